//! The rule of the hull.

use super::inside::{InsideChoice, Reason, Told};
use super::options::{Inside, Options};
use super::report::Clock;
use crate::error::Result;
use crate::geom::Frame;
use crate::mesh::TriangleSource;
use crate::progress::{Progress, Stage};
use crate::sign::{Closing, hull, hull_with_gap, scan_oriented, vanished};

/// Scans the source and takes for inside what infinity does not reach.
pub(super) fn tell(
    source: &mut dyn TriangleSource,
    frame: &Frame,
    options: &Options,
    clock: &mut Clock,
    progress: &dyn Progress,
) -> Result<Told> {
    let with_normals = options.surface.needs_normals();
    let scan = clock.time(Stage::Scan, || scan_oriented(source, frame, with_normals, progress))?;
    progress.begin(Stage::Sign, 0);
    let octree = clock.time(Stage::Sign, || match options.gap {
        Some(gap) => hull_with_gap(&scan.hits, source, frame, gap, progress),
        None => hull(&scan.hits, progress),
    })?;
    let choice = InsideChoice { rule: Inside::Hull, reason: Reason::Asked, reversed: false };
    let vanished = vanished(&scan.hits, &octree);
    Ok(Told { octree, counts: scan.counts, closing: Closing::default(), choice, clipped: 0, vanished })
}
