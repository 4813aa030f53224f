//! Files of all formats: round trips, real files good and bad, and other people's readers as oracles.

use glam::DVec3;
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use zmend::io::{self, Encoding, Format, Precision, WriteOptions};
use zmend::mesh::{Mesh, SourceCounts, TriangleSource};

/// Real files beside the repository, if they are there.
fn samples() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/meshes");
    if path.is_dir() {
        return Some(path);
    }
    println!("skipped: no meshes at {}", path.display());
    None
}

/// All files below a directory, sorted.
fn files(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).expect("a directory").map(|entry| entry.expect("an entry").path());
    let mut found: Vec<PathBuf> =
        entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect();
    found.sort();
    found
}

/// Points of a cube with faces of 3, 4, 5 and 8 corners; the coordinates need all their digits.
fn cube() -> Mesh {
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
    let points = (0..8).map(|i| corner(i) * 0.1 + DVec3::new(-1e-7, 1e3, 1.0 / 3.0)).collect();
    let faces: [&[u32]; 7] =
        [&[0, 2, 1], &[1, 2, 3], &[4, 5, 7, 6], &[0, 1, 5, 4], &[1, 3, 7, 5, 4], &[3, 2, 6], &[0, 1, 3, 2, 6, 7, 5, 4]];
    Mesh { points, faces: faces.into_iter().collect() }
}

/// The same mesh with points that single precision holds.
fn single(mut mesh: Mesh) -> Mesh {
    mesh.points.iter_mut().for_each(|p| *p = p.as_vec3().as_dvec3());
    mesh
}

/// Corners of all triangles that a source yields.
fn triangles(source: &mut dyn TriangleSource) -> (Vec<[DVec3; 3]>, SourceCounts) {
    let mut all = Vec::new();
    let counts = source
        .triangles(&mut |batch| {
            all.extend_from_slice(batch);
            Ok(())
        })
        .expect("readable");
    assert_eq!(all.len() as u64, counts.triangles);
    (all, counts)
}

#[test]
fn every_format_returns_what_was_written() {
    let directory = tempfile::tempdir().expect("a directory");
    for format in [Format::Ply, Format::Obj, Format::Off] {
        for is_text in [false, true] {
            let path = directory.path().join("cube").with_extension(format.extension());
            let write = |precision| {
                let bytes = io::write(&path, &cube(), WriteOptions { precision, is_text, ..WriteOptions::default() });
                assert_eq!(bytes.expect("written"), std::fs::metadata(&path).expect("there").len());
                io::read(&path).expect("readable")
            };
            assert_eq!(write(Precision::Double), cube(), "{format} {is_text}");
            // Text of single precision is short, and meets the single number when it is rounded again.
            assert_eq!(single(write(Precision::Single)), single(cube()), "{format} {is_text}");
        }
    }
}

#[test]
fn stl_returns_the_triangles() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut mesh = single(cube());
    let (expected, counts) = triangles(&mut mesh.clone());
    for has_short_faces in [false, true] {
        if has_short_faces {
            // The number of triangles cannot be told from sums any more, and is put right at the end.
            mesh.faces.push(&[1]);
            mesh.faces.push(&[1, 2]);
        }
        for is_text in [false, true] {
            let path = directory.path().join("cube.stl");
            let precision = if is_text { Precision::Double } else { Precision::Single };
            io::write(&path, &mesh, WriteOptions { is_text, precision, ..WriteOptions::default() }).expect("written");
            let mut input = io::open(&path).expect("readable");
            let info = input.info().clone();
            assert_eq!((info.format, info.is_streamed, info.trailing_bytes), (Format::Stl, !is_text, 0));
            assert_eq!(info.polygons, counts.triangles);
            assert_eq!(triangles(&mut input).0, expected);
            let mut read = io::read(&path).expect("readable");
            assert_eq!(triangles(&mut read).0, expected);
            assert_eq!(read.points.len(), 8);
        }
    }
}

#[test]
fn long_faces_are_written_with_long_counts() {
    let directory = tempfile::tempdir().expect("a directory");
    let points = (0..300).map(|i| DVec3::new(f64::from(i), f64::from(i * i), 0.0)).collect();
    let mut mesh = Mesh { points, ..Mesh::default() };
    mesh.faces.push(&(0..300).collect::<Vec<u32>>());
    for (name, is_text) in [("a.ply", false), ("a.ply", true), ("a.obj", true), ("a.off", true)] {
        let path = directory.path().join(name);
        io::write(&path, &mesh, WriteOptions { is_text, ..WriteOptions::default() }).expect("written");
        assert_eq!(io::read(&path).expect("readable"), mesh, "{name}");
        let has_long_counts = std::fs::read(&path).expect("there").windows(9).any(|w| w == b"list uint");
        assert_eq!(has_long_counts, name == "a.ply");
    }
}

#[test]
fn large_files_pass_through_small_buffers() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut mesh = Mesh::default();
    let count = 120_000;
    for i in 0..count {
        mesh.points.push(DVec3::new(f64::from(i), f64::from(i % 7), 0.5));
        let face = [0, 1, 2, 3].map(|k| (i + k) % count);
        mesh.faces.push(if i % 1000 == 0 { &face } else { &face[..3] });
    }
    let (expected, counts) = triangles(&mut mesh);
    for name in ["large.ply", "large.stl"] {
        let path = directory.path().join(name);
        io::write(&path, &mesh, WriteOptions::default()).expect("written");
        let mut input = io::open(&path).expect("readable");
        assert!(input.info().is_streamed);
        assert_eq!(input.bounds().expect("readable"), mesh.bounds().expect("valid"));
        for _ in 0..2 {
            let (found, found_counts) = triangles(&mut input);
            assert!(found == expected, "{name}");
            assert_eq!(found_counts.triangles, counts.triangles);
        }
    }
    assert_eq!(io::read(directory.path().join("large.ply")).expect("readable"), mesh);
}

/// Files that no reader should take for a mesh, and a part of the message.
const BROKEN: [(&str, &str); 5] = [
    ("assimp-invalid/OutOfMemory.off", "line 2: 353535235358 vertices and 6 faces are promised, but only"),
    ("assimp-invalid/empty.off", "the file is empty"),
    ("assimp-invalid/malformed.obj", "line 28: a face refers to vertex 0, but there are 8"),
    ("assimp/invalid.off", "refers to vertex 20, but there are 3"),
    ("assimp/issue623.ply", "line 15: "),
];

#[test]
fn every_sample_is_a_mesh_or_a_clear_error() {
    let Some(root) = samples() else { return };
    let mut broken = BTreeSet::new();
    for path in files(&root) {
        let name = path.strip_prefix(&root).expect("below").to_str().expect("UTF-8").to_owned();
        match (io::read(&path), io::open(&path)) {
            (Ok(mut mesh), Ok(mut input)) => {
                assert!(mesh.faces.corners().iter().all(|&c| (c as usize) < mesh.points.len()), "{name}");
                let info = input.info().clone();
                assert_eq!(info.trailing_bytes, 0, "{name}");
                assert_eq!(info.polygons, mesh.faces.len() as u64, "{name}");
                assert!(info.points.is_none_or(|points| points == mesh.points.len() as u64), "{name}");
                assert_eq!(input.bounds().expect("readable"), mesh.bounds().expect("valid"), "{name}");
                let counts = triangles(&mut input).1;
                assert_eq!(counts, triangles(&mut mesh).1, "{name}");
                assert_eq!(counts.polygons, info.polygons, "{name}");
            }
            (Err(error), _) => {
                println!("{error}");
                let expected = BROKEN.iter().find(|(broken, _)| *broken == name);
                let (_, part) = expected.unwrap_or_else(|| panic!("{name} should be readable: {error}"));
                assert!(error.to_string().contains(part), "{error}");
                broken.insert(name);
            }
            (Ok(_), Err(error)) => panic!("{name} is only readable as a whole: {error}"),
        }
    }
    assert_eq!(broken.len(), BROKEN.len(), "{broken:?}");
}

/// Vertices and polygons counted by other means: headers, and a few lines of Python over the text or the triangles.
const COUNTED: [(&str, usize, usize); 30] = [
    ("assimp/Spider_ascii.stl", 722, 1368),
    ("assimp/Spider_binary.stl", 722, 1368),
    ("assimp/Wuson.off", 3205, 3732),
    ("assimp/Wuson.stl", 2117, 3732),
    ("assimp/box_UTF16BE.obj", 8, 6),
    ("assimp/box_without_lineending.obj", 8, 6),
    ("assimp/cube_binary_header_with_RN_newline.ply", 8, 12),
    ("assimp/cube_binary_starts_with_nl.ply", 8, 6),
    ("assimp/number_formats.obj", 15, 1),
    ("assimp/regr01.obj", 2108, 2710),
    ("assimp/sphereWithHole.stl", 146, 285),
    ("assimp/triangle_with_empty_solid.stl", 3, 1),
    ("assimp/triangle_with_two_solids.stl", 6, 2),
    ("assimp-invalid/malformed2.obj", 8, 6),
    ("cgal/pig.stl", 8642, 16848),
    ("draco/mat_test.obj", 3576, 1300),
    ("gpytoolbox/fox_ascii.stl", 313, 622),
    ("gpytoolbox/hemisphere.obj", 27, 50),
    ("gpytoolbox/sphere_binary_solid_header.stl", 682, 1360),
    ("happly/platonic_shelf.ply", 50, 50),
    ("topomender/meshfile.obj", 12906, 25812),
    ("trimesh/1002_tray_bottom.STL", 2216, 4520),
    ("trimesh/chair_model.obj", 3186, 12756),
    ("trimesh/cycloidal.ply", 21384, 43368),
    ("trimesh/featuretype.STL", 2010, 3476),
    ("trimesh/fuze.ply", 502, 1000),
    ("trimesh/multibody.stl", 20, 32),
    ("trimesh/points_emptyface.ply", 1024, 0),
    ("trimesh/two_objects_mixed_case_names.stl", 16, 24),
    ("trimesh/whitespace.off", 8, 6),
];

#[test]
fn samples_have_the_counts_that_others_find() {
    let Some(root) = samples() else { return };
    for (name, points, polygons) in COUNTED {
        let mesh = io::read(root.join(name)).expect(name);
        assert_eq!((mesh.points.len(), mesh.faces.len()), (points, polygons), "{name}");
    }
}

#[test]
fn the_same_model_is_the_same_in_all_encodings() {
    let Some(root) = samples() else { return };
    let read = |name: &str| io::read(root.join(name)).expect(name);
    let shelf = read("happly/platonic_shelf.ply");
    assert_eq!(read("happly/platonic_shelf_ascii.ply").faces, shelf.faces);
    assert_eq!(read("happly/platonic_shelf_big_endian.ply"), shelf);
    assert_eq!(read("trimesh/fuze.ply").faces, read("trimesh/fuze_ascii.ply").faces);
    let encoding = |name: &str| io::open(root.join(name)).expect(name).info().encoding;
    assert_eq!(encoding("happly/platonic_shelf_big_endian.ply"), Encoding::BigEndian);
    assert_eq!(encoding("happly/platonic_shelf_ascii.ply"), Encoding::Text);
}

#[test]
fn odd_numbers_are_read_as_meant() {
    let Some(root) = samples() else { return };
    let mesh = io::read(root.join("assimp/number_formats.obj")).expect("valid");
    let expected = [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [-1.0, -2.0, -3.0], [100.0, 20.0, 310.0]];
    assert_eq!(mesh.points[..5], expected.map(DVec3::from_array));
    assert_eq!(mesh.points[9], DVec3::new(-100.0, -20.0, -310.0));
    assert_eq!(mesh.points[12], DVec3::new(-0.01, -0.2, -0.031));
    let mesh = io::read(root.join("draco/inf_nan.obj")).expect("valid");
    assert_eq!(mesh.points.iter().filter(|p| p.is_nan()).count(), 3);
}

/// `stl_io` reads binary files, and text of one solid.
#[test]
fn stl_agrees_with_stl_io() {
    let Some(root) = samples() else { return };
    let mut compared = 0;
    for path in files(&root).into_iter().filter(|path| Format::from_path(path) == Some(Format::Stl)) {
        let bytes = std::fs::read(&path).expect("readable").to_ascii_lowercase();
        let has_several_solids = bytes.windows(9).filter(|w| w == b"\nendsolid").count() > 1;
        let mut cursor = std::io::Cursor::new(std::fs::read(&path).expect("readable"));
        let theirs = stl_io::create_stl_reader(&mut cursor).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
        let (Ok(theirs), false) = (theirs, has_several_solids) else { continue };
        let (ours, _) = triangles(&mut io::open(&path).expect("readable"));
        assert_eq!(ours.len(), theirs.len(), "{}", path.display());
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert_eq!(ours.map(|corner| corner.as_vec3().to_array()), theirs.vertices.map(|vertex| vertex.0));
        }
        compared += 1;
    }
    assert!(compared >= 20, "{compared}");
}

/// `ply-rs-bw` reads all PLY files that keep to the letter of the format.
#[test]
fn ply_agrees_with_ply_rs() {
    use ply_rs_bw::ply::{DefaultElement, Property};
    let Some(root) = samples() else { return };
    let number = |element: &DefaultElement, name: &str| match element[name] {
        Property::Float(x) => f64::from(x),
        Property::Double(x) => x,
        ref other => panic!("{other:?}"),
    };
    let indices = |element: &DefaultElement| match element.get("vertex_indices").or_else(|| element.get("vertex_index"))
    {
        Some(Property::ListInt(list)) => list.iter().map(|&i| i as u32).collect::<Vec<u32>>(),
        Some(Property::ListUInt(list)) => list.clone(),
        other => panic!("{other:?}"),
    };
    let mut compared = 0;
    for path in files(&root).into_iter().filter(|path| Format::from_path(path) == Some(Format::Ply)) {
        let mut file = std::io::BufReader::new(std::fs::File::open(&path).expect("readable"));
        let theirs = ply_rs_bw::parser::Parser::<DefaultElement>::new().read_ply(&mut file);
        let (Ok(theirs), Ok(ours)) = (theirs, io::read(&path)) else { continue };
        let none = Vec::new();
        let vertices = theirs.payload.get("vertex").unwrap_or(&none);
        let faces = theirs.payload.get("face").unwrap_or(&none);
        assert_eq!((ours.points.len(), ours.faces.len()), (vertices.len(), faces.len()), "{}", path.display());
        for (ours, theirs) in ours.points.iter().zip(vertices) {
            let theirs = DVec3::new(number(theirs, "x"), number(theirs, "y"), number(theirs, "z"));
            // In text, they round `float` properties to single precision, and we keep what is written.
            assert!(*ours == theirs || ours.as_vec3() == theirs.as_vec3(), "{}", path.display());
        }
        assert!(ours.faces.iter().zip(faces).all(|(ours, theirs)| ours == indices(theirs)), "{}", path.display());
        compared += 1;
    }
    assert!(compared >= 25, "{compared}");
}

#[test]
fn inputs_that_cannot_be_opened_say_why() {
    let directory = tempfile::tempdir().expect("a directory");
    let missing = directory.path().join("missing.stl");
    assert!(io::open(&missing).expect_err("missing").to_string().contains("missing.stl: cannot read: "));
    assert!(io::read(directory.path()).is_err() && io::open(directory.path()).is_err());
    for name in ["empty.stl", "empty.ply", "empty.obj", "empty.off"] {
        let path = directory.path().join(name);
        std::fs::write(&path, "").expect("written");
        let message = io::open(&path).expect_err(name).to_string();
        assert!(message.ends_with("the file is empty; copy or export it again"), "{message}");
    }
    let unknown = directory.path().join("notes.txt");
    std::fs::write(&unknown, "Dear reader,").expect("written");
    assert!(io::open(&unknown).expect_err("unknown").to_string().contains("neither the content nor the name"));
    assert!(io::write(&unknown, &Mesh::default(), WriteOptions::default()).is_err());
}

#[test]
fn content_counts_not_names() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("cube.ply");
    io::write(&path, &cube(), WriteOptions { precision: Precision::Double, ..WriteOptions::default() })
        .expect("written");
    let misnamed = directory.path().join("cube.stl");
    std::fs::rename(&path, &misnamed).expect("renamed");
    assert_eq!(io::read(&misnamed).expect("readable"), cube());
    assert_eq!(io::open(&misnamed).expect("readable").info().format, Format::Ply);
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3";
    assert_eq!(io::read_bytes("bytes", text.as_bytes(), None).expect("readable").faces.len(), 1);
}

const STRIPS: &[u8] = b"ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty double x\nproperty int y\n\
    property char z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n\
    \0\0\0\0\0\0\0\0\0\0\0\x01\x02\0\0\0\0\0\0\0\0\0\0\0\x01\x02\0\0\0\x03\0\0\0\0\0\0\0\x01\0\0\0\0";

/// Files of a few hundred bytes of every kind, to be damaged.
fn seeds() -> Vec<(Format, Vec<u8>)> {
    let directory = tempfile::tempdir().expect("a directory");
    let mut seeds = vec![(Format::Ply, STRIPS.to_vec())];
    for format in [Format::Ply, Format::Stl, Format::Obj, Format::Off] {
        for is_text in [false, true] {
            let path = directory.path().join("seed").with_extension(format.extension());
            io::write(&path, &cube(), WriteOptions { is_text, ..WriteOptions::default() }).expect("written");
            seeds.push((format, std::fs::read(&path).expect("readable")));
        }
    }
    seeds
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// Any damage gives a mesh with valid indices or an error: no panic, no endless loop, no absurd allocation; and the
    /// stream finds what the reader finds.
    #[test]
    fn damaged_files_do_no_harm(
        seed in 0..9usize,
        length in 0.0..2.0f64,
        edits in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4u8), 0..6),
    ) {
        thread_local!(static SEEDS: Vec<(Format, Vec<u8>)> = seeds());
        let (format, mut bytes) = SEEDS.with(|seeds| seeds[seed].clone());
        bytes.truncate((length * bytes.len() as f64) as usize);
        for (index, byte, kind) in edits {
            if bytes.is_empty() {
                break;
            }
            let at = index.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 => bytes[at] = b"0123456789-.e \n\r#\\/"[usize::from(byte) % 19],
                2 => drop(bytes.remove(at)),
                _ => bytes.insert(at, byte),
            }
        }
        check_harmless(&bytes, format)?;
    }

    /// Bytes that never were a mesh.
    #[test]
    fn random_bytes_do_no_harm(bytes in proptest::collection::vec(any::<u8>(), 0..400), format in 0..4usize) {
        check_harmless(&bytes, [Format::Ply, Format::Stl, Format::Obj, Format::Off][format])?;
    }
}

fn check_harmless(bytes: &[u8], hint: Format) -> Result<(), TestCaseError> {
    let read = io::read_bytes("damaged", bytes, Some(hint));
    if let Ok(mesh) = &read {
        prop_assert!(mesh.faces.corners().iter().all(|&c| (c as usize) < mesh.points.len()));
        prop_assert!(mesh.points.len() <= bytes.len() && mesh.faces.corners().len() <= bytes.len());
    }
    let file = tempfile::Builder::new().suffix(&format!(".{}", hint.extension())).tempfile().expect("a file");
    std::fs::write(file.path(), bytes).expect("written");
    let streamed = io::open(file.path()).and_then(|mut input| {
        input.bounds()?;
        input.triangles(&mut |_| Ok(()))
    });
    match (&read, streamed) {
        (Ok(mesh), Ok(counts)) => prop_assert_eq!(counts.polygons, mesh.faces.len() as u64),
        (Err(_), Err(_)) => {}
        // What stands behind the faces of a PLY file is not looked at by the stream.
        (Err(_), Ok(_)) => prop_assert!(bytes.trim_ascii_start().starts_with(b"ply")),
        (Ok(_), Err(error)) => prop_assert!(false, "{}", error),
    }
    Ok(())
}

/// What the readers of others stumble over.
#[test]
fn long_lines_tiny_numbers_and_words_in_binary_headers_do_no_harm() {
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1.5e-9 0 0\nvertex 1 1 0\nendloop\nendfacet\n";
    let text = format!("solid {}\n{facet}endsolid\n", "name ".repeat(2000));
    let mesh = io::read_bytes("t.stl", text.as_bytes(), None).expect("valid");
    assert_eq!((mesh.faces.len(), mesh.points.iter().filter(|p| p.x == 1.5e-9).count()), (1, 1));
    for header in ["facet", "solid loop", "vertex of a facet in a loop", "solid facet loop vertex"] {
        let mut bytes = header.as_bytes().to_vec();
        bytes.resize(80, b' ');
        bytes.extend(1u32.to_le_bytes());
        let floats: [f32; 12] = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0];
        bytes.extend(floats.iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0, 0]);
        let mesh = io::read_bytes("t.stl", &bytes, None).expect(header);
        assert_eq!((mesh.faces.len(), mesh.points.len()), (1, 3), "{header}");
    }
}
