//! Dual contouring of a solid whose topology was repaired: closed and manifold whatever the edits, and the same as before away from them.
//!
//! # Idea
//!
//! After edits (see [`EditedOctree`]) signs of points do not say what the solid K is. Look at the grid of element centres, twice as fine:
//! K is closed, so it meets each of its cubes, the octants of cells, in a down-closed set, and the surface crosses each in at most one
//! disc. One vertex for each mixed octant would be a closed manifold, the boundary of a thickened K. Its polygons are the squares dual to
//! the edges of that grid that lead out of K, each round four octants:
//!
//! 1. a point in K, an edge at it that is not: the octants at the point in the four cells round the edge;
//! 2. an edge in K, a face at it that is not: the octants at both ends of the edge, in the two cells beside the face;
//! 3. a face in K, a cell at it that is not: the octants of the cell at the corners of the face.
//!
//! Sheet by sheet, the octants of a cell are then merged into one vertex where that leaves a manifold, see
//! [`subcomplex`](crate::grid::subcomplex). Polygons of the second and third kind collapse to triangles, edges or points on
//! the way. The rule looks at one cell and gives the usual cases where signs decide, so that in cells without an edit the outcome is
//! exactly that of [`dual_contouring`](super::dual_contouring), and the seam needs no care: a polygon none of whose cells is touched is
//! the same before and after.
//!
//! # Triangles
//!
//! Cut along diagonals, polygons stay a manifold if no diagonal is a side or another diagonal. Sides join octants of one cell or of
//! two cells with a common face. A diagonal of the third kind joins octants of a cell whose corners are opposite on a face: it is no
//! side, and no other polygon has both. One of the second kind joins octants of two cells with a common face at different points: it is
//! no side, and no other polygon has both either. One of the first kind joins vertices of two cells that have only an edge in
//! common; of the polygons with both, all lie round this edge, and there are two of them if both its ends are in K but not the edge
//! itself, as beside a cut. They are cut along different diagonals: at the low end through the cells that are low or high on both
//! axes, at the high end through the two others.
//!
//! # How
//!
//! The unedited surface is made as ever and passes through a filter, which leaves out the vertices of touched cells with all their polygons,
//! closes up the numbers, and appends vertices and polygons of touched cells. Edits deep inside or outside, where no brick is listed, are
//! no special case.
//!
//! Touched cells go brick by brick, and no cell asks a map: planes of edits, shifted, say which cells are touched, and planes of elements
//! what they see (`touched`). There are few different views, so that vertices and polygons are worked out once for each (`shapes`). Polygons
//! find their vertices in a table of the cells round a brick (`around`). They are made twice: first to count them and to list the neighbours
//! of each vertex, then to be passed on.
//!
//! Cost: without edits none. With edits, a look at two words for each corner of a face that passes the filter, and 2 bits a vertex of the
//! whole surface; and for each vertex of a touched cell some 0.5 us, half of that for smoothing, in parallel, and some 70 bytes.

mod around;
mod place;
mod polygons;
mod seam;
mod shapes;
#[cfg(test)]
mod tests;
mod touched;

use super::dual::{DualOptions, check_normals, contour, dual_contouring};
use super::layout::{BRICK_BYTES, Layout, Style};
use crate::error::Result;
use crate::geom::Frame;
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::EditedOctree;
use crate::progress::{Progress, Stage};
use polygons::{Patch, Polygons};
use seam::Seam;
use touched::Touched;

/// Bytes for each vertex of a touched cell: its cell, its polygon or its position, and its neighbours. Measured are 60 to 70.
const VERTEX_BYTES: usize = 96;

/// Passes the surface of an edited octree to `sink`; returns its size. It is closed, manifold and oriented outward, with the topology of the
/// solid thickened a little, whatever the edits. Without any it is exactly that of [`dual_contouring`]; with edits, vertices and polygons of
/// cells that no edit touches are the same and come in the same order, and then those of the others.
///
/// Vertices of touched cells are placed smoothly unless blocks are asked for: edits have no normals. There is no counterpart for marching
/// cubes, whose points are crossings of edges: take [`Placement::MassPoint`](super::Placement::MassPoint), which lies next to it. With
/// edits, [`Intersections::Avoid`](super::Intersections::Avoid) is not heeded.
///
/// # Errors
/// Whatever `sink` returns, `Cancelled`, `Memory` when `progress` says so, and when there are more than 2^32 vertices.
///
/// # Panics
/// When the complex is not closed ([`EditedOctree::validate`]), or sharp features are asked for and the octree has no normals.
pub fn dual_contouring_edited(
    octree: &EditedOctree,
    frame: &Frame,
    options: &DualOptions<'_>,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let signed = octree.signed();
    if !octree.is_edited() {
        return dual_contouring(signed, frame, options, sink, progress);
    }
    check_normals(signed.crossings(), options);
    let bricks = signed.crossings().bricks().len();
    progress.begin(Stage::Contour, 2 * bricks as u64);
    let bytes = signed.bytes() + bricks * BRICK_BYTES;
    progress.hold(bytes as u64)?;
    let layout = Layout::new(signed, Style::Usual)?;
    let touched = Touched::new(octree, progress)?;
    progress.hold((bytes + touched.vertices as usize * VERTEX_BYTES) as u64)?;
    let patch = Patch::new(&touched, &layout);
    let mut polygons = Polygons::default();
    patch.polygons(progress, |piece| {
        polygons.append(piece);
        Ok(())
    })?;
    // Of the unedited surface, what the filter leaves.
    let extras = layout.extra_polygons();
    let kept = extras.iter().filter(|(_, polygon)| !polygon.iter().any(|&v| patch.ranks.contains(v)));
    let (extra_triangles, extra_quads): (Vec<usize>, Vec<usize>) =
        kept.map(|(_, polygon)| polygon.len()).partition(|&corners| corners == 3);
    let quads = signed.crossings().len() + extra_quads.len() + polygons.quads.len();
    let quads = quads as u64 - patch.dropped_quads(progress)?;
    let triangles = (extra_triangles.len() + polygons.triangles.len()) as u64;
    let sizes = MeshSizes {
        points: u64::from(patch.kept) + u64::from(touched.vertices),
        faces: if options.triangles { 2 * quads } else { quads } + triangles,
        corners: if options.triangles { 6 } else { 4 } * quads + 3 * triangles,
    };
    let mut seam = Seam::new(sink, signed, frame, (&patch, polygons), sizes, *options);
    contour(&layout, &extras, frame, &DualOptions { triangles: false, ..*options }, &mut seam, progress)?;
    seam.finish(progress)?;
    Ok(sizes)
}
