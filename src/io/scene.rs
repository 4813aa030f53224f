//! Scenes to one mesh: parts that are placed, turned and repeated (glTF, 3MF), and faces cut for formats that know triangles alone.

use super::build::{Builder, Welder};
use crate::error::{Error, Place, Result};
use crate::mesh::{Mesh, MeshSizes, triangulate};
use glam::{DAffine3, DVec3, Vec3};

/// Vertices and triangles that a file of any size may stand for; and how many more for each of its bytes. A file of a thousand bytes can
/// ask for the same part a million times; real ones repeat some parts a hundred times. A million are some 30 MB.
const FREE: u64 = 1 << 20;
const PER_BYTE: u64 = 16;

/// The mesh of a scene in the making.
pub(super) struct Scene<'a> {
    name: &'a str,
    builder: Builder<'a>,
    left: u64,
}

impl<'a> Scene<'a> {
    /// An empty scene from a file of `bytes` bytes; `name` is for messages.
    pub(super) fn new(name: &'a str, bytes: usize) -> Self {
        Scene { name, builder: Builder::new(name), left: FREE + PER_BYTE * bytes as u64 }
    }

    /// Adds a part, whose indices are below the number of its points. A transform that mirrors turns the triangles round, so that what was
    /// outside stays outside. `weld` joins points that are the same bit by bit.
    pub(super) fn add(
        &mut self,
        points: &[DVec3],
        triangles: &[[u32; 3]],
        transform: &DAffine3,
        weld: bool,
    ) -> Result<()> {
        self.spend((points.len() + triangles.len()) as u64)?;
        let first = self.builder.points() as u32;
        let mut welder = weld.then(Welder::new);
        let mut numbers = Vec::new();
        for &point in points {
            let point = transform.transform_point3(point);
            match &mut welder {
                Some(welder) => numbers.push(welder.index(&mut self.builder, point)?),
                None => self.builder.point(point)?,
            }
        }
        let is_mirrored = transform.matrix3.determinant() < 0.0;
        for &triangle in triangles {
            let [a, b, c] = triangle.map(|corner| if weld { numbers[corner as usize] } else { first + corner });
            self.builder.polygon(&if is_mirrored { [a, c, b] } else { [a, b, c] })?;
        }
        Ok(())
    }

    /// Takes note of work: of so many points, triangles and parts.
    pub(super) fn spend(&mut self, amount: u64) -> Result<()> {
        let Some(left) = self.left.checked_sub(amount) else {
            let problem = "the scene repeats its parts too often: it would be many times larger than the file";
            return Err(Error::format(self.name, Place::Whole, problem, "export what is to be repaired alone"));
        };
        self.left = left;
        Ok(())
    }

    /// The mesh as built.
    pub(super) fn finish(self) -> Mesh {
        self.builder.finish()
    }
}

/// Cuts faces into triangles. Holds positions only if there are faces with more than three corners.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    name: String,
    points: Vec<Vec3>,
    is_needed: bool,
}

impl Triangles {
    /// For a file of this name, which is for messages.
    pub(super) fn new(name: String) -> Self {
        Triangles { name, ..Triangles::default() }
    }

    /// Takes the size of the mesh; returns the number of triangles, exact when no face has fewer than three corners.
    pub(super) fn begin(&mut self, sizes: MeshSizes) -> u64 {
        self.is_needed = sizes.corners != 3 * sizes.faces;
        sizes.corners.saturating_sub(2 * sizes.faces)
    }

    /// Takes the next points.
    pub(super) fn points(&mut self, points: &[DVec3]) {
        if self.is_needed {
            self.points.extend(points.iter().map(|p| p.as_vec3()));
        }
    }

    /// Calls `each` with the triangles of some faces; those with fewer than three corners have none.
    pub(super) fn cut(&self, arity: usize, corners: &[u32], mut each: impl FnMut([u32; 3])) -> Result<()> {
        if arity == 3 {
            corners.as_chunks().0.iter().for_each(|&triangle| each(triangle));
            return Ok(());
        }
        let cycle: Vec<u32> = (0..arity as u32).collect();
        let mut cut = Vec::new();
        let mut positions = Vec::new();
        for face in corners.chunks_exact(arity).filter(|face| face.len() > 3) {
            positions.clear();
            for &corner in face {
                let Some(point) = self.points.get(corner as usize) else {
                    let problem = format!("a face refers to vertex {corner}, but there are {}", self.points.len());
                    return Err(Error::format(self.name.as_str(), Place::Whole, problem, "indices count from 0"));
                };
                positions.push(point.as_dvec3());
            }
            cut.clear();
            triangulate(&positions, &cycle, &mut cut);
            cut.iter().for_each(|triangle| each(triangle.map(|i| face[i as usize])));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrored_parts_are_turned_round() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X];
        let mut scene = Scene::new("t", 0);
        let mirror = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
        scene.add(&points, &[[0, 1, 2]], &mirror, false).expect("small");
        scene.add(&points, &[[0, 3, 2]], &DAffine3::from_translation(DVec3::Z), true).expect("small");
        let mesh = scene.finish();
        assert_eq!(mesh.points.len(), 4 + 3);
        assert_eq!((mesh.faces.get(0), mesh.faces.get(1)), (&[0, 2, 1][..], &[4, 5, 6][..]));
        assert_eq!(mesh.points[4], DVec3::Z);
    }

    #[test]
    fn a_scene_does_not_explode() {
        let points = vec![DVec3::ZERO; 1 << 20];
        let mut scene = Scene::new("t", 10);
        let results = (0..20).map(|_| scene.add(&points, &[], &DAffine3::IDENTITY, false));
        assert!(results.last().expect("twenty").expect_err("too many").to_string().contains("too often"));
    }

    #[test]
    fn faces_are_cut_where_needed() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let mut triangles = Triangles::new("t".into());
        assert_eq!(triangles.begin(MeshSizes { points: 4, faces: 2, corners: 7 }), 3);
        triangles.points(&points);
        let mut found = Vec::new();
        triangles.cut(4, &[0, 1, 2, 3], |t| found.push(t)).expect("valid");
        triangles.cut(3, &[0, 1, 2], |t| found.push(t)).expect("valid");
        triangles.cut(2, &[0, 1], |t| found.push(t)).expect("nothing");
        assert_eq!(found.len(), 3);
        assert!(triangles.cut(4, &[0, 1, 2, 4], |_| {}).is_err());
    }
}
