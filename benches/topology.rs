//! Topology repair: thinning by the element removed, cutting and filling as a whole, and with a threshold, by the surface cell.
//!
//! `cargo bench --bench topology`. The gyroid is that of the documentation of `TopoMender`'s measurements: |g| < 1/2 in a ball, 8 pi a side.
//! Thresholds are sections 20 cells across: the throughput, in crossed edges, is the same at all levels. `ZMEND_BENCH_LEVEL=10` goes on to
//! level 10, which takes a few minutes.

use criterion::{
    BatchSize, BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main, measurement::WallTime,
};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Duration;
use zmend::grid::brick::{Local, Plane};
use zmend::grid::{Face, Key};
use zmend::octree::crossings::Sample;
use zmend::octree::{EditedOctree, SignedOctree};
use zmend::progress::Silent;
use zmend::topology::{Betti, Complex, Loops, Options, Side, repair_topology, thin};

/// Negative inside; changes by no more than one moves. Lengths in sides of the root.
type Field = fn([f64; 3]) -> f64;

const SOLIDS: [(&str, Field); 3] = [("ball", ball), ("torus", torus), ("gyroid", gyroid)];

fn ball(q: [f64; 3]) -> f64 {
    q.map(|c| (c - 0.5).powi(2)).iter().sum::<f64>().sqrt() - 0.42
}

fn torus(q: [f64; 3]) -> f64 {
    ((q[0] - 0.5).hypot(q[1] - 0.5) - 0.3).hypot(q[2] - 0.5) - 0.1
}

fn gyroid(q: [f64; 3]) -> f64 {
    let [x, y, z] = q.map(|c| 8.0 * PI * c);
    let g = x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos();
    ((g.abs() - 0.5) / (16.0 * PI)).max(ball(q))
}

/// The solid where a function on the unit cube is negative.
fn solid(depth: u32, field: Field) -> SignedOctree {
    let n = 1u32 << (depth - 3);
    let cells = f64::from(8 * n);
    let value = |brick: [u32; 3], local: [u32; 3]| {
        let at: [f64; 3] = std::array::from_fn(|a| f64::from(8 * brick[a] + local[a]) / cells);
        field(at)
    };
    // Bricks that the surface comes near: all others are as their centres are.
    let near = |brick: [u32; 3]| {
        let key = Key::cell(depth - 3, brick).expect("in the root");
        (value(brick, [4; 3]).abs() < 8.0 * 3f64.sqrt() / cells).then(|| {
            let mut plane = Plane::EMPTY;
            let inside = (0..512).map(Local::from_index).filter(|local| value(brick, local.coords()) < 0.0);
            inside.for_each(|local| plane.set(local));
            (key, plane)
        })
    };
    let in_slab = |x: u32| (0..n * n).filter_map(move |i| near([x, i / n, i % n]));
    let mut signs: Vec<(Key, Plane)> = (0..n).into_par_iter().flat_map_iter(in_slab).collect();
    signs.par_sort_unstable_by_key(|(key, _)| *key);
    let find = |key: Key| match signs.binary_search_by_key(&key, |(key, _)| *key) {
        Ok(i) => signs[i].1,
        Err(_) if value(key.min_corner().map(|c| c / key.size()), [4; 3]) < 0.0 => Plane::FULL,
        Err(_) => Plane::EMPTY,
    };
    let mixed = |&&(key, plane): &&(Key, Plane)| {
        let beside = || Face::ALL.into_iter().filter_map(|face| key.neighbour(face));
        !(plane.is_empty() || plane == Plane::FULL) || beside().any(|key| find(key) != plane)
    };
    let listed: Vec<(Key, Plane)> = signs.iter().filter(mixed).copied().collect();
    let samples = |_: usize, crossed: &[Plane; 3], list: &mut Vec<Sample>| {
        let count: u32 = crossed.iter().map(Plane::count).sum();
        list.extend((0..count).map(|_| Sample::new(1 << 15, 0)));
    };
    SignedOctree::from_signs(depth, false, &listed, |key| find(key) == Plane::FULL, samples)
}

fn group<'a>(c: &'a mut Criterion, name: &str) -> BenchmarkGroup<'a, WallTime> {
    let mut group = c.benchmark_group(name);
    group.sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
    group
}

/// The cost of an element removed, without a threshold.
fn thinning(c: &mut Criterion) {
    let mut group = group(c, "thin");
    for (name, field) in SOLIDS {
        let octree = EditedOctree::unedited(solid(7, field));
        for side in [Side::Object, Side::Background] {
            let complex = Complex::new(&octree, side);
            let removed = thin(&mut complex.clone(), None, &Silent).expect("not cancelled").removed;
            group.throughput(Throughput::Elements(removed));
            group.bench_function(format!("{name}-7-{side:?}"), |b| {
                b.iter_batched_ref(|| complex.clone(), |complex| thin(complex, None, &Silent), BatchSize::LargeInput);
            });
        }
    }
    group.finish();
}

/// All handles cut and all tunnels filled, whatever their size; counting before and after included.
fn whole(c: &mut Criterion) {
    let mut group = group(c, "whole");
    for (name, field, depths) in [("torus", torus as Field, 7..=9), ("gyroid", gyroid, 7..=8)] {
        for depth in depths {
            let octree = solid(depth, field);
            group.throughput(Throughput::Elements(octree.crossings().len() as u64));
            let all = Some(f64::INFINITY);
            let (cut, fill) = (Options { cut: all, ..Options::default() }, Options { fill: all, ..Options::default() });
            for (what, options) in [("cut", cut), ("fill", fill)] {
                group.bench_function(format!("{name}-{depth}-{what}"), |b| {
                    let repair = |octree| repair_topology(octree, &options, &Silent).expect("not cancelled");
                    b.iter_batched(|| octree.clone(), repair, BatchSize::LargeInput);
                });
            }
        }
    }
    group.finish();
}

/// With a threshold the cost is that of the surface.
fn threshold(c: &mut Criterion) {
    let last = std::env::var("ZMEND_BENCH_LEVEL").ok().and_then(|level| level.parse().ok()).unwrap_or(9);
    let mut group = group(c, "loops-up-to-20-cells-across");
    for (name, field) in SOLIDS {
        for depth in 7..=last {
            let octree = EditedOctree::unedited(solid(depth, field));
            group.throughput(Throughput::Elements(octree.signed().crossings().len() as u64));
            for side in [Side::Object, Side::Background] {
                group.bench_function(format!("{name}-{depth}-{side:?}"), |b| {
                    b.iter(|| Loops::find(black_box(&octree), side, 100.0 * PI, &Silent).expect("not cancelled"));
                });
            }
        }
    }
    group.finish();
}

fn betti(c: &mut Criterion) {
    let octree = EditedOctree::unedited(solid(8, gyroid));
    let mut group = group(c, "betti");
    group.throughput(Throughput::Elements(octree.signed().crossings().len() as u64));
    group.bench_function("gyroid-8", |b| b.iter(|| Betti::of(black_box(&octree))));
    group.finish();
}

criterion_group!(benches, thinning, whole, threshold, betti);
criterion_main!(benches);
