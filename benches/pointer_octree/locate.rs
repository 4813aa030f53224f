//! Questions to a tree whose leaves fill the root: the leaf at a place, the leaves beside a leaf, all pairs of leaves with a common face.

use super::node::{Leaf, Link, Node, Tree};
use super::traverse::{BIT, Visitor, traverse};

/// A leaf with its least corner in finest cells and the log2 of its side.
pub(crate) struct Place<'a, R> {
    pub(crate) leaf: &'a Leaf<R>,
    pub(crate) at: [u32; 3],
    pub(crate) size: u32,
}

/// The child of a node at one level in which a finest cell lies.
#[inline]
fn child_at([x, y, z]: [u32; 3], level: u32) -> usize {
    ((x >> level & 1) << 2 | (y >> level & 1) << 1 | z >> level & 1) as usize
}

/// The node of a size in which a finest cell lies, or the leaf that is larger.
#[inline]
fn descend<'a, R>(tree: &Tree<'a, R>, cell: [u32; 3], size: u32) -> Link<'a, R> {
    let mut node = tree.root;
    for level in (size..tree.depth).rev() {
        let Node::Inner(inner) = node else { break };
        node = inner.kids[child_at(cell, level)].get()?;
    }
    Some(node)
}

/// The leaf in which a finest cell lies. Cost: two dependent loads a level.
#[inline]
pub(crate) fn locate<'a, R>(tree: &Tree<'a, R>, cell: [u32; 3]) -> Option<&'a Leaf<R>> {
    descend(tree, cell, 0).and_then(Node::leaf)
}

/// All leaves, depth first.
pub(crate) fn leaves<'a, R>(tree: &Tree<'a, R>) -> Vec<Place<'a, R>> {
    let mut found = Vec::new();
    let mut waiting = vec![(tree.root, [0; 3], tree.depth)];
    while let Some((node, at, size)) = waiting.pop() {
        match node {
            Node::Leaf(leaf) => found.push(Place { leaf, at, size }),
            Node::Inner(inner) => {
                for (i, kid) in inner.kids.iter().enumerate().rev() {
                    let high = [i >> 2, i >> 1 & 1, i & 1];
                    let at = [0, 1, 2].map(|a: usize| at[a] | (high[a] as u32) << (size - 1));
                    waiting.extend(kid.get().map(|kid| (kid, at, size - 1)));
                }
            }
        }
    }
    found
}

/// Calls `each` with the leaves beside a leaf, across each of its faces: down from the root to a node of its size, and on to the children
/// at the face.
#[inline]
pub(crate) fn beside<'a, R>(tree: &Tree<'a, R>, at: [u32; 3], size: u32, each: &mut impl FnMut(&'a Leaf<R>)) {
    for axis in 0..3 {
        for high in [false, true] {
            let mut cell = at;
            let Some(c) = (if high { cell[axis].checked_add(1 << size) } else { cell[axis].checked_sub(1) }) else {
                continue;
            };
            if c >> tree.depth != 0 {
                continue;
            }
            cell[axis] = c;
            // Of a node on the high side, the children on the low one touch the leaf.
            if let Some(node) = descend(tree, cell, size) {
                touching(node, BIT[axis], if high { 0 } else { BIT[axis] }, each);
            }
        }
    }
}

fn touching<'a, R>(node: &'a Node<'a, R>, bit: usize, side: usize, each: &mut impl FnMut(&'a Leaf<R>)) {
    match node {
        Node::Leaf(leaf) => each(leaf),
        Node::Inner(inner) => {
            let kids = (0..8).filter(|i| i & bit == side).filter_map(|i| inner.kids[i].get());
            kids.for_each(|kid| touching(kid, bit, side, each));
        }
    }
}

/// Sums something over all pairs of leaves.
struct Pairs<F>(F, u64);

impl<'a, R: 'a, F: Fn(&Leaf<R>) -> u64> Visitor<'a, R> for Pairs<F> {
    const FACES: bool = true;

    #[inline]
    fn enters(&self, _: &[Link<'a, R>]) -> bool {
        true
    }

    #[inline]
    fn face(&mut self, _: usize, nodes: [Link<'a, R>; 2]) {
        for leaf in nodes.into_iter().flatten().filter_map(Node::leaf) {
            self.1 += (self.0)(leaf);
        }
    }
}

/// Sums up what `value` says of both leaves beside each face, by the recursion over cells and faces.
pub(crate) fn sum_over_faces<R>(tree: &Tree<'_, R>, value: impl Fn(&Leaf<R>) -> u64) -> u64 {
    let mut pairs = Pairs(value, 0);
    traverse(tree.root, &mut pairs);
    pairs.1
}
