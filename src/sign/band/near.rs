//! Closest points of triangles for the lattice points about them.

use super::{BRICK_BYTES, Field, NEAR, UNIT, Wanted};
use crate::geom::raster::FineTriangle;
use crate::grid::Key;
use crate::grid::brick::Local;
use crate::octree::LinearOctree;
use crate::progress::Progress;
use glam::DVec3;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Locks that threads seldom meet at.
const SHARDS: usize = 256;
/// Half the diagonal of a brick's points, and a little.
const BRICK_RADIUS: f64 = 6.1;
/// Triangles are tried on each brick of their bounds if these are at most so wide, in cells.
const SMALL: f64 = 12.0;

/// The bricks that have been found so far. An offer takes the nearer closest point, so that order and threads make no difference.
pub(super) struct Seeds {
    depth: u32,
    shards: Vec<Mutex<LinearOctree<Box<Field>>>>,
    bricks: AtomicUsize,
}

impl Seeds {
    pub(super) fn new(depth: u32) -> Self {
        let shards = (0..SHARDS).map(|_| Mutex::new(LinearOctree::new())).collect();
        Seeds { depth, shards, bricks: AtomicUsize::new(0) }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.bricks.load(Ordering::Relaxed) * BRICK_BYTES
    }

    /// All bricks, sorted.
    pub(super) fn into_bricks(self) -> Vec<(Key, Box<Field>)> {
        let mut bricks = Vec::new();
        for shard in self.shards {
            let mut shard = shard.into_inner().expect(NO_PANIC);
            for key in shard.keys_z() {
                bricks.extend(shard.remove(key).map(|field| (key, field)));
            }
        }
        bricks.sort_unstable_by_key(|b| b.0);
        bricks
    }

    fn with_brick(&self, brick: [u32; 3], change: impl FnOnce(&mut Field)) {
        let Some(key) = Key::cell(self.depth - 3, brick) else { return };
        let [x, y, z] = brick.map(|c| c as usize);
        let mut shard = self.shards[(x ^ y << 3 ^ z << 5) % SHARDS].lock().expect(NO_PANIC);
        change(shard.get_or_insert_with(key, || {
            self.bricks.fetch_add(1, Ordering::Relaxed);
            Box::new(Field::EMPTY)
        }));
    }

    /// Offers a point, in cells, to the lattice points about it.
    pub(super) fn add_point(&self, at: DVec3) {
        let (low, high) = ((at - NEAR).ceil(), (at + NEAR).floor());
        for_each(low, high, |p| {
            let brick = (p / 8.0).floor().as_uvec3().to_array();
            self.with_brick(brick, |field| offer(field, p, at));
        });
    }

    /// Offers a triangle's points to the lattice points about it; to fewer of them once `progress` is cancelled.
    pub(super) fn add_triangle(&self, fine: &FineTriangle, shift: u32, wanted: &impl Wanted, progress: &dyn Progress) {
        // Corners in a fixed order, so that the same triangle gives the same roundings however it is written.
        let mut fine = *fine;
        fine.sort_unstable();
        let [e, f] = [1, 2].map(|i| DVec3::from(std::array::from_fn(|a| f64::from(fine[i][a] - fine[0][a]))));
        let normal = e.cross(f);
        if normal == DVec3::ZERO || !wanted.triangle(&fine) {
            return;
        }
        let cell = f64::from(1u32 << shift);
        let corners = fine.map(|p| DVec3::from(p.map(f64::from)) / cell);
        let triangle = Triangle { corners, normal: normal.normalize() };
        let (low, high) = triangle.bounds(NEAR);
        if (high - low).max_element() <= SMALL {
            for_each((low / 8.0).floor(), (high / 8.0).floor(), |brick| self.add_to_brick(&triangle, brick, wanted));
        } else {
            triangle.for_bricks(|brick| {
                let centre = brick * 8.0 + 3.5;
                if !progress.is_cancelled() && triangle.closest(centre).distance(centre) <= NEAR + BRICK_RADIUS {
                    self.add_to_brick(&triangle, brick, wanted);
                }
            });
        }
    }

    fn add_to_brick(&self, triangle: &Triangle, brick: DVec3, wanted: &impl Wanted) {
        if brick.min_element() < 0.0 {
            return;
        }
        let (low, high) = triangle.bounds(NEAR);
        let (low, high) = (low.ceil().max(brick * 8.0), high.floor().min(brick * 8.0 + 7.0));
        let mut found: Vec<(DVec3, DVec3)> = Vec::new();
        let w = triangle.steepest();
        let (u, v) = ((w + 1) % 3, (w + 2) % 3);
        for_each_2d([low[u], low[v]], [high[u], high[v]], |at| {
            let [first, last] = triangle.slab([u, v, w], at, NEAR);
            let mut p = DVec3::ZERO;
            (p[u], p[v], p[w]) = (at[0], at[1], first.ceil().max(low[w]));
            while p[w] <= last.min(high[w]) {
                let closest = triangle.closest(p);
                if closest.distance_squared(p) <= NEAR * NEAR && wanted.point(closest) {
                    found.push((p, closest));
                }
                p[w] += 1.0;
            }
        });
        if !found.is_empty() {
            self.with_brick(brick.as_uvec3().to_array(), |field| {
                found.into_iter().for_each(|(p, closest)| offer(field, p, closest));
            });
        }
    }
}

/// Why locks are never poisoned.
const NO_PANIC: &str = "nothing panics while a brick is locked";

fn offer(field: &mut Field, point: DVec3, closest: DVec3) {
    let [x, y, z] = point.as_uvec3().to_array();
    let way = ((closest - point) * f64::from(UNIT)).round();
    field.offer(Local::new(x, y, z).index() as usize, way.to_array().map(|w| w as i16));
}

/// All integer points between two.
fn for_each(low: DVec3, high: DVec3, mut each: impl FnMut(DVec3)) {
    for_each_2d([low.x, low.y], [high.x, high.y], |[x, y]| {
        let mut z = low.z;
        while z <= high.z {
            each(DVec3::new(x, y, z));
            z += 1.0;
        }
    });
}

fn for_each_2d(low: [f64; 2], high: [f64; 2], mut each: impl FnMut([f64; 2])) {
    let mut x = low[0];
    while x <= high[0] {
        let mut y = low[1];
        while y <= high[1] {
            each([x, y]);
            y += 1.0;
        }
        x += 1.0;
    }
}

/// A triangle with its unit normal, in cells.
struct Triangle {
    corners: [DVec3; 3],
    normal: DVec3,
}

impl Triangle {
    fn bounds(&self, margin: f64) -> (DVec3, DVec3) {
        let [a, b, c] = self.corners;
        (a.min(b).min(c) - margin, a.max(b).max(c) + margin)
    }

    /// The axis that is nearest to the normal.
    fn steepest(&self) -> usize {
        let n = self.normal.abs();
        (0..3).fold(0, |best, a| if n[a] > n[best] { a } else { best })
    }

    /// The part of the line along `w` at (u, v) that is within `margin` of the plane.
    fn slab(&self, [u, v, w]: [usize; 3], at: [f64; 2], margin: f64) -> [f64; 2] {
        let (n, a) = (self.normal, self.corners[0]);
        let middle = a[w] - (n[u] * (at[0] - a[u]) + n[v] * (at[1] - a[v])) / n[w];
        let half = margin / n[w].abs();
        [middle - half, middle + half]
    }

    /// All bricks near the triangle, and a few more: rows of bricks along v, cut to where the triangle is.
    fn for_bricks(&self, mut each: impl FnMut(DVec3)) {
        let w = self.steepest();
        let (u, v) = ((w + 1) % 3, (w + 2) % 3);
        let margin = NEAR + BRICK_RADIUS;
        let (low, high) = self.bounds(NEAR);
        let (low, high) = ((low / 8.0).floor(), (high / 8.0).floor());
        let mut row = low[u];
        while row <= high[u] {
            let centre = row * 8.0 + 3.5;
            let [first, last] = self.range_along(u, v, [centre - margin, centre + margin]);
            let mut column = ((first - margin) / 8.0).floor().max(low[v]);
            while column <= ((last + margin) / 8.0).floor().min(high[v]) {
                let [first, last] = self.slab([u, v, w], [centre, column * 8.0 + 3.5], margin);
                let mut at = DVec3::ZERO;
                (at[u], at[v], at[w]) = (row, column, ((first - 7.0) / 8.0).ceil().max(low[w]));
                while at[w] <= (last / 8.0).floor().min(high[w]) {
                    each(at);
                    at[w] += 1.0;
                }
                column += 1.0;
            }
            row += 1.0;
        }
    }

    /// Between which coordinates along `v` the part of the triangle lies that is in a range along `u`; the wrong way round if none is.
    fn range_along(&self, u: usize, v: usize, range: [f64; 2]) -> [f64; 2] {
        let mut found = [f64::INFINITY, f64::NEG_INFINITY];
        let mut add = |x: f64| found = [found[0].min(x), found[1].max(x)];
        for i in 0..3 {
            let (a, b) = (self.corners[i], self.corners[(i + 1) % 3]);
            if (range[0]..=range[1]).contains(&a[u]) {
                add(a[v]);
            }
            for cut in range {
                if (a[u] < cut) != (b[u] < cut) {
                    add(a[v] + (b[v] - a[v]) * ((cut - a[u]) / (b[u] - a[u])));
                }
            }
        }
        found
    }

    /// The point of the triangle that is closest to `p`: by the part of the plane, inside, along an edge or at a corner, that it
    /// lies over (Ericson 2005, section 5.1.5).
    fn closest(&self, p: DVec3) -> DVec3 {
        let [a, b, c] = self.corners;
        let (ab, ac) = (b - a, c - a);
        let (ap, bp, cp) = (p - a, p - b, p - c);
        let (d1, d2) = (ab.dot(ap), ac.dot(ap));
        if d1 <= 0.0 && d2 <= 0.0 {
            return a;
        }
        let (d3, d4) = (ab.dot(bp), ac.dot(bp));
        if d3 >= 0.0 && d4 <= d3 {
            return b;
        }
        let (d5, d6) = (ab.dot(cp), ac.dot(cp));
        if d6 >= 0.0 && d5 <= d6 {
            return c;
        }
        let over_c = d1 * d4 - d3 * d2;
        if over_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return a + ab * (d1 / (d1 - d3));
        }
        let over_b = d5 * d2 - d1 * d6;
        if over_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return a + ac * (d2 / (d2 - d6));
        }
        let over_a = d3 * d6 - d5 * d4;
        if over_a <= 0.0 && d4 >= d3 && d5 >= d6 {
            return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
        }
        p - self.normal * self.normal.dot(ap)
    }
}
