//! What all readers build: a mesh whose counts fit its indices.

use crate::error::{Error, Place, Result};
use crate::mesh::Mesh;
use ahash::RandomState;
use glam::DVec3;
use hashbrown::HashTable;

/// A mesh in the making.
#[derive(Debug)]
pub(super) struct Builder<'a> {
    name: &'a str,
    mesh: Mesh,
}

impl<'a> Builder<'a> {
    /// An empty mesh; `name` is for messages.
    pub(super) fn new(name: &'a str) -> Self {
        Builder { name, mesh: Mesh::default() }
    }

    /// Makes room, or says that there is none. Callers bound the numbers by the bytes they have, not by what a header says.
    pub(super) fn reserve(&mut self, points: usize, polygons: usize, corners: usize) -> Result<()> {
        let room = self.mesh.points.try_reserve_exact(points);
        let room = room.and_then(|()| self.mesh.faces.try_reserve_exact(polygons, corners));
        room.map_err(|_| no_room(self.name, points + polygons))
    }

    /// Number of points so far.
    pub(super) fn points(&self) -> usize {
        self.mesh.points.len()
    }

    /// Appends a point.
    pub(super) fn point(&mut self, point: DVec3) -> Result<()> {
        if self.mesh.points.len() >= u32::MAX as usize {
            return Err(self.too_large("2^32 - 1 vertices"));
        }
        self.mesh.points.push(point);
        Ok(())
    }

    /// Appends a polygon.
    pub(super) fn polygon(&mut self, corners: &[u32]) -> Result<()> {
        if self.mesh.faces.corners().len() + corners.len() > u32::MAX as usize {
            return Err(self.too_large("2^32 - 1 corners of faces"));
        }
        self.mesh.faces.push(corners);
        Ok(())
    }

    /// The mesh as built.
    pub(super) fn finish(self) -> Mesh {
        self.mesh
    }

    #[cold]
    fn too_large(&self, limit: &str) -> Error {
        let problem = format!("there are more than {limit}, which is what a mesh in memory can have");
        Error::format(self.name, Place::Whole, problem, "stream it as binary STL or PLY, or split it")
    }
}

/// The error when there is not enough memory for so many points and polygons of a file.
#[cold]
pub(super) fn no_room(name: &str, elements: usize) -> Error {
    let problem = format!("{elements} vertices and faces do not fit into memory");
    Error::format(name, Place::Whole, problem, "split the file, or take a machine with more memory")
}

/// Gives equal points of a soup one index. Points are equal when their coordinates are, bit for bit, except that -0 is 0.
/// Indices go up in the order in which points are first seen, whatever the hash.
#[derive(Debug)]
pub(super) struct Welder {
    indices: HashTable<u32>,
    hasher: RandomState,
}

impl Welder {
    /// Knows no point yet.
    pub(super) fn new() -> Self {
        Welder { indices: HashTable::new(), hasher: RandomState::with_seeds(1, 2, 3, 4) }
    }

    /// The index of `point`, which is appended to the mesh when it is new.
    pub(super) fn index(&mut self, builder: &mut Builder<'_>, point: DVec3) -> Result<u32> {
        let key = |p: DVec3| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits()];
        let point = point + DVec3::ZERO; // -0 + 0 is 0, all else stays.
        let hash = self.hasher.hash_one(key(point));
        let points = &builder.mesh.points;
        if let Some(&index) = self.indices.find(hash, |&i| key(points[i as usize]) == key(point)) {
            return Ok(index);
        }
        let index = points.len() as u32;
        builder.point(point)?;
        let points = &builder.mesh.points;
        self.indices.insert_unique(hash, index, |&i| self.hasher.hash_one(key(points[i as usize])));
        Ok(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn welding_keeps_the_order_of_first_sight() {
        let mut builder = Builder::new("t");
        let mut welder = Welder::new();
        let nan = DVec3::new(f64::NAN, 0.0, 0.0);
        let points = [DVec3::X, DVec3::ZERO, -DVec3::ZERO, DVec3::X, nan, nan, DVec3::splat(1e-300)];
        let indices: Vec<u32> = points.iter().map(|&p| welder.index(&mut builder, p).expect("few")).collect();
        assert_eq!(indices, [0, 1, 1, 0, 2, 2, 3]);
        assert_eq!(builder.finish().points.len(), 4);
    }

    #[test]
    fn many_points_stay_apart() {
        let mut builder = Builder::new("t");
        let mut welder = Welder::new();
        for round in 0..2 {
            for i in 0..1000 {
                let index =
                    welder.index(&mut builder, DVec3::new(f64::from(i % 10), f64::from(i / 10), 0.5)).expect("few");
                assert_eq!(index, i as u32, "round {round}");
            }
        }
    }
}
