//! OBJ: positions and polygons; all that is not geometry of faces is skipped.
//!
//! Lines that are neither `v` nor `f` are ignored, among them points, lines, curves, groups and materials. Texture and
//! normal indices of corners are ignored, as are weights and colours behind positions.

use super::build::Builder;
use super::text::{self, Text};
use super::{Encoding, Parsed, number};
use crate::error::{Error, Result};
use glam::DVec3;

/// Reads a whole OBJ file.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Parsed> {
    let mut text = Text::with_continued_lines(name, bytes);
    let mut builder = Builder::new(name);
    let mut polygon = Vec::new();
    let mut furthest = Furthest::default();
    let mut has_other_lines = false;
    loop {
        text.skip_blanks();
        match *text.rest() {
            [] => break,
            [b'v', b' ' | b'\t' | b'\\', ..] => {
                text.advance(1);
                let mut coordinate = || text.number("a coordinate of a vertex");
                builder.point(DVec3::new(coordinate()?, coordinate()?, coordinate()?))?;
            }
            [b'f'] | [b'f', 0..=b' ' | b'#' | b'\\', ..] => {
                text.advance(1);
                polygon.clear();
                while let Some(corner) = next_corner(&mut text, builder.points(), &mut furthest)? {
                    polygon.push(corner);
                }
                builder.polygon(&polygon)?;
            }
            _ => has_other_lines = true,
        }
        text.skip_line();
    }
    if furthest.index as usize > builder.points() {
        return Err(out_of_range(&text, furthest.position, i64::from(furthest.index), builder.points()));
    }
    let mesh = builder.finish();
    if mesh.points.is_empty() && mesh.faces.is_empty() && has_other_lines {
        return Err(text.error_at(0, "no line of this file is a vertex or a face", "is it an OBJ file at all?"));
    }
    Ok(Parsed { mesh, encoding: Encoding::Text, trailing_bytes: 0 })
}

/// The greatest index seen, counted from 1, and where. Faces may stand before their vertices, so it is judged at the end.
#[derive(Debug, Default)]
struct Furthest {
    index: u32,
    position: usize,
}

/// The next corner of a face, as `7`, `7/1`, `7//3`, `7/1/3` or negative, counted back from the last vertex so far.
fn next_corner(text: &mut Text<'_>, points: usize, furthest: &mut Furthest) -> Result<Option<u32>> {
    text.skip_spaces();
    let rest = text.rest();
    if matches!(rest.first(), None | Some(b'\n' | b'\r')) {
        return Ok(None);
    }
    let Some((index, length)) = number::scan_integer(rest) else { return Err(text.unexpected("a vertex index")) };
    let others = match rest.get(length) {
        Some(b'/') => {
            let is_part = |b: &&u8| matches!(b, b'0'..=b'9' | b'/' | b'-' | b'+');
            rest[length..].iter().take_while(is_part).count()
        }
        _ => 0,
    };
    if rest.get(length + others).is_some_and(|&b| !text::is_delimiter(b)) {
        return Err(text.unexpected("a vertex index"));
    }
    let from_one = if index < 0 { points as i64 + index + 1 } else { index };
    let Some(from_one) = u32::try_from(from_one).ok().filter(|&i| i > 0) else {
        return Err(out_of_range(text, text.position(), index, points));
    };
    if from_one > furthest.index {
        *furthest = Furthest { index: from_one, position: text.position() };
    }
    text.advance(length + others);
    Ok(Some(from_one - 1))
}

#[cold]
fn out_of_range(text: &Text<'_>, position: usize, index: i64, points: usize) -> Error {
    let (seen, remedy) = match index {
        0 => ("", "OBJ counts vertices from 1: add 1 to all indices"),
        1.. => ("", "the vertices may be in another file, or this one is cut short: export it again"),
        _ => (" so far", "negative indices count back from the last vertex above the face: export the file again"),
    };
    text.error_at(position, format!("a face refers to vertex {index}, but there are {points}{seen}"), remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faces(text: &str) -> Result<Vec<Vec<u32>>> {
        Ok(parse("t.obj", text.as_bytes())?.mesh.faces.iter().map(<[u32]>::to_vec).collect())
    }

    const POINTS: &str = "v 0 0 0\nv 1 0 0 0.5 0.5 0.5\r\nv 1 1 0 1.0\rv\t0 1 0 # last\n";

    #[test]
    fn corners_come_in_all_forms() {
        let text = format!("{POINTS}f 1/1 2//2 3/3/3 4// #x\nf -4 -3/-1 \\\n -2//-1\nl 1 2 9\np 7\nvn 1\nfoo\nf 4 3 2");
        assert_eq!(faces(&text).expect("valid"), [vec![0, 1, 2, 3], vec![0, 1, 2], vec![3, 2, 1]]);
    }

    #[test]
    fn short_faces_are_kept_and_faces_may_come_first() {
        assert_eq!(
            faces(&format!("f\nf 1\nf 1 2 4\n{POINTS}f")).expect("valid"),
            [vec![], vec![0], vec![0, 1, 3], vec![]]
        );
    }

    #[test]
    fn errors_name_the_line_and_the_count() {
        let message = |line: &str| faces(&format!("{POINTS}{line}\n")).expect_err(line).to_string();
        assert!(message("f 1 2 5").starts_with("t.obj: line 5: a face refers to vertex 5, but there are 4; "));
        assert!(message("f 1 2 0").contains("line 5: a face refers to vertex 0, but there are 4; OBJ counts"));
        assert!(message("f 1 2 -5").contains("vertex -5, but there are 4 so far; "));
        assert!(message("f 1 2 99999999999").contains("vertex 99999999999,"));
        assert!(message("f 1 2 x3").contains("expected a vertex index, found `x3`; "));
        assert!(message("f 1 2.5 3").contains("found `2.5`"));
        assert!(message("v 1 2").contains("expected a coordinate of a vertex, but the line ends here; "));
        assert!(message("v 1 2 3,5").contains("found `3,5`"));
        assert!(parse("t.obj", b"what is\nthis").is_err());
        assert!(parse("t.obj", b"# nothing\n").is_ok());
    }
}
