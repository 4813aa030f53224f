//! Topology repair: thinning by the element removed, and finding all handles up to a threshold, by the surface cell.
//!
//! `cargo bench --bench topology`. The gyroid is that of the documentation of `TopoMender`'s measurements: |g| < 1/2 in a ball, 8 pi a side.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::hint::black_box;
use zmend::grid::brick::{Local, Plane};
use zmend::grid::{Face, Key};
use zmend::octree::crossings::Sample;
use zmend::octree::{EditedOctree, SignedOctree};
use zmend::progress::Silent;
use zmend::topology::{Betti, Complex, Loops, Side, thin};

type Field = fn([f64; 3]) -> f64;

fn ball(q: [f64; 3]) -> f64 {
    q.map(|c| (c - 0.5).powi(2)).iter().sum::<f64>().sqrt() - 0.42
}

fn torus(q: [f64; 3]) -> f64 {
    ((q[0] - 0.5).hypot(q[1] - 0.5) - 0.3).hypot(q[2] - 0.5) - 0.1
}

fn gyroid(q: [f64; 3]) -> f64 {
    let [x, y, z] = q.map(|c| 8.0 * PI * c);
    let g = x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos();
    (g.abs() - 0.5).max(ball(q))
}

/// The solid where a function on the unit cube is negative.
fn solid(depth: u32, field: Field) -> EditedOctree {
    let n = 1 << (depth - 3);
    let cells = f64::from(8 * n);
    let mut signs: Vec<(Key, Plane)> = (0..n * n * n)
        .into_par_iter()
        .map(|i| {
            let brick = [i / (n * n), i / n % n, i % n];
            let mut plane = Plane::EMPTY;
            for local in (0..512).map(Local::from_index) {
                let c = local.coords();
                let at: [u32; 3] = std::array::from_fn(|a| 8 * brick[a] + c[a]);
                if field(at.map(|c| f64::from(c) / cells)) < 0.0 {
                    plane.set(local);
                }
            }
            (Key::cell(depth - 3, brick).expect("in the root"), plane)
        })
        .collect();
    signs.par_sort_unstable_by_key(|(key, _)| *key);
    let find = |key: Key| signs[signs.binary_search_by_key(&key, |(key, _)| *key).expect("all are listed")].1;
    let mixed = |&&(key, plane): &&(Key, Plane)| {
        let beside = || Face::ALL.into_iter().filter_map(|face| key.neighbour(face));
        !(plane.is_empty() || plane == Plane::FULL) || beside().any(|key| find(key) != plane)
    };
    let listed: Vec<(Key, Plane)> = signs.iter().filter(mixed).copied().collect();
    let samples = |_: usize, crossed: &[Plane; 3], list: &mut Vec<Sample>| {
        let count: u32 = crossed.iter().map(Plane::count).sum();
        list.extend((0..count).map(|_| Sample::new(1 << 15, 0)));
    };
    let signed = SignedOctree::from_signs(depth, false, &listed, |key| find(key) == Plane::FULL, samples);
    EditedOctree::unedited(signed)
}

/// The cost of an element removed, without a threshold.
fn thinning(c: &mut Criterion) {
    let mut group = c.benchmark_group("thin");
    group.sample_size(10);
    for (name, field) in [("gyroid", gyroid as Field), ("torus", torus), ("ball", ball)] {
        let octree = solid(7, field);
        for side in [Side::Object, Side::Background] {
            let complex = Complex::new(&octree, side);
            let removed = thin(&mut complex.clone(), None, &Silent).expect("not cancelled").removed;
            group.throughput(Throughput::Elements(removed));
            group.bench_function(format!("{name}-7-{side:?}"), |b| {
                b.iter_batched(
                    || complex.clone(),
                    |mut complex| thin(&mut complex, None, &Silent),
                    BatchSize::LargeInput,
                );
            });
        }
    }
    group.finish();
}

/// With a threshold the cost is that of the surface: the throughput, in surface cells, is the same at all levels.
fn threshold(c: &mut Criterion) {
    let mut group = c.benchmark_group("loops-up-to-100-cells");
    group.sample_size(10);
    for (name, field) in [("ball", ball as Field), ("torus", torus), ("gyroid", gyroid)] {
        for depth in 7..=9 {
            let octree = solid(depth, field);
            group.throughput(Throughput::Elements(octree.signed().crossings().len() as u64));
            group.bench_function(format!("{name}-{depth}"), |b| {
                b.iter(|| Loops::find(black_box(&octree), Side::Object, 100.0, &Silent).expect("not cancelled"));
            });
        }
    }
    group.finish();
}

fn betti(c: &mut Criterion) {
    let octree = solid(8, gyroid);
    let mut group = c.benchmark_group("betti");
    group.throughput(Throughput::Elements(octree.signed().crossings().len() as u64));
    group.bench_function("gyroid-8", |b| b.iter(|| Betti::of(black_box(&octree))));
    group.finish();
}

criterion_group!(benches, thinning, threshold, betti);
criterion_main!(benches);
