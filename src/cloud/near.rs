//! Which points are near: of each point of a cloud, or of any place.
//!
//! The points lie in the leaves of a [`LinearOctree`], a few in each, in the order of the curve. Places that follow each other are mostly
//! near each other, so what is near is gathered for a whole cell at a time: one search of the tree answers for all points or places in it.
//!
//! Cost: 8 bytes a point beside the tree. Some 2 us a point for its sixteen nearest.

use super::Cloud;
use crate::error::{Error, Result};
use crate::geom::Bounds;
use crate::grid::Key;
use crate::grid::key::SIDE;
use crate::octree::LinearOctree;
use crate::progress::{Progress, check};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Most points of a leaf.
const MOST: usize = 12;

/// More points than these in one cell of the lattice are refused where all of them are searched for.
const CROWD: usize = 4096;

/// Part of the points on each side, along each axis, that may be far off.
const FAR_OFF: f64 = 0.01;

/// The number of a point that there is not.
pub const NONE: u32 = u32::MAX;

/// The points of a cloud by place. Numbers are those of the cloud that [`sorted`](Near::sorted) returned.
#[derive(Debug, Clone)]
pub struct Near {
    points: Vec<DVec3>,
    /// The points of each leaf.
    tree: LinearOctree<Range<u32>>,
    origin: DVec3,
    /// Lattice units in a model unit.
    scale: f64,
}

impl Near {
    /// Puts the points of a cloud into the order of the curve, and finds them there. The lattice lies over most of the points; the few that are far off
    /// do not make it coarse.
    ///
    /// # Panics
    /// If there are 2^32 points or more, or one is not finite.
    pub fn sorted(cloud: &Cloud) -> (Cloud, Near) {
        let (centre, size) = most_of(&cloud.points);
        let (origin, scale) = (centre - 0.5 * size, f64::from(SIDE) / size);
        // Those beyond lie in the outermost cells.
        let on_lattice = |p: &DVec3| ((*p - origin) * scale).to_array().map(|c| (c as u32).min(SIDE));
        let places: Vec<[u32; 3]> = cloud.points.par_iter().map(on_lattice).collect();
        let (tree, order) = LinearOctree::of_points(&places, MOST, crate::grid::key::MAX_LEVEL);
        assert_eq!(order.len(), cloud.points.len(), "all points are finite");
        let points: Vec<DVec3> = order.iter().map(|&i| cloud.points[i as usize]).collect();
        let normals =
            if cloud.has_normals() { order.iter().map(|&i| cloud.normals[i as usize]).collect() } else { Vec::new() };
        (Cloud { points: points.clone(), normals }, Near { points, tree, origin, scale })
    }

    /// The points, in their order.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// The most points that no search can tell apart by place: 12, unless many are so near to each other, beside the extent of most of the cloud, that
    /// the lattice has one cell for them. Searches look at all of them.
    pub fn crowd(&self) -> usize {
        self.tree.iter().map(|(_, range)| range.len()).max().unwrap_or(0)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.tree.allocated_bytes() + self.points.capacity() * size_of::<DVec3>()
    }

    /// The ranges of points that lie in leaves which meet a box, in order; all points of the box are among them.
    pub fn in_box(&self, bounds: &Bounds) -> impl Iterator<Item = Range<u32>> + '_ {
        let clamped = |p: DVec3| ((p - self.origin) * self.scale).clamp(DVec3::ZERO, DVec3::splat(f64::from(SIDE)));
        let (min, max) = (clamped(bounds.min), clamped(bounds.max));
        let low = min.to_array().map(|c| (c as u32).saturating_sub(1));
        let high = max.to_array().map(|c| (c as u32 + 1).min(SIDE));
        self.tree.leaves_in_box(low, high).map(|(_, range)| range.clone()).filter(|range| !range.is_empty())
    }

    /// Calls `each` with the points that are at most `radius` from a place, in order, and the squares of their distances.
    pub fn within(&self, place: DVec3, radius: f64, mut each: impl FnMut(u32, f64)) {
        let bounds = Bounds { min: place - radius, max: place + radius };
        for i in self.in_box(&bounds).flatten() {
            let square = self.points[i as usize].distance_squared(place);
            if square <= radius * radius {
                each(i, square);
            }
        }
    }

    /// Refuses clouds in which searches would take for ever.
    ///
    /// # Errors
    /// When too many points lie in one place, beside the extent of the cloud.
    pub(super) fn check(&self) -> Result<()> {
        let crowd = self.crowd();
        if crowd <= CROWD {
            return Ok(());
        }
        let problem = format!("{crowd} points lie within a 150,000th of the extent of the cloud");
        Err(Error::setting("input", problem, "leave out points that are far off, or some of those that lie so near"))
    }

    /// For each point, the `count` others that are nearest to it, nearest first, of equal ones the lower number first: `count` numbers a
    /// point, [`NONE`] where there are not as many points. On all threads.
    ///
    /// # Errors
    /// `Cancelled`.
    ///
    /// # Panics
    /// When `count` is 0.
    pub fn nearest(&self, count: usize, progress: &dyn Progress) -> Result<Vec<u32>> {
        let leaves: Vec<(Key, Range<u32>)> = self
            .tree
            .iter_z()
            .map(|(leaf, range)| (leaf, range.clone()))
            .filter(|(_, range)| !range.is_empty())
            .collect();
        let mut found = vec![NONE; count * self.points.len()];
        let mut rest = &mut found[..];
        let mut jobs = Vec::with_capacity(leaves.len());
        for (leaf, range) in leaves {
            let (own, after) = rest.split_at_mut(count * range.len());
            rest = after;
            jobs.push((leaf, range, own));
        }
        jobs.into_par_iter().with_min_len(16).for_each_init(Vec::new, |scratch, (leaf, range, found)| {
            if !progress.is_cancelled() {
                self.nearest_of_leaf(leaf, range, count, found, scratch);
            }
        });
        check(progress).map(|()| found)
    }

    /// Those of the points of a leaf.
    fn nearest_of_leaf(
        &self,
        leaf: Key,
        range: Range<u32>,
        count: usize,
        found: &mut [u32],
        scratch: &mut Vec<(f64, u32)>,
    ) {
        let wanted = count.min(self.points.len() - 1);
        let mut around = Bounds::EMPTY;
        self.points[range.start as usize..range.end as usize].iter().for_each(|&p| around.add(p));
        let mut radius = f64::from(leaf.size()) / self.scale;
        let mut waiting: Vec<u32> = range.clone().collect();
        let mut candidates = Vec::new();
        while !waiting.is_empty() {
            candidates.clear();
            let bounds = Bounds { min: around.min - radius, max: around.max + radius };
            candidates.extend(self.in_box(&bounds).flatten());
            let is_all = candidates.len() == self.points.len();
            waiting.retain(|&i| {
                let p = self.points[i as usize];
                scratch.clear();
                let others = candidates.iter().filter(|&&j| j != i);
                scratch.extend(others.map(|&j| (self.points[j as usize].distance_squared(p), j)));
                if scratch.len() < wanted {
                    return true;
                }
                let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
                if wanted > 0 {
                    scratch.select_nth_unstable_by(wanted - 1, order);
                    // Those beyond the radius may be farther than some that were not looked at.
                    if !is_all && scratch[wanted - 1].0 > radius * radius {
                        return true;
                    }
                    scratch[..wanted].sort_unstable_by(order);
                }
                let own = &mut found[count * (i - range.start) as usize..][..wanted];
                own.iter_mut().zip(scratch.iter()).for_each(|(slot, near)| *slot = near.1);
                false
            });
            radius *= 2.0;
        }
    }
}

/// A cube that holds most of some points, with room about them: its middle and side.
fn most_of(points: &[DVec3]) -> (DVec3, f64) {
    if points.is_empty() {
        return (DVec3::ZERO, 1.0);
    }
    let far_off = (points.len() as f64 * FAR_OFF) as usize;
    let ends = [0, 1, 2].map(|axis| {
        let mut along: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        [far_off, points.len() - 1 - far_off].map(|n| *along.select_nth_unstable_by(n, f64::total_cmp).1)
    });
    let [low, high] = [0, 1].map(|end| DVec3::from_array(ends.map(|ends| ends[end])));
    let extent = (high - low).max_element();
    // As much room on both sides as the points take.
    (low + 0.5 * (high - low), if extent > 0.0 { 3.0 * extent } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::chance::Chance;
    use crate::progress::Silent;
    use proptest::prelude::*;

    #[test]
    fn few_that_are_far_off_do_no_harm_and_crowds_are_told() {
        let mut chance = Chance(5);
        let mut place = |_: u32| DVec3::new(chance.unit(), chance.unit(), chance.unit());
        let mut points: Vec<DVec3> = (0..6000).map(&mut place).collect();
        points.push(DVec3::splat(1e9));
        let (_, near) = Near::sorted(&Cloud { points: points.clone(), normals: Vec::new() });
        assert!(near.crowd() <= MOST && near.check().is_ok());
        let mut found = Vec::new();
        near.within(DVec3::splat(1e9), 1.0, |i, _| found.push(i));
        assert_eq!(found.len(), 1);
        points.extend((0..6000).map(|i| DVec3::splat(1e9 + f64::from(i))));
        let (_, near) = Near::sorted(&Cloud { points, normals: Vec::new() });
        assert!(near.check().expect_err("two crowds").to_string().contains("points lie within a 150,000th"));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn neighbours_are_those_of_a_look_at_all(points in prop::collection::vec([-9..9i32, -9..9i32, -2..2i32], 1..80), count in 1..20usize) {
            // Many coincide, and many are equally far.
            let cloud = Cloud { points: points.iter().map(|p| DVec3::from_array(p.map(f64::from)) * 0.3).collect(), normals: Vec::new() };
            let (cloud, near) = Near::sorted(&cloud);
            let found = near.nearest(count, &Silent).expect("not cancelled");
            for (i, &p) in cloud.points.iter().enumerate() {
                let mut all: Vec<(f64, u32)> =
                    cloud.points.iter().zip(0..).filter(|&(_, j)| j != i as u32).map(|(q, j)| (q.distance_squared(p), j)).collect();
                all.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
                let mut expected: Vec<u32> = all.iter().take(count).map(|a| a.1).collect();
                expected.resize(count, NONE);
                prop_assert_eq!(&found[count * i..][..count], &expected[..]);
                let mut within = Vec::new();
                near.within(p + 0.1, 1.0, |j, _| within.push(j));
                let expected = (0u32..).zip(&cloud.points).filter(|(_, q)| q.distance_squared(p + 0.1) <= 1.0).map(|(j, _)| j);
                prop_assert!(within.into_iter().eq(expected));
            }
        }
    }
}
