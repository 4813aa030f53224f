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

use crate::error::Result;
use crate::geom::normal::NormalCode;
use crate::grid::{Axis, Extent, Key};
use crate::octree::crossings::{Crossings, OFFSET_MARGIN, Sample, Toggle, finest_element, lattice_point};
use crate::progress::{Progress, Stage, check};
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
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
}

/// Switches edges until no face is odd, so that any input gets an inside.
///
/// # Errors
/// `Cancelled`, `Memory` when `progress` says so, and when more than 2^32 edges are crossed.
pub fn close(crossings: Crossings, progress: &dyn Progress) -> Result<(Crossings, Closing)> {
    let odd_faces = crossings.count_odd_faces();
    if odd_faces == 0 {
        return Ok((crossings, Closing::default()));
    }
    let held = crossings.bytes() as u64 + odd_faces * ODD_FACE_BYTES;
    progress.hold(held)?;
    let odd = crossings.odd_faces();
    let rings = trace(&crossings, &odd, progress)?;
    drop(odd);
    progress.begin(Stage::Close, rings.len() as u64);
    let mut closing = Closing { odd_faces, rings: rings.len() as u64, switched: 0 };
    let switched = AtomicU64::new(0);
    // Asked while a patch grows.
    let note = |switches: usize| {
        check(progress)?;
        let all = switched.fetch_add(switches as u64, Ordering::Relaxed) + switches as u64;
        progress.hold(held + all * SWITCH_BYTES)
    };
    let toggles: Result<Vec<Vec<Toggle>>> = rings
        .into_par_iter()
        .map(|ring| {
            let mut patch = Patch { crossings: &crossings, normal: DVec3::ZERO, toggles: Vec::new() };
            patch.fill(ring, &note)?;
            progress.advance(1);
            Ok(patch.toggles)
        })
        .collect();
    let toggles = toggles?.concat();
    closing.switched = toggles.len() as u64;
    let crossings = crossings.toggled_within(toggles, progress)?;
    debug_assert_eq!(crossings.count_odd_faces(), 0, "filling all rings leaves no odd face");
    Ok((crossings, closing))
}

/// The most bytes for each odd face: listed (twice while the list is put together), under both its cells, as a step of the walk and of its
/// ring, and as a step of the rings into which that is cut.
const ODD_FACE_BYTES: u64 = 2 * 8 + 2 * 16 + 1 + 16 + 2 * size_of::<Step>() as u64;

/// The most bytes for each switched edge: in a list that may be half empty, and in one list of all.
const SWITCH_BYTES: u64 = 3 * size_of::<Toggle>() as u64;

/// A cell of a ring, in finest cells, and the point where the ring leaves it for the next one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    cell: [u32; 3],
    exit: DVec3,
}

/// A closed walk over cells, each sharing a face with the next.
type Ring = Vec<Step>;

/// Takes the odd faces apart into simple rings: no cell occurs twice in one.
fn trace(crossings: &Crossings, odd: &[Key], progress: &dyn Progress) -> Result<Vec<Ring>> {
    // Each odd face under both its cells.
    let mut ends: Vec<(Key, u32)> =
        odd.iter().zip(0..).flat_map(|(face, i)| face.coboundary().map(move |cell| (cell, i))).collect();
    ends.par_sort_unstable();
    let at_cell = |cell: Key| &ends[ends.partition_point(|e| e.0 < cell)..];
    let mut used = vec![false; odd.len()];
    let mut rings = Vec::new();
    // The walk so far: cells, and the face by which each is left.
    let mut walk: Vec<(Key, u32)> = Vec::new();
    let mut on_walk: hashbrown::HashMap<Key, usize, ahash::RandomState> =
        hashbrown::HashMap::with_hasher(ahash::RandomState::with_seeds(9, 10, 11, 12));
    let mut steps = 0u64;
    for start in 0..odd.len() {
        let mut cell = odd[start].coboundary().next().expect("a face has a cell");
        if used[start] {
            continue;
        }
        loop {
            steps += 1;
            if steps.is_multiple_of(4096) {
                check(progress)?;
            }
            if let Some(&since) = on_walk.get(&cell) {
                let ring = walk.split_off(since);
                for (cell, _) in &ring {
                    on_walk.remove(cell);
                }
                rings.push(ring.iter().map(|&(cell, face)| step(crossings, cell, odd[face as usize])).collect());
            }
            let exits = at_cell(cell).iter().take_while(|e| e.0 == cell).map(|e| e.1);
            let Some(exit) = exits.into_iter().find(|&f| !used[f as usize]) else {
                // Every cell has an even number of odd faces: only the start of a walk can run out of them.
                debug_assert!(walk.is_empty(), "a walk ends where it began");
                break;
            };
            used[exit as usize] = true;
            on_walk.insert(cell, walk.len());
            walk.push((cell, exit));
            cell = odd[exit as usize].coboundary().find(|&next| next != cell).expect("an odd face has two cells");
        }
    }
    Ok(rings)
}

/// A step of a ring through an odd face: the ring passes it at the mean of the crossings of its edges.
fn step(crossings: &Crossings, cell: Key, face: Key) -> Step {
    let depth = crossings.depth();
    let (mut sum, mut n) = (DVec3::ZERO, 0.0);
    for edge in face.boundary() {
        if let Some(sample) = crossings.sample(edge) {
            let axis = edge.dir().axes().next().expect("an edge has an axis");
            let mut p = lattice_point(depth, edge).map(f64::from);
            p[axis.index()] += sample.position();
            sum += DVec3::from(p);
            n += 1.0;
        }
    }
    Step { cell: lattice_point(depth, cell), exit: sum / n }
}

/// Twice the area vector of a ring (Newell): the direction that most of its patch faces.
fn area_vector(ring: &[Step]) -> DVec3 {
    let Some(first) = ring.first() else { return DVec3::ZERO };
    ring.windows(2).map(|w| (w[0].exit - first.exit).cross(w[1].exit - first.exit)).sum()
}

/// Lines that pass a lattice point as closely as this, in cells, may pass it on either side: positions of crossings are kept
/// that far from the ends of their edges, and rounded.
const NEAR: f64 = 2.0 * OFFSET_MARGIN as f64 / 65536.0;

/// The patch of one ring, as it grows.
struct Patch<'a> {
    /// What was scanned.
    crossings: &'a Crossings,
    /// Normal of the part of the hole at work, any length.
    normal: DVec3,
    toggles: Vec<Toggle>,
}

impl Patch<'_> {
    /// Fills the hole in `ring`; `note` is told of switches as they come, and may refuse.
    fn fill(&mut self, ring: Ring, note: &dyn Fn(usize) -> Result<()>) -> Result<()> {
        let mut pending = vec![(ring, DVec3::ZERO)];
        while let Some((ring, whole)) = pending.pop() {
            let ring = shortened(ring);
            if let Some(plane) = middle_plane(&ring) {
                // A part of the hole faces where its own ring faces, so a patch over a bent hole bends. The ring of a part that has no
                // area to speak of says nothing: such a part faces where the whole did.
                let own = area_vector(&ring);
                self.normal = if own.length_squared() > 1.0 { own } else { whole };
                let before = self.toggles.len();
                pending.extend(self.cut(ring, plane).into_iter().map(|part| (part, self.normal)));
                note(self.toggles.len() - before)?;
            }
        }
        Ok(())
    }

    /// Cuts a ring by a plane that it crosses: rings that lie on one side each.
    ///
    /// The crossings of the plane divide the ring into runs. Time and again the run whose ends lie nearest to each other is cut off,
    /// and the runs before and after it become one, until a single one is left. Cost: linear in the ring's length, but for a logarithm.
    fn cut(&mut self, ring: Ring, plane: Plane) -> Vec<Ring> {
        let mut runs = Runs::new(ring, plane);
        let mut sides = Vec::with_capacity(runs.list.len());
        while let Some(i) = runs.nearest() {
            let (before, after) = (runs.list[i].before, runs.list[i].after);
            let mut run: Ring = std::mem::take(&mut runs.list[i].steps).into();
            // The run leaves through the plane at `b`; the rest comes back through it at `a`.
            let (b, a) = (*run.last().expect("runs have steps"), runs.end(before));
            let line = self.line(plane, &b, &a);
            // Both new rings follow the line, each on its side: the run from b to a, the rest from a to b.
            follow(&mut run, plane, b.cell, line.iter().copied());
            sides.push(run);
            let mut back = Ring::new();
            follow(&mut back, plane, a.cell, line.iter().rev().map(|l| Crossing { from: l.to, to: l.from, at: l.at }));
            let rest = &mut runs.list[before].steps;
            rest.pop_back();
            rest.extend(back);
            if before == after {
                sides.push(std::mem::take(rest).into());
                break;
            }
            runs.join(before, after);
        }
        sides
    }

    /// The straight line in the plane from where `b` leaves its cell to where `a` leaves its own: the grid edges that it crosses,
    /// which are switched. Where it passes a lattice point so closely that rounding decides on which side, it keeps to the surface
    /// if there is one, so that the patch of a flat sheet cancels all of it.
    fn line(&mut self, plane: Plane, b: &Step, a: &Step) -> Vec<Crossing> {
        let [u, v] = plane.axis.others().map(Axis::index);
        let (from, to) = ([b.exit[u], b.exit[v]], [a.exit[u], a.exit[v]]);
        let delta = [to[0] - from[0], to[1] - from[1]];
        let mut square = [b.cell[u], b.cell[v]];
        let goal = [a.cell[u], a.cell[v]];
        let mut line = Vec::new();
        while square != goal {
            // Part of the way after which the line leaves the square, for each direction in which it still has to go.
            let leaves = |d: usize| {
                let boundary = f64::from(square[d] + u32::from(goal[d] > square[d]));
                let t = (boundary - from[d]) / delta[d];
                if square[d] == goal[d] {
                    f64::INFINITY
                } else if t.is_finite() {
                    t.clamp(0.0, 1.0)
                } else {
                    0.5
                }
            };
            let t = [leaves(0), leaves(1)];
            // The edge by which the square is left in each direction.
            let edge_in = |d: usize| {
                let mut at = [0; 3];
                at[plane.axis.index()] = plane.at;
                at[[u, v][d]] = square[d] + u32::from(goal[d] > square[d]);
                at[[u, v][1 - d]] = square[1 - d];
                at
            };
            let mut d = usize::from(t[0] > t[1]);
            if square[1 - d] != goal[1 - d] {
                let corner = [0, 1].map(|d| f64::from(square[d] + u32::from(goal[d] > square[d])));
                let beside = delta[0] * (corner[1] - from[1]) - delta[1] * (corner[0] - from[0]);
                let is_crossed =
                    |d: usize| self.crossings.is_crossed(self.edge(edge_in(d), plane.axis.others()[1 - d]));
                if beside.abs() <= NEAR * delta[0].hypot(delta[1]) && !is_crossed(d) && is_crossed(1 - d) {
                    d = 1 - d;
                }
            }
            let (t, other) = (t[d], 1 - d);
            let up = goal[d] > square[d];
            let along = (from[other] + t * delta[other]).clamp(f64::from(square[other]), f64::from(square[other] + 1));
            let edge_at = edge_in(d);
            let mut at = DVec3::from(edge_at.map(f64::from));
            at[[u, v][other]] = along;
            self.switch(edge_at, plane.axis.others()[other], along - f64::from(square[other]));
            let mut next = square;
            next[d] = if up { square[d] + 1 } else { square[d] - 1 };
            line.push(Crossing { from: square, to: next, at });
            square = next;
        }
        line
    }

    fn edge(&self, at: [u32; 3], axis: Axis) -> Key {
        finest_element(self.crossings.depth(), at, Extent::from(axis))
    }

    fn switch(&mut self, at: [u32; 3], axis: Axis, position: f64) {
        let edge = self.edge(at, axis);
        // Where the line runs askew, it crosses edges in the plane of the hole itself: any slope will do there.
        let mut normal = self.normal;
        let least = 1e-3 * normal.length();
        let w = &mut normal[axis.index()];
        if w.abs() <= least {
            *w = if least > 0.0 { least.copysign(*w) } else { 1.0 };
        }
        let normal = NormalCode::encode(axis, normal.to_array());
        let sample = Sample::new((position * 65536.0) as u16, normal.0);
        self.toggles.push(Toggle { edge, sample });
    }
}

/// A step of a line in a plane over a grid edge, between two squares of the plane.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    from: [u32; 2],
    to: [u32; 2],
    at: DVec3,
}

/// Closes a run of cells, whose last one lies beside the plane where the line begins, by the cells along the line up to the
/// one before the line's end, where the run began. Cells are on the side of `from`.
fn follow(run: &mut Ring, plane: Plane, from: [u32; 3], line: impl Iterator<Item = Crossing>) {
    let [u, v] = plane.axis.others().map(Axis::index);
    // Without a line the run ends where it began, in the one cell beside the plane.
    run.pop();
    for crossing in line {
        let mut cell = from;
        cell[u] = crossing.from[0];
        cell[v] = crossing.from[1];
        run.push(Step { cell, exit: crossing.at });
    }
}

/// Part of a ring on one side of a plane: its last step leaves through the plane.
struct Run {
    steps: VecDeque<Step>,
    before: usize,
    after: usize,
    /// Entries in the queue from before the run was joined with others do not count.
    joined: u32,
}

/// The runs of a ring, and which has the nearest ends.
struct Runs {
    list: Vec<Run>,
    /// Squared distance of the ends (as bits, which have the order of positive numbers), run, how often it had been joined.
    queue: BinaryHeap<Reverse<(u64, usize, u32)>>,
}

impl Runs {
    /// Divides a ring where it goes through the plane. No runs if it does not.
    fn new(mut ring: Ring, plane: Plane) -> Runs {
        let leaves = |ring: &Ring, i: usize| plane.parts(ring[i].cell, ring[(i + 1) % ring.len()].cell);
        let mut runs = Runs { list: Vec::new(), queue: BinaryHeap::new() };
        if let Some(last) = (0..ring.len()).rev().find(|&i| leaves(&ring, i)) {
            let start = (last + 1) % ring.len();
            ring.rotate_left(start);
        }
        let mut steps = VecDeque::new();
        for i in 0..ring.len() {
            steps.push_back(ring[i]);
            if leaves(&ring, i) {
                let i = runs.list.len();
                runs.list.push(Run {
                    steps: std::mem::take(&mut steps),
                    before: i.wrapping_sub(1),
                    after: i + 1,
                    joined: 0,
                });
            }
        }
        let n = runs.list.len();
        if n > 0 {
            (runs.list[0].before, runs.list[n - 1].after) = (n - 1, 0);
        }
        (0..n).for_each(|i| runs.enqueue(i));
        runs
    }

    /// The step by which a run leaves through the plane.
    fn end(&self, run: usize) -> Step {
        *self.list[run].steps.back().expect("runs have steps")
    }

    fn enqueue(&mut self, run: usize) {
        let distance = self.end(self.list[run].before).exit.distance_squared(self.end(run).exit);
        self.queue.push(Reverse((distance.to_bits(), run, self.list[run].joined)));
    }

    /// The run whose ends lie nearest to each other; the first if there are several.
    fn nearest(&mut self) -> Option<usize> {
        loop {
            let Reverse((_, run, joined)) = self.queue.pop()?;
            if !self.list[run].steps.is_empty() && self.list[run].joined == joined {
                return Some(run);
            }
        }
    }

    /// Makes a run and the one after the next, between which a run has been cut off, one.
    fn join(&mut self, first: usize, second: usize) {
        let mut steps = std::mem::take(&mut self.list[first].steps);
        let more = &mut self.list[second].steps;
        // The shorter one is moved.
        if steps.len() < more.len() {
            steps.into_iter().rev().for_each(|step| more.push_front(step));
        } else {
            steps.append(more);
            *more = steps;
        }
        let before = self.list[first].before;
        self.list[second].before = before;
        self.list[before].after = second;
        self.list[second].joined += 1;
        self.enqueue(second);
    }
}

/// A plane of the grid.
#[derive(Debug, Clone, Copy)]
struct Plane {
    axis: Axis,
    /// Its coordinate, in cells.
    at: u32,
}

impl Plane {
    fn parts(self, a: [u32; 3], b: [u32; 3]) -> bool {
        (a[self.axis.index()] < self.at) != (b[self.axis.index()] < self.at)
    }
}

/// A middle plane of the smallest octree cube around the ring that the ring crosses; `None` for a single cell.
fn middle_plane(ring: &[Step]) -> Option<Plane> {
    let first = ring.first()?.cell;
    let mut differ = [0u32; 3];
    for step in ring {
        (0..3).for_each(|a| differ[a] |= step.cell[a] ^ first[a]);
    }
    // The highest bit in which coordinates differ is the size of the cube's halves.
    let axis = Axis::ALL.into_iter().rev().max_by_key(|a| differ[a.index()].checked_ilog2())?;
    let half = differ[axis.index()].checked_ilog2()?;
    Some(Plane { axis, at: (first[axis.index()] >> half | 1) << half })
}

/// Takes out the places where the ring steps back the way it came. Empty if nothing is left.
fn shortened(ring: Ring) -> Ring {
    let mut kept: Ring = Vec::with_capacity(ring.len());
    for step in ring {
        // From a to b and back to a: both steps go, and the walk goes on from a.
        if kept.len() >= 2 && kept[kept.len() - 2].cell == step.cell {
            kept.truncate(kept.len() - 2);
        }
        kept.push(step);
    }
    // The same across the seam, where the ring's end meets its beginning.
    let (mut start, mut end) = (0, kept.len());
    while end - start > 2 {
        if kept[end - 1].cell == kept[start + 1].cell {
            (start, end) = (start + 1, end - 1);
        } else if kept[end - 2].cell == kept[start].cell {
            end -= 2;
        } else {
            kept.truncate(end);
            kept.drain(..start);
            return kept;
        }
    }
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::crossings::Builder;
    use crate::progress::Silent;
    use crate::sign::parity_signs;
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
