//! Dual contouring (Ju, Losasso, Schaefer and Warren 2002) and surface nets (Gibson 1998), manifold for any signs.
//!
//! Each [polygon](super::polygons) has a vertex: at the mean of its crossings (nets), or where its tangent planes meet. Each crossed edge
//! has a face between the vertices of the polygons round it: a quadrilateral, but for cells whose cycles are cut, where it has more corners. So
//! components and their genus are those of marching cubes.
//!
//! # No face without area
//!
//! Vertices in four cells round an edge are never all on one line, and if three of them are, the diagonal that cuts between these is the
//! right one. So of the two ways to cut a quadrilateral one is good, and vertices are stored so that this can be told exactly. Of two good
//! ways the one along a crease is taken, or else the one whose smaller triangle is the greater. Vertices that leave their cells, or share one,
//! have no such law: they are moved by some ten-thousandths of a cell where they must.

use super::cell_points::{CellPoint, Kind, STEPS, place_all};
use super::lattice::Lattice;
use super::polygons::{self, Polygons};
use super::rows::{CELLS, CellRows, Seen};
use super::run::{Extractor, in_parallel};
use super::slice::{Slice, bytes};
use super::tangents::Planes;
use crate::error::Result;
use crate::grid::brick::Bits;
use crate::grid::{Axis, Edge};
use crate::mesh::chance::Chance;
use crate::progress::Progress;
use crate::volume::Volume;
use glam::{DVec3, I64Vec3};
use std::sync::LazyLock;

/// The polygons of all masks, none of which passes through a face twice.
static POLYGONS: LazyLock<Vec<Polygons>> = LazyLock::new(|| polygons::all(true));

/// Those of materials.
static CAPPED: LazyLock<Vec<Polygons>> = LazyLock::new(|| polygons::all(false));

/// How often vertices are moved at most. Faces without area are as rare as coincidences: none has been seen that was left after two rounds.
const ROUNDS: u64 = 8;

/// Dual surfaces over the slices of a lattice.
pub(super) struct Dual<'a, V> {
    lattice: &'a Lattice<'a, V>,
    slices: &'a [Slice],
    /// For each slice, the vertices of its polygons.
    points: Vec<Vec<CellPoint>>,
    polygons: &'static [Polygons],
}

impl<'a, V: Volume> Dual<'a, V> {
    /// Places all vertices: where tangent planes meet if features shall be `sharp`, or else in the middle of crossings.
    pub(super) fn new(
        lattice: &'a Lattice<'a, V>,
        slices: &'a [Slice],
        sharp: bool,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let polygons: &'static [Polygons] = if lattice.volume.has_materials() { &CAPPED } else { &POLYGONS };
        let of_mask = |mask| &polygons[usize::from(mask)].list[..];
        let points = if sharp {
            let solve = |planes: &Planes, _, is_alone| {
                let (place, is_creased) = planes.solve(is_alone);
                CellPoint::new(place, if is_creased { Kind::Sharp } else { Kind::Smooth })
            };
            place_all(lattice, slices, of_mask, true, solve, progress)?
        } else {
            let solve = |planes: &Planes, cell, is_alone| {
                let place = if lattice.volume.has_materials() {
                    let place = lattice.between_materials(cell).as_vec3a();
                    if is_alone { place } else { planes.apart(place) }
                } else {
                    planes.middle()
                };
                CellPoint::new(place, Kind::Smooth)
            };
            place_all(lattice, slices, of_mask, false, solve, progress)?
        };
        progress.hold(bytes(slices) + super::cell_points::bytes(&points))?;
        let mut dual = Dual { lattice, slices, points, polygons };
        if sharp {
            dual.separate(progress)?;
        }
        Ok(dual)
    }

    /// Moves vertices a little until no face has to be cut into triangles without area. Only faces need a look that have vertices that left
    /// their cell, or several in one.
    fn separate(&mut self, progress: &dyn Progress) -> Result<()> {
        for round in 0..ROUNDS {
            let flat = in_parallel(self.slices.len(), progress, || self.scratch(), |rows, z| self.flat_faces(rows, z))?;
            let mut places: Vec<(usize, u32)> = flat.into_iter().flatten().collect();
            places.sort_unstable();
            places.dedup();
            if places.is_empty() {
                break;
            }
            for (z, number) in places {
                let mut chance = Chance((z as u64) << 40 ^ u64::from(number) << 8 ^ round);
                self.points[z][number as usize].nudge(&mut chance);
            }
        }
        Ok(())
    }

    /// The slices and numbers of the vertices of faces that cannot be cut well.
    fn flat_faces(&self, rows: &mut CellRows, z: usize) -> Vec<(usize, u32)> {
        let mut flat = Vec::new();
        let (mut face, mut corners) = (Vec::new(), Vec::new());
        let place = |back: [usize; 3], number: u32| (z - back[2], number);
        self.faces(rows, z, |cells| {
            let is_safe = |&(back, seen, _): &([usize; 3], Seen, Edge)| {
                let (z, number) = place(back, seen.first);
                self.is_single(seen) && self.points[z][number as usize].is_at_home()
            };
            if cells.iter().all(is_safe) {
                return;
            }
            self.face_of(&cells, z, [0; 2], &mut face);
            // Corners as numbers in the face.
            face.iter_mut().zip(0..).for_each(|(vertex, i)| vertex.number = i);
            corners.clear();
            cut(&face, &mut corners);
            let has_area = |t: &[u32; 3]| area(t.map(|i| &face[i as usize])) > 0.0;
            if !corners.as_chunks::<3>().0.iter().all(has_area) {
                flat.extend(cells.iter().flat_map(|&(back, seen, edge)| {
                    let around = &self.polygons[usize::from(seen.mask)].around[edge.index()];
                    around.iter().map(move |&i| place(back, seen.first + u32::from(i)))
                }));
            }
        });
        flat
    }

    /// The corners of a face of slice `z`, numbered from the first numbers of the slice before and this one on.
    #[inline]
    fn face_of(&self, cells: &[([usize; 3], Seen, Edge); 4], z: usize, firsts: [u32; 2], face: &mut Vec<Vertex>) {
        face.clear();
        for &(back, seen, edge) in cells {
            let around = &self.polygons[usize::from(seen.mask)].around[edge.index()];
            face.extend(around.iter().map(|&i| self.vertex(back, seen.first + u32::from(i), z, firsts)));
        }
    }

    #[inline]
    fn vertex(&self, back: [usize; 3], number: u32, z: usize, firsts: [u32; 2]) -> Vertex {
        let point = self.points[z - back[2]][number as usize];
        let offset = I64Vec3::from(back.map(|c| c as i64)) * STEPS;
        let number = firsts[1 - back[2]] + number;
        Vertex { number, at: point.steps() - offset, is_sharp: point.kind == Kind::Sharp }
    }

    /// Calls `each` with the faces of slice `z`: for each crossed edge that has all its cells, the cells round it, counter-clockwise seen
    /// from outside, as offsets from the edge's own, what is in them, and which of their edges it is.
    #[inline]
    fn faces(&self, rows: &mut CellRows, z: usize, mut each: impl FnMut([([usize; 3], Seen, Edge); 4])) {
        let before = z.checked_sub(1).map(|z| &self.slices[z]);
        rows.restart();
        for y in 0..self.slices[z].rows() {
            rows.advance([before, Some(&self.slices[z])], y, |mask| self.polygons[usize::from(mask)].list.len() as u32);
            for word in self.slices[z].row(y) {
                for axis in Axis::ALL {
                    let edges = word.crossed[axis.index()] & rows.complete(axis, word.x as usize);
                    for x in Bits(edges) {
                        let x = 64 * word.x as usize + x as usize;
                        let mut cells =
                            CELLS[axis.index()].map(|(back, row, edge)| (back, rows.at(row, x - back[0]), edge));
                        // The first cell is the edge's own: its least corner is where the edge starts.
                        if cells[0].1.mask & 1 == 0 {
                            cells.swap(1, 3);
                        }
                        each(cells);
                    }
                }
            }
        }
    }

    /// Whether a cell has one polygon.
    fn is_single(&self, seen: Seen) -> bool {
        self.polygons[usize::from(seen.mask)].list.len() == 1
    }

    /// Number of corners of the face of an edge.
    fn corners(&self, cells: &[([usize; 3], Seen, Edge); 4]) -> usize {
        let around =
            |&(_, seen, edge): &(_, Seen, Edge)| self.polygons[usize::from(seen.mask)].around[edge.index()].len();
        cells.iter().map(around).sum()
    }
}

impl<V: Volume> Extractor for Dual<'_, V> {
    type Scratch = CellRows;

    fn scratch(&self) -> CellRows {
        CellRows::new(self.lattice.size[0])
    }

    fn count(&self, rows: &mut CellRows, z: usize) -> [u64; 2] {
        let mut triangles = 0;
        self.faces(rows, z, |cells| triangles += self.corners(&cells) as u64 - 2);
        [self.points[z].len() as u64, triangles]
    }

    fn points(&self, _: &mut CellRows, z: usize, points: &mut Vec<DVec3>) {
        let slice = &self.slices[z];
        let mut masks = slice.masks().iter();
        let mut own = self.points[z].iter();
        for y in 0..slice.rows() {
            for word in slice.row(y) {
                for (x, &mask) in Bits(word.mixed).zip(&mut masks) {
                    let at = [64 * word.x as usize + x as usize, y, z];
                    let of_cell = own.by_ref().take(self.polygons[usize::from(mask)].list.len());
                    points.extend(of_cell.map(|point| self.lattice.to_model(point.place(at))));
                }
            }
        }
    }

    fn triangles(&self, rows: &mut CellRows, z: usize, first: impl Fn(usize) -> u32, corners: &mut Vec<u32>) {
        let firsts = [z.checked_sub(1).map_or(0, &first), first(z)];
        let is_mirrored = self.lattice.is_mirrored();
        let mut face: Vec<Vertex> = Vec::new();
        self.faces(rows, z, |cells| {
            if cells.iter().all(|&(_, seen, _)| self.is_single(seen)) {
                let mut quad = cells.map(|(back, seen, _)| self.vertex(back, seen.first, z, firsts));
                if is_mirrored {
                    quad.swap(1, 3);
                }
                corners.extend(cut_quad(&quad).as_flattened());
                return;
            }
            self.face_of(&cells, z, firsts, &mut face);
            if is_mirrored {
                face.reverse();
            }
            cut(&face, corners);
        });
    }
}

/// A corner of a face.
#[derive(Clone, Copy)]
struct Vertex {
    number: u32,
    /// In steps from the start of the edge.
    at: I64Vec3,
    is_sharp: bool,
}

/// Square of twice the area of a triangle: 0 exactly if it has none.
fn area([a, b, c]: [&Vertex; 3]) -> f64 {
    // Coordinates are less than 2^17 apart, so this is exact.
    (b.at - a.at).cross(c.at - a.at).as_dvec3().length_squared()
}

/// The two triangles of a quadrilateral.
#[inline]
fn cut_quad([a, b, c, d]: &[Vertex; 4]) -> [[u32; 3]; 2] {
    let least = |one: [&Vertex; 3], other: [&Vertex; 3]| area(one).min(area(other));
    let (along_ac, along_bd) = (least([a, b, c], [a, c, d]), least([a, b, d], [b, c, d]));
    let (sharp_ac, sharp_bd) = (a.is_sharp && c.is_sharp, b.is_sharp && d.is_sharp);
    let ac = if sharp_ac == sharp_bd || along_ac.min(along_bd) == 0.0 { along_ac >= along_bd } else { sharp_ac };
    let [a, b, c, d] = [a, b, c, d].map(|vertex| vertex.number);
    if ac { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
}

/// Appends the triangles of any face: of all ways to cut it, that whose smallest triangle is the greatest.
fn cut(face: &[Vertex], corners: &mut Vec<u32>) {
    if let Ok(quad) = face.try_into() {
        return corners.extend(cut_quad(quad).as_flattened());
    }
    let n = face.len();
    // The best way to cut what is between two corners: its smallest triangle, and the corner opposite to the diagonal.
    let mut best = vec![(f64::INFINITY, 0); n * n];
    for (length, i) in (2..n).flat_map(|length| (0..n - length).map(move |i| (length, i))) {
        let j = i + length;
        let ways = (i + 1..j).map(|k| {
            let sides = best[i * n + k].0.min(best[k * n + j].0);
            (sides.min(area([&face[i], &face[k], &face[j]])), k)
        });
        best[i * n + j] = ways.max_by(|a, b| a.0.total_cmp(&b.0)).expect("there is a corner between");
    }
    let mut open = vec![(0, n - 1)];
    while let Some((i, j)) = open.pop().filter(|(i, j)| i + 1 < *j) {
        let k = best[i * n + j].1;
        corners.extend([i, k, j].map(|i| face[i].number));
        open.extend([(i, k), (k, j)].into_iter().filter(|(i, j)| i + 1 < *j));
    }
}
