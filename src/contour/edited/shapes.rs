//! What a cell may see of the complex, and all that follows from it: worked out once for all cells that see the same.
//!
//! There are 15,936 closed subcomplexes of a cell; a repaired solid has some hundreds of them.

use super::around::steps_in_table;
use crate::grid::cases::Mask;
use crate::grid::subcomplex::Subcomplex;
use crate::grid::{Axis, Corner, Edge, Face};
use glam::DVec3;
use std::sync::LazyLock;

/// Four octants round an element of dimension 0, 1 or 2 in the complex and one of a dimension more that is not, counter-clockwise seen
/// from outside: steps to a cell, and a corner of it.
type Octants = [([i32; 3], Corner); 4];

/// The same, as the [table](super::around) has it.
pub(super) struct Ring {
    /// Cells by their places in the table from that of the cell that asks.
    pub(super) octants: [(i32, Corner); 4],
    /// The cells as bits, numbered as by [`number`].
    pub(super) cells: u32,
}

/// The number of a cell among the 27 round one, that one included: in the order of the steps to them.
fn number(steps: [i32; 3]) -> u32 {
    steps.into_iter().fold(0, |number, step| 3 * number + (step + 1) as u32)
}

/// What a cell sees of the complex, and what follows from it.
#[derive(Debug)]
pub(super) struct Shape {
    /// For each corner in the complex the vertex of the cell that it belongs to; 255 for others.
    pub(super) slots: [u8; 8],
    /// Number of its vertices.
    pub(super) vertices: u8,
    /// The vertices that are not the only one of their sheet, a bit each.
    pub(super) irregular: u8,
    /// For each axis the corners in the complex whose edge along the axis is not.
    pub(super) open: [Mask; 3],
    /// The corners in the complex.
    pub(super) corners: Mask,
    /// For each vertex the box that it may be in, from where the cell starts.
    pub(super) ranges: Vec<[DVec3; 2]>,
    /// The polygons at its octants, in order: places in [`RINGS`].
    pub(super) rings: Vec<u8>,
}

/// The polygons at the octants of a cell at the origin. First those round the edges at a corner (three times the corner, and the axis),
/// then the same with the other diagonal, then those beside an edge (twice the edge, and which of its faces), then those on a face.
pub(super) static RINGS: LazyLock<Vec<Ring>> = LazyLock::new(|| {
    let corners = || Corner::ALL.into_iter().flat_map(|corner| Axis::ALL.map(|axis| (corner, axis)));
    let turned = |mut ring: Octants| {
        ring.rotate_left(1);
        ring
    };
    let round = |turn: bool| {
        corners().map(move |(corner, axis)| {
            let ring = round_edge(corner, axis);
            directed(if turn { turned(ring) } else { ring }, Face::new(axis, !(corner & axis)))
        })
    };
    let beside = Edge::ALL.into_iter().flat_map(|edge| edge.faces().map(|face| (edge, face))).map(|(edge, face)| {
        let behind = edge.faces().into_iter().find(|&f| f != face).expect("two faces meet in an edge");
        directed(beside_edge(edge, face), behind.opposite())
    });
    let on = Face::ALL.into_iter().map(|face| directed(face.corners().map(|corner| ([0; 3], corner)), face.opposite()));
    let all = round(false).chain(round(true)).chain(beside).chain(on);
    let in_table = |ring: Octants| Ring {
        octants: ring.map(|(steps, corner)| (steps_in_table(steps), corner)),
        cells: ring.into_iter().fold(0, |cells, (steps, _)| cells | 1 << number(steps)),
    };
    all.map(in_table).collect()
});

/// Vertices keep this distance from the sides of their octants, in cells.
const MARGIN: f64 = 1.0 / 64.0;

/// The corners on the low side of each axis.
const LOW: [Mask; 3] = [0x0f, 0x33, 0x55];

/// Where the groups of [`RINGS`] begin.
const TURNED: usize = 24;
const BESIDE: usize = 48;
const ON: usize = 72;

impl Shape {
    /// Domain: closed.
    pub(super) fn new(parts: Subcomplex) -> Self {
        let sheets = parts.sheets();
        let there = || Corner::ALL.into_iter().filter(|&corner| parts.contains(corner));
        let mask = |corners: &mut dyn Iterator<Item = Corner>| corners.fold(0, |mask, c| mask | 1 << c.index());
        let irregular = there().filter(|c| sheets.vertices > 0 && !sheets.is_regular(sheets.sheet[c.index()]));
        let mut shape = Shape {
            slots: sheets.vertex,
            vertices: sheets.vertices,
            irregular: irregular.fold(0, |bits, c| bits | 1 << sheets.vertex[c.index()]),
            open: Axis::ALL.map(|axis| mask(&mut there().filter(|&c| !parts.contains(Edge::at(axis, c))))),
            corners: mask(&mut there()),
            ranges: Vec::new(),
            rings: Vec::new(),
        };
        shape.ranges = (0..shape.vertices).map(|vertex| shape.range(vertex)).collect();
        if shape.vertices > 0 {
            shape.rings = shape.rings_of(parts);
        }
        shape
    }

    /// Where a vertex may go, from where its cell starts.
    fn range(&self, vertex: u8) -> [DVec3; 2] {
        if self.vertices == 1 {
            return [DVec3::splat(MARGIN), DVec3::splat(1.0 - MARGIN)];
        }
        let corners = self.corners_of(vertex);
        [
            DVec3::from(LOW.map(|side| if corners & side != 0 { MARGIN } else { 0.5 + MARGIN })),
            DVec3::from(LOW.map(|side| if corners & !side != 0 { 1.0 - MARGIN } else { 0.5 - MARGIN })),
        ]
    }

    fn rings_of(&self, parts: Subcomplex) -> Vec<u8> {
        let mut rings = Vec::new();
        for corner in Corner::ALL.into_iter().filter(|&c| parts.contains(c)) {
            for axis in Axis::ALL.into_iter().filter(|&a| !parts.contains(Edge::at(a, corner))) {
                // Round an edge between two points of the complex there are two polygons, and they may have the same vertices: they
                // are cut along different diagonals.
                let turn = if corner & axis && parts.contains(corner ^ axis) { TURNED } else { 0 };
                rings.push(turn + 3 * corner.index() + axis.index());
            }
        }
        for edge in Edge::ALL.into_iter().filter(|&e| parts.contains(e)) {
            let open = (0..2).filter(|&i| !parts.contains(edge.faces()[i]));
            rings.extend(open.map(|i| BESIDE + 2 * edge.index() + i));
        }
        // The corners of a face have as many vertices between them as there are sides, or one: the polygon collapses.
        let is_whole = |face: &Face| {
            let slots = face.corners().map(|c| self.slots[c.index()]);
            (0..4).filter(|&i| slots[i] != slots[(i + 1) % 4]).count() > 2
        };
        let faces = Face::ALL.into_iter().filter(|&f| parts.contains(f));
        rings.extend(faces.filter(is_whole).map(|face| ON + face.index()));
        rings.into_iter().map(|n| n as u8).collect()
    }

    /// The corners whose octants a vertex stands for.
    #[inline]
    pub(super) fn corners_of(&self, vertex: u8) -> Mask {
        if self.vertices == 1 {
            return self.corners;
        }
        (0..8).filter(|&c| self.slots[c] == vertex).fold(0, |mask, c| mask | 1 << c)
    }
}

/// The octants of the four cells round the edge along `axis` at a corner of the cell, all at that corner's point.
fn round_edge(corner: Corner, axis: Axis) -> Octants {
    let [u, v] = axis.others();
    // The diagonal of the ring is the same whichever of the four cells asks.
    let low = Axis::ALL.map(|a| -i32::from(a != axis && !(corner & a)));
    let low_corner = corner | u | v;
    [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
        let mut there = low;
        there[u.index()] += du;
        there[v.index()] += dv;
        let corner = if du == 1 { low_corner ^ u } else { low_corner };
        (there, if dv == 1 { corner ^ v } else { corner })
    })
}

/// The octants at both ends of an edge of the cell, in it and in the one across `face`.
fn beside_edge(edge: Edge, face: Face) -> Octants {
    let [p, q] = edge.corners();
    let a = face.axis();
    let mut beyond = [0; 3];
    beyond[a.index()] = if face.is_high() { 1 } else { -1 };
    [([0; 3], p), ([0; 3], q), (beyond, q ^ a), (beyond, p ^ a)]
}

/// The ring turned so that its normal points as that of `outward` does. It begins with the same octant.
fn directed(mut ring: Octants, outward: Face) -> Octants {
    // The middles of octants, in quarters of a cell.
    let p = ring.map(|(at, corner)| Axis::ALL.map(|a| 4 * at[a.index()] + if corner & a { 3 } else { 1 }));
    let along = |a: usize, b: usize| -> [i32; 3] { std::array::from_fn(|x| p[b][x] - p[a][x]) };
    let (u, v) = (along(0, 2), along(1, 3));
    let [_, a, b] = [outward.axis(), outward.axis().next(), outward.axis().next().next()].map(Axis::index);
    let normal = u[a] * v[b] - u[b] * v[a];
    if (normal > 0) != outward.is_high() {
        ring.swap(1, 3);
    }
    ring
}
