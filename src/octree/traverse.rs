//! Ways through all leaves: in any order, in Z-order or by level, alone or on all threads; and through the leaves in one cell.

use std::iter::FusedIterator;

use rayon::prelude::*;

use super::{Block, CellState, LinearOctree};
use crate::grid::block::Cells;
use crate::grid::brick::Bits;
use crate::grid::{Corner, Direction, Extent, Key};

/// Into how many stretches of the Z-order curve a tree is cut at least for all threads, if it has as many leaves. A number that does
/// not depend on the threads, and enough for many of them to be kept busy where most leaves are in few stretches.
const STRETCHES: usize = 1024;

/// Traversal.
///
/// All of these borrow the tree and allocate nothing for a leaf, but where they say so.
impl<T> LinearOctree<T> {
    /// All leaves in arbitrary order: the fastest way, along the table.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (Key, &T)> + Clone {
        let blocks = self.blocks.iter();
        let leaves = blocks.flat_map(|(&name, block)| InBlock::new(name, block.leaves, block.records.iter()));
        Counted { leaves, left: self.len() }
    }

    /// All leaves in arbitrary order, with records to change.
    pub fn iter_mut(&mut self) -> impl ExactSizeIterator<Item = (Key, &mut T)> {
        let left = self.len();
        let blocks = self.blocks.iter_mut();
        let leaves = blocks.flat_map(|(&name, block)| InBlock::new(name, block.leaves, block.records.iter_mut()));
        Counted { leaves, left }
    }

    /// The keys of all leaves in Z-order, which is that of a depth-first walk.
    pub fn keys_z(&self) -> Vec<Key> {
        let mut keys = Vec::with_capacity(self.len());
        keys.extend(self.leaves_in(Key::ROOT).map(|(leaf, _)| leaf));
        keys
    }

    /// All leaves in Z-order: a depth-first walk, one probe for each block.
    pub fn iter_z(&self) -> impl ExactSizeIterator<Item = (Key, &T)> + Clone {
        Counted { leaves: self.leaves_in(Key::ROOT), left: self.len() }
    }

    /// All leaves in Z-order, with records to change. Collects a key and a reference for each, 16 bytes, and sorts them, on one thread:
    /// safe code cannot hand out references into a hash table along the curve otherwise. [`par_iter_z_mut`](Self::par_iter_z_mut) does so on
    /// all threads, and [`iter_mut`](Self::iter_mut) needs no list.
    pub fn iter_z_mut(&mut self) -> impl ExactSizeIterator<Item = (Key, &mut T)> + DoubleEndedIterator {
        let mut leaves: Vec<(Key, &mut T)> = self.iter_mut().collect();
        leaves.sort_unstable_by_key(|&(leaf, _)| leaf);
        leaves.into_iter()
    }

    /// All leaves from the coarsest level to the finest, each level in Z-order: breadth first. Collects and sorts 16 bytes for each
    /// block of up to 64 leaves.
    ///
    /// ```
    /// use zmend::grid::{Corner, Key};
    /// use zmend::octree::LinearOctree;
    ///
    /// let [first, rest @ ..] = Key::ROOT.children();
    /// let tree: LinearOctree<()> = first.children().into_iter().chain(rest).map(|leaf| (leaf, ())).collect();
    /// let levels: Vec<u32> = tree.iter_by_level().filter_map(|(leaf, ())| leaf.level()).collect();
    /// assert_eq!(levels, [1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2]);
    /// ```
    pub fn iter_by_level(&self) -> impl Iterator<Item = (Key, &T)> {
        let mut blocks: Vec<(Key, &Block<T>)> = self.blocks.iter().map(|(&name, block)| (name, block)).collect();
        blocks.sort_unstable_by_key(|&(name, _)| (name.level(), name));
        blocks.into_iter().flat_map(|(name, block)| InBlock::new(name, block.leaves, block.records.iter()))
    }

    /// The leaves that are this cell or lie inside it, in Z-order; not a larger one that holds it. Any cell will do.
    ///
    /// Costs at most a probe for each of them and each of their ancestors in the cell, far fewer where they share blocks.
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
        let blocks = self.blocks.par_iter();
        blocks.flat_map_iter(|(&name, block)| InBlock::new(name, block.leaves, block.records.iter()))
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
    pub fn par_iter_z(&self) -> impl ParallelIterator<Item = (Key, &T)> {
        self.stretches(STRETCHES).into_par_iter().flat_map_iter(|cell| self.leaves_in(cell))
    }
}

/// Changes on all threads.
impl<T: Send> LinearOctree<T> {
    /// All leaves on all threads in arbitrary order, with records to change.
    pub fn par_iter_mut(&mut self) -> impl ParallelIterator<Item = (Key, &mut T)> {
        let blocks = self.blocks.par_iter_mut();
        blocks.flat_map_iter(|(&name, block)| InBlock::new(name, block.leaves, block.records.iter_mut()))
    }

    /// All leaves in Z-order on all threads, with records to change. Collects a key and a reference for each, 16 bytes, and sorts
    /// them. See [`par_iter_z`](LinearOctree::par_iter_z).
    pub fn par_iter_z_mut(&mut self) -> impl IndexedParallelIterator<Item = (Key, &mut T)> {
        let mut leaves: Vec<(Key, &mut T)> = self.iter_mut().collect();
        leaves.par_sort_unstable_by_key(|&(leaf, _)| leaf);
        leaves.into_par_iter()
    }
}

impl<T> LinearOctree<T> {
    /// Cells in Z-order that hold all leaves and do not overlap: at least `count`, unless there are fewer leaves. O(`count`).
    pub(super) fn stretches(&self, count: usize) -> Vec<Key> {
        let mut cells = vec![Key::ROOT];
        while cells.len() < count {
            let before = cells.len();
            let divide = |cell: Key| {
                let parts = if self.state(cell).is_refined() { cell.children().to_vec() } else { vec![cell] };
                parts.into_iter().filter(move |&part| part == cell || !matches!(self.state(part), CellState::Absent))
            };
            let finer: Vec<Key> = cells.iter().copied().flat_map(divide).collect();
            if finer == cells {
                break;
            }
            cells = finer;
            debug_assert!(cells.len() >= before, "a refined cell has children");
        }
        cells
    }
}

/// The leaves of a block with their records.
#[derive(Clone)]
struct InBlock<R> {
    name: Key,
    places: Bits,
    records: R,
}

impl<R: Iterator> InBlock<R> {
    fn new(name: Key, leaves: Cells, records: R) -> Self {
        InBlock { name, places: leaves.places(), records }
    }
}

impl<R: Iterator> Iterator for InBlock<R> {
    type Item = (Key, R::Item);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let place = self.places.next()?;
        Some((self.name.in_block(place), self.records.next()?))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.places.0.count_ones() as usize;
        (left, Some(left))
    }
}

/// All leaves, whose number is known.
#[derive(Clone)]
struct Counted<I> {
    leaves: I,
    left: usize,
}

impl<I: Iterator> Iterator for Counted<I> {
    type Item = I::Item;

    #[inline]
    fn next(&mut self) -> Option<I::Item> {
        let leaf = self.leaves.next()?;
        self.left -= 1;
        Some(leaf)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.left, Some(self.left))
    }
}

impl<I: Iterator> ExactSizeIterator for Counted<I> {}

/// The leaves inside a cell in Z-order: [`LinearOctree::leaves_in`]. Or only those that meet one face, edge or corner
/// of it.
///
/// A depth-first walk without a stack: what comes after a cell is its next sibling, or what comes after its parent. The blocks
/// through which it goes on four levels are at hand, so that it comes to each block of a level once.
#[derive(Debug)]
pub struct LeavesIn<'a, T> {
    tree: &'a LinearOctree<T>,
    cell: Key,
    /// The children to visit: `first`, and those that differ from it along the axes of `free`.
    free: Extent,
    first: Corner,
    /// The axes along which children on the high side come first.
    flip: u8,
    /// Where the walk goes on.
    pub(super) next: Option<Key>,
    /// Of level l, at l mod 4.
    recent: [(Option<Key>, Option<&'a Block<T>>); 4],
}

impl<T> Clone for LeavesIn<'_, T> {
    fn clone(&self) -> Self {
        LeavesIn { ..*self }
    }
}

impl<'a, T> LeavesIn<'a, T> {
    /// The leaves inside `cell`, but not itself, that meet its face, edge or corner in a direction.
    pub(super) fn beside(tree: &'a LinearOctree<T>, cell: Key, direction: Direction) -> Self {
        let within = Self::new(tree, cell, direction.shared(), direction.corner());
        LeavesIn { next: Some(cell.child(within.first)), ..within }
    }

    fn new(tree: &'a LinearOctree<T>, cell: Key, free: Extent, first: Corner) -> Self {
        LeavesIn { tree, cell, free, first, flip: 0, next: Some(cell), recent: [(None, None); 4] }
    }

    /// All leaves, children in the order of their numbers with the bits of `flip` turned over.
    pub(super) fn flipped(tree: &'a LinearOctree<T>, flip: Corner) -> Self {
        LeavesIn { flip: flip.bits(), ..Self::new(tree, Key::ROOT, Extent::CELL, Corner::MIN) }
    }

    /// The block of a cell and its place there.
    fn block(&mut self, cell: Key) -> (Option<&'a Block<T>>, u32) {
        let (name, place) = cell.block();
        let recent = &mut self.recent[cell.level().unwrap_or(0) as usize & 3];
        if recent.0 != Some(name) {
            *recent = (Some(name), self.tree.blocks.get(&name));
        }
        (recent.1, place)
    }

    /// The first cell after `cell` and all it holds.
    pub(super) fn after(&self, mut cell: Key) -> Option<Key> {
        while cell != self.cell {
            let parent = cell.parent()?;
            // The next higher subset of the free axes; 0 after the last.
            let free = self.free.bits();
            let next = ((cell.corner_in_parent().bits() ^ self.flip) & free).wrapping_sub(free) & free;
            if next != 0 {
                return Some(parent.child(Corner::ALL[usize::from((self.first.bits() | next) ^ self.flip)]));
            }
            cell = parent;
        }
        None
    }
}

impl<'a, T> LeavesIn<'a, T> {
    /// Goes on from a cell to what it holds and what comes after it; gives the cell if it is a leaf.
    #[inline]
    pub(super) fn step(&mut self, cell: Key) -> Option<(Key, &'a T)> {
        let (Some(block), place) = self.block(cell) else {
            self.next = self.after(cell);
            return None;
        };
        let first = || cell.child(Corner::ALL[usize::from(self.first.bits() ^ self.flip)]);
        self.next = if block.refined.has(place) { Some(first()) } else { self.after(cell) };
        block.get(place).map(|record| (cell, record))
    }
}

impl<'a, T> Iterator for LeavesIn<'a, T> {
    type Item = (Key, &'a T);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        while let Some(cell) = self.next {
            let leaf = self.step(cell);
            if leaf.is_some() {
                return leaf;
            }
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
