//! How far apart two surfaces are: points of one, their distances to the other by a uniform grid of triangles.

use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::collections::HashMap;
use zmend::Mesh;
use zmend::mesh::TriangleSource;

/// Every triangle in the cells of a uniform grid that its bounding box meets.
pub(crate) struct TriangleGrid {
    triangles: Vec<[DVec3; 3]>,
    cells: HashMap<IVec3, Vec<u32>>,
    side: f64,
}

/// How many sides of grid cells distances are looked for.
const REACH: i32 = 4;

impl TriangleGrid {
    pub(crate) fn new(mesh: &Mesh, side: f64) -> Self {
        let triangles = triangles(mesh);
        let mut cells: HashMap<IVec3, Vec<u32>> = HashMap::new();
        for (i, t) in triangles.iter().enumerate() {
            let low = (t[0].min(t[1]).min(t[2]) / side).floor().as_ivec3();
            let high = (t[0].max(t[1]).max(t[2]) / side).floor().as_ivec3();
            for x in low.x..=high.x {
                for y in low.y..=high.y {
                    for z in low.z..=high.z {
                        let cell = IVec3::new(x, y, z);
                        if meets_plane(t, cell, side) {
                            cells.entry(cell).or_default().push(i as u32);
                        }
                    }
                }
            }
        }
        TriangleGrid { triangles, cells, side }
    }

    /// Distance from a point, or infinity if that is more than `REACH` sides: shell by shell of cells.
    fn distance(&self, p: DVec3) -> f64 {
        let home = (p / self.side).floor().as_ivec3();
        let mut least = f64::INFINITY;
        for shell in 0..=REACH {
            for x in -shell..=shell {
                for y in -shell..=shell {
                    let on_side = x.abs() == shell || y.abs() == shell;
                    for z in (-shell..=shell).step_by(if on_side || shell == 0 { 1 } else { 2 * shell as usize }) {
                        for &i in self.cells.get(&(home + IVec3::new(x, y, z))).into_iter().flatten() {
                            least = least.min(p.distance(closest(p, &self.triangles[i as usize])));
                        }
                    }
                }
            }
            // What is in later shells is farther away than this.
            if least <= f64::from(shell) * self.side {
                return least;
            }
        }
        f64::INFINITY
    }

    /// The greatest distance of the points, and one that has it.
    pub(crate) fn farthest(&self, points: &[DVec3]) -> (f64, DVec3) {
        let distances = points.par_iter().map(|&p| (self.distance(p), p));
        distances.reduce(|| (0.0, DVec3::ZERO), |a, b| if b.0 > a.0 { b } else { a })
    }
}

/// Whether the plane of a triangle comes near a cell of the grid.
fn meets_plane(t: &[DVec3; 3], cell: IVec3, side: f64) -> bool {
    let n = (t[1] - t[0]).cross(t[2] - t[0]);
    let centre = (cell.as_dvec3() + 0.5) * side - t[0];
    n.dot(centre).abs() <= n.abs().element_sum() * 0.5001 * side
}

pub(crate) fn triangles(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    let mut all = Vec::new();
    let mut source = mesh;
    source
        .triangles(&mut |batch| {
            all.extend_from_slice(batch);
            Ok(())
        })
        .expect("a sound mesh");
    all
}

/// Points on the surface: all corners, and inside and along the sides of triangles not farther apart than `spacing`.
pub(crate) fn samples(mesh: &Mesh, spacing: f64) -> Vec<DVec3> {
    let mut points = mesh.points.clone();
    for [a, b, c] in triangles(mesh) {
        points.push((a + b + c) / 3.0);
        // Rows parallel to the longest side, so that slim triangles get few points.
        let lengths = [b.distance(c), c.distance(a), a.distance(b)];
        let longest = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j])).expect("three sides");
        let (p, q, apex) = [(b, c, a), (c, a, b), (a, b, c)][longest];
        let height = if lengths[longest] > 0.0 { (q - p).cross(apex - p).length() / lengths[longest] } else { 0.0 };
        let rows = (height / spacing).ceil().max(1.0);
        for row in 0..rows as u32 {
            let t = f64::from(row) / rows;
            let (from, to) = (p.lerp(apex, t), q.lerp(apex, t));
            let steps = (from.distance(to) / spacing).ceil().max(1.0);
            points.extend((1..steps as u32).map(|i| from.lerp(to, f64::from(i) / steps)));
        }
    }
    points
}

/// No more points than tests have time for, from everywhere.
fn spread(points: &[DVec3]) -> Vec<DVec3> {
    points.iter().copied().step_by(points.len() / 100_000 + 1).collect()
}

/// The greatest distances from `a` to `b` and from `b` to `a` in cells, infinity beyond `REACH` cells.
pub(crate) fn hausdorff(a: &Mesh, b: &Mesh, cell: f64) -> [f64; 2] {
    let one_way = |from: &Mesh, to: &Mesh| {
        let (d, at) = TriangleGrid::new(to, cell).farthest(&spread(&samples(from, cell)));
        if d > 0.5 * cell {
            println!("    {:.3} cells at {at}", d / cell);
        }
        d / cell
    };
    [one_way(a, b), one_way(b, a)]
}

/// The point of a triangle that is closest to `p`: of the plane if that lies inside, else of the edges.
fn closest(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let n = (b - a).cross(c - a);
    if n.length_squared() > 0.0 {
        let inside = |s: DVec3, t: DVec3| (t - s).cross(p - s).dot(n) >= 0.0;
        if inside(a, b) && inside(b, c) && inside(c, a) {
            return p - n * (n.dot(p - a) / n.length_squared());
        }
    }
    let on_edge = |s: DVec3, t: DVec3| {
        let d = t - s;
        let along = if d.length_squared() > 0.0 { (d.dot(p - s) / d.length_squared()).clamp(0.0, 1.0) } else { 0.0 };
        s + along * d
    };
    let candidates = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    candidates.into_iter().min_by(|q, r| p.distance(*q).total_cmp(&p.distance(*r))).expect("three edges")
}
