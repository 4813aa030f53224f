//! The octree as a library of its own, from outside: what octrees of this kind got wrong before, each as a test, and a tree of a quarter
//! of a billion leaves.

mod pointer;

use std::collections::BTreeSet;
use std::time::Instant;

use zmend::geom::Domain;
use zmend::glam::DVec3;
use zmend::grid::key::{MAX_LEVEL, SIDE};
use zmend::grid::{Axis, Corner, Direction, Face, Key};
use zmend::octree::{Balance, LinearOctree, NodalOctree, RefineError};

/// Refined at a point, leaf by leaf.
fn toward(point: [u32; 3], level: u32, balance: Balance) -> LinearOctree<u32> {
    let mut tree = LinearOctree::from_iter([(Key::ROOT, 0)]);
    while let Some((leaf, _)) = tree.locate(point).filter(|(leaf, _)| leaf.level() < Some(level)) {
        tree.refine(leaf, balance, |child, _| child.size()).expect("a leaf above the finest level");
    }
    tree
}

/// Merging looked at the wrong cells, broke the balance, and left grandchildren without parents.
#[test]
fn a01_merging_keeps_balance_and_leaves_no_orphans() {
    let middle = SIDE / 2;
    let mut tree = toward([middle; 3], 6, Balance::Faces);
    let nodes = NodalOctree::with_values(tree.clone(), |_| 0.0f64);
    let mut refused = BTreeSet::new();
    for parent in tree.keys_z().into_iter().filter_map(Key::parent).collect::<BTreeSet<_>>() {
        // With refined children at corners 6 and 7, too.
        match tree.coarsen(parent, Balance::Faces, |records| records[0]) {
            Ok(()) | Err(RefineError::Blocked { .. }) => {}
            Err(RefineError::NotAFamily { child }) => {
                refused.insert(child.corner_in_parent().index());
                assert!(tree.state(child).is_refined());
            }
            Err(other) => panic!("{other}"),
        }
        assert_eq!((tree.validate(), tree.imbalance(Balance::Faces)), (Ok(()), None));
    }
    assert!(refused.contains(&7) || refused.contains(&0), "{refused:?}");
    let mut merged = nodes.clone();
    for leaf in nodes.tree().keys_z() {
        let _ = leaf.parent().map(|parent| merged.coarsen(parent, Balance::Off, |records| records[0]));
    }
    let corners: BTreeSet<Key> = merged.tree().iter().flat_map(|(leaf, _)| leaf.corners()).collect();
    assert_eq!(merged.len(), corners.len());
}

/// Splitting a leaf of the finest level said yes and did nothing; searches below it did not end; there, debug builds failed.
#[test]
fn a02_a03_a04_the_finest_level_is_a_level_like_others() {
    let mut tree = toward([77; 3], MAX_LEVEL, Balance::Corners);
    let (leaf, _) = tree.locate([77; 3]).expect("covered");
    let before = tree.len();
    assert_eq!((leaf.level(), leaf.size()), (Some(18), 2));
    assert_eq!(tree.refine(leaf, Balance::Corners, |_, &r| r), Err(RefineError::Finest { leaf }));
    assert_eq!((tree.len(), tree.validate()), (before, Ok(())));
    assert_eq!((Key::cell(19, [0; 3]), Key::holding([0; 3], 19)), (None, None));
    let around = tree.all_neighbours(leaf).map(|(other, _)| other.level());
    assert_eq!(around.filter(|&level| level == Some(18)).count(), 7);
    let one_level = LinearOctree::build(0, |_| true, |_| ());
    assert_eq!(one_level.len(), 1);
}

/// A point on the far boundary read beyond a table; the background cell was told by other arithmetic than the cells in it.
#[test]
fn a05_points_on_far_boundaries_have_a_leaf_that_holds_them() {
    let (min, max) = (DVec3::new(0.1, -7.3, 1e3), DVec3::new(0.4, 11.1, 1e3 + 0.7));
    let domain = Domain::new(min, max, [7, 3, 5]).expect("a box");
    let mut tree: LinearOctree<()> = domain.background().map(|cell| (cell, ())).collect();
    for step in 0..=210u32 {
        let share = DVec3::splat(f64::from(step) / 210.0);
        for p in [min + (max - min) * share, DVec3::new(max.x, min.y, max.z), max] {
            let p = p.clamp(min, max);
            let (leaf, ()) = tree.locate(domain.locate(p).expect("inside")).expect("covered");
            let (low, high) = domain.corners(leaf);
            assert!(low.cmple(p).all() && p.cmple(high).all(), "{p} is not in {low} to {high}");
            if domain.level(leaf) < Some(4) {
                tree.refine(leaf, Balance::Faces, |_, ()| ()).expect("a leaf");
            }
        }
    }
    assert_eq!(tree.imbalance(Balance::Faces), None);
}

/// A shift in 32 bits gave cells of deep levels no size.
#[test]
fn a06_sizes_hold_on_all_levels() {
    for level in 0..=MAX_LEVEL {
        let last = (1u32 << level) - 1;
        let cell = Key::cell(level, [last; 3]).expect("a cell");
        assert_eq!((cell.size(), cell.max_corner()), (SIDE >> level, [SIDE; 3]));
        assert_eq!(LinearOctree::from_iter([(cell, level)]).locate([SIDE; 3]), Some((cell, &level)));
    }
}

/// The box was grown about the origin, which lost points; flat clouds divided by zero.
#[test]
fn a07_boxes_grow_about_their_own_centre() {
    for (min, max) in [([10.0; 3], [20.0, 12.0, 11.0]), ([-20.0; 3], [-10.0, -20.0, -19.0]), ([5.0; 3], [5.0; 3])] {
        let (min, max) = (DVec3::from_array(min), DVec3::from_array(max));
        let domain = Domain::around(min, max, 0.25, 10).expect("a box");
        assert!(domain.min().cmplt(min).all() && domain.max().cmpgt(max).all());
        assert!(domain.locate(min).is_ok() && domain.locate(max).is_ok());
        let side = domain.cell_size(0);
        assert!((side.max_element() - side.min_element()).abs() < 1e-9 * side.max_element());
        assert!((domain.max() - domain.min()).max_element() <= 1.5 * (max - min).max_element().max(1.0) + side.x);
    }
}

/// Clouds were refined to the last level everywhere; points that coincide drove it there anyway.
#[test]
fn a08_refinement_for_points_ends_early() {
    let mut points = vec![[123_456, 7, SIDE]; 1000];
    points.extend((0..64u32).map(|i| [i % 4 * 100_000, i / 4 % 4 * 100_000, i / 16 * 100_000]));
    let (tree, order) = LinearOctree::of_points(&points, 8, MAX_LEVEL);
    assert_eq!(order.len(), points.len());
    // Where all points of a cell coincide, it is not split.
    assert!(tree.levels().max() <= Some(5), "{:?}", tree.levels().collect::<Vec<_>>());
    let mut seen = 0;
    for (leaf, range) in tree.iter_z() {
        let held: BTreeSet<[u32; 3]> =
            order[range.start as usize..range.end as usize].iter().map(|&i| points[i as usize]).collect();
        assert!(range.len() <= 8 || held.len() == 1);
        assert!(held.iter().all(|&p| tree.locate(p).map(|(key, _)| key) == Some(leaf)));
        seen += range.len();
    }
    assert_eq!(seen, points.len());
    let (none, _) = LinearOctree::of_points(&[], 1, 18);
    assert_eq!(none.len(), 1);
}

/// The leaves of a shell around the middle, 1, and all others, 0.
fn shell(holes: impl Fn(Key) -> bool + Sync) -> LinearOctree<u8> {
    let is_cut = |cell: Key| {
        let away = |p: [u32; 3]| p.iter().map(|&c| (f64::from(c) - f64::from(SIDE / 2)).powi(2)).sum::<f64>().sqrt();
        let near: f64 = away([0, 1, 2].map(|i| (SIDE / 2).clamp(cell.min_corner()[i], cell.max_corner()[i])));
        let far = cell.corners().map(|p| away(p.center())).into_iter().fold(0.0, f64::max);
        (near..=far).contains(&(f64::from(SIDE) * 0.3))
    };
    LinearOctree::build(5, is_cut, |leaf| u8::from(is_cut(leaf) && !holes(leaf)))
}

/// "Outside" was the side of the first cell in the map; cavities and separate outsides were one; no wall at all was "inside".
#[test]
fn a09_regions_are_told_apart_and_outside_is_at_the_boundary() {
    let tree = shell(|_| false);
    let wall = |&record: &u8| record == 1;
    let regions = tree.face_regions(wall);
    let of = |p: [u32; 3]| *regions.get(tree.locate(p).expect("covered").0).expect("not in the wall");
    assert_eq!((of([0; 3]), of([SIDE; 3]), of([SIDE / 2; 3])), (0, 0, 1));
    assert_eq!(regions.len() + tree.iter().filter(|(_, r)| wall(r)).count(), tree.len());
    // Two cavities are two regions; what is open at the boundary is outside, wherever.
    let open = [[0; 3], [3; 3], [5; 3], [7; 3]].map(|at| Key::cell(3, at).expect("a cell"));
    let tree = LinearOctree::build(3, |_| true, |leaf| u8::from(!open.contains(&leaf)));
    let regions = tree.face_regions(wall);
    assert_eq!(open.map(|leaf| regions.get(leaf).copied()), [Some(0), Some(1), Some(2), Some(0)]);
    let empty = LinearOctree::from_iter([(Key::ROOT, 0u8)]);
    assert!(empty.face_regions(wall).iter().all(|(_, &region)| region == 0));
    assert!(LinearOctree::from_iter([(Key::ROOT, 1u8)]).face_regions(wall).is_empty());
}

/// Regions meet across faces only: a wall of cells that touch at edges holds, one with a hole does not.
#[test]
fn a10_only_a_hole_in_the_wall_leaks() {
    let regions = |tree: &LinearOctree<u8>| tree.face_regions(|&r| r == 1).iter().map(|(_, &r)| r).max();
    assert_eq!(regions(&shell(|_| false)), Some(1));
    assert_eq!(
        regions(&shell(|leaf| leaf.contains(Key::point([SIDE / 2, SIDE / 2, SIDE / 10 * 2]).expect("inside")))),
        Some(0)
    );
}

/// Looking up nodes made new ones that no cell had.
#[test]
fn a13_looking_makes_nothing() {
    let mut field = NodalOctree::with_values(toward([9; 3], 4, Balance::Edges), |_| 1.0f64);
    let (len, leaves, bytes) = (field.len(), field.tree().len(), field.allocated_bytes());
    let nowhere = Key::point([12_345, 3, 3]).expect("inside");
    assert_eq!((field.value(nowhere), field.uses(nowhere), field.is_hanging(nowhere)), (None, 0, false));
    assert!(field.value_mut(nowhere).is_none() && field.record_mut(Key::ROOT).is_none());
    assert!(!field.tree().contains(Key::ROOT) && field.tree().get(nowhere).is_none());
    assert_eq!((field.len(), field.tree().len(), field.allocated_bytes()), (len, leaves, bytes));
}

/// No error values, no leaf search, no balance across edges and corners, no cascade, no threads, no files.
#[test]
fn a15_what_was_missing_is_there() {
    let mut tree = toward([SIDE / 2; 3], 3, Balance::Off);
    let leaf = tree.locate([SIDE / 2 - 1; 3]).expect("covered").0;
    let finest = tree.locate([SIDE / 2; 3]).expect("covered").0;
    assert_eq!((leaf.level(), finest.level()), (Some(1), Some(3)));
    assert!(
        matches!(tree.refine_strict(finest, Balance::Corners, |_, &r| r), Err(RefineError::Blocked { by, .. }) if by == leaf)
    );
    assert_eq!(tree.imbalance(Balance::Corners).map(|(larger, _)| larger.level()), Some(Some(1)));
    for (balance, directions) in [(Balance::Faces, 6), (Balance::Edges, 18), (Balance::Corners, 26)] {
        assert_eq!(balance.directions().count(), directions);
        tree.balance(balance, |_, &r| r);
        assert_eq!(tree.imbalance(balance), None);
    }
    let bytes = tree.to_bytes(|r, out| out.extend_from_slice(&r.to_le_bytes()));
    let read = |bytes: &mut &[u8]| bytes.split_off(..4)?.try_into().ok().map(u32::from_le_bytes);
    assert_eq!(LinearOctree::from_bytes("tree", &bytes, read).expect("as written"), tree);
}

/// Cells came by their coordinates, not along a curve, and neighbours by searches in a tree.
#[test]
fn a16_order_is_along_the_curve_and_neighbours_are_arithmetic() {
    let tree = toward([1 << 10; 3], 8, Balance::Corners);
    let keys = tree.keys_z();
    assert!(keys.is_sorted_by_key(|key| key.depth_first_rank()));
    assert!(tree.iter_z().map(|(leaf, _)| leaf).eq(keys.iter().copied()));
    for leaf in keys {
        for face in Face::ALL {
            let beyond = leaf.neighbour(face);
            assert_eq!(beyond.is_some(), tree.neighbours(leaf, face).next().is_some());
            assert_eq!(beyond, leaf.toward(Direction::from(face)));
        }
        assert!(
            Axis::ALL.into_iter().all(|a| leaf.corner(Corner::MAX).center()[a.index()] == leaf.max_corner()[a.index()])
        );
    }
}

/// A quarter of a billion leaves around two spheres, with 8 bytes of data each: some 3 GB and half a minute on two cores. Run it with
/// `cargo test --release --test octree -- --ignored --nocapture`.
#[test]
#[ignore = "takes 4 GB of memory"]
fn a_quarter_of_a_billion_leaves() {
    let radii = [0.466, 0.366].map(|r| ((f64::from(SIDE) * r) as u64).pow(2));
    let is_cut = |cell: Key| {
        let (min, side, middle) = (cell.min_corner(), u64::from(cell.size()), u64::from(SIDE / 2));
        let (mut near, mut far) = (0, 0);
        for low in min.map(u64::from) {
            let (below, above) = (low.abs_diff(middle), (low + side).abs_diff(middle));
            near += if (low..=low + side).contains(&middle) { 0 } else { below.min(above).pow(2) };
            far += below.max(above).pow(2);
        }
        radii.iter().any(|r| (near..=far).contains(r))
    };
    let start = Instant::now();
    let tree = LinearOctree::build(12, is_cut, Key::to_bits);
    let seconds = start.elapsed().as_secs_f64();
    let peak = std::fs::read_to_string("/proc/self/status").ok().and_then(|status| {
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        line.split_whitespace().next()?.parse::<f64>().ok()
    });
    let a_leaf = tree.allocated_bytes() as f64 / tree.len() as f64;
    println!("{} leaves in {seconds:.1} s, {a_leaf:.1} bytes each", tree.len());
    println!("peak {:.2} GB", peak.unwrap_or(f64::NAN) / 1e6);
    assert!(tree.len() >= 250_000_000 && tree.len() == 7 * ((tree.len() - 1) / 7) + 1);
    assert!(a_leaf <= 24.0 && peak.is_none_or(|kb| kb < 8e6));
    let state = &mut 1u64;
    for _ in 0..1000 {
        let point = [(); 3].map(|()| {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 45) as u32
        });
        let (leaf, &record) = tree.locate(point).expect("covered");
        assert!(record == leaf.to_bits() && leaf.contains(Key::point(point).expect("inside")));
    }
}
