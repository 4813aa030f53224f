//! Solids that touch the side of their cube: the cube of the file becomes one of 64 in a cube four times as wide, with nothing around it.
//!
//! Lattice points on the high sides of the file's cube belong to bricks beyond, and cells beyond have corners on all sides of it: so up to
//! one layer of bricks is added all around, with the signs that the file gives to the points on its sides. There the solid ends, as if
//! the cube had cut it off.
//!
//! Cost: 27 look-ups for each brick of the file's cube that has points inside on its side.

use super::check::{corners_of, plane_of};
use super::decode::{Decoded, Divided, Source};
use crate::geom::frame::DEPTHS;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Corner, Direction, Face, Key};
use crate::octree::crossings::lattice_point;
use ahash::RandomState;
use hashbrown::HashMap;

/// Levels by which the root grows.
pub(super) const LEVELS: u32 = 2;

/// A cell of the file's cube, as a cell of the larger one.
pub(super) fn shifted(cell: Key) -> Key {
    let level = cell.level().expect("cells have levels");
    let at = cell.min_corner().map(|c| c / cell.size() + (1 << level));
    Key::cell(level + LEVELS, at).expect("the file's cube is in the middle")
}

/// Where a brick lies, counted in bricks.
type At = [u32; 3];

impl Decoded {
    /// The same in a cube four times as wide; `None` if that has too many levels.
    pub(super) fn padded(mut self) -> Option<Decoded> {
        let depth = self.depth + LEVELS;
        if depth > *DEPTHS.end() {
            return None;
        }
        let is_small = self.cells < 8;
        self.fill_up();
        let side = 1 << (self.depth - 3);
        let mut beyond =
            Beyond { side, points: HashMap::with_hasher(RandomState::with_seeds(1, 2, 3, 4)), bricks: Vec::new() };
        for brick in &self.bricks {
            beyond.add(lattice_point(self.depth, brick.key).map(|c| c >> 3), &brick.corners);
        }
        for &(cell, _) in self.uniform.iter().filter(|(_, is_inside)| *is_inside) {
            self.on_sides(cell, &mut |at| beyond.add(at, &[Plane::FULL; 8]));
        }
        beyond.bricks.sort_unstable();
        beyond.bricks.dedup();
        let own = |at: [i32; 3]| self.points(&beyond, at);
        let mut bricks: Vec<(Divided, Source)> = Vec::with_capacity(self.bricks.len() + beyond.bricks.len());
        for at in &beyond.bricks {
            let corners = corners_of(own(*at), |step| own(std::array::from_fn(|a| at[a] + step[a])));
            if corners != [Plane::EMPTY; 8] {
                let key = Key::cell(depth - 3, at.map(|c| (c + side as i32) as u32)).expect("beside the middle");
                bricks.push((Divided { key, corners }, Source::Beside));
            }
        }
        // Of small grids, the edges on the sides are in the same brick as those between: nothing is kept of those.
        let source = |i| if is_small { Source::Beside } else { Source::File(i) };
        let sources = match self.sources {
            Some(sources) if !is_small => sources,
            _ => (0..self.bricks.len() as u32).map(source).collect(),
        };
        let of_file = self.bricks.into_iter().zip(sources);
        bricks.extend(of_file.map(|(brick, source)| (Divided { key: shifted(brick.key), ..brick }, source)));
        bricks.sort_unstable_by_key(|(brick, _)| brick.key);
        let (bricks, sources) = bricks.into_iter().unzip();
        let uniform = self.uniform.into_iter().map(|(cell, is_inside)| (shifted(cell), is_inside)).collect();
        Some(Decoded { depth, cells: 1 << depth, bricks, uniform, coarse: Vec::new(), sources: Some(sources) })
    }

    /// Grids of fewer than 8 cells a side do not fill their brick: the points on their high sides are its own.
    fn fill_up(&mut self) {
        if self.cells >= 8 {
            return;
        }
        for brick in &mut self.bricks {
            let mut points = Plane::EMPTY;
            for corner in Corner::ALL {
                for cell in brick.corners[corner.index()].iter() {
                    let c = cell.coords();
                    let [x, y, z] = Axis::ALL.map(|a| c[a.index()] + u32::from(corner.is_high(a)));
                    points.set(Local::new(x, y, z));
                }
            }
            brick.corners = corners_of(points, |_| Plane::EMPTY);
        }
    }

    /// How many sides of bricks inside lie on the side of the cube, those of bricks with both signs not counted. Each becomes surface.
    pub(super) fn filled_sides(&self) -> u64 {
        let inside = self.uniform.iter().filter(|(_, is_inside)| *is_inside);
        let of_cell = |&(cell, _): &(Key, bool)| {
            let sides = Face::ALL.into_iter().filter(|&face| cell.neighbour(face).is_none()).count();
            (sides as u64) << (2 * (self.depth - 3 - cell.level().expect("cells have levels")))
        };
        inside.map(of_cell).sum()
    }

    /// The bricks of a cell of one sign that lie on the side of the cube, some of them several times.
    fn on_sides(&self, cell: Key, found: &mut dyn FnMut(At)) {
        let least = lattice_point(self.depth, cell).map(|c| c >> 3);
        let width = 1u32 << (self.depth - 3 - cell.level().expect("cells have levels"));
        let last = (1 << (self.depth - 3)) - 1;
        for axis in Axis::ALL {
            let [u, v] = axis.others().map(Axis::index);
            let ends = [(least[axis.index()], 0), (least[axis.index()] + width - 1, last)];
            for (at, _) in ends.into_iter().filter(|(at, end)| at == end) {
                for (i, j) in (0..width).flat_map(|i| (0..width).map(move |j| (i, j))) {
                    let mut brick = least;
                    brick[axis.index()] = at;
                    brick[u] += i;
                    brick[v] += j;
                    found(brick);
                }
            }
        }
    }

    /// The inside points of a brick, in the file's cube or beside it.
    fn points(&self, beyond: &Beyond, at: [i32; 3]) -> Plane {
        let key = || Key::cell(self.depth - 3, at.map(|c| c as u32));
        let Some(key) = at.iter().all(|&c| c >= 0).then(key).flatten() else {
            return beyond.points.get(&at).copied().unwrap_or(Plane::EMPTY);
        };
        match self.bricks.binary_search_by_key(&key, |brick| brick.key) {
            Ok(i) => self.bricks[i].corners[0],
            Err(_) => plane_of(self.is_uniformly_inside(key)),
        }
    }
}

/// What lies beside the file's cube, in bricks counted from its least corner.
struct Beyond {
    /// Bricks a side of the file's cube.
    side: u32,
    /// Points inside on the high sides of the file's cube.
    points: HashMap<[i32; 3], Plane, RandomState>,
    /// Bricks that may have a corner inside.
    bricks: Vec<[i32; 3]>,
}

impl Beyond {
    /// Notes what a brick of the file, with the cells of which a corner is inside, means for those beside the cube.
    fn add(&mut self, at: At, corners: &[Plane; 8]) {
        let is_outside = |at: &[i32; 3]| at.iter().any(|&c| c < 0 || c >= self.side as i32);
        let at = at.map(|c| c as i32);
        let around =
            Direction::ALL.into_iter().map(|d| std::array::from_fn(|a| at[a] + d.steps()[a])).filter(is_outside);
        self.bricks.extend(around);
        for high in &Corner::ALL[1..] {
            let beyond: [i32; 3] = Axis::ALL.map(|a| at[a.index()] + i32::from(high.is_high(a)));
            // Along all of these axes it must lie beyond the cube: otherwise the points are those of a brick in it.
            if Axis::ALL.into_iter().any(|a| high.is_high(a) && beyond[a.index()] < self.side as i32) {
                continue;
            }
            let mut points = Plane::EMPTY;
            for cell in corners[high.index()].iter() {
                let c = cell.coords();
                if Axis::ALL.into_iter().all(|a| !high.is_high(a) || c[a.index()] == 7) {
                    let [x, y, z] = Axis::ALL.map(|a| if high.is_high(a) { 0 } else { c[a.index()] });
                    points.set(Local::new(x, y, z));
                }
            }
            if !points.is_empty() {
                *self.points.entry(beyond).or_insert(Plane::EMPTY) |= points;
            }
        }
    }
}
