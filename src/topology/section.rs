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
//! In the background the squares are faces of the grid, and those at the rim lie partly in the solid: each counts with the part of its
//! four corners that is outside. (An edge of the solid has both ends inside, so that no square of a cut needs that.)
//!
//! Cost: some 150 ns an edge of the section.

use super::complex::{Complex, Side, Spot};
use crate::grid::{Extent, Face};
use ahash::RandomState;
use hashbrown::HashMap;

/// The cross-section at an edge of the skeleton.
#[derive(Debug, Clone)]
pub(super) struct Section {
    /// Length of the vector area, in squares of cells.
    pub(super) area: f64,
    /// Number of squares.
    pub(super) squares: u64,
    /// Mean of the squares' centres, in lattice units.
    pub(super) centre: [f64; 3],
}

impl Section {
    /// The section through an edge that no face is left at.
    pub(super) fn of(complex: &Complex, edge: Spot) -> Section {
        let flow = Flow::into(complex, edge);
        let phi = flow.phi();
        let mut vector = [0.0; 3];
        let mut centre = [0.0; 3];
        for (&spot, &phi) in flow.edges.iter().zip(&phi) {
            let axis = spot.extent.axes().next().expect("an edge has an axis");
            vector[axis.index()] += phi as f64 * part_outside(complex, spot);
            let at = complex.key(spot).center();
            (0..3).for_each(|a| centre[a] += f64::from(at[a]));
        }
        let squares = flow.edges.len() as u64;
        Section {
            area: vector.iter().map(|c| c * c).sum::<f64>().sqrt(),
            squares,
            centre: centre.map(|c| c / squares as f64),
        }
    }
}

/// The part of a square that counts.
fn part_outside(complex: &Complex, edge: Spot) -> f64 {
    if complex.side() == Side::Object {
        return 1.0;
    }
    let [u, v] = edge.extent.axes().next().expect("an edge has an axis").others();
    let mut corners = 0;
    for (a, b) in [(false, false), (false, true), (true, false), (true, true)] {
        let cell = complex.half_toward(edge, Face::new(u, a)).and_then(|face| complex.half_toward(face, Face::new(v, b)));
        corners += u32::from(cell.is_some_and(|cell| {
            let was = complex.bricks[cell.brick as usize].record.as_deref().and_then(|r| r.face_of(cell.local));
            was.is_some() || complex.get(cell)
        }));
    }
    f64::from(corners) / 4.0
}

/// The edges that flowed into one, and how.
struct Flow {
    edges: Vec<Spot>,
    /// From, to (places in the list), and how the sign changes: phi(to) gets that times phi(from).
    steps: Vec<(u32, u32, i64)>,
}

impl Flow {
    fn into(complex: &Complex, edge: Spot) -> Flow {
        let mut flow = Flow { edges: vec![edge], steps: Vec::new() };
        let mut places: HashMap<Spot, u32, RandomState> = HashMap::with_hasher(RandomState::with_seeds(1, 2, 3, 4));
        places.insert(edge, 0);
        let mut next = 0;
        while next < flow.edges.len() {
            let (from, place) = (flow.edges[next], next as u32);
            next += 1;
            for (side, face) in faces_around(complex, from) {
                let Some((partner, edge)) = partner(complex, face) else { continue };
                if edge == from {
                    continue;
                }
                let to = *places.entry(edge).or_insert_with(|| {
                    flow.edges.push(edge);
                    flow.edges.len() as u32 - 1
                });
                // The edge is on the side of the face that is opposite to where the face is seen from the edge.
                let sign = -incidence(face.extent, side.opposite()) * incidence(face.extent, partner);
                flow.steps.push((place, to, sign));
            }
        }
        flow
    }

    /// The cocycle, edge by edge: each one as soon as all that it flows into is known.
    fn phi(&self) -> Vec<i64> {
        let n = self.edges.len();
        let mut waiting = vec![0u32; n];
        let mut first = vec![0u32; n + 1];
        for &(from, to, _) in &self.steps {
            waiting[to as usize] += 1;
            first[from as usize + 1] += 1;
        }
        (0..n).for_each(|i| first[i + 1] += first[i]);
        let mut phi = vec![0i64; n];
        phi[0] = 1;
        // Steps come in the order of where they start.
        let mut ready = vec![0u32];
        while let Some(from) = ready.pop() {
            for &(_, to, sign) in &self.steps[first[from as usize] as usize..first[from as usize + 1] as usize] {
                phi[to as usize] += sign * phi[from as usize];
                waiting[to as usize] -= 1;
                if waiting[to as usize] == 0 {
                    ready.push(to);
                }
            }
        }
        phi
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
