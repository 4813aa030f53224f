//! Sets of lattice points or cells, a plane a brick.

use super::{CellState, LinearOctree};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Face, Key};

/// Some of the points (or of the cells, each by its least corner) of a grid with 2^depth cells a side. Bricks without any are not held.
///
/// Cost: 64 bytes a brick and its entry in a hash map.
#[derive(Debug, Clone)]
pub(crate) struct PointSet {
    depth: u32,
    planes: LinearOctree<Plane>,
}

impl PointSet {
    /// The points of some bricks; of a brick that occurs several times, the last ones.
    pub(crate) fn new(depth: u32, bricks: impl IntoIterator<Item = (Key, Plane)>) -> Self {
        let planes = bricks.into_iter().filter(|(_, plane)| !plane.is_empty()).collect();
        PointSet { depth, planes }
    }

    /// How many bricks have points of the set.
    pub(crate) fn bricks(&self) -> usize {
        self.planes.len()
    }

    /// The bricks that have, in order.
    pub(crate) fn keys(&self) -> Vec<Key> {
        self.planes.keys_z()
    }

    /// Whether a cell of the brick's level or above has a point of the set in it. Two probes at most.
    pub(crate) fn any_in(&self, cell: Key) -> bool {
        !matches!(self.planes.state(cell), CellState::Absent)
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.planes.allocated_bytes()
    }

    /// Whether a point is in the set; none outside of the root is. Cost: a hash probe.
    pub(crate) fn contains(&self, at: [u32; 3]) -> bool {
        let key = Key::cell(self.depth - 3, at.map(|c| c >> 3));
        key.is_some_and(|key| self.plane(key).get(Local::new(at[0], at[1], at[2])))
    }

    /// The points of a brick that are in the set.
    pub(crate) fn plane(&self, brick: Key) -> Plane {
        self.planes.get(brick).copied().unwrap_or(Plane::EMPTY)
    }

    /// The points that are at most one step away along each axis. Cost: nine hash probes a brick.
    #[must_use]
    pub(crate) fn dilated(&self) -> Self {
        let mut set = self.clone();
        for axis in Axis::ALL {
            let beside = |key: Key, up| key.neighbour(Face::new(axis, up));
            let mut planes = LinearOctree::with_capacity(set.planes.len());
            let keys = set.planes.keys_z().into_iter();
            for key in keys.flat_map(|key| [Some(key), beside(key, false), beside(key, true)]).flatten() {
                if planes.contains(key) {
                    continue;
                }
                let at = |key: Option<Key>| key.map_or(Plane::EMPTY, |key| set.plane(key));
                let (here, below, above) = (set.plane(key), at(beside(key, false)), at(beside(key, true)));
                let all = here | here.at_plus(axis, &above) | here.at_minus(axis, &below);
                if !all.is_empty() {
                    planes.insert(key, all);
                }
            }
            set.planes = planes;
        }
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn dilating_adds_all_neighbours(points in prop::collection::vec(prop::array::uniform3(0u32..32), 0..40)) {
            let mut planes = std::collections::BTreeMap::new();
            for &[x, y, z] in &points {
                let key = Key::cell(2, [x >> 3, y >> 3, z >> 3]).expect("in the root");
                planes.entry(key).or_insert(Plane::EMPTY).set(Local::new(x, y, z));
            }
            let set = PointSet::new(5, planes);
            let dilated = set.dilated();
            for at in (0..32u32.pow(3)).map(|i| [i >> 10, i >> 5 & 31, i & 31]) {
                let distance = |p: &[u32; 3]| (0..3).map(|a| p[a].abs_diff(at[a])).max().expect("three axes");
                let nearest = points.iter().map(distance).min();
                prop_assert_eq!(set.contains(at), nearest == Some(0));
                prop_assert_eq!(dilated.contains(at), nearest.is_some_and(|d| d <= 1), "{:?}", at);
            }
            prop_assert!(!dilated.contains([32, 0, 0]));
        }
    }
}
