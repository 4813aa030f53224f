//! Walks over a surface: from face to face and from point to point.
//!
//! Visited faces and points are remembered in a hash set, so that what stays near its seed costs no more on a large mesh than on a small
//! one; nothing is ever read from it in its own order.

use super::Topology;
use ahash::RandomState;
use glam::{DVec2, DVec3};
use hashbrown::{HashMap, HashSet};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

/// Hashes that are the same on every run.
fn hasher() -> RandomState {
    RandomState::with_seeds(5, 6, 7, 8)
}

/// Faces in the order in which a walk from face to face comes to them, each with the number of steps that led there.
#[derive(Debug)]
pub struct Search<'a> {
    topology: &'a Topology<'a>,
    waiting: VecDeque<(u32, u32)>,
    seen: HashSet<u32, RandomState>,
    /// Edges with many users over which the walk has gone already, by their lowest sides; only breadth first.
    crossed: HashSet<u32, RandomState>,
    is_deep: bool,
}

impl Iterator for Search<'_> {
    type Item = (u32, u32);

    fn next(&mut self) -> Option<(u32, u32)> {
        loop {
            let (face, depth) = if self.is_deep { self.waiting.pop_back() } else { self.waiting.pop_front() }?;
            // Depth first, a face is seen when the walk comes to it, breadth first when it is first in sight.
            if self.is_deep && !self.seen.insert(face) {
                continue;
            }
            let start = self.waiting.len();
            let Search { topology, crossed, .. } = self;
            let sides = topology.sides(face).filter(|&side| {
                let crowd = if self.is_deep { None } else { topology.crowd(side) };
                crowd.is_none_or(|crowd| crossed.insert(crowd.lowest))
            });
            for other in sides.flat_map(|side| topology.beyond(side)).filter(|&other| other != face) {
                if if self.is_deep { !self.seen.contains(&other) } else { self.seen.insert(other) } {
                    self.waiting.push_back((other, depth + 1));
                }
            }
            if self.is_deep {
                self.waiting.make_contiguous()[start..].reverse();
            }
            return Some((face, depth));
        }
    }
}

/// Lengths of ways over a surface from some points.
#[derive(Debug, Clone)]
pub struct Geodesics {
    /// Points that are reached and how far they are in model units, the nearest first.
    pub reached: Vec<(u32, f64)>,
}

impl Topology<'_> {
    /// All faces that can be reached from one through common edges, the nearest first, with the number of steps.
    /// Non-manifold edges lead to all of their faces. O(1) a step and side.
    ///
    /// # Panics
    /// When there is no such face.
    pub fn breadth_first(&self, seed: u32) -> Search<'_> {
        self.search(seed, false)
    }

    /// All faces that can be reached from one, going on from the last one found as long as there is a way; the number of steps is that of
    /// the way taken. An edge with n users takes n² steps.
    ///
    /// # Panics
    /// When there is no such face.
    pub fn depth_first(&self, seed: u32) -> Search<'_> {
        self.search(seed, true)
    }

    fn search(&self, seed: u32, is_deep: bool) -> Search<'_> {
        assert!((seed as usize) < self.mesh().faces.len(), "there is no face {seed}");
        let mut seen = HashSet::with_hasher(hasher());
        if !is_deep {
            seen.insert(seed);
        }
        let crossed = HashSet::with_hasher(hasher());
        Search { topology: self, waiting: VecDeque::from([(seed, 0)]), seen, crossed, is_deep }
    }

    /// The faces at most `rings` steps through common edges away from one, the nearest first; with the number of steps.
    ///
    /// # Panics
    /// When there is no such face.
    pub fn face_rings(&self, face: u32, rings: u32) -> Vec<(u32, u32)> {
        self.breadth_first(face).take_while(|&(_, depth)| depth <= rings).collect()
    }

    /// The points at most `rings` edges away from one, the nearest first; with the number of edges.
    pub fn point_rings(&self, point: u32, rings: u32) -> Vec<(u32, u32)> {
        self.spread(point, |_, depth| depth <= rings)
    }

    /// The points whose straight distance from one is less than `radius` model units, and that edges between such points connect to it:
    /// the other side of a thin gap does not count. With the number of edges, in ascending order.
    pub fn points_within(&self, point: u32, radius: f64) -> Vec<(u32, u32)> {
        let at = |p: u32| self.mesh().points[p as usize];
        self.spread(point, |other, _| at(other).distance(at(point)) < radius)
    }

    fn spread(&self, point: u32, is_in: impl Fn(u32, u32) -> bool) -> Vec<(u32, u32)> {
        let mut seen = HashSet::with_hasher(hasher());
        let mut found = Vec::new();
        if (point as usize) < self.mesh().points.len() && is_in(point, 0) {
            seen.insert(point);
            found.push((point, 0));
        }
        let mut i = 0;
        while let Some(&(here, depth)) = found.get(i) {
            found.extend(
                self.connected(here).filter(|&o| is_in(o, depth + 1) && seen.insert(o)).map(|o| (o, depth + 1)),
            );
            i += 1;
        }
        found
    }

    /// Pairs of faces that share an edge, the lower one first, each pair once, ascending: the edges of the dual graph. At a non-manifold
    /// edge every face is paired with every other.
    pub fn dual_edges(&self) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for side in self.edges() {
            let faces: Vec<u32> = self.users(side).map(|s| self.face(s)).collect();
            for (i, &a) in faces.iter().enumerate() {
                pairs.extend(faces[i + 1..].iter().filter(|&&b| a != b).map(|&b| [a.min(b), a.max(b)]));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// Lengths of ways over the surface from some points to all others that are nearer than `limit` model units.
    ///
    /// Dijkstra's order, and besides ways along edges those through triangles: where two corners know their lengths, the plane of the
    /// triangle has one place that is as far from both on the other side, and the third corner is as far as it is from there if the
    /// straight way passes between the two (Novotni and Klein 2002). Exact in a flat triangulation seen from one point, if no corner
    /// is obtuse; elsewhere too long by a few percent, never shorter than a way over the surface. Polygons with more corners
    /// have only their sides.
    pub fn geodesics(&self, seeds: &[u32], limit: f64) -> Geodesics {
        let points = &self.mesh().points;
        let mut best: HashMap<u32, f64, RandomState> = HashMap::with_hasher(hasher());
        let mut done: HashMap<u32, f64, RandomState> = HashMap::with_hasher(hasher());
        // The bits of positive numbers are in the order of the numbers.
        let mut waiting: BinaryHeap<Reverse<(u64, u32)>> = BinaryHeap::new();
        for &seed in seeds.iter().filter(|&&seed| (seed as usize) < points.len()) {
            waiting.push(Reverse((0, seed)));
            best.insert(seed, 0.0);
        }
        let mut reached = Vec::new();
        while let Some(Reverse((bits, here))) = waiting.pop() {
            let far = f64::from_bits(bits);
            if done.contains_key(&here) || far.is_nan() || far >= limit {
                continue;
            }
            done.insert(here, far);
            reached.push((here, far));
            let mut offer = |point: u32, length: f64| {
                let least = best.entry(point).or_insert(f64::INFINITY);
                if length < *least && length < limit {
                    *least = length;
                    waiting.push(Reverse((length.to_bits(), point)));
                }
            };
            let at = |p: u32| points[p as usize];
            for other in self.connected(here).filter(|other| !done.contains_key(other)) {
                offer(other, far + at(here).distance(at(other)));
            }
            for &corner in self.corners_at(here) {
                let &[a, b, c] = self.mesh().faces.get(self.face(corner) as usize) else { continue };
                for (known, third) in [(a, b), (b, a), (a, c), (c, a), (b, c), (c, b)] {
                    let is_open = known != here && third != here && known != third && !done.contains_key(&third);
                    let from = done.get(&known).filter(|_| is_open);
                    let way = from.and_then(|&from| across([here, known, third].map(at), [far, from]));
                    way.into_iter().for_each(|length| offer(third, length));
                }
            }
        }
        Geodesics { reached }
    }
}

/// How far the third corner of a triangle is from the place that is as far as told from the other two, on the other side of their line;
/// none if there is no such place or the way does not pass between the two.
fn across([a, b, c]: [DVec3; 3], [from_a, from_b]: [f64; 2]) -> Option<f64> {
    let base = a.distance(b);
    let along = (b - a) / base;
    // The triangle with `a` at the origin and `b` on the x axis, `c` above.
    let x = (c - a).dot(along);
    let corner = DVec2::new(x, ((c - a) - x * along).length());
    let u = 0.5 * (base + (from_a - from_b) * (from_a + from_b) / base);
    let v = from_a * from_a - u * u;
    if v.is_nan() || v < 0.0 {
        return None;
    }
    let source = DVec2::new(u, -v.sqrt());
    let passes = source.x + (corner.x - source.x) * -source.y / (corner.y - source.y);
    (0.0..=base).contains(&passes).then(|| corner.distance(source))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, sample};

    /// A square of n by n cells, each of two triangles.
    fn plate(n: u32) -> Mesh {
        let at = |i: u32, j: u32| i * (n + 1) + j;
        let mut mesh = Mesh::default();
        for (i, j) in (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j))) {
            mesh.points.push(DVec3::new(f64::from(i), f64::from(j), 0.0));
            if i < n && j < n {
                mesh.faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                mesh.faces.push(&[at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        mesh
    }

    /// Bug C4.1: the ring of a polygon never grew beyond it.
    #[test]
    fn rings_grow() {
        let mesh = plate(6);
        let topology = Topology::new(&mesh);
        let middle = topology.find_face(&[24, 31, 32]).unwrap();
        let sizes = [0, 1, 2].map(|rings| topology.face_rings(middle, rings).len());
        assert_eq!(sizes, [1, 4, 10]);
        assert_eq!([0, 1, 2].map(|rings| topology.point_rings(24, rings).len()), [1, 7, 19]);
        assert_eq!(topology.point_rings(24, 99).len(), 49);
        assert!(topology.point_rings(1000, 3).is_empty());
    }

    #[test]
    fn walks_come_to_every_face_once() {
        let mesh = sample::build("nested", 1).unwrap();
        let topology = Topology::new(&mesh);
        for deep in [false, true] {
            let walk: Vec<(u32, u32)> = topology.search(0, deep).collect();
            let mut faces: Vec<u32> = walk.iter().map(|w| w.0).collect();
            faces.sort_unstable();
            faces.dedup();
            assert_eq!(faces.len(), walk.len());
            // The first of three balls.
            assert_eq!(walk.len(), topology.orientation().patches.iter().filter(|&&p| p == 0).count());
            let greatest = walk.iter().map(|w| w.1).max().unwrap();
            assert_eq!(greatest > 100, deep, "{greatest}");
            if !deep {
                assert!(walk.is_sorted_by_key(|w| w.1));
            }
        }
    }

    /// Bug C4.3: walks stopped at edges with more than two users and said nothing.
    #[test]
    fn walks_go_on_through_non_manifold_edges() {
        let faces: [&[u32]; 4] = [&[0, 1, 2], &[1, 0, 3], &[0, 1, 4], &[4, 1, 5]];
        let mesh = Mesh { points: vec![DVec3::ZERO; 6], faces: faces.into_iter().collect() };
        let topology = Topology::new(&mesh);
        assert_eq!(topology.breadth_first(0).collect::<Vec<_>>(), [(0, 0), (1, 1), (2, 1), (3, 2)]);
        assert_eq!(topology.dual_edges(), [[0, 1], [0, 2], [1, 2], [2, 3]]);
    }

    #[test]
    fn radii_do_not_jump_gaps() {
        let mut mesh = plate(6);
        let copy = plate(6);
        let n = mesh.points.len() as u32;
        mesh.points.extend(copy.points.iter().map(|p| *p + 0.1 * DVec3::Z));
        copy.faces.iter().for_each(|f| mesh.faces.push(&[f[0] + n, f[1] + n, f[2] + n]));
        let topology = Topology::new(&mesh);
        let within = topology.points_within(24, 2.0);
        // Strictly less than 2: a 3 by 3 square of points.
        assert_eq!(within.len(), 9);
        assert!(within.iter().all(|&(p, _)| p < n));
        assert!(topology.points_within(24, 0.0).is_empty());
    }

    #[test]
    fn ways_through_triangles_are_shorter_than_along_edges() {
        let mesh = plate(20);
        let ways = Topology::new(&mesh).geodesics(&[0], f64::INFINITY);
        assert_eq!(ways.reached.len(), mesh.points.len());
        for &(point, length) in &ways.reached {
            let straight = mesh.points[point as usize].length();
            assert!((straight - 1e-9..1.03 * straight + 1e-9).contains(&length), "{point}: {length} for {straight}");
        }
        let near = Topology::new(&mesh).geodesics(&[0], 3.5).reached;
        assert!(near.len() < 20 && near.is_sorted_by(|a, b| a.1 <= b.1) && near.iter().all(|n| n.1 < 3.5));
        // Half round a ball.
        let ball = sample::build("sphere", 2).unwrap();
        let far = Topology::new(&ball).geodesics(&[0], f64::INFINITY).reached.last().unwrap().1;
        assert!((far / std::f64::consts::PI - 1.0).abs() < 0.02, "{far}");
    }
}
