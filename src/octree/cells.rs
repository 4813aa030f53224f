//! The 512 cells of a brick at once, and the numbers of the crossings round them.

use super::SignedOctree;
use super::crossings::Brick;
use crate::grid::brick::{Bits, Local, Plane};
use crate::grid::cases::Mask;
use crate::grid::{Axis, Edge};

/// For each cell of a brick (named by its least corner): which of its edges are crossed.
pub(crate) struct CellEdges<'a> {
    brick: &'a Brick,
    /// The bricks at +x, +y, +z, +x+y, +x+z, +y+z.
    plus: [&'a Brick; 6],
    /// By the number of the edge in the cell.
    edges: [Plane; 12],
    /// The least corners that are inside.
    inside: Plane,
}

/// For each cell of a brick: which of its edges are crossed, which of its corners are inside.
pub(crate) struct Cells<'a> {
    edges: CellEdges<'a>,
    /// By the number of the corner.
    corners: [Plane; 8],
}

impl<'a> CellEdges<'a> {
    /// Brick number `i` of the octree.
    pub(crate) fn new(octree: &'a SignedOctree, i: usize) -> Self {
        let crossings = octree.crossings();
        let brick = &crossings.bricks()[i];
        let plus = crossings.plus(brick);
        let [x, y, z] = &brick.crossed;
        let [px, py, pz, pxy, pxz, pyz] = plus.map(|b| &b.crossed);
        let edges = [
            *x,
            x.at_plus_z(&pz[0]),
            x.at_plus_y(&py[0]),
            x.at_plus_y(&py[0]).at_plus_z(&pz[0].at_plus_y(&pyz[0])),
            *y,
            y.at_plus_z(&pz[1]),
            y.at_plus_x(&px[1]),
            y.at_plus_x(&px[1]).at_plus_z(&pz[1].at_plus_x(&pxz[1])),
            *z,
            z.at_plus_y(&py[2]),
            z.at_plus_x(&px[2]),
            z.at_plus_x(&px[2]).at_plus_y(&py[2].at_plus_x(&pxy[2])),
        ];
        CellEdges { brick, plus, edges, inside: octree.inside()[i] }
    }

    /// Calls `each` with every [knotty](Self::knotty) cell and its corners that are inside. Most bricks have none, and then no corners are asked
    /// for.
    pub(crate) fn for_knotty(self, mut each: impl FnMut(Local, Mask)) {
        let knotty = self.knotty();
        if knotty != Plane::EMPTY {
            let cells = self.with_corners();
            knotty.iter().for_each(|cell| each(cell, cells.mask(cell)));
        }
    }

    /// The corners, too.
    fn with_corners(self) -> Cells<'a> {
        // The sign changes along a crossed edge: corners follow from the least one.
        let (c0, edges) = (self.inside, &self.edges);
        let (c1, c2, c4) = (c0 ^ edges[8], c0 ^ edges[4], c0 ^ edges[0]);
        let (c3, c5, c6) = (c2 ^ edges[9], c4 ^ edges[10], c4 ^ edges[6]);
        let corners = [c0, c1, c2, c3, c4, c5, c6, c6 ^ edges[11]];
        Cells { edges: self, corners }
    }

    /// The cells with corners of both signs.
    pub(crate) fn mixed(&self) -> Plane {
        self.edges.iter().fold(Plane::EMPTY, |a, &b| a | b)
    }

    /// Those of the mixed cells that may have several sheets, or one that is not a simple disc: cells with an ambiguous face (all four
    /// edges crossed), or whose only corners of one sign are opposite to each other. All others have one sheet and one vertex.
    fn knotty(&self) -> Plane {
        Plane(std::array::from_fn(|x| {
            let e: [u64; 12] = std::array::from_fn(|i| self.edges[i].0[x]);
            let both = |[a, b]: [usize; 2]| e[a] & e[b];
            // Two edges of a face that are parallel, and the other two.
            let faces = [
                ([0, 1], [8, 10]),
                ([2, 3], [9, 11]),
                ([0, 2], [4, 6]),
                ([1, 3], [5, 7]),
                ([4, 5], [8, 9]),
                ([6, 7], [10, 11]),
            ];
            let ambiguous = faces.into_iter().fold(0, |any, (two, others)| any | both(two) & both(others));
            // Of the edges along an axis, two that are opposite in the cell, and the other two. All edges at two opposite corners are a pair an
            // axis.
            let only = |[a, b]: [usize; 2], [c, d]: [usize; 2]| e[a] & e[b] & !(e[c] | e[d]);
            let [x0, x1] = [only([0, 3], [1, 2]), only([1, 2], [0, 3])];
            let [y0, y1] = [only([4, 7], [5, 6]), only([5, 6], [4, 7])];
            let [z0, z1] = [only([8, 11], [9, 10]), only([9, 10], [8, 11])];
            ambiguous | x0 & y0 & z0 | x1 & y1 & z0 | x1 & y0 & z1 | x0 & y1 & z1
        }))
    }
}

impl<'a> Cells<'a> {
    /// Brick number `i` of the octree.
    pub(crate) fn new(octree: &'a SignedOctree, i: usize) -> Self {
        CellEdges::new(octree, i).with_corners()
    }

    /// The cells with corners of both signs.
    pub(crate) fn mixed(&self) -> Plane {
        self.edges.mixed()
    }

    /// Calls `each` with every mixed cell and its corners that are inside.
    #[inline]
    pub(crate) fn for_mixed(&self, mut each: impl FnMut(Local, Mask)) {
        let mixed = self.mixed();
        for (x, &word) in mixed.0.iter().enumerate() {
            if word == 0 {
                continue;
            }
            let masks = masks(self.corners.map(|corner| corner.0[x])).map(u64::to_le_bytes);
            for b in Bits(word) {
                each(Local::from_index(x as u32 * 64 + b), masks.as_flattened()[b as usize]);
            }
        }
    }

    pub(crate) fn brick(&self) -> &'a Brick {
        self.edges.brick
    }

    /// The corners of a cell that are inside.
    #[inline]
    pub(crate) fn mask(&self, cell: Local) -> Mask {
        let [x, y, z] = cell.coords();
        let bit = 8 * y + z;
        self.corners.iter().enumerate().fold(0, |mask, (i, plane)| mask | ((plane.0[x as usize] >> bit & 1) as u8) << i)
    }
}

/// The masks of the 64 cells of a layer, eight along z in each word, from the layer's words in the planes of the eight corners.
#[inline]
fn masks(mut words: [u64; 8]) -> [u64; 8] {
    // Byte y of word `corner` becomes byte `corner` of word y: blocks of 4, 2 and 1 are exchanged across the diagonal.
    for (block, mask) in [(4, 0x0000_0000_ffff_ffff), (2, 0x0000_ffff_0000_ffff), (1, 0x00ff_00ff_00ff_00ff)] {
        for i in (0..8).filter(|i| i & block == 0) {
            let (low, high) = (words[i], words[i + block]);
            words[i] = (low & mask) | (high & mask) << (8 * block);
            words[i + block] = (low >> (8 * block) & mask) | (high & !mask);
        }
    }
    words.map(transposed)
}

/// The transposed matrix of 8 x 8 bits, a row in each byte (Warren, Hacker's Delight, 7-3).
pub(crate) fn transposed(mut bits: u64) -> u64 {
    for (distance, mask) in [(7, 0x00aa_00aa_00aa_00aa), (14, 0x0000_cccc_0000_cccc), (28, 0x0000_0000_f0f0_f0f0)] {
        let swap = (bits ^ bits >> distance) & mask;
        bits ^= swap ^ swap << distance;
    }
    bits
}

/// Positions a side of the table: a brick and the next layer.
const SIDE: usize = 9;
/// Positions of the table for one axis.
const LAYER: usize = SIDE * SIDE * SIDE;
/// The bits of a word with the least y, and those with the least z, which begin its rows.
const LOW_Y: u64 = 0xff;
const LOW_Z: u64 = 0x0101_0101_0101_0101;
/// Entries before a position's for one step along each axis.
const STEP: [usize; 3] = [SIDE * SIDE, SIDE, 1];

/// A crossed edge as a brick sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    pub(crate) axis: Axis,
    /// Its start, in cells from the least corner of the brick, 0 ..= 8 each.
    pub(crate) start: [u32; 3],
    /// Its place in the arrays of the octree.
    pub(crate) number: u32,
    /// Whether its start is inside, and so its end outside.
    pub(crate) starts_inside: bool,
}

/// Entries from that of a cell's first edge on, among which are those of all of its edges; a power of two, so that masked indices need no
/// check.
const REACH: usize = 2048;

/// One entry for each edge of a brick's cells. Entries of edges that are not crossed are stale. Behind the last layer is room for the
/// reach of the last cell.
pub(crate) struct EdgeTable<T>(Box<[T; 7 * (STEP[0] + STEP[1] + STEP[2]) + REACH]>);

/// Where bit b of a plane's word stands in a layer of the table.
static AT: [u8; 64] = {
    let mut at = [0; 64];
    let mut b = 0;
    while b < 64 {
        at[b] = ((b >> 3) * STEP[1] + (b & 7)) as u8;
        b += 1;
    }
    at
};

/// How far the entry of each edge of a cell is from that of its first edge. Sixteen, so that masked indices need no check.
static EDGE_AT: [u16; 16] = {
    assert!(2 * LAYER + STEP[0] + STEP[1] < REACH, "an edge along z is farthest");
    let mut at = [0; 16];
    let mut i = 0;
    while i < 12 {
        let start = Edge::ALL[i].corners()[0];
        let mut sum = Edge::ALL[i].axis().index() * LAYER;
        let mut a = 0;
        while a < 3 {
            if start.is_high(Axis::ALL[a]) {
                sum += STEP[a];
            }
            a += 1;
        }
        at[i] = sum as u16;
        i += 1;
    }
    at
};

/// Where the entry of an edge is among those [around](EdgeTable::around) a cell.
#[inline]
pub(crate) fn place_of(edge: Edge) -> u16 {
    EDGE_AT[edge.index() & 15]
}

impl<T: Copy> EdgeTable<T> {
    pub(crate) fn new(empty: T) -> Self {
        EdgeTable(Box::new([empty; 7 * (STEP[0] + STEP[1] + STEP[2]) + REACH]))
    }

    /// The entries of the edges of a cell of the brick last filled in. Only crossed edges have any.
    #[inline]
    pub(crate) fn at(&self, cell: Local) -> impl Fn(Edge) -> T + '_ {
        let entry = self.around(cell);
        move |edge| entry(place_of(edge))
    }

    /// The same by [`place_of`] an edge, for who looks those up beforehand.
    #[inline]
    pub(crate) fn around(&self, cell: Local) -> impl Fn(u16) -> T + '_ {
        let [x, y, z] = cell.coords().map(|c| c as usize);
        let first = x * STEP[0] + y * STEP[1] + z * STEP[2];
        let entries: &[T; REACH] = self.0[first..first + REACH].try_into().expect("as many");
        move |place| entries[usize::from(place) % REACH]
    }

    /// Makes an entry for each crossing round the cells of a brick.
    #[inline]
    pub(crate) fn fill(&mut self, cells: &Cells<'_>, mut entry: impl FnMut(Crossing) -> T) {
        let mut number = cells.edges.brick.first;
        for (axis, plane) in Axis::ALL.into_iter().zip(&cells.edges.brick.crossed) {
            for (x, &word) in plane.0.iter().enumerate() {
                let inside = cells.corners[0].0[x];
                for b in Bits(word) {
                    let start = [x as u32, b >> 3, b & 7];
                    self.0[axis.index() * LAYER + x * STEP[0] + usize::from(AT[b as usize])] =
                        entry(Crossing { axis, start, number, starts_inside: inside >> b & 1 == 1 });
                    number += 1;
                }
            }
        }
        let [px, py, pz, pxy, pxz, pyz] = cells.edges.plus;
        for (brick, axes, start, select) in [
            (px, &[Axis::Y, Axis::Z][..], [8, 0, 0], !0),
            (py, &[Axis::X, Axis::Z], [0, 8, 0], LOW_Y),
            (pz, &[Axis::X, Axis::Y], [0, 0, 8], LOW_Z),
            (pxy, &[Axis::Z], [8, 8, 0], LOW_Y),
            (pxz, &[Axis::Y], [8, 0, 8], LOW_Z),
            (pyz, &[Axis::X], [0, 8, 8], LOW_Y & LOW_Z),
        ] {
            for &axis in axes {
                self.fill_layer(brick, &cells.corners, axis, start, select, &mut entry);
            }
        }
    }

    /// The same for the edges along `axis` of a neighbouring brick at the selected bits, in the layer that touches this brick, which
    /// starts at `start`.
    fn fill_layer(
        &mut self,
        brick: &Brick,
        corners: &[Plane; 8],
        axis: Axis,
        start: [u32; 3],
        select: u64,
        entry: &mut impl FnMut(Crossing) -> T,
    ) {
        let [x0, y0, z0] = start.map(|c| c as usize);
        let at = axis.index() * LAYER + x0 * STEP[0] + y0 * STEP[1] + z0;
        let words = &brick.crossed[axis.index()].0[..if x0 == 0 { 8 } else { 1 }];
        if words.iter().all(|word| word & select == 0) {
            return;
        }
        // The layer's points are corners of the brick's last cells: which corners, and how far on their bits are.
        let [high_x, high_y, high_z] = start.map(|c| c >> 3);
        let corner = &corners[(high_x << 2 | high_y << 1 | high_z) as usize];
        let last = 56 * high_y + 7 * high_z;
        let mut before = brick.first + brick.crossed[..axis.index()].iter().map(Plane::count).sum::<u32>();
        for (x, &word) in words.iter().enumerate() {
            let inside = corner.0[if high_x == 1 { 7 } else { x }] >> last;
            let rows = row_ranks(word);
            for (i, b) in Bits(word & select).enumerate() {
                // All before it are selected, too, or it begins a row.
                let number = before + if select == LOW_Z { u32::from(rows[(b >> 3) as usize]) } else { i as u32 };
                let start = [start[0] + x as u32, start[1] + (b >> 3), start[2] + (b & 7)];
                self.0[at + x * STEP[0] + usize::from(AT[b as usize])] =
                    entry(Crossing { axis, start, number, starts_inside: inside >> b & 1 == 1 });
            }
            before += u32::from(rows[8]);
        }
    }
}

/// How many bits of a word are set before each of its eight rows, and in all. As fast without an instruction that counts bits.
fn row_ranks(word: u64) -> [u8; 9] {
    let mut counts = word - (word >> 1 & 0x5555_5555_5555_5555);
    counts = (counts & 0x3333_3333_3333_3333) + (counts >> 2 & 0x3333_3333_3333_3333);
    counts = (counts + (counts >> 4)) & 0x0f0f_0f0f_0f0f_0f0f;
    let sums = counts.wrapping_mul(LOW_Z).to_le_bytes();
    std::array::from_fn(|row| if row == 0 { 0 } else { sums[row - 1] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn ranks_count_the_bits_before(word: u64) {
            let ranks = row_ranks(word);
            (0..8).for_each(|row| assert_eq!(u32::from(ranks[row]), (word & ((1 << (8 * row)) - 1)).count_ones()));
            prop_assert_eq!(u32::from(ranks[8]), word.count_ones());
        }

        #[test]
        fn transposing_swaps_rows_and_columns(bits: u64) {
            let transposed = transposed(bits);
            for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
                prop_assert_eq!(bits >> (8 * i + j) & 1, transposed >> (8 * j + i) & 1);
            }
        }
    }
}
