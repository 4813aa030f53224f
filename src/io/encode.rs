//! Meshes to bytes: what all writers share, and the text formats.

use crate::error::Result;
use crate::mesh::MeshSizes;
use glam::DVec3;
use std::io::Write;

/// How many digits or bytes a coordinate is written with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// As 32-bit numbers: 7 digits, which is what most programs read anyway.
    #[default]
    Single,
    /// As 64-bit numbers: 16 digits. Binary STL cannot.
    Double,
}

/// Turns a mesh into the bytes of a file, piece by piece: [`begin`](Self::begin), points, faces, [`end`](Self::end).
pub(super) trait Encoder {
    /// Bytes held until the end for a mesh of such sizes.
    fn bytes_for(&self, _sizes: MeshSizes) -> u64 {
        0
    }

    /// Encodes what stands before the points.
    fn begin(&mut self, sizes: MeshSizes, out: &mut Out) -> Result<()>;

    /// Encodes the next points.
    fn points(&mut self, points: &[DVec3], out: &mut Out);

    /// Encodes the next faces, which all have `arity` (at least 1) corners.
    fn faces(&mut self, arity: usize, corners: &[u32], out: &mut Out) -> Result<()>;

    /// Encodes what stands behind the faces.
    fn end(&mut self, _out: &mut Out) -> Option<Patch> {
        None
    }
}

/// Bytes that must be replaced once all is known.
pub(super) struct Patch {
    /// Where in the file.
    pub(super) position: u64,
    /// The right bytes.
    pub(super) bytes: Vec<u8>,
}

/// A buffer that is filled by storing into room that is already there, not by appending.
#[derive(Debug, Default)]
pub(super) struct Out {
    bytes: Vec<u8>,
    used: usize,
}

impl Out {
    /// At least `count` bytes behind the last ones used.
    pub(super) fn room(&mut self, count: usize) -> &mut [u8] {
        if self.bytes.len() < self.used + count {
            self.bytes.resize((self.used + count).next_power_of_two(), 0);
        }
        &mut self.bytes[self.used..]
    }

    /// Says how many bytes of the room were used.
    pub(super) fn advance(&mut self, count: usize) {
        self.used += count;
    }

    /// Appends bytes.
    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.room(bytes.len())[..bytes.len()].copy_from_slice(bytes);
        self.advance(bytes.len());
    }

    /// Appends an integer in decimal.
    pub(super) fn push_integer(&mut self, mut value: u64) {
        let mut digits = [0; 20];
        let mut start = digits.len();
        loop {
            start -= 1;
            digits[start] = b'0' + (value % 10) as u8;
            value /= 10;
            if value == 0 {
                break;
            }
        }
        self.push(&digits[start..]);
    }

    /// Appends the shortest decimal number that is read back as the same one.
    pub(super) fn push_number(&mut self, value: f64, precision: Precision) {
        let magnitude = value.abs();
        let is_plain = magnitude == 0.0 || (1e-5..1e16).contains(&magnitude);
        let written = match (precision, is_plain) {
            (Precision::Single, true) => write!(self, "{}", value as f32),
            (Precision::Single, false) => write!(self, "{:?}", value as f32),
            (Precision::Double, true) => write!(self, "{value}"),
            (Precision::Double, false) => write!(self, "{value:?}"),
        };
        written.expect("memory takes all that is written");
    }

    /// Appends three numbers with blanks between.
    pub(super) fn push_vector(&mut self, vector: DVec3, precision: Precision) {
        for (i, value) in vector.to_array().into_iter().enumerate() {
            if i > 0 {
                self.push(b" ");
            }
            self.push_number(value, precision);
        }
    }

    /// The bytes used.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes[..self.used]
    }

    /// Forgets the bytes, but not the room.
    pub(super) fn clear(&mut self) {
        self.used = 0;
    }
}

impl Write for Out {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.push(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Encodes points and faces as lines: OBJ, OFF, and PLY as text.
#[derive(Debug)]
pub(super) struct LineEncoder {
    /// What the first line or lines say.
    header: fn(MeshSizes, Precision) -> String,
    /// What stands before the coordinates of a point.
    point: &'static str,
    /// What stands before the corners of a face; `None` is their number.
    face: Option<&'static str>,
    /// The index of the first point.
    base: u32,
    precision: Precision,
}

impl LineEncoder {
    /// OBJ: `v x y z`, `f a b c` with vertices from 1.
    pub(super) fn obj(precision: Precision) -> Self {
        LineEncoder { header: |_, _| "# zmend\n".to_owned(), point: "v ", face: Some("f"), base: 1, precision }
    }

    /// OFF: counts, `x y z`, `3 a b c` with vertices from 0.
    pub(super) fn off(precision: Precision) -> Self {
        let header = |sizes: MeshSizes, _| format!("OFF\n{} {} 0\n", sizes.points, sizes.faces);
        LineEncoder { header, point: "", face: None, base: 0, precision }
    }

    /// PLY as text, which looks like OFF behind its header. `most_corners` is the most that a face may have.
    pub(super) fn ply(precision: Precision, most_corners: usize) -> Self {
        let header = match most_corners {
            0..=255 => |sizes, precision| super::ply::write_header("ascii", sizes, precision, true),
            _ => |sizes, precision| super::ply::write_header("ascii", sizes, precision, false),
        };
        LineEncoder { header, point: "", face: None, base: 0, precision }
    }
}

impl Encoder for LineEncoder {
    fn begin(&mut self, sizes: MeshSizes, out: &mut Out) -> Result<()> {
        out.push((self.header)(sizes, self.precision).as_bytes());
        Ok(())
    }

    fn points(&mut self, points: &[DVec3], out: &mut Out) {
        for &point in points {
            out.push(self.point.as_bytes());
            out.push_vector(point, self.precision);
            out.push(b"\n");
        }
    }

    fn faces(&mut self, arity: usize, corners: &[u32], out: &mut Out) -> Result<()> {
        for face in corners.chunks_exact(arity) {
            match self.face {
                Some(word) => out.push(word.as_bytes()),
                None => out.push_integer(arity as u64),
            }
            for &corner in face {
                out.push(b" ");
                out.push_integer(u64::from(corner) + u64::from(self.base));
            }
            out.push(b"\n");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_are_short() {
        let text = |value, precision| {
            let mut out = Out::default();
            out.push_number(value, precision);
            String::from_utf8(out.bytes().to_vec()).expect("ASCII")
        };
        assert_eq!(text(0.1, Precision::Single), "0.1");
        assert_eq!(text(0.1f32.into(), Precision::Double), "0.10000000149011612");
        assert_eq!(text(-3.0, Precision::Single), "-3");
        assert_eq!(text(1e-30, Precision::Single), "1e-30");
        assert_eq!(text(1e300, Precision::Double), "1e300");
        assert_eq!(text(f64::NAN, Precision::Single), "NaN");
    }

    proptest! {
        #[test]
        fn numbers_survive(bits in any::<u64>(), integer in any::<u64>()) {
            let value = f64::from_bits(bits);
            prop_assume!(!value.is_nan());
            let mut out = Out::default();
            out.push_number(value, Precision::Double);
            out.push(b" ");
            out.push_number(value, Precision::Single);
            out.push(b" ");
            out.push_integer(integer);
            let text = String::from_utf8(out.bytes().to_vec()).expect("ASCII");
            let words: Vec<&str> = text.split(' ').collect();
            prop_assert_eq!(words[0].parse::<f64>().expect("a number").to_bits(), bits);
            prop_assert_eq!(words[1].parse::<f32>().expect("a number").to_bits(), (value as f32).to_bits());
            prop_assert_eq!(words[2].parse::<u64>().expect("a number"), integer);
        }
    }
}
