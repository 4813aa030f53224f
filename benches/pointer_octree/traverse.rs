//! The recursion over cells, faces, edges and points (Ju, Losasso, Schaefer and Warren 2002; Zhou, Ju and Hu 2007).
//!
//! A cell leads to 8 cells, 12 faces, 6 edges and a point, a face to 4 faces, 4 edges and a point, an edge to 2 edges and a point, a point
//! to one point. Nodes come with an element by the sides on which they lie: of a face the low one first; of an edge by the two other
//! axes in the order x, y, z; of a point as children are numbered. So the k-th of the nodes round an edge has it as its edge
//! `4 axis + 3 - k`, the k-th of those at a point has it as its corner `7 - k`. A leaf stands for its children where others are divided.

use super::node::{Leaf, Link, Node};

/// The bit of an axis in the number of a child.
pub(crate) const BIT: [usize; 3] = [4, 2, 1];
/// The two other axes.
pub(crate) const OTHERS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// An array by index, written out: loops over so few do not become straight code by themselves.
macro_rules! by_index {
    ($f:expr; $($i:literal)*) => { [$($f($i)),*] };
}

/// Is shown elements all nodes of which are leaves, or nothing; and says where to go on.
pub(crate) trait Visitor<'a, R> {
    /// Which of faces, edges and points it wants to see; of cells it sees all leaves.
    const FACES: bool = false;
    const EDGES: bool = false;
    const POINTS: bool = false;

    /// Whether to look into elements between these nodes, one of which is divided.
    fn enters(&self, nodes: &[Link<'a, R>]) -> bool;

    /// What is worth remembering while one is between nodes; it is told again in [`leave`](Self::leave).
    fn state(&self) -> u64 {
        0
    }

    /// All between these nodes has been seen.
    fn leave(&mut self, _nodes: &[Link<'a, R>], _state: u64) {}

    /// A leaf.
    fn cell(&mut self, _leaf: &'a Leaf<R>) {}

    /// The face across an axis between two nodes.
    fn face(&mut self, _axis: usize, _nodes: [Link<'a, R>; 2]) {}

    /// The edge along an axis between four nodes.
    fn edge(&mut self, _axis: usize, _nodes: [Link<'a, R>; 4]) {}

    /// The point between eight nodes.
    fn point(&mut self, _nodes: [Link<'a, R>; 8]) {}
}

/// Passes over everything inside of a node.
pub(crate) fn traverse<'a, R, V: Visitor<'a, R>>(node: &'a Node<'a, R>, visitor: &mut V) {
    let inner = match node {
        Node::Inner(inner) => inner,
        Node::Leaf(leaf) => return visitor.cell(leaf),
    };
    if !visitor.enters(&[Some(node)]) {
        return;
    }
    let state = visitor.state();
    let kids = by_index!(|i: usize| inner.kids[i].get(); 0 1 2 3 4 5 6 7);
    kids.into_iter().flatten().for_each(|kid| traverse(kid, visitor));
    if V::FACES {
        faces::<R, V, 0, 1, 2>(&kids, visitor);
        faces::<R, V, 1, 0, 2>(&kids, visitor);
        faces::<R, V, 2, 0, 1>(&kids, visitor);
    }
    if V::EDGES {
        edges::<R, V, 0, 1, 2>(&kids, visitor);
        edges::<R, V, 1, 0, 2>(&kids, visitor);
        edges::<R, V, 2, 0, 1>(&kids, visitor);
    }
    if V::POINTS {
        point(kids, visitor);
    }
    visitor.leave(&[Some(node)], state);
}

/// Passes over the far sides of the root, beyond which there is nothing: so that every cell is the first one at some point.
pub(crate) fn traverse_far_sides<'a, R, V: Visitor<'a, R>>(root: &'a Node<'a, R>, visitor: &mut V) {
    let root = Some(root);
    face::<R, V, 0, 1, 2>([root, None], visitor);
    face::<R, V, 1, 0, 2>([root, None], visitor);
    face::<R, V, 2, 0, 1>([root, None], visitor);
    edge::<R, V, 0, 1, 2>([root, None, None, None], visitor);
    edge::<R, V, 1, 0, 2>([root, None, None, None], visitor);
    edge::<R, V, 2, 0, 1>([root, None, None, None], visitor);
    point([root, None, None, None, None, None, None, None], visitor);
}

/// The four faces across an axis round the middle of eight nodes.
#[inline]
fn faces<'a, R, V: Visitor<'a, R>, const A: usize, const U: usize, const W: usize>(
    nodes: &[Link<'a, R>; 8],
    visitor: &mut V,
) {
    let [a, b, c, d] = [0, BIT[W], BIT[U], BIT[U] | BIT[W]];
    face::<R, V, A, U, W>([nodes[a], nodes[a | BIT[A]]], visitor);
    face::<R, V, A, U, W>([nodes[b], nodes[b | BIT[A]]], visitor);
    face::<R, V, A, U, W>([nodes[c], nodes[c | BIT[A]]], visitor);
    face::<R, V, A, U, W>([nodes[d], nodes[d | BIT[A]]], visitor);
}

/// The two edges along an axis at the middle of eight nodes.
#[inline]
fn edges<'a, R, V: Visitor<'a, R>, const A: usize, const U: usize, const W: usize>(
    nodes: &[Link<'a, R>; 8],
    visitor: &mut V,
) {
    let (u, v) = (BIT[U].max(BIT[W]), BIT[U].min(BIT[W]));
    edge::<R, V, A, U, W>([nodes[0], nodes[v], nodes[u], nodes[u | v]], visitor);
    let half = BIT[A];
    edge::<R, V, A, U, W>([nodes[half], nodes[half | v], nodes[half | u], nodes[half | u | v]], visitor);
}

#[inline]
fn child<R>(node: Link<'_, R>, i: usize) -> Link<'_, R> {
    node.and_then(|node| node.child(i))
}

/// Whether all of the nodes are leaves or nothing; `None` if not, but one must not look inside.
#[inline]
fn are_leaves<'a, R, V: Visitor<'a, R>>(nodes: &[Link<'a, R>], visitor: &V) -> Option<bool> {
    let divided = nodes.iter().flatten().any(|node| node.is_inner());
    if divided { visitor.enters(nodes).then_some(false) } else { Some(true) }
}

fn face<'a, R, V: Visitor<'a, R>, const A: usize, const U: usize, const W: usize>(
    nodes: [Link<'a, R>; 2],
    visitor: &mut V,
) {
    match are_leaves(&nodes, visitor) {
        None => return,
        Some(true) => return visitor.face(A, nodes),
        Some(false) => {}
    }
    let state = visitor.state();
    // Round the middle of the face are the high children of the low node, and the other way round.
    let [low, high] = nodes;
    let bit = BIT[A];
    let round = |i: usize| if i & bit == 0 { child(low, i | bit) } else { child(high, i ^ bit) };
    let round = by_index!(round; 0 1 2 3 4 5 6 7);
    faces::<R, V, A, U, W>(&round, visitor);
    if V::EDGES {
        edges::<R, V, U, A, W>(&round, visitor);
        edges::<R, V, W, A, U>(&round, visitor);
    }
    if V::POINTS {
        point(round, visitor);
    }
    visitor.leave(&nodes, state);
}

fn edge<'a, R, V: Visitor<'a, R>, const A: usize, const U: usize, const W: usize>(
    nodes: [Link<'a, R>; 4],
    visitor: &mut V,
) {
    match are_leaves(&nodes, visitor) {
        None => return,
        Some(true) => return visitor.edge(A, nodes),
        Some(false) => {}
    }
    let state = visitor.state();
    // Of the node on one side of the edge, the children on the other side touch it.
    let (u, v) = (BIT[U].max(BIT[W]), BIT[U].min(BIT[W]));
    let round = |i: usize| child(nodes[2 * usize::from(i & u != 0) + usize::from(i & v != 0)], i ^ (u | v));
    let round = by_index!(round; 0 1 2 3 4 5 6 7);
    edges::<R, V, A, U, W>(&round, visitor);
    if V::POINTS {
        point(round, visitor);
    }
    visitor.leave(&nodes, state);
}

fn point<'a, R, V: Visitor<'a, R>>(nodes: [Link<'a, R>; 8], visitor: &mut V) {
    match are_leaves(&nodes, visitor) {
        None => return,
        Some(true) => return visitor.point(nodes),
        Some(false) => {}
    }
    let state = visitor.state();
    point(by_index!(|i: usize| child(nodes[i], 7 - i); 0 1 2 3 4 5 6 7), visitor);
    visitor.leave(&nodes, state);
}
