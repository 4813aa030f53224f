//! The room that belongs to one crossed edge, and whether two triangles keep to it (Ju and Udeshi 2006, "Intersection-free contouring
//! on an octree grid").
//!
//! Let v0 .. v3 be the vertices of the four cells round an edge from p to q, each strictly inside of its cell. The *envelope* of the
//! edge is the union of the four tetrahedra (p, q, v i, v i+1). Two neighbouring cells make up a convex box, so each tetrahedron lies in
//! them, and the segment from v i to v i+1 pierces their common face in its interior. Cut by that face, the tetrahedra of all twelve edges
//! of a cell are the cones from its vertex to the 24 triangles into which the six faces are divided from their piercing points: they
//! fill the cell and have nothing but sides in common. So **envelopes of different edges share only their surfaces**, and those two of
//! them that have a face in common meet in the segment between its vertices.
//!
//! Seen along the edge, v0 .. v3 lie in the four quadrants, in order. Over the polygon between them the envelope is the room below the
//! cone from q and above the cone from p. A triangle of three of the vertices that turns the right way is a function over that
//! polygon too, linear, and touches both cones in its corners. It is between the cones if the line of the edge goes through its *plane*
//! between p and q: that is the sign of two tetrahedra, (triangle, p) and (triangle, q). If this holds for both triangles at a diagonal,
//! they lie in the envelope, and meet its surface only along v0 v1 v2 v3. If it holds at both diagonals, the whole tetrahedron of
//! the four vertices lies there, and with it whatever surface a reader of the quadrilateral sees.
//!
//! The crossing e of the edge sees all four sides, so the four triangles (e, v i, v i+1), one in each tetrahedron, always lie in the
//! envelope.

use glam::{Vec4, Vec4Swizzles};

/// The least share of the edge that stays on both sides of the planes, and the least area (twice, seen along the edge, in
/// squared cells) of triangles. Coordinates are exact and at most 1 in size, so the rounding of the sums here is below 2^-19, and 2^-9 of
/// 2^-8 above it. What is nearer is taken for outside: that costs two triangles more.
const SHARE: f32 = 1.0 / 512.0;
/// See [`SHARE`].
const LEAST_AREA: f32 = 1.0 / 256.0;

/// Which diagonals of a quadrilateral keep to the envelope.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Safe {
    /// That from vertex 0 to vertex 2.
    pub(super) first: bool,
    /// That from vertex 1 to vertex 3.
    pub(super) second: bool,
}

/// Looks at the diagonals of the quadrilateral round an edge. A lane for each vertex, counter-clockwise seen from the edge's end; `w` along
/// the edge, (u, v) to the sides, in cells from its start.
#[inline]
pub(super) fn safe_diagonals(u: Vec4, v: Vec4, w: Vec4) -> Safe {
    // Lane i: the triangle of vertices i, i + 1 and i + 2.
    let (du, dv, dw) = (u.yzwx() - u, v.yzwx() - v, w.yzwx() - w);
    let (eu, ev, ew) = (u.zwxy() - u, v.zwxy() - v, w.zwxy() - w);
    let (nu, nv, nw) = (dv * ew - dw * ev, dw * eu - du * ew, du * ev - dv * eu);
    // The plane meets the edge's line so far from its start, times nw.
    let height = nu * u + nv * v + nw * w;
    let inside = nw.cmpge(Vec4::splat(LEAST_AREA)) & height.cmpge(nw * SHARE) & height.cmple(nw * (1.0 - SHARE));
    let safe = inside.bitmask();
    Safe { first: safe & 0b0101 == 0b0101, second: safe & 0b1010 == 0b1010 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Units of 2^-16 cells: exact in all types.
    type Point = [i128; 3];
    const CELL: i128 = 1 << 16;

    fn volume([a, b, c, d]: [Point; 4]) -> i128 {
        let [p, q, r] = [b, c, d].map(|x| [0, 1, 2].map(|k| x[k] - a[k]));
        p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) + p[2] * (q[0] * r[1] - q[1] * r[0])
    }

    /// The quadrants round an edge along w, as the cells lie.
    fn vertex(i: usize, [u, v, w]: [i128; 3]) -> Point {
        [if i == 1 || i == 2 { u } else { -u }, if i >= 2 { v } else { -v }, w]
    }

    fn lanes(points: [Point; 4]) -> [Vec4; 3] {
        [0, 1, 2].map(|k| Vec4::from_array(points.map(|p| p[k] as f32 / CELL as f32)))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]
        /// What is called safe lies in the envelope: every point of both triangles is in one of the four tetrahedra. As the triangles are
        /// cut by the tetrahedra in flat pieces, and these end at the diagonal's crossing of a wall, exact signs of volumes tell.
        #[test]
        fn safe_triangles_have_the_edge_s_ends_on_both_sides(
            corners in prop::array::uniform4(prop::array::uniform3(64..CELL - 64)),
        ) {
            let p = std::array::from_fn(|i| vertex(i, corners[i]));
            let [u, v, w] = lanes(p);
            let safe = safe_diagonals(u, v, w);
            let sides = |t: [usize; 3]| {
                let [a, b, c] = t.map(|i| p[i]);
                // Positive: the triangle is counter-clockwise seen from there.
                [volume([a, b, c, [0, 0, CELL]]), -volume([a, b, c, [0, 0, 0]]), volume([a, b, c, [a[0], a[1], a[2] + CELL]])]
            };
            for (is_safe, triangles) in [(safe.first, [[0, 1, 2], [2, 3, 0]]), (safe.second, [[1, 2, 3], [3, 0, 1]])] {
                let volumes = triangles.map(sides).concat();
                prop_assert!(!is_safe || volumes.iter().all(|&v| v > 0), "{volumes:?}");
                // Not by refusing everything: what is well inside is taken.
                let well = triangles.map(sides).iter().all(|[up, down, turn]| {
                    turn * 128 > CELL.pow(3) && up * 256 > *turn && down * 256 > *turn
                });
                prop_assert!(is_safe || !well, "{volumes:?}");
            }
        }
    }

    #[test]
    fn flat_quadrilaterals_are_safe_and_folded_ones_are_not() {
        let at = |heights: [f32; 4]| {
            let [u, v] = [Vec4::new(-0.5, 0.5, 0.5, -0.5), Vec4::new(-0.5, -0.5, 0.5, 0.5)];
            safe_diagonals(u, v, Vec4::from_array(heights))
        };
        assert_eq!(at([0.5; 4]), Safe { first: true, second: true });
        // The plane of vertices 0, 1 and 2 rises beyond the end of the edge.
        let u = Vec4::new(-0.1, 0.9, 0.9, -0.9);
        let v = Vec4::new(-0.9, -0.9, 0.1, 0.9);
        assert_eq!(safe_diagonals(u, v, Vec4::new(0.9, 0.1, 0.9, 0.9)), Safe { first: false, second: true });
        // Vertex 2 lies behind the line from 1 to 3: only the diagonal to it is inside.
        let u = Vec4::new(-0.9, 0.9, 0.01, -0.9);
        let v = Vec4::new(-0.9, -0.1, 0.01, 0.9);
        assert_eq!(safe_diagonals(u, v, Vec4::splat(0.5)), Safe { first: true, second: false });
    }
}
