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
    /// By part, gap after the parts, the least node of its set. Node 0 is the sentinel, node n + 1 is part n.
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
        let labels = Labels { first, parts, roots: Vec::new() };
        let mut union = Union { labels, complex, parent: Vec::new(), rows: Vec::new() };
        union.list_gaps();
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

    /// By name of a set, the number of full bricks in the gaps that belong to it. (Only the volumes of sets ask.)
    pub(super) fn deep_bricks(&self, complex: &Complex) -> Vec<u64> {
        let mut union = Union::again(self, complex);
        union.list_gaps();
        let mut count = vec![0; self.names()];
        for i in 0..union.rows.len() {
            if let Some((node, from, to)) = union.gap_after(i) {
                count[self.roots[node as usize] as usize] += u64::from(to - from);
            }
        }
        count
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

struct Union<'a> {
    labels: Labels,
    complex: &'a Complex,
    parent: Vec<u32>,
    rows: Vec<Entry>,
}

impl<'a> Union<'a> {
    /// As it was before the parts were joined, to ask for gaps once more.
    fn again(labels: &Labels, complex: &'a Complex) -> Self {
        let labels = Labels { first: labels.first.clone(), parts: labels.parts.clone(), roots: Vec::new() };
        Union { labels, complex, parent: Vec::new(), rows: Vec::new() }
    }

    fn list_gaps(&mut self) {
        let complex = self.complex;
        let entry = |brick: u32| {
            let [x, y, z] = complex.position(brick);
            Entry { row: [y, z], x, brick, gap: NOTHING }
        };
        self.rows = (0..complex.bricks.len() as u32).map(entry).collect();
        self.rows.par_sort_unstable();
        let mut nodes = self.labels.parts.len() as u32 + 1;
        for i in 0..self.rows.len() {
            let entry = self.rows[i];
            if complex.beside(entry.brick, Face::new(Axis::X, true)) == DEEP {
                let is_last = self.rows.get(i + 1).is_none_or(|next| next.row != entry.row);
                self.rows[i].gap = if is_last { SENTINEL } else { nodes };
                nodes += u32::from(!is_last);
            }
        }
        self.parent = (0..nodes).collect();
    }

    /// The gap after an entry: its node, and its bricks.
    fn gap_after(&self, i: usize) -> Option<(u32, u32, u32)> {
        let entry = self.rows[i];
        let next = self.rows.get(i + 1).filter(|next| next.row == entry.row);
        let end = next.map_or(self.complex.extents()[0], |next| next.x);
        (entry.gap != NOTHING).then_some((entry.gap, entry.x + 1, end))
    }

    /// The first entry after a place in a row.
    fn after(&self, row: [u32; 2], x: u32) -> usize {
        self.rows.partition_point(|entry| (entry.row, entry.x) < (row, x))
    }

    /// The node of the gap around an unopened brick.
    fn gap_at(&self, [x, y, z]: [u32; 3]) -> u32 {
        let after = self.after([y, z], x);
        match after.checked_sub(1).map(|i| self.rows[i]) {
            Some(entry) if entry.row == [y, z] => entry.gap,
            _ => SENTINEL,
        }
    }

    /// Joins gaps of neighbouring rows where they lie beside each other.
    fn join_gaps(&mut self) {
        let [_, height, depth] = self.complex.extents();
        for i in 0..self.rows.len() {
            let Some((node, from, to)) = self.gap_after(i) else { continue };
            let [y, z] = self.rows[i].row;
            for row in [[y.wrapping_sub(1), z], [y + 1, z], [y, z.wrapping_sub(1)], [y, z + 1]] {
                if row[0] >= height || row[1] >= depth {
                    // The gap lies on the boundary of the box.
                    self.join(node, SENTINEL);
                    continue;
                }
                let mut place = self.after(row, from);
                let before = place.checked_sub(1).filter(|&i| self.rows[i].row == row);
                let is_there = |entry: Option<&Entry>| entry.is_some_and(|entry| entry.row == row && entry.x == from);
                if !is_there(self.rows.get(place)) {
                    self.join(node, before.map_or(SENTINEL, |i| self.rows[i].gap));
                }
                while let Some(entry) = self.rows.get(place).filter(|entry| entry.row == row && entry.x + 1 < to) {
                    if entry.gap != NOTHING {
                        self.join(node, entry.gap);
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
                let gap = self.gap_beside(brick, axis, false);
                self.join_parts(brick, |part| part.low_layer(axis) != 0, gap);
            }
            let leaving = along.high_layer(axis);
            let high = self.complex.beside(brick, Face::new(axis, true));
            if leaving == 0 {
                continue;
            }
            if high == DEEP {
                let gap = self.gap_beside(brick, axis, true);
                self.join_parts(brick, |part| part.high_layer(axis) & leaving != 0, gap);
                continue;
            }
            let there = self.complex.live(high)[Extent::POINT.index()].low_layer(axis);
            if leaving & !there != 0 {
                self.join_parts(brick, |part| part.high_layer(axis) & leaving & !there != 0, SENTINEL);
            }
            if high < DEEP {
                for n in self.labels.first[high as usize]..self.labels.first[high as usize + 1] {
                    let met = self.labels.parts[n as usize].low_layer(axis) & leaving;
                    if met != 0 {
                        self.join_parts(brick, |part| part.high_layer(axis) & met != 0, n + 1);
                    }
                }
            }
        }
    }

    fn gap_beside(&self, brick: u32, axis: Axis, high: bool) -> u32 {
        let mut at = self.complex.position(brick);
        let c = &mut at[axis.index()];
        *c = if high { *c + 1 } else { *c - 1 };
        self.gap_at(at)
    }

    /// Joins a node with those parts of a brick for which the answer is yes.
    fn join_parts(&mut self, brick: u32, which: impl Fn(&Plane) -> bool, node: u32) {
        for part in self.labels.first[brick as usize]..self.labels.first[brick as usize + 1] {
            if which(&self.labels.parts[part as usize]) {
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
        self.labels.roots = roots;
        self.labels
    }
}
