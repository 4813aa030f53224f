//! All surfaces against each other, on volumes of signs.

use super::*;
use crate::geom::Frame;
use crate::grid::Axis;
use crate::mesh::{Mesh, MeshSizes};
use crate::octree::SignedOctree;
use crate::octree::crossings::{Builder, Sample, Toggle, finest_element};
use crate::progress::Silent;
use crate::sign::parity_signs;
use glam::DVec3;
use proptest::prelude::*;
use rayon::prelude::*;

const DEPTH: u32 = 5;
const N: u32 = 1 << DEPTH;

/// The octree of a sign volume; crossings as `sample` says.
fn octree_of(depth: u32, inside: impl Fn([u32; 3]) -> bool, mut sample: impl FnMut() -> Sample) -> SignedOctree {
    let n = 1 << depth;
    let mut toggles = Vec::new();
    for i in 0..u32::pow(n, 3) {
        let at = [i / n / n, i / n % n, i % n];
        for axis in Axis::ALL {
            let mut end = at;
            end[axis.index()] += 1;
            if inside(at) != inside(end) {
                toggles.push(Toggle { edge: finest_element(depth, at, axis.into()), sample: sample() });
            }
        }
    }
    parity_signs(Builder::new(depth, true).finish().toggled(toggles))
}

/// The same with crossings at pseudo-random places.
fn octree(inside: impl Fn([u32; 3]) -> bool) -> SignedOctree {
    let mut state = 12345u32;
    octree_of(DEPTH, inside, || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        Sample::new((state >> 16) as u16, state as u16 % 0xfe00)
    })
}

fn frame() -> Frame {
    Frame::new(DVec3::ZERO, f64::from(N), DEPTH).unwrap()
}

/// All surfaces of an octree.
fn surfaces(octree: &SignedOctree) -> Vec<Mesh> {
    surfaces_in(octree, &frame())
}

fn surfaces_in(octree: &SignedOctree, frame: &Frame) -> Vec<Mesh> {
    let collect = |extract: &dyn Fn(&mut Mesh) -> MeshSizes| {
        let mut mesh = Mesh::default();
        let sizes = extract(&mut mesh);
        let found = MeshSizes {
            points: mesh.points.len() as u64,
            faces: mesh.faces.len() as u64,
            corners: mesh.faces.corners().len() as u64,
        };
        assert_eq!(found, sizes, "sizes are known beforehand");
        mesh
    };
    let dual = |placement, triangles, intersections| {
        let options = DualOptions { placement, triangles, intersections };
        collect(&|mesh| dual_contouring(octree, frame, &options, mesh, &Silent).unwrap())
    };
    vec![
        collect(&|mesh| marching_cubes(octree, frame, mesh, &Silent).unwrap()),
        dual(Placement::SharpFeatures, true, Intersections::Allow),
        dual(Placement::SharpFeatures, false, Intersections::Allow),
        dual(Placement::MassPoint, false, Intersections::Allow),
        dual(Placement::Centre, false, Intersections::Allow),
        dual(Placement::Centre, true, Intersections::Avoid),
        dual(Placement::SharpFeatures, true, Intersections::Avoid),
        dual(Placement::SharpFeatures, false, Intersections::Avoid),
        dual(Placement::MassPoint, true, Intersections::Avoid),
        dual(Placement::MassPoint, false, Intersections::Avoid),
    ]
}

fn check(octree: &SignedOctree) -> Vec<Mesh> {
    check_with(octree, &frame())
}

fn check_with(octree: &SignedOctree, frame: &Frame) -> Vec<Mesh> {
    assert_eq!(octree.validate(), Ok(()));
    let surfaces = surfaces_in(octree, frame);
    for (i, mesh) in surfaces.iter().enumerate() {
        assert_eq!(mesh.validate(), Ok(()), "surface {i}");
    }
    surfaces
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// Noise of any density: every cell case next to every other.
    #[test]
    fn random_signs_give_closed_manifolds(seed in any::<u64>(), density in 1u64..8) {
        let inside = |p: [u32; 3]| {
            let hash = p.iter().fold(seed, |h, &c| (h ^ u64::from(c)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29));
            p.iter().all(|&c| (9..23).contains(&c)) && hash % 8 < density
        };
        let surfaces = check(&octree(inside));
        // All extractors agree on the topology.
        let reports: Vec<_> = surfaces.iter().map(Mesh::report).collect();
        for report in &reports {
            prop_assert_eq!(report.components, reports[0].components);
            prop_assert_eq!(report.genus, reports[0].genus);
            prop_assert!(report.volume > 0.0);
        }
    }
}

#[test]
fn a_box_is_a_box() {
    let octree = octree(|p| p.iter().all(|&c| (6..18).contains(&c)));
    for mesh in check(&octree) {
        let report = mesh.report();
        assert_eq!((report.components, report.genus), (1, Some(0)));
        assert!(report.volume > 11f64.powi(3) && report.volume < 13f64.powi(3), "{}", report.volume);
    }
}

#[test]
fn nothing_is_nothing() {
    for mesh in check(&octree(|_| false)) {
        assert!(mesh.points.is_empty() && mesh.faces.is_empty());
    }
}

/// The two opposite corners outside of a cell are joined through it: a tunnel.
#[test]
fn outside_is_joined_through_corners() {
    let (a, b) = ([10, 10, 10], [11, 11, 11]);
    let octree = octree(|p| p.iter().all(|&c| (8..14).contains(&c)) && p != a && p != b);
    for mesh in check(&octree) {
        assert_eq!(mesh.report().components, 2, "one cavity, not two");
    }
}

#[test]
fn threads_make_no_difference() {
    let octree = octree(|p| p.iter().all(|&c| (2..30).contains(&c)) && (p[0] * 7 + p[1] * 3 + p[2]) % 5 < 2);
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    assert_eq!(pool(1).install(|| surfaces(&octree)), pool(3).install(|| surfaces(&octree)));
}

/// Exact integer coordinates: 2^30 a cell.
type Point = [i128; 3];

fn difference(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: Point, b: Point) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn normal([a, b, c]: [Point; 3]) -> Point {
    cross(difference(b, a), difference(c, a))
}

/// The side of a triangle's plane on which a point lies: 1, 0, -1.
fn side(t: [Point; 3], p: Point) -> i128 {
    dot(normal(t), difference(p, t[0])).signum()
}

/// Whether a segment and a triangle have a point in common, ends and sides included.
fn meets(segment: [Point; 2], t: [Point; 3]) -> bool {
    let [p, q] = segment;
    let (sp, sq) = (side(t, p), side(t, q));
    if sp * sq > 0 {
        return false;
    }
    if (sp, sq) != (0, 0) {
        let turns = [0, 1, 2].map(|i| side([p, q, t[i]], t[(i + 1) % 3]));
        return turns.iter().all(|&s| s >= 0) || turns.iter().all(|&s| s <= 0);
    }
    // In the plane: above it, a point makes turns in the plane sides of planes.
    let n = normal(t);
    let turn = |a: Point, b: Point, c: Point| dot(n, normal([a, b, c])).signum();
    let holds = |p: Point| (0..3).all(|i| turn(t[i], t[(i + 1) % 3], p) >= 0);
    let crosses = |a: Point, b: Point| {
        turn(a, b, p) * turn(a, b, q) <= 0
            && turn(p, q, a) * turn(p, q, b) <= 0
            && [turn(a, b, p), turn(a, b, q)] != [0, 0]
    };
    holds(p) || holds(q) || (0..3).any(|i| crosses(t[i], t[(i + 1) % 3]))
}

/// Whether two triangles of a mesh have more in common than the corners that they share and what is between these.
fn intersect(points: &[Point], s: [u32; 3], t: [u32; 3]) -> bool {
    let place = |t: [u32; 3]| t.map(|i| points[i as usize]);
    let own = |s: [u32; 3], t: [u32; 3]| s.into_iter().filter(|i| !t.contains(i)).collect::<Vec<u32>>();
    match (&own(s, t)[..], &own(t, s)[..]) {
        (&[c], &[d]) => {
            let shared: Vec<u32> = s.into_iter().filter(|i| t.contains(i)).collect();
            let [a, b, c, d] = [shared[0], shared[1], c, d].map(|i| points[i as usize]);
            let (nc, nd) = (normal([a, b, c]), normal([a, b, d]));
            cross(nc, nd) == [0; 3] && dot(nc, nd) >= 0
        }
        (&[b, c], &[d, e]) => {
            let at = |i: u32| points[i as usize];
            meets([at(b), at(c)], place(t)) || meets([at(d), at(e)], place(s))
        }
        ([_, _, _], _) => {
            let sides = |t: [Point; 3]| [0, 1, 2].map(|i| [t[i], t[(i + 1) % 3]]);
            sides(place(s)).into_iter().any(|side| meets(side, place(t)))
                || sides(place(t)).into_iter().any(|side| meets(side, place(s)))
        }
        _ => true,
    }
}

/// All pairs of triangles that intersect. Quadrilaterals are cut at the first diagonal or at the second.
fn intersections(mesh: &Mesh, second: bool) -> Vec<[[u32; 3]; 2]> {
    let points: Vec<Point> =
        mesh.points.iter().map(|p| p.to_array().map(|c| (c * f64::from(1 << 30)) as i128)).collect();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for face in mesh.faces.iter() {
        match *face {
            [a, b, c] => triangles.push([a, b, c]),
            [a, b, c, d] if second => triangles.extend([[b, c, d], [b, d, a]]),
            [a, b, c, d] => triangles.extend([[a, b, c], [a, c, d]]),
            _ => panic!("{} corners", face.len()),
        }
    }
    let range = |t: [u32; 3], k: usize| {
        let c = t.map(|i| points[i as usize][k]);
        (c[0].min(c[1]).min(c[2]), c[0].max(c[1]).max(c[2]))
    };
    let boxes = |t: [u32; 3]| [0, 1, 2].map(|k| range(t, k));
    let mut boxed: Vec<_> = triangles.into_iter().map(|t| (boxes(t), t)).collect();
    boxed.sort_unstable();
    let mut found = Vec::new();
    for (i, (of_s, s)) in boxed.iter().enumerate() {
        let near = boxed[i + 1..].iter().take_while(|(of_t, _)| of_t[0].0 <= of_s[0].1);
        let near = near.filter(|(of_t, _)| (1..3).all(|k| of_t[k].0 <= of_s[k].1 && of_s[k].0 <= of_t[k].1));
        found.extend(near.filter(|(_, t)| intersect(&points, *s, *t)).map(|(_, t)| [*s, *t]));
    }
    found
}

/// The check that the next test relies on finds what there is.
#[test]
fn intersections_are_found() {
    let cube = octree(|p| p.iter().all(|&c| (6..9).contains(&c)));
    let mesh = surfaces(&cube).remove(0);
    assert_eq!(intersections(&mesh, false).len(), 0);
    let mut pushed = mesh.clone();
    // Through the opposite side.
    pushed.points[0] = 2.0 * DVec3::splat(7.0) - pushed.points[0] + DVec3::splat(0.01);
    assert!(intersections(&pushed, false).len() > 2);
    // Folded onto itself: the corner of a triangle mirrored at the opposite side.
    let flat = |d: [f64; 2]| Mesh {
        points: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], d].map(|[x, y]| DVec3::new(x, y, x + y)).to_vec(),
        faces: [&[0, 1, 2][..], &[1, 0, 3]].into_iter().collect(),
    };
    assert_eq!(intersections(&flat([0.5, -1.0]), false).len(), 0);
    assert_eq!(intersections(&flat([0.5, 0.5]), false).len(), 1);
}

/// Random signs round the common corner of eight bricks, with crossings and normals as random as can be: surfaces that say so have no
/// intersections, whichever way quadrilaterals are cut. Those that do not say so have thousands, or the test would mean little.
#[test]
fn nothing_intersects_that_should_not() {
    const MAY: [usize; 3] = [1, 2, 3];
    let frame = Frame::new(DVec3::ZERO, 16.0, 4).unwrap();
    let of_seed = |seed: u64| {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut chance = move || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ z >> 31
        };
        let (signs, more) = (chance(), chance());
        let signs = [signs, signs & more, signs | more][seed as usize % 3];
        let inside = |p: [u32; 3]| {
            let [x, y, z] = p.map(|c| c.wrapping_sub(6));
            x < 4 && y < 4 && z < 4 && signs >> (16 * x + 4 * y + z) & 1 == 1
        };
        let octree = octree_of(4, inside, || {
            let bits = chance();
            // In three of four volumes half of the crossings are as near to lattice points as can be.
            let offset = match (seed % 4, bits >> 60) {
                (0, _) | (_, 0..8) => bits as u16,
                (_, 8..12) => 0,
                _ => u16::MAX,
            };
            Sample::new(offset, (bits >> 16) as u16 % 0xff00)
        });
        let surfaces = check_with(&octree, &frame);
        surfaces.iter().map(|mesh| [false, true].map(|second| intersections(mesh, second).len())).collect::<Vec<_>>()
    };
    let found: Vec<_> = (0..500).into_par_iter().map(of_seed).collect();
    for (seed, surfaces) in found.iter().enumerate() {
        for (i, found) in surfaces.iter().enumerate().filter(|(i, _)| !MAY.contains(i)) {
            assert_eq!(found, &[0, 0], "seed {seed}, surface {i}");
        }
    }
    let that_may: usize = found.iter().map(|surfaces| MAY.map(|i| surfaces[i][0]).iter().sum::<usize>()).sum();
    assert!(that_may > 1000, "{that_may}");
}
