//! Local repairs: what is wrong is mended where it is, and every good face stays as it was.
//!
//! # How
//!
//! Steps are plain functions from mesh to mesh, each of which looks for one kind of defect:
//!
//! 1. [`clean`]: points at no place are given one between their neighbours; faces that are none, points without faces, spikes and
//!    repeated corners, and duplicates go.
//! 2. [`weld`]: points of rims that lie within a tolerance become one.
//! 3. [`stitch`]: points of rims that lie on an edge of a rim are made corners of it, so one long edge meets several short ones.
//! 4. [`flat`]: triangles without area are flipped or collapsed away.
//! 5. [`orient`]: neighbours are turned to run opposite ways, then closed parts outward.
//! 6. [`split`]: where more than two faces share an edge, solids that meet there are given points of their own.
//! 7. [`fill`]: small holes are closed by the surface that folds least and has the least area, refined and faired to match.
//! 8. [`split`] again: fans that meet in a point only are given points of their own. (Not before: a point in which two holes touch
//!    is no bow-tie any more once they are filled.)
//!
//! # Invariants
//!
//! - In the end all [`Defects`] are counted. If any count is worse than it was, everything is done again with a count after each step,
//!   and a step that made any count worse is undone. So no count is ever worse in the end, and a step may still make a hole that a
//!   later one fills.
//! - A mesh without defects is returned as it was, bit for bit; and a face with all its points, where no step had to touch it.
//! - Results do not depend on the number of threads, and which points are welded not on their order.
//!
//! # Cost
//!
//! Welding and stitching leave a mesh alone where points crowd within the tolerance ([`MOST_PAIRS`]). Each count takes some 40 ns a corner, self-intersections (if they are counted) 0.5 µs a triangle. Steps that find nothing cost
//! a pass over the mesh or its rims. Memory: about 60 bytes a triangle beside the mesh and one copy of it.

mod clean;
mod fill;
mod flat;
mod orient;
mod split;
mod stitch;
mod weld;

use super::{Mesh, Topology};
use crate::error::{Error, Result};
use crate::progress::{Progress, Stage, check};

/// Pairs of points that welding and stitching look at for each point of a rim, and [`SOME_PAIRS`] more in all; then they leave the mesh as it
/// is. Usual are some ten. Where a tolerance is wide beside the model, as a millionth of the diagonal is if something lies far off, all points
/// are near each other, and nothing is to be welded.
const MOST_PAIRS: u64 = 1 << 10;
const SOME_PAIRS: u64 = 1 << 22;

/// Whether so many pairs are too many for a rim of so many points.
fn is_crowded(pairs: u64, points: usize) -> bool {
    pairs > SOME_PAIRS + MOST_PAIRS * points as u64
}

/// Settings of [`Mesh::heal`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HealOptions {
    /// Points of rims that are not farther apart are welded, and stitched to edges that are not farther away. In parts of the diagonal
    /// of the box around the mesh, unless `is_absolute`. Where it is so wide that hundreds of points lie within it of each other, nothing is
    /// welded or stitched.
    pub tolerance: f64,
    /// Whether the tolerance is in model units.
    pub is_absolute: bool,
    /// Holes with more edges are left open; 0 fills none. Time grows with the cube.
    pub max_hole_edges: u32,
    /// Whether large fillings get points of their own, about as dense as around the hole, and are bent to follow the surface.
    pub smooth: bool,
    /// Whether a step may be taken only if it makes no new self-intersections.
    pub check_intersections: bool,
}

impl Default for HealOptions {
    fn default() -> Self {
        HealOptions {
            tolerance: 1e-6,
            is_absolute: false,
            max_hole_edges: 200,
            smooth: true,
            check_intersections: true,
        }
    }
}

/// Counts of what can be wrong with a mesh; the words are those of [`Report`](super::Report).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Defects {
    /// Points that are in no sound face.
    pub isolated_points: u64,
    /// Points with a coordinate that is not finite.
    pub non_finite_points: u64,
    /// Faces that refer to a point that does not exist.
    pub dangling_faces: u64,
    /// Faces with fewer than three corners, or that visit a point twice.
    pub degenerate_faces: u64,
    /// Faces without area.
    pub zero_area_faces: u64,
    /// Faces that are there twice.
    pub duplicate_faces: u64,
    /// Edges with one user.
    pub boundary_edges: u64,
    /// Rims, as [`Topology::boundary_loops`] tells them apart.
    pub holes: u64,
    /// Edges with three users or more.
    pub non_manifold_edges: u64,
    /// Fans beyond the first at their point.
    pub non_manifold_vertices: u64,
    /// Edges with two users that run the same way.
    pub inconsistent_edges: u64,
    /// Pairs of faces that meet where they should not: up to [`Defects::MOST`], and one more stands for all beyond. None where they were
    /// not counted.
    pub self_intersections: Option<u64>,
}

impl Defects {
    /// The most self-intersections that are counted.
    pub const MOST: usize = 100_000;

    /// Counts. Self-intersections take longer than all the rest.
    pub fn of(mesh: &Mesh, count_intersections: bool) -> Self {
        let r = mesh.report();
        let holes = if r.boundary_edges == 0 { 0 } else { Topology::new(mesh).boundary_loops().len() };
        let pairs = || mesh.self_intersections_up_to(Self::MOST).map_or(Self::MOST + 1, |pairs| pairs.len()) as u64;
        Defects {
            isolated_points: r.isolated_points,
            non_finite_points: r.non_finite_points,
            dangling_faces: r.dangling_faces,
            degenerate_faces: r.degenerate_faces,
            zero_area_faces: r.zero_area_faces,
            duplicate_faces: r.duplicate_faces,
            boundary_edges: r.boundary_edges,
            holes: holes as u64,
            non_manifold_edges: r.non_manifold_edges,
            non_manifold_vertices: r.non_manifold_vertices,
            inconsistent_edges: r.inconsistent_edges,
            self_intersections: count_intersections.then(pairs),
        }
    }

    /// All counts with their names, in one order. Self-intersections that were not counted are 0.
    pub fn counts(&self) -> [(&'static str, u64); 12] {
        [
            ("unused vertices", self.isolated_points),
            ("vertices not finite", self.non_finite_points),
            ("faces with missing vertices", self.dangling_faces),
            ("degenerate faces", self.degenerate_faces),
            ("faces without area", self.zero_area_faces),
            ("duplicate faces", self.duplicate_faces),
            ("boundary edges", self.boundary_edges),
            ("holes", self.holes),
            ("non-manifold edges", self.non_manifold_edges),
            ("non-manifold vertices", self.non_manifold_vertices),
            ("inconsistent edges", self.inconsistent_edges),
            ("self-intersections", self.self_intersections.unwrap_or(0)),
        ]
    }

    /// Whether there are none.
    pub fn is_none(&self) -> bool {
        self.counts().iter().all(|count| count.1 == 0)
    }

    /// Whether any count is greater than it was.
    pub fn is_worse_than(&self, before: &Defects) -> bool {
        self.counts().iter().zip(before.counts()).any(|(now, then)| now.1 > then.1)
    }
}

/// What a step of healing did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HealStep {
    /// What was done, in one word.
    pub name: &'static str,
    /// How many things it was done to.
    pub count: u64,
    /// Whether it was undone because a count of defects had grown.
    pub is_undone: bool,
}

/// A mesh that was healed as far as can be.
#[derive(Debug, Clone, PartialEq)]
pub struct Healed {
    /// The mesh.
    pub mesh: Mesh,
    /// What was wrong.
    pub before: Defects,
    /// What is left.
    pub after: Defects,
    /// What was done, in order; steps that found nothing are left out.
    pub steps: Vec<HealStep>,
}

/// A step: finds and mends, and tells how often.
type Step = fn(&Mesh, &Setting) -> (Mesh, u64);

/// What steps need to know.
#[derive(Debug, Clone, Copy)]
struct Setting {
    /// In model units.
    tolerance: f64,
    max_hole_edges: u32,
    smooth: bool,
    check_intersections: bool,
    /// Whether a step may make a hole that a later one fills.
    is_bold: bool,
}

const STEPS: [(&str, Step); 13] = [
    ("replaced", clean::replace_lost),
    ("removed", clean::remove_void),
    ("unduplicated", clean::remove_duplicates),
    ("welded", weld::weld),
    ("collapsed", clean::remove_void),
    ("unduplicated", clean::remove_duplicates),
    ("stitched", stitch::stitch),
    ("flattened", flat::remove_flat),
    ("turned", orient::orient),
    ("cut apart", split::split_edges),
    ("turned", orient::orient),
    ("filled", fill::fill),
    ("untied", split::split_ties),
];

impl Mesh {
    /// Repairs what can be repaired locally, and leaves all good faces as they are.
    ///
    /// Points at no place are put between their neighbours. Faces that are none and duplicates go. Points of rims within a tolerance
    /// are welded, cracks between one long edge and several short ones stitched, triangles without area flipped or collapsed away.
    /// Faces are turned to run the way that most of their neighbours do, closed parts outward. Solids that share edges are cut apart;
    /// small holes are filled to match; fans that share a point only are untied.
    ///
    /// No count of [`Defects`] is worse than before, a mesh without defects comes back bit for bit, and the result does not depend on the
    /// number of threads. Some 0.5 µs a triangle for a clean mesh on two threads, two to twenty times that for others.
    ///
    /// # Errors
    /// When the tolerance is negative or no number, and `Cancelled`.
    ///
    /// ```
    /// use zmend::mesh::{HealOptions, sample};
    /// use zmend::progress::Silent;
    ///
    /// let broken = sample::build("knot-holes", 1)?;
    /// let healed = broken.heal(&HealOptions::default(), &Silent)?;
    /// assert_eq!((healed.before.holes, healed.after.holes), (7, 0));
    /// assert!(healed.after.is_none() && healed.mesh.validate().is_ok());
    /// # Ok::<(), zmend::Error>(())
    /// ```
    pub fn heal(&self, options: &HealOptions, progress: &dyn Progress) -> Result<Healed> {
        if !(options.tolerance >= 0.0 && options.tolerance.is_finite()) {
            let problem = format!("{} is no length", options.tolerance);
            return Err(Error::setting("tolerance", problem, "take a number from 0 on"));
        }
        progress.begin(Stage::Heal, STEPS.len() as u64 + 1);
        let count = |mesh: &Mesh| Defects::of(mesh, options.check_intersections);
        let before = count(self);
        progress.advance(1);
        let mut healed = Healed { mesh: self.clone(), before, after: before, steps: Vec::new() };
        // A solid that looks inwards is nothing to count, but something to mend.
        if before.is_none() && self.outward() {
            return Ok(healed);
        }
        let diagonal = self.report().bounds.extent().length();
        let unit = if options.is_absolute {
            1.0
        } else if diagonal.is_finite() {
            diagonal
        } else {
            0.0
        };
        let setting = Setting {
            tolerance: options.tolerance * unit,
            max_hole_edges: options.max_hole_edges,
            smooth: options.smooth,
            check_intersections: options.check_intersections,
            is_bold: true,
        };
        for (name, step) in STEPS {
            check(progress)?;
            let (mesh, count) = step(&healed.mesh, &setting);
            if count > 0 {
                healed.steps.push(HealStep { name, count, is_undone: false });
                healed.mesh = mesh;
            }
            progress.advance(1);
        }
        healed.after = count(&healed.mesh);
        if !healed.after.is_worse_than(&before) {
            return Ok(healed);
        }
        // Step by step, then.
        progress.begin(Stage::Heal, STEPS.len() as u64);
        healed = Healed { mesh: self.clone(), before, after: before, steps: Vec::new() };
        let setting = Setting { is_bold: false, ..setting };
        for (name, step) in STEPS {
            check(progress)?;
            let (mesh, done) = step(&healed.mesh, &setting);
            if done > 0 {
                let after = count(&mesh);
                let is_undone = after.is_worse_than(&healed.after);
                healed.steps.push(HealStep { name, count: done, is_undone });
                if !is_undone {
                    (healed.mesh, healed.after) = (mesh, after);
                }
            }
            progress.advance(1);
        }
        Ok(healed)
    }
}

/// The mesh with other numbers of points, faces made anew by a function that may leave out or add some, and unused points dropped.
fn rebuilt(mesh: &Mesh, mut each: impl FnMut(u32, &[u32], &mut super::Polygons)) -> Mesh {
    let mut faces = super::Polygons::with_capacity(mesh.faces.len(), mesh.faces.corners().len());
    (0..).zip(mesh.faces.iter()).for_each(|(i, face)| each(i, face, &mut faces));
    Mesh { points: mesh.points.clone(), faces }
}

#[cfg(test)]
mod tests;
