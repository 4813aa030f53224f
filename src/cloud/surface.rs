//! From points to a field on an octree that is fine near them.

use super::{Cloud, Near, Shape, Sheet};
use crate::error::{Error, Result, Short};
use crate::field::Field;
use crate::geom::Frame;
use crate::geom::frame::DEPTHS;
use crate::grid::Key;
use crate::grid::brick::{Local, Plane};
use crate::octree::LinearOctree;
use crate::octree::crossings::lattice_point;
use crate::octree::point_set::PointSet;
use crate::progress::{Progress, Stage, check};
use glam::DVec3;
use rayon::prelude::*;

/// The deepest octree that is made unless one is asked for: 4096 cells a side.
const DEEPEST: u32 = 12;
/// Leaves away from points are of this level.
const COARSEST: u32 = 3;
/// Neighbours of a point that may be asked for.
const NEIGHBOURS: std::ops::RangeInclusive<usize> = 4..=200;

/// How to make a surface of points: `CloudOptions { depth: Some(9), ..CloudOptions::default() }`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudOptions {
    /// log2 of the number of cells a side of the grid, 4 to 18. Default `None`: cells are as wide as points are apart, or up to twice as
    /// fine.
    pub depth: Option<u32>,
    /// Side of a cell in model units, instead of `depth`. Default `None`.
    pub cell: Option<f64>,
    /// Part of the grid's side that the longest side of the cloud takes. Default 0.9.
    pub scale: f64,
    /// How many neighbours of each point tell its normal and its area, 4 to 200. More are smoother, fewer are sharper. Default 12.
    pub neighbours: usize,
    /// Where there are no normals: outside is what infinity reaches without passing between points that are less than this far apart, in
    /// model units. Default `None`: four times as far as points are apart.
    pub gap: Option<f64>,
}

impl Default for CloudOptions {
    fn default() -> Self {
        CloudOptions { depth: None, cell: None, scale: 0.9, neighbours: 12, gap: None }
    }
}

/// What was found in a cloud.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudReport {
    /// Points that the surface was made of.
    pub points: usize,
    /// Points left out: doubled ones, and those that are not finite.
    pub dropped: usize,
    /// Whether normals were given.
    pub had_normals: bool,
    /// How many points had their outer side from what infinity reaches; the others have it from their neighbours.
    pub seen_from_outside: usize,
    /// How far neighbouring points are from each other, in model units: half are nearer.
    pub spacing: f64,
}

impl Field {
    /// The field of a cloud, and the function that it is made of, which [`signed_by`](Field::signed_by) wants. The octree is finest along
    /// points, and wherever else the surface passes.
    ///
    /// # Errors
    /// When an option is out of range, or there are fewer than four points; `Cancelled`, and `Memory` when `progress` says so.
    pub fn of_cloud(
        cloud: &Cloud,
        options: &CloudOptions,
        progress: &dyn Progress,
    ) -> Result<(Field, Sheet, CloudReport)> {
        if !NEIGHBOURS.contains(&options.neighbours) {
            let problem = format!("{} is not {} to {}", options.neighbours, NEIGHBOURS.start(), NEIGHBOURS.end());
            return Err(Error::setting("neighbours", problem, "12 suits most clouds"));
        }
        if let Some(gap) = options.gap.filter(|gap| !(*gap > 0.0 && gap.is_finite())) {
            return Err(Error::setting("gap", format!("{gap} is no width"), "give a length above 0, or leave it out"));
        }
        progress.begin(Stage::Scan, 0);
        let mut cleaned = cloud.clone();
        let dropped = cleaned.clean();
        if cleaned.points.len() < 4 {
            let problem = format!("{} points are not enough for a surface", cleaned.points.len());
            return Err(Error::setting("input", problem, "give four at least, in different places"));
        }
        // Whether there is a grid for such a cloud, before any work.
        Frame::fit(&cleaned.bounds(), COARSEST + 1, options.scale)?;
        // Points, their order, neighbours, normals, areas, dipoles.
        progress.hold(cleaned.points.len() as u64 * (300 + 4 * options.neighbours as u64))?;
        let had_normals = cleaned.has_normals();
        let (sorted, near) = Near::sorted(&cleaned);
        drop(cleaned);
        let shape = Shape::of(&sorted, &near, options.neighbours, options.gap, progress)?;
        let report = CloudReport {
            points: sorted.points.len(),
            dropped,
            had_normals,
            seen_from_outside: shape.seen_from_outside,
            spacing: shape.spacing,
        };
        let frame = frame(&sorted, options, shape.spacing)?;
        let tree = tree(&sorted, &frame);
        let sheet = Sheet::new(&sorted, near, shape);
        drop(sorted);
        check(progress)?;
        progress.begin(Stage::Sign, 0);
        let field = Field::on_tree(frame, tree, &sheet, progress)?.refined(&sheet, progress)?;
        Ok((field, sheet, report))
    }
}

/// The grid that the options ask for.
fn frame(cloud: &Cloud, options: &CloudOptions, spacing: f64) -> Result<Frame> {
    let bounds = cloud.bounds();
    let frame = match (options.depth, options.cell) {
        (Some(depth), _) => Frame::fit(&bounds, depth, options.scale)?,
        (None, Some(cell)) => Frame::fit_cells(&bounds, cell, options.scale)?,
        (None, None) => {
            let least = Frame::fit(&bounds, COARSEST + 1, options.scale)?;
            let deeper = (least.cell_size() / spacing).log2().ceil();
            // Where most points coincide, spacing says nothing.
            let depth = if deeper.is_finite() { (f64::from(COARSEST + 1) + deeper) as u32 } else { DEEPEST };
            Frame::fit(&bounds, depth.clamp(COARSEST + 1, DEEPEST), options.scale)?
        }
    };
    if frame.depth() > COARSEST {
        return Ok(frame);
    }
    let problem = format!("cells of {} units are too large for the cloud", Short(frame.cell_size()));
    Err(Error::setting("depth", problem, format!("take depth {} to {}", COARSEST + 1, DEPTHS.end())))
}

/// The tree of the frame's depth that is finest within a cell of all points.
fn tree(cloud: &Cloud, frame: &Frame) -> LinearOctree<()> {
    // In cells of twice the size: those within half such a cell along each axis.
    let depth = frame.depth() - 1;
    if depth < 3 + COARSEST {
        return LinearOctree::build(frame.depth(), |_| true, |_| ());
    }
    let around = |p: &DVec3| {
        let at = (*p - frame.origin()) / (2.0 * frame.cell_size());
        (0..8).filter_map(move |corner| {
            let [x, y, z] = [0, 1, 2].map(|a| (at[a] + f64::from(corner >> a & 1) - 0.5) as u32);
            Some((Key::cell(depth - 3, [x >> 3, y >> 3, z >> 3])?, Local::new(x, y, z)))
        })
    };
    let mut cells: Vec<(Key, Local)> = cloud.points.par_iter().flat_map_iter(around).collect();
    cells.par_sort_unstable();
    let mut planes: Vec<(Key, Plane)> = Vec::new();
    for (key, local) in cells {
        if planes.last().is_none_or(|last| last.0 != key) {
            planes.push((key, Plane::EMPTY));
        }
        planes.last_mut().expect("just made").1.set(local);
    }
    let set = PointSet::new(depth, planes);
    let split = |cell: Key| {
        let level = cell.level().expect("a cell");
        if level < COARSEST {
            return true;
        }
        if level + 3 <= depth {
            return set.any_in(cell);
        }
        let plane = set.plane(cell.ancestor(depth - 3));
        let low = lattice_point(depth, cell);
        let side = 1 << (depth - level);
        (0..side * side * side)
            .any(|i| plane.get(Local::new(low[0] + i / side / side, low[1] + i / side % side, low[2] + i % side)))
    };
    LinearOctree::build(frame.depth(), split, |_| ())
}
