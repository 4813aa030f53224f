//! Points of rims that are nearly at one place become one.
//!
//! Which points those are depends on the points alone, not on their order: all pairs within the tolerance belong together, and so do
//! pairs that have a point in common. A cluster that has grown longer than twice the tolerance that way is left alone: the points
//! lie closer than the tolerance by nature there. Of each cluster the point stays that is closest to its middle.

use super::clean::push_mapped;
use super::{Setting, is_crowded, rebuilt};
use crate::mesh::gaps::Near;
use crate::mesh::{Mesh, Topology};
use crate::sets::Sets;
use glam::DVec3;

/// Welds the points of rims that are within the tolerance. Tells how many points went.
pub(super) fn weld(mesh: &Mesh, setting: &Setting) -> (Mesh, u64) {
    let topology = Topology::new(mesh);
    let mut rim: Vec<u32> = topology.boundary_sides().iter().flat_map(|&side| topology.ends(side)).collect();
    rim.sort_unstable();
    rim.dedup();
    rim.retain(|&v| mesh.points[v as usize].is_finite());
    let at = |i: u32| mesh.points[rim[i as usize] as usize];
    let sets = Sets::new(rim.len());
    let near = Near::new((0..rim.len() as u32).map(|i| (i, at(i))), setting.tolerance);
    if is_crowded(near.pairs(), rim.len()) {
        return (mesh.clone(), 0);
    }
    for i in 0..rim.len() as u32 {
        near.each(at(i), |j| {
            if j < i && at(i).distance(at(j)) <= setting.tolerance {
                sets.union(i, j);
            }
        });
    }
    let mut clusters: Vec<(u32, u32)> = (0..rim.len() as u32).map(|i| (sets.root(i), i)).collect();
    clusters.sort_unstable();
    let mut numbers: Vec<u32> = (0..mesh.points.len() as u32).collect();
    let mut points = mesh.points.clone();
    let mut welded = 0;
    for cluster in clusters.chunk_by(|a, b| a.0 == b.0).filter(|cluster| cluster.len() > 1) {
        let mut places: Vec<DVec3> = cluster.iter().map(|&(_, i)| at(i)).collect();
        // Sums in an order of their own, so that the numbers of points make no difference.
        places.sort_unstable_by(|a, b| compare(*a, *b));
        let (low, high) = places.iter().fold((places[0], places[0]), |(low, high), &p| (low.min(p), high.max(p)));
        if low.distance(high) > 2.0 * setting.tolerance {
            continue;
        }
        let middle = places.iter().map(|&p| p - places[0]).sum::<DVec3>() / places.len() as f64 + places[0];
        let stays = places.iter().min_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
        let first = rim[cluster[0].1 as usize];
        points[first as usize] = *stays.expect("a cluster has points");
        cluster.iter().for_each(|&(_, i)| numbers[rim[i as usize] as usize] = first);
        welded += cluster.len() as u64 - 1;
    }
    let mut result = rebuilt(mesh, |_, face, faces| {
        let is_sound = face.iter().all(|&v| (v as usize) < numbers.len());
        if is_sound { push_mapped(faces, face, |v| numbers[v as usize]) } else { faces.push(face) }
    });
    result.points = points;
    // Points that are used no more go at once; otherwise they would count as defects.
    let all_exist = result.faces.corners().iter().all(|&v| (v as usize) < result.points.len());
    if welded > 0 && all_exist { (super::clean::remove_void(&result, setting).0, welded) } else { (mesh.clone(), 0) }
}

/// By coordinates, x first.
fn compare(a: DVec3, b: DVec3) -> std::cmp::Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{setting, soup};
    use super::*;
    use crate::mesh::chance::Chance;
    use crate::mesh::sample;

    /// A mesh whose faces share no points, with points moved a little.
    fn shaken(mesh: &Mesh, by: f64) -> Mesh {
        let mut chance = Chance(4);
        let mut loose = soup(mesh);
        loose.points.iter_mut().for_each(|p| *p += chance.within_cube(by));
        loose
    }

    #[test]
    fn loose_triangles_become_a_surface() {
        let torus = sample::build("torus", 1).unwrap();
        let setting = Setting { tolerance: 1e-5, ..setting() };
        for by in [0.0, 2e-6] {
            let (welded, count) = weld(&shaken(&torus, by), &setting);
            assert_eq!(welded.validate(), Ok(()), "{by}");
            assert_eq!(
                (welded.points.len(), count),
                (torus.points.len(), (torus.faces.len() * 3 - torus.points.len()) as u64)
            );
        }
        assert_eq!(weld(&shaken(&torus, 2e-6), &Setting { tolerance: 0.0, ..setting }).1, 0);
        // Inner points stay.
        let (same, count) = weld(&torus, &Setting { tolerance: 1.0, ..setting });
        assert_eq!((same == torus, count), (true, 0));
    }

    /// Bug C4.12: which points were welded depended on their order; triangles that collapsed were kept with a point twice.
    #[test]
    fn the_order_of_points_makes_no_difference() {
        let knot = sample::build("knot-holes", 1).unwrap();
        let loose = shaken(&knot, 2e-6);
        let n = loose.points.len() as u32;
        let mut turned = loose.clone();
        turned.points.reverse();
        turned.faces = loose
            .faces
            .iter()
            .map(|f| f.iter().map(|v| n - 1 - v).collect::<Vec<_>>())
            .collect::<Vec<_>>()
            .iter()
            .map(|f| &f[..])
            .collect();
        let setting = Setting { tolerance: 1e-5, ..setting() };
        let places = |mesh: &Mesh| {
            mesh.faces
                .iter()
                .map(|f| f.iter().map(|&v| mesh.points[v as usize].to_array()).collect::<Vec<_>>())
                .collect::<Vec<_>>()
        };
        let (one, other) = (weld(&loose, &setting), weld(&turned, &setting));
        assert_eq!((one.1, places(&one.0)), (other.1, places(&other.0)));
        // With a tolerance as large as the small triangles, they go.
        let coarse = weld(&loose, &Setting { tolerance: 0.03, ..setting }).0;
        assert_eq!(coarse.report().degenerate_faces, 0);
    }

    #[test]
    fn rows_of_points_closer_than_the_tolerance_stay() {
        let points = (0..30).map(|i| DVec3::new(f64::from(i / 3), f64::from(i % 3 / 2), 0.0)).collect();
        let faces: Vec<[u32; 3]> = (0..10).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let row = Mesh { points, faces: faces.iter().map(|f| &f[..]).collect() };
        assert_eq!(weld(&row, &Setting { tolerance: 1.1, ..setting() }).1, 0);
    }
}
