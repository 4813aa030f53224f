//! Where the surface crosses edges, as far as the file says.

use super::dcf::Hermite;
use super::decode::Divided;
use super::pad::LEVELS;
use crate::geom::Frame;
use crate::geom::normal::NormalCode;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Corner, Edge, Extent, Key};
use crate::octree::crossings::{Sample, finest_element, lattice_point, toward};
use crate::octree::segments::Segments;
use crate::octree::{SignedOctree, StoredPoints};
use glam::DVec3;

/// A crossing of which nothing is known.
const HALF_WAY: Sample = Sample { offset: 1 << 15, normal: 0 };

/// The samples of DCF, brick by brick: 4 bytes a crossing and 8 a brick.
#[derive(Default)]
pub(super) struct Hermites {
    samples: Segments<Sample, 14>,
    /// For each brick, where its samples end.
    ends: Vec<usize>,
    /// Crossings without a sample.
    pub(super) missing: u64,
}

impl Hermites {
    /// Appends a brick, of which each leaf has the samples of its edges. The cell that starts where an edge does has the word.
    pub(super) fn push(&mut self, brick: &Divided, leaves: &Plane, data: &[[Option<Hermite>; 12]; 512]) {
        for (axis, plane) in Axis::ALL.into_iter().zip(brick.crossed()) {
            for edge in plane.iter() {
                let given = data[edge.index() as usize][4 * axis.index()].filter(|_| leaves.get(edge));
                self.missing += u64::from(given.is_none());
                self.samples.push(given.map_or(Sample { normal: straight(axis), ..HALF_WAY }, |h| sample(axis, h)));
            }
        }
        self.ends.push(self.samples.len());
    }

    /// Pushes the samples of brick number `i`, in order.
    pub(super) fn of_brick(&self, i: usize, samples: &mut Vec<Sample>) {
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        samples.extend_from_slice(&self.samples.slice(start..self.ends[i]));
    }
}

fn sample(axis: Axis, Hermite { offset, normal }: Hermite) -> Sample {
    // Offsets of 1 and more are cut off at 65535.
    Sample::new((offset * 65536.0) as u16, code(axis, DVec3::from(normal.map(f64::from))))
}

fn code(axis: Axis, normal: DVec3) -> u16 {
    if normal == DVec3::ZERO { straight(axis) } else { NormalCode::encode(axis, normal.to_array()).0 }
}

/// A normal along the edge.
fn straight(axis: Axis) -> u16 {
    NormalCode::encode(axis, DVec3::AXES[axis.index()].to_array()).0
}

/// A plane whose normal is nearer than this to a right angle with an edge (as sine) crosses it nowhere in particular.
const PARALLEL: f64 = 1e-3;

/// Cells a side of the table of points: a brick and the layer before it.
const SIDE: usize = 9;
/// Entries before that of a cell for one step along each axis.
const STEP: [usize; 3] = [SIDE * SIDE, SIDE, 1];

/// The points of the cells of a brick and of those before it along one axis or two; not numbers where there is none.
fn points_round(points: &StoredPoints, brick: Key) -> [[f32; 3]; SIDE.pow(3)] {
    /// The bits of a word in the last layer.
    const LAST: [u64; 3] = [!0, 0xff << 56, 0x8080_8080_8080_8080];
    let mut table = [[f32::NAN; 3]; SIDE.pow(3)];
    for before in Corner::ALL.into_iter().filter(|&corner| corner != Corner::MAX) {
        let steps = Axis::ALL.map(|a| -i32::from(before & a));
        let found = if before == Corner::MIN { Some(brick) } else { brick.toward(toward(steps)) };
        let Some(found) = found.and_then(|key| points.of_brick(key)) else { continue };
        let layer = |axis: Axis| if before & axis { LAST[axis.index()] } else { !0 };
        let select = |x| if before & Axis::X && x < 7 { 0 } else { layer(Axis::Y) & layer(Axis::Z) };
        found.for_selected(select, |cell, point| {
            // A neighbour's last cell stands at 0, the brick's first at 1.
            let c = cell.coords();
            let at: usize = Axis::ALL
                .map(|a| if before & a { 0 } else { (c[a.index()] as usize + 1) * STEP[a.index()] })
                .iter()
                .sum();
            table[at] = point;
        });
    }
    table
}

/// Pushes the samples of a brick's crossings, from the points of the four cells around each: the edge is cut by the plane through their mean with
/// the cross product of their diagonals as normal.
pub(super) fn from_points(points: &StoredPoints, frame: &Frame, brick: &Divided, samples: &mut Vec<Sample>) {
    let origin = lattice_point(frame.depth(), brick.key);
    let table = points_round(points, brick.key);
    let cells_a_unit = 1.0 / frame.cell_size();
    for (axis, plane) in Axis::ALL.into_iter().zip(brick.crossed()) {
        let [u, v] = axis.others().map(|a| STEP[a.index()]);
        for edge in plane.iter() {
            let start = edge.coords();
            let model = frame.to_model(DVec3::from(std::array::from_fn(|a| f64::from(origin[a] + start[a]))));
            let here: usize = (0..3).map(|a| (start[a] as usize + 1) * STEP[a]).sum();
            // Counter-clockwise round the edge.
            let around = [0, u, u + v, v].map(|back| {
                let point = table[here - back];
                (DVec3::from(point.map(f64::from)) - model) * cells_a_unit
            });
            samples.push(if around.iter().any(|p| p.is_nan()) {
                Sample { normal: straight(axis), ..HALF_WAY }
            } else {
                cut(axis, around)
            });
        }
    }
}

/// Where the edge along `axis` from the origin meets the plane of four points.
fn cut(axis: Axis, [a, b, c, d]: [DVec3; 4]) -> Sample {
    let mean = 0.25 * (a + b + c + d);
    let normal = (c - a).cross(d - b);
    let along = normal[axis.index()];
    let (at, normal) = if along.abs() > PARALLEL * normal.length() {
        (mean.dot(normal) / along, code(axis, normal))
    } else {
        (mean[axis.index()], straight(axis))
    };
    // Numbers below 0 become 0.
    Sample::new((at * 65536.0) as u16, normal)
}

/// Pushes the samples of a brick of which nothing is known.
pub(super) fn half_way(brick: &Divided, samples: &mut Vec<Sample>) {
    for (axis, plane) in Axis::ALL.into_iter().zip(brick.crossed()) {
        samples.extend(plane.iter().map(|_| Sample { normal: straight(axis), ..HALF_WAY }));
    }
}

/// Pushes the samples of a brick beside the file's cube, which is so many cells wide in the middle of a larger one: the solid ends where the
/// cube does. Of other crossings nothing is known.
pub(super) fn at_sides(depth: u32, cells: u32, brick: &Divided, samples: &mut Vec<Sample>) {
    let origin = lattice_point(depth, brick.key);
    let side = 1 << (depth - LEVELS);
    for (axis, plane) in Axis::ALL.into_iter().zip(brick.crossed()) {
        for edge in plane.iter() {
            let offset = match origin[axis.index()] + edge.coords()[axis.index()] {
                start if start + 1 == side => u16::MAX,
                start if start == side + cells => 0,
                _ => HALF_WAY.offset,
            };
            samples.push(Sample::new(offset, straight(axis)));
        }
    }
}

/// Points for all mixed cells of an octree: those that are there, and for others the mean of the crossings of their edges.
pub(super) fn completed(points: &StoredPoints, octree: &SignedOctree, frame: &Frame) -> StoredPoints {
    let crossings = octree.crossings();
    let mut all = StoredPoints::default();
    for (i, brick) in crossings.bricks().iter().enumerate() {
        let (mixed, stored) = (octree.mixed_cells(i), points.of_brick(brick.key));
        if mixed.is_empty() {
            continue;
        }
        let origin = crossings.origin(brick);
        let mean = |cell: Local| {
            let c = cell.coords();
            let (mut sum, mut count) = (DVec3::ZERO, 0.0);
            for edge in Edge::ALL {
                let (start, axis) = (edge.corners()[0], edge.axis());
                let at = Axis::ALL.map(|a| origin[a.index()] + c[a.index()] + u32::from(start.is_high(a)));
                let inside = at.iter().all(|&c| c >> crossings.depth() == 0);
                let key = inside.then(|| finest_element(crossings.depth(), at, Extent::from(axis)));
                if let Some(sample) = key.and_then(|key| crossings.sample(key)) {
                    sum += DVec3::from(at.map(f64::from)) + DVec3::AXES[axis.index()] * sample.position();
                    count += 1.0;
                }
            }
            frame.to_model(sum / count).as_vec3().to_array()
        };
        let of_cell = |cell| stored.and_then(|stored| stored.get(cell)).unwrap_or_else(|| mean(cell));
        let list: Vec<[f32; 3]> = mixed.iter().map(of_cell).collect();
        all.push(brick.key, mixed, &list);
    }
    all
}
