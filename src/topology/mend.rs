//! Topology repair as a whole: which loops are removed, and how.

use super::betti::Betti;
use super::complex::{Complex, Side};
use super::member::{Members, component_of, flow};
use super::options::{Measure, Options};
use super::patch::patches;
use super::section::{SIGN_BYTES, Sections, Signs};
use super::skeleton::{Arc, Skeleton};
use super::span::{Loop, loops};
use super::thin::thin;
use super::volumes::move_small;
use crate::error::Result;
use crate::grid::Key;
use crate::octree::components::component_bytes;
use crate::octree::{EditedOctree, SignedOctree};
use crate::progress::{Beside, Progress, Stage};
use rayon::prelude::*;

/// How a loop is removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// A handle of the solid is cut through.
    Cut,
    /// A tunnel through the solid gets a membrane.
    Fill,
}

/// A handle or a tunnel, where it is thinnest.
#[derive(Debug, Clone, PartialEq)]
pub struct Handle {
    /// What removes it.
    pub kind: Kind,
    /// Vector area of the cross-section, in squares of cells: the same whichever way it lies in the grid.
    pub area: f64,
    /// Squares that the cross-section is made of, staircases included: the area that `TopoMender` reckons with (a quarter of it for cuts).
    pub squares: u64,
    /// Mean of the cross-section, in lattice units.
    pub centre: [f64; 3],
    /// The component of the solid that it is a handle of, or a tunnel through: from 1 on by falling volume ([`Members`]). 0 for a tunnel
    /// through nothing but what was filled before.
    pub component: u32,
}

impl Handle {
    /// Diameter of the disc of the same area, in cells.
    pub fn diameter(&self) -> f64 {
        2.0 * (self.area / std::f64::consts::PI).sqrt()
    }

    /// The size that `TopoMender` gives it, in squares of cells: a quarter of the squares of a cut, the squares of a membrane but one.
    pub fn original_size(&self) -> f64 {
        match self.kind {
            Kind::Cut => self.squares as f64 / 4.0,
            Kind::Fill => self.squares.saturating_sub(1) as f64,
        }
    }

    /// Its size as it is compared with the options' `cut` and `fill`.
    pub fn size(&self, measure: Measure) -> f64 {
        match measure {
            Measure::Area => self.area,
            Measure::Original => self.original_size(),
        }
    }
}

/// What [`repair_topology`] found and did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TopologyReport {
    /// Components, handles and cavities of the input.
    pub before: Betti,
    /// The same of the result.
    pub after: Betti,
    /// Handles that were cut, from the smallest on in each round.
    pub cuts: Vec<Handle>,
    /// Tunnels that were filled.
    pub fills: Vec<Handle>,
    /// Walls that were drilled through, where a sketch has a loop ([`conform`](super::conform)).
    pub drilled: u64,
    /// Cavities that were filled.
    pub cavities_filled: u64,
    /// Floating parts that were dropped.
    pub islands_dropped: u64,
    /// Finest elements (points, edges, faces, cells) taken away.
    pub removed: u64,
    /// Finest elements added.
    pub added: u64,
    /// Finest cells that belong to the solid no more, or one of whose faces does that did not.
    pub changed_cells: u64,
}

impl TopologyReport {
    pub(super) fn count_edits(&mut self, octree: &EditedOctree) {
        self.removed = octree.removed().len() as u64;
        self.added = octree.added().len() as u64;
        self.changed_cells = octree.changed_cells();
    }
}

/// All loops of one side.
#[derive(Debug)]
pub struct Loops {
    complex: Complex,
    skeleton: Skeleton,
    found: Vec<Loop>,
    handles: Vec<Handle>,
}

impl Loops {
    /// Thins one side of a solid and finds its loops, from the smallest on. With a `limit` (area of the cross-section, in squares of
    /// cells), erosion ends where nothing of that size can be left, and larger loops may be missing or incomplete: cost and
    /// memory grow with the surface, and not with the volume.
    ///
    /// # Errors
    /// `Cancelled`, and `Memory` when `progress` says so.
    pub fn find(octree: &EditedOctree, side: Side, limit: f64, progress: &dyn Progress) -> Result<Loops> {
        let beside = Beside { progress, bytes: octree.bytes() as u64 };
        beside.hold(Complex::bytes_for(octree) as u64)?;
        Loops::of(octree, Complex::new(octree, side), limit, progress)
    }

    /// As [`find`](Self::find), of a complex that has not been thinned yet.
    pub(super) fn of(
        octree: &EditedOctree,
        mut complex: Complex,
        limit: f64,
        progress: &dyn Progress,
    ) -> Result<Loops> {
        let beside = Beside { progress, bytes: octree.bytes() as u64 };
        thin(&mut complex, layers(limit), &beside)?;
        beside.hold((complex.bytes() + complex.bricks() * SIGN_BYTES) as u64)?;
        let skeleton = Skeleton::new(&complex);
        let found = loops(octree, &complex, &skeleton, limit, progress)?;
        let kind = match complex.side() {
            Side::Object => Kind::Cut,
            Side::Background => Kind::Fill,
        };
        let mut handles = Vec::with_capacity(found.len());
        if !found.is_empty() {
            beside.hold((complex.bytes() + component_bytes(octree.signed())) as u64)?;
            let members = Members::new(octree.signed());
            handles.extend(found.iter().map(|Loop { edge, section, centre }| Handle {
                kind,
                area: section.area,
                squares: section.squares,
                centre: *centre,
                component: component_of(&members, &complex, *edge),
            }));
        }
        Ok(Loops { complex, skeleton, found, handles })
    }

    /// The skeleton.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// The thinned complex.
    pub fn complex(&self) -> &Complex {
        &self.complex
    }

    /// The loops, from the smallest on.
    pub fn handles(&self) -> &[Handle] {
        &self.handles
    }

    /// The edge of the skeleton at which a loop is thinnest, as [`Skeleton::edges`] names it.
    pub fn edge(&self, i: usize) -> Key {
        self.complex.key(self.found[i].edge)
    }

    /// The cross-section of a loop: the edges of the solid that it passes through, or the faces of which the membrane is made; the edge
    /// of the skeleton first. Cost: some 100 ns each.
    pub fn section(&self, i: usize) -> impl Iterator<Item = Key> + '_ {
        flow(&self.complex, self.found[i].edge)
    }

    /// The number of finest cells that the removal of a loop alone changes, counted as by [`EditedOctree::changed_cells`]. `octree` is what
    /// the loops were found in. Cost: some 1 us a square.
    pub fn changed_cells(&self, octree: &EditedOctree, i: usize) -> u64 {
        let faces: Vec<Key> = match self.complex.side() {
            Side::Object => self.section(i).flat_map(Key::coboundary).filter(|face| octree.contains(*face)).collect(),
            Side::Background => self.section(i).collect(),
        };
        let mut cells: Vec<Key> = faces.into_iter().flat_map(Key::coboundary).collect();
        cells.sort_unstable();
        cells.dedup();
        cells.len() as u64
    }

    /// The size of each arc of the skeleton: area and squares of the section where the solid seems thinnest along it. `octree` is
    /// what the loops were found in. Cost: a section an arc, some 0.2 us a square, in parallel.
    pub fn arc_sizes(&self, octree: &EditedOctree) -> Vec<(f64, u64)> {
        let signs = Signs::new(octree, &self.complex);
        let size = |sections: &mut Sections<'_>, arc: &Arc| {
            let edges = &self.skeleton.spots[arc.edges.clone()];
            let thinnest = edges.iter().min_by_key(|&&edge| sections.guess(edge));
            let section = sections.at(*thinnest.expect("an arc has edges"));
            (section.area, section.squares)
        };
        self.skeleton.arcs().par_iter().map_init(|| Sections::new(&self.complex, &signs), size).collect()
    }

    /// Removes some of the loops, given by their places in [`handles`](Self::handles). `octree` is what the loops were found in.
    ///
    /// # Panics
    /// When there are not as many.
    pub fn remove(&self, octree: EditedOctree, chosen: &[usize]) -> EditedOctree {
        let elements = self.patches(&octree, chosen);
        octree.with(elements, self.complex.side() == Side::Background)
    }

    /// The elements that are taken away, or added, to remove some of the loops.
    pub(super) fn patches(&self, octree: &EditedOctree, chosen: &[usize]) -> Vec<Key> {
        let edges: Vec<_> = chosen.iter().map(|&i| self.found[i].edge).collect();
        patches(octree, &self.complex, &edges)
    }

    /// Some of the loops with the number of cells that each changes, from the cheapest on.
    pub(super) fn by_cost(&self, octree: &EditedOctree, chosen: Vec<usize>) -> Vec<(u64, usize)> {
        let mut list: Vec<_> = chosen.into_par_iter().map(|i| (self.changed_cells(octree, i), i)).collect();
        list.sort_unstable();
        list
    }
}

/// Steps of thinning after which no section of that area has a cell left: its inradius is at most that of the disc, and fronts move by at
/// least 2.83 cells in five steps (see [`thin`](fn@super::thin)). One round more for the grid.
pub fn layers(limit: f64) -> Option<u32> {
    let layers = (limit / std::f64::consts::PI).sqrt() * 5.0 / 2.83 + 5.0;
    (layers < f64::from(1 << 20)).then(|| layers.ceil() as u32)
}

/// Lists all handles of the solid and all tunnels through it, and changes nothing. `limit` as in [`Loops::find`].
///
/// # Errors
/// `Cancelled`.
pub fn handles(octree: &EditedOctree, limit: f64, progress: &dyn Progress) -> Result<Vec<Handle>> {
    progress.begin(Stage::Topology, 0);
    let mut list = Loops::find(octree, Side::Object, limit, progress)?.handles;
    list.extend(Loops::find(octree, Side::Background, limit, progress)?.handles);
    Ok(list)
}

/// Repairs the topology of a solid: drops floating parts, fills cavities, cuts handles, fills tunnels, in this order.
///
/// # Errors
/// When an option is out of range, `Cancelled`, and `Memory` when `progress` says so.
pub fn repair_topology(
    signed: SignedOctree,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(EditedOctree, TopologyReport)> {
    repair_topology_watched(signed, options, &mut |_| Ok(()), progress)
}

/// A round of topology repair, before it happens.
#[derive(Debug)]
pub struct Round<'a> {
    /// The solid as it is.
    pub octree: &'a EditedOctree,
    /// The loops of one side that were found.
    pub loops: &'a Loops,
    /// Places of those that are going to be removed.
    pub chosen: &'a [usize],
}

/// As [`repair_topology`], and shows each round to `watch`: to keep skeletons or sections.
///
/// # Errors
/// As [`repair_topology`], and whatever `watch` returns.
pub fn repair_topology_watched(
    signed: SignedOctree,
    options: &Options,
    watch: &mut dyn FnMut(&Round<'_>) -> Result<()>,
    progress: &dyn Progress,
) -> Result<(EditedOctree, TopologyReport)> {
    options.check()?;
    progress.begin(Stage::Topology, 0);
    progress.hold(component_bytes(&signed) as u64)?;
    let mut octree = EditedOctree::unedited(signed);
    progress.hold((octree.bytes() + Complex::bytes_for(&octree)) as u64)?;
    let mut report = TopologyReport { before: Betti::of(&octree), ..TopologyReport::default() };
    for (side, volume, moved) in [
        (Side::Object, options.drop_islands, &mut report.islands_dropped),
        (Side::Background, options.fill_cavities, &mut report.cavities_filled),
    ] {
        if let Some(volume) = volume {
            let (signed, count) = move_small(octree.into_signed(), side, volume);
            *moved = count;
            octree = EditedOctree::unedited(signed);
        }
    }
    report.after = if report.islands_dropped + report.cavities_filled > 0 { Betti::of(&octree) } else { report.before };
    let mut work = Work { octree, report, options, watch, progress };
    if options.genus.is_some() || options.cheapest {
        work.cheapest()?;
    } else {
        work.remove(Side::Object)?;
        work.remove(Side::Background)?;
    }
    let Work { octree, mut report, .. } = work;
    if octree.is_edited() {
        report.after = Betti::of(&octree);
    }
    report.count_edits(&octree);
    Ok((octree, report))
}

/// The area up to which loops are looked for first, where it is not known how large those are that have to go: most of what noise makes is
/// smaller.
const FIRST_SIZE: f64 = 8.0;

struct Work<'a> {
    octree: EditedOctree,
    report: TopologyReport,
    options: &'a Options,
    watch: &'a mut dyn FnMut(&Round<'_>) -> Result<()>,
    progress: &'a dyn Progress,
}

impl Work<'_> {
    /// Removes all loops of one side up to the size that is asked for.
    fn remove(&mut self, side: Side) -> Result<()> {
        let Some(size) = self.options.size(side) else { return Ok(()) };
        let loops = Loops::find(&self.octree, side, self.options.area(side, size), self.progress)?;
        let chosen: Vec<usize> = self.up_to(&loops, size);
        self.apply(&loops, &chosen)
    }

    /// The places of the loops up to a size.
    fn up_to(&self, loops: &Loops, size: f64) -> Vec<usize> {
        let measure = self.options.measure;
        (0..loops.handles.len()).filter(|&i| loops.handles[i].size(measure) <= size).collect()
    }

    fn apply(&mut self, loops: &Loops, chosen: &[usize]) -> Result<()> {
        (self.watch)(&Round { octree: &self.octree, loops, chosen })?;
        if chosen.is_empty() {
            return Ok(());
        }
        let list = match loops.complex.side() {
            Side::Object => &mut self.report.cuts,
            Side::Background => &mut self.report.fills,
        };
        list.extend(chosen.iter().map(|&i| loops.handles[i].clone()));
        let depth = self.octree.signed().crossings().depth();
        let octree = std::mem::replace(&mut self.octree, EditedOctree::unedited(SignedOctree::empty(depth)));
        self.octree = loops.remove(octree, chosen);
        Ok(())
    }

    /// Cuts or fills, whichever changes fewer cells. Every handle goes round a tunnel, and once it is cut, the tunnel is gone; but nobody
    /// says which belongs to which. So both are looked for anew after each of a few runs from small to large: of the side that has the
    /// cheapest loop, those that are cheaper than any of the other side are removed, but not less than a quarter of what it has of this
    /// size. Sizes rise in steps of four, and erosion with them, so that small loops do not cost a thinning of the whole volume.
    fn cheapest(&mut self) -> Result<()> {
        let depth = self.octree.signed().crossings().depth();
        let mut excess = self.report.after.handles.saturating_sub(self.options.genus.unwrap_or(0)) as usize;
        let mut size = FIRST_SIZE;
        while excess > 0 {
            let found = [self.by_cost(Side::Object, size)?, self.by_cost(Side::Background, size)?];
            let least = [0, 1].map(|side: usize| found[side].1.first().map_or(u64::MAX, |cheapest| cheapest.0));
            let side = usize::from(least[1] < least[0]);
            let (loops, list) = &found[side];
            if list.is_empty() {
                if size.is_infinite() {
                    break;
                }
                // No section is wider than the root.
                size = if size < 4f64.powi(depth as i32) { 4.0 * size } else { f64::INFINITY };
                continue;
            }
            let run = list.partition_point(|(cost, _)| *cost <= least[1 - side]);
            let count = run.max(list.len().div_ceil(4)).min(excess);
            let chosen: Vec<usize> = list[..count].iter().map(|(_, i)| *i).collect();
            self.apply(loops, &chosen)?;
            excess -= count;
        }
        Ok(())
    }

    /// The loops of a side that may be removed, with the number of cells that each changes, from the cheapest on: those of up to `size`
    /// cells, which have about as much area at most, so that none is missing.
    fn by_cost(&self, side: Side, size: f64) -> Result<(Loops, Vec<(u64, usize)>)> {
        let bound = self.options.size(side).unwrap_or(f64::INFINITY);
        let loops = Loops::find(&self.octree, side, size.min(self.options.area(side, bound)), self.progress)?;
        let mut list = loops.by_cost(&self.octree, self.up_to(&loops, bound));
        list.retain(|(cost, _)| *cost as f64 <= size);
        Ok((loops, list))
    }
}
