//! Leaves split and merged one at a time, with neighbours that never differ by more than one level.
//!
//! A tree is BALANCED across faces if leaves that share a piece of a face differ by at most one level; across edges if those that
//! share a piece of an edge do as well; across corners if all that touch do. [`refine`](LinearOctree::refine) splits the larger
//! neighbours first, as many as it takes, so it is never refused; [`refine_strict`](LinearOctree::refine_strict) names the neighbour
//! in the way instead. [`coarsen`](LinearOctree::coarsen) refuses what would unbalance the tree. To balance a whole tree, see
//! [`balance`](LinearOctree::balance).

use super::{CellState, LeavesIn, LinearOctree};
use crate::grid::block::Cells;
use crate::grid::key::MAX_LEVEL;
use crate::grid::{Corner, Direction, Key};

/// Across what leaves may differ by at most one level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Balance {
    /// Across nothing: leaves of any size side by side.
    Off,
    /// Across faces.
    Faces,
    /// Across faces and edges. What conforming values at [nodes](super::NodalOctree) need.
    #[default]
    Edges,
    /// Across faces, edges and corners.
    Corners,
}

impl Balance {
    /// The directions in which neighbours are compared: none, 6, 18 or 26.
    pub fn directions(self) -> impl Iterator<Item = Direction> + Clone {
        Direction::ALL.into_iter().filter(move |d| d.moves().dimension() <= self as u32)
    }
}

/// Why a leaf cannot be split or merged. The tree is left as it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RefineError {
    /// The cell is no leaf.
    #[error("{cell} is not a leaf, so it cannot be split")]
    NotALeaf {
        /// The cell.
        cell: Key,
    },
    /// The leaf is of the finest level.
    #[error("{leaf} is of the finest level and cannot be split")]
    Finest {
        /// The leaf.
        leaf: Key,
    },
    /// A child of the cell to become a leaf is none.
    #[error("{child} is not a leaf, so its siblings cannot be merged")]
    NotAFamily {
        /// The first child that is no leaf, or the cell itself where it can have no children.
        child: Key,
    },
    /// A neighbour would differ by more than one level.
    #[error("{cell} cannot change: {by} beside it would differ by more than one level; change that first")]
    Blocked {
        /// The cell that was to change.
        cell: Key,
        /// The first neighbour in the way, by direction, then in Z-order.
        by: Key,
    },
}

/// Refinement and coarsening.
impl<T> LinearOctree<T> {
    /// Splits a leaf into eight, and before it all larger neighbours that would differ by more than one level from its children, and
    /// theirs. `split` makes the record of each child, by corner, from its parent's. Returns how many leaves were split: 1 and those
    /// neighbours. In a balanced tree they are as few as possible, and it stays balanced.
    ///
    /// Costs a probe for each direction of `balance`, a few for each larger neighbour, and three for each leaf that is split.
    ///
    /// ```
    /// use zmend::grid::{Corner, Key};
    /// use zmend::octree::{Balance, LinearOctree};
    ///
    /// let mut tree = LinearOctree::from_iter([(Key::ROOT, 'a')]);
    /// let mut leaf = Key::ROOT;
    /// for corner in [Corner::MIN, Corner::MAX, Corner::MAX] {
    ///     tree.refine(leaf, Balance::Off, |_, &record| record)?;
    ///     leaf = leaf.child(corner);
    /// }
    /// // A leaf of level 3 at the middle of the root. Before it, the three leaves of level 1 beside it are split twice, and three that
    /// // are beside two of those once.
    /// assert_eq!(tree.refine(leaf, Balance::Faces, |_, &record| record)?, 10);
    /// # Ok::<(), zmend::octree::RefineError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`RefineError::NotALeaf`] and [`RefineError::Finest`].
    pub fn refine(
        &mut self,
        leaf: Key,
        balance: Balance,
        mut split: impl FnMut(Key, &T) -> T,
    ) -> Result<usize, RefineError> {
        self.check_splits(leaf)?;
        // Each is larger than the one before it, so there are at most as many as levels.
        let (mut waiting, mut count) = (vec![leaf], 0);
        while let Some(&cell) = waiting.last() {
            if let Some(larger) = self.larger_beside(cell, balance) {
                waiting.push(larger);
            } else {
                waiting.pop();
                self.split_leaf(cell, &mut split);
                count += 1;
            }
        }
        Ok(count)
    }

    /// As [`refine`](LinearOctree::refine), but splits this leaf only, or nothing.
    ///
    /// # Errors
    ///
    /// [`RefineError::Blocked`] with the larger neighbour that must be split first; [`RefineError::NotALeaf`] and
    /// [`RefineError::Finest`].
    pub fn refine_strict(
        &mut self,
        leaf: Key,
        balance: Balance,
        mut split: impl FnMut(Key, &T) -> T,
    ) -> Result<(), RefineError> {
        self.check_splits(leaf)?;
        if let Some(by) = self.larger_beside(leaf, balance) {
            return Err(RefineError::Blocked { cell: leaf, by });
        }
        self.split_leaf(leaf, &mut split);
        Ok(())
    }

    /// Makes a cell whose eight children are all leaves a leaf in their place; `merge` makes its record from theirs, by corner. A
    /// balanced tree stays balanced.
    ///
    /// Costs up to 8 probes for each direction of `balance`.
    ///
    /// # Errors
    ///
    /// [`RefineError::NotAFamily`], and [`RefineError::Blocked`] with a leaf beside it that is smaller than the children.
    pub fn coarsen(
        &mut self,
        parent: Key,
        balance: Balance,
        merge: impl FnOnce([T; 8]) -> T,
    ) -> Result<(), RefineError> {
        if !parent.is_cell() || parent.level() == Some(MAX_LEVEL) {
            return Err(RefineError::NotAFamily { child: parent });
        }
        if let Some(child) = parent.children().into_iter().find(|&child| !self.contains(child)) {
            return Err(RefineError::NotAFamily { child });
        }
        if let Some(by) = self.smaller_beside(parent, balance) {
            return Err(RefineError::Blocked { cell: parent, by });
        }
        let records = self.take_family(parent).ok_or(RefineError::NotAFamily { child: parent })?;
        self.insert(parent, merge(records));
        Ok(())
    }

    fn check_splits(&self, leaf: Key) -> Result<(), RefineError> {
        match (self.contains(leaf), leaf.level()) {
            (false, _) => Err(RefineError::NotALeaf { cell: leaf }),
            (true, Some(MAX_LEVEL)) => Err(RefineError::Finest { leaf }),
            _ => Ok(()),
        }
    }

    /// The first neighbour of a leaf that is larger.
    fn larger_beside(&self, leaf: Key, balance: Balance) -> Option<Key> {
        balance.directions().find_map(|direction| {
            let beyond = leaf.toward(direction)?;
            matches!(self.state(beyond), CellState::Absent).then(|| self.leaf_around(beyond))?.map(|(larger, _)| larger)
        })
    }

    /// The first leaf beside a cell that is smaller than the cell's children.
    fn smaller_beside(&self, parent: Key, balance: Balance) -> Option<Key> {
        balance.directions().find_map(|direction| {
            let beside = |child: Key| {
                let beyond = child.toward(direction).filter(|&beyond| !parent.contains(beyond))?;
                let smaller = || LeavesIn::beside(self, beyond, direction.opposite()).next();
                self.state(beyond).is_refined().then(smaller)?.map(|(leaf, _)| leaf)
            };
            parent.children().into_iter().find_map(beside)
        })
    }

    /// Puts eight leaves in the place of one, which is there and above level 18.
    pub(super) fn split_leaf(&mut self, leaf: Key, split: &mut impl FnMut(Key, &T) -> T) {
        let (name, place) = leaf.block();
        let block = self.blocks.get_mut(&name).expect("a leaf has a block");
        let record = block.records.remove(block.leaves.rank(place));
        block.leaves = block.leaves & !Cells::one(place);
        block.refined |= Cells::one(place);
        self.levels.remove(leaf, 1);
        let records = Corner::ALL.map(|corner| split(leaf.child(corner), &record));
        self.put_family(leaf, records);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::oracle::{BALANCES, Oracle, points, tree};
    use proptest::prelude::*;

    /// Splits the leaves at points in turn.
    fn refined(points: &[[u32; 3]], balance: Balance) -> LinearOctree<u64> {
        let mut tree = LinearOctree::from_iter([(Key::ROOT, 0)]);
        for &point in points {
            for _ in 0..2 {
                let (leaf, _) = tree.locate(point).expect("the root is covered");
                tree.refine(leaf, balance, |child, _| child.to_bits()).expect("a leaf of a coarse level");
            }
        }
        tree
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn refining_keeps_the_balance_and_splits_no_more_than_it_must(
            points in points(4), balance in prop::sample::select(&BALANCES[..]),
        ) {
            let mut tree = refined(&points, balance);
            prop_assert_eq!(tree.validate(), Ok(()));
            prop_assert_eq!(Oracle::new(&tree).imbalance(balance), None);
            for &point in &points {
                let (leaf, _) = tree.locate(point).expect("covered");
                let before = tree.clone();
                let split = tree.refine(leaf, balance, |child, _| child.to_bits()).expect("a leaf");
                prop_assert_eq!(tree.len(), before.len() + 7 * split);
                prop_assert_eq!(tree.validate(), Ok(()));
                // As few as by splitting this one alone and balancing in the obvious way.
                let mut other = before;
                other.refine(leaf, Balance::Off, |child, _| child.to_bits()).expect("a leaf");
                let mut naive = Oracle::new(&other);
                naive.balance(balance);
                prop_assert_eq!(tree.keys_z(), naive.keys());
                prop_assert!(tree.iter().all(|(leaf, &record)| record == leaf.to_bits() || leaf == Key::ROOT));
            }
        }

        #[test]
        fn strict_refinement_names_the_neighbour_in_the_way(points in points(5), target in [0..1u32 << 19, 0..1u32 << 19, 0..1u32 << 19]) {
            let mut tree = refined(&points, Balance::Faces);
            let (leaf, _) = tree.locate(target).expect("covered");
            let before = tree.clone();
            match tree.refine_strict(leaf, Balance::Faces, |child, _| child.to_bits()) {
                Ok(()) => prop_assert_eq!(Oracle::new(&tree).imbalance(Balance::Faces), None),
                Err(RefineError::Blocked { cell, by }) => {
                    prop_assert!(tree == before && cell == leaf && by.size() == 2 * leaf.size());
                    let touches = |face| tree.neighbours(leaf, face).any(|(other, _)| other == by);
                    prop_assert!(crate::grid::Face::ALL.into_iter().any(touches));
                }
                Err(other) => prop_assert!(false, "{}", other),
            }
        }

        #[test]
        fn refining_then_coarsening_changes_nothing(points in points(5), target in [0..1u32 << 19, 0..1u32 << 19, 0..1u32 << 19],
            balance in prop::sample::select(&BALANCES[..])) {
            let mut tree = refined(&points, balance);
            let before = tree.clone();
            let (leaf, &record) = tree.locate(target).expect("covered");
            if tree.refine_strict(leaf, balance, |child, _| child.to_bits()).is_ok() {
                let merge = |records: [u64; 8]| {
                    assert_eq!(records, leaf.children().map(Key::to_bits));
                    record
                };
                prop_assert_eq!(tree.coarsen(leaf, balance, merge), Ok(()));
                prop_assert_eq!(tree.validate(), Ok(()));
            }
            prop_assert_eq!(tree, before);
        }

        #[test]
        fn coarsening_is_refused_exactly_if_it_unbalances(points in points(4), balance in prop::sample::select(&BALANCES[..])) {
            let tree = refined(&points, balance);
            let parents: std::collections::BTreeSet<Key> = tree.keys_z().into_iter().filter_map(Key::parent).collect();
            for parent in parents {
                let mut coarser = tree.clone();
                match coarser.coarsen(parent, balance, |records| records[0]) {
                    Ok(()) => prop_assert_eq!(Oracle::new(&coarser).imbalance(balance), None),
                    Err(RefineError::NotAFamily { child }) => {
                        prop_assert!(!tree.contains(child) && child.parent() == Some(parent) && coarser == tree);
                    }
                    Err(RefineError::Blocked { by, .. }) => {
                        prop_assert!(coarser == tree && 4 * by.size() <= parent.size());
                        let mut naive = Oracle::new(&tree);
                        naive.merge(parent);
                        prop_assert!(naive.imbalance(balance).is_some());
                    }
                    Err(other) => prop_assert!(false, "{}", other),
                }
            }
        }

        #[test]
        fn marks_and_counts_hold_after_any_changes(mut tree in tree(7), changes in prop::collection::vec((any::<prop::sample::Index>(), 0..4u8), 0..40)) {
            for (index, what) in changes {
                let keys = tree.keys_z();
                let Some(&leaf) = keys.get(index.index(keys.len().max(1))) else { break };
                match what {
                    0 => { tree.remove(leaf); }
                    1 => { let _ = tree.refine(leaf, Balance::Corners, |child, _| child.to_bits()); }
                    2 => { let _ = tree.coarsen(leaf.parent().unwrap_or(leaf), Balance::Off, |records| records[7]); }
                    _ => tree.retain(|key, _| key.to_bits() % 5 != u64::from(what)),
                }
                prop_assert_eq!(tree.validate(), Ok(()));
            }
            let naive: Vec<Key> = tree.iter().map(|(leaf, _)| leaf).collect();
            prop_assert_eq!(naive.len(), tree.len());
        }
    }

    #[test]
    fn what_cannot_change_is_named() {
        let leaf = Key::cell(MAX_LEVEL, [5; 3]).expect("the finest");
        let mut tree = LinearOctree::from_iter([(leaf, ())]);
        assert_eq!(tree.refine(leaf, Balance::Off, |_, ()| ()), Err(RefineError::Finest { leaf }));
        assert_eq!(tree.refine(Key::ROOT, Balance::Off, |_, ()| ()), Err(RefineError::NotALeaf { cell: Key::ROOT }));
        assert_eq!(tree.coarsen(leaf, Balance::Off, |_| ()), Err(RefineError::NotAFamily { child: leaf }));
        let error = tree.refine(Key::ROOT, Balance::Off, |_, ()| ()).expect_err("not a leaf");
        assert_eq!(error.to_string(), "cell level 0 at 0,0,0 is not a leaf, so it cannot be split");
    }
}
