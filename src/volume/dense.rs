//! Arrays of numbers as volumes.

use super::{Level, Volume};
use crate::error::{Error, Result};
use crate::grid::Axis;

/// A number type of which volumes are made: `u8`, `i8`, `u16`, `i16`, `u32`, `i32`, `f32`, `f64`. All are exact as `f64`.
pub trait Sample: Copy + PartialOrd + Send + Sync + Into<f64> + 'static {
    /// The samples that a level holds, told without leaving the type: those beyond the first (above it, or below it if the level is
    /// [`below`](Level::below)), and all of them if the second is true.
    fn bound(level: Level) -> (Self, bool);
}

macro_rules! whole {
    ($($t:ty),*) => {$(
        impl Sample for $t {
            fn bound(level: Level) -> (Self, bool) {
                // Casts saturate: beyond the greatest number there is none, which is right; all are beyond what is less than the least.
                if level.below {
                    let least = level.iso.ceil();
                    (least as $t, least > f64::from(<$t>::MAX))
                } else {
                    let greatest = level.iso.floor();
                    (greatest as $t, greatest < f64::from(<$t>::MIN))
                }
            }
        }
    )*};
}
whole!(u8, i8, u16, i16, u32, i32);

impl Sample for f32 {
    fn bound(level: Level) -> (Self, bool) {
        // The nearest f32 on the side that is outside.
        let near = level.iso as f32;
        let bound = if level.below && f64::from(near) < level.iso {
            near.next_up()
        } else if !level.below && f64::from(near) > level.iso {
            near.next_down()
        } else {
            near
        };
        (bound, false)
    }
}

impl Sample for f64 {
    fn bound(level: Level) -> (Self, bool) {
        (level.iso, false)
    }
}

/// A borrowed array of samples, with any strides.
///
/// Rows along x are read 64 samples at a time where x has the stride 1; other strides are as good, but slower. If another axis has it,
/// name that one x, and say so in the [`Placement`](super::Placement): its axes are columns that can be exchanged.
///
/// ```
/// use zmend::volume::{Dense, Volume};
///
/// let values = [0u8, 1, 2, 3, 4, 5, 6, 7];
/// let volume = Dense::new(&values, [2, 2, 2])?;
/// assert_eq!(volume.value([1, 0, 1]), 5.0);
/// // The same upside down, and with z first.
/// let turned = Dense::with_strides(&values, [2, 2, 2], 2, [4, -2, 1])?;
/// assert_eq!(turned.value([1, 0, 1]), 7.0);
/// # Ok::<(), zmend::Error>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Dense<'a, T> {
    values: &'a [T],
    size: [usize; 3],
    first: usize,
    strides: [isize; 3],
}

impl<'a, T: Sample> Dense<'a, T> {
    /// An array in which x runs fastest, then y, then z.
    ///
    /// # Errors
    /// When there are fewer values than the size says.
    pub fn new(values: &'a [T], size: [usize; 3]) -> Result<Self> {
        let strides = [1, size[0], size[0].saturating_mul(size[1])].map(|s| isize::try_from(s).unwrap_or(isize::MAX));
        Dense::with_strides(values, size, 0, strides)
    }

    /// An array whose first sample is at the index `first`, and the next one along each axis by `strides` further on. Strides may be 0 or
    /// negative.
    ///
    /// # Errors
    /// When there is a sample whose index is not in the array.
    pub fn with_strides(values: &'a [T], size: [usize; 3], first: usize, strides: [isize; 3]) -> Result<Self> {
        let volume = Dense { values, size, first, strides };
        if size.contains(&0) {
            return Ok(volume);
        }
        // The least and the greatest index.
        let (mut low, mut high) = (first as i128, first as i128);
        for axis in 0..3 {
            let reach = (size[axis] - 1) as i128 * strides[axis] as i128;
            low = low.saturating_add(reach.min(0));
            high = high.saturating_add(reach.max(0));
        }
        if low < 0 || high >= values.len() as i128 {
            let [x, y, z] = size;
            let problem =
                format!("{x} x {y} x {z} samples have indices from {low} to {high}, of {} values", values.len());
            return Err(Error::setting("size", problem, "give the size and strides of the array as it is"));
        }
        Ok(volume)
    }

    /// The samples, as they lie in memory.
    pub fn values(&self) -> &'a [T] {
        self.values
    }

    #[inline]
    fn index(&self, at: [usize; 3]) -> usize {
        let step = |a: usize| (at[a] as isize).wrapping_mul(self.strides[a]);
        (self.first as isize).wrapping_add(step(0)).wrapping_add(step(1)).wrapping_add(step(2)) as usize
    }
}

impl<T: Sample> Volume for Dense<'_, T> {
    fn size(&self) -> [usize; 3] {
        self.size
    }

    #[inline]
    fn value(&self, at: [usize; 3]) -> f64 {
        debug_assert!((0..3).all(|a| at[a] < self.size[a]), "lattice points are in the volume");
        self.values[self.index(at)].into()
    }

    #[inline]
    fn crossing(&self, at: [usize; 3], axis: Axis, level: Level) -> f64 {
        let from = self.index(at);
        let to = (from as isize).wrapping_add(self.strides[axis.index()]) as usize;
        level.between(self.values[from].into(), self.values[to].into())
    }

    fn signs(&self, [y, z]: [usize; 2], level: Level, words: &mut [u64]) {
        let start = self.index([0, y, z]);
        let (bound, all) = T::bound(level);
        let mut gathered;
        let row: &[T] = if self.strides[0] == 1 {
            &self.values[start..start + self.size[0]]
        } else {
            gathered = Vec::with_capacity(self.size[0]);
            gathered.extend((0..self.size[0]).map(|x| self.values[self.index([x, y, z])]));
            &gathered
        };
        for (word, part) in words.iter_mut().zip(row.chunks(64)) {
            *word = match (all, level.below) {
                (true, _) => !0 >> (64 - part.len()),
                (false, false) => bits(part, |v| v > bound),
                (false, true) => bits(part, |v| v < bound),
            };
        }
    }
}

/// One bit for each of up to 64 samples. Comparisons go to bytes, which compilers do many at a time; eight bytes of 0 or 1 become eight bits
/// by a product whose partial sums never meet.
#[inline]
fn bits<T: Copy>(part: &[T], holds: impl Fn(T) -> bool) -> u64 {
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let mut flags = [0u8; 64];
    if let Ok(whole) = <&[T; 64]>::try_from(part) {
        flags.iter_mut().zip(whole).for_each(|(flag, &v)| *flag = u8::from(holds(v)));
    } else {
        flags.iter_mut().zip(part).for_each(|(flag, &v)| *flag = u8::from(holds(v)));
    }
    let mut word = 0;
    for (eight, shift) in flags.as_chunks::<8>().0.iter().zip((0..64).step_by(8)) {
        word |= (u64::from_le_bytes(*eight).wrapping_mul(GATHER) >> 56) << shift;
    }
    word
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Signs by the fast way and by the trait's own.
    fn compare<T: Sample>(values: &[T], row: usize, isos: &[f64]) {
        struct Slow<'a, T>(Dense<'a, T>);
        impl<T: Sample> Volume for Slow<'_, T> {
            fn size(&self) -> [usize; 3] {
                self.0.size()
            }
            fn value(&self, at: [usize; 3]) -> f64 {
                self.0.value(at)
            }
        }
        let rows = values.len() / row;
        let there = Dense::new(values, [row, rows, 1]).unwrap();
        let back = Dense::with_strides(values, [row, rows, 1], row - 1, [-1, row as isize, 0]).unwrap();
        for (dense, iso) in [there, back].into_iter().flat_map(|d| isos.iter().map(move |&iso| (d, iso))) {
            for (level, y) in
                [Level::above(iso), Level::below(iso)].into_iter().flat_map(|l| (0..rows).map(move |y| (l, y)))
            {
                let (mut fast, mut slow) = (vec![!0; row.div_ceil(64)], vec![!0; row.div_ceil(64)]);
                dense.signs([y, 0], level, &mut fast);
                Slow(dense).signs([y, 0], level, &mut slow);
                assert_eq!(fast, slow, "{level:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn signs_are_those_of_the_values(bytes in prop::collection::vec(any::<u8>(), 320), row in 1usize..160) {
            let whole = bytes.len() / row * row;
            let isos = [f64::NEG_INFINITY, -1.0, -0.5, 0.0, 0.5, 100.0, 127.0, 200.5, 254.5, 255.0, 256.0, f64::INFINITY];
            compare(&bytes[..whole], row, &isos);
            let signed: Vec<i8> = bytes.iter().map(|&b| b as i8).collect();
            compare(&signed[..whole], row, &[-129.0, -128.5, -128.0, -1.0, 0.0, 126.5, 127.0, 128.0]);
            let wide: Vec<u16> = bytes.iter().map(|&b| u16::from(b) * 257).collect();
            compare(&wide[..whole], row, &[-1.0, 0.0, 25700.0, 65534.5, 65535.0, 1e9]);
            let floats: Vec<f32> = bytes.iter().map(|&b| if b == 7 { f32::NAN } else { f32::from(b) * 0.1 }).collect();
            compare(&floats[..whole], row, &[0.1, f64::from(0.1f32), 12.0, 1e300, -1e300, f64::INFINITY]);
            let doubles: Vec<f64> = bytes.iter().map(|&b| f64::from(b) * 0.1).collect();
            compare(&doubles[..whole], row, &[0.1, 0.1 * 3.0, 5.0]);
        }
    }

    #[test]
    fn arrays_that_are_too_short_are_refused() {
        let values = [0u16; 24];
        assert!(Dense::new(&values, [2, 3, 4]).is_ok() && Dense::new(&values, [0, 99, 99]).is_ok());
        let message = Dense::new(&values, [2, 3, 5]).unwrap_err().to_string();
        assert!(message.contains("2 x 3 x 5 samples have indices from 0 to 29, of 24 values"), "{message}");
        assert!(Dense::with_strides(&values, [2, 2, 2], 0, [1, -1, 0]).is_err());
        assert!(Dense::new(&values, [usize::MAX; 3]).is_err());
    }
}
