//! The corners of all faces at each point: enough to see every edge and every fan, without a table of edges.

use super::corners::Corners;

/// A corner of a face, seen from its point.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Corner {
    /// The point before it in the face.
    pub(super) prev: u32,
    /// The point after it.
    pub(super) next: u32,
    /// The face.
    pub(super) face: u32,
}

/// One point's corners and the edges there. Made once and moved from point to point.
#[derive(Default)]
pub(super) struct Star {
    /// The point.
    pub(super) point: u32,
    /// The corners there.
    pub(super) corners: Vec<Corner>,
    /// Each side of a corner: the point at its other end in the upper half; then the corner's number, and 1 in the lowest
    /// bit if the side leaves the point. Sorted, so that the users of an edge are neighbours.
    sides: Vec<u64>,
    /// Links of a union-find over the corners.
    links: Vec<u32>,
}

impl Star {
    /// Moves to another point. Sides that lead from a point to itself are left out.
    pub(super) fn visit(&mut self, corners: &Corners<'_>, point: u32) {
        self.point = point;
        self.corners.clear();
        self.corners.extend(corners.at(point).iter().map(|&corner| Corner {
            prev: corners.point(corners.prev(corner)),
            next: corners.point(corners.next(corner)),
            face: corners.face(corner),
        }));
        self.sides.clear();
        for (corner, i) in self.corners.iter().zip(0u64..) {
            let side = |other: u32, leaves: u64| (u64::from(other) << 32) | (i << 1) | leaves;
            let sides = [(corner.prev, 0), (corner.next, 1)].into_iter().filter(|&(other, _)| other != point);
            self.sides.extend(sides.map(|(other, leaves)| side(other, leaves)));
        }
        self.sides.sort_unstable();
    }

    /// The edges at the point, by the index of their other end.
    pub(super) fn edges(&self) -> impl Iterator<Item = Edge<'_>> {
        self.sides.chunk_by(|a, b| a >> 32 == b >> 32).map(|sides| Edge { sides, corners: &self.corners })
    }

    /// Number of fans. Corners without sides, of faces that stay at their point, are none of their own.
    pub(super) fn fans(&mut self) -> u32 {
        let links = &mut self.links;
        let root = |mut i: u32, links: &mut Vec<u32>| {
            while links[i as usize] != i {
                links[i as usize] = links[links[i as usize] as usize];
                i = links[i as usize];
            }
            i
        };
        links.clear();
        links.extend(0..self.corners.len() as u32);
        let sideless = self.corners.iter().filter(|c| c.prev == self.point && c.next == self.point).count();
        let mut fans = (self.corners.len() - sideless) as u32;
        for pair in self.sides.windows(2).filter(|pair| pair[0] >> 32 == pair[1] >> 32) {
            let (a, b) = (root(pair[0] as u32 >> 1, links), root(pair[1] as u32 >> 1, links));
            links[a.max(b) as usize] = a.min(b);
            fans -= u32::from(a != b);
        }
        fans.max(u32::from(!self.corners.is_empty()))
    }
}

/// An edge seen from one of its ends.
pub(super) struct Edge<'a> {
    sides: &'a [u64],
    corners: &'a [Corner],
}

impl Edge<'_> {
    /// The point at the other end.
    pub(super) fn other(&self) -> u32 {
        (self.sides[0] >> 32) as u32
    }

    /// How often faces run along the edge.
    pub(super) fn users(&self) -> u32 {
        self.sides.len() as u32
    }

    /// How many of them run towards the other end.
    pub(super) fn outgoing(&self) -> u32 {
        self.sides.iter().map(|side| *side as u32 & 1).sum()
    }

    /// The faces that run along the edge.
    pub(super) fn faces(&self) -> impl Iterator<Item = u32> {
        self.sides.iter().map(|side| self.corners[(*side as u32 >> 1) as usize].face)
    }
}

/// A point that a polygon visits twice, if any.
pub(super) fn repeated(polygon: &[u32]) -> Option<u32> {
    if polygon.len() <= 16 {
        return (1..polygon.len())
            .map(|k| polygon[k])
            .zip(1..)
            .find_map(|(v, k)| polygon[..k].contains(&v).then_some(v));
    }
    let mut sorted = polygon.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use glam::DVec3;

    #[test]
    fn a_star_shows_edges_and_fans() {
        // Two triangles share edge 0-1, a third one touches them in point 0, a fourth is not sound.
        let faces: [&[u32]; 4] = [&[0, 1, 2], &[1, 0, 3], &[0, 4, 5], &[0, 9, 1]];
        let mesh = Mesh { points: vec![DVec3::ZERO; 6], faces: faces.into_iter().collect() };
        let corners = Corners::new(&mesh);
        let mut star = Star::default();
        star.visit(&corners, 0);
        assert_eq!(star.fans(), 2);
        let edges: Vec<_> = star.edges().map(|e| (e.other(), e.users(), e.outgoing())).collect();
        assert_eq!(edges, [(1, 2, 1), (2, 1, 0), (3, 1, 1), (4, 1, 1), (5, 1, 0)]);
        assert_eq!(star.edges().next().unwrap().faces().collect::<Vec<_>>(), [0, 1]);
        star.visit(&corners, 1);
        assert_eq!((star.fans(), star.corners.len()), (1, 2));
    }

    #[test]
    fn faces_that_stay_at_a_point_are_no_fans() {
        let faces: [&[u32]; 3] = [&[1, 1, 1], &[0, 0, 0], &[0, 2, 3]];
        let mesh = Mesh { points: vec![DVec3::ZERO; 5], faces: faces.into_iter().collect() };
        let corners = Corners::new(&mesh);
        let mut star = Star::default();
        let fans: Vec<u32> = (0..5)
            .map(|point| {
                star.visit(&corners, point);
                star.fans()
            })
            .collect();
        assert_eq!(fans, [1, 1, 1, 1, 0]);
        assert_eq!(mesh.report().non_manifold_vertices, 0);
    }

    #[test]
    fn repeated_points_are_found_in_small_and_large_polygons() {
        let mut polygon: Vec<u32> = (0..40).collect();
        assert_eq!((repeated(&polygon), repeated(&polygon[..9]), repeated(&[])), (None, None, None));
        polygon[39] = 7;
        assert_eq!((repeated(&polygon), repeated(&[4, 5, 6, 5])), (Some(7), Some(5)));
    }
}
