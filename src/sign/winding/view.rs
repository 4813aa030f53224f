//! The spanning surface as seen from the 64 points of a block: what is near is summed up triangle by triangle for all points
//! at once, the rest is a polynomial.
//!
//! Single precision and a polynomial for the arc tangent do, as angles in a view need only tell which points must be looked at closely:
//! those with w near to one half, and those beside the plane of a near triangle, where angles jump.
//!
//! Cost: some 5 ns a near triangle and point, 0.2 us for each thing that is far.

use super::boundary::Corner;
use super::field::{Field, Seen, Triangle};
use super::polynomial::{Batch, EXPONENTS, Polynomial, TERMS, Values};
use super::span::{Span, position};
use glam::DVec3;
use std::f64::consts::PI;

/// What is beyond so many radii of the block is far.
const NEAR: f64 = 2.0;
/// A chain is a dipole and a quadrupole for points beyond so many times its radius.
const FAR: f64 = 2.5;
/// So far may angles in a view be off.
pub(super) const VIEW_ERROR: f64 = 0.02;
/// Points of a block.
const POINTS: usize = 64;

/// The points of a block, by axis, and their powers in the order of [`EXPONENTS`].
const PLACES: [[f32; POINTS]; 3] = {
    let mut places = [[0.0; POINTS]; 3];
    let mut i = 0;
    while i < POINTS {
        places[0][i] = (i >> 4) as f32 - 2.0;
        places[1][i] = (i >> 2 & 3) as f32 - 2.0;
        places[2][i] = (i & 3) as f32 - 2.0;
        i += 1;
    }
    places
};
const POWERS: [[f32; POINTS]; TERMS] = {
    let mut powers = [[1.0; POINTS]; TERMS];
    let mut term = 0;
    while term < TERMS {
        let mut axis = 0;
        while axis < 3 {
            let mut n = 0;
            while n < EXPONENTS[term][axis] {
                let mut i = 0;
                while i < POINTS {
                    powers[term][i] *= PLACES[axis][i];
                    i += 1;
                }
                n += 1;
            }
            axis += 1;
        }
        term += 1;
    }
    powers
};

/// Angles at the points of one block after the other; keeps its list between them.
#[derive(Default)]
pub(super) struct View {
    near: Vec<u32>,
}

/// The winding number of the spanning surface at the points of a block, but for [`VIEW_ERROR`]; NaN where it must be looked at closely.
pub(super) type Angles = [f32; POINTS];

impl View {
    /// Angles at the points x, y, z = -2, -1, 0, 1 times `unit` from `middle`, z first. `field` is that of a cell with all these points.
    pub(super) fn angles(&mut self, span: &Span, field: &Field, middle: Corner, unit: i32) -> Angles {
        let (from, unit) = (position(middle), f64::from(unit));
        let far = self.collect(span, field, from, 2.0 * 3f64.sqrt() * unit).coefficients(unit);
        let mut angles = [0.0; POINTS];
        for (power, coefficient) in POWERS.iter().zip(far) {
            for (angle, power) in angles.iter_mut().zip(power) {
                *angle += coefficient as f32 * power;
            }
        }
        add_all(span, &self.near, from, unit, &mut angles);
        angles.map(|angle| angle / (4.0 * PI) as f32)
    }

    /// Lists what is near, and returns what is far as seen from `middle`.
    fn collect(&mut self, span: &Span, field: &Field, middle: DVec3, radius: f64) -> Polynomial {
        self.near.clear();
        let mut batch = Batch::new(radius);
        let is_far = |distance: f64, own: f64| distance > own + NEAR * radius && distance > FAR * own + radius;
        for near in field.near(span, |node| is_far(node.centre().distance(middle), f64::from(node.radius))) {
            match near {
                Seen::Far { node, .. } => batch.push(&node.source(), node.centre() - middle),
                Seen::Triangle { node, corners, .. } => {
                    let triangle = Triangle::new(corners);
                    if is_far(triangle.centre.distance(middle), triangle.radius) {
                        batch.push(&triangle.source(), triangle.centre - middle);
                    } else {
                        self.near.push(node.triangle);
                    }
                }
            }
        }
        let mut polynomial = field.far_from(middle);
        polynomial.add(batch);
        polynomial
    }
}

/// The solid angles of some triangles together, at points about a middle.
pub(super) fn angles_about(span: &Span, triangles: &[u32], middle: DVec3, unit: f64) -> Values {
    let mut angles = [0.0; POINTS];
    // Places are half a unit below.
    add_all(span, triangles, middle + 0.5 * unit, unit, &mut angles);
    angles
}

/// Adds the solid angles of triangles at all places, as seen from a middle.
fn add_all(span: &Span, triangles: &[u32], from: DVec3, unit: f64, angles: &mut Angles) {
    for &triangle in triangles {
        let corners = span.triangles[triangle as usize];
        add_near(corners.map(|corner| ((position(corner) - from) / unit).as_vec3().to_array()), angles);
    }
}

/// Adds the solid angles of a triangle at all places. The loop has no branches, so that several places are done at once.
fn add_near(corners: [[f32; 3]; 3], angles: &mut Angles) {
    const HALF: f32 = std::f32::consts::FRAC_PI_2;
    for i in 0..POINTS {
        let [a, b, c] = corners.map(|p| [p[0] - PLACES[0][i], p[1] - PLACES[1][i], p[2] - PLACES[2][i]]);
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        let [la, lb, lc] = [a, b, c].map(|v| dot(v, v).sqrt());
        let (volume, scale) = (dot(a, cross), la * lb * lc);
        let below = scale + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        // Arc tangent of their quotient, to 1e-5 (Hastings 1955, "Approximations for Digital Computers").
        let (high, low) = (volume.abs(), below.abs());
        let t = high.min(low) / high.max(low).max(f32::MIN_POSITIVE);
        let t2 = t * t;
        let arc = t * (0.999_866 + t2 * (-0.330_299_5 + t2 * (0.180_141 + t2 * (-0.085_133 + t2 * 0.020_835_1))));
        let arc = if high > low { HALF - arc } else { arc };
        let arc = if below < 0.0 { 2.0 * HALF - arc } else { arc };
        let is_sure = high > 1e-4 * scale || below > 1e-3 * scale;
        angles[i] += if is_sure { 2.0 * arc.copysign(volume) } else { f32::NAN };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Of rings near and far, a view has the angles that the points have.
        #[test]
        fn views_are_what_points_see(ring in prop::collection::vec(prop::array::uniform3(-40..40i32), 3..9), others in prop::collection::vec((prop::array::uniform3(-9..9i32), 2..30i32), 0..20)) {
            let unit = 1 << 16;
            let middle = [1 << 25; 3];
            let place = |p: Corner| std::array::from_fn(|a| middle[a] + p[a] * unit / 2 + 77);
            let mut rings = vec![ring.iter().map(|&p| place(p)).collect::<Vec<Corner>>()];
            rings.extend(others.iter().map(|&(at, size)| {
                let step = |s: [i32; 3]| place(std::array::from_fn(|a| 20 * at[a] + size * s[a]));
                vec![step([0, 0, 0]), step([1, 0, 0]), step([0, 1, 0]), step([0, 0, 1])]
            }));
            let span = Span::new(rings);
            let field = Field::whole(&span);
            let angles = View::default().angles(&span, &field, middle, unit);
            for (i, angle) in angles.into_iter().enumerate().filter(|(_, angle)| !angle.is_nan()) {
                let at: Corner = std::array::from_fn(|a| middle[a] + ((i as i32 >> (4 - 2 * a) & 3) - 2) * unit);
                let plain = field.angle(&span, at);
                prop_assert!((f64::from(angle) - plain).abs() < VIEW_ERROR, "{}: {} {}", i, angle, plain);
            }
        }
    }
}
