//! The pipeline: any bag of polygons in, a closed, manifold, consistently oriented surface out.

mod memory;
mod options;
mod report;

pub use options::{Faces, Options, Surface};
pub use report::{RepairReport, Warning};

use crate::contour::{DualOptions, Placement, dual_contouring, marching_cubes};
use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::mesh::{Bounds, Mesh, MeshSink, MeshSizes, TriangleSource};
use crate::octree::SignedOctree;
use crate::octree::signed::SIGN_BYTES;
use crate::progress::{Progress, Silent, Stage};
use crate::sign::{close, parity_signs, scan};
use memory::{Guard, GuardedSink};
use report::Clock;

/// A repaired mesh and how it came about.
#[derive(Debug)]
pub struct Repaired {
    /// Closed, manifold, oriented outward; empty if the input encloses nothing.
    pub mesh: Mesh,
    /// What was found and done.
    pub report: RepairReport,
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
/// Memory: 8 bytes a crossed grid edge while scanning, about 7 after that (see [`Crossings`](crate::octree::Crossings)), and what the
/// sink holds.
///
/// # Errors
/// When an option is out of range, when the input does not fit into the given cube or needs more memory than may be taken, when source or
/// sink fail, and `Cancelled`.
pub fn repair_into(
    source: &mut dyn TriangleSource,
    options: &Options,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<RepairReport> {
    let mut clock = Clock::default();
    progress.begin(Stage::Read, 0);
    let bounds = clock.time(Stage::Read, || source.bounds())?;
    let frame = options.frame(&bounds)?;
    let guard = Guard::new(progress, options);
    let mut guarded = GuardedSink { sink, guard: &guard };
    let report = guard
        .check_source(source, &frame)
        .and_then(|()| mend(source, bounds, frame, options, &mut guarded, &guard, clock));
    report.map_err(|error| guard.explain(error, source, sink, &frame, options))
}

/// The stages after reading.
fn mend(
    source: &mut dyn TriangleSource,
    bounds: Bounds,
    frame: Frame,
    options: &Options,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
    mut clock: Clock,
) -> Result<RepairReport> {
    let mut warnings = Vec::new();
    if bounds.is_empty() {
        warnings.push(Warning::NoFaces);
    }
    let scanned = clock.time(Stage::Scan, || scan(source, &frame, options.surface.needs_normals(), progress))?;
    let (crossings, closing) = clock.time(Stage::Close, || close(scanned.crossings, progress))?;
    let octree = clock.time(Stage::Sign, || {
        progress.begin(Stage::Sign, 0);
        progress.hold((crossings.bytes() + crossings.bricks().len() * SIGN_BYTES) as u64)?;
        Ok::<_, Error>(parity_signs(crossings))
    })?;
    let sizes = clock.time(Stage::Contour, || extract(&octree, &frame, options, sink, progress))?;

    let counts = scanned.counts;
    if !bounds.is_empty() && octree.crossings().is_empty() {
        warnings.push(Warning::NothingEnclosed);
    }
    let noted = [
        (counts.skipped_triangles - counts.outside_triangles, Warning::SkippedTriangles as fn(u64) -> Warning),
        (counts.outside_triangles, Warning::OutsideTriangles),
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
    };
    let triangles = match options.faces {
        Faces::Auto => options.surface != Surface::Quads,
        Faces::Triangles => true,
        Faces::Polygons => false,
    };
    dual_contouring(octree, frame, &DualOptions { placement, triangles }, sink, progress)
}
