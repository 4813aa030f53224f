//! Winding numbers of surfaces without boundary.

use super::levels::{Nonzero, Rows, Steps};
use super::net::Net;
use super::samples::{Rule, push_samples};
use crate::error::Result;
use crate::grid::brick::Plane;
use crate::octree::SignedOctree;
use crate::octree::crossings::Sample;
use crate::octree::hits::OrientedHits;
use crate::progress::Progress;
use rayon::prelude::*;

/// The winding numbers of closed, consistently oriented surfaces: those without [circulation](super::circulations).
pub struct WholeNumbers {
    rows: Rows,
    /// For each brick of the hits, the points whose number is not 0.
    inside: Vec<Plane>,
    overlap: bool,
}

impl WholeNumbers {
    /// Counts. Cost: some 100 ns a brick.
    ///
    /// There must be no circulation; else the numbers are right along x only.
    pub fn new(hits: &OrientedHits) -> Self {
        let edges = hits.edges();
        let bricks = (0..edges.bricks().len()).into_par_iter();
        let mut rows = Rows::new(edges.depth(), bricks.map(|i| edges.bricks()[i].key));
        let (inside, beyond): (Vec<Plane>, Vec<bool>) =
            rows.walk(|i| steps_of(hits, i), |_| Nonzero::default()).into_iter().unzip();
        WholeNumbers { rows, inside, overlap: beyond.contains(&true) }
    }

    /// Whether some number is neither -1 nor 0 nor 1: solids overlap, or lie in each other with the same orientation. If not, inside by
    /// winding number is inside by parity.
    pub fn overlap(&self) -> bool {
        self.overlap
    }

    /// The octree of the points whose number is not 0. Cost: that of [`SignedOctree::from_signs`]; next to nothing without overlap, if no
    /// edge has several hits.
    ///
    /// # Errors
    /// `Cancelled`.
    pub fn into_octree(self, hits: OrientedHits, progress: &dyn Progress) -> Result<SignedOctree> {
        if !self.overlap && hits.are_single() {
            return Ok(SignedOctree::new(hits.into_edges(), self.inside));
        }
        let edges = hits.edges();
        let depth = edges.depth();
        let signs: Vec<_> = edges.bricks().iter().map(|brick| brick.key).zip(self.inside).collect();
        let uniform = |key| self.rows.between(key, depth) != 0;
        let samples = |i: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
            let (key, inside) = &signs[i];
            let nowhere = |_, _| unreachable!("without circulation, signs change at hits");
            push_samples(&hits, *key, inside, crossed, Rule::Nonzero, nowhere, out);
        };
        SignedOctree::try_from_signs(depth, edges.with_normals(), &signs, uniform, samples, progress)
    }
}

/// The jumps along the x-edges of a brick of the hits.
pub(super) fn steps_of(hits: &OrientedHits, i: usize) -> Steps {
    let brick = &hits.edges().bricks()[i];
    let turns = hits.turns(i);
    if turns.are_uniform() {
        let (x, none) = (brick.crossed[0], Plane::EMPTY);
        let (rises, falls) = if turns.leave(crate::grid::Axis::X) { (none, x) } else { (x, none) };
        return Steps { rises, falls, more: Vec::new() };
    }
    Steps::of(&Net::of(hits, brick))
}
