//! Readers: whatever the bytes, there is an error that says something, or a result that holds what it promises.

use std::path::PathBuf;
use zmend::contour::marching_cubes;
use zmend::contour::volume::{ExtractOptions, Method, extract};
use zmend::io::volume::{VolumeOptions, read_volume_bytes};
use zmend::io::{self, Format, OctreeFormat, skt};
use zmend::mesh::TriangleSource;
use zmend::progress::Silent;
use zmend::volume::Level;
use zmend::{Error, Mesh};

/// The name that errors must begin with.
const NAME: &str = "fuzzed";
/// What is looked at further: some formats hold large things in few bytes.
const MOST_FACES: usize = 2000;

pub(crate) fn stl(bytes: &[u8]) {
    mesh(bytes, Format::Stl, true);
}

pub(crate) fn ply(bytes: &[u8]) {
    mesh(bytes, Format::Ply, true);
}

pub(crate) fn obj(bytes: &[u8]) {
    mesh(bytes, Format::Obj, false);
}

pub(crate) fn off(bytes: &[u8]) {
    mesh(bytes, Format::Off, false);
}

pub(crate) fn gltf(bytes: &[u8]) {
    mesh(bytes, Format::Gltf, false);
}

pub(crate) fn glb(bytes: &[u8]) {
    mesh(bytes, Format::Glb, false);
}

/// An archive as it is, or the XML of the model in a sound one: else a fuzzer never gets past the checksum.
pub(crate) fn threemf(bytes: &[u8]) {
    match bytes.split_first() {
        Some((b'<', _)) => mesh(&archive(bytes), Format::ThreeMf, false),
        _ => mesh(bytes, Format::ThreeMf, false),
    }
}

/// Checks an error's words: they name the input, or a file beside it that it refers to, and no part of them is missing.
fn check_error(error: &Error) {
    let message = error.to_string();
    match error {
        Error::Format { problem, .. } => assert!(!problem.is_empty() && message.starts_with(NAME), "{message}"),
        Error::Io { action, .. } => assert_eq!(*action, "read", "{message}"),
        _ => panic!("{message}"),
    }
}

/// Reads a mesh, and streams it where that is something else.
fn mesh(bytes: &[u8], hint: Format, is_streamed: bool) {
    let read = io::read_bytes(NAME, bytes, Some(hint));
    match &read {
        Ok(mesh) => check_mesh(mesh, hint, bytes.len()),
        Err(error) => check_error(error),
    }
    if is_streamed {
        check_stream(bytes, hint, &read);
    }
}

fn check_mesh(mesh: &Mesh, hint: Format, len: usize) {
    assert!(mesh.faces.corners().iter().all(|&i| (i as usize) < mesh.points.len()), "indices lead somewhere");
    // Scenes may use their parts several times.
    let is_scene = matches!(hint, Format::Gltf | Format::Glb | Format::ThreeMf);
    let most = if is_scene { (3 << 20) + 48 * len } else { len };
    assert!(mesh.points.len() <= most && mesh.faces.corners().len() <= most, "no more than {len} bytes can say");
    if mesh.faces.len() <= MOST_FACES {
        let is_solid = mesh.validate().is_ok();
        let report = mesh.report();
        assert!(!is_solid || report.is_closed(), "{report:?}");
    }
}

/// What the stream finds is what the reader finds.
fn check_stream(bytes: &[u8], hint: Format, read: &zmend::Result<Mesh>) {
    thread_local!(static PATH: PathBuf = std::env::temp_dir().join(format!(
        "zmend-fuzz-{}-{:?}", std::process::id(), std::thread::current().id()
    )));
    let path = PATH.with(|path| path.with_extension(hint.extension()));
    std::fs::write(&path, bytes).expect("written");
    let streamed = io::open(&path).and_then(|mut input| {
        let bounds = input.bounds()?;
        let counts = input.triangles(&mut |_| Ok(()))?;
        Ok((bounds, counts))
    });
    std::fs::remove_file(&path).expect("removed");
    match (read, streamed) {
        (Ok(mesh), Ok((bounds, counts))) => {
            assert_eq!(counts.polygons, mesh.faces.len() as u64);
            let whole = (&*mesh).bounds().expect("sound");
            assert_eq!((bounds.min, bounds.max), (whole.min, whole.max));
        }
        (Err(_), Err(_)) => {}
        // What stands behind the faces of a PLY file is not looked at by the stream.
        (Err(_), Ok(_)) => assert!(bytes.trim_ascii_start().starts_with(b"ply")),
        (Ok(_), Err(error)) => panic!("{error}"),
    }
}

pub(crate) fn sof(bytes: &[u8]) {
    octree(bytes, OctreeFormat::Sof);
}

pub(crate) fn sog(bytes: &[u8]) {
    octree(bytes, OctreeFormat::Sog);
}

pub(crate) fn dcf(bytes: &[u8]) {
    octree(bytes, OctreeFormat::Dcf);
}

fn octree(bytes: &[u8], hint: OctreeFormat) {
    match io::read_octree_bytes(NAME, bytes, Some(hint)) {
        Err(error) => check_error(&error),
        Ok(file) => {
            assert_eq!(file.octree.validate(), Ok(()));
            assert_eq!(file.octree.crossings().odd_faces(), vec![]);
            let mut mesh = Mesh::default();
            marching_cubes(&file.octree, &file.frame, &mut mesh, &Silent).expect("in memory");
            assert_eq!(mesh.validate(), Ok(()));
        }
    }
}

pub(crate) fn skt(bytes: &[u8]) {
    match skt::parse(NAME, bytes) {
        Err(error) => check_error(&error),
        Ok(skeleton) => {
            let again = skt::parse(NAME, &skt::encode(&skeleton)).expect("ours");
            assert_eq!(skt::encode(&again), skt::encode(&skeleton));
        }
    }
}

pub(crate) fn axs(bytes: &[u8]) {
    match io::sketch::read_bytes(NAME, bytes) {
        Err(error) => check_error(&error),
        Ok(lines) => {
            assert!(lines.points.iter().all(|p| p.is_finite()));
            let mut ends = lines.lines.iter().flat_map(|line| &line.0);
            assert!(ends.all(|&i| (i as usize) < lines.points.len()), "lines lead somewhere");
            assert!(lines.points.len() <= bytes.len() && lines.lines.len() <= bytes.len());
        }
    }
}

/// The first byte says how much is known of the rest: nothing, or a layout of raw samples.
pub(crate) fn volume(bytes: &[u8]) {
    let Some((&first, rest)) = bytes.split_first() else { return };
    let raw = ["2x2x2:u8", "3x2x1:u16be", "4x4x4:f32", "2x3x4:f64:skip=7", "5x5x5:i8", "1x1x1:i32be"];
    let mut options = VolumeOptions::default();
    if first < 12 {
        options.raw = Some(raw[usize::from(first % 6)].parse().expect("a layout"));
    } else if first < 16 {
        options.channel = Some(usize::from(first - 12));
    }
    match read_volume_bytes(NAME, rest, &options, &Silent) {
        Err(error) => {
            let message = error.to_string();
            assert!(!message.is_empty());
        }
        Ok(file) => {
            let size = file.image.size();
            assert_eq!(size.iter().product::<usize>(), file.image.voxels().len());
            if file.image.voxels().len() <= 4096 {
                let range = file.image.voxels().range();
                let options = ExtractOptions {
                    level: Level::above(0.5 * (range.least + range.greatest)),
                    method: Method::SurfaceNets,
                    ..ExtractOptions::default()
                };
                let mut mesh = Mesh::default();
                if extract(&file.image, &options, &mut mesh, &Silent).is_ok() {
                    assert_eq!(mesh.validate(), Ok(()));
                }
            }
        }
    }
}

/// A ZIP archive that holds a model, not packed.
fn archive(model: &[u8]) -> Vec<u8> {
    const PATH: &[u8] = b"3D/3dmodel.model";
    let fields = |out: &mut Vec<u8>| {
        for half in [20u16, 0, 0, 0, 33] {
            out.extend(half.to_le_bytes());
        }
        for word in [crc32(model), model.len() as u32, model.len() as u32] {
            out.extend(word.to_le_bytes());
        }
        out.extend((PATH.len() as u16).to_le_bytes());
        out.extend(0u16.to_le_bytes());
    };
    let mut out = b"PK\x03\x04".to_vec();
    fields(&mut out);
    out.extend(PATH);
    out.extend(model);
    let start = out.len() as u32;
    out.extend(b"PK\x01\x02\x14\0");
    fields(&mut out);
    out.extend([0; 14]);
    out.extend(PATH);
    let size = out.len() as u32 - start;
    out.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    out.extend(size.to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0; 2]);
    out
}

/// The checksum of archives, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}
