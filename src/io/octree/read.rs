//! From a file to a [`SignedOctree`].

use super::check::Disagreement;
use super::dcf::Dcf;
use super::decode::{Decoded, Divided, Keep, Source, decode};
use super::dialect::{Dialect, Header};
use super::fill::{self, Hermites};
use super::pad::{LEVELS, shifted};
use super::sof::Sof;
use super::sog::Sog;
use super::{OctreeFile, OctreeFormat, OctreeInfo};
use crate::error::{Error, Place, Result};
use crate::geom::Frame;
use crate::grid::Key;
use crate::grid::brick::Plane;
use crate::io::bytes::Bytes;
use crate::octree::crossings::Sample;
use crate::octree::{SignedOctree, StoredPoints};
use crate::progress::{Progress, Silent, check};
use glam::DVec3;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads an octree file. The content says the format, or the name where the content does not (SOF).
///
/// Memory while reading: some 8 bytes a surface cell beyond what is returned.
///
/// # Errors
/// When the file cannot be read, is of no known format or malformed, or holds signs that contradict each other; and `Cancelled`.
pub fn read_octree(path: impl AsRef<Path>, progress: &dyn Progress) -> Result<OctreeFile> {
    let path = path.as_ref();
    let io_error = |e| Error::io(path, "read", e);
    let mut file = File::open(path).map_err(io_error)?;
    let metadata = file.metadata().map_err(io_error)?;
    let name = path.display().to_string();
    if metadata.is_file() {
        let format = OctreeFormat::of_file(path)?;
        return read_from(&name, file, metadata.len(), format, progress);
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(io_error)?;
    let format = OctreeFormat::detect(&bytes, OctreeFormat::from_path(path));
    read_from(&name, bytes.as_slice(), bytes.len() as u64, format, progress)
}

/// Reads the bytes of an octree file. `name` stands in error messages; `hint` is used where the content does not say its format.
///
/// # Errors
/// As [`read_octree`].
pub fn read_octree_bytes(name: &str, bytes: &[u8], hint: Option<OctreeFormat>) -> Result<OctreeFile> {
    read_from(name, bytes, bytes.len() as u64, OctreeFormat::detect(bytes, hint), &Silent)
}

fn read_from(
    name: &str,
    reader: impl Read,
    len: u64,
    format: Option<OctreeFormat>,
    progress: &dyn Progress,
) -> Result<OctreeFile> {
    let Some(format) = format else {
        let problem = "neither the content nor the name says that this is an octree";
        return Err(Error::format(name, Place::Whole, problem, "give it a name that ends in .sof, .sog or .dcf"));
    };
    check(progress)?;
    let bytes = Bytes::new(name, reader, 0, len);
    let info = OctreeInfo {
        path: name.into(),
        format,
        bytes: len,
        depth: 0,
        surface_cells: 0,
        surface_cells_inside: 0,
        surface_cells_outside: 0,
        empty_cells: 0,
        missing_samples: 0,
        trailing_bytes: 0,
        is_padded: false,
    };
    let mut reading = Reading { name, bytes, info, progress };
    let (octree, frame, points) = match format {
        OctreeFormat::Sof => reading.sof()?,
        OctreeFormat::Sog => reading.sog()?,
        OctreeFormat::Dcf => reading.dcf()?,
    };
    let Reading { bytes, mut info, .. } = reading;
    info.trailing_bytes = bytes.left();
    Ok(OctreeFile { octree, frame, points, info })
}

/// A file that is being read.
struct Reading<'a, R> {
    name: &'a str,
    bytes: Bytes<'a, R>,
    info: OctreeInfo,
    progress: &'a dyn Progress,
}

/// Sides of bricks that a solid may fill on the side of its cube, whatever the file is: a million faces. A full cube of 256 cells a side has a
/// third of it.
const MOST_SIDES: u64 = 1 << 14;
/// Bytes of the file for each side more, so that its size bounds memory and time.
const BYTES_A_SIDE: u64 = 32;

type Parts = (SignedOctree, Frame, Option<StoredPoints>);

impl<R: Read> Reading<'_, R> {
    fn sof(&mut self) -> Result<Parts> {
        let (frame, decoded) = self.decoded::<Sof>(&mut |_, _, _| {})?;
        Ok((self.octree(&decoded, false, |_, brick, samples| fill::half_way(brick, samples))?, frame, None))
    }

    fn sog(&mut self) -> Result<Parts> {
        let mut points = StoredPoints::default();
        let (frame, decoded) = self.decoded::<Sog>(&mut |brick, leaves, data| {
            let points_of_brick: Vec<[f32; 3]> = leaves.iter().map(|cell| data[cell.index() as usize]).collect();
            points.push(brick.key, *leaves, &points_of_brick);
        })?;
        if self.info.is_padded {
            points = points.renamed(shifted);
        }
        let octree =
            self.octree(&decoded, true, |_, brick, samples| fill::from_points(&points, &frame, brick, samples))?;
        if decoded.sources.is_some() {
            points = fill::completed(&points, &octree, &frame);
        }
        Ok((octree, frame, Some(points)))
    }

    fn dcf(&mut self) -> Result<Parts> {
        let mut hermites = Hermites::default();
        let (frame, decoded) = self.decoded::<Dcf>(&mut |brick, leaves, data| hermites.push(brick, leaves, data))?;
        self.info.missing_samples = hermites.missing;
        Ok((
            self.octree(&decoded, true, |i, brick, samples| match i {
                Some(i) => hermites.of_brick(i, samples),
                None => fill::half_way(brick, samples),
            })?,
            frame,
            None,
        ))
    }

    /// Reads header and nodes, and makes sure that the signs make sense.
    fn decoded<D: Dialect>(&mut self, keep: &mut Keep<'_, D::Leaf>) -> Result<(Frame, Decoded)> {
        let header = D::read_header(&mut self.bytes)?;
        let frame = self.frame(header)?;
        let mut decoded = decode::<D, _>(&mut self.bytes, header, &mut self.info, keep, self.progress)?;
        if let Some(point) = decoded.divide() {
            return Err(self.disagreement(point));
        }
        let Some(found) = decoded.disagreement() else { return Ok((frame, decoded)) };
        if let Disagreement::Around(point) = found {
            return Err(self.disagreement(point));
        }
        // The solid touches the side of its cube.
        let (sides, len) = (decoded.filled_sides(), self.info.bytes);
        if sides > MOST_SIDES + len / BYTES_A_SIDE {
            let problem =
                format!("the solid fills sides of its cube: {len} bytes would become {} faces there", 64 * sides);
            let remedy = "write the octree again with a margin of at least one cell on all sides";
            return Err(Error::format(self.name, Place::Whole, problem, remedy));
        }
        let shift = 1 << decoded.depth;
        let Some(decoded) = decoded.padded() else {
            let problem = "the solid touches the side of its cube, and the grid is too fine for a larger one";
            let remedy = "write the octree again with a margin of at least one cell on all sides";
            return Err(Error::format(self.name, Place::Whole, problem, remedy));
        };
        if let Some(Disagreement::Around(point) | Disagreement::OnSide(point)) = decoded.disagreement() {
            return Err(self.disagreement(point.map(|c| c.saturating_sub(shift))));
        }
        self.info.is_padded = true;
        let side = frame.size() * f64::from(1 << LEVELS);
        let frame = Frame::new(frame.origin() - frame.size(), side, decoded.depth);
        Ok((frame.map_err(|e| Error::format(self.name, Place::Whole, format!("a larger cube: {e}"), ""))?, decoded))
    }

    fn disagreement(&self, [x, y, z]: [u32; 3]) -> Error {
        let problem = format!("cells disagree whether their common corner is inside: at lattice point {x}, {y}, {z}");
        Error::format(self.name, Place::Whole, problem, "the file is damaged: write it again")
    }

    fn frame(&self, header: Header) -> Result<Frame> {
        let (corner, side) = header.cube.unwrap_or(([0.0; 3], 1.0));
        // Small grids are the least corner of one of 8 cells a side.
        let depth = header.depth.max(3);
        let side = f64::from(side) * f64::from(1u32 << (depth - header.depth));
        let frame = Frame::new(DVec3::from(corner.map(f64::from)), side, depth);
        frame.map_err(|e| Error::format(self.name, Place::Whole, format!("the cube of the octree: {e}"), ""))
    }

    /// Puts the octree together; `samples` pushes those of the crossings of a brick, in order, given its number in the
    /// file, unless cells in it were divided.
    fn octree(
        &self,
        decoded: &Decoded,
        with_normals: bool,
        samples: impl Fn(Option<usize>, &Divided, &mut Vec<Sample>) + Sync,
    ) -> Result<SignedOctree> {
        let crossings = |brick: &Divided| brick.crossed().iter().map(|plane| u64::from(plane.count())).sum::<u64>();
        if decoded.bricks.iter().map(crossings).sum::<u64>() > u64::from(u32::MAX) {
            let problem = "the surface crosses more than 2^32 - 1 edges of the grid";
            return Err(Error::format(self.name, Place::Whole, problem, "take an octree of smaller depth"));
        }
        let signs: Vec<(Key, Plane)> = decoded.bricks.iter().map(|brick| (brick.key, brick.corners[0])).collect();
        let is_inside = |brick| decoded.is_uniformly_inside(brick);
        let cells = 1 << self.info.depth;
        let samples = |i: usize, _: &[Plane; 3], list: &mut Vec<Sample>| {
            let brick = &decoded.bricks[i];
            match &decoded.sources {
                None => samples(Some(i), brick, list),
                Some(sources) => match sources[i] {
                    Source::File(i) => samples(Some(i as usize), brick, list),
                    Source::Unknown => samples(None, brick, list),
                    Source::Beside => fill::at_sides(decoded.depth, cells, brick, list),
                },
            }
        };
        Ok(SignedOctree::from_signs(decoded.depth, with_normals, &signs, is_inside, samples))
    }
}
