//! Walls for faces that bound nothing.
//!
//! An open sheet encloses nothing and vanishes. Here it becomes a wall: what is within half of a width of it is added to the solid. The faces
//! are read again, once for their hits and once for the band; those that the surface already follows need no wall, and neither do those inside of it.
//!
//! Which faces vanish is told by hits: a lattice edge outside that a face hits and the surface does not cross is lost. Faces count where they
//! pass through cells that the surface does not, if an edge is lost near by, away from the surface; or if there is no surface about, for
//! some triangles are so small that they hit nothing. So a sheet that stands on a solid gets its wall up to where it does, and the solid's
//! own faces, edges and corners get none. What bounds a solid gets none either, however thin the solid is, and sheets that lie within two
//! cells of a surface are taken for part of it.
//!
//! Cost: that of a scan, and of a [`Band`] of half the width; a hash probe or two for each lattice point near a face in question.

use super::band::{All, Band, MOST_CELLS, Wanted, seed_bytes};
use super::scan_oriented;
use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::geom::frame::DEPTHS;
use crate::geom::normal::NormalCode;
use crate::geom::raster::{FineTriangle, Hits, rasterise};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Key};
use crate::mesh::TriangleSource;
use crate::octree::crossings::{Sample, lattice_point};
use crate::octree::hits::OrientedHits;
use crate::octree::point_set::PointSet;
use crate::octree::signed::{GIVEN_BYTES, SignedOctree, Uniform};
use crate::progress::{Beside, Progress, check};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Which faces get a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Thicken {
    /// Those that would vanish otherwise.
    #[default]
    Sheets,
    /// All: solids grow by half the width, too.
    All,
}

/// The thinnest wall, in cells: thinner ones would tear.
const LEAST_CELLS: f64 = 2.0;

/// The least radius of a ball that rolls round a surface, in cells: a smaller one passes between lattice points.
const LEAST_RADIUS: f64 = 0.3;

/// Edges that faces hit and that the surface does not cross, with both ends outside: a measure of open sheets, which vanish. A plane of area A,
/// in cells, hits 1 to 1.7 A edges.
pub fn vanished(hits: &OrientedHits, octree: &SignedOctree) -> u64 {
    let lost = lost_edges(hits, octree);
    lost.iter().flat_map(|(_, planes)| planes).map(|plane| u64::from(plane.count())).sum()
}

/// The bricks with such edges, sorted, and the edges along x, y, z, each at its start.
fn lost_edges(hits: &OrientedHits, octree: &SignedOctree) -> Vec<(Key, [Plane; 3])> {
    let (edges, uniform) = (hits.edges(), octree.uniform());
    let of_brick = |i: usize| {
        let brick = &edges.bricks()[i];
        let (crossed, inside) = match octree.crossings().find(brick.key) {
            Some(j) => (octree.crossings().bricks()[j].crossed, octree.inside()[j]),
            None if uniform.is_inside(brick.key) => return None,
            None => ([Plane::EMPTY; 3], Plane::EMPTY),
        };
        let lost = [0, 1, 2].map(|a| brick.crossed[a] & !crossed[a] & !inside);
        (lost != [Plane::EMPTY; 3]).then_some((brick.key, lost))
    };
    (0..edges.bricks().len()).into_par_iter().filter_map(of_brick).collect()
}

/// Adds walls of `width` model units, half on each side, to the solids of `octree`, which was made from the same source and frame.
///
/// # Errors
/// When the wall is thinner than two cells or thicker than 120; whatever the source returns; `Cancelled`, and `Memory` when `progress`
/// says so.
pub fn thicken(
    octree: &SignedOctree,
    source: &mut dyn TriangleSource,
    frame: &Frame,
    width: f64,
    what: Thicken,
    progress: &dyn Progress,
) -> Result<SignedOctree> {
    check_width(width, frame)?;
    let radius = 0.5 * width / frame.cell_size();
    let beside = Beside { progress, bytes: octree.bytes() as u64 };
    let band = match what {
        Thicken::All => {
            beside.hold(seed_bytes(octree.crossings().bricks().len()) as u64)?;
            Band::around_wanted(source, frame, radius, &All, &beside)?
        }
        Thicken::Sheets => {
            let lost = Lost::new(octree, source, frame, &beside)?;
            let beside = Beside { progress: &beside, bytes: lost.bytes() as u64 };
            beside.hold(seed_bytes(lost.reaches.bricks()) as u64)?;
            Band::around_wanted(source, frame, radius, &lost, &beside)?
        }
    };
    let bricks = octree.crossings().bricks().len() + band.keys().len();
    beside.hold((octree.bytes() + band.bytes() + bricks * GIVEN_BYTES) as u64)?;
    united(octree, &band, radius, progress)
}

/// Refuses walls that the grid cannot show.
///
/// # Errors
/// Names the depth that would do.
pub fn check_width(width: f64, frame: &Frame) -> Result<()> {
    let cells = width / frame.cell_size();
    if !(width > 0.0 && width.is_finite()) {
        return Err(Error::setting(
            "thicken",
            format!("a wall of {width} units is none"),
            "the width is in model units",
        ));
    }
    if cells < LEAST_CELLS {
        let deeper = f64::from(frame.depth()) + (LEAST_CELLS / cells).log2().ceil();
        let remedy = if deeper <= f64::from(*DEPTHS.end()) {
            format!("take depth {deeper}, or a thicker wall")
        } else {
            "take a thicker wall".to_owned()
        };
        let problem = format!("a wall of {width} units is {cells:.2} cells thick, less than {LEAST_CELLS}");
        return Err(Error::setting("thicken", problem, remedy));
    }
    check_reach("thicken", 0.5 * width, frame)
}

/// Refuses gaps that the grid cannot show.
///
/// # Errors
/// Names the depth that would do.
pub fn check_gap(width: f64, frame: &Frame) -> Result<()> {
    let cells = width / frame.cell_size();
    if cells >= 2.0 * LEAST_RADIUS {
        return check_reach("gap", 0.5 * width, frame);
    }
    let problem = format!("{width} units are {cells:.2} cells: gaps so narrow let nothing through");
    Err(Error::setting("gap", problem, "leave it out, or take a greater depth"))
}

/// Refuses bands that are wider than their numbers can tell.
///
/// # Errors
/// Names the depth that would do.
pub(super) fn check_reach(option: &'static str, reach: f64, frame: &Frame) -> Result<()> {
    let cells = reach / frame.cell_size();
    if cells <= MOST_CELLS {
        return Ok(());
    }
    let shallower = f64::from(frame.depth()) - (cells / MOST_CELLS).log2().ceil();
    let remedy = if shallower >= f64::from(*DEPTHS.start()) {
        format!("take depth {shallower}, or less width")
    } else {
        "take less width".to_owned()
    };
    let problem = format!("{} units are {:.0} cells, more than {}", 2.0 * reach, 2.0 * cells, 2.0 * MOST_CELLS);
    Err(Error::setting(option, problem, remedy))
}

/// The union of solids and a band of `radius` cells.
fn united(octree: &SignedOctree, band: &Band, radius: f64, progress: &dyn Progress) -> Result<SignedOctree> {
    let (crossings, depth) = (octree.crossings(), band.depth());
    let uniform = octree.uniform();
    let mut keys: Vec<Key> = crossings.bricks().iter().map(|b| b.key).chain(band.keys()).collect();
    keys.par_sort_unstable();
    keys.dedup();
    let before = |key: Key| match crossings.find(key) {
        Some(i) => octree.inside()[i],
        None if uniform.is_inside(key) => Plane::FULL,
        None => Plane::EMPTY,
    };
    let after = |key: Key| {
        check(progress)?;
        Ok((key, before(key) | clipped(key, band.within(key, radius))))
    };
    let signs = keys.into_par_iter().map(after).collect::<Result<Vec<(Key, Plane)>>>()?;
    let with_normals = crossings.with_normals();
    let samples = |place: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
        let (key, inside) = &signs[place];
        let origin = lattice_point(depth, *key);
        let old = crossings.find(*key).map(|i| &crossings.bricks()[i]);
        for_crossed(crossed, |axis, local| {
            let at: [u32; 3] = std::array::from_fn(|a| origin[a] + local.coords()[a]);
            let starts_inside = inside.get(local);
            let mut end = at;
            end[axis.index()] += u32::from(!starts_inside);
            let old = old
                .filter(|brick| brick.crossed[axis.index()].get(local))
                .map(|brick| crossings.sample_at(brick.place(axis, local)));
            let is_near = band.way(end).is_some_and(|way| f64::from(way.length()) <= radius);
            let new = (is_near || old.is_none()).then(|| {
                let (t, normal) = band.leaves(at, axis, radius);
                sample(t, axis, normal, with_normals)
            });
            // The one that is farther out.
            out.push(match (old, new) {
                (Some(a), Some(b)) if (a.offset > b.offset) == starts_inside => a,
                (_, Some(b)) => b,
                (a, None) => a.expect("there is one of both"),
            });
        });
    };
    SignedOctree::try_from_signs(depth, with_normals, &signs, |key| uniform.is_inside(key), samples, progress)
}

/// A sample at a part of an edge, with a normal of any length.
pub(super) fn sample(t: f64, axis: Axis, normal: Vec3, with_normals: bool) -> Sample {
    if !with_normals {
        return Sample::new((t * 65536.0) as u16, 0);
    }
    // A surface parallel to an edge would not cross it.
    let mut normal = normal.as_dvec3().to_array();
    let along = &mut normal[axis.index()];
    if along.abs() < 1e-3 {
        *along = 1e-3_f64.copysign(*along);
    }
    Sample::new((t * 65536.0) as u16, NormalCode::encode(axis, normal).0)
}

/// Calls `each` with all crossed edges of a brick in order.
pub(super) fn for_crossed(crossed: &[Plane; 3], mut each: impl FnMut(Axis, Local)) {
    for axis in Axis::ALL {
        crossed[axis.index()].iter().for_each(|local| each(axis, local));
    }
}

/// Without the points on the root's boundary, which are outside whatever is there.
pub(super) fn clipped(key: Key, mut plane: Plane) -> Plane {
    let interior = [Plane::at_minus_x, Plane::at_minus_y, Plane::at_minus_z].map(|up| up(&Plane::FULL, &Plane::EMPTY));
    for (c, interior) in key.min_corner().into_iter().zip(interior) {
        if c == 0 {
            plane &= interior;
        }
    }
    plane
}

/// The faces that an octree's surface does not follow.
struct Lost<'a> {
    octree: &'a SignedOctree,
    uniform: Uniform<'a>,
    /// Cells that hold surface.
    mixed: PointSet,
    /// These and their neighbours.
    about_mixed: PointSet,
    /// Where an edge is near that is lost, away from any surface: cells, or starts of edges.
    reaches: PointSet,
    shift: u32,
}

impl<'a> Lost<'a> {
    fn new(
        octree: &'a SignedOctree,
        source: &mut dyn TriangleSource,
        frame: &Frame,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (crossings, depth) = (octree.crossings(), frame.depth());
        let mixed = crossings.bricks().iter().enumerate().map(|(i, brick)| (brick.key, octree.mixed_cells(i)));
        let mixed = PointSet::new(depth, mixed);
        let about_mixed = mixed.dilated();
        let hits = scan_oriented(source, frame, false, progress)?.hits;
        // At the edges of a solid, a lattice edge may be hit twice in the tip of a wedge. Only what is lost farther out counts, and from there
        // three cells back: to the surface on which a sheet stands.
        let lost = lost_edges(&hits, octree);
        let lost = lost.into_iter().map(|(key, [x, y, z])| (key, (x | y | z) & !about_mixed.plane(key)));
        let reaches = PointSet::new(depth, lost).dilated().dilated().dilated();
        Ok(Lost { octree, uniform: octree.uniform(), mixed, about_mixed, reaches, shift: frame.cell_shift() })
    }

    fn bytes(&self) -> usize {
        [&self.mixed, &self.about_mixed, &self.reaches].into_iter().map(PointSet::bytes).sum()
    }

    fn is_inside(&self, at: [u32; 3]) -> bool {
        let crossings = self.octree.crossings();
        let key = Key::cell(crossings.depth() - 3, at.map(|c| c >> 3));
        key.is_some_and(|key| match crossings.find(key) {
            Some(i) => self.octree.inside()[i].get(Local::new(at[0], at[1], at[2])),
            None => self.uniform.is_inside(key),
        })
    }
}

/// What a triangle's hits say.
struct Witness<'a> {
    lost: &'a Lost<'a>,
    hits: u64,
    is_lost: bool,
}

impl Hits for Witness<'_> {
    fn plane(&mut self, _: Axis, _: [f64; 3]) {}

    fn hit(&mut self, _: Axis, at: [u32; 3], _: u16) {
        self.hits += 1;
        self.is_lost = self.is_lost || self.lost.reaches.contains(at);
    }
}

impl Wanted for Lost<'_> {
    fn triangle(&self, triangle: &FineTriangle) -> bool {
        let mut witness = Witness { lost: self, hits: 0, is_lost: false };
        rasterise(triangle, self.shift, &mut witness);
        // Some are too small for the lattice.
        witness.is_lost || witness.hits == 0
    }

    fn point(&self, at: DVec3) -> bool {
        let cell = at.to_array().map(|c| c as u32);
        if self.reaches.contains(cell) {
            return !self.mixed.contains(cell);
        }
        !self.about_mixed.contains(cell) && !self.is_inside(cell)
    }
}
