//! Any target, by its name in the environment variable `ZMEND_FUZZ`: what it does is in `tests/replay/bodies`.
#![no_main]

#[path = "../tests/replay/bodies/mod.rs"]
mod bodies;

use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static NAME: LazyLock<String> = LazyLock::new(|| std::env::var("ZMEND_FUZZ").expect("ZMEND_FUZZ names a target"));

fuzz_target!(|bytes: &[u8]| bodies::run(&NAME, bytes));
