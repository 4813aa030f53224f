//! Shaded pictures of meshes, drawn by ourselves: no window, no graphics card, the same bytes on every machine.
//!
//! Triangles are projected in parallel rays, snapped to 1/256 of a sample and filled by exact integer edge functions
//! (a sample on a shared edge belongs to one of the two triangles only), so a closed surface shows no cracks. The picture
//! is filled in horizontal bands, each by one thread from first to last triangle; samples do not depend on each other.
//! Faces seen from behind are red: holes and flipped faces show. Creases are darkened where the depth lies behind the
//! mean depth around (Luft, Colditz and Deussen 2006, "Image enhancement by unsharp masking the depth buffer").

use crate::error::{Error, Result};
use crate::mesh::{Bounds, Mesh, triangulate};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use std::path::Path;

/// How to look at meshes. The z axis points up in the picture.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Width of the whole picture in pixels; at least 1 is taken.
    pub width: u32,
    /// Height of the picture in pixels; at least 1 is taken.
    pub height: u32,
    /// Where the eye is around the z axis, in degrees from the x axis towards the y axis.
    pub azimuth: f64,
    /// How high the eye is above the xy plane, in degrees: 90 looks down.
    pub elevation: f64,
    /// Samples along a side of a pixel, 1 to 8 are taken. Time and memory grow with its square.
    pub supersample: u32,
    /// Draw the edges of polygons on top.
    pub wireframe: bool,
    /// Free border around the mesh, as part of the shorter side of its panel.
    pub margin: f64,
}

impl Default for View {
    fn default() -> Self {
        View {
            width: 1200,
            height: 900,
            azimuth: -60.0,
            elevation: 25.0,
            supersample: 2,
            wireframe: false,
            margin: 0.05,
        }
    }
}

/// A picture: rows of pixels from the top, three bytes (sRGB) each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
}

impl Image {
    /// The colour of a pixel, counted from the left and from the top.
    ///
    /// # Panics
    /// When there is no such pixel.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        assert!(x < self.width && y < self.height, "the picture has {} x {} pixels", self.width, self.height);
        let at = 3 * (y as usize * self.width as usize + x as usize);
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    /// Writes a PNG file, first under another name beside it, so that there is a whole file or none.
    ///
    /// # Errors
    /// When the file cannot be written or renamed.
    pub fn write_png(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.partial", std::process::id()));
        let partial = path.with_file_name(name);
        let written = self.encode(&partial).map_err(|e| Error::io(path, "write", e));
        let renamed = written.and_then(|()| std::fs::rename(&partial, path).map_err(|e| Error::io(path, "rename", e)));
        renamed.inspect_err(|_| drop(std::fs::remove_file(&partial)))
    }

    fn encode(&self, path: &Path) -> std::io::Result<()> {
        let mut encoder =
            png::Encoder::new(std::io::BufWriter::new(std::fs::File::create(path)?), self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb)?;
        Ok(writer.finish()?)
    }
}

/// Draws meshes side by side, at one scale, from one direction. A mesh that lies where the first one does, as the input and
/// output of a repair do, is placed as the first one, so that features line up; others are centred. What is not finite
/// is left out.
///
/// Linear in triangles and samples: about COST
pub fn render(meshes: &[&Mesh], view: &View) -> Image {
    let (width, height, fine) = (view.width.max(1), view.height.max(1), view.supersample.clamp(1, 8));
    let camera = Camera::new(view);
    let panels = meshes.len().max(1) as u32;
    let flat: Vec<Vec<DVec3>> =
        meshes.iter().map(|mesh| mesh.points.par_iter().map(|&p| camera.project(p)).collect()).collect();
    let frames = frames(meshes, &flat);
    // Samples per model unit: what the tightest panel allows.
    let panel = DVec2::new(f64::from(width / panels), f64::from(height)) * f64::from(fine);
    let room = panel - 2.0 * view.margin.clamp(0.0, 0.45) * panel.min_element();
    let scale =
        frames.iter().map(|frame| (room / frame.extent().truncate()).min_element()).fold(f64::INFINITY, f64::min);
    let scale = if scale.is_finite() { scale } else { 1.0 };

    let columns: Vec<Vec<u8>> = (0..panels)
        .map(|i| {
            // The last panel takes the columns that are left over.
            let panel_width = if i + 1 == panels { width - i * (width / panels) } else { width / panels };
            let mut canvas = Canvas::new([panel_width * fine, height * fine]);
            if let Some(&mesh) = meshes.get(i as usize) {
                let middle = DVec2::new(canvas.width as f64, canvas.height as f64).extend(0.0) / 2.0;
                let center = frames[i as usize].center();
                let placed: Vec<DVec3> = flat[i as usize].par_iter().map(|&p| (p - center) * scale + middle).collect();
                canvas.draw(mesh, &placed, view.wireframe.then_some(WIRE_WIDTH * fine as f32));
                canvas.darken_creases();
            }
            canvas.shrink(fine as usize)
        })
        .collect();
    let mut rgb = Vec::with_capacity(3 * width as usize * height as usize);
    for y in 0..height as usize {
        for column in &columns {
            let row = column.len() / height as usize;
            rgb.extend_from_slice(&column[y * row..(y + 1) * row]);
        }
    }
    Image { width, height, rgb }
}

/// The part of the projected space that each panel shows: the bounds of the mesh's faces, or of the first mesh's if alike.
fn frames(meshes: &[&Mesh], flat: &[Vec<DVec3>]) -> Vec<Bounds> {
    let mut frames: Vec<Bounds> = Vec::with_capacity(meshes.len());
    for (mesh, points) in meshes.iter().zip(flat) {
        let mut bounds = Bounds::EMPTY;
        mesh.faces.corners().iter().filter_map(|&i| points.get(i as usize)).for_each(|&p| bounds.add(p));
        if bounds.is_empty() {
            bounds = Bounds { min: DVec3::ZERO, max: DVec3::ZERO };
        }
        let first = frames.first().copied().unwrap_or(bounds);
        let apart = (first.min - bounds.min).abs().max((first.max - bounds.max).abs()).max_element();
        frames.push(if apart <= 0.1 * first.extent().max_element() { first } else { bounds });
    }
    frames
}

/// Looks at the scene in parallel rays.
struct Camera {
    right: DVec3,
    up: DVec3,
    /// From the scene to the eye.
    back: DVec3,
}

impl Camera {
    fn new(view: &View) -> Self {
        let (sin_a, cos_a) = view.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = view.elevation.to_radians().sin_cos();
        let back = DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e);
        let right = DVec3::new(-sin_a, cos_a, 0.0);
        Camera { right, up: back.cross(right), back }
    }

    /// To the right, up, and towards the eye, in model units.
    fn project(&self, p: DVec3) -> DVec3 {
        DVec3::new(self.right.dot(p), self.up.dot(p), self.back.dot(p))
    }
}

/// Linear light.
const BACKGROUND: Vec3 = Vec3::new(0.90, 0.91, 0.93);
const FRONT: Vec3 = Vec3::new(0.36, 0.47, 0.60);
const BEHIND: Vec3 = Vec3::new(0.78, 0.13, 0.06);
const WIRE: Vec3 = Vec3::new(0.02, 0.03, 0.05);
/// Half the width of an edge in pixels; its two faces draw a half each.
const WIRE_WIDTH: f32 = 0.4;

/// Light that a face sends to the eye, from its unit normal in camera axes (turned to the eye).
fn shade(normal: Vec3, base: Vec3) -> Vec3 {
    let key = normal.dot(Vec3::new(-0.45, 0.62, 0.64).normalize()).max(0.0);
    let fill = normal.dot(Vec3::new(0.75, -0.1, 0.65).normalize()).max(0.0);
    let sky = 0.5 + 0.5 * normal.y;
    let rim = (1.0 - normal.z).powi(4);
    let gloss = normal.dot(Vec3::new(-0.26, 0.36, 0.92).normalize()).max(0.0).powi(40);
    base * (0.95 * key + 0.22 * fill + 0.16 + 0.18 * sky) + Vec3::splat(0.16 * rim + 0.10 * gloss)
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
        let light = shade(toward, if front > 0 { FRONT } else { BEHIND });
        let depth = |p: DVec3| p.z as f32;
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
        let bias: [i64; 3] = std::array::from_fn(|k| if dy[k] < 0 || (dy[k] == 0 && dx[k] < 0) { 0 } else { 1 });
        let inverse_area = 1.0 / edge_function(a, b, c) as f32;
        let reach = sides.map(|[p, q]| {
            let side = [0, 1].map(|k| (q[k] - p[k]) as f32);
            wire.map_or(0.0, |wire| wire * SUB as f32 * side[0].hypot(side[1]))
        });
        for y in ys {
            let [px, py] = [xs.start, y].map(|i| (i * SUB + SUB / 2) as i32);
            let mut weights = sides.map(|[p, q]| edge_function(p, q, [px, py]));
            let row = &mut samples[(y as usize - first) * width..][xs.start as usize..xs.end as usize];
            let mut entered = false;
            for sample in row {
                if (0..3).all(|k| weights[k] >= bias[k]) {
                    entered = true;
                    let weight = weights.map(|w| w as f32);
                    let depth = (0..3).map(|k| weight[k] * self.depth[k]).sum::<f32>() * inverse_area;
                    if depth > sample.depth {
                        let on_wire = (0..3).any(|k| weight[k] < reach[k] && self.edges >> k & 1 == 1);
                        *sample = Sample { depth, light: if on_wire { WIRE } else { self.light } };
                    }
                } else if entered {
                    break;
                }
                (0..3).for_each(|k| weights[k] -= dy[k] * SUB);
            }
        }
    }
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

/// One sample: the light that arrives, and how near to the eye it comes from (minus infinity: nothing there).
#[derive(Clone, Copy)]
struct Sample {
    light: Vec3,
    depth: f32,
}

/// The samples of one panel, rows from the bottom.
struct Canvas {
    width: usize,
    height: usize,
    samples: Vec<Sample>,
}

impl Canvas {
    fn new([width, height]: [u32; 2]) -> Self {
        let (width, height) = (width as usize, height as usize);
        Canvas { width, height, samples: vec![Sample { light: BACKGROUND, depth: f32::NEG_INFINITY }; width * height] }
    }

    /// Fills the faces of a mesh over placed points: x and y in samples from the lower left corner, z towards the eye.
    fn draw(&mut self, mesh: &Mesh, points: &[DVec3], wire: Option<f32>) {
        let chunk = |i: usize| {
            let mut patches = Vec::with_capacity(FACES);
            add_patches(mesh, points, i * FACES..mesh.faces.len().min((i + 1) * FACES), &mut patches);
            patches
        };
        let patches: Vec<Vec<Patch>> = (0..mesh.faces.len().div_ceil(FACES)).into_par_iter().map(chunk).collect();
        let rows = self.height.div_ceil(2 * rayon::current_num_threads());
        let width = self.width;
        self.samples.par_chunks_mut((rows * width).max(1)).enumerate().for_each(|(band, samples)| {
            patches.iter().flatten().for_each(|patch| patch.fill(samples, width, band * rows, wire));
        });
    }

    /// Darkens samples that lie behind the mean of the surface around them.
    fn darken_creases(&mut self) {
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
                sample.light *= 1.0 - 0.55 * (0.25 * behind).clamp(0.0, 1.0);
            },
        );
    }

    /// Averages light over pixels and encodes it; rows from the top.
    fn shrink(&self, fine: usize) -> Vec<u8> {
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
fn encode(light: f32) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let value = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    (255.0 * value + 0.5) as u8
}

/// Means over windows of `2 * radius + 1` values; there is nothing beyond the ends.
fn blur(from: &[[f32; 2]], to: &mut [[f32; 2]], radius: usize) {
    let at = |i: usize| from.get(i).map_or([0.0; 2], |v| v.map(f64::from));
    let mut sum = (0..radius).fold([0.0; 2], |sum, i| [0, 1].map(|k| sum[k] + at(i)[k]));
    for i in 0..from.len() {
        let (enters, leaves) = (at(i + radius), if i > radius { at(i - radius - 1) } else { [0.0; 2] });
        sum = [0, 1].map(|k| sum[k] + enters[k] - leaves[k]);
        to[i] = sum.map(|s| (s / (2 * radius + 1) as f64) as f32);
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
    use crate::mesh::{Polygons, sample};
    use std::f64::consts::PI;

    fn small() -> View {
        View { width: 400, height: 300, ..View::default() }
    }

    fn background() -> [u8; 3] {
        BACKGROUND.to_array().map(encode)
    }

    /// Pixels that show something, and those of them that are red.
    fn covered(image: &Image) -> (usize, usize) {
        let pixels = image.rgb.as_chunks::<3>().0;
        let shown = pixels.iter().filter(|&&p| p != background());
        (shown.clone().count(), shown.filter(|[r, g, _]| *r > g.saturating_add(40)).count())
    }

    fn flipped(mesh: &Mesh) -> Mesh {
        let faces = mesh.faces.iter().map(|f| f.iter().rev().copied().collect::<Vec<_>>()).collect::<Vec<_>>();
        Mesh { points: mesh.points.clone(), faces: faces.iter().map(|f| &f[..]).collect::<Polygons>() }
    }

    #[test]
    fn a_ball_is_a_disc_and_red_inside_out() {
        let ball = sample::build("sphere", 2).unwrap();
        let disc = PI * (0.45f64 * 300.0).powi(2);
        for supersample in [1, 2, 3] {
            let (shown, red) = covered(&render(&[&ball], &View { supersample, ..small() }));
            assert!((shown as f64 / disc - 1.0).abs() < 0.02, "{shown} pixels instead of {disc}");
            assert_eq!(red, 0);
        }
        let (shown, red) = covered(&render(&[&flipped(&ball)], &small()));
        assert!(red as f64 > 0.95 * shown as f64, "{red} of {shown}");
    }

    #[test]
    fn z_is_up_and_the_eye_is_where_the_view_says() {
        // A triangle in the plane x = 0 with its tip up, seen from +x: y to the right.
        let points = vec![DVec3::ZERO, DVec3::Y, DVec3::Z];
        let mesh = Mesh { points, faces: [&[0u32, 1, 2][..]].into_iter().collect() };
        let image = render(&[&mesh], &View { azimuth: 0.0, elevation: 0.0, ..small() });
        let shown = |x, y| image.pixel(x, y) != background();
        assert!(shown(100, 250) && shown(80, 40) && shown(300, 280) && !shown(300, 40));
        assert_eq!(covered(&image).1, 0);
        let behind = render(&[&mesh], &View { azimuth: 180.0, elevation: 0.0, ..small() });
        assert!(behind.pixel(300, 250)[0] > 100 && covered(&behind).1 > 10_000);
    }

    #[test]
    fn nothing_gives_the_background() {
        let far = Mesh { points: vec![DVec3::NAN; 3], faces: [&[0u32, 1, 2][..], &[0, 7, 8]].into_iter().collect() };
        let images = [render(&[], &small()), render(&[&Mesh::default()], &small()), render(&[&far, &far], &small())];
        for image in images {
            assert_eq!(image.rgb.len(), 3 * 400 * 300);
            assert_eq!(covered(&image).0, 0);
        }
        let tiny = View { width: 0, height: 0, supersample: 0, ..small() };
        assert_eq!(render(&[&Mesh::default(); 3], &tiny).rgb.len(), 3);
    }

    #[test]
    fn points_that_are_not_finite_are_left_out() {
        let ball = sample::build("nan", 1).unwrap();
        let (shown, _) = covered(&render(&[&ball], &small()));
        assert!(shown as f64 > 0.95 * PI * (0.45f64 * 300.0).powi(2));
    }

    #[test]
    fn meshes_stand_side_by_side_at_one_scale() {
        let ball = sample::build("sphere", 1).unwrap();
        let half = Mesh { points: ball.points.iter().map(|p| 0.5 * p + 7.0).collect(), faces: ball.faces.clone() };
        let image = render(&[&ball, &half], &small());
        let shown = |range: std::ops::Range<u32>| {
            range
                .flat_map(|x| (0..300).map(move |y| (x, y)))
                .filter(|&(x, y)| image.pixel(x, y) != background())
                .count()
        };
        let ratio = shown(0..200) as f64 / shown(200..400) as f64;
        assert!((ratio - 4.0).abs() < 0.15, "{ratio}");
    }

    #[test]
    fn a_closed_surface_shows_no_cracks_and_a_wireframe_no_diagonals() {
        let knot = sample::build("knot", 1).unwrap();
        assert_eq!(covered(&render(&[&knot], &small())).1, 0);
        let quad = sample::build("cube", 1).unwrap();
        let view = View { azimuth: 0.0, elevation: 0.0, wireframe: true, ..small() };
        let image = render(&[&quad], &view);
        assert_eq!(image.pixel(200, 150), image.pixel(190, 120));
        assert!(image.pixel(65, 150)[0] + 20 < image.pixel(200, 150)[0]);
    }

    #[test]
    fn pictures_do_not_depend_on_threads_and_survive_a_file() {
        let gear = sample::build("gear", 1).unwrap();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render(&[&gear, &gear], &View { wireframe: true, ..small() }))
        };
        let image = with(1);
        assert!(image == with(3));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("gear.png");
        image.write_png(&path).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut rgb).unwrap();
        assert!(rgb == image.rgb);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let message = image.write_png(folder.path().join("none").join("gear.png")).unwrap_err().to_string();
        assert!(message.contains("gear.png: cannot write"), "{message}");
    }

    /// Run by hand: `ZMEND_PICTURES=folder cargo test --lib render::tests::gallery -- --ignored --nocapture`.
    #[test]
    #[ignore = "a gallery to look at, and a measurement"]
    fn gallery() {
        let folder = std::env::var_os("ZMEND_PICTURES").map_or_else(std::env::temp_dir, Into::into);
        for (name, _) in sample::names() {
            let mesh = sample::build(name, 1).unwrap();
            render(&[&mesh], &View::default()).write_png(folder.join(format!("{name}.png"))).unwrap();
        }
        let [knot, holes] = ["knot", "knot-holes"].map(|name| sample::build(name, 7).unwrap());
        let start = std::time::Instant::now();
        let image = render(&[&knot, &holes], &View { width: 1600, ..View::default() });
        println!("{} triangles: {:.2} s", knot.faces.len() + holes.faces.len(), start.elapsed().as_secs_f64());
        image.write_png(folder.join("pair.png")).unwrap();
    }
}
