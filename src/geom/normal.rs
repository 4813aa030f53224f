//! Unoriented normals in 16 bits.
//!
//! A surface crosses a lattice edge; which side is inside is a matter of signs, not of the triangle. So the stored normal
//! has no orientation: the component along the edge's axis is taken as positive, and only half of the sphere needs codes.
//! The hemisphere is unfolded onto a square (octahedral map, Meyer et al. 2010) of 255 x 255 codes, with the pole, the
//! commonest normal of all in machine parts, represented exactly. The largest error is 0.6 degrees.

use glam::DVec3;

/// An unoriented unit normal, relative to the axis of the edge that it belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct NormalCode(pub u16);

/// Codes a side: odd, so that 0 has a code.
const HALF: f64 = 127.0;

impl NormalCode {
    /// Encodes a normal given by its components (any length, any sign) along the two other axes `u`, `v` and along the
    /// edge's own axis `w`.
    ///
    /// `w` must not be 0: a triangle parallel to an edge does not cross it.
    pub fn encode(u: f64, v: f64, w: f64) -> Self {
        let scale = HALF * w.signum() / (u.abs() + v.abs() + w.abs());
        let (a, b) = (u * scale, v * scale);
        // |a| + |b| <= 127: rotating by 45 degrees fills the square. Adding 127.5 rounds to nearest.
        let (s, t) = ((a + b + (HALF + 0.5)) as u16, (a - b + (HALF + 0.5)) as u16);
        NormalCode(s << 8 | t)
    }

    /// The unit normal as components along `u`, `v`, `w`, with `w` not negative.
    pub fn decode(self) -> [f64; 3] {
        let (s, t) = (f64::from(self.0 >> 8) - HALF, f64::from(self.0 & 255) - HALF);
        let (a, b) = (0.5 * (s + t), 0.5 * (s - t));
        let c = HALF - a.abs() - b.abs();
        let n = DVec3::new(a, b, c);
        (n / n.length()).to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn error_is_below_six_tenths_of_a_degree(u in -1.0..1.0, v in -1.0..1.0, w in 0.001..1.0) {
            let n = DVec3::new(u, v, w).normalize();
            let back = DVec3::from(NormalCode::encode(n.x, n.y, n.z).decode());
            prop_assert!((n.dot(back)).acos().to_degrees() < 0.6, "{n} {back}");
            prop_assert_eq!(NormalCode::encode(-u, -v, -w), NormalCode::encode(u, v, w));
            prop_assert_eq!(NormalCode::encode(1e40 * u, 1e40 * v, 1e40 * w), NormalCode::encode(u, v, w));
        }
    }

    #[test]
    fn the_pole_is_exact() {
        assert_eq!(NormalCode::encode(0.0, 0.0, -3.0).decode(), [0.0, 0.0, 1.0]);
    }
}
