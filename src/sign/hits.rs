//! Hits on their way from the rasteriser to the bricks.
//!
//! Triangles come in any order, bricks want their hits together. So each thread drops the hits of its triangles into
//! buckets, one for each block of 8 x 8 x 8 bricks (64^3 cells); later every block is sorted and resolved by itself.
//!
//! A hit is 8 bytes: which edge of the block (brick 9 bits, axis 2, position in the brick 9), where on the edge (16 bits),
//! the code of the normal (16 bits) and the orientation (1 bit). Sorting the 64-bit words brings the hits of an edge together, edges in the order in
//! which bricks store them. Buckets grow by chunks of 4 KB which are never moved.

use crate::geom::normal::NormalCode;
use crate::geom::raster::Hits;
use crate::grid::Axis;
use hashbrown::HashMap;

/// Cells a side of a block.
const BLOCK_SHIFT: u32 = 6;
/// Hits in a chunk.
const CHUNK: usize = 512;

/// One crossing of a lattice edge by a triangle, inside a known block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Hit(u64);

impl Hit {
    /// The brick's number in the block, in Z-order.
    pub(super) fn brick(self) -> u32 {
        (self.0 >> 44) as u32
    }

    /// Brick, axis and position in one number: equal for hits on the same edge.
    pub(super) fn slot(self) -> u32 {
        (self.0 >> 33) as u32
    }

    /// The edge's axis: 0, 1, 2 for x, y, z.
    pub(super) fn axis(self) -> usize {
        (self.0 >> 42) as usize & 3
    }

    /// The edge's position in its brick.
    pub(super) fn local(self) -> u32 {
        (self.0 >> 33) as u32 & 511
    }

    /// 65536ths of a cell from the edge's start.
    pub(super) fn offset(self) -> u16 {
        (self.0 >> 17) as u16
    }

    pub(super) fn normal(self) -> NormalCode {
        NormalCode((self.0 >> 1) as u16)
    }

    /// Whether who walks along the axis goes out here, as the triangle is oriented.
    pub(super) fn leaves(self) -> bool {
        self.0 & 1 == 1
    }
}

/// Brick coordinates in the block (0..8 each) to the brick's number, z lowest.
const fn interleave3(x: u32, y: u32, z: u32) -> u32 {
    let mut code = 0;
    let mut bit = 0;
    while bit < 3 {
        code |= (x >> bit & 1) << (3 * bit + 2) | (y >> bit & 1) << (3 * bit + 1) | (z >> bit & 1) << (3 * bit);
        bit += 1;
    }
    code
}

/// The brick's coordinates in its block, from its number: inverse of the order of [`Hit::brick`].
pub(super) const fn brick_coords(number: u32) -> [u32; 3] {
    let mut c = [0; 3];
    let mut bit = 0;
    while bit < 3 {
        c[0] |= (number >> (3 * bit + 2) & 1) << bit;
        c[1] |= (number >> (3 * bit + 1) & 1) << bit;
        c[2] |= (number >> (3 * bit) & 1) << bit;
        bit += 1;
    }
    c
}

/// What a coordinate within the block contributes to a slot: for each axis, by coordinate.
static SLOT_BITS: [[u32; 64]; 3] = slot_bits();

const fn slot_bits() -> [[u32; 64]; 3] {
    let mut table = [[0; 64]; 3];
    let mut c = 0;
    while c < 64 {
        let (brick, cell) = (c as u32 >> 3, c as u32 & 7);
        table[0][c] = interleave3(brick, 0, 0) << 11 | cell << 6;
        table[1][c] = interleave3(0, brick, 0) << 11 | cell << 3;
        table[2][c] = interleave3(0, 0, brick) << 11 | cell;
        c += 1;
    }
    table
}

/// The hits of one block, as one thread found them.
#[derive(Debug, Default)]
pub(super) struct Bucket {
    full: Vec<Vec<Hit>>,
    open: Vec<Hit>,
}

impl Bucket {
    #[cold]
    fn next_chunk(&mut self) {
        let full = std::mem::replace(&mut self.open, Vec::with_capacity(CHUNK));
        if !full.is_empty() {
            self.full.push(full);
        }
    }

    /// Moves all hits to the end of `hits`; every chunk is freed as soon as it is copied.
    pub(super) fn drain_into(self, hits: &mut Vec<Hit>) {
        for chunk in self.full.into_iter().chain([self.open]) {
            hits.extend_from_slice(&chunk);
        }
    }
}

/// Coordinates of a block, in blocks.
pub(super) type BlockCoords = [u32; 3];

/// Sorts hits into the buckets of their blocks.
#[derive(Debug)]
pub(super) struct HitSorter {
    buckets: Vec<(BlockCoords, Bucket)>,
    by_block: HashMap<BlockCoords, usize, ahash::RandomState>,
    /// The block of the last hit, and its bucket.
    current: Option<(BlockCoords, usize)>,
    /// Axis, normal and orientation of the triangle at work, in place.
    plane: u64,
    with_normals: bool,
}

impl HitSorter {
    pub(super) fn new(with_normals: bool) -> Self {
        HitSorter {
            buckets: Vec::new(),
            by_block: HashMap::with_hasher(ahash::RandomState::with_seeds(1, 2, 3, 4)),
            current: None,
            plane: 0,
            with_normals,
        }
    }

    pub(super) fn into_buckets(self) -> Vec<(BlockCoords, Bucket)> {
        self.buckets
    }

    #[cold]
    fn turn_to(&mut self, block: BlockCoords) -> usize {
        let bucket = *self.by_block.entry(block).or_insert_with(|| {
            self.buckets.push((block, Bucket::default()));
            self.buckets.len() - 1
        });
        self.current = Some((block, bucket));
        bucket
    }
}

impl Hits for HitSorter {
    #[inline]
    fn plane(&mut self, axis: Axis, normal: [f64; 3]) {
        let code = if self.with_normals { NormalCode::encode(axis, normal) } else { NormalCode(0) };
        self.plane = (axis.index() as u64) << 42 | u64::from(code.0) << 1 | u64::from(normal[axis.index()] > 0.0);
    }

    #[inline]
    fn hit(&mut self, _: Axis, at: [u32; 3], offset: u16) {
        let block = at.map(|c| c >> BLOCK_SHIFT);
        let bucket = match self.current {
            Some((current, bucket)) if current == block => bucket,
            _ => self.turn_to(block),
        };
        let [x, y, z] = at.map(|c| c as usize & 63);
        let slot = SLOT_BITS[0][x] | SLOT_BITS[1][y] | SLOT_BITS[2][z];
        let hit = Hit(u64::from(slot) << 33 | u64::from(offset) << 17 | self.plane);
        let bucket = &mut self.buckets[bucket].1;
        if bucket.open.len() == bucket.open.capacity() {
            bucket.next_chunk();
        }
        bucket.open.push(hit);
    }
}

/// Sorts hits by edge, then by offset, normal and orientation. Returns whether some edge has several.
#[inline(never)]
pub(super) fn sort_hits(hits: &mut Vec<Hit>, scratch: &mut Vec<Hit>) -> bool {
    const DIGIT: u32 = 10;
    if hits.len() < 512 {
        hits.sort_unstable();
        return hits.windows(2).any(|pair| pair[0].slot() == pair[1].slot());
    }
    // Two stable passes over the 20 bits of the slot; hits that share an edge are few and sorted afterwards.
    scratch.resize(hits.len(), Hit(0));
    let digit = |h: Hit, shift: u32| (h.0 >> shift) as usize & ((1 << DIGIT) - 1);
    let mut next = [[0u32; 1 << DIGIT]; 2];
    for &h in hits.iter() {
        next[0][digit(h, 33)] += 1;
        next[1][digit(h, 33 + DIGIT)] += 1;
    }
    for (shift, next) in [33, 33 + DIGIT].into_iter().zip(&mut next) {
        let mut sum = 0;
        for n in next.iter_mut() {
            sum += std::mem::replace(n, sum);
        }
        for &h in hits.iter() {
            let place = &mut next[digit(h, shift)];
            scratch[*place as usize] = h;
            *place += 1;
        }
        std::mem::swap(hits, scratch);
    }
    let mut repeated = false;
    let mut i = 1;
    while i < hits.len() {
        if hits[i - 1].slot() == hits[i].slot() {
            let end = i + hits[i..].iter().take_while(|h| h.slot() == hits[i].slot()).count();
            hits[i - 1..end].sort_unstable();
            repeated = true;
            i = end;
        }
        i += 1;
    }
    repeated
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_taken_apart_again() {
        let mut sorter = HitSorter::new(true);
        let at = [64 + 8 * 5 + 3, 8 * 2 + 7, 128 + 8 * 7 + 1];
        sorter.plane(Axis::Y, [0.0, 2.0, 0.0]);
        sorter.hit(Axis::Y, at, 999);
        let (block, bucket) = sorter.into_buckets().pop().unwrap();
        assert_eq!(block, [1, 0, 2]);
        let mut hits = Vec::new();
        bucket.drain_into(&mut hits);
        assert_eq!(brick_coords(hits[0].brick()), [5, 2, 7]);
        assert_eq!((hits[0].local(), hits[0].axis(), hits[0].offset()), (64 * 3 + 8 * 7 + 1, 1, 999));
        assert_eq!(hits[0].normal().decode(Axis::Y), glam::Vec3A::Y);
        assert!(hits[0].leaves());
    }

    #[test]
    fn radix_sort_sorts() {
        let mut state = 1u64;
        let mut hits: Vec<_> = (0..5000)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                Hit((state >> 11) & !(0xfff << 41))
            })
            .collect();
        let mut expected = hits.clone();
        expected.sort_unstable();
        sort_hits(&mut hits, &mut Vec::new());
        assert_eq!(hits, expected);
    }
}
