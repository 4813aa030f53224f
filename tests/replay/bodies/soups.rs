//! Repair of any soup, by every rule into every surface.

use super::Draw;
use zmend::glam::DVec3;
use zmend::repair::{Keep, Offset, Thicken, Warning};
use zmend::{Error, Faces, Inside, Mesh, Options, Surface, repair, topology};

/// Values on planes of the grid, beside them by next to nothing, anywhere, and nowhere.
const VALUES: [f64; 16] =
    [2.0, 3.0, 4.0, 8.0, 8.000_000_001, 9.0, 11.0, 12.0, 14.0, 2.5, 7.000_3, 10.123_456_789, 5.0, 6.0, f64::NAN, 1e300];

pub(crate) fn repaired(bytes: &[u8]) {
    let mut draw = Draw::new(bytes);
    let options = options(&mut draw);
    let mesh = soup(&mut draw);
    let repaired = match repair(mesh, &options) {
        Ok(repaired) => repaired,
        // Options and coordinates are drawn without regard for each other.
        Err(Error::Setting { problem, .. }) => return assert!(!problem.is_empty()),
        Err(error) => panic!("{error}"),
    };
    let (mesh, report) = (&repaired.mesh, &repaired.report);
    assert_eq!(mesh.validate(), Ok(()), "{options:?}");
    let says_why = report.warnings.iter().any(|w| matches!(w, Warning::NoFaces | Warning::NothingEnclosed));
    assert_eq!(mesh.faces.is_empty(), says_why, "{:?}", report.warnings);
    if options.surface != Surface::DualContouring || options.no_self_intersections {
        assert!(mesh.outward(), "{options:?}");
    }
    let promised = matches!(options.surface, Surface::MarchingCubes | Surface::Blocks) || options.no_self_intersections;
    if promised && report.topology.is_none() {
        assert_eq!(mesh.self_intersections().len(), 0, "{options:?}");
    }
}

fn options(draw: &mut Draw<'_>) -> Options {
    let depth = 3 + draw.below(4) as u32;
    let mut options = Options {
        depth,
        inside: draw.one_of(&[Inside::Auto, Inside::Parity, Inside::Winding, Inside::Hull]),
        surface: draw.one_of(&[Surface::MarchingCubes, Surface::DualContouring, Surface::Quads, Surface::Blocks]),
        faces: draw.one_of(&[Faces::Auto, Faces::Triangles, Faces::Polygons]),
        no_self_intersections: draw.coin(),
        ..Options::default()
    };
    // In model units: soups are about twelve wide.
    let width = 12.0 * draw.share();
    let extras = draw.byte();
    match extras % 16 {
        0 => options.thicken = Some(width),
        1 => (options.thicken, options.thicken_what) = (Some(width), Thicken::All),
        2 => options.offset = Some(Offset::Solid(width)),
        3 => options.offset = Some(Offset::Solid(-width)),
        4 => options.offset = Some(Offset::Shell(width)),
        5 => options.gap = Some(width),
        6 => options.keep = Keep::Largest,
        7 => options.keep = Keep::Ratio(draw.share()),
        8 => options.topology = topology::Options { cut: Some(width), ..topology::Options::default() },
        9 => options.topology = topology::Options { fill: Some(width), ..topology::Options::default() },
        10 => {
            options.topology = topology::Options { genus: Some(draw.below(3) as u64), ..topology::Options::default() }
        }
        11 => options.scale = draw.share(),
        _ => {}
    }
    options.drop_cavities = extras & 64 > 0;
    options
}

/// A few points, and polygons of any of them.
fn soup(draw: &mut Draw<'_>) -> Mesh {
    let mut mesh = Mesh::default();
    for _ in 0..=draw.below(24) {
        // Points that are nowhere, or far away, are rare.
        let mut value = || if draw.byte() < 250 { VALUES[draw.below(14)] } else { VALUES[draw.below(16)] };
        mesh.points.push(DVec3::new(value(), value(), value()));
    }
    while !draw.is_empty() && mesh.faces.len() < 64 {
        let corners = draw.one_of(&[3, 3, 3, 3, 3, 3, 4, 4, 5, 2, 1, 0, 7]);
        let face: Vec<u32> = (0..corners).map(|_| draw.below(mesh.points.len()) as u32).collect();
        mesh.faces.push(&face);
    }
    mesh
}
