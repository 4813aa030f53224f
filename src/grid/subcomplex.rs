//! The closed subcomplexes of a cell, and the sheets of the surface round each.
//!
//! A cell has 27 parts: 8 corners, 12 edges, 6 faces and itself. A [`Subcomplex`] is a set of them that holds with a part all parts of
//! its boundary. That is what a cell can see of a closed cubical complex; [`cases`](super::cases) has the 256 of them that follow from
//! their corners alone.
//!
//! # Octants
//!
//! A cell and one of its corners make an octant: a cube of the grid of element centres. Its eight corners are the middles of the point,
//! three edges, three faces and the cell, and a closed complex meets it in a down-closed set: empty, full, or cut from the rest by a
//! single disc (see the tests of [`cases`](super::cases)). If the cell is not in the complex, the octants cut are those at its corners
//! in the complex; if it is, none.
//!
//! # Sheets
//!
//! Two octants of a cell, at the ends of an edge, share a square of which the surface crosses exactly one arc if the edge is in the
//! complex, and nothing otherwise. So the sheets of the surface in the cell are the components of its corners in the complex over its
//! edges in the complex. A sheet has a disc for each of its corners, an arc inside for each of its edges, and round each of its faces an
//! inner vertex: its Euler number is that of the component, corners less edges plus faces. On a face of the cell that is not in the complex
//! it has an arc for each corner; arcs of corners joined by an edge are continued into each other, so they make up runs.
//!
//! A sheet is represented by a single vertex if it is a disc (its Euler number is 1), has no more than one run on each face, and runs on
//! three faces or more ([`Sheets::is_regular`]). Then
//!
//! - contracting it leaves the surface the same up to homeomorphism, for it is a disc;
//! - the vertices of two cells are joined by at most one edge of the mesh: the edges across a face are the arcs on it, and a run of arcs
//!   becomes one edge if the sheets on both sides are contracted, and the two-sided polygons between its arcs vanish;
//! - the vertex has three neighbours or more.
//!
//! Otherwise it has a vertex for each corner. The rule looks at one cell at a time, and both cells beside a face see the same runs on
//! it: so all of this holds wherever a cell of one kind lies beside one of another, and whatever the complex is.

use super::cases::{Mask, Sheets};
use super::{Axis, Corner, Edge, Extent, Face};

/// A corner, an edge or a face of a cell, or the cell itself: `9 x + 3 y + z`, for each axis 0 on the low side, 1 if it extends along
/// the axis, 2 on the high side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Part(u8);

/// What a part adds to its number for each axis, by the axis's bit: being there once, and twice.
const WEIGHT: [u8; 3] = [9, 3, 1];

impl Part {
    /// The cell itself.
    pub const CELL: Part = Part(13);
    /// All 27, in order.
    pub const ALL: [Part; 27] = {
        let mut all = [Part(0); 27];
        let mut i = 0;
        while i < 27 {
            all[i] = Part(i as u8);
            i += 1;
        }
        all
    };

    /// The part that extends along the axes of `extent` and lies on the side of `corner` on the others.
    pub const fn new(extent: Extent, corner: Corner) -> Part {
        let mut number = 0;
        let mut a = 0;
        while a < 3 {
            let axis = Axis::ALL[a];
            number += WEIGHT[a] * if extent.contains(axis) { 1 } else { 2 * corner.is_high(axis) as u8 };
            a += 1;
        }
        Part(number)
    }

    /// Its number, below 27.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// The axes along which it extends.
    pub const fn extent(self) -> Extent {
        let digits = self.digits();
        Extent::ALL[((digits[0] % 2) << 2 | (digits[1] % 2) << 1 | (digits[2] % 2)) as usize]
    }

    /// Its corner with the smallest coordinates.
    pub const fn start(self) -> Corner {
        let digits = self.digits();
        Corner::ALL[((digits[0] / 2) << 2 | (digits[1] / 2) << 1 | (digits[2] / 2)) as usize]
    }

    const fn digits(self) -> [u8; 3] {
        [self.0 / 9, self.0 / 3 % 3, self.0 % 3]
    }

    /// Its corners.
    pub const fn corners(self) -> Mask {
        let (extent, start) = (self.extent().bits(), self.start().bits());
        let mut mask = 0;
        let mut c = 0;
        while c < 8 {
            if c & !extent == start {
                mask |= 1 << c;
            }
            c += 1;
        }
        mask
    }
}

impl From<Corner> for Part {
    fn from(corner: Corner) -> Part {
        Part::new(Extent::POINT, corner)
    }
}

impl From<Edge> for Part {
    fn from(edge: Edge) -> Part {
        Part::new(edge.axis().into(), edge.corners()[0])
    }
}

impl From<Face> for Part {
    fn from(face: Face) -> Part {
        Part::new(Extent::CELL - face.axis(), face.corners()[0])
    }
}

/// A set of parts of a cell: bit i is part i.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Subcomplex(u32);

/// The subcomplexes that follow from their corners.
const OF_CORNERS: [Subcomplex; 256] = {
    let mut all = [Subcomplex(0); 256];
    let mut mask = 0;
    while mask < 256 {
        let mut i = 0;
        while i < 27 {
            if Part::ALL[i].corners() & !(mask as u8) == 0 {
                all[mask].0 |= 1 << i;
            }
            i += 1;
        }
        mask += 1;
    }
    all
};

/// Each part with its boundary.
static CLOSURE: [u32; 27] = {
    let mut all = [0; 27];
    let mut i = 0;
    while i < 27 {
        all[i] = OF_CORNERS[Part::ALL[i].corners() as usize].0;
        i += 1;
    }
    all
};

impl Subcomplex {
    /// No part.
    pub const EMPTY: Subcomplex = Subcomplex(0);

    /// All parts whose corners are in the mask.
    pub fn of_corners(mask: Mask) -> Subcomplex {
        OF_CORNERS[usize::from(mask)]
    }

    /// Whether a part is in it.
    #[inline]
    pub fn contains(self, part: impl Into<Part>) -> bool {
        self.0 >> part.into().0 & 1 == 1
    }

    /// Adds a part, but not its boundary.
    pub fn insert(&mut self, part: Part) {
        self.0 |= 1 << part.0;
    }

    /// Whether it holds with each part all the parts of its boundary.
    pub fn is_closed(self) -> bool {
        Part::ALL.into_iter().filter(|&part| self.contains(part)).all(|part| CLOSURE[part.index()] & !self.0 == 0)
    }

    /// The sheets of the surface in the cell and the vertices that stand for them, numbered by first corners. Domain: closed.
    pub fn sheets(self) -> Sheets {
        let mut sheets = Sheets { sheet: [255; 8], vertex: [255; 8], ..Sheets::default() };
        if self.contains(Part::CELL) {
            return sheets;
        }
        for seed in Corner::ALL.into_iter().filter(|&c| self.contains(c)) {
            if sheets.sheet[seed.index()] != 255 {
                continue;
            }
            let corners = self.component(seed);
            let in_order = Corner::ALL.into_iter().filter(|c| corners >> c.index() & 1 == 1);
            let is_regular = self.is_regular(corners);
            for corner in in_order {
                sheets.sheet[corner.index()] = sheets.count;
                sheets.vertex[corner.index()] = sheets.vertices;
                sheets.vertices += u8::from(!is_regular);
            }
            if is_regular {
                sheets.regular |= 1 << sheets.count;
                sheets.vertices += 1;
            }
            sheets.count += 1;
        }
        sheets
    }

    /// The corners joined to one of them by edges.
    fn component(self, seed: Corner) -> Mask {
        let mut found: Mask = 1 << seed.index();
        loop {
            let before = found;
            for edge in Edge::ALL.into_iter().filter(|&e| self.contains(e)) {
                let ends = Part::from(edge).corners();
                found |= if found & ends != 0 { ends } else { 0 };
            }
            if found == before {
                return found;
            }
        }
    }

    /// Whether a single vertex may stand for the sheet of a component.
    fn is_regular(self, component: Mask) -> bool {
        let of_component = |corner: Corner| component >> corner.index() & 1 == 1;
        let edges = Edge::ALL.into_iter().filter(|&e| of_component(e.corners()[0]) && self.contains(e)).count();
        let faces = Face::ALL.into_iter().filter(|&f| of_component(f.corners()[0]) && self.contains(f)).count();
        if component.count_ones() as usize + faces != edges + 1 {
            return false;
        }
        let mut touched = 0;
        for face in Face::ALL.into_iter().filter(|&f| !self.contains(f)) {
            let (ring, edges) = (face.corners(), face.edges());
            let corners = ring.iter().filter(|&&c| of_component(c)).count();
            // Where no edge of the face in the complex leads to a corner, a run begins. A run all round has no beginning.
            let begins = (0..4).filter(|&i| of_component(ring[i]) && !self.contains(edges[(i + 3) % 4])).count();
            if begins > 1 {
                return false;
            }
            touched += u32::from(corners > 0);
        }
        touched >= 3
    }
}

#[cfg(test)]
mod tests {
    use super::super::cases::CASES;
    use super::*;

    /// All closed subcomplexes: sets of corners, of edges between them, of faces with all edges, and the cell.
    fn for_all(mut each: impl FnMut(Subcomplex)) {
        for corners in 0..=255u8 {
            let edges: Vec<Edge> =
                Edge::ALL.into_iter().filter(|e| e.corners().iter().all(|c| corners >> c.index() & 1 == 1)).collect();
            for of_edges in 0..1u32 << edges.len() {
                let chosen: Vec<Edge> = (0..edges.len()).filter(|i| of_edges >> i & 1 == 1).map(|i| edges[i]).collect();
                let faces: Vec<Face> =
                    Face::ALL.into_iter().filter(|f| f.edges().iter().all(|e| chosen.contains(e))).collect();
                for of_faces in 0..1u32 << faces.len() {
                    let mut set = Subcomplex::EMPTY;
                    Corner::ALL
                        .into_iter()
                        .filter(|c| corners >> c.index() & 1 == 1)
                        .for_each(|c| set.insert(c.into()));
                    chosen.iter().for_each(|&e| set.insert(e.into()));
                    (0..faces.len()).filter(|i| of_faces >> i & 1 == 1).for_each(|i| set.insert(faces[i].into()));
                    each(set);
                    if of_faces == 63 {
                        set.insert(Part::CELL);
                        each(set);
                    }
                }
            }
        }
    }

    #[test]
    fn parts_know_their_corners() {
        for part in Part::ALL {
            assert_eq!(Part::new(part.extent(), part.start()), part);
            assert_eq!(part.corners().count_ones(), 1 << part.extent().dimension());
        }
        for edge in Edge::ALL {
            let ends = edge.corners().iter().fold(0, |mask, c| mask | 1 << c.index());
            assert_eq!(Part::from(edge).corners(), ends);
        }
        for face in Face::ALL {
            let ring = face.corners().iter().fold(0, |mask, c| mask | 1 << c.index());
            assert_eq!(Part::from(face).corners(), ring);
        }
        assert_eq!((Part::CELL.extent(), Part::CELL.corners()), (Extent::CELL, 255));
    }

    /// Cells that no edit touches have the vertices of their case.
    #[test]
    fn signs_give_the_cases() {
        for mask in 0..=255u8 {
            let set = Subcomplex::of_corners(mask);
            assert!(set.is_closed());
            assert_eq!(set.sheets(), CASES[usize::from(mask)].sheets, "mask {mask}");
        }
    }

    /// The surface inside a cell, put together from the arcs, agrees with what the rule says about it.
    #[test]
    fn sheets_with_one_vertex_are_discs_that_meet_faces_once() {
        let mut regular = 0;
        let mut all = 0;
        for_all(|set| {
            assert!(set.is_closed());
            all += 1;
            let sheets = set.sheets();
            for s in (0..sheets.count).filter(|&s| sheets.is_regular(s)) {
                regular += 1;
                // Follow the boundary of the sheet: steps from corner to corner along edges in the complex, or on from face to
                // face across an edge that is not.
                let corners: Vec<Corner> = Corner::ALL.into_iter().filter(|c| sheets.sheet[c.index()] == s).collect();
                let arcs: Vec<(Corner, Face)> = corners
                    .iter()
                    .flat_map(|&c| c.faces().map(|f| (c, f)))
                    .filter(|&(_, f)| !set.contains(f))
                    .collect();
                let next = |(c, f): (Corner, Face)| {
                    let place = f.corners().iter().position(|&x| x == c).expect("on the face");
                    let edge = f.edges()[place];
                    if set.contains(edge) {
                        let beyond = if edge.corners()[0] == c { edge.corners()[1] } else { edge.corners()[0] };
                        (beyond, f)
                    } else {
                        let [a, b] = edge.faces();
                        (c, if a == f { b } else { a })
                    }
                };
                let mut cycle = vec![arcs[0]];
                while next(*cycle.last().expect("not empty")) != arcs[0] {
                    cycle.push(next(*cycle.last().expect("not empty")));
                    assert!(cycle.len() <= arcs.len(), "{set:?}: the boundary does not close");
                }
                assert_eq!(cycle.len(), arcs.len(), "{set:?}: one cycle has all arcs");
                let mut passed: Vec<Face> = cycle.iter().map(|a| a.1).collect();
                passed.dedup();
                if passed.first() == passed.last() {
                    passed.pop();
                }
                let visits = passed.len();
                passed.sort();
                passed.dedup();
                assert!(visits >= 3 && passed.len() == visits, "{set:?}: each face once, three at least");
            }
        });
        assert!(regular > all / 4, "{regular} of the sheets of {all} subcomplexes have one vertex");
    }
}
