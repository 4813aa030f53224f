//! glTF and 3MF: round trips, scenes of parts, and files that mean no good.

use flate2::write::DeflateEncoder;
use glam::DVec3;
use proptest::prelude::*;
use std::io::Write;
use std::sync::LazyLock;
use zmend::Mesh;
use zmend::io::{self, Format, Precision, WriteOptions};
use zmend::mesh::sample;

/// A mesh with faces of 3, 4 and 5 corners, the last one not convex, and points that need their digits.
fn mixed() -> Mesh {
    let at = |x: f64, y: f64, z: f64| DVec3::new(x / 3.0, y / 7.0, 1e3 + z);
    let points = vec![at(0., 0., 0.), at(4., 0., 0.), at(4., 4., 0.), at(2., 1., 0.), at(0., 4., 0.), at(0., 0., 1.)];
    let faces: [&[u32]; 5] = [&[0, 1, 2, 3, 4], &[0, 1, 5], &[1, 2, 5], &[5], &[0, 4, 2, 1]];
    Mesh { points, faces: faces.into_iter().collect() }
}

fn area(mesh: &Mesh) -> f64 {
    mesh.report().area
}

fn bytes_of(mesh: &Mesh, format: Format, precision: Precision) -> Vec<u8> {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("mesh").with_extension(format.extension());
    let size = io::write(&path, mesh, WriteOptions { precision, ..WriteOptions::default() }).expect("written");
    let bytes = std::fs::read(&path).expect("there");
    assert_eq!(bytes.len() as u64, size);
    assert_eq!(io::open(&path).expect("readable").info().format, format);
    bytes
}

fn read(bytes: &[u8]) -> zmend::Result<Mesh> {
    io::read_bytes("t", bytes, None)
}

fn problem(bytes: &[u8]) -> String {
    read(bytes).expect_err("malformed").to_string()
}

#[test]
fn meshes_come_back() {
    for format in [Format::Glb, Format::ThreeMf] {
        let back = read(&bytes_of(&mixed(), format, Precision::Double)).expect("ours");
        assert_eq!((back.points.len(), back.faces.len()), (6, 3 + 2 + 2), "{format}");
        assert!((area(&back) / area(&mixed()) - 1.0).abs() < 1e-3, "{format}: cut as polygons are");
        let rounded = |p: &DVec3| if format == Format::Glb { p.as_vec3().as_dvec3() } else { *p };
        assert_eq!(back.points, mixed().points.iter().map(rounded).collect::<Vec<_>>());

        let knot = sample::build("knot", 1).expect("a sample");
        let back = read(&bytes_of(&knot, format, Precision::Single)).expect("ours");
        assert_eq!(back.validate(), knot.validate());
        let volume = knot.report().volume;
        assert!((back.report().volume / volume - 1.0).abs() < 1e-4);

        let nothing = read(&bytes_of(&Mesh::default(), format, Precision::Single)).expect("ours");
        assert!(nothing.points.is_empty() && nothing.faces.is_empty());
    }
    let error = io::read_bytes("t", b"{}", Some(Format::Gltf)).expect_err("no version");
    assert!(error.to_string().contains("version"), "{error}");
    let directory = tempfile::tempdir().expect("a directory");
    let refused = io::write(directory.path().join("x.gltf"), &mixed(), WriteOptions::default());
    assert!(refused.expect_err("only binary").to_string().contains(".glb"));
}

/// A document with these members beside one buffer, as text.
fn document(data: &[u8], members: &str) -> Vec<u8> {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let encoded: String = data
        .chunks(3)
        .flat_map(|chunk| {
            let bits = (0..3).fold(0, |bits, i| bits << 8 | u32::from(chunk.get(i).copied().unwrap_or(0)));
            let digit = move |i: usize| char::from(DIGITS[(bits >> (18 - 6 * i) & 63) as usize]);
            (0..4).map(move |i| if i <= chunk.len() { digit(i) } else { '=' })
        })
        .collect();
    let buffer = format!(r#"{{"byteLength":{},"uri":"data:application/octet-stream;base64,{encoded}"}}"#, data.len());
    format!(r#"{{"asset":{{"version":"2.0"}},"buffers":[{buffer}],{members}}}"#).into_bytes()
}

/// Four points as floats with 4 bytes between, as normalised bytes, and indices as bytes.
fn data() -> Vec<u8> {
    let mut data = Vec::new();
    for point in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]] {
        point.iter().for_each(|c| data.extend(c.to_le_bytes()));
        data.extend([9; 4]);
    }
    data.extend([0, 0, 0, 255, 0, 0, 0, 255, 0, 255, 255, 0]);
    data.extend([0, 1, 2, 3]);
    data
}

const ACCESSORS: &str = r#"
    "bufferViews": [{"buffer":0,"byteLength":64,"byteStride":16},{"buffer":0,"byteOffset":64,"byteLength":16}],
    "accessors": [
        {"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
        {"bufferView":1,"componentType":5121,"count":4,"type":"VEC3","normalized":true},
        {"bufferView":1,"byteOffset":12,"componentType":5121,"count":4,"type":"SCALAR"}
    ]"#;

#[test]
fn scenes_are_one_mesh() {
    let mesh = |primitive: &str| {
        read(&document(&data(), &format!(r#"{ACCESSORS},"meshes":[{{"primitives":[{primitive}]}}]"#)))
    };
    // Strips of all kinds: without indices, with them, from bytes that are parts of 255.
    for (mode, attributes) in [(5, "0"), (5, "1"), (6, "0")] {
        for indices in ["", r#","indices":2"#] {
            let mesh = mesh(&format!(r#"{{"attributes":{{"POSITION":{attributes}}},"mode":{mode}{indices}}}"#))
                .expect("valid");
            assert_eq!((mesh.points.len(), mesh.faces.len()), (4, 2));
            assert_eq!(mesh.points[3], DVec3::new(1.0, 1.0, 0.0));
            assert_eq!(mesh.faces.get(1), if mode == 5 { [2, 1, 3] } else { [0, 2, 3] });
        }
    }
    assert_eq!(mesh(r#"{"attributes":{"POSITION":0}}"#).expect("valid").faces.len(), 1);
    assert_eq!(mesh(r#"{"attributes":{"POSITION":0},"mode":1}"#).expect("lines").faces.len(), 0);

    // The mesh moved, mirrored by its parent, and left out, because the scene has no such node.
    let nodes = r#""scene":1,"scenes":[{"nodes":[3]},{"nodes":[0,2]}],"nodes":[
        {"children":[1],"scale":[-2,1,1]},{"mesh":0,"translation":[10,0,0]},
        {"mesh":0,"matrix":[0,1,0,0, -1,0,0,0, 0,0,1,0, 5,6,7,1]},{"mesh":0}]"#;
    let members =
        format!(r#"{ACCESSORS},{nodes},"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":2}}]}}]"#);
    let mesh = read(&document(&data(), &members)).expect("valid");
    assert_eq!((mesh.points.len(), mesh.faces.len()), (8, 2));
    assert_eq!((mesh.points[1], mesh.faces.get(0)), (DVec3::new(-22.0, 0.0, 0.0), &[0, 2, 1][..]));
    assert_eq!((mesh.points[5], mesh.faces.get(1)), (DVec3::new(5.0, 7.0, 7.0), &[4, 5, 6][..]));
}

#[test]
fn documents_that_make_no_sense_are_refused() {
    let problem = |members: &str| problem(&document(&data(), members));
    let meshes = |primitive: &str| format!(r#""meshes":[{{"primitives":[{primitive}]}}]"#);
    let simple = meshes(r#"{"attributes":{"POSITION":0}}"#);
    assert!(problem(&simple).contains("accessors[0]"));
    for (accessor, expected) in [
        (r#"{"bufferView":0,"componentType":5126,"count":5,"type":"VEC3"}"#, "5 elements"),
        (r#"{"bufferView":0,"componentType":5126,"count":18446744073709551615,"type":"VEC3"}"#, "elements"),
        (r#"{"bufferView":0,"componentType":5126,"count":1,"byteOffset":60,"type":"VEC3"}"#, "elements"),
        (r#"{"bufferView":0,"componentType":1,"count":1,"type":"VEC3"}"#, "componentType"),
        (r#"{"componentType":5126,"count":99999999999,"type":"VEC3"}"#, "no bufferView"),
        (r#"{"bufferView":0,"componentType":5126,"count":1,"type":"VEC3","sparse":{}}"#, "sparse"),
        (r#"{"bufferView":7,"componentType":5126,"count":1,"type":"VEC3"}"#, "bufferViews[7]"),
        (r#"{"bufferView":-1,"componentType":5126,"count":1,"type":"VEC3"}"#, "not a count"),
    ] {
        let views = r#""bufferViews":[{"buffer":0,"byteLength":64,"byteStride":16}]"#;
        let found = problem(&format!(r#"{views},"accessors":[{accessor}],{simple}"#));
        assert!(found.contains(expected), "{found}");
    }
    let circle = r#""nodes":[{"children":[1]},{"children":[2]},{"children":[1]}]"#;
    assert!(
        problem(&format!("{ACCESSORS},{circle}")).contains("twice"),
        "{}",
        problem(&format!("{ACCESSORS},{circle}"))
    );
    let packed = r#""extensionsRequired":["KHR_draco_mesh_compression"]"#;
    assert!(problem(packed).contains("without compression"));
    let wrong = meshes(r#"{"attributes":{"POSITION":0},"indices":1}"#);
    assert!(problem(&format!("{ACCESSORS},{wrong}")).contains("SCALAR"));
    assert!(problem(r#""x": 1e999"#).contains("JSON"));
    // One part a hundred thousand times.
    let big = vec![0; 12 << 12];
    let views = r#""bufferViews":[{"byteLength":49152}],"accessors":[{"bufferView":0,"componentType":5126,"count":4096,"type":"VEC3"}]"#;
    let nodes = vec![r#"{"mesh":0}"#; 100_000].join(",");
    let exploding = document(&big, &format!(r#"{views},{simple},"nodes":[{nodes}]"#));
    assert!(read(&exploding).expect_err("too large").to_string().contains("too often"));
}

#[test]
fn data_beside_the_file_is_found() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("a.gltf");
    let write = |uri: &str| {
        let buffer = format!(r#"{{"byteLength":80,"uri":"{uri}"}}"#);
        let mesh = r#""meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":5}]}]"#;
        let text = format!(r#"{{"asset":{{"version":"2.0"}},"buffers":[{buffer}],{ACCESSORS},{mesh}}}"#);
        std::fs::write(&path, text).expect("written");
        io::read(&path)
    };
    std::fs::write(directory.path().join("the data.bin"), data()).expect("written");
    assert_eq!(write("the%20data.bin").expect("beside").faces.len(), 2);
    assert!(write("none.bin").expect_err("missing").to_string().contains("none.bin: cannot read"));
    for elsewhere in ["../the data.bin", "/etc/passwd", "https://example.org/x.bin", "%2e%2e/x"] {
        assert!(write(elsewhere).expect_err("elsewhere").to_string().contains("not beside"), "{elsewhere}");
    }
}

/// An archive of files, packed or not.
fn archive(files: &[(&str, &[u8])], is_packed: bool) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (path, content) in files {
        let data = if is_packed {
            let mut packer = DeflateEncoder::new(Vec::new(), flate2::Compression::best());
            packer.write_all(content).expect("memory");
            packer.finish().expect("memory")
        } else {
            content.to_vec()
        };
        let start = bytes.len() as u32;
        let mut fields = Vec::new();
        [20u16, 0, if is_packed { 8 } else { 0 }, 0, 0].iter().for_each(|word| fields.extend(word.to_le_bytes()));
        [0, data.len() as u32, content.len() as u32].iter().for_each(|word| fields.extend(word.to_le_bytes()));
        [path.len() as u16, 0].iter().for_each(|word| fields.extend(word.to_le_bytes()));
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&fields);
        bytes.extend(path.as_bytes());
        bytes.extend(&data);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&fields);
        directory.extend([0; 10]);
        directory.extend(start.to_le_bytes());
        directory.extend(path.as_bytes());
    }
    let (start, size) = (bytes.len() as u32, directory.len() as u32);
    bytes.extend(directory);
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    [files.len() as u16; 2].iter().for_each(|count| bytes.extend(count.to_le_bytes()));
    [size, start].iter().for_each(|word| bytes.extend(word.to_le_bytes()));
    bytes.extend([0; 2]);
    bytes
}

const TRIANGLE: &str = r#"<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices>
    <triangles><triangle v1="0" v2="1" v3="2" pid="1"/></triangles></mesh>"#;

fn model(resources: &str, build: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?><m:model xmlns:m=\"x\"><m:resources>{resources}</m:resources><build>{build}</build></m:model>"
    )
}

#[test]
fn builds_are_one_mesh() {
    let components = r#"<object id="2"><components><component objectid="1"/>
        <component objectid="5" p:path="/3D/Other.model" transform="1 0 0 0 1 0 0 0 -1 10 20 30"/></components></object>"#;
    let root = model(
        &format!(r#"<object id="1">{TRIANGLE}</object>{components}<object id="9">{TRIANGLE}</object>"#),
        r#"<item objectid="2" transform="0 1 0 -1 0 0 0 0 1 100 0 0"/>"#,
    );
    let other = model(&format!(r#"<object id="5" type="model">{TRIANGLE}</object>"#), "");
    let relations = r#"<Relationships><Relationship Target="/3D/root.model" Type="http://x/3dmodel"/></Relationships>"#;
    let files = [
        ("3D/other.model", other.as_bytes()),
        ("3D/root.model", root.as_bytes()),
        ("_rels/.rels", relations.as_bytes()),
    ];
    for is_packed in [false, true] {
        let mesh = read(&archive(&files, is_packed)).expect("valid");
        assert_eq!((mesh.points.len(), mesh.faces.len()), (6, 2));
        // A row vector times the matrix: x becomes y, y becomes -x.
        assert_eq!(mesh.points[1], DVec3::new(100.0, 1.0, 0.0));
        assert_eq!(mesh.points[4], DVec3::new(80.0, 11.0, 30.0));
        assert_eq!((mesh.faces.get(0), mesh.faces.get(1)), (&[0, 1, 2][..], &[3, 5, 4][..]));
    }
    // Without relations the first model is taken, without a build all of its meshes.
    assert_eq!(read(&archive(&files[..1], true)).expect("valid").faces.len(), 1);
}

#[test]
fn archives_that_make_no_sense_are_refused() {
    let refusal =
        |resources: &str, build: &str| problem(&archive(&[("3D/a.model", model(resources, build).as_bytes())], true));
    let object = |content: &str| format!(r#"<object id="1">{content}</object>"#);
    assert!(refusal(&object(TRIANGLE), r#"<item objectid="3"/>"#).contains("object 3"));
    assert!(refusal(&object(&TRIANGLE.replace("v2=\"1\"", "v2=\"4\"")), "").contains("vertex 4"));
    assert!(refusal(&object(&TRIANGLE.replace("v2=\"1\"", "v2=\"-1\"")), "").contains("\"-1\""));
    assert!(refusal(&object(&TRIANGLE.replace("x=\"1\"", "x=\"one\"")), "").contains("\"one\""));
    assert!(refusal(&object(&TRIANGLE.replace("z=\"0\"", "")), "").contains("z is missing"));
    assert!(refusal(&object(TRIANGLE), r#"<item objectid="1" transform="1 2 3"/>"#).contains("twelve"));
    assert!(refusal(&object(TRIANGLE), r#"<item objectid="1" path="/no.model"/>"#).contains("no.model"));
    let circle = r#"<object id="1"><components><component objectid="1"/></components></object>"#;
    assert!(refusal(circle, r#"<item objectid="1"/>"#).contains("part of itself"));
    // Thirty levels of a hundred parts each.
    let levels: String = (1..30)
        .map(|i| {
            let component = format!(r#"<component objectid="{i}"/>"#);
            format!(r#"<object id="{}"><components>{}</components></object>"#, i + 1, component.repeat(100))
        })
        .collect();
    let error = refusal(&(object(TRIANGLE) + &levels), r#"<item objectid="30"/>"#);
    assert!(error.contains("too often"), "{error}");
    let cut = model(&object(TRIANGLE), "");
    assert!(problem(&archive(&[("a.model", &cut.as_bytes()[..cut.len() - 20])], true)).contains("a.model"));
    assert!(problem(&archive(&[("a.txt", b"x")], false)).contains("no 3D model"));
    // Blanks pack a thousandfold.
    let blanks = [model("", "").as_bytes(), &vec![b' '; 24 << 20]].concat();
    let error = problem(&archive(&[("a.model", &blanks)], true));
    assert!(error.contains("hundred times"), "{error}");
}

#[test]
fn cut_files_are_errors() {
    for format in [Format::Glb, Format::ThreeMf] {
        let bytes = bytes_of(&mixed(), format, Precision::Single);
        for len in 4..bytes.len() {
            let error = io::read_bytes("cut", &bytes[..len], Some(format)).expect_err("a part is missing");
            assert!(error.to_string().starts_with("cut: "), "{error}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]
    /// Whatever a damaged file says, it is an error or a mesh.
    #[test]
    fn damaged_files_do_no_harm(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        static WHOLE: LazyLock<[Vec<u8>; 2]> =
            LazyLock::new(|| [Format::Glb, Format::ThreeMf].map(|format| bytes_of(&mixed(), format, Precision::Single)));
        for (format, whole) in [Format::Glb, Format::ThreeMf].into_iter().zip(&*WHOLE) {
            let mut bytes = whole.clone();
            for (at, value) in &changes {
                let i = at.index(bytes.len());
                bytes[i] = *value;
            }
            if let Ok(mesh) = io::read_bytes("damaged", &bytes, Some(format)) {
                prop_assert!(mesh.faces.corners().iter().all(|&corner| (corner as usize) < mesh.points.len()));
            }
        }
    }
}
