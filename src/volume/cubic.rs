//! Volumes on lattices of cubes along the axes of space: what the octree needs.
//!
//! Most volumes are that already, or would be if their axes were exchanged or turned round: then the samples are only put into another order, and
//! stay what they are. All others (anisotropic, oblique) are sampled anew, linearly between their samples. Each sample stands for the box of
//! which it is the middle, as when a surface is closed at the border: half a step beyond the last samples the field is as at them,
//! further out it is not a number.

use super::image::with_samples;
use super::{Image, Placement, Sample, Voxels};
use crate::error::{Error, Result, Short};
use crate::progress::{Progress, Stage, check};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Steps whose lengths differ by less than this part are taken as equal: headers round to six digits or so.
const EQUAL: f64 = 1e-5;
/// The most samples along an axis: as many as the finest octree has points.
const MOST: f64 = 262_144.0;

/// How a volume came onto a lattice of cubes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// It was on one.
    None,
    /// Axes were exchanged or turned round.
    Reordered,
    /// Its values were interpolated.
    Resampled,
}

impl Image {
    /// The same field on a lattice of cubes along the axes of space, with sides of `cell` model units; as they are, or the least distance
    /// between samples, if nothing is said.
    ///
    /// Cost of interpolation: some 10 ns a sample, in parallel; the new samples are held beside the old ones.
    ///
    /// # Errors
    /// When `cell` is no length above 0, or so small that there would be more than 262,144 samples along an axis; `Cancelled`, and `Memory`
    /// when `progress` says so.
    pub fn on_cubes(self, cell: Option<f64>, progress: &dyn Progress) -> Result<(Image, Change)> {
        let placement = self.placement();
        let spacing = placement.spacing();
        let is_side = |side: f64| (spacing - side).abs().max_element() <= EQUAL * side;
        let side = cell.unwrap_or_else(|| spacing.min_element());
        if !(side.is_normal() && side > 0.0) {
            let problem = format!("{} is not a length above 0", Short(side));
            return Err(Error::setting("cell", problem, "give the side of a cell in the units of the volume"));
        }
        let Some(axes) = signed_axes(&placement.axes, side).filter(|_| is_side(side)) else {
            return Ok((self.resampled(side, progress)?, Change::Resampled));
        };
        if axes == [(0, true), (1, true), (2, true)] {
            let axes = DMat3::from_diagonal(DVec3::splat(side));
            return Ok((self.placed(Placement { axes, ..placement })?, Change::None));
        }
        Ok((self.reordered(axes, side)?, Change::Reordered))
    }

    /// The samples in another order: along each axis of space, those of one axis of the lattice, forwards or backwards.
    fn reordered(&self, axes: [(usize, bool); 3], side: f64) -> Result<Image> {
        let old = self.size();
        let size = axes.map(|(axis, _)| old[axis]);
        let mut first = [0; 3];
        axes.iter().filter(|(_, is_forwards)| !is_forwards).for_each(|&(axis, _)| first[axis] = old[axis] - 1);
        let strides = [1, old[0] as isize, (old[0] * old[1]) as isize];
        let step = axes.map(|(axis, is_forwards)| if is_forwards { strides[axis] } else { -strides[axis] });
        let start = self.index(first) as isize;
        macro_rules! reorder {
            ($voxels:path, $samples:expr) => {{
                let samples = $samples;
                let row = |n: usize| {
                    let (y, z) = ((n % size[1]) as isize, (n / size[1]) as isize);
                    let row = start + y * step[1] + z * step[2];
                    (0..size[0] as isize).map(move |x| samples[(row + x * step[0]) as usize])
                };
                $voxels((0..size[1] * size[2]).into_par_iter().flat_map_iter(row).collect())
            }};
        }
        let voxels = match self.voxels() {
            Voxels::U8(samples) => reorder!(Voxels::U8, samples),
            Voxels::I8(samples) => reorder!(Voxels::I8, samples),
            Voxels::U16(samples) => reorder!(Voxels::U16, samples),
            Voxels::I16(samples) => reorder!(Voxels::I16, samples),
            Voxels::U32(samples) => reorder!(Voxels::U32, samples),
            Voxels::I32(samples) => reorder!(Voxels::I32, samples),
            Voxels::F32(samples) => reorder!(Voxels::F32, samples),
            Voxels::F64(samples) => reorder!(Voxels::F64, samples),
        };
        let origin = self.placement().to_model(DVec3::from(first.map(|n| n as f64)));
        Image::new(size, Placement::with_spacing(origin, DVec3::splat(side)), voxels)
    }

    /// The field at other places.
    fn resampled(&self, side: f64, progress: &dyn Progress) -> Result<Image> {
        let placement = self.placement();
        let end = DVec3::from(self.size().map(|n| n as f64)) - 0.5;
        let corners = (0..8).map(|corner| {
            let at = DVec3::from([4, 2, 1].map(|bit| f64::from(u8::from(corner & bit != 0))));
            placement.to_model(DVec3::splat(-0.5) + at * (end + 0.5))
        });
        let (low, high) =
            corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        // Rounding must not add a layer of nothing.
        let count = ((high - low) / side - 1e-6).ceil().max(DVec3::ONE);
        if count.max_element() > MOST {
            let problem = format!("cells of {} units make {} along an axis", Short(side), Short(count.max_element()));
            return Err(Error::setting("cell", problem, format!("take so large ones that there are {MOST} at most")));
        }
        let size = count.to_array().map(|n| n as usize);
        let total = size.iter().product::<usize>();
        let is_single =
            matches!(self.voxels(), Voxels::U8(_) | Voxels::I8(_) | Voxels::U16(_) | Voxels::I16(_) | Voxels::F32(_));
        let bytes = total * if is_single { size_of::<f32>() } else { size_of::<f64>() };
        progress.begin(Stage::Read, size[2] as u64);
        progress.hold((self.voxels().bytes() + bytes) as u64)?;
        let placed = Placement::with_spacing(low + 0.5 * side, DVec3::splat(side));
        let inverse = placement.axes.inverse();
        let grid = Grid { size, start: inverse * (placed.origin - placement.origin), steps: inverse * side };
        let voxels = with_samples!(self.voxels(), samples => {
            let field = Field { samples, size: self.size() };
            if is_single {
                Voxels::F32(grid.sample(progress, |place| field.at(place) as f32)?)
            } else {
                Voxels::F64(grid.sample(progress, |place| field.at(place))?)
            }
        });
        Image::new(size, placed, voxels)
    }
}

/// For each axis of space the axis of the lattice along it, and whether forwards; if they all are along axes of space.
fn signed_axes(axes: &DMat3, side: f64) -> Option<[(usize, bool); 3]> {
    let along = |space: usize| {
        let is_along = |&axis: &usize| axes.col(axis)[space].abs() > 0.5 * side;
        let axis = (0..3).find(is_along)?;
        let step = axes.col(axis);
        let rest = (0..3).filter(|&a| a != space).map(|a| step[a].abs()).fold(0.0, f64::max);
        (rest <= EQUAL * side).then_some((axis, step[space] > 0.0))
    };
    let axes = [along(0)?, along(1)?, along(2)?];
    (0..3).all(|axis| axes.iter().any(|&(of, _)| of == axis)).then_some(axes)
}

/// Places to sample at, in steps of the old lattice.
struct Grid {
    size: [usize; 3],
    start: DVec3,
    /// By column: the steps along x, y and z.
    steps: DMat3,
}

impl Grid {
    fn sample<T: Copy + Default + Send>(
        &self,
        progress: &dyn Progress,
        value: impl Fn(DVec3) -> T + Sync,
    ) -> Result<Vec<T>> {
        let [nx, ny, nz] = self.size;
        let mut samples = Vec::new();
        if samples.try_reserve_exact(nx * ny * nz).is_err() {
            let problem = format!("{nx} x {ny} x {nz} samples do not fit into memory");
            return Err(Error::setting("cell", problem, "take larger cells"));
        }
        samples.resize(nx * ny * nz, T::default());
        samples.par_chunks_mut(nx * ny).enumerate().try_for_each(|(z, slice)| {
            check(progress)?;
            for (y, row) in slice.chunks_mut(nx).enumerate() {
                let start = self.start + self.steps * DVec3::new(0.0, y as f64, z as f64);
                for (x, sample) in row.iter_mut().enumerate() {
                    *sample = value(start + self.steps.x_axis * x as f64);
                }
            }
            progress.advance(1);
            Ok(())
        })?;
        Ok(samples)
    }
}

/// A field between samples.
struct Field<'a, T> {
    samples: &'a [T],
    size: [usize; 3],
}

impl<T: Sample> Field<'_, T> {
    /// The value at a place, in steps of the lattice; not a number more than half a step beyond the last samples.
    #[inline]
    fn at(&self, place: DVec3) -> f64 {
        let last = DVec3::from(self.size.map(|n| (n - 1) as f64));
        // A little more than half a step: places half a step beyond are rounded.
        let beyond = (place - last).max(-place).max_element();
        if beyond.is_nan() || beyond > 0.5 + 1e-6 {
            return f64::NAN;
        }
        let place = place.clamp(DVec3::ZERO, last);
        let low = place.floor();
        let part = place - low;
        let [x, y, z] = low.to_array().map(|c| c as usize);
        // Where a part is 0 there may be no further sample, nor need there be.
        let step = |a: usize, stride: usize| if part[a] > 0.0 { stride } else { 0 };
        let [nx, ny, _] = self.size;
        let (dx, dy, dz) = (step(0, 1), step(1, nx), step(2, nx * ny));
        let first = (z * ny + y) * nx + x;
        let along_x = |i: usize| {
            let (a, b): (f64, f64) = (self.samples[i].into(), self.samples[i + dx].into());
            if dx == 0 { a } else { a + part.x * (b - a) }
        };
        let along_y = |i: usize| {
            let a = along_x(i);
            if dy == 0 { a } else { a + part.y * (along_x(i + dy) - a) }
        };
        let a = along_y(first);
        if dz == 0 { a } else { a + part.z * (along_y(first + dz) - a) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::volume::Volume;

    /// A field that is linear in space, so that interpolation is exact.
    fn linear(size: [usize; 3], placement: Placement) -> Image {
        let mut samples = Vec::new();
        for z in 0..size[2] {
            for y in 0..size[1] {
                samples
                    .extend((0..size[0]).map(|x| value(placement.to_model(DVec3::new(x as f64, y as f64, z as f64)))));
            }
        }
        Image::new(size, placement, Voxels::F64(samples)).unwrap()
    }

    fn value(p: DVec3) -> f64 {
        p.dot(DVec3::new(1.0, -10.0, 100.0)) + 7.0
    }

    /// Whether all samples have the value that belongs to their place, or are beyond the samples.
    fn is_linear(image: &Image, is_within: impl Fn(DVec3) -> bool) -> bool {
        let [nx, ny, nz] = image.size();
        let mut points = (0..nx * ny * nz).map(|i| [i % nx, i / nx % ny, i / nx / ny]);
        points.all(|at| {
            let p = image.placement().to_model(DVec3::from(at.map(|c| c as f64)));
            !is_within(p) || (image.value(at) - value(p)).abs() < 1e-6
        })
    }

    #[test]
    fn axes_are_exchanged_and_turned_round() {
        let all = [DVec3::X, DVec3::Y, DVec3::Z];
        for (i, (a, b, c)) in [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)].into_iter().enumerate()
        {
            for flips in 0..8 {
                let sign = |bit: usize| if flips & bit != 0 { -0.5 } else { 0.5 };
                let axes = DMat3::from_cols(sign(1) * all[a], sign(2) * all[b], sign(4) * all[c]);
                let image = linear([3, 4, 5], Placement { origin: DVec3::new(1.0, 2.0, 3.0), axes });
                let (cubic, change) = image.clone().on_cubes(None, &Silent).unwrap();
                assert_eq!(change, if (i, flips) == (0, 0) { Change::None } else { Change::Reordered });
                assert_eq!(cubic.placement().axes, DMat3::from_diagonal(DVec3::splat(0.5)));
                assert!(is_linear(&cubic, |_| true) && cubic.voxels().len() == 60, "{i} {flips}");
            }
        }
    }

    #[test]
    fn other_lattices_are_sampled_anew() {
        let image = linear([4, 4, 4], Placement::with_spacing(DVec3::ONE, DVec3::new(1.0, 1.0, 1.5)));
        let (cubic, change) = image.clone().on_cubes(None, &Silent).unwrap();
        assert_eq!((change, cubic.size()), (Change::Resampled, [4, 4, 6]));
        // The boxes of both end at the same place: half a step before the first samples.
        assert_eq!(cubic.placement().origin, DVec3::new(1.0, 1.0, 0.75));
        assert!(is_linear(&cubic, |p| (1.0..=5.5).contains(&p.z)));
        assert_eq!(image.on_cubes(Some(0.5), &Silent).unwrap().0.size(), [8, 8, 12]);

        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.4);
        let oblique = linear([6, 7, 8], Placement { origin: DVec3::ZERO, axes: turn });
        let (cubic, _) = oblique.clone().on_cubes(None, &Silent).unwrap();
        let within = |p: DVec3| {
            let at = turn.inverse() * p;
            at.min_element() >= 0.0 && at.cmple(DVec3::new(5.0, 6.0, 7.0)).all()
        };
        assert!(is_linear(&cubic, within));
        let range = cubic.voxels().range();
        assert!(range.not_numbers > 0, "corners of the box that holds it are not in it");
        for bad in [0.0, -1.0, f64::NAN, 1e-9] {
            assert!(oblique.clone().on_cubes(Some(bad), &Silent).is_err(), "{bad}");
        }
    }
}
