//! What flowed into an edge of the skeleton while the complex was thinned: the way back along the discrete gradient.
//!
//! Every face f that was removed with an edge e' hands e' on to the other edges of f. Followed back from a skeleton edge e, these pairs
//! give all edges that flowed into e, and with signs a cocycle: a function phi on edges with phi(e) = 1 that sums to zero round
//! every face of the solid (only the faces of the sheets and the core could object, and those do not touch what was removed). Hence
//! phi(e') = - [f : e'] * sum of [f : e''] phi(e'') over the other edges of f, in the order of the flow: every edge is reckoned once,
//! however many ways lead from it to e, and ways that cancel do so.
//!
//! Edges are found breadth first; the place of an edge in the list stands in a table of its brick, which is kept for the next flow.
//!
//! Cost: some 50 ns an edge, and 6 KB for each brick that the widest flow comes through.

use super::complex::{Complex, Spot};
use crate::grid::{Axis, Extent, Face};

/// Steps through one complex, from edge to edge.
#[derive(Debug, Default)]
pub(super) struct Flow {
    edges: Vec<Spot>,
    /// The cocycle, edge by edge.
    phi: Vec<i64>,
    /// By the edge where they start: twice the place of the edge where they lead, and one more if the sign changes.
    steps: Vec<u32>,
    /// By edge, the first step that starts there, and one more at the end.
    first: Vec<u32>,
    /// By edge, how many steps to it are still to be taken.
    waiting: Vec<u32>,
    ready: Vec<u32>,
    places: Places,
}

impl Flow {
    /// Finds all edges that flowed into one, and phi. False if there are more than `most`: then nothing is known.
    pub(super) fn follow(&mut self, complex: &Complex, edge: Spot, most: usize) -> bool {
        self.places.clear(&self.edges);
        self.places.of_brick.resize(complex.bricks.len(), NONE);
        self.edges.clear();
        self.steps.clear();
        self.first.clear();
        self.waiting.clear();
        self.phi.clear();
        self.enter(edge);
        let mut next = 0;
        while let Some(&from) = self.edges.get(next) {
            if self.edges.len() > most {
                return false;
            }
            self.first.push(self.steps.len() as u32);
            sources(complex, from, &mut |edge, changes_sign| {
                let to = self.enter(edge);
                self.waiting[to as usize] += 1;
                self.steps.push(to << 1 | u32::from(changes_sign));
            });
            next += 1;
        }
        self.first.push(self.steps.len() as u32);
        self.sum_up();
        true
    }

    /// The edges with a phi other than 0, and that.
    pub(super) fn support(&self) -> impl Iterator<Item = (Spot, i64)> {
        self.edges.iter().copied().zip(self.phi.iter().copied()).filter(|(_, phi)| *phi != 0)
    }

    /// The place of an edge in the list.
    fn enter(&mut self, edge: Spot) -> u32 {
        let place = self.places.of(edge);
        if *place == NONE {
            *place = self.edges.len() as u32;
            self.edges.push(edge);
            self.waiting.push(0);
        }
        *place
    }

    /// Reckons phi, for each edge as soon as all that it flows into is known.
    fn sum_up(&mut self) {
        self.phi.resize(self.edges.len(), 0);
        self.phi[0] = 1;
        self.ready.push(0);
        while let Some(from) = self.ready.pop() {
            let phi = self.phi[from as usize];
            let steps = self.first[from as usize] as usize..self.first[from as usize + 1] as usize;
            for &step in &self.steps[steps] {
                let to = (step >> 1) as usize;
                self.phi[to] += if step & 1 == 1 { -phi } else { phi };
                self.waiting[to] -= 1;
                if self.waiting[to] == 0 {
                    self.ready.push(to as u32);
                }
            }
        }
    }
}

/// Not in the list.
const NONE: u32 = u32::MAX;
/// Edges that start in a brick.
const EDGES: usize = 3 * 512;

/// The places of edges in a list, by brick.
#[derive(Debug, Default)]
struct Places {
    /// By brick, the number of its table.
    of_brick: Vec<u32>,
    /// Tables that are taken.
    taken: usize,
    tables: Vec<u32>,
}

impl Places {
    #[inline]
    fn of(&mut self, edge: Spot) -> &mut u32 {
        let number = &mut self.of_brick[edge.brick as usize];
        if *number == NONE {
            *number = self.taken as u32;
            self.taken += 1;
            if self.tables.len() < self.taken * EDGES {
                self.tables.resize(self.taken * EDGES, NONE);
            }
        }
        &mut self.tables[*number as usize * EDGES + in_table(edge)]
    }

    /// Forgets the edges of a list.
    fn clear(&mut self, edges: &[Spot]) {
        for &edge in edges {
            self.tables[self.of_brick[edge.brick as usize] as usize * EDGES + in_table(edge)] = NONE;
        }
        edges.iter().for_each(|edge| self.of_brick[edge.brick as usize] = NONE);
        self.taken = 0;
    }
}

#[inline]
fn in_table(edge: Spot) -> usize {
    // Bits 1, 2, 4 to 0, 1, 2.
    (edge.extent.bits() as usize >> 1) << 9 | edge.local.index() as usize
}

/// Calls `visit` with each edge that flowed into another one through a face, and whether phi changes its sign there.
#[inline]
fn sources(complex: &Complex, edge: Spot, visit: &mut impl FnMut(Spot, bool)) {
    // X, Y, Z are bits 4, 2, 1. All that depends on axes and sides alone is worked out by the compiler.
    match edge.extent.bits() {
        4 => around::<0, 1, 2>(complex, edge, visit),
        2 => around::<1, 0, 2>(complex, edge, visit),
        _ => around::<2, 0, 1>(complex, edge, visit),
    }
}

/// [`sources`] of an edge along axis `A`; `U` and `V` are the two others, ascending.
#[inline]
fn around<const A: usize, const U: usize, const V: usize>(
    complex: &Complex,
    edge: Spot,
    visit: &mut impl FnMut(Spot, bool),
) {
    through::<A, U, false>(complex, edge, visit);
    through::<A, U, true>(complex, edge, visit);
    through::<A, V, false>(complex, edge, visit);
    through::<A, V, true>(complex, edge, visit);
}

/// [`sources`] through the face on one side, along axis `U`, of an edge along axis `A`.
#[inline]
fn through<const A: usize, const U: usize, const HIGH: bool>(
    complex: &Complex,
    edge: Spot,
    visit: &mut impl FnMut(Spot, bool),
) {
    let (along, across, normal) = (Axis::ALL[A], Axis::ALL[U], Axis::ALL[3 - A - U]);
    let step = |brick, local, axis, high| complex.step(brick, local, Face::new(axis, high));
    // The face on the high side starts where the edge does.
    let start = if HIGH { Some((edge.brick, edge.local)) } else { step(edge.brick, edge.local, across, false) };
    let Some((brick, local)) = start else { return };
    let Some(record) = complex.bricks[brick as usize].record.as_deref() else { return };
    let Some(partner) = record.edge_of(normal, local) else { return };
    // Seen from the face, the edge lies on the opposite side.
    let (own, high) = (Face::new(across, !HIGH), partner.is_high());
    let lies_opposite = partner.axis() == across;
    if lies_opposite && high != HIGH {
        return;
    }
    let axis = if lies_opposite { across } else { along };
    let end = if high { step(brick, local, axis, true) } else { Some((brick, local)) };
    let (brick, local) = end.expect("both were live, so their bricks are listed");
    let extent = Extent::from(if lies_opposite { along } else { across });
    let face = along | across;
    visit(Spot { brick, extent, local }, runs_along(face, own) == runs_along(face, Face::new(axis, high)));
}

/// The side of a face on which the edge lies with which it was removed.
fn partner_side(complex: &Complex, face: Spot) -> Option<Face> {
    complex.bricks[face.brick as usize].record.as_deref()?.edge_of(normal(face.extent), face.local)
}

/// The edge with which a face was removed.
pub(super) fn partner(complex: &Complex, face: Spot) -> Option<Spot> {
    let side = partner_side(complex, face)?;
    Some(complex.half_toward(face, side).expect("both were live, so their bricks are listed"))
}

#[inline]
fn normal(face: Extent) -> Axis {
    face.complement().axes().next().expect("a face has a normal")
}

/// Whether the edge on one side of a face runs along the face's turn, from the first to the second of its axes in cyclic order: its
/// incidence number is 1, and -1 otherwise.
#[inline]
fn runs_along(face: Extent, side: Face) -> bool {
    let [u, _] = normal(face).others();
    (side.axis() == u) == side.is_high()
}
