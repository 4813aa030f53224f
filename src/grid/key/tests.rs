//! The laws of keys, for every small element and for random ones.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::morton::{add, field, subtract};
use super::*;
use crate::grid::axis::{Direction, Edge, Face};

fn cell() -> impl Strategy<Value = Key> {
    (0..=MAX_LEVEL, [0..SIDE, 0..SIDE, 0..SIDE]).prop_map(|(l, p)| Key::holding(p, l).expect("inside the root"))
}

/// Any element but a point.
fn sized() -> impl Strategy<Value = Key> {
    (cell(), 0..27usize).prop_map(|(cell, part)| part_of(cell, part))
}

fn element() -> impl Strategy<Value = Key> {
    let side = 0..=SIDE;
    let point = [side.clone(), side.clone(), side].prop_map(|p| Key::point(p).expect("inside the root"));
    prop_oneof![3 => sized(), 1 => point]
}

/// Parts of a cell: 12 edges, 6 faces, itself for anything else.
fn part_of(cell: Key, part: usize) -> Key {
    match part {
        0..12 => cell.edge(Edge::ALL[part]),
        12..18 => cell.face(Face::ALL[part - 12]),
        _ => cell,
    }
}

fn cells_of(level: u32) -> impl Iterator<Item = Key> {
    let n = 1 << level;
    (0..n * n * n).map(move |i| Key::cell(level, [i / n / n, i / n % n, i % n]).expect("below 2^level"))
}

/// Every element of every kind and of levels up to 3, and the points that are their corners.
fn small_elements() -> BTreeSet<Key> {
    (0..=3).flat_map(cells_of).flat_map(|c| (0..27).map(move |i| part_of(c, i)).chain(c.corners())).collect()
}

/// The elements of `level` and one dimension more around `element`, by looking at all of them.
fn coboundary_oracle(element: Key, level: u32) -> BTreeSet<Key> {
    let candidates = cells_of(level).flat_map(|c| (0..27).map(move |i| part_of(c, i)));
    candidates.filter(|c| c.boundary().any(|b| b == element)).collect()
}

#[test]
fn every_small_element_obeys_the_laws() {
    let elements = small_elements();
    // Levels 0 ..= 3 have n^3 cells, 3 n^2 (n + 1) faces, 3 n (n + 1)^2 edges; the points are those of level 3.
    let sum: usize = [1usize, 2, 4, 8].iter().map(|n| n.pow(3) + 3 * n * n * (n + 1) + 3 * n * (n + 1).pow(2)).sum();
    assert_eq!(elements.len(), sum + 9usize.pow(3));
    for &e in &elements {
        laws(e);
    }
}

#[test]
fn coboundary_is_the_transpose_of_boundary() {
    for e in small_elements().into_iter().filter(|e| e.level().is_none_or(|l| l == 2)) {
        let level = e.level().unwrap_or(2);
        if e.is_point() && e.code().trailing_zeros() < 3 * 17 {
            continue; // no corner of level 2
        }
        assert_eq!(e.coboundary_at(level).collect::<BTreeSet<_>>(), coboundary_oracle(e, level), "{e}");
    }
}

/// What holds for any valid key.
fn laws(e: Key) {
    assert!(e.is_valid(), "{e:?}");
    assert_eq!(Key::from_bits(e.to_bits()), Some(e));
    assert_eq!(Key::from_fields(e.to_fields()), Some(e));
    assert_eq!(Key::element(e.center(), e.dir()), Some(e));

    let (min, max, center) = (e.min_corner(), e.max_corner(), e.center());
    for axis in Axis::ALL {
        let i = axis.index();
        assert_eq!(max[i] - min[i], if e.dir().contains(axis) { e.size() } else { 0 });
        assert_eq!(min[i] + max[i], 2 * center[i]);
    }
    let points: Vec<Key> = e.points().collect();
    assert_eq!(points.iter().collect::<BTreeSet<_>>().len(), 1 << e.dir().dimension());
    assert_eq!((points[0].center(), points[points.len() - 1].center()), (min, max));
    assert!(points.iter().all(|p| p.is_valid() && p.is_point()));
    assert!(Key::ROOT.contains(e));

    let boundary: Vec<Key> = e.boundary().collect();
    assert_eq!(boundary.len(), 2 * e.dir().dimension() as usize);
    assert_eq!(e.boundary().len(), boundary.len());
    for b in &boundary {
        assert!(b.is_valid() && b.dir().dimension() + 1 == e.dir().dimension());
        assert!(b.is_point() || b.level() == e.level());
        assert!(b.coboundary_at(e.level().expect("not a point")).any(|c| c == e), "{b} in the boundary of {e}");
    }
    let mut twice: Vec<Key> = boundary.iter().flat_map(|b| b.boundary()).collect();
    twice.sort();
    assert!(twice.chunks(2).all(|pair| pair[0] == pair[1]), "boundary of boundary of {e} does not cancel");

    let Some(level) = e.level() else { return };
    assert_eq!((level, e.size()), (MAX_LEVEL + 1 - e.size().ilog2(), SIDE >> level));
    for c in e.coboundary() {
        assert!(c.is_valid() && c.level() == Some(level), "{c:?}");
        assert!(c.boundary().any(|b| b == e));
    }
    for face in Face::ALL {
        let i = face.axis().index();
        let expected = i64::from(center[i]) + if face.is_high() { 1 } else { -1 } * i64::from(e.size());
        let moved = e.neighbour(face);
        assert_eq!(moved.is_some(), (0..=i64::from(SIDE)).contains(&expected), "{e} {face}");
        if let Some(moved) = moved {
            let mut at = center;
            at[i] = expected as u32;
            assert_eq!(Key::element(at, e.dir()), Some(moved));
            assert_eq!(moved.neighbour(face.opposite()), Some(e));
        }
    }
    assert!(Direction::ALL.iter().all(|&d| e.toward(d).is_none_or(|n| n.toward(d.opposite()) == Some(e))));
    if e.is_cell() {
        cell_laws(e, level);
    }
}

fn cell_laws(cell: Key, level: u32) {
    let position = cell.min_corner().map(|x| x / cell.size());
    assert_eq!(Key::cell(level, position), Some(cell));
    assert_eq!(Key::holding(cell.min_corner(), level), Some(cell));
    assert_eq!(cell.parent().is_none(), level == 0);
    if let Some(parent) = cell.parent() {
        assert_eq!(parent.child(cell.corner_in_parent()), cell);
        assert_eq!(parent, cell.ancestor(level - 1));
        assert!(parent.contains(cell) && !cell.contains(parent));
    }
    assert_eq!((cell.ancestor(level), cell.ancestor(0)), (cell, Key::ROOT));
    if level < MAX_LEVEL {
        for (corner, child) in Corner::ALL.into_iter().zip(cell.children()) {
            assert!(child.is_valid() && cell.contains(child));
            assert_eq!((child.parent(), child.corner_in_parent()), (Some(cell), corner));
            assert_eq!(child.corner(corner), cell.corner(corner));
            assert_eq!(child.corner(!corner).center(), cell.center());
            assert_eq!(child < cell, corner != Corner::MAX);
            assert_eq!(Key::around(cell.code_inside(corner), level + 1), child);
        }
    }
    assert!(cell.points().eq(cell.corners()));
    assert!(cell.boundary().eq(cell.faces()));
    for edge in Edge::ALL {
        assert!(cell.edge(edge).points().eq(edge.corners().map(|c| cell.corner(c))));
    }
    for face in Face::ALL {
        let mut corners = face.corners();
        corners.sort();
        assert!(cell.face(face).points().eq(corners.map(|c| cell.corner(c))));
    }
    let neighbours: BTreeSet<Key> = cell.neighbours().collect();
    let inside = position.map(|i| 3 - u32::from(i == 0) - u32::from(i + 1 == 1 << level));
    assert_eq!(neighbours.len() as u32, inside.iter().product::<u32>() - 1);
    let touch = |n: &Key| cell.corners().iter().any(|p| n.corners().contains(p));
    assert!(!neighbours.contains(&cell) && neighbours.iter().all(touch));
}

proptest! {
    #[test]
    fn any_element_obeys_the_laws(e in element()) {
        laws(e);
    }

    #[test]
    fn interleaving_is_bit_by_bit(p in [0..1u32 << 20, 0..1u32 << 20, 0..1u32 << 20]) {
        let slow = (0..20).fold(0, |code, i| {
            let [x, y, z] = p.map(|c| u64::from(c >> i & 1));
            code | (4 * x + 2 * y + z) << (3 * i)
        });
        prop_assert_eq!(interleave(p), slow);
        prop_assert_eq!(deinterleave(slow), p);
    }

    #[test]
    fn dilated_sums_are_sums(p in [0..1u32 << 20, 0..1u32 << 20, 0..1u32 << 20], n in 0..1u32 << 20, a in 0..3) {
        let (a, mut distance) = (a as usize, [0; 3]);
        let axis = Axis::ALL[a];
        distance[a] = n;
        let (mut sum, mut difference) = (p, p);
        sum[a] = (p[a] + n) % (1 << 20);
        difference[a] = p[a].wrapping_sub(n) % (1 << 20);
        prop_assert_eq!(deinterleave(add(interleave(p), field(axis), interleave(distance))), sum);
        prop_assert_eq!(deinterleave(subtract(interleave(p), field(axis), interleave(distance))), difference);
    }

    #[test]
    fn any_bits_are_checked(bits: u64) {
        let keys = [Key::from_bits(bits), Key::from_bits(bits & (CODE >> 3)), Key::from_fields(bits)];
        keys.into_iter().flatten().for_each(laws);
    }

    #[test]
    fn cells_that_do_not_overlap_are_in_z_order(a in cell(), b in cell()) {
        prop_assert_eq!(a.cmp(&b).is_eq(), a == b);
        prop_assert_eq!(a.depth_first_rank() == b.depth_first_rank(), a == b);
        if !a.contains(b) && !b.contains(a) {
            let (p, q) = (interleave(a.min_corner()), interleave(b.min_corner()));
            prop_assert_eq!(a.cmp(&b), p.cmp(&q));
            prop_assert_eq!(a.depth_first_rank().cmp(&b.depth_first_rank()), p.cmp(&q));
        } else if a != b {
            prop_assert_eq!(a.depth_first_rank() < b.depth_first_rank(), a.contains(b));
        }
    }

    #[test]
    fn the_common_ancestor_is_the_smallest(a in cell(), level in 0..=MAX_LEVEL, d in [-3..=3i32, -3..=3, -3..=3]) {
        // Near one another, so that it is not always the root.
        let (at, size) = (a.center().map(|x| x as i32), a.size() as i32);
        let near = [0, 1, 2].map(|i| (at[i] + d[i] * size).clamp(0, SIDE as i32 - 1) as u32);
        let b = Key::holding(near, level).expect("clamped");
        let c = a.common_ancestor(b);
        prop_assert_eq!(c, b.common_ancestor(a));
        prop_assert!(c.contains(a) && c.contains(b));
        if c != a && c != b {
            prop_assert!(c.children().iter().all(|child| !(child.contains(a) && child.contains(b))));
        }
    }

    #[test]
    fn containment_is_that_of_boxes(a in cell(), e in element(), near in any::<bool>()) {
        let inside = e.min_corner().map(|x| x.min(SIDE - 1));
        let around = || Key::holding(inside, a.level().expect("a cell")).expect("inside the root");
        let a = if near { around() } else { a };
        let (outer, inner) = ((a.min_corner(), a.max_corner()), (e.min_corner(), e.max_corner()));
        prop_assert_eq!(a.contains(e), (0..3).all(|i| outer.0[i] <= inner.0[i] && inner.1[i] <= outer.1[i]));
    }
}

#[test]
fn constructors_refuse_what_does_not_exist() {
    assert_eq!(Key::cell(0, [0; 3]), Some(Key::ROOT));
    assert_eq!(Key::cell(3, [8, 0, 0]), None);
    assert_eq!(Key::cell(19, [0; 3]), None);
    assert_eq!(Key::point([SIDE + 1, 0, 0]), None);
    assert_eq!(Key::point([u32::MAX; 3]), None);
    assert!(Key::point([SIDE; 3]).is_some());
    assert_eq!(Key::element([2, 2, 4], Extent::CELL), None); // axes of different levels
    assert_eq!(Key::element([1, 1, 0], Extent::from(Axis::X)), None); // x-edges of level 18 lie at even y
    assert!(Key::element([1, SIDE, 0], Extent::from(Axis::X)).is_some());
    assert_eq!(Key::element([SIDE, 0, 0], Extent::from(Axis::X)), None);
    assert_eq!(Key::element([0, 0, 0], Extent::CELL), None);
    assert_eq!(Key::from_bits(1 << 63), None);
    assert_eq!(Key::from_fields(1 << 63), None);
    assert_eq!(Key::holding([SIDE, 0, 0], 3), None);
    assert_eq!(Key::holding([0, 0, 0], 19), None);
}

#[test]
fn the_layout_is_as_documented() {
    let point = Key::point([1, 2, 4]).expect("inside the root");
    assert_eq!(point.to_bits(), 0b001_010_100);
    assert_eq!(point.to_fields(), 1 << 40 | 2 << 20 | 4);
    let edge = Key::element([1, 2, 4], Extent::from(Axis::X)).expect("of level 18");
    assert_eq!(edge.to_bits(), 1 << 62 | 0b001_010_100);
    assert_eq!(edge.to_fields(), 1 << 62 | 1 << 40 | 2 << 20 | 4);
    assert_eq!(Key::ROOT.to_bits(), 7 << 60 | 7 << 54);
    assert_eq!(Key::ROOT.to_string(), "cell level 0 at 0,0,0");
    assert_eq!(edge.to_string(), "edge x level 18 at 0,2,4");
    assert_eq!(format!("{point:?} {:?}", Key(0)), "Key(point at 1,2,4) Key(point at 0,0,0)");
    assert_eq!(format!("{:?}", Key(7 << 60)), "Key(invalid 0x7000000000000000)");
}
