//! Closest points passed on from neighbour to neighbour.
//!
//! A lattice point near the surface has about the same closest point as its neighbours (Danielsson 1980). In each round, all bricks about
//! which something changed take what their 26 neighbours have at their sides, and then pass ways on within: in one sweep upward and one
//! downward, a row of eight points at once. Rounds read what the one before left, so threads make no difference.

use super::{BEYOND, BRICK_BYTES, Field, UNIT};
use crate::error::Result;
use crate::grid::brick::Plane;
use crate::grid::{Direction, Key};
use crate::octree::LinearOctree;
use crate::progress::{Progress, check};
use rayon::prelude::*;

/// A brick and one layer of points round it.
const SIDE: usize = 10;
/// From a point to the next one along x and y.
const STEP: [usize; 2] = [SIDE * SIDE, SIDE];
/// For a step down, none or up: the first point of a brick with its surroundings, the first point of the brick there, and how many.
const FROM: [(usize, usize, usize); 3] = [(0, 7, 1), (1, 0, 8), (9, 0, 1)];
/// A component of a way that is longer than any other, also after a few steps.
const FAR: f32 = 1e6;

/// Passes ways on as far as they are at most `reach` cells long. Bricks are sorted, before and after.
pub(super) fn spread(
    mut bricks: Vec<(Key, Box<Field>)>,
    reach: f64,
    progress: &dyn Progress,
) -> Result<Vec<(Key, Box<Field>)>> {
    let most = (reach * f64::from(UNIT)).powi(2) as f32;
    let mut index = LinearOctree::with_capacity(bricks.len());
    for (i, (key, _)) in (0u32..).zip(&bricks) {
        index.insert(*key, i);
    }
    // All points that have a way are new to their neighbours at first.
    let mut active: Vec<Key> =
        bricks.iter().flat_map(|(key, field)| changed_sides(*key, &set(field)).chain([*key])).collect();
    loop {
        active.par_sort_unstable();
        active.dedup();
        if active.is_empty() {
            break;
        }
        check(progress)?;
        // At worst, all of the active ones change.
        progress.hold(((bricks.len() + active.len()) * BRICK_BYTES) as u64)?;
        let look = |key: Key| index.get(key).map(|&i| &*bricks[i as usize].1);
        let changes: Result<Vec<(Key, Box<Field>, Plane)>> = active
            .par_iter()
            .map_init(Halo::boxed, |halo, &key| {
                check(progress)?;
                halo.fill(key, look);
                halo.sweep();
                let field = halo.field(most);
                let old = look(key);
                let changed = difference(&field, old.unwrap_or(&Field::EMPTY));
                Ok((!changed.is_empty()).then_some((key, field, changed)))
            })
            .filter_map(Result::transpose)
            .collect();
        active.clear();
        for (key, field, changed) in changes? {
            active.extend(changed_sides(key, &changed));
            if let Some(&i) = index.get(key) {
                bricks[i as usize].1 = field;
            } else {
                index.insert(key, bricks.len() as u32);
                bricks.push((key, field));
            }
        }
    }
    bricks.par_sort_unstable_by_key(|b| b.0);
    Ok(bricks)
}

/// The points of a brick that have a way.
fn set(field: &Field) -> Plane {
    difference(field, &Field::EMPTY)
}

/// The points whose ways differ.
fn difference(a: &Field, b: &Field) -> Plane {
    let mut plane = Plane::EMPTY;
    for i in 0..512 {
        plane.0[i >> 6] |= u64::from(a.way(i) != b.way(i)) << (i & 63);
    }
    plane
}

/// The bricks that touch a changed point at their sides.
fn changed_sides(key: Key, changed: &Plane) -> impl Iterator<Item = Key> + use<> {
    const ROW: [u64; 3] = [0xff, !0, 0xff << 56];
    const COLUMN: [u64; 3] = [0x0101_0101_0101_0101, !0, 0x8080_8080_8080_8080];
    let words = changed.0;
    Direction::ALL.into_iter().filter_map(move |direction| {
        let [x, y, z] = direction.steps().map(|s| (s + 1) as usize);
        let words = [&words[..1], &words[..], &words[7..]][x];
        let touched = words.iter().any(|word| word & ROW[y] & COLUMN[z] != 0);
        if touched { key.toward(direction) } else { None }
    })
}

/// The ways of a brick's points and of those round it, as numbers that several can be added of at once.
struct Halo([[f32; SIDE * SIDE * SIDE]; 3]);

impl Halo {
    fn boxed() -> Box<Self> {
        Box::new(Halo([[FAR; SIDE * SIDE * SIDE]; 3]))
    }

    /// Takes the ways of a brick and its neighbours.
    fn fill<'a>(&mut self, key: Key, look: impl Fn(Key) -> Option<&'a Field>) {
        self.0 = [[FAR; SIDE * SIDE * SIDE]; 3];
        let beside = Direction::ALL.into_iter().map(|d| (d.steps(), key.toward(d)));
        for (steps, key) in beside.chain([([0; 3], Some(key))]) {
            let Some(field) = key.and_then(&look) else { continue };
            let [(to_x, x, nx), (to_y, y, ny), (to_z, z, nz)] = steps.map(|s| FROM[(s + 1) as usize]);
            for (i, j) in (0..nx).flat_map(|i| (0..ny).map(move |j| (i, j))) {
                let to = (to_x + i) * STEP[0] + (to_y + j) * STEP[1] + to_z;
                let from = (x + i) * 64 + (y + j) * 8 + z;
                for axis in 0..3 {
                    for k in 0..nz {
                        if field.0[0][from + k] != BEYOND {
                            self.0[axis][to + k] = f32::from(field.0[axis][from + k]);
                        }
                    }
                }
            }
        }
    }

    /// Passes ways on upward, then downward.
    fn sweep(&mut self) {
        for (x, y) in (1..9).flat_map(|x| (1..9).map(move |y| (x, y))) {
            let row = x * STEP[0] + y * STEP[1];
            for (dx, dy) in [(-1, -1), (-1, 0), (-1, 1), (0, -1)] {
                self.take_row(row, dx, dy);
            }
            self.along_row(row);
        }
        for (x, y) in (1..9).rev().flat_map(|x| (1..9).rev().map(move |y| (x, y))) {
            let row = x * STEP[0] + y * STEP[1];
            for (dx, dy) in [(1, 1), (1, 0), (1, -1), (0, 1)] {
                self.take_row(row, dx, dy);
            }
            self.along_row(row);
        }
    }

    /// Offers the eight points of a row the closest points of a row beside it, straight and askew.
    #[inline]
    fn take_row(&mut self, row: usize, dx: i32, dy: i32) {
        let other = (row as i32 + dx * STEP[0] as i32 + dy * STEP[1] as i32) as usize;
        let (dx, dy) = (dx as f32 * UNIT, dy as f32 * UNIT);
        let [ways_x, ways_y, ways_z] = &mut self.0;
        let eight = |ways: &[f32], from: usize| -> [f32; 8] { ways[from..from + 8].try_into().expect("eight") };
        let [mut x, mut y, mut z] = [eight(ways_x, row + 1), eight(ways_y, row + 1), eight(ways_z, row + 1)];
        for (start, dz) in [(other, -UNIT), (other + 1, 0.0), (other + 2, UNIT)] {
            let [ox, oy, oz] = [eight(ways_x, start), eight(ways_y, start), eight(ways_z, start)];
            for k in 0..8 {
                let (cx, cy, cz) = (ox[k] + dx, oy[k] + dy, oz[k] + dz);
                let nearer = cx * cx + cy * cy + cz * cz < x[k] * x[k] + y[k] * y[k] + z[k] * z[k];
                x[k] = if nearer { cx } else { x[k] };
                y[k] = if nearer { cy } else { y[k] };
                z[k] = if nearer { cz } else { z[k] };
            }
        }
        ways_x[row + 1..row + 9].copy_from_slice(&x);
        ways_y[row + 1..row + 9].copy_from_slice(&y);
        ways_z[row + 1..row + 9].copy_from_slice(&z);
    }

    /// Passes ways on along a row, both ways.
    #[inline]
    fn along_row(&mut self, row: usize) {
        for k in 1..9 {
            self.take(row + k, row + k - 1, -UNIT);
        }
        for k in (1..9).rev() {
            self.take(row + k, row + k + 1, UNIT);
        }
    }

    #[inline]
    fn take(&mut self, to: usize, from: usize, dz: f32) {
        let [x, y, z] = &mut self.0;
        let (cx, cy, cz) = (x[from], y[from], z[from] + dz);
        if cx * cx + cy * cy + cz * cz < x[to] * x[to] + y[to] * y[to] + z[to] * z[to] {
            (x[to], y[to], z[to]) = (cx, cy, cz);
        }
    }

    /// The brick's own ways, as far as they are not too long.
    fn field(&self, most: f32) -> Box<Field> {
        let mut field = Box::new(Field::EMPTY);
        for i in 0..512 {
            let from = ((i >> 6) + 1) * STEP[0] + ((i >> 3 & 7) + 1) * STEP[1] + (i & 7) + 1;
            let way = [0, 1, 2].map(|axis| self.0[axis][from]);
            if way.iter().map(|w| w * w).sum::<f32>() <= most {
                (0..3).for_each(|axis| field.0[axis][i] = way[axis] as i16);
            }
        }
        field
    }
}
