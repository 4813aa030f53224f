//! Components: the solids that a surface bounds, and the cavities in them.
//!
//! Signs decide, not meshes, so that all surfaces extracted from them agree. By the convention of [`cases`](crate::grid::cases), inside
//! points hang together through edges, outside points through faces and cells as well. Then every component of the surface has one
//! component of the inside on one side and one of the outside on the other, and these form a tree (Rosenfeld 1979): the surface has as many
//! components as there are solids and cavities.
//!
//! A **solid** is a component of the inside, with its outer surface and those of its cavities. A **cavity** is a component of the outside other
//! than the one that reaches infinity. A ball in a hollow ball makes two solids and one cavity.
//!
//! Cost: that of [`Regions`], and some population counts a brick to measure them; independent of the volume.

use super::cells::CellEdges;
use super::crossings::{Brick, Builder, Crossings, finest_element, owner};
use super::regions::{REGION_BYTES, Regions};
use super::signed::SignedOctree;
use crate::grid::brick::Plane;
use crate::grid::{Axis, Extent, Face, Key};
use crate::parallel::pieces;
use rayon::prelude::*;

/// What a component is and how large.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Component {
    /// Whether it is a solid; otherwise it is a cavity, or the outer space.
    pub is_inside: bool,
    /// Crossed edges with an end in it: the polygons of a dual surface round it. PolyMender's measure.
    pub edges: u64,
    /// Lattice points in it: the volume in cells, as near as whole cells tell. 0 for the outer space.
    pub points: u64,
}

/// Bytes held while the components of an octree are found and some of them dropped: the octree and what is made of it included.
pub fn component_bytes(octree: &SignedOctree) -> usize {
    2 * octree.bytes() + octree.crossings().bricks().len() * (REGION_BYTES + size_of::<[Plane; 3]>())
}

/// The components of the inside and the outside. Number 0 is the outer space.
#[derive(Debug)]
pub struct Components<'a> {
    octree: &'a SignedOctree,
    regions: Regions<'a, Crossings>,
    list: Vec<Component>,
}

impl<'a> Components<'a> {
    /// Finds and measures all components.
    pub fn new(octree: &'a SignedOctree) -> Self {
        let regions = Regions::joined(octree.crossings(), |i, join| diagonals(octree, i, join));
        let mut components = Components { octree, regions, list: Vec::new() };
        components.measure();
        components
    }

    /// All components; those after the first in the order in which the Z-order of bricks meets them.
    pub fn list(&self) -> &[Component] {
        &self.list
    }

    /// Solids in all.
    pub fn solids(&self) -> impl Iterator<Item = &Component> {
        self.list.iter().filter(|c| c.is_inside)
    }

    /// Cavities in all.
    pub fn cavities(&self) -> impl Iterator<Item = &Component> {
        self.list[1..].iter().filter(|c| !c.is_inside)
    }

    /// The component of a lattice point, in cells. Cost: a hash probe, and a look at the parts of its brick or a binary search.
    ///
    /// # Panics
    /// When the point lies on the high sides of the root, or beyond.
    pub fn of_point(&self, at: [u32; 3]) -> u32 {
        let crossings = self.octree.crossings();
        let (brick, local) = owner(crossings.depth(), finest_element(crossings.depth(), at, Extent::POINT));
        let brick = brick.expect("the point lies in the root");
        match crossings.find(brick) {
            Some(i) => {
                let part = self.regions.parts(i).find(|(_, part)| part.get(local));
                part.expect("every point of a brick lies in a part").0
            }
            None => self.regions.of_absent(brick),
        }
    }

    fn measure(&mut self) {
        let bricks = self.octree.crossings().bricks();
        let (count, piece) = pieces(bricks.len(), 64);
        let measured: Vec<Vec<(u32, Component)>> = (0..count)
            .into_par_iter()
            .map(|n| {
                let mut found = Vec::new();
                piece(n).for_each(|i| self.measure_brick(i, &mut found));
                found
            })
            .collect();
        let mut list = vec![Component::default(); self.regions.count() as usize];
        for (region, part) in measured.into_iter().flatten() {
            let all = &mut list[region as usize];
            all.is_inside |= part.is_inside;
            all.edges += part.edges;
            all.points += part.points;
        }
        for (region, length) in self.regions.runs() {
            list[region as usize].points += 512 * u64::from(length);
        }
        list[0].points = 0;
        self.list = list;
    }

    /// What a brick adds to its components: its points, and the edges that start in it, to those at both ends.
    fn measure_brick(&self, i: usize, found: &mut Vec<(u32, Component)>) {
        let crossings = self.octree.crossings();
        let brick = &crossings.bricks()[i];
        let inside = self.octree.inside()[i];
        let higher = higher(crossings, brick);
        for (region, &part) in self.regions.parts(i) {
            let ends =
                brick.crossed.map(|plane| (plane & part).count()).iter().sum::<u32>() + self.ends_within(i, &part);
            let is_inside = !(part & inside).is_empty();
            found.push((region, Component { is_inside, edges: u64::from(ends), points: u64::from(part.count()) }));
        }
        // Ends in the bricks at +x, +y, +z.
        for (axis, higher) in Axis::ALL.into_iter().zip(higher) {
            let leaving = brick.crossed[axis.index()] & Plane::EMPTY.at_plus(axis, &Plane::FULL);
            if leaving.is_empty() {
                continue;
            }
            let mut add = |region, edges: u32| {
                found.push((region, Component { edges: u64::from(edges), ..Component::default() }));
            };
            match higher {
                Ok(j) => self.regions.parts(j).for_each(|(region, part)| {
                    add(region, (leaving & Plane::EMPTY.at_plus(axis, part)).count());
                }),
                Err(key) => add(key.map_or(0, |key| self.regions.of_absent(key)), leaving.count()),
            }
        }
    }

    /// Crossed edges of a brick that end in a part of it.
    fn ends_within(&self, i: usize, part: &Plane) -> u32 {
        let crossed = &self.octree.crossings().bricks()[i].crossed;
        Axis::ALL.into_iter().map(|axis| (crossed[axis.index()] & part.at_plus(axis, &Plane::EMPTY)).count()).sum()
    }

    /// The crossings that are left when some components turn into what surrounds them: edges with an end in one of those are crossed no
    /// more, and nothing of them stays behind. No two of them may have a surface in common.
    #[must_use]
    pub fn without(&self, is_dropped: impl Fn(u32) -> bool + Sync) -> SignedOctree {
        let crossings = self.octree.crossings();
        let kept = |i: usize| {
            let brick = &crossings.bricks()[i];
            let dropped = self.regions.points_in(i, &is_dropped);
            let mut kept = brick.crossed;
            for ((axis, higher), kept) in Axis::ALL.into_iter().zip(higher(crossings, brick)).zip(&mut kept) {
                if kept.is_empty() {
                    continue;
                }
                let higher = match higher {
                    Ok(j) => self.regions.points_in(j, &is_dropped),
                    Err(Some(key)) if is_dropped(self.regions.of_absent(key)) => Plane::FULL,
                    Err(_) => Plane::EMPTY,
                };
                *kept &= !(dropped | dropped.at_plus(axis, &higher));
            }
            kept
        };
        SignedOctree::from_crossings(retained(crossings, kept))
    }
}

/// The bricks at +x, +y, +z of a brick: the place of each, or its key if it is not in the list, and none beside the root.
fn higher(crossings: &Crossings, brick: &Brick) -> [Result<usize, Option<Key>>; 3] {
    let places = crossings.plus_places(brick);
    Axis::ALL.map(|axis| places[axis.index()].ok_or_else(|| brick.key.neighbour(Face::new(axis, true))))
}

/// The pairs of outside points of a brick's cells that no edge need join: all outside corners of a cell hang together. In cells that are
/// not knotty, edges join them.
fn diagonals(octree: &SignedOctree, i: usize, join: &mut dyn FnMut([[u32; 3]; 2])) {
    let crossings = octree.crossings();
    let origin = crossings.origin(&crossings.bricks()[i]);
    CellEdges::new(octree, i).for_knotty(|cell, mask| {
        let c = cell.coords();
        let point = |k: u32| std::array::from_fn(|a| origin[a] + c[a] + (k >> (2 - a) & 1));
        let mut outside = (0..8).filter(|k| mask >> k & 1 == 0).map(point);
        let first = outside.next().expect("a knotty cell is mixed");
        outside.for_each(|other| join([first, other]));
    });
}

/// The crossings that `kept` names for each brick: none that is not there.
fn retained(crossings: &Crossings, kept: impl Fn(usize) -> [Plane; 3] + Sync + Send) -> Crossings {
    let planes: Vec<[Plane; 3]> = (0..crossings.bricks().len()).into_par_iter().map(kept).collect();
    let mut builder = Builder::new(crossings.depth(), crossings.with_normals());
    let (mut offsets, mut normals) = (Vec::new(), Vec::new());
    for (brick, kept) in crossings.bricks().iter().zip(planes) {
        let mut place = brick.first as usize;
        for (crossed, kept) in brick.crossed.iter().zip(&kept) {
            for local in crossed.iter() {
                if kept.get(local) {
                    let sample = crossings.sample_at(place);
                    offsets.push(sample.offset);
                    normals.push(sample.normal);
                }
                place += 1;
            }
        }
        builder.push(brick.key, kept, &offsets, &normals);
        offsets.clear();
        normals.clear();
    }
    builder.finish()
}
