//! Faces by the points they visit.

use super::super::star::Star;
use super::super::tally::{CHUNK, copies};
use super::Topology;
use rayon::prelude::*;

impl Topology<'_> {
    /// The lowest face that visits these points in this cyclic order, in either direction. O(faces at the first point).
    pub fn find_face(&self, cycle: &[u32]) -> Option<u32> {
        let first = *cycle.first()?;
        self.faces_at(first).find(|&face| is_same_cycle(self.mesh().faces.get(face as usize), cycle))
    }

    /// Faces beyond the first over the same cycle of points, in either direction, ascending. Degenerate faces do not count.
    pub fn duplicate_faces(&self) -> Vec<u32> {
        let points = self.corners.points();
        let in_chunk = |chunk: usize| {
            let (mut star, mut found) = (Star::default(), Vec::new());
            for v in chunk * CHUNK..points.min((chunk + 1) * CHUNK) {
                star.visit(&self.corners, v as u32);
                found.append(&mut copies(self.mesh(), &star));
            }
            found
        };
        let mut found: Vec<u32> = (0..points.div_ceil(CHUNK)).into_par_iter().flat_map_iter(in_chunk).collect();
        found.par_sort_unstable();
        found
    }
}

/// Whether two cycles visit the same points in the same order or the opposite one, wherever they begin.
fn is_same_cycle(a: &[u32], b: &[u32]) -> bool {
    let n = a.len();
    n == b.len()
        && (0..n)
            .any(|shift| (0..n).all(|k| a[k] == b[(shift + k) % n]) || (0..n).all(|k| a[k] == b[(shift + n - k) % n]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use glam::DVec3;

    /// Bug C4.10: looking for a face scribbled on the elements, so two threads could not do it at once.
    #[test]
    fn many_threads_look_for_faces_at_once() {
        let gear = crate::mesh::sample::build("gear", 1).unwrap();
        let topology = Topology::new(&gear);
        let find = |i: usize| topology.find_face(gear.faces.get(i));
        let alone: Vec<Option<u32>> = (0..gear.faces.len()).map(find).collect();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        let together: Vec<Option<u32>> = pool.install(|| (0..gear.faces.len()).into_par_iter().map(find).collect());
        assert!(alone == together && alone.iter().all(Option::is_some));
    }

    #[test]
    fn faces_are_found_whatever_point_comes_first() {
        let faces: [&[u32]; 4] = [&[0, 1, 2, 3], &[3, 2, 4], &[1, 0, 3, 2], &[0, 2, 1, 3]];
        let mesh = Mesh { points: vec![DVec3::ZERO; 5], faces: faces.into_iter().collect() };
        let topology = Topology::new(&mesh);
        assert_eq!(topology.find_face(&[2, 3, 0, 1]), Some(0));
        assert_eq!(topology.find_face(&[2, 1, 0, 3]), Some(0));
        assert_eq!(topology.find_face(&[2, 3, 4]), Some(1));
        assert_eq!(topology.find_face(&[3, 1, 2, 0]), Some(3));
        assert_eq!([&[0, 1, 2][..], &[], &[9, 8, 7], &[0, 1, 3, 2, 4]].map(|c| topology.find_face(c)), [None; 4]);
        assert_eq!(topology.duplicate_faces(), [2]);
    }
}
