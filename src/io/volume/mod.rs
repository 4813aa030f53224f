//! Files of volumes: samples on a lattice, and where they lie.
//!
//! | format | names | what is read | written | needs |
//! |---|---|---|---|---|
//! | `MetaImage` | `.mha`, `.mhd` | binary and text, one file or several | `.mha` | |
//! | NRRD | `.nrrd`, `.nhdr` | raw, text, hex, one file or several | `.nrrd` | |
//! | NIfTI-1 | `.nii`, `.hdr` | single volumes | | |
//! | VTK, XML | `.vti` | text, binary, appended; one piece | | feature `volumes` |
//! | VTK, older | `.vtk` | structured points, the first scalars | | |
//! | SLC | `.slc` | all | | |
//! | raw | any | as [`RawLayout`] says | | |
//!
//! With the feature `volumes`, packed data are read in all of them, and files that are packed as a whole (`.nii.gz`).
//!
//! The content says the format. Headers are parsed from the first megabyte into a layout of the data, and the data streamed from
//! the file into the volume, so nothing is held twice (but for VTI and SLC, whose files are held while they are read). No more is
//! allocated than the file can hold, packed as it may be. Integers of 64 bits become 32 bits where all samples fit, else doubles. Where a sample is
//! several numbers, somebody must say which one is meant.

mod fields;
mod layout;
mod legacy;
mod metaimage;
mod nifti;
mod nrrd;
mod raw;
mod samples;
mod slc;
#[cfg(test)]
mod tests;
#[cfg(feature = "volumes")]
mod vti;
mod write;

pub use raw::RawLayout;
pub use samples::{ByteOrder, SampleKind};
pub use write::write_volume;

use crate::error::{Error, Place, Result};
use crate::progress::Progress;
use crate::volume::Image;
use fields::LONGEST;
use layout::Source;
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A format of volume files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum VolumeFormat {
    /// `MetaImage`.
    MetaImage,
    /// NRRD.
    Nrrd,
    /// NIfTI-1.
    Nifti,
    /// VTK image data in XML. Needs the feature `volumes`.
    Vti,
    /// VTK structured points.
    Vtk,
    /// SLC of `VolVis`.
    Slc,
    /// Samples alone.
    Raw,
}

impl fmt::Display for VolumeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            VolumeFormat::MetaImage => "MetaImage",
            VolumeFormat::Nrrd => "NRRD",
            VolumeFormat::Nifti => "NIfTI",
            VolumeFormat::Vti => "VTI",
            VolumeFormat::Vtk => "VTK",
            VolumeFormat::Slc => "SLC",
            VolumeFormat::Raw => "raw",
        })
    }
}

impl VolumeFormat {
    /// The format that the end of a file's name says, in any letter case; `.gz` behind it does not matter.
    pub fn from_path(path: impl AsRef<Path>) -> Option<VolumeFormat> {
        let name = path.as_ref().file_name()?.to_str()?.to_ascii_lowercase();
        let name = name.strip_suffix(".gz").unwrap_or(&name);
        Some(match name.rsplit_once('.')?.1 {
            "mha" | "mhd" => VolumeFormat::MetaImage,
            "nrrd" | "nhdr" => VolumeFormat::Nrrd,
            "nii" | "hdr" => VolumeFormat::Nifti,
            "vti" => VolumeFormat::Vti,
            "vtk" => VolumeFormat::Vtk,
            "slc" => VolumeFormat::Slc,
            "raw" => VolumeFormat::Raw,
            _ => return None,
        })
    }

    /// The format that the content says.
    fn sniff(head: &[u8]) -> Option<VolumeFormat> {
        if nrrd::is_nrrd(head) {
            Some(VolumeFormat::Nrrd)
        } else if nifti::is_nifti(head) {
            Some(VolumeFormat::Nifti)
        } else if legacy::is_legacy(head) {
            Some(VolumeFormat::Vtk)
        } else if slc::is_slc(head) {
            Some(VolumeFormat::Slc)
        } else if is_vti(head) {
            Some(VolumeFormat::Vti)
        } else if metaimage::is_metaimage(head) {
            Some(VolumeFormat::MetaImage)
        } else {
            None
        }
    }

    /// The format of an existing file, if it is that of a volume: by its content, or by its name where it is packed or no file.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn of_file(path: impl AsRef<Path>) -> Result<Option<VolumeFormat>> {
        let path = path.as_ref();
        // What comes through a pipe can be read only once.
        if !path.is_file() {
            return Ok(VolumeFormat::from_path(path));
        }
        let mut head = Vec::new();
        let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
        file.take(1 << 12).read_to_end(&mut head).map_err(|e| Error::io(path, "read", e))?;
        let is_packed = head.starts_with(GZIP);
        Ok(VolumeFormat::sniff(&head).or_else(|| VolumeFormat::from_path(path).filter(|_| is_packed)))
    }
}

/// How packed files begin.
const GZIP: &[u8] = &[0x1f, 0x8b];

#[cfg(feature = "volumes")]
use vti::is_vti;

/// Without the feature, the name of the format is all that is known of it.
#[cfg(not(feature = "volumes"))]
fn is_vti(head: &[u8]) -> bool {
    let start = String::from_utf8_lossy(&head[..head.len().min(4096)]);
    start.contains("<VTKFile") && start.contains("ImageData")
}

/// The error for what this build cannot read.
#[cfg(not(feature = "volumes"))]
#[cold]
fn not_built(name: &str, what: &str) -> Error {
    let problem = format!("this build does not read {what}");
    Error::format(name, Place::Whole, problem, "build zmend with the feature `volumes`")
}

/// What to read of a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct VolumeOptions {
    /// The array to read where a file has several; the first one when not given.
    pub array: Option<String>,
    /// The number to read where each sample has several, from 0 on.
    pub channel: Option<usize>,
    /// What a file without a header holds.
    pub raw: Option<RawLayout>,
}

/// What was read of a file.
#[derive(Debug, Clone)]
pub struct VolumeFile {
    /// The volume.
    pub image: Image,
    /// What the file held.
    pub info: VolumeInfo,
}

/// What a file of a volume held.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VolumeInfo {
    /// What it was called.
    pub path: PathBuf,
    /// Its format.
    pub format: VolumeFormat,
    /// Its size, without that of files beside it; as far as it is known.
    pub bytes: u64,
    /// The array that was read, where arrays have names.
    pub array: Option<String>,
    /// All arrays that there are.
    pub arrays: Vec<String>,
    /// Bytes behind the samples, which were ignored.
    pub trailing_bytes: u64,
}

/// Reads a file. Files beside it that its header names are read, too.
///
/// Memory: the volume; for VTI and SLC the file beside it.
///
/// # Errors
/// When the file cannot be read, is of no known format, is malformed, or holds something else than one volume; and `Cancelled`.
pub fn read_volume(path: impl AsRef<Path>, options: &VolumeOptions, progress: &dyn Progress) -> Result<VolumeFile> {
    let path = path.as_ref();
    let io_error = |e| Error::io(path, "read", e);
    let mut file = File::open(path).map_err(io_error)?;
    let metadata = file.metadata().map_err(io_error)?;
    let name = path.display().to_string();
    let folder = path.parent().unwrap_or(Path::new(""));
    if metadata.is_file() {
        return read_from(&name, Some(folder), &mut file, metadata.len(), options, progress);
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(io_error)?;
    read_from(&name, Some(folder), &mut bytes.as_slice(), bytes.len() as u64, options, progress)
}

/// Reads the bytes of a file; `name` stands in error messages.
///
/// # Errors
/// As [`read_volume`], and when the data are in other files.
pub fn read_volume_bytes(
    name: &str,
    bytes: &[u8],
    options: &VolumeOptions,
    progress: &dyn Progress,
) -> Result<VolumeFile> {
    read_from(name, None, &mut &*bytes, bytes.len() as u64, options, progress)
}

fn read_from(
    name: &str,
    folder: Option<&Path>,
    reader: &mut dyn Read,
    len: u64,
    options: &VolumeOptions,
    progress: &dyn Progress,
) -> Result<VolumeFile> {
    let mut head = Vec::new();
    reader.take(LONGEST as u64).read_to_end(&mut head).map_err(|e| Error::io(name, "read", e))?;
    if head.starts_with(GZIP) && options.raw.is_none() {
        return read_packed(name, folder, &head, reader, len, options, progress);
    }
    read_plain(Source { name, folder, head: &head, rest: reader, len, is_packed: false }, len, options, progress)
}

/// Reads a file that is packed as a whole.
#[cfg(feature = "volumes")]
fn read_packed(
    name: &str,
    folder: Option<&Path>,
    packed: &[u8],
    reader: &mut dyn Read,
    len: u64,
    options: &VolumeOptions,
    progress: &dyn Progress,
) -> Result<VolumeFile> {
    let packed = std::io::BufReader::with_capacity(1 << 16, packed.chain(reader));
    let mut rest = flate2::bufread::MultiGzDecoder::new(packed);
    let mut head = Vec::new();
    let unpacked = (&mut rest).take(LONGEST as u64).read_to_end(&mut head);
    unpacked.map_err(|e| samples::Failure::Io(e).into_error(name))?;
    let source =
        Source { name, folder, head: &head, rest: &mut rest, len: layout::most_unpacked(len), is_packed: true };
    read_plain(source, len, options, progress)
}

#[cfg(not(feature = "volumes"))]
fn read_packed(
    name: &str,
    _: Option<&Path>,
    _: &[u8],
    _: &mut dyn Read,
    _: u64,
    _: &VolumeOptions,
    _: &dyn Progress,
) -> Result<VolumeFile> {
    Err(not_built(name, "packed files"))
}

/// Reads a file of `bytes` bytes.
fn read_plain(source: Source<'_>, bytes: u64, options: &VolumeOptions, progress: &dyn Progress) -> Result<VolumeFile> {
    let (name, head) = (source.name, source.head);
    if head.is_empty() {
        return Err(Error::format(name, Place::Whole, "the file is empty", "copy or export it again"));
    }
    let sniffed = VolumeFormat::sniff(head);
    let format = match (&options.raw, sniffed) {
        (Some(_), _) => VolumeFormat::Raw,
        (None, Some(format)) => format,
        (None, None) => return Err(unknown(name)),
    };
    if options.array.is_some() && format != VolumeFormat::Vti {
        let problem = format!("{name} is {format}, whose arrays have no names");
        return Err(Error::setting("array", problem, "leave this option away"));
    }
    let mut info = VolumeInfo { path: name.into(), format, bytes, array: None, arrays: Vec::new(), trailing_bytes: 0 };
    let layout = match (format, &options.raw) {
        (VolumeFormat::MetaImage, _) => metaimage::parse(name, head)?,
        (VolumeFormat::Nrrd, _) => nrrd::parse(name, head)?,
        (VolumeFormat::Nifti, _) => nifti::parse(name, head)?,
        (VolumeFormat::Vtk, _) => legacy::parse(name, head)?,
        (_, Some(raw)) => raw.layout(),
        _ => return read_whole(source, options, info, progress),
    };
    let (image, trailing) = layout.load(source, options.channel, progress)?;
    info.trailing_bytes = trailing;
    Ok(VolumeFile { image, info })
}

/// Reads a file whose format has no header before everything else.
fn read_whole(
    source: Source<'_>,
    options: &VolumeOptions,
    mut info: VolumeInfo,
    progress: &dyn Progress,
) -> Result<VolumeFile> {
    let Source { name, head, rest, len, .. } = source;
    let mut bytes = head.to_vec();
    rest.take(len).read_to_end(&mut bytes).map_err(|e| samples::Failure::Io(e).into_error(name))?;
    let image = if info.format == VolumeFormat::Slc {
        let (image, trailing) = slc::parse(name, &bytes, progress)?;
        info.trailing_bytes = trailing;
        image
    } else {
        xml(name, &bytes, options, &mut info, progress)?
    };
    Ok(VolumeFile { image, info })
}

#[cfg(feature = "volumes")]
fn xml(
    name: &str,
    bytes: &[u8],
    options: &VolumeOptions,
    info: &mut VolumeInfo,
    progress: &dyn Progress,
) -> Result<Image> {
    let (image, array, arrays) = vti::parse(name, bytes, options.array.as_deref(), options.channel, progress)?;
    (info.array, info.arrays) = (Some(array), arrays);
    Ok(image)
}

#[cfg(not(feature = "volumes"))]
fn xml(name: &str, _: &[u8], _: &VolumeOptions, _: &mut VolumeInfo, _: &dyn Progress) -> Result<Image> {
    Err(not_built(name, "VTI"))
}

#[cold]
fn unknown(name: &str) -> Error {
    let problem = "the content is that of no volume that is known here";
    let remedy = "MetaImage, NRRD, NIfTI, VTI, VTK and SLC are; of samples without a header say what they are: --raw 256x256x128:u16le";
    Error::format(name, Place::Whole, problem, remedy)
}
