//! Analysis and healing of every mesh of the data, against a naive computation; and the program's commands for both.

mod common;

use assert_cmd::Command;
use common::{data, files, name};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use zmend::glam::DVec3;
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

/// Fans beyond the first at all points: the corners there, joined by common edges until nothing changes.
fn extra_fans(mesh: &Mesh) -> usize {
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
    let extra = corners.into_values().map(|mut fans| {
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
        fans.len() - 1
    });
    extra.sum()
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
        has_bow_ties: extra_fans(mesh) > 0,
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

/// Number of classes of `0 .. n` that links between them leave.
fn classes(n: usize, links: impl Iterator<Item = (usize, usize)>) -> usize {
    let mut others = vec![Vec::new(); n];
    for (a, b) in links {
        others[a].push(b);
        others[b].push(a);
    }
    let mut is_seen = vec![false; n];
    let mut count = 0;
    for seed in 0..n {
        let mut waiting = if is_seen[seed] { Vec::new() } else { vec![seed] };
        count += waiting.len();
        while let Some(here) = waiting.pop() {
            if !std::mem::replace(&mut is_seen[here], true) {
                waiting.append(&mut others[here]);
            }
        }
    }
    count
}

/// Counts and measures again, from a map of edges: components, pieces of the rim, Euler characteristic, genus, area and volume.
fn check_measures(name: &str, mesh: &Mesh, edges: &Edges) {
    let report = mesh.report();
    let exists = |&v: &u32| (v as usize) < mesh.points.len();
    let is_sound = |face: &&[u32]| face.len() >= 3 && face.iter().all(exists);
    let sound: Vec<&[u32]> = mesh.faces.iter().filter(is_sound).collect();
    let lost = mesh.faces.len() - sound.len();
    // Faces that are not sound are classes of their own.
    let links = edges.values().flat_map(|users| users.windows(2).map(|two| (two[0].0 as usize, two[1].0 as usize)));
    let components = classes(mesh.faces.len(), links) - lost;
    assert_eq!(report.components, components as u64, "{name}");
    let rim: Vec<[u32; 2]> = edges.iter().filter(|(_, users)| users.len() == 1).map(|(key, _)| key.ends()).collect();
    let on_rim: BTreeSet<u32> = rim.iter().flatten().copied().collect();
    let inner = mesh.points.len() - on_rim.len();
    let pieces = classes(mesh.points.len(), rim.iter().map(|&[a, b]| (a as usize, b as usize))) - inner;
    assert_eq!(report.boundary_loops, pieces as u64, "{name}");
    let used: BTreeSet<u32> = sound.iter().flat_map(|face| face.iter().copied()).collect();
    let euler = used.len() as i64 - edges.len() as i64 + sound.len() as i64;
    assert_eq!((report.euler, report.isolated_points), (euler, (mesh.points.len() - used.len()) as u64), "{name}");
    let is_surface = edges.values().all(|users| users.len() == 2 && users[0].1 != users[1].1)
        && lost == 0
        && sound.iter().all(|face| face.iter().collect::<BTreeSet<_>>().len() == face.len());
    let genus = (2 * components as i64 - euler - extra_fans(mesh) as i64) / 2;
    assert_eq!(report.genus, is_surface.then_some(genus), "{name}");
    // Fans of triangles from the first corner for areas, from the middle for volumes.
    let (mut area, mut volume) = (0.0, 0.0);
    let center = report.bounds.center();
    for face in &sound {
        let corners: Vec<DVec3> = face.iter().map(|&v| mesh.points[v as usize] - center).collect();
        if !corners.iter().all(|p| p.is_finite()) {
            continue;
        }
        let normal = |k: usize| (corners[k - 1] - corners[0]).cross(corners[k] - corners[0]);
        area += 0.5 * (2..corners.len()).map(normal).sum::<DVec3>().length();
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let tip = |k: usize| middle.dot(corners[k].cross(corners[(k + 1) % corners.len()]));
        volume += (0..corners.len()).map(tip).sum::<f64>() / 6.0;
    }
    let alike = |found: f64, expected: f64, unit: f64| (found - expected).abs() <= 1e-9 * unit;
    assert!(alike(report.area, area, area), "{name}: area {} is {area}", report.area);
    let size = report.bounds.extent().length();
    let is_closed = report.boundary_edges == 0;
    assert!(
        !is_closed || sound.is_empty() || alike(report.volume, volume, size * area),
        "{name}: volume {} is {volume}",
        report.volume
    );
}

#[test]
fn analysis_of_the_data_agrees_with_a_naive_one() {
    let meshes = meshes(usize::MAX);
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
        // Chains that touch are one piece of the rim, so there are as many chains or more.
        assert!(diagnosis.loops.len() as u64 >= mesh.report().boundary_loops, "{name}");
        let length: f64 = diagnosis.loops.iter().map(|rim| rim.length).sum();
        let at = |v: u32| mesh.points[v as usize];
        let rim = edges.iter().filter(|(_, users)| users.len() == 1);
        let expected: f64 = rim.map(|(key, _)| at(key.ends()[0]).distance(at(key.ends()[1]))).sum();
        assert!(!expected.is_finite() || (length - expected).abs() <= 1e-9 * expected, "{name}: {length} {expected}");
        check_measures(name, mesh, &edges);
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

    // What is good stays, what is not is made anew.
    let two = {
        let mut two = sample::build("knot-holes", 1).expect("a sample");
        let ball = sample::build("sphere", 1).expect("a sample");
        let n = two.points.len() as u32;
        two.points.extend(ball.points.iter().map(|p| *p + DVec3::new(0.0, 0.0, 9.0)));
        ball.faces.iter().for_each(|f| two.faces.push(&f.iter().map(|v| v + n).collect::<Vec<_>>()));
        two
    };
    io::write(at.join("two.ply"), &two, io::WriteOptions::default()).expect("written");
    let json: Value =
        serde_json::from_str(&run(at, "repair two.ply kept.ply --keep-good --depth 6 --json")).expect("JSON");
    assert_eq!((json["components"]["all"].as_u64(), json["components"]["kept"].as_u64()), (Some(2), Some(2)));
    assert_eq!(json["output"]["verdict"].as_str(), Some("closed, manifold, oriented: a solid"), "{json}");
    let told = run(at, "repair holes.ply kept.obj --keep-good --depth 6");
    assert!(told.contains("1 of 1 component kept") && told.contains("holes were filled"), "{told}");
    let mut command = Command::cargo_bin("zmend").expect("built");
    let refused =
        command.current_dir(at).args("repair two.ply no.ply --keep-good --cut 1".split(' ')).assert().failure();
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("cut and fill"));

    let told = run(at, "info holes.ply");
    assert!(told.contains("a rim of ") && told.contains("kind"), "{told}");
    let json: Value = serde_json::from_str(&run(at, "info holes.ply --json")).expect("JSON");
    assert_eq!((json["rims"].as_u64(), json["orientable"].as_bool()), (Some(7), Some(true)));
}
