//! Cutting polygons into triangles.
//!
//! Whatever the polygon, `n` corners give `n - 2` triangles in which every side of the polygon occurs once and every
//! diagonal twice, once each way. So triangles have the boundary (mod 2, and with signs) that the polygon had: a closed
//! mesh stays closed, and holes keep their rims. Shape decides only which of these triangulations it is: a simple
//! polygon gets one without overlaps; a hopeless one gets some.

use glam::{DVec2, DVec3};

/// Visits of blocking corners and tests of ears granted to a polygon, plus [`WORK_PER_CORNER`] each: about 0.1 s.
const WORK: u64 = 1 << 24;
/// A comb of 100,000 corners takes 8 a corner; tangles run into this bound.
const WORK_PER_CORNER: u64 = 256;

/// Appends triangles that cover the polygon with the given corners (indices into `points`), oriented as it is.
///
/// A polygon of `n` corners yields exactly `n - 2` triangles, none when `n < 3`. Four corners are split by the diagonal
/// that leaves both halves facing the same way, then by the shorter one, whatever corner comes first; more are cut off ear
/// by ear in the plane of the Newell normal. Corners that repeat or do not exist or are not finite, and polygons that
/// cross themselves, give triangles without area or overlaps, but as many and with the same boundary.
///
/// Linear for convex polygons and for most others; the worst case is bounded at about 0.1 s and then trades shape for time.
pub fn triangulate(points: &[DVec3], polygon: &[u32], out: &mut Vec<[u32; 3]>) {
    match *polygon {
        [] | [_] | [_, _] => {}
        [a, b, c] => out.push([a, b, c]),
        [a, b, c, d] => out.extend(split_quad([a, b, c, d], [a, b, c, d].map(|i| point(points, i)))),
        _ => Ears::new(points, polygon, out).clip(),
    }
}

/// The point with an index, or NaN where there is none.
fn point(points: &[DVec3], index: u32) -> DVec3 {
    points.get(index as usize).copied().unwrap_or(DVec3::NAN)
}

/// The two triangles on either side of the better diagonal.
fn split_quad([a, b, c, d]: [u32; 4], [p, q, r, s]: [DVec3; 4]) -> [[u32; 3]; 2] {
    // How well the diagonal from `p` to `r` splits p q r s: 1 when both halves face the same way, 0 when one has no area.
    let facing = |p: DVec3, q: DVec3, r: DVec3, s: DVec3| {
        let agreement = (q - p).cross(r - p).dot((r - p).cross(s - p));
        i32::from(agreement > 0.0) - i32::from(agreement < 0.0)
    };
    let length =
        |p: DVec3, r: DVec3| if p.is_finite() && r.is_finite() { p.distance_squared(r) } else { f64::INFINITY };
    let from_a = facing(q, r, s, p)
        .cmp(&facing(p, q, r, s))
        .then(length(p, r).total_cmp(&length(q, s)))
        .then(a.min(c).cmp(&b.min(d)))
        .is_le();
    if from_a { [[a, b, c], [a, c, d]] } else { [[b, c, d], [b, d, a]] }
}

/// The area vector of a closed polyline: twice its area long, normal to its plane (Newell). Corners that are not finite
/// are left out.
fn newell(corners: &[DVec3]) -> DVec3 {
    let mut finite = corners.iter().filter(|p| p.is_finite());
    let Some(&origin) = finite.next() else { return DVec3::ZERO };
    let (sum, _) = finite.fold((DVec3::ZERO, DVec3::ZERO), |(sum, last), &p| {
        let edge = p - origin;
        (sum + last.cross(edge), edge)
    });
    sum
}

/// Twice the signed area of a triangle, positive when counter-clockwise.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// What is left of a polygon while its ears are cut off.
struct Ears<'a> {
    polygon: &'a [u32],
    corners: Vec<DVec3>,
    /// Corners without the coordinate in which the polygon is thinnest, so that it runs counter-clockwise.
    /// Dropping a coordinate rounds nothing.
    flat: Vec<DVec2>,
    /// Neighbours in the ring of corners that are left.
    next: Vec<u32>,
    prev: Vec<u32>,
    left: usize,
    blockers: Buckets,
    work: u64,
    out: &'a mut Vec<[u32; 3]>,
}

/// Marks a corner that has been cut off, in `Ears::next`.
const GONE: u32 = u32::MAX;

impl<'a> Ears<'a> {
    fn new(points: &[DVec3], polygon: &'a [u32], out: &'a mut Vec<[u32; 3]>) -> Self {
        let n = polygon.len();
        let corners: Vec<DVec3> = polygon.iter().map(|&i| point(points, i)).collect();
        let normal = newell(&corners);
        let flatten = |p: &DVec3| match normal.abs().max_position() {
            0 if normal.x >= 0.0 => DVec2::new(p.y, p.z),
            0 => DVec2::new(p.z, p.y),
            1 if normal.y >= 0.0 => DVec2::new(p.z, p.x),
            1 => DVec2::new(p.x, p.z),
            _ if normal.z >= 0.0 => DVec2::new(p.x, p.y),
            _ => DVec2::new(p.y, p.x),
        };
        let flat = corners.iter().map(flatten).collect();
        let next = (0..n).map(|i| ((i + 1) % n) as u32).collect();
        let prev = (0..n).map(|i| ((i + n - 1) % n) as u32).collect();
        let work = WORK + WORK_PER_CORNER * n as u64;
        out.reserve(n - 2);
        Ears { polygon, corners, flat, next, prev, left: n, blockers: Buckets::default(), work, out }
    }

    fn clip(mut self) {
        self.drop_void_corners();
        let reflex = self.ring().filter(|&i| self.turn_at(i) <= 0.0 && self.flat[i as usize].is_finite()).collect();
        self.blockers = Buckets::new(reflex, &self.flat);
        // Cutting an ear makes its neighbours wait for the next round, so that triangles stay plump; every other round runs
        // backwards, lest long strips become fans.
        let mut waiting: Vec<u32> = self.ring().collect();
        let mut candidates = Vec::new();
        let mut last_wait = vec![0u32; self.next.len()];
        let (mut round, mut greed) = (0, 0);
        while self.left > 3 {
            round += 1;
            if waiting.is_empty() {
                // No ear left: not a simple polygon. Be content with less, for one triangle.
                greed += 1;
                waiting.extend(self.ring());
                self.work = self.work.saturating_sub(self.next.len() as u64);
            }
            std::mem::swap(&mut candidates, &mut waiting);
            if round % 2 == 0 {
                candidates.reverse();
            }
            for at in candidates.drain(..) {
                if self.left > 3 && last_wait[at as usize] != round && self.may_cut(at, greed) {
                    greed = 0;
                    for i in [self.prev[at as usize], self.next[at as usize]] {
                        if last_wait[i as usize] != round {
                            last_wait[i as usize] = round;
                            waiting.push(i);
                        }
                    }
                    self.cut(at);
                }
            }
        }
        let last = self.ring().next().expect("three corners are left");
        self.out.push(self.triangle(last));
    }

    /// Cuts off corners that cannot span a proper triangle: not finite, repeated, or the tip of a spike without width.
    fn drop_void_corners(&mut self) {
        let (mut at, mut unseen) = (0u32, self.left);
        while unseen > 0 && self.left > 3 {
            let [a, b, c] = self.neighbours(at).map(|i| self.corners[i as usize]);
            if !b.is_finite() || b == c || a == c {
                // The corner before has a new neighbour: look at it again.
                let before = self.prev[at as usize];
                self.cut(at);
                at = before;
            } else {
                at = self.next[at as usize];
                unseen -= 1;
            }
        }
    }

    /// Corners that are left, in order.
    fn ring(&self) -> impl Iterator<Item = u32> + use<'_> {
        (0..self.next.len() as u32).filter(|&i| self.next[i as usize] != GONE)
    }

    fn neighbours(&self, at: u32) -> [u32; 3] {
        [self.prev[at as usize], at, self.next[at as usize]]
    }

    fn triangle(&self, at: u32) -> [u32; 3] {
        self.neighbours(at).map(|i| self.polygon[i as usize])
    }

    fn turn_at(&self, at: u32) -> f64 {
        let [a, b, c] = self.neighbours(at).map(|i| self.flat[i as usize]);
        turn(a, b, c)
    }

    /// Removes a corner from the ring and emits its triangle.
    fn cut(&mut self, at: u32) {
        self.out.push(self.triangle(at));
        let [before, _, after] = self.neighbours(at);
        self.next[before as usize] = after;
        self.prev[after as usize] = before;
        self.next[at as usize] = GONE;
        self.left -= 1;
    }

    /// Whether to cut off this corner. Greed 0 asks for a proper ear, 1 for any corner that is not reflex, 2 for any;
    /// nobody asks once the work granted is spent.
    fn may_cut(&mut self, at: u32, greed: u32) -> bool {
        self.work = self.work.saturating_sub(1);
        match greed {
            _ if self.work == 0 => true,
            0 => self.turn_at(at) > 0.0 && !self.is_blocked(at),
            1 => self.turn_at(at) >= 0.0,
            _ => true,
        }
    }

    /// Whether another part of the polygon reaches into the triangle at a convex corner.
    fn is_blocked(&mut self, at: u32) -> bool {
        let ids = self.neighbours(at);
        let [a, b, c] = ids.map(|i| self.flat[i as usize]);
        let mut visits = 0;
        let blocked = self.blockers.any_within(a.min(b).min(c), a.max(b).max(c), &mut visits, |i| {
            let p = self.flat[i as usize];
            self.next[i as usize] != GONE
                && turn(a, b, p) >= 0.0
                && turn(b, c, p) >= 0.0
                && turn(c, a, p) >= 0.0
                && p != a
                && p != b
                && p != c
                && self.turn_at(i) <= 0.0
        });
        self.work = self.work.saturating_sub(visits);
        blocked
    }
}

/// A grid of square cells over some corners, about as many cells as corners.
#[derive(Default)]
struct Buckets {
    min: DVec2,
    cells_per_unit: DVec2,
    /// Cells in each direction; 0 when there are no corners.
    cells: [usize; 2],
    /// Where each cell's corners end in `corners`.
    ends: Vec<u32>,
    corners: Vec<u32>,
}

impl Buckets {
    fn new(mut corners: Vec<u32>, flat: &[DVec2]) -> Self {
        if corners.is_empty() {
            return Buckets::default();
        }
        let at = |i: &u32| flat[*i as usize];
        let min = corners.iter().map(at).fold(DVec2::INFINITY, DVec2::min);
        let max = corners.iter().map(at).fold(DVec2::NEG_INFINITY, DVec2::max);
        let extent = (max - min).max(DVec2::splat(f64::MIN_POSITIVE));
        let count = corners.len() as f64;
        let across = |ratio: f64| (count * ratio).sqrt().clamp(1.0, count) as usize;
        let cells = [across(extent.x / extent.y), across(extent.y / extent.x)];
        let cells_per_unit = DVec2::from_array(cells.map(|n| n as f64)) / extent;
        let ends = vec![0; cells[0] * cells[1]];
        let mut grid = Buckets { min, cells_per_unit, cells, ends, corners: Vec::new() };
        corners.sort_by_cached_key(|i| grid.cell(at(i)));
        for i in &corners {
            let [x, y] = grid.cell(at(i));
            grid.ends[x * cells[1] + y] += 1;
        }
        let mut total = 0;
        for end in &mut grid.ends {
            total += *end;
            *end = total;
        }
        grid.corners = corners;
        grid
    }

    fn cell(&self, p: DVec2) -> [usize; 2] {
        let cell = (p - self.min) * self.cells_per_unit;
        [(cell.x as usize).min(self.cells[0] - 1), (cell.y as usize).min(self.cells[1] - 1)]
    }

    /// Whether a corner in the cells that a box touches passes the test; adds what was looked at to `visits`.
    fn any_within(&self, min: DVec2, max: DVec2, visits: &mut u64, test: impl Fn(u32) -> bool) -> bool {
        if self.corners.is_empty() {
            return false;
        }
        let ([x0, y0], [x1, y1]) = (self.cell(min), self.cell(max));
        (x0..=x1).any(|x| {
            // The cells of a column lie one after another.
            let (first, last) = (x * self.cells[1] + y0, x * self.cells[1] + y1);
            let start = if first == 0 { 0 } else { self.ends[first - 1] };
            let column = &self.corners[start as usize..self.ends[last] as usize];
            *visits += 1 + column.len() as u64;
            column.iter().any(|&i| test(i))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashMap;
    use std::f64::consts::TAU;

    fn cut(points: &[DVec3], polygon: &[u32]) -> Vec<[u32; 3]> {
        let mut out = Vec::new();
        triangulate(points, polygon, &mut out);
        out
    }

    /// Oriented edges with their multiplicity; opposite ones cancel.
    fn boundary<'a>(faces: impl IntoIterator<Item = &'a [u32]>) -> HashMap<(u32, u32), i32> {
        let mut edges = HashMap::new();
        for face in faces {
            for k in 0..face.len() {
                let (a, b) = (face[k], face[(k + 1) % face.len()]);
                if a != b {
                    *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
                }
            }
        }
        edges.retain(|_, n| *n != 0);
        edges
    }

    fn check_law(points: &[DVec3], polygon: &[u32]) -> Vec<[u32; 3]> {
        let triangles = cut(points, polygon);
        assert_eq!(triangles.len(), polygon.len().max(2) - 2);
        assert_eq!(boundary(triangles.iter().map(|t| &t[..])), boundary([polygon].into_iter().filter(|p| p.len() > 2)));
        triangles
    }

    /// Checks a simple planar polygon: its triangles all face its way and their areas add up to its own.
    fn check_area(points: &[DVec3], polygon: &[u32]) {
        let corners: Vec<DVec3> = polygon.iter().map(|&i| points[i as usize]).collect();
        let area = newell(&corners);
        let normal = area.normalize();
        let covered: f64 = check_law(points, polygon)
            .iter()
            .map(|t| newell(&t.map(|i| points[i as usize])))
            .inspect(|a| assert!(a.dot(normal) >= -1e-9 * area.length(), "a triangle faces the wrong way"))
            .map(DVec3::length)
            .sum();
        assert!((covered - area.length()).abs() <= 1e-9 * area.length(), "{covered} is not {}", area.length());
    }

    fn all(points: &[DVec3]) -> Vec<u32> {
        (0..points.len() as u32).collect()
    }

    /// A star-shaped polygon in a tilted plane.
    fn star(radii: &[f64], tilt: f64) -> Vec<DVec3> {
        let ring = |(i, r): (usize, &f64)| {
            let p = *r * DVec2::from_angle(TAU * i as f64 / radii.len() as f64);
            glam::DQuat::from_rotation_y(tilt) * DVec3::new(p.x, p.y, 0.25)
        };
        radii.iter().enumerate().map(ring).collect()
    }

    /// A comb with teeth up and down, sides full of collinear corners.
    fn comb(teeth: usize) -> Vec<DVec3> {
        let x = |i: usize| i as f64;
        let upper = (0..=2 * teeth).rev().map(|i| DVec3::new(x(i), 0.0, [1.0, 9.0][i % 2]));
        let lower = (0..=2 * teeth).map(|i| DVec3::new(x(i), 0.0, [0.0, 0.875][i % 2]));
        lower.chain(upper).collect()
    }

    #[test]
    fn quads_take_the_better_diagonal_from_any_corner() {
        let dart = [DVec3::ZERO, DVec3::new(2.0, -1.0, 0.0), DVec3::new(0.5, 0.0, 0.0), DVec3::new(2.0, 1.0, 0.0)];
        let kite = [DVec3::ZERO, DVec3::new(1.0, -1.0, 0.0), DVec3::new(9.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.0)];
        for (points, diagonal) in [(dart, [0, 2]), (kite, [1, 3])] {
            for polygon in [[0, 1, 2, 3], [1, 2, 3, 0], [2, 3, 0, 1], [3, 0, 1, 2], [3, 2, 1, 0], [0, 3, 2, 1]] {
                let triangles = check_law(&points, &polygon);
                assert!(triangles.iter().all(|t| diagonal.iter().all(|i| t.contains(i))), "{polygon:?}: {triangles:?}");
            }
            check_area(&points, &[0, 1, 2, 3]);
        }
    }

    #[test]
    fn a_polygon_with_a_hole_on_a_bridge_is_cut_right() {
        let square = |r: f64| [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(x, y)| DVec3::new(y, 5.0, x));
        let points = [square(2.0), square(1.0)].concat();
        check_area(&points, &[0, 1, 2, 3, 0, 4, 7, 6, 5, 4]);
    }

    /// Polygons that are not planar, as modellers write them: triangles all look where the polygon does, and none is a needle.
    #[test]
    fn bent_polygons_are_cut_without_folds() {
        for n in [4u32, 5, 6, 12, 40] {
            for wave in [0.05, 0.2, 0.4] {
                let corner = |i: u32| {
                    let turn = std::f64::consts::TAU * f64::from(i) / f64::from(n);
                    DVec3::new(turn.cos(), turn.sin(), wave * (2.0 * turn).sin())
                };
                let points: Vec<DVec3> = (0..n).map(corner).collect();
                let mut cut = Vec::new();
                triangulate(&points, &all(&points), &mut cut);
                assert_eq!(cut.len(), n as usize - 2);
                let normals =
                    || cut.iter().map(|t| t.map(|i| points[i as usize])).map(|[a, b, c]| (b - a).cross(c - a));
                assert!(normals().all(|normal| normal.z > 0.0), "{n} {wave}");
                // As large as seen from above, and by the slope a little larger.
                let (flat, area) = (normals().map(|n| n.z).sum::<f64>(), normals().map(DVec3::length).sum::<f64>());
                assert!((flat - f64::from(n) * (std::f64::consts::TAU / f64::from(n)).sin()).abs() < 1e-12);
                assert!(area < flat * (1.0 + 4.0 * wave * wave), "{n} {wave}: {area} over {flat}");
            }
        }
    }

    #[test]
    fn corners_without_a_place_spoil_one_triangle_each() {
        let mut points = star(&[1.0; 12], 0.3);
        points[3] = DVec3::NAN;
        points[7].y = f64::INFINITY;
        let triangles = check_law(&points, &[0, 1, 2, 3, 4, 5, 99, 6, 7, 8, 9, 10, 11]);
        let spoilt = triangles.iter().filter(|t| t.iter().any(|&i| !point(&points, i).is_finite())).count();
        assert_eq!(spoilt, 3);
    }

    #[test]
    fn large_polygons_do_not_hang() {
        let n = 100_000;
        let line: Vec<DVec3> = (0..n).map(|i| DVec3::splat(i as f64)).collect();
        let tangle: Vec<DVec3> = (0..n).map(|i| star(&[1.0; 7], 0.0)[i * i % 7] * (i as f64).sin()).collect();
        for (name, points) in
            [("comb", comb(n / 4)), ("disc", star(&vec![1.0; n], 1.0)), ("line", line), ("tangle", tangle)]
        {
            let start = std::time::Instant::now();
            let triangles = cut(&points, &all(&points));
            let seconds = start.elapsed().as_secs_f64();
            println!("{name}: {seconds:.3} s");
            assert!(seconds < 5.0, "{name} took {seconds} s");
            assert_eq!(boundary(triangles.iter().map(|t| &t[..])), boundary([&all(&points)[..]]));
        }
        check_area(&comb(n / 4), &all(&comb(n / 4)));
    }

    proptest! {
        #[test]
        fn triangles_have_the_boundary_of_their_polygon(
            polygon in prop::collection::vec(0u32..9, 0..14),
            points in prop::collection::vec(prop::array::uniform3(-2i8..3), 8),
        ) {
            let points: Vec<DVec3> = points.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
            check_law(&points, &polygon);
        }

        #[test]
        fn triangles_tile_star_shaped_polygons(radii in prop::collection::vec(0.01..1.0, 5..60), tilt in -4.0..4.0) {
            let points = star(&radii, tilt);
            check_area(&points, &all(&points));
        }

        #[test]
        fn triangles_tile_combs(teeth in 1usize..40, start in 0usize..20, reversed: bool) {
            let points = comb(teeth);
            let mut polygon = all(&points);
            polygon.rotate_left(start % points.len());
            if reversed {
                polygon.reverse();
            }
            check_area(&points, &polygon);
        }
    }
}
