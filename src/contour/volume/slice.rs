//! What walkers make and extractors look at: the crossed edges and mixed cells of a slice of the lattice, 64 at a time.

use crate::grid::brick::Bits;
use crate::grid::cases::Mask;
use crate::octree::cells::transposed;

/// 64 lattice points of a row along x of which an edge or a cell is cut by the surface. All elements belong to the lattice point at which
/// they start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Word {
    /// Number of the word in its row: its lattice points begin at 64 times that.
    pub(crate) x: u32,
    /// Number of its first crossed edge in the slice: edges are numbered word by word, and in a word first those along x.
    pub(crate) edge: u32,
    /// Number of its first mixed cell in the slice.
    pub(crate) cell: u32,
    /// The cells with corners of both signs.
    pub(crate) mixed: u64,
    /// The edges along x, y and z of which one end is inside.
    pub(crate) crossed: [u64; 3],
}

/// A slice of the lattice: all that starts at its points of one z. Only what the surface cuts is listed, so memory is that of the surface.
#[derive(Debug, Clone, Default)]
pub(crate) struct Slice {
    /// In ascending order, row by row.
    words: Vec<Word>,
    /// Where the words of each row end.
    rows: Vec<u32>,
    /// The corners that are inside, for each mixed cell.
    masks: Vec<Mask>,
    /// Number of crossed edges.
    edges: u32,
}

impl Slice {
    /// A slice without rows.
    pub(crate) fn with_rows(rows: usize) -> Self {
        Slice { rows: Vec::with_capacity(rows), ..Slice::default() }
    }

    /// Appends a word to the current row, which has no words from `x` on yet: its crossed edges, mixed cells, and for each corner of a
    /// cell those of which that corner is inside.
    pub(crate) fn push(&mut self, x: u32, crossed: [u64; 3], mixed: u64, corners: &[u64; 8]) {
        self.words.push(Word { x, edge: self.edges, cell: self.masks.len() as u32, mixed, crossed });
        self.edges += crossed.iter().map(|bits| bits.count_ones()).sum::<u32>();
        let (mut masks, mut count) = ([0; 64], 0);
        let mut left = mixed;
        while left != 0 {
            // Eight cells: their bits in eight words are eight masks, transposed.
            let shift = left.trailing_zeros() & !7;
            let bits = corners.map(|word| (word >> shift) as u8);
            let eight = transposed(u64::from_le_bytes(bits));
            for i in Bits(left >> shift & 0xff) {
                masks[count] = (eight >> (8 * i)) as u8;
                count += 1;
            }
            left &= !(0xff << shift);
        }
        self.masks.extend_from_slice(&masks[..count]);
    }

    /// Ends the current row.
    pub(crate) fn end_row(&mut self) {
        self.rows.push(self.words.len() as u32);
    }

    /// The words of a row; none beyond the last row.
    pub(crate) fn row(&self, y: usize) -> &[Word] {
        let end = |y: usize| self.rows.get(y).map_or(self.words.len(), |&end| end as usize);
        &self.words[if y == 0 { 0 } else { end(y - 1) }..end(y)]
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.rows.len()
    }

    /// The corners that are inside, for each mixed cell in order.
    pub(crate) fn masks(&self) -> &[Mask] {
        &self.masks
    }

    /// Number of crossed edges.
    pub(crate) fn edges(&self) -> u32 {
        self.edges
    }

    /// Gives back what was allocated in advance.
    pub(crate) fn shrink(&mut self) {
        self.words.shrink_to_fit();
        self.masks.shrink_to_fit();
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.words.capacity() * size_of::<Word>() + self.rows.capacity() * size_of::<u32>() + self.masks.capacity()
    }
}

/// Bytes held by slices.
pub(crate) fn bytes(slices: &[Slice]) -> u64 {
    slices.iter().map(|slice| slice.bytes() as u64).sum()
}

/// The corners of 64 cells that are inside, from the signs of the four rows round them: at y and z, y and z + 1, y + 1 and z, and at y + 1
/// and z + 1; each with the row's next word. Corners are numbered as in [`Corner`](crate::grid::Corner).
#[inline]
pub(crate) fn corners(rows: [[u64; 2]; 4]) -> [u64; 8] {
    let [a, b, c, d] = rows.map(|[word, _]| word);
    let [e, f, g, h] = rows.map(|[word, next]| word >> 1 | next << 63);
    [a, b, c, d, e, f, g, h]
}
