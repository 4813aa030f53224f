//! The main job on every real mesh there is: whatever can be read is repaired to closed, manifold, oriented surfaces.
//!
//! `ZMEND_SWEEP_DEPTHS="6,7,8,9" ZMEND_SWEEP_RULES="auto,parity,winding,hull" cargo test --release --test pipeline -- --nocapture` sweeps
//! at other depths than 6 and 7, and by other rules of inside than `auto`. With `ZMEND_SWEEP_INTERSECTIONS=1` it looks for
//! self-intersections where there must be none, too. A solid that an earlier rule gave already is not extracted again.

mod common;

use common::{Topology, check_repaired, data, files, name, surfaces};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use zmend::progress::Silent;
use zmend::{Faces, Inside, Mesh, Options, RepairReport, Repaired, Solid, Surface, io, repair, solidify};

/// What came of one file.
#[derive(Default)]
struct Outcome {
    repairs: usize,
    /// As many as would have been repairs, if another rule had not given the same solid.
    repeated: usize,
    empties: usize,
    refused: Option<String>,
    failures: Vec<String>,
    took: Duration,
}

fn depths() -> Vec<u32> {
    let list = std::env::var("ZMEND_SWEEP_DEPTHS").unwrap_or_else(|_| "6,7".to_owned());
    list.split(',').map(|d| d.trim().parse().expect("ZMEND_SWEEP_DEPTHS lists depths: 6,7,8")).collect()
}

fn rules() -> Vec<Inside> {
    let list = std::env::var("ZMEND_SWEEP_RULES").unwrap_or_else(|_| "auto".to_owned());
    let rule = |name: &str| match name.trim() {
        "auto" => Inside::Auto,
        "parity" => Inside::Parity,
        "winding" => Inside::Winding,
        "hull" => Inside::Hull,
        other => panic!("ZMEND_SWEEP_RULES lists rules: auto,parity,winding,hull; not {other}"),
    };
    list.split(',').map(rule).collect()
}

fn looks_for_intersections() -> bool {
    std::env::var_os("ZMEND_SWEEP_INTERSECTIONS").is_some()
}

fn sweep(path: &Path, depths: &[u32], rules: &[Inside]) -> Outcome {
    let start = Instant::now();
    let mut outcome = Outcome::default();
    match io::read(path) {
        Err(error) => outcome.refused = Some(error.to_string()),
        Ok(mesh) => depths.iter().for_each(|&depth| {
            let mut solids = Vec::new();
            rules.iter().for_each(|&inside| sweep_mesh(&name(path), &mesh, depth, inside, &mut solids, &mut outcome));
        }),
    }
    outcome.took = start.elapsed();
    outcome
}

/// Repairs by marching cubes; the other surfaces are extracted from one and the same solid, which is added to those of the rules before.
fn sweep_mesh(name: &str, mesh: &Mesh, depth: u32, inside: Inside, solids: &mut Vec<Solid>, outcome: &mut Outcome) {
    let mut first: Option<Topology> = None;
    let with_normals = Options { depth, inside, surface: Surface::DualContouring, ..Options::default() };
    let solid = solidify(&mut mesh.clone(), &with_normals, &Silent);
    if solid.as_ref().is_ok_and(|(solid, _)| solids.contains(solid)) {
        outcome.repeated += surfaces(depth).len();
        return;
    }
    for (mode, options) in surfaces(depth) {
        let mode = format!("{mode} by {inside:?}");
        let options = Options { inside, ..options };
        let repaired = match (&solid, options.surface) {
            (Ok((solid, report)), surface) if surface != Surface::MarchingCubes => extracted(solid, report, &options),
            _ => repair(mesh.clone(), &options),
        };
        let repaired = match repaired {
            Ok(repaired) => repaired,
            Err(error) => {
                outcome.failures.push(format!("{name} depth {depth} {mode}: refused: {error}"));
                continue;
            }
        };
        outcome.repairs += 1;
        outcome.empties += usize::from(repaired.mesh.faces.is_empty());
        match check_repaired(&repaired) {
            Ok(topology) if *first.get_or_insert(topology) == topology => {}
            Ok(topology) => {
                outcome.failures.push(format!("{name} depth {depth} {mode}: {topology:?}, but mc has {first:?}"));
            }
            Err(problem) => outcome.failures.push(format!("{name} depth {depth} {mode}: {problem}")),
        }
        if looks_for_intersections() && (options.surface == Surface::MarchingCubes || options.no_self_intersections) {
            let pairs = repaired.mesh.self_intersections().len();
            if pairs > 0 {
                outcome.failures.push(format!("{name} depth {depth} {mode}: {pairs} pairs of faces meet"));
            }
        }
    }
    solids.extend(solid.map(|(solid, _)| solid));
}

/// A surface of a solid, as `repair` would give it.
fn extracted(solid: &Solid, report: &RepairReport, options: &Options) -> zmend::Result<Repaired> {
    let mut mesh = Mesh::default();
    let sizes = solid.extract(options, &mut mesh, &Silent)?;
    Ok(Repaired { mesh, report: RepairReport { sizes, ..report.clone() } })
}

/// Files that hold no mesh. Everything else must be read.
const NOT_MESHES: &[&str] = &[
    "assimp/invalid.off",
    "assimp/issue623.ply",
    "assimp-invalid/OutOfMemory.off",
    "assimp-invalid/empty.off",
    "assimp-invalid/malformed.obj",
];

#[test]
fn every_mesh_is_repaired() {
    sweep_all(&depths(), &rules());
}

/// By every rule of inside, in every mode.
#[test]
fn every_mesh_is_repaired_by_every_rule() {
    sweep_all(&[5], &[Inside::Parity, Inside::Winding, Inside::Hull]);
}

/// Seen from outside through its skin, this model has two solid points at depth 9, each with a surface of a quarter of a cell. Vertices of
/// all eight cells round such a point went where their planes meet, past it and each other, and the volume came out negative.
#[test]
fn tips_smaller_than_a_cell_are_not_turned_inside_out() {
    let Some(data) = data() else { return };
    let mesh = io::read(data.join("cgal/pig.stl")).expect("a mesh");
    let options = Options { inside: Inside::Hull, ..common::options(9, Surface::DualContouring, Faces::Auto) };
    let topology = check_repaired(&repair(mesh, &options).expect("repairable")).expect("right side out");
    assert_eq!(topology, Topology::new(2, 0), "two tips");
}

fn sweep_all(depths: &[u32], rules: &[Inside]) {
    let Some(data) = data() else { return };
    let files = files(&data);
    let start = Instant::now();
    // Sweeps that somebody asks for take long, and say how far they are.
    let is_asked_for = std::env::var_os("ZMEND_SWEEP_DEPTHS").is_some();
    let told = |path: &PathBuf| {
        let outcome = sweep(path, depths, rules);
        if is_asked_for {
            let Outcome { repairs, repeated, took, .. } = outcome;
            println!("{}: {repairs} repairs, {repeated} repeated, in {:.1} s", name(path), took.as_secs_f64());
        }
        outcome
    };
    let outcomes: Vec<Outcome> = files.par_iter().map(told).collect();
    let sum = |count: fn(&Outcome) -> usize| outcomes.iter().map(count).sum::<usize>();
    let refused: Vec<String> =
        files.iter().zip(&outcomes).filter(|(_, o)| o.refused.is_some()).map(|(path, _)| name(path)).collect();
    println!(
        "sweep: {} files, {} repairs and {} of the same solids at depths {depths:?} by {rules:?} in {} modes, {} empty; {} files refused; {:.1} s",
        files.len(),
        sum(|o| o.repairs),
        sum(|o| o.repeated),
        surfaces(3).len(),
        sum(|o| o.empties),
        refused.len(),
        start.elapsed().as_secs_f64()
    );
    for (path, outcome) in files.iter().zip(&outcomes) {
        if let Some(error) = &outcome.refused {
            println!("refused: {error}");
            assert!(error.contains(&*path.file_name().expect("a file").to_string_lossy()), "{error} names the file");
        }
        if outcome.empties > 0 {
            println!("empty: {} in {} of {}", name(path), outcome.empties, outcome.repairs);
        }
        if outcome.took > Duration::from_secs(5) {
            println!("slow: {} took {:.1} s", name(path), outcome.took.as_secs_f64());
        }
    }
    let failures: Vec<&String> = outcomes.iter().flat_map(|o| &o.failures).collect();
    assert!(failures.is_empty(), "{} failures:\n{failures:#?}", failures.len());
    assert_eq!(refused, NOT_MESHES);
    assert!(
        sum(|o| o.repairs + o.repeated) >= 100 * depths.len() * rules.len() * surfaces(3).len(),
        "the data are all there"
    );
}
