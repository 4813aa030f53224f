//! SOG, the signed octree with geometry that `PolyMender` writes and `TopoMender` reads (readme of version 1.6, section V).
//!
//! ```text
//! byte   0  "SOG.Format 1.0" and a zero
//!       15  float32 x, y, z of the least corner of the cube, and its side, in model units: not aligned
//!       31  zeros
//!      128  as SOF, but each leaf is followed by float32 x, y, z: a point of the surface in the cell, in model units
//! ```

use super::dialect::{Dialect, Header, Node, put_cells, put_vector, take, take_depth, take_f32, take_vector};
use super::sof;
use crate::error::Result;
use crate::io::bytes::Bytes;
use std::io::Read;

/// The format.
pub(super) struct Sog;

/// The first bytes of every file.
pub(super) const MAGIC: &[u8; 15] = b"SOG.Format 1.0\0";
/// Bytes before the octree.
const HEADER: usize = 128;

impl Dialect for Sog {
    type Leaf = [f32; 3];

    fn read_header<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Header> {
        const REST: usize = HEADER - 31;
        if take(bytes)? != *MAGIC {
            return Err(bytes.error("the file does not begin with \"SOG.Format 1.0\"", "only this version is known"));
        }
        let (corner, side) = (take_vector(bytes)?, take_f32(bytes)?);
        if !(corner.iter().all(|c| c.is_finite()) && side.is_finite() && side > 0.0) {
            let problem = format!("a cube of {side} units at {corner:?} is none");
            return Err(bytes.error(problem, "the header is damaged: write the file again"));
        }
        take::<REST, _>(bytes)?;
        Ok(Header { depth: take_depth(bytes)?, cube: Some((corner, side)) })
    }

    fn read_node<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Node<[f32; 3]>> {
        sof::read_node(bytes, |bytes| {
            let point = take_vector(bytes)?;
            if point.iter().all(|c| c.is_finite()) {
                Ok(point)
            } else {
                Err(bytes.error(format!("the point of a cell is not finite: {point:?}"), "write the file again"))
            }
        })
    }

    fn write_header(header: Header, out: &mut Vec<u8>) {
        let start = out.len();
        let (corner, side) = header.cube.expect("SOG files say where their cube is");
        out.extend(MAGIC);
        put_vector(corner, out);
        out.extend(side.to_le_bytes());
        out.resize(start + HEADER, 0);
        put_cells(header.depth, out);
    }

    fn write_node(node: Node<&[f32; 3]>, out: &mut Vec<u8>) {
        sof::write_node(&node, out);
        if let Node::Leaf { data, .. } = node {
            put_vector(*data, out);
        }
    }
}
