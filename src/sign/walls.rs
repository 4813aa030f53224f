//! Coincident walls: one or none?
//!
//! A face that occurs twice in the input hits each edge twice at the same place. Counted by parity, the copies cancel and
//! leave a hole; counted once, they are the wall that was meant. But two solids that touch, each with its own face on
//! the common wall, give the same pairs of hits, and there the pair *should* cancel: the wall is inside their union.
//!
//! What surrounds a wall decides. All edges whose parity depends on the question are gathered into clusters that touch in grid
//! faces; each cluster is counted once or by parity, whichever leaves fewer odd faces, and once if that is the same. Of a doubled
//! solid every face is doubled, both ways leave no odd face, and the solid stays. A doubled patch of a solid borders on single
//! faces: counted once it fits, cancelled it would leave a hole. The common wall of two boxes fits to their sides only if cancelled.
//! For closed input counting by parity leaves no odd face, so a cluster is merged only if that leaves none either.
//!
//! Cost: some 1 us an edge in question; nothing if there is none.

use crate::grid::Key;
use crate::octree::crossings::{Crossings, Toggle};
use crate::sets::Sets;
use hashbrown::HashMap;

/// Bytes for each edge in question: the switch, its entry in the table (two slots at worst), the cluster, its excess, four faces.
pub(super) const BYTES: usize = 16 + 2 * 17 + 8 + 8 + 4 * 16;

/// Of the switches that would merge coincident walls, those that fit to their surroundings.
pub(super) fn worth_merging(crossings: &Crossings, mut merges: Vec<Toggle>) -> Vec<Toggle> {
    if merges.is_empty() {
        return merges;
    }
    merges.sort_unstable();
    let seeds = ahash::RandomState::with_seeds(5, 6, 7, 8);
    let mut place: HashMap<Key, usize, _> = HashMap::with_capacity_and_hasher(merges.len(), seeds);
    place.extend(merges.iter().enumerate().map(|(i, toggle)| (toggle.edge, i)));

    let clusters = Sets::new(merges.len());
    // For each cluster, by its representative: odd faces if merged less odd faces if not.
    let mut excess = vec![0i64; merges.len()];
    let mut faces = Vec::new();
    for (i, toggle) in merges.iter().enumerate() {
        for face in toggle.edge.coboundary() {
            let in_question: Vec<usize> = face.boundary().filter_map(|edge| place.get(&edge).copied()).collect();
            for &j in &in_question {
                clusters.union(i as u32, j as u32);
            }
            // Each face is weighed once, by the first of its edges, and only if its parity is in question.
            if in_question.iter().min() == Some(&i) && in_question.len() % 2 == 1 {
                let odd = face.boundary().filter(|&edge| crossings.is_crossed(edge)).count() % 2 == 1;
                faces.push((i, if odd { -1 } else { 1 }));
            }
        }
    }
    for (i, change) in faces {
        excess[clusters.root(i as u32) as usize] += change;
    }
    let mut i = 0;
    merges.retain(|_| {
        i += 1;
        excess[clusters.root(i as u32 - 1) as usize] <= 0
    });
    merges
}
