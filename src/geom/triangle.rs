//! Triangles in floating point.

use glam::DVec3;

/// The point of a triangle that is closest to `p`: its projection if that lies inside, else on one of the sides beyond
/// which `p` is (the way from the closest point of a convex polygon leads away from a side on which that point lies).
pub(crate) fn closest_on(&[a, b, c]: &[DVec3; 3], p: DVec3) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let squared = normal.length_squared();
    // Areas so small that they vanish have no inside.
    let is_flat = squared == 0.0;
    let (mut least, mut closest) = (f64::INFINITY, p);
    for (s, t) in [(a, b), (b, c), (c, a)] {
        let (side, way) = (t - s, p - s);
        if is_flat || side.cross(way).dot(normal) < 0.0 {
            let along = (side.dot(way) / side.length_squared()).clamp(0.0, 1.0);
            let on_side = s + along * side;
            let distance = p.distance_squared(on_side);
            if distance < least {
                (least, closest) = (distance, on_side);
            }
        }
    }
    if least == f64::INFINITY { p - normal * (normal.dot(p - a) / squared) } else { closest }
}
