//! The leaves around a cell: across its faces, edges and corners, of the same size, larger or smaller.

use std::iter::FusedIterator;

use super::{CellState, LeavesIn, LinearOctree};
use crate::grid::{Direction, Key};

/// Neighbours, found by arithmetic and probes; nothing is stored.
impl<T> LinearOctree<T> {
    /// The leaves that touch a cell in one direction, that is across a [`Face`](crate::grid::Face), an
    /// [`Edge`](crate::grid::Edge) or a [`Corner`](crate::grid::Corner), with their records.
    ///
    /// It is the one leaf that is, or holds, the neighbour of the same size, or else the smaller leaves inside that
    /// neighbour whose boundary meets the face, edge or corner shared with the cell, in Z-order. A larger leaf across
    /// an edge or corner may lie across a face as well. The cell itself may be any cell, a leaf or not.
    ///
    /// Costs one probe if it has the same size, one or two more if it is twice as large, and where leaves are smaller, one for each of
    /// them and of their ancestors in the neighbour at most. Domain: cells.
    pub fn neighbours(&self, cell: Key, direction: impl Into<Direction>) -> Neighbours<'_, T> {
        let direction = direction.into();
        let Some(beyond) = cell.toward(direction) else { return Neighbours { whole: None, parts: None } };
        let back = direction.opposite();
        let (whole, parts) = match self.state(beyond) {
            CellState::Leaf(record) => (Some((beyond, record)), None),
            CellState::Refined => (None, Some(LeavesIn::beside(self, beyond, back))),
            CellState::Absent => (self.leaf_around(beyond), None),
        };
        Neighbours { whole, parts }
    }

    /// The leaf that holds a cell which is not in the tree; likely one of the next coarser level.
    pub(super) fn leaf_around(&self, cell: Key) -> Option<(Key, &T)> {
        let coarser = self.levels.occupied & ((1 << cell.level()?) - 1);
        self.search(cell.code(), coarser, coarser.checked_ilog2()?)
    }

    /// All leaves other than the cell that touch it, across faces, edges and corners, each once, with their records: by
    /// direction in the order of [`Direction::ALL`], then in Z-order. Domain: leaves of this tree. Costs as
    /// [`neighbours`](LinearOctree::neighbours) 26 times.
    pub fn all_neighbours(&self, leaf: Key) -> impl Iterator<Item = (Key, &T)> {
        Direction::ALL.into_iter().enumerate().flat_map(move |(i, direction)| {
            // A larger one fills several directions and counts in the first.
            let earlier = &Direction::ALL[..i];
            let seen =
                move |larger: Key| earlier.iter().any(|&d| leaf.toward(d).is_some_and(|cell| larger.contains(cell)));
            self.neighbours(leaf, direction).filter(move |&(other, _)| other.size() <= leaf.size() || !seen(other))
        })
    }
}

/// The leaves of [`LinearOctree::neighbours`].
#[derive(Debug)]
pub struct Neighbours<'a, T> {
    /// The neighbour of the same size or larger, until it was given.
    whole: Option<(Key, &'a T)>,
    /// Smaller ones.
    parts: Option<LeavesIn<'a, T>>,
}

impl<'a, T> Iterator for Neighbours<'a, T> {
    type Item = (Key, &'a T);

    fn next(&mut self) -> Option<Self::Item> {
        self.whole.take().or_else(|| self.parts.as_mut()?.next())
    }
}

impl<T> FusedIterator for Neighbours<'_, T> {}

#[cfg(test)]
mod tests {
    use crate::grid::{Corner, Direction, Edge, Face, Key};
    use crate::octree::LinearOctree;
    use crate::octree::oracle::{Oracle, tree};
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn neighbours_agree_with_a_look_at_all_leaves(tree in tree(5)) {
            let oracle = Oracle::new(&tree);
            for leaf in tree.keys_z() {
                for direction in Direction::ALL {
                    let found: Vec<Key> = tree.neighbours(leaf, direction).map(|(key, _)| key).collect();
                    prop_assert_eq!(&found, &oracle.neighbours(leaf, direction), "{} {}", leaf, direction);
                    for other in found {
                        let mut back = tree.neighbours(other, direction.opposite());
                        prop_assert!(other.size() > leaf.size() || back.any(|(key, _)| key == leaf));
                    }
                }
                let all: Vec<Key> = tree.all_neighbours(leaf).map(|(key, _)| key).collect();
                let set: BTreeSet<Key> = all.iter().copied().collect();
                prop_assert_eq!(all.len(), set.len());
                prop_assert!(set.into_iter().eq(oracle.touching(leaf)));
            }
        }
    }

    #[test]
    fn one_larger_or_several_smaller() {
        let [first, rest @ ..] = Key::ROOT.children();
        let leaves = rest.into_iter().chain(first.children());
        let tree: LinearOctree<()> = leaves.map(|leaf| (leaf, ())).collect();
        let keys = |cell, direction: Direction| tree.neighbours(cell, direction).map(|(k, ())| k).collect::<Vec<_>>();

        let above = rest[0]; // corner 1, beyond the first in z
        assert_eq!(keys(above, Face::ALL[4].into()), [1, 3, 5, 7].map(|i| first.child(Corner::ALL[i])));
        assert_eq!(keys(first.child(Corner::ALL[3]), Face::ALL[5].into()), [above]);
        assert_eq!(keys(rest[2], Edge::ALL[0].into()), [3, 7].map(|i| first.child(Corner::ALL[i])));
        assert_eq!(keys(rest[6], Corner::MIN.into()), [first.child(Corner::MAX)]);
        assert_eq!(keys(above, Face::ALL[5].into()), []);
        assert_eq!(tree.all_neighbours(first.child(Corner::MAX)).count(), 14);
    }
}
