//! Quadratic error functions: the point nearest to several tangent planes (Ju, Losasso, Schaefer and Warren 2002).
//!
//! The sum of squared distances to the planes may have no single minimum: on a flat piece any point of the plane will do, on a
//! crease any point of the line. Instead of cutting off small singular values we add a small penalty on the distance from the
//! mass point (Tikhonov). Where the planes say nothing the result is the mass point's projection, as with the cut-off; where they
//! do, it is moved by the factor penalty / singular value: continuous in the input, and a closed formula.

use glam::{Vec3A, Vec4};
use std::ops::AddAssign;

/// Weight of the distance from the mass point, relative to one plane. Normals are stored to within 0.6 degrees, which on a flat piece
/// looks like a singular value of up to (0.01)^2 = 1e-4 a plane; a crease of 30 degrees has 2e-2, one of 90 degrees 0.5. 1e-3 lies
/// between: it damps the noise to a tenth, and pulls the crease of 90 degrees in by 0.2 percent of the way to the mass point.
const PENALTY: f32 = 1e-3;

/// The sum of the squared distances to some planes. Functions are added by adding them: a crossing makes one, and every cell beside
/// it adds it to its own. Coordinates up to 8 keep rounding (1e-6) far below the penalty.
#[derive(Debug, Clone, Copy)]
pub struct Qef {
    /// Rows of the sum of n n^T, and n.
    rows: [Vec4; 3],
    /// Sum of n (n . p), and of (n . p)^2.
    moments: Vec4,
    /// Sum of p, and the number of planes.
    points: Vec4,
}

impl Qef {
    /// No plane.
    pub const EMPTY: Qef = Qef { rows: [Vec4::ZERO; 3], moments: Vec4::ZERO, points: Vec4::ZERO };

    /// The plane through `p` with unit normal `n`.
    #[inline]
    pub fn of_plane(p: Vec3A, n: Vec3A) -> Qef {
        let normal = Vec4::from((n, 1.0));
        let distance = n.dot(p);
        Qef {
            rows: [normal * n.x, normal * n.y, normal * n.z],
            moments: normal.with_w(distance) * distance,
            points: Vec4::from((p, 1.0)),
        }
    }

    /// Mean of the points. There must be at least one.
    #[inline]
    pub fn mass_point(&self) -> Vec3A {
        Vec3A::from_vec4(self.points) / self.points.w
    }

    /// Squared length of the mean normal, for normals that all point outward: 1 on a flat piece, 1/2 at a crease of 90 degrees.
    #[inline]
    pub fn flatness(&self) -> f32 {
        let [x, y, z] = self.rows.map(|row| row.w);
        Qef::flatness_of(Vec4::new(x, y, z, self.points.w))
    }

    /// The same, given the sum of the normals and their number.
    #[inline]
    pub fn flatness_of(normals: Vec4) -> f32 {
        let [x, y, z, number] = normals.to_array();
        (x * x + y * y + z * z) / (number * number)
    }

    /// Mean of the squared distances of a point from the planes. There must be at least one. Rounding: 1e-5 for coordinates up to 8.
    pub fn mean_square(&self, p: Vec3A) -> f32 {
        let [x, y, z] = self.rows.map(Vec3A::from_vec4);
        let twice = x * p.x + y * p.y + z * p.z - 2.0 * Vec3A::from_vec4(self.moments);
        (twice.dot(p) + self.moments.w) / self.points.w
    }

    /// The point with the least sum of squared distances to the planes, and to the mass point with a weight of one in a thousand.
    /// There must be at least one plane.
    #[inline]
    pub fn minimiser(&self) -> Vec3A {
        let mass = self.mass_point();
        let [x, y, z] = self.rows.map(Vec3A::from_vec4);
        let residual = Vec3A::from_vec4(self.moments) - (x * mass.x + y * mass.y + z * mass.z);
        // Solve (n n^T + penalty) d = residual by cofactors: the matrix is symmetric, and positive thanks to the penalty.
        let penalty = PENALTY * self.points.w;
        let (a, b, c) = (x + Vec3A::X * penalty, y + Vec3A::Y * penalty, z + Vec3A::Z * penalty);
        let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
        let step = bc * residual.x + ca * residual.y + ab * residual.z;
        mass + step / a.dot(bc)
    }
}

/// Constrained minimum.
impl Qef {
    /// The same among the points of a box: the minimum stays on a crease, as far as the crease is in the box. If the free minimum lies
    /// outside, the coordinate that is furthest out is put on its side of the box and the others are solved for again.
    #[inline]
    pub fn minimiser_within(&self, low: Vec3A, high: Vec3A) -> Vec3A {
        let free = self.minimiser();
        if free.cmpge(low).all() && free.cmple(high).all() { free } else { self.minimiser_on_side(free, low, high) }
    }

    #[cold]
    fn minimiser_on_side(&self, mut p: Vec3A, low: Vec3A, high: Vec3A) -> Vec3A {
        let mass = self.mass_point();
        let penalty = PENALTY * self.points.w;
        let mut fixed = [false; 3];
        for _ in 0..3 {
            let outside = (low - p).max(p - high).to_array();
            let open = (0..3).filter(|&a| !fixed[a] && outside[a] > 0.0);
            let Some(worst) = open.max_by(|&a, &b| outside[a].total_cmp(&outside[b])) else { break };
            fixed[worst] = true;
            p[worst] = p[worst].clamp(low[worst], high[worst]);
            // Gauss and Seidel: with one or two unknowns and a diagonal made positive by the penalty, few rounds will do.
            for _ in 0..16 {
                for a in (0..3).filter(|&a| !fixed[a]) {
                    let row = Vec3A::from_vec4(self.rows[a]);
                    let rest = self.moments[a] + penalty * mass[a] - (row.dot(p) - row[a] * p[a]);
                    p[a] = rest / (row[a] + penalty);
                }
            }
        }
        p.clamp(low, high)
    }
}

impl AddAssign<&Qef> for Qef {
    #[inline]
    fn add_assign(&mut self, other: &Qef) {
        self.rows.iter_mut().zip(other.rows).for_each(|(row, other)| *row += other);
        self.moments += other.moments;
        self.points += other.points;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn qef(planes: &[([f32; 3], [f32; 3])]) -> Qef {
        let mut q = Qef::EMPTY;
        planes.iter().for_each(|(p, n)| q += &Qef::of_plane(Vec3A::from(*p), Vec3A::from(*n).normalize()));
        q
    }

    #[test]
    fn a_corner_is_found() {
        let q =
            qef(&[([0.3, 0.5, 0.1], [1., 0., 0.]), ([0.2, 0.6, 0.9], [0., 1., 0.]), ([0.9, 0.1, 0.7], [0., 0., 1.])]);
        assert!(q.minimiser().distance(Vec3A::new(0.3, 0.6, 0.7)) < 5e-3, "{}", q.minimiser());
        assert!((q.flatness() - 1.0 / 3.0).abs() < 1e-6);
    }

    /// Planes at distances 3, 0 and 4 from a point, far from the origin as in the last cells of a brick.
    #[test]
    fn squared_distances_are_averaged() {
        let q =
            qef(&[([5.0, 8.0, 1.0], [1., 0., 0.]), ([1.0, 7.5, 3.0], [0., 1., 0.]), ([8.0, 1.0, 2.0], [0., 0., -1.])]);
        assert!((q.mean_square(Vec3A::new(8.0, 7.5, 6.0)) - 25.0 / 3.0).abs() < 1e-4);
        assert!(q.mean_square(Vec3A::new(5.0, 7.5, 2.0)).abs() < 2e-5);
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

    /// The crease x = 0.3, y = 1.4 lies outside of the unit box: its nearest points are on the side y = 1, on the plane x = 0.3.
    #[test]
    fn outside_of_the_box_the_other_planes_count() {
        let q =
            qef(&[([0.3, 0.5, 0.2], [1., 0., 0.]), ([0.8, 1.4, 0.6], [0., 1., 0.]), ([0.3, 0.9, 0.9], [1., 0., 0.])]);
        let p = q.minimiser_within(Vec3A::ZERO, Vec3A::ONE);
        assert!((p.x - 0.3).abs() < 2e-3 && p.y == 1.0 && p.z >= 0.0 && p.z <= 1.0, "{p}");
    }

    #[test]
    fn on_a_plane_it_is_the_mass_point() {
        let q = qef(&[([0., 0., 0.5], [0., 0., 1.]), ([1., 0., 0.5], [0., 0., 1.]), ([0., 1., 0.5], [0., 0., 1.])]);
        assert!(q.minimiser().distance(q.mass_point()) < 1e-6);
        assert!((q.flatness() - 1.0).abs() < 1e-6);
    }
}
