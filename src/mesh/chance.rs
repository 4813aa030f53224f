//! Numbers by chance, the same on every machine and run.

use glam::DVec3;

/// What the state grows by from number to number: 2^64 divided by the golden ratio.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// Steele, Lea and Flood 2014 ("splitmix64"): enough chance for samples, in three lines. It holds the seed.
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    /// The same sequence, so many numbers further on.
    pub(super) fn skip(self, numbers: u64) -> Self {
        Chance(self.0.wrapping_add(numbers.wrapping_mul(STEP)))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly spread over `0 .. 1`.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Where the sequence is, over `0 .. 1`: multiples of the golden ratio without their whole parts, of which any
    /// stretch is spread more evenly than chance would (Weyl 1916).
    pub(super) fn even(&self) -> f64 {
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Evenly spread over a cube around the origin.
    pub(super) fn within_cube(&mut self, half_side: f64) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()).map(|x| half_side * (2.0 * x - 1.0))
    }

    /// Whether something with this probability happens now.
    pub(super) fn happens(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spread() {
        let (mut chance, n) = (Chance(1), 10_000);
        let mut bins = [[0; 10]; 2];
        for _ in 0..n {
            let by_chance = chance.unit();
            [by_chance, chance.even()].iter().zip(&mut bins).for_each(|(x, bins)| bins[(10.0 * x) as usize] += 1);
        }
        let off = bins.map(|bins| bins.iter().map(|&n: &i32| (n - 1000).abs()).max().expect("ten"));
        assert!(off[0] < 120 && off[1] <= 3, "{bins:?}");
    }

    #[test]
    fn skipping_is_drawing_without_looking() {
        let mut slow = Chance(7);
        (0..1000).for_each(|_| _ = slow.unit());
        assert_eq!(Chance(7).skip(1000).unit(), slow.unit());
        assert_eq!(Chance(7).skip(1001).even(), slow.even());
    }
}
