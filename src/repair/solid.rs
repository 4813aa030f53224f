//! A solid on a grid, from a mesh or from a file, and what can be made of it.

use super::refined::refined;
use super::{Faces, Options, Surface};
use crate::contour::{CellVertices, DualOptions, Intersections, Placement, dual_contouring_edited, marching_cubes};
use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::io::OctreeFile;
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::{CellPoints, EditedOctree, SignedOctree, StoredPoints};
use crate::progress::Progress;
use crate::topology::{self, Round, TopologyReport, repair_topology_watched};

/// A solid: inside and outside on a grid, and where the surface crosses it.
///
/// It comes from [`solidify`](super::solidify), or from an octree file:
///
/// ```no_run
/// use zmend::progress::Silent;
/// use zmend::{Mesh, Options, Solid, Surface, io, topology};
///
/// let file = io::read_octree("part.sog", &Silent)?;
/// let solid = Solid::from(file);
/// // Handles of less than two square units are cut.
/// let thin = topology::Options { cut: Some(2.0), ..topology::Options::default() };
/// let (solid, report) = solid.mended(&thin, &Silent)?;
/// println!("{} cuts", report.cuts.len());
/// let options = Options { surface: Surface::DualContouring, ..Options::default() };
/// let mut mesh = Mesh::default();
/// solid.extract(&options, &mut mesh, &Silent)?;
/// # Ok::<(), zmend::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// Inside and outside, and what topology repair made of it.
    pub octree: EditedOctree,
    /// Where the grid lies.
    pub frame: Frame,
    /// Points that the cells with surface have already: [`Surface::DualContouring`] takes them.
    pub points: Option<StoredPoints>,
}

impl From<OctreeFile> for Solid {
    fn from(OctreeFile { octree, frame, points, .. }: OctreeFile) -> Self {
        Solid { octree: EditedOctree::unedited(octree), frame, points }
    }
}

impl Solid {
    /// A solid of signs and crossings.
    pub fn new(octree: SignedOctree, frame: Frame) -> Self {
        Solid { octree: EditedOctree::unedited(octree), frame, points: None }
    }

    /// Signs and crossings, which know nothing of cuts and fills.
    pub fn signed(&self) -> &SignedOctree {
        self.octree.signed()
    }

    /// Repairs the topology: see [`topology`]. Areas are in model units squared, volumes in model units cubed; those of the report are
    /// in squares of cells. Cuts and fills that were made before are forgotten.
    ///
    /// # Errors
    /// When an option is out of range, and `Cancelled`.
    pub fn mended(self, options: &topology::Options, progress: &dyn Progress) -> Result<(Solid, TopologyReport)> {
        self.mended_watched(options, &mut |_| Ok(()), progress)
    }

    /// As [`mended`](Self::mended), and shows each round to `watch`, a [`Trace`](super::Trace) for instance.
    ///
    /// # Errors
    /// As [`mended`](Self::mended), and whatever `watch` returns.
    pub fn mended_watched(
        self,
        options: &topology::Options,
        watch: &mut dyn FnMut(&Round<'_>) -> Result<()>,
        progress: &dyn Progress,
    ) -> Result<(Solid, TopologyReport)> {
        let Solid { octree, frame, points } = self;
        let in_cells = options.in_cells(frame.cell_size());
        let (octree, report) = repair_topology_watched(octree.into_signed(), &in_cells, watch, progress)?;
        Ok((Solid { octree, frame, points }, report))
    }

    /// Makes the topology that of a sketch in model units: see [`topology::conform`]. Cuts and fills that were made before are forgotten.
    ///
    /// # Errors
    /// When the sketch does not lie within the grid, is too fine for it, or comes by no part of the solid, and `Cancelled`.
    pub fn conformed(self, sketch: &topology::Sketch, progress: &dyn Progress) -> Result<(Solid, TopologyReport)> {
        let Solid { octree, frame, points } = self;
        let in_cells = sketch.moved(|at| ((glam::DVec3::from(at) - frame.origin()) / frame.cell_size()).to_array());
        let (octree, report) = topology::conform(octree.into_signed(), &in_cells, progress)?;
        Ok((Solid { octree, frame, points }, report))
    }

    /// The same solid told by signs alone, as octree files need it: itself if there are no cuts and fills, and otherwise on a grid twice
    /// as fine. Its topology is the same; its surface is drawn back to within half an old cell of what is inside.
    ///
    /// # Errors
    /// When the grid is as fine as can be already, or something was added on the side of its cube.
    pub fn told_by_signs(self) -> Result<Solid> {
        if !self.octree.is_edited() {
            return Ok(self);
        }
        let (octree, frame) = refined(&self.octree, &self.frame)?;
        Ok(Solid::new(octree, frame))
    }

    /// Extracts the surface that the options ask for and passes it to `sink`; returns its size. Depth, scale and topology play no part.
    ///
    /// # Errors
    /// When the surface needs normals and the octree has none, whatever `sink` returns, and `Cancelled`.
    pub fn extract(
        &self,
        options: &Options,
        sink: &mut (dyn MeshSink + Send),
        progress: &dyn Progress,
    ) -> Result<MeshSizes> {
        let Solid { octree, frame, points } = self;
        let is_marching = options.surface == Surface::MarchingCubes;
        if is_marching && !octree.is_edited() {
            return marching_cubes(octree.signed(), frame, sink, progress);
        }
        let placement = match points {
            Some(points) if options.surface == Surface::DualContouring => Placement::Given { points, frame },
            // What lies next to the points of marching cubes.
            _ if is_marching => Placement::MassPoint,
            _ => self.placement(options.surface)?,
        };
        let intersections = if options.no_self_intersections { Intersections::Avoid } else { Intersections::Allow };
        let triangles = match options.faces {
            Faces::Auto => options.surface == Surface::DualContouring || is_marching,
            Faces::Triangles => true,
            Faces::Polygons => is_marching,
        };
        dual_contouring_edited(octree, frame, &DualOptions { placement, triangles, intersections }, sink, progress)
    }

    /// One point for each cell with surface, for SOG files: where `surface` has its vertices. Marching cubes have none, and take those of
    /// dual contouring; these are the ones that are known already, if there are any.
    ///
    /// # Errors
    /// When the points need normals and the octree has none.
    pub fn cell_points(&self, surface: Surface) -> Result<Box<dyn CellPoints + '_>> {
        let is_sharp = matches!(surface, Surface::DualContouring | Surface::MarchingCubes);
        match &self.points {
            Some(points) if is_sharp => Ok(Box::new(points)),
            _ => Ok(Box::new(CellVertices::new(self.frame, self.placement(surface)?))),
        }
    }

    /// Where dual contouring places vertices of its own.
    fn placement(&self, surface: Surface) -> Result<Placement<'static>> {
        match surface {
            Surface::Quads => Ok(Placement::MassPoint),
            Surface::Blocks => Ok(Placement::Centre),
            Surface::DualContouring | Surface::MarchingCubes => {
                let crossings = self.signed().crossings();
                if crossings.with_normals() || crossings.is_empty() {
                    return Ok(Placement::SharpFeatures);
                }
                let problem = "sharp features need normals, which this octree has not";
                Err(Error::setting("surface", problem, "take mc, quads or blocks"))
            }
        }
    }
}
