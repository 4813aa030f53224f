//! Skeletons and patches to look at: lines with weights, and faces with colours.
//!
//! Plain data in, PLY or OBJ out. PLY holds everything: edges have the properties `vertex1`, `vertex2`, `weight`, `red`, `green`, `blue`,
//! faces a list and a colour. OBJ has lines (`l`) with their weights in comments, and faces without colours.

use super::encode::{Out, Precision};
use super::file::AtomicFile;
use super::format::Format;
use crate::error::{Error, Place, Result};
use glam::DVec3;
use std::fmt::Write;
use std::path::Path;

/// Red, green, blue.
pub type Colour = [u8; 3];

/// Straight lines between points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lines {
    /// Positions in model units.
    pub points: Vec<DVec3>,
    /// The lines.
    pub lines: Vec<Line>,
}

/// A line between two points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Indices of its points.
    pub ends: [u32; 2],
    /// Its weight, for example the area of the section there.
    pub weight: f32,
    /// How it is shown.
    pub colour: Colour,
}

/// Lines from point to point to point.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Polylines {
    /// Positions in model units.
    pub points: Vec<DVec3>,
    /// The points of each line in order, the first one again at the end if it is closed; and how it is shown.
    pub lines: Vec<(Vec<u32>, Colour)>,
}

impl Polylines {
    /// Drops the points that no line uses; the others keep their order. Points that do not exist stay named.
    pub fn drop_unused_points(&mut self) {
        let mut numbers = vec![u32::MAX; self.points.len()];
        let mut used: Vec<u32> = self.lines.iter().flat_map(|line| line.0.iter().copied()).collect();
        used.sort_unstable();
        used.dedup();
        used.retain(|&v| (v as usize) < numbers.len());
        (0..).zip(&used).for_each(|(i, &v)| numbers[v as usize] = i);
        self.points = used.iter().map(|&v| self.points[v as usize]).collect();
        for v in self.lines.iter_mut().flat_map(|line| &mut line.0) {
            *v = numbers.get(*v as usize).copied().unwrap_or(u32::MAX);
        }
    }
}

/// Quadrilaterals between points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Patches {
    /// Positions in model units.
    pub points: Vec<DVec3>,
    /// The corners of each quadrilateral, and how it is shown.
    pub quads: Vec<([u32; 4], Colour)>,
}

/// A colour for a share between 0 (red: the thinnest) and 1 (blue: the thickest), over orange, white and light blue. Shares beyond are cut
/// off, NaN is white.
pub fn colour_of_share(share: f64) -> Colour {
    const STOPS: [[f64; 3]; 5] =
        [[202.0, 0.0, 32.0], [244.0, 165.0, 130.0], [247.0, 247.0, 247.0], [146.0, 197.0, 222.0], [5.0, 113.0, 176.0]];
    let place = if share.is_nan() { 2.0 } else { 4.0 * share.clamp(0.0, 1.0) };
    let stop = (place as usize).min(3);
    let fraction = place - stop as f64;
    std::array::from_fn(|i| (STOPS[stop][i] * (1.0 - fraction) + STOPS[stop + 1][i] * fraction).round() as u8)
}

/// Writes lines as PLY or OBJ, whichever the name says. Returns the size of the file in bytes.
///
/// # Errors
/// When the name says neither, a line refers to a point that does not exist, or the file cannot be written.
pub fn write_lines(path: impl AsRef<Path>, lines: &Lines) -> Result<u64> {
    let path = path.as_ref();
    let is_ply = is_ply(path)?;
    check_corners(path, "line", lines.points.len(), lines.lines.iter().map(|line| &line.ends[..]))?;
    let mut text = Text::create(path)?;
    if is_ply {
        let edges = format!(
            "element edge {}\nproperty int vertex1\nproperty int vertex2\nproperty float weight\n{COLOUR}",
            lines.lines.len()
        );
        text.ply_points(&lines.points, &edges)?;
        for Line { ends: [a, b], weight, colour: [red, green, blue] } in &lines.lines {
            let bits = weight.to_bits().to_le_bytes();
            text.put(&[&a.to_le_bytes()[..], &b.to_le_bytes(), &bits, &[*red, *green, *blue]].concat())?;
        }
        return text.finish();
    }
    text.obj_points(&lines.points)?;
    let mut last = None;
    for line in &lines.lines {
        if last.replace(line.weight.to_bits()) != Some(line.weight.to_bits()) {
            text.put(format!("# weight {}\n", line.weight).as_bytes())?;
        }
        text.put(format!("l {} {}\n", line.ends[0] + 1, line.ends[1] + 1).as_bytes())?;
    }
    text.finish()
}

/// Writes lines as PLY, where each piece is an edge of weight 1, or as OBJ, where each line is one. Returns the size of the file in bytes.
///
/// # Errors
/// When the name says neither, a line refers to a point that does not exist, or the file cannot be written.
pub fn write_polylines(path: impl AsRef<Path>, lines: &Polylines) -> Result<u64> {
    let path = path.as_ref();
    if is_ply(path)? {
        let piece = |pair: &[u32], colour| Line { ends: [pair[0], pair[1]], weight: 1.0, colour };
        let pieces = lines.lines.iter().flat_map(|(line, colour)| line.windows(2).map(|pair| piece(pair, *colour)));
        return write_lines(path, &Lines { points: lines.points.clone(), lines: pieces.collect() });
    }
    check_corners(path, "line", lines.points.len(), lines.lines.iter().map(|line| &line.0[..]))?;
    let mut text = Text::create(path)?;
    text.obj_points(&lines.points)?;
    for (line, _) in &lines.lines {
        text.put(b"l")?;
        line.iter().try_for_each(|v| text.put(format!(" {}", v + 1).as_bytes()))?;
        text.put(b"\n")?;
    }
    text.finish()
}

/// Writes quadrilaterals as PLY or OBJ, whichever the name says; OBJ has no colours. Returns the size of the file in bytes.
///
/// # Errors
/// When the name says neither, a quadrilateral refers to a point that does not exist, or the file cannot be written.
pub fn write_patches(path: impl AsRef<Path>, patches: &Patches) -> Result<u64> {
    let path = path.as_ref();
    let is_ply = is_ply(path)?;
    check_corners(path, "face", patches.points.len(), patches.quads.iter().map(|(corners, _)| &corners[..]))?;
    let mut text = Text::create(path)?;
    if is_ply {
        text.ply_points(&patches.points, &patch_elements(patches.quads.len()))?;
        for (corners, colour) in &patches.quads {
            let [a, b, c, d] = corners.map(u32::to_le_bytes);
            text.put(&[&[4][..], &a, &b, &c, &d, colour].concat())?;
        }
        return text.finish();
    }
    text.obj_points(&patches.points)?;
    for ([a, b, c, d], _) in &patches.quads {
        text.put(format!("f {} {} {} {}\n", a + 1, b + 1, c + 1, d + 1).as_bytes())?;
    }
    text.finish()
}

/// Bytes of a point, and of a quadrilateral with its colour.
const SIZES: [usize; 2] = [12, 20];

/// Reads quadrilaterals with their colours from a PLY file that [`write_patches`] has written.
///
/// # Errors
/// When the file cannot be read, or is any other file.
pub fn read_patches(path: impl AsRef<Path>) -> Result<Patches> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    parse_patches(&bytes).ok_or_else(|| {
        let problem = "this is no PLY file of patches";
        Error::format(path.display().to_string(), Place::Whole, problem, "`zmend topology --patches` writes such files")
    })
}

/// The patches that a file holds, if it is as [`write_patches`] writes it, to the byte.
fn parse_patches(bytes: &[u8]) -> Option<Patches> {
    const END: &[u8] = b"end_header\n";
    let head = bytes.windows(END.len()).take(CHUNK).position(|here| here == END)? + END.len();
    let (head, body) = (std::str::from_utf8(&bytes[..head]).ok()?, &bytes[head..]);
    let count = |element: &str| head.lines().find_map(|line| line.strip_prefix(element)?.parse::<usize>().ok());
    let (points, quads) = (count("element vertex ")?, count("element face ")?);
    let sizes = [points.checked_mul(SIZES[0])?, quads.checked_mul(SIZES[1])?];
    if head != ply_header(points, &patch_elements(quads)) || sizes[0].checked_add(sizes[1])? != body.len() {
        return None;
    }
    let (of_points, of_quads) = body.split_at(sizes[0]);
    let point = |bytes: &[u8; SIZES[0]]| DVec3::from_slice(&floats(bytes));
    let quad = |bytes: &[u8; SIZES[1]]| {
        let corners: [u32; 4] =
            std::array::from_fn(|k| u32::from_le_bytes(std::array::from_fn(|b| bytes[1 + 4 * k + b])));
        let is_sound = bytes[0] == 4 && corners.iter().all(|&corner| (corner as usize) < points);
        is_sound.then_some((corners, [bytes[17], bytes[18], bytes[19]]))
    };
    Some(Patches {
        points: of_points.as_chunks().0.iter().map(point).collect(),
        quads: of_quads.as_chunks().0.iter().map(quad).collect::<Option<_>>()?,
    })
}

fn floats(bytes: &[u8; SIZES[0]]) -> [f64; 3] {
    std::array::from_fn(|k| f64::from(f32::from_le_bytes(std::array::from_fn(|b| bytes[4 * k + b]))))
}

/// The faces of a PLY file of patches, as its header says.
fn patch_elements(quads: usize) -> String {
    format!("element face {quads}\nproperty list uchar int vertex_indices\n{COLOUR}")
}

/// The header of a binary PLY file; `behind` is what comes after its points.
fn ply_header(points: usize, behind: &str) -> String {
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment zmend\nelement vertex {points}\n");
    for axis in ["x", "y", "z"] {
        let _ = writeln!(header, "property float {axis}");
    }
    header + behind + "end_header\n"
}

/// The properties of a colour in the header of a PLY file.
const COLOUR: &str = "property uchar red\nproperty uchar green\nproperty uchar blue\n";

fn is_ply(path: &Path) -> Result<bool> {
    match Format::from_path(path) {
        Some(Format::Ply) => Ok(true),
        Some(Format::Obj) => Ok(false),
        _ => {
            let problem = "the name says neither PLY nor OBJ";
            let remedy = "give it a name that ends in .ply or .obj";
            Err(Error::format(path.display().to_string(), Place::Whole, problem, remedy))
        }
    }
}

fn check_corners<'a>(path: &Path, what: &str, points: usize, corners: impl Iterator<Item = &'a [u32]>) -> Result<()> {
    for (i, corners) in corners.enumerate() {
        // PLY has signed indices.
        if let Some(corner) = corners.iter().find(|&&c| c as usize >= points || c > i32::MAX as u32) {
            let problem = format!("{what} {i} refers to point {corner}, but there are {points}");
            return Err(Error::format(path.display().to_string(), Place::Whole, problem, ""));
        }
    }
    Ok(())
}

/// Bytes gathered before they are written.
const CHUNK: usize = 1 << 18;

/// A file on its way.
struct Text {
    file: AtomicFile,
    out: Out,
    bytes: u64,
}

impl Text {
    fn create(path: &Path) -> Result<Self> {
        Ok(Text { file: AtomicFile::create(path)?, out: Out::default(), bytes: 0 })
    }

    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.push(bytes);
        if self.out.bytes().len() < CHUNK { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<()> {
        self.file.write(self.out.bytes())?;
        self.bytes += self.out.bytes().len() as u64;
        self.out.clear();
        Ok(())
    }

    /// A binary PLY file up to the end of its points; `behind` is the rest of the header.
    fn ply_points(&mut self, points: &[DVec3], behind: &str) -> Result<()> {
        self.put(ply_header(points.len(), behind).as_bytes())?;
        points.iter().try_for_each(|p| self.put(p.as_vec3().to_array().map(f32::to_le_bytes).as_flattened()))
    }

    fn obj_points(&mut self, points: &[DVec3]) -> Result<()> {
        self.put(b"# zmend\n")?;
        for &point in points {
            self.out.push(b"v ");
            self.out.push_vector(point, Precision::Single);
            self.put(b"\n")?;
        }
        Ok(())
    }

    fn finish(mut self) -> Result<u64> {
        self.flush()?;
        self.file.commit()?;
        Ok(self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(ends: [u32; 2], weight: f32) -> Line {
        Line { ends, weight, colour: [1, 2, 3] }
    }

    fn written(name: &str, write: impl Fn(&Path) -> Result<u64>) -> Vec<u8> {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join(name);
        let size = write(&path).expect("written");
        let bytes = std::fs::read(&path).expect("there");
        assert_eq!(bytes.len() as u64, size);
        bytes
    }

    #[test]
    fn lines_have_weights_and_colours() {
        let lines =
            Lines { points: vec![DVec3::X, DVec3::Y, DVec3::Z], lines: vec![line([0, 1], 2.5), line([2, 1], 2.5)] };
        let bytes = written("a.ply", |path| write_lines(path, &lines));
        let header = b"end_header\n";
        let body = bytes.windows(header.len()).position(|w| w == header).expect("a header") + header.len();
        let head = std::str::from_utf8(&bytes[..body]).expect("text");
        assert!(
            head.contains("element vertex 3\n") && head.contains("element edge 2\nproperty int vertex1\n"),
            "{head}"
        );
        let edges = &bytes[body + 3 * 12..];
        let first = [&0u32.to_le_bytes()[..], &1u32.to_le_bytes(), &2.5f32.to_le_bytes(), &[1, 2, 3]].concat();
        assert_eq!((edges.len(), &edges[..15]), (30, &first[..]));

        let text = String::from_utf8(written("a.obj", |path| write_lines(path, &lines))).expect("text");
        assert_eq!(text, "# zmend\nv 1 0 0\nv 0 1 0\nv 0 0 1\n# weight 2.5\nl 1 2\nl 3 2\n");
    }

    #[test]
    fn polylines_are_one_line_each() {
        let mut lines = Polylines {
            points: vec![DVec3::ONE, DVec3::X, DVec3::ONE, DVec3::Y, DVec3::Z],
            lines: vec![(vec![1, 3, 4, 1], [9; 3]), (vec![4, 3], [0; 3])],
        };
        lines.drop_unused_points();
        let text = String::from_utf8(written("a.obj", |path| write_polylines(path, &lines))).expect("text");
        assert_eq!(text, "# zmend\nv 1 0 0\nv 0 1 0\nv 0 0 1\nl 1 2 3 1\nl 3 2\n");
        let bytes = written("a.ply", |path| write_polylines(path, &lines));
        assert!(String::from_utf8_lossy(&bytes).contains("element edge 4\n"));
        assert_eq!(&bytes[bytes.len() - 3..], [0; 3]);
    }

    #[test]
    fn patches_are_meshes() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        let patches =
            Patches { points: points.clone(), quads: vec![([0, 1, 2, 3], [255, 0, 0]), ([3, 2, 1, 0], [0; 3])] };
        for name in ["a.ply", "a.obj"] {
            let bytes = written(name, |path| write_patches(path, &patches));
            let mesh = crate::io::read_bytes(name, &bytes, Format::from_path(Path::new(name))).expect("a mesh");
            assert_eq!(mesh.points, points);
            assert!(mesh.faces.iter().eq(patches.quads.iter().map(|q| &q.0[..])));
        }
        let bytes = written("a.ply", |path| write_patches(path, &patches));
        assert_eq!(parse_patches(&bytes).as_ref(), Some(&patches));
        // Any byte too few, any index too great.
        assert!((0..bytes.len()).all(|len| parse_patches(&bytes[..len]).is_none()));
        let mut wrong = bytes.clone();
        let last = wrong.len() - 4;
        wrong[last] = 1;
        assert!(parse_patches(&wrong).is_none() && parse_patches(b"end_header\n").is_none());
        assert!(read_patches("no such file").is_err());
    }

    #[test]
    fn what_cannot_be_written_is_refused() {
        let directory = tempfile::tempdir().expect("a directory");
        let lines = Lines { points: vec![DVec3::X], lines: vec![line([0, 1], 0.0)] };
        let error = write_lines(directory.path().join("a.ply"), &lines).expect_err("no point 1");
        assert!(error.to_string().contains("line 0 refers to point 1, but there are 1"));
        let error = write_lines(directory.path().join("a.stl"), &Lines::default()).expect_err("no lines");
        assert!(error.to_string().contains(".ply or .obj"));
        let patches = Patches { points: Vec::new(), quads: vec![([0; 4], [0; 3])] };
        assert!(write_patches(directory.path().join("a.obj"), &patches).is_err());
        assert_eq!(std::fs::read_dir(directory.path()).expect("a directory").count(), 0);
    }

    #[test]
    fn colours_go_from_red_to_blue() {
        assert_eq!((colour_of_share(0.0), colour_of_share(-1.0)), ([202, 0, 32], [202, 0, 32]));
        assert_eq!((colour_of_share(1.0), colour_of_share(f64::INFINITY)), ([5, 113, 176], [5, 113, 176]));
        assert_eq!((colour_of_share(0.5), colour_of_share(f64::NAN)), ([247; 3], [247; 3]));
    }
}
