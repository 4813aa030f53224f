//! The patch that fills a ring.

use super::rings::{Ring, Step, area_vector, shortened};
use super::runs::Runs;
use crate::error::Result;
use crate::geom::normal::NormalCode;
use crate::grid::{Axis, Extent, Key};
use crate::octree::crossings::{Crossings, OFFSET_MARGIN, Sample, finest_element};
use glam::DVec3;

/// Lines that pass a lattice point as closely as this, in cells, may pass it on either side: positions of crossings are kept
/// that far from the ends of their edges, and rounded.
const NEAR: f64 = 2.0 * OFFSET_MARGIN as f64 / 65536.0;

/// The patch of one ring, as it grows.
pub(super) struct Patch<'a> {
    /// What was scanned.
    crossings: &'a Crossings,
    /// Normal of the part of the hole at work, any length.
    normal: DVec3,
    switches: Vec<Switch>,
}

/// An edge that a patch crosses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Switch {
    pub(crate) edge: Key,
    /// Where the patch goes through.
    pub(crate) sample: Sample,
}

impl<'a> Patch<'a> {
    /// The edges that the patch of a ring crosses; `note` is told of their number as they come, and may refuse.
    pub(super) fn of(ring: Ring, crossings: &'a Crossings, note: &dyn Fn(usize) -> Result<()>) -> Result<Vec<Switch>> {
        let mut patch = Patch { crossings, normal: DVec3::ZERO, switches: Vec::new() };
        patch.fill(ring, note)?;
        Ok(patch.switches)
    }

    fn fill(&mut self, ring: Ring, note: &dyn Fn(usize) -> Result<()>) -> Result<()> {
        let mut pending = vec![(ring, DVec3::ZERO)];
        while let Some((ring, whole)) = pending.pop() {
            let ring = shortened(ring);
            if let Some(plane) = middle_plane(&ring) {
                // A part of the hole faces where its own ring faces, so a patch over a bent hole bends. The ring of a part that has no
                // area to speak of says nothing: such a part faces where the whole did.
                let own = area_vector(&ring);
                self.normal = if own.length_squared() > 1.0 { own } else { whole };
                let before = self.switches.len();
                pending.extend(self.cut(ring, plane).into_iter().map(|part| (part, self.normal)));
                note(self.switches.len() - before)?;
            }
        }
        Ok(())
    }

    /// Cuts a ring by a plane that it crosses: rings that lie on one side each.
    ///
    /// The crossings of the plane divide the ring into runs. Time and again the run whose ends lie nearest to each other is cut off,
    /// and the runs before and after it become one, until a single one is left. Cost: linear in the ring's length, but for a logarithm.
    fn cut(&mut self, ring: Ring, plane: Plane) -> Vec<Ring> {
        let mut runs = Runs::new(ring, plane);
        let mut sides = Vec::with_capacity(runs.list.len());
        while let Some(i) = runs.nearest() {
            let (before, after) = (runs.list[i].before, runs.list[i].after);
            let mut run: Ring = std::mem::take(&mut runs.list[i].steps).into();
            // The run leaves through the plane at `b`; the rest comes back through it at `a`.
            let (b, a) = (*run.last().expect("runs have steps"), runs.end(before));
            let line = self.line(plane, &b, &a);
            // Both new rings follow the line, each on its side: the run from b to a, the rest from a to b.
            follow(&mut run, plane, b.cell, line.iter().copied());
            sides.push(run);
            let mut back = Ring::new();
            follow(&mut back, plane, a.cell, line.iter().rev().map(|l| Crossing { from: l.to, to: l.from, at: l.at }));
            let rest = &mut runs.list[before].steps;
            rest.pop_back();
            rest.extend(back);
            if before == after {
                sides.push(std::mem::take(rest).into());
                break;
            }
            runs.join(before, after);
        }
        sides
    }

    /// The straight line in the plane from where `b` leaves its cell to where `a` leaves its own: the grid edges that it crosses,
    /// which are switched. Where it passes a lattice point so closely that rounding decides on which side, it keeps to the surface
    /// if there is one, so that the patch of a flat sheet cancels all of it.
    fn line(&mut self, plane: Plane, b: &Step, a: &Step) -> Vec<Crossing> {
        let [u, v] = plane.axis.others().map(Axis::index);
        let (from, to) = ([b.exit[u], b.exit[v]], [a.exit[u], a.exit[v]]);
        let delta = [to[0] - from[0], to[1] - from[1]];
        let mut square = [b.cell[u], b.cell[v]];
        let goal = [a.cell[u], a.cell[v]];
        let mut line = Vec::new();
        while square != goal {
            // Part of the way after which the line leaves the square, for each direction in which it still has to go.
            let leaves = |d: usize| {
                let boundary = f64::from(square[d] + u32::from(goal[d] > square[d]));
                let t = (boundary - from[d]) / delta[d];
                if square[d] == goal[d] {
                    f64::INFINITY
                } else if t.is_finite() {
                    t.clamp(0.0, 1.0)
                } else {
                    0.5
                }
            };
            let t = [leaves(0), leaves(1)];
            // The edge by which the square is left in each direction.
            let edge_in = |d: usize| {
                let mut at = [0; 3];
                at[plane.axis.index()] = plane.at;
                at[[u, v][d]] = square[d] + u32::from(goal[d] > square[d]);
                at[[u, v][1 - d]] = square[1 - d];
                at
            };
            let mut d = usize::from(t[0] > t[1]);
            if square[1 - d] != goal[1 - d] {
                let corner = [0, 1].map(|d| f64::from(square[d] + u32::from(goal[d] > square[d])));
                let beside = delta[0] * (corner[1] - from[1]) - delta[1] * (corner[0] - from[0]);
                let is_crossed =
                    |d: usize| self.crossings.is_crossed(self.edge(edge_in(d), plane.axis.others()[1 - d]));
                if beside.abs() <= NEAR * delta[0].hypot(delta[1]) && !is_crossed(d) && is_crossed(1 - d) {
                    d = 1 - d;
                }
            }
            let (t, other) = (t[d], 1 - d);
            let up = goal[d] > square[d];
            let along = (from[other] + t * delta[other]).clamp(f64::from(square[other]), f64::from(square[other] + 1));
            let edge_at = edge_in(d);
            let mut at = DVec3::from(edge_at.map(f64::from));
            at[[u, v][other]] = along;
            self.switch(edge_at, plane, d, along - f64::from(square[other]));
            let mut next = square;
            next[d] = if up { square[d] + 1 } else { square[d] - 1 };
            line.push(Crossing { from: square, to: next, at });
            square = next;
        }
        line
    }

    fn edge(&self, at: [u32; 3], axis: Axis) -> Key {
        finest_element(self.crossings.depth(), at, Extent::from(axis))
    }

    /// Switches the edge in the plane that a step in direction `d` crosses.
    fn switch(&mut self, at: [u32; 3], plane: Plane, d: usize, position: f64) {
        let axis = plane.axis.others()[1 - d];
        let edge = self.edge(at, axis);
        // Where the line runs askew, it crosses edges in the plane of the hole itself: any slope will do there.
        let mut normal = self.normal;
        let least = 1e-3 * normal.length();
        let w = &mut normal[axis.index()];
        if w.abs() <= least {
            *w = if least > 0.0 { least.copysign(*w) } else { 1.0 };
        }
        let normal = NormalCode::encode(axis, normal.to_array());
        let sample = Sample::new((position * 65536.0) as u16, normal.0);
        self.switches.push(Switch { edge, sample });
    }
}

/// A step of a line in a plane over a grid edge, between two squares of the plane.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    from: [u32; 2],
    to: [u32; 2],
    at: DVec3,
}

/// Closes a run of cells, whose last one lies beside the plane where the line begins, by the cells along the line up to the
/// one before the line's end, where the run began. Cells are on the side of `from`.
fn follow(run: &mut Ring, plane: Plane, from: [u32; 3], line: impl Iterator<Item = Crossing>) {
    let [u, v] = plane.axis.others().map(Axis::index);
    // Without a line the run ends where it began, in the one cell beside the plane.
    run.pop();
    for crossing in line {
        let mut cell = from;
        cell[u] = crossing.from[0];
        cell[v] = crossing.from[1];
        run.push(Step { cell, exit: crossing.at });
    }
}

/// A plane of the grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub(super) axis: Axis,
    /// Its coordinate, in cells.
    pub(super) at: u32,
}

impl Plane {
    pub(super) fn parts(self, a: [u32; 3], b: [u32; 3]) -> bool {
        (a[self.axis.index()] < self.at) != (b[self.axis.index()] < self.at)
    }
}

/// A middle plane of the smallest octree cube around the ring that the ring crosses; `None` for a single cell.
pub(super) fn middle_plane(ring: &[Step]) -> Option<Plane> {
    let first = ring.first()?.cell;
    let mut differ = [0u32; 3];
    for step in ring {
        (0..3).for_each(|a| differ[a] |= step.cell[a] ^ first[a]);
    }
    // The highest bit in which coordinates differ is the size of the cube's halves.
    let axis = Axis::ALL.into_iter().rev().max_by_key(|a| differ[a.index()].checked_ilog2())?;
    let half = differ[axis.index()].checked_ilog2()?;
    Some(Plane { axis, at: (first[axis.index()] >> half | 1) << half })
}
