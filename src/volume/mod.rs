//! Scalar fields sampled on a lattice: what surfaces are extracted from.
//!
//! A [`Volume`] has samples at the lattice points 0 .. size along each axis, and says which of them are inside, where the surface cuts an
//! edge between two of them, and which way the field grows. Only [`size`](Volume::size) and [`value`](Volume::value) have to be written;
//! the rest has defaults that interpolate linearly. Who knows better (an analytic field, an octree of crossings) says so, and who is
//! faster (an array) too.
//!
//! | what there is | adapter |
//! |---|---|
//! | an array of any number type, in memory that is somebody else's, with any strides | [`Dense`] |
//! | a function of the lattice point | [`Samples`] |
//! | a continuous function of the place, of which surface and normals shall be exact | [`LevelSet`] |
//! | a part of another volume | [`Cropped`] |
//! | samples of any number type that are owned, with their place: what files are read into | [`Image`] |
//! | one of several materials, told apart by their numbers | [`Label`] |
//!
//! # Inside
//!
//! A sample is inside if it exceeds the [`Level`], or is below it if that is asked for. Samples **equal to the level are outside**, and so
//! are those that are **not a number**; infinite ones are as good as others. Everything agrees on that: no surface cracks at a tie.
//!
//! # Where it lies
//!
//! Volumes know nothing but the lattice; [`Placement`] says where that lies in the model's space, with any spacing, turned or mirrored.
//!
//! This module knows numbers and places only; surfaces are made by [`contour::volume`](crate::contour::volume).

pub mod cubic;
mod dense;
mod field;
pub mod image;
mod label;
mod placement;

pub use dense::{Dense, Sample};
pub use field::{Cropped, LevelSet, Samples};
pub use image::{Image, Voxels};
pub use label::Label;
pub use placement::Placement;

use crate::grid::Axis;
use glam::DVec3;

/// The value at which the surface lies, and the side of it that is solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// The value of the surface.
    pub iso: f64,
    /// Whether the solid is where values are lower.
    pub below: bool,
}

impl Level {
    /// The solid is where values exceed `iso`.
    pub const fn above(iso: f64) -> Self {
        Level { iso, below: false }
    }

    /// The solid is where values are less than `iso`.
    pub const fn below(iso: f64) -> Self {
        Level { iso, below: true }
    }

    /// Whether a sample is inside. No sample that equals the level is, nor any that is not a number.
    #[inline]
    pub fn holds(self, value: f64) -> bool {
        if self.below { value < self.iso } else { value > self.iso }
    }

    /// How far a sample is inside: positive exactly for those that are, and finite. What is not a number is as far outside as
    /// can be.
    #[inline]
    pub fn depth(self, value: f64) -> f64 {
        let depth = if self.below { self.iso - value } else { value - self.iso };
        if depth.is_nan() { -FAR } else { depth.clamp(-FAR, FAR) }
    }

    /// Where the surface cuts the way from one sample to another, by linear interpolation: 0 at the first, 1 at the second. One of the two
    /// must be inside and the other outside. The result is finite; where a sample is not a number or infinite, it is 1/2.
    #[inline]
    pub fn between(self, from: f64, to: f64) -> f64 {
        let t = (self.iso - from) / (to - from);
        // Infinite differences of finite numbers make 0, and NaN fails the comparison.
        if (0.0..=1.0).contains(&t) && (to - from).is_finite() { t } else { 0.5 }
    }
}

/// The greatest depth, a quarter of the greatest number: sums and differences of two depths stay finite.
const FAR: f64 = f64::MAX / 4.0;

/// A scalar field with samples on a lattice. Lattice points are `[x, y, z]`, each from 0 on, below the [size](Self::size).
///
/// ```
/// use zmend::volume::{Level, Volume};
///
/// /// The distance from the middle of a box.
/// struct Ball;
///
/// impl Volume for Ball {
///     fn size(&self) -> [usize; 3] {
///         [9, 9, 9]
///     }
///     fn value(&self, at: [usize; 3]) -> f64 {
///         at.iter().map(|&c| (c as f64 - 4.0).powi(2)).sum::<f64>().sqrt()
///     }
/// }
///
/// let mut words = [0];
/// Ball.signs([4, 4], Level::below(2.5), &mut words);
/// assert_eq!(words[0], 0b0_0111_1100);
/// ```
pub trait Volume: Sync {
    /// Number of samples along x, y and z.
    fn size(&self) -> [usize; 3];

    /// The sample at a lattice point.
    fn value(&self, at: [usize; 3]) -> f64;

    /// Which samples of the row along x at `[y, z]` are inside: bit `x % 64` of word `x / 64`. All bits of `words` are written, those beyond
    /// the row as 0; there are `size()[0]` / 64 words, rounded up. Must agree with [`Level::holds`] of the [values](Self::value), if
    /// other defaults than this one are used.
    fn signs(&self, [y, z]: [usize; 2], level: Level, words: &mut [u64]) {
        let row = self.size()[0];
        for (word, start) in words.iter_mut().zip((0..row).step_by(64)) {
            let points = start..row.min(start + 64);
            *word = points.rev().fold(0, |bits, x| bits << 1 | u64::from(level.holds(self.value([x, y, z]))));
        }
    }

    /// Where the surface cuts the edge from the lattice point `at` one step along `axis`, of which one end is inside and the other
    /// outside: from 0 at `at` to 1 at the other end. Interpolates linearly, if nothing else is said.
    fn crossing(&self, at: [usize; 3], axis: Axis, level: Level) -> f64 {
        let mut to = at;
        to[axis.index()] += 1;
        level.between(self.value(at), self.value(to))
    }

    /// The direction in which the field grows, at a place between the lattice points (`0 ..= size - 1` along each axis): the derivatives by
    /// x, y and z, in units of the value a step. Need not have the right length. Central differences, interpolated between
    /// the lattice points round the place, if nothing else is said; differences to one side at the border, and none where samples
    /// are not finite.
    fn gradient(&self, place: DVec3) -> DVec3 {
        differences(self, place)
    }

    /// Whether there are several [materials](Self::material).
    fn has_materials(&self) -> bool {
        false
    }

    /// The number of the material at a lattice point, of which one is inside. Surface nets have one place for all vertices in a cell, halfway
    /// between the materials, so that the surfaces of all of them fit together. Only called if there [are any](Self::has_materials).
    fn material(&self, at: [usize; 3]) -> f64 {
        self.value(at)
    }

    /// Whether [`valid_cells`](Self::valid_cells) leaves out any.
    fn has_invalid_cells(&self) -> bool {
        false
    }

    /// Which cells of the row along x at `[y, z]` may hold surface, each named by its lattice point with the least coordinates, as
    /// bits like [`signs`](Self::signs). The surface is left open round those that may not. Only called if
    /// [`has_invalid_cells`](Self::has_invalid_cells).
    fn valid_cells(&self, [y, z]: [usize; 2], words: &mut [u64]) {
        let _ = (y, z);
        words.fill(!0);
    }
}

impl<V: Volume + ?Sized> Volume for &V {
    fn size(&self) -> [usize; 3] {
        (**self).size()
    }
    fn value(&self, at: [usize; 3]) -> f64 {
        (**self).value(at)
    }
    fn signs(&self, row: [usize; 2], level: Level, words: &mut [u64]) {
        (**self).signs(row, level, words);
    }
    fn crossing(&self, at: [usize; 3], axis: Axis, level: Level) -> f64 {
        (**self).crossing(at, axis, level)
    }
    fn gradient(&self, place: DVec3) -> DVec3 {
        (**self).gradient(place)
    }
    fn has_materials(&self) -> bool {
        (**self).has_materials()
    }
    fn material(&self, at: [usize; 3]) -> f64 {
        (**self).material(at)
    }
    fn has_invalid_cells(&self) -> bool {
        (**self).has_invalid_cells()
    }
    fn valid_cells(&self, row: [usize; 2], words: &mut [u64]) {
        (**self).valid_cells(row, words);
    }
}

/// Central differences at the lattice points round a place, interpolated linearly. Lattice points that do not count are not asked:
/// on an edge of the lattice these are two.
fn differences<V: Volume + ?Sized>(volume: &V, place: DVec3) -> DVec3 {
    let size = volume.size();
    let low: [usize; 3] = std::array::from_fn(|a| (place[a].max(0.0) as usize).min(size[a].saturating_sub(1)));
    let t: [f64; 3] = std::array::from_fn(|a| place[a] - low[a] as f64);
    // The axes along which the place is between lattice points.
    let between = (0..3).fold(0, |axes, a| axes | usize::from(t[a] > 0.0 && low[a] + 1 < size[a]) << a);
    let mut sum = DVec3::ZERO;
    for corner in (0..8).filter(|corner| corner & !between == 0) {
        let at: [usize; 3] = std::array::from_fn(|a| low[a] + (corner >> a & 1));
        let weights = (0..3).filter(|a| between >> a & 1 == 1).map(|a| if at[a] > low[a] { t[a] } else { 1.0 - t[a] });
        sum += weights.product::<f64>() * difference_at(volume, at, size);
    }
    sum
}

fn difference_at<V: Volume + ?Sized>(volume: &V, at: [usize; 3], size: [usize; 3]) -> DVec3 {
    let along = |axis: usize| {
        let (mut low, mut high) = (at, at);
        low[axis] = at[axis].saturating_sub(1);
        high[axis] = (at[axis] + 1).min(size[axis] - 1);
        let steps = high[axis] - low[axis];
        let difference = (volume.value(high) - volume.value(low)) / steps as f64;
        if steps > 0 && difference.is_finite() { difference } else { 0.0 }
    };
    DVec3::new(along(0), along(1), along(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_and_what_is_no_number_are_outside() {
        for level in [Level::above(1.0), Level::below(1.0)] {
            for value in [1.0, f64::NAN] {
                assert!(!level.holds(value) && level.depth(value) <= 0.0);
            }
        }
        assert!(Level::above(1.0).holds(f64::INFINITY) && Level::above(1.0).depth(f64::INFINITY) > 1e300);
        assert!(Level::below(1.0).holds(f64::NEG_INFINITY) && !Level::below(1.0).holds(f64::INFINITY));
    }

    #[test]
    fn crossings_are_finite_whatever_the_samples() {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN, 0.0, 1.0, f64::MIN_POSITIVE];
        let level = Level::above(0.5);
        for (a, b) in
            odd.into_iter().flat_map(|a| odd.map(|b| (a, b))).filter(|&(a, b)| level.holds(a) != level.holds(b))
        {
            let t = level.between(a, b);
            assert!((0.0..=1.0).contains(&t), "{a} {b} {t}");
        }
        assert_eq!(level.between(0.0, 2.0), 0.25);
        assert_eq!(level.between(f64::MAX, f64::MIN), 0.5);
    }

    #[test]
    fn differences_are_exact_for_linear_fields() {
        let field = Samples::new([5, 4, 3], |[x, y, z]| 2.0 * x as f64 - 3.0 * y as f64 + 0.5 * z as f64);
        for place in [DVec3::new(0.0, 0.0, 0.0), DVec3::new(4.0, 3.0, 2.0), DVec3::new(2.25, 1.0, 0.5)] {
            assert!(field.gradient(place).distance(DVec3::new(2.0, -3.0, 0.5)) < 1e-12);
        }
        let flat = Samples::new([1, 4, 3], |_| f64::NAN);
        assert_eq!(flat.gradient(DVec3::new(0.0, 1.5, 1.0)), DVec3::ZERO);
    }
}
