//! Ball pivoting: triangles between the points themselves (Bernardini, Mittleman, Rushmeier, Silva and Taubin 1999).
//!
//! A ball lies on three points and holds no other. Over each side of that triangle it is rolled until it touches another point, which makes
//! the next triangle, and so on, until it has been everywhere it can reach; then it is put down elsewhere. Larger balls go on where smaller
//! ones fell through.
//!
//! The surface interpolates: its corners are points of the cloud. It is manifold and oriented as the normals are, but closed only where
//! points are dense enough for the ball and clean; [`Solid::from_cloud`](crate::Solid::from_cloud) closes everything.
//!
//! # Invariants
//!
//! Each directed edge belongs to one triangle at most. The front are those whose other direction belongs to none. A point that has
//! triangles but no front edge is done with. Where several fans of triangles meet in a point in the end, each gets a copy of it.
//!
//! # Cost
//!
//! One search of the points within two radii for each edge that the ball rolls over: some 10 us. Some 300 bytes a triangle.

use super::{Cloud, Near, Shape};
use crate::error::{Error, Result};
use crate::mesh::Mesh;
use crate::progress::{Progress, Stage, check};
use ahash::RandomState;
use glam::DVec3;
use hashbrown::HashMap;
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Balls that are rolled when no radius is given, in the spacing that 98 of 100 points have: Poisson disks leave no holes for the first
/// one.
const RADII: [f64; 3] = [1.0, 1.6, 2.5];
/// A ball that reaches a point by less than this part of its radius does not hold it.
const TOUCH: f64 = 1e-6;
/// Neighbours that tell spacing and, where there are none, normals.
const NEIGHBOURS: usize = 12;
/// Points, or rolls, between two questions whether to go on.
const PIECE: usize = 1 << 10;

/// A directed edge of a triangle: its third corner and the ball that lies on it.
#[derive(Debug, Clone, Copy)]
struct Side {
    opposite: u32,
    centre: DVec3,
}

/// The work so far.
struct Rolling<'a> {
    near: &'a Near,
    normals: &'a [DVec3],
    radius: f64,
    sides: HashMap<[u32; 2], Side, RandomState>,
    /// How many edges of the front end or begin at each point.
    front: Vec<u32>,
    is_used: Vec<bool>,
    triangles: Vec<[u32; 3]>,
    waiting: VecDeque<[u32; 2]>,
    found: Vec<u32>,
}

/// Triangles between the points of a cloud, made by balls of some radii in model units, in ascending order; of radii found from the spacing
/// if there are none. Points that no triangle has are left out. The result has boundaries where points are too far apart.
///
/// # Errors
/// When a radius is no length above 0, there are fewer than four points, and `Cancelled`.
pub fn pivot(cloud: &Cloud, radii: &[f64], progress: &dyn Progress) -> Result<Mesh> {
    if let Some(radius) = radii.iter().find(|r| !(r.is_finite() && **r > 0.0)) {
        let remedy = "give a length in model units, somewhat above the distance of neighbours";
        return Err(Error::setting("radius", format!("{radius} is no length above 0"), remedy));
    }
    let mut cloud = cloud.clone();
    cloud.clean();
    if cloud.points.len() < 4 {
        let problem = format!("{} points are not enough for a surface", cloud.points.len());
        return Err(Error::setting("input", problem, "give four at least, in different places"));
    }
    progress.hold(cloud.points.len() as u64 * 900)?;
    let (sorted, near) = Near::sorted(&cloud);
    drop(cloud);
    let shape = Shape::of(&sorted, &near, NEIGHBOURS, None, progress)?;
    let mut radii = if radii.is_empty() { RADII.map(|r| r * shape.wide_spacing).to_vec() } else { radii.to_vec() };
    radii.sort_by(f64::total_cmp);
    progress.begin(Stage::Contour, sorted.points.len() as u64);
    let count = sorted.points.len();
    let mut rolling = Rolling {
        near: &near,
        normals: &shape.normals,
        radius: 0.0,
        sides: HashMap::with_hasher(RandomState::with_seeds(3, 1, 4, 1)),
        front: vec![0; count],
        is_used: vec![false; count],
        triangles: Vec::new(),
        waiting: VecDeque::new(),
        found: Vec::new(),
    };
    for radius in radii {
        rolling.roll(radius, progress)?;
    }
    Ok(separated(&sorted.points, &rolling.triangles))
}

impl Rolling<'_> {
    /// Rolls a ball from where the front is, and then from seeds.
    fn roll(&mut self, radius: f64, progress: &dyn Progress) -> Result<()> {
        self.radius = radius;
        // Larger balls on the triangles of the front, in the order of the triangles.
        for i in 0..self.triangles.len() {
            let [a, b, c] = self.triangles[i];
            let Some(centre) = self.ball([a, b, c]) else { continue };
            for [from, to] in [[a, b], [b, c], [c, a]] {
                if !self.sides.contains_key(&[to, from]) {
                    self.sides.get_mut(&[from, to]).expect("a side of its triangle").centre = centre;
                    self.waiting.push_back([from, to]);
                }
            }
        }
        self.spread(progress)?;
        for point in 0..self.front.len() {
            if point.is_multiple_of(PIECE) {
                check(progress)?;
                progress.advance(PIECE as u64);
            }
            if !self.is_used[point]
                && let Some((triangle, centre)) = self.seed(point as u32)
            {
                self.add(triangle, centre);
                self.spread(progress)?;
            }
        }
        Ok(())
    }

    /// Rolls over all edges that wait.
    fn spread(&mut self, progress: &dyn Progress) -> Result<()> {
        let mut rolls = 0usize;
        while let Some([from, to]) = self.waiting.pop_front() {
            rolls += 1;
            if rolls.is_multiple_of(PIECE) {
                check(progress)?;
            }
            if self.sides.contains_key(&[to, from]) {
                continue;
            }
            if let Some((third, centre)) = self.touched([from, to]) {
                self.add([to, from, third], centre);
            }
        }
        Ok(())
    }

    /// The points within two radii of a place, in order.
    fn gather(&mut self, place: DVec3) {
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        self.near.within(place, 2.0 * self.radius * (1.0 + TOUCH), |i, _| found.push(i));
        self.found = found;
    }

    fn point(&self, i: u32) -> DVec3 {
        self.near.points()[i as usize]
    }

    /// The middle of the ball on a triangle, on the side to which it faces; none if the triangle is too large, or faces away from a normal
    /// of its corners.
    fn ball(&self, triangle: [u32; 3]) -> Option<DVec3> {
        let [a, b, c] = triangle.map(|i| self.point(i));
        let (u, v) = (b - a, c - a);
        let normal = u.cross(v);
        let square = normal.length_squared();
        if square == 0.0 || triangle.iter().any(|&i| self.normals[i as usize].dot(normal) <= 0.0) {
            return None;
        }
        let to_middle = (normal.cross(u) * v.length_squared() + v.cross(normal) * u.length_squared()) / (2.0 * square);
        let height = self.radius * self.radius - to_middle.length_squared();
        (height >= 0.0).then(|| a + to_middle + normal * (height / square).sqrt())
    }

    /// Whether a ball on three points holds none of those gathered.
    fn is_empty(&self, centre: DVec3, triangle: [u32; 3]) -> bool {
        let least = (self.radius * (1.0 - TOUCH)).powi(2);
        self.found.iter().all(|&i| self.point(i).distance_squared(centre) >= least || triangle.contains(&i))
    }

    /// Whether a triangle may be added: none of its directed edges is there, and no corner is done with.
    fn fits(&self, [a, b, c]: [u32; 3]) -> bool {
        let is_done = |i: u32| self.is_used[i as usize] && self.front[i as usize] == 0;
        ![[a, b], [b, c], [c, a]].iter().any(|side| self.sides.contains_key(side))
            && ![a, b, c].into_iter().any(is_done)
    }

    /// A first triangle at a point that has none: the nearest two unused ones on which the ball can lie.
    fn seed(&mut self, point: u32) -> Option<([u32; 3], DVec3)> {
        let place = self.point(point);
        self.gather(place);
        let mut free: Vec<(f64, u32)> = self
            .found
            .iter()
            .filter(|&&i| i != point && !self.is_used[i as usize])
            .map(|&i| (self.point(i).distance_squared(place), i))
            .collect();
        free.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        free.truncate(NEIGHBOURS);
        for (n, &(_, second)) in free.iter().enumerate() {
            for &(_, third) in &free[n + 1..] {
                for triangle in [[point, second, third], [point, third, second]] {
                    let ball = self.ball(triangle).filter(|&centre| self.is_empty(centre, triangle));
                    if let Some(centre) = ball {
                        return Some((triangle, centre));
                    }
                }
            }
        }
        None
    }

    /// The point that the ball touches first when it is rolled over an edge of the front, and where the ball is then.
    fn touched(&mut self, [from, to]: [u32; 2]) -> Option<(u32, DVec3)> {
        let Side { opposite, centre } = self.sides[&[from, to]];
        let (a, b) = (self.point(from), self.point(to));
        let middle = 0.5 * (a + b);
        self.gather(middle);
        // The ball starts over its triangle and turns about the edge, away from it.
        let axis = (b - a).normalize_or_zero();
        let start = (centre - middle).normalize_or_zero();
        let across = axis.cross(start);
        let mut first: Option<(f64, u32, DVec3)> = None;
        for &third in &self.found {
            let triangle = [to, from, third];
            if third == from || third == to || third == opposite || !self.fits(triangle) {
                continue;
            }
            let Some(next) = self.ball(triangle) else { continue };
            let way = next - middle;
            let angle = way.dot(across).atan2(way.dot(start)).rem_euclid(TAU);
            if first.is_none_or(|(least, ..)| angle < least) && self.is_empty(next, triangle) {
                first = Some((angle, third, next));
            }
        }
        first.map(|(_, third, centre)| (third, centre))
    }

    fn add(&mut self, triangle: [u32; 3], centre: DVec3) {
        let [a, b, c] = triangle;
        self.triangles.push(triangle);
        triangle.iter().for_each(|&i| self.is_used[i as usize] = true);
        for ([from, to], opposite) in [([a, b], c), ([b, c], a), ([c, a], b)] {
            self.sides.insert([from, to], Side { opposite, centre });
            let is_glued = self.sides.contains_key(&[to, from]);
            for end in [from, to] {
                let front = &mut self.front[end as usize];
                *front = if is_glued { *front - 1 } else { *front + 1 };
            }
            if !is_glued {
                self.waiting.push_back([from, to]);
            }
        }
    }
}

/// The mesh of some triangles: without points that none uses, and with a copy of a point for each fan of triangles that meets others only
/// there.
fn separated(points: &[DVec3], triangles: &[[u32; 3]]) -> Mesh {
    // The corner of another triangle at the same point, across the edge that ends there, seen from each corner (three a triangle).
    let seeds = RandomState::with_seeds(1, 6, 1, 8);
    let mut starts: HashMap<[u32; 2], u32, _> = HashMap::with_capacity_and_hasher(3 * triangles.len(), seeds);
    for (t, triangle) in (0u32..).zip(triangles) {
        for k in 0..3 {
            starts.insert([triangle[k], triangle[(k + 1) % 3]], 3 * t + k as u32);
        }
    }
    let sets = crate::sets::Sets::new(3 * triangles.len());
    for (t, triangle) in (0u32..).zip(triangles) {
        for k in 0..3usize {
            let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
            if let Some(&other) = starts.get(&[to, from]) {
                // The other triangle's edge runs from `to` to `from`.
                let next = other / 3 * 3 + (other % 3 + 1) % 3;
                sets.union(3 * t + k as u32, next);
                sets.union(3 * t + (k as u32 + 1) % 3, other);
            }
        }
    }
    let mut mesh = Mesh::default();
    let mut numbers = vec![u32::MAX; 3 * triangles.len()];
    for (t, triangle) in (0u32..).zip(triangles) {
        let corners = [0, 1, 2].map(|k| {
            let root = sets.root(3 * t + k as u32) as usize;
            if numbers[root] == u32::MAX {
                numbers[root] = mesh.points.len() as u32;
                mesh.points.push(points[triangle[k] as usize]);
            }
            numbers[root]
        });
        mesh.faces.push(&corners);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{ScatterOptions, scatter};
    use crate::mesh::chance::Chance;
    use crate::mesh::sample;
    use crate::progress::Silent;

    fn cloud(name: &str, percent: f64) -> Cloud {
        let mesh = sample::build(name, 2).expect("a sample");
        let spacing = Some(percent / 100.0 * mesh.report().bounds.extent().length());
        scatter(&mesh, &ScatterOptions { spacing, ..ScatterOptions::default() }, &Silent).expect("points")
    }

    #[test]
    fn balls_roll_round_solids() {
        for name in ["sphere", "torus"] {
            let cloud = cloud(name, 2.0);
            let mesh = pivot(&cloud, &[], &Silent).expect("a surface");
            let report = mesh.report();
            assert_eq!((report.non_manifold_edges, report.inconsistent_edges), (0, 0), "{name}");
            assert!(mesh.points.len() as f64 > 0.99 * cloud.points.len() as f64, "{name}");
            assert!(report.boundary_edges * 100 < mesh.faces.len() as u64, "{name}: {}", report.boundary_edges);
            assert!(report.volume > 0.0);
            // Corners are points of the cloud.
            let places: std::collections::HashSet<[u64; 3]> =
                cloud.points.iter().map(|p| p.to_array().map(f64::to_bits)).collect();
            assert!(mesh.points.iter().all(|p| places.contains(&p.to_array().map(f64::to_bits))));
        }
    }

    #[test]
    fn sheets_stay_open_and_small_balls_fall_through() {
        let points: Vec<DVec3> = (0..100).map(|i| DVec3::new(f64::from(i % 10), f64::from(i / 10), 0.0)).collect();
        let cloud = Cloud { normals: vec![DVec3::Z; points.len()], points };
        let mesh = pivot(&cloud, &[1.0], &Silent).expect("a surface");
        let report = mesh.report();
        assert_eq!((mesh.faces.len(), mesh.points.len(), report.boundary_edges), (2 * 81, 100, 36));
        assert_eq!((report.non_manifold_edges, report.non_manifold_vertices), (0, 0));
        assert!(pivot(&cloud, &[0.5], &Silent).expect("nothing").faces.is_empty());
        for radius in [0.0, -1.0, f64::NAN] {
            assert!(pivot(&cloud, &[radius], &Silent).expect_err("no length").to_string().starts_with("radius: "));
        }
    }

    #[test]
    fn chaos_gives_a_manifold_too() {
        let mut chance = Chance(5);
        let points: Vec<DVec3> = (0..400).map(|_| DVec3::new(chance.unit(), chance.unit(), chance.unit())).collect();
        let mesh = pivot(&Cloud { points, normals: Vec::new() }, &[0.05, 0.08, 0.12], &Silent).expect("something");
        let report = mesh.report();
        assert!(!mesh.faces.is_empty());
        assert_eq!((report.non_manifold_edges, report.non_manifold_vertices, report.inconsistent_edges), (0, 0, 0));
    }
}
