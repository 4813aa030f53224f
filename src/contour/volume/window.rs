//! The numbers of the points on the edges of a row of cells.
//!
//! A row of cells has edges that start in four rows of lattice points. Their numbers fit into the first cache; going on to the next row
//! of cells, two of the four stay.

use super::slice::Slice;
use crate::grid::brick::Bits;
use crate::grid::{Axis, Edge};

/// Numbers of the points on the edges that start in four rows of lattice points: at y and z, y and z + 1, y + 1 and z, y + 1 and z + 1.
pub(super) struct Window {
    /// Three for each lattice point, row by row.
    numbers: Vec<u32>,
    /// Where each row begins.
    starts: [usize; 4],
    /// For each edge of a cell, where its number is, if the cell is the first of its row. (Sixteen, so that four bits find one without a check.)
    edges: [usize; 16],
}

impl Window {
    /// For rows of so many lattice points.
    pub(super) fn new(width: usize) -> Self {
        // The points beyond the row, up to a multiple of 64 and one more, are looked up by no edge that is crossed.
        let row = 3 * (width.next_multiple_of(64) + 1);
        let mut window = Window { numbers: vec![0; 4 * row], starts: [0, row, 2 * row, 3 * row], edges: [0; 16] };
        window.set_edges();
        window
    }

    /// Fills in all rows round the cells at `y` between two slices, of which the first points have these numbers.
    fn start(&mut self, slices: [&Slice; 2], firsts: [u32; 2], y: usize) {
        for side in 0..2 {
            self.fill(side, slices[side], firsts[side], y);
            self.fill(2 + side, slices[side], firsts[side], y + 1);
        }
    }

    /// Goes on from the cells of the row before to those at `y`.
    fn advance(&mut self, slices: [&Slice; 2], firsts: [u32; 2], y: usize) {
        let [a, b, c, d] = self.starts;
        self.starts = [c, d, a, b];
        self.set_edges();
        for side in 0..2 {
            self.fill(2 + side, slices[side], firsts[side], y + 1);
        }
    }

    /// Goes on to the cells at `y`, from those at `row`, if it has been at any.
    pub(super) fn go_to(&mut self, row: &mut Option<usize>, slices: [&Slice; 2], firsts: [u32; 2], y: usize) {
        match *row {
            Some(row) if row == y => return,
            Some(row) if row + 1 == y => self.advance(slices, firsts, y),
            _ => self.start(slices, firsts, y),
        }
        *row = Some(y);
    }

    /// The numbers of the points on the edges of a cell, given its lattice point with the least x. Only those on crossed edges mean anything.
    #[inline]
    pub(super) fn at(&self, x: usize) -> impl Fn(u8) -> u32 + '_ {
        let numbers = &self.numbers[3 * x..];
        move |edge| numbers[self.edges[usize::from(edge & 15)]]
    }

    fn set_edges(&mut self) {
        for edge in Edge::ALL {
            let [low, _] = edge.corners();
            let row = usize::from(low & Axis::Z) + 2 * usize::from(low & Axis::Y);
            self.edges[edge.index()] = self.starts[row] + 3 * usize::from(low & Axis::X) + edge.axis().index();
        }
    }

    #[inline]
    fn fill(&mut self, row: usize, slice: &Slice, first: u32, y: usize) {
        let numbers = &mut self.numbers[self.starts[row]..];
        for word in slice.row(y) {
            let numbers = &mut numbers[3 * 64 * word.x as usize..][..3 * 64];
            let mut number = first + word.edge;
            for (axis, &crossed) in word.crossed.iter().enumerate() {
                for x in Bits(crossed) {
                    numbers[3 * x as usize + axis] = number;
                    number += 1;
                }
            }
        }
    }
}
