//! Regions: which lattice points hang together when some edges are closed.
//!
//! Closed edges lie in bricks; everywhere else all points of a brick hang together. So a region is made of
//!
//! - parts of bricks, found by a bit-parallel [flood](crate::grid::flood) in each brick, and
//! - runs: rows of absent bricks along x between two that are listed. What is before the first brick of a row or behind the last, and all
//!   rows without bricks, is the outer space.
//!
//! Parts and runs are joined where an open edge leads from one to the other. Two runs that lie beside each other are joined once, by the
//! one that starts later. So neither time nor memory depend on the volume.
//!
//! With the crossed edges of a surface closed, regions are the components of the inside, and of the outside as far as edges join them
//! (see [`components`](super::components)). With all edges closed that any face hits, the outer region is what infinity reaches.
//!
//! # Cost
//!
//! Per brick: a flood for each of its parts (most have two) and some six look-ups of neighbours, in parallel. While it lasts, 64 bytes a part
//! and 28 a brick.

use super::LinearOctree;
use super::crossings::{Crossings, lattice_point};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Key};
use crate::parallel::pieces;
use crate::sets::Sets;
use rayon::prelude::*;
use std::ops::Range;

/// Closed edges in bricks, sorted by key.
pub trait ClosedEdges: Sync {
    /// log2 of the number of cells a side.
    fn depth(&self) -> u32;
    /// Number of bricks that are listed.
    fn len(&self) -> usize;
    /// Whether no brick is listed.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Key of a brick of the list.
    fn key(&self, brick: usize) -> Key;
    /// The closed edges of a brick of the list along x, y, z, each at its start. All other bricks have none.
    fn closed(&self, brick: usize) -> [Plane; 3];
    /// The place of a brick in the list.
    fn find(&self, brick: Key) -> Option<usize>;
}

/// Closed edges in a list of bricks of their own.
#[derive(Debug)]
pub struct ClosedBricks {
    depth: u32,
    /// Key, and the closed edges along x, y, z, each at its start.
    bricks: Vec<(Key, [Plane; 3])>,
    index: LinearOctree<u32>,
}

impl ClosedBricks {
    /// Bytes for each brick.
    pub const BYTES: usize = size_of::<(Key, [Plane; 3])>() + 2 * size_of::<(Key, u32)>();

    /// Asks for the closed edges of each brick, in parallel; the keys are sorted. `closed` is given the places of all keys, too.
    pub fn new(depth: u32, keys: Vec<Key>, closed: impl Fn(Key, &LinearOctree<u32>) -> [Plane; 3] + Sync) -> Self {
        let index: LinearOctree<u32> = keys.iter().copied().zip(0..).collect();
        let bricks = keys.into_par_iter().map(|key| (key, closed(key, &index))).collect();
        ClosedBricks { depth, bricks, index }
    }
}

impl ClosedEdges for ClosedBricks {
    fn depth(&self) -> u32 {
        self.depth
    }

    fn len(&self) -> usize {
        self.bricks.len()
    }

    fn key(&self, brick: usize) -> Key {
        self.bricks[brick].0
    }

    fn closed(&self, brick: usize) -> [Plane; 3] {
        self.bricks[brick].1
    }

    fn find(&self, brick: Key) -> Option<usize> {
        self.index.get(brick).map(|&i| i as usize)
    }
}

impl ClosedEdges for Crossings {
    fn depth(&self) -> u32 {
        self.depth()
    }

    fn len(&self) -> usize {
        self.bricks().len()
    }

    fn key(&self, brick: usize) -> Key {
        self.bricks()[brick].key
    }

    fn closed(&self, brick: usize) -> [Plane; 3] {
        self.bricks()[brick].crossed
    }

    fn find(&self, brick: Key) -> Option<usize> {
        self.find(brick)
    }
}

/// Bytes for each brick while regions are found: two parts on average, twice, with their nodes, and the brick's place in a row.
pub const REGION_BYTES: usize = 4 * size_of::<Plane>() + 2 * size_of::<(u64, u32)>() + 2 * size_of::<[u32; 4]>();

/// All lattice points in regions, numbered from 0: the outer one, then in the order in which bricks meet them.
#[derive(Debug)]
pub struct Regions<'a, E> {
    edges: &'a E,
    /// For each brick the number of its first part, and at the end the number of all.
    first: Vec<u32>,
    parts: Vec<Plane>,
    /// Bricks in rows: y, z, x in 16 bits each, and the place in the list.
    rows: Vec<(u64, u32)>,
    /// The region of each part, then of the run behind each brick in the order of `rows`, then of the outer space.
    region: Vec<u32>,
    count: u32,
}

/// What is at the place of a brick: its number in the list, or else the node of a run or of the outer space.
enum Found {
    Brick(usize),
    Absent(u32),
}

impl<'a, E: ClosedEdges> Regions<'a, E> {
    /// Finds all regions.
    pub fn new(edges: &'a E) -> Self {
        Regions::joined(edges, |_, _| ())
    }

    /// As [`new`](Regions::new), except that further pairs of lattice points, in cells, hang together: those that `more` passes on for each
    /// brick.
    pub fn joined(edges: &'a E, more: impl Fn(usize, &mut dyn FnMut([[u32; 3]; 2])) + Sync) -> Self {
        let (count, piece) = pieces(edges.len(), 64);
        let parts: Vec<(Vec<u32>, Vec<Plane>)> = (0..count)
            .into_par_iter()
            .map(|n| {
                let (mut counts, mut parts) = (Vec::new(), Vec::new());
                for i in piece(n) {
                    let before = parts.len();
                    parts.extend(crate::grid::flood::parts(&edges.closed(i).map(|plane| !plane)));
                    counts.push((parts.len() - before) as u32);
                }
                (counts, parts)
            })
            .collect();
        let mut all =
            Regions { edges, first: vec![0], parts: Vec::new(), rows: Vec::new(), region: Vec::new(), count: 0 };
        let mut number = 0;
        for (counts, parts) in parts {
            all.first.extend(counts.into_iter().map(|n| {
                number += n;
                number
            }));
            all.parts.extend(parts);
        }
        let place = |i| row_code(all.coords(i)) << 16 | u64::from(all.coords(i)[0]);
        all.rows = (0..edges.len()).into_par_iter().map(|i| (place(i), i as u32)).collect();
        all.rows.par_sort_unstable();
        let sets = Sets::new(all.outer_node() as usize + 1);
        (0..edges.len()).into_par_iter().for_each(|i| {
            all.join_brick(i, &sets);
            more(i, &mut |pair| {
                let [a, b] = pair.map(|p| all.node(p));
                sets.union(a, b);
            });
        });
        (0..all.rows.len()).into_par_iter().for_each(|k| all.join_run(k, &sets));
        all.number(&sets);
        all
    }

    /// How many regions there are, the outer one included.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// The parts of a brick: the region of each and its points.
    pub fn parts(&self, brick: usize) -> impl Iterator<Item = (u32, &Plane)> {
        let parts = self.nodes(brick);
        self.region[parts.clone()].iter().copied().zip(&self.parts[parts])
    }

    /// The points of a brick that lie in a region for which the answer is yes.
    pub fn points_in(&self, brick: usize, wanted: impl Fn(u32) -> bool) -> Plane {
        self.parts(brick).filter(|part| wanted(part.0)).fold(Plane::EMPTY, |a, (_, &part)| a | part)
    }

    /// The region of a lattice point, in cells. Cost: that of finding its brick, and a look at its parts.
    pub fn of_point(&self, at: [u32; 3]) -> u32 {
        self.region[self.node(at) as usize]
    }

    /// The region that all points of an absent brick lie in. Cost: a binary search.
    pub fn of_absent(&self, brick: Key) -> u32 {
        let at = lattice_point(self.edges.depth(), brick).map(|c| c >> 3);
        self.region[self.absent(at) as usize]
    }

    /// The runs of absent bricks between bricks of a row: the region of each and its length in bricks.
    pub fn runs(&self) -> impl Iterator<Item = (u32, u32)> {
        (0..self.rows.len()).filter_map(|k| {
            let bricks = self.run_length(k)?;
            Some((self.region[self.parts.len() + k], bricks))
        })
    }

    fn coords(&self, brick: usize) -> [u32; 3] {
        lattice_point(self.edges.depth(), self.edges.key(brick)).map(|c| c >> 3)
    }

    fn nodes(&self, brick: usize) -> Range<usize> {
        self.first[brick] as usize..self.first[brick + 1] as usize
    }

    fn outer_node(&self) -> u32 {
        u32::try_from(self.parts.len() + self.rows.len()).expect("fewer than 2^32 parts and bricks")
    }

    /// Bricks between number `k` of the rows and the next one of its row, `None` if there is no next one or nothing between.
    fn run_length(&self, k: usize) -> Option<u32> {
        let (this, next) = (self.rows[k].0, self.rows.get(k + 1)?.0);
        let bricks = (next - this) as u32;
        (next >> 16 == this >> 16 && bricks > 1).then(|| bricks - 1)
    }

    /// The node of an absent brick at these coordinates, in bricks; they may lie beside the root.
    fn absent(&self, at: [u32; 3]) -> u32 {
        let code = row_code(at) << 16 | u64::from(at[0]);
        let behind = self.rows.partition_point(|row| row.0 < code);
        let in_row = |k: Option<usize>| k.and_then(|k| self.rows.get(k)).is_some_and(|row| row.0 >> 16 == code >> 16);
        if in_row(behind.checked_sub(1)) && in_row(Some(behind)) {
            (self.parts.len() + behind - 1) as u32
        } else {
            self.outer_node()
        }
    }

    /// What is at brick coordinates, `None` for beside the root.
    fn at(&self, at: Option<[u32; 3]>) -> Found {
        let key = at.and_then(|at| Key::cell(self.edges.depth() - 3, at));
        match (at, key) {
            (Some(at), Some(key)) => match self.edges.find(key) {
                Some(i) => Found::Brick(i),
                None => Found::Absent(self.absent(at)),
            },
            _ => Found::Absent(self.outer_node()),
        }
    }

    /// The node of a lattice point, in cells.
    fn node(&self, point: [u32; 3]) -> u32 {
        match self.at(Some(point.map(|c| c >> 3))) {
            Found::Absent(node) => node,
            Found::Brick(i) => {
                let local = Local::new(point[0], point[1], point[2]);
                let part = self.parts[self.nodes(i)].iter().position(|part| part.get(local));
                self.first[i] + part.expect("every point lies in a part") as u32
            }
        }
    }

    /// Joins the parts of a brick to what is at its six sides.
    fn join_brick(&self, i: usize, sets: &Sets) {
        let coords = self.coords(i);
        let open = self.edges.closed(i).map(|plane| !plane);
        for axis in Axis::ALL {
            let high = self.at(Some(stepped(coords, axis, 1).expect("up is always possible")));
            for a in self.nodes(i) {
                let leaving = self.parts[a] & open[axis.index()];
                match high {
                    Found::Brick(j) => {
                        for b in self.nodes(j) {
                            if !(leaving & Plane::EMPTY.at_plus(axis, &self.parts[b])).is_empty() {
                                sets.union(a as u32, b as u32);
                            }
                        }
                    }
                    Found::Absent(node) => {
                        if !(leaving & Plane::EMPTY.at_plus(axis, &Plane::FULL)).is_empty() {
                            sets.union(a as u32, node);
                        }
                    }
                }
            }
            // An edge that comes from an absent brick is open.
            if let Found::Absent(node) = self.at(stepped(coords, axis, -1)) {
                for a in self.nodes(i).filter(|&a| self.parts[a].touches_min(axis)) {
                    sets.union(a as u32, node);
                }
            }
        }
    }

    /// Joins the run behind number `k` of the rows to the runs beside its first brick.
    fn join_run(&self, k: usize, sets: &Sets) {
        let node = (self.parts.len() + k) as u32;
        if self.run_length(k).is_none() {
            // No points, so nothing else is joined to it; it shall not count as a region.
            sets.union(node, self.outer_node());
            return;
        }
        let start = stepped(self.coords(self.rows[k].1 as usize), Axis::X, 1).expect("up is always possible");
        for (axis, step) in [(Axis::Y, -1), (Axis::Y, 1), (Axis::Z, -1), (Axis::Z, 1)] {
            if let Found::Absent(beside) = self.at(stepped(start, axis, step)) {
                sets.union(node, beside);
            }
        }
    }

    /// Gives regions their numbers.
    fn number(&mut self, sets: &Sets) {
        let outer = self.outer_node();
        let roots: Vec<u32> = (0..=outer).into_par_iter().map(|node| sets.root(node)).collect();
        // The root of a set is its least node, so its number is known before any other of the set asks.
        let mut numbers = vec![0; roots.len()];
        let mut next = 1;
        for (node, &root) in (0..).zip(&roots) {
            if root == node && root != roots[outer as usize] {
                numbers[node as usize] = next;
                next += 1;
            }
        }
        self.region = roots.into_par_iter().map(|root| numbers[root as usize]).collect();
        self.count = next;
    }
}

/// y and z of a row of bricks in one number.
fn row_code([_, y, z]: [u32; 3]) -> u64 {
    u64::from(y) << 16 | u64::from(z)
}

/// The place one step on along an axis, unless that is below 0.
fn stepped(mut at: [u32; 3], axis: Axis, step: i32) -> Option<[u32; 3]> {
    at[axis.index()] = at[axis.index()].checked_add_signed(step)?;
    Some(at)
}
