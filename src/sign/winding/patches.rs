//! The patches that span the boundary of a surface, and their hits.

use super::boundary::Boundary;
use super::span::Span;
use crate::error::Result;
use crate::geom::raster::FineTriangle;
use crate::octree::hits::OrientedHits;
use crate::progress::{Progress, check};
use crate::sign::scan::scan_snapped;

/// Patches that span the boundary of an oriented surface: together with it they are closed.
#[derive(Debug)]
pub struct Patches {
    pub(super) span: Span,
    /// Of the span, turned so that hits of the surface and these have no circulation.
    pub(super) hits: OrientedHits,
    rings: u64,
    reversed: bool,
}

impl Patches {
    /// Spans all rings of a boundary in a grid with 2^depth cells a side. While that is made, `held` bytes are held by others.
    ///
    /// # Errors
    /// `Cancelled`, `Memory` when `progress` says so, and when more than 2^32 edges are crossed.
    pub fn new(boundary: &Boundary, depth: u32, held: u64, progress: &dyn Progress) -> Result<Patches> {
        progress.hold(held + boundary.bytes_of_rings())?;
        let rings = boundary.rings();
        let count = rings.len() as u64;
        check(progress)?;
        let span = Span::new(rings);
        let held = held + span.bytes() as u64;
        let turned: Vec<FineTriangle> = span.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let hits = scan_snapped(&turned, depth, held + size_of_val(&turned[..]) as u64, progress)?;
        Ok(Patches { span, hits, rings: count, reversed: boundary.reversed() })
    }

    /// Whether the surface was found to be turned inside out: then its hits count the other way.
    pub fn reversed(&self) -> bool {
        self.reversed
    }

    /// Number of rings of the boundary: that of holes, and more where these touch each other.
    pub fn rings(&self) -> u64 {
        self.rings
    }

    /// The edges of the grid that they cross.
    pub fn hits(&self) -> &OrientedHits {
        &self.hits
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.span.bytes() + self.hits.bytes()
    }
}
