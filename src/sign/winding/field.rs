//! The smooth part of the winding number, by relaxation from coarse to fine.
//!
//! Once patches have made the jumps d those of a closed surface, prefix sums give whole numbers p. The generalised winding number w has the
//! jumps of the input alone and is harmonic elsewhere: on the lattice, it is the w whose differences come nearest to the input's jumps, in
//! the sense of least squares (the projection of Hodge). So s = p - w solves a Poisson equation whose sources are the *patches*: at each
//! lattice point, the sum of s(y) - s(x) over its six neighbours y is the sum of the patches' jumps along the edges to them.
//!
//! There are no triangles in this, and nothing happens where there are no patches: a surface with few holes has few sources, however large
//! it is. Levels of the grid are solved one after the other (cascadic multigrid, Bornemann and Deuflhard 1996). A level consists of the
//! bricks of 8^3 points that have sources on it or near, or in which the final surface may run by what the coarser level says; it starts from
//! the coarser level's values, which are also its boundary values, and takes a fixed number of steps of relaxation
//! ([`relax`](super::relax)). Far away, s is the field of a dipole: the sum of the patches' area vectors, at the middle of the patches.
//!
//! Values are 16-bit numbers, in units of 1/2048: errors of relaxation are ten times as large.
//!
//! Cost: some 15,000 instructions a brick of each level; 2 KB a brick while a level is solved and 1 KB after that. Steps read the last step's
//! values, bricks are independent and sums have a fixed order: results do not depend on threads.

use super::relax::{Block, Grid, UNIT, Values, rounds, store, weights};
use super::sources::Sources;
use super::world;
use crate::error::Result;
use crate::grid::brick::Local;
use crate::grid::{Axis, Corner, Key};
use crate::octree::LinearOctree;
use crate::progress::{Progress, check};
use glam::DVec3;
use rayon::prelude::*;

/// Levels up to this one cover the whole world: its brick at level 2 is the root.
const DENSE: u32 = 2;
/// Bricks with sources so near, in points, are solved as well.
const REACH: u32 = 2;

/// The field far from its sources.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dipole {
    /// Sum of the area vectors, in finest cells squared.
    pub(super) area: DVec3,
    /// In finest cells, from the world's corner.
    pub(super) centre: DVec3,
}

impl Dipole {
    fn at(&self, point: DVec3) -> f32 {
        let r = point - self.centre;
        (self.area.dot(r) / (4.0 * std::f64::consts::PI * r.length().powi(3).max(1.0))) as f32
    }
}

/// Values on all levels.
pub(super) struct Field {
    levels: Vec<Level>,
    finest: u32,
    far: Dipole,
}

struct Level {
    /// Sorted.
    keys: Vec<Key>,
    index: LinearOctree<u32>,
    grid: Grid,
}

impl Level {
    fn get(&self, key: Key) -> Option<&Values> {
        self.index.get(key).map(|&i| &self.grid.values[i as usize])
    }
}

/// Solves for sources at points of the world's finest bricks. `wanted` says whether the final surface may run through a brick of the world
/// in which values are in a range.
///
/// # Errors
/// `Cancelled`.
pub(super) fn solve(
    depth: u32,
    points: Vec<(Key, Local, i32)>,
    far: Dipole,
    wanted: impl Fn(Key, [f32; 2]) -> bool + Sync,
    progress: &dyn Progress,
) -> Result<Field> {
    let finest = world::finest(depth);
    let mut sources = vec![Sources::new(points)];
    let mut needed = vec![sources[0].reach(REACH)];
    for _ in 0..finest {
        check(progress)?;
        let coarser = sources[sources.len() - 1].restricted();
        let mut keys = coarser.reach(REACH);
        keys.extend(needed[needed.len() - 1].iter().map(|key| key.parent().expect("not the world itself")));
        keys.par_sort_unstable();
        keys.dedup();
        sources.push(coarser);
        needed.push(keys);
    }
    let mut field = Field { levels: Vec::new(), finest, far };
    for (level, (sources, needed)) in (0..).zip(sources.iter().rev().zip(needed.iter().rev())) {
        check(progress)?;
        let keys = if level <= DENSE { all(level) } else { field.bricks(level, needed, &wanted) };
        field.add_level(level, keys, sources, progress)?;
    }
    Ok(field)
}

/// All bricks of a level.
fn all(level: u32) -> Vec<Key> {
    let side = 1u32 << level;
    let mut keys: Vec<Key> = (0..side.pow(3))
        .map(|n| Key::cell(level, [n >> (2 * level), n >> level & (side - 1), n & (side - 1)]).expect("in the world"))
        .collect();
    keys.sort_unstable();
    keys
}

impl Field {
    /// The values in a finest brick of the world, if it was solved, in units of 1 / [`UNIT`].
    pub(super) fn values(&self, brick: Key) -> Option<&Values> {
        self.levels[self.finest as usize].get(brick)
    }

    /// The finest bricks that were solved, sorted.
    pub(super) fn finest_bricks(&self) -> &[Key] {
        &self.levels[self.finest as usize].keys
    }

    /// The value at a lattice point of the root, in cells.
    pub(super) fn at_point(&self, depth: u32, point: [u32; 3]) -> f32 {
        self.at(self.finest, point.map(|c| (1 << depth) + i64::from(c)))
    }

    /// The value in the middle of a finest brick.
    pub(super) fn middle(&self, brick: Key) -> f32 {
        self.at(self.finest, world::coords(brick).map(|c| 8 * i64::from(c) + 4))
    }

    /// The value at a point of a level, by what the finest level that was solved there says.
    fn at(&self, level: u32, point: [i64; 3]) -> f32 {
        let side = 8 << level;
        if point.iter().any(|c| !(0..side).contains(c)) {
            let scale = (1u64 << (self.finest - level)) as f64;
            return self.far.at(DVec3::from(point.map(|c| c as f64 * scale)));
        }
        let brick = |level, p: [i64; 3]| world::brick(level, p.map(|c| c >> 3)).expect("the point lies in the world");
        for coarser in (0..=level).rev() {
            let shift = level - coarser;
            let below = point.map(|c| c >> shift);
            let Some(values) = self.levels[coarser as usize].get(brick(coarser, below)) else { continue };
            let local = |p: [i64; 3]| Local::new(p[0] as u32, p[1] as u32, p[2] as u32);
            let part = point.map(|c| (c & ((1 << shift) - 1)) as f32 / (1u64 << shift) as f32);
            return Corner::ALL.into_iter().fold(0.0, |sum, corner| {
                let step: [i64; 3] = std::array::from_fn(|a| i64::from(corner.bits() >> (2 - a) & 1));
                let weight: f32 = (0..3).map(|a| if step[a] == 1 { part[a] } else { 1.0 - part[a] }).product();
                let next: [i64; 3] = std::array::from_fn(|a| below[a] + step[a]);
                if weight == 0.0 {
                    sum
                } else if (0..3).all(|a| next[a] >> 3 == below[a] >> 3) {
                    sum + weight * f32::from(values[local(next).index() as usize]) / UNIT
                } else {
                    sum + weight * self.at(coarser, next)
                }
            });
        }
        unreachable!("the coarsest levels cover the world")
    }

    /// The bricks of a level that are solved: the needed ones, and those of the coarser level's children that are wanted.
    fn bricks(&self, level: u32, needed: &[Key], wanted: &(impl Fn(Key, [f32; 2]) -> bool + Sync)) -> Vec<Key> {
        let Level { keys, grid, .. } = &self.levels[level as usize - 1];
        let children = |(&parent, values): (&Key, &Values)| {
            // The range of the values in an eighth of the brick.
            let range = |corner: Corner| {
                let first =
                    [256, 32, 4].into_iter().zip(Axis::ALL).map(|(step, a)| step * usize::from(corner.is_high(a)));
                let first: usize = first.sum();
                let own = (0..64).map(|n| values[first + (n >> 4) * 64 + (n >> 2 & 3) * 8 + (n & 3)]);
                let [low, high] = own.fold([i16::MAX, i16::MIN], |[low, high], v| [low.min(v), high.max(v)]);
                [low, high].map(|v| f32::from(v) / UNIT)
            };
            let is_chosen = |corner: Corner| {
                let key = parent.child(corner);
                (needed.binary_search(&key).is_ok() || wanted(key, range(corner))).then_some(key)
            };
            Corner::ALL.into_iter().filter_map(is_chosen).collect::<Vec<Key>>()
        };
        let mut keys: Vec<Key> = keys.par_iter().zip(&grid.values).flat_map_iter(children).collect();
        keys.par_sort_unstable();
        keys
    }

    /// Solves one more level.
    fn add_level(&mut self, level: u32, keys: Vec<Key>, sources: &Sources, progress: &dyn Progress) -> Result<()> {
        let mut index = LinearOctree::with_capacity(keys.len());
        for (i, &key) in (0u32..).zip(&keys) {
            index.insert(key, i);
        }
        let mut grid = Grid::new(&keys, &index);
        self.start(level, &keys, &mut grid);
        let of_brick: Vec<&[(Local, f32)]> = keys.par_iter().map(|&key| sources.of(key)).collect();
        let mut next = vec![[0; 512]; keys.len()];
        for _ in 0..rounds(level, self.finest) {
            check(progress)?;
            for weight in weights() {
                next.par_iter_mut().enumerate().with_min_len(16).for_each_init(Block::new, |block, (i, out)| {
                    grid.gather(i, block);
                    block.step(of_brick[i], weight, out);
                });
                std::mem::swap(&mut grid.values, &mut next);
            }
        }
        self.levels.push(Level { keys, index, grid });
        Ok(())
    }

    /// First values of the bricks of a level, and those beyond their open sides, from the coarser level.
    fn start(&self, level: u32, keys: &[Key], grid: &mut Grid) {
        if level == 0 {
            // The world's own sides, in order.
            let far = |side, n| store(self.at(0, Block::beyond(side, n)) * UNIT);
            (0..6).for_each(|side| grid.fixed[side] = std::array::from_fn(|n| far(side, n)));
            return;
        }
        let Level { index, grid: coarser, .. } = &self.levels[level as usize - 1];
        // Children of one brick stand together, and so do their open sides.
        let (mut jobs, mut values, mut fixed, mut done) = (Vec::new(), &mut grid.values[..], &mut grid.fixed[..], 0);
        for family in keys.chunk_by(|a, b| a.parent() == b.parent()) {
            let sides = &grid.sides[done..done + family.len()];
            done += family.len();
            let open = sides.iter().flatten().filter(|&&side| Grid::is_open(side)).count();
            let (own_values, own_fixed);
            (own_values, values) = values.split_at_mut(family.len());
            (own_fixed, fixed) = fixed.split_at_mut(open);
            jobs.push((family, sides, own_values, own_fixed));
        }
        jobs.into_par_iter().with_min_len(4).for_each_init(
            || (Block::new(), Block::new()),
            |(coarse, fine), (family, sides, values, fixed)| {
                let parent = family[0].parent().expect("not the world itself");
                let i = *index.get(parent).expect("a brick is solved only if its parent is");
                coarser.gather(i as usize, coarse);
                coarse.fill_corners();
                let mut fixed = fixed.iter_mut();
                for ((key, sides), out) in family.iter().zip(sides).zip(values) {
                    fine.refined(coarse, key.corner_in_parent());
                    fine.store(out);
                    for (side, _) in sides.iter().enumerate().filter(|(_, side)| Grid::is_open(**side)) {
                        fine.store_side(side, fixed.next().expect("as many as open sides"));
                    }
                }
            },
        );
    }
}
