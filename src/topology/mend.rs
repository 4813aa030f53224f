//! Topology repair as a whole: which loops are removed, and how.

use super::betti::Betti;
use super::complex::{Complex, Side};
use super::patch::patches;
use super::skeleton::Skeleton;
use super::span::{Loop, loops};
use super::thin::thin;
use super::volumes::move_small;
use crate::error::{Error, Result};
use crate::octree::{EditedOctree, SignedOctree};
use crate::progress::{Progress, Stage};

/// What to repair; `Options { cut: Some(20.0), ..Options::default() }`. By default, nothing.
///
/// Lengths are in cells of the finest level, areas in their squares, volumes in their cubes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// Cut handles of up to this cross-section; infinity: all that a patch can cut.
    pub cut: Option<f64>,
    /// Fill tunnels of up to this cross-section, after cutting.
    pub fill: Option<f64>,
    /// Remove the smallest handles and tunnels, by cut or fill, whichever is smaller, until at most so many handles are left. `cut` and
    /// `fill`, where given, bound what may be used.
    pub genus: Option<u64>,
    /// Decide for each loop whether to cut or to fill, whichever is smaller, instead of cutting first. `cut` and `fill` bound what may be
    /// used, without a bound where they are not given.
    pub cheapest: bool,
    /// Fill cavities of up to this volume.
    pub fill_cavities: Option<f64>,
    /// Drop floating parts of up to this volume.
    pub drop_islands: Option<f64>,
}

impl Options {
    /// # Errors
    /// When a size is negative or not a number.
    fn check(&self) -> Result<()> {
        let sizes = [
            ("cut", self.cut),
            ("fill", self.fill),
            ("fill_cavities", self.fill_cavities),
            ("drop_islands", self.drop_islands),
        ];
        match sizes.into_iter().find(|(_, size)| size.is_some_and(|size| size.is_nan() || size < 0.0)) {
            Some((name, size)) => Err(Error::setting(
                name,
                format!("{} is not a size", size.unwrap_or_default()),
                "give a number from 0 on",
            )),
            None => Ok(()),
        }
    }
}

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
}

impl Handle {
    fn new(kind: Kind, found: &Loop) -> Self {
        let section = &found.section;
        Handle { kind, area: section.area, squares: section.squares, centre: found.centre }
    }

    /// Diameter of the disc of the same area, in cells.
    pub fn diameter(&self) -> f64 {
        2.0 * (self.area / std::f64::consts::PI).sqrt()
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

/// All loops of one side.
#[derive(Debug)]
pub struct Loops {
    complex: Complex,
    skeleton: Skeleton,
    found: Vec<Loop>,
}

impl Loops {
    /// Thins one side of a solid and finds its loops, from the smallest on. With a `limit` (area of the cross-section, in squares of
    /// cells), erosion ends where nothing of that size can be left, and larger loops may be missing or incomplete: cost and
    /// memory grow with the surface, and not with the volume.
    ///
    /// # Errors
    /// `Cancelled`.
    pub fn find(octree: &EditedOctree, side: Side, limit: f64, progress: &dyn Progress) -> Result<Loops> {
        let mut complex = Complex::new(octree, side);
        thin(&mut complex, layers(limit), progress)?;
        let skeleton = Skeleton::new(&complex);
        let found = loops(octree, &complex, &skeleton, limit, progress)?;
        Ok(Loops { complex, skeleton, found })
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
    pub fn handles(&self) -> Vec<Handle> {
        let kind = match self.complex.side() {
            Side::Object => Kind::Cut,
            Side::Background => Kind::Fill,
        };
        self.found.iter().map(|found| Handle::new(kind, found)).collect()
    }

    /// Removes the `count` smallest loops. `octree` is what the loops were found in.
    ///
    /// # Panics
    /// When there are not as many.
    pub fn remove(&self, octree: EditedOctree, count: usize) -> EditedOctree {
        let edges: Vec<_> = self.found[..count].iter().map(|found| found.edge).collect();
        let elements = patches(&octree, &self.complex, &edges);
        octree.with(elements, self.complex.side() == Side::Background)
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
    let mut list = Loops::find(octree, Side::Object, limit, progress)?.handles();
    list.extend(Loops::find(octree, Side::Background, limit, progress)?.handles());
    Ok(list)
}

/// Repairs the topology of a solid: drops floating parts, fills cavities, cuts handles, fills tunnels, in this order.
///
/// # Errors
/// When an option is out of range, and `Cancelled`.
pub fn repair_topology(
    signed: SignedOctree,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(EditedOctree, TopologyReport)> {
    options.check()?;
    progress.begin(Stage::Topology, 0);
    let mut octree = EditedOctree::unedited(signed);
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
    let mut work = Work { octree, report, progress };
    if options.genus.is_some() || options.cheapest {
        work.cheapest(options)?;
    } else {
        work.remove(Side::Object, options.cut)?;
        work.remove(Side::Background, options.fill)?;
    }
    let Work { octree, mut report, .. } = work;
    if octree.is_edited() {
        report.after = Betti::of(&octree);
    }
    report.removed = octree.removed().len() as u64;
    report.added = octree.added().len() as u64;
    report.changed_cells = octree.changed_cells();
    Ok((octree, report))
}

/// The area up to which loops are looked for first, where it is not known how large those are that have to go: most of what noise makes is
/// smaller.
const FIRST_SIZE: f64 = 8.0;

struct Work<'a> {
    octree: EditedOctree,
    report: TopologyReport,
    progress: &'a dyn Progress,
}

impl Work<'_> {
    /// Removes all loops of one side up to a size.
    fn remove(&mut self, side: Side, size: Option<f64>) -> Result<()> {
        let Some(size) = size else { return Ok(()) };
        // Each cut and each fill removes one.
        if self.report.after.handles as usize == self.report.cuts.len() + self.report.fills.len() {
            return Ok(());
        }
        let loops = Loops::find(&self.octree, side, size, self.progress)?;
        let count = loops.found.partition_point(|found| found.section.area <= size);
        self.apply(&loops, count);
        Ok(())
    }

    fn apply(&mut self, loops: &Loops, count: usize) {
        if count == 0 {
            return;
        }
        let list = match loops.complex.side() {
            Side::Object => &mut self.report.cuts,
            Side::Background => &mut self.report.fills,
        };
        list.extend(loops.handles().into_iter().take(count));
        let depth = self.octree.signed().crossings().depth();
        let octree = std::mem::replace(&mut self.octree, EditedOctree::unedited(SignedOctree::empty(depth)));
        self.octree = loops.remove(octree, count);
    }

    /// Cuts or fills, whichever is smaller. Every handle goes round a tunnel, and once it is cut, the tunnel is gone; but nobody says which
    /// belongs to which. So both are looked for anew after each of a few runs from small to large: of the side that has the smallest
    /// loop, those that are smaller than any of the other side are removed, but not less than a quarter of what it has of this size.
    /// Sizes rise in steps of four, and erosion with them, so that small loops do not cost a thinning of the whole volume.
    fn cheapest(&mut self, options: &Options) -> Result<()> {
        let depth = self.octree.signed().crossings().depth();
        let bounds = [options.cut, options.fill].map(|size| size.unwrap_or(f64::INFINITY));
        let mut excess = self.report.after.handles.saturating_sub(options.genus.unwrap_or(0)) as usize;
        let mut size = FIRST_SIZE;
        while excess > 0 {
            let mut sides = Vec::with_capacity(2);
            for (side, bound) in [Side::Object, Side::Background].into_iter().zip(bounds) {
                let loops = Loops::find(&self.octree, side, bound.min(size), self.progress)?;
                let sizes: Vec<f64> = loops.found.iter().map(|found| found.section.area).collect();
                let count = sizes.partition_point(|&area| area <= bound.min(size));
                sides.push((loops, sizes[..count].to_vec()));
            }
            let smallest = [0, 1].map(|side| sides[side].1.first().copied().unwrap_or(f64::INFINITY));
            let side = usize::from(smallest[1] < smallest[0]);
            let (loops, sizes) = &sides[side];
            if sizes.is_empty() {
                if size.is_infinite() {
                    break;
                }
                // No section is wider than the root.
                size = if size < 4f64.powi(depth as i32) { 4.0 * size } else { f64::INFINITY };
                continue;
            }
            let run = sizes.partition_point(|&area| area <= smallest[1 - side]);
            let count = run.max(sizes.len().div_ceil(4)).min(excess);
            self.apply(loops, count);
            excess -= count;
        }
        Ok(())
    }
}
