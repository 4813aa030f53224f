//! Winding numbers of surfaces with boundary.

use super::circulation::Circulation;
use super::field::{self, Dipole, Field};
use super::levels::{Counter, Layer, Rows, Steps};
use super::relax::{UNIT, Values};
use super::samples::{Rule, push_samples};
use super::whole::steps_of;
use super::world;
use crate::error::Result;
use crate::geom::normal::NormalCode;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Face, Key};
use crate::octree::SignedOctree;
use crate::octree::crossings::{Sample, finest_element, lattice_point};
use crate::octree::hits::OrientedHits;
use crate::progress::{Progress, Stage, check};
use crate::sign::close::{Switch, span};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Patches that span the boundary of an oriented surface.
#[derive(Debug)]
pub struct Patches {
    /// Edges that patches cross, sorted, and by how much the winding number rises along them.
    edges: Vec<(Key, i32)>,
    rings: u64,
    /// Whether hits and patches enclose a negative volume as they are turned. Then hits count the other way, and `edges` says so as well.
    reversed: bool,
}

impl Patches {
    /// Spans all rings of the boundary.
    ///
    /// # Errors
    /// `Cancelled`.
    pub fn new(hits: &OrientedHits, circulations: &[Circulation], progress: &dyn Progress) -> Result<Patches> {
        let patches = Patches::turned(hits, circulations, false, progress)?;
        if Bricks::of_surface(hits, &patches).volume() >= 0 {
            return Ok(patches);
        }
        // Not the same rings the other way: made anew, so that a surface and its reverse come to exactly the same.
        Patches::turned(hits, circulations, true, progress)
    }

    fn turned(
        hits: &OrientedHits,
        circulations: &[Circulation],
        reversed: bool,
        progress: &dyn Progress,
    ) -> Result<Patches> {
        let sign = if reversed { -1 } else { 1 };
        let faces: Vec<(Key, i32)> = circulations.iter().map(|c| (c.face, sign * c.strength)).collect();
        let (mut switches, rings) = span(hits.edges(), &faces, progress)?;
        switches.par_sort_unstable();
        let sum = |same: &[Switch]| (same[0].edge, same.iter().map(|s| if s.rises { 1 } else { -1 }).sum());
        let edges = switches.chunk_by(|a, b| a.edge == b.edge).map(sum).filter(|&(_, jump)| jump != 0).collect();
        Ok(Patches { edges, rings, reversed })
    }

    /// Whether the surface was found to be turned inside out.
    pub fn reversed(&self) -> bool {
        self.reversed
    }

    /// Number of rings of the boundary: about that of holes.
    pub fn rings(&self) -> u64 {
        self.rings
    }

    /// The edges that they cross, sorted, and by how much the winding number rises along each.
    pub fn edges(&self) -> impl Iterator<Item = (Key, i32)> {
        self.edges.iter().copied()
    }

    /// Area of the patches, as the number of edges that they cross; edges crossed several times count as often.
    pub fn area(&self) -> u64 {
        self.edges.iter().map(|edge| u64::from(edge.1.unsigned_abs())).sum()
    }

    /// By how much the winding number rises along an edge.
    fn jump(&self, edge: Key) -> i32 {
        self.edges.binary_search_by_key(&edge, |e| e.0).map_or(0, |i| self.edges[i].1)
    }
}

/// The outcome of [`winding_signs`].
#[derive(Debug)]
pub struct Winding {
    /// Where the winding number is above one half.
    pub octree: SignedOctree,
    /// Points next to the root's boundary that would be inside: there the surface was clipped.
    pub clipped: u64,
}

/// Winding numbers above this are inside, give or take [`HOLD`].
const THRESHOLD: f32 = 0.5;
/// Beside a flat sheet the winding number comes as near to one half as the sheet is large, on one side from below, and inside of a solid
/// from above. What is rounded must not make a crust of the sheet, or a slit in the solid. So points for which patches and hits together
/// say outside must be above the threshold by this, and those for which they say inside may be below it. It moves the surface by a
/// sixtieth of a hole's radius.
const HOLD: f32 = 1.0 / 64.0;
/// Values of coarser levels are trusted that far.
const MARGIN: f32 = 0.1;

/// Inside and outside of a surface with boundary.
///
/// # Errors
/// `Cancelled`.
pub fn winding_signs(hits: &OrientedHits, patches: &Patches, progress: &dyn Progress) -> Result<Winding> {
    progress.begin(Stage::Sign, 0);
    let bricks = Bricks::of_surface(hits, patches);
    let mut rows = bricks.rows();
    rows.walk(|i| bricks.steps(i), |_| ());
    let depth = hits.edges().depth();
    let wanted = |key, range| {
        let Some((first, side)) = world::in_root(depth, key) else { return false };
        let cell = |at| Key::cell(depth - 3, at).expect("in the root");
        let (first, last) = (cell(first), cell(first.map(|c| c + side - 1)));
        let number = bricks.none_between(first, last).then(|| rows.between(first, depth));
        may_pass(number, range)
    };
    let field = field::solve(depth, patches.sources(depth), patches.dipole(depth), wanted, progress)?;
    check(progress)?;

    // The same again with all bricks through which the surface may run, and those before them, which own edges into them.
    let bricks = bricks.with(field.finest_bricks().iter().filter_map(|&key| world::to_root(depth, key)));
    let mut rows = bricks.rows();
    let layers = rows.walk(
        |i| bricks.steps(i),
        |i| {
            let key = world::from_root(depth, bricks.keys[i]);
            let values = field.values(key);
            Above { values, value: if values.is_some() { 0.0 } else { field.middle(key) }, inside: Plane::EMPTY }
        },
    );
    let mut clipped = 0;
    let signs: Vec<(Key, Plane)> = bricks
        .keys
        .iter()
        .zip(layers)
        .map(|(&key, inside)| {
            let (inside, off) = clip(depth, key, inside);
            clipped += off;
            (key, inside)
        })
        .collect();
    let uniform = |key| rows.between(key, depth) >= least(field.middle(world::from_root(depth, key)));
    let edges = hits.edges();
    let rule = if patches.reversed { Rule::Negative } else { Rule::Positive };
    let octree = SignedOctree::from_signs(depth, edges.with_normals(), &signs, uniform, |i, crossed, out| {
        let (key, inside) = &signs[i];
        let origin = lattice_point(depth, *key);
        let elsewhere = |axis, local: Local| {
            let c = local.coords();
            Smooth { field: &field, patches, depth }.sample(
                axis,
                std::array::from_fn(|a| origin[a] + c[a]),
                edges.with_normals(),
            )
        };
        push_samples(hits, *key, inside, crossed, rule, elsewhere, out);
    });
    Ok(Winding { octree, clipped })
}

/// The winding number at any lattice point, slowly.
#[cfg(test)]
pub(super) fn numbers(hits: &OrientedHits, patches: &Patches) -> impl Fn([u32; 3]) -> f64 {
    let depth = hits.edges().depth();
    let silent = &crate::progress::Silent;
    let field = field::solve(depth, patches.sources(depth), patches.dipole(depth), |_, _| false, silent);
    let field = field.expect("not cancelled");
    // Whole numbers from jumps along x, added up point by point.
    let mut jumps: Vec<([u32; 3], i32)> = Vec::new();
    for brick in hits.edges().bricks().iter() {
        let origin = hits.edges().origin(brick);
        hits.for_edges(brick, |axis, local, of_edge| {
            let c = local.coords();
            let net = of_edge.iter().map(|hit| if patches.reversed { -hit.jump() } else { hit.jump() }).sum();
            jumps.extend((axis == Axis::X).then(|| (std::array::from_fn(|a| origin[a] + c[a]), net)));
        });
    }
    jumps.extend(patches.ends(depth).filter(|end| end.1 == Axis::X).map(|([start, _], _, jump)| (start, jump)));
    let sign = if patches.reversed { -1.0 } else { 1.0 };
    move |at| {
        let before = jumps.iter().filter(|(p, _)| p[1..] == at[1..] && p[0] < at[0]).map(|j| j.1).sum::<i32>();
        sign * (f64::from(before) - f64::from(field.at_point(depth, at)))
    }
}

/// Whether a point is inside, from its whole number and its smooth part.
fn is_inside(number: i32, smooth: f32) -> bool {
    let hold = if number > 0 { -HOLD } else { HOLD };
    number as f32 - smooth > THRESHOLD + hold
}

/// Whether the final surface may run where the smooth part is in a range, and the whole number is known or not.
fn may_pass(number: Option<i32>, [low, high]: [f32; 2]) -> bool {
    let (low, high) = (least(low - MARGIN), least(high + MARGIN));
    match number {
        Some(number) => (low..high).contains(&number),
        None => low != high,
    }
}

/// The least whole number that is inside where the smooth part is not near to what decides.
fn least(smooth: f32) -> i32 {
    (smooth + THRESHOLD).floor() as i32 + 1
}

/// Makes the points on the root's boundary outside. Also returns how many points next to it are inside.
fn clip(depth: u32, brick: Key, mut inside: Plane) -> (Plane, u64) {
    let mut clipped = 0;
    let coords = lattice_point(depth, brick);
    for (a, at) in coords.into_iter().enumerate() {
        for (end, layer) in [(0, 0), ((1 << depth) - 8, 7)] {
            if at == end {
                let beside = (0..512).map(Local::from_index).filter(|p| p.coords()[a] == layer && inside.get(*p));
                let beside: Vec<Local> = beside.collect();
                clipped += beside.len() as u64;
                if layer == 0 {
                    beside.into_iter().for_each(|p| inside.toggle(p));
                }
            }
        }
    }
    (inside, clipped)
}

/// The points of a brick whose winding number is inside.
struct Above<'a> {
    /// The smooth part, point by point.
    values: Option<&'a Values>,
    /// Where that is not known, the same for all.
    value: f32,
    inside: Plane,
}

impl Layer<Plane> for Above<'_> {
    fn at(&mut self, x: usize, counter: &Counter) {
        let Some(values) = self.values else {
            self.inside.0[x] = counter.at_least(least(self.value));
            return;
        };
        let numbers = counter.values();
        let bit = |line: usize| u64::from(is_inside(numbers[line], f32::from(values[64 * x + line]) / UNIT));
        self.inside.0[x] = (0..64).fold(0, |word, line| word | bit(line) << line);
    }

    fn end(self) -> Plane {
        self.inside
    }
}

/// Bricks and the jumps along their edges, those of patches included.
struct Bricks<'a> {
    hits: &'a OrientedHits,
    patches: &'a Patches,
    /// Sorted.
    keys: Vec<Key>,
}

impl<'a> Bricks<'a> {
    /// All bricks with hits or patches.
    fn of_surface(hits: &'a OrientedHits, patches: &'a Patches) -> Self {
        let depth = hits.edges().depth();
        let mut of_patches: Vec<Key> = patches.edges.iter().map(|&(edge, _)| brick_of(depth, edge)).collect();
        of_patches.dedup();
        let keys = hits.edges().bricks().iter().map(|brick| brick.key).collect();
        Bricks { hits, patches, keys }.with(of_patches.into_iter())
    }

    /// More bricks, and those before them along each axis.
    fn with(self, more: impl Iterator<Item = Key>) -> Self {
        let mut keys = self.keys;
        keys.extend(more.flat_map(|key| {
            let before = Axis::ALL.into_iter().filter_map(move |axis| key.neighbour(Face::new(axis, false)));
            before.chain([key])
        }));
        keys.par_sort_unstable();
        keys.dedup();
        Bricks { keys, ..self }
    }

    fn rows(&self) -> Rows {
        Rows::new(self.hits.edges().depth(), self.keys.par_iter().copied())
    }

    /// Whether none of them lies between two, in their order.
    fn none_between(&self, first: Key, last: Key) -> bool {
        let next = self.keys.partition_point(|&key| key < first);
        self.keys.get(next).is_none_or(|&key| key > last)
    }

    /// The jumps along the x-edges of brick `i`.
    fn steps(&self, i: usize) -> Steps {
        let key = self.keys[i];
        let edges = self.hits.edges();
        let mut steps = edges.find(key).map_or_else(Steps::default, |place| steps_of(self.hits, place));
        if self.patches.reversed {
            std::mem::swap(&mut steps.rises, &mut steps.falls);
            steps.more.iter_mut().for_each(|(_, jump)| *jump = -*jump);
        }
        let (depth, before) = (edges.depth(), steps.more.len());
        for &(edge, jump) in &self.patches.edges[self.patches.range(depth, key)] {
            if edge.dir() == Axis::X.into() {
                let [x, y, z] = lattice_point(depth, edge);
                steps.more.push((Local::new(x, y, z), jump));
            }
        }
        if steps.more.len() > before {
            steps.more.sort_unstable();
        }
        steps
    }

    /// Sign and size of the volume that hits and patches enclose, in cells.
    fn volume(&self) -> i64 {
        let volume = |i: usize| {
            let origin = i64::from(lattice_point(self.hits.edges().depth(), self.keys[i])[0]);
            let Steps { rises, falls, more } = self.steps(i);
            let net = |x: usize| i64::from(falls.0[x].count_ones()) - i64::from(rises.0[x].count_ones());
            let single: i64 = (0..8).map(|x| net(x) * (origin + x as i64)).sum();
            single - more.iter().map(|&(p, jump)| i64::from(jump) * (origin + i64::from(p.coords()[0]))).sum::<i64>()
        };
        (0..self.keys.len()).into_par_iter().map(volume).sum()
    }
}

/// The finest brick that owns an edge.
fn brick_of(depth: u32, edge: Key) -> Key {
    Key::cell(depth - 3, lattice_point(depth, edge).map(|c| c >> 3)).expect("edges lie in bricks")
}

impl Patches {
    /// The places of the edges of a brick. Those of a brick stand together, and bricks in order.
    fn range(&self, depth: u32, brick: Key) -> Range<usize> {
        let start = self.edges.partition_point(|&(edge, _)| brick_of(depth, edge) < brick);
        let len = self.edges[start..].iter().take_while(|&&(edge, _)| brick_of(depth, edge) == brick).count();
        start..start + len
    }

    /// Both ends of each edge.
    fn ends(&self, depth: u32) -> impl Iterator<Item = ([[u32; 3]; 2], Axis, i32)> {
        self.edges.iter().map(move |&(edge, jump)| {
            let axis = edge.dir().axes().next().expect("an edge has an axis");
            let start = lattice_point(depth, edge);
            let mut end = start;
            end[axis.index()] += 1;
            ([start, end], axis, jump)
        })
    }

    /// The sources of the smooth part.
    fn sources(&self, depth: u32) -> Vec<(Key, Local, i32)> {
        let at = |[x, y, z]: [u32; 3], strength| (world::at_point(depth, [x, y, z]), Local::new(x, y, z), strength);
        self.ends(depth).flat_map(|([start, end], _, jump)| [at(start, jump), at(end, -jump)]).collect()
    }

    /// What they are from afar.
    fn dipole(&self, depth: u32) -> Dipole {
        let (mut area, mut middle, mut weight) = ([0i64; 3], [0i64; 3], 0i64);
        for ([start, end], axis, jump) in self.ends(depth) {
            area[axis.index()] += i64::from(jump);
            weight += 2 * i64::from(jump.abs());
            (0..3).for_each(|a| middle[a] += i64::from(start[a] + end[a]) * i64::from(jump.abs()));
        }
        let root = f64::from(1u32 << depth);
        let centre = DVec3::from(middle.map(|c| root + c as f64 / weight.max(1) as f64));
        Dipole { area: DVec3::from(area.map(|c| c as f64)), centre }
    }
}

/// Crossings where no face is.
struct Smooth<'a> {
    field: &'a Field,
    patches: &'a Patches,
    depth: u32,
}

impl Smooth<'_> {
    /// Where and how steeply the surface crosses the edge that starts at `start`.
    fn sample(&self, axis: Axis, start: [u32; 3], with_normals: bool) -> Sample {
        let mut end = start;
        end[axis.index()] += 1;
        let jump = self.jump(start, axis) as f32;
        let (a, b) = (self.field.at_point(self.depth, start), self.field.at_point(self.depth, end) - jump);
        // Along the edge the winding number is this or that whole number less what goes from a to b: the one with which it passes.
        let number = (THRESHOLD + 0.5 * (a + b)).round();
        let t = (number - THRESHOLD - a) / (b - a);
        let position = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.5 };
        let normal = if with_normals { self.normal(axis, start, end) } else { DVec3::ZERO };
        Sample::new(
            (position * 65535.0) as u16,
            if with_normals { NormalCode::encode(axis, normal.to_array()).0 } else { 0 },
        )
    }

    fn jump(&self, start: [u32; 3], axis: Axis) -> i32 {
        self.patches.jump(finest_element(self.depth, start, axis.into()))
    }

    /// By how much the smooth part rises along an edge, without the patches' jump: minus that of the winding number without hits.
    fn slope(&self, start: [u32; 3], axis: Axis) -> f64 {
        let mut end = start;
        end[axis.index()] += 1;
        let rise = self.field.at_point(self.depth, end) - self.field.at_point(self.depth, start);
        f64::from(rise - self.jump(start, axis) as f32)
    }

    /// The gradient at the middle of an edge, but not along the surface: the component along the edge is at least a little.
    fn normal(&self, axis: Axis, start: [u32; 3], end: [u32; 3]) -> DVec3 {
        let mut normal = DVec3::ZERO;
        for u in axis.others() {
            let mut sum = 0.0;
            let mut count = 0.0;
            for mut p in [start, end] {
                for _ in 0..2 {
                    if p[u.index()] < 1 << self.depth {
                        sum += self.slope(p, u);
                        count += 1.0;
                    }
                    if p[u.index()] == 0 {
                        break;
                    }
                    p[u.index()] -= 1;
                }
            }
            normal[u.index()] = if count > 0.0 { sum / count } else { 0.0 };
        }
        let along = self.slope(start, axis);
        let least = 1e-3 * normal.abs().max_element().max(1e-9);
        normal[axis.index()] = if along.abs() < least { least.copysign(along) } else { along };
        normal
    }
}
