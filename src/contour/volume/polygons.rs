//! The surface of a case as polygons: one for each cycle, or for a part of it, and three for a tunnel.
//!
//! The polygons of all cells are a closed surface whose vertices are the crossed edges. Its dual has a vertex for each polygon and a face
//! for each crossed edge, and is a surface, too: but if two cells' polygons have two segments in common, both in an open face, the dual has
//! two edges between the same two vertices. So cycles that pass through a face twice are cut by diagonals through the cell: then no polygon
//! does, nor has it corners of both segments, so that diagonals of the dual's faces do not come upon its edges either. The dual is a
//! manifold for all signs. (Schaefer, Ju and Warren 2007 have a vertex for each cycle, and leave that to chance.)
//!
//! Two cycles round one component of inside corners bound a tunnel, as in marching cubes: the band between them is three quadrilaterals. So
//! components and handles are those of marching cubes. Materials have no tunnels: what is a tunnel for one of them is two caps for the other one
//! in it, and both shall have the same triangles.

use crate::grid::cases::{CASES, Case, middle, share_face};
use crate::grid::{Edge, Face};

/// The polygons of a case.
#[derive(Debug, Clone, Default)]
pub(super) struct Polygons {
    /// Their edges, in cyclic order, the inside on the left.
    pub(super) list: Vec<Vec<Edge>>,
    /// For each crossed edge, its polygons, counter-clockwise seen from outside.
    pub(super) around: [Vec<u8>; 12],
}

/// Those of all masks, with tunnels or with caps at both ends of each.
pub(super) fn all(with_tunnels: bool) -> Vec<Polygons> {
    CASES.iter().map(|case| polygons(case, with_tunnels)).collect()
}

fn polygons(case: &Case, with_tunnels: bool) -> Polygons {
    let cut = |cycle: &Vec<Edge>| (1..=9).find_map(|parts| cut(cycle, parts)).expect("checked for all 256 masks");
    let list: Vec<Vec<Edge>> = match &case.cycles[..] {
        [a, b] if with_tunnels && case.has_tunnel() => band(a, b),
        cycles => cycles.iter().flat_map(cut).collect(),
    };
    let mut around: [Vec<u8>; 12] = Default::default();
    for edge in case.cycles.iter().flatten() {
        // From the polygon with the segment that leaves the edge on to the one with that which comes.
        let (mut to, mut here) = (after(&case.cycles, *edge), Vec::new());
        while let Some(i) = list.iter().position(|polygon| step(polygon, *edge) == Some(to)) {
            here.push(i as u8);
            to = before(&list[i], *edge);
        }
        around[edge.index()] = here;
    }
    Polygons { list, around }
}

/// The edge after `edge` in a polygon, if it is there.
fn step(polygon: &[Edge], edge: Edge) -> Option<Edge> {
    polygon.iter().position(|&e| e == edge).map(|i| polygon[(i + 1) % polygon.len()])
}

fn after(cycles: &[Vec<Edge>], edge: Edge) -> Edge {
    cycles.iter().find_map(|cycle| step(cycle, edge)).expect("every crossed edge is on a cycle")
}

fn before(polygon: &[Edge], edge: Edge) -> Edge {
    let at = polygon.iter().position(|&e| e == edge).expect("the polygon has the edge");
    polygon[(at + polygon.len() - 1) % polygon.len()]
}

/// A cycle in so many parts, none of which [passes twice](passes_twice) through a face; `None` if there is no such way.
fn cut(cycle: &[Edge], parts: usize) -> Option<Vec<Vec<Edge>>> {
    if parts == 1 {
        return (!passes_twice(cycle)).then(|| vec![cycle.to_vec()]);
    }
    let n = cycle.len();
    let chords = (0..n).flat_map(|i| (i + 2..n).map(move |j| (i, j))).filter(|&(i, j)| !share_face(cycle[i], cycle[j]));
    chords.into_iter().find_map(|(i, j)| {
        let (one, other) = (&cycle[i..=j], [&cycle[j..], &cycle[..=i]].concat());
        (1..parts).find_map(|of_one| Some([cut(one, of_one)?, cut(&other, parts - of_one)?].concat()))
    })
}

/// The band between the rims of a tunnel, which have as many corners, cut along the shortest bridges. The rims are at opposite corners of the
/// cell, so no bridge lies in a face.
fn band(a: &[Edge], b: &[Edge]) -> Vec<Vec<Edge>> {
    let n = a.len();
    let distance = |a: Edge, b: Edge| (0..3).map(|axis| (middle(a)[axis] - middle(b)[axis]).pow(2)).sum::<i32>();
    // The rims run against each other.
    let opposite = |shift: usize, i: usize| b[(shift + n - i) % n];
    let length = |&shift: &usize| (0..n).map(|i| distance(a[i], opposite(shift, i))).sum::<i32>();
    let shift = (0..n).min_by_key(length).expect("rims have corners");
    (0..n).map(|i| vec![a[i], a[(i + 1) % n], opposite(shift, (i + 1) % n), opposite(shift, i)]).collect()
}

/// Whether a polygon has a side in a face, and more corners there than the ends of that.
fn passes_twice(polygon: &[Edge]) -> bool {
    let n = polygon.len();
    let is_in = |edge: usize, face: Face| polygon[edge % n].faces().contains(&face);
    let passes = |face: Face| (0..n).any(|i| is_in(i, face) && is_in(i + 1, face));
    let corners_in = |face: Face| (0..n).filter(|&i| is_in(i, face)).count();
    Face::ALL.into_iter().any(|face| passes(face) && corners_in(face) > 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_pass_through_faces_once() {
        for with_tunnels in [false, true] {
            let all = all(with_tunnels);
            for (polygons, case) in all.iter().zip(&*CASES) {
                assert!(polygons.list.iter().all(|polygon| polygon.len() >= 3 && !passes_twice(polygon)));
                // Each cut adds its two ends. A disc has one less than polygons, a band as many.
                let corners: usize = polygons.list.iter().map(Vec::len).sum();
                let cycles: usize = case.cycles.iter().map(Vec::len).sum();
                let discs = if with_tunnels && case.has_tunnel() { 0 } else { case.cycles.len() };
                assert_eq!(corners, cycles + 2 * (polygons.list.len() - discs));
                assert_eq!(corners, polygons.around.iter().map(Vec::len).sum::<usize>());
            }
            // Few masks need it.
            let cut = all.iter().zip(&*CASES).filter(|(p, c)| p.list.len() > c.cycles.len()).count();
            assert_eq!(cut, if with_tunnels { 40 } else { 36 });
        }
    }

    /// The cells that are inside but for two opposite corners have a tunnel, of three quadrilaterals: each has a side on either rim, and
    /// shares one bridge with each of the others.
    #[test]
    fn tunnels_are_bands() {
        let all = all(true);
        let tunnels: Vec<usize> = (0..256).filter(|&mask| CASES[mask].has_tunnel()).collect();
        assert_eq!(
            tunnels,
            [24, 36, 66, 129].map(|outside: usize| 255 - outside).into_iter().rev().collect::<Vec<_>>()
        );
        for mask in tunnels {
            let (list, cycles) = (&all[mask].list, &CASES[mask].cycles);
            assert_eq!(list.len(), 3);
            for (i, polygon) in list.iter().enumerate() {
                let on = |rim: usize| polygon.iter().filter(|edge| cycles[rim].contains(edge)).count();
                assert_eq!([on(0), on(1)], [2, 2]);
                let next = &list[(i + 1) % 3];
                assert_eq!(polygon.iter().filter(|edge| next.contains(edge)).count(), 2);
            }
            assert!(all[mask].around.iter().all(|around| around.is_empty() || around.len() == 2));
        }
    }
}
