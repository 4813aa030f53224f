//! The unedited surface as it passes by, with holes where edits touch it, into which the patch is put.

use super::place::{Neighbours, Points, place};
use super::polygons::{Patch, Polygons};
use crate::contour::DualOptions;
use crate::error::Result;
use crate::geom::Frame;
use crate::mesh::{MeshSink, MeshSizes};
use crate::octree::SignedOctree;
use crate::progress::Progress;
use glam::DVec3;

/// Takes the unedited surface as polygons and passes the edited one on.
pub(super) struct Seam<'a> {
    sink: &'a mut (dyn MeshSink + Send),
    octree: &'a SignedOctree,
    frame: &'a Frame,
    patch: &'a Patch<'a>,
    /// What the edited surface will have.
    sizes: MeshSizes,
    options: DualOptions<'a>,
    /// Vertices of the unedited surface that have passed, those of them that were dropped, and those of the ring.
    passed: u32,
    dropped: usize,
    /// The vertices of untouched cells that the patch uses, and their positions in cells as far as they have passed.
    ring: Vec<u32>,
    fixed: Points,
    /// Of the vertices of the patch; none once its points have been passed on.
    neighbours: Option<Neighbours>,
}

impl<'a> Seam<'a> {
    pub(super) fn new(
        sink: &'a mut (dyn MeshSink + Send),
        octree: &'a SignedOctree,
        frame: &'a Frame,
        (patch, polygons): (&'a Patch<'a>, Polygons),
        sizes: MeshSizes,
        options: DualOptions<'a>,
    ) -> Self {
        let mut ring: Vec<u32> = polygons.sides().map(|[from, _]| from).filter(|&v| v < patch.kept).collect();
        ring.sort_unstable();
        ring.dedup();
        ring.shrink_to_fit();
        let neighbours = Some(Neighbours::new(&polygons, &ring, patch.kept, patch.touched.vertices));
        let (passed, dropped, fixed) = (0, 0, Points::default());
        Seam { sink, octree, frame, patch, sizes, options, passed, dropped, ring, fixed, neighbours }
    }

    /// Passes on points of untouched cells, and keeps those of the ring.
    fn keep(&mut self, points: &[DVec3]) -> Result<()> {
        let first = self.passed - self.dropped as u32;
        while let Some(&vertex) = self.ring.get(self.fixed.len()) {
            let Some(&point) = points.get((vertex - first) as usize) else { break };
            let in_cells = (point - self.frame.origin()) / self.frame.cell_size();
            self.fixed.push(self.patch.touched.scale().fixed(in_cells));
        }
        self.passed += points.len() as u32;
        self.sink.points(points)
    }

    /// Passes on the points of the patch, unless that was done: all others have passed.
    fn end_points(&mut self) -> Result<()> {
        let Some(neighbours) = self.neighbours.take() else { return Ok(()) };
        let fixed = std::mem::take(&mut self.fixed);
        let ring = fixed.len();
        let points = place(self.octree, self.options.placement, self.patch.touched, &neighbours, fixed);
        drop(neighbours);
        let scale = self.patch.touched.scale();
        let mut skipped = 0;
        points.parts().try_for_each(|part| {
            let start = (ring - skipped).min(part.len());
            skipped += start;
            let to_model = |&point| self.frame.to_model(scale.cells(point));
            self.sink.points(&part[start..].iter().map(to_model).collect::<Vec<DVec3>>())
        })
    }

    /// Passes on the faces of the patch, which are made once more: that costs less than to keep them.
    pub(super) fn finish(mut self, progress: &dyn Progress) -> Result<()> {
        self.end_points()?;
        let mut triangles = Vec::new();
        self.patch.polygons(progress, |piece: Polygons| {
            triangles.extend(piece.triangles);
            self.quads(piece.quads.as_flattened())
        })?;
        self.sink.faces(3, triangles.as_flattened())
    }

    /// Passes on quadrilaterals, or the triangles they are cut into.
    fn quads(&mut self, corners: &[u32]) -> Result<()> {
        if !self.options.triangles {
            return self.sink.faces(4, corners);
        }
        let cut: Vec<u32> = corners.chunks_exact(4).flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]]).collect();
        self.sink.faces(3, &cut)
    }
}

impl MeshSink for Seam<'_> {
    fn begin(&mut self, _: MeshSizes) -> Result<()> {
        self.sink.begin(self.sizes)
    }

    fn points(&mut self, mut points: &[DVec3]) -> Result<()> {
        while !points.is_empty() {
            let next = self.patch.dropped.get(self.dropped).map_or(points.len(), |&v| (v - self.passed) as usize);
            let (kept, rest) = points.split_at(next.min(points.len()));
            self.keep(kept)?;
            points = rest;
            if !points.is_empty() {
                points = &points[1..];
                self.passed += 1;
                self.dropped += 1;
            }
        }
        Ok(())
    }

    fn faces(&mut self, arity: usize, corners: &[u32]) -> Result<()> {
        self.end_points()?;
        let ranks = &self.patch.ranks;
        let mut kept = Vec::with_capacity(corners.len());
        for face in corners.chunks_exact(arity).filter(|face| !face.iter().any(|&v| ranks.contains(v))) {
            kept.extend(face.iter().map(|&v| v - ranks.rank(v)));
        }
        if arity == 4 { self.quads(&kept) } else { self.sink.faces(arity, &kept) }
    }
}
