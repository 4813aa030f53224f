//! Quadratic error functions: the point nearest to several tangent planes (Ju, Losasso, Schaefer and Warren 2002).
//!
//! The sum of squared distances to the planes may have no single minimum: on a flat piece any point of the plane will do, on a
//! crease any point of the line. Instead of cutting off small singular values we add a small penalty on the distance from the
//! mass point (Tikhonov). Where the planes say nothing the result is the mass point's projection, as with the cut-off; where they
//! do, it is moved by the factor penalty / singular value: continuous in the input, and a closed formula.

use glam::{Mat3A, Vec3A};

/// Weight of the distance from the mass point, relative to one plane. Normals are stored to within 0.6 degrees, which on a flat piece
/// looks like a singular value of up to (0.01)^2 = 1e-4 a plane; a crease of 30 degrees has 2e-2, one of 90 degrees 0.5. 1e-3 lies
/// between: it damps the noise to a tenth, and pulls the crease of 90 degrees in by 0.2 percent of the way to the mass point.
const PENALTY: f32 = 1e-3;

/// Tangent planes seen so far. In single precision: 1e-7 is far below the penalty.
#[derive(Debug, Clone, Copy)]
pub struct Qef {
    /// Sum of n n^T.
    products: Mat3A,
    /// Sum of n (n . p).
    moments: Vec3A,
    points: Vec3A,
    normals: Vec3A,
    count: f32,
}

impl Default for Qef {
    fn default() -> Self {
        let zero = Vec3A::ZERO;
        Qef { products: Mat3A::ZERO, moments: zero, points: zero, normals: zero, count: 0.0 }
    }
}

impl Qef {
    /// Adds the plane through `p` with unit normal `n`. Take coordinates near 0: precision is relative to them.
    #[inline]
    pub fn add(&mut self, p: Vec3A, n: Vec3A) {
        self.products.x_axis += n * n.x;
        self.products.y_axis += n * n.y;
        self.products.z_axis += n * n.z;
        self.moments += n * n.dot(p);
        self.points += p;
        self.normals += n;
        self.count += 1.0;
    }

    /// Mean of the points. There must be at least one.
    #[inline]
    pub fn mass_point(&self) -> Vec3A {
        self.points / self.count
    }

    /// Squared length of the mean normal, for normals that all point outward: 1 on a flat piece, 1/2 at a crease of 90 degrees.
    #[inline]
    pub fn flatness(&self) -> f32 {
        self.normals.length_squared() / (self.count * self.count)
    }

    /// The point with the least sum of squared distances to the planes, and to the mass point with a weight of one in a thousand.
    /// There must be at least one plane.
    #[inline]
    pub fn minimiser(&self) -> Vec3A {
        let mass = self.mass_point();
        let residual = self.moments - self.products * mass;
        // Solve (products + penalty) d = residual by cofactors: the matrix is symmetric, and positive thanks to the penalty.
        let penalty = PENALTY * self.count;
        let a = self.products.x_axis + Vec3A::X * penalty;
        let b = self.products.y_axis + Vec3A::Y * penalty;
        let c = self.products.z_axis + Vec3A::Z * penalty;
        let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
        let step = bc * residual.x + ca * residual.y + ab * residual.z;
        mass + step / a.dot(bc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn qef(planes: &[([f32; 3], [f32; 3])]) -> Qef {
        let mut q = Qef::default();
        planes.iter().for_each(|(p, n)| q.add(Vec3A::from(*p), Vec3A::from(*n).normalize()));
        q
    }

    #[test]
    fn a_corner_is_found() {
        let q =
            qef(&[([0.3, 0.5, 0.1], [1., 0., 0.]), ([0.2, 0.6, 0.9], [0., 1., 0.]), ([0.9, 0.1, 0.7], [0., 0., 1.])]);
        assert!(q.minimiser().distance(Vec3A::new(0.3, 0.6, 0.7)) < 5e-3, "{}", q.minimiser());
        assert!((q.flatness() - 1.0 / 3.0).abs() < 1e-6);
    }

    #[test]
    fn on_a_crease_the_mass_point_decides() {
        let q = qef(&[
            ([0.3, 0.5, 0.0], [1., 0., 0.]),
            ([0.3, 0.1, 1.0], [1., 0., 0.]),
            ([0.5, 0.6, 0.0], [0., 1., 0.]),
            ([0.9, 0.6, 1.0], [0., 1., 0.]),
        ]);
        assert!(q.minimiser().distance(Vec3A::new(0.3, 0.6, 0.5)) < 2e-3, "{}", q.minimiser());
    }

    #[test]
    fn on_a_plane_it_is_the_mass_point() {
        let q = qef(&[([0., 0., 0.5], [0., 0., 1.]), ([1., 0., 0.5], [0., 0., 1.]), ([0., 1., 0.5], [0., 0., 1.])]);
        assert!(q.minimiser().distance(q.mass_point()) < 1e-6);
        assert!((q.flatness() - 1.0).abs() < 1e-6);
    }
}
