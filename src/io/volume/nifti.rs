//! `NIfTI-1` (`NIfTI` Data Format Working Group, 2005): 348 bytes of header in either byte order, then the data, in one file (`.nii`) or in an
//! image file beside it (`.hdr` and `.img`).
//!
//! The lattice lies where the sform says, where there is none, where the qform says, else at the origin: methods 3, 2 and 1 of the standard.
//! Slope and intercept are applied. Coordinates stay in the units of the file, x to the right, y to the front, z up.
//!
//! It needs no crate: the header is a dozen numbers at fixed places.

use super::layout::{Coding, Data, Layout, Skip};
use super::samples::{ByteOrder, SampleKind};
use crate::error::{Error, Place, Result};
use crate::volume::Placement;
use glam::{DMat3, DQuat, DVec3};
use std::path::Path;

/// Bytes of a header: the number that it begins with.
const HEADER: usize = 348;

/// The byte order of a file that begins as `NIfTI` files do.
fn order(head: &[u8]) -> Option<ByteOrder> {
    let first: [u8; 4] = *head.first_chunk()?;
    let order = [ByteOrder::Little, ByteOrder::Big].into_iter().find(|&order| {
        let size = if order == ByteOrder::Little { i32::from_le_bytes(first) } else { i32::from_be_bytes(first) };
        size == HEADER as i32
    })?;
    matches!(head.get(344..HEADER)?, b"n+1\0" | b"ni1\0").then_some(order)
}

pub(super) fn is_nifti(head: &[u8]) -> bool {
    order(head).is_some()
}

/// A header in its byte order.
struct Header<'a> {
    bytes: &'a [u8],
    order: ByteOrder,
}

impl Header<'_> {
    fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.bytes[at..at + N]);
        if self.order == ByteOrder::Big {
            bytes.reverse();
        }
        bytes
    }

    fn short(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.array(at))
    }

    fn float(&self, at: usize) -> f64 {
        f32::from_le_bytes(self.array(at)).into()
    }

    fn floats<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| self.float(at + 4 * i))
    }
}

/// Reads a header; `name` also tells the image file beside it.
pub(super) fn parse(name: &str, head: &[u8]) -> Result<Layout> {
    let fail = |at: u64, problem: String, remedy: &str| Err(Error::format(name, Place::Byte(at), problem, remedy));
    let (Some(order), Some(bytes)) = (order(head), head.get(..HEADER)) else {
        return fail(0, "this is no header of NIfTI-1".to_owned(), "convert the file to .nii");
    };
    let header = Header { bytes, order };
    let dimensions = header.short(40);
    let sizes: Vec<i16> =
        (1..=7).map(|i| if i <= dimensions { header.short(40 + 2 * i as usize) } else { 1 }).collect();
    if !(1..=7).contains(&dimensions) || sizes.iter().any(|&n| n < 1) {
        return fail(40, format!("{dimensions} dimensions of the sizes {sizes:?} are none"), "export the file again");
    }
    if sizes[3..].iter().any(|&n| n != 1) {
        let problem = format!("there are several volumes in the file: {dimensions} dimensions of the sizes {sizes:?}");
        return fail(40, problem, "split it and take one of them");
    }
    let kind = match header.short(70) {
        2 => SampleKind::U8,
        4 => SampleKind::I16,
        8 => SampleKind::I32,
        16 => SampleKind::F32,
        64 => SampleKind::F64,
        256 => SampleKind::I8,
        512 => SampleKind::U16,
        768 => SampleKind::U32,
        1024 => SampleKind::I64,
        1280 => SampleKind::U64,
        other => {
            let problem = format!("the datatype {other} is none of real numbers with up to 64 bits");
            return fail(70, problem, "convert the file to float32");
        }
    };
    let start = header.float(108);
    let data = if &bytes[344..] == b"n+1\0" {
        if !(start >= HEADER as f64 && start < 1e15) {
            return fail(108, format!("the data cannot begin at byte {start}"), "export the file again");
        }
        Data::Here(start as u64)
    } else {
        let image = Path::new(name).with_extension("img");
        Data::Files(image.file_name().map(|name| name.to_string_lossy().into_owned()).into_iter().collect())
    };
    let scale = [header.float(112), header.float(116)];
    Ok(Layout {
        size: [0, 1, 2].map(|a| sizes[a] as u64),
        placement: placement(&header),
        kind,
        order,
        channels: 1,
        coding: Coding::Raw,
        data,
        skip: Skip::NOTHING,
        scale: scale.iter().all(|n| n.is_finite()).then_some(scale),
    })
}

fn placement(header: &Header<'_>) -> Placement {
    let [factor, x, y, z] = header.floats::<4>(76);
    if header.short(254) > 0 {
        let rows = [280, 296, 312].map(|at| header.floats::<4>(at));
        let column = |i: usize| DVec3::new(rows[0][i], rows[1][i], rows[2][i]);
        return Placement { origin: column(3), axes: DMat3::from_cols(column(0), column(1), column(2)) };
    }
    // Samples that are said to be nowhere apart are one unit apart.
    let spacing = DVec3::from([x, y, z].map(|step| if step.abs() > 0.0 { step.abs() } else { 1.0 }));
    if header.short(252) <= 0 {
        return Placement::with_spacing(DVec3::ZERO, spacing);
    }
    let [b, c, d] = header.floats::<3>(256);
    let a = (1.0 - (b * b + c * c + d * d)).max(0.0).sqrt();
    let turn = DMat3::from_quat(DQuat::from_xyzw(b, c, d, a).normalize());
    let flip = if factor < 0.0 { -1.0 } else { 1.0 };
    let axes = turn * DMat3::from_diagonal(spacing * DVec3::new(1.0, 1.0, flip));
    Placement { origin: header.floats::<3>(268).into(), axes }
}
