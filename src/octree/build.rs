//! Trees built from the root down on all threads, and trees put together.

use super::locate::code_of;
use super::{Block, LinearOctree};
use crate::grid::block::Cells;
use crate::grid::brick::Bits;
use crate::grid::key::MAX_LEVEL;
use crate::grid::{Corner, Key};
use crate::parallel::in_order;
use crate::progress::Silent;
use hashbrown::hash_map::Entry;
use rayon::prelude::*;
use std::ops::Range;

/// Regions of this level and all below them are built by one thread each.
const TOP: u32 = 3;

/// A cell with leaves inside, and which of its children have.
struct Region {
    cell: Key,
    refined: u8,
}

/// Building.
impl<T: Send> LinearOctree<T> {
    /// The tree that covers the root, in which a cell above `max_level` (18 at most) is split where `split` says so. `record` makes the
    /// record of each leaf. Both are asked once for a cell, on any thread, in any order.
    ///
    /// O(n): a block is made at once, with one probe. Nothing but the tree is held, and few subtrees at a time beside it.
    ///
    /// ```
    /// use zmend::grid::Key;
    /// use zmend::octree::LinearOctree;
    ///
    /// // Fine at the origin.
    /// let tree = LinearOctree::build(18, |cell| cell.min_corner() == [0; 3], |leaf| leaf.size());
    /// assert_eq!((tree.len(), tree.locate([1; 3]).unwrap().1), (1 + 7 * 18, &2));
    /// ```
    pub fn build(max_level: u32, split: impl Fn(Key) -> bool + Sync, record: impl Fn(Key) -> T + Sync) -> Self {
        let max_level = max_level.min(MAX_LEVEL);
        let mut tree = LinearOctree::new();
        if max_level == 0 || !split(Key::ROOT) {
            tree.insert(Key::ROOT, record(Key::ROOT));
            return tree;
        }
        let grower = Grower { max_level, split: &split, record: &record };
        let (name, place) = Key::ROOT.block();
        tree.put_block(name, Block { refined: Cells::one(place), ..Block::EMPTY });
        let first = grower.block(Key::ROOT.child(Corner::MIN), Cells::of_level(1), &mut Vec::new());
        let mut regions = vec![Region { cell: Key::ROOT, refined: first.1.refined.byte(0) }];
        let mut blocks = vec![first];
        for _ in 0..TOP {
            let mut below = Vec::new();
            regions.into_iter().for_each(|region| grower.below(&mut blocks, &region, &mut Vec::new(), &mut below));
            regions = below;
        }
        let mut put = |blocks: Vec<(Key, Block<T>)>| {
            tree.blocks.reserve(blocks.len());
            blocks.into_iter().for_each(|(name, block)| tree.put_block(name, block));
            Ok(())
        };
        put(blocks)
            .and_then(|()| {
                let grow = |scratch: &mut Vec<T>, n: usize| {
                    let (mut blocks, mut waiting) = (Vec::new(), Vec::new());
                    grower.below(&mut blocks, &regions[n], scratch, &mut waiting);
                    while let Some(region) = waiting.pop() {
                        grower.below(&mut blocks, &region, scratch, &mut waiting);
                    }
                    blocks
                };
                in_order(regions.len(), &Silent, Vec::new, grow, put)
            })
            .expect("nothing fails or is cancelled");
        tree.look_ahead();
        tree
    }
}

/// What a tree is built by.
struct Grower<'a, S, R> {
    max_level: u32,
    split: &'a S,
    record: &'a R,
}

impl<S: Fn(Key) -> bool, R> Grower<'_, S, R> {
    /// Adds the block with the grandchildren of a region; lists those of its children that have refined children in turn.
    fn below<T>(
        &self,
        blocks: &mut Vec<(Key, Block<T>)>,
        region: &Region,
        scratch: &mut Vec<T>,
        regions: &mut Vec<Region>,
    ) where
        R: Fn(Key) -> T,
    {
        if region.refined == 0 {
            return;
        }
        let children = Bits(u64::from(region.refined));
        let cells = children.clone().fold(Cells::EMPTY, |cells, child| cells | Cells::family(8 * child));
        let (name, block) = self.block(region.cell.child(Corner::MIN).child(Corner::MIN), cells, scratch);
        let inside = children.map(|child| Region {
            cell: region.cell.child(Corner::ALL[child as usize]),
            refined: block.refined.byte(8 * child),
        });
        regions.extend(inside.filter(|inside| inside.refined != 0));
        blocks.push((name, block));
    }

    /// Some cells of a block, each split or a leaf. `scratch` is empty before and after.
    fn block<T>(&self, name: Key, cells: Cells, scratch: &mut Vec<T>) -> (Key, Block<T>)
    where
        R: Fn(Key) -> T,
    {
        if name.level() == Some(self.max_level) {
            let mut records = Vec::with_capacity(cells.count());
            records.extend(cells.places().map(|place| (self.record)(name.in_block(place))));
            return (name, Block { leaves: cells, refined: Cells::EMPTY, records });
        }
        let (mut leaves, mut refined) = (Cells::EMPTY, Cells::EMPTY);
        for place in cells.places() {
            let cell = name.in_block(place);
            if (self.split)(cell) {
                refined |= Cells::one(place);
            } else {
                leaves |= Cells::one(place);
                scratch.push((self.record)(cell));
            }
        }
        let mut records = Vec::with_capacity(scratch.len());
        records.append(scratch);
        (name, Block { leaves, refined, records })
    }
}

impl<T> LinearOctree<T> {
    /// Puts a block where none is.
    fn put_block(&mut self, name: Key, block: Block<T>) {
        self.levels.add(name, block.leaves.count());
        self.room += block.room();
        self.blocks.insert(name, block);
    }

    /// Takes over the leaves of another tree, without looking whether they overlap those of this one. Of a leaf that is in both, the
    /// record of the other stays. O(blocks) where the trees share none.
    pub fn append(&mut self, other: Self) {
        self.blocks.reserve(other.blocks.len());
        for (name, block) in other.blocks {
            match self.blocks.entry(name) {
                Entry::Vacant(slot) => {
                    self.levels.add(name, block.leaves.count());
                    self.room += block.room();
                    slot.insert(block);
                }
                Entry::Occupied(mut slot) => {
                    let own = slot.get_mut();
                    own.refined |= block.refined;
                    for (place, record) in block.leaves.places().zip(block.records) {
                        if own.leaves.has(place) {
                            own.records[own.leaves.rank(place)] = record;
                        } else {
                            self.room += own.add(place, record);
                            self.levels.add(name, 1);
                        }
                    }
                }
            }
        }
    }
}

/// Trees for points.
impl LinearOctree<Range<u32>> {
    /// The tree that covers the root with at most `most` lattice points a leaf, but for leaves of `max_level` and those whose points all
    /// coincide. Returns it with the order of the points along the curve: the record of a leaf is the range of its points there. Points
    /// with a coordinate above 2^19 are left out.
    ///
    /// Sorts 16 bytes a point on all threads, then O(n) bisections; a point is in the range of one leaf only.
    ///
    /// # Panics
    ///
    /// If there are 2^32 points or more.
    ///
    /// ```
    /// use zmend::octree::LinearOctree;
    ///
    /// let points = [[9, 9, 9], [500_000, 0, 0], [11, 9, 9], [9, 9, 9]];
    /// let (tree, order) = LinearOctree::of_points(&points, 2, 18);
    /// let (_, range) = tree.locate([9, 9, 9]).unwrap();
    /// assert_eq!(order[range.start as usize..range.end as usize], [0, 3]);
    /// ```
    pub fn of_points(points: &[[u32; 3]], most: usize, max_level: u32) -> (Self, Vec<u32>) {
        let count = u32::try_from(points.len()).expect("fewer than 2^32 points");
        let coded = (0..count).into_par_iter().filter_map(|i| Some((code_of(points[i as usize])?, i)));
        let mut coded: Vec<(u64, u32)> = coded.collect();
        coded.par_sort_unstable();
        let range = |cell: Key| {
            // The first code in the cell, and the first beyond it: a cell's bits below its own are all those there are.
            let first = cell.depth_first_rank() >> 5;
            let beyond = first + u64::from(cell.size()).pow(3);
            coded.partition_point(|&(code, _)| code < first)..coded.partition_point(|&(code, _)| code < beyond)
        };
        let split = |cell: Key| {
            let inside = &coded[range(cell)];
            inside.len() > most && inside.first().map(|p| p.0) != inside.last().map(|p| p.0)
        };
        let record = |leaf: Key| {
            let range = range(leaf);
            range.start as u32..range.end as u32
        };
        let tree = LinearOctree::build(max_level, split, record);
        (tree, coded.into_iter().map(|(_, i)| i).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::oracle::{points, tree};
    use proptest::prelude::*;

    /// A `Vec` of such records says that it has room for all there are, which once overflowed the sum over blocks.
    #[test]
    fn records_without_size_take_no_room() {
        let mut tree = LinearOctree::build(4, |_| true, |_| ());
        assert_eq!((tree.len(), tree.validate()), (4096, Ok(())));
        tree.append(LinearOctree::build(2, |_| true, |_| ()));
        tree.retain(|leaf, ()| leaf.level() == Some(4));
        tree.keys_z().into_iter().for_each(|leaf| tree.remove(leaf).unwrap_or_else(|| panic!("{leaf:?} is a leaf")));
        assert_eq!((tree.len(), tree.validate()), (0, Ok(())));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_tree_is_what_its_splits_say(points in points(5), max_level in 0..8u32) {
            let split = |cell: Key| points.iter().any(|&p| Key::point(p).is_some_and(|p| cell.contains(p)));
            let mut expected = LinearOctree::from_iter([(Key::ROOT, Key::ROOT.to_bits())]);
            while let Some(leaf) = expected.keys_z().into_iter().find(|&leaf| leaf.level() < Some(max_level) && split(leaf)) {
                expected.refine(leaf, crate::octree::Balance::Off, |child, _| child.to_bits()).expect("a leaf");
            }
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads");
                let tree = pool.install(|| LinearOctree::build(max_level, split, Key::to_bits));
                prop_assert_eq!(tree.validate(), Ok(()));
                prop_assert_eq!(&tree, &expected);
            }
        }

        #[test]
        fn appending_is_inserting(mut one in tree(7), other in tree(7)) {
            let mut expected = one.clone();
            expected.extend(other.iter().map(|(leaf, &record)| (leaf, record + 1)));
            let mut other = other;
            other.iter_mut().for_each(|(_, record)| *record += 1);
            one.append(other);
            prop_assert_eq!(&one, &expected);
            prop_assert_eq!(one.validate(), expected.validate());
            prop_assert_eq!(one.allocated_bytes() >= one.len() * 8, true);
        }
    }
}
