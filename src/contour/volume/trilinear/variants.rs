//! The surfaces that a mask can have, depending on what is joined through its faces and its middle: derived, not typed in.
//!
//! On a face with two corners inside, opposite to each other, either these are joined or the two others are. That choice, made for each such
//! face, says how the segments on the faces link up into cycles. The surface consists of discs bounded by one cycle each, but for one
//! tunnel that may join two of them. (Chernyaev's cases, 4 to 13, are these choices up to symmetry.)
//!
//! Discs are triangulated without other points where that can be done without a diagonal in a face of the cell, where the next cell could
//! have the same one. Where it cannot, they are a fan round a point in the middle; and tunnels have three points round their neck. (Tables of
//! the 33 cases use such diagonals; where two cells do so at the same face, four triangles meet in one edge.)

use crate::grid::cases::{Mask, best_disc, best_tunnel, cycles_of, inside_end, middle};
use crate::grid::{Corner, Edge, Face};
use std::sync::LazyLock;

/// A triangulated surface in a cell.
#[derive(Debug, Clone, Default)]
pub(super) struct Patch {
    /// Corners of triangles, three for each, counter-clockwise seen from outside: numbers of edges, and from 12 on of centres.
    pub(super) corners: Vec<u8>,
    /// The discs that have a point in the middle: their cycles.
    pub(super) centres: Vec<Vec<Edge>>,
}

/// What a mask and its faces have in common: all but what is joined through the middle.
#[derive(Debug, Clone)]
pub(super) struct Variant {
    /// The region of the cell's boundary that each corner is in.
    pub(super) regions: [u8; 8],
    /// The cycles, each directed with the inside on its left.
    pub(super) cycles: Vec<Vec<Edge>>,
    /// All of them discs.
    pub(super) discs: Patch,
    /// Two regions that may be joined by a tunnel, and the surface then.
    pub(super) tunnels: Vec<([u8; 2], Patch)>,
}

/// All variants of a mask.
#[derive(Debug, Clone)]
pub(super) struct Variants {
    /// The faces on which something has to be chosen.
    pub(super) faces: Vec<Face>,
    /// By choice: bit i is set if the inside corners of face i are joined.
    pub(super) by_choice: Vec<Variant>,
}

impl Variants {
    /// Whether there is nothing to choose.
    pub(super) fn is_plain(&self) -> bool {
        self.by_choice.len() == 1 && self.by_choice[0].tunnels.is_empty()
    }
}

/// By mask. Derived at first use, in some milliseconds.
pub(super) static VARIANTS: LazyLock<Vec<Variants>> = LazyLock::new(|| (0..=255).map(derive).collect());

fn derive(mask: Mask) -> Variants {
    let is_inside = |corner: Corner| mask >> corner.index() & 1 == 1;
    let is_open = |face: &Face| {
        let ring = face.corners().map(is_inside);
        ring[0] == ring[2] && ring[1] == ring[3] && ring[0] != ring[1]
    };
    let faces: Vec<Face> = Face::ALL.into_iter().filter(is_open).collect();
    let by_choice = (0..1u32 << faces.len())
        .map(|choice| {
            let joined = |face: Face| faces.iter().position(|&f| f == face).is_some_and(|i| choice >> i & 1 == 1);
            variant(mask, joined)
        })
        .collect();
    Variants { faces, by_choice }
}

fn variant(mask: Mask, joined: impl Fn(Face) -> bool) -> Variant {
    let is_inside = |corner: Corner| mask >> corner.index() & 1 == 1;
    // Where the segment goes that starts on an edge.
    let mut next = [None; 12];
    for face in Face::ALL {
        let ring = face.corners();
        let edge_after = |i: usize| Edge::between(ring[i % 4], ring[(i + 1) % 4]).expect("neighbours on a face");
        let leaves = |&i: &usize| is_inside(ring[i % 4]) && !is_inside(ring[(i + 1) % 4]);
        for enter in (0..4).filter(|&i| !is_inside(ring[i]) && is_inside(ring[(i + 1) % 4])) {
            // Round the inside corners, or round the outside ones if it is joined.
            let leave = if joined(face) { enter + 3 } else { (enter + 1..enter + 4).find(leaves).expect("mixed") };
            next[edge_after(enter).index()] = Some(edge_after(leave));
        }
    }
    let cycles = cycles_of(next);
    let regions = regions(mask, joined);
    let discs = patch(cycles.iter().map(|cycle| &cycle[..]), None);
    let mut variant = Variant { regions, cycles, discs, tunnels: Vec::new() };
    variant.tunnels = tunnels(mask, &variant);
    variant
}

/// Corners of one sign that are joined over edges and faces.
fn regions(mask: Mask, joined: impl Fn(Face) -> bool) -> [u8; 8] {
    let mut region: [u8; 8] = std::array::from_fn(|i| i as u8);
    let mut join = |a: Corner, b: Corner| {
        let (from, to) = (region[a.index()], region[b.index()]);
        if mask >> a.index() & 1 == mask >> b.index() & 1 {
            region.iter_mut().filter(|r| **r == from).for_each(|r| *r = to);
        }
    };
    Edge::ALL.into_iter().for_each(|edge| join(edge.corners()[0], edge.corners()[1]));
    for face in Face::ALL {
        let ring = face.corners();
        let inside = usize::from(mask >> ring[0].index() & 1 == 0);
        let first = if joined(face) { inside } else { 1 - inside };
        join(ring[first], ring[first + 2]);
    }
    region
}

/// The pairs of regions that a tunnel may join: two of one sign beside a third one. The cycles between are its rims.
fn tunnels(mask: Mask, variant: &Variant) -> Vec<([u8; 2], Patch)> {
    let sides = |cycle: &[Edge]| {
        let inside = inside_end(mask, cycle[0]);
        [inside, inside.across(cycle[0].axis())].map(|corner| variant.regions[corner.index()])
    };
    let mut tunnels = Vec::new();
    for (i, a) in variant.cycles.iter().enumerate() {
        for b in &variant.cycles[i + 1..] {
            let (side_a, side_b) = (sides(a), sides(b));
            let Some(common) = (0..2).find(|&s| side_a[s] == side_b[s]) else { continue };
            let others = variant.cycles.iter().filter(|&c| c != a && c != b).map(|cycle| &cycle[..]);
            tunnels.push(([side_a[1 - common], side_b[1 - common]], patch(others, Some([a, b]))));
        }
    }
    tunnels
}

/// Discs, and perhaps a band between two cycles.
fn patch<'a>(discs: impl Iterator<Item = &'a [Edge]>, band: Option<[&[Edge]; 2]>) -> Patch {
    let mut patch = Patch::default();
    if let Some([a, b]) = band {
        match best_tunnel(a, b) {
            Some(triangles) => patch.corners.extend(triangles.as_flattened().iter().map(|&edge| number(edge))),
            None => patch.band_with_neck(a, b),
        }
    }
    for cycle in discs {
        if let Some(triangles) = best_disc(cycle) {
            patch.corners.extend(triangles.as_flattened().iter().map(|&edge| number(edge)));
        } else {
            let centre = patch.add_centre(cycle.to_vec());
            for (i, &edge) in cycle.iter().enumerate() {
                patch.corners.extend([number(edge), number(cycle[(i + 1) % cycle.len()]), centre]);
            }
        }
    }
    patch
}

fn number(edge: Edge) -> u8 {
    edge.index() as u8
}

impl Patch {
    fn add_centre(&mut self, edges: Vec<Edge>) -> u8 {
        self.centres.push(edges);
        11 + self.centres.len() as u8
    }

    /// A band between two cycles, with three points round its neck: each stands for a third of either cycle.
    fn band_with_neck(&mut self, a: &[Edge], b: &[Edge]) {
        // Seen from one side, the cycles run in opposite directions.
        let back: Vec<Edge> = b.iter().rev().copied().collect();
        let starts = (0..a.len()).flat_map(|i| (0..b.len()).map(move |j| (i, j)));
        let apart = |&(i, j): &(usize, usize)| -> i32 {
            let pairs = thirds(a, i).into_iter().zip(thirds(&back, j));
            pairs.map(|(a, b)| distance(&a, &b)).sum()
        };
        let (i, j) = starts.min_by_key(apart).expect("cycles are not empty");
        let (of_a, of_b) = (thirds(a, i), thirds(&back, j));
        let neck = [0, 1, 2].map(|k| self.add_centre([&of_a[k][..], &of_b[k]].concat()));
        self.collar(&of_a, neck);
        let turned = |third: &Vec<Edge>| third.iter().rev().copied().collect();
        self.collar(&[&of_b[2], &of_b[1], &of_b[0]].map(turned), [neck[2], neck[1], neck[0]]);
    }

    /// The band between a cycle, in three parts, and three points.
    fn collar(&mut self, thirds: &[Vec<Edge>; 3], neck: [u8; 3]) {
        for k in 0..3 {
            let next = (k + 1) % 3;
            for pair in thirds[k].windows(2) {
                self.corners.extend([number(pair[0]), number(pair[1]), neck[k]]);
            }
            let last = number(thirds[k][thirds[k].len() - 1]);
            self.corners.extend([last, number(thirds[next][0]), neck[next], last, neck[next], neck[k]]);
        }
    }
}

/// A cycle from its edge number `start` on, in three parts.
fn thirds(cycle: &[Edge], start: usize) -> [Vec<Edge>; 3] {
    let mut turned = cycle.to_vec();
    turned.rotate_left(start);
    let n = turned.len();
    [0, 1, 2].map(|k| turned[k * n / 3..(k + 1) * n / 3].to_vec())
}

/// Square of the distance between the means of two lists of edges, in some unit.
fn distance(a: &[Edge], b: &[Edge]) -> i32 {
    let mean = |edges: &[Edge]| {
        let sum = edges.iter().map(|&e| middle(e)).fold([0; 3], |sum, m| [0, 1, 2].map(|i| sum[i] + m[i]));
        // 60 is a multiple of all numbers of edges that a third can have.
        sum.map(|c| 60 * c / edges.len() as i32)
    };
    let (a, b) = (mean(a), mean(b));
    (0..3).map(|i| (a[i] - b[i]).pow(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::cases::share_face;
    use std::collections::BTreeMap;

    /// Every patch is a surface bounded by the cycles, and no inner edge lies in a face.
    #[test]
    fn patches_are_bounded_by_their_cycles() {
        let (mut variants, mut tunnels) = (0, 0);
        for variant in VARIANTS.iter().flat_map(|v| &v.by_choice) {
            variants += 1;
            tunnels += variant.tunnels.len();
            let rims: usize = variant.cycles.iter().map(Vec::len).sum();
            let next: BTreeMap<u8, u8> = variant
                .cycles
                .iter()
                .flat_map(|c| (0..c.len()).map(move |i| (c[i].index() as u8, c[(i + 1) % c.len()].index() as u8)))
                .collect();
            for patch in variant.tunnels.iter().map(|t| &t.1).chain([&variant.discs]) {
                let mut sides = BTreeMap::new();
                for t in patch.corners.as_chunks::<3>().0 {
                    (0..3).for_each(|i| *sides.entry((t[i], t[(i + 1) % 3])).or_insert(0) += 1);
                }
                assert!(sides.values().all(|&n| n == 1));
                let rim: Vec<_> = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a))).collect();
                assert_eq!(rim.len(), rims);
                assert!(rim.iter().all(|(a, b)| next[a] == *b));
                for (a, b) in sides.keys().filter(|(a, b)| *a < 12 && *b < 12 && next[a] != *b && next[b] != *a) {
                    assert!(!share_face(Edge::ALL[usize::from(*a)], Edge::ALL[usize::from(*b)]));
                }
            }
        }
        assert_eq!((variants, tunnels), (656, 424));
    }

    /// Chernyaev's case 13: all faces are open, and each of the 64 choices has a surface.
    #[test]
    fn the_chess_board_has_all_choices() {
        let board = &VARIANTS[0b1001_0110];
        assert_eq!((board.faces.len(), board.by_choice.len()), (6, 64));
        let mut cycles = board.by_choice.iter().map(|v| v.cycles.len()).collect::<Vec<_>>();
        cycles.sort_unstable();
        assert_eq!((cycles[0], cycles[63]), (1, 4));
    }
}
