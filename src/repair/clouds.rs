//! Solids from clouds of points.

use super::Solid;
use crate::cloud::{Cloud, CloudOptions, CloudReport};
use crate::error::Result;
use crate::field::Field;
use crate::progress::Progress;

impl Solid {
    /// The solid whose surface the points of a cloud were taken of; see [`cloud`](crate::cloud). Crossings have normals, for any surface.
    ///
    /// Cost: for cells half as wide as points are apart, some 100 us and 3 kB a point.
    ///
    /// # Errors
    /// As [`Field::of_cloud`].
    pub fn from_cloud(cloud: &Cloud, options: &CloudOptions, progress: &dyn Progress) -> Result<(Solid, CloudReport)> {
        let (field, sheet, report) = Field::of_cloud(cloud, options, progress)?;
        let octree = field.signed_by(&sheet, progress)?;
        Ok((Solid::new(octree, *field.frame()), report))
    }
}
