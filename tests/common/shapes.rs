//! Small solids with known volume.

use super::together;
use glam::DVec3;
use zmend::Mesh;

/// The triangles of a box; `flipped` chooses the other diagonal of each side.
pub(crate) fn boxed(min: DVec3, max: DVec3, flipped: bool) -> Mesh {
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
    let points = (0..8).map(|i| min + corner(i) * (max - min)).collect();
    let sides: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut mesh = Mesh { points, ..Mesh::default() };
    for mut side in sides {
        if flipped {
            side.rotate_left(1);
        }
        mesh.faces.push(&[side[0], side[1], side[2]]);
        mesh.faces.push(&[side[0], side[2], side[3]]);
    }
    mesh
}

pub(crate) fn unit_cube() -> Mesh {
    boxed(DVec3::ZERO, DVec3::ONE, false)
}

/// A single triangle.
pub(crate) fn triangle(corners: [DVec3; 3]) -> Mesh {
    Mesh { points: corners.to_vec(), faces: [&[0u32, 1, 2][..]].into_iter().collect() }
}

/// Triangles without common points.
pub(crate) fn soup(triangles: impl IntoIterator<Item = [DVec3; 3]>) -> Mesh {
    together(&triangles.into_iter().map(triangle).collect::<Vec<_>>())
}
