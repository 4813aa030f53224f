//! Hulls, gaps, walls and components, beside what they come after: the repair by parity of the same mesh.
//!
//! `cargo bench --bench bands`. Throughput is in surface cells of the plain repair.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use zmend::geom::Frame;
use zmend::mesh::{Mesh, TriangleSource, sample};
use zmend::octree::components::Components;
use zmend::progress::Silent;
use zmend::sign::{Band, Thicken, close, hull, hull_with_gap, parity_signs, scan, scan_oriented, thicken};

const DEPTH: u32 = 8;

fn frame(mesh: &mut Mesh) -> Frame {
    Frame::fit(&mesh.bounds().expect("in memory"), DEPTH, 0.8).expect("samples fit")
}

fn bands(c: &mut Criterion) {
    for (name, detail) in [("knot", 2), ("gear", 2)] {
        let mut mesh = sample::build(name, detail).expect("a sample");
        let frame = frame(&mut mesh);
        let cell = frame.cell_size();
        let scanned = |mesh: &mut Mesh| scan(mesh, &frame, true, &Silent).expect("in memory").crossings;
        let signed = |mesh: &mut Mesh| parity_signs(close(scanned(mesh), &Silent).expect("in memory").0);
        let octree = signed(&mut mesh);
        let hits = scan_oriented(&mut mesh, &frame, true, &Silent).expect("in memory").hits;
        let mut group = c.benchmark_group(format!("{name}-{}k-triangles", mesh.faces.len() / 1000));
        group.throughput(Throughput::Elements(octree.crossings().len() as u64)).sample_size(10);
        group.bench_function("parity", |b| b.iter(|| signed(black_box(&mut mesh))));
        group.bench_function("components", |b| b.iter(|| Components::new(black_box(&octree)).list().len()));
        group.bench_function("hull", |b| b.iter(|| hull(black_box(&hits), &Silent)));
        for cells in [2.0, 6.0] {
            group.bench_function(format!("band-{cells}"), |b| {
                b.iter(|| Band::around(black_box(&mut mesh), &frame, cells, &Silent).expect("in memory"));
            });
            group.bench_function(format!("hull-gap-{}", 2.0 * cells), |b| {
                b.iter(|| hull_with_gap(&hits, &mut mesh, &frame, 2.0 * cells * cell, &Silent).expect("in memory"));
            });
            group.bench_function(format!("thicken-all-{}", 2.0 * cells), |b| {
                let width = 2.0 * cells * cell;
                b.iter(|| thicken(&octree, &mut mesh, &frame, width, Thicken::All, &Silent).expect("in memory"));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, bands);
criterion_main!(benches);
