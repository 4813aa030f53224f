//! Time of the processor and memory of something that is done.

use peak_alloc::PeakAlloc;
use rustix::time::{ClockId, clock_gettime};
use std::hint::black_box;
use std::time::Instant;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// What something costs.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Cost {
    /// Seconds of the processor, all threads together; the least of some runs.
    pub(crate) cpu: f64,
    /// Seconds on the clock; the least of some runs.
    pub(crate) wall: f64,
    /// Bytes held at the peak, without what was held before.
    pub(crate) peak: f64,
    /// Bytes held in the end, result included.
    pub(crate) live: f64,
}

/// How long to measure.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    pub(crate) runs: usize,
    pub(crate) most_runs: usize,
    /// Seconds after which `runs` are enough, and after which one is.
    pub(crate) enough: f64,
    pub(crate) most: f64,
}

impl Effort {
    pub(crate) const FULL: Effort = Effort { runs: 3, most_runs: 30, enough: 0.5, most: 8.0 };
    pub(crate) const QUICK: Effort = Effort { runs: 1, most_runs: 3, enough: 0.05, most: 1.0 };
}

/// Seconds of the processor that the process has taken.
fn cpu() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Does something with what `prepare` makes each time, which is not measured.
pub(crate) fn measure<P, T>(effort: Effort, mut prepare: impl FnMut() -> P, mut run: impl FnMut(P) -> T) -> Cost {
    let mut cost = Cost { cpu: f64::INFINITY, wall: f64::INFINITY, ..Cost::default() };
    let (mut spent, mut runs) = (0.0, 0);
    loop {
        let input = prepare();
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        let (clock, time) = (Instant::now(), cpu());
        let result = black_box(run(input));
        let (wall, cpu) = (clock.elapsed().as_secs_f64(), cpu() - time);
        if runs == 0 {
            cost.peak = MEMORY.peak_usage().saturating_sub(before) as f64;
            cost.live = MEMORY.current_usage() as f64 - before as f64;
        }
        drop(result);
        cost.cpu = cost.cpu.min(cpu);
        cost.wall = cost.wall.min(wall);
        spent += wall;
        runs += 1;
        let enough = runs >= effort.runs && spent >= effort.enough;
        if enough || spent >= effort.most || runs == effort.most_runs {
            return cost;
        }
    }
}

/// Does something on so many threads.
pub(crate) fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be made");
    pool.install(work)
}
