//! From a [`SignedOctree`] to a file.

use super::dcf::{Dcf, Hermite};
use super::dialect::Header;
use super::encode::encode;
use super::sof::Sof;
use super::sog::Sog;
use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::geom::normal::NormalCode;
use crate::grid::Edge;
use crate::grid::cases::is_crossed;
use crate::octree::cells::{Cells, Crossing, EdgeTable};
use crate::octree::crossings::position;
use crate::octree::{CellPoints, SignedOctree};
use crate::progress::Progress;
use std::path::Path;

/// Writes an octree as SOF and returns the size of the file. Neither crossings nor the place of the grid are kept.
///
/// # Errors
/// When the file cannot be written, and `Cancelled`.
pub fn write_sof(path: impl AsRef<Path>, octree: &SignedOctree, progress: &dyn Progress) -> Result<u64> {
    let header = Header { depth: octree.crossings().depth(), cube: None };
    let nothing = |bricks: &[u32], leaves: &mut Vec<()>| {
        let cells = bricks.iter().map(|&i| octree.mixed_cells(i as usize).count() as usize);
        leaves.resize(leaves.len() + cells.sum::<usize>(), ());
    };
    encode::<Sof>(path.as_ref(), octree, header, &nothing, progress)
}

/// Writes an octree as SOG, with a point for each surface cell, and returns the size of the file. Numbers are in single precision.
///
/// # Errors
/// When single precision cannot hold the cube, when the file cannot be written, and `Cancelled`.
pub fn write_sog(
    path: impl AsRef<Path>,
    octree: &SignedOctree,
    frame: &Frame,
    points: &dyn CellPoints,
    progress: &dyn Progress,
) -> Result<u64> {
    let corner = frame.origin().as_vec3();
    let side = frame.size() as f32;
    if !((corner + side).is_finite() && corner.is_finite() && side.is_normal()) {
        let problem = format!("SOG cannot hold a cube of {:e} units at {}", frame.size(), frame.origin());
        return Err(Error::setting("format", problem, "scale the model to coordinates between 1e-30 and 1e30"));
    }
    let header = Header { depth: octree.crossings().depth(), cube: Some((corner.to_array(), side)) };
    let leaves = |bricks: &[u32], leaves: &mut Vec<[f32; 3]>| points.of_bricks(octree, bricks, leaves);
    encode::<Sog>(path.as_ref(), octree, header, &leaves, progress)
}

/// Writes an octree as DCF, with a sample for each crossed edge, and returns the size of the file. The place of the grid is not kept.
///
/// # Errors
/// When the octree has no normals, when the file cannot be written, and `Cancelled`.
pub fn write_dcf(path: impl AsRef<Path>, octree: &SignedOctree, progress: &dyn Progress) -> Result<u64> {
    let crossings = octree.crossings();
    if !crossings.with_normals() && !crossings.is_empty() {
        let remedy = "write SOF, or start from a mesh, an SOG or a DCF file";
        return Err(Error::setting("format", "DCF files hold normals, and this octree has none", remedy));
    }
    let header = Header { depth: crossings.depth(), cube: None };
    let leaves = |bricks: &[u32], leaves: &mut Vec<[Option<Hermite>; 12]>| {
        let mut table = EdgeTable::new(Hermite { offset: 0.0, normal: [0.0; 3] });
        for &i in bricks {
            let cells = Cells::new(octree, i as usize);
            table.fill(&cells, |Crossing { axis, number, starts_inside, .. }| {
                // Decoded normals point to the high end of the edge.
                let normal = NormalCode(crossings.normals()[number as usize]).decode(axis).to_array();
                let outward = if starts_inside { normal } else { normal.map(|c| -c) };
                Hermite { offset: position(crossings.offsets()[number as usize]) as f32, normal: outward }
            });
            leaves.extend(cells.mixed().iter().map(|cell| {
                let (mask, at) = (cells.mask(cell), table.at(cell));
                Edge::ALL.map(|edge| is_crossed(mask, edge).then(|| at(edge)))
            }));
        }
    };
    encode::<Dcf>(path.as_ref(), octree, header, &leaves, progress)
}
