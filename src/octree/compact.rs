//! [`CompactOctree`]: a signed octree at rest, in less than half the memory.
//!
//! A [`SignedOctree`] is made to be worked on: three planes of crossed edges, signs, places of neighbours and a hash index for each brick,
//! 330 bytes. All of that follows from the signs and the order of the bricks: an edge is crossed where the signs of its ends differ, and
//! a brick without crossings of its own is uniform and needs no record. So what is kept of a brick is
//!
//! ```text
//! key less the one before, less 1   1 to 7 bytes, seven bits each, lowest first, the highest bit where more follow
//! flags                             bits 0, 1, 2: the first point beyond the high side along x, y, z is inside;
//!                                   bit 3: rows are like those before them along x, not y
//! number of crossings               1 or 2 bytes, as the key
//! which rows are not as expected    8 bytes, a bit for each of the 64 rows of 8 points along z
//! those rows                        a byte each
//! ```
//!
//! some 40 bytes, and offsets and normals as they are: nothing is lost, and [`into_signed`](CompactOctree::into_signed) gives the same
//! octree, bit by bit. Of every 16 bricks the first has its key and places in a table, so that any brick is found by bisection and a
//! walk over at most 15 records.
//!
//! # Cost
//!
//! Real meshes take 2.5 to 2.7 bytes for each cell with a change of sign, with normals 4.5 to 4.7. Either way some 0.5 us a brick, in
//! parallel from here to the signed octree. A question about a point takes about 0.2 us, about an edge 1 us.
//!
//! # Invariants
//!
//! - Bricks are in Z-order; each has at least one crossing.
//! - A brick that is not there is uniform; its sign is that of any of its points, told by the flags of the brick before it.

use super::crossings::{Builder, Codes, Sample, lattice_point};
use super::signed::SignedOctree;
use crate::grid::brick::{Local, Plane};
use crate::grid::key::{deinterleave, interleave};
use crate::grid::{Axis, Key};
use crate::parallel::{in_order, pieces};
use crate::progress::Silent;

/// Bricks for each entry of the table.
const GROUP: usize = 16;
/// Bytes of a page of records.
const PAGE: usize = 1 << 16;
/// The most bytes of a record.
const RECORD: usize = 7 + 1 + 2 + 8 + 64;

/// A signed octree that takes little room and answers questions, but slowly. See the [module](self).
#[derive(Debug, Clone)]
pub struct CompactOctree {
    signs: Signs,
    offsets: Codes,
    normals: Codes,
}

/// The signs of all bricks with crossings.
#[derive(Debug, Clone)]
struct Signs {
    depth: u32,
    with_normals: bool,
    bricks: usize,
    groups: Vec<Group>,
    /// Records one after another; those of a group are on one page.
    pages: Vec<Vec<u8>>,
}

/// The first of some bricks.
#[derive(Debug, Clone, Copy)]
struct Group {
    /// Coordinates of the brick, in bricks, interleaved.
    code: u64,
    page: u32,
    /// Where on the page.
    at: u32,
    /// Number of crossings before the brick.
    first: u32,
}

/// A record, read.
#[derive(Debug, Clone, Copy)]
struct Record<'a> {
    code: u64,
    first: u32,
    flags: u8,
    /// Which rows are not as expected.
    changes: u64,
    rows: &'a [u8],
}

/// The flag of rows that are like those before them along x.
const ALONG_X: u8 = 8;

impl From<SignedOctree> for CompactOctree {
    /// The bricks of `octree` are given back as they are packed; offsets and normals stay where they are.
    fn from(octree: SignedOctree) -> Self {
        let (crossings, inside) = octree.into_parts();
        let (depth, with_normals) = (crossings.depth(), crossings.with_normals());
        let (bricks, mut offsets, mut normals) = crossings.into_parts();
        offsets.shrink_to_fit();
        normals.shrink_to_fit();
        let mut signs = Signs { depth, with_normals, bricks: 0, groups: Vec::new(), pages: Vec::new() };
        let mut before = 0;
        for (brick, inside) in bricks.into_iter().zip(inside).filter(|(brick, _)| brick.count() > 0) {
            let code = interleave(lattice_point(depth, brick.key).map(|c| c >> 3));
            before = signs.push(code, before, brick.first, brick.count(), &inside, &brick.crossed);
        }
        signs.groups.shrink_to_fit();
        if let Some(page) = signs.pages.last_mut() {
            page.shrink_to_fit();
        }
        CompactOctree { signs, offsets, normals }
    }
}

impl CompactOctree {
    /// log2 of the number of cells a side.
    pub fn depth(&self) -> u32 {
        self.signs.depth
    }

    /// Number of crossed edges.
    pub fn len(&self) -> usize {
        self.offsets.len()
    }

    /// Whether no edge is crossed.
    pub fn is_empty(&self) -> bool {
        self.offsets.is_empty()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let pages: usize = self.signs.pages.iter().map(|page| page.capacity() + size_of::<Vec<u8>>()).sum();
        pages
            + self.signs.groups.capacity() * size_of::<Group>()
            + self.offsets.allocated_bytes()
            + self.normals.allocated_bytes()
    }

    /// Whether lattice point `at` (in cells, 0 ..= 2^depth) is inside. Cost: a search a brick along x until one is found.
    pub fn is_inside(&self, at: [u32; 3]) -> bool {
        let [x, y, z] = at.map(|c| c >> 3);
        for bx in (0..=x).rev() {
            if let Some(record) = self.signs.find(interleave([bx, y, z])) {
                return if bx == x {
                    record.inside().get(Local::new(at[0], at[1], at[2]))
                } else {
                    record.is_inside_beyond(Axis::X)
                };
            }
        }
        false
    }

    /// The sample of a finest edge, if it is crossed. Cost: four searches.
    pub fn sample(&self, edge: Key) -> Option<Sample> {
        let axis = edge.dir().axes().next()?;
        let [x, y, z] = lattice_point(self.signs.depth, edge);
        let record = self.signs.find(interleave([x, y, z].map(|c| c >> 3)))?;
        let crossed = self.signs.crossed(&record);
        let local = Local::new(x, y, z);
        let before: u32 = crossed[..axis.index()].iter().map(Plane::count).sum();
        let place = (record.first + before + crossed[axis.index()].rank(local)) as usize;
        crossed[axis.index()].get(local).then(|| Sample {
            offset: self.offsets[place],
            normal: if self.signs.with_normals { self.normals[place] } else { 0 },
        })
    }

    /// The octree to work on. Offsets and normals are given back as they are copied.
    pub fn into_signed(self) -> SignedOctree {
        let CompactOctree { signs, offsets, normals } = self;
        let mut builder = Builder::new(signs.depth, signs.with_normals);
        let (mut offsets, mut normals) = (offsets.into_reader(), normals.into_reader());
        let (mut of_offsets, mut of_normals): (Vec<u16>, Vec<u16>) = Default::default();
        let (count, piece) = pieces(signs.groups.len(), 8);
        let unpack = |(): &mut (), n| {
            let records = piece(n).flat_map(|group| signs.group(group));
            records.map(|record| (signs.key(record.code), signs.crossed(&record))).collect()
        };
        let append = |bricks: Vec<(Key, [Plane; 3])>| {
            for (key, crossed) in bricks {
                let count = crossed.iter().map(Plane::count).sum::<u32>() as usize;
                offsets.read(count, &mut of_offsets);
                normals.read(count, &mut of_normals);
                builder.push(key, crossed, &of_offsets, &of_normals);
            }
            Ok(())
        };
        in_order(count, &Silent, || (), unpack, append).expect("nothing fails or is cancelled");
        SignedOctree::from_crossings(builder.finish())
    }
}

impl Signs {
    /// Appends a brick; `before` is the code of the last one. Returns its own.
    fn push(&mut self, code: u64, before: u64, first: u32, count: u32, inside: &Plane, crossed: &[Plane; 3]) -> u64 {
        let starts_group = self.bricks.is_multiple_of(GROUP);
        if starts_group {
            if self.pages.last().is_none_or(|page| page.len() + GROUP * RECORD > PAGE) {
                self.pages.push(Vec::with_capacity(PAGE));
            }
            let (page, at) = (self.pages.len() - 1, self.pages[self.pages.len() - 1].len());
            self.groups.push(Group { code, page: page as u32, at: at as u32, first });
        }
        self.bricks += 1;
        let page = self.pages.last_mut().expect("a group has a page");
        // The first of a group has its code in the table.
        push_number(page, if starts_group { 0 } else { code - before - 1 });
        // A point of the high side of the brick, and whether the edge that leaves the brick there is crossed.
        let beyond = |axis: Axis| {
            let end = Local::from_index(7 * [64, 8, 1][axis.index()]);
            u8::from(inside.get(end) ^ crossed[axis.index()].get(end)) << axis.index()
        };
        let flags = Axis::ALL.into_iter().map(beyond).sum::<u8>();
        let rows = rows(inside);
        let [along_y, along_x] = [0, ALONG_X].map(|flag| changes(&rows, flag));
        let (flags, changes) =
            if along_x.count_ones() < along_y.count_ones() { (flags | ALONG_X, along_x) } else { (flags, along_y) };
        page.push(flags);
        push_number(page, u64::from(count));
        page.extend_from_slice(&changes.to_le_bytes());
        page.extend(crate::grid::brick::Bits(changes).map(|row| rows[row as usize]));
        code
    }

    fn key(&self, code: u64) -> Key {
        Key::cell(self.depth - 3, deinterleave(code)).expect("bricks lie in the root cube")
    }

    /// The records of a group in order.
    fn group(&self, group: usize) -> impl Iterator<Item = Record<'_>> {
        let Group { code, page, at, first } = self.groups[group];
        let bricks = GROUP.min(self.bricks - group * GROUP);
        let mut bytes = &self.pages[page as usize][at as usize..];
        let (mut code, mut first) = (code, first);
        (0..bricks).map(move |i| {
            code += take_number(&mut bytes) + u64::from(i > 0);
            let flags = take(&mut bytes, 1)[0];
            let count = take_number(&mut bytes) as u32;
            let changes = u64::from_le_bytes(take(&mut bytes, 8).try_into().expect("eight bytes"));
            let rows = take(&mut bytes, changes.count_ones() as usize);
            let record = Record { code, first, flags, changes, rows };
            first += count;
            record
        })
    }

    /// The record of a brick.
    fn find(&self, code: u64) -> Option<Record<'_>> {
        let group = self.groups.partition_point(|group| group.code <= code).checked_sub(1)?;
        self.group(group).take_while(|record| record.code <= code).find(|record| record.code == code)
    }

    /// The crossed edges of a brick: those between points of different signs, in it and beyond it.
    fn crossed(&self, record: &Record<'_>) -> [Plane; 3] {
        let inside = record.inside();
        let at = deinterleave(record.code);
        let beyond = |axis: Axis| {
            let mut next = at;
            next[axis.index()] += 1;
            match self.find(interleave(next)) {
                Some(next) => next.inside(),
                None if record.is_inside_beyond(axis) => Plane::FULL,
                None => Plane::EMPTY,
            }
        };
        [
            inside ^ inside.at_plus_x(&beyond(Axis::X)),
            inside ^ inside.at_plus_y(&beyond(Axis::Y)),
            inside ^ inside.at_plus_z(&beyond(Axis::Z)),
        ]
    }
}

impl Record<'_> {
    fn is_inside_beyond(&self, axis: Axis) -> bool {
        self.flags >> axis.index() & 1 == 1
    }

    /// The points of the brick that are inside.
    fn inside(&self) -> Plane {
        let mut rows = [0; 64];
        let mut given = self.rows.iter();
        for row in 0..64 {
            let is_given = self.changes >> row & 1 == 1;
            rows[row] = if is_given { *given.next().expect("a byte a bit") } else { expected(&rows, row, self.flags) };
        }
        let (words, _) = rows.as_chunks();
        Plane(std::array::from_fn(|x| u64::from_le_bytes(words[x])))
    }
}

/// The 64 rows of a plane along z.
fn rows(plane: &Plane) -> [u8; 64] {
    let mut rows = [0; 64];
    let (words, _) = rows.as_chunks_mut();
    words.iter_mut().zip(plane.0).for_each(|(row, word)| *row = word.to_le_bytes());
    rows
}

/// What a row is taken to be, given those before it: like its neighbour along x or y, if there is one, else along the other axis.
fn expected(rows: &[u8; 64], row: usize, flags: u8) -> u8 {
    let (x, y) = (row >> 3, row & 7);
    match (x, y) {
        (0, 0) => 0,
        (0, _) => rows[row - 1],
        (_, 0) => rows[row - 8],
        _ if flags & ALONG_X == 0 => rows[row - 1],
        _ => rows[row - 8],
    }
}

/// The rows that are not as expected.
fn changes(rows: &[u8; 64], flags: u8) -> u64 {
    (0..64).filter(|&row| rows[row] != expected(rows, row, flags)).fold(0, |changes, row| changes | 1 << row)
}

fn push_number(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 128 {
        bytes.push(number as u8 | 128);
        number >>= 7;
    }
    bytes.push(number as u8);
}

fn take<'a>(bytes: &mut &'a [u8], count: usize) -> &'a [u8] {
    let (taken, rest) = bytes.split_at(count);
    *bytes = rest;
    taken
}

fn take_number(bytes: &mut &[u8]) -> u64 {
    let mut number = 0;
    for shift in (0..).step_by(7) {
        let byte = take(bytes, 1)[0];
        number |= u64::from(byte & 127) << shift;
        if byte < 128 {
            break;
        }
    }
    number
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Extent;
    use crate::octree::crossings::{Toggle, finest_element};
    use proptest::prelude::*;

    const DEPTH: u32 = 5;

    /// The octree of balls and single points, with samples that differ.
    fn octree(balls: &[([i32; 3], i32)], with_normals: bool) -> SignedOctree {
        let inside = |p: [u32; 3]| {
            let is_within = |(centre, square): &([i32; 3], i32)| {
                (0..3).map(|a| (p[a] as i32 - centre[a]).pow(2)).sum::<i32>() <= *square
            };
            p.iter().all(|&c| (1..32).contains(&c)) && balls.iter().any(is_within)
        };
        let mut toggles = Vec::new();
        for i in 0..32 * 32 * 32 {
            let at = [i >> 10, i >> 5 & 31, i & 31];
            for axis in Axis::ALL {
                let mut end = at;
                end[axis.index()] += 1;
                if inside(at) != inside(end) {
                    let number = i.wrapping_mul(0x9e37_79b9) >> 7;
                    let sample = Sample::new(number as u16, if with_normals { (number >> 9) as u16 } else { 0 });
                    toggles.push(Toggle { edge: finest_element(DEPTH, at, axis.into()), sample });
                }
            }
        }
        SignedOctree::from_crossings(Builder::new(DEPTH, with_normals).finish().toggled(toggles))
    }

    #[track_caller]
    fn assert_same(a: &SignedOctree, b: &SignedOctree) {
        assert!(a.crossings().bricks().iter().eq(b.crossings().bricks().iter()));
        assert!(a.crossings().offsets().iter().eq(b.crossings().offsets().iter()));
        assert!(a.crossings().normals().iter().eq(b.crossings().normals().iter()));
        assert!(a.inside() == b.inside());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn nothing_is_lost(
            balls in prop::collection::vec((prop::array::uniform3(1i32..32), 0i32..80), 0..9),
            with_normals: bool,
        ) {
            let octree = octree(&balls, with_normals);
            let compact = CompactOctree::from(octree.clone());
            prop_assert_eq!((compact.len(), compact.depth()), (octree.crossings().len(), DEPTH));
            for i in 0..33 * 33 * 33 {
                let at = [i / 33 / 33, i / 33 % 33, i % 33];
                prop_assert_eq!(compact.is_inside(at), octree.is_inside(at), "{:?}", at);
                for axis in Axis::ALL.into_iter().filter(|_| at.iter().all(|&c| c < 32)) {
                    let edge = finest_element(DEPTH, at, Extent::from(axis));
                    prop_assert_eq!(compact.sample(edge), octree.crossings().sample(edge));
                }
            }
            assert_same(&compact.into_signed(), &octree);
        }

        #[test]
        fn numbers_come_back(numbers in prop::collection::vec(any::<u64>(), 0..9), shift in 0u32..64) {
            let mut bytes = Vec::new();
            numbers.iter().for_each(|n| push_number(&mut bytes, n >> shift));
            let mut rest = &bytes[..];
            numbers.iter().for_each(|n| assert_eq!(take_number(&mut rest), n >> shift));
            prop_assert!(rest.is_empty());
        }

        #[test]
        fn planes_come_back(words: [u64; 8], mask: [u64; 8]) {
            let plane = Plane(words) & Plane(mask);
            for flags in [0, ALONG_X] {
                let rows = rows(&plane);
                let changes = changes(&rows, flags);
                let given: Vec<u8> = crate::grid::brick::Bits(changes).map(|row| rows[row as usize]).collect();
                prop_assert_eq!(Record { code: 0, first: 0, flags, changes, rows: &given }.inside(), plane);
            }
        }
    }

    #[test]
    fn nothing_is_nothing() {
        let compact = CompactOctree::from(octree(&[], true));
        assert!(compact.is_empty() && !compact.is_inside([5; 3]) && compact.bytes() == 0);
        assert_same(&compact.into_signed(), &octree(&[], true));
    }
}
