//! What is wrong with a mesh, in colour.

use super::canvas::{Mark, Marks};
use crate::mesh::{Mesh, Topology};
use glam::Vec3;

/// Edges with one user: green. Colours are linear light.
const BOUNDARY: Vec3 = Vec3::new(0.02, 0.42, 0.06);
/// Edges with three users or more: violet.
const NON_MANIFOLD: Vec3 = Vec3::new(0.42, 0.03, 0.55);
/// Edges whose two users run the same way: blue.
const INCONSISTENT: Vec3 = Vec3::new(0.01, 0.10, 0.60);
/// Faces that meet others where they should not: yellow.
const CROSSING: Vec3 = Vec3::new(0.85, 0.50, 0.02);
/// The most pairs of faces that meet; of more, none are shown.
const MOST: usize = 1 << 20;

/// The defects of a mesh that can be seen.
pub(super) fn marks(mesh: &Mesh) -> Marks {
    let topology = Topology::new(mesh);
    let colour = |side: u32| match topology.count(side) {
        1 => Some(BOUNDARY),
        2 => topology.users(side).all(|user| topology.ends(user)[0] == topology.ends(side)[0]).then_some(INCONSISTENT),
        _ => Some(NON_MANIFOLD),
    };
    let mark = |side: u32| Some(Mark { ends: topology.ends(side), light: colour(side)? });
    let mut faces: Vec<u32> = mesh.self_intersections_up_to(MOST).unwrap_or_default().into_flattened();
    faces.sort_unstable();
    faces.dedup();
    Marks { edges: topology.edges().filter_map(mark).collect(), faces, light: CROSSING }
}
