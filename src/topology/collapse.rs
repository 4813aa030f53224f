//! What a brick does in a step of [thinning](super::thin): it finds its elements with exactly one coface, and lets the elements that are that
//! coface choose among them.
//!
//! Elements with exactly one coface are ones and twos of shifted planes: of the two elements along an axis beside an element, one starts
//! where it does and the other one step lower. All is done to 256 elements of a kind at a time, in registers of 128 bits, or of 256 where
//! the library is compiled for processors that have them (`wide`).
//!
//! A brick keeps the planes of those kinds only that are marked, and says along which axes they have their coface,
//! so that only these pairs of extents are looked at again.
//!
//! # Cost
//!
//! Some 1,600 instructions to find the marks of a brick, and as many to choose.

use super::complex::{Brick, Complex, Planes, Record};
use crate::grid::brick::{Bits, Plane, Z0};
use crate::grid::{Axis, Extent, Face};
use wide::u64x4;

/// The pairs of extents that collapse, as lower extent and axis that the upper one has beside.
pub(super) const PAIRS: [(Extent, Axis); 12] = {
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

/// The number of a pair, by lower extent and axis.
const NUMBERS: [[usize; 3]; 8] = {
    let mut numbers = [[PAIRS.len(); 3]; 8];
    let mut n = 0;
    while n < PAIRS.len() {
        numbers[PAIRS[n].0.index()][PAIRS[n].1.index()] = n;
        n += 1;
    }
    numbers
};

/// By axis, the pairs whose upper part extends along it where the lower one does not, as bits.
const ALONG: [u16; 3] = {
    let mut along = [0; 3];
    let mut i = 0;
    while i < PAIRS.len() {
        along[PAIRS[i].1.index()] |= 1 << i;
        i += 1;
    }
    along
};

/// Which elements of a brick have exactly one coface.
pub(super) struct Marks {
    pub(super) brick: u32,
    /// By [pair](PAIRS), whether there are any of the lower extent whose one coface is of the upper one.
    pairs: u16,
    /// By extent, whether there are any.
    kinds: u8,
    /// Those of `pairs` that have one in the low layer, so that its coface may be in the brick below.
    low: u16,
    /// Whether there are faces that would be marked if erosion went along their normal in this step.
    pub(super) waiting: bool,
    /// The first of its planes.
    first: u16,
}

impl Marks {
    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.pairs == 0
    }

    /// Whether the low neighbour along an axis may choose one of them.
    pub(super) fn is_beside(&self, axis: Axis) -> bool {
        self.low & ALONG[axis.index()] != 0
    }
}

/// The marks of a group of bricks.
#[derive(Default)]
pub(super) struct Marked {
    pub(super) bricks: Vec<Marks>,
    /// Of each brick, those of its kinds that are there.
    planes: Vec<Plane>,
}

impl Marked {
    pub(super) fn clear(&mut self) {
        self.bricks.clear();
        self.planes.clear();
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.bricks.capacity() * size_of::<Marks>() + self.planes.capacity() * size_of::<Plane>()
    }

    /// The marks of the brick at a place of the group.
    pub(super) fn of(&self, place: usize) -> MarksOf<'_> {
        let Marks { pairs, low, kinds, first, .. } = self.bricks[place];
        MarksOf { pairs, low, kinds, planes: &self.planes[usize::from(first)..] }
    }

    /// Finds those of a brick; cells are eroded along the axes in `erode`. A group has at most 64 bricks.
    pub(super) fn find(&mut self, complex: &Complex, brick: u32, erode: Option<Extent>) {
        let live = complex.live(brick);
        let low = |axis| complex.live(complex.beside(brick, Face::new(axis, false)));
        let low = [low(Axis::X), low(Axis::Y), low(Axis::Z)];
        let kept = complex.bricks[brick as usize].kept.as_deref();
        let mut found = Found { planes: [Plane::EMPTY; 7], any: [0; 12] };
        found.once_covered(live, low, 0);
        found.once_covered(live, low, LANES);
        let Found { planes: mut found, any } = found;
        let mut marks = Marks { brick, pairs: 0, kinds: 0, low: 0, waiting: false, first: self.planes.len() as u16 };
        for (i, any) in any.into_iter().enumerate() {
            marks.pairs |= u16::from(any != 0) << i;
        }
        for axis in Axis::ALL {
            let pair = NUMBERS[(!Extent::from(axis)).index()][axis.index()];
            if erode.is_none_or(|axes| !axes.contains(axis)) && marks.pairs >> pair & 1 == 1 {
                marks.waiting |= erode.is_some();
                marks.pairs &= !(1 << pair);
            }
        }
        if let Some(kept) = kept {
            found.iter_mut().zip(kept).for_each(|(plane, kept)| *plane &= !*kept);
            let is_there = |i: u32| !found[PAIRS[i as usize].0.index()].is_empty();
            marks.pairs = Bits(marks.pairs.into()).filter(|&i| is_there(i)).fold(0, |pairs, i| pairs | 1 << i);
        }
        for i in Bits(marks.pairs.into()) {
            let (extent, axis) = PAIRS[i as usize];
            marks.kinds |= 1 << extent.index();
            marks.low |= u16::from(found[extent.index()].touches_min(axis)) << i;
        }
        self.planes.extend(Bits(marks.kinds.into()).map(|i| found[i as usize]));
        self.bricks.push(marks);
    }
}

/// The marks of a brick, with its planes.
#[derive(Clone, Copy)]
pub(super) struct MarksOf<'a> {
    pairs: u16,
    low: u16,
    kinds: u8,
    planes: &'a [Plane],
}

impl<'a> MarksOf<'a> {
    pub(super) const NONE: MarksOf<'static> = MarksOf { pairs: 0, low: 0, kinds: 0, planes: &[] };

    #[inline]
    fn plane(self, extent: Extent) -> Option<&'a Plane> {
        let before = self.kinds & ((1 << extent.index()) - 1);
        (self.kinds >> extent.index() & 1 == 1).then(|| &self.planes[usize::from(COUNTS[usize::from(before)])])
    }
}

/// How many bits there are in a number of seven.
const COUNTS: [u8; 128] = {
    let mut counts = [0; 128];
    let mut i = 0;
    while i < 128 {
        counts[i] = i.count_ones() as u8;
        i += 1;
    }
    counts
};

/// Words that are worked on together: two registers of every processor of a kind.
const LANES: usize = 4;

type Words = u64x4;

/// Those of a plane from word `x` on.
#[inline]
fn words(plane: &Plane, x: usize) -> Words {
    Words::from([plane.0[x], plane.0[x + 1], plane.0[x + 2], plane.0[x + 3]])
}

#[inline]
fn store(words: Words, plane: &mut Plane, x: usize) {
    plane.0[x..x + LANES].copy_from_slice(words.as_array_ref());
}

#[inline]
fn union(words: Words) -> u64 {
    let [a, b, c, d] = words.to_array();
    a | b | c | d
}

/// The elements of a brick with exactly one coface.
struct Found {
    /// By extent.
    planes: [Plane; 7],
    /// By [pair](PAIRS), whether there are any of the lower extent whose one coface is of the upper one.
    any: [u64; 12],
}

impl Found {
    /// Of the elements of `lower`, those with exactly one coface, from word `x` on; of them, those that have it along each of some axes.
    #[inline(always)]
    #[expect(
        clippy::inline_always,
        reason = "axes and extents are known where it is called: a few operations are left"
    )]
    fn put<const N: usize>(&mut self, lower: Extent, x: usize, once: Words, along: [(Axis, Words); N]) {
        store(once, &mut self.planes[lower.index()], x);
        for (axis, one) in along {
            self.any[NUMBERS[lower.index()][axis.index()]] |= union(once & one);
        }
    }

    /// Finds the elements of a brick with exactly one coface, in the words from `x` on; `low` are the low neighbours of the brick.
    ///
    /// Everything a few words at a time, so that it stays in registers: some 170 operations, and a few where nothing is left or all cells
    /// are.
    #[inline(always)]
    fn once_covered(&mut self, live: &Planes, low: [&Planes; 3], x: usize) {
        use Axis::{X, Y, Z};
        let here = |extent: Extent| words(&live[extent.index()], x);
        let all = live.iter().fold(Words::ZERO, |all, plane| all | words(plane, x));
        if union(all) == 0 {
            return;
        }
        let (a, b, c) = (
            along(live, low, x, Extent::CELL, X),
            along(live, low, x, Extent::CELL, Y),
            along(live, low, x, Extent::CELL, Z),
        );
        for (axis, (one, _)) in [(X, a), (Y, b), (Z, c)] {
            let face = !Extent::from(axis);
            self.put(face, x, here(face) & one, [(axis, one)]);
        }
        if union(!here(Extent::CELL)) == 0 {
            // Every point that begins a cell begins two faces with each edge, and three edges.
            return;
        }
        let (a, aa) = along(live, low, x, Extent::from(X), X);
        let (b, bb) = along(live, low, x, Extent::from(Y), Y);
        let (c, cc) = along(live, low, x, Extent::from(Z), Z);
        let once = here(Extent::POINT) & (a ^ b ^ c) & !(a & b & c | aa | bb | cc);
        self.put(Extent::POINT, x, once, [(X, a), (Y, b), (Z, c)]);
        for (axis, u, v) in [(X, Y, Z), (Y, X, Z), (Z, X, Y)] {
            let edge = Extent::from(axis);
            let (a, aa) = along(live, low, x, edge | u, u);
            let (b, bb) = along(live, low, x, edge | v, v);
            self.put(edge, x, here(edge) & (a ^ b) & !(aa | bb), [(u, a), (v, b)]);
        }
    }
}

/// For the words from `x` on of the elements that have `upper` beside them along an axis, on either side: those for which just one is there,
/// and those for which both are.
#[inline(always)]
#[expect(clippy::inline_always, reason = "axis and extent are known where it is called: a few operations are left")]
fn along(live: &Planes, low: [&Planes; 3], x: usize, upper: Extent, axis: Axis) -> (Words, Words) {
    let (own, next) = (&live[upper.index()], &low[axis.index()][upper.index()]);
    let above = words(own, x);
    let below = match axis {
        Axis::X => Words::from([if x == 0 { next.0[7] } else { own.0[x - 1] }, own.0[x], own.0[x + 1], own.0[x + 2]]),
        Axis::Y => above << 8 | words(next, x) >> 56,
        Axis::Z => above << 1 & Words::splat(!Z0) | words(next, x) >> 7 & Words::splat(Z0),
    };
    (above ^ below, above & below)
}

/// What was chosen in the layers next to the high neighbours and has its lower part there.
#[derive(Clone)]
pub(super) struct Carries {
    /// The pairs of which there is any.
    pairs: u16,
    layers: [u64; 12],
}

impl Carries {
    pub(super) const NONE: Carries = Carries { pairs: 0, layers: [0; 12] };
}

impl Brick {
    /// Lets the elements of the brick choose among the marks in their boundary: its own, and those of the high neighbours.
    pub(super) fn choose(&mut self, own: MarksOf<'_>, high: [MarksOf<'_>; 3], carries: &mut Carries) -> Lost {
        let mut lost = Lost::default();
        let Some(live) = self.live.as_deref_mut() else { return lost };
        let [x, y, z] = high;
        let pairs = own.pairs | x.low & ALONG[0] | y.low & ALONG[1] | z.low & ALONG[2];
        for i in Bits(pairs.into()).map(|i| i as usize) {
            let (extent, axis) = PAIRS[i];
            let (marked, next) = match (own.plane(extent), high[axis.index()].plane(extent)) {
                (None, None) => continue,
                (marked, next) => (marked.unwrap_or(&Plane::EMPTY), next.unwrap_or(&Plane::EMPTY)),
            };
            let parts = [extent.index(), (extent | axis).index()];
            let [lower, upper] = live.get_disjoint_mut(parts).expect("two extents");
            let taken = match axis {
                Axis::X => Taken::new::<0>(marked, next, lower, upper),
                Axis::Y => Taken::new::<1>(marked, next, lower, upper),
                Axis::Z => Taken::new::<2>(marked, next, lower, upper),
            };
            if taken.union == 0 {
                continue;
            }
            let layer = taken.high.high_layer(axis);
            if layer != 0 {
                carries.pairs |= 1 << i;
                carries.layers[i] = layer;
            }
            lost.add(&taken.all, extent | axis);
            if extent.dimension() > 0 {
                self.record.get_or_insert_with(|| Box::new(Record::NONE)).note(extent, axis, &taken);
            }
        }
        lost
    }

    /// Takes away what the low neighbours chose here.
    pub(super) fn finish(&mut self, carried: [Option<&Carries>; 3], lost: &mut Lost) {
        let Some(live) = self.live.as_deref_mut() else { return };
        for (axis, carried) in Axis::ALL.into_iter().zip(carried) {
            let Some(carried) = carried else { continue };
            for i in Bits((carried.pairs & ALONG[axis.index()]).into()).map(|i| i as usize) {
                let (extent, plane) = (PAIRS[i].0, Plane::from_low_layer(axis, carried.layers[i]));
                live[extent.index()] &= !plane;
                lost.add(&plane, extent);
            }
        }
        if lost.is_any() && live.iter().all(Plane::is_empty) {
            self.live = None;
        }
    }
}

/// The elements of a brick that have chosen an element of their boundary along one axis.
struct Taken {
    all: Plane,
    /// Those that have chosen the high one.
    high: Plane,
    /// All words of `all`.
    union: u64,
}

impl Taken {
    /// Lets those of `upper` choose along axis `A` among those that are marked, here and in the `next` brick, and takes both away; of what
    /// is chosen in the next brick only the layer that carries tell of is left there.
    #[inline]
    fn new<const A: usize>(marked: &Plane, next: &Plane, lower: &mut Plane, upper: &mut Plane) -> Taken {
        let mut taken = Taken { all: Plane::EMPTY, high: Plane::EMPTY, union: 0 };
        for x in [0, LANES] {
            let (own, next_words) = (words(marked, x), words(next, x));
            let ahead = match A {
                0 => Words::from([
                    marked.0[x + 1],
                    marked.0[x + 2],
                    marked.0[x + 3],
                    if x == 0 { marked.0[4] } else { next.0[0] },
                ]),
                1 => own >> 8 | next_words << 56,
                _ => own >> 1 & Words::splat(!(Z0 << 7)) | (next_words & Words::splat(Z0)) << 7,
            };
            let there = words(upper, x);
            let chosen = (own | ahead) & there;
            store(chosen, &mut taken.all, x);
            store(chosen & !own, &mut taken.high, x);
            store(there & !chosen, upper, x);
            taken.union |= union(chosen);
        }
        for x in [0, LANES] {
            let high = words(&taken.high, x);
            let above = match A {
                0 => Words::from([
                    if x == 0 { 0 } else { taken.high.0[3] },
                    taken.high.0[x],
                    taken.high.0[x + 1],
                    taken.high.0[x + 2],
                ]),
                1 => high << 8,
                _ => high << 1 & Words::splat(!Z0),
            };
            store(words(lower, x) & !(words(&taken.all, x) & !high | above), lower, x);
        }
        taken
    }
}

/// What a brick has lost in a step: bit 3 if anything, and for each axis (bits 0 to 2) whether something of that lies in the high layer and
/// extends along it.
#[derive(Clone, Copy, Default)]
pub(super) struct Lost(u8);

impl Lost {
    fn add(&mut self, plane: &Plane, extent: Extent) {
        self.0 |= extent.axes().fold(1 << 3, |all, axis| all | u8::from(plane.touches_max(axis)) << axis.index());
    }

    pub(super) fn is_any(self) -> bool {
        self.0 != 0
    }

    /// Whether that matters to the high neighbour along an axis.
    pub(super) fn is_beside(self, axis: Axis) -> bool {
        self.0 >> axis.index() & 1 == 1
    }
}

impl Record {
    /// Notes that the elements one dimension above `extent`, along `axis`, were removed with their low and high parts.
    fn note(&mut self, extent: Extent, axis: Axis, taken: &Taken) {
        let Taken { all, high, .. } = taken;
        if extent.dimension() == 2 {
            let number = axis.index() + 1;
            for (bit, plane) in self.cells[..2].iter_mut().enumerate() {
                if number >> bit & 1 == 1 {
                    *plane |= *all;
                }
            }
            self.cells[2] |= *high;
        } else {
            let normal = (extent | axis).complement().axes().next().expect("a face has a normal");
            let [paired, second, is_high] = &mut self.faces[normal.index()];
            *paired |= *all;
            if normal.others()[1] == axis {
                *second |= *all;
            }
            *is_high |= *high;
        }
    }
}
