//! The pipeline: any bag of polygons in, a closed, manifold, consistently oriented surface out.

mod options;
mod report;
mod solid;

pub use options::{Faces, Options, Surface};
pub use report::{RepairReport, Warning};
pub use solid::Solid;

use crate::error::Result;
use crate::geom::Frame;
use crate::mesh::{Bounds, Mesh, MeshSink, MeshSizes, TriangleSource};
use crate::progress::{Progress, Silent, Stage};
use crate::sign::{close, parity_signs, scan};
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
    let (solid, mut report) = solidify(source, options, progress)?;
    let mut clock = Clock::default();
    report.sizes = clock.time(Stage::Contour, || solid.extract(options, sink, progress))?;
    report.times.append(&mut clock.times);
    Ok(report)
}

/// Repairs whatever `source` yields, but extracts no surface: the solid can be written as an octree file or be extracted in several ways.
/// The report's sizes are those of no mesh. Crossings have normals if [`Surface::needs_normals`] of the options' surface says so.
///
/// # Errors
/// As [`repair_into`].
pub fn solidify(
    source: &mut dyn TriangleSource,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Solid, RepairReport)> {
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
    let report = RepairReport {
        bounds,
        frame,
        scan: counts,
        closing,
        crossings: octree.crossings().len() as u64,
        bricks: octree.crossings().bricks().len() as u64,
        octree_bytes: octree.bytes() as u64,
        volume: octree.volume() * frame.cell_size().powi(3),
        sizes: MeshSizes::default(),
        warnings,
        times: clock.times,
    };
    Ok((Solid { octree, frame, points: None }, report))
}

/// An input without faces gets the unit cube: all checks of options apply, and the result is empty.
fn nonempty(bounds: Bounds) -> Bounds {
    if bounds.is_empty() { Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::ONE } } else { bounds }
}
