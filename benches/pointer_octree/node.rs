//! Nodes and how they hang together.

use super::blocks::Blocks;
use std::cell::{Cell, OnceCell};

/// A pointer to a node; `None` where nothing has been.
pub(crate) type Link<'a, R> = Option<&'a Node<'a, R>>;

/// The eight pointers of a node, child `4x + 2y + z`.
pub(crate) type Kids<'a, R> = [Cell<Link<'a, R>>; 8];

/// A node: 24 bytes, and 64 for its children or a record for what a task keeps beside a leaf.
pub(crate) enum Node<'a, R> {
    /// A cell that is divided.
    Inner(Inner<'a, R>),
    /// A cell that is not.
    Leaf(Leaf<R>),
}

/// A divided cell.
pub(crate) struct Inner<'a, R> {
    /// Its children. They lie beside all others' in blocks of their own: what is behind one pointer has one size in safe Rust.
    pub(crate) kids: &'a Kids<'a, R>,
    /// For whom passes by: when something in here changed last.
    pub(crate) stamp: Cell<u32>,
}

/// Takes the place of a tag: its other values say that a node is no leaf.
#[derive(Clone, Copy)]
#[repr(u8)]
pub(crate) enum Tag {
    Leaf,
}

/// A cell that is not divided: two words of tags, a number, and what a task keeps beside.
pub(crate) struct Leaf<R> {
    /// While a surface is made: bit e, the surface crosses edge e; bit 12 + c, corner c is inside.
    pub(crate) a: Cell<u64>,
    /// While a surface is made: where it crosses the three edges at the least corner, 16 bits each.
    pub(crate) b: Cell<u64>,
    /// Of the first vertex.
    pub(crate) vertex: Cell<u32>,
    tag: Tag,
    pub(crate) rest: R,
}

const _: () = assert!(size_of::<Node<'_, ()>>() == 24 && size_of::<OnceCell<Node<'_, ()>>>() == 24);

/// Where the nodes of a tree live.
pub(crate) struct Memory<'a, R> {
    nodes: Blocks<'a, OnceCell<Node<'a, R>>>,
    kids: Blocks<'a, Kids<'a, R>>,
}

impl<R> Default for Memory<'_, R> {
    fn default() -> Self {
        Memory { nodes: Blocks::default(), kids: Blocks::default() }
    }
}

impl<'a, R: Default> Memory<'a, R> {
    /// A new leaf, all zero.
    #[inline]
    pub(crate) fn leaf(&'a self) -> &'a Node<'a, R> {
        let leaf =
            || Leaf { a: Cell::new(0), b: Cell::new(0), vertex: Cell::new(0), tag: Tag::Leaf, rest: R::default() };
        self.nodes.take().get_or_init(|| Node::Leaf(leaf()))
    }

    /// A new node without children.
    #[inline]
    pub(crate) fn inner(&'a self) -> &'a Node<'a, R> {
        let inner = || Inner { kids: self.kids.take(), stamp: Cell::new(0) };
        self.nodes.take().get_or_init(|| Node::Inner(inner()))
    }

    /// Leaves and inner nodes.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [self.nodes.taken() - self.kids.taken(), self.kids.taken()]
    }
}

impl<'a, R> Node<'a, R> {
    /// A child; a leaf stands for all of its own.
    #[inline]
    pub(crate) fn child(&'a self, i: usize) -> Link<'a, R> {
        match self {
            Node::Inner(inner) => inner.kids[i].get(),
            Node::Leaf(_) => Some(self),
        }
    }

    #[inline]
    pub(crate) fn leaf(&self) -> Option<&Leaf<R>> {
        match self {
            Node::Inner(_) => None,
            Node::Leaf(leaf) => Some(leaf),
        }
    }

    #[inline]
    pub(crate) fn is_inner(&self) -> bool {
        matches!(self, Node::Inner(_))
    }
}

/// An octree of nodes and pointers.
pub(crate) struct Tree<'a, R> {
    pub(crate) memory: &'a Memory<'a, R>,
    pub(crate) root: &'a Node<'a, R>,
    /// log2 of the number of finest cells a side.
    pub(crate) depth: u32,
}

impl<'a, R: Default> Tree<'a, R> {
    /// A divided root without children.
    pub(crate) fn new(memory: &'a Memory<'a, R>, depth: u32) -> Self {
        Tree { memory, root: memory.inner(), depth }
    }
}
