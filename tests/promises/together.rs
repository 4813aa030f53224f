//! Many repairs at a time in one process: the same bytes as one alone, on the threads of the caller's pool and on no others.

use crate::solids::{Case, case};
use crate::{is_same, pool};
use rayon::prelude::*;
use std::collections::HashSet;
use std::sync::Mutex;
use std::sync::mpsc;
use std::thread::ThreadId;
use std::time::Duration;
use zmend::glam::DVec3;
use zmend::mesh::{Bounds, MeshSink, MeshSizes, SourceCounts, TriangleSource, sample};
use zmend::progress::{Progress, Silent};
use zmend::{Mesh, Options, Result, Surface, repair, repair_into};

/// Cases of damaged solids; every one of them is repaired on many threads at a time.
const CASES: u64 = 16;

/// Runs something that must not wait for itself.
fn in_time<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let (send, result) = mpsc::channel();
    std::thread::spawn(move || send.send(work()));
    result.recv_timeout(Duration::from_secs(120)).expect("it neither hangs nor panics")
}

fn repaired(number: u64) -> Result<Mesh> {
    let Case { mesh, options, .. } = case(number);
    repair(mesh, &options).map(|repaired| repaired.mesh)
}

fn agree(a: &Result<Mesh>, b: &Result<Mesh>) -> bool {
    match (a, b) {
        (Ok(a), Ok(b)) => is_same(a, b),
        (Err(a), Err(b)) => a.to_string() == b.to_string(),
        _ => false,
    }
}

#[test]
fn many_repairs_at_a_time_give_what_one_gives() {
    // Those at depth 4.
    let numbers: Vec<u64> = (0..).filter(|n| n % 2 == 0).take(CASES as usize).collect();
    let alone: Vec<Result<Mesh>> = numbers.iter().map(|&n| repaired(n)).collect();
    let expected = numbers.clone();
    let (in_pool, in_own) = in_time(move || {
        // As parallel work within one pool, where repairs share threads,
        let in_pool: Vec<_> = pool(3).install(|| expected.par_iter().map(|&n| repaired(n)).collect());
        // and on threads of the caller's own, all into rayon's own pool.
        let in_own: Vec<_> = std::thread::scope(|scope| {
            let handles: Vec<_> = expected
                .chunks(4)
                .map(|some| scope.spawn(|| some.iter().map(|&n| repaired(n)).collect::<Vec<_>>()))
                .collect();
            handles.into_iter().flat_map(|handle| handle.join().expect("no panic")).collect()
        });
        (in_pool, in_own)
    });
    for (((number, alone), in_pool), in_own) in numbers.iter().zip(&alone).zip(&in_pool).zip(&in_own) {
        assert!(agree(alone, in_pool) && agree(alone, in_own), "case {number}");
    }
}

/// Notes the threads that call it.
#[derive(Default)]
struct Witness(Mutex<HashSet<ThreadId>>);

impl Witness {
    fn note(&self) {
        self.0.lock().expect("no panic").insert(std::thread::current().id());
    }
}

impl Progress for Witness {
    fn advance(&self, _: u64) {
        self.note();
    }

    fn is_cancelled(&self) -> bool {
        self.note();
        false
    }
}

#[test]
fn work_stays_in_the_callers_pool() {
    let mesh = sample::build("knot-holes", 1).expect("a sample");
    let pool = pool(2);
    let own: HashSet<ThreadId> = pool.broadcast(|_| std::thread::current().id()).into_iter().collect();
    for surface in [Surface::MarchingCubes, Surface::DualContouring] {
        let witness = Witness::default();
        let options = Options { depth: 7, surface, ..Options::default() };
        pool.install(|| repair_into(&mut &mesh, &options, &mut Mesh::default(), &witness)).expect("repairable");
        let seen = witness.0.into_inner().expect("no panic");
        assert!(!seen.is_empty() && seen.is_subset(&own), "{seen:?} of {own:?}");
    }
}

/// A sink, a source and a progress that use rayon themselves.
struct Busy {
    mesh: Mesh,
}

/// What comes last takes longest, so that others wait.
fn be_busy() {
    (0..6u64).into_par_iter().for_each(|i| std::thread::sleep(Duration::from_micros(10 * i * i)));
}

impl MeshSink for Busy {
    fn begin(&mut self, sizes: MeshSizes) -> Result<()> {
        be_busy();
        self.mesh.begin(sizes)
    }

    fn points(&mut self, points: &[DVec3]) -> Result<()> {
        be_busy();
        self.mesh.points(points)
    }

    fn faces(&mut self, arity: usize, corners: &[u32]) -> Result<()> {
        be_busy();
        self.mesh.faces(arity, corners)
    }
}

impl TriangleSource for Busy {
    fn bounds(&mut self) -> Result<Bounds> {
        be_busy();
        self.mesh.bounds()
    }

    fn triangles(&mut self, sink: &mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Result<SourceCounts> {
        self.mesh.triangles(&mut |batch| {
            be_busy();
            sink(batch)
        })
    }
}

/// Sinks that used rayon waited for ever: a thread that waits for others is given more work, and was given the next piece of the very surface
/// of which it was passing on the one before.
#[test]
fn sources_and_sinks_may_be_parallel_themselves() {
    for surface in [Surface::MarchingCubes, Surface::DualContouring, Surface::Blocks] {
        for threads in [1, 2, 4] {
            let mesh = in_time(move || {
                let mesh = sample::build("knot-holes", 1).expect("a sample");
                let options = Options { depth: 6, surface, ..Options::default() };
                let mut sink = Busy { mesh: Mesh::default() };
                let done = pool(threads).install(|| repair_into(&mut Busy { mesh }, &options, &mut sink, &Silent));
                done.map(|_| sink.mesh)
            });
            assert_eq!(mesh.expect("repairable").validate(), Ok(()));
        }
    }
}
