//! Edges one after another.

use crate::mesh::Topology;

/// Edges that follow each other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chain {
    /// Its points in order; the first does not come again at the end.
    pub points: Vec<u32>,
    /// Whether the last point is followed by the first.
    pub is_closed: bool,
}

impl Chain {
    /// Its edges, as pairs of points in its order.
    pub fn pieces(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        let back = self.is_closed.then(|| [self.points[self.points.len() - 1], self.points[0]]);
        self.points.windows(2).map(|pair| [pair[0], pair[1]]).chain(back)
    }

    /// Its length in model units.
    pub fn length(&self, topology: &Topology<'_>) -> f64 {
        let at = |p: u32| topology.mesh().points[p as usize];
        self.pieces().map(|[a, b]| at(a).distance(at(b))).sum()
    }
}

/// Joins edges, each given by one of its sides, into chains as long as possible: they end where other than two of the edges meet. No edge
/// is lost or comes twice. Chains with ends come first, in order of their lower ends; then those without, in order of their lowest
/// points. O(n log n).
pub fn chains(topology: &Topology<'_>, edges: &[u32]) -> Vec<Chain> {
    // Each edge twice, by its ends.
    let mut halves: Vec<[u32; 2]> = edges.iter().map(|&side| topology.ends(side)).filter(|[a, b]| a != b).collect();
    halves.extend_from_within(..);
    let n = halves.len() / 2;
    halves[n..].iter_mut().for_each(|half| half.reverse());
    halves.sort_unstable();
    halves.dedup();
    let range = |point: u32| {
        let start = halves.partition_point(|half| half[0] < point);
        start..start + halves[start..].partition_point(|half| half[0] == point)
    };
    let mut is_used = vec![false; halves.len()];
    let mut use_half = |i: usize| {
        let [a, b] = halves[i];
        let back = halves.binary_search(&[b, a]).expect("each edge is there both ways");
        is_used[back] = true;
        !std::mem::replace(&mut is_used[i], true)
    };
    let mut found = Vec::new();
    let mut follow = |first: usize| {
        if !use_half(first) {
            return;
        }
        let [start, mut at] = halves[first];
        let mut points = vec![start];
        while at != start {
            points.push(at);
            let here = range(at);
            let Some(next) = (here.len() == 2).then(|| here.clone().find(|&i| use_half(i))).flatten() else { break };
            at = halves[next][1];
        }
        found.push(Chain { points, is_closed: at == start });
    };
    (0..halves.len()).filter(|&i| range(halves[i][0]).len() != 2).for_each(&mut follow);
    (0..halves.len()).for_each(follow);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{EdgeKey, sample};
    use std::collections::BTreeSet;

    #[test]
    fn chains_end_at_branches_and_lose_nothing() {
        let cube = sample::build("cube", 2).unwrap();
        let topology = Topology::new(&cube);
        let sharp = topology.features(&super::super::FeatureOptions::default()).edges();
        let found = chains(&topology, &sharp);
        // Twelve edges of two pieces between the corners.
        assert_eq!(found.len(), 12);
        assert!(
            found.iter().all(|chain| chain.points.len() == 3 && !chain.is_closed && chain.length(&topology) == 1.0)
        );
        let pieces: BTreeSet<EdgeKey> = found.iter().flat_map(Chain::pieces).map(|[a, b]| EdgeKey::new(a, b)).collect();
        assert!(pieces.into_iter().eq(sharp.iter().map(|&s| topology.key(s)).collect::<BTreeSet<_>>()));
        // All edges of a surface, each once though given twice.
        let all: Vec<u32> = topology.edges().chain(topology.edges()).collect();
        let found = chains(&topology, &all);
        assert_eq!(found.iter().flat_map(Chain::pieces).count(), all.len() / 2);
        assert!(chains(&topology, &[]).is_empty());
    }

    #[test]
    fn loops_are_closed() {
        let holes = sample::build("knot-holes", 1).unwrap();
        let topology = Topology::new(&holes);
        let found = chains(&topology, &topology.boundary_sides());
        assert_eq!(found.len(), 7);
        assert!(found.iter().all(|chain| chain.is_closed && chain.pieces().count() == chain.points.len()));
        // A loop with a tail ends where the tail begins.
        let faces: [&[u32]; 1] = [&[0, 1, 2, 3]];
        let mesh = crate::Mesh { points: vec![glam::DVec3::ZERO; 4], faces: faces.into_iter().collect() };
        let topology = Topology::new(&mesh);
        assert_eq!(chains(&topology, &[0, 1, 2, 3])[0], Chain { points: vec![0, 1, 2, 3], is_closed: true });
    }
}
