//! Marching cubes with the topology of the trilinear interpolant (Chernyaev 1995, "Marching cubes 33"; Lewiner et al. 2003).
//!
//! Samples say which corners of a cell are inside; the trilinear interpolant of its eight samples says how they are joined, through
//! the faces and through the middle. [`decide`] asks it, and [`variants`] has the surface for every answer. Chernyaev's table of 33 cases
//! had gaps that were found one by one (Custodio et al. 2013, Grosso 2016); here there is no table: answers come from the
//! function itself, surfaces from the cycles on the faces.
//!
//! Faces are decided by their own samples, so the surface is closed and manifold whatever rounding does. Points on edges, and everything
//! in cells where nothing is open, are those of marching cubes.

mod decide;
mod variants;

use super::cubes::edge_points;
use super::lattice::{CLEARANCE, Lattice, place};
use super::run::Extractor;
use super::slice::Slice;
use super::window::Window;
use crate::grid::brick::Bits;
use crate::grid::cases::Mask;
use crate::grid::{Axis, Corner, Edge};
use crate::volume::Volume;
use decide::{is_joined, joined};
use glam::DVec3;
use variants::{Patch, VARIANTS, Variants};

/// Marching cubes over the slices of a lattice, with the topology of the trilinear interpolant.
pub(super) struct Trilinear<'a, V> {
    lattice: &'a Lattice<'a, V>,
    slices: &'a [Slice],
    variants: &'static [Variants],
}

impl<'a, V: Volume> Trilinear<'a, V> {
    pub(super) fn new(lattice: &'a Lattice<'a, V>, slices: &'a [Slice]) -> Self {
        Trilinear { lattice, slices, variants: &VARIANTS }
    }

    /// The surface in a mixed cell.
    #[inline]
    fn patch(&self, at: [usize; 3], mask: Mask) -> &'static Patch {
        let variants = &self.variants[usize::from(mask)];
        if variants.is_plain() { &variants.by_choice[0].discs } else { self.choose(at, variants) }
    }

    fn choose(&self, at: [usize; 3], variants: &'static Variants) -> &'static Patch {
        let values = Corner::ALL.map(|corner| self.lattice.depth(corner_of(at, corner)));
        let choice =
            variants.faces.iter().rev().fold(0, |bits, &face| bits << 1 | usize::from(is_joined(&values, face)));
        let variant = &variants.by_choice[choice];
        if variant.tunnels.is_empty() {
            return &variant.discs;
        }
        let joined = joined(&values);
        let meet = |[a, b]: [u8; 2]| joined[usize::from(a)] == joined[usize::from(b)];
        variant.tunnels.iter().find(|(regions, _)| meet(*regions)).map_or(&variant.discs, |(_, patch)| patch)
    }

    /// Calls `each` with the mixed cells of a slice, in order.
    fn cells(&self, z: usize, mut each: impl FnMut([usize; 3], &'static Patch)) {
        let slice = &self.slices[z];
        let mut masks = slice.masks().iter();
        for y in 0..slice.rows() {
            for word in slice.row(y) {
                for (x, &mask) in Bits(word.mixed).zip(&mut masks) {
                    let at = [64 * word.x as usize + x as usize, y, z];
                    each(at, self.patch(at, mask));
                }
            }
        }
    }

    /// The mean of the points on the edges of a cycle, in the cell at `at`.
    fn centre(&self, at: [usize; 3], cycle: &[Edge]) -> DVec3 {
        let point = |edge: &Edge| {
            let [low, _] = edge.corners();
            let start = corner_of(at, low);
            place(start) + self.lattice.crossing(start, edge.axis()) * DVec3::AXES[edge.axis().index()]
        };
        let mean = cycle.iter().map(point).sum::<DVec3>() / cycle.len() as f64;
        mean.clamp(place(at) + CLEARANCE, place(at) + (1.0 - CLEARANCE))
    }
}

/// The lattice point at a corner of a cell.
#[inline]
fn corner_of(at: [usize; 3], corner: Corner) -> [usize; 3] {
    std::array::from_fn(|a| at[a] + usize::from(corner & Axis::ALL[a]))
}

impl<V: Volume> Extractor for Trilinear<'_, V> {
    type Scratch = Window;

    fn scratch(&self) -> Window {
        Window::new(self.lattice.size[0])
    }

    fn count(&self, _: &mut Window, z: usize) -> [u64; 2] {
        let (mut points, mut corners) = (u64::from(self.slices[z].edges()), 0);
        self.cells(z, |_, patch| {
            points += patch.centres.len() as u64;
            corners += patch.corners.len() as u64;
        });
        [points, corners / 3]
    }

    /// First those on edges, then those in the middle of discs.
    fn points(&self, _: &mut Window, z: usize, points: &mut Vec<DVec3>) {
        edge_points(self.lattice, &self.slices[z], z, points);
        self.cells(z, |at, patch| {
            points.extend(patch.centres.iter().map(|cycle| self.lattice.to_model(self.centre(at, cycle))));
        });
    }

    fn triangles(&self, window: &mut Window, z: usize, first: impl Fn(usize) -> u32, corners: &mut Vec<u32>) {
        let Some(next) = self.slices.get(z + 1) else { return };
        let slices = [&self.slices[z], next];
        let mut centre = first(z) + slices[0].edges();
        let mut row = None;
        self.cells(z, |[x, y, _], patch| {
            window.go_to(&mut row, slices, [first(z), first(z + 1)], y);
            let number = window.at(x);
            let point = |corner: u8| if corner < 12 { number(corner) } else { centre + u32::from(corner) - 12 };
            let start = corners.len();
            corners.extend(patch.corners.iter().map(|&corner| point(corner)));
            if self.lattice.is_mirrored() {
                corners[start..].as_chunks_mut::<3>().0.iter_mut().for_each(|t| t.swap(1, 2));
            }
            centre += patch.centres.len() as u32;
        });
    }
}

#[cfg(test)]
mod tests;
