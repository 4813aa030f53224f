//! From crossed edges to signs.

use super::node::{Link, Node, Tree};
use super::traverse::{Visitor, traverse};
use std::cell::Cell;
use std::sync::LazyLock;
use zmend::grid::Edge;
use zmend::grid::cases::{self, CASES};

/// Where the bits of the corners begin in a leaf's first word.
pub(crate) const CORNERS: u32 = 12;

/// What a surface has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Crossed edges, which are the vertices of marching cubes.
    pub(crate) crossings: u64,
    /// Triangles of marching cubes.
    pub(crate) triangles: u64,
    /// Leaves with corners of both signs.
    pub(crate) mixed: u64,
    /// Leaves one of whose faces has an odd number of crossed edges: there the surface is open.
    pub(crate) odd: u64,
}

/// The inside corners of a cell whose least corner is outside, by its crossed edges.
pub(crate) static CORNERS_OF: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut table = vec![0; 1 << 12];
    for mask in (0..=255u8).step_by(2) {
        let edges = Edge::ALL.iter().filter(|&&e| cases::is_crossed(mask, e));
        table[edges.fold(0, |bits, e| bits | 1usize << e.index())] = mask;
    }
    table
});

/// Gives the four cells round an edge what only the last one knows so far: whether it is crossed.
struct Spread;

impl<'a, R: 'a> Visitor<'a, R> for Spread {
    const EDGES: bool = true;
    const FACES: bool = true;

    #[inline]
    fn enters(&self, nodes: &[Link<'a, R>]) -> bool {
        // A face leads to edges, an edge to what its four cells share: nothing is crossed where a cell is missing.
        nodes.iter().all(Option::is_some)
    }

    #[inline]
    fn edge(&mut self, axis: usize, nodes: [Link<'a, R>; 4]) {
        let [Some(Node::Leaf(n0)), Some(Node::Leaf(n1)), Some(Node::Leaf(n2)), Some(Node::Leaf(owner))] = nodes else {
            return;
        };
        let bit = owner.a.get() >> (4 * axis) & 1;
        if bit != 0 {
            for (k, leaf) in [n0, n1, n2].into_iter().enumerate() {
                leaf.a.set(leaf.a.get() | 1 << (4 * axis + 3 - k));
            }
        }
    }
}

/// Spreads crossings to all cells, and gives corners signs and crossings numbers, from the root down: outside at its least corner.
///
/// Cost: a pass over the edges, and one over the cells.
pub(crate) fn sign<R>(tree: &Tree<'_, R>) -> Counts {
    sign_and(tree, &mut |_, _| ())
}

/// The same, and makes leaves of what is nothing yet: then the leaves fill the root, each with the signs of its corners.
pub(crate) fn sign_all<R: Default>(tree: &Tree<'_, R>) -> Counts {
    sign_and(tree, &mut |link, sign| {
        let node = tree.memory.leaf();
        if let Node::Leaf(leaf) = node {
            leaf.a.set(u64::from(sign) << CORNERS);
        }
        link.set(Some(node));
    })
}

/// `missing` is told where there is no child, and the sign there (all ones: inside).
fn sign_and<'a, R>(tree: &Tree<'a, R>, missing: &mut impl FnMut(&Cell<Link<'a, R>>, u8)) -> Counts {
    traverse(tree.root, &mut Spread);
    let mut counts = Counts::default();
    descend(tree.root, 0, &CORNERS_OF, &mut counts, missing);
    counts
}

/// Signs of a cell whose least corner has the sign `first` (all ones: inside); returns those of its corners.
fn descend<'a, R>(
    node: &Node<'a, R>,
    first: u8,
    table: &[u8],
    counts: &mut Counts,
    missing: &mut impl FnMut(&Cell<Link<'a, R>>, u8),
) -> u8 {
    match node {
        Node::Inner(inner) => {
            let mut of = |i: usize, sign: u8| {
                if let Some(kid) = inner.kids[i].get() {
                    return descend(kid, sign, table, counts, missing);
                }
                missing(&inner.kids[i], sign);
                sign
            };
            // Of the least child all corners are known then: they are the others' least corners.
            let least = of(0, first);
            (1..8).fold(least & 1, |corners, i| {
                let sign = if least >> i & 1 == 1 { 0xff } else { 0 };
                corners | of(i, sign) & 1 << i
            })
        }
        Node::Leaf(leaf) => {
            let edges = leaf.a.get() & 0xfff;
            let corners = table[edges as usize] ^ first;
            leaf.a.set(edges | u64::from(corners) << CORNERS);
            leaf.vertex.set(counts.crossings as u32);
            counts.crossings += u64::from((edges & 0x111).count_ones());
            counts.triangles += CASES[usize::from(corners)].triangles.len() as u64;
            counts.mixed += u64::from(edges != 0);
            let is_odd = FACES.iter().any(|face| (edges & face).count_ones() % 2 == 1);
            counts.odd += u64::from(is_odd);
            corners
        }
    }
}

/// The edges of each face.
pub(crate) const FACES: [u64; 6] = {
    let edges = [[4, 8, 5, 9], [6, 10, 7, 11], [0, 8, 1, 10], [2, 9, 3, 11], [0, 4, 2, 6], [1, 5, 3, 7]];
    let mut faces = [0; 6];
    let mut i = 0;
    while i < 24 {
        faces[i / 4] |= 1 << edges[i / 4][i % 4];
        i += 1;
    }
    faces
};
