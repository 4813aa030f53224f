//! Contouring of edited octrees: without any edit, where it must cost nothing, and with a membrane across the hole of a torus.
//!
//! `cargo bench --bench edited`. Throughput of `plain` and `unedited` is in surface cells (crossed edges), so 1/throughput is ns a surface
//! cell; that of `membrane` is in edited elements, and the time is that of the whole surface.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use std::collections::BTreeSet;
use std::hint::black_box;
use zmend::Result;
use zmend::contour::{DualOptions, Placement, dual_contouring, dual_contouring_edited};
use zmend::geom::Frame;
use zmend::grid::brick::{Local, Plane};
use zmend::grid::{Axis, Key};
use zmend::mesh::{MeshSink, MeshSizes};
use zmend::octree::crossings::{Sample, finest_element, lattice_point};
use zmend::octree::{EditedOctree, SignedOctree};
use zmend::progress::Silent;

const DEPTH: u32 = 8;
const N: u32 = 1 << DEPTH;

/// Takes a mesh and keeps only a sum, so that the extractor is measured and not the memory of the result.
#[derive(Default)]
struct Sum(f64, u64);

impl MeshSink for Sum {
    fn begin(&mut self, _: MeshSizes) -> Result<()> {
        Ok(())
    }

    fn points(&mut self, points: &[DVec3]) -> Result<()> {
        self.0 += points.iter().map(|p| p.x).sum::<f64>();
        Ok(())
    }

    fn faces(&mut self, _: usize, corners: &[u32]) -> Result<()> {
        self.1 += corners.iter().map(|&c| u64::from(c)).sum::<u64>();
        Ok(())
    }
}

/// A torus about the z axis whose hole is as wide as its tube.
fn is_inside(p: [u32; 3]) -> bool {
    let half = f64::from(N) / 2.0;
    let p = DVec3::from(p.map(f64::from)) - half;
    ((p.truncate().length() - 0.6 * half).powi(2) + p.z * p.z).sqrt() < 0.3 * half
}

fn torus() -> SignedOctree {
    let bricks = N >> 3;
    let mut signs: Vec<(Key, Plane)> = Vec::new();
    for i in 0..bricks.pow(3) {
        let key = Key::cell(DEPTH - 3, [i / bricks / bricks, i / bricks % bricks, i % bricks]).expect("in the root");
        let origin = lattice_point(DEPTH, key);
        let mut plane = Plane::EMPTY;
        let points = (0..512).map(Local::from_index);
        points.filter(|p| is_inside(std::array::from_fn(|a| origin[a] + p.coords()[a]))).for_each(|p| plane.set(p));
        signs.push((key, plane));
    }
    signs.sort_unstable_by_key(|s| s.0);
    SignedOctree::from_signs(
        DEPTH,
        false,
        &signs,
        |_| false,
        |_, crossed, out| {
            let count = crossed.iter().map(Plane::count).sum::<u32>() as usize;
            out.resize(count, Sample::new(1 << 15, 0));
        },
    )
}

/// What of the faces half way up is not in the solid, out to the middle of the tube.
fn membrane(signed: SignedOctree) -> EditedOctree {
    let face = Axis::X | Axis::Y;
    let mut added = BTreeSet::new();
    let reach = 0.6 * f64::from(N) / 2.0;
    for at in (0..N * N).map(|i| [i / N, i % N, N / 2]) {
        let [x, y, _] = at.map(|c| f64::from(c) + 0.5 - f64::from(N) / 2.0);
        if x.hypot(y) < reach {
            let face = finest_element(DEPTH, at, face);
            let edges: Vec<Key> = face.boundary().collect();
            added.extend(edges.iter().flat_map(|e| e.boundary()).chain(edges.iter().copied()).chain([face]));
        }
    }
    let open = EditedOctree::unedited(signed);
    let added: Vec<Key> = added.into_iter().filter(|&element| !open.contains(element)).collect();
    EditedOctree::new(open.into_signed(), Vec::new(), added)
}

fn edited(c: &mut Criterion) {
    let signed = torus();
    let frame = Frame::new(DVec3::ZERO, 1.0, DEPTH).expect("a frame");
    let options = DualOptions { placement: Placement::MassPoint, triangles: true, ..DualOptions::default() };
    let mut group = c.benchmark_group("torus");
    group.throughput(Throughput::Elements(signed.crossings().len() as u64)).sample_size(30);
    group.bench_function("plain", |b| {
        b.iter(|| {
            let mut sum = Sum::default();
            dual_contouring(black_box(&signed), &frame, &options, &mut sum, &Silent).expect("in memory");
            sum.1
        });
    });
    let mut bench = |name: &str, octree: &EditedOctree, elements: usize| {
        group.throughput(Throughput::Elements(elements as u64));
        group.bench_function(name, |b| {
            b.iter(|| {
                let mut sum = Sum::default();
                dual_contouring_edited(black_box(octree), &frame, &options, &mut sum, &Silent).expect("in memory");
                sum.1
            });
        });
    };
    let unedited = EditedOctree::unedited(signed.clone());
    bench("unedited", &unedited, signed.crossings().len());
    let filled = membrane(signed);
    assert_eq!(filled.validate(), Ok(()));
    bench("membrane", &filled, filled.added().len());
    group.finish();
}

criterion_group!(benches, edited);
criterion_main!(benches);
