//! From slices to the sink: what all extractors have in common.

use super::slice::{Slice, bytes};
use super::sweep::Walker;
use crate::error::{Error, Result};
use crate::mesh::{MeshSink, MeshSizes};
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Stage, check};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Slices that a thread walks over at a time. The signs of one more are made.
const SLAB: usize = 16;

/// Makes points and triangles of slices: the part of extraction that knows what the surface shall look like.
///
/// The points of a slice come in an order that is the extractor's own, and so do its triangles. They may refer to points of this slice
/// and the ones next to it.
pub(super) trait Extractor: Sync {
    /// What a thread reuses from slice to slice.
    type Scratch: Send;

    /// Makes that.
    fn scratch(&self) -> Self::Scratch;

    /// Number of points of slice `z`, and of triangles: its own, or others', but as many in all as there are.
    fn count(&self, scratch: &mut Self::Scratch, z: usize) -> [u64; 2];

    /// Appends the points of slice `z`, in model units.
    fn points(&self, scratch: &mut Self::Scratch, z: usize, points: &mut Vec<DVec3>);

    /// Appends the corners of the triangles of slice `z`; `first(z)` is the number of the first point of a slice.
    fn triangles(&self, scratch: &mut Self::Scratch, z: usize, first: impl Fn(usize) -> u32, corners: &mut Vec<u32>);
}

/// All slices, walked over in slabs on all threads.
pub(super) fn walk<W: Walker>(walker: &W, progress: &dyn Progress) -> Result<Vec<Slice>> {
    let (count, slab) = pieces(walker.slices(), SLAB);
    progress.begin(Stage::Contour, 3 * walker.slices() as u64);
    let held = AtomicU64::new(0);
    let walk = |n| {
        check(progress)?;
        let slices = walker.walk(slab(n));
        let bytes = bytes(&slices);
        progress.hold(held.fetch_add(bytes, Ordering::Relaxed) + bytes)?;
        progress.advance(slices.len() as u64);
        Ok(slices)
    };
    let slabs: Vec<Vec<Slice>> = (0..count).into_par_iter().map(walk).collect::<Result<_>>()?;
    Ok(slabs.into_iter().flatten().collect())
}

/// Something made of each slice, on all threads.
pub(super) fn in_parallel<S, T: Send>(
    slices: usize,
    progress: &dyn Progress,
    init: impl Fn() -> S + Sync + Send,
    make: impl Fn(&mut S, usize) -> T + Sync,
) -> Result<Vec<T>> {
    let checked = |state: &mut S, z| check(progress).map(|()| make(state, z));
    (0..slices).into_par_iter().map_init(init, checked).collect()
}

/// Passes on the points and triangles of all slices.
pub(super) fn pass_on<E: Extractor>(
    extractor: &E,
    slices: &[Slice],
    sink: &mut (dyn MeshSink + Send),
    progress: &dyn Progress,
) -> Result<MeshSizes> {
    let counts = in_parallel(slices.len(), progress, || extractor.scratch(), |scratch, z| extractor.count(scratch, z))?;
    let mut points = 0;
    let mut firsts = Vec::with_capacity(counts.len());
    for [n, _] in &counts {
        firsts.push(points);
        points += n;
    }
    let faces = counts.iter().map(|&[_, n]| n).sum();
    if points > u64::from(u32::MAX) || 3 * faces > u64::from(u32::MAX) {
        let problem =
            format!("the surface has {points} points and {faces} faces; fewer than 2^32 corners can be numbered");
        return Err(Error::setting("size", problem, "cut the volume into parts, or make it coarser"));
    }
    let sizes = MeshSizes { points, faces, corners: 3 * faces };
    sink.begin(sizes)?;
    let make_points = |scratch: &mut E::Scratch, z: usize| {
        let mut points = Vec::with_capacity(counts[z][0] as usize);
        extractor.points(scratch, z, &mut points);
        debug_assert_eq!(points.len() as u64, counts[z][0], "points of slice {z} are as many as were counted");
        points
    };
    let take_points = |points: Vec<DVec3>| {
        progress.advance(1);
        sink.points(&points)
    };
    in_order(slices.len(), progress, || extractor.scratch(), make_points, take_points)?;
    let make_triangles = |scratch: &mut E::Scratch, z: usize| {
        let mut corners = Vec::with_capacity(3 * counts[z][1] as usize);
        extractor.triangles(scratch, z, |z| firsts.get(z).map_or(0, |&n| n as u32), &mut corners);
        corners
    };
    let mut made = 0;
    let take_triangles = |corners: Vec<u32>| {
        progress.advance(1);
        made += corners.len() as u64;
        sink.faces(3, &corners)
    };
    in_order(slices.len(), progress, || extractor.scratch(), make_triangles, take_triangles)?;
    debug_assert_eq!(made, 3 * faces, "triangles are as many as were counted");
    Ok(sizes)
}
