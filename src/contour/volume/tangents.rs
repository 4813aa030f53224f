//! Crossings with their tangent planes, and where the vertex of a polygon goes.

use super::lattice::{Lattice, place};
use super::slice::Slice;
use crate::geom::qef::Qef;
use crate::grid::brick::Bits;
use crate::grid::{Axis, Edge};
use crate::volume::Volume;
use glam::{DVec3, Mat3A, Vec3A};

/// A crossing of an edge.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tangent {
    /// Where on the edge.
    t: f32,
    /// Of the tangent plane, on the lattice: scaled so that it measures distances in the model, in units of the mean spacing.
    normal: [f32; 3],
}

/// The crossings round a layer of cells: those of two slices.
#[derive(Default)]
pub(super) struct Tangents {
    slices: [(Option<usize>, Vec<Tangent>); 2],
}

impl Tangents {
    /// Those of the slices `z` and `z + 1`. What is known of one of them already is kept.
    pub(super) fn fill<V: Volume>(&mut self, lattice: &Lattice<'_, V>, slices: &[Slice], z: usize, with_normals: bool) {
        if self.slices[1].0 == Some(z) {
            self.slices.swap(0, 1);
        }
        for (side, (known, tangents)) in self.slices.iter_mut().enumerate() {
            let z = z + side;
            if *known != Some(z) {
                tangents.clear();
                slices.get(z).iter().for_each(|slice| tangents_of(lattice, slice, z, with_normals, tangents));
                *known = Some(z);
            }
        }
    }

    /// Number of crossings in the first of both slices.
    pub(super) fn first(&self) -> u32 {
        self.slices[0].1.len() as u32
    }

    /// The crossing with a number: those of the second slice come after those of the first.
    #[inline]
    pub(super) fn get(&self, number: u32) -> Tangent {
        let [(_, here), (_, next)] = &self.slices;
        let number = number as usize;
        here.get(number).copied().unwrap_or_else(|| next[number - here.len()])
    }
}

fn tangents_of<V: Volume>(
    lattice: &Lattice<'_, V>,
    slice: &Slice,
    z: usize,
    with_normals: bool,
    tangents: &mut Vec<Tangent>,
) {
    for y in 0..slice.rows() {
        for word in slice.row(y) {
            for axis in Axis::ALL {
                for x in Bits(word.crossed[axis.index()]) {
                    let at = [64 * word.x as usize + x as usize, y, z];
                    let t = lattice.crossing(at, axis);
                    let normal = if with_normals { lattice.normal(at, axis, t).as_vec3().to_array() } else { [0.0; 3] };
                    tangents.push(Tangent { t: t as f32, normal });
                }
            }
        }
    }
}

impl<V: Volume> Lattice<'_, V> {
    /// The outward normal of the surface on an edge, of the scale that [`Tangent`] has. Where the volume knows no gradient it is along the
    /// edge.
    fn normal(&self, at: [usize; 3], axis: Axis, t: f64) -> DVec3 {
        let along = DVec3::AXES[axis.index()];
        let mut to = at;
        to[axis.index()] += 1;
        let gradient = match (self.sample(at), self.sample(to)) {
            (Some(at), Some(_)) => self.volume.gradient(place(at) + t * along),
            // Out of the border.
            (Some(_), None) if !self.level.below => -along,
            (Some(_), None) => along,
            _ if self.level.below => -along,
            _ => along,
        };
        let gradient =
            if gradient.is_finite() && gradient != DVec3::ZERO { gradient } else { self.difference(at, to) * along };
        // Scaled first: squares of tiny numbers vanish.
        let outward = gradient / if self.level.below { 1.0 } else { -1.0 } / gradient.abs().max_element();
        let length = (self.covector * outward).length();
        outward * (self.covector.determinant().abs().cbrt() / length)
    }

    /// The sign of what a field without gradient does from one lattice point to the next.
    fn difference(&self, at: [usize; 3], to: [usize; 3]) -> f64 {
        let starts_inside = self.depth(at) > self.depth(to);
        if starts_inside == self.level.below { 1.0 } else { -1.0 }
    }

    /// From normals on the lattice, of the scale that [`Tangent`] has, to unit normals in the model.
    pub(super) fn unit_normals(&self) -> Mat3A {
        let scale = self.covector.determinant().abs().cbrt();
        Mat3A::from((self.covector * (1.0 / scale)).as_mat3())
    }
}

/// The tangent planes of a polygon, in coordinates of its cell.
#[derive(Default)]
pub(super) struct Planes {
    /// Point and normal on the lattice.
    pub(super) list: Vec<(Vec3A, Vec3A)>,
    /// Unit normals in the model.
    pub(super) units: Vec<Vec3A>,
}

impl Planes {
    /// Those of a polygon's edges, given the crossing of each.
    pub(super) fn fill(&mut self, polygon: &[Edge], crossing: impl Fn(Edge) -> Tangent, to_unit: &Mat3A) {
        self.list.clear();
        self.units.clear();
        for &edge in polygon {
            let Tangent { t, normal } = crossing(edge);
            let [low, _] = edge.corners();
            let corner = Vec3A::from(Axis::ALL.map(|axis| f32::from(u8::from(low & axis))));
            let normal = Vec3A::from(normal);
            self.list.push((corner + t * Vec3A::AXES[edge.axis().index()], normal));
            self.units.push(*to_unit * normal);
        }
    }

    /// The mean of the points.
    fn mass_point(&self) -> Vec3A {
        self.list.iter().map(|(point, _)| *point).sum::<Vec3A>() / self.list.len() as f32
    }

    /// The mean of the points, away from the sides of the cell.
    pub(super) fn middle(&self) -> Vec3A {
        self.mass_point().clamp(LOW, HIGH)
    }

    /// Whether the triangles of the polygon's fan round a place have an area: a height of two steps of vertices in cells. In the cell they
    /// always have.
    pub(super) fn has_fan(&self, apex: Vec3A) -> bool {
        let n = self.list.len();
        (0..n).all(|i| {
            let (a, b) = (self.list[i].0 - apex, self.list[(i + 1) % n].0 - apex);
            let longest = a.length().max(b.length()).max((b - a).length());
            a.cross(b).length() > longest / 8192.0
        })
    }

    /// Square of the length of the mean unit normal: 1 on a flat piece, 1/2 at a crease of 90 degrees.
    fn flatness(&self) -> f32 {
        let mean = self.units.iter().sum::<Vec3A>() / self.units.len() as f32;
        mean.length_squared()
    }

    /// Where the vertex of the polygon goes for dual contouring, and whether there is a crease or corner. Polygons that are not alone in
    /// their cell may look for the same place: each stays a little apart.
    pub(super) fn solve(&self, is_alone: bool) -> (Vec3A, bool) {
        let (place, is_creased) = self.solve_alone();
        (if is_alone { place } else { self.apart(place) }, is_creased)
    }

    /// The place drawn to the polygon a little.
    pub(super) fn apart(&self, place: Vec3A) -> Vec3A {
        place.lerp(self.middle(), APART)
    }

    fn solve_alone(&self) -> (Vec3A, bool) {
        let flatness = self.flatness();
        if flatness >= FLAT {
            return (self.middle(), false);
        }
        let mut sum = Qef::EMPTY;
        self.list.iter().for_each(|&(point, normal)| sum += &Qef::of_plane(point, normal));
        let is_creased = flatness < CREASED;
        (within_reach(&sum, sum.minimiser(), is_creased), is_creased)
    }
}

/// The minimiser of a quadratic error function, if it may be used as it is; else the best place in the cell. It may leave the cell by up to a cell
/// if all planes meet there: that keeps creases that bulge into the next cell, see [`crease`](crate::contour).
pub(super) fn within_reach(sum: &Qef, free: Vec3A, is_creased: bool) -> Vec3A {
    if free.cmpge(LOW).all() && free.cmple(HIGH).all() {
        return free;
    }
    let is_near = free.cmpge(Vec3A::splat(-REACH)).all() && free.cmple(Vec3A::splat(1.0 + REACH)).all();
    if is_creased && is_near && sum.mean_square(free) < SHARP {
        // Up to four cells may look for the same point: each stays a little apart.
        return free.lerp(sum.mass_point(), APART);
    }
    within_cell(sum)
}

/// The best place in the cell.
pub(super) fn within_cell(sum: &Qef) -> Vec3A {
    let inside = sum.minimiser_within(LOW, HIGH);
    if inside.is_finite() { inside } else { sum.mass_point().clamp(LOW, HIGH) }
}

/// Vertices keep a thousandth of a cell from the sides of their cell.
const LOW: Vec3A = Vec3A::splat(1.0 / 1024.0);
const HIGH: Vec3A = Vec3A::splat(1.0 - 1.0 / 1024.0);

/// How far from its cell a vertex may be, in cells along each axis.
const REACH: f32 = 0.95;

/// How far a vertex that leaves its cell is drawn to its mass point.
const APART: f32 = 1.0 / 64.0;

/// From this square of the length of the mean normal on, a piece is flat: differences of 16-bit samples make normals wrong by half a degree.
const FLAT: f32 = 0.9999;

/// Below this square of the length of the mean normal there is a crease: two planes at 30 degrees have cos^2(15) = 0.933.
const CREASED: f32 = 0.933;

/// The planes meet in a point if the mean square of its distances from them is less, in squared cells: as for octrees.
const SHARP: f32 = 0.025 * 0.025;
