//! Faces that are none, corners that are too many, and faces that are there twice.

use super::{Setting, rebuilt};
use crate::mesh::star::repeated;
use crate::mesh::{Mesh, Polygons, Topology};
use glam::DVec3;
use std::collections::BTreeMap;

/// Removes faces with missing or infinite points or fewer than three corners, repeated corners and spikes, cuts faces that visit a point
/// twice into those that do not, and drops points that no face uses. Tells how many faces and points that were.
pub(super) fn remove_void(mesh: &Mesh, _: &Setting) -> (Mesh, u64) {
    let is_finite = |v: &u32| mesh.points.get(*v as usize).is_some_and(|p| p.is_finite());
    let mut done = 0;
    let mut cycles = Vec::new();
    let faces = rebuilt(mesh, |_, face, faces| {
        if face.len() < 3 || !face.iter().all(is_finite) {
            done += 1;
        } else if repeated(face).is_none() {
            faces.push(face);
        } else {
            done += 1;
            simple_cycles(face, &mut cycles);
            cycles.drain(..).for_each(|cycle| faces.push(&cycle));
        }
    });
    let (mesh, dropped) = without_unused(faces);
    (mesh, done + dropped)
}

/// Puts points that are not finite in the middle of their neighbours, from the outside inwards where several are neighbours. Those that
/// know no finite point stay. Tells how many were moved.
pub(super) fn replace_lost(mesh: &Mesh, _: &Setting) -> (Mesh, u64) {
    let mut lost: Vec<u32> = (0u32..).zip(&mesh.points).filter(|(_, p)| !p.is_finite()).map(|(i, _)| i).collect();
    if lost.is_empty() {
        return (mesh.clone(), 0);
    }
    let topology = Topology::new(mesh);
    let mut result = mesh.clone();
    let mut done = 0;
    loop {
        let middle = |&v: &u32| {
            let known: Vec<DVec3> =
                topology.connected(v).map(|w| result.points[w as usize]).filter(|p| p.is_finite()).collect();
            let origin = *known.first()?;
            let middle = known.iter().map(|&p| (p - origin) / known.len() as f64).sum::<DVec3>() + origin;
            middle.is_finite().then_some((v, middle))
        };
        let found: Vec<(u32, DVec3)> = lost.iter().filter_map(middle).collect();
        if found.is_empty() {
            return (result, done);
        }
        done += found.len() as u64;
        found.iter().for_each(|&(v, p)| result.points[v as usize] = p);
        lost.retain(|&v| !result.points[v as usize].is_finite());
    }
}

/// Cuts a cycle into cycles that visit no point twice, and have three points or more. What remains of spikes has fewer.
/// Sides that are not part of a spike stay.
fn simple_cycles(face: &[u32], cycles: &mut Vec<Vec<u32>>) {
    let mut path: Vec<u32> = Vec::with_capacity(face.len());
    for &v in face {
        if let Some(at) = path.iter().position(|&w| w == v) {
            let cycle = path.split_off(at);
            if cycle.len() >= 3 {
                cycles.push(cycle);
            }
        }
        path.push(v);
    }
    if path.len() >= 3 {
        cycles.push(path);
    }
}

/// The mesh without points that no face uses, in the same order, and how many these were.
pub(super) fn without_unused(mut mesh: Mesh) -> (Mesh, u64) {
    let mut numbers = vec![u32::MAX; mesh.points.len()];
    mesh.faces.corners().iter().for_each(|&v| numbers[v as usize] = 0);
    let mut next = 0;
    for number in numbers.iter_mut().filter(|number| **number == 0) {
        *number = next;
        next += 1;
    }
    let dropped = mesh.points.len() as u64 - u64::from(next);
    if dropped > 0 {
        let mut used = numbers.iter().map(|&number| number != u32::MAX);
        mesh.points.retain(|_| used.next().expect("one for each point"));
        mesh = rebuilt(&mesh, |_, face, faces| push_mapped(faces, face, |v| numbers[v as usize]));
    }
    (mesh, dropped)
}

/// Appends a face with other points.
pub(super) fn push_mapped(faces: &mut Polygons, face: &[u32], map: impl Fn(u32) -> u32) {
    match *face {
        [a, b, c] => faces.push(&[map(a), map(b), map(c)]),
        _ => faces.push(&face.iter().map(|&v| map(v)).collect::<Vec<_>>()),
    }
}

/// Removes faces over the same points as one before; unless bold, none that leaves a rim where there was an edge: two faces back to back
/// that are all there is at an edge stay.
pub(super) fn remove_duplicates(mesh: &Mesh, setting: &Setting) -> (Mesh, u64) {
    let topology = Topology::new(mesh);
    let copies = topology.duplicate_faces();
    if copies.is_empty() {
        return (mesh.clone(), 0);
    }
    let mut goes: BTreeMap<u32, bool> = copies.iter().map(|&face| (face, true)).collect();
    loop {
        let mut stays = Vec::new();
        for (&face, _) in goes.iter().filter(|(_, goes)| **goes) {
            let leaves_rim = topology.sides(face).any(|side| {
                let before = topology.count(side);
                let gone = topology.users(side).filter(|&user| goes.get(&topology.face(user)) == Some(&true)).count();
                let after = before - gone as u32;
                after == 1 || (after % 2 == 1 && before.is_multiple_of(2))
            });
            if leaves_rim {
                stays.push(face);
            }
        }
        if stays.is_empty() || setting.is_bold {
            break;
        }
        stays.into_iter().for_each(|face| _ = goes.insert(face, false));
    }
    let gone = goes.values().filter(|goes| **goes).count() as u64;
    let kept = rebuilt(mesh, |i, face, faces| {
        if goes.get(&i) != Some(&true) {
            faces.push(face);
        }
    });
    (kept, gone)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{mesh, setting};
    use super::*;

    fn cut(face: &[u32]) -> Vec<Vec<u32>> {
        let mut cycles = Vec::new();
        simple_cycles(face, &mut cycles);
        cycles
    }

    #[test]
    fn cycles_are_cut_where_they_visit_a_point_again() {
        assert_eq!(cut(&[0, 1, 2, 0, 3, 4]), [[0, 1, 2], [0, 3, 4]]);
        assert_eq!(cut(&[0, 1, 2, 3, 2]), [[0, 1, 2]]);
        assert_eq!(cut(&[0, 0, 1, 1, 2]), [[0, 1, 2]]);
        assert_eq!(cut(&[5, 0, 1, 0, 6, 5]), [[5, 0, 6]]);
        assert_eq!(cut(&[5, 0, 1, 0, 5]), Vec::<Vec<u32>>::new());
        assert_eq!(cut(&[1, 1, 1]), Vec::<Vec<u32>>::new());
        // The repeated point comes first and last.
        assert_eq!(cut(&[0, 1, 2, 0]), [[0, 1, 2]]);
    }

    #[test]
    fn what_is_no_face_goes() {
        let broken = mesh(7, &[&[0, 1, 2], &[0, 1], &[], &[0, 1, 99], &[3, 4, 3], &[2, 1, 6]]);
        let (clean, done) = remove_void(&broken, &setting());
        // Four faces, and the points 3, 4 and 5.
        assert_eq!((clean.faces.len(), clean.points.len(), done), (2, 4, 7));
        assert_eq!(clean.faces.get(1), [2, 1, 3]);
        assert_eq!(clean.points[3], broken.points[6]);
    }

    #[test]
    fn lost_points_come_back_between_their_neighbours() {
        let plate = crate::mesh::sample::build("plate", 4).unwrap();
        let inner = plate.points.iter().position(|p| p.x == 0.5 && p.y == 0.5).unwrap();
        let mut broken = plate.clone();
        broken.points[inner] = DVec3::NAN;
        let (whole, count) = replace_lost(&broken, &setting());
        assert!(count == 1 && whole.points[inner].distance(plate.points[inner]) < 1e-12);
        let nowhere = Mesh { points: vec![DVec3::NAN; 5], faces: plate.faces.clone() };
        assert_eq!(replace_lost(&nowhere, &setting()).1, 0);
    }

    #[test]
    fn duplicates_go_but_leave_no_rim() {
        let tetrahedron: [&[u32]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];
        let twice = mesh(4, &[tetrahedron, tetrahedron].concat());
        let (clean, gone) = remove_duplicates(&twice, &setting());
        assert_eq!((clean.faces.len(), gone, clean.validate()), (4, 4, Ok(())));
        // One face of a closed surface is there twice.
        let once = mesh(4, &[&tetrahedron[..], &[&[1, 0, 2]]].concat());
        assert_eq!(remove_duplicates(&once, &setting()).1, 1);
        // Two sheets back to back.
        let pillow = mesh(4, &[&[0, 1, 2], &[0, 2, 3], &[2, 1, 0], &[3, 2, 0]]);
        assert_eq!(remove_duplicates(&pillow, &setting()).1, 0);
        assert_eq!(remove_duplicates(&pillow, &Setting { is_bold: true, ..setting() }).1, 2);
    }
}
