//! Meshes of cells around and inside of a body: for finite volumes and elements.
//!
//! Cells are fine along the surface and grow away from it, by one level at a time: the tree is balanced over faces, so that a face has one
//! neighbour, or four half as large whose nodes hang in its middle and on its edges. A finest cell with corners on both sides of the
//! surface is cut; of all others all points are on one side.

use crate::geom::Frame;
use crate::grid::Key;
use crate::grid::brick::Local;
use crate::octree::crossings::lattice_point;
use crate::octree::point_set::PointSet;
use crate::octree::signed::Uniform;
use crate::octree::{Balance, LinearOctree, SignedOctree};
use glam::DVec3;
use rayon::prelude::*;

/// On which side of the surface a cell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Side {
    /// All of it is outside.
    Outside = 0,
    /// All of it is inside.
    Inside = 1,
    /// It has corners on both sides.
    Cut = 2,
}

/// Hexahedra over shared points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Hexahedra {
    /// Corners of cells, in model units, along the curve.
    pub points: Vec<DVec3>,
    /// The corners of each cell: those of the low face in z, counterclockwise seen from above, then those above them.
    pub cells: Vec<[u32; 8]>,
    /// The level of each cell: the root cube has 0.
    pub levels: Vec<u8>,
    /// Where each cell is.
    pub sides: Vec<Side>,
    /// The signed distance of each point from the surface, below 0 inside; none where it was not asked for.
    pub distances: Vec<f64>,
}

/// Signs of all lattice points of an octree.
pub(crate) struct Signs<'a> {
    octree: &'a SignedOctree,
    uniform: Uniform<'a>,
}

impl<'a> Signs<'a> {
    pub(crate) fn new(octree: &'a SignedOctree) -> Self {
        Signs { octree, uniform: octree.uniform() }
    }

    /// Whether a lattice point, in cells, is inside. A probe, or a search.
    pub(crate) fn is_inside(&self, at: [u32; 3]) -> bool {
        let crossings = self.octree.crossings();
        // There is nothing inside on the root's boundary.
        let Some(key) = Key::cell(crossings.depth() - 3, at.map(|c| c >> 3)) else { return false };
        match crossings.find(key) {
            Some(i) => self.octree.inside()[i].get(Local::new(at[0], at[1], at[2])),
            None => self.uniform.is_inside(key),
        }
    }
}

/// The cells of a solid: those with surface of the octree's depth, the others as large as balance allows but of the level `coarsest` at
/// most.
pub(crate) fn cells_of(octree: &SignedOctree, coarsest: u32) -> LinearOctree<Side> {
    let depth = octree.crossings().depth();
    let mixed = octree.crossings().bricks().iter().enumerate().map(|(i, brick)| (brick.key, octree.mixed_cells(i)));
    let mixed = PointSet::new(depth, mixed);
    let signs = Signs::new(octree);
    let has_surface = |cell: Key| {
        let level = cell.level().expect("a cell");
        if level + 3 <= depth {
            return mixed.any_in(cell);
        }
        let plane = mixed.plane(cell.ancestor(depth - 3));
        let (low, side) = (lattice_point(depth, cell), 1 << (depth - level));
        let at = |i: u32| Local::new(low[0] + i / side / side, low[1] + i / side % side, low[2] + i % side);
        (0..side * side * side).any(|i| plane.get(at(i)))
    };
    let side = |leaf: Key| match leaf.level() == Some(depth) && has_surface(leaf) {
        true => Side::Cut,
        false if signs.is_inside(lattice_point(depth, leaf)) => Side::Inside,
        false => Side::Outside,
    };
    let split = |cell: Key| cell.level() < Some(coarsest) || has_surface(cell);
    let mut tree = LinearOctree::build(depth, split, side);
    // Only cells of one sign are split.
    tree.balance(Balance::Faces, |_, &side| side);
    tree
}

impl Hexahedra {
    /// Those of the cells of a tree for which the answer is yes, in order, without distances. Sorts 8 bytes a corner.
    pub(crate) fn of_tree(
        tree: &LinearOctree<Side>,
        frame: &Frame,
        wanted: impl Fn(Side) -> bool + Sync,
    ) -> (Self, Vec<Key>) {
        let leaves: Vec<(Key, Side)> =
            tree.iter_z().map(|(leaf, &side)| (leaf, side)).filter(|leaf| wanted(leaf.1)).collect();
        let mut corners: Vec<Key> = leaves.par_iter().flat_map_iter(|(leaf, _)| leaf.corners()).collect();
        corners.par_sort_unstable();
        corners.dedup();
        let place = |point: &Key| super::build::place(frame, point.center());
        let number = |point: Key| corners.binary_search(&point).expect("a corner of a cell") as u32;
        let cells = leaves.par_iter().map(|(leaf, _)| ORDER.map(|corner| number(leaf.corners()[corner])));
        let hexahedra = Hexahedra {
            points: corners.par_iter().map(place).collect(),
            cells: cells.collect(),
            levels: leaves.iter().map(|(leaf, _)| leaf.level().expect("a cell") as u8).collect(),
            sides: leaves.iter().map(|leaf| leaf.1).collect(),
            distances: Vec::new(),
        };
        (hexahedra, corners)
    }

    /// Number of cells on a side.
    pub fn count(&self, side: Side) -> usize {
        self.sides.iter().filter(|&&s| s == side).count()
    }
}

/// The corners of a cell, by number (x highest), in the order of finite elements.
const ORDER: [usize; 8] = [0b000, 0b100, 0b110, 0b010, 0b001, 0b101, 0b111, 0b011];
