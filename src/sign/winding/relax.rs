//! Relaxation of a level of bricks.
//!
//! A step replaces the value at each point by a weighted mean of itself and of what its six neighbours and its source say (Jacobi). Weights are
//! the reciprocals of the zeros of a Chebyshev polynomial, so that a round of six steps flattens to 2 percent all that a coarser level
//! cannot see. The 8^3 values of a brick and those beyond its sides are gathered in a block of 10^3; then a step is ten operations on
//! rows of eight.

use crate::grid::brick::Local;
use crate::grid::{Axis, Corner, Face, Key};
use crate::octree::LinearOctree;
use rayon::prelude::*;

/// Values at the points of a brick, in units of 1 / [`UNIT`].
pub(super) type Values = [i16; 512];
/// Values at the points beyond a side of a brick, in the order of the other two coordinates.
pub(super) type Side = [i16; 64];
/// Values are up to 16, to 1/2048.
pub(super) const UNIT: f32 = 2048.0;

/// Steps of a round.
const STEPS: usize = 6;
/// A round flattens all that has this or more of the steepness of what alternates from point to point, which has 2.
const FLATTENED: f64 = 0.3;

/// The weights of the steps of a round.
pub(super) fn weights() -> [f32; STEPS] {
    let (middle, half) = (0.5 * (2.0 + FLATTENED), 0.5 * (2.0 - FLATTENED));
    // Long and short steps in turn, so that nothing grows in between.
    [3, 2, 5, 0, 4, 1].map(|i| {
        let angle = std::f64::consts::PI * (f64::from(i) + 0.5) / STEPS as f64;
        (1.0 / (middle + half * angle.cos())) as f32
    })
}

/// Rounds of a level: many on the coarsest, which starts from nothing; some on others, which cost little; one on the two finest.
pub(super) fn rounds(level: u32, finest: u32) -> usize {
    match level {
        0 => 20,
        _ if level + 1 < finest => 3,
        _ => 1,
    }
}

/// The nearest value that can be stored. Adding 3 * 2^22 leaves the whole number in the lowest bits.
#[inline]
pub(super) fn store(value: f32) -> i16 {
    (value.clamp(-32767.0, 32767.0) + 12_582_912.0).to_bits() as i16
}

/// Points of a block a side.
const WIDE: usize = 10;
/// Steps in a block along x, y, z.
const STRIDE: [usize; 3] = [WIDE * WIDE, WIDE, 1];

/// Values of a brick and beyond its sides, in units.
pub(super) struct Block(Box<[f32; WIDE * WIDE * WIDE]>);

/// Where row (x, y) of a brick's values begins in a block.
#[inline]
const fn row(x: usize, y: usize) -> usize {
    (x + 1) * STRIDE[0] + (y + 1) * STRIDE[1] + 1
}

impl Block {
    pub(super) fn new() -> Self {
        Block(Box::new([0.0; WIDE * WIDE * WIDE]))
    }

    #[inline]
    fn at(&self, at: usize) -> &[f32; 8] {
        self.0[at..at + 8].first_chunk().expect("eight")
    }

    #[inline]
    fn set(&mut self, at: usize, values: &[i16]) {
        let to: &mut [f32; 8] = self.0[at..at + 8].first_chunk_mut().expect("eight");
        let from: &[i16; 8] = values.first_chunk().expect("eight");
        *to = from.map(f32::from);
    }

    /// One step of relaxation.
    pub(super) fn step(&self, sources: &[(Local, f32)], weight: f32, out: &mut Values) {
        let (keep, share) = (1.0 - weight, weight / 6.0);
        for (n, out) in out.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            let at = row(n >> 3, n & 7);
            let (own, before, after) = (self.at(at), self.at(at - 1), self.at(at + 1));
            let (low_y, high_y) = (self.at(at - STRIDE[1]), self.at(at + STRIDE[1]));
            let (low_x, high_x) = (self.at(at - STRIDE[0]), self.at(at + STRIDE[0]));
            *out = std::array::from_fn(|z| {
                let sum = (before[z] + after[z]) + (low_y[z] + high_y[z]) + (low_x[z] + high_x[z]);
                store(keep * own[z] + share * sum)
            });
        }
        for &(local, strength) in sources {
            let value = &mut out[local.index() as usize];
            *value = value.saturating_sub(store(UNIT * share * strength));
        }
    }

    /// The values of the brick.
    pub(super) fn store(&self, out: &mut Values) {
        for (n, out) in out.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            *out = self.at(row(n >> 3, n & 7)).map(store);
        }
    }

    /// The values beyond a side.
    pub(super) fn store_side(&self, side: usize, out: &mut Side) {
        let [a, u, v] = ACROSS[side / 2].map(|axis| STRIDE[axis]);
        let first = a * (9 * (side & 1)) + u + v;
        for (n, out) in out.iter_mut().enumerate() {
            *out = store(self.0[first + u * (n >> 3) + v * (n & 7)]);
        }
    }

    /// Gives values to the edges and corners, which steps do not need, but [`refined`](Self::refined) does: linearly from those beside.
    pub(super) fn fill_corners(&mut self) {
        let ends = [(0, 1), (9, 8)];
        for [a, b, c] in [[0, 1, 2], [0, 2, 1], [1, 2, 0]].map(|axes| axes.map(|axis| STRIDE[axis])) {
            for ((i, next_i), (j, next_j)) in ends.into_iter().flat_map(|i| ends.map(|j| (i, j))) {
                (1..9).for_each(|k| self.extend(k * c, [i * a, next_i * a], [j * b, next_j * b]));
            }
        }
        for ((i, next_i), (j, next_j)) in ends.into_iter().flat_map(|i| ends.map(|j| (i, j))) {
            for k in [0, 9] {
                self.extend(k, [i * STRIDE[0], next_i * STRIDE[0]], [j * STRIDE[1], next_j * STRIDE[1]]);
            }
        }
    }

    /// The value at an end of two axes, from those one step before on either or both.
    fn extend(&mut self, at: usize, [i, next_i]: [usize; 2], [j, next_j]: [usize; 2]) {
        self.0[at + i + j] = self.0[at + next_i + j] + self.0[at + i + next_j] - self.0[at + next_i + next_j];
    }

    /// Makes this the block of a child of a block, by linear interpolation axis by axis.
    pub(super) fn refined(&mut self, coarse: &Block, child: Corner) {
        // Of the fine points every other one is a coarse one, from the second on.
        let mean = |i: usize, at: &dyn Fn(usize) -> f32| {
            if i % 2 == 1 { at(i.div_ceil(2)) } else { 0.5 * (at(i / 2) + at(i / 2 + 1)) }
        };
        let first: usize = (0..3).map(|a| 4 * STRIDE[a] * usize::from(child.is_high(Axis::ALL[a]))).sum();
        let mut along_z = [[[0.0; WIDE]; COARSE]; COARSE];
        for (x, along_z) in along_z.iter_mut().enumerate() {
            for (y, out) in along_z.iter_mut().enumerate() {
                let from = &coarse.0[first + x * STRIDE[0] + y * STRIDE[1]..][..COARSE];
                *out = std::array::from_fn(|z| mean(z, &|z| from[z]));
            }
        }
        let mut along_y = [[[0.0; WIDE]; WIDE]; COARSE];
        for (from, out) in along_z.iter().zip(&mut along_y) {
            *out = std::array::from_fn(|y| std::array::from_fn(|z| mean(y, &|y| from[y][z])));
        }
        for (n, out) in self.0.as_chunks_mut::<WIDE>().0.iter_mut().enumerate() {
            let (x, y) = (n / WIDE, n % WIDE);
            *out = std::array::from_fn(|z| mean(x, &|x| along_y[x][y][z]));
        }
    }
}

/// Points a side of a coarse block that a child needs.
const COARSE: usize = 6;
/// For each axis: itself, and the other two.
const ACROSS: [[usize; 3]; 3] = [[0, 1, 2], [1, 0, 2], [2, 0, 1]];

/// The bricks of a level.
pub(super) struct Grid {
    pub(super) values: Vec<Values>,
    /// For each brick and side, in the order x low, x high, y low, ...: the brick there, or [`OPEN`] and the place in `fixed`. Open sides
    /// are numbered in this order.
    pub(super) sides: Vec<[u32; 6]>,
    /// The values beyond open sides. They stay.
    pub(super) fixed: Vec<Side>,
}

/// Marks sides where no brick is.
const OPEN: u32 = 1 << 31;

impl Grid {
    /// Bricks without values.
    pub(super) fn new(keys: &[Key], index: &LinearOctree<u32>) -> Self {
        let side = |key: Key, side: usize| {
            let next = key.neighbour(Face::new(Axis::ALL[side / 2], side % 2 == 1));
            next.and_then(|next| index.get(next)).map_or(OPEN, |&i| i)
        };
        let mut sides: Vec<[u32; 6]> = keys.par_iter().map(|&key| std::array::from_fn(|n| side(key, n))).collect();
        let mut open = 0;
        for side in sides.iter_mut().flatten().filter(|side| **side == OPEN) {
            *side |= open;
            open += 1;
        }
        Grid { values: vec![[0; 512]; keys.len()], sides, fixed: vec![[0; 64]; open as usize] }
    }

    /// Whether no brick is on a side.
    pub(super) fn is_open(side: u32) -> bool {
        side & OPEN != 0
    }

    /// The values of brick `i` and beyond its sides.
    pub(super) fn gather(&self, i: usize, block: &mut Block) {
        for (n, from) in self.values[i].as_chunks::<8>().0.iter().enumerate() {
            block.set(row(n >> 3, n & 7), from);
        }
        for (side, &from) in self.sides[i].iter().enumerate() {
            if Grid::is_open(from) {
                let values = &self.fixed[(from ^ OPEN) as usize];
                block.set_side(side, |n| 8 * n, |n| n, values);
            } else {
                // The layer of the neighbour's that touches this brick.
                let values = &self.values[from as usize];
                let near = side % 2 == 1;
                match side / 2 {
                    0 => block.set_side(side, |n| if near { 8 * n } else { 448 + 8 * n }, |n| n, values),
                    1 => block.set_side(side, |n| if near { 64 * n } else { 56 + 64 * n }, |n| n, values),
                    _ => block.set_side(side, |_| 0, |n| if near { 8 * n } else { 8 * n + 7 }, values),
                }
            }
        }
    }
}

impl Block {
    /// Sets the values beyond a side: of x and y by rows of eight, which start where `rows` says, of z one by one.
    #[inline]
    fn set_side(
        &mut self,
        side: usize,
        rows: impl Fn(usize) -> usize,
        points: impl Fn(usize) -> usize,
        values: &[i16],
    ) {
        let high = side % 2;
        match side / 2 {
            0 => (0..8).for_each(|y| self.set(9 * high * STRIDE[0] + (y + 1) * STRIDE[1] + 1, &values[rows(y)..])),
            1 => (0..8).for_each(|x| self.set((x + 1) * STRIDE[0] + 9 * high * STRIDE[1] + 1, &values[rows(x)..])),
            _ => (0..64).for_each(|n| self.0[row(n >> 3, n & 7) - 1 + 9 * high] = f32::from(values[points(n)])),
        }
    }

    /// The point beyond a side of a brick, from its first point.
    pub(super) fn beyond(side: usize, n: usize) -> [i64; 3] {
        let [a, u, v] = ACROSS[side / 2];
        let mut point = [0; 3];
        (point[a], point[u], point[v]) = (if side % 2 == 1 { 8 } else { -1 }, n as i64 >> 3, n as i64 & 7);
        point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is linear stays as it is, in every way that values take.
    #[test]
    fn linear_functions_are_kept() {
        let keys: Vec<Key> = Key::ROOT.children().into_iter().flat_map(Key::children).collect();
        let mut index = LinearOctree::new();
        (0u32..).zip(&keys).for_each(|(i, &key)| {
            index.insert(key, i);
        });
        let linear = |p: [i64; 3]| (20 * p[0] - 14 * p[1] + 6 * p[2]) as f32;
        let first = |key: Key| key.min_corner().map(|c| i64::from(c / (crate::grid::key::SIDE >> 5)));
        let mut grid = Grid::new(&keys, &index);
        for (i, &key) in keys.iter().enumerate() {
            let [x, y, z] = first(key);
            let at = |p: [i64; 3]| store(linear([x + p[0], y + p[1], z + p[2]]));
            grid.values[i] = std::array::from_fn(|n| at([n as i64 >> 6, n as i64 >> 3 & 7, n as i64 & 7]));
            for (side, place) in grid.sides[i].into_iter().enumerate().filter(|(_, side)| Grid::is_open(*side)) {
                grid.fixed[(place ^ OPEN) as usize] = std::array::from_fn(|n| at(Block::beyond(side, n)));
            }
        }
        assert_eq!(grid.fixed.len(), 6 * 16);
        let (mut block, mut child) = (Block::new(), Block::new());
        for (i, &key) in keys.iter().enumerate() {
            grid.gather(i, &mut block);
            let mut out = [0; 512];
            for weight in weights() {
                block.step(&[], weight, &mut out);
                assert_eq!(out, grid.values[i], "brick {i}");
            }
            block.step(&[(Local::new(1, 2, 3), 0.75)], 0.8, &mut out);
            let at = Local::new(1, 2, 3).index() as usize;
            assert_eq!(i32::from(out[at]), i32::from(grid.values[i][at]) - (0.1 * UNIT).round() as i32);
            block.fill_corners();
            for corner in Corner::ALL {
                child.refined(&block, corner);
                let [x, y, z] = first(key).map(|c| 2 * c);
                let by = |axis| 8 * i64::from(corner.is_high(axis));
                let start = [x + by(Axis::X), y + by(Axis::Y), z + by(Axis::Z)];
                for (n, &value) in child.0.iter().enumerate() {
                    let p = [n / 100, n / 10 % 10, n % 10].map(|c| c as i64 - 1);
                    let expected = 0.5 * linear(std::array::from_fn(|a| start[a] + p[a]));
                    assert!((value - expected).abs() < 1e-2, "{key} {corner:?} {p:?}: {value}, not {expected}");
                }
                let mut values = [0; 512];
                child.store(&mut values);
                assert_eq!(f32::from(values[0]), 0.5 * linear(start));
                let mut side = [0; 64];
                child.store_side(3, &mut side);
                let p = Block::beyond(3, 10);
                assert_eq!(f32::from(side[10]), 0.5 * linear(std::array::from_fn(|a| start[a] + p[a])));
            }
        }
    }
}
