//! Clouds of points to surfaces and back, level sets, and cells round bodies: by the library and as users of the program meet them.

mod common;

use assert_cmd::Command;
use common::{check, data};
use std::collections::{BTreeMap, HashMap};
use std::fs;
use tempfile::TempDir;
use zmend::cloud::{Cloud, CloudOptions, CloudReport, ScatterOptions, scatter};
use zmend::field::{Adapt, Field, Side};
use zmend::geom::Frame;
use zmend::glam::DVec3;
use zmend::mesh::{DistanceOptions, sample};
use zmend::progress::Silent;
use zmend::repair::CellOptions;
use zmend::{Inside, Mesh, Options, Solid, Surface, io, solidify};

/// Points of a mesh, so many hundredths of its diagonal apart.
fn points_of(mesh: &Mesh, percent: f64) -> Cloud {
    let report = mesh.report();
    let spacing = percent / 100.0 * report.bounds.extent().length();
    scatter(mesh, &ScatterOptions { spacing: Some(spacing), ..ScatterOptions::default() }, &Silent).expect("points")
}

/// The surface of a cloud, which is closed, manifold and right side out; the side of its cells.
fn surface_of(cloud: &Cloud, options: &CloudOptions) -> (Mesh, f64, CloudReport) {
    let (solid, report) = Solid::from_cloud(cloud, options, &Silent).expect("a solid");
    assert_eq!(solid.signed().validate(), Ok(()));
    let mut mesh = Mesh::default();
    solid.extract(&Options::default(), &mut mesh, &Silent).expect("a surface");
    check(&mesh).unwrap_or_else(|problem| panic!("{problem}"));
    (mesh, solid.frame.cell_size(), report)
}

/// The greatest distance between two surfaces, either way, in cells.
fn apart(a: &Mesh, b: &Mesh, cell: f64) -> f64 {
    let options = DistanceOptions { samples: 20_000, ..DistanceOptions::default() };
    a.distances(b, options, &Silent).expect("not cancelled").expect("faces").hausdorff() / cell
}

#[test]
fn clouds_of_solids_come_back_within_two_cells() {
    for (name, percent) in
        [("sphere", 2.5), ("torus", 2.0), ("knot", 1.4), ("part", 1.0), ("nested", 0.9), ("cube", 2.0)]
    {
        let mesh = sample::build(name, 2).expect("a sample");
        let mut cloud = points_of(&mesh, percent);
        for with_normals in [true, false] {
            if !with_normals {
                cloud.normals.clear();
            }
            let (surface, cell, report) = surface_of(&cloud, &CloudOptions::default());
            let (is, was) = (check(&surface).expect("closed"), check(&mesh).expect("closed"));
            assert_eq!(is, was, "{name} {with_normals}: {report:?}");
            let apart = apart(&surface, &mesh, cell);
            assert!(apart < 2.0, "{name} {with_normals}: {apart} cells");
            assert_eq!((report.had_normals, report.points), (with_normals, cloud.points.len()));
        }
    }
}

/// Squares of the spacing on a surface, at most: there are some 0.7 points for each.
const MOST_SQUARES: f64 = 75_000.0;

/// How many squares of so many hundredths of its diagonal a mesh has.
fn squares(mesh: &Mesh, percent: f64) -> f64 {
    let report = mesh.report();
    report.area / (percent / 100.0 * report.bounds.extent().length()).powi(2)
}

/// How far points are apart, in hundredths of a diagonal.
const PERCENTS: [f64; 5] = [1.4, 1.0, 0.7, 0.5, 0.35];

/// What the grid itself makes of a mesh, by exact signs.
fn on_grid(mesh: &Mesh, cell: f64) -> Mesh {
    let options = Options { cell: Some(cell), inside: Inside::Winding, ..Options::default() };
    let (solid, _) = solidify(&mut mesh.clone(), &options, &Silent).expect("a solid");
    let mut own = Mesh::default();
    solid.extract(&Options::default(), &mut own, &Silent).expect("a surface");
    own
}

/// How far points of a mesh may be apart so that they resolve it: as far as the width of cells on whose grid the mesh itself comes back within a
/// cell and a quarter and with as many parts and handles. What no such grid resolves has edges sharper than cells, walls thinner than these, or
/// walls inside of walls that bound nothing.
fn resolving(mesh: &Mesh) -> Option<f64> {
    let (diagonal, was) = (mesh.report().bounds.extent().length(), check(mesh).expect("closed"));
    PERCENTS.into_iter().take_while(|&percent| squares(mesh, percent) <= MOST_SQUARES).find(|percent| {
        let width = percent / 100.0 * diagonal;
        let own = on_grid(mesh, width);
        !own.faces.is_empty() && apart(&own, mesh, width) <= 1.25 && check(&own).expect("closed") == was
    })
}

/// What came of the points of a mesh.
struct Back {
    percent: f64,
    points: usize,
    /// In cells, to the mesh and to what the grid itself makes of it.
    apart: [f64; 2],
}

impl Back {
    fn of(mesh: &Mesh, with_normals: bool, percent: f64) -> Back {
        let mut cloud = points_of(mesh, percent);
        if !with_normals {
            cloud.normals.clear();
        }
        let (surface, cell, _) = surface_of(&cloud, &CloudOptions::default());
        let far = |other: &Mesh| {
            if surface.faces.is_empty() || other.faces.is_empty() {
                f64::INFINITY
            } else {
                apart(&surface, other, cell)
            }
        };
        Back { percent, points: cloud.points.len(), apart: [far(mesh), far(&on_grid(mesh, cell))] }
    }
}

impl std::fmt::Display for Back {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Back { percent, points, apart: [mesh, grid] } = self;
        write!(
            f,
            "{percent} %, {points} points, {mesh:.2} cells from the mesh and {grid:.2} from its solid on that grid"
        )
    }
}

/// Closed meshes of the collection, the small ones; with `ZMEND_CLOUDS=all` all of them.
///
/// Those that a grid resolves come back from points so far apart, within two cells of the mesh; without normals from points half as far apart, for
/// sides of a wall are not told apart before. Of others one spacing must do, by which the surface is within two cells of the mesh or, where the mesh has
/// what no grid shows, of what the grid itself makes of it.
#[test]
fn clouds_of_real_solids_come_back_within_two_cells() {
    const SOME: [&str; 7] = [
        "cgal/knot2.off",
        "geometry-central/bob_small.ply",
        "geometry-central/spot.ply",
        "irmb/cactus10k.obj",
        "manifold-elalish/Offset3.obj",
        "trimesh/fixed_top.ply",
        "trimesh/plate_holes.STL",
    ];
    let Some(data) = data() else { return };
    let all = std::env::var("ZMEND_CLOUDS").is_ok_and(|which| which == "all");
    let (mut far, mut skipped, mut seen) = (Vec::new(), Vec::new(), Vec::new());
    let mut counts = [0; 2];
    for path in common::files(&data) {
        let name = common::name(&path);
        let Ok(mesh) = io::read(&path) else { continue };
        // Some are there twice.
        if !(all || SOME.contains(&&*name)) || mesh.faces.is_empty() || check(&mesh).is_err() || seen.contains(&mesh) {
            continue;
        }
        let resolving = resolving(&mesh);
        assert!(all || resolving.is_some(), "{name}");
        for with_normals in [true, false] {
            let share = if with_normals { 1.0 } else { 0.5 };
            let tried = resolving.map_or(PERCENTS.to_vec(), |percent| vec![percent]);
            let tried = tried.into_iter().map(|percent| share * percent);
            let (mut found, mut others) = (None, Vec::new());
            for percent in tried.filter(|&percent| squares(&mesh, percent) <= MOST_SQUARES) {
                let back = Back::of(&mesh, with_normals, percent);
                let [from_mesh, from_grid] = back.apart;
                if from_mesh < 2.0 || resolving.is_none() && from_grid < 2.0 {
                    found = Some(back);
                    break;
                }
                others.push(back.to_string());
            }
            let kind = if resolving.is_some() { "resolved" } else { "not resolved" };
            match found {
                Some(back) => {
                    counts[usize::from(resolving.is_none())] += 1;
                    println!("{name}, {kind}, normals {with_normals}: {back}");
                }
                None if others.is_empty() => skipped.push(format!("{name}, {kind}, normals {with_normals}")),
                None => far.push(format!("{name}, {kind}, normals {with_normals}: {}", others.join("; "))),
            }
        }
        seen.push(mesh);
    }
    println!("too many points:\n{}\nnot within two cells:\n{}", skipped.join("\n"), far.join("\n"));
    println!("{} clouds of {} meshes; {} more of what no grid resolves", counts[0], seen.len(), counts[1]);
    far.retain(|line| !line.contains("not resolved"));
    assert!(counts[0] > 0 && far.is_empty() && (!all || counts[1] >= 17), "{far:?}");
}

/// Nodes inside of a thick layer of cells with points were all negative, and the surface lay up to a cell too far out.
#[test]
fn a11_surfaces_are_not_shifted_by_thick_layers() {
    let mesh = sample::build("sphere", 3).expect("a sample");
    let cloud = points_of(&mesh, 1.2);
    let radius = mesh.points[0].length();
    for depth in [4, 5, 6, 8] {
        let (surface, cell, report) =
            surface_of(&cloud, &CloudOptions { depth: Some(depth), ..CloudOptions::default() });
        let off: f64 = surface.points.iter().map(|p| p.length() - radius).sum::<f64>() / surface.points.len() as f64;
        // Blended planes lie farther out than a ball, by half the square of the spacing.
        assert!(off.abs() < 0.05 * cell.max(report.spacing), "depth {depth}: {off} at cells of {cell}");
    }
}

/// Planes were fitted as z = ax + by + c with sums about the origin: walls, and clouds far from the origin, gave garbage.
#[test]
fn a12_vertical_walls_far_from_the_origin_have_planes() {
    let mut mesh = sample::build("cube", 1).expect("a sample");
    mesh.points.iter_mut().for_each(|p| *p += DVec3::new(3e6, -2e6, 1e6));
    let mut cloud = points_of(&mesh, 2.0);
    cloud.normals.clear();
    let (surface, cell, report) = surface_of(&cloud, &CloudOptions::default());
    let apart = apart(&surface, &mesh, cell);
    assert!(apart < 1.5 && report.seen_from_outside as f64 > 0.9 * report.points as f64, "{apart} {report:?}");
}

/// Marching cubes without a rule for ambiguous faces, skipped cells and unshared vertices made a soup with holes. Here anything is closed.
#[test]
fn a14_whatever_the_points_the_surface_is_closed() {
    let number = |i: u64| {
        let mixed = (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ mixed >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((mixed ^ mixed >> 31) >> 40) as f64 / f64::from(1 << 24)
    };
    let chaos: Vec<DVec3> = (0..800).map(|i| DVec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2))).collect();
    let sheet: Vec<DVec3> = chaos.iter().map(|p| p.with_z(0.5)).collect();
    let line: Vec<DVec3> = chaos.iter().map(|p| DVec3::splat(p.x)).collect();
    let odd: Vec<DVec3> = chaos.iter().flat_map(|&p| [p, p, p.with_x(f64::NAN)]).collect();
    let few = chaos[..4].to_vec();
    let lone: Vec<DVec3> = chaos.iter().map(|p| p * 1e-3).chain([DVec3::splat(1e3)]).collect();
    for (name, points) in
        [("chaos", chaos), ("sheet", sheet), ("line", line), ("odd", odd), ("few", few), ("lone", lone)]
    {
        let normals: Vec<DVec3> = points.iter().map(|p| DVec3::new(p.y, -p.z, p.x * p.x).normalize_or_zero()).collect();
        for normals in [Vec::new(), normals] {
            let cloud = Cloud { points: points.clone(), normals };
            for depth in [None, Some(4), Some(6)] {
                let (_, _, report) = surface_of(&cloud, &CloudOptions { depth, ..CloudOptions::default() });
                assert_eq!(report.points + report.dropped, points.len(), "{name}");
            }
        }
    }
    for points in [Vec::new(), vec![DVec3::ONE; 9], vec![DVec3::NAN; 9]] {
        let cloud = Cloud { points, normals: Vec::new() };
        let error = Solid::from_cloud(&cloud, &CloudOptions::default(), &Silent).expect_err("too few");
        assert!(error.to_string().contains("not enough for a surface"), "{error}");
    }
}

#[test]
fn holes_close_smoothly_where_there_are_normals() {
    let mesh = sample::build("sphere", 3).expect("a sample");
    let radius = mesh.points[0].length();
    let mut cloud = points_of(&mesh, 1.5);
    let keeps: Vec<bool> = cloud.points.iter().map(|p| p.z < 0.8 * radius).collect();
    for list in [&mut cloud.points, &mut cloud.normals] {
        let mut keep = keeps.iter();
        list.retain(|_| *keep.next().expect("one each"));
    }
    let (surface, cell, _) = surface_of(&cloud, &CloudOptions::default());
    assert_eq!(check(&surface).expect("closed").euler, 2);
    // Between the flat cap and the round one.
    let top = surface.points.iter().map(|p| p.z).fold(0.0, f64::max);
    assert!((0.8 * radius - cell..radius + cell).contains(&top), "{top} of {radius}");
}

#[test]
fn fields_adapt_and_their_surfaces_are_closed() {
    let frame = Frame::new(DVec3::splat(-2.0), 4.0, 7).expect("a cube");
    let torus = |p: DVec3| (p.x.hypot(p.y) - 1.1).hypot(p.z) - 0.4;
    let mut sizes = Vec::new();
    for tolerance in [0.0, 0.002, 0.02] {
        let field = Field::build(frame, &torus, Adapt { tolerance, ..Adapt::default() }, &Silent).expect("a field");
        assert_eq!(field.nodes().tree().imbalance(zmend::octree::Balance::Edges), None);
        sizes.push(field.nodes().len());
        for octree in [field.signed(&Silent).expect("signs"), field.signed_by(&torus, &Silent).expect("signs")] {
            assert_eq!(octree.validate(), Ok(()));
            for surface in [Surface::MarchingCubes, Surface::DualContouring] {
                let mut mesh = Mesh::default();
                let solid = Solid::new(octree.clone(), frame);
                solid.extract(&Options { surface, ..Options::default() }, &mut mesh, &Silent).expect("a surface");
                assert_eq!(check(&mesh).expect("closed").euler, 0);
                let worst = mesh.points.iter().map(|&p| torus(p).abs()).fold(0.0, f64::max);
                assert!(worst < 0.01 + 2.0 * tolerance, "{tolerance}: {worst}");
            }
        }
    }
    assert!(sizes[0] > sizes[1] && sizes[1] > 2 * sizes[2], "{sizes:?}");
    // What is inside at the boundary of the root is closed there.
    let all = Field::build(frame, &|p: DVec3| p.x - 9.0, Adapt::default(), &Silent).expect("a field");
    let mut mesh = Mesh::default();
    Solid::new(all.signed(&Silent).expect("signs"), frame)
        .extract(&Options::default(), &mut mesh, &Silent)
        .expect("a box");
    assert_eq!(check(&mesh).expect("closed").euler, 2);
}

#[test]
fn volumes_of_fields_give_the_same_surface() {
    use zmend::contour::volume::{ExtractOptions, extract};
    use zmend::volume::{Level, Placement};

    let frame = Frame::new(DVec3::splat(-2.0), 4.0, 5).expect("a cube");
    let field = Field::build(frame, &|p: DVec3| p.length() - 1.3, Adapt::default(), &Silent).expect("a field");
    let placement = Placement::with_spacing(frame.origin(), DVec3::splat(frame.cell_size()));
    let options = ExtractOptions { level: Level::below(0.0), placement, ..ExtractOptions::default() };
    let (mut of_volume, mut of_octree) = (Mesh::default(), Mesh::default());
    extract(&field, &options, &mut of_volume, &Silent).expect("a surface");
    Solid::new(field.signed(&Silent).expect("signs"), frame)
        .extract(&Options::default(), &mut of_octree, &Silent)
        .expect("a surface");
    assert_eq!(check(&of_volume), check(&of_octree));
    assert_eq!(of_volume.points.len(), of_octree.points.len());
    assert!(apart(&of_volume, &of_octree, frame.cell_size()) < 1e-3);
}

/// A solid of a built-in mesh.
fn solid(name: &str, depth: u32) -> (Mesh, Solid) {
    let mesh = sample::build(name, 1).expect("a sample");
    let options = Options { depth, surface: Surface::DualContouring, ..Options::default() };
    let (solid, _) = solidify(&mut mesh.clone(), &options, &Silent).expect("a solid");
    (mesh, solid)
}

#[test]
fn cells_fill_the_cube_and_know_their_side() {
    let (mesh, solid) = solid("part", 6);
    let cells = solid.cells(Surface::DualContouring, &CellOptions::default(), &Silent).expect("cells");
    let size = |level: u8| solid.frame.size() / f64::from(1u32 << level);
    let volume = |side: Side| -> f64 {
        let of_side = cells.levels.iter().zip(&cells.sides).filter(|(_, s)| **s == side);
        of_side.map(|(&level, _)| size(level).powi(3)).sum()
    };
    let [outside, inside, cut] = [Side::Outside, Side::Inside, Side::Cut].map(volume);
    let whole = solid.frame.size().powi(3);
    assert!((outside + inside + cut - whole).abs() < 1e-9 * whole);
    let report = mesh.report();
    assert!(inside < report.volume && report.volume < inside + cut, "{inside} {} {cut}", report.volume);
    let mut corners_used = vec![false; cells.points.len()];
    for ((corners, &level), side) in cells.cells.iter().zip(&cells.levels).zip(&cells.sides) {
        let at = corners.map(|i| cells.points[i as usize]);
        // Counterclockwise below, then above.
        assert!((at[1] - at[0]).cross(at[3] - at[0]).dot(at[4] - at[0]) > 0.99 * size(level).powi(3));
        assert!((at[6] - at[0] - size(level)).length() < 1e-9 * whole.cbrt());
        corners.iter().for_each(|&i| corners_used[i as usize] = true);
        let inside = corners.iter().filter(|&&i| cells.distances[i as usize] < 0.0).count();
        assert_eq!(
            *side,
            match inside {
                0 => Side::Outside,
                8 => Side::Inside,
                _ => Side::Cut,
            }
        );
    }
    assert!(corners_used.iter().all(|&used| used));
    // Distances change by no more than places do.
    for corners in &cells.cells {
        let [a, b] = [corners[0], corners[6]].map(|i| (cells.points[i as usize], cells.distances[i as usize]));
        assert!((a.1 - b.1).abs() <= a.0.distance(b.0) * 1.0001 + 0.5 * solid.frame.cell_size());
    }
    // A face is that of one neighbour, or of four half as large: each node in the middle of a face of a cell belongs to cells one level
    // finer.
    let only = CellOptions { outside: false, distances: false, ..CellOptions::default() };
    let body = solid.cells(Surface::DualContouring, &only, &Silent).expect("cells");
    assert_eq!(body.cells.len(), cells.count(Side::Inside) + cells.count(Side::Cut));
    assert!(body.distances.is_empty() && body.points.len() < cells.points.len());
    let mut faces: BTreeMap<[u32; 4], u32> = BTreeMap::new();
    for corners in &body.cells {
        for face in [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [0, 3, 7, 4], [1, 2, 6, 5]] {
            let mut face = face.map(|i: usize| corners[i]);
            face.sort_unstable();
            *faces.entry(face).or_default() += 1;
        }
    }
    assert!(faces.values().all(|&uses| uses <= 2));
}

#[test]
fn distance_fields_and_samples_agree_with_the_mesh() {
    let (mesh, solid) = solid("cube", 6);
    let exact = |p: DVec3| {
        let beyond = (p - 0.5).abs() - 0.5;
        beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0)
    };
    assert_eq!(mesh.report().bounds.max, DVec3::ONE);
    let cell = solid.frame.cell_size();
    let field = solid
        .distance_field(Surface::DualContouring, Adapt { tolerance: 0.1 * cell, ..Adapt::default() }, &Silent)
        .expect("a field");
    for i in 0..500u32 {
        let p = solid.frame.origin()
            + solid.frame.size() * DVec3::new(f64::from(i % 8), f64::from(i / 8 % 8), f64::from(i / 64)) / 8.3;
        let (found, expected) = (field.value_at(p).expect("in the cube"), exact(p));
        // Leaves are coarse where the surface cannot be.
        assert!((found - expected).abs() < 0.35 * cell + 0.4 * expected.abs(), "{p}: {found} {expected}");
    }
    let image = solid.distance_image(Surface::DualContouring, 4, &Silent).expect("samples");
    assert_eq!(image.size(), [17; 3]);
    let samples: HashMap<[usize; 3], f64> = (0..17usize.pow(3))
        .map(|i| [i % 17, i / 17 % 17, i / 289])
        .map(|at| (at, image.voxels().value(image.index(at))))
        .collect();
    for (at, value) in samples {
        let expected = exact(image.placement().to_model(DVec3::from_array(at.map(|c| c as f64))));
        assert!((value - expected).abs() < 0.3 * cell, "{at:?}: {value} {expected}");
    }
    assert!(solid.distance_image(Surface::DualContouring, 7, &Silent).is_err());
    let deep = CellOptions { coarsest: 7, ..CellOptions::default() };
    assert!(
        solid
            .cells(Surface::DualContouring, &deep, &Silent)
            .expect_err("too deep")
            .to_string()
            .contains("take 6 or less")
    );
}

/// A folder to run the program in.
struct Folder(TempDir);

impl Folder {
    fn run(&self, args: &str) -> (i32, String, String) {
        let mut command = Command::cargo_bin("zmend").expect("built");
        let output = command.current_dir(self.0.path()).args(args.split_whitespace()).output().expect("runs");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        (output.status.code().expect("a code"), text(output.stdout), text(output.stderr))
    }

    #[track_caller]
    fn out(&self, args: &str) -> String {
        let (code, out, err) = self.run(args);
        assert_eq!((code, &*err), (0, ""), "{args}: {out}");
        out
    }

    #[track_caller]
    fn error(&self, args: &str) -> String {
        let (code, out, err) = self.run(args);
        assert!(code != 0 && out.is_empty(), "{args}: {out}");
        err
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.0.path().join(name)).expect("written")
    }
}

#[test]
fn the_program_takes_points_and_makes_surfaces_of_them() {
    let folder = Folder(tempfile::tempdir().expect("a folder"));
    folder.out("sample torus torus.ply");
    let told = folder.out("points torus.ply cloud.xyz --spacing 2%");
    assert!(told.starts_with("cloud.xyz: ") && told.contains(" points, "), "{told}");
    folder.out("points torus.ply cloud.ply --spacing 2%");
    folder.out("points torus.ply rows.csv --spacing 2% --pattern regular --no-normals");
    let text = folder.out("surface cloud.xyz again.ply");
    assert!(text.contains("told by normals") && text.ends_with("closed, manifold, oriented: a solid\n"), "{text}");
    let text = folder.out("surface cloud.xyz again.ply --no-normals --force --threads 1");
    assert!(text.contains("seen from outside for "), "{text}");
    let one = folder.bytes("again.ply");
    folder.out("surface cloud.xyz again.ply --no-normals --force --threads 3");
    assert_eq!(one, folder.bytes("again.ply"));
    for args in [
        "surface cloud.ply other.stl --surface dc --keep largest",
        "surface rows.csv rows.off --depth 6",
        "surface torus.ply octree.sog",
    ] {
        folder.out(&format!("{args} --quiet"));
    }
    let text = folder.out("surface cloud.ply ball.ply --method ball");
    assert!(text.contains("boundary edges") && text.contains("manifold, oriented"), "{text}");
    assert!(folder.error("surface cloud.ply b.ply --radius 3").contains("only a ball has a radius"));
    let json: serde_json::Value = serde_json::from_str(&folder.out("surface cloud.ply a.stl --json")).expect("JSON");
    assert_eq!((json["input"]["had_normals"].as_bool(), json["output"]["euler"].as_i64()), (Some(true), Some(0)));
    assert_eq!(
        json["input"]["points"].as_u64(),
        Some(fs::read_to_string(folder.0.path().join("cloud.xyz")).expect("text").lines().count() as u64)
    );

    fs::write(folder.0.path().join("bad.xyz"), "1 2 3\n4 5\n").expect("written");
    assert!(folder.error("surface bad.xyz x.stl").contains("bad.xyz: line 2: expected three numbers"));
    fs::write(folder.0.path().join("few.xyz"), "1 2 3\n4 5 6\n").expect("written");
    assert!(folder.error("surface few.xyz x.stl").contains("2 points are not enough"));
    assert!(folder.error("points torus.ply cloud.stl").contains("ends in .xyz or .ply"));
    assert!(folder.error("points torus.ply cloud.xyz").contains("exists already"));
    assert!(folder.error("points torus.ply b.xyz --spacing 0").contains("spacing"));
    assert!(folder.error("surface cloud.xyz b.stl --depth 3").contains("depth"));
    assert!(folder.error("surface cloud.xyz b.stl --depth 12 --max-memory 1M").contains("max-memory"));
    assert!(!folder.0.path().join("b.stl").exists() && !folder.0.path().join("b.xyz").exists());
}

#[test]
fn the_program_makes_cells_of_bodies() {
    let folder = Folder(tempfile::tempdir().expect("a folder"));
    folder.out("sample part part.ply");
    let text = folder.out("octmesh part.ply part.vtu --depth 5");
    assert!(text.contains("cells cut") && text.contains("nodes"), "{text}");
    let text = folder.out("octmesh part.ply text.vtu --depth 4 --ascii --only inside,cut --no-distances");
    assert!(text.contains("cells inside"), "{text}");
    let vtu = String::from_utf8(folder.bytes("text.vtu")).expect("text");
    assert!(
        vtu.contains("Name=\"side\"") && !vtu.contains("Name=\"distance\"") && vtu.trim_end().ends_with("</VTKFile>")
    );
    folder.out("octmesh part.ply part.mha --depth 4");
    assert!(folder.out("info part.mha").contains("17 x 17 x 17"));
    folder.out("repair part.ply part.sog --depth 5");
    let json: serde_json::Value = serde_json::from_str(&folder.out("octmesh part.sog p.vtu --json")).expect("JSON");
    let count = |name: &str| json["output"]["counts"][name].as_u64().expect("a number");
    assert_eq!(count("cells"), count("cells_outside") + count("cells_inside") + count("cells_cut"));
    assert!(folder.error("octmesh part.ply part.stl").contains("ends in .vtu or .mha"));
    assert!(folder.error("octmesh part.ply q.vtu --depth 4 --coarsest 5").contains("coarsest"));
}
