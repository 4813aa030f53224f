//! The parts of a mesh, and which of them can stay as they are.
//!
//! A *part* is what hangs together by common points. It is *whole* if it is closed, manifold and oriented. It is *good* if besides, it meets
//! neither itself nor another part, not even in a point, and bounds a solid where it is: its faces look outwards where no other part
//! goes round it, or inwards where one does. Parts that lie in each other are good together or not at all, for what is inside depends on
//! all of them.
//!
//! What lies in what is told by winding numbers at a point of each part ([`TriangleTree::crossings`]), which whole parts have everywhere.
//!
//! # Cost
//!
//! Topology and self-intersections, some 1 µs a triangle on two threads, and a ray a part. 60 bytes a triangle.

use super::star::Star;
use super::topology::FaceState;
use super::{Mesh, Topology, TriangleTree};
use crate::sets::Sets;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Pairs of faces that meet, of which no more are listed: of so bad a mesh no part is good.
const MOST_PAIRS: usize = 1 << 22;

/// What became of each part.
#[derive(Debug, Clone)]
pub(crate) struct Parts {
    /// The part of each face, counted in order of their lowest faces; [`Parts::NONE`] for faces that are not sound.
    pub(crate) of_face: Vec<u32>,
    /// Of each part.
    pub(crate) fates: Vec<Fate>,
}

/// Why a part is good or not. The first that holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fate {
    /// It can stay.
    Good,
    /// It is open, not manifold, not oriented, or has faces without area.
    Defective,
    /// It meets itself or another part.
    Meets,
    /// It lies in another part or around it, and that one is not good or does not fit.
    Nested,
}

impl Parts {
    /// The part of a face that is in none.
    pub(crate) const NONE: u32 = u32::MAX;

    /// Whether a face is of a part that can stay.
    pub(crate) fn is_good(&self, face: usize) -> bool {
        self.of_face[face] != Parts::NONE && self.fates[self.of_face[face] as usize] == Fate::Good
    }

    /// How many parts have this fate.
    pub(crate) fn count(&self, fate: Fate) -> u64 {
        self.fates.iter().filter(|&&f| f == fate).count() as u64
    }
}

impl Mesh {
    /// The parts, and which can stay. Parts of faces before `from` cannot in any case: they only count as what others meet or lie in; that
    /// they meet each other or themselves is not looked at.
    pub(crate) fn parts(&self, from: u32) -> Parts {
        let topology = Topology::new(self);
        let (of_face, count) = self.hang_together(&topology);
        let mut fates = vec![Fate::Good; count];
        let part = |face: u32| Some(of_face[face as usize]).filter(|&part| part != Parts::NONE);
        let mut set = |parts: &mut dyn Iterator<Item = u32>, fate: Fate| {
            let new = parts.filter(|&part| fates[part as usize] == Fate::Good).collect::<Vec<_>>();
            new.into_iter().for_each(|part| fates[part as usize] = fate);
        };
        set(&mut topology.defective_faces().into_iter().filter_map(part), Fate::Defective);
        match self.intersections_from(from, MOST_PAIRS) {
            Some(pairs) => set(&mut pairs.into_iter().flatten().filter_map(part), Fate::Meets),
            None => set(&mut (0..count as u32), Fate::Meets),
        }
        set(&mut self.touching(&topology, part).into_iter(), Fate::Meets);
        self.judge_nests(&of_face, &mut fates, from);
        Parts { of_face, fates }
    }

    /// The part of each face, and the number of parts.
    fn hang_together(&self, topology: &Topology<'_>) -> (Vec<u32>, usize) {
        let sets = Sets::new(self.points.len());
        let faces = 0..self.faces.len() as u32;
        faces.clone().into_par_iter().filter(|&face| topology.is_sound(face)).for_each(|face| {
            let corners = self.faces.get(face as usize);
            corners.windows(2).for_each(|pair| _ = sets.union(pair[0], pair[1]));
        });
        let mut numbers = vec![Parts::NONE; self.points.len()];
        let mut count = 0;
        let of_face = faces.map(|face| {
            if !topology.is_sound(face) {
                return Parts::NONE;
            }
            let number = &mut numbers[sets.root(self.faces.get(face as usize)[0]) as usize];
            if *number == Parts::NONE {
                *number = count;
                count += 1;
            }
            *number
        });
        (of_face.collect(), count as usize)
    }

    /// Parts with points at a place where another part has one.
    fn touching(&self, topology: &Topology<'_>, part: impl Fn(u32) -> Option<u32>) -> Vec<u32> {
        let of_point = |v: u32| part(topology.faces_at(v).next()?);
        // Both zeros are one place.
        let place = |v: u32| (self.points[v as usize] + 0.0).to_array().map(f64::to_bits);
        let mut places: Vec<([u64; 3], u32)> =
            (0..self.points.len() as u32).filter_map(|v| Some((place(v), of_point(v)?))).collect();
        places.par_sort_unstable();
        let shared = places.chunk_by(|a, b| a.0 == b.0).filter(|here| here[0].1 != here[here.len() - 1].1);
        shared.flatten().map(|place| place.1).collect()
    }

    /// Finds what lies in what; parts that do not fit, and those that lie in or around parts that are not good, are nested.
    fn judge_nests(&self, of_face: &[u32], fates: &mut [Fate], from: u32) {
        let count = fates.len();
        let (mut first, mut volumes) = (vec![u32::MAX; count], vec![0.0; count]);
        for (face, &part) in (0u32..).zip(of_face).filter(|(_, part)| **part != Parts::NONE) {
            let part = part as usize;
            if first[part] == u32::MAX {
                first[part] = face;
            }
            let origin = self.points[self.faces.get(first[part] as usize)[0] as usize];
            let corner = |k: usize| self.points[self.faces.get(face as usize)[k] as usize] - origin;
            let fan = 2..self.faces.get(face as usize).len();
            volumes[part] += fan.map(|k| corner(0).dot(corner(k - 1).cross(corner(k)))).sum::<f64>();
        }
        // Parts of which no winding number is known surround nothing, but may lie in something.
        let is_seen: Vec<bool> = fates.iter().map(|&fate| fate != Fate::Defective).collect();
        let tree = TriangleTree::new(self);
        let around = |part: usize| -> Option<BTreeMap<u32, i64>> {
            let probe: DVec3 = self.points[self.faces.get(first[part] as usize)[0] as usize];
            let sees = |face: u32| {
                let other = of_face[face as usize];
                other != Parts::NONE && other as usize != part && is_seen[other as usize]
            };
            let mut turns = BTreeMap::new();
            for (face, leaves) in tree.crossings(probe, sees)? {
                *turns.entry(of_face[face as usize]).or_insert(0) += if leaves { 1 } else { -1 };
            }
            turns.retain(|_, n| *n != 0);
            Some(turns)
        };
        let around: Vec<Option<BTreeMap<u32, i64>>> = (0..count).into_par_iter().map(around).collect();
        let nests = Sets::new(count);
        let mut fits = vec![true; count];
        for (part, around) in around.iter().enumerate() {
            let Some(around) = around else {
                fits[part] = false;
                continue;
            };
            around.keys().for_each(|&other| _ = nests.union(part as u32, other));
            let outside: i64 = around.values().sum();
            fits[part] = if volumes[part] > 0.0 { outside == 0 } else { volumes[part] < 0.0 && outside == 1 };
        }
        let mut is_spoilt = vec![false; count];
        for part in 0..count {
            is_spoilt[nests.root(part as u32) as usize] |=
                fates[part] != Fate::Good || !fits[part] || first[part] < from;
        }
        for part in 0..count {
            if fates[part] == Fate::Good && is_spoilt[nests.root(part as u32) as usize] {
                fates[part] = Fate::Nested;
            }
        }
    }
}

impl Topology<'_> {
    /// Faces at which the surface is not closed, manifold and oriented, and those without area.
    fn defective_faces(&self) -> Vec<u32> {
        let any = [FaceState::DEGENERATE, FaceState::BOUNDARY, FaceState::NON_MANIFOLD, FaceState::INCONSISTENT];
        let is_wrong = |face: u32| {
            let state = self.state(face);
            self.is_sound(face) && (any.iter().any(|&bit| state.has(bit)) || self.normal(face).is_none())
        };
        let wrong = (0..self.mesh().faces.len() as u32).into_par_iter().filter(|&face| is_wrong(face));
        let points = (0..self.mesh().points.len() as u32).into_par_iter();
        let tied = points.map_init(Star::default, |star, v| (v, self.fans_with(star, v))).filter(|&(_, fans)| fans > 1);
        wrong.chain(tied.filter_map(|(v, _)| self.faces_at(v).next())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::sample;

    /// Meshes side by side in one.
    fn together(meshes: &[Mesh]) -> Mesh {
        let mut all = Mesh::default();
        for mesh in meshes {
            let n = all.points.len() as u32;
            all.points.extend_from_slice(&mesh.points);
            mesh.faces.iter().for_each(|f| all.faces.push(&f.iter().map(|v| v + n).collect::<Vec<_>>()));
        }
        all
    }

    fn ball(radius: f64, x: f64, outward: bool) -> Mesh {
        let mut ball = sample::build("sphere", 1).unwrap();
        ball.points.iter_mut().for_each(|p| *p = radius * *p + x * DVec3::X);
        if !outward {
            ball.faces =
                ball.faces.iter().map(|f| [f[0], f[2], f[1]]).collect::<Vec<_>>().iter().map(|f| &f[..]).collect();
        }
        ball
    }

    fn fates(meshes: &[Mesh]) -> Vec<Fate> {
        together(meshes).parts(0).fates
    }

    #[test]
    fn parts_that_are_apart_are_judged_alone() {
        use Fate::{Defective, Good, Meets, Nested};
        let holes = sample::build("knot-holes", 1).unwrap();
        let far = |mut mesh: Mesh| {
            mesh.points.iter_mut().for_each(|p| p.y += 100.0);
            mesh
        };
        assert_eq!(fates(&[ball(1.0, 0.0, true), far(holes.clone())]), [Good, Defective]);
        assert_eq!(fates(&[ball(1.0, 0.0, true), ball(1.0, 1.0, true), ball(1.0, 9.0, true)]), [Meets, Meets, Good]);
        // A ball that looks inwards is no solid where nothing is around it.
        assert_eq!(fates(&[ball(1.0, 0.0, false), ball(1.0, 9.0, true)]), [Nested, Good]);
        assert!(Mesh::default().parts(0).fates.is_empty());
    }

    #[test]
    fn parts_that_lie_in_each_other_stay_or_go_together() {
        use Fate::{Good, Nested};
        let hollow = [ball(3.0, 0.0, true), ball(2.0, 0.0, false)];
        assert_eq!(fates(&hollow), [Good, Good]);
        let core = ball(1.0, 0.0, true);
        assert_eq!(fates(&[hollow[0].clone(), hollow[1].clone(), core.clone()]), [Good; 3]);
        assert_eq!(fates(&[hollow[0].clone(), core.clone()]), [Nested, Nested]);
        assert_eq!(fates(&[hollow[1].clone(), core, ball(1.0, 9.0, true)]), [Nested, Nested, Good]);
        // A hole in what lies within spoils what is around it.
        let mut open = ball(1.0, 0.5, false);
        open.faces = open.faces.iter().skip(1).collect();
        assert_eq!(fates(&[ball(3.0, 0.0, true), open]), [Nested, Fate::Defective]);
    }

    #[test]
    fn parts_that_touch_are_not_good() {
        let cube = sample::build("cube", 1).unwrap();
        let mut beside = cube.clone();
        // They have an edge in common, but not its points.
        beside.points.iter_mut().for_each(|p| *p += DVec3::new(1.0, 1.0, -0.0));
        assert_eq!(fates(&[cube.clone(), beside]), [Fate::Meets; 2]);
        assert_eq!(fates(&[cube.clone(), cube]), [Fate::Meets; 2]);
    }

    #[test]
    fn early_faces_are_only_what_others_lie_in() {
        let (core, around) = (ball(1.0, 0.0, true), ball(3.0, 0.0, true));
        let first = core.faces.len() as u32;
        let parts = together(&[core, around, ball(1.0, 9.0, true)]).parts(first);
        assert_eq!(parts.fates, [Fate::Nested, Fate::Nested, Fate::Good]);
        assert!(parts.is_good(parts.of_face.len() - 1) && !parts.is_good(0));
    }
}
