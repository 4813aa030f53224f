//! Connected sets of points of a complex, under those edges that a caller chooses.
//!
//! Inside a brick, sets grow by shifting planes; between bricks they are joined through the layers that touch, in disjoint sets. Full bricks
//! that were never opened are taken row by row: between two listed bricks of a row there is a gap, a single node, which is joined to
//! its neighbours and to the gaps beside it. So the cost is that of the listed bricks, whatever lies between them.
//!
//! In the background, the sentinel is set 0, and so is whatever is joined to it: edges with a missing end lead there.
//!
//! Cost: some 1 to 2 us a brick.

use super::complex::{Complex, DEEP, NOTHING, Spot};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Extent, Face};
use rayon::prelude::*;

/// The set of the sentinel.
pub(super) const SENTINEL: u32 = 0;

/// A partition of the points of a complex.
#[derive(Debug)]
pub(super) struct Labels {
    /// By brick, the first of its parts; one more at the end.
    first: Vec<u32>,
    /// Connected within their brick, disjoint.
    parts: Vec<Plane>,
    rows: Rows,
    /// By node, the least node of its set. Node 0 is the sentinel, node n + 1 is part n, then come the gaps.
    roots: Vec<u32>,
}

impl Labels {
    /// Joins the ends of the chosen edges: `joins` gives those along x, y, z that start in a brick. In full bricks that have not been opened
    /// all edges join.
    pub(super) fn new(complex: &Complex, joins: impl Fn(u32) -> [Plane; 3] + Sync + Send) -> Labels {
        let bricks = 0..complex.bricks.len() as u32;
        let joins: Vec<[Plane; 3]> = bricks.clone().into_par_iter().map(&joins).collect();
        let sets: Vec<Vec<Plane>> = bricks
            .into_par_iter()
            .map(|brick| connected(complex.live(brick)[Extent::POINT.index()], &joins[brick as usize]))
            .collect();
        let mut first = Vec::with_capacity(sets.len() + 1);
        let mut parts = Vec::new();
        for set in sets {
            first.push(parts.len() as u32);
            parts.extend(set);
        }
        first.push(parts.len() as u32);
        let (rows, nodes) = Rows::new(complex, parts.len() as u32 + 1);
        let mut union = Union { complex, first, parts, rows, parent: (0..nodes).collect() };
        union.join_gaps();
        for (brick, joins) in (0..).zip(&joins) {
            union.join_brick(brick, joins);
        }
        union.finish()
    }

    /// The parts of a brick.
    pub(super) fn parts(&self, brick: u32) -> impl Iterator<Item = (u32, &Plane)> {
        let range = self.first[brick as usize]..self.first[brick as usize + 1];
        range.map(|part| (self.roots[part as usize + 1], &self.parts[part as usize]))
    }

    /// The set of a live point.
    pub(super) fn set(&self, brick: u32, point: Local) -> Option<u32> {
        self.parts(brick).find(|(_, part)| part.get(point)).map(|(root, _)| root)
    }

    /// The set of one end of an edge; the sentinel's if that end is missing. In an unopened brick, the set of any point of it.
    pub(super) fn end(&self, complex: &Complex, edge: Spot, high: bool) -> u32 {
        let axis = edge.extent.axes().next().expect("an edge has an axis");
        let end = complex.half_toward(edge, Face::new(axis, high));
        end.and_then(|end| self.set(end.brick, end.local)).unwrap_or(SENTINEL)
    }

    /// One more than the greatest name of a set.
    pub(super) fn names(&self) -> usize {
        self.roots.len()
    }

    /// The names of all sets, ascending, without the sentinel's.
    pub(super) fn sets(&self) -> Vec<u32> {
        (1..).zip(&self.roots[1..]).filter(|(node, root)| node == *root).map(|(node, _)| node).collect()
    }

    /// The set of the full brick, not opened, on one side of a brick.
    pub(super) fn set_beside(&self, complex: &Complex, brick: u32, face: Face) -> u32 {
        self.roots[self.rows.gap_beside(complex, brick, face) as usize]
    }
}

/// The connected sets of points in a brick.
fn connected(points: Plane, joins: &[Plane; 3]) -> Vec<Plane> {
    let mut sets = Vec::new();
    let mut left = points;
    loop {
        let Some(seed) = left.iter().next() else { return sets };
        let mut set = Plane::EMPTY;
        set.set(seed);
        loop {
            let mut next = set;
            for (axis, along) in Axis::ALL.into_iter().zip(joins) {
                next |= (next & *along).at_minus(axis, &Plane::EMPTY);
                next |= next.at_plus(axis, &Plane::EMPTY) & *along;
            }
            next &= points;
            if next == set {
                break;
            }
            set = next;
        }
        left &= !set;
        sets.push(set);
    }
}

/// A listed brick in its row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    /// y and z, in bricks.
    row: [u32; 2],
    x: u32,
    brick: u32,
    /// The node of the gap between this brick and the next one of the row, or [`NOTHING`].
    gap: u32,
}

/// The listed bricks by rows, and the gaps between them.
#[derive(Debug)]
struct Rows {
    entries: Vec<Entry>,
    /// Bricks in a row of the box.
    length: u32,
}

impl Rows {
    /// Numbers the gaps from `nodes` on; also returns the number after the last.
    fn new(complex: &Complex, mut nodes: u32) -> (Rows, u32) {
        let entry = |brick: u32| {
            let [x, y, z] = complex.position(brick);
            Entry { row: [y, z], x, brick, gap: NOTHING }
        };
        let mut entries: Vec<Entry> = (0..complex.bricks.len() as u32).map(entry).collect();
        entries.par_sort_unstable();
        for i in 0..entries.len() {
            if complex.beside(entries[i].brick, Face::new(Axis::X, true)) == DEEP {
                let is_last = entries.get(i + 1).is_none_or(|next| next.row != entries[i].row);
                entries[i].gap = if is_last { SENTINEL } else { nodes };
                nodes += u32::from(!is_last);
            }
        }
        (Rows { entries, length: complex.extents()[0] }, nodes)
    }

    /// The gap after an entry: its node, and its bricks.
    fn gap_after(&self, i: usize) -> Option<(u32, u32, u32)> {
        let entry = self.entries[i];
        let next = self.entries.get(i + 1).filter(|next| next.row == entry.row);
        let end = next.map_or(self.length, |next| next.x);
        (entry.gap != NOTHING).then_some((entry.gap, entry.x + 1, end))
    }

    /// The first entry that is not before a place in a row.
    fn from(&self, row: [u32; 2], x: u32) -> usize {
        self.entries.partition_point(|entry| (entry.row, entry.x) < (row, x))
    }

    /// The node of the gap around the unopened brick on one side of a brick.
    fn gap_beside(&self, complex: &Complex, brick: u32, face: Face) -> u32 {
        let mut at = complex.position(brick);
        let c = &mut at[face.axis().index()];
        *c = if face.is_high() { *c + 1 } else { *c - 1 };
        let [x, y, z] = at;
        match self.from([y, z], x).checked_sub(1).map(|i| self.entries[i]) {
            Some(entry) if entry.row == [y, z] => entry.gap,
            _ => SENTINEL,
        }
    }
}

struct Union<'a> {
    complex: &'a Complex,
    first: Vec<u32>,
    parts: Vec<Plane>,
    rows: Rows,
    parent: Vec<u32>,
}

impl Union<'_> {
    /// Joins gaps of neighbouring rows where they lie beside each other.
    fn join_gaps(&mut self) {
        let [_, height, depth] = self.complex.extents();
        for i in 0..self.rows.entries.len() {
            let Some((node, from, to)) = self.rows.gap_after(i) else { continue };
            let [y, z] = self.rows.entries[i].row;
            for row in [[y.wrapping_sub(1), z], [y + 1, z], [y, z.wrapping_sub(1)], [y, z + 1]] {
                if row[0] >= height || row[1] >= depth {
                    // The gap lies on the boundary of the box.
                    self.join(node, SENTINEL);
                    continue;
                }
                let mut place = self.rows.from(row, from);
                let before = place.checked_sub(1).filter(|&i| self.rows.entries[i].row == row);
                let is_there = |entry: Option<&Entry>| entry.is_some_and(|entry| entry.row == row && entry.x == from);
                if !is_there(self.rows.entries.get(place)) {
                    self.join(node, before.map_or(SENTINEL, |i| self.rows.entries[i].gap));
                }
                while let Some(entry) =
                    self.rows.entries.get(place).filter(|entry| entry.row == row && entry.x + 1 < to)
                {
                    let gap = entry.gap;
                    if gap != NOTHING {
                        self.join(node, gap);
                    }
                    place += 1;
                }
            }
        }
    }

    /// Joins the parts of a brick with those of its high neighbours, with gaps and with the sentinel.
    fn join_brick(&mut self, brick: u32, joins: &[Plane; 3]) {
        let points = self.complex.live(brick)[Extent::POINT.index()];
        for (axis, &along) in Axis::ALL.into_iter().zip(joins) {
            let missing_start = (along & !points).at_minus(axis, &Plane::EMPTY);
            if !missing_start.is_empty() {
                self.join_parts(brick, |part| !(*part & missing_start).is_empty(), SENTINEL);
            }
            if self.complex.beside(brick, Face::new(axis, false)) == DEEP {
                let gap = self.rows.gap_beside(self.complex, brick, Face::new(axis, false));
                self.join_parts(brick, |part| part.low_layer(axis) != 0, gap);
            }
            let leaving = along.high_layer(axis);
            let high = self.complex.beside(brick, Face::new(axis, true));
            if leaving == 0 {
                continue;
            }
            if high == DEEP {
                let gap = self.rows.gap_beside(self.complex, brick, Face::new(axis, true));
                self.join_parts(brick, |part| part.high_layer(axis) & leaving != 0, gap);
                continue;
            }
            let there = self.complex.live(high)[Extent::POINT.index()].low_layer(axis);
            if leaving & !there != 0 {
                self.join_parts(brick, |part| part.high_layer(axis) & leaving & !there != 0, SENTINEL);
            }
            if high < DEEP {
                for n in self.first[high as usize]..self.first[high as usize + 1] {
                    let met = self.parts[n as usize].low_layer(axis) & leaving;
                    if met != 0 {
                        self.join_parts(brick, |part| part.high_layer(axis) & met != 0, n + 1);
                    }
                }
            }
        }
    }

    /// Joins a node with those parts of a brick for which the answer is yes.
    fn join_parts(&mut self, brick: u32, which: impl Fn(&Plane) -> bool, node: u32) {
        for part in self.first[brick as usize]..self.first[brick as usize + 1] {
            if which(&self.parts[part as usize]) {
                self.join(part + 1, node);
            }
        }
    }

    fn join(&mut self, a: u32, b: u32) {
        debug_assert!(a != NOTHING && b != NOTHING, "what is not listed is a gap");
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    fn root(&mut self, mut a: u32) -> u32 {
        while self.parent[a as usize] != a {
            let next = self.parent[a as usize];
            self.parent[a as usize] = self.parent[next as usize];
            a = next;
        }
        a
    }

    fn finish(mut self) -> Labels {
        let roots = (0..self.parent.len() as u32).map(|node| self.root(node)).collect();
        Labels { first: self.first, parts: self.parts, rows: self.rows, roots }
    }
}
