//! The sparse walker: only the bricks of an octree are looked at.
//!
//! A brick has its crossed edges and mixed cells as planes of bits already; a row of eight bricks makes a word. Rows of an octree run along z, so
//! the octree is taken as a volume whose axes are turned round: its x is the octree's z.

use super::slice::Slice;
use super::sweep::Walker;
use crate::geom::Frame;
use crate::geom::normal::NormalCode;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Key};
use crate::octree::SignedOctree;
use crate::octree::crossings::position;
use crate::volume::{Level, Placement, Volume};
use glam::{DMat3, DVec3};
use std::ops::Range;

/// An octree of signs and crossings as a volume: 1 inside and -1 outside, cut where its crossings are.
pub(super) struct Bricks<'a> {
    octree: &'a SignedOctree,
    /// Least corner, in bricks, and place of each brick, in order of the corners.
    sorted: Vec<([u32; 3], usize)>,
}

impl<'a> Bricks<'a> {
    pub(super) fn new(octree: &'a SignedOctree) -> Self {
        let crossings = octree.crossings();
        let corner = |i: usize| crossings.origin(&crossings.bricks()[i]).map(|c| c >> 3);
        let mut sorted: Vec<_> = (0..crossings.bricks().len()).map(|i| (corner(i), i)).collect();
        sorted.sort_unstable();
        Bricks { octree, sorted }
    }

    /// Where the volume lies if the octree lies in a frame.
    pub(super) fn placement(frame: &Frame) -> Placement {
        let axes = DMat3::from_cols(DVec3::Z, DVec3::Y, DVec3::X) * frame.cell_size();
        Placement { origin: frame.origin(), axes }
    }

    /// The number of the crossing of an edge, if it has one.
    fn find(&self, [z, y, x]: [usize; 3], axis: Axis) -> Option<usize> {
        let at = [x, y, z].map(|c| c as u32);
        let crossings = self.octree.crossings();
        let key = Key::cell(crossings.depth() - 3, at.map(|c| c >> 3))?;
        let brick = &crossings.bricks()[crossings.find(key)?];
        let local = Local::new(at[0], at[1], at[2]);
        let axis = turned(axis);
        brick.crossed[axis.index()].get(local).then(|| brick.place(axis, local))
    }
}

/// The octree's axis of an axis of the volume, and the other way round.
fn turned(axis: Axis) -> Axis {
    Axis::ALL[2 - axis.index()]
}

impl Volume for Bricks<'_> {
    fn size(&self) -> [usize; 3] {
        [(1 << self.octree.crossings().depth()) + 1; 3]
    }

    fn value(&self, [z, y, x]: [usize; 3]) -> f64 {
        if self.octree.is_inside([x, y, z].map(|c| c as u32)) { 1.0 } else { -1.0 }
    }

    fn crossing(&self, at: [usize; 3], axis: Axis, _: Level) -> f64 {
        self.find(at, axis).map_or(0.5, |place| position(self.octree.crossings().offsets()[place]))
    }

    /// That of the crossing on whose edge the place is; none without normals.
    fn gradient(&self, place: DVec3) -> DVec3 {
        let at = place.to_array().map(|c| c as usize);
        let on_edge = Axis::ALL.into_iter().find(|axis| place[axis.index()].fract() != 0.0);
        let crossing = on_edge.and_then(|axis| Some((axis, self.find(at, axis)?)));
        let Some((axis, place)) = crossing.filter(|_| self.octree.crossings().with_normals()) else {
            return DVec3::ZERO;
        };
        // To the high end of the edge.
        let normal = NormalCode(self.octree.crossings().normals()[place]).decode(turned(axis)).as_dvec3();
        let normal = DVec3::new(normal.z, normal.y, normal.x);
        if self.value(at) > 0.0 { -normal } else { normal }
    }
}

impl Walker for Bricks<'_> {
    fn slices(&self) -> usize {
        self.size()[2]
    }

    fn walk(&self, range: Range<usize>) -> Vec<Slice> {
        let mut slices = Vec::with_capacity(range.len());
        let mut layer = (None, Vec::new());
        for x in range {
            let brick = x as u32 / 8;
            if layer.0 != Some(brick) {
                layer = (Some(brick), self.layer(brick));
            }
            slices.push(slice(&layer.1, x % 8, self.size()[1]));
        }
        slices
    }
}

/// What a slice needs of a brick.
struct Part {
    /// Least corner along y and z, in bricks.
    at: [u32; 2],
    crossed: [Plane; 3],
    mixed: Plane,
    corners: [Plane; 8],
}

impl Bricks<'_> {
    /// The bricks of a layer across x, row by row.
    fn layer(&self, x: u32) -> Vec<Part> {
        let start = self.sorted.partition_point(|(at, _)| at[0] < x);
        let end = self.sorted.partition_point(|(at, _)| at[0] <= x);
        let part = |&([_, y, z], i): &([u32; 3], usize)| Part {
            at: [y, z],
            crossed: self.octree.crossings().bricks()[i].crossed,
            mixed: self.octree.mixed_cells(i),
            corners: self.octree.corners(i),
        };
        self.sorted[start..end].iter().map(part).collect()
    }
}

/// The slice at `x` in a layer of bricks.
fn slice(layer: &[Part], x: usize, rows: usize) -> Slice {
    let mut slice = Slice::with_rows(rows);
    for y in 0..rows {
        let start = layer.partition_point(|part| (part.at[0] as usize) < y / 8);
        let row = layer[start..].iter().take_while(|part| part.at[0] as usize == y / 8);
        // Eight positions along z, at their place in the word.
        let byte = |plane: &Plane, z: u32| (plane.0[x] >> (8 * (y % 8)) & 0xff) << (8 * (z % 8));
        let mut word = None;
        let (mut crossed, mut mixed, mut corners) = ([0; 3], 0, [0; 8]);
        let mut push = |word: Option<u32>, crossed: &mut [u64; 3], mixed: &mut u64, corners: &mut [u64; 8]| {
            if let Some(word) = word.filter(|_| *mixed | crossed[0] | crossed[1] | crossed[2] != 0) {
                slice.push(word, *crossed, *mixed, corners);
            }
            (*crossed, *mixed, *corners) = ([0; 3], 0, [0; 8]);
        };
        for part in row {
            let z = part.at[1];
            if word != Some(z / 8) {
                push(word, &mut crossed, &mut mixed, &mut corners);
                word = Some(z / 8);
            }
            mixed |= byte(&part.mixed, z);
            crossed.iter_mut().zip(part.crossed.iter().rev()).for_each(|(word, plane)| *word |= byte(plane, z));
            for (i, word) in corners.iter_mut().enumerate() {
                // x and z exchanged: the first and the last bit.
                *word |= byte(&part.corners[i >> 2 | i & 2 | (i & 1) << 2], z);
            }
        }
        push(word, &mut crossed, &mut mixed, &mut corners);
        slice.end_row();
    }
    slice.shrink();
    slice
}

#[cfg(test)]
mod tests {
    use super::super::{Border, ExtractOptions, Method, extract, extract_octree};
    use super::*;
    use crate::mesh::Mesh;
    use crate::mesh::chance::Chance;
    use crate::octree::crossings::Sample;
    use crate::progress::Silent;

    /// Random signs in a part of a cube of 32 cells, with random crossings.
    fn random() -> SignedOctree {
        let mut signs = Vec::new();
        for i in 0..64u32 {
            let at = [i >> 4, i >> 2 & 3, i & 3];
            let mut chance = Chance(u64::from(i));
            let mut plane = Plane::EMPTY;
            for local in (0..512).map(Local::from_index) {
                let [x, y, z] = local.coords();
                let on_root = (0..3).any(|a| 8 * at[a] + [x, y, z][a] == 0);
                if !on_root && at[1] != 2 && chance.unit() < 0.4 {
                    plane.set(local);
                }
            }
            signs.push((Key::cell(2, at).unwrap(), plane));
        }
        signs.sort_unstable_by_key(|(key, _)| *key);
        SignedOctree::from_signs(
            5,
            true,
            &signs,
            |_| false,
            |i, crossed, samples| {
                let mut chance = Chance(1000 + i as u64);
                let mut number = || (65536.0 * chance.unit()) as u16;
                (0..crossed.iter().map(Plane::count).sum()).for_each(|_| samples.push(Sample::new(number(), number())));
            },
        )
    }

    /// Both walkers find the same, in every method, and it is closed.
    #[test]
    fn bricks_are_as_the_dense_walker_sees_them() {
        let octree = random();
        let frame = Frame::new(DVec3::new(1.0, 2.0, 3.0), 16.0, 5).unwrap();
        for method in [
            Method::MarchingCubes,
            Method::Trilinear,
            Method::ExtendedMarchingCubes,
            Method::DualContouring,
            Method::SurfaceNets,
        ] {
            let options = ExtractOptions { method, ..ExtractOptions::default() };
            let (mut sparse, mut dense) = (Mesh::default(), Mesh::default());
            extract_octree(&octree, &frame, &options, &mut sparse, &Silent).unwrap();
            let placement = Bricks::placement(&frame);
            let options = ExtractOptions { placement, border: Border::Open, ..options };
            extract(&Bricks::new(&octree), &options, &mut dense, &Silent).unwrap();
            assert!(sparse == dense, "{method:?}");
            assert_eq!((sparse.validate(), sparse.report().zero_area_faces), (Ok(()), 0), "{method:?}");
            assert!(sparse.outward() && sparse.faces.len() > 1000);
        }
    }
}
