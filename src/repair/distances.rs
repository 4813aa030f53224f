//! The distance from a solid's surface: as a field, at the corners of cells, and as a volume.

use super::{Options, Solid, Surface};
use crate::error::{Error, Result};
use crate::field::cells::{Signs, cells_of};
use crate::field::{Adapt, Edge, Field, Function, Hexahedra, Side, Zero};
use crate::geom::Frame;
use crate::mesh::{Mesh, TriangleTree};
use crate::octree::LinearOctree;
use crate::progress::{Progress, Stage, check};
use crate::volume::{Image, Placement, Voxels};
use glam::DVec3;
use rayon::prelude::*;

/// Distances computed at a time.
const BATCH: usize = 512;

/// Which cells are made of a solid.
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of its own")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellOptions {
    /// The largest cells have this level, 0 to the octree's depth. Default 3: an eighth of the root's side.
    pub coarsest: u32,
    /// Whether there are cells outside. Default yes.
    pub outside: bool,
    /// Whether there are cells inside. Default yes.
    pub inside: bool,
    /// Whether there are cells that the surface cuts. Default yes.
    pub cut: bool,
    /// Whether to find the distances of points from the surface. Default yes.
    pub distances: bool,
}

impl Default for CellOptions {
    fn default() -> Self {
        CellOptions { coarsest: 3, outside: true, inside: true, cut: true, distances: true }
    }
}

/// The distance from a surface, with the signs of the octree that it was extracted from: negative inside.
struct Distance<'a> {
    tree: TriangleTree<'a>,
    signs: Signs<'a>,
    frame: &'a Frame,
}

impl Distance<'_> {
    /// The lattice point that is nearest to a place.
    fn lattice_point(&self, place: DVec3) -> [u32; 3] {
        let at = (place - self.frame.origin()) / self.frame.cell_size() + 0.5;
        at.to_array().map(|c| (c as u32).min(1 << self.frame.depth()))
    }

    fn at(&self, place: DVec3) -> f64 {
        let distance = self.tree.closest(place).map_or(f64::INFINITY, |closest| closest.distance);
        // A place on the surface is outside, as zero is.
        if self.signs.is_inside(self.lattice_point(place)) { -distance } else { distance }
    }
}

/// Asked for at lattice points only, so that signs are known.
impl Function for Distance<'_> {
    fn values(&self, places: &[DVec3], out: &mut Vec<f64>) {
        out.extend(places.iter().map(|&place| self.at(place)));
    }

    fn zeros(&self, edges: &[Edge], out: &mut Vec<Zero>) {
        out.extend(edges.iter().map(|edge| Zero { at: edge.linear(), slope: edge.ends[1] - edge.ends[0] }));
    }
}

impl Solid {
    /// The signed distance from the solid's surface as a field on the octree's lattice, below 0 inside. The surface is the one that
    /// `surface` names. Cuts and fills must be told by signs ([`told_by_signs`](Solid::told_by_signs)).
    ///
    /// Some 2 us a node, and more far from the surface.
    ///
    /// # Errors
    /// When there is no surface, or it needs normals that the octree has not; as [`Field::build`]; `Cancelled`.
    pub fn distance_field(&self, surface: Surface, adapt: Adapt, progress: &dyn Progress) -> Result<Field> {
        let mesh = self.surface_mesh(surface, progress)?;
        progress.begin(Stage::Measure, 0);
        Field::build(self.frame, &self.distance_from(&mesh, progress)?, adapt, progress)
    }

    /// The cells of a body and of what is around it, with levels, sides and distances.
    ///
    /// # Errors
    /// When the coarsest level is deeper than the octree, and as [`distance_field`](Solid::distance_field).
    pub fn cells(&self, surface: Surface, options: &CellOptions, progress: &dyn Progress) -> Result<Hexahedra> {
        let depth = self.frame.depth();
        if options.coarsest > depth {
            let problem = format!("{} is deeper than the octree, {depth}", options.coarsest);
            return Err(Error::setting("coarsest", problem, format!("take {depth} or less")));
        }
        let mesh = if options.distances { self.surface_mesh(surface, progress)? } else { Mesh::default() };
        let tree: LinearOctree<Side> = cells_of(self.signed(), options.coarsest);
        check(progress)?;
        let wanted = |side| match side {
            Side::Outside => options.outside,
            Side::Inside => options.inside,
            Side::Cut => options.cut,
        };
        // Keys, corners and their numbers, points, distances.
        progress.hold((tree.allocated_bytes() + tree.len() * (2 * 8 * 8 + 40 + 2 * 40)) as u64)?;
        let (mut cells, corners) = Hexahedra::of_tree(&tree, &self.frame, wanted);
        drop((tree, corners));
        if options.distances {
            cells.distances = self.distances(&mesh, &cells.points, progress)?;
        }
        Ok(cells)
    }

    /// The signed distance at all lattice points of a cube about the solid, as a volume of 32-bit numbers: every `2^(depth - level)`th
    /// point of the octree's lattice, 2^level + 1 along each axis.
    ///
    /// # Errors
    /// When the level is 0 or deeper than the octree, or the volume too large, and as [`distance_field`](Solid::distance_field).
    pub fn distance_image(&self, surface: Surface, level: u32, progress: &dyn Progress) -> Result<Image> {
        let depth = self.frame.depth();
        if !(1..=depth).contains(&level) {
            let problem = format!("{level} is not 1 to {depth}, the depth of the octree");
            return Err(Error::setting("depth", problem, "take one of these"));
        }
        let mesh = self.surface_mesh(surface, progress)?;
        let side = (1usize << level) + 1;
        let step = self.frame.cell_size() * f64::from(1u32 << (depth - level));
        progress.hold((side.pow(3) * (size_of::<f32>() + size_of::<f64>())) as u64)?;
        let distance = self.distance_from(&mesh, progress)?;
        progress.begin(Stage::Measure, (side * side) as u64);
        let rows = (0..side * side).into_par_iter().map(|row| {
            check(progress)?;
            let mut values = Vec::with_capacity(side);
            for x in 0..side {
                let at = DVec3::new(x as f64, (row % side) as f64, (row / side) as f64);
                values.push(distance.at(self.frame.origin() + step * at) as f32);
            }
            progress.advance(1);
            Ok(values)
        });
        let rows: Result<Vec<Vec<f32>>> = rows.collect();
        let placement = Placement::with_spacing(self.frame.origin(), DVec3::splat(step));
        Image::new([side; 3], placement, Voxels::F32(rows?.concat()))
    }

    /// The surface in memory, in triangles.
    fn surface_mesh(&self, surface: Surface, progress: &dyn Progress) -> Result<Mesh> {
        if self.octree.is_edited() {
            let problem = "cuts and fills are not told by signs";
            return Err(Error::setting("octree", problem, "make it finer first: `Solid::told_by_signs`"));
        }
        let mut mesh = Mesh::default();
        self.extract(&Options { surface, faces: super::Faces::Triangles, ..Options::default() }, &mut mesh, progress)?;
        if mesh.faces.is_empty() {
            let problem = "nothing is inside: there is no surface to measure distances from";
            return Err(Error::setting("input", problem, "see what `zmend repair` says of it"));
        }
        Ok(mesh)
    }

    fn distance_from<'a>(&'a self, mesh: &'a Mesh, progress: &dyn Progress) -> Result<Distance<'a>> {
        let tree = TriangleTree::try_new(mesh, progress)?;
        Ok(Distance { tree, signs: Signs::new(self.signed()), frame: &self.frame })
    }

    /// The distances of lattice points.
    fn distances(&self, mesh: &Mesh, points: &[DVec3], progress: &dyn Progress) -> Result<Vec<f64>> {
        let distance = self.distance_from(mesh, progress)?;
        progress.begin(Stage::Measure, points.len() as u64);
        let batches = points.par_chunks(BATCH).map(|points| {
            check(progress)?;
            let mut out = Vec::with_capacity(points.len());
            distance.values(points, &mut out);
            progress.advance(points.len() as u64);
            Ok(out)
        });
        let batches: Result<Vec<Vec<f64>>> = batches.collect();
        Ok(batches?.concat())
    }
}
