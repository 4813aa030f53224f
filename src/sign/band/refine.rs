//! Closer points next to the closest one so far.
//!
//! Neighbours pass on what is best for them, and that may be a little beside what is best for a point far from the surface. But lattice points
//! at the surface have closest points of their own all over it: those round the one that a point has are tried, and again round
//! the best of them, until none is closer.

use super::{BEYOND, Band, Field, NEAR, UNIT, square};
use crate::error::Result;
use crate::grid::Key;
use crate::grid::brick::Local;
use crate::octree::crossings::lattice_point;
use crate::progress::{Progress, check};
use rayon::prelude::*;

/// Points of a brick by their index, and shorter ways for them.
type Found = Vec<(u16, [i16; 3])>;

/// A position in 512ths of a cell.
type Place = [i32; 3];

impl Band {
    /// Refines the ways of all points at least so far from the surface, in cells.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(super) fn refine(&mut self, from: f64, progress: &dyn Progress) -> Result<()> {
        let least = (from.max(NEAR) * f64::from(UNIT)).powi(2) as u32;
        let found: Result<Vec<Found>> = (0..self.bricks.len())
            .into_par_iter()
            .map(|n| {
                check(progress)?;
                let (key, field) = &self.bricks[n];
                let origin = lattice_point(self.depth, *key);
                let far = (0..512).filter(|&i| field.0[0][i] != BEYOND && square(field.way(i)) >= least);
                let mut search = Search { band: self, last: (*key, Some(field)) };
                let closer = |i: usize| search.closer(origin, i as u16, field.way(i)).map(|way| (i as u16, way));
                Ok(far.filter_map(closer).collect())
            })
            .collect();
        for ((_, field), found) in self.bricks.iter_mut().zip(found?) {
            for (i, way) in found {
                field.offer(usize::from(i), way);
            }
        }
        Ok(())
    }
}

/// Looks up ways, and remembers the brick of the last one.
struct Search<'a> {
    band: &'a Band,
    last: (Key, Option<&'a Field>),
}

impl Search<'_> {
    /// A shorter way from position `i` of the brick at `origin`, if one is found.
    fn closer(&mut self, origin: [u32; 3], i: u16, way: [i16; 3]) -> Option<[i16; 3]> {
        let local = Local::from_index(u32::from(i)).coords();
        let from: Place = std::array::from_fn(|a| ((origin[a] + local[a]) as i32) * UNIT as i32);
        let (mut best, mut length) = (way, square(way));
        loop {
            let about: Place = std::array::from_fn(|a| (from[a] + i32::from(best[a]) + UNIT as i32 / 2) / UNIT as i32);
            let before = length;
            for step in 0..27 {
                let at = [about[0] + step / 9 - 1, about[1] + step / 3 % 3 - 1, about[2] + step % 3 - 1];
                let Some(place) = self.closest(at) else { continue };
                let way: Place = std::array::from_fn(|a| place[a] - from[a]);
                // Others may lie far away, but then they are of no use.
                if way.iter().any(|w| w.abs() >= i32::from(BEYOND)) {
                    continue;
                }
                let way = way.map(|w| w as i16);
                if square(way) < length {
                    (best, length) = (way, square(way));
                }
            }
            if length == before {
                return (best != way).then_some(best);
            }
        }
    }

    /// The closest point of a lattice point.
    fn closest(&mut self, at: Place) -> Option<Place> {
        let at = at.map(|c| c as u32);
        let key = Key::cell(self.band.depth - 3, at.map(|c| c >> 3))?;
        if key != self.last.0 {
            let field = self.band.index.get(key).map(|&i| &*self.band.bricks[i as usize].1);
            self.last = (key, field);
        }
        let way = self.last.1?.way(Local::new(at[0], at[1], at[2]).index() as usize);
        (way[0] != BEYOND).then(|| std::array::from_fn(|a| at[a] as i32 * UNIT as i32 + i32::from(way[a])))
    }
}
