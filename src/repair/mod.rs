//! The pipeline: any bag of polygons in, a closed, manifold, consistently oriented surface out.

mod clouds;
mod distances;
mod hull;
mod inside;
mod keep_good;
mod memory;
mod options;
mod refined;
mod report;
mod sampled;
mod solid;
mod trace;

pub use crate::sign::{Keep, Kept, Offset, Thicken};
pub use distances::CellOptions;
pub use inside::{InsideChoice, Reason};
pub use keep_good::{KeptParts, Mended, repair_keeping_good};
pub use options::{Faces, Inside, Options, Surface};
pub use report::{RepairReport, Warning};
pub use solid::Solid;
pub use trace::{Trace, TracedRound, membranes};

use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::mesh::{Bounds, Mesh, MeshSink, MeshSizes, TriangleSource};
use crate::progress::{Progress, Silent, Stage};
use crate::sign::{check_gap, check_width, keep, offset, thicken};
use inside::{Told, tell};
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
    let begun = Begun::new(source, options, progress)?;
    let (frame, guard) = (begun.frame, Guard::new(progress, options));
    let report = mend(source, begun, options, &guard).and_then(|(solid, mut report)| {
        let mut clock = Clock::default();
        let mut guarded = GuardedSink { sink, guard: &guard };
        report.sizes = clock.time(Stage::Contour, || solid.extract(options, &mut guarded, &guard))?;
        report.times.append(&mut clock.times);
        Ok(report)
    });
    report.map_err(|error| guard.explain(error, source, Some(sink), &frame, options))
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
    let begun = Begun::new(source, options, progress)?;
    let (frame, guard) = (begun.frame, Guard::new(progress, options));
    mend(source, begun, options, &guard).map_err(|error| guard.explain(error, source, None, &frame, options))
}

/// A repair of which the extent is known.
struct Begun {
    bounds: Bounds,
    frame: Frame,
    clock: Clock,
}

impl Begun {
    fn new(source: &mut dyn TriangleSource, options: &Options, progress: &dyn Progress) -> Result<Self> {
        let mut clock = Clock::default();
        progress.begin(Stage::Read, 0);
        let bounds = clock.time(Stage::Read, || source.bounds())?;
        let frame = options.frame(&bounds)?;
        check(options, &frame)?;
        Ok(Begun { bounds, frame, clock })
    }
}

/// The stages between reading and contouring.
fn mend(
    source: &mut dyn TriangleSource,
    Begun { bounds, frame, mut clock }: Begun,
    options: &Options,
    guard: &Guard<'_>,
) -> Result<(Solid, RepairReport)> {
    let progress: &dyn Progress = guard;
    guard.check_source(source, &frame)?;
    let mut warnings = Vec::new();
    if bounds.is_empty() {
        warnings.push(Warning::NoFaces);
    }
    let told = match options.inside {
        Inside::Hull => hull::tell(source, &frame, options, &mut clock, progress)?,
        rule => tell(source, &frame, options.surface.needs_normals(), rule, &mut clock, progress)?,
    };
    let Told { mut octree, counts, closing, choice, clipped, vanished } = told;
    if let Some(width) = options.thicken {
        octree = clock.time(Stage::Sign, || thicken(&octree, source, &frame, width, options.thicken_what, progress))?;
    }
    if let Some(by) = options.offset {
        let with_normals = options.surface.needs_normals();
        octree = clock.time(Stage::Sign, || offset(&octree, source, &frame, by, with_normals, progress))?;
    }
    let (octree, kept) = clock.time(Stage::Sign, || keep(octree, options.keep, options.drop_cavities, progress))?;
    let mut solid = Solid::new(octree, frame);
    let mut topology = None;
    if !options.topology.is_nothing() {
        let (mended, report) = clock.time(Stage::Topology, || solid.mended(&options.topology, progress))?;
        (solid, topology) = (mended, Some(report));
    }
    if options.no_self_intersections && solid.octree.is_edited() && options.surface != Surface::Blocks {
        warnings.push(Warning::MayIntersect);
    }
    let octree = solid.signed();

    if !bounds.is_empty() && octree.crossings().is_empty() {
        warnings.push(Warning::NothingEnclosed);
    }
    let noted = [
        (counts.skipped_triangles - counts.outside_triangles, Warning::SkippedTriangles as fn(u64) -> Warning),
        (counts.outside_triangles, Warning::OutsideTriangles),
        (closing.rings, Warning::HolesClosed),
        (counts.merged_walls, Warning::WallsMerged),
        (clipped, Warning::Clipped),
        (
            if options.thicken.is_none() && options.offset.is_none() { percent(vanished, counts.hits) } else { 0 },
            Warning::FacesVanished,
        ),
    ];
    warnings.extend(noted.into_iter().filter(|(n, _)| *n > 0).map(|(n, warning)| warning(n)));
    let report = RepairReport {
        bounds,
        frame,
        scan: counts,
        closing,
        inside: choice,
        vanished,
        kept,
        topology,
        crossings: octree.crossings().len() as u64,
        bricks: octree.crossings().bricks().len() as u64,
        octree_bytes: octree.bytes() as u64,
        volume: octree.volume() * frame.cell_size().powi(3),
        sizes: MeshSizes::default(),
        warnings,
        times: clock.times,
    };
    Ok((solid, report))
}

/// Refuses what can be told before anything is read.
fn check(options: &Options, frame: &Frame) -> Result<()> {
    options.keep.check()?;
    if let Some(gap) = options.gap {
        if options.inside != Inside::Hull {
            return Err(Error::setting("gap", "only the hull has gaps that can be closed", "add `--inside hull`"));
        }
        check_gap(gap, frame)?;
    }
    options.offset.map_or(Ok(()), |offset| offset.check(frame))?;
    options.thicken.map_or(Ok(()), |width| check_width(width, frame))
}

/// So many in a hundred, rounded.
fn percent(part: u64, whole: u64) -> u64 {
    (100 * part + whole / 2).checked_div(whole).unwrap_or(0)
}
