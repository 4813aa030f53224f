//! Rules of inside and outside: what `auto` takes and why, and what each rule makes of what PolyMender cannot do.

mod common;

use common::shapes::{boxed, unit_cube};
use common::{Chance, Topology, check_repaired, options, together, volume, with_faces, with_points};
use glam::{DMat3, DVec3};
use zmend::mesh::sample;
use zmend::repair::{Keep, Reason, Warning};
use zmend::{Faces, Inside, Mesh, Options, Repaired, Surface, repair};

fn build(name: &str) -> Mesh {
    sample::build(name, 1).expect("a sample")
}

fn with(mesh: &Mesh, depth: u32, inside: Inside, surface: Surface) -> Repaired {
    let options = Options { inside, ..options(depth, surface, Faces::Auto) };
    repair(mesh.clone(), &options).expect("repairable")
}

/// Repairs by marching cubes and checks.
fn by(what: &str, mesh: &Mesh, depth: u32, inside: Inside) -> (Topology, Repaired) {
    let repaired = with(mesh, depth, inside, Surface::MarchingCubes);
    let topology = check_repaired(&repaired).unwrap_or_else(|e| panic!("{what}, {inside:?}: {e}"));
    (topology, repaired)
}

fn turned(mesh: &Mesh) -> Mesh {
    let faces: Vec<Vec<u32>> = mesh.faces.iter().map(|face| face.iter().rev().copied().collect()).collect();
    with_faces(mesh, faces.iter().map(Vec::as_slice))
}

/// A third of the faces are missing, here and there.
fn sieve(mesh: &Mesh) -> Mesh {
    let mut chance = Chance(5);
    with_faces(mesh, mesh.faces.iter().filter(|_| chance.below(3) > 0))
}

#[test]
fn auto_says_what_it_took_and_why() {
    let cube = unit_cube();
    let shifted = with_points(&cube, |p| DMat3::from_rotation_x(0.2) * p + DVec3::splat(0.4));
    let apart = with_points(&cube, |p| p + DVec3::new(2.0, 0.1, 0.2));
    let mut chance = Chance(3);
    let some_turned: Vec<Vec<u32>> = build("knot")
        .faces
        .iter()
        .map(|f| if chance.below(9) == 0 { f.iter().rev().copied().collect() } else { f.to_vec() })
        .collect();
    let some_turned = with_faces(&build("knot"), some_turned.iter().map(Vec::as_slice));
    let inner = with_points(&build("sphere"), |p| 0.4 * p);
    let cases = [
        ("sphere", build("sphere"), Inside::Parity, Reason::Sound),
        ("part", build("part"), Inside::Parity, Reason::Sound),
        ("cavities", build("nested"), Inside::Parity, Reason::Sound),
        ("sphere turned", turned(&build("sphere")), Inside::Parity, Reason::Sound),
        ("one of two turned", together(&[cube.clone(), turned(&apart)]), Inside::Parity, Reason::Sound),
        ("two that overlap", together(&[cube.clone(), shifted]), Inside::Winding, Reason::Overlaps),
        ("one in the other", together(&[build("sphere"), inner.clone()]), Inside::Winding, Reason::Overlaps),
        ("a cavity", together(&[build("sphere"), turned(&inner)]), Inside::Parity, Reason::Sound),
        ("some faces turned", some_turned.clone(), Inside::Parity, Reason::Turned),
        ("doubled", build("doubled"), Inside::Parity, Reason::Turned),
        ("sieve", sieve(&build("sphere")), Inside::Winding, Reason::Open),
        ("holes", build("knot-holes"), Inside::Winding, Reason::Open),
        (
            "some turned, some missing",
            with_faces(&some_turned, some_turned.faces.iter().skip(9)),
            Inside::Parity,
            Reason::OpenAndTurned,
        ),
        ("plate", build("plate"), Inside::Parity, Reason::Sheet),
    ];
    for (what, mesh, rule, reason) in cases {
        let (_, repaired) = by(what, &mesh, 6, Inside::Auto);
        let choice = repaired.report.inside;
        assert_eq!((choice.rule, choice.reason), (rule, reason), "{what}");
        assert!(!choice.reason.to_string().is_empty());
        let asked = by(what, &mesh, 6, rule).1;
        assert_eq!(asked.report.inside.reason, Reason::Asked);
        assert!(asked.mesh == repaired.mesh, "{what}: auto is not the rule that it took");
    }
}

/// Where a surface is closed, oriented and does not overlap itself, rules give the same bytes.
#[test]
fn sound_surfaces_are_the_same_by_all_rules() {
    for sound in ["sphere", "torus", "knot", "part", "noisy", "nested", "cube"] {
        for surface in [Surface::MarchingCubes, Surface::DualContouring] {
            let parity = with(&build(sound), 6, Inside::Parity, surface);
            let winding = with(&build(sound), 6, Inside::Winding, surface);
            let reversed = with(&turned(&build(sound)), 6, Inside::Winding, surface);
            assert!(parity.mesh == winding.mesh, "{sound} {surface:?}");
            assert!(parity.mesh == reversed.mesh, "{sound} turned {surface:?}");
        }
    }
}

/// PolyMender: overlaps become cavities, in 37 to 46 rings.
#[test]
fn overlapping_solids_become_one() {
    let askew = DMat3::from_rotation_z(0.5) * DMat3::from_rotation_x(0.3);
    let three = together(&[
        build("sphere"),
        with_points(&unit_cube(), |p| askew * p),
        with_points(&build("sphere"), |p| 0.6 * p + DVec3::new(0.8, 0.2, 0.1)),
    ]);
    for depth in [6, 7] {
        let (topology, union) = by("three", &three, depth, Inside::Auto);
        assert_eq!(topology, Topology::new(1, 0));
        assert!(union.report.volume > 1.02 * volume(&build("sphere")), "{}", union.report.volume);
        let (_, parity) = by("three", &three, depth, Inside::Parity);
        assert!(parity.report.volume < 0.95 * union.report.volume);
    }
    // Boxes with a common wall, and a box within a box: volumes of unions are known.
    let inner = boxed(DVec3::splat(0.25), DVec3::splat(0.75), false);
    let beside = boxed(DVec3::new(0.5, 0.1, 0.2), DVec3::new(1.5, 0.9, 0.7), false);
    for (what, mesh, expected) in [
        ("within", together(&[unit_cube(), inner.clone()]), 1.0),
        ("twice", together(&[unit_cube(), unit_cube()]), 1.0),
        ("a cavity", together(&[unit_cube(), turned(&inner)]), 1.0 - 0.125),
        ("half out", together(&[unit_cube(), beside]), 1.0 + 0.5 * 0.8 * 0.5),
    ] {
        let (_, repaired) = by(what, &with_points(&mesh, |p| askew * p), 7, Inside::Winding);
        let result = volume(&repaired.mesh);
        assert!((result / expected - 1.0).abs() < 0.01, "{what}: {result}, not {expected}");
    }
}

/// PolyMender: 3.66 at depth 6, 0.01 at depth 8.
#[test]
fn a_sphere_with_a_third_of_its_faces_missing_keeps_its_volume() {
    let open = sieve(&build("sphere"));
    for depth in [6, 7, 8] {
        let (_, repaired) = by("sieve", &open, depth, Inside::Winding);
        let result = volume(&repaired.mesh);
        assert!((result / volume(&build("sphere")) - 1.0).abs() < 0.02, "depth {depth}: {result}");
        let reversed = by("sieve turned", &turned(&open), depth, Inside::Winding).1;
        assert!(reversed.mesh == repaired.mesh && reversed.report.inside.reversed, "depth {depth}");
    }
}

#[test]
fn a_sphere_with_a_third_of_its_faces_missing_stays_in_one_piece() {
    for depth in [6, 7, 8] {
        let (_, repaired) = by("sieve", &sieve(&build("sphere")), depth, Inside::Winding);
        // What comes loose lies behind faces whose neighbours are all missing.
        let options = Options {
            inside: Inside::Winding,
            keep: Keep::Largest,
            ..options(depth, Surface::MarchingCubes, Faces::Auto)
        };
        let largest = repair(sieve(&build("sphere")), &options).expect("repairable");
        assert_eq!(check_repaired(&largest).map(|topology| topology.components), Ok(1));
        assert!(volume(&largest.mesh) > 0.9999 * volume(&repaired.mesh), "depth {depth}");
    }
}

/// The hole of a ball is closed by a smooth cap between its rim and its chord, and dual contouring finds no crease in it.
#[test]
fn big_holes_close_smoothly() {
    let ball = sample::build("sphere", 2).expect("a sample");
    let cap = DVec3::new(0.3, 0.4, 0.85).normalize();
    let middle = |face: &[u32]| face.iter().map(|&i| ball.points[i as usize]).sum::<DVec3>() / face.len() as f64;
    for height in [0.3, 0.7] {
        let open = with_faces(&ball, ball.faces.iter().filter(|face| middle(face).dot(cap) < height));
        for surface in [Surface::MarchingCubes, Surface::DualContouring] {
            let repaired = with(&open, 7, Inside::Winding, surface);
            assert_eq!(check_repaired(&repaired), Ok(Topology::new(1, 0)), "{height} {surface:?}");
            // Ball without cap.
            let least = std::f64::consts::PI * (2.0 / 3.0 + height - height.powi(3) / 3.0);
            let result = volume(&repaired.mesh);
            assert!((0.97 * least..1.02 * volume(&ball)).contains(&result), "{height} {surface:?}: {result}");
            // In the hole no face is far from level: the angle of a cap there is small.
            let normals = repaired.mesh.faces.iter().filter_map(|face| {
                let corners: Vec<DVec3> = face.iter().map(|&i| repaired.mesh.points[i as usize]).collect();
                let within = corners
                    .iter()
                    .all(|p| p.reject_from(cap).length() < 0.6 * (1.0 - height * height).sqrt() && p.dot(cap) > 0.0);
                let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                (within && normal.length() > 1e-7).then(|| normal.normalize().dot(cap))
            });
            let (steep, all) = normals.fold((0, 0), |(steep, all), level| (steep + usize::from(level < 0.8), all + 1));
            assert!(all > 100 && 20 * steep < all, "{height} {surface:?}: {steep} of {all} faces are steep");
        }
    }
}

/// An open box that touches the grid's boundary nearly, a half space: what is inside stays in the grid.
#[test]
fn what_runs_out_of_the_grid_is_clipped() {
    let mut floor = Mesh { points: Vec::new(), ..Mesh::default() };
    // A dish: a ball's lower part, open at the top, which fills the grid.
    let ball = build("sphere");
    floor.points.clone_from(&ball.points);
    let low = |face: &&[u32]| face.iter().all(|&i| ball.points[i as usize].z < 0.2);
    let dish = with_faces(&floor, ball.faces.iter().filter(low));
    for scale in [0.5, 0.9, 0.99, 1.0 - 1e-5] {
        for inside in [Inside::Auto, Inside::Winding] {
            let options = Options { scale, inside, ..options(6, Surface::MarchingCubes, Faces::Auto) };
            let repaired = repair(dish.clone(), &options).expect("repairable");
            let topology = check_repaired(&repaired).expect("a solid");
            assert_eq!(topology, Topology::new(1, 0), "scale {scale} {inside:?}: {:?}", repaired.report.warnings);
        }
    }
    // A cube without its lid runs over, and ten of them so far that whole bricks at the boundary are inside.
    let cube = unit_cube();
    let lidless = |face: &&[u32]| !face.iter().all(|&i| cube.points[i as usize].z == 1.0);
    for (cubes, depth, scale) in [(1, 5, 0.9), (10, 5, 0.9), (10, 7, 0.5), (10, 8, 0.9), (100, 8, 0.5)] {
        let faces = (0..cubes).flat_map(|_| cube.faces.iter().filter(lidless));
        let options = Options { scale, inside: Inside::Winding, ..options(depth, Surface::MarchingCubes, Faces::Auto) };
        let repaired = repair(with_faces(&cube, faces), &options).expect("repairable");
        assert_eq!(check_repaired(&repaired).expect("a solid"), Topology::new(1, 0));
        let clipped = repaired.report.warnings.iter().find_map(|warning| match warning {
            Warning::Clipped(points) => Some(*points),
            _ => None,
        });
        assert_eq!(clipped.is_some(), cubes > 1, "{cubes} cubes: {clipped:?}");
    }
}
