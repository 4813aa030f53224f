//! DCF, the signed octree with Hermite samples for dual contouring programs (Ju).
//!
//! ```text
//! byte 0  "multisign" and a zero, three times int32 cells a side, then a node:
//!         int32 0, and eight nodes, child 4x + 2y + z
//!       | int32 1, int16 sign
//!       | int32 2, int16 sign for each corner, then for each of the 12 edges: int32 0, or
//!         int32 1, float32 offset from the low end (0 to 1), float32 x, y, z of the normal
//! ```
//!
//! The readme says that a sign of 0 means inside; the program that wrote these files, and the one that reads them, take 1 for INSIDE.
//! That is what is read and written here. Normals point outward. Edges are numbered as in [`Edge`](crate::grid::Edge): those along x, y,
//! z, each by their start.

use super::dialect::{
    Dialect, Header, Node, put_cells, put_vector, take, take_depth, take_f32, take_i32, take_vector, unknown_type,
};
use crate::error::Result;
use crate::io::bytes::Bytes;
use std::io::Read;

/// The format.
pub(super) struct Dcf;

/// The first bytes of every file.
pub(super) const MAGIC: &[u8; 10] = b"multisign\0";

/// Where the surface crosses an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hermite {
    /// Distance from the low end, in cells.
    pub(super) offset: f32,
    /// The unit normal, outward.
    pub(super) normal: [f32; 3],
}

impl Dialect for Dcf {
    /// By the number of the edge.
    type Leaf = [Option<Hermite>; 12];

    fn read_header<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Header> {
        if take(bytes)? != *MAGIC {
            return Err(bytes.error("the file does not begin with \"multisign\"", "it is damaged or of another format"));
        }
        let [depth, y, z] = [take_depth(bytes)?, take_depth(bytes)?, take_depth(bytes)?];
        if depth != y || depth != z {
            return Err(bytes.error("the grid is not a cube", "only cubes are known"));
        }
        Ok(Header { depth, cube: None })
    }

    fn read_node<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Node<Self::Leaf>> {
        Ok(match take_i32(bytes)? {
            0 => Node::Inner,
            1 => Node::Empty { is_outside: take(bytes)? == [0, 0] },
            2 => {
                let signs: [u8; 16] = take(bytes)?;
                let outside = (0..8).fold(0, |mask, i| mask | u8::from(signs[2 * i..][..2] == [0, 0]) << i);
                let mut data = Self::Leaf::default();
                for edge in &mut data {
                    *edge = read_edge(bytes)?;
                }
                Node::Leaf { outside, data }
            }
            kind => return unknown_type(bytes, kind),
        })
    }

    fn write_header(header: Header, out: &mut Vec<u8>) {
        out.extend(MAGIC);
        (0..3).for_each(|_| put_cells(header.depth, out));
    }

    fn write_node(node: Node<&Self::Leaf>, out: &mut Vec<u8>) {
        match node {
            Node::Inner => out.extend(0i32.to_le_bytes()),
            Node::Empty { is_outside } => {
                out.extend(1i32.to_le_bytes());
                out.extend(i16::from(!is_outside).to_le_bytes());
            }
            Node::Leaf { outside, data } => {
                out.extend(2i32.to_le_bytes());
                (0..8).for_each(|i| out.extend(i16::from(outside >> i & 1 == 0).to_le_bytes()));
                for edge in data {
                    out.extend(i32::from(edge.is_some()).to_le_bytes());
                    if let Some(Hermite { offset, normal }) = edge {
                        out.extend(offset.to_le_bytes());
                        put_vector(*normal, out);
                    }
                }
            }
        }
    }
}

fn read_edge<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Option<Hermite>> {
    match take_i32(bytes)? {
        0 => return Ok(None),
        1 => {}
        count => return Err(bytes.error(format!("an edge with {count} samples"), "only 0 and 1 are known")),
    }
    let (offset, normal) = (take_f32(bytes)?, take_vector(bytes)?);
    if !((0.0..=1.0).contains(&offset) && normal.iter().all(|c| c.is_finite())) {
        let problem = format!("a sample {offset} of the way along its edge with normal {normal:?}");
        return Err(bytes.error(problem, "ways from 0 to 1 and finite normals are known"));
    }
    Ok(Some(Hermite { offset, normal }))
}
