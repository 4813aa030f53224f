//! Hits on their way from the rasteriser to the bricks.
//!
//! Triangles come in any order, bricks want their hits together. So each thread drops the hits of its triangles into
//! buckets, one for each block of 8 x 8 x 8 bricks (64^3 cells); later every block is sorted and resolved by itself.
//!
//! A hit is 8 bytes: which edge of the block (brick 9 bits, axis 2, position in the brick 9), where on the edge (16 bits),
//! the code of the normal (16 bits) and the orientation (1 bit). Sorting the 64-bit words brings the hits of an edge together, edges in
//! the order in which bricks store them. Buckets grow by chunks which are never moved: the first holds 64 hits, later ones twice as many
//! as the one before, up to 4 KB. All chunks are noted in a [`Ledger`], and where they become too many, hits are dropped from then on.

use crate::error::{Error, Result};
use crate::geom::normal::NormalCode;
use crate::geom::raster::Hits;
use crate::grid::Axis;
use crate::progress::{Progress, check};
use hashbrown::HashMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Cells a side of a block.
const BLOCK_SHIFT: u32 = 6;
/// Hits in the first chunk of a bucket, and in its largest.
const CHUNKS: [usize; 2] = [64, 512];
/// Bytes of a bucket without its hits: its place in the list, which may be half empty, and in the map.
const BUCKET: u64 = 2 * 80 + 2 * 25;
/// Bytes of a chunk beyond its hits: its place in the list of chunks, which may be half empty, and what the allocator needs.
const CHUNK: u64 = 2 * 24 + 16;

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

/// What the buckets of all threads hold, and whether that is too much.
pub(super) struct Ledger<'a> {
    bytes: AtomicU64,
    is_enough: AtomicBool,
    error: Mutex<Option<Error>>,
    progress: &'a dyn Progress,
}

impl<'a> Ledger<'a> {
    pub(super) fn new(progress: &'a dyn Progress) -> Self {
        Ledger { bytes: AtomicU64::new(0), is_enough: AtomicBool::new(false), error: Mutex::new(None), progress }
    }

    /// Bytes noted.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Notes bytes that are about to be taken; `false` if that is too much, or the caller wants to stop.
    fn note(&self, bytes: u64) -> bool {
        let total = self.bytes.fetch_add(bytes, Ordering::Relaxed) + bytes;
        let held = check(self.progress).and_then(|()| self.progress.hold(total));
        if let Err(error) = held {
            self.error.lock().expect("noting does not panic").get_or_insert(error);
            self.is_enough.store(true, Ordering::Relaxed);
        }
        !self.is_enough()
    }

    fn is_enough(&self) -> bool {
        self.is_enough.load(Ordering::Relaxed)
    }

    /// The reason to stop, if there is any.
    pub(super) fn result(&self) -> Result<()> {
        self.error.lock().expect("noting does not panic").take().map_or(Ok(()), Err)
    }
}

/// The hits of one block, as one thread found them.
#[derive(Debug, Default)]
pub(super) struct Bucket {
    full: Vec<Vec<Hit>>,
    open: Vec<Hit>,
}

impl Bucket {
    #[cold]
    fn next_chunk(&mut self, ledger: &Ledger<'_>) {
        let [least, most] = CHUNKS;
        let hits = (2 * self.open.capacity()).clamp(least, most);
        if !ledger.note((hits * size_of::<Hit>()) as u64 + CHUNK) {
            self.open.clear();
            return;
        }
        let full = std::mem::replace(&mut self.open, Vec::with_capacity(hits));
        if !full.is_empty() {
            self.full.push(full);
        }
    }

    /// Bytes held by the hits.
    pub(super) fn bytes(&self) -> u64 {
        let chunks = self.full.iter().chain([&self.open]);
        chunks.map(|chunk| (chunk.capacity() * size_of::<Hit>()) as u64).sum()
    }

    /// Its hits, as they lie in its chunks.
    fn chunks(&self) -> impl Iterator<Item = &[Hit]> {
        self.full.iter().chain([&self.open]).map(Vec::as_slice)
    }
}

/// Coordinates of a block, in blocks.
pub(super) type BlockCoords = [u32; 3];

/// Sorts hits into the buckets of their blocks.
pub(super) struct HitSorter<'a> {
    ledger: &'a Ledger<'a>,
    buckets: Vec<(BlockCoords, Bucket)>,
    by_block: HashMap<BlockCoords, usize, ahash::RandomState>,
    /// The least point of the last hit's block, at first of none, and the block's bucket.
    current: ([u32; 3], usize),
    /// Axis, normal and orientation of the triangle at work, in place.
    plane: u64,
    with_normals: bool,
}

impl<'a> HitSorter<'a> {
    pub(super) fn new(ledger: &'a Ledger<'a>, with_normals: bool) -> Self {
        HitSorter {
            ledger,
            buckets: Vec::new(),
            by_block: HashMap::with_hasher(ahash::RandomState::with_seeds(1, 2, 3, 4)),
            current: ([u32::MAX; 3], 0),
            plane: 0,
            with_normals,
        }
    }

    pub(super) fn into_buckets(self) -> Vec<(BlockCoords, Bucket)> {
        self.buckets
    }

    #[cold]
    fn turn_to(&mut self, at: [u32; 3]) -> usize {
        let block = at.map(|c| c >> BLOCK_SHIFT);
        let bucket = match self.by_block.get(&block) {
            Some(&bucket) => bucket,
            // Any bucket will do for hits that are dropped.
            None if !self.ledger.note(BUCKET) && !self.buckets.is_empty() => return 0,
            None => {
                let bucket = self.buckets.len();
                self.buckets.push((block, Bucket::default()));
                self.by_block.insert(block, bucket);
                bucket
            }
        };
        self.current = (block.map(|c| c << BLOCK_SHIFT), bucket);
        bucket
    }
}

impl Hits for HitSorter<'_> {
    #[inline]
    fn plane(&mut self, axis: Axis, normal: [f64; 3]) {
        let code = if self.with_normals { NormalCode::encode(axis, normal) } else { NormalCode(0) };
        self.plane = (axis.index() as u64) << 42 | u64::from(code.0) << 1 | u64::from(normal[axis.index()] > 0.0);
    }

    #[inline]
    fn hit(&mut self, _: Axis, at: [u32; 3], offset: u16) {
        let (from, bucket) = self.current;
        let is_elsewhere = ((at[0] ^ from[0]) | (at[1] ^ from[1]) | (at[2] ^ from[2])) >> BLOCK_SHIFT != 0;
        let bucket = if is_elsewhere { self.turn_to(at) } else { bucket };
        let [x, y, z] = at.map(|c| c as usize & 63);
        let slot = SLOT_BITS[0][x] | SLOT_BITS[1][y] | SLOT_BITS[2][z];
        let hit = Hit(u64::from(slot) << 33 | u64::from(offset) << 17 | self.plane);
        let bucket = &mut self.buckets[bucket].1;
        if bucket.open.len() == bucket.open.capacity() {
            bucket.next_chunk(self.ledger);
        }
        bucket.open.push(hit);
    }

    fn is_enough(&self) -> bool {
        self.ledger.is_enough()
    }
}

/// Whether some edge has several of the sorted hits.
pub(super) fn is_repeated(hits: &[Hit]) -> bool {
    hits.windows(2).any(|pair| pair[0].slot() == pair[1].slot())
}

/// The hits of some buckets, sorted by edge, then by offset, normal and orientation, to `hits`; what was there before is lost.
#[inline(never)]
pub(super) fn sort_hits(buckets: &[Bucket], hits: &mut Vec<Hit>, scratch: &mut Vec<Hit>) {
    const DIGIT: u32 = 10;
    let count = buckets.iter().flat_map(Bucket::chunks).map(<[Hit]>::len).sum();
    if count < 512 {
        hits.clear();
        buckets.iter().flat_map(Bucket::chunks).for_each(|chunk| hits.extend_from_slice(chunk));
        return hits.sort_unstable();
    }
    // Two stable passes over the 20 bits of the slot; hits that share an edge are few and sorted afterwards.
    let digit = |h: Hit, shift: u32| (h.0 >> shift) as usize & ((1 << DIGIT) - 1);
    let mut next = [[0u32; 1 << DIGIT]; 2];
    for &h in buckets.iter().flat_map(Bucket::chunks).flatten() {
        next[0][digit(h, 33)] += 1;
        next[1][digit(h, 33 + DIGIT)] += 1;
    }
    for next in &mut next {
        let mut sum = 0;
        for n in next.iter_mut() {
            sum += std::mem::replace(n, sum);
        }
    }
    let [low, high] = &mut next;
    let scatter = |from: &[Hit], shift: u32, next: &mut [u32; 1 << DIGIT], to: &mut [Hit]| {
        for &h in from {
            let place = &mut next[digit(h, shift)];
            to[*place as usize] = h;
            *place += 1;
        }
    };
    scratch.resize(count, Hit(0));
    buckets.iter().flat_map(Bucket::chunks).for_each(|chunk| scatter(chunk, 33, low, scratch));
    hits.resize(count, Hit(0));
    scatter(scratch, 33 + DIGIT, high, hits);
    let mut i = 1;
    while i < hits.len() {
        if hits[i - 1].slot() == hits[i].slot() {
            let end = i + hits[i..].iter().take_while(|h| h.slot() == hits[i].slot()).count();
            hits[i - 1..end].sort_unstable();
            i = end;
        }
        i += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    /// Lets a million bytes be held.
    struct Million;

    impl Progress for Million {
        fn hold(&self, bytes: u64) -> Result<()> {
            let limit = 1_000_000;
            if bytes <= limit { Ok(()) } else { Err(Error::Memory { needed: bytes, limit, remedy: String::new() }) }
        }
    }

    #[test]
    fn hits_beyond_the_limit_are_dropped() {
        // Many in one block; one in each of many blocks.
        for shift in [0, BLOCK_SHIFT] {
            let ledger = Ledger::new(&Million);
            let mut sorter = HitSorter::new(&ledger, false);
            sorter.plane(Axis::X, [1.0, 0.0, 0.0]);
            let mut wanted = 0;
            while !sorter.is_enough() {
                sorter.hit(Axis::X, [wanted << shift & 0x3_ffff, 0, 0], 5);
                wanted += 1;
            }
            (0..100_000).for_each(|i| sorter.hit(Axis::X, [i << shift & 0x3_ffff, 0, 0], 5));
            assert!(matches!(ledger.result(), Err(Error::Memory { limit: 1_000_000, .. })));
            let buckets = sorter.into_buckets();
            let held: u64 = buckets.iter().map(|(_, bucket)| bucket.bytes()).sum();
            assert!((100_000..1_010_000).contains(&held), "{held}");
            assert!(wanted > 1000 && buckets.len() <= wanted as usize);
        }
    }

    #[test]
    fn slots_are_taken_apart_again() {
        let ledger = Ledger::new(&Silent);
        let mut sorter = HitSorter::new(&ledger, true);
        let at = [64 + 8 * 5 + 3, 8 * 2 + 7, 128 + 8 * 7 + 1];
        sorter.plane(Axis::Y, [0.0, 2.0, 0.0]);
        sorter.hit(Axis::Y, at, 999);
        let (block, bucket) = sorter.into_buckets().pop().unwrap();
        assert_eq!(block, [1, 0, 2]);
        let mut hits = Vec::new();
        sort_hits(&[bucket], &mut hits, &mut Vec::new());
        assert_eq!(brick_coords(hits[0].brick()), [5, 2, 7]);
        assert_eq!((hits[0].local(), hits[0].axis(), hits[0].offset()), (64 * 3 + 8 * 7 + 1, 1, 999));
        assert_eq!(hits[0].normal().decode(Axis::Y), glam::Vec3A::Y);
        assert!(hits[0].leaves());
    }

    #[test]
    fn radix_sort_sorts() {
        let mut state = 1u64;
        let mut next = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            Hit((state >> 11) & !(0xfff << 41))
        };
        // Few hits are sorted in another way than many.
        for count in [0, 300, 5000] {
            let mut expected: Vec<_> = (0..count).map(&mut next).collect();
            let (first, last) = expected.split_at(count / 3);
            let buckets = [first, last].map(|hits| {
                let (full, open) = hits.split_at(hits.len() / 2);
                Bucket { full: vec![full.to_vec()], open: open.to_vec() }
            });
            expected.sort_unstable();
            let mut hits = vec![Hit(7); 1000];
            sort_hits(&buckets, &mut hits, &mut Vec::new());
            assert_eq!(hits, expected);
        }
    }
}
