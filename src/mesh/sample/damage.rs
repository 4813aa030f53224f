//! Ways to break a mesh, the same each time.

use crate::mesh::chance::Chance;
use crate::mesh::{Mesh, Polygons};
use glam::DVec3;

/// Removes faces; the points stay.
pub(super) fn without(mesh: &Mesh, mut remove: impl FnMut(usize, DVec3) -> bool) -> Mesh {
    let middle = |face: &[u32]| face.iter().map(|&i| mesh.points[i as usize]).sum::<DVec3>() / face.len() as f64;
    let kept = mesh.faces.iter().enumerate().filter(|(i, face)| !remove(*i, middle(face))).map(|(_, face)| face);
    Mesh { points: mesh.points.clone(), faces: kept.collect() }
}

/// Removes points that no face uses.
pub(super) fn without_loose_points(mesh: &Mesh) -> Mesh {
    let mut ids = vec![u32::MAX; mesh.points.len()];
    let mut points = Vec::new();
    let mut faces = Polygons::default();
    for face in mesh.faces.iter() {
        let renamed = face.iter().map(|&i| {
            if ids[i as usize] == u32::MAX {
                ids[i as usize] = points.len() as u32;
                points.push(mesh.points[i as usize]);
            }
            ids[i as usize]
        });
        faces.push(&renamed.collect::<Vec<_>>());
    }
    Mesh { points, faces }
}

/// How a careless exporter treats each face, as probabilities.
pub(super) struct Carelessness {
    pub(super) missing: f64,
    pub(super) flipped: f64,
    pub(super) doubled: f64,
    /// A triangle hangs on the face's first edge, as long as the edge and at right angles to the face.
    pub(super) hanging: f64,
}

/// Exports a mesh of triangles carelessly.
pub(super) fn careless(mesh: &Mesh, how: &Carelessness, chance: &mut Chance) -> Mesh {
    let mut out = Mesh { points: mesh.points.clone(), faces: Polygons::default() };
    for face in mesh.faces.iter() {
        let (missing, flipped) = (chance.happens(how.missing), chance.happens(how.flipped));
        let (doubled, hanging) = (chance.happens(how.doubled), chance.happens(how.hanging));
        if missing {
            continue;
        }
        let turned: Vec<u32> = if flipped { face.iter().rev().copied().collect() } else { face.to_vec() };
        out.faces.push(&turned);
        if doubled {
            out.faces.push(&turned);
        }
        if hanging {
            let [a, b, c] = [0, 1, 2].map(|k| mesh.points[face[k] as usize]);
            let tip = a.midpoint(b) + a.distance(b) * (b - a).cross(c - a).normalize_or_zero();
            out.faces.push(&[face[0], face[1], out.points.len() as u32]);
            out.points.push(tip);
        }
    }
    out
}
