//! Analysis and healing of every mesh of the data, against a naive computation; and the program's commands for both.

mod common;

use assert_cmd::Command;
use common::{data, files, name};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use zmend::mesh::{EdgeKey, HealOptions, MeshKind, Topology, sample};
use zmend::progress::Silent;
use zmend::{Mesh, io};

/// Every mesh of the data that can be read and has at most so many faces.
fn meshes(most_faces: usize) -> Vec<(String, Mesh)> {
    let Some(data) = data() else { return Vec::new() };
    let read = files(&data).into_iter().filter_map(|path| Some((name(&path), io::read(&path).ok()?)));
    read.filter(|(_, mesh)| mesh.faces.len() <= most_faces).collect()
}

/// Faces that use each edge, with the way they run.
type Edges = BTreeMap<EdgeKey, Vec<(u32, bool)>>;

fn sides(face: &[u32]) -> impl Iterator<Item = (u32, u32)> + '_ {
    (0..face.len()).map(|k| (face[k], face[(k + 1) % face.len()])).filter(|(a, b)| a != b)
}

fn edges(mesh: &Mesh) -> Edges {
    let mut edges = Edges::new();
    for (face, i) in mesh.faces.iter().zip(0..) {
        if face.len() >= 3 && face.iter().all(|&v| (v as usize) < mesh.points.len()) {
            sides(face).for_each(|(a, b)| edges.entry(EdgeKey::new(a, b)).or_default().push((i, a < b)));
        }
    }
    edges
}

/// Number of fans at each point: the corners there, joined by common edges until nothing changes.
fn has_bow_tie(mesh: &Mesh) -> bool {
    let mut corners: BTreeMap<u32, Vec<BTreeSet<u32>>> = BTreeMap::new();
    for face in mesh.faces.iter().filter(|f| f.len() >= 3 && f.iter().all(|&v| (v as usize) < mesh.points.len())) {
        for k in 0..face.len() {
            let ends = [face[(k + face.len() - 1) % face.len()], face[(k + 1) % face.len()]];
            let ends: BTreeSet<u32> = ends.into_iter().filter(|&end| end != face[k]).collect();
            if !ends.is_empty() {
                corners.entry(face[k]).or_default().push(ends);
            }
        }
    }
    corners.into_values().any(|mut fans| {
        let mut i = 0;
        while i < fans.len() {
            match (i + 1..fans.len()).find(|&j| !fans[i].is_disjoint(&fans[j])) {
                Some(j) => {
                    let other = fans.swap_remove(j);
                    fans[i].extend(other);
                }
                None => i += 1,
            }
        }
        fans.len() > 1
    })
}

fn naive_kind(mesh: &Mesh, edges: &Edges) -> MeshKind {
    let any = |test: fn(&[(u32, bool)]) -> bool| edges.values().any(|users| test(users));
    let exists = |&v: &u32| (v as usize) < mesh.points.len();
    let is_sound = |face: &[u32]| face.len() >= 3 && face.iter().all(exists);
    let twice = |face: &[u32]| face.iter().collect::<BTreeSet<_>>().len() < face.len();
    let mut cycles = BTreeSet::new();
    let has_duplicates = mesh.faces.iter().filter(|face| is_sound(face) && !twice(face)).any(|face| {
        let least = (0..face.len()).min_by_key(|&k| face[k]).expect("a corner");
        let mut cycle = [&face[least..], &face[..least]].concat();
        if cycle[1] > cycle[cycle.len() - 1] {
            cycle[1..].reverse();
        }
        !cycles.insert(cycle)
    });
    MeshKind {
        is_empty: !mesh.faces.iter().any(is_sound),
        is_open: any(|users| users.len() == 1),
        has_non_manifold_edges: any(|users| users.len() > 2),
        has_bow_ties: has_bow_tie(mesh),
        is_inconsistent: any(|users| users.len() == 2 && users[0].1 == users[1].1),
        is_one_sided: !is_orientable(mesh, edges),
        has_degenerate_faces: mesh.faces.iter().any(|face| !is_sound(face) || twice(face)),
        has_duplicates,
    }
}

/// Colours faces two ways from neighbour to neighbour.
fn is_orientable(mesh: &Mesh, edges: &Edges) -> bool {
    let mut links: Vec<Vec<(u32, bool)>> = vec![Vec::new(); mesh.faces.len()];
    for users in edges.values() {
        if let [(f, up), (g, other)] = users[..]
            && f != g
        {
            links[f as usize].push((g, up == other));
            links[g as usize].push((f, up == other));
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; mesh.faces.len()];
    (0..mesh.faces.len()).all(|seed| {
        if turned[seed].is_some() {
            return true;
        }
        turned[seed] = Some(false);
        let mut waiting = vec![seed];
        while let Some(face) = waiting.pop() {
            let here = turned[face].expect("seen");
            for &(other, turns) in &links[face] {
                match turned[other as usize] {
                    None => {
                        turned[other as usize] = Some(here != turns);
                        waiting.push(other as usize);
                    }
                    Some(there) if there != (here != turns) => return false,
                    Some(_) => {}
                }
            }
        }
        true
    })
}

#[test]
fn analysis_of_the_data_agrees_with_a_naive_one() {
    let meshes = meshes(60_000);
    for (name, mesh) in &meshes {
        let edges = edges(mesh);
        let topology = Topology::new(mesh);
        let mut found = Edges::new();
        for side in topology.edges() {
            let users = topology.users(side).map(|s| (topology.face(s), topology.ends(s)[0] < topology.ends(s)[1]));
            found.insert(topology.key(side), users.collect());
        }
        assert!(found == edges, "{name}");
        let diagnosis = topology.diagnose();
        assert_eq!(diagnosis.kind, naive_kind(mesh, &edges), "{name}");
        let rims = diagnosis.loops.iter().map(|rim| rim.sides.len()).sum::<usize>();
        assert_eq!(rims, edges.values().filter(|users| users.len() == 1).count(), "{name}");
    }
    println!("{} meshes", meshes.len());
}

#[test]
fn healing_the_data_makes_nothing_worse() {
    let meshes = meshes(12_000);
    let (mut clean, mut healed_whole, mut better) = (0, 0, 0);
    for (name, mesh) in &meshes {
        let healed = mesh.heal(&HealOptions::default(), &Silent).expect("nobody cancels");
        assert!(!healed.after.is_worse_than(&healed.before), "{name}: {healed:?}");
        if healed.before.is_none() && mesh.outward() {
            clean += 1;
            // Not a number is not equal to itself, and a clean mesh has none.
            assert!(healed.mesh == *mesh, "{name}");
        } else if healed.after.is_none() {
            healed_whole += 1;
        } else if healed.after != healed.before {
            better += 1;
        }
    }
    println!("{} meshes: {clean} clean, {healed_whole} healed, {better} better", meshes.len());
    assert!(meshes.is_empty() || (clean > 10 && healed_whole > 5));
}

/// Runs the program in a directory.
fn run(directory: &Path, arguments: &str) -> String {
    let mut command = Command::cargo_bin("zmend").expect("built");
    let output = command.current_dir(directory).args(arguments.split_whitespace()).output().expect("run");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{arguments}: {text}{}", String::from_utf8_lossy(&output.stderr));
    text
}

#[test]
fn the_program_heals_converts_and_finds_features() {
    let folder = tempfile::tempdir().expect("a directory");
    let at = folder.path();
    for (sample, file) in [("knot-holes", "holes.ply"), ("part", "part.obj"), ("cube", "cube.off")] {
        io::write(at.join(file), &sample::build(sample, 1).expect("a sample"), io::WriteOptions::default())
            .expect("written");
    }
    let told = run(at, "heal holes.ply healed.ply");
    assert!(told.contains("healed: closed, manifold, oriented") && told.contains("boundary edges"), "{told}");
    assert_eq!(io::read(at.join("healed.ply")).expect("a mesh").validate(), Ok(()));
    let json: Value = serde_json::from_str(&run(at, "heal holes.ply again.ply --json --max-hole 0")).expect("JSON");
    assert_eq!((json["before"]["holes"].as_u64(), json["after"]["holes"].as_u64()), (Some(7), Some(7)));
    assert_eq!(json["after"]["self_intersections"].as_u64(), Some(0));

    // A clean mesh is written byte for byte as it would be converted, polygons and all.
    for format in ["ply", "obj", "off", "stl", "glb", "3mf"] {
        for input in ["part.obj", "cube.off"] {
            run(at, &format!("heal {input} a.{format} --force"));
            run(at, &format!("convert {input} b.{format} --force"));
            let [a, b] = ["a", "b"].map(|name| std::fs::read(at.join(format!("{name}.{format}"))).expect("written"));
            assert!(a == b, "{input} as {format}");
        }
    }
    let cube = io::read(at.join("b.off")).expect("a mesh");
    assert_eq!((cube.faces.len(), cube.faces.get(0).len()), (6, 4));

    let told = run(at, "features part.obj lines.obj --angle 40");
    assert!(told.contains("folds outwards"), "{told}");
    let lines = std::fs::read_to_string(at.join("lines.obj")).expect("written");
    assert!(lines.lines().filter(|line| line.starts_with("l ")).count() >= 4);
    let json: Value = serde_json::from_str(&run(at, "features cube.off lines.ply --json")).expect("JSON");
    assert_eq!((json["kinds"][0]["edges"].as_u64(), json["kinds"][0]["length"].as_f64()), (Some(12), Some(12.0)));

    let told = run(at, "info holes.ply");
    assert!(told.contains("a rim of ") && told.contains("kind"), "{told}");
    let json: Value = serde_json::from_str(&run(at, "info holes.ply --json")).expect("JSON");
    assert_eq!((json["rims"].as_u64(), json["orientable"].as_bool()), (Some(7), Some(true)));
}
