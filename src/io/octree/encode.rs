//! Bricks to nodes: the file is written as it is made, in the order of the bricks, which is that of a depth-first walk.
//!
//! Surface cells, the leaves of the file, are the finest cells with corners of both signs. Everything else is covered by the fewest
//! empty nodes. Above the bricks the walk is a recursion of at most 15 levels; each node hands the signs of its eight corners to its
//! parent, so that the sign of an empty node, which is that of the parent's middle, is known when it is written. What is below a brick is
//! encoded in parallel, some hundred bricks ahead of the walk.

use super::dialect::{Dialect, Header, Node};
use crate::error::Result;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Corner, Key};
use crate::io::file::AtomicFile;
use crate::octree::SignedOctree;
use crate::octree::cells::Cells;
use crate::progress::{Progress, Stage, check};
use rayon::prelude::*;
use std::path::Path;

/// Bricks encoded at once by one thread.
const BATCH: usize = 32;
/// Batches encoded before they are written.
const AHEAD: usize = 16;
/// Bytes gathered before they are written.
const CHUNK: usize = 1 << 18;

/// Makes what the leaves of some bricks say beside their signs: brick by brick, in the order of [`Local`].
pub(super) type Leaves<'a, L> = dyn Fn(&[u32], &mut Vec<L>) + Sync + 'a;

/// Writes a file; returns its size.
pub(super) fn encode<D: Dialect>(
    path: &Path,
    octree: &SignedOctree,
    header: Header,
    leaves: &Leaves<'_, D::Leaf>,
    progress: &dyn Progress,
) -> Result<u64> {
    let bricks = octree.crossings().bricks();
    let surface: Vec<u32> =
        (0..bricks.len()).into_par_iter().filter(|&i| !octree.mixed_cells(i).is_empty()).map(|i| i as u32).collect();
    progress.begin(Stage::Write, surface.len() as u64);
    let mut out = Vec::new();
    D::write_header(header, &mut out);
    let file = AtomicFile::create(path)?;
    let encoded = Vec::new().into_iter();
    let mut encoder = Encoder::<D> { octree, leaves, progress, ahead: &surface, encoded, file, out, written: 0 };
    // The corner of the grid is outside.
    encoder.node(Key::ROOT, &surface, true)?;
    encoder.flush()?;
    encoder.file.commit()?;
    Ok(encoder.written)
}

struct Encoder<'a, D: Dialect> {
    octree: &'a SignedOctree,
    leaves: &'a Leaves<'a, D::Leaf>,
    progress: &'a dyn Progress,
    /// Bricks that are not encoded yet.
    ahead: &'a [u32],
    /// Bricks that are not written yet, in order.
    encoded: std::vec::IntoIter<EncodedBrick>,
    file: AtomicFile,
    out: Vec<u8>,
    written: u64,
}

/// The nodes of a brick.
struct EncodedBrick {
    bytes: Vec<u8>,
    /// The corners of the brick that are outside.
    outside: u8,
}

impl<D: Dialect> Encoder<'_, D> {
    /// Writes a cell of at least the size of a brick, of which the bricks with surface are given, and whether its least corner is
    /// outside. Returns which of its corners are.
    fn node(&mut self, cell: Key, mut surface: &[u32], is_outside: bool) -> Result<u8> {
        if surface.is_empty() {
            D::write_node(Node::Empty { is_outside }, &mut self.out);
            return Ok(if is_outside { 255 } else { 0 });
        }
        let crossings = self.octree.crossings();
        if cell.level() == Some(crossings.depth() - 3) {
            let brick = self.next_brick()?;
            self.out.extend(brick.bytes);
            if self.out.len() >= CHUNK {
                self.flush()?;
            }
            return Ok(brick.outside);
        }
        D::write_node(Node::Inner, &mut self.out);
        let mut least = 0;
        let mut outside = 0;
        for corner in Corner::ALL {
            let child = cell.child(corner);
            let of_child = surface.partition_point(|&i| child.contains(crossings.bricks()[i as usize].key));
            let (here, others) = surface.split_at(of_child);
            surface = others;
            let (bit, is_first) = (1 << corner.index(), corner == Corner::MIN);
            // An empty child has the sign of the middle, others that of their least corner: both are corners of the first.
            let known = if here.is_empty() { least >> 7 == 1 } else { least & bit != 0 };
            let of_child = self.node(child, here, if is_first { is_outside } else { known })?;
            if is_first {
                least = of_child;
            }
            outside |= of_child & bit;
        }
        Ok(outside)
    }

    /// The next brick in order.
    fn next_brick(&mut self) -> Result<EncodedBrick> {
        if let Some(brick) = self.encoded.next() {
            return Ok(brick);
        }
        check(self.progress)?;
        let (now, later) = self.ahead.split_at(self.ahead.len().min(BATCH * AHEAD));
        self.ahead = later;
        let (octree, leaves) = (self.octree, self.leaves);
        let encode = |batch: &[u32]| {
            let mut data = Vec::new();
            leaves(batch, &mut data);
            let mut data = data.as_slice();
            let of_brick = |&i: &u32| {
                let cells = Cells::new(octree, i as usize);
                let (here, others) = data.split_at(cells.mixed().count() as usize);
                data = others;
                BrickEncoder::<D> { mixed: cells.mixed(), inside: &octree.inside()[i as usize], data: here, cells }
                    .encode()
            };
            batch.iter().map(of_brick).collect::<Vec<_>>()
        };
        let encoded: Vec<EncodedBrick> = now.par_chunks(BATCH).flat_map_iter(encode).collect();
        self.progress.advance(encoded.len() as u64);
        self.encoded = encoded.into_iter();
        Ok(self.encoded.next().expect("as many bricks are encoded as the walk meets"))
    }

    fn flush(&mut self) -> Result<()> {
        self.file.write(&self.out)?;
        self.written += self.out.len() as u64;
        self.out.clear();
        Ok(())
    }
}

struct BrickEncoder<'a, D: Dialect> {
    cells: Cells<'a>,
    mixed: Plane,
    inside: &'a Plane,
    /// For each mixed cell.
    data: &'a [D::Leaf],
}

impl<D: Dialect> BrickEncoder<'_, D> {
    fn encode(&self) -> EncodedBrick {
        let mut bytes = Vec::new();
        self.node(Local::new(0, 0, 0), 8, &mut bytes);
        // Corner i of the brick is corner i of its cell there.
        let is_outside = |corner: Corner| {
            let [x, y, z] = crate::grid::Axis::ALL.map(|a| 7 * u32::from(corner.is_high(a)));
            self.cells.mask(Local::new(x, y, z)) >> corner.index() & 1 == 0
        };
        let outside = Corner::ALL.into_iter().filter(|&c| is_outside(c)).fold(0, |mask, c| mask | 1 << c.index());
        EncodedBrick { bytes, outside }
    }

    /// Writes the cell of `side` finest cells at `at`.
    fn node(&self, at: Local, side: u32, out: &mut Vec<u8>) {
        if (self.mixed & Plane::cube(at, side)).is_empty() {
            D::write_node(Node::Empty { is_outside: !self.inside.get(at) }, out);
        } else if side == 1 {
            let data = &self.data[self.mixed.rank(at) as usize];
            D::write_node(Node::Leaf { outside: !self.cells.mask(at), data }, out);
        } else {
            D::write_node(Node::Inner, out);
            let half = side / 2;
            for corner in Corner::ALL {
                // All coordinates are multiples of the side: adding half is setting bits.
                let [x, y, z] = at.coords();
                let step = |axis| half * u32::from(corner.is_high(axis));
                let [dx, dy, dz] = crate::grid::Axis::ALL.map(step);
                self.node(Local::new(x + dx, y + dy, z + dz), half, out);
            }
        }
    }
}
