//! Hulls, gaps and walls for sheets.

mod common;

use common::shapes::{boxed, soup, triangle, unit_cube};
use common::{Chance, check, check_repaired, together, volume, with_faces, with_points};
use glam::{DMat3, DVec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::PI;
use zmend::geom::Frame;
use zmend::mesh::{TriangleSource, sample};
use zmend::octree::SignedOctree;
use zmend::progress::Silent;
use zmend::repair::Warning;
use zmend::sign::{hull, hull_with_gap, scan_oriented};
use zmend::{Inside, Keep, Mesh, Options, Repaired, Surface, Thicken, repair};

const SURFACES: [Surface; 2] = [Surface::MarchingCubes, Surface::DualContouring];

fn mended(mesh: &Mesh, options: &Options) -> Repaired {
    let repaired = repair(mesh.clone(), options).expect("repairable");
    check(&repaired.mesh).expect("closed, manifold, oriented");
    repaired
}

/// A turn about no axis of the grid.
fn turned(mesh: &Mesh) -> Mesh {
    let turn = DMat3::from_rotation_x(0.4) * DMat3::from_rotation_z(0.7);
    with_points(mesh, |p| turn * p)
}

fn square(corners: [[f64; 3]; 4]) -> [[DVec3; 3]; 2] {
    let [a, b, c, d] = corners.map(DVec3::from);
    [[a, b, c], [a, c, d]]
}

/// What is within r of a flat convex sheet (Steiner 1840).
fn wall_volume(area: f64, perimeter: f64, r: f64) -> f64 {
    2.0 * r * area + 0.5 * PI * r * r * perimeter + 4.0 / 3.0 * PI * r.powi(3)
}

#[test]
fn sheets_vanish_with_a_warning_and_stay_with_a_width() {
    let corners = [DVec3::ZERO, DVec3::new(1.0, 0.1, 0.2), DVec3::new(0.1, 0.9, 0.4)];
    let area = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
    let perimeter = (0..3).map(|i| corners[i].distance(corners[(i + 1) % 3])).sum();
    let plate = turned(&soup(square([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.6, 0.0], [0.0, 0.6, 0.0]])));
    for (mesh, area, perimeter) in [(triangle(corners), area, perimeter), (plate, 0.6, 3.2)] {
        for inside in [Inside::Auto, Inside::Parity, Inside::Hull] {
            let options = Options { depth: 6, inside, ..Options::default() };
            let gone = mended(&mesh, &options);
            assert!(gone.mesh.faces.is_empty());
            let vanished = gone.report.warnings.iter().any(|w| matches!(w, Warning::FacesVanished(n) if *n > 90));
            assert!(vanished, "{inside:?}: {:?}", gone.report.warnings);
        }
        for surface in SURFACES {
            let options = Options { depth: 6, surface, ..Options::default() };
            let cell = mended(&mesh, &options).report.frame.cell_size();
            for cells in [2.5, 4.0, 9.0] {
                let width = cells * cell;
                let wall = mended(&mesh, &Options { thicken: Some(width), ..options });
                let expected = wall_volume(area, perimeter, 0.5 * width);
                let found = volume(&wall.mesh);
                assert!((found / expected - 1.0).abs() < 0.02, "{surface:?}, {cells} cells: {found}, not {expected}");
                assert_eq!(check(&wall.mesh).expect("sound").components, 1);
                assert!(!wall.report.warnings.iter().any(|w| matches!(w, Warning::FacesVanished(_))));
            }
        }
    }
}

/// With 4 cells and more a wall is area by width, within 5 percent, its round rim apart.
#[test]
fn a_bowl_and_a_leaf_that_overlaps_itself_get_walls() {
    let ball = sample::build("sphere", 2).expect("a sample");
    let bowl = with_faces(&ball, ball.faces.iter().filter(|f| f.iter().all(|&i| ball.points[i as usize].z < 0.1)));
    let area: f64 = bowl
        .faces
        .iter()
        .map(|f| {
            let [a, b, c] = [0, 1, 2].map(|i| bowl.points[f[i] as usize]);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let options = Options { depth: 6, inside: Inside::Hull, ..Options::default() };
    let cell = mended(&bowl, &options).report.frame.cell_size();
    let width = 5.0 * cell;
    let wall = mended(&bowl, &Options { thicken: Some(width), ..options });
    let radius = ball.points[0].length();
    let rim = 2.0 * PI * radius * PI * (0.5 * width).powi(2) / 2.0;
    let expected = area * width + rim;
    assert!((volume(&wall.mesh) / expected - 1.0).abs() < 0.05, "{} {expected}", volume(&wall.mesh));
    // The leaf: two squares of which the second lies half over the first, two cells above it: one solid.
    let leaf = soup(
        [
            square([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]),
            square([[0.5, 0.0, 0.03], [1.5, 0.0, 0.03], [1.5, 1.0, 0.03], [0.5, 1.0, 0.03]]),
        ]
        .concat(),
    );
    for what in [Thicken::Sheets, Thicken::All] {
        let wall = mended(
            &turned(&leaf),
            &Options { depth: 6, inside: Inside::Hull, thicken: Some(0.12), thicken_what: what, ..Options::default() },
        );
        // The overlap, 0.5 by 1, is 0.15 thick, the rest 0.12; and the rims.
        let flat = 0.12 + 0.5 * 0.15;
        let rim = 0.5 * PI * 0.06 * 0.06 * 5.0;
        assert!((volume(&wall.mesh) / (flat + rim) - 1.0).abs() < 0.05, "{} {}", volume(&wall.mesh), flat + rim);
        assert_eq!(check(&wall.mesh).expect("sound").components, 1);
    }
}

/// A cube with a fin: the fin gets a wall that reaches the cube, the cube none.
#[test]
fn solids_are_left_alone() {
    let cube = boxed(DVec3::ZERO, DVec3::ONE, false);
    let fin = soup(square([[1.0, 0.2, 0.4], [2.0, 0.2, 0.4], [2.0, 0.8, 0.4], [1.0, 0.8, 0.4]]));
    let mesh = turned(&together(&[cube.clone(), fin]));
    for surface in SURFACES {
        let options = Options { depth: 7, surface, inside: Inside::Parity, ..Options::default() };
        let alone = mended(&mesh, &options);
        let width = 4.0 * alone.report.frame.cell_size();
        let both = mended(&mesh, &Options { thicken: Some(width), ..options });
        let wall = wall_volume(0.6, 3.2, 0.5 * width) - 0.5 * PI * (0.5 * width).powi(2) * 0.6;
        let found = volume(&both.mesh) - volume(&alone.mesh);
        assert!((found / wall - 1.0).abs() < 0.05, "{surface:?}: {found}, not {wall}");
        assert_eq!(check(&both.mesh).expect("sound").components, 1, "{surface:?}: the wall reaches the cube");
        // Of a clean solid nothing is lost, sharp edges included.
        let part = sample::build("part", 1).expect("a sample");
        let options = Options { depth: 6, surface, thicken: Some(0.3), ..Options::default() };
        let plain = mended(&part, &options);
        let thick = mended(&part, &Options { thicken_what: Thicken::All, ..options });
        let truth = volume(&part);
        assert!((volume(&plain.mesh) / truth - 1.0).abs() < 0.02, "{} {truth}", volume(&plain.mesh));
        assert!(volume(&thick.mesh) > truth * 1.1);
    }
}

/// Triangles that pass between all lattice lines have walls nevertheless.
#[test]
fn dust_gets_walls() {
    let frame = Frame::new(DVec3::ZERO, 32.0, 5).expect("a frame");
    let speck = |at: DVec3| [at, at + DVec3::new(0.2, 0.0, 0.1), at + DVec3::new(0.0, 0.2, 0.1)];
    let specks = (0..9).map(|i| speck(DVec3::new(4.3 + 3.0 * f64::from(i), 8.4, 20.3)));
    let mesh = soup(specks.chain([speck(DVec3::splat(1.3)), speck(DVec3::splat(29.3))]));
    let hits = scan_oriented(&mut mesh.clone(), &frame, false, &Silent).expect("in memory").hits;
    assert_eq!(hits.len(), 0, "the specks hit nothing");
    let options = Options { depth: 6, thicken: Some(1.6), ..Options::default() };
    let walls = mended(&mesh, &options);
    assert_eq!(check(&walls.mesh).expect("sound").components, 11);
}

#[test]
fn widths_that_the_grid_cannot_show_name_the_depth() {
    let plate = sample::build("plate", 1).expect("a sample");
    let cell = mended(&plate, &Options { depth: 6, ..Options::default() }).report.frame.cell_size();
    let message = |options: Options| repair(plate.clone(), &options).unwrap_err().to_string();
    let thin = Options { depth: 6, thicken: Some(0.6 * cell), ..Options::default() };
    assert!(message(thin).contains("take depth 8"), "{}", message(thin));
    assert!(repair(plate.clone(), &Options { depth: 8, ..thin }).is_ok());
    let thick = Options { depth: 12, thicken: Some(10.0 * cell), ..Options::default() };
    assert!(message(thick).contains("take depth 9"), "{}", message(thick));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(message(Options { thicken: Some(bad), ..Options::default() }).starts_with("thicken"), "{bad}");
        let gap = Options { gap: Some(bad), inside: Inside::Hull, ..Options::default() };
        assert!(message(gap).starts_with("gap"), "{bad}");
    }
    assert!(message(Options { gap: Some(1.0), ..Options::default() }).contains("--inside hull"));
}

/// The six sides of a cube, each so much smaller all round.
fn cube_with_gaps(inset: f64) -> Mesh {
    let (a, b) = (inset, 1.0 - inset);
    let mut sides = Vec::new();
    for axis in 0..3 {
        for w in [0.0, 1.0] {
            let corner = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (w, u, v);
                p
            };
            sides.extend(square([corner(a, a), corner(b, a), corner(b, b), corner(a, b)]));
        }
    }
    soup(sides)
}

#[test]
fn gaps_are_closed_up_to_their_width() {
    for surface in SURFACES {
        let cell = 1.0 / 0.9 / 64.0;
        // The sides of neighbouring faces are 3 cells apart.
        let mesh = cube_with_gaps(3.0 * cell / 2f64.sqrt());
        for mesh in [mesh.clone(), turned(&mesh)] {
            let open = Options { depth: 6, surface, inside: Inside::Hull, ..Options::default() };
            assert!(volume(&mended(&mesh, &open).mesh) < 0.05);
            let closed = mended(&mesh, &Options { gap: Some(4.0 * cell), ..open });
            let found = volume(&closed.mesh);
            assert!((0.96..1.005).contains(&found), "{surface:?}: {found}");
            assert_eq!(check(&closed.mesh).expect("sound").components, 1);
            let too_narrow = mended(&mesh, &Options { gap: Some(1.0 * cell), ..open });
            assert!(volume(&too_narrow.mesh) < 0.1);
        }
    }
}

/// Closing does not touch what a ball can roll over: convex solids stay as they are, whichever way their faces look.
#[test]
fn flat_and_convex_faces_stay_where_they_are() {
    let mut random = Chance(7);
    for mesh in [turned(&unit_cube()), sample::build("sphere", 1).expect("a sample")] {
        let flipped: Vec<Vec<u32>> = mesh
            .faces
            .iter()
            .map(|f| if random.below(2) == 0 { f.to_vec() } else { f.iter().rev().copied().collect() })
            .collect();
        let flipped = with_faces(&mesh, flipped.iter().map(|f| &f[..]));
        let options = Options { depth: 6, inside: Inside::Hull, ..Options::default() };
        let plain = mended(&flipped, &options);
        assert!((volume(&plain.mesh) / volume(&mesh) - 1.0).abs() < 0.01);
        let cell = plain.report.frame.cell_size();
        for cells in [0.8, 3.0, 8.0] {
            let closed = mended(&flipped, &Options { gap: Some(cells * cell), ..options });
            let ratio = volume(&closed.mesh) / volume(&mesh);
            assert!((ratio - 1.0).abs() < 0.015, "{cells}: {ratio}");
        }
    }
}

/// Overlaps, shells within shells and sheets inside: the hull is the outer shell.
#[test]
fn what_is_inside_does_not_count() {
    let boxes = together(&[
        boxed(DVec3::ZERO, DVec3::splat(2.0), false),
        boxed(DVec3::splat(1.0), DVec3::splat(3.0), true),
        boxed(DVec3::splat(0.5), DVec3::splat(0.7), true),
        soup(square([[0.2, 0.2, 1.0], [1.8, 0.2, 1.0], [1.8, 1.8, 1.0], [0.2, 1.8, 1.0]])),
    ]);
    for surface in SURFACES {
        let options = Options { depth: 7, surface, inside: Inside::Hull, ..Options::default() };
        let found = mended(&turned(&boxes), &options);
        assert!((volume(&found.mesh) / 15.0 - 1.0).abs() < 0.01, "{}", volume(&found.mesh));
        assert_eq!(check(&found.mesh).expect("sound").components, 1);
    }
}

#[test]
fn loose_bits_go() {
    let parts = [
        boxed(DVec3::ZERO, DVec3::splat(3.0), false),
        boxed(DVec3::splat(1.0), DVec3::splat(2.0), true),
        boxed(DVec3::new(4.0, 0.0, 0.0), DVec3::new(4.5, 0.5, 0.5), false),
        boxed(DVec3::new(4.0, 2.0, 0.0), DVec3::new(4.2, 2.2, 0.2), false),
    ];
    let mesh = together(&parts);
    for (keep, drop_cavities, components, expected) in [
        (Keep::All, false, 4, 26.0 + 0.125 + 0.008),
        (Keep::Largest, false, 2, 26.0),
        (Keep::Largest, true, 1, 27.0),
        (Keep::Count(2), false, 3, 26.125),
        (Keep::Ratio(0.01), true, 2, 27.125),
    ] {
        for surface in SURFACES {
            let options =
                Options { depth: 7, surface, keep, drop_cavities, inside: Inside::Parity, ..Options::default() };
            let repaired = mended(&mesh, &options);
            assert_eq!(check_repaired(&repaired).expect("sound").components, components, "{keep:?}");
            assert!((volume(&repaired.mesh) / expected - 1.0).abs() < 0.01, "{keep:?} {surface:?}");
        }
    }
}

/// Outside by a walk over all lattice points along edges without hits.
fn flood(side: usize, is_closed: impl Fn([u32; 3], usize) -> bool) -> Vec<bool> {
    let n = side + 1;
    let index = |p: [u32; 3]| (p[0] as usize * n + p[1] as usize) * n + p[2] as usize;
    let mut outside = vec![false; n.pow(3)];
    let mut pending = vec![[0; 3]];
    while let Some(p) = pending.pop() {
        if std::mem::replace(&mut outside[index(p)], true) {
            continue;
        }
        for axis in 0..3 {
            let mut step = p;
            if p[axis] < side as u32 && !is_closed(p, axis) {
                step[axis] += 1;
                pending.push(step);
            }
            step = p;
            if p[axis] > 0 {
                step[axis] -= 1;
                if !is_closed(step, axis) {
                    pending.push(step);
                }
            }
        }
    }
    outside
}

fn soups() -> impl Strategy<Value = Mesh> {
    let corner = || (2.0f64..30.0, 2.0f64..30.0, 2.0f64..30.0).prop_map(DVec3::from);
    let boxes = prop::collection::vec((corner(), corner()), 0..3);
    let faces = prop::collection::vec([corner(), corner(), corner()], 0..24);
    (boxes, faces, 0usize..4).prop_map(|(boxes, faces, missing)| {
        let mut parts: Vec<Mesh> = boxes.into_iter().map(|(a, b)| boxed(a.min(b), a.max(b), false)).collect();
        parts.push(soup(faces));
        let all = together(&parts);
        with_faces(&all, all.faces.iter().skip(missing))
    })
}

fn config() -> ProptestConfig {
    ProptestConfig { cases: 24, rng_seed: RngSeed::Fixed(2), failure_persistence: None, ..ProptestConfig::default() }
}

fn point(i: usize, side: usize) -> [u32; 3] {
    let n = side + 1;
    [i / n / n, i / n % n, i % n].map(|c| c as u32)
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_hull_is_what_a_dense_flood_leaves(mut mesh in soups(), depth in 4u32..6) {
        let frame = Frame::new(DVec3::ZERO, 32.0, depth).expect("a frame");
        let scan = scan_oriented(&mut mesh, &frame, true, &Silent).expect("in memory");
        let octree: SignedOctree = hull(&scan.hits, &Silent).expect("in memory");
        prop_assert_eq!(octree.validate(), Ok(()));
        let side = 1usize << depth;
        let closed = |p: [u32; 3], axis: usize| {
            let axis = zmend::grid::Axis::ALL[axis];
            scan.hits.edges().is_crossed(zmend::octree::crossings::finest_element(depth, p, axis.into()))
        };
        for (i, outside) in flood(side, closed).into_iter().enumerate() {
            let p = point(i, side);
            prop_assert_eq!(octree.is_inside(p), !outside, "{:?}", p);
        }
    }

    /// With a gap: never less than without, and never nearer to infinity than the ball comes.
    #[test]
    fn closing_gaps_only_adds(mut mesh in soups(), gap in 0.7f64..9.0) {
        let depth = 5;
        let frame = Frame::new(DVec3::splat(-16.0), 64.0, depth + 1).expect("a frame");
        let scan = scan_oriented(&mut mesh, &frame, true, &Silent).expect("in memory");
        let plain = hull(&scan.hits, &Silent).expect("in memory");
        let closed = hull_with_gap(&scan.hits, &mut mesh, &frame, gap, &Silent).expect("in memory");
        prop_assert_eq!(closed.validate(), Ok(()));
        let bounds = mesh.bounds().expect("in memory");
        for i in 0..65usize.pow(3) {
            let p = point(i, 64);
            prop_assert!(closed.is_inside(p) || !plain.is_inside(p), "{:?} was inside", p);
            if closed.is_inside(p) {
                let p = DVec3::from(p.map(f64::from)) - 16.0;
                let beyond = (bounds.min - p).max(p - bounds.max).max_element();
                prop_assert!(beyond < 0.3, "{:?} is beyond all faces by {}", p, beyond);
            }
        }
    }

    #[test]
    fn any_soup_with_any_choice_is_closed(mesh in soups(), gap in 1.0f64..6.0, thicken in 2.2f64..6.0, all: bool, drop_cavities: bool) {
        let thicken_what = if all { Thicken::All } else { Thicken::Sheets };
        for (inside, gap) in [(Inside::Parity, None), (Inside::Hull, Some(gap)), (Inside::Hull, None)] {
            for surface in SURFACES {
                let options = Options {
                    depth: 5, surface, inside, gap, thicken: Some(thicken), thicken_what, keep: Keep::Ratio(0.1), drop_cavities, ..Options::default()
                };
                mended(&mesh, &options);
            }
        }
    }
}

#[test]
fn threads_make_no_difference() {
    let mesh = sample::build("gear", 1).expect("a sample");
    let options = Options {
        depth: 6,
        inside: Inside::Hull,
        gap: Some(0.2),
        thicken: Some(0.25),
        keep: Keep::Largest,
        drop_cavities: true,
        surface: Surface::DualContouring,
        ..Options::default()
    };
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| mended(&mesh, &options).mesh)
    };
    let one = by(1);
    assert!(!one.faces.is_empty());
    assert_eq!(by(4), one);
}
