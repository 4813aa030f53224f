//! The cube in which the smooth part is found: four times as wide as the root, so that what happens at its rim matters little.
//!
//! The root lies at a quarter to a half of it along each axis. Bricks of level j have cells of 2^-(j+3) of the world's side; those of level
//! `depth - 1` are the bricks of the finest grid.

use crate::grid::Key;
use crate::grid::key::SIDE;
use crate::octree::crossings::lattice_point;

/// Level of the world's bricks that are bricks of the finest grid.
pub(super) const fn finest(depth: u32) -> u32 {
    depth - 1
}

/// A brick of the finest grid as one of the world.
pub(super) fn from_root(depth: u32, brick: Key) -> Key {
    at_point(depth, lattice_point(depth, brick))
}

/// The brick of the finest grid that a finest brick of the world is, if it lies in the root.
pub(super) fn to_root(depth: u32, key: Key) -> Option<Key> {
    in_root(depth, key).map(|(at, _)| Key::cell(depth - 3, at).expect("in the root"))
}

/// The world's finest brick with a lattice point of the root, in cells.
pub(super) fn at_point(depth: u32, point: [u32; 3]) -> Key {
    let coords = point.map(|c| (1 << (depth - 3)) + (c >> 3));
    Key::cell(finest(depth), coords).expect("the root lies in the world")
}

/// The finest bricks of the root in a brick of the world: the first in space and how many a side. `None` outside of the root, and for those
/// that hold more than the root.
pub(super) fn in_root(depth: u32, key: Key) -> Option<([u32; 3], u32)> {
    let side = 1 << (finest(depth) - level(key));
    let root = 1 << (depth - 3);
    let first = coords(key).map(|c| (c * side).wrapping_sub(root));
    (side <= root && first.iter().all(|&c| c < root)).then_some((first, side))
}

pub(super) fn level(key: Key) -> u32 {
    key.level().expect("bricks are cells")
}

/// In bricks of its level.
pub(super) fn coords(key: Key) -> [u32; 3] {
    key.min_corner().map(|c| c / (SIDE >> level(key)))
}

/// The brick with these coordinates, if it lies in the world.
pub(super) fn brick(level: u32, coords: [i64; 3]) -> Option<Key> {
    let range = 0..1 << level;
    coords.iter().all(|c| range.contains(c)).then(|| Key::cell(level, coords.map(|c| c as u32)).expect("in the world"))
}
