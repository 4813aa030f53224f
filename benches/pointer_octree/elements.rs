//! The cell complex of a tree whose leaves fill the root: which elements there are, and where what is known of them is kept.
//!
//! A face is an element if both cells beside it are leaves, an edge if all four are, a point if all eight are (Zhou, Ju and Hu 2007). So a
//! large leaf's face may be many elements. What is known of an element is kept in the smallest leaf beside it, the first one of these: of
//! that leaf, it is a whole face, edge or corner.
//!
//! The words of a leaf, from here on:
//!
//! ```text
//! a      12 .. 20  corners that are inside, as before     40 .. 45  log2 of its side, in finest cells
//!        48 .. 64  step of thinning in which something changed last
//! b      two bits for each corner, edge, face and the cell, 27 in all: 0 there, 1 gone, 2 or 3 gone in the last step or this one
//! vertex its place: the coordinates of its least corner, 10 bits each
//! ```

use super::node::{Leaf, Link, Memory, Node, Tree};
use super::sign::CORNERS;
use super::traverse::{BIT, OTHERS};
use std::cell::Cell;
use zmend::glam::Vec3;
use zmend::grid::{Edge, Face};

/// What a leaf keeps beside: the records of its faces, if one has any.
#[derive(Default)]
pub(crate) struct Beside<'a> {
    pub(crate) records: Cell<Option<&'a Records>>,
}

/// How a face was removed with an edge, for each face of a leaf.
#[derive(Default)]
pub(crate) struct Records(pub(crate) [Cell<Record>; 6]);

/// The area that has been collapsed into a face, and the edge it was removed with.
#[derive(Clone, Copy)]
pub(crate) struct Record {
    /// Square finest cells.
    pub(crate) weight: f32,
    /// Bit 12: there is one; bit 11: along the second of the face's axes; bit 10: on the high side; below: where it starts along its axis.
    pub(crate) retrace: u32,
}

impl Default for Record {
    fn default() -> Self {
        Record { weight: 0.0, retrace: 0 }
    }
}

pub(crate) type TopoNode<'a> = Node<'a, Beside<'a>>;
pub(crate) type TopoLeaf<'a> = Leaf<Beside<'a>>;
pub(crate) type TopoLink<'a> = Link<'a, Beside<'a>>;
pub(crate) type TopoTree<'a> = Tree<'a, Beside<'a>>;
pub(crate) type TopoMemory<'a> = Memory<'a, Beside<'a>>;

const _: () = assert!(size_of::<TopoNode<'_>>() == 32 && size_of::<Records>() == 48);

/// The greatest depth: coordinates have 10 bits.
pub(crate) const MAX_DEPTH: u32 = 10;

/// An element's tag: two bits of the word `b` of a leaf.
#[derive(Clone, Copy)]
pub(crate) struct Slot<'a> {
    pub(crate) leaf: &'a TopoLeaf<'a>,
    shift: u32,
}

/// Tags of elements that are there, and that are gone for good.
pub(crate) const THERE: u64 = 0;
pub(crate) const GONE: u64 = 1;

impl Slot<'_> {
    #[inline]
    pub(crate) fn tag(self) -> u64 {
        self.leaf.b.get() >> self.shift & 3
    }

    #[inline]
    pub(crate) fn set(self, tag: u64) {
        self.leaf.b.set(self.leaf.b.get() & !(3 << self.shift) | tag << self.shift);
    }

    /// The number of an edge or a face in its leaf.
    #[inline]
    pub(crate) fn number(self) -> usize {
        match self.shift {
            FACE.. => (self.shift - FACE) as usize / 2,
            EDGE.. => (self.shift - EDGE) as usize / 2,
            _ => self.shift as usize / 2,
        }
    }

    /// The record of a face.
    pub(crate) fn record(self) -> Record {
        self.leaf.rest.records.get().map_or_else(Record::default, |records| records.0[self.number()].get())
    }
}

const EDGE: u32 = 16;
const FACE: u32 = 40;
const CELL: u32 = 52;

impl<'a> TopoLeaf<'a> {
    /// log2 of the side, in finest cells.
    #[inline]
    pub(crate) fn size(&self) -> u32 {
        (self.a.get() >> 40 & 31) as u32
    }

    /// The least corner, in finest cells.
    #[inline]
    pub(crate) fn at(&self) -> [u32; 3] {
        let at = self.vertex.get();
        [at >> 20, at >> 10 & 1023, at & 1023]
    }

    #[inline]
    pub(crate) fn stamp(&self) -> u32 {
        (self.a.get() >> 48) as u32
    }

    #[inline]
    pub(crate) fn set_stamp(&self, step: u32) {
        self.a.set(self.a.get() & !(0xffff << 48) | u64::from(step) << 48);
    }

    #[inline]
    pub(crate) fn cell(&'a self) -> Slot<'a> {
        Slot { leaf: self, shift: CELL }
    }

    /// The centre, in half finest cells.
    #[inline]
    pub(crate) fn centre(&self) -> Vec3 {
        let ([x, y, z], half) = (self.at(), 1 << self.size());
        Vec3::new((2 * x + half) as f32, (2 * y + half) as f32, (2 * z + half) as f32)
    }
}

/// Of some leaves the smallest, the first one of these, and its place.
#[inline]
fn owner<'a, const N: usize>(nodes: &[TopoLink<'a>; N]) -> Option<(&'a TopoLeaf<'a>, usize)> {
    let mut best: Option<(&TopoLeaf<'_>, usize)> = None;
    for (k, node) in nodes.iter().enumerate() {
        let leaf = node.and_then(Node::leaf)?;
        if best.is_none_or(|(other, _)| leaf.size() < other.size()) {
            best = Some((leaf, k));
        }
    }
    best
}

#[inline]
fn same<'a>(a: TopoLink<'a>, b: TopoLink<'a>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => std::ptr::eq(a, b),
        _ => false,
    }
}

/// The face between two leaves; none within one.
#[inline]
pub(crate) fn face_slot(axis: usize, nodes: [TopoLink<'_>; 2]) -> Option<Slot<'_>> {
    if same(nodes[0], nodes[1]) {
        return None;
    }
    let (leaf, k) = owner(&nodes)?;
    Some(Slot { leaf, shift: FACE + 2 * (2 * axis + 1 - k) as u32 })
}

/// The edge between four leaves; none within a face or a cell.
#[inline]
pub(crate) fn edge_slot(axis: usize, nodes: [TopoLink<'_>; 4]) -> Option<Slot<'_>> {
    let [a, b, c, d] = nodes;
    if (same(a, b) && same(c, d)) || (same(a, c) && same(b, d)) {
        return None;
    }
    let (leaf, k) = owner(&nodes)?;
    Some(Slot { leaf, shift: EDGE + 2 * (4 * axis + 3 - k) as u32 })
}

/// The point between eight leaves.
#[inline]
pub(crate) fn point_slot(nodes: [TopoLink<'_>; 8]) -> Option<Slot<'_>> {
    let (leaf, k) = owner(&nodes)?;
    Some(Slot { leaf, shift: 2 * (7 - k) as u32 })
}

/// The faces round an edge.
#[inline]
pub(crate) fn faces_round(axis: usize, [a, b, c, d]: [TopoLink<'_>; 4]) -> [Option<Slot<'_>>; 4] {
    let [u, v] = OTHERS[axis];
    [face_slot(v, [a, b]), face_slot(v, [c, d]), face_slot(u, [a, c]), face_slot(u, [b, d])]
}

/// The four nodes round the edge that leaves a point along an axis, down or up.
#[inline]
pub(crate) fn nodes_round<'a>(nodes: &[TopoLink<'a>; 8], axis: usize, up: bool) -> [TopoLink<'a>; 4] {
    let ([u, v], half) = (OTHERS[axis].map(|a| BIT[a]), if up { BIT[axis] } else { 0 });
    [nodes[half], nodes[half | v], nodes[half | u], nodes[half | u | v]]
}

/// The area of the quadrilateral through the centres of the leaves round an edge, in square finest cells.
pub(crate) fn dual_area(nodes: [TopoLink<'_>; 4]) -> f32 {
    let centre = |node: TopoLink<'_>| node.and_then(Node::leaf).map_or(Vec3::ZERO, TopoLeaf::centre);
    let [a, b, c, d] = nodes;
    let (a, b, c, d) = (centre(a), centre(b), centre(c), centre(d));
    // Two triangles, and centres count half cells.
    ((b - a).cross(c - a).length() + (b - d).cross(c - d).length()) / 8.0
}

/// Gives every leaf its place and size, and its elements tags: there if all corners are inside.
pub(crate) fn prepare(tree: &TopoTree<'_>) {
    let points_of = |corners: &mut dyn Iterator<Item = usize>| corners.fold(0u8, |bits, c| bits | 1 << c);
    let edges = Edge::ALL.map(|e| points_of(&mut e.corners().into_iter().map(zmend::grid::Corner::index)));
    let faces = Face::ALL.map(|f| points_of(&mut f.corners().into_iter().map(zmend::grid::Corner::index)));
    let tags: Vec<u64> = (0..=255u8)
        .map(|corners| {
            let outside = |points: u8| u64::from(corners & points != points);
            let of_points = (0..8).fold(0, |tags, c| tags | outside(1 << c) << (2 * c));
            let with_edges = (0..12).fold(of_points, |tags, e| tags | outside(edges[e]) << (EDGE + 2 * e as u32));
            let with_faces = (0..6).fold(with_edges, |tags, f| tags | outside(faces[f]) << (FACE + 2 * f as u32));
            with_faces | outside(0xff) << CELL
        })
        .collect();
    assert!(tree.depth <= MAX_DEPTH, "coordinates have 10 bits");
    below(tree.root, [0; 3], tree.depth, &tags);
}

fn below(node: &TopoNode<'_>, at: [u32; 3], size: u32, tags: &[u64]) {
    match node {
        Node::Inner(inner) => {
            inner.stamp.set(0);
            for (i, kid) in inner.kids.iter().enumerate() {
                let high = [i >> 2, i >> 1 & 1, i & 1];
                let at = std::array::from_fn(|a| at[a] | (high[a] as u32) << (size - 1));
                if let Some(kid) = kid.get() {
                    below(kid, at, size - 1, tags);
                }
            }
        }
        Node::Leaf(leaf) => {
            let corners = leaf.a.get() >> CORNERS & 0xff;
            leaf.a.set(corners << CORNERS | u64::from(size) << 40);
            leaf.b.set(tags[corners as usize]);
            leaf.vertex.set(at[0] << 20 | at[1] << 10 | at[2]);
        }
    }
}

/// Forgets the records of all faces; their memory stays where it is.
pub(crate) fn forget(tree: &TopoTree<'_>) {
    for place in super::locate::leaves(tree) {
        place.leaf.rest.records.set(None);
    }
}
