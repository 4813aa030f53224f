//! Oracles: solid angles of the triangles, unions of solids, jumps added up face by face.

use super::span::solid_angle;
use super::*;
use crate::geom::Frame;
use crate::geom::raster::FineTriangle;
use crate::grid::{Axis, Key};
use crate::mesh::{Mesh, TriangleSource, sample};
use crate::octree::crossings::{finest_element, lattice_point};
use crate::octree::hits::{EdgeHit, OrientedHits};
use crate::progress::Silent;
use crate::sign::{close, parity_signs, scan, scan_oriented};
use glam::DVec3;
use proptest::prelude::*;
use rayon::prelude::*;
use std::collections::BTreeMap;

fn hits_of(mesh: &Mesh, depth: u32) -> (OrientedHits, Frame) {
    let bounds = (&*mesh).bounds().expect("in memory");
    let frame = Frame::fit(&bounds, depth, 0.8).expect("a frame");
    let hits = scan_oriented(&mut &*mesh, &frame, true, &Silent).expect("scanned").hits;
    assert_eq!(hits.validate(), Ok(()));
    (hits, frame)
}

fn patches_of(mesh: &Mesh, frame: &Frame) -> Patches {
    let boundary = Boundary::of(&mut &*mesh, frame, 0, &Silent).expect("in memory");
    Patches::new(&boundary, frame.depth(), 0, &Silent).expect("not cancelled")
}

fn solve(mesh: &Mesh, depth: u32) -> (Winding, Frame) {
    let (hits, frame) = hits_of(mesh, depth);
    let patches = patches_of(mesh, &frame);
    let winding = winding_signs(&hits, &patches, &Silent).expect("not cancelled");
    assert_eq!(winding.octree.validate(), Ok(()));
    (winding, frame)
}

fn triangles(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    let mut all = Vec::new();
    (&mut &*mesh)
        .triangles(&mut |batch| {
            all.extend_from_slice(batch);
            Ok(())
        })
        .expect("in memory");
    all
}

/// Faces of a mesh that pass a test, by number and middle.
fn some_faces(mesh: &Mesh, keep: impl Fn(usize, DVec3) -> bool) -> Mesh {
    let middle = |face: &[u32]| face.iter().map(|&i| mesh.points[i as usize]).sum::<DVec3>() / face.len() as f64;
    let faces = mesh.faces.iter().enumerate().filter(|(i, face)| keep(*i, middle(face))).map(|(_, face)| face);
    Mesh { points: mesh.points.clone(), faces: faces.collect() }
}

/// A number that looks random.
fn scrambled(i: usize) -> u64 {
    let z = (i as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb) >> 32
}

/// A third of the faces are missing, here and there.
fn sieve(mesh: &Mesh) -> Mesh {
    some_faces(mesh, |i, _| !scrambled(i).is_multiple_of(3))
}

/// The net jump of every edge that has one.
fn jumps_of(hits: &OrientedHits) -> BTreeMap<Key, i32> {
    let mut jumps = BTreeMap::new();
    for brick in hits.edges().bricks().iter() {
        let origin = hits.edges().origin(brick);
        hits.for_edges(brick, |axis, local, of_edge| {
            let c = local.coords();
            let edge = finest_element(hits.edges().depth(), std::array::from_fn(|a| origin[a] + c[a]), axis.into());
            jumps.insert(edge, of_edge.iter().copied().map(EdgeHit::jump).sum());
        });
    }
    jumps.retain(|_, jump| *jump != 0);
    jumps
}

/// Circulations by adding up round every face beside a jump.
fn plain_circulations(jumps: &BTreeMap<Key, i32>) -> Vec<Circulation> {
    let mut found = BTreeMap::new();
    for face in jumps.keys().flat_map(|edge| edge.coboundary()) {
        let axis = face.dir().complement().axes().next().expect("a face has a normal");
        let [u, v] = axis.others();
        let side = |along: Axis, across: Axis, high: bool| {
            let edges = face.boundary().filter(|e| e.dir() == along.into());
            let mut edges: Vec<Key> = edges.collect();
            edges.sort_unstable_by_key(|e| e.center()[across.index()]);
            jumps.get(&edges[usize::from(high)]).copied().unwrap_or(0)
        };
        let strength = side(u, v, false) + side(v, u, true) - side(u, v, true) - side(v, u, false);
        if strength != 0 {
            found.insert(face, strength);
        }
    }
    found.into_iter().map(|(face, strength)| Circulation { face, strength }).collect()
}

fn soup(corners: &[[f64; 3]]) -> Mesh {
    let points: Vec<DVec3> = corners.iter().map(|&p| DVec3::from(p)).collect();
    let faces: Vec<[u32; 3]> = (0..points.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh { points, faces: faces.iter().map(|f| &f[..]).collect() }
}

/// Hits and patches together have no circulation.
fn assert_spanned(mesh: &Mesh, depth: u32) {
    let (hits, frame) = hits_of(mesh, depth);
    let mut jumps = jumps_of(&hits);
    assert!(circulations(&hits, &Silent).expect("not cancelled") == plain_circulations(&jumps));
    let patches = patches_of(mesh, &frame);
    for (edge, jump) in jumps_of(patches.hits()) {
        *jumps.entry(edge).or_insert(0) += if patches.reversed() { -jump } else { jump };
    }
    jumps.retain(|_, jump| *jump != 0);
    assert!(plain_circulations(&jumps).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// Whatever the soup, circulations are those of a plain count, patches take them away, and signs are consistent.
    #[test]
    fn any_soup_is_spanned_and_signed(corners in prop::collection::vec(prop::array::uniform3(0.0..1.0), 3..60)) {
        let mesh = soup(&corners[..corners.len() / 3 * 3]);
        assert_spanned(&mesh, 4);
        let (winding, _) = solve(&mesh, 4);
        prop_assert!(winding.octree.crossings().odd_faces().is_empty());
    }

    /// The union of balls is what any of them holds, even if some are turned inside out; without overlap it is the same as parity.
    #[test]
    fn overlapping_solids_become_their_union(balls in prop::collection::vec((prop::array::uniform3(0.0..2.0), 0.2..0.8f64), 1..5), turned in any::<bool>()) {
        let ball = sample::build("sphere", 1).expect("a sample");
        let mut mesh = Mesh::default();
        for (centre, radius) in &balls {
            let first = mesh.points.len() as u32;
            let bounds = (&ball).bounds().expect("in memory");
            let scale = 2.0 * radius / bounds.extent().max_element();
            mesh.points.extend(ball.points.iter().map(|p| DVec3::from(*centre) + (*p - bounds.center()) * scale));
            for face in ball.faces.iter() {
                let mut face: Vec<u32> = face.iter().map(|i| i + first).collect();
                if turned {
                    face.reverse();
                }
                mesh.faces.push(&face);
            }
        }
        let (hits, frame) = hits_of(&mesh, 5);
        prop_assert_eq!(circulations(&hits, &Silent).expect("not cancelled"), []);
        let numbers = WholeNumbers::new(&hits);
        let (overlap, single) = (numbers.overlap(), hits.are_single());
        let octree = numbers.into_octree(hits, &Silent).expect("not cancelled");
        prop_assert_eq!(octree.validate(), Ok(()));
        if !overlap {
            let parity = scan(&mut &mesh, &frame, true, &Silent).expect("scanned").crossings;
            let parity = parity_signs(close(parity, &Silent).expect("not cancelled").0);
            prop_assert_eq!(parity.inside(), octree.inside());
            // Of several hits of an edge, between two balls, each rule has its own choice.
            prop_assert!(!single || parity.crossings().offsets().iter().eq(octree.crossings().offsets().iter()));
        }
        for i in 0..33u32.pow(3) {
            let at = [i / 33 / 33, i / 33 % 33, i % 33];
            let p = frame.to_model(DVec3::from(at.map(f64::from)));
            let depth = balls.iter().map(|(c, r)| (p.distance(DVec3::from(*c)) - r) / frame.cell_size()).fold(f64::INFINITY, f64::min);
            // The balls are polyhedra.
            if depth.abs() > 0.5 {
                prop_assert_eq!(octree.is_inside(at), depth < 0.0, "{:?} {}", at, depth);
            }
        }
    }
}

/// Inside is where the solid angles of the triangles come to more than one half: bowls, sieves, seams, holes, soups.
#[test]
fn signs_are_those_of_the_solid_angles() {
    let ball = sample::build("sphere", 1).expect("a sample");
    let bounds = (&ball).bounds().expect("in memory");
    let (centre, radius) = (bounds.center(), 0.5 * bounds.extent().x);
    let slanted = DVec3::new(0.3, 0.5, 0.8).normalize();
    let turned = |mesh: &Mesh, turn: &dyn Fn(DVec3) -> bool| {
        let faces: Vec<Vec<u32>> = mesh
            .faces
            .iter()
            .map(|f| {
                let middle = f.iter().map(|&i| mesh.points[i as usize]).sum::<DVec3>() / f.len() as f64;
                if turn(middle) { f.iter().rev().copied().collect() } else { f.to_vec() }
            })
            .collect();
        Mesh { points: mesh.points.clone(), faces: faces.iter().map(Vec::as_slice).collect() }
    };
    let cases = [
        ("bowl", some_faces(&ball, |_, p| (p - centre).dot(slanted) < 0.0)),
        ("cap", some_faces(&ball, |_, p| (p - centre).dot(slanted) < -0.5 * radius)),
        ("hole", some_faces(&ball, |_, p| (p - centre).dot(slanted) < 0.8 * radius)),
        ("half turned", turned(&ball, &|p| (p - centre).dot(slanted) < 0.0)),
        ("reversed hole", turned(&some_faces(&ball, |_, p| (p - centre).dot(slanted) < 0.8 * radius), &|_| true)),
        ("sieve", sieve(&ball)),
    ];
    for (name, mesh) in cases {
        check_signs(name, &mesh, 5);
    }
}

/// Winding numbers nearer to one half may come out on either side: errors of many chains add up.
const SURE: f64 = 2e-3;

/// Compares all lattice points with the triangles' solid angles, but for those where these are nearly one half.
fn check_signs(name: &str, mesh: &Mesh, depth: u32) {
    let (winding, frame) = solve(mesh, depth);
    let sign = if patches_of(mesh, &frame).reversed() { -1.0 } else { 1.0 };
    // Where the scan sees them: on a face itself, points are on the side to which they are moved.
    let snapped = |p| frame.snap(p).expect("in the root");
    let triangles: Vec<FineTriangle> = triangles(mesh).iter().map(|t| t.map(snapped)).collect();
    let side = 1u32 << depth;
    let wrong: Vec<([u32; 3], f64)> = (0..side.pow(3))
        .into_par_iter()
        .filter_map(|i| {
            let at = [i / side / side, i / side % side, i % side];
            let fine = at.map(|c| (c << frame.cell_shift()) as i32);
            let w = sign * triangles.iter().map(|t| solid_angle(t, fine)).sum::<f64>() / (4.0 * std::f64::consts::PI);
            let expected = w > 0.5 && !at.contains(&0);
            (winding.octree.is_inside(at) != expected && (w - 0.5).abs() > SURE).then_some((at, w))
        })
        .collect();
    assert!(wrong.is_empty(), "{name}: {} points, such as {:?}", wrong.len(), &wrong[..wrong.len().min(5)]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn signs_of_soups_are_those_of_the_solid_angles(corners in prop::collection::vec(prop::array::uniform3(0.0..1.0), 3..90), snap in any::<bool>()) {
        // On the lattice itself ties are everywhere.
        let snap = |p: [f64; 3]| if snap { p.map(|c| (c * 8.0).round() / 8.0) } else { p };
        let corners: Vec<[f64; 3]> = corners[..corners.len() / 3 * 3].iter().map(|&p| snap(p)).collect();
        check_signs("soup", &soup(&corners), 4);
    }
}

/// A ball keeps its volume at any depth when a third of its faces are missing, and comes out the same turned inside out.
#[test]
fn a_sieve_keeps_its_volume() {
    for detail in [1, 2] {
        let ball = sample::build("sphere", detail).expect("a sample");
        let open = sieve(&ball);
        for depth in 6..=8 {
            let (winding, frame) = solve(&open, depth);
            let volume = winding.octree.volume() * frame.cell_size().powi(3);
            let expected = ball.report().volume;
            println!(
                "detail {detail}, depth {depth}: volume {volume:.4}, of {expected:.4}: {:.2} %",
                100.0 * (volume / expected - 1.0)
            );
            assert!((volume / expected - 1.0).abs() < 0.02, "detail {detail}, depth {depth}: {volume}, not {expected}");
            assert_eq!(winding.clipped, 0);
        }
        let faces: Vec<Vec<u32>> = open.faces.iter().map(|f| f.iter().rev().copied().collect()).collect();
        let reversed = Mesh { points: open.points.clone(), faces: faces.iter().map(Vec::as_slice).collect() };
        let (a, b) = (solve(&open, 6).0, solve(&reversed, 6).0);
        let (a, b) = (a.octree, b.octree);
        let differ: u32 = a.inside().iter().zip(b.inside()).map(|(a, b)| (*a ^ *b).count()).sum();
        assert_eq!((a.inside().len(), differ), (b.inside().len(), 0));
    }
}

/// The lower half of a cube's surface and four times the like: nothing leaves the grid, and a wall inside vanishes.
#[test]
fn walls_inside_vanish() {
    let mut mesh = sample::build("cube", 4).expect("a sample");
    let first = mesh.points.len() as u32;
    mesh.points.extend([[0.3, 0.2, 0.2], [0.35, 0.8, 0.2], [0.4, 0.5, 0.8]].map(DVec3::from));
    let bounds = (&mesh).bounds().expect("in memory");
    let wall: Vec<DVec3> = mesh.points[first as usize..].iter().map(|p| bounds.min + *p * bounds.extent()).collect();
    mesh.points.truncate(first as usize);
    mesh.points.extend(wall);
    mesh.faces.push(&[first, first + 1, first + 2]);
    let (winding, frame) = solve(&mesh, 6);
    let volume = winding.octree.volume() * frame.cell_size().powi(3);
    assert!((volume / bounds.extent().element_product() - 1.0).abs() < 0.02, "{volume}");
    let crossings = winding.octree.crossings();
    for brick in crossings.bricks().iter() {
        let at = DVec3::from(lattice_point(6, brick.key).map(|c| f64::from(c) + 4.0));
        let depth = (frame.to_model(at) - bounds.center()).abs().max_element() / bounds.extent().x;
        assert!(depth > 0.5 - 16.0 / 51.0 || brick.count() == 0, "a wall at {at}");
    }
}

/// A sheet alone encloses nothing, whatever its size; nor does it come to anything beside a solid.
#[test]
fn flat_sheets_vanish() {
    let plate = sample::build("plate", 1).expect("a sample");
    let slanted = glam::DMat3::from_rotation_x(0.3) * glam::DMat3::from_rotation_y(0.4);
    for (name, turn) in [("straight", glam::DMat3::IDENTITY), ("slanted", slanted)] {
        let plate = Mesh { points: plate.points.iter().map(|&p| turn * p).collect(), faces: plate.faces.clone() };
        for depth in 5..=8 {
            let (winding, _) = solve(&plate, depth);
            assert_eq!((winding.octree.crossings().len(), winding.clipped), (0, 0), "{name}, depth {depth}");
        }
    }
}

/// The same bytes on any number of threads.
#[test]
fn threads_make_no_difference() {
    let open = sieve(&sample::build("torus", 1).expect("a sample"));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| solve(&open, 7).0.octree)
    };
    let (one, three) = (on(1), on(3));
    assert!(one.crossings().offsets().iter().eq(three.crossings().offsets().iter()));
    assert!(one.crossings().normals().iter().eq(three.crossings().normals().iter()));
    assert_eq!(one.inside(), three.inside());
}
