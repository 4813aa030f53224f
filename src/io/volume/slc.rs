//! SLC (`VolVis`): a header of numbers as text up to an `X`, a picture, and one slice after the other: its size, an `X` and its bytes.
//!
//! Samples are bytes. Compressed slices are runs: a byte with the highest bit set announces as many plain bytes as its other bits say, one
//! without it a byte that is repeated so often, and nothing (0) ends the slice. Slices always end with their own size, so that a damaged slice
//! does not spoil the next one, and never give more samples than they should.

use super::layout::checked_count;
use crate::error::{Error, Place, Result};
use crate::progress::{Progress, Stage, check};
use crate::volume::{Image, Placement, Voxels};
use glam::DVec3;

/// The number that all files begin with.
const MAGIC: &[u8] = b"11111";

pub(super) fn is_slc(head: &[u8]) -> bool {
    head.starts_with(MAGIC) && head.get(MAGIC.len()).is_some_and(u8::is_ascii_whitespace)
}

/// A position in the file.
struct Cursor<'a> {
    name: &'a str,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    #[cold]
    fn error(&self, problem: impl Into<String>) -> Error {
        let remedy = "the file is damaged or cut short: copy or export it again";
        Error::format(self.name, Place::Byte(self.at as u64), problem, remedy)
    }

    /// The next word.
    fn word(&mut self) -> &'a str {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
        let length = rest[start..].iter().take(40).take_while(|b| !b.is_ascii_whitespace()).count();
        self.at += start + length;
        std::str::from_utf8(&rest[start..start + length]).unwrap_or("")
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T> {
        let before = self.at;
        let number = self.word().parse();
        number.map_err(|_| {
            self.at = before;
            self.error(format!("expected {what}"))
        })
    }

    /// The `X` that ends a row of numbers.
    fn end_of_numbers(&mut self) -> Result<()> {
        let blanks = self.bytes[self.at..].iter().take_while(|b| b.is_ascii_whitespace()).count();
        if self.bytes.get(self.at + blanks) != Some(&b'X') {
            return Err(self.error("expected an `X`"));
        }
        self.at += blanks + 1;
        Ok(())
    }

    fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8]> {
        let taken = self.bytes.get(self.at..).and_then(|rest| rest.get(..count));
        let taken = taken.ok_or_else(|| self.error(format!("expected {count} bytes of {what}")))?;
        self.at += count;
        Ok(taken)
    }
}

/// Reads a file. Returns the volume and how many bytes follow behind it.
pub(super) fn parse(name: &str, bytes: &[u8], progress: &dyn Progress) -> Result<(Image, u64)> {
    let mut cursor = Cursor { name, bytes, at: MAGIC.len() };
    let size: [u64; 3] = [cursor.number("a size")?, cursor.number("a size")?, cursor.number("a size")?];
    let bits: u32 = cursor.number("the bits of a sample")?;
    if bits != 8 {
        return Err(cursor.error(format!("samples of {bits} bits are not known, only of 8")));
    }
    let mut spacing = || cursor.number::<f64>("a distance between samples");
    let spacing = DVec3::new(spacing()?, spacing()?, spacing()?);
    for what in ["a unit", "an origin of the data", "a modification of the data"] {
        cursor.number::<i64>(what)?;
    }
    let is_packed = match cursor.number::<i64>("a compression")? {
        0 => false,
        1 => true,
        other => return Err(cursor.error(format!("the compression {other} is not known"))),
    };
    let icon: [usize; 2] = [cursor.number("a size of the picture")?, cursor.number("a size of the picture")?];
    cursor.end_of_numbers()?;
    cursor.take(icon[0].saturating_mul(icon[1]).saturating_mul(3), "the picture")?;

    let count = checked_count(name, size)?;
    // A run of 127 takes two bytes.
    let most = bytes.len().saturating_mul(if is_packed { 64 } else { 1 });
    let [x, y, z] = size;
    if count > most {
        return Err(cursor.error(format!("{x} x {y} x {z} samples cannot be in {} bytes", bytes.len())));
    }
    progress.begin(Stage::Read, count as u64);
    progress.hold(count as u64)?;
    let mut samples = Vec::with_capacity(count);
    let slice_len = (x * y) as usize;
    for slice in 0..z {
        check(progress)?;
        let length: usize = cursor.number("the size of a slice")?;
        cursor.end_of_numbers()?;
        let data = cursor.take(length, "a slice")?;
        let end = samples.len() + slice_len;
        if is_packed {
            unpack(data, end, &mut samples);
        } else {
            samples.extend(data.iter().take(slice_len));
        }
        if samples.len() != end {
            let missing = end - samples.len();
            return Err(cursor.error(format!("slice {slice} has {missing} samples too few")));
        }
        progress.advance(slice_len as u64);
    }
    let trailing = (bytes.len() - cursor.at) as u64;
    let image =
        Image::new(size.map(|n| n as usize), Placement::with_spacing(DVec3::ZERO, spacing), Voxels::U8(samples));
    Ok((image.map_err(|e| Error::format(name, Place::Whole, e.to_string(), ""))?, trailing))
}

/// Unpacks runs until there are `end` samples.
fn unpack(mut data: &[u8], end: usize, samples: &mut Vec<u8>) {
    while let Some((&head, rest)) = data.split_first() {
        let (run, left) = (usize::from(head & 127), end - samples.len());
        let used = if head & 128 != 0 {
            let plain = &rest[..run.min(rest.len())];
            samples.extend(&plain[..plain.len().min(left)]);
            plain.len()
        } else {
            let Some(&value) = rest.first().filter(|_| run > 0) else { return };
            samples.extend(std::iter::repeat_n(value, run.min(left)));
            1
        };
        data = &rest[used..];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn file(compression: u8, slices: &[&[u8]]) -> Vec<u8> {
        let header = format!("11111\n3 2 2 8\n1.0 2.0 0.5\n1 6 0 {compression}\n1 1 X");
        let mut bytes = [header.as_bytes(), &[7; 3]].concat();
        for slice in slices {
            bytes.extend(format!("{} X", slice.len()).as_bytes());
            bytes.extend(*slice);
        }
        bytes
    }

    #[test]
    fn runs_and_plain_bytes_are_unpacked() {
        let plain = file(0, &[&[1, 1, 1, 1, 2, 3], &[4; 6]]);
        let (image, trailing) = parse("t", &plain, &Silent).unwrap();
        assert_eq!((image.size(), trailing), ([3, 2, 2], 0));
        assert_eq!(image.placement().spacing(), DVec3::new(1.0, 2.0, 0.5));
        let packed = file(1, &[&[4, 1, 128 + 2, 2, 3, 0], &[6, 4]]);
        assert_eq!(parse("t", &packed, &Silent).unwrap().0, image);
    }

    #[test]
    fn damaged_files_are_refused() {
        let message = |bytes: &[u8]| parse("t", bytes, &Silent).unwrap_err().to_string();
        assert!(message(&file(1, &[&[4, 1, 0], &[6, 4]])).contains("slice 0 has 2 samples too few"));
        // A run that is too long is cut.
        assert!(parse("t", &file(1, &[&[100, 1], &[6, 4]]), &Silent).is_ok());
        assert!(message(&file(2, &[])).contains("compression 2"));
        assert!(message(b"11111 9999999 9999999 2 8 1 1 1 0 0 0 1 0 0 X").contains("cannot be in"));
        assert!(message(b"11111 2 2 2 16 1 1 1 0 0 0 1 0 0 X").contains("16 bits"));
        let whole = file(1, &[&[6, 1], &[6, 4]]);
        assert!((6..whole.len()).all(|end| parse("t", &whole[..end], &Silent).is_err()));
    }
}
