//! A solid on a grid, from a mesh or from a file, and what can be made of it.

use super::{Faces, Options, Surface};
use crate::contour::{CellVertices, DualOptions, Intersections, Placement, dual_contouring, marching_cubes};
use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::{CellPoints, SignedOctree, StoredPoints};
use crate::progress::Progress;

/// A solid: inside and outside on a grid, and where the surface crosses it.
///
/// It comes from [`solidify`](super::solidify), or from an octree file:
///
/// ```no_run
/// use zmend::progress::Silent;
/// use zmend::{Mesh, Options, Solid, Surface, io};
///
/// let file = io::read_octree("part.sog", &Silent)?;
/// let solid = Solid { octree: file.octree, frame: file.frame, points: file.points };
/// let options = Options { surface: Surface::DualContouring, ..Options::default() };
/// let mut mesh = Mesh::default();
/// solid.extract(&options, &mut mesh, &Silent)?;
/// # Ok::<(), zmend::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Solid {
    /// Inside and outside.
    pub octree: SignedOctree,
    /// Where the grid lies.
    pub frame: Frame,
    /// Points that the cells with surface have already: [`Surface::DualContouring`] takes them.
    pub points: Option<StoredPoints>,
}

impl Solid {
    /// Extracts the surface that the options ask for and passes it to `sink`; returns its size. Depth and scale play no part.
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
        if options.surface == Surface::MarchingCubes {
            return marching_cubes(octree, frame, sink, progress);
        }
        let placement = match points {
            Some(points) if options.surface == Surface::DualContouring => Placement::Given { points, frame },
            _ => self.placement(options.surface)?,
        };
        let intersections = if options.no_self_intersections { Intersections::Avoid } else { Intersections::Allow };
        let triangles = match options.faces {
            Faces::Auto => options.surface == Surface::DualContouring,
            Faces::Triangles => true,
            Faces::Polygons => false,
        };
        dual_contouring(octree, frame, &DualOptions { placement, triangles, intersections }, sink, progress)
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
                let crossings = self.octree.crossings();
                if crossings.with_normals() || crossings.is_empty() {
                    return Ok(Placement::SharpFeatures);
                }
                let problem = "sharp features need normals, which this octree has not";
                Err(Error::setting("surface", problem, "take mc, quads or blocks"))
            }
        }
    }
}
