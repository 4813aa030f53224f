//! What tests compare with: solids from functions, and homology by the book on a dense grid.

use crate::grid::brick::{Local, Plane};
use crate::grid::{Extent, Key};
use crate::octree::crossings::finest_element;
use crate::octree::{EditedOctree, SignedOctree};

/// The octree of the lattice points for which `inside` says so; those with a coordinate 0 are outside.
pub(crate) fn octree(depth: u32, inside: impl Fn([u32; 3]) -> bool + Sync) -> SignedOctree {
    let inside = |p: [u32; 3]| p.iter().all(|&c| c > 0 && c < 1 << depth) && inside(p);
    let n = 1 << (depth - 3);
    let mut signs = Vec::new();
    let mut uniform = Vec::new();
    for (x, y, z) in lattice(n) {
        let key = Key::cell(depth - 3, [x, y, z]).expect("in the root");
        let mut plane = Plane::EMPTY;
        for local in (0..512).map(Local::from_index) {
            let c = local.coords();
            if inside([8 * x + c[0], 8 * y + c[1], 8 * z + c[2]]) {
                plane.set(local);
            }
        }
        signs.push((key, plane));
    }
    signs.sort_unstable_by_key(|(key, _)| *key);
    // Full bricks are not listed unless an edge that they own is crossed, so that deep regions are deep.
    let all = signs.clone();
    let find = |key: Key| all[all.binary_search_by_key(&key, |(key, _)| *key).expect("all are there")].1;
    signs.retain(|&(key, plane)| {
        let same = |other: Plane| other == plane;
        let alike = plane.is_empty() || plane == Plane::FULL;
        let beside = crate::grid::Face::ALL.into_iter().filter_map(|face| key.neighbour(face));
        !(alike && beside.into_iter().all(|key| same(find(key))))
    });
    for (key, plane) in &all {
        if *plane == Plane::FULL && signs.binary_search_by_key(key, |(key, _)| *key).is_err() {
            uniform.push(*key);
        }
    }
    SignedOctree::from_signs(
        depth,
        false,
        &signs,
        |key| uniform.binary_search(&key).is_ok(),
        |_, crossed, samples| {
            let count: u32 = crossed.iter().map(Plane::count).sum();
            let middle = crate::octree::crossings::Sample::new(1 << 15, 0);
            samples.extend((0..count).map(|_| middle));
        },
    )
}

fn lattice(n: u32) -> impl Iterator<Item = (u32, u32, u32)> {
    (0..n).flat_map(move |x| (0..n).flat_map(move |y| (0..n).map(move |z| (x, y, z))))
}

/// All elements of the solid of an octree, asked one by one.
pub(crate) fn elements(octree: &EditedOctree) -> Vec<Key> {
    let depth = octree.signed().crossings().depth();
    let mut list = Vec::new();
    for (x, y, z) in lattice(1 << depth) {
        for extent in Extent::ALL {
            let key = finest_element(depth, [x, y, z], extent);
            if octree.contains(key) {
                list.push(key);
            }
        }
    }
    list.sort_unstable();
    list
}

/// Betti numbers over the field of two elements, by reducing boundary matrices (the standard algorithm of persistent homology).
pub(crate) fn betti(elements: &[Key]) -> [usize; 3] {
    let mut order: Vec<Key> = elements.to_vec();
    order.sort_unstable_by_key(|key| (key.dir().dimension(), *key));
    let number: std::collections::HashMap<Key, usize> = order.iter().enumerate().map(|(i, &k)| (k, i)).collect();
    let mut columns: Vec<Vec<usize>> = Vec::new();
    let mut pivots: std::collections::HashMap<usize, usize> = std::collections::HashMap::new();
    let mut betti = [0; 4];
    for (i, key) in order.iter().enumerate() {
        let mut column: Vec<usize> = key.boundary().map(|face| number[&face]).collect();
        column.sort_unstable();
        while let Some(&low) = column.last() {
            let Some(&other) = pivots.get(&low) else { break };
            column = difference(&column, &columns[other]);
        }
        let dimension = key.dir().dimension() as usize;
        match column.last() {
            None => betti[dimension] += 1,
            Some(&low) => {
                pivots.insert(low, i);
                betti[dimension - 1] -= 1;
            }
        }
        columns.push(column);
    }
    assert_eq!(betti[3], 0, "nothing in space encloses itself");
    [betti[0], betti[1], betti[2]]
}

/// Symmetric difference of sorted lists.
fn difference(a: &[usize], b: &[usize]) -> Vec<usize> {
    let mut sum = Vec::with_capacity(a.len() + b.len());
    let (mut i, mut j) = (0, 0);
    while i < a.len() || j < b.len() {
        match (a.get(i), b.get(j)) {
            (Some(x), Some(y)) if x == y => (i, j) = (i + 1, j + 1),
            (Some(x), y) if y.is_none_or(|y| x < y) => {
                sum.push(*x);
                i += 1;
            }
            (_, y) => {
                sum.extend(y);
                j += 1;
            }
        }
    }
    sum
}

/// A pseudo-random number for a lattice point, the same on every run.
pub(crate) fn noise(seed: u64, p: [u32; 3]) -> f64 {
    let mut h = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for c in p {
        h = (h ^ u64::from(c)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h ^= h >> 29;
    }
    h = h.wrapping_mul(0x94d0_49bb_1331_11eb);
    (h >> 11) as f64 / (1u64 << 53) as f64
}

/// Noise on a grid of `cell` lattice points, interpolated between.
pub(crate) fn smooth_noise(seed: u64, cell: u32, p: [u32; 3]) -> f64 {
    let base = p.map(|c| c / cell);
    let t = p.map(|c| f64::from(c % cell) / f64::from(cell));
    let mut sum = 0.0;
    for corner in 0..8 {
        let high = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
        let weight: f64 = (0..3).map(|a| if high[a] == 1 { t[a] } else { 1.0 - t[a] }).product();
        sum += weight * noise(seed, [base[0] + high[0], base[1] + high[1], base[2] + high[2]]);
    }
    sum
}

/// The distance of a lattice point from a torus round the axis given by a direction, in cells: negative inside.
pub(crate) fn torus(centre: [f64; 3], axis: [f64; 3], big: f64, small: f64, p: [u32; 3]) -> f64 {
    let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
    let d: [f64; 3] = std::array::from_fn(|a| f64::from(p[a]) - centre[a]);
    let along: f64 = (0..3).map(|a| d[a] * axis[a] / length).sum();
    let across = (d.iter().map(|c| c * c).sum::<f64>() - along * along).max(0.0).sqrt();
    (across - big).hypot(along) - small
}
