//! What fuzzing is fed with and what it found, replayed: the seeds, changes of them by chance, and every past finding.
//!
//! `fuzz/run.sh` runs the same bodies for hours. `ZMEND_REPLAY_CHANGES=1000` makes so many changes of each seed here, without a fuzzer.

mod bodies;

use std::fs;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Changes of each seed in CI.
const CHANGES: u64 = 12;
/// Longer inputs are not made.
const MOST_BYTES: usize = 4096;

fn inputs(kind: &str, target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/replay").join(kind).join(target);
    let Ok(entries) = fs::read_dir(&folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), fs::read(path).expect("readable"))).collect()
}

/// Runs a target; on a panic says of which input.
fn run(target: &'static str, what: &str, bytes: &[u8]) -> Result<(), String> {
    catch_unwind(|| bodies::run(target, bytes)).map_err(|_| format!("{target}: {what}"))
}

#[test]
fn findings_stay_mended() {
    let mut count = 0;
    for (target, _) in bodies::TARGETS {
        for (path, bytes) in inputs("findings", target) {
            assert_eq!(run(target, &path.display().to_string(), &bytes), Ok(()));
            count += 1;
        }
    }
    println!("{count} findings replayed");
}

#[test]
fn seeds_and_changes_of_them_do_no_harm() {
    let changes = std::env::var("ZMEND_REPLAY_CHANGES").ok().map_or(CHANGES, |n| n.parse().expect("a number"));
    let seeds: Vec<_> = bodies::TARGETS
        .into_iter()
        .flat_map(|(target, _)| {
            let seeds = inputs("seeds", target);
            assert!(!seeds.is_empty(), "{target} has no seeds");
            seeds.into_iter().map(move |(path, bytes)| (target, path, bytes))
        })
        .collect();
    let (next, runs) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let failures: Vec<String> = std::thread::scope(|scope| {
        let work = || {
            let mut failures = Vec::new();
            while let Some((target, path, bytes)) = seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
                for change in 0..=changes {
                    let input = if change == 0 { bytes.clone() } else { changed(bytes, &seeds, change) };
                    let what = format!("{}, change {change}: {}", path.display(), input.escape_ascii());
                    failures.extend(run(target, &what, &input).err());
                    runs.fetch_add(1, Ordering::Relaxed);
                }
            }
            failures
        };
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        handles.into_iter().flat_map(|handle| handle.join().expect("no panic")).collect()
    });
    println!("{} inputs from {} seeds", runs.into_inner(), seeds.len());
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}

/// Splitmix64.
struct Chance(u64);

impl Chance {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % n.max(1) as u64) as usize
    }
}

/// One to four changes: bytes are replaced, removed, doubled, cut off, or taken from another seed.
fn changed(bytes: &[u8], seeds: &[(&str, PathBuf, Vec<u8>)], number: u64) -> Vec<u8> {
    const BYTES: &[u8] = b"\0\x01\x7f\x80\xff0123456789-.e \n<>/\"[]{}";
    let mut chance = Chance(number.wrapping_mul(1_000_003) ^ bytes.len() as u64);
    let mut out = bytes.to_vec();
    for _ in 0..=chance.below(4) {
        if out.is_empty() {
            return out;
        }
        let at = chance.below(out.len());
        let length = 1 + chance.below(16.min(out.len() - at));
        match chance.below(7) {
            0 => out[at] = BYTES[chance.below(BYTES.len())],
            1 => out[at] ^= 1 << chance.below(8),
            2 => drop(out.drain(at..at + length)),
            3 => {
                let piece = out[at..at + length].to_vec();
                out.splice(at..at, piece);
            }
            4 => out.truncate(at),
            5 => out[at..at + length].fill(0xff),
            _ => {
                let other = &seeds[chance.below(seeds.len())].2;
                let from = chance.below(other.len());
                let piece = &other[from..other.len().min(from + 24)];
                out.splice(at..(at + piece.len()).min(out.len()), piece.iter().copied());
            }
        }
    }
    out.truncate(MOST_BYTES);
    out
}
