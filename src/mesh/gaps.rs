//! What is near each other at the rims of a surface, and gaps that are so narrow that they are no holes on purpose.

use super::Topology;
use ahash::RandomState;
use glam::{DVec3, I64Vec3};
use hashbrown::HashMap;

/// The most cubes along an edge in which points are looked for: for longer ones all points are looked at.
const MOST_CUBES: f64 = 1e4;

/// A point of a rim beside an edge of a rim that does not lead to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// The point.
    pub point: u32,
    /// The side along the edge.
    pub side: u32,
    /// How far the point is from the edge, in model units.
    pub distance: f64,
}

impl Topology<'_> {
    /// Points of rims that are at most `width` model units away from an edge of a rim which they do not belong to, each with the
    /// closest such edge; ascending by point. O(rim) as long as `width` is not much longer than its edges.
    pub fn gaps(&self, width: f64) -> Vec<Gap> {
        let sides = self.boundary_sides();
        let mut rim: Vec<u32> = sides.iter().flat_map(|&side| self.ends(side)).collect();
        rim.sort_unstable();
        rim.dedup();
        let at = |v: u32| self.mesh().points[v as usize];
        rim.retain(|&v| at(v).is_finite());
        let near = Near::of_rim(self, &sides, &rim, width);
        let mut found: Vec<Gap> = Vec::new();
        for &side in &sides {
            let [a, b] = self.ends(side);
            near.along(at(a), at(b), |point| {
                if point != a && point != b {
                    let along = at(b) - at(a);
                    let t = (along.dot(at(point) - at(a)) / along.length_squared()).clamp(0.0, 1.0);
                    let distance = at(point).distance(at(a) + t * along);
                    if distance <= width {
                        found.push(Gap { point, side, distance });
                    }
                }
            });
        }
        found.sort_unstable_by(|x, y| {
            x.point.cmp(&y.point).then(x.distance.total_cmp(&y.distance)).then(x.side.cmp(&y.side))
        });
        found.dedup_by_key(|gap| gap.point);
        found
    }
}

/// Where a point lies along an edge, between 0 and 1, if it is on it within the tolerance and away from its ends.
pub(super) fn place_on(a: DVec3, b: DVec3, p: DVec3, tolerance: f64) -> Option<f64> {
    let along = b - a;
    let t = along.dot(p - a) / along.length_squared();
    let is_inside = t > 0.0 && t < 1.0 && p.distance(a) > tolerance && p.distance(b) > tolerance;
    (is_inside && p.distance(a + t * along) <= tolerance).then_some(t)
}

/// Places in cubes as large as a tolerance, or a little larger.
pub(super) struct Near {
    cubes: HashMap<I64Vec3, Vec<u32>, RandomState>,
    size: f64,
}

impl Near {
    /// Sorts numbered places into cubes.
    pub(super) fn new(places: impl Iterator<Item = (u32, DVec3)>, tolerance: f64) -> Self {
        let places: Vec<(u32, DVec3)> = places.collect();
        let largest = places.iter().map(|(_, p)| p.abs().max_element()).fold(0.0, f64::max);
        // Cubes are counted by integers that doubles hold exactly.
        let size = tolerance.max(largest * 1e-14).max(f64::MIN_POSITIVE);
        let mut cubes = HashMap::with_hasher(RandomState::with_seeds(5, 6, 7, 8));
        for (i, p) in places {
            cubes.entry((p / size).floor().as_i64vec3()).or_insert_with(Vec::new).push(i);
        }
        Near { cubes, size }
    }

    /// Calls with every place in the cube of a point or in one beside it, and maybe others.
    pub(super) fn each(&self, p: DVec3, mut visit: impl FnMut(u32)) {
        let cube = (p / self.size).floor().as_i64vec3();
        neighbours(cube).for_each(|at| self.cubes.get(&at).into_iter().flatten().for_each(|&j| visit(j)));
    }

    /// Points of rims in cubes about as large as the edges there: a handful each. Half of the edges are longer, so that a few far ones do not
    /// bring all others into one cube.
    pub(super) fn of_rim(topology: &Topology<'_>, sides: &[u32], points: &[u32], tolerance: f64) -> Self {
        let at = |v: u32| topology.mesh().points[v as usize];
        let lengths = sides.iter().map(|&side| topology.ends(side).map(at)).map(|[a, b]| a.distance(b));
        let mut lengths: Vec<f64> = lengths.filter(|length| length.is_finite()).collect();
        let middle = lengths.len() / 2;
        let median = lengths.get(middle).is_some().then(|| *lengths.select_nth_unstable_by(middle, f64::total_cmp).1);
        Near::new(points.iter().map(|&v| (v, at(v))), median.unwrap_or(0.0).max(tolerance))
    }

    /// How many places [`each`](Self::each) would call with in all, if it were asked for every place. O(places).
    pub(super) fn pairs(&self) -> u64 {
        let around =
            |cube: &I64Vec3| neighbours(*cube).map(|at| self.cubes.get(&at).map_or(0, Vec::len) as u64).sum::<u64>();
        self.cubes.iter().map(|(cube, places)| places.len() as u64 * around(cube)).sum()
    }

    /// Calls with every place within the size of a cube of a straight line, some of them several times, and maybe others.
    pub(super) fn along(&self, a: DVec3, b: DVec3, mut visit: impl FnMut(u32)) {
        let steps = (a.distance(b) / self.size).ceil();
        if steps <= MOST_CUBES {
            (0..=steps as u32).for_each(|k| self.each(a.lerp(b, f64::from(k) / steps.max(1.0)), &mut visit));
        } else {
            let mut all: Vec<u32> = self.cubes.values().flatten().copied().collect();
            all.sort_unstable();
            all.into_iter().for_each(visit);
        }
    }
}

/// A cube and those around it.
fn neighbours(cube: I64Vec3) -> impl Iterator<Item = I64Vec3> {
    (0..27).map(move |i| cube + I64Vec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, sample};

    #[test]
    fn slits_are_gaps_and_holes_are_not() {
        // Two plates side by side, 1e-3 apart, the second with points in the middle of the first one's edge.
        let (one, two) = (sample::build("plate", 1).unwrap(), sample::build("plate", 3).unwrap());
        let mut mesh = one.clone();
        let first = one.points.len() as u32;
        mesh.points.extend(two.points.iter().map(|p| *p + 1.001 * DVec3::X));
        two.faces.iter().for_each(|f| mesh.faces.push(&f.iter().map(|v| v + first).collect::<Vec<_>>()));
        let gaps = Topology::new(&mesh).gaps(0.01);
        // Both ends on this side, four points on the other.
        assert_eq!(gaps.len(), 6);
        assert!(gaps.iter().all(|gap| (gap.distance - 1e-3).abs() < 1e-12));
        assert!(Topology::new(&mesh).gaps(1e-4).is_empty());
        assert!(Topology::new(&Mesh::default()).gaps(1.0).is_empty());
    }
}
