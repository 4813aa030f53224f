//! Indexed polygons: what can be said about them, and what can be done to them.

pub(crate) mod chance;
mod corners;
mod distance;
mod edit;
mod features;
mod gaps;
mod heal;
mod intersect;
mod meet;
mod oriented;
mod polygon;
mod report;
pub mod sample;
mod source;
mod star;
mod stream;
mod tally;
mod topology;
mod tree;
mod validate;

pub use crate::geom::Bounds;
pub use distance::{Deviation, DistanceOptions, Distances};
pub use edit::{Edit, FaceId, PointId, SavePoint};
pub use features::{Chain, Constraint, Constraints, FeatureOptions, Features, Group, Groups, chains, grow};
pub use gaps::Gap;
pub use heal::{Defects, HealOptions, HealStep, Healed};
pub use polygon::triangulate;
pub use report::Report;
pub(crate) use source::Batch;
pub use stream::{MeshSink, MeshSizes, SourceCounts, TriangleSource};
pub use topology::{
    BoundaryLoop, Diagnosis, EdgeKey, FaceState, Geodesics, MeshKind, Neighbour, Orientation, Search, Topology,
};
pub use tree::{Closest, TriangleTree};
pub use validate::Violation;

use glam::DVec3;
use std::collections::TryReserveError;
use std::ops::Range;

/// Points and polygons over them. Nothing is promised: a broken soup and a clean solid are both a `Mesh`;
/// [`report`](Mesh::report) tells which.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions in model units.
    pub points: Vec<DVec3>,
    /// Polygons as cycles of indices into `points`, counter-clockwise seen from outside where orientation is right.
    pub faces: Polygons,
}

/// A list of polygons in two arrays: the corners of all polygons one after another, and where each polygon ends.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Polygons {
    corners: Vec<u32>,
    ends: Vec<u32>,
}

impl Polygons {
    /// No polygons yet, with room for some.
    pub fn with_capacity(polygons: usize, corners: usize) -> Self {
        Polygons { corners: Vec::with_capacity(corners), ends: Vec::with_capacity(polygons) }
    }

    /// Makes room for exactly so many more polygons and corners.
    pub fn reserve_exact(&mut self, polygons: usize, corners: usize) {
        self.ends.reserve_exact(polygons);
        self.corners.reserve_exact(corners);
    }

    /// As [`reserve_exact`](Self::reserve_exact), but says if there is not enough memory.
    pub(crate) fn try_reserve_exact(&mut self, polygons: usize, corners: usize) -> Result<(), TryReserveError> {
        self.ends.try_reserve_exact(polygons)?;
        self.corners.try_reserve_exact(corners)
    }

    /// Appends a polygon.
    ///
    /// # Panics
    /// When all polygons together would have 2^32 corners or more.
    pub fn push(&mut self, polygon: &[u32]) {
        self.corners.extend_from_slice(polygon);
        self.ends.push(u32::try_from(self.corners.len()).expect("fewer than 2^32 corners in a mesh"));
    }

    /// Appends polygons that all have `arity` corners, one after another in `corners`.
    ///
    /// # Panics
    /// When the number of corners is no multiple of `arity`, or all polygons together would have 2^32 corners or more.
    pub fn push_all(&mut self, arity: usize, corners: &[u32]) {
        assert!(corners.len().is_multiple_of(arity), "whole polygons");
        let end = u32::try_from(self.corners.len() + corners.len()).expect("fewer than 2^32 corners in a mesh");
        let start = self.corners.len() as u32;
        self.corners.extend_from_slice(corners);
        let polygons = corners.len() / arity;
        self.ends.extend((1..=polygons as u32).map(|n| start + n * arity as u32));
        debug_assert!(polygons == 0 || self.ends.last() == Some(&end), "the last polygon ends where the corners do");
    }

    /// Number of polygons.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is no polygon.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The corners of polygon `i`.
    ///
    /// # Panics
    /// When there is no polygon `i`.
    pub fn get(&self, i: usize) -> &[u32] {
        &self.corners[self.range(i)]
    }

    /// Where the corners of polygon `i` are among [`corners`](Self::corners).
    ///
    /// # Panics
    /// When there is no polygon `i`.
    pub fn range(&self, i: usize) -> Range<usize> {
        let start = if i == 0 { 0 } else { self.ends[i - 1] as usize };
        start..self.ends[i] as usize
    }

    /// All polygons in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[u32]> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }

    /// The corners of all polygons, one after another.
    pub fn corners(&self) -> &[u32] {
        &self.corners
    }
}

impl<'a> FromIterator<&'a [u32]> for Polygons {
    fn from_iter<I: IntoIterator<Item = &'a [u32]>>(iter: I) -> Self {
        let mut polygons = Polygons::default();
        iter.into_iter().for_each(|p| polygons.push(p));
        polygons
    }
}
