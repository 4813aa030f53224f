//! Cross-sections: what flowed into an edge of the skeleton while the complex was thinned.
//!
//! The edges that flowed into an edge of the skeleton ([`Flow`]) are the cross-section of the handle there, a surface made of one square for
//! each edge, across its middle. With the signs of their cocycle, it has no boundary but on the boundary of the solid, so that the sum of its
//! oriented unit squares, its VECTOR AREA, depends on that curve alone: staircases do not count, whichever way the handle runs.
//!
//! The corners of the squares are cells (of the dual, for a background). Where such a cell does not belong to the complex, the rim of the
//! section is there, and the corner is moved onto the surface of the solid as the signs have it: in a cell of the grid to the mean of the
//! middles of its crossed edges, from a point of the grid half a step toward the outside. Otherwise slanted sections, whose rim
//! runs through notches, would seem smaller than straight ones, and membranes would count what is inside the solid.
//!
//! Cost: some 20 ns an edge of the section beside its flow, and 128 bytes a brick for all sections together.

use super::complex::{Brick, Complex, DEEP, NOTHING, Side, Spot};
use super::flow::Flow;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Corner, Direction, Edge, Extent, Face};
use crate::octree::EditedOctree;
use rayon::prelude::*;

/// The cross-section at an edge of the skeleton.
#[derive(Debug, Clone)]
pub(super) struct Section {
    /// Length of the vector area, in squares of cells.
    pub(super) area: f64,
    /// Number of squares.
    pub(super) squares: u64,
}

impl Section {
    /// What is too wide to be looked at.
    const WIDE: Section = Section { area: f64::INFINITY, squares: u64::MAX };

    /// Whether nothing is known but that it is too wide.
    pub(super) fn is_wide(&self) -> bool {
        self.area.is_infinite()
    }
}

/// Takes sections of one complex; reuses its memory.
pub(super) struct Sections<'a> {
    rim: Rim<'a>,
    flow: Flow,
    limit: f64,
    /// Edges that a flow may have.
    most: usize,
}

impl<'a> Sections<'a> {
    /// `signs` are those of the complex.
    pub(super) fn new(complex: &'a Complex, signs: &'a Signs) -> Self {
        Sections { rim: Rim { signs, complex }, flow: Flow::default(), limit: f64::INFINITY, most: usize::MAX }
    }

    /// Sections of some times the `limit` (in squares of cells) are not followed to their end from now on, and count as infinitely wide.
    #[must_use]
    pub(super) fn up_to(self, limit: f64) -> Self {
        // From infinity on, casts saturate.
        let most = (WIDEST * limit) as usize;
        Sections { limit, most: most.saturating_add(FOLDS), ..self }
    }

    /// The area up to which all sections are taken.
    pub(super) fn limit(&self) -> f64 {
        self.limit
    }

    /// The section through an edge that no face is left at.
    pub(super) fn at(&mut self, edge: Spot) -> Section {
        if !self.flow.follow(self.rim.complex, edge, self.most) {
            return Section::WIDE;
        }
        let mut vector = [0.0; 3];
        let mut squares = 0;
        for (spot, phi) in self.flow.support() {
            let square = self.rim.square(spot);
            (0..3).for_each(|a| vector[a] += phi as f64 * square[a]);
            squares += 1;
        }
        Section { area: vector.iter().map(|c| c * c).sum::<f64>().sqrt(), squares }
    }

    /// Mean of the centres of the squares of the section through an edge, in lattice units. The section is not too wide.
    pub(super) fn centre(&mut self, edge: Spot) -> [f64; 3] {
        let complex = self.rim.complex;
        self.flow.follow(complex, edge, self.most);
        let (mut sum, mut squares) = ([0.0; 3], 0.0);
        for (spot, _) in self.flow.support() {
            let at = complex.coordinates(spot);
            (0..3).for_each(|a| sum[a] += at[a]);
            squares += 1.0;
        }
        sum.map(|c| c / squares)
    }

    /// A guess at the area of the section, in no time: the two shorter ones of the three lines along the axes through the start of an
    /// edge, as far as they stay on the complex's side.
    pub(super) fn guess(&self, edge: Spot) -> u32 {
        let length = |axis| {
            [false, true]
                .map(|high| self.rim.signs.run(self.rim.complex, edge, Face::new(axis, high)))
                .iter()
                .sum::<u32>()
        };
        let mut lengths = Axis::ALL.map(|axis| length(axis) + 1);
        lengths.sort_unstable();
        lengths[0] * lengths[1]
    }
}

/// By how much the squares of a section may outnumber its vector area. Staircases make that at most the root of 3; the rest is for folds.
const WIDEST: f64 = 16.0;

/// And by how much at least: noise has small sections with many folds.
const FOLDS: usize = 256;

/// The length from which on lines are all the same, in cells.
const FAR: u32 = 64;

/// Bytes of [`Signs`] for each brick.
pub(super) const SIGN_BYTES: usize = 2 * size_of::<Plane>();

/// What a complex was before it was thinned, by brick, in the complex's own coordinates.
pub(super) struct Signs {
    /// The signs of the points of the grid.
    inside: Vec<Plane>,
    cells: Vec<Plane>,
    /// How far the corner in a cell is moved, by the signs of its corners.
    moves: Vec<[f64; 3]>,
}

impl Signs {
    /// Cost: a hash probe a brick, in parallel.
    pub(super) fn new(octree: &EditedOctree, complex: &Complex) -> Signs {
        let signed = octree.signed();
        let of = |brick: &Brick| {
            let plane = match signed.crossings().find(brick.key) {
                Some(i) => signed.inside()[i],
                None if octree.is_uniformly_inside(brick.key) => Plane::FULL,
                None => Plane::EMPTY,
            };
            if complex.side() == Side::Object { plane } else { plane.turned_over() }
        };
        let cells = |brick: &Brick| {
            let removed = brick.record.as_deref().map_or(Plane::EMPTY, |record| record.cells[0] | record.cells[1]);
            removed | brick.live.as_deref().map_or(Plane::EMPTY, |live| live[Extent::CELL.index()])
        };
        Signs {
            inside: complex.bricks.par_iter().map(of).collect(),
            cells: complex.bricks.par_iter().map(cells).collect(),
            moves: (0..=255).map(to_surface).collect(),
        }
    }

    /// How many steps it is from the start of a spot to the last point on the complex's side in one direction; not more than [`FAR`].
    fn run(&self, complex: &Complex, spot: Spot, toward: Face) -> u32 {
        let mut steps = 0;
        let axis = toward.axis();
        let mut brick = spot.brick;
        let mut at = spot.local.coords();
        while steps < FAR {
            let c = &mut at[axis.index()];
            let next = if toward.is_high() { *c + 1 } else { c.wrapping_sub(1) };
            if next > 7 {
                brick = complex.beside(brick, toward);
                if brick >= DEEP {
                    return if brick == NOTHING && complex.side() == Side::Object { steps } else { FAR };
                }
            }
            *c = next & 7;
            let inside = self.inside[brick as usize].get(Local::new(at[0], at[1], at[2]));
            if inside != (complex.side() == Side::Object) {
                break;
            }
            steps += 1;
        }
        steps
    }

    /// The signs of the corners of a cell, as the bits of a number.
    fn corners(&self, complex: &Complex, cell: Spot) -> usize {
        let [x, y, z] = cell.local.coords();
        if x < 7 && y < 7 && z < 7 {
            let plane = &self.inside[cell.brick as usize].0;
            let half = |x: u32| {
                let square = plane[x as usize] >> (8 * y + z);
                ((square & 0b11) | (square >> 6 & 0b1100)) as usize
            };
            return half(x) | half(x + 1) << 4;
        }
        let sign = |corner: Corner| {
            self.at(complex, cell.brick, cell.local, Axis::ALL.map(|axis| i32::from(corner.is_high(axis))))
        };
        Corner::ALL.into_iter().map(|corner| usize::from(sign(corner)) << corner.index()).sum()
    }

    /// The sign of a point, some steps of -1, 0 or 1 from the start of a brick's position.
    #[inline]
    fn at(&self, complex: &Complex, mut brick: u32, local: Local, steps: [i32; 3]) -> bool {
        let mut at = local.coords();
        if at.iter().all(|c| (1..7).contains(c)) {
            let index = local.index() as i32 + 64 * steps[0] + 8 * steps[1] + steps[2];
            return self.inside[brick as usize].get(Local::from_index(index as u32));
        }
        for (axis, step) in Axis::ALL.into_iter().zip(steps) {
            let moved = at[axis.index()] as i32 + step;
            if !(0..8).contains(&moved) {
                brick = match complex.beside(brick, Face::new(axis, step > 0)) {
                    NOTHING => return false,
                    DEEP => return complex.side() == Side::Object,
                    next => next,
                };
            }
            at[axis.index()] = (moved & 7) as u32;
        }
        self.inside[brick as usize].get(Local::new(at[0], at[1], at[2]))
    }
}

/// The corners of squares, at the rim moved onto the surface.
struct Rim<'a> {
    signs: &'a Signs,
    complex: &'a Complex,
}

impl Rim<'_> {
    /// The vector area of the square across an edge.
    #[inline]
    fn square(&self, edge: Spot) -> [f64; 3] {
        let axis = edge.extent.axes().next().expect("an edge has an axis");
        let [u, v] = axis.others();
        let (index, [u_step, v_step]) = (edge.local.index(), [u, v].map(|axis| 1 << (6 - 3 * axis.index())));
        if index & (7 * u_step) != 0 && index & (7 * v_step) != 0 {
            let cells = &self.signs.cells[edge.brick as usize];
            let corners = [index, index - u_step, index - v_step, index - u_step - v_step];
            if corners.into_iter().all(|corner| cells.get(Local::from_index(corner))) {
                return std::array::from_fn(|a| if a == axis.index() { 1.0 } else { 0.0 });
            }
        }
        self.moved_square(edge)
    }

    /// The vector area of a square whose corners may have been moved.
    fn moved_square(&self, edge: Spot) -> [f64; 3] {
        let axis = edge.extent.axes().next().expect("an edge has an axis");
        let [u, v] = axis.others();
        // Half the cross product of the diagonals, from (low, low) to (high, high) and from (high, low) to (low, high).
        let mut diagonals = [[0.0; 3]; 2];
        for (second, sign, high_u, high_v) in
            [(0, 1.0, true, true), (0, -1.0, false, false), (1, 1.0, false, true), (1, -1.0, true, false)]
        {
            let diagonal = &mut diagonals[second];
            diagonal[u.index()] += sign * if high_u { 0.5 } else { -0.5 };
            diagonal[v.index()] += sign * if high_v { 0.5 } else { -0.5 };
            let face = self.complex.half_toward(edge, Face::new(u, high_u));
            if let Some(cell) = face.and_then(|face| self.complex.half_toward(face, Face::new(v, high_v))) {
                let moved = self.moved(cell);
                (0..3).for_each(|a| diagonal[a] += sign * moved[a]);
            }
        }
        let [p, q] = diagonals;
        std::array::from_fn(|a| {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            (p[b] * q[c] - p[c] * q[b]) / 2.0
        })
    }

    /// How far the corner in a cell of the complex's coordinates is moved.
    fn moved(&self, cell: Spot) -> [f64; 3] {
        let complex = self.complex;
        if self.signs.cells[cell.brick as usize].get(cell.local) {
            return [0.0; 3];
        }
        match complex.side() {
            Side::Object => self.signs.moves[self.signs.corners(complex, cell)],
            Side::Background => {
                // Half a step along each axis on which only one side is outside; where none is, on a diagonal.
                let mut sum = [0.0; 3];
                for reach in 1..=3 {
                    let mut any = false;
                    for direction in Direction::ALL.iter().filter(|d| d.moves().dimension() == reach) {
                        if !self.signs.at(complex, cell.brick, cell.local, direction.steps()) {
                            any = true;
                            (0..3).for_each(|a| sum[a] += f64::from(direction.steps()[a]));
                        }
                    }
                    if any {
                        break;
                    }
                }
                sum.map(|sum: f64| sum.clamp(-0.5, 0.5))
            }
        }
    }
}

/// From the centre of a cell of the grid to the mean of the middles of its crossed edges; the inside corners are the bits of `code`.
fn to_surface(code: u32) -> [f64; 3] {
    let (mut sum, mut crossed) = ([0.0; 3], 0u32);
    for edge in Edge::ALL {
        let [from, to] = edge.corners();
        if (code >> from.index() ^ code >> to.index()) & 1 == 1 {
            crossed += 1;
            for axis in Axis::ALL.into_iter().filter(|&axis| axis != edge.axis()) {
                sum[axis.index()] += if from.is_high(axis) { 0.5 } else { -0.5 };
            }
        }
    }
    sum.map(|sum: f64| sum / f64::from(crossed.max(1)))
}
