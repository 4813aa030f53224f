//! One point in each cell that the surface crosses: what dual contouring makes and SOG files hold.
//!
//! Points are in model units and in single precision, as the files have them, so that what was read is written again bit by bit.
//! [`StoredPoints`] costs 12 bytes a cell and 80 a brick.

use super::SignedOctree;
use super::segments::Segments;
use crate::grid::Key;
use crate::grid::brick::{Bits, Local, Plane};

/// A point in each mixed cell (one with corners of both signs) of an octree, made or looked up when asked for.
pub trait CellPoints: Sync {
    /// Appends the points of all mixed cells of some bricks, given by their numbers in ascending order: brick by brick, in the order
    /// of [`Local`].
    fn of_bricks(&self, octree: &SignedOctree, bricks: &[u32], points: &mut Vec<[f32; 3]>);
}

/// Points of cells, held in memory.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StoredPoints {
    bricks: Vec<StoredBrick>,
    points: Segments<[f32; 3], 12>,
}

#[derive(Debug, Clone, PartialEq)]
struct StoredBrick {
    key: Key,
    /// The cells that have a point.
    cells: Plane,
    /// Points of all bricks before.
    first: usize,
}

impl StoredPoints {
    /// Appends a brick with a point for each set bit of `cells`.
    ///
    /// # Panics
    /// When bricks do not come in ascending order, or the numbers do not agree.
    pub fn push(&mut self, key: Key, cells: Plane, points: &[[f32; 3]]) {
        assert!(self.bricks.last().is_none_or(|last| last.key < key), "bricks come in order");
        assert_eq!(cells.count() as usize, points.len(), "one point a cell");
        self.bricks.push(StoredBrick { key, cells, first: self.points.len() });
        self.points.extend_from_slice(points);
    }

    /// The same points in bricks of other names, which must come in the same order.
    pub(crate) fn renamed(mut self, name: impl Fn(Key) -> Key) -> Self {
        self.bricks.iter_mut().for_each(|brick| brick.key = name(brick.key));
        debug_assert!(self.bricks.is_sorted_by(|a, b| a.key < b.key), "bricks stay in order");
        self
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.bricks.capacity() * size_of::<StoredBrick>() + self.points.allocated_bytes()
    }

    /// The points of a brick. Cost: a binary search.
    pub fn of_brick(&self, key: Key) -> Option<PointsOfBrick<'_>> {
        let i = self.bricks.binary_search_by_key(&key, |brick| brick.key).ok()?;
        Some(PointsOfBrick { brick: &self.bricks[i], points: &self.points })
    }
}

/// The points of the cells of one brick.
#[derive(Debug, Clone, Copy)]
pub struct PointsOfBrick<'a> {
    brick: &'a StoredBrick,
    points: &'a Segments<[f32; 3], 12>,
}

impl PointsOfBrick<'_> {
    /// The point of a cell, if it has one.
    #[inline]
    pub fn get(&self, cell: Local) -> Option<[f32; 3]> {
        let StoredBrick { cells, first, .. } = self.brick;
        cells.get(cell).then(|| self.points[first + cells.rank(cell) as usize])
    }

    /// The cells that have a point.
    pub(crate) fn cells(&self) -> &Plane {
        &self.brick.cells
    }

    /// Calls `each` with the cells among those of `select`, a word of bits for each x, that have a point, and with the points.
    pub(crate) fn for_selected(&self, select: impl Fn(usize) -> u64, mut each: impl FnMut(Local, [f32; 3])) {
        let mut before = self.brick.first;
        for (x, &word) in self.brick.cells.0.iter().enumerate() {
            for b in Bits(word & select(x)) {
                let below = (word & ((1 << b) - 1)).count_ones();
                each(Local::from_index(x as u32 * 64 + b), self.points[before + below as usize]);
            }
            before += word.count_ones() as usize;
        }
    }
}

impl<P: CellPoints> CellPoints for &P {
    fn of_bricks(&self, octree: &SignedOctree, bricks: &[u32], points: &mut Vec<[f32; 3]>) {
        (**self).of_bricks(octree, bricks, points);
    }
}

impl CellPoints for StoredPoints {
    /// # Panics
    /// When a mixed cell has no point, as when the points are those of another octree.
    fn of_bricks(&self, octree: &SignedOctree, bricks: &[u32], points: &mut Vec<[f32; 3]>) {
        for &i in bricks {
            let mixed = octree.mixed_cells(i as usize);
            let stored = self.of_brick(octree.crossings().bricks()[i as usize].key);
            let point = |cell| stored.and_then(|stored| stored.get(cell)).expect("every mixed cell has a point");
            points.extend(mixed.iter().map(point));
        }
    }
}
