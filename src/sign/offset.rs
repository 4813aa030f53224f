//! Surfaces at a distance of another one: the resampling of meshes through a distance field.
//!
//! The field is the distance to the triangles, negative inside, on the lattice points of a [`Band`] about the new surface; inside and outside are
//! those of the octree that was made from the same triangles, by whatever rule, so faces that are turned over, edges, corners and
//! self-intersections do no harm. (Signs by the normal of the closest face or vertex, as resamplers often take them, are wrong there.)
//! New signs are old ones with the band added or taken away, whole words at a time. Crossings lie where a cubic through both ends of the edge,
//! with the distances and slopes that the ways to the closest points tell, has the distance.
//!
//! Solids grow round at convex edges and corners, and shrink with sharp ones, as the distance says. A hole that was closed stays where it is: its
//! surface is none of the triangles.
//!
//! Cost: a [`Band`] of the distance; some 200 ns a crossed edge.

use super::band::{Band, MOST_CELLS, between, seed_bytes};
use super::thicken::{clipped, for_crossed, sample};
use crate::error::{Error, Result, Short};
use crate::geom::Frame;
use crate::grid::brick::Plane;
use crate::grid::{Axis, Key};
use crate::mesh::TriangleSource;
use crate::octree::crossings::{Sample, lattice_point};
use crate::octree::signed::{GIVEN_BYTES, SignedOctree};
use crate::progress::{Beside, Progress, check};
use glam::Vec3;
use rayon::prelude::*;

/// Which surface is made of another one. Distances are in model units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Offset {
    /// Solids grow by this distance, or shrink where it is negative.
    Solid(f64),
    /// What is within this distance of the faces, on either side: a shell, for open surfaces as for closed ones.
    Shell(f64),
}

/// The thinnest shell on each side, in cells: thinner ones would tear.
const LEAST_SHELL: f64 = 1.0;

/// Distances at the ends of an edge differ by its length at most; some more says that one of them is that of another surface.
const MOST_STEP: f64 = 1.5;

impl Offset {
    /// The distance, in model units.
    pub fn distance(self) -> f64 {
        match self {
            Offset::Solid(distance) | Offset::Shell(distance) => distance,
        }
    }

    /// Refuses distances that the grid cannot show.
    ///
    /// # Errors
    /// Says what would do.
    pub fn check(self, frame: &Frame) -> Result<()> {
        let (distance, cell) = (self.distance(), frame.cell_size());
        let cells = distance / cell;
        let refuse = |problem: String, remedy: String| Err(Error::setting("offset", problem, remedy));
        if !distance.is_finite() {
            return refuse(format!("{distance} is no distance"), "give a number of model units".to_owned());
        }
        if cells.abs() > MOST_CELLS - 1.0 {
            let problem = format!("{} units are {:.0} cells, more than {}", Short(distance), cells, MOST_CELLS - 1.0);
            return refuse(
                problem,
                format!("take cells of {} units or more", Short(distance.abs() / (MOST_CELLS - 2.0))),
            );
        }
        if matches!(self, Offset::Shell(_)) && cells < LEAST_SHELL {
            let problem = format!("a shell of {} units on each side is {cells:.2} cells thick there", Short(distance));
            return refuse(
                problem,
                format!("take cells of {} units or less, or more distance", Short(distance.max(0.0))),
            );
        }
        Ok(())
    }
}

/// The surface at a distance of the triangles of a source, of which `octree` was made in the same frame.
///
/// # Errors
/// As [`Offset::check`]; whatever the source returns; `Cancelled`, and `Memory` when `progress` says so.
pub fn offset(
    octree: &SignedOctree,
    source: &mut dyn TriangleSource,
    frame: &Frame,
    offset: Offset,
    with_normals: bool,
    progress: &dyn Progress,
) -> Result<SignedOctree> {
    offset.check(frame)?;
    let distance = offset.distance() / frame.cell_size();
    let beside = Beside { progress, bytes: octree.bytes() as u64 };
    beside.hold(seed_bytes(octree.crossings().bricks().len()) as u64)?;
    let band = Band::around(source, frame, distance.abs(), &beside)?;
    let bricks = octree.crossings().bricks().len() + band.keys().len();
    beside.hold((octree.bytes() + band.bytes() + bricks * GIVEN_BYTES) as u64)?;
    let nothing = SignedOctree::empty(frame.depth());
    let old = if matches!(offset, Offset::Shell(_)) { &nothing } else { octree };
    let moved = Moved { old, band: &band, distance };
    moved.octree(with_normals, progress)
}

/// A surface and the distance to it.
struct Moved<'a> {
    old: &'a SignedOctree,
    band: &'a Band,
    /// In cells.
    distance: f64,
}

impl Moved<'_> {
    fn octree(&self, with_normals: bool, progress: &dyn Progress) -> Result<SignedOctree> {
        let Moved { old, band, distance } = self;
        let (crossings, uniform) = (old.crossings(), old.uniform());
        let mut keys: Vec<Key> = crossings.bricks().iter().map(|brick| brick.key).chain(band.keys()).collect();
        keys.par_sort_unstable();
        keys.dedup();
        let before = |key: Key| match crossings.find(key) {
            Some(i) => old.inside()[i],
            None if uniform.is_inside(key) => Plane::FULL,
            None => Plane::EMPTY,
        };
        let after = |key: Key| {
            let near = band.within(key, distance.abs());
            let plane = if *distance >= 0.0 { before(key) | near } else { before(key) & !near };
            check(progress)?;
            Ok((key, clipped(key, plane)))
        };
        let signs = keys.into_par_iter().map(after).collect::<Result<Vec<(Key, Plane)>>>()?;
        let samples = |place: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
            let (key, inside) = signs[place];
            let origin = lattice_point(band.depth(), key);
            let was_inside = before(key);
            let brick = crossings.find(key).map(|i| &crossings.bricks()[i]);
            for_crossed(crossed, |axis, local| {
                let at: [u32; 3] = std::array::from_fn(|a| origin[a] + local.coords()[a]);
                let brick = brick.filter(|brick| brick.crossed[axis.index()].get(local));
                // The sign of the other end follows from whether there was a crossing.
                let starts = was_inside.get(local);
                let found = self.crossing(at, axis, [starts, starts != brick.is_some()], inside.get(local));
                out.push(match (found, brick) {
                    (Some((t, normal)), _) => sample(t, axis, normal, with_normals),
                    (None, Some(brick)) => crossings.sample_at(brick.place(axis, local)),
                    (None, None) => sample(0.5, axis, Vec3::AXES[axis.index()], with_normals),
                });
            });
        };
        let uniform = |key| uniform.is_inside(key);
        SignedOctree::try_from_signs(band.depth(), with_normals, &signs, uniform, samples, progress)
    }

    /// Where the edge from a lattice point along an axis, whose ends were inside or not, has the distance; `None` where the band does not
    /// tell, or not of the surface that is crossed.
    fn crossing(&self, at: [u32; 3], axis: Axis, was_inside: [bool; 2], starts_inside: bool) -> Option<(f64, Vec3)> {
        let mut end = at;
        end[axis.index()] += 1;
        let of = |at: [u32; 3], was_inside: bool| {
            let way = self.band.way(at)?;
            let sign = if was_inside { -1.0 } else { 1.0 };
            Some((f64::from(sign * way.length()), -sign * way.normalize_or_zero()))
        };
        let ((a, from), (b, to)) = (of(at, was_inside[0])?, of(end, was_inside[1])?);
        if (a - b).abs() > MOST_STEP {
            return None;
        }
        let slopes = [from, to].map(|normal| f64::from(normal[axis.index()]));
        let (mut inner, mut outer) = if starts_inside { (0.0, 1.0) } else { (1.0, 0.0) };
        for _ in 0..20 {
            let middle = 0.5 * (inner + outer);
            let is_inside = between([a, b], slopes, middle) <= self.distance;
            *if is_inside { &mut inner } else { &mut outer } = middle;
        }
        let t = 0.5 * (inner + outer);
        Some((t, from.lerp(to, t as f32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Bounds, Mesh, sample as samples};
    use crate::progress::Silent;
    use crate::sign::{parity_signs, scan};
    use glam::DVec3;

    fn moved(mesh: &mut Mesh, cell: f64, by: Offset) -> Result<(SignedOctree, Frame)> {
        let bounds = mesh.bounds()?;
        let room = by.distance().max(0.0);
        let bounds = Bounds { min: bounds.min - room, max: bounds.max + room };
        let frame = Frame::fit_cells(&bounds, cell, 0.9)?;
        let octree = match by {
            Offset::Solid(_) => parity_signs(scan(mesh, &frame, true, &Silent)?.crossings),
            Offset::Shell(_) => SignedOctree::empty(frame.depth()),
        };
        Ok((offset(&octree, mesh, &frame, by, true, &Silent)?, frame))
    }

    /// Number of crossings, and how far at most one is from where a distance, in model units, is what it should be; in cells.
    fn worst(octree: &SignedOctree, frame: &Frame, distance: impl Fn(DVec3) -> f64, expected: f64) -> (usize, f64) {
        assert_eq!(octree.validate(), Ok(()));
        let crossings = octree.crossings();
        let mut worst = 0.0f64;
        for brick in crossings.bricks().iter() {
            for axis in Axis::ALL {
                for local in brick.crossed[axis.index()].iter() {
                    let origin = crossings.origin(brick);
                    let mut at = DVec3::from(std::array::from_fn(|a| f64::from(origin[a] + local.coords()[a])));
                    at[axis.index()] += crossings.sample_at(brick.place(axis, local)).position();
                    worst = worst.max((distance(frame.to_model(at)) - expected).abs() / frame.cell_size());
                }
            }
        }
        (crossings.len(), worst)
    }

    /// A box of sides 4, 6 and 8.
    fn block() -> Mesh {
        let corner = |i: u32| DVec3::new(f64::from(i & 1) * 4.0, f64::from(i >> 1 & 1) * 6.0, f64::from(i >> 2) * 8.0);
        let faces: [&[u32]; 6] =
            [&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]];
        Mesh { points: (0..8).map(corner).collect(), faces: faces.into_iter().collect() }
    }

    #[test]
    fn boxes_grow_round_and_shrink_sharp() {
        let mut mesh = block();
        let half = DVec3::new(2.0, 3.0, 4.0);
        let distance = |p: DVec3| {
            let beyond = (p - half).abs() - half;
            beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0)
        };
        for by in [1.3, 0.07, 0.0, -0.05, -1.4] {
            let (octree, frame) = moved(&mut mesh, 0.23, Offset::Solid(by)).unwrap();
            let (count, worst) = worst(&octree, &frame, distance, by);
            assert!(count > 500 && worst < 0.15, "{by}: {count} crossings, {worst} cells off");
        }
        assert!(moved(&mut mesh, 0.23, Offset::Solid(-2.5)).unwrap().0.crossings().is_empty());
    }

    #[test]
    fn balls_stay_balls() {
        let mut ball = samples::build("sphere", 3).unwrap();
        let bounds = ball.bounds().unwrap();
        let (centre, radius) = (bounds.center(), 0.5 * bounds.extent().max_element());
        for part in [-0.5, -0.1, 0.03, 0.4] {
            let (octree, frame) = moved(&mut ball, radius / 20.0, Offset::Solid(part * radius)).unwrap();
            let (count, worst) = worst(&octree, &frame, |p| p.distance(centre) - radius, part * radius);
            assert!(count > 500 && worst < 0.12, "{part}: {worst} cells off");
        }
    }

    #[test]
    fn shells_go_round_open_sheets() {
        let points = vec![DVec3::ZERO, 5.0 * DVec3::X, DVec3::new(5.0, 3.0, 0.0), 3.0 * DVec3::Y];
        let mut sheet = Mesh { points, faces: [&[0u32, 1, 2, 3][..]].into_iter().collect() };
        let (octree, frame) = moved(&mut sheet, 0.1, Offset::Shell(0.5)).unwrap();
        let distance = |p: DVec3| p.distance(p.clamp(DVec3::ZERO, DVec3::new(5.0, 3.0, 0.0)));
        let (count, worst) = worst(&octree, &frame, distance, 0.5);
        assert!(count > 3000 && worst < 0.12, "{count} crossings, {worst} cells off");
        assert!(octree.crossings().with_normals());
        let message = |offset: Offset| offset.check(&frame).unwrap_err().to_string();
        assert!(message(Offset::Shell(0.05)).contains("0.50 cells thick there; take cells of 0.05 units or less"));
        assert!(message(Offset::Solid(-7.0)).contains("more than 59; take cells of 0.12069 units or more"));
        assert!(message(Offset::Solid(f64::NAN)).contains("NaN is no distance"));
    }
}
