//! The best triangulation of a rim.

use crate::mesh::{EdgeKey, Topology};
use glam::DVec3;
use std::collections::BTreeSet;

/// How bad a triangulation is: the sharpest fold, in steps of a degree so that area has its say among those that are nearly alike, and the
/// area.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
struct Weight {
    fold: f64,
    area: f64,
}

impl Weight {
    const NONE: Weight = Weight { fold: 0.0, area: 0.0 };
    const NEVER: Weight = Weight { fold: f64::INFINITY, area: f64::INFINITY };

    fn and(self, other: Weight) -> Weight {
        Weight { fold: self.fold.max(other.fold), area: self.area + other.area }
    }
}

/// Rounding of folds, in radians.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Triangles over the corners of a rim, which run as the rim does, such that the sharpest fold between them and towards the faces beyond
/// the rim is least, and of such the area (Liepa 2003, section 3). None if every triangulation has an edge that is there already.
/// O(n³) time, O(n²) memory.
pub(super) fn span(topology: &Topology<'_>, rim: &[u32], taken: &BTreeSet<EdgeKey>) -> Option<Vec<[u32; 3]>> {
    let n = rim.len();
    let at = |i: usize| topology.mesh().points[rim[i] as usize];
    let is_free = |i: usize, j: usize| {
        let is_rim = j == i + 1 || (i == 0 && j == n - 1);
        is_rim || !(taken.contains(&EdgeKey::new(rim[i], rim[j])) || topology.find(rim[i], rim[j]).is_some())
    };
    // The normal of the face beyond the rim's edge from i to the next corner.
    let beyond: Vec<Option<DVec3>> = (0..n)
        .map(|i| topology.find(rim[i], rim[(i + 1) % n]).and_then(|side| topology.normal(topology.face(side))))
        .collect();
    let mut best = vec![Weight::NONE; n * n];
    let mut split = vec![0u32; n * n];
    let normal = |i: usize, k: usize, j: usize| (at(k) - at(i)).cross(at(j) - at(i));
    let fold = |a: DVec3, b: Option<DVec3>| b.map_or(0.0, |b| (a.angle_between(b) / DEGREE).round());
    for length in 2..n {
        for i in 0..n - length {
            let j = i + length;
            let mut least = Weight::NEVER;
            for k in (i + 1..j).filter(|_| is_free(i, j)) {
                let parts = best[i * n + k].and(best[k * n + j]);
                if parts >= least {
                    continue;
                }
                let here = normal(i, k, j);
                // What is beyond the sides towards the parts: a face of the mesh, or the triangle chosen there.
                let part = |from: usize, to: usize| {
                    if to == from + 1 { beyond[from] } else { Some(normal(from, split[from * n + to] as usize, to)) }
                };
                let mut folds = fold(here, part(i, k)).max(fold(here, part(k, j)));
                if length == n - 1 {
                    folds = folds.max(fold(here, beyond[j]));
                }
                let weight =
                    parts.and(Weight { fold: if folds.is_nan() { 180.0 } else { folds }, area: 0.5 * here.length() });
                if weight < least {
                    (least, split[i * n + j]) = (weight, k as u32);
                }
            }
            best[i * n + j] = least;
        }
    }
    if best[n - 1] >= Weight::NEVER {
        return None;
    }
    let mut triangles = Vec::with_capacity(n - 2);
    let mut waiting = vec![(0, n - 1)];
    while let Some((i, j)) = waiting.pop() {
        if j > i + 1 {
            let k = split[i * n + j] as usize;
            triangles.push([rim[i], rim[k], rim[j]]);
            waiting.extend([(k, j), (i, k)]);
        }
    }
    Some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use glam::DVec2;
    use std::f64::consts::TAU;

    #[test]
    fn a_planar_polygon_keeps_its_area() {
        // A star with reflex corners: area is least where nothing overlaps.
        let points: Vec<DVec3> =
            (0..16).map(|i| ([1.0, 0.4][i % 2] * DVec2::from_angle(TAU * i as f64 / 16.0)).extend(0.0)).collect();
        let mesh = Mesh { points: points.clone(), ..Mesh::default() };
        let rim: Vec<u32> = (0..16).collect();
        let triangles = span(&Topology::new(&mesh), &rim, &BTreeSet::new()).unwrap();
        assert_eq!(triangles.len(), 14);
        let area = |[a, b, c]: [u32; 3]| {
            0.5 * (points[b as usize] - points[a as usize]).cross(points[c as usize] - points[a as usize]).z
        };
        let expected = 8.0 * 0.4 * (TAU / 16.0).sin();
        assert!((triangles.iter().map(|&t| area(t)).sum::<f64>() - expected).abs() < 1e-12);
        assert!(triangles.iter().all(|&t| area(t) > 0.0));
        // With every diagonal taken there is none.
        let all: BTreeSet<EdgeKey> = (0..16).flat_map(|a| (0..a).map(move |b| EdgeKey::new(a, b))).collect();
        assert!(span(&Topology::new(&mesh), &rim, &all).is_none());
    }
}
