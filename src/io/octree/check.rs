//! Whether all cells agree on every lattice point, and nothing inside touches the side of the cube.
//!
//! Files may say anything of a point as often as it is a corner: up to eight times. A lie would be a surface that is not closed, or one
//! between cells of which the file says that they have none. So every corner is compared with the sign that the point's own brick gives
//! it: within bricks and toward larger coordinates plane by plane, in the other directions with neighbours of one sign only (those that
//! are divided compare themselves). Larger cells of one sign are compared with their neighbours of at least their size. Neighbours across
//! faces are enough in the last two cases: around a point or an edge, each cell has a face in common with the next.
//!
//! Cost: ten binary searches a brick, six a cell, in parallel.

use super::decode::{Decoded, Divided};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Corner, Direction, Key};
use crate::octree::crossings::{lattice_point, toward};
use rayon::prelude::*;

/// What is wrong with the signs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Disagreement {
    /// The cells around a lattice point disagree whether it is inside.
    Around([u32; 3]),
    /// A lattice point on the side of the cube is inside.
    OnSide([u32; 3]),
}

/// What is known of the points of a brick.
enum Signs<'a> {
    Divided(&'a Divided),
    Uniform(bool),
    /// Beyond the side of the cube.
    Beyond,
}

impl Decoded {
    /// Whether a brick of one sign is inside.
    pub(super) fn is_uniformly_inside(&self, brick: Key) -> bool {
        self.uniform_around(brick).unwrap_or(false)
    }

    /// The first disagreement among divided bricks, else among cells of one sign.
    pub(super) fn disagreement(&self) -> Option<Disagreement> {
        let of_brick = |brick| self.within(brick).or_else(|| self.around(brick));
        let found = self.bricks.par_iter().find_map_first(of_brick);
        found.or_else(|| {
            self.uniform.par_iter().find_map_first(|&(cell, is_inside)| self.around_uniform(cell, is_inside))
        })
    }

    fn signs(&self, brick: Option<Key>) -> Signs<'_> {
        let Some(key) = brick else { return Signs::Beyond };
        if let Ok(i) = self.bricks.binary_search_by_key(&key, |brick| brick.key) {
            return Signs::Divided(&self.bricks[i]);
        }
        // What the file does not cover is outside.
        Signs::Uniform(self.uniform_around(key).unwrap_or(false))
    }

    /// The sign of the cell of one sign that is or holds `cell`.
    pub(super) fn uniform_around(&self, cell: Key) -> Option<bool> {
        // Cells of an octree are in order; one that holds `cell` may come just before or just after it.
        let i = self.uniform.partition_point(|&(key, _)| key < cell);
        let near = self.uniform[i.saturating_sub(1)..].iter().take(2);
        near.copied().find_map(|(key, is_inside)| key.contains(cell).then_some(is_inside))
    }

    /// Compares all corners of the cells of a brick with the points' own signs.
    fn within(&self, brick: &Divided) -> Option<Disagreement> {
        let own = |steps| match self.signs(brick.key.toward(toward(steps))) {
            Signs::Divided(divided) => divided.corners[0],
            Signs::Uniform(is_inside) => plane_of(is_inside),
            Signs::Beyond => Plane::EMPTY,
        };
        let expected = corners_of(brick.corners[0], own);
        let differs = |corner: Corner| (brick.corners[corner.index()] ^ expected[corner.index()]).iter().next();
        let (corner, cell) = Corner::ALL.into_iter().find_map(|corner| Some((corner, differs(corner)?)))?;
        Some(self.at(brick.key, cell, corner))
    }

    /// Compares the corners on the low sides of a brick with neighbours of one sign.
    fn around(&self, brick: &Divided) -> Option<Disagreement> {
        for direction in across_faces().filter(|d| d.steps().contains(&-1)) {
            let expected = match self.signs(brick.key.toward(direction)) {
                Signs::Divided(_) => continue,
                Signs::Uniform(is_inside) => plane_of(is_inside),
                Signs::Beyond => Plane::EMPTY,
            };
            let steps = direction.steps();
            let is_there = |corner: &Corner| {
                Axis::ALL.iter().all(|&a| steps[a.index()] == 0 || corner.is_high(a) == (steps[a.index()] > 0))
            };
            let side = side(steps);
            let differs = |corner: Corner| ((brick.corners[corner.index()] ^ expected) & side).iter().next();
            let mut corners = Corner::ALL.into_iter().filter(is_there);
            if let Some((corner, cell)) = corners.find_map(|corner| Some((corner, differs(corner)?))) {
                return Some(self.at(brick.key, cell, corner));
            }
        }
        None
    }

    fn around_uniform(&self, cell: Key, is_inside: bool) -> Option<Disagreement> {
        let scale = |point: Key| lattice_point(self.depth, point);
        let differs = |direction: &Direction| match cell.toward(*direction) {
            None => is_inside,
            Some(beyond) => self.uniform_around(beyond).is_some_and(|other| other != is_inside),
        };
        let direction = across_faces().find(differs)?;
        let point = scale(cell.corner(direction.corner()));
        Some(if cell.toward(direction).is_none() { Disagreement::OnSide(point) } else { Disagreement::Around(point) })
    }

    /// The disagreement at a corner of a cell of a brick.
    fn at(&self, brick: Key, cell: Local, corner: Corner) -> Disagreement {
        let (origin, cell) = (lattice_point(self.depth, brick), cell.coords());
        let point = Axis::ALL.map(|a| origin[a.index()] + cell[a.index()] + u32::from(corner.is_high(a)));
        if point.iter().any(|&c| c == 0 || c == self.cells) {
            Disagreement::OnSide(point)
        } else {
            Disagreement::Around(point)
        }
    }
}

/// For each corner, the cells of a brick whose corner is inside, from its own points and those of the bricks some steps on.
pub(super) fn corners_of(c0: Plane, own: impl Fn([i32; 3]) -> Plane) -> [Plane; 8] {
    let [z, y, x] = [[0, 0, 1], [0, 1, 0], [1, 0, 0]].map(&own);
    let [yz, xz, xy, xyz] = [[0, 1, 1], [1, 0, 1], [1, 1, 0], [1, 1, 1]].map(&own);
    // At +z first, and then the others of what is there.
    let (c1, y1) = (c0.at_plus_z(&z), y.at_plus_z(&yz));
    let (x1, xy1) = (x.at_plus_z(&xz), xy.at_plus_z(&xyz));
    [
        c0,
        c1,
        c0.at_plus_y(&y),
        c1.at_plus_y(&y1),
        c0.at_plus_x(&x),
        c1.at_plus_x(&x1),
        c0.at_plus_y(&y).at_plus_x(&x.at_plus_y(&xy)),
        c1.at_plus_y(&y1).at_plus_x(&x1.at_plus_y(&xy1)),
    ]
}

fn across_faces() -> impl Iterator<Item = Direction> {
    Direction::ALL.into_iter().filter(|direction| direction.moves().dimension() == 1)
}

pub(super) fn plane_of(is_inside: bool) -> Plane {
    if is_inside { Plane::FULL } else { Plane::EMPTY }
}

/// The cells of a brick on its side (edge, corner) in a direction.
fn side([x, y, z]: [i32; 3]) -> Plane {
    let layer = |step: i32| match step {
        0 => 0xff,
        -1 => 1,
        _ => 0x80u64,
    };
    let (rows, columns) = (layer(y), layer(z));
    let square = (0..8).filter(|i| rows >> i & 1 == 1).fold(0, |square, i| square | columns << (8 * i));
    Plane(std::array::from_fn(|i| if layer(x) >> i & 1 == 1 { square } else { 0 }))
}
