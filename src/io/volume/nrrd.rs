//! NRRD (Nearly Raw Raster Data, teem): a header of `key: value` lines up to an empty one, and the data behind it (`.nrrd`) or in files beside it
//! (`.nhdr`).
//!
//! Axes whose space direction is `none`, or whose kind says that they hold the numbers of one sample (vectors, colours), are channels if they
//! are the fastest; otherwise there must be three axes that are longer than 1. Coordinates stay as they are, whatever the space is called.

use super::fields::{Field, Fields, lines, numbered};
use super::layout::{Coding, Data, Layout, Skip};
use super::samples::{ByteOrder, SampleKind};
use crate::error::{Error, Place, Result};
use crate::volume::Placement;
use glam::{DMat3, DVec3};

/// How all files begin; the version follows.
const MAGIC: &[u8] = b"NRRD000";

pub(super) fn is_nrrd(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// Reads a header.
pub(super) fn parse(name: &str, head: &[u8]) -> Result<Layout> {
    let mut fields = Fields::new(name);
    let mut end = None;
    let mut listed: Option<Vec<String>> = None;
    for (number, line, next) in lines(head).skip(1) {
        let line = String::from_utf8_lossy(line);
        let line = line.trim();
        if let Some(listed) = &mut listed {
            listed.extend((!line.is_empty()).then(|| line.to_owned()));
        } else if line.is_empty() {
            end = Some(next as u64);
            break;
        } else if !line.starts_with('#') && !line.contains(":=") {
            let Some((key, value)) = line.split_once(':') else {
                let problem = "expected `key: value`";
                return Err(Error::format(name, Place::Line(number), problem, "correct this line or export again"));
            };
            fields.push(key, value, number);
            if matches!(key, "data file" | "datafile") && value.trim().starts_with("LIST") {
                listed = Some(Vec::new());
            }
        }
    }
    let data = match (fields.find(&["data file", "datafile"]), listed, end) {
        (Some(_), Some(listed), _) => Data::Files(listed),
        (Some(field), None, _) => Data::Files(files(&field.value).unwrap_or_else(|| vec![field.value.clone()])),
        (None, _, Some(end)) => Data::Here(end),
        (None, _, None) => {
            let problem = "the header does not end: no empty line, no `data file`";
            return Err(Error::format(name, Place::Whole, problem, "the file was cut short: copy or export it again"));
        }
    };
    layout(&fields, data)
}

/// The files of `pattern first last step [subdim]`.
fn files(value: &str) -> Option<Vec<String>> {
    let words: Vec<&str> = value.split_whitespace().collect();
    let [pattern, first, last, step, ..] = words[..] else { return None };
    numbered(pattern, first.parse().ok()?, last.parse().ok()?, step.parse().ok()?)
}

/// Kinds of axes along which samples lie.
const IN_SPACE: [&str; 4] = ["domain", "space", "time", "???"];

/// What is said of one axis.
#[derive(Debug, Clone, Copy)]
struct AxisOf {
    size: u64,
    /// Step from sample to sample.
    direction: Option<DVec3>,
    /// Where along the axis the first sample is, in units of it.
    start: f64,
    is_channel: bool,
}

fn layout(fields: &Fields<'_>, data: Data) -> Result<Layout> {
    let axes = axes(fields)?;
    let sizes = fields.require("sizes")?;
    let (channels, spatial) = match axes.split_first() {
        Some((first, rest)) if first.is_channel || axes.len() == 4 && rest.iter().all(|axis| axis.size > 1) => {
            (first.size, rest)
        }
        _ => (1, &axes[..]),
    };
    // Whatever is longer than 1 is an axis of space; those of length 1 fill up.
    let long = spatial.iter().filter(|axis| axis.size > 1).count();
    let mut spare = 3usize.saturating_sub(long);
    let mut spatial: Vec<AxisOf> = spatial
        .iter()
        .filter(|axis| {
            let is_taken = axis.size != 1 || spare > 0;
            spare -= usize::from(axis.size == 1 && spare > 0);
            is_taken
        })
        .copied()
        .collect();
    if spatial.iter().any(|axis| axis.is_channel) || !(2..=3).contains(&spatial.len()) {
        return Err(
            fields.error(sizes, "expected two or three axes of space, and at most one before them for channels")
        );
    }
    let placement = placement(fields, &mut spatial)?;
    let coding = coding(fields)?;
    let kind = kind(fields)?;
    let order = match fields.find(&["endian"]).map(|field| field.value.as_str()) {
        Some("big") => ByteOrder::Big,
        Some("little") => ByteOrder::Little,
        _ if kind.bytes() == 1 || coding == Coding::Text => ByteOrder::Little,
        _ => return fields.require("endian").and_then(|field| Err(fields.error(field, "expected little or big"))),
    };
    let number = |keys: &[&str]| match fields.find(keys) {
        Some(field) => fields.numbers(field, 1).map(|n| n[0]),
        None => Ok(0.0),
    };
    let (lines, bytes) = (number(&["line skip", "lineskip"])?, number(&["byte skip", "byteskip"])?);
    let skip = if bytes < 0.0 { Skip::FromEnd } else { Skip::Ahead { lines: lines as u64, bytes: bytes as u64 } };
    Ok(Layout {
        size: [0, 1, 2].map(|a| spatial[a].size),
        placement,
        kind,
        order,
        channels,
        coding,
        data,
        skip,
        scale: None,
    })
}

fn kind(fields: &Fields<'_>) -> Result<SampleKind> {
    let field = fields.require("type")?;
    Ok(match field.value.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => SampleKind::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleKind::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => SampleKind::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => SampleKind::U16,
        "int" | "signed int" | "int32" | "int32_t" => SampleKind::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleKind::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => SampleKind::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => SampleKind::U64,
        "float" => SampleKind::F32,
        "double" => SampleKind::F64,
        _ => return Err(fields.error(field, "expected a type of number such as uint8")),
    })
}

fn coding(fields: &Fields<'_>) -> Result<Coding> {
    let field = fields.require("encoding")?;
    Ok(match field.value.to_ascii_lowercase().as_str() {
        "raw" => Coding::Raw,
        "txt" | "text" | "ascii" => Coding::Text,
        "hex" => Coding::Hex,
        "gz" | "gzip" => Coding::Gzip,
        "bz2" | "bzip2" => {
            return Err(fields.error(field, "bzip2 is not known here: save it with the encoding gzip or raw"));
        }
        _ => return Err(fields.error(field, "expected an encoding: raw, text, hex or gzip")),
    })
}

/// The axes, the fastest first.
fn axes(fields: &Fields<'_>) -> Result<Vec<AxisOf>> {
    let sizes = fields.require("sizes")?;
    let list = fields.counts(sizes)?;
    let dimension = fields.require("dimension")?;
    if fields.counts(dimension)? != [list.len() as u64] || list.len() > 16 {
        return Err(fields.error(sizes, "expected as many sizes as there are dimensions"));
    }
    let words = |keys: &[&str]| -> Vec<String> {
        fields.find(keys).map_or(Vec::new(), |field| field.value.split_whitespace().map(str::to_owned).collect())
    };
    let (kinds, centerings) = (words(&["kinds"]), words(&["centers", "centerings"]));
    let directions = fields.find(&["space directions"]).map(|field| vectors(fields, field)).transpose()?;
    let of = |keys: &[&str]| -> Result<Vec<f64>> {
        fields.find(keys).map_or(Ok(vec![f64::NAN; list.len()]), |field| fields.numbers(field, list.len()))
    };
    let (spacings, mins, maxs) = (of(&["spacings"])?, of(&["axis mins", "axismins"])?, of(&["axis maxs", "axismaxs"])?);
    let mut place = 0;
    let mut axis = |i: usize| -> Result<AxisOf> {
        let is_cell = centerings.get(i).is_some_and(|center| center == "cell");
        let steps = if is_cell { list[i] as f64 } else { list[i] as f64 - 1.0 };
        let spaced =
            [spacings[i], (maxs[i] - mins[i]) / steps].into_iter().find(|step| step.is_finite() && *step != 0.0);
        let offset = if is_cell { 0.5 } else { 0.0 };
        let start = match spaced {
            Some(step) if mins[i].is_finite() => mins[i] / step + offset,
            _ => 0.0,
        };
        let is_named = kinds.get(i).is_some_and(|kind| !IN_SPACE.contains(&kind.as_str()));
        let direction = match &directions {
            Some(directions) => directions.get(i).copied().ok_or_else(|| {
                let field = fields.find(&["space directions"]).unwrap_or(sizes);
                fields.error(field, "expected a vector, or `none`, for each axis")
            })?,
            None => None,
        };
        let is_channel = is_named || (directions.is_some() && direction.is_none() && list[i] > 1);
        let direction = direction.or_else(|| {
            let unit = DVec3::AXES.get(place).copied()?;
            spaced.map(|step| step * unit)
        });
        place += usize::from(!is_channel);
        Ok(AxisOf { size: list[i], direction, start, is_channel })
    };
    (0..list.len()).map(&mut axis).collect()
}

/// The vectors of a field: `(1,0,0) none (0,1,0)`.
fn vectors(fields: &Fields<'_>, field: &Field) -> Result<Vec<Option<DVec3>>> {
    let fail = || fields.error(field, "expected vectors such as (1,0,0), or none");
    let mut rest = field.value.trim();
    let mut list = Vec::new();
    while !rest.is_empty() {
        if let Some(behind) = rest.strip_prefix("none") {
            list.push(None);
            rest = behind.trim_start();
            continue;
        }
        let (inner, behind) = rest.strip_prefix('(').and_then(|rest| rest.split_once(')')).ok_or_else(fail)?;
        let numbers: Option<Vec<f64>> = inner.split(',').map(|number| number.trim().parse().ok()).collect();
        let mut numbers = numbers.filter(|numbers| matches!(numbers.len(), 2 | 3)).ok_or_else(fail)?;
        numbers.resize(3, 0.0);
        list.push(Some(DVec3::new(numbers[0], numbers[1], numbers[2])));
        rest = behind.trim_start();
    }
    Ok(list)
}

/// Where the samples lie; a missing third axis is added.
fn placement(fields: &Fields<'_>, axes: &mut Vec<AxisOf>) -> Result<Placement> {
    let mut steps: Vec<DVec3> = (0..axes.len()).map(|i| axes[i].direction.unwrap_or(DVec3::AXES[i])).collect();
    if let [x, y] = steps[..] {
        let normal = x.cross(y).normalize_or(DVec3::Z);
        steps.push(normal * (x.length() * y.length()).sqrt());
        axes.push(AxisOf { size: 1, direction: None, start: 0.0, is_channel: false });
    }
    let origin = match fields.find(&["space origin"]) {
        Some(field) => match vectors(fields, field)?[..] {
            [Some(origin)] => origin,
            _ => return Err(fields.error(field, "expected one vector")),
        },
        None => steps.iter().zip(axes.iter()).map(|(step, axis)| *step * axis.start).sum(),
    };
    Ok(Placement { origin, axes: DMat3::from_cols(steps[0], steps[1], steps[2]) })
}
