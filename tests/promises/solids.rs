//! Solids that are damaged by chance: a seed gives a mesh and the options to repair it with, the same on every machine.
//!
//! A solid is one sample of the library, or up to three polyhedra stretched and turned. One to five harms come over it, each in a strength
//! from hardly any to total. Surfaces, rules of inside and depths take turns; everything else that can be asked for is drawn.

use crate::common::{Chance, surfaces, together, with_points};
use glam::DVec3;
use std::sync::OnceLock;
use zmend::mesh::{Bounds, sample};
use zmend::repair::{Keep, Offset, Thicken};
use zmend::{Faces, Inside, Mesh, Options, Surface, topology};

/// A mesh, what is to be made of it, and words for both.
pub(crate) struct Case {
    pub(crate) mesh: Mesh,
    pub(crate) options: Options,
    pub(crate) words: String,
}

/// Triangle soup in the making.
struct Soup {
    points: Vec<DVec3>,
    faces: Vec<Vec<u32>>,
    /// The longest side of the solid's bounds before it was harmed.
    size: f64,
}

/// What can be done to a solid, with a strength from 0 to 1.
type Harm = fn(&mut Soup, f64, &mut Chance);

const HARMS: [(&str, Harm); 22] = [
    ("missing faces", missing),
    ("holes", holes),
    ("half missing", half_missing),
    ("flips", flips),
    ("flipped patch", flipped_patch),
    ("inside out", inside_out),
    ("duplicates", duplicates),
    ("noise", noise),
    ("not finite", not_finite),
    ("slivers", slivers),
    ("flat faces", flat_faces),
    ("junk", junk),
    ("far junk", far_junk),
    ("loose points", loose_points),
    ("unwelded", unwelded),
    ("welded at random", welded_at_random),
    ("rounded", rounded),
    ("collapsed", collapsed),
    ("inner sheets", inner_sheets),
    ("big polygons", big_polygons),
    ("twice, moved a little", twice),
    ("points pulled out", pulled_out),
];

/// Half of the cases at depth 4, one in twenty at depth 7, where a case takes fifty times as long.
const DEPTHS: [u32; 20] = [4, 5, 4, 6, 4, 5, 4, 5, 4, 7, 4, 6, 4, 5, 4, 6, 5, 4, 5, 4];

/// The polyhedra: few faces, sharp edges, exact planes.
const POLYHEDRA: [&str; 8] =
    ["cube", "tetrahedron", "octahedron", "dodecahedron", "icosahedron", "zonohedron", "plate", "sphere"];

/// The case with this number.
pub(crate) fn case(number: u64) -> Case {
    let mut chance = Chance(number.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let (name, mesh) = solid(&mut chance);
    let mut words = vec![name];
    let mut soup =
        Soup { size: extent(&mesh), faces: mesh.faces.iter().map(<[u32]>::to_vec).collect(), points: mesh.points };
    for _ in 0..=chance.below(5) {
        let (name, harm) = HARMS[chance.below(HARMS.len())];
        let strength = chance.unit().powi(3);
        harm(&mut soup, strength, &mut chance);
        words.push(format!("{name} {strength:.3}"));
    }
    if chance.below(8) == 0 {
        chance.shuffle(&mut soup.faces);
    }
    let mesh = Mesh { points: soup.points, faces: soup.faces.iter().map(Vec::as_slice).collect() };
    let mesh = placed(mesh, &mut chance, &mut words);
    let options = drawn_options(number, &mesh, &mut chance, &mut words);
    Case { mesh, options, words: words.join(", ") }
}

/// The longest side of the bounds of what is finite; 0 if there is nothing, or all in one place.
fn extent(mesh: &Mesh) -> f64 {
    let mut bounds = Bounds::EMPTY;
    mesh.faces.corners().iter().for_each(|&i| bounds.add(mesh.points[i as usize]));
    if bounds.is_empty() { 0.0 } else { bounds.extent().max_element() }
}

fn solid(chance: &mut Chance) -> (String, Mesh) {
    static SAMPLES: OnceLock<Vec<Mesh>> = OnceLock::new();
    let samples = SAMPLES
        .get_or_init(|| sample::names().iter().map(|(name, _)| sample::build(name, 1).expect("a sample")).collect());
    if chance.below(12) == 0 {
        let i = chance.below(samples.len());
        return (sample::names()[i].0.to_owned(), samples[i].clone());
    }
    let mut names = Vec::new();
    let mut parts = Vec::new();
    for _ in 0..=chance.below(3) {
        let name = POLYHEDRA[chance.below(POLYHEDRA.len())];
        let i = sample::names().iter().position(|(n, _)| *n == name).expect("a sample");
        // Half of them stay along the axes, in places that grids like.
        let is_askew = chance.below(2) == 0;
        let turn = if is_askew { chance.rotation() } else { glam::DMat3::IDENTITY };
        let stretch = if is_askew { chance.point() + 0.05 } else { DVec3::splat([0.5, 1.0, 2.0][chance.below(3)]) };
        let moved = if is_askew { chance.point() } else { (4.0 * chance.point()).floor() / 4.0 };
        parts.push(with_points(&samples[i], |p| turn * (stretch * p) + moved));
        names.push(name);
    }
    (names.join(" and "), together(&parts))
}

/// Now and then huge, tiny or far away.
fn placed(mesh: Mesh, chance: &mut Chance, words: &mut Vec<String>) -> Mesh {
    match chance.below(12) {
        0 => {
            let scale = 10f64.powf(600.0 * chance.unit() - 300.0);
            words.push(format!("scale {scale:e}"));
            with_points(&mesh, |p| p * scale)
        }
        1 => {
            let by = 10f64.powf(16.0 * chance.unit()) * (2.0 * chance.point() - 1.0);
            words.push(format!("moved by {by}"));
            with_points(&mesh, |p| p + by)
        }
        2 => {
            let flat = DVec3::new(1.0, 1.0, 10f64.powf(-20.0 * chance.unit()));
            words.push(format!("flattened by {}", flat.z));
            with_points(&mesh, |p| p * flat)
        }
        3 => {
            words.push("as 32-bit floats".to_owned());
            with_points(&mesh, |p| p.as_vec3().as_dvec3())
        }
        _ => mesh,
    }
}

fn drawn_options(number: u64, mesh: &Mesh, chance: &mut Chance, words: &mut Vec<String>) -> Options {
    let turn = |n: u64, of: usize| (number / n % of as u64) as usize;
    let depth = DEPTHS[turn(1, DEPTHS.len())];
    let inside = [Inside::Auto, Inside::Parity, Inside::Winding, Inside::Hull][turn(20, 4)];
    let modes = surfaces(depth);
    let (mode, options) = modes[turn(1, modes.len())];
    let mut options = Options { inside, ..options };
    words.push(format!("{mode} by {inside:?} at depth {depth}"));
    if chance.below(8) == 0 {
        options.scale = 0.05 + 0.94 * chance.unit();
    }
    // The grid grows with widths: so many cells are a width of which both sides of the model get as much as it is. A single point has no widths.
    let (own, cells) = (extent(mesh), options.scale * f64::from(1u32 << depth));
    let extent = if own > 0.0 { own } else { 1.0 };
    let mut width = |from: f64, to: f64| {
        let wanted = from + (to - from) * chance.unit();
        (own > 0.0 && cells > 4.0 * wanted).then(|| wanted * extent / (cells - 2.0 * wanted))
    };
    let (gap, wall, offset) = (width(1.0, 6.0), width(2.1, 6.0), width(2.0, 5.0));
    let (cell, size) = (extent / cells, (1.0 + 9.0 * chance.unit()) * extent / cells);
    if options.surface == Surface::Quads && chance.below(3) == 0 {
        options.faces = Faces::Triangles;
    }
    if inside == Inside::Hull && chance.below(2) == 0 {
        options.gap = gap;
    }
    // It grows with the wider one of both.
    let wall = wall.map(|wall| wall * (1.0 + options.gap.unwrap_or(0.0) / extent));
    match chance.below(16) {
        0 => options.thicken = wall,
        1 => (options.thicken, options.thicken_what) = (wall, Thicken::All),
        2 => options.offset = offset.map(Offset::Solid),
        3 => options.offset = offset.map(|offset| Offset::Solid(-offset)),
        4 => options.offset = offset.map(Offset::Shell),
        _ => {}
    }
    options.keep = match chance.below(8) {
        0 => Keep::Largest,
        1 => Keep::Ratio(chance.unit()),
        2 => Keep::Count(1 + chance.below(3) as u32),
        _ => Keep::All,
    };
    options.drop_cavities = chance.below(6) == 0;
    let (area, volume) = (Some(size * size), Some(size * size * size));
    // What is too large or small to have a volume in model units has no topology to repair, either.
    let choice =
        if (size * size * size).is_normal() && (cell * cell * cell).is_normal() { chance.below(16) } else { 16 };
    options.topology = match choice {
        0 => topology::Options { cut: area, ..topology::Options::default() },
        1 => topology::Options { fill: area, ..topology::Options::default() },
        2 => topology::Options { genus: Some(chance.below(3) as u64), ..topology::Options::default() },
        3 => topology::Options { cut: area, fill: area, cheapest: true, ..topology::Options::default() },
        4 => topology::Options { fill_cavities: volume, drop_islands: volume, ..topology::Options::default() },
        _ => topology::Options::default(),
    };
    options
}

fn missing(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    soup.faces.retain(|_| chance.unit() >= strength);
}

/// The faces that have a point in a ball.
fn in_ball(soup: &Soup, strength: f64, chance: &mut Chance) -> impl Fn(&[u32], &[DVec3]) -> bool + use<> {
    let centre = if soup.points.is_empty() { DVec3::ZERO } else { soup.points[chance.below(soup.points.len())] };
    let radius = 0.5 * strength.sqrt() * soup.size;
    move |face, points| face.iter().any(|&i| points[i as usize].distance(centre) <= radius)
}

fn holes(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    for _ in 0..=chance.below(4) {
        let is_in = in_ball(soup, strength, chance);
        soup.faces.retain(|face| !is_in(face, &soup.points));
    }
}

fn half_missing(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let normal = chance.rotation().x_axis;
    let along = |p: &DVec3| normal.dot(*p);
    let low = soup.points.iter().map(along).fold(f64::INFINITY, f64::min);
    soup.faces.retain(|face| face.iter().all(|&i| along(&soup.points[i as usize]) >= low + strength * soup.size));
}

fn flips(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    soup.faces.iter_mut().filter(|_| chance.unit() < strength).for_each(|face| face.reverse());
}

fn flipped_patch(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let is_in = in_ball(soup, strength, chance);
    soup.faces.iter_mut().filter(|face| is_in(face, &soup.points)).for_each(|face| face.reverse());
}

fn inside_out(soup: &mut Soup, _: f64, _: &mut Chance) {
    soup.faces.iter_mut().for_each(|face| face.reverse());
}

fn duplicates(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let mut copies = Vec::new();
    for face in &soup.faces {
        if chance.unit() < strength {
            let mut copy = face.clone();
            match chance.below(3) {
                0 => copy.reverse(),
                1 if !copy.is_empty() => copy.rotate_left(1),
                _ => {}
            }
            copies.push(copy);
        }
    }
    soup.faces.append(&mut copies);
}

fn noise(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let far = strength * 0.2 * soup.size;
    soup.points.iter_mut().for_each(|p| *p += far * (2.0 * chance.point() - 1.0));
}

fn not_finite(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    const VALUES: [f64; 4] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -f64::NAN];
    for point in &mut soup.points {
        if chance.unit() < 0.1 * strength {
            point[chance.below(3)] = VALUES[chance.below(4)];
        }
    }
}

/// Faces are cut at points of their edges, which are moved off them by next to nothing.
fn slivers(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    for i in 0..soup.faces.len() {
        if soup.faces[i].len() != 3 || chance.unit() >= strength {
            continue;
        }
        let [a, b, c] = [0, 1, 2].map(|k| soup.faces[i][k]);
        let [p, q] = [a, b].map(|k| soup.points[k as usize]);
        let off = soup.size * 10f64.powf(-4.0 - 14.0 * chance.unit());
        let middle = soup.points.len() as u32;
        soup.points.push(p.lerp(q, chance.unit()) + off * (2.0 * chance.point() - 1.0));
        soup.faces[i] = vec![a, middle, c];
        soup.faces.push(vec![middle, b, c]);
        if chance.below(2) == 0 {
            soup.faces.push(vec![a, b, middle]);
        }
    }
}

/// Points, lines and faces folded onto themselves.
fn flat_faces(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    for i in 0..soup.faces.len() {
        if chance.unit() < strength {
            let face = soup.faces[i].clone();
            let (first, last) = (face.first().copied(), face.last().copied());
            soup.faces.push(match (chance.below(5), first, last) {
                (0, Some(a), _) => vec![a],
                (1, Some(a), Some(b)) => vec![a, b],
                (2, Some(a), Some(b)) => vec![a, b, a],
                (3, Some(a), _) => vec![a, a, a],
                _ => face.iter().chain(face.iter().rev()).copied().collect(),
            });
        }
    }
}

fn add_triangles(soup: &mut Soup, triangles: usize, mut point: impl FnMut() -> DVec3) {
    for _ in 0..triangles {
        let first = soup.points.len() as u32;
        soup.points.extend([point(), point(), point()]);
        soup.faces.push(vec![first, first + 1, first + 2]);
    }
}

fn junk(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let (size, count) = (soup.size, 1 + (100.0 * strength) as usize);
    let length = size * 10f64.powf(-6.0 * chance.unit());
    for _ in 0..count {
        let at = size * (1.2 * chance.point() - 0.1);
        add_triangles(soup, 1, || at + length * (chance.point() - 0.5));
    }
}

fn far_junk(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let far = soup.size * 10f64.powf(8.0 * strength);
    add_triangles(soup, 1, || far * (2.0 * chance.point() - 1.0));
}

fn loose_points(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let count = 1 + (50.0 * strength) as usize;
    soup.points.extend((0..count).map(|_| 1e6 * chance.point()));
}

fn unwelded(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    for face in &mut soup.faces {
        if chance.unit() < strength.cbrt() {
            for corner in face {
                soup.points.push(soup.points[*corner as usize]);
                *corner = soup.points.len() as u32 - 1;
            }
        }
    }
}

/// Any two points become one.
fn welded_at_random(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    for _ in 0..=(20.0 * strength) as usize {
        if soup.points.is_empty() {
            return;
        }
        let [a, b] = [0, 1].map(|_| chance.below(soup.points.len()));
        if chance.below(2) == 0 {
            soup.points[a] = soup.points[b];
        } else {
            soup.faces.iter_mut().flatten().filter(|i| **i as usize == a).for_each(|i| *i = b as u32);
        }
    }
}

/// All points move onto a coarse lattice: faces lie in each other and in planes of the grid.
fn rounded(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let step = soup.size / (2.0 + ((1.0 - strength) * 60.0 * chance.unit()).floor());
    soup.points.iter_mut().for_each(|p| *p = (*p / step).round() * step);
}

/// Points within a ball become one.
fn collapsed(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    if soup.points.is_empty() {
        return;
    }
    let centre = soup.points[chance.below(soup.points.len())];
    let radius = 0.5 * strength * soup.size;
    soup.points.iter_mut().filter(|p| p.distance(centre) <= radius).for_each(|p| *p = centre);
}

fn inner_sheets(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let n = soup.points.len();
    for _ in 0..=(10.0 * strength) as usize {
        if n > 0 {
            soup.faces.push((0..3).map(|_| chance.below(n) as u32).collect());
        }
    }
}

/// Polygons of many corners in any order.
fn big_polygons(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let n = soup.points.len();
    for _ in 0..=chance.below(3) {
        let corners = 4 + (60.0 * strength * chance.unit()) as usize;
        if n > 0 {
            soup.faces.push((0..corners).map(|_| chance.below(n) as u32).collect());
        }
    }
}

fn twice(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    let (n, by) = (soup.points.len() as u32, 0.1 * strength * soup.size * (2.0 * chance.point() - 1.0));
    soup.points.extend_from_within(..);
    soup.points[n as usize..].iter_mut().for_each(|p| *p += by);
    let copies: Vec<Vec<u32>> = soup.faces.iter().map(|face| face.iter().map(|i| i + n).collect()).collect();
    soup.faces.extend(copies);
}

fn pulled_out(soup: &mut Soup, strength: f64, chance: &mut Chance) {
    for _ in 0..=chance.below(3) {
        if !soup.points.is_empty() {
            let i = chance.below(soup.points.len());
            soup.points[i] += 3.0 * strength * soup.size * (2.0 * chance.point() - 1.0);
        }
    }
}
