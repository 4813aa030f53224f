//! What the smooth part of the winding number springs from, on every level of the grid.

use super::world;
use crate::grid::brick::Local;
use crate::grid::{Corner, Direction, Key};
use crate::octree::LinearOctree;
use rayon::prelude::*;
use std::ops::Range;

/// Sources at lattice points of one level: few a brick.
#[derive(Debug)]
pub(super) struct Sources {
    /// The bricks that have any, sorted.
    pub(super) keys: Vec<Key>,
    /// Where those of each brick begin, and the end.
    firsts: Vec<u32>,
    items: Vec<(Local, f32)>,
    index: LinearOctree<u32>,
}

impl Sources {
    /// From strengths at points, which are added up where they coincide.
    pub(super) fn new(mut points: Vec<(Key, Local, i32)>) -> Sources {
        points.par_sort_unstable();
        let mut bricks: Vec<(Key, Vec<(Local, f32)>)> = Vec::new();
        for same in points.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (key, local, _) = same[0];
            let sum: i32 = same.iter().map(|p| p.2).sum();
            match bricks.last_mut() {
                Some((last, list)) if *last == key => list.push((local, sum as f32)),
                _ => bricks.push((key, vec![(local, sum as f32)])),
            }
        }
        Sources::of_bricks(bricks)
    }

    fn of_bricks(bricks: Vec<(Key, Vec<(Local, f32)>)>) -> Sources {
        let mut made = Sources { keys: Vec::new(), firsts: vec![0], items: Vec::new(), index: LinearOctree::new() };
        for (key, mut items) in bricks {
            items.retain(|item| item.1 != 0.0);
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
    pub(super) fn of(&self, brick: Key) -> &[(Local, f32)] {
        self.index.get(brick).map_or(&[], |&i| &self.items[self.range(i as usize)])
    }

    fn range(&self, i: usize) -> Range<usize> {
        self.firsts[i] as usize..self.firsts[i + 1] as usize
    }

    /// The bricks with sources at most so many points from them, sorted; with those that have them.
    pub(super) fn reach(&self, points: u32) -> Vec<Key> {
        let near = |i: usize| {
            let mut directions = vec![[0; 3]];
            for (local, _) in &self.items[self.range(i)] {
                let step = local.coords().map(|c| if c < points { -1 } else { i32::from(c >= 8 - points) });
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

    /// The same sources as the next coarser lattice sees them: full weighting, which keeps their moments.
    pub(super) fn restricted(&self) -> Sources {
        // A point next to a coarse brick's low side adds to it as well: half of its strength is a point before.
        let mut keys: Vec<Key> = Vec::new();
        for &key in &self.keys {
            let [x, y, z] = world::coords(key);
            for step in 0..8 {
                let c = [x + (step >> 2), y + (step >> 1 & 1), z + (step & 1)].map(|c| c >> 1);
                keys.extend(world::brick(world::level(key) - 1, c.map(i64::from)));
            }
        }
        keys.par_sort_unstable();
        keys.dedup();
        let restrict = |&key: &Key| {
            let mut sums = [0f32; 512];
            let corner = world::coords(key).map(|c| 2 * i64::from(c));
            for n in 0..27 {
                let by = [n / 9, n / 3 % 3, n % 3].map(|c| c - 1);
                let Some(fine) = world::brick(world::level(key) + 1, std::array::from_fn(|a| corner[a] + by[a])) else {
                    continue;
                };
                for &(local, strength) in self.of(fine) {
                    let c = local.coords();
                    let at = std::array::from_fn(|a| 8 * by[a] as i32 + c[a] as i32);
                    spread(&mut sums, at, 0.5 * strength);
                }
            }
            let items = (0..512).map(Local::from_index).zip(sums).filter(|item| item.1 != 0.0).collect();
            (key, items)
        };
        Sources::of_bricks(keys.par_iter().map(restrict).collect())
    }
}

/// Shares a strength at a fine point among the coarse points around it, as far as these lie in the brick.
fn spread(sums: &mut [f32; 512], at: [i32; 3], strength: f32) {
    let odd = at.map(|c| c & 1);
    let weight = strength / (1 << odd.iter().sum::<i32>()) as f32;
    for corner in Corner::ALL {
        let step = [0, 1, 2].map(|a| i32::from(corner.bits()) >> (2 - a) & 1);
        if (0..3).any(|a| step[a] > odd[a]) {
            continue;
        }
        let c: [i32; 3] = std::array::from_fn(|a| (at[a] >> 1) + step[a]);
        if c.iter().all(|c| (0..8).contains(c)) {
            sums[(c[0] * 64 + c[1] * 8 + c[2]) as usize] += weight;
        }
    }
}
