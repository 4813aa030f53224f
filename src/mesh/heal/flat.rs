//! Triangles without area.
//!
//! A triangle whose corners are on a line is a *cap* if one of them is between the others: it goes when the edge between those is
//! flipped, so that the neighbour there is cut in two at the corner. If two corners are at one place, it goes when they become one,
//! provided that no other faces fall together by that (the link condition of Dey et al. 1999).

use super::Setting;
use super::clean::{push_mapped, without_unused};
use crate::mesh::tally::FLAT;
use crate::mesh::{Mesh, Neighbour, Topology};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Rounds in which triangles that do not touch each other are treated at once: strips of caps take one a triangle.
const ROUNDS: usize = 32;

/// Whether a triangle has no area against its longest edge.
pub(super) fn is_flat([a, b, c]: [DVec3; 3]) -> bool {
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    (b - a).cross(c - a).length() <= FLAT * longest
}

/// What becomes of faces and points.
#[derive(Default)]
struct Changes {
    /// Triangles in place of others.
    faces: BTreeMap<u32, Option<[u32; 3]>>,
    /// Points that become others.
    points: BTreeMap<u32, u32>,
    /// Points whose faces change.
    locked: BTreeSet<u32>,
}

/// Flips or collapses triangles without area. Tells how many.
pub(super) fn remove_flat(mesh: &Mesh, _: &Setting) -> (Mesh, u64) {
    let mut mesh = mesh.clone();
    let mut done = 0;
    for _ in 0..ROUNDS {
        let topology = Topology::new(&mesh);
        let mut changes = Changes::default();
        for (i, face) in (0..).zip(mesh.faces.iter()) {
            if let &[a, b, c] = face {
                let is_sound = topology.is_sound(i) && a != b && b != c && c != a;
                if is_sound && is_flat([a, b, c].map(|v| mesh.points[v as usize])) && remove(&topology, i, &mut changes)
                {
                    done += 1;
                }
            }
        }
        if changes.locked.is_empty() {
            break;
        }
        let map = |v: u32| *changes.points.get(&v).unwrap_or(&v);
        let next = super::rebuilt(&mesh, |i, face, faces| match changes.faces.get(&i) {
            Some(Some(triangle)) => faces.push(triangle),
            Some(None) => {}
            None => push_mapped(faces, face, map),
        });
        mesh = without_unused(next).0;
    }
    (mesh, done)
}

/// Plans how a triangle goes, if it can.
fn remove(topology: &Topology<'_>, face: u32, changes: &mut Changes) -> bool {
    let at = |v: u32| topology.mesh().points[v as usize];
    let length = |side: u32| {
        let [a, b] = topology.ends(side);
        at(a).distance(at(b))
    };
    let mut sides: Vec<u32> = topology.sides(face).collect();
    sides.sort_by(|&a, &b| length(a).total_cmp(&length(b)));
    let [shortest, _, longest] = sides[..] else { return false };
    if length(shortest) <= FLAT.sqrt() * length(longest) && collapse(topology, shortest, changes) {
        return true;
    }
    flip(topology, longest, changes) || drop_loose(topology, face, changes)
}

/// Plans to leave a triangle out that is loose on two sides or three: there is no more rim without it.
fn drop_loose(topology: &Topology<'_>, face: u32, changes: &mut Changes) -> bool {
    let corners = topology.mesh().faces.get(face as usize);
    let loose = topology.sides(face).filter(|&side| topology.count(side) == 1).count();
    if loose < 2 || corners.iter().any(|v| changes.locked.contains(v)) {
        return false;
    }
    changes.locked.extend(corners);
    changes.faces.insert(face, None);
    true
}

/// Plans to make one point of an edge's ends.
fn collapse(topology: &Topology<'_>, side: u32, changes: &mut Changes) -> bool {
    let [a, b] = topology.ends(side);
    let gone: Vec<u32> = topology.users(side).map(|user| topology.face(user)).collect();
    let is_triangle = |&face: &u32| topology.mesh().faces.get(face as usize).len() == 3;
    let around: BTreeSet<u32> = topology.connected(a).collect();
    let common = topology.connected(b).filter(|v| around.contains(v)).count();
    // Rims must not come together: an inner edge may have one end on a rim at most.
    let on_rim = |v: u32| {
        topology.corners_at(v).iter().any(|&c| topology.count(c) == 1 || topology.count(topology.prev(c)) == 1)
    };
    let pinches = gone.len() == 2 && on_rim(a) && on_rim(b);
    if gone.len() > 2 || !gone.iter().all(is_triangle) || common != gone.len() || pinches {
        return false;
    }
    let mut touched: BTreeSet<u32> = topology.connected(b).chain(around).chain([a, b]).collect();
    if touched.iter().any(|v| changes.locked.contains(v)) {
        return false;
    }
    changes.locked.append(&mut touched);
    changes.points.insert(a.max(b), a.min(b));
    gone.iter().for_each(|&face| _ = changes.faces.insert(face, None));
    true
}

/// Plans to turn an edge between two triangles into that between their other corners.
fn flip(topology: &Topology<'_>, side: u32, changes: &mut Changes) -> bool {
    let Neighbour::Face(beyond) = topology.neighbour(side) else { return false };
    let (face, other) = (topology.face(side), topology.users(side).nth(1));
    let Some(other) = other.filter(|_| beyond != face) else { return false };
    let [a, b] = topology.ends(side);
    let (v, d) = (topology.ends(topology.prev(side))[0], topology.ends(topology.prev(other))[0]);
    let corners = [a, b, v, d];
    let is_plain = topology.mesh().faces.get(beyond as usize).len() == 3 && topology.ends(other)[0] == b && v != d;
    if !is_plain || corners.iter().any(|p| changes.locked.contains(p)) || topology.find(v, d).is_some() {
        return false;
    }
    let [one, two] = [[a, d, v], [d, b, v]];
    if [one, two].iter().any(|t| is_flat(t.map(|p| topology.mesh().points[p as usize]))) {
        return false;
    }
    changes.locked.extend(corners);
    changes.faces.extend([(face, Some(one)), (beyond, Some(two))]);
    true
}

#[cfg(test)]
mod tests {
    use super::super::tests::setting;
    use super::*;
    use crate::mesh::sample;

    #[test]
    fn caps_are_flipped_and_needles_collapsed() {
        let ball = sample::build("sphere", 1).unwrap();
        let topology = Topology::new(&ball);
        // A cap on every hundredth edge: its middle as a corner of one triangle only, with a flat triangle between.
        let mut mesh = ball.clone();
        let mut cut: BTreeMap<u32, (u32, u32)> = BTreeMap::new();
        for side in topology.edges().step_by(100) {
            let [a, b] = topology.ends(side);
            let middle = mesh.points.len() as u32;
            mesh.points.push(0.5 * (mesh.points[a as usize] + mesh.points[b as usize]));
            cut.insert(topology.face(side), (side, middle));
            let [x, y] = [mesh.points[a as usize], mesh.points[b as usize]];
            assert!(is_flat([x, y, mesh.points[middle as usize]]));
        }
        let mut caps = 0;
        mesh = super::super::rebuilt(&mesh, |i, face, faces| {
            if let Some(&(side, m)) = cut.get(&i) {
                let ([a, b], c) = (topology.ends(side), topology.ends(topology.prev(side))[0]);
                [[a, m, c], [m, b, c], [a, b, m]].iter().for_each(|t| faces.push(t));
                caps += 1;
            } else {
                faces.push(face);
            }
        });
        let mesh = without_unused(mesh).0;
        assert_eq!((mesh.validate(), mesh.report().zero_area_faces), (Ok(()), caps));
        let (healed, done) = remove_flat(&mesh, &setting());
        assert_eq!((healed.validate(), healed.report().zero_area_faces, done), (Ok(()), 0, caps));
        // Two corners of the same place.
        let mut needle = ball.clone();
        let [a, b] = topology.ends(topology.edges().nth(500).unwrap());
        needle.points[a as usize] = needle.points[b as usize];
        assert_eq!((needle.validate(), needle.report().zero_area_faces), (Ok(()), 2));
        let (healed, _) = remove_flat(&needle, &setting());
        assert_eq!((healed.validate(), healed.report().zero_area_faces), (Ok(()), 0));
        assert_eq!((healed.faces.len(), healed.points.len()), (ball.faces.len() - 2, ball.points.len() - 1));
    }

    #[test]
    fn loose_ones_go_and_what_cannot_go_stays() {
        // A flat triangle alone, and one between two faces of which the third side is a rim.
        let points = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Y];
        let of = |faces: &[&[u32]]| Mesh { points: points.clone(), faces: faces.iter().copied().collect() };
        assert_eq!(remove_flat(&of(&[&[0, 1, 2]]), &setting()), (Mesh::default(), 1));
        let between = without_unused(of(&[&[0, 2, 1], &[0, 1, 3], &[1, 2, 4]])).0;
        assert_eq!(remove_flat(&between, &setting()), (between.clone(), 0));
    }
}
