//! Functions as volumes, and parts of volumes.

use super::{Level, Volume};
use crate::error::{Error, Result};
use crate::grid::Axis;
use glam::DVec3;

/// A function of the lattice point, asked anew each time.
#[derive(Debug, Clone, Copy)]
pub struct Samples<F> {
    size: [usize; 3],
    function: F,
}

impl<F: Fn([usize; 3]) -> f64 + Sync> Samples<F> {
    /// The samples `function(point)` for all lattice points below `size`.
    pub fn new(size: [usize; 3], function: F) -> Self {
        Samples { size, function }
    }
}

impl<F: Fn([usize; 3]) -> f64 + Sync> Volume for Samples<F> {
    fn size(&self) -> [usize; 3] {
        self.size
    }

    fn value(&self, at: [usize; 3]) -> f64 {
        (self.function)(at)
    }
}

/// A continuous function of the place, in lattice units. Where the surface cuts an edge is searched for, and gradients are taken right
/// there, so that sharp edges of the function come out sharp.
#[derive(Debug, Clone, Copy)]
pub struct LevelSet<F> {
    size: [usize; 3],
    function: F,
}

/// Steps of the search for a crossing: it halves the edge each time, so 2^-40 of it is left.
const HALVINGS: u32 = 40;
/// Half the distance of the two places from which a derivative is taken, in steps of the lattice. The function may be made from 32-bit
/// numbers of some hundred units: 1e-3 keeps their rounding (1e-5) small, and is far below what features are measured in.
const NEAR: f64 = 1e-3;

impl<F: Fn(DVec3) -> f64 + Sync> LevelSet<F> {
    /// The function `function(place)` on the lattice points below `size`.
    pub fn new(size: [usize; 3], function: F) -> Self {
        LevelSet { size, function }
    }
}

impl<F: Fn(DVec3) -> f64 + Sync> Volume for LevelSet<F> {
    fn size(&self) -> [usize; 3] {
        self.size
    }

    fn value(&self, at: [usize; 3]) -> f64 {
        (self.function)(DVec3::from(at.map(|c| c as f64)))
    }

    fn crossing(&self, at: [usize; 3], axis: Axis, level: Level) -> f64 {
        let start = DVec3::from(at.map(|c| c as f64));
        let starts_inside = level.holds((self.function)(start));
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let is_inside = level.holds((self.function)(start + middle * DVec3::AXES[axis.index()]));
            *if is_inside == starts_inside { &mut low } else { &mut high } = middle;
        }
        0.5 * (low + high)
    }

    fn gradient(&self, place: DVec3) -> DVec3 {
        let along = |axis: usize| {
            let step = NEAR * DVec3::AXES[axis];
            ((self.function)(place + step) - (self.function)(place - step)) / (2.0 * NEAR)
        };
        DVec3::new(along(0), along(1), along(2))
    }
}

/// A box cut out of a volume: its lattice point `first` is the part's `[0, 0, 0]`.
#[derive(Debug, Clone, Copy)]
pub struct Cropped<V> {
    volume: V,
    first: [usize; 3],
    size: [usize; 3],
}

impl<V: Volume> Cropped<V> {
    /// The lattice points of `volume` from `first` on, `size` of them along each axis.
    ///
    /// # Errors
    /// When the volume does not have them all.
    pub fn new(volume: V, first: [usize; 3], size: [usize; 3]) -> Result<Self> {
        let whole = volume.size();
        for axis in Axis::ALL {
            let a = axis.index();
            if first[a].checked_add(size[a]).is_none_or(|end| end > whole[a]) {
                let problem =
                    format!("{} samples from {} on along {axis} are not among {}", size[a], first[a], whole[a]);
                return Err(Error::setting("crop", problem, "cut out a box that the volume holds"));
            }
        }
        Ok(Cropped { volume, first, size })
    }

    fn whole(&self, at: [usize; 3]) -> [usize; 3] {
        std::array::from_fn(|a| at[a] + self.first[a])
    }
}

impl<V: Volume> Volume for Cropped<V> {
    fn size(&self) -> [usize; 3] {
        self.size
    }

    fn value(&self, at: [usize; 3]) -> f64 {
        self.volume.value(self.whole(at))
    }

    fn crossing(&self, at: [usize; 3], axis: Axis, level: Level) -> f64 {
        self.volume.crossing(self.whole(at), axis, level)
    }

    fn gradient(&self, place: DVec3) -> DVec3 {
        self.volume.gradient(place + DVec3::from(self.first.map(|c| c as f64)))
    }

    fn has_invalid_cells(&self) -> bool {
        self.volume.has_invalid_cells()
    }

    fn valid_cells(&self, [y, z]: [usize; 2], words: &mut [u64]) {
        let [first, dy, dz] = self.first;
        let mut row = vec![0; self.volume.size()[0].div_ceil(64)];
        self.volume.valid_cells([y + dy, z + dz], &mut row);
        for (word, i) in words.iter_mut().zip(first / 64..) {
            let next = row.get(i + 1).copied().unwrap_or(0);
            *word = row[i] >> (first % 64) | next.unbounded_shl(64 - first as u32 % 64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_of_functions_are_exact() {
        let ball = LevelSet::new([9; 3], |p: DVec3| (p - 4.0).length());
        let t = ball.crossing([6, 4, 4], Axis::X, Level::below(2.75));
        assert!((t - 0.75).abs() < 1e-9);
        assert!(ball.gradient(DVec3::new(4.0, 6.0, 4.0)).distance(DVec3::Y) < 1e-5);
    }

    #[test]
    fn parts_are_as_in_the_whole() {
        let whole = Samples::new([200, 3, 3], |[x, y, z]| (x * 7919 % 101 + y + z) as f64);
        let part = Cropped::new(&whole, [67, 1, 1], [130, 2, 2]).unwrap();
        assert_eq!(part.value([5, 1, 0]), whole.value([72, 2, 1]));
        let mut words = [0; 3];
        part.signs([1, 1], Level::above(50.0), &mut words);
        for x in 0..192 {
            let expected = x < 130 && whole.value([67 + x, 2, 2]) > 50.0;
            assert_eq!(words[x / 64] >> (x % 64) & 1 == 1, expected);
        }
        let message = Cropped::new(&whole, [100, 0, 0], [101, 1, 1]).err().unwrap().to_string();
        assert!(message.contains("101 samples from 100 on along x are not among 200"), "{message}");
    }
}
