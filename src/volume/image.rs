//! Volumes in memory that own their samples: what volume files are read into.
//!
//! An [`Image`] is a box of samples on a lattice, x fastest, then y, then z, of the type that the file has them in. Its [`Placement`] says
//! where the samples lie in space: any affine lattice, so that anisotropic spacing, flipped axes and the oblique slices of scanners are all the
//! same thing.
//!
//! # Invariants
//!
//! There is at least one sample along each axis, as many voxels as the size says, and the placement is finite and not flat.
//!
//! # Cost
//!
//! The samples in their own type, nothing beside them.

use super::{Dense, Level, Placement, Sample, Volume};
use crate::error::{Error, Result};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Samples that are summed up at a time.
const PIECE: usize = 1 << 16;

/// Samples, in the type they come in.
///
/// Integers of 64 bits have no place here: readers narrow them to 32 where all of them fit, else they become `F64`.
#[derive(Debug, Clone, PartialEq)]
pub enum Voxels {
    /// Unsigned, 8 bits.
    U8(Vec<u8>),
    /// Signed, 8 bits.
    I8(Vec<i8>),
    /// Unsigned, 16 bits.
    U16(Vec<u16>),
    /// Signed, 16 bits.
    I16(Vec<i16>),
    /// Unsigned, 32 bits.
    U32(Vec<u32>),
    /// Signed, 32 bits.
    I32(Vec<i32>),
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
}

/// Does the same with samples of every type.
macro_rules! with_samples {
    ($voxels:expr, $samples:ident => $result:expr) => {
        match $voxels {
            $crate::volume::Voxels::U8($samples) => $result,
            $crate::volume::Voxels::I8($samples) => $result,
            $crate::volume::Voxels::U16($samples) => $result,
            $crate::volume::Voxels::I16($samples) => $result,
            $crate::volume::Voxels::U32($samples) => $result,
            $crate::volume::Voxels::I32($samples) => $result,
            $crate::volume::Voxels::F32($samples) => $result,
            $crate::volume::Voxels::F64($samples) => $result,
        }
    };
}
pub(crate) use with_samples;

impl Voxels {
    /// Number of samples.
    pub fn len(&self) -> usize {
        with_samples!(self, samples => samples.len())
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The type's name.
    pub fn type_name(&self) -> &'static str {
        match self {
            Voxels::U8(_) => "u8",
            Voxels::I8(_) => "i8",
            Voxels::U16(_) => "u16",
            Voxels::I16(_) => "i16",
            Voxels::U32(_) => "u32",
            Voxels::I32(_) => "i32",
            Voxels::F32(_) => "f32",
            Voxels::F64(_) => "f64",
        }
    }

    /// Sample number `i`: every type fits into an `f64` without loss.
    ///
    /// # Panics
    /// When there is none.
    pub fn value(&self, i: usize) -> f64 {
        with_samples!(self, samples => wide(samples[i]))
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        with_samples!(self, samples => size_of_val(samples.as_slice()))
    }

    /// Least and greatest sample and how many are NaN. Cost: one pass, in parallel.
    pub fn range(&self) -> Range {
        with_samples!(self, samples => {
            let of_piece = |piece: &[_]| {
                let add = |range: Range, &value: &_| range.with(wide(value));
                piece.iter().fold(Range::EMPTY, add)
            };
            samples.par_chunks(PIECE).map(of_piece).reduce(|| Range::EMPTY, Range::merged)
        })
    }
}

/// Any sample as a double.
fn wide(sample: impl Into<f64>) -> f64 {
    sample.into()
}

/// What values there are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The least value, or infinity where there is none.
    pub least: f64,
    /// The greatest value, or minus infinity where there is none.
    pub greatest: f64,
    /// How many samples are NaN.
    pub not_numbers: u64,
}

impl Range {
    /// No value.
    pub const EMPTY: Range = Range { least: f64::INFINITY, greatest: f64::NEG_INFINITY, not_numbers: 0 };

    #[inline]
    fn with(self, value: f64) -> Range {
        Range {
            least: self.least.min(value),
            greatest: self.greatest.max(value),
            not_numbers: self.not_numbers + u64::from(value.is_nan()),
        }
    }

    fn merged(self, other: Range) -> Range {
        Range {
            least: self.least.min(other.least),
            greatest: self.greatest.max(other.greatest),
            not_numbers: self.not_numbers + other.not_numbers,
        }
    }
}

/// A volume: samples and where they lie.
///
/// ```
/// use zmend::volume::{Image, Placement, Volume, Voxels};
///
/// let image = Image::new([3, 2, 1], Placement::default(), Voxels::U8(vec![0, 1, 2, 3, 4, 5]))?;
/// assert_eq!(image.value([1, 1, 0]), 4.0);
/// assert_eq!(image.voxels().range().greatest, 5.0);
/// # Ok::<(), zmend::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    size: [usize; 3],
    placement: Placement,
    voxels: Voxels,
}

impl Image {
    /// A volume of `size` samples along x, y and z, x fastest.
    ///
    /// # Errors
    /// When there is no sample, when there are more or fewer voxels, and as [`Placement::check`].
    pub fn new(size: [usize; 3], placement: Placement, voxels: Voxels) -> Result<Self> {
        let count = size.iter().try_fold(1usize, |count, &n| count.checked_mul(n));
        if count != Some(voxels.len()) || voxels.is_empty() {
            let [x, y, z] = size;
            let problem = format!("{x} x {y} x {z} samples are not the {} that there are", voxels.len());
            return Err(Error::setting("size", problem, "give one sample or more along each axis, and voxels for all"));
        }
        placement.check()?;
        Ok(Image { size, placement, voxels })
    }

    /// Number of samples along x, y and z: 1 or more.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Where the samples lie.
    pub fn placement(&self) -> Placement {
        self.placement
    }

    /// The samples, x fastest, then y, then z.
    pub fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// The same samples elsewhere.
    ///
    /// # Errors
    /// As [`Placement::check`].
    pub fn placed(self, placement: Placement) -> Result<Self> {
        placement.check()?;
        Ok(Image { placement, ..self })
    }

    /// The same samples in the same directions, so far apart; the first one stays where it is.
    ///
    /// # Errors
    /// As [`Placement::check`].
    pub fn with_spacing(self, spacing: DVec3) -> Result<Self> {
        let placement = self.placement;
        let axes = placement.axes * DMat3::from_diagonal(spacing / placement.spacing());
        self.placed(Placement { axes, ..placement })
    }

    /// One material, where samples are numbers of materials: 1 where a sample equals `label`, 0 elsewhere, so that the level 1/2 lies between. For
    /// what needs a field, as [sampling anew](Self::on_cubes) does; [`Label`](super::Label) is the same without a copy. Cost: one pass, in parallel.
    #[must_use]
    pub fn material(&self, label: f64) -> Self {
        let voxels = with_samples!(&self.voxels, samples => {
            Voxels::U8(samples.par_iter().map(|&sample| u8::from(wide(sample) == label)).collect())
        });
        Image { voxels, ..*self }
    }

    /// The place of a sample among the voxels.
    #[inline]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// The corners of the box of the samples, in model units.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            let at = [4, 2, 1].map(|bit| corner & bit != 0);
            let end = |a: usize| if at[a] { (self.size[a] - 1) as f64 } else { 0.0 };
            self.placement.to_model(DVec3::new(end(0), end(1), end(2)))
        })
    }
}

/// The samples of one type.
fn dense<T: Sample>(samples: &[T], size: [usize; 3]) -> Dense<'_, T> {
    Dense::new(samples, size).expect("images have as many voxels as their size says")
}

/// What is asked for rows is done in the type of the samples, with one look at what that is.
impl Volume for Image {
    fn size(&self) -> [usize; 3] {
        self.size
    }

    #[inline]
    fn value(&self, at: [usize; 3]) -> f64 {
        self.voxels.value(self.index(at))
    }

    fn signs(&self, row: [usize; 2], level: Level, words: &mut [u64]) {
        with_samples!(&self.voxels, samples => dense(samples, self.size).signs(row, level, words));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_placements_are_checked() {
        let voxels = || Voxels::I16(vec![-1, 2, 3, 4]);
        let image = Image::new([2, 2, 1], Placement::default(), voxels()).unwrap();
        assert_eq!((image.value([0, 1, 0]), image.index([1, 1, 0]), image.voxels().bytes()), (3.0, 3, 8));
        assert!(Image::new([2, 1, 1], Placement::default(), voxels()).is_err());
        assert!(Image::new([usize::MAX, usize::MAX, 2], Placement::default(), voxels()).is_err());
        assert!(Image::new([0, 2, 1], Placement::default(), Voxels::U8(Vec::new())).is_err());
        for spacing in [DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, f64::NAN, 1.0), DVec3::splat(f64::INFINITY)] {
            let message = image.clone().placed(Placement::with_spacing(DVec3::ZERO, spacing)).unwrap_err().to_string();
            assert!(message.contains("--spacing"), "{message}");
        }
    }

    #[test]
    fn images_are_volumes() {
        let axes = DMat3::from_cols(DVec3::new(0.0, 2.0, 0.0), DVec3::new(3.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 4.0));
        let placement = Placement { origin: DVec3::ONE, axes };
        let image = Image::new([2, 1, 3], placement, Voxels::U16(vec![0, 1, 2, 3, 4, 5])).unwrap();
        assert_eq!(image.corners()[7], DVec3::new(1.0, 3.0, 9.0));
        let finer = image.clone().with_spacing(DVec3::splat(1.0)).unwrap();
        assert_eq!(finer.placement().to_model(DVec3::ONE), DVec3::splat(2.0));
        let mut words = [0];
        let rows = [0, 1, 2].map(|z| {
            image.signs([0, z], Level::above(2.5), &mut words);
            words[0]
        });
        assert_eq!(rows, [0, 0b10, 0b11]);
        assert_eq!(Volume::value(&image, [1, 0, 2]), 5.0);
        assert_eq!(image.gradient(DVec3::new(0.5, 0.0, 1.0)), DVec3::new(1.0, 0.0, 2.0));
    }

    #[test]
    fn materials_are_told_by_their_number() {
        let image = Image::new([2, 2, 1], Placement::default(), Voxels::I16(vec![3, -2, 3, 0])).unwrap();
        let material = |label| image.material(label).voxels;
        assert_eq!(material(3.0), Voxels::U8(vec![1, 0, 1, 0]));
        assert_eq!((material(-2.0), material(0.5)), (Voxels::U8(vec![0, 1, 0, 0]), Voxels::U8(vec![0; 4])));
    }

    #[test]
    fn ranges_leave_nan_out() {
        let range = Voxels::F32(vec![f32::NAN, 2.0, -3.0]).range();
        assert_eq!(range, Range { least: -3.0, greatest: 2.0, not_numbers: 1 });
        assert_eq!(Voxels::U32(vec![7; 200_000]).range(), Range { least: 7.0, greatest: 7.0, not_numbers: 0 });
    }
}
