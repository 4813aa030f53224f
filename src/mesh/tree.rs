//! A tree of boxes over the triangles of a mesh: for what is near, and for what may touch.
//!
//! # Idea
//!
//! Triangles are halved along the longest side of the box of their centres, again and again, until at most eight are
//! left. Halves are equal in number (give or take one), so the tree is perfect: node `i` has the children `2i` and
//! `2i + 1`, and which triangles are below a node follows from its number. There are no pointers, and no depth is
//! greater than another, however the input is made.
//!
//! # Invariants
//!
//! - Node `2^l + j` holds the triangles `n j / 2^l .. n (j + 1) / 2^l`, rounded down.
//! - The box of a node is the least one around its triangles, exact, in double precision: far outliers do no harm to
//!   what is small.
//! - The tree depends on the mesh alone, not on the number of threads.
//!
//! # Cost
//!
//! 16 bytes a triangle and 12 to 24 for boxes, 48 more while it is made. Some 300 ns a triangle on one thread for a
//! million.

use super::meet::has_area;
use super::{Bounds, Mesh, triangulate};
use crate::error::Result;
use crate::geom::triangle::closest_on;
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Silent, check};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// The most triangles of a leaf. With four, the tree is twice as large, distances take 1 to 6 % fewer instructions, and
/// self-intersections 15 % more.
const LEAF: usize = 8;
/// Triangles below which halving is not worth another thread.
const ALONE: usize = 1 << 12;
/// Faces cut into triangles at a time.
const PIECE: usize = 1 << 13;
/// Binary exponents of the largest coordinate between which products of six coordinates neither overflow nor vanish.
const SAFE_EXPONENTS: Range<i32> = -100..100;

/// The triangles of a mesh under a tree of boxes: finds the point of the surface that is closest to any other.
///
/// Polygons are cut by [`triangulate`]. What bounds no surface is left out: faces with fewer than three corners, with
/// points that do not exist or are not finite, and triangles without any area (decided exactly).
///
/// ```
/// use zmend::glam::DVec3;
/// use zmend::mesh::{TriangleTree, sample};
///
/// let cube = sample::build("cube", 1)?; // from 0 to 1
/// let tree = TriangleTree::new(&cube);
/// let found = tree.closest(DVec3::new(0.5, 0.4, 3.0)).expect("a cube has faces");
/// assert_eq!((found.point, found.distance), (DVec3::new(0.5, 0.4, 1.0), 2.0));
/// # Ok::<(), zmend::Error>(())
/// ```
#[derive(Debug)]
pub struct TriangleTree<'a> {
    /// The mesh's points times `scale`.
    points: Cow<'a, [DVec3]>,
    /// A power of two, 1 but for meshes of absurd size.
    scale: f64,
    /// Corners of the triangles, in the order of the leaves.
    corners: Vec<[u32; 3]>,
    /// Of which face each triangle is a part.
    faces: Vec<u32>,
    /// Boxes of the nodes; the root is number 1, number 0 is not used.
    boxes: Vec<Bounds>,
    /// Levels below the root.
    height: u32,
}

/// A point of a surface, as seen from another point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// The point of the surface, in model units.
    pub point: DVec3,
    /// How far it is, in model units.
    pub distance: f64,
    /// The face it lies on.
    pub face: u32,
}

/// A triangle on its way into the tree.
struct Item {
    /// Three times the centre.
    center: DVec3,
    corners: [u32; 3],
    face: u32,
}

impl<'a> TriangleTree<'a> {
    /// Makes the tree, on all threads. O(n log n).
    pub fn new(mesh: &'a Mesh) -> Self {
        Self::try_new(mesh, &Silent).expect("it is not cancelled")
    }

    /// [`new`](Self::new), until `progress` says that it is cancelled.
    ///
    /// # Errors
    /// `Cancelled`.
    pub fn try_new(mesh: &'a Mesh, progress: &dyn Progress) -> Result<Self> {
        let (points, scale) = scaled(&mesh.points);
        let mut items = items(mesh, &points);
        let height = items.len().div_ceil(LEAF).max(1).next_power_of_two().trailing_zeros();
        let n = items.len();
        sort(&mut items, Node::ROOT, n, height, progress);
        check(progress)?;
        let (corners, faces) = items.iter().map(|item| (item.corners, item.face)).unzip();
        drop(items);
        let mut tree = TriangleTree { points, scale, corners, faces, boxes: Vec::new(), height };
        tree.boxes = tree.make_boxes();
        Ok(tree)
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there is no triangle.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// The point of the surface that is closest to `p`, or none if there is no surface or `p` is not finite. Where
    /// several are, it is always the same one for the same mesh. Some 1 µs for a million triangles and a point near the
    /// surface, O(log n); a hundred times as much for a point from which many are nearly as far.
    pub fn closest(&self, p: DVec3) -> Option<Closest> {
        (p.is_finite() && !self.is_empty()).then(|| self.closest_from(p, 0).0)
    }

    /// [`closest`](Self::closest) for a finite point and a tree that is not empty, with a triangle that may be near,
    /// and the triangle found.
    pub(super) fn closest_from(&self, p: DVec3, guess: u32) -> (Closest, u32) {
        let p = p * self.scale;
        let (mut best, mut point) = (guess, closest_on(&self.triangle(guess), p));
        let mut least = p.distance_squared(point);
        // One sibling waits on each level.
        let mut waiting = [(0.0, 0); 32];
        let mut count = 0;
        let mut next = Some((0.0, Node::ROOT.number));
        while let Some((bound, node)) = next {
            next = None;
            if bound < least {
                if node >> self.height == 0 {
                    let child = |number: u32| (distance_squared(&self.boxes[number as usize], p), number);
                    let (mut near, mut far) = (child(2 * node), child(2 * node + 1));
                    if far.0 < near.0 {
                        std::mem::swap(&mut near, &mut far);
                    }
                    waiting[count] = far;
                    count += 1;
                    next = Some(near);
                    continue;
                }
                for number in self.leaf(node) {
                    let triangle = self.triangle(number);
                    // A box is cheap and tells most triangles off.
                    if distance_squared(&around(&triangle), p) < least {
                        let found = closest_on(&triangle, p);
                        let distance = p.distance_squared(found);
                        if distance < least {
                            (least, best, point) = (distance, number, found);
                        }
                    }
                }
            }
            if count > 0 {
                count -= 1;
                next = Some(waiting[count]);
            }
        }
        let face = self.faces[best as usize];
        (Closest { point: point / self.scale, distance: least.sqrt() / self.scale, face }, best)
    }

    /// Numbers of the points that triangles use, in the order in which these do so first.
    pub(super) fn used_points(&self) -> Vec<u32> {
        let mut is_new = vec![true; self.points.len()];
        let corners = self.corners.iter().flatten().copied();
        corners.filter(|&corner| std::mem::replace(&mut is_new[corner as usize], false)).collect()
    }

    /// A point of the mesh, in model units.
    pub(super) fn point(&self, number: u32) -> DVec3 {
        self.points[number as usize] / self.scale
    }

    /// Corners of a triangle times [`scale`](Self::scale).
    pub(super) fn triangle(&self, triangle: u32) -> [DVec3; 3] {
        self.corners[triangle as usize].map(|corner| self.points[corner as usize])
    }

    /// By what the tree's coordinates are greater than the mesh's: a power of two.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// The face of a triangle.
    pub(super) fn face(&self, triangle: u32) -> u32 {
        self.faces[triangle as usize]
    }

    /// Levels below the root.
    pub(super) fn height(&self) -> u32 {
        self.height
    }

    /// The box of a node.
    pub(super) fn bounds(&self, node: u32) -> &Bounds {
        &self.boxes[node as usize]
    }

    /// The triangles of a leaf, which is a node with a number from 2^height.
    pub(super) fn leaf(&self, node: u32) -> Range<u32> {
        let node = Node { number: node, level: self.height };
        let range = node.range(self.len());
        range.start as u32..range.end as u32
    }

    /// Boxes of leaves, then level by level upwards.
    fn make_boxes(&self) -> Vec<Bounds> {
        let leaves = 1usize << self.height;
        let mut boxes = vec![Bounds::EMPTY; 2 * leaves];
        let around = |leaf: usize| {
            let triangles = self.leaf((leaves + leaf) as u32);
            triangles.map(|i| around(&self.triangle(i))).fold(Bounds::EMPTY, |a, b| union(&a, &b))
        };
        boxes[leaves..].par_iter_mut().enumerate().with_min_len(ALONE / LEAF).for_each(|(i, b)| *b = around(i));
        for level in (0..self.height).rev() {
            let (parents, children) = boxes.split_at_mut(2 << level);
            let parents = parents[1 << level..].iter_mut().zip(children.chunks_exact(2));
            parents.for_each(|(parent, pair)| *parent = union(&pair[0], &pair[1]));
        }
        boxes
    }
}

/// A node by its number, with the level it is on; the root is on level 0.
#[derive(Clone, Copy)]
struct Node {
    number: u32,
    level: u32,
}

impl Node {
    const ROOT: Node = Node { number: 1, level: 0 };

    /// Which of `n` triangles are below the node.
    fn range(self, n: usize) -> Range<usize> {
        let j = u64::from(self.number - (1 << self.level));
        let at = |j: u64| ((n as u64 * j) >> self.level) as usize;
        at(j)..at(j + 1)
    }

    fn children(self) -> [Node; 2] {
        [0, 1].map(|side| Node { number: 2 * self.number + side, level: self.level + 1 })
    }
}

/// Points times a power of two, such that exact predicates and squares of distances stay within what doubles hold.
fn scaled(points: &[DVec3]) -> (Cow<'_, [DVec3]>, f64) {
    let greatest = |a: f64, p: &DVec3| if p.is_finite() { a.max(p.abs().max_element()) } else { a };
    let greatest = points.par_iter().fold(|| 0.0, greatest).reduce(|| 0.0, f64::max);
    let exponent = if greatest > 0.0 { greatest.log2() as i32 } else { 0 };
    if SAFE_EXPONENTS.contains(&exponent) {
        return (Cow::Borrowed(points), 1.0);
    }
    // Denormal numbers are too many powers of two away from 1, but not from being safe.
    let scale = f64::powi(2.0, -exponent.clamp(-1000, 1000));
    (points.par_iter().map(|&p| p * scale).collect::<Vec<_>>().into(), scale)
}

/// The triangles that count.
fn items(mesh: &Mesh, points: &[DVec3]) -> Vec<Item> {
    let mut items = Vec::with_capacity(mesh.faces.len());
    let (count, piece) = pieces(mesh.faces.len(), PIECE);
    let make = |cut: &mut Vec<[u32; 3]>, number: usize| {
        let mut made = Vec::with_capacity(PIECE);
        for face in piece(number).filter(|&face| mesh.is_sound(mesh.faces.get(face))) {
            cut.clear();
            triangulate(points, mesh.faces.get(face), cut);
            for &corners in &*cut {
                let triangle = corners.map(|i| points[i as usize]);
                let center = triangle[0] + triangle[1] + triangle[2];
                if center.is_finite() && has_area(&triangle) {
                    made.push(Item { center, corners, face: face as u32 });
                }
            }
        }
        made
    };
    let take = |mut made: Vec<Item>| {
        items.append(&mut made);
        Ok(())
    };
    in_order(count, &Silent, Vec::new, make, take).expect("nobody cancels");
    items
}

/// Sorts the triangles of a node, of `n` in all, into its leaves. Leaves them as they are once it is cancelled.
fn sort(items: &mut [Item], node: Node, n: usize, height: u32, progress: &dyn Progress) {
    let is_large = n >> node.level > ALONE;
    if node.level == height || is_large && progress.is_cancelled() {
        return;
    }
    let first = items[0].center;
    let (low, high) = items.iter().fold((first, first), |(low, high), i| (low.min(i.center), high.max(i.center)));
    let axis = (high - low).max_position();
    let children = node.children();
    let middle = children[0].range(n).len();
    items.select_nth_unstable_by(middle, |a, b| a.center[axis].total_cmp(&b.center[axis]));
    let (left, right) = items.split_at_mut(middle);
    let mut halves =
        (|| sort(left, children[0], n, height, progress), || sort(right, children[1], n, height, progress));
    if is_large {
        rayon::join(halves.0, halves.1);
    } else {
        halves.0();
        halves.1();
    }
}

/// The least box around a triangle.
pub(super) fn around([a, b, c]: &[DVec3; 3]) -> Bounds {
    Bounds { min: a.min(*b).min(*c), max: a.max(*b).max(*c) }
}

fn union(a: &Bounds, b: &Bounds) -> Bounds {
    Bounds { min: a.min.min(b.min), max: a.max.max(b.max) }
}

/// Square of the distance between a point and a box.
fn distance_squared(bounds: &Bounds, p: DVec3) -> f64 {
    (bounds.min - p).max(p - bounds.max).max(DVec3::ZERO).length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::mesh::chance::Chance;
    use crate::mesh::sample;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Distance to a triangle by another way: the least over a fine fan of points would never be exact, so by
    /// barycentric cases.
    fn naive(&[a, b, c]: &[DVec3; 3], p: DVec3) -> f64 {
        let on_side = |s: DVec3, t: DVec3| {
            let along = ((t - s).dot(p - s) / (t - s).length_squared()).clamp(0.0, 1.0);
            p.distance(s + along * (t - s))
        };
        let on_sides = on_side(a, b).min(on_side(b, c)).min(on_side(c, a));
        // Coordinates of the projection along two sides, from the normal equations.
        let (u, v, w) = (b - a, c - a, p - a);
        let (uu, uv, vv, wu, wv) = (u.dot(u), u.dot(v), v.dot(v), w.dot(u), w.dot(v));
        let determinant = uu * vv - uv * uv;
        let (s, t) = ((vv * wu - uv * wv) / determinant, (uu * wv - uv * wu) / determinant);
        if s >= 0.0 && t >= 0.0 && s + t <= 1.0 { on_sides.min(p.distance(a + s * u + t * v)) } else { on_sides }
    }

    fn check(mesh: &Mesh, points: usize) {
        let tree = TriangleTree::new(mesh);
        let mut chance = Chance(5);
        let mut guess = 0;
        for i in 0..points {
            let p = chance.within_cube(if i % 3 == 0 { 20.0 } else { 3.0 });
            let expected = (0..tree.len() as u32).map(|i| naive(&tree.triangle(i), p)).fold(f64::INFINITY, f64::min);
            let found = tree.closest(p).unwrap();
            assert!((found.distance - expected).abs() <= 1e-12 * (1.0 + expected), "{p}: {found:?} {expected}");
            assert!((found.point.distance(p) - found.distance).abs() <= 1e-12 * (1.0 + expected));
            // Whatever the search begins with.
            let again = tree.closest_from(p, guess);
            assert!((again.0.distance - expected).abs() <= 1e-12 * (1.0 + expected));
            guess = again.1;
        }
    }

    #[test]
    fn the_closest_point_is_the_closest_of_all() {
        for (name, points) in [("overlap", 300), ("gear", 100), ("cube", 300), ("plate", 300), ("nan", 300)] {
            check(&sample::build(name, 1).unwrap(), points);
        }
        let mut chance = Chance(9);
        for n in 1..40 {
            let points: Vec<DVec3> = (0..3 * n).map(|_| chance.within_cube(2.0)).collect();
            let faces = (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect::<Vec<[u32; 3]>>();
            check(&Mesh { points, faces: faces.iter().map(|f| &f[..]).collect() }, 50);
        }
    }

    #[test]
    fn boxes_hold_what_is_below() {
        for (name, detail) in [("overlap", 1), ("knot", 1), ("plate", 1), ("cube", 3)] {
            let mesh = sample::build(name, detail).unwrap();
            let tree = TriangleTree::new(&mesh);
            let leaves = 1u32 << tree.height();
            let mut next = 0;
            for leaf in leaves..2 * leaves {
                let range = tree.leaf(leaf);
                assert!(range.start == next && range.len() <= LEAF && !range.is_empty(), "{name} {leaf} {range:?}");
                next = range.end;
                let below = range.map(|i| around(&tree.triangle(i))).fold(Bounds::EMPTY, |a, b| union(&a, &b));
                assert_eq!(*tree.bounds(leaf), below);
            }
            assert_eq!(next as usize, tree.len());
            for node in 1..leaves {
                assert_eq!(*tree.bounds(node), union(tree.bounds(2 * node), tree.bounds(2 * node + 1)));
            }
            let mut faces = tree.faces.clone();
            faces.sort_unstable();
            faces.dedup();
            assert_eq!(faces.len(), mesh.faces.len());
        }
    }

    #[test]
    fn what_bounds_no_surface_is_left_out() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::NAN, 2.0 * DVec3::X];
        let faces: [&[u32]; 6] = [&[0, 1, 4], &[0, 1, 3], &[0, 1, 7], &[1, 2], &[1, 1, 2], &[]];
        let mut mesh = Mesh { points, faces: faces.into_iter().collect() };
        let tree = TriangleTree::new(&mesh);
        assert!(tree.is_empty() && tree.closest(DVec3::ZERO).is_none());
        mesh.faces.push(&[0, 1, 2]);
        let tree = TriangleTree::new(&mesh);
        assert_eq!((tree.len(), tree.used_points()), (1, vec![0, 1, 2]));
        assert_eq!(tree.closest(DVec3::Z).map(|c| (c.distance, c.face)), Some((1.0, 6)));
        assert_eq!(tree.closest(DVec3::NAN), None);
    }

    #[test]
    fn absurd_sizes_are_measured_all_the_same() {
        for exponent in [-1050, -900, 900, 1015] {
            let mut mesh = sample::build("cube", 1).unwrap();
            let size = f64::powi(2.0, exponent / 2) * f64::powi(2.0, exponent - exponent / 2);
            mesh.points.iter_mut().for_each(|p| *p *= size);
            let found = TriangleTree::new(&mesh).closest(DVec3::new(0.5, 0.25, 3.0) * size).unwrap();
            assert_eq!((found.point / size, found.distance / size), (DVec3::new(0.5, 0.25, 1.0), 2.0), "{exponent}");
        }
    }

    #[test]
    fn far_points_do_no_harm_to_what_is_small() {
        let mut mesh = sample::build("knot", 1).unwrap();
        mesh.points.push(DVec3::splat(1e25));
        let far = mesh.points.len() as u32 - 1;
        mesh.faces.push(&[0, 1, far]);
        let tree = TriangleTree::new(&mesh);
        // Leaves stay small, but for that of the far triangle and some of those beside it.
        let leaves = 1u32 << tree.height();
        let small = (leaves..2 * leaves).filter(|&leaf| tree.bounds(leaf).extent().max_element() < 1.0).count();
        assert!(small as u32 >= leaves - 8, "{small} of {leaves}");
    }

    #[test]
    fn a_tree_is_not_made_once_cancelled() {
        /// Is cancelled from a number of looks on.
        struct Looks(AtomicU32, u32);
        impl Progress for Looks {
            fn is_cancelled(&self) -> bool {
                self.0.fetch_add(1, Ordering::Relaxed) >= self.1
            }
        }
        let mesh = sample::build("knot", 6).unwrap();
        let whole = Looks(AtomicU32::new(0), u32::MAX);
        assert!(TriangleTree::try_new(&mesh, &whole).is_ok());
        let looks = whole.0.into_inner();
        assert!(looks > 20, "{looks}");
        for after in [0, 1, 5] {
            let stopped = Looks(AtomicU32::new(0), after);
            assert!(matches!(TriangleTree::try_new(&mesh, &stopped), Err(Error::Cancelled)));
            // Each of those before it has begun two halves; the last look is that for the result.
            assert!(stopped.0.into_inner() <= 2 * after + 2);
        }
    }

    #[test]
    fn threads_make_no_difference() {
        let mesh = sample::build("overlap", 3).unwrap();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| TriangleTree::new(&mesh).corners)
        };
        assert!(with(1) == with(4));
    }
}
