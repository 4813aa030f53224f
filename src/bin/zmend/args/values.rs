//! Values that are checked as they are read.

use clap::builder::RangedI64ValueParser;
use clap::value_parser;
use zmend::geom::frame::{DEPTHS, Frame};
use zmend::mesh::{Bounds, sample};

pub(super) fn depth_range() -> RangedI64ValueParser<u32> {
    value_parser!(u32).range(i64::from(*DEPTHS.start())..=i64::from(*DEPTHS.end()))
}

pub(super) fn detail_range() -> RangedI64ValueParser<u32> {
    value_parser!(u32).range(1..=i64::from(sample::MAX_DETAIL))
}

/// A number that the library takes as scale.
pub(super) fn scale(text: &str) -> Result<f64, String> {
    let scale = text.parse().map_err(|_| "not a number".to_owned())?;
    let unit = Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::ONE };
    Frame::fit(&unit, *DEPTHS.start(), scale).map(|_| scale).map_err(|e| e.to_string())
}

/// A number that the library takes as side of a cell.
pub(super) fn cell(text: &str) -> Result<f64, String> {
    let cell = coordinate(text)?;
    let point = Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::ZERO };
    Frame::fit_cells(&point, cell, 0.9).map(|_| cell).map_err(|e| e.to_string())
}

pub(super) fn coordinate(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|c: &f64| c.is_finite()).ok_or_else(|| "not a finite number".to_owned())
}

/// A number of bytes with a unit: K, M, G, T (thousands) or Ki, Mi, Gi, Ti (1024), with or without a B.
pub(super) fn bytes(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, f64); 9] = [
        ("ki", 1024.0),
        ("mi", 1024.0 * 1024.0),
        ("gi", 1024.0 * 1024.0 * 1024.0),
        ("ti", 1024.0 * 1024.0 * 1024.0 * 1024.0),
        ("k", 1e3),
        ("m", 1e6),
        ("g", 1e9),
        ("t", 1e12),
        ("", 1.0),
    ];
    let lower = text.to_ascii_lowercase();
    let plain = lower.strip_suffix('b').unwrap_or(&lower);
    let (digits, unit) =
        UNITS.iter().find_map(|(name, unit)| Some((plain.strip_suffix(name)?, unit))).unwrap_or(("", &1.0));
    match digits.trim_end().parse::<f64>() {
        Ok(number) if number.is_finite() && number * unit >= 1.0 => Ok((number * unit) as u64),
        _ => Err("not a number of bytes such as 500M or 4G".to_owned()),
    }
}

pub(super) fn degrees(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|degrees: &f64| degrees.is_finite()).ok_or_else(|| "not a number of degrees".to_owned())
}

/// The most pixels of a picture, which takes some hundred bytes for each: 40 million are 8 K.
const MOST_PIXELS: u64 = 40_000_000;

pub(super) fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    let [width, height]: [u32; 2] = sides.ok_or_else(|| "not of the form 1200x900".to_owned())?;
    match u64::from(width) * u64::from(height) {
        1..=MOST_PIXELS => Ok([width, height]),
        _ => Err(format!("a picture has 1 to {MOST_PIXELS} pixels")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_checked() {
        assert_eq!(size("1200x900"), Ok([1200, 900]));
        for bad in ["", "1200", "x", "0x5", "-1x5", "1e3x5", "100000x100000", "99999999999x1"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        assert_eq!(scale("0.5"), Ok(0.5));
        assert!(["0", "1", "-1", "nan", "inf", "x"].iter().all(|bad| scale(bad).is_err()));
        let sizes = ["1", "500M", "4G", "4gb", "1.5 GiB", "2KB", "1T"].map(bytes);
        let expected = [1, 500_000_000, 4_000_000_000, 4_000_000_000, 1_610_612_736, 2000, 1_000_000_000_000];
        assert_eq!(sizes, expected.map(Ok));
        assert!(["", "G", "-1G", "0", "nan", "4X", "1e999"].iter().all(|bad| bytes(bad).is_err()));
        assert_eq!(cell("0.25"), Ok(0.25));
        assert!(["0", "-1", "nan", "inf", "x", "1e-320"].iter().all(|bad| cell(bad).is_err()));
        assert!(coordinate("-1e9").is_ok() && coordinate("inf").is_err());
        assert!(degrees("-45.5").is_ok() && degrees("nan").is_err() && degrees("north").is_err());
    }
}
