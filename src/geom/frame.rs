//! The cube of the octree in model space, and the fixed-point coordinates in which everything exact is computed.

use super::bounds::Bounds;
use crate::error::{Error, Result, Short};
use glam::DVec3;

/// The root cube is 2^26 fixed-point units wide. Edge functions and plane normals of snapped triangles then stay below
/// 2^53: exact in `i64` and in `f64`. A unit is 1/64 of the resolution of 32-bit floats at the far side of the cube.
pub const FINE_BITS: u32 = 26;

/// Least and greatest depth of a grid: bricks are three levels deep, keys hold eighteen.
pub const DEPTHS: std::ops::RangeInclusive<u32> = 3..=18;

/// The least side of a cell, relative to the largest coordinate: 1/1024 of it is then a unit in the last place of an `f64`.
const FINEST_CELL: f64 = 1024.0 * f64::EPSILON;

/// A cube in model space, its sides along the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cube {
    /// The corner with the least coordinates.
    pub min: DVec3,
    /// Length of the sides, in model units.
    pub size: f64,
}

/// Where the root cube lies in model space and how finely it is divided.
///
/// The cube is made round a model ([`fit`](Frame::fit), [`fit_cells`](Frame::fit_cells)) or given ([`new`](Frame::new),
/// [`with_cells`](Frame::with_cells)); a given one may not hold the model, which [`check_holds`](Frame::check_holds) tells.
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
            let problem = format!("a cube of {} units at {} cannot be divided", Short(size), short(origin));
            return Err(Error::setting("box", problem, "scale the model to coordinates between 1e-280 and 1e280"));
        }
        let cell_size = size / f64::from(1u32 << depth);
        let largest = origin.abs().max_element().max(far.abs().max_element());
        if cell_size < FINEST_CELL * largest {
            let (cell, largest) = (Short(cell_size), Short(largest));
            let problem = format!("cells of {cell} units are too small to be told apart at coordinates of {largest}");
            let remedy = "move the model nearer to the origin, or take a smaller depth";
            return Err(Error::setting("depth", problem, remedy));
        }
        Ok(Frame { origin, size, depth, cell_size })
    }

    /// The cube about the centre of `bounds` whose side is the largest extent of the model over `scale`, as PolyMender
    /// places it. A model without extent gets a cube of one unit.
    ///
    /// # Errors
    /// When `scale` is not inside (0, 1), when there is nothing in the bounds, and as [`Frame::new`].
    pub fn fit(bounds: &Bounds, depth: u32, scale: f64) -> Result<Self> {
        let size = side_round(bounds, scale)?.unwrap_or(1.0);
        Frame::new(bounds.center() - 0.5 * size, size, depth)
    }

    /// The cube about the centre of `bounds` with cells of exactly `cell` model units: of the least depth at which its side is not
    /// less than that of [`Frame::fit`].
    ///
    /// # Errors
    /// When `cell` is no positive number, or so small that a depth of 18 is not enough, and as [`Frame::fit`].
    pub fn fit_cells(bounds: &Bounds, cell: f64, scale: f64) -> Result<Self> {
        let least = side_round(bounds, scale)?.unwrap_or(cell);
        let depth = depth_for(cell, least)?;
        let size = side_of(cell, depth);
        Frame::new(bounds.center() - 0.5 * size, size, depth)
    }

    /// The given cube with cells of exactly `cell` model units. It keeps its least corner and grows until its side is a power of two
    /// of cells.
    ///
    /// # Errors
    /// When `cell` is no positive number, or so small that a depth of 18 is not enough, and as [`Frame::new`].
    pub fn with_cells(cube: Cube, cell: f64) -> Result<Self> {
        let depth = depth_for(cell, cube.size)?;
        Frame::new(cube.min, side_of(cell, depth), depth)
    }

    /// Whether all points of `bounds` lie inside the open cube, at least half a fixed-point unit (2^-27 of the side) from its sides.
    ///
    /// # Errors
    /// Says along which axis, on which side and by how much the model sticks out most, and names a cube that would hold it.
    pub fn check_holds(&self, bounds: &Bounds) -> Result<()> {
        if bounds.is_empty() || (self.snap(bounds.min).is_some() && self.snap(bounds.max).is_some()) {
            return Ok(());
        }
        let (low, high) = (self.origin - bounds.min, bounds.max - (self.origin + self.size));
        let is_low = low.max_element() >= high.max_element();
        let beyond = if is_low { low } else { high };
        let axis = (0..3).rev().max_by(|&a, &b| beyond[a].total_cmp(&beyond[b])).expect("three axes");
        let name = ["x", "y", "z"][axis];
        let how =
            if beyond[axis] > 0.0 { format!("is {} units beyond", Short(beyond[axis])) } else { "touches".to_owned() };
        let [from, to, start, end] =
            [bounds.min[axis], bounds.max[axis], self.origin[axis], self.origin[axis] + self.size].map(Short);
        let (which, at) = if is_low { ("least", start) } else { ("greatest", end) };
        let problem = format!("the model, with {name} from {from} to {to}, {how} the {which} {name} of the box, {at}");
        let size = side_round(bounds, 0.9)?.unwrap_or(1.0);
        let corner = short(bounds.center() - 0.5 * size);
        Err(Error::setting("box", problem, format!("a box at {corner} with sides of {} holds it", Short(size))))
    }

    /// Least corner of the root cube, in model units.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Side of the root cube, in model units.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// The root cube.
    pub fn cube(&self) -> Cube {
        Cube { min: self.origin, size: self.size }
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

/// The side of a cube round a model that takes up `scale` of it; `None` for a model without extent.
fn side_round(bounds: &Bounds, scale: f64) -> Result<Option<f64>> {
    // 1 - 2^-20 leaves 32 fixed-point units on both sides.
    if !(scale > 0.0 && scale <= 1.0 - 1.0 / f64::from(1 << 20)) {
        let problem = format!("{} is not above 0 and below 1", Short(scale));
        return Err(Error::setting("scale", problem, "0.9 is the default"));
    }
    if bounds.is_empty() {
        return Err(Error::setting(
            "input",
            "there is no face with finite corners",
            "check the file with `zmend info`",
        ));
    }
    let extent = bounds.extent().max_element();
    Ok((extent > 0.0).then_some(extent / scale))
}

/// The least depth at which cells of `cell` units make up a side of `least` units.
fn depth_for(cell: f64, least: f64) -> Result<u32> {
    if !(cell.is_normal() && cell > 0.0) {
        let problem = format!("{} is not a length above 0", Short(cell));
        return Err(Error::setting("cell", problem, "give the side of a cell in the units of the model"));
    }
    DEPTHS.into_iter().find(|&depth| side_of(cell, depth) >= least).ok_or_else(|| {
        let most = 1u32 << DEPTHS.end();
        let problem = format!("a side of {} units has more than {most} cells of {} units", Short(least), Short(cell));
        let fitting = Short(least / f64::from(most) * 1.0001);
        Error::setting("cell", problem, format!("take cells of {fitting} units or more"))
    })
}

/// The side of a cube with 2^depth cells a side: exact, as is the division that gives the cell again.
fn side_of(cell: f64, depth: u32) -> f64 {
    cell * f64::from(1u32 << depth)
}

/// A point in a message.
fn short(p: DVec3) -> String {
    p.to_array().map(|c| Short(c).to_string()).join(" ")
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

    #[test]
    fn messages_have_no_rows_of_zeros() {
        for (min, max) in [(0.0, 1e300), (-1e305, 1e305), (-f64::MAX, f64::MAX), (1e200, 1e200 * (1.0 + 1e-15))] {
            let bounds = Bounds { min: DVec3::splat(min), max: DVec3::splat(max) };
            let message = Frame::fit(&bounds, 18, 0.9).unwrap_err().to_string();
            assert!(message.len() < 200, "{message}");
        }
    }

    #[test]
    fn cells_have_exactly_the_size_asked_for() {
        let frame = Frame::fit_cells(&unit(), 0.1, 0.9).unwrap();
        assert_eq!((frame.cell_size(), frame.depth()), (0.1, 4));
        assert_eq!(frame.origin() + 0.5 * frame.size(), DVec3::splat(0.5));
        // 0.9 of 16 cells are 14.4: a cell a little smaller, and the next depth is taken.
        assert_eq!(Frame::fit_cells(&unit(), 1.0 / 14.3, 0.9).unwrap().depth(), 4);
        assert_eq!(Frame::fit_cells(&unit(), 1.0 / 14.5, 0.9).unwrap().depth(), 5);
        // Huge cells make a grid of the least depth.
        let frame = Frame::fit_cells(&unit(), 7.5, 0.9).unwrap();
        assert_eq!((frame.depth(), frame.size()), (3, 60.0));
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-310] {
            assert!(Frame::fit_cells(&unit(), bad, 0.9).is_err(), "{bad}");
        }
        let message = Frame::fit_cells(&unit(), 1e-6, 0.9).unwrap_err().to_string();
        assert!(message.starts_with("cell: a side of 1.11111 units has more than 262144 cells"), "{message}");
        assert!(message.contains("take cells of 4.23"), "{message}");
        assert_eq!(Frame::fit_cells(&unit(), 4.239e-6, 0.9).unwrap().depth(), 18);
        let point = Bounds { min: DVec3::ONE, max: DVec3::ONE };
        assert_eq!(Frame::fit_cells(&point, 2.0, 0.9).unwrap().size(), 16.0);
    }

    #[test]
    fn a_given_cube_must_hold_the_model() {
        let holds = |x: f64, y: f64, z: f64, size| Frame::new(DVec3::new(x, y, z), size, 6)?.check_holds(&unit());
        assert!(holds(-0.1, -0.1, -0.1, 1.2).is_ok());
        assert!(Frame::new(DVec3::ONE, 1.0, 6).unwrap().check_holds(&Bounds::EMPTY).is_ok());
        for (result, words) in [
            (holds(-0.1, 0.25, -0.1, 1.5), "with y from 0 to 1, is 0.25 units beyond the least y of the box, 0.25"),
            (holds(-0.1, -0.1, -0.5, 1.25), "with z from 0 to 1, is 0.25 units beyond the greatest z of the box, 0.75"),
            (holds(0.0, -0.1, -0.1, 1.5), "touches the least x of the box, 0"),
        ] {
            let message = result.unwrap_err().to_string();
            assert!(message.contains(words) && message.starts_with("box: "), "{message}");
            assert!(message.ends_with("a box at -0.0555556 -0.0555556 -0.0555556 with sides of 1.11111 holds it"));
        }
        let cube = Cube { min: DVec3::splat(-0.5), size: 2.0 };
        let frame = Frame::with_cells(cube, 0.3).unwrap();
        assert_eq!((frame.origin(), frame.depth(), frame.cell_size()), (cube.min, 3, 0.3));
        assert_eq!(Frame::with_cells(cube, 0.25).unwrap().cube(), cube);
    }
}
