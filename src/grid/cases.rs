//! The 256 ways in which the corners of a cell can be inside or outside, and the surface in each: derived, not typed in.
//!
//! # Convention
//!
//! The solid is the closed complex of all elements whose corners are all inside. So inside corners are joined through
//! edges, and outside corners through faces and the cell as well: two inside corners across a face's diagonal are apart, and
//! all outside corners of a cell are together. Every extractor uses this convention, so all agree on the topology.
//!
//! # Marching cubes
//!
//! On each face, the surface cuts off every run of inside corners by one segment. Each crossed edge lies on two faces and ends
//! one segment on each, so the segments link up into directed cycles. Neighbouring cells see the same segments on their
//! common face. A cycle becomes triangles by the triangulation of least area (crossings at the middle of edges) among those
//! without a diagonal in a face of the cell, where the neighbour could have the same one. Two cycles round one component of
//! inside corners bound a tunnel: the two opposite corners outside of a cell that is otherwise inside are joined through it.
//!
//! # Dual contouring
//!
//! A sheet is the surface round one component of inside corners. It is represented by one vertex if it is a disc that
//! passes through each face of the cell at most once ([regular](Sheets::is_regular)). Otherwise (it passes twice through a face, or it
//! is a tunnel) it gets a vertex for each of its inside corners, the surface of the grid of element centres: always a manifold.

use super::{Axis, Corner, Edge, Face};
use std::sync::LazyLock;

/// A set of corners of a cell: bit i is corner i. Here: those that are inside.
pub type Mask = u8;

/// The surface in one case.
#[derive(Debug, Clone, Default)]
pub struct Case {
    /// Closed, directed sequences of crossed edges, the inside on the left: their normal by the right-hand rule is outward.
    pub cycles: Vec<Vec<Edge>>,
    /// Marching cubes: triangles between crossings of edges, counter-clockwise seen from outside.
    pub triangles: Vec<[Edge; 3]>,
    /// Dual contouring: the sheets and their vertices.
    pub sheets: Sheets,
}

impl Case {
    /// Whether its two cycles bound a tunnel: then its surface is a band between them, not a disc in each.
    pub fn has_tunnel(&self) -> bool {
        // Discs have two triangles less than corners, a band has as many.
        let corners: usize = self.cycles.iter().map(Vec::len).sum();
        self.triangles.len() + 2 * self.cycles.len() != corners
    }
}

/// The sheets of a case and the vertices that stand for them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sheets {
    /// For each corner the number of its sheet; 255 for corners outside.
    pub sheet: [u8; 8],
    /// For each corner the vertex of the cell that it belongs to; 255 for corners outside.
    pub vertex: [u8; 8],
    /// Number of sheets.
    pub count: u8,
    /// Number of vertices.
    pub vertices: u8,
    /// Bit s: sheet s is represented by a single vertex.
    pub regular: u8,
}

impl Sheets {
    /// Whether sheet `s` is represented by a single vertex.
    pub fn is_regular(&self, s: u8) -> bool {
        self.regular >> s & 1 == 1
    }

    /// Whether every sheet has a single vertex.
    pub fn all_regular(&self) -> bool {
        self.vertices == self.count
    }
}

/// All cases by mask. Derived at first use, in about a millisecond.
pub static CASES: LazyLock<Vec<Case>> = LazyLock::new(|| (0..=255).map(derive).collect());

fn derive(mask: Mask) -> Case {
    let cycles = cycles(mask);
    let component = components(mask);
    // The inside corner of a crossed edge tells which sheet its cycle belongs to.
    let sheet_of = |cycle: &Vec<Edge>| component[inside_end(mask, cycle[0]).index()];
    let mut triangles = Vec::new();
    let mut sheets = Sheets { sheet: component, vertex: [255; 8], ..Sheets::default() };
    sheets.count = component.iter().filter(|&&c| c != 255).max().map_or(0, |&c| c + 1);
    if mask == 255 {
        // Inside all round: no surface.
        return Case { cycles, triangles, sheets: Sheets { sheet: [255; 8], vertex: [255; 8], ..Sheets::default() } };
    }
    for s in 0..sheets.count {
        let of_sheet: Vec<&Vec<Edge>> = cycles.iter().filter(|c| sheet_of(c) == s).collect();
        match of_sheet[..] {
            [cycle] => triangles.extend(best_disc(cycle).expect("checked for all 256 masks")),
            [a, b] => triangles.extend(best_tunnel(a, b).expect("checked for all 256 masks")),
            _ => unreachable!("a component of inside corners has one or two cycles round it"),
        }
        let corners = Corner::ALL.into_iter().filter(|c| component[c.index()] == s);
        if of_sheet.len() == 1 && passes_each_face_once(of_sheet[0]) {
            sheets.regular |= 1 << s;
            corners.for_each(|c| sheets.vertex[c.index()] = sheets.vertices);
            sheets.vertices += 1;
        } else {
            for c in corners {
                sheets.vertex[c.index()] = sheets.vertices;
                sheets.vertices += 1;
            }
        }
    }
    Case { cycles, triangles, sheets }
}

fn is_inside(mask: Mask, corner: Corner) -> bool {
    mask >> corner.index() & 1 == 1
}

/// Whether the surface crosses the edge.
pub fn is_crossed(mask: Mask, edge: Edge) -> bool {
    let [a, b] = edge.corners();
    is_inside(mask, a) != is_inside(mask, b)
}

/// The end of a crossed edge that is inside.
pub fn inside_end(mask: Mask, edge: Edge) -> Corner {
    let [a, b] = edge.corners();
    if is_inside(mask, a) { a } else { b }
}

/// For each corner inside, the number of its component over edges, in order of first corners.
fn components(mask: Mask) -> [u8; 8] {
    let mut component = [255; 8];
    let mut next = 0;
    for seed in Corner::ALL {
        if !is_inside(mask, seed) || component[seed.index()] != 255 {
            continue;
        }
        let mut open = vec![seed];
        while let Some(corner) = open.pop() {
            if component[corner.index()] == 255 {
                component[corner.index()] = next;
                open.extend(Axis::ALL.map(|a| corner ^ a).into_iter().filter(|&c| is_inside(mask, c)));
            }
        }
        next += 1;
    }
    component
}

/// The directed segments in which the surface meets a face: from the edge by which a run of inside corners is entered to the one by
/// which it is left, going counter-clockwise seen from outside of the cell.
fn segments(mask: Mask, face: Face) -> impl Iterator<Item = [Edge; 2]> {
    let ring = face.corners();
    let edge_after = move |i: usize| Edge::between(ring[i % 4], ring[(i + 1) % 4]).expect("neighbours on a face");
    (0..4).filter(move |&i| !is_inside(mask, ring[i]) && is_inside(mask, ring[(i + 1) % 4])).map(move |enter| {
        let leave = (enter + 1..enter + 4).find(|&i| !is_inside(mask, ring[(i + 1) % 4])).expect("a corner is outside");
        [edge_after(enter), edge_after(leave)]
    })
}

fn cycles(mask: Mask) -> Vec<Vec<Edge>> {
    let mut next = [None; 12];
    for [from, to] in Face::ALL.into_iter().flat_map(|face| segments(mask, face)) {
        next[from.index()] = Some(to);
    }
    cycles_of(next)
}

/// The cycles in which edges follow each other.
pub(crate) fn cycles_of(mut next: [Option<Edge>; 12]) -> Vec<Vec<Edge>> {
    let mut cycles = Vec::new();
    for start in Edge::ALL {
        let mut cycle = Vec::new();
        let mut edge = start;
        while let Some(to) = next[edge.index()].take() {
            cycle.push(edge);
            edge = to;
        }
        if !cycle.is_empty() {
            cycles.push(cycle);
        }
    }
    cycles
}

/// Whether two edges lie on a common face of the cell.
pub(crate) fn share_face(a: Edge, b: Edge) -> bool {
    a.faces().iter().any(|face| b.faces().contains(face))
}

/// Whether no two steps of the cycle run through the same face.
fn passes_each_face_once(cycle: &[Edge]) -> bool {
    let mut seen = Vec::new();
    (0..cycle.len()).all(|i| {
        let (a, b) = (cycle[i], cycle[(i + 1) % cycle.len()]);
        let face = *a.faces().iter().find(|f| b.faces().contains(f)).expect("a step runs through a face");
        let new = !seen.contains(&face);
        seen.push(face);
        new
    })
}

/// The middle of an edge of the unit cell, doubled.
pub(crate) fn middle(edge: Edge) -> [i32; 3] {
    let [a, b] = edge.corners();
    Axis::ALL.map(|axis| i32::from(a & axis) + i32::from(b & axis))
}

fn area([a, b, c]: [Edge; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(middle);
    let (u, v) = ([0, 1, 2].map(|i| f64::from(b[i] - a[i])), [0, 1, 2].map(|i| f64::from(c[i] - a[i])));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    n.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A triangulation and its area.
type Weighed = (f64, Vec<[Edge; 3]>);

/// The triangulation of a polygon of least area, without diagonals in faces of the cell; the first one found among equals. `None`
/// if there is none. Edges of the polygon itself are not diagonals.
fn best_triangulation(polygon: &[Edge], diagonal: &dyn Fn(Edge, Edge) -> bool) -> Option<Weighed> {
    let n = polygon.len();
    if n == 2 {
        return Some((0.0, Vec::new()));
    }
    let mut best: Option<Weighed> = None;
    for apex in 1..n - 1 {
        let triangle = [polygon[0], polygon[apex], polygon[n - 1]];
        let sides = [(0, apex), (apex, n - 1)];
        if triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[0] == triangle[2] {
            continue;
        }
        if sides.iter().any(|&(i, j)| j - i > 1 && !diagonal(polygon[i], polygon[j])) {
            continue;
        }
        let (Some(left), Some(right)) =
            (best_triangulation(&polygon[..=apex], diagonal), best_triangulation(&polygon[apex..], diagonal))
        else {
            continue;
        };
        let weight = left.0 + right.0 + area(triangle);
        if best.as_ref().is_none_or(|b| weight < b.0 - 1e-9) {
            best = Some((weight, [vec![triangle], left.1, right.1].concat()));
        }
    }
    best
}

/// The best triangulation of a disc bounded by a cycle, if there is one without other points.
pub(crate) fn best_disc(cycle: &[Edge]) -> Option<Vec<[Edge; 3]>> {
    best_triangulation(cycle, &|a, b| !share_face(a, b)).map(|(_, triangles)| triangles)
}

/// The band between two cycles, if there is one without other points: cut open along the best bridge, it is a polygon.
pub(crate) fn best_tunnel(a: &[Edge], b: &[Edge]) -> Option<Vec<[Edge; 3]>> {
    let rotated = |cycle: &[Edge], by: usize| {
        let mut ring = cycle.to_vec();
        ring.rotate_left(by);
        ring.push(ring[0]);
        ring
    };
    let mut best: Option<Weighed> = None;
    let bridges = (0..a.len()).flat_map(|i| (0..b.len()).map(move |j| (i, j)));
    for (i, j) in bridges.filter(|&(i, j)| !share_face(a[i], b[j])) {
        let (ring_a, ring_b) = (rotated(a, i), rotated(b, j));
        let polygon = [ring_a, ring_b].concat();
        // Diagonals go across the band: inside one cycle they would leave it.
        let across = |x: Edge, y: Edge| a.contains(&x) != a.contains(&y) && !share_face(x, y);
        let found = best_triangulation(&polygon, &across);
        // The bridge is used by two triangles already; no other diagonal may repeat it.
        let found = found.filter(|(_, triangles)| {
            let uses = |x, y| triangles.iter().filter(|t| t.contains(&x) && t.contains(&y)).count();
            a.iter().all(|&x| b.iter().all(|&y| uses(x, y) <= 2))
        });
        if let Some(found) = found.filter(|f| best.as_ref().is_none_or(|b| f.0 < b.0 - 1e-9)) {
            best = Some(found);
        }
    }
    best.map(|(_, triangles)| triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn crossed(mask: Mask) -> Vec<Edge> {
        Edge::ALL.into_iter().filter(|&e| is_crossed(mask, e)).collect()
    }

    #[test]
    fn each_crossed_edge_is_on_one_cycle() {
        for mask in 0..=255 {
            let mut edges: Vec<Edge> = CASES[mask as usize].cycles.concat();
            edges.sort();
            assert_eq!(edges, crossed(mask), "mask {mask}");
        }
    }

    /// The number of triangles agrees with PolyMender's table (there, bits are outside corners).
    #[test]
    fn triangle_counts_are_known() {
        let mut histogram = BTreeMap::new();
        CASES.iter().for_each(|case| *histogram.entry(case.triangles.len()).or_insert(0) += 1);
        let expected = [(0, 2), (1, 16), (2, 46), (3, 80), (4, 76), (5, 32), (6, 4)];
        assert_eq!(histogram.into_iter().collect::<Vec<_>>(), expected);
        for outside in [24u8, 36, 66, 129] {
            assert_eq!(CASES[!outside as usize].triangles.len(), 6);
        }
    }

    /// Patches are surfaces whose boundary is exactly the directed segments on the faces, and no other edge lies in a face.
    #[test]
    fn patches_are_bounded_by_the_segments() {
        for mask in 0..=255 {
            let case = &CASES[mask as usize];
            let mut sides: BTreeMap<(Edge, Edge), i32> = BTreeMap::new();
            for t in &case.triangles {
                for i in 0..3 {
                    *sides.entry((t[i], t[(i + 1) % 3])).or_insert(0) += 1;
                }
            }
            assert!(sides.values().all(|&n| n == 1), "mask {mask}: a directed edge is used twice");
            let boundary: Vec<_> = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a))).copied().collect();
            let mut segments: Vec<_> =
                Face::ALL.into_iter().flat_map(|f| segments(mask, f)).map(|[a, b]| (a, b)).collect();
            segments.sort();
            assert_eq!(boundary, segments, "mask {mask}");
            for &(a, b) in sides.keys().filter(|s| !boundary.contains(s)) {
                assert!(!share_face(a, b) || boundary.contains(&(b, a)), "mask {mask}: an inner edge lies in a face");
            }
        }
    }

    /// For every pair of masks that agree on a common face, the segments of the two cells on it are opposite to each other.
    #[test]
    fn patches_match_across_faces() {
        for axis in Axis::ALL {
            let (low, high) = (Face::new(axis, false), Face::new(axis, true));
            // The same edge of the common face, seen from the cell on the other side.
            let moved = |e: Edge| {
                let [a, b] = e.corners();
                Edge::between(a ^ axis, b ^ axis).unwrap()
            };
            for a in 0..=255u8 {
                for b in 0..=255u8 {
                    let same = Corner::ALL
                        .into_iter()
                        .filter(|&c| c & axis)
                        .all(|c| is_inside(a, c) == is_inside(b, c ^ axis));
                    if same {
                        let mut here: Vec<_> = segments(a, high).map(|[from, to]| [moved(to), moved(from)]).collect();
                        let mut there: Vec<_> = segments(b, low).collect();
                        here.sort();
                        there.sort();
                        assert_eq!(here, there, "masks {a} {b} along {axis}");
                    }
                }
            }
        }
    }

    #[test]
    fn normals_point_outward() {
        for corner in Corner::ALL {
            let mask: Mask = 1 << corner.index();
            let [t] = CASES[mask as usize].triangles[..] else { panic!("one triangle round one corner") };
            let [a, b, c] = t.map(middle);
            let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            for axis in Axis::ALL {
                let away = if corner & axis { -1 } else { 1 };
                assert!(n[axis.index()] * away > 0);
            }
        }
    }

    /// A point of the cell's surface: a corner, or a crossing that may be anywhere between the ends of its edge.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
    enum Place {
        At(Corner),
        On(Edge),
    }

    impl Place {
        fn end(self, high: bool) -> [i32; 3] {
            let corner = match self {
                Place::At(corner) => corner,
                Place::On(edge) => edge.corners()[usize::from(high)],
            };
            Axis::ALL.map(|axis| i32::from(corner & axis))
        }
    }

    /// Six times the volume of a tetrahedron.
    fn volume(p: [[i32; 3]; 4]) -> i32 {
        let [a, b, c] = [1, 2, 3].map(|i| [0, 1, 2].map(|k| p[i][k] - p[0][k]));
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    }

    /// On which side of a plane through three places a fourth one lies (1 or -1), if it is the same wherever crossings are on their
    /// edges. The volume is linear in the place of each, so it is enough to look at their ends: but one sign there means that sign
    /// everywhere between.
    fn side(plane: [Place; 3], place: Place) -> Option<i32> {
        let [a, b, c] = plane;
        let places = [a, b, c, place];
        let volumes = (0..16).map(|ends: u32| volume(std::array::from_fn(|i| places[i].end(ends >> i & 1 == 1))));
        let (low, high) = volumes.fold((0, 0), |(low, high), v| (v.min(low), v.max(high)));
        match (low < 0, high > 0) {
            (true, false) => Some(-1),
            (false, true) => Some(1),
            _ => None,
        }
    }

    /// Whether a plane through three of the corners of two triangles and of the cell has all other corners of the one strictly on one
    /// side and those of the other on the other, wherever the crossings are: then the triangles meet in what they share, nowhere else.
    fn are_separated(s: [Edge; 3], t: [Edge; 3]) -> bool {
        let [s, t] = [s, t].map(|t| t.map(Place::On));
        let mut places: Vec<Place> = [s, t].concat().into_iter().chain(Corner::ALL.map(Place::At)).collect();
        places.sort();
        places.dedup();
        let on_side = |t: [Place; 3], plane: [Place; 3], sign: i32| {
            t.into_iter().all(|place| plane.contains(&place) || side(plane, place) == Some(sign))
        };
        let separates = |plane| [1, -1].into_iter().any(|sign| on_side(s, plane, sign) && on_side(t, plane, -sign));
        let n = places.len();
        let mut planes = (0..n).flat_map(|i| (0..i).flat_map(move |j| (0..j).map(move |k| [i, j, k])));
        planes.any(|plane| separates(plane.map(|i| places[i])))
    }

    /// The triangles of a cell never cross, wherever the surface crosses its edges: a proof for all 256 cases.
    #[test]
    fn triangles_of_a_cell_never_cross() {
        let mut bad = Vec::new();
        for mask in 0..=255u8 {
            let triangles = &CASES[usize::from(mask)].triangles;
            for (i, s) in triangles.iter().enumerate() {
                let crossing = triangles[..i].iter().filter(|t| !are_separated(*s, **t));
                bad.extend(crossing.map(|t| format!("mask {mask:#b}: {s:?} and {t:?}")));
            }
        }
        assert!(bad.is_empty(), "{} {bad:#?}", bad.len());
    }

    /// In the grid of element centres the solid meets each octant in a down-closed set of elements (if a face is in it, so are its
    /// edges and points). All such sets: each is connected, its complement too, so the surface crosses the octant in one disc.
    #[test]
    fn down_closed_octants_are_cut_once() {
        // Elements of an octant are the subsets of {x, y, z}; neighbours differ in one axis.
        let connected = |set: u8| {
            let mut reached = set & set.wrapping_neg();
            for _ in 0..8 {
                let grown = (0..8u8).filter(|e| reached >> e & 1 == 1);
                let grown = grown.fold(reached, |r, e| r | 1 << (e ^ 1) | 1 << (e ^ 2) | 1 << (e ^ 4));
                reached = grown & set;
            }
            reached == set
        };
        let mut found = 0;
        for set in 1..255u8 {
            let down_closed = (0..8u8)
                .filter(|e| set >> e & 1 == 1)
                .all(|e| (0..8u8).filter(|s| s & e == *s).all(|s| set >> s & 1 == 1));
            if down_closed {
                found += 1;
                assert!(connected(set) && connected(!set), "set {set:#b}");
                // No ambiguous face: marching cubes cuts it with a single cycle.
                assert_eq!(CASES[set as usize].cycles.len(), 1);
            }
        }
        // Dedekind's number for three variables is 20; without the empty and the full set.
        assert_eq!(found, 18);
    }

    #[test]
    fn sheets_are_the_components_of_inside_corners() {
        let mut by_vertices = BTreeMap::new();
        for mask in 1..255u8 {
            let case = &CASES[mask as usize];
            let sheets = case.sheets;
            assert!(sheets.count as usize <= case.cycles.len());
            for c in Corner::ALL {
                assert_eq!(sheets.vertex[c.index()] < sheets.vertices, is_inside(mask, c), "mask {mask}");
            }
            *by_vertices.entry((sheets.count, sheets.vertices)).or_insert(0) += 1;
        }
        let regular: i32 =
            by_vertices.iter().filter(|((sheets, vertices), _)| sheets == vertices).map(|(_, n)| n).sum();
        // 36 masks have a sheet that passes a face twice, 4 have a tunnel (PolyMender cuts the former in two).
        assert_eq!(254 - regular, 40);
    }
}
