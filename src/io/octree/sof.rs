//! SOF, the signed octree of PolyMender (Ju 2004; readme of version 1.6, section IV).
//!
//! ```text
//! int32 cells a side, then a node: byte 0, and eight nodes, child 4x + 2y + z
//!                                | byte 1, byte 0 inside or 1 outside
//!                                | byte 2, byte of signs: bit i is 1 where corner i is outside
//! ```

use super::dialect::{Dialect, Header, Node, put_cells, take, take_depth, unknown_type};
use crate::error::Result;
use crate::io::bytes::Bytes;
use std::io::Read;

/// The format.
pub(super) struct Sof;

impl Dialect for Sof {
    type Leaf = ();

    fn read_header<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Header> {
        Ok(Header { depth: take_depth(bytes)?, cube: None })
    }

    fn read_node<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Node<()>> {
        read_node(bytes, |_| Ok(()))
    }

    fn write_header(header: Header, out: &mut Vec<u8>) {
        put_cells(header.depth, out);
    }

    fn write_node(node: Node<&()>, out: &mut Vec<u8>) {
        write_node(&node, out);
    }
}

/// Reads a node as SOF and SOG have it; `data` reads what stands behind the signs of a leaf.
pub(super) fn read_node<L, R: Read>(
    bytes: &mut Bytes<'_, R>,
    data: impl FnOnce(&mut Bytes<'_, R>) -> Result<L>,
) -> Result<Node<L>> {
    Ok(match take(bytes)? {
        [0] => Node::Inner,
        [1] => Node::Empty { is_outside: take(bytes)? != [0] },
        [2] => {
            let [outside] = take(bytes)?;
            Node::Leaf { outside, data: data(bytes)? }
        }
        [kind] => return unknown_type(bytes, kind.into()),
    })
}

/// Appends a node as SOF and SOG have it, without what stands behind the signs of a leaf.
pub(super) fn write_node<L>(node: &Node<L>, out: &mut Vec<u8>) {
    match *node {
        Node::Inner => out.push(0),
        Node::Empty { is_outside } => out.extend([1, u8::from(is_outside)]),
        Node::Leaf { outside, .. } => out.extend([2, outside]),
    }
}
