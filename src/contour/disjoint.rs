//! Dual contouring whose faces never pass through each other.
//!
//! # Idea
//!
//! Cells are *plain*, with one vertex strictly inside for a surface that passes through each face at most once, or *knotty*, all
//! others. Round an edge between four plain cells, the quadrilateral becomes two triangles if these keep to the
//! [envelope](super::envelope) of the edge, and four triangles round the edge's crossing if not. Knotty cells have no vertex: they are cut as
//! by marching cubes, in triangles between the crossings of their edges. Where a plain cell meets a knotty one, the surface goes through
//! the common face along the straight segment between two crossings, and the plain cell adds the triangle from its vertex to it.
//!
//! # Why nothing intersects
//!
//! - *Between cells.* In a face between two plain cells, the surface consists of two segments from the crossings to the point where
//!   the faces' vertices see each other, or keeps to the envelopes beside them; in all other faces it is the segments of marching cubes.
//!   So two cells have the same curve in their common face, and it is enough to look at each cell by itself.
//! - *In a plain cell* every piece lies in a cone from the vertex to one face. Cones to different faces share only sides. In a cone to a face
//!   towards a knotty cell there is one triangle; in one towards a plain cell there are the envelopes of two crossed edges, which share only
//!   the segment between the vertices.
//! - *In a knotty cell* the triangles have corners on its edges. That they never cross, wherever on the edges the crossings are, is
//!   proven case by case in the tests of [`grid::cases`](crate::grid::cases). No triangle but for its sides lies in a face.
//!
//! The surface is closed and manifold, with the topology of all other surfaces: in each cell it is a disc, or what marching cubes has, with the
//! same boundary. Positions are multiples of 2^-17 cells, at least 2^-10 cells inside of what they must be inside of. The proof holds for
//! them as they are computed; a file of 32-bit numbers may move them by more than the distance that is left between two faces.
//!
//! # Cost
//!
//! Positions are kept (6 bytes a cell) until it is known which quadrilaterals are cut (1 byte a crossing), for the size of the mesh must
//! be known before the first point is passed on. Contouring takes about 1.5 times as many instructions as without, in four passes instead
//! of two; some 2 percent of the triangles are there for this alone.

use super::PIECE;
use super::dual::{DualOptions, Faces};
use super::envelope::{Safe, safe_diagonals};
use super::layout::{CellTable, Knot, Layout, Seen, Style};
use super::place::Planes;
use crate::error::Result;
use crate::geom::Frame;
use crate::grid::brick::{Local, Plane};
use crate::grid::cases::{CASES, Mask};
use crate::grid::{Axis, Edge, Key};
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::SignedOctree;
use crate::octree::crossings::position;
use crate::octree::segments::Segments;
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Stage};
use glam::{DVec3, Mat4, Vec3A, Vec4};
use std::ops::Range;

/// What becomes of a crossed edge: some of these bits.
type Cut = u8;
/// Its quadrilateral is cut from vertex 1 to vertex 3; else from 0 to 2.
const TURNED: Cut = 1;
/// Either diagonal will do, so that it may stay whole.
const WHOLE: Cut = 2;
/// Its crossing is a point of the mesh, and each pair of neighbouring plain cells has a triangle with it.
const POINT: Cut = 4;

/// The surface without intersections; see [`dual_contouring`](super::dual_contouring).
pub(super) fn disjoint_contouring(
    octree: &SignedOctree,
    frame: &Frame,
    options: &DualOptions<'_>,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let bricks = octree.crossings().bricks().len();
    progress.begin(Stage::Contour, 4 * bricks as u64);
    let (count, piece) = pieces(bricks, PIECE);
    let mut placed =
        Placed { layout: Layout::new(octree, Style::Disjoint)?, positions: Segments::default(), sharp: Vec::new() };
    let layout = &placed.layout;
    let (positions, sharp) = (&mut placed.positions, &mut placed.sharp);
    in_order(
        count,
        progress,
        Planes::new,
        |planes, n| place(layout, planes, options, piece(n)),
        |(points, creased)| {
            progress.advance(PIECE as u64);
            positions.extend_from_slice(&points);
            sharp.extend(creased);
            Ok(())
        },
    )?;

    let mut cut = Cuts { by_crossing: Segments::default(), points: vec![0], doubled: [0; 2] };
    let triangles = options.triangles;
    in_order(
        count,
        progress,
        || CellTable::new(Vec4::ZERO),
        |table, n| placed.cut(table, triangles, piece(n)),
        |found| {
            progress.advance(PIECE as u64);
            cut.add(&found);
            Ok(())
        },
    )?;
    let surface = Disjoint { placed, cut };
    let sizes = surface.sizes();
    sink.begin(sizes)?;
    in_order(
        count,
        progress,
        || (),
        |(), n| surface.points(frame, piece(n)),
        |points| {
            progress.advance(PIECE as u64);
            sink.points(&points)
        },
    )?;
    in_order(
        count,
        progress,
        || CellTable::new(Numbered::default()),
        |table, n| surface.faces(triangles, table, piece(n)),
        |faces| {
            progress.advance(PIECE as u64);
            faces.pass_on(sink)
        },
    )?;
    Ok(sizes)
}

/// A place in a cell in 65536ths of its sides, each plus a half.
type InCell = [u16; 3];

/// Places keep this distance from the sides of their cell, in 65536ths: 1/1024 of a cell.
const MARGIN: f32 = 64.0;

fn rounded(cell: Local, p: Vec3A) -> InCell {
    let in_cell = (p - Vec3A::from(cell.coords().map(|c| c as f32))) * 65536.0;
    in_cell.clamp(Vec3A::splat(MARGIN), Vec3A::splat(65535.0 - MARGIN)).to_array().map(|c| c as u16)
}

#[inline(never)]
fn place(
    layout: &Layout<'_>,
    planes: &mut Planes,
    options: &DualOptions<'_>,
    range: Range<usize>,
) -> (Vec<InCell>, Vec<Plane>) {
    let mut positions = Vec::with_capacity((layout.first_of(range.end) - layout.first_of(range.start)) as usize);
    let creased =
        range.map(|i| planes.place_brick(layout, i, options.placement, |cell, p| positions.push(rounded(cell, p))));
    let creased = creased.collect();
    (positions, creased)
}

/// The vertices of plain cells.
struct Placed<'a> {
    layout: Layout<'a>,
    positions: Segments<InCell, 13>,
    /// For each brick the cells with sharp features.
    sharp: Vec<Plane>,
}

/// In the fourth coordinate of a cell's vertex: it has a crease, or it is knotty and has no vertex.
const CREASED: f32 = 1.0;
const KNOTTY: f32 = 2.0;

/// What becomes of the edges of some bricks.
#[derive(Default)]
struct CutPiece {
    cuts: Vec<Cut>,
    /// For each brick, its edges with points.
    points: Vec<u32>,
    /// Faces and their corners; twice as many as there are.
    doubled: [u64; 2],
}

impl Placed<'_> {
    #[inline(never)]
    fn cut(&self, table: &mut CellTable<Vec4>, triangles: bool, range: Range<usize>) -> CutPiece {
        let crossings = self.layout.octree.crossings();
        let mut found =
            CutPiece { cuts: Vec::with_capacity(crossings.places(range.clone()).len()), ..CutPiece::default() };
        for i in range {
            self.fill(table, i);
            let mut points = 0;
            for axis in Axis::ALL {
                crossings.bricks()[i].crossed[axis.index()].iter().for_each(|edge| {
                    let (cut, doubled) = cut_of(table, axis, edge);
                    found.cuts.push(cut);
                    points += u32::from(cut & POINT != 0);
                    let (faces, corners) = match cut {
                        POINT => (doubled, 3 * doubled),
                        _ if cut & WHOLE != 0 && !triangles => (2, 8),
                        _ => (4, 12),
                    };
                    found.doubled[0] += u64::from(faces);
                    found.doubled[1] += u64::from(corners);
                });
            }
            for knot in self.layout.knots_of(i) {
                let n = 2 * CASES[usize::from(knot.mask)].triangles.len() as u64;
                found.doubled[0] += n;
                found.doubled[1] += 3 * n;
            }
            found.points.push(points);
        }
        found
    }

    /// The vertices of the cells round the edges of a brick, in cells from its least corner.
    #[inline]
    fn fill(&self, table: &mut CellTable<Vec4>, brick: usize) {
        table.fill(&self.layout, brick, |Seen { brick, cell, at, first, mask }| {
            if mask != 0 {
                return Vec4::splat(KNOTTY);
            }
            let [x, y, z] = self.positions[first as usize].map(|c| f32::from(c) + 0.5);
            let crease = if self.sharp[brick].get(cell) { CREASED } else { 0.0 };
            let [i, j, k] = at.map(|c| c as f32);
            Vec4::new(x, y, z, 0.0) * (1.0 / 65536.0) + Vec4::new(i, j, k, crease)
        });
    }
}

/// What becomes of an edge, and twice the number of its triangles if it has a point. A triangle at a face between a plain and
/// a knotty cell has two edges with points, and is counted half at each.
#[inline]
fn cut_of(table: &CellTable<Vec4>, axis: Axis, edge: Local) -> (Cut, u32) {
    let [a, b, c, d] = table.round(axis, edge);
    let lanes = Mat4::from_cols(a, b, c, d).transpose();
    let flags = lanes.w_axis;
    let knotty = flags.cmpge(Vec4::splat(KNOTTY)).bitmask();
    if knotty != 0 {
        let plain = |i: u32| knotty >> (i & 3) & 1 ^ 1;
        return (POINT, (0..4).map(|i| plain(i) + plain(i + 1)).sum());
    }
    let coordinates = [lanes.x_axis, lanes.y_axis, lanes.z_axis];
    let start = edge.coords();
    let [u, v] = axis.others();
    let [u, v, w] = [u, v, axis].map(|a| coordinates[a.index()] - start[a.index()] as f32);
    let creased = flags.cmpge(Vec4::splat(CREASED)).bitmask();
    // The diagonal joins the vertices of a crease.
    let is_turned = creased & 0b1010 == 0b1010 && creased & 0b0101 != 0b0101;
    let cut = match safe_diagonals(u, v, w) {
        Safe { first: true, second: true } => WHOLE | if is_turned { TURNED } else { 0 },
        Safe { first: true, .. } => 0,
        Safe { second: true, .. } => TURNED,
        _ => POINT,
    };
    (cut, 8)
}

/// What becomes of all edges.
struct Cuts {
    /// For each crossing.
    by_crossing: Segments<Cut, 15>,
    /// For each brick, the points on edges of all bricks before it; and of all bricks.
    points: Vec<u32>,
    /// Faces and their corners; twice as many as there are.
    doubled: [u64; 2],
}

impl Cuts {
    fn add(&mut self, piece: &CutPiece) {
        self.by_crossing.extend_from_slice(&piece.cuts);
        for points in &piece.points {
            let before = self.points[self.points.len() - 1];
            self.points.push(before.checked_add(*points).expect("fewer than 2^32 vertices"));
        }
        (0..2).for_each(|i| self.doubled[i] += piece.doubled[i]);
    }
}

/// A cell with a vertex, or a knotty one.
#[derive(Debug, Clone, Copy, Default)]
struct Numbered {
    vertex: u32,
    is_knotty: bool,
}

/// Everything that is known about the surface.
struct Disjoint<'a> {
    placed: Placed<'a>,
    cut: Cuts,
}

impl Disjoint<'_> {
    fn sizes(&self) -> MeshSizes {
        let on_edges = self.cut.points[self.cut.points.len() - 1];
        let [faces, corners] = self.cut.doubled.map(|n| n / 2);
        MeshSizes { points: self.placed.layout.vertices + u64::from(on_edges), faces, corners }
    }

    /// The number of the first point on an edge of a brick. They follow those in its cells.
    fn first_on_edges(&self, brick: usize) -> u32 {
        let number = self.placed.layout.first_of(brick + 1) + u64::from(self.cut.points[brick]);
        u32::try_from(number).expect("fewer than 2^32 vertices")
    }

    /// The points of some bricks.
    #[inline(never)]
    fn points(&self, frame: &Frame, range: Range<usize>) -> Vec<DVec3> {
        let Layout { octree, .. } = self.placed.layout;
        let crossings = octree.crossings();
        let on_edges = self.cut.points[range.end] - self.cut.points[range.start];
        let in_cells = self.placed.layout.first_of(range.end) - self.placed.layout.first_of(range.start);
        let mut points = Vec::with_capacity(on_edges as usize + in_cells as usize);
        for i in range {
            let brick = &crossings.bricks()[i];
            let origin = DVec3::from(crossings.origin(brick).map(f64::from));
            let mut plain = self.placed.layout.mixed(i);
            self.placed.layout.knots_of(i).iter().for_each(|knot| plain.toggle(knot.cell));
            let [first, end] = [i, i + 1].map(|i| self.placed.layout.first_of(i) as usize);
            points.extend(plain.iter().zip(&*self.placed.positions.slice(first..end)).map(|(cell, p)| {
                let in_cell = DVec3::from(p.map(|c| (f64::from(c) + 0.5) * (1.0 / 65536.0)));
                frame.to_model(origin + DVec3::from(cell.coords().map(f64::from)) + in_cell)
            }));
            let mut place = brick.first as usize;
            for axis in Axis::ALL {
                brick.crossed[axis.index()].iter().for_each(|edge| {
                    if self.cut.by_crossing[place] & POINT != 0 {
                        let along = DVec3::AXES[axis.index()] * position(crossings.offsets()[place]);
                        points.push(frame.to_model(origin + DVec3::from(edge.coords().map(f64::from)) + along));
                    }
                    place += 1;
                });
            }
        }
        points
    }

    #[inline(never)]
    fn faces(&self, triangles: bool, table: &mut CellTable<Numbered>, range: Range<usize>) -> Faces {
        let crossings = self.placed.layout.octree.crossings();
        let places = crossings.places(range.clone());
        let cuts = self.cut.by_crossing.slice(places.clone());
        let mut cuts = cuts.iter();
        let mut faces = Faces::new(triangles, places.len());
        for i in range {
            table.fill(&self.placed.layout, i, |Seen { brick, first, mask, .. }| Numbered {
                vertex: first.wrapping_add(self.cut.points[brick]),
                is_knotty: mask != 0,
            });
            let inside = &self.placed.layout.octree.inside()[i];
            let mut next = self.first_on_edges(i);
            for axis in Axis::ALL {
                crossings.bricks()[i].crossed[axis.index()].iter().for_each(|edge| {
                    let mut cells = table.round(axis, edge);
                    if !inside.get(edge) {
                        cells.swap(1, 3);
                    }
                    let [a, b, c, d] = cells.map(|cell| cell.vertex);
                    let cut = *cuts.next().expect("one for each crossing");
                    match (cut & (POINT | TURNED), cut & WHOLE != 0) {
                        (0, true) => faces.quad([a, b, c, d]),
                        (0, false) => faces.triangles(&[[a, b, c], [a, c, d]]),
                        (TURNED, true) => faces.quad([b, c, d, a]),
                        (TURNED, false) => faces.triangles(&[[b, c, d], [b, d, a]]),
                        _ => {
                            for (k, cell) in cells.iter().enumerate() {
                                let after = cells[(k + 1) % 4];
                                if !cell.is_knotty && !after.is_knotty {
                                    faces.triangles(&[[next, cell.vertex, after.vertex]]);
                                }
                            }
                            next += 1;
                        }
                    }
                });
            }
            let origin = crossings.origin(&crossings.bricks()[i]);
            for &Knot { cell, mask } in self.placed.layout.knots_of(i) {
                let c = cell.coords();
                self.knot(std::array::from_fn(|a| origin[a] + c[a]), mask, &mut faces);
            }
        }
        faces
    }

    /// The triangles in a knotty cell, and those that plain neighbours have at its faces.
    fn knot(&self, at: [u32; 3], mask: Mask, faces: &mut Faces) {
        let case = &CASES[usize::from(mask)];
        let mut points = [0; 12];
        case.cycles.iter().flatten().for_each(|&edge| points[edge.index()] = self.point(at, edge));
        let point = |edge: Edge| points[edge.index()];
        case.triangles.iter().for_each(|triangle| faces.triangles(&[triangle.map(point)]));
        for cycle in &case.cycles {
            for (&from, &to) in cycle.iter().zip(cycle.iter().cycle().skip(1)) {
                let face =
                    from.faces().into_iter().find(|f| to.faces().contains(f)).expect("a step runs through a face");
                let mut beyond = at;
                let a = face.axis().index();
                beyond[a] = if face.is_high() { at[a] + 1 } else { at[a] - 1 };
                let (brick, vertex, mask) = self.placed.layout.find(beyond);
                if mask == 0 {
                    faces.triangles(&[[point(to), point(from), vertex + self.cut.points[brick]]]);
                }
            }
        }
    }

    /// The number of the point on an edge of the cell at `at`. Cost: a hash probe, and a look at the crossings of its brick before it.
    fn point(&self, at: [u32; 3], edge: Edge) -> u32 {
        let crossings = self.placed.layout.octree.crossings();
        let start = edge.corners()[0];
        let at = Axis::ALL.map(|a| at[a.index()] + u32::from(start & a));
        let key = Key::cell(crossings.depth() - 3, at.map(|c| c >> 3)).expect("edges lie in the root cube");
        let i = crossings.find(key).expect("crossed edges belong to listed bricks");
        let brick = &crossings.bricks()[i];
        let place = brick.place(edge.axis(), Local::new(at[0], at[1], at[2]));
        let before =
            self.cut.by_crossing.slice(brick.first as usize..place).iter().filter(|&cut| cut & POINT != 0).count();
        self.first_on_edges(i) + before as u32
    }
}
