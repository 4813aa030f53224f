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
//! How far the corners are moved is worked out once for all sections: a byte a cell.
//!
//! Cost: some 300 instructions an edge of the section beside its flow, and for all sections together 72 bytes a brick and 512 more for each
//! that the surface comes through.

use super::complex::{Brick, Complex, DEEP, NOTHING, Side, Spot};
use super::flow::Flow;
use crate::grid::brick::{Bits, Local, Plane};
use crate::grid::{Axis, Edge, Extent, Face};
use crate::octree::EditedOctree;
use crate::octree::cells::transposed;
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
pub(super) const SIGN_BYTES: usize = size_of::<Plane>() + size_of::<Option<Box<Moves>>>() + size_of::<Moves>();

/// For each cell of a brick, how far the corner in it is moved: the place of that in a list that begins with not at all.
type Moves = [u8; 512];

/// What a complex was before it was thinned, by brick, in the complex's own coordinates.
pub(super) struct Signs {
    /// The signs of the points of the grid.
    inside: Vec<Plane>,
    /// None if no corner is moved.
    moves: Vec<Option<Box<Moves>>>,
    list: Vec<[f64; 3]>,
}

impl Signs {
    /// Cost: two hash probes a brick, and some 11,000 instructions if the surface comes through, in parallel.
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
        let inside = complex.bricks.par_iter().map(of).collect();
        let mut signs = Signs { inside, moves: Vec::new(), list: Vec::new() };
        let bricks = 0..complex.bricks.len() as u32;
        (signs.moves, signs.list) = match complex.side() {
            Side::Object => (
                bricks.into_par_iter().map(|brick| cut_cells(octree, complex, brick)).collect(),
                (0..=255).map(to_surface).collect(),
            ),
            Side::Background => (
                bricks.into_par_iter().map(|brick| signs.toward_outside(complex, brick)).collect(),
                (0..27).map(|code| [code / 9, code / 3 % 3, code % 3].map(|half| HALVES[half])).collect(),
            ),
        };
        signs
    }

    /// Around the solid: for each point that does not belong to what is outside, half a step along each axis on which only one side is outside.
    fn toward_outside(&self, complex: &Complex, brick: u32) -> Option<Box<Moves>> {
        let missing = !cells_before(complex, brick);
        if missing.is_empty() {
            return None;
        }
        let outside = |brick: u32| if brick < DEEP { !self.inside[brick as usize] } else { Plane::FULL };
        let own = outside(brick);
        let beside = |axis, high| outside(complex.beside(brick, Face::new(axis, high)));
        let low = Axis::ALL.map(|axis| own.at_minus(axis, &beside(axis, false)));
        let high = Axis::ALL.map(|axis| own.at_plus(axis, &beside(axis, true)));
        let near = low.iter().chain(&high).fold(Plane::EMPTY, |near, plane| near | *plane);
        let mut moves = Box::new([0; 512]);
        (missing & near).iter().for_each(|cell| {
            let half = |a: usize| match (low[a].get(cell), high[a].get(cell)) {
                (false, true) => 1,
                (true, false) => 2,
                _ => 0,
            };
            moves[cell.index() as usize] = 9 * half(0) + 3 * half(1) + half(2);
        });
        (missing & !near).iter().for_each(|cell| moves[cell.index() as usize] = DIAGONAL);
        Some(moves)
    }

    /// How far the corner in a cell of the complex's coordinates is moved.
    #[inline]
    fn moved(&self, complex: &Complex, (brick, cell): (u32, Local)) -> [f64; 3] {
        match self.code(brick, cell) {
            DIAGONAL if complex.side() == Side::Background => self.on_diagonal(complex, brick, cell),
            code => self.list[usize::from(code)],
        }
    }

    /// 0 if the corner in a cell is not moved.
    #[inline]
    fn code(&self, brick: u32, cell: Local) -> u8 {
        self.moves[brick as usize].as_ref().map_or(0, |moves| moves[cell.index() as usize])
    }

    /// Half a step from a point of which no neighbour along an axis is outside, toward those that are outside and differ from it along two axes,
    /// or along all three.
    fn on_diagonal(&self, complex: &Complex, brick: u32, point: Local) -> [f64; 3] {
        let mut outside = 0;
        for (i, steps) in (0..9).map(|i| (i, [i / 3 - 1, i % 3 - 1])) {
            outside |= (!self.line(complex, brick, point, steps) & 7) << (3 * i);
        }
        let nearest = BY_REACH.into_iter().map(|reach| outside & reach).find(|found| *found != 0);
        let mut sum = [0.0; 3];
        for i in Bits(nearest.unwrap_or(0)) {
            let steps = [i / 9, i / 3 % 3, i % 3];
            (0..3).for_each(|a| sum[a] += f64::from(steps[a]) - 1.0);
        }
        sum.map(|sum: f64| sum.clamp(-0.5, 0.5))
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

    /// The signs of three points in a row along z, as bits: the one so many steps along x and y from a place, the one before it and the one
    /// after it.
    #[inline]
    fn line(&self, complex: &Complex, brick: u32, local: Local, [dx, dy]: [i32; 2]) -> u64 {
        let [x, y, z] = local.coords();
        let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
        let beyond = |brick: u32, axis, is_beyond, high| {
            if is_beyond && brick < DEEP { complex.beside(brick, Face::new(axis, high)) } else { brick }
        };
        let brick = beyond(beyond(brick, Axis::X, x > 7, dx > 0), Axis::Y, y > 7, dy > 0);
        let row = |brick: u32| match brick {
            DEEP if complex.side() == Side::Object => 0xff,
            NOTHING | DEEP => 0,
            _ => self.inside[brick as usize].0[(x & 7) as usize] >> (8 * (y & 7)) & 0xff,
        };
        match z {
            0 => row(brick) << 1 & 7 | row(beyond(brick, Axis::Z, true, false)) >> 7,
            7 => row(brick) >> 6 | row(beyond(brick, Axis::Z, true, true)) << 2 & 4,
            _ => row(brick) >> (z - 1) & 7,
        }
    }
}

/// Of the solid: the inside corners of each cell that does not belong to it.
fn cut_cells(octree: &EditedOctree, complex: &Complex, brick: u32) -> Option<Box<Moves>> {
    let i = octree.signed().crossings().find(complex.bricks[brick as usize].key)?;
    let corners = octree.signed().corners(i);
    let cells = cells_before(complex, brick);
    let mut moves = Box::new([0; 512]);
    for (row, codes) in moves.as_chunks_mut::<8>().0.iter_mut().enumerate() {
        let (x, shift) = (row >> 3, 8 * (row & 7));
        let missing = !(cells.0[x] >> shift) & 0xff;
        if missing != 0 {
            let rows = u64::from_le_bytes(corners.map(|plane| (plane.0[x] >> shift & missing) as u8));
            *codes = transposed(rows).to_le_bytes();
        }
    }
    Some(moves)
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
        // X, Y, Z are bits 4, 2, 1. All that depends on the axis alone is worked out by the compiler.
        match edge.extent.bits() {
            4 => self.square_across::<0>(edge),
            2 => self.square_across::<1>(edge),
            _ => self.square_across::<2>(edge),
        }
    }

    /// The same for an edge along axis `A`.
    #[inline]
    fn square_across<const A: usize>(&self, edge: Spot) -> [f64; 3] {
        let [u, v] = Axis::ALL[A].others();
        let back = |(brick, local): (u32, Local), axis| self.complex.step(brick, local, Face::new(axis, false));
        // The cells round the edge: high and low along u, and then the same low along v.
        let high = Some((edge.brick, edge.local));
        let low = back((edge.brick, edge.local), u);
        let cells = [high, low, high.and_then(|at| back(at, v)), low.and_then(|at| back(at, v))];
        let is_moved = |&(brick, cell): &(u32, Local)| self.signs.code(brick, cell) != 0;
        let mut square = [0.0; 3];
        if !cells.iter().flatten().any(is_moved) {
            square[A] = 1.0;
            return square;
        }
        let [hh, lh, hl, ll] = cells.map(|cell| cell.map_or([0.0; 3], |cell| self.signs.moved(self.complex, cell)));
        // Half the cross product of the diagonals, from (low, low) to (high, high) and from (high, low) to (low, high).
        let diagonal = |from: [f64; 3], to: [f64; 3], along_u: f64| {
            let mut diagonal: [f64; 3] = std::array::from_fn(|a| to[a] - from[a]);
            diagonal[u.index()] += along_u;
            diagonal[v.index()] += 1.0;
            diagonal
        };
        let (p, q) = (diagonal(ll, hh, 1.0), diagonal(hl, lh, -1.0));
        std::array::from_fn(|a| {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            (p[b] * q[c] - p[c] * q[b]) / 2.0
        })
    }
}

/// The cells of a brick before anything was removed.
fn cells_before(complex: &Complex, brick: u32) -> Plane {
    let removed = complex.bricks[brick as usize].record.as_deref();
    complex.live(brick)[Extent::CELL.index()] | removed.map_or(Plane::EMPTY, |record| record.cells[0] | record.cells[1])
}

/// Stands for a move of which only the neighbours on diagonals tell.
const DIAGONAL: u8 = u8::MAX;

/// By how much points are moved along an axis.
const HALVES: [f64; 3] = [0.0, 0.5, -0.5];

/// The points round another one, as bits 9x + 3y + z of a number: those one step away along one axis, along two, along all three.
const BY_REACH: [u64; 3] = {
    let mut reaches = [0; 3];
    let mut i = 0;
    while i < 27 {
        let still = (i / 9 == 1) as usize + (i / 3 % 3 == 1) as usize + (i % 3 == 1) as usize;
        if still < 3 {
            reaches[2 - still] |= 1 << i;
        }
        i += 1;
    }
    reaches
};

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
