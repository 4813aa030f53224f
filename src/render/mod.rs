//! Shaded pictures of meshes, drawn by ourselves: no window, no graphics card, the same bytes on every machine.
//!
//! Triangles are projected in parallel rays, snapped to 1/256 of a sample and filled by exact integer edge functions
//! (a sample on a shared edge belongs to one of the two triangles only), so a closed surface shows no cracks. The picture
//! is filled in horizontal bands, each by one thread from first to last triangle; samples do not depend on each other.
//! Faces seen from behind are red: holes and flipped faces show. Creases are darkened where the depth lies behind the
//! mean depth around (Luft, Colditz and Deussen 2006, "Image enhancement by unsharp masking the depth buffer").

mod canvas;
mod defects;

use crate::error::{Error, Result};
use crate::mesh::{Bounds, Mesh};
use canvas::Canvas;
use glam::{DVec2, DVec3};
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
    /// Mark what is wrong: boundary edges green, non-manifold edges violet, edges whose faces run the same way blue, faces that meet others
    /// where they should not yellow (unless a million pairs do).
    pub defects: bool,
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
            defects: false,
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
/// Linear in triangles and samples: a million triangles on 1200 x 900 pixels take 0.4 s on two cores, and about 80 bytes a
/// triangle and 130 a pixel.
///
/// ```no_run
/// let knot = zmend::mesh::sample::build("knot-holes", 1)?;
/// zmend::render::render(&[&knot], &zmend::render::View::default()).write_png("knot.png")?;
/// # Ok::<(), zmend::Error>(())
/// ```
pub fn render(meshes: &[&Mesh], view: &View) -> Image {
    render_with(meshes, &[], view)
}

/// A quadrilateral in a colour of its own: a membrane of a cut or a fill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Membrane {
    /// The corners, in model units.
    pub corners: [DVec3; 4],
    /// Red, green, blue (sRGB).
    pub colour: [u8; 3],
}

/// [`render`], and membranes over each of the meshes, seen through them.
pub fn render_with(meshes: &[&Mesh], membranes: &[Membrane], view: &View) -> Image {
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
                if view.defects {
                    canvas.mark(mesh, &placed, &defects::marks(mesh), MARK_WIDTH * f64::from(fine));
                }
                let place = |p: DVec3| (camera.project(p) - center) * scale + middle;
                let halves = |membrane: &Membrane| {
                    let ([a, b, c, d], light) = (membrane.corners.map(place), canvas::decode(membrane.colour));
                    [([a, b, c], light), ([a, c, d], light)]
                };
                canvas.lay_over(&membranes.iter().flat_map(halves).collect::<Vec<_>>());
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

/// Half the width of an edge in pixels; its two faces draw a half each.
const WIRE_WIDTH: f32 = 0.4;

/// The width of a marked edge in pixels.
const MARK_WIDTH: f64 = 3.0;

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

#[cfg(test)]
mod tests {
    use super::canvas::{BACKGROUND, encode};
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
    fn membranes_are_seen_through_the_mesh() {
        let ball = sample::build("sphere", 2).unwrap();
        let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, z]| 0.2 * DVec3::new(x, 0.0, z));
        let membranes = [Membrane { corners: square, colour: [5, 200, 30] }];
        let view = View { azimuth: -90.0, elevation: 0.0, ..small() };
        let [plain, marked] = [&membranes[..0], &membranes].map(|membranes| render_with(&[&ball], membranes, &view));
        assert_eq!(plain, render(&[&ball], &view));
        let pairs = || plain.rgb.as_chunks::<3>().0.iter().zip(marked.rgb.as_chunks::<3>().0);
        let changed: Vec<_> = pairs().filter(|(a, b)| a != b).map(|(_, b)| b).collect();
        // A fifth of the ball's diameter, which is nine tenths of the height.
        let expected = (0.2f64 * 0.9 * 300.0).powi(2);
        assert!((changed.len() as f64 / expected - 1.0).abs() < 0.05, "{} for {expected}", changed.len());
        assert!(changed.iter().all(|[r, g, b]| g > r && g > b));
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
    fn defects_are_marked_in_their_colours() {
        // How many pixels are more green, more violet, or more yellow than any surface is.
        let marked = |name: &str| {
            let mesh = sample::build(name, 1).unwrap();
            let image = render(&[&mesh], &View { defects: true, ..small() });
            let pixels = image.rgb.as_chunks::<3>().0;
            let count = |test: fn([i32; 3]) -> bool| pixels.iter().filter(|p| test(p.map(i32::from))).count();
            [
                count(|[r, g, b]| g > r + 40 && g > b + 40),
                count(|[r, g, b]| r > g + 60 && b > g + 60),
                count(|[r, g, b]| r > b + 60 && g > b + 60),
            ]
        };
        assert_eq!(marked("torus"), [0; 3]);
        let [open, doubled, crossing] = ["knot-holes", "doubled", "overlap"].map(marked);
        // Green over the red behind is a little yellow where they meet.
        assert!(open[0] > 500 && open[1] == 0 && open[2] < 100, "{open:?}");
        assert!(doubled[1] > 1000 && crossing[2] > 1000 && crossing[0] == 0, "{doubled:?} {crossing:?}");
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
        let scenes = ["cube", "scan", "gear"].map(|name| sample::build(name, 2).unwrap());
        let view = View { width: 1800, height: 600, wireframe: true, elevation: 40.0, ..View::default() };
        render(&scenes.each_ref(), &view).write_png(folder.join("wires.png")).unwrap();
    }
}
