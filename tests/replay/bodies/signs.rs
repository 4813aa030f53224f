//! Topology of any signs: what is cut and filled is told, and surfaces agree with what is counted.

use super::Draw;
use zmend::geom::Frame;
use zmend::glam::DVec3;
use zmend::grid::Key;
use zmend::grid::brick::{Local, Plane};
use zmend::octree::SignedOctree;
use zmend::octree::crossings::{Sample, lattice_point};
use zmend::progress::Silent;
use zmend::topology::{Betti, Options as Repair};
use zmend::{Mesh, Options, Solid, Surface};

const DEPTH: u32 = 4;
const SIDE: usize = 1 << DEPTH;

pub(crate) fn mended(bytes: &[u8]) {
    let mut draw = Draw::new(bytes);
    let options = options(&mut draw);
    let solid = solid(&dense(draw));
    assert_eq!(solid.signed().validate(), Ok(()));
    let counted = Betti::of(&solid.octree);
    let (mended, report) = match solid.mended(&options, &Silent) {
        Ok(mended) => mended,
        Err(zmend::Error::Setting { problem, .. }) => return assert!(!problem.is_empty()),
        Err(error) => panic!("{error}"),
    };
    assert_eq!(mended.octree.validate(), Ok(()));
    assert_eq!((report.before, report.after), (counted, Betti::of(&mended.octree)));
    if options.fill_cavities.is_none() && options.drop_islands.is_none() {
        let removed = (report.cuts.len() + report.fills.len()) as u64;
        assert_eq!(report.before.handles - report.after.handles, removed, "each cut or fill removes one handle");
        assert_eq!(report.before.components, report.after.components);
        assert_eq!(report.before.cavities, report.after.cavities);
    }
    for (surface, no_self_intersections) in
        [(Surface::MarchingCubes, false), (Surface::Blocks, false), (Surface::Quads, true)]
    {
        let mut mesh = Mesh::default();
        let options = Options { surface, no_self_intersections, ..Options::default() };
        mended.extract(&options, &mut mesh, &Silent).expect("in memory");
        assert_eq!(mesh.validate(), Ok(()), "{surface:?}");
        let euler = mesh.points.len() as i64 - mesh.faces.corners().len() as i64 / 2 + mesh.faces.len() as i64;
        assert_eq!(euler, 2 * report.after.euler_number(), "{surface:?}");
    }
}

fn options(draw: &mut Draw<'_>) -> Repair {
    let size = [0.5, 1.0, 2.0, 4.0, 9.0, 30.0, f64::INFINITY, -1.0][draw.below(8)];
    let all = Repair::default();
    match draw.below(8) {
        0 => Repair { cut: Some(size), ..all },
        1 => Repair { fill: Some(size), ..all },
        2 => Repair { cut: Some(size), fill: Some(size), ..all },
        3 => Repair { cheapest: true, ..all },
        4 => Repair { genus: Some(draw.below(4) as u64), ..all },
        5 => Repair { fill_cavities: Some(size), ..all },
        6 => Repair { drop_islands: Some(size), cut: Some(size), ..all },
        _ => Repair { genus: Some(0), cheapest: true, fill_cavities: Some(f64::INFINITY), ..all },
    }
}

/// Signs of all points: boxes and balls first, then single points, then bits as they come.
fn dense(mut draw: Draw<'_>) -> Vec<bool> {
    let mut dense = vec![false; SIDE.pow(3)];
    for _ in 0..draw.below(6) {
        let (is_ball, is_solid) = (draw.coin(), draw.coin());
        let [a, b] = [(); 2].map(|()| [(); 3].map(|()| draw.below(SIDE)));
        for (i, sign) in dense.iter_mut().enumerate() {
            let p = [i / SIDE / SIDE, i / SIDE % SIDE, i % SIDE];
            let is_in = if is_ball {
                (0..3).map(|k| p[k].abs_diff(a[k]).pow(2)).sum::<usize>() <= b[0].pow(2) / 4
            } else {
                (0..3).all(|k| (a[k].min(b[k])..=a[k].max(b[k])).contains(&p[k]))
            };
            if is_in {
                *sign = is_solid;
            }
        }
    }
    for _ in 0..draw.below(64) {
        let at = usize::from(draw.word()) % dense.len();
        dense[at] = !dense[at];
    }
    for (i, byte) in draw.rest().iter().enumerate() {
        for bit in 0..8 {
            if let Some(sign) = dense.get_mut(8 * i + bit) {
                *sign ^= byte >> bit & 1 == 1;
            }
        }
    }
    // The root's least sides are outside.
    for (i, sign) in dense.iter_mut().enumerate() {
        *sign &= [i / SIDE / SIDE, i / SIDE % SIDE, i % SIDE].iter().all(|&c| c > 0);
    }
    dense
}

fn solid(dense: &[bool]) -> Solid {
    let mut signs: Vec<(Key, Plane)> = Vec::new();
    for i in 0..8 {
        let key = Key::cell(DEPTH - 3, [i >> 2, i >> 1 & 1, i & 1]).expect("in the root");
        let origin = lattice_point(DEPTH, key);
        let mut plane = Plane::EMPTY;
        for p in (0..512).map(Local::from_index) {
            let [x, y, z] = std::array::from_fn(|a| (origin[a] + p.coords()[a]) as usize);
            if dense[(x * SIDE + y) * SIDE + z] {
                plane.set(p);
            }
        }
        signs.push((key, plane));
    }
    signs.sort_unstable_by_key(|brick| brick.0);
    let samples = |_: usize, crossed: &[Plane; 3], list: &mut Vec<Sample>| {
        let count: u32 = crossed.iter().map(Plane::count).sum();
        list.extend((0..count).map(|i| Sample::new((i * 7919 % 65536) as u16, 0)));
    };
    let frame = Frame::new(DVec3::ZERO, 1.0, DEPTH).expect("a frame");
    Solid::new(SignedOctree::from_signs(DEPTH, false, &signs, |_| false, samples), frame)
}
