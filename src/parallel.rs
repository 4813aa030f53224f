//! Pieces made in parallel and taken in order.

use crate::error::{Error, Result};
use crate::progress::Progress;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex};

/// Pieces a thread that may be made and wait to be taken.
const AHEAD: usize = 4;
/// Why the lock is never poisoned.
const NO_PANIC: &str = "neither making nor taking panics";

/// Makes the pieces `0..count` on all threads of the current pool and passes them on to `take` in order. `init` makes what a thread
/// reuses from piece to piece.
///
/// Threads fetch numbers in ascending order. Whoever has made a piece puts it down, and takes what is next in order as long as there is
/// any; who is more than [`AHEAD`] pieces a thread ahead of what is taken waits. So few pieces exist at a time, nobody waits for a wave
/// to end, and one thread alone needs no other.
///
/// # Errors
/// The first error of `take`, and `Cancelled`.
pub(crate) fn in_order<S, T: Send>(
    count: usize,
    progress: &dyn Progress,
    init: impl Fn() -> S + Sync,
    make: impl Fn(&mut S, usize) -> T + Sync,
    take: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    struct Line<T, F> {
        waiting: BTreeMap<usize, T>,
        next: usize,
        take: F,
        result: Result<()>,
    }
    let line = Mutex::new(Line { waiting: BTreeMap::new(), next: 0, take, result: Ok(()) });
    let moved = Condvar::new();
    let fetched = AtomicUsize::new(0);
    let ahead = AHEAD * rayon::current_num_threads();
    let work = || {
        let mut state = None;
        loop {
            let number = fetched.fetch_add(1, Ordering::Relaxed);
            if number >= count {
                return;
            }
            // Whoever has the number that is next never waits here.
            let too_early = |line: &mut Line<T, _>| number >= line.next + ahead && line.result.is_ok();
            drop(moved.wait_while(line.lock().expect(NO_PANIC), too_early));
            let piece = make(state.get_or_insert_with(&init), number);
            let mut line = line.lock().expect(NO_PANIC);
            line.waiting.insert(number, piece);
            while line.result.is_ok() {
                let next = line.next;
                let Some(piece) = line.waiting.remove(&next) else { break };
                line.next += 1;
                line.result = if progress.is_cancelled() { Err(Error::Cancelled) } else { (line.take)(piece) };
            }
            moved.notify_all();
            if line.result.is_err() {
                fetched.store(count, Ordering::Relaxed);
                return;
            }
        }
    };
    rayon::scope(|scope| {
        for _ in 1..rayon::current_num_threads().min(count) {
            scope.spawn(|_| work());
        }
        work();
    });
    line.into_inner().expect(NO_PANIC).result
}

/// `0..len` in pieces of at most `size`: how many, and piece number n.
pub(crate) fn pieces(len: usize, size: usize) -> (usize, impl Fn(usize) -> Range<usize> + Copy) {
    (len.div_ceil(size), move |n| n * size..len.min((n + 1) * size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    #[test]
    fn pieces_come_in_order_whatever_they_cost() {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut taken = Vec::new();
            let make = |(): &mut (), n: usize| {
                let spin = (n * 7919 % 13) * 1000;
                std::hint::black_box((0..spin).fold(n, |a, b| a ^ b));
                n
            };
            let take = |n| {
                taken.push(n);
                Ok(())
            };
            pool.install(|| in_order(500, &Silent, || (), make, take)).unwrap();
            assert_eq!(taken, (0..500).collect::<Vec<_>>());
        }
    }

    #[test]
    fn an_error_ends_it() {
        let mut taken = 0;
        let stop = |n| {
            taken += 1;
            if n == 10 { Err(Error::setting("n", "is 10", "")) } else { Ok(()) }
        };
        assert!(in_order(1_000_000, &Silent, || (), |(), n| n, stop).is_err());
        assert_eq!(taken, 11);
    }

    #[test]
    fn pieces_cover_everything() {
        let (count, piece) = pieces(10, 4);
        assert_eq!((0..count).map(piece).collect::<Vec<_>>(), [0..4, 4..8, 8..10]);
        assert_eq!(pieces(0, 4).0, 0);
    }
}
