//! Where the vertex of a sheet goes: onto its crease or corner, wherever that is.
//!
//! # Why vertices leave their cells
//!
//! A crease runs from a cell A into a cell B through their common face F. In F the solid is a wedge, and two lines end
//! in its tip. Mostly they leave F through different sides: there are crossings on both, F has corners of both signs,
//! and the surface has an edge from A's vertex to B's, both on the crease. But where both leave through *the same* side
//! e, that is crossed twice, its ends have the same sign, and so have all corners of F:
//!
//! ```text
//!     +-----------+  F, seen along the crease, and the faces below it;
//!     |    A|B    |  the solid is what is between the lines.
//!     |     .     |
//!     |    / \    |  No corner of F is inside: the surface does not know that it should
//!     +---/-e-\---+  go from A to B. It goes through the cells C and D below
//!     |  / C|D \  |  them, from A to C to D to B.
//!     | /       \ |
//!     o-----------o
//! ```
//!
//! While the vertices of C and D stay there, the crease is cut off by up to half the length of e: a notch. **No dual
//! surface whose vertices stay in their cells can keep it**, for of the four cells only A and B meet the crease, and no
//! edge leads from one to the other. On turned cubes one face in five of those that a crease goes through is cut off,
//! and 19 of 20 points of creases that were farther than 1/20 of a cell from the surface lay there; the others lay at
//! corners, which bulge through faces likewise, and in cells with several sheets. Diagonals that cut across, and cells
//! that know only one of the planes, were not among the causes.
//!
//! But C and D know both planes, by the crossings of their other edges. So their vertices go where the planes meet,
//! beyond e, and the way from A to C to D to B is straight. The same holds for corners, and nothing has to be known of
//! other cells.
//!
//! # When
//!
//! - The sheet is creased, and **all its tangent planes go through the point** ([`SHARP`]): a bent sheet has no such
//!   point, and its vertex stays in its cell, as ever. Only if the cell that has the point has no vertex of its own,
//!   the sheet bulges into it, and may go there in any case.
//! - The point is at most a cell away from the cell, and in the grid.
//! - It is not [behind](is_behind) the only corner that is inside, or outside: three planes meet somewhere in any case, and the vertices of
//!   eight cells round a tip of a few tenths of a cell went past it and each other, the surface inside out.
//! - It does not [pierce](pierces) a thin wall: the groove that the tangent planes of a wall's ragged rim tell of may be deeper than the wall.
//!
//! Vertices that leave are drawn to their mass points a little ([`APART`]), for up to four cells may look for the same
//! point. Along the crease they come in the order of their mass points, which may differ from that of the surface by
//! some hundredths of a cell: there narrow triangles fold over.
//!
//! # Cells with several sheets
//!
//! If the wedge contains two opposite corners of F and its tip is beyond, the solid is in doubt: signs do not tell
//! whether the two are one or two pieces, and the complex of inside elements says two
//! ([`grid::cases`](crate::grid::cases)). The notch between them is real topology, but needs no width: the vertices of
//! all sheets that are creased themselves go to the one point of all planes of the cell, if there is one.
//!
//! # What is left
//!
//! Two creases in one cell with a single sheet have one vertex between them. That takes creases nearer to each other
//! than the diagonal of a cell; all others are kept from end to end, to 0.03 cells (tests/edges.rs).
//!
//! Cost: within a tenth of a percent of a repair, with creases and without; hash probes for vertices that leave,
//! nothing for others.

use super::dual::Placement;
use crate::geom::qef::Qef;
use crate::grid::cases::Mask;
use crate::grid::{Axis, Corner};
use glam::{Vec3A, Vec4};

/// Vertices keep this distance from the sides of their cell, in cells.
const CELL_MARGIN: f32 = 1.0 / 1024.0;

/// How far each of several vertices of a cell, and each that leaves its cell, is drawn to its own mass point. Two sheets can have one
/// minimiser, as both sides of a thin edge do, and files that tell vertices apart by position only, as STL does, would join them:
/// the trailing edge of a wing came back with 33 non-manifold edges.
pub(super) const APART: f32 = 1.0 / 64.0;

/// From this squared length of the mean normal on, the normals of a sheet differ by no more than their codes do (0.6 degrees): its
/// tangent planes are one plane, and the mass point lies on it.
const FLAT: f32 = 0.9999;

/// Below this squared length of the mean normal, a sheet is taken to have a crease: two planes at 30 degrees have cos^2(15) = 0.933.
const CREASED: f32 = 0.933;

/// The tangent planes go through one point if the mean square of its distances from them is less, in squared cells. Codes of normals
/// make it wrong by a hundredth of a cell for each cell of distance.
const SHARP: f32 = 0.025 * 0.025;

/// What is at a point outside of a cell, as far as vertices that would go there are concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Beyond {
    /// The vertex may not go there: it is outside of the grid, behind or through the solid, or vertices stay in their cells.
    Barred,
    /// A cell without a vertex.
    Empty,
    /// A cell that has one.
    Taken,
}

/// Whether a sheet has a crease or corner.
pub(super) fn is_creased(placement: Placement<'_>, sum: &Qef) -> bool {
    placement.needs_normals() && sum.flatness() < CREASED
}

/// The same, given the sum of the normals and their number.
pub(super) fn are_creased(normals: Vec4) -> bool {
    Qef::flatness_of(normals) < CREASED
}

/// Where the vertex of a sheet goes whose planes add up to `sum`, in a cell with the least corner `corner`; `beyond` tells what is at a
/// point outside of it.
#[inline]
pub(super) fn solve(corner: Vec3A, placement: Placement<'_>, sum: &Qef, beyond: &dyn Fn(Vec3A) -> Beyond) -> Vec3A {
    let (low, high) = (corner + CELL_MARGIN, corner + (1.0 - CELL_MARGIN));
    if !placement.needs_normals() || sum.flatness() >= FLAT {
        return sum.mass_point().clamp(low, high);
    }
    let free = sum.minimiser();
    if free.cmpge(low).all() && free.cmple(high).all() { free } else { solve_outside(low, high, sum, free, beyond) }
}

/// The same where the minimiser lies outside of the cell.
#[cold]
fn solve_outside(low: Vec3A, high: Vec3A, sum: &Qef, free: Vec3A, beyond: &dyn Fn(Vec3A) -> Beyond) -> Vec3A {
    if sum.flatness() < CREASED && is_near(low, high, free) {
        let goes = match beyond(free) {
            Beyond::Barred => false,
            Beyond::Empty => true,
            Beyond::Taken => sum.mean_square(free) < SHARP,
        };
        if goes {
            return free.lerp(sum.mass_point(), APART);
        }
    }
    sum.minimiser_within(low, high)
}

/// The point where all planes of a cell meet that are added up in `whole`, if it is a crease or corner, and near enough. `corner` and
/// `beyond` are as for [`solve`].
pub(super) fn common_point(corner: Vec3A, whole: &Qef, beyond: &dyn Fn(Vec3A) -> Beyond) -> Option<Vec3A> {
    let free = whole.minimiser();
    let is_sharp = whole.flatness() < CREASED && whole.mean_square(free) < SHARP;
    (is_sharp && is_near(corner, corner + 1.0, free) && beyond(free) != Beyond::Barred).then_some(free)
}

/// Whether a point is on the other side of the only corner of its sign, in a cell with the least corner `corner`: beyond it along two axes or
/// more.
pub(super) fn is_behind(corner: Vec3A, mask: Mask, p: Vec3A) -> bool {
    let only = match mask.count_ones() {
        1 => Corner::ALL[mask.trailing_zeros() as usize],
        7 => Corner::ALL[mask.trailing_ones() as usize],
        _ => return false,
    };
    let p = p - corner;
    let is_beyond = |a: &Axis| if only.is_high(*a) { p[a.index()] > 1.0 } else { p[a.index()] < 0.0 };
    Axis::ALL.iter().filter(|a| is_beyond(a)).count() >= 2
}

/// Whether a vertex that goes from its cell, with the least corner `corner`, to the cell of `p` comes out on the far side of what is thinner than
/// a cell: if it leaves by corners of one sign, and no corner of that cell further on has it. `is_inside` tells of that cell's corners.
pub(super) fn pierces(corner: Vec3A, mask: Mask, p: Vec3A, is_inside: impl Fn(Corner) -> bool) -> bool {
    let way = (p - corner).floor();
    let is_on_way =
        |c: &Corner| Axis::ALL.iter().all(|&a| way[a.index()] == 0.0 || c.is_high(a) == (way[a.index()] > 0.0));
    let corners = || Corner::ALL.into_iter().filter(is_on_way);
    let leaves_by = |sign: bool| corners().all(|c| (mask >> c.index() & 1 == 1) == sign);
    [false, true].into_iter().any(|sign| leaves_by(sign) && corners().all(|c| is_inside(c) != sign))
}

/// Whether a point is at most a cell away from the box along each axis.
fn is_near(low: Vec3A, high: Vec3A, p: Vec3A) -> bool {
    p.cmpge(low - 1.0).all() && p.cmple(high + 1.0).all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_thinner_than_a_cell_are_not_pierced() {
        let cell = Vec3A::new(4.0, 3.0, 2.0);
        // The wall's points are below the cell, and end at its low x.
        let below = Corner::ALL.into_iter().filter(|c| !c.is_high(Axis::Z)).fold(0, |mask, c| mask | 1u8 << c.index());
        let through = cell + Vec3A::new(-0.03, 0.4, -0.4);
        // The corners of the cell across its rim that are inside: those of the rim, or the deeper ones as well.
        let rim = |c: Corner| c.is_high(Axis::X) && c.is_high(Axis::Z);
        let thick = |c: Corner| c.is_high(Axis::X) || !c.is_high(Axis::Z);
        assert!(pierces(cell, below, through, rim));
        assert!(!pierces(cell, below, through, thick));
        // A gap is as a wall.
        assert!(pierces(cell, !below, through, |c| !rim(c)));
        assert!(!pierces(cell, !below, through, |c| !thick(c)));
        // Sideways it leaves by corners of both signs, and in the cell it leaves by none.
        assert!(!pierces(cell, below, cell + Vec3A::new(-0.4, 0.4, 0.4), rim));
        assert!(!pierces(cell, below, cell + 0.5, |_| true));
    }
}
