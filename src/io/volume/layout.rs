//! What the header of a volume file says of its data, and the data themselves, once for all formats that have a header and then samples in a
//! row.
//!
//! The parsers of the formats turn headers into a [`Layout`]; [`Layout::load`] checks that so many samples can be in so many bytes before anything
//! is allocated, and streams the samples from the file into their final place: nothing is held twice. Deflate packs 1032 bytes into one at
//! best (two bits for the longest match, 258 bytes), so a packed file bounds the volume, too.

use super::samples::{ByteOrder, Failure, SampleKind, Samples, fill};
use crate::error::{Error, Place, Result};
use crate::progress::{Progress, Stage};
use crate::volume::{Image, Placement, Voxels};
use rayon::prelude::*;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Take};
use std::path::{Path, PathBuf};

/// The most numbers that may stand together for each sample.
const MOST_CHANNELS: u64 = 4096;

/// How the bytes of samples are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    Raw,
    Text,
    Hex,
    Zlib,
    Gzip,
}

/// Where the data are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Data {
    /// In the same file, from this byte on.
    Here(u64),
    /// In files beside it, one after the other.
    Files(Vec<String>),
}

/// What stands before the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Skip {
    /// So many lines and then so many bytes.
    Ahead { lines: u64, bytes: u64 },
    /// Whatever there is: the data end where the file does.
    FromEnd,
}

impl Skip {
    pub(super) const NOTHING: Skip = Skip::Ahead { lines: 0, bytes: 0 };
}

/// What a header says.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub(super) size: [u64; 3],
    pub(super) placement: Placement,
    pub(super) kind: SampleKind,
    pub(super) order: ByteOrder,
    pub(super) channels: u64,
    pub(super) coding: Coding,
    pub(super) data: Data,
    pub(super) skip: Skip,
    /// Factor and summand that make values of samples, if they are not the values already.
    pub(super) scale: Option<[f64; 2]>,
}

/// A file that is being read: the first bytes, which hold the header, and the others.
pub(super) struct Source<'a> {
    /// For messages.
    pub(super) name: &'a str,
    /// Where files beside it are, unless it is no file itself.
    pub(super) folder: Option<&'a Path>,
    pub(super) head: &'a [u8],
    pub(super) rest: &'a mut dyn Read,
    /// Bytes in all; where the file is packed as a whole, the most that there can be.
    pub(super) len: u64,
    pub(super) is_packed: bool,
}

/// The most bytes that so many deflated bytes unpack to.
pub(super) fn most_unpacked(bytes: u64) -> u64 {
    bytes.saturating_mul(1032).saturating_add(1 << 10)
}

/// The number of samples, where that can be in a file at all.
pub(super) fn checked_count(name: &str, size: [u64; 3]) -> Result<usize> {
    let count = size.iter().try_fold(1u64, |count, &n| count.checked_mul(n));
    count.filter(|&count| (1..1 << 48).contains(&count)).and_then(|count| usize::try_from(count).ok()).ok_or_else(
        || {
            let [x, y, z] = size;
            let problem = format!("the size {x} x {y} x {z} is none that a volume can have");
            Error::format(name, Place::Whole, problem, "correct the size in the header")
        },
    )
}

/// The channel that is taken of so many.
pub(super) fn checked_channel(name: &str, channels: u64, asked: Option<usize>) -> Result<usize> {
    match asked {
        Some(channel) if (channel as u64) < channels => Ok(channel),
        None if channels == 1 => Ok(0),
        Some(channel) => {
            let problem = format!("there is no channel {channel}: samples have {channels}");
            Err(Error::format(name, Place::Whole, problem, "channels count from 0"))
        }
        None => {
            let problem = format!("each sample has {channels} numbers");
            Err(Error::format(name, Place::Whole, problem, "say which one is meant: --channel 0 is the first"))
        }
    }
}

impl Layout {
    /// Reads the data. Returns the volume and how many bytes follow behind, where that is known.
    pub(super) fn load(
        &self,
        source: Source<'_>,
        channel: Option<usize>,
        progress: &dyn Progress,
    ) -> Result<(Image, u64)> {
        let name = source.name;
        let count = checked_count(name, self.size)?;
        self.placement.check().map_err(|e| Error::format(name, Place::Whole, e.to_string(), ""))?;
        if !(1..=MOST_CHANNELS).contains(&self.channels) {
            let problem = format!("{} numbers for each sample are not 1 to {MOST_CHANNELS}", self.channels);
            return Err(Error::format(name, Place::Whole, problem, "correct the header"));
        }
        let channel = checked_channel(name, self.channels, channel)?;
        let samples = Samples { kind: self.kind, order: self.order, channels: self.channels as usize, channel, count };
        let needed = samples.bytes().ok_or_else(|| self.too_short(name, u64::MAX, source.len))?;
        progress.begin(Stage::Read, needed);
        let (voxels, trailing) = match &self.data {
            Data::Here(offset) => {
                let (head, offset) = (source.head, *offset);
                let in_head = (head.len() as u64).min(offset);
                skip_bytes(source.rest, offset - in_head).map_err(|e| Error::io(name, "read", e))?;
                let mut reader = head[in_head as usize..].chain(source.rest);
                let available = source.len.saturating_sub(offset);
                self.voxels(name, &mut reader, available, source.is_packed, &samples, needed, progress)?
            }
            Data::Files(names) => {
                let mut parts = Parts::open(name, source.folder, names, self.skip, needed)?;
                let (name, len) = (parts.name(), parts.len);
                let inner = Layout { skip: parts.left_to_skip(self.skip), ..self.clone() };
                inner.voxels(&name, &mut parts, len, false, &samples, needed, progress)?
            }
        };
        let voxels = match self.scale {
            Some([slope, intercept]) if slope != 0.0 && [slope, intercept] != [1.0, 0.0] => {
                scaled(&voxels, slope, intercept)
            }
            _ => voxels,
        };
        let image = Image::new(self.size.map(|n| n as usize), self.placement, voxels);
        Ok((image.map_err(|e| Error::format(name, Place::Whole, e.to_string(), ""))?, trailing))
    }

    #[expect(clippy::too_many_arguments, reason = "where the data are, and what they are")]
    fn voxels(
        &self,
        name: &str,
        reader: &mut dyn Read,
        available: u64,
        is_packed: bool,
        samples: &Samples,
        needed: u64,
        progress: &dyn Progress,
    ) -> Result<(Voxels, u64)> {
        // At the best, a sample of a text is a digit and a blank.
        let numbers = samples.count as u64 * self.channels;
        let (least, most) = match self.coding {
            Coding::Raw => (needed, available),
            Coding::Text => (2 * numbers - 1, available),
            Coding::Hex => (2 * needed, available),
            Coding::Zlib | Coding::Gzip => (needed, most_unpacked(available)),
        };
        let skipped = match self.skip {
            Skip::Ahead { lines, bytes } => lines.saturating_add(bytes),
            Skip::FromEnd => 0,
        };
        if least > most.saturating_sub(if self.coding == Coding::Gzip { 0 } else { skipped }) {
            return Err(self.too_short(name, needed, available));
        }
        match self.skip {
            Skip::NOTHING => {}
            // In NRRD, bytes are skipped in what was packed.
            Skip::Ahead { bytes, .. } if self.coding == Coding::Gzip && bytes > 0 => {}
            Skip::Ahead { lines, bytes } => {
                skip_lines(reader, lines).map_err(|e| Error::io(name, "read", e))?;
                skip_bytes(reader, bytes).map_err(|e| Error::io(name, "read", e))?;
            }
            Skip::FromEnd if is_packed || self.coding != Coding::Raw => {
                let problem = "the data are said to end where the file does, but they are packed";
                return Err(Error::format(name, Place::Whole, problem, "write the file again, with the header before"));
            }
            Skip::FromEnd => {
                skip_bytes(reader, available - needed).map_err(|e| Error::io(name, "read", e))?;
            }
        }
        let ends = |failure| self.failed(name, failure, needed);
        let voxels = match self.coding {
            Coding::Raw => samples.read(reader, progress).map_err(ends)?,
            Coding::Text | Coding::Hex => {
                let mut text = Vec::new();
                reader.take(available).read_to_end(&mut text).map_err(|e| Error::io(name, "read", e))?;
                if self.coding == Coding::Text {
                    samples.parse(&text, progress).map_err(ends)?
                } else {
                    samples.read(&mut Hex { text: &text }, progress).map_err(ends)?
                }
            }
            Coding::Zlib | Coding::Gzip => self.unpacked(name, reader, samples, progress)?,
        };
        let is_known = self.coding == Coding::Raw && !is_packed && self.skip != Skip::FromEnd;
        Ok((voxels, if is_known { available - skipped.min(available) - needed } else { 0 }))
    }

    #[cfg(feature = "volumes")]
    fn unpacked(
        &self,
        name: &str,
        reader: &mut dyn Read,
        samples: &Samples,
        progress: &dyn Progress,
    ) -> Result<Voxels> {
        let packed = std::io::BufReader::with_capacity(1 << 16, reader);
        let mut unpacked: Box<dyn Read + '_> = if self.coding == Coding::Zlib {
            Box::new(flate2::bufread::ZlibDecoder::new(packed))
        } else {
            Box::new(flate2::bufread::MultiGzDecoder::new(packed))
        };
        let needed = samples.bytes().unwrap_or(u64::MAX);
        if let Skip::Ahead { bytes, .. } = self.skip {
            skip_bytes(&mut *unpacked, if self.coding == Coding::Gzip { bytes } else { 0 })
                .map_err(|e| self.failed(name, Failure::Io(e), needed))?;
        }
        samples.read(&mut *unpacked, progress).map_err(|failure| self.failed(name, failure, needed))
    }

    #[cfg(not(feature = "volumes"))]
    fn unpacked(&self, name: &str, _: &mut dyn Read, _: &Samples, _: &dyn Progress) -> Result<Voxels> {
        Err(super::not_built(name, "packed volumes"))
    }

    #[cold]
    fn failed(&self, name: &str, failure: Failure, needed: u64) -> Error {
        match failure {
            Failure::Ends(samples) => {
                let each = self.kind.bytes() as u64 * self.channels;
                self.too_short(name, needed, samples as u64 * each)
            }
            other => other.into_error(name),
        }
    }

    #[cold]
    fn too_short(&self, name: &str, needed: u64, available: u64) -> Error {
        let [x, y, z] = self.size;
        let kind = self.kind.name();
        let channels = if self.channels == 1 { String::new() } else { format!(" with {} channels", self.channels) };
        let packed = matches!(self.coding, Coding::Zlib | Coding::Gzip);
        let there = if packed { "packed, and no more than" } else { "and there are only" };
        let problem = format!(
            "{x} x {y} x {z} samples of the type {kind}{channels} take {needed} bytes, {there} {available} bytes of data"
        );
        Error::format(
            name,
            Place::Whole,
            problem,
            "the file is cut short, or its size or type is wrong: copy it again or correct the header",
        )
    }
}

impl Failure {
    /// What went wrong in a file.
    #[cold]
    pub(super) fn into_error(self, name: &str) -> Error {
        match self {
            Failure::Refused(error) => error,
            Failure::Io(e)
                if matches!(e.kind(), std::io::ErrorKind::InvalidInput | std::io::ErrorKind::InvalidData) =>
            {
                let problem = format!("the packed data are damaged ({e})");
                Error::format(name, Place::Whole, problem, "copy or export the file again")
            }
            Failure::Io(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
                let problem = "the packed data end too soon";
                Error::format(name, Place::Whole, problem, "the file was cut short: copy or export it again")
            }
            Failure::Io(e) => Error::io(name, "read", e),
            Failure::Ends(samples) => {
                let problem = format!("the data end after {samples} samples");
                Error::format(name, Place::Whole, problem, "the file was cut short: copy or export it again")
            }
            Failure::Text { position, problem } => {
                let problem = format!("{problem}, at byte {position} of the data");
                Error::format(name, Place::Whole, problem, "correct it or export the file again")
            }
        }
    }
}

/// Values of samples.
fn scaled(voxels: &Voxels, slope: f64, intercept: f64) -> Voxels {
    let value = |i: usize| voxels.value(i) * slope + intercept;
    match voxels {
        Voxels::U8(_) | Voxels::I8(_) | Voxels::U16(_) | Voxels::I16(_) | Voxels::F32(_) => {
            Voxels::F32((0..voxels.len()).into_par_iter().map(|i| value(i) as f32).collect())
        }
        Voxels::U32(_) | Voxels::I32(_) | Voxels::F64(_) => {
            Voxels::F64((0..voxels.len()).into_par_iter().map(value).collect())
        }
    }
}

fn skip_bytes(reader: &mut dyn Read, count: u64) -> std::io::Result<()> {
    std::io::copy(&mut reader.take(count), &mut std::io::sink()).map(|_| ())
}

fn skip_lines(reader: &mut dyn Read, lines: u64) -> std::io::Result<()> {
    let mut byte = [0];
    for _ in 0..lines {
        while byte != *b"\n" {
            if fill(reader, &mut byte)? == 0 {
                return Ok(());
            }
        }
        byte = [0];
    }
    Ok(())
}

/// Bytes written as two hexadecimal digits each; blanks do not count.
struct Hex<'a> {
    text: &'a [u8],
}

impl Read for Hex<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut count = 0;
        for out in buffer {
            let mut digits = self.text.iter().enumerate().filter(|(_, b)| **b > b' ');
            let (Some((_, &high)), Some((end, &low))) = (digits.next(), digits.next()) else { break };
            let [high, low] = [high, low].map(|b| char::from(b).to_digit(16));
            let (Some(high), Some(low)) = (high, low) else {
                return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, "not a hexadecimal digit"));
            };
            *out = (16 * high + low) as u8;
            self.text = &self.text[end + 1..];
            count += 1;
        }
        Ok(count)
    }
}

/// Data files, one after the other, each opened when it is its turn.
struct Parts {
    paths: Vec<PathBuf>,
    /// Where there are several: where the data of each begin, and how many bytes they are.
    ranges: Vec<(u64, u64)>,
    next: usize,
    file: Option<Take<File>>,
    /// Bytes of all together.
    len: u64,
}

impl Parts {
    /// Finds the files that a header names, beside it.
    fn open(name: &str, folder: Option<&Path>, names: &[String], skip: Skip, needed: u64) -> Result<Parts> {
        let Some(folder) = folder else {
            let problem = "the data are in another file, and there is no folder to look for it";
            return Err(Error::format(name, Place::Whole, problem, "read it as a file, by its path"));
        };
        if names.is_empty() {
            return Err(Error::format(name, Place::Whole, "the list of data files is empty", "export the file again"));
        }
        let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
        let mut parts = Parts { paths, ranges: Vec::new(), next: 0, file: None, len: 0 };
        let each = needed / names.len() as u64;
        for path in &parts.paths.clone() {
            let metadata = std::fs::metadata(path).map_err(|e| {
                let problem = format!("the data are said to be in {}, which cannot be read ({e})", path.display());
                Error::format(name, Place::Whole, problem, "put that file there, or correct the header")
            })?;
            if !metadata.is_file() {
                let problem = format!("the data are said to be in {}, which is no file", path.display());
                return Err(Error::format(name, Place::Whole, problem, "correct the header"));
            }
            let len = metadata.len();
            if names.len() == 1 {
                parts.len = len;
                break;
            }
            let before = match skip {
                Skip::Ahead { bytes, .. } => bytes,
                Skip::FromEnd => len.saturating_sub(each),
            };
            if len < before.saturating_add(each) {
                let problem = format!("has {len} bytes, but {each} of data should be in each of {} files", names.len());
                return Err(Error::format(path.display().to_string(), Place::Whole, problem, "copy it again"));
            }
            parts.ranges.push((before, each));
            parts.len += each;
        }
        Ok(parts)
    }

    /// What the caller has to skip: of a single file, everything.
    fn left_to_skip(&self, skip: Skip) -> Skip {
        match skip {
            _ if self.paths.len() == 1 => skip,
            _ => Skip::NOTHING,
        }
    }

    /// For messages.
    fn name(&self) -> String {
        let first = self.paths.first().map_or(String::new(), |path| path.display().to_string());
        if self.paths.len() > 1 { format!("{first} and {} more files", self.paths.len() - 1) } else { first }
    }
}

impl Read for Parts {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            if let Some(file) = &mut self.file {
                let count = file.read(buffer)?;
                if count > 0 || buffer.is_empty() {
                    return Ok(count);
                }
            }
            let Some(path) = self.paths.get(self.next) else { return Ok(0) };
            let mut file = File::open(path)?;
            let (start, len) = self.ranges.get(self.next).copied().unwrap_or((0, u64::MAX));
            file.seek(SeekFrom::Start(start))?;
            self.file = Some(file.take(len));
            self.next += 1;
        }
    }
}
