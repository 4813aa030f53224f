//! Which hit of an edge is the surface.

use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Key};
use crate::octree::crossings::Sample;
use crate::octree::hits::{EdgeHit, OrientedHits};

/// Which winding numbers are inside, where they are whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rule {
    /// All but 0.
    Nonzero,
    /// Those above 0.
    Positive,
    /// Those below 0: the input is turned inside out.
    Negative,
}

impl Rule {
    fn is_inside(self, number: i32) -> bool {
        match self {
            Rule::Nonzero => number != 0,
            Rule::Positive => number > 0,
            Rule::Negative => number < 0,
        }
    }

    /// The hit at which an edge goes in or out, if any does: of several, the middle one. The outer end has the number 0.
    fn passing(self, hits: &[EdgeHit], starts_inside: bool) -> Option<EdgeHit> {
        if let [hit] = hits {
            // It goes out, if the edge starts inside.
            let fits = self == Rule::Nonzero || hit.leaves == (starts_inside == (self == Rule::Positive));
            return fits.then_some(*hit);
        }
        let mut number = if starts_inside { -hits.iter().copied().map(EdgeHit::jump).sum::<i32>() } else { 0 };
        let passes = |hit: &&EdgeHit| {
            let before = self.is_inside(number);
            number += hit.jump();
            before != self.is_inside(number)
        };
        let passing: Vec<EdgeHit> = hits.iter().filter(passes).copied().collect();
        passing.get(passing.len() / 2).copied().filter(|_| passing.len() % 2 == 1)
    }
}

/// Appends a sample for each crossed edge of a brick whose inside points are known; `elsewhere` has those that no hit explains.
pub(super) fn push_samples(
    hits: &OrientedHits,
    key: Key,
    inside: &Plane,
    crossed: &[Plane; 3],
    rule: Rule,
    elsewhere: impl Fn(Axis, Local) -> Sample,
    out: &mut Vec<Sample>,
) {
    let mut done = [Plane::EMPTY; 3];
    if let Some(place) = hits.edges().find(key) {
        let brick = &hits.edges().bricks()[place];
        hits.for_edges(brick, |axis, local, of_edge| {
            let a = axis.index();
            if !crossed[a].get(local) {
                return;
            }
            if let Some(EdgeHit { sample, .. }) = rule.passing(of_edge, inside.get(local)) {
                done[a].set(local);
                out.push(Sample::new(sample.offset, sample.normal));
            }
        });
    }
    if done == *crossed {
        return;
    }
    let explained = std::mem::take(out);
    let mut explained = explained.into_iter();
    for axis in Axis::ALL {
        let a = axis.index();
        for local in crossed[a].iter() {
            let sample = if done[a].get(local) { explained.next() } else { None };
            out.push(sample.unwrap_or_else(|| elsewhere(axis, local)));
        }
    }
}
