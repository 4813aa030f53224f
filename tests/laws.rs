//! Laws on random soups with coordinates from few values, so that every degeneracy occurs.

mod common;

use common::{check_repaired, check_with, is_closed_mod_2, surfaces, together, topology_of, volume};
use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use zmend::geom::Frame;
use zmend::mesh::TriangleSource;
use zmend::progress::Silent;
use zmend::sign::{close, parity_signs, scan};
use zmend::{Mesh, Surface, repair};

/// Values that lie on planes of every grid over 0 .. 16, beside them by next to nothing, and anywhere.
const VALUES: [f64; 12] = [2.0, 3.0, 4.0, 8.0, 8.0 + 1e-9, 9.0, 11.0, 12.0, 14.0, 2.5, 7.000_3, 10.123_456_789];

fn point() -> impl Strategy<Value = DVec3> {
    let value = || prop::sample::select(&VALUES[..]);
    (value(), value(), value()).prop_map(DVec3::from)
}

/// Triangles over a few points.
fn soup() -> impl Strategy<Value = Mesh> {
    prop::collection::vec(point(), 3..24).prop_flat_map(|points| {
        let n = points.len() as u32;
        prop::collection::vec([0..n, 0..n, 0..n], 1..41)
            .prop_map(move |faces| Mesh { points: points.clone(), faces: faces.iter().map(|f| &f[..]).collect() })
    })
}

/// A frame whose grid holds [`VALUES`] exactly from depth 4 on.
fn frame(depth: u32) -> Frame {
    Frame::new(DVec3::ZERO, 16.0, depth).expect("a frame")
}

/// The same cases on every run, unless `ZMEND_LAWS_SEED` gives another seed; `PROPTEST_CASES` asks for more or fewer than 400.
fn config() -> ProptestConfig {
    let seed = std::env::var("ZMEND_LAWS_SEED").ok().map_or(1, |s| s.parse().expect("ZMEND_LAWS_SEED is a number"));
    let cases = std::env::var("PROPTEST_CASES").ok().map_or(400, |s| s.parse().expect("PROPTEST_CASES is a number"));
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(seed), failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    /// All surfaces of any soup are closed, lie in the grid, have the same topology, and say why if they are empty.
    #[test]
    fn any_soup_is_repaired(mesh in soup(), depth in 3u32..=6) {
        let mut first = None;
        for (mode, options) in surfaces(depth) {
            let repaired = repair(mesh.clone(), &options).expect("repairable");
            // Sharp vertices of a solid that is thinner than its cells may pass each other and turn it inside out: by less than a cell.
            let least = -repaired.report.frame.cell_size().powi(3);
            let topology = if options.surface == Surface::DualContouring && !options.no_self_intersections {
                check_with(&repaired, |mesh| {
                    let topology = topology_of(mesh)?;
                    let volume = volume(mesh);
                    let enough = volume >= least * topology.components as f64;
                    if enough { Ok(topology) } else { Err(format!("volume {volume}")) }
                })
            } else {
                check_repaired(&repaired)
            };
            prop_assert!(topology.is_ok(), "{} at depth {}: {:?}", mode, depth, topology);
            prop_assert_eq!(first.get_or_insert_with(|| topology.clone()), &topology, "{} at depth {}", mode, depth);
        }
    }

    /// In a frame that holds all points exactly, closing leaves no odd face, and signs agree with crossings.
    #[test]
    fn any_scan_is_closed(mesh in soup(), depth in 3u32..=6) {
        let scan = scan(&mut mesh.clone(), &frame(depth), true, &Silent).expect("scanned");
        prop_assert_eq!(scan.crossings.validate(), Ok(()));
        prop_assert_eq!(scan.counts.skipped_triangles, 0);
        if is_closed_mod_2(&mesh) {
            prop_assert_eq!(scan.crossings.odd_faces(), vec![]);
        }
        let (closed, _) = close(scan.crossings, &Silent).expect("closed");
        prop_assert_eq!(closed.validate(), Ok(()));
        prop_assert_eq!(closed.odd_faces(), vec![]);
        let octree = parity_signs(closed);
        prop_assert_eq!(octree.validate(), Ok(()));
        let volume = octree.volume();
        prop_assert!((0.0..=8f64.powi(depth as i32)).contains(&volume), "{volume}");
    }

    /// A soup and its reverse are closed, whatever else they are.
    #[test]
    fn a_soup_with_its_reverse_is_closed(mesh in soup(), depth in 3u32..=6) {
        let reversed = |face: &[u32]| face.iter().rev().copied().collect::<Vec<u32>>();
        let faces: Vec<Vec<u32>> = mesh.faces.iter().map(reversed).collect();
        let back = Mesh { points: mesh.points.clone(), faces: faces.iter().map(Vec::as_slice).collect() };
        let scan = scan(&mut together(&[mesh, back]), &frame(depth), true, &Silent).expect("scanned");
        prop_assert_eq!(scan.crossings.validate(), Ok(()));
        prop_assert_eq!(scan.crossings.odd_faces(), vec![]);
    }

    /// Random tetrahedra, flat ones and such with common faces among them, are closed in any position.
    #[test]
    fn sums_of_tetrahedra_are_closed(corners in prop::collection::vec([point(), point(), point(), point()], 1..10), depth in 3u32..=6) {
        let faces: [&[u32]; 4] = [&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]];
        let parts: Vec<Mesh> =
            corners.iter().map(|c| Mesh { points: c.to_vec(), faces: faces.into_iter().collect() }).collect();
        let mut mesh = together(&parts);
        let bounds = mesh.bounds().expect("sound");
        for frame in [frame(depth), Frame::fit(&bounds, depth, 0.9).expect("a frame")] {
            let scan = scan(&mut mesh, &frame, true, &Silent).expect("scanned");
            prop_assert_eq!(scan.crossings.odd_faces(), vec![]);
        }
    }
}
