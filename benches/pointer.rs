//! The pointer octree, and maps with an entry a cell, beside zmend: build, signs, contour, the whole repair, search, neighbours, thinning.
//!
//! `cargo bench --bench pointer`. Wall time of one thread by surface cell (search: by question, neighbours: by leaf, thinning: by element
//! removed), at one depth: `ZMEND_BENCH_DEPTH`, 8 if that is not set. For depths, memory, two threads and tables: `--bench report`.

mod common;
mod pointer_octree;

use common::Sum;
use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use pointer_octree::blocks::Blocks;
use pointer_octree::cell_map::{self, TreeCells, hash_cells};
use pointer_octree::elements::{TopoMemory, forget, prepare};
use pointer_octree::node::{Memory, Tree};
use pointer_octree::{contour, locate, scan, sign, span, thin};
use std::hint::black_box;
use std::time::Duration;
use zmend::geom::Frame;
use zmend::grid::{Face, Key};
use zmend::mesh::{TriangleSource, sample};
use zmend::octree::{EditedOctree, LinearOctree, SignedOctree};
use zmend::progress::Silent;
use zmend::topology::{Complex, Loops, Side};
use zmend::{Inside, Mesh, Options};

fn depth() -> u32 {
    std::env::var("ZMEND_BENCH_DEPTH").ok().and_then(|depth| depth.parse().ok()).unwrap_or(8)
}

fn input() -> (Mesh, Frame) {
    let mut mesh = sample::build("knot", 2).expect("a sample");
    let bounds = mesh.bounds().expect("in memory");
    (mesh, Frame::fit(&bounds, depth(), 0.9).expect("samples fit"))
}

fn signed(mesh: &Mesh, frame: &Frame) -> SignedOctree {
    let crossings = zmend::sign::scan(&mut &*mesh, frame, false, &Silent).expect("in memory").crossings;
    zmend::sign::parity_signs(zmend::sign::close(crossings, &Silent).expect("in memory").0)
}

fn group<'a>(c: &'a mut Criterion, name: &str, elements: u64) -> BenchmarkGroup<'a, WallTime> {
    let mut group = c.benchmark_group(name);
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    group.throughput(Throughput::Elements(elements));
    group
}

fn whole(c: &mut Criterion) {
    let (mesh, frame) = input();
    let cells = signed(&mesh, &frame).crossings().len() as u64;
    let mut group = group(c, "pointer/repair", cells);
    let options = Options { depth: frame.depth(), inside: Inside::Parity, ..Options::default() };
    let sum = Sum::default;
    group.bench_function("zmend", |b| {
        b.iter(|| zmend::repair_into(&mut &mesh, &options, &mut sum(), &Silent).expect("in memory").crossings);
    });
    group.bench_function("pointer", |b| {
        b.iter(|| pointer_octree::repair(&mut &mesh, &frame, &mut sum()).expect("in memory"));
    });
    group.bench_function("hash", |b| {
        b.iter(|| cell_map::repair(hash_cells(), &mut &mesh, &frame, &mut sum()).expect("in memory"));
    });
    group.bench_function("ordered", |b| {
        b.iter(|| cell_map::repair(TreeCells::new(), &mut &mesh, &frame, &mut sum()).expect("in memory"));
    });
}

fn stages(c: &mut Criterion) {
    let (mesh, frame) = input();
    let crossings = zmend::sign::scan(&mut &mesh, &frame, false, &Silent).expect("in memory").crossings;
    let cells = crossings.len() as u64;
    let memory = Memory::<()>::default();
    let tree = Tree::new(&memory, frame.depth());

    let mut build = group(c, "pointer/build", cells);
    build.bench_function("zmend", |b| {
        b.iter(|| zmend::sign::scan(&mut &mesh, &frame, false, &Silent).expect("in memory"));
    });
    build.bench_function("pointer", |b| {
        b.iter(|| {
            let memory = Memory::<()>::default();
            scan::scan(&Tree::new(&memory, frame.depth()), &mut &mesh, &frame).expect("in memory")
        });
    });
    build.bench_function("hash", |b| {
        b.iter(|| cell_map::scan(&mut hash_cells(), &mut &mesh, &frame).expect("in memory"));
    });
    build.bench_function("ordered", |b| {
        b.iter(|| cell_map::scan(&mut TreeCells::new(), &mut &mesh, &frame).expect("in memory"));
    });
    build.finish();

    scan::scan(&tree, &mut &mesh, &frame).expect("in memory");
    let mut signs = group(c, "pointer/signs", cells);
    signs.bench_function("zmend", |b| {
        let signed =
            |crossings| zmend::sign::parity_signs(zmend::sign::close(crossings, &Silent).expect("in memory").0);
        b.iter_batched(|| crossings.clone(), signed, BatchSize::LargeInput);
    });
    signs.bench_function("pointer", |b| b.iter(|| sign::sign(&tree)));
    signs.finish();

    let octree = signed(&mesh, &frame);
    let counts = sign::sign(&tree);
    let mut contours = group(c, "pointer/contour", cells);
    contours.bench_function("zmend", |b| {
        b.iter(|| zmend::contour::marching_cubes(&octree, &frame, &mut Sum::default(), &Silent).expect("in memory"));
    });
    contours.bench_function("pointer", |b| {
        b.iter(|| contour::marching_cubes(&tree, &counts, &frame, &mut Sum::default()).expect("in memory"));
    });
}

fn search(c: &mut Criterion) {
    let (mesh, frame) = input();
    let depth = frame.depth();
    let memory = Memory::<()>::default();
    let tree = Tree::new(&memory, depth);
    scan::scan(&tree, &mut &mesh, &frame).expect("in memory");
    sign::sign_all(&tree);
    let places = locate::leaves(&tree);
    let key = |at: [u32; 3], size: u32| Key::cell(depth - size, at.map(|c| c >> size)).expect("a leaf of the tree");
    let leaves: Vec<Key> = places.iter().map(|place| key(place.at, place.size)).collect();
    let linear: LinearOctree<u32> = leaves.iter().map(|&leaf| (leaf, 1)).collect();
    // A stride that is prime to any number of leaves in memory visits them in no order.
    let some: Vec<Key> = (0..1 << 14).map(|i| leaves[i * 1_000_003 % leaves.len()]).collect();
    let shift = 19 - depth;

    let mut located = group(c, "pointer/locate", some.len() as u64);
    located.bench_function("zmend", |b| {
        b.iter(|| some.iter().filter_map(|leaf| linear.locate(black_box(leaf.center()))).count());
    });
    located.bench_function("pointer", |b| {
        let found = |leaf: &Key| locate::locate(&tree, black_box(leaf.center()).map(|c| c >> shift));
        b.iter(|| some.iter().filter_map(found).count());
    });
    located.finish();

    let mut neighbours = group(c, "pointer/neighbours", leaves.len() as u64);
    neighbours.bench_function("zmend", |b| {
        let around = |leaf| Face::ALL.into_iter().map(|face| linear.neighbours(leaf, face).count()).sum::<usize>();
        b.iter(|| leaves.iter().map(|&leaf| around(leaf)).sum::<usize>());
    });
    neighbours.bench_function("pointer, by recursion", |b| b.iter(|| locate::sum_over_faces(&tree, |_| 1)));
    neighbours.bench_function("pointer, leaf by leaf", |b| {
        b.iter(|| {
            let mut count = 0u64;
            places.iter().for_each(|place| locate::beside(&tree, place.at, place.size, &mut |_| count += 1));
            count
        });
    });
}

fn topology(c: &mut Criterion) {
    let (mesh, frame) = input();
    let octree = EditedOctree::unedited(signed(&mesh, &frame));
    let (memory, records) = (TopoMemory::default(), Blocks::default());
    let tree = Tree::new(&memory, frame.depth());
    scan::scan(&tree, &mut &mesh, &frame).expect("in memory");
    sign::sign_all(&tree);
    let anew = || {
        forget(&tree);
        prepare(&tree);
    };
    let cells = octree.signed().crossings().len() as u64;

    let mut thinning = group(c, "pointer/thin", cells);
    thinning.bench_function("zmend", |b| {
        let thinned = |mut complex| zmend::topology::thin(&mut complex, None, &Silent).expect("not cancelled");
        b.iter_batched(|| Complex::new(&octree, Side::Object), thinned, BatchSize::LargeInput);
    });
    thinning.bench_function("pointer", |b| {
        b.iter_batched(anew, |()| thin::thin(&tree, &records), BatchSize::PerIteration);
    });
    thinning.finish();

    let mut loops = group(c, "pointer/thin-and-span", cells);
    loops.bench_function("zmend", |b| {
        b.iter(|| Loops::find(&octree, Side::Object, f64::INFINITY, &Silent).expect("not cancelled"));
    });
    loops.bench_function("pointer", |b| {
        let found = |()| {
            thin::thin(&tree, &records);
            span::handles(&tree)
        };
        b.iter_batched(anew, found, BatchSize::PerIteration);
    });
}

/// One thread for everybody.
fn alone(c: &mut Criterion) {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("nobody made threads before");
    whole(c);
    stages(c);
    search(c);
    topology(c);
}

criterion_group!(benches, alone);
criterion_main!(benches);
