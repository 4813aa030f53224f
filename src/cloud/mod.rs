//! Clouds of points: from points to the surface that they were taken of, and back.
//!
//! ```text
//! points -> normals -> winding number and planes -> Field on an octree -> signs and crossings -> surface
//! ```
//!
//! [`Solid::from_cloud`](crate::Solid::from_cloud) makes a solid of a [`Cloud`], whose surface is closed, manifold and right side out
//! because it is extracted from signs, as all surfaces are here. [`scatter`] goes the other way. [`pivot()`] interpolates: a
//! ball rolls over the points and leaves triangles between them.
//!
//! | piece | what it does |
//! |---|---|
//! | [`Near`] | which points are near |
//! | [`Plane`] | planes of points |
//! | [`Shape`] | spacing, normals and areas of points; which side is out |
//! | [`Dipoles`] | the winding number of oriented points |
//! | [`Sheet`] | both as a function, whose [`Field`](crate::field::Field) has the surface |
//!
//! ```
//! use zmend::cloud::{CloudOptions, ScatterOptions, scatter};
//! use zmend::mesh::sample;
//! use zmend::progress::Silent;
//! use zmend::{Mesh, Options, Solid};
//!
//! let ball = sample::build("sphere", 1)?;
//! let mut cloud = scatter(&ball, &ScatterOptions::default(), &Silent)?;
//! cloud.normals.clear(); // found again
//! let (solid, report) = Solid::from_cloud(&cloud, &CloudOptions::default(), &Silent)?;
//! let mut surface = Mesh::default();
//! solid.extract(&Options::default(), &mut surface, &Silent)?;
//! assert_eq!(surface.validate(), Ok(()));
//! assert!(!report.had_normals && surface.report().volume > 0.0);
//! # Ok::<(), zmend::Error>(())
//! ```

mod dipoles;
mod near;
mod orient;
mod outside;
mod parts;
mod pivot;
mod plane;
mod scatter;
mod shape;
mod sheet;
mod surface;

pub use dipoles::{Dipoles, View};
pub use near::{NONE, Near};
pub use pivot::pivot;
pub use plane::Plane;
pub use scatter::{Pattern, ScatterOptions, scatter, scatter_into};
pub use shape::Shape;
pub use sheet::Sheet;
pub use surface::{CloudOptions, CloudReport};

use crate::geom::Bounds;
use glam::DVec3;
use rayon::prelude::*;

/// Points in space, and perhaps their normals.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cloud {
    /// The points, in model units.
    pub points: Vec<DVec3>,
    /// A normal each, outward and of any length, or none at all.
    pub normals: Vec<DVec3>,
}

impl Cloud {
    /// Whether there is a normal for each point.
    pub fn has_normals(&self) -> bool {
        !self.points.is_empty() && self.normals.len() == self.points.len()
    }

    /// The least box that holds all points that are finite.
    pub fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        self.points.iter().for_each(|&p| bounds.add(p));
        bounds
    }

    /// Without points that are not finite, and with each place once: the first point there stays. Without all normals if a point that stays
    /// has none of a length. Returns how many points are gone. Sorts 32 bytes a point.
    pub fn clean(&mut self) -> usize {
        let before = self.points.len();
        let has_normals = self.has_normals();
        let finite = (0..before).into_par_iter().filter(|&i| self.points[i].is_finite());
        // Zeros are equal whatever their sign.
        let mut places: Vec<([u64; 3], usize)> =
            finite.map(|i| (self.points[i].to_array().map(|c| (c + 0.0).to_bits()), i)).collect();
        places.par_sort_unstable();
        places.dedup_by_key(|place| place.0);
        let mut kept: Vec<usize> = places.into_iter().map(|place| place.1).collect();
        kept.par_sort_unstable();
        if kept.len() < before {
            self.points = kept.iter().map(|&i| self.points[i]).collect();
            if has_normals {
                self.normals = kept.iter().map(|&i| self.normals[i]).collect();
            }
        }
        let is_normal = |n: &DVec3| n.is_finite() && n.length_squared().is_normal();
        if !has_normals || !self.normals.iter().all(is_normal) {
            self.normals.clear();
        }
        before - self.points.len()
    }
}
