//! What it costs to tell inside from outside by each rule: whole repairs of a closed, an overlapping and two open models.
//!
//! `cargo bench --bench inside`. Compare `winding` and `auto` with `parity` of the same model and depth.

mod common;

use common::Sum;
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use zmend::mesh::sample;
use zmend::progress::Silent;
use zmend::{Inside, Mesh, Options, repair_into};

/// The mesh without a third of its faces, here and there.
fn sieve(mesh: &Mesh) -> Mesh {
    let keep = |i: usize| !((i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32).is_multiple_of(3);
    let faces = mesh.faces.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, face)| face);
    Mesh { points: mesh.points.clone(), faces: faces.collect() }
}

fn rules(c: &mut Criterion) {
    let sample = |name, detail| sample::build(name, detail).expect("a sample");
    let models = [
        ("closed-knot", sample("knot", 2)),
        ("overlap", sample("overlap", 1)),
        ("open-scan", sample("scan", 2)),
        ("sieve", sieve(&sample("sphere", 2))),
    ];
    for (name, mut mesh) in models {
        for depth in 7..=9 {
            let mut group = c.benchmark_group(format!("{name}-{depth}"));
            group.sample_size(10);
            for inside in [Inside::Parity, Inside::Auto, Inside::Winding] {
                group.bench_function(format!("{inside:?}").to_lowercase(), |b| {
                    b.iter(|| {
                        let mut sum = Sum::default();
                        let options = Options { depth, inside, ..Options::default() };
                        repair_into(black_box(&mut mesh), &options, &mut sum, &Silent).unwrap();
                        sum.1
                    });
                });
            }
            group.finish();
        }
    }
}

criterion_group!(benches, rules);
criterion_main!(benches);
