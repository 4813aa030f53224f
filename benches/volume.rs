//! Surfaces of volumes: a ball and a gyroid of 256^3 samples of 32 bits, by every method, and by another crate.
//!
//! `cargo bench --bench volume`. Throughput is in cells, so 1/throughput is ns a cell; numbers of faces are printed once. One thread, for
//! rates a core; `ZMEND_BENCH_SIDE=512` takes larger volumes.
//!
//! `fast-surface-nets` makes 32-bit points and normals without placing, in one pass over an array that it is given as signed distances; its
//! surface is neither manifold at open faces nor closed at the border.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fast_surface_nets::ndshape::{RuntimeShape, Shape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use std::hint::black_box;
use zmend::Mesh;
use zmend::contour::volume::{ExtractOptions, Method, extract};
use zmend::progress::Silent;
use zmend::volume::Dense;

/// Samples of a function of the place, in sides of the volume from its middle.
fn samples(side: usize, field: impl Fn([f32; 3]) -> f32) -> Vec<f32> {
    let place = |c: usize| (c as f32 + 0.5) / side as f32 - 0.5;
    let at = |i: usize| field([i % side, i / side % side, i / (side * side)].map(place));
    (0..side.pow(3)).map(at).collect()
}

fn volumes(c: &mut Criterion) {
    let side = std::env::var("ZMEND_BENCH_SIDE").ok().map_or(256, |s| s.parse().expect("a number"));
    let ball = |p: [f32; 3]| 0.4 - p.iter().map(|c| c * c).sum::<f32>().sqrt();
    // As many periods as give vcglib's 2.5 million faces at 256^3.
    let gyroid = |p: [f32; 3]| {
        let [x, y, z] = p.map(|c| c * 3.46 * std::f32::consts::TAU);
        x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos()
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    for (name, values) in [("ball", samples(side, ball)), ("gyroid", samples(side, gyroid))] {
        let mut group = c.benchmark_group(format!("{name}-{side}"));
        group.throughput(Throughput::Elements(values.len() as u64)).sample_size(10);
        let volume = Dense::new(&values, [side; 3]).expect("as many samples as that");
        for method in Method::ALL {
            let options = ExtractOptions { method, ..ExtractOptions::default() };
            let run = || {
                let mut mesh = Mesh::default();
                extract(black_box(&volume), &options, &mut mesh, &Silent).expect("in memory");
                mesh
            };
            println!("{name}: {} faces by {method:?}", pool.install(run).faces.len());
            group.bench_function(format!("{method:?}"), |b| b.iter(|| pool.install(run)));
        }
        let shape = RuntimeShape::<u32, 3>::new([side as u32; 3]);
        let distances: Vec<f32> = values.iter().map(|v| -v).collect();
        group.bench_function("fast-surface-nets", |b| {
            b.iter(|| {
                let mut buffer = SurfaceNetsBuffer::default();
                let last = shape.as_array().map(|n| n - 1);
                surface_nets(black_box(&distances), &shape, [0; 3], last, &mut buffer);
                buffer
            });
        });
        group.finish();
    }
}

criterion_group!(benches, volumes);
criterion_main!(benches);
