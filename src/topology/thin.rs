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
//! What a brick does in a step is in [`collapse`](super::collapse). Its marks depend on itself and its three low neighbours, a choice on
//! its three high ones. A step visits only bricks in which, or beside which, the last one took something away. Whenever the front comes
//! to a full brick that has never been looked at, it is opened.
//!
//! # Erosion and the rest
//!
//! Collapses may come in any order. Those of cells (erosion) can be limited to a number of layers; those of faces and edges, which live
//! on sheets and curves, always run to the end. What is left of the cells is the core: thicker than twice that many layers.
//!
//! # What is kept
//!
//! Points and edges of a subcomplex that is kept ([`Complex::keeping`]) are never marked. None of them is chosen from below either: a kept
//! edge has kept ends. So what is left can be pushed onto it as far as that goes, and what lies beside it says how the solid differs.
//!
//! # What is remembered
//!
//! For each face removed with an edge, which edge; for each cell removed with a face, which face: twelve planes a brick
//! ([`Record`]). That is the discrete gradient (Forman 1998) along which [`section`](super::section) finds its way back.
//!
//! # Cost
//!
//! Some 0.4 us a brick and step; a front is in a brick for some 20 steps, the rim of its sheet included: 2.4 ns an element. Beside the
//! complex, some 400 bytes for each brick that a front is in.

use super::collapse::{Carries, Lost, Marked, Marks, MarksOf, PAIRS};
use super::complex::{Brick, Complex, DEEP};
use crate::error::Result;
use crate::grid::brick::Bits;
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

/// The axes along which cells may be eroded, step by step: twice all of them, then one after the other. The first moves a front with
/// normal n by max `|n_i|` (the ball of the L1 metric), the second by the sum of `|n_i|` (that of the maximum metric); two to one, a front
/// moves by 3, 2.83 and 2.89 cells in five steps along the axes and their two kinds of diagonals. So fronts meet where Euclidean ones
/// would, to a few percent, and cross-sections stand straight.
const ERODED: [Extent; 5] = [Extent::CELL, Extent::CELL, axis_alone(Axis::X), axis_alone(Axis::Y), axis_alone(Axis::Z)];

const fn axis_alone(axis: Axis) -> Extent {
    Extent::POINT.with(axis)
}

/// Bricks that are looked at together.
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
    let mut step = Step::default();
    loop {
        check(progress)?;
        let axes = ERODED[done.steps as usize % ERODED.len()];
        let erode = if layers.is_none_or(|layers| done.steps < layers) { Some(axes) } else { None };
        step.mark(complex, &active, erode);
        if done.steps.is_multiple_of(8) {
            progress.hold((complex.bytes() + step.bytes()) as u64)?;
        }
        if all_of(&step.marked).all(|marks| marks.is_empty() && !marks.waiting) {
            // Bricks that were opened were full.
            let opened = complex.bricks.len() - listed;
            done.removed = (before + opened as u64 * 4096).saturating_sub(complex.count());
            return Ok(done);
        }
        step.run(complex, &mut active);
        done.steps += 1;
        progress.advance(1);
    }
}

/// A set of bricks by their places.
#[derive(Default)]
struct Places(Vec<u64>);

impl Places {
    fn insert(&mut self, place: u32) {
        let word = (place >> 6) as usize;
        if word >= self.0.len() {
            self.0.resize(word + 1, 0);
        }
        self.0[word] |= 1 << (place & 63);
    }

    /// Moves all into a list, in order.
    fn drain_into(&mut self, list: &mut Vec<u32>) {
        list.clear();
        for (first, word) in (0..).step_by(64).zip(&mut self.0) {
            list.extend(Bits(std::mem::take(word)).map(|bit| first + bit));
        }
    }
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

/// A brick in which something is chosen.
struct Work<'a> {
    place: u32,
    brick: &'a mut Brick,
    lost: Lost,
}

/// The brick is in no list.
const NO_PLACE: u32 = u32::MAX;

/// A step; keeps its memory for the next one.
#[derive(Default)]
struct Step {
    /// In groups of [`GRAIN`] bricks.
    marked: Vec<Marked>,
    /// By brick, its place among the marks, and then in `uppers`.
    place_of: Vec<u32>,
    /// Bricks in which something may be chosen.
    uppers: Vec<u32>,
    /// Of each of those.
    carries: Vec<Carries>,
    places: Places,
}

impl Step {
    /// The place of a brick in the list that `place_of` is about, if it is in there.
    fn place(&self, brick: u32) -> Option<usize> {
        let place = if brick < DEEP { self.place_of[brick as usize] } else { NO_PLACE };
        (place != NO_PLACE).then_some(place as usize)
    }

    /// Bytes held.
    fn bytes(&self) -> usize {
        let upper = size_of::<u32>() + size_of::<Carries>() + size_of::<Work<'_>>() + size_of::<(u32, Lost)>();
        self.marked.iter().map(Marked::bytes).sum::<usize>()
            + self.uppers.capacity() * upper
            + self.place_of.capacity() * 4
    }

    /// The marks of a brick.
    fn marks_of(&self, brick: u32) -> MarksOf<'_> {
        self.place(brick).map_or(MarksOf::NONE, |place| self.marked[place / GRAIN].of(place % GRAIN))
    }

    /// Finds the marks of some bricks.
    fn mark(&mut self, complex: &Complex, active: &[u32], erode: Option<Extent>) {
        self.marked.resize_with(active.len().div_ceil(GRAIN), Marked::default);
        self.uppers.reserve(active.len());
        self.marked.par_iter_mut().zip(active.par_chunks(GRAIN)).for_each(|(group, bricks)| {
            group.clear();
            bricks.iter().for_each(|&brick| group.find(complex, brick, erode));
        });
    }

    /// Opens the bricks in which something may be chosen, and lists them.
    fn list_uppers(&mut self, complex: &mut Complex) {
        for marks in all_of(&self.marked).filter(|marks| !marks.is_empty()) {
            self.places.insert(marks.brick);
            for axis in Axis::ALL.into_iter().filter(|&axis| marks.is_beside(axis)) {
                if let Some(beside) = complex.open(marks.brick, Face::new(axis, false)) {
                    self.places.insert(beside);
                }
            }
        }
        self.places.drain_into(&mut self.uppers);
        self.place_of.resize(complex.bricks.len(), NO_PLACE);
    }

    /// Takes all pairs away; `active` becomes the bricks to look at in the next step.
    fn run(&mut self, complex: &mut Complex, active: &mut Vec<u32>) {
        self.list_uppers(complex);
        for (place, marks) in (0..).zip(all_of(&self.marked)) {
            self.place_of[marks.brick as usize] = place;
        }
        let mut work = taken(&mut complex.bricks, &self.uppers);
        let mut carries = std::mem::take(&mut self.carries);
        carries.clear();
        carries.resize(work.len(), Carries::NONE);
        work.par_iter_mut().zip(&mut carries).with_min_len(GRAIN).for_each(|(work, carries)| {
            let [_, x, _, y, _, z] = work.brick.around;
            let high = [self.marks_of(x), self.marks_of(y), self.marks_of(z)];
            work.lost = work.brick.choose(self.marks_of(work.place), high, carries);
        });
        // The marks are done with: now the table says where the carries of a brick are.
        for marks in all_of(&self.marked) {
            self.place_of[marks.brick as usize] = NO_PLACE;
            if marks.waiting {
                // Faces whose turn has not come yet are waited for.
                self.places.insert(marks.brick);
            }
        }
        (0..).zip(&self.uppers).for_each(|(i, &upper)| self.place_of[upper as usize] = i);
        work.par_iter_mut().with_min_len(GRAIN).for_each(|work| {
            let carried = |low| self.place(low).map(|place| &carries[place]);
            let [x, _, y, _, z, _] = work.brick.around;
            work.brick.finish([carried(x), carried(y), carried(z)], &mut work.lost);
        });
        self.carries = carries;
        self.uppers.iter().for_each(|&upper| self.place_of[upper as usize] = NO_PLACE);
        let losses: Vec<(u32, Lost)> =
            work.iter().map(|work| (work.place, work.lost)).filter(|(_, lost)| lost.is_any()).collect();
        for (place, lost) in losses {
            self.places.insert(place);
            for axis in Axis::ALL.into_iter().filter(|&axis| lost.is_beside(axis)) {
                if let Some(beside) = complex.open(place, Face::new(axis, true)) {
                    self.places.insert(beside);
                }
            }
        }
        self.places.drain_into(active);
    }
}

/// The marks of all groups.
fn all_of(marked: &[Marked]) -> impl Iterator<Item = &Marks> {
    marked.iter().flat_map(|group| &group.bricks)
}

/// Some of the bricks, given in order.
fn taken<'a>(bricks: &'a mut [Brick], places: &[u32]) -> Vec<Work<'a>> {
    let (mut left, mut first) = (bricks, 0);
    let take = |&place: &u32| {
        let (brick, further) =
            std::mem::take(&mut left)[(place - first) as usize..].split_first_mut().expect("a place");
        (left, first) = (further, place + 1);
        Work { place, brick, lost: Lost::default() }
    };
    places.iter().map(take).collect()
}
