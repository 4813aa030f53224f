//! The program `zmend` as its users meet it.

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use zmend::io::{self, WriteOptions};
use zmend::mesh::sample;

/// A folder with a broken mesh, `knot.ply`, to work in.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Folder(tempfile::tempdir().unwrap());
        folder.add("knot.ply", "knot-holes");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn add(&self, file: &str, name: &str) {
        io::write(self.path(file), &sample::build(name, 1).unwrap(), WriteOptions::default()).unwrap();
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs the program in the folder; arguments are separated by blanks.
    fn run(&self, args: &str) -> Ran {
        let mut command = Command::cargo_bin("zmend").unwrap();
        let output = command.current_dir(self.0.path()).args(args.split_whitespace()).output().unwrap();
        Ran {
            args: args.to_owned(),
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

/// How the program ended and what it said.
#[derive(Debug)]
struct Ran {
    args: String,
    code: Option<i32>,
    out: String,
    err: String,
}

impl Ran {
    #[track_caller]
    fn ok(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }

    /// Fails with one line on standard error, which holds all of these words.
    #[track_caller]
    fn fails(self, words: &[&str]) {
        assert_eq!(self.code, Some(1), "{self:?}");
        assert!(self.out.is_empty() && self.err.starts_with("error: ") && self.err.lines().count() == 1, "{self:?}");
        assert!(words.iter().all(|word| self.err.contains(word)), "{words:?} in {self:?}");
    }

    /// The parser of arguments refuses it, with all of these words.
    #[track_caller]
    fn refused(self, words: &[&str]) {
        assert_eq!(self.code, Some(2), "{self:?}");
        assert!(self.err.starts_with("error: ") && words.iter().all(|word| self.err.contains(word)), "{self:?}");
    }

    #[track_caller]
    fn says(&self, words: &[&str]) {
        assert!(words.iter().all(|word| self.out.contains(word)), "{words:?} in {}:\n{}", self.args, self.out);
    }

    #[track_caller]
    fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|e| panic!("{e} in {self:?}"))
    }
}

/// Reads a file (which welds STL) and finds the surface of a solid.
#[track_caller]
fn assert_solid(path: &Path) {
    let mesh = io::read(path).unwrap();
    assert_eq!(mesh.validate(), Ok(()), "{}", path.display());
    assert!(mesh.report().volume > 0.0);
}

#[test]
fn samples_are_listed_and_written() {
    let folder = Folder::new();
    let list = folder.run("sample --list").ok();
    assert_eq!(list.out.lines().count(), sample::names().len());
    list.says(&["knot-holes", "gear"]);
    folder.run("sample gear gear.stl").ok().says(&["gear.stl", "faces"]);
    folder.run("sample gear gear.stl").fails(&["gear.stl", "exists", "--force"]);
    folder.run("sample cube gear.stl --force --detail 3").ok();
    assert_eq!(io::read(folder.path("gear.stl")).unwrap().faces.len(), 108);
    folder.run("sample nothing x.ply").fails(&["nothing", "knot-holes"]);
    folder.run("sample knot x.jpeg").fails(&["x.jpeg", ".ply"]);
    folder.run("sample knot").refused(&["OUT"]);
    folder.run("sample").refused(&["NAME"]);
    folder.run("sample knot x.ply --detail 21").refused(&["detail"]);
    assert_eq!(folder.names(), ["gear.stl", "knot.ply"]);
}

#[test]
fn holes_are_repaired_and_told() {
    let folder = Folder::new();
    let info = folder.run("info knot.ply").ok();
    info.says(&["PLY (binary)", "7 holes (", "zmend repair knot.ply OUT"]);
    let repair = folder.run("repair knot.ply fixed.ply --depth 6").ok();
    repair.says(&["before", "after", "64 cells", "non-manifold edges", "kB", "scan", "total"]);
    assert!(repair.out.ends_with("closed, manifold, oriented: a solid\n"), "{}", repair.out);
    assert!(repair.err.starts_with("warning: the surface was open"), "{}", repair.err);
    assert_solid(&folder.path("fixed.ply"));
    let info = folder.run("info fixed.ply").ok();
    info.says(&["genus", "closed, manifold, oriented: a solid"]);
    assert!(!info.out.contains("OUT"), "{}", info.out);
    assert_eq!(folder.names(), ["fixed.ply", "knot.ply"]);
}

#[test]
fn reports_are_full_or_brief() {
    let folder = Folder::new();
    let brief = folder.run("repair knot.ply -o a.ply -d 6 --report brief").ok();
    brief.says(&["by construction; --report full measures it", "Euler characteristic"]);
    assert!(!brief.out.contains("boundary edges"), "{}", brief.out);
    let full = folder.run("repair knot.ply -o b.ply -d 6 --report full").ok();
    full.says(&["boundary edges", "a solid"]);
    assert_eq!(fs::read(folder.path("a.ply")).unwrap(), fs::read(folder.path("b.ply")).unwrap());
}

#[test]
fn json_tells_everything() {
    let folder = Folder::new();
    let ran = folder.run("repair knot.ply fixed.stl -d 6 -s dc --scale 0.8 --json").ok();
    assert_eq!(ran.out.lines().count(), 1);
    let json = ran.json();
    let faces = sample::build("knot-holes", 1).unwrap().faces.len();
    for (pointer, expected) in [
        ("/input/path", "knot.ply".into()),
        ("/input/format", "ply".into()),
        ("/input/measured", true.into()),
        ("/input/solid", false.into()),
        ("/input/faces", faces.into()),
        ("/input/triangles", faces.into()),
        ("/input/holes", 7.into()),
        ("/input/genus", Value::Null),
        ("/output/path", "fixed.stl".into()),
        ("/output/format", "stl".into()),
        ("/output/coordinate_bits", 32.into()),
        ("/output/solid", true.into()),
        ("/output/closed", true.into()),
        ("/output/boundary_edges", 0.into()),
        ("/output/non_manifold_edges", 0.into()),
        ("/output/non_manifold_vertices", 0.into()),
        ("/output/components", 1.into()),
        ("/output/genus", 1.into()),
        ("/options/depth", 6.into()),
        ("/options/scale", 0.8.into()),
        ("/options/surface", "dc".into()),
        ("/grid/cells_a_side", 64.into()),
        ("/scan/triangles", faces.into()),
    ] {
        assert_eq!(json.pointer(pointer), Some(&expected), "{pointer}");
    }
    for stage in ["read", "scan", "close", "sign", "contour", "write", "total"] {
        assert!(json["seconds"][stage].as_f64().unwrap() >= 0.0, "{stage}");
    }
    assert!(json["closing"]["rings"].as_u64().unwrap() > 0 && json["warnings"].as_array().unwrap().len() == 1);
    assert_eq!(json["output"]["bytes"].as_u64(), Some(fs::metadata(folder.path("fixed.stl")).unwrap().len()));
    let volume = json["output"]["volume"].as_f64().unwrap();
    assert!((volume / 17.58 - 1.0).abs() < 0.05, "{volume}");
    if cfg!(target_os = "linux") {
        assert!(json["peak_memory_bytes"].as_u64().unwrap() > 1 << 20);
    }
    let info = folder.run("info knot.ply fixed.stl --json").ok();
    let lines: Vec<Value> = info.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 2);
    assert!(lines[0]["verdict"].as_str().unwrap().starts_with("7 holes ("));
    assert_eq!(lines[1]["solid"], true);
}

#[test]
fn every_format_and_surface_is_read_back_closed() {
    let folder = Folder::new();
    for surface in ["mc", "dc", "quads"] {
        for name in ["a.stl", "a.ply", "a.obj", "a.off"] {
            for more in ["", "--ascii", "--faces triangles", "--faces polygons"] {
                folder.run(&format!("repair knot.ply {name} --force -q -d 6 --surface {surface} {more}")).ok();
                assert_solid(&folder.path(name));
            }
        }
    }
    folder.run("repair knot.ply odd.name -d 5 --format obj").ok();
    assert!(fs::read_to_string(folder.path("odd.name")).unwrap().contains("\nf "));
    folder.run("repair knot.ply odd.stl -d 5 --format off --json").ok().says(&["\"format\":\"off\""]);
    folder.run("info odd.stl").ok().says(&["OFF (text)", "a solid"]);
}

/// In the cells along its tip both sides of the wedge have a vertex, and both were put where the sides meet: 270 pairs of
/// vertices at one place, which STL joined.
#[test]
fn both_sides_of_a_thin_wedge_stay_apart_in_stl() {
    let folder = Folder::new();
    let wedge = "OFF\n6 5 0\n\
        0.742 0.672 0\n0.672 0.742 0\n0 0 0\n0.742 0.672 1\n0.672 0.742 1\n0 0 1\n\
        3 2 1 0\n3 3 4 5\n4 0 1 4 3\n4 1 2 5 4\n4 2 0 3 5\n";
    fs::write(folder.path("wedge.off"), wedge).unwrap();
    for surface in ["mc", "dc", "quads"] {
        for depth in [4, 5, 6] {
            folder.run(&format!("repair wedge.off fixed.stl -q -f -d {depth} -s {surface}")).ok();
            assert_solid(&folder.path("fixed.stl"));
        }
    }
}

#[test]
fn quiet_says_nothing() {
    let folder = Folder::new();
    folder.add("plate.ply", "plate");
    for args in ["repair knot.ply a.ply -d 6 --quiet", "repair plate.ply b.ply -q"] {
        let ran = folder.run(args).ok();
        assert!(ran.out.is_empty() && ran.err.is_empty(), "{ran:?}");
    }
    let ran = folder.run("repair none.ply a.ply --quiet --force");
    ran.fails(&["none.ply"]);
    folder.run("repair knot.ply c.ply --quiet --json").refused(&["--quiet", "--json"]);
}

#[test]
fn threads_do_not_change_a_byte() {
    let folder = Folder::new();
    folder.add("gear.stl", "gear");
    for (input, surface, name) in [("gear.stl", "dc", "ply"), ("knot.ply", "mc", "stl")] {
        for threads in [1, 2] {
            folder.run(&format!("repair {input} {threads}.{name} -q -d 7 -s {surface} --threads {threads}")).ok();
        }
        let [one, two] = [1, 2].map(|threads| fs::read(folder.path(&format!("{threads}.{name}"))).unwrap());
        assert!(one == two && one.len() > 1000, "{input}");
    }
    folder.run("repair knot.ply a.ply --threads 0").refused(&["threads"]);
}

#[test]
fn what_encloses_nothing_gives_an_empty_file_and_a_warning() {
    let folder = Folder::new();
    folder.add("plate.ply", "plate");
    fs::write(folder.path("none.off"), "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n").unwrap();
    for (input, warning) in [("plate.ply", "encloses nothing"), ("none.off", "no faces")] {
        let ran = folder.run(&format!("repair {input} empty.stl --force")).ok();
        assert!(ran.err.starts_with("warning: ") && ran.err.contains(warning), "{ran:?}");
        ran.says(&["\nempty"]);
        assert!(io::read(folder.path("empty.stl")).unwrap().faces.is_empty());
    }
    folder.run("info empty.stl none.off").ok().says(&["there are no faces"]);
}

#[test]
fn nothing_is_overwritten_by_accident() {
    let folder = Folder::new();
    fs::write(folder.path("mine.ply"), "mine").unwrap();
    folder.run("repair knot.ply mine.ply").fails(&["mine.ply", "exists", "--force"]);
    assert_eq!(fs::read_to_string(folder.path("mine.ply")).unwrap(), "mine");
    folder.run("repair knot.ply mine.ply -d 5 --force").ok();
    assert_solid(&folder.path("mine.ply"));
    let before = fs::read(folder.path("knot.ply")).unwrap();
    for goal in ["knot.ply", "./knot.ply", "../knot.ply"] {
        let goal = goal.replace("..", &format!("../{}", folder.0.path().file_name().unwrap().display()));
        folder.run(&format!("repair knot.ply {goal} --force")).fails(&["knot.ply", "would replace the input"]);
    }
    folder.run("render knot.ply knot.ply --force").fails(&["knot.ply", ".png"]);
    assert!(fs::read(folder.path("knot.ply")).unwrap() == before);
    // A repair that fails leaves what was there.
    fs::write(folder.path("bad.ply"), "ply\nformat ascii 1.0\nelement vertex 1\n").unwrap();
    let before = fs::read(folder.path("mine.ply")).unwrap();
    folder.run("repair bad.ply mine.ply --force").fails(&["bad.ply"]);
    assert!(fs::read(folder.path("mine.ply")).unwrap() == before);
    assert_eq!(folder.names(), ["bad.ply", "knot.ply", "mine.ply"]);
}

#[test]
fn errors_name_the_file_and_the_remedy() {
    let folder = Folder::new();
    fs::write(folder.path("empty.stl"), "").unwrap();
    fs::write(folder.path("note.txt"), "hello").unwrap();
    fs::write(folder.path("bad.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n").unwrap();
    fs::create_dir(folder.path("dir.ply")).unwrap();
    folder.run("repair none.ply out.ply").fails(&["none.ply", "cannot read"]);
    folder.run("repair empty.stl out.ply").fails(&["empty.stl", "empty"]);
    folder.run("repair note.txt out.ply").fails(&["note.txt", "format"]);
    folder.run("repair bad.off out.ply").fails(&["bad.off: line 6: ", "vertex 9"]);
    folder.run("repair dir.ply out.ply").fails(&["dir.ply", "directory"]);
    folder.run("repair knot.ply dir.ply --force").fails(&["dir.ply", "directory"]);
    folder.run("repair knot.ply no/such/out.ply").fails(&["no/such/out.ply", "directory"]);
    folder.run("repair knot.ply out.jpeg").fails(&["out.jpeg", ".ply"]);
    folder.run("repair knot.ply out").fails(&["out: ", ".ply"]);
    folder.run("repair knot.ply").refused(&["OUT"]);
    folder.run("repair knot.ply a.ply -o b.ply").refused(&["cannot be used with"]);
    for depth in ["2", "19", "-1", "many"] {
        folder.run(&format!("repair knot.ply out.ply --depth {depth}")).refused(&["--depth"]);
    }
    for scale in ["0", "1", "nan", "big"] {
        folder.run(&format!("repair knot.ply out.ply --scale {scale}")).refused(&["--scale"]);
    }
    folder.run("").code.filter(|&code| code == 2).unwrap();
    assert_eq!(folder.names(), ["bad.off", "dir.ply", "empty.stl", "knot.ply", "note.txt"]);
    // One bad file does not keep the others from being told.
    let info = folder.run("info none.ply knot.ply empty.stl");
    assert_eq!((info.code, info.err.lines().count()), (Some(1), 2), "{info:?}");
    info.says(&["7 holes"]);
}

#[test]
fn verdicts_tell_what_is_wrong() {
    let folder = Folder::new();
    for (name, words) in [
        ("gear", "non-manifold"),
        ("doubled", "non-manifold edges"),
        ("nan", "vertices not finite"),
        ("cube", "a solid"),
        ("plate", "1 hole (4 boundary edges)"),
    ] {
        folder.add("a.off", name);
        folder.run("info a.off").ok().says(&[words]);
    }
    let cube = sample::build("cube", 1).unwrap();
    let flipped: Vec<Vec<u32>> = cube.faces.iter().map(|f| f.iter().rev().copied().collect()).collect();
    let flipped = zmend::Mesh { points: cube.points, faces: flipped.iter().map(Vec::as_slice).collect() };
    io::write(folder.path("a.off"), &flipped, WriteOptions::default()).unwrap();
    folder.run("info a.off").ok().says(&["inside out", "zmend repair"]);
}

#[test]
fn digits_are_kept_far_from_the_origin() {
    let folder = Folder::new();
    let mut ball = sample::build("sphere", 1).unwrap();
    ball.points.iter_mut().for_each(|p| *p += 1e6);
    let double = WriteOptions { precision: io::Precision::Double, ..WriteOptions::default() };
    io::write(folder.path("far.ply"), &ball, double).unwrap();
    for name in ["a.ply", "a.obj", "a.off"] {
        let ran = folder.run(&format!("repair far.ply {name} -d 6 --json")).ok();
        assert!(ran.out.contains("\"coordinate_bits\":64") && ran.err.is_empty(), "{ran:?}");
        assert_solid(&folder.path(name));
    }
    folder.run("repair far.ply text.stl -d 6 --ascii").ok();
    assert_solid(&folder.path("text.stl"));
    let ran = folder.run("repair far.ply a.stl -d 6").ok();
    assert!(ran.err.contains("7 digits"), "{ran:?}");
    ball.points.iter_mut().for_each(|p| *p *= 1e60);
    io::write(folder.path("huge.ply"), &ball, double).unwrap();
    folder.run("repair huge.ply huge.stl").fails(&["format", "STL", "PLY"]);
    folder.run("repair huge.ply b.ply -d 6").ok();
    assert_solid(&folder.path("b.ply"));
}

#[test]
fn pictures_are_drawn() {
    let folder = Folder::new();
    folder.run("render knot.ply a.png --size 120x80").ok().says(&["a.png", "120 x 80"]);
    folder.run("render knot.ply a.png").fails(&["a.png", "exists"]);
    let more = "--compare knot.ply --compare knot.ply --azimuth -30 --elevation -10.5 --wireframe --force";
    folder.run(&format!("render knot.ply a.png --size 300x100 {more}")).ok().says(&["300 x 100"]);
    assert!(fs::read(folder.path("a.png")).unwrap().starts_with(b"\x89PNG"));
    folder.run("render knot.ply b.jpg").fails(&["b.jpg", ".png"]);
    folder.run("render none.ply b.png").fails(&["none.ply"]);
    folder.run("render knot.ply b.png --size 100").refused(&["--size"]);
    folder.run("render knot.ply b.png --azimuth nan").refused(&["--azimuth"]);
    assert_eq!(folder.names(), ["a.png", "knot.ply"]);
}

#[test]
fn octree_files_are_made_and_contoured() {
    let folder = Folder::new();
    for format in ["sof", "sog", "dcf"] {
        folder.run(&format!("repair knot.ply a.{format} -d 6")).ok().says(&["on a grid of 64 cells", "surface cells"]);
        let json = folder.run(&format!("repair a.{format} b.{format} --json")).ok().json();
        assert_eq!((&json["input"]["depth"], &json["output"]["format"]), (&6.into(), &format.into()));
        let (a, b) = (fs::read(folder.path(&format!("a.{format}"))), fs::read(folder.path(&format!("b.{format}"))));
        assert_eq!(a.unwrap(), b.unwrap());
        folder.run(&format!("info a.{format}")).ok().says(&["of 64 cells a side", "zmend repair"]);
        let surface = if format == "sof" { "quads" } else { "dc" };
        let ran = folder.run(&format!("repair a.{format} {format}.ply -s {surface} --report full --json")).ok();
        assert_eq!((&ran.json()["output"]["solid"], ran.err.is_empty()), (&true.into(), format != "sof"), "{ran:?}");
        assert_solid(&folder.path(&format!("{format}.ply")));
    }
    // The content says what it is, not the name; SOG files say where they lie.
    fs::rename(folder.path("a.sog"), folder.path("a.x")).unwrap();
    folder.run("repair a.x c.stl").ok().says(&["a solid"]);
    let bounds = |name| io::read(folder.path(name)).unwrap().report().bounds;
    folder.run("repair knot.ply d.stl -d 6 -q").ok();
    assert!(bounds("c.stl").min.distance(bounds("d.stl").min) < 0.1);
    // DCF has normals, SOF has not.
    folder.run("repair a.dcf c.sof -q").ok();
    folder.run("repair a.sof c.dcf").fails(&["normals", "SOF"]);
    folder.run("repair a.sof e.ply -s dc").fails(&["surface", "mc"]);
    folder.run("repair a.dcf e.ply -d 7").fails(&["depth", "grid of its own"]);
    folder.run("repair a.dcf e.ply --scale 0.5").fails(&["scale"]);
    folder.run("sample knot e.sog").fails(&["octree"]);
    fs::write(folder.path("bad.sof"), [4, 0, 0, 0, 0, 1]).unwrap();
    folder.run("repair bad.sof e.ply").fails(&["bad.sof", "byte 6"]);
    assert_eq!(folder.run("info bad.sof knot.ply").code, Some(1));
    assert!(!folder.names().iter().any(|name| name.starts_with("e.") || name.ends_with("partial")));
}

#[test]
fn scenes_come_and_go() {
    let folder = Folder::new();
    for format in ["glb", "3mf"] {
        folder.run(&format!("repair knot.ply a.{format} -d 6 -s quads")).ok().says(&["a solid"]);
        assert_solid(&folder.path(&format!("a.{format}")));
        folder.run(&format!("repair a.{format} {format}.ply -d 6")).ok().says(&["a solid"]);
        let json = folder.run(&format!("info a.{format} --json")).ok().json();
        assert_eq!((&json["format"], &json["solid"]), (&format.into(), &true.into()));
    }
    folder.run("repair knot.ply a.gltf").fails(&["a.gltf", ".glb"]);
    folder.run("sample knot b.glb").ok();
}

#[test]
fn grids_are_given_by_cells_and_boxes() {
    let folder = Folder::new();
    folder.add("cube.off", "cube");
    let json = folder.run("repair cube.off a.ply --cell 0.03 --json").ok().json();
    assert_eq!((&json["grid"]["cell_size"], &json["grid"]["cells_a_side"]), (&0.03.into(), &64.into()));
    assert_eq!((&json["options"]["cell"], &json["options"]["depth"]), (&0.03.into(), &6.into()));
    folder.run("repair cube.off b.ply --box -5 -5.5 -1e1 20 -d 5").ok().says(&["32 cells", "0.625 wide"]);
    assert_solid(&folder.path("b.ply"));
    // The same grid for two models: the same lattice planes.
    let json = folder.run("repair cube.off c.ply --force --box -5 -5 -5 10 --cell 0.3 --json").ok().json();
    assert_eq!(
        (&json["grid"]["size"], &json["grid"]["origin"]),
        (&19.2.into(), &serde_json::json!([-5.0, -5.0, -5.0]))
    );
    assert_eq!(json["options"]["box"]["size"], 10.0);
    folder.run("repair cube.off d.ply --box 0.5 -5 -5 10").fails(&["box: the model", "least x", "holds it"]);
    folder.run("repair cube.off d.ply --cell 1e-9").fails(&["cell: ", "262144", "take cells of"]);
    for bad in
        ["--cell 1 --depth 8", "--box 0 0 0 9 --scale 0.5", "--cell 0", "--cell -1", "--box 0 0 0", "--max-memory 0"]
    {
        folder.run(&format!("repair cube.off d.ply {bad}")).refused(&[bad.split_once(' ').unwrap().0]);
    }
    assert!(!folder.path("d.ply").exists());
}

#[test]
fn flags_without_effect_are_told() {
    let folder = Folder::new();
    for (args, words) in [
        ("a.obj --ascii", "--ascii makes no difference"),
        ("a.stl --faces polygons -s dc", "STL has nothing but triangles"),
        ("a.ply --faces polygons", "marching cubes makes triangles"),
    ] {
        let ran = folder.run(&format!("repair knot.ply {args} -d 5")).ok();
        assert!(ran.err.contains(words), "{ran:?}");
    }
    let ran = folder.run("repair knot.ply b.ply --ascii --faces polygons -s quads -d 5").ok();
    assert!(!ran.err.contains("no difference"), "{ran:?}");
}

/// Volumes beyond the range of numbers were NaN, and the file no solid although nothing was wrong with it.
#[test]
fn huge_coordinates_do_not_contradict_themselves() {
    let folder = Folder::new();
    let corners = "0 0 0\n1e200 0 0\n0 1e200 0\n0 0 1e200";
    let simplex = format!("OFF\n4 4 0\n{corners}\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
    fs::write(folder.path("huge.off"), &simplex).unwrap();
    let ran = folder.run("repair huge.off a.ply -d 5").ok();
    assert!(ran.err.is_empty() && ran.out.ends_with("a solid\n"), "{ran:?}");
    folder.run("info huge.off").ok().says(&["to 1.41421e200 long", "a solid"]);
    fs::write(folder.path("huge.off"), simplex.replace("1e200", "1e305")).unwrap();
    let ran = folder.run("repair huge.off b.ply -d 5");
    assert!(ran.err.len() < 200, "{ran:?}");
    ran.fails(&["box: a cube of 1.11111e305 units", "scale the model"]);
}

#[test]
fn help_has_examples() {
    let folder = Folder::new();
    for command in ["repair", "info", "sample", "render"] {
        folder.run(&format!("{command} --help")).ok().says(&["Examples:", &format!("  zmend {command} ")]);
        folder.run("--help").ok().says(&[command]);
    }
    folder.run("--version").ok().says(&[env!("CARGO_PKG_VERSION")]);
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let folder = Folder::new();
    let program = assert_cmd::cargo::cargo_bin("zmend");
    let mut child = std::process::Command::new(program)
        .current_dir(folder.0.path())
        .args(["info", "knot.ply", "knot.ply"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

#[cfg(unix)]
#[test]
fn pipes_are_read_and_devices_written() {
    let folder = Folder::new();
    let mut command = Command::cargo_bin("zmend").unwrap();
    let args = ["repair", "/dev/stdin", "out.off", "-d", "5", "--json"];
    let input = fs::read(folder.path("knot.ply")).unwrap();
    let output = command.current_dir(folder.0.path()).args(args).write_stdin(input).output().unwrap();
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&json["input"]["holes"], &json["output"]["solid"]), (&7.into(), &true.into()));
    let ran = folder.run("repair knot.ply /dev/null --format ply -d 5").ok();
    ran.says(&["by construction"]);
    assert_eq!(folder.names(), ["knot.ply", "out.off"]);
}
