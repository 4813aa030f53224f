//! Where the vertices of touched cells go: near the crossings, and then smooth.
//!
//! Every vertex starts at the mean of the places where the surface crosses the edges at its corners: the sample where the surface was there
//! before, a quarter of a cell from the corner where edits made it. So a cut is half a cell wide, and a membrane as thick. Some rounds
//! of averaging with the neighbours follow. Vertices of untouched cells stay, and no vertex leaves its octants: those of different cells
//! and sheets never change places.

use super::polygons::{Patch, Polygons};
use super::touched::TouchedCell;
use crate::contour::Placement;
use crate::grid::{Axis, Corner, Edge};
use crate::octree::crossings::{Crossings, finest_element};
use glam::DVec3;
use rayon::prelude::*;

/// How far from the solid's points the surface runs where edits made it, in cells: a gap between two points one cell apart and a membrane
/// are half a cell thick, both.
const DISTANCE: f64 = 0.25;
/// Vertices keep this distance from the sides of their octants, in cells.
const MARGIN: f64 = 1.0 / 64.0;
/// Rounds of averaging. In slanted membranes and cuts through a torus the steps of the grid are gone after six; after twenty nothing is
/// visibly different.
const ROUNDS: usize = 6;
/// How far a vertex goes to the mean of its neighbours in a round. All move at once: with 1, two neighbours would change places again and
/// again.
const STEP: f64 = 0.5;

/// A vertex on its way.
#[derive(Debug, Clone, Copy)]
struct Moving {
    at: DVec3,
    /// Where it may go.
    low: DVec3,
    high: DVec3,
}

/// The positions of the vertices of touched cells, in cells. `ring` lists the vertices of other cells that the polygons use, sorted, and
/// `fixed` their positions. Cost: linear in vertices and their neighbours, in parallel.
pub(super) fn place(
    crossings: &Crossings,
    placement: Placement<'_>,
    patch: &Patch<'_>,
    polygons: &Polygons,
    ring: &[u32],
    fixed: &[DVec3],
) -> Vec<DVec3> {
    if placement == Placement::Centre {
        return patch.touched.cells.iter().flat_map(middles_of).collect();
    }
    let mut moving: Vec<Moving> =
        patch.touched.cells.par_iter().flat_map_iter(|cell| vertices_of(crossings, cell)).collect();
    let neighbours = Neighbours::new(polygons, ring, patch.kept, moving.len());
    for _ in 0..ROUNDS {
        let moved = |(i, vertex): (usize, &Moving)| {
            let around = neighbours.of(i);
            let position = |&n: &u32| match n.checked_sub(ring.len() as u32) {
                Some(touched) => moving[touched as usize].at,
                None => fixed[n as usize],
            };
            let mean = around.iter().map(position).sum::<DVec3>() / around.len() as f64;
            Moving { at: vertex.at.lerp(mean, STEP).clamp(vertex.low, vertex.high), ..*vertex }
        };
        moving = moving.par_iter().enumerate().map(moved).collect();
    }
    moving.into_iter().map(|vertex| vertex.at).collect()
}

/// The neighbours of each vertex of a touched cell, in the order of the polygons: first the vertices of the ring, then those of touched
/// cells.
struct Neighbours {
    ends: Vec<u32>,
    list: Vec<u32>,
}

impl Neighbours {
    fn new(polygons: &Polygons, ring: &[u32], kept: u32, vertices: usize) -> Self {
        let mut ends = vec![0; vertices + 1];
        // Each neighbour is the end of one side that begins at the vertex.
        let sides =
            || polygons.sides().filter(|[from, _]| *from >= kept).map(|[from, to]| ((from - kept) as usize, to));
        sides().for_each(|(from, _)| ends[from + 1] += 1);
        (0..vertices).for_each(|i| ends[i + 1] += ends[i]);
        let mut next = ends.clone();
        let mut list = vec![0; ends[vertices] as usize];
        for (from, to) in sides() {
            let number = match to.checked_sub(kept) {
                Some(touched) => ring.len() as u32 + touched,
                None => ring.binary_search(&to).expect("the ring has all vertices of untouched cells") as u32,
            };
            list[next[from] as usize] = number;
            next[from] += 1;
        }
        Neighbours { ends, list }
    }

    fn of(&self, i: usize) -> &[u32] {
        &self.list[self.ends[i] as usize..self.ends[i + 1] as usize]
    }
}

/// The middles of the octants of each vertex of a cell, or of the cell if there is only one.
fn middles_of(cell: &TouchedCell) -> impl Iterator<Item = DVec3> {
    let cell = *cell;
    (0..cell.vertices).map(move |vertex| {
        let corners = Corner::ALL.into_iter().filter(|c| cell.vertices > 1 && cell.slots[c.index()] == vertex);
        let (sum, n) = corners.fold((DVec3::ZERO, 0.0), |(sum, n), c| (sum + octant_middle(c), n + 1.0));
        DVec3::from(cell.at.map(f64::from)) + if n > 0.0 { sum / n } else { DVec3::splat(0.5) }
    })
}

/// The middle of the octant of a cell at a corner, from where the cell starts.
fn octant_middle(corner: Corner) -> DVec3 {
    0.25 + 0.5 * position(corner)
}

/// Where a corner is in its cell.
fn position(corner: Corner) -> DVec3 {
    DVec3::from(Axis::ALL.map(|a| f64::from(u8::from(corner & a))))
}

/// The vertices of a cell before they are smoothed.
fn vertices_of(crossings: &Crossings, cell: &TouchedCell) -> impl Iterator<Item = Moving> {
    let cell = *cell;
    let origin = DVec3::from(cell.at.map(f64::from));
    (0..cell.vertices).map(move |vertex| {
        let corners = || Corner::ALL.into_iter().filter(move |c| cell.slots[c.index()] == vertex);
        let (mut low, mut high) = (DVec3::ONE, DVec3::ZERO);
        let (mut sum, mut n) = (DVec3::ZERO, 0.0);
        for corner in corners() {
            let here = position(corner);
            (low, high) = (low.min(0.5 * here), high.max(0.5 * here + 0.5));
            for axis in Axis::ALL.into_iter().filter(|&a| !cell.parts.contains(Edge::at(a, corner))) {
                let sign = if corner & axis { -1.0 } else { 1.0 };
                sum += here + DVec3::AXES[axis.index()] * sign * distance(crossings, &cell, corner, axis);
                n += 1.0;
            }
        }
        let middle = corners().map(octant_middle).sum::<DVec3>() / corners().count() as f64;
        if cell.vertices == 1 {
            (low, high) = (DVec3::ZERO, DVec3::ONE);
        }
        let is_irregular = cell.irregular >> vertex & 1 == 1;
        // What has the octant to itself stays near its middle.
        let mean = if n == 0.0 { middle } else { sum / n };
        let at = if is_irregular { mean.lerp(middle, 0.5) } else { mean };
        let (low, high) = (low + MARGIN, high - MARGIN);
        Moving { at: origin + at.clamp(low, high), low: origin + low, high: origin + high }
    })
}

/// How far from a corner in the complex the surface crosses the edge along `axis`, which is not in the complex, in cells.
fn distance(crossings: &Crossings, cell: &TouchedCell, corner: Corner, axis: Axis) -> f64 {
    let inside = |c: Corner| cell.signs >> c.index() & 1 == 1;
    let other = corner ^ axis;
    if !inside(corner) || inside(other) || cell.parts.contains(other) {
        return DISTANCE;
    }
    let start = Axis::ALL.map(|a| (cell.at[a.index()] + i32::from(corner & a && a != axis)) as u32);
    let edge = finest_element(crossings.depth(), start, axis.into());
    let sample = crossings.sample(edge).expect("an edge between inside and outside is crossed");
    if corner & axis { 1.0 - sample.position() } else { sample.position() }
}
