//! The obvious twin of the octree for tests: a list of boxes, all of which are looked at for every question.

use proptest::prelude::*;

use super::{Balance, LinearOctree};
use crate::grid::key::SIDE;
use crate::grid::{Axis, Direction, Key};

/// Up to so many lattice points.
pub(super) fn points(max: usize) -> impl Strategy<Value = Vec<[u32; 3]>> {
    prop::collection::vec([0..=SIDE, 0..=SIDE, 0..=SIDE], 0..=max)
}

/// Trees with leaves of levels up to `depth`: the root, split around random points to random levels, with random leaves
/// missing. The record of each leaf is the bits of its key.
pub(super) fn tree(depth: u32) -> impl Strategy<Value = LinearOctree<u64>> {
    let splits = prop::collection::vec(([0..SIDE, 0..SIDE, 0..SIDE], 1..=depth), 0..6);
    (splits, prop::collection::vec(any::<prop::sample::Index>(), 0..8)).prop_map(|(splits, missing)| {
        let mut tree = LinearOctree::from_iter([(Key::ROOT, Key::ROOT.to_bits())]);
        for (point, level) in splits {
            while let Some((leaf, _)) = tree.locate(point).filter(|(leaf, _)| leaf.level() < Some(level)) {
                tree.remove(leaf);
                tree.extend(leaf.children().map(|child| (child, child.to_bits())));
            }
        }
        let keys = tree.keys_z();
        for index in missing {
            tree.remove(keys[index.index(keys.len())]);
        }
        tree
    })
}

/// Every kind.
pub(super) const BALANCES: [Balance; 4] = [Balance::Off, Balance::Faces, Balance::Edges, Balance::Corners];

/// Least and greatest coordinates.
type Span = ([u32; 3], [u32; 3]);

/// All leaves in Z-order with their boxes.
pub(super) struct Oracle(Vec<(Key, Span)>);

impl Oracle {
    pub(super) fn new<T>(tree: &LinearOctree<T>) -> Self {
        Oracle(tree.keys_z().into_iter().map(|leaf| (leaf, span(leaf))).collect())
    }

    /// The leaf that holds a point on its low faces or inside, or on the root's high faces.
    pub(super) fn leaf_at(&self, point: [u32; 3]) -> Option<Key> {
        let holds = |&&(_, (min, max)): &&(Key, Span)| {
            (0..3).all(|i| min[i] <= point[i] && (point[i] < max[i] || point[i] == SIDE && max[i] == SIDE))
        };
        self.0.iter().find(holds).map(|&(leaf, _)| leaf)
    }

    /// The leaves that overlap the same-sized neighbour and touch what it shares with the cell.
    pub(super) fn neighbours(&self, cell: Key, direction: Direction) -> Vec<Key> {
        let Some(beyond) = cell.toward(direction).map(span) else { return Vec::new() };
        let shared = meet(span(cell), beyond);
        let touches = |b: Span| meets(meet(b, shared)) && (0..3).all(|i| meet(b, beyond).0[i] < meet(b, beyond).1[i]);
        self.0.iter().filter(|&&(_, b)| touches(b)).map(|&(leaf, _)| leaf).collect()
    }

    /// The leaves that share a piece of an element, of its own dimension.
    pub(super) fn around(&self, element: Key) -> Vec<Key> {
        let shares = |b: Span| {
            let (min, max) = meet(b, span(element));
            meets((min, max))
                && Axis::ALL.into_iter().all(|a| !element.dir().contains(a) || min[a.index()] < max[a.index()])
        };
        self.0.iter().filter(|&&(_, b)| shares(b)).map(|&(leaf, _)| leaf).collect()
    }

    /// The leaves.
    pub(super) fn keys(&self) -> Vec<Key> {
        self.0.iter().map(|&(leaf, _)| leaf).collect()
    }

    /// Two leaves that differ by more than one level though they share a piece of a face, edge or corner: the larger, the smaller.
    pub(super) fn imbalance(&self, balance: Balance) -> Option<(Key, Key)> {
        let share = |a: Span, b: Span| {
            let (min, max) = meet(a, b);
            meets((min, max)) && (0..3).filter(|&i| min[i] == max[i]).count() <= balance as usize
        };
        self.0.iter().find_map(|&(a, box_a)| {
            let smaller = self.0.iter().find(|&&(b, box_b)| a.size() > 2 * b.size() && share(box_a, box_b));
            smaller.map(|&(b, _)| (a, b))
        })
    }

    /// Splits leaves that are too large for a neighbour, as long as there are any.
    pub(super) fn balance(&mut self, balance: Balance) {
        while let Some((larger, _)) = self.imbalance(balance) {
            self.0.retain(|&(leaf, _)| leaf != larger);
            self.0.extend(larger.children().map(|child| (child, span(child))));
        }
        self.0.sort_by_key(|&(leaf, _)| leaf);
    }

    /// Puts a cell in the place of its children.
    pub(super) fn merge(&mut self, parent: Key) {
        self.0.retain(|&(leaf, _)| !parent.contains(leaf));
        self.0.push((parent, span(parent)));
    }

    /// The other leaves that touch this one.
    pub(super) fn touching(&self, leaf: Key) -> impl Iterator<Item = Key> {
        self.0.iter().filter(move |&&(k, b)| k != leaf && meets(meet(b, span(leaf)))).map(|&(k, _)| k)
    }
}

fn span(leaf: Key) -> Span {
    (leaf.min_corner(), leaf.max_corner())
}

fn meet(a: Span, b: Span) -> Span {
    let axes = [0, 1, 2];
    (axes.map(|i| a.0[i].max(b.0[i])), axes.map(|i| a.1[i].min(b.1[i])))
}

fn meets((min, max): Span) -> bool {
    (0..3).all(|i| min[i] <= max[i])
}
