//! Dual contouring keeps sharp edges: points of the true edges, and how far the surface is from them.

mod common;

use common::distance::TriangleGrid;
use common::shapes::unit_cube;
use common::{Chance, check_repaired, options, with_points};
use glam::{DMat3, DVec3};
use std::collections::HashMap;
use zmend::mesh::Mesh;
use zmend::{Faces, Options, Surface, repair};

const DEPTH: u32 = 6;

/// A prism over a polygon in the xz plane, given counter-clockwise seen against y; from y = 0 to the plane y = end(x, z).
fn prism(profile: &[[f64; 2]], end: impl Fn(f64, f64) -> f64) -> Mesh {
    let n = profile.len() as u32;
    let low = profile.iter().map(|&[x, z]| DVec3::new(x, 0.0, z));
    let high = profile.iter().map(|&[x, z]| DVec3::new(x, end(x, z), z));
    let mut mesh = Mesh { points: low.chain(high).collect(), ..Mesh::default() };
    mesh.faces.push(&(0..n).collect::<Vec<_>>());
    mesh.faces.push(&(n..2 * n).rev().collect::<Vec<_>>());
    (0..n).for_each(|i| mesh.faces.push(&[i, n + i, n + (i + 1) % n, (i + 1) % n]));
    mesh
}

/// What fan disks have: a hollow arc, slanted ends, edges of many angles, curved ones too.
fn fan_part() -> Mesh {
    let arc = (0..=24).map(|i| {
        let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_2 / 24.0).sin_cos();
        [1.0 - 0.6 * sin, 1.0 - 0.6 * cos]
    });
    let profile: Vec<[f64; 2]> =
        [[0.0, 0.0], [0.8, 0.0], [1.0, 0.15]].into_iter().chain(arc).chain([[0.0, 1.0]]).collect();
    prism(&profile, |x, z| 0.35 + 0.25 * x + 0.1 * z)
}

/// A wedge of 12 degrees whose blunt tip is so many cells thick, and as long as the grid allows.
fn wedge(tip: f64) -> Mesh {
    let cell = 1.0 / (0.9 * f64::from(1 << DEPTH));
    let (thin, thick) = (0.5 * tip * cell, 0.5 * tip * cell + 6f64.to_radians().tan());
    prism(&[[0.0, -thin], [1.0, -thick], [1.0, thick], [0.0, thin]], |_, _| 0.4)
}

/// Points of all edges at which the faces' normals differ by more than 20 degrees.
fn sharp_edges(mesh: &Mesh, spacing: f64) -> Vec<DVec3> {
    let mut normals: HashMap<(u32, u32), Vec<DVec3>> = HashMap::new();
    for face in mesh.faces.iter() {
        let at = |i: usize| mesh.points[face[i % face.len()] as usize];
        let normal = (1..face.len() - 1).map(|i| (at(i) - at(0)).cross(at(i + 1) - at(0))).sum::<DVec3>().normalize();
        for (i, &a) in face.iter().enumerate() {
            let b = face[(i + 1) % face.len()];
            normals.entry((a.min(b), a.max(b))).or_default().push(normal);
        }
    }
    let mut points = Vec::new();
    for ((a, b), n) in normals {
        assert_eq!(n.len(), 2, "closed");
        if n[0].dot(n[1]) < 20f64.to_radians().cos() {
            let (a, b) = (mesh.points[a as usize], mesh.points[b as usize]);
            let steps = (a.distance(b) / spacing).ceil();
            points.extend((0..=steps as u32).map(|i| a.lerp(b, f64::from(i) / steps)));
        }
    }
    points
}

/// Rotations: none, about one axis, and so many others.
fn rotations(n: u64) -> Vec<DMat3> {
    let mut all = vec![DMat3::IDENTITY, DMat3::from_rotation_z(0.5)];
    all.extend((0..n).map(|seed| Chance(seed).rotation()));
    all
}

/// The distances of points of the edges from the surface, in cells, ascending.
fn distances(mesh: &Mesh, options: &Options) -> Vec<f64> {
    let repaired = repair(mesh.clone(), options).expect("repairable");
    check_repaired(&repaired).expect("sound");
    let cell = repaired.report.frame.cell_size();
    let grid = TriangleGrid::new(&repaired.mesh, cell);
    let mut all: Vec<f64> = sharp_edges(mesh, 0.2 * cell).into_iter().map(|p| grid.farthest(&[p]).0 / cell).collect();
    all.sort_by(f64::total_cmp);
    all
}

#[test]
fn explore() {
    for (name, mesh) in [
        ("cube", unit_cube()),
        ("fan part", fan_part()),
        ("wedge 3", wedge(3.0)),
        ("wedge 2", wedge(2.0)),
        ("wedge 1.5", wedge(1.5)),
        ("wedge 1", wedge(1.0)),
        ("wedge 0", wedge(0.0)),
    ] {
        for (i, rotation) in rotations(6).into_iter().enumerate() {
            let turned = with_points(&mesh, |p| rotation * p);
            let dc = options(DEPTH, Surface::DualContouring, Faces::Auto);
            for (what, options) in [("dc", dc), ("disjoint", Options { no_self_intersections: true, ..dc })] {
                let d = distances(&turned, &options);
                let at = |q: f64| d[((d.len() - 1) as f64 * q) as usize];
                let over = d.iter().filter(|&&d| d > 0.1).count();
                println!(
                    "{name:10} {i} {what:9} n {:6} median {:.4} 90% {:.3} 99% {:.3} max {:.3}; over 0.1: {over}",
                    d.len(),
                    at(0.5),
                    at(0.9),
                    at(0.99),
                    at(1.0)
                );
            }
        }
    }
}
