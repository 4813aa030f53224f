//! The octree's invariants, recomputed.

use super::{Block, Levels, LinearOctree};
use crate::grid::block::Cells;
use crate::grid::key::MAX_LEVEL;
use crate::grid::{Corner, Key};

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
    /// The marks by which searches find their way are wrong.
    #[error("{cell} is marked as refined or not, but its children say otherwise")]
    Mark {
        /// The cell with the wrong mark.
        cell: Key,
    },
}

impl<T> LinearOctree<T> {
    /// Whether all keys are cells, the counts of levels and the marks of cells with leaves inside are right, and no two leaves
    /// overlap.
    ///
    /// O(n), a probe for each block and each family of eight siblings.
    ///
    /// # Errors
    ///
    /// The first violation of the first of these kinds, by Z-order or level.
    pub fn validate(&self) -> Result<(), Violation> {
        let is_block = |name: &Key| name.is_valid() && name.is_cell() && name.block().1 == 0;
        if let Some(key) = self.blocks.keys().copied().filter(|name| !is_block(name)).min() {
            return Err(Violation::NotACell { key });
        }
        let outside = self.blocks.iter().filter_map(|(name, block)| {
            let level = name.level().unwrap_or(MAX_LEVEL);
            (block.nodes() & !Cells::of_level(level)).places().next().map(|place| name.in_block(place))
        });
        if let Some(key) = outside.min() {
            return Err(Violation::NotACell { key });
        }
        let mut found = Levels::default();
        self.blocks.iter().for_each(|(&name, block)| found.add(name, block.records.len()));
        if let Some(level) = (0..found.counts.len()).find(|&level| {
            found.counts[level] != self.levels.counts[level] || found.has(level as u32) != self.levels.has(level as u32)
        }) {
            let (found, recorded) = (found.counts[level], self.levels.counts[level]);
            return Err(Violation::Count { level: level as u32, found, recorded });
        }
        if let Some(cell) = self.blocks.iter().filter_map(|(&name, block)| self.wrong_mark(name, block)).min() {
            return Err(Violation::Mark { cell });
        }
        // A leaf with leaves inside is refined, too.
        let overlaps = self
            .blocks
            .iter()
            .flat_map(|(&name, block)| (block.leaves & block.refined).places().map(move |place| name.in_block(place)));
        let inner = overlaps.filter_map(|outer| {
            let first = |corner| self.leaves_in(outer.child(corner)).next().map(|(leaf, _)| (leaf, outer));
            Corner::ALL.into_iter().filter_map(first).min()
        });
        match inner.min() {
            Some((inner, outer)) => Err(Violation::Overlap { outer, inner }),
            None => Ok(()),
        }
    }

    /// The first cell that is marked wrongly because of a block: an ancestor, or one of its own.
    fn wrong_mark(&self, name: Key, block: &Block<T>) -> Option<Key> {
        if block.records.len() != block.leaves.count() || block.nodes().is_empty() {
            return Some(name);
        }
        let has_children = |cell: Key| {
            let first = (cell.level() < Some(MAX_LEVEL)).then(|| self.block_of(cell.child(Corner::MIN)))??;
            Some(first.0.nodes().byte(first.1) != 0)
        };
        let idle =
            block.refined.places().map(|place| name.in_block(place)).find(|&cell| has_children(cell) != Some(true));
        let families = (0..64).step_by(8).filter(|&place| block.nodes().byte(place) != 0);
        let unmarked = families
            .filter_map(|place| name.in_block(place).parent())
            .find(|&parent| !self.block_of(parent).is_some_and(|(above, place)| above.refined.has(place)));
        idle.into_iter().chain(unmarked).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
            let mut keys = tree.keys_z();
            keys.sort();
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
        tree.levels.add(Key::ROOT, 1);
        assert_eq!(tree.validate(), Err(Violation::Count { level: 0, found: 0, recorded: 1 }));
        tree.levels.remove(Key::ROOT, 1);
        tree.levels.occupied = 0;
        assert_eq!(tree.validate(), Err(Violation::Count { level: 1, found: 8, recorded: 8 }));
        let face = Key::ROOT.child(Corner::MIN).faces()[0];
        let mut strange = tree.clone();
        strange.blocks.insert(face, Block::EMPTY);
        assert_eq!(strange.validate(), Err(Violation::NotACell { key: face }));
        tree.levels.occupied = 2;
        let (root, _) = Key::ROOT.block();
        tree.blocks.get_mut(&root).expect("the root is refined").refined = Cells::EMPTY;
        assert_eq!(tree.validate(), Err(Violation::Mark { cell: Key::ROOT }));
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
