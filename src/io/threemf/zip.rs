//! As much of ZIP as 3MF needs (PKWARE APPNOTE): reading stored and deflated entries by the directory at the end, writing them as they
//! come.
//!
//! The directory is found from the end of the file, each entry by what the directory says; sizes are believed only as far as there are bytes.
//! ZIP64 is read, not written.

use crate::error::{Error, Place, Result};
use crate::io::encode::Out;
use flate2::Crc;
use flate2::read::DeflateDecoder;
use std::io::Read;

/// Signatures of the records.
const LOCAL: u32 = 0x0403_4b50;
const DESCRIPTOR: u32 = 0x0807_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
const END_64: u32 = 0x0606_4b50;
const LOCATOR_64: u32 = 0x0706_4b50;
/// Bytes of the records without what varies.
const LOCAL_SIZE: usize = 30;
const CENTRAL_SIZE: usize = 46;
const END_SIZE: usize = 22;
const LOCATOR_SIZE: usize = 20;
/// Stands for a number that is in the ZIP64 field.
const IN_64: u32 = u32::MAX;
const STORED: u16 = 0;
const DEFLATED: u16 = 8;

/// What `PK` and two bytes begin: the first record of any archive.
pub(in crate::io) fn is_zip(prefix: &[u8]) -> bool {
    prefix.starts_with(&LOCAL.to_le_bytes())
}

fn word16(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().copied().map(u16::from_le_bytes)
}

fn word32(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes)
}

fn word64(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..)?.first_chunk().copied().map(u64::from_le_bytes)
}

/// An archive in memory.
pub(super) struct Archive<'a> {
    name: &'a str,
    bytes: &'a [u8],
    entries: Vec<Entry<'a>>,
}

/// A file in an archive.
struct Entry<'a> {
    /// With `/` between folders, none at the start.
    path: String,
    method: u16,
    data: &'a [u8],
}

impl<'a> Archive<'a> {
    /// Reads the directory.
    pub(super) fn open(name: &'a str, bytes: &'a [u8]) -> Result<Self> {
        let malformed = || {
            let problem = "the directory of the archive is damaged or missing";
            Error::format(name, Place::Whole, problem, "the file was cut short: copy or export it again")
        };
        let mut archive = Archive { name, bytes, entries: Vec::new() };
        let (count, mut at) = archive.directory().ok_or_else(malformed)?;
        for _ in 0..count {
            let (entry, next) = archive.entry(at).ok_or_else(malformed)?;
            archive.entries.push(entry);
            at = next;
        }
        Ok(archive)
    }

    /// Number of entries, and where the directory begins.
    fn directory(&self) -> Option<(u64, usize)> {
        let bytes = self.bytes;
        // A comment of at most 64 KiB may follow the record.
        let last = bytes.len().checked_sub(END_SIZE)?;
        let end = (last.saturating_sub(0xffff)..=last).rev().find(|&at| word32(bytes, at) == Some(END))?;
        let (count, start) = (word16(bytes, end + 10)?, word32(bytes, end + 16)?);
        if count != u16::MAX && start != IN_64 {
            return Some((count.into(), start as usize));
        }
        let locator = end.checked_sub(LOCATOR_SIZE).filter(|&at| word32(bytes, at) == Some(LOCATOR_64))?;
        let end = usize::try_from(word64(bytes, locator + 8)?).ok()?;
        (word32(bytes, end)? == END_64).then_some(())?;
        Some((word64(bytes, end.checked_add(32)?)?, usize::try_from(word64(bytes, end.checked_add(48)?)?).ok()?))
    }

    /// The entry at a place of the directory, and the place of the next one.
    fn entry(&self, at: usize) -> Option<(Entry<'a>, usize)> {
        let bytes = self.bytes;
        (word32(bytes, at)? == CENTRAL).then_some(())?;
        let method = word16(bytes, at + 10)?;
        let [path_len, extra_len, comment_len] = [28, 30, 32].map(|field| word16(bytes, at + field).map(usize::from));
        let path = bytes.get(at + CENTRAL_SIZE..)?.get(..path_len?)?;
        let extra_at = at + CENTRAL_SIZE + path_len?;
        let extra = bytes.get(extra_at..)?.get(..extra_len?)?;
        let (packed, full, local) = (word32(bytes, at + 20)?, word32(bytes, at + 24)?, word32(bytes, at + 42)?);
        // The ZIP64 field has those numbers that did not fit, in this order.
        let mut wide = zip64(extra).unwrap_or(&[]);
        let mut widened = |number: u32| {
            if number != IN_64 {
                return Some(u64::from(number));
            }
            let value = word64(wide, 0)?;
            wide = &wide[8..];
            Some(value)
        };
        let _full = widened(full)?;
        let (packed, local) = (usize::try_from(widened(packed)?).ok()?, usize::try_from(widened(local)?).ok()?);
        (word32(bytes, local)? == LOCAL).then_some(())?;
        let before = usize::from(word16(bytes, local + 26)?) + usize::from(word16(bytes, local + 28)?);
        let data = bytes.get(local + LOCAL_SIZE + before..)?.get(..packed)?;
        let path = String::from_utf8_lossy(path).replace('\\', "/");
        let path = path.trim_start_matches('/').to_owned();
        Some((Entry { path, method, data }, extra_at + extra_len? + comment_len?))
    }

    /// The path of the first entry whose name ends so, in any letter case.
    pub(super) fn find_by_end(&self, end: &str) -> Option<&str> {
        let ends_so = |path: &str| path.to_ascii_lowercase().ends_with(end);
        self.entries.iter().map(|entry| entry.path.as_str()).find(|path| ends_so(path))
    }

    /// The content of an entry as a stream; `None` where there is no such entry. The content is as long as it is; whoever reads must say
    /// when it is enough.
    pub(super) fn open_entry(&self, path: &str) -> Result<Option<Box<dyn Read + 'a>>> {
        let path = path.trim_start_matches('/');
        let Some(entry) = self.entries.iter().find(|entry| entry.path.eq_ignore_ascii_case(path)) else {
            return Ok(None);
        };
        match entry.method {
            STORED => Ok(Some(Box::new(entry.data))),
            DEFLATED => Ok(Some(Box::new(DeflateDecoder::new(entry.data)))),
            method => {
                let problem = format!("{path} is packed by method {method}, which is not the usual one");
                Err(Error::format(self.name, Place::Whole, problem, "export the file again"))
            }
        }
    }
}

/// The content of the ZIP64 field among extra fields.
fn zip64(mut extra: &[u8]) -> Option<&[u8]> {
    loop {
        let (id, len) = (word16(extra, 0)?, usize::from(word16(extra, 2)?));
        let field = extra.get(4..4 + len)?;
        if id == 1 {
            return Some(field);
        }
        extra = &extra[4 + len..];
    }
}

/// What the directory says of a written entry.
#[derive(Debug)]
struct Written {
    path: &'static str,
    start: u32,
    crc: u32,
    packed: u32,
    full: u32,
}

/// Writes an archive of deflated entries.
#[derive(Debug, Default)]
pub(super) struct ArchiveWriter {
    entries: Vec<Written>,
    /// Bytes written.
    position: u64,
    crc: Crc,
    /// Where the data of the open entry begins.
    data: u64,
}

impl ArchiveWriter {
    fn push(&mut self, bytes: &[u8], out: &mut Out) {
        out.push(bytes);
        self.position += bytes.len() as u64;
    }

    /// Fields that local headers and the directory have in common, from the version on: sizes stand behind the data.
    fn fields(crc: u32, packed: u32, full: u32, path: &str) -> Vec<u8> {
        const VERSION: u16 = 20;
        const SIZES_BEHIND: u16 = 8;
        // The first day of the calendar of ZIP, so that the same mesh gives the same bytes.
        const DAY: u16 = 1 << 5 | 1;
        let mut fields = Vec::new();
        [VERSION, SIZES_BEHIND, DEFLATED, 0, DAY].iter().for_each(|word| fields.extend(word.to_le_bytes()));
        [crc, packed, full].iter().for_each(|word| fields.extend(word.to_le_bytes()));
        fields.extend((path.len() as u16).to_le_bytes());
        fields.extend(0u16.to_le_bytes());
        fields
    }

    /// Begins an entry.
    pub(super) fn begin(&mut self, path: &'static str, out: &mut Out) {
        self.entries.push(Written { path, start: self.position as u32, crc: 0, packed: 0, full: 0 });
        self.push(&LOCAL.to_le_bytes(), out);
        self.push(&Self::fields(0, 0, 0, path), out);
        self.push(path.as_bytes(), out);
        self.data = self.position;
        self.crc = Crc::new();
    }

    /// Takes bytes of the open entry, plain and packed. The packed ones may lag behind.
    pub(super) fn data(&mut self, plain: &[u8], packed: &[u8], out: &mut Out) {
        self.crc.update(plain);
        self.push(packed, out);
    }

    /// Bytes so far.
    pub(super) fn position(&self) -> u64 {
        self.position
    }

    /// Ends the open entry, of which `full` bytes were given.
    pub(super) fn end(&mut self, full: u64, out: &mut Out) {
        let (crc, packed) = (self.crc.sum(), (self.position - self.data) as u32);
        let entry = self.entries.last_mut().expect("an entry was begun");
        (entry.crc, entry.packed, entry.full) = (crc, packed, full as u32);
        let words = [DESCRIPTOR, crc, packed, full as u32];
        self.push(&words.map(u32::to_le_bytes).concat(), out);
    }

    /// Writes the directory.
    pub(super) fn finish(&mut self, out: &mut Out) {
        let start = self.position as u32;
        let entries = std::mem::take(&mut self.entries);
        for Written { path, start, crc, packed, full } in &entries {
            self.push(&CENTRAL.to_le_bytes(), out);
            self.push(&20u16.to_le_bytes(), out);
            self.push(&Self::fields(*crc, *packed, *full, path), out);
            // No comment, first disk, no attributes.
            self.push(&[0; 10], out);
            self.push(&start.to_le_bytes(), out);
            self.push(path.as_bytes(), out);
        }
        let size = (self.position as u32).wrapping_sub(start);
        let count = (entries.len() as u16).to_le_bytes();
        self.push(&END.to_le_bytes(), out);
        self.push(&[0; 4], out);
        self.push(&[count, count].concat(), out);
        self.push(&[size, start].map(u32::to_le_bytes).concat(), out);
        self.push(&[0; 2], out);
    }
}
