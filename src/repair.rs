//! The pipeline: any bag of polygons in, a closed, manifold, consistently oriented surface out.

use crate::contour::{DualOptions, Intersections, Placement, dual_contouring, marching_cubes};
use crate::error::Result;
use crate::geom::Frame;
use crate::mesh::{Bounds, Mesh, MeshSink, MeshSizes, TriangleSource};
use crate::octree::SignedOctree;
use crate::progress::{Progress, Silent, Stage};
use crate::sign::{Closing, ScanCounts, close, parity_signs, scan};
use std::fmt;
use std::time::{Duration, Instant};

/// How to repair: `Options { depth: 9, ..Options::default() }`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// log2 of the number of cells a side of the grid, 3 ..= 18. Each level more resolves half the size and costs four times as
    /// much. Default 8: 256 cells.
    pub depth: u32,
    /// Part of the grid's side that the longest side of the model takes, above 0 and below 1. Default 0.9.
    pub scale: f64,
    /// Which surface is extracted. Default [`Surface::MarchingCubes`].
    pub surface: Surface,
    /// What the faces are. Default [`Faces::Auto`].
    pub faces: Faces,
    /// Whether faces must not pass through each other: see [`Intersections`]. Marching cubes and blocks have no such faces in any case,
    /// whatever this says. Default false.
    pub no_self_intersections: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            depth: 8,
            scale: 0.9,
            surface: Surface::default(),
            faces: Faces::default(),
            no_self_intersections: false,
        }
    }
}

/// The kinds of surfaces that can be extracted. All have the same topology.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Surface {
    /// Marching cubes: triangles, one point where the surface crosses an edge of the grid.
    #[default]
    MarchingCubes,
    /// Dual contouring: one point a cell, which keeps sharp edges and corners.
    DualContouring,
    /// Dual contouring with points at the mean of the crossings: smooth quadrilaterals, no sharp edges.
    Quads,
    /// Squares of one cell, as if the solid were built of blocks.
    Blocks,
}

/// What the faces of a surface are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Faces {
    /// Polygons for [`Surface::Quads`] and [`Surface::Blocks`], triangles for the others.
    #[default]
    Auto,
    /// Triangles; quadrilaterals of dual surfaces are cut along creases.
    Triangles,
    /// Quadrilaterals and a few triangles for dual surfaces. Marching cubes makes triangles in any case.
    Polygons,
}

impl Surface {
    /// Whether its points need the normals of the input.
    pub fn needs_normals(self) -> bool {
        self == Surface::DualContouring
    }
}

/// A repaired mesh and how it came about.
#[derive(Debug)]
pub struct Repaired {
    /// Closed, manifold, oriented outward; empty if the input encloses nothing.
    pub mesh: Mesh,
    /// What was found and done.
    pub report: RepairReport,
}

/// What a repair found and did.
#[derive(Debug, Clone)]
pub struct RepairReport {
    /// Bounds of the input's faces, in model units.
    pub bounds: Bounds,
    /// Where the grid lies.
    pub frame: Frame,
    /// What was scanned.
    pub scan: ScanCounts,
    /// What was closed.
    pub closing: Closing,
    /// Grid edges that the final surface crosses.
    pub crossings: u64,
    /// Bricks of 8 x 8 x 8 cells that the octree holds.
    pub bricks: u64,
    /// Bytes of the octree.
    pub octree_bytes: u64,
    /// Estimate of the volume enclosed, in cubed model units: see [`SignedOctree::volume`]. [`Mesh::report`] has the exact one.
    pub volume: f64,
    /// Size of the extracted surface.
    pub sizes: MeshSizes,
    /// What the user should know.
    pub warnings: Vec<Warning>,
    /// Wall-clock time of each stage, in order.
    pub times: Vec<(Stage, Duration)>,
}

/// Something that the user should know about the result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Warning {
    /// The input has no faces.
    NoFaces,
    /// The input encloses nothing at this resolution: the result is empty.
    NothingEnclosed,
    /// So many triangles had corners that are not finite and were left out.
    SkippedTriangles(u64),
    /// The input has holes, and so many rings of cells were filled.
    HolesClosed(u64),
    /// On so many grid edges, coincident walls were counted as one.
    WallsMerged(u64),
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::NoFaces => write!(f, "the input has no faces with finite corners: the result is empty"),
            Warning::NothingEnclosed => write!(
                f,
                "the input encloses nothing at this resolution: open sheets and walls thinner than a cell vanish; try a greater depth"
            ),
            Warning::SkippedTriangles(1) => {
                write!(f, "a triangle with coordinates that are not finite was left out")
            }
            Warning::SkippedTriangles(n) => {
                write!(f, "{n} triangles with coordinates that are not finite were left out")
            }
            Warning::HolesClosed(1) => write!(f, "the surface was open: a hole was closed"),
            Warning::HolesClosed(n) => write!(f, "the surface was open: {n} holes, as the grid sees them, were closed"),
            Warning::WallsMerged(n) => write!(f, "duplicate faces were counted once (grid edges concerned: {n})"),
        }
    }
}

/// Repairs a mesh in memory.
///
/// ```
/// use zmend::{Options, mesh::sample, repair};
///
/// let broken = sample::build("knot-holes", 1)?;
/// assert!(broken.validate().is_err());
/// let repaired = repair(broken, &Options { depth: 7, ..Options::default() })?;
/// assert_eq!(repaired.mesh.validate(), Ok(()));
/// # Ok::<(), zmend::Error>(())
/// ```
///
/// # Errors
/// When an option is out of range.
pub fn repair(mut mesh: Mesh, options: &Options) -> Result<Repaired> {
    let mut result = Mesh::default();
    let report = repair_into(&mut mesh, options, &mut result, &Silent)?;
    Ok(Repaired { mesh: result, report })
}

/// Repairs whatever `source` yields and passes the result to `sink` as it is made: neither mesh need be in memory.
///
/// Memory: 8 bytes a crossed grid edge while scanning, about 7 after that (see [`Crossings`](crate::octree::Crossings)).
///
/// # Errors
/// When an option is out of range, when source or sink fail, and `Cancelled`.
pub fn repair_into(
    source: &mut dyn TriangleSource,
    options: &Options,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<RepairReport> {
    let mut clock = Clock::default();
    progress.begin(Stage::Read, 0);
    let bounds = clock.time(Stage::Read, || source.bounds())?;
    let mut warnings = Vec::new();
    if bounds.is_empty() {
        warnings.push(Warning::NoFaces);
    }
    let frame = Frame::fit(&nonempty(bounds), options.depth, options.scale)?;
    let scanned = clock.time(Stage::Scan, || scan(source, &frame, options.surface.needs_normals(), progress))?;
    let (crossings, closing) = clock.time(Stage::Close, || close(scanned.crossings, progress))?;
    let octree = clock.time(Stage::Sign, || {
        progress.begin(Stage::Sign, 0);
        parity_signs(crossings)
    });
    let sizes = clock.time(Stage::Contour, || extract(&octree, &frame, options, sink, progress))?;

    let counts = scanned.counts;
    if !bounds.is_empty() && octree.crossings().is_empty() {
        warnings.push(Warning::NothingEnclosed);
    }
    let noted = [
        (counts.skipped_triangles, Warning::SkippedTriangles as fn(u64) -> Warning),
        (closing.rings, Warning::HolesClosed),
        (counts.merged_walls, Warning::WallsMerged),
    ];
    warnings.extend(noted.into_iter().filter(|(n, _)| *n > 0).map(|(n, warning)| warning(n)));
    Ok(RepairReport {
        bounds,
        frame,
        scan: counts,
        closing,
        crossings: octree.crossings().len() as u64,
        bricks: octree.crossings().bricks().len() as u64,
        octree_bytes: octree.bytes() as u64,
        volume: octree.volume() * frame.cell_size().powi(3),
        sizes,
        warnings,
        times: clock.times,
    })
}

/// Extracts the surface that the options ask for.
fn extract(
    octree: &SignedOctree,
    frame: &Frame,
    options: &Options,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let placement = match options.surface {
        Surface::MarchingCubes => return marching_cubes(octree, frame, sink, progress),
        Surface::DualContouring => Placement::SharpFeatures,
        Surface::Quads => Placement::MassPoint,
        Surface::Blocks => Placement::Centre,
    };
    let intersections = if options.no_self_intersections { Intersections::Avoid } else { Intersections::Allow };
    let triangles = match options.faces {
        Faces::Auto => options.surface == Surface::DualContouring,
        Faces::Triangles => true,
        Faces::Polygons => false,
    };
    dual_contouring(octree, frame, &DualOptions { placement, triangles, intersections }, sink, progress)
}

/// An input without faces gets the unit cube: all checks of options apply, and the result is empty.
fn nonempty(bounds: Bounds) -> Bounds {
    if bounds.is_empty() { Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::ONE } } else { bounds }
}

/// Times stages.
#[derive(Default)]
struct Clock {
    times: Vec<(Stage, Duration)>,
}

impl Clock {
    fn time<T>(&mut self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.times.push((stage, start.elapsed()));
        result
    }
}
