//! Fields of functions.

use super::Function;
use crate::error::{Error, Result};
use crate::geom::Frame;
use crate::grid::Key;
use crate::grid::key::{MAX_LEVEL, SIDE};
use crate::octree::{Balance, LinearOctree, NodalOctree};
use crate::progress::{Progress, check};
use glam::DVec3;
use rayon::prelude::*;

/// Places asked for at a time: those of a few leaves beside each other.
const BATCH: usize = 256;

/// Values are this at most, one way or the other, so that their sums and products are numbers.
const FAR: f64 = 1e150;

/// Bytes for each node while a field is made: its entry in the table, at worst, and lists of keys and values.
const NODE_BYTES: usize = 2 * 25 + 40;

/// Where a field is fine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adapt {
    /// Leaves are of this level or finer, 0 at most 18. What is thinner than a leaf of this level may be missed. Default 3.
    pub coarsest: u32,
    /// How far a leaf's field may be off, in model units, where the surface may be in it; leaves of the frame's depth may be off by more.
    /// Default 0: all leaves along the surface are of the frame's depth, unless the function is linear there.
    pub tolerance: f64,
    /// How much the function changes over a unit of length, at most. Leaves in which it cannot be zero by this measure stay as they are.
    /// Default 1, as distances have it.
    pub steepness: f64,
}

impl Default for Adapt {
    fn default() -> Self {
        Adapt { coarsest: 3, tolerance: 0.0, steepness: 1.0 }
    }
}

/// A function on the nodes of an octree. See the [module](super).
#[derive(Debug, Clone)]
pub struct Field {
    pub(super) nodes: NodalOctree<(), f64>,
    pub(super) frame: Frame,
}

impl Field {
    /// The field of a function, refined where the surface may be, until what is between the nodes is near enough to the function; no deeper
    /// than the frame's depth.
    ///
    /// Each leaf above that depth is looked at in 15 places: its corners, the middles of its faces, its middle.
    ///
    /// # Errors
    /// When tolerance or steepness are not 0 or more, `Cancelled`, and `Memory` when `progress` says so.
    pub fn build(frame: Frame, function: &impl Function, adapt: Adapt, progress: &dyn Progress) -> Result<Field> {
        for (option, value) in [("tolerance", adapt.tolerance), ("steepness", adapt.steepness)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::setting(option, format!("{value} is not 0 or more"), "leave it at its default"));
            }
        }
        let coarsest = adapt.coarsest.min(frame.depth());
        let mut active: Vec<Key> = LinearOctree::build(coarsest, |_| true, |_| ()).keys_z();
        let mut leaves: Vec<Key> = Vec::new();
        for _ in coarsest..frame.depth() {
            check(progress)?;
            progress.hold(((leaves.len() + 9 * active.len()) * 2 * size_of::<Key>()) as u64)?;
            let splits: Vec<bool> = active
                .par_chunks(BATCH / PLACES)
                .flat_map_iter(|cells| splits(&frame, function, cells, &adapt))
                .collect();
            let mut below = Vec::new();
            for (cell, is_split) in active.into_iter().zip(splits) {
                if is_split { below.extend(cell.children()) } else { leaves.push(cell) }
            }
            active = below;
        }
        let tree = leaves.into_iter().chain(active).map(|leaf| (leaf, ())).collect();
        Field::on_tree(frame, tree, function, progress)
    }

    /// The field of a function on a tree that covers the root and is no deeper than the frame. It is balanced over edges first, so that the
    /// field is continuous.
    ///
    /// # Errors
    /// `Cancelled`, and `Memory` when `progress` says so.
    ///
    /// # Panics
    /// When a leaf is finer than the cells of the frame.
    pub fn on_tree(
        frame: Frame,
        tree: LinearOctree<()>,
        function: &impl Function,
        progress: &dyn Progress,
    ) -> Result<Field> {
        let nodes = NodalOctree::new();
        let mut field = Field { nodes, frame };
        field.take(tree, function, progress)?;
        Ok(field)
    }

    /// The same with all leaves refined to the frame's depth through which the surface passes, by the function that it was made of.
    ///
    /// # Errors
    /// `Cancelled`, and `Memory` when `progress` says so.
    pub fn refined(self, function: &impl Function, progress: &dyn Progress) -> Result<Field> {
        self.refined_where(function, Field::is_mixed, progress)
    }

    /// The same with leaves split, and split again, as long as they are above the frame's depth and `demands` says so.
    pub(super) fn refined_where(
        mut self,
        function: &impl Function,
        demands: impl Fn(&Field, Key) -> bool + Sync,
        progress: &dyn Progress,
    ) -> Result<Field> {
        loop {
            let depth = self.frame.depth();
            let is_wanted = |leaf: Key| leaf.level() < Some(depth) && demands(&self, leaf);
            let mut wanted: Vec<Key> =
                self.nodes.tree().par_iter().filter_map(|(leaf, ())| is_wanted(leaf).then_some(leaf)).collect();
            if wanted.is_empty() {
                return Ok(self);
            }
            wanted.par_sort_unstable();
            let mut tree = self.nodes.tree().clone();
            for leaf in wanted {
                // Balancing one leaf may have split another before its turn.
                if tree.contains(leaf) {
                    tree.refine(leaf, Balance::Edges, |_, ()| ()).expect("a leaf above the finest level");
                }
            }
            self.take(tree, function, progress)?;
        }
    }

    /// Takes over a tree, with the values that are known and those of a function elsewhere.
    fn take(&mut self, mut tree: LinearOctree<()>, function: &impl Function, progress: &dyn Progress) -> Result<()> {
        tree.balance(Balance::Edges, |_, ()| ());
        let depth = self.frame.depth();
        assert!(tree.iter().all(|(leaf, ())| leaf.level() <= Some(depth)), "no leaf is finer than the frame");
        check(progress)?;
        progress.hold((tree.allocated_bytes() + 2 * tree.len() * NODE_BYTES) as u64)?;
        let old = std::mem::take(&mut self.nodes);
        self.nodes = NodalOctree::with_values(tree, |point| old.value(point).unwrap_or(f64::NAN));
        drop(old);
        let mut unknown: Vec<Key> = self.nodes.nodes().filter(|(_, value)| value.is_nan()).map(|node| node.0).collect();
        unknown.par_sort_unstable();
        let frame = &self.frame;
        let values: Result<Vec<Vec<f64>>> = unknown
            .par_chunks(BATCH)
            .map(|points| {
                check(progress)?;
                let places: Vec<DVec3> = points.iter().map(|point| place(frame, point.center())).collect();
                let mut values = Vec::with_capacity(places.len());
                function.values(&places, &mut values);
                Ok(values)
            })
            .collect();
        for (point, value) in unknown.iter().zip(values?.into_iter().flatten()) {
            // Not known to be inside, so outside.
            let value = if value.is_nan() { f64::INFINITY } else { value };
            *self.nodes.value_mut(*point).expect("a node") = value.clamp(-FAR, FAR);
        }
        Ok(())
    }

    /// The values at the nodes.
    pub fn nodes(&self) -> &NodalOctree<(), f64> {
        &self.nodes
    }

    /// Where the tree lies in space. Its depth is that of the finest leaves that there can be.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// The value at a place in model units; `None` outside of the root cube.
    pub fn value_at(&self, p: DVec3) -> Option<f64> {
        let at = (p - self.frame.origin()) * (f64::from(SIDE) / self.frame.size());
        self.nodes.value_at(at.to_array())
    }

    /// Whether a leaf has values of both signs, or lies at the root's boundary, beyond which all is outside, and has one that is not.
    pub(super) fn is_mixed(&self, leaf: Key) -> bool {
        let value = |point: Key| self.nodes.value(point).expect("the corner of a leaf is a node");
        let corners = leaf.corners().map(|point| value(point) < 0.0);
        let is_at_boundary = leaf.min_corner().contains(&0) || leaf.max_corner().contains(&SIDE);
        if corners.contains(&true) && (corners.contains(&false) || is_at_boundary) {
            return true;
        }
        // Nothing hangs on the finest leaves.
        let may_have_hanging = leaf.level() < Some(self.frame.depth());
        let differs = |&value: &f64| (value < 0.0) != corners[0];
        may_have_hanging && self.nodes.places(leaf).is_some_and(|places| places.iter().any(differs))
    }
}

/// A lattice point in model units.
pub(super) fn place(frame: &Frame, point: [u32; 3]) -> DVec3 {
    let finest = f64::from(1u32 << (MAX_LEVEL + 1 - frame.depth()));
    frame.to_model(DVec3::from_array(point.map(f64::from)) / finest)
}

/// Places in which a leaf is looked at.
const PLACES: usize = 15;

/// Which of some cells are to be split.
fn splits(frame: &Frame, function: &impl Function, cells: &[Key], adapt: &Adapt) -> Vec<bool> {
    let mut places = Vec::with_capacity(PLACES * cells.len());
    for cell in cells {
        let [low, high] = [cell.min_corner(), cell.max_corner()].map(|corner| place(frame, corner));
        let middle = 0.5 * (low + high);
        places.extend((0..8).map(|c| DVec3::select(glam::BVec3::new(c & 4 != 0, c & 2 != 0, c & 1 != 0), high, low)));
        for axis in 0..3 {
            for end in [low, high] {
                let mut face = middle;
                face[axis] = end[axis];
                places.push(face);
            }
        }
        places.push(middle);
    }
    let mut values = Vec::with_capacity(places.len());
    function.values(&places, &mut values);
    let is_split = |(cell, values): (&Key, &[f64])| {
        let half_diagonal = 0.5 * 3f64.sqrt() * frame.size() * f64::from(cell.size()) / f64::from(SIDE);
        let is_mixed = values.iter().any(|&v| v < 0.0) && !values.iter().all(|&v| v < 0.0);
        // No point of the cell is farther than that from its middle.
        if !is_mixed && values[PLACES - 1].abs() > adapt.steepness * half_diagonal {
            return false;
        }
        let corners = &values[..8];
        let mean_of = |picked: &dyn Fn(usize) -> bool| {
            let picked: Vec<f64> = (0..8).filter(|&c| picked(c)).map(|c| corners[c]).collect();
            picked.iter().sum::<f64>() / picked.len() as f64
        };
        let off = |value: f64, mean: f64| (value - mean).abs();
        let faces = (0..6).map(|f| off(values[8 + f], mean_of(&|c| c >> (2 - f / 2) & 1 == f % 2)));
        let worst = faces.fold(off(values[PLACES - 1], mean_of(&|_| true)), f64::max);
        worst.is_nan() || worst > adapt.tolerance
    };
    cells.iter().zip(values.chunks_exact(PLACES)).map(is_split).collect()
}
