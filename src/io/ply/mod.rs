//! PLY: elements with named properties, as text or binary of either byte order.
//!
//! Used are the properties `x`, `y`, `z` of `vertex`, the list `vertex_indices` (or `vertex_index`) of `face` and of
//! `tristrips`; all else is skipped. Header counts are never trusted: what they promise must fit in the bytes that follow.

mod body;
mod file;
mod header;
mod write;

pub(super) use file::PlyFile;
pub(super) use header::{Header, is_ply};
pub(super) use write::{PlyEncoder, write_header};

use self::body::{BigEndian, Binary, Body, LittleEndian};
use self::header::Scalar;
use super::build::Builder;
use super::bytes::Bytes;
use super::text::Text;
use super::{Encoding, Parsed};
use crate::cloud::Cloud;
use crate::error::Result;

/// Reads a whole PLY file in memory.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Parsed> {
    let header = Header::parse(name, bytes)?;
    let body = || Bytes::new(name, &bytes[header.body..], header.body as u64, bytes.len() as u64);
    let mut builder = Builder::new(name);
    match header.encoding {
        Encoding::Text => {
            let mut text = Text::new(name, bytes);
            text.advance(header.body);
            read_elements(&header, &mut text, &mut builder)?;
        }
        Encoding::LittleEndian => read_elements(&header, &mut Binary::<LittleEndian, _>::new(body()), &mut builder)?,
        Encoding::BigEndian => read_elements(&header, &mut Binary::<BigEndian, _>::new(body()), &mut builder)?,
    }
    Ok(Parsed { mesh: builder.finish(), encoding: header.encoding, trailing_bytes: 0 })
}

/// Reads the vertices of a PLY file in memory, with their properties `nx`, `ny`, `nz` as normals if all three are there.
pub(super) fn parse_cloud(name: &str, bytes: &[u8]) -> Result<Cloud> {
    let header = Header::parse(name, bytes)?;
    let body = || Bytes::new(name, &bytes[header.body..], header.body as u64, bytes.len() as u64);
    match header.encoding {
        Encoding::Text => {
            let mut text = Text::new(name, bytes);
            text.advance(header.body);
            read_vertices(&header, &mut text)
        }
        Encoding::LittleEndian => read_vertices(&header, &mut Binary::<LittleEndian, _>::new(body())),
        Encoding::BigEndian => read_vertices(&header, &mut Binary::<BigEndian, _>::new(body())),
    }
}

/// Reads the elements up to the vertices.
fn read_vertices(header: &Header, body: &mut impl Body) -> Result<Cloud> {
    let mut cloud = Cloud::default();
    for element in &header.elements {
        body.check_size(element)?;
        if element.name != "vertex" {
            body.skip(element)?;
            continue;
        }
        cloud.points.reserve(element.count as usize);
        let normals = element.normals();
        cloud.normals.reserve(if normals.is_some() { element.count as usize } else { 0 });
        body.vertices(element, normals, |point, normal| {
            cloud.points.push(point);
            cloud.normals.extend(normal);
            Ok(())
        })?;
        break;
    }
    Ok(cloud)
}

/// Reads all elements in their order in the file.
fn read_elements(header: &Header, body: &mut impl Body, builder: &mut Builder<'_>) -> Result<()> {
    let points = header.points();
    for element in &header.elements {
        body.check_size(element)?;
        match element.name.as_str() {
            "vertex" => {
                builder.reserve(element.count as usize, 0, 0)?;
                body.points(element, |point| builder.point(point))?;
            }
            "face" => {
                let corners = (3 * element.count).min(body.left() / body.least_size(Scalar::I32));
                builder.reserve(0, element.count as usize, corners as usize)?;
                body.faces(element, points, |face| builder.polygon(face))?;
            }
            "tristrips" => body.strips(element, points, |triangle| builder.polygon(&triangle))?,
            _ => body.skip(element)?,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    /// A square, two triangles of it and an empty face, with extra properties everywhere.
    const HEADER: &str = "element vertex 4\nproperty uchar red\nproperty float x\nproperty float y\nproperty float z\n\
         property list uchar short extra\nelement other 2\nproperty list ushort double a\nproperty int b\n\
         element face 3\nproperty float quality\nproperty list uchar int vertex_indices\nproperty list uchar float uv\n\
         end_header\n";

    /// The body that goes with it, written by `put(type size, value)`.
    fn body(mut put: impl FnMut(char, f64)) {
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            for (t, v) in [('B', 7.0), ('f', x), ('f', y), ('f', 0.0), ('B', 1.0), ('h', -5.0)] {
                put(t, v);
            }
        }
        for (t, v) in [('H', 1.0), ('d', 0.1), ('i', -1.0), ('H', 0.0), ('i', 8.0)] {
            put(t, v);
        }
        for face in [&[0, 1, 2][..], &[0, 1, 2, 3], &[]] {
            put('f', 0.25);
            put('B', face.len() as f64);
            for &i in face {
                put('i', f64::from(i));
            }
            for (t, v) in [('B', 2.0), ('f', 1.0), ('f', 1.0)] {
                put(t, v);
            }
        }
    }

    fn binary(big: bool) -> Vec<u8> {
        let order = if big { "big" } else { "little" };
        let mut bytes = format!("ply\nformat binary_{order}_endian 1.0\n{HEADER}").into_bytes();
        body(|kind, value| {
            let mut raw = match kind {
                'B' => vec![value as u8],
                'h' => (value as i16).to_le_bytes().to_vec(),
                'H' => (value as u16).to_le_bytes().to_vec(),
                'i' => (value as i32).to_le_bytes().to_vec(),
                'f' => (value as f32).to_le_bytes().to_vec(),
                _ => value.to_le_bytes().to_vec(),
            };
            if big {
                raw.reverse();
            }
            bytes.extend(raw);
        });
        bytes
    }

    fn ascii() -> Vec<u8> {
        let mut text = format!("ply\nformat ascii 1.0\n{HEADER}");
        body(|_, value| writeln!(text, "{value}").expect("memory takes all"));
        text.into_bytes()
    }

    #[test]
    fn all_encodings_give_the_same_mesh() {
        let mesh = parse("t.ply", &ascii()).expect("valid").mesh;
        assert_eq!(mesh.points.len(), 4);
        assert_eq!(mesh.faces.iter().collect::<Vec<_>>(), [&[0, 1, 2][..], &[0, 1, 2, 3], &[]]);
        assert_eq!(parse("t.ply", &binary(false)).expect("valid").mesh, mesh);
        assert_eq!(parse("t.ply", &binary(true)).expect("valid").mesh, mesh);
    }

    #[test]
    fn every_truncation_is_an_error() {
        for whole in [ascii(), binary(false), binary(true)] {
            // The last byte of the text is a line end that may be missing.
            let end = whole.len() - usize::from(whole.ends_with(b"\n"));
            for length in 0..end {
                assert!(parse("t.ply", &whole[..length]).is_err(), "{length} of {end} bytes");
            }
        }
    }

    #[test]
    fn errors_name_the_place_and_the_counts() {
        let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
        let faces = "element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n1 1 0\n";
        let message = |text: &str| parse("t.ply", text.as_bytes()).expect_err(text).to_string();
        assert!(
            message(&format!("{header}{faces}3 0 1 3"))
                .contains("line 13: face 0 refers to vertex 3, but there are 3; ")
        );
        assert!(message(&format!("{header}{faces}3 0 1 -1")).contains("refers to vertex -1, "));
        assert!(message(&format!("{header}{faces}3 0 1 0.5")).contains("refers to vertex 0.5, "));
        assert!(message(&format!("{header}{faces}-3 0 1 2")).contains("a list with -3 entries"));
        assert!(message(&format!("{header}{faces}3 0 1 x")).contains("found `x`"));
        let huge = header.replace("vertex 3", "vertex 4000000000000");
        assert!(message(&format!("{huge}end_header\n0 0 0")).contains("4000000000000 of `vertex` need at least"));
        let bare = "ply\nformat ascii 1.0\nelement vertex 4000000000\nelement face 1\nend_header\n0";
        let Err(error) = parse("t.ply", bare.as_bytes()) else { panic!("there is no room for so many") };
        assert!(error.to_string().contains("4000000000 of `vertex` need at least"), "{error}");
        assert!(
            message("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n")
                .contains("no property `y`")
        );
        let faces = "element face 1\nproperty list uchar int corners\nend_header\n0 0 0\n1 0 0\n1 1 0 9 9\n3 0 1 2\n";
        assert!(message(&format!("{header}{faces}")).contains("no list `vertex_indices`"));
    }

    #[test]
    fn strips_become_triangles() {
        let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty int x\nproperty short y\nproperty double z\n\
                    element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
                    0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0 too many\n9 0 1 2 3 -1 1 3 3 4\n";
        let mesh = parse("t.ply", text.as_bytes()).expect("valid").mesh;
        assert_eq!(mesh.faces.iter().collect::<Vec<_>>(), [[0, 1, 2], [2, 1, 3]]);
    }

    #[test]
    fn elements_without_properties_take_no_time() {
        let text = "ply\nformat ascii 1.0\nelement nothing 999999999999999999\nend_header\n";
        assert_eq!(parse("t.ply", text.as_bytes()).expect("valid").mesh.points.len(), 0);
    }
}
