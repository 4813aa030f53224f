//! The octree around a sphere, 2.5 million leaves of levels up to 9: building, leaf search, look-ups, neighbours, traversal, balance; beside
//! the layouts that stand to reason. Times are for one element each.
//!
//! The baseline is the published layout of the octree of TCAD ("ordered map"): an ordered map from cell centres of four 64-bit numbers
//! to records of 24 bytes, with parents beside leaves, in which a search looks up one level after the other. It is a `BTreeMap` here,
//! which is faster and leaner than the `std::map` of C++. The others hold one entry a leaf: `hashbrown`, with a search level by level from
//! the finest, and a sorted array with bisection.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use rayon::prelude::*;
use zmend::grid::key::SIDE;
use zmend::grid::{Face, Key};
use zmend::octree::{Balance, LinearOctree};

/// Questions asked in one round.
const COUNT: usize = 1 << 15;
/// The finest level.
const DEPTH: u32 = 9;
/// Radius of the sphere in lattice units; it is centred in the root.
const RADIUS: i64 = (SIDE as f64 * 0.466) as i64;

/// A cell's centre, and a number that the published layout carries along.
type Centre = [i64; 4];
/// Level, tag, place in the parent, and the number of a triangle.
type Record = (u8, u8, u8, u64);

/// `SplitMix64`: the same random numbers on every run.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Whether the sphere passes through a cell. Both trees ask this.
fn is_cut(cell: Key) -> bool {
    let (mut nearest, mut farthest) = (0, 0);
    for low in cell.min_corner() {
        let low = i64::from(low) - i64::from(SIDE / 2);
        let high = low + i64::from(cell.size());
        nearest += low.max(-high).max(0).pow(2);
        farthest += high.max(-low).pow(2);
    }
    (nearest..=farthest).contains(&RADIUS.pow(2))
}

/// The tree, in the way of this library.
fn built() -> LinearOctree<u64> {
    LinearOctree::build(DEPTH, is_cut, Key::to_bits)
}

/// Calls `leaf` with the leaves, and `parent` with what is split before.
fn descend(cell: Key, parent: &mut impl FnMut(Key), leaf: &mut impl FnMut(Key)) {
    if cell.level() < Some(DEPTH) && is_cut(cell) {
        parent(cell);
        cell.children().into_iter().for_each(|child| descend(child, parent, leaf));
    } else {
        leaf(cell);
    }
}

fn centre(cell: Key) -> Centre {
    let [x, y, z] = cell.center().map(i64::from);
    [x, y, z, 0]
}

/// The tree in the published layout: eight insertions a split.
fn ordered_map() -> BTreeMap<Centre, Record> {
    let mut map = BTreeMap::from([(centre(Key::ROOT), (0, 0, 0, 0))]);
    let mut insert = |cell: Key| {
        let corner = cell.corner_in_parent().index() as u8;
        map.insert(centre(cell), (cell.level().unwrap_or(0) as u8, 0, corner, 0));
    };
    let mut waiting = vec![Key::ROOT];
    while let Some(cell) = waiting.pop() {
        if cell.level() < Some(DEPTH) && is_cut(cell) {
            cell.children().into_iter().for_each(&mut insert);
            waiting.extend(cell.children());
        }
    }
    map
}

/// The leaf at a point in the published layout: down from the root, a look-up a level.
fn search(map: &BTreeMap<Centre, Record>, point: [u32; 3]) -> Option<&Record> {
    let mut found = None;
    for level in 0..=DEPTH {
        match map.get(&centre(Key::holding(point, level)?)) {
            Some(record) => found = Some(record),
            None => break,
        }
    }
    found
}

/// An entry a leaf.
fn hash_map() -> hashbrown::HashMap<Key, u64, ahash::RandomState> {
    hashbrown::HashMap::with_hasher(ahash::RandomState::with_seeds(1, 2, 3, 4))
}

/// All questions in rounds of `COUNT`, again and again, so that a cache warmed by one round does not help the next.
fn rounds<T>(all: &[T]) -> impl Iterator<Item = &[T]> {
    all.chunks_exact(COUNT).cycle()
}

fn next<'a, T>(rounds: &mut impl Iterator<Item = &'a [T]>) -> &'a [T] {
    black_box(rounds.next().expect("more than one round"))
}

/// Bytes of memory of the process.
fn resident() -> f64 {
    let status = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    status.split(' ').nth(1).and_then(|pages| pages.parse::<f64>().ok()).map_or(f64::NAN, |pages| pages * 4096.0)
}

fn building(group: &mut BenchmarkGroup<'_, WallTime>) {
    group.throughput(Throughput::Elements(built().len() as u64));
    // Trees are dropped beside the clock, all of them.
    group.bench_function("build, all threads", |b| b.iter_with_large_drop(built));
    group.bench_function("build, one thread", |b| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        b.iter_with_large_drop(|| pool.install(built));
    });
    group.bench_function("build, leaf by leaf", |b| {
        b.iter_with_large_drop(|| {
            let mut tree = LinearOctree::from_iter([(Key::ROOT, 0)]);
            let split = |cell| tree.refine(cell, Balance::Off, |_, _| 0).map(|_| ()).expect("a leaf");
            descend(Key::ROOT, &mut { split }, &mut |_| ());
            tree
        });
    });
    group.bench_function("build, leaf by leaf, in balance", |b| {
        b.iter_with_large_drop(|| {
            let mut tree = LinearOctree::from_iter([(Key::ROOT, 0)]);
            let split = |cell| {
                if tree.contains(cell) {
                    tree.refine(cell, Balance::Faces, |_, _| 0).map(|_| ()).expect("a leaf");
                }
            };
            descend(Key::ROOT, &mut { split }, &mut |_| ());
            tree
        });
    });
    group.bench_function("build, ordered map", |b| b.iter_with_large_drop(ordered_map));
    group.bench_function("build, hashbrown", |b| {
        b.iter_with_large_drop(|| {
            let mut map = hash_map();
            descend(Key::ROOT, &mut |_| (), &mut |leaf| *map.entry(leaf).or_insert(0) = 0);
            map
        });
    });
    group.bench_function("build, sorted array", |b| {
        b.iter_with_large_drop(|| {
            let mut leaves = Vec::new();
            descend(Key::ROOT, &mut |_| (), &mut |leaf| leaves.push((leaf, 0u64)));
            leaves.par_sort_unstable();
            leaves
        });
    });
    group.bench_function("balance across faces, edges, corners", |b| {
        b.iter_batched(built, |mut tree| tree.balance(Balance::Corners, |_, &r| r), criterion::BatchSize::PerIteration);
    });
}

/// Neighbours and traversals.
fn walking(group: &mut BenchmarkGroup<'_, WallTime>, tree: &LinearOctree<u64>, sorted: &[Key], shuffled: &[Key]) {
    for (order, keys) in [("random", shuffled), ("coherent", sorted)] {
        group.bench_function(format!("all 6 face neighbours, {order}"), |b| {
            let across = |leaf, face| tree.neighbours(leaf, face).map(|(_, &record)| record & 1).sum::<u64>();
            let around = |&leaf: &Key| Face::ALL.into_iter().map(|face| across(leaf, face)).sum::<u64>();
            let mut rounds = rounds(keys);
            b.iter(|| next(&mut rounds).iter().map(around).sum::<u64>());
        });
    }
    group.bench_function("all neighbours, coherent", |b| {
        let around = |&leaf: &Key| tree.all_neighbours(leaf).map(|(_, &record)| record & 1);
        let mut rounds = rounds(sorted);
        b.iter(|| next(&mut rounds).iter().flat_map(around).sum::<u64>());
    });

    group.throughput(Throughput::Elements(tree.len() as u64));
    group.bench_function("traverse, table order", |b| {
        b.iter(|| tree.iter().map(|(_, &record)| record & 1).sum::<u64>());
    });
    group.bench_function("traverse, Z-order", |b| {
        b.iter(|| tree.iter_z().map(|(_, &record)| record & 1).sum::<u64>());
    });
    group.bench_function("traverse, Z-order, all threads", |b| {
        b.iter(|| tree.par_iter_z().map(|(_, &record)| record & 1).sum::<u64>());
    });
    let mut elements = 0;
    tree.visit_dual(|_| elements += 1);
    group.throughput(Throughput::Elements(elements));
    group.bench_function("traverse, dual", |b| {
        b.iter(|| {
            let mut count = 0u64;
            tree.visit_dual(|dual| count += u64::from(dual.extent.dimension()));
            count
        });
    });
}

fn octree(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("octree");
    // First, while memory is not fragmented.
    let before = resident();
    let map = ordered_map();
    let of_map = resident() - before;
    let mut tree = built();
    let grown = tree.allocated_bytes() as f64;
    tree.shrink_to_fit();
    let leaves = tree.len() as f64;
    println!(
        "{leaves} leaves; bytes each: {:.1}, shrunk {:.1}",
        grown / leaves,
        tree.allocated_bytes() as f64 / leaves
    );
    println!("ordered map: {} cells, {:.1} bytes a leaf", map.len(), of_map / leaves);
    building(&mut group);

    let sorted = tree.keys_z();
    let mut state = 1;
    let mut shuffled = sorted.clone();
    shuffled.sort_by_cached_key(|_| random(&mut state));
    let points: Vec<[u32; 3]> = (0..sorted.len()).map(|_| [(); 3].map(|()| random(&mut state) as u32 % SIDE)).collect();
    group.throughput(Throughput::Elements(COUNT as u64));

    let found = |leaf: Option<(Key, &u64)>| leaf.map_or(0, |(_, &record)| record & 1);
    let on_leaves: Vec<[u32; 3]> = shuffled.iter().map(|leaf| leaf.center()).collect();
    for (place, points) in [("uniform", &points), ("in random leaves", &on_leaves)] {
        group.bench_function(format!("leaf search, {place}, ordered map"), |b| {
            let mut rounds = rounds(points);
            b.iter(|| next(&mut rounds).iter().filter_map(|&p| search(&map, p)).map(|r| u64::from(r.0)).sum::<u64>());
        });
    }
    drop(map);

    let mut map = hash_map();
    map.extend(tree.iter().map(|(leaf, &record)| (leaf, record)));
    println!("hashbrown: {:.1} bytes a leaf", map.allocation_size() as f64 / leaves);
    for (order, keys) in [("random", &shuffled), ("coherent", &sorted)] {
        group.bench_function(format!("look-up, {order}, LinearOctree"), |b| {
            let mut rounds = rounds(keys);
            b.iter(|| next(&mut rounds).iter().filter_map(|&k| tree.get(k)).map(|&r| r & 1).sum::<u64>());
        });
        group.bench_function(format!("look-up, {order}, hashbrown"), |b| {
            let mut rounds = rounds(keys);
            b.iter(|| next(&mut rounds).iter().filter_map(|k| map.get(k)).map(|&r| r & 1).sum::<u64>());
        });
        group.bench_function(format!("look-up, {order}, sorted array"), |b| {
            let mut rounds = rounds(keys);
            b.iter(|| next(&mut rounds).iter().filter_map(|k| sorted.binary_search(k).ok()).sum::<usize>());
        });
    }
    let in_hash_map = |p| (0..=DEPTH).rev().find_map(|level| map.get(&Key::holding(p, level)?));
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
        group.bench_function(format!("leaf search, {place}, at once"), |b| {
            let mut rounds = rounds(points);
            b.iter(|| tree.locate_all(next(&mut rounds).iter().copied()).map(found).sum::<u64>());
        });
        group.bench_function(format!("leaf search, {place}, hashbrown"), |b| {
            let mut rounds = rounds(points);
            b.iter(|| next(&mut rounds).iter().filter_map(|&p| in_hash_map(p)).map(|r| r & 1).sum::<u64>());
        });
        group.bench_function(format!("leaf search, {place}, sorted array"), |b| {
            let mut rounds = rounds(points);
            let last = |p: [u32; 3]| Key::holding(p, 18).map(|cell| sorted.partition_point(|&leaf| leaf < cell));
            b.iter(|| next(&mut rounds).iter().filter_map(|&p| last(p)).sum::<usize>());
        });
    }
    drop(map);
    group.bench_function("leaf search, along lines, from the last leaf", |b| {
        let mut rounds = rounds(&lines);
        b.iter(|| {
            let walk = next(&mut rounds).iter().scan(Key::ROOT, |hint, &p| {
                let leaf = tree.locate_from(*hint, p)?;
                *hint = leaf.0;
                Some(*leaf.1 & 1)
            });
            walk.sum::<u64>()
        });
    });
    walking(&mut group, &tree, &sorted, &shuffled);
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
