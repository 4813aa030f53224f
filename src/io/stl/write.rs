//! STL from a mesh. Positions are repeated in each triangle, so they are held until the end.

use super::super::encode::{Encoder, Out, Patch, Precision};
use super::{HEADER, RECORD};
use crate::error::{Error, Place, Result};
use crate::mesh::{MeshSizes, triangulate};
use glam::{DVec3, Vec3};

/// Offset of the number of triangles in a binary file.
const COUNT: u64 = 80;

/// Encodes triangles; polygons with more corners are cut, those with fewer left out.
#[derive(Debug)]
pub(in crate::io) struct StlEncoder<P> {
    name: String,
    points: Vec<P>,
    /// Number of triangles in the header.
    promised: u64,
    /// Number of triangles so far.
    written: u64,
    /// Encodes one triangle.
    push: fn([DVec3; 3], &mut Out),
    is_text: bool,
}

/// A stored position.
pub(in crate::io) trait Position: Copy {
    fn store(point: DVec3) -> Self;
    fn load(self) -> DVec3;
}

impl Position for Vec3 {
    fn store(point: DVec3) -> Self {
        point.as_vec3()
    }
    fn load(self) -> DVec3 {
        self.as_dvec3()
    }
}

impl Position for DVec3 {
    fn store(point: DVec3) -> Self {
        point
    }
    fn load(self) -> DVec3 {
        self
    }
}

impl StlEncoder<Vec3> {
    /// Binary STL; `name` is for messages.
    pub(in crate::io) fn binary(name: String) -> Self {
        StlEncoder { name, points: Vec::new(), promised: 0, written: 0, push: push_binary, is_text: false }
    }
}

impl<P: Position> StlEncoder<P> {
    /// STL as text; `name` is for messages.
    pub(in crate::io) fn text(name: String, precision: Precision) -> Self {
        let push = match precision {
            Precision::Single => |triangle, out: &mut Out| push_text(triangle, Precision::Single, out),
            Precision::Double => |triangle, out: &mut Out| push_text(triangle, Precision::Double, out),
        };
        StlEncoder { name, points: Vec::new(), promised: 0, written: 0, push, is_text: true }
    }

    #[cold]
    fn error(&self, problem: String, remedy: &str) -> Error {
        Error::format(self.name.as_str(), Place::Whole, problem, remedy)
    }

    fn count(&mut self) -> Result<()> {
        self.written += 1;
        if self.is_text || u32::try_from(self.written).is_ok() {
            return Ok(());
        }
        Err(self.too_many(self.written))
    }

    #[cold]
    fn too_many(&self, triangles: u64) -> Error {
        let problem = format!("{triangles} triangles or more; binary STL can count {} at most", u32::MAX);
        self.error(problem, "write PLY, or take a smaller depth")
    }
}

impl<P: Position> Encoder for StlEncoder<P> {
    fn bytes_for(&self, sizes: MeshSizes) -> u64 {
        sizes.points * size_of::<P>() as u64
    }

    fn begin(&mut self, sizes: MeshSizes, out: &mut Out) -> Result<()> {
        // Exact when no face has fewer than three corners; else it is corrected at the end.
        self.promised = sizes.corners.saturating_sub(2 * sizes.faces);
        self.points.reserve_exact(sizes.points as usize);
        if self.is_text {
            out.push(b"solid zmend\n");
            return Ok(());
        }
        let promised = u32::try_from(self.promised).map_err(|_| self.too_many(self.promised))?;
        let mut header = [b' '; HEADER];
        header[..16].copy_from_slice(b"binary STL zmend");
        header[COUNT as usize..].copy_from_slice(&promised.to_le_bytes());
        out.push(&header);
        Ok(())
    }

    fn points(&mut self, points: &[DVec3], _: &mut Out) {
        self.points.extend(points.iter().map(|&point| P::store(point)));
    }

    fn faces(&mut self, arity: usize, corners: &[u32], out: &mut Out) -> Result<()> {
        let cycle: Vec<u32> = (0..arity as u32).collect();
        let mut positions = Vec::with_capacity(arity);
        let mut cut = Vec::new();
        for face in corners.chunks_exact(arity) {
            positions.clear();
            for &corner in face {
                let Some(point) = self.points.get(corner as usize) else {
                    let problem = format!("a face refers to vertex {corner}, but there are {}", self.points.len());
                    return Err(self.error(problem, "indices count from 0"));
                };
                positions.push(point.load());
            }
            match positions[..] {
                [a, b, c] => {
                    self.count()?;
                    (self.push)([a, b, c], out);
                }
                [_, _, _, ..] => {
                    cut.clear();
                    triangulate(&positions, &cycle, &mut cut);
                    for triangle in &cut {
                        self.count()?;
                        (self.push)(triangle.map(|corner| positions[corner as usize]), out);
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn end(&mut self, out: &mut Out) -> Option<Patch> {
        if self.is_text {
            out.push(b"endsolid zmend\n");
            return None;
        }
        (self.written != self.promised)
            .then(|| Patch { position: COUNT, bytes: (self.written as u32).to_le_bytes().to_vec() })
    }
}

/// The unit normal, or zero where there is none.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

fn push_binary(triangle: [DVec3; 3], out: &mut Out) {
    let [a, b, c] = triangle;
    let mut record = [0; RECORD];
    let floats = [normal(triangle), a, b, c].map(|vector| vector.as_vec3().to_array());
    let (rooms, _) = record.as_chunks_mut();
    rooms.iter_mut().zip(floats.as_flattened()).for_each(|(room, value)| *room = value.to_le_bytes());
    out.push(&record);
}

fn push_text(triangle: [DVec3; 3], precision: Precision, out: &mut Out) {
    out.push(b"facet normal ");
    out.push_vector(normal(triangle), Precision::Single);
    out.push(b"\nouter loop\n");
    for corner in triangle {
        out.push(b"vertex ");
        out.push_vector(corner, precision);
        out.push(b"\n");
    }
    out.push(b"endloop\nendfacet\n");
}
