//! Binary little-endian PLY from a mesh.

use super::super::encode::{Encoder, Out, Precision};
use crate::error::Result;
use crate::mesh::MeshSizes;
use glam::DVec3;
use std::fmt::Write;

/// Encodes points as three floats or doubles, faces as a list of integers counted by one byte.
#[derive(Debug)]
pub(in crate::io) struct PlyEncoder {
    precision: Precision,
    /// Whether no face has more than 255 corners, so that one byte counts them.
    has_short_faces: bool,
}

impl PlyEncoder {
    /// `most_corners` is the most that a face may have.
    pub(in crate::io) fn new(precision: Precision, most_corners: usize) -> Self {
        PlyEncoder { precision, has_short_faces: most_corners <= 255 }
    }
}

/// The header of a PLY file.
pub(in crate::io) fn write_header(
    encoding: &str,
    sizes: MeshSizes,
    precision: Precision,
    has_short_faces: bool,
) -> String {
    let float = if precision == Precision::Single { "float" } else { "double" };
    let count = if has_short_faces { "uchar" } else { "uint" };
    let index = if sizes.points <= 1 << 31 { "int" } else { "uint" };
    let mut header = format!("ply\nformat {encoding} 1.0\ncomment zmend\nelement vertex {}\n", sizes.points);
    for axis in ["x", "y", "z"] {
        let _ = writeln!(header, "property {float} {axis}");
    }
    let _ = writeln!(header, "element face {}\nproperty list {count} {index} vertex_indices\nend_header", sizes.faces);
    header
}

impl Encoder for PlyEncoder {
    fn begin(&mut self, sizes: MeshSizes, out: &mut Out) -> Result<()> {
        out.push(write_header("binary_little_endian", sizes, self.precision, self.has_short_faces).as_bytes());
        Ok(())
    }

    fn points(&mut self, points: &[DVec3], out: &mut Out) {
        match self.precision {
            Precision::Single => {
                let (rooms, _) = out.room(12 * points.len()).as_chunks_mut::<12>();
                for (room, point) in rooms.iter_mut().zip(points) {
                    let [x, y, z] = point.as_vec3().to_array().map(f32::to_le_bytes);
                    *room = [x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3], z[0], z[1], z[2], z[3]];
                }
                out.advance(12 * points.len());
            }
            Precision::Double => {
                let (rooms, _) = out.room(24 * points.len()).as_chunks_mut::<8>();
                let values = points.iter().flat_map(DVec3::to_array);
                rooms.iter_mut().zip(values).for_each(|(room, value)| *room = value.to_le_bytes());
                out.advance(24 * points.len());
            }
        }
    }

    fn faces(&mut self, arity: usize, corners: &[u32], out: &mut Out) -> Result<()> {
        match arity {
            3 if self.has_short_faces => {
                push_triangles(corners, out);
                return Ok(());
            }
            4 if self.has_short_faces => {
                push_quads(corners, out);
                return Ok(());
            }
            _ => {}
        }
        for face in corners.chunks_exact(arity) {
            let count = (arity as u32).to_le_bytes();
            out.push(if self.has_short_faces { &count[..1] } else { &count });
            let (rooms, _) = out.room(4 * arity).as_chunks_mut();
            rooms.iter_mut().zip(face).for_each(|(room, corner)| *room = corner.to_le_bytes());
            out.advance(4 * arity);
        }
        Ok(())
    }
}

/// Each record of 13 bytes is one store of 16; the next one overwrites the three bytes too many.
fn push_triangles(corners: &[u32], out: &mut Out) {
    const RECORD: usize = 13;
    const STORE: usize = size_of::<u128>();

    let (triangles, _) = corners.as_chunks::<3>();
    let bytes = RECORD * triangles.len();
    let mut room = out.room(bytes + STORE);
    for &[a, b, c] in triangles {
        let record = 3 | u128::from(a) << 8 | u128::from(b) << 40 | u128::from(c) << 72;
        room[..STORE].copy_from_slice(&record.to_le_bytes());
        room = &mut room[RECORD..];
    }
    out.advance(bytes);
}

/// The same for records of 17 bytes: the count, and one store of 16.
fn push_quads(corners: &[u32], out: &mut Out) {
    const RECORD: usize = 17;

    let (quads, _) = corners.as_chunks::<4>();
    let bytes = RECORD * quads.len();
    let (rooms, _) = out.room(bytes).as_chunks_mut::<RECORD>();
    for (room, &[a, b, c, d]) in rooms.iter_mut().zip(quads) {
        let corners = u128::from(a) | u128::from(b) << 32 | u128::from(c) << 64 | u128::from(d) << 96;
        room[0] = 4;
        room[1..].copy_from_slice(&corners.to_le_bytes());
    }
    out.advance(bytes);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlapping_stores_give_plain_records() {
        let corners: Vec<u32> = (0..3000).map(|i: u32| i.wrapping_mul(0x9E37_79B9)).collect();
        let plain: Vec<u8> =
            corners.chunks(3).flat_map(|t| std::iter::once(3).chain(t.iter().flat_map(|c| c.to_le_bytes()))).collect();
        let mut out = Out::default();
        push_triangles(&corners[..1500], &mut out);
        push_triangles(&corners[1500..], &mut out);
        push_triangles(&[], &mut out);
        assert_eq!(out.bytes(), plain);

        let plain: Vec<u8> =
            corners.chunks(4).flat_map(|t| std::iter::once(4).chain(t.iter().flat_map(|c| c.to_le_bytes()))).collect();
        let mut out = Out::default();
        push_quads(&corners, &mut out);
        assert_eq!(out.bytes(), plain);
    }

    #[test]
    fn types_fit_the_sizes() {
        let header = |points, short| {
            write_header("ascii", MeshSizes { points, ..MeshSizes::default() }, Precision::Double, short)
        };
        assert!(header(1 << 31, true).contains("property double z\nelement face 0\nproperty list uchar int vertex"));
        assert!(header((1 << 31) + 1, false).contains("list uint uint"));
    }
}
