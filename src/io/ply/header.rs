//! The header of a PLY file, which is text in any encoding.

use super::super::Encoding;
use super::super::text::{self, Text};
use crate::error::{Error, Result};

/// What a PLY file says about itself.
#[derive(Debug, Clone)]
pub(in crate::io) struct Header {
    /// How the body is written.
    pub(in crate::io) encoding: Encoding,
    /// The groups of records in the body, in their order.
    pub(super) elements: Vec<Element>,
    /// Offset of the body in the file.
    pub(super) body: usize,
}

/// A group of records with the same properties.
#[derive(Debug, Clone)]
pub(super) struct Element {
    /// For example `vertex`.
    pub(super) name: String,
    /// Number of records.
    pub(super) count: u64,
    /// What each record holds.
    pub(super) properties: Vec<Property>,
}

/// A value or list of values in each record of an element.
#[derive(Debug, Clone)]
pub(super) struct Property {
    /// For example `x`.
    pub(super) name: String,
    /// What is stored.
    pub(super) kind: Kind,
}

/// What a property stores.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// One value.
    One(Scalar),
    /// A number of values and then these.
    List(Scalar, Scalar),
}

/// The type of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &[u8]) -> Option<Scalar> {
        Some(match name {
            b"char" | b"int8" => Scalar::I8,
            b"uchar" | b"uint8" => Scalar::U8,
            b"short" | b"int16" => Scalar::I16,
            b"ushort" | b"uint16" => Scalar::U16,
            b"int" | b"int32" => Scalar::I32,
            b"uint" | b"uint32" => Scalar::U32,
            b"long" | b"int64" => Scalar::I64,
            b"ulong" | b"uint64" => Scalar::U64,
            b"float" | b"float32" => Scalar::F32,
            b"double" | b"float64" => Scalar::F64,
            _ => return None,
        })
    }

    /// Bytes of a value in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }
}

impl Element {
    /// The positions of the properties `x`, `y`, `z`, or the first one that is missing.
    pub(super) fn coordinates(&self) -> Result<[usize; 3], &'static str> {
        let find = |name| self.one(name).ok_or(name);
        Ok([find("x")?, find("y")?, find("z")?])
    }

    /// The positions of the properties `nx`, `ny`, `nz`, if all are there.
    pub(super) fn normals(&self) -> Option<[usize; 3]> {
        Some([self.one("nx")?, self.one("ny")?, self.one("nz")?])
    }

    /// The position of a property with one value.
    fn one(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name == name && matches!(p.kind, Kind::One(_)))
    }

    /// The position of the list of vertex indices.
    pub(super) fn indices(&self) -> Option<usize> {
        let is_name = |name: &str| name == "vertex_indices" || name == "vertex_index";
        self.properties.iter().position(|p| is_name(&p.name) && matches!(p.kind, Kind::List(..)))
    }
}

/// Whether a file begins as PLY files do, perhaps behind blank lines.
pub(in crate::io) fn is_ply(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    start.starts_with(b"ply") && start.get(3).is_none_or(u8::is_ascii_whitespace)
}

impl Header {
    /// Reads the header at the beginning of `bytes`.
    pub(in crate::io) fn parse(name: &str, bytes: &[u8]) -> Result<Header> {
        let mut text = Text::new(name, bytes);
        text.skip_blanks();
        if !is_ply(bytes) {
            return Err(text.unexpected("`ply`"));
        }
        text.word();
        let has_old_mac_lines = matches!(text.rest(), [b'\r', next, ..] if *next != b'\n');
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            text.skip_blanks();
            let start = text.position();
            match text.word() {
                b"" => return Err(text.unexpected("`end_header`")),
                b"end_header" => break,
                b"format" => encoding = Some(parse_encoding(&mut text)?),
                b"element" => elements.push(parse_element(&mut text)?),
                b"property" => {
                    let property = parse_property(&mut text)?;
                    let Some(element) = elements.last_mut() else {
                        let problem = format!("property `{}` stands before any element", property.name);
                        return Err(text.error_at(start, problem, "export the file again"));
                    };
                    element.properties.push(property);
                }
                // Comments, and what else people put there.
                _ => {}
            }
            text.skip_line();
        }
        let Some(encoding) = encoding else {
            return Err(text.error("the header has no `format` line", "add one, for example `format ascii 1.0`"));
        };
        let blanks = text.rest().iter().take_while(|b| matches!(b, b' ' | b'\t')).count();
        text.advance(blanks);
        // Where lines end in CR alone, a LF belongs to the body.
        let newline = text::newline_length(text.rest());
        text.advance(if has_old_mac_lines { newline.min(1) } else { newline });
        Ok(Header { encoding, elements, body: text.position() })
    }

    /// Number of vertices promised.
    pub(in crate::io) fn points(&self) -> u64 {
        self.count("vertex")
    }

    /// Number of faces promised.
    pub(in crate::io) fn faces(&self) -> u64 {
        self.count("face")
    }

    /// Number of records of an element, 0 when there is none.
    fn count(&self, name: &str) -> u64 {
        self.elements.iter().filter(|e| e.name == name).map(|e| e.count).fold(0, u64::saturating_add)
    }
}

fn parse_encoding(text: &mut Text<'_>) -> Result<Encoding> {
    text.skip_spaces();
    let encoding = match text.peek_word() {
        b"ascii" => Encoding::Text,
        b"binary_little_endian" => Encoding::LittleEndian,
        b"binary_big_endian" => Encoding::BigEndian,
        _ => return Err(text.unexpected("`ascii`, `binary_little_endian` or `binary_big_endian`")),
    };
    text.word();
    Ok(encoding)
}

fn parse_element(text: &mut Text<'_>) -> Result<Element> {
    let name = parse_name(text, "the name of an element")?;
    text.skip_spaces();
    let start = text.position();
    let count = text.integer(format_args!("the number of `{name}`"))?;
    let count = u64::try_from(count)
        .map_err(|_| text.error_at(start, format!("the number of `{name}` is {count}"), "export the file again"))?;
    Ok(Element { name, count, properties: Vec::new() })
}

fn parse_property(text: &mut Text<'_>) -> Result<Property> {
    text.skip_spaces();
    let kind = if text.peek_word() == b"list" {
        text.word();
        Kind::List(parse_scalar(text)?, parse_scalar(text)?)
    } else {
        Kind::One(parse_scalar(text)?)
    };
    Ok(Property { name: parse_name(text, "the name of a property")?, kind })
}

fn parse_scalar(text: &mut Text<'_>) -> Result<Scalar> {
    text.skip_spaces();
    let scalar = Scalar::from_name(text.peek_word()).ok_or_else(|| text.unexpected("a type as `float` or `int`"))?;
    text.word();
    Ok(scalar)
}

fn parse_name(text: &mut Text<'_>, what: &str) -> Result<String, Error> {
    text.skip_spaces();
    let word = text.word();
    if word.is_empty() { Err(text.unexpected(what)) } else { Ok(String::from_utf8_lossy(word).into_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINES: [&str; 8] = [
        "ply",
        "format binary_little_endian 1.0",
        "comment end_header \\",
        "element   vertex\t7 ",
        "property float32 x",
        " element face 1",
        "property list uint8 int vertex_index",
        "end_header",
    ];

    #[test]
    fn headers_end_where_their_last_line_ends() {
        for newline in ["\n", "\r\n", "\r"] {
            let header = LINES.join(newline) + newline;
            for (before, body) in [("", "\nbody"), ("\n \n", "\n\nbody"), ("", "body")] {
                let bytes = format!("{before}{header}{body}");
                let parsed = Header::parse("t.ply", bytes.as_bytes()).expect("valid");
                assert_eq!(&bytes[parsed.body..], body, "{newline:?}");
                assert_eq!((parsed.encoding, parsed.points()), (Encoding::LittleEndian, 7));
                assert_eq!(parsed.elements[1].properties[0].kind, Kind::List(Scalar::U8, Scalar::I32));
            }
        }
    }

    #[test]
    fn errors_name_the_line() {
        let message =
            |line: &str| Header::parse("t.ply", format!("ply\n{line}").as_bytes()).expect_err(line).to_string();
        assert!(message("property float x\n").contains("line 2: property `x` stands before any element"));
        assert!(message("format binary 1.0\n").contains("line 2: expected `ascii`, "));
        assert!(message("element vertex many\n").contains("expected the number of `vertex`, found `many`"));
        assert!(message("element vertex -1\n").contains("the number of `vertex` is -1"));
        assert!(message("element vertex 1\nproperty vec3 x\n").contains("line 3: expected a type"));
        assert!(message("element vertex 1\nproperty float\n").contains("line 3: expected the name of a property"));
        assert!(message("end_header\n").contains("the header has no `format` line"));
        assert!(message("format ascii 1.0\n").contains("expected `end_header`, but the file ends here"));
        assert!(!is_ply(b"plywood") && is_ply(b"ply") && is_ply(b"\n ply\r"));
    }
}
