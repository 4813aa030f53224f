//! The boundary of an oriented surface: the edges along which it ends, or along which faces meet that are turned opposite ways.
//!
//! Each triangle is walked round as it is turned; an edge that is passed as often in one direction as in the other has a face on both
//! sides. What is left over is a set of directed edges, as many of which lead to each corner as from it, so that it falls into closed
//! *rings*. Corners are the same if they are in fixed-point coordinates, so triangles need not know of each other, and what
//! the rasteriser takes as one line is one edge.
//!
//! Cost: a pass over the source, some 60 ns an edge of a triangle; 56 bytes for each edge whose other side has not come yet. Meshes mostly
//! come in an order in which these are few.

use crate::error::Result;
use crate::geom::Frame;
use crate::geom::frame::FINE_BITS;
use crate::mesh::TriangleSource;
use crate::progress::{Progress, check};
use hashbrown::HashMap;

/// A corner in fixed-point coordinates.
pub(super) type Corner = [i32; 3];

/// Bytes of an entry of the table of edges, of which one half may be empty.
const ENTRY: usize = 2 * (size_of::<([Corner; 2], i32)>() + 1);

/// The directed edges of a boundary.
#[derive(Debug)]
pub struct Boundary {
    /// From corner to corner, sorted; as many times as the boundary passes there.
    edges: Vec<[Corner; 2]>,
    reversed: bool,
}

impl Boundary {
    /// The boundary of a surface in a grid. Triangles that have no place in it are left out, as in the scan.
    ///
    /// If the volume that the surface encloses together with the cone from the middle of the root to its boundary is negative, the surface
    /// is taken as turned inside out, and so is its boundary: a surface and its reverse come to the same.
    ///
    /// # Errors
    /// Whatever the source returns, `Cancelled`, and `Memory` when `progress` says so: `held` bytes are held already.
    pub fn of(source: &mut dyn TriangleSource, frame: &Frame, held: u64, progress: &dyn Progress) -> Result<Self> {
        let hasher = ahash::RandomState::with_seeds(17, 18, 19, 20);
        let mut nets: HashMap<[Corner; 2], i32, ahash::RandomState> = HashMap::with_hasher(hasher);
        let mut volume = 0i128;
        source.triangles(&mut |batch| {
            check(progress)?;
            for triangle in batch {
                let [Some(a), Some(b), Some(c)] = triangle.map(|p| frame.snap(p)) else { continue };
                volume += six_volumes([a, b, c]);
                for [from, to] in [[a, b], [b, c], [c, a]] {
                    let (edge, way) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
                    if from == to {
                        continue;
                    }
                    let net = nets.entry(edge).or_insert(0);
                    *net += way;
                    if *net == 0 {
                        nets.remove(&edge);
                    }
                }
            }
            progress.hold(held + (nets.capacity() * ENTRY) as u64)
        })?;
        let reversed = volume < 0;
        let mut edges = Vec::with_capacity(nets.len());
        for ([low, high], net) in nets {
            let edge = if (net < 0) == reversed { [low, high] } else { [high, low] };
            edges.extend(std::iter::repeat_n(edge, net.unsigned_abs() as usize));
        }
        edges.sort_unstable();
        Ok(Boundary { edges, reversed })
    }

    /// Whether the surface is turned inside out.
    pub fn reversed(&self) -> bool {
        self.reversed
    }

    /// Bytes held while rings are made, and by them.
    pub(super) fn bytes_of_rings(&self) -> u64 {
        (self.edges.len() * (size_of::<[Corner; 2]>() + 2 * size_of::<Corner>() + 3 * size_of::<usize>())) as u64
    }

    /// The closed walks into which the boundary falls, none of which passes a corner twice. Always the same ones, in whatever order the
    /// triangles came.
    pub(super) fn rings(&self) -> Vec<Vec<Corner>> {
        let edges = &self.edges;
        let mut corners: Vec<Corner> = edges.iter().map(|edge| edge[0]).collect();
        corners.dedup();
        let number = |corner: Corner| corners.binary_search(&corner).expect("edges lead on from wherever they lead to");
        // The edges from each corner stand together: the first that was not yet walked.
        let mut next: Vec<usize> = corners.iter().map(|&c| edges.partition_point(|edge| edge[0] < c)).collect();
        let mut place_on_walk = vec![usize::MAX; corners.len()];
        let mut rings = Vec::new();
        for start in 0..corners.len() {
            let mut walk = vec![start];
            place_on_walk[start] = 0;
            loop {
                let last = walk[walk.len() - 1];
                let leads_on = edges.get(next[last]).filter(|edge| edge[0] == corners[last]);
                // A walk can end only where it began.
                let Some(&[_, to]) = leads_on else { break };
                next[last] += 1;
                let to = number(to);
                let place = place_on_walk[to];
                if place == usize::MAX {
                    place_on_walk[to] = walk.len();
                    walk.push(to);
                    continue;
                }
                rings.push(walk[place..].iter().map(|&i| corners[i]).collect());
                walk.drain(place + 1..).for_each(|i| place_on_walk[i] = usize::MAX);
            }
            place_on_walk[start] = usize::MAX;
        }
        rings
    }
}

/// Six times the volume of the tetrahedron from the middle of the root.
fn six_volumes(triangle: [Corner; 3]) -> i128 {
    let middle = 1i64 << (FINE_BITS - 1);
    let [a, b, c] = triangle.map(|p| p.map(|x| i64::from(x) - middle));
    let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
    (0..3).map(|i| i128::from(a[i]) * i128::from(cross[i])).sum()
}
