//! The cells that edits touch, what they see of the complex, and their vertices.
//!
//! All is done by bricks and planes. Edits of a brick, moved back along the axes on which they do not extend, are the cells round them;
//! elements moved by the place of a part in its cell say which cells see that part.

use super::place::Scale;
use super::shapes::Shape;
use crate::error::Result;
use crate::grid::brick::{Bits, Local, Plane};
use crate::grid::cases::Mask;
use crate::grid::subcomplex::{Part, Subcomplex};
use crate::grid::{Axis, Corner, Extent, Key};
use crate::octree::crossings::lattice_point;
use crate::octree::{EditedOctree, LinearOctree, SignedOctree};
use crate::parallel::{in_order, pieces};
use crate::progress::Progress;
use glam::DVec3;
use hashbrown::HashMap;
use std::ops::Range;

/// Where a cell or a brick starts, in cells or bricks: from 0 inside the root. Edits on the root's boundary touch cells one step outside.
pub(super) type At = [i32; 3];

/// A cell with a part that is edited.
#[derive(Debug, Clone, Copy)]
pub(super) struct TouchedCell {
    /// Its first vertex, counted over the touched cells.
    pub(super) first: u32,
    /// The place of what it sees of the edited complex.
    pub(super) shape: u16,
    /// The corners inside by their signs; 0 as well in bricks without a change of sign.
    pub(super) signs: Mask,
}

/// A brick with touched cells.
#[derive(Debug, Clone)]
pub(super) struct TouchedBrick {
    pub(super) at: At,
    /// Its place in the octree, if it is listed there.
    pub(super) place: Option<u32>,
    pub(super) plane: Plane,
    /// The place of its first cell.
    pub(super) first: u32,
}

impl TouchedBrick {
    /// The place of the brick's first cell and, for each cell, where it starts.
    pub(super) fn cells(&self) -> impl Iterator<Item = (usize, At)> + '_ {
        let start = |cell: Local| std::array::from_fn(|a| 8 * self.at[a] + cell.coords()[a] as i32);
        (self.first as usize..).zip(self.plane.iter().map(start))
    }
}

/// All cells with a part that is edited, brick by brick in Z-order.
#[derive(Debug)]
pub(super) struct Touched {
    /// Place in `bricks` by [`brick_key`].
    index: LinearOctree<u32>,
    pub(super) bricks: Vec<TouchedBrick>,
    pub(super) cells: Vec<TouchedCell>,
    pub(super) shapes: Vec<Shape>,
    /// Number of vertices.
    pub(super) vertices: u32,
    depth: u32,
}

/// For each touched cell of a brick what it sees of the complex, and its corners inside by their signs.
type Views = Vec<(Subcomplex, Mask)>;

/// Bricks a piece of the work.
const PIECE: usize = 16;

/// Bricks one step outside of the root need a name as well: that of a cell in a root four times as wide, in which the octree's own begins
/// at brick 1 of each axis. Bricks further off have none.
fn brick_key(depth: u32, brick: At) -> Option<Key> {
    Key::cell(depth - 1, brick.map(|b| (b + 1) as u32))
}

/// Why those that edits touch have a name.
const NAMED: &str = "edits touch bricks of the root or beside it";

/// The inverse of [`brick_key`].
fn brick_at(depth: u32, key: Key) -> At {
    lattice_point(depth - 1, key).map(|b| b as i32 - 1)
}

/// Bricks before and beyond another by a step along some axes.
fn stepped(at: At, corner: Corner, step: i32) -> At {
    Axis::ALL.map(|a| at[a.index()] + if corner & a { step } else { 0 })
}

impl Touched {
    /// The nearest point of the root, in cells: cells beyond its boundary have vertices, too.
    pub(super) fn in_root(&self, p: DVec3) -> DVec3 {
        p.clamp(DVec3::ZERO, DVec3::splat(f64::from(1u32 << self.depth)))
    }

    /// The fixed point in which positions are kept.
    pub(super) fn scale(&self) -> Scale {
        Scale::new(self.depth)
    }

    /// Cost: linear in the edits, then some microseconds a brick and 60 ns a touched cell in parallel; while it lasts, 512 bytes an edited
    /// brick.
    ///
    /// # Errors
    /// `Cancelled`.
    ///
    /// # Panics
    /// When the complex is not closed.
    pub(super) fn new(octree: &EditedOctree, progress: &dyn Progress) -> Result<Self> {
        let depth = octree.signed().crossings().depth();
        let (edited, planes) = EditedBricks::new(octree);
        let mut listed: Vec<(Key, Plane)> = planes.iter().map(|(key, &plane)| (key, plane)).collect();
        drop(planes);
        listed.sort_unstable_by_key(|brick| brick.0);
        let count = listed.iter().map(|brick| brick.1.count() as usize).sum();
        let mut touched = Touched {
            index: LinearOctree::with_capacity(listed.len()),
            bricks: Vec::with_capacity(listed.len()),
            cells: Vec::with_capacity(count),
            shapes: Vec::new(),
            vertices: 0,
            depth,
        };
        let hasher = ahash::RandomState::with_seeds(21, 22, 23, 24);
        let mut numbers: HashMap<Subcomplex, u16, ahash::RandomState> = HashMap::with_hasher(hasher);
        let (count, piece) = pieces(listed.len(), PIECE);
        let look = |seen: &mut Vec<Subcomplex>, n| {
            let of_brick = |&(key, plane): &(Key, Plane)| {
                let at = brick_at(depth, key);
                let place = edited.place(at);
                edited.seen_from(at, &plane, seen);
                (place, seen.iter().copied().zip(signs(octree.signed(), place, &plane)).collect())
            };
            listed[piece(n)].iter().map(of_brick).collect()
        };
        let mut next = listed.iter();
        let list = |bricks: Vec<(Option<u32>, Views)>| {
            for ((place, cells), &(key, plane)) in bricks.into_iter().zip(next.by_ref()) {
                let brick = TouchedBrick { at: brick_at(depth, key), place, plane, first: touched.cells.len() as u32 };
                touched.index.insert(key, touched.bricks.len() as u32);
                for (cell, (parts, signs)) in plane.iter().zip(cells) {
                    let shape = *numbers.entry(parts).or_insert_with(|| {
                        let coords = cell.coords();
                        assert!(parts.is_closed(), "the complex is closed: not at {coords:?} of brick {:?}", brick.at);
                        touched.shapes.push(Shape::new(parts));
                        touched.shapes.len() as u16 - 1
                    });
                    touched.cells.push(TouchedCell { first: touched.vertices, shape, signs });
                    let vertices = u32::from(touched.shapes[usize::from(shape)].vertices);
                    touched.vertices = touched.vertices.checked_add(vertices).expect("fewer than 2^32 vertices");
                }
                touched.bricks.push(brick);
            }
            Ok(())
        };
        in_order(count, progress, Vec::new, look, list)?;
        Ok(touched)
    }

    /// What a touched cell sees.
    #[inline]
    pub(super) fn shape(&self, cell: TouchedCell) -> &Shape {
        &self.shapes[usize::from(cell.shape)]
    }

    /// The place of a brick in the list, if it has touched cells. Cost: a hash probe.
    pub(super) fn find(&self, brick: At) -> Option<usize> {
        self.index.get(brick_key(self.depth, brick)?).map(|&place| place as usize)
    }

    /// The bricks with touched cells among a brick and those round it, with the steps to them. Cost: 27 hash probes.
    pub(super) fn around(&self, brick: usize) -> impl Iterator<Item = ([i32; 3], usize)> + '_ {
        let at = self.bricks[brick].at;
        let steps = (0..27).map(|i| [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1]);
        steps.filter_map(move |steps| Some((steps, self.find(std::array::from_fn(|a| at[a] + steps[a]))?)))
    }

    /// How many pieces there are to work on, and the bricks of piece number n.
    pub(super) fn pieces(&self) -> (usize, impl Fn(usize) -> Range<usize> + Copy + use<>) {
        pieces(self.bricks.len(), PIECE)
    }

    /// The number of the first vertex of a brick, or of all vertices beyond the last.
    pub(super) fn first_of(&self, brick: usize) -> u32 {
        let first = self.bricks.get(brick).and_then(|brick| self.cells.get(brick.first as usize));
        first.map_or(self.vertices, |cell| cell.first)
    }
}

/// The corners that are inside of some cells of a brick.
fn signs(octree: &SignedOctree, place: Option<u32>, cells: &Plane) -> Vec<Mask> {
    let corners = place.map(|i| octree.corners(i as usize));
    let signs = |cell| {
        let corners = corners.as_ref()?;
        Some((0..8).fold(0, |mask, i| mask | Mask::from(corners[i].get(cell)) << i))
    };
    cells.iter().map(|cell| signs(cell).unwrap_or(0)).collect()
}

/// The cells of which elements are parts: those of the elements' brick, and of the bricks before it along the axes of each corner.
fn cells_round(elements: &[Plane; 8]) -> [Plane; 8] {
    let mut spread = [[Plane::EMPTY; 8]; 8];
    spread[0] = *elements;
    for axis in Axis::ALL {
        let bit = usize::from(axis.bit());
        for (before, extent) in (0..64).map(|i| (i >> 3, i & 7)).filter(|(b, e)| (b | e) & bit == 0) {
            let plane = spread[before][extent];
            if !plane.is_empty() {
                spread[before][extent | bit] |= plane | plane.at_plus(axis, &Plane::EMPTY);
                spread[before | bit][extent | bit] |= Plane::EMPTY.at_plus(axis, &plane);
            }
        }
    }
    spread.map(|planes| planes[Extent::CELL.index()])
}

/// The elements of the complex by brick and extent.
struct EditedBricks<'a> {
    octree: &'a EditedOctree,
    /// Place in `elements` of the bricks that own an edited element, by [`brick_key`]. Elements on the root's high faces start in
    /// bricks outside, and are there because they were added.
    index: LinearOctree<u32>,
    elements: Vec<[Plane; 8]>,
}

impl<'a> EditedBricks<'a> {
    /// Also returns the cells round all edits, by [`brick_key`].
    fn new(octree: &'a EditedOctree) -> (Self, LinearOctree<Plane>) {
        let depth = octree.signed().crossings().depth();
        let mut bricks = EditedBricks { octree, index: LinearOctree::new(), elements: Vec::new() };
        let mut touched = LinearOctree::new();
        for (list, add) in [(octree.removed(), false), (octree.added(), true)] {
            let at = |&element: &Key| lattice_point(depth, element).map(|c| c as i32);
            let mut edits = list.iter().map(|element| (at(element), element.dir())).peekable();
            while let Some(&(first, _)) = edits.peek() {
                let brick = first.map(|c| c >> 3);
                let mut changed = [Plane::EMPTY; 8];
                while let Some(([x, y, z], extent)) = edits.next_if(|(at, _)| at.map(|c| c >> 3) == brick) {
                    changed[extent.index()].set(Local::new(x as u32 & 7, y as u32 & 7, z as u32 & 7));
                }
                bricks.change(brick, &changed, add);
                for (corner, cells) in Corner::ALL.into_iter().zip(cells_round(&changed)) {
                    if !cells.is_empty() {
                        let key = brick_key(depth, stepped(brick, corner, -1)).expect(NAMED);
                        *touched.get_or_insert_with(key, || Plane::EMPTY) |= cells;
                    }
                }
            }
        }
        (bricks, touched)
    }

    /// Adds elements of a brick or takes them away.
    fn change(&mut self, brick: At, changed: &[Plane; 8], add: bool) {
        let key = brick_key(self.octree.signed().crossings().depth(), brick).expect(NAMED);
        let place = if let Some(&place) = self.index.get(key) {
            place
        } else {
            self.index.insert(key, self.elements.len() as u32);
            self.elements.push(self.unedited(brick));
            self.elements.len() as u32 - 1
        };
        for (plane, &changed) in self.elements[place as usize].iter_mut().zip(changed) {
            *plane = if add { *plane | changed } else { *plane & !changed };
        }
    }

    /// The place in the octree of a brick, if it is listed.
    fn place(&self, brick: At) -> Option<u32> {
        let crossings = self.octree.signed().crossings();
        key_in_root(crossings.depth(), brick).and_then(|key| crossings.find(key)).map(|place| place as u32)
    }

    /// The elements that start in a brick, by their signs.
    fn unedited(&self, brick: At) -> [Plane; 8] {
        let depth = self.octree.signed().crossings().depth();
        match (self.place(brick), key_in_root(depth, brick)) {
            (Some(place), _) => self.octree.signed().elements(place as usize),
            (None, Some(key)) if self.octree.is_uniformly_inside(key) => [Plane::FULL; 8],
            _ => [Plane::EMPTY; 8],
        }
    }

    /// Those that start in a brick.
    fn of(&self, brick: At) -> [Plane; 8] {
        let key = brick_key(self.octree.signed().crossings().depth(), brick).expect(NAMED);
        self.index.get(key).map_or_else(|| self.unedited(brick), |&place| self.elements[place as usize])
    }

    /// What the touched cells of a brick see of the complex, one after the other.
    fn seen_from(&self, brick: At, touched: &Plane, seen: &mut Vec<Subcomplex>) {
        // The brick's own elements, and for its last cells those of the bricks beyond.
        let touches = |corner: Corner| Axis::ALL.into_iter().all(|a| !(corner & a) || touched.touches_max(a));
        let around: [[Plane; 8]; 8] = Corner::ALL
            .map(|corner| if touches(corner) { self.of(stepped(brick, corner, 1)) } else { [Plane::EMPTY; 8] });
        let parts: [Plane; 27] = Part::ALL.map(|part| moved(&around, part));
        seen.clear();
        for (x, &word) in touched.0.iter().enumerate() {
            let words: [u64; 27] = std::array::from_fn(|part| parts[part].0[x]);
            seen.extend(Bits(word).map(|bit| {
                let mut cell = Subcomplex::EMPTY;
                Part::ALL.into_iter().filter(|part| words[part.index()] >> bit & 1 == 1).for_each(|p| cell.insert(p));
                cell
            }));
        }
    }
}

/// The cells of a brick that see a part, given the elements of the bricks beyond it by corner.
fn moved(around: &[[Plane; 8]; 8], part: Part) -> Plane {
    let start = part.start();
    let mut planes: [Plane; 8] = std::array::from_fn(|beyond| around[beyond][part.extent().index()]);
    for axis in Axis::ALL.into_iter().filter(|&a| start & a) {
        let bit = usize::from(axis.bit());
        for beyond in (0..8).filter(|b| b & bit == 0 && b & !usize::from(start.bits()) == 0) {
            planes[beyond] = planes[beyond].at_plus(axis, &planes[beyond | bit]);
        }
    }
    planes[0]
}

/// The key of a brick of the root; `None` outside.
fn key_in_root(depth: u32, brick: At) -> Option<Key> {
    let inside = brick.iter().all(|&b| b >= 0);
    inside.then(|| Key::cell(depth - 3, brick.map(|b| b as u32))).flatten()
}
