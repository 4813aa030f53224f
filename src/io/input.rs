//! Files as sources of triangles: streamed where the format allows, else read into memory.

use super::ply::{self, PlyFile};
use super::stl::{self, StlFile};
use super::{Encoding, Format};
use crate::error::{Error, Result};
use crate::mesh::{Bounds, Mesh, SourceCounts, TriangleSource};
use glam::DVec3;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes looked at to find out what a file is. A PLY header must fit in, or the file is read as a whole.
const PREFIX: u64 = 1 << 20;

/// An input file and its triangles.
///
/// Memory: binary STL files are not held at all; of binary PLY files only the vertices are, in the precision of the file;
/// all else is held as a [`Mesh`](crate::Mesh).
pub struct Input {
    info: InputInfo,
    source: Source,
}

/// Where the triangles are.
enum Source {
    Memory(Mesh),
    File(Box<dyn TriangleSource + Send>),
}

/// What is known of an input file before its triangles are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputInfo {
    /// Where it is.
    pub path: PathBuf,
    /// Its format, by its content.
    pub format: Format,
    /// How its numbers are written.
    pub encoding: Encoding,
    /// Its size.
    pub bytes: u64,
    /// Number of vertices. Unknown for streamed STL, which repeats them.
    pub points: Option<u64>,
    /// Number of polygons.
    pub polygons: u64,
    /// Whether each pass reads the file anew.
    pub is_streamed: bool,
    /// Bytes behind the end of what the format describes, which were ignored.
    pub trailing_bytes: u64,
}

impl std::fmt::Display for InputInfo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let InputInfo { path, format, encoding, bytes, points, polygons, trailing_bytes, .. } = self;
        write!(f, "{}: {format} ({encoding}), {bytes} bytes, ", path.display())?;
        if let Some(points) = points {
            write!(f, "{points} vertices, ")?;
        }
        write!(f, "{polygons} polygons")?;
        if *trailing_bytes > 0 {
            write!(f, "; {trailing_bytes} bytes behind the end were ignored")?;
        }
        Ok(())
    }
}

/// Opens a file as a source of triangles.
///
/// # Errors
/// When the file cannot be read, is of no known format, or is malformed as far as it is read now: faces of streamed files
/// are only looked at when they pass.
pub fn open(path: impl AsRef<Path>) -> Result<Input> {
    let path = path.as_ref();
    let io_error = |e| Error::io(path, "read", e);
    let mut file = File::open(path).map_err(io_error)?;
    let metadata = file.metadata().map_err(io_error)?;
    let mut bytes = Vec::new();
    if metadata.is_file() && metadata.len() > 0 {
        (&mut file).take(PREFIX).read_to_end(&mut bytes).map_err(io_error)?;
        if let Some(input) = open_streamed(path, file, metadata.len(), &bytes)? {
            return Ok(input);
        }
        bytes = std::fs::read(path).map_err(io_error)?;
    } else {
        file.read_to_end(&mut bytes).map_err(io_error)?;
    }
    let name = path.display().to_string();
    let format = Format::detect(&name, &bytes, bytes.len() as u64, Format::from_path(path))?;
    let parsed = super::parse(&name, &bytes, format)?;
    let info = InputInfo {
        path: path.to_owned(),
        format,
        encoding: parsed.encoding,
        bytes: bytes.len() as u64,
        points: Some(parsed.mesh.points.len() as u64),
        polygons: parsed.mesh.faces.len() as u64,
        is_streamed: false,
        trailing_bytes: parsed.trailing_bytes,
    };
    Ok(Input { info, source: Source::Memory(parsed.mesh) })
}

/// Opens a file that need not be held in memory, or gives `None` when it must.
fn open_streamed(path: &Path, file: File, len: u64, prefix: &[u8]) -> Result<Option<Input>> {
    let name = path.display().to_string();
    let is_short = prefix.len() as u64 == len;
    let mut info = InputInfo {
        path: path.to_owned(),
        format: Format::detect(&name, prefix, len, Format::from_path(path))?,
        encoding: Encoding::LittleEndian,
        bytes: len,
        points: None,
        polygons: 0,
        is_streamed: true,
        trailing_bytes: 0,
    };
    let source: Box<dyn TriangleSource + Send> = match info.format {
        Format::Stl if !stl::is_text(&super::text::decode(prefix), len) => {
            let stl = StlFile::open(path.to_owned(), file, len)?;
            info.polygons = stl.solids().triangles();
            info.trailing_bytes = stl.solids().trailing_bytes;
            Box::new(stl)
        }
        Format::Ply => match ply::Header::parse(&name, prefix) {
            Ok(header) => match PlyFile::open(path.to_owned(), file, len, &header)? {
                Some(ply) => {
                    info.encoding = header.encoding;
                    info.points = Some(header.points());
                    info.polygons = header.faces();
                    Box::new(ply)
                }
                None => return Ok(None),
            },
            Err(error) if is_short => return Err(error),
            Err(_) => return Ok(None),
        },
        _ => return Ok(None),
    };
    Ok(Some(Input { info, source: Source::File(source) }))
}

impl Input {
    /// What is known of the file.
    pub fn info(&self) -> &InputInfo {
        &self.info
    }

    /// The whole mesh, unless it is streamed.
    pub fn mesh(&self) -> Option<&Mesh> {
        match &self.source {
            Source::Memory(mesh) => Some(mesh),
            Source::File(_) => None,
        }
    }

    fn source(&self) -> &dyn TriangleSource {
        match &self.source {
            Source::Memory(mesh) => mesh,
            Source::File(file) => file.as_ref(),
        }
    }

    fn source_mut(&mut self) -> &mut dyn TriangleSource {
        match &mut self.source {
            Source::Memory(mesh) => mesh,
            Source::File(file) => file.as_mut(),
        }
    }
}

impl std::fmt::Debug for Input {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Input").field("info", &self.info).finish_non_exhaustive()
    }
}

impl TriangleSource for Input {
    fn bounds(&mut self) -> Result<Bounds> {
        self.source_mut().bounds()
    }

    fn triangles(&mut self, sink: &mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Result<SourceCounts> {
        self.source_mut().triangles(sink)
    }

    fn size_hint(&self) -> Option<u64> {
        self.source().size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Opens a file of the given content.
    fn open_bytes(name: &str, bytes: &[u8]) -> Result<(InputInfo, String)> {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        let info = open(&path)?.info().clone();
        let shown = info.to_string().replace(&format!("{}/", directory.path().display()), "");
        Ok((info, shown))
    }

    #[test]
    fn what_is_known_of_a_file_can_be_shown() {
        let (info, shown) = open_bytes("a.stl", &[[0; 84].as_slice(), b"behind"].concat()).expect("valid");
        assert!(info.is_streamed);
        assert_eq!(shown, "a.stl: STL (binary), 90 bytes, 0 polygons; 6 bytes behind the end were ignored");
        let (info, shown) = open_bytes("a.obj", b"v 0 0 0\nf 1").expect("valid");
        assert!(!info.is_streamed);
        assert_eq!(shown, "a.obj: OBJ (text), 11 bytes, 1 vertices, 1 polygons");
    }

    #[test]
    fn headers_longer_than_the_prefix_are_read_as_a_whole() {
        let comments = "comment long\n".repeat(PREFIX as usize / 12);
        let header = format!("ply\nformat binary_little_endian 1.0\n{comments}");
        let (info, _) =
            open_bytes("a.ply", format!("{header}element vertex 0\nend_header\n").as_bytes()).expect("valid");
        assert_eq!((info.is_streamed, info.points), (false, Some(0)));
        assert!(open_bytes("a.ply", header.as_bytes()).is_err());
    }
}
