//! Leaf search: which leaf holds a point, or a cell.

use super::LinearOctree;
use crate::grid::Key;
use crate::grid::key::{MAX_LEVEL, SIDE, interleave};

/// Leaf search.
///
/// Only leaves are in the map, so whether a point's leaf is finer or coarser than a cell that is absent cannot be told,
/// and the binary search over levels that a map with all ancestors would allow is none here. Instead each level that
/// HAS leaves is probed at most once: `L` levels cost 1 to `L` probes, often three or four in a mesh's octree, at most
/// 19.
impl<T> LinearOctree<T> {
    /// The leaf that holds a point given in lattice coordinates, 0 ..= 2^19, with its record.
    ///
    /// A leaf holds its low faces but not its high ones, so that a point has one leaf only; the high faces of the root
    /// belong to the leaves inside them. `None` where there is no leaf, and outside the root. Up to one probe for each
    /// level with leaves, from fine to coarse.
    ///
    /// ```
    /// use zmend::grid::Key;
    /// use zmend::octree::LinearOctree;
    ///
    /// let tree = LinearOctree::from_iter([(Key::ROOT, "all")]);
    /// assert_eq!(tree.locate([1, 2, 1 << 19]), Some((Key::ROOT, &"all")));
    /// assert_eq!(tree.locate([1, 2, u32::MAX]), None);
    /// ```
    pub fn locate(&self, point: [u32; 3]) -> Option<(Key, &T)> {
        self.finest_around(code_of(point)?, self.levels.occupied)
    }

    /// As [`locate`](LinearOctree::locate), for a point whose leaf is likely of about the size of the cell `hint`, such
    /// as the leaf of the previous point on a path: levels are probed by their distance from the hint's. Any cell will
    /// do as hint. For points along a line it takes a third of the time: 21 against 62 ns in `cargo bench --bench octree`.
    pub fn locate_from(&self, hint: Key, point: [u32; 3]) -> Option<(Key, &T)> {
        self.nearest_around(code_of(point)?, hint.level().unwrap_or(MAX_LEVEL))
    }

    /// The leaf that is this cell or holds it, with its record. Up to one probe for each level with leaves, from the
    /// cell's own level to the root. Domain: cells.
    pub fn leaf_over(&self, cell: Key) -> Option<(Key, &T)> {
        let level = cell.level().unwrap_or(0);
        self.finest_around(cell.code(), self.levels.occupied & ((2 << level) - 1))
    }

    /// The leaf around an interleaved point of the half-open root, where levels near `level` are the most likely.
    pub(super) fn nearest_around(&self, code: u64, level: u32) -> Option<(Key, &T)> {
        let mut levels = self.levels.occupied;
        while levels != 0 {
            // A coarser level only if it is nearer than any finer one.
            let (coarser, finer) = (levels & ((1 << level) - 1), levels >> level);
            let level = match (coarser.checked_ilog2(), finer.trailing_zeros()) {
                (Some(coarser), down) if finer == 0 || level - coarser < down => coarser,
                (_, down) => level + down,
            };
            levels ^= 1 << level;
            let cell = Key::around(code, level);
            if let Some(record) = self.get(cell) {
                return Some((cell, record));
            }
        }
        None
    }

    /// The finest leaf around an interleaved point, among these levels.
    fn finest_around(&self, code: u64, mut levels: u32) -> Option<(Key, &T)> {
        while levels != 0 {
            let level = levels.ilog2();
            let cell = Key::around(code, level);
            if let Some(record) = self.get(cell) {
                return Some((cell, record));
            }
            levels ^= 1 << level;
        }
        None
    }
}

/// The interleaved coordinates, with those on the high faces of the root moved inside. `None` outside the root.
fn code_of(point: [u32; 3]) -> Option<u64> {
    point.iter().all(|&x| x <= SIDE).then(|| interleave(point.map(|x| x.min(SIDE - 1))))
}

#[cfg(test)]
mod tests {
    use crate::grid::Key;
    use crate::grid::key::SIDE;
    use crate::octree::oracle::{Oracle, points, tree};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn search_agrees_with_a_look_at_all_leaves(tree in tree(18), points in points(20)) {
            let oracle = Oracle::new(&tree);
            let seen = tree.iter().flat_map(|(leaf, _)| leaf.corners().map(Key::center)).take(200);
            let mut hint = Key::ROOT;
            for point in points.into_iter().chain(seen) {
                let expected = oracle.leaf_at(point);
                let found = tree.locate(point);
                prop_assert_eq!(found.map(|(leaf, _)| leaf), expected);
                prop_assert!(found.is_none_or(|(leaf, &record)| record == leaf.to_bits()));
                for hint in [hint, Key::ROOT, Key::cell(18, [0; 3]).expect("the finest")] {
                    prop_assert_eq!(tree.locate_from(hint, point), found);
                }
                hint = found.map_or(hint, |(leaf, _)| leaf);
            }
            prop_assert_eq!(tree.locate([0, SIDE + 1, 0]), None);
        }

        #[test]
        fn the_leaf_over_a_cell_holds_it(tree in tree(6), points in points(20), level in 0..=8u32) {
            for point in points {
                let Some(cell) = Key::holding(point, level) else { continue };
                let holds = |leaf: &Key| leaf.contains(cell);
                let expected = tree.iter().map(|(leaf, _)| leaf).find(holds);
                prop_assert_eq!(tree.leaf_over(cell).map(|(leaf, _)| leaf), expected);
            }
        }
    }
}
