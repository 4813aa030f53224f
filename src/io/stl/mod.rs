//! STL: triangles without connection, as text or binary.
//!
//! Text is read word by word in any letter case; facets may have any number of vertices, solids may lack their name and
//! their end. Binary files may hold several solids one after another. Normals are ignored: corners say it all.

mod write;

pub(super) use write::StlEncoder;

use super::build::{Builder, Welder};
use super::bytes::Bytes;
use super::text::Text;
use super::{Encoding, Parsed, number};
use crate::error::{Error, Place, Result};
use crate::mesh::{Batch, Bounds, SourceCounts, TriangleSource};
use glam::{DVec3, Vec3};
use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::PathBuf;

/// Bytes before the triangles of a binary solid: 80 of any content, 4 of count.
pub(super) const HEADER: usize = 84;
/// Bytes of a triangle: normal, three corners, two bytes of attributes.
pub(super) const RECORD: usize = 50;

/// Whether a file of `len` bytes is a binary STL of one solid to the byte. `prefix` is its beginning.
pub(super) fn is_exactly_binary(prefix: &[u8], len: u64) -> bool {
    prefix.first_chunk().is_some_and(|header| HEADER as u64 + RECORD as u64 * triangles_in(header) == len)
}

/// Whether an STL file is text. `prefix` is its beginning; many binary files begin with `solid`, too.
pub(super) fn is_text(prefix: &[u8], len: u64) -> bool {
    let start = prefix.trim_ascii_start();
    let begins = |word: &str| start.get(..word.len()).is_some_and(|found| found.eq_ignore_ascii_case(word.as_bytes()));
    if is_exactly_binary(prefix, len) || !(begins("solid") || begins("facet")) {
        return false;
    }
    let start = &start[..start.len().min(4096)];
    let has = |word: &str| start.windows(word.len()).any(|found| found.eq_ignore_ascii_case(word.as_bytes()));
    let is_plain = start.iter().take(1024).all(|&b| b >= b' ' || b.is_ascii_whitespace());
    is_plain || has("endsolid") || (has("facet") && has("vertex"))
}

/// Reads a whole text file and welds bit-identical positions.
pub(super) fn parse_text(name: &str, bytes: &[u8]) -> Result<Parsed> {
    let mut builder = Builder::new(name);
    let mut welder = Welder::new();
    let mut corners = Vec::new();
    visit_facets(name, bytes, |facet| {
        corners.clear();
        for &point in facet {
            corners.push(welder.index(&mut builder, point)?);
        }
        builder.polygon(&corners)
    })?;
    Ok(Parsed { mesh: builder.finish(), encoding: Encoding::Text, trailing_bytes: 0 })
}

/// Reads a whole binary file in memory and welds bit-identical positions.
pub(super) fn parse_binary(name: &str, bytes: &[u8]) -> Result<Parsed> {
    let mut builder = Builder::new(name);
    let mut welder = Welder::new();
    let mut reader = Cursor::new(bytes);
    let solids = Solids::find(name, &mut reader, bytes.len() as u64)?;
    let triangles = solids.triangles() as usize;
    builder.reserve(0, triangles, 3 * triangles)?;
    solids.visit(name, &mut reader, |triangle| {
        let mut corners = [0; 3];
        for (corner, point) in corners.iter_mut().zip(triangle) {
            *corner = welder.index(&mut builder, point)?;
        }
        builder.polygon(&corners)
    })?;
    Ok(Parsed { mesh: builder.finish(), encoding: Encoding::LittleEndian, trailing_bytes: solids.trailing_bytes })
}

/// Calls `visit` with the corners of every facet.
fn visit_facets(name: &str, bytes: &[u8], mut visit: impl FnMut(&[DVec3]) -> Result<()>) -> Result<()> {
    let mut text = Text::new(name, bytes);
    let mut facet = Vec::new();
    loop {
        text.skip_blanks();
        let start = text.position();
        let word = text.word();
        let is = |keyword: &str| word.eq_ignore_ascii_case(keyword.as_bytes());
        if word.is_empty() {
            break;
        } else if is("vertex") {
            let mut coordinate = || {
                text.skip_blanks();
                text.number("a coordinate of a vertex")
            };
            facet.push(DVec3::new(coordinate()?, coordinate()?, coordinate()?));
        } else if is("endloop") || is("endfacet") || is("facet") || is("outer") || is("solid") || is("endsolid") {
            if !facet.is_empty() {
                visit(&facet)?;
                facet.clear();
            }
            if is("solid") || is("endsolid") {
                skip_solid_name(&mut text);
            }
        } else if is("color") || is("colour") {
            text.skip_line();
        } else if !(is("normal") || is("loop") || number::scan(word).is_some()) {
            let shown = String::from_utf8_lossy(&word[..word.len().min(40)]);
            let problem = format!("`{}` is no word of an STL file", shown.escape_debug());
            return Err(text.error_at(start, problem, "remove it or export the file again"));
        }
    }
    if facet.is_empty() { Ok(()) } else { Err(text.unexpected("`endloop`")) }
}

/// Skips a name of any words up to the end of the line, or up to `facet normal` where all stands on one line.
fn skip_solid_name(text: &mut Text<'_>) {
    loop {
        text.skip_spaces();
        let mut ahead = text.clone();
        let word = ahead.word();
        let is_facet = word.eq_ignore_ascii_case(b"facet") && {
            let mut ahead = ahead.clone();
            ahead.skip_spaces();
            ahead.word().eq_ignore_ascii_case(b"normal")
        };
        if word.is_empty() || is_facet {
            return;
        }
        *text = ahead;
    }
}

/// Where the triangles of a binary STL file are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Solids {
    /// Offset of the first triangle and number of triangles of each solid.
    solids: Vec<(u64, u64)>,
    /// Bytes behind the last solid, which mean nothing to an STL reader.
    pub(super) trailing_bytes: u64,
}

impl Solids {
    /// Follows the headers through a file of `len` bytes. The first solid must be whole; what does not look like a whole
    /// solid behind it is trailing bytes.
    pub(super) fn find(name: &str, reader: &mut (impl Read + Seek), len: u64) -> Result<Solids> {
        let mut solids = Vec::new();
        let mut start = 0;
        while len - start >= HEADER as u64 {
            let mut header = [0; HEADER];
            let read = reader.seek(SeekFrom::Start(start)).and_then(|_| reader.read_exact(&mut header));
            read.map_err(|e| Error::io(name, "read", e))?;
            let triangles = triangles_in(&header);
            let left = len - start - HEADER as u64;
            let is_padding = header == [0; HEADER] && start > 0;
            if is_padding || triangles * RECORD as u64 > left {
                break;
            }
            solids.push((start + HEADER as u64, triangles));
            start += HEADER as u64 + triangles * RECORD as u64;
        }
        let found = Solids { solids, trailing_bytes: len - start };
        found.check(name, reader, len)?;
        Ok(found)
    }

    /// Tells a file that is cut short, or lies about its count, from one that merely has something behind its end.
    fn check(&self, name: &str, reader: &mut (impl Read + Seek), len: u64) -> Result<()> {
        let mut header = [0; HEADER];
        let read = reader.seek(SeekFrom::Start(0)).and_then(|_| reader.read_exact(&mut header));
        if read.is_err() {
            let problem = format!("{len} bytes are neither the text `solid` nor a binary header of {HEADER} bytes");
            return Err(Error::format(name, Place::Whole, problem, "copy or export the file again"));
        }
        let left = len - HEADER as u64;
        let whole = left / RECORD as u64;
        let promised = triangles_in(&header);
        if self.solids.is_empty() || (self.triangles() == 0 && whole > 0 && self.trailing_bytes > 0) {
            let problem =
                format!("the header promises {promised} triangles, but {left} bytes with {whole} triangles follow");
            let remedy =
                format!("copy or export the file again, or set the count at byte 80 to {whole} to use what is there");
            return Err(Error::format(name, Place::Byte(80), problem, remedy));
        }
        Ok(())
    }

    /// Triangles of all solids.
    pub(super) fn triangles(&self) -> u64 {
        self.solids.iter().map(|(_, triangles)| triangles).sum()
    }

    /// Calls `visit` with every triangle.
    pub(super) fn visit<R: Read + Seek>(
        &self,
        name: &str,
        reader: &mut R,
        mut visit: impl FnMut([DVec3; 3]) -> Result<()>,
    ) -> Result<()> {
        for &(start, triangles) in &self.solids {
            reader.seek(SeekFrom::Start(start)).map_err(|e| Error::io(name, "read", e))?;
            let mut bytes = Bytes::new(name, &mut *reader, start, start + triangles * RECORD as u64);
            while bytes.left() > 0 {
                let (records, _) = bytes.fill(RECORD)?.as_chunks();
                let consumed = records.len() * RECORD;
                for record in records {
                    visit(corners(record))?;
                }
                if consumed == 0 {
                    return Err(
                        bytes.error("the file shrinks while it is read", "wait until it is written, then try again")
                    );
                }
                bytes.consume(consumed);
            }
        }
        Ok(())
    }
}

/// The count in a binary header.
fn triangles_in(header: &[u8; HEADER]) -> u64 {
    u64::from(u32::from_le_bytes([header[80], header[81], header[82], header[83]]))
}

/// The corners in a binary record.
fn corners(record: &[u8; RECORD]) -> [DVec3; 3] {
    let float = |at: usize| f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
    [12, 24, 36].map(|at| Vec3::new(float(at), float(at + 4), float(at + 8)).as_dvec3())
}

/// A binary STL file as a source of triangles. Nothing is held: each pass reads the file anew.
#[derive(Debug)]
pub(super) struct StlFile {
    path: PathBuf,
    file: File,
    solids: Solids,
    bounds: Option<Bounds>,
}

impl StlFile {
    /// Looks through the headers of a binary file of `len` bytes.
    pub(super) fn open(path: PathBuf, mut file: File, len: u64) -> Result<StlFile> {
        let solids = Solids::find(&path.display().to_string(), &mut file, len)?;
        Ok(StlFile { path, file, solids, bounds: None })
    }

    /// Where the triangles are.
    pub(super) fn solids(&self) -> &Solids {
        &self.solids
    }

    fn visit(&self, visit: impl FnMut([DVec3; 3]) -> Result<()>) -> Result<()> {
        self.solids.visit(&self.path.display().to_string(), &mut &self.file, visit)
    }
}

impl TriangleSource for StlFile {
    fn bounds(&mut self) -> Result<Bounds> {
        if let Some(bounds) = self.bounds {
            return Ok(bounds);
        }
        let mut bounds = Bounds::EMPTY;
        self.visit(|triangle| {
            for corner in triangle {
                bounds.add(corner);
            }
            Ok(())
        })?;
        self.bounds = Some(bounds);
        Ok(bounds)
    }

    fn triangles(&mut self, sink: &mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Result<SourceCounts> {
        let mut batch = Batch::new(sink);
        self.visit(|triangle| batch.triangle(triangle))?;
        batch.finish()
    }

    fn size_hint(&self) -> Option<u64> {
        Some(self.solids.triangles())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;

    const FACET: &str =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 -0\nendloop\nendfacet\n";

    fn text(text: &str) -> Result<Mesh> {
        assert!(is_text(text.as_bytes(), text.len() as u64), "{text}");
        Ok(parse_text("t.stl", text.as_bytes())?.mesh)
    }

    /// A binary solid of triangles that share an edge pairwise.
    fn binary(header: &str, triangles: u32) -> Vec<u8> {
        let mut bytes = header.as_bytes().to_vec();
        bytes.resize(80, b' ');
        bytes.extend(triangles.to_le_bytes());
        for i in 0..triangles {
            let corner = |n: u32| [n as f32, (n % 2) as f32, if n == 1 { -0.0 } else { 0.0 }];
            let floats = [[0.0; 3], corner(i), corner(i + 1), corner(i + 2)];
            bytes.extend(floats.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0xFF, 0xFF]);
        }
        bytes
    }

    #[test]
    fn text_is_read_as_exporters_write_it() {
        let two = format!("solid a\n{FACET}endsolid a\nsolid solid facet\n{FACET}endsolid\n");
        for variant in [
            two.clone(),
            two.to_uppercase(),
            two.replace('\n', "\r\n"),
            two.replace('\n', "\r"),
            two.replace("0 0 1", "nan -nan(ind) -1.#IND"),
            format!("\n \n{}", two.replace("endsolid", "color 1 0 0\nendsolid")),
            format!("solid\n{FACET}{FACET}").trim_end().to_owned(),
            format!("solid all on one line {}", two.replace('\n', " ")),
            format!("{FACET}{FACET}"),
        ] {
            let mesh = text(&variant).expect(&variant);
            assert_eq!((mesh.points.len(), mesh.faces.len()), (3, 2), "{variant}");
        }
    }

    #[test]
    fn facets_may_have_any_number_of_vertices() {
        let mesh = text(&format!("solid\n{}", FACET.replace("endloop", "vertex 0 1 0\nendloop"))).expect("valid");
        assert_eq!(mesh.faces.get(0), [0, 1, 2, 3]);
    }

    #[test]
    fn broken_text_is_an_error_with_its_line() {
        let message = |body: &str| text(&format!("solid\n{body}")).expect_err(body).to_string();
        assert!(message(&FACET.replace("vertex 1 0 0", "vertex 1 0")).contains("line 6: expected a coordinate"));
        assert!(message(&FACET.replace("vertex 1 0 0", "vortex 1 0 0")).contains("line 5: `vortex` is no word"));
        assert!(message(&FACET[..FACET.len() - 17]).contains("expected `endloop`, but the file ends here"));
    }

    #[test]
    fn binary_files_may_begin_with_solid_and_hold_several() {
        let one = binary("solid facet", 2);
        assert!(!is_text(&one, one.len() as u64));
        let mesh = parse_binary("t.stl", &one).expect("valid").mesh;
        assert_eq!((mesh.points.len(), mesh.faces.len()), (4, 2));

        let glued = [binary("a", 2), binary("b", 0), binary("c", 3)].concat();
        let parsed = parse_binary("t.stl", &glued).expect("valid");
        assert_eq!((parsed.mesh.points.len(), parsed.mesh.faces.len(), parsed.trailing_bytes), (5, 5, 0));

        for garbage in [vec![0; 200], vec![7; 83], vec![255; 1000]] {
            let parsed = parse_binary("t.stl", &[one.clone(), garbage.clone()].concat()).expect("valid");
            assert_eq!((parsed.mesh.faces.len(), parsed.trailing_bytes), (2, garbage.len() as u64));
        }
    }

    #[test]
    fn wrong_counts_are_errors_with_a_remedy() {
        let message = |bytes: &[u8]| parse_binary("t.stl", bytes).expect_err("wrong").to_string();
        let whole = binary("x", 3);
        assert_eq!(
            message(&whole[..whole.len() - 1]),
            "t.stl: byte 80: the header promises 3 triangles, but 149 bytes with 2 triangles follow; \
             copy or export the file again, or set the count at byte 80 to 2 to use what is there"
        );
        let mut none = whole.clone();
        none[80] = 0;
        assert!(message(&none).contains("promises 0 triangles, but 150 bytes with 3 triangles follow"));
        assert!(message(&whole[..50]).contains("50 bytes are neither"));
        assert!(message(b"").contains("0 bytes are neither"));
    }
}
