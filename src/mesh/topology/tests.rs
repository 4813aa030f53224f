//! Against maps of everything, and the degenerate cases one by one.

use super::*;
use crate::mesh::sample;
use glam::DVec3;
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

fn mesh(points: usize, faces: &[&[u32]]) -> Mesh {
    let points = (0..points).map(|i| DVec3::new(i as f64, (i * i) as f64, (i % 3) as f64)).collect();
    Mesh { points, faces: faces.iter().copied().collect() }
}

const TETRAHEDRON: [&[u32]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];

/// Edges with their users, as a map says.
fn naive(mesh: &Mesh) -> BTreeMap<EdgeKey, Vec<(u32, bool)>> {
    let mut edges: BTreeMap<EdgeKey, Vec<(u32, bool)>> = BTreeMap::new();
    for (face, i) in mesh.faces.iter().zip(0..) {
        let is_sound = face.len() >= 3 && face.iter().all(|&v| (v as usize) < mesh.points.len());
        for k in (0..face.len()).filter(|_| is_sound) {
            let (a, b) = (face[k], face[(k + 1) % face.len()]);
            if a != b {
                edges.entry(EdgeKey::new(a, b)).or_default().push((i, a < b));
            }
        }
    }
    edges
}

fn check(mesh: &Mesh) {
    let topology = Topology::new(mesh);
    let edges = naive(mesh);
    let found: BTreeMap<EdgeKey, Vec<(u32, bool)>> = topology
        .edges()
        .map(|side| {
            let users = topology.users(side).map(|s| (topology.face(s), topology.ends(s)[0] < topology.ends(s)[1]));
            (topology.key(side), users.collect())
        })
        .collect();
    assert_eq!(found, edges);
    assert_eq!(topology.edges().count(), edges.len());
    for (key, users) in &edges {
        let [a, b] = key.ends();
        assert!(topology.faces_along(b, a).eq(users.iter().map(|u| u.0)));
        assert_eq!(topology.count(topology.find(a, b).unwrap()), users.len() as u32);
    }
    let mut others = vec![BTreeSet::new(); mesh.points.len()];
    let mut of_face: Vec<Vec<&Vec<(u32, bool)>>> = vec![Vec::new(); mesh.faces.len()];
    for (key, users) in &edges {
        let [a, b] = key.ends();
        others[a as usize].insert(b);
        others[b as usize].insert(a);
        users.iter().for_each(|user| of_face[user.0 as usize].push(users));
    }
    for (v, others) in (0..).zip(others) {
        assert!(topology.connected(v).eq(others));
    }
    for (face, i) in mesh.faces.iter().zip(0..) {
        let state = topology.state(i);
        let of_face = &of_face[i as usize];
        let mine = |test: fn(&[(u32, bool)]) -> bool| of_face.iter().any(|users| test(users));
        assert_eq!(state.has(FaceState::BOUNDARY), mine(|u| u.len() == 1));
        assert_eq!(state.has(FaceState::NON_MANIFOLD), mine(|u| u.len() > 2));
        assert_eq!(state.has(FaceState::INCONSISTENT), mine(|u| u.len() == 2 && u[0].1 == u[1].1));
        assert_eq!(state.has(FaceState::UNSOUND), !mesh.is_sound(face));
        let neighbours: BTreeSet<u32> = topology.neighbours(i).collect();
        let expected: BTreeSet<u32> = of_face.iter().copied().flatten().map(|u| u.0).filter(|&f| f != i).collect();
        assert_eq!(neighbours, expected);
        assert!(neighbours.iter().all(|&other| {
            let shared: Vec<u32> = topology.shared_sides(i, other).collect();
            !shared.is_empty()
                && shared.iter().all(|&side| topology.users(side).any(|user| topology.face(user) == other))
        }));
        assert_eq!(topology.shared_sides(i, i).count(), 0);
    }
    // Every boundary edge is in one chain, once.
    let mut rims: Vec<EdgeKey> =
        topology.boundary_loops().iter().flat_map(|l| &l.sides).map(|&s| topology.key(s)).collect();
    rims.sort_unstable();
    assert!(rims.iter().eq(edges.iter().filter(|(_, u)| u.len() == 1).map(|(key, _)| key)));
    for rim in topology.boundary_loops() {
        assert_eq!(rim.points.len(), rim.sides.len() + usize::from(!rim.is_closed));
        for (k, &side) in rim.sides.iter().enumerate() {
            let key = EdgeKey::new(rim.points[k], rim.points[(k + 1) % rim.points.len()]);
            assert_eq!(topology.key(side), key);
        }
    }
    assert_eq!(topology.duplicate_faces().len() as u64, mesh.report().duplicate_faces);
    let kind = topology.kind();
    let clean = !kind.is_empty && kind.is_closed_manifold();
    assert_eq!(clean, mesh.validate_indices() && !mesh.faces.is_empty(), "{kind}");
}

impl Mesh {
    /// Whether the mesh is valid, wherever its points are.
    fn validate_indices(&self) -> bool {
        Mesh { points: vec![DVec3::ZERO; self.points.len()], faces: self.faces.clone() }.validate().is_ok()
    }
}

proptest! {
    #[test]
    fn everything_agrees_with_a_map(faces in prop::collection::vec(prop::collection::vec(0u32..8, 0..6), 0..14), points in 6usize..9) {
        let faces: Vec<&[u32]> = faces.iter().map(|f| &f[..]).collect();
        check(&mesh(points, &faces));
    }

    #[test]
    fn triangles_agree_with_a_map(faces in prop::collection::vec([0u32..7, 0..7, 0..7], 0..24)) {
        let faces: Vec<&[u32]> = faces.iter().map(|f| &f[..]).collect();
        check(&mesh(7, &faces));
    }
}

#[test]
fn samples_agree_with_a_map() {
    for name in ["gear", "doubled", "nan", "knot-holes", "cube", "overlap"] {
        check(&sample::build(name, 1).unwrap());
    }
}

fn kind(points: usize, faces: &[&[u32]]) -> String {
    Topology::new(&mesh(points, faces)).kind().to_string()
}

#[test]
fn case_clean() {
    assert_eq!(kind(4, &TETRAHEDRON), "closed, manifold, oriented");
    assert_eq!(kind(4, &TETRAHEDRON[1..]), "open");
}

/// Two faces back to back are a closed surface, although one face comes twice.
#[test]
fn case_pillow() {
    let pillow = Topology::new(&mesh(3, &[&[0, 1, 2], &[0, 2, 1]])).kind();
    assert!(pillow.has_duplicates && pillow.is_closed_manifold(), "{pillow}");
}

#[test]
fn case_empty_mesh() {
    assert_eq!(kind(0, &[]), "empty");
    assert_eq!(kind(3, &[&[0, 1], &[0, 1, 9]]), "empty");
    let nothing = mesh(3, &[]);
    let topology = Topology::new(&nothing);
    assert!(topology.edges().next().is_none() && topology.corners_at(99).is_empty() && topology.find(0, 1).is_none());
    assert!(topology.diagnose().loops.is_empty());
}

#[test]
fn case_polygon_with_a_repeated_vertex() {
    let bow = mesh(5, &[&[0, 1, 2, 0, 3, 4]]);
    let topology = Topology::new(&bow);
    assert_eq!(topology.faces_at(0).collect::<Vec<_>>(), [0, 0]);
    assert_eq!(topology.kind().to_string(), "open, with bow-ties, degenerate");
    assert_eq!(topology.boundary_loops().len(), 2);
}

/// Counted as closed, and as its own neighbour.
#[test]
fn case_spike() {
    let spike = mesh(3, &[&[0, 1, 0]]);
    let topology = Topology::new(&spike);
    assert_eq!(topology.neighbours(0).count(), 0);
    assert_eq!(topology.neighbour(topology.find(0, 1).unwrap()), Neighbour::Face(0));
    let found = topology.diagnose();
    // 0 - 1 - 0 comes back at 1; from 0 to 0 it does not move.
    assert_eq!((found.spikes, found.self_edges, found.kind.has_degenerate_faces), (1, 1, true));
    let tail = mesh(5, &[&[0, 1, 2, 3, 2]]);
    assert_eq!((Topology::new(&tail).diagnose().spikes, Topology::new(&tail).diagnose().self_edges), (1, 0));
}

#[test]
fn case_self_edge() {
    let mesh = mesh(4, &[&[0, 0, 1, 2], &[1, 0, 3], &[3, 3, 3]]);
    let topology = Topology::new(&mesh);
    assert_eq!(topology.connected(0).collect::<Vec<_>>(), [1, 2, 3]);
    assert_eq!(topology.connected(3).collect::<Vec<_>>(), [0, 1]);
    assert_eq!((topology.count(0), topology.neighbour(0)), (0, Neighbour::Nobody));
    assert_eq!(topology.diagnose().self_edges, 4);
}

#[test]
fn case_duplicate_polygons() {
    let doubled = [TETRAHEDRON, TETRAHEDRON].concat();
    let mesh = mesh(4, &doubled);
    let topology = Topology::new(&mesh);
    assert_eq!(topology.duplicate_faces(), [4, 5, 6, 7]);
    assert_eq!(topology.neighbour(0), Neighbour::Many(3));
    assert_eq!(topology.kind().to_string(), "closed, non-manifold, with duplicates");
}

#[test]
fn case_bow_tie_vertex() {
    let tie: [&[u32]; 4] = [&[0, 5, 4], &[0, 4, 6], &[4, 5, 6], &[5, 0, 6]];
    let mesh = mesh(7, &[TETRAHEDRON, tie].concat());
    let topology = Topology::new(&mesh);
    assert_eq!((topology.fans(0), topology.fans(1)), (2, 1));
    assert_eq!(topology.kind().to_string(), "closed, with bow-ties");
}

#[test]
fn case_two_closed_shells_that_share_an_edge() {
    let other: [&[u32]; 4] = [&[0, 5, 1], &[0, 1, 6], &[1, 5, 6], &[5, 0, 6]];
    assert_eq!(kind(7, &[TETRAHEDRON, other].concat()), "closed, non-manifold");
}

#[test]
fn case_inconsistent_winding() {
    let mut faces = TETRAHEDRON.to_vec();
    faces[1] = &[3, 1, 0];
    assert_eq!(kind(4, &faces), "closed, inconsistent");
    assert_eq!(Topology::new(&mesh(4, &faces)).diagnose().faces_to_turn, 1);
}

#[test]
fn case_isolated_vertices() {
    let lone = mesh(6, &TETRAHEDRON);
    let topology = Topology::new(&lone);
    assert_eq!((topology.connected(5).count(), topology.faces_at(5).count(), topology.fans(5)), (0, 0, 0));
    assert_eq!(topology.kind().to_string(), "closed, manifold, oriented");
}

#[test]
fn bent_faces_are_told_from_planar_ones() {
    let square = |z: f64| vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, z), DVec3::Y, DVec3::splat(9.0)];
    let faces: [&[u32]; 4] = [&[0, 1, 2, 3], &[0, 1, 4], &[3, 2, 1, 0], &[0, 0, 0, 0]];
    for (z, bent) in [(0.0, 0), (1e-6, 0), (0.1, 2)] {
        let mesh = Mesh { points: square(z), faces: faces.into_iter().collect() };
        let topology = Topology::new(&mesh);
        assert_eq!(topology.diagnose().bent_faces, bent);
        // The corners lie a quarter of the height above and below the mean.
        let expected = 0.25 * z / 0.5f64.sqrt();
        assert!((topology.bend(0).unwrap() - expected).abs() <= 1e-2 * z && topology.bend(3).is_none());
        assert!(topology.bend(1).unwrap() < 1e-12);
    }
}

/// Bug C4.13: tables took several pieces of memory for each element.
#[test]
fn tables_take_few_bytes() {
    for name in ["knot", "gear", "scan"] {
        let mesh = sample::build(name, 1).unwrap();
        let topology = Topology::new(&mesh);
        assert!(topology.bytes() <= 40 * mesh.faces.len() as u64, "{name}");
    }
}

/// Queries at points and edges with very many faces took time with the square of their number.
#[test]
fn fans_and_books_are_no_worse_than_others() {
    let n = 100_000;
    let mut mesh = Mesh { points: (0..n + 2).map(|i| DVec3::new(f64::from(i), 1.0, 0.0)).collect(), ..Mesh::default() };
    // Every other triangle of a fan: as many rims as triangles meet in its tip.
    (1..n).step_by(2).for_each(|i| mesh.faces.push(&[0, i, i + 1]));
    let topology = Topology::new(&mesh);
    assert_eq!((topology.fans(0), topology.boundary_loops().len()), (n / 2, n as usize / 2));
    assert!(topology.kind().has_bow_ties);
    // A book: all triangles along one edge.
    mesh.faces = (2..n).map(|i| [0, 1, i]).collect::<Vec<_>>().iter().map(|f| &f[..]).collect();
    let topology = Topology::new(&mesh);
    assert_eq!(topology.edges().count(), 2 * (n as usize - 2) + 1);
    assert_eq!((topology.count(0), topology.neighbour(3)), (n - 2, Neighbour::Many(n - 3)));
    assert_eq!(topology.breadth_first(7).map(|step| step.1).max(), Some(1));
    let found = topology.diagnose();
    assert!(found.kind.has_non_manifold_edges && found.is_orientable);
    assert_eq!(topology.features(&crate::mesh::FeatureOptions::default()).non_manifold, [0]);
}

/// Rims that touch in a point are rims of their own.
#[test]
fn rims_that_touch_are_told_apart() {
    // Two triangles missing from a tetrahedron's neighbours: an octahedron without two faces that share a point only.
    let octahedron: [&[u32]; 8] =
        [&[0, 2, 4], &[2, 1, 4], &[1, 3, 4], &[3, 0, 4], &[2, 0, 5], &[1, 2, 5], &[3, 1, 5], &[0, 3, 5]];
    let open: Vec<&[u32]> =
        octahedron.iter().enumerate().filter(|(i, _)| ![0, 2].contains(i)).map(|(_, f)| *f).collect();
    let mesh = mesh(6, &open);
    let loops = Topology::new(&mesh).boundary_loops();
    assert_eq!(loops.len(), 2);
    assert!(loops.iter().all(|rim| rim.is_closed && rim.points.len() == 3 && rim.points.contains(&4)));
    let plate = sample::build("plate", 1).unwrap();
    assert_eq!(Topology::new(&plate).boundary_loops()[0].length, 4.0);
}

#[test]
fn threads_make_no_difference() {
    let gear = sample::build("gear", 1).unwrap();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let topology = Topology::new(&gear);
            (topology.rings.clone(), topology.states.clone(), topology.diagnose())
        })
    };
    assert_eq!(with(1), with(3));
}

/// Run by hand: `cargo test --release --lib mesh::topology::tests::cost -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn cost_of_ten_million_triangles() {
    let n = 2240u32;
    let at = |i: u32, j: u32| (i % n) * n + j % n;
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for (i, j) in (0..n * n).map(|q| (q / n, q % n)) {
        faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
    for shuffled in [false, true] {
        if shuffled {
            let mut chance = crate::mesh::chance::Chance(3);
            for i in (1..faces.len()).rev() {
                faces.swap(i, (chance.unit() * (i + 1) as f64) as usize);
            }
        }
        let mesh = Mesh { points: vec![DVec3::ZERO; (n * n) as usize], faces: faces.iter().map(|f| &f[..]).collect() };
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let start = std::time::Instant::now();
                let corners = Corners::new(&mesh);
                let first = start.elapsed();
                drop(corners);
                let start = std::time::Instant::now();
                let topology = Topology::new(&mesh);
                let bytes = topology.bytes() as f64 / faces.len() as f64;
                let time = start.elapsed();
                println!("shuffled: {shuffled}, {threads} threads: corners {first:.2?}, all {time:.2?}, {bytes:.1} bytes a triangle");
                assert!(bytes < 40.0 && topology.count(0) == 2);
                let start = std::time::Instant::now();
                assert!(mesh.report().is_closed());
                println!("report {:.2?}", start.elapsed());
            });
        }
    }
}
