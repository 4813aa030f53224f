//! Faces that pass through each other.
//!
//! The tree of boxes is joined with itself: two nodes of one level whose boxes overlap hand on to the four pairs of
//! their children, down to pairs of leaves; there the boxes of single triangles are compared, and [`meet`] decides
//! exactly. Pairs of nodes some levels below the root are independent pieces of work for all threads.
//!
//! Nodes whose boxes are nearly empty, which is what bundles of long thin triangles have, are told apart by boxes that lie along them
//! ([`Slivers`]), and nodes of triangles around one point, whose boxes all hold it, by cones ([`Fans`]).
//!
//! Cost: O(n log n), but for triangles that are long in several directions where many others are, and for books: many triangles along
//! one edge. Beside the tree, eight bytes a pair found.

use super::fans::Fans;
use super::meet::{Triangle, meet};
use super::oriented::Slivers;
use super::tree::{TriangleTree, around};
use super::{Bounds, Mesh};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// The level, or the leaves' if that is higher up, on which pairs of nodes are pieces of work: some thousands.
const PIECES: u32 = 9;

impl Mesh {
    /// All pairs of faces that meet anywhere but in what their common corners span: that pass through each other,
    /// touch, or lie on each other, though they may be neighbours. Exact: decided by the points' coordinates as they
    /// are.
    ///
    /// - Polygons are cut by [`triangulate`](super::triangulate). A face of which two triangles meet is paired with
    ///   itself.
    /// - Corners are common when they are at the same place, whatever their numbers. So seams between surfaces that are
    ///   not welded do not count; a corner within another face or in the middle of its side does.
    /// - Of triangles with the same three corners, one is a duplicate and not an intersection: [`report`](Self::report)
    ///   counts such faces.
    /// - Triangles without any area, with points that are not finite, or that do not exist, are left out.
    ///
    /// Each pair has the lower face first; pairs are sorted. Some 0.8 µs a triangle on one thread for a clean mesh of a
    /// million triangles, and 40 bytes. [`self_intersections_up_to`](Self::self_intersections_up_to) limits time and
    /// memory for bad ones.
    ///
    /// ```
    /// use zmend::mesh::sample;
    ///
    /// assert!(sample::build("torus", 1)?.self_intersections().is_empty());
    /// assert!(sample::build("overlap", 1)?.has_self_intersections());
    /// # Ok::<(), zmend::Error>(())
    /// ```
    pub fn self_intersections(&self) -> Vec<[u32; 2]> {
        self.self_intersections_up_to(usize::MAX).expect("no limit")
    }

    /// Whether there are any [`self_intersections`](Self::self_intersections). Stops at the first.
    pub fn has_self_intersections(&self) -> bool {
        self.self_intersections_up_to(0).is_none()
    }

    /// [`self_intersections`](Self::self_intersections), or none if more than `limit` pairs of triangles meet. These
    /// are as many as the pairs of faces if all faces are triangles. Stops as soon as it is known.
    pub fn self_intersections_up_to(&self, limit: usize) -> Option<Vec<[u32; 2]>> {
        self.intersections_from(0, limit)
    }

    /// [`self_intersections_up_to`](Self::self_intersections_up_to), but only pairs of which one is face `from` or a later one.
    pub(crate) fn intersections_from(&self, from: u32, limit: usize) -> Option<Vec<[u32; 2]>> {
        let tree = TriangleTree::new(self);
        let (slivers, fans) = (Slivers::new(&tree), Fans::new(&tree));
        let is_apart = |a: u32, b: u32| slivers.are_apart(&tree, a, b) || fans.are_apart(a, b);
        let mut pieces = Vec::new();
        descend(&tree, &is_apart, tree.height().min(PIECES), 1, 1, &mut |a, b| pieces.push([a, b]));
        let found = AtomicUsize::new(0);
        let in_piece = |&[a, b]: &[u32; 2]| {
            let mut join =
                Join { tree: &tree, from, limit, found: &found, pairs: Vec::new(), near: [Vec::new(), Vec::new()] };
            if !join.is_over() {
                descend(&tree, &is_apart, tree.height(), a, b, &mut |a, b| join.leaves(a, b));
            }
            join.pairs
        };
        let pairs: Vec<Vec<[u32; 2]>> = pieces.par_iter().map(in_piece).collect();
        if found.into_inner() > limit {
            return None;
        }
        let mut pairs = pairs.concat();
        pairs.par_sort_unstable();
        pairs.dedup();
        Some(pairs)
    }
}

/// Calls `visit` with every pair of nodes on a level, below two nodes of the same level, whose boxes overlap and that are not apart.
pub(super) fn descend(
    tree: &TriangleTree<'_>,
    is_apart: &impl Fn(u32, u32) -> bool,
    level: u32,
    a: u32,
    b: u32,
    visit: &mut impl FnMut(u32, u32),
) {
    if a >> level != 0 {
        return visit(a, b);
    }
    // A node and itself have one pair of different children, not two.
    let children: &[(u32, u32)] = if a == b { &[(0, 0), (0, 1), (1, 1)] } else { &[(0, 0), (0, 1), (1, 0), (1, 1)] };
    for (i, j) in children {
        let (a, b) = (2 * a + i, 2 * b + j);
        if a == b || (overlap(tree.bounds(a), tree.bounds(b)) && !is_apart(a, b)) {
            descend(tree, is_apart, level, a, b, visit);
        }
    }
}

fn overlap(a: &Bounds, b: &Bounds) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// A triangle near another leaf.
struct Near {
    bounds: Bounds,
    triangle: Triangle,
    number: u32,
}

/// The join of two subtrees.
struct Join<'a> {
    tree: &'a TriangleTree<'a>,
    /// Pairs of earlier faces are of no interest.
    from: u32,
    limit: usize,
    /// Pairs that were found by all.
    found: &'a AtomicUsize,
    pairs: Vec<[u32; 2]>,
    near: [Vec<Near>; 2],
}

impl Join<'_> {
    /// Whether more was found than was asked for.
    fn is_over(&self) -> bool {
        self.found.load(Relaxed) > self.limit
    }

    fn leaves(&mut self, a: u32, b: u32) {
        if self.is_over() {
            return;
        }
        let mut near = std::mem::take(&mut self.near);
        self.list(&mut near[0], a, b);
        if a == b {
            for (i, t) in near[0].iter().enumerate() {
                near[0][i + 1..].iter().for_each(|u| self.pair(t, u));
            }
        } else if !near[0].is_empty() {
            self.list(&mut near[1], b, a);
            for t in &near[0] {
                near[1].iter().for_each(|u| self.pair(t, u));
            }
        }
        self.near = near;
    }

    /// The triangles of a leaf that are near another one.
    fn list(&self, near: &mut Vec<Near>, leaf: u32, other: u32) {
        let other = self.tree.bounds(other);
        near.clear();
        near.extend(self.tree.leaf(leaf).filter_map(|number| {
            let triangle = self.tree.triangle(number);
            let bounds = around(&triangle);
            overlap(&bounds, other).then_some(Near { bounds, triangle, number })
        }));
    }

    fn pair(&mut self, t: &Near, u: &Near) {
        let (f, g) = (self.tree.face(t.number), self.tree.face(u.number));
        if f.max(g) >= self.from && overlap(&t.bounds, &u.bounds) && meet(&t.triangle, &u.triangle) {
            self.pairs.push([f.min(g), f.max(g)]);
            self.found.fetch_add(1, Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::chance::Chance;
    use crate::mesh::meet::tests::{lattice_point, oracle};
    use crate::mesh::sample;
    use glam::{DVec3, I64Vec3};

    fn mesh(points: Vec<DVec3>, faces: &[[u32; 3]]) -> Mesh {
        Mesh { points, faces: faces.iter().map(|f| &f[..]).collect() }
    }

    #[test]
    fn soups_agree_with_every_pair() {
        let mut chance = Chance(11);
        let (mut most, mut clean) = (0, 0);
        for case in 0..400 {
            let points: Vec<I64Vec3> = (0..4 + case % 40).map(|_| lattice_point(&mut chance, 3 + case % 9)).collect();
            let mut any = || (chance.unit() * points.len() as f64) as u32;
            let faces: Vec<[u32; 3]> = (0..=case % 60).map(|_| [any(), any(), any()]).collect();
            let corners: Vec<[I64Vec3; 3]> = faces.iter().map(|f| f.map(|i| points[i as usize])).collect();
            let is_proper =
                |&i: &usize| (corners[i][1] - corners[i][0]).cross(corners[i][2] - corners[i][0]) != I64Vec3::ZERO;
            let proper: Vec<usize> = (0..faces.len()).filter(is_proper).collect();
            let pairs = proper.iter().flat_map(|&i| proper.iter().map(move |&j| [i, j])).filter(|[i, j]| i < j);
            let expected: Vec<[u32; 2]> =
                pairs.filter(|&[i, j]| oracle(corners[i], corners[j])).map(|pair| pair.map(|i| i as u32)).collect();
            let mesh = mesh(points.iter().map(|p| p.as_dvec3()).collect(), &faces);
            assert_eq!(mesh.self_intersections(), expected);
            assert_eq!(mesh.has_self_intersections(), !expected.is_empty());
            assert_eq!(mesh.self_intersections_up_to(expected.len()).as_ref(), Some(&expected));
            if let Some(less) = expected.len().checked_sub(1) {
                assert_eq!(mesh.self_intersections_up_to(less), None);
            }
            most = most.max(expected.len());
            clean += usize::from(expected.is_empty());
        }
        assert!(most > 300 && clean > 10, "{most} {clean}");
    }

    /// Of a mesh with many leaves: every pair of triangles that is not found does not meet.
    #[test]
    fn nothing_is_overlooked() {
        for name in ["overlap", "gear", "doubled", "scan"] {
            let mesh = sample::build(name, 1).unwrap();
            let tree = TriangleTree::new(&mesh);
            let found = mesh.self_intersections();
            // Sweep along x: no boxes of nodes.
            let mut all: Vec<(Bounds, Triangle, u32)> =
                (0..tree.len() as u32).map(|i| (around(&tree.triangle(i)), tree.triangle(i), tree.face(i))).collect();
            all.sort_by(|a, b| a.0.min.x.total_cmp(&b.0.min.x));
            let mut expected: Vec<[u32; 2]> = (0..all.len())
                .into_par_iter()
                .flat_map_iter(|i| {
                    let (a, rest) = (&all[i], &all[i + 1..]);
                    let near = rest.iter().take_while(|b| b.0.min.x <= a.0.max.x).filter(|b| overlap(&a.0, &b.0));
                    near.filter(|b| meet(&a.1, &b.1)).map(|b| [a.2.min(b.2), a.2.max(b.2)]).collect::<Vec<_>>()
                })
                .collect();
            expected.sort_unstable();
            expected.dedup();
            assert_eq!(found, expected, "{name}");
            println!("{name}: {} pairs of {} faces", found.len(), mesh.faces.len());
            assert_eq!(found.is_empty(), name != "overlap", "{name}");
        }
    }

    #[test]
    fn clean_samples_are_clean() {
        for name in ["knot", "knot-holes", "part", "sphere", "torus", "cube", "plate", "nested", "noisy"] {
            let mesh = sample::build(name, 1).unwrap();
            assert!(mesh.self_intersections().is_empty() && !mesh.has_self_intersections(), "{name}");
        }
    }

    #[test]
    fn two_boxes_that_cross_are_found_at_any_size() {
        let cube = sample::build("cube", 1).unwrap();
        let mut two = cube.clone();
        two.points.extend(cube.points.iter().map(|p| p + DVec3::new(0.5, 0.25, 0.125)));
        cube.faces.iter().for_each(|f| two.faces.push(&[f[0] + 8, f[1] + 8, f[2] + 8, f[3] + 8]));
        let expected = two.self_intersections();
        // Three faces of each cube pass through one face of the other each or two.
        assert!(expected.len() >= 6 && expected.iter().all(|&[a, b]| a < 6 && b >= 6), "{expected:?}");
        for scale in [1e-300, 1e-120, 1e120, 1e300] {
            let mut scaled = two.clone();
            scaled.points.iter_mut().for_each(|p| *p *= f64::powi(2.0, f64::log2(scale) as i32));
            assert_eq!(scaled.self_intersections(), expected, "{scale}");
        }
    }

    #[test]
    fn bad_faces_are_left_out() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::NAN, DVec3::INFINITY, 0.5 * DVec3::X, DVec3::Z];
        let faces: [&[u32]; 8] =
            [&[0, 1, 2], &[0, 1, 3], &[4, 0, 1], &[0, 1, 99], &[0, 1], &[], &[0, 5, 1], &[2, 2, 5]];
        let bad = Mesh { points, faces: faces.into_iter().collect() };
        assert!(bad.self_intersections().is_empty());
        assert!(!Mesh::default().has_self_intersections());
        // The corner 5 is in the middle of the side from 0 to 1.
        let mut touching = bad.clone();
        touching.faces.push(&[5, 6, 1]);
        assert_eq!(touching.self_intersections(), [[0, 8]]);
    }

    #[test]
    fn a_polygon_may_cross_itself() {
        let points = [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0], [-1.0, 1.0]];
        let points = points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
        let bow = Mesh { points, faces: [&[0, 1, 2, 3, 4][..]].into_iter().collect() };
        assert_eq!(bow.self_intersections(), [[0, 0]]);
    }

    #[test]
    fn many_copies_stop_at_the_limit() {
        // All triangles pass through one place: 4,498,500 pairs.
        let turned = |i: u32, far: f64| DVec3::from((glam::DVec2::from_angle(f64::from(i)) * far, f64::from(i) * 1e-5));
        let points = (0..3000).flat_map(|i| [turned(i, 1.0), turned(i, -1.0), turned(i, 0.5) + DVec3::Z]).collect();
        let faces: Vec<[u32; 3]> = (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let needles = mesh(points, &faces);
        assert!(needles.self_intersections_up_to(1000).is_none() && needles.has_self_intersections());
    }

    #[test]
    fn threads_make_no_difference() {
        let mesh = sample::build("overlap", 2).unwrap();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| mesh.self_intersections())
        };
        let one = with(1);
        assert!(one.len() > 1000 && one == with(4), "{}", one.len());
    }
}
