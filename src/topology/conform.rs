//! Making a solid's topology that of a sketch: a graph that shall be all there is to it (after Ju, Zhou and Hu 2007, "Editing the topology of 3D
//! models by sketching").
//!
//! The sketch is laid on the grid ([`Sketch`]) and joined to the solid, whose parts without a line are dropped, and all cavities of which are
//! filled. Then the solid is thinned with the sketch kept ([`Complex::keeping`]). What is left beside it is what is wrong, each thing once:
//!
//! - An arc is a loop that the sketch does not have, or a bridge between two of its parts. It is cut like any handle, at its thinnest place; or
//!   a tunnel is filled instead, if that changes fewer cells.
//! - A wall of faces closes what is a loop of the sketch. It is drilled through, at the face from which it is the fewest steps to the surface.
//!
//! When nothing is left beside the sketch, collapses lead from the solid to the sketch: it has the sketch's homotopy type. This is how it ends, so
//! that it is so always, and not just for shapes that are thick enough. Fills may close a loop that the sketch has, which shows when the solid is thinned
//! again: then they are taken back, first the lot of them, to be tried one by one, and after that each for good. So every round but
//! those lowers the number of things that are wrong, and it comes to an end.
//!
//! Cost: that of thinning both sides, without a threshold, for each round; there are some ten.

use super::betti::Betti;
use super::complex::{Complex, Side};
use super::mend::{Loops, TopologyReport};
use super::patch::patches;
use super::skeleton::walls;
use super::sketch::Sketch;
use super::volumes::{drop_untouched, move_small};
use crate::error::{Error, Result};
use crate::grid::Key;
use crate::octree::components::component_bytes;
use crate::octree::crossings::lattice_point;
use crate::octree::{EditedOctree, SignedOctree};
use crate::progress::{Progress, Stage};
use hashbrown::HashSet;

/// Makes the topology of a solid that of a sketch, whose positions are in cells of the finest level: as many parts and loops, linked in the
/// same way, and no cavity. Where a line lies outside of the solid, there is a bar along it, thinner than a cell.
///
/// # Errors
/// When the sketch does not lie within the grid, is too fine for it, or comes by no part of the solid; `Cancelled`, and `Memory` when
/// `progress` says so.
pub fn conform(
    signed: SignedOctree,
    sketch: &Sketch,
    progress: &dyn Progress,
) -> Result<(EditedOctree, TopologyReport)> {
    progress.begin(Stage::Topology, 0);
    let depth = signed.crossings().depth();
    let kept = sketch.on_grid(depth)?;
    progress.hold(component_bytes(&signed) as u64)?;
    let unedited = EditedOctree::unedited(signed);
    let mut report = TopologyReport { before: Betti::of(&unedited), ..TopologyReport::default() };
    let points = kept.iter().filter(|key| key.dir().dimension() == 0).map(|&point| lattice_point(depth, point));
    let (signed, dropped, left) = drop_untouched(unedited.signed(), points);
    if left == 0 {
        let remedy = "draw it in the coordinates of the model, where the solid is";
        return Err(Error::setting("sketch", "no line of it comes into the solid", remedy));
    }
    let (signed, filled) = move_small(signed, Side::Background, f64::INFINITY);
    (report.islands_dropped, report.cavities_filled) = (dropped, filled);
    let octree = EditedOctree::unedited(signed);
    let added = kept.iter().copied().filter(|&element| !octree.contains(element)).collect();
    let octree = octree.with(added, true);
    let mut work = Work { octree, kept, report, one_by_one: false, refused: HashSet::with_hasher(fixed()), progress };
    work.run()?;
    let Work { octree, mut report, .. } = work;
    report.after = Betti::of(&octree);
    report.count_edits(&octree);
    Ok((octree, report))
}

/// Nothing depends on the order in the set.
fn fixed() -> ahash::RandomState {
    ahash::RandomState::with_seeds(9, 10, 11, 12)
}

struct Work<'a> {
    octree: EditedOctree,
    /// Points and edges of the sketch.
    kept: Vec<Key>,
    report: TopologyReport,
    /// Whether tunnels are filled one by one.
    one_by_one: bool,
    /// Tunnels that are not to be filled, by the faces of their skeletons.
    refused: HashSet<Key, ahash::RandomState>,
    progress: &'a dyn Progress,
}

/// Tunnels that were filled on trial.
struct Trial {
    elements: Vec<Key>,
    faces: Vec<Key>,
    /// Loops that are left if none of the sketch's was closed.
    loops: usize,
}

impl Work<'_> {
    fn run(&mut self) -> Result<()> {
        let mut trial: Option<Trial> = None;
        loop {
            self.progress.hold((self.octree.bytes() + Complex::bytes_for(&self.octree)) as u64)?;
            let complex = Complex::keeping(&self.octree, &self.kept);
            let loops = Loops::of(&self.octree, complex, f64::INFINITY, self.progress)?;
            let walls = walls(loops.complex());
            let left = loops.handles().len();
            if let Some(trial) = trial.take().filter(|trial| !walls.is_empty() || left != trial.loops) {
                self.take_back(trial);
                continue;
            }
            if !walls.is_empty() {
                let elements = patches(&self.octree, loops.complex(), &walls);
                self.edit(elements, false);
                self.report.drilled += walls.len() as u64;
                continue;
            }
            if left == 0 {
                return Ok(());
            }
            let cuts = loops.by_cost(&self.octree, (0..left).collect());
            let (least, most) = (cuts[0].0, cuts[left - 1].0);
            let tunnels = Loops::find(&self.octree, Side::Background, most as f64, self.progress)?;
            let open = (0..tunnels.handles().len()).filter(|&i| !self.refused.contains(&tunnels.edge(i)));
            let fills = tunnels.by_cost(&self.octree, open.collect());
            let cheaper = fills.partition_point(|(cost, _)| *cost < least).min(left);
            if cheaper > 0 {
                let count = if self.one_by_one { 1 } else { cheaper };
                trial = Some(self.fill(&tunnels, &fills[..count], left - count));
                continue;
            }
            let bound = fills.first().map_or(u64::MAX, |fill| fill.0);
            let count = cuts.partition_point(|(cost, _)| *cost <= bound).max(left.div_ceil(4));
            let chosen: Vec<usize> = cuts[..count].iter().map(|cut| cut.1).collect();
            self.report.cuts.extend(chosen.iter().map(|&i| loops.handles()[i].clone()));
            let elements = loops.patches(&self.octree, &chosen);
            self.edit(elements, false);
        }
    }

    fn fill(&mut self, tunnels: &Loops, fills: &[(u64, usize)], loops: usize) -> Trial {
        let chosen: Vec<usize> = fills.iter().map(|fill| fill.1).collect();
        self.report.fills.extend(chosen.iter().map(|&i| tunnels.handles()[i].clone()));
        let elements = tunnels.patches(&self.octree, &chosen);
        self.edit(elements.clone(), true);
        Trial { elements, faces: chosen.into_iter().map(|i| tunnels.edge(i)).collect(), loops }
    }

    fn take_back(&mut self, trial: Trial) {
        self.edit(trial.elements, false);
        self.report.fills.truncate(self.report.fills.len() - trial.faces.len());
        if trial.faces.len() == 1 {
            self.refused.extend(trial.faces);
        }
        self.one_by_one = true;
    }

    /// Adds elements that are not there, or removes some that are.
    fn edit(&mut self, elements: Vec<Key>, add: bool) {
        let depth = self.octree.signed().crossings().depth();
        let octree = std::mem::replace(&mut self.octree, EditedOctree::unedited(SignedOctree::empty(depth)));
        self.octree = octree.with(elements, add);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::topology::oracle::{betti, elements, noise, octree};
    use crate::topology::thin;

    fn distance(p: [u32; 3], q: [f64; 3]) -> f64 {
        (0..3).map(|a| (f64::from(p[a]) - q[a]).powi(2)).sum::<f64>().sqrt()
    }

    fn ring(centre: [f64; 3], radius: f64) -> Sketch {
        let points = (0..12).map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 12.0).sin_cos();
            [centre[0] + radius * cos, centre[1] + radius * sin, centre[2]]
        });
        Sketch { points: points.collect(), lines: (0..12).map(|i| [i, (i + 1) % 12]).collect() }
    }

    /// How far a point is from the circle that the ring goes round.
    fn from_circle(p: [u32; 3], centre: [f64; 3], radius: f64) -> f64 {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|a| f64::from(p[a]) - centre[a]);
        (x.hypot(y) - radius).hypot(z)
    }

    fn conformed(solid: SignedOctree, sketch: &Sketch) -> (EditedOctree, TopologyReport) {
        let depth = solid.crossings().depth();
        let (octree, report) = conform(solid, sketch, &Silent).expect("it can be done");
        assert_eq!(octree.validate(), Ok(()));
        let (parts, loops) = sketch.parts_and_loops();
        assert_eq!((report.after.components, report.after.handles, report.after.cavities), (parts, loops, 0));
        assert_eq!(report.after, Betti::of(&octree));
        // More than numbers: the solid collapses onto the sketch.
        let kept = sketch.on_grid(depth).expect("it was on the grid before");
        assert!(kept.iter().all(|&element| octree.contains(element)), "the sketch is part of the solid");
        let mut complex = Complex::keeping(&octree, &kept);
        thin(&mut complex, None, &Silent).expect("nobody cancels");
        assert_eq!(complex.count(), kept.len() as u64, "nothing is left but the sketch");
        (octree, report)
    }

    const CENTRE: [f64; 3] = [16.0; 3];

    #[test]
    fn a_ball_with_a_ring_in_it_is_drilled_through() {
        let ball = octree(5, |p| distance(p, CENTRE) < 11.3);
        let (_, report) = conformed(ball, &ring(CENTRE, 7.0));
        assert_eq!((report.drilled, report.cuts.len(), report.fills.len()), (1, 0, 0));
    }

    #[test]
    fn a_torus_with_an_arc_in_it_is_cut_or_filled_whichever_is_less() {
        let arc = Sketch { lines: (0..6).map(|i| [i, i + 1]).collect(), ..ring(CENTRE, 9.0) };
        let arc = Sketch { points: arc.points[..7].to_vec(), ..arc };
        for (tube, fills) in [(2.6, 0), (6.9, 1)] {
            let torus = octree(5, |p| from_circle(p, CENTRE, 9.0) < tube);
            let (_, report) = conformed(torus, &arc);
            assert_eq!((report.drilled, report.cuts.len(), report.fills.len()), (0, 1 - fills, fills), "{tube}");
        }
    }

    #[test]
    fn a_torus_with_its_circle_in_it_is_left_alone_and_a_broken_one_is_closed() {
        let torus = |p| from_circle(p, CENTRE, 9.0) < 3.3;
        let (whole, report) = conformed(octree(5, torus), &ring(CENTRE, 9.0));
        assert!(!whole.is_edited() && report.changed_cells == 0);
        let broken = octree(5, |p| torus(p) && !(20 < p[0] && (14..18).contains(&p[1])));
        let (closed, report) = conformed(broken, &ring(CENTRE, 9.0));
        assert_eq!(report.before.handles, 0);
        assert!(closed.removed().is_empty() && !closed.added().is_empty());
    }

    #[test]
    fn parts_without_a_line_are_dropped_and_bridges_cut() {
        // A dumbbell and a ball beside it; one point in each end of the dumbbell.
        let dumbbell = |p| {
            distance(p, [8.0, 8.0, 8.0]) < 5.0
                || distance(p, [24.0, 8.0, 8.0]) < 5.0
                || (8..24).contains(&p[0]) && distance([8, p[1], p[2]], [8.0; 3]) < 1.6
        };
        let solid = octree(5, |p| dumbbell(p) || distance(p, [16.0, 24.0, 24.0]) < 4.0);
        let sketch = Sketch { points: vec![[8.0; 3], [24.0, 8.0, 8.0]], lines: Vec::new() };
        let (_, report) = conformed(solid, &sketch);
        assert_eq!((report.islands_dropped, report.cuts.len()), (1, 1));
        assert!(report.cuts[0].area < 16.0);
        assert_eq!(report.after.components, 2);
    }

    #[test]
    fn noise_becomes_any_sketch() {
        let mut done = [0; 3];
        for seed in 0..24u64 {
            let density = 0.35 + 0.028 * seed as f64;
            let solid = octree(4, |p| p.iter().all(|&c| c < 15) && noise(seed, p) < density);
            let random = |n: u64| noise(1000 + seed, [n as u32, 3, 5]);
            let at = |n: u64| std::array::from_fn(|a| (2.0 + 11.0 * random(3 * n + a as u64)).round());
            let sketch = Sketch { points: (0..5).map(at).collect(), lines: vec![[0, 1], [1, 2], [2, 0], [3, 4]] };
            if sketch.on_grid(4).is_err() {
                continue;
            }
            let before = elements(&EditedOctree::unedited(solid.clone()));
            let (octree, report) = conformed(solid, &sketch);
            let of = |betti: &Betti| [betti.components, betti.handles, betti.cavities].map(|n| n as usize);
            assert_eq!(of(&report.before), betti(&before), "{seed}");
            assert_eq!(of(&report.after), betti(&elements(&octree)), "{seed}");
            done = [done[0] + report.cuts.len() as u64, done[1] + report.fills.len() as u64, done[2] + report.drilled];
        }
        assert!(done.iter().all(|&count| count > 2), "{done:?}");
    }

    #[test]
    fn a_sketch_beside_the_solid_is_an_error() {
        let ball = octree(5, |p| distance(p, CENTRE) < 5.0);
        let error = conform(ball, &ring([8.0, 8.0, 3.0], 4.0), &Silent).expect_err("no line comes into the ball");
        assert!(error.to_string().contains("no line of it comes into the solid"), "{error}");
    }
}
