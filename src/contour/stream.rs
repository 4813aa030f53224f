//! Pieces made in parallel and taken in order.

use crate::error::Result;
use crate::progress::{Progress, check};
use rayon::prelude::*;

/// Bricks in a piece: some ten thousand cells, whose points and faces stay in the cache until they are taken.
pub(super) const BRICKS: usize = 64;

/// Makes a piece of every `BRICKS` bricks, in parallel, and passes the pieces on in order; while some are taken the next are made.
/// Memory: four pieces a thread. `init` makes what a thread reuses.
pub(super) fn in_order<S: Send, T: Send>(
    bricks: usize,
    progress: &dyn Progress,
    init: impl Fn() -> S + Sync,
    make: impl Fn(&mut S, std::ops::Range<usize>) -> T + Sync,
    mut take: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let at_once = BRICKS * 2 * rayon::current_num_threads();
    let wave = |from: usize| -> Vec<T> {
        let to = bricks.min(from + at_once);
        let starts: Vec<usize> = (from..to).step_by(BRICKS).collect();
        starts.into_par_iter().map_init(&init, |state, at| make(state, at..to.min(at + BRICKS))).collect()
    };
    let mut ready = wave(0);
    let mut from = at_once;
    while !ready.is_empty() {
        check(progress)?;
        let (taken, next) = rayon::join(|| ready.into_iter().try_for_each(&mut take), || wave(from));
        taken?;
        progress.advance((bricks.min(from) - (from - at_once)) as u64);
        from += at_once;
        ready = next;
    }
    Ok(())
}
