//! Sharp edges, corners and tips, on fields whose features are known.

use super::*;
use crate::mesh::TriangleTree;
use glam::{DQuat, DVec2};

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

/// Turns the part below into its place.
fn turn() -> DMat3 {
    DMat3::from_rotation_x(0.3) * DMat3::from_rotation_z(0.5)
}

/// A slanted block with a round cut, as a fandisk has them: straight and curved edges, at angles from 90 to 130 degrees.
fn fandisk(p: DVec3) -> f64 {
    let p = turn() * (p - 16.0);
    let (sin, cos) = 40f64.to_radians().sin_cos();
    let block = (p.x * sin - p.y * cos + 4.0).min(p.y + 7.0).min(9.0 - p.x).min(p.x + 9.0).min(8.0 - p.z.abs());
    block.min((p.truncate() - DVec2::new(2.0, -7.0)).length() - 5.0)
}

/// Points on its edges: the rim of the cut and its mouth, the slanted top, and edges round the right side.
fn fandisk_features() -> Vec<DVec3> {
    let rim = (2..=178).map(|i| {
        let (sin, cos) = f64::from(i).to_radians().sin_cos();
        DVec3::new(2.0 + 5.0 * cos, -7.0 + 5.0 * sin, 8.0)
    });
    let mouth = (-79..=79).map(|i| DVec3::new(7.0, -7.0, f64::from(i) / 10.0));
    let (sin, cos) = 40f64.to_radians().sin_cos();
    let top = (-85..=85).map(|i| f64::from(i) / 10.0).map(|x| DVec3::new(x, (x * sin + 4.0) / cos, -8.0));
    let right = (0..=150).map(|i| DVec3::new(9.0, -7.0 + f64::from(i) / 10.0, 8.0));
    let deep = (-79..=79).map(|i| DVec3::new(9.0, -7.0, f64::from(i) / 10.0));
    let place = |p: DVec3| turn().transpose() * p + 16.0;
    let on_surface = |p: &DVec3| fandisk(*p).abs() < 1e-9;
    rim.chain(mouth).chain(top).chain(right).chain(deep).map(place).filter(on_surface).collect()
}

#[test]
fn curved_edges_and_tips_are_kept() {
    let cone = |p: DVec3| {
        let p = DMat3::from_rotation_y(0.6) * (p - 15.3);
        (8.0 - p.z - 2.0 * p.truncate().length()).min(p.z + 8.0)
    };
    let rim = (0..360).map(|i| {
        let (sin, cos) = f64::from(i).to_radians().sin_cos();
        DMat3::from_rotation_y(-0.6) * DVec3::new(8.0 * cos, 8.0 * sin, -8.0) + 15.3
    });
    let rim: Vec<DVec3> = rim.collect();
    let features = fandisk_features();
    assert!(features.len() > 700, "{}", features.len());
    for method in [Method::DualContouring, Method::ExtendedMarchingCubes] {
        let (mean, worst) = farthest(&cells(34, cone, method), &rim);
        assert!(worst < 0.1 && mean < 0.02, "{method:?}, cone: {mean} {worst}");
        let (mean, worst) = farthest(&cells(34, fandisk, method), &features);
        assert!(worst < 0.1 && mean < 0.02, "{method:?}, fandisk: {mean} {worst}");
    }
    // Without them, edges are cut off.
    let (mean, worst) = farthest(&cells(34, fandisk, Method::MarchingCubes), &features);
    assert!(worst > 0.2 && mean > 0.05, "{mean} {worst}");
}

#[test]
fn without_features_extended_marching_cubes_is_marching_cubes() {
    let ball = |p: DVec3| 12.2 - (p - DVec3::new(15.1, 15.3, 15.2)).length();
    let [plain, extended] =
        [Method::MarchingCubes, Method::ExtendedMarchingCubes].map(|method| cells(32, ball, method));
    assert!(plain == extended);
    // Nor is there anything to decide for the trilinear interpolant.
    assert!(plain == cells(32, ball, Method::Trilinear));
}

/// Planes have no features, and round surfaces hardly any: there, vertices of dual contouring are on the surface of marching cubes.
#[test]
fn without_features_dual_contouring_is_on_marching_cubes() {
    let slab = |p: DVec3| 5.3 - (p - 15.2).dot(DVec3::new(0.3, -0.5, 0.8).normalize()).abs();
    let ball = |p: DVec3| 12.2 - (p - DVec3::new(15.1, 15.3, 15.2)).length();
    let fields: [(&(dyn Fn(DVec3) -> f64 + Sync), f64); 2] = [(&slab, 1e-3), (&ball, 0.08)];
    for (field, most) in fields {
        let [plain, dual] = [Method::MarchingCubes, Method::DualContouring].map(|method| {
            let options = ExtractOptions { method, border: Border::Open, ..ExtractOptions::default() };
            extracted(&LevelSet::new([32; 3], field), &options)
        });
        let (_, worst) = farthest(&plain, &dual.points);
        assert!(dual.points.len() > 1000 && worst < most, "{worst}");
    }
}
