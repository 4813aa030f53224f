//! Samples as files have them: a type, a byte order, perhaps several channels; into [`Voxels`] as they come.
//!
//! What is allocated has been checked against the size of the file before. Integers of 64 bits become 32 bits as long as all fit, and doubles
//! from the first one on that does not.

use crate::error::{Error, Result};
use crate::io::number;
use crate::progress::Progress;
use crate::volume::Voxels;
use std::io::{ErrorKind, Read};

/// Bytes decoded at a time: a multiple of the size of every sample.
const CHUNK: usize = 1 << 16;

/// The types of samples in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SampleKind {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 64 bits.
    I64,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl SampleKind {
    const ALL: [SampleKind; 10] = [
        SampleKind::U8,
        SampleKind::I8,
        SampleKind::U16,
        SampleKind::I16,
        SampleKind::U32,
        SampleKind::I32,
        SampleKind::U64,
        SampleKind::I64,
        SampleKind::F32,
        SampleKind::F64,
    ];

    /// Bytes a sample.
    pub fn bytes(self) -> usize {
        match self {
            SampleKind::U8 | SampleKind::I8 => 1,
            SampleKind::U16 | SampleKind::I16 => 2,
            SampleKind::U32 | SampleKind::I32 | SampleKind::F32 => 4,
            SampleKind::U64 | SampleKind::I64 | SampleKind::F64 => 8,
        }
    }

    /// The name of the type: `u8`, `i8`, and so on up to `f64`.
    pub fn name(self) -> &'static str {
        match self {
            SampleKind::U8 => "u8",
            SampleKind::I8 => "i8",
            SampleKind::U16 => "u16",
            SampleKind::I16 => "i16",
            SampleKind::U32 => "u32",
            SampleKind::I32 => "i32",
            SampleKind::U64 => "u64",
            SampleKind::I64 => "i64",
            SampleKind::F32 => "f32",
            SampleKind::F64 => "f64",
        }
    }

    /// The type of this [name](Self::name).
    pub fn from_name(name: &str) -> Option<SampleKind> {
        SampleKind::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// Which byte of a number comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ByteOrder {
    /// The least significant one.
    #[default]
    Little,
    /// The most significant one.
    Big,
}

/// How samples stand in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Samples {
    pub(super) kind: SampleKind,
    pub(super) order: ByteOrder,
    /// Numbers that stand together for each sample.
    pub(super) channels: usize,
    /// The one of them that is taken.
    pub(super) channel: usize,
    /// Number of samples.
    pub(super) count: usize,
}

/// Why samples cannot be had.
#[derive(Debug)]
pub(super) enum Failure {
    /// The data end after so many samples.
    Ends(usize),
    /// The data cannot be read, or not be unpacked.
    Io(std::io::Error),
    /// There is not so much memory, or it must not be taken, or the user wants to stop.
    Refused(Error),
    /// A sample of a text is not what it should be.
    Text { position: usize, problem: String },
}

impl Samples {
    /// Bytes of all samples in a file; `None` where no file is that large.
    pub(super) fn bytes(&self) -> Option<u64> {
        let bytes = (self.count as u64).checked_mul(self.channels as u64)?.checked_mul(self.kind.bytes() as u64)?;
        (bytes < 1 << 62).then_some(bytes)
    }

    /// Reads binary samples.
    pub(super) fn read(&self, reader: &mut dyn Read, progress: &dyn Progress) -> Result<Voxels, Failure> {
        macro_rules! collect {
            ($voxels:path, $type:ty) => {
                $voxels(match self.order {
                    ByteOrder::Little => self.collect(reader, progress, <$type>::from_le_bytes)?,
                    ByteOrder::Big => self.collect(reader, progress, <$type>::from_be_bytes)?,
                })
            };
        }
        Ok(match self.kind {
            SampleKind::U8 => collect!(Voxels::U8, u8),
            SampleKind::I8 => collect!(Voxels::I8, i8),
            SampleKind::U16 => collect!(Voxels::U16, u16),
            SampleKind::I16 => collect!(Voxels::I16, i16),
            SampleKind::U32 => collect!(Voxels::U32, u32),
            SampleKind::I32 => collect!(Voxels::I32, i32),
            SampleKind::F32 => collect!(Voxels::F32, f32),
            SampleKind::F64 => collect!(Voxels::F64, f64),
            SampleKind::I64 => {
                let from = if self.order == ByteOrder::Little { i64::from_le_bytes } else { i64::from_be_bytes };
                let narrow = |samples: &[i64], out: &mut Vec<i32>| narrowed(samples, out);
                self.narrow(reader, progress, from, narrow, |n| n as f64, Voxels::I32)?
            }
            SampleKind::U64 => {
                let from = if self.order == ByteOrder::Little { u64::from_le_bytes } else { u64::from_be_bytes };
                let narrow = |samples: &[u64], out: &mut Vec<u32>| narrowed(samples, out);
                self.narrow(reader, progress, from, narrow, |n| n as f64, Voxels::U32)?
            }
        })
    }

    /// Room for all samples.
    fn room<T>(&self, progress: &dyn Progress) -> Result<Vec<T>, Failure> {
        let bytes = self.count as u64 * size_of::<T>() as u64;
        progress.hold(bytes).map_err(Failure::Refused)?;
        let mut room = Vec::new();
        room.try_reserve_exact(self.count).map_err(|_| {
            let problem = format!("{} samples of the type {} do not fit into memory", self.count, self.kind.name());
            Failure::Refused(Error::setting("size", problem, "crop the volume, or take one with fewer samples"))
        })?;
        Ok(room)
    }

    /// Reads numbers of `N` bytes.
    fn collect<T, const N: usize>(
        &self,
        reader: &mut dyn Read,
        progress: &dyn Progress,
        from: impl Fn([u8; N]) -> T,
    ) -> Result<Vec<T>, Failure> {
        let mut samples = self.room(progress)?;
        self.chunks(reader, progress, |bytes| {
            let (numbers, _) = bytes.as_chunks::<N>();
            if self.channels == 1 {
                samples.extend(numbers.iter().map(|&bytes| from(bytes)));
            } else {
                samples.extend(numbers.iter().skip(self.channel).step_by(self.channels).map(|&bytes| from(bytes)));
            }
        })?;
        Ok(samples)
    }

    /// Reads numbers of 64 bits, which are kept in 32 as long as that is possible.
    fn narrow<W: Copy, T: Copy + Into<f64>>(
        &self,
        reader: &mut dyn Read,
        progress: &dyn Progress,
        from: impl Fn([u8; 8]) -> W,
        narrow: impl Fn(&[W], &mut Vec<T>) -> bool,
        widen: impl Fn(W) -> f64,
        voxels: impl Fn(Vec<T>) -> Voxels,
    ) -> Result<Voxels, Failure> {
        let mut short: Vec<T> = self.room(progress)?;
        let mut wide: Option<Vec<f64>> = None;
        let mut chunk = Vec::new();
        self.chunks(reader, progress, |bytes| {
            chunk.clear();
            let numbers = bytes.as_chunks::<8>().0.iter().skip(self.channel).step_by(self.channels);
            chunk.extend(numbers.map(|&bytes| from(bytes)));
            if wide.is_none() {
                let before = short.len();
                if narrow(&chunk, &mut short) {
                    return;
                }
                short.truncate(before);
            }
            let wide = wide.get_or_insert_with(|| {
                let short = std::mem::take(&mut short);
                let mut wide = Vec::with_capacity(self.count);
                wide.extend(short.into_iter().map(Into::into));
                wide
            });
            wide.extend(chunk.iter().map(|&number| widen(number)));
        })?;
        Ok(wide.map_or_else(|| voxels(short), Voxels::F64))
    }

    /// Passes the bytes of all samples on, some thousand samples at a time.
    fn chunks(
        &self,
        reader: &mut dyn Read,
        progress: &dyn Progress,
        mut take: impl FnMut(&[u8]),
    ) -> Result<(), Failure> {
        let size = self.channels * self.kind.bytes();
        let mut buffer = vec![0; (CHUNK / size).max(1) * size];
        let mut left = self.count;
        while left > 0 {
            if progress.is_cancelled() {
                return Err(Failure::Refused(Error::Cancelled));
            }
            let wanted = buffer.len().min(left.saturating_mul(size));
            let filled = fill(reader, &mut buffer[..wanted]).map_err(Failure::Io)?;
            let whole = filled / size;
            take(&buffer[..whole * size]);
            left -= whole;
            progress.advance(filled as u64);
            if filled < wanted {
                return Err(Failure::Ends(self.count - left));
            }
        }
        Ok(())
    }

    /// Reads samples that are written as decimal text with blanks, and perhaps commas, between them.
    pub(super) fn parse(&self, text: &[u8], progress: &dyn Progress) -> Result<Voxels, Failure> {
        macro_rules! integers {
            ($voxels:path, $type:ty) => {
                $voxels(self.scan(text, progress, |number| {
                    let cut = number as $type;
                    (f64::from(cut) == number).then_some(cut)
                })?)
            };
        }
        Ok(match self.kind {
            SampleKind::U8 => integers!(Voxels::U8, u8),
            SampleKind::I8 => integers!(Voxels::I8, i8),
            SampleKind::U16 => integers!(Voxels::U16, u16),
            SampleKind::I16 => integers!(Voxels::I16, i16),
            SampleKind::U32 => integers!(Voxels::U32, u32),
            SampleKind::I32 => integers!(Voxels::I32, i32),
            SampleKind::F32 => Voxels::F32(self.scan(text, progress, |number| Some(number as f32))?),
            SampleKind::F64 | SampleKind::U64 | SampleKind::I64 => Voxels::F64(self.scan(text, progress, Some)?),
        })
    }

    fn scan<T>(
        &self,
        text: &[u8],
        progress: &dyn Progress,
        convert: impl Fn(f64) -> Option<T>,
    ) -> Result<Vec<T>, Failure> {
        let is_blank = |b: &u8| *b <= b' ' || *b == b',';
        let mut samples = self.room(progress)?;
        let mut at = 0;
        for number in 0..self.count * self.channels {
            at += text[at..].iter().take_while(|b| is_blank(b)).count();
            if at >= text.len() {
                return Err(Failure::Ends(samples.len()));
            }
            let scanned = number::scan(&text[at..]).filter(|&(_, n)| text.get(at + n).is_none_or(is_blank));
            let sample = scanned.and_then(|(value, length)| Some((convert(value)?, length)));
            let Some((sample, length)) = sample else {
                let word: Vec<u8> = text[at..].iter().copied().take_while(|b| !is_blank(b)).take(40).collect();
                let word = String::from_utf8_lossy(&word);
                let problem = format!("`{}` is no sample of the type {}", word.escape_debug(), self.kind.name());
                return Err(Failure::Text { position: at, problem });
            };
            at += length;
            if number % self.channels == self.channel {
                samples.push(sample);
            }
        }
        Ok(samples)
    }
}

/// Appends all numbers if all fit.
fn narrowed<W: Copy, T: TryFrom<W>>(numbers: &[W], out: &mut Vec<T>) -> bool {
    numbers.iter().all(|&number| match T::try_from(number) {
        Ok(short) => {
            out.push(short);
            true
        }
        Err(_) => false,
    })
}

/// Reads until the buffer is full or nothing is left; returns how many bytes there were.
pub(super) fn fill(reader: &mut dyn Read, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match reader.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(filled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn samples(kind: SampleKind, count: usize) -> Samples {
        Samples { kind, order: ByteOrder::Little, channels: 1, channel: 0, count }
    }

    #[test]
    fn every_type_comes_in_both_orders() {
        for kind in SampleKind::ALL {
            assert_eq!(SampleKind::from_name(kind.name()), Some(kind));
            // 1 and 2, as integers or as floating-point numbers.
            let little: Vec<u8> = [1u8, 2]
                .into_iter()
                .flat_map(|n| match kind {
                    SampleKind::F32 => f32::from(n).to_le_bytes().to_vec(),
                    SampleKind::F64 => f64::from(n).to_le_bytes().to_vec(),
                    _ => u64::from(n).to_le_bytes()[..kind.bytes()].to_vec(),
                })
                .collect();
            let big: Vec<u8> = little.chunks(kind.bytes()).flat_map(|n| n.iter().rev().copied()).collect();
            for (order, bytes) in [(ByteOrder::Little, little), (ByteOrder::Big, big)] {
                let voxels = Samples { order, ..samples(kind, 2) }.read(&mut bytes.as_slice(), &Silent).unwrap();
                assert_eq!([0, 1].map(|i| voxels.value(i)), [1.0, 2.0], "{kind:?} {order:?}");
                let second = Samples { order, channels: 2, channel: 1, count: 1, kind };
                assert_eq!(second.read(&mut bytes.as_slice(), &Silent).unwrap().value(0), 2.0);
                let cut = &mut &bytes[..bytes.len() - 1];
                assert!(matches!(samples(kind, 2).read(cut, &Silent), Err(Failure::Ends(1))));
            }
            assert_eq!(samples(kind, 2).parse(b" 1,\n2 x", &Silent).unwrap().value(1), 2.0);
        }
    }

    #[test]
    fn integers_of_64_bits_are_narrowed_if_all_fit() {
        let bytes = |list: &[i64]| list.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let read = |kind, list: &[i64]| samples(kind, list.len()).read(&mut bytes(list).as_slice(), &Silent).unwrap();
        assert_eq!(read(SampleKind::I64, &[-5, 7]), Voxels::I32(vec![-5, 7]));
        assert_eq!(read(SampleKind::U64, &[1, 4_000_000_000]), Voxels::U32(vec![1, 4_000_000_000]));
        let mut list = vec![3; 20_000];
        list.push(1 << 40);
        let Voxels::F64(wide) = read(SampleKind::I64, &list) else { panic!("too wide for 32 bits") };
        assert!(wide.len() == list.len() && wide[0] == 3.0 && wide[20_000] == f64::from(2).powi(40));
    }

    #[test]
    fn text_is_checked() {
        let fails = |kind, text: &str| samples(kind, 2).parse(text.as_bytes(), &Silent).unwrap_err();
        assert!(matches!(fails(SampleKind::U8, "1"), Failure::Ends(1)));
        assert!(matches!(fails(SampleKind::U8, "1 256"), Failure::Text { position: 2, .. }));
        assert!(matches!(fails(SampleKind::I16, "1 0.5"), Failure::Text { position: 2, .. }));
        assert!(matches!(fails(SampleKind::F32, "1 2x"), Failure::Text { position: 2, .. }));
        assert!(matches!(samples(SampleKind::F32, 2).parse(b"nan -1e3", &Silent), Ok(Voxels::F32(_))));
    }
}
