//! Marching cubes (Lorensen and Cline 1987) over bricks: one point a crossed edge, triangles by the derived cases.
//!
//! The number of a point is the number of its crossing, so no table of points is needed. The number of triangles is known before the
//! first is made: a cell whose surface is one cycle of n edges has n - 2 triangles, each crossed edge is on four cells, so there
//! are 4 V - 2 C of them for V crossed edges and C mixed cells, but for the few knotty cells, which are looked at one by one.
//!
//! The result is closed and manifold for any signs: segments on faces match, and no inner edge lies in a face (tests of
//! [`cases`](crate::grid::cases)). Triangles stay in their cells, so different cells' never intersect.

use super::PIECE;
use crate::error::Result;
use crate::geom::Frame;
use crate::grid::brick::{Bits, Plane};
use crate::grid::cases::CASES;
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::SignedOctree;
use crate::octree::cells::{CellEdges, Cells, EdgeTable, place_of};
use crate::octree::crossings::{Crossings, position};
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Stage};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::LazyLock;

/// Passes the surface of the octree to `sink` as triangles; returns its size. Cost: about 25 ns a crossed edge, and memory for a
/// few thousand cells a thread.
///
/// # Errors
/// Whatever `sink` returns, and `Cancelled`.
pub fn marching_cubes(
    octree: &SignedOctree,
    frame: &Frame,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let crossings = octree.crossings();
    let bricks = crossings.bricks().len();
    progress.begin(Stage::Contour, 2 * bricks as u64);
    progress.hold(octree.bytes() as u64)?;
    let triangles = count_triangles(octree);
    let sizes = MeshSizes { points: crossings.len() as u64, faces: triangles, corners: 3 * triangles };
    sink.begin(sizes)?;
    let (count, piece) = pieces(bricks, PIECE);
    let points = |(): &mut (), n| points(crossings, frame, piece(n));
    in_order(
        count,
        progress,
        || (),
        points,
        |points| {
            progress.advance(PIECE as u64);
            sink.points(&points)
        },
    )?;
    let triangles = |numbers: &mut EdgeTable<u32>, n| triangles_of(octree, numbers, piece(n));
    in_order(
        count,
        progress,
        || EdgeTable::new(0),
        triangles,
        |corners| {
            progress.advance(PIECE as u64);
            sink.faces(3, &corners)
        },
    )?;
    Ok(sizes)
}

/// The number of triangles of the whole surface.
#[inline(never)]
fn count_triangles(octree: &SignedOctree) -> u64 {
    let of_brick = |i: usize| {
        let edges = CellEdges::new(octree, i);
        let mut correction = -2 * i64::from(edges.mixed().count());
        edges.for_knotty(|_, mask| {
            let case = &CASES[usize::from(mask)];
            correction += case.triangles.len() as i64 + 2 - case.cycles.iter().map(Vec::len).sum::<usize>() as i64;
        });
        correction
    };
    let corrections: i64 = (0..octree.crossings().bricks().len()).into_par_iter().map(of_brick).sum();
    (4 * octree.crossings().len() as i64 + corrections) as u64
}

#[inline(never)]
fn points(crossings: &Crossings, frame: &Frame, range: Range<usize>) -> Vec<DVec3> {
    let places = crossings.places(range.clone());
    let mut points = Vec::with_capacity(places.len());
    let offsets = crossings.offsets().slice(places);
    let mut offsets = offsets.iter().copied();
    for brick in range.map(|i| &crossings.bricks()[i]) {
        // The brick's lattice planes in model space.
        let origin = DVec3::from(crossings.origin(brick).map(f64::from));
        let lattice: [DVec3; 8] = std::array::from_fn(|i| frame.to_model(origin + i as f64));
        let [x, y, z] = &brick.crossed;
        points_along::<0>(x, &lattice, frame.cell_size(), &mut offsets, &mut points);
        points_along::<1>(y, &lattice, frame.cell_size(), &mut offsets, &mut points);
        points_along::<2>(z, &lattice, frame.cell_size(), &mut offsets, &mut points);
    }
    points
}

/// Appends the points of a brick's crossings along one axis.
#[inline]
fn points_along<const AXIS: usize>(
    crossed: &Plane,
    lattice: &[DVec3; 8],
    cell_size: f64,
    offsets: &mut impl Iterator<Item = u16>,
    points: &mut Vec<DVec3>,
) {
    for (x, &word) in crossed.0.iter().enumerate() {
        points.extend(Bits(word).zip(&mut *offsets).map(|(b, offset)| {
            let b = b as usize;
            let mut point = [lattice[x].x, lattice[b >> 3 & 7].y, lattice[b & 7].z];
            point[AXIS] += cell_size * position(offset);
            DVec3::from(point)
        }));
    }
}

/// Corners of triangles that most cells have: those of a cycle of up to four edges.
const USUAL: usize = 6;
/// Corners of triangles that a cell may have.
const MOST: usize = 24;

/// The triangles of a case as [places](place_of) of their corners' edges.
#[derive(Clone, Copy)]
struct Places {
    count: u16,
    at: [u16; MOST],
}

static PLACES: LazyLock<[Places; 256]> = LazyLock::new(|| {
    std::array::from_fn(|mask| {
        let edges = CASES[mask].triangles.as_flattened();
        assert!(edges.len() <= MOST, "case {mask}");
        let mut places = Places { count: edges.len() as u16, at: [0; MOST] };
        places.at.iter_mut().zip(edges).for_each(|(at, &edge)| *at = place_of(edge));
        places
    })
});

#[inline(never)]
fn triangles_of(octree: &SignedOctree, numbers: &mut EdgeTable<u32>, range: Range<usize>) -> Vec<u32> {
    let mut corners = Vec::with_capacity(7 * octree.crossings().places(range.clone()).len());
    let mut made = 0;
    let places = &*PLACES;
    for i in range {
        let cells = Cells::new(octree, i);
        numbers.fill(&cells, |crossing| crossing.number);
        // Room for a cell is a slice of known length, and six corners are written without asking how many there are.
        let end = made + MOST * cells.mixed().count() as usize;
        corners.resize(end.max(corners.len()), 0);
        cells.for_mixed(|cell, mask| {
            let Places { count, at } = &places[usize::from(mask)];
            let point = numbers.around(cell);
            let room: &mut [u32; MOST] = (&mut corners[made..made + MOST]).try_into().expect("as many");
            (0..USUAL).for_each(|i| room[i] = point(at[i]));
            (USUAL..usize::from(*count)).for_each(|i| room[i] = point(at[i]));
            made += usize::from(*count);
        });
    }
    corners.truncate(made);
    corners
}
