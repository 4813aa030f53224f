//! Dual contouring keeps sharp edges: points of the true edges everywhere, and how far the surface is from them.

mod common;

use common::distance::TriangleGrid;
use common::shapes::unit_cube;
use common::{Chance, check_repaired, options, together, with_faces, with_points};
use glam::{DMat3, DVec3};
use std::collections::HashMap;
use zmend::{Faces, Mesh, Options, Surface, repair};

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

/// A hollow edge of 90 degrees, one of 135, corners where two edges bulge and one is hollow, and a slanted end.
fn bracket() -> Mesh {
    let profile = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.25], [0.5, 0.25], [0.3, 0.45], [0.3, 1.0], [0.0, 1.0]];
    prism(&profile, |x, z| 0.4 + 0.2 * x - 0.1 * z)
}

/// A cube with a turned cube cut out of its middle: all edges and corners in there are hollow.
fn hollow_cube() -> Mesh {
    let turn = DMat3::from_rotation_z(0.4) * DMat3::from_rotation_x(0.7);
    let cavity = with_points(&unit_cube(), |p| DVec3::splat(0.5) + turn * (0.45 * (p - 0.5)));
    let inward: Vec<Vec<u32>> = cavity.faces.iter().map(|face| face.iter().rev().copied().collect()).collect();
    let cavity = with_faces(&cavity, inward.iter().map(Vec::as_slice));
    together(&[unit_cube(), cavity])
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

/// What is found of a part in some rotations: the greatest median of the distances, the least part of the points that are within 0.1 cells,
/// and the greatest distance, in cells.
fn kept(name: &str, mesh: &Mesh, options: &Options, rotations: &[DMat3]) -> (f64, f64, f64) {
    let of_rotation = |rotation: &DMat3| {
        let d = distances(&with_points(mesh, |p| *rotation * p), options);
        let within = d.iter().filter(|&&d| d < 0.1).count() as f64 / d.len() as f64;
        (d[d.len() / 2], within, d[d.len() - 1])
    };
    let all = rotations.iter().map(of_rotation);
    let found = all.fold((0.0, 1.0, 0.0), |a, b| (f64::max(a.0, b.0), f64::min(a.1, b.1), f64::max(a.2, b.2)));
    let (median, within, worst) = found;
    println!("{name}: median {median:.4}, {:.2} percent within 0.1, worst {worst:.3}", 100.0 * within);
    found
}

/// Parts whose edges are farther apart than the diagonal of a cell, 1.73.
fn wide_parts() -> [(&'static str, Mesh); 6] {
    [
        ("cube", unit_cube()),
        ("fan part", fan_part()),
        ("bracket", bracket()),
        ("hollow cube", hollow_cube()),
        ("wedge of 3 cells", wedge(3.0)),
        ("wedge of 1.8 cells", wedge(1.8)),
    ]
}

/// Every point of every edge, corners and all.
#[test]
fn sharp_edges_are_kept() {
    let dc = options(DEPTH, Surface::DualContouring, Faces::Auto);
    for (name, mesh) in wide_parts() {
        let (median, within, worst) = kept(name, &mesh, &dc, &rotations(8));
        assert!(median < 0.01 && within == 1.0 && worst < 0.1, "{name}");
    }
}

/// Where both edges of a blunt tip go through one cell, its single vertex cannot be on both: there they are cut off by less than half the
/// tip, and they are kept everywhere else.
#[test]
fn two_edges_in_a_cell_may_share_a_vertex() {
    let dc = options(DEPTH, Surface::DualContouring, Faces::Auto);
    let (median, within, worst) = kept("wedge of 1.5 cells", &wedge(1.5), &dc, &rotations(8));
    assert!(median < 0.01 && within > 0.98 && worst < 0.75);
}

/// Vertices stay in their cells: edges that bulge through an edge of the grid are cut off.
#[test]
fn without_intersections_edges_are_kept_mostly() {
    let disjoint = options(DEPTH, Surface::DualContouring, Faces::Auto);
    let disjoint = Options { no_self_intersections: true, ..disjoint };
    for (name, mesh) in wide_parts() {
        let (median, within, worst) = kept(name, &mesh, &disjoint, &rotations(4));
        assert!(median < 0.01 && within > 0.8 && worst < 0.65, "{name}");
    }
}

/// Where it lies along the grid, nothing is lost: not even a wedge that ends in nothing.
#[test]
fn edges_along_the_grid_are_kept_everywhere() {
    let dc = options(DEPTH, Surface::DualContouring, Faces::Auto);
    for mesh in [unit_cube(), wedge(3.0), wedge(1.5), wedge(1.0)] {
        for options in [dc, Options { no_self_intersections: true, ..dc }] {
            let d = distances(&mesh, &options);
            assert!(d[d.len() - 1] < 0.1, "{}", d[d.len() - 1]);
        }
    }
}

/// Other surfaces cut edges off: the measure can tell.
#[test]
fn marching_cubes_does_not_keep_them() {
    let turned = with_points(&unit_cube(), |p| rotations(1)[2] * p);
    let d = distances(&turned, &options(DEPTH, Surface::MarchingCubes, Faces::Auto));
    assert!(d[d.len() / 2] > 0.1, "{}", d[d.len() / 2]);
}
