//! The handles of what thinning leaves: a maximum spanning forest, and the cuts through the loops (Zhou, Ju and Hu 2007, sections 5 and 6).
//!
//! An edge of the skeleton weighs what was collapsed into it, a cross-section of the handle there. Edges join the forest from the heaviest
//! to the lightest; one that closes a loop is the thinnest of it. The program grows a tree from one point by a heap, and so repairs one
//! component; here edges are sorted once, and all components are in the forest. Areas are not divided by four as there.

use super::elements::{
    Beside, GONE, Slot, THERE, TopoLeaf, TopoLink, TopoNode, TopoTree, dual_area, edge_slot, face_slot, faces_round,
    point_slot,
};
use super::node::Node;
use super::traverse::{OTHERS, Visitor, traverse};

/// What an edge at a sheet weighs: it is never cut.
const SHEET: f32 = 1e20;

/// An edge of the complex, by its axis and where it starts, in finest cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Edge {
    axis: usize,
    start: [u32; 3],
}

/// A loop, where it is thinnest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Handle {
    /// Area of the section, in square finest cells.
    pub(crate) size: f32,
    edge: Edge,
}

/// An edge of the skeleton with its weight and its ends.
struct Arc {
    weight: f32,
    edge: Edge,
    ends: [u64; 2],
}

#[derive(Default)]
struct Skeleton(Vec<Arc>);

/// Where an edge starts, from one of the cells round it: its corner there is its number's.
fn start(slot: Slot<'_>, axis: usize) -> [u32; 3] {
    let ([u, v], k, mut at) = (OTHERS[axis], slot.number() % 4, slot.leaf.at());
    at[u] += ((k >> 1) as u32) << slot.leaf.size();
    at[v] += ((k & 1) as u32) << slot.leaf.size();
    at
}

impl<'a> Visitor<'a, Beside<'a>> for Skeleton {
    const FACES: bool = true;
    const EDGES: bool = true;

    fn enters(&self, _: &[TopoLink<'a>]) -> bool {
        true
    }

    #[inline]
    fn edge(&mut self, axis: usize, nodes: [TopoLink<'a>; 4]) {
        let Some(slot) = edge_slot(axis, nodes).filter(|slot| slot.tag() == THERE) else { return };
        let faces = faces_round(axis, nodes);
        let weight = if faces.iter().flatten().any(|face| face.tag() == THERE) {
            SHEET
        } else {
            dual_area(nodes) + faces.iter().flatten().map(|face| face.record().weight).sum::<f32>()
        };
        let from = start(slot, axis);
        let mut to = from;
        to[axis] += 1 << slot.leaf.size();
        let ends = [from, to].map(|p| p.iter().fold(0, |key, &c| key << 20 | u64::from(c)));
        self.0.push(Arc { weight, edge: Edge { axis, start: from }, ends });
    }
}

/// The loops of the skeleton from the thinnest on, those in sheets left out.
///
/// Cost: a pass over the edges, and sorting those that are left.
pub(crate) fn handles(tree: &TopoTree<'_>) -> Vec<Handle> {
    let mut skeleton = Skeleton::default();
    traverse(tree.root, &mut skeleton);
    let mut arcs = skeleton.0;
    let mut points: Vec<u64> = arcs.iter().flat_map(|arc| arc.ends).collect();
    points.sort_unstable();
    points.dedup();
    arcs.sort_unstable_by(|a, b| b.weight.total_cmp(&a.weight).then(a.edge.cmp(&b.edge)));
    let mut parent: Vec<u32> = (0..points.len() as u32).collect();
    let mut handles = Vec::new();
    for Arc { weight, edge, ends } in arcs {
        let [a, b] = ends.map(|end| root(&mut parent, points.partition_point(|&point| point < end) as u32));
        parent[a.max(b) as usize] = a.min(b);
        if a == b && weight < SHEET {
            handles.push(Handle { size: weight, edge });
        }
    }
    handles.reverse();
    handles
}

fn root(parent: &mut [u32], mut a: u32) -> u32 {
    while parent[a as usize] != a {
        let next = parent[a as usize];
        parent[a as usize] = parent[next as usize];
        a = next;
    }
    a
}

/// The leaf in which a finest cell lies.
fn leaf_at<'a>(tree: &TopoTree<'a>, cell: [u32; 3]) -> TopoLink<'a> {
    let mut node: &TopoNode<'a> = tree.root;
    for level in (0..tree.depth).rev() {
        let Node::Inner(inner) = node else { break };
        let i = cell.iter().fold(0, |i, c| 2 * i + (c >> level & 1));
        node = inner.kids[i as usize].get()?;
    }
    Some(node)
}

/// The four leaves round an edge.
fn round<'a>(tree: &TopoTree<'a>, Edge { axis, start }: Edge) -> [TopoLink<'a>; 4] {
    let [u, v] = OTHERS[axis];
    std::array::from_fn(|k| {
        let mut cell = start;
        cell[u] = cell[u].checked_sub(u32::from(k & 2 == 0))?;
        cell[v] = cell[v].checked_sub(u32::from(k & 1 == 0))?;
        if cell.iter().any(|c| c >> tree.depth != 0) { None } else { leaf_at(tree, cell) }
    })
}

/// The edge with which a face was removed.
fn retraced(face: Slot<'_>) -> Option<Edge> {
    let bits = face.record().retrace;
    if bits == 0 {
        return None;
    }
    let (number, side) = (face.number(), 1 << face.leaf.size());
    let [u, v] = OTHERS[number / 2];
    let (axis, across) = if bits >> 11 & 1 == 1 { (v, u) } else { (u, v) };
    let mut start = face.leaf.at();
    start[number / 2] += side * (number as u32 & 1);
    start[across] += side * (bits >> 10 & 1);
    start[axis] += bits & 1023;
    Some(Edge { axis, start })
}

/// Takes from the complex, as it was before it was thinned, whatever flowed into the thinnest edges of handles, with all that touches it.
pub(crate) fn cut(tree: &TopoTree<'_>, handles: &[Handle]) {
    super::elements::prepare(tree);
    let mut waiting: Vec<Edge> = handles.iter().map(|handle| handle.edge).collect();
    while let Some(edge) = waiting.pop() {
        let nodes = round(tree, edge);
        let Some(slot) = edge_slot(edge.axis, nodes).filter(|slot| slot.tag() == THERE) else { continue };
        slot.set(GONE);
        nodes.into_iter().flatten().filter_map(Node::leaf).for_each(|leaf| leaf.cell().set(GONE));
        for face in faces_round(edge.axis, nodes).into_iter().flatten().filter(|face| face.tag() == THERE) {
            face.set(GONE);
            waiting.extend(retraced(face));
        }
    }
}

/// Points, edges, faces and cells that are there, the second and the last counted negative.
#[derive(Default)]
struct Euler(i64);

impl<'a> Visitor<'a, Beside<'a>> for Euler {
    const FACES: bool = true;
    const EDGES: bool = true;
    const POINTS: bool = true;

    fn enters(&self, _: &[TopoLink<'a>]) -> bool {
        true
    }

    fn cell(&mut self, leaf: &'a TopoLeaf<'a>) {
        self.0 -= i64::from(leaf.cell().tag() == THERE);
    }

    fn face(&mut self, axis: usize, nodes: [TopoLink<'a>; 2]) {
        self.0 += i64::from(face_slot(axis, nodes).is_some_and(|slot| slot.tag() == THERE));
    }

    fn edge(&mut self, axis: usize, nodes: [TopoLink<'a>; 4]) {
        self.0 -= i64::from(edge_slot(axis, nodes).is_some_and(|slot| slot.tag() == THERE));
    }

    fn point(&mut self, nodes: [TopoLink<'a>; 8]) {
        self.0 += i64::from(point_slot(nodes).is_some_and(|slot| slot.tag() == THERE));
    }
}

/// The Euler number of the complex: components less handles plus cavities.
pub(crate) fn euler(tree: &TopoTree<'_>) -> i64 {
    let mut euler = Euler::default();
    traverse(tree.root, &mut euler);
    euler.0
}
