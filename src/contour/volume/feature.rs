//! Whether there is a feature in a polygon, and where.

use super::tangents::{Planes, within_cell, within_reach};
use crate::geom::qef::Qef;
use glam::{DMat2, DMat3, DVec2, DVec3, Vec3A};

/// From which angle between normals on there is a feature.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sharpness {
    cos: f32,
    sin: f32,
}

impl Sharpness {
    /// From an angle in degrees on.
    pub(super) fn new(angle: f64) -> Self {
        let (sin, cos) = angle.to_radians().sin_cos();
        Sharpness { cos: cos as f32, sin: sin as f32 }
    }
}

/// The place of the feature in a polygon, in coordinates of its cell, if there is one (Kobbelt et al. 2001, section 3): where two normals
/// differ by more than the angle. The two that differ most span a plane; if another one leaves that by more than the angle, there is a
/// corner, where all planes meet, or else an edge, which runs across it. On an edge, the place is solved for in the plane across it, so that
/// planes that are nearly one do not move it along the edge.
///
/// It is in the cell, or where planes meet just beyond. In a cell that has other polygons, it is drawn to the polygon a little.
pub(super) fn feature(planes: &Planes, sharpness: Sharpness, is_alone: bool) -> Option<Vec3A> {
    let n = planes.units.len();
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    let cos = |&(i, j): &(usize, usize)| planes.units[i].dot(planes.units[j]);
    let (i, j) = pairs.min_by(|a, b| cos(a).total_cmp(&cos(b)))?;
    if cos(&(i, j)) >= sharpness.cos {
        return None;
    }
    let axis = planes.units[i].cross(planes.units[j]).normalize_or_zero();
    let is_corner = planes.units.iter().any(|unit| unit.dot(axis).abs() > sharpness.sin);
    let middle = planes.middle();
    let along = planes.list[i].1.cross(planes.list[j].1);
    let free = if is_corner { meet(planes, middle) } else { meet_across(planes, middle, along) }?;
    let mut sum = Qef::EMPTY;
    planes.list.iter().for_each(|&(point, normal)| sum += &Qef::of_plane(point, normal));
    let place = within_reach(&sum, free, true);
    let place = if planes.has_fan(place) { place } else { within_cell(&sum) };
    Some(if is_alone { place } else { planes.apart(place) })
}

/// The place nearest to all planes. None if there is no single one.
fn meet(planes: &Planes, middle: Vec3A) -> Option<Vec3A> {
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for (point, normal) in &planes.list {
        let normal = normal.as_dvec3();
        matrix += DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        right += normal * normal.dot((*point - middle).as_dvec3());
    }
    let place = middle + (matrix.inverse() * right).as_vec3a();
    (matrix.determinant() > SINGULAR && place.is_finite()).then_some(place)
}

/// The place nearest to all planes among those that are across a direction from the middle.
fn meet_across(planes: &Planes, middle: Vec3A, along: Vec3A) -> Option<Vec3A> {
    let (u, v) = along.try_normalize()?.any_orthonormal_pair();
    let (mut matrix, mut right) = (DMat2::ZERO, DVec2::ZERO);
    for (point, normal) in &planes.list {
        let across = DVec2::new(f64::from(normal.dot(u)), f64::from(normal.dot(v)));
        matrix += DMat2::from_cols(across * across.x, across * across.y);
        right += across * f64::from(normal.dot(*point - middle));
    }
    let d = (matrix.inverse() * right).as_vec2();
    let place = middle + u * d.x + v * d.y;
    (matrix.determinant() > SINGULAR && place.is_finite()).then_some(place)
}

/// Below this determinant planes have no single place where they meet. Two unit normals at an angle make its square of the sine: a thousandth is
/// two degrees.
const SINGULAR: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;

    fn planes(list: &[([f32; 3], [f32; 3])]) -> Planes {
        let list: Vec<_> = list.iter().map(|(p, n)| (Vec3A::from(*p), Vec3A::from(*n).normalize())).collect();
        let units = list.iter().map(|(_, n)| *n).collect();
        Planes { list, units }
    }

    #[test]
    fn flat_pieces_have_no_feature() {
        let bent = planes(&[
            ([0.5, 0.0, 0.5], [0., 0.2, 1.]),
            ([0.0, 0.5, 0.5], [0.2, 0., 1.]),
            ([1.0, 0.5, 0.5], [0., 0., 1.]),
        ]);
        assert_eq!(feature(&bent, Sharpness::new(30.0), true), None);
        assert!(feature(&bent, Sharpness::new(10.0), true).is_some());
    }

    /// Noise in one of the normals does not move the vertex along the edge.
    #[test]
    fn edges_are_solved_for_across() {
        let edge = planes(&[
            ([0.3, 0.2, 0.0], [1., 0., 0.001]),
            ([0.3, 0.4, 1.0], [1., 0., -0.001]),
            ([0.7, 0.6, 0.0], [0., 1., 0.]),
            ([0.9, 0.6, 1.0], [0., 1., 0.]),
        ]);
        let place = feature(&edge, Sharpness::new(30.0), true).unwrap();
        assert!(place.distance(Vec3A::new(0.3, 0.6, 0.5)) < 2e-3, "{place}");
    }

    #[test]
    fn corners_are_where_all_planes_meet() {
        let corner =
            [([0.2, 0.9, 0.1], [1., 0., 0.]), ([0.9, 0.3, 0.1], [0., 1., 0.]), ([0.9, 0.1, 0.6], [0., 0., 1.])];
        let place = feature(&planes(&corner), Sharpness::new(30.0), true).unwrap();
        assert!(place.distance(Vec3A::new(0.2, 0.3, 0.6)) < 1e-5, "{place}");
    }
}
