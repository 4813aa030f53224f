//! Whoever wants to stop a stage need not wait for its end, and gets back all memory.
//!
//! `ZMEND_CANCEL_DEPTH=10 cargo test --release --test promises cancel -- --nocapture` stops large work of each kind at forty moments and says how long it
//! went on at most; in CI the work is small. Work runs on one thread, and time is what that thread has computed: others that keep the
//! machine busy make no difference.

use crate::number;
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use zmend::contour::volume::{ExtractOptions, Method, extract};
use zmend::glam::DVec3;
use zmend::mesh::{DistanceOptions, sample};
use zmend::progress::{Progress, Silent, Stage};
use zmend::repair::{Keep, Offset, Thicken};
use zmend::volume::{Level, LevelSet};
use zmend::{Error, Inside, Mesh, Options, Result, Solid, Surface, repair_into, solidify, topology};

/// The longest that work may go on.
const MOST: Duration = Duration::from_millis(100);

/// How long this thread has computed.
#[cfg(target_os = "linux")]
fn now() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("a thread");
    let nanos = text.split_whitespace().next().and_then(|word| word.parse().ok());
    Duration::from_nanos(nanos.expect("a number"))
}

/// The time of day.
#[cfg(not(target_os = "linux"))]
fn now() -> Duration {
    std::time::UNIX_EPOCH.elapsed().expect("a time")
}

/// Stops after a time, and notes the stages.
struct Stop {
    begun: Duration,
    after: Duration,
    is_asked: AtomicBool,
    /// The stage that runs, and the longest time between two looks while it did, in nanoseconds.
    stages: Mutex<(Option<Stage>, BTreeMap<Stage, u64>)>,
    last: AtomicU64,
}

impl Stop {
    fn after(after: Duration) -> Self {
        Stop {
            begun: now(),
            after,
            is_asked: AtomicBool::new(false),
            stages: Mutex::default(),
            last: AtomicU64::new(0),
        }
    }

    fn elapsed(&self) -> Duration {
        now().saturating_sub(self.begun)
    }

    fn look(&self) {
        let now = self.elapsed().as_nanos() as u64;
        let gap = now.saturating_sub(self.last.swap(now, Ordering::Relaxed));
        let mut stages = self.stages.lock().expect("no panic");
        if let Some(stage) = stages.0 {
            let longest = stages.1.entry(stage).or_default();
            *longest = gap.max(*longest);
        }
    }
}

impl Progress for Stop {
    fn begin(&self, stage: Stage, _: u64) {
        self.look();
        self.stages.lock().expect("no panic").0 = Some(stage);
    }

    fn is_cancelled(&self) -> bool {
        self.look();
        let is_over = self.elapsed() >= self.after;
        self.is_asked.fetch_or(is_over, Ordering::Relaxed);
        is_over
    }
}

type Job = (&'static str, Box<dyn Fn(&dyn Progress) -> Result<()> + Sync>);

fn repairing(name: &'static str, mesh: &'static str, detail: u32, options: Options) -> Job {
    let mesh = sample::build(mesh, detail).expect("a sample");
    let job =
        move |progress: &dyn Progress| repair_into(&mut &mesh, &options, &mut Mesh::default(), progress).map(|_| ());
    (name, Box::new(job))
}

/// All kinds of work, on grids of some depth.
fn jobs(depth: u32) -> Vec<Job> {
    let detail = 1 << (depth.saturating_sub(7) / 2);
    let plain = Options { depth, ..Options::default() };
    let by = |inside| Options { inside, ..plain };
    let coarse = Options { depth: depth - 1, ..plain };
    let topology = |topology| Options { topology, ..coarse };
    // Some cells.
    let width = 6.0 * 3.0 / f64::from(1u32 << depth);
    let mut jobs = vec![
        repairing("scan, close, marching cubes", "knot-holes", 4 * detail, by(Inside::Parity)),
        repairing("many triangles", "scan", 8 * detail, by(Inside::Parity)),
        repairing("winding", "knot-holes", detail, Options { inside: Inside::Winding, ..coarse }),
        repairing("winding of overlaps", "overlap", detail, by(Inside::Winding)),
        repairing("hull", "gear", detail, by(Inside::Hull)),
        repairing("hull with gap", "gear", detail, Options { gap: Some(width), inside: Inside::Hull, ..coarse }),
        repairing("dual contouring", "part", detail, Options { surface: Surface::DualContouring, ..plain }),
        repairing(
            "dual contouring, disjoint",
            "part",
            detail,
            Options { surface: Surface::DualContouring, no_self_intersections: true, ..plain },
        ),
        repairing("blocks", "part", detail, Options { surface: Surface::Blocks, ..plain }),
        repairing(
            "walls",
            "scan",
            detail,
            Options { thicken: Some(width), thicken_what: Thicken::All, inside: Inside::Parity, ..coarse },
        ),
        repairing("offset", "torus", detail, Options { offset: Some(Offset::Solid(width)), ..coarse }),
        repairing("shell", "torus", detail, Options { offset: Some(Offset::Shell(width)), ..coarse }),
        repairing(
            "keep",
            "overlap",
            detail,
            Options { keep: Keep::Largest, drop_cavities: true, ..by(Inside::Parity) },
        ),
        repairing(
            "cut",
            "noisy",
            detail,
            topology(topology::Options { cut: Some(0.01), ..topology::Options::default() }),
        ),
        repairing(
            "fill",
            "noisy",
            detail,
            topology(topology::Options { fill: Some(0.01), ..topology::Options::default() }),
        ),
        repairing(
            "genus",
            "noisy",
            detail,
            topology(topology::Options { genus: Some(0), ..topology::Options::default() }),
        ),
    ];
    let soup = sample::build("gear", detail).expect("a sample");
    let ball = sample::build("sphere", detail).expect("a sample");
    let far = DistanceOptions { samples: 10_000 << (2 * (depth.max(7) - 7)), ..DistanceOptions::default() };
    jobs.push(("distances", Box::new(move |progress| ball.distances(&soup, far, progress).map(|_| ()))));
    let side = 1usize << (depth - 2).min(9);
    let gyroid = move |p: DVec3| {
        let q = p * (40.0 / side as f64);
        q.x.sin() * q.y.cos() + q.y.sin() * q.z.cos() + q.z.sin() * q.x.cos()
    };
    for (name, method) in [
        ("volume, marching cubes", Method::MarchingCubes),
        ("volume, dual contouring", Method::DualContouring),
        ("volume, extended", Method::ExtendedMarchingCubes),
    ] {
        let options = ExtractOptions { level: Level::below(0.0), method, ..ExtractOptions::default() };
        let job = move |progress: &dyn Progress| {
            extract(&LevelSet::new([side; 3], gyroid), &options, &mut Mesh::default(), progress).map(|_| ())
        };
        jobs.push((name, Box::new(job)));
    }
    let to_solid = move |progress: &dyn Progress| {
        Solid::from_volume(&LevelSet::new([side; 3], gyroid), Level::below(0.0), DVec3::ZERO, 1.0, progress).map(|_| ())
    };
    jobs.push(("solid of a volume", Box::new(to_solid)));
    let mut knot = sample::build("knot", detail).expect("a sample");
    let with_normals = Options { surface: Surface::DualContouring, ..plain };
    let (solid, _) = solidify(&mut knot, &with_normals, &Silent).expect("repairable");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("knot.dcf");
    zmend::io::write_dcf(&path, solid.signed(), &Silent).expect("written");
    let read = path.clone();
    jobs.push(("read an octree", Box::new(move |progress| zmend::io::read_octree(&read, progress).map(|_| ()))));
    let write = move |progress: &dyn Progress| {
        let result = zmend::io::write_dcf(path.with_extension("out"), solid.signed(), progress).map(|_| ());
        let names = std::fs::read_dir(folder.path()).expect("there").count();
        assert_eq!(names, if path.with_extension("out").exists() { 2 } else { 1 }, "whole or absent");
        let _ = std::fs::remove_file(path.with_extension("out"));
        result
    };
    jobs.push(("write an octree", Box::new(write)));
    jobs
}

/// Does work on one thread until it is stopped: what came of it, for how long it went on afterwards, and its looks.
fn run(job: &Job, after: Duration) -> (Result<()>, Duration, Stop) {
    crate::pool(1).install(|| {
        let stop = Stop::after(after);
        let result = job.1(&stop);
        (result, stop.elapsed().saturating_sub(after), stop)
    })
}

#[test]
fn any_work_stops_soon_when_told_to() {
    let depth = number("ZMEND_CANCEL_DEPTH");
    let moments = if depth.is_some() { 40 } else { 2 };
    let mut late = Vec::new();
    for job in jobs(depth.map_or(7, |depth| depth as u32)) {
        let name = job.0;
        let (result, _, watch) = run(&job, Duration::MAX);
        result.expect("nobody stops it");
        let gaps = watch.stages.lock().expect("no panic").1.clone();
        let whole = Duration::from_nanos(watch.last.load(Ordering::Relaxed));
        let (mut worst, mut stopped) = (Duration::ZERO, 0);
        for moment in 0..moments {
            let after = whole.mul_f64((f64::from(moment) + 0.5) / f64::from(moments));
            let (result, late, stop) = run(&job, after);
            match result {
                Err(Error::Cancelled) => stopped += 1,
                Ok(()) => assert!(!stop.is_asked.into_inner(), "{name}: it was told to stop"),
                Err(error) => panic!("{name}: {error}"),
            }
            worst = worst.max(late);
        }
        let gaps: Vec<String> =
            gaps.iter().map(|(stage, gap)| format!("{} {} ms", stage.name(), gap / 1_000_000)).collect();
        println!(
            "{name}: {whole:.1?} in all, stopped {stopped} times of {moments}, after {worst:.1?} at most; between looks: {}",
            gaps.join(", ")
        );
        if worst > MOST {
            late.push(format!("{name}: {worst:.0?}"));
        }
    }
    assert!(late.is_empty(), "too late: {late:?}");
}

/// What is told to stop before it begins does nothing.
#[test]
fn what_is_stopped_at_once_does_not_begin() {
    for job in jobs(5) {
        assert!(matches!(run(&job, Duration::ZERO).0, Err(Error::Cancelled)), "{}", job.0);
    }
}
