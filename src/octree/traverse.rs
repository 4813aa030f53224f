//! Ways through all leaves: in any order or in Z-order, alone or on all threads; and through the leaves in one cell.

use std::iter::FusedIterator;

use rayon::prelude::*;

use super::LinearOctree;
use crate::grid::{Corner, Direction, Extent, Key};

/// Traversal.
///
/// The plain ones go through the table: O(n), no memory, arbitrary order. The `_z` ones collect a key and a reference
/// for each leaf, 16 bytes, and sort them: O(n log n), and the same order whatever the tree's history and the number of
/// threads.
impl<T> LinearOctree<T> {
    /// All leaves in arbitrary order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (Key, &T)> + Clone {
        self.leaves.iter().map(|(&leaf, record)| (leaf, record))
    }

    /// All leaves in arbitrary order, with records to change.
    pub fn iter_mut(&mut self) -> impl ExactSizeIterator<Item = (Key, &mut T)> {
        self.leaves.iter_mut().map(|(&leaf, record)| (leaf, record))
    }

    /// The keys of all leaves in Z-order, which is that of a depth-first walk. Sorts on all threads.
    pub fn keys_z(&self) -> Vec<Key> {
        let mut keys: Vec<Key> = self.leaves.keys().copied().collect();
        keys.par_sort_unstable();
        keys
    }

    /// All leaves in Z-order.
    pub fn iter_z(&self) -> impl ExactSizeIterator<Item = (Key, &T)> + DoubleEndedIterator {
        let mut leaves: Vec<(Key, &T)> = self.iter().collect();
        leaves.sort_unstable_by_key(|&(leaf, _)| leaf);
        leaves.into_iter()
    }

    /// All leaves in Z-order, with records to change.
    pub fn iter_z_mut(&mut self) -> impl ExactSizeIterator<Item = (Key, &mut T)> + DoubleEndedIterator {
        let mut leaves: Vec<(Key, &mut T)> = self.iter_mut().collect();
        leaves.sort_unstable_by_key(|&(leaf, _)| leaf);
        leaves.into_iter()
    }

    /// The leaves that are this cell or lie inside it, in Z-order; not a larger one that holds it. Any cell will do.
    ///
    /// Costs a probe for each of them and each of their ancestors in the cell; where the cell is EMPTY, up to 8^d
    /// probes with leaves `d` levels below it elsewhere in the tree.
    ///
    /// ```
    /// use zmend::grid::Key;
    /// use zmend::octree::LinearOctree;
    ///
    /// let tree: LinearOctree<()> = Key::ROOT.children().map(|leaf| (leaf, ())).into_iter().collect();
    /// assert!(tree.leaves_in(Key::ROOT).map(|(leaf, _)| leaf).eq(Key::ROOT.children()));
    /// ```
    pub fn leaves_in(&self, cell: Key) -> LeavesIn<'_, T> {
        LeavesIn::new(self, cell, Extent::CELL, Corner::MIN)
    }
}

/// Traversal on all threads.
impl<T: Sync> LinearOctree<T> {
    /// All leaves on all threads, in arbitrary order.
    pub fn par_iter(&self) -> impl ParallelIterator<Item = (Key, &T)> {
        self.leaves.par_iter().map(|(&leaf, record)| (leaf, record))
    }

    /// All leaves in Z-order on all threads. Each thread works on stretches of the curve, and what is collected is in
    /// order, so that results do not depend on the number of threads; for sums of floats, collect first.
    ///
    /// ```
    /// use rayon::prelude::*;
    /// use zmend::grid::Key;
    /// use zmend::octree::LinearOctree;
    ///
    /// let tree: LinearOctree<u32> = Key::ROOT.children().map(|leaf| (leaf, leaf.size())).into_iter().collect();
    /// let keys: Vec<Key> = tree.par_iter_z().map(|(leaf, _)| leaf).collect();
    /// assert_eq!(keys, Key::ROOT.children());
    /// ```
    pub fn par_iter_z(&self) -> impl IndexedParallelIterator<Item = (Key, &T)> {
        let mut leaves: Vec<(Key, &T)> = self.iter().collect();
        leaves.par_sort_unstable_by_key(|&(leaf, _)| leaf);
        leaves.into_par_iter()
    }
}

/// Changes on all threads.
impl<T: Send> LinearOctree<T> {
    /// All leaves on all threads in arbitrary order, with records to change.
    pub fn par_iter_mut(&mut self) -> impl ParallelIterator<Item = (Key, &mut T)> {
        self.leaves.par_iter_mut().map(|(&leaf, record)| (leaf, record))
    }

    /// All leaves in Z-order on all threads, with records to change. See [`par_iter_z`](LinearOctree::par_iter_z).
    pub fn par_iter_z_mut(&mut self) -> impl IndexedParallelIterator<Item = (Key, &mut T)> {
        let mut leaves: Vec<(Key, &mut T)> = self.iter_mut().collect();
        leaves.par_sort_unstable_by_key(|&(leaf, _)| leaf);
        leaves.into_par_iter()
    }
}

/// The leaves inside a cell in Z-order: [`LinearOctree::leaves_in`]. Or only those that meet one face, edge or corner
/// of it.
///
/// A depth-first walk without a stack: what comes after a cell is its next sibling, or what comes after its parent.
#[derive(Debug)]
pub struct LeavesIn<'a, T> {
    tree: &'a LinearOctree<T>,
    cell: Key,
    /// The children to visit: `first`, and those that differ from it along the axes of `free`.
    free: Extent,
    first: Corner,
    /// Where the walk goes on.
    next: Option<Key>,
}

impl<'a, T> LeavesIn<'a, T> {
    /// The leaves inside `cell`, but not itself, that meet its face, edge or corner in a direction.
    pub(super) fn beside(tree: &'a LinearOctree<T>, cell: Key, direction: Direction) -> Self {
        let within = Self::new(tree, cell, direction.shared(), direction.corner());
        LeavesIn { next: within.down(cell), ..within }
    }

    fn new(tree: &'a LinearOctree<T>, cell: Key, free: Extent, first: Corner) -> Self {
        LeavesIn { tree, cell, free, first, next: Some(cell) }
    }

    /// The first child to visit, if there are leaves of finer levels at all.
    fn down(&self, cell: Key) -> Option<Key> {
        let finer = self.tree.levels.occupied >> cell.level()? > 1;
        finer.then(|| cell.child(self.first))
    }

    /// The first cell after `cell` and all it holds.
    fn after(&self, mut cell: Key) -> Option<Key> {
        while cell != self.cell {
            let parent = cell.parent()?;
            // The next higher subset of the free axes; 0 after the last.
            let free = self.free.bits();
            let next = (cell.corner_in_parent().bits() & free).wrapping_sub(free) & free;
            if next != 0 {
                return Some(parent.child(Corner::ALL[usize::from(self.first.bits() | next)]));
            }
            cell = parent;
        }
        None
    }
}

impl<'a, T> Iterator for LeavesIn<'a, T> {
    type Item = (Key, &'a T);

    fn next(&mut self) -> Option<Self::Item> {
        let tree = self.tree;
        while let Some(cell) = self.next {
            if let Some(record) = tree.get(cell) {
                self.next = self.after(cell);
                return Some((cell, record));
            }
            self.next = self.down(cell).or_else(|| self.after(cell));
        }
        None
    }
}

impl<T> FusedIterator for LeavesIn<'_, T> {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::oracle::{points, tree};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn z_order_depends_on_neither_history_nor_threads(tree in tree(18), shuffle in any::<u64>()) {
            let expected: Vec<(Key, u64)> = tree.iter_z().map(|(leaf, &record)| (leaf, record)).collect();
            prop_assert!(expected.is_sorted_by_key(|&(leaf, _)| leaf.depth_first_rank()));

            let mut shuffled = expected.clone();
            shuffled.sort_by_key(|(leaf, _)| leaf.to_bits().wrapping_mul(shuffle | 1).rotate_left(17));
            let mut other: LinearOctree<u64> = LinearOctree::new();
            for &(leaf, _) in &shuffled {
                other.insert(leaf.parent().unwrap_or(leaf), 0);
            }
            other.extend(shuffled.iter().copied());
            other.retain(|leaf, _| tree.contains(leaf));
            prop_assert_eq!(&tree, &other);

            prop_assert!(other.iter_z().map(|(leaf, &record)| (leaf, record)).eq(expected.iter().copied()));
            prop_assert!(other.iter_z_mut().map(|(leaf, record)| (leaf, *record)).eq(expected.iter().copied()));
            prop_assert!(other.keys_z().into_iter().eq(expected.iter().map(|&(leaf, _)| leaf)));
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads");
                pool.install(|| {
                    let found: Vec<_> = other.par_iter_z().map(|(leaf, &record)| (leaf, record)).collect();
                    assert_eq!(found, expected);
                    let found: Vec<_> = other.par_iter_z_mut().map(|(leaf, record)| (leaf, *record)).collect();
                    assert_eq!(found, expected);
                    assert_eq!(other.par_iter().map(|(leaf, _)| leaf).max(), expected.last().map(|&(leaf, _)| leaf));
                    other.par_iter_mut().for_each(|(leaf, record)| assert_eq!(*record, leaf.to_bits()));
                });
            }
        }

        #[test]
        fn leaves_in_a_cell_are_those_it_contains(tree in tree(6), points in points(10), level in 0..5u32) {
            for point in points {
                let Some(cell) = Key::holding(point, level) else { continue };
                let inside = tree.keys_z().into_iter().filter(|&leaf| cell.contains(leaf));
                prop_assert!(tree.leaves_in(cell).map(|(leaf, _)| leaf).eq(inside));
            }
        }
    }
}
