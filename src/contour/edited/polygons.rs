//! The polygons round the vertices of touched cells, and which ones of the unedited surface they replace.

use super::touched::{At, Touched};
use crate::contour::layout::Layout;
use crate::grid::cases::{CASES, is_crossed};
use crate::grid::{Axis, Corner, Edge, Face};
use rayon::prelude::*;

/// A set of numbers below some limit that tells how many of its members are below a number.
#[derive(Debug)]
pub(super) struct Ranks {
    /// 64 bits, and the number of members before them.
    words: Vec<(u64, u32)>,
}

impl Ranks {
    fn new(limit: u64, members: &[u32]) -> Self {
        let mut words = vec![(0, 0); (limit / 64 + 1) as usize];
        members.iter().for_each(|&n| words[n as usize / 64].0 |= 1u64 << (n % 64));
        let mut before = 0;
        for word in &mut words {
            word.1 = before;
            before += word.0.count_ones();
        }
        Ranks { words }
    }

    #[inline]
    pub(super) fn contains(&self, n: u32) -> bool {
        self.words[n as usize / 64].0 >> (n % 64) & 1 == 1
    }

    /// Number of members below `n`.
    #[inline]
    pub(super) fn rank(&self, n: u32) -> u32 {
        let (word, before) = self.words[n as usize / 64];
        before + (word & ((1 << (n % 64)) - 1)).count_ones()
    }
}

/// What takes the place of the unedited surface in touched cells. Vertices have the numbers of the whole edited surface: those of
/// untouched cells as before, but closing up where others drop out, and then those of touched cells.
pub(super) struct Patch<'a> {
    pub(super) touched: &'a Touched,
    layout: &'a Layout<'a>,
    /// The vertices of the unedited surface that drop out, sorted.
    pub(super) dropped: Vec<u32>,
    pub(super) ranks: Ranks,
    /// Number of vertices of untouched cells.
    pub(super) kept: u32,
}

/// Polygons by their number of corners. Each quadrilateral begins with a corner of the diagonal by which it must be cut.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    pub(super) quads: Vec<[u32; 4]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Polygons {
    /// The sides of all polygons in order, each as the ends in the direction in which it is run through.
    pub(super) fn sides(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        let of_quads = self.quads.iter().flat_map(|q| (0..4).map(move |i| [q[i], q[(i + 1) % 4]]));
        of_quads.chain(self.triangles.iter().flat_map(|t| (0..3).map(move |i| [t[i], t[(i + 1) % 3]])))
    }
}

/// Touched cells a piece.
const PIECE: usize = 1024;

/// Four octants round an element of dimension 0, 1 or 2 in the complex and one of a dimension more that is not.
type Ring = [(At, Corner); 4];

impl<'a> Patch<'a> {
    pub(super) fn new(touched: &'a Touched, layout: &'a Layout<'a>) -> Self {
        let replaced = |cell: &super::touched::TouchedCell| {
            let case = &CASES[usize::from(cell.signs)].sheets;
            let first = case.vertex.iter().position(|&v| v == 0);
            let first = first.map_or(0, |corner| layout.vertex(cell.at.map(|c| c as u32), Corner::ALL[corner]));
            first..first + u32::from(case.vertices)
        };
        let mut dropped: Vec<u32> = touched.cells.par_iter().flat_map_iter(replaced).collect();
        dropped.par_sort_unstable();
        let ranks = Ranks::new(layout.vertices, &dropped);
        let kept = layout.vertices as u32 - dropped.len() as u32;
        assert!(kept.checked_add(touched.vertices).is_some(), "fewer than 2^32 vertices");
        Patch { touched, layout, dropped, ranks, kept }
    }

    /// Number of quadrilaterals of the unedited surface that have a vertex in a touched cell: one for each crossed edge of those cells.
    pub(super) fn dropped_quads(&self) -> u64 {
        let cells = self.touched.cells.par_iter().enumerate();
        let edges = cells.filter(|(_, cell)| !matches!(cell.signs, 0 | 255)).map(|(i, cell)| {
            let crossed = Edge::ALL.into_iter().filter(|&e| is_crossed(cell.signs, e));
            let own = crossed.filter(|edge| self.is_first(i, &round_edge(cell.at, edge.corners()[0], edge.axis())));
            own.count() as u64
        });
        edges.sum()
    }

    /// Whether no touched cell before number `i` is among the cells of the ring.
    fn is_first(&self, i: usize, ring: &Ring) -> bool {
        ring.iter().all(|&(at, _)| self.touched.find(at).is_none_or(|other| other >= i))
    }

    /// The vertex that stands for an octant.
    fn vertex(&self, (at, corner): (At, Corner)) -> u32 {
        if let Some(i) = self.touched.find(at) {
            let cell = &self.touched.cells[i];
            return self.kept + cell.first + u32::from(cell.slots[corner.index()]);
        }
        let before = self.layout.vertex(at.map(|c| c as u32), corner);
        before - self.ranks.rank(before)
    }

    /// All polygons with a vertex in a touched cell, in the order of the first such cell.
    pub(super) fn polygons(&self) -> Polygons {
        let pieces: Vec<Polygons> = (0..self.touched.cells.len().div_ceil(PIECE))
            .into_par_iter()
            .map(|n| {
                let mut polygons = Polygons::default();
                let cells = n * PIECE..self.touched.cells.len().min((n + 1) * PIECE);
                cells.for_each(|i| self.polygons_of(i, &mut polygons));
                polygons
            })
            .collect();
        let mut all = Polygons::default();
        for piece in pieces {
            all.quads.extend(piece.quads);
            all.triangles.extend(piece.triangles);
        }
        all
    }

    /// The polygons of touched cell `i` that no touched cell before it has.
    fn polygons_of(&self, i: usize, polygons: &mut Polygons) {
        let cell = &self.touched.cells[i];
        let (at, parts) = (cell.at, cell.parts);
        if cell.vertices == 0 {
            return;
        }
        for corner in Corner::ALL.into_iter().filter(|&c| parts.contains(c)) {
            for axis in Axis::ALL.into_iter().filter(|&a| !parts.contains(Edge::at(a, corner))) {
                let mut ring = round_edge(at, corner, axis);
                if !self.is_first(i, &ring) {
                    continue;
                }
                // Round an edge between two points of the complex there are two polygons, and they may have the same vertices: they
                // are cut along different diagonals.
                if corner & axis && parts.contains(corner ^ axis) {
                    ring.rotate_left(1);
                }
                let mut outward = [0; 3];
                outward[axis.index()] = if corner & axis { -1 } else { 1 };
                self.push(ring, outward, polygons);
            }
        }
        for edge in Edge::ALL.into_iter().filter(|&e| parts.contains(e)) {
            for face in edge.faces().into_iter().filter(|&f| !parts.contains(f)) {
                let ring = beside_edge(at, edge, face);
                if self.is_first(i, &ring) {
                    let behind = edge.faces().into_iter().find(|&f| f != face).expect("two faces meet in an edge");
                    self.push(ring, normal(behind.opposite()), polygons);
                }
            }
        }
        for face in Face::ALL.into_iter().filter(|&f| parts.contains(f)) {
            self.push(face.corners().map(|corner| (at, corner)), normal(face.opposite()), polygons);
        }
    }

    /// Appends the polygon with these octants, turned outward, unless it collapses.
    fn push(&self, ring: Ring, outward: [i32; 3], polygons: &mut Polygons) {
        let p = ring.map(|(at, corner)| octant_middle(at, corner));
        let along = |a: usize, b: usize| -> [i32; 3] { std::array::from_fn(|x| p[b][x] - p[a][x]) };
        let (u, v) = (along(0, 2), along(1, 3));
        let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let mut quad = ring.map(|octant| self.vertex(octant));
        if (0..3).map(|a| cross[a] * outward[a]).sum::<i32>() < 0 {
            quad.swap(1, 3);
        }
        let mut corners = Vec::with_capacity(4);
        (0..4).filter(|&i| quad[i] != quad[(i + 3) % 4]).for_each(|i| corners.push(quad[i]));
        match corners[..] {
            [_, _, _, _] => polygons.quads.push(quad),
            [a, b, c] => polygons.triangles.push([a, b, c]),
            _ => {}
        }
    }
}

/// The octants of the four cells round the edge along `axis` at a corner of the cell at `at`, all at that corner's point.
fn round_edge(at: At, corner: Corner, axis: Axis) -> Ring {
    let [u, v] = axis.others();
    // The diagonal of the ring is the same whichever of the four cells asks.
    let low = Axis::ALL.map(|a| at[a.index()] - i32::from(a != axis && !(corner & a)));
    let low_corner = corner | u | v;
    [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
        let mut there = low;
        there[u.index()] += du;
        there[v.index()] += dv;
        let corner = if du == 1 { low_corner ^ u } else { low_corner };
        (there, if dv == 1 { corner ^ v } else { corner })
    })
}

/// The octants at both ends of an edge of the cell at `at`, in that cell and in the one across `face`.
fn beside_edge(at: At, edge: Edge, face: Face) -> Ring {
    let [p, q] = edge.corners();
    let a = face.axis();
    let mut beyond = at;
    beyond[a.index()] += if face.is_high() { 1 } else { -1 };
    [(at, p), (at, q), (beyond, q ^ a), (beyond, p ^ a)]
}

/// The middle of an octant in quarters of a cell.
fn octant_middle(at: At, corner: Corner) -> [i32; 3] {
    Axis::ALL.map(|a| 4 * at[a.index()] + if corner & a { 3 } else { 1 })
}

/// The outward normal of a face.
fn normal(face: Face) -> [i32; 3] {
    let mut normal = [0; 3];
    normal[face.axis().index()] = if face.is_high() { 1 } else { -1 };
    normal
}
