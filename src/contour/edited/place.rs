//! Where the vertices of touched cells go: near the crossings, and then smooth.
//!
//! Every vertex starts at the mean of the places where the surface crosses the edges at its corners: the sample where the surface was there
//! before, a quarter of a cell from the corner where edits made it. So a cut is half a cell wide, and a membrane as thick. Some rounds
//! of averaging with the neighbours follow. Vertices of untouched cells stay, and no vertex leaves its octants: those of different cells
//! and sheets never change places. Where a membrane ends at the root's boundary, the half of it that would lie beyond is flat.

use super::polygons::Polygons;
use super::shapes::Shape;
use super::touched::{Touched, TouchedBrick, TouchedCell};
use crate::contour::Placement;
use crate::grid::brick::{Bits, Local};
use crate::grid::cases::Mask;
use crate::grid::{Axis, Corner, Edge};
use crate::octree::SignedOctree;
use crate::octree::cells::{Cells, Crossing, EdgeTable};
use crate::octree::crossings::position;
use crate::octree::segments::Segments;
use crate::parallel::in_order;
use crate::progress::Silent;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// How far from the solid's points the surface runs where edits made it, in cells: a gap between two points one cell apart and a membrane
/// are half a cell thick, both.
const DISTANCE: f64 = 0.25;
/// Rounds of averaging. In slanted membranes and cuts through a torus the steps of the grid are gone after six; after twenty nothing is
/// visibly different.
const ROUNDS: usize = 6;
/// How far a vertex goes to the mean of its neighbours in a round. All move at once: with 1, two neighbours would change places again and
/// again.
const STEP: f64 = 0.5;

/// A position in fixed point, see [`Scale`].
pub(super) type Fixed = [i32; 3];

/// Positions, in segments: they grow into the room that topology repair leaves behind.
pub(super) type Points = Segments<Fixed, 12>;

/// Between cells and fixed point, of which a unit is 2^-30 of the root's side: half the bytes of doubles, and exact for the bounds that
/// vertices keep.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    /// A unit, in cells.
    unit: f64,
    /// Units a cell.
    cell: f64,
}

impl Scale {
    pub(super) fn new(depth: u32) -> Self {
        let cell = f64::from(1u32 << (30 - depth));
        Scale { unit: 1.0 / cell, cell }
    }

    /// From cells.
    #[inline]
    pub(super) fn fixed(self, point: DVec3) -> Fixed {
        (point * self.cell + 0.5).to_array().map(|c| c as i32)
    }

    /// To cells.
    #[inline]
    pub(super) fn cells(self, point: Fixed) -> DVec3 {
        DVec3::from(point.map(f64::from)) * self.unit
    }
}

/// The positions of the vertices of touched cells, in cells, appended to `fixed`, those of the ring. Cost: linear in vertices and their
/// neighbours, in parallel.
pub(super) fn place(
    octree: &SignedOctree,
    placement: Placement<'_>,
    touched: &Touched,
    neighbours: &Neighbours,
    fixed: Points,
) -> Points {
    let ring = fixed.len();
    let scale = touched.scale();
    let mut points = fixed;
    let (count, piece) = touched.pieces();
    let of_bricks = |distances: &mut Distances, n| {
        let mut points = Vec::new();
        for brick in piece(n) {
            if placement == Placement::Centre {
                middles(touched, brick, scale, &mut points);
            } else {
                distances.fill(octree, touched, brick);
                distances.start(touched, brick, scale, &mut points);
            }
        }
        points
    };
    let append = |of_bricks: Vec<Fixed>| {
        points.extend_from_slice(&of_bricks);
        Ok(())
    };
    in_order(count, &Silent, Distances::new, of_bricks, append).expect("nothing fails or is cancelled");
    if placement == Placement::Centre {
        return points;
    }
    // The last piece that has a brick beside those of each.
    let askers: Vec<usize> = (0..count)
        .into_par_iter()
        .map(|n| {
            let last = piece(n).flat_map(|brick| touched.around(brick)).map(|(_, beside)| beside).max();
            (n..count).find(|&n| last.is_none_or(|last| last < piece(n).end)).unwrap_or(n)
        })
        .collect();
    for _ in 0..ROUNDS {
        smooth(touched, neighbours, &askers, ring, &mut points);
    }
    points
}

/// Pieces that move at the same time.
const WAVE: usize = 64;

/// One round. All vertices move at once: the new positions of a piece wait until the last piece that asks for the old ones has moved. Along
/// the Z-order few of them wait at a time.
fn smooth(touched: &Touched, neighbours: &Neighbours, askers: &[usize], ring: usize, points: &mut Points) {
    let (count, piece) = touched.pieces();
    let mut waiting: Vec<(usize, Vec<Fixed>)> = Vec::new();
    for wave in (0..count).step_by(WAVE) {
        let end = count.min(wave + WAVE);
        let moved = |n| (n, moved(touched, neighbours, ring, points, piece(n)));
        waiting.par_extend((wave..end).into_par_iter().map(moved));
        waiting.retain(|(n, moved)| {
            let is_asked = askers[*n] >= end;
            if !is_asked {
                let first = ring + touched.first_of(piece(*n).start) as usize;
                (first..).zip(moved).for_each(|(i, &point)| points[i] = point);
            }
            is_asked
        });
    }
}

/// Where the vertices of some bricks go in a round.
fn moved(touched: &Touched, neighbours: &Neighbours, ring: usize, points: &Points, bricks: Range<usize>) -> Vec<Fixed> {
    let scale = touched.scale();
    let vertices = [bricks.start, bricks.end].map(|brick| touched.first_of(brick) as usize);
    let mut moved = Vec::with_capacity(vertices[1] - vertices[0]);
    let [mut start, end] = vertices.map(|i| neighbours.start(i));
    let list = neighbours.list.slice(start..end);
    let mut rest = &*list;
    for (cell, at) in touched.bricks[bricks].iter().flat_map(TouchedBrick::cells) {
        let TouchedCell { first, shape, .. } = touched.cells[cell];
        let origin = DVec3::from(at.map(f64::from));
        for (i, [low, high]) in (first as usize..).zip(&touched.shapes[usize::from(shape)].ranges) {
            let (own, further) = rest.split_at(neighbours.start(i + 1) - start);
            (rest, start) = (further, start + own.len());
            let mut sum = [0i64; 3];
            for &n in own {
                let point = points[n as usize];
                (0..3).for_each(|a| sum[a] += i64::from(point[a]));
            }
            let mean = DVec3::from(sum.map(|sum| sum as f64)) * (scale.unit / own.len() as f64);
            let to = scale.cells(points[ring + i]).lerp(mean, STEP).clamp(origin + *low, origin + *high);
            moved.push(scale.fixed(touched.in_root(to)));
        }
    }
    moved
}

/// The neighbours of each vertex of a touched cell, in the order of the polygons: first the vertices of the ring, then those of touched
/// cells.
pub(super) struct Neighbours {
    /// For each vertex where the list of its neighbours ends.
    ends: Vec<u32>,
    list: Segments<u32, 14>,
}

impl Neighbours {
    /// `ring` lists the vertices of other cells that the polygons use, sorted; vertices from number `kept` on are those of touched cells.
    pub(super) fn new(polygons: &Polygons, ring: &[u32], kept: u32, vertices: u32) -> Self {
        let mut ends = vec![0; vertices as usize];
        // Each neighbour is the end of one side that begins at the vertex.
        let sides =
            || polygons.sides().filter(|[from, _]| *from >= kept).map(|[from, to]| ((from - kept) as usize, to));
        sides().for_each(|(from, _)| ends[from] += 1);
        let mut sum = 0;
        for end in &mut ends {
            // Where it begins, for now: it moves on to the end as the list is filled.
            sum += std::mem::replace(end, sum);
        }
        let mut list = Segments::filled(0, sum as usize);
        for (from, to) in sides() {
            let number = match to.checked_sub(kept) {
                Some(touched) => ring.len() as u32 + touched,
                None => ring.binary_search(&to).expect("the ring has all vertices of untouched cells") as u32,
            };
            list[ends[from] as usize] = number;
            ends[from] += 1;
        }
        Neighbours { ends, list }
    }

    /// Where in the list the neighbours of a vertex begin, or the list ends.
    #[inline]
    fn start(&self, i: usize) -> usize {
        if i == 0 { 0 } else { self.ends[i - 1] as usize }
    }
}

/// Appends the middles of the octants of each vertex of the cells of a brick, or of the cell if it has only one.
fn middles(touched: &Touched, brick: usize, scale: Scale, points: &mut Vec<Fixed>) {
    for (cell, at) in touched.bricks[brick].cells() {
        let shape = touched.shape(touched.cells[cell]);
        for vertex in 0..shape.vertices {
            let middle =
                if shape.vertices == 1 { DVec3::splat(0.5) } else { middle_of_octants(shape.corners_of(vertex)) };
            points.push(scale.fixed(touched.in_root(DVec3::from(at.map(f64::from)) + middle)));
        }
    }
}

/// The middle of the octants of a cell at some corners, from where the cell starts.
fn middle_of_octants(corners: Mask) -> DVec3 {
    let middles = Bits(u64::from(corners)).map(|c| 0.25 + 0.5 * position_of(Corner::ALL[c as usize]));
    middles.sum::<DVec3>() / f64::from(corners.count_ones())
}

/// Where a corner is in its cell.
fn position_of(corner: Corner) -> DVec3 {
    DVec3::from(Axis::ALL.map(|a| f64::from(u8::from(corner & a))))
}

/// How far along their edges the crossings of a brick are.
struct Distances {
    edges: EdgeTable<f64>,
}

impl Distances {
    fn new() -> Self {
        Distances { edges: EdgeTable::new(0.0) }
    }

    fn fill(&mut self, octree: &SignedOctree, touched: &Touched, brick: usize) {
        let Some(place) = touched.bricks[brick].place else { return };
        let offsets = octree.crossings().offsets();
        self.edges
            .fill(&Cells::new(octree, place as usize), |Crossing { number, .. }| position(offsets[number as usize]));
    }

    /// Appends the vertices of the cells of a brick before they are smoothed.
    fn start(&self, touched: &Touched, brick: usize, scale: Scale, points: &mut Vec<Fixed>) {
        let brick = &touched.bricks[brick];
        for ((i, at), local) in brick.cells().zip(brick.plane.iter()) {
            let cell = touched.cells[i];
            let shape = touched.shape(cell);
            let origin = DVec3::from(at.map(f64::from));
            for vertex in 0..shape.vertices {
                let corners = shape.corners_of(vertex);
                let (sum, n) = self.crossings_round(shape, cell, local, corners);
                let middle = || middle_of_octants(corners);
                // What has the octant to itself stays near its middle.
                let mean = if n == 0.0 { middle() } else { sum / n };
                let is_irregular = shape.irregular >> vertex & 1 == 1;
                let start = if is_irregular { mean.lerp(middle(), 0.5) } else { mean };
                let [low, high] = shape.ranges[usize::from(vertex)];
                points.push(scale.fixed(touched.in_root(origin + start.clamp(low, high))));
            }
        }
    }

    /// The sum and the number of the places where the surface crosses the edges at some corners of a cell.
    fn crossings_round(&self, shape: &Shape, cell: TouchedCell, local: Local, corners: Mask) -> (DVec3, f64) {
        let (mut sum, mut n) = (DVec3::ZERO, 0.0);
        let sample = self.edges.at(local);
        let inside = |c: Corner| cell.signs >> c.index() & 1 == 1;
        for corner in Bits(u64::from(corners)).map(|c| Corner::ALL[c as usize]) {
            let here = position_of(corner);
            for axis in Axis::ALL.into_iter().filter(|a| shape.open[a.index()] >> corner.index() & 1 == 1) {
                let other = corner ^ axis;
                let distance = if !inside(corner) || inside(other) || shape.corners >> other.index() & 1 == 1 {
                    DISTANCE
                } else {
                    let position = sample(Edge::at(axis, corner));
                    if corner & axis { 1.0 - position } else { position }
                };
                let sign = if corner & axis { -1.0 } else { 1.0 };
                sum += here + DVec3::AXES[axis.index()] * sign * distance;
                n += 1.0;
            }
        }
        (sum, n)
    }
}
