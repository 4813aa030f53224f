//! Sketches: files of lines that say what topology a solid shall have.
//!
//! Read are the `.axs` files of the `MendIT` program, and the lines of OBJ files, which look alike:
//!
//! ```text
//! # a comment
//! v 0.5 0.25 1     a point, in the coordinates of the model
//! l 1 2            a line between points, counted from 1; of OBJ files also along more of them, or counted back from the last (-1)
//! s 3              ignored
//! o                ends an .axs file; with a name behind it, as OBJ files have it, ignored
//! ```
//!
//! Any other line is ignored. Skeletons that were [written](super::skeleton::write_lines) as OBJ can be read, too.

use super::number;
use super::skeleton::{Colour, Polylines};
use super::text::{self, Text};
use crate::error::{Error, Result};
use glam::DVec3;
use std::path::Path;

/// How lines that say no colour are shown.
const COLOUR: Colour = [255; 3];

/// Reads a sketch from a file.
///
/// # Errors
/// When the file cannot be read, a number in it is malformed or not finite, or a line names a point that is not there.
pub fn read(path: impl AsRef<Path>) -> Result<Polylines> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    read_bytes(&path.display().to_string(), &bytes)
}

/// Reads the bytes of a sketch. `name` stands in error messages.
///
/// # Errors
/// As [`read`], except that nothing is read from disk.
pub fn read_bytes(name: &str, bytes: &[u8]) -> Result<Polylines> {
    let decoded = text::decode(bytes);
    let mut text = Text::with_continued_lines(name, &decoded);
    let mut sketch = Polylines::default();
    // The last point that a line names, and where: points may stand behind lines.
    let mut furthest = (0, 0);
    loop {
        text.skip_blanks();
        match *text.rest() {
            [] => break,
            [b'v', 0..=b' ', ..] => {
                text.advance(1);
                let start = text.position();
                let mut coordinate = || text.number("a coordinate of a point");
                let point = DVec3::new(coordinate()?, coordinate()?, coordinate()?);
                if !point.is_finite() {
                    return Err(text.error_at(start, "a coordinate is not finite", "correct this line"));
                }
                sketch.points.push(point);
            }
            [b'l', 0..=b' ', ..] => {
                text.advance(1);
                let mut line = Vec::new();
                while let Some(index) = next_index(&mut text, sketch.points.len())? {
                    if index >= furthest.0 {
                        furthest = (index + 1, text.position());
                    }
                    line.push(index);
                }
                if line.len() < 2 {
                    return Err(text.error("a line needs two points", "name them both, or leave it out"));
                }
                sketch.lines.push((line, COLOUR));
            }
            [b'o', ref rest @ ..] if is_end_of_line(rest) => break,
            _ => {}
        }
        text.skip_line();
    }
    let points = sketch.points.len();
    if furthest.0 as usize > points {
        let problem = format!("a line names point {}, but there are {points}", furthest.0);
        return Err(text.error_at(furthest.1, problem, "points are counted from 1: correct the line"));
    }
    if points == 0 {
        return Err(text.error_at(0, "there are no points (v x y z)", "is it a sketch at all?"));
    }
    Ok(sketch)
}

/// The next index of a line, from 0 on; none at its end.
fn next_index(text: &mut Text<'_>, points: usize) -> Result<Option<u32>> {
    text.skip_spaces();
    if matches!(text.rest().first(), None | Some(b'\n' | b'\r')) {
        return Ok(None);
    }
    let Some((index, length)) = number::scan_integer(text.rest()) else {
        return Err(text.unexpected("a point's number"));
    };
    if text.rest().get(length).is_some_and(|&b| !text::is_delimiter(b)) {
        return Err(text.unexpected("a point's number"));
    }
    let from_one = if index < 0 { points as i64 + index + 1 } else { index };
    let Some(from_one) = u32::try_from(from_one).ok().filter(|&number| number > 0) else {
        return Err(text.error(format!("there is no point {index}"), "points are counted from 1: correct the line"));
    };
    text.advance(length);
    Ok(Some(from_one - 1))
}

fn is_end_of_line(rest: &[u8]) -> bool {
    let blank = rest.iter().take_while(|&&b| b == b' ' || b == b'\t').count();
    matches!(rest.get(blank), None | Some(b'\n' | b'\r' | b'#'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Result<Vec<Vec<u32>>> {
        Ok(read_bytes("t.axs", text.as_bytes())?.lines.into_iter().map(|line| line.0).collect())
    }

    #[test]
    fn both_kinds_of_files_are_read() {
        let axs = "# 3 2\nv 0 0 0\nv 1 0 0.5\r\nv 1e1 1 0\ns 1\nl 1 2\nl 2 3\no\nl 8 9 junk\n";
        assert_eq!(lines(axs).expect("valid"), [vec![0, 1], vec![1, 2]]);
        let obj = "o knot\nl 1 2 3 1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nl -1 -3\nvn 1 0 0\nf 1 2 3\n";
        assert_eq!(lines(obj).expect("valid"), [vec![0, 1, 2, 0], vec![2, 0]]);
        assert_eq!(read_bytes("t", axs.as_bytes()).expect("valid").points[2], DVec3::new(10.0, 1.0, 0.0));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (text, expected) in [
            ("v 0 0 0\nv 1 1 1\nl 1 3\n", "line 3: a line names point 3, but there are 2"),
            ("v 0 0 0\nl 1 0\n", "line 2: there is no point 0"),
            ("v 0 0 0\nl -2 1\n", "line 2: there is no point -2"),
            ("v 0 0 0\nl 1\n", "line 2: a line needs two points"),
            ("v 0 0\n", "line 1: expected a coordinate of a point"),
            ("v 0 0 nan\n", "line 1: a coordinate is not finite"),
            ("v 0 0 0\nl 1/1 1/2\n", "line 2: expected a point's number, found `1/1`"),
            ("", "there are no points"),
            ("o\nv 0 0 0\n", "there are no points"),
        ] {
            let message = lines(text).expect_err(text).to_string();
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }
}
