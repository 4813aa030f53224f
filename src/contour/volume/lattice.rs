//! A volume as extractors see it: with a layer of outside round it where the surface shall be closed, and a place in the model.

use crate::grid::{Axis, Corner, Edge};
use crate::volume::{Level, Placement, Volume};
use glam::{DMat3, DVec3};

/// Points keep this distance from the ends of their edge, in edges. So no two points meet, whatever the samples: three points on different
/// edges of a cell are never on a line, and triangles between them have an area.
pub(crate) const CLEARANCE: f64 = 1.0 / 1024.0;

/// A volume with its level and place. Lattice points count from the border on, if there is one: the first sample is then `[1, 1, 1]`.
pub(crate) struct Lattice<'a, V: ?Sized> {
    pub(crate) volume: &'a V,
    pub(crate) level: Level,
    /// Layers of virtual samples on each side, all outside: 0 or 1.
    pub(crate) border: usize,
    /// Lattice points along each axis, with the border.
    pub(crate) size: [usize; 3],
    /// Of the lattice with its border.
    placement: Placement,
    /// From gradients on the lattice to gradients in the model.
    pub(crate) covector: DMat3,
}

impl<'a, V: Volume> Lattice<'a, V> {
    /// A lattice with a border, or without.
    pub(crate) fn new(volume: &'a V, level: Level, placement: Placement, has_border: bool) -> Self {
        let border = usize::from(has_border);
        // A volume without samples has no border either; one layer of samples without border has no cells.
        let sizes = volume.size();
        let size = if sizes.contains(&0) { [0; 3] } else { sizes.map(|n| n + 2 * border) };
        let size = if size.iter().any(|&n| n < 2) { [0; 3] } else { size };
        let placement = placement.starting_at(DVec3::splat(-(border as f64)));
        let covector = placement.axes.inverse().transpose();
        Lattice { volume, level, border, size, placement, covector }
    }

    /// The lattice point of the volume, if it is no virtual one.
    #[inline]
    pub(crate) fn sample(&self, at: [usize; 3]) -> Option<[usize; 3]> {
        let at = at.map(|c| c.wrapping_sub(self.border));
        let size = self.volume.size();
        (at[0] < size[0] && at[1] < size[1] && at[2] < size[2]).then_some(at)
    }

    /// Where the surface cuts the edge that starts at `at`, away from its ends. In the border it is half way: samples are taken to be the
    /// middles of boxes that fill the volume.
    #[inline]
    pub(crate) fn crossing(&self, at: [usize; 3], axis: Axis) -> f64 {
        let mut to = at;
        to[axis.index()] += 1;
        match (self.sample(at), self.sample(to)) {
            (Some(at), Some(_)) => {
                let t = self.volume.crossing(at, axis, self.level);
                if t > CLEARANCE { t.min(1.0 - CLEARANCE) } else { CLEARANCE }
            }
            _ => 0.5,
        }
    }

    /// How far a lattice point is inside; in the border, one unit outside.
    pub(crate) fn depth(&self, at: [usize; 3]) -> f64 {
        self.sample(at).map_or(-1.0, |at| self.level.depth(self.volume.value(at)))
    }

    /// Halfway between the materials in a cell, in coordinates of the cell: the mean of the middles of its edges whose ends differ. All beyond
    /// the border is one more material.
    pub(crate) fn between_materials(&self, cell: [usize; 3]) -> DVec3 {
        let at = |corner: Corner| std::array::from_fn(|a| cell[a] + usize::from(corner & Axis::ALL[a]));
        // Bits, for what is not a number differs from itself.
        let materials = Corner::ALL.map(|corner| self.sample(at(corner)).map(|at| self.volume.material(at).to_bits()));
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for edge in Edge::ALL {
            let [low, high] = edge.corners();
            if materials[low.index()] != materials[high.index()] {
                sum += 0.5 * (place(at(low)) + place(at(high))) - place(cell);
                count += 1.0;
            }
        }
        sum / count
    }

    /// The cells of a row that may hold surface, among them those of the border; none where there is no row.
    pub(crate) fn valid_cells(&self, y: Option<usize>, z: Option<usize>, words: &mut [u64]) {
        let (Some(y), Some(z)) = (y, z) else { return words.fill(0) };
        words.fill(!0);
        let size = self.volume.size();
        let (Some(y), Some(z)) = (y.checked_sub(self.border), z.checked_sub(self.border)) else { return };
        if y + 1 < size[1] && z + 1 < size[2] && size[0] > 1 {
            let own = size[0].div_ceil(64);
            self.volume.valid_cells([y, z], &mut words[..own]);
            // The cells at both ends of the row are in the border.
            let cells = size[0] - 1;
            words[cells / 64] |= !0 << (cells % 64);
            if self.border == 1 {
                let mut carry = 1;
                for word in words {
                    (*word, carry) = (*word << 1 | carry, *word >> 63);
                }
            }
        }
    }

    /// From a place on the lattice to model units.
    #[inline]
    pub(crate) fn to_model(&self, place: DVec3) -> DVec3 {
        self.placement.to_model(place)
    }

    /// The steps from a lattice point to the next one along x, y and z, in model units.
    #[inline]
    pub(crate) fn steps(&self) -> [DVec3; 3] {
        let axes = &self.placement.axes;
        [axes.x_axis, axes.y_axis, axes.z_axis]
    }

    /// Whether faces made on the lattice have to be turned over in the model.
    pub(crate) fn is_mirrored(&self) -> bool {
        self.placement.is_mirrored()
    }
}

/// The place of a lattice point.
#[inline]
pub(crate) fn place(at: [usize; 3]) -> DVec3 {
    DVec3::new(at[0] as f64, at[1] as f64, at[2] as f64)
}
