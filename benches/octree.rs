//! The octree around a sphere, 2.5 million leaves of levels up to 9: look-ups beside an ordered map and a sorted array,
//! leaf search, neighbours, traversal. Times are for one element each.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rayon::prelude::*;
use zmend::grid::key::SIDE;
use zmend::grid::{Face, Key};
use zmend::octree::LinearOctree;

/// Questions asked in one round.
const COUNT: usize = 1 << 15;
/// The finest level.
const DEPTH: u32 = 9;
/// Radius of the sphere in lattice units; it is centred in the root.
const RADIUS: u64 = (SIDE as f64 * 0.466) as u64;

/// `SplitMix64`: the same random numbers on every run.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Adds the leaves inside a cell: split to `DEPTH` wherever the sphere passes.
fn refine(cell: Key, tree: &mut LinearOctree<u32>) {
    let (min, max, centre) = (cell.min_corner(), cell.max_corner(), u64::from(SIDE / 2));
    let (mut nearest, mut farthest) = (0, 0);
    for i in 0..3 {
        let (low, high) = (u64::from(min[i]), u64::from(max[i]));
        let (below, above) = (low.abs_diff(centre), high.abs_diff(centre));
        nearest += if (low..=high).contains(&centre) { 0 } else { below.min(above).pow(2) };
        farthest += below.max(above).pow(2);
    }
    if cell.level() < Some(DEPTH) && (nearest..=farthest).contains(&RADIUS.pow(2)) {
        cell.children().into_iter().for_each(|child| refine(child, tree));
    } else {
        tree.insert(cell, tree.len() as u32);
    }
}

/// All questions in rounds of `COUNT`, again and again, so that a cache warmed by one round does not help the next.
fn rounds<T>(all: &[T]) -> impl Iterator<Item = &[T]> {
    all.chunks_exact(COUNT).cycle()
}

fn next<'a, T>(rounds: &mut impl Iterator<Item = &'a [T]>) -> &'a [T] {
    black_box(rounds.next().expect("more than one round"))
}

fn octree(criterion: &mut Criterion) {
    let mut tree = LinearOctree::new();
    refine(Key::ROOT, &mut tree);
    tree.shrink_to_fit();
    let sorted = tree.keys_z();
    println!("{} leaves, {:.1} bytes each", tree.len(), tree.allocated_bytes() as f64 / tree.len() as f64);

    let mut state = 1;
    let mut shuffled = sorted.clone();
    shuffled.sort_by_cached_key(|_| random(&mut state));
    let points: Vec<[u32; 3]> = (0..sorted.len()).map(|_| [(); 3].map(|()| random(&mut state) as u32 % SIDE)).collect();

    let mut group = criterion.benchmark_group("octree");
    group.throughput(Throughput::Elements(COUNT as u64));

    let map: BTreeMap<Key, u32> = tree.iter().map(|(leaf, &record)| (leaf, record)).collect();
    for (order, keys) in [("random", &shuffled), ("coherent", &sorted)] {
        group.bench_function(format!("look-up, {order}, LinearOctree"), |b| {
            let mut rounds = rounds(keys);
            b.iter(|| next(&mut rounds).iter().filter_map(|&k| tree.get(k)).map(|&r| u64::from(r)).sum::<u64>());
        });
        group.bench_function(format!("look-up, {order}, BTreeMap"), |b| {
            let mut rounds = rounds(keys);
            b.iter(|| next(&mut rounds).iter().filter_map(|k| map.get(k)).map(|&r| u64::from(r)).sum::<u64>());
        });
        group.bench_function(format!("look-up, {order}, sorted Vec"), |b| {
            let mut rounds = rounds(keys);
            b.iter(|| next(&mut rounds).iter().filter_map(|k| sorted.binary_search(k).ok()).sum::<usize>());
        });
    }
    drop(map);

    let found = |leaf: Option<(Key, &u32)>| leaf.map_or(0, |(_, &record)| u64::from(record));
    let on_leaves: Vec<[u32; 3]> = shuffled.iter().map(|leaf| leaf.center()).collect();
    // Lines along z, half a finest leaf from point to point.
    let step = SIDE >> DEPTH >> 1;
    let lines: Vec<[u32; 3]> = (0..1 << 21u32)
        .map(|i| [(i >> (DEPTH + 1)) * 7919 % SIDE, (i >> (DEPTH + 1)) * 104_729 % SIDE, i % (SIDE / step) * step])
        .collect();
    for (place, points) in [("uniform", &points), ("in random leaves", &on_leaves), ("along lines", &lines)] {
        group.bench_function(format!("leaf search, {place}"), |b| {
            let mut rounds = rounds(points);
            b.iter(|| next(&mut rounds).iter().map(|&p| found(tree.locate(p))).sum::<u64>());
        });
    }
    group.bench_function("leaf search, along lines, from the last leaf", |b| {
        let mut rounds = rounds(&lines);
        b.iter(|| {
            let walk = next(&mut rounds).iter().scan(Key::ROOT, |hint, &p| {
                let leaf = tree.locate_from(*hint, p)?;
                *hint = leaf.0;
                Some(u64::from(*leaf.1))
            });
            walk.sum::<u64>()
        });
    });

    for (order, keys) in [("random", &shuffled), ("coherent", &sorted)] {
        group.bench_function(format!("all 6 face neighbours, {order}"), |b| {
            let across = |leaf, face| tree.neighbours(leaf, face).map(|(_, &record)| u64::from(record)).sum::<u64>();
            let around = |&leaf: &Key| Face::ALL.into_iter().map(|face| across(leaf, face)).sum::<u64>();
            let mut rounds = rounds(keys);
            b.iter(|| next(&mut rounds).iter().map(around).sum::<u64>());
        });
    }
    group.bench_function("all neighbours, coherent", |b| {
        let around = |&leaf: &Key| tree.all_neighbours(leaf).map(|(_, &record)| u64::from(record));
        let mut rounds = rounds(&sorted);
        b.iter(|| next(&mut rounds).iter().flat_map(around).sum::<u64>());
    });

    group.throughput(Throughput::Elements(tree.len() as u64));
    group.bench_function("traverse, table order", |b| {
        b.iter(|| tree.iter().map(|(_, &record)| u64::from(record)).sum::<u64>());
    });
    group.bench_function("traverse, Z-order, all threads", |b| {
        b.iter(|| tree.par_iter_z().map(|(_, &record)| u64::from(record)).sum::<u64>());
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(600));
    targets = octree
}
criterion_main!(benches);
