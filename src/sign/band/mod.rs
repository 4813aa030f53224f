//! The band round a surface: the lattice points within some cells of it, each with the way to its closest point.
//!
//! Three steps make it:
//!
//! 1. [`near`]: every lattice point within [`NEAR`] of a triangle gets the closest point of the triangle, computed for itself. Triangles are
//!    streamed and forgotten; even one that is too small to meet a lattice line has lattice points near it.
//! 2. [`spread`]: closest points are passed on from neighbour to neighbour (Danielsson 1980) brick by brick, in rounds, until none
//!    comes nearer.
//! 3. [`refine`]: lattice points about the rim of the band, where surfaces are made of it, look for a closer point next to the one they have.
//!
//! Ways are stored in bricks in 512ths of a cell, three 16-bit numbers a point, which is enough for [`MOST_CELLS`] and makes comparisons
//! exact: of several triangles the nearest one is kept whatever their order, of equal ones the one with the least way.
//!
//! # Accuracy
//!
//! Step 1 is exact but for the rounding to 512ths. A closest point that is passed on is a point of the surface, so that distances are
//! never too small. Within a cell of the rim they are too large by 0.01 cells on average and 0.08 at most (see the tests), and exact round flat
//! faces; between the surface and there by up to 0.15.
//!
//! # Cost
//!
//! 3 KB for each brick that the band touches. Step 1: the closest points of the lattice points about a triangle, some 80 if it is smaller than
//! a cell. Step 2: 26 candidates for each point of a brick, in each round that it takes part in. Step 3: some 27 to 81 candidates for each
//! point within a cell of the rim.

mod near;
mod refine;
mod spread;

use crate::error::Result;
use crate::geom::Frame;
use crate::geom::raster::FineTriangle;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Key};
use crate::mesh::TriangleSource;
use crate::octree::LinearOctree;
use crate::octree::crossings::{Crossings, position};
use crate::parallel::pieces;
use crate::progress::{Progress, check};
use glam::{DVec3, Vec3};
use near::Seeds;
use rayon::prelude::*;

/// The widest band, in cells on each side.
pub const MOST_CELLS: f64 = 60.0;

/// Lattice points so near to a triangle, in cells, get its closest point for themselves. The more there are, the better those that are passed
/// on: with 1.3, distances were too large by up to 0.13 cells, with 2 by up to 0.08.
const NEAR: f64 = 2.0;

/// Ways that are passed on may be so much too long, in cells, before they are refined.
const SLACK: f64 = 0.15;

/// Units of a way in a cell.
const UNIT: f32 = 512.0;

/// First number of the way of a point that is beyond the band.
const BEYOND: i16 = i16::MAX;

/// The ways from the points of a brick to their closest points, by axis and position.
#[derive(Debug, Clone, PartialEq)]
struct Field([[i16; 512]; 3]);

/// Bytes for each brick, its place in an index included.
pub(super) const BRICK_BYTES: usize =
    size_of::<Field>() + 2 * size_of::<(Key, Box<Field>)>() + 2 * size_of::<(Key, u32)>();

/// Bytes that the first step takes at most for a surface with so many bricks.
pub(super) fn seed_bytes(bricks: usize) -> usize {
    2 * bricks * BRICK_BYTES
}

impl Field {
    const EMPTY: Field = Field([[BEYOND; 512]; 3]);

    fn way(&self, i: usize) -> [i16; 3] {
        [self.0[0][i], self.0[1][i], self.0[2][i]]
    }

    /// Keeps the nearer of two closest points.
    fn offer(&mut self, i: usize, way: [i16; 3]) {
        let old = self.way(i);
        if (square(way), way) < (square(old), old) {
            (0..3).for_each(|a| self.0[a][i] = way[a]);
        }
    }
}

/// Squared length of a way; that of a point beyond the band is greater than any other.
fn square(way: [i16; 3]) -> u32 {
    way.map(|w| i32::from(w).pow(2) as u32).iter().sum()
}

/// Which triangles have a band, and which parts of them.
pub(super) trait Wanted: Sync {
    /// Whether to look at a triangle at all.
    fn triangle(&self, triangle: &FineTriangle) -> bool;
    /// Whether a point of such a triangle counts, in cells.
    fn point(&self, at: DVec3) -> bool;
}

/// All of them.
pub(super) struct All;

impl Wanted for All {
    fn triangle(&self, _: &FineTriangle) -> bool {
        true
    }

    fn point(&self, _: DVec3) -> bool {
        true
    }
}

/// The lattice points near a surface and the ways to their closest points.
#[derive(Debug)]
pub struct Band {
    depth: u32,
    /// Sorted by key.
    bricks: Vec<(Key, Box<Field>)>,
    index: LinearOctree<u32>,
}

impl Band {
    /// The band of `reach` cells, at most [`MOST_CELLS`], round the triangles of a source. Triangles with corners that have no place in
    /// the grid, or without area, have none.
    ///
    /// # Errors
    /// Whatever the source returns, `Cancelled`, and `Memory` when `progress` says so.
    ///
    /// # Panics
    /// When `reach` is greater than [`MOST_CELLS`].
    pub fn around(source: &mut dyn TriangleSource, frame: &Frame, reach: f64, progress: &dyn Progress) -> Result<Self> {
        Band::around_wanted(source, frame, reach, &All, progress)
    }

    /// As [`around`](Band::around), for some triangles only.
    pub(super) fn around_wanted(
        source: &mut dyn TriangleSource,
        frame: &Frame,
        reach: f64,
        wanted: &impl Wanted,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let seeds = Seeds::new(frame.depth());
        source.triangles(&mut |batch| {
            batch.par_iter().with_min_len(64).try_for_each(|corners| {
                check(progress)?;
                if let [Some(a), Some(b), Some(c)] = corners.map(|p| frame.snap(p)) {
                    seeds.add_triangle(&[a, b, c], frame.cell_shift(), wanted, progress);
                }
                Ok(())
            })?;
            progress.advance(batch.len() as u64);
            progress.hold(seeds.bytes() as u64)
        })?;
        Band::spread(frame.depth(), seeds, reach, progress)
    }

    /// The band of `reach` cells round the places where edges are crossed.
    ///
    /// # Errors
    /// `Cancelled`, and `Memory` when `progress` says so.
    ///
    /// # Panics
    /// When `reach` is greater than [`MOST_CELLS`].
    pub fn around_crossings(crossings: &Crossings, reach: f64, progress: &dyn Progress) -> Result<Self> {
        let seeds = Seeds::new(crossings.depth());
        let (count, piece) = pieces(crossings.bricks().len(), 16);
        (0..count).into_par_iter().try_for_each(|n| {
            check(progress)?;
            for brick in piece(n).map(|i| &crossings.bricks()[i]) {
                let origin = crossings.origin(brick);
                let mut place = brick.first as usize;
                for axis in Axis::ALL {
                    for local in brick.crossed[axis.index()].iter() {
                        let mut at = DVec3::from(std::array::from_fn(|a| f64::from(origin[a] + local.coords()[a])));
                        at[axis.index()] += position(crossings.offsets()[place]);
                        seeds.add_point(at);
                        place += 1;
                    }
                }
            }
            Ok(())
        })?;
        Band::spread(crossings.depth(), seeds, reach, progress)
    }

    fn spread(depth: u32, seeds: Seeds, reach: f64, progress: &dyn Progress) -> Result<Self> {
        assert!(reach <= MOST_CELLS, "ways have 16 bits");
        // Of what was cancelled, not all may be there.
        check(progress)?;
        // The far ends of edges that leave the band have a distance, too.
        progress.hold(seeds.bytes() as u64)?;
        let bricks = spread::spread(seeds.into_bricks(), reach + 1.0 + SLACK, progress)?;
        let mut index = LinearOctree::with_capacity(bricks.len());
        for (i, (key, _)) in (0..).zip(&bricks) {
            index.insert(*key, i);
        }
        let mut band = Band { depth, bricks, index };
        band.refine(reach - 1.0, progress)?;
        Ok(band)
    }

    /// log2 of the number of cells a side.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// The bricks with points in the band, sorted.
    pub fn keys(&self) -> impl ExactSizeIterator<Item = Key> + '_ {
        self.bricks.iter().map(|b| b.0)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.bricks.len() * BRICK_BYTES
    }

    /// The way from a lattice point to its closest point, in cells; `None` beyond the band.
    pub fn way(&self, at: [u32; 3]) -> Option<Vec3> {
        let key = Key::cell(self.depth - 3, at.map(|c| c >> 3))?;
        let field = &self.bricks[*self.index.get(key)? as usize].1;
        let way = field.way(Local::new(at[0], at[1], at[2]).index() as usize);
        (way[0] != BEYOND).then(|| Vec3::from(way.map(f32::from)) / UNIT)
    }

    /// The points of a brick that are not farther than `distance` cells from the surface, which must be in the band's reach.
    pub fn within(&self, brick: Key, distance: f64) -> Plane {
        let Some(&i) = self.index.get(brick) else { return Plane::EMPTY };
        let field = &self.bricks[i as usize].1;
        let most = (distance * f64::from(UNIT)).powi(2) as u32;
        let mut plane = Plane::EMPTY;
        for x in 0..8 {
            for bit in 0..64 {
                let is_near = square(field.way(64 * x + bit)) <= most;
                plane.0[x] |= u64::from(is_near) << bit;
            }
        }
        plane
    }

    /// Where the edge from a lattice point along `axis`, one of whose ends only is within `distance` cells of the surface, has that
    /// distance: part of its length, and the direction in which the distance grows.
    ///
    /// Distances at both ends, and their slopes along the edge, which the ways tell, give a cubic: exact for planes, and to 0.01
    /// cells for balls of two cells.
    pub fn leaves(&self, at: [u32; 3], axis: Axis, distance: f64) -> (f64, Vec3) {
        let mut end = at;
        end[axis.index()] += 1;
        let [(from, a), (to, b)] = [at, end].map(|p| match self.way(p) {
            Some(way) => (f64::from(way.length()), -way.normalize_or_zero()),
            None => (f64::INFINITY, Vec3::ZERO),
        });
        if !(from.is_finite() && to.is_finite()) {
            // Only where the grid ends is an end beyond the band.
            let normal = Vec3::AXES[axis.index()];
            return (0.5, if from.is_finite() { normal } else { -normal });
        }
        let slopes = [a, b].map(|n| f64::from(n[axis.index()]));
        let value = |t: f64| between([from, to], slopes, t);
        let (mut near, mut far) = if from <= to { (0.0, 1.0) } else { (1.0, 0.0) };
        for _ in 0..20 {
            let middle = 0.5 * (near + far);
            if value(middle) <= distance { near = middle } else { far = middle }
        }
        let t = 0.5 * (near + far);
        (t, a.lerp(b, t as f32))
    }
}

/// The cubic with these values and slopes at 0 and 1.
pub(super) fn between([from, to]: [f64; 2], slopes: [f64; 2], t: f64) -> f64 {
    let s = 1.0 - t;
    from * s * s * (1.0 + 2.0 * t) + to * t * t * (1.0 + 2.0 * s) + slopes[0] * t * s * s - slopes[1] * t * t * s
}

#[cfg(test)]
mod tests;
