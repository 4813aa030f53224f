//! Values that are checked as they are read.

use clap::builder::RangedI64ValueParser;
use clap::value_parser;
use glam::DVec3;
use zmend::Keep;
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
    let unit = Bounds { min: DVec3::ZERO, max: DVec3::ONE };
    Frame::fit(&unit, *DEPTHS.start(), scale).map(|_| scale).map_err(|e| e.to_string())
}

/// A number that the library takes as side of a cell.
pub(super) fn cell(text: &str) -> Result<f64, String> {
    let cell = coordinate(text)?;
    let point = Bounds { min: DVec3::ZERO, max: DVec3::ZERO };
    Frame::fit_cells(&point, cell, 0.9).map(|_| cell).map_err(|e| e.to_string())
}

pub(super) fn coordinate(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|c: &f64| c.is_finite()).ok_or_else(|| "not a finite number".to_owned())
}

/// Distances between samples: three, or one for all axes.
pub(super) fn spacing(text: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, String> = text.split(',').map(|number| width(number.trim())).collect();
    match numbers?[..] {
        [all] => Ok(DVec3::splat(all)),
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err("not one length or three, such as 0.5,0.5,1.25".to_owned()),
    }
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

/// The greatest distance that is allowed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Limit {
    /// In model units.
    Length(f64),
    /// In hundredths of the diagonal of a box.
    Percent(f64),
}

/// A length, or a percentage.
pub(super) fn limit(text: &str) -> Result<Limit, String> {
    let (number, limit) =
        text.strip_suffix('%').map_or((text, Limit::Length as fn(f64) -> Limit), |n| (n, Limit::Percent));
    let number = number.trim().parse().ok().filter(|n| (0.0..f64::INFINITY).contains(n));
    number.map(limit).ok_or_else(|| "not a length or percentage such as 0.01 or 0.5%".to_owned())
}

/// A length in model units.
pub(super) fn width(text: &str) -> Result<f64, String> {
    let width = text.parse().map_err(|_| "not a number".to_owned())?;
    if width > 0.0 && f64::is_finite(width) { Ok(width) } else { Err("not a width above 0".to_owned()) }
}

/// An area or a volume: a number from 0 on, or `all`.
pub(super) fn amount(text: &str) -> Result<f64, String> {
    let amount = if text == "all" { Ok(f64::INFINITY) } else { text.parse() };
    amount.ok().filter(|amount| *amount >= 0.0).ok_or_else(|| "not a number from 0 on, `inf` or `all`".to_owned())
}

/// `all`, `largest`, a number of solids, or a ratio, which is written with a point.
pub(super) fn keep(text: &str) -> Result<Keep, String> {
    let keep = match text {
        "all" => Keep::All,
        "largest" => Keep::Largest,
        _ => match text.parse() {
            Ok(count) => Keep::Count(count),
            Err(_) => Keep::Ratio(text.parse().map_err(|_| "not `all`, `largest`, a ratio or a number".to_owned())?),
        },
    };
    keep.check().map(|()| keep).map_err(|e| e.to_string())
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
        assert_eq!((limit("0.25"), limit("2 %")), (Ok(Limit::Length(0.25)), Ok(Limit::Percent(2.0))));
        assert!(["", "%", "-1", "nan", "inf%", "1%%", "x"].iter().all(|bad| limit(bad).is_err()));
        assert_eq!(
            (keep("1"), keep("1.0"), keep("0.25")),
            (Ok(Keep::Count(1)), Ok(Keep::Ratio(1.0)), Ok(Keep::Ratio(0.25)))
        );
        assert_eq!((keep("all"), keep("largest")), (Ok(Keep::All), Ok(Keep::Largest)));
        assert!(["0", "-1", "1.5", "nan", "most", ""].iter().all(|bad| keep(bad).is_err()));
        assert_eq!((spacing("2"), spacing("1, 2,0.5")), (Ok(DVec3::splat(2.0)), Ok(DVec3::new(1.0, 2.0, 0.5))));
        assert!(["", "1,2", "1,2,0", "1,2,3,4", "x"].iter().all(|bad| spacing(bad).is_err()));
        assert_eq!(width("2.5"), Ok(2.5));
        assert!(["0", "-1", "nan", "inf", "x"].iter().all(|bad| width(bad).is_err()));
        assert_eq!(["0", "2.5", "inf", "all"].map(amount), [Ok(0.0), Ok(2.5), Ok(f64::INFINITY), Ok(f64::INFINITY)]);
        assert!(["-1", "nan", "-inf", "some"].iter().all(|bad| amount(bad).is_err()));
        assert!(degrees("-45.5").is_ok() && degrees("nan").is_err() && degrees("north").is_err());
    }
}
