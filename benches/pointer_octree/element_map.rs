//! Thinning on one map entry for each finest element of a solid: no recursion, no bricks, only keys that are looked up.

use super::cell_map::CellMap;
use super::locate;
use super::node::Tree;
use super::sign::CORNERS;
use super::thin::Thinned;
use zmend::grid::{Extent, Key};
use zmend::octree::crossings::finest_element;

/// The step in which an element was removed; 0 for what is there.
pub(crate) type Removed = u32;

/// Enters the elements all corners of which are inside. The leaves of the tree fill the root.
///
/// Cost: a byte for each point of the lattice while it is made.
pub(crate) fn fill<R, M: CellMap<Removed>>(tree: &Tree<'_, R>, map: &mut M) {
    let (depth, side) = (tree.depth, 1usize << tree.depth);
    let index = |[x, y, z]: [u32; 3]| (x as usize * side + y as usize) * side + z as usize;
    let mut inside = vec![false; side * side * side];
    for place in locate::leaves(tree) {
        if place.leaf.a.get() >> CORNERS & 1 == 1 {
            let across = |a: usize| place.at[a]..place.at[a] + (1 << place.size);
            for x in across(0) {
                for y in across(1) {
                    let start = index([x, y, place.at[2]]);
                    inside[start..start + (1 << place.size)].fill(true);
                }
            }
        }
    }
    // No point on the far side of the root is inside, so no step leads out of it.
    for (i, _) in inside.iter().enumerate().filter(|(_, inside)| **inside) {
        let at = [i / side / side, i / side % side, i % side].map(|c| c as u32);
        for extent in 0..8u32 {
            let is_there = (0..8u32)
                .filter(|corner| corner & !extent == 0)
                .all(|corner| inside[index([at[0] + (corner >> 2), at[1] + (corner >> 1 & 1), at[2] + (corner & 1)])]);
            if is_there {
                *map.made(finest_element(depth, at, Extent::ALL[extent as usize])) = 0;
            }
        }
    }
}

/// Collapses whatever can be, in layers as [`super::thin`] does it, and curves to their ends as well.
pub(crate) fn thin<M: CellMap<Removed>>(map: &mut M, depth: u32) -> Thinned {
    let mut done = Thinned::default();
    let mut waiting = map.keys();
    while !waiting.is_empty() {
        waiting.sort_unstable();
        waiting.dedup();
        done.steps += 1;
        let mut next = Vec::new();
        for key in waiting {
            if key.is_cell() || map.get(key) != Some(&0) {
                continue;
            }
            let Some(upper) = only(map, key, depth, done.steps) else { continue };
            for element in [key, upper] {
                if let Some(removed) = map.get_mut(element) {
                    *removed = done.steps;
                }
                next.extend(element.boundary());
            }
            done.removed += 2;
        }
        waiting = next;
    }
    done
}

/// The one element that has another in its boundary and is there; none if one was there when the step began.
fn only<M: CellMap<Removed>>(map: &M, key: Key, depth: u32, step: u32) -> Option<Key> {
    let mut found = None;
    for upper in key.coboundary_at(depth) {
        match map.get(upper) {
            Some(0) if found.is_none() => found = Some(upper),
            Some(&removed) if removed == 0 || removed == step => return None,
            _ => {}
        }
    }
    found
}
