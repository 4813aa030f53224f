//! Laws of healing, on samples and on anything.

use super::*;
use crate::mesh::chance::Chance;
use crate::mesh::sample;
use crate::progress::Silent;
use glam::DVec3;
use proptest::prelude::*;

pub(super) fn mesh(points: usize, faces: &[&[u32]]) -> Mesh {
    let points = (0..points).map(|i| DVec3::new(i as f64, (i * i) as f64, (i % 3) as f64)).collect();
    Mesh { points, faces: faces.iter().copied().collect() }
}

pub(super) fn setting() -> Setting {
    Setting { tolerance: 1e-9, max_hole_edges: 200, smooth: true, check_intersections: true, is_bold: false }
}

/// The same faces, none of which shares a point with another.
pub(super) fn soup(mesh: &Mesh) -> Mesh {
    let mut loose = Mesh::default();
    for face in mesh.faces.iter() {
        let first = loose.points.len() as u32;
        loose.points.extend(face.iter().map(|&v| mesh.points[v as usize]));
        loose.faces.push(&(first..first + face.len() as u32).collect::<Vec<_>>());
    }
    loose
}

fn heal(mesh: &Mesh) -> Healed {
    let healed = mesh.heal(&HealOptions::default(), &Silent).unwrap();
    assert!(!healed.after.is_worse_than(&healed.before), "{healed:?}");
    assert_eq!(healed.after, Defects::of(&healed.mesh, true));
    healed
}

#[test]
fn clean_meshes_come_back_bit_for_bit() {
    for name in ["knot", "noisy", "part", "sphere", "torus", "cube", "nested"] {
        let mesh = sample::build(name, 1).unwrap();
        let healed = heal(&mesh);
        assert!(healed.mesh == mesh && healed.steps.is_empty() && healed.before.is_none(), "{name}");
    }
}

#[test]
fn samples_are_healed_as_far_as_can_be() {
    for (name, left) in [("knot-holes", 0), ("doubled", 0), ("plate", 1)] {
        let healed = heal(&sample::build(name, 1).unwrap());
        assert_eq!(healed.after.holes, left, "{name}: {healed:?}");
        assert_eq!(healed.mesh.validate().is_ok(), left == 0, "{name}");
    }
    let nan = heal(&sample::build("nan", 1).unwrap());
    assert_eq!(
        (nan.after.non_finite_points, nan.after.degenerate_faces, nan.after.holes),
        (0, 0, 0),
        "{:?}",
        nan.steps
    );
    assert_eq!(nan.mesh.report().genus, Some(0));
    let gear = heal(&sample::build("gear", 1).unwrap());
    assert_eq!(gear.after.duplicate_faces, 0, "{:?}", gear.after);
    assert!(gear.after.inconsistent_edges < gear.before.inconsistent_edges / 10, "{:?}", gear.after);
    assert!(
        gear.after.boundary_edges < gear.before.boundary_edges && gear.after.holes < gear.before.holes / 4,
        "{gear:?}"
    );
    let loose = soup(&sample::build("part", 1).unwrap());
    assert!(heal(&loose).after.is_none());
}

#[test]
fn a_solid_that_looks_inwards_is_turned() {
    let ball = sample::build("sphere", 1).unwrap();
    let turned = rebuilt(&ball, |_, f, faces| faces.push(&[f[0], f[2], f[1]]));
    let healed = heal(&turned);
    assert!(healed.mesh == ball && healed.before.is_none());
    assert_eq!(healed.steps, [HealStep { name: "turned", count: ball.faces.len() as u64, is_undone: false }]);
}

/// Cancels at once.
struct Never;
impl Progress for Never {
    fn is_cancelled(&self) -> bool {
        true
    }
}

#[test]
fn settings_are_looked_at() {
    let ball = sample::build("sphere", 1).unwrap();
    for tolerance in [-1.0, f64::NAN, f64::INFINITY] {
        let message = ball.heal(&HealOptions { tolerance, ..HealOptions::default() }, &Silent).unwrap_err().to_string();
        assert!(message.starts_with("tolerance: "), "{message}");
    }
    let open = sample::build("plate", 1).unwrap();
    assert!(matches!(open.heal(&HealOptions::default(), &Never), Err(Error::Cancelled)));
}

#[test]
fn threads_make_no_difference() {
    let broken = damaged(2);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| heal(&broken))
    };
    assert!(with(1) == with(3));
}

/// A small sample with faces lost, turned, doubled, torn loose and moved.
fn damaged(seed: u64) -> Mesh {
    let mut chance = Chance(seed);
    let (name, details) = [("cube", 4), ("plate", 6), ("sphere", 1)][(seed % 3) as usize];
    let whole = sample::build(name, 1 + (seed / 3 % details) as u32).unwrap();
    let mut mesh = Mesh { points: whole.points.clone(), ..Mesh::default() };
    let rate = 0.02 + 0.2 * chance.unit();
    for face in whole.faces.iter() {
        let mut face = face.to_vec();
        if chance.happens(rate) {
            face.reverse();
        }
        for v in &mut face {
            if chance.happens(0.3 * rate) {
                let far = if chance.happens(0.5) { 1e-9 } else { 0.1 };
                mesh.points.push(mesh.points[*v as usize] + chance.within_cube(far));
                *v = mesh.points.len() as u32 - 1;
            }
            if chance.happens(0.05 * rate) {
                *v = (chance.unit() * (mesh.points.len() + 1) as f64) as u32;
            }
        }
        let copies = if chance.happens(0.5 * rate) { 2 } else { usize::from(!chance.happens(0.5 * rate)) };
        (0..copies).for_each(|_| mesh.faces.push(&face));
    }
    mesh
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// The law: no count of defects grows. And what was healed is healed: a second time changes no count.
    #[test]
    fn healing_makes_nothing_worse(seed in 0u64..1_000_000) {
        let healed = heal(&damaged(seed));
        let again = heal(&healed.mesh);
        prop_assert!(!again.after.is_worse_than(&healed.after));
    }

    #[test]
    fn healing_makes_nothing_worse_of_any_soup(faces in prop::collection::vec(prop::collection::vec(0u32..10, 0..6), 0..14)) {
        let faces: Vec<&[u32]> = faces.iter().map(|f| &f[..]).collect();
        heal(&mesh(9, &faces));
    }
}

/// Something lies so far off that the tolerance, a part of the diagonal, is wider than the model: each point was compared with each other one.
#[test]
fn crowds_are_left_alone_and_soon() {
    let mut crowd = soup(&sample::build("torus", 4).unwrap());
    let first = crowd.points.len() as u32;
    crowd.points.extend([1e9, 2e9, 3e9].map(|c| DVec3::new(c, c * c / 1e9, 1.0)));
    crowd.faces.push(&[first, first + 1, first + 2]);
    let begun = std::time::Instant::now();
    let setting = Setting { tolerance: 1e3, ..setting() };
    for step in [weld::weld, stitch::stitch] {
        let (same, count) = step(&crowd, &setting);
        assert_eq!((same == crowd, count), (true, 0));
    }
    // 369,000 points: all pairs would be some minutes.
    assert!(begun.elapsed() < std::time::Duration::from_secs(20), "{:?}", begun.elapsed());
    // With few such faces and a tolerance of the right size everything is found.
    let sound = Setting { tolerance: 1e-5, ..setting };
    assert_eq!(weld::weld(&crowd, &sound).0.report().components, 2);
}
