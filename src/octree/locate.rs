//! Leaf search: which leaf holds a point, or a cell.

use super::{CellState, LinearOctree};
use crate::grid::Key;
use crate::grid::key::{MAX_LEVEL, SIDE, interleave};

/// The level of the leaf that holds each cell of a coarse level: most of the root's volume is in large leaves, so searches look there first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Coarse {
    /// Bits of an interleaved point below its cell.
    shift: u32,
    /// The levels that are finer than the table's.
    finer: u32,
    /// By cell, in Z-order: a level, or one of the following.
    cells: Box<[u8]>,
}

/// Leaves lie inside the cell.
const FINER: u8 = 0xff;
/// No leaf is there.
const NOTHING: u8 = 0xfe;
/// Levels that a table may have. Trees with fewer leaves than make the first worth its while have none.
const LEVELS: [u32; 2] = [4, 5];
/// Leaves for each byte of the table, at least.
const LEAVES: usize = 8;

impl Coarse {
    /// A table of nothing.
    fn new(level: u32) -> Self {
        let cells = vec![NOTHING; 1 << (3 * level)].into_boxed_slice();
        Coarse { shift: 3 * (MAX_LEVEL + 1 - level), finer: !((2 << level) - 1), cells }
    }

    /// The levels that the leaf at an interleaved point may have.
    #[inline]
    fn levels(&self, code: u64) -> u32 {
        match self.cells[(code >> self.shift) as usize] {
            FINER => self.finer,
            level => 1u32.unbounded_shl(u32::from(level)),
        }
    }

    pub(super) fn bytes(&self) -> usize {
        self.cells.len()
    }
}

/// Leaf search.
///
/// A probe tells of a cell whether it is a leaf, has leaves inside, or lies in a larger leaf or nowhere. So the level of the leaf at a
/// point is found by bisection of the levels that have leaves, after a look at the finest, where most leaves are: at most 6 probes, and
/// those of coarse levels hit few blocks, which are in the cache. Large trees that were built at once, or shrunk, know what their coarse
/// cells have, until a leaf changes: then one probe finds a large leaf, and others are searched among the finer levels only. The table
/// takes an eighth of a byte a leaf.
impl<T> LinearOctree<T> {
    /// The leaf that holds a point given in lattice coordinates, 0 ..= 2^19, with its record.
    ///
    /// A leaf holds its low faces but not its high ones, so that a point has one leaf only; the high faces of the root
    /// belong to the leaves inside them. `None` where there is no leaf, and outside the root. O(log L) probes with leaves of L
    /// levels.
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
        self.complete(self.search_at(point)?)
    }

    /// How to search for the leaf at a point.
    #[inline]
    pub(super) fn search_at(&self, point: [u32; 3]) -> Option<Search> {
        let code = code_of(point)?;
        let ahead = self.levels.coarse.as_ref().map_or(!0, |coarse| coarse.levels(code));
        let levels = self.levels.occupied & ahead;
        Some(Search::new(code, levels, levels.checked_ilog2()?))
    }

    /// Looks up what the coarse levels have, if there are so many leaves that it costs little beside them.
    pub(super) fn look_ahead(&mut self) {
        let [least, most] = LEVELS;
        let level = (self.len() / LEAVES).checked_ilog2().map_or(0, |bits| bits / 3).min(most);
        if level >= least {
            self.look_at_coarse(level);
        }
    }

    fn look_at_coarse(&mut self, level: u32) {
        let mut coarse = Coarse::new(level);
        self.list_coarse(Key::ROOT, level, &mut coarse);
        self.levels.coarse = Some(coarse);
    }

    /// Enters a cell of a level up to `last`, and all inside of it.
    fn list_coarse(&self, cell: Key, last: u32, coarse: &mut Coarse) {
        let level = cell.level().expect("a cell");
        let entry = match self.state(cell) {
            CellState::Absent => return,
            CellState::Leaf(_) => level as u8,
            CellState::Refined if level < last => {
                return cell.children().into_iter().for_each(|child| self.list_coarse(child, last, coarse));
            }
            CellState::Refined => FINER,
        };
        let first = (interleave(cell.min_corner()) >> coarse.shift) as usize;
        coarse.cells[first..first + (1 << (3 * (last - level)))].fill(entry);
    }

    /// As [`locate`](LinearOctree::locate), for a point whose leaf is likely of about the size of the cell `hint`, such
    /// as the leaf of the previous point on a path: the hint's level and the next one are probed first. Any cell will do as hint.
    /// One or two probes where it is right within a level.
    pub fn locate_from(&self, hint: Key, point: [u32; 3]) -> Option<(Key, &T)> {
        self.search(code_of(point)?, self.levels.occupied, hint.level().unwrap_or(MAX_LEVEL))
    }

    /// The leaf that is this cell or holds it, with its record. One probe if it is, else O(log L) with leaves of L coarser levels.
    /// Domain: cells.
    pub fn leaf_over(&self, cell: Key) -> Option<(Key, &T)> {
        let level = cell.level()?;
        self.search(cell.code(), self.levels.occupied & ((2 << level) - 1), level)
    }

    /// The leaf around an interleaved point of the half-open root, among those of `levels`; `level` is the most likely.
    #[inline]
    pub(super) fn search(&self, code: u64, levels: u32, level: u32) -> Option<(Key, &T)> {
        self.complete(Search::new(code, levels, level))
    }

    #[inline]
    fn complete(&self, mut search: Search) -> Option<(Key, &T)> {
        loop {
            let cell = search.cell();
            match self.state(cell) {
                CellState::Leaf(record) => return Some((cell, record)),
                other if search.narrow(other.is_refined()) => {}
                _ => return None,
            }
        }
    }
}

/// A search that goes on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search {
    /// The interleaved point.
    code: u64,
    /// The levels that its leaf may have.
    levels: u32,
    /// The level to look at.
    level: u32,
    is_first: bool,
}

impl Search {
    /// A search for nothing.
    pub(super) const IDLE: Search = Search { code: 0, levels: 0, level: 0, is_first: false };

    /// Looks at a level, then bisects `levels`; but where that level is not the finest, looks at the next one in the direction the
    /// answer gives first.
    #[inline]
    fn new(code: u64, levels: u32, level: u32) -> Self {
        Search { code, levels, level, is_first: levels >> level > 1 }
    }

    /// The cell to look at.
    #[inline]
    pub(super) fn cell(&self) -> Key {
        Key::around(self.code, self.level)
    }

    /// Goes on among the levels finer or coarser than the cell. False if none is left.
    #[inline]
    pub(super) fn narrow(&mut self, is_finer: bool) -> bool {
        let below = (2 << self.level) - 1;
        self.levels &= if is_finer { !below } else { below >> 1 };
        let next = match (std::mem::take(&mut self.is_first), is_finer) {
            (true, true) if self.levels != 0 => Some(self.levels.trailing_zeros()),
            (true, false) => self.levels.checked_ilog2(),
            _ => middle(self.levels),
        };
        self.level = next.unwrap_or(self.level);
        next.is_some()
    }
}

/// A level half-way between the coarsest and the finest of a set, if it is not empty.
#[inline]
fn middle(levels: u32) -> Option<u32> {
    let half = u32::midpoint(levels.trailing_zeros(), levels.checked_ilog2()?);
    Some((levels & ((2 << half) - 1)).ilog2())
}

/// The interleaved coordinates, with those on the high faces of the root moved inside. `None` outside the root.
#[inline]
pub(super) fn code_of(point: [u32; 3]) -> Option<u64> {
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
        fn search_agrees_with_a_look_at_all_leaves(tree in tree(18), points in points(20), ahead in 0..7u32) {
            let mut tree = tree;
            if ahead > 0 {
                tree.look_at_coarse(ahead);
            }
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
            // All at once, more than are taken at a time, some outside.
            let outside = (0..40).map(|i| [i, SIDE + i % 2, 0]);
            let all: Vec<[u32; 3]> = outside.chain(tree.iter().map(|(leaf, _)| leaf.center())).collect();
            let mut at_once = tree.locate_all(all.iter().copied());
            prop_assert_eq!(at_once.len(), all.len());
            prop_assert!(at_once.by_ref().take(33).eq(all[..33].iter().map(|&p| tree.locate(p))));
            prop_assert_eq!(at_once.len(), all.len() - 33);
            prop_assert!(at_once.eq(all[33..].iter().map(|&p| tree.locate(p))));
            // What was looked up holds until a leaf changes.
            if let Some(leaf) = tree.keys_z().first().copied() {
                tree.remove(leaf);
                prop_assert_eq!(tree.locate(leaf.center()), None);
            }
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
