//! Octree files: SOF, SOG and DCF, bit by bit as `PolyMender` writes and `TopoMender` reads them.
//!
//! | format | what it holds | normals | where it lies | recognised by |
//! |---|---|---|---|---|
//! | SOF | signs | no | a unit cube | its name |
//! | SOG | signs, a point in each surface cell | from the points | the file says | content |
//! | DCF | signs, Hermite samples of edges | yes | a unit cube | content |
//!
//! All three are an octree in depth-first order, child and corner 4x + 2y + z, with the least significant byte first. See `sof`, `sog` and
//! `dcf` for the layouts, `encode` for what is written, `decode` and `check` for what is read.
//!
//! # Writing
//!
//! Surface cells are the finest cells with corners of both signs, and empty nodes are as large as possible. (`PolyMender` also writes
//! cells that the surface touches without changing a sign: one in two hundred or so.) The file is written as it is made and appears when it
//! is complete.
//!
//! # Reading
//!
//! Every file that is read gives an octree that all of this library can work with, or an error: nodes of unknown type, cut files, cells
//! that disagree on a lattice point that they share are refused. A solid that touches the side of its cube ends there, in a grid four times
//! as wide (see `pad`). Surface cells without a change of sign are taken as empty, at any level; those with one that are not at the finest
//! level are divided (see `coarse`). Grids of 1, 2 and 4 cells a side become the least corner of one of 8, with cells of the same size.
//!
//! What a file does not say of a crossing is filled in. SOF says nothing: crossings lie half way, and there are no normals. From the
//! points of SOG, each crossing lies where its edge meets the plane that fits the points of its four cells best (its normal is the
//! cross product of their diagonals), or beside their mean where the plane is parallel to the edge. In DCF an edge without a sample is
//! crossed half way, at a right angle. Writing what was read gives the same file again, if it came from here.

mod check;
mod coarse;
mod dcf;
mod decode;
mod dialect;
mod encode;
mod fill;
mod pad;
mod read;
mod sof;
mod sog;
mod write;

pub use read::{read_octree, read_octree_bytes};
pub use write::{write_dcf, write_sof, write_sog};

use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::octree::{SignedOctree, StoredPoints};
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A format of octree files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum OctreeFormat {
    /// Signed octree.
    Sof,
    /// Signed octree with geometry.
    Sog,
    /// Signed octree with Hermite samples.
    Dcf,
}

impl OctreeFormat {
    /// The format that the end of a file's name says, in any letter case.
    pub fn from_path(path: impl AsRef<Path>) -> Option<OctreeFormat> {
        let extension = path.as_ref().extension()?.to_str()?.to_ascii_lowercase();
        [OctreeFormat::Sof, OctreeFormat::Sog, OctreeFormat::Dcf].into_iter().find(|f| f.extension() == extension)
    }

    /// The usual end of file names, in lower case.
    pub fn extension(self) -> &'static str {
        match self {
            OctreeFormat::Sof => "sof",
            OctreeFormat::Sog => "sog",
            OctreeFormat::Dcf => "dcf",
        }
    }

    /// The format of a file that begins with `prefix`: what the content says, else `hint`. `None` is no octree, as far as can be told.
    fn detect(prefix: &[u8], hint: Option<OctreeFormat>) -> Option<OctreeFormat> {
        if prefix.starts_with(&sog::MAGIC[..10]) {
            Some(OctreeFormat::Sog)
        } else if prefix.starts_with(dcf::MAGIC) {
            Some(OctreeFormat::Dcf)
        } else {
            hint
        }
    }

    /// The format of an existing file, if it is that of an octree: by its content, or by its name where the content is silent.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn of_file(path: impl AsRef<Path>) -> Result<Option<OctreeFormat>> {
        let path = path.as_ref();
        let hint = OctreeFormat::from_path(path);
        // What comes through a pipe can be read only once.
        if !path.is_file() {
            return Ok(hint);
        }
        let mut prefix = Vec::new();
        let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
        file.take(16).read_to_end(&mut prefix).map_err(|e| Error::io(path, "read", e))?;
        Ok(OctreeFormat::detect(&prefix, hint))
    }
}

impl fmt::Display for OctreeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.extension().to_uppercase())
    }
}

/// What was read of an octree file.
#[derive(Debug, Clone)]
pub struct OctreeFile {
    /// The solid; with normals unless it comes from SOF.
    pub octree: SignedOctree,
    /// Where its grid lies.
    pub frame: Frame,
    /// The points of the surface cells, as SOG files have them.
    pub points: Option<StoredPoints>,
    /// What the file held.
    pub info: OctreeInfo,
}

/// What an octree file held.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OctreeInfo {
    /// What it was called.
    pub path: PathBuf,
    /// Its format.
    pub format: OctreeFormat,
    /// Its size.
    pub bytes: u64,
    /// log2 of the number of cells a side, which may be below the least depth of the grid, 3.
    pub depth: u32,
    /// Surface cells (leaves of type 2).
    pub surface_cells: u64,
    /// Those of them with all corners inside.
    pub surface_cells_inside: u64,
    /// Those of them with all corners outside.
    pub surface_cells_outside: u64,
    /// Empty nodes of any size (leaves of type 1).
    pub empty_cells: u64,
    /// Crossed edges of which the file has no sample although its format could.
    pub missing_samples: u64,
    /// Bytes behind the end of the octree, which were ignored.
    pub trailing_bytes: u64,
    /// Whether the solid touches the side of its cube: then that is the one in the middle of a grid of four times as many cells a side.
    pub is_padded: bool,
}

impl fmt::Display for OctreeInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let OctreeInfo { path, format, bytes, depth, surface_cells, trailing_bytes, .. } = self;
        let cells = 1u32 << depth;
        write!(f, "{}: {format}, {bytes} bytes, {cells} cells a side, {surface_cells} surface cells", path.display())?;
        if *trailing_bytes > 0 {
            write!(f, "; {trailing_bytes} bytes behind the end were ignored")?;
        }
        Ok(())
    }
}
