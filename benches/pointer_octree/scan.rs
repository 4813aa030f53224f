//! Scan conversion by descent: a triangle goes down to all cells that it touches (Ju 2004, section 3), by separating axes.
//!
//! A triangle and a cube are apart if they are along one of 13 axes: the cube's three, the triangle's normal, and the cross products of the
//! cube's and the triangle's edges. The nine of these are the edges of the triangle's projections along x, y and z, of which the nearest
//! corner of the cube is looked at (Schwarz and Seidel 2010). Going down, nothing is projected again: the value of each edge function at a
//! child is its parent's and one or two additions. Levels at which the triangle's box lies in one child are skipped.
//!
//! At the bottom, each of the three edges at the cell's least corner is compared with the triangle. Whether it is crossed is decided exactly,
//! and ties as zmend decides them (`geom::raster`), so that both trees have the same crossed edges. A leaf is made for every cell that is
//! touched, as PolyMender does; thus the four cells round a crossed edge have leaves.

use super::node::{Inner, Node, Tree};
use super::traverse::OTHERS;
use std::cell::Cell;
use zmend::geom::Frame;
use zmend::glam::DVec3;
use zmend::mesh::TriangleSource;

/// log2 of the fixed-point units a side of the root, as `Frame::snap` counts.
const FINE_BITS: u32 = zmend::geom::frame::FINE_BITS;

/// A triangle in fixed-point units, ready to go down.
struct Falling {
    corners: [[i64; 3]; 3],
    min: [i64; 3],
    max: [i64; 3],
    normal: [i64; 3],
    /// Edge functions by the axis along which one looks and by edge: slopes along the two other axes.
    slopes: [[[i64; 2]; 3]; 3],
    /// By how much they grow at most over a cube with sides of 1.
    reach: [[i64; 3]; 3],
    /// Slopes of the plane, and by how much its value may be wrong.
    plane: [f64; 3],
    /// By how much the plane's value falls and grows at most over a cube with sides of 1.
    plane_reach: [f64; 2],
    slack: f64,
}

/// The functions at the least corner of a cell.
#[derive(Clone, Copy)]
struct Values {
    edges: [[i64; 3]; 3],
    plane: f64,
}

/// Marks the edges that the triangles of a source cross; returns how many triangles there were.
///
/// # Errors
/// Those of the source.
pub(crate) fn scan<R: Default>(
    tree: &Tree<'_, R>,
    source: &mut dyn TriangleSource,
    frame: &Frame,
) -> zmend::Result<u64> {
    let snapped = |p: DVec3| frame.snap(p).map(|p| p.map(i64::from));
    let counts = source.triangles(&mut |batch| {
        for &[a, b, c] in batch {
            if let (Some(a), Some(b), Some(c)) = (snapped(a), snapped(b), snapped(c)) {
                Falling::new([a, b, c]).fall(tree);
            }
        }
        Ok(())
    })?;
    Ok(counts.triangles)
}

impl Falling {
    fn new(corners: [[i64; 3]; 3]) -> Self {
        let [p, q, r] = corners;
        let along = |f: fn(i64, i64) -> i64| std::array::from_fn(|a| f(f(p[a], q[a]), r[a]));
        let (e, f): ([i64; 3], [i64; 3]) = (std::array::from_fn(|a| q[a] - p[a]), std::array::from_fn(|a| r[a] - p[a]));
        let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        let slopes = std::array::from_fn(|axis| {
            let [u, v] = OTHERS[axis];
            // Seen along y, x and z have the other handedness.
            let sign = if (normal[axis] > 0) == (axis != 1) { 1 } else { -1 };
            std::array::from_fn(|i| {
                let (p, q) = (corners[i], corners[(i + 1) % 3]);
                [sign * (p[v] - q[v]), sign * (q[u] - p[u])]
            })
        });
        let plane = normal.map(|n| -(n as f64));
        let slack = plane.iter().map(|n| n.abs()).sum::<f64>() / f64::from(1 << 16);
        let reach = slopes.map(|edges: [[i64; 2]; 3]| edges.map(|[a, b]| a.max(0) + b.max(0)));
        let plane_reach = [plane.iter().map(|n| n.min(0.0)).sum(), plane.iter().map(|n| n.max(0.0)).sum()];
        let (min, max) = (along(i64::min), along(i64::max));
        Falling { corners, min, max, normal, slopes, reach, plane, plane_reach, slack }
    }

    /// The functions at a point.
    fn values(&self, at: [i64; 3]) -> Values {
        let edges = std::array::from_fn(|axis| {
            let [u, v] = OTHERS[axis];
            std::array::from_fn(|i| {
                let ([a, b], p) = (self.slopes[axis][i], self.corners[i]);
                a * (at[u] - p[u]) + b * (at[v] - p[v])
            })
        });
        let plane = (0..3).map(|a| self.plane[a] * (at[a] - self.corners[0][a]) as f64).sum();
        Values { edges, plane }
    }

    /// Goes down from the root.
    fn fall<R: Default>(&self, tree: &Tree<'_, R>) {
        let shift = FINE_BITS - tree.depth;
        // Cells touched, those beside the triangle included.
        let low = self.min.map(|c| (c - 1) >> shift);
        let differing = (0..3).fold(0, |bits, a| bits | (low[a] ^ (self.max[a] >> shift)));
        let common = 64 - differing.leading_zeros();
        let mut node = tree.root;
        for level in (common..tree.depth).rev() {
            let Node::Inner(inner) = node else { break };
            let i = (0..3).fold(0, |i, a| 2 * i + (low[a] >> level & 1)) as usize;
            node = made(tree, &inner.kids[i], level == 0);
        }
        let at = low.map(|c| c >> common << (common + shift));
        match node {
            Node::Inner(inner) => self.enter(tree, inner, at, common + shift - 1, &self.values(at)),
            Node::Leaf(_) => self.mark(node, at, shift, &self.values(at)),
        }
    }

    /// Goes on to the children of a cell, of side 2^`half` each.
    fn enter<'a, R: Default>(
        &self,
        tree: &Tree<'a, R>,
        inner: &'a Inner<'a, R>,
        at: [i64; 3],
        half: u32,
        values: &Values,
    ) {
        let shift = FINE_BITS - tree.depth;
        let side = 1i64 << half;
        // By axis and half: whether the triangle's box touches it.
        let touched: [[bool; 2]; 3] =
            std::array::from_fn(|a| [self.min[a] <= at[a] + side, self.max[a] >= at[a] + side]);
        for i in 0..8 {
            let high = [i >> 2, i >> 1 & 1, i & 1];
            if !(touched[0][high[0]] && touched[1][high[1]] && touched[2][high[2]]) {
                continue;
            }
            let Some(values) = self.overlaps(values, high, half) else { continue };
            let at = [0, 1, 2].map(|a: usize| at[a] + ((high[a] as i64) << half));
            let kid = made(tree, &inner.kids[i], half == shift);
            match kid {
                Node::Inner(inner) => self.enter(tree, inner, at, half - 1, &values),
                Node::Leaf(_) => self.mark(kid, at, shift, &values),
            }
        }
    }

    /// The functions at the least corner of a child, if no axis separates it from the triangle.
    #[inline]
    fn overlaps(&self, values: &Values, high: [usize; 3], half: u32) -> Option<Values> {
        let mut child = *values;
        let [x, y, z] = [-(high[0] as i64), -(high[1] as i64), -(high[2] as i64)];
        let side = (1i64 << half) as f64;
        let [p, q, r] = self.plane;
        child.plane += side * (p * high[0] as f64 + q * high[1] as f64 + r * high[2] as f64);
        if child.plane + side * self.plane_reach[0] - self.slack > 0.0
            || child.plane + side * self.plane_reach[1] + self.slack < 0.0
        {
            return None;
        }
        let overlaps = self.step(0, &mut child, [y, z], half)
            && self.step(1, &mut child, [x, z], half)
            && self.step(2, &mut child, [x, y], half);
        overlaps.then_some(child)
    }

    /// Moves the edge functions seen along an axis to a child; whether it touches the triangle's projection.
    #[inline]
    fn step(&self, axis: usize, values: &mut Values, [u, v]: [i64; 2], half: u32) -> bool {
        let (slopes, reach, values) = (&self.slopes[axis], &self.reach[axis], &mut values.edges[axis]);
        let mut least = 0;
        for i in 0..3 {
            let [a, b] = slopes[i];
            values[i] += ((a & u) + (b & v)) << half;
            least |= values[i] + (reach[i] << half);
        }
        least >= 0
    }

    /// Marks those of the three edges at the least corner of a cell that are crossed.
    #[inline]
    fn mark<R>(&self, leaf: &Node<'_, R>, at: [i64; 3], shift: u32, values: &Values) {
        let Node::Leaf(leaf) = leaf else { return };
        for axis in 0..3 {
            let [p, q, r] = values.edges[axis];
            if (p | q | r) < 0 || self.normal[axis] == 0 {
                continue;
            }
            // A line through an edge of the projection passes on one side of it.
            let beside = |i: usize| {
                let [a, b] = self.slopes[axis][i];
                values.edges[axis][i] == 0 && !(a > 0 || (a == 0 && b > 0))
            };
            if beside(0) || beside(1) || beside(2) {
                continue;
            }
            if let Some(offset) = self.offset(axis, at, shift) {
                leaf.a.set(leaf.a.get() ^ 1 << (4 * axis));
                let place = 16 * axis;
                leaf.b.set(leaf.b.get() & !(0xffff << place) | u64::from(offset) << place);
            }
        }
    }

    /// Where the plane meets the edge along `axis` that starts at a point, in 65536ths of a cell; `None` if that is elsewhere.
    #[inline]
    fn offset(&self, axis: usize, at: [i64; 3], shift: u32) -> Option<u16> {
        let (mut value, mut size) = (0.0, 0.0);
        for (slope, (at, from)) in self.plane.iter().zip(at.iter().zip(self.corners[0])) {
            let part = slope * (at - from) as f64;
            value += part;
            size += part.abs();
        }
        let slope = self.plane[axis];
        let cells = -value / slope / (1i64 << shift) as f64;
        let error = size / slope.abs() / (1i64 << shift) as f64 * 2f64.powi(-50);
        if cells > error && cells < 1.0 - error {
            return Some((cells * 65536.0) as u16);
        }
        if cells < -error || cells > 1.0 + error { None } else { self.exact_offset(axis, at, shift) }
    }

    /// The same in whole numbers, where rounding could make a difference.
    #[cold]
    fn exact_offset(&self, axis: usize, at: [i64; 3], shift: u32) -> Option<u16> {
        let sign = i128::from(self.normal[axis].signum());
        let normal = self.normal.map(|n| sign * i128::from(n));
        let numerator: i128 = (0..3).map(|a| normal[a] * i128::from(self.corners[0][a] - at[a])).sum();
        let denominator = normal[axis] << shift;
        // The plane's slope along the axes that the lattice is moved along before this one.
        let is_above = normal[..axis].iter().map(|n| -n).find(|&slope| slope != 0).is_some_and(|slope| slope > 0);
        let (cell, rest) = (numerator.div_euclid(denominator), numerator.rem_euclid(denominator));
        match (cell, rest, is_above) {
            (0, 0, true) => Some(0),
            (1, 0, false) => Some(u16::MAX),
            (_, 0, _) => None,
            (0, ..) => Some(((rest << 16) / denominator) as u16),
            _ => None,
        }
    }
}

/// The node behind a pointer, made if there is none.
#[inline]
fn made<'a, R: Default>(tree: &Tree<'a, R>, link: &Cell<Option<&'a Node<'a, R>>>, is_leaf: bool) -> &'a Node<'a, R> {
    link.get().unwrap_or_else(|| {
        let node = if is_leaf { tree.memory.leaf() } else { tree.memory.inner() };
        link.set(Some(node));
        node
    })
}
