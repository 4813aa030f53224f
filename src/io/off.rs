//! OFF: counts, positions, polygons. Also with normals, colours and texture coordinates, which are skipped.
//!
//! Each vertex and each face begins a line; what stands behind its numbers on the line is ignored, so that colours of any
//! width do no harm. The number of edges may be missing, as may the keyword `OFF` itself.

use super::build::Builder;
use super::text::Text;
use super::{Encoding, Parsed, number};
use crate::error::Result;
use glam::DVec3;

/// The keyword at the start of `bytes`, as `OFF`, `COFF` or `STCN4nOFF`, if there is one.
pub(super) fn keyword(bytes: &[u8]) -> Option<&[u8]> {
    let mut length = 0;
    for prefix in [&b"ST"[..], b"C", b"N", b"4", b"n"] {
        length += if bytes[length..].starts_with(prefix) { prefix.len() } else { 0 };
    }
    let is_keyword = bytes[length..].starts_with(b"OFF") && !bytes.get(length + 3).is_some_and(u8::is_ascii_alphabetic);
    is_keyword.then(|| &bytes[..length + 3])
}

/// Reads a whole OFF file.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Parsed> {
    let mut text = Text::new(name, bytes);
    text.skip_blanks();
    let (points, polygons) = parse_header(&mut text)?;

    let mut builder = Builder::new(name);
    // The least vertex is `0 0 0` and a line end, the least face `0` and a line end.
    builder.reserve(points.min(bytes.len() as u64 / 6) as usize, polygons.min(bytes.len() as u64 / 2) as usize, 0)?;
    for i in 0..points {
        text.skip_blanks();
        let mut coordinate = || {
            text.skip_blanks();
            text.number(format_args!("a coordinate of vertex {i} of {points}"))
        };
        builder.point(DVec3::new(coordinate()?, coordinate()?, coordinate()?))?;
        text.skip_line();
    }
    let mut polygon = Vec::new();
    for i in 0..polygons {
        text.skip_blanks();
        let start = text.position();
        let corners = text.integer(format_args!("the number of corners of face {i} of {polygons}"))?;
        if corners < 0 {
            return Err(text.error_at(start, format!("face {i} has {corners} corners"), "export the file again"));
        }
        polygon.clear();
        for _ in 0..corners {
            text.skip_blanks();
            let start = text.position();
            let index = text.integer("a vertex index")?;
            if u64::try_from(index).is_ok_and(|index| index < points) {
                polygon.push(index as u32);
            } else {
                let problem = format!("face {i} refers to vertex {index}, but there are {points}");
                return Err(text.error_at(
                    start,
                    problem,
                    "OFF counts vertices from 0: correct the face or export again",
                ));
            }
        }
        builder.polygon(&polygon)?;
        text.skip_line();
    }
    Ok(Parsed { mesh: builder.finish(), encoding: Encoding::Text, trailing_bytes: 0 })
}

/// Takes the keyword and the counts of vertices and faces, and moves to the line behind.
fn parse_header(text: &mut Text<'_>) -> Result<(u64, u64)> {
    if let Some(keyword) = keyword(text.rest()) {
        if keyword.iter().any(|b| matches!(b, b'4' | b'n')) {
            let problem = format!("`{}` has points of other than three dimensions", String::from_utf8_lossy(keyword));
            return Err(text.error(problem, "project it to three dimensions"));
        }
        text.advance(keyword.len());
        text.skip_blanks();
        if text.peek_word().eq_ignore_ascii_case(b"BINARY") {
            return Err(text.error("binary OFF is not supported", "save it as text, or as PLY or STL"));
        }
    } else if number::scan_integer(text.rest()).is_none() {
        return Err(text.unexpected("`OFF`"));
    }
    let mut count = |what: &str| {
        text.skip_blanks();
        let start = text.position();
        let count = text.integer(what)?;
        u64::try_from(count).map_err(|_| text.error_at(start, format!("{what} is {count}"), "export the file again"))
    };
    let counts = (count("the number of vertices")?, count("the number of faces")?);
    text.skip_line();
    let (points, polygons) = counts;
    let least = points.saturating_mul(6).saturating_add(polygons.saturating_mul(2));
    if least > text.rest().len() as u64 + 1 {
        let problem =
            format!("{points} vertices and {polygons} faces are promised, but only {} bytes follow", text.rest().len());
        return Err(text.error_at(
            text.position().saturating_sub(1),
            problem,
            "correct the counts or export the file again",
        ));
    }
    Ok(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<(usize, Vec<Vec<u32>>)> {
        let mesh = parse("t.off", text.as_bytes())?.mesh;
        Ok((mesh.points.len(), mesh.faces.iter().map(<[u32]>::to_vec).collect()))
    }

    const REST: &str = "0 0 0\n\n1 0 0 # x\n1 1 0 1 1 0.5 1\n3 0 1 2 0.5 0.5 0.5\n";

    #[test]
    fn headers_come_in_all_forms() {
        for header in
            ["OFF\n3 1 0\n", "OFF 3 1 0\n", "OFF3 1 2\n", "3 1 0\n", "# c\n\nCOFF\n# c\n3 1\n", "STCNOFF\r\n3 1 9\r\n"]
        {
            assert_eq!(read(&format!("{header}{REST}")).expect(header), (3, vec![vec![0, 1, 2]]));
        }
        assert!(keyword(b"OFFSET").is_none() && keyword(b"STOFF ").is_some());
    }

    #[test]
    fn errors_name_the_line_and_a_remedy() {
        let message = |text: &str| read(text).expect_err(text).to_string();
        assert!(message("4OFF\n1 1 0\n").contains("other than three dimensions; project"));
        assert!(message("nOFF 5\n1 1 0\n").contains("other than three dimensions"));
        assert!(message("OFF BINARY\n\0\0").contains("line 1: binary OFF is not supported; save it as text"));
        assert!(message("OFF\n9999999999 1 0\n0 0 0\n").starts_with("t.off: line 2: 9999999999 vertices"));
        assert!(message("OFF\n-3 1 0\n").contains("line 2: the number of vertices is -3"));
        assert!(message("").contains("expected `OFF`"));
        assert!(
            message(&format!("OFF\n3 2 0\n{REST}"))
                .contains("expected the number of corners of face 1 of 2, but the file ends here")
        );
        assert!(message("OFF\n1 1 0\n0 0 0\n3 0 0 1\n").contains("line 4: face 0 refers to vertex 1, but there are 1"));
        assert!(message("OFF\n1 1 0\n0 0 0\n3 0 0").contains("expected a vertex index, but the file ends here"));
        assert!(message("OFF\n1 0 0\n0 0 zero\n").contains("expected a coordinate of vertex 0 of 1, found `zero`"));
    }
}
