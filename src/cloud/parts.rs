//! The surface about a place, where it is no single sheet: its parts, told apart by normals and planes, and how they meet.
//!
//! Points of both sides of a wall, of a slot, or of an edge must not be averaged into one plane. So points about a place are put into parts:
//! the heaviest one, with all whose normals are like its own and that lie along it; then the heaviest that is left, and so on. Of each part
//! the blended plane says how far off it is. Two parts each of which lies behind the other bound a body that is sharp or thin there, and the
//! place is in it if it is behind both; if each lies in front of the other they bound a groove or a slot, and it is behind one of them at least.
//! (As Fleishman, Cohen-Or and Silva 2005 put pieces of sharp features together; they find them by fitting.)

use glam::DVec3;

/// Parts that are told apart: three meet in the corner of a box, and three sheets may be about a place between two walls.
const MOST: usize = 3;
/// Normals of a part are this near (cosine) to the first one's: within 37 degrees.
const ALIKE: f64 = 0.8;
/// Points of a part lie no farther from it than so many spacings. Points of an arc, however round, have no distance in this measure.
const ALONG: f64 = 0.35;
/// Parts of which no point lies before or behind the place, but for so many spacings, do not count: what they are there is not known. But the
/// heaviest always does.
const BESIDE: f64 = 1.6;

/// A point about a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weighted {
    pub(super) weight: f64,
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
}

/// What points say of a place: how far it is in front of the surface, and which way that is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Said {
    /// Of all points that were heard.
    pub(super) weight: f64,
    /// In model units; below zero behind the surface.
    pub(super) distance: f64,
    /// The mean normal of the part that decides; shorter than 1 where its normals differ.
    pub(super) normal: DVec3,
}

/// Some points with normals like each other: sums over them, divided by their weight at last.
#[derive(Debug, Clone, Copy)]
struct Part {
    weight: f64,
    distance: f64,
    normal: DVec3,
    centre: DVec3,
    /// The square of the least distance along the plane.
    beside: f64,
}

impl Part {
    const EMPTY: Part =
        Part { weight: 0.0, distance: 0.0, normal: DVec3::ZERO, centre: DVec3::ZERO, beside: f64::INFINITY };

    fn add(&mut self, place: DVec3, &Weighted { weight, point, normal }: &Weighted) {
        let way = place - point;
        let distance = way.dot(normal);
        self.beside = self.beside.min(way.length_squared() - distance * distance);
        self.weight += weight;
        self.distance += weight * distance;
        self.normal += weight * normal;
        self.centre += weight * point;
    }

    fn mean(self) -> Part {
        let by = 1.0 / self.weight;
        Part { distance: by * self.distance, normal: by * self.normal, centre: by * self.centre, ..self }
    }

    /// Whether two parts lie behind each other, as those of a wall or of an edge that is sharp.
    fn is_convex(&self, other: &Part) -> bool {
        let way = other.centre - self.centre;
        way.dot(self.normal) - way.dot(other.normal) < 0.0
    }

    /// What bounds both bodies, or their union.
    fn with(self, other: Part, is_convex: bool) -> Part {
        if (self.distance < other.distance) == is_convex { other } else { self }
    }
}

/// What some points say of a place. Those that were put into a part are taken off the list; `None` if there are none.
pub(super) fn said(place: DVec3, points: &mut Vec<Weighted>, spacing: f64) -> Option<Said> {
    let mut parts = [Part::EMPTY; MOST];
    let (mut count, mut heard) = (0, 0.0);
    while count < MOST {
        let heavier = |a: &Weighted, b: Weighted| if b.weight > a.weight { b } else { *a };
        let Some(first) = points.first().map(|first| points.iter().fold(*first, |a, &b| heavier(&a, b))) else { break };
        let mut part = Part::EMPTY;
        points.retain(|point| {
            let off = (point.point - first.point).dot(point.normal + first.normal);
            let is_of = point.normal.dot(first.normal) >= ALIKE && off.abs() <= 2.0 * ALONG * spacing;
            if is_of {
                part.add(place, point);
            }
            !is_of
        });
        if part.weight <= 0.0 {
            // No normal: nothing is like it.
            return None;
        }
        heard += part.weight;
        if count == 0 || part.beside <= (BESIDE * spacing).powi(2) {
            parts[count] = part.mean();
            count += 1;
        }
    }
    let [a, b, c] = parts;
    let decides = match count {
        0 => return None,
        1 => a,
        2 => a.with(b, a.is_convex(&b)),
        _ => {
            let convex = [a.is_convex(&b), b.is_convex(&c), c.is_convex(&a)];
            // The two that meet unlike the others do first, or any two.
            let is_mostly = convex.iter().filter(|&&is| is).count() >= 2;
            let odd = convex.iter().position(|&is| is != is_mostly);
            let (first, second, third) = match odd {
                Some(1) => (b, c, a),
                Some(2) => (c, a, b),
                _ => (a, b, c),
            };
            first.with(second, is_mostly == odd.is_none()).with(third, is_mostly)
        }
    };
    Some(Said { weight: heard, distance: decides.distance, normal: decides.normal })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a plane through a point, one a unit along two directions across the normal, as seen from a place.
    fn plane(list: &mut Vec<Weighted>, place: DVec3, through: DVec3, normal: DVec3, is_there: impl Fn(DVec3) -> bool) {
        let (u, v) = normal.any_orthonormal_pair();
        for i in -4..=4 {
            for j in -4..=4 {
                let point = through + u * f64::from(i) + v * f64::from(j);
                let weight = (-place.distance_squared(point)).exp();
                if is_there(point) && weight > 0.002 {
                    list.push(Weighted { weight, point, normal });
                }
            }
        }
    }

    fn distance(place: DVec3, planes: &[(DVec3, DVec3)], is_there: impl Fn(DVec3) -> bool) -> f64 {
        let mut list = Vec::new();
        planes.iter().for_each(|&(through, normal)| plane(&mut list, place, through, normal, &is_there));
        said(place, &mut list, 1.0).expect("points").distance
    }

    #[test]
    fn walls_and_slots_thinner_than_points_are_apart_keep_both_sides() {
        for thickness in [0.2, 0.5, 1.0] {
            let wall = [(DVec3::ZERO, DVec3::NEG_Z), (DVec3::new(0.3, 0.4, thickness), DVec3::Z)];
            let slot = [(DVec3::ZERO, DVec3::Z), (DVec3::new(0.3, 0.4, thickness), DVec3::NEG_Z)];
            for z in [-0.6, -0.1, 0.3 * thickness, 0.5 * thickness, 0.9 * thickness, thickness + 0.1] {
                let place = DVec3::new(0.2, 0.1, z);
                let beyond = (z - 0.5 * thickness).abs() - 0.5 * thickness;
                let (of_wall, of_slot) = (distance(place, &wall, |_| true), distance(place, &slot, |_| true));
                assert!((of_wall - beyond).abs() < 1e-9, "wall of {thickness} at {z}: {of_wall}");
                assert!((of_slot + beyond).abs() < 1e-9, "slot of {thickness} at {z}: {of_slot}");
            }
        }
    }

    #[test]
    fn edges_and_corners_are_sharp_both_ways() {
        let faces = DVec3::AXES.map(|axis| (DVec3::splat(-0.25), axis)).map(|(p, n)| (p * (DVec3::ONE - n), n));
        for place in [DVec3::new(-0.3, -0.2, -2.0), DVec3::new(0.2, -0.4, -1.5), DVec3::splat(-0.2), DVec3::splat(0.3)]
        {
            // The corner of a box at the origin, and the notch of its shape.
            let of_box = place.max_element();
            let found = distance(place, &faces, |p| p.max_element() < 1e-9);
            assert!((found - of_box).abs() < 1e-9, "{place}: {found}");
            let inward = faces.map(|(p, n)| (p, -n));
            let found = distance(place, &inward, |p| p.max_element() < 1e-9);
            assert!((found + of_box).abs() < 1e-9, "{place}: {found}");
        }
    }
}
