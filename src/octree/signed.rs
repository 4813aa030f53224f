//! Inside and outside at every lattice point: what repair, topology and contouring meet in.

use super::crossings::{Crossings, finest_element, position};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Extent, Key};
use crate::parallel::pieces;
use rayon::prelude::*;

/// Crossed edges together with the signs of the lattice points.
///
/// Signs are stored for the points of bricks; everywhere else they are uniform up to the next brick and follow from it.
#[derive(Debug, Clone)]
pub struct SignedOctree {
    crossings: Crossings,
    /// For each brick, the points that are inside.
    inside: Vec<Plane>,
}

impl SignedOctree {
    /// Puts crossings and signs together; `inside` has one plane a brick.
    ///
    /// # Panics
    /// When there are not as many planes as bricks.
    pub fn new(crossings: Crossings, inside: Vec<Plane>) -> Self {
        assert_eq!(crossings.bricks().len(), inside.len(), "one plane a brick");
        SignedOctree { crossings, inside }
    }

    /// The crossed edges.
    pub fn crossings(&self) -> &Crossings {
        &self.crossings
    }

    /// For each brick, its points that are inside.
    pub fn inside(&self) -> &[Plane] {
        &self.inside
    }

    /// Whether lattice point `at` (in cells, 0 ..= 2^depth) is inside. Cost: a hash probe a brick along x until one is found.
    pub fn is_inside(&self, at: [u32; 3]) -> bool {
        let [x, y, z] = at;
        let local = Local::new(x, y, z);
        for bx in (0..=x >> 3).rev() {
            let found =
                Key::cell(self.crossings.depth() - 3, [bx, y >> 3, z >> 3]).and_then(|key| self.crossings.find(key));
            if let Some(i) = found {
                let end = Local::new(7, y, z);
                return if bx == x >> 3 {
                    self.inside[i].get(local)
                } else {
                    self.inside[i].get(end) ^ self.crossings.bricks()[i].crossed[0].get(end)
                };
            }
        }
        false
    }

    /// Volume enclosed, in cells: the length of all x-lines of the grid that is inside. Cost: some 2 ns a crossed x-edge.
    pub fn volume(&self) -> f64 {
        // Sums of fixed chunks in a fixed order: the same for any number of threads.
        let (count, piece) = pieces(self.inside.len(), 256);
        let sums: Vec<f64> = (0..count).into_par_iter().map(|n| piece(n).map(|i| self.volume_of(i)).sum()).collect();
        sums.iter().sum()
    }

    /// Where lines leave the inside counts positive, where they enter it, negative.
    fn volume_of(&self, i: usize) -> f64 {
        let (brick, inside) = (&self.crossings.bricks()[i], &self.inside[i]);
        let from = f64::from(self.crossings.origin(brick)[0]);
        let first = brick.first as usize;
        let offsets = self.crossings.offsets().range(first..first + brick.crossed[0].count() as usize);
        let ends = brick.crossed[0].iter().zip(offsets).map(|(p, &offset)| {
            let x = from + f64::from(p.coords()[0]) + position(offset);
            if inside.get(p) { x } else { -x }
        });
        ends.sum()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.crossings.bytes() + self.inside.capacity() * size_of::<Plane>()
    }

    /// The first finest edge whose ends have the same sign although it is crossed, or different ones although it is not.
    ///
    /// # Errors
    /// Names the edge, or the broken invariant of the crossings.
    pub fn validate(&self) -> Result<(), String> {
        self.crossings.validate()?;
        for (i, brick) in self.crossings.bricks().iter().enumerate() {
            let origin = self.crossings.origin(brick);
            for p in (0..512).map(Local::from_index) {
                let c = p.coords();
                let at: [u32; 3] = std::array::from_fn(|a| origin[a] + c[a]);
                for axis in Axis::ALL {
                    let mut end = at;
                    end[axis.index()] += 1;
                    let changes = self.inside[i].get(p) != self.is_inside(end);
                    if changes != brick.crossed[axis.index()].get(p) {
                        let edge = finest_element(self.crossings.depth(), at, Extent::from(axis));
                        return Err(format!("edge {edge} has crossings and signs that disagree"));
                    }
                }
            }
        }
        Ok(())
    }
}
