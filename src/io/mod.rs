//! Reading and writing files.
//!
//! The content of a file says its format; its name is asked only where the content does not. [`read`] gives a [`Mesh`],
//! [`open`] a source of triangles that is streamed where the format allows, [`create`] a sink that writes as faces come.
//!
//! Readers take what exporters really write, and never panic, hang or allocate more than a small multiple of the file:
//! they give a mesh with everything the file holds, or an error that names the place and the remedy.
//!
//! | format | names | read | written | needs |
//! |---|---|---|---|---|
//! | STL | `.stl` | binary (streamed) and text | both | |
//! | PLY | `.ply` | binary (streamed) and text | both | |
//! | OBJ | `.obj` | polygons | polygons | |
//! | OFF | `.off` | polygons | polygons | |
//! | glTF 2.0 | `.glb`, `.gltf` | triangles, strips and fans of the default scene | `.glb` | feature `gltf` |
//! | 3MF | `.3mf` | all that is to be built | one object | feature `3mf` |
//!
//! Scenes of parts (glTF, 3MF) become one mesh, with the transforms of their nodes, items and components applied.
//!
//! Clouds of points, XYZ or PLY, come by [`read_cloud`] and go by [`write_cloud`] or a [`CloudWriter`]. Cells of simulations
//! go to VTU files by [`write_vtu`].
//!
//! Signed octrees in SOF, SOG and DCF files ([`OctreeFormat`]) come and go by [`read_octree`], [`write_sof`], [`write_sog`] and
//! [`write_dcf`]. Volumes have a [module](volume) of their own, and so have [sketches](sketch).
//!
//! ```
//! use zmend::io;
//!
//! let text = b"OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
//! let mesh = io::read_bytes("square", text, None)?;
//! assert_eq!(mesh.faces.get(0), [0, 1, 2, 3]);
//! # Ok::<(), zmend::Error>(())
//! ```

mod build;
mod bytes;
mod encode;
mod file;
mod format;
#[cfg(feature = "gltf")]
mod gltf;
mod input;
mod number;
mod obj;
mod octree;
mod off;
mod ply;
mod points;
#[cfg(any(feature = "gltf", feature = "3mf"))]
mod scene;
pub mod skeleton;
pub mod sketch;
pub mod skt;
mod stl;
mod text;
#[cfg(feature = "3mf")]
mod threemf;
pub mod volume;
mod vtu;
mod write;

pub use encode::Precision;
pub use format::{Encoding, Format};
pub use input::{Input, InputInfo, open};
pub use octree::{
    OctreeFile, OctreeFormat, OctreeInfo, read_octree, read_octree_bytes, write_dcf, write_sof, write_sog,
};
pub use points::{CloudFormat, CloudWriter, read_cloud, read_cloud_bytes, write_cloud};
pub use vtu::write_vtu;
pub use write::{WriteOptions, Writer, create, write, write_as};

use crate::error::{Error, Place, Result};
use crate::mesh::Mesh;
use std::path::Path;

/// What a reader found in a whole file.
#[derive(Debug)]
struct Parsed {
    mesh: Mesh,
    encoding: Encoding,
    /// Bytes behind the end of what the format describes.
    trailing_bytes: u64,
}

/// Reads a file of any format into memory. Polygons stay polygons; the triangles of STL files are welded where their
/// corners are bit-identical.
///
/// # Errors
/// When the file cannot be read, is of no known format, or is malformed.
pub fn read(path: impl AsRef<Path>) -> Result<Mesh> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    read_bytes(&path.display().to_string(), &bytes, Format::from_path(path))
}

/// Reads the bytes of a file of any format. `name` stands in error messages; `hint` is used where the content does not say
/// its format.
///
/// # Errors
/// When the bytes are of no known format, or malformed.
pub fn read_bytes(name: &str, bytes: &[u8], hint: Option<Format>) -> Result<Mesh> {
    let format = Format::detect(name, bytes, bytes.len() as u64, hint)?;
    Ok(parse(name, bytes, format)?.mesh)
}

/// Reads bytes of a known format.
fn parse(name: &str, bytes: &[u8], format: Format) -> Result<Parsed> {
    if bytes.is_empty() {
        return Err(Error::format(name, Place::Whole, "the file is empty", "copy or export it again"));
    }
    match format {
        #[cfg(feature = "gltf")]
        Format::Gltf => gltf::parse_text(name, bytes),
        #[cfg(feature = "gltf")]
        Format::Glb => gltf::parse_binary(name, bytes),
        #[cfg(not(feature = "gltf"))]
        Format::Gltf | Format::Glb => Err(format.unknown(name)),
        #[cfg(feature = "3mf")]
        Format::ThreeMf => threemf::parse(name, bytes),
        #[cfg(not(feature = "3mf"))]
        Format::ThreeMf => Err(format.unknown(name)),
        Format::Ply => ply::parse(name, bytes),
        Format::Obj => obj::parse(name, &text::decode(bytes)),
        Format::Off => off::parse(name, &text::decode(bytes)),
        Format::Stl => {
            let text = text::decode(bytes);
            let is_text = !stl::is_exactly_binary(bytes, bytes.len() as u64) && stl::is_text(&text, text.len() as u64);
            if is_text { stl::parse_text(name, &text) } else { stl::parse_binary(name, bytes) }
        }
    }
}
