//! A volume as extractors see it: with a layer of outside round it where the surface shall be closed, and a place in the model.

use super::slice::Slice;
use crate::grid::brick::Bits;
use crate::grid::{Axis, Corner, Edge};
use crate::volume::{Level, Placement, Volume};
use glam::{DMat3, DVec3};

/// Points keep this distance from the ends of their edge, in edges. So no two points meet, whatever the samples: three points on different
/// edges of a cell are never on a line, and triangles between them have an area.
pub(crate) const CLEARANCE: f64 = 1.0 / 1024.0;

/// Crossings that are looked up at a time: enough to keep the memory busy, few enough for the first cache.
const BATCH: usize = 256;

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
            (Some(at), Some(_)) => away_from_ends(self.volume.crossing(at, axis, self.level)),
            _ => 0.5,
        }
    }

    /// Calls `each` with the crossed edges of slice `z`, in order, and where the surface cuts them.
    ///
    /// Samples are looked up long after the signs were taken, when no cache has them any more. So edges are listed first, without a look at what
    /// is there, and looked up many at a time: then nothing has to wait for one sample before it can ask for the next.
    #[inline]
    pub(crate) fn crossings_of(&self, slice: &Slice, z: usize, mut each: impl FnMut([usize; 3], Axis, f64)) {
        let (mut edges, mut places) = (Vec::with_capacity(BATCH + 3 * 64), Vec::with_capacity(BATCH + 3 * 64));
        let mut look_up = |edges: &mut Vec<([usize; 3], Axis)>| {
            self.crossings(edges, &mut places);
            edges.drain(..).zip(&places).for_each(|((at, axis), &t)| each(at, axis, t));
        };
        for y in 0..slice.rows() {
            for word in slice.row(y) {
                for axis in Axis::ALL {
                    let at = |x: u32| [64 * word.x as usize + x as usize, y, z];
                    edges.extend(Bits(word.crossed[axis.index()]).map(|x| (at(x), axis)));
                }
                if edges.len() >= BATCH {
                    look_up(&mut edges);
                }
            }
        }
        look_up(&mut edges);
    }

    /// The crossings of many edges.
    fn crossings(&self, edges: &mut [([usize; 3], Axis)], places: &mut Vec<f64>) {
        places.clear();
        places.resize(edges.len(), 0.5);
        let (size, border) = (self.volume.size(), self.border);
        // Those of which both ends are samples, along whatever axis.
        let is_inner = |at: [usize; 3]| (0..3).all(|a| at[a].wrapping_sub(border) < size[a] - 1);
        if edges.iter().all(|&(at, _)| is_inner(at)) {
            edges.iter_mut().for_each(|(at, _)| *at = at.map(|c| c - border));
            self.volume.crossings(edges, self.level, places);
            edges.iter_mut().for_each(|(at, _)| *at = at.map(|c| c + border));
            places.iter_mut().for_each(|t| *t = away_from_ends(*t));
        } else {
            places.iter_mut().zip(edges).for_each(|(place, &mut (at, axis))| *place = self.crossing(at, axis));
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

/// A place on an edge, drawn away from its ends; from its start, if it is not a number.
#[inline]
fn away_from_ends(t: f64) -> f64 {
    if t > CLEARANCE { t.min(1.0 - CLEARANCE) } else { CLEARANCE }
}

/// The place of a lattice point.
#[inline]
pub(crate) fn place(at: [usize; 3]) -> DVec3 {
    DVec3::new(at[0] as f64, at[1] as f64, at[2] as f64)
}
