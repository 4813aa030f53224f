//! Patches: what has to go so that edges of the skeleton can.
//!
//! To cut at an edge e, everything must go that was only there because of it: the smallest set A that has e, with an element all its
//! cofaces, and with the upper part of a pair also the lower. What is left is closed, and since pairs go as a whole, it collapses by the
//! same pairs onto the skeleton without e. So one patch takes away exactly one loop, and any number of patches, which may
//! overlap, as many loops as edges: components and cavities stay as they are. This is a statement about discrete gradients (Forman 1998)
//! and needs no geometry.
//!
//! The original takes the edges that flowed into e and their cofaces. That is A, except where a cell in it was removed with a face that is
//! not: there the original's result may differ by a loop.
//!
//! Cost: some 100 ns an element of the patches.

use super::complex::{Complex, Planes, Spot};
use super::flow::partner;
use crate::grid::{Extent, Face, Key};
use crate::octree::EditedOctree;
use crate::octree::edited::alternating;

/// The elements that go with some edges of the skeleton, or faces of [walls](super::skeleton::walls), in no particular order.
///
/// `octree` is what the complex was made of.
pub(super) fn patches(octree: &EditedOctree, complex: &Complex, first: &[Spot]) -> Vec<Key> {
    let mut patch = Patch { octree, complex, bricks: Vec::new(), pending: Vec::new(), gone: Vec::new() };
    patch.bricks.resize_with(complex.bricks.len(), || None);
    first.iter().for_each(|&spot| patch.add(spot));
    while let Some(spot) = patch.pending.pop() {
        patch.spread(spot);
    }
    debug_assert_eq!(
        patch.gone.iter().map(|spot| alternating(spot.extent)).sum::<i64>(),
        first.iter().map(|spot| alternating(spot.extent)).sum::<i64>(),
        "pairs go as a whole"
    );
    patch.gone.iter().map(|&spot| complex.key(spot)).collect()
}

struct Patch<'a> {
    octree: &'a EditedOctree,
    complex: &'a Complex,
    /// By brick, the elements before thinning, less those that are gone.
    bricks: Vec<Option<Box<Planes>>>,
    pending: Vec<Spot>,
    gone: Vec<Spot>,
}

impl Patch<'_> {
    /// Takes an element away if it is still there.
    fn add(&mut self, spot: Spot) {
        let planes = self.bricks[spot.brick as usize]
            .get_or_insert_with(|| Box::new(self.complex.before_thinning(self.octree, spot.brick)));
        let plane = &mut planes[spot.extent.index()];
        if plane.get(spot.local) {
            plane.toggle(spot.local);
            self.pending.push(spot);
            self.gone.push(spot);
        }
    }

    /// Takes away what has to go with an element.
    fn spread(&mut self, spot: Spot) {
        let complex = self.complex;
        if spot.extent == Extent::CELL {
            let record = complex.bricks[spot.brick as usize].record.as_deref();
            if let Some(side) = record.and_then(|record| record.face_of(spot.local)) {
                self.add(complex.half_toward(spot, side).expect("both were live, so their bricks are listed"));
            }
            return;
        }
        if spot.extent.dimension() == 2
            && let Some(edge) = partner(complex, spot)
        {
            self.add(edge);
        }
        for side in Face::ALL.into_iter().filter(|side| !spot.extent.contains(side.axis())) {
            if let Some(coface) = complex.half_toward(spot, side) {
                self.add(coface);
            }
        }
    }
}
