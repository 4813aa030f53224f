use super::*;
use crate::mesh::chance::Chance;
use crate::mesh::{Mesh, TriangleTree};
use crate::progress::Silent;
use crate::volume::{Dense, LevelSet};
use glam::{DMat3, DQuat, DVec3};

/// Kinds of random samples.
const KINDS: [fn(&mut Chance) -> f32; 4] = [
    |chance| chance.unit() as f32 - 0.5,
    |chance| if chance.unit() < 0.5 { -1.0 } else { 1.0 },
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

fn cells(size: usize, field: impl Fn(DVec3) -> f64 + Sync, method: Method) -> Mesh {
    let mut mesh = Mesh::default();
    let options = ExtractOptions { method, ..ExtractOptions::default() };
    extract(&LevelSet::new([size; 3], field), &options, &mut mesh, &Silent).unwrap();
    mesh
}

const METHODS: [Method; 5] = [
    Method::MarchingCubes,
    Method::Trilinear,
    Method::DualContouring,
    Method::SurfaceNets,
    Method::ExtendedMarchingCubes,
];

#[test]
fn random_volumes_have_closed_surfaces() {
    for (kind, seed) in (0..KINDS.len()).flat_map(|kind| (0..4).map(move |seed| (kind, seed))) {
        let size = [[24, 24, 24], [62, 5, 7], [63, 3, 3], [130, 4, 2]][seed as usize];
        let values = random(kind, size, seed);
        for method in METHODS {
            let mesh = surface(&values, size, &ExtractOptions { method, ..ExtractOptions::default() });
            assert_eq!(mesh.validate(), Ok(()), "{method:?}, kind {kind}, seed {seed}");
            let report = mesh.report();
            assert_eq!(
                (report.zero_area_faces, report.isolated_points),
                (0, 0),
                "{method:?}, kind {kind}, seed {seed}"
            );
            assert!(mesh.outward() && report.faces > 100);
        }
    }
}

/// A cube turned askew: its edges and corners.
fn turned_cube(half: f64, middle: f64, angle: f64) -> (impl Fn(DVec3) -> f64 + Sync, Vec<DVec3>) {
    let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), angle));
    let field = move |p: DVec3| half - (turn * (p - middle)).abs().max_element();
    let mut features = Vec::new();
    for axis in 0..3 {
        for (u, v) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            for t in 0..=200 {
                let mut p = DVec3::ZERO;
                p[axis] = half * (f64::from(t) / 100.0 - 1.0);
                p[(axis + 1) % 3] = half * u;
                p[(axis + 2) % 3] = half * v;
                features.push(turn.transpose() * p + middle);
            }
        }
    }
    (field, features)
}

/// How far points are from the surface at most: in the mean, and for the worst.
fn farthest(mesh: &Mesh, points: &[DVec3]) -> (f64, f64) {
    let tree = TriangleTree::new(mesh);
    let far: Vec<f64> = points.iter().map(|&p| tree.closest(p).unwrap().distance).collect();
    (far.iter().sum::<f64>() / far.len() as f64, far.iter().copied().fold(0.0, f64::max))
}

#[test]
fn sharp_edges_and_corners_are_kept() {
    for method in [Method::DualContouring, Method::ExtendedMarchingCubes] {
        for turn in 0..6 {
            let (field, features) = turned_cube(9.3, 15.6, 0.2 + 0.37 * f64::from(turn));
            let mesh = cells(32, field, method);
            let (mean, worst) = farthest(&mesh, &features);
            assert!(worst < 0.1 && mean < 0.01, "{method:?}: {mean} {worst}");
            assert_eq!((mesh.validate(), mesh.report().zero_area_faces), (Ok(()), 0));
        }
    }
}
