//! Which way normals point: as what infinity reaches says, and as neighbours say where that says nothing.
//!
//! Orientation is passed on from those points whose outer side is known for sure, along the graph of nearest points, always over the surest
//! link (Hoppe et al. 1992 with their minimal spanning tree). Two points on an arc of a circle have normals that mirror each other in the
//! plane between the points; so it is the mirrored normal that is compared, and not the normal itself: that is right at sharp edges, and
//! across thin walls, where normals of neighbours are at right angles or opposite.

use super::{NONE, outside};
use crate::error::Result;
use crate::progress::{Progress, check};
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Votes from here on are not overruled by neighbours.
const SURE: f64 = 0.999;

/// Part of the points seen at best that are nearly as many.
const ENOUGH: f64 = 0.8;

/// A link to a point that is not oriented yet. Greater is surer; of equals, the lower numbers.
#[derive(Debug, PartialEq)]
struct Link {
    sureness: f64,
    from: u32,
    to: u32,
}

impl Eq for Link {}

impl PartialOrd for Link {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Link {
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |link: &Link| (link.to, link.from);
        self.sureness.total_cmp(&other.sureness).then_with(|| key(other).cmp(&key(self)))
    }
}

/// Normals turned outward, and how many of them as infinity sees them. Too narrow a gap lets infinity in, and hardly any point is seen for
/// sure; too wide a one closes what is open. So of several gaps, from narrow to wide, the first one is taken with which nearly as many are
/// seen as with any. `nearest` lists `count` neighbours a point.
///
/// # Errors
/// `Cancelled`.
pub(super) fn oriented(
    points: &[DVec3],
    mut normals: Vec<DVec3>,
    nearest: &[u32],
    count: usize,
    gaps: &[f64],
    progress: &dyn Progress,
) -> Result<(Vec<DVec3>, usize)> {
    let mut tried = Vec::with_capacity(gaps.len());
    for &gap in gaps {
        check(progress)?;
        let votes = outside::votes(points, &normals, gap, progress)?;
        let sure = votes.iter().filter(|vote| vote.abs() >= SURE).count();
        tried.push((sure, votes));
    }
    let most = tried.iter().map(|tried| tried.0).max().unwrap_or(0);
    let enough = tried.into_iter().find(|tried| tried.0 as f64 >= ENOUGH * most as f64);
    let votes = enough.map_or_else(|| vec![0.0; points.len()], |tried| tried.1);
    let mut known = vec![false; points.len()];
    let mut seen = 0;
    for ((normal, known), vote) in normals.iter_mut().zip(&mut known).zip(&votes) {
        if vote.abs() >= SURE {
            *normal *= vote.signum();
            *known = true;
            seen += 1;
        }
    }
    let of = |i: u32| nearest[count * i as usize..][..count].iter().copied().take_while(|&j| j != NONE);
    let mut heap = BinaryHeap::new();
    let link = |normals: &[DVec3], from: u32, to: u32| {
        let sureness = mirrored(points, normals, from, to).dot(normals[to as usize]).abs();
        Link { sureness, from, to }
    };
    for i in (0u32..).take(points.len()).filter(|&i| known[i as usize]) {
        heap.extend(of(i).filter(|&j| !known[j as usize]).map(|j| link(&normals, i, j)));
    }
    // Parts without any known point begin at their surest, or else their highest.
    let mut starts: Vec<u32> = (0u32..).take(points.len()).filter(|&i| !known[i as usize]).collect();
    starts.sort_by(|&a, &b| {
        let [p, q] = [a, b].map(|i| points[i as usize].z);
        votes[b as usize].abs().total_cmp(&votes[a as usize].abs()).then(q.total_cmp(&p)).then(a.cmp(&b))
    });
    let mut starts = starts.into_iter();
    loop {
        let mut steps = 0u32;
        while let Some(Link { from, to, .. }) = heap.pop() {
            steps = steps.wrapping_add(1);
            if steps.is_multiple_of(65536) {
                check(progress)?;
            }
            if known[to as usize] {
                continue;
            }
            if mirrored(points, &normals, from, to).dot(normals[to as usize]) < 0.0 {
                normals[to as usize] *= -1.0;
            }
            known[to as usize] = true;
            heap.extend(of(to).filter(|&j| !known[j as usize]).map(|j| link(&normals, to, j)));
        }
        let Some(start) = starts.find(|&i| !known[i as usize]) else { break };
        // Some point that is known may not be among the nearest of others, but have them among its own.
        if let Some(link) = of(start).filter(|&j| known[j as usize]).map(|j| link(&normals, j, start)).max() {
            heap.push(link);
            continue;
        }
        let vote = votes[start as usize];
        let outward = if vote == 0.0 { normals[start as usize].z } else { vote };
        if outward < 0.0 {
            normals[start as usize] *= -1.0;
        }
        known[start as usize] = true;
        heap.extend(of(start).filter(|&j| !known[j as usize]).map(|j| link(&normals, start, j)));
    }
    Ok((normals, seen))
}

/// The normal of `from` in the mirror between both points.
fn mirrored(points: &[DVec3], normals: &[DVec3], from: u32, to: u32) -> DVec3 {
    let (way, normal) = (points[to as usize] - points[from as usize], normals[from as usize]);
    let square = way.length_squared();
    if square == 0.0 { normal } else { normal - way * (2.0 * way.dot(normal) / square) }
}
