//! Nodes to bricks: one walk over the file, no recursion and no stack, because the cell that follows another is arithmetic on keys.
//!
//! A point of the lattice belongs to the brick of the cell of which it is the least corner, so every brick gets its signs from its own
//! cells, and from its own cells it knows which edges are crossed. What the cells say of their other corners is kept until
//! [`check`](super::check) has compared it with what the neighbours say.
//!
//! Memory: 520 bytes a brick that is not of one sign, 16 bytes an empty node of at least 8 cells a side.

use super::OctreeInfo;
use super::coarse::MOST_CELLS;
use super::dialect::{Dialect, Header, Node};
use crate::error::Result;
use crate::grid::brick::{Local, Plane};
use crate::grid::key::SIDE;
use crate::grid::{Corner, Key};
use crate::io::bytes::Bytes;
use crate::octree::cells::transposed;
use crate::progress::{Progress, Stage, check};
use std::io::Read;

/// Least depth of a grid of bricks. Smaller files are taken as the least corner of one.
const LEAST_DEPTH: u32 = 3;
/// Nodes between two looks at whether to go on.
const OFTEN: u64 = 1 << 14;

/// What the nodes of a file say.
#[derive(Debug)]
pub(super) struct Decoded {
    /// log2 of the number of cells a side of the grid: that of the file, but at least 3.
    pub(super) depth: u32,
    /// Number of cells a side of the file.
    pub(super) cells: u32,
    /// Bricks with both signs, in order.
    pub(super) bricks: Vec<Divided>,
    /// Cells of one sign, of the size of a brick or larger, and whether they are inside, in order.
    pub(super) uniform: Vec<(Key, bool)>,
    /// Surface cells above the finest level with corners of both signs, a bit for each that is inside.
    pub(super) coarse: Vec<(Key, u8)>,
    /// What is known of each brick, if not all are as the file has them.
    pub(super) sources: Option<Vec<Source>>,
}

/// Where a brick comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    /// It is that number of the file's.
    File(u32),
    /// It holds cells that were divided.
    Unknown,
    /// It lies beside the file's cube.
    Beside,
}

/// A brick with both signs.
#[derive(Debug)]
pub(super) struct Divided {
    pub(super) key: Key,
    /// For each corner, the cells whose corner is inside.
    pub(super) corners: [Plane; 8],
}

impl Divided {
    /// The crossed edges along x, y, z, each at its start.
    pub(super) fn crossed(&self) -> [Plane; 3] {
        [4, 2, 1].map(|end: usize| self.corners[0] ^ self.corners[end])
    }
}

/// Takes a brick that is complete, with its leaves and what they say.
pub(super) type Keep<'a, L> = dyn FnMut(&Divided, &Plane, &[L; 512]) + 'a;

/// Reads all nodes. Passes each brick with both signs to `keep`, with its leaves and what they say.
pub(super) fn decode<D: Dialect, R: Read>(
    bytes: &mut Bytes<'_, R>,
    header: Header,
    info: &mut OctreeInfo,
    keep: &mut Keep<'_, D::Leaf>,
    progress: &dyn Progress,
) -> Result<Decoded> {
    info.depth = header.depth;
    progress.begin(Stage::Read, bytes.left());
    let mut told = bytes.position();
    let depth = header.depth.max(LEAST_DEPTH);
    let root = Key::cell(depth - header.depth, [0; 3]).expect("the least corner of the grid");
    let mut decoder = Decoder::<D> {
        made: Decoded {
            depth,
            cells: 1 << header.depth,
            bricks: Vec::new(),
            uniform: Vec::new(),
            coarse: Vec::new(),
            sources: None,
        },
        brick: None,
        leaves: Plane::EMPTY,
        inside: [0; 512],
        has_coarse: false,
        data: Box::new([D::Leaf::default(); 512]),
        keep,
    };
    let mut next = Some(root);
    let (mut nodes, mut coarse) = (0u64, 0u64);
    while let Some(cell) = next {
        nodes += 1;
        if nodes.is_multiple_of(OFTEN) {
            check(progress)?;
            progress.advance(bytes.position() - told);
            told = bytes.position();
        }
        let is_finest = cell.level() == Some(depth);
        next = match D::read_node(bytes)? {
            Node::Inner if is_finest => {
                return Err(bytes.error("a cell of the finest level is divided", "the file is damaged"));
            }
            Node::Inner => Some(cell.child(Corner::MIN)),
            Node::Empty { is_outside } => {
                info.empty_cells += 1;
                decoder.empty(cell, !is_outside);
                after(cell, root)
            }
            Node::Leaf { outside, data } => {
                info.surface_cells += 1;
                match outside {
                    0 => info.surface_cells_inside += 1,
                    255 => info.surface_cells_outside += 1,
                    _ => {}
                }
                if is_finest {
                    decoder.leaf(cell, !outside, data);
                } else if [0, 255].contains(&outside) {
                    decoder.empty(cell, outside == 0);
                } else {
                    coarse += 1 << (3 * (depth - cell.level().expect("cells have levels")));
                    if coarse > MOST_CELLS {
                        let problem = "surface cells above the finest level would be divided into too many";
                        return Err(bytes.error(problem, "write the octree with surface cells at the finest level"));
                    }
                    decoder.coarse(cell, !outside);
                }
                after(cell, root)
            }
        };
    }
    decoder.finish_brick();
    progress.advance(bytes.position() - told);
    Ok(decoder.made)
}

/// The cell after `cell` and all it holds, in a walk over `root`.
fn after(mut cell: Key, root: Key) -> Option<Key> {
    while cell != root {
        let parent = cell.parent()?;
        if let Some(&corner) = Corner::ALL.get(cell.corner_in_parent().index() + 1) {
            return Some(parent.child(corner));
        }
        cell = parent;
    }
    None
}

/// Where in its brick a cell lies.
#[inline]
fn at(depth: u32, cell: Key) -> Local {
    let finest = SIDE.ilog2() - depth;
    Local::from_order(cell.code_inside(Corner::MIN) >> (3 * finest))
}

/// Adds the corners of leaves that are inside to the planes of a brick: a row of eight cells is a matrix of 8 x 8 bits, transposed.
fn spread(leaves: &Plane, inside: &[u8; 512], corners: &mut [Plane; 8]) {
    for (i, row) in inside.as_chunks::<8>().0.iter().enumerate() {
        let (x, shift) = (i >> 3, 8 * (i & 7));
        let there = leaves.0[x] >> shift & 0xff;
        if there != 0 {
            let by_corner = transposed(u64::from_le_bytes(*row)).to_le_bytes();
            for (plane, bits) in corners.iter_mut().zip(by_corner) {
                plane.0[x] |= (u64::from(bits) & there) << shift;
            }
        }
    }
}

struct Decoder<'a, 'k, D: Dialect> {
    made: Decoded,
    /// The brick that is being read.
    brick: Option<Divided>,
    /// Its leaves at the finest level.
    leaves: Plane,
    /// For each of them the corners that are inside; stale for other cells.
    inside: [u8; 512],
    /// Whether it holds cells that are to be divided.
    has_coarse: bool,
    /// What they say; stale for other cells.
    data: Box<[D::Leaf; 512]>,
    keep: &'a mut Keep<'k, D::Leaf>,
}

impl<D: Dialect> Decoder<'_, '_, D> {
    /// Takes a cell of one sign.
    fn empty(&mut self, cell: Key, is_inside: bool) {
        let depth = self.made.depth;
        let level = cell.level().expect("cells have levels");
        if level + 3 <= depth {
            self.finish_brick();
            self.made.uniform.push((cell, is_inside));
            return;
        }
        let (brick, at) = self.brick_around(cell);
        if is_inside {
            let cube = Plane::cube(at, 1 << (depth - level));
            brick.corners.iter_mut().for_each(|plane| *plane |= cube);
        }
    }

    /// Takes a larger cell with corners of both signs; `inside` has a bit for each.
    fn coarse(&mut self, cell: Key, inside: u8) {
        if cell.level().expect("cells have levels") + 3 <= self.made.depth {
            self.finish_brick();
        } else {
            self.brick_around(cell);
            self.has_coarse = true;
        }
        self.made.coarse.push((cell, inside));
    }

    /// Takes a cell of the finest level; `inside` has a bit for each corner.
    fn leaf(&mut self, cell: Key, inside: u8, data: D::Leaf) {
        let (_, at) = self.brick_around(cell);
        self.inside[at.index() as usize] = inside;
        self.leaves.set(at);
        self.data[at.index() as usize] = data;
    }

    /// The brick that holds a cell, and where in it the cell lies.
    fn brick_around(&mut self, cell: Key) -> (&mut Divided, Local) {
        let key = cell.ancestor(self.made.depth - 3);
        if self.brick.as_ref().is_none_or(|brick| brick.key != key) {
            self.finish_brick();
            self.leaves = Plane::EMPTY;
        }
        let brick = self.brick.get_or_insert(Divided { key, corners: [Plane::EMPTY; 8] });
        (brick, self::at(self.made.depth, cell))
    }

    /// Puts down the brick that is being read, if there is any.
    fn finish_brick(&mut self) {
        let Some(mut brick) = self.brick.take() else { return };
        spread(&self.leaves, &self.inside, &mut brick.corners);
        let has_coarse = std::mem::take(&mut self.has_coarse);
        if !has_coarse
            && [Plane::EMPTY, Plane::FULL].contains(&brick.corners[0])
            && brick.corners == [brick.corners[0]; 8]
        {
            self.made.uniform.push((brick.key, !brick.corners[0].is_empty()));
            return;
        }
        (self.keep)(&brick, &self.leaves, &self.data);
        self.made.bricks.push(brick);
    }
}
