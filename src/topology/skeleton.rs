//! What thinning leaves, as a graph: arcs of edges between junctions, sheets and cores.
//!
//! An edge without faces is an edge of the graph. Everything else that is connected, the closed sheets around cavities and the core that was
//! not eroded, is contracted to a node each, and so is the sentinel of the background: what loops there may be inside cannot be
//! removed by a patch through an edge. Nodes at which two edges of the graph meet lie within arcs.
//!
//! Where a subcomplex is kept ([`Complex::keeping`]), it is one node with all that hangs together with it by faces, and its edges are none of the
//! graph: loops are what does not come down to it. Sheets are then not closed, but may end on it ([`walls`]).
//!
//! Cost: that of [`Labels`], and some 50 ns an edge of the graph.

use super::complex::{Complex, DEEP, Spot};
use super::label::{Labels, SENTINEL};
use crate::grid::brick::Plane;
use crate::grid::{Axis, Extent, Face, Key};
use std::collections::BTreeMap;
use std::ops::Range;

/// What stands at the end of an arc.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Node {
    /// A point where other than two arcs meet, or any point of a ring.
    Junction,
    /// Faces that enclose cavities, or cannot be collapsed for another reason.
    Sheet,
    /// Cells that were not eroded.
    Core,
    /// What is outside of the background's box.
    Sentinel,
    /// All that is kept, as one node.
    Kept,
}

/// A chain of edges.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arc {
    /// The nodes at its ends, by number.
    pub ends: [u32; 2],
    /// The places of its edges in [`Skeleton::edges`].
    pub edges: Range<usize>,
}

/// The graph of a thinned complex.
#[derive(Debug, Clone)]
pub struct Skeleton {
    pub(super) spots: Vec<Spot>,
    edges: Vec<Key>,
    arcs: Vec<Arc>,
    nodes: Vec<Node>,
}

impl Skeleton {
    /// The graph of a complex, thinned or not.
    pub fn new(complex: &Complex) -> Skeleton {
        let covered = |brick: u32| covered_edges(complex, brick);
        let labels = Labels::new(complex, covered);
        let mut graph = Graph { edges: Vec::new(), degree: vec![0; labels.names()], kind: kinds(complex, &labels) };
        let first_kept = graph.kind.iter().position(|kind| *kind == Node::Kept);
        for brick in 0..complex.bricks.len() as u32 {
            let covered = covered(brick);
            let kept = complex.bricks[brick as usize].kept.as_deref();
            for axis in Axis::ALL {
                let extent = Extent::from(axis);
                let mut free = complex.live(brick)[extent.index()] & !covered[axis.index()];
                if let Some(kept) = kept {
                    free &= !kept[extent.index()];
                }
                for local in free.iter() {
                    let spot = Spot { brick, extent, local };
                    let ends = [false, true].map(|high| match (labels.end(complex, spot, high), first_kept) {
                        (end, Some(first)) if graph.kind[end as usize] == Node::Kept => first as u32,
                        (end, _) => end,
                    });
                    graph.push(spot, ends);
                }
            }
        }
        let (order, chains) = graph.chains();
        let spots: Vec<Spot> = order.iter().map(|&i| graph.edges[i as usize].0).collect();
        // Nodes are numbered as they occur.
        let mut numbers = vec![u32::MAX; labels.names()];
        let mut nodes = Vec::new();
        let mut number = |name: u32| {
            let number = &mut numbers[name as usize];
            if *number == u32::MAX {
                *number = nodes.len() as u32;
                nodes.push(graph.kind[name as usize]);
            }
            *number
        };
        let arcs = chains.into_iter().map(|(ends, edges)| Arc { ends: ends.map(&mut number), edges }).collect();
        Skeleton { edges: spots.iter().map(|&spot| complex.key(spot)).collect(), spots, arcs, nodes }
    }

    /// The finest elements that the edges stand for, arc by arc: edges of the solid, faces beside the solid for a background.
    pub fn edges(&self) -> &[Key] {
        &self.edges
    }

    /// The arcs.
    pub fn arcs(&self) -> &[Arc] {
        &self.arcs
    }

    /// What the nodes are.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }
}

/// Of each connected set of faces that is left beside what is kept, the face at which the solid is drilled through in the fewest steps. Where all
/// cavities are filled, such a wall spans what should be open, and without any one of its faces it collapses further.
/// Cost: that of [`Labels`], and some 30 ns a cell of the ways through.
pub(super) fn walls(complex: &Complex) -> Vec<Spot> {
    let faces = |brick: u32| Axis::ALL.map(|normal| (!Extent::from(normal), complex.live(brick)));
    let bricks = 0..complex.bricks.len() as u32;
    if bricks.clone().all(|brick| faces(brick).iter().all(|(face, live)| live[face.index()].is_empty())) {
        return Vec::new();
    }
    let labels = Labels::new(complex, |brick| covered_edges(complex, brick));
    let mut least: BTreeMap<u32, (usize, Spot)> = BTreeMap::new();
    for brick in bricks {
        for (extent, live) in faces(brick) {
            for local in live[extent.index()].iter() {
                let face = Spot { brick, extent, local };
                let wall = labels.set(brick, local).expect("the corners of a live face are live");
                let way = (steps_through(complex, face), face);
                least.entry(wall).and_modify(|least| *least = way.min(*least)).or_insert(way);
            }
        }
    }
    least.into_values().map(|(_, face)| face).collect()
}

/// The cells that were removed with the faces on the way from a face to the surface, on both sides.
fn steps_through(complex: &Complex, face: Spot) -> usize {
    let normal = (!face.extent).axes().next().expect("a face has a normal");
    let side = |high: bool| {
        let mut cell = complex.half_toward(face, Face::new(normal, high));
        std::iter::from_fn(move || {
            let here = cell?;
            let record = complex.bricks[here.brick as usize].record.as_deref()?;
            let out = record.face_of(here.local)?;
            // The cell beyond the face that it was removed with.
            cell = complex.step(here.brick, here.local, out).map(|(brick, local)| Spot { brick, local, ..here });
            Some(())
        })
        .count()
    };
    side(false) + side(true)
}

/// The edges of a brick that have a face.
fn covered_edges(complex: &Complex, brick: u32) -> [Plane; 3] {
    let live = complex.live(brick);
    Axis::ALL.map(|axis| {
        let extent = Extent::from(axis);
        let edges = live[extent.index()];
        if edges.is_empty() {
            return edges;
        }
        let with = |across: Axis| {
            let faces = (extent | across).index();
            let low = complex.live(complex.beside(brick, Face::new(across, false)));
            live[faces] | live[faces].at_minus(across, &low[faces])
        };
        let [u, v] = axis.others();
        edges & (with(u) | with(v))
    })
}

/// What each set of points is, by its name.
fn kinds(complex: &Complex, labels: &Labels) -> Vec<Node> {
    let mut kinds = vec![Node::Junction; labels.names()];
    let mut raise = |set: u32, kind: Node| kinds[set as usize] = kinds[set as usize].max(kind);
    for brick in 0..complex.bricks.len() as u32 {
        let live = complex.live(brick);
        let starts = |dimension: u32| {
            let of = Extent::ALL.into_iter().filter(|extent| extent.dimension() == dimension);
            of.fold(Plane::EMPTY, |all, extent| all | live[extent.index()])
        };
        for (kind, starts) in [(Node::Sheet, starts(2)), (Node::Core, starts(3))] {
            for (set, part) in labels.parts(brick) {
                if !(*part & starts).is_empty() {
                    raise(set, kind);
                }
            }
        }
        if let Some(kept) = complex.bricks[brick as usize].kept.as_deref() {
            let of_kept = labels.parts(brick).filter(|(_, part)| !(**part & kept[Extent::POINT.index()]).is_empty());
            of_kept.for_each(|(set, _)| raise(set, Node::Kept));
        }
        for face in Face::ALL.into_iter().filter(|&face| complex.beside(brick, face) == DEEP) {
            raise(labels.set_beside(complex, brick, face), Node::Core);
        }
    }
    kinds[SENTINEL as usize] = Node::Sentinel;
    kinds
}

/// Edges with the sets at their ends.
struct Graph {
    edges: Vec<(Spot, [u32; 2])>,
    degree: Vec<u32>,
    kind: Vec<Node>,
}

impl Graph {
    fn push(&mut self, spot: Spot, ends: [u32; 2]) {
        ends.iter().for_each(|&end| self.degree[end as usize] += 1);
        self.edges.push((spot, ends));
    }

    /// Whether arcs end at a node.
    fn ends_arcs(&self, node: u32) -> bool {
        self.degree[node as usize] != 2 || self.kind[node as usize] != Node::Junction
    }

    /// All edges in the order of the arcs, and the arcs: first those between nodes that end arcs, then rings.
    #[expect(clippy::type_complexity, reason = "a list and its sections")]
    fn chains(&self) -> (Vec<u32>, Vec<([u32; 2], Range<usize>)>) {
        // Edges by node.
        let mut at_node: Vec<(u32, u32)> =
            (0..).zip(&self.edges).flat_map(|(i, (_, ends))| ends.map(|end| (end, i))).collect();
        at_node.sort_unstable();
        let at = |node: u32| {
            let first = at_node.partition_point(|entry| entry.0 < node);
            at_node[first..].iter().take_while(move |entry| entry.0 == node).map(|entry| entry.1)
        };
        let mut used = vec![false; self.edges.len()];
        let mut order = Vec::with_capacity(self.edges.len());
        let mut arcs = Vec::new();
        let starts = at_node.iter().filter(|entry| self.ends_arcs(entry.0)).chain(&at_node);
        for &(start, first) in starts {
            if used[first as usize] {
                continue;
            }
            let begin = order.len();
            let (mut node, mut edge) = (start, first);
            loop {
                used[edge as usize] = true;
                order.push(edge);
                let [a, b] = self.edges[edge as usize].1;
                node = if node == a { b } else { a };
                if self.ends_arcs(node) {
                    break;
                }
                match at(node).find(|&next| !used[next as usize]) {
                    Some(next) => edge = next,
                    None => break,
                }
            }
            arcs.push(([start, node], begin..order.len()));
        }
        (order, arcs)
    }
}
