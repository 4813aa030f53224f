//! Inside and outside at every lattice point: what repair, topology and contouring meet in.

use super::cells::Cells;
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

    /// The cells of brick `i` with corners of both signs.
    ///
    /// # Panics
    /// When there is no brick `i`.
    pub fn mixed_cells(&self, i: usize) -> Plane {
        Cells::new(self, i).mixed()
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

    /// Volume enclosed, in cells: the length of all lines of the grid along one axis that is inside. The axis is the one with most crossings:
    /// thin walls lie across it, and their thickness is measured instead of the lattice planes between their sides. An estimate: what
    /// lies along the lines is only known to a cell. Cost: some 2 ns a crossing along that axis, less for the others.
    pub fn volume(&self) -> f64 {
        let bricks = self.crossings.bricks();
        let crossed = |a: Axis| {
            (0..bricks.len()).into_par_iter().map(|i| u64::from(bricks[i].crossed[a.index()].count())).sum::<u64>()
        };
        let axis = Axis::ALL.into_iter().max_by_key(|&a| crossed(a)).expect("three axes");
        // Sums of fixed chunks in a fixed order: the same for any number of threads.
        let (count, piece) = pieces(self.inside.len(), 256);
        let lengths = |n| piece(n).map(|i| self.length_inside(i, axis)).sum();
        let sums: Vec<f64> = (0..count).into_par_iter().map(lengths).collect();
        sums.iter().sum()
    }

    /// Where lines along `axis` leave the inside in brick `i` counts positive, where they enter it, negative.
    fn length_inside(&self, i: usize, axis: Axis) -> f64 {
        let (brick, inside) = (&self.crossings.bricks()[i], &self.inside[i]);
        let a = axis.index();
        let from = f64::from(self.crossings.origin(brick)[a]);
        let first = (brick.first + brick.crossed[..a].iter().map(Plane::count).sum::<u32>()) as usize;
        let offsets = self.crossings.offsets().range(first..first + brick.crossed[a].count() as usize);
        let ends = brick.crossed[a].iter().zip(offsets).map(|(p, &offset)| {
            let w = from + f64::from(p.coords()[a]) + position(offset);
            if inside.get(p) { w } else { -w }
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
