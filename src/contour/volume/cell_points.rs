//! Vertices in cells: where they are, in sixteen bits.
//!
//! They are placed once, and kept for the whole surface in eight bytes each: whoever cuts polygons looks at them, and areas can be told from
//! nothing exactly. A step of the grid is 1/16384 of a cell, far below what samples say.

use super::lattice::Lattice;
use super::run::in_parallel;
use super::slice::Slice;
use super::tangents::{Planes, Tangents};
use super::window::Window;
use crate::error::Result;
use crate::grid::Edge;
use crate::grid::brick::Bits;
use crate::grid::cases::Mask;
use crate::mesh::chance::Chance;
use crate::progress::Progress;
use crate::volume::Volume;
use glam::{DVec3, I64Vec3, Vec3A};

/// Steps of a cell.
pub(super) const STEPS: i64 = 1 << 14;

/// The vertex of a polygon.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CellPoint {
    /// In steps, from one cell before its own.
    at: [u16; 3],
    /// What it is.
    pub(super) kind: Kind,
}

/// What a vertex in a cell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u16)]
pub(super) enum Kind {
    /// There is none.
    #[default]
    None,
    /// On a smooth piece.
    Smooth,
    /// On a crease or corner.
    Sharp,
}

impl CellPoint {
    /// The vertex nearest to a place in coordinates of its cell.
    pub(super) fn new(place: Vec3A, kind: Kind) -> Self {
        let steps = ((place + 1.0) * STEPS as f32).round();
        // Casts saturate: three cells after the first are the most that can be.
        CellPoint { at: steps.to_array().map(|c| c as u16), kind }
    }

    /// Where it is, in steps from the least corner of its cell.
    #[inline]
    pub(super) fn steps(self) -> I64Vec3 {
        I64Vec3::from(self.at.map(i64::from)) - STEPS
    }

    /// Whether it is in its own cell.
    pub(super) fn is_at_home(self) -> bool {
        let home = STEPS as u16..2 * STEPS as u16;
        self.at.iter().all(|c| home.contains(c))
    }

    /// Moves it by up to eight steps along each axis: half of what keeps it from the sides of its cell.
    pub(super) fn nudge(&mut self, chance: &mut Chance) {
        self.at = self.at.map(|c| c.saturating_add_signed((17.0 * chance.unit()) as i16 - 8));
    }

    /// Where it is on the lattice, if its cell is at `at`.
    #[inline]
    pub(super) fn place(self, at: [usize; 3]) -> DVec3 {
        super::lattice::place(at) + self.steps().as_dvec3() / STEPS as f64
    }
}

/// Bytes held by the vertices of slices.
pub(super) fn bytes(points: &[Vec<CellPoint>]) -> u64 {
    points.iter().map(|points| size_of_val(&points[..]) as u64).sum()
}

/// What a thread reuses from slice to slice.
pub(super) struct Scratch {
    window: Window,
    tangents: Tangents,
    planes: Planes,
}

/// The vertices of all cells: for each slice, those of its mixed cells in order, with as many for each cell as `polygons` has for its mask.
/// `solve` finds the place of one, given its tangent planes, its cell, and whether it is the only one there.
pub(super) fn place_all<V: Volume>(
    lattice: &Lattice<'_, V>,
    slices: &[Slice],
    polygons: impl Fn(Mask) -> &'static [Vec<Edge>] + Sync,
    with_normals: bool,
    solve: impl Fn(&Planes, [usize; 3], bool) -> CellPoint + Sync,
    progress: &dyn Progress,
) -> Result<Vec<Vec<CellPoint>>> {
    let scratch =
        || Scratch { window: Window::new(lattice.size[0]), tangents: Tangents::default(), planes: Planes::default() };
    let to_unit = lattice.unit_normals();
    let place = |Scratch { window, tangents, planes }: &mut Scratch, z: usize| {
        let slice = &slices[z];
        let mut points = Vec::with_capacity(slice.masks().len());
        let Some(next) = slices.get(z + 1).filter(|_| !slice.masks().is_empty()) else { return points };
        tangents.fill(lattice, slices, z, with_normals);
        let mut masks = slice.masks().iter();
        let mut row = None;
        for y in 0..slice.rows() {
            for word in slice.row(y).iter().filter(|word| word.mixed != 0) {
                window.go_to(&mut row, [slice, next], [0, tangents.first()], y);
                for (x, &mask) in Bits(word.mixed).zip(&mut masks) {
                    let x = 64 * word.x as usize + x as usize;
                    let number = window.at(x);
                    let polygons = polygons(mask);
                    let is_alone = polygons.len() == 1;
                    for polygon in polygons {
                        planes.fill(polygon, |edge| tangents.get(number(edge.index() as u8)), &to_unit);
                        points.push(solve(planes, [x, y, z], is_alone));
                    }
                }
            }
        }
        points
    };
    in_parallel(slices.len(), progress, scratch, place)
}
