//! A whole repair, by depth, and its stages.

use super::common::Sum;
use super::markdown::{number, table, times};
use super::measure::{Cost, measure, on_threads};
use super::pointer_octree::cell_map::{self, TreeCells, hash_cells};
use super::pointer_octree::node::{Memory, Tree};
use super::pointer_octree::{self, contour, scan, sign};
use super::svg::plot;
use super::{Plan, Report, input};
use std::hint::black_box;
use zmend::geom::Frame;
use zmend::geom::raster::{Hits, rasterise};
use zmend::grid::Axis;
use zmend::mesh::{MeshSink, MeshSizes, TriangleSource};
use zmend::progress::Silent;
use zmend::{Inside, Mesh, Options};

/// The input: 80,640 triangles.
const SAMPLE: (&str, u32) = ("knot", 2);

const NAMES: [&str; 4] = ["zmend", "pointer octree", "hash entry a cell", "ordered map"];

pub(crate) fn report(plan: &Plan, report: &mut Report) {
    let mut rows = Vec::new();
    let mut lines: [[Vec<(f64, f64)>; 4]; 2] = Default::default();
    for depth in plan.repair.clone() {
        let (mesh, frame) = input(SAMPLE.0, SAMPLE.1, depth);
        let cells = crossings(&mesh, &frame) as f64;
        let one = zmend_on(1, plan, &mesh, &frame);
        let two = zmend_on(2, plan, &mesh, &frame);
        let others = [0, 1, 2].map(|subject| on_threads(1, || baseline(subject, plan, &mesh, &frame)));
        for (i, cost) in [one, others[0], others[1], others[2]].iter().enumerate() {
            lines[0][i].push((f64::from(depth), 1e9 * cost.cpu / cells));
            lines[1][i].push((f64::from(depth), cost.peak / cells));
        }
        let mut row = vec![depth.to_string(), format!("{cells}")];
        row.extend(others.map(|other| times(other.cpu / one.cpu)));
        row.extend(others.map(|other| times(other.peak / one.peak)));
        row.push(number(1e9 * one.cpu / cells));
        row.push(number(one.peak / cells));
        row.push(number(1e9 * others[0].cpu / cells));
        row.push(number(others[0].peak / cells));
        row.push(times(others[0].wall / two.wall));
        row.push(number(two.cpu / one.cpu));
        row.push(times(others[0].peak / two.peak));
        rows.push(row);
    }
    report.say("### Whole repair\n\n");
    report.say("How many times as much the others take as zmend does, one thread each:\n\n");
    let part = |columns: &[usize]| rows.iter().map(|row| columns.iter().map(|&c| row[c].clone()).collect()).collect();
    let ratios: Vec<Vec<String>> = part(&[0, 1, 2, 5, 3, 6, 4, 7]);
    report.say(table(
        &["depth", "surface cells", "pointer: time", "memory", "hash: time", "memory", "ordered: time", "memory"],
        &ratios,
    ));
    report.text +=
        "\nIn ns and bytes a surface cell, and zmend on two threads, by the clock, beside the pointer octree:\n\n";
    let absolute: Vec<Vec<String>> = part(&[0, 8, 9, 10, 11, 12, 13, 14]);
    report.say(table(
        &["depth", "zmend ns", "bytes", "pointer ns", "bytes", "2 threads: clock", "CPU, 2 threads over 1", "memory"],
        &absolute,
    ));
    report.say("\n");
    let named = |lines: &[Vec<(f64, f64)>; 4]| -> Vec<_> {
        NAMES.iter().map(|name| (*name).to_owned()).zip(lines.iter().cloned()).collect()
    };
    let svg = plot("Whole repair, one thread", "depth", "ns a surface cell", &named(&lines[0]));
    report.plot(
        "repair-time.svg",
        "Time of a whole repair by depth: zmend takes least from start to end, maps with an entry a cell grow",
        svg,
    );
    let svg = plot("Whole repair, peak", "depth", "bytes a surface cell", &named(&lines[1]));
    report.plot("repair-memory.svg", "Peak memory of a whole repair by depth: zmend takes least", svg);
    others(plan, report);
    on_threads(1, || stages(plan, report));
}

/// Other samples at one depth, zmend and the pointer octree alone.
fn others(plan: &Plan, report: &mut Report) {
    let mut rows = Vec::new();
    for (name, detail) in [("torus", 1), ("part", 1), ("noisy", 1), ("knot", 1), ("knot", 6)] {
        let (mesh, frame) = input(name, detail, plan.depth);
        let cells = crossings(&mesh, &frame) as f64;
        let zmend = zmend_on(1, plan, &mesh, &frame);
        let pointer = on_threads(1, || baseline(0, plan, &mesh, &frame));
        rows.push(vec![
            format!("{name}, detail {detail}"),
            mesh.faces.len().to_string(),
            format!("{cells}"),
            times(pointer.cpu / zmend.cpu),
            times(pointer.peak / zmend.peak),
            number(1e9 * zmend.cpu / cells),
            number(1e9 * pointer.cpu / cells),
        ]);
    }
    report.say(format!("Other inputs, depth {}:\n\n", plan.depth));
    let head =
        ["input", "polygons", "surface cells", "pointer: time", "memory", "zmend ns a cell", "pointer ns a cell"];
    report.say(table(&head, &rows) + "\n");
}

/// Crossed edges.
fn crossings(mesh: &Mesh, frame: &Frame) -> u64 {
    let counts = pointer_octree::repair(&mut &*mesh, frame, &mut Sum::default()).expect("in memory");
    assert_eq!(counts.odd, 0, "samples here are closed");
    counts.crossings
}

fn zmend_on(threads: usize, plan: &Plan, mesh: &Mesh, frame: &Frame) -> Cost {
    let options = Options { depth: frame.depth(), inside: Inside::Parity, ..Options::default() };
    on_threads(threads, || {
        measure(
            plan.effort,
            || (),
            |()| zmend::repair_into(&mut &*mesh, &options, &mut Sum::default(), &Silent).expect("in memory").crossings,
        )
    })
}

fn baseline(subject: usize, plan: &Plan, mesh: &Mesh, frame: &Frame) -> Cost {
    let source = &mut &*mesh;
    measure(
        plan.effort,
        || (),
        |()| {
            let sink = &mut Sum::default();
            match subject {
                0 => pointer_octree::repair(source, frame, sink),
                1 => cell_map::repair(hash_cells(), source, frame, sink),
                _ => cell_map::repair(TreeCells::new(), source, frame, sink),
            }
            .expect("in memory")
        },
    )
}

/// Counts hits: what no scan conversion along lines can do without.
#[derive(Default)]
struct Count(u64);

impl Hits for Count {
    fn plane(&mut self, _: Axis, _: [f64; 3]) {}

    #[inline]
    fn hit(&mut self, _: Axis, at: [u32; 3], offset: u16) {
        self.0 += u64::from(at[0] ^ at[1] ^ at[2]) ^ u64::from(offset);
    }
}

/// Scan conversion, signs and marching cubes one by one.
fn stages(plan: &Plan, report: &mut Report) {
    let (mesh, frame) = input(SAMPLE.0, SAMPLE.1, plan.depth);
    let (source, depth, effort) = (&mut &mesh, plan.depth, plan.effort);
    let cells = crossings(&mesh, &frame) as f64;

    let scanned = measure(effort, || (), |()| zmend::sign::scan(source, &frame, false, &Silent).expect("in memory"));
    let crossed = zmend::sign::scan(source, &frame, false, &Silent).expect("in memory").crossings;
    let signed = |crossed| zmend::sign::parity_signs(zmend::sign::close(crossed, &Silent).expect("in memory").0);
    let signs = measure(effort, || crossed.clone(), signed);
    let octree = signed(crossed);
    let contoured = measure(
        effort,
        || (),
        |()| zmend::contour::marching_cubes(&octree, &frame, &mut Sum::default(), &Silent).expect("in memory"),
    );
    let zmend = [scanned, signs, contoured];

    let fresh = || {
        let memory = Memory::<()>::default();
        let tree = Tree::new(&memory, depth);
        scan::scan(&tree, &mut &mesh, &frame).expect("in memory")
    };
    let built = measure(effort, || (), |()| fresh());
    let memory = Memory::<()>::default();
    let tree = Tree::new(&memory, depth);
    scan::scan(&tree, source, &frame).expect("in memory");
    // Signs may be given again and again: what was spread is spread once more.
    let signs = measure(effort, || (), |()| sign::sign(&tree));
    let counts = sign::sign(&tree);
    let contoured = measure(
        effort,
        || (),
        |()| contour::marching_cubes(&tree, &counts, &frame, &mut Sum::default()).expect("in memory"),
    );
    let pointer = [built, signs, contoured];
    let [leaves, inner] = memory.counts();

    let mut map = hash_cells();
    let built = measure(effort, hash_cells, |mut map| {
        cell_map::scan(&mut map, &mut &mesh, &frame).expect("in memory");
        map
    });
    cell_map::scan(&mut map, source, &frame).expect("in memory");
    let signs = measure(effort, || (), |()| cell_map::sign(&mut map, depth));
    let (keys, counts) = cell_map::sign(&mut map, depth);
    let contoured = measure(
        effort,
        || (),
        |()| cell_map::marching_cubes(&map, &keys, &counts, &frame, &mut Sum::default()).expect("in memory"),
    );
    let hash = [built, signs, contoured];

    let rasterised = measure(effort, || (), |()| hits(&mut &mesh, &frame));
    let output = measure(effort, || (), |()| output(counts.crossings, counts.triangles));
    let swept = measure(effort, || vec![1u64; octree.bytes() / 8], |words| words.iter().fold(0, |a, b| a ^ b));
    let limits = [("hits alone", rasterised), ("one pass over the octree", swept), ("output alone", output)];

    report.say(format!("### Stages, depth {depth}\n\n"));
    report.say(format!(
        "The pointer octree has {leaves} leaves and {inner} inner nodes, {} bytes a surface cell; zmend's takes {}. \
         The limit is what the stage cannot do without: the exact rasterisation of all triangles, one reading of the octree, making points and \
         triangles of which nothing has to be found out. In ns a surface cell, one thread:\n\n",
        number((24 * leaves + 88 * inner) as f64 / cells),
        number(octree.bytes() as f64 / cells),
    ));
    let rows: Vec<Vec<String>> = ["build from triangles", "close, signs", "contour"]
        .iter()
        .enumerate()
        .map(|(i, stage)| {
            let per_cell = |cost: Cost| number(1e9 * cost.cpu / cells);
            vec![
                (*stage).to_owned(),
                times(pointer[i].cpu / zmend[i].cpu),
                times(hash[i].cpu / zmend[i].cpu),
                per_cell(zmend[i]),
                per_cell(pointer[i]),
                per_cell(hash[i]),
                format!("{}, {}", limits[i].0, per_cell(limits[i].1)),
                number(zmend[i].cpu / limits[i].1.cpu),
            ]
        })
        .collect();
    report.say(table(
        &["stage", "pointer over zmend", "hash over zmend", "zmend", "pointer", "hash", "limit", "zmend over limit"],
        &rows,
    ));
    report.say("\n");
}

/// All triangles rasterised, and the hits forgotten.
fn hits(source: &mut dyn TriangleSource, frame: &Frame) -> u64 {
    let mut count = Count::default();
    let counted = source.triangles(&mut |batch| {
        for triangle in batch {
            if let [Some(a), Some(b), Some(c)] = triangle.map(|p| frame.snap(p)) {
                rasterise(&[a, b, c], frame.cell_shift(), &mut count);
            }
        }
        Ok(())
    });
    counted.expect("in memory");
    count.0
}

/// As many points and corners as a surface has, in batches, into the sink that all others use.
fn output(points: u64, triangles: u64) -> u64 {
    const BATCH: u64 = 1 << 15;
    let mut sink = Sum::default();
    let sizes = MeshSizes { points, faces: triangles, corners: 3 * triangles };
    let passed = sink.begin(sizes).and_then(|()| {
        let mut batch = Vec::new();
        for start in (0..points).step_by(BATCH as usize) {
            batch.clear();
            batch.extend((start..points.min(start + BATCH)).map(|i| zmend::glam::DVec3::splat(i as f64)));
            sink.points(black_box(&batch))?;
        }
        let mut batch = Vec::new();
        for start in (0..3 * triangles).step_by(BATCH as usize) {
            batch.clear();
            batch.extend((start..(3 * triangles).min(start + BATCH)).map(|i| i as u32));
            sink.faces(3, black_box(&batch))?;
        }
        Ok(())
    });
    passed.expect("in memory");
    sink.1
}
