//! Meshes that pass by: sources that yield triangles without holding them, sinks that take a mesh as it is made.

use super::{Mesh, Polygons};
use crate::error::Result;
use crate::geom::Bounds;
use glam::DVec3;

/// What a source has passed on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SourceCounts {
    /// Polygons of the input.
    pub polygons: u64,
    /// Triangles they were cut into.
    pub triangles: u64,
}

/// Triangles in a repeatable order, readable any number of times. A file can be one without being held in memory.
pub trait TriangleSource {
    /// Bounds of the points that faces use; points that are not finite are left out.
    ///
    /// # Errors
    /// When the input cannot be read or is malformed.
    fn bounds(&mut self) -> Result<Bounds>;

    /// Calls `sink` with batches of triangles (some thousands each) until all have passed or `sink` fails.
    /// Corners that are not finite are passed on as they are.
    ///
    /// # Errors
    /// When the input cannot be read or is malformed, and whatever `sink` returns.
    fn triangles(&mut self, sink: &mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Result<SourceCounts>;

    /// Number of triangles if known beforehand, for progress bars.
    fn size_hint(&self) -> Option<u64> {
        None
    }
}

/// The exact size of a mesh that is about to be passed to a [`MeshSink`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MeshSizes {
    /// Number of points.
    pub points: u64,
    /// Number of faces.
    pub faces: u64,
    /// Sum of the numbers of corners of all faces.
    pub corners: u64,
}

/// Takes a mesh piece by piece: [`begin`](Self::begin), then all points, then all faces.
pub trait MeshSink {
    /// Bytes that the sink is going to hold of a mesh of such sizes, buffers aside. None, unless it says otherwise.
    fn bytes_for(&self, sizes: MeshSizes) -> u64 {
        let _ = sizes;
        0
    }

    /// Says how much will come.
    ///
    /// # Errors
    /// When the sink cannot take that much, or cannot write.
    fn begin(&mut self, sizes: MeshSizes) -> Result<()>;

    /// Takes the next points, in model units.
    ///
    /// # Errors
    /// When the sink cannot write.
    fn points(&mut self, points: &[DVec3]) -> Result<()>;

    /// Takes the next faces, all with `arity` corners, as indices into the points; `corners.len()` is a multiple of `arity`.
    ///
    /// # Errors
    /// When the sink cannot write.
    fn faces(&mut self, arity: usize, corners: &[u32]) -> Result<()>;
}

/// What the mesh held before is replaced.
impl MeshSink for Mesh {
    fn bytes_for(&self, sizes: MeshSizes) -> u64 {
        let index = size_of::<u32>() as u64;
        // Polygons have three corners or more: these are all triangles, whose ends are not listed.
        let ends = if sizes.corners == 3 * sizes.faces { 0 } else { sizes.faces };
        sizes.points * size_of::<DVec3>() as u64 + (ends + sizes.corners) * index
    }

    fn begin(&mut self, sizes: MeshSizes) -> Result<()> {
        self.points.clear();
        self.points.reserve_exact(sizes.points as usize);
        self.faces = Polygons::default();
        self.faces.reserve_exact(sizes.faces as usize, sizes.corners as usize);
        Ok(())
    }

    fn points(&mut self, points: &[DVec3]) -> Result<()> {
        self.points.extend_from_slice(points);
        Ok(())
    }

    fn faces(&mut self, arity: usize, corners: &[u32]) -> Result<()> {
        self.faces.push_all(arity, corners);
        Ok(())
    }
}
