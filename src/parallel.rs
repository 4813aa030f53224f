//! Pieces made in parallel and taken in order.

use crate::error::{Error, Result};
use crate::progress::Progress;
use rayon::Scope;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Pieces a thread that may be made and wait to be taken.
const AHEAD: usize = 4;
/// Why no lock is ever poisoned.
const NO_PANIC: &str = "nobody panics with the lock in hand";

/// Makes the pieces `0..count` on all threads of the current pool and passes them on to `take` in order. `init` makes what is
/// reused from piece to piece, by one at a time.
///
/// A turn makes one piece, the next in ascending order, and puts it down; then it takes what is next in order as long as there is any, unless
/// another turn is at that already. There are as many turns as pieces may exist at a time, [`AHEAD`] a thread, and one more begins with
/// each piece that is taken. So few pieces exist at a time, nobody waits for a wave to end, and one thread alone needs no other.
///
/// No turn ever waits for another one, and no lock is held while something is made or taken. So both may use rayon themselves, or belong to a
/// sink that does: a thread that waits there for others may be given any turn of any line meanwhile.
///
/// # Errors
/// The first error of `take`, and `Cancelled`.
pub(crate) fn in_order<S: Send, T: Send>(
    count: usize,
    progress: &dyn Progress,
    init: impl Fn() -> S + Sync,
    make: impl Fn(&mut S, usize) -> T + Sync,
    take: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let line = Line {
        count,
        fetched: AtomicUsize::new(0),
        spare: Mutex::new(Vec::new()),
        made: Mutex::new(Made { waiting: BTreeMap::new(), next: 0, take: Some(take), result: Ok(()) }),
        progress,
        init,
        make,
    };
    let turns = count.min(AHEAD * rayon::current_num_threads());
    rayon::scope(|scope| (0..turns).for_each(|_| scope.spawn(|scope| line.turn(scope))));
    line.made.into_inner().expect(NO_PANIC).result
}

/// Pieces on their way.
struct Line<'a, S, T, I, M, K> {
    count: usize,
    /// How many were begun.
    fetched: AtomicUsize,
    /// What `init` made and nobody uses.
    spare: Mutex<Vec<S>>,
    made: Mutex<Made<T, K>>,
    progress: &'a dyn Progress,
    init: I,
    make: M,
}

/// What was made.
struct Made<T, K> {
    waiting: BTreeMap<usize, T>,
    /// The number of the piece to be taken next.
    next: usize,
    /// In the hands of whoever takes.
    take: Option<K>,
    result: Result<()>,
}

impl<S, T, I, M, K> Line<'_, S, T, I, M, K>
where
    S: Send,
    T: Send,
    I: Fn() -> S + Sync,
    M: Fn(&mut S, usize) -> T + Sync,
    K: FnMut(T) -> Result<()> + Send,
{
    fn turn<'s>(&'s self, scope: &Scope<'s>) {
        let number = self.fetched.fetch_add(1, Ordering::Relaxed);
        if number >= self.count {
            return;
        }
        let spare = self.spare.lock().expect(NO_PANIC).pop();
        let mut state = spare.unwrap_or_else(&self.init);
        let piece = (self.make)(&mut state, number);
        self.spare.lock().expect(NO_PANIC).push(state);
        let mut made = self.made.lock().expect(NO_PANIC);
        made.waiting.insert(number, piece);
        // Who has it looks for more before it lays it down.
        let Some(mut take) = made.take.take() else { return };
        while made.result.is_ok() {
            let next = made.next;
            let Some(piece) = made.waiting.remove(&next) else { break };
            drop(made);
            let result = if self.progress.is_cancelled() { Err(Error::Cancelled) } else { take(piece) };
            scope.spawn(|scope| self.turn(scope));
            made = self.made.lock().expect(NO_PANIC);
            (made.next, made.result) = (next + 1, result);
        }
        if made.result.is_err() {
            self.fetched.store(self.count, Ordering::Relaxed);
        }
        made.take = Some(take);
    }
}

/// `0..len` in pieces of at most `size`: how many, and piece number n.
pub(crate) fn pieces(len: usize, size: usize) -> (usize, impl Fn(usize) -> Range<usize> + Copy) {
    (len.div_ceil(size), move |n| n * size..len.min((n + 1) * size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use rayon::prelude::*;
    use std::time::Duration;

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

    /// Whoever waited in a nested call of rayon was given another piece of the same line to make: it waited for a lock that it held itself,
    /// or for a piece that lay below it on its own stack.
    #[test]
    fn making_and_taking_may_be_parallel_themselves() {
        let (send, done) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            for threads in [1, 2, 3, 5] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                // What comes last takes longest: somebody else takes it, and the others wait.
                let nap = |i: usize| std::thread::sleep(Duration::from_micros((i * i) as u64));
                let nested = |n: usize| (0..n % 12).into_par_iter().with_max_len(1).for_each(nap);
                let line = || {
                    let mut taken = Vec::new();
                    let make = |(): &mut (), n| {
                        nested(n);
                        n
                    };
                    let take = |n| {
                        nested(n / 2);
                        taken.push(n);
                        Ok(())
                    };
                    in_order(100, &Silent, || (), make, take).unwrap();
                    taken
                };
                // Several lines at a time on the same threads, too.
                let taken: Vec<_> = pool.install(|| (0..6).into_par_iter().map(|_| line()).collect());
                assert!(taken.into_iter().all(|taken| taken.into_iter().eq(0..100)));
            }
            send.send(()).unwrap();
        });
        done.recv_timeout(Duration::from_secs(60)).expect("nobody waits for what he has to do himself");
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
