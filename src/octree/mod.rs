//! [`LinearOctree`]: an octree without pointers, a hash map from packed keys to blocks of leaves.
//!
//! Only leaves have records. Parents, children and neighbours are arithmetic on keys. Leaves lie in blocks of 4 x 4 x 4 cells of a
//! level: two words of bits tell which cells are leaves and which have leaves inside, and the records follow each other without
//! gaps. So a leaf costs its record and 3 to 5 bytes, one probe answers for 64 cells, and a search for the leaf at a point bisects the
//! levels.
//!
//! | to | there is |
//! |---|---|
//! | make and change trees | [`insert`](LinearOctree::insert), [`build`](LinearOctree::build), [`refine`](LinearOctree::refine), [`coarsen`](LinearOctree::coarsen), [`balance`](LinearOctree::balance), [`of_points`](LinearOctree::of_points) |
//! | find leaves | [`locate`](LinearOctree::locate), [`locate_all`](LinearOctree::locate_all), [`leaves_in_box`](LinearOctree::leaves_in_box), [`leaves_within`](LinearOctree::leaves_within), [`along_ray`](LinearOctree::along_ray), [`around`](LinearOctree::around), [`neighbours`](LinearOctree::neighbours) |
//! | go through all | [`iter_z`](LinearOctree::iter_z), [`iter_by_level`](LinearOctree::iter_by_level), [`par_iter_z`](LinearOctree::par_iter_z), [`visit_dual`](LinearOctree::visit_dual), [`face_regions`](LinearOctree::face_regions) |
//! | have values at corners | [`NodalOctree`] |
//! | keep | [`to_bytes`](LinearOctree::to_bytes), [`from_bytes`](LinearOctree::from_bytes), and `serde` with the feature of that name |
//!
//! ```
//! use zmend::grid::{Corner, Face, Key};
//! use zmend::octree::LinearOctree;
//!
//! // The root split once, and its first child once more.
//! let mut tree = LinearOctree::new();
//! let [first, rest @ ..] = Key::ROOT.children();
//! tree.extend(rest.into_iter().chain(first.children()).map(|leaf| (leaf, leaf.size())));
//! assert_eq!((tree.len(), tree.validate()), (15, Ok(())));
//!
//! let (leaf, &size) = tree.locate([0, 0, 1000]).unwrap();
//! assert_eq!((leaf, size), (first.child(Corner::MIN), 1 << 17));
//! let beside: Vec<_> = tree.neighbours(rest[3], Face::ALL[0]).map(|(leaf, _)| leaf).collect();
//! assert_eq!(beside, [0, 1, 2, 3].map(|i| first.child(Corner::ALL[4 + i])));
//! ```

mod balance;
mod blocks;
mod build;
mod bytes;
pub(crate) mod cells;
pub mod compact;
pub mod components;
pub mod crossings;
mod dual;
pub mod edited;
mod face_regions;
pub mod hits;
mod locate;
mod locate_all;
mod neighbour;
pub mod nodes;
#[cfg(test)]
mod oracle;
pub(crate) mod point_set;
pub mod points;
mod query;
mod refine;
pub mod regions;
pub mod segments;
pub mod signed;
mod traverse;
mod validate;

use std::fmt;

use ahash::RandomState;
use hashbrown::HashMap;

use crate::grid::Key;
use crate::grid::block::Cells;
use crate::grid::key::MAX_LEVEL;
use locate::Coarse;

pub use blocks::CellState;
pub use compact::CompactOctree;
pub use crossings::Crossings;
pub use dual::{Dual, DualPiece};
pub use edited::EditedOctree;
pub use hits::OrientedHits;
pub use locate_all::LocateAll;
pub use neighbour::Neighbours;
pub use nodes::NodalOctree;
pub use points::{CellPoints, StoredPoints};
pub use query::Crossed;
pub use refine::{Balance, RefineError};
pub use signed::SignedOctree;
pub use traverse::LeavesIn;
pub use validate::Violation;

/// The hash never differs between runs: 256 bits of the fraction of pi.
const SEEDS: [u64; 4] = [0x243f_6a88_85a3_08d3, 0x1319_8a2e_0370_7344, 0xa409_3822_299f_31d0, 0x082e_fa98_ec4e_6c89];

/// Leaves a block for which a table has room when it is made: those of real surfaces have twice as many.
const LEAVES_A_BLOCK: usize = 16;

/// A set of cells that do not overlap, the leaves, each with a record of type `T`.
///
/// The leaves need not cover the root cube. No operation but the checked [`try_insert`](LinearOctree::try_insert) looks
/// for overlaps; [`validate`](LinearOctree::validate) does. With overlapping leaves nothing is undefined, but searches
/// return any one of the leaves that overlap.
///
/// # Memory
///
/// A block of up to 64 leaves of a level takes 49 bytes in a hash table, and an allocation with room for its records: up to seven
/// more than it has, until [`shrink_to_fit`](LinearOctree::shrink_to_fit). Blocks near a surface have 25 to 30 leaves, which makes 3
/// to 5 bytes a leaf beside its record; trees that cover the root have at least 7 leaves a block. A leaf alone, far from all others,
/// costs a block of its own and one of each coarser level. See [`allocated_bytes`](LinearOctree::allocated_bytes).
///
/// # Order
///
/// The order of [`iter`](LinearOctree::iter) is arbitrary and depends on the history of the tree; it must never reach a
/// result. The `_z` traversals give Z-order, whatever the history and the number of threads.
#[derive(Clone)]
pub struct LinearOctree<T> {
    /// By the name of the block.
    blocks: HashMap<Key, Block<T>, RandomState>,
    levels: Levels,
    /// For how many records there is room in all blocks.
    room: usize,
}

/// The cells of a level in a cube of 4 x 4 x 4 that are leaves or refined. See [`blocks`].
#[derive(Debug, Clone)]
struct Block<T> {
    /// The leaves.
    leaves: Cells,
    /// The cells with leaves inside.
    refined: Cells,
    /// Those of `leaves`, in order.
    records: Vec<T>,
}

impl<T> LinearOctree<T> {
    /// An empty tree; allocates nothing.
    pub fn new() -> Self {
        Self::with_capacity(0)
    }

    /// An empty tree whose table has room for so many leaves, if they lie as near to each other as those along a surface.
    pub fn with_capacity(leaves: usize) -> Self {
        let [a, b, c, d] = SEEDS;
        let hasher = RandomState::with_seeds(a, b, c, d);
        let blocks = HashMap::with_capacity_and_hasher(leaves.div_ceil(LEAVES_A_BLOCK), hasher);
        LinearOctree { blocks, levels: Levels::default(), room: 0 }
    }

    /// Makes room for so many more leaves; see [`with_capacity`](LinearOctree::with_capacity).
    pub fn reserve(&mut self, additional: usize) {
        self.blocks.reserve(additional.div_ceil(LEAVES_A_BLOCK));
    }

    /// Gives back what memory the leaves do not need, and makes ready for searches. O(n) if it moves them.
    pub fn shrink_to_fit(&mut self) {
        self.blocks.shrink_to_fit();
        self.blocks.values_mut().for_each(|block| block.records.shrink_to_fit());
        self.room = self.blocks.values().map(Block::room).sum();
        self.look_ahead();
    }

    /// Bytes held by the table and the records, not counting what records own elsewhere. O(1).
    pub fn allocated_bytes(&self) -> usize {
        let coarse = self.levels.coarse.as_ref().map_or(0, Coarse::bytes);
        self.blocks.allocation_size() + self.room * size_of::<T>() + coarse
    }

    /// How many leaves there are.
    pub fn len(&self) -> usize {
        self.levels.leaves
    }

    /// Whether there is no leaf.
    pub fn is_empty(&self) -> bool {
        self.levels.leaves == 0
    }

    /// Removes all leaves; keeps the memory of the table.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.room = 0;
        self.levels = Levels::default();
    }

    /// Whether exactly this cell is a leaf. One probe.
    pub fn contains(&self, leaf: Key) -> bool {
        self.block_of(leaf).is_some_and(|(block, place)| block.leaves.has(place))
    }

    /// The record of exactly this leaf. One probe; see [`leaf_over`](LinearOctree::leaf_over) for a leaf that may be
    /// larger.
    pub fn get(&self, leaf: Key) -> Option<&T> {
        let (block, place) = self.block_of(leaf)?;
        block.get(place)
    }

    /// The record of exactly this leaf, to change. One probe.
    pub fn get_mut(&mut self, leaf: Key) -> Option<&mut T> {
        self.record_mut(leaf)
    }

    /// Makes the cell a leaf, without looking whether it overlaps others; returns the record it had, if it was one. One
    /// probe, and one more for each ancestor that had no leaves yet.
    ///
    /// # Panics
    ///
    /// If the key is not that of a cell.
    pub fn insert(&mut self, cell: Key, record: T) -> Option<T> {
        self.put_record(cell, record)
    }

    /// As [`insert`](LinearOctree::insert), but refuses keys that are not cells, and cells inside or around another leaf. A probe
    /// more, and a search in the coarser levels.
    ///
    /// # Errors
    ///
    /// [`Violation::NotACell`] and [`Violation::Overlap`]; the tree is left as it was.
    pub fn try_insert(&mut self, cell: Key, record: T) -> Result<Option<T>, Violation> {
        if !(cell.is_valid() && cell.is_cell()) {
            return Err(Violation::NotACell { key: cell });
        }
        if self.state(cell).is_refined() {
            let (inner, _) = self.leaves_in(cell).next().expect("it has leaves inside");
            return Err(Violation::Overlap { outer: cell, inner });
        }
        match self.leaf_over(cell) {
            Some((outer, _)) if outer != cell => Err(Violation::Overlap { outer, inner: cell }),
            _ => Ok(self.insert(cell, record)),
        }
    }

    /// The record of a leaf, made first if the cell is none yet; does not look for overlaps. Costs as
    /// [`insert`](LinearOctree::insert).
    ///
    /// # Panics
    ///
    /// If the key is not that of a cell.
    pub fn get_or_insert_with(&mut self, cell: Key, record: impl FnOnce() -> T) -> &mut T {
        self.record_or_put(cell, record)
    }

    /// Removes exactly this leaf and returns its record. One probe, and one more for each ancestor that has no leaves left.
    pub fn remove(&mut self, leaf: Key) -> Option<T> {
        self.take_record(leaf)
    }

    /// Keeps the leaves for which the answer is yes, asked in arbitrary order.
    pub fn retain(&mut self, keep: impl FnMut(Key, &mut T) -> bool) {
        self.retain_records(keep);
    }

    /// How many leaves have this level; none above 18.
    pub fn len_of_level(&self, level: u32) -> usize {
        self.levels.counts.get(level as usize).copied().unwrap_or(0)
    }

    /// The levels that have leaves, from coarse to fine.
    pub fn levels(&self) -> impl DoubleEndedIterator<Item = u32> + Clone + use<T> {
        let occupied = self.levels.occupied;
        (0..=MAX_LEVEL).filter(move |level| occupied >> level & 1 != 0)
    }
}

impl<T> Default for LinearOctree<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// As [`LinearOctree::insert`] for each.
impl<T> Extend<(Key, T)> for LinearOctree<T> {
    fn extend<I: IntoIterator<Item = (Key, T)>>(&mut self, leaves: I) {
        let leaves = leaves.into_iter();
        self.reserve(leaves.size_hint().0);
        for (cell, record) in leaves {
            self.insert(cell, record);
        }
    }
}

/// As [`LinearOctree::insert`] for each.
impl<T> FromIterator<(Key, T)> for LinearOctree<T> {
    fn from_iter<I: IntoIterator<Item = (Key, T)>>(leaves: I) -> Self {
        let mut tree = LinearOctree::new();
        tree.extend(leaves);
        tree
    }
}

/// The same leaves with equal records, whatever the history.
impl<T: PartialEq> PartialEq for LinearOctree<T> {
    fn eq(&self, other: &Self) -> bool {
        let same = |(&name, block): (&Key, &Block<T>)| {
            other.blocks.get(&name).is_some_and(|b| b.leaves == block.leaves && b.records == block.records)
        };
        self.len() == other.len() && self.blocks.iter().all(same)
    }
}

impl<T: Eq> Eq for LinearOctree<T> {}

/// All leaves in Z-order.
impl<T: fmt::Debug> fmt::Debug for LinearOctree<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.iter_z()).finish()
    }
}

/// How many leaves each level has.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Levels {
    counts: [usize; MAX_LEVEL as usize + 1],
    /// Bit `l` is set where `counts[l]` is not 0.
    occupied: u32,
    /// Of all levels.
    leaves: usize,
    /// What the coarse levels have, as long as no leaf has changed since that was looked up.
    coarse: Option<Coarse>,
}

impl Levels {
    /// `more` leaves of the level of `cell`.
    fn add(&mut self, cell: Key, more: usize) {
        let level = cell.level().expect("a leaf is a cell: checked by insert");
        self.coarse = None;
        self.counts[level as usize] += more;
        self.leaves += more;
        self.occupied |= u32::from(more > 0) << level;
    }

    /// `fewer` leaves of the level of `cell`.
    fn remove(&mut self, cell: Key, fewer: usize) {
        let level = cell.level().expect("a leaf is a cell: checked by insert");
        self.coarse = None;
        self.counts[level as usize] -= fewer;
        self.leaves -= fewer;
        if self.counts[level as usize] == 0 {
            self.occupied &= !(1 << level);
        }
    }

    /// Whether any leaf has this level.
    fn has(&self, level: u32) -> bool {
        self.occupied >> level & 1 != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Corner;

    #[test]
    fn leaves_and_levels_are_counted() {
        let child = Key::ROOT.child(Corner::MIN);
        let mut tree = LinearOctree::new();
        assert_eq!(tree.insert(child, 'a'), None);
        assert_eq!(tree.insert(child, 'b'), Some('a'));
        *tree.get_or_insert_with(child.child(Corner::MAX), || 'c') = 'd';
        assert_eq!(*tree.get_or_insert_with(child, || 'x'), 'b');
        assert_eq!((tree.len(), tree.len_of_level(1), tree.len_of_level(2), tree.len_of_level(99)), (2, 1, 1, 0));
        assert_eq!(tree.levels().collect::<Vec<_>>(), [1, 2]);

        assert_eq!(tree.remove(child), Some('b'));
        assert_eq!(tree.remove(child), None);
        assert_eq!((tree.get(child.child(Corner::MAX)), tree.contains(child)), (Some(&'d'), false));
        assert_eq!(tree.levels().collect::<Vec<_>>(), [2]);

        tree.retain(|_, &mut record| record != 'd');
        assert!(tree.is_empty() && tree.levels().next().is_none());
        tree.insert(child, 'e');
        tree.clear();
        assert!(tree.is_empty() && tree.levels().next().is_none());
    }

    #[test]
    fn checked_insertion_refuses_overlap_with_larger_leaves() {
        let [first, second, ..] = Key::ROOT.children();
        let mut tree = LinearOctree::new();
        assert_eq!(tree.try_insert(first, 1), Ok(None));
        assert_eq!(tree.try_insert(first, 2), Ok(Some(1)));
        let inner = first.child(Corner::MAX);
        assert_eq!(tree.try_insert(inner, 3), Err(Violation::Overlap { outer: first, inner }));
        assert_eq!(tree.try_insert(second.child(Corner::MAX), 4), Ok(None));
        let point = Key::point([0; 3]).expect("inside the root");
        assert_eq!(tree.try_insert(point, 5), Err(Violation::NotACell { key: point }));
        assert_eq!((tree.len(), tree.validate()), (2, Ok(())));
    }

    #[test]
    #[should_panic(expected = "point at 0,0,0 cannot be a leaf")]
    fn a_point_is_no_leaf() {
        LinearOctree::new().insert(Key::point([0; 3]).expect("inside the root"), ());
    }

    #[test]
    fn equal_and_shown_alike_whatever_the_history() {
        let leaves = Key::ROOT.children().map(|leaf| (leaf, leaf.corner_in_parent().index()));
        let forward: LinearOctree<_> = leaves.into_iter().collect();
        let mut backward: LinearOctree<_> = leaves.into_iter().rev().collect();
        backward.insert(Key::ROOT, 0);
        backward.remove(Key::ROOT);
        assert_eq!(forward, backward);
        assert_eq!(format!("{forward:?}"), format!("{backward:?}"));
    }

    #[test]
    fn a_leaf_costs_its_record_and_little_more() {
        let mut tree: LinearOctree<u64> = LinearOctree::new();
        tree.extend(Key::ROOT.children().into_iter().flat_map(Key::children).map(|leaf| (leaf, 0)));
        assert_eq!(tree.len(), 64);
        tree.shrink_to_fit();
        // A block with leaves, two of refined cells.
        assert!(tree.allocated_bytes() <= 64 * 8 + 4 * 49 + 32, "{}", tree.allocated_bytes());
        tree.retain(|_, _| false);
        tree.shrink_to_fit();
        assert_eq!((tree.allocated_bytes(), tree.blocks.len()), (0, 0));
    }
}
