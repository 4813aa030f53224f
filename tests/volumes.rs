//! Volumes from files to surfaces and through topology repair, and meshes through distance fields: by the library and the program.

mod common;

use assert_cmd::Command;
use common::{check, topology_of, volume};
use serde_json::Value;
use std::path::{Path, PathBuf};
use zmend::contour::volume::{Border, ExtractOptions, Method, extract};
use zmend::glam::{DMat3, DVec3};
use zmend::io::volume::{VolumeOptions, read_volume, write_volume};
use zmend::mesh::sample;
use zmend::progress::Silent;
use zmend::topology::{Betti, Options as Repair};
use zmend::volume::{Cropped, Image, Level, Placement, Voxels};
use zmend::{Mesh, Offset, Options, Solid, Surface, repair};

/// The directory of real volumes beside the repository, if it is there.
fn volumes() -> Option<PathBuf> {
    common::data().map(|meshes| meshes.with_file_name("volumes"))
}

fn read(path: &Path) -> Image {
    read_volume(path, &VolumeOptions::default(), &Silent).unwrap_or_else(|e| panic!("{e}")).image
}

fn extracted(image: &Image, level: Level, method: Method) -> Mesh {
    let options = ExtractOptions { level, method, placement: image.placement(), ..ExtractOptions::default() };
    let mut mesh = Mesh::default();
    extract(image, &options, &mut mesh, &Silent).unwrap();
    mesh
}

fn solid(image: Image, level: Level) -> Solid {
    let (image, _) = image.on_cubes(None, &Silent).unwrap();
    let placement = image.placement();
    Solid::from_volume(&image, level, placement.origin, placement.axes.x_axis.x, &Silent).unwrap()
}

fn surface(solid: &Solid, surface: Surface) -> Mesh {
    let mut mesh = Mesh::default();
    solid.extract(&Options { surface, ..Options::default() }, &mut mesh, &Silent).unwrap();
    mesh
}

/// The surfaces of a solid with these Betti numbers: so many components with so many handles in all.
fn surfaces(betti: &Betti) -> common::Topology {
    common::Topology::new(betti.components + betti.cavities, betti.handles as i64)
}

#[test]
fn real_volumes_are_read_and_lie_where_they_should() {
    let Some(data) = volumes() else { return };
    for (file, size, kind, level, topology) in [
        ("vtk-data/HeadMRVolume.mhd", [48, 62, 42], "u8", 41.0, None),
        ("vtk-data/neghip.slc", [66, 66, 66], "u8", 60.0, None),
        // A nut has a hole.
        ("vtk-data/nut.slc", [68, 41, 59], "u8", 100.0, Some(common::Topology::new(1, 1))),
        ("vtk-data/vase.vti", [115, 101, 75], "u8", 100.0, None),
        ("vtk-data/hydrogen.vti", [64, 64, 64], "f32", 0.2, None),
        ("pyvista/channels.vti", [250, 250, 100], "i32", 3.0, None),
        ("pyvista/frog_tissues.vti", [500, 470, 136], "u8", 20.0, None),
    ] {
        let image = read(&data.join(file));
        assert_eq!((image.size(), image.voxels().type_name()), (size, kind), "{file}");
        let mesh = extracted(&image, Level::above(level), Method::MarchingCubes);
        let found = check(&mesh).unwrap_or_else(|e| panic!("{file}: {e}"));
        assert!(mesh.faces.len() > 500 && topology.is_none_or(|topology| topology == found), "{file}: {found:?}");
        let [low, .., high] = image.corners();
        let half = 0.5 * image.placement().spacing();
        let is_within = |p: &DVec3| p.cmpge(low - half).all() && p.cmple(high + half).all();
        assert!(mesh.points.iter().all(is_within), "{file}");
    }
    // The file has the largest and the least value of this array.
    let range = read(&data.join("vtk-data/hydrogen.vti")).voxels().range();
    assert_eq!((range.least, range.greatest, range.not_numbers), (0.0, 1.0, 0));
}

#[test]
fn octrees_and_volumes_give_the_same_surface() {
    let Some(data) = volumes() else { return };
    let image = read(&data.join("vtk-data/HeadMRVolume.mhd"));
    for level in [Level::above(41.0), Level::below(100.5)] {
        let direct = extracted(&image, level, Method::MarchingCubes);
        let solid = solid(image.clone(), level);
        let through = surface(&solid, Surface::MarchingCubes);
        assert_eq!(check(&direct), check(&through));
        assert_eq!((direct.points.len(), direct.faces.len()), (through.points.len(), through.faces.len()));
        let (a, b) = (volume(&direct), volume(&through));
        assert!((a - b).abs() < 1e-3 * a, "{a} {b}");
        assert_eq!(check(&direct).unwrap(), surfaces(&Betti::of(&solid.octree)));
    }
}

/// Nothing but noise decides about the thousands of handles of these solids; most are one cell wide.
#[test]
fn noise_loses_its_handles_by_few_cells() {
    let Some(data) = volumes() else { return };
    let head = read(&data.join("vtk-data/HeadMRVolume.mhd"));
    let channels = read(&data.join("pyvista/channels.vti"));
    let part = Cropped::new(&channels, [40, 40, 20], [100, 100, 60]).unwrap();
    let part = Solid::from_volume(&part, Level::above(1.0), DVec3::ZERO, 1.0, &Silent).unwrap();
    for (name, solid, handles, cells) in
        [("head", solid(head, Level::above(41.0)), 76, 200), ("channels", part, 200, 600)]
    {
        let changed = |options: Repair| {
            let (solid, report) = solid.clone().mended(&options, &Silent).unwrap();
            assert_eq!(report.before, Betti::of(&self::Solid::new(solid.signed().clone(), solid.frame).octree));
            assert_eq!((report.after.handles, report.after), (0, Betti::of(&solid.octree)), "{name}");
            let mesh = surface(&solid, Surface::MarchingCubes);
            assert_eq!(check(&mesh).unwrap(), surfaces(&report.after), "{name}");
            assert!(report.before.handles >= handles, "{name}: {}", report.before);
            assert_eq!(
                (report.before.components, report.before.cavities),
                (report.after.components, report.after.cavities)
            );
            report.changed_cells
        };
        let by_area = changed(Repair { genus: Some(0), ..Repair::default() });
        let cut = changed(Repair { cut: Some(f64::INFINITY), ..Repair::default() });
        println!("{name}: {by_area} cells changed, {cut} by cuts alone");
        assert!(by_area <= cells && cut <= cells, "{name}: {by_area} {cut}");
    }
}

/// A ball with a smaller one on top, cut by five of the sides of the box of 8 x 10 x 12.
fn lump(size: [usize; 3], placement: Placement) -> Image {
    let middle = DVec3::new(4.1, 5.05, 6.02);
    let value = |p: DVec3| (5.37 - p.distance(middle)).max(2.13 - p.distance(middle + DVec3::new(1.3, 2.1, 4.4)));
    let [nx, ny, nz] = size;
    let point = |i: usize| DVec3::from([i % nx, i / nx % ny, i / nx / ny].map(|c| c as f64));
    let samples = (0..nx * ny * nz).map(|i| value(placement.to_model(point(i)))).collect();
    Image::new(size, placement, Voxels::F64(samples)).unwrap()
}

#[test]
fn world_coordinates_do_not_depend_on_the_lattice() {
    let level = Level::above(0.0);
    let plain = lump([33, 41, 49], Placement::with_spacing(DVec3::ZERO, DVec3::splat(0.25)));
    let expected = extracted(&plain, level, Method::MarchingCubes);
    let at_border = extracted(&plain, level, Method::SurfaceNets).points.iter().any(|p| p.x < 0.0);
    assert!(check(&expected).is_ok() && at_border);
    let size = volume(&expected);
    // The same samples, exchanged and turned round: the same surface.
    let axes = DMat3::from_cols(DVec3::new(0.0, 0.0, -0.25), DVec3::new(0.25, 0.0, 0.0), DVec3::new(0.0, 0.25, 0.0));
    let turned = lump([49, 33, 41], Placement { origin: DVec3::new(0.0, 0.0, 12.0), axes });
    for method in [Method::MarchingCubes, Method::Trilinear, Method::DualContouring, Method::SurfaceNets] {
        let mesh = extracted(&turned, level, method);
        assert_eq!(check(&mesh), check(&expected));
        assert!((volume(&mesh) - size).abs() < 0.02 * size, "{method:?}");
    }
    let through = surface(&solid(turned, level), Surface::MarchingCubes);
    assert_eq!((through.points.len(), through.faces.len()), (expected.points.len(), expected.faces.len()));
    // Other lattices, with and without the octree: the slanted one holds a little more of the lump.
    let anisotropic = Placement::with_spacing(DVec3::ZERO, DVec3::new(0.25, 0.2, 0.5));
    let slanted = DMat3::from_cols(DVec3::new(0.25, 0.0, 0.0), DVec3::new(0.05, 0.25, 0.0), DVec3::new(0.0, 0.0, 0.25));
    let slanted = Placement { origin: DVec3::new(-2.0, 0.0, 0.0), axes: slanted };
    for (size_of, placement, least, most) in
        [([33, 51, 25], anisotropic, 0.95, 1.05), ([41, 41, 49], slanted, 1.0, 1.2)]
    {
        let image = lump(size_of, placement);
        let meshes =
            [extracted(&image, level, Method::MarchingCubes), surface(&solid(image, level), Surface::MarchingCubes)];
        let volumes = meshes.each_ref().map(volume);
        assert!(meshes.iter().all(|mesh| check(mesh) == check(&expected)));
        assert!(volumes.iter().all(|found| (least..most).contains(&(found / size))), "{volumes:?} {size}");
        assert!((volumes[0] / volumes[1] - 1.0).abs() < 0.03, "{volumes:?}");
    }
}

#[test]
fn open_borders_have_a_rim() {
    let image = lump([33, 41, 49], Placement::with_spacing(DVec3::ZERO, DVec3::splat(0.25)));
    let options = ExtractOptions { border: Border::Open, placement: image.placement(), ..ExtractOptions::default() };
    let mut mesh = Mesh::default();
    extract(&image, &options, &mut mesh, &Silent).unwrap();
    let report = mesh.report();
    assert!(report.boundary_edges > 0 && report.is_manifold() && topology_of(&mesh).is_err());
}

/// Folder and program.
struct Shell(tempfile::TempDir);

impl Shell {
    fn new() -> Self {
        Shell(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// What the program prints, if it succeeds, or its error.
    fn run(&self, args: &str) -> Result<String, String> {
        let mut command = Command::cargo_bin("zmend").unwrap();
        let output = command.current_dir(self.0.path()).args(args.split_whitespace()).output().unwrap();
        if output.status.success() {
            Ok(String::from_utf8(output.stdout).unwrap())
        } else {
            Err(String::from_utf8(output.stderr).unwrap())
        }
    }

    fn json(&self, args: &str) -> Value {
        let out = self.run(&format!("{args} --json")).unwrap_or_else(|e| panic!("{args}: {e}"));
        serde_json::from_str(&out).unwrap()
    }
}

#[test]
fn the_program_extracts_volumes() {
    let shell = Shell::new();
    let placement = Placement::with_spacing(DVec3::ZERO, DVec3::new(0.25, 0.25, 0.5));
    let image = lump([33, 41, 25], placement);
    write_volume(shell.path("lump.mha"), &image, &Silent).unwrap();
    let info = shell.run("info lump.mha").unwrap();
    assert!(info.contains("MetaImage") && info.contains("33 x 41 x 25 of f64") && info.contains("--iso"), "{info}");
    assert_eq!(shell.json("info lump.mha")["size"], serde_json::json!([33, 41, 25]));

    for method in ["mc", "mc33", "dc", "nets", "emc"] {
        let told = shell.json(&format!("extract lump.mha {method}.ply --iso 0 --method {method}"));
        assert_eq!((&told["output"]["solid"], &told["options"]["method"]), (&true.into(), &method.into()), "{told}");
        let mesh = zmend::io::read(shell.path(&format!("{method}.ply"))).unwrap();
        assert_eq!(check(&mesh).unwrap().genus(), 0);
    }
    let told = shell.run("extract lump.mha open.ply --iso 0 --open").unwrap();
    assert!(told.contains("lump.mha -> open.ply: PLY, what is above 0") && told.contains("5 holes"), "{told}");
    // What is below is the rest of the box.
    let told = shell.json("extract lump.mha below.ply --iso 0 --below");
    let above = shell.json("extract lump.mha above.ply --iso 0");
    let sum = [&told, &above].map(|told| told["output"]["volume"].as_f64().unwrap()).iter().sum::<f64>();
    assert!((sum - 33.0 * 41.0 * 25.0 * 0.25 * 0.25 * 0.5).abs() < 5.0, "{sum}");
    // Spacing on the command line goes before the file's.
    let told = shell.json("extract lump.mha above.ply --iso 0 --spacing 0.5,0.5,1 --force");
    let ratio = told["output"]["volume"].as_f64().unwrap() / above["output"]["volume"].as_f64().unwrap();
    assert!((ratio - 8.0).abs() < 1e-3, "{ratio}");

    // Topology goes by cubes; octrees can be written.
    let told = shell.json("extract lump.mha fixed.ply --iso 0 --genus 0");
    assert_eq!((&told["input"]["resampled"], &told["output"]["solid"]), (&0.25.into(), &true.into()), "{told}");
    assert_eq!(told["warnings"][0], "the volume was sampled anew, on cubes 0.25 wide");
    assert_eq!(shell.json("topology lump.mha listed.ply --iso 0 --cut 1")["topology"]["after"]["handles"], 0);
    let listed = shell.json("topology lump.mha --list --iso 0 --cell 0.5");
    assert_eq!((&listed["topology"]["components"], &listed["grid"]["cell_size"]), (&1.into(), &0.5.into()));
    shell.run("extract lump.mha lump.sog --iso 0").unwrap();
    assert!(shell.run("info lump.sog").unwrap().contains("SOG"));

    let Voxels::F64(samples) = image.voxels() else { panic!("doubles were given") };
    let bytes: Vec<u8> = samples.iter().flat_map(|sample| (*sample as f32).to_be_bytes()).collect();
    std::fs::write(shell.path("lump.raw"), bytes).unwrap();
    let raw = shell.json("extract lump.raw raw.ply --iso 0 --raw 33x41x25:f32be --spacing 0.25,0.25,0.5");
    let volumes = [&raw, &above].map(|told| told["output"]["volume"].as_f64().unwrap());
    assert!((volumes[0] - volumes[1]).abs() < 1e-3 * volumes[1], "{volumes:?}");
}

/// Two boxes of one material beside each other in another one fill a block of that size, and their surfaces meet without a gap.
#[test]
fn the_program_extracts_labels_that_fit_together() {
    let shell = Shell::new();
    let material = |at: [usize; 3]| match at {
        [0..4, ..] => 1,
        [4..9, ..] => 6,
        _ => 0,
    };
    let [nx, ny, nz] = [12, 5, 7];
    let voxels = (0..nx * ny * nz).map(|i| material([i % nx, i / nx % ny, i / (nx * ny)])).collect();
    let image = Image::new([nx, ny, nz], Placement::default(), Voxels::U8(voxels)).unwrap();
    write_volume(shell.path("labels.mha"), &image, &Silent).unwrap();
    let [one, six] = [1, 6].map(|label| {
        let told = shell.json(&format!("extract labels.mha {label}.ply --label {label}"));
        assert_eq!((&told["output"]["solid"], &told["options"]["label"]), (&true.into(), &f64::from(label).into()));
        zmend::io::read(shell.path(&format!("{label}.ply"))).unwrap()
    });
    let boundary = |mesh: &Mesh| -> Vec<[[u64; 3]; 3]> {
        let at = |p: u32| mesh.points[p as usize].to_array().map(|c| (c + 100.0).to_bits());
        let mut faces: Vec<[[u64; 3]; 3]> = mesh
            .faces
            .iter()
            .map(|face| {
                let mut corners = [at(face[0]), at(face[1]), at(face[2])];
                corners.sort_unstable();
                corners
            })
            .collect();
        faces.sort_unstable();
        faces
    };
    let (of_one, of_six) = (boundary(&one), boundary(&six));
    let common = of_one.iter().filter(|face| of_six.binary_search(face).is_ok()).count();
    // The wall between them is a square a point of it, but for the rim.
    assert!(common >= 2 * (ny - 1) * (nz - 1), "{common} of {}", of_one.len());
    let error = shell.run("extract labels.mha a.ply --label 3").expect_err("nothing has this label");
    assert!(error.contains("label: no sample is 3; values go from 0 to 6"), "{error}");
    for (args, words) in [
        ("extract labels.mha a.ply --label 6 --method dc", "method: surfaces of labels fit together by surface nets"),
        ("extract labels.mha a.ply --label 6 --cell 0.5", "cell: numbers of materials cannot be interpolated"),
        ("extract labels.mha a.ply --label 3 --genus 0", "label: no sample is 3; values go from 0 to 6"),
    ] {
        let error = shell.run(args).expect_err(args);
        assert!(error.contains(words) && !shell.path("a.ply").exists(), "{args}: {error}");
    }
}

/// A material goes through topology repair as a field of 1 and 0: here two rings, of which the smaller one is dropped and the other one filled or
/// cut; also sampled anew, and by `zmend topology`.
#[test]
fn topology_of_labels_is_repaired() {
    let shell = Shell::new();
    let material = |[x, y, z]: [usize; 3]| {
        let is_ring = |low: usize, high: usize, wide: usize| {
            let is_within = |low: usize, high: usize| (low..high).contains(&x) && (low..high).contains(&y);
            is_within(low, high) && !is_within(low + wide, high - wide)
        };
        let is_of_it = (2..5).contains(&z) && (is_ring(2, 14, 3) || is_ring(20, 25, 2));
        if is_of_it { 7 } else { u8::from(x > 10) * 9 }
    };
    let [nx, ny, nz] = [27, 27, 7];
    let voxels = (0..nx * ny * nz).map(|i| material([i % nx, i / nx % ny, i / (nx * ny)])).collect();
    let image = Image::new([nx, ny, nz], Placement::default(), Voxels::U8(voxels)).unwrap();
    write_volume(shell.path("rings.mha"), &image, &Silent).unwrap();
    let plain = shell.json("extract rings.mha rings.ply --label 7");
    assert_eq!((&plain["output"]["components"], &plain["output"]["genus"]), (&2.into(), &2.into()), "{plain}");
    for (args, genus) in
        [("--drop-islands 80", 1), ("--drop-islands 80 --genus 0", 0), ("--drop-islands 80 --cell 0.5", 1)]
    {
        let told = shell.json(&format!("extract rings.mha one.ply --label 7 --force {args}"));
        assert_eq!((&told["output"]["components"], &told["output"]["solid"]), (&1.into(), &true.into()), "{told}");
        assert_eq!(told["output"]["genus"], genus, "{args}: {told}");
        let volume = told["output"]["volume"].as_f64().unwrap();
        // 324 samples, whose edges nets cut off.
        assert!((265.0..324.0).contains(&volume), "{args}: {volume}");
    }
    let told = shell.json("topology rings.mha --list --label 7");
    assert_eq!((&told["topology"]["components"], &told["topology"]["handles"]), (&2.into(), &2.into()), "{told}");
}

#[test]
fn the_program_says_what_is_wrong_with_volumes() {
    let shell = Shell::new();
    let image = lump([33, 41, 25], Placement::with_spacing(DVec3::ZERO, DVec3::new(0.25, 0.25, 0.5)));
    write_volume(shell.path("lump.nrrd"), &image, &Silent).unwrap();
    shell.run("sample sphere s.ply").unwrap();
    for (args, words) in [
        ("extract lump.nrrd a.ply", "iso: it is not said where the surface lies; values go from -"),
        ("extract lump.nrrd a.ply --iso 300", "iso: no sample is above 300; values go from -"),
        ("extract lump.nrrd a.ply --iso -300 --below", "iso: no sample is below -300"),
        ("extract lump.nrrd a.ply --iso x", "not a finite number"),
        ("extract lump.nrrd a.ply --iso 0 --array b", "array: lump.nrrd is NRRD, whose arrays have no names"),
        ("extract lump.nrrd a.ply --iso 0 --channel 1", "there is no channel 1: samples have 1"),
        ("extract lump.nrrd a.ply --iso 0 --raw 9x9", "raw: \"9x9\" does not describe samples"),
        ("extract lump.nrrd a.ply --iso 0 --raw 99x99x99:f64", "take 7762392 bytes, and there are only"),
        ("extract lump.nrrd a.ply --iso 0 --genus 0 --method emc", "have no such surface; take mc, dc or nets"),
        ("extract lump.nrrd a.ply --iso 0 --genus 0 --open", "leave --open away"),
        ("extract lump.nrrd a.ply --iso 0 --max-memory 1K", "max-memory"),
        ("extract lump.nrrd lump.nrrd --iso 0", "name says no format to write"),
        ("topology lump.nrrd a.ply --iso 0 --genus 0 --depth 6", "depth: lump.nrrd has a grid of its own"),
        ("repair lump.nrrd a.ply", "this is a volume (NRRD), not a mesh; `zmend extract lump.nrrd OUT --iso VALUE`"),
        ("extract none.mhd a.ply --iso 0", "none.mhd: cannot read"),
        ("extract s.ply a.ply --iso 0", "s.ply: the content is that of no volume that is known here"),
        ("extract s.ply a.ply --genus 0", "s.ply: this is no volume; `zmend repair` takes meshes"),
        ("topology s.ply a.ply --genus 0 --iso 1", "iso: s.ply is no volume"),
    ] {
        let error = shell.run(args).expect_err(args);
        assert!(error.contains(words), "{args}: {error}");
        assert!(!shell.path("a.ply").exists(), "{args}");
    }
}

/// Bugs of a well-known resampler: its tables alias at the far side of the box, surfaces are not closed at the border of the box, and signs
/// are wrong where edges are closest.
#[test]
fn resampled_meshes_have_no_long_edges_and_no_holes() {
    for (name, cell) in [("sphere", 0.05), ("knot-holes", 0.06)] {
        let mesh = sample::build(name, 1).unwrap();
        for offset in [Offset::Solid(0.0), Offset::Solid(0.2), Offset::Solid(-0.1), Offset::Shell(0.1)] {
            for surface in [Surface::MarchingCubes, Surface::DualContouring] {
                let options = Options { cell: Some(cell), offset: Some(offset), surface, ..Options::default() };
                let repaired = repair(mesh.clone(), &options).unwrap();
                check(&repaired.mesh).unwrap_or_else(|e| panic!("{name} {offset:?}: {e}"));
                let longest = repaired.mesh.report().max_edge;
                assert!(longest < 2.0 * 3f64.sqrt() * cell, "{name} {offset:?}: {longest}");
            }
        }
    }
    let shell = Shell::new();
    shell.run("sample sphere s.ply").unwrap();
    let told = shell.json("remesh s.ply larger.ply --cell 0.05 --offset 0.5");
    let ball = |radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    let found = told["output"]["volume"].as_f64().unwrap();
    assert!((found - ball(1.5)).abs() < 0.03 * found, "{found}");
    let told = shell.json("remesh s.ply shell.ply --cell 0.05 --offset 0.2 --shell");
    let found = told["output"]["volume"].as_f64().unwrap();
    assert!((found - ball(1.2) + ball(0.8)).abs() < 0.03 * found, "{found}");
    let error = shell.run("remesh s.ply a.ply --cell 0.05 --offset 0.02 --shell").unwrap_err();
    assert!(error.contains("take cells of 0.02 units or less, or more distance"), "{error}");
    assert!(shell.run("remesh s.ply a.ply --cell 0.05 --shell").is_err());
}
