//! Solids to try things on, clean ones and broken ones, made from formulas: the same bytes on every machine and run.

pub mod create;
mod damage;
mod shape;

use super::Mesh;
use super::chance::Chance;
use crate::error::{Error, Result};
use create::{Platonic, finer, platonic, zonohedron};
use damage::{Carelessness, careless, without, without_loose_points};
use glam::{DMat3, DQuat, DVec2, DVec3, EulerRot, IVec3};
use shape::{arc, band, cells, cylinder, extrude, hole, moved, sphere, together, triangles, tube, wrapped};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The greatest detail: some millions of triangles.
pub const MAX_DETAIL: u32 = 20;

/// A sample: its name, what it is, and how it is made at a detail.
type Sample = (&'static str, &'static str, fn(u32) -> Mesh);

const SAMPLES: &[Sample] = &[
    ("knot", "a tube along a (2,3) torus knot; clean, genus 1", knot),
    ("knot-holes", "the knot with seven patches missing", knot_holes),
    ("gear", "a gear of four sheets with gaps; faces flipped, doubled, missing, and hanging loose", gear),
    ("overlap", "a soup of boxes, balls and cylinders that overlap", overlap),
    ("scan", "a bumpy blob as scanned: no underside, five holes, mild noise", scan),
    ("noisy", "a bent clamp with 72 tiny bridges, tunnels and loops; clean, genus 72 instead of 0", noisy),
    ("part", "a machined bracket with sharp edges, a fillet and two holes, turned askew; clean, genus 2", part),
    ("sphere", "a ball; clean", |detail| sphere(24 * detail as i32, |p| p)),
    ("torus", "a torus; clean, genus 1", |detail| torus(96 * detail, 40 * detail)),
    ("cube", "a unit cube of quads, six at detail 1; clean", cube),
    ("tetrahedron", "four triangles at detail 1; clean", |detail| solid(Platonic::Tetrahedron, detail)),
    ("octahedron", "eight triangles at detail 1; clean", |detail| solid(Platonic::Octahedron, detail)),
    ("dodecahedron", "twelve pentagons cut into triangles; clean", |detail| solid(Platonic::Dodecahedron, detail)),
    ("icosahedron", "twenty triangles at detail 1; clean", |detail| solid(Platonic::Icosahedron, detail)),
    ("zonohedron", "thirty rhombs cut into triangles; clean", rhombs),
    ("plate", "an open square of two triangles at detail 1", plate),
    ("nested", "a ball in the cavity of a ball; clean, three surfaces", nested),
    ("doubled", "a torus with every face twice, half of the copies flipped", doubled),
    ("nan", "a ball with points at no place, faces without area, and lines for faces", nan),
];

/// Name and one-line description of every sample that [`build`] makes.
pub fn names() -> &'static [(&'static str, &'static str)] {
    const NAMES: [(&str, &str); SAMPLES.len()] = {
        let mut names = [("", ""); SAMPLES.len()];
        let mut i = 0;
        while i < SAMPLES.len() {
            names[i] = (SAMPLES[i].0, SAMPLES[i].1);
            i += 1;
        }
        names
    };
    &NAMES
}

/// Makes a sample about one to six model units large.
///
/// Detail 1 means some thousand to twenty thousand triangles (some dozen for polyhedra and `plate`), and their number
/// grows with its square; shape and defects stay, where they are not single faces.
///
/// # Errors
/// When there is no sample of that name, or detail is not in `1 ..= `[`MAX_DETAIL`].
pub fn build(name: &str, detail: u32) -> Result<Mesh> {
    if !(1..=MAX_DETAIL).contains(&detail) {
        return Err(Error::setting("detail", format!("{detail} is not in 1 to {MAX_DETAIL}"), "1 is the default"));
    }
    if let Some((_, _, make)) = SAMPLES.iter().find(|sample| sample.0 == name) {
        return Ok(make(detail));
    }
    let known: Vec<&str> = SAMPLES.iter().map(|sample| sample.0).collect();
    Err(Error::setting("sample", format!("there is no `{name}`"), format!("take one of {}", known.join(", "))))
}

/// Quads along the knot and around its tube at detail 1.
const KNOT: [u32; 2] = [280, 36];

fn knot(detail: u32) -> Mesh {
    tube(KNOT[1] * detail, KNOT[0] * detail, 0.42, |t| {
        let ((sin2, cos2), (sin3, cos3)) = ((2.0 * TAU * t).sin_cos(), (3.0 * TAU * t).sin_cos());
        DVec3::new((2.0 + cos3) * cos2, (2.0 + cos3) * sin2, sin3)
    })
}

fn knot_holes(detail: u32) -> Mesh {
    let knot = knot(detail);
    let [along, around] = KNOT.map(|n| n * detail);
    let center = |k: u32| knot.points[(k * along / 7 * around + (11 * k * detail) % around) as usize];
    let centers: Vec<DVec3> = (0..7).map(center).collect();
    let radius = |k: usize| 0.16 + 0.03 * k as f64;
    let in_patch = |_, p: DVec3| centers.iter().enumerate().any(|(k, &center)| p.distance(center) < radius(k));
    without_loose_points(&without(&knot, in_patch))
}

fn gear(detail: u32) -> Mesh {
    let (teeth, hub, thickness, gap) = (12.0, 0.45, 0.6, 0.012);
    // A tooth: root, flank, tip, flank; its corners lie on samples of the outline.
    let rim = |turn: f64| {
        let phase = (teeth * turn).fract();
        let height = ((phase - 0.3) / 0.15).min((0.95 - phase) / 0.15).clamp(0.0, 1.0);
        1.6 + 0.4 * height
    };
    let at = |turn: f64, radius: f64, z: f64| (radius * DVec2::from_angle(TAU * turn)).extend(z);
    let (around, half) = (240 * detail, 0.5 * thickness);
    let wall = |radius: &dyn Fn(f64) -> f64, [from, to]: [f64; 2]| {
        band(around, 5 * detail, |turn, v| at(turn, radius(turn), from + (to - from) * v))
    };
    let lid = |z: f64, [inner, outer]: [f64; 2]| {
        band(around, 10 * detail, |turn, v| {
            let [from, to] = [inner, outer].map(|part| hub + (rim(turn) - hub) * part);
            at(turn, from + (to - from) * v, z)
        })
    };
    let parts = [
        wall(&rim, [-half, half]),
        wall(&|_| hub + gap, [half, -half]),
        lid(half + gap, [1.0, 0.0]),
        lid(-half - gap, [0.0, 1.0]),
    ];
    let how = Carelessness { missing: 0.03, flipped: 0.1, doubled: 0.05, hanging: 0.004 };
    careless(&together(&parts), &how, &mut Chance(12))
}

fn overlap(detail: u32) -> Mesh {
    let unit = triangles(&cube(4 * detail));
    let boxed = |size: [f64; 3], turn: DQuat, shift: [f64; 3]| {
        moved(unit.clone(), |p| turn * ((p - 0.5) * DVec3::from_array(size)) + DVec3::from_array(shift))
    };
    let ball = |radius: f64, shift: [f64; 3]| sphere(10 * detail as i32, |p| radius * p + DVec3::from_array(shift));
    let rod = |radius: f64, height: f64, turn: DQuat, shift: [f64; 3]| {
        moved(cylinder(radius, height, 40 * detail, 8 * detail), |p| turn * p + DVec3::from_array(shift))
    };
    together(&[
        boxed([3.0, 2.0, 0.5], DQuat::IDENTITY, [0.0, 0.0, 0.0]),
        boxed([0.6, 0.6, 2.2], DQuat::from_rotation_z(0.4), [-0.9, 0.3, 0.9]),
        boxed([2.4, 0.4, 0.4], DQuat::from_rotation_y(-0.5), [0.1, -0.5, 0.8]),
        ball(0.7, [-0.9, 0.3, 2.1]),
        ball(0.8, [1.1, 0.4, 0.5]),
        ball(0.5, [0.3, 0.9, 0.1]),
        rod(0.3, 2.6, DQuat::IDENTITY, [1.1, 0.4, 0.6]),
        rod(0.22, 2.8, DQuat::from_rotation_y(FRAC_PI_2), [0.0, 0.3, 1.5]),
    ])
}

fn scan(detail: u32) -> Mesh {
    let mut chance = Chance(5);
    let blob = sphere(40 * detail as i32, |p| {
        let bumps = (3.0 * p.x + 1.0).sin() * (2.5 * p.y).cos() + 0.5 * (5.0 * p.z + 2.0 * p.x).sin();
        let ripple = 0.06 * (11.0 * p.y + 4.0 * p.z).sin() * (9.0 * p.x).cos();
        (1.2 + 0.2 * bumps + ripple) * p
    });
    let holes = [[0.9, -0.3, 0.3], [0.1, -0.9, 0.4], [-0.2, 0.3, 0.95], [-0.9, -0.1, -0.2], [0.5, 0.8, 0.1]];
    let radius = |k: usize| 0.09 + 0.03 * k as f64;
    let in_hole = |p: DVec3| {
        holes
            .iter()
            .enumerate()
            .any(|(k, &hole)| p.normalize().distance(DVec3::from_array(hole).normalize()) < radius(k))
    };
    let open = without_loose_points(&without(&blob, |_, p| p.z < -0.55 || in_hole(p)));
    moved(open, |p| p + chance.within_cube(0.008 / f64::from(detail)))
}

/// Two plates joined at one end, with bridges across the slit, tunnels through the upper plate, loops on top of it.
fn noisy(detail: u32) -> Mesh {
    // Sizes of the coarse cells: six by six to a period, the second and fifth of them thin; layers from below.
    const PERIODS: i32 = 6;
    const SPAN: [f64; 6] = [0.26, 0.08, 0.16, 0.16, 0.08, 0.26];
    const LAYERS: [f64; 8] = [0.3, 0.3, 0.09, 0.09, 0.3, 0.3, 0.08, 0.06];
    let solid = |c: IVec3| {
        let (period, x, y) = (c.x / 6 + c.y / 6, c.x % 6, c.y % 6);
        let (bridged, odd) = ((x, y) == (1, 1), period % 2 == 1);
        match c.z {
            _ if c.x >= 6 * PERIODS => c.z < 6,
            0 | 1 => true,
            2 | 3 => bridged,
            4 | 5 => !(odd && (x, y) == (4, 1)),
            6 => !odd && y == 4 && (x == 1 || x == 4),
            _ => !odd && y == 4 && (1..=4).contains(&x),
        }
    };
    let detail = detail as i32;
    let along = |i: i32, sizes: &[f64]| {
        let (whole, part) = (i / detail, f64::from(i % detail) / f64::from(detail));
        let size = |k: i32| sizes[k as usize % sizes.len()];
        (0..whole).map(size).sum::<f64>() + part * size(whole)
    };
    let size = detail * IVec3::new(6 * PERIODS + 1, 6 * PERIODS, 8);
    let clamp = cells(
        size,
        |c| solid(c / detail),
        |p| {
            let flat = DVec3::new(along(p.x, &SPAN), along(p.y, &SPAN), along(p.z, &LAYERS));
            // Bent around the y axis, 4 units below.
            let (sin, cos) = ((flat.x - 3.0) / 5.0).sin_cos();
            DVec3::new((4.0 + flat.z) * sin, flat.y - 3.0, (4.0 + flat.z) * cos - 4.0)
        },
    );
    triangles(&clamp)
}

fn part(detail: u32) -> Mesh {
    let n = 16 * detail;
    let at = DVec2::new;
    let mut outline = vec![at(0.0, 0.0)];
    outline.extend(arc(at(4.4, 0.4), 0.4, [-FRAC_PI_2, 0.0], n));
    outline.push(at(4.8, 1.0));
    outline.extend(arc(at(1.8, 1.8), 0.8, [3.0 * FRAC_PI_2, PI], n));
    outline.extend(arc(at(0.5, 3.2), 0.5, [0.0, PI], 2 * n));
    let holes = [hole(at(0.5, 3.2), 0.28, 4 * n), hole(at(3.5, 0.5), 0.26, 4 * n)];
    let turn = DMat3::from_euler(EulerRot::XYZ, 1.2, 0.35, 0.5);
    moved(extrude(&outline, &holes, [-0.9, 0.9], 1), |p| turn * (p - DVec3::new(1.8, 1.3, 0.0)))
}

fn torus(around: u32, across: u32) -> Mesh {
    wrapped(around, across, |turn, angle| {
        let (sin, cos) = (TAU * angle).sin_cos();
        ((1.0 + 0.4 * cos) * DVec2::from_angle(TAU * turn)).extend(0.4 * sin)
    })
}

fn cube(detail: u32) -> Mesh {
    cells(IVec3::splat(detail as i32), |_| true, |p| p.as_dvec3() / f64::from(detail))
}

fn solid(solid: Platonic, detail: u32) -> Mesh {
    finer(&platonic(solid), detail)
}

/// The zonohedron of the six axes through the corners of an icosahedron.
fn rhombs(detail: u32) -> Mesh {
    let corners = platonic(Platonic::Icosahedron).points;
    let first = |i: &usize| corners[..*i].iter().all(|p| p.distance(-corners[*i]) > 0.5);
    let axes: Vec<DVec3> = (0..corners.len()).filter(first).map(|i| 0.5 * corners[i]).collect();
    finer(&zonohedron(&axes).expect("six axes in space"), detail)
}

fn plate(detail: u32) -> Mesh {
    without_loose_points(&triangles(&without(&cube(detail), |_, p| p.z > 0.0)))
}

fn nested(detail: u32) -> Mesh {
    let ball = |n: i32, radius: f64| sphere(n * detail as i32, move |p| radius * p);
    together(&[ball(24, 1.0), sphere(18 * detail as i32, |p| -0.75 * p), ball(12, 0.45)])
}

fn doubled(detail: u32) -> Mesh {
    let torus = torus(96 * detail, 40 * detail);
    let mut chance = Chance(2);
    let mut twice = torus.clone();
    for &[a, b, c] in torus.faces.corners().as_chunks().0 {
        twice.faces.push(&if chance.happens(0.5) { [a, b, c] } else { [c, b, a] });
    }
    twice
}

fn nan(detail: u32) -> Mesh {
    let mut mesh = sphere(24 * detail as i32, |p| p);
    let n = mesh.points.len();
    mesh.points[n / 3] = DVec3::NAN;
    mesh.points[n / 2].z = f64::INFINITY;
    mesh.points[2 * n / 3].x = f64::NAN;
    let loose = n as u32;
    mesh.points.extend([-0.5, 0.0, 0.25].map(DVec3::splat));
    mesh.faces.push(&[loose, loose + 1, loose + 2]);
    for face in [&[0u32, 0, 1][..], &[5, 5, 5], &[7, 8], &[9]] {
        mesh.faces.push(face);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Report;

    fn report(name: &str) -> Report {
        build(name, 1).unwrap().report()
    }

    #[test]
    fn clean_samples_are_clean_at_any_detail() {
        for (name, components, genus) in [
            ("knot", 1, 1),
            ("noisy", 1, 72),
            ("part", 1, 2),
            ("sphere", 1, 0),
            ("torus", 1, 1),
            ("cube", 1, 0),
            ("tetrahedron", 1, 0),
            ("octahedron", 1, 0),
            ("dodecahedron", 1, 0),
            ("icosahedron", 1, 0),
            ("zonohedron", 1, 0),
            ("nested", 3, 0),
        ] {
            for detail in [1, 2, 3] {
                let mesh = build(name, detail).unwrap();
                assert_eq!(mesh.validate(), Ok(()), "{name} {detail}");
                let report = mesh.report();
                assert_eq!((report.components, report.genus), (components, Some(genus)), "{name} {detail}");
                assert_eq!(report.zero_area_faces + report.duplicate_faces + report.isolated_points, 0, "{name}");
                assert!(report.volume > 0.0 && report.bounds.extent().max_element() < 8.0, "{name}: {report:?}");
            }
        }
    }

    #[test]
    fn volumes_and_areas_are_those_of_the_formulas() {
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 0.01, "{a} {b}");
        close(report("sphere").volume, 4.0 / 3.0 * PI);
        close(report("torus").volume, 2.0 * PI * PI * 0.4 * 0.4);
        close(report("cube").volume, 1.0);
        close(report("nested").volume, 4.0 / 3.0 * PI * (1.0 - 0.75f64.powi(3) + 0.45f64.powi(3)));
        close(report("plate").area, 1.0);
        // An L with its fillet and roundings, less two holes, 1.8 thick.
        let corner = |r: f64| (1.0 - PI / 4.0) * r * r;
        let outline = 4.8 + 2.2 + 0.5 * PI * 0.25 + corner(0.8) - corner(0.4);
        close(report("part").volume, 1.8 * (outline - PI * (0.28 * 0.28 + 0.26 * 0.26)));
    }

    #[test]
    fn open_samples_have_their_holes() {
        let holes = report("knot-holes");
        assert_eq!((holes.boundary_loops, holes.components, holes.isolated_points), (7, 1, 0));
        assert!(holes.is_manifold() && holes.is_oriented());
        let scan = report("scan");
        assert_eq!((scan.boundary_loops, scan.components, scan.isolated_points), (6, 1, 0));
        assert!(scan.is_manifold() && scan.is_oriented());
        let plate = report("plate");
        assert_eq!((plate.faces, plate.points, plate.boundary_edges, plate.boundary_loops), (2, 4, 4, 1));
    }

    #[test]
    fn broken_samples_are_broken_as_described() {
        let gear = report("gear");
        assert!(gear.boundary_loops > 100 && gear.inconsistent_edges > gear.faces / 10);
        assert!(gear.non_manifold_edges > 100 && gear.duplicate_faces > gear.faces / 30);
        assert!(gear.components >= 4);
        let overlap = report("overlap");
        assert_eq!((overlap.components, overlap.genus), (8, Some(0)));
        let doubled = report("doubled");
        assert_eq!((doubled.duplicate_faces * 2, doubled.non_manifold_edges), (doubled.faces, doubled.edges));
        let nan = report("nan");
        assert_eq!((nan.non_finite_points, nan.degenerate_faces, nan.zero_area_faces), (3, 4, 1));
        assert!(!nan.is_closed() && nan.volume.is_finite() && nan.bounds.extent().is_finite());
    }

    #[test]
    fn samples_are_the_same_each_time_and_scale_with_detail() {
        for (name, _) in names() {
            let [coarse, again, fine] = [1, 1, 2].map(|detail| build(name, detail).unwrap());
            assert_eq!(format!("{coarse:?}"), format!("{again:?}"), "{name}");
            let ratio = fine.faces.len() as f64 / coarse.faces.len() as f64;
            assert!((1.9..4.3).contains(&ratio), "{name}: {ratio}");
        }
    }

    #[test]
    fn unknown_names_and_details_are_explained() {
        let message = build("cow", 1).unwrap_err().to_string();
        assert!(message.starts_with("sample: there is no `cow`; take one of knot, "), "{message}");
        assert!(build("knot", 0).is_err() && build("knot", MAX_DETAIL + 1).is_err());
    }
}
