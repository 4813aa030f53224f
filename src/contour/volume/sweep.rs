//! The dense walker: every sample is looked at once, 64 at a time.
//!
//! Rows of samples become words of signs. An edge along x is crossed where a word differs from itself shifted by one, edges along y and z
//! where it differs from the next row's and the next slice's, and a cell is mixed where some of its eight corners are inside and some
//! are not: some ten operations for 64 cells. Only mixed cells are looked at one by one.
//!
//! Memory: the signs of two slices, one bit a sample, for each thread.

use super::lattice::Lattice;
use super::slice::{Slice, corners};
use crate::volume::{Level, Volume};
use std::ops::Range;

/// Where the surface is, slice by slice: the part of extraction that knows how the volume is stored.
pub(crate) trait Walker: Sync {
    /// Number of slices.
    fn slices(&self) -> usize;

    /// Some of the slices, in order.
    fn walk(&self, range: Range<usize>) -> Vec<Slice>;
}

/// Signs of a slice of the lattice, in rows of words.
struct Signs {
    words: Vec<u64>,
    /// Words a row.
    row: usize,
    /// Whether all are outside.
    is_empty: bool,
}

impl Signs {
    fn new(rows: usize, row: usize) -> Self {
        Signs { words: vec![0; rows * row], row, is_empty: true }
    }

    fn row(&self, y: usize) -> &[u64] {
        &self.words[y * self.row..(y + 1) * self.row]
    }

    /// Fills in slice `z` of the lattice.
    fn fill<V: Volume>(&mut self, lattice: &Lattice<'_, V>, z: usize, level: Level) {
        if !self.is_empty {
            self.words.fill(0);
        }
        self.is_empty = true;
        let size = lattice.volume.size();
        let Some(z) = z.checked_sub(lattice.border).filter(|&z| z < size[2]) else { return };
        let words = size[0].div_ceil(64);
        let last = !0 >> (words * 64 - size[0]);
        for y in 0..size[1] {
            let start = (y + lattice.border) * self.row;
            let row = &mut self.words[start..start + self.row];
            lattice.volume.signs([y, z], level, &mut row[..words]);
            // A volume's own signs are not trusted beyond the row.
            row[words - 1] &= last;
            if lattice.border == 1 {
                let mut carry = 0;
                for word in row.iter_mut() {
                    (*word, carry) = (*word << 1 | carry, *word >> 63);
                }
            }
            self.is_empty &= row.iter().fold(0, |any, &word| any | word) == 0;
        }
    }
}

impl<V: Volume> Walker for Lattice<'_, V> {
    fn slices(&self) -> usize {
        self.size[2]
    }

    #[inline(never)]
    fn walk(&self, range: Range<usize>) -> Vec<Slice> {
        let words = self.size[0].div_ceil(64);
        // One row and one word more, which stay empty, spare all questions at the end.
        let signs = || Signs::new(self.size[1] + 1, words + 1);
        let (mut here, mut next) = (signs(), signs());
        here.fill(self, range.start, self.level);
        let mut slices = Vec::with_capacity(range.len());
        for z in range {
            next.fill(self, z + 1, self.level);
            slices.push(self.compare(z, &here, &next));
            std::mem::swap(&mut here, &mut next);
        }
        slices
    }
}

impl<V: Volume> Lattice<'_, V> {
    /// The slice at `z`, of which the signs are `here`; those of the next one are `next`.
    fn compare(&self, z: usize, here: &Signs, next: &Signs) -> Slice {
        let [width, rows, depth] = self.size;
        let mut slice = Slice::with_rows(rows);
        if here.is_empty && next.is_empty {
            (0..rows).for_each(|_| slice.end_row());
            return slice;
        }
        let words = width.div_ceil(64);
        // Points that have a neighbour along x: all but the last of the row. Likewise for rows and slices.
        let with_x: Vec<u64> = (0..words).map(|w| first_bits((width - 1).saturating_sub(64 * w))).collect();
        let with_z = if z + 1 < depth { !0 } else { 0 };
        let mut valid = Valid::new(self, words);
        for y in 0..rows {
            let with_y = if y + 1 < rows { !0 } else { 0 };
            let [a, b, c, d] = [here.row(y), next.row(y), here.row(y + 1), next.row(y + 1)];
            if self.volume.has_invalid_cells() {
                valid.fill(self, y, z);
            }
            for w in 0..words {
                let corners = corners([[a[w], a[w + 1]], [b[w], b[w + 1]], [c[w], c[w + 1]], [d[w], d[w + 1]]]);
                let any = corners.iter().fold(0, |a, b| a | b);
                let all = corners.iter().fold(!0, |a, b| a & b);
                // On the last row, slice or word there is more crossed than mixed.
                if any & !all == 0 {
                    continue;
                }
                let mixed = any & !all & with_x[w] & with_y & with_z & valid.cells[w];
                let crossed = [
                    (corners[0] ^ corners[4]) & with_x[w] & valid.edges[0][w],
                    (corners[0] ^ corners[2]) & with_y & valid.edges[1][w],
                    (corners[0] ^ corners[1]) & with_z & valid.edges[2][w],
                ];
                if mixed | crossed[0] | crossed[1] | crossed[2] != 0 {
                    slice.push(w as u32, crossed, mixed, &corners);
                }
            }
            slice.end_row();
        }
        slice.shrink();
        slice
    }
}

/// The cells of a row that may hold surface, and the edges that are on one of these.
struct Valid {
    cells: Vec<u64>,
    edges: [Vec<u64>; 3],
    /// Cells beside those of the row: at y - 1, at z - 1, at both.
    beside: [Vec<u64>; 3],
}

impl Valid {
    /// All of them.
    fn new<V: Volume>(lattice: &Lattice<'_, V>, words: usize) -> Self {
        let all = || vec![!0; words];
        let rows = || if lattice.volume.has_invalid_cells() { all() } else { Vec::new() };
        Valid { cells: all(), edges: [all(), all(), all()], beside: [rows(), rows(), rows()] }
    }

    fn fill<V: Volume>(&mut self, lattice: &Lattice<'_, V>, y: usize, z: usize) {
        lattice.valid_cells(Some(y), Some(z), &mut self.cells);
        let [below, behind, both] = &mut self.beside;
        lattice.valid_cells(y.checked_sub(1), Some(z), below);
        lattice.valid_cells(Some(y), z.checked_sub(1), behind);
        lattice.valid_cells(y.checked_sub(1), z.checked_sub(1), both);
        let [mut carry_y, mut carry_z] = [0; 2];
        for w in 0..self.cells.len() {
            let (here, below, behind, both) = (self.cells[w], below[w], behind[w], both[w]);
            let (along_y, along_z) = (here | behind, here | below);
            self.edges[0][w] = here | below | behind | both;
            self.edges[1][w] = along_y | along_y << 1 | carry_y;
            self.edges[2][w] = along_z | along_z << 1 | carry_z;
            (carry_y, carry_z) = (along_y >> 63, along_z >> 63);
        }
    }
}

/// A word with so many bits set, from the lowest on: at most all.
fn first_bits(count: usize) -> u64 {
    if count == 0 { 0 } else { !0 >> (64 - count.min(64)) }
}
