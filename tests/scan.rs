//! The tie rule: whatever the position of a closed surface, the scan leaves no odd face.

mod common;

use common::shapes::{boxed, unit_cube};
use common::{Chance, closed_meshes, data, is_closed_mod_2, together, with_faces, with_points};
use glam::{BVec3, DVec3};
use rayon::prelude::*;
use std::collections::BTreeSet;
use zmend::Mesh;
use zmend::geom::Frame;
use zmend::grid::{Extent, Key};
use zmend::mesh::{TriangleSource, sample};
use zmend::octree::Crossings;
use zmend::progress::Silent;
use zmend::sign::{Scan, scan, scan_oriented};

/// A frame round a mesh that leaves some cells on all sides.
fn frame_of(mesh: &Mesh, depth: u32) -> Frame {
    let bounds = (&*mesh).bounds().expect("a sound mesh");
    let extent = bounds.extent().max_element();
    assert!(extent > 0.0);
    Frame::new(bounds.center() - 0.625 * extent, 1.25 * extent, depth).expect("a frame")
}

fn scanned(mesh: &Mesh, frame: &Frame) -> Scan {
    scan(&mut &*mesh, frame, true, &Silent).expect("scanned")
}

/// The mesh with coordinates rounded to multiples of the frame's cell along the chosen axes.
fn snapped(mesh: &Mesh, frame: &Frame, axes: BVec3) -> Mesh {
    let cell = frame.cell_size();
    with_points(mesh, |p| {
        let q = frame.origin() + ((p - frame.origin()) / cell).round() * cell;
        DVec3::select(axes, q, p)
    })
}

/// Axes to snap along: vertices come to lie on planes, on edges, on points of the grid.
const SNAPS: [(&str, BVec3); 5] = [
    ("planes x", BVec3::new(true, false, false)),
    ("planes z", BVec3::new(false, false, true)),
    ("edges z", BVec3::new(true, true, false)),
    ("edges x", BVec3::new(false, true, true)),
    ("points", BVec3::TRUE),
];

/// What is wrong with the scan of a closed mesh; the number of crossings if nothing is.
fn try_scan(what: &str, mesh: &Mesh, frame: &Frame) -> Result<usize, String> {
    let scan = scanned(mesh, frame);
    scan.crossings.validate().map_err(|problem| format!("{what}: {problem}"))?;
    if scan.counts.skipped_triangles > 0 {
        return Err(format!("{what}: {} triangles skipped", scan.counts.skipped_triangles));
    }
    match scan.crossings.odd_faces().len() {
        0 => Ok(scan.crossings.len()),
        odd => Err(format!("{what}, depth {}: {odd} odd faces", frame.depth())),
    }
}

/// All positions of one mesh.
fn try_positions(name: &str, mesh: &Mesh, seeds: u64) -> Vec<Result<usize, String>> {
    let mut found = Vec::new();
    for depth in 5..=7 {
        let frame = frame_of(mesh, depth);
        found.push(try_scan(name, mesh, &frame));
        for (how, axes) in SNAPS {
            found.push(try_scan(&format!("{name} snapped to {how}"), &snapped(mesh, &frame, axes), &frame));
        }
        for seed in 0..seeds {
            let rotation = Chance(seed).rotation();
            let rotated = with_points(mesh, |p| rotation * p);
            let frame = frame_of(&rotated, depth);
            found.push(try_scan(&format!("{name} rotated by {seed}"), &rotated, &frame));
            let on_points = snapped(&rotated, &frame, BVec3::TRUE);
            found.push(try_scan(&format!("{name} rotated by {seed} and snapped"), &on_points, &frame));
        }
    }
    found
}

fn assert_all_even(what: &str, meshes: &[(String, Mesh)], seeds: u64) {
    let found: Vec<Result<usize, String>> =
        meshes.par_iter().flat_map_iter(|(name, mesh)| try_positions(name, mesh, seeds)).collect();
    let crossings: usize = found.iter().flatten().sum();
    println!("tie rule, {what}: {} closed meshes, {} scans, {crossings} crossings", meshes.len(), found.len());
    let failures: Vec<_> = found.iter().filter_map(|f| f.as_ref().err()).collect();
    assert!(failures.is_empty(), "{} failures: {failures:#?}", failures.len());
    assert!(crossings > 1000 * meshes.len(), "the scans are not empty");
}

#[test]
fn closed_data_have_no_odd_face_in_any_position() {
    let Some(data) = data() else { return };
    let meshes = closed_meshes(&data);
    println!("closed: {:?}", meshes.iter().map(|(name, _)| name).collect::<Vec<_>>());
    assert!(meshes.len() >= 40, "only {} meshes are closed", meshes.len());
    assert_all_even("data", &meshes, 3);
}

#[test]
fn closed_samples_have_no_odd_face_in_any_position() {
    let mut meshes: Vec<(String, Mesh)> = sample::names()
        .iter()
        .map(|(name, _)| ((*name).to_owned(), sample::build(name, 1).expect("a sample")))
        .filter(|(_, mesh)| is_closed_mod_2(mesh))
        .collect();
    assert!(meshes.len() >= 8, "only {} samples are closed", meshes.len());
    // Every face twice, or three times; solids that share a wall, an edge, a corner.
    let twice = |(name, mesh): &(String, Mesh)| (format!("twice {name}"), together(&[mesh.clone(), mesh.clone()]));
    meshes.extend(meshes.iter().map(twice).collect::<Vec<_>>());
    let cube = unit_cube();
    meshes.push(("cube three times".to_owned(), together(&[cube.clone(), cube.clone(), cube.clone()])));
    for (what, by) in [("wall", DVec3::X), ("edge", DVec3::new(1.0, 1.0, 0.0)), ("corner", DVec3::ONE)] {
        meshes.push((format!("cubes with a common {what}"), together(&[cube.clone(), boxed(by, by + 1.0, true)])));
    }
    assert_all_even("samples", &meshes, 3);
}

/// What can be odd is found to be odd: without a face, a closed mesh has odd faces, and as many as an obvious count finds.
#[test]
fn open_surfaces_have_the_odd_faces_that_a_plain_count_finds() {
    for name in ["sphere", "torus", "part", "knot-holes", "gear", "scan"] {
        let mesh = sample::build(name, 1).expect("a sample");
        let open = with_faces(&mesh, mesh.faces.iter().skip(mesh.faces.len() / 5));
        let scan = scanned(&open, &frame_of(&open, 6));
        let odd = scan.crossings.odd_faces();
        assert!(odd.len() > 20, "{name}: {} odd faces", odd.len());
        assert_eq!(odd, plain_odd_faces(&scan.crossings), "{name}");
    }
}

/// The odd faces by looking up each edge of each face beside each crossing.
fn plain_odd_faces(crossings: &Crossings) -> Vec<Key> {
    let mut faces = BTreeSet::new();
    for brick in crossings.bricks().iter() {
        let origin = crossings.origin(brick);
        for axis in zmend::grid::Axis::ALL {
            for local in brick.crossed[axis.index()].iter() {
                let c = local.coords();
                let at = std::array::from_fn(|a| origin[a] + c[a]);
                let edge = zmend::octree::crossings::finest_element(crossings.depth(), at, Extent::from(axis));
                assert!(crossings.is_crossed(edge));
                faces.extend(edge.coboundary());
            }
        }
    }
    let odd = |face: &Key| face.boundary().filter(|&edge| crossings.is_crossed(edge)).count() % 2 == 1;
    faces.into_iter().filter(odd).collect()
}

/// Everything about two lists of crossings.
fn assert_same(name: &str, a: &Crossings, b: &Crossings) {
    assert_eq!(a.bricks().len(), b.bricks().len(), "{name}");
    assert!(a.bricks().iter().eq(b.bricks().iter()), "{name}: bricks");
    assert!(a.offsets().iter().eq(b.offsets().iter()), "{name}: offsets");
    assert!(a.normals().iter().eq(b.normals().iter()), "{name}: normals");
}

/// Whoever keeps all hits knows what the parity is.
#[test]
fn oriented_hits_have_the_parity_of_the_plain_scan() {
    let mut several = 0;
    for (name, _) in sample::names() {
        let mesh = sample::build(name, 1).expect("a sample");
        for (depth, with_normals) in [(5, true), (7, false)] {
            let frame = Frame::fit(&(&mesh).bounds().expect("a sample"), depth, 0.9).expect("a frame");
            let plain = scan(&mut &mesh, &frame, with_normals, &Silent).expect("scanned");
            let oriented = scan_oriented(&mut &mesh, &frame, with_normals, &Silent).expect("scanned");
            assert_eq!(oriented.hits.validate(), Ok(()), "{name}");
            assert_eq!(oriented.hits.len() as u64, oriented.counts.hits, "{name}");
            several += oriented.hits.len() - oriented.hits.edges().len();
            let parity = oriented.parity(&Silent).unwrap();
            assert_eq!(parity.counts, plain.counts, "{name}");
            assert_same(name, &parity.crossings, &plain.crossings);
        }
    }
    assert!(several > 1000, "{several} hits share an edge");
}

/// Along a line through a solid that is oriented outward, hits enter and leave in turn; through its mirror image the other way round.
#[test]
fn hits_know_where_faces_are_turned() {
    let sphere = sample::build("sphere", 1).expect("a sample");
    let reversed = sphere.faces.iter().map(|face| face.iter().rev().copied().collect::<Vec<u32>>());
    let reversed: Vec<Vec<u32>> = reversed.collect();
    let mirrored = Mesh { points: sphere.points.clone(), faces: reversed.iter().map(Vec::as_slice).collect() };
    let frame = frame_of(&sphere, 6);
    for (mesh, outward) in [(&sphere, true), (&mirrored, false)] {
        let hits = scan_oriented(&mut &*mesh, &frame, false, &Silent).expect("scanned").hits;
        let mut checked = 0;
        for brick in hits.edges().bricks().iter() {
            let origin = hits.edges().origin(brick);
            hits.for_edges(brick, |axis, local, of_edge| {
                let past_middle = origin[axis.index()] + local.coords()[axis.index()] >= 32;
                let [hit] = of_edge else { panic!("a ball is thick") };
                assert_eq!(hit.leaves == outward, past_middle, "axis {axis:?} at {:?} of {origin:?}", local.coords());
                assert_eq!(hit.jump(), if hit.leaves { -1 } else { 1 });
                checked += 1;
            });
        }
        assert_eq!(checked, hits.len());
        assert!(checked > 1000);
    }
}
