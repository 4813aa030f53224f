//! VTK XML image data (`.vti`), of one piece.
//!
//! The numbers of an array are text, or binary: in base64 or as they are, in their place or in a block at the end of the file (`AppendedData`),
//! plain or in blocks packed by zlib. Binary data begin with sizes: plain ones with their number of bytes, packed ones with the number of
//! blocks, their size, that of the last one, and their sizes when packed. Sizes and data are encoded in base64 one after the other, each
//! filled up with `=`, so whoever decodes four letters at a time need not know where the one ends.

use super::layout::{checked_channel, checked_count, most_unpacked};
use super::legacy::placed;
use super::samples::{ByteOrder, Failure, SampleKind, Samples};
use crate::error::{Error, Place, Result};
use crate::progress::{Progress, Stage};
use crate::volume::{Image, Placement};
use glam::{DMat3, DVec3};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::io::{self, ErrorKind, Read};

/// Whether a file begins as VTK's XML files of images do.
pub(super) fn is_vti(head: &[u8]) -> bool {
    let start = &head[..head.len().min(4096)];
    let has = |word: &[u8]| start.windows(word.len()).any(|window| window == word);
    has(b"<VTKFile") && has(b"ImageData")
}

/// An array of numbers.
#[derive(Debug, Clone)]
struct Array {
    name: String,
    kind: SampleKind,
    channels: u64,
    is_of_cells: bool,
    is_text: bool,
    /// Where its content is: at a byte of the file, or so far behind the start of the appended data.
    start: Start,
    is_active: bool,
}

#[derive(Debug, Clone, Copy)]
enum Start {
    Inline(usize),
    Appended(u64),
}

/// What the tags of a file say.
#[derive(Debug, Default)]
struct Document {
    order: ByteOrder,
    /// Bytes of a size: 4 or 8.
    word: usize,
    is_packed: bool,
    /// The first and last point along each axis.
    extent: [[i64; 2]; 3],
    origin: DVec3,
    spacing: DVec3,
    directions: DMat3,
    arrays: Vec<Array>,
    /// Where the appended data begin, and whether they are base64.
    appended: Option<(usize, bool)>,
}

/// Reads a file: the array of that name, else the one that is marked as its scalars, else the first one of points, else of cells. Returns the
/// volume, the array's name and those of all arrays.
pub(super) fn parse(
    name: &str,
    bytes: &[u8],
    array: Option<&str>,
    channel: Option<usize>,
    progress: &dyn Progress,
) -> Result<(Image, String, Vec<String>)> {
    let document = Document::parse(name, bytes)?;
    let fail = |problem: String, remedy: &str| Error::format(name, Place::Whole, problem, remedy);
    let names: Vec<String> = document.arrays.iter().map(|array| array.name.clone()).collect();
    let chosen = match array {
        Some(wanted) => document.arrays.iter().find(|array| array.name == wanted),
        None => document.arrays.iter().min_by_key(|array| (array.is_of_cells, !array.is_active)),
    };
    let Some(array) = chosen else {
        let known =
            if names.is_empty() { "there is none".to_owned() } else { format!("there are: {}", names.join(", ")) };
        return Err(fail(format!("there is no array {} of numbers in the file", array.unwrap_or("")), &known));
    };
    let points = document.extent.map(|[first, last]| (last.saturating_sub(first) as u64).saturating_add(1));
    let size = if array.is_of_cells { points.map(|n| (n - 1).max(1)) } else { points };
    let count = checked_count(name, size)?;
    if array.channels > 4096 {
        return Err(fail(format!("{} components are too many", array.channels), "export the file again"));
    }
    let channel = checked_channel(name, array.channels, channel)?;
    let samples =
        Samples { kind: array.kind, order: document.order, channels: array.channels as usize, channel, count };
    let content = document.content(name, bytes, array)?;
    let needed = samples.bytes().unwrap_or(u64::MAX);
    let most = if array.is_text { content.0.len() as u64 / 2 + 1 } else { content.most(document.is_packed) };
    let least = if array.is_text { count as u64 * array.channels } else { needed };
    if least > most {
        let [x, y, z] = size;
        let problem =
            format!("array {}: {x} x {y} x {z} samples cannot be in its {} bytes", array.name, content.0.len());
        return Err(fail(problem, "the file was cut short: copy or export it again"));
    }
    progress.begin(Stage::Read, needed);
    let voxels = if array.is_text {
        samples.parse(content.0, progress)
    } else {
        document.open(&content).map_err(Failure::Io).and_then(|mut stream| samples.read(&mut *stream, progress))
    };
    let voxels = voxels.map_err(|failure| failure.into_error(name))?;
    let image = Image::new(size.map(|n| n as usize), document.placement(array.is_of_cells.then_some(points)), voxels);
    Ok((image.map_err(|e| fail(e.to_string(), ""))?, array.name.clone(), names))
}

impl Document {
    /// Reads all tags up to the appended data.
    fn parse(name: &str, bytes: &[u8]) -> Result<Document> {
        let mut reader = Reader::from_reader(bytes);
        let mut document =
            Document { word: 4, spacing: DVec3::ONE, directions: DMat3::IDENTITY, ..Document::default() };
        let mut section = None;
        let (mut is_image, mut pieces) = (false, 0);
        loop {
            let at = reader.buffer_position();
            let fail = |problem: String| {
                Error::format(
                    name,
                    Place::Byte(at),
                    problem,
                    "the file is damaged or cut short: copy or export it again",
                )
            };
            let event = reader.read_event().map_err(|e| fail(e.to_string()))?;
            let (tag, is_empty) = match event {
                Event::Start(tag) => (tag, false),
                Event::Empty(tag) => (tag, true),
                Event::End(tag) => {
                    if matches!(tag.local_name().as_ref(), "PointData" | "CellData") {
                        section = None;
                    }
                    continue;
                }
                Event::Eof if is_image && pieces > 0 => return Ok(document),
                Event::Eof => return Err(fail("there is no piece of image data in the file".to_owned())),
                _ => continue,
            };
            let behind = reader.buffer_position() as usize;
            let value = |key: &str| attribute(&tag, key).map_err(&fail);
            match tag.local_name().as_ref() {
                "VTKFile" => {
                    let kind = value("type")?.unwrap_or_default();
                    if kind != "ImageData" {
                        let problem = format!("the file holds {kind}, not ImageData");
                        return Err(Error::format(name, Place::Byte(at), problem, "save the volume as .vti"));
                    }
                    document.head(&tag).map_err(fail)?;
                }
                "ImageData" => {
                    is_image = true;
                    document.image(&tag).map_err(fail)?;
                }
                "Piece" => {
                    pieces += 1;
                    if pieces > 1 {
                        let problem = "the image is in several pieces".to_owned();
                        return Err(Error::format(name, Place::Byte(at), problem, "save it as one piece"));
                    }
                    if let Some(extent) = value("Extent")? {
                        document.extent = extent_of(&extent).map_err(fail)?;
                    }
                }
                "PointData" | "CellData" if !is_empty => {
                    let is_of_cells = tag.local_name().as_ref() == "CellData";
                    section = Some((is_of_cells, value("Scalars")?.unwrap_or_default()));
                }
                "DataArray" => {
                    if let Some((is_of_cells, active)) = &section {
                        let array = array_of(&tag, *is_of_cells, active, behind).map_err(fail)?;
                        document.arrays.extend(array);
                    }
                }
                "AppendedData" => {
                    let is_base64 = value("encoding")?.is_none_or(|encoding| encoding == "base64");
                    let mark = bytes[behind..].iter().position(|&b| b == b'_');
                    let mark = mark.ok_or_else(|| fail("the appended data have no `_` before them".to_owned()))?;
                    document.appended = Some((behind + mark + 1, is_base64));
                    return Ok(document);
                }
                _ => {}
            }
        }
    }

    /// What the outermost tag says.
    fn head(&mut self, tag: &BytesStart<'_>) -> Result<(), String> {
        if attribute(tag, "byte_order")?.as_deref() == Some("BigEndian") {
            self.order = ByteOrder::Big;
        }
        if attribute(tag, "header_type")?.as_deref() == Some("UInt64") {
            self.word = 8;
        }
        match attribute(tag, "compressor")?.as_deref() {
            None | Some("") => Ok(()),
            Some("vtkZLibDataCompressor") => {
                self.is_packed = true;
                Ok(())
            }
            Some(other) => {
                Err(format!("the data are packed by {other}, which is not known: save them with zlib, or plain"))
            }
        }
    }

    /// What the tag of the image says.
    fn image(&mut self, tag: &BytesStart<'_>) -> Result<(), String> {
        let extent = attribute(tag, "WholeExtent")?.ok_or("the image has no WholeExtent")?;
        self.extent = extent_of(&extent)?;
        let vector = |key| -> Result<Option<DVec3>, String> {
            attribute(tag, key)?.map(|text| numbers::<f64, 3>(&text).map(DVec3::from)).transpose()
        };
        self.origin = vector("Origin")?.unwrap_or(DVec3::ZERO);
        self.spacing = vector("Spacing")?.unwrap_or(DVec3::ONE);
        if let Some(text) = attribute(tag, "Direction")? {
            self.directions = DMat3::from_cols_array(&numbers::<f64, 9>(&text)?).transpose();
        }
        Ok(())
    }

    fn placement(&self, cells_of: Option<[u64; 3]>) -> Placement {
        placed(self.extent.map(|[first, _]| first), self.directions, self.origin, self.spacing, cells_of)
    }

    /// The content of an array.
    fn content<'a>(&self, name: &str, bytes: &'a [u8], array: &Array) -> Result<Content<'a>> {
        let missing = || {
            let problem = format!("array {} lies behind the end of the file", array.name);
            Error::format(name, Place::Whole, problem, "the file was cut short: copy or export it again")
        };
        let (start, is_base64) = match (array.start, self.appended) {
            (Start::Inline(start), _) => (start, true),
            (Start::Appended(offset), Some((start, is_base64))) => {
                let offset = usize::try_from(offset).map_err(|_| missing())?;
                (start.checked_add(offset).ok_or_else(missing)?, is_base64)
            }
            (Start::Appended(_), None) => return Err(missing()),
        };
        let rest = bytes.get(start..).ok_or_else(missing)?;
        let end = if is_base64 { rest.iter().position(|&b| b == b'<').unwrap_or(rest.len()) } else { rest.len() };
        Ok(Content(&rest[..end], is_base64))
    }

    /// The bytes of the samples.
    fn open<'a>(&self, content: &Content<'a>) -> io::Result<Box<dyn Read + 'a>> {
        let mut stream: Box<dyn Read + 'a> = match *content {
            Content(text, true) => Box::new(Base64 { text, bytes: [0; 3], left: 0 }),
            Content(bytes, false) => Box::new(bytes),
        };
        let first = self.read_word(&mut *stream)?;
        if !self.is_packed {
            return Ok(Box::new(stream.take(first)));
        }
        let (size, _last) = (self.read_word(&mut *stream)?, self.read_word(&mut *stream)?);
        if first > content.0.len() as u64 {
            return Err(io::Error::new(ErrorKind::InvalidData, "more blocks than bytes"));
        }
        let sizes: io::Result<Vec<u64>> = (0..first).map(|_| self.read_word(&mut *stream)).collect();
        Ok(Box::new(Blocks { stream, sizes: sizes?.into_iter(), size, block: Vec::new(), used: 0 }))
    }

    /// A size.
    fn read_word(&self, stream: &mut dyn Read) -> io::Result<u64> {
        let mut bytes = [0; 8];
        stream.read_exact(&mut bytes[..self.word])?;
        if self.order == ByteOrder::Big {
            bytes[..self.word].reverse();
        }
        Ok(u64::from_le_bytes(bytes))
    }
}

/// Bytes of a file, and whether they are base64.
struct Content<'a>(&'a [u8], bool);

impl Content<'_> {
    /// The most bytes that it can stand for.
    fn most(&self, is_packed: bool) -> u64 {
        let bytes = self.0.len() as u64;
        let bytes = if self.1 { bytes / 4 * 3 } else { bytes };
        if is_packed { most_unpacked(bytes) } else { bytes }
    }
}

/// The value of an attribute.
fn attribute(tag: &BytesStart<'_>, key: &str) -> Result<Option<String>, String> {
    for attribute in tag.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| e.to_string())?;
        if attribute.key.local_name().as_ref() == key {
            return Ok(Some(attribute.value.into_owned()));
        }
    }
    Ok(None)
}

/// As many numbers as there should be.
fn numbers<T: std::str::FromStr, const N: usize>(text: &str) -> Result<[T; N], String> {
    let list: Option<Vec<T>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    list.and_then(|list| list.try_into().ok()).ok_or_else(|| format!("\"{text}\" is not {N} numbers"))
}

/// First and last point along each axis.
fn extent_of(text: &str) -> Result<[[i64; 2]; 3], String> {
    let [a, b, c, d, e, f] = numbers::<i64, 6>(text)?;
    let extent = [[a, b], [c, d], [e, f]];
    let is_sound = extent.iter().all(|&[first, last]| last.checked_sub(first).is_some_and(|n| n >= 0));
    if is_sound { Ok(extent) } else { Err(format!("the extent \"{text}\" holds no point")) }
}

/// What the tag of an array says; `None` where it holds no numbers.
fn array_of(tag: &BytesStart<'_>, is_of_cells: bool, active: &str, behind: usize) -> Result<Option<Array>, String> {
    let kind = match attribute(tag, "type")?.as_deref() {
        Some("UInt8") => SampleKind::U8,
        Some("Int8") => SampleKind::I8,
        Some("UInt16") => SampleKind::U16,
        Some("Int16") => SampleKind::I16,
        Some("UInt32") => SampleKind::U32,
        Some("Int32") => SampleKind::I32,
        Some("UInt64") => SampleKind::U64,
        Some("Int64") => SampleKind::I64,
        Some("Float32") => SampleKind::F32,
        Some("Float64") => SampleKind::F64,
        _ => return Ok(None),
    };
    let name = attribute(tag, "Name")?.unwrap_or_default();
    let channels = attribute(tag, "NumberOfComponents")?;
    let channels = channels.map_or(Ok(1), |text| numbers::<u64, 1>(&text).map(|[n]| n))?.max(1);
    let format = attribute(tag, "format")?.unwrap_or_else(|| "ascii".to_owned());
    let start = match format.as_str() {
        "appended" => {
            let offset = attribute(tag, "offset")?.ok_or("an appended array has no offset")?;
            Start::Appended(numbers::<u64, 1>(&offset)?[0])
        }
        "ascii" | "binary" => Start::Inline(behind),
        other => return Err(format!("the format {other} of an array is not known")),
    };
    let is_active = !name.is_empty() && name == active;
    Ok(Some(Array { name, kind, channels, is_of_cells, is_text: format == "ascii", start, is_active }))
}

/// Decodes base64, four letters at a time.
struct Base64<'a> {
    text: &'a [u8],
    bytes: [u8; 3],
    /// How many of the bytes, at the end, are still to be given.
    left: usize,
}

impl Base64<'_> {
    /// Decodes the next four letters; false at the end.
    fn next(&mut self) -> io::Result<bool> {
        let (mut letters, mut count, mut fill) = (0u32, 0, 0);
        while count < 4 {
            let Some((&letter, rest)) = self.text.split_first() else { break };
            self.text = rest;
            let value = match letter {
                b'A'..=b'Z' => letter - b'A',
                b'a'..=b'z' => letter - b'a' + 26,
                b'0'..=b'9' => letter - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => {
                    fill += 1;
                    0
                }
                b'\t' | b'\n' | b'\r' | b' ' => continue,
                _ => return Err(io::Error::new(ErrorKind::InvalidData, "not base64")),
            };
            letters = letters << 6 | u32::from(value);
            count += 1;
        }
        if count < 4 || fill > 2 {
            return Ok(false);
        }
        // The filled bytes are the last ones: what counts is moved to the end.
        let [_, a, b, c] = letters.to_be_bytes();
        self.bytes = [[a, b, c], [0, a, b], [0, 0, a]][fill];
        self.left = 3 - fill;
        Ok(true)
    }
}

impl Read for Base64<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() && (self.left > 0 || self.next()?) {
            let count = self.left.min(buffer.len() - filled);
            let from = 3 - self.left;
            buffer[filled..filled + count].copy_from_slice(&self.bytes[from..from + count]);
            self.left -= count;
            filled += count;
        }
        Ok(filled)
    }
}

/// Unpacks blocks, one at a time.
struct Blocks<'a> {
    stream: Box<dyn Read + 'a>,
    /// Of the packed blocks.
    sizes: std::vec::IntoIter<u64>,
    /// Of a block.
    size: u64,
    block: Vec<u8>,
    used: usize,
}

impl Read for Blocks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.used == self.block.len() {
            let Some(packed) = self.sizes.next() else { return Ok(0) };
            self.block.clear();
            self.used = 0;
            let mut packed = (&mut self.stream).take(packed);
            flate2::read::ZlibDecoder::new(&mut packed).take(self.size).read_to_end(&mut self.block)?;
            // What the unpacking did not ask for belongs to this block all the same.
            io::copy(&mut packed, &mut io::sink())?;
        }
        let count = buffer.len().min(self.block.len() - self.used);
        buffer[..count].copy_from_slice(&self.block[self.used..self.used + count]);
        self.used += count;
        Ok(count)
    }
}
