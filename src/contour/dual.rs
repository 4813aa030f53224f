//! Dual contouring (Ju, Losasso, Schaefer and Warren 2002) over bricks, manifold for any signs.
//!
//! A mixed cell has one vertex for each sheet of the surface in it; each crossed edge becomes a quadrilateral between the vertices
//! of its four cells. In a few cells ([irregular sheets](crate::grid::cases)) that would glue two places of the surface
//! together. There the surface of the grid of element centres is used as it is: one vertex for each inside corner, and two more kinds
//! of polygons, beside an inside edge (across a face that is not inside) and on an inside face. Those collapse in all other cells.
//!
//! Vertices are numbered brick by brick, in the order of the cells: a cell's number is the brick's first plus the rank of its bit
//! in the plane of mixed cells, plus the extra vertices of knotty cells before it, of which there are few and which are listed.
//!
//! Cost: about 60 ns and 76/80 bytes a mixed cell beyond the octree (a plane and 12 bytes a brick); positions are not kept.

use super::PIECE;
use super::cells::{Cells, Crossing, EdgeTable};
use crate::error::Result;
use crate::geom::Frame;
use crate::geom::normal::NormalCode;
use crate::geom::qef::Qef;
use crate::grid::brick::{Bits, Local, Plane};
use crate::grid::cases::{CASES, Mask, inside_end};
use crate::grid::{Axis, Corner, Edge, Face, Key};
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::SignedOctree;
use crate::octree::crossings::{Brick, Crossings, position, toward};
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Stage};
use glam::{DVec3, Vec3A};
use rayon::prelude::*;
use std::ops::Range;

/// Where the vertices go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Placement {
    /// At the minimum of the quadratic error function, kept inside the cell: sharp edges and corners are kept. Needs normals.
    #[default]
    SharpFeatures,
    /// At the mean of the crossings of the sheet.
    MassPoint,
}

/// How [`dual_contouring`] makes the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DualOptions {
    /// Where the vertices go.
    pub placement: Placement,
    /// Split quadrilaterals into triangles, along creases where there are any.
    pub triangles: bool,
}

/// Passes the surface of the octree to `sink`, as quadrilaterals (and a few triangles) or as triangles; returns its size.
/// Quadrilaterals begin with a corner of the diagonal by which they are best split.
///
/// # Errors
/// Whatever `sink` returns, and `Cancelled`.
///
/// # Panics
/// When sharp features are asked for and the octree has no normals.
pub fn dual_contouring(
    octree: &SignedOctree,
    frame: &Frame,
    options: &DualOptions,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let crossings = octree.crossings();
    assert!(
        options.placement == Placement::MassPoint || crossings.with_normals() || crossings.is_empty(),
        "sharp features need normals"
    );
    let bricks = crossings.bricks().len();
    progress.begin(Stage::Contour, 2 * bricks as u64);
    let layout = Layout::new(octree);
    let polygons = layout.extra_polygons();
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
        || CellTable(Box::new([CellVertices::default(); CELL_SIDE.pow(3)])),
        |table, n| layout.faces(&sharp, &polygons, options.triangles, table, piece(n)),
        |faces| {
            progress.advance(PIECE as u64);
            faces.pass_on(sink)
        },
    )?;
    Ok(sizes)
}

/// A mixed cell whose vertices are not the ordinary single one.
#[derive(Debug, Clone, Copy)]
struct Knot {
    cell: Local,
    mask: Mask,
}

/// Which cells have vertices, and which numbers.
pub(super) struct Layout<'a> {
    octree: &'a SignedOctree,
    bricks: Vec<CellBrick>,
    knots: Vec<Knot>,
    pub(super) vertices: u64,
}

struct CellBrick {
    mixed: Plane,
    /// Number of the first vertex.
    first: u32,
    /// Where the brick's knots begin.
    knots: u32,
}

impl<'a> Layout<'a> {
    pub(super) fn new(octree: &'a SignedOctree) -> Self {
        let found: Vec<(Plane, Vec<Knot>)> = (0..octree.crossings().bricks().len())
            .into_par_iter()
            .map(|i| {
                let cells = Cells::new(octree, i);
                let knotty = cells.knotty();
                let knots = knotty.iter().map(|cell| Knot { cell, mask: cells.mask(cell) });
                (cells.mixed(), knots.filter(|k| k.extra_vertices() > 0).collect())
            })
            .collect();
        let mut layout = Layout { octree, bricks: Vec::with_capacity(found.len()), knots: Vec::new(), vertices: 0 };
        for (mixed, knots) in found {
            let first = u32::try_from(layout.vertices).expect("fewer than 2^32 vertices");
            layout.vertices +=
                u64::from(mixed.count()) + knots.iter().map(|k| u64::from(k.extra_vertices())).sum::<u64>();
            layout.bricks.push(CellBrick { mixed, first, knots: layout.knots.len() as u32 });
            layout.knots.extend(knots);
        }
        layout
    }

    fn knots_of(&self, brick: usize) -> &[Knot] {
        let end = self.bricks.get(brick + 1).map_or(self.knots.len(), |b| b.knots as usize);
        &self.knots[self.bricks[brick].knots as usize..end]
    }

    /// Calls `each` with the mixed cells of a brick that `select` leaves of each word, their first vertices and their masks (0 if
    /// ordinary).
    #[inline]
    fn for_cells(&self, brick: usize, select: impl Fn(usize) -> u64, mut each: impl FnMut(Local, u32, Mask)) {
        let CellBrick { mixed, first, .. } = &self.bricks[brick];
        let mut before = *first;
        let mut knots = self.knots_of(brick).iter().peekable();
        for (x, &word) in mixed.0.iter().enumerate() {
            let selected = select(x);
            let mut counted = 0;
            for b in Bits(word & selected) {
                let cell = Local::from_index(x as u32 * 64 + b);
                while let Some(knot) = knots.next_if(|k| k.cell < cell) {
                    before += knot.extra_vertices();
                }
                // Counting up is cheaper than counting bits, but only all bits can be counted up.
                let below = if selected == !0 { counted } else { (word & ((1 << b) - 1)).count_ones() };
                let mask = knots.peek().filter(|k| k.cell == cell).map_or(0, |k| k.mask);
                each(cell, before + below, mask);
                counted += 1;
            }
            before += if selected == !0 { counted } else { word.count_ones() };
        }
    }

    /// The vertex of the cell at `at` to which its inside corner `corner` belongs.
    pub(super) fn vertex(&self, at: [u32; 3], corner: Corner) -> u32 {
        let crossings = self.octree.crossings();
        let key = Key::cell(crossings.depth() - 3, at.map(|c| c >> 3)).expect("cells lie in the root cube");
        let brick = crossings.find(key).expect("mixed cells belong to listed bricks");
        let cell = Local::new(at[0], at[1], at[2]);
        let extra: u32 = self.knots_of(brick).iter().filter(|k| k.cell < cell).map(|k| k.extra_vertices()).sum();
        let CellBrick { mixed, first, .. } = &self.bricks[brick];
        let slot = self.knots_of(brick).iter().find(|k| k.cell == cell).map_or(0, |k| k.slot(corner));
        first + mixed.rank(cell) + extra + slot
    }

    /// The polygons beside inside edges and on inside faces of irregular cells, each with its brick.
    pub(super) fn extra_polygons(&self) -> Vec<(usize, Vec<u32>)> {
        let mut polygons = Vec::new();
        for (i, brick) in self.octree.crossings().bricks().iter().enumerate() {
            let origin = self.octree.crossings().origin(brick);
            for knot in self.knots_of(i).iter().filter(|k| !CASES[usize::from(k.mask)].sheets.all_regular()) {
                let c = knot.cell.coords();
                let at = std::array::from_fn(|a| origin[a] + c[a]);
                polygons.extend(self.polygons_of_knot(at, knot.mask).into_iter().map(|p| (i, p)));
            }
        }
        polygons
    }

    fn polygons_of_knot(&self, at: [u32; 3], mask: Mask) -> Vec<Vec<u32>> {
        let sheets = &CASES[usize::from(mask)].sheets;
        let irregular = |c: Corner| mask >> c.index() & 1 == 1 && !sheets.is_regular(sheets.sheet[c.index()]);
        let face_is_inside = |face: Face| face.corners().iter().all(|c| mask >> c.index() & 1 == 1);
        let mut polygons = Vec::new();
        for edge in Edge::ALL {
            let [p, q] = edge.corners();
            if !(irregular(p) && irregular(q)) {
                continue;
            }
            for face in edge.faces().into_iter().filter(|&f| !face_is_inside(f)) {
                // The cell across the face sees the two corners on its other side.
                let mut beyond = at;
                let a = face.axis().index();
                beyond[a] = if face.is_high() { at[a] + 1 } else { at[a] - 1 };
                let (p2, q2) = (p ^ face.axis(), q ^ face.axis());
                let (vp, vq) = (self.vertex(beyond, p2), self.vertex(beyond, q2));
                // If it is irregular as well, it finds the same polygon.
                if vp != vq && !face.is_high() {
                    continue;
                }
                let corners = [(at, p), (at, q), (beyond, q2), (beyond, p2)];
                // The solid ends at the edge: outward is into the face.
                let outward = middle(&face.corners().map(|c| point(at, c))) - middle(&[point(at, p), point(at, q)]);
                let mut polygon = self.oriented(&corners, outward);
                polygon.dedup();
                if polygon.first() == polygon.last() {
                    polygon.pop();
                }
                polygons.push(polygon);
            }
        }
        for face in Face::ALL.into_iter().filter(|&f| face_is_inside(f) && irregular(f.corners()[0])) {
            let ring = face.corners();
            let corners = ring.map(|c| (at, c));
            let outward = centre(at) - middle(&ring.map(|c| point(at, c)));
            polygons.push(self.oriented(&corners, outward));
        }
        polygons
    }

    /// The vertices of a polygon, in the order in which its normal points outward. Vertices are taken to lie half way between their
    /// corner and the centre of their cell.
    fn oriented(&self, corners: &[([u32; 3], Corner); 4], outward: DVec3) -> Vec<u32> {
        let p = corners.map(|(at, c)| middle(&[point(at, c), centre(at)]));
        let normal = (p[2] - p[0]).cross(p[3] - p[1]);
        let mut polygon: Vec<u32> = corners.iter().map(|&(at, c)| self.vertex(at, c)).collect();
        if normal.dot(outward) < 0.0 {
            polygon.reverse();
        }
        polygon
    }

    /// The points of the vertices of some bricks, and the planes of their cells with sharp features.
    #[inline(never)]
    fn place_vertices(
        &self,
        frame: &Frame,
        placement: Placement,
        planes: &mut Planes,
        range: Range<usize>,
    ) -> (Vec<DVec3>, Vec<Plane>) {
        let crossings = self.octree.crossings();
        let first = self.bricks[range.start].first;
        let end = self.bricks.get(range.end).map_or(self.vertices, |b| u64::from(b.first));
        let mut points = Vec::with_capacity((end - u64::from(first)) as usize);
        let mut creased = Vec::with_capacity(range.len());
        for i in range {
            let cells = Cells::new(self.octree, i);
            planes.fill(&cells, crossings, placement);
            let origin = DVec3::from(crossings.origin(cells.brick()).map(f64::from));
            let mut of_brick = Plane::EMPTY;
            let mixed = cells.mixed();
            let mut knots = self.knots_of(i).iter().peekable();
            mixed.iter().for_each(|cell| {
                let place = |p: Vec3A| points.push(frame.to_model(origin + p.as_dvec3()));
                let is_creased = match knots.next_if(|k| k.cell == cell) {
                    None => planes.place_ordinary(cell, placement, place),
                    Some(knot) => planes.place_knot(*knot, placement, place),
                };
                if is_creased {
                    of_brick.set(cell);
                }
            });
            creased.push(of_brick);
        }
        (points, creased)
    }

    #[inline(never)]
    fn faces(
        &self,
        sharp: &[Plane],
        extra: &[(usize, Vec<u32>)],
        triangles: bool,
        table: &mut CellTable,
        range: Range<usize>,
    ) -> Faces {
        let quads = self.octree.crossings().places(range.clone()).len();
        let mut faces =
            Faces { triangles, corners: Vec::with_capacity(quads * if triangles { 6 } else { 4 }), others: Vec::new() };
        let from = extra.partition_point(|(brick, _)| *brick < range.start);
        let extra = extra[from..].iter().take_while(|(brick, _)| *brick < range.end);
        for i in range.clone() {
            table.fill(self, sharp, i);
            table.quads(&self.octree.crossings().bricks()[i], &self.octree.inside()[i], &mut faces);
        }
        extra.for_each(|(_, polygon)| faces.polygon(polygon));
        faces
    }
}

impl Knot {
    /// Vertices beyond the first.
    fn extra_vertices(self) -> u32 {
        u32::from(CASES[usize::from(self.mask)].sheets.vertices) - 1
    }

    fn slot(self, corner: Corner) -> u32 {
        slot(self.mask, corner)
    }
}

/// Which of the cell's vertices an inside corner belongs to.
#[inline]
fn slot(mask: Mask, corner: Corner) -> u32 {
    u32::from(CASES[usize::from(mask)].sheets.vertex[corner.index()])
}

fn point(cell: [u32; 3], corner: Corner) -> DVec3 {
    DVec3::from(Axis::ALL.map(|a| f64::from(cell[a.index()] + u32::from(corner & a))))
}

fn centre(cell: [u32; 3]) -> DVec3 {
    DVec3::from(cell.map(|c| f64::from(c) + 0.5))
}

fn middle(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len() as f64
}

/// Vertices keep this distance from the sides of their cell, in cells.
const CELL_MARGIN: f32 = 1.0 / 1024.0;
/// How far each of several vertices of a cell is drawn to its own mass point. Two sheets can have one minimiser, as both sides of
/// a thin edge do, and files that tell vertices apart by position only, as STL does, would join them: the trailing edge
/// of a wing came back with 33 non-manifold edges.
const APART: f32 = 1.0 / 64.0;

/// From this squared length of the mean normal on, the normals of a sheet differ by no more than their codes do (0.6 degrees): its
/// tangent planes are one plane, and the mass point lies on it.
const FLAT: f32 = 0.9999;

/// Below this squared length of the mean normal, a sheet is taken to have a crease: two planes at 30 degrees have cos^2(15) = 0.933.
const CREASED: f32 = 0.933;

/// The tangent planes at the crossings round the cells of a brick, in cells from its least corner, and what they add up to for
/// each cell.
struct Planes {
    /// Point and outward unit normal of each crossing.
    tangents: EdgeTable<(Vec3A, Vec3A)>,
    /// For each cell, and those round the brick, whose sums are never read. Cells without crossings have empty sums.
    sums: Box<[Qef; SUM_SIDE.pow(3)]>,
}

/// Cells a side of the table of sums: a brick and a layer on both sides.
const SUM_SIDE: usize = 10;
/// Entries before that of a cell for one step along each axis.
const SUM_STEP: [usize; 3] = [SUM_SIDE * SUM_SIDE, SUM_SIDE, 1];
/// For each axis, how far the four cells round an edge are before the one that starts where it does.
const ROUND_EDGE: [[usize; 4]; 3] = {
    let [x, y, z] = SUM_STEP;
    [[0, y, z, y + z], [0, x, z, x + z], [0, x, y, x + y]]
};

impl Planes {
    fn new() -> Self {
        Planes { tangents: EdgeTable::new((Vec3A::ZERO, Vec3A::ZERO)), sums: Box::new([Qef::EMPTY; SUM_SIDE.pow(3)]) }
    }

    fn sum_at([x, y, z]: [u32; 3]) -> usize {
        (x as usize + 1) * SUM_STEP[0] + (y as usize + 1) * SUM_STEP[1] + z as usize + 1
    }

    fn fill(&mut self, cells: &Cells<'_>, crossings: &Crossings, placement: Placement) {
        let sums = &mut self.sums;
        self.tangents.fill(cells, |Crossing { axis, start, number, starts_inside }| {
            let offset = position(crossings.offsets()[number as usize]) as f32;
            let point = Vec3A::from(start.map(|c| c as f32)) + offset * Vec3A::AXES[axis.index()];
            let normal = match placement {
                Placement::SharpFeatures => NormalCode(crossings.normals()[number as usize]).decode(axis),
                Placement::MassPoint => Vec3A::ZERO,
            };
            // Decoded normals point to the high end of the edge.
            let normal = if starts_inside { normal } else { -normal };
            let plane = Qef::of_plane(point, normal);
            let last = Self::sum_at(start);
            ROUND_EDGE[axis.index()].iter().for_each(|step| sums[last - step] += &plane);
            (point, normal)
        });
    }

    /// The sum for a cell, which is empty from then on.
    fn take_sum(&mut self, cell: Local) -> Qef {
        std::mem::replace(&mut self.sums[Self::sum_at(cell.coords())], Qef::EMPTY)
    }

    /// Calls `place` with the vertex of a cell that has one, in cells from the least corner of its brick. Returns whether the cell has
    /// a crease or corner.
    #[inline]
    fn place_ordinary(&mut self, cell: Local, placement: Placement, mut place: impl FnMut(Vec3A)) -> bool {
        let sum = self.take_sum(cell);
        place(solve(cell, placement, &sum));
        is_creased(placement, &sum)
    }

    /// The same for a cell with several sheets or vertices.
    fn place_knot(&mut self, Knot { cell, mask }: Knot, placement: Placement, mut place: impl FnMut(Vec3A)) -> bool {
        self.take_sum(cell);
        let case = &CASES[usize::from(mask)];
        let tangent = self.tangents.at(cell);
        let mut creased = false;
        for sheet in 0..case.sheets.count {
            let of_sheet = || {
                let sheet_of = |edge| case.sheets.sheet[inside_end(mask, edge).index()];
                case.cycles.iter().flatten().copied().filter(move |&edge| sheet_of(edge) == sheet)
            };
            let mut sum = Qef::EMPTY;
            of_sheet().map(&tangent).for_each(|(p, n)| sum += &Qef::of_plane(p, n));
            let common = solve(cell, placement, &sum);
            creased |= is_creased(placement, &sum);
            if case.sheets.is_regular(sheet) {
                let apart = if case.sheets.count > 1 { APART } else { 0.0 };
                place(common.lerp(sum.mass_point(), apart));
                continue;
            }
            // Each inside corner has a vertex: near the crossings round it, or between it and the middle of the cell.
            for corner in Corner::ALL.into_iter().filter(|c| case.sheets.sheet[c.index()] == sheet) {
                let around = of_sheet().filter(|&e| inside_end(mask, e) == corner).map(|e| tangent(e).0);
                let (n, sum) = around.fold((0.0, Vec3A::ZERO), |(n, sum), p| (n + 1.0, sum + p));
                let between = least_corner(cell) + 0.25 + 0.5 * point([0; 3], corner).as_vec3a();
                // A corner that has no crossings is no place of the surface: its vertex only has to differ from the others.
                place(if n > 0.0 { (sum / n).lerp(common, 0.25) } else { common.lerp(between, 0.25) });
            }
        }
        creased
    }
}

fn least_corner(cell: Local) -> Vec3A {
    Vec3A::from(cell.coords().map(|c| c as f32))
}

/// Where the vertex of a sheet in a cell goes.
#[inline]
fn solve(cell: Local, placement: Placement, sum: &Qef) -> Vec3A {
    let corner = least_corner(cell);
    let (low, high) = (corner + CELL_MARGIN, corner + (1.0 - CELL_MARGIN));
    match placement {
        Placement::SharpFeatures if sum.flatness() < FLAT => sum.minimiser_within(low, high),
        Placement::SharpFeatures | Placement::MassPoint => sum.mass_point().clamp(low, high),
    }
}

fn is_creased(placement: Placement, sum: &Qef) -> bool {
    placement == Placement::SharpFeatures && sum.flatness() < CREASED
}

/// Cells a side of the table: a brick and the layer before it.
const CELL_SIDE: usize = 9;

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

/// The vertices of the cells of a brick and of those before it in x, y and z. Entries of other cells are stale.
struct CellTable(Box<[CellVertices; CELL_SIDE.pow(3)]>);

impl CellTable {
    fn fill(&mut self, layout: &Layout<'_>, sharp: &[Plane], brick: usize) {
        const LAST_Y: u64 = 0xff << 56;
        const LAST_Z: u64 = 0x8080_8080_8080_8080;
        let crossings = layout.octree.crossings();
        for (steps, bits) in [
            ([0, 0, 0], !0),
            ([-1, 0, 0], !0),
            ([0, -1, 0], LAST_Y),
            ([0, 0, -1], LAST_Z),
            ([-1, -1, 0], LAST_Y),
            ([-1, 0, -1], LAST_Z),
            ([0, -1, -1], LAST_Y & LAST_Z),
        ] {
            let found = if steps == [0; 3] {
                Some(brick)
            } else {
                crossings.bricks()[brick].key.toward(toward(steps)).and_then(|key| crossings.find(key))
            };
            let Some(found) = found else { continue };
            let select = |x: usize| if steps[0] == 0 || x == 7 { bits } else { 0 };
            layout.for_cells(found, select, |cell, first, mask| {
                let c = cell.coords();
                // 1 is the brick's own first cell; a neighbour's last cell comes to stand at 0.
                let [x, y, z] = std::array::from_fn(|a| (c[a] as i32 + 1 + 8 * steps[a]) as usize);
                let crease = if sharp[found].get(cell) { CREASE } else { 0 };
                self.0[(x * CELL_SIDE + y) * CELL_SIDE + z] = CellVertices { first, flags: u32::from(mask) | crease };
            });
        }
    }

    /// One quadrilateral for each crossed edge of the brick.
    fn quads(&self, brick: &Brick, inside: &Plane, faces: &mut Faces) {
        const STEP: [usize; 3] = [CELL_SIDE * CELL_SIDE, CELL_SIDE, 1];
        for axis in Axis::ALL {
            let [u, v] = axis.others();
            let (su, sv) = (STEP[u.index()], STEP[v.index()]);
            // The four cells round the edge, counter-clockwise in (u, v), and the corner of each at the edge's start.
            let round =
                [(su + sv, Corner::MIN | u | v), (sv, Corner::MIN | v), (0, Corner::MIN), (su, Corner::MIN | u)];
            brick.crossed[axis.index()].iter().for_each(|edge| {
                let [x, y, z] = edge.coords().map(|c| c as usize + 1);
                let at = (x * CELL_SIDE + y) * CELL_SIDE + z;
                let starts_inside = inside.get(edge);
                let cells = round.map(|(step, _)| self.0[at - step]);
                let mut quad = cells.map(|cell| cell.first);
                if cells.iter().fold(0, |a, cell| a | cell.flags) != 0 {
                    for (vertex, (cell, (_, start))) in quad.iter_mut().zip(cells.iter().zip(round)) {
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
struct Faces {
    triangles: bool,
    /// Corners of quadrilaterals, or of triangles.
    corners: Vec<u32>,
    /// Polygons that are not quadrilaterals.
    others: Vec<Vec<u32>>,
}

impl Faces {
    #[inline]
    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        if self.triangles {
            self.corners.extend([a, b, c, a, c, d]);
        } else {
            self.corners.extend([a, b, c, d]);
        }
    }

    fn polygon(&mut self, polygon: &[u32]) {
        match *polygon {
            [a, b, c, d] => self.quad([a, b, c, d]),
            [a, b, c] if self.triangles => self.corners.extend([a, b, c]),
            _ => self.others.push(polygon.to_vec()),
        }
    }

    fn pass_on(self, sink: &mut dyn MeshSink) -> Result<()> {
        sink.faces(if self.triangles { 3 } else { 4 }, &self.corners)?;
        self.others.iter().try_for_each(|polygon| sink.faces(polygon.len(), polygon))
    }
}
