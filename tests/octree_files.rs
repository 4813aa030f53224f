//! Octree files: round trips, the sample of the original program, files of other hands, and broken ones.

use proptest::prelude::*;
use std::path::Path;
use zmend::contour::marching_cubes;
use zmend::geom::Frame;
use zmend::glam::DVec3;
use zmend::grid::Key;
use zmend::grid::brick::{Local, Plane};
use zmend::io::{self, OctreeFile, OctreeFormat, read_octree, read_octree_bytes};
use zmend::mesh::{Mesh, TriangleSource, sample};
use zmend::octree::crossings::{Sample, lattice_point};
use zmend::octree::{CellPoints, SignedOctree};
use zmend::progress::Silent;
use zmend::{Faces, Options, Solid, Surface, sign, solidify};

const FORMATS: [OctreeFormat; 3] = [OctreeFormat::Sof, OctreeFormat::Sog, OctreeFormat::Dcf];

/// Points in the middle of cells, moved a little: enough to see whether each comes back to its cell.
struct Middles(Frame);

impl CellPoints for Middles {
    fn of_bricks(&self, octree: &SignedOctree, bricks: &[u32], points: &mut Vec<[f32; 3]>) {
        for &i in bricks {
            let origin = octree.crossings().origin(&octree.crossings().bricks()[i as usize]);
            points.extend(octree.mixed_cells(i as usize).iter().map(|cell| {
                let at = DVec3::from(std::array::from_fn(|a| f64::from(origin[a] + cell.coords()[a])));
                self.0.to_model(at + 0.5 + 0.25 * (at * 0.7).sin()).as_vec3().to_array()
            }));
        }
    }
}

/// The octree of signs at lattice points 1 .. 2^depth - 1; samples at pseudo-random places.
fn octree(depth: u32, with_normals: bool, is_inside: impl Fn([u32; 3]) -> bool) -> SignedOctree {
    let bricks = 1u32 << (depth - 3);
    let mut signs: Vec<(Key, Plane)> = Vec::new();
    for i in 0..bricks.pow(3) {
        let key = Key::cell(depth - 3, [i / bricks / bricks, i / bricks % bricks, i % bricks]).expect("in the root");
        let origin = lattice_point(depth, key);
        let mut plane = Plane::EMPTY;
        let points = (0..512).map(Local::from_index);
        let at = |p: Local| std::array::from_fn(|a| origin[a] + p.coords()[a]);
        points.filter(|&p| !at(p).contains(&0) && is_inside(at(p))).for_each(|p| plane.set(p));
        signs.push((key, plane));
    }
    signs.sort_unstable_by_key(|brick| brick.0);
    let samples = |brick: usize, crossed: &[Plane; 3], list: &mut Vec<Sample>| {
        let mut state = brick as u32;
        let crossings: u32 = crossed.iter().map(Plane::count).sum();
        list.extend((0..crossings).map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Codes are two numbers from 0 to 254.
            let [a, b] = [state >> 24, state >> 16 & 255].map(|c| (c % 255) as u16);
            Sample::new(state as u16, a << 8 | b)
        }));
    };
    let octree = SignedOctree::from_signs(depth, with_normals, &signs, |_| false, samples);
    assert_eq!(octree.validate(), Ok(()));
    octree
}

/// Solid noise of some density, in eighths.
fn noise(seed: u64, density: u64) -> impl Fn([u32; 3]) -> bool {
    move |p| {
        let mix = |h: u64, c: &u32| (h ^ u64::from(*c)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
        p.iter().fold(seed, mix) % 8 < density
    }
}

fn unit(depth: u32) -> Frame {
    Frame::new(DVec3::ZERO, 1.0, depth).expect("a unit cube")
}

/// The bytes of an octree in a format; SOG files get the points they came with, or else [`Middles`].
fn written(octree: &SignedOctree, frame: &Frame, points: Option<&dyn CellPoints>, format: OctreeFormat) -> Vec<u8> {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("octree").with_extension(format.extension());
    let middles = Middles(*frame);
    let bytes = match format {
        OctreeFormat::Sof => io::write_sof(&path, octree, &Silent),
        OctreeFormat::Sog => io::write_sog(&path, octree, frame, points.unwrap_or(&middles), &Silent),
        _ => io::write_dcf(&path, octree, &Silent),
    };
    let written = std::fs::read(&path).expect("there");
    assert_eq!(bytes.expect("written"), written.len() as u64);
    written
}

fn rewritten(file: &OctreeFile) -> Vec<u8> {
    let points = file.points.as_ref().map(|points| points as &dyn CellPoints);
    written(&file.octree, &file.frame, points, file.info.format)
}

/// An octree of a sample mesh, and its frame.
fn scanned(name: &str, depth: u32) -> (SignedOctree, Frame) {
    let mut mesh = sample::build(name, 1).expect("a sample");
    let frame = Frame::fit(&mesh.bounds().expect("bounds"), depth, 0.9).expect("a frame");
    let scan = sign::scan(&mut mesh, &frame, true, &Silent).expect("scanned");
    let (crossings, _) = sign::close(scan.crossings, &Silent).expect("closed");
    (sign::parity_signs(crossings), frame)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn signs_and_samples_survive(seed in any::<u64>(), density in 0u64..=8, depth in 3u32..=5) {
        let octree = octree(depth, true, noise(seed, density));
        for format in FORMATS {
            let bytes = written(&octree, &unit(depth), None, format);
            let file = read_octree_bytes("noise", &bytes, Some(format)).expect("well formed");
            prop_assert_eq!(file.octree.validate(), Ok(()));
            prop_assert_eq!(file.info.trailing_bytes, 0);
            prop_assert_eq!(file.octree.inside(), octree.inside());
            let keys = |octree: &SignedOctree| octree.crossings().bricks().iter().map(|b| b.key).collect::<Vec<_>>();
            prop_assert_eq!(keys(&file.octree), keys(&octree));
            if format == OctreeFormat::Dcf {
                let (a, b) = (file.octree.crossings(), octree.crossings());
                prop_assert!(a.offsets().iter().eq(b.offsets().iter()) && a.normals().iter().eq(b.normals().iter()));
                prop_assert_eq!(file.info.missing_samples, 0);
            }
            prop_assert_eq!(rewritten(&file), bytes, "{}", format);
        }
    }

    /// Whatever a damaged file says, it is an error or an octree that holds what octrees promise.
    #[test]
    fn damaged_files_do_no_harm(seed in any::<u64>(), flips in prop::collection::vec((any::<prop::sample::Index>(), 0u32..8), 1..4)) {
        let octree = octree(3, true, |p| noise(seed, 1)(p) && p.iter().all(|&c| c < 7));
        for format in FORMATS {
            let mut bytes = written(&octree, &unit(3), None, format);
            for (at, bit) in &flips {
                let i = at.index(bytes.len());
                bytes[i] ^= 1 << bit;
            }
            if let Ok(file) = read_octree_bytes("damaged", &bytes, Some(format)) {
                prop_assert_eq!(file.octree.validate(), Ok(()));
                let again = rewritten(&file);
                let again = read_octree_bytes("again", &again, Some(format)).expect("ours");
                prop_assert_eq!(again.octree.inside(), file.octree.inside());
            }
        }
    }
}

#[test]
fn cut_files_are_errors() {
    let octree = octree(4, true, |p| p.iter().map(|&c| (c as i32 - 7).pow(2)).sum::<i32>() < 9);
    for format in FORMATS {
        let bytes = written(&octree, &unit(4), None, format);
        for len in 0..bytes.len() {
            let error = read_octree_bytes("cut", &bytes[..len], Some(format)).expect_err("a part is missing");
            assert!(error.to_string().starts_with("cut: byte "), "{error}");
        }
        let longer = [&bytes[..], b"more"].concat();
        assert_eq!(read_octree_bytes("longer", &longer, Some(format)).expect("readable").info.trailing_bytes, 4);
    }
}

/// The sizes that the formats give to numbers of nodes, as in the files of the original (bunny at depth 7).
#[test]
fn sizes_follow_from_the_nodes() {
    let (octree, frame) = scanned("gear", 6);
    let sizes = FORMATS.map(|format| written(&octree, &frame, None, format).len() as u64);
    let info = read_octree_bytes("gear", &written(&octree, &frame, None, OctreeFormat::Sof), Some(OctreeFormat::Sof));
    let (leaves, empty) = info.map(|file| (file.info.surface_cells, file.info.empty_cells)).expect("readable");
    let inner = (leaves + empty - 1) / 7;
    // Each crossed edge is in four cells.
    let samples = 4 * octree.crossings().len() as u64;
    assert_eq!(sizes[0], 4 + inner + 2 * (empty + leaves));
    assert_eq!(sizes[1], 128 + sizes[0] + 12 * leaves);
    assert_eq!(sizes[2], 22 + 4 * inner + 6 * empty + 68 * leaves + 16 * samples);
    let of_bunny = |leaves: u64, empty: u64, crossings: u64| {
        let inner = (leaves + empty - 1) / 7;
        let sof = 4 + inner + 2 * (empty + leaves);
        [sof, 128 + sof + 12 * leaves, 22 + 4 * inner + 6 * empty + 68 * leaves + 64 * crossings]
    };
    assert_eq!(of_bunny(46_027, 60_843, 45_858), [229_011, 781_463, 6_490_896]);
}

#[test]
fn bytes_are_those_of_the_description() {
    // One lattice point inside, in the middle of a grid of two cells a side.
    let corners: [u8; 8] = std::array::from_fn(|i| !(1 << (7 - i)));
    let sof: Vec<u8> = [2, 0, 0, 0, 0].into_iter().chain(corners.iter().flat_map(|&signs| [2, signs])).collect();
    let file = read_octree_bytes("two", &sof, Some(OctreeFormat::Sof)).expect("well formed");
    assert_eq!((file.info.depth, file.info.surface_cells, file.octree.crossings().len()), (1, 8, 6));
    assert_eq!((file.frame.depth(), file.frame.size(), file.frame.cell_size()), (3, 4.0, 0.5));
    assert!(file.octree.is_inside([1, 1, 1]));
    assert!((file.octree.volume() - 1.0).abs() < 1e-4);

    let mut sog = b"SOG.Format 1.0\0".to_vec();
    [-1.0f32, 2.0, 5.0, 4.0].iter().for_each(|number| sog.extend(number.to_le_bytes()));
    sog.resize(128, 0);
    sog.extend([2, 0, 0, 0, 0]);
    for (i, &signs) in (0..8).zip(&corners) {
        sog.extend([2, signs]);
        let place = |axis: u32, low: f32| low + 1.5 + 1.0 * f32::from(i >> axis & 1 == 1);
        [place(2, -1.0), place(1, 2.0), place(0, 5.0)].iter().for_each(|c| sog.extend(c.to_le_bytes()));
    }
    let file = read_octree_bytes("two", &sog, None).expect("well formed");
    assert_eq!((file.info.format, file.frame.origin()), (OctreeFormat::Sog, DVec3::new(-1.0, 2.0, 5.0)));
    assert_eq!(file.frame.cell_size(), 2.0);
    // The points are those of a cube of side 1: all edges meet its faces at 1/4 or 3/4, at a right angle.
    let mut mesh = Mesh::default();
    marching_cubes(&file.octree, &file.frame, &mut mesh, &Silent).expect("memory");
    let middle = DVec3::new(1.0, 4.0, 7.0);
    assert!(mesh.points.iter().all(|p| (p.distance(middle) - 0.5).abs() < 1e-3), "{:?}", mesh.points);

    let int = |n: i32| n.to_le_bytes();
    let mut dcf = b"multisign\0".to_vec();
    (0..3).for_each(|_| dcf.extend(int(2)));
    dcf.extend(int(0));
    for signs in corners {
        dcf.extend(int(2));
        (0..8).for_each(|i| dcf.extend([1 - (signs >> i & 1), 0]));
        for edge in zmend::grid::Edge::ALL {
            let [a, b] = edge.corners().map(|c| signs >> c.index() & 1);
            dcf.extend(int(i32::from(a != b)));
            if a != b {
                let axis = edge.axis().index();
                let outward = if a == 0 { 1.0f32 } else { -1.0 };
                dcf.extend(0.75f32.to_le_bytes());
                (0..3).for_each(|i| dcf.extend((if i == axis { outward } else { 0.0 }).to_le_bytes()));
            }
        }
    }
    let file = read_octree_bytes("two", &dcf, None).expect("well formed");
    assert_eq!((file.info.format, file.info.missing_samples), (OctreeFormat::Dcf, 0));
    assert!(file.octree.crossings().offsets().iter().all(|&offset| offset == 3 << 14));
    assert!(file.octree.is_inside([1, 1, 1]) && !file.octree.is_inside([1, 1, 2]));
}

#[test]
fn what_makes_no_sense_is_refused() {
    let refusal = |nodes: &[u8]| {
        let bytes = [&[8, 0, 0, 0], nodes].concat();
        read_octree_bytes("x.sof", &bytes, Some(OctreeFormat::Sof)).expect_err("no sense").to_string()
    };
    assert!(refusal(&[7]).contains("type 7"));
    assert!(refusal(&[0; 100]).contains("finest level is divided"));
    // Four cells a side are inside in one corner of the grid, in another one eight corners say so of one cell.
    let one_child = |i: usize, child: &[u8]| {
        let empty = [1, 1];
        let children = (0..8).flat_map(|c| if c == i { child.to_vec() } else { empty.to_vec() });
        [0].into_iter().chain(children).collect::<Vec<u8>>()
    };
    let inner_cell = one_child(0, &one_child(7, &one_child(0, &[2, 0])));
    assert!(refusal(&inner_cell).contains("disagree"), "{}", refusal(&inner_cell));
    // Cells without a change of sign may be surface cells, at any level.
    let fine = [&[8, 0, 0, 0][..], &one_child(3, &[2, 255])].concat();
    let file = read_octree_bytes("x.sof", &fine, Some(OctreeFormat::Sof)).expect("all outside");
    assert_eq!((file.info.surface_cells_outside, file.info.empty_cells), (1, 7));
    assert!(file.octree.crossings().is_empty());

    for cells in [0, -1, 3, 1 << 19, i32::MIN] {
        let bytes = [&i32::to_le_bytes(cells)[..], &[1, 1]].concat();
        let error = read_octree_bytes("x.sof", &bytes, Some(OctreeFormat::Sof)).expect_err("no grid").to_string();
        assert!(error.contains("power of two"), "{error}");
    }
    assert!(read_octree_bytes("x", &[8, 0, 0, 0, 1, 1], None).expect_err("who knows").to_string().contains(".sof"));
}

/// Deep files of a few bytes are quick, and none is an exception from the rule.
#[test]
fn depth_costs_nothing() {
    let (mut bytes, deep) = ((1i32 << 18).to_le_bytes().to_vec(), 18);
    (0..deep).for_each(|_| bytes.push(0));
    bytes.extend([1; 2].repeat(8 + 7 * (deep - 1)));
    let file = read_octree_bytes("deep.sof", &bytes, Some(OctreeFormat::Sof)).expect("well formed");
    assert_eq!((file.info.depth, file.info.empty_cells), (18, 127));
    assert_eq!(rewritten(&file).len(), 6, "one empty node");
}

#[test]
fn points_give_back_the_surface() {
    let (octree, frame) = scanned("knot", 6);
    let points = zmend::contour::CellVertices::new(frame, zmend::contour::Placement::SharpFeatures);
    let bytes = written(&octree, &frame, Some(&points), OctreeFormat::Sog);
    let file = read_octree_bytes("knot.sog", &bytes, None).expect("ours");
    assert_eq!(file.points.as_ref().map_or(0, zmend::octree::StoredPoints::len) as u64, file.info.surface_cells);
    // Where edges are crossed was lost; the points of the cells around tell it to within some hundredths of a cell.
    let (a, b) = (octree.crossings(), file.octree.crossings());
    assert_eq!(a.len(), b.len());
    let errors = a.offsets().iter().zip(b.offsets().iter()).map(|(&a, &b)| f64::from(a.abs_diff(b)) / 65536.0);
    let mean = errors.clone().sum::<f64>() / a.len() as f64;
    let large = errors.filter(|&e| e > 0.25).count();
    assert!(mean < 0.05 && large * 50 < a.len(), "mean {mean}, {large} of {} are off by more than a quarter", a.len());
}

/// What the file of a solid gives as dual surface is what the solid itself gives, rounded to 32 bits, but for the few cells with several
/// sheets, as the file has one point for all of them, and for creases that bulge into the next cell: points of files stay in their cells.
#[test]
fn dual_surfaces_come_back() {
    for (name, surface, most) in [("gear", Surface::DualContouring, 0.02), ("knot-holes", Surface::Quads, 0.005)] {
        let options = Options { depth: 6, surface, faces: Faces::Polygons, ..Options::default() };
        let mut mesh = sample::build(name, 1).expect("a sample");
        let with_normals = Options { surface: Surface::DualContouring, ..options };
        let (solid, _) = solidify(&mut mesh, &with_normals, &Silent).expect("repairable");
        let points = solid.cell_points(surface).expect("there are normals");
        let bytes = written(solid.signed(), &solid.frame, Some(points.as_ref()), OctreeFormat::Sog);
        let file = read_octree_bytes(name, &bytes, None).expect("ours");
        let read = Solid::from(file);
        let extracted = |solid: &Solid, surface| {
            let mut mesh = Mesh::default();
            solid.extract(&Options { surface, ..options }, &mut mesh, &Silent).expect("memory");
            assert_eq!(mesh.validate(), Ok(()));
            mesh
        };
        // Dual contouring takes the points of the file, whatever they are.
        let (direct, again) = (extracted(&solid, surface), extracted(&read, Surface::DualContouring));
        assert_eq!((direct.points.len(), direct.faces.len()), (again.points.len(), again.faces.len()));
        let cell = solid.frame.cell_size();
        let differ = direct.points.iter().zip(&again.points).filter(|(a, b)| a.distance(**b) > 1e-4 * cell).count();
        let part = differ as f64 / direct.points.len() as f64;
        assert!(part < most, "{name}: {differ} of {} points differ", direct.points.len());
        assert!(extracted(&read, Surface::MarchingCubes).report().volume > 0.0);
        let options = Options { no_self_intersections: true, ..options };
        let mut disjoint = Mesh::default();
        read.extract(&options, &mut disjoint, &Silent).expect("memory");
        assert_eq!(disjoint.validate(), Ok(()));
    }
}

#[test]
fn surfaces_that_need_normals_need_them() {
    let solid = Solid::new(octree(3, false, |p| p == [4, 4, 4]), unit(3));
    let mut mesh = Mesh::default();
    let sharp = Options { surface: Surface::DualContouring, ..Options::default() };
    assert!(solid.extract(&sharp, &mut mesh, &Silent).expect_err("no normals").to_string().contains("take mc"));
    assert!(solid.cell_points(Surface::MarchingCubes).is_err() && solid.cell_points(Surface::Blocks).is_ok());
    let path = tempfile::tempdir().expect("a directory").path().join("x.dcf");
    assert!(io::write_dcf(path, solid.signed(), &Silent).expect_err("no normals").to_string().contains("SOF"));
    for surface in [Surface::MarchingCubes, Surface::Quads, Surface::Blocks] {
        let mut mesh = Mesh::default();
        solid.extract(&Options { surface, ..sharp }, &mut mesh, &Silent).expect("memory");
        assert_eq!((mesh.validate(), mesh.report().genus), (Ok(()), Some(0)));
    }
}

#[test]
fn the_sample_of_the_original() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/volumes/topomender/sogfile.sog");
    if !path.is_file() {
        println!("skipped: no {}", path.display());
        return;
    }
    let file = read_octree(&path, &Silent).expect("the original's");
    let info = &file.info;
    assert_eq!((info.format, info.depth, info.trailing_bytes), (OctreeFormat::Sog, 6, 0));
    assert_eq!((info.surface_cells, info.surface_cells_outside, info.surface_cells_inside), (12_911, 21, 4));
    assert!((file.frame.size() - 201.1).abs() < 0.1, "{}", file.frame.size());
    assert_eq!(file.octree.validate(), Ok(()));
    // Written again, it is the same file but for the 25 surface cells without a change of sign, each of which becomes (part of) an
    // empty node.
    let again = rewritten(&file);
    let file_again = read_octree_bytes("again", &again, None).expect("ours");
    assert_eq!(file_again.info.surface_cells, 12_911 - 25);
    assert_eq!(file_again.octree.inside(), file.octree.inside());
    assert_eq!(rewritten(&file_again), again);
    let mut mesh = Mesh::default();
    marching_cubes(&file.octree, &file.frame, &mut mesh, &Silent).expect("memory");
    assert_eq!(mesh.validate(), Ok(()));
}

/// The nodes of an SOF or SOG file below a cell that starts at `at` and is `side` cells wide; SOG leaves get their middle as a point.
fn nodes(at: [u32; 3], side: u32, is_sog: bool, inside: &dyn Fn([u32; 3]) -> bool, out: &mut Vec<u8>) {
    let points = |n: u32| (0..n * n * n).map(move |i| [i / n / n, i / n % n, i % n].map(|c| c * side / (n - 1)));
    let step = |p: [u32; 3]| inside(std::array::from_fn(|a| at[a] + p[a]));
    let all =
        (0..(side + 1).pow(3)).map(|i| [i / (side + 1) / (side + 1), i / (side + 1) % (side + 1), i % (side + 1)]);
    let count = all.clone().filter(|&p| step(p)).count();
    if count == 0 || count == all.count() {
        out.extend([1, u8::from(count == 0)]);
    } else if side == 1 {
        out.extend([2, points(2).enumerate().fold(0, |mask, (i, p)| mask | u8::from(!step(p)) << i)]);
        if is_sog {
            at.iter().for_each(|&c| out.extend((c as f32 + 0.5).to_le_bytes()));
        }
    } else {
        out.push(0);
        for i in 0..8u32 {
            let child = std::array::from_fn(|a| at[a] + side / 2 * (i >> (2 - a) & 1));
            nodes(child, side / 2, is_sog, inside, out);
        }
    }
}

/// Whether a lattice point is inside.
type Inside<'a> = &'a dyn Fn([u32; 3]) -> bool;

/// An octree file of signs at the (cells + 1)^3 points of a grid.
fn file_of(cells: u32, is_sog: bool, inside: &dyn Fn([u32; 3]) -> bool) -> OctreeFile {
    let mut bytes = Vec::new();
    if is_sog {
        bytes.extend(b"SOG.Format 1.0\0");
        [0.0, 0.0, 0.0, cells as f32].iter().for_each(|number: &f32| bytes.extend(number.to_le_bytes()));
        bytes.resize(128, 0);
    }
    bytes.extend((cells as i32).to_le_bytes());
    nodes([0; 3], cells, is_sog, inside, &mut bytes);
    read_octree_bytes("made", &bytes, Some(OctreeFormat::Sof)).expect("well formed")
}

#[test]
fn solids_that_touch_the_side_of_their_cube_end_there() {
    for cells in [2u32, 4, 8, 16] {
        let noise = |p: [u32; 3]| {
            let n = p.iter().fold(u64::from(cells), |n, &c| (n ^ u64::from(c)).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            n >> 40 & 1 == 1
        };
        let solids: [(&str, Inside<'_>); 5] = [
            ("full", &|_| true),
            ("slab", &|p| p[2] < cells / 2),
            ("high", &|p| p[0] > cells / 2 && p[1] > 0),
            ("corner", &|p| p == [cells; 3]),
            ("noise", &noise),
        ];
        for (name, inside) in solids {
            for is_sog in [false, true] {
                let file = file_of(cells, is_sog, inside);
                let (octree, frame) = (&file.octree, &file.frame);
                assert_eq!((octree.validate(), file.info.is_padded), (Ok(()), true), "{name} {cells}");
                assert_eq!(file.info.depth, cells.ilog2());
                // The same points are inside, at the same places.
                let scale = if is_sog { 1.0 } else { 1.0 / f64::from(cells) };
                let shift = (-frame.origin() / frame.cell_size()).to_array().map(|c| c.round() as u32);
                assert!((frame.cell_size() / scale - 1.0).abs() < 1e-12);
                let around = 0..(cells + 2).pow(3);
                for p in around.map(|i| [i / (cells + 2) / (cells + 2), i / (cells + 2) % (cells + 2), i % (cells + 2)])
                {
                    let at = std::array::from_fn(|a| shift[a] + p[a] - 1);
                    let expected = p.iter().all(|&c| (1..=cells + 1).contains(&c)) && inside(p.map(|c| c - 1));
                    assert_eq!(octree.is_inside(at), expected, "{name} {cells} {p:?}");
                }
                let solid = Solid::from(file);
                for surface in [Surface::MarchingCubes, Surface::Quads, Surface::DualContouring] {
                    if surface == Surface::DualContouring && !is_sog {
                        continue;
                    }
                    let mut mesh = Mesh::default();
                    solid.extract(&Options { surface, ..Options::default() }, &mut mesh, &Silent).expect("a surface");
                    assert_eq!(mesh.validate(), Ok(()), "{name} {cells} {surface:?}");
                    let volume = mesh.report().volume / scale.powi(3);
                    let expected = f64::from(cells).powi(3);
                    if name == "full" && surface == Surface::MarchingCubes {
                        assert!((volume / expected - 1.0).abs() < 0.01, "{cells} {volume}");
                    }
                }
            }
        }
    }
}

#[test]
fn too_fine_to_be_put_into_a_larger_cube() {
    let bytes = [&(1i32 << 17).to_le_bytes()[..], &[1, 1]].concat();
    assert!(read_octree_bytes("x.sof", &bytes, Some(OctreeFormat::Sof)).is_ok());
    // One brick in a corner is full.
    let corner = [[0; 14].as_slice(), &[1, 0], &[1; 2 * 7 * 14]].concat();
    let bytes = [&(1i32 << 17).to_le_bytes()[..], &corner].concat();
    let error = read_octree_bytes("x.sof", &bytes, Some(OctreeFormat::Sof)).expect_err("no room").to_string();
    assert!(error.contains("too fine") && error.contains("margin"), "{error}");
}

/// A few bytes said that a huge cube is full, and its sides took minutes and gigabytes.
#[test]
fn a_few_bytes_do_not_become_a_huge_surface() {
    let full = |cells: i32| [&cells.to_le_bytes()[..], &[1, 0]].concat();
    let file = read_octree_bytes("small.sof", &full(256), Some(OctreeFormat::Sof)).expect("a full cube");
    assert_eq!(file.octree.crossings().len(), 6 * 257 * 257);
    for cells in [1 << 10, 1 << 16] {
        let error =
            read_octree_bytes("full.sof", &full(cells), Some(OctreeFormat::Sof)).expect_err("too many").to_string();
        assert!(error.contains("full.sof") && error.contains("6 bytes") && error.contains("margin"), "{error}");
    }
}

/// The nodes of an SOF file below a cell, with leaves of `coarse` cells in one half.
fn simplified(at: [u32; 3], side: u32, coarse: u32, inside: &dyn Fn([u32; 3]) -> bool, out: &mut Vec<u8>) {
    let corners = (0..8u32).map(|i| inside(std::array::from_fn(|a| at[a] + side * (i >> (2 - a) & 1))));
    let mask = corners.enumerate().fold(0u8, |mask, (i, is_in)| mask | u8::from(!is_in) << i);
    if side <= coarse {
        out.extend(if [0, 255].contains(&mask) { [1, mask & 1] } else { [2, mask] });
        return;
    }
    out.push(0);
    for i in 0..8u32 {
        // One half is fine, the other one is coarse.
        let child: [u32; 3] = std::array::from_fn(|a| at[a] + side / 2 * (i >> (2 - a) & 1));
        let coarse = if side == 16 && i >= 4 { 1 } else { coarse };
        simplified(child, side / 2, coarse, inside, out);
    }
}

#[test]
fn surface_cells_above_the_finest_level_are_divided() {
    // A ball, of which cells of two finest ones are surface cells wherever they may be.
    let cells = 16u32;
    let inside = |p: [u32; 3]| p.iter().map(|&c| (f64::from(c) - 8.1).powi(2)).sum::<f64>() < 25.0;
    for coarse in [1, 2, 4] {
        let mut bytes = (cells as i32).to_le_bytes().to_vec();
        simplified([0; 3], cells, coarse, &inside, &mut bytes);
        let file = read_octree_bytes("coarse", &bytes, Some(OctreeFormat::Sof)).expect("consistent");
        assert_eq!((file.octree.validate(), file.info.is_padded), (Ok(()), false));
        let mut mesh = Mesh::default();
        marching_cubes(&file.octree, &file.frame, &mut mesh, &Silent).expect("memory");
        assert_eq!((mesh.validate(), mesh.report().genus), (Ok(()), Some(0)), "{coarse}");
        let volume = mesh.report().volume * 4096.0 / (4.0 / 3.0 * std::f64::consts::PI * 125.0);
        assert!((0.7..1.15).contains(&volume), "{coarse} {volume}");
        // The fine half is as it was.
        for i in 0..9 * 17 * 17 {
            let p = [8 + i / 289, i / 17 % 17, i % 17];
            let fine = p.iter().all(|&c| c < 16) && p[0] > 8;
            assert!(!fine || file.octree.is_inside(p) == inside(p), "{coarse} {p:?}");
        }
    }
    let mut bytes = (1i32 << 10).to_le_bytes().to_vec();
    bytes.extend([2, 0xf0]);
    let error = read_octree_bytes("x.sof", &bytes, Some(OctreeFormat::Sof)).expect_err("a billion").to_string();
    assert!(error.contains("too many"), "{error}");
}
