//! Signs of fields, at all finest lattice points along their surfaces.

use super::build::place;
use super::{Edge, Field, Function, Zero};
use crate::error::Result;
use crate::geom::normal::NormalCode;
use crate::grid::brick::{Local, Plane};
use crate::grid::key::MAX_LEVEL;
use crate::grid::{Axis, Key};
use crate::octree::crossings::{Sample, lattice_point};
use crate::octree::signed::GIVEN_BYTES;
use crate::octree::{CellState, SignedOctree};
use crate::progress::{Progress, check};
use crate::volume::Volume;
use glam::DVec3;
use rayon::prelude::*;

/// Normals have at least this part of their length along the edge that they are stored with: a surface along it would not cross it.
const LEAST_SLOPE: f64 = 1e-3;

impl Field {
    /// Signs and crossings, with normals, of the lattice of the frame's depth; crossings are those of the field itself, linear along edges.
    /// What is inside at the root's boundary is closed there.
    ///
    /// Cost: some probes for each lattice point of the bricks along the surface.
    ///
    /// # Errors
    /// `Cancelled`, and `Memory` when `progress` says so.
    pub fn signed(&self, progress: &dyn Progress) -> Result<SignedOctree> {
        self.signed_by(self, progress)
    }

    /// As [`signed`](Field::signed), with crossings where a function says: the one that the field was made of, which is more exact than
    /// the field, or one that knows better where a surface is.
    ///
    /// # Errors
    /// `Cancelled`, and `Memory` when `progress` says so.
    pub fn signed_by(&self, function: &impl Function, progress: &dyn Progress) -> Result<SignedOctree> {
        let depth = self.frame.depth();
        let bricks = self.mixed_bricks();
        progress.hold((bricks.len() * GIVEN_BYTES) as u64)?;
        let signs: Result<Vec<(Key, Plane)>> = bricks
            .into_par_iter()
            .map(|brick| {
                check(progress)?;
                Ok((brick, self.points_inside(brick)))
            })
            .collect();
        let signs = signs?;
        let is_inside = |brick: Key| {
            // A brick without surface is all of one sign, that of any of its points that is not on the root's boundary.
            self.lattice_value(lattice_point(depth, brick).map(|c| c + 7)) < 0.0
        };
        let samples = |n: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
            let edges = self.edges(lattice_point(depth, signs[n].0), crossed);
            let list: Vec<Edge> = edges.iter().map(|edge| edge.1).collect();
            let mut zeros = Vec::with_capacity(list.len());
            function.zeros(&list, &mut zeros);
            out.extend(edges.iter().zip(zeros).map(|((axis, _), zero)| sample(*axis, zero)));
        };
        SignedOctree::try_from_signs(depth, true, &signs, is_inside, samples, progress)
    }

    /// The bricks that the surface passes through or touches, sorted.
    fn mixed_bricks(&self) -> Vec<Key> {
        let level = self.frame.depth() - 3;
        let mixed: Vec<Key> =
            self.nodes.tree().par_iter().filter_map(|(leaf, ())| self.is_mixed(leaf).then_some(leaf)).collect();
        let mut bricks: Vec<Key> = mixed
            .into_par_iter()
            .flat_map_iter(|leaf| {
                if leaf.level() >= Some(level) {
                    return vec![leaf.ancestor(level)];
                }
                let [x, y, z] = lattice_point(self.frame.depth(), leaf).map(|c| c >> 3);
                let side = leaf.size() >> (MAX_LEVEL + 1 - level);
                let places = (0..side.pow(3)).map(|i| [x + i / side / side, y + i / side % side, z + i % side]);
                places.filter_map(|place| Key::cell(level, place)).collect()
            })
            .collect();
        bricks.par_sort_unstable();
        bricks.dedup();
        bricks
    }

    /// The lattice points of a brick that are inside.
    fn points_inside(&self, brick: Key) -> Plane {
        let depth = self.frame.depth();
        let tree = self.nodes.tree();
        let origin = lattice_point(depth, brick);
        let mut plane = Plane::EMPTY;
        let mut fill = |leaf: Key| {
            // The part of the leaf, low sides only, that is in the brick.
            let low = lattice_point(depth, leaf);
            let side = leaf.size() >> (MAX_LEVEL + 1 - depth);
            let first: [u32; 3] = std::array::from_fn(|a| low[a].max(origin[a]));
            let end: [u32; 3] = std::array::from_fn(|a| (low[a] + side).min(origin[a] + 8));
            let values = (side > 1).then(|| self.nodes.places(leaf)).flatten();
            let sign = values.and_then(|values| {
                let inside = values.iter().filter(|&&v| v < 0.0).count();
                (inside == 0 || inside == values.len()).then_some(inside > 0)
            });
            for x in first[0]..end[0] {
                for y in first[1]..end[1] {
                    for z in first[2]..end[2] {
                        if sign.unwrap_or_else(|| self.value_in(leaf, [x, y, z]) < 0.0) {
                            plane.set(Local::new(x, y, z));
                        }
                    }
                }
            }
        };
        match tree.state(brick) {
            CellState::Absent => {
                if let Some((leaf, ())) = tree.leaf_over(brick) {
                    fill(leaf);
                }
            }
            _ => tree.leaves_in(brick).for_each(|(leaf, ())| fill(leaf)),
        }
        for (axis, c) in Axis::ALL.into_iter().zip(origin) {
            if c == 0 {
                // Points on the root's boundary are outside.
                plane &= Plane::FULL.at_minus(axis, &Plane::EMPTY);
            }
        }
        plane
    }

    /// The value at a lattice point of the frame's depth, in cells, which lies in the root.
    fn lattice_value(&self, at: [u32; 3]) -> f64 {
        let point = self.on_root(at);
        let node = Key::point(point).and_then(|key| self.nodes.value(key));
        node.or_else(|| self.nodes.value_at(point.map(f64::from))).unwrap_or(f64::INFINITY)
    }

    /// The same for a point of a leaf, where that is known.
    fn value_in(&self, leaf: Key, at: [u32; 3]) -> f64 {
        let point = self.on_root(at);
        let node = Key::point(point).and_then(|key| self.nodes.value(key));
        node.or_else(|| self.nodes.value_in(leaf, point.map(f64::from))).unwrap_or(f64::INFINITY)
    }

    /// A lattice point of the frame's depth as one of the root's own lattice.
    fn on_root(&self, at: [u32; 3]) -> [u32; 3] {
        at.map(|c| c << (MAX_LEVEL + 1 - self.frame.depth()))
    }

    /// The crossed edges of the brick at `origin`, in order.
    fn edges(&self, origin: [u32; 3], crossed: &[Plane; 3]) -> Vec<(Axis, Edge)> {
        let mut edges = Vec::new();
        for axis in Axis::ALL {
            for local in crossed[axis.index()].iter() {
                let start: [u32; 3] = std::array::from_fn(|a| origin[a] + local.coords()[a]);
                let mut end = start;
                end[axis.index()] += 1;
                let points = [start, end];
                let ends = points.map(|at| place(&self.frame, self.on_root(at)));
                edges.push((axis, Edge { ends, values: points.map(|at| self.lattice_value(at)) }));
            }
        }
        edges
    }
}

/// A zero as a sample of an edge.
fn sample(axis: Axis, Zero { at, slope }: Zero) -> Sample {
    let mut normal = slope.normalize_or_zero().to_array();
    let along = &mut normal[axis.index()];
    if along.abs() < LEAST_SLOPE {
        *along = LEAST_SLOPE.copysign(*along);
    }
    Sample::new((at * 65536.0) as u16, NormalCode::encode(axis, normal).0)
}

/// A field is a function; zeros are linear along edges, and slopes those of the field across two cells.
impl Function for Field {
    fn values(&self, places: &[DVec3], out: &mut Vec<f64>) {
        out.extend(places.iter().map(|&p| self.value_at(p).unwrap_or(f64::INFINITY)));
    }

    fn zeros(&self, edges: &[Edge], out: &mut Vec<Zero>) {
        let step = self.frame.cell_size();
        out.extend(edges.iter().map(|edge| {
            let at = edge.linear();
            let p = edge.place(at);
            let value = |p: DVec3| self.value_at(p);
            let slope = DVec3::AXES.map(|axis| match (value(p - step * axis), value(p + step * axis)) {
                (Some(a), Some(b)) => b - a,
                _ => 0.0,
            });
            Zero { at, slope: DVec3::from_array(slope) }
        }));
    }
}

/// The values at all lattice points of the frame's depth, 2^depth + 1 along each axis. [`Frame`](crate::geom::Frame) says where they are:
/// at its origin, a cell apart. Each value costs a probe or a search.
impl Volume for Field {
    fn size(&self) -> [usize; 3] {
        [(1 << self.frame.depth()) + 1; 3]
    }

    fn value(&self, at: [usize; 3]) -> f64 {
        self.lattice_value(at.map(|c| c as u32))
    }
}
