//! The spanning surface as seen from within a cell: what is far is a [`Polynomial`], what is near a list.
//!
//! From the root down, what is far enough of a cell goes from the list into the polynomial; the rest is left to the cells below it. A
//! chain that is larger than the cell is opened: its triangle and its halves go separate ways. So a cell looks at what is about as
//! far from it as it is large, and a few things more, however long the boundary is elsewhere (the fast multipole method of Greengard and
//! Rokhlin 1987).
//!
//! Large loose triangles are no dipoles for a cell unless they are many times their size away. Where there are many, those that do not come near
//! it are looked at from 64 points, and go into the polynomial, too.
//!
//! Cost: 0.2 us for each thing that becomes far, 0.3 us for one that is smoothed. A point looks at all things near, some 20 ns each.

use super::boundary::Corner;
use super::polynomial::{Batch, Polynomial, Source};
use super::span::{NONE, Node, Span, position, slope_of_edge, solid_angle};
use super::view::angles_about;
use crate::geom::raster::FineTriangle;
use crate::geom::triangle::closest_on;
use glam::DVec3;
use std::f64::consts::PI;

/// A chain is a dipole and a quadrupole for points beyond so many times its radius.
const FAR: f64 = 4.0;
/// What is beyond so many radii of a cell, and beyond [`FAR`], becomes part of its polynomial.
const BEYOND: f64 = 3.0;
/// Triangles that leave so many radii round a cell free can be smoothed, and are if there are so many.
const FREE: f64 = 1.5;
const MANY: usize = 100;
/// So far may [`Field::angle`] be off, as a part of the whole sphere.
pub(super) const ERROR: f64 = 5e-4;

/// The list of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Near {
    /// A node and all below it.
    All(u32),
    /// The triangle of a node, of which what is below is listed by itself or far.
    Triangle(u32),
}

/// The spanning surface as seen from within a ball.
#[derive(Debug, Clone)]
pub(super) struct Field {
    middle: DVec3,
    /// Solid angle of what is far.
    far: Polynomial,
    /// Bound of the amount of that as a part of the whole sphere, in all of the ball.
    share: f64,
    /// Bounds of its first and second derivatives.
    steepness: [f64; 2],
    near: Vec<Near>,
}

impl Field {
    /// All is near.
    pub(super) fn whole(span: &Span) -> Field {
        let near = if span.nodes.is_empty() { Vec::new() } else { vec![Near::All(0)] };
        Field { middle: DVec3::ZERO, far: Polynomial::default(), share: 0.0, steepness: [0.0; 2], near }
    }

    /// As seen from a ball, which must lie within this one's.
    pub(super) fn within(&self, span: &Span, middle: DVec3, radius: f64) -> Field {
        self.sorted(span, middle, radius).smoothed(span, radius)
    }

    /// The same with chains alone in the polynomial.
    fn sorted(&self, span: &Span, middle: DVec3, radius: f64) -> Field {
        let far = self.far.moved(middle - self.middle);
        let mut field = Field {
            middle,
            far,
            share: self.share,
            steepness: self.steepness,
            near: Vec::with_capacity(self.near.len()),
        };
        let mut batch = Batch::new(radius);
        let is_far = |distance: f64, own: f64| distance > FAR * own + BEYOND * radius;
        for &near in &self.near {
            let (first, end) = match near {
                Near::Triangle(i) => {
                    field.sort_triangle(span, i, radius, is_far, &mut batch);
                    continue;
                }
                Near::All(i) => (i as usize, span.nodes[i as usize].skip as usize),
            };
            let mut i = first;
            while i < end {
                let node = &span.nodes[i];
                let (r, own) = (node.centre() - middle, f64::from(node.radius));
                let skip = node.skip as usize;
                if is_far(r.length(), own) {
                    batch.push(&node.source(), r);
                    field.bound(f64::from(node.extent), f64::from(node.length), r.length() - own - radius);
                    i = skip;
                } else if own <= radius {
                    field.near.push(Near::All(i as u32));
                    i = skip;
                } else {
                    if node.triangle != NONE {
                        field.sort_triangle(span, i as u32, radius, is_far, &mut batch);
                    }
                    i += 1;
                }
            }
        }
        field.far.add(batch);
        field
    }

    /// With triangles of the list in the polynomial that are not next to the ball, if there are many.
    fn smoothed(mut self, span: &Span, radius: f64) -> Field {
        if self.near.len() < MANY {
            return self;
        }
        let free = (1.0 + FREE) * radius;
        let is_free = |near: &Near| {
            let (node, is_single) = match *near {
                Near::Triangle(i) => (&span.nodes[i as usize], true),
                Near::All(i) => (&span.nodes[i as usize], span.nodes[i as usize].skip == i + 1),
            };
            let (distance, own) = (node.centre().distance(self.middle), f64::from(node.radius));
            if !is_single || node.triangle == NONE || distance - own > free {
                return distance - own > free;
            }
            let corners = span.triangles[node.triangle as usize].map(position);
            closest_on(&corners, self.middle).distance(self.middle) > free
        };
        let (smooth, near): (Vec<Near>, Vec<Near>) = self.near.iter().copied().partition(is_free);
        if smooth.len() < MANY {
            return self;
        }
        self.near = smooth;
        let mut triangles = Vec::with_capacity(self.near.len());
        let (mut share, [mut first, mut second]) = (self.share, self.steepness);
        for seen in self.near(span, |_| false) {
            if let Seen::Triangle { node, corners, .. } = seen {
                triangles.push(node.triangle);
                share += share_of_triangle(corners, self.middle, radius);
                let [a, b] = steepness_of_sides(corners, node.sides, self.middle, radius);
                first += a;
                second += b;
            }
        }
        // The points lie well spread in the cube of the ball.
        let unit = 0.55 * radius / 3f64.sqrt();
        let far = self.far.plus(&Polynomial::through(&angles_about(span, &triangles, self.middle, unit), unit));
        Field { far, share, steepness: [first, second], near, ..self }
    }

    /// Lists the triangle of a node as near or adds it to what is far.
    fn sort_triangle(
        &mut self,
        span: &Span,
        i: u32,
        radius: f64,
        is_far: impl Fn(f64, f64) -> bool,
        batch: &mut Batch,
    ) {
        let node = &span.nodes[i as usize];
        let triangle = Triangle::new(&span.triangles[node.triangle as usize]);
        let r = triangle.centre - self.middle;
        if !is_far(r.length(), triangle.radius) {
            self.near.push(Near::Triangle(i));
            return;
        }
        batch.push(&triangle.source(), r);
        let [a, b, c] = triangle.corners;
        let lengths = [a.distance(b), b.distance(c), c.distance(a)];
        let length = lengths.into_iter().zip(node.sides).filter(|side| side.1).map(|side| side.0).sum();
        self.bound(triangle.area().length(), length, r.length() - triangle.radius - radius);
    }

    /// Takes something into account that is so far from all of the ball: its area and the length of its part of the boundary.
    fn bound(&mut self, area: f64, length: f64, distance: f64) {
        self.share += share(area, distance);
        let [first, second] = steepness_of_length(length, distance);
        self.steepness[0] += first;
        self.steepness[1] += second;
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Field>() + self.near.capacity() * size_of::<Near>()
    }

    /// The polynomial of what is far, moved to a middle.
    pub(super) fn far_from(&self, middle: DVec3) -> Polynomial {
        self.far.moved(middle - self.middle)
    }

    /// All that is near: nodes for which `is_far` says that they are looked at as a whole, and triangles.
    pub(super) fn near<'a, F: FnMut(&Node) -> bool>(&'a self, span: &'a Span, is_far: F) -> Walk<'a, F> {
        Walk { span, list: self.near.iter(), first: 0, next: 0, end: 0, is_far }
    }

    /// The winding number of the surface at a point: its solid angle over that of the sphere.
    pub(super) fn angle(&self, span: &Span, at: Corner) -> f64 {
        self.sum::<false>(span, at).0
    }

    /// The winding number, and how it changes for each fixed-point unit.
    pub(super) fn angle_and_slope(&self, span: &Span, at: Corner) -> (f64, DVec3) {
        self.sum::<true>(span, at)
    }

    fn sum<const SLOPE: bool>(&self, span: &Span, at: Corner) -> (f64, DVec3) {
        let p = position(at);
        let way = p - self.middle;
        let (mut angle, mut slope) = (self.far.at(way), DVec3::ZERO);
        if SLOPE {
            slope = self.far.slope_at(way);
        }
        let is_far = |node: &Node| {
            let near = FAR * f64::from(node.radius);
            (node.centre() - p).length_squared() > near * near
        };
        for near in self.near(span, is_far) {
            match near {
                Seen::Far { node, has_chord } => {
                    let r = node.centre() - p;
                    let (a, s) = node.expansion::<SLOPE>(r, r.length_squared());
                    angle += a;
                    slope += s;
                    if SLOPE && has_chord {
                        let [from, _, to] = span.triangles[node.triangle as usize].map(|corner| position(corner) - p);
                        slope += slope_of_edge(from, to);
                    }
                }
                Seen::Triangle { corners, bounded, .. } => {
                    angle += solid_angle(corners, at);
                    if SLOPE {
                        let [a, b, c] = corners.map(|corner| position(corner) - p);
                        let sides = [[a, b], [b, c], [c, a]].into_iter().zip(bounded).filter(|side| side.1);
                        slope += sides.map(|([from, to], _)| slope_of_edge(from, to)).sum::<DVec3>();
                    }
                }
            }
        }
        let whole = 4.0 * PI;
        (angle / whole, slope / whole)
    }

    /// Whether the amount of the winding number is below one half in all of a ball: how large the surface is, and how far, may tell so.
    pub(super) fn is_minor(&self, span: &Span, centre: DVec3, radius: f64) -> bool {
        let distance = |node: &Node| node.centre().distance(centre) - f64::from(node.radius) - radius;
        let mut sum = ERROR + self.share;
        for near in self.near(span, |node| distance(node) > 2.0 * f64::from(node.radius)) {
            sum += match near {
                Seen::Far { node, .. } => share(f64::from(node.extent), distance(node)),
                Seen::Triangle { corners, .. } => share_of_triangle(corners, centre, radius),
            };
            if sum >= 0.5 {
                return false;
            }
        }
        sum < 0.5
    }

    /// Bounds of the first and of the second derivatives of the winding number in a ball, in any direction, for each fixed-point unit.
    /// Infinite where the boundary comes into the ball, and where the second is above `most`.
    pub(super) fn steepness(&self, span: &Span, centre: DVec3, radius: f64, most: f64) -> [f64; 2] {
        let distance = |node: &Node| node.centre().distance(centre) - f64::from(node.radius) - radius;
        let [mut first, mut second] = self.steepness;
        for near in self.near(span, |node| distance(node) > 2.0 * f64::from(node.radius)) {
            match near {
                Seen::Far { node, .. } => {
                    let [a, b] = steepness_of_length(f64::from(node.length), distance(node));
                    first += a;
                    second += b;
                }
                Seen::Triangle { node, corners, .. } => {
                    let [a, b] = steepness_of_sides(corners, node.sides, centre, radius);
                    first += a;
                    second += b;
                }
            }
            if second > most || second.is_infinite() {
                return [f64::INFINITY; 2];
            }
        }
        [first, second]
    }
}

/// A triangle of the surface, and a ball round it.
pub(super) struct Triangle {
    corners: [DVec3; 3],
    pub(super) centre: DVec3,
    pub(super) radius: f64,
}

impl Triangle {
    pub(super) fn new(fine: &FineTriangle) -> Self {
        let corners = fine.map(position);
        let centre = corners.iter().sum::<DVec3>() / 3.0;
        let radius = corners.iter().map(|p| p.distance_squared(centre)).fold(0.0, f64::max).sqrt();
        Triangle { corners, centre, radius }
    }

    fn area(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a)
    }

    /// What it is from afar: about its centre it has no quadrupole.
    pub(super) fn source(&self) -> Source {
        Source { area: self.area(), moment: [0.0; 6] }
    }
}

/// Something near.
pub(super) enum Seen<'a> {
    /// A node that is looked at as a whole.
    Far {
        node: &'a Node,
        /// Whether the chord of the chain, as a side of the triangle above, has a slope that nobody else tells.
        has_chord: bool,
    },
    /// The triangle of a node.
    Triangle {
        node: &'a Node,
        corners: &'a FineTriangle,
        /// Which of its sides have a slope that nobody else tells: of others the triangles below have the reverse, and the one above.
        bounded: [bool; 3],
    },
}

/// Walks over all that is near.
pub(super) struct Walk<'a, F> {
    span: &'a Span,
    list: std::slice::Iter<'a, Near>,
    /// The listed node at work, the next one below it, and the first that is not below it.
    first: usize,
    next: usize,
    end: usize,
    is_far: F,
}

impl<'a, F: FnMut(&Node) -> bool> Iterator for Walk<'a, F> {
    type Item = Seen<'a>;

    fn next(&mut self) -> Option<Seen<'a>> {
        loop {
            while self.next < self.end {
                let node = &self.span.nodes[self.next];
                let is_first = self.next == self.first;
                if (self.is_far)(node) {
                    self.next = node.skip as usize;
                    let has_chord = !is_first && node.triangle != NONE && !node.sides[2];
                    return Some(Seen::Far { node, has_chord });
                }
                self.next += 1;
                if node.triangle != NONE {
                    let [a, b, c] = node.sides;
                    let corners = &self.span.triangles[node.triangle as usize];
                    return Some(Seen::Triangle { node, corners, bounded: [a, b, c || is_first] });
                }
            }
            match *self.list.next()? {
                Near::All(i) => {
                    self.first = i as usize;
                    self.next = self.first;
                    self.end = self.span.nodes[self.first].skip as usize;
                }
                Near::Triangle(i) => {
                    let node = &self.span.nodes[i as usize];
                    let corners = &self.span.triangles[node.triangle as usize];
                    return Some(Seen::Triangle { node, corners, bounded: [true; 3] });
                }
            }
        }
    }
}

/// Of all round a point, an area takes up at most its share of the sphere on which it lies.
fn share(area: f64, distance: f64) -> f64 {
    area / (4.0 * PI * distance * distance)
}

/// The same of a triangle for all points of a ball: not more than half, as a plane.
fn share_of_triangle(triangle: &FineTriangle, centre: DVec3, radius: f64) -> f64 {
    let triangle = Triangle::new(triangle);
    let distance = closest_on(&triangle.corners, centre).distance(centre) - radius;
    if distance > 0.0 { share(triangle.area().length(), distance).min(0.5) } else { 0.5 }
}

/// Bounds of the derivatives of what a length of the boundary does at a distance. Chains may be folded: then their length is more than
/// that of a line.
fn steepness_of_length(length: f64, distance: f64) -> [f64; 2] {
    let first = length / (4.0 * PI * distance * distance);
    [first, 2.0 * first / distance]
}

/// The same of some sides of a triangle in a ball: infinite if one comes into it.
fn steepness_of_sides(corners: &FineTriangle, sides: [bool; 3], centre: DVec3, radius: f64) -> [f64; 2] {
    let [a, b, c] = corners.map(position);
    let (mut first, mut second) = (0.0, 0.0);
    for (side, _) in [[a, b], [b, c], [c, a]].into_iter().zip(sides).filter(|side| side.1) {
        let distance = distance_to(side, centre) - radius;
        if distance <= 0.0 {
            return [f64::INFINITY; 2];
        }
        // By the law of Biot and Savart, of a length at this distance, or of a straight line that passes there.
        let share = (side[0].distance(side[1]) / (2.0 * distance)).min(1.0) / (PI * distance);
        first += 0.5 * share;
        second += share / distance;
    }
    [first, second]
}

/// Distance from a segment to a point.
pub(super) fn distance_to([a, b]: [DVec3; 2], p: DVec3) -> f64 {
    let along = (p - a).dot(b - a) / (b - a).length_squared();
    // Of a point, if it has no length.
    if along.is_nan() { p.distance(a) } else { p.distance(a.lerp(b, along.clamp(0.0, 1.0))) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::chance::Chance;

    /// A closed walk round a point, with corners up to `jag` off.
    fn ring(corners: usize, jag: f64, middle: DVec3, radius: f64, mut chance: impl FnMut() -> f64) -> Vec<Corner> {
        let corner = |i: usize| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / corners as f64).sin_cos();
            let mut off = || 1.0 + jag * (chance() - 0.5);
            let p = [cos * off(), 0.6 * sin + 0.5 * cos * off(), 0.7 * sin * off()];
            (middle + radius * DVec3::from(p)).to_array().map(|c| c as i32)
        };
        (0..corners).map(corner).collect()
    }

    fn plain(span: &Span, at: Corner) -> f64 {
        span.triangles.iter().map(|t| solid_angle(t, at)).sum::<f64>() / (4.0 * PI)
    }

    /// What a point's cell of so many levels below the root sees, and the cell's middle and radius.
    fn at_level(
        span: &Span,
        at: Corner,
        level: u32,
        within: impl Fn(&Field, &Span, DVec3, f64) -> Field,
    ) -> (Field, DVec3, f64) {
        let mut field = Field::whole(span);
        let (mut middle, mut radius) = (DVec3::splat(f64::from(1 << 25)), 0.0);
        for level in 0..=level {
            let side = 1 << (26 - level);
            middle = DVec3::from(at.map(|c| f64::from(c / side * side + side / 2)));
            radius = 0.5 * 3f64.sqrt() * f64::from(side);
            field = within(&field, span, middle, radius);
        }
        (field, middle, radius)
    }

    #[test]
    fn large_loose_triangles_are_smoothed() {
        let mut random = Chance(2);
        let mut chance = || random.unit();
        let mut corner = |from: DVec3, size: f64| {
            let mut off = || size * (chance() - 0.5);
            from + DVec3::new(off(), off(), off())
        };
        let root = f64::from(1 << 26);
        let rings = (0..3000).map(|_| {
            let from = corner(DVec3::splat(0.5 * root), 0.9 * root);
            (0..3).map(|_| corner(from, 0.08 * root).to_array().map(|c| c as i32)).collect()
        });
        let span = Span::new(rings.collect());
        let (mut worst, mut listed, mut left) = (0f64, 0, 0);
        for _ in 0..300 {
            let at: Corner = corner(DVec3::splat(0.5 * root), 0.9 * root).to_array().map(|c| c as i32);
            let (field, middle, radius) = at_level(&span, at, 4, Field::sorted);
            let (smooth, ..) = at_level(&span, at, 4, Field::within);
            (listed, left) = (listed + field.near.len(), left + smooth.near.len());
            let (angle, slope) = smooth.angle_and_slope(&span, at);
            let (same, same_slope) = field.angle_and_slope(&span, at);
            worst = worst.max((angle - plain(&span, at)).abs());
            assert!((angle - same).abs() < 2.0 * ERROR, "{angle} {same}");
            assert!(slope.distance(same_slope) * root / 128.0 < 10.0 * ERROR, "{slope} {same_slope}");
            // The bounds hold of the smoothed field, too: they are not less.
            let [bounds, exact] =
                [&smooth, &field].map(|field| field.steepness(&span, position(at), 1000.0, f64::INFINITY));
            assert!(bounds[0] >= exact[0] && bounds[1] >= exact[1], "{bounds:?} {exact:?}");
            assert!(!smooth.is_minor(&span, middle, radius) || field.is_minor(&span, middle, radius));
        }
        println!("worst {worst:.2e}, {left} of {listed} left");
        assert!(worst < ERROR, "{worst}");
        assert!(4 * left < listed, "{left} of {listed}");
    }

    #[test]
    fn cells_see_what_the_triangles_are() {
        let mut random = Chance(1);
        let mut chance = || random.unit();
        let middle = DVec3::splat(f64::from(1 << 25));
        let large = f64::from(1 << 23);
        let mut spans: Vec<(String, Span)> = Vec::new();
        for (corners, jag) in
            [(3, 0.0), (4, 0.0), (7, 0.4), (100, 0.0), (100, 0.1), (1000, 0.0), (1000, 0.02), (1001, 0.3)]
        {
            let span = Span::new(vec![ring(corners, jag, middle, large, &mut chance)]);
            assert_eq!(span.triangles.len(), corners - 2);
            spans.push((format!("{corners} corners, jag {jag}"), span));
        }
        // Many holes in a ball.
        let holes = (0..300).map(|i| {
            let way = DVec3::new(chance() - 0.5, chance() - 0.5, chance() - 0.5).normalize_or(DVec3::X);
            ring(3 + i % 40, 0.1, middle + 2.0 * large * way, 0.03 * large, &mut chance)
        });
        spans.push(("300 holes".to_owned(), Span::new(holes.collect())));
        for (name, span) in &spans {
            let (mut worst, mut steep, mut minor, mut near) = (0f64, 0f64, 0, 0);
            for i in 0..2000 {
                let at: Corner = std::array::from_fn(|_| (1 << 24) + (chance() * f64::from(1 << 25)) as i32);
                let (field, middle, radius) = at_level(span, at, i % 9, Field::within);
                near += field.near.len();
                let (angle, slope) = field.angle_and_slope(span, at);
                assert_eq!(angle, field.angle(span, at));
                if field.is_minor(span, position(at), 1000.0) {
                    assert!(angle.abs() < 0.5);
                    minor += 1;
                }
                if field.is_minor(span, middle, radius) {
                    assert!(angle.abs() < 0.5);
                }
                worst = worst.max((angle - plain(span, at)).abs());
                // Over a step that is short, but much longer than roundings.
                let step = 1 << 12;
                for axis in 0..3 {
                    let mut beyond = at;
                    beyond[axis] += step;
                    let rise = plain(span, beyond) - plain(span, at);
                    let [first, second] = field.steepness(span, position(at), f64::from(step), f64::INFINITY);
                    if first.is_finite() && rise.abs() < 0.5 {
                        let slack = 1e-9 + 0.5 * second * f64::from(step).powi(2);
                        assert!(rise.abs() <= first * f64::from(step) + 1e-9, "{rise} {first}");
                        steep = steep.max((rise - slope[axis] * f64::from(step)).abs() - slack);
                    }
                }
            }
            println!("{name}: worst {worst:.2e}, slope off by {steep:.2e}, {near} near, {minor} minor");
            assert!(minor > 500, "{name}: {minor}");
            assert!(worst < ERROR, "{name}: {worst}");
            assert!(steep < 0.1 * ERROR, "{name}: {steep}");
        }
    }
}
