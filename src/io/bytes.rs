//! A window that moves over binary input, so that memory does not grow with the file.

use crate::error::{Error, Place, Result};
use std::io::{ErrorKind, Read};

/// Bytes read at once.
const CHUNK: usize = 1 << 20;

/// Binary input of known length, seen through a buffer.
#[derive(Debug)]
pub(super) struct Bytes<'a, R> {
    name: &'a str,
    reader: R,
    buffer: Vec<u8>,
    /// The bytes in the buffer that are not yet consumed.
    window: std::ops::Range<usize>,
    /// Offset in the file of the start of the window.
    position: u64,
    /// Offset in the file where the input ends.
    end: u64,
}

impl<'a, R: Read> Bytes<'a, R> {
    /// The bytes `position .. end` of a file; `reader` is already at `position`. `name` is for messages.
    pub(super) fn new(name: &'a str, reader: R, position: u64, end: u64) -> Self {
        Bytes { name, reader, buffer: Vec::new(), window: 0..0, position, end }
    }

    /// Offset in the file of the next byte.
    pub(super) fn position(&self) -> u64 {
        self.position
    }

    /// Number of bytes left.
    pub(super) fn left(&self) -> u64 {
        self.end - self.position
    }

    /// All bytes in the buffer: at least `wanted` of them unless fewer are left.
    pub(super) fn fill(&mut self, wanted: usize) -> Result<&[u8]> {
        let target = self.left().min(wanted.max(CHUNK) as u64) as usize;
        if self.window.len() < wanted.min(target) {
            self.buffer.copy_within(self.window.clone(), 0);
            self.window = 0..self.window.len();
            if self.buffer.len() < target {
                self.buffer.resize(target, 0);
            }
            while self.window.end < target {
                match self.reader.read(&mut self.buffer[self.window.end..target]) {
                    Ok(0) => {
                        self.end = self.position + self.window.len() as u64;
                        break;
                    }
                    Ok(count) => self.window.end += count,
                    Err(e) if e.kind() == ErrorKind::Interrupted => {}
                    Err(e) => return Err(Error::io(self.name, "read", e)),
                }
            }
        }
        Ok(&self.buffer[self.window.clone()])
    }

    /// Consumes bytes of the buffer.
    pub(super) fn consume(&mut self, count: usize) {
        self.window.start += count;
        self.position += count as u64;
    }

    /// Takes as many bytes as the array has, or `None` when fewer are left.
    #[inline]
    pub(super) fn take<const N: usize>(&mut self) -> Result<Option<[u8; N]>> {
        if let Some(&taken) = self.buffer[self.window.clone()].first_chunk() {
            self.consume(N);
            return Ok(Some(taken));
        }
        self.fill_and_take()
    }

    /// The same if the buffer has too few.
    #[cold]
    fn fill_and_take<const N: usize>(&mut self) -> Result<Option<[u8; N]>> {
        let taken = self.fill(N)?.first_chunk().copied();
        self.consume(if taken.is_some() { N } else { 0 });
        Ok(taken)
    }

    /// Skips `count` bytes, or returns false when fewer are left.
    pub(super) fn skip(&mut self, mut count: u64) -> Result<bool> {
        if count > self.left() {
            return Ok(false);
        }
        while count > 0 {
            let step = (self.fill(1)?.len() as u64).min(count);
            if step == 0 {
                return Ok(false);
            }
            self.consume(step as usize);
            count -= step;
        }
        Ok(true)
    }

    /// An error at the next byte.
    #[cold]
    pub(super) fn error(&self, problem: impl Into<String>, remedy: &str) -> Error {
        Error::format(self.name, Place::Byte(self.position), problem, remedy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Yields a few bytes at a time, as a pipe may.
    struct Slow<'a>(&'a [u8]);

    impl Read for Slow<'_> {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            let count = out.len().min(7);
            self.0.read(&mut out[..count])
        }
    }

    #[test]
    fn the_window_covers_what_is_wanted() {
        let data: Vec<u8> = (0..CHUNK + 1000).map(|i| (i % 251) as u8).collect();
        let mut bytes = Bytes::new("t", Slow(&data), 0, data.len() as u64);
        let mut at = 0;
        while bytes.left() > 0 {
            let window = bytes.fill(300).expect("memory");
            assert!(window.len() >= 300.min(data.len() - at));
            assert_eq!(window, &data[at..at + window.len()]);
            let step = window.len().clamp(1, 299);
            bytes.consume(step);
            at += step;
        }
        assert_eq!(bytes.take::<1>().expect("memory"), None);
    }

    #[test]
    fn a_file_that_shrinks_is_cut_short_not_endless() {
        let mut bytes = Bytes::new("t", &b"abc"[..], 0, 1000);
        assert_eq!(bytes.take().expect("memory"), Some(*b"ab"));
        assert!(!bytes.skip(500).expect("memory"));
        assert_eq!(bytes.left(), 1);
    }
}
