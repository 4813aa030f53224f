//! Cracks where one long edge meets several short ones.
//!
//! Points of rims that lie on an edge of a rim, within the tolerance, become corners of the face there, in their order along the edge. The
//! edge is then as many pieces as the edges on the other side of the crack, and shares them. An edge is only cut where at least half of
//! its pieces find a partner, itself cut or not, so that cutting never leaves more rim than there was.

use super::{Setting, is_crowded, rebuilt};
use crate::mesh::gaps::{Near, place_on};
use crate::mesh::{EdgeKey, Mesh, Topology, triangulate};
use ahash::RandomState;
use hashbrown::HashMap;

/// Cuts edges of rims at points of rims that lie on them. Tells how many edges were cut.
pub(super) fn stitch(mesh: &Mesh, setting: &Setting) -> (Mesh, u64) {
    let topology = Topology::new(mesh);
    let sides = topology.boundary_sides();
    let mut rim: Vec<u32> = sides.iter().flat_map(|&side| topology.ends(side)).collect();
    rim.sort_unstable();
    rim.dedup();
    rim.retain(|&v| mesh.points[v as usize].is_finite());
    let at = |v: u32| mesh.points[v as usize];
    let near = Near::of_rim(&topology, &sides, &rim, setting.tolerance);
    let mut cuts: Vec<(u32, Vec<u32>)> = Vec::new();
    let mut pairs = 0;
    for &side in &sides {
        if is_crowded(pairs, rim.len()) {
            return (mesh.clone(), 0);
        }
        let [a, b] = topology.ends(side);
        let face = mesh.faces.get(topology.face(side) as usize);
        let mut on: Vec<(f64, u32)> = Vec::new();
        near.along(at(a), at(b), |v| {
            pairs += 1;
            if let Some(t) = place_on(at(a), at(b), at(v), setting.tolerance)
                && !face.contains(&v)
                && !on.iter().any(|&(_, known)| known == v)
            {
                on.push((t, v));
            }
        });
        if !on.is_empty() {
            on.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            cuts.push((side, on.into_iter().map(|(_, v)| v).collect()));
        }
    }
    keep_matching(&topology, &sides, &mut cuts);
    apply(mesh, &topology, &cuts)
}

/// The pieces of a cut edge.
fn pieces(topology: &Topology<'_>, side: u32, cut: &[u32]) -> Vec<EdgeKey> {
    let [a, b] = topology.ends(side);
    let points: Vec<u32> = std::iter::once(a).chain(cut.iter().copied()).chain([b]).collect();
    points.windows(2).map(|pair| EdgeKey::new(pair[0], pair[1])).collect()
}

/// Drops cuts most of whose pieces nobody shares, until none is left.
fn keep_matching(topology: &Topology<'_>, sides: &[u32], cuts: &mut Vec<(u32, Vec<u32>)>) {
    loop {
        let mut users: HashMap<EdgeKey, u32, RandomState> = HashMap::with_hasher(RandomState::with_seeds(5, 6, 7, 8));
        for &side in sides {
            let cut = cuts.binary_search_by_key(&side, |cut| cut.0).map_or(&[][..], |i| &cuts[i].1);
            pieces(topology, side, cut).into_iter().for_each(|key| *users.entry(key).or_default() += 1);
        }
        let before = cuts.len();
        cuts.retain(|(side, cut)| {
            let pieces = pieces(topology, *side, cut);
            let shared = pieces.iter().filter(|key| users[*key] == 2).count();
            // A piece that is an edge elsewhere, inside the surface, would become non-manifold.
            let is_free =
                |key: &EdgeKey| topology.find(key.ends()[0], key.ends()[1]).is_none_or(|s| topology.count(s) == 1);
            2 * shared >= pieces.len() && pieces.iter().all(is_free)
        });
        if cuts.len() == before {
            return;
        }
    }
}

/// Puts the points into the faces; triangles that were cut become triangles again.
fn apply(mesh: &Mesh, topology: &Topology<'_>, cuts: &[(u32, Vec<u32>)]) -> (Mesh, u64) {
    let mut cut = Vec::new();
    let mut corners: Vec<u32> = Vec::new();
    let result = rebuilt(mesh, |i, face, faces| {
        corners.clear();
        for (side, &v) in (mesh.faces.range(i as usize).start as u32..).zip(face) {
            corners.push(v);
            if let Ok(at) = cuts.binary_search_by_key(&side, |cut| cut.0) {
                debug_assert_eq!(topology.face(side), i);
                corners.extend(&cuts[at].1);
            }
        }
        if face.len() == 3 && corners.len() > 3 {
            cut.clear();
            triangulate(&mesh.points, &corners, &mut cut);
            cut.iter().for_each(|triangle| faces.push(triangle));
        } else {
            faces.push(&corners);
        }
    });
    (result, cuts.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::super::tests::setting;
    use super::*;
    use crate::mesh::sample;
    use glam::DVec3;

    /// A cube whose top is one square, while the sides are cut n times: no point of the top's edges is in the middle.
    #[test]
    fn one_edge_meets_several() {
        for n in [2, 3, 7] {
            let cube = sample::build("cube", n).unwrap();
            let is_top = |mesh: &Mesh, face: &[u32]| face.iter().all(|&v| mesh.points[v as usize].z == 1.0);
            let corner =
                |x: f64, y: f64| cube.points.iter().position(|p| *p == DVec3::new(x, y, 1.0)).expect("a corner") as u32;
            let top = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            for split in [false, true] {
                let mut open = rebuilt(&cube, |_, face, faces| {
                    if !is_top(&cube, face) {
                        faces.push(face);
                    }
                });
                if split {
                    open.faces.push(&top[..3]);
                    open.faces.push(&[top[0], top[2], top[3]]);
                } else {
                    open.faces.push(&top);
                }
                let before = super::super::clean::without_unused(open).0;
                let (closed, count) = stitch(&before, &Setting { tolerance: 1e-9, ..setting() });
                assert_eq!(
                    (count, closed.report().boundary_edges, closed.report().zero_area_faces),
                    (4, 0, 0),
                    "{n} {split}"
                );
                assert!((closed.report().volume - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn points_that_lead_nowhere_stay_out() {
        // A triangle that touches the middle of a square's edge with its tip.
        let points = [[0.0, 0.0], [2.0, 0.0], [2.0, -1.0], [0.0, -1.0], [1.0, 0.0], [1.5, 1.0], [0.5, 1.0]];
        let points = points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
        let faces: [&[u32]; 2] = [&[0, 3, 2, 1], &[4, 5, 6]];
        let mesh = Mesh { points, faces: faces.into_iter().collect() };
        let (same, count) = stitch(&mesh, &Setting { tolerance: 1e-9, ..setting() });
        assert_eq!((same == mesh, count), (true, 0));
    }
}
