//! [`LinearOctree`]: an octree without pointers, a hash map from the [`Key`] of each leaf to its record.
//!
//! Only leaves are stored. Parents, children and neighbours are arithmetic on keys, so that a tree costs its records, 8
//! bytes of key and one control byte per slot, and changing a leaf never touches another one. The tree knows which
//! levels have leaves and how many; that keeps searches to the levels that occur.
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

pub(crate) mod cells;
pub mod compact;
pub mod components;
pub mod crossings;
pub mod edited;
pub mod hits;
mod locate;
mod neighbour;
#[cfg(test)]
mod oracle;
pub(crate) mod point_set;
pub mod points;
pub mod regions;
pub mod segments;
pub mod signed;
mod traverse;
mod validate;

use std::fmt;

use ahash::RandomState;
use hashbrown::HashMap;
use hashbrown::hash_map::Entry;

use crate::grid::Key;
use crate::grid::key::MAX_LEVEL;

pub use compact::CompactOctree;
pub use crossings::Crossings;
pub use edited::EditedOctree;
pub use hits::OrientedHits;
pub use neighbour::Neighbours;
pub use points::{CellPoints, StoredPoints};
pub use signed::SignedOctree;
pub use traverse::LeavesIn;
pub use validate::Violation;

/// The hash never differs between runs: 256 bits of the fraction of pi.
const SEEDS: [u64; 4] = [0x243f_6a88_85a3_08d3, 0x1319_8a2e_0370_7344, 0xa409_3822_299f_31d0, 0x082e_fa98_ec4e_6c89];

/// A set of cells that do not overlap, the leaves, each with a record of type `T`.
///
/// The leaves need not cover the root cube. No operation but the checked [`try_insert`](LinearOctree::try_insert) looks
/// for overlaps; [`validate`](LinearOctree::validate) does. With overlapping leaves nothing is undefined, but searches
/// return any one of the leaves that overlap.
///
/// # Memory
///
/// A slot of the hash table takes `size_of::<(Key, T)>() + 1` bytes: 9 with an empty record, 17 with one of 1 to 8
/// bytes. The number of slots is a power of two and at most 7/8 of them are used, so a leaf costs between 8/7 and 16/7
/// slots. See [`allocated_bytes`](LinearOctree::allocated_bytes).
///
/// # Order
///
/// The order of [`iter`](LinearOctree::iter) is arbitrary and depends on the history of the tree; it must never reach a
/// result. The `_z` traversals give Z-order, whatever the history and the number of threads.
#[derive(Clone)]
pub struct LinearOctree<T> {
    leaves: HashMap<Key, T, RandomState>,
    levels: Levels,
}

impl<T> LinearOctree<T> {
    /// An empty tree; allocates nothing.
    pub fn new() -> Self {
        Self::with_capacity(0)
    }

    /// An empty tree with room for so many leaves.
    pub fn with_capacity(leaves: usize) -> Self {
        let [a, b, c, d] = SEEDS;
        let hasher = RandomState::with_seeds(a, b, c, d);
        LinearOctree { leaves: HashMap::with_capacity_and_hasher(leaves, hasher), levels: Levels::default() }
    }

    /// Makes room for so many more leaves.
    pub fn reserve(&mut self, additional: usize) {
        self.leaves.reserve(additional);
    }

    /// Gives back what memory the leaves do not need. O(n) if it moves them.
    pub fn shrink_to_fit(&mut self) {
        self.leaves.shrink_to_fit();
    }

    /// How many leaves fit without growing.
    pub fn capacity(&self) -> usize {
        self.leaves.capacity()
    }

    /// Bytes held by the table, not counting what records own elsewhere.
    pub fn allocated_bytes(&self) -> usize {
        self.leaves.allocation_size()
    }

    /// How many leaves there are.
    pub fn len(&self) -> usize {
        self.leaves.len()
    }

    /// Whether there is no leaf.
    pub fn is_empty(&self) -> bool {
        self.leaves.is_empty()
    }

    /// Removes all leaves, keeps the memory.
    pub fn clear(&mut self) {
        self.leaves.clear();
        self.levels = Levels::default();
    }

    /// Whether exactly this cell is a leaf. One probe.
    pub fn contains(&self, leaf: Key) -> bool {
        self.leaves.contains_key(&leaf)
    }

    /// The record of exactly this leaf. One probe; see [`leaf_over`](LinearOctree::leaf_over) for a leaf that may be
    /// larger.
    pub fn get(&self, leaf: Key) -> Option<&T> {
        self.leaves.get(&leaf)
    }

    /// The record of exactly this leaf, to change. One probe.
    pub fn get_mut(&mut self, leaf: Key) -> Option<&mut T> {
        self.leaves.get_mut(&leaf)
    }

    /// Makes the cell a leaf, without looking whether it overlaps others; returns the record it had, if it was one. One
    /// probe.
    ///
    /// # Panics
    ///
    /// If the key is not that of a cell.
    pub fn insert(&mut self, cell: Key, record: T) -> Option<T> {
        assert!(cell.is_cell(), "{cell} cannot be a leaf");
        let old = self.leaves.insert(cell, record);
        if old.is_none() {
            self.levels.add(cell);
        }
        old
    }

    /// As [`insert`](LinearOctree::insert), but refuses keys that are not cells, and cells inside another leaf. One
    /// probe for each level with leaves above the cell's.
    ///
    /// It does not see leaves INSIDE the cell, which no few probes could tell; there can be none while cells are
    /// inserted from coarse to fine.
    ///
    /// # Errors
    ///
    /// [`Violation::NotACell`] and [`Violation::Overlap`]; the tree is left as it was.
    pub fn try_insert(&mut self, cell: Key, record: T) -> Result<Option<T>, Violation> {
        if !(cell.is_valid() && cell.is_cell()) {
            return Err(Violation::NotACell { key: cell });
        }
        match self.leaf_over(cell) {
            Some((outer, _)) if outer != cell => Err(Violation::Overlap { outer, inner: cell }),
            _ => Ok(self.insert(cell, record)),
        }
    }

    /// The record of a leaf, made first if the cell is none yet; does not look for overlaps. One probe.
    ///
    /// # Panics
    ///
    /// If the key is not that of a cell.
    pub fn get_or_insert_with(&mut self, cell: Key, record: impl FnOnce() -> T) -> &mut T {
        assert!(cell.is_cell(), "{cell} cannot be a leaf");
        match self.leaves.entry(cell) {
            Entry::Occupied(leaf) => leaf.into_mut(),
            Entry::Vacant(slot) => {
                self.levels.add(cell);
                slot.insert(record())
            }
        }
    }

    /// Removes exactly this leaf and returns its record. One probe.
    pub fn remove(&mut self, leaf: Key) -> Option<T> {
        let record = self.leaves.remove(&leaf)?;
        self.levels.remove(leaf);
        Some(record)
    }

    /// Keeps the leaves for which the answer is yes, asked in arbitrary order.
    pub fn retain(&mut self, mut keep: impl FnMut(Key, &mut T) -> bool) {
        let levels = &mut self.levels;
        self.leaves.retain(|&leaf, record| {
            let stays = keep(leaf, record);
            if !stays {
                levels.remove(leaf);
            }
            stays
        });
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
        self.leaves == other.leaves
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
}

impl Levels {
    fn add(&mut self, leaf: Key) {
        let level = leaf.level().expect("a leaf is a cell: checked by insert");
        self.counts[level as usize] += 1;
        self.occupied |= 1 << level;
    }

    fn remove(&mut self, leaf: Key) {
        let level = leaf.level().expect("a leaf is a cell: checked by insert");
        self.counts[level as usize] -= 1;
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
    fn a_leaf_costs_its_record_and_nine_bytes_of_a_slot() {
        let mut tree: LinearOctree<u64> = LinearOctree::with_capacity(7 << 10);
        tree.extend(Key::ROOT.children().into_iter().flat_map(Key::children).map(|leaf| (leaf, 0)));
        assert!((7 << 10..8 << 10).contains(&tree.capacity()), "{}", tree.capacity());
        assert!(tree.allocated_bytes() <= 17 * (8 << 10) + 64, "{}", tree.allocated_bytes());
        tree.shrink_to_fit();
        assert!(tree.allocated_bytes() <= 17 * 128 + 64, "{}", tree.allocated_bytes());
    }
}
