//! A pointer octree, to see what hashing buys: the layout of the program of Zhou, Ju and Hu (2007), and the methods of that and of Ju's (2004).
//!
//! Inner nodes have eight child pointers, leaves two words of 64 bits, a number, and what a task keeps beside; all come from blocks
//! of 1 MB ([`blocks`]) and are told apart by a tag that takes no room. Whatever needs more than one cell goes by the recursion over cells,
//! faces, edges and points ([`traverse`]).
//!
//! | task | module | source |
//! |---|---|---|
//! | build from triangles | [`scan`] | Ju 2004, section 3 |
//! | signs | [`sign`] | the same, section 5: parity from the root down |
//! | marching cubes | [`contour`] | the recursion over points, zmend's cases |
//! | search, neighbours | [`locate`] | descent from the root, or the recursion over faces |
//! | thinning, handles, cuts | [`thin`](mod@thin), [`span`] over [`elements`] | Zhou, Ju and Hu 2007, sections 4 to 6 |
//!
//! Beside it, the same with an entry a finest cell ([`cell_map`]) and thinning with one an element ([`element_map`]), in a hash table or an
//! ordered map. tests/pointer holds all of them to what zmend does; docs/benchmarks.md, "What hashing buys", has the results.
#![allow(dead_code, reason = "each program uses its own part")]

pub(crate) mod blocks;
pub(crate) mod cell_map;
pub(crate) mod contour;
pub(crate) mod element_map;
pub(crate) mod elements;
pub(crate) mod locate;
pub(crate) mod node;
pub(crate) mod scan;
pub(crate) mod sign;
pub(crate) mod span;
pub(crate) mod thin;
pub(crate) mod traverse;

use node::{Memory, Tree};
use sign::Counts;
use zmend::Result;
use zmend::geom::Frame;
use zmend::mesh::{MeshSink, TriangleSource};

/// Repairs a closed mesh by parity: scan, signs, marching cubes.
///
/// # Errors
/// Those of source and sink.
pub(crate) fn repair(source: &mut dyn TriangleSource, frame: &Frame, sink: &mut dyn MeshSink) -> Result<Counts> {
    let memory = Memory::<()>::default();
    let tree = Tree::new(&memory, frame.depth());
    scan::scan(&tree, source, frame)?;
    let counts = sign::sign(&tree);
    contour::marching_cubes(&tree, &counts, frame, sink)?;
    Ok(counts)
}
