//! The octree at rest on real meshes: nothing is lost, and the bytes for each cell of the surface.

mod common;

use zmend::geom::Frame;
use zmend::grid::brick::Plane;
use zmend::mesh::{Mesh, TriangleSource, sample};
use zmend::octree::crossings::Brick;
use zmend::octree::{CompactOctree, SignedOctree};
use zmend::progress::Silent;
use zmend::{io, sign};

/// Meshes of all kinds, from `../shared/data/meshes`.
const MODELS: [&str; 8] = [
    "cgal/pig.stl",
    "cgal/turbine.off",
    "cgal/knot2.off",
    "cgal/cheese.off",
    "cgal/anchor_dense.off",
    "trimesh/cycloidal.ply",
    "trimesh/1002_tray_bottom.STL",
    "irmb/cactus10k.obj",
];

fn octree(mesh: &Mesh, depth: u32, with_normals: bool) -> SignedOctree {
    let mut mesh = mesh;
    let frame = Frame::fit(&mesh.bounds().expect("valid"), depth, 0.9).expect("ordinary");
    let scan = sign::scan(&mut mesh, &frame, with_normals, &Silent).expect("scanned");
    sign::parity_signs(sign::close(scan.crossings, &Silent).expect("closed").0)
}

/// Finest cells with corners of both signs: those with a crossed edge.
fn surface_cells(octree: &SignedOctree) -> u64 {
    let crossings = octree.crossings();
    let of_brick = |brick: &Brick| {
        let [x, y, z] = &brick.crossed;
        let [px, py, pz, pxy, pxz, pyz] = crossings.plus(brick).map(|next| &next.crossed);
        let across = |a: &Plane, b: &Plane| *a | *b;
        let along_x = across(x, &x.at_plus_y(&py[0]));
        let along_x_next = across(&pz[0], &pz[0].at_plus_y(&pyz[0]));
        let along_y = across(y, &y.at_plus_z(&pz[1]));
        let along_y_next = across(&px[1], &px[1].at_plus_z(&pxz[1]));
        let along_z = across(z, &z.at_plus_x(&px[2]));
        let along_z_next = across(&py[2], &py[2].at_plus_x(&pxy[2]));
        let mixed = along_x | along_x.at_plus_z(&along_x_next) | along_y | along_y.at_plus_x(&along_y_next);
        u64::from((mixed | along_z | along_z.at_plus_y(&along_z_next)).count())
    };
    crossings.bricks().iter().map(of_brick).sum()
}

/// Bytes a surface cell, of the octree to work on and at rest.
fn bytes_a_cell(mesh: &Mesh, depth: u32, with_normals: bool) -> [f64; 2] {
    let octree = octree(mesh, depth, with_normals);
    let cells = surface_cells(&octree) as f64;
    let before = octree.bytes() as f64;
    [before / cells, CompactOctree::from(octree).bytes() as f64 / cells]
}

fn models() -> impl Iterator<Item = (&'static str, Mesh)> {
    let data = common::data();
    MODELS.into_iter().filter_map(move |name| {
        let path = data.as_ref()?.join(name);
        match io::read(&path) {
            Ok(mesh) => Some((name, mesh)),
            Err(error) => {
                println!("skipped: {error}");
                None
            }
        }
    })
}

#[test]
fn three_bytes_a_cell_and_six_with_normals() {
    let mut all: Vec<(&str, Mesh)> = models().take(3).collect();
    all.extend(["knot-holes", "gear"].map(|name| (name, sample::build(name, 1).expect("a sample"))));
    for (name, mesh) in all {
        for (with_normals, most) in [(false, 3.0), (true, 6.0)] {
            let [before, after] = bytes_a_cell(&mesh, 8, with_normals);
            println!("{name}: {before:.2} -> {after:.2} bytes a cell");
            assert!(after <= most && after < before, "{name}: {before} -> {after}");
        }
    }
}

#[test]
fn real_octrees_come_back() {
    for (name, mesh) in models().take(4) {
        let octree = octree(&mesh, 7, true);
        let again = CompactOctree::from(octree.clone()).into_signed();
        assert!(again.crossings().bricks().iter().eq(octree.crossings().bricks().iter()), "{name}");
        assert!(again.crossings().offsets().iter().eq(octree.crossings().offsets().iter()), "{name}");
        assert!(again.crossings().normals().iter().eq(octree.crossings().normals().iter()), "{name}");
        assert!(again.inside() == octree.inside(), "{name}");
    }
}

/// `cargo test --release --test compact -- --ignored --nocapture`
#[test]
#[ignore = "a table of all models at depths 8 to 10"]
fn table() {
    for (name, mesh) in models() {
        for depth in 8..=10 {
            let [[before, after], [before_normals, after_normals]] =
                [false, true].map(|with_normals| bytes_a_cell(&mesh, depth, with_normals));
            println!("{name:32} {depth:2}  {before:5.2} {after:5.2}   {before_normals:5.2} {after_normals:5.2}");
            assert!(after <= 3.0 && after_normals <= 6.0, "{name}");
        }
    }
}
