//! All hits of a surface on the edges of the finest grid, with the side to which its faces are turned.
//!
//! [`Crossings`] know where a surface is, but not which side of a face is the outer one, and keep one crossing an edge. Whoever goes by
//! orientation, or looks at every wall on an edge, starts from here. An edge that is hit once, as nearly all are, costs its place in the
//! crossings and one bit; the hits of the others stand in a list beside.
//!
//! # Orientation
//!
//! A face is *left* where a walk along the edge's axis, upward, comes out on the side that its normal points to. With faces that are
//! oriented outward the walk leaves the solid there; where it does not leave, it enters.
//!
//! # Invariants ([`OrientedHits::validate`])
//!
//! - Those of [`Crossings`], of the edges with at least one hit; the sample is that of the middle hit (of two, the lower).
//! - One bit of orientation an edge: that of the middle hit.
//! - Edges with several hits are listed by place, each with its hits in order of offset, normal, orientation.
//!
//! # Cost
//!
//! 2 bytes (4 with normals) and a bit an edge, 232 bytes and an index entry a brick; 12 bytes more for an edge with several hits, and 6
//! for each of these. A byte a brick says how its hits are turned; where all agree, and they mostly do, nobody looks at single bits.

use super::crossings::{Brick, Builder, Crossings, Sample};
use crate::error::Result;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Key};
use crate::progress::{Progress, Silent};
use rayon::prelude::*;
use std::ops::Range;

/// One crossing of an edge by a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EdgeHit {
    /// Where, and how the face is sloped. Unlike the samples of [`Crossings`], those of several hits may lie at the very ends.
    pub sample: Sample,
    /// Whether a walk along the axis comes out on the outer side of the face.
    pub leaves: bool,
}

impl EdgeHit {
    /// By how much the winding number rises along the axis: 1 where the walk enters, -1 where it leaves.
    pub fn jump(self) -> i32 {
        if self.leaves { -1 } else { 1 }
    }
}

/// An edge with several hits.
#[derive(Debug, Clone, Copy)]
struct Several {
    /// Its place in the arrays of the crossings.
    place: u32,
    /// Number of such hits before its own.
    first: u32,
    /// Axis and position: `512 axis + local`.
    slot: u16,
}

/// All hits of a surface on the edges of a finest grid with 2^depth cells a side.
#[derive(Debug, Clone)]
pub struct OrientedHits {
    edges: Crossings,
    leaves: BitList,
    several: Vec<Several>,
    hits: Vec<EdgeHit>,
    /// One a brick.
    turns: Vec<Turns>,
}

/// How the hits of a brick are turned: for each axis, bit `2 axis` if some single hit enters, bit `2 axis + 1` if some leaves; both if some
/// edge has several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Turns(u8);

impl Turns {
    /// Those of several bricks.
    pub(crate) fn and(self, other: Turns) -> Turns {
        Turns(self.0 | other.0)
    }

    /// Whether along each axis all edges have one hit at most, and all of these one orientation.
    pub(crate) fn are_uniform(self) -> bool {
        self.0 & self.0 >> 1 & 0b01_01_01 == 0
    }

    /// Whether hits along `axis` leave, if all do the same.
    pub(crate) fn leave(self, axis: Axis) -> bool {
        self.0 >> (2 * axis.index() + 1) & 1 == 1
    }
}

impl OrientedHits {
    /// The edges with at least one hit, each with the sample of its middle hit.
    pub fn edges(&self) -> &Crossings {
        &self.edges
    }

    /// The same, and everything else is dropped.
    pub fn into_edges(self) -> Crossings {
        self.edges
    }

    /// Number of hits.
    pub fn len(&self) -> usize {
        self.edges.len() - self.several.len() + self.hits.len()
    }

    /// Whether nothing is hit.
    pub fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// Whether no edge has more than one hit.
    pub fn are_single(&self) -> bool {
        self.several.is_empty()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.edges.bytes()
            + self.leaves.words.capacity() * size_of::<u64>()
            + self.several.capacity() * size_of::<Several>()
            + self.hits.capacity() * size_of::<EdgeHit>()
            + self.turns.capacity()
    }

    /// Of the hit edges of a brick of [`edges`](Self::edges), those whose hit is left; for edges with several, the middle hit. Cost: a few
    /// operations a word where all hits of a word have one orientation, as most have; else one a hit.
    pub fn leaving(&self, brick: &Brick) -> [Plane; 3] {
        let mut place = brick.first as usize;
        brick.crossed.map(|plane| {
            Plane(plane.0.map(|word| {
                let bits = self.leaves.get(place, word.count_ones());
                place += word.count_ones() as usize;
                deposit(bits, word)
            }))
        })
    }

    /// How the hits of the brick at a place of [`edges`](Self::edges) are turned. Cost: none.
    pub(crate) fn turns(&self, brick: usize) -> Turns {
        self.turns[brick]
    }

    /// The edges of a brick that have several hits, in order of axis and position, with all their hits.
    pub fn several_in(&self, brick: &Brick) -> impl Iterator<Item = (Axis, Local, &[EdgeHit])> + Clone {
        let place_of = |place| self.several.partition_point(|s| s.place < place);
        let range =
            if self.several.is_empty() { 0..0 } else { place_of(brick.first)..place_of(brick.first + brick.count()) };
        range.map(|i| {
            let Several { first, slot, .. } = self.several[i];
            let end = self.several.get(i + 1).map_or(self.hits.len(), |next| next.first as usize);
            let axis = Axis::ALL[usize::from(slot >> 9)];
            (axis, Local::from_index(u32::from(slot)), &self.hits[first as usize..end])
        })
    }

    fn find_turns(&self, brick: &Brick) -> Turns {
        let mut place = brick.first as usize;
        let mut turns = 0;
        for axis in Axis::ALL {
            let n = brick.crossed[axis.index()].count() as usize;
            turns |= self.leaves.occurring(place..place + n) << (2 * axis.index());
            place += n;
        }
        self.several_in(brick).for_each(|(axis, ..)| turns |= 0b11 << (2 * axis.index()));
        Turns(turns)
    }

    /// Calls `each` with every hit edge of a brick, in order of axis and position, and with its hits from the edge's start to its end.
    pub fn for_edges(&self, brick: &Brick, mut each: impl FnMut(Axis, Local, &[EdgeHit])) {
        let leaving = self.leaving(brick);
        let mut several = self.several_in(brick).peekable();
        let mut place = brick.first as usize;
        for axis in Axis::ALL {
            for local in brick.crossed[axis.index()].iter() {
                if let Some((_, _, hits)) = several.next_if(|&(a, l, _)| (a, l) == (axis, local)) {
                    each(axis, local, hits);
                } else {
                    let leaves = leaving[axis.index()].get(local);
                    each(axis, local, &[EdgeHit { sample: self.edges.sample_at(place), leaves }]);
                }
                place += 1;
            }
        }
    }

    /// The first broken invariant, in words. Cost: linear.
    ///
    /// # Errors
    /// Describes the violation and names its key or place.
    pub fn validate(&self) -> Result<(), String> {
        self.edges.validate()?;
        if self.leaves.len != self.edges.len() {
            return Err(format!("{} edges, but {} orientations", self.edges.len(), self.leaves.len));
        }
        if !self.several.is_sorted_by(|a, b| a.place < b.place && a.first < b.first) {
            return Err("edges with several hits are not in order".to_owned());
        }
        let mut listed = 0;
        for brick in self.edges.bricks().iter() {
            let leaving = self.leaving(brick);
            let place = self.edges.find(brick.key).expect("it is listed");
            if self.turns.get(place) != Some(&self.find_turns(brick)) {
                return Err(format!("brick {} is turned otherwise than it says", brick.key));
            }
            for (axis, local, hits) in self.several_in(brick) {
                listed += 1;
                let at = format!("axis {} at {:?} of brick {}", axis.index(), local.coords(), brick.key);
                if hits.len() < 2 || !hits.is_sorted() {
                    return Err(format!("{at}: {} hits, or not in order", hits.len()));
                }
                if !brick.crossed[axis.index()].get(local) {
                    return Err(format!("{at}: hits on an edge without any"));
                }
                let middle = hits[(hits.len() - 1) / 2];
                let Sample { offset, normal } = middle.sample;
                if self.edges.sample_at(brick.place(axis, local)) != Sample::new(offset, normal)
                    || leaving[axis.index()].get(local) != middle.leaves
                {
                    return Err(format!("{at}: its sample is not the middle hit's"));
                }
            }
        }
        if listed == self.several.len() { Ok(()) } else { Err("hits on edges of no brick".to_owned()) }
    }
}

/// Puts [`OrientedHits`] together from bricks in ascending order of keys.
#[derive(Debug)]
pub struct HitsBuilder {
    edges: Builder,
    leaves: BitList,
    several: Vec<Several>,
    hits: Vec<EdgeHit>,
}

/// The hits of some bricks on their way to the builder: hit edges in order, the same as in the arrays of [`OrientedHits`].
#[derive(Debug, Default)]
pub struct HitBatch {
    leaves: BitList,
    /// Places count from the batch's first edge, hits from its first hit.
    several: Vec<Several>,
    hits: Vec<EdgeHit>,
}

impl HitBatch {
    /// Makes room for some edges.
    pub fn reserve(&mut self, edges: usize) {
        self.leaves.words.reserve_exact(edges.div_ceil(64));
    }

    /// Appends an edge with a single hit.
    #[inline]
    pub fn push(&mut self, leaves: bool) {
        self.leaves.push(leaves);
    }

    /// Appends an edge with several hits, in order; the sample of the middle one is its own.
    pub fn push_several(&mut self, axis: Axis, local: Local, hits: impl Iterator<Item = EdgeHit>) {
        let first = self.hits.len();
        self.hits.extend(hits);
        let middle = self.hits[first + (self.hits.len() - first - 1) / 2];
        let slot = (axis.index() as u16) << 9 | local.index() as u16;
        self.several.push(Several { place: self.leaves.len as u32, first: first as u32, slot });
        self.leaves.push(middle.leaves);
    }
}

impl HitsBuilder {
    /// Starts without bricks.
    pub fn new(depth: u32, with_normals: bool) -> Self {
        let (leaves, several, hits) = Default::default();
        HitsBuilder { edges: Builder::new(depth, with_normals), leaves, several, hits }
    }

    /// Appends a brick with the samples of its hit edges, as [`Builder::push`] does. Their orientations come in a batch that is appended
    /// before or after.
    ///
    /// # Panics
    /// As [`Builder::push`].
    pub fn push(&mut self, key: Key, hit: [Plane; 3], offsets: &[u16], normals: &[u16]) {
        self.edges.push(key, hit, offsets, normals);
    }

    /// Appends the orientations of the next edges.
    ///
    /// # Panics
    /// Beyond 2^32 hits.
    pub fn append(&mut self, batch: &HitBatch) {
        let place = u32::try_from(self.leaves.len).expect("fewer than 2^32 edges");
        let first = u32::try_from(self.hits.len()).expect("fewer than 2^32 hits");
        let moved = |s: &Several| Several { place: s.place + place, first: s.first + first, ..*s };
        self.several.extend(batch.several.iter().map(moved));
        self.hits.extend_from_slice(&batch.hits);
        self.leaves.append(&batch.leaves);
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.edges.bytes()
            + self.leaves.words.capacity() * size_of::<u64>()
            + self.several.capacity() * size_of::<Several>()
            + self.hits.capacity() * size_of::<EdgeHit>()
    }

    /// Adds what the invariants of [`Crossings`] ask for.
    ///
    /// # Panics
    /// When there are not as many orientations as edges.
    pub fn finish(self) -> OrientedHits {
        self.finish_within(&Silent).expect("nothing is refused or cancelled")
    }

    /// The same, within the memory that `progress` allows.
    ///
    /// # Errors
    /// Whatever [`Progress::hold`] returns.
    ///
    /// # Panics
    /// When there are not as many orientations as edges.
    pub fn finish_within(self, progress: &dyn Progress) -> Result<OrientedHits> {
        let edges = self.edges.finish_within(progress)?;
        assert_eq!(self.leaves.len, edges.len(), "one orientation an edge");
        let HitsBuilder { leaves, several, hits, .. } = self;
        let turns = Vec::new();
        let mut made = OrientedHits { edges, leaves, several, hits, turns };
        made.turns =
            (0..made.edges.bricks().len()).into_par_iter().map(|i| made.find_turns(&made.edges.bricks()[i])).collect();
        Ok(made)
    }
}

/// A list of bits. Being short, it is a plain vector.
#[derive(Debug, Clone, Default)]
struct BitList {
    /// 64 bits a word, the first in the lowest place; bits beyond the end are 0.
    words: Vec<u64>,
    len: usize,
}

impl BitList {
    #[inline]
    fn push(&mut self, bit: bool) {
        if self.len.is_multiple_of(64) {
            self.words.push(0);
        }
        let last = self.words.len() - 1;
        self.words[last] |= u64::from(bit) << (self.len & 63);
        self.len += 1;
    }

    fn append(&mut self, other: &BitList) {
        let shift = self.len & 63;
        self.len += other.len;
        for &word in &other.words {
            if shift == 0 {
                self.words.push(word);
            } else {
                let last = self.words.len() - 1;
                self.words[last] |= word << shift;
                self.words.push(word >> (64 - shift));
            }
        }
        // The last word of `other` may have ended within the last but one of ours.
        self.words.truncate(self.len.div_ceil(64));
    }

    /// Bit 0 if any bit of a range is 0, bit 1 if any is 1.
    fn occurring(&self, mut range: Range<usize>) -> u8 {
        let mut found = 0;
        while !range.is_empty() {
            let n = range.len().min(64);
            let bits = self.get(range.start, n as u32);
            found |= u8::from(bits != !0 >> (64 - n)) | u8::from(bits != 0) << 1;
            range.start += n;
        }
        found
    }

    /// `n` bits, at most 64, from place `from` on.
    #[inline]
    fn get(&self, from: usize, n: u32) -> u64 {
        if n == 0 {
            return 0;
        }
        let (word, shift) = (from >> 6, from & 63);
        let mut bits = self.words[word] >> shift;
        if shift + n as usize > 64 {
            bits |= self.words[word + 1] << (64 - shift);
        }
        bits & (!0 >> (64 - n))
    }
}

/// The lowest bits of `bits`, one by one, at the set places of `mask`.
#[inline]
fn deposit(mut bits: u64, mask: u64) -> u64 {
    if bits == 0 {
        return 0;
    }
    if bits.count_ones() == mask.count_ones() {
        return mask;
    }
    let (mut rest, mut out) = (mask, 0);
    while bits != 0 {
        let low = rest & rest.wrapping_neg();
        out |= low & (bits & 1).wrapping_neg();
        bits >>= 1;
        rest ^= low;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bits_are_a_list(parts in prop::collection::vec(prop::collection::vec(any::<bool>(), 0..200), 0..6), n in 1u32..=64) {
            let (mut list, mut plain) = (BitList::default(), Vec::new());
            for part in &parts {
                let mut one = BitList::default();
                part.iter().for_each(|&bit| one.push(bit));
                list.append(&one);
                plain.extend_from_slice(part);
            }
            prop_assert_eq!(list.len, plain.len());
            for (i, window) in plain.windows(n as usize).enumerate() {
                let expected = window.iter().rev().fold(0u64, |bits, &bit| bits << 1 | u64::from(bit));
                prop_assert_eq!(list.get(i, n), expected);
                let any = |bit| u8::from(window.contains(&bit));
                prop_assert_eq!(list.occurring(i..i + n as usize), any(false) | any(true) << 1);
            }
        }

        #[test]
        fn deposited_bits_keep_their_order(bits: u64, mask: u64) {
            let n = mask.count_ones();
            let bits = if n == 0 { 0 } else { bits & (!0 >> (64 - n)) };
            let placed = deposit(bits, mask);
            let taken = (0..64).filter(|i| mask >> i & 1 == 1).map(|i| placed >> i & 1);
            prop_assert_eq!(placed & !mask, 0);
            prop_assert_eq!(taken.rev().fold(0u64, |word, bit| word << 1 | bit), bits);
        }
    }
}
