//! Marching cubes (Lorensen and Cline 1987) by the derived cases: closed and manifold for all signs.
//!
//! Points are numbered as the crossed edges are, and the triangles of a cell follow from the signs of its corners.

use super::lattice::{Lattice, place};
use super::run::Extractor;
use super::slice::Slice;
use super::window::Window;
use crate::grid::brick::Bits;
use crate::grid::cases::{CASES, Mask};
use crate::grid::{Axis, Edge};
use crate::volume::Volume;
use glam::DVec3;

/// The triangles of all cases, as edges of the cell.
pub(super) struct Triangles {
    /// Those of a case are between its ends.
    edges: Vec<u8>,
    ends: [[u16; 2]; 256],
}

impl Triangles {
    /// Counter-clockwise seen from outside, or clockwise if they are `turned`.
    pub(super) fn new(turned: bool) -> Self {
        let mut triangles = Triangles { edges: Vec::new(), ends: [[0; 2]; 256] };
        for (case, mask) in CASES.iter().zip(0..) {
            let start = triangles.edges.len() as u16;
            for [a, b, c] in case.triangles.iter().map(|t| t.map(|e: Edge| e.index() as u8)) {
                triangles.edges.extend(if turned { [a, c, b] } else { [a, b, c] });
            }
            triangles.ends[mask] = [start, triangles.edges.len() as u16];
        }
        triangles
    }

    /// The corners of the triangles of a case, three for each.
    #[inline]
    pub(super) fn of(&self, mask: Mask) -> &[u8] {
        let [start, end] = self.ends[usize::from(mask)].map(usize::from);
        &self.edges[start..end]
    }
}

/// Marching cubes over the slices of a lattice.
pub(super) struct Cubes<'a, V> {
    lattice: &'a Lattice<'a, V>,
    slices: &'a [Slice],
    triangles: Triangles,
}

impl<'a, V: Volume> Cubes<'a, V> {
    pub(super) fn new(lattice: &'a Lattice<'a, V>, slices: &'a [Slice]) -> Self {
        Cubes { lattice, slices, triangles: Triangles::new(lattice.is_mirrored()) }
    }
}

impl<V: Volume> Extractor for Cubes<'_, V> {
    type Scratch = Window;

    fn scratch(&self) -> Window {
        Window::new(self.lattice.size[0])
    }

    fn count(&self, _: &mut Window, z: usize) -> [u64; 2] {
        let slice = &self.slices[z];
        let corners: u64 = slice.masks().iter().map(|&mask| self.triangles.of(mask).len() as u64).sum();
        [u64::from(slice.edges()), corners / 3]
    }

    #[inline(never)]
    fn points(&self, _: &mut Window, z: usize, points: &mut Vec<DVec3>) {
        edge_points(self.lattice, &self.slices[z], z, points);
    }

    #[inline(never)]
    fn triangles(&self, window: &mut Window, z: usize, first: impl Fn(usize) -> u32, corners: &mut Vec<u32>) {
        let slice = &self.slices[z];
        // The last slice has no cells.
        let Some(next) = self.slices.get(z + 1) else { return };
        let (slices, firsts) = ([slice, next], [first(z), first(z + 1)]);
        let mut masks = slice.masks().iter();
        let mut row = None;
        for y in 0..slice.rows() {
            for word in slice.row(y).iter().filter(|word| word.mixed != 0) {
                window.go_to(&mut row, slices, firsts, y);
                let start = 64 * word.x as usize;
                for (x, &mask) in Bits(word.mixed).zip(&mut masks) {
                    let number = window.at(start + x as usize);
                    corners.extend(self.triangles.of(mask).iter().map(|&edge| number(edge)));
                }
            }
        }
    }
}

/// Appends the points on the crossed edges of a slice, in order, in model units.
#[inline]
pub(super) fn edge_points<V: Volume>(lattice: &Lattice<'_, V>, slice: &Slice, z: usize, points: &mut Vec<DVec3>) {
    for y in 0..slice.rows() {
        for word in slice.row(y) {
            let first = [64 * word.x as usize, y, z];
            let start = lattice.to_model(place(first));
            for (axis, along) in Axis::ALL.into_iter().zip(lattice.steps()) {
                for x in Bits(word.crossed[axis.index()]) {
                    let t = lattice.crossing([first[0] + x as usize, y, z], axis);
                    points.push(start + lattice.steps()[0] * f64::from(x) + along * t);
                }
            }
        }
    }
}
