//! Regions of leaves that hang together across faces, with some leaves as walls: inside, outside and cavities of a body.

use super::LinearOctree;
use crate::grid::{Axis, Face};
use crate::sets::Sets;
use rayon::prelude::*;

/// Leaves looked at by one thread at a time.
const BATCH: usize = 1024;

impl<T> LinearOctree<T> {
    /// The region of each leaf that is no wall: leaves that share a piece of a face are in one. Region 0 is all that hangs together with a
    /// face beyond which there is nothing, on the boundary of the root or of a tree with holes: the outside. The others are cavities, 1,
    /// 2, ... by their first leaves in Z-order.
    ///
    /// A wall of leaves that meet at edges only holds: nothing leaks between two cells diagonally. O(n) probes, most of them on all threads,
    /// whose number does not matter to the result; 12 bytes a leaf beside the result while it runs.
    ///
    /// ```
    /// use zmend::grid::Key;
    /// use zmend::octree::LinearOctree;
    ///
    /// // A cell of level 3 and its 26 neighbours, which are a wall.
    /// let middle = Key::cell(3, [3; 3]).unwrap();
    /// let tree = LinearOctree::build(3, |_| true, |leaf| middle.neighbours().any(|beside| beside == leaf));
    /// let regions = tree.face_regions(|&is_wall| is_wall);
    /// assert_eq!((regions.get(middle), regions.locate([0; 3]).unwrap().1), (Some(&1), &0));
    /// ```
    pub fn face_regions(&self, is_wall: impl Fn(&T) -> bool) -> LinearOctree<u32>
    where
        T: Sync,
    {
        let mut numbers = LinearOctree::new();
        let open = self.iter_z().filter(|(_, record)| !is_wall(record));
        numbers.extend(open.map(|(leaf, _)| (leaf, 0)));
        let keys = numbers.keys_z();
        for (number, &leaf) in (1u32..).zip(&keys) {
            numbers.insert(leaf, number);
        }
        // Number 0 is the outside.
        let sets = Sets::new(keys.len() + 1);
        keys.par_iter().enumerate().with_min_len(BATCH).for_each(|(i, &leaf)| {
            let number = i as u32 + 1;
            for axis in Axis::ALL {
                for face in [Face::new(axis, false), Face::new(axis, true)] {
                    if self.neighbours(leaf, face).next().is_none() {
                        sets.union(0, number);
                    }
                    // Of two leaves the smaller joins, of two alike the one below.
                    let joins = |size: u32| size > leaf.size() || size == leaf.size() && face.is_high();
                    if let Some((_, &other)) =
                        numbers.neighbours(leaf, face).next().filter(|(other, _)| joins(other.size()))
                    {
                        sets.union(number, other);
                    }
                }
            }
        });
        // The root of a set is its least number, so the first of its leaves.
        let mut regions: Vec<u32> = vec![0];
        let mut count = 0;
        for (number, &leaf) in (1u32..).zip(&keys) {
            let root = sets.root(number);
            count += u32::from(root == number);
            let region = if root == number { count } else { regions[root as usize] };
            regions.push(region);
            numbers.insert(leaf, region);
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use crate::grid::Key;
    use crate::octree::oracle::{Oracle, tree};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn regions_are_what_spreads_from_leaf_to_leaf(tree in tree(5), salt: u64) {
            let is_wall = |record: &u64| (record ^ salt).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 62 == 0;
            let regions = tree.face_regions(is_wall);
            prop_assert_eq!(regions.validate(), Ok(()));
            let oracle = Oracle::new(&tree);
            let open: Vec<Key> = tree.iter_z().filter(|(_, r)| !is_wall(r)).map(|(leaf, _)| leaf).collect();
            prop_assert!(regions.iter_z().map(|(leaf, _)| leaf).eq(open.iter().copied()));
            // The least number spreads until nothing changes.
            let beside: Vec<Vec<Key>> = open.iter().map(|&leaf| {
                crate::grid::Face::ALL.into_iter().flat_map(|face| oracle.neighbours(leaf, face.into())).collect()
            }).collect();
            let at_end = |&leaf: &Key| crate::grid::Face::ALL.into_iter().any(|face| oracle.neighbours(leaf, face.into()).is_empty());
            let mut labels: Vec<usize> = open.iter().enumerate().map(|(i, leaf)| if at_end(leaf) { 0 } else { i + 1 }).collect();
            loop {
                let before = labels.clone();
                for (i, others) in beside.iter().enumerate() {
                    for other in others {
                        if let Ok(j) = open.binary_search(other) {
                            let least = labels[i].min(labels[j]);
                            (labels[i], labels[j]) = (least, least);
                        }
                    }
                }
                if labels == before {
                    break;
                }
            }
            let mut seen = vec![0];
            for (leaf, label) in open.iter().zip(labels) {
                let region = seen.iter().position(|&l| l == label).unwrap_or_else(|| { seen.push(label); seen.len() - 1 });
                prop_assert_eq!(regions.get(*leaf).copied(), Some(region as u32));
            }
        }
    }
}
