//! Which format a file has, from its content first.

#[cfg(feature = "gltf")]
use super::gltf;
#[cfg(feature = "3mf")]
use super::threemf;
use super::{off, ply, stl, text};
use crate::error::{Error, Place, Result};
use std::fmt;
use std::path::Path;

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Stereolithography: triangles without connection; text or binary.
    Stl,
    /// Polygon file format (Stanford); text or binary.
    Ply,
    /// Wavefront OBJ; text.
    Obj,
    /// Object file format (Geomview); text.
    Off,
    /// glTF 2.0 with its document as text; read only. Needs the feature `gltf`.
    Gltf,
    /// glTF 2.0 in one binary file. Needs the feature `gltf`.
    Glb,
    /// 3D Manufacturing Format: XML in a ZIP archive. Needs the feature `3mf`.
    ThreeMf,
}

/// How names of files to write may end.
pub(super) const NAMES: &str = ".stl, .ply, .obj, .off, .glb or .3mf";

/// How numbers are written in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// As decimal text.
    Text,
    /// As binary numbers with the least significant byte first.
    LittleEndian,
    /// As binary numbers with the most significant byte first.
    BigEndian,
}

impl Format {
    /// The format that the end of a file's name says, in any letter case.
    pub fn from_path(path: impl AsRef<Path>) -> Option<Format> {
        match path.as_ref().extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "stl" => Some(Format::Stl),
            "ply" => Some(Format::Ply),
            "obj" => Some(Format::Obj),
            "off" => Some(Format::Off),
            "gltf" => Some(Format::Gltf),
            "glb" => Some(Format::Glb),
            "3mf" => Some(Format::ThreeMf),
            _ => None,
        }
    }

    /// The usual end of file names, in lower case.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Stl => "stl",
            Format::Ply => "ply",
            Format::Obj => "obj",
            Format::Off => "off",
            Format::Gltf => "gltf",
            Format::Glb => "glb",
            Format::ThreeMf => "3mf",
        }
    }

    /// Whether faces of more than three corners are cut when they are written.
    pub fn has_only_triangles(self) -> bool {
        matches!(self, Format::Stl | Format::Gltf | Format::Glb | Format::ThreeMf)
    }

    /// Whether coordinates can be written in no more than single precision.
    pub fn is_single(self, is_text: bool) -> bool {
        matches!(self, Format::Stl if !is_text) || matches!(self, Format::Gltf | Format::Glb)
    }

    /// The error for a format of which this build knows nothing but the name.
    #[cfg(not(all(feature = "gltf", feature = "3mf")))]
    #[cold]
    pub(super) fn unknown(self, name: &str) -> Error {
        let feature = if self == Format::ThreeMf { "3mf" } else { "gltf" };
        let problem = format!("{self} is not among the formats of this build");
        Error::format(name, Place::Whole, problem, format!("build zmend with the feature `{feature}`"))
    }

    /// The format of a file of `len` bytes that begins with `prefix`: what the content says for sure, else `hint`, else
    /// what the content looks like.
    pub(super) fn detect(name: &str, prefix: &[u8], len: u64, hint: Option<Format>) -> Result<Format> {
        Format::sniff(prefix, len).or(hint).or_else(|| looks_like_obj(prefix).then_some(Format::Obj)).ok_or_else(|| {
            let problem = "neither the content nor the name says which format this is";
            Error::format(name, Place::Whole, problem, format!("give it a name that ends in {NAMES}"))
        })
    }

    /// The format that the content says for sure.
    fn sniff(prefix: &[u8], len: u64) -> Option<Format> {
        if stl::is_exactly_binary(prefix, len) {
            return Some(Format::Stl);
        }
        #[cfg(feature = "3mf")]
        if threemf::is_zip(prefix) {
            return Some(Format::ThreeMf);
        }
        #[cfg(feature = "gltf")]
        if prefix.starts_with(gltf::MAGIC) {
            return Some(Format::Glb);
        } else if gltf::is_text(prefix) {
            return Some(Format::Gltf);
        }
        let text = text::decode(prefix);
        let mut cursor = text::Text::new("", &text);
        cursor.skip_blanks();
        if ply::is_ply(&text) {
            Some(Format::Ply)
        } else if off::keyword(cursor.rest()).is_some() {
            Some(Format::Off)
        } else if stl::is_text(&text, len) {
            Some(Format::Stl)
        } else {
            None
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Format::Stl => "STL",
            Format::Ply => "PLY",
            Format::Obj => "OBJ",
            Format::Off => "OFF",
            Format::Gltf => "glTF",
            Format::Glb => "GLB",
            Format::ThreeMf => "3MF",
        })
    }
}

impl fmt::Display for Encoding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Encoding::Text => "text",
            Encoding::LittleEndian => "binary",
            Encoding::BigEndian => "binary, big endian",
        })
    }
}

/// Whether the first statement is one of OBJ.
fn looks_like_obj(prefix: &[u8]) -> bool {
    let text = text::decode(prefix);
    let mut cursor = text::Text::with_continued_lines("", &text);
    cursor.skip_blanks();
    matches!(cursor.word(), b"v" | b"vn" | b"vt" | b"f" | b"o" | b"g" | b"s" | b"mtllib" | b"usemtl")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_goes_before_the_name() {
        let detect = |bytes: &[u8], hint| Format::detect("t", bytes, bytes.len() as u64, hint).ok();
        assert_eq!(detect(b"ply\nformat", Some(Format::Obj)), Some(Format::Ply));
        assert_eq!(detect(b"\n# x\n COFF\n1 1 0", Some(Format::Stl)), Some(Format::Off));
        assert_eq!(detect(b"\r\nSOLID x\nfacet", Some(Format::Ply)), Some(Format::Stl));
        assert_eq!(detect(&[0; 84], Some(Format::Ply)), Some(Format::Stl));
        assert_eq!(detect(b"# c\nv 1 2 3", None), Some(Format::Obj));
        assert_eq!(detect(b"# c\nv 1 2 3", Some(Format::Off)), Some(Format::Off));
        assert_eq!(detect(b"hello", None), None);
        assert_eq!(detect(b"", None), None);
    }

    #[test]
    fn names_say_formats_in_any_case() {
        assert_eq!(Format::from_path("a/b.c.StL"), Some(Format::Stl));
        let all = [Format::Stl, Format::Ply, Format::Obj, Format::Off, Format::Gltf, Format::Glb, Format::ThreeMf];
        for format in all {
            assert_eq!(Format::from_path(format!("x.{}", format.extension())), Some(format));
        }
        assert_eq!(Format::from_path("stl"), None);
        assert_eq!(Format::from_path("x.jpeg"), None);
    }
}
