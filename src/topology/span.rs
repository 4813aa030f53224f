//! The handles of a skeleton: a maximum spanning forest of its arcs, and the thinnest edge of each arc that is left over.
//!
//! An arc is as thick as its thinnest cross-section. Arcs join the forest from the thickest to the thinnest, sheets, cores and the sentinel
//! being nodes; one that would close a loop is the thinnest of that loop, and its thinnest edge is where the loop
//! is cut. All components are in the forest.
//!
//! A section costs as much as it is wide, and an arc has hundreds of edges, so not all sections are taken. Lines along the axes tell
//! roughly how thick the solid is at an edge ([`Sections::guess`]), which no neck can hide from; where they are shortest, the section is
//! taken, and once more at the shortest ones that are at least a width away from there, of which there can be many along a tube.
//! Where a loop is to be cut, the thinnest is looked for in halving steps around, and in a tube (many times as long as wide) also
//! every half a width along it. Cost: some 0.2 us a square of the sections taken, in
//! parallel, and 0.3 us an edge of the skeleton.

use super::complex::{Complex, Spot};
use super::section::{Section, Sections, Signs};
use super::skeleton::{Arc, Skeleton};
use crate::error::Result;
use crate::octree::EditedOctree;
use crate::progress::{Progress, check};
use rayon::prelude::*;
use std::cmp::Reverse;

/// A loop, where it is thinnest.
#[derive(Debug, Clone)]
pub(super) struct Loop {
    pub(super) edge: Spot,
    pub(super) section: Section,
    /// Mean of the section, in lattice units.
    pub(super) centre: [f64; 3],
}

/// An edge of an arc: its place in the arc, itself and its section.
#[derive(Debug, Clone)]
struct Candidate {
    place: usize,
    edge: Spot,
    section: Section,
}

impl Candidate {
    /// What the thinnest edge of an arc has least: of sections of about the same area, the straighter one changes less.
    fn cost(&self) -> f64 {
        self.section.area + self.section.squares as f64 / 4.0
    }
}

/// The loops of a skeleton, from the thinnest on.
pub(super) fn loops(
    octree: &EditedOctree,
    complex: &Complex,
    skeleton: &Skeleton,
    progress: &dyn Progress,
) -> Result<Vec<Loop>> {
    let signs = Signs::new(octree, complex);
    let thinnest: Result<Vec<Candidate>> = skeleton
        .arcs()
        .par_iter()
        .map_init(
            || Sections::new(complex, &signs),
            |sections, arc| {
                check(progress)?;
                Ok(thin_place(sections, &skeleton.spots[arc.edges.clone()]))
            },
        )
        .collect();
    let mut arcs: Vec<(&Arc, Candidate)> = skeleton.arcs().iter().zip(thinnest?).collect();
    // Areas are not negative: their bits have their order.
    arcs.sort_by_key(|(_, thin)| Reverse((thin.section.area.to_bits(), thin.section.squares, thin.edge)));
    let mut parent: Vec<u32> = (0..skeleton.nodes().len() as u32).collect();
    let mut loops = Vec::new();
    for (arc, thin) in arcs {
        let [a, b] = arc.ends.map(|end| root(&mut parent, end));
        if a == b {
            loops.push((arc, thin));
        }
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut loops: Vec<Loop> = loops
        .into_par_iter()
        .map_init(
            || Sections::new(complex, &signs),
            |sections, (arc, thin)| refined(sections, &skeleton.spots[arc.edges.clone()], thin),
        )
        .collect();
    loops.sort_by_key(|found| (found.section.area.to_bits(), found.section.squares, found.edge));
    Ok(loops)
}

fn root(parent: &mut [u32], mut a: u32) -> u32 {
    while parent[a as usize] != a {
        let next = parent[a as usize];
        parent[a as usize] = parent[next as usize];
        a = next;
    }
    a
}

/// How many sections of an arc are taken before it is known whether it closes a loop.
const TRIES: usize = 2;

fn take(sections: &mut Sections<'_>, edges: &[Spot], i: usize) -> Candidate {
    Candidate { place: i, edge: edges[i], section: sections.at(edges[i]) }
}

fn width(area: f64) -> usize {
    (area.sqrt() as usize).max(1)
}

/// A thin section of an arc: the thinnest of a few at which the solid seems thin.
fn thin_place(sections: &mut Sections<'_>, edges: &[Spot]) -> Candidate {
    let mut guesses: Vec<(u32, usize)> = edges.iter().map(|&edge| sections.guess(edge)).zip(0..).collect();
    guesses.sort_unstable();
    let mut best = take(sections, edges, guesses[0].1);
    let mut taken = vec![best.place];
    let mut left = guesses.into_iter().skip(1);
    while taken.len() < TRIES {
        let apart = width(best.section.area);
        let Some((_, next)) = left.find(|(_, i)| taken.iter().all(|t| t.abs_diff(*i) >= apart)) else { break };
        let other = take(sections, edges, next);
        taken.push(next);
        if other.cost() < best.cost() {
            best = other;
        }
    }
    best
}

/// Arcs of so many widths of their section are tubes.
const LONG: usize = 8;
/// Sections of a tube that are so many times as large as the thinnest are as good, if they have fewer squares: less is changed there.
const AS_GOOD: f64 = 1.0 + 1.0 / 12.0;

/// The thinnest section near a thin one; of a tube, where many are about the same, one of those with the fewest squares.
fn refined(sections: &mut Sections<'_>, edges: &[Spot], best: Candidate) -> Loop {
    let wide = width(best.section.area);
    let mut best = best;
    let mut taken = Vec::new();
    if edges.len() > LONG * wide {
        taken.extend((0..edges.len()).step_by(wide.div_ceil(2)).map(|i| take(sections, edges, i)));
        taken.push(best);
        best = taken.iter().min_by(|a, b| a.cost().total_cmp(&b.cost())).expect("one at least").clone();
    }
    best = around(sections, edges, best, Candidate::cost);
    if !taken.is_empty() {
        let bound = taken.iter().fold(best.section.area, |least, other| least.min(other.section.area)) * AS_GOOD;
        let squares = |c: &Candidate| if c.section.area <= bound { c.section.squares as f64 } else { f64::INFINITY };
        taken.push(best);
        let fewest = taken.into_iter().min_by(|a, b| squares(a).total_cmp(&squares(b))).expect("one at least");
        best = around(sections, edges, fewest, squares);
    }
    Loop { edge: best.edge, centre: sections.centre(best.edge), section: best.section }
}

/// The best section in halving steps around one.
fn around(
    sections: &mut Sections<'_>,
    edges: &[Spot],
    mut best: Candidate,
    cost: impl Fn(&Candidate) -> f64,
) -> Candidate {
    let mut step = width(best.section.area).div_ceil(4);
    while step > 0 {
        let middle = best.place;
        for i in [middle.checked_sub(step), Some(middle + step)].into_iter().flatten().filter(|&i| i < edges.len()) {
            let other = take(sections, edges, i);
            if cost(&other) < cost(&best) {
                best = other;
            }
        }
        step /= 2;
    }
    best
}
