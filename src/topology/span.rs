//! The handles of a skeleton: a maximum spanning forest of its arcs, and the thinnest edge of each arc that is left over.
//!
//! An arc is as thick as its thinnest cross-section. Arcs join the forest from the thickest to the thinnest, sheets, cores and the sentinel
//! being nodes; one that would close a loop is the thinnest of that loop, and its thinnest edge is where the loop
//! is cut. All components are in the forest.
//!
//! Sections of neighbouring edges are alike, so along an arc they are taken at steps of half their width, and the thinnest is then
//! looked for by halving steps around it. Cost: some 150 ns an edge of the sections taken, in parallel.

use super::complex::{Complex, Spot};
use super::section::{Section, Signs};
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
}

/// The loops of a skeleton, from the thinnest on.
pub(super) fn loops(
    octree: &EditedOctree,
    complex: &Complex,
    skeleton: &Skeleton,
    progress: &dyn Progress,
) -> Result<Vec<Loop>> {
    let signs = Signs::new(octree, complex);
    let thinnest: Result<Vec<Loop>> = skeleton
        .arcs()
        .par_iter()
        .map(|arc| {
            check(progress)?;
            Ok(thinnest(&signs, complex, &skeleton.spots[arc.edges.clone()]))
        })
        .collect();
    let mut arcs: Vec<(&Arc, Loop)> = skeleton.arcs().iter().zip(thinnest?).collect();
    let size = |thin: &Loop| (thin.section.area.to_bits(), thin.section.squares, thin.edge);
    // Areas are not negative: their bits have their order.
    arcs.sort_by_key(|(_, thin)| Reverse(size(thin)));
    let mut parent: Vec<u32> = (0..skeleton.nodes().len() as u32).collect();
    let mut loops = Vec::new();
    for (arc, thin) in arcs {
        let [a, b] = arc.ends.map(|end| root(&mut parent, end));
        if a == b {
            loops.push(thin);
        }
        parent[a.max(b) as usize] = a.min(b);
    }
    loops.sort_by_key(size);
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

/// The thinnest section of an arc.
fn thinnest(signs: &Signs, complex: &Complex, edges: &[Spot]) -> Loop {
    let take = |i: usize| Loop { edge: edges[i], section: Section::of(signs, complex, edges[i]) };
    let mut best = (0, take(0));
    let try_at = |i: usize, best: &mut (usize, Loop)| {
        let here = take(i);
        let area = here.section.area;
        if area < best.1.section.area {
            *best = (i, here);
        }
        area
    };
    let step = |area: f64| ((area.sqrt() / 2.0) as usize).max(1);
    let mut widest = step(best.1.section.area);
    let mut i = widest;
    while i < edges.len() {
        let next = step(try_at(i, &mut best));
        widest = widest.max(next);
        i += next;
    }
    let mut around = widest / 2;
    while around > 0 {
        let middle = best.0;
        if middle >= around {
            try_at(middle - around, &mut best);
        }
        if middle + around < edges.len() {
            try_at(middle + around, &mut best);
        }
        around /= 2;
    }
    best.1
}
