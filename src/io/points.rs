//! Clouds of points: XYZ text and PLY.
//!
//! XYZ is what scanners and spreadsheets write: a point a line, its coordinates first, with blanks, tabs, commas or semicolons between
//! numbers, and comments behind `#`, `//` or `%`. What follows the coordinates are normals if there are three numbers at least and they
//! have unit length, in all lines; else colours and the like, which are skipped. A first line with a single number, or of words, is a
//! heading.

use super::encode::{Out, Precision};
use super::file::AtomicFile;
use super::{Format, number, ply, text};
use crate::cloud::Cloud;
use crate::error::{Error, Place, Result};
use glam::DVec3;
use std::path::Path;

/// Bytes gathered before they are written.
const CHUNK: usize = 1 << 18;
/// Lengths of unit normals written with few digits.
const UNIT: std::ops::Range<f64> = 0.95..1.05;
/// Names of files that hold points as text.
const TEXT: [&str; 7] = ["xyz", "xyzn", "pts", "asc", "txt", "csv", "dat"];

/// Reads a cloud of points: of PLY files the vertices, with their normals if they have any; of other meshes all points; of everything else,
/// a point a line.
///
/// # Errors
/// When the file cannot be read or is malformed; the message names the line.
pub fn read_cloud(path: impl AsRef<Path>) -> Result<Cloud> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    let is_text = path.extension().is_some_and(|e| TEXT.iter().any(|text| e.eq_ignore_ascii_case(text)));
    let hint = if is_text { None } else { Format::from_path(path) };
    read_cloud_bytes(&path.display().to_string(), &bytes, hint)
}

/// As [`read_cloud`], of bytes. `name` stands in messages; `hint` says which mesh it is where the content does not.
///
/// # Errors
/// When the bytes are malformed.
pub fn read_cloud_bytes(name: &str, bytes: &[u8], hint: Option<Format>) -> Result<Cloud> {
    if bytes.is_empty() {
        return Err(Error::format(name, Place::Whole, "the file is empty", "copy or export it again"));
    }
    if ply::is_ply(bytes) {
        return ply::parse_cloud(name, bytes);
    }
    match hint {
        Some(format) => Ok(Cloud { points: super::parse(name, bytes, format)?.mesh.points, normals: Vec::new() }),
        None => parse_lines(name, &text::decode(bytes)),
    }
}

/// A point a line.
fn parse_lines(name: &str, bytes: &[u8]) -> Result<Cloud> {
    let mut cloud = Cloud::default();
    let mut numbers = Vec::new();
    let mut has_normals = true;
    let mut rest = bytes;
    let mut line_number = 0u64;
    while !rest.is_empty() {
        let (line, after) = rest.split_at(rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len()));
        rest = &after[text::newline_length(after)..];
        line_number += 1;
        numbers.clear();
        let is_complete = numbers_of(line, &mut numbers);
        match numbers[..] {
            [] if is_complete => {}
            // Words behind numbers do no harm.
            [x, y, z, ref more @ ..] if is_complete || !more.is_empty() => {
                cloud.points.push(DVec3::new(x, y, z));
                has_normals = has_normals && more.len() >= 3;
                if has_normals {
                    cloud.normals.push(DVec3::new(more[0], more[1], more[2]));
                }
            }
            // A heading: words, or how many points there are.
            _ if cloud.points.is_empty() && (numbers.is_empty() || is_complete && numbers.len() == 1) => {}
            _ => {
                let shown = String::from_utf8_lossy(&line[..line.len().min(40)]);
                let problem = format!("expected three numbers, found `{}`", shown.trim().escape_debug());
                let remedy = "a cloud of points has x, y and z in each line, and perhaps a normal";
                return Err(Error::format(name, Place::Line(line_number), problem, remedy));
            }
        }
    }
    if cloud.points.is_empty() {
        let remedy = "points are taken of .xyz, .txt, .csv and .pts files, and of meshes";
        return Err(Error::format(name, Place::Whole, "there are no points in it", remedy));
    }
    let are_unit = cloud.normals.iter().all(|n| UNIT.contains(&n.length()) || *n == DVec3::ZERO);
    if !(has_normals && are_unit) {
        cloud.normals.clear();
    }
    Ok(cloud)
}

/// The numbers of a line; returns whether nothing else stands in it.
fn numbers_of(line: &[u8], numbers: &mut Vec<f64>) -> bool {
    let is_between = |b: u8| b <= b' ' || b == b',' || b == b';';
    let mut rest = line;
    loop {
        let blanks = rest.iter().take_while(|&&b| is_between(b)).count();
        rest = &rest[blanks..];
        if rest.is_empty() || rest[0] == b'#' || rest[0] == b'%' || rest.starts_with(b"//") {
            return true;
        }
        match number::scan(rest) {
            Some((value, length)) if rest.get(length).is_none_or(|&b| is_between(b) || b == b'#') => {
                numbers.push(value);
                rest = &rest[length..];
            }
            _ => return false,
        }
    }
}

/// Files in which points can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CloudFormat {
    /// A line of text a point.
    Xyz,
    /// Binary PLY, little-endian, without faces.
    Ply,
}

impl CloudFormat {
    /// The format that a name says: `.ply` for PLY, `.xyz`, `.txt` and other names of text files for lines.
    pub fn from_path(path: impl AsRef<Path>) -> Option<CloudFormat> {
        let extension = path.as_ref().extension()?;
        if extension.eq_ignore_ascii_case("ply") {
            return Some(CloudFormat::Ply);
        }
        TEXT.iter().any(|text| extension.eq_ignore_ascii_case(text)).then_some(CloudFormat::Xyz)
    }
}

/// A file that takes points one by one, and holds none. It has a temporary name until [`finish`](CloudWriter::finish), and is removed when
/// dropped before.
pub struct CloudWriter {
    file: AtomicFile,
    format: CloudFormat,
    with_normals: bool,
    decimals: usize,
    out: Out,
    /// Where in the file the number of points belongs.
    count_at: u64,
    count: u64,
    bytes: u64,
}

/// Room for the number of points in a header.
const COUNT_DIGITS: usize = 20;

impl CloudWriter {
    /// Begins a file. Coordinates in text have so many decimals that `resolution`, in model units, has four digits.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn create(
        path: impl AsRef<Path>,
        format: CloudFormat,
        with_normals: bool,
        resolution: f64,
    ) -> Result<CloudWriter> {
        let digits = 4.0 - resolution.log10().floor();
        let decimals = if digits.is_finite() { digits.clamp(0.0, 17.0) as usize } else { 17 };
        let file = AtomicFile::create(path.as_ref())?;
        let mut writer =
            CloudWriter { file, format, with_normals, decimals, out: Out::default(), count_at: 0, count: 0, bytes: 0 };
        if format == CloudFormat::Ply {
            writer.out.push(b"ply\nformat binary_little_endian 1.0\nelement vertex ");
            writer.count_at = writer.out.bytes().len() as u64;
            writer.out.push(&[b' '; COUNT_DIGITS]);
            writer.out.push(b"\nproperty double x\nproperty double y\nproperty double z\n");
            if with_normals {
                writer.out.push(b"property float nx\nproperty float ny\nproperty float nz\n");
            }
            writer.out.push(b"end_header\n");
        }
        Ok(writer)
    }

    /// Writes a point, and its normal if those were asked for.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn point(&mut self, point: DVec3, normal: DVec3) -> Result<()> {
        self.count += 1;
        match self.format {
            CloudFormat::Ply => {
                point.to_array().iter().for_each(|c| self.out.push(&c.to_le_bytes()));
                if self.with_normals {
                    normal.as_vec3().to_array().iter().for_each(|c| self.out.push(&c.to_le_bytes()));
                }
            }
            CloudFormat::Xyz => {
                for (i, c) in point.to_array().into_iter().enumerate() {
                    if i > 0 {
                        self.out.push(b" ");
                    }
                    self.out.push(format!("{c:.*}", self.decimals).as_bytes());
                }
                if self.with_normals {
                    for c in normal.to_array() {
                        self.out.push(b" ");
                        self.out.push_number((c * 1e6).round() / 1e6, Precision::Single);
                    }
                }
                self.out.push(b"\n");
            }
        }
        if self.out.bytes().len() >= CHUNK { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        self.file.write(self.out.bytes())?;
        self.bytes += self.out.bytes().len() as u64;
        self.out.clear();
        Ok(())
    }

    /// Gives the file its name; returns its size.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(mut self) -> Result<u64> {
        self.flush()?;
        if self.format == CloudFormat::Ply {
            self.file.patch(self.count_at, format!("{:<COUNT_DIGITS$}", self.count).as_bytes())?;
        }
        self.file.commit()?;
        Ok(self.bytes)
    }
}

/// Writes a cloud as the name says, and returns the size of the file.
///
/// # Errors
/// When the name says no format, or the file cannot be written.
pub fn write_cloud(path: impl AsRef<Path>, cloud: &Cloud) -> Result<u64> {
    let path = path.as_ref();
    let format = CloudFormat::from_path(path).ok_or_else(|| {
        let remedy = "give it a name that ends in .xyz or .ply";
        Error::format(path.display().to_string(), Place::Whole, "the name says no format for points", remedy)
    })?;
    let bounds = cloud.bounds();
    let resolution = if bounds.is_empty() { 1.0 } else { bounds.extent().max_element() * 1e-4 };
    let mut writer = CloudWriter::create(path, format, cloud.has_normals(), resolution)?;
    for (i, &point) in cloud.points.iter().enumerate() {
        writer.point(point, cloud.normals.get(i).copied().unwrap_or_default())?;
    }
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Cloud> {
        read_cloud_bytes("t.xyz", text.as_bytes(), None)
    }

    #[test]
    fn lines_are_read_however_they_are_written() {
        let expected = vec![DVec3::new(1.0, -2.5, 3e-2), DVec3::new(4.0, 5.0, 6.0)];
        for text in [
            "1 -2.5 3e-2\n4 5 6\n",
            "2\n1 -2.5 0.03\n4 5 6",
            "x,y,z\r\n1,-2.5,0.03\r\n\r\n4,5,6\r\n",
            "# scan\r 1;-2.5;0.03 # first\r// and\r4;5;6\r",
            "1 -2.5 .03 255 0 7\n4 5 6 1 2 3 wall\n",
            "\u{feff}1\t-2.5\t.03 0.7\n4 5 6 0.9\n",
        ] {
            let cloud = parsed(text).expect(text);
            assert_eq!((cloud.points, cloud.normals), (expected.clone(), vec![]), "{text:?}");
        }
        let cloud = parsed("1 -2.5 0.03 0 0 1\n4 5 6 0.6 -0.8 0 17\n").expect("normals");
        assert_eq!((cloud.points, cloud.normals), (expected, vec![DVec3::Z, DVec3::new(0.6, -0.8, 0.0)]));
    }

    #[test]
    fn errors_name_the_line() {
        let message = |text: &str| parsed(text).expect_err(text).to_string();
        assert!(message("1 2 3\r\n4 5\r\n").starts_with("t.xyz: line 2: expected three numbers, found `4 5`; "));
        assert!(message("1 2 3\r4 5 x\r").starts_with("t.xyz: line 2: expected three numbers, found `4 5 x`; "));
        assert!(message("heading\nanother\n").contains("there are no points in it"));
        assert!(message("").contains("the file is empty"));
    }

    #[test]
    fn clouds_come_back() {
        let directory = tempfile::tempdir().expect("a directory");
        let mut cloud = Cloud {
            points: (0..1000).map(|i| DVec3::new(f64::from(i) / 8.0, 1.5, -2.0)).collect(),
            normals: Vec::new(),
        };
        for normals in [0, 1000] {
            cloud.normals = vec![DVec3::new(0.0, 0.6, 0.8); normals];
            for name in ["a.xyz", "a.ply"] {
                let path = directory.path().join(name);
                let bytes = write_cloud(&path, &cloud).expect("written");
                assert_eq!(std::fs::metadata(&path).expect("there").len(), bytes);
                let again = read_cloud(&path).expect("read");
                assert_eq!(again.points, cloud.points);
                assert_eq!(again.normals.len(), normals);
                assert!(again.normals.iter().all(|n| n.distance(cloud.normals[0]) < 1e-6));
            }
        }
        assert!(
            write_cloud(directory.path().join("a.stl"), &cloud).expect_err("no format").to_string().contains(".xyz")
        );
        let off = b"OFF\n3 0 0\n1 2 3\n4 5 6\n7 8 9\n";
        assert_eq!(read_cloud_bytes("a", off, Some(Format::Off)).expect("a mesh").points.len(), 3);
    }
}
