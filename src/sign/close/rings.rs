//! The boundary of a surface as closed walks over cells.

use crate::error::Result;
use crate::grid::Key;
use crate::octree::crossings::{Crossings, lattice_point};
use crate::progress::{Progress, check};
use glam::DVec3;
use rayon::prelude::*;

/// A cell of a ring, in finest cells, and the point where the ring leaves it for the next one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    pub(super) cell: [u32; 3],
    pub(super) exit: DVec3,
}

/// A closed walk over cells, each sharing a face with the next.
pub(super) type Ring = Vec<Step>;

/// Takes the boundary apart into simple rings: no cell occurs twice in one. It is given as steps over grid faces, numbered in order, each
/// under every cell from which it may be taken; it goes on in the cell on the other side.
///
/// # Errors
/// `Cancelled`.
pub(super) fn trace(crossings: &Crossings, mut exits: Vec<(Key, Exit)>, progress: &dyn Progress) -> Result<Vec<Ring>> {
    // Walks begin in the order in which steps are given.
    let starts: Vec<Key> = exits.chunk_by(|a, b| a.1.number == b.1.number).map(|same| same[0].0).collect();
    exits.par_sort_unstable();
    let at_cell = |cell: Key| &exits[exits.partition_point(|e| e.0 < cell)..];
    let mut used = vec![false; starts.len()];
    let mut rings = Vec::new();
    // The walk so far: cells, and the face by which each is left.
    let mut walk: Vec<(Key, Key)> = Vec::new();
    let mut on_walk: hashbrown::HashMap<Key, usize, ahash::RandomState> =
        hashbrown::HashMap::with_hasher(ahash::RandomState::with_seeds(9, 10, 11, 12));
    let mut steps = 0u64;
    for (start, mut cell) in starts.into_iter().enumerate() {
        if used[start] {
            continue;
        }
        loop {
            steps += 1;
            if steps.is_multiple_of(4096) {
                check(progress)?;
            }
            if let Some(&since) = on_walk.get(&cell) {
                let ring = walk.split_off(since);
                for (cell, _) in &ring {
                    on_walk.remove(cell);
                }
                rings.push(ring.iter().map(|&(cell, face)| step(crossings, cell, face)).collect());
            }
            let here = at_cell(cell).iter().take_while(|e| e.0 == cell).map(|e| e.1);
            let Some(Exit { number, face }) = here.into_iter().find(|exit| !used[exit.number as usize]) else {
                // As many steps lead into a cell as out of it: only the start of a walk can run out of them.
                debug_assert!(walk.is_empty(), "a walk ends where it began");
                break;
            };
            used[number as usize] = true;
            on_walk.insert(cell, walk.len());
            walk.push((cell, face));
            cell = face.coboundary().find(|&next| next != cell).expect("faces of a boundary have two cells");
        }
    }
    Ok(rings)
}

/// A step of the boundary over a grid face. Steps that may be taken only once have one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Exit {
    pub(super) number: u32,
    pub(super) face: Key,
}

/// A step of a ring through a face of the boundary: the ring passes it at the mean of the crossings of its edges.
fn step(crossings: &Crossings, cell: Key, face: Key) -> Step {
    let depth = crossings.depth();
    let (mut sum, mut n) = (DVec3::ZERO, 0.0);
    for edge in face.boundary() {
        if let Some(sample) = crossings.sample(edge) {
            let axis = edge.dir().axes().next().expect("an edge has an axis");
            let mut p = lattice_point(depth, edge).map(f64::from);
            p[axis.index()] += sample.position();
            sum += DVec3::from(p);
            n += 1.0;
        }
    }
    Step { cell: lattice_point(depth, cell), exit: sum / n }
}

/// Twice the area vector of a ring (Newell): the direction that most of its patch faces.
pub(super) fn area_vector(ring: &[Step]) -> DVec3 {
    let Some(first) = ring.first() else { return DVec3::ZERO };
    ring.windows(2).map(|w| (w[0].exit - first.exit).cross(w[1].exit - first.exit)).sum()
}

/// Takes out the places where the ring steps back the way it came. Empty if nothing is left.
pub(super) fn shortened(ring: Ring) -> Ring {
    let mut kept: Ring = Vec::with_capacity(ring.len());
    for step in ring {
        // From a to b and back to a: both steps go, and the walk goes on from a.
        if kept.len() >= 2 && kept[kept.len() - 2].cell == step.cell {
            kept.truncate(kept.len() - 2);
        }
        kept.push(step);
    }
    // The same across the seam, where the ring's end meets its beginning.
    let (mut start, mut end) = (0, kept.len());
    while end - start > 2 {
        if kept[end - 1].cell == kept[start + 1].cell {
            (start, end) = (start + 1, end - 1);
        } else if kept[end - 2].cell == kept[start].cell {
            end -= 2;
        } else {
            kept.truncate(end);
            kept.drain(..start);
            return kept;
        }
    }
    Vec::new()
}
