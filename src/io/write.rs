//! Writing meshes to files, whole or as they are made.

use super::Format;
use super::encode::{Encoder, LineEncoder, Out, Precision};
use super::file::AtomicFile;
use super::format::NAMES;
use super::ply::PlyEncoder;
use super::stl::StlEncoder;
use crate::error::{Error, Place, Result};
use crate::mesh::{Mesh, MeshSink, MeshSizes};
use glam::{DVec3, Vec3};
use std::path::{Path, PathBuf};

/// Bytes gathered before they are written.
const CHUNK: usize = 1 << 18;
/// Points or corners encoded at once, so that the buffer does not grow far beyond [`CHUNK`].
const PIECE: usize = 1 << 14;

/// How to write a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteOptions {
    /// Precision of the coordinates.
    pub precision: Precision,
    /// Text instead of binary, where a format has both.
    pub is_text: bool,
    /// The most corners that a face of a PLY file may have. Above 255, each face takes 3 bytes more.
    pub most_corners: usize,
}

impl Default for WriteOptions {
    fn default() -> Self {
        WriteOptions { precision: Precision::Single, is_text: false, most_corners: 255 }
    }
}

/// A file that takes a mesh piece by piece.
///
/// It has a temporary name until [`finish`](Self::finish), and is removed when dropped before. Memory: the buffer, and for
/// STL the positions.
pub struct Writer {
    path: PathBuf,
    file: AtomicFile,
    encoder: Box<dyn Encoder + Send>,
    out: Out,
    most_corners: usize,
    bytes: u64,
    promised: MeshSizes,
    received: MeshSizes,
}

/// Begins a file.
///
/// # Errors
/// When the file cannot be created.
pub fn create(path: impl AsRef<Path>, format: Format, options: WriteOptions) -> Result<Writer> {
    let path = path.as_ref();
    let WriteOptions { precision, is_text, most_corners } = options;
    let name = path.display().to_string();
    let encoder: Box<dyn Encoder + Send> = match (format, is_text, precision) {
        (Format::Ply, false, _) => Box::new(PlyEncoder::new(precision, most_corners)),
        (Format::Ply, true, _) => Box::new(LineEncoder::ply(precision, most_corners)),
        (Format::Stl, false, _) => Box::new(StlEncoder::binary(name)),
        (Format::Stl, true, Precision::Single) => Box::new(StlEncoder::<Vec3>::text(name, precision)),
        (Format::Stl, true, Precision::Double) => Box::new(StlEncoder::<DVec3>::text(name, precision)),
        #[cfg(feature = "gltf")]
        (Format::Glb, ..) => Box::new(super::gltf::GlbEncoder::new(name)),
        #[cfg(feature = "3mf")]
        (Format::ThreeMf, ..) => Box::new(super::threemf::ThreeMfEncoder::new(name, precision)),
        #[cfg(feature = "gltf")]
        (Format::Gltf, ..) => {
            let problem = "glTF is written in one binary file only";
            return Err(Error::format(name, Place::Whole, problem, "give it a name that ends in .glb"));
        }
        #[cfg(not(feature = "gltf"))]
        (Format::Gltf | Format::Glb, ..) => return Err(format.unknown(&name)),
        #[cfg(not(feature = "3mf"))]
        (Format::ThreeMf, ..) => return Err(format.unknown(&name)),
        (Format::Obj, ..) => Box::new(LineEncoder::obj(precision)),
        (Format::Off, ..) => Box::new(LineEncoder::off(precision)),
    };
    Ok(Writer {
        path: path.to_owned(),
        file: AtomicFile::create(path)?,
        encoder,
        out: Out::default(),
        // Only where one byte counts the corners is there a limit.
        most_corners: if format == Format::Ply && most_corners <= 255 { 255 } else { usize::MAX },
        bytes: 0,
        promised: MeshSizes::default(),
        received: MeshSizes::default(),
    })
}

/// Writes a mesh in the format that the name says, and returns the size of the file. Faces without any corner are left out.
///
/// # Errors
/// When the name says no format, or the file cannot be written.
pub fn write(path: impl AsRef<Path>, mesh: &Mesh, options: WriteOptions) -> Result<u64> {
    let path = path.as_ref();
    let format = Format::from_path(path).ok_or_else(|| {
        let remedy = format!("give it a name that ends in {NAMES}");
        Error::format(path.display().to_string(), Place::Whole, "the name says no format to write", remedy)
    })?;
    write_as(path, format, mesh, options)
}

/// Writes a mesh in a format, whatever the name says, and returns the size of the file. Faces without any corner are left out.
///
/// # Errors
/// When the file cannot be written.
pub fn write_as(path: impl AsRef<Path>, format: Format, mesh: &Mesh, options: WriteOptions) -> Result<u64> {
    let most_corners = mesh.faces.iter().map(<[u32]>::len).max().unwrap_or(0);
    let mut writer = create(path, format, WriteOptions { most_corners, ..options })?;
    pass_on(mesh, &mut writer)?;
    writer.finish()
}

/// Passes a mesh to a sink. Faces without any corner are left out.
fn pass_on(mesh: &Mesh, sink: &mut dyn MeshSink) -> Result<()> {
    let faces = mesh.faces.iter().filter(|face| !face.is_empty()).count() as u64;
    let corners = mesh.faces.corners();
    sink.begin(MeshSizes { points: mesh.points.len() as u64, faces, corners: corners.len() as u64 })?;
    sink.points(&mesh.points)?;
    // Corners of neighbouring faces are neighbours: faces of one arity in a row are one slice.
    let mut start = 0;
    let mut end = 0;
    let mut arity = 0;
    for face in mesh.faces.iter().filter(|face| !face.is_empty()) {
        if face.len() != arity {
            if end > start {
                sink.faces(arity, &corners[start..end])?;
            }
            (start, arity) = (end, face.len());
        }
        end += face.len();
    }
    if end > start { sink.faces(arity, &corners[start..end]) } else { Ok(()) }
}

impl Writer {
    /// Completes the file, gives it its name and returns its size in bytes.
    ///
    /// # Errors
    /// When the file cannot be written or renamed, or when [`MeshSink::begin`] promised another mesh than came.
    pub fn finish(mut self) -> Result<u64> {
        if self.received != self.promised {
            let problem = format!("promised were {:?}, written {:?}", self.promised, self.received);
            return Err(self.error(problem, "this is a bug of the program that writes"));
        }
        let patch = self.encoder.end(&mut self.out);
        self.flush()?;
        if let Some(patch) = patch {
            self.file.patch(patch.position, &patch.bytes)?;
        }
        self.file.commit()?;
        Ok(self.bytes)
    }

    fn flush(&mut self) -> Result<()> {
        self.file.write(self.out.bytes())?;
        self.bytes += self.out.bytes().len() as u64;
        self.out.clear();
        Ok(())
    }

    fn flush_if_full(&mut self) -> Result<()> {
        if self.out.bytes().len() < CHUNK { Ok(()) } else { self.flush() }
    }

    #[cold]
    fn error(&self, problem: impl Into<String>, remedy: &str) -> Error {
        Error::format(self.path.display().to_string(), Place::Whole, problem, remedy)
    }
}

impl MeshSink for Writer {
    fn bytes_for(&self, sizes: MeshSizes) -> u64 {
        self.encoder.bytes_for(sizes)
    }

    fn begin(&mut self, sizes: MeshSizes) -> Result<()> {
        self.promised = sizes;
        self.encoder.begin(sizes, &mut self.out)
    }

    fn points(&mut self, points: &[DVec3]) -> Result<()> {
        for piece in points.chunks(PIECE) {
            self.encoder.points(piece, &mut self.out);
            self.flush_if_full()?;
        }
        self.received.points += points.len() as u64;
        Ok(())
    }

    fn faces(&mut self, arity: usize, corners: &[u32]) -> Result<()> {
        if arity > self.most_corners {
            let problem = format!("a face has {arity} corners, which one byte cannot count");
            return Err(self.error(problem, "set `most_corners` in the options"));
        }
        if arity == 0 || corners.is_empty() {
            return Ok(());
        }
        for piece in corners.chunks(arity * PIECE.div_ceil(arity)) {
            self.encoder.faces(arity, piece, &mut self.out)?;
            self.flush_if_full()?;
        }
        self.received.faces += (corners.len() / arity) as u64;
        self.received.corners += corners.len() as u64;
        Ok(())
    }
}

impl std::fmt::Debug for Writer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Writer").field("path", &self.path).field("bytes", &self.bytes).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_passes_on_unchanged() {
        let faces: [&[u32]; 7] = [&[0, 1, 2], &[2, 1, 0], &[], &[0, 1, 2, 3], &[3], &[1, 2], &[0, 2, 3]];
        let mesh = Mesh { points: vec![DVec3::X; 4], faces: faces.into_iter().collect() };
        let mut copy = Mesh::default();
        pass_on(&mesh, &mut copy).expect("memory");
        assert_eq!(copy.points, mesh.points);
        assert!(copy.faces.iter().eq(mesh.faces.iter().filter(|face| !face.is_empty())));
    }

    #[test]
    fn broken_promises_leave_no_file() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("a.ply");
        let mut writer = create(&path, Format::Ply, WriteOptions::default()).expect("created");
        writer.begin(MeshSizes { points: 2, faces: 0, corners: 0 }).expect("begun");
        writer.points(&[DVec3::X]).expect("written");
        assert!(writer.finish().expect_err("one is missing").to_string().contains("promised"));
        assert_eq!(std::fs::read_dir(directory.path()).expect("a directory").count(), 0);
    }

    #[test]
    fn too_much_for_a_format_is_an_error() {
        let directory = tempfile::tempdir().expect("a directory");
        let begin = |name: &str, sizes| {
            let path = directory.path().join(name);
            create(&path, Format::from_path(&path).expect("known"), WriteOptions::default())
                .expect("created")
                .begin(sizes)
        };
        let sizes = MeshSizes { points: 0, faces: 1 << 32, corners: 3 << 32 };
        assert!(
            begin("a.stl", sizes).expect_err("2^32").to_string().contains("binary STL can count 4294967295 at most")
        );
        assert!(begin("a.ply", sizes).is_ok());
        let mut writer = create(directory.path().join("b.ply"), Format::Ply, WriteOptions::default()).expect("created");
        assert!(writer.faces(256, &[0; 256]).is_err());
    }
}
