//! Boxes that lie along what is in them.
//!
//! A long thin triangle that is parallel to no axis has a box that is nearly empty, and a bundle of such triangles has boxes that all
//! overlap: a tree of boxes then tells nothing apart, and every triangle is compared with every other. So nodes whose boxes are far
//! larger than the triangles in them get a second box, turned to lie along them (Gottschalk et al. 1996, with axes from the
//! longest extent instead of a covariance, and only the six axes of the two boxes as separating directions).
//!
//! Most meshes have no such nodes and pay for one look at each triangle. Boxes are padded by more than what rounding can do, so what
//! they tell apart is apart.

use super::Bounds;
use super::tree::TriangleTree;
use glam::DVec3;
use rayon::prelude::*;

/// How many times larger than that of its triangles the area of a leaf's box is, from which on it is worth another box. Eight triangles that
/// are about as long as wide stay below 6, however they lie.
const EMPTY: f64 = 16.0;
/// How many times smaller the area of the turned box has to be.
const WORTH: f64 = 4.0;
/// Rounding of a projection, against the greatest coordinate: some dozen units in the last place.
const ROUNDING: f64 = 1e-14;

/// A box with axes of its own.
#[derive(Debug, Clone, Copy)]
struct Oriented {
    center: DVec3,
    /// Unit vectors at right angles.
    axes: [DVec3; 3],
    /// Half the sides.
    half: [f64; 3],
}

impl Oriented {
    /// A box around points, along their longest extent as seen from the first of them.
    fn around(points: &[DVec3]) -> Option<Self> {
        let first = *points.first()?;
        let farthest = |from: DVec3, to: &dyn Fn(DVec3) -> DVec3| {
            let distances = points.iter().map(|&p| to(p - from));
            distances.fold(DVec3::ZERO, |a, b| if b.length_squared() > a.length_squared() { b } else { a })
        };
        let end = first + farthest(first, &|d| d);
        let u = farthest(end, &|d| d).try_normalize()?;
        let across = farthest(end, &|d| d - d.dot(u) * u);
        let v = (across - across.dot(u) * u).try_normalize().unwrap_or_else(|| u.any_orthonormal_vector());
        Self::along([u, v, u.cross(v)], points)
    }

    /// The least box with these axes, padded.
    fn along(axes: [DVec3; 3], points: &[DVec3]) -> Option<Self> {
        let first = *points.first()?;
        let extents = axes.map(|axis| {
            points.iter().map(|p| axis.dot(*p - first)).fold((0f64, 0f64), |(low, high), x| (low.min(x), high.max(x)))
        });
        let far = points.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let center = (0..3).map(|k| 0.5 * (extents[k].0 + extents[k].1) * axes[k]).sum::<DVec3>() + first;
        let half = extents.map(|(low, high)| 0.5 * (high - low) + ROUNDING * far);
        Some(Oriented { center, axes, half })
    }

    /// A box with the usual axes.
    fn upright(bounds: &Bounds) -> Self {
        let half = 0.5 * bounds.extent();
        let far = bounds.min.abs().max(bounds.max.abs()).max_element();
        let half = half.to_array().map(|h| h + ROUNDING * far);
        Oriented { center: bounds.center(), axes: [DVec3::X, DVec3::Y, DVec3::Z], half }
    }

    fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let way = |k: usize| if i >> k & 1 == 0 { -self.half[k] } else { self.half[k] };
            self.center + way(0) * self.axes[0] + way(1) * self.axes[1] + way(2) * self.axes[2]
        })
    }

    /// Half the area of its sides.
    fn area(&self) -> f64 {
        let [a, b, c] = self.half.map(|h| 2.0 * h);
        a * b + b * c + c * a
    }

    /// Whether one of its own axes shows that another box is apart.
    fn parts(&self, other: &Oriented) -> bool {
        let way = other.center - self.center;
        (0..3).any(|k| {
            let axis = self.axes[k];
            let reach: f64 = (0..3).map(|l| other.half[l] * axis.dot(other.axes[l]).abs()).sum();
            axis.dot(way).abs() > (self.half[k] + reach) * (1.0 + ROUNDING)
        })
    }
}

/// Turned boxes of those nodes of a tree that are worth it.
#[derive(Debug, Default)]
pub(super) struct Slivers {
    boxes: Vec<Oriented>,
    /// Which box is a node's, [`Slivers::NONE`] for most; empty if there is none at all.
    of_node: Vec<u32>,
}

impl Slivers {
    const NONE: u32 = u32::MAX;

    /// Looks at all leaves, and upwards from those that are worth it. O(n).
    pub(super) fn new(tree: &TriangleTree<'_>) -> Self {
        let leaves = 1u32 << tree.height();
        let of_leaf = |leaf: u32| {
            let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
            let covered: f64 = tree.leaf(leaf).map(|i| area(tree.triangle(i))).sum();
            let upright = Oriented::upright(tree.bounds(leaf)).area();
            if upright <= EMPTY * covered {
                return None;
            }
            let points: Vec<DVec3> = tree.leaf(leaf).flat_map(|i| tree.triangle(i)).collect();
            Oriented::around(&points).filter(|turned| WORTH * turned.area() < upright)
        };
        let found: Vec<(u32, Oriented)> =
            (leaves..2 * leaves).into_par_iter().filter_map(|leaf| Some((leaf, of_leaf(leaf)?))).collect();
        let mut slivers = Slivers::default();
        if found.is_empty() {
            return slivers;
        }
        slivers.of_node = vec![Self::NONE; 2 * leaves as usize];
        found.into_iter().for_each(|(leaf, turned)| slivers.put(leaf, turned));
        for node in (1..leaves).rev() {
            let (Some(a), Some(b)) = (slivers.get(2 * node), slivers.get(2 * node + 1)) else { continue };
            let points = [a.corners(), b.corners()].concat();
            // Along the longer one, or along both.
            let longer = if a.half[0] >= b.half[0] { a.axes } else { b.axes };
            let candidates = [Oriented::along(longer, &points), Oriented::around(&points)];
            let turned = candidates.into_iter().flatten().min_by(|x, y| x.area().total_cmp(&y.area()));
            let upright = Oriented::upright(tree.bounds(node)).area();
            turned
                .filter(|turned| WORTH * turned.area() < upright)
                .into_iter()
                .for_each(|turned| slivers.put(node, turned));
        }
        slivers
    }

    fn put(&mut self, node: u32, turned: Oriented) {
        self.of_node[node as usize] = self.boxes.len() as u32;
        self.boxes.push(turned);
    }

    fn get(&self, node: u32) -> Option<&Oriented> {
        self.boxes.get(*self.of_node.get(node as usize)? as usize)
    }

    /// Whether turned boxes show that what is in two nodes is apart.
    pub(super) fn are_apart(&self, tree: &TriangleTree<'_>, a: u32, b: u32) -> bool {
        let upright = |node| Oriented::upright(tree.bounds(node));
        match (self.get(a), self.get(b)) {
            (None, None) => false,
            (Some(a), Some(b)) => a.parts(b) || b.parts(a),
            (Some(a), None) => a.parts(&upright(b)),
            (None, Some(b)) => b.parts(&upright(a)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::chance::Chance;
    use crate::mesh::{Mesh, sample};
    use glam::DQuat;
    use std::f64::consts::TAU;

    /// The side of a long thin cylinder of n strips, turned askew, and moved.
    fn bundle(n: u32, length: f64, at: DVec3) -> Mesh {
        let turn = DQuat::from_rotation_arc(DVec3::Z, DVec3::new(0.6, 0.5, 0.7).normalize());
        let ring =
            |z: f64| (0..n).map(move |i| DVec3::from((glam::DVec2::from_angle(TAU * f64::from(i) / f64::from(n)), z)));
        let points = ring(-length).chain(ring(length)).map(|p| turn * p + at).collect();
        let quads = (0..n).map(|i| [i, (i + 1) % n, n + (i + 1) % n, n + i]);
        let faces: Vec<[u32; 3]> = quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Mesh { points, faces: faces.iter().map(|f| &f[..]).collect() }
    }

    /// Pairs of different leaves that are compared, with turned boxes and without.
    fn compared(mesh: &Mesh) -> [usize; 2] {
        let tree = TriangleTree::new(mesh);
        [Slivers::new(&tree), Slivers::default()].map(|slivers| {
            let mut count = 0;
            let is_apart = |a: u32, b: u32| slivers.are_apart(&tree, a, b);
            super::super::intersect::descend(&tree, &is_apart, tree.height(), 1, 1, &mut |a, b| {
                count += usize::from(a != b);
            });
            count
        })
    }

    /// Every strip was compared with every other.
    #[test]
    fn bundles_of_slivers_are_told_apart() {
        let n = 4096;
        let mesh = bundle(n, 30.0, DVec3::new(3.0, -7.0, 2.0));
        let leaves = (mesh.faces.len() / 8) as f64;
        let [few, many] = compared(&mesh);
        assert!((few as f64) < 12.0 * leaves && many as f64 > 100.0 * leaves, "{few} {many} of {leaves}");
        assert!(mesh.self_intersections().is_empty());
        // A rod through it is found.
        let mut pierced = mesh.clone();
        let rod = bundle(8, 40.0, DVec3::new(3.0, -7.0, 2.0) + 0.95);
        let first = pierced.points.len() as u32;
        pierced.points.extend(rod.points.iter().map(|p| DVec3::new(-p.x, p.y, p.z)));
        rod.faces.iter().for_each(|f| pierced.faces.push(&[f[0] + first, f[1] + first, f[2] + first]));
        let mut shaken = pierced.clone();
        shaken.points.iter_mut().for_each(|p| *p = DQuat::from_rotation_x(1.0) * *p);
        assert_eq!(pierced.has_self_intersections(), shaken.has_self_intersections());
    }

    #[test]
    fn ordinary_meshes_have_no_turned_boxes() {
        for name in ["knot", "overlap", "scan"] {
            let mesh = sample::build(name, 1).unwrap();
            assert!(Slivers::new(&TriangleTree::new(&mesh)).boxes.len() < mesh.faces.len() / 200, "{name}");
        }
    }

    /// Pairs that are told apart never meet: slivers in all directions that do cross.
    #[test]
    fn nothing_that_meets_is_told_apart() {
        let mut chance = Chance(8);
        for far in [0.0, 1e6] {
            let mut mesh = Mesh::default();
            for _ in 0..600 {
                let (a, b) = (chance.within_cube(1.0), chance.within_cube(1.0));
                let first = mesh.points.len() as u32;
                mesh.points.extend([a, b, a.lerp(b, 0.5) + chance.within_cube(1e-3)].map(|p| p + far));
                mesh.faces.push(&[first, first + 1, first + 2]);
            }
            let tree = TriangleTree::new(&mesh);
            assert!(Slivers::new(&tree).boxes.len() < 200);
            let mut expected = Vec::new();
            for i in 0..tree.len() as u32 {
                for j in 0..i {
                    if crate::mesh::meet::meet(&tree.triangle(i), &tree.triangle(j)) {
                        let (f, g) = (tree.face(i), tree.face(j));
                        expected.push([f.min(g), f.max(g)]);
                    }
                }
            }
            expected.sort_unstable();
            assert_eq!(mesh.self_intersections(), expected);
            assert!(!expected.is_empty());
        }
    }
}
