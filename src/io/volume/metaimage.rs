//! `MetaImage` (Kitware's `MetaIO`): a header of `Key = Value` lines, and the data behind it (`.mha`) or in files beside it (`.mhd`).
//!
//! The `Offset` is where the middle of the first sample lies; `TransformMatrix` has the directions of the axes, one after the other.
//! `ElementSize` stands in where `ElementSpacing` is missing, as in `MetaIO`. Intensity functions are not applied, as in ITK.

use super::fields::{Field, Fields, LONGEST, lines, numbered};
use super::layout::{Coding, Data, Layout, Skip};
use super::samples::{ByteOrder, SampleKind};
use crate::error::{Error, Place, Result};
use crate::volume::Placement;
use glam::{DMat3, DVec3};

/// Keys of which one begins a file.
const FIRST: [&str; 5] = ["objecttype", "ndims", "comment", "transformtype", "objectsubtype"];

/// Whether a file begins as `MetaImage` files do.
pub(super) fn is_metaimage(head: &[u8]) -> bool {
    let first = lines(head).map(|(_, line, _)| line).find(|line| !line.trim_ascii().is_empty());
    first.and_then(split).is_some_and(|(key, _)| FIRST.contains(&key.to_ascii_lowercase().as_str()))
}

/// Key and value of a line.
fn split(line: &[u8]) -> Option<(&str, &str)> {
    // The data may follow without a header's end: anything that is no text is no line.
    let line = std::str::from_utf8(line.get(..line.len().min(LONGEST))?).ok()?;
    let (key, value) = line.split_once('=')?;
    Some((key.trim(), value.trim()))
}

/// Reads a header.
pub(super) fn parse(name: &str, head: &[u8]) -> Result<Layout> {
    let mut fields = Fields::new(name);
    let mut data = None;
    let mut listed = Vec::new();
    for (number, line, next) in lines(head) {
        if data == Some(Data::Files(Vec::new())) {
            // What follows `LIST` are names of files.
            listed.extend(
                std::str::from_utf8(line).ok().map(str::trim).filter(|file| !file.is_empty()).map(str::to_owned),
            );
            continue;
        }
        let Some((key, value)) = split(line) else {
            if line.trim_ascii().is_empty() {
                continue;
            }
            let problem = "expected `Key = Value`";
            return Err(Error::format(name, Place::Line(number), problem, "is this a MetaImage file? export it again"));
        };
        fields.push(key, value, number);
        if key.eq_ignore_ascii_case("ElementDataFile") {
            let is_list = value.split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case("LIST"));
            data = Some(match value {
                _ if value.eq_ignore_ascii_case("LOCAL") => Data::Here(next as u64),
                _ if is_list => Data::Files(Vec::new()),
                _ => Data::Files(files(value).unwrap_or_else(|| vec![value.to_owned()])),
            });
            if !is_list {
                break;
            }
        }
    }
    let data = match data {
        Some(Data::Files(files)) if files.is_empty() => Data::Files(listed),
        Some(data) => data,
        None => {
            let problem = "the header has no `ElementDataFile`, with which it ends";
            return Err(Error::format(name, Place::Whole, problem, "the file was cut short: copy or export it again"));
        }
    };
    layout(&fields, data)
}

/// The files of `pattern first last step`.
fn files(value: &str) -> Option<Vec<String>> {
    let words: Vec<&str> = value.split_whitespace().collect();
    let [pattern, first, last, step] = words[..] else { return None };
    numbered(pattern, first.parse().ok()?, last.parse().ok()?, step.parse().ok()?)
}

fn layout(fields: &Fields<'_>, data: Data) -> Result<Layout> {
    let sizes = fields.require("dimsize")?;
    let mut size = fields.counts(sizes)?;
    let dimensions = match fields.find(&["ndims"]) {
        Some(field) => fields.counts(field)?[0] as usize,
        None => size.len(),
    };
    if size.len() != dimensions || !(2..=4).contains(&dimensions) || size[3.min(dimensions)..].iter().any(|&n| n != 1) {
        let problem = format!("expected the size of a volume in {dimensions} dimensions");
        return Err(fields.error(sizes, &problem));
    }
    size.resize(3, 1);
    let of = |field: &Field, default: f64| -> Result<DVec3> {
        let mut numbers = fields.numbers(field, dimensions)?;
        numbers.resize(3, default);
        Ok(DVec3::new(numbers[0], numbers[1], numbers[2]))
    };
    let spacing = fields.find(&["elementspacing", "elementsize"]).map_or(Ok(DVec3::ONE), |field| of(field, 1.0))?;
    let origin = fields.find(&["offset", "position", "origin"]).map_or(Ok(DVec3::ZERO), |field| of(field, 0.0))?;
    let directions = match fields.find(&["transformmatrix", "rotation", "orientation"]) {
        Some(field) => {
            let numbers = fields.numbers(field, dimensions * dimensions)?;
            let mut matrix = DMat3::IDENTITY;
            for axis in 0..dimensions.min(3) {
                for c in 0..dimensions.min(3) {
                    matrix.col_mut(axis)[c] = numbers[axis * dimensions + c];
                }
            }
            matrix
        }
        None => DMat3::IDENTITY,
    };
    let element = fields.require("elementtype")?;
    let kind = match element.value.to_ascii_uppercase().trim_end_matches("_ARRAY") {
        "MET_UCHAR" => SampleKind::U8,
        "MET_CHAR" | "MET_ASCII_CHAR" => SampleKind::I8,
        "MET_USHORT" => SampleKind::U16,
        "MET_SHORT" => SampleKind::I16,
        "MET_UINT" | "MET_ULONG" => SampleKind::U32,
        "MET_INT" | "MET_LONG" => SampleKind::I32,
        "MET_ULONG_LONG" => SampleKind::U64,
        "MET_LONG_LONG" => SampleKind::I64,
        "MET_FLOAT" => SampleKind::F32,
        "MET_DOUBLE" => SampleKind::F64,
        _ => return Err(fields.error(element, "expected a type of number such as MET_UCHAR")),
    };
    let is_true = |keys: &[&str], default: bool| {
        fields.find(keys).map_or(default, |field| matches!(field.value.as_bytes().first(), Some(b'T' | b't' | b'1')))
    };
    let is_packed = is_true(&["compresseddata"], false);
    let coding = match is_true(&["binarydata"], true) {
        _ if is_packed => Coding::Zlib,
        true => Coding::Raw,
        false => Coding::Text,
    };
    let is_big = is_true(&["elementbyteordermsb", "binarydatabyteordermsb"], false);
    let skip = match fields.find(&["headersize"]) {
        Some(field) if field.value == "-1" => Skip::FromEnd,
        Some(field) => Skip::Ahead { lines: 0, bytes: fields.counts(field)?[0] },
        None => Skip::NOTHING,
    };
    let channels = fields.find(&["elementnumberofchannels"]).map_or(Ok(1), |f| fields.counts(f).map(|n| n[0]))?;
    Ok(Layout {
        size: [size[0], size[1], size[2]],
        placement: Placement { origin, axes: directions * DMat3::from_diagonal(spacing) },
        kind,
        order: if is_big { ByteOrder::Big } else { ByteOrder::Little },
        channels,
        coding,
        data,
        skip,
        scale: None,
    })
}
