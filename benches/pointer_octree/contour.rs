//! Marching cubes: points by the recursion over cells, triangles by the one over points.
//!
//! At a point the first of the eight cells is the one whose greatest corner it is; the edges of that cell belong to the seven
//! others, which know the numbers of the points on them. The cases are zmend's.

use super::node::{Leaf, Link, Node, Tree};
use super::sign::{CORNERS, Counts};
use super::traverse::{Visitor, traverse, traverse_far_sides};
use zmend::Result;
use zmend::geom::Frame;
use zmend::glam::DVec3;
use zmend::grid::Edge;
use zmend::grid::cases::{CASES, Case};
use zmend::mesh::{MeshSink, MeshSizes};
use zmend::octree::crossings::Sample;

/// Points or corners passed on at once.
const BATCH: usize = 1 << 15;

/// Passes the surface to `sink`.
///
/// # Errors
/// Those of the sink.
pub(crate) fn marching_cubes<R>(
    tree: &Tree<'_, R>,
    counts: &Counts,
    frame: &Frame,
    sink: &mut dyn MeshSink,
) -> Result<MeshSizes> {
    let Counts { crossings, triangles, .. } = *counts;
    let sizes = MeshSizes { points: crossings, faces: triangles, corners: 3 * triangles };
    sink.begin(sizes)?;
    let mut points = Points { frame, sink: &mut *sink, batch: Vec::with_capacity(BATCH + 8) };
    points.of(tree.root, [0; 3], tree.depth)?;
    points.sink.points(&points.batch)?;
    let mut triangles =
        Triangles { cases: &CASES, sink: &mut *sink, batch: Vec::with_capacity(BATCH + 16), result: Ok(()) };
    traverse(tree.root, &mut triangles);
    traverse_far_sides(tree.root, &mut triangles);
    let Triangles { batch, result, .. } = triangles;
    result?;
    sink.faces(3, &batch)?;
    Ok(sizes)
}

struct Points<'s, S: ?Sized> {
    frame: &'s Frame,
    sink: &'s mut S,
    batch: Vec<DVec3>,
}

impl<S: MeshSink + ?Sized> Points<'_, S> {
    /// The points of the edges that the leaves in a cell own: those at their least corners.
    fn of<R>(&mut self, node: &Node<'_, R>, at: [u32; 3], level: u32) -> Result<()> {
        match node {
            Node::Inner(inner) => {
                for (i, kid) in inner.kids.iter().enumerate() {
                    if let Some(kid) = kid.get() {
                        let high = [i >> 2, i >> 1 & 1, i & 1];
                        let at = std::array::from_fn(|a| at[a] | (high[a] as u32) << (level - 1));
                        self.of(kid, at, level - 1)?;
                    }
                }
            }
            Node::Leaf(leaf) => {
                let edges = leaf.a.get() & 0x111;
                if edges != 0 {
                    let start = self.frame.to_model(DVec3::from(at.map(f64::from)));
                    for axis in (0..3).filter(|axis| edges >> (4 * axis) & 1 == 1) {
                        let offset = Sample::new((leaf.b.get() >> (16 * axis)) as u16, 0).position();
                        self.batch.push(start + DVec3::AXES[axis] * (self.frame.cell_size() * offset));
                    }
                    if self.batch.len() >= BATCH {
                        self.sink.points(&self.batch)?;
                        self.batch.clear();
                    }
                }
            }
        }
        Ok(())
    }
}

struct Triangles<'s, S: ?Sized> {
    cases: &'s [Case],
    sink: &'s mut S,
    batch: Vec<u32>,
    result: Result<()>,
}

/// The number of the point on an edge that starts at the least corner of a leaf.
#[inline]
fn number<R>(leaf: &Leaf<R>, axis: usize) -> u32 {
    let before = leaf.a.get() & 0x111 & ((1 << (4 * axis)) - 1);
    leaf.vertex.get() + before.count_ones()
}

impl<'a, R: 'a, S: MeshSink + ?Sized> Visitor<'a, R> for Triangles<'_, S> {
    const FACES: bool = true;
    const EDGES: bool = true;
    const POINTS: bool = true;

    #[inline]
    fn enters(&self, nodes: &[Link<'a, R>]) -> bool {
        nodes[0].is_some()
    }

    #[inline]
    fn point(&mut self, nodes: [Link<'a, R>; 8]) {
        let Some(Node::Leaf(cell)) = nodes[0] else { return };
        let corners = (cell.a.get() >> CORNERS) as u8;
        if corners == 0 || corners == 0xff {
            return;
        }
        for &edge in self.cases[usize::from(corners)].triangles.as_flattened() {
            let [start, _] = Edge::corners(edge);
            if let Some(Node::Leaf(owner)) = nodes[start.index()] {
                self.batch.push(number(owner, edge.axis().index()));
            }
        }
        if self.batch.len() >= BATCH {
            if self.result.is_ok() {
                self.result = self.sink.faces(3, &self.batch);
            }
            self.batch.clear();
        }
    }
}
