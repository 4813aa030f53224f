//! Thinning by elementary collapses, as Zhou, Ju and Hu (2007, section 4) and their program do it: on leaves of all sizes, layer by layer.
//!
//! A face with one cell, an edge with one face, a point with one edge go together. What is removed in a step has that step's code; an element
//! whose upper one was removed in the same step waits, so that each step takes one layer. Steps pass over groups of nodes in which the
//! last one changed something, until no cell and no face is removed any more.

use super::blocks::Blocks;
use super::elements::{
    Beside, GONE, Record, Records, Slot, THERE, TopoLeaf, TopoLink, TopoTree, dual_area, edge_slot, face_slot,
    faces_round, nodes_round, point_slot,
};
use super::node::Node;
use super::traverse::{OTHERS, Visitor, traverse};

/// What thinning did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Thinned {
    pub(crate) steps: u32,
    /// Elements removed.
    pub(crate) removed: u64,
}

/// One step.
struct Step<'a> {
    number: u32,
    /// The tags of what is removed in this step, and of what was in the last one.
    code: u64,
    last: u64,
    /// Pairs removed in this step, without those of points and edges, and with them.
    faces: u64,
    pairs: u64,
    /// Changes, tags of the last step that are taken back included.
    changes: u64,
    records: &'a Blocks<'a, Records>,
}

/// Collapses whatever can be, and keeps in faces what went with them.
pub(crate) fn thin<'a>(tree: &TopoTree<'a>, records: &'a Blocks<'a, Records>) -> Thinned {
    let mut done = Thinned::default();
    loop {
        done.steps += 1;
        let odd = u64::from(done.steps % 2);
        let mut step =
            Step { number: done.steps, code: 2 + odd, last: 3 - odd, faces: 0, pairs: 0, changes: 0, records };
        traverse(tree.root, &mut step);
        done.removed += 2 * step.pairs;
        if step.faces == 0 {
            return done;
        }
    }
}

impl<'a> Step<'a> {
    /// Whether an element is there; what the last step removed is gone for good now.
    #[inline]
    fn is_there(&self, slot: Slot<'a>) -> bool {
        let tag = slot.tag();
        if tag == self.last {
            slot.set(GONE);
        }
        tag == THERE
    }

    #[inline]
    fn remove(&mut self, slot: Slot<'a>) {
        slot.set(self.code);
        slot.leaf.set_stamp(self.number);
        self.changes += 1;
    }

    /// The one of some upper elements that is there; none if there are several, or if one was there when the step began.
    #[inline]
    fn only<const N: usize>(&self, slots: [Option<Slot<'a>>; N]) -> Option<Slot<'a>> {
        let mut found = None;
        for slot in slots.into_iter().flatten() {
            match slot.tag() {
                THERE if found.is_none() => found = Some(slot),
                tag if tag == THERE || tag == self.code => return None,
                _ => {}
            }
        }
        found
    }

    #[inline]
    fn is_active(&self, node: TopoLink<'a>) -> bool {
        let stamp = match node {
            Some(Node::Inner(inner)) => inner.stamp.get(),
            Some(Node::Leaf(leaf)) => leaf.stamp(),
            None => return false,
        };
        stamp + 1 >= self.number
    }

    #[inline]
    fn any_active(&self, nodes: &[TopoLink<'a>]) -> bool {
        nodes.iter().any(|&node| self.is_active(node))
    }

    fn write(&self, face: Slot<'a>, record: Record) {
        let records = face.leaf.rest.records.get().unwrap_or_else(|| {
            let records = self.records.take();
            face.leaf.rest.records.set(Some(records));
            records
        });
        records.0[face.number()].set(record);
    }
}

/// Names an edge of a face by its place in the face; see [`Record`].
fn retrace(face: Slot<'_>, axis: usize, edge: Slot<'_>) -> u32 {
    let [u, v] = OTHERS[face.number() / 2];
    let across = if axis == u { v } else { u };
    // Corner of the edge's leaf at which it starts.
    let number = edge.number() % 4;
    let high = match OTHERS[axis] {
        [a, _] if a == across => number >> 1,
        _ => number & 1,
    };
    let (at, from) = (edge.leaf.at(), face.leaf.at());
    let place = at[across] + ((high as u32) << edge.leaf.size());
    1 << 12 | u32::from(axis == v) << 11 | u32::from(place > from[across]) << 10 | (at[axis] - from[axis])
}

impl<'a> Visitor<'a, Beside<'a>> for Step<'a> {
    const FACES: bool = true;
    const EDGES: bool = true;
    const POINTS: bool = true;

    #[inline]
    fn enters(&self, nodes: &[TopoLink<'a>]) -> bool {
        self.any_active(nodes)
    }

    fn state(&self) -> u64 {
        self.changes
    }

    fn leave(&mut self, nodes: &[TopoLink<'a>], state: u64) {
        if self.changes != state {
            for node in nodes.iter().flatten() {
                if let Node::Inner(inner) = node {
                    inner.stamp.set(self.number);
                }
            }
        }
    }

    fn cell(&mut self, leaf: &'a TopoLeaf<'a>) {
        self.is_there(leaf.cell());
    }

    #[inline]
    fn face(&mut self, axis: usize, nodes: [TopoLink<'a>; 2]) {
        if !self.any_active(&nodes) {
            return;
        }
        let Some(face) = face_slot(axis, nodes).filter(|&slot| self.is_there(slot)) else { return };
        let cell = |node: TopoLink<'a>| node.and_then(Node::leaf).map(TopoLeaf::cell);
        if let Some(cell) = self.only([cell(nodes[0]), cell(nodes[1])]) {
            self.remove(face);
            self.remove(cell);
            self.faces += 1;
            self.pairs += 1;
        }
    }

    #[inline]
    fn edge(&mut self, axis: usize, nodes: [TopoLink<'a>; 4]) {
        if !self.any_active(&nodes) {
            return;
        }
        let Some(edge) = edge_slot(axis, nodes).filter(|&slot| self.is_there(slot)) else { return };
        let faces = faces_round(axis, nodes);
        if let Some(face) = self.only(faces) {
            let weight = faces.into_iter().flatten().map(|face| face.record().weight).sum::<f32>() + dual_area(nodes);
            self.write(face, Record { weight, retrace: retrace(face, axis, edge) });
            self.remove(edge);
            self.remove(face);
            self.faces += 1;
            self.pairs += 1;
        }
    }

    #[inline]
    fn point(&mut self, nodes: [TopoLink<'a>; 8]) {
        if !self.any_active(&nodes) {
            return;
        }
        let Some(point) = point_slot(nodes).filter(|&slot| self.is_there(slot)) else { return };
        let along = |axis: usize, up: bool| edge_slot(axis, nodes_round(&nodes, axis, up));
        let edges = [along(0, false), along(0, true), along(1, false), along(1, true), along(2, false), along(2, true)];
        if let Some(edge) = self.only(edges) {
            self.remove(point);
            self.remove(edge);
            self.pairs += 1;
        }
    }
}
