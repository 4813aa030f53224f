//! Cross-sections: what flowed into an edge of the skeleton while the complex was thinned.
//!
//! Every face f that was removed with an edge e' hands e' on to the other edges of f. Followed back from a skeleton edge e, these pairs give
//! all edges that flowed into e: the cross-section of the handle there, a surface made of one square for each edge, across its
//! middle. With signs, it is a cocycle: a function phi on edges with phi(e) = 1 that sums to zero round every face of the
//! solid (only the faces of the sheets and the core could object, and those do not touch what was removed). Hence
//!
//! - phi(e') = - [f : e'] * sum of [f : e''] phi(e'') over the other edges of f, in the order of the flow: every edge is reckoned once,
//!   however many ways lead from it to e, and ways that cancel do so;
//! - the surface has no boundary but on the boundary of the solid, so that the sum of its oriented unit squares, its VECTOR AREA,
//!   depends on that curve alone: staircases do not count, whichever way the handle runs.
//!
//! The corners of the squares are cells (of the dual, for a background). Where such a cell does not belong to the complex, the rim of the
//! section is there, and the corner is moved onto the surface of the solid as the signs have it: in a cell of the grid to the mean of the
//! middles of its crossed edges, from a point of the grid half a step toward the outside. Otherwise slanted sections, whose rim
//! runs through notches, would seem smaller than straight ones, and membranes would count what is inside the solid.
//!
//! Cost: some 200 ns an edge of the section.

use super::complex::{Brick, Complex, DEEP, NOTHING, Record, Side, Spot};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Corner, Direction, Edge, Extent, Face};
use crate::octree::EditedOctree;
use ahash::RandomState;
use hashbrown::HashMap;
use rayon::prelude::*;
use std::hash::BuildHasher;

/// The cross-section at an edge of the skeleton.
#[derive(Debug, Clone)]
pub(super) struct Section {
    /// Length of the vector area, in squares of cells.
    pub(super) area: f64,
    /// Number of squares.
    pub(super) squares: u64,
}

/// Takes sections of one complex; reuses its memory.
pub(super) struct Sections<'a> {
    rim: Rim<'a>,
    flow: Flow,
}

impl<'a> Sections<'a> {
    /// `signs` are those of the complex.
    pub(super) fn new(complex: &'a Complex, signs: &'a Signs) -> Self {
        Sections { rim: Rim { signs, complex }, flow: Flow::default() }
    }

    /// The section through an edge that no face is left at.
    pub(super) fn at(&mut self, edge: Spot) -> Section {
        let complex = self.rim.complex;
        self.flow.follow(complex, edge);
        let mut vector = [0.0; 3];
        let mut squares = 0;
        for (&spot, &phi) in self.flow.edges.iter().zip(&self.flow.phi).filter(|(_, phi)| **phi != 0) {
            let square = self.rim.square(spot);
            (0..3).for_each(|a| vector[a] += phi as f64 * square[a]);
            squares += 1;
        }
        Section { area: vector.iter().map(|c| c * c).sum::<f64>().sqrt(), squares }
    }

    /// Mean of the centres of the squares of the section through an edge, in lattice units.
    pub(super) fn centre(&mut self, edge: Spot) -> [f64; 3] {
        let complex = self.rim.complex;
        self.flow.follow(complex, edge);
        let (mut sum, mut squares) = ([0.0; 3], 0.0);
        for (&spot, _) in self.flow.edges.iter().zip(&self.flow.phi).filter(|(_, phi)| **phi != 0) {
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

/// The length from which on lines are all the same, in cells.
const FAR: u32 = 64;

/// The signs of a complex's points of the grid, by brick, in the complex's own coordinates.
pub(super) struct Signs(Vec<Plane>);

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
        Signs(complex.bricks.par_iter().map(of).collect())
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
            let inside = self.0[brick as usize].get(Local::new(at[0], at[1], at[2]));
            if inside != (complex.side() == Side::Object) {
                break;
            }
            steps += 1;
        }
        steps
    }

    /// The sign of a point, some steps of -1, 0 or 1 from the start of a brick's position.
    fn at(&self, complex: &Complex, mut brick: u32, local: Local, steps: [i32; 3]) -> bool {
        let mut at = local.coords();
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
        self.0[brick as usize].get(Local::new(at[0], at[1], at[2]))
    }
}

/// The corners of squares, at the rim moved onto the surface.
struct Rim<'a> {
    signs: &'a Signs,
    complex: &'a Complex,
}

impl Rim<'_> {
    /// The vector area of the square across an edge.
    fn square(&self, edge: Spot) -> [f64; 3] {
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
        let brick = &complex.bricks[cell.brick as usize];
        let is_removed = |record: &Record| (record.cells[0] | record.cells[1]).get(cell.local);
        if brick.record.as_deref().is_some_and(is_removed) || complex.get(cell) {
            return [0.0; 3];
        }
        let sign = |steps| self.signs.at(complex, cell.brick, cell.local, steps);
        let (mut sum, mut crossed) = ([0.0; 3], 0u32);
        match complex.side() {
            Side::Object => {
                let corners = Corner::ALL.map(|corner| sign(Axis::ALL.map(|axis| i32::from(corner.is_high(axis)))));
                for edge in Edge::ALL {
                    let [from, to] = edge.corners();
                    if corners[from.index()] != corners[to.index()] {
                        crossed += 1;
                        for axis in Axis::ALL.into_iter().filter(|&axis| axis != edge.axis()) {
                            sum[axis.index()] += if from.is_high(axis) { 0.5 } else { -0.5 };
                        }
                    }
                }
            }
            Side::Background => {
                // Half a step along each axis on which only one side is outside; where none is, on a diagonal.
                crossed = 1;
                for reach in 1..=3 {
                    let mut any = false;
                    for direction in Direction::ALL.iter().filter(|d| d.moves().dimension() == reach) {
                        if !sign(direction.steps()) {
                            any = true;
                            (0..3).for_each(|a| sum[a] += f64::from(direction.steps()[a]));
                        }
                    }
                    if any {
                        break;
                    }
                }
                sum = sum.map(|sum: f64| sum.clamp(-0.5, 0.5));
            }
        }
        sum.map(|sum| sum / f64::from(crossed.max(1)))
    }
}

/// The edges that flowed into one, and how.
#[derive(Default)]
struct Flow {
    edges: Vec<Spot>,
    /// The cocycle, edge by edge.
    phi: Vec<i64>,
    /// From, to (places in the list), and how the sign changes: phi(to) gets that times phi(from).
    steps: Vec<(u32, u32, i64)>,
    /// By edge, the first step that starts there, and one more at the end.
    first: Vec<u32>,
    /// By edge, how many steps to it are still to be taken.
    waiting: Vec<u32>,
    ready: Vec<u32>,
    places: Places,
}

/// The place of an edge in a list, by its packed spot.
type Places = HashMap<u64, u32, Hasher>;

/// Seeds for [`Places`], which never differ.
#[derive(Clone)]
struct Hasher(RandomState);

impl Default for Hasher {
    fn default() -> Self {
        Hasher(RandomState::with_seeds(1, 2, 3, 4))
    }
}

impl BuildHasher for Hasher {
    type Hasher = <RandomState as BuildHasher>::Hasher;
    fn build_hasher(&self) -> Self::Hasher {
        self.0.build_hasher()
    }
}

impl Flow {
    /// Finds all edges that flowed into one, and phi.
    fn follow(&mut self, complex: &Complex, edge: Spot) {
        self.edges.clear();
        self.steps.clear();
        self.first.clear();
        self.waiting.clear();
        self.places.clear();
        self.edges.push(edge);
        self.waiting.push(0);
        self.places.insert(edge.pack(), 0);
        let mut next = 0;
        while let Some(&from) = self.edges.get(next) {
            self.first.push(self.steps.len() as u32);
            for (side, face) in faces_around(complex, from) {
                let Some((partner, edge)) = partner(complex, face) else { continue };
                if edge == from {
                    continue;
                }
                let to = *self.places.entry(edge.pack()).or_insert_with(|| {
                    self.edges.push(edge);
                    self.waiting.push(0);
                    self.edges.len() as u32 - 1
                });
                self.waiting[to as usize] += 1;
                // The edge is on the side of the face that is opposite to where the face is seen from the edge.
                let sign = -incidence(face.extent, side.opposite()) * incidence(face.extent, partner);
                self.steps.push((next as u32, to, sign));
            }
            next += 1;
        }
        self.first.push(self.steps.len() as u32);
        // Each edge as soon as all that it flows into is known.
        self.phi.clear();
        self.phi.resize(self.edges.len(), 0);
        self.phi[0] = 1;
        self.ready.push(0);
        while let Some(from) = self.ready.pop() {
            let steps = self.first[from as usize] as usize..self.first[from as usize + 1] as usize;
            for &(_, to, sign) in &self.steps[steps] {
                self.phi[to as usize] += sign * self.phi[from as usize];
                self.waiting[to as usize] -= 1;
                if self.waiting[to as usize] == 0 {
                    self.ready.push(to);
                }
            }
        }
    }
}

/// The faces around an edge, each with the direction in which it lies.
pub(super) fn faces_around(complex: &Complex, edge: Spot) -> impl Iterator<Item = (Face, Spot)> + '_ {
    let sides = Face::ALL.into_iter().filter(move |side| !edge.extent.contains(side.axis()));
    sides.filter_map(move |side| complex.half_toward(edge, side).map(|face| (side, face)))
}

/// The edge with which a face was removed, and its side of the face.
pub(super) fn partner(complex: &Complex, face: Spot) -> Option<(Face, Spot)> {
    let normal = face.extent.complement().axes().next().expect("a face has a normal");
    let side = complex.bricks[face.brick as usize].record.as_deref()?.edge_of(normal, face.local)?;
    let edge = complex.half_toward(face, side).expect("both were live, so their bricks are listed");
    Some((side, edge))
}

/// The incidence number of a face and its edge on one side: 1 where the edge runs along the face's turn, from the first to the second of
/// its axes in cyclic order, and -1 where it runs against it.
fn incidence(face: Extent, side: Face) -> i64 {
    let [u, _] = face.complement().axes().next().expect("a face has a normal").others();
    if (side.axis() == u) == side.is_high() { 1 } else { -1 }
}
