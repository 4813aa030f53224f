//! What a repair says of itself.

use super::inside::InsideChoice;
use crate::geom::Frame;
use crate::mesh::{Bounds, MeshSizes};
use crate::progress::Stage;
use crate::sign::{Closing, Kept, ScanCounts};
use crate::topology::TopologyReport;
use std::fmt;
use std::time::{Duration, Instant};

/// What a repair found and did.
#[derive(Debug, Clone)]
pub struct RepairReport {
    /// Bounds of the input's faces, in model units.
    pub bounds: Bounds,
    /// Where the grid lies.
    pub frame: Frame,
    /// What was scanned.
    pub scan: ScanCounts,
    /// What was closed. By winding number: the rims, rings (seams between faces turned opposite ways included) and the area of the patches
    /// that were thought over the holes.
    pub closing: Closing,
    /// How inside was told from outside.
    pub inside: InsideChoice,
    /// Grid edges that faces cross where no solid ends: of open sheets and of walls within solids.
    pub vanished: u64,
    /// Which solids stayed, if any were to be dropped or filled.
    pub kept: Kept,
    /// What became of handles and tunnels, if the options asked for anything; areas are in squares of cells.
    pub topology: Option<TopologyReport>,
    /// Grid edges that the final surface crosses.
    pub crossings: u64,
    /// Bricks of 8 x 8 x 8 cells that the octree holds.
    pub bricks: u64,
    /// Bytes of the octree.
    pub octree_bytes: u64,
    /// Estimate of the volume enclosed, in cubed model units: see [`SignedOctree::volume`](crate::octree::SignedOctree::volume). [`Mesh::report`](crate::Mesh::report) has the exact one.
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
    /// So many triangles were left out because they reach out of the grid, although the source's bounds did not say so.
    OutsideTriangles(u64),
    /// The input has holes, and so many rings of cells were filled.
    HolesClosed(u64),
    /// About so many percent of the surface bound no solid and vanished.
    FacesVanished(u64),
    /// On so many grid edges, coincident walls were counted as one.
    WallsMerged(u64),
    /// At so many points of the grid the surface reached the grid's boundary and was clipped.
    Clipped(u64),
    /// Faces at cuts and fills may pass through each other although it was asked that none do.
    MayIntersect,
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
            Warning::OutsideTriangles(1) => write!(f, "a triangle that reaches out of the grid was left out"),
            Warning::OutsideTriangles(n) => write!(f, "{n} triangles that reach out of the grid were left out"),
            Warning::HolesClosed(1) => write!(f, "the surface was open: a hole was closed"),
            Warning::HolesClosed(n) => write!(f, "the surface was open: {n} holes, as the grid sees them, were closed"),
            Warning::Clipped(n) => write!(
                f,
                "the surface runs out of the grid and was clipped there (grid points concerned: {n}); try a smaller scale, or parity"
            ),
            Warning::FacesVanished(n) => write!(
                f,
                "about {n} % of the input's surface bounds no solid and vanished; --thicken WIDTH gives open sheets a wall"
            ),
            Warning::MayIntersect => {
                write!(f, "faces may pass through each other where handles were cut or tunnels filled")
            }
            Warning::WallsMerged(n) => write!(f, "duplicate faces were counted once (grid edges concerned: {n})"),
        }
    }
}

/// Times stages.
#[derive(Default)]
pub(super) struct Clock {
    pub(super) times: Vec<(Stage, Duration)>,
}

impl Clock {
    pub(super) fn time<T>(&mut self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let took = start.elapsed();
        match self.times.iter_mut().find(|(other, _)| *other == stage) {
            Some((_, time)) => *time += took,
            None => self.times.push((stage, took)),
        }
        result
    }
}
