//! By how much the winding number jumps along each edge of a brick, all hits taken together.

use crate::grid::Axis;
use crate::grid::brick::{Local, Plane};
use crate::octree::crossings::Brick;
use crate::octree::hits::{EdgeHit, OrientedHits};

/// Net jumps along the edges of a brick. Nearly all are 0, 1 or -1.
#[derive(Debug, Clone, Default)]
pub(super) struct Net {
    /// Edges along which it rises by 1.
    pub(super) rises: [Plane; 3],
    /// Edges along which it falls by 1.
    pub(super) falls: [Plane; 3],
    /// All others along which it changes, by how much, in order of axis and position.
    pub(super) steep: Vec<(Axis, Local, i32)>,
}

impl Net {
    pub(super) fn of(hits: &OrientedHits, brick: &Brick) -> Net {
        let leaving = hits.leaving(brick);
        let mut net =
            Net { rises: std::array::from_fn(|a| brick.crossed[a] ^ leaving[a]), falls: leaving, steep: Vec::new() };
        for (axis, local, of_edge) in hits.several_in(brick) {
            let a = axis.index();
            let sum: i32 = of_edge.iter().copied().map(EdgeHit::jump).sum();
            for (plane, jump) in [(&mut net.rises[a], 1), (&mut net.falls[a], -1)] {
                if plane.get(local) != (sum == jump) {
                    plane.toggle(local);
                }
            }
            if sum.abs() > 1 {
                net.steep.push((axis, local, sum));
            }
        }
        net
    }

    /// The jump along one edge.
    pub(super) fn at(&self, axis: Axis, local: Local) -> i32 {
        let a = axis.index();
        match (self.rises[a].get(local), self.falls[a].get(local)) {
            (true, _) => 1,
            (_, true) => -1,
            _ => self.steep.iter().find(|&&(x, l, _)| (x, l) == (axis, local)).map_or(0, |&(.., jump)| jump),
        }
    }
}
