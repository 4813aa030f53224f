//! Keeping a repair within its memory, and saying what would do when it is not enough.
//!
//! Stages say what they are going to hold ([`Progress::hold`]), from what they know: chunks of hits as they fill, bricks and crossings as
//! they are made, the tables of closing and contouring from counts. [`Guard`] compares that with the limit. What a sink will hold is known
//! before it is given anything ([`GuardedSink`]). So nothing is taken before it is granted, whatever the input; only small things (a
//! batch of triangles, what threads have at hand) are not counted.
//!
//! One estimate is made beforehand, where the input is small and its triangles may be huge: how many hits are to be expected
//! ([`expected_hits`]). It saves filling gigabytes until the limit is met. Where the limit is met, the same estimate tells the depth
//! that would do.

use super::options::{Inside, Options, Surface};
use crate::error::{Bytes, Error, Result};
use crate::geom::Frame;
use crate::geom::frame::DEPTHS;
use crate::mesh::{MeshSink, MeshSizes, TriangleSource};
use crate::progress::{Progress, Stage};
use crate::sign::expected_hits;
use glam::DVec3;
use std::sync::atomic::{AtomicU64, Ordering};

/// Sources with at most so many triangles are measured before they are scanned: that takes some milliseconds.
const FEW_TRIANGLES: u64 = 1 << 20;
/// Bytes of a hit while it waits, with what is left empty in chunks.
const HIT: f64 = 8.5;
/// Bytes of the octree for each crossing: offset, brick, signs and index.
const CROSSING: f64 = 6.6;
/// Bytes more for the normal.
const NORMAL: f64 = 2.0;
/// Bytes for each crossing while dual contouring looks at it.
const DUAL: f64 = 2.5;
/// What is named as a remedy must do: not all that is held is a quarter with each level less, and stages differ.
const SPARE: f64 = 1.6;
/// Bytes for each hit while winding numbers of an open surface are told.
const WINDING: f64 = 16.0;
/// An estimate may be wrong by as much, as a factor.
const SAFETY: f64 = 1.2;

/// Progress that refuses to hold more than a limit.
pub(super) struct Guard<'a> {
    progress: &'a dyn Progress,
    limit: u64,
    /// The most that was held. It counts as held ever after where something large is added: allocators rarely give back to the
    /// system what lies among other things.
    held: AtomicU64,
}

impl<'a> Guard<'a> {
    pub(super) fn new(progress: &'a dyn Progress, options: &Options) -> Self {
        Guard { progress, limit: options.max_memory.unwrap_or(u64::MAX), held: AtomicU64::new(0) }
    }

    /// Refuses a source whose hits alone are more than may be held, if it takes little time to look.
    pub(super) fn check_source(&self, source: &mut dyn TriangleSource, frame: &Frame) -> Result<()> {
        if self.limit == u64::MAX || source.size_hint().is_none_or(|triangles| triangles > FEW_TRIANGLES) {
            return Ok(());
        }
        // Without the safety: what may be possible is tried.
        self.hold((expected_hits(source, frame, self.progress)? * 8.0) as u64)
    }

    /// Adds a remedy to an error that says that memory is short.
    pub(super) fn explain(
        &self,
        error: Error,
        source: &mut dyn TriangleSource,
        sink: Option<&dyn MeshSink>,
        frame: &Frame,
        options: &Options,
    ) -> Error {
        let Error::Memory { needed, limit, .. } = error else { return error };
        let hits = match expected_hits(source, frame, self.progress) {
            Ok(hits) => hits,
            Err(error) => return error,
        };
        let needed = (SAFETY * estimate(hits, options, sink)).max(needed as f64);
        let at = |depth: u32| needed / 4f64.powi((frame.depth() - depth) as i32);
        let fitting = (*DEPTHS.start()..frame.depth()).rev().find(|&depth| SPARE * at(depth) <= limit as f64);
        let remedy = match fitting {
            Some(depth) => {
                let cells = crate::error::Short(frame.size() / f64::from(1u32 << depth));
                let bytes = Bytes(at(depth) as u64);
                format!("depth {depth}, with cells of {cells} units, needs about {bytes}; or allow more")
            }
            None => "allow more: no depth needs so little".to_owned(),
        };
        Error::Memory { needed: needed as u64, limit, remedy }
    }
}

/// Bytes that a repair with so many hits takes when it takes the most, with what the sink holds if there is one.
fn estimate(hits: f64, options: &Options, sink: Option<&dyn MeshSink>) -> f64 {
    let count = hits as u64;
    let octree = hits * (CROSSING + if options.surface.needs_normals() { NORMAL } else { 0.0 });
    // A closed surface of triangles has two for each point, one of quadrilaterals one.
    let (tables, arity) = match options.surface {
        Surface::MarchingCubes => (0.0, 3),
        Surface::DualContouring | Surface::Quads | Surface::Blocks => (DUAL, 4),
    };
    let faces = if arity == 3 { count.saturating_mul(2) } else { count };
    let sizes = MeshSizes { points: count, faces, corners: faces.saturating_mul(arity) };
    // Sinks need not reckon with more than there can be.
    let sink = sink.filter(|_| hits < 1e15).map_or(0.0, |sink| sink.bytes_for(sizes) as f64);
    // Whether the surface is open is not known yet.
    let hit = if matches!(options.inside, Inside::Auto | Inside::Winding) { WINDING } else { HIT };
    (hits * hit).max(octree + hits * tables) + sink
}

impl Progress for Guard<'_> {
    fn begin(&self, stage: Stage, total: u64) {
        self.progress.begin(stage, total);
    }

    fn advance(&self, amount: u64) {
        self.progress.advance(amount);
    }

    fn hold(&self, bytes: u64) -> Result<()> {
        if bytes > self.limit {
            return Err(Error::Memory { needed: bytes, limit: self.limit, remedy: String::new() });
        }
        self.held.fetch_max(bytes, Ordering::Relaxed);
        self.progress.hold(bytes)
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled()
    }
}

/// A sink that is only begun if what it will hold may be held beside what the stages hold.
pub(super) struct GuardedSink<'a> {
    pub(super) sink: &'a mut (dyn MeshSink + Send),
    pub(super) guard: &'a Guard<'a>,
}

impl MeshSink for GuardedSink<'_> {
    fn bytes_for(&self, sizes: MeshSizes) -> u64 {
        self.sink.bytes_for(sizes)
    }

    fn begin(&mut self, sizes: MeshSizes) -> Result<()> {
        let beside = self.guard.held.load(Ordering::Relaxed);
        self.guard.hold(beside.saturating_add(self.sink.bytes_for(sizes)))?;
        self.sink.begin(sizes)
    }

    fn points(&mut self, points: &[DVec3]) -> Result<()> {
        self.sink.points(points)
    }

    fn faces(&mut self, arity: usize, corners: &[u32]) -> Result<()> {
        self.sink.faces(arity, corners)
    }
}

#[cfg(test)]
mod tests {
    use crate::mesh::{Mesh, sample};
    use crate::repair::{Options, Surface, repair};
    use crate::{Error, progress::Silent, repair_into};
    use glam::DVec3;

    fn refused(mesh: &Mesh, options: Options) -> (u64, u64, String) {
        match repair(mesh.clone(), &options) {
            Err(Error::Memory { needed, limit, remedy }) => (needed, limit, remedy),
            other => panic!("{other:?}"),
        }
    }

    /// The depth that a remedy names.
    fn depth(remedy: &str) -> u32 {
        remedy
            .strip_prefix("depth ")
            .and_then(|rest| rest.split(',').next())
            .and_then(|n| n.parse().ok())
            .expect(remedy)
    }

    #[test]
    fn a_cube_at_the_greatest_depth_is_refused_at_once() {
        let cube = sample::build("cube", 1).unwrap();
        let (needed, limit, remedy) =
            refused(&cube, Options { depth: 18, max_memory: Some(4 << 30), ..Options::default() });
        assert!(limit == 4 << 30 && needed > 1 << 41, "{needed}");
        assert!(remedy.ends_with("or allow more"), "{remedy}");
        assert!((11..=14).contains(&depth(&remedy)), "{remedy}");
    }

    #[test]
    fn what_is_named_as_remedy_does() {
        for name in ["knot-holes", "scan", "cheese", "soup", "cube"] {
            let Ok(mesh) = sample::build(name, 1) else { continue };
            for surface in [Surface::MarchingCubes, Surface::DualContouring] {
                let options = Options { depth: 8, max_memory: Some(4 << 20), surface, ..Options::default() };
                let (_, _, remedy) = refused(&mesh, options);
                let fits = Options { depth: depth(&remedy), ..options };
                let result = repair(mesh.clone(), &fits);
                assert!(result.is_ok(), "{name} {surface:?}: {remedy}: {:?}", result.err());
            }
        }
    }

    #[test]
    fn without_any_depth_that_does_it_says_so() {
        let cube = sample::build("cube", 1).unwrap();
        let (_, _, remedy) = refused(&cube, Options { max_memory: Some(100), ..Options::default() });
        assert_eq!(remedy, "allow more: no depth needs so little");
    }

    /// Loose small triangles: nearly every one has a block, a brick and a hole of its own.
    #[test]
    fn loose_triangles_are_refused_in_any_stage() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let mut soup = Mesh::default();
        for i in 0..3000 {
            let at = DVec3::new(random(), random(), random());
            soup.points.extend((0..3).map(|_| at + 1e-3 * DVec3::new(random(), random(), random())));
            soup.faces.push(&[3 * i, 3 * i + 1, 3 * i + 2]);
        }
        let run = |limit| {
            let options = Options { depth: 11, max_memory: Some(limit), ..Options::default() };
            repair_into(&mut soup.clone(), &options, &mut Mesh::default(), &Silent)
        };
        let mut refusals = 0;
        let mut limit = 10_000;
        while run(limit).is_err_and(|e| matches!(e, Error::Memory { .. })) {
            refusals += 1;
            limit += limit / 4;
        }
        assert!(refusals > 10 && limit < 1 << 26, "{refusals} refusals below {limit}");
        assert!(run(limit).is_ok());
    }
}
