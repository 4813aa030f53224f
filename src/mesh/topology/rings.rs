//! How sides find those along the same edge.
//!
//! # How
//!
//! Every side belongs to the lower of its points. Points are cut into ranges, and sides are first brought into the range of their point, as
//! records that hold all that is needed, so that from then on only memory that is in the cache is visited in no order: counted by point,
//! sorted by the other end, linked. What is visited at random is written once, each side's place in the ring. (Looking at the sides from
//! the points misses the cache twice a corner when faces are shuffled.) Records of a quarter of all sides are held at a time.
//!
//! # Cost
//!
//! Six passes over the corners in order, and one random write a side. Beside what stays, 9 bytes a triangle while it is made. Ten million
//! triangles take 1.4 s of CPU time if faces are shuffled, where looking from the points takes 3.5, and 0.9 if they are in order, where that
//! takes 0.5.

use super::super::corners::Corners;
use super::super::star::repeated;
use super::FaceState;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering::Relaxed};

/// At most so many ranges of points.
const RANGES: usize = 2048;
/// Points of a range, at least: log2.
const LEAST_RANGE: u32 = 10;
/// Sides below which all records are held at once.
const SMALL: usize = 1 << 16;
/// How many times otherwise.
const WAVES: u64 = 4;
/// Users of an edge up to which going round its ring is nothing.
pub(super) const FEW: usize = 8;

/// Sides along the same edge, and what that says of faces.
pub(super) struct Rings {
    /// The next side along the same edge.
    pub(super) next: Vec<u32>,
    /// Bits of [`FaceState`].
    pub(super) states: Vec<u8>,
    /// The sides of edges with more than a few users, ascending.
    pub(super) crowds: Vec<Crowd>,
}

/// A side of an edge with more than a few users.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Crowd {
    /// The side.
    pub(super) side: u32,
    /// The lowest side of the edge.
    pub(super) lowest: u32,
    /// Number of users.
    pub(super) users: u32,
}

/// A side in the range of its lower point.
#[derive(Clone, Copy, Default)]
struct Record {
    /// The lower point, counted from the first of its range, twice; and 1 if the side leaves it.
    low: u32,
    high: u32,
    side: u32,
}

impl Record {
    fn key(&self) -> u64 {
        (u64::from(self.high) << 32) | u64::from(self.side)
    }
}

/// Where records go.
struct Plan<'a, 'm> {
    corners: &'a Corners<'m>,
    states: &'a [AtomicU8],
    /// log2 of the points of a range.
    bits: u32,
    ranges: usize,
    /// Pieces of the faces, one a thread.
    pieces: Vec<Range<usize>>,
}

impl Plan<'_, '_> {
    /// Calls with the lower point, the higher one, the side and whether it leaves the lower one, for all sides of a piece.
    fn each(&self, piece: Range<usize>, mut visit: impl FnMut(u32, u32, u32, bool)) {
        let polygons = &self.corners.mesh().faces;
        let mut see = |from: u32, to: u32, side: u32| {
            if from != to {
                visit(from.min(to), from.max(to), side, from < to);
            }
        };
        if self.corners.are_triangles() {
            let range = 3 * piece.start..3 * piece.end;
            let all = polygons.corners()[range.clone()].as_chunks::<3>().0;
            for ((&[a, b, c], state), side) in
                all.iter().zip(&self.states[piece]).zip((range.start as u32..).step_by(3))
            {
                if state.load(Relaxed) & FaceState::UNSOUND.0 == 0 {
                    see(a, b, side);
                    see(b, c, side + 1);
                    see(c, a, side + 2);
                }
            }
            return;
        }
        for i in piece.filter(|&i| self.states[i].load(Relaxed) & FaceState::UNSOUND.0 == 0) {
            let (face, start) = (polygons.get(i), polygons.range(i).start as u32);
            let ends = face.iter().zip(face.iter().cycle().skip(1));
            ends.zip(start..).for_each(|((&a, &b), side)| see(a, b, side));
        }
    }

    /// How many sides of each piece belong to each range.
    fn counts(&self) -> Vec<Vec<u32>> {
        let count = |piece: &Range<usize>| {
            let mut counts = vec![0u32; self.ranges];
            self.each(piece.clone(), |low, _, _, _| counts[(low >> self.bits) as usize] += 1);
            counts
        };
        self.pieces.par_iter().map(count).collect()
    }

    /// The records of a piece that belong to some ranges, range by range, with where each range begins.
    fn records(&self, piece: usize, ranges: &Range<usize>, counts: &[u32]) -> (Vec<Record>, Vec<u32>) {
        let mut starts = Vec::with_capacity(ranges.len() + 1);
        let mut total = 0;
        for &count in &counts[ranges.clone()] {
            starts.push(total);
            total += count;
        }
        let mut cursors = starts.clone();
        starts.push(total);
        let mut records = vec![Record::default(); total as usize];
        self.each(self.pieces[piece].clone(), |low, high, side, leaves| {
            let range = (low >> self.bits) as usize;
            if let Some(cursor) = cursors.get_mut(range.wrapping_sub(ranges.start)) {
                let low = ((low - ((range as u32) << self.bits)) << 1) | u32::from(leaves);
                records[*cursor as usize] = Record { low, high, side };
                *cursor += 1;
            }
        });
        (records, starts)
    }
}

impl Rings {
    /// Finds all rings, on all threads.
    pub(super) fn new(corners: &Corners<'_>) -> Self {
        let mesh = corners.mesh();
        let sides = mesh.faces.corners().len();
        let next: Vec<AtomicU32> = (0..sides as u32).into_par_iter().map(AtomicU32::new).collect();
        let state = |i: usize| {
            let face = mesh.faces.get(i);
            let bit = |is: bool, state: FaceState| if is { state.0 } else { 0 };
            let is_sound = mesh.is_sound(face);
            let twice = is_sound && repeated(face).is_some();
            AtomicU8::new(bit(!is_sound, FaceState::UNSOUND) | bit(twice, FaceState::DEGENERATE))
        };
        let states: Vec<AtomicU8> = (0..mesh.faces.len()).into_par_iter().map(state).collect();
        let points = corners.points();
        let bits = points.div_ceil(RANGES).next_power_of_two().trailing_zeros().max(LEAST_RANGE);
        let threads = rayon::current_num_threads().min(mesh.faces.len().div_ceil(1 << 12)).max(1);
        let piece = mesh.faces.len().div_ceil(threads).max(1);
        let plan = Plan {
            corners,
            states: &states,
            bits,
            ranges: points.div_ceil(1 << bits),
            pieces: (0..mesh.faces.len()).step_by(piece).map(|i| i..mesh.faces.len().min(i + piece)).collect(),
        };
        let counts = plan.counts();
        let mut crowds = Vec::new();
        for ranges in waves(&counts, plan.ranges, sides) {
            let of_piece = |piece: usize| plan.records(piece, &ranges, &counts[piece]);
            let pieces: Vec<(Vec<Record>, Vec<u32>)> = (0..plan.pieces.len()).into_par_iter().map(of_piece).collect();
            let found = (0..ranges.len()).into_par_iter().map_init(Scratch::default, |scratch, range| {
                scratch
                    .sort(pieces.iter().map(|(all, starts)| &all[starts[range] as usize..starts[range + 1] as usize]));
                let mut crowds = Vec::new();
                scratch.edges(|edge| link(corners, edge, &next, &states, &mut crowds));
                crowds
            });
            crowds.extend(found.collect::<Vec<_>>().concat());
        }
        crowds.par_sort_unstable();
        Rings {
            next: next.into_iter().map(AtomicU32::into_inner).collect(),
            states: states.into_iter().map(AtomicU8::into_inner).collect(),
            crowds,
        }
    }
}

/// Cuts the ranges so that none of few waves has much more sides than another.
fn waves(counts: &[Vec<u32>], ranges: usize, sides: usize) -> Vec<Range<usize>> {
    if ranges == 0 {
        return Vec::new();
    }
    let share = if sides < SMALL { u64::MAX } else { (sides as u64).div_ceil(WAVES) };
    let (mut waves, mut start, mut held) = (Vec::new(), 0, 0);
    for range in 0..ranges {
        let here: u64 = counts.iter().map(|counts| u64::from(counts[range])).sum();
        if held > 0 && held + here > share {
            waves.push(start..range);
            (start, held) = (range, 0);
        }
        held += here;
    }
    waves.push(start..ranges);
    waves
}

/// The records of a range while they are sorted.
#[derive(Default)]
struct Scratch {
    records: Vec<Record>,
    ends: Vec<u32>,
}

impl Scratch {
    /// Sorts by lower point, higher point and side.
    fn sort<'a>(&mut self, lists: impl Iterator<Item = &'a [Record]> + Clone) {
        let Scratch { records, ends } = self;
        ends.clear();
        for record in lists.clone().flatten() {
            let low = (record.low >> 1) as usize;
            if ends.len() <= low {
                ends.resize(low + 1, 0);
            }
            ends[low] += 1;
        }
        let mut total = 0;
        for end in ends.iter_mut() {
            total += std::mem::replace(end, total);
        }
        records.clear();
        records.resize(total as usize, Record::default());
        for record in lists.flatten() {
            let cursor = &mut ends[(record.low >> 1) as usize];
            records[*cursor as usize] = *record;
            *cursor += 1;
        }
        let mut start = 0;
        for &end in ends.iter() {
            records[start as usize..end as usize].sort_unstable_by_key(Record::key);
            start = end;
        }
    }

    /// Calls with the records of each edge.
    fn edges(&self, visit: impl FnMut(&[Record])) {
        self.records.chunk_by(|a, b| a.high == b.high && a.low >> 1 == b.low >> 1).for_each(visit);
    }
}

/// Makes a ring of the sides along one edge, and tells their faces what it is.
fn link(corners: &Corners<'_>, edge: &[Record], next: &[AtomicU32], states: &[AtomicU8], crowds: &mut Vec<Crowd>) {
    let n = edge.len();
    if n > 1 {
        (0..n).for_each(|k| next[edge[k].side as usize].store(edge[if k + 1 == n { 0 } else { k + 1 }].side, Relaxed));
    }
    if n > FEW {
        let (lowest, users) = (edge[0].side, n as u32);
        crowds.extend(edge.iter().map(|record| Crowd { side: record.side, lowest, users }));
    }
    let state = match edge {
        [_] => FaceState::BOUNDARY,
        [a, b] if (a.low ^ b.low) & 1 == 1 => return,
        [_, _] => FaceState::INCONSISTENT,
        _ => FaceState::NON_MANIFOLD,
    };
    edge.iter().for_each(|record| _ = states[corners.face(record.side) as usize].fetch_or(state.0, Relaxed));
}
