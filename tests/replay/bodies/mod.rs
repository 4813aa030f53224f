//! What is done with any bytes whatever: the bodies of the fuzz targets, which `fuzz/` runs for hours and `cargo test` over all corpora.
//!
//! Each takes bytes and panics where a promise is broken: not only by a panic of the library, but also by a result that its validators, or
//! an oracle here, find wrong. Nothing but the library is needed, so the same bytes mean the same with any fuzzer.

mod draw;
mod edits;
mod fields;
mod files;
mod octrees;
mod signs;
mod soups;

use draw::Draw;

/// A fuzz target: its name, and what it does with bytes.
pub(crate) type Target = (&'static str, fn(&[u8]));

/// All of them.
pub(crate) const TARGETS: [Target; 19] = [
    ("stl", files::stl),
    ("ply", files::ply),
    ("obj", files::obj),
    ("off", files::off),
    ("gltf", files::gltf),
    ("glb", files::glb),
    ("threemf", files::threemf),
    ("sof", files::sof),
    ("sog", files::sog),
    ("dcf", files::dcf),
    ("skt", files::skt),
    ("axs", files::axs),
    ("volume", files::volume),
    ("octree_bytes", octrees::bytes),
    ("octrees", octrees::operations),
    ("edits", edits::operations),
    ("soups", soups::repaired),
    ("signs", signs::mended),
    ("fields", fields::extracted),
];

/// Runs a target by its name.
pub(crate) fn run(name: &str, bytes: &[u8]) {
    let (_, body) = TARGETS.iter().find(|target| target.0 == name).expect("a target of this name");
    body(bytes);
}
