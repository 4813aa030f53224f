//! The cells that edits touch, what they see of the complex, and their vertices.

use crate::grid::brick::{Local, Plane};
use crate::grid::cases::Mask;
use crate::grid::subcomplex::{Part, Subcomplex};
use crate::grid::{Axis, Corner, Extent, Key};
use crate::octree::crossings::{lattice_point, owner};
use crate::octree::{EditedOctree, LinearOctree};
use rayon::prelude::*;

/// Where a cell starts, in cells: 0 .. 2^depth inside the root. Edits on the root's boundary touch cells one step outside.
pub(super) type At = [i32; 3];

/// A cell with a part that is edited.
#[derive(Debug, Clone, Copy)]
pub(super) struct TouchedCell {
    pub(super) at: At,
    /// What it sees of the edited complex.
    pub(super) parts: Subcomplex,
    /// For each corner in the complex the vertex of the cell that it belongs to.
    pub(super) slots: [u8; 8],
    /// Its first vertex, counted over the touched cells.
    pub(super) first: u32,
    /// Number of its vertices.
    pub(super) vertices: u8,
    /// The vertices that are not the only one of their sheet, a bit each.
    pub(super) irregular: u8,
    /// The corners inside by their signs; 0 as well in bricks without a change of sign.
    pub(super) signs: Mask,
}

/// All cells with a part that is edited, brick by brick in Z-order.
#[derive(Debug)]
pub(super) struct Touched {
    /// Place in `bricks` by [`brick_key`].
    index: LinearOctree<u32>,
    bricks: Vec<(Plane, u32)>,
    pub(super) cells: Vec<TouchedCell>,
    /// Number of vertices.
    pub(super) vertices: u32,
    depth: u32,
}

/// Bricks one step outside of the root need a name as well: that of a cell in a root four times as wide, in which the octree's own begins
/// at brick 1 of each axis.
fn brick_key(depth: u32, brick: At) -> Key {
    Key::cell(depth - 1, brick.map(|b| (b + 1) as u32)).expect("bricks beside the root fit into one four times as wide")
}

/// The inverse of [`brick_key`].
fn brick_at(depth: u32, key: Key) -> At {
    lattice_point(depth - 1, key).map(|b| b as i32 - 1)
}

fn local([x, y, z]: At) -> Local {
    Local::new(x as u32 & 7, y as u32 & 7, z as u32 & 7)
}

/// The cells round a finest element.
fn cells_round(depth: u32, element: Key) -> impl Iterator<Item = At> {
    let (at, dir) = (lattice_point(depth, element).map(|c| c as i32), element.dir());
    let before = Corner::ALL.into_iter().filter(move |c| c.bits() & dir.bits() == 0);
    before.map(move |c| Axis::ALL.map(|a| at[a.index()] - i32::from(c & a)))
}

impl Touched {
    /// Cost: linear in the edits; for each touched cell 27 bits looked up and its sheets worked out, brick by brick and in parallel.
    ///
    /// # Panics
    /// When the complex is not closed.
    pub(super) fn new(octree: &EditedOctree) -> Self {
        let depth = octree.signed().crossings().depth();
        let mut planes: LinearOctree<Plane> = LinearOctree::new();
        let mut last = (Key::ROOT, Plane::EMPTY);
        for at in octree.removed().iter().chain(octree.added()).flat_map(|&element| cells_round(depth, element)) {
            let key = brick_key(depth, at.map(|c| c >> 3));
            if key != last.0 {
                keep(&mut planes, last);
                last = (key, Plane::EMPTY);
            }
            last.1.set(local(at));
        }
        keep(&mut planes, last);
        let mut listed: Vec<(Key, Plane)> = planes.iter().map(|(key, &plane)| (key, plane)).collect();
        listed.par_sort_unstable_by_key(|brick| brick.0);
        let elements = Elements::new(octree);
        let cells: Vec<Vec<TouchedCell>> =
            listed.par_iter().map(|&(key, plane)| cells_of(&elements, brick_at(depth, key), &plane)).collect();
        let mut touched = Touched {
            index: LinearOctree::with_capacity(listed.len()),
            bricks: Vec::with_capacity(listed.len()),
            cells: Vec::with_capacity(cells.iter().map(Vec::len).sum()),
            vertices: 0,
            depth,
        };
        for ((key, plane), of_brick) in listed.into_iter().zip(cells) {
            touched.index.insert(key, touched.bricks.len() as u32);
            touched.bricks.push((plane, touched.cells.len() as u32));
            for mut cell in of_brick {
                cell.first = touched.vertices;
                let vertices = touched.vertices.checked_add(u32::from(cell.vertices));
                touched.vertices = vertices.expect("fewer than 2^32 vertices");
                touched.cells.push(cell);
            }
        }
        touched
    }

    /// The place of the cell at `at` in the list, if it is touched. Cost: a hash probe and a rank.
    pub(super) fn find(&self, at: At) -> Option<usize> {
        let &brick = self.index.get(brick_key(self.depth, at.map(|c| c >> 3)))?;
        let (plane, first) = &self.bricks[brick as usize];
        plane.get(local(at)).then(|| (first + plane.rank(local(at))) as usize)
    }
}

/// Adds cells to what is listed.
fn keep(planes: &mut LinearOctree<Plane>, (key, plane): (Key, Plane)) {
    if !plane.is_empty() {
        let listed = planes.get_or_insert_with(key, || Plane::EMPTY);
        *listed |= plane;
    }
}

/// The touched cells of a brick.
fn cells_of(elements: &Elements<'_>, brick: At, touched: &Plane) -> Vec<TouchedCell> {
    // The brick's own elements, and for its last cells those of the bricks beyond.
    let mut needed = [false; 8];
    for cell in touched.iter() {
        let last = Axis::ALL.into_iter().filter(|a| cell.coords()[a.index()] == 7).fold(Corner::MIN, Corner::high);
        (0..8u8).filter(|c| c & !last.bits() == 0).for_each(|c| needed[usize::from(c)] = true);
    }
    let around: [[Plane; 8]; 8] = std::array::from_fn(|i| {
        let beyond = Axis::ALL.map(|a| brick[a.index()] + i32::from(Corner::ALL[i] & a));
        if needed[i] { elements.of(beyond) } else { [Plane::EMPTY; 8] }
    });
    let signed = elements.octree.signed();
    let place = key_in_root(signed.crossings().depth(), brick).and_then(|key| signed.crossings().find(key));
    let corners = place.map(|i| signed.corners(i));
    let parts: [(Extent, [u32; 3]); 27] =
        Part::ALL.map(|part| (part.extent(), Axis::ALL.map(|a| u32::from(part.start() & a))));
    let made = touched.iter().map(|cell| {
        let c = cell.coords();
        let mut seen = Subcomplex::EMPTY;
        for (part, (extent, start)) in Part::ALL.into_iter().zip(parts) {
            let [x, y, z] = std::array::from_fn(|a| c[a] + start[a]);
            let beyond = (x >> 3) << 2 | (y >> 3) << 1 | z >> 3;
            if around[beyond as usize][extent.index()].get(Local::new(x, y, z)) {
                seen.insert(part);
            }
        }
        let at = std::array::from_fn(|a| 8 * brick[a] + c[a] as i32);
        assert!(seen.is_closed(), "the complex is closed: the cell at {at:?} has a part without its boundary");
        let sheets = seen.sheets();
        let irregular = Corner::ALL.into_iter().filter(|&c| seen.contains(c));
        let irregular = irregular.filter(|c| sheets.vertices > 0 && !sheets.is_regular(sheets.sheet[c.index()]));
        TouchedCell {
            at,
            parts: seen,
            slots: sheets.vertex,
            first: 0,
            vertices: sheets.vertices,
            irregular: irregular.fold(0, |bits, c| bits | 1 << sheets.vertex[c.index()]),
            signs: corners.as_ref().map_or(0, |planes| (0..8).fold(0, |m, i| m | Mask::from(planes[i].get(cell)) << i)),
        }
    });
    made.collect()
}

/// The key of a brick of the root; `None` outside.
fn key_in_root(depth: u32, brick: At) -> Option<Key> {
    let inside = brick.iter().all(|&b| b >= 0);
    inside.then(|| Key::cell(depth - 3, brick.map(|b| b as u32))).flatten()
}

/// The elements of the complex by brick and extent.
struct Elements<'a> {
    octree: &'a EditedOctree,
    /// Those on the root's high faces start in bricks outside, and are there because they were added.
    outside: LinearOctree<[Plane; 8]>,
}

impl<'a> Elements<'a> {
    fn new(octree: &'a EditedOctree) -> Self {
        let depth = octree.signed().crossings().depth();
        let mut outside = LinearOctree::new();
        for &element in octree.added().iter().filter(|&&element| owner(depth, element).0.is_none()) {
            let at = lattice_point(depth, element).map(|c| c as i32);
            let planes: &mut [Plane; 8] =
                outside.get_or_insert_with(brick_key(depth, at.map(|c| c >> 3)), || [Plane::EMPTY; 8]);
            planes[element.dir().index()].set(local(at));
        }
        Elements { octree, outside }
    }

    /// Those that start in a brick.
    fn of(&self, brick: At) -> [Plane; 8] {
        let depth = self.octree.signed().crossings().depth();
        match key_in_root(depth, brick) {
            Some(key) => self.octree.elements(key),
            None => self.outside.get(brick_key(depth, brick)).copied().unwrap_or([Plane::EMPTY; 8]),
        }
    }
}
