//! The stages of a repair one by one: scan, close, sign, marching cubes, dual contouring, and the whole.
//!
//! `cargo bench --bench stages`. Throughput is in surface cells (crossed edges), so 1/throughput is ns a surface cell.

mod common;

use common::Sum;
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use zmend::contour::{DualOptions, Placement, dual_contouring, marching_cubes};
use zmend::geom::Frame;
use zmend::mesh::{TriangleSource, sample};
use zmend::octree::SignedOctree;
use zmend::progress::Silent;
use zmend::sign::{close, parity_signs, scan};
use zmend::{Mesh, Options, repair_into};

const DEPTH: u32 = 8;

fn frame(mesh: &mut Mesh) -> Frame {
    let bounds = mesh.bounds().expect("in memory");
    Frame::fit(&bounds, DEPTH, 0.9).expect("samples fit")
}

fn signed(mesh: &mut Mesh) -> (Frame, SignedOctree) {
    let frame = frame(mesh);
    let scanned = scan(mesh, &frame, true, &Silent).expect("in memory");
    (frame, parity_signs(close(scanned.crossings, &Silent).expect("in memory").0))
}

fn stages(c: &mut Criterion) {
    // Few large triangles, and some 1.5 triangles a surface cell.
    for (name, detail) in [("knot", 1), ("knot", 6)] {
        let mut mesh = sample::build(name, detail).expect("a sample");
        let (frame, octree) = signed(&mut mesh);
        let cells = octree.crossings().len() as u64;
        let mut group = c.benchmark_group(format!("{name}-{}k-triangles", mesh.faces.len() / 1000));
        group.throughput(Throughput::Elements(cells)).sample_size(20);
        group.bench_function("scan", |b| b.iter(|| scan(black_box(&mut mesh), &frame, false, &Silent).unwrap()));
        group.bench_function("scan-normals", |b| b.iter(|| scan(black_box(&mut mesh), &frame, true, &Silent).unwrap()));
        let crossings = scan(&mut mesh, &frame, true, &Silent).expect("in memory").crossings;
        group.bench_function("close-nothing", |b| {
            b.iter_batched(|| crossings.clone(), |x| close(x, &Silent).unwrap(), BatchSize::LargeInput);
        });
        group.bench_function("sign", |b| b.iter_batched(|| crossings.clone(), parity_signs, BatchSize::LargeInput));
        group.bench_function("mc", |b| {
            b.iter(|| {
                let mut sum = Sum::default();
                marching_cubes(black_box(&octree), &frame, &mut sum, &Silent).unwrap();
                sum.1
            });
        });
        for (name, placement) in [("dc", Placement::SharpFeatures), ("quads", Placement::MassPoint)] {
            group.bench_function(name, |b| {
                b.iter(|| {
                    let mut sum = Sum::default();
                    let options = DualOptions { placement, ..DualOptions::default() };
                    dual_contouring(black_box(&octree), &frame, &options, &mut sum, &Silent).unwrap();
                    sum.1
                });
            });
        }
        group.bench_function("repair-mc", |b| {
            b.iter(|| {
                let mut sum = Sum::default();
                let options = Options { depth: DEPTH, ..Options::default() };
                repair_into(black_box(&mut mesh), &options, &mut sum, &Silent).unwrap();
                sum.1
            });
        });
        group.finish();
    }
}

fn holes(c: &mut Criterion) {
    let mut mesh = sample::build("knot-holes", 1).expect("a sample");
    let frame = frame(&mut mesh);
    let crossings = scan(&mut mesh, &frame, false, &Silent).expect("in memory").crossings;
    let mut group = c.benchmark_group("knot-holes");
    group.throughput(Throughput::Elements(crossings.odd_faces().len() as u64)).sample_size(20);
    // Per odd face.
    group.bench_function("close", |b| {
        b.iter_batched(|| crossings.clone(), |x| close(x, &Silent).unwrap(), BatchSize::LargeInput);
    });
    group.finish();
}

criterion_group!(benches, stages, holes);
criterion_main!(benches);
