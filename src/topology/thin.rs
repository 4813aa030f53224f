//! Thinning: elementary collapses in layers, 512 elements at a time, until only curves, closed sheets and (if asked for) a core are left.
//!
//! An elementary collapse removes an element e together with c, the only element that has e in its boundary. It keeps the homotopy type.
//! One step
//!
//! 1. marks on a snapshot every point, edge and face with exactly one coface: ones and twos of shifted planes;
//! 2. lets each edge, face and cell choose one among the marked elements of its boundary (by extent, axis, low before high), and takes
//!    both away.
//!
//! All the pairs of a step are independent: a marked element has no other coface than the one that chooses; and where an edge is
//! marked, its one face f has no cell (a cell on f would give the edge a second face), so that nobody is chosen from below and
//! chooses from above at the same time. Hence the result depends neither on the order of bricks nor on the number of threads.
//!
//! A brick's marks depend on itself and its three low neighbours, a choice on its three high ones. A step visits only bricks in which, or
//! beside which, the last one took something away. Whenever the front comes to a full brick that has never been looked at, it is
//! opened.
//!
//! # Erosion and the rest
//!
//! Collapses may come in any order. Those of cells (erosion) can be limited to a number of layers; those of faces and edges, which live
//! on sheets and curves, always run to the end. What is left of the cells is the core: thicker than twice that many layers.
//!
//! # What is kept
//!
//! Points and edges of a subcomplex that is kept ([`Complex::keeping`]) are never marked. None of them is chosen from below either: a kept edge has
//! kept ends. So what is left can be pushed onto it as far as that goes, and what lies beside it says how the solid differs.
//!
//! # What is remembered
//!
//! For each face removed with an edge, which edge; for each cell removed with a face, which face: twelve planes a brick
//! ([`Record`]). That is the discrete gradient (Forman 1998) along which [`section`](super::section) finds its way back.
//!
//! # Cost
//!
//! Some 0.4 us a brick and step; a front is in a brick for some 20 steps, the rim of its sheet included: 3 ns an element. Beside the complex,
//! 700 bytes for each brick that a front is in.

use super::complex::{Brick, Complex, DEEP, Planes, Record};
use crate::error::Result;
use crate::grid::brick::Plane;
use crate::grid::{Axis, Extent, Face};
use crate::progress::{Progress, check};
use rayon::prelude::*;

/// What [`thin`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Thinned {
    /// Steps until nothing was left to collapse.
    pub steps: u32,
    /// Elements removed; of a background, a few at its box too many.
    pub removed: u64,
}

/// The pairs of extents that collapse, as lower extent, axis that the upper one has beside, and number of the pair.
const PAIRS: [(Extent, Axis); 12] = {
    let mut pairs = [(Extent::POINT, Axis::X); 12];
    let (mut n, mut extent) = (0, 0);
    while extent < 7 {
        let mut a = 0;
        while a < 3 {
            if !Extent::ALL[extent].contains(Axis::ALL[a]) {
                pairs[n] = (Extent::ALL[extent], Axis::ALL[a]);
                n += 1;
            }
            a += 1;
        }
        extent += 1;
    }
    pairs
};

/// The axes along which cells may be eroded, step by step: twice all of them, then one after the other. The first moves a front with
/// normal n by max `|n_i|` (the ball of the L1 metric), the second by the sum of `|n_i|` (that of the maximum metric); two to one, a front
/// moves by 3, 2.83 and 2.89 cells in five steps along the axes and their two kinds of diagonals. So fronts meet where Euclidean ones
/// would, to a few percent, and cross-sections stand straight.
const ERODED: [Extent; 5] = [Extent::CELL, Extent::CELL, axis_alone(Axis::X), axis_alone(Axis::Y), axis_alone(Axis::Z)];

const fn axis_alone(axis: Axis) -> Extent {
    Extent::POINT.with(axis)
}

/// Bytes for each brick that a front is in.
const FRONT_BYTES: usize = size_of::<Marks>() + size_of::<Work>();

/// Bricks that a thread takes at least.
const GRAIN: usize = 64;

/// Collapses whatever can be collapsed; cells only in the first `layers` steps, if that is given.
///
/// # Errors
/// `Cancelled`, and `Memory` when `progress` says so.
pub fn thin(complex: &mut Complex, layers: Option<u32>, progress: &dyn Progress) -> Result<Thinned> {
    let mut done = Thinned::default();
    let before = complex.count();
    let listed = complex.bricks.len();
    let mut active = first_front(complex);
    let (mut marks, mut place_of) = (Vec::new(), Vec::new());
    loop {
        check(progress)?;
        if done.steps.is_multiple_of(8) {
            progress.hold((complex.bytes() + active.len() * FRONT_BYTES) as u64)?;
        }
        let axes = ERODED[done.steps as usize % ERODED.len()];
        let erode = if layers.is_none_or(|layers| done.steps < layers) { Some(axes) } else { None };
        marks.resize_with(active.len(), Marks::default);
        marks
            .par_iter_mut()
            .zip(&active)
            .with_min_len(GRAIN)
            .for_each(|(marks, &brick)| marks.find(complex, brick, erode));
        if marks.iter().all(|marks| marks.kinds == 0 && !marks.waiting) {
            // Bricks that were opened were full.
            let opened = complex.bricks.len() - listed;
            done.removed = (before + opened as u64 * 4096).saturating_sub(complex.count());
            return Ok(done);
        }
        Step::new(complex, &marks, &mut place_of).run(complex, &mut active);
        // Faces whose turn has not come yet are waited for.
        active.extend(marks.iter().filter(|marks| marks.waiting).map(|marks| marks.brick));
        merge(&mut active);
        done.steps += 1;
        progress.advance(1);
    }
}

/// Sorts a list of a few runs that are in order, without duplicates.
#[expect(clippy::stable_sort_primitive, reason = "stable sorts merge runs")]
fn merge(list: &mut Vec<u32>) {
    list.sort();
    list.dedup();
}

/// The bricks in or beside which something is missing: all others have no element with exactly one coface.
fn first_front(complex: &mut Complex) -> Vec<u32> {
    let listed = complex.bricks.len() as u32;
    let mut front: Vec<u32> = (0..listed).filter(|&brick| complex.bricks[brick as usize].live.is_some()).collect();
    for brick in 0..listed {
        for axis in Axis::ALL {
            let high = Face::new(axis, true);
            let misses = |&(extent, other): &(Extent, Axis)| {
                other == axis && (!complex.live(brick)[(extent | axis).index()]).touches_max(axis)
            };
            if complex.beside(brick, high) == DEEP && PAIRS.iter().any(misses) {
                front.extend(complex.open(brick, high));
            }
        }
    }
    front.sort_unstable();
    front
}

/// The elements of a brick with exactly one coface.
#[derive(Default)]
struct Marks {
    brick: u32,
    /// By extent; bit e is set where plane e is not empty.
    kinds: u8,
    /// Whether there are faces that would be marked if erosion went along their normal in this step.
    waiting: bool,
    /// Where the bit of an extent is not set, what was there before.
    planes: [Plane; 7],
}

impl Marks {
    /// Finds those of a brick; cells are eroded along the axes in `erode`.
    fn find(&mut self, complex: &Complex, brick: u32, erode: Option<Extent>) {
        (self.brick, self.kinds, self.waiting) = (brick, 0, false);
        let live = complex.live(brick);
        let low = Axis::ALL.map(|axis| complex.live(complex.beside(brick, Face::new(axis, false))));
        let kept = complex.bricks[brick as usize].kept.as_deref();
        let mut any = [0; 7];
        for x in 0..8 {
            let mut marked = once_covered(live, low, x);
            if let Some(kept) = kept {
                marked.iter_mut().zip(kept).for_each(|(marked, kept)| *marked &= !kept.0[x]);
            }
            for (extent, word) in marked.into_iter().enumerate() {
                any[extent] |= word;
                self.planes[extent].0[x] = word;
            }
        }
        for axis in Axis::ALL.into_iter().filter(|&axis| erode.is_none_or(|axes| !axes.contains(axis))) {
            let face = !Extent::from(axis);
            self.waiting |= erode.is_some() && any[face.index()] != 0;
            any[face.index()] = 0;
        }
        self.kinds = any.iter().rev().fold(0, |kinds, &word| kinds << 1 | u8::from(word != 0));
    }

    fn plane(&self, extent: Extent) -> Option<&Plane> {
        (self.kinds >> extent.index() & 1 == 1).then(|| &self.planes[extent.index()])
    }
}

/// Word `x` of the planes of all elements with exactly one coface, by extent; `low` are the low neighbours of the brick.
///
/// Everything word by word, so that it stays in registers: some 150 operations a word, and a few where nothing is left or all cells are.
#[inline]
fn once_covered(live: &Planes, low: [&Planes; 3], x: usize) -> [u64; 7] {
    let mut marked = [0; 7];
    if live.iter().fold(0, |any, plane| any | plane.0[x]) == 0 {
        return marked;
    }
    let here = |extent: Extent| live[extent.index()].0[x];
    let cells = Axis::ALL.map(|axis| along(live, low, x, Extent::CELL, axis).0);
    for axis in Axis::ALL {
        let face = !Extent::from(axis);
        marked[face.index()] = here(face) & cells[axis.index()];
    }
    if here(Extent::CELL) == !0 {
        // Every point that begins a cell begins two faces with each edge, and three edges.
        return marked;
    }
    let of = |axis: Axis| along(live, low, x, Extent::from(axis), axis);
    let ((a, aa), (b, bb), (c, cc)) = (of(Axis::X), of(Axis::Y), of(Axis::Z));
    marked[Extent::POINT.index()] = here(Extent::POINT) & (a ^ b ^ c) & !(a & b & c | aa | bb | cc);
    for axis in Axis::ALL {
        let edge = Extent::from(axis);
        let [u, v] = axis.others();
        let ((a, aa), (b, bb)) = (along(live, low, x, edge | u, u), along(live, low, x, edge | v, v));
        marked[edge.index()] = here(edge) & (a ^ b) & !(aa | bb);
    }
    marked
}

/// For word `x` of the elements that have `upper` beside them along an axis, on either side: those for which just one is there, and those for
/// which both are.
#[inline(always)]
#[expect(clippy::inline_always, reason = "axis and extent are known where it is called: a few operations are left")]
fn along(live: &Planes, low: [&Planes; 3], x: usize, upper: Extent, axis: Axis) -> (u64, u64) {
    let next = &low[axis.index()][upper.index()];
    let above = live[upper.index()].0[x];
    let below = match axis {
        Axis::X => {
            if x == 0 {
                next.0[7]
            } else {
                live[upper.index()].0[x - 1]
            }
        }
        Axis::Y => above << 8 | next.0[x] >> 56,
        Axis::Z => above << 1 & !Z0 | next.0[x] >> 7 & Z0,
    };
    (above ^ below, above & below)
}

/// Bits with z = 0 of a word of a plane.
const Z0: u64 = 0x0101_0101_0101_0101;

/// A brick in which something is chosen.
struct Work {
    place: u32,
    around: [u32; 6],
    live: Option<Box<Planes>>,
    record: Option<Box<Record>>,
    /// What the brick has lost: bit 3 if anything, and for each axis (bits 0 to 2) whether something of that lies in the high layer
    /// and extends along it.
    lost: u8,
    /// For each pair of extents, what was chosen in the layer next to the high neighbour and has its lower part there.
    carries: [u64; 12],
}

/// No brick has marks here.
const NO_MARKS: u32 = u32::MAX;

struct Step<'a> {
    marks: &'a [Marks],
    /// By brick, the place in `marks`.
    place_of: &'a mut Vec<u32>,
    work: Vec<Work>,
}

impl<'a> Step<'a> {
    fn new(complex: &mut Complex, marks: &'a [Marks], place_of: &'a mut Vec<u32>) -> Self {
        let mut beside = Vec::new();
        for mark in marks {
            let reaches_low =
                |&(extent, axis): &(Extent, Axis)| mark.plane(extent).is_some_and(|p| p.touches_min(axis));
            for axis in Axis::ALL {
                if PAIRS.iter().filter(|(_, other)| *other == axis).any(reaches_low) {
                    beside.extend(complex.open(mark.brick, Face::new(axis, false)));
                }
            }
        }
        let mut uppers: Vec<u32> = marks.iter().filter(|mark| mark.kinds != 0).map(|mark| mark.brick).collect();
        beside.sort_unstable();
        beside.dedup();
        uppers.extend(beside);
        merge(&mut uppers);
        place_of.resize(complex.bricks.len(), NO_MARKS);
        for (place, mark) in (0..).zip(marks).filter(|(_, mark)| mark.kinds != 0) {
            place_of[mark.brick as usize] = place;
        }
        let take = |place: u32| {
            let Brick { around, live, record, .. } = &mut complex.bricks[place as usize];
            Work { place, around: *around, live: live.take(), record: record.take(), lost: 0, carries: [0; 12] }
        };
        let work = uppers.into_iter().map(take).collect();
        Step { marks, place_of, work }
    }

    /// Takes all pairs away; `active` becomes the bricks to look at in the next step.
    fn run(mut self, complex: &mut Complex, active: &mut Vec<u32>) {
        let marks_of = |brick: u32| {
            let place = if brick < DEEP { self.place_of[brick as usize] } else { NO_MARKS };
            (place != NO_MARKS).then(|| &self.marks[place as usize])
        };
        self.work.par_iter_mut().with_min_len(GRAIN).for_each(|work| {
            let high = Axis::ALL.map(|axis| marks_of(work.around[Face::new(axis, true).index()]));
            work.choose(marks_of(work.place), high);
        });
        // The marks are done with: now the table says where the carries of a brick are.
        self.marks.iter().for_each(|mark| self.place_of[mark.brick as usize] = NO_MARKS);
        let carries: Vec<[u64; 12]> = self.work.iter().map(|work| work.carries).collect();
        (0..).zip(&self.work).for_each(|(i, work)| self.place_of[work.place as usize] = i);
        let place_of = &*self.place_of;
        self.work.par_iter_mut().with_min_len(GRAIN).for_each(|work| {
            let carried = |axis: Axis| {
                let low = work.around[Face::new(axis, false).index()];
                let place = if low < DEEP { place_of[low as usize] } else { NO_MARKS };
                (place != NO_MARKS).then(|| &carries[place as usize])
            };
            work.finish(Axis::ALL.map(carried));
        });
        self.work.iter().for_each(|work| self.place_of[work.place as usize] = NO_MARKS);
        active.clear();
        let losses: Vec<(u32, u8)> =
            self.work.iter().map(|work| (work.place, work.lost)).filter(|l| l.1 != 0).collect();
        for work in self.work {
            let brick = &mut complex.bricks[work.place as usize];
            (brick.live, brick.record) = (work.live, work.record);
        }
        active.extend(losses.iter().map(|loss| loss.0));
        let mut beside = Vec::new();
        for (place, lost) in losses {
            for axis in Axis::ALL.into_iter().filter(|axis| lost >> axis.index() & 1 == 1) {
                beside.extend(complex.open(place, Face::new(axis, true)));
            }
        }
        beside.sort_unstable();
        active.extend(beside);
    }
}

impl Work {
    /// Lets the elements of the brick choose among the marks in their boundary: its own, and those of the high neighbours.
    fn choose<'a>(&mut self, own: Option<&'a Marks>, high: [Option<&'a Marks>; 3]) {
        let Some(live) = self.live.as_deref_mut() else { return };
        for ((extent, axis), carry) in PAIRS.into_iter().zip(&mut self.carries) {
            let plane = |marks: Option<&'a Marks>| marks.and_then(|marks| marks.plane(extent));
            let (marked, next) = match (plane(own), plane(high[axis.index()])) {
                (None, None) => continue,
                (marked, next) => (marked.unwrap_or(&Plane::EMPTY), next.unwrap_or(&Plane::EMPTY)),
            };
            let (lower, upper) = (extent.index(), (extent | axis).index());
            let there = live[upper];
            let low = *marked & there;
            let high = marked.at_plus(axis, next) & there & !*marked;
            let both = low | high;
            if both.is_empty() {
                continue;
            }
            live[lower] &= !(low | high.at_minus(axis, &Plane::EMPTY));
            live[upper] = there & !both;
            *carry = high.high_layer(axis);
            self.lost |= lost(&both, extent | axis);
            if extent.dimension() > 0 {
                self.record.get_or_insert_with(|| Box::new(Record::NONE)).note(extent, axis, &low, &high);
            }
        }
    }

    /// Takes away what the low neighbours chose here.
    fn finish(&mut self, carried: [Option<&[u64; 12]>; 3]) {
        let Some(live) = self.live.as_deref_mut() else { return };
        for (i, (extent, axis)) in PAIRS.into_iter().enumerate() {
            let layer = carried[axis.index()].map_or(0, |carries| carries[i]);
            if layer != 0 {
                let plane = Plane::from_low_layer(axis, layer);
                live[extent.index()] &= !plane;
                self.lost |= lost(&plane, extent);
            }
        }
        if self.lost != 0 && live.iter().all(Plane::is_empty) {
            self.live = None;
        }
    }
}

/// The bits of [`Work::lost`] for elements of an extent.
fn lost(plane: &Plane, extent: Extent) -> u8 {
    extent.axes().fold(1 << 3, |all, axis| all | u8::from(plane.touches_max(axis)) << axis.index())
}

impl Record {
    /// Notes that the elements one dimension above `extent`, along `axis`, were removed with their low and high parts.
    fn note(&mut self, extent: Extent, axis: Axis, low: &Plane, high: &Plane) {
        let both = *low | *high;
        if extent.dimension() == 2 {
            let number = axis.index() + 1;
            for (bit, plane) in self.cells[..2].iter_mut().enumerate() {
                if number >> bit & 1 == 1 {
                    *plane |= both;
                }
            }
            self.cells[2] |= *high;
        } else {
            let normal = (extent | axis).complement().axes().next().expect("a face has a normal");
            let [paired, second, is_high] = &mut self.faces[normal.index()];
            *paired |= both;
            if normal.others()[1] == axis {
                *second |= both;
            }
            *is_high |= *high;
        }
    }
}
