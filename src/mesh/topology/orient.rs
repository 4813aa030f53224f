//! Which faces must be turned over so that neighbours run the same way round.

use super::Topology;

/// Patches of faces that hang together by edges with two users, and how they are turned in each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Orientation {
    /// The patch of each face, counted from 0 in order of their lowest faces; [`Orientation::NONE`] for faces that are not sound.
    pub patches: Vec<u32>,
    /// Whether a face runs against the lowest one of its patch.
    pub turned: Vec<bool>,
    /// Number of patches.
    pub count: u32,
    /// Lowest sides of the edges between two faces that cannot be made consistent: none if all patches are orientable.
    pub conflicts: Vec<u32>,
}

impl Orientation {
    /// The patch of a face that is in none.
    pub const NONE: u32 = u32::MAX;

    /// Whether all patches can be turned consistently; a Möbius strip cannot.
    pub fn is_orientable(&self) -> bool {
        self.conflicts.is_empty()
    }
}

impl Topology<'_> {
    /// How neighbours are turned to each other. Non-manifold edges bind nobody: patches end there.
    ///
    /// Along an edge with two users, both must run opposite ways. From the lowest face of each patch this is handed on from neighbour to
    /// neighbour; where it contradicts itself, the patch has one side only. O(n), 9 bytes a face.
    pub fn orientation(&self) -> Orientation {
        let faces = self.states.len();
        let mut found = Orientation {
            patches: vec![Orientation::NONE; faces],
            turned: vec![false; faces],
            count: 0,
            conflicts: vec![],
        };
        let mut waiting = Vec::new();
        for seed in 0..faces as u32 {
            if found.patches[seed as usize] != Orientation::NONE || !self.is_sound(seed) {
                continue;
            }
            found.patches[seed as usize] = found.count;
            waiting.push(seed);
            while let Some(face) = waiting.pop() {
                for side in self.sides(face) {
                    let other = self.rings[side as usize];
                    if other == side || self.rings[other as usize] != side {
                        continue;
                    }
                    let beyond = self.face(other);
                    let alike = self.ends(side)[0] == self.ends(other)[0];
                    let turned = found.turned[face as usize] != alike;
                    if found.patches[beyond as usize] == Orientation::NONE {
                        found.patches[beyond as usize] = found.count;
                        found.turned[beyond as usize] = turned;
                        waiting.push(beyond);
                    } else if found.turned[beyond as usize] != turned && side < other {
                        found.conflicts.push(side);
                    }
                }
            }
            found.count += 1;
        }
        found.conflicts.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, sample};
    use glam::DVec3;

    #[test]
    fn turned_faces_are_found() {
        let mut mesh = sample::build("torus", 1).unwrap();
        let expected = |i: usize| i % 7 == 3 || i % 11 == 5;
        mesh.faces = (0..mesh.faces.len())
            .map(|i| {
                let mut face = mesh.faces.get(i).to_vec();
                if expected(i) {
                    face.reverse();
                }
                face
            })
            .collect::<Vec<_>>()
            .iter()
            .map(|face| &face[..])
            .collect();
        let found = Topology::new(&mesh).orientation();
        assert!(found.is_orientable() && found.count == 1);
        assert!(found.turned.iter().enumerate().all(|(i, &turned)| turned == expected(i)));
    }

    /// Bug C4.2: the type of a mesh said nothing of its orientation. Two users at each inner edge, and still no outside.
    #[test]
    fn a_moebius_strip_is_not_orientable() {
        let n = 10u32;
        let at = |i: u32, j: u32| if i == n { 1 - j } else { 2 * i + j };
        let faces: Vec<[u32; 4]> = (0..n).map(|i| [at(i, 0), at(i + 1, 0), at(i + 1, 1), at(i, 1)]).collect();
        let strip = Mesh { points: vec![DVec3::ZERO; 20], faces: faces.iter().map(|f| &f[..]).collect() };
        let found = Topology::new(&strip).orientation();
        assert_eq!((found.is_orientable(), found.count, found.conflicts.len()), (false, 1, 1));
    }

    #[test]
    fn patches_end_at_non_manifold_edges() {
        // Three sheets along one edge, and a face that is none.
        let faces: [&[u32]; 5] = [&[0, 1, 2], &[0, 1, 3], &[1, 0, 4], &[1, 9, 2], &[2, 1, 5]];
        let mesh = Mesh { points: vec![DVec3::ZERO; 6], faces: faces.into_iter().collect() };
        let found = Topology::new(&mesh).orientation();
        assert_eq!(found.patches, [0, 1, 2, Orientation::NONE, 0]);
        assert!(found.is_orientable() && found.count == 3);
    }
}
