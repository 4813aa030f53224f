//! How a [`LinearOctree`](super::LinearOctree) is stored: a hash map of blocks of 4 x 4 x 4 cells of one level.
//!
//! A block holds a word of 64 bits in which its leaves are set, a second one in which the cells that have leaves INSIDE are, and the
//! records of its leaves in order without gaps. A record's place is the number of leaves before it.
//!
//! # Invariants
//!
//! - A cell is `refined` exactly if a leaf lies strictly inside it; so a cell other than the root that is a leaf or refined has a
//!   refined parent.
//! - A block without leaves and without refined cells is not there.
//!
//! A cell's parent changes only when the first of the eight siblings appears or the last one goes; that is seen in one byte, so most
//! changes touch one block. A tree that covers the root has at least 7 leaves for each block, but for one.

use super::{Block, LinearOctree};
use crate::grid::block::Cells;
use crate::grid::{Corner, Key};
use hashbrown::hash_map::Entry;

/// Records for which a block makes room at a time: a family.
const ROOM: usize = 8;

/// What a tree has at a cell: [`LinearOctree::state`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellState<'a, T> {
    /// The cell is a leaf, with this record.
    Leaf(&'a T),
    /// There are leaves inside.
    Refined,
    /// Neither: the cell lies in a larger leaf, or where there is none.
    Absent,
}

impl<T> CellState<'_, T> {
    /// Whether there are leaves inside.
    pub fn is_refined(&self) -> bool {
        matches!(self, CellState::Refined)
    }

    /// Whether the cell is a leaf.
    pub fn is_leaf(&self) -> bool {
        matches!(self, CellState::Leaf(_))
    }
}

impl<T> Block<T> {
    pub(super) const EMPTY: Block<T> = Block { leaves: Cells::EMPTY, refined: Cells::EMPTY, records: Vec::new() };

    /// The cells that are leaves or refined.
    pub(super) fn nodes(&self) -> Cells {
        self.leaves | self.refined
    }

    pub(super) fn get(&self, place: u32) -> Option<&T> {
        self.leaves.has(place).then(|| &self.records[self.leaves.rank(place)])
    }

    pub(super) fn state(&self, place: u32) -> CellState<'_, T> {
        match self.get(place) {
            Some(record) => CellState::Leaf(record),
            None if self.refined.has(place) => CellState::Refined,
            None => CellState::Absent,
        }
    }

    /// For how many records there is room; 0 for records without size, which need none.
    pub(super) fn room(&self) -> usize {
        if size_of::<T>() == 0 { 0 } else { self.records.capacity() }
    }

    /// Makes room for `more` records, in steps of [`ROOM`]; returns for how many more there is [room](Self::room) than before.
    pub(super) fn make_room(&mut self, more: usize) -> usize {
        let before = self.room();
        if self.records.capacity() - self.records.len() < more {
            self.records.reserve_exact(more.next_multiple_of(ROOM));
        }
        self.room() - before
    }

    /// Adds a record where there is no leaf.
    pub(super) fn add(&mut self, place: u32, record: T) -> usize {
        let room = self.make_room(1);
        self.records.insert(self.leaves.rank(place), record);
        self.leaves |= Cells::one(place);
        room
    }
}

/// Storage.
impl<T> LinearOctree<T> {
    /// What there is at a cell: a leaf, leaves inside it, or neither. One probe. Nothing that is not a cell is in the tree.
    ///
    /// ```
    /// use zmend::grid::Key;
    /// use zmend::octree::{CellState, LinearOctree};
    ///
    /// let [first, second, ..] = Key::ROOT.children();
    /// let tree = LinearOctree::from_iter([(first, 7)]);
    /// let states = [Key::ROOT, first, second].map(|cell| tree.state(cell));
    /// assert_eq!(states, [CellState::Refined, CellState::Leaf(&7), CellState::Absent]);
    /// ```
    pub fn state(&self, cell: Key) -> CellState<'_, T> {
        let Some((block, place)) = self.block_of(cell) else { return CellState::Absent };
        block.state(place)
    }

    /// The block of a cell, if there is one, and the cell's place in it.
    pub(super) fn block_of(&self, cell: Key) -> Option<(&Block<T>, u32)> {
        if !cell.is_cell() {
            return None;
        }
        let (name, place) = cell.block();
        Some((self.blocks.get(&name)?, place))
    }

    /// The leaf's block and the place of its record there.
    pub(super) fn record_mut(&mut self, leaf: Key) -> Option<&mut T> {
        if !leaf.is_cell() {
            return None;
        }
        let (name, place) = leaf.block();
        let block = self.blocks.get_mut(&name)?;
        block.leaves.has(place).then(|| &mut block.records[block.leaves.rank(place)])
    }

    /// As [`LinearOctree::insert`].
    pub(super) fn put_record(&mut self, cell: Key, record: T) -> Option<T> {
        assert!(cell.is_cell(), "{cell} cannot be a leaf");
        let (name, place) = cell.block();
        let block = self.blocks.entry(name).or_insert(Block::EMPTY);
        if block.leaves.has(place) {
            let rank = block.leaves.rank(place);
            return Some(std::mem::replace(&mut block.records[rank], record));
        }
        let is_first = (block.nodes() & Cells::family(place)).is_empty();
        self.room += block.add(place, record);
        self.levels.add(cell, 1);
        if is_first {
            self.refine_above(cell);
        }
        None
    }

    /// As [`LinearOctree::get_or_insert_with`].
    pub(super) fn record_or_put(&mut self, cell: Key, record: impl FnOnce() -> T) -> &mut T {
        if !self.contains(cell) {
            self.put_record(cell, record());
        }
        self.record_mut(cell).expect("just made")
    }

    /// Makes all children of a cell leaves; it is marked as refined, and no child is a leaf or refined. One probe.
    pub(super) fn put_family(&mut self, parent: Key, records: [T; 8]) {
        let first = parent.child(Corner::MIN);
        let (name, place) = first.block();
        let block = self.blocks.entry(name).or_insert(Block::EMPTY);
        debug_assert!((block.nodes() & Cells::family(place)).is_empty(), "the children of {parent} are new");
        self.room += block.make_room(8);
        let rank = block.leaves.rank(place);
        block.records.splice(rank..rank, records);
        block.leaves |= Cells::family(place);
        self.levels.add(first, 8);
    }

    /// Removes the children of a cell if all are leaves.
    pub(super) fn take_family(&mut self, parent: Key) -> Option<[T; 8]> {
        let first = parent.child(Corner::MIN);
        let (name, place) = first.block();
        let Entry::Occupied(mut entry) = self.blocks.entry(name) else { return None };
        let block = entry.get_mut();
        if block.leaves.byte(place) != 0xff {
            return None;
        }
        let rank = block.leaves.rank(place);
        let records: Vec<T> = block.records.drain(rank..rank + 8).collect();
        block.leaves = block.leaves & !Cells::family(place);
        self.levels.remove(first, 8);
        if block.nodes().is_empty() {
            self.room -= entry.remove().room();
        }
        self.unrefine_above(first);
        records.try_into().ok()
    }

    /// Removes a leaf; see [`LinearOctree::remove`].
    pub(super) fn take_record(&mut self, leaf: Key) -> Option<T> {
        if !leaf.is_cell() {
            return None;
        }
        let (name, place) = leaf.block();
        let Entry::Occupied(mut entry) = self.blocks.entry(name) else { return None };
        let block = entry.get_mut();
        if !block.leaves.has(place) {
            return None;
        }
        let record = block.records.remove(block.leaves.rank(place));
        block.leaves = block.leaves & !Cells::one(place);
        let was_last = (block.nodes() & Cells::family(place)).is_empty();
        if block.nodes().is_empty() {
            self.room -= entry.remove().room();
        }
        self.levels.remove(leaf, 1);
        if was_last {
            self.unrefine_above(leaf);
        }
        Some(record)
    }

    /// As [`LinearOctree::retain`].
    pub(super) fn retain_records(&mut self, mut keep: impl FnMut(Key, &mut T) -> bool) {
        let (levels, room) = (&mut self.levels, &mut self.room);
        let mut emptied = Vec::new();
        self.blocks.retain(|&name, block| {
            let (before, mut places) = (block.leaves, block.leaves.places());
            block.records.retain_mut(|record| {
                let place = places.next().expect("a place a record");
                let stays = keep(name.in_block(place), record);
                if !stays {
                    block.leaves = block.leaves & !Cells::one(place);
                }
                stays
            });
            let gone = before & !block.leaves;
            levels.remove(name, gone.count());
            let left = block.nodes();
            emptied.extend(
                (0..64).step_by(8).filter(|&p| gone.byte(p) != 0 && left.byte(p) == 0).map(|p| name.in_block(p)),
            );
            if left.is_empty() {
                *room -= block.room();
            }
            !left.is_empty()
        });
        emptied.into_iter().for_each(|cell| self.unrefine_above(cell));
    }

    /// Marks the ancestors of a cell as refined, up to the first that is.
    fn refine_above(&mut self, mut cell: Key) {
        while let Some(parent) = cell.parent() {
            let (name, place) = parent.block();
            let block = self.blocks.entry(name).or_insert(Block::EMPTY);
            let was_node = !(block.nodes() & Cells::family(place)).is_empty();
            block.refined |= Cells::one(place);
            if was_node {
                return;
            }
            cell = parent;
        }
    }

    /// Takes the mark from the parent of a family that is gone, and goes on above if that was the last of ITS family.
    fn unrefine_above(&mut self, mut cell: Key) {
        while let Some(parent) = cell.parent() {
            let (name, place) = parent.block();
            let Entry::Occupied(mut entry) = self.blocks.entry(name) else { return };
            let block = entry.get_mut();
            block.refined = block.refined & !Cells::one(place);
            let left = block.nodes();
            if left.is_empty() {
                self.room -= entry.remove().room();
            }
            if !(left & Cells::family(place)).is_empty() {
                return;
            }
            cell = parent;
        }
    }
}
