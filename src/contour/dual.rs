//! Dual contouring (Ju, Losasso, Schaefer and Warren 2002) over bricks, manifold for any signs.
//!
//! A mixed cell has one vertex for each sheet of the surface in it; each crossed edge becomes a quadrilateral between the vertices
//! of its four cells. In a few cells ([irregular sheets](crate::grid::cases)) that would glue two places of the surface
//! together. There the surface of the grid of element centres is used as it is: one vertex for each inside corner, and two more kinds
//! of polygons, beside an inside edge (across a face that is not inside) and on an inside face. Those collapse in all other cells.
//!
//! The work is in four places: `layout` numbers the vertices, `place` says where they go, `knots` has the polygons of irregular sheets,
//! and here the crossed edges become quadrilaterals. `disjoint` does without intersections.
//!
//! Cost: about 60 ns and 76/80 bytes a mixed cell beyond the octree (a plane and 12 bytes a brick); positions are not kept.

use super::PIECE;
use super::disjoint::disjoint_contouring;
use super::layout::{BRICK_BYTES, CellTable, Layout, Seen, Style, slot, starts};
use super::place::Planes;
use crate::error::Result;
use crate::geom::Frame;
use crate::grid::Axis;
use crate::grid::brick::Plane;
use crate::grid::cases::Mask;
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::crossings::Brick;
use crate::octree::{Crossings, SignedOctree, StoredPoints};
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Stage};
use glam::DVec3;
use std::ops::Range;

/// Where the vertices go.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Placement<'a> {
    /// At the minimum of the quadratic error function, so that sharp edges and corners are kept. It lies inside the cell, but for creases and
    /// corners that bulge into the next one: there all tangent planes meet. Needs normals.
    #[default]
    SharpFeatures,
    /// At the mean of the crossings of the sheet.
    MassPoint,
    /// In the middle of the cell, so that the solid is made of blocks: the lattice points inside, each with a cube of one cell round
    /// it. Where blocks touch only along an edge or in a corner, each keeps 1/64 of a cell to itself, so that the surface does not meet
    /// itself there.
    Centre,
    /// At points that are known already, as those of SOG files; cells without one are placed by [`SharpFeatures`](Self::SharpFeatures).
    /// Several vertices of a cell keep a little apart from its point. Needs normals, to tell where creases are.
    Given {
        /// The points of the mixed cells of the octree.
        points: &'a StoredPoints,
        /// Where the grid lies in their space.
        frame: &'a Frame,
    },
}

impl Placement<'_> {
    /// Whether it looks at the normals of crossings.
    pub fn needs_normals(&self) -> bool {
        matches!(self, Placement::SharpFeatures | Placement::Given { .. })
    }
}

/// Whether faces may pass through each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Intersections {
    /// They may: here and there they do, mostly at creases and in walls thinner than a cell.
    #[default]
    Allow,
    /// They do not. Quadrilaterals that could are cut in four, the few cells with several sheets are cut as by marching cubes, and all
    /// vertices stay in their cells, so that askew creases have notches.
    Avoid,
}

/// How [`dual_contouring`] makes the surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DualOptions<'a> {
    /// Where the vertices go.
    pub placement: Placement<'a>,
    /// Split quadrilaterals into triangles, along creases where there are any.
    pub triangles: bool,
    /// Whether faces may pass through each other. [`Placement::Centre`] has no such faces in any case.
    pub intersections: Intersections,
}

/// Passes the surface of the octree to `sink`, as quadrilaterals (and a few triangles) or as triangles; returns its size.
/// Quadrilaterals begin with a corner of the diagonal by which they are best split.
///
/// # Errors
/// Whatever `sink` returns, `Cancelled`, `Memory` when `progress` says so, and when there are more than 2^32 vertices.
///
/// # Panics
/// When sharp features are asked for and the octree has no normals.
pub fn dual_contouring(
    octree: &SignedOctree,
    frame: &Frame,
    options: &DualOptions<'_>,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    check_normals(octree.crossings(), options);
    if options.intersections == Intersections::Avoid && options.placement != Placement::Centre {
        return disjoint_contouring(octree, frame, options, sink, progress);
    }
    progress.begin(Stage::Contour, 2 * octree.crossings().bricks().len() as u64);
    progress.hold((octree.bytes() + octree.crossings().bricks().len() * BRICK_BYTES) as u64)?;
    let layout = Layout::new(octree, Style::Usual)?;
    let polygons = layout.extra_polygons();
    contour(&layout, &polygons, frame, options, sink, progress)
}

/// # Panics
/// When sharp features are asked for and there are no normals.
pub(super) fn check_normals(crossings: &Crossings, options: &DualOptions<'_>) {
    let has_normals = crossings.with_normals() || crossings.is_empty();
    assert!(!options.placement.needs_normals() || has_normals, "sharp features need normals");
}

/// [`dual_contouring`] with a layout and its [extra polygons](Layout::extra_polygons) at hand, once the stage has begun, and whatever
/// `options` says about intersections.
pub(super) fn contour(
    layout: &Layout<'_>,
    polygons: &[(usize, Vec<u32>)],
    frame: &Frame,
    options: &DualOptions<'_>,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let crossings = layout.octree.crossings();
    let bricks = crossings.bricks().len();
    let (quads, extra_corners) = (crossings.len() as u64, polygons.iter().map(|p| p.1.len() as u64).sum::<u64>());
    let sizes = if options.triangles {
        let triangles = 2 * quads + extra_corners - 2 * polygons.len() as u64;
        MeshSizes { points: layout.vertices, faces: triangles, corners: 3 * triangles }
    } else {
        MeshSizes { points: layout.vertices, faces: quads + polygons.len() as u64, corners: 4 * quads + extra_corners }
    };
    sink.begin(sizes)?;
    let mut sharp: Vec<Plane> = Vec::with_capacity(bricks);
    let (count, piece) = pieces(bricks, PIECE);
    in_order(
        count,
        progress,
        Planes::new,
        |planes, n| layout.place_vertices(frame, options.placement, planes, piece(n)),
        |(points, creased)| {
            progress.advance(PIECE as u64);
            sharp.extend(creased);
            sink.points(&points)
        },
    )?;
    in_order(
        count,
        progress,
        || CellTable::new(CellVertices::default()),
        |table, n| layout.faces(&sharp, polygons, options.triangles, table, piece(n)),
        |faces| {
            progress.advance(PIECE as u64);
            faces.pass_on(sink)
        },
    )?;
    Ok(sizes)
}

impl Layout<'_> {
    /// The points of the vertices of some bricks, and the planes of their cells with sharp features.
    #[inline(never)]
    fn place_vertices(
        &self,
        frame: &Frame,
        placement: Placement<'_>,
        planes: &mut Planes,
        range: Range<usize>,
    ) -> (Vec<DVec3>, Vec<Plane>) {
        let crossings = self.octree.crossings();
        let mut points = Vec::with_capacity((self.first_of(range.end) - self.first_of(range.start)) as usize);
        let creased = range.map(|i| {
            let origin = DVec3::from(crossings.origin(&crossings.bricks()[i]).map(f64::from));
            planes.place_brick(self, i, placement, |_, p| points.push(frame.to_model(origin + p.as_dvec3())))
        });
        let creased = creased.collect();
        (points, creased)
    }

    #[inline(never)]
    fn faces(
        &self,
        sharp: &[Plane],
        extra: &[(usize, Vec<u32>)],
        triangles: bool,
        table: &mut CellTable<CellVertices>,
        range: Range<usize>,
    ) -> Faces {
        let quads = self.octree.crossings().places(range.clone()).len();
        let mut faces = Faces::new(triangles, quads);
        let from = extra.partition_point(|(brick, _)| *brick < range.start);
        let extra = extra[from..].iter().take_while(|(brick, _)| *brick < range.end);
        for i in range.clone() {
            table.fill_in(self, sharp, i);
            table.quads(&self.octree.crossings().bricks()[i], &self.octree.inside()[i], &mut faces);
        }
        extra.for_each(|(_, polygon)| faces.polygon(polygon));
        faces
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct CellVertices {
    first: u32,
    /// The mask (0 for a cell with a single vertex), and [`CREASE`].
    flags: u32,
}

/// The flag of a cell with a crease.
const CREASE: u32 = 1 << 8;

impl CellVertices {
    fn mask(self) -> Mask {
        self.flags as Mask
    }

    fn is_creased(self) -> bool {
        self.flags & CREASE != 0
    }
}

impl CellTable<CellVertices> {
    /// The vertices of the cells round the edges of a brick.
    #[inline]
    fn fill_in(&mut self, layout: &Layout<'_>, sharp: &[Plane], brick: usize) {
        self.fill(layout, brick, |Seen { brick, cell, first, mask, .. }| {
            let crease = if sharp[brick].get(cell) { CREASE } else { 0 };
            CellVertices { first, flags: u32::from(mask) | crease }
        });
    }

    /// One quadrilateral for each crossed edge of the brick.
    fn quads(&self, brick: &Brick, inside: &Plane, faces: &mut Faces) {
        for axis in Axis::ALL {
            let starts = starts(axis);
            brick.crossed[axis.index()].iter().for_each(|edge| {
                let starts_inside = inside.get(edge);
                let cells = self.round(axis, edge);
                let mut quad = cells.map(|cell| cell.first);
                if cells.iter().fold(0, |a, cell| a | cell.flags) != 0 {
                    for (vertex, (cell, start)) in quad.iter_mut().zip(cells.iter().zip(starts)) {
                        if cell.mask() != 0 {
                            *vertex += slot(cell.mask(), if starts_inside { start } else { start | axis });
                        }
                    }
                    // The diagonal joins the vertices of a crease.
                    let creased = cells.map(CellVertices::is_creased);
                    if creased[1] && creased[3] && !(creased[0] && creased[2]) {
                        quad.rotate_left(1);
                    }
                }
                if !starts_inside {
                    quad.swap(1, 3);
                }
                faces.quad(quad);
            });
        }
    }
}

/// Faces of some bricks.
pub(super) struct Faces {
    triangles: bool,
    /// Corners of quadrilaterals, or of triangles.
    corners: Vec<u32>,
    /// Corners of triangles among quadrilaterals.
    pieces: Vec<u32>,
    /// Polygons that are neither.
    others: Vec<Vec<u32>>,
}

impl Faces {
    /// No faces yet, with room for so many quadrilaterals.
    pub(super) fn new(triangles: bool, quads: usize) -> Self {
        let corners = Vec::with_capacity(quads * if triangles { 6 } else { 4 });
        Faces { triangles, corners, pieces: Vec::new(), others: Vec::new() }
    }

    #[inline]
    pub(super) fn triangles(&mut self, triangles: &[[u32; 3]]) {
        let corners = if self.triangles { &mut self.corners } else { &mut self.pieces };
        corners.extend_from_slice(triangles.as_flattened());
    }

    #[inline]
    pub(super) fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        if self.triangles {
            self.corners.extend([a, b, c, a, c, d]);
        } else {
            self.corners.extend([a, b, c, d]);
        }
    }

    fn polygon(&mut self, polygon: &[u32]) {
        match *polygon {
            [a, b, c, d] => self.quad([a, b, c, d]),
            [a, b, c] => self.triangles(&[[a, b, c]]),
            _ => self.others.push(polygon.to_vec()),
        }
    }

    pub(super) fn pass_on(self, sink: &mut dyn MeshSink) -> Result<()> {
        sink.faces(if self.triangles { 3 } else { 4 }, &self.corners)?;
        sink.faces(3, &self.pieces)?;
        self.others.iter().try_for_each(|polygon| sink.faces(polygon.len(), polygon))
    }
}
