use super::*;
use crate::contour::Placement;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Extent, Key};
use crate::mesh::Mesh;
use crate::octree::SignedOctree;
use crate::octree::crossings::{Sample, finest_element, lattice_point};
use crate::progress::Silent;
use glam::DVec3;
use proptest::prelude::*;
use std::collections::{BTreeSet, HashSet};

/// A repeatable source of chance.
struct Chance(u64);

impl Chance {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % u64::from(limit)) as u32
    }
}

/// The representative of a set of numbers, each of which leads to another member.
fn root(sets: &mut [usize], mut i: usize) -> usize {
    while sets[i] != i {
        sets[i] = sets[sets[i]];
        i = sets[i];
    }
    i
}

/// A cubical complex as a dense grid of elements: coordinates are doubled, odd ones extend.
#[derive(Clone)]
struct Dense {
    depth: u32,
    side: usize,
    there: Vec<bool>,
}

type Element = [usize; 3];

impl Dense {
    fn of_signs(depth: u32, inside: impl Fn([u32; 3]) -> bool) -> Self {
        let side = 2 * (1 << depth) + 1;
        let mut dense = Dense { depth, side, there: vec![false; side.pow(3)] };
        for i in 0..dense.there.len() {
            let e = dense.element(i);
            dense.there[i] = Self::points(e).into_iter().all(|p| inside(p.map(|c| c as u32)));
        }
        dense
    }

    fn points(e: Element) -> Vec<[usize; 3]> {
        let ends = e.map(|c| if c % 2 == 1 { vec![c / 2, c / 2 + 1] } else { vec![c / 2] });
        let mut points = Vec::new();
        for &x in &ends[0] {
            for &y in &ends[1] {
                points.extend(ends[2].iter().map(|&z| [x, y, z]));
            }
        }
        points
    }

    fn element(&self, i: usize) -> Element {
        [i / self.side / self.side, i / self.side % self.side, i % self.side]
    }

    fn index(&self, [x, y, z]: Element) -> usize {
        (x * self.side + y) * self.side + z
    }

    fn contains(&self, e: Element) -> bool {
        self.there[self.index(e)]
    }

    fn key(&self, e: Element) -> Key {
        let extent = Axis::ALL.into_iter().filter(|a| e[a.index()] % 2 == 1).fold(Extent::POINT, Extent::with);
        finest_element(self.depth, e.map(|c| c as u32 / 2), extent)
    }

    /// Elements whose coordinates differ by one at most and only where `free` says so of this one's.
    fn around(&self, e: Element, free: impl Fn(usize) -> bool) -> Vec<Element> {
        let range = |c: usize| if free(c) { c.saturating_sub(1)..=(c + 1).min(self.side - 1) } else { c..=c };
        let mut found = Vec::new();
        for x in range(e[0]) {
            for y in range(e[1]) {
                found.extend(range(e[2]).map(|z| [x, y, z]));
            }
        }
        found
    }

    /// The element and all of which it is a part.
    fn star(&self, e: Element) -> Vec<Element> {
        self.around(e, |c| c % 2 == 0)
    }

    /// The element and all its parts.
    fn closure(&self, e: Element) -> Vec<Element> {
        self.around(e, |c| c % 2 == 1)
    }

    fn set(&mut self, elements: &[Element], there: bool) {
        for &e in elements {
            let i = self.index(e);
            self.there[i] = there;
        }
    }

    fn euler(&self) -> i64 {
        let sign = |e: Element| if e.iter().filter(|&&c| c % 2 == 1).count() % 2 == 0 { 1 } else { -1 };
        (0..self.there.len()).filter(|&i| self.there[i]).map(|i| sign(self.element(i))).sum()
    }

    /// Number of components of what is there or not there. Everything outside of the root is one.
    fn components(&self, there: bool) -> usize {
        let outside = self.there.len();
        let mut sets: Vec<usize> = (0..=outside).collect();
        for i in (0..outside).filter(|&i| self.there[i] == there) {
            let e = self.element(i);
            let mut join = |j: usize| {
                let (a, b) = (root(&mut sets, i), root(&mut sets, j));
                sets[a] = b;
            };
            if !there && e.iter().any(|&c| c == 0 || c == self.side - 1) {
                join(outside);
            }
            self.closure(e).into_iter().map(|f| self.index(f)).filter(|&j| self.there[j] == there).for_each(&mut join);
        }
        let mut roots = BTreeSet::new();
        for i in (0..outside).filter(|&i| self.there[i] == there) {
            roots.insert(root(&mut sets, i));
        }
        if !there {
            roots.insert(root(&mut sets, outside));
        }
        roots.len()
    }
}

/// The octree of some signs; samples are anywhere on their edges.
fn octree(depth: u32, inside: impl Fn([u32; 3]) -> bool + Sync) -> SignedOctree {
    let side = 1 << (depth - 3);
    let mut signs: Vec<(Key, Plane)> = Vec::new();
    for i in 0..side * side * side {
        let key = Key::cell(depth - 3, [i / side / side, i / side % side, i % side]).expect("in the root");
        let origin = lattice_point(depth, key);
        let mut plane = Plane::EMPTY;
        for p in (0..512).map(Local::from_index) {
            if inside(std::array::from_fn(|a| origin[a] + p.coords()[a])) {
                plane.set(p);
            }
        }
        signs.push((key, plane));
    }
    signs.sort_unstable_by_key(|s| s.0);
    SignedOctree::from_signs(
        depth,
        true,
        &signs,
        |_| false,
        |i, crossed, out| {
            let mut chance = Chance(i as u64);
            for _ in 0..crossed.iter().map(Plane::count).sum::<u32>() {
                out.push(Sample::new(chance.below(1 << 16) as u16, chance.below(0xfe00) as u16));
            }
        },
    )
}

fn frame(depth: u32) -> Frame {
    Frame::new(DVec3::new(-3.0, 1.0, 0.5), 2.0, depth).expect("a frame")
}

fn surface(octree: &EditedOctree, triangles: bool, placement: Placement<'_>) -> Mesh {
    let mut mesh = Mesh::default();
    let options = DualOptions { placement, triangles, ..DualOptions::default() };
    let frame = frame(octree.signed().crossings().depth());
    let sizes = dual_contouring_edited(octree, &frame, &options, &mut mesh, &Silent).expect("a surface");
    let found = MeshSizes {
        points: mesh.points.len() as u64,
        faces: mesh.faces.len() as u64,
        corners: mesh.faces.corners().len() as u64,
    };
    assert_eq!(found, sizes, "sizes are known beforehand");
    mesh
}

/// Some open stars out of the complex and some closures into it; the complex after that.
fn edited(signed: SignedOctree, dense: &mut Dense, chance: &mut Chance, cuts: u32, fills: u32) -> EditedOctree {
    let before = dense.clone();
    let side = dense.side as u32;
    for _ in 0..cuts {
        let there: Vec<usize> = (0..dense.there.len()).filter(|&i| dense.there[i]).collect();
        if !there.is_empty() {
            let e = dense.element(there[chance.below(there.len() as u32) as usize]);
            dense.set(&dense.star(e), false);
        }
    }
    for _ in 0..fills {
        let e = [0; 3].map(|_| chance.below(side) as usize);
        dense.set(&dense.closure(e), true);
    }
    let changed = |to: bool| -> Vec<Key> {
        let changed = (0..dense.there.len()).filter(|&i| dense.there[i] == to && before.there[i] != to);
        changed.map(|i| dense.key(dense.element(i))).collect()
    };
    let octree = EditedOctree::new(signed, changed(false), changed(true));
    assert_eq!(octree.validate(), Ok(()));
    octree
}

/// The surface is closed and manifold, and is the boundary of the thickened complex.
fn check(octree: &EditedOctree, dense: &Dense) {
    for (triangles, placement) in [(true, Placement::MassPoint), (false, Placement::SharpFeatures)] {
        let mesh = surface(octree, triangles, placement);
        assert_eq!(mesh.validate(), Ok(()), "triangles: {triangles}");
        let root = frame(octree.signed().crossings().depth()).cube();
        let is_in_root = |p: &DVec3| p.cmpge(root.min).all() && p.cmple(root.min + root.size).all();
        assert!(mesh.points.iter().all(is_in_root), "elements at the root's boundary stay in the root");
        let report = mesh.report();
        let boundaries = dense.components(true) + dense.components(false) - 1;
        assert_eq!(report.components as usize, boundaries, "a surface for each component and each cavity");
        // Each closed surface has the Euler number 2 - 2 genus, and all together twice that of the solid.
        let genus = boundaries as i64 - dense.euler();
        assert_eq!(report.genus, Some(genus));
        if !mesh.faces.is_empty() {
            assert!(report.volume > 0.0, "volume {}", report.volume);
        }
    }
}

/// Whether a point is inside: by chance, and never on the root's boundary.
fn noise(seed: u64, density: u64, depth: u32, margin: u32) -> impl Fn([u32; 3]) -> bool + Sync + Copy {
    move |p| {
        let hash = p.iter().fold(seed, |h, &c| (h ^ u64::from(c)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29));
        p.iter().all(|c| (margin..=(1 << depth) - margin).contains(c)) && hash % 8 < density
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]
    #[test]
    fn any_edits_give_closed_manifolds(seed: u64, density in 0u64..=8, cuts in 0u32..40, fills in 0u32..40) {
        let inside = noise(seed, density, 3, 1);
        let mut dense = Dense::of_signs(3, inside);
        let octree = edited(octree(3, inside), &mut dense, &mut Chance(seed), cuts, fills);
        check(&octree, &dense);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]
    /// Several bricks.
    #[test]
    fn edits_reach_across_bricks(seed: u64, density in 0u64..=8, cuts in 0u32..300, fills in 0u32..300) {
        let inside = noise(seed, density, 4, 2);
        let mut dense = Dense::of_signs(4, inside);
        let octree = edited(octree(4, inside), &mut dense, &mut Chance(seed), cuts, fills);
        check(&octree, &dense);
    }

    /// Polygons none of whose cells is touched are the same and come in the same order; all others have a vertex in such a cell.
    #[test]
    fn untouched_cells_stay_as_they_were(seed: u64, density in 1u64..8, cuts in 1u32..6, fills in 0u32..6) {
        let inside = noise(seed, density, 4, 4);
        let mut dense = Dense::of_signs(4, inside);
        let octree = edited(octree(4, inside), &mut dense, &mut Chance(seed), cuts, fills);
        let mut touched = HashSet::new();
        for &element in octree.removed().iter().chain(octree.added()) {
            let e: [usize; 3] = element.center().map(|c| (c >> (18 - 4)) as usize);
            touched.extend(dense.star(e).into_iter().filter(|c| c.iter().all(|c| c % 2 == 1)).map(|c| c.map(|c| c / 2)));
        }
        let frame = frame(4);
        let faces = |octree: &EditedOctree, keep: &dyn Fn(bool) -> bool| -> Vec<Vec<[u64; 3]>> {
            let mesh = surface(octree, false, Placement::MassPoint);
            let is_touched = |&v: &u32| {
                let cell = (mesh.points[v as usize] - frame.origin()) / frame.cell_size();
                // Outside of the root there is nothing but what was added.
                let is_outside = cell.min_element() < 0.0 || cell.max_element() >= 16.0;
                is_outside || touched.contains(&cell.to_array().map(|c| c as usize))
            };
            let kept = mesh.faces.iter().filter(|face| keep(face.iter().any(is_touched)));
            kept.map(|face| face.iter().map(|&v| mesh.points[v as usize].to_array().map(f64::to_bits)).collect()).collect()
        };
        let before = EditedOctree::unedited(octree.signed().clone());
        prop_assert_eq!(faces(&octree, &|touched| !touched), faces(&before, &|touched| !touched));
    }
}

/// Each of the 256 cases next to every edit of one cell: thousands of them.
#[test]
fn every_case_with_edits_in_one_cell() {
    let mut chance = Chance(7);
    for mask in 0..256u32 {
        for _ in 0..2 {
            let around = chance.below(1 << 30);
            let inside = |p: [u32; 3]| {
                let q = p.map(|c| c.wrapping_sub(3));
                if q.iter().all(|&c| c < 2) {
                    return mask >> (4 * q[0] + 2 * q[1] + q[2]) & 1 == 1;
                }
                p.iter().all(|c| (2..6).contains(c)) && (around >> ((p[0] + 5 * p[1] + 7 * p[2]) % 30)) & 1 == 1
            };
            let mut dense = Dense::of_signs(3, inside);
            let before = dense.clone();
            // Parts of the cell from 3 to 4 on each axis.
            for _ in 0..=chance.below(4) {
                let e = [0; 3].map(|_| 6 + chance.below(3) as usize);
                let there = dense.contains(e);
                let changed = if there { dense.star(e) } else { dense.closure(e) };
                dense.set(&changed, !there);
            }
            let changed = |to: bool| -> Vec<Key> {
                let changed = (0..dense.there.len()).filter(|&i| dense.there[i] == to && before.there[i] != to);
                changed.map(|i| dense.key(dense.element(i))).collect()
            };
            let octree = EditedOctree::new(octree(3, inside), changed(false), changed(true));
            assert_eq!(octree.validate(), Ok(()));
            check(&octree, &dense);
        }
    }
}

#[test]
fn without_edits_nothing_is_different() {
    let signed = octree(5, noise(3, 4, 5, 9));
    let octree = EditedOctree::unedited(signed.clone());
    for triangles in [false, true] {
        let mut plain = Mesh::default();
        let options = DualOptions { triangles, ..DualOptions::default() };
        dual_contouring(&signed, &frame(5), &options, &mut plain, &Silent).expect("a surface");
        assert_eq!(surface(&octree, triangles, Placement::SharpFeatures), plain);
    }
}

/// A cavity deep inside and a bubble of a face far outside, in bricks that no crossing lists; and elements on the root's boundary.
#[test]
fn edits_may_be_far_from_the_surface() {
    let depth = 6;
    let signed = octree(depth, |p| p.iter().all(|c| (10..50).contains(c)));
    let brick = |b: [u32; 3]| Key::cell(depth - 3, b).expect("in the root");
    assert!(signed.crossings().find(brick([3, 3, 3])).is_none() && signed.crossings().find(brick([7, 7, 7])).is_none());
    let mut dense = Dense::of_signs(depth, |p| p.iter().all(|c| (10..50).contains(c)));
    let before = dense.clone();
    for e in [[55, 55, 55], [54, 57, 51], [60, 60, 61]] {
        dense.set(&dense.star(e), false);
    }
    for e in [[121, 121, 120], [128, 77, 128], [0, 1, 1], [0, 0, 0], [128, 128, 128], [1, 127, 64]] {
        dense.set(&dense.closure(e), true);
    }
    let changed = |to: bool| -> Vec<Key> {
        let changed = (0..dense.there.len()).filter(|&i| dense.there[i] == to && before.there[i] != to);
        changed.map(|i| dense.key(dense.element(i))).collect()
    };
    check(&EditedOctree::new(signed, changed(false), changed(true)), &dense);
}

/// Blocks keep to the middles of cells, and where a cell has several vertices, of their octants; beyond the root to its boundary.
#[test]
fn blocks_stay_blocks() {
    let inside = noise(17, 5, 4, 2);
    let mut dense = Dense::of_signs(4, inside);
    let octree = edited(octree(4, inside), &mut dense, &mut Chance(6), 20, 20);
    let mesh = surface(&octree, true, Placement::Centre);
    assert_eq!(mesh.validate(), Ok(()));
    let frame = frame(4);
    let touched = Touched::new(&octree, &Silent).expect("not cancelled");
    let single = touched.bricks.iter().flat_map(super::touched::TouchedBrick::cells);
    let single = single.filter(|&(cell, _)| touched.shape(touched.cells[cell]).vertices == 1);
    let middles: Vec<DVec3> = single.map(|(_, at)| touched.in_root(DVec3::from(at.map(f64::from)) + 0.5)).collect();
    assert!(middles.len() > 10);
    let there: HashSet<[u64; 3]> = mesh.points.iter().map(|p| p.to_array().map(f64::to_bits)).collect();
    for middle in middles {
        assert!(there.contains(&frame.to_model(middle).to_array().map(f64::to_bits)), "{middle}");
    }
}

#[test]
fn threads_make_no_difference() {
    let inside = noise(11, 5, 4, 2);
    let mut dense = Dense::of_signs(4, inside);
    let octree = edited(octree(4, inside), &mut dense, &mut Chance(5), 200, 200);
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
    let run = || surface(&octree, true, Placement::SharpFeatures);
    assert_eq!(pool(1).install(run), pool(3).install(run));
}

/// A membrane across the hole of a frame closes it, thin, and a cut through a bar opens a gap as wide as was taken out.
#[test]
fn a_membrane_is_thin_and_a_cut_is_wide() {
    let depth = 5;
    // A square frame of bars, six cells thick round a hole of ten.
    let solid = |p: [u32; 3]| {
        let [x, y, z] = p;
        let within = |c: u32, low: u32, high: u32| (low..high).contains(&c);
        within(z, 13, 19) && within(x, 5, 27) && within(y, 5, 27) && !(within(x, 11, 21) && within(y, 11, 21))
    };
    let genus = |octree: &EditedOctree| surface(octree, true, Placement::MassPoint).report().genus;
    let signed = octree(depth, solid);
    assert_eq!(genus(&EditedOctree::unedited(signed.clone())), Some(1));

    let mut dense = Dense::of_signs(depth, solid);
    let mut added = BTreeSet::new();
    for (x, y) in (10..21).flat_map(|x| (10..21).map(move |y| (x, y))) {
        added.extend(dense.closure([2 * x + 1, 2 * y + 1, 32]).into_iter().filter(|&e| !dense.contains(e)));
    }
    let filled = EditedOctree::new(signed.clone(), Vec::new(), added.iter().map(|&e| dense.key(e)).collect());
    assert_eq!(filled.validate(), Ok(()));
    assert_eq!(genus(&filled), Some(0));
    let mesh = surface(&filled, true, Placement::MassPoint);
    let frame = frame(depth);
    let cells = |p: &DVec3| (*p - frame.origin()) / frame.cell_size();
    let middle: Vec<DVec3> =
        mesh.points.iter().map(cells).filter(|p| (p.truncate() - glam::DVec2::splat(16.0)).length() < 2.5).collect();
    assert!(middle.len() > 20);
    for p in middle {
        let height = (p.z - 16.0).abs();
        assert!((0.15..0.5).contains(&height), "{p}");
    }

    let mut removed = BTreeSet::new();
    for (x, z) in (5..11).flat_map(|x| (13..19).map(move |z| (x, z))) {
        removed.extend(dense.star([2 * x, 33, 2 * z]).into_iter().filter(|&e| dense.contains(e)));
    }
    dense.set(&removed.iter().copied().collect::<Vec<_>>(), false);
    let cut = EditedOctree::new(signed, removed.iter().map(|&e| dense.key(e)).collect(), Vec::new());
    assert_eq!(cut.validate(), Ok(()));
    assert_eq!(genus(&cut), Some(0));
    let mesh = surface(&cut, true, Placement::MassPoint);
    // Across the bar, which lies along y between the points 16 and 17, nothing is within a fifth of a cell of the middle.
    let near = mesh.points.iter().map(cells).filter(|p| p.x < 10.5 && (p.y - 16.5).abs() < 0.2).count();
    assert_eq!(near, 0);
    assert!(mesh.points.iter().map(cells).any(|p| p.x < 10.5 && (p.y - 16.5).abs() < 0.4));
}
