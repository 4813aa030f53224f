//! Indexed polygons: what can be said about them, and what can be done to them.

pub(crate) mod chance;
mod corners;
mod distance;
mod edit;
mod fans;
mod features;
mod gaps;
mod heal;
mod intersect;
mod meet;
mod oriented;
pub(crate) mod parts;
mod polygon;
mod ray;
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
pub use ray::RayHit;
pub use report::Report;
pub(crate) use source::Batch;
pub use stream::{MeshSink, MeshSizes, SourceCounts, TriangleSource};
pub use topology::{
    BoundaryLoop, Diagnosis, EdgeKey, FaceState, Geodesics, MeshKind, Neighbour, Orientation, Search, Topology,
};
pub use tree::{Closest, TriangleTree};
pub use validate::Violation;

use glam::DVec3;
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

/// A list of polygons: the corners of all of them one after another, and where each ends. As long as all have as many corners, that number is
/// all that is kept of the latter: triangles take 12 bytes each.
#[derive(Debug, Clone, Default)]
pub struct Polygons {
    corners: Vec<u32>,
    ends: Ends,
}

/// Where polygons end.
#[derive(Debug, Clone)]
enum Ends {
    /// All have `arity` corners; 0 while there are none. Their ends, if they have to be listed, shall have room for so many.
    Every { arity: u32, room: usize },
    /// The end of each.
    Each(Vec<u32>),
}

impl Default for Ends {
    fn default() -> Self {
        Ends::Every { arity: 0, room: 0 }
    }
}

impl PartialEq for Polygons {
    /// Whether they are the same polygons, in the same order.
    fn eq(&self, other: &Self) -> bool {
        let (n, m) = (self.len(), other.len());
        let is_same = |(a, b): (&Ends, &Ends)| match (a, b) {
            (Ends::Every { arity: a, .. }, Ends::Every { arity: b, .. }) => a == b,
            _ => (0..n).all(|i| self.range(i) == other.range(i)),
        };
        n == m && self.corners == other.corners && is_same((&self.ends, &other.ends))
    }
}

impl Eq for Polygons {}

impl Polygons {
    /// No polygons yet, with room for some.
    pub fn with_capacity(polygons: usize, corners: usize) -> Self {
        Polygons { corners: Vec::with_capacity(corners), ends: Ends::Every { arity: 0, room: polygons } }
    }

    /// Makes room for exactly so many more polygons and corners.
    pub fn reserve_exact(&mut self, polygons: usize, corners: usize) {
        let count = self.len();
        self.corners.reserve_exact(corners);
        match &mut self.ends {
            Ends::Every { room, .. } => *room = count + polygons,
            Ends::Each(ends) => ends.reserve_exact(polygons),
        }
    }

    /// Appends a polygon.
    ///
    /// # Panics
    /// When all polygons together would have 2^32 corners or more.
    pub fn push(&mut self, polygon: &[u32]) {
        self.push_all(polygon.len(), polygon);
        if polygon.is_empty() {
            let end = self.corners.len() as u32;
            self.listed().push(end);
        }
    }

    /// Appends polygons that all have `arity` corners, one after another in `corners`.
    ///
    /// # Panics
    /// When the number of corners is no multiple of `arity`, or all polygons together would have 2^32 corners or more.
    pub fn push_all(&mut self, arity: usize, corners: &[u32]) {
        assert!(corners.len().is_multiple_of(arity), "whole polygons");
        u32::try_from(self.corners.len() + corners.len()).expect("fewer than 2^32 corners in a mesh");
        if corners.is_empty() {
            return;
        }
        match &mut self.ends {
            Ends::Every { arity: every, .. } if *every == 0 => *every = arity as u32,
            Ends::Every { arity: every, .. } if *every == arity as u32 => {}
            _ => {
                let start = self.corners.len() as u32;
                self.listed().extend((1..=(corners.len() / arity) as u32).map(|n| start + n * arity as u32));
            }
        }
        self.corners.extend_from_slice(corners);
    }

    /// The list of ends, which is made if there is none.
    fn listed(&mut self) -> &mut Vec<u32> {
        if let Ends::Every { arity, room } = self.ends {
            let count = self.len();
            let mut ends = Vec::with_capacity(room.max(count));
            ends.extend((1..=count as u32).map(|n| n * arity));
            self.ends = Ends::Each(ends);
        }
        match &mut self.ends {
            Ends::Each(ends) => ends,
            Ends::Every { .. } => unreachable!("they have been listed"),
        }
    }

    /// Number of polygons.
    pub fn len(&self) -> usize {
        match &self.ends {
            Ends::Every { arity: 0, .. } => 0,
            // Triangles are spared the division.
            Ends::Every { arity: 3, .. } => self.corners.len() / 3,
            Ends::Every { arity, .. } => self.corners.len() / *arity as usize,
            Ends::Each(ends) => ends.len(),
        }
    }

    /// Whether there is no polygon.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The corners of polygon `i`.
    ///
    /// # Panics
    /// When there is no polygon `i`.
    #[inline]
    pub fn get(&self, i: usize) -> &[u32] {
        &self.corners[self.range(i)]
    }

    /// Where the corners of polygon `i` are among [`corners`](Self::corners).
    ///
    /// # Panics
    /// When there is no polygon `i`.
    #[inline]
    pub fn range(&self, i: usize) -> Range<usize> {
        match &self.ends {
            Ends::Every { arity, .. } => {
                let (start, arity) = (i * *arity as usize, *arity as usize);
                assert!(start < self.corners.len(), "there is no polygon {i}");
                start..start + arity
            }
            Ends::Each(ends) => {
                let start = if i == 0 { 0 } else { ends[i - 1] as usize };
                start..ends[i] as usize
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Polygons are what was pushed, one by one or many at once, whether all have as many corners or not, and equal what holds the same.
        #[test]
        fn polygons_are_what_was_pushed(
            runs in prop::collection::vec((0usize..6, 1usize..4), 0..8),
            room in 0usize..20,
        ) {
            let (mut one_by_one, mut at_once) = (Polygons::with_capacity(room, 0), Polygons::default());
            let mut expected: Vec<Vec<u32>> = Vec::new();
            for &(arity, count) in &runs {
                let first = expected.len() as u32;
                let run: Vec<Vec<u32>> = (0..count as u32).map(|i| vec![first + i; arity]).collect();
                run.iter().for_each(|polygon| one_by_one.push(polygon));
                if arity == 0 {
                    run.iter().for_each(|polygon| at_once.push(polygon));
                } else {
                    at_once.push_all(arity, &run.concat());
                }
                expected.extend(run);
                at_once.reserve_exact(1, arity);
            }
            let same = expected.iter().map(Vec::as_slice);
            prop_assert!(one_by_one.iter().eq(same.clone()) && at_once.iter().eq(same));
            prop_assert!(one_by_one == at_once && at_once.len() == expected.len());
            prop_assert_eq!(at_once.is_empty(), expected.is_empty());
            at_once.push(&[7, 7]);
            prop_assert!(one_by_one != at_once);
            prop_assert!(std::panic::catch_unwind(|| one_by_one.range(expected.len())).is_err());
        }
    }

    /// The same corners, cut otherwise, are other polygons; how they came does not matter.
    #[test]
    fn equal_is_what_has_the_same_polygons() {
        let of = |polygons: &[&[u32]]| polygons.iter().copied().collect::<Polygons>();
        let (triangles, pairs) = (of(&[&[0, 1, 2], &[3, 4, 5]]), of(&[&[0, 1], &[2, 3], &[4, 5]]));
        let mixed = of(&[&[0, 1, 2, 3], &[4, 5]]);
        assert!(triangles != pairs && triangles != mixed && mixed != pairs && mixed != of(&[&[0, 1], &[2, 3, 4, 5]]));
        assert!(of(&[]) == Polygons::with_capacity(3, 9) && of(&[&[]]) != of(&[]));
    }
}
