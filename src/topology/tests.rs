//! Solids of known topology, and noise, through the whole of topology repair.

use super::oracle::{betti, elements, noise, octree, smooth_noise, torus};
use super::*;
use crate::grid::key::SIDE;
use crate::octree::{EditedOctree, SignedOctree};
use crate::progress::Silent;

fn mend(signed: &SignedOctree, options: &Options) -> (EditedOctree, TopologyReport) {
    let (edited, report) = repair_topology(signed.clone(), options, &Silent).unwrap();
    assert_eq!(edited.validate(), Ok(()));
    assert_eq!(report.after, Betti::of(&edited));
    let removed = report.cuts.len() + report.fills.len();
    if report.islands_dropped + report.cavities_filled == 0 {
        assert_eq!(report.before.handles - report.after.handles, removed as u64, "{report:?}");
        assert_eq!(report.before.components, report.after.components);
        assert_eq!(report.before.cavities, report.after.cavities);
    }
    (edited, report)
}

const CUT: Options = Options {
    cut: Some(f64::INFINITY),
    fill: None,
    genus: None,
    cheapest: false,
    fill_cavities: None,
    drop_islands: None,
    measure: Measure::Area,
};
const FILL: Options = Options { cut: None, fill: Some(f64::INFINITY), ..CUT };

#[test]
fn every_patch_removes_one_loop_and_nothing_else_in_noise() {
    for (seed, density) in [(1, 0.2), (2, 0.4), (3, 0.5), (4, 0.6), (5, 0.8), (6, 0.9), (7, 0.97)] {
        let signed = octree(4, |p| p.iter().all(|&c| c < 11) && noise(seed, p) < density);
        for options in [CUT, FILL, Options { cheapest: true, ..Options::default() }] {
            let (edited, report) = mend(&signed, &options);
            let [components, handles, cavities] = betti(&elements(&edited)).map(|n| n as u64);
            assert_eq!(report.after, Betti { components, handles, cavities }, "{seed}");
        }
    }
    for seed in 0..6 {
        let signed = octree(5, |p| smooth_noise(seed, 4, p) < 0.5);
        for options in [CUT, FILL, Options { cheapest: true, ..Options::default() }] {
            mend(&signed, &options);
        }
    }
}

/// The area of a disc.
fn disc(radius: f64) -> f64 {
    std::f64::consts::PI * radius * radius
}

fn assert_near(area: f64, expected: f64, what: &str) {
    assert!((0.9..1.1).contains(&(area / expected)), "{what}: {area}, not {expected}");
}

#[test]
fn tori_in_all_directions_are_cut_and_filled_where_they_are() {
    for axis in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [0.3, 0.5, 0.8]] {
        let signed = octree(6, |p| torus([31.3, 31.7, 30.9], axis, 18.0, 6.7, p) < 0.0);
        let (_, report) = mend(&signed, &CUT);
        assert_eq!(report.after, Betti { components: 1, handles: 0, cavities: 0 });
        assert_near(report.cuts[0].area, disc(6.7), "cut");
        let (edited, report) = mend(&signed, &FILL);
        assert_eq!(report.after, Betti { components: 1, handles: 0, cavities: 0 });
        assert_near(report.fills[0].area, disc(11.3), "fill");
        assert!(report.fills[0].squares as usize <= edited.added().len());
        let off: f64 = report.fills[0].centre.iter().map(|c| (c / f64::from(SIDE >> 6) - 31.3).abs()).sum();
        assert!(off < 6.0, "the membrane is in the middle: {:?}", report.fills[0].centre);
    }
}

#[test]
fn every_component_has_its_handles_cut() {
    let (x, y) = ([1.0, 0.0, 0.2], [0.1, 1.0, 0.0]);
    let signed = octree(6, |p| {
        torus([15.0, 30.0, 30.0], x, 10.0, 3.7, p) < 0.0 || torus([45.0, 32.0, 31.0], y, 12.0, 4.6, p) < 0.0
    });
    let (_, report) = mend(&signed, &CUT);
    assert_eq!(report.before, Betti { components: 2, handles: 2, cavities: 0 });
    assert_eq!(report.after.handles, 0);
    assert_near(report.cuts[0].area, disc(3.7), "thin torus");
    assert_near(report.cuts[1].area, disc(4.6), "thick torus");
    // With a threshold between them only the thin one is cut.
    let (_, report) = mend(&signed, &Options { cut: Some(disc(4.1)), ..Options::default() });
    assert_eq!((report.cuts.len(), report.after.handles), (1, 1));
}

#[test]
fn holes_of_a_plate_are_found_by_their_size() {
    let radii = [3.4, 5.6, 8.2];
    let centres = [[10.0, 12.0], [12.0, 40.0], [40.0, 30.0]];
    let signed = octree(6, |p| {
        let [x, y, z] = p.map(f64::from);
        let in_hole = radii.iter().zip(centres).any(|(r, c)| (x - c[0]).hypot(y - c[1]) < *r);
        (27.0..36.0).contains(&z) && (2.0..60.0).contains(&x) && (2.0..60.0).contains(&y) && !in_hole
    });
    let list = handles(&EditedOctree::unedited(signed.clone()), f64::INFINITY, &Silent).unwrap();
    let fills: Vec<&Handle> = list.iter().filter(|handle| handle.kind == Kind::Fill).collect();
    assert_eq!((list.len(), fills.len()), (6, 3));
    for (fill, radius) in fills.iter().zip(radii) {
        assert_near(fill.area, disc(radius), "hole");
        assert!((fill.diameter() / (2.0 * radius) - 1.0).abs() < 0.05);
    }
    let (_, report) = mend(&signed, &Options { fill: Some(disc(7.0)), ..Options::default() });
    assert_eq!((report.fills.len(), report.after.handles), (2, 1));
    // A membrane has two cells beside each square, a cut from a hole to the plate's rim hardly more than one.
    let all = mend(&signed, &FILL).1.changed_cells;
    for genus in [2, 1, 0] {
        let (_, report) = mend(&signed, &Options { genus: Some(genus), ..Options::default() });
        assert_eq!((report.after.handles, report.cuts.len(), report.fills.len()), (genus, 3 - genus as usize, 0));
        assert!(report.changed_cells < all);
        // From the first or the second hole: 9 times 4.6 or 4.4 cells.
        assert_near(report.cuts[0].area, 9.0 * 4.5, "the smallest cut goes first");
    }
    // Through a block the same holes are cheaper to fill.
    let block = octree(6, |p| {
        let [x, y, z] = p.map(f64::from);
        let in_hole = radii.iter().zip(centres).any(|(r, c)| (x - c[0]).hypot(y - c[1]) < *r);
        (2.0..60.0).contains(&z) && (2.0..60.0).contains(&x) && (2.0..60.0).contains(&y) && !in_hole
    });
    let (_, report) = mend(&block, &Options { genus: Some(1), ..Options::default() });
    assert_eq!((report.after.handles, report.cuts.len(), report.fills.len()), (1, 0, 2));
    assert_near(report.fills[0].area, disc(3.4), "the smallest hole goes first");
}

#[test]
fn hollow_solids_keep_their_cavities_and_the_loops_of_their_walls() {
    let from = |p: [u32; 3]| p.map(|c| (f64::from(c) - 15.5) * (f64::from(c) - 15.5)).iter().sum::<f64>().sqrt();
    let (_, report) = mend(&octree(5, |p| (7.0..12.0).contains(&from(p))), &CUT);
    assert_eq!((report.before, report.cuts.len()), (Betti { components: 1, handles: 0, cavities: 1 }, 0));
    let tube = octree(6, |p| (3.0..7.0).contains(&(torus([31.0; 3], [0.0, 0.2, 1.0], 18.0, 0.0, p))));
    let (_, report) = mend(&tube, &CUT);
    assert_eq!(report.before, Betti { components: 1, handles: 2, cavities: 1 });
    assert_eq!(report.cuts.len(), 0, "a cut through a hollow tube would open its cavity");
    // The cavity is a ring: a membrane closes it, and another one the hole.
    let (_, report) = mend(&tube, &FILL);
    assert_eq!((report.fills.len(), report.after.handles), (2, 0));
}

#[test]
fn a_knot_is_cut_but_not_filled() {
    use std::f64::consts::TAU;
    let curve: Vec<[f64; 3]> = (0..400)
        .map(|i| {
            let t = TAU * f64::from(i) / 400.0;
            [t.sin() + 2.0 * (2.0 * t).sin(), t.cos() - 2.0 * (2.0 * t).cos(), -(3.0 * t).sin()].map(|c| 32.0 + 8.0 * c)
        })
        .collect();
    let signed =
        octree(6, |p| curve.iter().any(|c| (0..3).map(|a| (f64::from(p[a]) - c[a]).powi(2)).sum::<f64>() < 3.6 * 3.6));
    let (_, report) = mend(&signed, &CUT);
    assert_eq!((report.before.handles, report.after.handles), (1, 0));
    assert_near(report.cuts[0].area, disc(3.6), "tube");
    let (_, report) = mend(&signed, &FILL);
    assert_eq!((report.after.handles, report.fills.len()), (1, 0), "no disc spans a knot");
}

#[test]
fn islands_and_cavities_go_by_their_volume() {
    let ball = |p: [u32; 3], at: f64, radius: f64| {
        p.map(|c| (f64::from(c) - at).powi(2)).iter().sum::<f64>() < radius * radius
    };
    let signed = octree(6, |p| {
        ball(p, 24.0, 20.5) && !ball(p, 20.0, 4.5) && !ball(p, 28.0, 7.5) || ball(p, 50.0, 5.5) || ball(p, 58.0, 2.5)
    });
    let before = Betti { components: 3, handles: 0, cavities: 2 };
    let volume = |radius: f64| 4.2 * radius.powi(3);
    assert_eq!((volumes(&signed, Side::Object).len(), volumes(&signed, Side::Background).len()), (3, 2));
    let close = |found: u64, radius: f64| (found as f64 / volume(radius) - 1.0).abs() < 0.1;
    assert!(close(volumes(&signed, Side::Background)[1], 7.5) && close(volumes(&signed, Side::Object)[1], 5.5));
    for (radius, after) in [(2.0, (3, 2)), (3.5, (2, 2)), (5.0, (2, 1)), (6.5, (1, 1)), (100.0, (0, 0))] {
        let volume = Some(volume(radius));
        let options = Options { fill_cavities: volume, drop_islands: volume, ..Options::default() };
        let (edited, report) = mend(&signed, &options);
        assert_eq!(report.before, before);
        assert_eq!((report.after.components, report.after.cavities), after, "{radius}");
        assert_eq!(edited.signed().validate(), Ok(()));
    }
}

/// Blobs that run into each other, with necks and holes of all sizes.
fn blobs(seed: u64) -> SignedOctree {
    octree(6, |p| smooth_noise(seed, 9, p) + 0.15 * smooth_noise(seed + 1, 4, p) < 0.55)
}

#[test]
fn eroding_as_deep_as_a_threshold_asks_for_finds_what_full_erosion_finds() {
    for seed in [10, 20, 30] {
        let octree = EditedOctree::unedited(blobs(seed));
        for side in [Side::Object, Side::Background] {
            let sizes = |limit: f64| -> Vec<f64> {
                let loops = Loops::find(&octree, side, limit, &Silent).unwrap();
                loops.handles().iter().map(|handle| handle.area).collect()
            };
            let all = sizes(f64::INFINITY);
            for limit in [6.0, 25.0, 80.0] {
                let few = sizes(limit);
                let up_to = |list: &[f64], size: f64| list.iter().filter(|&&area| area <= size).count();
                // Sections near the threshold may come out a little larger or smaller.
                assert!(up_to(&few, limit) >= up_to(&all, 0.8 * limit), "{seed} {side:?} {limit}: {few:?} {all:?}");
                assert!(up_to(&few, 0.8 * limit) <= up_to(&all, limit), "{seed} {side:?} {limit}: {few:?} {all:?}");
            }
        }
    }
}

#[test]
fn threads_make_no_difference() {
    let signed = blobs(40);
    let options = Options { cut: Some(30.0), fill: Some(60.0), ..Options::default() };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (edited, report) = pool.install(|| mend(&signed, &options));
        (edited.removed().to_vec(), edited.added().to_vec(), report)
    };
    let one = run(1);
    assert!(!one.0.is_empty() && !one.1.is_empty());
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
}

#[test]
fn the_cheapest_way_changes_no_more_than_cutting_or_filling_everything() {
    let signed = blobs(50);
    let area = |options: &Options| {
        let (_, report) = mend(&signed, options);
        assert_eq!(report.after.handles, 0);
        report.cuts.iter().chain(&report.fills).map(|handle| handle.area).sum::<f64>()
    };
    let cheapest = area(&Options { cheapest: true, ..Options::default() });
    assert!(cheapest <= area(&CUT) && cheapest <= area(&FILL));
}

#[test]
fn nonsense_is_refused_and_nothing_asked_is_nothing_done() {
    let signed = octree(4, |p| torus([7.5; 3], [0.0, 0.0, 1.0], 4.0, 1.6, p) < 0.0);
    for size in [-1.0, f64::NAN] {
        let options = Options { fill: Some(size), ..Options::default() };
        let error = repair_topology(signed.clone(), &options, &Silent).unwrap_err().to_string();
        assert!(error.contains("fill") && error.contains("is not a size"), "{error}");
    }
    let (edited, report) = mend(&signed, &Options::default());
    assert!(!edited.is_edited() && report.before == report.after);
    let (edited, report) = mend(&SignedOctree::empty(4), &Options { cheapest: true, ..CUT });
    assert!(!edited.is_edited() && report.after == Betti::default());
}
