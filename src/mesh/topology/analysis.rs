//! What kind of surface a mesh is, and its rims.

use super::{Orientation, Topology};
use crate::sets::Sets;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// What kind of surface a mesh is. Several may hold at once; a closed manifold solid is neither empty nor any of the others, but for duplicates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[expect(clippy::struct_excessive_bools, reason = "each is a finding of its own")]
pub struct MeshKind {
    /// There is no sound face.
    pub is_empty: bool,
    /// An edge has one user.
    pub is_open: bool,
    /// An edge has three users or more.
    pub has_non_manifold_edges: bool,
    /// Several fans meet in a point.
    pub has_bow_ties: bool,
    /// Two users of an edge run the same way.
    pub is_inconsistent: bool,
    /// Neighbours cannot be turned so that they run opposite ways: the surface has one side only.
    pub is_one_sided: bool,
    /// A face visits a point twice, runs along a spike or stays at a point.
    pub has_degenerate_faces: bool,
    /// A face comes twice.
    pub has_duplicates: bool,
}

impl MeshKind {
    /// Whether this is a closed surface on which every edge has two users that run opposite ways and every point one fan. A face that comes
    /// twice may be one: two faces back to back.
    pub fn is_closed_manifold(self) -> bool {
        MeshKind { has_duplicates: false, ..self } == MeshKind::default()
    }
}

impl std::fmt::Display for MeshKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.is_empty {
            return f.write_str("empty");
        }
        let words = [
            (self.is_open, "open"),
            (self.has_non_manifold_edges, "non-manifold"),
            (self.has_bow_ties, "with bow-ties"),
            (self.is_one_sided, "one-sided"),
            (self.is_inconsistent, "inconsistent"),
            (self.has_degenerate_faces, "degenerate"),
            (self.has_duplicates, "with duplicates"),
        ];
        f.write_str(if self.is_open { "" } else { "closed" })?;
        let mut gap = if self.is_open { "" } else { ", " };
        for (_, word) in words.iter().filter(|(is, _)| *is) {
            write!(f, "{gap}{word}")?;
            gap = ", ";
        }
        if *self == MeshKind::default() { f.write_str(", manifold, oriented") } else { Ok(()) }
    }
}

/// A chain of boundary edges.
#[derive(Debug, Clone, PartialEq)]
pub struct BoundaryLoop {
    /// The sides, each running along a boundary edge, in the order of the chain.
    pub sides: Vec<u32>,
    /// The points in this order; as many as sides, one more if the chain has ends.
    pub points: Vec<u32>,
    /// Whether it comes back to its start. Chains with ends begin and end where non-manifold edges do.
    pub is_closed: bool,
    /// Its length in model units.
    pub length: f64,
}

/// What can be said of a mesh beyond its [`Report`](crate::mesh::Report).
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    /// What kind of surface it is.
    pub kind: MeshKind,
    /// Whether neighbours can be turned to run opposite ways everywhere.
    pub is_orientable: bool,
    /// Faces that would have to be turned for that, the fewer of each patch.
    pub faces_to_turn: u64,
    /// Corners at which a face comes back to the point from which it came.
    pub spikes: u64,
    /// Sides that run from a point to itself.
    pub self_edges: u64,
    /// Faces with more than three corners that are [bent](Topology::bend) by more than [`Diagnosis::BENT`].
    pub bent_faces: u64,
    /// The rims.
    pub loops: Vec<BoundaryLoop>,
}

impl Diagnosis {
    /// What is taken as planar: far above what coordinates in single precision lose, far below what is seen.
    pub const BENT: f64 = 1e-3;
}

/// Marks an end of a boundary edge that has no partner.
const NO_PARTNER: u32 = u32::MAX;

impl Topology<'_> {
    /// What kind of surface this is. O(n).
    pub fn kind(&self) -> MeshKind {
        self.kind_with(&self.orientation())
    }

    fn kind_with(&self, orientation: &Orientation) -> MeshKind {
        use super::FaceState as S;
        let any = |state: S| self.states.par_iter().any(|&s| S(s).has(state));
        MeshKind {
            is_empty: !self.states.par_iter().any(|&s| !S(s).has(S::UNSOUND)),
            is_open: any(S::BOUNDARY),
            has_non_manifold_edges: any(S::NON_MANIFOLD),
            has_bow_ties: self.has_bow_ties(),
            is_inconsistent: any(S::INCONSISTENT),
            is_one_sided: !orientation.is_orientable(),
            has_degenerate_faces: any(S(S::DEGENERATE.0 | S::UNSOUND.0)),
            has_duplicates: !self.duplicate_faces().is_empty(),
        }
    }

    fn has_bow_ties(&self) -> bool {
        let points = (0..self.corners.points() as u32).into_par_iter();
        points.map_init(super::Star::default, |star, point| self.fans_with(star, point) > 1).any(|is_tie| is_tie)
    }

    /// Kind, orientability, spikes and rims. O(n).
    pub fn diagnose(&self) -> Diagnosis {
        let orientation = self.orientation();
        let mut turned = vec![[0u64; 2]; orientation.count as usize];
        for (&patch, &is_turned) in orientation.patches.iter().zip(&orientation.turned) {
            if patch != Orientation::NONE {
                turned[patch as usize][usize::from(is_turned)] += 1;
            }
        }
        // Corners of sound faces whose neighbours pass a test.
        let corners = |test: fn(u32, u32, u32) -> bool| {
            let faces = (0..self.states.len() as u32).into_par_iter();
            let sides = faces.flat_map_iter(|face| self.sides(face));
            sides
                .filter(|&c| {
                    let [here, next] = self.ends(c);
                    test(self.corners.point(self.prev(c)), here, next)
                })
                .count() as u64
        };
        Diagnosis {
            kind: self.kind_with(&orientation),
            is_orientable: orientation.is_orientable(),
            faces_to_turn: turned.iter().map(|n| n[0].min(n[1])).sum(),
            spikes: corners(|before, here, after| before == after && before != here),
            self_edges: corners(|_, here, after| here == after),
            bent_faces: self.bent_faces(),
            loops: self.boundary_loops(),
        }
    }

    /// How far a face is from being planar: the greatest distance of a corner from the plane through the mean of all with the face's
    /// normal, as part of the greatest distance of a corner from that mean. None if the face has no normal.
    pub fn bend(&self, face: u32) -> Option<f64> {
        let normal = self.normal(face)?;
        let corners = || self.mesh().faces.get(face as usize).iter().map(|&v| self.mesh().points[v as usize]);
        let mean = corners().sum::<DVec3>() / corners().len() as f64;
        let greatest = |of: fn(DVec3, DVec3) -> f64| corners().map(|p| of(p - mean, normal)).fold(0.0, f64::max);
        Some(greatest(|way, normal| way.dot(normal).abs()) / greatest(|way, _| way.length()))
    }

    fn bent_faces(&self) -> u64 {
        if self.corners.are_triangles() {
            return 0;
        }
        let faces = (0..self.states.len() as u32).into_par_iter().filter(|&face| self.sides(face).len() > 3);
        faces.filter(|&face| self.bend(face).is_some_and(|bend| bend > Diagnosis::BENT)).count() as u64
    }

    /// The corners at a point, each with the lowest corner of its fan.
    pub(in crate::mesh) fn corners_by_fan(&self, point: u32) -> Vec<(u32, u32)> {
        let corners = self.corners_at(point);
        let number = |corner: u32| corners.binary_search(&corner).expect("a corner at the point") as u32;
        let fans = Sets::new(corners.len());
        for (&corner, i) in corners.iter().zip(0..) {
            for side in [corner, self.prev(corner)] {
                let [a, b] = self.ends(side);
                // To the next one round the edge: so all along it hang together.
                let user = self.rings[side as usize];
                if a != b && user != side {
                    let beyond = if self.ends(user)[0] == point { user } else { self.next(user) };
                    fans.union(i, number(beyond));
                }
            }
        }
        corners.iter().zip(0..).map(|(&corner, i)| (corner, corners[fans.root(i) as usize])).collect()
    }

    /// Sides along boundary edges, ascending.
    pub fn boundary_sides(&self) -> Vec<u32> {
        let faces =
            (0..self.states.len() as u32).into_par_iter().filter(|&f| self.state(f).has(super::FaceState::BOUNDARY));
        faces.flat_map_iter(|face| self.sides(face).filter(|&side| self.count(side) == 1)).collect()
    }

    /// The rims, in order of their lowest sides. Each that is closed begins with it and runs its way.
    ///
    /// From edge to edge it goes round the fan between them; where a rim comes to a point for a second time, it is two rims that touch
    /// there. Neither faces that are turned over nor non-manifold edges stop it: what cannot be followed ends a chain that is not closed.
    /// O(boundary).
    pub fn boundary_loops(&self) -> Vec<BoundaryLoop> {
        let sides = self.boundary_sides();
        let partners = self.partners(&sides);
        let mut is_used = vec![false; sides.len()];
        let mut loops = Vec::new();
        for first in 0..sides.len() as u32 {
            if is_used[first as usize] {
                continue;
            }
            // Ends are numbered 2 i where side i starts, 2 i + 1 where it stops. First back to where the chain begins, if anywhere.
            let mut start = 2 * first;
            while partners[start as usize] != NO_PARTNER && partners[start as usize] ^ 1 != 2 * first {
                start = partners[start as usize] ^ 1;
            }
            let mut end = if partners[start as usize] == NO_PARTNER { start } else { 2 * first };
            // Each step with the point from which it goes; a point that comes again closes a rim.
            let mut path: Vec<(u32, u32)> = Vec::new();
            let mut places = HashMap::new();
            while end != NO_PARTNER && !is_used[(end / 2) as usize] {
                is_used[(end / 2) as usize] = true;
                let side = sides[(end / 2) as usize];
                let [from, to] = self.along(side, end % 2 == 0);
                places.insert(from, path.len());
                path.push((from, side));
                if let Some(&at) = places.get(&to) {
                    path[at..].iter().for_each(|step| _ = places.remove(&step.0));
                    loops.push(self.rim(path.split_off(at), true));
                }
                end = partners[(end ^ 1) as usize];
            }
            if !path.is_empty() {
                loops.push(self.rim(path, false));
            }
        }
        loops.sort_by_cached_key(|rim| rim.sides.iter().copied().min());
        loops
    }

    /// The points of a side, the way it runs or the other way.
    fn along(&self, side: u32, forward: bool) -> [u32; 2] {
        let [a, b] = self.ends(side);
        if forward { [a, b] } else { [b, a] }
    }

    /// A rim of steps, each with the point from which it goes and its side.
    fn rim(&self, mut steps: Vec<(u32, u32)>, is_closed: bool) -> BoundaryLoop {
        let mut tip = None;
        if is_closed {
            let lowest = (0..steps.len()).min_by_key(|&i| steps[i].1).expect("a rim has a side");
            steps.rotate_left(lowest);
            if self.ends(steps[0].1)[0] != steps[0].0 {
                // The sides in opposite order, from the same side on, each from its other end.
                let points: Vec<u32> = (0..steps.len()).map(|i| steps[(i + 1) % steps.len()].0).collect();
                steps.iter_mut().zip(points).for_each(|(step, point)| step.0 = point);
                steps[1..].reverse();
            }
        } else if let Some(&(from, side)) = steps.last() {
            tip = self.ends(side).into_iter().find(|&p| p != from);
        }
        let length = |&(_, side): &(u32, u32)| {
            let [a, b] = self.ends(side).map(|p| self.mesh().points[p as usize]);
            a.distance(b)
        };
        BoundaryLoop {
            length: steps.iter().map(length).sum(),
            sides: steps.iter().map(|step| step.1).collect(),
            points: steps.iter().map(|step| step.0).chain(tip).collect(),
            is_closed,
        }
    }

    /// Which ends of boundary edges follow each other.
    fn partners(&self, sides: &[u32]) -> Vec<u32> {
        let mut partners = vec![NO_PARTNER; 2 * sides.len()];
        // Each end with its point and the corner there.
        let mut ends: Vec<(u32, u32, u32)> = Vec::with_capacity(2 * sides.len());
        for (&side, i) in sides.iter().zip(0..) {
            let [a, b] = self.ends(side);
            ends.extend([(a, side, 2 * i), (b, self.next(side), 2 * i + 1)]);
        }
        ends.par_sort_unstable();
        let mut pair = |a: u32, b: u32| {
            partners[a as usize] = b;
            partners[b as usize] = a;
        };
        for here in ends.chunk_by(|a, b| a.0 == b.0) {
            if let [a, b] = here {
                pair(a.2, b.2);
                continue;
            }
            let fans = self.corners_by_fan(here[0].0);
            let fan = |corner: u32| fans[fans.binary_search_by_key(&corner, |f| f.0).expect("a corner at the point")].1;
            let mut by_fan: Vec<(u32, u32)> = here.iter().map(|&(_, corner, end)| (fan(corner), end)).collect();
            by_fan.sort_unstable();
            let mut left = Vec::new();
            for alike in by_fan.chunk_by(|a, b| a.0 == b.0) {
                let pairs = alike.chunks_exact(2);
                left.extend(pairs.remainder().iter().map(|end| end.1));
                pairs.for_each(|two| pair(two[0].1, two[1].1));
            }
            left.chunks_exact(2).for_each(|two| pair(two[0], two[1]));
        }
        partners
    }
}
