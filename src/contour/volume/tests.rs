use super::*;
use crate::mesh::Mesh;
use crate::mesh::chance::Chance;
use crate::progress::Silent;
use crate::volume::Dense;

/// Kinds of random samples.
const KINDS: [fn(&mut Chance) -> f32; 4] = [
    |chance| chance.unit() as f32 - 0.5,
    |chance| if chance.unit() < 0.5 { -1.0 } else { 1.0 },
    |chance| (3.0 * chance.unit()).floor() as f32 - 1.0,
    |chance| {
        [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 0.0, 1e-30, -1e-30]
            [(8.0 * chance.unit()) as usize]
    },
];

fn random(kind: usize, size: [usize; 3], seed: u64) -> Vec<f32> {
    let mut chance = Chance(seed);
    (0..size.iter().product()).map(|_| KINDS[kind](&mut chance)).collect()
}

fn surface(values: &[f32], size: [usize; 3], options: &ExtractOptions) -> Mesh {
    let mut mesh = Mesh::default();
    let sizes = extract(&Dense::new(values, size).unwrap(), options, &mut mesh, &Silent).unwrap();
    assert_eq!((sizes.points, sizes.faces), (mesh.points.len() as u64, mesh.faces.len() as u64));
    mesh
}

#[test]
fn random_volumes_have_closed_surfaces() {
    for (kind, seed) in (0..KINDS.len()).flat_map(|kind| (0..4).map(move |seed| (kind, seed))) {
        let size = [[24, 24, 24], [62, 5, 7], [63, 3, 3], [130, 4, 2]][seed as usize];
        let mesh = surface(&random(kind, size, seed), size, &ExtractOptions::default());
        assert_eq!(mesh.validate(), Ok(()), "kind {kind}, seed {seed}");
        let report = mesh.report();
        assert_eq!((report.zero_area_faces, report.isolated_points), (0, 0));
        assert!(mesh.outward() && report.faces > 100);
    }
}
