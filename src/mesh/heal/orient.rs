//! Faces that look the wrong way.
//!
//! In each patch the fewer faces are turned. A patch that is closed then bounds something: one that lies in an even number of others must
//! enclose a positive volume and is turned as a whole if it does not. Within an odd number of others it may be the wall of a cavity or
//! another solid, and only the author knows: it is turned only if the patch right around it is.

use super::{Setting, rebuilt};
use crate::mesh::{Bounds, Mesh, Orientation, Topology, triangulate};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Turns faces. Tells how many.
pub(super) fn orient(mesh: &Mesh, _: &Setting) -> (Mesh, u64) {
    let topology = Topology::new(mesh);
    let found = topology.orientation();
    let count = found.count as usize;
    let mut sizes = vec![[0u64; 2]; count];
    let mut is_closed = vec![true; count];
    let mut faces: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (face, &patch) in (0u32..).zip(&found.patches).filter(|(_, patch)| **patch != Orientation::NONE) {
        let patch = patch as usize;
        sizes[patch][usize::from(found.turned[face as usize])] += 1;
        is_closed[patch] &= topology.sides(face).all(|side| topology.count(side) == 2);
        faces[patch].push(face);
    }
    for &side in &found.conflicts {
        is_closed[found.patches[topology.face(side) as usize] as usize] = false;
    }
    // Whether the faces of a patch are turned that run against its first.
    let turns_minority: Vec<bool> = sizes.iter().map(|n| n[1] <= n[0]).collect();
    let goes = |face: u32, patch: usize| found.turned[face as usize] == turns_minority[patch];
    let shells: Vec<Shell> = (0..count)
        .filter(|&patch| is_closed[patch])
        .map(|patch| Shell::new(mesh, patch, &faces[patch], |face| goes(face, patch)))
        .collect();
    let mut turns = vec![false; count];
    outward(&shells, &mut turns);
    let mut done = 0;
    let result = rebuilt(mesh, |i, face, faces| {
        let patch = found.patches[i as usize] as usize;
        if patch < count && goes(i, patch) != turns[patch] {
            done += 1;
            // The first corner stays first.
            let turned: Vec<u32> = face[..1].iter().chain(face[1..].iter().rev()).copied().collect();
            faces.push(&turned);
        } else {
            faces.push(face);
        }
    });
    (result, done)
}

/// A closed patch.
struct Shell {
    patch: usize,
    bounds: Bounds,
    volume: f64,
    triangles: Vec<[DVec3; 3]>,
}

impl Shell {
    fn new(mesh: &Mesh, patch: usize, faces: &[u32], is_turned: impl Fn(u32) -> bool) -> Self {
        let mut shell = Shell { patch, bounds: Bounds::EMPTY, volume: 0.0, triangles: Vec::new() };
        let mut cut = Vec::new();
        for &face in faces {
            cut.clear();
            triangulate(&mesh.points, mesh.faces.get(face as usize), &mut cut);
            let corners = cut.iter().map(|t| t.map(|v| mesh.points[v as usize]));
            shell.triangles.extend(corners.map(|[a, b, c]| if is_turned(face) { [a, c, b] } else { [a, b, c] }));
        }
        shell.triangles.iter().flatten().for_each(|&p| shell.bounds.add(p));
        let center = shell.bounds.center();
        let pyramid = |[a, b, c]: &[DVec3; 3]| (a - center).dot((b - center).cross(c - center));
        shell.volume = shell.triangles.iter().map(pyramid).sum::<f64>() / 6.0;
        shell
    }

    /// Whether a point lies within: the solid angle under which the shell is seen is not 0 (Van Oosterom and Strackee 1983).
    fn contains(&self, p: DVec3) -> bool {
        let angle = |t: &[DVec3; 3]| {
            let [a, b, c] = t.map(|corner| corner - p);
            let [la, lb, lc] = [a, b, c].map(DVec3::length);
            2.0 * a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
        };
        self.triangles.iter().map(angle).sum::<f64>().abs() > 2.0 * PI
    }

    fn has_in_box(&self, p: DVec3) -> bool {
        p.cmpge(self.bounds.min).all() && p.cmple(self.bounds.max).all()
    }
}

/// The most triangles that are looked at to find out what lies in what: some seconds. With more work than that, as foams of thousands
/// of cavities would make, closed patches stay as they are.
const MOST_WORK: u64 = 1 << 28;

/// Which closed patches are to be turned as a whole.
fn outward(shells: &[Shell], turns: &mut [bool]) {
    // From large to small: whatever is around a shell is larger.
    let mut order: Vec<&Shell> = shells.iter().collect();
    order.sort_by(|a, b| b.volume.abs().total_cmp(&a.volume.abs()).then(a.patch.cmp(&b.patch)));
    let probe = |shell: &Shell| shell.triangles.first().map_or(DVec3::NAN, |[a, b, c]| (a + b + c) / 3.0);
    let candidates = |i: usize| {
        let p = probe(order[i]);
        order[..i].iter().enumerate().filter(move |(_, shell)| shell.has_in_box(p))
    };
    let cost = |i: usize| candidates(i).map(|(_, shell)| shell.triangles.len() as u64).sum::<u64>();
    if (0..order.len()).into_par_iter().map(cost).sum::<u64>() > MOST_WORK {
        return;
    }
    let find = |i: usize| -> Vec<usize> {
        candidates(i).filter(|(_, shell)| shell.contains(probe(order[i]))).map(|(j, _)| j).collect()
    };
    let around: Vec<Vec<usize>> = (0..order.len()).into_par_iter().map(find).collect();
    for (i, shell) in order.iter().enumerate() {
        // The innermost has the most around itself.
        let parent = around[i].iter().copied().max_by_key(|&j| around[j].len());
        turns[shell.patch] = match parent {
            Some(parent) if around[i].len() % 2 == 1 => turns[order[parent].patch],
            _ => shell.volume < 0.0,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::setting;
    use super::*;
    use crate::mesh::sample;

    fn turned(mesh: &Mesh, test: impl Fn(usize) -> bool) -> Mesh {
        rebuilt(mesh, |i, face, faces| {
            let mut face = face.to_vec();
            if test(i as usize) {
                face[1..].reverse();
            }
            faces.push(&face);
        })
    }

    #[test]
    fn turned_faces_are_turned_back() {
        for name in ["torus", "nested", "cube", "knot-holes"] {
            let mesh = sample::build(name, 1).unwrap();
            for (what, test) in [
                ("a third", (|i| i % 3 == 1) as fn(usize) -> bool),
                ("all", |_| true),
                ("two thirds", |i| i % 3 != 1),
                ("none", |_| false),
            ] {
                let (healed, count) = orient(&turned(&mesh, test), &setting());
                if name == "knot-holes" {
                    // Nothing tells which side of an open surface is outside.
                    assert_eq!(healed.report().inconsistent_edges, 0);
                } else {
                    assert!(healed == mesh, "{name}, {what}");
                    assert_eq!(count, (0..mesh.faces.len()).filter(|&i| test(i)).count() as u64);
                }
            }
        }
    }

    #[test]
    fn a_solid_in_a_solid_is_left_to_its_author() {
        let ball = sample::build("sphere", 1).unwrap();
        let mut two = ball.clone();
        let n = ball.points.len() as u32;
        two.points.extend(ball.points.iter().map(|p| 0.5 * p));
        ball.faces.iter().for_each(|f| two.faces.push(&[f[0] + n, f[1] + n, f[2] + n]));
        assert_eq!(orient(&two, &setting()), (two.clone(), 0));
        // Side by side, each has its own outside.
        two.points[n as usize..].iter_mut().for_each(|p| p.x += 5.0);
        let one_turned = turned(&two, |i| i < ball.faces.len());
        assert!(orient(&one_turned, &setting()).0 == two);
    }
}
