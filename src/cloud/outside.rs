//! What infinity reaches without coming between points: on which side of each point that is.
//!
//! The points, on a lattice, are dilated until they are a wall without gaps; [`Regions`] are what is left between walls. From each point,
//! the way along its normal and the way against it lead out of the wall into a region, soon or later. The outer region is outside. A wall
//! that it touches has its points turned to it; other regions beside that wall are inside; walls within those are turned away from them,
//! since there is a cavity behind; and so on inward.

use crate::error::Result;
use crate::geom::{Bounds, Frame};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Face, Key};
use crate::octree::point_set::PointSet;
use crate::octree::regions::{ClosedBricks, Regions};
use crate::progress::{Progress, check};
use glam::DVec3;
use hashbrown::HashMap;
use rayon::prelude::*;

/// Steps of dilation. A wall is as thick as five cells then; a hole is closed if the nearest point is at most [`CLOSES`] cells away
/// everywhere in it.
const STEPS: usize = 2;
/// See [`STEPS`]: two cells less half of one, since points are rounded to the lattice.
const CLOSES: f64 = 1.5;
/// Ways out of walls are looked for up to so many cells, in halves: farther on, a way leads through the body and out on its other side.
const REACH: u32 = 5;

/// The dilated points as closed edges: those with one end in the set.
fn wall(depth: u32, set: &PointSet) -> ClosedBricks {
    // Edges belong to the brick they start in: also to those below the set.
    let below = |key: Key| Axis::ALL.map(|axis| key.neighbour(Face::new(axis, false)));
    let mut keys: Vec<Key> = set.keys();
    keys.extend(set.keys().into_iter().flat_map(below).flatten());
    keys.par_sort_unstable();
    keys.dedup();
    ClosedBricks::new(depth, keys, |key, _| {
        let here = set.plane(key);
        Axis::ALL.map(|axis| {
            let next = key.neighbour(Face::new(axis, true)).map_or(Plane::EMPTY, |next| set.plane(next));
            here ^ here.at_plus(axis, &next)
        })
    })
}

/// A way out of a wall: the region it leads to and how far that is, in half cells.
type Exit = Option<(u32, u32)>;

/// For each point how surely its normal points outward, from -1 to 1: 1 where only the way along it leads to the outside, less where both
/// do but one is shorter, 0 where neither does. `gap` is the width up to which gaps between points are closed.
///
/// # Errors
/// `Cancelled`, and when the points lie where no grid can be.
pub(super) fn votes(points: &[DVec3], normals: &[DVec3], gap: f64, progress: &dyn Progress) -> Result<Vec<f64>> {
    let mut bounds = Bounds::EMPTY;
    points.iter().for_each(|&p| bounds.add(p));
    if bounds.is_empty() || !(gap > 0.0 && bounds.extent().max_element() > 0.0) {
        return Ok(vec![0.0; points.len()]);
    }
    // Walls keep clear of the root's sides. No more cells than the finest octree has.
    let least = bounds.extent().max_element() / f64::from(1 << 17);
    let cell = (0.5 * gap / CLOSES).max(least);
    let bounds = Bounds { min: bounds.min - 8.0 * cell, max: bounds.max + 8.0 * cell };
    let frame = Frame::fit_cells(&bounds, cell, 0.99)?;
    let depth = frame.depth();
    let on_lattice = |p: DVec3| ((p - frame.origin()) / cell + 0.5).to_array().map(|c| c as u32);
    let mut codes: Vec<(Key, Local)> = points
        .par_iter()
        .filter_map(|&p| {
            let [x, y, z] = on_lattice(p);
            Some((Key::cell(depth - 3, [x >> 3, y >> 3, z >> 3])?, Local::new(x, y, z)))
        })
        .collect();
    codes.par_sort_unstable();
    let mut planes: Vec<(Key, Plane)> = Vec::new();
    for (key, local) in codes {
        if planes.last().is_none_or(|last| last.0 != key) {
            planes.push((key, Plane::EMPTY));
        }
        planes.last_mut().expect("just made").1.set(local);
    }
    let mut set = PointSet::new(depth, planes);
    for _ in 0..STEPS {
        check(progress)?;
        set = set.dilated();
    }
    progress.hold((set.bytes() + set.bricks() * size_of::<(Key, [Plane; 3])>()) as u64)?;
    let wall = wall(depth, &set);
    check(progress)?;
    let regions = Regions::new(&wall);
    let exit = |p: DVec3, way: DVec3| -> Exit {
        (1..=2 * REACH).find_map(|step| {
            let at = on_lattice(p + 0.5 * f64::from(step) * cell * way);
            (!set.contains(at)).then(|| (regions.of_point(at), step))
        })
    };
    let seen: Vec<(u32, [Exit; 2])> = points
        .par_iter()
        .zip(normals)
        .with_min_len(256)
        .map(|(&p, &n)| {
            (regions.of_point(on_lattice(p)), if n == DVec3::ZERO { [None; 2] } else { [exit(p, n), exit(p, -n)] })
        })
        .collect();
    let walls = reached(&seen, regions.count());
    let vote = |(wall, exits): &(u32, [Exit; 2])| {
        let Some(&(region, is_outside)) = walls.get(wall) else { return 0.0 };
        let way = |exit: Exit| exit.filter(|exit| exit.0 == region).map(|exit| exit.1);
        let toward = match (way(exits[0]), way(exits[1])) {
            (Some(_), None) => 1.0,
            (None, Some(_)) => -1.0,
            // Thin: out on both sides, and the nearer side is the own one.
            (Some(a), Some(b)) => (f64::from(b) - f64::from(a)) / f64::from(4 * REACH),
            (None, None) => 0.0,
        };
        if is_outside { toward } else { -toward }
    };
    Ok(seen.iter().map(vote).collect())
}

/// From which region each wall is reached first, going inward from the outer one, and whether that is outside. Which walls and regions
/// touch is told by the points.
fn reached(seen: &[(u32, [Exit; 2])], regions: u32) -> HashMap<u32, (u32, bool), ahash::RandomState> {
    let mut touching: Vec<(u32, u32)> =
        seen.iter().flat_map(|(wall, exits)| exits.iter().flatten().map(|exit| (exit.0, *wall))).collect();
    touching.par_sort_unstable();
    touching.dedup();
    let mut back: Vec<(u32, u32)> = touching.iter().map(|&(region, wall)| (wall, region)).collect();
    back.par_sort_unstable();
    let of = |list: &[(u32, u32)], key: u32| -> Vec<u32> {
        let (first, end) = (list.partition_point(|e| e.0 < key), list.partition_point(|e| e.0 <= key));
        list[first..end].iter().map(|e| e.1).collect()
    };
    let mut walls = HashMap::with_hasher(ahash::RandomState::with_seeds(1, 2, 3, 4));
    let mut known = vec![false; regions as usize];
    known[0] = true;
    let mut queue = std::collections::VecDeque::from([(0, true)]);
    while let Some((region, is_outside)) = queue.pop_front() {
        for wall in of(&touching, region) {
            if walls.contains_key(&wall) {
                continue;
            }
            walls.insert(wall, (region, is_outside));
            for beyond in of(&back, wall) {
                if !std::mem::replace(&mut known[beyond as usize], true) {
                    queue.push_back((beyond, !is_outside));
                }
            }
        }
    }
    walls
}
