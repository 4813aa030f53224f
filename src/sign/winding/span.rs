//! A surface that spans the boundary, and the solid angle under which it is seen.
//!
//! The generalised winding number w of a surface S is that of a closed surface, a whole number n, and of any surface P with the same
//! boundary: w = n(S - P) + w(P). P is ours to choose, and is made so that w(P) is quick to tell. The chain of edges between two corners
//! of a ring is halved; the triangle of its two ends and the middle belongs to P, and so do those of both halves, and so on. All corners of
//! P are corners of the boundary. Triangles near the boundary are small and run along it, and few are large:
//! where a chain is far away, its part of P is a dipole and a quadrupole (Barill, Dickson, Schmidt, Levin and Jacobson 2018, "Fast winding
//! numbers for soups and clouds", here for chains of a boundary in place of clusters of a surface), and a point next to
//! a ring of m edges meets some 2 log m triangles. Rings form a tree in Z-order of their middles in the same way.
//!
//! What the gradient of w is depends on the boundary only (the law of Biot and Savart): so the chains' lengths and distances bound by how
//! much w changes within a ball.
//!
//! Nodes lie in depth-first order, and each knows where the next is that is not below it: walking the tree needs no stack. How the surface is
//! seen from a point, and from all points of a cell, is told by `Field`.
//!
//! Where a point lies on the plane of a triangle, it counts as moved by the same (e, e^2, e^3) as in the [rasteriser](crate::geom::raster):
//! so whole numbers from hits of P and angles of P jump at the same places.
//!
//! Cost: 110 bytes an edge of the boundary.

use super::boundary::Corner;
use super::polynomial::Source;
use crate::geom::raster::FineTriangle;
use crate::grid::key::interleave;
use glam::{DMat3, DVec3};

pub(super) const NONE: u32 = u32::MAX;

/// Of a chain with its part of the surface, or of several rings. Lengths are in fixed-point units.
#[derive(Debug)]
pub(super) struct Node {
    centre: [f32; 3],
    /// All corners are that near.
    pub(super) radius: f32,
    /// Vector area.
    area: [f32; 3],
    /// Of the edges.
    pub(super) length: f32,
    /// Sum of the areas of all triangles.
    pub(super) extent: f32,
    /// Integral of (place - centre) times normal: xx, yy, zz, and what yz, zx, xy come to on both sides of the diagonal.
    moment: [f32; 6],
    /// Place of the next node that is not below this one.
    pub(super) skip: u32,
    /// The node's own triangle, or [`NONE`].
    pub(super) triangle: u32,
    /// Which of the triangle's sides are edges of the boundary.
    pub(super) sides: [bool; 3],
}

/// What is summed up from below.
#[derive(Clone, Copy)]
struct Sum {
    centre: DVec3,
    radius: f64,
    area: DVec3,
    moment: DMat3,
    length: f64,
    extent: f64,
}

/// The spanning surface.
#[derive(Debug, Default)]
pub(super) struct Span {
    pub(super) nodes: Vec<Node>,
    pub(super) triangles: Vec<FineTriangle>,
}

pub(super) fn position(corner: Corner) -> DVec3 {
    DVec3::from(corner.map(f64::from))
}

/// The matrix with elements a\[i\] b\[j\].
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

impl Span {
    /// Spans rings.
    pub(super) fn new(mut rings: Vec<Vec<Corner>>) -> Self {
        let code = |ring: &Vec<Corner>| {
            let middle = ring.iter().map(|&c| position(c)).sum::<DVec3>() / ring.len() as f64;
            interleave(middle.to_array().map(|c| c as u32 >> 6))
        };
        rings.sort_by_cached_key(|ring| (code(ring), ring[0]));
        let mut span = Span::default();
        if !rings.is_empty() {
            span.push_rings(&rings);
        }
        span
    }

    /// Its triangles, turned so that their boundary runs along the rings.
    pub(super) fn triangles(&self) -> &[FineTriangle] {
        &self.triangles
    }

    pub(super) fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.triangles.capacity() * size_of::<FineTriangle>()
    }

    fn push_rings(&mut self, rings: &[Vec<Corner>]) -> Sum {
        if let [ring] = rings {
            return self.push_chain(ring, true);
        }
        let place = self.push_place();
        let (low, high) = rings.split_at(rings.len() / 2);
        let parts = [self.push_rings(low), self.push_rings(high)];
        let centre = 0.5 * (parts[0].centre + parts[1].centre);
        let radius = parts.iter().map(|part| part.centre.distance(centre) + part.radius).fold(0.0, f64::max);
        self.enter(place, &parts, centre, radius, NONE, [false; 3])
    }

    /// The chain through all these corners, at least three; `is_ring` if an edge leads from the last back to the first.
    fn push_chain(&mut self, chain: &[Corner], is_ring: bool) -> Sum {
        let place = self.push_place();
        let middle = chain.len() / 2;
        let triangle = self.triangles.len() as u32;
        let corners = [chain[0], chain[middle], chain[chain.len() - 1]];
        self.triangles.push(corners);
        let [a, b, c] = corners.map(position);
        let halves = [&chain[..=middle], &chain[middle..]];
        let sides = [halves[0].len() == 2, halves[1].len() == 2, is_ring];
        let lengths = [a.distance(b), b.distance(c), c.distance(a)];
        let own = Sum {
            centre: (a + b + c) / 3.0,
            radius: 0.0,
            area: 0.5 * (b - a).cross(c - a),
            moment: DMat3::ZERO,
            length: (0..3).filter(|&i| sides[i]).map(|i| lengths[i]).sum(),
            extent: 0.5 * (b - a).cross(c - a).length(),
        };
        let mut parts = vec![own];
        parts.extend(halves.into_iter().filter(|half| half.len() > 2).map(|half| self.push_chain(half, false)));
        let (low, high) = chain.iter().map(|&p| position(p)).fold((a, a), |(low, high), p| (low.min(p), high.max(p)));
        let centre = 0.5 * (low + high);
        let radius = chain.iter().map(|&p| position(p).distance(centre)).fold(0.0, f64::max);
        self.enter(place, &parts, centre, radius, triangle, sides)
    }

    fn push_place(&mut self) -> usize {
        let node = Node {
            centre: [0.0; 3],
            radius: 0.0,
            area: [0.0; 3],
            length: 0.0,
            extent: 0.0,
            moment: [0.0; 6],
            skip: 0,
            triangle: NONE,
            sides: [false; 3],
        };
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    fn enter(
        &mut self,
        place: usize,
        parts: &[Sum],
        centre: DVec3,
        radius: f64,
        triangle: u32,
        sides: [bool; 3],
    ) -> Sum {
        // Moments are about the centre as it is stored.
        let stored = centre.as_vec3();
        let centre = stored.as_dvec3();
        let about = |part: &Sum| part.moment + outer(part.centre - centre, part.area);
        let sum = Sum {
            centre,
            radius: radius + 8.0,
            area: parts.iter().map(|part| part.area).sum(),
            moment: parts.iter().map(about).fold(DMat3::ZERO, |a, b| a + b),
            length: parts.iter().map(|part| part.length).sum(),
            extent: parts.iter().map(|part| part.extent).sum(),
        };
        let m = sum.moment.to_cols_array_2d();
        let both = |i: usize, j: usize| (m[i][j] + m[j][i]) as f32;
        self.nodes[place] = Node {
            centre: stored.to_array(),
            radius: sum.radius as f32,
            area: sum.area.as_vec3().to_array(),
            length: sum.length as f32,
            extent: sum.extent as f32,
            moment: [m[0][0] as f32, m[1][1] as f32, m[2][2] as f32, both(1, 2), both(2, 0), both(0, 1)],
            skip: self.nodes.len() as u32,
            triangle,
            sides,
        };
        sum
    }
}

impl Node {
    pub(super) fn centre(&self) -> DVec3 {
        DVec3::from(self.centre.map(f64::from))
    }

    /// What it is from afar.
    pub(super) fn source(&self) -> Source {
        Source { area: DVec3::from(self.area.map(f64::from)), moment: self.moment.map(f64::from) }
    }

    /// Solid angle and its slope at a point from which the centre is at `r`.
    pub(super) fn expansion<const SLOPE: bool>(&self, r: DVec3, r2: f64) -> (f64, DVec3) {
        let Source { area, moment: [xx, yy, zz, yz, zx, xy] } = self.source();
        let i2 = 1.0 / r2;
        let i3 = i2 * i2.sqrt();
        // The moment from both sides.
        let m = DVec3::new(
            xx * r.x + 0.5 * (xy * r.y + zx * r.z),
            yy * r.y + 0.5 * (xy * r.x + yz * r.z),
            zz * r.z + 0.5 * (zx * r.x + yz * r.y),
        );
        let (flux, trace, rmr) = (area.dot(r), xx + yy + zz, r.dot(m));
        let angle = i3 * (flux + trace - 3.0 * rmr * i2);
        if !SLOPE {
            return (angle, DVec3::ZERO);
        }
        // Derivatives by r, and moving the point moves r the other way.
        let of_dipole = area - r * (3.0 * flux * i2);
        let of_quadrupole = r * (15.0 * rmr * i2 * i2 - 3.0 * trace * i2) - m * (6.0 * i2);
        (angle, -i3 * (of_dipole + of_quadrupole))
    }
}

/// The solid angle of a triangle, positive where it turns its back (van Oosterom and Strackee 1983).
pub(super) fn solid_angle(triangle: &FineTriangle, at: Corner) -> f64 {
    let p = position(at);
    let relative = triangle.map(|corner| position(corner) - p);
    let (volume, below, scale) = half_angle(relative);
    // Less may be nothing but rounding.
    if below > 1e-6 * scale {
        // In front of a plane and beside the triangle it is small, whatever its sign.
        if volume.abs() < 0.05 * below {
            // The series of the arc tangent, to 1e-12.
            let t = volume / below;
            let t2 = t * t;
            return 2.0 * t * (1.0 - t2 * (1.0 / 3.0 - t2 * (1.0 / 5.0 - t2 * (1.0 / 7.0))));
        }
        return 2.0 * volume.atan2(below);
    }
    solid_angle_on_edge(triangle, at)
}

/// The same for a point on an edge, or nearly: there, what is left is small beside what it was added up from. The corners are taken in an order of
/// their own, so that both orientations have the same roundings, and cancel.
#[cold]
fn solid_angle_on_edge(triangle: &FineTriangle, at: Corner) -> f64 {
    let p = position(at);
    let mut sorted = *triangle;
    sorted.sort_unstable();
    let is_turned = (0..3).all(|i| [triangle[i], triangle[(i + 1) % 3], triangle[(i + 2) % 3]] != sorted);
    let relative = sorted.map(|corner| position(corner) - p);
    let (volume, below, scale) = half_angle(relative);
    let rounding = 1e-12 * scale;
    let side = match volume.abs() > rounding {
        true if is_turned => -volume.signum(),
        true => volume.signum(),
        false => side(triangle, at),
    };
    if volume.abs() > rounding || below.abs() > rounding {
        return 2.0 * side * volume.abs().atan2(below);
    }
    // What is seen from a point that has really moved, by so much that roundings do not matter.
    let moved = DVec3::new(2f64.powi(-4), 2f64.powi(-14), 2f64.powi(-24));
    let (volume, below, _) = half_angle(relative.map(|corner| corner - moved));
    2.0 * side * volume.abs().atan2(below)
}

/// Of a triangle with corners relative to a point, what half its solid angle has as tangent: a fraction, and what its parts are to be compared
/// with.
fn half_angle([a, b, c]: [DVec3; 3]) -> (f64, f64, f64) {
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    let scale = la * lb * lc;
    (a.dot(b.cross(c)), scale + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb, scale)
}

/// On which side of a triangle's plane a point lies, once it has moved by (e, e^2, e^3): 1 on its back. 0 if there is no plane.
fn side(triangle: &FineTriangle, at: Corner) -> f64 {
    let [a, b, c] = triangle.map(|p| p.map(i64::from));
    let e: [i64; 3] = std::array::from_fn(|i| b[i] - a[i]);
    let f: [i64; 3] = std::array::from_fn(|i| c[i] - a[i]);
    let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    let height: i128 = (0..3).map(|i| i128::from(n[i]) * i128::from(a[i] - i64::from(at[i]))).sum();
    let moved = n.into_iter().map(|c| -c.signum()).find(|&s| s != 0).unwrap_or(0);
    if height == 0 { moved as f64 } else { height.signum() as f64 }
}

pub(super) fn slope_of_edge(a: DVec3, b: DVec3) -> DVec3 {
    let (la, lb) = (a.length(), b.length());
    let below = la * lb * (la * lb + a.dot(b));
    // On the line itself there is none.
    if below > 1e-12 * (la * lb).powi(2) { a.cross(b) * ((la + lb) / below) } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::super::field::distance_to;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// On an edge too, a triangle turned over is seen from the other side. (What was rounding once told the one orientation that it is
        /// seen from afar.)
        #[test]
        fn angles_change_sign_with_the_orientation(corners in prop::array::uniform3(prop::array::uniform3(1..20i32)), part in 0..9i32) {
            // As large as in a grid; the part of the edge is exact.
            let [a, b, c] = corners.map(|corner| corner.map(|x| 3_355_443 * x / 8 * 8));
            let at = std::array::from_fn(|i| a[i] + (b[i] - a[i]) / 8 * part);
            for [a, b, c] in [[a, b, c], [b, c, a], [c, a, b]] {
                let (there, back) = (solid_angle(&[a, b, c], at), solid_angle(&[c, b, a], at));
                prop_assert!((there + back).abs() < 1e-3, "{} {}", there, back);
            }
        }
    }

    proptest! {
        /// On a plane of a triangle too, angles jump where the rasteriser's lattice says.
        #[test]
        fn points_on_the_plane_are_on_one_side(a in prop::array::uniform3(1..20i32), b in prop::array::uniform3(1..20i32), c in prop::array::uniform3(1..20i32), at in prop::array::uniform3(1..20i32)) {
            let triangle = [a, b, c];
            let scaled = |p: Corner, by: i32| p.map(|x| x * by);
            // The same point really moved, in a finer grid.
            let (fine, moved) = (triangle.map(|p| scaled(p, 1 << 20)), scaled(at, 1 << 20));
            let moved = [moved[0] + (1 << 14), moved[1] + (1 << 7), moved[2] + 1];
            let (plain, beside) = (solid_angle(&triangle, at), solid_angle(&fine, moved));
            let [p, q, r] = triangle.map(position);
            // Beside the plane, but nearer to it than the step, which is a 64th, a point may really come to its other side.
            let normal = (q - p).cross(r - p);
            let height = normal.dot(p - position(at));
            prop_assume!(height == 0.0 || height.abs() > normal.length() / 32.0);
            prop_assert_eq!(side(&triangle, at), side(&fine, moved));
            // Away from edges and corners these are near to each other.
            let off = [[p, q], [q, r], [r, p]].map(|s| distance_to(s, position(at)));
            if off.iter().all(|d| d.is_nan() || *d > 0.3) {
                prop_assert!((plain - beside).abs() < 0.15, "{} {}", plain, beside);
            }
        }
    }
}
