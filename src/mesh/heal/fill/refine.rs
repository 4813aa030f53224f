//! Fillings as fine and as smooth as what is around them.
//!
//! Liepa 2003, sections 4 and 5: triangles are cut in three at their centres as long as they are large against the edges at their corners,
//! with lengths handed on from the rim inwards, and edges flipped until they are Delaunay; then the new points go where the second
//! Laplacian vanishes, with the rim and the points around it fixed: the surface leaves the rim in the direction in which it came.

use super::Patch;
use crate::mesh::{EdgeKey, Topology};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// How much farther than the edges around a corner a centre must be from it: the square root of two, as published.
const DENSITY: f64 = std::f64::consts::SQRT_2;
/// Rounds of cutting: each makes triangles three times as many at most.
const ROUNDS: usize = 12;
/// The most triangles of a filling; rims whose edges differ by orders of magnitude would ask for more.
const MOST: usize = 20_000;
/// Sweeps over all edges after a round, to make them Delaunay.
const FLIPS: usize = 12;
/// Sweeps over the new points, as a membrane for a start that is near, then as a thin plate.
const MEMBRANE: usize = 50;
const SWEEPS: usize = 2000;

/// The patch with points of its own, or none if it needs none.
pub(super) fn refined(topology: &Topology<'_>, patch: &Patch) -> Option<Patch> {
    let first = topology.mesh().points.len() as u32;
    let mut work = Work { topology, first, scales: BTreeMap::new(), patch: patch.clone() };
    let corners: BTreeSet<u32> = patch.triangles.iter().flatten().copied().collect();
    for v in corners {
        let lengths: Vec<f64> = topology.connected(v).map(|other| work.at(v).distance(work.at(other))).collect();
        work.scales.insert(v, lengths.iter().sum::<f64>() / lengths.len().max(1) as f64);
    }
    for _ in 0..ROUNDS {
        if !work.cut() || work.patch.triangles.len() > MOST {
            break;
        }
        for _ in 0..FLIPS {
            if !work.flip() {
                break;
            }
        }
    }
    if work.patch.points.is_empty() || work.patch.triangles.len() > MOST {
        return None;
    }
    work.fair();
    let is_flat = |t: &[u32; 3]| super::is_flat(t.map(|v| work.at(v)));
    (!work.patch.triangles.iter().any(is_flat)).then_some(work.patch)
}

struct Work<'a> {
    topology: &'a Topology<'a>,
    /// Number of the first point of its own.
    first: u32,
    /// How long edges at a point should be.
    scales: BTreeMap<u32, f64>,
    patch: Patch,
}

impl Work<'_> {
    fn at(&self, v: u32) -> DVec3 {
        let points = &self.topology.mesh().points;
        points.get(v as usize).copied().unwrap_or_else(|| self.patch.points[(v - self.first) as usize])
    }

    /// Cuts triangles that are too large in three. Whether there were any.
    fn cut(&mut self) -> bool {
        let mut any = false;
        for i in 0..self.patch.triangles.len() {
            let t @ [a, b, c] = self.patch.triangles[i];
            let corners = t.map(|v| self.at(v));
            let center = (corners[0] + corners[1] + corners[2]) / 3.0;
            let scale = t.iter().map(|v| self.scales[v]).sum::<f64>() / 3.0;
            let is_far = |k: usize| DENSITY * center.distance(corners[k]) > scale.max(self.scales[&t[k]]);
            if (0..3).all(is_far) {
                let v = self.first + self.patch.points.len() as u32;
                self.patch.points.push(center);
                self.scales.insert(v, scale);
                self.patch.triangles[i] = [a, b, v];
                self.patch.triangles.extend([[b, c, v], [c, a, v]]);
                any = true;
            }
        }
        any
    }

    /// Flips edges whose opposite angles are together more than half a turn. Whether there were any.
    fn flip(&mut self) -> bool {
        let mut users: BTreeMap<EdgeKey, Vec<usize>> = BTreeMap::new();
        for (i, &[a, b, c]) in self.patch.triangles.iter().enumerate() {
            [[a, b], [b, c], [c, a]].iter().for_each(|e| users.entry(EdgeKey::new(e[0], e[1])).or_default().push(i));
        }
        let mut is_changed = vec![false; self.patch.triangles.len()];
        let mut added = BTreeSet::new();
        for (key, pair) in &users {
            let &[i, j] = &pair[..] else { continue };
            if is_changed[i] || is_changed[j] {
                continue;
            }
            let [low, high] = key.ends();
            let t = self.patch.triangles[i];
            // The edge runs from a to b in the first triangle.
            let k = (0..3).find(|&k| EdgeKey::new(t[k], t[(k + 1) % 3]) == *key).expect("a side of it");
            let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            let d = self.patch.triangles[j].into_iter().find(|v| *v != low && *v != high).expect("three corners");
            let angle = |tip: u32| (self.at(a) - self.at(tip)).angle_between(self.at(b) - self.at(tip));
            let other = EdgeKey::new(c, d);
            let is_free = !users.contains_key(&other) && !added.contains(&other) && self.topology.find(c, d).is_none();
            if is_free && c != d && angle(c) + angle(d) > std::f64::consts::PI + 1e-9 {
                let normal = |[p, q, r]: [u32; 3]| (self.at(q) - self.at(p)).cross(self.at(r) - self.at(p));
                // Not where the surface would fold.
                if normal([a, d, c]).dot(normal([d, b, c])) > 0.0 {
                    (self.patch.triangles[i], self.patch.triangles[j]) = ([a, d, c], [d, b, c]);
                    (is_changed[i], is_changed[j]) = (true, true);
                    added.insert(other);
                }
            }
        }
        !added.is_empty()
    }

    /// Moves the points of the patch to where their second umbrella vector vanishes (Kobbelt et al. 1998), one after another.
    fn fair(&mut self) {
        // Points of the patch, those of the rim first, and behind them those around the rim.
        let corners: BTreeSet<u32> = self.patch.triangles.iter().flatten().copied().collect();
        let rim: Vec<u32> = corners.range(..self.first).copied().collect();
        let own = self.patch.points.len();
        let mut places: Vec<u32> = rim.iter().copied().chain(self.first..self.first + own as u32).collect();
        let mut numbers: BTreeMap<u32, usize> = places.iter().copied().zip(0..).collect();
        let mut around: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); places.len()];
        for t in &self.patch.triangles {
            let [a, b, c] = t.map(|v| numbers[&v]);
            [(a, [b, c]), (b, [c, a]), (c, [a, b])].into_iter().for_each(|(v, others)| around[v].extend(others));
        }
        for (i, &v) in rim.iter().enumerate() {
            for other in self.topology.connected(v) {
                let next = places.len();
                let number = *numbers.entry(other).or_insert(next);
                if number == next {
                    places.push(other);
                }
                around[i].insert(number);
            }
        }
        let around: Vec<Vec<usize>> = around.into_iter().map(|others| others.into_iter().collect()).collect();
        let mut at: Vec<DVec3> = places.iter().map(|&v| self.at(v)).collect();
        let extent = self.scales.values().copied().fold(0.0, f64::max);
        let umbrella =
            |at: &[DVec3], v: usize| around[v].iter().map(|&o| at[o]).sum::<DVec3>() / around[v].len() as f64 - at[v];
        for sweep in 0..MEMBRANE + SWEEPS {
            let mut moved = 0f64;
            for v in rim.len()..rim.len() + own {
                let step = if sweep < MEMBRANE {
                    umbrella(&at, v)
                } else {
                    let (others, n) = (&around[v], around[v].len() as f64);
                    let second = others.iter().map(|&o| umbrella(&at, o)).sum::<DVec3>() / n - umbrella(&at, v);
                    -second / (1.0 + others.iter().map(|&o| 1.0 / around[o].len() as f64).sum::<f64>() / n)
                };
                at[v] += step;
                moved = moved.max(step.length());
            }
            if sweep >= MEMBRANE && (moved.is_nan() || moved <= 1e-5 * extent) {
                break;
            }
        }
        self.patch.points.copy_from_slice(&at[rim.len()..rim.len() + own]);
    }
}
