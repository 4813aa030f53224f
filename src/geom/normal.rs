//! Unoriented normals in 16 bits.
//!
//! A surface crosses a lattice edge; which side is inside is a matter of signs, not of the triangle. So the stored normal
//! has no orientation: the component along the edge's axis is taken as positive, and only half of the sphere needs codes.
//! The hemisphere is unfolded onto a square (octahedral map, Meyer et al. 2010) of 255 x 255 codes, with the pole, the
//! commonest normal of all in machine parts, represented exactly. The largest error is 0.6 degrees.

use crate::grid::Axis;
use glam::Vec3A;

/// An unoriented unit normal, relative to the axis of the edge that it belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct NormalCode(pub u16);

/// Codes a side: odd, so that 0 has a code.
const HALF: f64 = 127.0;

impl NormalCode {
    /// Encodes a normal of any length and sign, for a crossing of an edge along `axis`.
    ///
    /// Its component along the axis must not be 0: a triangle parallel to an edge does not cross it.
    pub fn encode(axis: Axis, normal: [f64; 3]) -> Self {
        let [u, v] = axis.others().map(|a| normal[a.index()]);
        let w = normal[axis.index()];
        let scale = HALF * w.signum() / (u.abs() + v.abs() + w.abs());
        let (a, b) = (u * scale, v * scale);
        // |a| + |b| <= 127: rotating by 45 degrees fills the square. Adding 127.5 rounds to nearest.
        let (s, t) = ((a + b + (HALF + 0.5)) as u16, (a - b + (HALF + 0.5)) as u16);
        NormalCode(s << 8 | t)
    }

    /// The unit normal; its component along `axis` is not negative.
    #[inline]
    pub fn decode(self, axis: Axis) -> Vec3A {
        const HALF: f32 = super::normal::HALF as f32;
        let (s, t) = (f32::from(self.0 >> 8) - HALF, f32::from(self.0 & 255) - HALF);
        let (a, b) = (0.5 * (s + t), 0.5 * (s - t));
        let c = HALF - a.abs() - b.abs();
        let n = match axis {
            Axis::X => Vec3A::new(c, a, b),
            Axis::Y => Vec3A::new(b, c, a),
            Axis::Z => Vec3A::new(a, b, c),
        };
        n / n.length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn error_is_below_six_tenths_of_a_degree(n in [-1.0..1.0, -1.0..1.0, -1.0..1.0], axis in 0usize..3) {
            let axis = Axis::ALL[axis];
            let unit = DVec3::from(n).normalize();
            prop_assume!(unit[axis.index()].abs() > 1e-3);
            let back = NormalCode::encode(axis, n).decode(axis).as_dvec3();
            prop_assert!(back[axis.index()] >= 0.0);
            prop_assert!(unit.dot(back).abs().min(1.0).acos().to_degrees() < 0.6, "{unit} {back}");
            prop_assert_eq!(NormalCode::encode(axis, n.map(|c| -c)), NormalCode::encode(axis, n));
            prop_assert_eq!(NormalCode::encode(axis, n.map(|c| 1e40 * c)), NormalCode::encode(axis, n));
        }
    }

    #[test]
    fn the_pole_is_exact() {
        assert_eq!(NormalCode::encode(Axis::Y, [0.0, -3.0, 0.0]).decode(Axis::Y), Vec3A::Y);
    }
}
