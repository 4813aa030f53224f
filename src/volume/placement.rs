//! Where a lattice lies in the model's space.

use crate::error::{Error, Result, Short};
use glam::{DMat3, DVec3};

/// The place of the lattice of a volume: an affine map from lattice points to model units. Any spacing, turned, mirrored or slanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Where the sample `[0, 0, 0]` is, in model units.
    pub origin: DVec3,
    /// The steps from a sample to the next one along x, y and z, in model units: the columns.
    pub axes: DMat3,
}

impl Default for Placement {
    /// Lattice points are where their numbers say.
    fn default() -> Self {
        Placement { origin: DVec3::ZERO, axes: DMat3::IDENTITY }
    }
}

impl Placement {
    /// Steps of these lengths along the model's own axes.
    pub fn with_spacing(origin: DVec3, spacing: DVec3) -> Self {
        Placement { origin, axes: DMat3::from_diagonal(spacing) }
    }

    /// From a place on the lattice to model units.
    #[inline]
    pub fn to_model(&self, place: DVec3) -> DVec3 {
        self.origin + self.axes * place
    }

    /// Lengths of the steps along x, y and z, in model units.
    pub fn spacing(&self) -> DVec3 {
        DVec3::new(self.axes.x_axis.length(), self.axes.y_axis.length(), self.axes.z_axis.length())
    }

    /// Whether the lattice is a mirror image: its axes are left-handed.
    pub fn is_mirrored(&self) -> bool {
        self.axes.determinant() < 0.0
    }

    /// The same lattice, counted from another of its points.
    #[must_use]
    pub fn starting_at(&self, first: DVec3) -> Self {
        Placement { origin: self.to_model(first), axes: self.axes }
    }

    /// Whether lattice points of different numbers are at different places.
    ///
    /// # Errors
    /// When something is not finite, or the axes lie in a plane, or nearly do.
    pub fn check(&self) -> Result<()> {
        let volume = self.axes.determinant().abs();
        let spacing = self.spacing();
        // Cells whose height is less than a billionth of their sides are as flat as makes no difference.
        let is_sound = self.origin.is_finite() && volume.is_normal() && volume > 1e-9 * spacing.element_product();
        if is_sound {
            return Ok(());
        }
        let [x, y, z] = spacing.to_array().map(Short);
        let problem = format!("steps of {x}, {y} and {z} units do not span a space, or the origin is not finite");
        Err(Error::setting("placement", problem, "give three lengths above 0, as `--spacing 1,1,2` does"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placements_are_affine() {
        let placement = Placement::with_spacing(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 1.0, -2.0));
        assert_eq!(placement.to_model(DVec3::new(2.0, 1.0, 1.0)), DVec3::new(2.0, 3.0, 1.0));
        assert_eq!(placement.starting_at(DVec3::Z).to_model(DVec3::ZERO), placement.to_model(DVec3::Z));
        assert!(placement.is_mirrored() && placement.check().is_ok());
        assert_eq!(placement.spacing(), DVec3::new(0.5, 1.0, 2.0));
    }

    #[test]
    fn flat_placements_are_refused() {
        for spacing in [DVec3::new(1.0, 0.0, 1.0), DVec3::new(1.0, f64::NAN, 1.0), DVec3::new(1.0, f64::INFINITY, 1.0)]
        {
            assert!(Placement::with_spacing(DVec3::ZERO, spacing).check().is_err());
        }
        let slanted = DMat3::from_cols(DVec3::X, DVec3::X + 1e-12 * DVec3::Y, DVec3::Z);
        let message = Placement { origin: DVec3::ZERO, axes: slanted }.check().unwrap_err().to_string();
        assert!(message.contains("--spacing"), "{message}");
    }
}
