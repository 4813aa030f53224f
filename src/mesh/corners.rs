//! Which corners of faces are at each point: the table from which every other relation follows.
//!
//! # Idea
//!
//! A *corner* is a place in [`Polygons::corners`](super::Polygons::corners), and so is the *side* that leaves it for the next corner of
//! its face. Corners are sorted by their points, by counting; which point, face, next and previous corner belongs to one is read from
//! the mesh itself, so nothing is stored twice.
//!
//! # How
//!
//! Each thread owns a range of points, reads all corners and keeps those in its range: two passes over memory in order, no locks, and
//! a table that does not depend on the number of threads. Reading everything is a small part of the work up to a dozen threads, and
//! never more than it is for one.
//!
//! # Cost
//!
//! 4 bytes a corner and a point (14 a triangle); 4 more a corner where faces differ in their number of corners. Some 2 ns a corner for
//! a mesh whose faces are in some order, 8 where they are shuffled.

use super::Mesh;
use rayon::prelude::*;
use std::ops::Range;

/// The corners of all sound faces, sorted by point, ascending at each point.
#[derive(Debug, Clone)]
pub(super) struct Corners<'a> {
    mesh: &'a Mesh,
    /// Where each point's corners end.
    ends: Vec<u32>,
    list: Vec<u32>,
    faces: FaceOf,
}

/// Of which face a corner is.
#[derive(Debug, Clone)]
enum FaceOf {
    /// All faces are triangles.
    Triangles,
    /// All faces have so many corners.
    Regular(u32),
    /// The face of each corner.
    Mixed(Vec<u32>),
}

impl FaceOf {
    fn new(mesh: &Mesh) -> Self {
        let arity = if mesh.faces.is_empty() { 0 } else { mesh.faces.get(0).len() };
        if arity > 0 && (0..mesh.faces.len()).into_par_iter().all(|i| mesh.faces.range(i).end == (i + 1) * arity) {
            return if arity == 3 { FaceOf::Triangles } else { FaceOf::Regular(arity as u32) };
        }
        let mut faces = Vec::with_capacity(mesh.faces.corners().len());
        (0u32..).zip(mesh.faces.iter()).for_each(|(i, face)| faces.resize(faces.len() + face.len(), i));
        FaceOf::Mixed(faces)
    }
}

impl<'a> Corners<'a> {
    /// Sorts by counting.
    pub(super) fn new(mesh: &'a Mesh) -> Self {
        let faces = FaceOf::new(mesh);
        let all = mesh.faces.corners();
        let points = mesh.points.len();
        let is_sound = !matches!(faces, FaceOf::Regular(..3))
            && all.par_iter().all(|&v| (v as usize) < points)
            && (matches!(faces, FaceOf::Triangles | FaceOf::Regular(_)) || mesh.faces.iter().all(|f| f.len() >= 3));
        // Calls with each corner of a sound face, and its point.
        let each = |visit: &mut dyn FnMut(&[u32], u32)| {
            if is_sound {
                visit(all, 0);
            } else {
                let sound = (0..mesh.faces.len()).filter(|&i| mesh.is_sound(mesh.faces.get(i)));
                sound.for_each(|i| visit(mesh.faces.get(i), mesh.faces.range(i).start as u32));
            }
        };
        let parts = rayon::current_num_threads().min(points.div_ceil(1 << 12)).max(1);
        let size = points.div_ceil(parts).max(1);
        let mut ends = vec![0u32; points];
        ends.par_chunks_mut(size).enumerate().for_each(|(part, counts)| {
            let low = (part * size) as u32;
            each(&mut |corners, _| {
                for v in corners {
                    if let Some(count) = counts.get_mut(v.wrapping_sub(low) as usize) {
                        *count += 1;
                    }
                }
            });
        });
        let mut total = 0;
        for end in &mut ends {
            // For now where the point's corners start; filling moves it to where they end.
            total += std::mem::replace(end, total);
        }
        let mut list = vec![0u32; total as usize];
        let mut rest = &mut list[..];
        let mut tasks = Vec::with_capacity(parts);
        let starts: Vec<u32> = ends.iter().step_by(size).copied().chain([total]).collect();
        for (part, cursors) in ends.chunks_mut(size).enumerate() {
            let here;
            (here, rest) = rest.split_at_mut((starts[part + 1] - starts[part]) as usize);
            tasks.push((part, cursors, here));
        }
        tasks.into_par_iter().for_each(|(part, cursors, here)| {
            let (low, start) = ((part * size) as u32, starts[part]);
            each(&mut |corners, first| {
                for (v, corner) in corners.iter().zip(first..) {
                    if let Some(cursor) = cursors.get_mut(v.wrapping_sub(low) as usize) {
                        here[(*cursor - start) as usize] = corner;
                        *cursor += 1;
                    }
                }
            });
        });
        Corners { mesh, ends, list, faces }
    }

    /// The mesh.
    pub(super) fn mesh(&self) -> &'a Mesh {
        self.mesh
    }

    /// Whether all faces are triangles.
    pub(super) fn are_triangles(&self) -> bool {
        matches!(self.faces, FaceOf::Triangles)
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        let faces = if let FaceOf::Mixed(faces) = &self.faces { faces.len() } else { 0 };
        4 * (self.ends.len() + self.list.len() + faces) as u64
    }

    /// Number of points, used or not.
    pub(super) fn points(&self) -> usize {
        self.ends.len()
    }

    /// The corners at a point.
    pub(super) fn at(&self, point: u32) -> &[u32] {
        let v = point as usize;
        let start = if v == 0 { 0 } else { self.ends[v - 1] };
        &self.list[start as usize..self.ends[v] as usize]
    }

    /// The point of a corner.
    pub(super) fn point(&self, corner: u32) -> u32 {
        self.mesh.faces.corners()[corner as usize]
    }

    /// The face of a corner.
    pub(super) fn face(&self, corner: u32) -> u32 {
        match &self.faces {
            FaceOf::Triangles => corner / 3,
            FaceOf::Regular(arity) => corner / arity,
            FaceOf::Mixed(faces) => faces[corner as usize],
        }
    }

    /// The corners of the face of a corner.
    fn around(&self, corner: u32) -> Range<u32> {
        if let FaceOf::Triangles = self.faces {
            let first = corner - corner % 3;
            return first..first + 3;
        }
        let range = self.mesh.faces.range(self.face(corner) as usize);
        range.start as u32..range.end as u32
    }

    /// The corner after this one in its face.
    pub(super) fn next(&self, corner: u32) -> u32 {
        let around = self.around(corner);
        if corner + 1 == around.end { around.start } else { corner + 1 }
    }

    /// The corner before this one in its face.
    pub(super) fn prev(&self, corner: u32) -> u32 {
        let around = self.around(corner);
        if corner == around.start { around.end - 1 } else { corner - 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_corner_of_a_sound_face_is_at_its_point(
            faces in prop::collection::vec(prop::collection::vec(0u32..7, 0..6), 0..20), points in 1usize..8, arity in 0usize..6,
        ) {
            // Faces of any kind, and of one arity.
            for regular in [false, true] {
                let mut polygons = super::super::Polygons::default();
                for face in &faces {
                    let fixed: Vec<u32> = (0..arity as u32).map(|k| (face.len() as u32 * 3 + k * k) % 7).collect();
                    polygons.push(if regular { &fixed } else { face });
                }
                let mesh = Mesh { points: vec![DVec3::ZERO; points], faces: polygons };
                let corners = Corners::new(&mesh);
                let mut expected = vec![Vec::new(); points];
                for i in 0..mesh.faces.len() {
                    let (face, range) = (mesh.faces.get(i), mesh.faces.range(i));
                    for (k, &v) in face.iter().enumerate() {
                        let corner = (range.start + k) as u32;
                        prop_assert_eq!(corners.face(corner), i as u32);
                        prop_assert_eq!(corners.next(corner), (range.start + (k + 1) % face.len()) as u32);
                        prop_assert_eq!(corners.prev(corners.next(corner)), corner);
                        if mesh.is_sound(face) {
                            expected[v as usize].push(corner);
                        }
                    }
                }
                for (v, expected) in expected.iter().enumerate() {
                    prop_assert_eq!(corners.at(v as u32), &expected[..]);
                }
            }
        }
    }

    #[test]
    fn tables_do_not_depend_on_the_number_of_threads() {
        let mesh = super::super::sample::build("gear", 1).unwrap();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let corners = Corners::new(&mesh);
                (corners.ends, corners.list)
            })
        };
        assert_eq!(with(1), with(3));
    }
}
