//! `zmend compare`, and the self-intersections that `zmend info` tells, as users meet them.

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use tempfile::TempDir;
use zmend::Mesh;
use zmend::glam::DVec3;
use zmend::io::{self, Precision, WriteOptions};
use zmend::mesh::sample;

/// A folder with a cube of six squares, 0 to 1, as `cube.ply`.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Folder(tempfile::tempdir().unwrap());
        folder.add("cube.ply", &sample::build("cube", 1).unwrap());
        folder
    }

    fn add(&self, name: &str, mesh: &Mesh) {
        let options = WriteOptions { precision: Precision::Double, ..WriteOptions::default() };
        io::write(self.0.path().join(name), mesh, options).unwrap();
    }

    /// Adds the cube, moved and scaled.
    fn add_cube(&self, name: &str, scale: f64, shift: DVec3) {
        let mut cube = sample::build("cube", 1).unwrap();
        cube.points.iter_mut().for_each(|p| *p = *p * scale + shift);
        self.add(name, &cube);
    }

    /// Exit code, standard output and standard error of the program; arguments are separated by blanks.
    fn run(&self, args: &str) -> (i32, String, String) {
        let mut command = Command::cargo_bin("zmend").unwrap();
        let output = command.current_dir(self.0.path()).args(args.split_whitespace()).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
    }

    /// Standard output of a run that succeeds and complains of nothing.
    #[track_caller]
    fn out(&self, args: &str) -> String {
        let (code, out, err) = self.run(args);
        assert_eq!((code, &*err), (0, ""), "{args}: {out}");
        out
    }

    #[track_caller]
    fn json(&self, args: &str) -> Value {
        serde_json::from_str(&self.out(&format!("{args} --json"))).unwrap()
    }
}

/// The words of the line that begins with a label.
#[track_caller]
fn line<'a>(text: &'a str, label: &str) -> &'a str {
    let found = text.lines().find_map(|line| line.trim_start().strip_prefix(label));
    found.unwrap_or_else(|| panic!("no {label} in\n{text}")).trim()
}

#[test]
fn distances_and_numbers_stand_side_by_side() {
    let folder = Folder::new();
    folder.add_cube("moved.obj", 1.0, DVec3::new(0.25, 0.0, 0.0));
    let text = folder.out("compare cube.ply moved.obj");
    assert!(text.starts_with("A: cube.ply\nB: moved.obj\n"), "{text}");
    assert_eq!(line(&text, "vertices").split_whitespace().collect::<Vec<_>>(), ["8", "8"]);
    assert_eq!(line(&text, "least x y z").split_whitespace().collect::<Vec<_>>(), ["0", "0", "0", "0.25", "0", "0"]);
    assert_eq!(line(&text, "self-intersections").split_whitespace().collect::<Vec<_>>(), ["0", "0"]);
    assert_eq!(line(&text, "genus").split_whitespace().collect::<Vec<_>>(), ["0", "0"]);
    // A quarter of the square root of three.
    let hausdorff = line(&text, "Hausdorff distance");
    assert_eq!(hausdorff, "0.25 (14.4338 %); 100 % is the diagonal of A's box, 1.73205");
    let json = folder.json("compare cube.ply moved.obj");
    let distance = &json["distance"];
    assert!((distance["hausdorff"].as_f64().unwrap() - 0.25).abs() < 1e-12);
    assert!((distance["hausdorff_percent"].as_f64().unwrap() - 25.0 / 3f64.sqrt()).abs() < 1e-9);
    assert_eq!(json["a"]["genus"], json["b"]["genus"]);
    assert_eq!((&json["a"]["path"], &json["b"]["format"]), (&"cube.ply".into(), &"obj".into()));
    assert_eq!(json["options"]["samples"], 200_000);
    for way in ["a_to_b", "b_to_a"] {
        // One face in six is a quarter away, four hang over by a quarter, and one lies within: as far from the middle
        // of its sides as from the face, at most; the mean of that is the integral of (1 - 2t)^2 for t up to a quarter.
        let mean = distance[way]["mean"].as_f64().unwrap();
        assert!((mean - (0.25 + 4.0 * 0.25 * 0.125 + 0.875 / 6.0) / 6.0).abs() < 3e-4, "{mean}");
        assert_eq!(distance[way]["points"], 200_008);
        let place = |key: &str| (0..3).map(|k| distance[way][key][k].as_f64().unwrap()).collect::<Vec<_>>();
        let gap = DVec3::from_slice(&place("from")).distance(DVec3::from_slice(&place("to")));
        assert!((gap - 0.25).abs() < 1e-12);
    }
}

#[test]
fn one_surface_may_be_far_where_the_other_is_not() {
    let folder = Folder::new();
    let mut two = sample::build("cube", 1).unwrap();
    let cube = two.clone();
    two.points.extend(cube.points.iter().map(|p| p + 10.0 * DVec3::Y));
    cube.faces.iter().for_each(|f| two.faces.push(&f.iter().map(|i| i + 8).collect::<Vec<_>>()));
    folder.add("two.off", &two);
    let json = folder.json("compare cube.ply two.off -n 1000 --quick");
    assert!(json["distance"]["a_to_b"]["max"].as_f64().unwrap() < 1e-12);
    assert!((json["distance"]["b_to_a"]["max"].as_f64().unwrap() - 10.0).abs() < 1e-12);
    assert_eq!((&json["a"]["components"], &json["b"]["components"]), (&1.into(), &2.into()));
    assert_eq!(json["b"]["self_intersections"], Value::Null);
}

#[test]
fn scripts_learn_whether_it_is_near_enough() {
    let folder = Folder::new();
    folder.add_cube("moved.ply", 1.0, DVec3::new(0.0, 0.0, 0.125));
    for (limit, is_near) in [("0.2", true), ("0.1", false), ("8%", true), ("7%", false), ("0", false)] {
        let (code, out, err) = folder.run(&format!("compare cube.ply moved.ply -n 1000 --max-distance {limit}"));
        assert_eq!((code, err.is_empty()), (i32::from(!is_near), is_near), "{limit}: {err}");
        assert!(out.contains("Hausdorff distance 0.125"), "{out}");
        assert!(is_near || err.starts_with("warning: distance 0.125 "), "{err}");
    }
    for bad in ["-1", "nan", "near", "%"] {
        let (code, _, err) = folder.run(&format!("compare cube.ply moved.ply --max-distance {bad}"));
        assert!(code == 2 && err.contains("--max-distance"), "{bad}: {err}");
    }
}

#[test]
fn the_same_seed_gives_the_same_words_on_any_number_of_threads() {
    let folder = Folder::new();
    folder.add("overlap.stl", &sample::build("overlap", 1).unwrap());
    folder.add("knot.ply", &sample::build("knot", 1).unwrap());
    let with = |more: &str| folder.out(&format!("compare overlap.stl knot.ply -n 20000 --quick {more}"));
    let one = with("--threads 1");
    assert_eq!(one, with("--threads 3"));
    assert_ne!(one, with("--seed 2"));
}

#[test]
fn what_is_no_surface_is_told() {
    let folder = Folder::new();
    fs::write(folder.0.path().join("none.off"), "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n").unwrap();
    fs::write(folder.0.path().join("line.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n").unwrap();
    for (a, b, why) in [
        ("cube.ply", "none.off", "B has no face with an area"),
        ("line.off", "cube.ply", "A has no face with an area"),
        ("none.off", "line.off", "there is no face with an area"),
    ] {
        let text = folder.out(&format!("compare {a} {b}"));
        assert!(text.ends_with(&format!("no distance: {why}\n")), "{text}");
        assert_eq!(folder.json(&format!("compare {a} {b}"))["distance"], Value::Null);
        let (code, _, err) = folder.run(&format!("compare {a} {b} --max-distance 1"));
        assert!(code == 1 && err.contains(why), "{err}");
    }
    let (code, out, err) = folder.run("compare cube.ply missing.ply");
    assert!(code == 1 && out.is_empty() && err.starts_with("error: missing.ply"), "{err}");
    // Faces with points at no place are left out.
    folder.add("ball.ply", &sample::build("sphere", 1).unwrap());
    folder.add("nan.ply", &sample::build("nan", 1).unwrap());
    let json = folder.json("compare nan.ply ball.ply -n 1000");
    assert!(json["distance"]["hausdorff"].as_f64().is_some(), "{json}");
}

#[test]
fn self_intersections_are_counted() {
    let folder = Folder::new();
    let mut two = sample::build("cube", 1).unwrap();
    let cube = two.clone();
    two.points.extend(cube.points.iter().map(|p| p + 0.5));
    cube.faces.iter().for_each(|f| two.faces.push(&f.iter().map(|i| i + 8).collect::<Vec<_>>()));
    folder.add("two.ply", &two);
    // Three faces of each, and each passes through two of the other.
    let text = folder.out("info two.ply");
    assert_eq!(line(&text, "self-intersections"), "6");
    assert!(text.ends_with("closed, manifold, oriented: a solid, but it passes through or touches itself\n"), "{text}");
    assert_eq!(folder.json("info two.ply")["self_intersections"], 6);
    assert_eq!(folder.json("info cube.ply")["self_intersections"], 0);
    let quick = folder.out("info two.ply --quick");
    assert!(quick.ends_with(": a solid\n") && !quick.contains("self-intersections"), "{quick}");
    assert_eq!(folder.json("info two.ply --quick")["self_intersections"], Value::Null);
    // More than a million are not counted: 1,500 sheets through one line.
    let turned = |i: u32| zmend::glam::DVec2::from_angle(f64::from(i) * 1e-3);
    let points = (0..1500).flat_map(|i| [turned(i).extend(1.0), turned(i).extend(-1.0), (-turned(i)).extend(0.0)]);
    let faces: Vec<[u32; 3]> = (0..1500).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    folder.add("book.ply", &Mesh { points: points.collect(), faces: faces.iter().map(|f| &f[..]).collect() });
    assert_eq!(line(&folder.out("info book.ply"), "self-intersections"), "over 1,000,000");
    assert_eq!(folder.json("info book.ply")["self_intersections"], 1_000_001);
}

#[test]
fn help_has_examples() {
    let folder = Folder::new();
    let help = folder.out("compare --help");
    assert!(
        ["Examples:", "  zmend compare ", "--max-distance 0.5%"].iter().all(|words| help.contains(words)),
        "{help}"
    );
    assert!(folder.out("--help").contains("compare"));
    assert!(folder.out("info --help").contains("--quick"));
}
