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
//! Cost: that of [`Regions`], some 3 us a brick, and about 0.5 us a brick to measure them; independent of the volume.

use super::crossings::{Brick, Crossings};
use super::regions::Regions;
use super::signed::SignedOctree;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Face, Key};
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
        SignedOctree::from_crossings(crossings.retained(kept))
    }
}

/// The bricks at +x, +y, +z of a brick: the place of each, or its key if it is not in the list, and none beside the root.
fn higher(crossings: &Crossings, brick: &Brick) -> [Result<usize, Option<Key>>; 3] {
    let places = crossings.plus_places(brick);
    Axis::ALL.map(|axis| places[axis.index()].ok_or_else(|| brick.key.neighbour(Face::new(axis, true))))
}

/// The pairs of outside points of a brick's cells that no edge of the cell joins: across faces whose four edges are all crossed, and across
/// cells that are otherwise inside.
fn diagonals(octree: &SignedOctree, i: usize, join: &mut dyn FnMut([[u32; 3]; 2])) {
    let crossings = octree.crossings();
    let brick = &crossings.bricks()[i];
    let [x, y, z] = &brick.crossed;
    let [px, py, pz, pxy, ..] = crossings.plus(brick).map(|b| &b.crossed);
    let (y_at_x, x_at_y) = (y.at_plus_x(&px[1]), x.at_plus_y(&py[0]));
    let (z_at_x, x_at_z) = (z.at_plus_x(&px[2]), x.at_plus_z(&pz[0]));
    let (z_at_y, y_at_z) = (z.at_plus_y(&py[2]), y.at_plus_z(&pz[1]));
    let origin = crossings.origin(brick);
    let inside = &octree.inside()[i];
    let mut pair = |p: Local, from: [u32; 3], to: [u32; 3]| {
        let c = p.coords();
        join([from, to].map(|step| std::array::from_fn(|a| origin[a] + c[a] + step[a])));
    };
    let faces =
        [(*x & *y & y_at_x & x_at_y, [0, 1]), (*x & *z & z_at_x & x_at_z, [0, 2]), (*y & *z & z_at_y & y_at_z, [1, 2])];
    for (ambiguous, axes) in faces {
        let [u, v] = axes.map(|a| std::array::from_fn(|b| u32::from(a == b)));
        for p in ambiguous.iter() {
            if inside.get(p) {
                pair(p, u, v);
            } else {
                pair(p, [0; 3], std::array::from_fn(|a| u[a] | v[a]));
            }
        }
    }
    // The other corners of the cells, as far as some corner at its ends is outside and the three next to it are inside.
    let c0 = *inside;
    let (c1, c2, c4) = (c0 ^ *z, c0 ^ *y, c0 ^ *x);
    let (c3, c5, c6) = (c2 ^ z_at_y, c4 ^ z_at_x, c4 ^ y_at_x);
    let c7 = c6 ^ z_at_x.at_plus_y(&py[2].at_plus_x(&pxy[2]));
    let all = [c0, c1, c2, c3, c4, c5, c6, c7];
    for low in 0..4 {
        let others = (0..8).filter(|&c| c != low && c != 7 - low).fold(Plane::FULL, |a, c| a & all[c]);
        for p in (others & !(all[low] | all[7 - low])).iter() {
            let corner = |c: usize| [c as u32 >> 2, c as u32 >> 1 & 1, c as u32 & 1];
            pair(p, corner(low), corner(7 - low));
        }
    }
}
