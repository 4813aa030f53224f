//! Points on the surface of a mesh.
//!
//! *Poisson disk:* points by chance, none nearer to another than the spacing, and no place on the surface much farther from one. Darts are thrown
//! (Cook 1986) at evenly spread places, in an order by chance, [`DARTS`] for each square of the spacing; a grid of cells as wide as the
//! spacing says which points are near. Neither darts nor their order are stored.
//!
//! *Regular:* rows of points over each triangle, from the corner opposite its shortest side on, as far apart as the spacing or nearer; points
//! that come too near to others, at common sides or on small triangles, are left out.
//!
//! Points with opposite normals do not count as near: both sides of a thin wall have their own.
//!
//! Cost: 40 bytes a point that is kept, 20 a triangle; some 0.3 us a dart.

use super::Cloud;
use crate::error::{Error, Result, Short};
use crate::mesh::chance::Chance;
use crate::mesh::{Bounds, Mesh, triangulate};
use crate::progress::{Progress, Stage, check};
use ahash::RandomState;
use glam::DVec3;
use hashbrown::HashMap;

/// Darts for each square of the spacing: with 16, less than one point in a hundred could be added.
const DARTS: f64 = 16.0;
/// Points of rows are left out that are nearer than so many spacings to another.
const ROW: f64 = 0.4;
/// More points than these are refused.
const MOST: f64 = 1e9;
/// Work between two questions whether to go on.
const PIECE: u64 = 1 << 12;

/// How points are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Pattern {
    /// By chance, but never near to each other.
    #[default]
    Poisson,
    /// In rows over each face.
    Regular,
}

/// How to take points of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ScatterOptions {
    /// How far points are from each other, in model units: the least distance of a Poisson disk pattern, the greatest along and between
    /// rows. Default `None`: a hundredth of the diagonal of the mesh's box.
    pub spacing: Option<f64>,
    /// How they are spread.
    pub pattern: Pattern,
    /// Other numbers give other points by chance.
    pub seed: u64,
}

/// Points on the faces of a mesh, with the normals of the faces: a cloud in memory.
///
/// # Errors
/// As [`scatter_into`].
pub fn scatter(mesh: &Mesh, options: &ScatterOptions, progress: &dyn Progress) -> Result<Cloud> {
    let mut cloud = Cloud::default();
    let mut take = |point, normal| {
        cloud.points.push(point);
        cloud.normals.push(normal);
        Ok(())
    };
    scatter_into(mesh, options, &mut take, progress)?;
    Ok(cloud)
}

/// Points on the faces of a mesh, and the unit normals of the faces there, passed to `take` as they are found; returns their number. Always
/// the same ones for the same mesh and options. Faces without area, or with corners that are not finite, have none.
///
/// # Errors
/// When the spacing is no length above 0, or so small that there would be more than a billion points; when the mesh has no faces with an
/// area; `Cancelled`, and what `take` returns.
pub fn scatter_into(
    mesh: &Mesh,
    options: &ScatterOptions,
    take: &mut dyn FnMut(DVec3, DVec3) -> Result<()>,
    progress: &dyn Progress,
) -> Result<u64> {
    let faces = Faces::of(mesh);
    let area = faces.ends.last().copied().unwrap_or(0.0);
    if area == 0.0 {
        let problem = "there is no face with an area";
        return Err(Error::setting("input", problem, "check the file with `zmend info`"));
    }
    let mut bounds = Bounds::EMPTY;
    faces.corners.iter().flatten().for_each(|&i| bounds.add(mesh.points[i as usize]));
    let spacing = options.spacing.unwrap_or(bounds.extent().length() / 100.0);
    let refuse = |problem: String, remedy: String| Err(Error::setting("spacing", problem, remedy));
    if !(spacing.is_normal() && spacing > 0.0) {
        return refuse(format!("{spacing} is no length above 0"), "give it in the units of the model".to_owned());
    }
    let expected = area / (spacing * spacing);
    if expected > MOST {
        let problem = format!("a surface of {} square units takes {} points", Short(area), Short(expected));
        return refuse(problem, format!("take {} or more", Short((area / MOST).sqrt())));
    }
    let mut kept = Kept::new(bounds.min, spacing, options.pattern);
    let mut count = 0;
    let mut offer = |point, normal| {
        if kept.keep(point, normal) {
            count += 1;
            take(point, normal)?;
        }
        Ok(())
    };
    match options.pattern {
        Pattern::Poisson => {
            let darts = (expected * DARTS).ceil().max(DARTS) as u64;
            faces.darts(darts, options.seed, &mut offer, progress)?;
        }
        Pattern::Regular => faces.rows(spacing, &mut offer, progress)?,
    }
    Ok(count)
}

/// The triangles of a mesh that have an area.
struct Faces<'a> {
    points: &'a [DVec3],
    corners: Vec<[u32; 3]>,
    /// The area of each and all before.
    ends: Vec<f64>,
}

impl<'a> Faces<'a> {
    fn of(mesh: &'a Mesh) -> Faces<'a> {
        let mut faces = Faces { points: &mesh.points, corners: Vec::new(), ends: Vec::new() };
        let (mut triangles, mut sum) = (Vec::new(), 0.0);
        for polygon in mesh.faces.iter() {
            triangles.clear();
            if polygon.iter().all(|&i| mesh.points.get(i as usize).is_some_and(|p| p.is_finite())) {
                triangulate(&mesh.points, polygon, &mut triangles);
            }
            for &corners in &triangles {
                let [a, b, c] = corners.map(|i| mesh.points[i as usize]);
                let area = 0.5 * (b - a).cross(c - a).length();
                if area > 0.0 && area.is_finite() {
                    sum += area;
                    faces.corners.push(corners);
                    faces.ends.push(sum);
                }
            }
        }
        faces
    }

    fn triangle(&self, i: usize) -> [DVec3; 3] {
        self.corners[i].map(|corner| self.points[corner as usize])
    }

    /// Offers so many places by chance, evenly spread over all faces, in an order by chance.
    fn darts(
        &self,
        count: u64,
        seed: u64,
        offer: &mut dyn FnMut(DVec3, DVec3) -> Result<()>,
        progress: &dyn Progress,
    ) -> Result<()> {
        progress.begin(Stage::Measure, count);
        let bits = count.next_power_of_two().trailing_zeros().max(2);
        let area = self.ends.last().copied().unwrap_or(0.0);
        for i in 0..1u64 << bits {
            if i.is_multiple_of(PIECE) {
                check(progress)?;
            }
            let dart = shuffled(i, bits);
            if dart >= count {
                continue;
            }
            let mut chance = Chance(seed ^ dart.wrapping_mul(0xa24b_aed4_963e_e407));
            let at = area * (dart as f64 + chance.unit()) / count as f64;
            let face = self.ends.partition_point(|&end| end <= at).min(self.ends.len() - 1);
            let [a, b, c] = self.triangle(face);
            // Even over a triangle: of a parallelogram, the half beyond is turned over.
            let (mut u, mut v) = (chance.unit(), chance.unit());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            offer(a + u * (b - a) + v * (c - a), (b - a).cross(c - a).normalize())?;
            if dart.is_multiple_of(PIECE) {
                progress.advance(PIECE);
            }
        }
        Ok(())
    }

    /// Offers rows of places over each face.
    fn rows(
        &self,
        spacing: f64,
        offer: &mut dyn FnMut(DVec3, DVec3) -> Result<()>,
        progress: &dyn Progress,
    ) -> Result<()> {
        progress.begin(Stage::Measure, self.corners.len() as u64);
        let steps = |length: f64| (length / spacing).ceil().max(1.0) as u64;
        for face in 0..self.corners.len() {
            let [a, b, c] = self.triangle(face);
            let normal = (b - a).cross(c - a).normalize();
            let sides = [(a, b, c), (b, c, a), (c, a, b)];
            let shortest = sides.into_iter().min_by(|s, t| s.1.distance(s.2).total_cmp(&t.1.distance(t.2)));
            let (apex, left, right) = shortest.expect("three sides");
            let rows = steps(apex.distance(left).max(apex.distance(right)));
            for row in 0..=rows {
                if row.is_multiple_of(64) {
                    check(progress)?;
                }
                let along = row as f64 / rows as f64;
                let [from, to] = [left, right].map(|end| apex.lerp(end, along));
                let places = steps(from.distance(to));
                for place in 0..=places {
                    offer(from.lerp(to, place as f64 / places as f64), normal)?;
                }
            }
            progress.advance(1);
        }
        Ok(())
    }
}

/// A number of so many bits, each in its own place: odd multiples and shifted sums can be undone.
fn shuffled(i: u64, bits: u32) -> u64 {
    let mask = (1u64 << bits) - 1;
    let mut x = i;
    for odd in [0x9e37_79b9_7f4a_7c15u64, 0xd1b5_4a32_d192_ed03, 0x8cb9_2ba7_2f3d_8dd7] {
        x = x.wrapping_mul(odd) & mask;
        x ^= x >> bits.div_ceil(2);
    }
    x
}

/// The end of a list.
const END: u32 = u32::MAX;

/// The points kept so far, in cells as wide as the spacing.
struct Kept {
    origin: DVec3,
    cell: f64,
    /// Square of the distance within which no second point is kept.
    square: f64,
    points: Vec<(DVec3, DVec3)>,
    /// The point before in the same cell.
    before: Vec<u32>,
    last: HashMap<[i64; 3], u32, RandomState>,
}

impl Kept {
    fn new(origin: DVec3, spacing: f64, pattern: Pattern) -> Kept {
        let cell = if pattern == Pattern::Poisson { spacing } else { ROW * spacing };
        let last = HashMap::with_hasher(RandomState::with_seeds(2, 7, 1, 8));
        Kept { origin, cell, square: cell * cell, points: Vec::new(), before: Vec::new(), last }
    }

    /// Keeps a point if no other with a like normal is near.
    fn keep(&mut self, point: DVec3, normal: DVec3) -> bool {
        let cell = ((point - self.origin) / self.cell).floor().to_array().map(|c| c as i64);
        for n in 0..27 {
            let beside = [cell[0] + n / 9 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n % 3 - 1];
            let mut next = self.last.get(&beside).copied().unwrap_or(END);
            while next != END {
                let (other, other_normal) = self.points[next as usize];
                if other.distance_squared(point) < self.square && other_normal.dot(normal) >= 0.0 {
                    return false;
                }
                next = self.before[next as usize];
            }
        }
        let number = self.points.len() as u32;
        self.points.push((point, normal));
        self.before.push(self.last.insert(cell, number).unwrap_or(END));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TriangleTree, sample};
    use crate::progress::Silent;

    #[test]
    fn disks_do_not_touch_and_leave_little_room() {
        let mesh = sample::build("sphere", 2).expect("a sample");
        let options = ScatterOptions { spacing: Some(0.1 * mesh.points[0].length()), ..ScatterOptions::default() };
        let spacing = options.spacing.expect("given");
        let cloud = scatter(&mesh, &options, &Silent).expect("points");
        assert_eq!(cloud, scatter(&mesh, &options, &Silent).expect("the same"));
        let other = scatter(&mesh, &ScatterOptions { seed: 1, ..options }, &Silent).expect("others");
        assert_ne!(cloud.points[0], other.points[0]);
        let tree = TriangleTree::new(&mesh);
        let nearest = |p: DVec3, own: usize| {
            let others = cloud.points.iter().enumerate().filter(|&(i, _)| i != own);
            others.map(|(_, q)| q.distance(p)).fold(f64::INFINITY, f64::min)
        };
        for (i, &p) in cloud.points.iter().enumerate() {
            assert!(tree.closest(p).expect("faces").distance < 1e-9 * spacing);
            assert!((spacing..1.6 * spacing).contains(&nearest(p, i)), "{i}: {}", nearest(p, i) / spacing);
            assert!((cloud.normals[i].length() - 1.0).abs() < 1e-12 && cloud.normals[i].dot(p) > 0.0);
        }
        let gaps = other.points.iter().map(|&p| nearest(p, usize::MAX)).fold(0.0, f64::max);
        assert!(gaps < 1.2 * spacing, "{}", gaps / spacing);
    }

    #[test]
    fn rows_cover_all_faces() {
        let mesh = sample::build("cube", 1).expect("a sample");
        let options = ScatterOptions { spacing: Some(0.1), pattern: Pattern::Regular, seed: 0 };
        let cloud = scatter(&mesh, &options, &Silent).expect("points");
        assert!((600..1100).contains(&cloud.points.len()), "{}", cloud.points.len());
        let off = |p: &DVec3| (*p - 0.5).abs().max_element() - 0.5;
        assert!(cloud.points.iter().all(|p| off(p).abs() < 1e-12));
        // The corner of each face, seen from the middle of a cell of the pattern.
        for n in 0..100u32 {
            let p = DVec3::new(f64::from(n % 10) / 10.0 + 0.05, f64::from(n / 10) / 10.0 + 0.05, 1.0);
            assert!(cloud.points.iter().any(|q| q.distance(p) < 0.1), "{p}");
        }
    }

    #[test]
    fn what_cannot_be_done_is_refused() {
        let mesh = sample::build("cube", 1).expect("a sample");
        for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-6] {
            let options = ScatterOptions { spacing: Some(spacing), ..ScatterOptions::default() };
            let message = scatter(&mesh, &options, &Silent).expect_err("refused").to_string();
            assert!(message.starts_with("spacing: "), "{message}");
        }
        let flat = Mesh { points: vec![DVec3::ZERO; 3], faces: [&[0u32, 1, 2][..]].into_iter().collect() };
        assert!(scatter(&flat, &ScatterOptions::default(), &Silent).expect_err("flat").to_string().contains("no face"));
    }

    #[test]
    fn orders_miss_no_dart() {
        for bits in [2, 3, 7, 10] {
            let mut all: Vec<u64> = (0..1 << bits).map(|i| shuffled(i, bits)).collect();
            assert!(!all.is_sorted());
            all.sort_unstable();
            assert!(all.into_iter().eq(0..1 << bits));
        }
    }
}
