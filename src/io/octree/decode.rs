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
use crate::error::{Error, Result};
use crate::grid::brick::{Local, Plane};
use crate::grid::key::SIDE;
use crate::grid::{Corner, Extent, Key};
use crate::io::bytes::Bytes;
use crate::octree::cells::transposed;
use crate::octree::crossings::owned;
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
        filled: Plane::EMPTY,
        inside: [0; 512],
        has_coarse: false,
        divided: 0,
        data: Box::new([D::Leaf::default(); 512]),
        keep,
    };
    let (mut next, mut nodes, mut looked) = (Some(root), 0u64, 0);
    while let Some(cell) = next {
        nodes += 1;
        if nodes >= looked + OFTEN {
            looked = nodes;
            check(progress)?;
            progress.advance(bytes.position() - told);
            told = bytes.position();
        }
        let is_finest = cell.level() == Some(depth);
        next = match D::read_node(bytes)? {
            Node::Inner if is_finest => return Err(divided(bytes)),
            Node::Inner if cell.level() == Some(depth - 3) => {
                nodes += decoder.nodes_of_brick(bytes, cell, info)?;
                after(cell, root)
            }
            Node::Inner => Some(cell.child(Corner::MIN)),
            Node::Empty { is_outside } => {
                info.empty_cells += 1;
                decoder.empty(cell, !is_outside);
                after(cell, root)
            }
            Node::Leaf { outside, data } => {
                count_leaf(info, outside);
                if is_finest {
                    decoder.leaf(cell, !outside, data);
                } else {
                    decoder.large(bytes, cell, !outside)?;
                }
                after(cell, root)
            }
        };
    }
    decoder.finish_brick();
    progress.advance(bytes.position() - told);
    Ok(decoder.made)
}

/// The error for a finest cell that is an inner node.
#[cold]
fn divided<R: Read>(bytes: &Bytes<'_, R>) -> Error {
    bytes.error("a cell of the finest level is divided", "the file is damaged")
}

fn count_leaf(info: &mut OctreeInfo, outside: u8) {
    info.surface_cells += 1;
    info.surface_cells_inside += u64::from(outside == 0);
    info.surface_cells_outside += u64::from(outside == 255);
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
    /// Its cells that are inside as a whole.
    filled: Plane,
    /// For each of them the corners that are inside; stale for other cells.
    inside: [u8; 512],
    /// Whether it holds cells that are to be divided.
    has_coarse: bool,
    /// Finest cells that come of dividing larger ones.
    divided: u64,
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
        let at = self.brick_around(cell);
        if is_inside {
            self.fill(at, 1 << (3 * (depth - level)));
        }
    }

    /// Takes as many cells of the brick that is being read, a cube, as inside.
    fn fill(&mut self, at: Local, cells: u32) {
        self.filled |= Plane::cube(at, 1 << (cells.ilog2() / 3));
    }

    /// Takes the nodes inside of a brick, which come in its Z-order, and returns how many there are.
    fn nodes_of_brick<R: Read>(&mut self, bytes: &mut Bytes<'_, R>, key: Key, info: &mut OctreeInfo) -> Result<u64> {
        let depth = self.made.depth;
        self.begin_brick(key);
        let mut nodes = 0;
        // The place of the next node in the order, and how many finest cells it has.
        let (mut place, mut cells) = (0u32, 64u32);
        while place < 512 {
            nodes += 1;
            let at = Local::from_order(place.into());
            match D::read_node(bytes)? {
                Node::Inner if cells == 1 => return Err(divided(bytes)),
                Node::Inner => {
                    cells /= 8;
                    continue;
                }
                Node::Empty { is_outside } => {
                    info.empty_cells += 1;
                    if !is_outside {
                        self.fill(at, cells);
                    }
                }
                Node::Leaf { outside, data } => {
                    count_leaf(info, outside);
                    if cells == 1 {
                        self.put_leaf(at, !outside, data);
                    } else {
                        let brick = owned(depth, key, at, Extent::CELL);
                        self.large(bytes, brick.ancestor(depth - cells.ilog2() / 3), !outside)?;
                    }
                }
            }
            place += cells;
            while cells < 64 && place.is_multiple_of(8 * cells) {
                cells *= 8;
            }
        }
        Ok(nodes)
    }

    /// Takes a surface cell above the finest level; `inside` has a bit for each corner.
    fn large<R: Read>(&mut self, bytes: &Bytes<'_, R>, cell: Key, inside: u8) -> Result<()> {
        if [0, 255].contains(&inside) {
            self.empty(cell, inside == 255);
            return Ok(());
        }
        self.divided += 1 << (3 * (self.made.depth - cell.level().expect("cells have levels")));
        if self.divided > MOST_CELLS {
            let problem = "surface cells above the finest level would be divided into too many";
            return Err(bytes.error(problem, "write the octree with surface cells at the finest level"));
        }
        self.coarse(cell, inside);
        Ok(())
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
        let at = self.brick_around(cell);
        self.put_leaf(at, inside, data);
    }

    /// The same, given where in the brick that is being read it lies.
    #[inline]
    fn put_leaf(&mut self, at: Local, inside: u8, data: D::Leaf) {
        self.inside[at.index() as usize] = inside;
        self.leaves.set(at);
        self.data[at.index() as usize] = data;
    }

    /// Begins the brick that holds a cell, unless that is being read; where in it the cell lies.
    fn brick_around(&mut self, cell: Key) -> Local {
        let key = cell.ancestor(self.made.depth - 3);
        if self.brick.as_ref().is_none_or(|brick| brick.key != key) {
            self.begin_brick(key);
        }
        self::at(self.made.depth, cell)
    }

    fn begin_brick(&mut self, key: Key) {
        self.finish_brick();
        (self.leaves, self.filled) = (Plane::EMPTY, Plane::EMPTY);
        self.brick = Some(Divided { key, corners: [Plane::EMPTY; 8] });
    }

    /// Puts down the brick that is being read, if there is any.
    fn finish_brick(&mut self) {
        let Some(mut brick) = self.brick.take() else { return };
        brick.corners = [self.filled; 8];
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
