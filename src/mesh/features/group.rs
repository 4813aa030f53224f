//! Regions of faces.

use super::Constraints;
use crate::error::{Error, Result};
use crate::mesh::{Neighbour, Topology};

/// A region of faces with a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Its faces, ascending.
    pub faces: Vec<u32>,
    /// What it is called; may be empty.
    pub label: String,
}

/// Regions of one mesh, no face in two of them. Numbers of groups stay when others are removed, and are never used again.
#[derive(Debug, Clone, Default)]
pub struct Groups {
    list: Vec<Option<Group>>,
    /// The group of each face.
    of_face: Vec<Option<u32>>,
}

impl Groups {
    /// No groups yet, for a mesh.
    pub fn new(topology: &Topology<'_>) -> Self {
        Groups { list: Vec::new(), of_face: vec![None; topology.mesh().faces.len()] }
    }

    /// All sound faces in groups that end at constraints and at non-manifold edges, each grown from its lowest face.
    pub fn between(topology: &Topology<'_>, constraints: &Constraints) -> Self {
        let mut groups = Groups::new(topology);
        for seed in 0..topology.mesh().faces.len() as u32 {
            if topology.is_sound(seed) && groups.of_face(seed).is_none() {
                let faces = grow(topology, seed, constraints, std::f64::consts::PI);
                groups.insert(faces, String::new());
            }
        }
        groups
    }

    /// Adds a group and returns its number.
    ///
    /// # Errors
    /// When there are no faces, one does not exist, or one is in a group already. No group is left behind then.
    pub fn add(&mut self, faces: &[u32], label: impl Into<String>) -> Result<u32> {
        let refuse = |problem: String| Err(Error::setting("group", problem, "name faces that are in no group"));
        if faces.is_empty() {
            return refuse("there are no faces".to_owned());
        }
        for &face in faces {
            match self.of_face.get(face as usize) {
                None => return refuse(format!("there is no face {face}")),
                Some(Some(other)) => return refuse(format!("face {face} is in group {other}")),
                Some(None) => {}
            }
        }
        let mut faces = faces.to_vec();
        faces.sort_unstable();
        faces.dedup();
        Ok(self.insert(faces, label.into()))
    }

    fn insert(&mut self, faces: Vec<u32>, label: String) -> u32 {
        let number = self.list.len() as u32;
        faces.iter().for_each(|&face| self.of_face[face as usize] = Some(number));
        self.list.push(Some(Group { faces, label }));
        number
    }

    /// Removes a group, if it is there; its faces are free.
    pub fn remove(&mut self, number: u32) -> Option<Group> {
        let removed = self.list.get_mut(number as usize)?.take()?;
        removed.faces.iter().for_each(|&face| self.of_face[face as usize] = None);
        Some(removed)
    }

    /// A group by its number.
    pub fn get(&self, number: u32) -> Option<&Group> {
        self.list.get(number as usize)?.as_ref()
    }

    /// The group of a face.
    pub fn of_face(&self, face: u32) -> Option<u32> {
        self.of_face.get(face as usize).copied().flatten()
    }

    /// All groups with their numbers, ascending.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &Group)> {
        (0..).zip(&self.list).filter_map(|(i, group)| Some((i, group.as_ref()?)))
    }

    /// Whether a side's edge bounds a group: its users are not all in the same one, or it is a boundary edge of a face in one. Faces in no
    /// group are on the other side of a boundary like those of another group.
    pub fn is_boundary(&self, topology: &Topology<'_>, side: u32) -> bool {
        let mine = self.of_face(topology.face(side));
        let others = || topology.users(side).skip(1).map(|user| self.of_face(topology.face(user)));
        (mine.is_some() && topology.count(side) == 1) || others().any(|other| other != mine)
    }

    /// The edges that bound a group, each by its lowest side, ascending; [`Constraints::add_edges`] makes constraints of them.
    pub fn boundary(&self, topology: &Topology<'_>, number: u32) -> Vec<u32> {
        let faces = self.get(number).map_or(&[][..], |group| &group.faces);
        let sides =
            faces.iter().flat_map(|&face| topology.sides(face)).filter(|&side| self.is_boundary(topology, side));
        let mut lowest: Vec<u32> = sides.filter_map(|side| topology.users(side).min()).collect();
        lowest.sort_unstable();
        lowest.dedup();
        lowest
    }

    /// The groups beyond the boundary of one, ascending.
    pub fn neighbours(&self, topology: &Topology<'_>, number: u32) -> Vec<u32> {
        let users =
            self.boundary(topology, number).into_iter().flat_map(|side| topology.users(side).collect::<Vec<_>>());
        let mut found: Vec<u32> = users.filter_map(|side| self.of_face(topology.face(side))).collect();
        found.sort_unstable();
        found.dedup();
        found.retain(|&group| group != number);
        found
    }
}

/// The faces that can be reached from one without crossing a constraint, a non-manifold edge, or an edge at which normals differ by more
/// than an angle (in radians) or are not known unless the angle is π; ascending.
pub fn grow(topology: &Topology<'_>, seed: u32, constraints: &Constraints, angle: f64) -> Vec<u32> {
    let mut is_in = hashbrown::HashSet::with_hasher(ahash::RandomState::with_seeds(5, 6, 7, 8));
    is_in.insert(seed);
    let mut found = vec![seed];
    let mut i = 0;
    while let Some(&face) = found.get(i) {
        for side in topology.sides(face) {
            let [a, b] = topology.ends(side);
            let is_smooth =
                || angle >= std::f64::consts::PI || topology.dihedral(side).is_some_and(|d| d.abs() <= angle);
            if let Neighbour::Face(beyond) = topology.neighbour(side)
                && constraints.of_edge(a, b).is_none()
                && is_smooth()
                && is_in.insert(beyond)
            {
                found.push(beyond);
            }
        }
        i += 1;
    }
    found.sort_unstable();
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{FeatureOptions, sample};
    use std::f64::consts::FRAC_PI_4;

    #[test]
    fn groups_and_constraints_are_two_sides_of_one_coin() {
        let cube = sample::build("cube", 3).unwrap();
        let topology = Topology::new(&cube);
        let mut constraints = Constraints::new();
        let sharp = topology.features(&FeatureOptions::default()).edges();
        constraints.add_edges(&topology, &sharp, "sharp");
        let groups = Groups::between(&topology, &constraints);
        assert_eq!(groups.iter().count(), 6);
        let mut bounds: Vec<u32> = Vec::new();
        for (number, group) in groups.iter() {
            assert_eq!((group.faces.len(), groups.neighbours(&topology, number).len()), (9, 4));
            assert_eq!(group.faces, grow(&topology, group.faces[4], &Constraints::new(), FRAC_PI_4));
            bounds.extend(groups.boundary(&topology, number));
        }
        bounds.sort_unstable();
        bounds.dedup();
        assert_eq!(bounds, sharp);
        assert_eq!(grow(&topology, 0, &Constraints::new(), 2.0).len(), cube.faces.len());
    }

    /// Bug C4.4: between a face of a group and one of none, there was said to be no boundary.
    #[test]
    fn an_edge_between_grouped_and_ungrouped_is_a_boundary() {
        let cube = sample::build("cube", 1).unwrap();
        let topology = Topology::new(&cube);
        let mut groups = Groups::new(&topology);
        let one = groups.add(&[2], "").unwrap();
        assert!(topology.sides(2).all(|side| groups.is_boundary(&topology, side)));
        assert_eq!(groups.boundary(&topology, one).len(), 4);
        assert!(groups.neighbours(&topology, one).is_empty());
        // The rim of a sheet bounds its group, and nothing bounds nothing.
        let plate = sample::build("plate", 1).unwrap();
        let topology = Topology::new(&plate);
        let mut groups = Groups::new(&topology);
        assert!(topology.edges().all(|side| !groups.is_boundary(&topology, side)));
        let all = groups.add(&[0, 1], "").unwrap();
        assert_eq!(groups.boundary(&topology, all).len(), 4);
    }

    /// Bug C4.5: a group that was refused stayed behind, empty.
    #[test]
    fn a_refused_group_leaves_nothing_behind() {
        let cube = sample::build("cube", 1).unwrap();
        let mut groups = Groups::new(&Topology::new(&cube));
        let first = groups.add(&[3, 1, 1], "first").unwrap();
        assert_eq!(groups.get(first).unwrap().faces, [1, 3]);
        for bad in [&[][..], &[0, 3], &[0, 9]] {
            assert!(groups.add(bad, "").is_err());
        }
        assert_eq!((groups.iter().count(), groups.of_face(0)), (1, None));
        groups.remove(first);
        assert!(groups.of_face(3).is_none() && groups.remove(first).is_none());
        assert_eq!(groups.add(&[0, 3], "").unwrap(), first + 1);
    }
}
