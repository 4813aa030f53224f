//! Where a surface folds: angles at edges, feature edges, and chains of them; regions between them.
//!
//! Edges that end or divide a surface on purpose are [`Constraints`]: chains of edges that were found by angle, drawn by hand, or are the
//! boundaries of face groups. [`Groups`] are the other side of the same coin: regions of faces that grow until they come to a
//! constraint. From one follows the other, so each can be made of the other.

mod chain;
mod constraint;
mod group;

pub use chain::{Chain, chains};
pub use constraint::{Constraint, Constraints};
pub use group::{Group, Groups, grow};

use super::{Neighbour, Topology};
use glam::DVec3;
use rayon::prelude::*;

/// What to take as a feature edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeatureOptions {
    /// The angle between normals, in radians, from which on an edge between two faces is a feature.
    pub angle: f64,
    /// Whether boundary edges are features.
    pub boundary: bool,
    /// Whether edges with three users or more are features.
    pub non_manifold: bool,
}

impl Default for FeatureOptions {
    /// 40 degrees, boundaries and non-manifold edges.
    fn default() -> Self {
        FeatureOptions { angle: 40f64.to_radians(), boundary: true, non_manifold: true }
    }
}

/// Feature edges by kind, each by its lowest side, ascending.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Features {
    /// Edges at which the surface folds outwards.
    pub convex: Vec<u32>,
    /// Edges at which it folds inwards.
    pub concave: Vec<u32>,
    /// Edges with one user.
    pub boundary: Vec<u32>,
    /// Edges with three users or more.
    pub non_manifold: Vec<u32>,
    /// Edges of which a face has no normal, so that the angle is not known: no features, but not flat either.
    pub unknown: Vec<u32>,
}

impl Features {
    /// All edges but those whose angle is not known, ascending.
    pub fn edges(&self) -> Vec<u32> {
        let mut all = [&self.convex[..], &self.concave, &self.boundary, &self.non_manifold].concat();
        all.sort_unstable();
        all
    }
}

impl Topology<'_> {
    /// The unit normal of a face by Newell's formula; none if it is not sound, not finite, or has no area.
    pub fn normal(&self, face: u32) -> Option<DVec3> {
        if !self.is_sound(face) {
            return None;
        }
        let corners = self.mesh().faces.get(face as usize);
        let at = |k: usize| self.mesh().points[corners[k] as usize];
        let origin = at(0);
        let longest = (1..corners.len()).map(|k| (at(k) - origin).abs().max_element()).fold(0.0, f64::max);
        // In a unit in which squares neither vanish nor overflow.
        let at = |k: usize| (at(k) - origin) / longest;
        let sum: DVec3 = (2..corners.len()).map(|k| at(k - 1).cross(at(k))).sum();
        sum.try_normalize()
    }

    /// By how much the surface folds at a side's edge: the angle between the normals of its two faces in radians, 0 where it is flat,
    /// positive where it is convex as seen from the side's face, negative where it is concave, up to π.
    ///
    /// A neighbour that runs the same way is taken as turned over. None unless the edge has two users that are different faces with
    /// an area.
    pub fn dihedral(&self, side: u32) -> Option<f64> {
        let Neighbour::Face(beyond) = self.neighbour(side) else { return None };
        let face = self.face(side);
        let other = self.users(side).nth(1)?;
        let [a, b] = self.ends(side);
        let along = self.mesh().points[b as usize] - self.mesh().points[a as usize];
        let along = (along / along.abs().max_element()).try_normalize()?;
        let here = self.normal(face)?;
        let there = if self.ends(other)[0] == a { -self.normal(beyond)? } else { self.normal(beyond)? };
        (face != beyond).then(|| here.cross(there).dot(along).atan2(here.dot(there)))
    }

    /// Edges at which the surface ends, branches or folds by an angle or more. O(n), on all threads.
    ///
    /// ```
    /// use zmend::mesh::{FeatureOptions, Topology, sample};
    ///
    /// let cube = sample::build("cube", 1)?;
    /// let features = Topology::new(&cube).features(&FeatureOptions::default());
    /// assert_eq!((features.convex.len(), features.concave.len()), (12, 0));
    /// # Ok::<(), zmend::Error>(())
    /// ```
    pub fn features(&self, options: &FeatureOptions) -> Features {
        let of_face = |face: u32| {
            let mut found = Features::default();
            for side in self.sides(face).filter(|&side| self.users(side).all(|other| side <= other)) {
                match self.neighbour(side) {
                    Neighbour::Nobody if options.boundary && self.count(side) == 1 => found.boundary.push(side),
                    Neighbour::Many(_) if options.non_manifold => found.non_manifold.push(side),
                    Neighbour::Face(beyond) if beyond != face => match self.dihedral(side) {
                        None => found.unknown.push(side),
                        Some(angle) if angle >= options.angle => found.convex.push(side),
                        Some(angle) if angle <= -options.angle => found.concave.push(side),
                        Some(_) => {}
                    },
                    _ => {}
                }
            }
            found
        };
        let join = |mut a: Features, mut b: Features| {
            a.convex.append(&mut b.convex);
            a.concave.append(&mut b.concave);
            a.boundary.append(&mut b.boundary);
            a.non_manifold.append(&mut b.non_manifold);
            a.unknown.append(&mut b.unknown);
            a
        };
        let faces = (0..self.mesh().faces.len() as u32).into_par_iter().with_min_len(1 << 10);
        // Joined from left to right, so sides ascend.
        faces.map(of_face).fold(Features::default, join).reduce(Features::default, join)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, sample};
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Two triangles along the x axis, the second one turned by an angle from flat.
    fn hinge(angle: f64) -> Mesh {
        let (sin, cos) = angle.sin_cos();
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::NEG_Y, DVec3::new(0.0, cos, -sin)];
        Mesh { points, faces: [[1, 0, 2], [0, 1, 3]].iter().map(|f| &f[..]).collect() }
    }

    /// Bug C4.12: angles had no sign, and an edge whose face had no normal counted as flat.
    #[test]
    fn angles_are_signed_and_never_hidden() {
        for angle in [0.0, 0.3, FRAC_PI_2, 3.0, -0.3, -FRAC_PI_2, -3.0] {
            let mesh = hinge(angle);
            let topology = Topology::new(&mesh);
            let side = topology.find(0, 1).unwrap();
            assert!((topology.dihedral(side).unwrap() - angle).abs() < 1e-12, "{angle}");
            let other = topology.users(side).nth(1).unwrap();
            assert!((topology.dihedral(other).unwrap() - angle).abs() < 1e-12, "{angle}");
        }
        let mut flat = hinge(0.3);
        flat.points[3] = 0.5 * DVec3::X;
        let topology = Topology::new(&flat);
        let features = topology.features(&FeatureOptions::default());
        assert_eq!((topology.dihedral(0), features.unknown.len(), features.edges().len()), (None, 1, 4));
        // Turned over, the neighbour folds as before.
        let mut turned = hinge(FRAC_PI_2);
        turned.faces = [[1, 0, 2], [1, 0, 3]].iter().map(|f| &f[..]).collect();
        assert!((Topology::new(&turned).dihedral(0).unwrap() - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn features_of_a_part_are_its_sharp_edges() {
        let part = sample::build("part", 1).unwrap();
        let topology = Topology::new(&part);
        let features = topology.features(&FeatureOptions::default());
        assert!(features.boundary.is_empty() && features.non_manifold.is_empty() && features.unknown.is_empty());
        // The rims of both lids, with two holes, and the corners of the L.
        let long: Vec<Chain> = chains(&topology, &features.edges());
        assert!(long.iter().filter(|chain| chain.is_closed).count() >= 4, "{}", long.len());
        let smooth = topology.features(&FeatureOptions { angle: PI, ..FeatureOptions::default() });
        assert!(smooth.edges().is_empty());
        let holes = sample::build("knot-holes", 1).unwrap();
        let topology = Topology::new(&holes);
        let features = topology.features(&FeatureOptions { angle: PI, ..FeatureOptions::default() });
        assert_eq!(features.boundary.len() as u64, holes.report().boundary_edges);
    }

    #[test]
    fn tiny_and_huge_faces_have_normals() {
        for size in [1e-200, 1.0, 1e200] {
            let mut mesh = hinge(0.5);
            mesh.points.iter_mut().for_each(|p| *p *= size);
            assert!((Topology::new(&mesh).dihedral(0).unwrap() - 0.5).abs() < 1e-9, "{size}");
        }
    }
}
