//! Whole winding numbers along the rows of the grid: prefix sums in place of prefix parities, 64 lines at once.
//!
//! Where jumps have no circulation, the sum of the jumps along x from outside of the root is the winding number, up to what is smooth. The
//! numbers of 64 lines are held as bits: plane i has bit i of each number, in two's complement. Adding one to some lines is a carry that
//! runs up the planes and mostly ends at once.
//!
//! Cost: some 100 ns a brick, half of it for putting the bricks into rows.

use super::net::Net;
use crate::grid::Key;
use crate::grid::brick::{Local, Plane};
use rayon::prelude::*;

/// Numbers of 64 lines.
#[derive(Debug, Clone)]
pub(super) struct Counter {
    planes: [u64; 32],
    /// All planes from this one on are 0; 32 as soon as any number was negative.
    high: usize,
}

impl Counter {
    const ZERO: Counter = Counter { planes: [0; 32], high: 0 };

    fn add(&mut self, mut carry: u64) {
        let mut i = 0;
        while carry != 0 && i < 32 {
            let next = self.planes[i] & carry;
            self.planes[i] ^= carry;
            carry = next;
            i += 1;
        }
        self.high = self.high.max(i);
    }

    fn subtract(&mut self, mut borrow: u64) {
        let mut i = 0;
        while borrow != 0 && i < 32 {
            let next = !self.planes[i] & borrow;
            self.planes[i] ^= borrow;
            borrow = next;
            i += 1;
        }
        self.high = self.high.max(i);
    }

    /// The lines whose number is not 0.
    pub(super) fn nonzero(&self) -> u64 {
        self.planes[..self.high].iter().fold(0, |any, plane| any | plane)
    }

    /// The lines whose number is neither -1 nor 0 nor 1.
    fn beyond_one(&self) -> u64 {
        let [ones, rest @ ..] = &self.planes[..self.high] else { return 0 };
        let (any, all) = rest.iter().fold((0, *ones), |(any, all), plane| (any | plane, all & plane));
        any & !(if self.high == 32 { all } else { 0 })
    }

    /// The lines whose number is at least `least`.
    pub(super) fn at_least(&self, least: i32) -> u64 {
        if self.high < 32 && (least <= 0 || least >> self.high != 0) {
            return if least <= 0 { !0 } else { 0 };
        }
        let (mut greater, mut equal) = (0, !0);
        for i in (0..self.high).rev() {
            // In two's complement the highest bit counts the other way.
            let flip = if i == 31 { !0 } else { 0 };
            let (plane, bit) = (self.planes[i] ^ flip, if least >> i & 1 == 1 { !0 } else { 0 } ^ flip);
            greater |= equal & plane & !bit;
            equal &= !(plane ^ bit);
        }
        greater | equal
    }

    /// The numbers of all lines.
    pub(super) fn values(&self) -> [i32; 64] {
        let mut values = [0; 64];
        for (i, &plane) in self.planes[..self.high].iter().enumerate().filter(|(_, plane)| **plane != 0) {
            for (line, value) in values.iter_mut().enumerate() {
                *value |= ((plane >> line & 1) as i32) << i;
            }
        }
        values
    }

    /// The number of line 0.
    fn first(&self) -> i32 {
        self.planes[..self.high].iter().enumerate().fold(0, |value, (i, plane)| value | ((plane & 1) as i32) << i)
    }
}

/// The jumps along the x-edges of a brick.
#[derive(Debug, Default)]
pub(super) struct Steps {
    pub(super) rises: Plane,
    pub(super) falls: Plane,
    /// Further jumps, sorted by position.
    pub(super) more: Vec<(Local, i32)>,
}

impl Steps {
    pub(super) fn of(net: &Net) -> Steps {
        let more =
            net.steep.iter().filter(|(axis, ..)| axis.index() == 0).map(|&(_, local, jump)| (local, jump)).collect();
        Steps { rises: net.rises[0], falls: net.falls[0], more }
    }

    /// Turns all jumps round.
    pub(super) fn turn(&mut self) {
        std::mem::swap(&mut self.rises, &mut self.falls);
        self.more.iter_mut().for_each(|(_, jump)| *jump = -*jump);
    }

    /// Adds the jumps of another surface.
    pub(super) fn add(&mut self, other: Steps) {
        let (both_rise, both_fall) = (self.rises & other.rises, self.falls & other.falls);
        self.rises |= other.rises;
        self.falls |= other.falls;
        self.more.extend(other.more);
        self.more.extend(both_rise.iter().map(|local| (local, 1)));
        self.more.extend(both_fall.iter().map(|local| (local, -1)));
        self.more.sort_unstable();
    }
}

/// Bricks in rows along x.
pub(super) struct Rows {
    /// Row (y and z), then x, all in bricks; and the place of the brick in the list that was given.
    order: Vec<(u64, u32)>,
    /// For each of these, the number with which all lines go on where the next brick is missing. Valid after [`walk`](Self::walk).
    after: Vec<i32>,
}

impl Rows {
    /// Puts bricks into rows.
    pub(super) fn new(depth: u32, bricks: impl IndexedParallelIterator<Item = Key>) -> Rows {
        let code = |(i, key): (usize, Key)| (code(key, depth), i as u32);
        let mut order: Vec<(u64, u32)> = bricks.enumerate().map(code).collect();
        order.par_sort_unstable();
        Rows { after: vec![0; order.len()], order }
    }

    /// Walks along all rows. `steps` tells the jumps of a brick by its place, and `begin` what is made of its numbers. Results are in order
    /// of place.
    pub(super) fn walk<T: Send, L: Layer<T>>(
        &mut self,
        steps: impl Fn(usize) -> Steps + Sync,
        begin: impl Fn(usize) -> L + Sync,
    ) -> Vec<T> {
        let walked: Vec<(u32, i32, T)> = self
            .order
            .par_chunk_by(|a, b| a.0 >> 16 == b.0 >> 16)
            .flat_map_iter(|row| {
                let mut counter = Counter::ZERO;
                let (steps, begin) = (&steps, &begin);
                row.iter().map(move |&(_, place)| {
                    let Steps { rises, falls, more } = steps(place as usize);
                    let mut more = more.into_iter().peekable();
                    let mut layer = begin(place as usize);
                    for x in 0..8 {
                        layer.at(x, &counter);
                        counter.add(rises.0[x]);
                        counter.subtract(falls.0[x]);
                        while let Some((local, jump)) = more.next_if(|(local, _)| local.coords()[0] as usize == x) {
                            let line = 1 << (local.index() & 63);
                            (0..jump).for_each(|_| counter.add(line));
                            (jump..0).for_each(|_| counter.subtract(line));
                        }
                    }
                    (place, counter.first(), layer.end())
                })
            })
            .collect();
        self.after = walked.iter().map(|w| w.1).collect();
        let mut results: Vec<Option<T>> = Vec::new();
        results.resize_with(walked.len(), || None);
        for (place, _, result) in walked {
            results[place as usize] = Some(result);
        }
        results.into_iter().map(|result| result.expect("every brick is in a row")).collect()
    }

    /// The number at the points of a brick that was not given: one, as nothing jumps there. Cost: a binary search.
    pub(super) fn between(&self, brick: Key, depth: u32) -> i32 {
        let code = code(brick, depth);
        let next = self.order.partition_point(|&(c, _)| c < code);
        if next > 0 && self.order[next - 1].0 >> 16 == code >> 16 { self.after[next - 1] } else { 0 }
    }
}

/// What is made of the numbers of one brick.
pub(super) trait Layer<T> {
    /// The numbers at the points with this x, 0 to 7.
    fn at(&mut self, x: usize, counter: &Counter);
    /// After the last layer.
    fn end(self) -> T;
}

fn code(brick: Key, depth: u32) -> u64 {
    let [x, y, z] = crate::octree::crossings::lattice_point(depth, brick).map(|c| u64::from(c >> 3));
    (y << 16 | z) << 16 | x
}

/// The points whose winding number is not 0, and whether any is beyond 1 or -1.
#[derive(Default)]
pub(super) struct Nonzero {
    inside: Plane,
    beyond: u64,
}

impl Layer<(Plane, bool)> for Nonzero {
    fn at(&mut self, x: usize, counter: &Counter) {
        self.inside.0[x] = counter.nonzero();
        self.beyond |= counter.beyond_one();
    }

    fn end(self) -> (Plane, bool) {
        (self.inside, self.beyond != 0)
    }
}

/// Nothing but the numbers between bricks.
impl Layer<()> for () {
    fn at(&mut self, _: usize, _: &Counter) {}
    fn end(self) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::brick::Bits;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn counters_count(steps in prop::collection::vec((any::<u64>(), any::<u64>(), any::<u64>(), any::<bool>()), 0..40), least in -6i32..7) {
            let mut counter = Counter::ZERO;
            let mut plain = [0i32; 64];
            for (a, b, c, up) in steps {
                let lines = a & b & c;
                if up { counter.add(lines) } else { counter.subtract(lines) }
                Bits(lines).for_each(|line| plain[line as usize] += if up { 1 } else { -1 });
                let lines_with = |test: &dyn Fn(i32) -> bool| {
                    plain.iter().rev().fold(0u64, |word, &n| word << 1 | u64::from(test(n)))
                };
                prop_assert_eq!(counter.values(), plain);
                prop_assert_eq!(counter.nonzero(), lines_with(&|n| n != 0));
                prop_assert_eq!(counter.beyond_one(), lines_with(&|n| n.abs() > 1));
                prop_assert_eq!(counter.at_least(least), lines_with(&|n| n >= least));
                prop_assert_eq!(counter.first(), plain[0]);
            }
        }
    }
}
