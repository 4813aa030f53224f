//! How many digits written coordinates need.

use zmend::geom::Frame;
use zmend::io::{Format, Precision};
use zmend::mesh::Bounds;
use zmend::{Error, Options, Result};

/// 32-bit coordinates will do where they have so many steps in a cell.
const STEPS: f64 = 1024.0;

/// What written coordinates need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Need {
    /// 32-bit floats will do.
    Single,
    /// More digits: cells are small, or far from the origin.
    Digits,
    /// Greater or smaller numbers than 32-bit floats can be.
    Range,
}

/// The precision that is written, and whether it is too low for the grid, because `format` can do no better.
pub(crate) fn choose(bounds: &Bounds, options: &Options, format: Format, is_text: bool) -> Result<(Precision, bool)> {
    chosen(need(bounds, options)?, farthest(bounds), format, is_text)
}

/// The same where the grid is known.
pub(crate) fn of_frame(frame: &Frame, format: Format, is_text: bool) -> Result<(Precision, bool)> {
    let corners = Bounds { min: frame.origin(), max: frame.origin() + frame.size() };
    of_box(&corners, frame.cell_size(), format, is_text)
}

/// The same for points within a box, in cells of a size.
pub(crate) fn of_box(bounds: &Bounds, cell: f64, format: Format, is_text: bool) -> Result<(Precision, bool)> {
    let far = farthest(bounds);
    chosen(need_at(far, cell), far, format, is_text)
}

fn chosen(need: Need, far: f64, format: Format, is_text: bool) -> Result<(Precision, bool)> {
    let is_single = format.is_single(is_text);
    match need {
        Need::Single => Ok((Precision::Single, false)),
        Need::Digits if is_single => Ok((Precision::Single, true)),
        Need::Range if is_single => {
            let kind = if format == Format::Stl { "binary STL".to_owned() } else { format.to_string() };
            let problem = format!("{kind} cannot hold numbers such as {far:e}");
            Err(Error::setting("format", problem, "write PLY, or STL as text with --ascii"))
        }
        Need::Digits | Need::Range => Ok((Precision::Double, false)),
    }
}

fn need(bounds: &Bounds, options: &Options) -> Result<Need> {
    if bounds.is_empty() {
        return Ok(Need::Single);
    }
    let cell = options.frame(bounds)?.cell_size();
    Ok(need_at(farthest(bounds) + cell, cell))
}

/// What cells of this size need so far from the origin.
fn need_at(far: f64, cell: f64) -> Need {
    if far > f64::from(f32::MAX) || cell / STEPS < f64::from(f32::MIN_POSITIVE) {
        Need::Range
    } else if far / f64::from(1 << 24) > cell / STEPS {
        Need::Digits
    } else {
        Need::Single
    }
}

/// The greatest coordinate, whatever its sign.
fn farthest(bounds: &Bounds) -> f64 {
    bounds.min.abs().max(bounds.max.abs()).max_element()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn digits_suffice() {
        let of = |at: f64, size: f64, depth| {
            let bounds = Bounds { min: DVec3::splat(at), max: DVec3::splat(at + size) };
            need(&bounds, &Options { depth, ..Options::default() }).unwrap()
        };
        assert_eq!(of(0.0, 1.0, 8), Need::Single);
        assert_eq!(of(0.0, 1.0, 13), Need::Single);
        assert_eq!(of(0.0, 1.0, 16), Need::Digits);
        assert_eq!(of(-1e3, 1.0, 8), Need::Digits);
        assert_eq!(of(0.0, 1e38, 8), Need::Single);
        assert_eq!(of(0.0, 1e39, 8), Need::Range);
        assert_eq!(of(0.0, 1e-36, 8), Need::Range);
        assert_eq!(need(&Bounds::EMPTY, &Options::default()).unwrap(), Need::Single);
    }

    #[test]
    fn only_binary_stl_is_short_of_digits() {
        let far = Bounds { min: DVec3::splat(1e5), max: DVec3::splat(1e5 + 1.0) };
        let huge = Bounds { min: DVec3::ZERO, max: DVec3::splat(1e99) };
        let choose = |bounds, format, is_text| choose(bounds, &Options::default(), format, is_text);
        assert_eq!(choose(&far, Format::Stl, false).unwrap(), (Precision::Single, true));
        assert_eq!(choose(&far, Format::Stl, true).unwrap(), (Precision::Double, false));
        assert_eq!(choose(&huge, Format::Ply, false).unwrap(), (Precision::Double, false));
        assert!(choose(&huge, Format::Stl, false).unwrap_err().to_string().contains("1e99"));
    }
}
