//! Winding numbers of surfaces with boundary.
//!
//! A lattice point is inside if w = n + s is above one half, n being the whole number of hits and patches together, and s the angle of the
//! spanning surface. Nearly everywhere that is known without looking at the point:
//!
//! - From the root down, cells which no patch enters are looked at. Where patches are too small and too far for |s| to come to one half,
//!   inside is where n is positive. Else the angle at the cell's middle and a bound of how much it differs within (`Field::steepness`) may
//!   leave one answer to how large n must be. Then the cell is *calm*: bits of n are compared, 64 points at once. Cells without hits, whose
//!   n is one number, are calm wherever w stays away from one half.
//! - What is left are *rough* bricks: near the boundary, along patches, and where the surface w = 1/2 closes a hole. In each block of 4 x 4 x 4
//!   points, value and slope of the angle at its middle and the bound of the second derivative decide about all points but those within a
//!   fraction of a cell of that surface. These are looked at one by one.
//! - Blocks next to the boundary have a `View`: what is near is summed up for every point, the rest is a polynomial.
//!
//! w is continuous across patches: in a block it is followed from the middle, and jumps at hits of the surface only.
//!
//! Beside a flat sheet w comes as near to one half as the sheet is large, on one side from below, or inside of a solid from above. So the few
//! points nearer to it than angles are right are *ties*: they go with their neighbours if all of these agree.

use super::field::{ERROR, Field};
use super::levels::{Counter, Layer, Rows, Steps};
use super::net::Net;
use super::patches::Patches;
use super::samples::{Rule, push_samples};
use super::view::{VIEW_ERROR, View};
use super::whole::steps_of;
use crate::error::Result;
use crate::geom::frame::FINE_BITS;
use crate::geom::normal::NormalCode;
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Face, Key};
use crate::octree::SignedOctree;
use crate::octree::crossings::{Sample, lattice_point};
use crate::octree::hits::OrientedHits;
use crate::progress::{Progress, Stage, check};
use glam::DVec3;
use rayon::prelude::*;
use std::cell::OnceCell;
use std::cmp::Ordering;

/// The outcome of [`winding_signs`].
#[derive(Debug)]
pub struct Winding {
    /// Where the winding number is above one half.
    pub octree: SignedOctree,
    /// Points next to the root's boundary that would be inside: there the surface was clipped.
    pub clipped: u64,
}

/// Bytes held for each brick: its key, its place in a row, its signs as they are found and in order. What the octree takes comes mostly
/// in their stead.
const BRICK_BYTES: usize = 2 * size_of::<(Key, Plane, Vec<Local>)>() + 3 * size_of::<u64>();
/// Estimates that may be wrong by more decide too little of a block to be worth their while.
const MOST: f64 = 0.25;
/// Half the points along the side of a block.
const HALF: u32 = 2;
/// Winding numbers above this are inside.
const THRESHOLD: f64 = 0.5;

/// Inside and outside of a surface with boundary.
///
/// # Errors
/// `Cancelled`, and `Memory` when `progress` says so.
pub fn winding_signs(hits: &OrientedHits, patches: &Patches, progress: &dyn Progress) -> Result<Winding> {
    progress.begin(Stage::Sign, 0);
    let depth = hits.edges().depth();
    let bricks = Bricks::of_surface(hits, patches);
    let mut rows = bricks.rows();
    rows.walk(|i| bricks.steps(i), |_| ());
    let parts = Parts::of(&bricks, &rows);
    check(progress)?;

    // The same again with all rough bricks, and those before them, which own edges into them.
    let bricks = bricks.with(parts.rough());
    let held = hits.bytes() / 4 * 5 + patches.bytes() + parts.bytes() + bricks.keys.len() * BRICK_BYTES;
    progress.hold(held as u64)?;
    let mut rows = bricks.rows();
    let angles = Angles::new(hits, patches);
    let made = rows.walk(
        |i| bricks.steps(i),
        |i| {
            let key = bricks.keys[i];
            Points {
                angles: &angles,
                parts: &parts,
                key,
                least: parts.least(key),
                numbers: Vec::new(),
                inside: Plane::EMPTY,
            }
        },
    );
    check(progress)?;
    let uniform = |key| parts.least(key).is_some_and(|least| rows.between(key, depth) >= least);
    let mut signs: Vec<(Key, Plane)> = bricks.keys.iter().copied().zip(made.iter().map(|made| made.0)).collect();
    let ties = made.into_iter().enumerate().flat_map(|(i, (_, ties))| ties.into_iter().map(move |local| (i, local)));
    break_ties(depth, &mut signs, &ties.collect::<Vec<_>>(), uniform);
    let edge = inside_at_boundary(depth, Key::ROOT, &bricks.keys, &uniform);
    progress.hold((held + edge.len() * BRICK_BYTES) as u64)?;
    signs.extend(edge.into_iter().map(|key| (key, Plane::FULL)));
    signs.par_sort_unstable_by_key(|sign| sign.0);
    let mut clipped = 0;
    for (key, inside) in &mut signs {
        clipped += clip(depth, *key, inside);
    }
    let edges = hits.edges();
    let rule = if patches.reversed() { Rule::Negative } else { Rule::Positive };
    let samples = |i: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
        let (key, inside) = &signs[i];
        let origin = lattice_point(depth, *key);
        let field = OnceCell::new();
        let elsewhere = |axis, local: Local| {
            let c = local.coords();
            let field = field.get_or_init(|| angles.of_brick(&parts, *key));
            angles.sample(field, axis, std::array::from_fn(|a| origin[a] + c[a]), edges.with_normals())
        };
        push_samples(hits, *key, inside, crossed, rule, elsewhere, out);
    };
    let octree = SignedOctree::try_from_signs(depth, edges.with_normals(), &signs, uniform, samples, progress)?;
    Ok(Winding { octree, clipped })
}

/// The least whole number that is inside where the angle is `angle`: bounds of angles beside a rim may be far beyond all whole numbers.
fn least(angle: f64) -> i32 {
    ((THRESHOLD - angle).floor() as i32).saturating_add(1)
}

/// Lets ties agree with their neighbours if these agree with each other. `ties` are sorted.
fn break_ties(depth: u32, signs: &mut [(Key, Plane)], ties: &[(usize, Local)], uniform: impl Fn(Key) -> bool) {
    let place = |brick: Key| signs.binary_search_by_key(&brick, |sign| sign.0);
    // `None` of a tie.
    let decided = |brick: Key, local: Local| match place(brick) {
        Ok(i) if ties.binary_search(&(i, local)).is_ok() => None,
        Ok(i) => Some(signs[i].1.get(local)),
        Err(_) => Some(uniform(brick)),
    };
    let side = 1 << depth;
    let turned = ties.iter().filter(|&&(i, local)| {
        let (origin, c) = (lattice_point(depth, signs[i].0), local.coords());
        let mut beside = Face::ALL.into_iter().filter_map(|face| {
            let mut at: [u32; 3] = std::array::from_fn(|a| origin[a] + c[a]);
            let a = face.axis().index();
            at[a] = if face.is_high() { at[a] + 1 } else { at[a].wrapping_sub(1) };
            if at[a] >= side {
                return Some(false);
            }
            let brick = Key::cell(depth - 3, at.map(|c| c >> 3)).expect("in the root");
            decided(brick, Local::new(at[0], at[1], at[2]))
        });
        let mine = signs[i].1.get(local);
        beside.next().is_some_and(|first| first != mine && beside.all(|other| other == first))
    });
    for (i, local) in turned.copied().collect::<Vec<_>>() {
        signs[i].1.toggle(local);
    }
}

/// The bricks of a cell at the root's boundary that are not among `keys`, which are sorted, and inside as a whole. Those that hang together
/// without one of `keys` are all on one side.
fn inside_at_boundary(depth: u32, cell: Key, keys: &[Key], uniform: &impl Fn(Key) -> bool) -> Vec<Key> {
    let level = cell.level().expect("a cell");
    let [first, last] = ends(depth, cell);
    let is_at_boundary =
        Face::ALL.into_iter().any(|face| (if face.is_high() { last } else { first }).neighbour(face).is_none());
    let keys = &keys[keys.partition_point(|&key| key < first)..keys.partition_point(|&key| key <= last)];
    if !is_at_boundary {
        return Vec::new();
    }
    match (keys.is_empty(), level == depth - 3) {
        (false, true) => Vec::new(),
        (true, _) if !uniform(first) => Vec::new(),
        (true, true) => vec![cell],
        (_, false) => {
            cell.children().into_iter().flat_map(|child| inside_at_boundary(depth, child, keys, uniform)).collect()
        }
    }
}

/// The first and the last brick of a cell.
fn ends(depth: u32, cell: Key) -> [Key; 2] {
    let first = lattice_point(depth, cell).map(|c| c >> 3);
    let side = 1 << (depth - 3 - cell.level().expect("a cell"));
    [first, first.map(|c| c + side - 1)].map(|at| Key::cell(depth - 3, at).expect("in the root"))
}

/// Makes the points on the root's boundary outside. Returns how many points on it or next to it were inside.
fn clip(depth: u32, brick: Key, inside: &mut Plane) -> u64 {
    let mut clipped = 0;
    for (a, at) in lattice_point(depth, brick).into_iter().enumerate() {
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
    clipped
}

/// Bricks, and the jumps along their edges, those of patches included.
struct Bricks<'a> {
    hits: &'a OrientedHits,
    patches: &'a Patches,
    /// Sorted.
    keys: Vec<Key>,
}

impl<'a> Bricks<'a> {
    /// All bricks with hits of surface or patches.
    fn of_surface(hits: &'a OrientedHits, patches: &'a Patches) -> Self {
        let of = |hits: &OrientedHits| hits.edges().bricks().iter().map(|brick| brick.key).collect::<Vec<_>>();
        let bricks = Bricks { hits, patches, keys: of(hits) };
        bricks.and(of(&patches.hits))
    }

    fn and(mut self, more: Vec<Key>) -> Self {
        self.keys.extend(more);
        self.keys.par_sort_unstable();
        self.keys.dedup();
        self
    }

    /// More bricks, and those before them along each axis.
    fn with(self, more: impl Iterator<Item = Key>) -> Self {
        let before = |key: Key| Axis::ALL.into_iter().filter_map(move |axis| key.neighbour(Face::new(axis, false)));
        self.and(more.flat_map(|key| before(key).chain([key])).collect())
    }

    fn rows(&self) -> Rows {
        Rows::new(self.hits.edges().depth(), self.keys.par_iter().copied())
    }

    /// The jumps along the x-edges of brick `i`.
    fn steps(&self, i: usize) -> Steps {
        let of = |hits: &OrientedHits| hits.edges().find(self.keys[i]).map(|place| steps_of(hits, place));
        let mut steps = of(self.hits).unwrap_or_default();
        if self.patches.reversed() {
            steps.turn();
        }
        if let Some(more) = of(&self.patches.hits) {
            steps.add(more);
        }
        steps
    }
}

/// Levels between a district and its bricks.
const DISTRICT: u32 = 1;

/// The root, divided into calm cells and rough bricks.
#[derive(Default)]
struct Parts {
    /// The first brick of each, in order of keys, and the least number that is inside; none for rough bricks.
    parts: Vec<(Key, Option<i32>)>,
    /// The cells of 2 x 2 x 2 bricks that have several parts, sorted, and what they see.
    districts: Vec<(Key, Field)>,
}

impl Parts {
    /// `rows` have been walked.
    fn of(bricks: &Bricks<'_>, rows: &Rows) -> Parts {
        let keys = |hits: &OrientedHits| hits.edges().bricks().iter().map(|brick| brick.key).collect();
        let divide = Divide {
            depth: bricks.hits.edges().depth(),
            angles: Angles::new(bricks.hits, bricks.patches),
            surface: keys(bricks.hits),
            spanned: keys(&bricks.patches.hits),
            rows,
        };
        divide.parts(Key::ROOT, &divide.angles.whole)
    }

    fn rough(&self) -> impl Iterator<Item = Key> {
        self.parts.iter().filter(|part| part.1.is_none()).map(|part| part.0)
    }

    /// The least number that is inside in a brick, if it is calm.
    fn least(&self, brick: Key) -> Option<i32> {
        let next = self.parts.partition_point(|part| part.0 <= brick);
        self.parts[next - 1].1
    }

    /// What the district of a brick sees, if that has several parts.
    fn district(&self, brick: Key) -> Option<&Field> {
        let district = brick.ancestor(brick.level()?.saturating_sub(DISTRICT));
        let place = self.districts.binary_search_by_key(&district, |d| d.0).ok()?;
        Some(&self.districts[place].1)
    }

    fn bytes(&self) -> usize {
        let districts: usize = self.districts.iter().map(|(_, field)| field.bytes()).sum();
        districts + self.parts.capacity() * size_of::<(Key, Option<i32>)>()
    }

    /// Parts of cells in their order.
    fn joined(parts: impl IntoIterator<Item = Parts>) -> Parts {
        let mut all = Parts::default();
        for Parts { parts, districts } in parts {
            all.parts.extend(parts);
            all.districts.extend(districts);
        }
        all
    }
}

struct Divide<'a> {
    depth: u32,
    angles: Angles<'a>,
    /// Bricks with hits of the surface, sorted.
    surface: Vec<Key>,
    /// Bricks with hits of patches, sorted.
    spanned: Vec<Key>,
    rows: &'a Rows,
}

impl Divide<'_> {
    /// The parts of a cell, the upper levels by several threads; `field` is what the cell above it sees.
    fn parts(&self, cell: Key, field: &Field) -> Parts {
        let calm = self.calm(cell, field);
        let level = cell.level().expect("a cell");
        let bricks = self.depth - 3;
        if calm.is_some() || level == bricks {
            return Parts { parts: vec![(ends(self.depth, cell)[0], calm)], districts: Vec::new() };
        }
        let (middle, radius) = self.ball(cell);
        let field = self.angles.within(field, middle, radius);
        let of_child = |child| self.parts(child, &field);
        let mut parts = if level < 3 {
            Parts::joined(cell.children().into_par_iter().map(of_child).collect::<Vec<_>>())
        } else {
            Parts::joined(cell.children().map(of_child))
        };
        if level == bricks.saturating_sub(DISTRICT) {
            parts.districts.push((cell, field));
        }
        parts
    }

    /// Middle and radius of a cell.
    fn ball(&self, cell: Key) -> ([u32; 3], f64) {
        let half = 1 << (self.depth - 1 - cell.level().expect("a cell"));
        (lattice_point(self.depth, cell).map(|c| c + half), f64::from(half) * 3f64.sqrt())
    }

    /// The least number that is inside, if it is the same in all of the cell; `field` is that of a cell round it.
    fn calm(&self, cell: Key, field: &Field) -> Option<i32> {
        let [first, last] = ends(self.depth, cell);
        let any = |keys: &[Key]| keys.get(keys.partition_point(|&key| key < first)).is_some_and(|&key| key <= last);
        if any(&self.spanned) {
            return None;
        }
        let (middle, radius) = self.ball(cell);
        if self.angles.are_minor(field, middle, radius) {
            return Some(least(0.0));
        }
        let [first_order, _] = self.angles.steepness(field, middle, radius, f64::INFINITY);
        let reach = first_order * radius + ERROR;
        if reach.is_infinite() {
            return None;
        }
        let angle = self.angles.at(field, middle);
        if any(&self.surface) {
            let bounds = [least(angle - reach), least(angle + reach)];
            return (bounds[0] == bounds[1]).then_some(bounds[0]);
        }
        let number = f64::from(self.rows.between(first, self.depth)) + angle;
        ((number - THRESHOLD).abs() > reach).then(|| least(angle))
    }
}

/// The angle of the patches, by cells.
struct Angles<'a> {
    hits: &'a OrientedHits,
    patches: &'a Patches,
    /// What the root sees.
    whole: Field,
    /// log2 of fixed-point units in a cell.
    shift: u32,
}

impl<'a> Angles<'a> {
    fn new(hits: &'a OrientedHits, patches: &'a Patches) -> Self {
        Angles { hits, patches, whole: Field::whole(&patches.span), shift: FINE_BITS - hits.edges().depth() }
    }

    fn fine(&self, point: [u32; 3]) -> [i32; 3] {
        point.map(|c| (c << self.shift) as i32)
    }

    fn unit(&self) -> f64 {
        f64::from(1u32 << self.shift)
    }

    /// What is seen so many cells around a point; `field` is that of a ball round it.
    fn within(&self, field: &Field, point: [u32; 3], radius: f64) -> Field {
        field.within(&self.patches.span, self.place(point), radius * self.unit())
    }

    /// What a brick sees.
    fn of_brick(&self, parts: &Parts, brick: Key) -> Field {
        let middle = lattice_point(self.hits.edges().depth(), brick).map(|c| c + 4);
        self.within(parts.district(brick).unwrap_or(&self.whole), middle, 4.0 * 3f64.sqrt())
    }

    fn place(&self, point: [u32; 3]) -> DVec3 {
        DVec3::from(self.fine(point).map(f64::from))
    }

    fn at(&self, field: &Field, point: [u32; 3]) -> f64 {
        field.angle(&self.patches.span, self.fine(point))
    }

    /// The angle at a point, and how it changes by the cell.
    fn tangent(&self, field: &Field, point: [u32; 3]) -> (f64, DVec3) {
        let (angle, slope) = field.angle_and_slope(&self.patches.span, self.fine(point));
        (angle, slope * self.unit())
    }

    /// Whether the amount of the angle is below one half, so many cells around a point, by the size of patches alone.
    fn are_minor(&self, field: &Field, point: [u32; 3], radius: f64) -> bool {
        field.is_minor(&self.patches.span, self.place(point), radius * self.unit())
    }

    /// Bounds of the angle's derivatives by the cell, so many cells around a point; infinite if the second is above `most`.
    fn steepness(&self, field: &Field, point: [u32; 3], radius: f64, most: f64) -> [f64; 2] {
        let unit = self.unit();
        let [first, second] =
            field.steepness(&self.patches.span, self.place(point), radius * unit, most / (unit * unit));
        [first * unit, second * unit * unit]
    }

    /// Inside points of a rough brick from its whole numbers, and ties.
    fn inside(&self, parts: &Parts, brick: Key, numbers: &[[i32; 64]]) -> (Plane, Vec<Local>) {
        let edges = self.hits.edges();
        let net = edges.find(brick).map(|place| Net::of(self.hits, &edges.bricks()[place])).unwrap_or_default();
        let [x, y, z] = self.patches.hits.edges().brick_or_nothing(Some(brick)).crossed;
        let mut rough = Rough {
            angles: self,
            field: self.of_brick(parts, brick),
            origin: lattice_point(edges.depth(), brick),
            numbers,
            net,
            spanned: x | y | z,
            inside: Plane::EMPTY,
            ties: Vec::new(),
            view: View::default(),
        };
        for block in 0..8 {
            rough.block([block >> 2 & 1, block >> 1 & 1, block & 1].map(|bit| 2 * HALF * bit));
        }
        rough.ties.sort_unstable();
        (rough.inside, rough.ties)
    }

    /// Where and how steeply w passes one half on the edge that starts at `start`.
    fn sample(&self, field: &Field, axis: Axis, start: [u32; 3], with_normals: bool) -> Sample {
        let a = axis.index();
        let mut middle = self.fine(start);
        middle[a] += 1 << (self.shift - 1);
        let (angle, slope) = field.angle_and_slope(&self.patches.span, middle);
        let slope = slope * self.unit();
        // Up to a whole number: the nearest that is possible.
        let above = angle - THRESHOLD - (angle - THRESHOLD).round();
        let straight = 0.5 - above / slope[a];
        let position = if (-0.5..=1.5).contains(&straight) { straight } else { self.between(field, axis, start) };
        let offset = (position.clamp(0.0, 1.0) * 65535.0) as u16;
        if !with_normals {
            return Sample::new(offset, 0);
        }
        // Not along the edge.
        let least = 1e-3 * slope.abs().max_element().max(1e-30);
        let mut normal = slope.to_array();
        if normal[a].abs() < least {
            normal[a] = least.copysign(normal[a]);
        }
        Sample::new(offset, NormalCode::encode(axis, normal).0)
    }

    /// The same by values at both ends: next to the boundary.
    fn between(&self, field: &Field, axis: Axis, start: [u32; 3]) -> f64 {
        let mut end = start;
        end[axis.index()] += 1;
        let from = self.at(field, start);
        let to = self.at(field, end);
        let to = to + (from - to).round();
        let passed = (0.5 * (from + to) - THRESHOLD).round() + THRESHOLD;
        let position = (passed - from) / (to - from);
        if position.is_finite() { position } else { 0.5 }
    }
}

/// A rough brick at work.
struct Rough<'a> {
    angles: &'a Angles<'a>,
    /// What the brick sees.
    field: Field,
    origin: [u32; 3],
    numbers: &'a [[i32; 64]],
    /// Jumps of the surface.
    net: Net,
    /// Points at which an edge starts that a patch crosses.
    spanned: Plane,
    inside: Plane,
    ties: Vec<Local>,
    /// Of the block at work.
    view: View,
}

impl Rough<'_> {
    /// Decides about a block of 4 x 4 x 4 points.
    fn block(&mut self, low: [u32; 3]) {
        let middle = low.map(|c| c + HALF);
        let at = self.point(middle);
        let radius = f64::from(HALF) * 3f64.sqrt();
        let locals = (0..64u32).map(|i| [low[0] + (i >> 4), low[1] + (i >> 2 & 3), low[2] + (i & 3)]);
        if !locals.clone().any(|[x, y, z]| self.spanned.get(Local::new(x, y, z)))
            && self.angles.are_minor(&self.field, at, radius)
        {
            for local in locals {
                self.decide(local, f64::from(self.number(local)) - THRESHOLD, 0.0);
            }
            return;
        }
        // Above this, what the block's middle knows decides too little.
        let most = 2.0 * (MOST - ERROR) / (radius * radius);
        let [_, second] = self.angles.steepness(&self.field, at, radius, most);
        if second > most {
            let span = &self.angles.patches.span;
            let angles = self.view.angles(span, &self.field, self.angles.fine(at), 1 << self.angles.shift);
            for (local, angle) in locals.zip(angles) {
                let above = f64::from(self.number(local)) + f64::from(angle) - THRESHOLD;
                self.decide(local, above, VIEW_ERROR);
            }
            return;
        }
        let reach = |squared: f64| 0.5 * second * squared + ERROR;
        let (angle, slope) = self.angles.tangent(&self.field, at);
        let number = self.number(middle);
        for local in locals {
            let from_middle = DVec3::from(std::array::from_fn(|a| f64::from(local[a]) - f64::from(middle[a])));
            let number = f64::from(number + self.jumps(middle, local));
            let above = number + angle + slope.dot(from_middle) - THRESHOLD;
            self.decide(local, above, reach(from_middle.length_squared()));
        }
    }

    /// Enters a point of which w is so much above one half, give or take some.
    fn decide(&mut self, at: [u32; 3], above: f64, give: f64) {
        // What is not known is looked at.
        if above.abs().partial_cmp(&give) != Some(Ordering::Greater) {
            self.point_itself(at);
        } else if above > 0.0 {
            self.inside.set(Local::new(at[0], at[1], at[2]));
        }
    }

    fn point(&self, local: [u32; 3]) -> [u32; 3] {
        std::array::from_fn(|a| self.origin[a] + local[a])
    }

    fn number(&self, local: [u32; 3]) -> i32 {
        self.numbers[local[0] as usize][(8 * local[1] + local[2]) as usize]
    }

    /// By how much the winding number jumps on the way from one point to another, along x, y and then z.
    fn jumps(&self, from: [u32; 3], to: [u32; 3]) -> i32 {
        let (mut sum, mut at) = (0, from);
        for axis in Axis::ALL {
            let a = axis.index();
            let up = at[a] < to[a];
            while at[a] != to[a] {
                let next = if up { at[a] + 1 } else { at[a] - 1 };
                let mut start = at;
                start[a] = start[a].min(next);
                let jump = self.net.at(axis, Local::new(start[0], start[1], start[2]));
                sum += if up { jump } else { -jump };
                at[a] = next;
            }
        }
        if self.angles.patches.reversed() { -sum } else { sum }
    }

    /// Looks at one point.
    fn point_itself(&mut self, at: [u32; 3]) {
        let local = Local::new(at[0], at[1], at[2]);
        let above = f64::from(self.number(at)) + self.angles.at(&self.field, self.point(at)) - THRESHOLD;
        if above.abs() <= ERROR {
            self.ties.push(local);
        }
        if above > 0.0 {
            self.inside.set(local);
        }
    }
}

/// What becomes of the points of a brick.
struct Points<'a> {
    angles: &'a Angles<'a>,
    parts: &'a Parts,
    key: Key,
    /// The least number that is inside; none in a rough brick.
    least: Option<i32>,
    numbers: Vec<[i32; 64]>,
    inside: Plane,
}

impl Layer<(Plane, Vec<Local>)> for Points<'_> {
    fn at(&mut self, x: usize, counter: &Counter) {
        match self.least {
            Some(least) => self.inside.0[x] = counter.at_least(least),
            None => self.numbers.push(counter.values()),
        }
    }

    fn end(self) -> (Plane, Vec<Local>) {
        match self.least {
            Some(_) => (self.inside, Vec::new()),
            None => self.angles.inside(self.parts, self.key, &self.numbers),
        }
    }
}
