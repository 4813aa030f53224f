//! Exact rasterisation of triangles along lattice lines.
//!
//! For each of the three axes, a triangle is projected along the axis and the lattice lines of that axis that pass through
//! it are found with integer edge functions; where each line meets the triangle's plane is a hit.
//!
//! # Ties
//!
//! A line through a triangle's edge or vertex, and a hit exactly on a lattice point, are decided by ONE symbolic
//! perturbation: the whole lattice is moved by (e, e^2, e^3) along x, y, z, with e positive and smaller than anything
//! else (Edelsbrunner and Muecke 1990 call this simulation of simplicity). No line then meets an edge and no lattice point
//! lies on a triangle, and because it is the same motion for all three axes, the four lattice edges round a grid face are
//! still a closed square in general position. So a closed surface crosses it an even number of times: **for closed input
//! the parity round every grid face is even, whatever the degeneracy**.
//!
//! - Inside the projection: an edge function E(u, v) = A u + B v + C that is 0 counts as positive if A > 0, or A = 0 and
//!   B > 0, where u is the earlier of the two axes (its perturbation dominates).
//! - Along the axis: a hit at exactly the lattice coordinate w is above the moved point if the plane's slope along the
//!   axes that move more than w is positive, taken in order; if all are 0 (or none moves more), it is below.
//!
//! # Precision
//!
//! Coordinates are integers below 2^26 ([`FINE_BITS`](super::frame::FINE_BITS)), edge functions below 2^54, so the choice
//! of lines is exact in `i64`. The depth of a hit is a fixed-point linear function of the line; where that comes within
//! one 1/65536 of a cell to a lattice point, it is computed again as an exact fraction in `i128`. Triangles so steep that the
//! error bound of the fast way is not below that are done exactly throughout.

use crate::grid::Axis;

/// A triangle in fixed-point coordinates.
pub type FineTriangle = [[i32; 3]; 3];

/// Receives what [`rasterise`] finds.
pub trait Hits {
    /// The triangle's plane crosses lines along `axis` at the hits that follow. Its normal (x, y, z; of any length) is oriented as the
    /// triangle is: seen from where it points to, the corners run counter-clockwise.
    fn plane(&mut self, axis: Axis, normal: [f64; 3]);

    /// The lattice edge that starts at lattice point `at` and runs one cell along `axis` is crossed, `offset` 65536ths of a
    /// cell from its start.
    fn hit(&mut self, axis: Axis, at: [u32; 3], offset: u16);

    /// Whether no more hits are wanted: asked every some rows of lattice lines, so that even the largest triangle soon ends.
    fn is_enough(&self) -> bool {
        false
    }
}

/// Rows of a triangle between two looks at [`Hits::is_enough`], some milliseconds in the finest grid; where there are no more columns than
/// that, they are looked at together.
const BAND: i64 = 8;

/// Extra bits of the fixed-point depth below 1/65536 of a cell.
const GUARD_BITS: u32 = 20;

/// Passes every crossing of `triangle` with a lattice edge to `hits`. Cells are 2^shift units wide. The order of the three
/// corners makes no difference to what is found. Cost: some 60 ns for a triangle smaller than a cell, then about 3 ns a hit.
///
/// Coordinates must lie in 1 .. 2^26.
pub fn rasterise(triangle: &FineTriangle, shift: u32, hits: &mut impl Hits) {
    let mut t = *triangle;
    // Corners in a fixed order, so that the same triangle gives the same roundings however it is written.
    let mut turned = false;
    if t[1] < t[0] {
        t.swap(0, 1);
        turned = true;
    }
    if t[2] < t[1] {
        t.swap(1, 2);
        turned = !turned;
        if t[1] < t[0] {
            t.swap(0, 1);
            turned = !turned;
        }
    }
    // Corners are sorted along x.
    let ceil = |x: i32| (i64::from(x) + (1 << shift) - 1) >> shift;
    let of = |a: usize| (ceil(t[0][a].min(t[1][a]).min(t[2][a])), ceil(t[0][a].max(t[1][a]).max(t[2][a])));
    let ranges = [(ceil(t[0][0]), ceil(t[2][0])), of(1), of(2)];
    let [x, y, z] = ranges.map(|(first, end)| first < end);
    if !(x && (y || z) || y && z) {
        return;
    }
    let t = t.map(|p| p.map(i64::from));
    let e = std::array::from_fn::<_, 3, _>(|a| t[1][a] - t[0][a]);
    let f = std::array::from_fn::<_, 3, _>(|a| t[2][a] - t[0][a]);
    let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    // Seen along y, with u = x and v = z, the axes have the other handedness.
    if y && z {
        Projection::new::<1, 2, 0>(&t, n, &ranges, n[0] > 0, shift, turned).scan(Axis::X, hits);
    }
    if x && z {
        Projection::new::<0, 2, 1>(&t, n, &ranges, n[1] < 0, shift, turned).scan(Axis::Y, hits);
    }
    if x && y {
        Projection::new::<0, 1, 2>(&t, n, &ranges, n[2] > 0, shift, turned).scan(Axis::Z, hits);
    }
}

/// Lattice coordinates of which lines may pass: the first, and the one after the last. Strictly after the least coordinate of the triangle and
/// not after the greatest, once the lattice has moved a little up.
type LatticeRange = (i64, i64);

/// A triangle seen along one axis: u and v are the other two axes, in order.
struct Projection {
    /// Corners as (u, v, w).
    corners: [[i64; 3]; 3],
    /// Normal along (u, v, w).
    normal: [i64; 3],
    columns: LatticeRange,
    rows: LatticeRange,
    /// Whether the corners run counter-clockwise in the (u, v) plane.
    ccw: bool,
    shift: u32,
    /// Whether the corners run the other way than they were given.
    turned: bool,
}

/// A half plane of the lattice lines (column, row): inside where `start + column * du + row * dv >= 0`.
struct HalfPlane {
    start: i64,
    du: i64,
    dv: i64,
}

impl Projection {
    #[inline]
    fn new<const U: usize, const V: usize, const W: usize>(
        t: &[[i64; 3]; 3],
        n: [i64; 3],
        ranges: &[LatticeRange; 3],
        ccw: bool,
        shift: u32,
        turned: bool,
    ) -> Self {
        let (corners, normal) = (t.map(|p| [p[U], p[V], p[W]]), [n[U], n[V], n[W]]);
        Projection { corners, normal, columns: ranges[U], rows: ranges[V], ccw, shift, turned }
    }

    /// The side of the edge from corner `p` to corner `q` on which the triangle lies, from the first column and row on.
    #[inline]
    fn half_plane(&self, p: [i64; 3], q: [i64; 3]) -> HalfPlane {
        let (p, q) = if self.ccw { (p, q) } else { (q, p) };
        let (a, b) = (p[1] - q[1], q[0] - p[0]);
        let value = a * ((self.columns.0 << self.shift) - p[0]) + b * ((self.rows.0 << self.shift) - p[1]);
        let zero_is_inside = a > 0 || (a == 0 && b > 0);
        HalfPlane { start: value - i64::from(!zero_is_inside), du: a << self.shift, dv: b << self.shift }
    }

    #[inline]
    fn scan(&self, axis: Axis, hits: &mut impl Hits) {
        if self.normal[2] == 0 {
            return;
        }
        match self.columns.1 - self.columns.0 {
            ..=2 => self.scan_narrow::<2>(axis, hits),
            3..=4 => self.scan_narrow::<4>(axis, hits),
            5..=6 => self.scan_narrow::<6>(axis, hits),
            7..=BAND => self.scan_narrow::<{ BAND as usize }>(axis, hits),
            _ => self.scan_wide(axis, hits),
        }
    }

    /// The half planes of the three sides.
    #[inline]
    fn sides(&self) -> [HalfPlane; 3] {
        let [a, b, c] = self.corners;
        [self.half_plane(a, b), self.half_plane(b, c), self.half_plane(c, a)]
    }

    /// At most `N` columns: the lines of a band of rows are told as the bits of one word, and hits are drawn from that, without a branch
    /// that depends on where a row begins and ends.
    #[inline]
    fn scan_narrow<const N: usize>(&self, axis: Axis, hits: &mut impl Hits) {
        let sides = self.sides();
        let steps = sides.each_ref().map(|side| side.du);
        let mut starts = sides.each_ref().map(|side| side.start);
        let wanted = (1u64 << (self.columns.1 - self.columns.0)) - 1;
        let count = self.rows.1 - self.rows.0;
        // Many small triangles pass between the lines: the rest is worked out at the first hit.
        let mut plane = None;
        let mut band = 0;
        while band < count {
            if band != 0 && hits.is_enough() {
                return;
            }
            let mut inside = 0;
            for row in 0..BAND.min(count - band) {
                inside |= (inside_of::<N>(starts, steps) & wanted) << (row * BAND);
                starts = std::array::from_fn(|i| starts[i] + sides[i].dv);
            }
            if inside != 0 {
                let plane = plane.get_or_insert_with(|| self.plane(axis, hits));
                while inside != 0 {
                    let line = i64::from(inside.trailing_zeros());
                    inside &= inside - 1;
                    let (column, row) = (line % BAND, band + line / BAND);
                    self.hit(axis, column, row, plane.depth.at(column, row), plane, hits);
                }
            }
            band += BAND;
        }
    }

    /// Any number of columns.
    #[inline]
    fn scan_wide(&self, axis: Axis, hits: &mut impl Hits) {
        let sides = self.sides();
        let steps = sides.each_ref().map(|side| side.du);
        let width = self.columns.1 - self.columns.0;
        let mut plane = None;
        for row in 0..self.rows.1 - self.rows.0 {
            if row % BAND == BAND - 1 && hits.is_enough() {
                return;
            }
            let (first, end) = inside_of_row(sides.each_ref().map(|side| side.start + row * side.dv), steps, width);
            if first < end {
                let plane = plane.get_or_insert_with(|| self.plane(axis, hits));
                let mut fixed = plane.depth.at(first, row);
                for column in first..end {
                    self.hit(axis, column, row, fixed, plane, hits);
                    fixed = fixed.wrapping_add(plane.depth.du);
                }
            }
        }
    }

    /// What hits along `axis` need, once there is one.
    #[inline]
    fn plane(&self, axis: Axis, hits: &mut impl Hits) -> Plane {
        let [u, v, w] = self.normal.map(|c| (if self.turned { -c } else { c }) as f64);
        let normal = match axis {
            Axis::X => [w, u, v],
            Axis::Y => [u, w, v],
            Axis::Z => [u, v, w],
        };
        hits.plane(axis, normal);
        Plane { depth: Depth::new(self, self.columns, self.rows), tie_is_above: self.tie_is_above(axis) }
    }

    /// Passes on the hit on line (`column`, `row`) of those that may pass, at depth `fixed`.
    #[inline]
    fn hit(&self, axis: Axis, column: i64, row: i64, fixed: i64, plane: &Plane, hits: &mut impl Hits) {
        let code = fixed >> GUARD_BITS;
        let (u, v) = (self.columns.0 + column, self.rows.0 + row);
        let offset = code & 0xffff;
        let (cell, offset) = if plane.depth.reliable && offset.wrapping_sub(1) as u64 <= 65533 {
            (code >> 16, offset as u16)
        } else {
            self.exact_depth(u, v, plane.tie_is_above)
        };
        let (u, v, w) = (u as u32, v as u32, cell as u32);
        let at = match axis {
            Axis::X => [w, u, v],
            Axis::Y => [u, w, v],
            Axis::Z => [u, v, w],
        };
        hits.hit(axis, at, offset);
    }

    /// On which side of a moved lattice point a hit lies that is exactly on the unmoved one.
    fn tie_is_above(&self, axis: Axis) -> bool {
        let [nu, nv, nw] = self.normal;
        // Slopes of the plane w(u, v), up to a positive factor, along the axes that are moved more than `axis` is.
        let (slope_u, slope_v) = (-nu * nw.signum(), -nv * nw.signum());
        match axis {
            Axis::X => false,
            Axis::Y => slope_u > 0,
            Axis::Z => slope_u > 0 || (slope_u == 0 && slope_v > 0),
        }
    }

    /// Cell and offset of the hit on lattice line (`u`, `v`), in exact arithmetic.
    #[cold]
    fn exact_depth(&self, u: i64, v: i64, above: bool) -> (i64, u16) {
        let [pu, pv, pw] = self.corners[0].map(i128::from);
        let [nu, nv, nw] = self.normal.map(|c| i128::from(c) * i128::from(self.normal[2].signum()));
        let (du, dv) = ((i128::from(u) << self.shift) - pu, (i128::from(v) << self.shift) - pv);
        let (numerator, denominator) = (pw * nw - nu * du - nv * dv, nw << self.shift);
        let (cell, rest) = (numerator.div_euclid(denominator), numerator.rem_euclid(denominator));
        match (rest, above) {
            (0, true) => (cell as i64, 0),
            (0, false) => (cell as i64 - 1, u16::MAX),
            _ => (cell as i64, ((rest << 16) / denominator) as u16),
        }
    }
}

/// The columns of a row that are inside of three half planes, as bits, of the first `N`: `starts` in the first column and `steps` more in
/// each next.
#[inline]
fn inside_of<const N: usize>(mut starts: [i64; 3], steps: [i64; 3]) -> u64 {
    let mut inside = 0;
    for column in 0..N {
        // The sign of all three at once.
        let [a, b, c] = starts;
        inside |= u64::from(a | b | c >= 0) << column;
        starts = [a + steps[0], b + steps[1], c + steps[2]];
    }
    inside
}

/// The columns of a row of any length that are inside, by division: the first, and the one after the last.
#[inline]
fn inside_of_row(starts: [i64; 3], steps: [i64; 3], width: i64) -> (i64, i64) {
    let (mut first, mut end) = (0, width);
    for (start, du) in starts.into_iter().zip(steps) {
        let inside = |column: i64| start + column * du >= 0;
        if du > 0 {
            if !inside(first) {
                first = (-start + du - 1) / du;
            }
        } else if !inside(end - 1) {
            end = if start < 0 { first } else { start / -du + 1 };
        }
    }
    (first, end)
}

/// The plane of a triangle, seen along an axis.
struct Plane {
    depth: Depth,
    /// On which side of a moved lattice point a hit lies that is exactly on the unmoved one.
    tie_is_above: bool,
}

/// Depth along the axis as a linear function of column and row, in 2^-36 of a cell.
struct Depth {
    start: i64,
    du: i64,
    dv: i64,
    /// Whether the error stays below 1/65536 of a cell.
    reliable: bool,
}

impl Depth {
    /// A cell in these units.
    const CELL: u64 = 1 << (16 + GUARD_BITS);

    fn new(p: &Projection, columns: (i64, i64), rows: (i64, i64)) -> Self {
        let [nu, nv, nw] = p.normal.map(|c| c as f64);
        let (slope_u, slope_v) = (-nu / nw, -nv / nw);
        let [u, v, w] = p.corners[0];
        let (du, dv) = (((columns.0 << p.shift) - u) as f64, ((rows.0 << p.shift) - v) as f64);
        // Units: fixed-point lattice units so far; `unit` makes them 2^-36 of a cell.
        let unit = (Self::CELL >> p.shift) as f64;
        let cell = Self::CELL as f64;
        let reach_u = slope_u.abs() * ((columns.1 - columns.0 + 1) << p.shift) as f64;
        let reach_v = slope_v.abs() * ((rows.1 - rows.0 + 1) << p.shift) as f64;
        // Rounding errors are below 8 ulp of the largest intermediate; 2^60 keeps the fixed point within i64, where
        // 2^60 * 2^-50 = 2^10 is far below the 2^20 of 1/65536 of a cell. What `du` and `dv` lack adds at most a unit a
        // column and a row, 2^18 over the greatest triangle.
        let reliable = (reach_u + reach_v + w as f64) * unit < 2f64.powi(60);
        let start = (w as f64 + slope_u * du + slope_v * dv) * unit;
        Depth { start: start as i64, du: (slope_u * cell) as i64, dv: (slope_v * cell) as i64, reliable }
    }

    /// Depth on a line, by its column and row.
    #[inline]
    fn at(&self, column: i64, row: i64) -> i64 {
        self.start.wrapping_add(column.wrapping_mul(self.du)).wrapping_add(row.wrapping_mul(self.dv))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    /// Crossings as a map from edge to number of hits.
    #[derive(Default)]
    struct Counter(BTreeMap<(usize, [u32; 3]), Vec<u16>>);

    impl Hits for Counter {
        fn plane(&mut self, _: Axis, _: [f64; 3]) {}
        fn hit(&mut self, axis: Axis, at: [u32; 3], offset: u16) {
            self.0.entry((axis.index(), at)).or_default().push(offset);
        }
    }

    impl Counter {
        fn is_crossed(&self, axis: usize, at: [u32; 3]) -> bool {
            self.0.get(&(axis, at)).is_some_and(|hits| hits.len() % 2 == 1)
        }

        /// Grid faces with an odd number of crossed edges, among those next to a hit.
        fn odd_faces(&self) -> usize {
            let mut faces = std::collections::BTreeSet::new();
            for &(axis, at) in self.0.keys() {
                for other in (0..3).filter(|&o| o != axis) {
                    // The two faces that hold the edge and extend along `other`.
                    let mut below = at;
                    below[other] -= 1;
                    faces.insert((3 - axis - other, at));
                    faces.insert((3 - axis - other, below));
                }
            }
            faces.iter().filter(|&&(normal, at)| self.is_odd(normal, at)).count()
        }

        fn is_odd(&self, normal: usize, at: [u32; 3]) -> bool {
            let (a, b) = ((normal + 1) % 3, (normal + 2) % 3);
            let step = |mut p: [u32; 3], d: usize| {
                p[d] += 1;
                p
            };
            [(a, at), (a, step(at, b)), (b, at), (b, step(at, a))]
                .iter()
                .fold(false, |odd, &(axis, p)| odd ^ self.is_crossed(axis, p))
        }
    }

    const SHIFT: u32 = 4;

    fn scan(triangles: &[FineTriangle]) -> Counter {
        let mut counter = Counter::default();
        triangles.iter().for_each(|t| rasterise(t, SHIFT, &mut counter));
        counter
    }

    fn tetrahedron(p: [[i32; 3]; 4]) -> [FineTriangle; 4] {
        [[p[0], p[1], p[2]], [p[0], p[3], p[1]], [p[1], p[3], p[2]], [p[2], p[3], p[0]]]
    }

    /// Exact oracle: the moved lattice as rationals with a tiny but finite perturbation, in i128.
    fn oracle(t: &FineTriangle) -> BTreeMap<(usize, [u32; 3]), usize> {
        // So many new units to one fixed-point unit that the motion is smaller than any slope can magnify.
        const UNIT: i128 = 1 << 90;
        let moved = [1i128 << 60, 1 << 30, 1];
        let mut found = BTreeMap::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let lattice = |i: i128, a: usize| (i << SHIFT) * UNIT + moved[a];
            let corner = |k: usize, a: usize| i128::from(t[k][a]) * UNIT;
            let range = |a: usize| {
                let c = [t[0][a], t[1][a], t[2][a]];
                (i128::from(*c.iter().min().unwrap() >> SHIFT) - 1, i128::from(*c.iter().max().unwrap() >> SHIFT) + 1)
            };
            for i in range(u).0..=range(u).1 {
                for j in range(v).0..=range(v).1 {
                    let (lu, lv) = (lattice(i, u), lattice(j, v));
                    let side = |a: usize, b: usize| {
                        let (au, av) = (corner(a, u), corner(a, v));
                        let (bu, bv) = (t[b][u] - t[a][u], t[b][v] - t[a][v]);
                        (i128::from(bu) * (lv - av) - i128::from(bv) * (lu - au)).signum()
                    };
                    let s = [side(0, 1), side(1, 2), side(2, 0)];
                    if s[0] == 0 || s[0] != s[1] || s[1] != s[2] {
                        continue;
                    }
                    let e: [i128; 3] = std::array::from_fn(|a| i128::from(t[1][a] - t[0][a]));
                    let f: [i128; 3] = std::array::from_fn(|a| i128::from(t[2][a] - t[0][a]));
                    let n: [i128; 3] =
                        std::array::from_fn(|a| e[(a + 1) % 3] * f[(a + 2) % 3] - e[(a + 2) % 3] * f[(a + 1) % 3]);
                    // Which lattice interval along the axis: the last point whose plane value is not yet past.
                    let value = |k: i128| {
                        n[axis] * (lattice(k, axis) - corner(0, axis))
                            + n[u] * (lu - corner(0, u))
                            + n[v] * (lv - corner(0, v))
                    };
                    let (low, high) = range(axis);
                    let k = (low..=high).rev().find(|&k| value(k) * n[axis].signum() < 0).expect("within bounds");
                    let mut at = [0; 3];
                    (at[axis], at[u], at[v]) = (k as u32, i as u32, j as u32);
                    *found.entry((axis, at)).or_insert(0) += 1;
                }
            }
        }
        found
    }

    fn coordinate() -> impl Strategy<Value = i32> {
        // Mostly on lattice planes, so that every degeneracy occurs.
        prop_oneof![(4i32..14).prop_map(|c| c << SHIFT), 64i32..224, (8i32..28).prop_map(|c| c << (SHIFT - 1))]
    }

    fn point() -> impl Strategy<Value = [i32; 3]> {
        [coordinate(), coordinate(), coordinate()]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn closed_surfaces_leave_no_odd_face(p in [point(), point(), point(), point()]) {
            prop_assert_eq!(scan(&tetrahedron(p)).odd_faces(), 0);
        }

        #[test]
        fn hits_are_those_of_the_moved_lattice(t in [point(), point(), point()]) {
            let found: BTreeMap<_, _> = scan(&[t]).0.into_iter().map(|(edge, hits)| (edge, hits.len())).collect();
            prop_assert_eq!(found, oracle(&t));
        }

        #[test]
        fn order_of_corners_makes_no_difference(t in [point(), point(), point()]) {
            let found = scan(&[t]).0;
            for [a, b, c] in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                prop_assert_eq!(&scan(&[[t[a], t[b], t[c]]]).0, &found);
            }
        }

        /// Large coordinates, where the fast way and the exact way meet: every hit lies where the plane is.
        #[test]
        fn offsets_are_those_of_the_plane(p in [[1i32..1 << 26, 1..1 << 26, 1..1 << 26], [1i32..1 << 26, 1..1 << 26, 1..1 << 26], [1i32..1 << 26, 1..1 << 26, 1..1 << 26]]) {
            struct Check { t: FineTriangle, hits: usize }
            impl Hits for Check {
                fn plane(&mut self, _: Axis, _: [f64; 3]) {}
                fn hit(&mut self, axis: Axis, at: [u32; 3], offset: u16) {
                    const SHIFT: u32 = 21;
                    let e: [i128; 3] = std::array::from_fn(|a| i128::from(self.t[1][a] - self.t[0][a]));
                    let f: [i128; 3] = std::array::from_fn(|a| i128::from(self.t[2][a] - self.t[0][a]));
                    let n: [i128; 3] = std::array::from_fn(|a| e[(a + 1) % 3] * f[(a + 2) % 3] - e[(a + 2) % 3] * f[(a + 1) % 3]);
                    let mut rest = 0;
                    for a in (0..3).filter(|&a| a != axis.index()) {
                        rest += n[a] * ((i128::from(at[a]) << SHIFT) - i128::from(self.t[0][a]));
                    }
                    let w = axis.index();
                    let depth = f64::from(self.t[0][w]) - rest as f64 / n[w] as f64;
                    let found = (f64::from(at[w]) + (f64::from(offset) + 0.5) / 65536.0) * f64::from(1 << SHIFT);
                    assert!((depth - found).abs() < f64::from(1u32 << SHIFT) / 32768.0, "{depth} {found}");
                    self.hits += 1;
                }
            }
            let mut check = Check { t: p, hits: 0 };
            rasterise(&p, 21, &mut check);
        }
    }
}
