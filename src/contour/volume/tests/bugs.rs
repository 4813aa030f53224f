//! What other extractors were found to do wrong, and must not happen here.

use super::*;
use crate::volume::Cropped;

fn by(method: Method) -> ExtractOptions {
    ExtractOptions { method, ..ExtractOptions::default() }
}

/// Deciders that answer both cells of a face alike at a tie crack the surface: in masks of two values, all open faces are ties.
#[test]
fn ties_on_open_faces_do_not_crack() {
    // A chess board: every face of every cell is open, every saddle is 0.
    let board = Samples::new([9; 3], |at| if at.iter().sum::<usize>() % 2 == 0 { 1.0 } else { -1.0 });
    for method in Method::ALL {
        let mesh = extracted(&board, &by(method));
        assert_eq!((mesh.validate(), mesh.report().zero_area_faces), (Ok(()), 0), "{method:?}");
    }
}

/// Samples at the level have made points coincide and faces vanish, and one extractor took them for inside, another for outside.
#[test]
fn samples_at_the_level_are_outside_for_all() {
    let values: [f32; 27] = std::array::from_fn(|i| if i == 13 { 1.0 } else { 0.0 });
    for method in Method::ALL {
        let mesh = surface(&values, [3; 3], &by(method));
        let report = mesh.report();
        assert_eq!((mesh.validate(), report.zero_area_faces, report.components), (Ok(()), 0, 1), "{method:?}");
        assert!(report.min_edge > 1e-4 && report.volume > 1e-10, "{method:?}: {} {}", report.min_edge, report.volume);
        let at_level = surface(&[0.0; 27], [3; 3], &by(method));
        assert!(at_level.faces.is_empty(), "{method:?}");
    }
}

/// A walker stopped one layer of cells too early on every axis.
#[test]
fn the_last_layer_of_cells_is_there() {
    for axis in 0..3 {
        let plane = Samples::new([33; 3], |at| 16.5 - at[axis] as f64);
        let mesh = extracted(&plane, &ExtractOptions { border: Border::Open, ..by(Method::MarchingCubes) });
        let mut expected = [0.0, 32.0].map(DVec3::splat);
        expected.iter_mut().for_each(|p| p[axis] = 16.5);
        let bounds = mesh.report().bounds;
        assert_eq!((mesh.faces.len(), bounds.min, bounds.max), (2 * 32 * 32, expected[0], expected[1]));
    }
}

/// In a part of a volume, a walker looked up points as if it were the whole.
#[test]
fn parts_have_the_surface_of_a_copy() {
    let size = [70, 9, 8];
    let values = random(3, size, 3);
    let whole = Dense::new(&values, size).unwrap();
    let (first, part) = ([3, 2, 1], [66, 6, 7]);
    let copy: Vec<f32> = (0..part.iter().product())
        .map(|i| [i % part[0], i / part[0] % part[1], i / (part[0] * part[1])])
        .map(|at| whole.value([0, 1, 2].map(|a| at[a] + first[a])) as f32)
        .collect();
    for method in Method::ALL {
        let cropped = extracted(&Cropped::new(whole, first, part).unwrap(), &by(method));
        let copied = surface(&copy, part, &by(method));
        // Normals look beyond the part, where the copy has nothing.
        if matches!(method, Method::DualContouring | Method::ExtendedMarchingCubes) {
            assert_eq!(cropped.validate(), Ok(()), "{method:?}");
        } else {
            assert!(cropped == copied, "{method:?}");
        }
    }
}

/// Tables with the wrong stride joined points of opposite borders: edges ran across the whole surface.
#[test]
fn no_edge_is_longer_than_its_cells() {
    for size in [[40, 23, 31], [63, 20, 20], [64, 20, 20], [65, 20, 20]] {
        let middle = DVec3::from(size.map(|n| 0.5 * n as f64));
        // Cut by both borders along x.
        let ball = LevelSet::new(size, move |p: DVec3| middle.x + 1.0 - (p - middle).length());
        for (method, border) in Method::ALL.into_iter().flat_map(|m| [(m, Border::Closed), (m, Border::Open)]) {
            let mesh = extracted(&ball, &ExtractOptions { border, ..by(method) });
            assert!(mesh.report().max_edge < 2.0 * 3f64.sqrt(), "{method:?} {size:?}");
        }
    }
}

/// Indices of 32 bits end at 2^31 samples. Here are 2^31 and some more; all are outside, but for a ball near the last.
#[test]
fn volumes_may_have_more_samples_than_32_bits_count() {
    struct Huge;
    const SIZE: [usize; 3] = [2048, 1024, 1040];
    impl Volume for Huge {
        fn size(&self) -> [usize; 3] {
            SIZE
        }
        fn value(&self, at: [usize; 3]) -> f64 {
            let from_end = [0, 1, 2].map(|a| SIZE[a] as f64 - 5.0 - at[a] as f64);
            3.3 - DVec3::from(from_end).length()
        }
        fn signs(&self, [y, z]: [usize; 2], level: Level, words: &mut [u64]) {
            words.fill(0);
            if y + 10 > SIZE[1] && z + 10 > SIZE[2] {
                let first = SIZE[0] - 64;
                words[31] =
                    (0..64).fold(0, |bits, x| bits | u64::from(level.holds(self.value([first + x, y, z]))) << x);
            }
        }
    }
    let mesh = extracted(&Huge, &by(Method::MarchingCubes));
    let report = mesh.report();
    assert_eq!((mesh.validate(), report.components, report.genus), (Ok(()), 1, Some(0)));
    assert!((report.bounds.max - DVec3::new(2046.3, 1022.3, 1038.3)).abs().max_element() < 0.01);
}

/// Samples and levels went through 32 bits, even where the mesh had 64.
#[test]
fn doubles_stay_doubles() {
    let step = Samples::new([12, 3, 3], |[x, _, _]| 1.0 + 1e-12 * (x as f64 - 5.25));
    for method in Method::ALL {
        let options = ExtractOptions { level: Level::above(1.0), border: Border::Open, ..by(method) };
        let bounds = extracted(&step, &options).report().bounds;
        assert!((bounds.min.x - 5.25).abs().max((bounds.max.x - 5.25).abs()) < 1e-3, "{method:?} {bounds:?}");
    }
}

/// One extractor began anew with the mesh it was given, another one went on with it.
#[test]
fn what_a_mesh_held_is_replaced() {
    let ball = Samples::new([9; 3], |at| 3.2 - (DVec3::from(at.map(|c| c as f64)) - 4.0).length());
    for method in Method::ALL {
        let once = extracted(&ball, &by(method));
        let mut twice = once.clone();
        extract(&(&ball as &dyn Volume), &by(method), &mut twice, &Silent).unwrap();
        assert!(once == twice, "{method:?}");
    }
}

/// Points of slices that were neither the current nor the next one were never set: rows and slices without surface lie between these.
#[test]
fn surfaces_may_be_far_apart() {
    let balls = Samples::new([130, 40, 60], |[x, y, z]| {
        let distance = |c: [f64; 3]| (DVec3::new(x as f64, y as f64, z as f64) - DVec3::from(c)).length();
        4.2 - distance([5.0, 6.0, 5.0]).min(distance([120.0, 33.0, 6.0])).min(distance([64.0, 20.0, 52.0]))
    });
    for method in Method::ALL {
        let mesh = extracted(&balls, &by(method));
        assert_eq!((mesh.validate(), mesh.report().components, mesh.report().euler), (Ok(()), 3, 6), "{method:?}");
    }
}

/// Solutions outside of the cell were replaced by the centroid, which blunted thin wedges.
#[test]
fn thin_wedges_keep_their_edge() {
    let tilt = DMat3::from_rotation_y(0.35) * DMat3::from_rotation_z(0.2);
    let (sin, cos) = 10f64.to_radians().sin_cos();
    let wedge = move |p: DVec3| {
        let p = tilt * (p - 14.2);
        (sin * (9.0 - p.x) - cos * p.z.abs()).min(p.x + 6.0).min(6.0 - p.y.abs())
    };
    for method in [Method::DualContouring, Method::ExtendedMarchingCubes] {
        let mesh = cells(30, wedge, method);
        assert_eq!(mesh.validate(), Ok(()));
        // The surface comes as near to the edge as the samples see the wedge, which is where it is a cell thick.
        let reach = mesh.points.iter().map(|&p| (tilt * (p - 14.2)).x).fold(f64::MIN, f64::max);
        let sampled = cells(30, wedge, Method::MarchingCubes);
        let seen = sampled.points.iter().map(|&p| (tilt * (p - 14.2)).x).fold(f64::MIN, f64::max);
        assert!(reach > seen + 0.3 && reach < 9.05, "{method:?}: {seen} {reach}");
    }
}
