use super::*;
use crate::mesh::{Mesh, sample};
use crate::progress::Silent;
use proptest::prelude::*;

/// The distance of a point to a mesh, by all triangles.
fn distance(triangles: &[[DVec3; 3]], p: DVec3) -> f64 {
    let of = |&[a, b, c]: &[DVec3; 3]| {
        let n = (b - a).cross(c - a);
        let inside = [(a, b), (b, c), (c, a)].iter().all(|&(s, t)| (t - s).cross(p - s).dot(n) >= 0.0);
        if inside && n.length_squared() > 0.0 {
            return n.dot(p - a).abs() / n.length();
        }
        let to_edge = |s: DVec3, t: DVec3| {
            let d = t - s;
            let along = (d.dot(p - s) / d.length_squared().max(1e-300)).clamp(0.0, 1.0);
            p.distance(s + along * d)
        };
        to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
    };
    triangles.iter().map(of).fold(f64::INFINITY, f64::min)
}

fn in_cells(mesh: &mut Mesh, frame: &Frame) -> Vec<[DVec3; 3]> {
    let mut all = Vec::new();
    let mut take = |batch: &[[DVec3; 3]]| {
        let to_cells = |p: &DVec3| (*p - frame.origin()) / frame.cell_size();
        all.extend(
            batch
                .iter()
                .filter(|t| (t[1] - t[0]).cross(t[2] - t[0]).length() > 0.0)
                .map(|t| [0, 1, 2].map(|i| to_cells(&t[i]))),
        );
        Ok(())
    };
    mesh.triangles(&mut take).expect("in memory");
    all
}

/// Greatest and mean excess of the band's distances over the true ones; checks that exactly the points within reach are there.
fn excess(mesh: &mut Mesh, frame: &Frame, reach: f64, every: usize) -> (f64, f64) {
    let band = Band::around(mesh, frame, reach, &Silent).expect("in memory");
    let triangles = in_cells(mesh, frame);
    let side = 1usize << frame.depth();
    let (mut worst, mut sum, mut n) = (0.0f64, 0.0, 0);
    for i in (0..side.pow(3)).step_by(every) {
        let at = [i / side / side, i / side % side, i % side];
        let p = DVec3::from(at.map(|c| c as f64));
        let at = at.map(|c| c as u32);
        let truth = distance(&triangles, p);
        match band.way(at) {
            Some(way) => {
                let found = f64::from(way.length());
                assert!(found > truth - 0.005, "{at:?}: {found}, not {truth}");
                assert!(distance(&triangles, p + way.as_dvec3()) < 0.005, "{at:?}: not the way to the surface");
                assert!(found < truth + SLACK, "{at:?}: {found}, not {truth}");
                if (reach - 1.0..=reach + 1.0).contains(&truth) {
                    worst = worst.max(found - truth);
                    sum += found - truth;
                    n += 1;
                }
            }
            None => assert!(truth > reach, "{at:?} has distance {truth}"),
        }
        let key = Key::cell(frame.depth() - 3, at.map(|c| c >> 3)).expect("in the root");
        let is_within = band.within(key, reach).get(Local::new(at[0], at[1], at[2]));
        assert_eq!(is_within, band.way(at).is_some_and(|way| f64::from(way.length()) <= reach), "{at:?}");
    }
    (worst, if n > 0 { sum / f64::from(n) } else { 0.0 })
}

#[test]
fn distances_are_those_of_all_triangles() {
    for (name, reach) in [("plate", 3.0), ("cube", 7.5), ("part", 1.0), ("part", 5.0), ("torus", 9.0)] {
        let mut mesh = sample::build(name, 1).expect("a sample");
        let frame = Frame::fit(&mesh.bounds().expect("in memory"), 5, 0.4).expect("it fits");
        let (worst, mean) = excess(&mut mesh, &frame, reach, 7);
        assert!(worst < 0.08 && mean < 0.012, "{name} at reach {reach}: {worst}, on average {mean}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, rng_seed: proptest::test_runner::RngSeed::Fixed(5), failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn triangles_of_any_size_are_near_their_points(
        corners in prop::collection::vec((prop::array::uniform3(2.0f64..30.0), prop::array::uniform9(-1.0f64..1.0), -6i32..5), 1..6),
        reach in 0.3f64..9.0,
    ) {
        let mut mesh = Mesh::default();
        for (at, spread, size) in corners {
            let first = mesh.points.len() as u32;
            let corner = |i: usize| DVec3::from(at) + DVec3::from_slice(&spread[3 * i..]) * f64::from(size).exp2();
            mesh.points.extend((0..3).map(|i| corner(i).clamp(DVec3::splat(0.5), DVec3::splat(31.5))));
            mesh.faces.push(&[first, first + 1, first + 2]);
        }
        let frame = Frame::new(DVec3::ZERO, 32.0, 5).expect("a frame");
        let (worst, _) = excess(&mut mesh, &frame, reach, 11);
        prop_assert!(worst < 0.08, "{}", worst);
    }
}

/// Distance from a ball's surface at depth 6: the edges along which it becomes 4 cells are cut where they should be.
#[test]
fn edges_leave_the_band_at_its_distance() {
    let mut mesh = Mesh {
        points: vec![DVec3::splat(32.1), DVec3::new(32.1, 32.2, 32.1), DVec3::new(32.2, 32.1, 32.1)],
        ..Mesh::default()
    };
    mesh.faces.push(&[0, 1, 2]);
    let frame = Frame::new(DVec3::ZERO, 64.0, 6).expect("a frame");
    let band = Band::around(&mut mesh, &frame, 4.0, &Silent).expect("in memory");
    let triangles = in_cells(&mut mesh, &frame);
    let mut cut = 0;
    for key in band.keys() {
        let within = band.within(key, 4.0);
        let origin = crate::octree::crossings::lattice_point(6, key);
        for axis in Axis::ALL {
            let high =
                key.toward(crate::octree::crossings::toward(std::array::from_fn(|a| i32::from(a == axis.index()))));
            let next = high.map_or(Plane::EMPTY, |key| band.within(key, 4.0));
            for p in (within ^ within.at_plus(axis, &next)).iter() {
                let at = std::array::from_fn(|a| origin[a] + p.coords()[a]);
                let (t, normal) = band.leaves(at, axis, 4.0);
                let mut p = DVec3::from(at.map(f64::from));
                p[axis.index()] += t;
                assert!((distance(&triangles, p) - 4.0).abs() < 0.01, "{at:?} {axis:?} {t}");
                let outward = (p - DVec3::splat(32.13)).normalize();
                assert!(normal.as_dvec3().normalize().dot(outward) > 0.995, "{at:?} {normal}");
                cut += 1;
            }
        }
    }
    assert!(cut > 200);
}
