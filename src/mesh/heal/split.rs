//! Parts that share edges or points which they should not.
//!
//! Around an edge with four users or more, faces are sorted by angle. Each face that runs from the lower point to the higher one has its
//! inside just before it, so it belongs with the face before, which must run the other way: the two bound one wedge of the inside,
//! and stay together. Where that does not come out even, the edge is left as it is. Then the corners at each point fall into fans
//! that hang together by such pairs and by ordinary edges, and every fan but the first is given a copy of the point. (Guéziec et al.
//! 2001, "Cutting and stitching", cut all faces at such an edge apart; pairs leave no rims.)

use super::{Setting, rebuilt};
use crate::mesh::{Mesh, Topology};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

/// Angles between neighbouring faces, in radians, below which it is not certain which comes first.
const TIE: f64 = 1e-9;

/// Cuts solids apart that share edges. Tells how many points were copied.
pub(super) fn split_edges(mesh: &Mesh, _: &Setting) -> (Mesh, u64) {
    let topology = Topology::new(mesh);
    let mut pairs: BTreeMap<u32, u32> = BTreeMap::new();
    let mut points = BTreeSet::new();
    for side in topology.edges().filter(|&side| topology.count(side) > 2) {
        if let Some(paired) = pair(&topology, side) {
            points.extend(topology.ends(side));
            paired.into_iter().for_each(|[a, b]| pairs.extend([(a, b), (b, a)]));
        }
    }
    copy_points(&topology, points, &pairs)
}

/// Gives each fan beyond the first of its point a point of its own. Tells how many.
pub(super) fn split_ties(mesh: &Mesh, _: &Setting) -> (Mesh, u64) {
    let topology = Topology::new(mesh);
    let points = (0..mesh.points.len() as u32).filter(|&v| topology.fans(v) > 1);
    copy_points(&topology, points, &BTreeMap::new())
}

/// Which users of an edge belong together.
fn pair(topology: &Topology<'_>, side: u32) -> Option<Vec<[u32; 2]>> {
    let [low, high] = topology.key(side).ends();
    let at = |v: u32| topology.mesh().points[v as usize];
    let axis = (at(high) - at(low)).try_normalize()?;
    let across = axis.any_orthonormal_vector();
    let up = axis.cross(across);
    let mut around = Vec::new();
    for user in topology.users(side) {
        let is_forward = topology.ends(user)[0] == low;
        let direction = if is_forward { axis } else { -axis };
        // From the edge into the face.
        let inward: DVec3 = topology.normal(topology.face(user))?.cross(direction);
        around.push((inward.dot(up).atan2(inward.dot(across)), is_forward, user));
    }
    around.sort_by(|a, b| a.0.total_cmp(&b.0));
    let n = around.len();
    (0..n)
        .map(|i| {
            let (here, before) = (around[i], around[(i + n - 1) % n]);
            let gap = (here.0 - before.0).rem_euclid(2.0 * PI);
            let is_clear = gap > TIE && gap < 2.0 * PI - TIE && here.1 != before.1;
            is_clear.then_some((here.1, [before.2, here.2]))
        })
        .collect::<Option<Vec<_>>>()
        .map(|all| all.into_iter().filter(|(is_forward, _)| *is_forward).map(|(_, pair)| pair).collect())
}

/// Copies points so that each fan has its own, where fans hang together by ordinary edges, by pairs of sides, and by edges of which
/// nothing is known. Tells how many copies were made.
fn copy_points(
    topology: &Topology<'_>,
    points: impl IntoIterator<Item = u32>,
    pairs: &BTreeMap<u32, u32>,
) -> (Mesh, u64) {
    let mut mesh = topology.mesh().clone();
    let mut renamed: BTreeMap<u32, u32> = BTreeMap::new();
    for v in points {
        let corners = topology.corners_at(v);
        // Fans by their lowest corners.
        let mut fans: BTreeMap<u32, u32> = BTreeMap::new();
        let mut count = 0;
        for &first in corners {
            if fans.contains_key(&first) {
                continue;
            }
            let mut waiting = vec![first];
            fans.insert(first, count);
            while let Some(corner) = waiting.pop() {
                for side in [corner, topology.prev(corner)] {
                    let [a, b] = topology.ends(side);
                    let partners: Vec<u32> = match pairs.get(&side) {
                        Some(&other) => vec![other],
                        None if a == b => Vec::new(),
                        None => topology.users(side).skip(1).collect(),
                    };
                    for user in partners {
                        let beyond = if topology.ends(user)[0] == v { user } else { topology.next(user) };
                        fans.entry(beyond).or_insert_with(|| {
                            waiting.push(beyond);
                            count
                        });
                    }
                }
            }
            count += 1;
        }
        let first_copy = mesh.points.len() as u32;
        mesh.points.extend((1..count).map(|_| topology.mesh().points[v as usize]));
        renamed.extend(fans.iter().filter(|fan| *fan.1 > 0).map(|(&corner, fan)| (corner, first_copy + fan - 1)));
    }
    let copies = mesh.points.len() - topology.mesh().points.len();
    let mut corners = Vec::new();
    let faces = rebuilt(topology.mesh(), |i, face, faces| {
        corners.clear();
        let range = topology.mesh().faces.range(i as usize);
        corners.extend(range.zip(face).map(|(corner, v)| *renamed.get(&(corner as u32)).unwrap_or(v)));
        faces.push(&corners);
    });
    (Mesh { faces: faces.faces, ..mesh }, copies as u64)
}

#[cfg(test)]
mod tests {
    use super::super::tests::setting;
    use super::*;
    use crate::mesh::sample;

    /// Cubes at some places, welded where they touch.
    fn cubes(places: &[[f64; 3]]) -> Mesh {
        let cube = sample::build("cube", 1).unwrap();
        let mut mesh = Mesh::default();
        for place in places {
            let numbers: Vec<u32> = cube
                .points
                .iter()
                .map(|p| {
                    let p = *p + DVec3::from_array(*place);
                    let known = mesh.points.iter().position(|q| *q == p);
                    known.unwrap_or_else(|| {
                        mesh.points.push(p);
                        mesh.points.len() - 1
                    }) as u32
                })
                .collect();
            cube.faces
                .iter()
                .for_each(|f| mesh.faces.push(&f.iter().map(|&v| numbers[v as usize]).collect::<Vec<_>>()));
        }
        mesh
    }

    #[test]
    fn cubes_that_share_an_edge_are_cut_apart() {
        let two = cubes(&[[0.0; 3], [1.0, 1.0, 0.0]]);
        assert_eq!((two.report().non_manifold_edges, two.points.len()), (1, 14));
        let (apart, copies) = split_edges(&two, &setting());
        assert_eq!((apart.validate(), copies, apart.report().components), (Ok(()), 2, 2));
        assert!((apart.report().volume - 2.0).abs() < 1e-12);
        // Faces keep their places.
        for (a, b) in apart.faces.iter().zip(two.faces.iter()) {
            assert!(a.iter().zip(b).all(|(&a, &b)| apart.points[a as usize] == two.points[b as usize]));
        }
    }

    #[test]
    fn cubes_that_share_a_corner_are_untied() {
        let two = cubes(&[[0.0; 3], [1.0, 1.0, 1.0]]);
        assert_eq!(split_edges(&two, &setting()).1, 0);
        let (apart, copies) = split_ties(&two, &setting());
        assert_eq!((apart.validate(), copies), (Ok(()), 1));
    }

    #[test]
    fn three_sheets_along_an_edge_stay() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Y];
        let faces: [&[u32]; 3] = [&[0, 1, 2], &[0, 1, 3], &[1, 0, 4]];
        let sheets = Mesh { points, faces: faces.into_iter().collect() };
        assert_eq!(split_edges(&sheets, &setting()), (sheets.clone(), 0));
    }
}
