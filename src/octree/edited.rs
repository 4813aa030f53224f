//! A solid after topology repair: the signs as they were, and a sparse list of elements that were removed or added.
//!
//! The solid of a [`SignedOctree`] is the closed cubical complex of all finest elements (points, edges, faces, cells) all corners of which
//! are inside. Cutting a handle removes an open set from it (with an element all its cofaces), filling a tunnel adds a closed one (with an
//! element all its faces). The result K is a closed complex again, but signs of points alone no longer say which: a cut may
//! leave two points inside and take the edge between them away, a membrane may join points by faces and no cell.
//!
//! # Invariants ([`EditedOctree::validate`])
//!
//! - Both lists are sorted and without duplicates; what is removed belongs to the solid of the signs, what is added does not.
//! - K is closed: every face of an element of K is in K.
//!
//! # Cost
//!
//! 8 bytes an edit beside the octree. An element is looked up by two binary searches and up to eight signs; whoever needs many takes the
//! planes of a whole brick ([`EditedOctree::elements`]).

use super::crossings::{finest_element, lattice_point, owner};
use super::{LinearOctree, SignedOctree};
use crate::grid::brick::Plane;
use crate::grid::key::SIDE;
use crate::grid::{Axis, Corner, Extent, Face, Key};
use rayon::prelude::*;
use std::ops::Range;

/// Signs of lattice points, and finest elements that are exceptions to them.
#[derive(Debug, Clone, PartialEq)]
pub struct EditedOctree {
    signed: SignedOctree,
    removed: Vec<Key>,
    added: Vec<Key>,
}

impl EditedOctree {
    /// Puts signs and edits together, in any order and with duplicates; what is both removed and added stays as the signs have it.
    ///
    /// All edits name finest elements. That they leave the complex closed is the caller's promise; see [`validate`](Self::validate).
    pub fn new(signed: SignedOctree, mut removed: Vec<Key>, mut added: Vec<Key>) -> Self {
        for list in [&mut removed, &mut added] {
            list.par_sort_unstable();
            list.dedup();
        }
        let both: Vec<Key> = removed.iter().copied().filter(|key| added.binary_search(key).is_ok()).collect();
        for list in [&mut removed, &mut added] {
            list.retain(|key| both.binary_search(key).is_err());
        }
        EditedOctree { signed, removed, added }
    }

    /// With further elements added, or removed; those that the other list has are taken out of it.
    #[must_use]
    pub fn with(self, elements: Vec<Key>, add: bool) -> Self {
        let EditedOctree { signed, mut removed, mut added } = self;
        if add {
            added.extend(elements);
        } else {
            removed.extend(elements);
        }
        EditedOctree::new(signed, removed, added)
    }

    /// The solid of the signs, without any edit.
    pub fn unedited(signed: SignedOctree) -> Self {
        EditedOctree { signed, removed: Vec::new(), added: Vec::new() }
    }

    /// The signs, which edits do not change.
    pub fn signed(&self) -> &SignedOctree {
        &self.signed
    }

    /// Gives the signs back and forgets the edits.
    pub fn into_signed(self) -> SignedOctree {
        self.signed
    }

    /// The elements taken away, sorted.
    pub fn removed(&self) -> &[Key] {
        &self.removed
    }

    /// The elements added, sorted.
    pub fn added(&self) -> &[Key] {
        &self.added
    }

    /// Whether there is any edit.
    pub fn is_edited(&self) -> bool {
        !(self.removed.is_empty() && self.added.is_empty())
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.signed.bytes() + (self.removed.capacity() + self.added.capacity()) * size_of::<Key>()
    }

    /// Whether a finest element belongs to the solid. Cost: two binary searches and up to eight questions for a sign.
    pub fn contains(&self, element: Key) -> bool {
        self.added.binary_search(&element).is_ok()
            || self.all_inside(element) && self.removed.binary_search(&element).is_err()
    }

    /// Whether all corners of an element are inside by their signs.
    fn all_inside(&self, element: Key) -> bool {
        let side = SIDE >> self.signed.crossings().depth();
        element.points().all(|p| self.signed.is_inside(p.center().map(|c| c / side)))
    }

    /// The elements of the solid that a brick owns, by extent. Any cell three levels above the finest will do. Cost: some 100 ns if the
    /// brick is listed, and two binary searches.
    pub fn elements(&self, brick: Key) -> [Plane; 8] {
        let mut planes = match self.signed.crossings().find(brick) {
            Some(i) => self.signed.elements(i),
            None if self.is_uniformly_inside(brick) => [Plane::FULL; 8],
            None => [Plane::EMPTY; 8],
        };
        self.apply(brick, &mut planes);
        planes
    }

    /// As [`elements`](Self::elements) of the brick number `i` of the crossings.
    pub fn elements_at(&self, i: usize) -> [Plane; 8] {
        let mut planes = self.signed.elements(i);
        if self.is_edited() {
            self.apply(self.signed.crossings().bricks()[i].key, &mut planes);
        }
        planes
    }

    /// Whether a brick that the crossings do not list lies inside.
    pub fn is_uniformly_inside(&self, brick: Key) -> bool {
        self.signed.is_inside(lattice_point(self.signed.crossings().depth(), brick))
    }

    /// The bricks that own an edited element, sorted.
    pub fn edited_bricks(&self) -> Vec<Key> {
        let depth = self.signed.crossings().depth();
        let mut bricks: Vec<Key> =
            self.removed.iter().chain(&self.added).filter_map(|&key| owner(depth, key).0).collect();
        bricks.dedup();
        bricks.sort_unstable();
        bricks.dedup();
        bricks
    }

    fn apply(&self, brick: Key, planes: &mut [Plane; 8]) {
        let depth = self.signed.crossings().depth();
        for (list, there) in [(&self.removed, false), (&self.added, true)] {
            for &element in &list[within(list, brick)] {
                let (plane, local) = (&mut planes[element.dir().index()], owner(depth, element).1);
                if plane.get(local) != there {
                    plane.toggle(local);
                }
            }
        }
    }

    /// The number of finest cells that are removed, or beside an edited face: what the edits have touched.
    pub fn changed_cells(&self) -> u64 {
        let depth = self.signed.crossings().depth();
        let mut changed: LinearOctree<Plane> = LinearOctree::new();
        let mut add = |brick, cells| *changed.get_or_insert_with(brick, || Plane::EMPTY) |= cells;
        for list in [&self.removed, &self.added] {
            for of_brick in list.chunk_by(|a, b| owner(depth, *a).0 == owner(depth, *b).0) {
                let elements = of_brick.iter().map(|&element| (element.dir(), owner(depth, element).1));
                let Some(brick) = owner(depth, of_brick[0]).0 else {
                    // On the root's high faces.
                    let beside =
                        of_brick.iter().filter(|key| key.dir().dimension() == 2).flat_map(|key| key.coboundary());
                    for (brick, cell) in beside.map(|cell| owner(depth, cell)) {
                        add(brick.expect("cells lie in the root"), Plane::cube(cell, 1));
                    }
                    continue;
                };
                // The brick's cells, and those of the brick before it along each axis.
                let (mut own, mut before) = (Plane::EMPTY, [Plane::EMPTY; 3]);
                for (extent, start) in elements.filter(|(extent, _)| extent.dimension() >= 2) {
                    own.set(start);
                    if let Some(normal) = extent.complement().axes().next() {
                        let mut low = Plane::EMPTY;
                        low.set(start);
                        own |= low.at_plus(normal, &Plane::EMPTY);
                        before[normal.index()] |= Plane::EMPTY.at_plus(normal, &low);
                    }
                }
                add(brick, own);
                for (axis, cells) in Axis::ALL.into_iter().zip(before).filter(|(_, cells)| !cells.is_empty()) {
                    if let Some(brick) = brick.neighbour(Face::new(axis, false)) {
                        add(brick, cells);
                    }
                }
            }
        }
        changed.iter().map(|(_, cells)| u64::from(cells.count())).sum()
    }

    /// The Euler number of the solid: points less edges plus faces less cells. Cost: 50 ns a brick, in parallel; bricks that are wholly
    /// inside have none.
    pub fn euler_number(&self) -> i64 {
        let bricks = 0..self.signed.crossings().bricks().len();
        let signed: i64 = bricks.into_par_iter().map(|i| euler_number(&self.signed.elements(i))).sum();
        let of = |list: &[Key]| -> i64 { list.iter().map(|key| alternating(key.dir())).sum() };
        signed - of(&self.removed) + of(&self.added)
    }

    /// The first broken invariant, in words. Cost: a few microseconds an edit; the complex of the signs alone is always closed.
    ///
    /// # Errors
    /// Describes the violation and names its element.
    pub fn validate(&self) -> Result<(), String> {
        let depth = self.signed.crossings().depth();
        for (list, name) in [(&self.removed, "removed"), (&self.added, "added")] {
            if !list.is_sorted_by(|a, b| a < b) {
                return Err(format!("the list of what is {name} is not sorted"));
            }
            for &element in list {
                if finest_element(depth, lattice_point(depth, element), element.dir()) != element {
                    return Err(format!("{element} is {name}, but is not of the finest level"));
                }
                if self.all_inside(element) != (name == "removed") {
                    return Err(format!("{element} is {name}, but the signs had it so already"));
                }
            }
        }
        for &element in &self.removed {
            if let Some(coface) = element.coboundary_at(depth).find(|&coface| self.contains(coface)) {
                return Err(format!("{element} is removed, but {coface} beside it is not"));
            }
        }
        for &element in &self.added {
            if let Some(face) = element.boundary().find(|&face| !self.contains(face)) {
                return Err(format!("{element} is added, but not {face} in its boundary"));
            }
        }
        Ok(())
    }
}

/// The places in a sorted list of the finest elements that a brick owns: centres lie in it, or on its low faces.
fn within(list: &[Key], brick: Key) -> Range<usize> {
    // The first and the last key of the brick along the Z-order curve have its corner bits all 0 and all 1.
    let low = brick.corner(Corner::MIN).code();
    let span = u64::from(brick.size()).pow(3);
    let first = list.partition_point(|key| key.code() < low);
    let count = list[first..].partition_point(|key| key.code() < low + span);
    first..first + count
}

/// 1 for points and faces, -1 for edges and cells.
pub(crate) fn alternating(extent: Extent) -> i64 {
    if extent.dimension().is_multiple_of(2) { 1 } else { -1 }
}

/// The Euler number of the elements in some planes, by extent.
pub fn euler_number(planes: &[Plane; 8]) -> i64 {
    Extent::ALL.into_iter().map(|extent| alternating(extent) * i64::from(planes[extent.index()].count())).sum()
}
