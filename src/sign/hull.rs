//! The hull: inside is what infinity cannot reach.
//!
//! For faces without trustworthy orientation, duplicated, torn or put together from parts that only nearly meet: nothing counts but that there
//! is a face. The outside is what can be reached from infinity along lattice edges that no face hits (one of the [`Regions`]), inside is the
//! rest. Walls within vanish, and so do sheets that enclose nothing. The surface goes through the hit that is nearest to the outside.
//!
//! # Gaps
//!
//! Where faces leave gaps, the outside flows in. With a gap of width w = 2 r the hull is closed first (in the sense of mathematical morphology:
//! Serra 1982, with a ball; Nooruddin and Turk 2003 close models with it):
//!
//! 1. The outside comes from infinity, but not nearer to any face than r: a [`Band`] says where. It cannot pass through gaps below w.
//! 2. From there it grows back by r, but not through faces: up to the faces where there are any, and into a gap as far as a ball of
//!    radius r would sink into it. A second band, round the outside of step 1, says how far.
//!
//! The lattice needs room to pass: gaps wider than w are certain to let the outside in only if they are two cells wider or more.
//!
//! As with any closing, sharp inner corners are rounded, with radius r. Faces are touched from outside only as the ball does; what lies
//! deeper in narrow places is inside.
//!
//! # Cost
//!
//! That of [`Regions`] without gaps. With them, that of two bands of r cells: memory and time grow with the surface times r.

use super::band::{Band, seed_bytes};
use super::thicken::{check_gap, clipped, for_crossed, sample};
use crate::error::Result;
use crate::geom::Frame;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Face, Key};
use crate::mesh::TriangleSource;
use crate::octree::crossings::{Sample, lattice_point};
use crate::octree::hits::{EdgeHit, OrientedHits};
use crate::octree::regions::{ClosedBricks, ClosedEdges, REGION_BYTES, Regions};
use crate::octree::signed::{GIVEN_BYTES, SignedOctree};
use crate::progress::{Beside, Progress, check};
use glam::Vec3;
use rayon::prelude::*;
use std::iter::Peekable;

/// What infinity cannot reach without passing through a face.
///
/// # Errors
/// `Memory` when `progress` says so.
pub fn hull(hits: &OrientedHits, progress: &dyn Progress) -> Result<SignedOctree> {
    let edges = hits.edges();
    progress.hold((2 * hits.bytes() + edges.bricks().len() * (REGION_BYTES + GIVEN_BYTES)) as u64)?;
    let regions = Regions::new(edges);
    let signs: Vec<(Key, Plane)> = (0..edges.bricks().len())
        .into_par_iter()
        .map(|i| (edges.bricks()[i].key, !regions.points_in(i, |region| region == 0)))
        .collect();
    let samples = |i: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
        // Both ends of a crossed edge lie in different regions, so it is hit.
        hits.for_edges(&edges.bricks()[i], |axis, local, hits| {
            if crossed[axis.index()].get(local) {
                out.push(outermost(hits, signs[i].1.get(local)));
            }
        });
    };
    let uniform = |key| regions.of_absent(key) != 0;
    SignedOctree::try_from_signs(edges.depth(), edges.with_normals(), &signs, uniform, samples, progress)
}

/// Of the hits of an edge, the one that is nearest to its outer end.
fn outermost(hits: &[EdgeHit], starts_inside: bool) -> Sample {
    let hit = if starts_inside { hits.last() } else { hits.first() };
    let Sample { offset, normal } = hit.expect("an edge with hits").sample;
    Sample::new(offset, normal)
}

/// Distances from crossings are too large by so much, in cells, for a radius; see [`Band`].
fn tolerance(radius: f64) -> f64 {
    0.1 + 0.08 / radius
}

/// As [`hull`], after gaps between faces up to a width of `gap` model units are closed. `hits` are those of the same source and frame.
///
/// # Errors
/// When the gap is above 120 cells or below 0.6; whatever the source returns; `Cancelled`, and `Memory` when `progress` says so.
pub fn hull_with_gap(
    hits: &OrientedHits,
    source: &mut dyn TriangleSource,
    frame: &Frame,
    gap: f64,
    progress: &dyn Progress,
) -> Result<SignedOctree> {
    let radius = 0.5 * gap / frame.cell_size();
    check_gap(gap, frame)?;
    let held = 2 * hits.bytes();
    progress.hold((held + seed_bytes(hits.edges().bricks().len())) as u64)?;
    let faces = Band::around(source, frame, radius, &Beside { progress, bytes: held as u64 })?;
    let held = held + faces.bytes() + faces.keys().len() * (WALL_BYTES + GIVEN_BYTES);
    progress.hold(held as u64)?;
    let far = walls(hits, &[&faces], |key| !faces.within(key, radius));
    check(progress)?;
    let far_regions = Regions::new(&far);
    check(progress)?;
    let outer = |key: Key| match far.find(key) {
        Some(i) => far_regions.points_in(i, |region| region == 0),
        None if far_regions.of_absent(key) == 0 => Plane::FULL,
        None => Plane::EMPTY,
    };
    let rolled = rolled(hits, &far, &faces, radius, outer);
    check(progress)?;
    let beside = Beside { progress, bytes: held as u64 };
    let rim = Band::around_crossings(rolled.crossings(), radius + tolerance(radius), &beside)?;
    drop(rolled);
    let most = faces.keys().len() + rim.keys().len();
    progress.hold((held + rim.bytes() + most * (WALL_BYTES + GIVEN_BYTES)) as u64)?;
    let grown = |key: Key| outer(key) | rim.within(key, radius + tolerance(radius));
    let near = walls(hits, &[&faces, &rim], grown);
    check(progress)?;
    let regions = Regions::new(&near);
    check(progress)?;

    let signs: Vec<(Key, Plane)> = (0..near.len())
        .into_par_iter()
        .map(|i| (near.key(i), clipped(near.key(i), !regions.points_in(i, |region| region == 0))))
        .collect();
    check(progress)?;
    let samples = |i: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
        let (key, inside) = &signs[i];
        let origin = lattice_point(frame.depth(), *key);
        let mut found = samples_of(hits, *key, crossed, inside);
        for_crossed(crossed, |axis, local| {
            let hit = found.next_if(|f| (f.0, f.1) == (axis, local)).map(|f| f.2);
            out.push(hit.unwrap_or_else(|| {
                let at = std::array::from_fn(|a| origin[a] + local.coords()[a]);
                let [start, end] = ends(at, axis).map(|p| is_in(&outer, frame.depth(), p));
                between(&rim, at, axis, [start, end], radius, hits.edges().with_normals())
            }));
        });
    };
    let uniform = |key| regions.of_absent(key) != 0;
    SignedOctree::try_from_signs(frame.depth(), hits.edges().with_normals(), &signs, uniform, samples, progress)
}

/// The surface on which the centre of the ball rolls: what the outside does not reach as long as it keeps its distance.
fn rolled(
    hits: &OrientedHits,
    far: &ClosedBricks,
    faces: &Band,
    radius: f64,
    outer: impl Fn(Key) -> Plane + Sync,
) -> SignedOctree {
    let depth = faces.depth();
    let signs: Vec<(Key, Plane)> =
        (0..far.len()).into_par_iter().map(|i| (far.key(i), clipped(far.key(i), !outer(far.key(i))))).collect();
    let samples = |i: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
        let (key, inside) = &signs[i];
        let origin = lattice_point(depth, *key);
        let mut found = samples_of(hits, *key, crossed, inside);
        for_crossed(crossed, |axis, local| {
            let at = std::array::from_fn(|a| origin[a] + local.coords()[a]);
            let ends = ends(at, axis);
            let inner = ends[usize::from(!inside.get(local))];
            let is_near = faces.way(inner).is_some_and(|way| f64::from(way.length()) <= radius);
            // With a small radius the outside may come so near to a face that only the face stops it.
            let hit = found.next_if(|f| (f.0, f.1) == (axis, local)).map(|f| f.2).filter(|_| !is_near);
            out.push(hit.unwrap_or_else(|| Sample::new((faces.leaves(at, axis, radius).0 * 65536.0) as u16, 0)));
        });
    };
    SignedOctree::from_signs(depth, false, &signs, |key| outer(key) == Plane::EMPTY, samples)
}

/// The lattice points at the ends of an edge.
fn ends(at: [u32; 3], axis: Axis) -> [[u32; 3]; 2] {
    let mut end = at;
    end[axis.index()] += 1;
    [at, end]
}

fn is_in(points: &impl Fn(Key) -> Plane, depth: u32, at: [u32; 3]) -> bool {
    Key::cell(depth - 3, at.map(|c| c >> 3)).is_none_or(|key| points(key).get(Local::new(at[0], at[1], at[2])))
}

/// Where an edge without faces has the distance `radius` from the outside of step 1: the sample between its ends, each of which lies
/// in that outside or not.
fn between(rim: &Band, at: [u32; 3], axis: Axis, is_outer: [bool; 2], radius: f64, with_normals: bool) -> Sample {
    let points = ends(at, axis);
    let [from, to] = [0, 1].map(|i| {
        let sign = if is_outer[i] { -1.0 } else { 1.0 };
        rim.way(points[i]).map(|way| (sign * f64::from(way.length()), -sign as f32 * way.normalize_or_zero()))
    });
    let (Some((from, a)), Some((to, b))) = (from, to) else {
        return sample(0.5, axis, Vec3::AXES[axis.index()], with_normals);
    };
    let t = ((radius - from) / (to - from)).clamp(0.0, 1.0);
    sample(if t.is_finite() { t } else { 0.5 }, axis, a.lerp(b, t as f32), with_normals)
}

/// The crossed edges of a brick that have hits, in order, and the sample of each.
fn samples_of(
    hits: &OrientedHits,
    key: Key,
    crossed: &[Plane; 3],
    inside: &Plane,
) -> Peekable<impl Iterator<Item = (Axis, Local, Sample)> + use<>> {
    let mut found = Vec::new();
    if let Some(i) = hits.edges().find(key) {
        hits.for_edges(&hits.edges().bricks()[i], |axis, local, hits| {
            if crossed[axis.index()].get(local) {
                found.push((axis, local, outermost(hits, inside.get(local))));
            }
        });
    }
    found.into_iter().peekable()
}

/// Bytes for each brick of walls and of their regions.
const WALL_BYTES: usize = ClosedBricks::BYTES + size_of::<Plane>() + REGION_BYTES;

/// Edges that are closed because a face hits them, or because just one of their ends lies in a set. All bricks of the hits and of some bands
/// are listed; elsewhere the set must be uniform. What is beside the root is in it.
fn walls(hits: &OrientedHits, bands: &[&Band], set: impl Fn(Key) -> Plane + Sync) -> ClosedBricks {
    let edges = hits.edges();
    let mut keys: Vec<Key> = edges.bricks().iter().map(|b| b.key).collect();
    bands.iter().for_each(|band| keys.extend(band.keys()));
    keys.par_sort_unstable();
    keys.dedup();
    let sets: Vec<Plane> = keys.par_iter().map(|&key| set(key)).collect();
    ClosedBricks::new(edges.depth(), keys, |key, places| {
        let set = |key| places.get(key).map_or_else(|| set(key), |&i| sets[i as usize]);
        let (here, hit) = (set(key), edges.find(key).map_or([Plane::EMPTY; 3], |i| edges.bricks()[i].crossed));
        Axis::ALL.map(|axis| {
            let next = key.neighbour(Face::new(axis, true)).map_or(Plane::FULL, &set);
            hit[axis.index()] | (here ^ here.at_plus(axis, &next))
        })
    })
}
