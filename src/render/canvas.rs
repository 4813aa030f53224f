//! Filling triangles: exact edge functions, a depth for each sample, light for each face, darker creases.

use crate::mesh::{Mesh, triangulate};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Behind everything. Colours are linear light.
pub(super) const BACKGROUND: Vec3 = Vec3::new(0.90, 0.91, 0.93);
const FRONT: Vec3 = Vec3::new(0.33, 0.45, 0.60);
const BEHIND: Vec3 = Vec3::new(0.78, 0.13, 0.06);
/// What is seen from behind must stand out in the dark, too.
const BEHIND_GLOW: Vec3 = Vec3::new(0.17, 0.018, 0.008);
/// In samples: above the rounding of depths (1e-3 for 10,000 samples), below what can be seen.
const BEHIND_SHIFT: f32 = 0.02;
/// Greatest part of a triangle's height that the line along an edge may take.
const WIRE_SHARE: f32 = 0.08;
const WIRE: Vec3 = Vec3::new(0.02, 0.03, 0.05);

/// Light that a face sends to the eye, from its unit normal in camera axes (turned to the eye).
fn shade(normal: Vec3, base: Vec3) -> Vec3 {
    let key = normal.dot(Vec3::new(-0.45, 0.62, 0.64).normalize()).max(0.0);
    let fill = normal.dot(Vec3::new(0.75, -0.1, 0.65).normalize()).max(0.0);
    let sky = 0.5 + 0.5 * normal.y;
    let rim = (1.0 - normal.z).powi(4);
    let gloss = normal.dot(Vec3::new(-0.26, 0.36, 0.92).normalize()).max(0.0).powi(40);
    base * (0.95 * key + 0.14 * fill + 0.07 + 0.14 * sky) + Vec3::splat(0.14 * rim + 0.14 * gloss)
}

/// Subdivisions of a sample's side.
const SUB: i64 = 256;
/// Coordinates beyond this many samples are not drawn: subdivided ones fit an `i32`, edge functions an `i64`.
const FAR: f64 = (1 << 21) as f64;
/// Faces handled at a time.
const FACES: usize = 1 << 13;

/// A triangle ready to be filled.
struct Patch {
    /// In subdivisions, counter-clockwise with y up.
    corners: [[i32; 2]; 3],
    /// Towards the eye, in samples.
    depth: [f32; 3],
    light: Vec3,
    /// Bit k: the side opposite of corner k is an edge of the polygon.
    edges: u8,
}

impl Patch {
    /// `None` when corners are not finite, too far away, or in line.
    fn new([a, b, c]: [DVec3; 3], edges: u8) -> Option<Patch> {
        if ![a, b, c].iter().all(|p| p.is_finite() && p.truncate().abs().max_element() < FAR) {
            return None;
        }
        let snap = |p: DVec3| [p.x, p.y].map(|x| (x * SUB as f64).round() as i32);
        let front = edge_function(snap(a), snap(b), snap(c));
        if front == 0 {
            return None;
        }
        // The side that is seen: turned to the eye, even where snapping has tipped a face over.
        let normal = (b - a).cross(c - a).normalize_or(DVec3::Z).as_vec3();
        let toward = if normal.z < 0.0 { -normal } else { normal };
        let light = if front > 0 { shade(toward, FRONT) } else { shade(toward, BEHIND) + BEHIND_GLOW };
        // Of two faces in one place, the one seen from the front shows.
        let depth = |p: DVec3| if front > 0 { p.z as f32 } else { p.z as f32 - BEHIND_SHIFT };
        Some(if front > 0 {
            Patch { corners: [a, b, c].map(snap), depth: [a, b, c].map(depth), light, edges }
        } else {
            let edges = (edges & 1) | (edges & 2) << 1 | (edges & 4) >> 1;
            Patch { corners: [a, c, b].map(snap), depth: [a, c, b].map(depth), light, edges }
        })
    }

    /// Fills the samples of some rows, the lowest of which is `first`, where nothing nearer has been. Edges of the
    /// polygon are drawn half as wide as given, in samples.
    fn fill(&self, samples: &mut [Sample], width: usize, first: usize, wire: Option<f32>) {
        let [a, b, c] = self.corners;
        let sides = [[b, c], [c, a], [a, b]];
        let rows = samples.len() / width;
        let range = |k: usize, from: usize, len: usize| {
            let (min, max) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            // Samples whose centres lie between.
            let center = (SUB / 2) as i32;
            let start = (i64::from(min - center) + SUB - 1).div_euclid(SUB).max(from as i64);
            let end = i64::from(max - center).div_euclid(SUB).min((from + len) as i64 - 1);
            start..end + 1
        };
        let (xs, ys) = (range(0, 0, width), range(1, first, rows));
        if xs.is_empty() || ys.is_empty() {
            return;
        }
        // Corner k's weight is the edge function of the side opposite; samples on a side belong to the triangle that has
        // it on its left, or above.
        let [dx, dy] = [0, 1].map(|k| sides.map(|[p, q]| i64::from(q[k]) - i64::from(p[k])));
        let bias: [i64; 3] = std::array::from_fn(|k| i64::from(dy[k] > 0 || (dy[k] == 0 && dx[k] > 0)));
        let area = edge_function(a, b, c) as f32;
        // How much of a weight an edge's line takes: of small triangles a part only, or dense meshes would be black.
        let reach = sides.map(|[p, q]| {
            let side = [0, 1].map(|k| (q[k] - p[k]) as f32);
            wire.map_or(0.0, |wire| (wire * SUB as f32 * side[0].hypot(side[1])).min(WIRE_SHARE * area))
        });
        for y in ys {
            let [px, py] = [xs.start, y].map(|i| (i * SUB + SUB / 2) as i32);
            let start = sides.map(|[p, q]| edge_function(p, q, [px, py]));
            let span = span(start, bias, dy.map(|dy| dy * SUB), xs.end - xs.start);
            let mut weights: [i64; 3] = std::array::from_fn(|k| start[k] - span.start * dy[k] * SUB);
            let row = &mut samples[(y as usize - first) * width + xs.start as usize..];
            for sample in &mut row[span.start as usize..span.end as usize] {
                let weight = weights.map(|w| w as f32);
                let depth = (0..3).map(|k| weight[k] * self.depth[k]).sum::<f32>() / area;
                if depth > sample.depth {
                    let on_wire = (0..3).any(|k| weight[k] < reach[k] && self.edges >> k & 1 == 1);
                    *sample = Sample { depth, light: if on_wire { WIRE } else { self.light } };
                }
                (0..3).for_each(|k| weights[k] -= dy[k] * SUB);
            }
        }
    }
}

/// The steps of a row, of `len`, at which no weight is below its bias: weights begin as `start` and fall by `fall` a step. May be empty,
/// but never lies outside of the row.
fn span(start: [i64; 3], bias: [i64; 3], fall: [i64; 3], len: i64) -> std::ops::Range<i64> {
    let (mut from, mut to) = (0, len);
    for k in 0..3 {
        let room = start[k] - bias[k];
        match fall[k].signum() {
            1 => to = to.min(room.div_euclid(fall[k]) + 1),
            -1 => from = from.max((-room - fall[k] - 1).div_euclid(-fall[k])),
            _ if room < 0 => to = from,
            _ => {}
        }
    }
    if from < to { from..to } else { 0..0 }
}

/// Twice the area of a triangle in squared subdivisions, positive when counter-clockwise.
fn edge_function(p: [i32; 2], q: [i32; 2], r: [i32; 2]) -> i64 {
    let [[ux, uy], [vx, vy]] = [q, r].map(|s| [0, 1].map(|k| i64::from(s[k]) - i64::from(p[k])));
    ux * vy - uy * vx
}

/// The triangles of some faces over placed points, appended.
fn add_patches(mesh: &Mesh, points: &[DVec3], faces: std::ops::Range<usize>, patches: &mut Vec<Patch>) {
    let mut triangles = Vec::new();
    for face in faces.map(|i| mesh.faces.get(i)) {
        triangles.clear();
        triangulate(points, face, &mut triangles);
        for &[a, b, c] in &triangles {
            // Sides that occur in the polygon, as opposed to diagonals; not asked of polygons with many corners.
            let is_edge = |p: u32, q: u32| {
                let n = face.len();
                !(4..=32).contains(&n) || (0..n).any(|k| face[k] == p && face[if k + 1 == n { 0 } else { k + 1 }] == q)
            };
            let edges = u8::from(is_edge(b, c)) | u8::from(is_edge(c, a)) << 1 | u8::from(is_edge(a, b)) << 2;
            let point = |i: u32| points.get(i as usize).copied().unwrap_or(DVec3::NAN);
            patches.extend(Patch::new([a, b, c].map(point), edges));
        }
    }
}

/// An edge to be marked.
pub(super) struct Mark {
    pub(super) ends: [u32; 2],
    pub(super) light: Vec3,
}

/// Edges and faces to be marked.
#[derive(Default)]
pub(super) struct Marks {
    pub(super) edges: Vec<Mark>,
    pub(super) faces: Vec<u32>,
    /// The colour of the faces.
    pub(super) light: Vec3,
}

/// Marks are seen as if they were this much nearer, in samples; edges in front of faces.
const MARK_SHIFT: [f64; 2] = [0.5, 4.0];

/// What is laid over is seen as if it were this much nearer, in samples: more than any picture is deep, and little enough for depths to keep
/// a hundredth of a sample.
const OVER: f32 = 65_536.0;

/// Strips along the marked edges, `width` samples wide, and the marked faces in another colour.
fn mark_patches(mesh: &Mesh, points: &[DVec3], marks: &Marks, width: f64) -> Vec<Patch> {
    let point = |i: u32| points.get(i as usize).copied().unwrap_or(DVec3::NAN);
    let mut patches = Vec::new();
    let mut triangles = Vec::new();
    for &face in &marks.faces {
        triangles.clear();
        triangulate(points, mesh.faces.get(face as usize), &mut triangles);
        for t in &triangles {
            let corners = t.map(|i| point(i) + MARK_SHIFT[0] * DVec3::Z);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(DVec3::Z).as_vec3();
            let light = shade(if normal.z < 0.0 { -normal } else { normal }, marks.light);
            patches.extend(Patch::new(corners, 0).map(|patch| Patch { light, ..patch }));
        }
    }
    for mark in &marks.edges {
        let [a, b] = mark.ends.map(|i| point(i) + MARK_SHIFT[1] * DVec3::Z);
        let along = (b - a).truncate().normalize_or(glam::DVec2::X);
        // A little longer than the edge, so that marks one after another have no gaps.
        let (across, ahead) = (0.5 * width * along.perp().extend(0.0), 0.25 * width * along.extend(0.0));
        let (a, b) = (a - ahead, b + ahead);
        let quad = [a - across, b - across, b + across, a + across];
        for corners in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
            patches.extend(Patch::new(corners, 0).map(|patch| Patch { light: mark.light, ..patch }));
        }
    }
    patches
}

/// One sample: the light that arrives, and how near to the eye it comes from (minus infinity: nothing there).
#[derive(Clone, Copy)]
struct Sample {
    light: Vec3,
    depth: f32,
}

/// The samples of one panel, rows from the bottom.
pub(super) struct Canvas {
    pub(super) width: usize,
    pub(super) height: usize,
    samples: Vec<Sample>,
}

impl Canvas {
    pub(super) fn new([width, height]: [u32; 2]) -> Self {
        let (width, height) = (width as usize, height as usize);
        Canvas { width, height, samples: vec![Sample { light: BACKGROUND, depth: f32::NEG_INFINITY }; width * height] }
    }

    /// Fills the faces of a mesh over placed points: x and y in samples from the lower left corner, z towards the eye.
    pub(super) fn draw(&mut self, mesh: &Mesh, points: &[DVec3], wire: Option<f32>) {
        let chunk = |i: usize| {
            let mut patches = Vec::with_capacity(FACES);
            add_patches(mesh, points, i * FACES..mesh.faces.len().min((i + 1) * FACES), &mut patches);
            patches
        };
        let patches: Vec<Vec<Patch>> = (0..mesh.faces.len().div_ceil(FACES)).into_par_iter().map(chunk).collect();
        self.fill(&patches, wire);
    }

    /// Marks edges, in strips `width` samples wide, and faces of a mesh over placed points.
    pub(super) fn mark(&mut self, mesh: &Mesh, points: &[DVec3], marks: &Marks, width: f64) {
        self.fill(&[mark_patches(mesh, points, marks, width)], None);
    }

    /// Fills triangles over placed points with a colour each (linear light), in front of all else and as near to the eye as they are to
    /// each other.
    pub(super) fn lay_over(&mut self, triangles: &[([DVec3; 3], Vec3)]) {
        let patch = |(corners, base): &([DVec3; 3], Vec3)| {
            let patch = Patch::new(*corners, 0)?;
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(DVec3::Z).as_vec3();
            let light = shade(if normal.z < 0.0 { -normal } else { normal }, *base);
            Some(Patch { light, depth: patch.depth.map(|depth| depth + OVER), ..patch })
        };
        self.fill(&[triangles.iter().filter_map(patch).collect()], None);
    }

    fn fill(&mut self, patches: &[Vec<Patch>], wire: Option<f32>) {
        let rows = self.height.div_ceil(2 * rayon::current_num_threads());
        let width = self.width;
        self.samples.par_chunks_mut((rows * width).max(1)).enumerate().for_each(|(band, samples)| {
            patches.iter().flatten().for_each(|patch| patch.fill(samples, width, band * rows, wire));
        });
    }

    /// Darkens samples that lie behind the mean of the surface around them.
    pub(super) fn darken_creases(&mut self) {
        let radius = (self.width.min(self.height) / 80).max(1);
        let seen = |sample: &Sample| if sample.depth.is_finite() { [sample.depth, 1.0] } else { [0.0; 2] };
        // Depth and coverage, both blurred twice each way: their quotient is the mean depth of what is covered.
        let mut blurred: Vec<[f32; 2]> = self.samples.iter().map(seen).collect();
        for [width, height] in [[self.width, self.height], [self.height, self.width]] {
            blurred.par_chunks_mut(width.max(1)).for_each(|row| {
                let mut line = vec![[0.0; 2]; row.len()];
                blur(row, &mut line, radius);
                blur(&line, row, radius);
            });
            blurred = transposed(&blurred, width, height);
        }
        let radius = radius as f32;
        self.samples.par_iter_mut().zip(&blurred).filter(|(sample, _)| sample.depth.is_finite()).for_each(
            |(sample, [depth, coverage])| {
                let behind = (depth / coverage - sample.depth) / radius;
                sample.light *= 1.0 - 0.45 * (0.25 * behind).clamp(0.0, 1.0);
            },
        );
    }

    /// Averages light over pixels and encodes it; rows from the top.
    pub(super) fn shrink(&self, fine: usize) -> Vec<u8> {
        let width = self.width;
        let pixels = width / fine;
        let mut rgb = vec![0; 3 * pixels * (self.height / fine)];
        rgb.par_chunks_mut((3 * pixels).max(1)).rev().enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let rows = (y * fine..(y + 1) * fine).map(|y| &self.samples[y * width + x * fine..][..fine]);
                let light: Vec3 = rows.flatten().map(|sample| sample.light).sum();
                let light = light / (fine * fine) as f32;
                pixel.copy_from_slice(&light.to_array().map(encode));
            }
        });
        rgb
    }
}

/// The sRGB transfer function.
pub(super) fn encode(light: f32) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let value = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    (255.0 * value + 0.5) as u8
}

/// The light of an sRGB colour.
pub(super) fn decode(colour: [u8; 3]) -> Vec3 {
    let light = |value: u8| {
        let value = f32::from(value) / 255.0;
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    };
    Vec3::from(colour.map(light))
}

/// Means over windows of `2 * radius + 1` values; there is nothing beyond the ends.
fn blur(from: &[[f32; 2]], to: &mut [[f32; 2]], radius: usize) {
    let at = |i: usize| from.get(i).map_or([0.0; 2], |v| v.map(f64::from));
    let mut sum = (0..radius).fold([0.0; 2], |sum, i| [0, 1].map(|k| sum[k] + at(i)[k]));
    for (i, mean) in to.iter_mut().enumerate() {
        let (enters, leaves) = (at(i + radius), if i > radius { at(i - radius - 1) } else { [0.0; 2] });
        sum = [0, 1].map(|k| sum[k] + enters[k] - leaves[k]);
        *mean = sum.map(|s| (s / (2 * radius + 1) as f64) as f32);
    }
}

/// Columns as rows, by squares that fit the cache.
fn transposed(from: &[[f32; 2]], width: usize, height: usize) -> Vec<[f32; 2]> {
    const SIDE: usize = 32;
    let mut to = vec![[0.0; 2]; from.len()];
    to.par_chunks_mut((SIDE * height).max(1)).enumerate().for_each(|(i, columns)| {
        for y0 in (0..height).step_by(SIDE) {
            for (x, column) in columns.chunks_mut(height).enumerate() {
                for y in y0..height.min(y0 + SIDE) {
                    column[y] = from[y * width + i * SIDE + x];
                }
            }
        }
    });
    to
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn spans_are_where_all_weights_suffice(
            start in prop::array::uniform3(-300i64..300),
            bias in prop::array::uniform3(0i64..2),
            fall in prop::array::uniform3(-9i64..9),
            len in 0i64..40,
        ) {
            let span = span(start, bias, fall, len);
            prop_assert!(0 <= span.start && span.end <= len);
            for n in 0..len {
                prop_assert_eq!(span.contains(&n), (0..3).all(|k| start[k] - n * fall[k] >= bias[k]), "{}", n);
            }
        }
    }
}
