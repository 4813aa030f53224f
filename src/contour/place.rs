//! Where the vertices of dual surfaces go: the planes of their cells, added up; [`crease`](super::crease) finds the point.

use super::crease::{APART, Beyond, are_creased, common_point, is_behind, is_creased, pierces, solve};
use super::dual::Placement;
use super::layout::{Knot, Layout, Style};
use crate::geom::normal::NormalCode;
use crate::geom::qef::Qef;
use crate::grid::brick::{Local, Plane};
use crate::grid::cases::{CASES, inside_end};
use crate::grid::{Axis, Corner};
use crate::octree::SignedOctree;
use crate::octree::cells::{Cells, Crossing, EdgeTable};
use crate::octree::crossings::{Crossings, position};
use glam::{DVec3, Vec3A, Vec4};

/// The tangent planes at the crossings round the cells of a brick, in cells from its least corner, and what they add up to for
/// each cell.
pub(super) struct Planes {
    /// Point and outward unit normal of each crossing.
    tangents: EdgeTable<(Vec3A, Vec3A)>,
    /// For each cell, and those round the brick, whose sums are never read. Cells without crossings have empty sums.
    sums: Box<[Qef; SUM_SIDE.pow(3)]>,
    /// The same where the points are given, and normals only tell of creases: their sum, and their number.
    normals: Box<[Vec4; SUM_SIDE.pow(3)]>,
    /// Whether these are in use.
    only_normals: bool,
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
    pub(super) fn new() -> Self {
        Planes {
            tangents: EdgeTable::new((Vec3A::ZERO, Vec3A::ZERO)),
            sums: Box::new([Qef::EMPTY; SUM_SIDE.pow(3)]),
            normals: Box::new([Vec4::ZERO; SUM_SIDE.pow(3)]),
            only_normals: false,
        }
    }

    fn sum_at([x, y, z]: [u32; 3]) -> usize {
        (x as usize + 1) * SUM_STEP[0] + (y as usize + 1) * SUM_STEP[1] + z as usize + 1
    }

    /// Calls `place` with the cell and position of each vertex of a brick in order, in cells from the least corner of the brick. Returns
    /// the cells with a crease or corner.
    #[inline]
    pub(super) fn place_brick(
        &mut self,
        layout: &Layout<'_>,
        brick: usize,
        placement: Placement<'_>,
        mut place: impl FnMut(Local, Vec3A),
    ) -> Plane {
        let cells = Cells::new(layout.octree, brick);
        let mixed = layout.mixed(brick);
        self.only_normals = match placement {
            Placement::Given { points, .. } => {
                points.of_brick(cells.brick().key).is_some_and(|points| (mixed & !*points.cells()).is_empty())
            }
            _ => false,
        };
        if placement != Placement::Centre {
            self.fill(&cells, layout.octree.crossings(), placement);
        }
        let given = given(layout.octree, brick, placement);
        let origin = layout.octree.crossings().origin(cells.brick());
        let side = 1 << layout.octree.crossings().depth();
        let beyond = |cell: Local, p: Vec3A| {
            let at = p.floor().to_array().map(|c| c as i32);
            let at: [u32; 3] = std::array::from_fn(|a| origin[a].wrapping_add_signed(at[a]));
            if layout.style != Style::Usual || at.iter().any(|&c| c >= side) {
                return Beyond::Barred;
            }
            let (corner, mask) = (least_corner(cell), cells.mask(cell));
            let is_inside = |c| layout.octree.is_inside(Axis::ALL.map(|a| at[a.index()] + u32::from(c & a)));
            match layout.is_mixed(at) {
                _ if is_behind(corner, mask, p) => Beyond::Barred,
                true if pierces(corner, mask, p, is_inside) => Beyond::Barred,
                true => Beyond::Taken,
                false => Beyond::Empty,
            }
        };
        let mut creased = Plane::EMPTY;
        let mut knots = layout.knots_of(brick).iter().peekable();
        mixed.iter().for_each(|cell| {
            let place = |p| place(cell, p);
            let beyond = |p| beyond(cell, p);
            let is_creased = match knots.next_if(|k| k.cell == cell) {
                None => self.place_ordinary(cell, placement, given(cell), &beyond, place),
                Some(_) if layout.style == Style::Disjoint => self.skip_knot(cell),
                Some(&knot) => self.place_knot(knot, placement, given(cell), &beyond, place),
            };
            if is_creased {
                creased.set(cell);
            }
        });
        creased
    }

    /// Calls `place` with one position for each mixed cell of a brick, however many sheets it has, in cells from the least corner of the
    /// brick.
    pub(super) fn place_cells(
        &mut self,
        octree: &SignedOctree,
        brick: usize,
        placement: Placement<'_>,
        mut place: impl FnMut(Vec3A),
    ) {
        let cells = Cells::new(octree, brick);
        self.only_normals = false;
        self.fill(&cells, octree.crossings(), placement);
        let given = given(octree, brick, placement);
        cells
            .mixed()
            .iter()
            .for_each(|cell| _ = self.place_ordinary(cell, placement, given(cell), &|_| Beyond::Barred, &mut place));
    }

    fn fill(&mut self, cells: &Cells<'_>, crossings: &Crossings, placement: Placement<'_>) {
        let Planes { tangents, sums, normals, only_normals } = self;
        tangents.fill(cells, |Crossing { axis, start, number, starts_inside }| {
            let offset = position(crossings.offsets()[number as usize]) as f32;
            let point = Vec3A::from(start.map(|c| c as f32)) + offset * Vec3A::AXES[axis.index()];
            let normal = match placement {
                Placement::SharpFeatures | Placement::Given { .. } => {
                    NormalCode(crossings.normals()[number as usize]).decode(axis)
                }
                Placement::MassPoint | Placement::Centre => Vec3A::ZERO,
            };
            // Decoded normals point to the high end of the edge.
            let normal = if starts_inside { normal } else { -normal };
            let last = Self::sum_at(start);
            if *only_normals {
                let normal = Vec4::from((normal, 1.0));
                ROUND_EDGE[axis.index()].iter().for_each(|step| normals[last - step] += normal);
            } else {
                let plane = Qef::of_plane(point, normal);
                ROUND_EDGE[axis.index()].iter().for_each(|step| sums[last - step] += &plane);
            }
            (point, normal)
        });
    }

    /// The sum for a cell, which is empty from then on.
    fn take_sum(&mut self, cell: Local) -> Qef {
        std::mem::replace(&mut self.sums[Self::sum_at(cell.coords())], Qef::EMPTY)
    }

    /// The same of the normals.
    fn take_normals(&mut self, cell: Local) -> Vec4 {
        std::mem::replace(&mut self.normals[Self::sum_at(cell.coords())], Vec4::ZERO)
    }

    /// Calls `place` with the vertex of a cell that has one, in cells from the least corner of its brick; `beyond` tells what is at a
    /// point outside of the cell. Returns whether the cell has a crease or corner.
    #[inline]
    fn place_ordinary(
        &mut self,
        cell: Local,
        placement: Placement<'_>,
        given: Option<Vec3A>,
        beyond: &dyn Fn(Vec3A) -> Beyond,
        mut place: impl FnMut(Vec3A),
    ) -> bool {
        if placement == Placement::Centre {
            place(least_corner(cell) + 0.5);
            return false;
        }
        if self.only_normals {
            place(given.expect("all mixed cells of the brick have points"));
            return are_creased(self.take_normals(cell));
        }
        let sum = self.take_sum(cell);
        place(given.unwrap_or_else(|| solve(least_corner(cell), placement, &sum, beyond)));
        is_creased(placement, &sum)
    }

    /// Leaves out a cell with several sheets. Returns that it has no crease.
    fn skip_knot(&mut self, cell: Local) -> bool {
        self.take_sum(cell);
        self.take_normals(cell);
        false
    }

    /// The same for a cell with several sheets or vertices.
    fn place_knot(
        &mut self,
        Knot { cell, mask }: Knot,
        placement: Placement<'_>,
        given: Option<Vec3A>,
        beyond: &dyn Fn(Vec3A) -> Beyond,
        mut place: impl FnMut(Vec3A),
    ) -> bool {
        let whole = self.take_sum(cell);
        self.take_normals(cell);
        let case = &CASES[usize::from(mask)];
        if placement == Placement::Centre {
            for vertex in 0..case.sheets.vertices {
                let own = Corner::ALL.into_iter().filter(|c| case.sheets.vertex[c.index()] == vertex);
                let (n, sum) = own.fold((0.0, Vec3A::ZERO), |(n, sum), c| (n + 1.0, sum + corner_of(c)));
                place(least_corner(cell) + Vec3A::splat(0.5).lerp(sum / n, APART));
            }
            return false;
        }
        let tangent = self.tangents.at(cell);
        let is_free = given.is_none() && placement.needs_normals();
        let tip = if is_free { common_point(least_corner(cell), &whole, beyond) } else { None };
        let mut creased = false;
        for sheet in 0..case.sheets.count {
            let of_sheet = || {
                let sheet_of = |edge| case.sheets.sheet[inside_end(mask, edge).index()];
                case.cycles.iter().flatten().copied().filter(move |&edge| sheet_of(edge) == sheet)
            };
            let mut sum = Qef::EMPTY;
            of_sheet().map(&tangent).for_each(|(p, n)| sum += &Qef::of_plane(p, n));
            let is_creased = is_creased(placement, &sum);
            creased |= is_creased;
            let tip = tip.filter(|_| is_creased);
            let stay = || solve(least_corner(cell), placement, &sum, &|_| Beyond::Barred);
            let common = given.or(tip).unwrap_or_else(stay);
            if case.sheets.is_regular(sheet) {
                let apart = if case.sheets.count > 1 || tip.is_some() { APART } else { 0.0 };
                place(common.lerp(sum.mass_point(), apart));
                continue;
            }
            // Each inside corner has a vertex: near the crossings round it, or between it and the middle of the cell.
            for corner in Corner::ALL.into_iter().filter(|c| case.sheets.sheet[c.index()] == sheet) {
                let around = of_sheet().filter(|&e| inside_end(mask, e) == corner).map(|e| tangent(e).0);
                let (n, sum) = around.fold((0.0, Vec3A::ZERO), |(n, sum), p| (n + 1.0, sum + p));
                let between = least_corner(cell) + 0.25 + 0.5 * corner_of(corner);
                // A corner that has no crossings is no place of the surface: its vertex only has to differ from the others.
                let (own, apart) = if n > 0.0 { (sum / n, 0.75) } else { (between, 0.25) };
                place(common.lerp(own, if tip.is_some() { APART } else { apart }));
            }
        }
        creased
    }
}

/// The given points of the cells of a brick, in cells from its least corner.
fn given(octree: &SignedOctree, brick: usize, placement: Placement<'_>) -> impl Fn(Local) -> Option<Vec3A> {
    let crossings = octree.crossings();
    let brick = &crossings.bricks()[brick];
    let origin = DVec3::from(crossings.origin(brick).map(f64::from));
    let given = match placement {
        Placement::Given { points, frame } => points.of_brick(brick.key).map(|points| (points, frame)),
        _ => None,
    };
    move |cell| {
        let (points, frame) = given?;
        let point = DVec3::from(points.get(cell)?.map(f64::from));
        Some(((point - frame.origin()) / frame.cell_size() - origin).as_vec3a())
    }
}

/// A corner of the unit cell.
fn corner_of(corner: Corner) -> Vec3A {
    Vec3A::from(Axis::ALL.map(|a| f32::from(u8::from(corner & a))))
}

fn least_corner(cell: Local) -> Vec3A {
    Vec3A::from(cell.coords().map(|c| c as f32))
}
