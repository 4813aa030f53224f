//! [`NodalOctree`]: a tree with values at the corners of its leaves, and a continuous field between them.
//!
//! A NODE is a lattice point that is the corner of a leaf, with a value and the number of leaves that have it as a corner. It comes with
//! the first of them and goes with the last. A node HANGS where it lies in the middle of an edge or a face of a larger leaf.
//!
//! # The field
//!
//! A leaf has 27 places for values: its corners, the middles of its edges and faces, and its centre. Where a node hangs, its value counts
//! for the larger leaf, too. Elsewhere the middle of an edge is the mean of its ends, the middle of a face the mean of its edges' middles,
//! the centre the mean of the faces'. Inside each octant of the leaf the field is trilinear between its eight places. So what it is on
//! a face follows from the nodes on that face alone, and if leaves that share faces or edges differ by at most one level
//! ([`Balance::Edges`]), it is the same from both sides: continuous, with all nodes free. That is the job of the 26-node element of
//! finite-element octrees. Where no node hangs on a leaf it is the usual trilinear field.
//!
//! # Cost
//!
//! A hash entry a node: 9 bytes, a count, and the value, padded, in a table 7/16 to 7/8 full. Trees refined near a surface have about
//! 1.2 nodes a leaf. Splitting a leaf costs 27 probes for the parent's places and 19 for new nodes.

use super::{Balance, LinearOctree, RefineError, SEEDS};
use crate::grid::key::SIDE;
use crate::grid::{Axis, Corner, Extent, Key};
use ahash::RandomState;
use hashbrown::HashMap;
use std::ops::{Add, Mul};

/// What can be averaged: `f32`, vectors, and whatever adds and scales like them.
pub trait Value: Copy + Add<Output = Self> + Mul<f64, Output = Self> {}

impl<V: Copy + Add<Output = V> + Mul<f64, Output = V>> Value for V {}

/// A [`LinearOctree`] and values at the corners of its leaves. See the [module](self).
///
/// ```
/// use zmend::grid::Key;
/// use zmend::octree::{Balance, NodalOctree};
///
/// let x = |point: Key| f64::from(point.center()[0]);
/// let mut field = NodalOctree::new();
/// field.insert(Key::ROOT, (), x);
/// field.refine(Key::ROOT, Balance::Edges, |_, ()| ())?;
/// field.refine(Key::ROOT.children()[0], Balance::Edges, |_, ()| ())?;
/// assert_eq!((field.tree().len(), field.len()), (15, 27 + 19));
/// assert_eq!(field.value_at([1000.5, 7.0, 524_288.0]), Some(1000.5));
/// // In the middle of an edge of a leaf of level 1.
/// let hanging = Key::point([1 << 17, 1 << 18, 0]).unwrap();
/// assert!(field.is_hanging(hanging) && field.uses(hanging) == 2);
/// # Ok::<(), zmend::octree::RefineError>(())
/// ```
#[derive(Debug, Clone)]
pub struct NodalOctree<T, V> {
    tree: LinearOctree<T>,
    nodes: Nodes<V>,
}

/// By point.
type Nodes<V> = HashMap<Key, Node<V>, RandomState>;

/// A corner of leaves.
#[derive(Debug, Clone, Copy)]
struct Node<V> {
    /// How many leaves have it as a corner, 1 ..= 8.
    uses: u8,
    value: V,
}

impl<T, V: Value> NodalOctree<T, V> {
    /// No leaf, no node.
    pub fn new() -> Self {
        let [a, b, c, d] = SEEDS;
        NodalOctree { tree: LinearOctree::new(), nodes: HashMap::with_hasher(RandomState::with_seeds(a, b, c, d)) }
    }

    /// Values at the corners of the leaves of a tree. `value` is asked once for each node, leaf by leaf in Z-order.
    pub fn with_values(tree: LinearOctree<T>, mut value: impl FnMut(Key) -> V) -> Self {
        let mut nodes = Self::new().nodes;
        for (leaf, _) in tree.iter_z() {
            add_corners(&mut nodes, leaf, &mut value);
        }
        NodalOctree { tree, nodes }
    }

    /// The leaves.
    pub fn tree(&self) -> &LinearOctree<T> {
        &self.tree
    }

    /// The leaf's record, to change.
    pub fn record_mut(&mut self, leaf: Key) -> Option<&mut T> {
        self.tree.get_mut(leaf)
    }

    /// The tree alone.
    pub fn into_tree(self) -> LinearOctree<T> {
        self.tree
    }

    /// Number of nodes: of distinct corners of leaves.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are none, and no leaves.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The value at a node, if the point is one. One probe.
    pub fn value(&self, point: Key) -> Option<V> {
        self.nodes.get(&point).map(|node| node.value)
    }

    /// The value at a node, to change.
    pub fn value_mut(&mut self, point: Key) -> Option<&mut V> {
        self.nodes.get_mut(&point).map(|node| &mut node.value)
    }

    /// How many leaves have the point as a corner, 0 ..= 8. One probe.
    pub fn uses(&self, point: Key) -> u32 {
        self.nodes.get(&point).map_or(0, |node| u32::from(node.uses))
    }

    /// All nodes and their values, in no order that matters.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = (Key, V)> + '_ {
        self.nodes.iter().map(|(&point, node)| (point, node.value))
    }

    /// All nodes and their values in Z-order. Collects and sorts.
    pub fn nodes_z(&self) -> Vec<(Key, V)> {
        let mut nodes: Vec<(Key, V)> = self.nodes.iter().map(|(&point, node)| (point, node.value)).collect();
        nodes.sort_unstable_by_key(|&(point, _)| point);
        nodes
    }

    /// Bytes held by tree and nodes.
    pub fn allocated_bytes(&self) -> usize {
        self.tree.allocated_bytes() + self.nodes.allocation_size()
    }

    /// Whether the point is a node in the middle of an edge or a face of a leaf. Up to eight searches.
    pub fn is_hanging(&self, point: Key) -> bool {
        let has_corner = |leaf: Key| leaf.corners().contains(&point);
        self.nodes.contains_key(&point)
            && self.tree.octants(point.center()).into_iter().flatten().any(|(leaf, _)| !has_corner(leaf))
    }

    /// Makes a cell a leaf, as [`LinearOctree::insert`]; corners that are no nodes yet get the `value` of their point.
    pub fn insert(&mut self, cell: Key, record: T, mut value: impl FnMut(Key) -> V) -> Option<T> {
        let old = self.tree.insert(cell, record);
        if old.is_none() {
            add_corners(&mut self.nodes, cell, &mut value);
        }
        old
    }

    /// Removes a leaf and those of its corners that no other leaf has.
    pub fn remove(&mut self, leaf: Key) -> Option<T> {
        let record = self.tree.remove(leaf)?;
        leaf.corners().into_iter().for_each(|point| drop_use(&mut self.nodes, point));
        Some(record)
    }

    /// As [`LinearOctree::refine`]. New nodes get the value of the field there, so that it does not change.
    ///
    /// # Errors
    ///
    /// Those of [`LinearOctree::refine`].
    pub fn refine(
        &mut self,
        leaf: Key,
        balance: Balance,
        mut split: impl FnMut(Key, &T) -> T,
    ) -> Result<usize, RefineError> {
        let NodalOctree { tree, nodes } = self;
        tree.refine(leaf, balance, |child, record| {
            split_nodes(nodes, child);
            split(child, record)
        })
    }

    /// As [`LinearOctree::coarsen`]; corners of the children that no other leaf has are gone.
    ///
    /// # Errors
    ///
    /// Those of [`LinearOctree::coarsen`].
    pub fn coarsen(
        &mut self,
        parent: Key,
        balance: Balance,
        merge: impl FnOnce([T; 8]) -> T,
    ) -> Result<(), RefineError> {
        self.tree.coarsen(parent, balance, merge)?;
        parent.corners().into_iter().for_each(|point| add_use(&mut self.nodes, point));
        for child in parent.children() {
            child.corners().into_iter().for_each(|point| drop_use(&mut self.nodes, point));
        }
        Ok(())
    }

    /// As [`LinearOctree::balance`]. New nodes get the value of the field there.
    pub fn balance(&mut self, balance: Balance, mut split: impl FnMut(Key, &T) -> T) -> usize
    where
        T: Sync,
    {
        let NodalOctree { tree, nodes } = self;
        tree.balance(balance, |child, record| {
            split_nodes(nodes, child);
            split(child, record)
        })
    }

    /// The field at a point in lattice coordinates, 0 ..= 2^19; `None` where no leaf is, or touches it. A search and at most 27 probes.
    pub fn value_at(&self, point: [f64; 3]) -> Option<V> {
        if !point.iter().all(|c| (0.0..=f64::from(SIDE)).contains(c)) {
            return None;
        }
        let floor = point.map(|c| c as u32);
        let leaf = self.tree.locate(floor).or_else(|| {
            // On the high side of a leaf beside a hole.
            let low = [0, 1, 2].map(|i| floor[i] - u32::from(floor[i] > 0 && f64::from(floor[i]) == point[i]));
            self.tree.leaves_in_box(low, floor).next()
        })?;
        self.value_in(leaf.0, point)
    }

    /// As [`value_at`](NodalOctree::value_at), by the field of this leaf, in whose closed cube the point lies. `None` if it is no leaf.
    pub fn value_in(&self, leaf: Key, point: [f64; 3]) -> Option<V> {
        let places = self.places(leaf)?;
        let (min, half) = (leaf.min_corner(), f64::from(leaf.size() / 2));
        // In half sides: which octant, and where there.
        let at = [0, 1, 2].map(|i| (point[i] - f64::from(min[i])) / half);
        let octant = at.map(|c| usize::from(c >= 1.0));
        let [x, y, z] = [0, 1, 2].map(|i| at[i] - octant[i] as f64);
        let mix = |a: V, b: V, t: f64| a * (1.0 - t) + b * t;
        let place = |[i, j, k]: [usize; 3]| places[9 * (octant[0] + i) + 3 * (octant[1] + j) + octant[2] + k];
        let along_z = |i, j| mix(place([i, j, 0]), place([i, j, 1]), z);
        Some(mix(mix(along_z(0, 0), along_z(0, 1), y), mix(along_z(1, 0), along_z(1, 1), y), x))
    }

    /// The values at the 27 places of a leaf: at index `9 i + 3 j + k` that `i`, `j`, `k` half sides from its least corner. `None` if it is
    /// no leaf.
    pub fn places(&self, leaf: Key) -> Option<[V; 27]> {
        self.tree.contains(leaf).then(|| places(&self.nodes, leaf))?
    }
}

impl<T, V: Value> Default for NodalOctree<T, V> {
    fn default() -> Self {
        Self::new()
    }
}

/// The centre of a leaf, of its faces and edges, and its corners: `9 i + 3 j + k`. `None` if a corner is no node.
fn places<V: Value>(nodes: &Nodes<V>, leaf: Key) -> Option<[V; 27]> {
    let (min, half) = (leaf.min_corner(), leaf.size() / 2);
    let node = |n: u32| {
        let steps = [n / 9, n / 3 % 3, n % 3];
        let point = Key::point([0, 1, 2].map(|i| min[i] + steps[i] * half))?;
        nodes.get(&point).map(|node| node.value)
    };
    let mut places = [node(0)?; 27];
    for corner in Corner::ALL {
        let n = Axis::ALL.into_iter().map(|a| 2 * STRIDE[a.index()] * usize::from(corner & a)).sum::<usize>();
        places[n] = node(n as u32)?;
    }
    // Middles of edges, then of faces, then the centre: the mean of what is half a side away along the axes on which it is in the middle.
    for dimension in 1..=3 {
        for (n, axes) in MIDDLES.iter().enumerate().filter(|(_, axes)| axes.dimension() == dimension) {
            // Nothing hangs in the middle of a leaf.
            let hanging = if dimension < 3 { node(n as u32) } else { None };
            places[n] = hanging.unwrap_or_else(|| {
                let ends =
                    axes.axes().flat_map(|a| [n - STRIDE[a.index()], n + STRIDE[a.index()]]).map(|end| places[end]);
                ends.reduce(|a, b| a + b).expect("a middle has ends") * (0.5 / f64::from(dimension))
            });
        }
    }
    Some(places)
}

/// Places from one to the next along x, y, z.
const STRIDE: [usize; 3] = [9, 3, 1];

/// The axes along which each of the 27 places is in the middle.
const MIDDLES: [Extent; 27] = {
    let mut middles = [Extent::POINT; 27];
    let mut n = 0;
    while n < 27 {
        let steps = [n / 9, n / 3 % 3, n % 3];
        let mut a = 0;
        while a < 3 {
            if steps[a] == 1 {
                middles[n] = middles[n].with(Axis::ALL[a]);
            }
            a += 1;
        }
        n += 1;
    }
    middles
};

/// When a child takes its place: the corners it adds, before the first child with the values of the parent's field. Of the parent's eight
/// corners, each goes to the child there.
fn split_nodes<V: Value>(nodes: &mut Nodes<V>, child: Key) {
    let Some(parent) = child.parent() else { return };
    if child.corner_in_parent() == Corner::MIN {
        let (min, half) = (parent.min_corner(), child.size());
        let places = places(nodes, parent).expect("the corners of a leaf are nodes");
        for (n, (axes, value)) in (0u32..).zip(MIDDLES.iter().zip(places)).filter(|(_, (axes, _))| axes.dimension() > 0)
        {
            let steps = [n / 9, n / 3 % 3, n % 3];
            let point = Key::point([0, 1, 2].map(|i| min[i] + steps[i] * half)).expect("in the root");
            // Two children at an edge's middle, four at a face's, eight at the centre.
            nodes.entry(point).or_insert(Node { uses: 0, value }).uses += 1 << axes.dimension();
        }
    }
}

fn add_corners<V>(nodes: &mut Nodes<V>, leaf: Key, value: &mut impl FnMut(Key) -> V) {
    for point in leaf.corners() {
        nodes.entry(point).or_insert_with(|| Node { uses: 0, value: value(point) }).uses += 1;
    }
}

fn add_use<V>(nodes: &mut Nodes<V>, point: Key) {
    nodes.get_mut(&point).expect("a leaf's corner is a node").uses += 1;
}

fn drop_use<V>(nodes: &mut Nodes<V>, point: Key) {
    let node = nodes.get_mut(&point).expect("a leaf's corner is a node");
    node.uses -= 1;
    if node.uses == 0 {
        nodes.remove(&point);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::oracle::points;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn number(point: Key) -> f64 {
        f64::from((point.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as u32) / f64::from(1 << 24)
    }

    /// Each corner of a leaf and how many leaves have it.
    fn corners<T, V: Value>(field: &NodalOctree<T, V>) -> BTreeMap<Key, u32> {
        let mut corners = BTreeMap::new();
        for (leaf, _) in field.tree().iter_z() {
            leaf.corners().into_iter().for_each(|point| *corners.entry(point).or_default() += 1);
        }
        corners
    }

    fn counted<T, V: Value>(field: &NodalOctree<T, V>) -> BTreeMap<Key, u32> {
        field.nodes_z().into_iter().map(|(point, _)| (point, field.uses(point))).collect()
    }

    /// Refined at points, with unrelated values at all nodes.
    fn field(points: &[[u32; 3]], balance: Balance) -> NodalOctree<u8, f64> {
        let mut field = NodalOctree::new();
        field.insert(Key::ROOT, 0, number);
        for &point in points {
            for _ in 0..2 {
                let (leaf, _) = field.tree().locate(point).expect("covered");
                field.refine(leaf, balance, |_, &record| record).expect("a leaf");
            }
        }
        let nodes = field.nodes_z();
        nodes.into_iter().for_each(|(point, _)| *field.value_mut(point).expect("a node") = number(point));
        field
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn nodes_are_the_distinct_corners_after_any_changes(changes in prop::collection::vec((any::<prop::sample::Index>(), 0..5u8), 1..30)) {
            let mut field = field(&[[5, 1 << 18, 400_000]], Balance::Off);
            for (index, what) in changes {
                let keys = field.tree().keys_z();
                let Some(&leaf) = keys.get(index.index(keys.len().max(1))) else { break };
                match what {
                    0 => { field.remove(leaf); }
                    1 => { let _ = field.refine(leaf, Balance::Corners, |_, &record| record); }
                    2 => { let _ = field.refine(leaf, Balance::Off, |_, &record| record); }
                    3 => { field.balance(Balance::Faces, |_, &record| record); }
                    _ => { let _ = field.coarsen(leaf.parent().unwrap_or(leaf), Balance::Off, |records| records[0]); }
                }
                prop_assert_eq!(counted(&field), corners(&field));
                let orphans = field.tree().validate();
                prop_assert_eq!(orphans, Ok(()));
            }
            let again = NodalOctree::with_values(field.tree().clone(), number);
            prop_assert_eq!(counted(&again), corners(&field));
        }

        #[test]
        fn a_node_hangs_where_it_is_no_corner_of_a_leaf_around_it(points in points(3)) {
            let field = field(&points, Balance::Edges);
            for (point, _) in field.nodes_z() {
                let expected = field.tree().around(point).any(|(leaf, _)| !leaf.corners().contains(&point));
                prop_assert_eq!(field.is_hanging(point), expected);
                prop_assert!(expected || field.uses(point) as usize == field.tree().around(point).count());
            }
            prop_assert!(!field.is_hanging(Key::point([3; 3]).expect("inside")));
        }

        #[test]
        fn the_field_is_continuous_and_goes_through_its_nodes(points in points(3), shares in prop::collection::vec([0.0..=1.0, 0.0..=1.0], 8)) {
            let field = field(&points, Balance::Edges);
            for (point, value) in field.nodes_z() {
                prop_assert_eq!(field.value_at(point.center().map(f64::from)), Some(value));
            }
            for (leaf, _) in field.tree().iter_z() {
                for face in crate::grid::Face::ALL {
                    let [u, v] = face.axis().others().map(Axis::index);
                    for (other, _) in field.tree().neighbours(leaf, face).filter(|(other, _)| other.size() <= leaf.size()) {
                        // Points of the face of the smaller one, from both sides.
                        for [s, t] in &shares {
                            let mut p = leaf.min_corner().map(f64::from);
                            p[face.axis().index()] += if face.is_high() { f64::from(leaf.size()) } else { 0.0 };
                            p[u] = f64::from(other.min_corner()[u]) + s * f64::from(other.size());
                            p[v] = f64::from(other.min_corner()[v]) + t * f64::from(other.size());
                            let (a, b) = (field.value_in(leaf, p).expect("a leaf"), field.value_in(other, p).expect("a leaf"));
                            prop_assert!((a - b).abs() < 1e-12, "{} and {}: {} and {}", leaf, other, a, b);
                        }
                    }
                }
            }
        }

        #[test]
        fn refining_does_not_change_the_field(points in points(3), at in prop::collection::vec([0.0..=1.0, 0.0..=1.0, 0.0..=1.0], 20)) {
            let before = field(&points, Balance::Edges);
            let mut after = before.clone();
            for p in at.iter().take(2) {
                let (leaf, _) = after.tree().locate(p.map(|c: f64| (c * f64::from(SIDE)) as u32)).expect("covered");
                after.refine(leaf, Balance::Edges, |_, &record| record).expect("a leaf");
            }
            for p in at {
                let p = p.map(|c: f64| c * f64::from(SIDE));
                let (a, b) = (before.value_at(p).expect("covered"), after.value_at(p).expect("covered"));
                prop_assert!((a - b).abs() < 1e-12, "{} and {}", a, b);
            }
        }
    }

    #[test]
    fn outside_and_in_holes_there_is_no_field() {
        let mut field = field(&[], Balance::Edges);
        assert_eq!(field.value_at([0.0, f64::from(SIDE), 5.0]).map(f64::is_finite), Some(true));
        for p in [[-1e-9, 0.0, 0.0], [0.0, f64::from(SIDE) * 1.0001, 0.0], [f64::NAN, 0.0, 0.0]] {
            assert_eq!(field.value_at(p), None);
        }
        field.refine(Key::ROOT, Balance::Off, |_, &record| record).expect("a leaf");
        Key::ROOT.children()[1..].iter().for_each(|&child| assert!(field.remove(child).is_some()));
        let middle = f64::from(SIDE / 2);
        assert_eq!(field.value_at([middle; 3]), field.value(Key::point([SIDE / 2; 3]).expect("inside")));
        assert!(
            field.value_at([5.0, middle, middle]).is_some() && field.value_at([5.0, middle + 0.5, middle]).is_none()
        );
        field.remove(Key::ROOT.children()[0]);
        assert_eq!((field.value_at([5.0; 3]), field.is_empty(), field.len()), (None, true, 0));
    }
}
