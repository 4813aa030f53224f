//! [`Domain`]: a box in space over the lattice of an octree, as a background grid of cells.
//!
//! The box is divided into `I x J x K` BACKGROUND CELLS, its cells of level 0, which need not be cubes. The grid lies at the low corner of
//! the root cube of a [`LinearOctree`](crate::octree::LinearOctree), whose own level `b` is the first with room for it, `2^b >= max(I, J, K)`; a cell of level `l` of
//! the domain is a cell of level `b + l` of the root, and 18 - b levels remain. What of the root lies beyond the grid has no leaves.
//!
//! Lattice points are the truth: a coordinate in space belongs to the last lattice point whose own coordinate,
//! [`to_space`](Domain::to_space), is not above it. So going to space and back gives every lattice point itself, and cells found for
//! a point hold it by the same numbers by which their corners are told. Distinct lattice points have distinct coordinates: a domain
//! for which they would not be is refused.

use crate::error::{Error, Result, Short};
use crate::grid::key::{MAX_LEVEL, SIDE};
use crate::grid::{Axis, Key};
use glam::DVec3;

/// The least distance of lattice points, relative to the largest coordinate: sixteen units in the last place.
const FINEST_STEP: f64 = 16.0 * f64::EPSILON;

/// A point that does not lie in the domain.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{axis} = {value} is not in the domain, {min} to {max}")]
pub struct Outside {
    /// The first axis along which it lies outside.
    pub axis: Axis,
    /// The coordinate there; it may be no number.
    pub value: f64,
    /// The least coordinate inside.
    pub min: f64,
    /// The greatest.
    pub max: f64,
}

/// A box in space and its grid of background cells. See the [module](self).
///
/// ```
/// use zmend::geom::Domain;
/// use zmend::glam::DVec3;
/// use zmend::octree::LinearOctree;
///
/// let domain = Domain::new(DVec3::ZERO, DVec3::new(3.0, 1.0, 0.5), [3, 2, 1])?;
/// let tree: LinearOctree<()> = domain.background().map(|cell| (cell, ())).collect();
/// assert_eq!((tree.len(), domain.max_level()), (6, 16));
/// let point = domain.locate(DVec3::new(3.0, 0.6, 0.1))?; // the far boundary is inside
/// let (leaf, ()) = tree.locate(point).unwrap();
/// assert_eq!(domain.corners(leaf), (DVec3::new(2.0, 0.5, 0.0), DVec3::new(3.0, 1.0, 0.5)));
/// assert!(domain.locate(DVec3::new(3.0001, 0.0, 0.0)).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    min: DVec3,
    max: DVec3,
    cells: [u32; 3],
    /// Lattice coordinates of the far corner.
    ends: [u32; 3],
    base: u32,
}

impl Domain {
    /// A box from `min` to `max` with so many background cells along x, y, z.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] if a count is 0 or above 2^18, the box is empty or not finite, or so far from the origin that its lattice
    /// points have no coordinates of their own.
    pub fn new(min: DVec3, max: DVec3, cells: [u32; 3]) -> Result<Self> {
        let most = cells.iter().copied().max().unwrap_or(0);
        if cells.contains(&0) || most > 1 << MAX_LEVEL {
            let problem = format!("{cells:?} background cells cannot be made");
            return Err(Error::setting("cells", problem, "take 1 to 262144 along each axis"));
        }
        let base = most.next_power_of_two().trailing_zeros();
        let size = max - min;
        if !(min.is_finite() && max.is_finite() && size.is_finite() && size.min_element() > 0.0) {
            let problem = format!("a box from {min} to {max} has no volume");
            return Err(Error::setting("box", problem, "grow it along the axes on which it is flat"));
        }
        let ends = cells.map(|n| n << (19 - base));
        for i in 0..3 {
            let (step, largest) = (size[i] / f64::from(ends[i]), min[i].abs().max(max[i].abs()));
            if step.is_nan() || step < FINEST_STEP * largest || step < f64::MIN_POSITIVE {
                let (step, largest) = (Short(step), Short(largest));
                let problem = format!("cells down to {step} cannot be told apart at coordinates of {largest}");
                return Err(Error::setting("box", problem, "move the model nearer to the origin"));
            }
        }
        Ok(Domain { min, max, cells, ends, base })
    }

    /// The box of a model from `min` to `max`, grown by `margin` times its longest side on all sides, with cubic background cells, `cells`
    /// of them along its longest side. A model without extent gets a box of one unit.
    ///
    /// # Errors
    ///
    /// As [`new`](Domain::new), and if the margin is negative or no number.
    pub fn around(min: DVec3, max: DVec3, margin: f64, cells: u32) -> Result<Self> {
        if !(margin.is_finite() && margin >= 0.0) {
            return Err(Error::setting("margin", format!("{margin} is not 0 or more"), "0.1 suits most models"));
        }
        let longest = (max - min).max_element();
        let longest = if longest == 0.0 { 1.0 } else { longest };
        let side = longest * (1.0 + 2.0 * margin) / f64::from(cells.max(1));
        let counts = ((max - min + 2.0 * margin * longest) / side).to_array();
        // A count that is an integer but for rounding is not rounded up.
        let counts = counts.map(|n| ((n - 1e-9).ceil() as u32).clamp(1, cells.max(1)));
        let half = DVec3::from_array(counts.map(f64::from)) * (side / 2.0);
        let centre = min + (max - min) / 2.0;
        Domain::new(centre - half, centre + half, if cells == 0 { [0; 3] } else { counts })
    }

    /// The least corner.
    pub fn min(&self) -> DVec3 {
        self.min
    }

    /// The greatest corner.
    pub fn max(&self) -> DVec3 {
        self.max
    }

    /// Background cells along x, y, z.
    pub fn cells(&self) -> [u32; 3] {
        self.cells
    }

    /// The finest level of its cells.
    pub fn max_level(&self) -> u32 {
        MAX_LEVEL - self.base
    }

    /// The level of a cell of the root as a cell of the domain; `None` for what is larger than a background cell or no cell.
    pub fn level(&self, cell: Key) -> Option<u32> {
        cell.level()?.checked_sub(self.base)
    }

    /// The sides of the cells of a level along x, y, z.
    pub fn cell_size(&self, level: u32) -> DVec3 {
        let size = (self.max - self.min) / DVec3::from_array(self.cells.map(f64::from));
        size / f64::from(level.min(MAX_LEVEL)).exp2()
    }

    /// The cell of a level at a position counted in cells of that level. `None` outside, or if the level is above
    /// [`max_level`](Domain::max_level).
    pub fn cell(&self, level: u32, position: [u32; 3]) -> Option<Key> {
        let is_inside = level <= self.max_level() && (0..3).all(|i| position[i] < self.cells[i] << level);
        Key::cell(self.base + level, position).filter(|_| is_inside)
    }

    /// All background cells, z fastest: the leaves of a tree that covers the domain.
    pub fn background(&self) -> impl Iterator<Item = Key> + use<> {
        let (base, [nx, ny, nz]) = (self.base, self.cells);
        let places = (0..nx).flat_map(move |x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])));
        places.filter_map(move |place| Key::cell(base, place))
    }

    /// The coordinates of a lattice point. Those of the box's own corners are exactly its own. Beyond the box, coordinates go on.
    pub fn to_space(&self, point: [u32; 3]) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|i| self.coordinate(i, point[i])))
    }

    /// The least and the greatest corner of a cell.
    pub fn corners(&self, cell: Key) -> (DVec3, DVec3) {
        (self.to_space(cell.min_corner()), self.to_space(cell.max_corner()))
    }

    /// The lattice point of a point in space: along each axis the last one that is not above it, but below the far boundary, so that
    /// points there are in the last cells. What [`LinearOctree::locate`](crate::octree::LinearOctree::locate) wants.
    ///
    /// # Errors
    ///
    /// [`Outside`].
    pub fn locate(&self, p: DVec3) -> std::result::Result<[u32; 3], Outside> {
        let mut point = [0; 3];
        for axis in Axis::ALL {
            let i = axis.index();
            let (value, min, max) = (p[i], self.min[i], self.max[i]);
            if !(min..=max).contains(&value) {
                return Err(Outside { axis, value, min, max });
            }
            // The quotient is off by less than a step.
            let last = self.ends[i] - 1;
            let about = (((value - min) / (max - min) * f64::from(self.ends[i])) as u32).min(last);
            let up = about < last && self.coordinate(i, about + 1) <= value;
            let down = about > 0 && self.coordinate(i, about) > value;
            point[i] = about + u32::from(up) - u32::from(down);
        }
        Ok(point)
    }

    /// A point in space in lattice coordinates, with fractions: what searches within radii and along rays, and
    /// [`NodalOctree::value_at`](crate::octree::NodalOctree::value_at) want. Exact at lattice points, the far boundary included; off by
    /// rounding between them. Not limited to the box.
    pub fn to_lattice(&self, p: DVec3) -> [f64; 3] {
        let point = self.locate(p).ok();
        [0, 1, 2].map(|i| {
            let at = (p[i] - self.min[i]) / (self.max[i] - self.min[i]) * f64::from(self.ends[i]);
            match point.map(|point| point[i]) {
                Some(n) if self.coordinate(i, n) == p[i] => f64::from(n),
                _ if p[i] == self.max[i] => f64::from(self.ends[i]),
                _ => at,
            }
        })
    }

    fn coordinate(&self, i: usize, n: u32) -> f64 {
        debug_assert!(n <= SIDE, "a lattice point of the root");
        if n == self.ends[i] {
            return self.max[i];
        }
        self.min[i] + (self.max[i] - self.min[i]) * (f64::from(n) / f64::from(self.ends[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::LinearOctree;
    use proptest::prelude::*;

    fn domain() -> impl Strategy<Value = Domain> {
        let corner = || [-1e3..1e3, -1e3..1e3, -1e3..1e3];
        (corner(), [1e-3..1e3, 1e-3..1e3, 1e-3..1e3], [1..20u32, 1..20u32, 1..20u32]).prop_map(|(min, size, cells)| {
            let (min, size): (DVec3, DVec3) = (DVec3::from_array(min), DVec3::from_array(size));
            Domain::new(min, min + size, cells).expect("a box")
        })
    }

    proptest! {
        #[test]
        fn lattice_points_come_back(domain in domain(), share in [0.0..=1.0, 0.0..=1.0, 0.0..=1.0]) {
            let random = [0, 1, 2].map(|i| (share[i] * f64::from(domain.ends[i])) as u32);
            for point in [random, domain.ends, [0; 3]] {
                let p = domain.to_space(point);
                prop_assert_eq!(domain.locate(p), Ok([0, 1, 2].map(|i| point[i].min(domain.ends[i] - 1))));
                prop_assert_eq!(domain.to_lattice(p), point.map(f64::from));
            }
            prop_assert_eq!(domain.to_space(domain.ends), domain.max());
        }

        #[test]
        fn points_lie_in_their_cells(domain in domain(), share in [0.0..=1.0, 0.0..=1.0, 0.0..=1.0], level in 0..6u32) {
            let p = domain.min().lerp(domain.max(), 1.0) * DVec3::from_array(share) + domain.min() * (1.0 - DVec3::from_array(share));
            let p = p.clamp(domain.min(), domain.max());
            let tree: LinearOctree<()> = domain.background().map(|cell| (cell, ())).collect();
            prop_assert_eq!(tree.len() as u32, domain.cells().iter().product::<u32>());
            let (leaf, ()) = tree.locate(domain.locate(p).expect("inside")).expect("a background cell");
            prop_assert_eq!(domain.level(leaf), Some(0));
            let (min, max) = domain.corners(leaf);
            prop_assert!(min.cmple(p).all() && p.cmple(max).all());
            prop_assert!(((max - min) - domain.cell_size(0)).abs().max_element() < 1e-9);
            let last = domain.cells().map(|n| (n << level) - 1);
            let cell = domain.cell(level, last).expect("the last");
            prop_assert_eq!((domain.level(cell), domain.corners(cell).1), (Some(level), domain.max()));
            prop_assert_eq!(domain.cell(level, [last[0] + 1, 0, 0]), None);
        }
    }

    #[test]
    fn outside_is_a_value_that_says_where() {
        let domain = Domain::new(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), [1, 2, 3]).expect("a box");
        let outside = domain.locate(DVec3::new(0.5, -0.25, 0.0)).expect_err("below");
        assert_eq!(outside.to_string(), "y = -0.25 is not in the domain, 0 to 2");
        assert!(domain.locate(DVec3::new(0.5, f64::NAN, 0.0)).is_err());
        assert!(domain.locate(DVec3::new(1.0_f64.next_up(), 0.0, 0.0)).is_err());
        assert_eq!(domain.locate(DVec3::new(1.0, 2.0, 3.0)), Ok([(1 << 17) - 1, (2 << 17) - 1, (3 << 17) - 1]));
    }

    #[test]
    fn what_cannot_be_divided_is_refused() {
        let (zero, one) = (DVec3::ZERO, DVec3::ONE);
        for (min, max, cells) in [
            (zero, one, [1, 0, 1]),
            (zero, one, [1 << 19, 1, 1]),
            (zero, DVec3::new(1.0, 0.0, 1.0), [1; 3]),
            (zero, DVec3::splat(f64::INFINITY), [1; 3]),
            (DVec3::splat(f64::NAN), one, [1; 3]),
            (DVec3::splat(1e16), DVec3::splat(1e16 + 64.0), [1; 3]),
        ] {
            assert!(Domain::new(min, max, cells).is_err(), "{min} {max} {cells:?}");
        }
        assert!(Domain::around(zero, one, -1.0, 4).is_err() && Domain::around(zero, one, 0.1, 0).is_err());
    }
}
