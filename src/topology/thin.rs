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
//! # What is remembered
//!
//! For each face removed with an edge, which edge; for each cell removed with a face, which face: twelve planes a brick
//! ([`Record`]). That is the discrete gradient (Forman 1998) along which [`section`](super::section) finds its way back.
//!
//! # Cost
//!
//! Some 0.4 us a brick and step; a front needs 8 to 14 steps to cross a brick: 1 to 1.5 ns an element.

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

/// Bricks that a thread takes at least.
const GRAIN: usize = 64;

/// Collapses whatever can be collapsed; cells only in the first `layers` steps, if that is given.
///
/// # Errors
/// `Cancelled`.
pub fn thin(complex: &mut Complex, layers: Option<u32>, progress: &dyn Progress) -> Result<Thinned> {
    let mut done = Thinned::default();
    let before = complex.count();
    let listed = complex.bricks.len();
    let mut active = first_front(complex);
    let mut place_of = Vec::new();
    loop {
        check(progress)?;
        let axes = ERODED[done.steps as usize % ERODED.len()];
        let erode = if layers.is_none_or(|layers| done.steps < layers) { Some(axes) } else { None };
        let mut marks: Vec<Marks> =
            active.par_iter().with_min_len(GRAIN).filter_map(|&brick| Marks::of(complex, brick, erode)).collect();
        if marks.is_empty() {
            // Bricks that were opened were full.
            let opened = complex.bricks.len() - listed;
            done.removed = (before + opened as u64 * 4096).saturating_sub(complex.count());
            return Ok(done);
        }
        // Faces whose turn has not come yet are waited for.
        let waiting: Vec<u32> = marks.iter().filter(|marks| marks.waiting).map(|marks| marks.brick).collect();
        marks.retain(|marks| marks.kinds != 0);
        let step = Step::new(complex, &marks, &mut place_of);
        step.run(complex, &mut active);
        active.extend(waiting);
        active.sort_unstable();
        active.dedup();
        done.steps += 1;
        progress.advance(1);
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

/// The elements of a brick with exactly one coface.
struct Marks {
    brick: u32,
    /// By extent; bit e is set where plane e is not empty.
    kinds: u8,
    /// Whether there are faces that would be marked if erosion went along their normal in this step.
    waiting: bool,
    planes: Box<[Plane; 7]>,
}

impl Marks {
    /// None if there are no such elements, nor any that wait.
    fn of(complex: &Complex, brick: u32, erode: Option<Extent>) -> Option<Marks> {
        let live = complex.live(brick);
        let low = Axis::ALL.map(|axis| complex.live(complex.beside(brick, Face::new(axis, false))));
        let mut planes = [Plane::EMPTY; 7];
        let (mut kinds, mut waiting) = (0, false);
        for extent in &Extent::ALL[..7] {
            let here = live[extent.index()];
            if here.is_empty() || extent.dimension() == 2 && erode.is_none() {
                continue;
            }
            let (mut once, mut twice) = (Plane::EMPTY, Plane::EMPTY);
            for axis in extent.complement().axes() {
                let upper = (*extent | axis).index();
                let above = live[upper];
                twice |= once & above;
                once |= above;
                let below = above.at_minus(axis, &low[axis.index()][upper]);
                twice |= once & below;
                once |= below;
            }
            let marked = here & once & !twice;
            let normal = extent.complement().axes().next().expect("not a cell");
            if extent.dimension() == 2 && erode.is_none_or(|axes| !axes.contains(normal)) {
                waiting |= !marked.is_empty();
                continue;
            }
            kinds |= u8::from(!marked.is_empty()) << extent.index();
            planes[extent.index()] = marked;
        }
        (kinds != 0 || waiting).then(|| Marks { brick, kinds, waiting, planes: Box::new(planes) })
    }
}

/// A brick in which something is chosen.
struct Work {
    place: u32,
    brick: Brick,
    before: Planes,
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
        let mut uppers: Vec<u32> = Vec::with_capacity(marks.len() + marks.len() / 2);
        for mark in marks {
            uppers.push(mark.brick);
            for axis in Axis::ALL {
                let touches = |&&(extent, other): &&(Extent, Axis)| {
                    other == axis
                        && mark.kinds >> extent.index() & 1 == 1
                        && mark.planes[extent.index()].touches_min(axis)
                };
                if PAIRS.iter().find(touches).is_some() {
                    uppers.extend(complex.open(mark.brick, Face::new(axis, false)));
                }
            }
        }
        uppers.sort_unstable();
        uppers.dedup();
        place_of.resize(complex.bricks.len(), NO_MARKS);
        (0..).zip(marks.iter()).for_each(|(place, mark)| place_of[mark.brick as usize] = place);
        let take = |place: u32| {
            let brick = &mut complex.bricks[place as usize];
            let (live, record) = (brick.live.take(), brick.record.take());
            let before = live.as_deref().copied().unwrap_or([Plane::EMPTY; 8]);
            let brick = Brick { key: brick.key, around: brick.around, live, record };
            Work { place, brick, before, carries: [0; 12] }
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
            let high = Axis::ALL.map(|axis| marks_of(work.brick.around[Face::new(axis, true).index()]));
            work.choose(marks_of(work.place), high);
        });
        // The marks are done with: now the table says where the carries of a brick are.
        self.marks.iter().for_each(|mark| self.place_of[mark.brick as usize] = NO_MARKS);
        let carries: Vec<[u64; 12]> = self.work.iter().map(|work| work.carries).collect();
        (0..).zip(&self.work).for_each(|(i, work)| self.place_of[work.place as usize] = i);
        let place_of = &*self.place_of;
        let changes: Vec<u8> = self
            .work
            .par_iter_mut()
            .with_min_len(GRAIN)
            .map(|work| {
                let carried = |axis: Axis| {
                    let low = work.brick.around[Face::new(axis, false).index()];
                    let place = if low < DEEP { place_of[low as usize] } else { NO_MARKS };
                    (place != NO_MARKS).then(|| &carries[place as usize])
                };
                let carried = Axis::ALL.map(carried);
                work.finish(carried)
            })
            .collect();
        self.work.iter().for_each(|work| self.place_of[work.place as usize] = NO_MARKS);
        active.clear();
        let places: Vec<u32> = self.work.iter().map(|work| work.place).collect();
        for work in self.work {
            let Brick { live, record, .. } = work.brick;
            let brick = &mut complex.bricks[work.place as usize];
            (brick.live, brick.record) = (live.filter(|planes| planes.iter().any(|p| !p.is_empty())), record);
        }
        for (place, change) in places.into_iter().zip(changes).filter(|(_, change)| *change != 0) {
            active.push(place);
            for axis in Axis::ALL {
                if change >> axis.index() & 1 == 1 {
                    active.extend(complex.open(place, Face::new(axis, true)));
                }
            }
        }
    }
}

impl Work {
    /// Lets the elements of the brick choose among the marks in their boundary: its own, and those of the high neighbours.
    fn choose(&mut self, own: Option<&Marks>, high: [Option<&Marks>; 3]) {
        let Some(live) = self.brick.live.as_deref_mut() else { return };
        let kinds_of = |marks: Option<&Marks>| marks.map_or(0, |marks| marks.kinds);
        let own_kinds = kinds_of(own);
        let plane = |marks: Option<&Marks>, extent: Extent| marks.map_or(Plane::EMPTY, |m| m.planes[extent.index()]);
        for ((extent, axis), carry) in PAIRS.into_iter().zip(&mut self.carries) {
            let next = high[axis.index()];
            if (own_kinds | kinds_of(next)) >> extent.index() & 1 == 0 {
                continue;
            }
            let (lower, upper) = (extent.index(), (extent | axis).index());
            let marked = plane(own, extent);
            let low = marked & live[upper];
            if !low.is_empty() {
                live[lower] &= !low;
                live[upper] &= !low;
            }
            let high = marked.at_plus(axis, &plane(next, extent)) & live[upper];
            if !high.is_empty() {
                live[lower] &= !high.at_minus(axis, &Plane::EMPTY);
                live[upper] &= !high;
                *carry = high.high_layer(axis);
            }
            if extent.dimension() > 0 {
                let record = self.brick.record.get_or_insert_with(|| Box::new(Record::NONE));
                record.note(extent, axis, low, high);
            }
        }
    }

    /// Takes away what the low neighbours chose here. Whether the brick has lost anything (bit 3), and for each axis (bits 0 to 2) whether
    /// something of that lies in the high layer and extends along it.
    fn finish(&mut self, carried: [Option<&[u64; 12]>; 3]) -> u8 {
        let Some(live) = self.brick.live.as_deref_mut() else { return 0 };
        for (i, (extent, axis)) in PAIRS.into_iter().enumerate() {
            let layer = carried[axis.index()].map_or(0, |carries| carries[i]);
            if layer != 0 {
                live[extent.index()] &= !Plane::from_low_layer(axis, layer);
            }
        }
        let lost: Planes = std::array::from_fn(|extent| live[extent] ^ self.before[extent]);
        let along = Axis::ALL.map(|axis| {
            let with = Extent::ALL.into_iter().filter(|extent| extent.contains(axis));
            with.fold(Plane::EMPTY, |all, extent| all | lost[extent.index()])
        });
        let touches = Axis::ALL.map(|axis| u8::from(along[axis.index()].touches_max(axis)) << axis.index());
        let lost = along.iter().fold(lost[0], |all, plane| all | *plane);
        touches.iter().fold(u8::from(!lost.is_empty()) << 3, |all, bit| all | bit)
    }
}

impl Record {
    /// Notes that the elements one dimension above `extent`, along `axis`, were removed with their low and high parts.
    fn note(&mut self, extent: Extent, axis: Axis, low: Plane, high: Plane) {
        let both = low | high;
        if extent.dimension() == 2 {
            let number = axis.index() + 1;
            for (bit, plane) in self.cells[..2].iter_mut().enumerate() {
                if number >> bit & 1 == 1 {
                    *plane |= both;
                }
            }
            self.cells[2] |= high;
        } else {
            let normal = (extent | axis).complement().axes().next().expect("a face has a normal");
            let [paired, second, is_high] = &mut self.faces[normal.index()];
            *paired |= both;
            if normal.others()[1] == axis {
                *second |= both;
            }
            *is_high |= high;
        }
    }
}
