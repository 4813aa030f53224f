//! Signs to surface: the boundary of the solid as a mesh.
//!
//! Both extractors walk over bricks, look at 512 cells at a time (`cells`) and use the derived tables of
//! [`grid::cases`](crate::grid::cases), so they agree on the topology. They pass the mesh on as it is made: first the points of all
//! bricks, then the faces, in the order of the bricks; the mesh as a whole is never held.

mod cells;
mod cubes;
mod dual;
mod edited;

pub use cubes::marching_cubes;
/// Bricks of a piece: some five thousand cells, whose points and faces stay in the cache until they are taken.
const PIECE: usize = 64;

pub use dual::{DualOptions, Placement, dual_contouring};
pub use edited::dual_contouring_edited;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Frame;
    use crate::grid::Axis;
    use crate::mesh::{Mesh, MeshSizes};
    use crate::octree::SignedOctree;
    use crate::octree::crossings::{Builder, Sample, Toggle, finest_element};
    use crate::progress::Silent;
    use crate::sign::parity_signs;
    use glam::DVec3;
    use proptest::prelude::*;

    const DEPTH: u32 = 5;
    const N: u32 = 1 << DEPTH;

    /// The octree of a sign volume; crossings at pseudo-random places.
    fn octree(inside: impl Fn([u32; 3]) -> bool) -> SignedOctree {
        let mut toggles = Vec::new();
        let mut state = 12345u32;
        for i in 0..N.pow(3) {
            let at = [i / N / N, i / N % N, i % N];
            for axis in Axis::ALL {
                let mut end = at;
                end[axis.index()] += 1;
                if inside(at) != inside(end) {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let sample = Sample::new((state >> 16) as u16, state as u16 % 0xfe00);
                    toggles.push(Toggle { edge: finest_element(DEPTH, at, axis.into()), sample });
                }
            }
        }
        parity_signs(Builder::new(DEPTH, true).finish().toggled(toggles))
    }

    fn frame() -> Frame {
        Frame::new(DVec3::ZERO, f64::from(N), DEPTH).unwrap()
    }

    /// All surfaces of an octree.
    fn surfaces(octree: &SignedOctree) -> Vec<Mesh> {
        let collect = |extract: &dyn Fn(&mut Mesh) -> MeshSizes| {
            let mut mesh = Mesh::default();
            let sizes = extract(&mut mesh);
            let found = MeshSizes {
                points: mesh.points.len() as u64,
                faces: mesh.faces.len() as u64,
                corners: mesh.faces.corners().len() as u64,
            };
            assert_eq!(found, sizes, "sizes are known beforehand");
            mesh
        };
        let dual = |placement, triangles| {
            let options = DualOptions { placement, triangles };
            collect(&|mesh| dual_contouring(octree, &frame(), &options, mesh, &Silent).unwrap())
        };
        vec![
            collect(&|mesh| marching_cubes(octree, &frame(), mesh, &Silent).unwrap()),
            dual(Placement::SharpFeatures, true),
            dual(Placement::SharpFeatures, false),
            dual(Placement::MassPoint, false),
        ]
    }

    fn check(octree: &SignedOctree) -> Vec<Mesh> {
        assert_eq!(octree.validate(), Ok(()));
        let surfaces = surfaces(octree);
        for (i, mesh) in surfaces.iter().enumerate() {
            assert_eq!(mesh.validate(), Ok(()), "surface {i}");
        }
        surfaces
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// Noise of any density: every cell case next to every other.
        #[test]
        fn random_signs_give_closed_manifolds(seed in any::<u64>(), density in 1u64..8) {
            let inside = |p: [u32; 3]| {
                let hash = p.iter().fold(seed, |h, &c| (h ^ u64::from(c)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29));
                p.iter().all(|&c| (9..23).contains(&c)) && hash % 8 < density
            };
            let surfaces = check(&octree(inside));
            // All extractors agree on the topology.
            let reports: Vec<_> = surfaces.iter().map(Mesh::report).collect();
            for report in &reports {
                prop_assert_eq!(report.components, reports[0].components);
                prop_assert_eq!(report.genus, reports[0].genus);
                prop_assert!(report.volume > 0.0);
            }
        }
    }

    #[test]
    fn a_box_is_a_box() {
        let octree = octree(|p| p.iter().all(|&c| (6..18).contains(&c)));
        for mesh in check(&octree) {
            let report = mesh.report();
            assert_eq!((report.components, report.genus), (1, Some(0)));
            assert!(report.volume > 11f64.powi(3) && report.volume < 13f64.powi(3), "{}", report.volume);
        }
    }

    #[test]
    fn nothing_is_nothing() {
        for mesh in check(&octree(|_| false)) {
            assert!(mesh.points.is_empty() && mesh.faces.is_empty());
        }
    }

    /// The two opposite corners outside of a cell are joined through it: a tunnel.
    #[test]
    fn outside_is_joined_through_corners() {
        let (a, b) = ([10, 10, 10], [11, 11, 11]);
        let octree = octree(|p| p.iter().all(|&c| (8..14).contains(&c)) && p != a && p != b);
        for mesh in check(&octree) {
            assert_eq!(mesh.report().components, 2, "one cavity, not two");
        }
    }

    #[test]
    fn threads_make_no_difference() {
        let octree = octree(|p| p.iter().all(|&c| (2..30).contains(&c)) && (p[0] * 7 + p[1] * 3 + p[2]) % 5 < 2);
        let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        assert_eq!(pool(1).install(|| surfaces(&octree)), pool(3).install(|| surfaces(&octree)));
    }
}
