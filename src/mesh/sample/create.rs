//! Shapes from numbers: platonic solids, zonohedra, extrusions, spheres, tori and knots.

use super::shape;
use crate::error::{Error, Result};
use crate::mesh::{Mesh, triangulate};
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

/// The five convex solids with equal regular faces and equal corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Platonic {
    /// Four triangles.
    Tetrahedron,
    /// Six squares.
    Cube,
    /// Eight triangles.
    Octahedron,
    /// Twelve pentagons.
    Dodecahedron,
    /// Twenty triangles.
    Icosahedron,
}

/// A platonic solid around the origin with corners one model unit away from it; its faces are polygons.
pub fn platonic(solid: Platonic) -> Mesh {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    // A point and its mirror images in the planes of the axes.
    let mirrored = |p: DVec3| {
        let sign = |bit: usize| if bit == 0 { 1.0 } else { -1.0 };
        (0..8).map(move |i| p * DVec3::new(sign(i & 1), sign(i & 2), sign(i & 4)))
    };
    let turned = |p: DVec3| [p, DVec3::new(p.z, p.x, p.y), DVec3::new(p.y, p.z, p.x)].into_iter().flat_map(mirrored);
    let cube = || mirrored(DVec3::ONE);
    let points: Vec<DVec3> = match solid {
        Platonic::Tetrahedron => cube().filter(|p| p.x * p.y * p.z > 0.0).collect(),
        Platonic::Cube => cube().collect(),
        Platonic::Octahedron => turned(DVec3::X).collect(),
        Platonic::Dodecahedron => cube().chain(turned(DVec3::new(0.0, 1.0 / golden, golden))).collect(),
        Platonic::Icosahedron => turned(DVec3::new(0.0, 1.0, golden)).collect(),
    };
    hull(points.into_iter().map(DVec3::normalize).collect())
}

/// The most generators of a zonohedron: 128 sums of them are looked at.
const MOST_GENERATORS: usize = 7;

/// The zonohedron of some vectors: all sums of parts of them, around the origin. Faces are polygons with parallel sides.
///
/// # Errors
/// When there are fewer than three vectors or more than seven, one is not finite, or all are in one plane.
pub fn zonohedron(generators: &[DVec3]) -> Result<Mesh> {
    let refuse = |problem: &str| Err(Error::setting("zonohedron", problem, "give three to seven vectors in space"));
    if !(3..=MOST_GENERATORS).contains(&generators.len()) {
        return refuse("there are too few vectors or too many");
    }
    if generators.iter().any(|g| !g.is_finite()) {
        return refuse("a vector is not finite");
    }
    let half = |i: usize, bits: usize| if bits >> i & 1 == 1 { 0.5 } else { -0.5 };
    let sum = |bits: usize| generators.iter().enumerate().map(|(i, g)| half(i, bits) * *g).sum();
    let mesh = hull((0..1 << generators.len()).map(sum).collect());
    if mesh.faces.len() < 6 { refuse("the vectors are in one plane") } else { Ok(mesh) }
}

/// The convex hull of some points: polygons, of which those in one plane are one. O(n⁴): for shapes of some dozen points.
fn hull(points: Vec<DVec3>) -> Mesh {
    let size = points.iter().map(|p| p.length()).fold(0.0, f64::max);
    let close = 1e-9 * size;
    let mut distinct: Vec<DVec3> = Vec::new();
    for p in points {
        if distinct.iter().all(|q| q.distance(p) > close) {
            distinct.push(p);
        }
    }
    let n = distinct.len();
    let mut planes: BTreeSet<Vec<u32>> = BTreeSet::new();
    let mut mesh = Mesh::default();
    let triples = (0..n).flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k])));
    for [i, j, k] in triples {
        let Some(normal) = (distinct[j] - distinct[i]).cross(distinct[k] - distinct[i]).try_normalize() else {
            continue;
        };
        let height = |p: &DVec3| normal.dot(*p - distinct[i]);
        let (low, high) = distinct.iter().map(height).fold((0f64, 0f64), |(low, high), h| (low.min(h), high.max(h)));
        let outward = match (low > -close, high < close) {
            (false, true) => normal,
            (true, false) => -normal,
            _ => continue,
        };
        let on: Vec<u32> = (0..n as u32).filter(|&v| height(&distinct[v as usize]).abs() < close).collect();
        if planes.insert(on.clone()) {
            mesh.faces.push(&around(&distinct, on, outward));
        }
    }
    mesh.points = distinct;
    super::without_loose_points(&mesh)
}

/// The corners of a convex polygon in order, counter-clockwise as seen from where a normal points.
fn around(points: &[DVec3], mut on: Vec<u32>, normal: DVec3) -> Vec<u32> {
    let at = |v: u32| points[v as usize];
    let middle = on.iter().map(|&v| at(v)).sum::<DVec3>() / on.len() as f64;
    let u = (at(on[0]) - middle).normalize();
    let v = normal.cross(u);
    let angle = |p: DVec3| (p - middle).dot(v).atan2((p - middle).dot(u));
    on.sort_by(|&a, &b| angle(at(a)).total_cmp(&angle(at(b))));
    // Points between corners are no corners.
    let n = on.len();
    let turn = |k: usize| {
        let [a, b, c] = [at(on[(k + n - 1) % n]), at(on[k]), at(on[(k + 1) % n])];
        (b - a).normalize().cross((c - b).normalize()).dot(normal)
    };
    (0..n).filter(|&k| turn(k) > 1e-9).map(|k| on[k]).collect()
}

/// A prism over a polygon with holes in the xy plane, between two heights; in triangles. Each ring may run either way; each hole must see
/// the rings before it.
///
/// # Errors
/// When a ring has fewer than three corners or one that is not finite, or the heights do not ascend.
pub fn extrude(outline: &[DVec2], holes: &[Vec<DVec2>], heights: [f64; 2]) -> Result<Mesh> {
    let refuse =
        |problem: &str| Err(Error::setting("extrude", problem, "give rings of corners, and ascending heights"));
    if std::iter::once(outline).chain(holes.iter().map(|hole| &hole[..])).any(|ring| ring.len() < 3) {
        return refuse("a ring has fewer than three corners");
    }
    if outline.iter().chain(holes.iter().flatten()).any(|p| !p.is_finite()) {
        return refuse("a corner is not finite");
    }
    if heights[1].partial_cmp(&heights[0]) != Some(std::cmp::Ordering::Greater) {
        return refuse("the heights do not ascend");
    }
    let area = |ring: &[DVec2]| (0..ring.len()).map(|k| ring[k].perp_dot(ring[(k + 1) % ring.len()])).sum::<f64>();
    let turned = |ring: &[DVec2], positive: bool| {
        let mut ring = ring.to_vec();
        if (area(&ring) > 0.0) != positive {
            ring.reverse();
        }
        ring
    };
    let holes: Vec<Vec<DVec2>> = holes.iter().map(|hole| turned(hole, false)).collect();
    Ok(shape::extrude(&turned(outline, true), &holes, heights, 1))
}

/// A ball of radius 1 around the origin, in 12 n² triangles of nearly equal size.
pub fn sphere(n: u32) -> Mesh {
    shape::sphere(n.max(1) as i32, |p| p)
}

/// A torus around the z axis, of radius 1 and the thickness of a tube's radius, in 2 · around · across triangles.
pub fn torus(tube: f64, around: u32, across: u32) -> Mesh {
    shape::wrapped(around.max(3), across.max(3), |turn, angle| {
        let (sin, cos) = (TAU * angle).sin_cos();
        ((1.0 + tube * cos) * DVec2::from_angle(TAU * turn)).extend(tube * sin)
    })
}

/// A tube along a torus knot that winds `p` times around the axis and `q` times around the torus, in 2 · along · around triangles. (2, 3) is the
/// trefoil; if p and q have a common divisor, the tube goes several times over a simpler knot.
pub fn knot([p, q]: [u32; 2], tube: f64, along: u32, around: u32) -> Mesh {
    shape::tube(around.max(3), along.max(3), tube, |t| {
        let ((sin_p, cos_p), (sin_q, cos_q)) = ((f64::from(p) * TAU * t).sin_cos(), (f64::from(q) * TAU * t).sin_cos());
        DVec3::new((2.0 + cos_q) * cos_p, (2.0 + cos_q) * sin_p, sin_q)
    })
}

/// The same surface in triangles, each cut into `n` by `n`.
pub(super) fn finer(mesh: &Mesh, n: u32) -> Mesh {
    let mut triangles = Vec::new();
    mesh.faces.iter().for_each(|face| triangulate(&mesh.points, face, &mut triangles));
    let mut result = Mesh::default();
    let mut known: BTreeMap<[u64; 3], u32> = BTreeMap::new();
    for corners in triangles {
        let mut at = |i: u32, j: u32| {
            // Summed in order of the corners' numbers, so that triangles agree on their common edges to the last bit.
            let mut parts = [(corners[0], n - i - j), (corners[1], i), (corners[2], j)];
            parts.sort_unstable();
            let weighted = parts.iter().filter(|part| part.1 > 0).map(|&(v, w)| f64::from(w) * mesh.points[v as usize]);
            let p = weighted.sum::<DVec3>() / f64::from(n);
            *known.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
                result.points.push(p);
                result.points.len() as u32 - 1
            })
        };
        let mut faces = Vec::new();
        for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
            faces.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            if i + j + 1 < n {
                faces.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        faces.iter().for_each(|face| result.faces.push(face));
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn platonic_solids_are_regular() {
        for (solid, points, faces, corners) in [
            (Platonic::Tetrahedron, 4, 4, 3),
            (Platonic::Cube, 8, 6, 4),
            (Platonic::Octahedron, 6, 8, 3),
            (Platonic::Dodecahedron, 20, 12, 5),
            (Platonic::Icosahedron, 12, 20, 3),
        ] {
            let mesh = platonic(solid);
            let report = mesh.report();
            assert_eq!((mesh.validate(), mesh.points.len(), mesh.faces.len()), (Ok(()), points, faces), "{solid:?}");
            assert!(mesh.faces.iter().all(|face| face.len() == corners));
            assert!(report.max_edge - report.min_edge < 1e-12 && report.volume > 0.1 && report.genus == Some(0));
            for n in [1, 2, 3] {
                let fine = finer(&mesh, n);
                let expected = mesh.faces.iter().map(|f| f.len() - 2).sum::<usize>() * (n * n) as usize;
                assert_eq!((fine.validate(), fine.faces.len()), (Ok(()), expected), "{solid:?} {n}");
                assert!((fine.report().volume - report.volume).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn zonohedra_are_sums() {
        // A box, a rhombic dodecahedron, and a rhombic triacontahedron.
        let diagonals =
            [DVec3::ONE, DVec3::new(1.0, -1.0, -1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(-1.0, -1.0, 1.0)];
        let axes: Vec<DVec3> = platonic(Platonic::Icosahedron)
            .points
            .into_iter()
            .filter(|p| p.z + 1e-3 * p.y + 1e-6 * p.x > 0.0)
            .collect();
        for (generators, points, faces) in
            [(&[DVec3::X, DVec3::Y, DVec3::Z][..], 8, 6), (&diagonals, 14, 12), (&axes, 32, 30)]
        {
            let mesh = zonohedron(generators).unwrap();
            assert_eq!((mesh.validate(), mesh.points.len(), mesh.faces.len()), (Ok(()), points, faces));
            // The volume is the sum over all triples (Shephard 1974).
            let n = generators.len();
            let triples = (0..n).flat_map(|i| (0..i).flat_map(move |j| (0..j).map(move |k| [i, j, k])));
            let volume: f64 = triples.map(|t| t.map(|i| generators[i])).map(|[a, b, c]| a.cross(b).dot(c).abs()).sum();
            assert!((mesh.report().volume - volume).abs() < 1e-9 * volume);
        }
        assert!(zonohedron(&[DVec3::X; 2]).is_err() && zonohedron(&[DVec3::X; 8]).is_err());
        assert!(zonohedron(&[DVec3::X, DVec3::Y, DVec3::X + DVec3::Y]).is_err());
        assert!(zonohedron(&[DVec3::X, DVec3::Y, DVec3::NAN]).is_err());
    }

    #[test]
    fn extrusions_have_their_holes() {
        let square = |half: f64, at: f64| {
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|c| DVec2::from(c) * half + at).to_vec()
        };
        let (outer, holes) = (square(3.0, 0.0), vec![square(0.5, 1.5), square(0.5, -1.5)]);
        let mut turned = outer.clone();
        turned.reverse();
        for outline in [&outer, &turned] {
            let mesh = extrude(outline, &holes, [-1.0, 1.0]).unwrap();
            let report = mesh.report();
            assert_eq!((mesh.validate(), report.genus), (Ok(()), Some(2)));
            assert!((report.volume - 2.0 * (36.0 - 2.0)).abs() < 1e-12);
        }
        assert!(extrude(&outer[..2], &[], [0.0, 1.0]).is_err() && extrude(&outer, &[], [1.0, 1.0]).is_err());
        assert!(extrude(&outer, &[vec![DVec2::NAN; 3]], [0.0, 1.0]).is_err());
    }

    #[test]
    fn round_shapes_are_surfaces() {
        for (mesh, genus) in [(sphere(5), 0), (torus(0.25, 20, 9), 1), (knot([2, 5], 0.3, 300, 12), 1)] {
            assert_eq!((mesh.validate(), mesh.report().genus), (Ok(()), Some(genus)));
            assert!(mesh.outward() && !mesh.has_self_intersections());
        }
    }
}
