//! What can be said about a mesh: counts, topology, size; and whether it is the surface of a solid.
//!
//! Both [`Mesh::report`] and [`Mesh::validate`] look at one point after another together with the corners of all faces
//! there (its star). Every edge is seen whole from its lower end, every fan from its point, so no table of edges is
//! needed.

use super::tally::{sum_faces, sum_points};
use super::{Bounds, Mesh};
use rayon::prelude::*;

/// Counts, topology and size of a mesh. [`Mesh::report`] makes it, and defines the words.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Points of the mesh, used or not.
    pub points: u64,
    /// Points that sound faces use.
    pub points_used: u64,
    /// Points that no sound face uses.
    pub isolated_points: u64,
    /// Points, used or not, with a coordinate that is not finite.
    pub non_finite_points: u64,
    /// Polygons of the mesh, sound or not.
    pub faces: u64,
    /// Triangles into which the sound faces can be cut.
    pub triangles: u64,
    /// Faces that refer to a point that does not exist.
    pub dangling_faces: u64,
    /// Other faces with fewer than three corners or a point that they visit twice. Those with three corners or more are
    /// sound, and their edges count.
    pub degenerate_faces: u64,
    /// Sound faces, not degenerate, whose area vanishes against their longest edge.
    pub zero_area_faces: u64,
    /// Faces beyond the first over the same cycle of points, in either direction; degenerate ones do not count.
    pub duplicate_faces: u64,
    /// Edges.
    pub edges: u64,
    /// Edges with one user.
    pub boundary_edges: u64,
    /// Edges with three users or more.
    pub non_manifold_edges: u64,
    /// Edges with two users that run the same way.
    pub inconsistent_edges: u64,
    /// Connected pieces of the boundary: holes, as long as their rims do not touch in a point.
    pub boundary_loops: u64,
    /// Fans beyond the first of their point, summed over all points: bow-ties count one, an apex of three cones two. Corners of faces
    /// that never leave their point are no fans.
    pub non_manifold_vertices: u64,
    /// Connected pieces of the surface: sound faces belong together when they share an edge. A point alone connects nothing.
    pub components: u64,
    /// Points used minus edges plus sound faces, as the mesh is, with points between fans counted once.
    pub euler: i64,
    /// Number of handles, summed over all components, with one point for each fan. Known when the mesh
    /// [is oriented](Report::is_oriented), closed, and has no degenerate face; bow-ties do not matter.
    pub genus: Option<i64>,
    /// Volume in cubed model units, positive when faces look outwards. Means something for closed meshes only.
    pub volume: f64,
    /// Area in squared model units. A face that is not planar counts with its projection along its mean normal.
    pub area: f64,
    /// Box around the used points that are finite, in model units.
    pub bounds: Bounds,
    /// Shortest edge between finite points in model units; 0 without edges.
    pub min_edge: f64,
    /// Mean length of the edges between finite points in model units, each edge taken once; 0 without edges.
    pub mean_edge: f64,
    /// Longest edge between finite points in model units; 0 without edges.
    pub max_edge: f64,
}

impl Report {
    /// Whether every edge has two users or more: the surface has no rim.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// Whether no edge has more than two users and no point more than one fan; rims are allowed.
    pub fn is_manifold(&self) -> bool {
        self.non_manifold_edges == 0 && self.non_manifold_vertices == 0
    }

    /// Whether no edge has more than two users, and the two run opposite ways wherever there are two.
    pub fn is_oriented(&self) -> bool {
        self.non_manifold_edges == 0 && self.inconsistent_edges == 0
    }
}

impl Mesh {
    /// Counts what there is and measures it.
    ///
    /// A *sound* face has at least three corners, all of which exist as points; other faces are only counted as such. An
    /// *edge* is a pair of different points that follow each other in sound faces; its *users* are the times they do, so a
    /// face that runs along an edge and straight back uses it twice. A *fan* is a set of corners at one point that hang
    /// together by edges. Lengths, areas and volumes leave out what has points that are not finite.
    ///
    /// About 7 bytes a corner, 11 where faces differ in their numbers of corners; 60 ns on one thread, 35 ns on two.
    /// The result does not depend on the number of threads.
    ///
    /// ```
    /// let torus = zmend::mesh::sample::build("torus", 1)?.report();
    /// assert!(torus.is_closed() && torus.is_manifold() && torus.is_oriented());
    /// assert_eq!((torus.components, torus.euler, torus.genus), (1, 0, Some(1)));
    /// # Ok::<(), zmend::Error>(())
    /// ```
    pub fn report(&self) -> Report {
        let points = sum_points(self);
        let faces = sum_faces(self, &points.bounds);
        let euler = points.used as i64 - points.edges as i64 + faces.sound as i64;
        let extra_fans = points.fans - points.used;
        // Every union leaves one component, or one loop, less.
        let components = faces.sound - points.surface_unions;
        let is_surface = points.boundary_edges + points.non_manifold_edges + points.inconsistent_edges == 0
            && faces.dangling + faces.degenerate == 0;
        Report {
            points: self.points.len() as u64,
            points_used: points.used,
            isolated_points: self.points.len() as u64 - points.used,
            non_finite_points: self.points.par_iter().filter(|p| !p.is_finite()).count() as u64,
            faces: self.faces.len() as u64,
            triangles: faces.triangles,
            dangling_faces: faces.dangling,
            degenerate_faces: faces.degenerate,
            zero_area_faces: faces.zero_area,
            duplicate_faces: points.duplicate_faces,
            edges: points.edges,
            boundary_edges: points.boundary_edges,
            non_manifold_edges: points.non_manifold_edges,
            inconsistent_edges: points.inconsistent_edges,
            boundary_loops: points.rim_points - points.rim_unions,
            non_manifold_vertices: extra_fans,
            components,
            euler,
            genus: is_surface.then_some((2 * components as i64 - euler - extra_fans as i64) / 2),
            volume: faces.volume,
            area: faces.area,
            bounds: points.bounds,
            min_edge: if points.finite_edges == 0 { 0.0 } else { points.min_length },
            mean_edge: points.total_length / points.finite_edges.max(1) as f64,
            max_edge: points.max_length,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::corners::Corners;
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    fn mesh(points: usize, faces: &[Vec<u32>]) -> Mesh {
        let points = (0..points).map(|i| DVec3::new(i as f64, (i * i) as f64, (i % 3) as f64)).collect();
        Mesh { points, faces: faces.iter().map(|f| &f[..]).collect() }
    }

    /// Which faces use an edge, and whether upwards.
    type Users = Vec<(usize, bool)>;

    /// Number of classes of `0 .. n` under the pairs that are alike, by relabelling until nothing changes.
    fn classes(n: usize, pairs: &[(usize, usize)]) -> usize {
        let mut label: Vec<usize> = (0..n).collect();
        for &(a, b) in pairs {
            let (from, to) = (label[a], label[b]);
            label.iter_mut().filter(|l| **l == from).for_each(|l| *l = to);
        }
        label.into_iter().collect::<BTreeSet<_>>().len()
    }

    /// The counts again, from a map of edges and comparisons of everything with everything:
    /// edges, boundary, non-manifold, inconsistent, loops, extra fans, components, duplicates, degenerate, dangling, used.
    fn naive(mesh: &Mesh) -> [usize; 11] {
        let exists = |&i: &u32| (i as usize) < mesh.points.len();
        let sound: Vec<&[u32]> = mesh.faces.iter().filter(|f| f.len() >= 3 && f.iter().all(exists)).collect();
        let dangling = mesh.faces.iter().filter(|f| !f.iter().all(exists)).count();
        let sound = &sound;
        let sides = |f: usize| (0..sound[f].len()).map(move |k| (sound[f][k], sound[f][(k + 1) % sound[f].len()]));
        let mut edges: BTreeMap<(u32, u32), Users> = BTreeMap::new();
        for f in 0..sound.len() {
            for (a, b) in sides(f).filter(|(a, b)| a != b) {
                edges.entry((a.min(b), a.max(b))).or_default().push((f, a < b));
            }
        }
        let count = |test: &dyn Fn(&Users) -> bool| edges.values().filter(|users| test(users)).count();
        let rim: Vec<(u32, u32)> = edges.iter().filter(|(_, users)| users.len() == 1).map(|(e, _)| *e).collect();
        let meets = |(a, b): (u32, u32), (c, d): (u32, u32)| a == c || a == d || b == c || b == d;
        let pairs = |n: usize, alike: &dyn Fn(usize, usize) -> bool| -> Vec<(usize, usize)> {
            (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|&(i, j)| alike(i, j)).collect()
        };
        let loops = classes(rim.len(), &pairs(rim.len(), &|i, j| meets(rim[i], rim[j])));
        let shares = |f: usize, g: usize| {
            let others: Vec<(u32, u32)> = sides(g).collect();
            sides(f).any(|(a, b)| a != b && (others.contains(&(a, b)) || others.contains(&(b, a))))
        };
        let components = classes(sound.len(), &pairs(sound.len(), &shares));
        let mut stars: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
        for face in sound {
            for k in 0..face.len() {
                let ends = [face[(k + face.len() - 1) % face.len()], face[(k + 1) % face.len()]];
                stars.entry(face[k]).or_default().push(ends);
            }
        }
        let fans: usize = stars
            .iter()
            .map(|(v, c)| {
                let sideless = c.iter().filter(|ends| **ends == [*v; 2]).count();
                let all = classes(c.len(), &pairs(c.len(), &|i, j| c[i].iter().any(|p| p != v && c[j].contains(p))));
                (all - sideless).max(1)
            })
            .sum();
        let is_degenerate = |f: &[u32]| f.len() < 3 || f.iter().collect::<BTreeSet<_>>().len() < f.len();
        let canonical = |f: &&[u32]| {
            let back: Vec<u32> = f.iter().rev().copied().collect();
            let turns = |f: &[u32]| (0..f.len()).map(|k| [&f[k..], &f[..k]].concat()).min();
            turns(f).min(turns(&back)).unwrap()
        };
        let proper: Vec<Vec<u32>> = sound.iter().filter(|f| !is_degenerate(f)).map(canonical).collect();
        [
            edges.len(),
            rim.len(),
            count(&|users| users.len() > 2),
            count(&|users| users.len() == 2 && users[0].1 == users[1].1),
            loops,
            fans - stars.len(),
            components,
            proper.len() - proper.iter().collect::<BTreeSet<_>>().len(),
            mesh.faces.iter().filter(|f| f.iter().all(exists) && is_degenerate(f)).count(),
            dangling,
            stars.len(),
        ]
    }

    fn counts(r: &Report) -> [usize; 11] {
        [
            r.edges,
            r.boundary_edges,
            r.non_manifold_edges,
            r.inconsistent_edges,
            r.boundary_loops,
            r.non_manifold_vertices,
            r.components,
            r.duplicate_faces,
            r.degenerate_faces,
            r.dangling_faces,
            r.points_used,
        ]
        .map(|n| n as usize)
    }

    proptest! {
        #[test]
        fn reports_agree_with_the_naive_twin(
            faces in prop::collection::vec(prop::collection::vec(0u32..8, 0..6), 0..12),
            triangles in prop::collection::vec(prop::collection::vec(0u32..9, 3), 0..12),
            copies in 0usize..3,
        ) {
            let mut faces = [faces, triangles].concat();
            for i in 0..copies.min(faces.len()) {
                let mut copy = faces[i].clone();
                copy.reverse();
                let shift = i % copy.len().max(1);
                copy.rotate_left(shift);
                faces.push(copy);
            }
            let mesh = mesh(8, &faces);
            let report = mesh.report();
            prop_assert_eq!(counts(&report), naive(&mesh));
            let clean = report.is_closed() && report.is_manifold() && report.is_oriented()
                && report.degenerate_faces + report.dangling_faces == 0;
            prop_assert_eq!(mesh.validate().is_ok(), clean);
        }
    }

    #[test]
    fn special_cases_are_counted_as_documented() {
        let of = |points: usize, faces: &[&[u32]]| {
            mesh(points, &faces.iter().map(|f| f.to_vec()).collect::<Vec<_>>()).report()
        };
        let empty = of(3, &[]);
        assert_eq!((empty.isolated_points, empty.euler, empty.genus, empty.mean_edge), (3, 0, Some(0), 0.0));
        assert!(empty.bounds.is_empty());
        // A spike uses its edge twice, a side from a point to itself is no edge.
        let spike = of(3, &[&[0, 1, 0], &[2, 2, 2]]);
        assert_eq!((spike.edges, spike.boundary_edges, spike.degenerate_faces), (1, 0, 2));
        assert_eq!((spike.zero_area_faces, spike.genus), (0, None));
        // Two tetrahedra that share an edge are one component, that share a point two.
        let shared: [&[u32]; 8] =
            [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3], &[0, 5, 1], &[0, 1, 6], &[1, 5, 6], &[5, 0, 6]];
        let edge = of(7, &shared);
        assert_eq!((edge.non_manifold_edges, edge.components, edge.non_manifold_vertices), (1, 1, 0));
        let tip: Vec<Vec<u32>> = shared
            .iter()
            .zip(0..)
            .map(|(f, i)| f.iter().map(|&v| if i > 3 && v == 1 { 4 } else { v }).collect())
            .collect();
        let tip = mesh(7, &tip).report();
        assert_eq!((tip.non_manifold_vertices, tip.components, tip.genus, tip.euler), (1, 2, Some(0), 3));
        // Three collinear points.
        let mut flat = mesh(3, &[vec![0, 1, 2]]);
        flat.points = vec![DVec3::ZERO, DVec3::ONE, 3.0 * DVec3::ONE];
        assert_eq!(flat.report().zero_area_faces, 1);
    }

    #[test]
    fn measures_do_not_suffer_far_from_the_origin() {
        let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2 & 1));
        let faces: [&[u32]; 6] =
            [&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]];
        for shift in [0.0, 1e9] {
            let points = (0..8).map(|i| 2.0 * corner(i) + DVec3::splat(shift)).collect();
            let report = Mesh { points, faces: faces.into_iter().collect() }.report();
            assert!((report.volume - 8.0).abs() < 1e-12 && (report.area - 24.0).abs() < 1e-12);
            assert_eq!((report.min_edge, report.mean_edge, report.max_edge), (2.0, 2.0, 2.0));
            assert_eq!((report.faces, report.triangles, report.genus), (6, 12, Some(0)));
            assert_eq!(report.bounds.extent(), DVec3::splat(2.0));
        }
    }

    #[test]
    fn points_that_are_not_finite_spoil_only_their_own_faces() {
        let mut mesh = mesh(4, &[vec![0, 1, 2], vec![0, 2, 3]]);
        mesh.points[3] = DVec3::NAN;
        let report = mesh.report();
        assert_eq!((report.non_finite_points, report.boundary_edges, report.edges), (1, 4, 5));
        assert!(report.area > 0.0 && report.bounds.extent().is_finite() && report.max_edge.is_finite());
    }

    #[test]
    fn reports_do_not_depend_on_the_number_of_threads() {
        let n = 300u32;
        let at = |i: u32, j: u32| (i % n) * n + j % n;
        let quads: Vec<Vec<u32>> = (0..n * n)
            .map(|q| (q / n, q % n))
            .map(|(i, j)| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
            .collect();
        let mesh = mesh((n * n) as usize, &quads);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| mesh.report())
        };
        let report = with(1);
        assert_eq!(report, with(4));
        assert_eq!((report.genus, report.components), (Some(1), 1));
    }

    /// Run by hand: `cargo test --release --lib report::tests::cost -- --ignored --nocapture`.
    #[test]
    #[ignore = "a measurement"]
    fn cost_of_a_corner() {
        let n = 1400u32;
        let at = |i: u32, j: u32| (i % n) * n + j % n;
        let mut mesh = mesh((n * n) as usize, &[]);
        for (i, j) in (0..n * n).map(|q| (q / n, q % n)) {
            mesh.faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.faces.push(&[at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let corners = mesh.faces.corners().len() as f64;
            let time = |what: &str, work: &(dyn Fn() + Sync)| {
                let start = std::time::Instant::now();
                pool.install(work);
                println!("{threads} threads, {what}: {:.1} ns a corner", 1e9 * start.elapsed().as_secs_f64() / corners);
            };
            time("corners", &|| assert_eq!(Corners::new(&mesh).points(), mesh.points.len()));
            time("report", &|| assert!(mesh.report().is_closed()));
            time("validate", &|| mesh.validate().unwrap());
        }
    }

    /// Squares of coordinates, or their cubes, are not in the range of numbers: the volume was NaN, and edges had no length.
    #[test]
    fn huge_and_tiny_meshes_are_measured() {
        let unit = super::super::sample::build("cube", 1).unwrap();
        for (size, volume) in [(1e90, 1e270), (1e200, f64::INFINITY), (1e-90, 1e-270), (1e-200, 0.0)] {
            let mut cube = unit.clone();
            cube.points.iter_mut().for_each(|p| *p *= size);
            let (report, expected) = (cube.report(), unit.report());
            assert!((report.max_edge / (expected.max_edge * size) - 1.0).abs() < 1e-9, "{size}");
            assert!((report.min_edge / (expected.min_edge * size) - 1.0).abs() < 1e-9, "{size}");
            let ratio = report.volume / (expected.volume * volume);
            assert!(report.volume == expected.volume * volume || (ratio - 1.0).abs() < 1e-9, "{size} {ratio}");
            assert_eq!(cube.validate(), Ok(()));
        }
    }
}
