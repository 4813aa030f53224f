//! Small holes.
//!
//! A rim of `n` edges is closed by the triangulation that folds least, and of those the one with the least area (Barequet and Sharir
//! 1995; Liepa 2003, section 3): [`span`]. Where it is coarser than the faces around it, it is refined and faired: [`refine`].
//!
//! A filling is only kept if it has no triangle without area, no edge that is there already, and (if that is checked) does not meet the
//! rest of the surface; what fails smooth is tried plain, and then left open.

mod refine;
mod span;

use super::Setting;
use super::flat::is_flat;
use crate::mesh::{EdgeKey, Mesh, Topology};
use glam::DVec3;
use std::collections::BTreeSet;

/// A filling: triangles over the mesh's points and some of its own, which have the numbers from the mesh's on.
#[derive(Debug, Clone, Default)]
struct Patch {
    triangles: Vec<[u32; 3]>,
    points: Vec<DVec3>,
}

/// Fills holes. Tells how many.
pub(super) fn fill(mesh: &Mesh, setting: &Setting) -> (Mesh, u64) {
    let topology = Topology::new(mesh);
    let rims: Vec<Vec<u32>> = topology
        .boundary_loops()
        .into_iter()
        .filter(|rim| rim.is_closed && (3..=setting.max_hole_edges as usize).contains(&rim.points.len()))
        .filter(|rim| rim.sides.iter().zip(&rim.points).all(|(&side, &point)| topology.ends(side)[0] == point))
        // Fillings run against the faces at the rim.
        .map(|rim| rim.points.into_iter().rev().collect())
        .collect();
    let mut new_edges = BTreeSet::new();
    let plain: Vec<Option<Patch>> = rims.iter().map(|rim| plain(&topology, rim, &mut new_edges)).collect();
    let smooth = |patch: &Patch| refine::refined(&topology, patch).filter(|_| setting.smooth);
    let mut patches: Vec<Option<Patch>> =
        plain.iter().map(|p| p.as_ref().map(|p| smooth(p).unwrap_or_else(|| p.clone()))).collect();
    let mut result = with_patches(mesh, &patches);
    if setting.check_intersections {
        for fallback in [&plain[..], &[]] {
            let bad = meeting(mesh, &result, &patches);
            if bad.is_empty() {
                break;
            }
            bad.into_iter().for_each(|i| patches[i] = fallback.get(i).cloned().flatten());
            result = with_patches(mesh, &patches);
        }
    }
    (result, patches.iter().flatten().count() as u64)
}

/// The filling without points of its own; its edges are noted, so that no other uses them.
fn plain(topology: &Topology<'_>, rim: &[u32], new_edges: &mut BTreeSet<EdgeKey>) -> Option<Patch> {
    let triangles = span::span(topology, rim, new_edges)?;
    let at = |v: u32| topology.mesh().points[v as usize];
    // A face alone has a rim, too, and would be filled by its own back.
    if triangles.iter().any(|t| is_flat(t.map(at)) || topology.find_face(t).is_some()) {
        return None;
    }
    for &[a, b, c] in &triangles {
        new_edges.extend([EdgeKey::new(a, b), EdgeKey::new(b, c), EdgeKey::new(c, a)]);
    }
    Some(Patch { triangles, points: Vec::new() })
}

/// The mesh with its fillings behind its own faces.
fn with_patches(mesh: &Mesh, patches: &[Option<Patch>]) -> Mesh {
    let mut result = mesh.clone();
    for patch in patches.iter().flatten() {
        let shift = (result.points.len() - mesh.points.len()) as u32;
        let own = |v: u32| if (v as usize) < mesh.points.len() { v } else { v + shift };
        patch.triangles.iter().for_each(|t| result.faces.push(&t.map(own)));
        result.points.extend(&patch.points);
    }
    result
}

/// Which fillings meet something, themselves included.
fn meeting(mesh: &Mesh, result: &Mesh, patches: &[Option<Patch>]) -> Vec<usize> {
    let first = mesh.faces.len() as u32;
    let mut owners = Vec::new();
    for (i, patch) in patches.iter().enumerate() {
        owners.resize(owners.len() + patch.as_ref().map_or(0, |p| p.triangles.len()), i);
    }
    // So many that all have to go, one way or the other.
    let Some(pairs) = result.intersections_from(first, 1 << 20) else { return (0..patches.len()).collect() };
    let mut bad: Vec<usize> =
        pairs.iter().flatten().filter(|&&f| f >= first).map(|&f| owners[(f - first) as usize]).collect();
    bad.sort_unstable();
    bad.dedup();
    bad
}

#[cfg(test)]
mod tests {
    use super::super::tests::setting;
    use super::*;
    use crate::mesh::sample;

    #[test]
    fn holes_of_a_knot_are_filled_to_match() {
        let whole = sample::build("knot", 1).unwrap().report();
        let open = sample::build("knot-holes", 1).unwrap();
        for smooth in [false, true] {
            let (filled, count) = fill(&open, &Setting { smooth, ..setting() });
            assert_eq!((filled.validate(), count), (Ok(()), 7));
            assert!(!filled.has_self_intersections());
            assert_eq!(filled.points[..open.points.len()], open.points[..]);
            assert!((filled.report().volume / whole.volume - 1.0).abs() < 1e-3);
            let report = filled.report();
            assert!(report.genus == Some(1) && report.zero_area_faces == 0);
            assert!(
                !smooth || report.faces.abs_diff(whole.faces) < whole.faces / 50,
                "{} {}",
                report.faces,
                whole.faces
            );
        }
    }

    #[test]
    fn a_cap_of_a_ball_is_round_again() {
        let ball = sample::build("sphere", 1).unwrap();
        let is_cap = |face: &[u32]| face.iter().all(|&v| ball.points[v as usize].z > 0.8);
        let open = super::super::rebuilt(&ball, |_, face, faces| {
            if !is_cap(face) {
                faces.push(face);
            }
        });
        let open = super::super::clean::without_unused(open).0;
        let missing = |smooth| {
            let (filled, count) = fill(&open, &Setting { smooth, ..setting() });
            assert_eq!((filled.validate(), count), (Ok(()), 1));
            1.0 - filled.report().volume / ball.report().volume
        };
        let (flat, round) = (missing(false), missing(true));
        assert!(flat > 0.015 && round.abs() < 0.1 * flat, "{flat} {round}");
    }

    #[test]
    fn large_holes_and_flat_ones_stay_open() {
        let open = sample::build("knot-holes", 1).unwrap();
        assert_eq!(fill(&open, &Setting { max_hole_edges: 5, ..setting() }).1, 0);
        // A crack: three points on a line.
        let points = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X, DVec3::Y];
        let faces: [&[u32]; 2] = [&[0, 1, 3], &[1, 2, 3]];
        let sheet = Mesh { points, faces: faces.into_iter().collect() };
        // Its rim would be filled by the sheet's other side.
        assert_eq!(fill(&sheet, &setting()).1, 0);
        let alone = Mesh { faces: [&[0, 1, 3][..]].into_iter().collect(), ..sheet };
        assert_eq!(fill(&alone, &setting()).1, 0);
    }

    #[test]
    fn a_lid_of_a_box_is_two_triangles() {
        let cube = sample::build("cube", 1).unwrap();
        let open = super::super::rebuilt(&cube, |i, face, faces| {
            if i > 0 {
                faces.push(face);
            }
        });
        let (filled, count) = fill(&open, &setting());
        assert_eq!((filled.faces.len(), count, filled.validate()), (7, 1, Ok(())));
        assert!((filled.report().volume - 1.0).abs() < 1e-12);
    }
}
