//! The handles of a skeleton: a maximum spanning forest of its arcs, and the thinnest edge of each arc that is left over.
//!
//! An arc is as thick as its thinnest cross-section. Arcs join the forest from the thickest to the thinnest, sheets, cores and the sentinel
//! being nodes; one that would close a loop is the thinnest of that loop, and its thinnest edge is where the loop
//! is cut. All components are in the forest.
//!
//! A section costs as much as it is wide, and an arc has hundreds of edges, so not all sections are taken. Arcs that are on no loop at all
//! (bridges of the graph, such as the trunk between two handles) need none. Of the others, lines along the axes tell
//! roughly how thick the solid is at an edge ([`Sections::guess`]), which no neck can hide from; where they are shortest, the section is
//! taken, and once more at the shortest ones that are at least a width away from there, of which there can be many along a tube.
//! Where a loop is to be cut, the thinnest is looked for in halving steps around, and in a tube (many times as long as wide) also
//! every half a width along it. Cost: some 70 ns a square of the sections taken, in
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

/// The loops of a skeleton, from the thinnest on; those whose sections are many times wider than `limit` (in squares of cells) are left out.
pub(super) fn loops(
    octree: &EditedOctree,
    complex: &Complex,
    skeleton: &Skeleton,
    limit: f64,
    progress: &dyn Progress,
) -> Result<Vec<Loop>> {
    let mut parent: Vec<u32> = (0..skeleton.nodes().len() as u32).collect();
    let mut round: Vec<&Arc> = Vec::new();
    for (arc, is_bridge) in skeleton.arcs().iter().zip(bridges(skeleton)) {
        if is_bridge {
            join(&mut parent, arc);
        } else {
            round.push(arc);
        }
    }
    if round.is_empty() {
        return Ok(Vec::new());
    }
    let signs = Signs::new(octree, complex);
    let thinnest: Result<Vec<Candidate>> = round
        .par_iter()
        .map_init(
            || Sections::new(complex, &signs).up_to(limit),
            |sections, arc| {
                check(progress)?;
                Ok(thin_place(sections, &skeleton.spots[arc.edges.clone()]))
            },
        )
        .collect();
    let mut arcs: Vec<(&Arc, Candidate)> = round.into_iter().zip(thinnest?).collect();
    // Areas are not negative: their bits have their order.
    arcs.sort_by_key(|(_, thin)| Reverse((thin.section.area.to_bits(), thin.section.squares, thin.edge)));
    arcs.retain(|(arc, _)| !join(&mut parent, arc));
    let mut loops: Vec<Loop> = arcs
        .into_par_iter()
        .map_init(
            || Sections::new(complex, &signs).up_to(limit),
            |sections, (arc, thin)| refined(sections, &skeleton.spots[arc.edges.clone()], thin),
        )
        // Where a wide section was found first, a thin one may yet be near.
        .filter(|found: &Loop| !found.section.is_wide())
        .collect();
    loops.sort_by_key(|found| (found.section.area.to_bits(), found.section.squares, found.edge));
    Ok(loops)
}

/// For each arc, whether it is on no loop: without it, its ends would not be connected. Found by a depth-first search: an arc of
/// its tree is a bridge if no other arc leads from below it to its upper end or beyond (Tarjan 1974).
fn bridges(skeleton: &Skeleton) -> Vec<bool> {
    let (arcs, nodes) = (skeleton.arcs(), skeleton.nodes().len());
    let mut at_node: Vec<(u32, u32)> = (0..).zip(arcs).flat_map(|(i, arc)| arc.ends.map(|end| (end, i))).collect();
    at_node.sort_unstable();
    let first = |node: u32| at_node.partition_point(|entry| entry.0 < node);
    let mut bridges = vec![false; arcs.len()];
    // When a node was come to, and the least such time that is reached from below it.
    let (mut times, mut reached) = (vec![u32::MAX; nodes], vec![u32::MAX; nodes]);
    let mut time = 0;
    // Node, arc by which it was come to, and next place in the list.
    let mut path: Vec<(u32, u32, usize)> = Vec::new();
    for start in 0..nodes as u32 {
        if times[start as usize] == u32::MAX {
            path.push((start, u32::MAX, first(start)));
        }
        while let Some((node, by, next)) = path.last_mut() {
            let (node, by) = (*node, *by);
            let here = node as usize;
            if times[here] == u32::MAX {
                (times[here], reached[here]) = (time, time);
                time += 1;
            }
            if let Some(&(_, arc)) = at_node.get(*next).filter(|entry| entry.0 == node) {
                *next += 1;
                let [a, b] = arcs[arc as usize].ends;
                let other = if a == node { b } else { a };
                if times[other as usize] == u32::MAX {
                    path.push((other, arc, first(other)));
                } else if arc != by {
                    reached[here] = reached[here].min(times[other as usize]);
                }
                continue;
            }
            path.pop();
            if let Some(&(above, _, _)) = path.last() {
                bridges[by as usize] = reached[here] > times[above as usize];
                reached[above as usize] = reached[above as usize].min(reached[here]);
            }
        }
    }
    bridges
}

/// Joins the ends of an arc; whether they were not joined before.
fn join(parent: &mut [u32], arc: &Arc) -> bool {
    let [a, b] = arc.ends.map(|end| root(parent, end));
    parent[a.max(b) as usize] = a.min(b);
    a != b
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
        let apart = width(best.section.area.min(sections.limit()));
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
/// Sections of a tube that are so many times as large as the best are as good, if they have fewer squares: less is changed there. Nothing but
/// judgement says how many times; a tenth is what areas may be off, and with a twelfth the sample of TopoMender's authors is cut where
/// their program cuts it.
const AS_GOOD: f64 = 1.0 + 1.0 / 12.0;

/// The thinnest section near a thin one; of a tube, where many are about the same, one of those with the fewest squares.
fn refined(sections: &mut Sections<'_>, edges: &[Spot], best: Candidate) -> Loop {
    let wide = width(best.section.area.min(sections.limit()));
    let mut best = best;
    let mut taken = Vec::new();
    if edges.len() > LONG * wide {
        taken.extend((0..edges.len()).step_by(wide.div_ceil(2)).map(|i| take(sections, edges, i)));
        taken.push(best);
        best = taken.iter().min_by(|a, b| a.cost().total_cmp(&b.cost())).expect("one at least").clone();
    }
    best = around(sections, edges, best, Candidate::cost);
    if !taken.is_empty() {
        // Not the least of all areas: a section that is folded back on itself has next to none, and very many squares.
        let bound = best.section.area * AS_GOOD;
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
    let mut step = width(best.section.area.min(sections.limit())).div_ceil(4);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::topology::oracle::{noise, octree};
    use crate::topology::{Side, thin};

    #[test]
    fn bridges_are_the_arcs_without_which_their_ends_are_apart() {
        let mut seen = [0; 2];
        for seed in 0..12u8 {
            let density = 0.3 + 0.05 * f64::from(seed);
            let signed = octree(4, |p| p.iter().all(|&c| c < 11) && noise(u64::from(seed), p) < density);
            let octree = EditedOctree::unedited(signed);
            for side in [Side::Object, Side::Background] {
                let mut complex = Complex::new(&octree, side);
                thin(&mut complex, None, &Silent).unwrap();
                let skeleton = Skeleton::new(&complex);
                let found = bridges(&skeleton);
                for (i, arc) in skeleton.arcs().iter().enumerate() {
                    let mut parent: Vec<u32> = (0..skeleton.nodes().len() as u32).collect();
                    let others = skeleton.arcs().iter().enumerate().filter(|(other, _)| *other != i);
                    others.for_each(|(_, other)| _ = join(&mut parent, other));
                    assert_eq!(found[i], join(&mut parent, arc), "{seed} {side:?} {i}");
                    seen[usize::from(found[i])] += 1;
                }
            }
        }
        assert!(seen.iter().all(|&count| count > 4), "{seen:?}");
    }
}
