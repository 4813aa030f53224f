//! Triangles around a point.
//!
//! All boxes around the triangles of a fan hold its tip, so a tree of boxes tells none of them from another, and a fan of n triangles would
//! take n²/8 comparisons. But triangles with a common corner may meet there: it is enough that they are apart everywhere else. So nodes
//! all of whose triangles have a corner at one place are given a cone from there that holds them, and where two nodes with the same tip have
//! cones that are apart, nothing in them meets.
//!
//! Cones are wider than what rounding can do. Ordinary meshes have next to no such nodes, for leaves hold more triangles than a point
//! has in common, and pay for one look at each leaf.

use super::tree::TriangleTree;
use glam::DVec3;
use rayon::prelude::*;

/// What cones are wider than they need be, in radians: some thousand times the rounding of a direction.
const ROOM: f64 = 1e-12;
/// Half the angle of the widest cone that is of use, in radians. Beyond a right angle a cone does not hold the triangles between its rays.
const WIDEST: f64 = 1.5;

/// All that is seen from a tip in directions not too far from one.
#[derive(Debug, Clone, Copy)]
struct Cone {
    tip: DVec3,
    axis: DVec3,
    half: f64,
}

/// The angle between two unit vectors; exact to rounding where it is small, too.
fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

impl Cone {
    /// The cone of the triangles of a node, for a corner that all have.
    fn new(tip: DVec3, ways: &[DVec3]) -> Option<Self> {
        let axis = ways.iter().sum::<DVec3>().try_normalize()?;
        let half = ways.iter().map(|&way| angle(axis, way)).fold(0.0, f64::max) + ROOM;
        (half < WIDEST).then_some(Cone { tip, axis, half })
    }

    /// The cone around two with the same tip.
    fn around(&self, other: &Cone) -> Option<Self> {
        let axis = (self.axis + other.axis).try_normalize()?;
        let half = [self, other].map(|cone| angle(axis, cone.axis) + cone.half);
        let half = half[0].max(half[1]) + ROOM;
        (self.tip == other.tip && half < WIDEST).then_some(Cone { axis, half, ..*self })
    }
}

/// Cones of those nodes of a tree that are parts of large fans.
#[derive(Debug, Default)]
pub(super) struct Fans {
    cones: Vec<Cone>,
    /// Which cone is a node's, [`Fans::NONE`] for most; empty if there is none at all.
    of_node: Vec<u32>,
}

impl Fans {
    const NONE: u32 = u32::MAX;

    /// Looks at all leaves, and upwards from those that are fans. O(n).
    pub(super) fn new(tree: &TriangleTree<'_>) -> Self {
        let leaves = 1u32 << tree.height();
        // Leaves of one or two triangles always have a corner in common, and are few enough to be compared.
        let of_leaf = |leaf: u32| (tree.leaf(leaf).len() > 2).then(|| cone_of(tree, leaf)).flatten();
        let found: Vec<(u32, Cone)> =
            (leaves..2 * leaves).into_par_iter().filter_map(|leaf| Some((leaf, of_leaf(leaf)?))).collect();
        let mut fans = Fans::default();
        if found.len() < 2 {
            return fans;
        }
        fans.of_node = vec![Self::NONE; 2 * leaves as usize];
        found.into_iter().for_each(|(leaf, cone)| fans.put(leaf, cone));
        for node in (1..leaves).rev() {
            let (Some(a), Some(b)) = (fans.get(2 * node), fans.get(2 * node + 1)) else { continue };
            if let Some(cone) = a.around(b) {
                fans.put(node, cone);
            }
        }
        fans
    }

    fn put(&mut self, node: u32, cone: Cone) {
        self.of_node[node as usize] = self.cones.len() as u32;
        self.cones.push(cone);
    }

    fn get(&self, node: u32) -> Option<&Cone> {
        self.cones.get(*self.of_node.get(node as usize)? as usize)
    }

    /// Whether triangles of two nodes have nothing but a common corner in common.
    pub(super) fn are_apart(&self, a: u32, b: u32) -> bool {
        let (Some(a), Some(b)) = (self.get(a), self.get(b)) else { return false };
        a.tip == b.tip && angle(a.axis, b.axis) > a.half + b.half
    }
}

/// The cone of a leaf whose triangles have a corner at one place; of several such places, that of the narrowest.
fn cone_of(tree: &TriangleTree<'_>, leaf: u32) -> Option<Cone> {
    let mut range = tree.leaf(leaf);
    let first = tree.triangle(range.next()?);
    let tips = first.into_iter().filter(|tip| range.clone().all(|number| tree.triangle(number).contains(tip)));
    let cone = |tip: DVec3| {
        let others = tree.leaf(leaf).flat_map(|number| tree.triangle(number)).filter(|&p| p != tip);
        let ways: Option<Vec<DVec3>> = others.map(|p| (p - tip).try_normalize()).collect();
        Cone::new(tip, &ways?)
    };
    tips.filter_map(cone).min_by(|a, b| a.half.total_cmp(&b.half))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::chance::Chance;
    use crate::mesh::intersect::descend;
    use crate::mesh::meet::meet;
    use crate::mesh::oriented::Slivers;
    use crate::mesh::{Mesh, sample};

    /// A disc of n triangles around its middle, bent to a cone.
    fn fan(n: u32, height: f64) -> Mesh {
        let ring = (0..n).map(|i| {
            let turn = glam::DVec2::from_angle(std::f64::consts::TAU * f64::from(i) / f64::from(n));
            DVec3::from((turn, height))
        });
        let points = std::iter::once(DVec3::new(0.1, 0.05, 0.02)).chain(ring).collect();
        let faces: Vec<[u32; 3]> = (0..n).map(|i| [0, 1 + i, 1 + (i + 1) % n]).collect();
        Mesh { points, faces: faces.iter().map(|f| &f[..]).collect() }
    }

    /// Every triangle of a fan was compared with every other.
    #[test]
    fn triangles_of_a_fan_are_told_apart() {
        for height in [0.0, 0.02, 0.7, -3.0] {
            let mesh = fan(20_000, height);
            let tree = TriangleTree::new(&mesh);
            let (fans, slivers) = (Fans::new(&tree), Slivers::new(&tree));
            let mut compared = 0;
            let is_apart = |a: u32, b: u32| slivers.are_apart(&tree, a, b) || fans.are_apart(a, b);
            descend(&tree, &is_apart, tree.height(), 1, 1, &mut |a, b| compared += u32::from(a != b));
            assert!(compared < 8 << tree.height(), "{height}: {compared} of {}", 1 << tree.height());
            assert!(mesh.self_intersections().is_empty(), "{height}");
        }
    }

    #[test]
    fn ordinary_meshes_have_no_fans() {
        for name in ["knot", "overlap", "scan"] {
            let mesh = sample::build(name, 1).unwrap();
            assert!(Fans::new(&TriangleTree::new(&mesh)).cones.len() < mesh.faces.len() / 100, "{name}");
        }
    }

    /// Fans that cross themselves, and others: what is told apart does not meet.
    #[test]
    fn nothing_that_meets_is_told_apart() {
        let mut chance = Chance(4);
        for spread in [1e-6, 0.1, 1.0] {
            let mut mesh = fan(300, 0.3);
            for _ in 0..150 {
                let first = mesh.points.len() as u32;
                let way = chance.within_cube(1.0);
                mesh.points.extend([way, way + chance.within_cube(spread)]);
                mesh.faces.push(&[0, first, first + 1]);
            }
            let tree = TriangleTree::new(&mesh);
            let mut expected = Vec::new();
            for i in 0..tree.len() as u32 {
                for j in (0..i).filter(|&j| meet(&tree.triangle(i), &tree.triangle(j))) {
                    let (f, g) = (tree.face(i), tree.face(j));
                    expected.push([f.min(g), f.max(g)]);
                }
            }
            expected.sort_unstable();
            assert_eq!(mesh.self_intersections(), expected);
            assert!(!Fans::new(&tree).cones.is_empty());
        }
    }
}
