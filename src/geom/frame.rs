//! The cube of the octree in model space, and the fixed-point coordinates in which everything exact is computed.

use crate::error::{Error, Result};
use crate::mesh::Bounds;
use glam::DVec3;

/// The root cube is 2^26 fixed-point units wide. Edge functions and plane normals of snapped triangles then stay below
/// 2^53: exact in `i64` and in `f64`. A unit is 1/64 of the resolution of 32-bit floats at the far side of the cube.
pub const FINE_BITS: u32 = 26;

/// Least and greatest depth of a grid: bricks are three levels deep, keys hold eighteen.
pub const DEPTHS: std::ops::RangeInclusive<u32> = 3..=18;

/// The least side of a cell, relative to the largest coordinate: 1/1024 of it is then a unit in the last place of an `f64`.
const FINEST_CELL: f64 = 1024.0 * f64::EPSILON;

/// Where the root cube lies in model space and how finely it is divided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    origin: DVec3,
    size: f64,
    depth: u32,
    cell_size: f64,
}

impl Frame {
    /// A root cube with its least corner at `origin` and sides of `size` model units, with 2^depth cells a side.
    ///
    /// # Errors
    /// When the depth is not in [`DEPTHS`] or the cube is not finite, empty, or too small to have distinct coordinates.
    pub fn new(origin: DVec3, size: f64, depth: u32) -> Result<Self> {
        if !DEPTHS.contains(&depth) {
            let problem = format!("{depth} is not in {}..={}", DEPTHS.start(), DEPTHS.end());
            return Err(Error::setting(
                "depth",
                problem,
                "8 or 9 suits most models; each level more costs four times as much",
            ));
        }
        let far = origin + size;
        if !(origin.is_finite() && size.is_normal() && size > 0.0 && far.is_finite() && size < 1e300 && size > 1e-290) {
            let problem = format!("a cube of {size} units at {origin} cannot be divided");
            return Err(Error::setting("box", problem, "scale the model to coordinates between 1e-280 and 1e280"));
        }
        let cell_size = size / f64::from(1u32 << depth);
        let largest = origin.abs().max_element().max(far.abs().max_element());
        if cell_size < FINEST_CELL * largest {
            let problem =
                format!("cells of {cell_size:e} units are too small to be told apart at coordinates of {largest:e}");
            return Err(Error::setting(
                "depth",
                problem,
                "move the model nearer to the origin, or take a smaller depth",
            ));
        }
        Ok(Frame { origin, size, depth, cell_size })
    }

    /// The cube about the centre of `bounds` whose side is the largest extent of the model over `scale`, as PolyMender
    /// places it. A model without extent gets a cube of one unit.
    ///
    /// # Errors
    /// When `scale` is not inside (0, 1), when there is nothing in the bounds, and as [`Frame::new`].
    pub fn fit(bounds: &Bounds, depth: u32, scale: f64) -> Result<Self> {
        // 1 - 2^-20 leaves 32 fixed-point units on both sides.
        if !(scale > 0.0 && scale <= 1.0 - 1.0 / f64::from(1 << 20)) {
            return Err(Error::setting("scale", format!("{scale} is not above 0 and below 1"), "0.9 is the default"));
        }
        if bounds.is_empty() {
            return Err(Error::setting(
                "input",
                "there is no face with finite corners",
                "check the file with `zmend info`",
            ));
        }
        let extent = bounds.extent().max_element();
        let size = if extent > 0.0 { extent / scale } else { 1.0 };
        Frame::new(bounds.center() - 0.5 * size, size, depth)
    }

    /// Least corner of the root cube, in model units.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Side of the root cube, in model units.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// log2 of the number of cells a side.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Side of a finest cell, in model units.
    pub fn cell_size(&self) -> f64 {
        self.cell_size
    }

    /// log2 of the number of fixed-point units in a finest cell.
    pub fn cell_shift(&self) -> u32 {
        FINE_BITS - self.depth
    }

    /// Snaps a model point to fixed-point coordinates. `None` outside the open root cube, and for NaN.
    pub fn snap(&self, p: DVec3) -> Option<[i32; 3]> {
        let fine = f64::from(1 << FINE_BITS);
        let q = (p - self.origin) * (fine / self.size) + 0.5;
        // NaN fails both comparisons. Truncation of a positive number is floor, so this rounds to nearest.
        let is_inside = q.min_element() >= 1.0 && q.max_element() < fine && !q.is_nan();
        is_inside.then_some([q.x as i32, q.y as i32, q.z as i32])
    }

    /// From a position in finest cells (0 ..= 2^depth) to model space.
    #[inline]
    pub fn to_model(&self, cells: DVec3) -> DVec3 {
        self.origin + cells * self.cell_size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Bounds {
        Bounds { min: DVec3::ZERO, max: DVec3::ONE }
    }

    #[test]
    fn the_model_sits_in_the_middle() {
        let frame = Frame::fit(&unit(), 5, 0.5).unwrap();
        assert_eq!(frame.origin(), DVec3::splat(-0.5));
        assert_eq!(frame.size(), 2.0);
        assert_eq!(frame.cell_size(), 2.0 / 32.0);
        assert_eq!(frame.snap(DVec3::splat(0.5)), Some([1 << 25; 3]));
        assert_eq!(frame.to_model(DVec3::splat(16.0)), DVec3::splat(0.5));
    }

    #[test]
    fn outside_and_nan_are_refused() {
        let frame = Frame::fit(&unit(), 5, 0.9).unwrap();
        for p in [DVec3::splat(-10.0), DVec3::NAN, DVec3::new(0.5, f64::NAN, 0.5), DVec3::INFINITY, DVec3::splat(2.0)] {
            assert_eq!(frame.snap(p), None, "{p}");
        }
    }

    #[test]
    fn the_largest_scale_still_has_a_margin() {
        let frame = Frame::fit(&unit(), 6, 1.0 - 1.0 / f64::from(1 << 20)).unwrap();
        assert!(frame.snap(DVec3::ZERO).is_some_and(|p| p.iter().all(|&c| c > 0)));
        assert!(frame.snap(DVec3::ONE).is_some_and(|p| p.iter().all(|&c| c < 1 << FINE_BITS)));
    }

    #[test]
    fn bad_settings_say_what_to_do() {
        for scale in [0.0, 1.0, 1.5, -1.0, f64::NAN] {
            assert!(Frame::fit(&unit(), 6, scale).unwrap_err().to_string().contains("0.9"));
        }
        assert!(Frame::fit(&unit(), 19, 0.9).is_err());
        assert!(Frame::fit(&Bounds::EMPTY, 6, 0.9).is_err());
        let huge = Bounds { min: DVec3::splat(-f64::MAX), max: DVec3::splat(f64::MAX) };
        assert!(Frame::fit(&huge, 6, 0.9).is_err());
        let far = Bounds { min: DVec3::splat(1e14), max: DVec3::splat(1e14 + 1.0) };
        assert!(Frame::fit(&far, 6, 0.9).unwrap_err().to_string().contains("nearer to the origin"));
        let point = Bounds { min: DVec3::ONE, max: DVec3::ONE };
        assert_eq!(Frame::fit(&point, 6, 0.9).unwrap().size(), 1.0);
    }
}
