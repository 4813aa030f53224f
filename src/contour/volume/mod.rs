//! Volumes to surfaces.
//!
//! Extraction has three parts that know little of each other. The **volume** knows the field and where the surface cuts an edge
//! ([`volume`](crate::volume)). The **walker** knows in which order samples are looked at: it makes, slice by slice, words of 64 bits that
//! say which edges are crossed and which cells are mixed. The **extractor** makes points and faces of these words, and asks the volume
//! for places. So any extractor runs with any walker, over any volume.
//!
//! | part | done by |
//! |---|---|
//! | `sweep` | the walker: every sample once, as rows of bits, in slabs on all threads |
//! | `bricks` | another walker, over the bricks of an octree, which it takes as a volume |
//! | `slice` | their product: words of crossed edges and mixed cells, only where there is surface |
//! | `lattice` | the volume with a border round it and a place in the model |
//! | `run` | numbers points and faces slice by slice and passes them on in order |
//! | `window` | the numbers of the points round a row of cells, kept in the first cache |
//! | `cubes` | marching cubes |
//! | `trilinear` | marching cubes with the topology of the trilinear interpolant |
//! | `polygons` | the cases as polygons, of which dual surfaces have vertices |
//! | `tangents`, `cell_points` | tangent planes, and where vertices in cells go |
//! | `rows`, `dual` | dual contouring and surface nets |
//! | `feature`, `extended` | extended marching cubes |
//!
//! # What holds
//!
//! - Samples equal to the level are outside, and so are those that are not a number ([`Level`]). Every point
//!   keeps a thousandth of an edge from the samples. So there are no faces without area, and no two points at one place.
//! - The surface is closed where it leaves the volume: half a step beyond the last samples, so that each sample is the middle of a box and
//!   the volume as large as all boxes. On request ([`Border::Open`]) it ends at the last samples.
//! - Memory is that of the signs of two slices for each thread, and a few bytes for each face while it is made.
//! - The same volume gives the same bytes on any number of threads.

mod bricks;
mod cell_points;
mod cubes;
mod dual;
mod extended;
mod feature;
mod lattice;
mod polygons;
mod rows;
mod run;
mod slice;
mod sweep;
mod tangents;
#[cfg(test)]
mod tests;
mod trilinear;
mod window;

use crate::error::{Error, Result, Short};
use crate::geom::Frame;
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::SignedOctree;
use crate::progress::Progress;
use crate::volume::{Label, Level, Placement, Volume};
use bricks::Bricks;
use lattice::Lattice;
use slice::Slice;

/// How the surface is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Method {
    /// Marching cubes: one point on each crossed edge, inside samples joined along edges only. Closed and manifold for all signs.
    #[default]
    MarchingCubes,
    /// Marching cubes with the topology of the trilinear interpolant of the samples ("Marching cubes 33"): where signs alone leave open what
    /// is joined, their values decide. Closed and manifold for all values.
    Trilinear,
    /// Dual contouring: one point for each sheet of the surface in a cell, where its tangent planes meet, so that sharp edges and corners are
    /// kept. Closed and manifold for all signs.
    DualContouring,
    /// Surface nets: as dual contouring, with points in the middle of the crossings.
    SurfaceNets,
    /// Extended marching cubes: marching cubes, with a point more where there is a sharp edge or corner
    /// ([`feature_angle`](ExtractOptions::feature_angle)). Without such, it is marching cubes. Closed and manifold for all signs.
    ExtendedMarchingCubes,
}

impl Method {
    /// All methods.
    pub const ALL: [Method; 5] = [
        Method::MarchingCubes,
        Method::Trilinear,
        Method::DualContouring,
        Method::SurfaceNets,
        Method::ExtendedMarchingCubes,
    ];
}

/// What happens where the surface leaves the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Border {
    /// It is closed half a step beyond the last samples: all beyond the volume counts as outside.
    #[default]
    Closed,
    /// It ends at the last samples, with a rim. Dual surfaces end half a cell before, and may have points there that no face uses.
    Open,
}

/// What [`extract`] makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtractOptions {
    /// Where the surface lies, and on which side the solid is.
    pub level: Level,
    /// How it is made.
    pub method: Method,
    /// What happens where it leaves the volume.
    pub border: Border,
    /// Extended marching cubes: normals in a cell that differ by more than this angle, in degrees, are those of a feature. Above 0, below 90.
    pub feature_angle: f64,
    /// Where the lattice lies in the model. Faces are counter-clockwise seen from outside there, even if it is mirrored.
    pub placement: Placement,
}

impl Default for ExtractOptions {
    /// Marching cubes above 0, closed at the border, on the lattice's own coordinates; features from 30 degrees on.
    fn default() -> Self {
        ExtractOptions {
            level: Level::above(0.0),
            method: Method::default(),
            border: Border::default(),
            feature_angle: 30.0,
            placement: Placement::default(),
        }
    }
}

impl ExtractOptions {
    fn check(&self) -> Result<()> {
        if self.level.iso.is_nan() {
            return Err(Error::setting(
                "iso",
                "the level is not a number",
                "give a number between those of the volume",
            ));
        }
        if !(self.feature_angle > 0.0 && self.feature_angle < 90.0) {
            let problem = format!("{} is not above 0 and below 90", Short(self.feature_angle));
            return Err(Error::setting("feature-angle", problem, "30 is the default"));
        }
        self.placement.check()
    }
}

/// Passes the surface of a volume to `sink` as triangles; returns its size. Without any sample inside, that is an empty mesh.
///
/// ```
/// use zmend::Mesh;
/// use zmend::contour::volume::{ExtractOptions, extract};
/// use zmend::progress::Silent;
/// use zmend::volume::{Level, Samples};
///
/// let ball = Samples::new([20; 3], |at| at.iter().map(|&c| (c as f64 - 9.5).powi(2)).sum::<f64>().sqrt());
/// let mut mesh = Mesh::default();
/// extract(&ball, &ExtractOptions { level: Level::below(8.0), ..ExtractOptions::default() }, &mut mesh, &Silent)?;
/// let report = mesh.report();
/// assert!(report.is_closed() && report.is_manifold());
/// assert!((report.volume / (4.0 / 3.0 * std::f64::consts::PI * 512.0) - 1.0).abs() < 0.02);
/// # Ok::<(), zmend::Error>(())
/// ```
///
/// # Errors
/// When the level is not a number, the feature angle out of range or the placement flat, when there would be 2^32 points or more, whatever `sink` returns,
/// `Cancelled`, and `Memory` when `progress` says so.
pub fn extract<V: Volume>(
    volume: &V,
    options: &ExtractOptions,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    options.check()?;
    let lattice = Lattice::new(volume, options.level, options.placement, options.border == Border::Closed);
    let slices = run::walk(&lattice, progress)?;
    contour(&lattice, &slices, options, sink, progress)
}

/// The surface in slices, by the method asked for.
fn contour<V: Volume>(
    lattice: &Lattice<'_, V>,
    slices: &[Slice],
    options: &ExtractOptions,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    match options.method {
        Method::MarchingCubes => run::pass_on(&cubes::Cubes::new(lattice, slices), slices, sink, progress),
        Method::Trilinear => run::pass_on(&trilinear::Trilinear::new(lattice, slices), slices, sink, progress),
        Method::DualContouring | Method::SurfaceNets => {
            let dual = dual::Dual::new(lattice, slices, options.method == Method::DualContouring, progress)?;
            run::pass_on(&dual, slices, sink, progress)
        }
        Method::ExtendedMarchingCubes => {
            let extended = extended::Extended::new(lattice, slices, options.feature_angle, progress)?;
            run::pass_on(&extended, slices, sink, progress)
        }
    }
}

/// Passes the surface of one material to `sink`, of a volume whose samples are numbers of materials: by surface nets, whatever level and
/// method `options` say.
///
/// The surfaces of all materials fit together: where two of them touch, both have the same triangles, turned to either side, also along the lines
/// where three or more meet. Only where a material touches itself along an edge or in a point, its surface keeps a 64th of a cell apart, so that
/// it is a manifold.
///
/// # Errors
/// As [`extract`].
pub fn extract_label<V: Volume>(
    labels: &V,
    label: f64,
    options: &ExtractOptions,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let options = ExtractOptions { level: Label::<&V>::LEVEL, method: Method::SurfaceNets, ..*options };
    extract(&Label::new(labels, label), &options, sink, progress)
}

/// Passes the surface of an octree to `sink`, by any of the methods for volumes: samples are 1 inside and -1 outside, points are its crossings, and
/// normals those of the crossings, if it has any. Only its bricks are looked at.
///
/// Level, border and placement of `options` do not matter: the octree has its signs, all of its border is outside, and `frame` says where it lies.
/// For the surfaces of repairs see [`marching_cubes`](super::marching_cubes) and [`dual_contouring`](super::dual_contouring), which know more
/// of octrees.
///
/// # Errors
/// As [`extract`].
pub fn extract_octree(
    octree: &SignedOctree,
    frame: &Frame,
    options: &ExtractOptions,
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let bricks = Bricks::new(octree);
    let (level, placement) = (Level::above(0.0), Bricks::placement(frame));
    let options = ExtractOptions { level, placement, ..*options };
    options.check()?;
    let lattice = Lattice::new(&bricks, level, placement, false);
    let slices = run::walk(&bricks, progress)?;
    contour(&lattice, &slices, &options, sink, progress)
}
