//! VTU: cells of simulations, for `ParaView` and other programs of the Visualization Toolkit.
//!
//! XML with numbers as text, or behind it as raw bytes. Cells have the data `level` and `side` (0 outside, 1 inside, 2 cut), points the
//! data `distance`, if it is known.

use super::encode::{Out, Precision};
use super::file::AtomicFile;
use crate::error::Result;
use crate::field::Hexahedra;
use crate::progress::{Progress, Stage, check};
use std::fmt::Write;
use std::path::Path;

/// The number of a hexahedron among the kinds of cells of the toolkit.
const HEXAHEDRON: u8 = 12;
/// Numbers encoded at a time.
const PIECE: usize = 1 << 14;

/// Pushes a number of an array, as text or in bytes.
type Push<'a> = Box<dyn Fn(usize, bool, &mut Out) + 'a>;

/// An array of the file: how it is named, and its numbers.
struct Array<'a> {
    name: &'static str,
    kind: &'static str,
    /// Bytes a number.
    size: usize,
    components: usize,
    len: usize,
    push: Push<'a>,
}

impl<'a> Array<'a> {
    /// Numbers `0..len`, each pushed as text or in bytes.
    fn new(
        name: &'static str,
        (kind, size): (&'static str, usize),
        components: usize,
        len: usize,
        push: impl Fn(usize, bool, &mut Out) + 'a,
    ) -> Self {
        Array { name, kind, size, components, len, push: Box::new(push) }
    }

    fn bytes(&self) -> u64 {
        (self.len * self.size) as u64
    }
}

fn push_float(value: f64, is_text: bool, out: &mut Out) {
    if is_text { out.push_number(value, Precision::Double) } else { out.push(&value.to_le_bytes()) }
}

fn push_long(value: u64, is_text: bool, out: &mut Out) {
    if is_text { out.push_integer(value) } else { out.push(&value.to_le_bytes()) }
}

fn push_byte(value: u8, is_text: bool, out: &mut Out) {
    if is_text { out.push_integer(u64::from(value)) } else { out.push(&[value]) }
}

/// Writes cells, with numbers as text or as bytes, and returns the size of the file.
///
/// # Errors
/// When the file cannot be written, and `Cancelled`.
pub fn write_vtu(path: impl AsRef<Path>, cells: &Hexahedra, is_text: bool, progress: &dyn Progress) -> Result<u64> {
    let (long, float, byte) = (("Int64", 8), ("Float64", 8), ("UInt8", 1));
    let Hexahedra { points, cells: corners, levels, sides, distances } = cells;
    let count = corners.len();
    let point_data =
        [Array::new("distance", float, 1, distances.len(), |i, text, out| push_float(distances[i], text, out))];
    let cell_data = [
        Array::new("level", byte, 1, count, |i, text, out| push_byte(levels[i], text, out)),
        Array::new("side", byte, 1, count, |i, text, out| push_byte(sides[i] as u8, text, out)),
    ];
    let point_arrays =
        [Array::new("points", float, 3, 3 * points.len(), |i, text, out| push_float(points[i / 3][i % 3], text, out))];
    let cell_arrays = [
        Array::new("connectivity", long, 1, 8 * count, |i, text, out| {
            push_long(u64::from(corners[i / 8][i % 8]), text, out);
        }),
        Array::new("offsets", long, 1, count, |i, text, out| push_long(8 * (i as u64 + 1), text, out)),
        Array::new("types", byte, 1, count, |_, text, out| push_byte(HEXAHEDRON, text, out)),
    ];
    let has_distances = distances.len() == points.len();
    let sections: [(&str, &[Array<'_>]); 4] = [
        ("PointData", if has_distances { &point_data } else { &[] }),
        ("CellData", &cell_data),
        ("Points", &point_arrays),
        ("Cells", &cell_arrays),
    ];
    let mut file = Output { file: AtomicFile::create(path.as_ref())?, out: Out::default(), bytes: 0 };
    progress.begin(Stage::Write, sections.iter().flat_map(|s| s.1).map(Array::bytes).sum());
    file.text(&format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{count}\">\n",
        points.len(),
    ));
    let mut offset = 0;
    for (section, arrays) in &sections {
        file.text(&format!("<{section}>\n"));
        for array in *arrays {
            let Array { name, kind, components, .. } = array;
            let mut tag = format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" ");
            if is_text {
                file.text(&(tag + "format=\"ascii\">\n"));
                file.numbers(array, true, progress)?;
                file.text("</DataArray>\n");
            } else {
                write!(tag, "format=\"appended\" offset=\"{offset}\"/>").expect("memory takes all that is written");
                file.text(&(tag + "\n"));
                offset += 8 + array.bytes();
            }
        }
        file.text(&format!("</{section}>\n"));
    }
    file.text("</Piece>\n</UnstructuredGrid>\n");
    if !is_text {
        // The mark before the first byte is no part of the data.
        file.text("<AppendedData encoding=\"raw\">\n_");
        for array in sections.iter().flat_map(|section| section.1) {
            file.out.push(&array.bytes().to_le_bytes());
            file.numbers(array, false, progress)?;
        }
        file.text("\n</AppendedData>\n");
    }
    file.text("</VTKFile>\n");
    file.flush()?;
    file.file.commit()?;
    Ok(file.bytes)
}

/// A file and what is not yet written to it.
struct Output {
    file: AtomicFile,
    out: Out,
    bytes: u64,
}

impl Output {
    fn text(&mut self, text: &str) {
        self.out.push(text.as_bytes());
    }

    fn numbers(&mut self, array: &Array<'_>, is_text: bool, progress: &dyn Progress) -> Result<()> {
        for i in 0..array.len {
            (array.push)(i, is_text, &mut self.out);
            if is_text {
                let ends_line = (i + 1) % 8 == 0 || i + 1 == array.len;
                self.out.push(if ends_line { b"\n" } else { b" " });
            }
            if (i + 1) % PIECE == 0 {
                check(progress)?;
                progress.advance((PIECE * array.size) as u64);
                self.flush()?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<()> {
        self.file.write(self.out.bytes())?;
        self.bytes += self.out.bytes().len() as u64;
        self.out.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Side;
    use crate::progress::Silent;
    use glam::DVec3;

    fn one_cell() -> Hexahedra {
        let corner = |i: u32| DVec3::new(f64::from(i >> 2), f64::from(i >> 1 & 1), f64::from(i & 1) * 0.5);
        Hexahedra {
            points: (0..8).map(corner).collect(),
            cells: vec![[0, 4, 6, 2, 1, 5, 7, 3]],
            levels: vec![5],
            sides: vec![Side::Cut],
            distances: (0..8).map(|i| f64::from(i) - 3.5).collect(),
        }
    }

    #[test]
    fn text_says_everything() {
        let path = tempfile::NamedTempFile::new().expect("a file");
        let bytes = write_vtu(path.path(), &one_cell(), true, &Silent).expect("written");
        let text = std::fs::read_to_string(path.path()).expect("text");
        assert_eq!(text.len() as u64, bytes);
        for part in [
            "NumberOfPoints=\"8\" NumberOfCells=\"1\"",
            "Name=\"distance\" NumberOfComponents=\"1\" format=\"ascii\">\n-3.5 -2.5 -1.5 -0.5 0.5 1.5 2.5 3.5\n<",
            "Name=\"level\" NumberOfComponents=\"1\" format=\"ascii\">\n5\n<",
            "Name=\"side\" NumberOfComponents=\"1\" format=\"ascii\">\n2\n<",
            "Name=\"points\" NumberOfComponents=\"3\" format=\"ascii\">\n0 0 0 0 0 0.5 0 1\n0 0 1 0.5 1 0 0 1\n",
            "0 4 6 2 1 5 7 3\n",
            "Name=\"offsets\" NumberOfComponents=\"1\" format=\"ascii\">\n8\n<",
            "Name=\"types\" NumberOfComponents=\"1\" format=\"ascii\">\n12\n<",
        ] {
            assert!(text.contains(part), "{part}\n{text}");
        }
    }

    #[test]
    fn bytes_are_where_their_offsets_say() {
        let path = tempfile::NamedTempFile::new().expect("a file");
        write_vtu(path.path(), &one_cell(), false, &Silent).expect("written");
        let bytes = std::fs::read(path.path()).expect("bytes");
        let mark = b"encoding=\"raw\">\n_";
        let start = bytes.windows(mark.len()).position(|w| w == mark).expect("data") + mark.len();
        let head = String::from_utf8_lossy(&bytes[..start]).into_owned();
        let array = |name: &str| {
            let tag = &head[head.find(&format!("Name=\"{name}\"")).expect("named")..];
            let digits = &tag[tag.find("offset=\"").expect("an offset") + 8..];
            let at = start + digits[..digits.find('"').expect("an end")].parse::<usize>().expect("a number");
            let len = u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes")) as usize;
            bytes[at + 8..at + 8 + len].to_vec()
        };
        assert_eq!((array("level"), array("side"), array("types")), (vec![5], vec![2], vec![12]));
        assert_eq!(array("distance")[..8], (-3.5f64).to_le_bytes());
        assert_eq!(array("points").len(), 8 * 24);
        let corners: Vec<u8> = array("connectivity").chunks(8).map(|c| c[0]).collect();
        assert_eq!(corners, [0, 4, 6, 2, 1, 5, 7, 3]);
        assert!(bytes.ends_with(b"\n</AppendedData>\n</VTKFile>\n"));
    }
}
