//! What is said of large meshes: neighbourhoods, self-intersections and distances; and what is done to them: healing.
//!
//! `cargo bench --bench mesh`. Throughput is in triangles, or in points whose distance is asked for.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use zmend::Mesh;
use zmend::glam::DVec3;
use zmend::mesh::{DistanceOptions, FeatureOptions, HealOptions, Topology, TriangleTree, sample};
use zmend::progress::Silent;

fn intersections(c: &mut Criterion) {
    // A clean mesh of 1.3 million triangles, one of a million and more that cross in places, and the tree alone.
    let knot = sample::build("knot", 8).expect("a sample");
    let overlap = sample::build("overlap", 14).expect("a sample");
    for (name, mesh) in [("knot", &knot), ("overlap", &overlap)] {
        let mut group = c.benchmark_group(format!("{name}-{}k-triangles", mesh.faces.len() / 1000));
        group.throughput(Throughput::Elements(mesh.faces.len() as u64)).sample_size(10);
        group.bench_function("tree", |b| b.iter(|| TriangleTree::new(black_box(mesh)).len()));
        group.bench_function("self-intersections", |b| b.iter(|| black_box(mesh).self_intersections().len()));
        group.bench_function("has-self-intersections", |b| b.iter(|| black_box(mesh).has_self_intersections()));
        group.finish();
    }
}

fn distances(c: &mut Criterion) {
    let knot = sample::build("knot", 8).expect("a sample");
    let tree = TriangleTree::new(&knot);
    // Points beside the surface in order, and points anywhere.
    let near: Vec<DVec3> = knot.points.iter().step_by(16).map(|p| *p + 0.01).collect();
    let far: Vec<DVec3> = near.iter().step_by(16).map(|p| (*p * 1000.0).fract() * 4.0).collect();
    let mut group = c.benchmark_group(format!("distances-{}k-triangles", knot.faces.len() / 1000));
    group.sample_size(10);
    for (name, points) in [("closest-near", &near), ("closest-anywhere", &far)] {
        let sum = || points.iter().filter_map(|&p| tree.closest(p)).map(|c| c.distance).sum::<f64>();
        group.throughput(Throughput::Elements(points.len() as u64));
        group.bench_function(name, |b| b.iter(sum));
    }
    let rough = sample::build("knot", 4).expect("a sample");
    let options = DistanceOptions { samples: 200_000, ..DistanceOptions::default() };
    let points = 2 * options.samples + (knot.points.len() + rough.points.len()) as u64;
    group.throughput(Throughput::Elements(points));
    group.bench_function("both-ways", |b| b.iter(|| knot.distances(&rough, options, &Silent).expect("not cancelled")));
    group.finish();
}

/// A torus of 2 n² triangles, in order or shuffled.
fn torus(n: u32, shuffled: bool) -> Mesh {
    let at = |i: u32, j: u32| (i % n) * n + j % n;
    let quads = (0..n * n).map(|q| (q / n, q % n));
    let mut faces: Vec<[u32; 3]> = quads
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    if shuffled {
        // A stride without divisors in common with the number of faces (2, 5 and 7 for n = 2240) visits each once.
        let (count, stride) = (faces.len(), 3_333_333);
        faces = (0..count).map(|i| faces[i * stride % count]).collect();
    }
    let points = (0..n * n).map(|v| {
        let [u, w] = [v / n, v % n].map(|k| std::f64::consts::TAU * f64::from(k) / f64::from(n));
        DVec3::new((2.0 + w.cos()) * u.cos(), (2.0 + w.cos()) * u.sin(), w.sin())
    });
    Mesh { points: points.collect(), faces: faces.iter().map(|f| &f[..]).collect() }
}

fn topology(c: &mut Criterion) {
    for shuffled in [false, true] {
        let mesh = torus(2240, shuffled);
        let bytes = Topology::new(&mesh).bytes() as f64 / mesh.faces.len() as f64;
        let order = if shuffled { "shuffled" } else { "in-order" };
        let mut group = c.benchmark_group(format!("10M-triangles-{order}-{bytes:.0}-bytes-each"));
        group.throughput(Throughput::Elements(mesh.faces.len() as u64)).sample_size(10);
        group.bench_function("topology", |b| b.iter(|| Topology::new(black_box(&mesh)).bytes()));
        group.bench_function("report", |b| b.iter(|| black_box(&mesh).report().edges));
        if !shuffled {
            let topology = Topology::new(&mesh);
            group.bench_function("diagnose", |b| b.iter(|| topology.diagnose().loops.len()));
            let options = FeatureOptions::default();
            group.bench_function("features", |b| b.iter(|| topology.features(&options).convex.len()));
        }
        group.finish();
    }
}

/// Long thin triangles that are parallel to no axis, around a rod.
fn slivers(c: &mut Criterion) {
    let n = 50_000u32;
    let along = DVec3::new(20.0, 17.0, 23.0);
    let [u, v] = [along.any_orthonormal_vector(), along.cross(along.any_orthonormal_vector()).normalize()];
    let ring = |end: f64| {
        let at = move |i: u32| std::f64::consts::TAU * f64::from(i) / f64::from(n);
        (0..n).map(move |i| end * along + at(i).cos() * u + at(i).sin() * v)
    };
    let quads = (0..n).map(|i| [i, (i + 1) % n, n + (i + 1) % n, n + i]);
    let faces: Vec<[u32; 3]> = quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let rod = Mesh { points: ring(-1.0).chain(ring(1.0)).collect(), faces: faces.iter().map(|f| &f[..]).collect() };
    let mut group = c.benchmark_group("slivers-100k-triangles");
    group.throughput(Throughput::Elements(rod.faces.len() as u64)).sample_size(10);
    group.bench_function("self-intersections", |b| b.iter(|| black_box(&rod).self_intersections().len()));
    group.finish();
}

fn healing(c: &mut Criterion) {
    let holes = sample::build("knot-holes", 4).expect("a sample");
    let clean = sample::build("knot", 4).expect("a sample");
    let mut group = c.benchmark_group(format!("heal-{}k-triangles", clean.faces.len() / 1000));
    group.throughput(Throughput::Elements(clean.faces.len() as u64)).sample_size(10);
    for (name, mesh) in [("clean", &clean), ("seven-holes", &holes)] {
        let options = HealOptions { max_hole_edges: 400, ..HealOptions::default() };
        let heal = || mesh.heal(&options, &Silent).expect("not cancelled").after.holes;
        group.bench_function(name, |b| b.iter(heal));
    }
    group.finish();
}

criterion_group!(benches, topology, intersections, slivers, distances, healing);
criterion_main!(benches);
