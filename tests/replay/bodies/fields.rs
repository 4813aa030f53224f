//! Surfaces of any samples by every method.

use super::Draw;
use zmend::Mesh;
use zmend::contour::volume::{ExtractOptions, Method, extract};
use zmend::progress::Silent;
use zmend::volume::{Dense, Level};

/// What samples are made of: two values, three, the level itself and beside it, huge ones, none.
const VALUES: [f32; 16] = [
    -1.0,
    1.0,
    0.0,
    0.5,
    -0.5,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    1e30,
    -1e30,
    f32::MAX,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    -0.0,
    1e-3,
    7.0,
];
pub(crate) fn extracted(bytes: &[u8]) {
    let mut draw = Draw::new(bytes);
    let size: [usize; 3] = [(); 3].map(|()| 1 + draw.below(7));
    // Of the first two values alone, of the first three, or of all.
    let kinds = draw.one_of(&[2, 3, 5, 16, 16]);
    let level = draw.one_of(&[0.0, 0.5, -1.0, 1e-3]);
    let is_below = draw.coin();
    let samples: Vec<f32> = (0..size.iter().product::<usize>()).map(|_| VALUES[draw.below(kinds)]).collect();
    let volume = Dense::new(&samples, size).expect("as many as there are");
    let mut eulers = Vec::new();
    for method in Method::ALL {
        let level = if is_below { Level::below(level) } else { Level::above(level) };
        let mut mesh = Mesh::default();
        let options = ExtractOptions { level, method, ..ExtractOptions::default() };
        extract(&volume, &options, &mut mesh, &Silent).expect("in memory");
        assert_eq!(mesh.validate(), Ok(()), "{method:?}");
        let corners = mesh.faces.corners().len() as i64;
        eulers.push((method, mesh.points.len() as i64 - corners / 2 + mesh.faces.len() as i64));
        if matches!(method, Method::MarchingCubes | Method::ExtendedMarchingCubes) {
            assert_eq!(
                eulers[0].1,
                eulers.last().expect("just pushed").1,
                "{method:?} has the topology of {:?}",
                Method::ALL[0]
            );
        }
    }
}
