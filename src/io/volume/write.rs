//! Volumes into files: `MetaImage` and NRRD, in one file, with plain little-endian samples.

use super::VolumeFormat;
use crate::error::{Error, Place, Result};
use crate::io::file::AtomicFile;
use crate::progress::{Progress, Stage, check};
use crate::volume::image::with_samples;
use crate::volume::{Image, Voxels};
use glam::DVec3;
use std::path::Path;

/// Samples written at a time.
const PIECE: usize = 1 << 16;

/// Writes a volume as the name says, `.mha` or `.nrrd`, and returns the size of the file. It is read again as it was, with its placement. The file
/// appears when it is complete.
///
/// # Errors
/// When the name says another format, or none; when the file cannot be written; and `Cancelled`.
pub fn write_volume(path: impl AsRef<Path>, image: &Image, progress: &dyn Progress) -> Result<u64> {
    let path = path.as_ref();
    let header = match VolumeFormat::from_path(path) {
        Some(VolumeFormat::MetaImage) if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mhd")) => {
            meta(image)
        }
        Some(VolumeFormat::Nrrd) if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("nhdr")) => nrrd(image),
        _ => {
            let problem = "the name says no format in which volumes are written";
            let remedy = "give it a name that ends in .mha or .nrrd";
            return Err(Error::format(path.display().to_string(), Place::Whole, problem, remedy));
        }
    };
    let mut file = AtomicFile::create(path)?;
    file.write(header.as_bytes())?;
    progress.begin(Stage::Write, image.voxels().bytes() as u64);
    let mut buffer = Vec::new();
    with_samples!(image.voxels(), samples => {
        for piece in samples.chunks(PIECE) {
            check(progress)?;
            buffer.clear();
            piece.iter().for_each(|sample| buffer.extend_from_slice(&sample.to_le_bytes()));
            file.write(&buffer)?;
            progress.advance(buffer.len() as u64);
        }
    });
    file.commit()?;
    Ok((header.len() + image.voxels().bytes()) as u64)
}

/// Numbers with blanks between them, in the shortest way that is read again as they were.
fn words(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(|n| n.to_string()).collect::<Vec<_>>().join(" ")
}

fn sizes(image: &Image) -> String {
    image.size().map(|n| n.to_string()).join(" ")
}

fn meta(image: &Image) -> String {
    let placement = image.placement();
    let spacing = placement.spacing();
    let directions = [0, 1, 2].map(|a| placement.axes.col(a) / spacing[a]);
    let kind = match image.voxels() {
        Voxels::U8(_) => "MET_UCHAR",
        Voxels::I8(_) => "MET_CHAR",
        Voxels::U16(_) => "MET_USHORT",
        Voxels::I16(_) => "MET_SHORT",
        Voxels::U32(_) => "MET_UINT",
        Voxels::I32(_) => "MET_INT",
        Voxels::F32(_) => "MET_FLOAT",
        Voxels::F64(_) => "MET_DOUBLE",
    };
    format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n\
         TransformMatrix = {}\nOffset = {}\nElementSpacing = {}\nDimSize = {}\nElementType = {kind}\nElementDataFile = LOCAL\n",
        words(directions.iter().flat_map(DVec3::to_array)),
        words(placement.origin.to_array()),
        words(spacing.to_array()),
        sizes(image),
    )
}

fn nrrd(image: &Image) -> String {
    let placement = image.placement();
    let vector = |v: DVec3| format!("({})", v.to_array().map(|n| n.to_string()).join(","));
    let kind = match image.voxels() {
        Voxels::U8(_) => "uint8",
        Voxels::I8(_) => "int8",
        Voxels::U16(_) => "uint16",
        Voxels::I16(_) => "int16",
        Voxels::U32(_) => "uint32",
        Voxels::I32(_) => "int32",
        Voxels::F32(_) => "float",
        Voxels::F64(_) => "double",
    };
    format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nspace dimension: 3\nsizes: {}\nspace directions: {}\nkinds: domain domain domain\n\
         endian: little\nencoding: raw\nspace origin: {}\n\n",
        sizes(image),
        [0, 1, 2].map(|a| vector(placement.axes.col(a))).join(" "),
        vector(placement.origin),
    )
}
