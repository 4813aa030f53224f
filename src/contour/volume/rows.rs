//! The cells round the edges that start in a row of lattice points: four rows of them.

use super::slice::Slice;
use crate::grid::brick::Bits;
use crate::grid::cases::Mask;
use crate::grid::{Axis, Corner, Edge};

/// A mixed cell.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seen {
    /// The number of its first polygon in its slice.
    pub(super) first: u32,
    /// Its corners that are inside.
    pub(super) mask: Mask,
}

/// For each axis, the cells round an edge along it, counter-clockwise seen from its end: how many cells before the edge's own along x, y and z,
/// in which row, and which of the cell's edges it is.
pub(super) static CELLS: [[([usize; 3], usize, Edge); 4]; 3] = {
    let mut cells = [[([0; 3], 0, Edge::at(Axis::X, Corner::MIN)); 4]; 3];
    let mut a = 0;
    while a < 3 {
        let axis = Axis::ALL[a];
        let [u, v] = axis.others();
        // Round the edge from u to v.
        let turns = [[0, 0], [1, 0], [1, 1], [0, 1]];
        let mut i = 0;
        while i < 4 {
            let mut back = [0; 3];
            back[u as usize] = turns[i][0];
            back[v as usize] = turns[i][1];
            let mut corner = Corner::MIN;
            if turns[i][0] == 1 {
                corner = corner.high(u);
            }
            if turns[i][1] == 1 {
                corner = corner.high(v);
            }
            cells[a][i] = (back, 3 - back[1] - 2 * back[2], Edge::at(axis, corner));
            i += 1;
        }
        a += 1;
    }
    cells
};

/// Four rows of cells: at y - 1 and z - 1, y and z - 1, y - 1 and z, y and z.
pub(super) struct CellRows {
    rows: [Row; 4],
    /// How far both slices have been looked at: polygons and cells.
    done: [(u32, usize); 2],
}

#[derive(Clone)]
struct Row {
    mixed: Vec<u64>,
    cells: Vec<Seen>,
}

impl CellRows {
    /// For rows of so many lattice points.
    pub(super) fn new(width: usize) -> Self {
        let words = width.div_ceil(64);
        let row = Row { mixed: vec![0; words], cells: vec![Seen::default(); 64 * words] };
        CellRows { rows: std::array::from_fn(|_| row.clone()), done: [(0, 0); 2] }
    }

    /// Goes to the place before the first row.
    pub(super) fn restart(&mut self) {
        self.done = [(0, 0); 2];
        self.rows.iter_mut().for_each(|row| row.mixed.fill(0));
    }

    /// Goes on to the edges at `y`, which is the row after the one before. `slices` are those at z - 1 and z, `polygons` says how many of them
    /// a cell has.
    pub(super) fn advance(&mut self, slices: [Option<&Slice>; 2], y: usize, polygons: impl Fn(Mask) -> u32) {
        self.rows.swap(0, 1);
        self.rows.swap(2, 3);
        for (side, slice) in slices.into_iter().enumerate() {
            let row = &mut self.rows[1 + 2 * side];
            row.mixed.fill(0);
            let Some(slice) = slice else { continue };
            let (mut first, mut cell) = self.done[side];
            for word in slice.row(y) {
                row.mixed[word.x as usize] = word.mixed;
                for x in Bits(word.mixed) {
                    let mask = slice.masks()[cell];
                    row.cells[64 * word.x as usize + x as usize] = Seen { first, mask };
                    first += polygons(mask);
                    cell += 1;
                }
            }
            self.done[side] = (first, cell);
        }
    }

    /// The edges along an axis that start in a word of the row, of which all four cells are mixed.
    #[inline]
    pub(super) fn complete(&self, axis: Axis, word: usize) -> u64 {
        let here = |row: usize| self.rows[row].mixed[word];
        // The cells before those of the word.
        let back = |row: usize| here(row) << 1 | if word > 0 { self.rows[row].mixed[word - 1] >> 63 } else { 0 };
        match axis {
            Axis::X => here(0) & here(1) & here(2) & here(3),
            Axis::Y => here(1) & here(3) & back(1) & back(3),
            Axis::Z => here(2) & here(3) & back(2) & back(3),
        }
    }

    /// A mixed cell of one of the rows.
    #[inline]
    pub(super) fn at(&self, row: usize, x: usize) -> Seen {
        self.rows[row].cells[x]
    }
}
