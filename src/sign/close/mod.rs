//! Closing holes: further edges are switched until no grid face is odd (Ju 2004, section 5, on keys instead of a tree).
//!
//! The crossed edges are faces of a dual surface whose vertices are cells; a grid face with an odd number of crossed edges is
//! an edge of that surface's boundary, joining two cells. Every cell has an even number of odd faces, so the boundary falls
//! into rings of cells. Each ring is filled by divide and conquer:
//!
//! 1. Take the smallest octree cube that holds the ring; one of its middle planes cuts the ring.
//! 2. Where the ring goes through the plane and comes back, join the two places by a straight line in the plane. The line
//!    crosses grid edges of the plane: switch those. It runs along the cells on either side of the plane, so the ring falls
//!    into one on each side.
//! 3. A ring that doubles back on itself is shortened; one that is left with a single cell is gone. Fill the rest likewise.
//!
//! Invariant: the odd faces are at any time the steps of the rings not yet filled. Switching an edge of the plane turns over the
//! two faces in the plane beside it (in a row along the line they cancel, but for the ends, where the ring went through) and
//! one face on each side, which is the new step of the new ring there. So no second trace is needed, and since a switch is
//! an XOR, rings do not disturb each other: all are filled in parallel from the same crossings.
//!
//! Departures from PolyMender: rings are simple (a walk that meets itself closes a ring at once), a plane's crossings are paired with
//! the nearest neighbour along the ring, patches carry the position of the line and the normal of the part of the hole that it
//! cuts (the area vector of that part's ring, so normals turn along the patch as the hole does), and where an edge is switched off
//! nothing is left behind.
//!
//! Cost: about 1 us an odd face for tracing, 0.1 us a switched edge.

mod patch;
mod rings;
mod runs;

pub(crate) use patch::Switch;

use crate::error::Result;
use crate::grid::Key;
use crate::octree::crossings::{Crossings, Toggle};
use crate::progress::{Progress, Stage, check};
use patch::Patch;
use rayon::prelude::*;
use rings::{Exit, Step, trace};
use std::sync::atomic::{AtomicU64, Ordering};

/// What [`close`] did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Closing {
    /// Grid faces that were odd: the length of all boundaries of the scanned surface, in cells.
    pub odd_faces: u64,
    /// Rings that the boundary fell into: about the number of holes.
    pub rings: u64,
    /// Edges that were switched.
    pub switched: u64,
    /// Edges that faces cross and that were switched off: of open sheets, which are closed onto themselves and vanish, all.
    pub vanished: u64,
}

/// Switches edges until no face is odd, so that any input gets an inside.
///
/// # Errors
/// `Cancelled`.
pub fn close(crossings: Crossings, progress: &dyn Progress) -> Result<(Crossings, Closing)> {
    let odd_faces = crossings.count_odd_faces();
    if odd_faces == 0 {
        return Ok((crossings, Closing::default()));
    }
    let held = crossings.bytes() as u64 + odd_faces * RIM_BYTES;
    progress.hold(held)?;
    let odd = crossings.odd_faces();
    // Each odd face under both its cells.
    let number = |(face, number): (&Key, u32)| (*face, Exit { number, face: *face });
    let exits =
        odd.iter().zip(0..).map(number).flat_map(|(face, exit)| face.coboundary().map(move |cell| (cell, exit)));
    let exits = exits.collect();
    drop(odd);
    let (switches, rings) = fill(&crossings, exits, held, progress)?;
    let mut toggles: Vec<Toggle> =
        switches.into_iter().map(|Switch { edge, sample, .. }| Toggle { edge, sample }).collect();
    let mut closing = Closing { odd_faces, rings, ..Closing::default() };
    closing.switched = toggles.len() as u64;
    toggles.par_sort_unstable();
    let once = toggles.par_chunk_by(|a, b| a.edge == b.edge).filter(|same| same.len() % 2 == 1);
    closing.vanished = once.filter(|same| crossings.is_crossed(same[0].edge)).count() as u64;
    let crossings = crossings.toggled_within(toggles, progress)?;
    debug_assert_eq!(crossings.count_odd_faces(), 0, "filling all rings leaves no odd face");
    Ok((crossings, closing))
}

/// The most bytes for each face of a boundary: listed, under both its cells, as a step of the walk and of its ring, and as a step of the
/// rings into which that is cut.
const RIM_BYTES: u64 = 8 + 3 * size_of::<(Key, Exit)>() as u64 + 1 + 16 + 2 * size_of::<Step>() as u64;

/// The most bytes for each switched edge: in a list that may be half empty, and in one list of all.
const SWITCH_BYTES: u64 = 3 * size_of::<Switch>() as u64;

/// Traces the rings of a boundary and fills them: the edges switched, and the number of rings. `held` bytes are held already.
fn fill(
    crossings: &Crossings,
    exits: Vec<(Key, Exit)>,
    held: u64,
    progress: &dyn Progress,
) -> Result<(Vec<Switch>, u64)> {
    let rings = trace(crossings, exits, progress)?;
    progress.begin(Stage::Close, rings.len() as u64);
    let count = rings.len() as u64;
    let switched = AtomicU64::new(0);
    // Asked while a patch grows.
    let note = |switches: usize| {
        check(progress)?;
        let all = switched.fetch_add(switches as u64, Ordering::Relaxed) + switches as u64;
        progress.hold(held + all * SWITCH_BYTES)
    };
    let switches: Result<Vec<Vec<Switch>>> = rings
        .into_par_iter()
        .map(|ring| {
            let switches = Patch::of(ring, crossings, &note)?;
            progress.advance(1);
            Ok(switches)
        })
        .collect();
    Ok((switches?.concat(), count))
}

#[cfg(test)]
mod tests {
    use super::patch::middle_plane;
    use super::rings::{Ring, Step, shortened};
    use super::*;
    use crate::geom::normal::NormalCode;
    use crate::grid::{Axis, Extent};
    use crate::octree::crossings::Builder;
    use crate::octree::crossings::{Sample, finest_element};
    use crate::progress::Silent;
    use crate::sign::parity_signs;
    use glam::DVec3;
    use proptest::prelude::*;

    fn ring(cells: &[u32]) -> Ring {
        cells.iter().map(|&c| Step { cell: [c, 0, 0], exit: DVec3::splat(f64::from(c)) }).collect()
    }

    fn cells(ring: &[Step]) -> Vec<u32> {
        ring.iter().map(|s| s.cell[0]).collect()
    }

    #[test]
    fn spikes_are_cut_off() {
        assert_eq!(cells(&shortened(ring(&[1, 2, 3, 2, 5, 6]))), [1, 2, 5, 6]);
        assert_eq!(cells(&shortened(ring(&[1, 2, 3, 4, 3, 2, 5, 6]))), [1, 2, 5, 6]);
        // Across the seam: 9 1 2 .. 2 1 is a way to 9 and back.
        assert_eq!(cells(&shortened(ring(&[1, 2, 5, 6, 2]))), [2, 5, 6]);
        assert!(shortened(ring(&[1, 2])).is_empty());
        assert!(shortened(ring(&[1, 2, 3, 2])).is_empty());
        assert!(shortened(Vec::new()).is_empty());
    }

    #[test]
    fn the_plane_is_that_of_the_smallest_cube() {
        let plane = middle_plane(&ring(&[5, 6])).unwrap();
        assert_eq!((plane.axis, plane.at), (Axis::X, 6));
        let plane = middle_plane(&ring(&[3, 4])).unwrap();
        assert_eq!(plane.at, 4);
        assert!(middle_plane(&ring(&[7, 7])).is_none());
    }

    fn edges(depth: u32, list: &[([u32; 3], usize)]) -> Crossings {
        let sample = Sample::new(1 << 15, 0);
        let toggle = |&(at, axis): &([u32; 3], usize)| Toggle {
            edge: finest_element(depth, at, Extent::from(Axis::ALL[axis])),
            sample,
        };
        Builder::new(depth, true).finish().toggled(list.iter().map(toggle).collect())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        /// Whatever edges are crossed, closing leaves no odd face, and signs agree with crossings.
        #[test]
        fn anything_is_closed(list in prop::collection::vec(((1u32..31, 1u32..31, 1u32..31), 0usize..3), 0..60)) {
            let list: Vec<_> = list.into_iter().map(|((x, y, z), axis)| ([x, y, z], axis)).collect();
            let crossings = edges(5, &list);
            prop_assert_eq!(crossings.validate(), Ok(()));
            let (closed, closing) = close(crossings, &Silent).unwrap();
            prop_assert!(closed.odd_faces().is_empty());
            prop_assert!(closing.odd_faces % 2 == 0);
            prop_assert_eq!(parity_signs(closed).validate(), Ok(()));
        }
    }

    /// A square sheet with a square hole: the outer and the inner ring are filled, and the patch of the hole lies in its plane.
    #[test]
    fn a_hole_in_a_box_is_filled_flat() {
        let mut list = Vec::new();
        for i in 4..20 {
            for j in 4..20 {
                for side in [3, 19] {
                    list.extend([([side, i, j], 0), ([i, side, j], 1)]);
                    if side == 3 || !(8..14).contains(&i) || !(8..14).contains(&j) {
                        list.push(([i, j, side], 2));
                    }
                }
            }
        }
        let (closed, closing) = close(edges(5, &list), &Silent).unwrap();
        assert_eq!(closing.rings, 1);
        assert_eq!(closing.odd_faces, 4 * 6);
        assert_eq!(closing.switched, 36);
        let whole = parity_signs(closed);
        let inside = (0..33u32.pow(3)).filter(|i| whole.is_inside([i / 33 / 33, i / 33 % 33, i % 33])).count();
        assert_eq!(inside, 16 * 16 * 16);
    }

    /// A box without its walls at +x and +z: one bent hole. Its patch turns with it, and everywhere it faces outward between +x and +z.
    #[test]
    fn the_patch_of_a_bent_hole_bends() {
        let mut list = Vec::new();
        for i in 4..20 {
            for j in 4..20 {
                list.extend([([3, i, j], 0), ([i, 3, j], 1), ([i, 19, j], 1), ([i, j, 3], 2)]);
            }
        }
        let open = edges(5, &list);
        let (closed, closing) = close(open.clone(), &Silent).unwrap();
        assert_eq!(closing.rings, 1);
        let mut normals = Vec::new();
        let bricks = closed.bricks().iter();
        for brick in bricks {
            for axis in Axis::ALL {
                for local in brick.crossed[axis.index()].iter() {
                    let at = std::array::from_fn(|a| closed.origin(brick)[a] + local.coords()[a]);
                    let edge = finest_element(5, at, Extent::from(axis));
                    if !open.is_crossed(edge) {
                        let code = closed.sample(edge).expect("the edge is crossed").normal;
                        normals.push(NormalCode(code).decode(axis));
                    }
                }
            }
        }
        let middle = glam::Vec3A::new(1.0, 0.0, 1.0).normalize();
        assert!(normals.iter().all(|n| n.dot(middle).abs() > 0.5), "{normals:?}");
        assert!(normals.iter().any(|n| n.angle_between(normals[0]) > 0.3), "a flat patch: {:?}", normals[0]);
    }
}
