//! The octree's invariants, recomputed.

use super::{Levels, LinearOctree};
use crate::grid::Key;

/// What breaks an octree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Violation {
    /// A key that names no cell inside the root.
    #[error("{key:?} is not a cell, so it cannot be a leaf")]
    NotACell {
        /// The key.
        key: Key,
    },
    /// Two leaves of which one lies inside the other.
    #[error("leaf {inner} lies inside leaf {outer}")]
    Overlap {
        /// The larger leaf.
        outer: Key,
        /// The smaller one.
        inner: Key,
    },
    /// The tree's own count of the leaves of a level is wrong.
    #[error("level {level} has {found} leaves, but {recorded} were counted")]
    Count {
        /// The level.
        level: u32,
        /// Leaves there are.
        found: usize,
        /// Leaves on record.
        recorded: usize,
    },
}

impl<T> LinearOctree<T> {
    /// Whether all keys are cells, the counts of levels are right and no two leaves overlap.
    ///
    /// O(n), with a probe for each leaf and each level with leaves above its own. It is the only check that sees a leaf
    /// inserted AROUND others.
    ///
    /// # Errors
    ///
    /// The first violation of the first of these kinds, by Z-order or level.
    pub fn validate(&self) -> Result<(), Violation> {
        if let Some(key) = self.leaves.keys().copied().filter(|key| !(key.is_valid() && key.is_cell())).min() {
            return Err(Violation::NotACell { key });
        }
        let mut found = Levels::default();
        self.leaves.keys().for_each(|&leaf| found.add(leaf));
        if let Some(level) = (0..found.counts.len()).find(|&level| {
            found.counts[level] != self.levels.counts[level] || found.has(level as u32) != self.levels.has(level as u32)
        }) {
            let (found, recorded) = (found.counts[level], self.levels.counts[level]);
            return Err(Violation::Count { level: level as u32, found, recorded });
        }
        let overlaps = self.leaves.keys().filter_map(|&inner| {
            let (outer, _) = self.leaf_over(inner.parent()?)?;
            Some((inner, outer))
        });
        match overlaps.min() {
            Some((inner, outer)) => Err(Violation::Overlap { outer, inner }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Corner;
    use crate::octree::oracle::{points, tree};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn overlaps_are_found(mut tree in tree(9), points in points(3), level in 0..=10u32) {
            prop_assert_eq!(tree.validate(), Ok(()));
            for point in points {
                let Some(cell) = Key::holding(point, level) else { continue };
                tree.insert(cell, 0);
            }
            let keys = tree.keys_z();
            let is_inside = |&inner: &Key| keys.iter().any(|&outer| outer != inner && outer.contains(inner));
            let inner = keys.iter().copied().find(is_inside);
            match tree.validate() {
                Ok(()) => prop_assert_eq!(inner, None),
                Err(Violation::Overlap { outer, inner: found }) => {
                    prop_assert_eq!(Some(found), inner);
                    prop_assert!(outer != found && outer.contains(found) && tree.contains(outer));
                }
                Err(other) => prop_assert!(false, "{}", other),
            }
        }
    }

    #[test]
    fn wrong_counts_and_keys_are_found() {
        let mut tree: LinearOctree<()> = Key::ROOT.children().map(|leaf| (leaf, ())).into_iter().collect();
        tree.levels.add(Key::ROOT);
        assert_eq!(tree.validate(), Err(Violation::Count { level: 0, found: 0, recorded: 1 }));
        tree.levels.remove(Key::ROOT);
        tree.levels.occupied = 0;
        assert_eq!(tree.validate(), Err(Violation::Count { level: 1, found: 8, recorded: 8 }));
        let face = Key::ROOT.child(Corner::MIN).faces()[0];
        tree.leaves.insert(face, ());
        assert_eq!(tree.validate(), Err(Violation::NotACell { key: face }));
    }

    #[test]
    fn violations_say_what_and_where() {
        let inner = Key::ROOT.child(Corner::MAX);
        assert_eq!(
            Violation::Overlap { outer: Key::ROOT, inner }.to_string(),
            "leaf cell level 1 at 262144,262144,262144 lies inside leaf cell level 0 at 0,0,0"
        );
    }
}
