//! Planes through points: by the directions in which the points are spread least.

use glam::{DMat3, DVec3};

/// Rotations of the Jacobi method until a matrix is diagonal; ten sweeps are more than any needs.
const SWEEPS: usize = 10;

/// A plane fitted to points by covariance: through their mean, across the direction in which they vary least (Hoppe et al. 1992).
///
/// Unlike the regression of one coordinate by the others, it is the same for a wall as for a floor; and sums are taken about the mean, so
/// that nothing is lost far from the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// The mean of the points.
    pub centre: DVec3,
    /// Unit normal, one way or the other.
    pub normal: DVec3,
    /// How much the points vary across the plane, as a part of what they vary in all: 0 for a plane, 1/3 for a ball of points.
    pub variation: f64,
}

impl Plane {
    /// The plane of some points. `None` for fewer than three, and for points on a line or in one place, which have none.
    ///
    /// ```
    /// use zmend::cloud::Plane;
    /// use zmend::glam::DVec3;
    ///
    /// // A wall, far out.
    /// let points = [[0.0, 0.0], [0.0, 1.0], [2.0, 1.0], [2.0, 0.0]].map(|[y, z]| DVec3::new(1e6, y, z));
    /// let plane = Plane::fit(points).unwrap();
    /// assert!((plane.normal.x.abs() - 1.0).abs() < 1e-12 && plane.centre == DVec3::new(1e6, 1.0, 0.5));
    /// ```
    pub fn fit(points: impl IntoIterator<Item = DVec3> + Clone) -> Option<Plane> {
        let (mut count, mut sum) = (0.0, DVec3::ZERO);
        for p in points.clone() {
            sum += p;
            count += 1.0;
        }
        let centre = sum / count;
        let mut spread = DMat3::ZERO;
        for p in points {
            let d = p - centre;
            spread += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        let (values, vectors) = eigen(spread);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let [least, middle, most] = order.map(|i| values[i].max(0.0));
        // On a line, any plane through it is as good.
        let is_spread = count >= 3.0 && most > 0.0 && middle > 1e-12 * most;
        is_spread.then(|| Plane {
            centre,
            normal: vectors.col(order[0]).normalize(),
            variation: least / (least + middle + most),
        })
    }
}

/// Eigenvalues and eigenvectors, as columns, of a symmetric matrix: Jacobi's rotations (1846).
fn eigen(mut a: DMat3) -> ([f64; 3], DMat3) {
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..SWEEPS {
        if a.col(0)[1] == 0.0 && a.col(0)[2] == 0.0 && a.col(1)[2] == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a.col(q)[p];
            if off == 0.0 {
                continue;
            }
            let theta = (a.col(q)[q] - a.col(p)[p]) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            // An angle so small that its square overflowed turns nothing.
            let t = if t.is_finite() { t } else { 0.0 };
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = c;
            turn.col_mut(q)[q] = c;
            turn.col_mut(q)[p] = s;
            turn.col_mut(p)[q] = -s;
            a = turn.transpose() * a * turn;
            a.col_mut(q)[p] = 0.0;
            a.col_mut(p)[q] = 0.0;
            vectors *= turn;
        }
    }
    ([a.col(0)[0], a.col(1)[1], a.col(2)[2]], vectors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvectors_are_those_of_the_matrix(values in [-5.0..5.0, -5.0..5.0, -5.0..5.0], turn in [-1.0..1.0, -1.0..1.0, -1.0..1.0, 0.1..1.0]) {
            let turn = DMat3::from_quat(DQuat::from_array(turn).normalize());
            let matrix = turn * DMat3::from_diagonal(DVec3::from_array(values)) * turn.transpose();
            let (found, vectors) = eigen(matrix);
            for (i, &value) in found.iter().enumerate() {
                let v = vectors.col(i);
                prop_assert!((matrix * v - value * v).length() < 1e-9 && (v.length() - 1.0).abs() < 1e-9);
            }
        }

        #[test]
        fn planes_are_found_however_they_lie(turn in [-1.0..1.0, -1.0..1.0, -1.0..1.0, 0.1..1.0], at in [-1e5..1e5, -1e5..1e5, -1e5..1e5]) {
            let turn = DQuat::from_array(turn).normalize();
            let on_plane = |i: u32| turn * DVec3::new(f64::from(i % 5), f64::from(i / 5), 0.0) + DVec3::from_array(at);
            let plane = Plane::fit((0..20).map(on_plane)).expect("a plane");
            prop_assert!(plane.normal.dot(turn * DVec3::Z).abs() > 1.0 - 1e-9 && plane.variation < 1e-9);
        }
    }

    #[test]
    fn lines_and_places_have_no_plane() {
        let line = (0..9).map(|i| DVec3::new(1.0, 2.0, 3.0) * f64::from(i));
        assert_eq!(Plane::fit(line), None);
        assert_eq!(Plane::fit([DVec3::ONE; 7]), None);
        assert_eq!(Plane::fit([DVec3::ZERO, DVec3::X]), None);
        assert!(Plane::fit([DVec3::ZERO, DVec3::X, DVec3::Y]).is_some_and(|plane| plane.normal.z.abs() == 1.0));
    }
}
