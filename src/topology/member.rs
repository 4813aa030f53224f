//! Which component of the solid a loop belongs to, and what its cross-section is made of.
//!
//! Components are numbered by their size, from 1 on. Cuts and fills move none of their points and join or part none of them, so that the numbers
//! stay as they are from the first loop that is removed to the last.

use super::complex::{Complex, Spot};
use super::flow::partner;
use crate::grid::{Face, Key};
use crate::octree::SignedOctree;
use crate::octree::components::Components;
use crate::octree::crossings::lattice_point;
use hashbrown::HashSet;
use std::cmp::Reverse;

/// The numbers of the components of a solid: 1 for the one with the most lattice points, and so on.
#[derive(Debug)]
pub struct Members<'a> {
    signed: &'a SignedOctree,
    components: Components<'a>,
    /// By component, its number; 0 for what is outside.
    numbers: Vec<u32>,
}

impl<'a> Members<'a> {
    /// Finds and numbers them. Cost: that of [`Components`].
    pub fn new(signed: &'a SignedOctree) -> Self {
        let components = Components::new(signed);
        let list = components.list();
        let mut solids: Vec<usize> = (0..list.len()).filter(|&i| list[i].is_inside).collect();
        solids.sort_by_key(|&i| (Reverse(list[i].points), i));
        let mut numbers = vec![0; list.len()];
        (1..).zip(solids).for_each(|(number, i)| numbers[i] = number);
        Members { signed, components, numbers }
    }

    /// Lattice points of each component, which are about its volume in cells: that of number 1 first.
    pub fn volumes(&self) -> Vec<u64> {
        let mut volumes: Vec<u64> = self.components.solids().map(|solid| solid.points).collect();
        volumes.sort_unstable_by_key(|&volume| Reverse(volume));
        volumes
    }

    /// The number of the component that a finest element belongs to or touches: that of the first of its corners that is inside by its
    /// sign; `None` if there is none.
    pub fn of(&self, element: Key) -> Option<u32> {
        let depth = self.signed.crossings().depth();
        let mut corners = element.points().map(|point| lattice_point(depth, point));
        // Nothing on the high sides of the root is inside.
        let inside = corners.find(|&at| at.iter().all(|&c| c >> depth == 0) && self.signed.is_inside(at))?;
        Some(self.numbers[self.components.of_point(inside) as usize])
    }
}

/// The elements that flowed into an edge of the skeleton, that edge first: edges of a solid that its cross-section passes through, or the
/// faces of which the membrane across a tunnel is made. Cost: some 100 ns each.
pub(super) fn flow(complex: &Complex, edge: Spot) -> impl Iterator<Item = Key> + '_ {
    let mut seen: HashSet<Spot, ahash::RandomState> = HashSet::with_hasher(ahash::RandomState::with_seeds(1, 2, 3, 4));
    seen.insert(edge);
    let mut pending = vec![edge];
    let mut next = 0;
    std::iter::from_fn(move || {
        let &from = pending.get(next)?;
        next += 1;
        let sides = Face::ALL.into_iter().filter(|side| !from.extent.contains(side.axis()));
        let faces = sides.filter_map(|side| complex.half_toward(from, side));
        let into = faces.filter_map(|face| partner(complex, face));
        pending.extend(into.filter(|edge| seen.insert(*edge)));
        Some(complex.key(from))
    })
}

/// The component that a loop belongs to; see [`Handle::component`](super::Handle::component).
pub(super) fn component_of(members: &Members<'_>, complex: &Complex, edge: Spot) -> u32 {
    flow(complex, edge).find_map(|element| members.of(element)).unwrap_or(0)
}
