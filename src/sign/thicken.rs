//! Walls for faces that bound nothing.
//!
//! An open sheet encloses nothing and vanishes. Here it becomes a wall: what is within half of a width of it is added to the solid. The faces
//! are read a second time; those that the surface already follows need no wall, and neither do those inside of it.
//!
//! Which faces vanish is told by their hits. A triangle of which some lattice edge that it hits is not crossed by the surface, and starts
//! outside, is lost there; so is one that hits none and is far from the surface. Of a lost triangle those points count that lie in cells
//! without surface: a sheet that stands on a solid gets its wall up to where it does, and the solid's own faces get none.
//!
//! Cost: that of a [`Band`] of half the width, and some 0.3 us a brick for the union.

use super::band::{All, Band, MOST_CELLS, Wanted};
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
use crate::octree::signed::{SignedOctree, Uniform};
use crate::progress::Progress;
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
    let edges = hits.edges();
    let uniform = octree.uniform();
    let of_brick = |i: usize| {
        let brick = &edges.bricks()[i];
        let (crossed, inside) = match octree.crossings().find(brick.key) {
            Some(j) => (octree.crossings().bricks()[j].crossed, octree.inside()[j]),
            None if uniform.is_inside(brick.key) => return 0,
            None => ([Plane::EMPTY; 3], Plane::EMPTY),
        };
        (0..3).map(|a| u64::from((brick.crossed[a] & !crossed[a] & !inside).count())).sum()
    };
    (0..edges.bricks().len()).into_par_iter().map(of_brick).sum()
}

/// Adds walls of `width` model units, half on each side, to the solids of `octree`, which was made from the same source and frame.
///
/// # Errors
/// When the wall is thinner than two cells or thicker than 120; whatever the source returns; and `Cancelled`.
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
    let band = match what {
        Thicken::All => Band::around_wanted(source, frame, radius, &All, progress)?,
        Thicken::Sheets => Band::around_wanted(source, frame, radius, &Lost::new(octree, frame), progress)?,
    };
    Ok(united(octree, &band, radius))
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
pub(super) fn united(octree: &SignedOctree, band: &Band, radius: f64) -> SignedOctree {
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
    let signs: Vec<(Key, Plane)> =
        keys.into_par_iter().map(|key| (key, before(key) | clipped(key, band.within(key, radius)))).collect();
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
    SignedOctree::from_signs(depth, with_normals, &signs, |key| uniform.is_inside(key), samples)
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
            plane = plane & interior;
        }
    }
    plane
}

/// The faces that an octree's surface does not follow.
struct Lost<'a> {
    octree: &'a SignedOctree,
    uniform: Uniform<'a>,
    /// For each brick the cells that hold surface.
    mixed: Vec<Plane>,
    shift: u32,
}

impl<'a> Lost<'a> {
    fn new(octree: &'a SignedOctree, frame: &Frame) -> Self {
        let crossings = octree.crossings();
        let bricks = (0..crossings.bricks().len()).into_par_iter();
        let mixed = bricks.map(|i| crossings.mixed_cells(&crossings.bricks()[i])).collect();
        Lost { octree, uniform: octree.uniform(), mixed, shift: frame.cell_shift() }
    }

    /// The brick at a cell or point.
    fn brick(&self, at: [u32; 3]) -> std::result::Result<usize, Option<Key>> {
        let crossings = self.octree.crossings();
        let key = Key::cell(crossings.depth() - 3, at.map(|c| c >> 3));
        key.and_then(|key| crossings.find(key)).ok_or(key)
    }

    fn is_mixed(&self, cell: [u32; 3]) -> bool {
        self.brick(cell).is_ok_and(|i| self.mixed[i].get(Local::new(cell[0], cell[1], cell[2])))
    }

    /// Whether an edge that a face hits is not crossed and starts outside.
    fn loses(&self, axis: Axis, at: [u32; 3]) -> bool {
        let local = Local::new(at[0], at[1], at[2]);
        match self.brick(at) {
            Ok(i) => {
                let brick = &self.octree.crossings().bricks()[i];
                !brick.crossed[axis.index()].get(local) && !self.octree.inside()[i].get(local)
            }
            Err(key) => !key.is_some_and(|key| self.uniform.is_inside(key)),
        }
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

    fn hit(&mut self, axis: Axis, at: [u32; 3], _: u16) {
        self.hits += 1;
        self.is_lost = self.is_lost || self.lost.loses(axis, at);
    }
}

impl Wanted for Lost<'_> {
    fn triangle(&self, triangle: &FineTriangle) -> bool {
        let mut witness = Witness { lost: self, hits: 0, is_lost: false };
        rasterise(triangle, self.shift, &mut witness);
        if witness.hits > 0 {
            return witness.is_lost;
        }
        // Too small for the lattice. If there is no surface about it, it is lost, unless it is inside.
        let centre: [i64; 3] = std::array::from_fn(|a| triangle.iter().map(|p| i64::from(p[a])).sum::<i64>() / 3);
        let cell = centre.map(|c| (c >> self.shift) as u32);
        let mut about =
            (0..27u32).map(|n| std::array::from_fn(|a| (cell[a] + [n / 9, n / 3 % 3, n % 3][a]).saturating_sub(1)));
        !about.any(|cell| self.is_mixed(cell)) && self.loses(Axis::X, cell)
    }

    fn point(&self, at: DVec3) -> bool {
        !self.is_mixed(at.to_array().map(|c| c as u32))
    }
}
