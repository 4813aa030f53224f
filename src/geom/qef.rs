//! Quadratic error functions: the point nearest to several tangent planes (Ju, Losasso, Schaefer and Warren 2002).
//!
//! The sum of squared distances to the planes may have no single minimum: on a flat piece any point of the plane will do, on a
//! crease any point of the line. Instead of cutting off small singular values we add a small penalty on the distance from the
//! mass point (Tikhonov). Where the planes say nothing the result is the mass point's projection, as with the cut-off; where they
//! do, it is moved by the factor penalty / singular value: continuous in the input, and a closed formula.

use glam::DVec3;

/// Weight of the distance from the mass point, relative to one plane. Normals are stored to within 0.6 degrees, which on a flat piece
/// looks like a singular value of up to (0.01)^2 = 1e-4 a plane; a crease of 30 degrees has 2e-2, one of 90 degrees 0.5. 1e-3 lies
/// between: it damps the noise to a tenth, and pulls the crease of 90 degrees in by 0.2 percent of the way to the mass point.
const PENALTY: f64 = 1e-3;

/// Tangent planes seen so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Qef {
    /// Sum of n n^T: xx, xy, xz, yy, yz, zz.
    products: [f64; 6],
    /// Sum of n (n . p).
    moments: DVec3,
    points: DVec3,
    normals: DVec3,
    count: f64,
}

impl Qef {
    /// Adds the plane through `p` with unit normal `n`. Take coordinates near 0: they are squared.
    #[inline]
    pub fn add(&mut self, p: DVec3, n: DVec3) {
        let products = [n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z];
        self.products.iter_mut().zip(products).for_each(|(sum, x)| *sum += x);
        self.moments += n * n.dot(p);
        self.points += p;
        self.normals += n;
        self.count += 1.0;
    }

    /// Mean of the points. There must be at least one.
    #[inline]
    pub fn mass_point(&self) -> DVec3 {
        self.points / self.count
    }

    /// Squared length of the mean normal, for normals that all point outward: 1 on a flat piece, 1/2 at a crease of 90 degrees.
    #[inline]
    pub fn flatness(&self) -> f64 {
        self.normals.length_squared() / (self.count * self.count)
    }

    /// The point with the least sum of squared distances to the planes, and to the mass point with a weight of one in a thousand.
    /// There must be at least one plane.
    #[inline]
    pub fn minimiser(&self) -> DVec3 {
        let mass = self.mass_point();
        let [xx, xy, xz, yy, yz, zz] = self.products;
        let product = |v: DVec3| {
            DVec3::new(xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z)
        };
        let r = self.moments - product(mass);
        // Solve (products + penalty) d = r by cofactors: the matrix is symmetric, and positive thanks to the penalty.
        let penalty = PENALTY * self.count;
        let (a, d, f) = (xx + penalty, yy + penalty, zz + penalty);
        let (b, c, e) = (xy, xz, yz);
        let (ca, cb, cc) = (d * f - e * e, c * e - b * f, b * e - c * d);
        let (cd, ce, cf) = (a * f - c * c, b * c - a * e, a * d - b * b);
        let det = a * ca + b * cb + c * cc;
        let step =
            DVec3::new(ca * r.x + cb * r.y + cc * r.z, cb * r.x + cd * r.y + ce * r.z, cc * r.x + ce * r.y + cf * r.z);
        mass + step / det
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn qef(planes: &[([f64; 3], [f64; 3])]) -> Qef {
        let mut q = Qef::default();
        planes.iter().for_each(|(p, n)| q.add(DVec3::from(*p), DVec3::from(*n).normalize()));
        q
    }

    #[test]
    fn a_corner_is_found() {
        let q =
            qef(&[([0.3, 0.5, 0.1], [1., 0., 0.]), ([0.2, 0.6, 0.9], [0., 1., 0.]), ([0.9, 0.1, 0.7], [0., 0., 1.])]);
        assert!(q.minimiser().distance(DVec3::new(0.3, 0.6, 0.7)) < 5e-3, "{}", q.minimiser());
        assert!((q.flatness() - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn on_a_crease_the_mass_point_decides() {
        let q = qef(&[
            ([0.3, 0.5, 0.0], [1., 0., 0.]),
            ([0.3, 0.1, 1.0], [1., 0., 0.]),
            ([0.5, 0.6, 0.0], [0., 1., 0.]),
            ([0.9, 0.6, 1.0], [0., 1., 0.]),
        ]);
        assert!(q.minimiser().distance(DVec3::new(0.3, 0.6, 0.5)) < 2e-3, "{}", q.minimiser());
    }

    #[test]
    fn on_a_plane_it_is_the_mass_point() {
        let q = qef(&[([0., 0., 0.5], [0., 0., 1.]), ([1., 0., 0.5], [0., 0., 1.]), ([0., 1., 0.5], [0., 0., 1.])]);
        assert!(q.minimiser().distance(q.mass_point()) < 1e-12);
        assert!((q.flatness() - 1.0).abs() < 1e-12);
    }
}
