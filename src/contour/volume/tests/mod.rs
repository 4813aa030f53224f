mod bugs;
mod features;
mod topology;

use super::*;
use crate::mesh::Mesh;
use crate::mesh::chance::Chance;
use crate::progress::Silent;
use crate::volume::{Dense, LevelSet, Samples};
use glam::{DMat3, DVec3};

/// Kinds of random samples.
const KINDS: [fn(&mut Chance) -> f32; 5] = [
    |chance| chance.unit() as f32 - 0.5,
    |chance| if chance.unit() < 0.5 { -1.0 } else { 1.0 },
    // Mostly inside: full of tunnels and of cycles that pass through a face twice.
    |chance| if chance.unit() < 0.2 { -1.0 } else { 1.0 },
    |chance| (3.0 * chance.unit()).floor() as f32 - 1.0,
    |chance| {
        [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 0.0, 1e-30, -1e-30]
            [(8.0 * chance.unit()) as usize]
    },
];

fn random(kind: usize, size: [usize; 3], seed: u64) -> Vec<f32> {
    let mut chance = Chance(seed);
    (0..size.iter().product()).map(|_| KINDS[kind](&mut chance)).collect()
}

fn surface(values: &[f32], size: [usize; 3], options: &ExtractOptions) -> Mesh {
    let mut mesh = Mesh::default();
    let sizes = extract(&Dense::new(values, size).unwrap(), options, &mut mesh, &Silent).unwrap();
    assert_eq!((sizes.points, sizes.faces), (mesh.points.len() as u64, mesh.faces.len() as u64));
    mesh
}

/// The surface of any volume, behind one type: so extractors are compiled once for all of them.
fn extracted(volume: &dyn Volume, options: &ExtractOptions) -> Mesh {
    let mut mesh = Mesh::default();
    extract(&volume, options, &mut mesh, &Silent).unwrap();
    mesh
}

fn cells(size: usize, field: impl Fn(DVec3) -> f64 + Sync, method: Method) -> Mesh {
    extracted(&LevelSet::new([size; 3], field), &ExtractOptions { method, ..ExtractOptions::default() })
}

/// Closed, manifold, outward, without faces of no area: for random volumes of all kinds, in every method; and all that go by signs have the same
/// topology. `ZMEND_RANDOM_VOLUMES` says how many of each kind and method; 2 if it does not.
#[test]
fn random_volumes_have_closed_surfaces() {
    let count = std::env::var("ZMEND_RANDOM_VOLUMES").ok().map_or(2, |s| s.parse().expect("a number"));
    for (kind, seed) in (0..KINDS.len()).flat_map(|kind| (0..count).map(move |seed| (kind, seed))) {
        let size =
            [[24, 24, 24], [62, 5, 7], [63, 3, 3], [130, 4, 2]][if seed % 16 == 1 { 1 + seed / 16 % 3 } else { 0 }];
        let values = random(kind, size, seed as u64);
        let mut topology = None;
        for method in Method::ALL {
            let mesh = surface(&values, size, &ExtractOptions { method, ..ExtractOptions::default() });
            assert_eq!(mesh.validate(), Ok(()), "{method:?}, kind {kind}, seed {seed}");
            let report = mesh.report();
            assert_eq!(
                (report.zero_area_faces, report.isolated_points),
                (0, 0),
                "{method:?}, kind {kind}, seed {seed}"
            );
            assert!(mesh.outward() && report.faces > 100);
            if method != Method::Trilinear {
                let found = (report.components, report.euler);
                assert_eq!(*topology.get_or_insert(found), found, "{method:?}, kind {kind}, seed {seed}");
            }
        }
    }
}

/// A ball in the model, on a lattice that is fine along z, turned or mirrored: always outward, and where it should be.
#[test]
fn placements_are_honoured() {
    for (method, mirrored) in Method::ALL.into_iter().flat_map(|m| [(m, false), (m, true)]) {
        let turn = DMat3::from_rotation_x(0.4);
        let axes = turn * DMat3::from_diagonal(DVec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 0.5));
        let middle = DVec3::new(12.0, 12.0, 24.0);
        let placement = Placement { origin: DVec3::new(100.0, -20.0, 7.0), axes };
        let centre = placement.to_model(middle);
        let field = LevelSet::new([25, 25, 49], |p: DVec3| 9.0 - (axes * (p - middle)).length());
        let mesh = extracted(&field, &ExtractOptions { method, placement, ..ExtractOptions::default() });
        assert_eq!(mesh.validate(), Ok(()));
        let report = mesh.report();
        assert!(
            (report.volume / (4.0 / 3.0 * std::f64::consts::PI * 729.0) - 1.0).abs() < 0.02,
            "{method:?} {}",
            report.volume
        );
        assert!(mesh.points.iter().all(|p| (p.distance(centre) - 9.0).abs() < 0.1), "{method:?}");
    }
}

/// A solid that fills the volume: closed half a step beyond it, or nothing at all.
#[test]
fn borders_close_or_stay_open() {
    let full = [1u8; 60];
    for method in Method::ALL {
        let dense = Dense::new(&full, [3, 4, 5]).unwrap();
        let options = ExtractOptions { method, level: Level::above(0.5), ..ExtractOptions::default() };
        let closed = extracted(&dense, &options);
        assert_eq!(closed.validate(), Ok(()));
        let bounds = closed.report().bounds;
        let limit = if matches!(method, Method::SurfaceNets) { 0.25 } else { 1e-3 };
        assert!((bounds.min + 0.5).abs().max_element() < limit, "{method:?} {bounds:?}");
        assert!((bounds.max - DVec3::new(2.5, 3.5, 4.5)).abs().max_element() < limit, "{method:?} {bounds:?}");
        let open = extracted(&dense, &ExtractOptions { border: Border::Open, ..options });
        assert_eq!((open.points.len(), open.faces.len()), (0, 0));
        // Half a ball on the border has a rim there.
        let half = LevelSet::new([20, 20, 10], |p: DVec3| 7.2 - (p - DVec3::new(9.6, 9.7, 0.0)).length());
        let bowl = extracted(&half, &ExtractOptions { method, border: Border::Open, ..ExtractOptions::default() });
        let report = bowl.report();
        assert!(report.boundary_edges > 30 && report.is_manifold() && report.is_oriented(), "{method:?}");
        assert_eq!((report.components, report.isolated_points), (1, 0));
    }
}

/// Cells that are not valid leave a hole, without loose points.
#[test]
fn invalid_cells_are_left_out() {
    struct Holed(LevelSet<fn(DVec3) -> f64>);
    impl Volume for Holed {
        fn size(&self) -> [usize; 3] {
            self.0.size()
        }
        fn value(&self, at: [usize; 3]) -> f64 {
            self.0.value(at)
        }
        fn has_invalid_cells(&self) -> bool {
            true
        }
        fn valid_cells(&self, [_, z]: [usize; 2], words: &mut [u64]) {
            words.fill(if z < 12 { !0 } else { !0 << 10 });
        }
    }
    let ball: fn(DVec3) -> f64 = |p| 7.2 - (p - DVec3::new(9.6, 9.7, 9.8)).length();
    for method in Method::ALL {
        let holed = Holed(LevelSet::new([20; 3], ball));
        let mesh = extracted(&holed, &ExtractOptions { method, ..ExtractOptions::default() });
        let report = mesh.report();
        assert!(report.is_manifold() && report.is_oriented() && report.boundary_edges > 10, "{method:?}");
        assert!(report.components == 1 && report.boundary_loops == 1, "{method:?}");
        let whole = report.points == report.points_used;
        assert!(whole || matches!(method, Method::DualContouring | Method::SurfaceNets), "{method:?}");
        assert!(mesh.points.iter().all(|p| p.z < 12.0 || p.x > 8.9 || p.z < 12.5), "{method:?}");
    }
}

#[test]
fn threads_make_no_difference() {
    let size = [40, 33, 70];
    let values = random(0, size, 5);
    for method in Method::ALL {
        let options = ExtractOptions { method, ..ExtractOptions::default() };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| surface(&values, size, &options))
        };
        assert!(on(1) == on(3), "{method:?}");
    }
}

#[test]
fn bad_settings_are_refused() {
    let dense = Dense::new(&[0.0f32; 8], [2, 2, 2]).unwrap();
    let refuse =
        |options: ExtractOptions| extract(&dense, &options, &mut Mesh::default(), &Silent).unwrap_err().to_string();
    let good = ExtractOptions::default();
    assert!(refuse(ExtractOptions { level: Level::above(f64::NAN), ..good }).starts_with("iso: "));
    assert!(refuse(ExtractOptions { feature_angle: 90.0, ..good }).starts_with("feature-angle: 90 is not"));
    let flat = Placement::with_spacing(DVec3::ZERO, DVec3::ZERO);
    assert!(refuse(ExtractOptions { placement: flat, ..good }).starts_with("placement: "));
    for size in [[0, 5, 5], [1, 1, 1], [1, 7, 2]] {
        let values = vec![1u16; size.iter().product()];
        for (method, border) in Method::ALL.into_iter().flat_map(|m| [(m, Border::Closed), (m, Border::Open)]) {
            let options = ExtractOptions { method, border, level: Level::above(0.5), ..good };
            let mesh = extracted(&Dense::new(&values, size).unwrap(), &options);
            assert_eq!(mesh.validate(), Ok(()));
            assert_eq!(mesh.faces.is_empty(), border == Border::Open || values.is_empty(), "{size:?} {method:?}");
        }
    }
}

/// Three materials that meet in a line, and a fourth round them: each triangle between two of them is a triangle of both.
#[test]
fn surfaces_of_labels_fit_together() {
    let size = [24, 22, 20];
    let labels = Samples::new(size, |[x, y, z]| {
        let p = DVec3::new(x as f64 - 11.2, y as f64 - 10.4, z as f64 - 9.7);
        if p.length() > 8.6 { 0.0 } else { 1.0 + ((p.y.atan2(p.x) + 4.0) / 2.1).floor().min(2.0) }
    });
    let mut sides = std::collections::BTreeMap::new();
    let mut volume = 0.0;
    for label in [0.0, 1.0, 2.0, 3.0] {
        let mut mesh = Mesh::default();
        extract_label(&labels, label, &ExtractOptions::default(), &mut mesh, &Silent).unwrap();
        assert_eq!((mesh.validate(), mesh.report().zero_area_faces), (Ok(()), 0), "label {label}");
        volume += mesh.report().volume;
        for face in mesh.faces.iter() {
            let mut corners: Vec<_> =
                face.iter().map(|&i| mesh.points[i as usize].to_array().map(f64::to_bits)).collect();
            corners.sort_unstable();
            *sides.entry(corners).or_insert(0) += 1;
        }
    }
    // Together they fill the volume, but for its own edges and corners, which nets cut off.
    let whole: usize = size.iter().product();
    assert!(volume < whole as f64 && volume > 0.99 * whole as f64, "{volume} of {whole}");
    let (inner, outer) = (sides.values().filter(|&&n| n == 2).count(), sides.values().filter(|&&n| n == 1).count());
    assert_eq!(inner + outer, sides.len());
    assert!(inner > 1500, "{inner}");
    // Those of one material only are on the border.
    let on_border = |corner: &[u64; 3]| {
        let p = corner.map(f64::from_bits);
        (0..3).any(|a| p[a] < 0.0 || p[a] > size[a] as f64 - 1.0)
    };
    assert!(sides.iter().filter(|(_, n)| **n == 1).all(|(corners, _)| corners.iter().all(on_border)));
}
