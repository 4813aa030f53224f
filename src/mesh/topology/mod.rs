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
//! 27 bytes a triangle: 12 for rings, 14 for corners at points, 1 of state; 12 more where faces differ in their number of corners.
//! While it is made, no more than that. See `benches/mesh.rs`.

mod analysis;
mod cycle;
mod orient;
mod walk;

pub use analysis::{BoundaryLoop, Diagnosis, MeshKind};
pub use orient::Orientation;
pub use walk::{Geodesics, Search};

use super::Mesh;
use super::corners::Corners;
use super::star::{Star, repeated};
use super::tally::CHUNK;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering::Relaxed};

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
}

impl<'a> Topology<'a> {
    /// Finds all neighbourhoods, on all threads. O(n).
    pub fn new(mesh: &'a Mesh) -> Self {
        let corners = Corners::new(mesh);
        let sides = mesh.faces.corners().len() as u32;
        let rings: Vec<AtomicU32> = (0..sides).into_par_iter().map(AtomicU32::new).collect();
        let states: Vec<AtomicU8> = (0..mesh.faces.len())
            .into_par_iter()
            .map(|i| {
                let face = mesh.faces.get(i);
                let bit = |is: bool, state: FaceState| if is { state.0 } else { 0 };
                let is_sound = mesh.is_sound(face);
                let twice = is_sound && repeated(face).is_some();
                AtomicU8::new(bit(!is_sound, FaceState::UNSOUND) | bit(twice, FaceState::DEGENERATE))
            })
            .collect();
        // Every side belongs to the lower of its points, so each entry of `rings` is written once, whoever does it.
        (0..corners.points().div_ceil(CHUNK)).into_par_iter().for_each_init(Vec::new, |sides, chunk| {
            for v in chunk * CHUNK..corners.points().min((chunk + 1) * CHUNK) {
                upper_sides(&corners, v as u32, sides);
                for edge in sides.chunk_by(|a, b| a >> 32 == b >> 32) {
                    link(&corners, v as u32, edge, &rings, &states);
                }
            }
        });
        let rings = rings.into_iter().map(AtomicU32::into_inner).collect();
        let states = states.into_iter().map(AtomicU8::into_inner).collect();
        Topology { corners, rings, states }
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a Mesh {
        self.corners.mesh()
    }

    /// Bytes held, besides the mesh.
    pub fn bytes(&self) -> u64 {
        self.corners.bytes() + 4 * self.rings.len() as u64 + self.states.len() as u64
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
        if a == b { 0 } else { self.users(side).count() as u32 }
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
        let others = self.sides(face).flat_map(|side| self.users(side).skip(1));
        others.map(|side| self.face(side)).filter(move |&other| other != face)
    }

    /// All edges, each by its lowest side, in ascending order of these.
    pub fn edges(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.states.len() as u32).flat_map(|face| self.sides(face)).filter(|&side| {
            let [a, b] = self.ends(side);
            a != b && self.users(side).all(|other| side <= other)
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

/// The sides between a point and higher ones: these in the upper half, the side in the lower one; sorted.
fn upper_sides(corners: &Corners<'_>, v: u32, sides: &mut Vec<u64>) {
    sides.clear();
    for &corner in corners.at(v) {
        let before = corners.prev(corner);
        let ends = [(corners.point(corners.next(corner)), corner), (corners.point(before), before)];
        sides.extend(
            ends.iter().filter(|(other, _)| *other > v).map(|&(o, side)| (u64::from(o) << 32) | u64::from(side)),
        );
    }
    sides.sort_unstable();
}

/// Makes a ring of the sides along one edge, and tells their faces what it is.
fn link(corners: &Corners<'_>, v: u32, edge: &[u64], rings: &[AtomicU32], states: &[AtomicU8]) {
    let side = |k: usize| edge[k] as u32;
    let n = edge.len();
    if n > 1 {
        (0..n).for_each(|k| rings[side(k) as usize].store(side(if k + 1 == n { 0 } else { k + 1 }), Relaxed));
    }
    let leaves = |k: usize| corners.point(side(k)) == v;
    let state = match n {
        1 => FaceState::BOUNDARY,
        2 if leaves(0) != leaves(1) => return,
        2 => FaceState::INCONSISTENT,
        _ => FaceState::NON_MANIFOLD,
    };
    (0..n).for_each(|k| _ = states[corners.face(side(k)) as usize].fetch_or(state.0, Relaxed));
}

#[cfg(test)]
mod tests;
