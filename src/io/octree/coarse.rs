//! Surface cells above the finest level, which simplified octrees may have: they are divided.
//!
//! A lattice point in or on such a cell gets its sign from the smallest cell that has it: from a cell of one sign or of the finest level as
//! it stands there, else by trilinear interpolation between the eight corners of the smallest large one. Interpolation on a face or
//! an edge depends on the corners there only, so that neighbours of one size agree. Where the surface runs exactly is not known any more.
//!
//! Cost: some 100 ns a finest cell, with at most [`MOST_CELLS`].

use super::decode::{Decoded, Divided, Source};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Corner, Key};
use crate::octree::crossings::lattice_point;
use ahash::RandomState;
use hashbrown::HashMap;

/// Finest cells that may come of dividing large ones: what is beyond is an attack, or a file for another depth.
pub(super) const MOST_CELLS: u64 = 1 << 21;

/// Where a brick lies, counted in bricks; those beyond the high sides of the root have points, too.
type At = [u32; 3];
type ByBrick<T> = HashMap<At, T, RandomState>;

fn by_brick<T>() -> ByBrick<T> {
    HashMap::with_hasher(RandomState::with_seeds(1, 2, 3, 4))
}

/// The points of a brick that lie in or on large cells.
#[derive(Clone, Copy)]
struct Known {
    there: Plane,
    inside: Plane,
}

impl Known {
    fn say(&mut self, points: Plane, is_inside: bool) {
        self.inside &= !points;
        if is_inside {
            self.inside |= points;
        }
    }
}

/// The brick of a lattice point, and the point in it.
fn place(p: [u32; 3]) -> (At, Local) {
    (p.map(|c| c >> 3), Local::new(p[0], p[1], p[2]))
}

impl Decoded {
    /// Divides the large surface cells. A lattice point at which one of them contradicts a smaller cell, if there is any.
    pub(super) fn divide(&mut self) -> Option<[u32; 3]> {
        let mut leaves = std::mem::take(&mut self.coarse);
        if leaves.is_empty() {
            return None;
        }
        // Smaller ones come later, and have the last word.
        leaves.sort_by_key(|(cell, _)| cell.level());
        let mut points: ByBrick<Known> = by_brick();
        let mut bricks: ByBrick<Plane> = by_brick();
        for &(cell, inside) in &leaves {
            let (at, side) = self.extent(cell);
            for step in steps(side + 1) {
                let (brick, local) = place(std::array::from_fn(|a| at[a] + step[a]));
                let known = points.entry(brick).or_insert(Known { there: Plane::EMPTY, inside: Plane::EMPTY });
                known.there.set(local);
                let mut point = Plane::EMPTY;
                point.set(local);
                known.say(point, interpolated(inside, side, step));
            }
            for step in steps(side) {
                let (brick, local) = place(std::array::from_fn(|a| at[a] + step[a]));
                bricks.entry(brick).or_insert(Plane::EMPTY).set(local);
            }
        }
        self.correct(&mut points, &bricks);
        let is_inside = |p: [u32; 3]| {
            let (brick, local) = place(p);
            points[&brick].inside.get(local)
        };
        for &(cell, inside) in &leaves {
            let (at, side) = self.extent(cell);
            for corner in Corner::ALL {
                let p = Axis::ALL.map(|a| at[a.index()] + side * u32::from(corner.is_high(a)));
                if is_inside(p) != (inside >> corner.index() & 1 == 1) {
                    return Some(p);
                }
            }
        }
        let mut sources: Vec<(Divided, Source)> = Vec::with_capacity(self.bricks.len() + bricks.len());
        for (i, mut brick) in (0..).zip(std::mem::take(&mut self.bricks)) {
            let at = lattice_point(self.depth, brick.key).map(|c| c >> 3);
            let source = match bricks.remove(&at) {
                Some(cells) => {
                    set_corners(&mut brick, at, &cells, is_inside);
                    Source::Unknown
                }
                None => Source::File(i),
            };
            sources.push((brick, source));
        }
        for (at, cells) in bricks {
            let key = Key::cell(self.depth - 3, at).expect("cells lie in the root");
            let mut brick = Divided { key, corners: [Plane::EMPTY; 8] };
            set_corners(&mut brick, at, &cells, is_inside);
            sources.push((brick, Source::Unknown));
        }
        sources.sort_unstable_by_key(|(brick, _)| brick.key);
        let sources: (Vec<Divided>, Vec<Source>) = sources.into_iter().unzip();
        (self.bricks, self.sources) = (sources.0, Some(sources.1));
        None
    }

    /// Where a cell starts and how wide it is, in finest cells.
    fn extent(&self, cell: Key) -> ([u32; 3], u32) {
        (lattice_point(self.depth, cell), 1 << (self.depth - cell.level().expect("cells have levels")))
    }

    /// Gives points the signs that cells of the finest level and of one sign have there. `bricks` are the cells of large leaves.
    fn correct(&self, points: &mut ByBrick<Known>, bricks: &ByBrick<Plane>) {
        for brick in &self.bricks {
            let at = lattice_point(self.depth, brick.key).map(|c| c >> 3);
            let beyond = |corner: Corner| Axis::ALL.map(|a| at[a.index()] + u32::from(corner.is_high(a)));
            if !Corner::ALL.into_iter().any(|corner| points.contains_key(&beyond(corner))) {
                continue;
            }
            let others = !bricks.get(&at).copied().unwrap_or(Plane::EMPTY);
            for (cell, corner) in others.iter().flat_map(|cell| Corner::ALL.map(|corner| (cell, corner))) {
                let c = cell.coords();
                let p = Axis::ALL.map(|a| 8 * at[a.index()] + c[a.index()] + u32::from(corner.is_high(a)));
                let (home, local) = place(p);
                if let Some(known) = points.get_mut(&home).filter(|known| known.there.get(local)) {
                    let mut point = Plane::EMPTY;
                    point.set(local);
                    known.say(point, brick.corners[corner.index()].get(cell));
                }
            }
        }
        for (at, known) in points {
            for back in Corner::ALL {
                let brick = Axis::ALL.map(|a| at[a.index()].wrapping_sub(u32::from(back.is_high(a))));
                let key = Key::cell(self.depth - 3, brick);
                let Some(is_inside) = key.and_then(|key| self.uniform_around(key)) else { continue };
                let layers = Axis::ALL.into_iter().filter(|&a| back.is_high(a));
                let side = layers.fold(Plane::FULL, |side, a| side & Plane::from_low_layer(a, !0));
                known.say(side & known.there, is_inside);
            }
        }
    }
}

/// All positions in a cube.
fn steps(side: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..side).flat_map(move |x| (0..side).flat_map(move |y| (0..side).map(move |z| [x, y, z])))
}

/// Whether a point of a cell is inside, so many steps from its least corner.
fn interpolated(inside: u8, side: u32, step: [u32; 3]) -> bool {
    let weight = |corner: Corner| -> u64 {
        Axis::ALL
            .map(|a| u64::from(if corner.is_high(a) { step[a.index()] } else { side - step[a.index()] }))
            .iter()
            .product()
    };
    let within = Corner::ALL.into_iter().filter(|corner| inside >> corner.index() & 1 == 1).map(weight).sum::<u64>();
    2 * within > u64::from(side).pow(3)
}

/// Gives some cells of a brick the signs of their corners.
fn set_corners(brick: &mut Divided, at: At, cells: &Plane, is_inside: impl Fn([u32; 3]) -> bool) {
    for (corner, plane) in Corner::ALL.into_iter().zip(&mut brick.corners) {
        *plane &= !*cells;
        for cell in cells.iter() {
            let c = cell.coords();
            if is_inside(Axis::ALL.map(|a| 8 * at[a.index()] + c[a.index()] + u32::from(corner.is_high(a)))) {
                plane.set(cell);
            }
        }
    }
}
