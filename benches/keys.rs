//! Arithmetic on keys: time for each operation, over 4096 random elements that stay in the first-level cache.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main, measurement::WallTime};
use zmend::grid::key::{SIDE, deinterleave, interleave};
use zmend::grid::{Axis, Corner, Edge, Face, Key};

const COUNT: usize = 4096;

/// `SplitMix64`: the same random numbers on every run.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn coordinates() -> Vec<[u32; 3]> {
    let mut state = 1;
    (0..COUNT).map(|_| [(); 3].map(|()| random(&mut state) as u32 % SIDE)).collect()
}

/// Cells of levels 4 to 12.
fn cells() -> Vec<Key> {
    let level = |i| 4 + i as u32 % 9;
    coordinates().into_iter().enumerate().map(|(i, p)| Key::holding(p, level(i)).expect("inside the root")).collect()
}

/// Times `operation` over all of `items`, folding what it gives into a sum that is used.
fn each<I: Copy>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    items: &[I],
    mut operation: impl FnMut(I) -> u64,
) {
    group.bench_function(name, |b| {
        b.iter(|| black_box(items).iter().map(|&item| operation(item)).fold(0, u64::wrapping_add));
    });
}

fn bits(key: Option<Key>) -> u64 {
    key.map_or(0, Key::to_bits)
}

fn arithmetic(criterion: &mut Criterion) {
    let (points, cells) = (coordinates(), cells());
    let pairs: Vec<(Key, Key)> = cells.iter().copied().zip(cells.iter().copied().skip(1)).collect();
    let edges: Vec<Key> = cells.iter().map(|cell| cell.edge(Edge::ALL[cell.corner_in_parent().index()])).collect();
    let codes: Vec<u64> = cells.iter().map(|cell| cell.code()).collect();

    let mut group = criterion.benchmark_group("keys");
    group.throughput(Throughput::Elements(COUNT as u64));
    let g = &mut group;
    each(g, "interleave", &points, interleave);
    each(g, "deinterleave", &codes, |code| deinterleave(code).into_iter().map(u64::from).sum());
    each(g, "level", &cells, |cell| cell.level().map_or(0, u64::from));
    each(g, "parent", &cells, |cell| bits(cell.parent()));
    each(g, "child", &cells, |cell| cell.child(Corner::ALL[5]).to_bits());
    each(g, "common ancestor", &pairs, |(a, b)| a.common_ancestor(b).to_bits());
    each(g, "neighbour across a face", &cells, |cell| bits(cell.neighbour(Face::new(Axis::Y, true))));
    each(g, "6 neighbours", &cells, |cell| Face::ALL.into_iter().map(|face| bits(cell.neighbour(face))).sum());
    each(g, "26 neighbours", &cells, |cell| cell.neighbours().map(Key::to_bits).fold(0, u64::wrapping_add));
    each(g, "8 corners", &cells, |cell| cell.corners().into_iter().map(Key::to_bits).sum());
    each(g, "boundary of a cell", &cells, |cell| cell.boundary().map(Key::to_bits).fold(0, u64::wrapping_add));
    each(g, "boundary of an edge", &edges, |edge| edge.boundary().map(Key::to_bits).fold(0, u64::wrapping_add));
    each(g, "coboundary of an edge", &edges, |edge| edge.coboundary().map(Key::to_bits).fold(0, u64::wrapping_add));
    each(g, "compare", &pairs, |(a, b)| u64::from(a < b));
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(500));
    targets = arithmetic
}
criterion_main!(benches);
