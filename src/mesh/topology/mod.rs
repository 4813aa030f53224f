//! Which faces, edges and points of a mesh are next to each other.
//!
//! # Idea
//!
//! The *side* of a face that leaves a corner has the number of that corner in [`Polygons::corners`](super::Polygons::corners), so sides
//! need no list. All sides along one edge, whichever way they run, form a ring: each knows the next, in ascending order, the last the
//! first. A ring of one is a boundary edge, one of two joins two faces, a longer one is a non-manifold edge, and nothing stops there: who
//! asks for neighbours goes round. With the table of corners at each point this answers everything in time proportional to the answer.
//!
//! An edge has an exact key of 64 bits, the lower point in the upper half, and belongs to its lower point: it is found among the corners
//! there. No hash table is needed, for the points themselves are the buckets, of half a dozen edges each: neither keys nor empty slots
//! are stored. (Open addressing over the same keys takes 16 bytes an edge at a load of three quarters, 24 a triangle, besides the lists
//! of users, and visits memory in no order.)
//!
//! # Invariants
//!
//! - Only *sound* faces have sides in rings: three corners or more, all of which exist. A side from a point to itself is no edge; it
//!   and the sides of unsound faces are rings of their own without users.
//! - Rings ascend, and state bits follow from the mesh alone: nothing depends on the number of threads.
//! - The mesh is borrowed, so it cannot change while this is there.
//!
//! # Cost
//!
//! 27 bytes a triangle: 12 for rings, 14 for corners at points, 1 of state; 12 more where faces differ in their number of corners, and 12 for
//! a side along an edge with more than eight users. While it is made, 9 more. Edges and points with many faces are no worse than others:
//! nothing is asked of every pair. See `benches/mesh.rs`.

mod analysis;
mod cycle;
mod orient;
mod rings;
mod walk;

pub use analysis::{BoundaryLoop, Diagnosis, MeshKind};
pub use orient::Orientation;
pub use walk::{Geodesics, Search};

use super::Mesh;
use super::corners::Corners;
use super::star::Star;
use rings::{Crowd, FEW, Rings};

/// An edge as one number: the lower of its points in the upper 32 bits, the higher one in the lower.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EdgeKey(pub u64);

impl EdgeKey {
    /// The key of the edge between two points, in either order.
    pub fn new(a: u32, b: u32) -> Self {
        EdgeKey((u64::from(a.min(b)) << 32) | u64::from(a.max(b)))
    }

    /// Its points, the lower one first.
    pub fn ends(self) -> [u32; 2] {
        [(self.0 >> 32) as u32, self.0 as u32]
    }
}

/// What is known of a face, as bits: see the constants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FaceState(u8);

impl FaceState {
    /// Fewer than three corners, or a corner whose point does not exist: not part of the surface.
    pub const UNSOUND: FaceState = FaceState(1);
    /// Visits a point twice.
    pub const DEGENERATE: FaceState = FaceState(2);
    /// Has a side that no other face uses.
    pub const BOUNDARY: FaceState = FaceState(4);
    /// Has a side that is used three times or more.
    pub const NON_MANIFOLD: FaceState = FaceState(8);
    /// Has a side that one other face uses, the same way.
    pub const INCONSISTENT: FaceState = FaceState(16);

    /// Whether any of these bits is set.
    pub fn has(self, any: FaceState) -> bool {
        self.0 & any.0 != 0
    }
}

/// Who uses the other side of a face's side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Neighbour {
    /// Nobody: the surface ends here.
    Nobody,
    /// One other face, or the face itself if it runs along an edge and back.
    Face(u32),
    /// So many users besides: a non-manifold edge. [`Topology::users`] lists them.
    Many(u32),
}

/// Neighbourhoods of a mesh, made on demand and borrowed from it.
///
/// ```
/// use zmend::mesh::{Topology, sample};
///
/// let cube = sample::build("cube", 1)?;
/// let topology = Topology::new(&cube);
/// assert_eq!(topology.edges().count(), 12);
/// assert_eq!(topology.connected(0).count(), 3);
/// assert_eq!(topology.neighbours(0).count(), 4);
/// # Ok::<(), zmend::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Topology<'a> {
    corners: Corners<'a>,
    /// The next side along the same edge.
    rings: Vec<u32>,
    states: Vec<u8>,
    crowds: Vec<Crowd>,
}

impl<'a> Topology<'a> {
    /// Finds all neighbourhoods, on all threads. O(n).
    pub fn new(mesh: &'a Mesh) -> Self {
        let corners = Corners::new(mesh);
        let Rings { next: rings, states, crowds } = Rings::new(&corners);
        Topology { corners, rings, states, crowds }
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a Mesh {
        self.corners.mesh()
    }

    /// Bytes held, besides the mesh.
    pub fn bytes(&self) -> u64 {
        let crowds = size_of::<Crowd>() * self.crowds.len();
        self.corners.bytes() + 4 * self.rings.len() as u64 + self.states.len() as u64 + crowds as u64
    }

    /// What is known of a face.
    pub fn state(&self, face: u32) -> FaceState {
        FaceState(self.states[face as usize])
    }

    /// Whether a face is part of the surface.
    pub fn is_sound(&self, face: u32) -> bool {
        !self.state(face).has(FaceState::UNSOUND)
    }

    /// The sides of a face; none unless it is sound.
    pub fn sides(&self, face: u32) -> std::ops::Range<u32> {
        let range = self.mesh().faces.range(face as usize);
        if self.is_sound(face) { range.start as u32..range.end as u32 } else { 0..0 }
    }

    /// The points from which and to which a side of a sound face runs.
    pub fn ends(&self, side: u32) -> [u32; 2] {
        [self.corners.point(side), self.corners.point(self.corners.next(side))]
    }

    /// The key of a side's edge.
    pub fn key(&self, side: u32) -> EdgeKey {
        let [a, b] = self.ends(side);
        EdgeKey::new(a, b)
    }

    /// The face of a side.
    pub fn face(&self, side: u32) -> u32 {
        self.corners.face(side)
    }

    /// The side after this one in its face.
    pub fn next(&self, side: u32) -> u32 {
        self.corners.next(side)
    }

    /// The side before this one in its face.
    pub fn prev(&self, side: u32) -> u32 {
        self.corners.prev(side)
    }

    /// The corners at a point, which are the sides that leave it, in ascending order. None where the point does not exist.
    pub fn corners_at(&self, point: u32) -> &[u32] {
        if (point as usize) < self.corners.points() { self.corners.at(point) } else { &[] }
    }

    /// The faces at a point, ascending; a face that visits it twice comes twice.
    pub fn faces_at(&self, point: u32) -> impl Iterator<Item = u32> + '_ {
        self.corners_at(point).iter().map(|&corner| self.face(corner))
    }

    /// The points to which edges lead from a point, ascending.
    pub fn connected(&self, point: u32) -> impl Iterator<Item = u32> + use<> {
        let at = self.corners_at(point).iter();
        let ends = at.flat_map(|&corner| [self.next(corner), self.prev(corner)].map(|c| self.corners.point(c)));
        let mut points: Vec<u32> = ends.filter(|&other| other != point).collect();
        points.sort_unstable();
        points.dedup();
        points.into_iter()
    }

    /// All sides along a side's edge, beginning with itself. Of a side that is no edge, itself.
    pub fn users(&self, side: u32) -> impl Iterator<Item = u32> + '_ {
        let mut next = Some(side);
        std::iter::from_fn(move || {
            let here = next?;
            next = Some(self.rings[here as usize]).filter(|&after| after != side);
            Some(here)
        })
    }

    /// How often faces run along a side's edge; 0 if both ends are one point.
    pub fn count(&self, side: u32) -> u32 {
        let [a, b] = self.ends(side);
        if a == b {
            return 0;
        }
        match self.crowd(side) {
            Some(crowd) => crowd.users,
            None => self.users(side).count() as u32,
        }
    }

    /// A side's edge, if it has more than a few users. O(1) for others.
    fn crowd(&self, side: u32) -> Option<&Crowd> {
        if self.crowds.is_empty() || self.users(side).take(FEW + 1).count() <= FEW {
            return None;
        }
        Some(&self.crowds[self.crowds.binary_search_by_key(&side, |crowd| crowd.side).ok()?])
    }

    /// Whether a side is the lowest along its edge.
    fn is_lowest(&self, side: u32) -> bool {
        self.crowd(side).map_or_else(|| self.users(side).all(|other| side <= other), |crowd| crowd.lowest == side)
    }

    /// The lowest side along the edge between two points, in either order. O(corners at a point).
    pub fn find(&self, a: u32, b: u32) -> Option<u32> {
        let [low, high] = [a.min(b), a.max(b)];
        let here = self.corners_at(low).iter().flat_map(|&corner| [corner, self.prev(corner)]);
        here.filter(|&side| low != high && self.ends(side).contains(&high)).min()
    }

    /// The faces along the edge between two points, ascending; a face that runs along it twice comes twice.
    pub fn faces_along(&self, a: u32, b: u32) -> impl Iterator<Item = u32> + '_ {
        self.find(a, b).into_iter().flat_map(|side| self.users(side)).map(|side| self.face(side))
    }

    /// Who is beyond a side of a sound face.
    pub fn neighbour(&self, side: u32) -> Neighbour {
        match self.count(side) {
            0 | 1 => Neighbour::Nobody,
            2 => Neighbour::Face(self.face(self.rings[side as usize])),
            users => Neighbour::Many(users - 1),
        }
    }

    /// The faces that share an edge with a face, in order of its sides, through non-manifold edges as well. A face comes once for each
    /// edge shared; the face itself does not come.
    pub fn neighbours(&self, face: u32) -> impl Iterator<Item = u32> + '_ {
        self.sides(face).flat_map(|side| self.beyond(side)).filter(move |&other| other != face)
    }

    /// The sides of a face along which another one lies, through non-manifold edges as well.
    pub fn shared_sides(&self, face: u32, other: u32) -> impl Iterator<Item = u32> + '_ {
        self.sides(face).filter(move |&side| other != face && self.beyond(side).any(|beyond| beyond == other))
    }

    /// The faces of the other users of a side's edge.
    fn beyond(&self, side: u32) -> impl Iterator<Item = u32> + '_ {
        self.users(side).skip(1).map(|side| self.face(side))
    }

    /// All edges, each by its lowest side, in ascending order of these.
    pub fn edges(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.states.len() as u32).flat_map(|face| self.sides(face)).filter(|&side| {
            let [a, b] = self.ends(side);
            a != b && self.is_lowest(side)
        })
    }

    /// Number of fans at a point: sets of corners that hang together by edges. 0 if no sound face uses the point, more than one at a
    /// bow-tie.
    pub fn fans(&self, point: u32) -> u32 {
        self.fans_with(&mut Star::default(), point)
    }

    /// The same, with a star that is moved from point to point.
    pub(in crate::mesh) fn fans_with(&self, star: &mut Star, point: u32) -> u32 {
        star.visit(&self.corners, point);
        star.fans()
    }
}

#[cfg(test)]
mod tests;
