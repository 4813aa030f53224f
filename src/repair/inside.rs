//! Inside and outside: which rule is taken, and what comes of it.

use super::options::Inside;
use super::report::Clock;
use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::mesh::TriangleSource;
use crate::octree::SignedOctree;
use crate::octree::signed::SIGN_BYTES;
use crate::progress::{Progress, Stage, check};
use crate::sign::winding::{Boundary, Circulation, Patches, WholeNumbers, circulations, winding_signs};
use crate::sign::{Closing, OrientedScan, Scan, ScanCounts, close, parity_signs, scan, scan_oriented, vanished};
use std::fmt;

/// How inside was told from outside, and why so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InsideChoice {
    /// The rule that was taken, never [`Inside::Auto`].
    pub rule: Inside,
    /// Why it was taken.
    pub reason: Reason,
    /// Whether an open surface was taken as turned inside out, because most of it is. Only by winding number.
    pub reversed: bool,
}

/// Why a rule was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reason {
    /// It was asked for.
    Asked,
    /// The surface is closed, oriented, and goes round nothing twice: parity says the same as any other rule.
    Sound,
    /// The surface is closed and oriented, and solids overlap or lie in each other.
    Overlaps,
    /// The surface is closed, but some of its faces are turned the other way: their orientation says nothing.
    Turned,
    /// The surface is open, and its faces are turned the same way but for few.
    Open,
    /// The surface is open, and its faces are turned this way and that.
    OpenAndTurned,
    /// The surface is open, and what would close it is nearly as large as it is: it encloses next to nothing.
    Sheet,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Reason::Asked => "as asked for",
            Reason::Sound => "the surface is closed, oriented and does not overlap itself",
            Reason::Overlaps => {
                "the surface is closed and oriented, and solids overlap or lie in each other: their union is taken"
            }
            Reason::Turned => "the surface is closed, but its faces are not all turned the same way",
            Reason::Open => "the surface is open and its faces are turned the same way",
            Reason::OpenAndTurned => "the surface is open and its faces are turned this way and that",
            Reason::Sheet => "the surface is open, and its holes are as large as the rest of it",
        })
    }
}

/// What became of the triangles.
pub(super) struct Told {
    pub(super) octree: SignedOctree,
    pub(super) counts: ScanCounts,
    pub(super) closing: Closing,
    pub(super) choice: InsideChoice,
    /// Points at which the surface was clipped by the root.
    pub(super) clipped: u64,
    /// Grid edges that faces cross where no solid ends.
    pub(super) vanished: u64,
}

/// Scans the source and tells inside from outside.
pub(super) fn tell(
    source: &mut dyn TriangleSource,
    frame: &Frame,
    with_normals: bool,
    inside: Inside,
    clock: &mut Clock,
    progress: &dyn Progress,
) -> Result<Told> {
    if inside == Inside::Parity {
        let scan = clock.time(Stage::Scan, || scan(source, frame, with_normals, progress))?;
        return by_parity(scan, Reason::Asked, clock, progress);
    }
    let scan = clock.time(Stage::Scan, || scan_oriented(source, frame, with_normals, progress))?;
    progress.begin(Stage::Close, 0);
    let boundary = clock.time(Stage::Close, || circulations(&scan.hits, progress))?;
    if boundary.is_empty() {
        return without_boundary(scan, inside, clock, progress);
    }
    let reason = if inside == Inside::Auto { reason_of(&boundary) } else { Reason::Asked };
    if matches!(reason, Reason::Turned | Reason::OpenAndTurned) {
        return by_parity(clock.time(Stage::Scan, || scan.parity(progress))?, reason, clock, progress);
    }
    let odd_faces = boundary.iter().filter(|c| is_rim(c)).count() as u64;
    let patches = clock.time(Stage::Close, || {
        let held = (scan.hits.bytes() + size_of_val(&boundary[..])) as u64;
        let edges = Boundary::of(source, frame, held, progress)?;
        Patches::new(&edges, frame.depth(), held, progress)
    })?;
    if reason == Reason::Open && patches.hits().len() as f64 > MOST_MISSING * scan.hits.len() as f64 {
        return by_parity(clock.time(Stage::Scan, || scan.parity(progress))?, Reason::Sheet, clock, progress);
    }
    let closing = Closing { odd_faces, rings: patches.rings(), switched: patches.hits().len() as u64, vanished: 0 };
    let winding = clock.time(Stage::Sign, || winding_signs(&scan.hits, &patches, progress))?;
    let vanished = vanished(&scan.hits, &winding.octree);
    let choice = InsideChoice { rule: Inside::Winding, reason, reversed: patches.reversed() };
    Ok(Told { octree: winding.octree, counts: scan.counts, closing, choice, clipped: winding.clipped, vanished })
}

fn by_parity(scan: Scan, reason: Reason, clock: &mut Clock, progress: &dyn Progress) -> Result<Told> {
    let (crossings, closing) = clock.time(Stage::Close, || close(scan.crossings, progress))?;
    let octree = clock.time(Stage::Sign, || {
        progress.begin(Stage::Sign, 0);
        progress.hold((crossings.bytes() + crossings.bricks().len() * SIGN_BYTES) as u64)?;
        Ok::<_, Error>(parity_signs(crossings))
    })?;
    let choice = InsideChoice { rule: Inside::Parity, reason, reversed: false };
    let vanished = closing.vanished;
    Ok(Told { octree, counts: scan.counts, closing, choice, clipped: 0, vanished })
}

/// Closed and oriented surfaces.
fn without_boundary(scan: OrientedScan, inside: Inside, clock: &mut Clock, progress: &dyn Progress) -> Result<Told> {
    progress.begin(Stage::Sign, 0);
    let numbers = clock.time(Stage::Sign, || WholeNumbers::new(&scan.hits));
    check(progress)?;
    let (rule, reason) = match inside {
        Inside::Auto if numbers.overlap() => (Inside::Winding, Reason::Overlaps),
        // Pairs of coincident walls are not looked into by winding numbers.
        Inside::Auto if !scan.hits.are_single() => {
            return by_parity(clock.time(Stage::Scan, || scan.parity(progress))?, Reason::Sound, clock, progress);
        }
        Inside::Auto => (Inside::Parity, Reason::Sound),
        rule => (rule, Reason::Asked),
    };
    let octree = clock.time(Stage::Sign, || numbers.into_octree(scan.hits, progress))?;
    let choice = InsideChoice { rule, reason, reversed: false };
    Ok(Told { octree, counts: scan.counts, closing: Closing::default(), choice, clipped: 0, vanished: 0 })
}

/// Whether an open end passes through a face, and not merely a seam between faces turned opposite ways.
fn is_rim(circulation: &Circulation) -> bool {
    circulation.strength % 2 != 0
}

/// Seams may be so many times as long as rims before orientation is not trusted: a few faces of a scan that are turned over do no harm.
const MOST_SEAMS: f64 = 0.25;

/// What is missing may be so many times as large as what is there, before the surface is a sheet: to tell that sheets enclose nothing takes
/// winding numbers long, as they are nearly one half all along it.
const MOST_MISSING: f64 = 0.75;

/// What is to be said of a surface with this boundary.
fn reason_of(boundary: &[Circulation]) -> Reason {
    let rims = boundary.iter().filter(|c| is_rim(c)).count();
    let seams = boundary.len() - rims;
    if rims == 0 {
        Reason::Turned
    } else if seams as f64 > MOST_SEAMS * rims as f64 {
        Reason::OpenAndTurned
    } else {
        Reason::Open
    }
}
