//! Speed of all readers and writers in bytes of the file per second, beside `stl_io` and `ply-rs-bw`.
//!
//! Readers run over bytes in memory, or over a file in the page cache where they stream; writers write to `/dev/null`.

use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main, measurement::WallTime};
use glam::DVec3;
use std::hint::black_box;
use std::io::Cursor;
use std::path::Path;
use zmend::io::{self, Format, Precision, WriteOptions};
use zmend::mesh::{Mesh, MeshSink, MeshSizes, TriangleSource};

/// Points along and across the torus.
const STEPS: u32 = 400;

/// A torus of 160,000 points and 320,000 triangles.
fn torus() -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..STEPS {
        for j in 0..STEPS {
            let [(u, v), (x, y)] = [i, j].map(|k| (f64::from(k) * std::f64::consts::TAU / f64::from(STEPS)).sin_cos());
            let radius = 50.0 + 20.0 * y;
            mesh.points.push(DVec3::new(radius * u, radius * v, 20.0 * x));
            let at = |di: u32, dj: u32| (i + di) % STEPS * STEPS + (j + dj) % STEPS;
            mesh.faces.push(&[at(0, 0), at(1, 0), at(1, 1)]);
            mesh.faces.push(&[at(0, 0), at(1, 1), at(0, 1)]);
        }
    }
    mesh
}

fn group<'a>(criterion: &'a mut Criterion, name: &str, bytes: u64) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Bytes(bytes)).sample_size(10);
    group
}

fn sum(source: &mut dyn TriangleSource) -> f64 {
    let mut sum = 0.0;
    let counts = source.triangles(&mut |batch| {
        sum += batch.iter().map(|t| t[0].x).sum::<f64>();
        Ok(())
    });
    counts.expect("readable");
    sum
}

fn readers(criterion: &mut Criterion) {
    let directory = tempfile::tempdir().expect("a directory");
    let mesh = torus();
    let text = WriteOptions { is_text: true, ..WriteOptions::default() };
    let double = WriteOptions { precision: Precision::Double, ..WriteOptions::default() };
    for (name, file, options) in [
        ("stl", "torus.stl", WriteOptions::default()),
        ("stl text", "text.stl", text),
        ("ply", "torus.ply", WriteOptions::default()),
        ("ply double", "double.ply", double),
        ("ply text", "text.ply", text),
        ("obj", "torus.obj", WriteOptions::default()),
        ("obj double", "double.obj", double),
        ("off", "torus.off", WriteOptions::default()),
    ] {
        let path = directory.path().join(file);
        io::write(&path, &mesh, options).expect("written");
        let bytes = std::fs::read(&path).expect("readable");
        let mut group = group(criterion, &format!("read {name}"), bytes.len() as u64);
        group
            .bench_function("read_bytes", |b| b.iter(|| io::read_bytes(name, black_box(&bytes), None).expect("valid")));
        if !options.is_text && matches!(Format::from_path(&path), Some(Format::Stl | Format::Ply)) {
            group.bench_function("open, triangles", |b| b.iter(|| sum(&mut io::open(&path).expect("valid"))));
        }
        match name {
            "stl" => {
                let triangles =
                    |bytes| stl_io::create_stl_reader(&mut Cursor::new(bytes)).expect("valid").flatten().count();
                group.bench_function("stl_io, triangles", |b| b.iter(|| triangles(black_box(&bytes))));
                group.bench_function("stl_io, welded", |b| {
                    b.iter(|| stl_io::read_stl(&mut Cursor::new(black_box(&bytes))).expect("valid"));
                });
            }
            "ply" => {
                let parser = ply_rs_bw::parser::Parser::<ply_rs_bw::ply::DefaultElement>::new();
                group.bench_function("ply-rs-bw, default elements", |b| {
                    b.iter(|| parser.read_ply(&mut Cursor::new(black_box(&bytes))).expect("valid"));
                });
            }
            _ => {}
        }
    }
}

fn writers(criterion: &mut Criterion) {
    let mesh = torus();
    let sizes = MeshSizes {
        points: mesh.points.len() as u64,
        faces: mesh.faces.len() as u64,
        corners: mesh.faces.corners().len() as u64,
    };
    let write = |format, options| {
        let mut writer = io::create(Path::new("/dev/null"), format, options).expect("opened");
        writer.begin(sizes).expect("written");
        writer.points(&mesh.points).expect("written");
        writer.faces(3, mesh.faces.corners()).expect("written");
        writer.finish().expect("written")
    };
    for format in [Format::Stl, Format::Ply, Format::Obj, Format::Off] {
        let bytes = write(format, WriteOptions::default());
        let mut group = group(criterion, "write", bytes);
        group.bench_function(format.extension(), |b| b.iter(|| write(format, WriteOptions::default())));
    }
    // Faces alone: what a repair writes most of.
    let mut group = group(criterion, "write", 13 * sizes.faces);
    let mut writer = io::create(Path::new("/dev/null"), Format::Ply, WriteOptions::default()).expect("opened");
    group
        .bench_function("ply faces", |b| b.iter(|| writer.faces(3, black_box(mesh.faces.corners())).expect("written")));
}

criterion_group!(benches, readers, writers);
criterion_main!(benches);
