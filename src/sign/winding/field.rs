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
//! the coarser level's values, which are also its boundary values, and takes a fixed number of steps of relaxation. These have to do no
//! more than flatten what the coarser level could not see, and steps of Jacobi with the weights of Chebyshev do that to 2 percent in six.
//!
//! Far away, s is the field of a dipole: the sum of the patches' area vectors, at the middle of the patches.
//!
//! Cost: about 6 us a brick of each level, 4 KB a brick while a level is solved and 2 KB after that. Steps read the last step's values, bricks are
//! independent and sums have a fixed order: results do not depend on threads.

use super::sources::Sources;
use super::world;
use crate::error::Result;
use crate::grid::brick::Local;
use crate::grid::{Axis, Corner, Face, Key};
use crate::octree::LinearOctree;
use crate::progress::{Progress, check};
use glam::DVec3;
use rayon::prelude::*;

/// Values at the points of a brick.
pub(super) type Values = [f32; 512];

/// Levels up to this one cover the whole world: its brick at level 2 is the root.
const DENSE: u32 = 2;
/// Bricks with sources so near, in points, are solved as well.
const REACH: u32 = 2;
/// Steps of a round.
const STEPS: usize = 6;
/// Rounds on the coarsest level, which starts from nothing; on others, which are cheap; and on the two finest.
const ROUNDS: [usize; 3] = [20, 3, 1];
/// A round flattens all that has this or more of the steepness of what alternates from point to point, which has 2.
const FLATTENED: f64 = 0.3;

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

#[derive(Default)]
struct Level {
    /// Sorted.
    keys: Vec<Key>,
    index: LinearOctree<u32>,
    values: Vec<Values>,
}

impl Level {
    fn get(&self, key: Key) -> Option<&Values> {
        self.index.get(key).map(|&i| &self.values[i as usize])
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

/// Points of the coarser level a side round a brick: from one before its first to its last, and that of the brick after.
const COARSE: usize = 6;
/// Points a side of a brick and one more on either side.
const WIDE: usize = 10;
/// Values at such points.
type Wide = [f32; WIDE * WIDE * WIDE];

impl Field {
    /// The values in a finest brick of the world, if it was solved.
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
        let local = |p: [i64; 3]| Local::new(p[0] as u32, p[1] as u32, p[2] as u32);
        let brick = |level, p: [i64; 3]| world::brick(level, p.map(|c| c >> 3)).expect("the point lies in the world");
        for coarser in (0..=level).rev() {
            let shift = level - coarser;
            let below = point.map(|c| c >> shift);
            let Some(values) = self.levels.get(coarser as usize).and_then(|l| l.get(brick(coarser, below))) else {
                continue;
            };
            if shift == 0 {
                return values[local(below).index() as usize];
            }
            let part = point.map(|c| (c & ((1 << shift) - 1)) as f32 / (1u64 << shift) as f32);
            return Corner::ALL.into_iter().fold(0.0, |sum, corner| {
                let step: [i64; 3] = std::array::from_fn(|a| i64::from(corner.bits() >> (2 - a) & 1));
                let weight: f32 = (0..3).map(|a| if step[a] == 1 { part[a] } else { 1.0 - part[a] }).product();
                if weight == 0.0 {
                    sum
                } else {
                    sum + weight * self.at(coarser, std::array::from_fn(|a| below[a] + step[a]))
                }
            });
        }
        unreachable!("the coarsest levels cover the world")
    }

    /// The coarser level's values at the points round a brick.
    fn coarse(&self, key: Key) -> [f32; COARSE * COARSE * COARSE] {
        let level = world::level(key) - 1;
        let first = world::coords(key).map(|c| 4 * i64::from(c) - 1);
        // They lie in two bricks along each axis at most.
        let bricks: [Option<&Values>; 8] = std::array::from_fn(|n| {
            let at =
                std::array::from_fn(|a| (first[a] + if n >> (2 - a) & 1 == 1 { COARSE as i64 - 1 } else { 0 }) >> 3);
            world::brick(level, at).and_then(|key| self.levels[level as usize].get(key))
        });
        let mut out = [0.0; COARSE * COARSE * COARSE];
        for (n, out) in out.iter_mut().enumerate() {
            let step = [n / (COARSE * COARSE), n / COARSE % COARSE, n % COARSE];
            let point: [i64; 3] = std::array::from_fn(|a| first[a] + step[a] as i64);
            let which = (0..3).fold(0, |which, a| which << 1 | usize::from(point[a] >> 3 != first[a] >> 3));
            *out = match bricks[which] {
                Some(values) => values[Local::new(point[0] as u32, point[1] as u32, point[2] as u32).index() as usize],
                None => self.at(level, point),
            };
        }
        out
    }

    /// The bricks of a level that are solved: the needed ones, and those of the coarser level's children that are wanted.
    fn bricks(&self, level: u32, needed: &[Key], wanted: &(impl Fn(Key, [f32; 2]) -> bool + Sync)) -> Vec<Key> {
        let is_wanted = |key: Key| {
            let coarse = self.coarse(key);
            // Those at the brick itself: the first is a point before.
            let own = (0..COARSE.pow(3)).filter(|n| n / 36 > 0 && n / 6 % 6 > 0 && n % 6 > 0).map(|n| coarse[n]);
            let range = own.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
            wanted(key, range)
        };
        let parents = &self.levels[level as usize - 1].keys;
        let children = parents.par_iter().flat_map_iter(|parent| parent.children());
        let mut keys: Vec<Key> = children.filter(|&key| needed.binary_search(&key).is_ok() || is_wanted(key)).collect();
        keys.par_sort_unstable();
        keys
    }

    /// Solves one more level.
    fn add_level(&mut self, level: u32, keys: Vec<Key>, sources: &Sources, progress: &dyn Progress) -> Result<()> {
        let mut index = LinearOctree::with_capacity(keys.len());
        for (i, &key) in (0u32..).zip(&keys) {
            index.insert(key, i);
        }
        let started: Vec<(Values, Vec<(usize, Side)>)> =
            keys.par_iter().map(|&key| self.start(level, key, &index)).collect();
        let mut values = Vec::with_capacity(keys.len());
        let mut rims = Rims { sides: Vec::with_capacity(keys.len()), fixed: Vec::new() };
        for (key, (start, fixed)) in keys.iter().zip(started) {
            let mut sides = neighbours(*key).map(|next| next.and_then(|next| index.get(next)).map_or(FIXED, |&i| i));
            for (side, rim) in fixed {
                sides[side] = FIXED | rims.fixed.len() as u32;
                rims.fixed.push(rim);
            }
            rims.sides.push(sides);
            values.push(start);
        }
        let mut next = vec![[0.0; 512]; values.len()];
        let weights = weights();
        let rounds = if level == 0 { ROUNDS[0] } else { ROUNDS[if level + 1 < self.finest { 1 } else { 2 }] };
        for _ in 0..rounds {
            check(progress)?;
            for weight in weights {
                next.par_iter_mut().enumerate().for_each(|(i, out)| {
                    step(&rims.around(&values, i), sources.of(keys[i]), weight, out);
                });
                std::mem::swap(&mut values, &mut next);
            }
        }
        self.levels.push(Level { keys, index, values });
        Ok(())
    }

    /// First values of a brick, and the values beyond those of its sides where no brick is.
    fn start(&self, level: u32, key: Key, index: &LinearOctree<u32>) -> (Values, Vec<(usize, Side)>) {
        let wide: Wide = if level == 0 {
            std::array::from_fn(|n| {
                let point = [n / 100, n / 10 % 10, n % 10].map(|c| c as i64 - 1);
                if point.iter().all(|c| (0..8).contains(c)) { 0.0 } else { self.at(0, point) }
            })
        } else {
            refined(&self.coarse(key))
        };
        let values = std::array::from_fn(|n| wide[wide_index([n >> 6, n >> 3 & 7, n & 7].map(|c| c + 1))]);
        let open = (0..6).zip(neighbours(key)).filter(|(_, next)| next.is_none_or(|next| !index.contains(next)));
        (values, open.map(|(side, _)| (side, std::array::from_fn(|n| wide[wide_side(side, n)]))).collect())
    }
}

/// Values at the points beyond a side of a brick.
type Side = [f32; 64];

/// Where the values beyond the sides of the bricks of a level come from.
struct Rims {
    /// For each brick and side, in the order x low, x high, y low, ...: the brick there, or [`FIXED`] and the place of fixed values.
    sides: Vec<[u32; 6]>,
    fixed: Vec<Side>,
}

/// Marks places of fixed values.
const FIXED: u32 = 1 << 31;

impl Rims {
    /// The values of brick `i` and around it.
    fn around(&self, values: &[Values], i: usize) -> Wide {
        let mut wide = [0.0; WIDE * WIDE * WIDE];
        for (row, from) in values[i].as_chunks::<8>().0.iter().enumerate() {
            let at = wide_index([(row >> 3) + 1, (row & 7) + 1, 1]);
            wide[at..at + 8].copy_from_slice(from);
        }
        for (side, &from) in self.sides[i].iter().enumerate() {
            if from & FIXED == 0 {
                let next = &values[from as usize];
                (0..64).for_each(|n| wide[wide_side(side, n)] = next[own_side(side ^ 1, n)]);
            } else {
                let fixed = &self.fixed[(from ^ FIXED) as usize];
                (0..64).for_each(|n| wide[wide_side(side, n)] = fixed[n]);
            }
        }
        wide
    }
}

/// The bricks beside a brick, in the order of [`Rims::sides`].
fn neighbours(key: Key) -> [Option<Key>; 6] {
    std::array::from_fn(|side| key.neighbour(Face::new(Axis::ALL[side / 2], side % 2 == 1)))
}

const fn wide_index([x, y, z]: [usize; 3]) -> usize {
    (x * WIDE + y) * WIDE + z
}

/// Axes along and across a side.
const ACROSS: [[usize; 3]; 3] = [[0, 1, 2], [1, 0, 2], [2, 0, 1]];

/// Point `n` of a brick's side, as an index of its values.
#[inline]
fn own_side(side: usize, n: usize) -> usize {
    let [a, u, v] = ACROSS[side / 2];
    let stride = [64, 8, 1];
    stride[a] * (7 * (side & 1)) + stride[u] * (n >> 3) + stride[v] * (n & 7)
}

/// The point beyond it.
#[inline]
fn wide_side(side: usize, n: usize) -> usize {
    let [a, u, v] = ACROSS[side / 2];
    let stride = [WIDE * WIDE, WIDE, 1];
    stride[a] * (9 * (side & 1)) + stride[u] * ((n >> 3) + 1) + stride[v] * ((n & 7) + 1)
}

/// Linear interpolation, axis by axis.
fn refined(coarse: &[f32; COARSE * COARSE * COARSE]) -> Wide {
    // Of the fine points every other one is a coarse one, from the second on.
    let between = |i: usize, at: &dyn Fn(usize) -> f32| {
        if i % 2 == 1 { at(i.div_ceil(2)) } else { 0.5 * (at(i / 2) + at(i / 2 + 1)) }
    };
    let mut along_z = [0.0; COARSE * COARSE * WIDE];
    for (n, out) in along_z.iter_mut().enumerate() {
        *out = between(n % WIDE, &|z| coarse[n / WIDE * COARSE + z]);
    }
    let mut along_y = [0.0; COARSE * WIDE * WIDE];
    for (n, out) in along_y.iter_mut().enumerate() {
        let (x, y, z) = (n / (WIDE * WIDE), n / WIDE % WIDE, n % WIDE);
        *out = between(y, &|y| along_z[(x * COARSE + y) * WIDE + z]);
    }
    std::array::from_fn(|n| between(n / (WIDE * WIDE), &|x| along_y[x * WIDE * WIDE + n % (WIDE * WIDE)]))
}

/// The weights of the steps of a round: the reciprocals of the zeros of the Chebyshev polynomial on [[`FLATTENED`], 2].
fn weights() -> [f32; STEPS] {
    let (middle, half) = (0.5 * (2.0 + FLATTENED), 0.5 * (2.0 - FLATTENED));
    // Long and short steps in turn, so that nothing grows in between.
    [3, 2, 5, 0, 4, 1].map(|i| {
        let angle = std::f64::consts::PI * (f64::from(i) + 0.5) / STEPS as f64;
        (1.0 / (middle + half * angle.cos())) as f32
    })
}

/// One step of relaxation of a brick.
fn step(wide: &Wide, sources: &[(Local, f32)], weight: f32, out: &mut Values) {
    let (keep, share) = (1.0 - weight, weight / 6.0);
    for x in 0..8 {
        for y in 0..8 {
            let at = wide_index([x + 1, y + 1, 1]);
            let row = |at: usize| -> &[f32; 8] { wide[at..at + 8].first_chunk().expect("eight") };
            let (own, before, after) = (row(at), row(at - 1), row(at + 1));
            let (y_low, y_high, x_low, x_high) =
                (row(at - WIDE), row(at + WIDE), row(at - WIDE * WIDE), row(at + WIDE * WIDE));
            for z in 0..8 {
                let sum = (before[z] + after[z]) + (y_low[z] + y_high[z]) + (x_low[z] + x_high[z]);
                out[64 * x + 8 * y + z] = keep * own[z] + share * sum;
            }
        }
    }
    for &(local, strength) in sources {
        out[local.index() as usize] -= share * strength;
    }
}
