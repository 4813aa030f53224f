//! The sums behind a report: over faces, and over points with the edges and faces of which they are the lowest.

use super::corners::Corners;
use super::star::{Corner, Star, repeated};
use super::{Bounds, Mesh};
use crate::sets::Sets;
use glam::DVec3;
use rayon::prelude::*;

/// A face is flat to zero area when twice its area is at most this part of its longest edge squared: far above the
/// rounding of doubles near the origin (2e-16), far below the slimmest triangle that single precision can tell (1e-7).
pub(super) const FLAT: f64 = 1e-12;
/// Lengths whose sixth powers are in the range of numbers.
const ORDINARY: std::ops::Range<f64> = 1e-45..1e45;
/// Points or faces handled at a time. Fixed, so that sums do not depend on the number of threads.
pub(super) const CHUNK: usize = 1 << 13;

/// What faces add up to.
#[derive(Default)]
pub(super) struct Faces {
    pub(super) sound: u64,
    pub(super) triangles: u64,
    pub(super) dangling: u64,
    pub(super) degenerate: u64,
    pub(super) zero_area: u64,
    pub(super) volume: f64,
    pub(super) area: f64,
}

/// What points, with the edges and faces of which they are the lowest, add up to.
pub(super) struct Tally {
    pub(super) used: u64,
    pub(super) fans: u64,
    pub(super) edges: u64,
    pub(super) boundary_edges: u64,
    pub(super) non_manifold_edges: u64,
    pub(super) inconsistent_edges: u64,
    pub(super) duplicate_faces: u64,
    /// Unions of two faces by an edge, of two points by an edge of the rim, that joined anything.
    pub(super) surface_unions: u64,
    pub(super) rim_unions: u64,
    pub(super) rim_points: u64,
    pub(super) bounds: Bounds,
    /// Number, sum, least and greatest of the lengths of finite edges.
    pub(super) finite_edges: u64,
    pub(super) total_length: f64,
    pub(super) min_length: f64,
    pub(super) max_length: f64,
}

impl Mesh {
    /// Whether a face has at least three corners and all exist.
    pub(super) fn is_sound(&self, face: &[u32]) -> bool {
        face.len() >= 3 && face.iter().all(|&i| (i as usize) < self.points.len())
    }
}

/// Adds up what faces are. `bounds` are those of the used points. Volumes are taken relative to their middle, so that they do not
/// cancel far from the origin, and sums are made in a unit in which no square or cube leaves the range of numbers.
pub(super) fn sum_faces(mesh: &Mesh, bounds: &Bounds) -> Faces {
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let unit = if bounds.is_empty() || ORDINARY.contains(&largest) { 1.0 } else { largest };
    let scale = |p: DVec3| p / unit;
    let near = Bounds { min: scale(bounds.min), max: scale(bounds.max) }.center();
    let in_chunk = |chunk: usize| {
        let mut sums = Faces::default();
        let faces = chunk * CHUNK..mesh.faces.len().min((chunk + 1) * CHUNK);
        faces.for_each(|i| sums.add_face(mesh, mesh.faces.get(i), near, scale));
        sums
    };
    let chunks: Vec<Faces> = (0..mesh.faces.len().div_ceil(CHUNK)).into_par_iter().map(in_chunk).collect();
    let sum = chunks.into_iter().fold(Faces::default(), |a, b| Faces {
        sound: a.sound + b.sound,
        triangles: a.triangles + b.triangles,
        dangling: a.dangling + b.dangling,
        degenerate: a.degenerate + b.degenerate,
        zero_area: a.zero_area + b.zero_area,
        volume: a.volume + b.volume,
        area: a.area + b.area,
    });
    Faces { volume: sum.volume * unit * unit * unit, area: sum.area * unit * unit, ..sum }
}

/// The length of a vector, also where its square is not in the range of numbers.
fn length(d: DVec3) -> f64 {
    let length = d.length();
    let largest = d.abs().max_element();
    if ORDINARY.contains(&length) || largest == 0.0 { length } else { largest * (d / largest).length() }
}

impl Faces {
    fn add_face(&mut self, mesh: &Mesh, face: &[u32], near: DVec3, scale: impl Fn(DVec3) -> DVec3) {
        if !mesh.is_sound(face) {
            let dangling = face.iter().any(|&i| i as usize >= mesh.points.len());
            self.dangling += u64::from(dangling);
            self.degenerate += u64::from(!dangling);
            return;
        }
        let degenerate = repeated(face).is_some();
        self.sound += 1;
        self.triangles += face.len() as u64 - 2;
        self.degenerate += u64::from(degenerate);
        let corner = |k: usize| scale(mesh.points[face[k] as usize]);
        if !(0..face.len()).all(|k| corner(k).is_finite()) {
            return;
        }
        let origin = corner(0);
        let mut last = corner(face.len() - 1) - origin;
        let (mut sum, mut normal, mut longest) = (DVec3::ZERO, DVec3::ZERO, 0f64);
        for p in (0..face.len()).map(|k| corner(k) - origin) {
            normal += last.cross(p);
            longest = longest.max(last.distance_squared(p));
            sum += p;
            last = p;
        }
        let twice_area = normal.length();
        self.area += 0.5 * twice_area;
        self.zero_area += u64::from(!degenerate && twice_area <= FLAT * longest);
        // The pyramid over the face as a fan around its middle: the same whatever corner comes first.
        let middle = origin + sum / face.len() as f64;
        self.volume += (middle - near).dot(normal) / 6.0;
    }
}

/// Adds up what is seen from all points.
pub(super) fn sum_points(mesh: &Mesh) -> Tally {
    let corners = Corners::new(mesh);
    let (surface, rim) = (Sets::new(mesh.faces.len()), Sets::new(mesh.points.len()));
    let in_chunk = |chunk: usize| {
        let mut sums = Tally::default();
        let mut star = Star::default();
        for v in chunk * CHUNK..corners.points().min((chunk + 1) * CHUNK) {
            star.visit(&corners, v as u32);
            if !star.corners.is_empty() {
                sums.add_star(mesh, &mut star, &surface, &rim);
            }
        }
        sums
    };
    let chunks: Vec<Tally> = (0..corners.points().div_ceil(CHUNK)).into_par_iter().map(in_chunk).collect();
    chunks.into_iter().fold(Tally::default(), |a, b| Tally {
        used: a.used + b.used,
        fans: a.fans + b.fans,
        edges: a.edges + b.edges,
        boundary_edges: a.boundary_edges + b.boundary_edges,
        non_manifold_edges: a.non_manifold_edges + b.non_manifold_edges,
        inconsistent_edges: a.inconsistent_edges + b.inconsistent_edges,
        duplicate_faces: a.duplicate_faces + b.duplicate_faces,
        surface_unions: a.surface_unions + b.surface_unions,
        rim_unions: a.rim_unions + b.rim_unions,
        rim_points: a.rim_points + b.rim_points,
        bounds: Bounds { min: a.bounds.min.min(b.bounds.min), max: a.bounds.max.max(b.bounds.max) },
        finite_edges: a.finite_edges + b.finite_edges,
        total_length: a.total_length + b.total_length,
        min_length: a.min_length.min(b.min_length),
        max_length: a.max_length.max(b.max_length),
    })
}

impl Default for Tally {
    fn default() -> Self {
        Tally {
            used: 0,
            fans: 0,
            edges: 0,
            boundary_edges: 0,
            non_manifold_edges: 0,
            inconsistent_edges: 0,
            duplicate_faces: 0,
            surface_unions: 0,
            rim_unions: 0,
            rim_points: 0,
            bounds: Bounds::EMPTY,
            finite_edges: 0,
            total_length: 0.0,
            min_length: f64::INFINITY,
            max_length: 0.0,
        }
    }
}

impl Tally {
    fn add_star(&mut self, mesh: &Mesh, star: &mut Star, surface: &Sets, rim: &Sets) {
        let v = star.point;
        let at = mesh.points[v as usize];
        self.used += 1;
        self.fans += u64::from(star.fans());
        self.bounds.add(at);
        self.rim_points += u64::from(star.edges().any(|edge| edge.users() == 1));
        for edge in star.edges().filter(|edge| edge.other() > v) {
            self.edges += 1;
            match edge.users() {
                1 => {
                    self.boundary_edges += 1;
                    self.rim_unions += u64::from(rim.union(v, edge.other()));
                }
                2 => self.inconsistent_edges += u64::from(edge.outgoing() != 1),
                _ => self.non_manifold_edges += 1,
            }
            let mut faces = edge.faces();
            let first = faces.next().expect("an edge has a user");
            self.surface_unions += faces.filter(|&face| surface.union(first, face)).count() as u64;
            let length = length(at - mesh.points[edge.other() as usize]);
            if length.is_finite() {
                self.finite_edges += 1;
                self.total_length += length;
                self.min_length = self.min_length.min(length);
                self.max_length = self.max_length.max(length);
            }
        }
        self.duplicate_faces += copies(mesh, star).len() as u64;
    }
}

/// Faces beyond the first over the same cycle, among those whose lowest point is the star's.
pub(super) fn copies(mesh: &Mesh, star: &Star) -> Vec<u32> {
    let v = star.point;
    let ends = |corner: &Corner| [corner.prev.min(corner.next), corner.prev.max(corner.next)];
    let is_lowest = |corner: &&Corner| ends(corner)[0] > v && corner.prev != corner.next;
    let mut lowest: Vec<Corner> = star.corners.iter().filter(is_lowest).copied().collect();
    lowest.sort_unstable_by_key(|corner| (ends(corner), corner.face));
    // The cycle from the star's point on, towards the lower neighbour, and its face.
    let cycle = |corner: &Corner| {
        let face = mesh.faces.get(corner.face as usize);
        if repeated(face).is_some() || face.iter().any(|&i| i < v) {
            return None;
        }
        let at = face.iter().position(|&i| i == v)?;
        let mut cycle = [&face[at..], &face[..at]].concat();
        if corner.prev < corner.next {
            cycle[1..].reverse();
        }
        Some((cycle, corner.face))
    };
    let among = |alike: &[Corner]| {
        let mut cycles: Vec<(Vec<u32>, u32)> = alike.iter().filter_map(cycle).collect();
        cycles.sort_unstable();
        cycles.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1).collect::<Vec<_>>()
    };
    lowest.chunk_by(|a, b| ends(a) == ends(b)).filter(|alike| alike.len() > 1).flat_map(among).collect()
}
