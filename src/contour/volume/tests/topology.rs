//! What is joined: the same in all methods that go by signs, and that of the interpolant in the one that goes by values.

use super::*;
use std::collections::BTreeMap;

/// The least point that a point is joined to.
fn root(parents: &mut [u32], mut point: u32) -> u32 {
    while parents[point as usize] != point {
        parents[point as usize] = parents[parents[point as usize] as usize];
        point = parents[point as usize];
    }
    point
}

/// The Euler numbers of the components, sorted: for closed surfaces, components and the genus of each.
fn topology(mesh: &Mesh) -> Vec<i64> {
    let mut parents: Vec<u32> = (0..mesh.points.len() as u32).collect();
    for side in mesh.faces.iter().flat_map(|face| face.windows(2)) {
        let [a, b] = [0, 1].map(|i| root(&mut parents, side[i]));
        parents[a.max(b) as usize] = a.min(b);
    }
    // Twice the Euler number of a closed surface is that of its points less that of its triangles.
    let mut doubled: BTreeMap<u32, i64> = BTreeMap::new();
    (0..parents.len() as u32).for_each(|point| *doubled.entry(root(&mut parents, point)).or_default() += 2);
    mesh.faces.iter().for_each(|face| *doubled.entry(root(&mut parents, face[0])).or_default() -= 1);
    let mut numbers: Vec<i64> = doubled.into_values().map(|n| n / 2).collect();
    numbers.sort_unstable();
    numbers
}

/// Marching cubes, plain and extended, dual contouring and surface nets join the same samples: their surfaces have as many components, of the
/// same genus.
#[test]
fn signs_alone_make_the_same_topology() {
    let size = [16, 15, 14];
    let mut handles = 0;
    for (share, seed) in
        [0.1, 0.3, 0.5, 0.7, 0.85, 0.95].into_iter().flat_map(|share| (0..4).map(move |seed| (share, seed)))
    {
        let mut chance = Chance(seed);
        let values: Vec<f32> =
            (0..size.iter().product()).map(|_| if chance.unit() < share { 1.0 } else { -1.0 }).collect();
        let of = |method| topology(&surface(&values, size, &ExtractOptions { method, ..ExtractOptions::default() }));
        let expected = of(Method::MarchingCubes);
        handles += expected.iter().map(|euler| 1 - euler / 2).sum::<i64>();
        for method in [Method::ExtendedMarchingCubes, Method::DualContouring, Method::SurfaceNets] {
            assert_eq!(of(method), expected, "{method:?}, {share} inside, seed {seed}");
        }
    }
    assert!(handles > 1000, "{handles}");
}

/// Two samples outside in opposite corners of a cell are joined through it, in all methods.
#[test]
fn tunnels_lead_through_cells() {
    for step in [[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]] {
        // Two cavities in a block, which are one.
        let holes = [[3, 3, 3], [3 + step[0], 3 + step[1], 3 + step[2]]];
        let block = Samples::new([7; 3], |at| if holes.contains(&at.map(|c| c as i32)) { -1.0 } else { 1.0 });
        for method in Method::ALL.into_iter().filter(|&method| method != Method::Trilinear) {
            let mesh = extracted(&block, &ExtractOptions { method, ..ExtractOptions::default() });
            assert_eq!(topology(&mesh), [2, 2], "{method:?} {step:?}");
        }
    }
}

/// Random samples with nothing at the border, and the trilinear interpolant of them on a lattice so many times as fine.
fn refined(values: &[f32], side: usize, times: usize) -> impl Volume + '_ {
    let dense = Dense::new(values, [side; 3]).unwrap();
    Samples::new([(side - 1) * times + 1; 3], move |at| {
        let low = at.map(|c| (c / times).min(side - 2));
        let part: [f64; 3] = std::array::from_fn(|a| (at[a] - low[a] * times) as f64 / times as f64);
        (0..8)
            .map(|corner| {
                let high: [usize; 3] = std::array::from_fn(|a| corner >> a & 1);
                let weights = (0..3).map(|a| if high[a] == 1 { part[a] } else { 1.0 - part[a] });
                weights.product::<f64>() * dense.value(std::array::from_fn(|a| low[a] + high[a]))
            })
            .sum()
    })
}

/// The surface for the trilinear interpolant has the components of that function, with the genus of each, as a lattice shows that is fine
/// enough; others do not.
#[test]
fn trilinear_topology_is_that_of_a_refined_lattice() {
    let side = 6;
    let (mut plain_differs, mut unclear) = (0, 0);
    for seed in 0..24 {
        let mut chance = Chance(seed);
        let values: Vec<f32> = (0..side * side * side)
            .map(|i| {
                let is_border = [i % side, i / side % side, i / (side * side)].iter().any(|&c| c == 0 || c == side - 1);
                let size = 0.1 + chance.unit() as f32;
                if is_border || chance.unit() < 0.5 { -size } else { size }
            })
            .collect();
        let of =
            |method| topology(&surface(&values, [side; 3], &ExtractOptions { method, ..ExtractOptions::default() }));
        let found = of(Method::Trilinear);
        let on_lattice = |times| topology(&extracted(&refined(&values, side, times), &ExtractOptions::default()));
        // Necks thinner than a step are not seen.
        let is_clear = on_lattice(7) == found || on_lattice(19) == found;
        unclear += usize::from(!is_clear);
        plain_differs += usize::from(of(Method::MarchingCubes) != found);
    }
    assert!(unclear <= 1 && plain_differs > 12, "{unclear} unclear, {plain_differs} otherwise");
}
