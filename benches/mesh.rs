//! What is said of large meshes: self-intersections and distances.
//!
//! `cargo bench --bench mesh`. Throughput is in triangles, or in points whose distance is asked for.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use zmend::glam::DVec3;
use zmend::mesh::{DistanceOptions, TriangleTree, sample};
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

criterion_group!(benches, intersections, distances);
criterion_main!(benches);
