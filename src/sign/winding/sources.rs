//! What the smooth part of the winding number springs from, on every level of the grid.

use super::world;
use crate::grid::brick::Local;
use crate::grid::{Axis, Direction, Key};
use crate::octree::LinearOctree;
use rayon::prelude::*;
use std::ops::Range;

/// A source at a lattice point: for each axis, the jump along the edge that goes up from it less that along the edge that comes from below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Source {
    pub(super) at: Local,
    pub(super) along: [f32; 3],
}

impl Source {
    /// What the six neighbours are to be higher, taken together.
    pub(super) fn strength(&self) -> f32 {
        self.along[0] + self.along[1] + self.along[2]
    }
}

/// Sources of one level: few a brick.
#[derive(Debug)]
pub(super) struct Sources {
    /// The bricks that have any, sorted.
    pub(super) keys: Vec<Key>,
    /// Where those of each brick begin, and the end.
    firsts: Vec<u32>,
    items: Vec<Source>,
    index: LinearOctree<u32>,
}

impl Sources {
    /// From points, axes and differences of jumps there, which are added up where they coincide.
    pub(super) fn new(mut points: Vec<(Key, Local, Axis, i32)>) -> Sources {
        points.par_sort_unstable();
        let mut bricks: Vec<(Key, Vec<Source>)> = Vec::new();
        for same in points.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (key, at, ..) = same[0];
            let mut along = [0.0; 3];
            same.iter().for_each(|&(_, _, axis, jump)| along[axis.index()] += jump as f32);
            match bricks.last_mut() {
                Some((last, list)) if *last == key => list.push(Source { at, along }),
                _ => bricks.push((key, vec![Source { at, along }])),
            }
        }
        Sources::of_bricks(bricks)
    }

    fn of_bricks(bricks: Vec<(Key, Vec<Source>)>) -> Sources {
        let mut made = Sources { keys: Vec::new(), firsts: vec![0], items: Vec::new(), index: LinearOctree::new() };
        for (key, mut items) in bricks {
            items.retain(|item| item.along != [0.0; 3]);
            if items.is_empty() {
                continue;
            }
            made.index.insert(key, made.keys.len() as u32);
            made.keys.push(key);
            made.items.extend(items);
            made.firsts.push(made.items.len() as u32);
        }
        made
    }

    /// Those in a brick, sorted by position.
    pub(super) fn of(&self, brick: Key) -> &[Source] {
        self.index.get(brick).map_or(&[], |&i| &self.items[self.range(i as usize)])
    }

    fn range(&self, i: usize) -> Range<usize> {
        self.firsts[i] as usize..self.firsts[i + 1] as usize
    }

    /// The bricks with sources at most so many points from them, sorted; with those that have them.
    pub(super) fn reach(&self, points: u32) -> Vec<Key> {
        let near = |i: usize| {
            let mut directions = vec![[0; 3]];
            for source in &self.items[self.range(i)] {
                let step = source.at.coords().map(|c| if c < points { -1 } else { i32::from(c >= 8 - points) });
                // All bricks that the point is near to: by face, edge and corner.
                for mask in 1..8 {
                    let part: [i32; 3] = std::array::from_fn(|a| if mask >> a & 1 == 1 { step[a] } else { 0 });
                    if !directions.contains(&part) {
                        directions.push(part);
                    }
                }
            }
            let key = self.keys[i];
            directions.into_iter().filter_map(move |steps| match Direction::from_steps(steps) {
                Some(direction) => key.toward(direction),
                None => Some(key),
            })
        };
        let mut keys: Vec<Key> = (0..self.keys.len()).into_par_iter().flat_map_iter(near).collect();
        keys.par_sort_unstable();
        keys.dedup();
        keys
    }

    /// The same sources as the next coarser lattice sees them: full weighting across the axis of a jump; along it, weights of four points, which
    /// keep the place of the jump within its edge as well (its second moment). With two, sheets would move by half a coarse cell.
    pub(super) fn restricted(&self) -> Sources {
        // A point adds to coarse points up to three points before and after it.
        let mut keys: Vec<Key> = Vec::new();
        for &key in &self.keys {
            let fine = world::coords(key).map(i64::from);
            for n in 0..8 {
                let coarse = std::array::from_fn(|a| (fine[a] + if n >> a & 1 == 1 { 1 } else { -1 }) >> 1);
                keys.extend(world::brick(world::level(key) - 1, coarse));
            }
        }
        keys.par_sort_unstable();
        keys.dedup();
        let restrict = |&key: &Key| {
            let mut sums = [[0f32; 3]; 512];
            let corner = world::coords(key).map(|c| 2 * i64::from(c));
            for n in 0..64 {
                let by = [n / 16, n / 4 % 4, n % 4].map(|c| c - 1);
                let Some(fine) = world::brick(world::level(key) + 1, std::array::from_fn(|a| corner[a] + by[a])) else {
                    continue;
                };
                for source in self.of(fine) {
                    let c = source.at.coords();
                    let at = std::array::from_fn(|a| 8 * by[a] as i32 + c[a] as i32);
                    spread(&mut sums, at, source.along);
                }
            }
            let items = (0..512).map(Local::from_index).zip(sums).map(|(at, along)| Source { at, along });
            (key, items.filter(|item| item.along != [0.0; 3]).collect())
        };
        Sources::of_bricks(keys.par_iter().map(restrict).collect())
    }
}

/// Shares a source at a fine point among the coarse points around it, as far as these lie in the brick.
fn spread(sums: &mut [[f32; 3]; 512], at: [i32; 3], along: [f32; 3]) {
    for axis in (0..3).filter(|&axis| along[axis] != 0.0) {
        let weights = |a: usize| -> &[f32] {
            match (at[a] & 1, a == axis) {
                (0, _) => &[0.0, 1.0],
                (_, false) => &[0.0, 0.5, 0.5],
                (_, true) => &[-1.0 / 16.0, 9.0 / 16.0, 9.0 / 16.0, -1.0 / 16.0],
            }
        };
        // Weights start one coarse point before.
        let shares = |a: usize| {
            (0i32..).zip(weights(a)).map(move |(i, &w)| ((at[a] >> 1) - 1 + i, w)).filter(|(c, _)| (0..8).contains(c))
        };
        for (x, wx) in shares(0) {
            for (y, wy) in shares(1) {
                for (z, wz) in shares(2) {
                    sums[(x * 64 + y * 8 + z) as usize][axis] += 0.5 * wx * wy * wz * along[axis];
                }
            }
        }
    }
}
