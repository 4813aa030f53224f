//! Whether two triangles meet where they should not, decided exactly.
//!
//! # What counts
//!
//! Two triangles *meet* if they have a point in common that is not spanned by their common corners: with no corner in
//! common, any point at all; with one, any other point than that; with two, any point off the side between them, which
//! is when they lie in one plane and fold over each other. Triangles with the same three corners do not meet: they are
//! duplicates. Corners are the same when they are at the same place, whatever their numbers, so surfaces that are not
//! welded do not meet along their seams; a corner in the middle of another triangle's side is a meeting.
//!
//! # How
//!
//! Everything is signs of determinants: on which side of a plane a point is, in 3D, or of a line, after dropping a
//! coordinate. [`robust`] computes those exactly, fast where they are clear (Shewchuk 1997). No intersection is ever
//! computed, only whether there is one. Most pairs near each other share corners, and most of those are settled by two
//! signs.
//!
//! The corners of U are strictly on one side of the plane of T, or both triangles lie in one plane, or they meet the
//! line in which the planes cut each other in two intervals. These overlap exactly if an end of one lies in the other:
//! a corner of U in the plane of T and in T, a side of U that passes through T, or the same with T and U exchanged
//! (compare Guigue and Devillers 2003, "Fast and robust triangle-triangle overlap test using orientation predicates",
//! who order the ends instead).
//!
//! With one corner in common, both intervals begin there, so one that leads into the *cone* of the other is enough: the
//! triangle without regard to the side opposite the common corner. It does not matter which one is taken.

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// Three points that are not on a line.
pub(super) type Triangle = [DVec3; 3];

/// Pairs of points, each the line through them.
type Lines<'a> = &'a [[DVec3; 2]];

/// The sign of a determinant: -1, 0 or 1.
fn sign(determinant: f64) -> i8 {
    i8::from(determinant > 0.0) - i8::from(determinant < 0.0)
}

/// On which side of the plane through three points a fourth one is.
fn side(&[a, b, c]: &Triangle, p: DVec3) -> i8 {
    // Planes across an axis are common, and the slowest of all to decide by a determinant: it is 0 there.
    if (a.cmpeq(p) & b.cmpeq(p) & c.cmpeq(p)).any() {
        return 0;
    }
    let [a, b, c, p] = [a, b, c, p].map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
    sign(orient3d(a, b, c, p))
}

/// On which side of the line from `a` to `b` the point `p` is, seen along a coordinate axis.
fn turn(axis: usize, a: DVec3, b: DVec3, p: DVec3) -> i8 {
    let [a, b, p] = [a, b, p].map(|p| match axis {
        0 => Coord { x: p.y, y: p.z },
        1 => Coord { x: p.z, y: p.x },
        _ => Coord { x: p.x, y: p.y },
    });
    sign(orient2d(a, b, p))
}

/// A plane as seen along an axis to which it is not parallel.
#[derive(Clone, Copy)]
struct View {
    axis: usize,
    /// 1 if the triangle that spans the plane runs counter-clockwise, -1 if clockwise.
    turn: i8,
}

impl View {
    /// A view on a triangle, unless it has no area.
    fn of(&[a, b, c]: &Triangle) -> Option<Self> {
        let first = (b - a).cross(c - a).abs().max_position();
        (first..first + 3).map(|axis| axis % 3).find_map(|axis| {
            let turn = turn(axis, a, b, c);
            (turn != 0).then_some(View { axis, turn })
        })
    }

    /// Whether `p` is strictly to the right of a line, where the triangle's own sides have it on their left.
    fn is_right(self, &[from, to]: &[DVec3; 2], p: DVec3) -> bool {
        turn(self.axis, from, to, p) == -self.turn
    }

    /// Whether a point of the plane is to the right of no line.
    fn is_within(self, lines: Lines<'_>, p: DVec3) -> bool {
        !lines.iter().any(|line| self.is_right(line, p))
    }
}

/// Whether three finite points are not on a line.
pub(super) fn has_area(t: &Triangle) -> bool {
    View::of(t).is_some()
}

fn view(t: &Triangle) -> View {
    View::of(t).expect("triangles in the tree have an area")
}

fn sides(&[a, b, c]: &Triangle) -> [[DVec3; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// A triangle that begins with its corner number `i`.
fn turned(t: &Triangle, i: usize) -> Triangle {
    [t[i], t[(i + 1) % 3], t[(i + 2) % 3]]
}

/// Whether two triangles have more in common than what their common corners span. The order of triangles and of their
/// corners makes no difference. Some tens of nanoseconds for most pairs whose boxes overlap.
pub(super) fn meet(t: &Triangle, u: &Triangle) -> bool {
    // How many corners are common, and the sums of their numbers in both triangles: of one corner its number, of two
    // what is left of 0 + 1 + 2 without the third.
    let (mut common, mut sums) = (0, [0, 0]);
    for (i, p) in t.iter().enumerate() {
        for (j, q) in u.iter().enumerate() {
            if p == q {
                common += 1;
                sums = [sums[0] + i, sums[1] + j];
            }
        }
    }
    match common {
        0 => meet_apart(t, u),
        1 => meet_at_corner(&turned(t, sums[0]), &turned(u, sums[1])),
        2 => meet_at_side(&turned(t, 3 - sums[0]), u[3 - sums[1]]),
        _ => false,
    }
}

/// No corner in common.
fn meet_apart(t: &Triangle, u: &Triangle) -> bool {
    let of_u = u.map(|p| side(t, p));
    if is_one_sided(of_u) {
        return false;
    }
    if of_u == [0; 3] {
        return overlap(t, u);
    }
    let of_t = t.map(|p| side(u, p));
    !is_one_sided(of_t) && (enters(t, &sides(t), u, of_u) || enters(u, &sides(u), t, of_t))
}

/// Whether three points are strictly on one side.
fn is_one_sided(sides: [i8; 3]) -> bool {
    sides[0] != 0 && sides[0] == sides[1] && sides[0] == sides[2]
}

/// Whether a corner of `u` that is in the plane of `t`, or a side that passes through it, is within lines in the plane
/// of `t`. `at` tells where the corners of `u` are.
fn enters(t: &Triangle, lines: Lines<'_>, u: &Triangle, at: [i8; 3]) -> bool {
    (0..3).any(|i| {
        let j = (i + 1) % 3;
        if at[i] == 0 { view(t).is_within(lines, u[i]) } else { at[j] == -at[i] && passes(lines, u[i], u[j], at[j]) }
    })
}

/// Whether the line through `p` and `q`, which are on different sides of a plane, is within lines in it. `at` tells
/// where `q` is.
fn passes(lines: Lines<'_>, p: DVec3, q: DVec3, at: i8) -> bool {
    !lines.iter().any(|&[from, to]| side(&[p, q, from], to) == -at)
}

/// Whether two triangles in one plane have a point in common: no side of one has the other strictly beyond it.
fn overlap(t: &Triangle, u: &Triangle) -> bool {
    let is_apart = |t: &Triangle, u: &Triangle| {
        let view = view(t);
        sides(t).iter().any(|line| u.iter().all(|&p| view.is_right(line, p)))
    };
    !is_apart(t, u) && !is_apart(u, t)
}

/// Their first corners are the same.
fn meet_at_corner(t: &Triangle, u: &Triangle) -> bool {
    let (p, q) = (side(t, u[1]), side(t, u[2]));
    let cone = |&[a, b, c]: &Triangle| [[a, b], [c, a]];
    match (p, q) {
        (0, 0) => {
            let leads_into = |t: &Triangle, u: &Triangle| {
                let (view, lines) = (view(t), cone(t));
                view.is_within(&lines, u[1]) || view.is_within(&lines, u[2])
            };
            leads_into(t, u) || leads_into(u, t)
        }
        (0, _) => view(t).is_within(&cone(t), u[1]),
        (_, 0) => view(t).is_within(&cone(t), u[2]),
        _ => p != q && passes(&cone(t), u[1], u[2], q),
    }
}

/// All corners of `t` but the first are also corners of another triangle, whose third corner is `apex`.
fn meet_at_side(t: &Triangle, apex: DVec3) -> bool {
    side(t, apex) == 0 && !view(t).is_right(&[t[1], t[2]], apex)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::mesh::chance::Chance;
    use glam::I64Vec3;

    /// Homogeneous coordinates: a point with rational coordinates, or the coefficients of a plane.
    type Rational = [i128; 4];

    fn cross(a: I64Vec3, b: I64Vec3) -> I64Vec3 {
        a.cross(b)
    }

    fn value(plane: &Rational, p: &Rational) -> i128 {
        (0..4).map(|k| plane[k] * p[k]).sum()
    }

    /// The plane through `at` with this normal; positive where the normal points.
    fn plane(at: I64Vec3, normal: I64Vec3) -> Rational {
        let n = normal.to_array().map(i128::from);
        [n[0], n[1], n[2], -i128::from(normal.dot(at))]
    }

    fn reduced(p: Rational) -> Rational {
        let gcd = |a: i128, b: i128| {
            let (mut a, mut b) = (a.abs(), b.abs());
            while b != 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        let divisor = p.into_iter().fold(0, gcd) * p[3].signum();
        p.map(|x| x / divisor)
    }

    /// A convex polygon, cut off where a plane is negative; what lies in the plane stays.
    fn clipped(polygon: &[Rational], plane: &Rational) -> Vec<Rational> {
        let mut kept = Vec::new();
        for (i, p) in polygon.iter().enumerate() {
            let q = &polygon[(i + 1) % polygon.len()];
            let (f, g) = (value(plane, p), value(plane, q));
            if f >= 0 {
                kept.push(*p);
            }
            if f.signum() * g.signum() < 0 {
                let (f, g) = (f.abs(), g.abs());
                kept.push(reduced(std::array::from_fn(|k| f * q[k] + g * p[k])));
            }
        }
        kept
    }

    /// The definition, word for word: the common part as a polygon with rational corners, and whether the common
    /// corners span it.
    pub(in crate::mesh) fn oracle(t: [I64Vec3; 3], u: [I64Vec3; 3]) -> bool {
        let normal = cross(t[1] - t[0], t[2] - t[0]);
        let point = |p: I64Vec3| [p.x, p.y, p.z, 1].map(i128::from);
        let mut common = u.map(point).to_vec();
        let inward = |i: usize| plane(t[i], cross(normal, t[(i + 1) % 3] - t[i]));
        for half_space in [plane(t[0], normal), plane(t[0], -normal), inward(0), inward(1), inward(2)] {
            common = clipped(&common, &half_space);
        }
        let shared: Vec<I64Vec3> = t.into_iter().filter(|p| u.contains(p)).collect();
        match shared[..] {
            [] => !common.is_empty(),
            [a] => common.iter().any(|p| *p != point(a)),
            // Within both triangles, so on the line is on the side.
            [a, b] => {
                let across = cross(b - a, normal);
                common.iter().any(|p| value(&plane(a, across), p) != 0 || value(&plane(a, normal), p) != 0)
            }
            _ => false,
        }
    }

    /// A point of a cube of n^3 lattice points.
    pub(in crate::mesh) fn lattice_point(chance: &mut Chance, n: i64) -> I64Vec3 {
        let mut coordinate = || (chance.unit() * n as f64) as i64;
        I64Vec3::new(coordinate(), coordinate(), coordinate())
    }

    #[test]
    fn signs_agree_with_exact_clipping() {
        // Some affine maps, under which nothing meets or parts: all exact in doubles, most with determinants that must
        // be done exactly.
        let maps: [fn(DVec3) -> DVec3; 4] = [
            |p| p,
            |p| DVec3::new(p.x + 3.0 * p.y - 2.0 * p.z, 5.0 * p.x + p.z, p.y - 7.0 * p.z) / 1024.0 + 1e6,
            |p| p * 1_073_741_827.0 + DVec3::new(1e15, -2e15, 3e15),
            |p| DVec3::new(p.x + 1e12 * (p.y + p.z), p.y - p.x, p.z + 1e9 * p.x),
        ];
        let mut chance = Chance(3);
        let mut counts = [[0; 2]; 4];
        for case in 0..60_000 {
            let n = 2 + case % 6;
            let mut corner = || lattice_point(&mut chance, n);
            let (t, mut u) = ([corner(), corner(), corner()], [corner(), corner(), corner()]);
            // Random triangles seldom share corners.
            let shared = case as usize / 6 % 3;
            u[..shared].copy_from_slice(&t[..shared]);
            u.rotate_left(case as usize % 3);
            if [t, u].iter().any(|t| cross(t[1] - t[0], t[2] - t[0]) == I64Vec3::ZERO) {
                continue;
            }
            let expected = oracle(t, u);
            assert_eq!(oracle(u, t), expected, "{t:?} {u:?}");
            counts[t.iter().filter(|p| u.contains(p)).count()][usize::from(expected)] += 1;
            for map in maps {
                let place = |p: I64Vec3| map(p.as_dvec3());
                let (t, u) = (t.map(place), u.map(place));
                assert!(has_area(&t) && has_area(&u));
                assert_eq!([meet(&t, &u), meet(&u, &t)], [expected; 2], "{t:?} {u:?}");
                let [a, b, c] = u;
                assert_eq!(meet(&t, &[b, a, c]), expected, "{t:?} {u:?} mirrored");
            }
        }
        println!("apart and meeting, for 0 to 3 common corners: {counts:?}");
        assert!(counts[..3].iter().flatten().all(|&n| n > 500) && counts[3][1] == 0, "{counts:?}");
    }

    #[test]
    fn areas_are_exact() {
        let line = |t: f64| DVec3::new(1e15 + t, -3e15 + 2.0 * t, 4.0 * t);
        assert!(!has_area(&[line(0.0), line(1.0), line(3.0)]));
        assert!(has_area(&[line(0.0), line(1.0), line(3.0) + 0.5 * DVec3::X]));
        assert!(!has_area(&[DVec3::ONE, DVec3::ONE, DVec3::X]));
    }

    #[test]
    fn touching_is_told_from_sharing() {
        let [a, b, c] = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let meets = |u: Triangle| meet(&[a, b, c], &u);
        let up = DVec3::Z;
        // No common corner: a corner within, on a side, beside it by a hair; a side that passes through.
        assert!(meets([DVec3::new(0.25, 0.25, 0.0), up, up + b]));
        assert!(meets([DVec3::new(0.5, 0.5, 0.0), up, up + b]));
        assert!(!meets([DVec3::new(0.5, 0.5 + f64::EPSILON, 0.0), up, up + b]));
        assert!(meets([DVec3::new(0.25, 0.25, -1.0), DVec3::new(0.25, 0.25, 1.0), 9.0 * b]));
        // One: nothing else, a side along a side, a side within, through the plane behind the corner and through the
        // triangle.
        assert!(!meets([a, up, up - b]));
        assert!(meets([a, 2.0 * b, up]));
        assert!(meets([a, b + c, up]));
        assert!(!meets([a, -b - c + up, -b - c - up]));
        assert!(meets([a, b + c + up, b + c - up]));
        // Two: hinged, flat, folded over. Three: a duplicate.
        assert!(!meets([a, b, up]) && !meets([a, b, -c]));
        assert!(meets([a, b, b + c]) && meets([b, a, 0.5 * c]));
        assert!(!meets([c, b, a]));
    }
}
