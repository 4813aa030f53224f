//! Irregular sheets of dual surfaces: the polygons that no crossed edge has.
//!
//! A sheet that is a tunnel, or passes twice through a face of its cell, has a vertex for each of its inside corners
//! ([`grid::cases`](crate::grid::cases)): there the surface of the grid of element centres is used as it is, which has two more kinds of
//! polygons, beside an inside edge (across a face that is not inside) and on an inside face. They collapse in all other cells.

use super::layout::Layout;
use crate::grid::cases::{CASES, Mask};
use crate::grid::{Axis, Corner, Edge, Face};
use glam::DVec3;

impl Layout<'_> {
    /// The polygons beside inside edges and on inside faces of irregular cells, each with its brick.
    pub(super) fn extra_polygons(&self) -> Vec<(usize, Vec<u32>)> {
        let mut polygons = Vec::new();
        for (i, brick) in self.octree.crossings().bricks().iter().enumerate() {
            let origin = self.octree.crossings().origin(brick);
            for knot in self.knots_of(i).iter().filter(|k| !CASES[usize::from(k.mask)].sheets.all_regular()) {
                let c = knot.cell.coords();
                let at = std::array::from_fn(|a| origin[a] + c[a]);
                polygons.extend(self.polygons_of_knot(at, knot.mask).into_iter().map(|p| (i, p)));
            }
        }
        polygons
    }

    fn polygons_of_knot(&self, at: [u32; 3], mask: Mask) -> Vec<Vec<u32>> {
        let sheets = &CASES[usize::from(mask)].sheets;
        let irregular = |c: Corner| mask >> c.index() & 1 == 1 && !sheets.is_regular(sheets.sheet[c.index()]);
        let face_is_inside = |face: Face| face.corners().iter().all(|c| mask >> c.index() & 1 == 1);
        let mut polygons = Vec::new();
        for edge in Edge::ALL {
            let [p, q] = edge.corners();
            if !(irregular(p) && irregular(q)) {
                continue;
            }
            for face in edge.faces().into_iter().filter(|&f| !face_is_inside(f)) {
                // The cell across the face sees the two corners on its other side.
                let mut beyond = at;
                let a = face.axis().index();
                beyond[a] = if face.is_high() { at[a] + 1 } else { at[a] - 1 };
                let (p2, q2) = (p ^ face.axis(), q ^ face.axis());
                let (vp, vq) = (self.vertex(beyond, p2), self.vertex(beyond, q2));
                // If it is irregular as well, it finds the same polygon.
                if vp != vq && !face.is_high() {
                    continue;
                }
                let corners = [(at, p), (at, q), (beyond, q2), (beyond, p2)];
                // The solid ends at the edge: outward is into the face.
                let outward = middle(&face.corners().map(|c| point(at, c))) - middle(&[point(at, p), point(at, q)]);
                let mut polygon = self.oriented(&corners, outward);
                polygon.dedup();
                if polygon.first() == polygon.last() {
                    polygon.pop();
                }
                polygons.push(polygon);
            }
        }
        for face in Face::ALL.into_iter().filter(|&f| face_is_inside(f) && irregular(f.corners()[0])) {
            let ring = face.corners();
            let corners = ring.map(|c| (at, c));
            let outward = centre(at) - middle(&ring.map(|c| point(at, c)));
            polygons.push(self.oriented(&corners, outward));
        }
        polygons
    }

    /// The vertices of a polygon, in the order in which its normal points outward. Vertices are taken to lie half way between their
    /// corner and the centre of their cell.
    fn oriented(&self, corners: &[([u32; 3], Corner); 4], outward: DVec3) -> Vec<u32> {
        let p = corners.map(|(at, c)| middle(&[point(at, c), centre(at)]));
        let normal = (p[2] - p[0]).cross(p[3] - p[1]);
        let mut polygon: Vec<u32> = corners.iter().map(|&(at, c)| self.vertex(at, c)).collect();
        if normal.dot(outward) < 0.0 {
            polygon.reverse();
        }
        polygon
    }
}

fn point(cell: [u32; 3], corner: Corner) -> DVec3 {
    DVec3::from(Axis::ALL.map(|a| f64::from(cell[a.index()] + u32::from(corner & a))))
}

fn centre(cell: [u32; 3]) -> DVec3 {
    DVec3::from(cell.map(|c| f64::from(c) + 0.5))
}

fn middle(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len() as f64
}
