//! A whole tree balanced 2:1: the fewest splits after which neighbours differ by at most one level.
//!
//! Levels are looked at from fine to coarse. The leaves of a block, those there are and those that will be made, move one step in all
//! directions as words of bits; each family of cells they reach is compared with the level above: a parent that is neither a leaf nor
//! refined, though covered by a leaf, must be made, by splitting that leaf as often as it takes. What a split asks for in turn is two
//! levels coarser, so that one pass through the levels finds all of it; then leaves are split from coarse to fine.
//!
//! A cell is made only because a leaf two levels finer touches its parent, which no balanced refinement can avoid: the result is the
//! least one. It follows that balancing twice changes nothing.
//!
//! # Cost
//!
//! Up to 27 probes a block (of 30 leaves, near a surface) and 3 for each leaf split. Blocks of a level are looked at on all threads; the
//! result is a set, so it does not depend on them.

use super::{Balance, CellState, LinearOctree, SEEDS};
use crate::grid::block::{Cells, block_beside};
use crate::grid::key::MAX_LEVEL;
use crate::grid::{Corner, Direction, Face, Key};
use ahash::RandomState;
use hashbrown::HashMap;
use rayon::prelude::*;

/// Families of cells to be made, by the block they are in; an entry for each level.
struct Made(Vec<HashMap<Key, Cells, RandomState>>);

impl<T> LinearOctree<T> {
    /// Splits leaves until neighbours differ by at most one level across what `balance` says; no more than necessary. `split` makes the
    /// record of each child from its parent's, from coarse to fine, in an order that does not depend on threads or history. Returns how
    /// many leaves were split. Holes stay holes. Costs some 0.2 us a leaf for balance over corners, less for less: what has to be split is
    /// found on all threads, the splitting itself is done on one, since it changes the table.
    ///
    /// ```
    /// use zmend::grid::Key;
    /// use zmend::octree::{Balance, LinearOctree};
    ///
    /// let at_middle = |cell: Key| cell.contains(Key::point([1 << 18; 3]).unwrap());
    /// let mut tree = LinearOctree::build(6, |cell| cell.corner_in_parent().index() == 0 && at_middle(cell), |_| ());
    /// assert_eq!((tree.len(), tree.balance(Balance::Faces, |_, ()| ())), (15, 0));
    /// ```
    pub fn balance(&mut self, balance: Balance, mut split: impl FnMut(Key, &T) -> T) -> usize
    where
        T: Sync,
    {
        let made = self.to_be_made(balance);
        let mut count = 0;
        for level in made.0 {
            let mut families: Vec<Key> = level
                .into_iter()
                .flat_map(|(name, cells)| {
                    (0..64).step_by(8).filter(move |&p| cells.has(p)).map(move |p| name.in_block(p))
                })
                .filter_map(Key::parent)
                .collect();
            families.sort_unstable();
            for leaf in families {
                self.split_leaf(leaf, &mut split);
                count += 1;
            }
        }
        count
    }

    /// Two neighbours that differ by more than one level, the larger first: the first such pair by the smaller one in Z-order. `None`
    /// if the tree is balanced. A probe and, where a neighbour is larger, a search for each leaf and direction; on all threads.
    pub fn imbalance(&self, balance: Balance) -> Option<(Key, Key)>
    where
        T: Sync,
    {
        let worst = |leaf: Key| {
            let larger = balance.directions().filter_map(move |direction| {
                let beyond = leaf.toward(direction)?;
                matches!(self.state(beyond), CellState::Absent).then(|| self.leaf_around(beyond))?
            });
            larger.map(move |(larger, _)| (leaf, larger)).find(|(leaf, larger)| larger.size() > 2 * leaf.size())
        };
        self.par_iter().filter_map(|(leaf, _)| worst(leaf)).min().map(|(leaf, larger)| (larger, leaf))
    }

    /// The families of cells that do not exist yet.
    fn to_be_made(&self, balance: Balance) -> Made
    where
        T: Sync,
    {
        let [a, b, c, d] = SEEDS;
        let empty = HashMap::with_hasher(RandomState::with_seeds(a, b, c, d));
        let mut made = Made(vec![empty; MAX_LEVEL as usize + 1]);
        let directions: Vec<Direction> = balance.directions().collect();
        // Leaves of level 1 touch nothing coarser but the root, which would hold them.
        for level in (2..=MAX_LEVEL).rev() {
            let wanted = self.families_above(level, &made, &directions);
            for (first, parents) in wanted {
                for corner in Corner::ALL.into_iter().filter(|c| parents >> c.index() & 1 != 0) {
                    let parent = first.parent().map_or(first, |above| above.child(corner));
                    self.make_node(parent, &mut made);
                }
            }
        }
        made
    }

    /// For a level: the cells of the level above that must be there, some of the eight siblings beside the first.
    fn families_above(&self, level: u32, made: &Made, directions: &[Direction]) -> Vec<(Key, u8)>
    where
        T: Sync,
    {
        let made_here = &made.0[level as usize];
        let is_of_level = |name: &Key| name.level() == Some(level);
        let old = self.blocks.par_iter().filter(|(name, block)| is_of_level(name) && !block.leaves.is_empty());
        let old = old.map(|(&name, block)| (name, block.leaves | made_here.get(&name).copied().unwrap_or_default()));
        let is_new = |name: &Key| self.blocks.get(name).is_none_or(|block| block.leaves.is_empty());
        let new = made_here.par_iter().filter(|(name, _)| is_new(name)).map(|(&name, &cells)| (name, cells));
        let mut wanted: Vec<(Key, u8)> = old
            .chain(new)
            .flat_map_iter(|(name, leaves)| {
                let reached = neighbours(leaves, directions).into_iter().enumerate();
                reached.filter(|(_, cells)| !cells.is_empty()).filter_map(move |(n, cells)| {
                    let block = block_beside(name, [n / 9, n / 3 % 3, n % 3].map(|step| step as i32 - 1))?;
                    self.missing_parents(block, cells & Cells::of_level(level), made)
                })
            })
            .collect();
        wanted.par_sort_unstable();
        wanted.dedup();
        wanted
    }

    /// Of the parents of some cells of a block those that are neither there nor to be made, but covered by a leaf: the first sibling,
    /// and a bit for each.
    fn missing_parents(&self, block: Key, cells: Cells, made: &Made) -> Option<(Key, u8)> {
        let first = block.parent()?;
        let (name, place) = first.block();
        let there = self.blocks.get(&name).map_or(Cells::EMPTY, super::Block::nodes);
        let made = made.0[first.level()? as usize].get(&name).copied().unwrap_or_default();
        let parents = (0..8).filter(|&family| cells.byte(8 * family) != 0).fold(0, |bits, family| bits | 1 << family);
        let missing = parents & !(there | made).byte(place);
        // In a refined cell, what is not there is a hole.
        let above = first.parent()?;
        (missing != 0 && !self.state(above).is_refined() && self.leaf_over(above).is_some()).then_some((first, missing))
    }

    /// Marks the family of a cell to be made, and those of its ancestors, unless they are there.
    fn make_node(&self, mut cell: Key, made: &mut Made) {
        while matches!(self.state(cell), CellState::Absent) {
            let (name, place) = cell.block();
            let cells = made.0[cell.level().unwrap_or(0) as usize].entry(name).or_default();
            if cells.has(place) {
                return;
            }
            *cells |= Cells::family(place);
            let Some(parent) = cell.parent() else { return };
            cell = parent;
        }
    }
}

/// The neighbours of cells in some directions, in the block itself (number 13) and in the 26 around it: number `9 x + 3 y + z` with steps
/// counted from -1.
fn neighbours(cells: Cells, directions: &[Direction]) -> [Cells; 27] {
    let mut reached = [Cells::EMPTY; 27];
    for direction in directions {
        let mut parts = [Cells::EMPTY; 27];
        parts[13] = cells;
        for axis in direction.moves().axes() {
            let face = Face::new(axis, direction.corner() & axis);
            let stride = [9, 3, 1][axis.index()];
            let mut moved = [Cells::EMPTY; 27];
            for (n, part) in parts.into_iter().enumerate().filter(|(_, part)| !part.is_empty()) {
                let (within, beyond) = part.moved(face);
                moved[n] |= within;
                moved[if face.is_high() { n + stride } else { n - stride }] |= beyond;
            }
            parts = moved;
        }
        reached.iter_mut().zip(parts).for_each(|(all, part)| *all |= part);
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::oracle::{BALANCES, Oracle, tree};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(128))]

        #[test]
        fn balancing_is_least_and_idempotent(tree in tree(6), balance in prop::sample::select(&BALANCES[..])) {
            let mut balanced = tree.clone();
            let count = balanced.balance(balance, |child, _| child.to_bits());
            prop_assert_eq!(balanced.len(), tree.len() + 7 * count);
            prop_assert_eq!(balanced.validate(), Ok(()));
            prop_assert_eq!(balanced.imbalance(balance), None);
            let mut naive = Oracle::new(&tree);
            naive.balance(balance);
            prop_assert_eq!(balanced.keys_z(), naive.keys());
            prop_assert!(balanced.iter().all(|(leaf, &record)| record == leaf.to_bits()));
            let again = balanced.clone();
            prop_assert_eq!(balanced.balance(balance, |child, _| child.to_bits()), 0);
            prop_assert_eq!(balanced, again);
        }

        #[test]
        fn imbalance_is_seen(tree in tree(6), balance in prop::sample::select(&BALANCES[..])) {
            let expected = Oracle::new(&tree).imbalance(balance);
            prop_assert_eq!(tree.imbalance(balance).is_some(), expected.is_some());
            if let Some((larger, leaf)) = tree.imbalance(balance) {
                prop_assert!(tree.contains(larger) && tree.contains(leaf) && larger.size() > 2 * leaf.size());
            }
        }

        #[test]
        fn the_order_of_splits_depends_on_neither_history_nor_threads(tree in tree(8)) {
            let mut expected = None;
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads");
                let mut other: LinearOctree<u64> = tree.iter_z().map(|(leaf, &record)| (leaf, record)).collect();
                let mut order = Vec::new();
                pool.install(|| other.balance(Balance::Corners, |child, _| { order.push(child); 0 }));
                prop_assert_eq!(expected.get_or_insert_with(|| order.clone()), &order);
            }
        }
    }
}
