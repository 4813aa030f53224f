//! Is this the surface of a solid? If not, why?

use super::corners::Corners;
use super::star::{Star, repeated};
use super::tally::{CHUNK, sum_faces};
use super::{Bounds, Mesh};
use rayon::prelude::*;
use std::fmt;

/// The first reason why a mesh is not the surface of a solid. Faces and points are given by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Violation {
    /// A face has fewer than three corners.
    TooFewCorners {
        /// The face.
        face: u32,
    },
    /// A face refers to a point that does not exist.
    MissingPoint {
        /// The face.
        face: u32,
        /// The index without a point.
        point: u32,
    },
    /// A face uses a point with a coordinate that is not finite.
    NotFinite {
        /// The face.
        face: u32,
        /// The point.
        point: u32,
    },
    /// A face visits a point twice.
    RepeatedPoint {
        /// The face.
        face: u32,
        /// The point.
        point: u32,
    },
    /// Only one face uses an edge.
    Boundary {
        /// The ends, the lower index first.
        edge: [u32; 2],
        /// The face.
        face: u32,
    },
    /// More than two faces use an edge.
    NonManifoldEdge {
        /// The ends, the lower index first.
        edge: [u32; 2],
        /// How often the edge is used.
        users: u32,
    },
    /// Two faces use an edge in the same direction, so one of them is turned over.
    Inconsistent {
        /// The ends, the lower index first.
        edge: [u32; 2],
        /// The faces.
        faces: [u32; 2],
    },
    /// Several fans of faces meet in a point only.
    BowTie {
        /// The point.
        point: u32,
        /// Number of fans.
        fans: u32,
    },
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Violation::TooFewCorners { face } => write!(f, "face {face} has fewer than three corners"),
            Violation::MissingPoint { face, point } => write!(f, "face {face}: there is no point {point}"),
            Violation::NotFinite { face, point } => write!(f, "face {face}: point {point} is not finite"),
            Violation::RepeatedPoint { face, point } => write!(f, "face {face} visits point {point} twice"),
            Violation::Boundary { edge: [a, b], face } => write!(f, "edge {a}-{b} is used by face {face} alone"),
            Violation::NonManifoldEdge { edge: [a, b], users } => write!(f, "edge {a}-{b} is used {users} times"),
            Violation::Inconsistent { edge: [a, b], faces: [g, h] } => {
                write!(f, "edge {a}-{b} runs the same way in faces {g} and {h}")
            }
            Violation::BowTie { point, fans } => write!(f, "{fans} fans of faces meet in point {point} only"),
        }
    }
}

impl Mesh {
    /// Whether this is a closed, manifold, consistently oriented surface over finite points: every edge has two users that
    /// run opposite ways, every point one fan, every face three different corners or more. No faces at all are a
    /// closed surface, too, and unused points are no matter. Where the surface lies, and whether it looks outwards
    /// ([`Mesh::outward`]) or crosses itself, is not asked. Time and memory are those of [`Mesh::report`], where
    /// the words are defined.
    ///
    /// # Errors
    /// The first violation: the one at the lowest face, else at the lowest point.
    pub fn validate(&self) -> Result<(), Violation> {
        let in_face = |i: usize| self.face_violation(i as u32, self.faces.get(i));
        if let Some(violation) = (0..self.faces.len()).into_par_iter().find_map_first(in_face) {
            return Err(violation);
        }
        let corners = Corners::new(self);
        let in_chunk = |chunk: usize| {
            let mut star = Star::default();
            let points = chunk * CHUNK..corners.points().min((chunk + 1) * CHUNK);
            points.into_iter().find_map(|v| {
                star.visit(&corners, v as u32);
                star_violation(&mut star)
            })
        };
        (0..corners.points().div_ceil(CHUNK)).into_par_iter().find_map_first(in_chunk).map_or(Ok(()), Err)
    }

    /// Whether the total signed volume is not negative. A solid with cavities is outward although the cavities' own
    /// surfaces, which look into them, have negative volume. Means something for closed, oriented meshes only.
    pub fn outward(&self) -> bool {
        let mut bounds = Bounds::EMPTY;
        self.faces.corners().iter().filter_map(|&i| self.points.get(i as usize)).for_each(|&p| bounds.add(p));
        sum_faces(self, &bounds).volume >= 0.0
    }

    fn face_violation(&self, face: u32, corners: &[u32]) -> Option<Violation> {
        let first = |is_bad: &dyn Fn(usize) -> bool| corners.iter().copied().find(|&i| is_bad(i as usize));
        if corners.len() < 3 {
            Some(Violation::TooFewCorners { face })
        } else if let Some(point) = first(&|i| i >= self.points.len()) {
            Some(Violation::MissingPoint { face, point })
        } else if let Some(point) = first(&|i| !self.points[i].is_finite()) {
            Some(Violation::NotFinite { face, point })
        } else {
            repeated(corners).map(|point| Violation::RepeatedPoint { face, point })
        }
    }
}

/// What is wrong with the edges to higher points, or else with the point itself.
fn star_violation(star: &mut Star) -> Option<Violation> {
    let point = star.point;
    let wrong_edge = star.edges().filter(|edge| edge.other() > point).find_map(|edge| {
        let ends = [point, edge.other()];
        let mut faces = edge.faces();
        let mut face = || faces.next().expect("an edge has as many faces as users");
        match edge.users() {
            1 => Some(Violation::Boundary { edge: ends, face: face() }),
            2 if edge.outgoing() == 1 => None,
            2 => Some(Violation::Inconsistent { edge: ends, faces: [face(), face()] }),
            users => Some(Violation::NonManifoldEdge { edge: ends, users }),
        }
    });
    wrong_edge.or_else(|| match star.fans() {
        0 | 1 => None,
        fans => Some(Violation::BowTie { point, fans }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn mesh(points: usize, faces: &[&[u32]]) -> Mesh {
        let points = (0..points).map(|i| DVec3::new(i as f64, (i * i) as f64, (i % 3) as f64)).collect();
        Mesh { points, faces: faces.iter().copied().collect() }
    }

    const TETRAHEDRON: [&[u32]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];

    #[test]
    fn the_first_violation_is_named_with_its_place() {
        let with = |face: usize, corners: &'static [u32]| {
            let mut faces = TETRAHEDRON.to_vec();
            faces[face] = corners;
            mesh(4, &faces).validate().unwrap_err()
        };
        assert_eq!(mesh(4, &TETRAHEDRON).validate(), Ok(()));
        assert_eq!(mesh(5, &[]).validate(), Ok(()));
        assert_eq!(with(2, &[1, 2]), Violation::TooFewCorners { face: 2 });
        assert_eq!(with(2, &[1, 2, 9]), Violation::MissingPoint { face: 2, point: 9 });
        assert_eq!(with(1, &[1, 2, 3, 1]), Violation::RepeatedPoint { face: 1, point: 1 });
        assert_eq!(with(1, &[1, 0, 3]), Violation::Inconsistent { edge: [0, 1], faces: [0, 1] });
        assert_eq!(with(1, &[1, 2, 3]), Violation::Boundary { edge: [0, 1], face: 0 });
        assert_eq!(mesh(4, &TETRAHEDRON[1..]).validate(), Err(Violation::Boundary { edge: [0, 1], face: 0 }));
        let doubled = [TETRAHEDRON, TETRAHEDRON].concat();
        assert_eq!(mesh(4, &doubled).validate(), Err(Violation::NonManifoldEdge { edge: [0, 1], users: 4 }));
        let tie: [&[u32]; 4] = [&[0, 5, 4], &[0, 4, 6], &[4, 5, 6], &[5, 0, 6]];
        let message = mesh(7, &[TETRAHEDRON, tie].concat()).validate().unwrap_err().to_string();
        assert_eq!(message, "2 fans of faces meet in point 0 only");
        let mut lost = mesh(4, &TETRAHEDRON);
        lost.points[3].z = f64::NAN;
        assert_eq!(lost.validate(), Err(Violation::NotFinite { face: 1, point: 3 }));
    }

    #[test]
    fn outward_is_told_from_inward_far_from_the_origin() {
        let mut tetrahedron = mesh(4, &TETRAHEDRON);
        tetrahedron.points =
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| 0.125 * p + DVec3::splat(1e7)).to_vec();
        assert!(tetrahedron.outward());
        tetrahedron.points.swap(0, 1);
        assert!(!tetrahedron.outward());
    }
}
