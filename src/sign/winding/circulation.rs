//! Where the boundary of the oriented surface is.
//!
//! The winding number of a closed, consistently oriented surface is a whole number off the surface, and jumps by one where a hit is. So
//! the jumps along the four edges of a grid face, walked round, add up to 0. Where they do not, the boundary of the surface passes
//! through the face: the rim of a hole, or a seam between faces that are turned opposite ways. This is the oriented counterpart of
//! [`Crossings::odd_faces`](crate::octree::Crossings::odd_faces); a face is odd just if its circulation is.
//!
//! Round every cell circulations add up to 0 (they are a curl), so the boundary consists of closed walks over cells.
//!
//! Cost: a brick whose hits are all turned one way along each axis takes some forty operations on words a face direction, as for odd faces.
//! Others are counted bit by bit, some 1 us each.

use super::net::Net;
use crate::error::Result;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Extent, Key};
use crate::octree::crossings::{Crossings, finest_element};
use crate::octree::hits::OrientedHits;
use crate::progress::{Progress, check};
use rayon::prelude::*;

/// A grid face through which the surface's boundary passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Circulation {
    /// The face, of the finest grid.
    pub face: Key,
    /// Jumps round the face, counter-clockwise as seen from the face's positive side. Never 0; odd for a rim, mostly 2 or -2 for a seam.
    pub strength: i32,
}

/// Bricks between two looks whether it was cancelled.
const AT_ONCE: usize = 1 << 15;

/// All finest faces with a circulation, sorted.
///
/// # Errors
/// `Cancelled`.
pub fn circulations(hits: &OrientedHits, progress: &dyn Progress) -> Result<Vec<Circulation>> {
    let count = hits.edges().bricks().len();
    let mut found = Vec::new();
    for first in (0..count).step_by(AT_ONCE) {
        check(progress)?;
        found.par_extend((first..count.min(first + AT_ONCE)).into_par_iter().flat_map_iter(|i| of_brick(hits, i)));
    }
    found.par_sort_unstable();
    Ok(found)
}

/// Those of the faces that start in a brick.
fn of_brick(hits: &OrientedHits, i: usize) -> Vec<Circulation> {
    let edges = hits.edges();
    let brick = &edges.bricks()[i];
    let places = edges.plus_places(brick);
    let turns = places.iter().flatten().fold(hits.turns(i), |turns, &place| turns.and(hits.turns(place)));
    let mut found = Vec::new();
    if turns.are_uniform() {
        let plus = edges.plus(brick);
        let suspects = Axis::ALL.map(|axis| {
            let [u, v] = axis.others();
            let (a, b) = (brick.crossed[u.index()], brick.crossed[v.index()]);
            let a_beyond = shifted(&a, v, &plus[v.index()].crossed[u.index()]);
            let b_beyond = shifted(&b, u, &plus[u.index()].crossed[v.index()]);
            // Along each axis all jumps are equal: opposite edges cancel if both are hit or none; if each pair has one hit edge, it
            // depends on which ones.
            let (da, db) = (a ^ a_beyond, b ^ b_beyond);
            let same = a ^ b ^ if turns.leave(u) == turns.leave(v) { Plane::EMPTY } else { Plane::FULL };
            (da ^ db) | (da & db & same)
        });
        if suspects.iter().all(Plane::is_empty) {
            return found;
        }
        let nets = nets(hits, i);
        push_faces(edges, i, &nets, &suspects, &mut found);
    } else {
        let nets = nets(hits, i);
        let suspects = Axis::ALL.map(|axis| unbalanced(&nets, axis));
        push_faces(edges, i, &nets, &suspects, &mut found);
    }
    found
}

/// The net jumps of a brick and of those at +x, +y, +z.
fn nets(hits: &OrientedHits, i: usize) -> [Net; 4] {
    let edges = hits.edges();
    let brick = &edges.bricks()[i];
    let [x, y, z] =
        edges.plus_places(brick).map(|p| p.map_or_else(Net::default, |p| Net::of(hits, &edges.bricks()[p])));
    [Net::of(hits, brick), x, y, z]
}

/// The plane one step along `axis`.
fn shifted(plane: &Plane, axis: Axis, next: &Plane) -> Plane {
    match axis {
        Axis::X => plane.at_plus_x(next),
        Axis::Y => plane.at_plus_y(next),
        Axis::Z => plane.at_plus_z(next),
    }
}

/// The faces across `axis` round which jumps up and down are not equally many, or an edge is steep.
fn unbalanced(nets: &[Net; 4], axis: Axis) -> Plane {
    let [u, v] = axis.others();
    let beyond = |of: fn(&Net) -> &[Plane; 3], along: Axis, step: Axis| {
        shifted(&of(&nets[0])[along.index()], step, &of(&nets[1 + step.index()])[along.index()])
    };
    let rises: fn(&Net) -> &[Plane; 3] = |net| &net.rises;
    let falls: fn(&Net) -> &[Plane; 3] = |net| &net.falls;
    let own = &nets[0];
    let up = [own.rises[u.index()], beyond(rises, v, u), beyond(falls, u, v), own.falls[v.index()]];
    let down = [own.falls[u.index()], beyond(falls, v, u), beyond(rises, u, v), own.rises[v.index()]];
    let (up, down) = (count(up), count(down));
    let differ = (0..3).fold(Plane::EMPTY, |differ, bit| differ | (up[bit] ^ down[bit]));
    // Steep edges are few, and belong to several bricks: look at all faces then.
    if nets.iter().all(|net| net.steep.is_empty()) { differ } else { Plane::FULL }
}

/// How many of four planes have each bit, as three bits.
fn count([a, b, c, d]: [Plane; 4]) -> [Plane; 3] {
    let (ab, cd) = (a ^ b, c ^ d);
    let (pair_ab, pair_cd, carry) = (a & b, c & d, ab & cd);
    [ab ^ cd, pair_ab ^ pair_cd ^ carry, pair_ab & pair_cd]
}

/// Adds the circulations of the suspects that have one.
fn push_faces(edges: &Crossings, i: usize, nets: &[Net; 4], suspects: &[Plane; 3], found: &mut Vec<Circulation>) {
    let origin = edges.origin(&edges.bricks()[i]);
    for (axis, plane) in Axis::ALL.into_iter().zip(suspects) {
        let [u, v] = axis.others();
        for local in plane.iter() {
            let beyond = |along, step: Axis| {
                let mut c = local.coords();
                c[step.index()] += 1;
                nets[if c[step.index()] == 8 { 1 + step.index() } else { 0 }].at(along, Local::new(c[0], c[1], c[2]))
            };
            let strength = nets[0].at(u, local) + beyond(v, u) - beyond(u, v) - nets[0].at(v, local);
            if strength != 0 {
                let c = local.coords();
                let at = std::array::from_fn(|a| origin[a] + c[a]);
                found.push(Circulation { face: finest_element(edges.depth(), at, Extent::CELL - axis), strength });
            }
        }
    }
}
