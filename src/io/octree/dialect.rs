//! What the three formats do differently: the header, the width of a node's numbers, and what a leaf says beside its signs.

use crate::error::Result;
use crate::grid::key::MAX_LEVEL;
use crate::io::bytes::Bytes;
use std::io::Read;

/// What stands before the nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Header {
    /// log2 of the number of cells a side.
    pub(super) depth: u32,
    /// Least corner and side of the cube in model units, where the format has them.
    pub(super) cube: Option<([f32; 3], f32)>,
}

/// A node of the octree without its children.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Node<L> {
    /// Eight children follow.
    Inner,
    /// A cell of any size without surface.
    Empty {
        /// Whether it is outside.
        is_outside: bool,
    },
    /// A cell with a sign for each corner.
    Leaf {
        /// Bit i: corner i is outside.
        outside: u8,
        /// What the format says beside.
        data: L,
    },
}

/// A format.
pub(super) trait Dialect {
    /// What a leaf says beside its signs.
    type Leaf: Copy + Default + Send;

    /// Reads the header.
    fn read_header<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Header>;

    /// Reads a node without its children.
    fn read_node<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<Node<Self::Leaf>>;

    /// Appends the header.
    fn write_header(header: Header, out: &mut Vec<u8>);

    /// Appends a node without its children.
    fn write_node(node: Node<&Self::Leaf>, out: &mut Vec<u8>);
}

/// Takes as many bytes as the array has.
#[inline]
pub(super) fn take<const N: usize, R: Read>(bytes: &mut Bytes<'_, R>) -> Result<[u8; N]> {
    match bytes.take()? {
        Some(taken) => Ok(taken),
        None => {
            Err(bytes.error("the octree ends before it is complete", "the file was cut short: copy or write it again"))
        }
    }
}

pub(super) fn take_i32<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<i32> {
    take(bytes).map(i32::from_le_bytes)
}

pub(super) fn take_f32<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<f32> {
    take(bytes).map(f32::from_le_bytes)
}

pub(super) fn take_vector<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<[f32; 3]> {
    let taken: [u8; 12] = take(bytes)?;
    Ok(std::array::from_fn(|i| f32::from_le_bytes(std::array::from_fn(|byte| taken[4 * i + byte]))))
}

pub(super) fn put_vector(vector: [f32; 3], out: &mut Vec<u8>) {
    vector.iter().for_each(|c| out.extend(c.to_le_bytes()));
}

/// Takes the number of cells a side and returns its log2.
pub(super) fn take_depth<R: Read>(bytes: &mut Bytes<'_, R>) -> Result<u32> {
    let cells = take_i32(bytes)?;
    match u32::try_from(cells) {
        Ok(cells) if cells.is_power_of_two() && cells <= 1 << MAX_LEVEL => Ok(cells.ilog2()),
        _ => Err(bytes.error(
            format!("a grid of {cells} cells a side, which is not a power of two up to {}", 1 << MAX_LEVEL),
            "the file is damaged or of another format",
        )),
    }
}

/// The number of cells a side as the headers have it.
pub(super) fn put_cells(depth: u32, out: &mut Vec<u8>) {
    out.extend((1i32 << depth).to_le_bytes());
}

/// The error for a node of no known type.
#[cold]
pub(super) fn unknown_type<T, R: Read>(bytes: &Bytes<'_, R>, kind: i32) -> Result<T> {
    let problem = format!("a node of type {kind}, but there are only 0 (divided), 1 (empty) and 2 (surface)");
    Err(bytes.error(problem, "the file is damaged or of another format"))
}
