//! What lies around an element: boundary, coboundary, neighbours, and the parts of a cell.

use std::iter::FusedIterator;

use super::morton::{add, field, raise, subtract};
use super::{EXTENT_SHIFT, Key, MAX_LEVEL};
use crate::grid::axis::{Axis, Corner, Direction, Edge, Extent, Face};

/// Incidence and neighbours.
impl Key {
    /// The elements of one dimension less of which its boundary consists: for each axis of its extent, the two half its
    /// side below and above its centre. All have its level, unless they are points.
    ///
    /// In the order x low, x high, y low, ... A cell gives its six faces in the order of [`Face::ALL`], an edge its two
    /// ends, a point nothing.
    pub fn boundary(self) -> Incident {
        let half = if self.is_point() { 0 } else { 1 << (3 * self.trailing()) };
        Incident { key: self, half, faces: faces_across(self.dir()) }
    }

    /// The elements of its own level and of one dimension more in whose boundary it lies: for each axis not in its
    /// extent, the two half its side below and above its centre, of which those outside the root are left out.
    ///
    /// In the order x low, x high, y low, ... Domain: edges, faces and cells; a cell gives nothing. For a point say at
    /// which level: [`coboundary_at`](Key::coboundary_at).
    pub fn coboundary(self) -> Incident {
        debug_assert!(!self.is_point(), "a point needs a level: coboundary_at");
        self.coboundary_at(MAX_LEVEL - self.trailing())
    }

    /// As [`coboundary`](Key::coboundary), of elements of `level`: the up to six edges of that level around a point.
    /// Domain: the element's own level; for a point, the levels up to 18 with cells that have a corner there.
    pub fn coboundary_at(self, level: u32) -> Incident {
        debug_assert!(self.level().is_none_or(|own| own == level), "of its own level");
        let half = 1 << (3 * (MAX_LEVEL - level));
        debug_assert!(!self.is_point() || self.code() & (8 * half - 1) == 0, "level {level} has no corner at {self}");
        let inside = Axis::ALL.into_iter().fold(0, |faces, axis| {
            let at = self.0 & field(axis);
            let (low, high) = (u32::from(at != 0), u32::from(at != SIDE_CODE & field(axis)));
            faces | (low | high << 1) << (2 * axis.index())
        });
        Incident { key: self, half, faces: inside & faces_across(self.dir().complement()) }
    }

    /// The same element one side further across a face: the neighbour of the same size. `None` outside the root.
    /// Domain: cells, faces and edges; for a face or an edge, any of the six directions.
    pub const fn neighbour(self, across: Face) -> Option<Key> {
        let field = field(across.axis());
        let side = (across.axis().bit() as u64) << (3 * (self.trailing() + 1));
        if across.is_high() { self.plus(field, side) } else { self.minus(field, side) }
    }

    /// The neighbour of the same size in any of the 26 directions, `None` outside the root. Domain as
    /// [`neighbour`](Key::neighbour).
    pub fn toward(self, direction: Direction) -> Option<Key> {
        let faces = direction.moves().axes().map(|axis| Face::new(axis, direction.corner() & axis));
        faces.into_iter().try_fold(self, Key::neighbour)
    }

    /// The up to 26 neighbours of the same size inside the root, by increasing step in x, then y, then z. Domain as
    /// [`neighbour`](Key::neighbour).
    pub fn neighbours(self) -> impl Iterator<Item = Key> + Clone {
        Direction::ALL.into_iter().filter_map(move |direction| self.toward(direction))
    }

    /// The corner of a cell, a point. Domain: cells.
    #[must_use]
    pub const fn corner(self, corner: Corner) -> Key {
        let low = self.lowest();
        Key(raise(self.code() & !(7 * low), corner, 8 * low))
    }

    /// The eight corners of a cell, by number. Domain: cells.
    pub fn corners(self) -> [Key; 8] {
        Corner::ALL.map(|corner| self.corner(corner))
    }

    /// The face of a cell. Domain: cells.
    #[must_use]
    pub const fn face(self, face: Face) -> Key {
        self.half_toward(face, self.lowest())
    }

    /// The six faces of a cell, by number. Domain: cells.
    pub fn faces(self) -> [Key; 6] {
        Face::ALL.map(|face| self.face(face))
    }

    /// The edge of a cell. Domain: cells.
    #[must_use]
    pub const fn edge(self, edge: Edge) -> Key {
        let [a, b] = edge.faces();
        self.half_toward(a, self.lowest()).half_toward(b, self.lowest())
    }

    /// The twelve edges of a cell, by number. Domain: cells.
    pub fn edges(self) -> [Key; 12] {
        Edge::ALL.map(|edge| self.edge(edge))
    }

    /// The points at the corners of any element, by corner number: two of an edge, four of a face, eight of a cell, a
    /// point itself.
    pub fn points(self) -> impl Iterator<Item = Key> + Clone {
        let (min, dir) = (self.min_code(), self.dir().bits());
        let side = if self.is_point() { 0 } else { 8 << (3 * self.trailing()) };
        Corner::ALL.into_iter().filter(move |c| c.bits() & !dir == 0).map(move |c| Key(raise(min, c, side)))
    }

    /// Half a side further across `face`, `half` given as z bit, with that axis switched in the extent.
    const fn half_toward(self, face: Face, half: u64) -> Key {
        let bit = face.axis().bit() as u64;
        let field = field(face.axis());
        let moved = if face.is_high() { add(self.0, field, half * bit) } else { subtract(self.0, field, half * bit) };
        Key(moved ^ bit << EXTENT_SHIFT)
    }

    /// `distance` further along one field, unless that leaves the root.
    const fn plus(self, field: u64, distance: u64) -> Option<Key> {
        let moved = add(self.0, field, distance);
        let (from, to) = (self.0 & field, moved & field);
        if from < to && to <= SIDE_CODE & field { Some(Key(moved)) } else { None }
    }

    /// `distance` back along one field, unless that leaves the root.
    const fn minus(self, field: u64, distance: u64) -> Option<Key> {
        if self.0 & field < distance { None } else { Some(Key(subtract(self.0, field, distance))) }
    }
}

/// The coordinate 2^19 on all three axes, interleaved.
const SIDE_CODE: u64 = 7 << 57;

/// The two faces across each axis of an extent, bit `i` for face `i`.
const fn faces_across(extent: Extent) -> u32 {
    let axes = extent.bits() as u32;
    (axes >> 2 & 1) * 0b11 + (axes >> 1 & 1) * 0b1100 + (axes & 1) * 0b11_0000
}

/// The elements of [`Key::boundary`] or [`Key::coboundary`]; at most six, made as they are asked for.
#[derive(Debug, Clone)]
pub struct Incident {
    key: Key,
    /// Half a side, as z bit.
    half: u64,
    /// The faces still to be crossed, a bit each.
    faces: u32,
}

impl Iterator for Incident {
    type Item = Key;

    fn next(&mut self) -> Option<Key> {
        let face = Face::from_index(self.faces.trailing_zeros() as usize)?;
        self.faces &= self.faces - 1;
        Some(self.key.half_toward(face, self.half))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.faces.count_ones() as usize;
        (left, Some(left))
    }
}

impl ExactSizeIterator for Incident {}
impl FusedIterator for Incident {}
