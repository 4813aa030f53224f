//! Memory within limits, and signals: what only a whole process can show.
#![cfg(target_os = "linux")]

use serde_json::Value;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use zmend::io::{self, WriteOptions};
use zmend::mesh::sample;

fn program() -> PathBuf {
    assert_cmd::cargo::cargo_bin("zmend")
}

/// A folder with samples of some detail.
fn folder(samples: &[(&str, u32)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, detail) in samples {
        let path = folder.path().join(format!("{name}.ply"));
        io::write(path, &sample::build(name, *detail).unwrap(), WriteOptions::default()).unwrap();
    }
    folder
}

/// Runs the program; arguments are separated by blanks.
fn run(folder: &Path, args: &str) -> Output {
    Command::new(program()).current_dir(folder).args(args.split_whitespace()).output().unwrap()
}

fn error(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn the_peak_stays_below_the_limit() {
    let folder = folder(&[("knot-holes", 2), ("scan", 1), ("cube", 1)]);
    for (args, least) in [
        ("repair knot-holes.ply a.ply -d 9", 20),
        ("repair knot-holes.ply a.stl -d 9 -s dc", 20),
        ("repair scan.ply a.ply -d 9 -s quads", 20),
        ("repair cube.ply a.stl -d 10", 60),
        ("repair cube.ply a.ply -d 10 -s dc", 40),
        ("repair cube.ply a.ply -d 9 --inside hull", 36),
        ("repair scan.ply a.ply -d 8 --inside hull --gap 0.05", 58),
        ("repair scan.ply a.ply -d 8 --thicken 0.05 --thicken-what all", 36),
        ("repair scan.ply a.ply -d 9 --thicken 0.05", 28),
        ("repair knot-holes.ply a.ply -d 9 --keep largest --drop-cavities", 24),
        ("repair knot-holes.ply a.ply -d 9 --cut 0.01", 36),
        ("repair scan.ply a.ply -d 9 --fill 0.01", 64),
    ] {
        let mut limit = least * 1_000_000u64;
        let mut refusals = 0;
        let peak = loop {
            let output = run(folder.path(), &format!("{args} --force --json --report brief --max-memory {limit}"));
            if output.status.success() {
                let json: Value = serde_json::from_slice(&output.stdout).unwrap();
                break json["peak_memory_bytes"].as_u64().unwrap();
            }
            assert_eq!(output.status.code(), Some(1));
            assert!(error(&output).starts_with("error: max-memory: "), "{}", error(&output));
            refusals += 1;
            limit += limit / 8;
        };
        println!("{args}: peak {peak} of {limit} after {refusals} refusals");
        assert!(peak <= limit, "{args}: {peak} of {limit}");
        // Nor is much more asked for than is taken.
        assert!(refusals == 0 || peak > limit / 2, "{args}: {peak} of {limit}");
    }
    assert!(names(folder.path()).iter().all(|name| !name.contains("partial")));
}

#[test]
fn a_cube_at_the_greatest_depth_ends_with_a_clear_error_and_soon() {
    let folder = folder(&[("cube", 1)]);
    let start = Instant::now();
    let script = format!("ulimit -v 2000000; exec {} repair cube.ply out.ply -d 18", program().display());
    for output in [
        Command::new("sh").current_dir(folder.path()).args(["-c", &script]).output().unwrap(),
        run(folder.path(), "repair cube.ply out.ply -d 18 --max-memory 1G"),
    ] {
        let error = error(&output);
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(error.starts_with("error: max-memory: ") && error.contains("depth 1"), "{error}");
        assert!(error.contains("TB or more are needed"), "{error}");
    }
    assert!(start.elapsed() < Duration::from_secs(20));
    assert_eq!(names(folder.path()), ["cube.ply"]);
}

/// A repair that takes long, stopped by a signal once it has begun to write.
fn interrupt(signals: &[&str]) -> (Output, Duration) {
    let folder = folder(&[("cube", 1)]);
    let mut command = Command::new(program());
    command.current_dir(folder.path()).args("repair cube.ply out.ply -d 13 --max-memory 60G".split(' '));
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let begun = Instant::now();
    while !names(folder.path()).iter().any(|name| name.contains("partial")) {
        assert!(begun.elapsed() < Duration::from_secs(60), "the file is begun");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(50));
    let sent = Instant::now();
    for signal in signals {
        let status = Command::new("kill").arg(signal).arg(child.id().to_string()).status().unwrap();
        assert!(status.success());
    }
    let output = child.wait_with_output().unwrap();
    let elapsed = sent.elapsed();
    if signals.len() == 1 {
        assert_eq!(names(folder.path()), ["cube.ply"], "nothing half-written is left");
    }
    (output, elapsed)
}

#[test]
fn signals_end_a_repair_and_leave_nothing() {
    for signal in ["-INT", "-TERM"] {
        let (output, elapsed) = interrupt(&[signal]);
        assert_eq!(output.status.code(), Some(130), "{}", error(&output));
        assert_eq!(error(&output), "error: cancelled\n");
        assert!(output.stdout.is_empty());
        // A tenth of a second on a quiet machine.
        assert!(elapsed < Duration::from_secs(5), "{elapsed:?}");
    }
}

#[test]
fn a_second_signal_ends_it_at_once() {
    let (output, _) = interrupt(&["-INT", "-INT"]);
    assert_eq!(output.status.code(), Some(130), "{}", error(&output));
}

/// Writes a binary STL file of a bumpy ball with `2 n^2` triangles.
fn write_ball(path: &Path, n: u32) {
    let mut out = BufWriter::with_capacity(1 << 20, File::create(path).unwrap());
    out.write_all(&[b' '; 80]).unwrap();
    out.write_all(&(2 * n * n).to_le_bytes()).unwrap();
    let point = |i: u32, j: u32| {
        let (theta, phi) = (f64::from(i) / f64::from(n), f64::from(j % n) / f64::from(n));
        let ((st, ct), (sp, cp)) = ((theta * std::f64::consts::PI).sin_cos(), (phi * std::f64::consts::TAU).sin_cos());
        let r = 1.0 + 0.1 * (7.0 * ct).sin();
        let st = if i == 0 || i == n { 0.0 } else { st };
        [r * st * cp, r * st * sp, r * ct].map(|c| c as f32)
    };
    let mut row: Vec<[f32; 3]> = (0..=n).map(|j| point(0, j)).collect();
    for i in 1..=n {
        let next: Vec<[f32; 3]> = (0..=n).map(|j| point(i, j)).collect();
        for j in 0..n as usize {
            for triangle in [[row[j], next[j], next[j + 1]], [row[j], next[j + 1], row[j + 1]]] {
                let mut record = [0; 50];
                let numbers = triangle.as_flattened().iter().flat_map(|c| c.to_le_bytes());
                record[12..48].iter_mut().zip(numbers).for_each(|(byte, value)| *byte = value);
                out.write_all(&record).unwrap();
            }
        }
        row = next;
    }
    out.flush().unwrap();
}

/// Peak memory and bytes of the file of a repair of a ball with `2 n^2` triangles, in an address space of `kilobytes`.
fn peak_of_ball(n: u32, depth: u32, kilobytes: u64) -> (u64, u64) {
    let folder = tempfile::tempdir().unwrap();
    write_ball(&folder.path().join("ball.stl"), n);
    let program = program();
    let args = format!("repair ball.stl out.ply -d {depth} --json --report brief --threads 2");
    let script = format!("ulimit -v {kilobytes}; exec {} {args}", program.display());
    let output = Command::new("sh").current_dir(folder.path()).args(["-c", &script]).output().unwrap();
    assert!(output.status.success(), "{}", error(&output));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{} bytes: peak {}, {}", json["input"]["bytes"], json["peak_memory_bytes"], json["seconds"]);
    (json["peak_memory_bytes"].as_u64().unwrap(), json["input"]["bytes"].as_u64().unwrap())
}

#[test]
fn memory_does_not_depend_on_the_size_of_the_input() {
    let [(small, of_small), (large, of_large)] = [100, 500].map(|n| peak_of_ball(n, 7, 1_000_000));
    assert!(of_large > 24 * of_small && large < small + 4_000_000, "{small} for {of_small}, {large} for {of_large}");
}

/// `cargo test --release --test memory -- --ignored --nocapture streamed`: writes 2 GB to the folder for temporary files.
#[test]
#[ignore = "writes 2 GB and takes a minute"]
fn two_gigabytes_are_streamed() {
    let [(small, _), (large, of_large)] = [450, 4500].map(|n| peak_of_ball(n, 9, 500_000));
    assert!(of_large > 2_000_000_000 && large < small + 10_000_000, "{small}, {large}");
}

/// Peak memory of the extraction of a ball from a volume of so many samples along each axis, one byte each.
fn peak_of_volume(side: usize) -> u64 {
    let folder = tempfile::tempdir().unwrap();
    let from_middle = |c: usize| (c as f64 - 0.5 * (side - 1) as f64) / side as f64;
    let sample = |i: usize| {
        let squares = [i % side, i / side % side, i / (side * side)].map(|c| from_middle(c).powi(2));
        (128.0 + 1000.0 * (0.4 - squares.iter().sum::<f64>().sqrt())) as u8
    };
    fs::write(folder.path().join("ball.raw"), (0..side.pow(3)).map(sample).collect::<Vec<u8>>()).unwrap();
    let args =
        format!("extract ball.raw out.ply --iso 128 --raw {side}x{side}x{side}:u8 --threads 2 --json --report brief");
    let output = run(folder.path(), &args);
    assert!(output.status.success(), "{}", error(&output));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    json["peak_memory_bytes"].as_u64().unwrap()
}

/// Beside the volume, extraction holds what it knows of the surface and the signs of few slices: here some 65 bytes for each sample of a slice, of
/// which the ball has six triangles.
#[test]
fn extraction_takes_the_memory_of_a_slice() {
    let side = 320;
    let beside = peak_of_volume(side).saturating_sub(peak_of_volume(8) + side.pow(3) as u64);
    let of_slice = (side * side) as u64;
    println!("{beside} bytes, {} a sample of a slice", beside / of_slice);
    assert!(beside < 110 * of_slice, "{beside}");
}
