//! The elements of a solid, or of what is around it, in bricks of bit planes: [`Complex`].
//!
//! One plane for each kind of element (by [`Extent`]), eight planes a brick. A brick is listed when its elements are not all alike; wide
//! regions of bricks that are full cost nothing until something reaches them ([`Complex::open`]), and a brick that has become empty gives its
//! planes back.
//!
//! # The background is the object turned over
//!
//! The complement of a closed complex K is open: with an element it has all its cofaces. Its DUAL is closed: a point of the grid becomes a
//! cell, an edge a face, a face an edge, a cell a point, and boundary and coboundary are exchanged. Count centres in half cells, so
//! that an element that starts at p has the coordinate c = 2p + 1 along the axes of its extent and c = 2p along the others. Then c -> M - c
//! with an odd M changes the parity along all axes, hence extent into its complement, and keeps neighbours. In a brick that is: plane E of
//! the dual is plane !E of K, inverted, with all its 512 bits in reverse order; and high neighbours become low ones. So the background is a
//! complex of the same kind, in its own coordinates, and every stage of topology repair serves both.
//!
//! # The sentinel
//!
//! The complement is taken in the three-sphere, so that outside of some box there is one more cell, the sentinel, a point of the dual. The
//! box is made of the bricks that hold anything of K. Elements that stick out of it do not exist; a dual edge that leads there has
//! one end only, and the sentinel is the other. So the background is closed but for the sentinel, which never is in anybody's way:
//! collapses ask for cofaces only, and those are all in the box.
//!
//! # Invariants
//!
//! - Bricks `0..listed` at the time of building are sorted by key; those opened later follow in the order of opening.
//! - `around` names for each of the six sides the place of the neighbour, or [`NOTHING`], or [`DEEP`] for a full brick not yet opened.
//! - The live elements are closed (but for the sentinel) before and after every step of thinning.
//!
//! # Cost
//!
//! 512 bytes a brick while it has elements, 40 for its name and neighbours, and 768 for the record of what was paired with what, once
//! something was removed there.

use crate::grid::brick::{Local, Plane};
use crate::grid::key::SIDE;
use crate::grid::{Axis, Extent, Face, Key};
use crate::octree::crossings::{lattice_point, owned, owner};
use crate::octree::{EditedOctree, LinearOctree};
use rayon::prelude::*;

/// What a complex is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Side {
    /// The elements of the solid.
    Object,
    /// The dual of the elements that are not in the solid.
    Background,
}

/// A plane for each kind of element, by extent.
pub(super) type Planes = [Plane; 8];

/// No brick is there: all its elements are missing.
pub(super) const NOTHING: u32 = u32::MAX;
/// A brick is there that has not been opened: all its elements are live.
pub(super) const DEEP: u32 = u32::MAX - 1;

static EMPTY: Planes = [Plane::EMPTY; 8];
static FULL: Planes = [Plane::FULL; 8];

/// The elements of one brick.
#[derive(Debug, Clone)]
pub(super) struct Brick {
    pub(super) key: Key,
    /// By side: low x, high x, low y, ... in the complex's own coordinates.
    pub(super) around: [u32; 6],
    /// None when all are gone.
    pub(super) live: Option<Box<Planes>>,
    /// None when nothing was ever removed.
    pub(super) record: Option<Box<Record>>,
    /// Points and edges that thinning leaves alone, if there are any.
    pub(super) kept: Option<Box<Planes>>,
}

/// With what each element that has been removed as the upper part of a pair was removed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Record {
    /// Faces removed with an edge, by their normal: whether it is so, whether the edge lies across the second of the
    /// [other axes](Axis::others) rather than the first, and whether it is the high one.
    pub(super) faces: [[Plane; 3]; 3],
    /// Cells removed with a face: the number of its normal plus one in two planes, and whether it is the high one.
    pub(super) cells: [Plane; 3],
}

impl Record {
    pub(super) const NONE: Record = Record { faces: [[Plane::EMPTY; 3]; 3], cells: [Plane::EMPTY; 3] };

    /// The side of a face on which the edge lies with which it was removed.
    pub(super) fn edge_of(&self, normal: Axis, face: Local) -> Option<Face> {
        let [paired, second, high] = &self.faces[normal.index()];
        paired.get(face).then(|| Face::new(normal.others()[usize::from(second.get(face))], high.get(face)))
    }

    /// The side of a cell on which the face lies with which it was removed.
    pub(super) fn face_of(&self, cell: Local) -> Option<Face> {
        let [one, two, high] = &self.cells;
        let number = usize::from(one.get(cell)) + 2 * usize::from(two.get(cell));
        (number > 0).then(|| Face::new(Axis::ALL[number - 1], high.get(cell)))
    }
}

/// A closed complex of finest elements in bricks; see the module.
#[derive(Debug, Clone)]
pub struct Complex {
    depth: u32,
    side: Side,
    index: LinearOctree<u32>,
    pub(super) bricks: Vec<Brick>,
    /// Least and greatest brick of the box, counted in bricks.
    low: [u32; 3],
    high: [u32; 3],
}

/// A place of an element: brick, extent and position, in the complex's own coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Spot {
    pub(super) brick: u32,
    pub(super) extent: Extent,
    pub(super) local: Local,
}

impl Complex {
    /// The elements of the solid, or the dual of all others. Cost: some 0.5 us a listed brick, in parallel.
    pub fn new(octree: &EditedOctree, side: Side) -> Complex {
        Complex::with_kept(octree, side, &[])
    }

    /// The elements of the solid, of which `kept`, finest points and edges with their ends, are never to be removed: a subcomplex onto
    /// which what is left can be pushed. Cost as [`new`](Self::new).
    pub fn keeping(octree: &EditedOctree, kept: &[Key]) -> Complex {
        let mut complex = Complex::with_kept(octree, Side::Object, kept);
        for &element in kept {
            let Some(Spot { brick, extent, local }) = complex.spot(element) else { continue };
            let planes = complex.bricks[brick as usize].kept.get_or_insert_with(|| Box::new(EMPTY));
            planes[extent.index()].set(local);
        }
        complex
    }

    /// As `keeping`, but nothing is kept yet: the bricks are there.
    fn with_kept(octree: &EditedOctree, side: Side, kept: &[Key]) -> Complex {
        let crossings = octree.signed().crossings();
        let depth = crossings.depth();
        let mut keys: Vec<Key> = crossings.bricks().iter().map(|brick| brick.key).collect();
        let mut further = octree.edited_bricks();
        further.extend(kept.iter().filter_map(|&element| owner(depth, element).0));
        if further.iter().any(|key| crossings.find(*key).is_none()) {
            keys.extend(further);
            keys.par_sort_unstable();
            keys.dedup();
        }
        let mut index = LinearOctree::with_capacity(keys.len() + keys.len() / 4);
        let (mut low, mut high) = ([u32::MAX; 3], [0; 3]);
        for (place, &key) in (0..).zip(&keys) {
            index.insert(key, place);
            let at = lattice_point(depth, key).map(|c| c >> 3);
            low = std::array::from_fn(|a| low[a].min(at[a]));
            high = std::array::from_fn(|a| high[a].max(at[a]));
        }
        let mut complex = Complex { depth, side, index, bricks: Vec::new(), low, high };
        let bricks: Vec<Brick> = keys.into_par_iter().map(|key| complex.listed(octree, key)).collect();
        complex.bricks = bricks;
        complex
    }

    /// A brick as the octree has it.
    fn listed(&self, octree: &EditedOctree, key: Key) -> Brick {
        let signed = octree.signed();
        let found = signed.crossings().find(key);
        // The signs just beyond each side: if no brick is listed there, they hold for all of it.
        let beyond: [bool; 6] = match found {
            None => [octree.is_uniformly_inside(key); 6],
            Some(i) => {
                let corners = signed.corners(i);
                std::array::from_fn(|side| {
                    let face = Face::ALL[side];
                    if !face.is_high() {
                        return corners[0].get(Local::from_index(0));
                    }
                    let [x, y, z] = Axis::ALL.map(|axis| if axis == face.axis() { 7 } else { 0 });
                    corners[usize::from(face.axis().bit())].get(Local::new(x, y, z))
                })
            }
        };
        let around = Face::ALL.map(|face| {
            let primal = self.own(face);
            let Some(there) = key.neighbour(primal) else { return NOTHING };
            match self.index.get(there) {
                Some(&place) => place,
                None if beyond[primal.index()] == (self.side == Side::Object) && self.in_box(there) => DEEP,
                None => NOTHING,
            }
        });
        let planes = self.turned(key, octree.elements(key));
        let live = planes.iter().any(|plane| !plane.is_empty()).then(|| Box::new(planes));
        Brick { key, around, live, record: None, kept: None }
    }

    /// The planes of a brick in the complex's own coordinates, from those of the solid.
    fn turned(&self, key: Key, mut solid: Planes) -> Planes {
        if self.side == Side::Object {
            return solid;
        }
        solid.iter_mut().for_each(|plane| *plane = !*plane);
        let at = self.brick_at(key);
        for axis in Axis::ALL.into_iter().filter(|a| at[a.index()] == self.high[a.index()]) {
            // What starts in the last layer and extends along the axis sticks out of the box.
            let last = !Plane::EMPTY.at_plus(axis, &Plane::FULL);
            for extent in Extent::ALL.into_iter().filter(|extent| extent.contains(axis)) {
                solid[extent.index()] &= last;
            }
        }
        std::array::from_fn(|extent| solid[7 - extent].turned_over())
    }

    /// Bytes that [`new`](Self::new) takes for an octree, at most.
    pub fn bytes_for(octree: &EditedOctree) -> usize {
        let bricks = octree.signed().crossings().bricks().len() + octree.edited_bricks().len();
        bricks * (size_of::<Planes>() + size_of::<Brick>() + 2 * size_of::<(Key, u32)>())
    }

    /// Object or background.
    pub fn side(&self) -> Side {
        self.side
    }

    /// log2 of the number of finest cells a side of the root.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Number of bricks listed.
    pub fn bricks(&self) -> usize {
        self.bricks.len()
    }

    /// Number of live elements in listed bricks.
    pub fn count(&self) -> u64 {
        let of = |brick: &Brick| brick.live.as_deref().map_or(0, |planes| planes.iter().map(Plane::count).sum::<u32>());
        self.bricks.par_iter().map(|brick| u64::from(of(brick))).sum()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let of = |brick: &Brick| {
            usize::from(brick.live.is_some()) * size_of::<Planes>()
                + usize::from(brick.record.is_some()) * size_of::<Record>()
        };
        let boxes: usize = self.bricks.iter().map(of).sum();
        boxes + self.bricks.capacity() * size_of::<Brick>() + self.index.allocated_bytes()
    }

    /// Whether a finest element of the solid, or of its complement, is still there. Cost: a hash probe; for elements in full bricks some
    /// more.
    pub fn is_live(&self, element: Key) -> bool {
        self.spot(element).is_some_and(|spot| self.get(spot))
    }

    /// The place of a brick in a neighbouring place's direction turned from own to the octree's coordinates, and back.
    fn own(&self, face: Face) -> Face {
        match self.side {
            Side::Object => face,
            Side::Background => Face::new(face.axis(), !face.is_high()),
        }
    }

    fn brick_at(&self, key: Key) -> [u32; 3] {
        lattice_point(self.depth, key).map(|c| c >> 3)
    }

    fn in_box(&self, brick: Key) -> bool {
        let at = self.brick_at(brick);
        (0..3).all(|a| self.low[a] <= at[a] && at[a] <= self.high[a])
    }

    /// A brick's position in bricks, in own coordinates.
    pub(super) fn position(&self, brick: u32) -> [u32; 3] {
        let at = self.brick_at(self.bricks[brick as usize].key);
        match self.side {
            Side::Object => std::array::from_fn(|a| at[a] - self.low[a]),
            Side::Background => std::array::from_fn(|a| self.high[a] - at[a]),
        }
    }

    /// Bricks of the box along each axis.
    pub(super) fn extents(&self) -> [u32; 3] {
        std::array::from_fn(|a| (self.high[a] + 1).saturating_sub(self.low[a]))
    }

    /// The live elements of a brick, also for [`NOTHING`] and [`DEEP`].
    #[inline]
    pub(super) fn live(&self, brick: u32) -> &Planes {
        match brick {
            NOTHING => &EMPTY,
            DEEP => &FULL,
            _ => self.bricks[brick as usize].live.as_deref().unwrap_or(&EMPTY),
        }
    }

    /// The brick on one side of a brick.
    #[inline]
    pub(super) fn beside(&self, brick: u32, face: Face) -> u32 {
        self.bricks[brick as usize].around[face.index()]
    }

    /// Whether the element at a spot is live.
    #[inline]
    pub(super) fn get(&self, spot: Spot) -> bool {
        self.live(spot.brick)[spot.extent.index()].get(spot.local)
    }

    /// The element at a spot, as the octree names it.
    pub(super) fn key(&self, spot: Spot) -> Key {
        let (extent, local) = match self.side {
            Side::Object => (spot.extent, spot.local),
            Side::Background => (!spot.extent, Local::from_index(511 - spot.local.index())),
        };
        owned(self.depth, self.bricks[spot.brick as usize].key, local, extent)
    }

    /// The centre of the element at a spot, in lattice units.
    pub(super) fn coordinates(&self, spot: Spot) -> [f64; 3] {
        let size = f64::from(SIDE >> self.depth);
        let origin = lattice_point(self.depth, self.bricks[spot.brick as usize].key);
        let local = spot.local.coords();
        std::array::from_fn(|a| {
            let half = if spot.extent.contains(Axis::ALL[a]) { 0.5 } else { 0.0 };
            let own = f64::from(local[a]) + half;
            (f64::from(origin[a]) + if self.side == Side::Object { own } else { 7.5 - own }) * size
        })
    }

    /// Where the element with this name is, if its brick is listed.
    pub(super) fn spot(&self, element: Key) -> Option<Spot> {
        let (brick, local) = owner(self.depth, element);
        let brick = *self.index.get(brick?)?;
        Some(match self.side {
            Side::Object => Spot { brick, extent: element.dir(), local },
            Side::Background => Spot { brick, extent: !element.dir(), local: Local::from_index(511 - local.index()) },
        })
    }

    /// The spot half a side from another one across a side of it: in its boundary along an axis of its extent, in its coboundary along
    /// any other. None outside of all listed bricks.
    #[inline]
    pub(super) fn half_toward(&self, spot: Spot, face: Face) -> Option<Spot> {
        let axis = face.axis();
        let inward = spot.extent.contains(axis);
        let extent = if inward { spot.extent - axis } else { spot.extent | axis };
        // The low boundary and the high coboundary start where the element does.
        if inward != face.is_high() {
            return Some(Spot { extent, ..spot });
        }
        let (brick, local) = self.step(spot.brick, spot.local, face)?;
        Some(Spot { brick, extent, local })
    }

    /// The brick and the position one step further on one side. None outside of all listed bricks.
    #[inline]
    pub(super) fn step(&self, brick: u32, local: Local, face: Face) -> Option<(u32, Local)> {
        // The coordinates of a position are three bits each, x highest.
        let place = 6 - 3 * face.axis().index() as u32;
        let (index, one) = (local.index(), 1 << place);
        let c = index >> place & 7;
        let (across, next) = if face.is_high() {
            (c == 7, if c == 7 { index - 7 * one } else { index + one })
        } else {
            (c == 0, if c == 0 { index + 7 * one } else { index - one })
        };
        let brick = if across { self.beside(brick, face) } else { brick };
        (brick < DEEP).then_some((brick, Local::from_index(next)))
    }

    /// The elements of a brick as they were before anything was removed; `octree` is what the complex was made of.
    pub(super) fn before_thinning(&self, octree: &EditedOctree, brick: u32) -> Planes {
        let key = self.bricks[brick as usize].key;
        self.turned(key, octree.elements(key))
    }

    /// Opens the brick on one side if it is full and has not been opened. Its place, if there is any.
    pub(super) fn open(&mut self, brick: u32, face: Face) -> Option<u32> {
        match self.beside(brick, face) {
            NOTHING => return None,
            DEEP => {}
            place => return Some(place),
        }
        let key = self.bricks[brick as usize].key.neighbour(self.own(face)).expect("deep bricks lie in the root");
        let place = self.bricks.len() as u32;
        self.index.insert(key, place);
        let around = Face::ALL.map(|face| {
            let Some(there) = key.neighbour(self.own(face)).filter(|there| self.in_box(*there)) else { return NOTHING };
            self.index.get(there).copied().unwrap_or(DEEP)
        });
        for (face, &neighbour) in Face::ALL.into_iter().zip(&around).filter(|(_, neighbour)| **neighbour < DEEP) {
            self.bricks[neighbour as usize].around[face.opposite().index()] = place;
        }
        let solid = if self.side == Side::Object { FULL } else { EMPTY };
        let live = Some(Box::new(self.turned(key, solid)));
        self.bricks.push(Brick { key, around, live, record: None, kept: None });
        Some(place)
    }

    /// The first element that is live although one in its boundary is not, and is no way to the sentinel either.
    ///
    /// # Errors
    /// Names it.
    pub fn validate(&self) -> Result<(), String> {
        for brick in 0..self.bricks.len() as u32 {
            for face in Face::ALL {
                let there = self.beside(brick, face);
                if there < DEEP && self.beside(there, face.opposite()) != brick {
                    return Err(format!("the neighbours of {} disagree", self.bricks[brick as usize].key));
                }
            }
            for extent in Extent::ALL {
                for local in self.live(brick)[extent.index()].iter() {
                    let spot = Spot { brick, extent, local };
                    let element = self.key(spot);
                    let faces = Face::ALL.into_iter().filter(|face| extent.contains(face.axis()));
                    for face in faces {
                        let deep = self.half_toward(spot, face).is_none() && self.beside(brick, face) == DEEP;
                        let gone = self.half_toward(spot, face).is_none_or(|part| !self.get(part));
                        if gone && !deep && !self.leaves_box(spot, face) {
                            return Err(format!("{element} is live, but its boundary is not"));
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Whether the part of an element's boundary on one side is the sentinel's: it lies on the boundary of the background's box.
    fn leaves_box(&self, spot: Spot, face: Face) -> bool {
        let (at, axis) = (self.position(spot.brick), face.axis().index());
        let c = at[axis] * 8 + spot.local.coords()[axis];
        let last = self.extents()[axis] * 8 - 1;
        self.side == Side::Background && c == if face.is_high() { last } else { 0 }
    }
}
