//! What topology repair can be looked at by: skeletons with the sizes of their arcs, and the membranes of cuts and fills.

use crate::geom::Frame;
use crate::grid::key::SIDE;
use crate::grid::{Axis, Key};
use crate::io::skeleton::{Colour, Line, Lines, Patches, colour_of_share};
use crate::io::skt::{Record, Skeleton};
use crate::octree::EditedOctree;
use crate::topology::{Kind, Loops, Round, Side};
use glam::DVec3;
use hashbrown::HashMap;
use std::ops::Range;

/// Edges that are cut, faces that are filled.
const REMOVED: Colour = [0, 158, 73];
/// Membranes across handles.
const CUT: Colour = [202, 0, 32];
/// Membranes across tunnels.
const FILLED: Colour = [5, 113, 176];

/// The skeletons of the rounds of a topology repair, as they were found.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// Round by round.
    pub rounds: Vec<TracedRound>,
}

/// The skeleton of a round.
#[derive(Debug, Clone)]
pub struct TracedRound {
    /// Whether it is that of the solid or of what is around it.
    pub side: Side,
    /// The edges of the skeleton, or for the background the faces that stand for them, arc by arc.
    pub edges: Vec<Key>,
    /// For each arc its edges, and the area (in squares of cells) and number of squares of its thinnest section.
    pub arcs: Vec<(Range<usize>, f64, u64)>,
    /// The edges that are cut, or the faces that are filled, sorted, with area and squares of their sections.
    pub removed: Vec<(Key, f64, u64)>,
}

impl Trace {
    /// Keeps the skeleton of a round. Cost: a section an arc.
    pub fn keep(&mut self, round: &Round<'_>) {
        self.keep_loops(round.octree, round.loops, round.chosen);
    }

    /// Keeps the skeleton of one side; `octree` is what the loops were found in, and those that are chosen are shown as removed.
    pub fn keep_loops(&mut self, octree: &EditedOctree, loops: &Loops, chosen: &[usize]) {
        let skeleton = loops.skeleton();
        let sizes = loops.arc_sizes(octree);
        let with_size = |&i: &usize| (loops.edge(i), loops.handles()[i].area, loops.handles()[i].squares);
        let mut removed: Vec<(Key, f64, u64)> = chosen.iter().map(with_size).collect();
        removed.sort_unstable_by_key(|cut| cut.0);
        self.rounds.push(TracedRound {
            side: loops.complex().side(),
            edges: skeleton.edges().to_vec(),
            arcs: skeleton.arcs().iter().zip(sizes).map(|(arc, (area, n))| (arc.edges.clone(), area, n)).collect(),
            removed,
        });
    }

    /// What an SKT file holds: a phase a round, with the sizes as `TopoMender` has them, in model units squared. Positions are relative
    /// to the cube of the grid.
    pub fn to_skt(&self, frame: &Frame) -> Skeleton {
        let square = frame.cell_size() * frame.cell_size();
        let phase = |round: &TracedRound| {
            let records = round.parts().map(|(edge, _, squares, is_removed)| match round.side {
                Side::Object => Record::of_edge(edge, is_removed, (squares as f64 / 4.0 * square) as f32),
                Side::Background => {
                    Record::of_face(edge, is_removed, (squares.saturating_sub(1) as f64 * square) as f32)
                }
            });
            records.collect()
        };
        Skeleton { phases: self.rounds.iter().map(phase).collect() }
    }

    /// The skeletons as lines in model space. Their weights are areas in model units squared, their colours go from red for the thinnest
    /// to blue for the thickest by the root of that; what is removed is green.
    pub fn to_lines(&self, frame: &Frame) -> Lines {
        let square = frame.cell_size() * frame.cell_size();
        let mut points = Points::new(frame);
        let mut lines = Vec::new();
        let areas = || self.rounds.iter().flat_map(|round| &round.arcs).map(|arc| arc.1.sqrt());
        let (least, most) = areas().fold((f64::INFINITY, 0.0f64), |(least, most), a| (least.min(a), most.max(a)));
        for round in &self.rounds {
            for (edge, area, _, is_removed) in round.parts() {
                let [a, b] = match round.side {
                    Side::Object => Record::of_edge(edge, false, 0.0).ends,
                    Side::Background => Record::of_face(edge, false, 0.0).ends,
                };
                let share = if most > least { (area.sqrt() - least) / (most - least) } else { 0.5 };
                lines.push(Line {
                    ends: [points.place(a.center()), points.place(b.center())],
                    weight: (area * square) as f32,
                    colour: if is_removed { REMOVED } else { colour_of_share(share) },
                });
            }
        }
        Lines { points: points.list, lines }
    }
}

impl TracedRound {
    /// Each edge with the area and the squares of its arc, and whether it is removed.
    fn parts(&self) -> impl Iterator<Item = (Key, f64, u64, bool)> + '_ {
        let of_arc = move |(edges, area, squares): &(Range<usize>, f64, u64)| {
            let (area, squares) = (*area, *squares);
            self.edges[edges.clone()].iter().map(move |&edge| {
                match self.removed.binary_search_by_key(&edge, |cut| cut.0) {
                    Ok(i) => (edge, self.removed[i].1, self.removed[i].2, true),
                    Err(_) => (edge, area, squares, false),
                }
            })
        };
        self.arcs.iter().flat_map(of_arc)
    }
}

/// Membranes as squares in model space: those across handles in red, round the edges of the solid that they cut; those across tunnels in blue,
/// made of faces. Elements of other dimensions, which come along, show nothing.
pub fn membranes(frame: &Frame, sections: impl IntoIterator<Item = (Kind, Key)>) -> Patches {
    let mut points = Points::new(frame);
    let mut quads = Vec::new();
    for (kind, element) in sections {
        let (corners, colour) = match (kind, element.dir().dimension()) {
            (Kind::Cut, 1) => (across(element), CUT),
            (Kind::Fill, 2) => (corners(element), FILLED),
            _ => continue,
        };
        quads.push((corners.map(|corner| points.place(corner)), colour));
    }
    Patches { points: points.list, quads }
}

/// The centres of the four cells round an edge.
fn across(edge: Key) -> [[u32; 3]; 4] {
    let axis = edge.dir().axes().next().expect("an edge has an axis");
    let half = SIDE >> edge.level().expect("edges have levels") >> 1;
    around(edge.center(), axis, half)
}

/// The corners of a face.
fn corners(face: Key) -> [[u32; 3]; 4] {
    let normal = face.dir().complement().axes().next().expect("a face has a normal");
    let half = SIDE >> face.level().expect("faces have levels") >> 1;
    around(face.center(), normal, half)
}

/// The corners of a square, counter-clockwise round an axis. Only what touches the side of the root would stick out of it, and is cut off
/// there.
fn around(centre: [u32; 3], axis: Axis, half: u32) -> [[u32; 3]; 4] {
    let [u, v] = axis.others().map(Axis::index);
    [(false, false), (true, false), (true, true), (false, true)].map(|(high_u, high_v)| {
        let mut corner = centre;
        for (a, high) in [(u, high_u), (v, high_v)] {
            corner[a] = if high { (corner[a] + half).min(SIDE) } else { corner[a].saturating_sub(half) };
        }
        corner
    })
}

/// Points in model space, each once.
struct Points<'a> {
    frame: &'a Frame,
    places: HashMap<[u32; 3], u32, ahash::RandomState>,
    list: Vec<DVec3>,
}

impl<'a> Points<'a> {
    fn new(frame: &'a Frame) -> Self {
        let places = HashMap::with_hasher(ahash::RandomState::with_seeds(1, 2, 3, 4));
        Points { frame, places, list: Vec::new() }
    }

    /// The place of a point, given in lattice units.
    fn place(&mut self, at: [u32; 3]) -> u32 {
        let Points { frame, places, list } = self;
        *places.entry(at).or_insert_with(|| {
            let cells = f64::from(SIDE >> frame.depth());
            list.push(frame.to_model(DVec3::from(at.map(f64::from)) / cells));
            list.len() as u32 - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Corner, Edge, Face};

    #[test]
    fn membranes_lie_where_their_elements_do() {
        let frame = Frame::new(DVec3::splat(1.0), 8.0, 3).unwrap();
        let cell = Key::cell(3, [2, 3, 4]).unwrap();
        let edge = cell.edge(Edge::at(Axis::X, Corner::MIN));
        let face = cell.face(Face::new(Axis::Z, true));
        let Patches { points, quads } =
            membranes(&frame, [(Kind::Cut, edge), (Kind::Cut, cell), (Kind::Fill, face), (Kind::Fill, edge)]);
        assert_eq!((points.len(), quads.len()), (8, 2));
        let of = |i: usize| quads[i].0.map(|p| points[p as usize].to_array());
        assert_eq!(of(0), [[3.5, 3.5, 4.5], [3.5, 4.5, 4.5], [3.5, 4.5, 5.5], [3.5, 3.5, 5.5]]);
        assert_eq!(of(1), [[3.0, 4.0, 6.0], [4.0, 4.0, 6.0], [4.0, 5.0, 6.0], [3.0, 5.0, 6.0]]);
        assert_ne!(quads[0].1, quads[1].1);
    }
}
