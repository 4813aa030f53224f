//! Ways to break a mesh, the same each time.

use crate::mesh::{Mesh, Polygons};
use glam::DVec3;

/// Steele, Lea and Flood 2014 ("splitmix64"): enough chance for samples, in three lines.
pub(super) struct Chance(pub(super) u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly spread over `0 .. 1`.
    pub(super) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Evenly spread over a cube around the origin.
    pub(super) fn within_cube(&mut self, half_side: f64) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()).map(|x| half_side * (2.0 * x - 1.0))
    }

    /// Whether something with this probability happens now.
    pub(super) fn happens(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }
}

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
