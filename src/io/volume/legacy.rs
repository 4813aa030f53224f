//! The older VTK format (`.vtk`) with `DATASET STRUCTURED_POINTS`: lines of text, and the samples as text or as big-endian numbers.
//!
//! The first array is read, be it of points or of cells; other kinds of data sets are refused.

use super::fields::{Field, Fields, lines};
use super::layout::{Coding, Data, Layout, Skip};
use super::samples::{ByteOrder, SampleKind};
use crate::error::{Error, Place, Result};
use crate::volume::Placement;
use glam::{DMat3, DVec3};

const MAGIC: &[u8] = b"# vtk DataFile Version";

pub(super) fn is_legacy(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// Reads a header.
pub(super) fn parse(name: &str, head: &[u8]) -> Result<Layout> {
    let mut fields = Fields::new(name);
    let mut array = None;
    let mut data = None;
    for (number, line, next) in lines(head).skip(2) {
        let line = String::from_utf8_lossy(line);
        let line = line.trim();
        // The line before the data: of scalars the one that names a table, or the one that follows in its place.
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let key = key.to_ascii_lowercase();
        if array.is_some() {
            if key != "lookup_table" {
                break;
            }
            data = Some(next as u64);
            break;
        }
        match key.as_str() {
            "scalars" => {
                array = Some(Field { key: key.clone(), value: value.trim().to_owned(), line: number });
                data = Some(next as u64);
            }
            "vectors" | "normals" | "tensors" | "texture_coordinates" | "field" | "color_scalars" => {
                let problem = format!("the first array of the file is {key}, not scalars");
                return Err(Error::format(name, Place::Line(number), problem, "save it as .vti"));
            }
            "" | "metadata" => {}
            _ => fields.push(&key, value, number),
        }
    }
    let dataset = fields.require("dataset")?;
    if !dataset.value.eq_ignore_ascii_case("STRUCTURED_POINTS") {
        return Err(fields.error(dataset, "only structured points are a volume: save it as image data"));
    }
    let (Some(array), Some(data)) = (array, data) else {
        return Err(Error::format(name, Place::Whole, "there are no scalars in the file", "export it again"));
    };
    layout(&fields, &array, data)
}

fn layout(fields: &Fields<'_>, array: &Field, data: u64) -> Result<Layout> {
    let sizes = fields.require("dimensions")?;
    let [x, y, z] = fields.counts(sizes)?[..] else { return Err(fields.error(sizes, "expected three sizes")) };
    let vector = |keys: &[&str], default: DVec3| match fields.find(keys) {
        Some(field) => fields.numbers(field, 3).map(|n| DVec3::new(n[0], n[1], n[2])),
        None => Ok(default),
    };
    let (origin, spacing) = (vector(&["origin"], DVec3::ZERO)?, vector(&["spacing", "aspect_ratio"], DVec3::ONE)?);
    let of_cells = fields.find(&["cell_data"]).is_some();
    let size = if of_cells { [x, y, z].map(|n| n.saturating_sub(1).max(1)) } else { [x, y, z] };
    let mut words = array.value.split_whitespace();
    let (kind, channels) = (words.nth(1).unwrap_or(""), words.next());
    let kind = match kind.to_ascii_lowercase().as_str() {
        "unsigned_char" => SampleKind::U8,
        "char" | "signed_char" => SampleKind::I8,
        "unsigned_short" => SampleKind::U16,
        "short" => SampleKind::I16,
        "unsigned_int" => SampleKind::U32,
        "int" => SampleKind::I32,
        "unsigned_long" | "vtktypeuint64" => SampleKind::U64,
        "long" | "vtkidtype" | "vtktypeint64" => SampleKind::I64,
        "float" => SampleKind::F32,
        "double" => SampleKind::F64,
        _ => return Err(fields.error(array, "expected a name and a type of number such as float")),
    };
    let channels =
        channels.map_or(Ok(1), str::parse).map_err(|_| fields.error(array, "expected a number of components"))?;
    let is_binary = fields.find(&["binary"]).is_some();
    Ok(Layout {
        size,
        placement: placed([0; 3], DMat3::IDENTITY, origin, spacing, of_cells.then_some([x, y, z])),
        kind,
        order: ByteOrder::Big,
        channels,
        coding: if is_binary { Coding::Raw } else { Coding::Text },
        data: Data::Here(data),
        skip: Skip::NOTHING,
        scale: None,
    })
}

/// Where the samples of VTK's images lie: the first one `extent` steps from the origin. Samples of cells lie in the middle between points, of which
/// there are so many.
pub(super) fn placed(
    extent: [i64; 3],
    directions: DMat3,
    origin: DVec3,
    spacing: DVec3,
    cells_of: Option<[u64; 3]>,
) -> Placement {
    // An axis with one point has no cells, but what lies there.
    let half = cells_of.map_or(DVec3::ZERO, |points| DVec3::from(points.map(|n| if n > 1 { 0.5 } else { 0.0 })));
    let placement = Placement { origin, axes: directions * DMat3::from_diagonal(spacing) };
    let first = DVec3::from(extent.map(|n| n as f64)) + half;
    Placement { origin: placement.to_model(first), ..placement }
}
