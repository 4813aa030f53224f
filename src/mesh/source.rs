//! Meshes in memory as sources of triangles.

use super::{Bounds, Mesh, SourceCounts, TriangleSource, triangulate};
use crate::error::{Error, Place, Result};
use glam::DVec3;

/// Triangles passed on at once.
const BATCH: usize = 1 << 12;

/// Cuts polygons into triangles and passes these on in batches.
pub(crate) struct Batch<'a> {
    sink: &'a mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>,
    triangles: Vec<[DVec3; 3]>,
    counts: SourceCounts,
    cycle: Vec<u32>,
    cut: Vec<[u32; 3]>,
}

impl<'a> Batch<'a> {
    /// Nothing passed on yet.
    pub(crate) fn new(sink: &'a mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Self {
        let triangles = Vec::with_capacity(BATCH);
        Batch { sink, triangles, counts: SourceCounts::default(), cycle: Vec::new(), cut: Vec::new() }
    }

    /// Takes a polygon that is a triangle.
    pub(crate) fn triangle(&mut self, triangle: [DVec3; 3]) -> Result<()> {
        self.counts.polygons += 1;
        self.push(triangle)
    }

    /// Takes any polygon; with fewer than three corners it is counted, but has no triangles.
    pub(crate) fn polygon(&mut self, corners: &[DVec3]) -> Result<()> {
        match *corners {
            [a, b, c] => return self.triangle([a, b, c]),
            [_, _, _, ..] => {}
            _ => {
                self.counts.polygons += 1;
                return Ok(());
            }
        }
        self.counts.polygons += 1;
        self.cycle.clear();
        self.cycle.extend(0..corners.len() as u32);
        self.cut.clear();
        triangulate(corners, &self.cycle, &mut self.cut);
        for i in 0..self.cut.len() {
            self.push(self.cut[i].map(|corner| corners[corner as usize]))?;
        }
        Ok(())
    }

    /// Passes on what is left.
    pub(crate) fn finish(mut self) -> Result<SourceCounts> {
        if !self.triangles.is_empty() {
            self.flush()?;
        }
        Ok(self.counts)
    }

    fn push(&mut self, triangle: [DVec3; 3]) -> Result<()> {
        self.triangles.push(triangle);
        if self.triangles.len() < BATCH { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<()> {
        self.counts.triangles += self.triangles.len() as u64;
        (self.sink)(&self.triangles)?;
        self.triangles.clear();
        Ok(())
    }
}

impl Mesh {
    /// The position of a corner of face `face`.
    fn position(&self, face: usize, corner: u32) -> Result<DVec3> {
        self.points.get(corner as usize).copied().ok_or_else(|| {
            let problem = format!("face {face} refers to vertex {corner}, but there are {}", self.points.len());
            Error::format("mesh", Place::Whole, problem, "indices count from 0")
        })
    }
}

impl TriangleSource for &Mesh {
    fn bounds(&mut self) -> Result<Bounds> {
        let mut bounds = Bounds::EMPTY;
        for (i, face) in self.faces.iter().enumerate() {
            for &corner in face {
                bounds.add(self.position(i, corner)?);
            }
        }
        Ok(bounds)
    }

    fn triangles(&mut self, sink: &mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Result<SourceCounts> {
        let mut batch = Batch::new(sink);
        let mut corners = Vec::new();
        for (i, face) in self.faces.iter().enumerate() {
            if let &[a, b, c] = face {
                batch.triangle([self.position(i, a)?, self.position(i, b)?, self.position(i, c)?])?;
            } else {
                corners.clear();
                for &corner in face {
                    corners.push(self.position(i, corner)?);
                }
                batch.polygon(&corners)?;
            }
        }
        batch.finish()
    }

    fn size_hint(&self) -> Option<u64> {
        Some(self.faces.iter().map(|face| face.len().saturating_sub(2) as u64).sum())
    }
}

impl TriangleSource for Mesh {
    fn bounds(&mut self) -> Result<Bounds> {
        (&*self).bounds()
    }

    fn triangles(&mut self, sink: &mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Result<SourceCounts> {
        (&*self).triangles(sink)
    }

    fn size_hint(&self) -> Option<u64> {
        (&self).size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square and a far point, with faces of `0 ..= 4` corners.
    fn mixed() -> Mesh {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y, DVec3::splat(9.0)];
        let faces: [&[u32]; 5] = [&[], &[1], &[1, 2], &[0, 1, 2], &[0, 1, 2, 3]];
        Mesh { points, faces: faces.into_iter().collect() }
    }

    #[test]
    fn polygons_pass_as_triangles() {
        let mut area = 0.0;
        let counts = mixed()
            .triangles(&mut |batch| {
                area += batch.iter().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).z).sum::<f64>();
                Ok(())
            })
            .expect("valid");
        assert_eq!(counts, SourceCounts { polygons: 5, triangles: 3 });
        assert!((area - 1.5).abs() < 1e-12);
        assert_eq!(mixed().size_hint(), Some(3));
    }

    #[test]
    fn bounds_leave_out_points_without_faces() {
        let bounds = mixed().bounds().expect("valid");
        assert_eq!((bounds.min, bounds.max), (DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0)));
        assert!(Mesh::default().bounds().expect("valid").is_empty());
    }

    #[test]
    fn batches_hold_every_triangle_once() {
        let mut mesh = mixed();
        (0..2 * BATCH).for_each(|_| mesh.faces.push(&[0, 1, 2]));
        let mut sizes = Vec::new();
        let mut sink = |batch: &[[DVec3; 3]]| {
            sizes.push(batch.len());
            Ok(())
        };
        let counts = mesh.triangles(&mut sink).expect("valid");
        assert_eq!(sizes, [BATCH, BATCH, 3]);
        assert_eq!(counts.triangles, 2 * BATCH as u64 + 3);
    }

    #[test]
    fn wrong_indices_are_errors() {
        let mut mesh = mixed();
        mesh.faces.push(&[0, 1, 5]);
        assert!(mesh.bounds().is_err() && mesh.triangles(&mut |_| Ok(())).is_err());
    }
}
