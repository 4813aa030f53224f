//! Where a surface crosses the edges of the finest grid: three bit planes a brick, and two small numbers a crossing.
//!
//! A brick is the record of the cell three levels above the finest. Its planes say which of its 3 x 512 lattice edges (those
//! that start at its 512 points) are crossed; position and normal of each crossing stand in arrays beside, in the order
//! brick by brick along the Z-order curve, x-edges before y- before z-edges, then by position. So a crossing needs no key and
//! no pointer: its place is the number of crossings before it, the brick's first plus the ranks of its bits.
//!
//! # Invariants ([`Crossings::validate`])
//!
//! - Bricks are sorted by key, distinct, and listed in the index with their place.
//! - `first` of each brick is the number of crossings of all bricks before it.
//! - A crossed edge has four cells around it, and each of them belongs to a brick of the list (possibly a brick without
//!   crossings of its own). So whoever looks for cells with a change of sign, or for odd faces, need only look into bricks.
//!
//! # Cost
//!
//! 232 bytes a brick, some 30 for its index entry, 2 bytes a crossing for the offset and 2 more if there are normals. A
//! surface crosses some 65 to 75 edges of a brick: 6 bytes a crossing without normals, 8 with.

use super::LinearOctree;
use super::segments::Segments;
use crate::error::{Error, Result};
use crate::grid::brick::{Local, Plane};
use crate::grid::key::SIDE;
use crate::grid::{Axis, Direction, Extent, Key};
use crate::progress::{Progress, Silent, check};
use rayon::prelude::*;
use std::ops::Range;

/// The crossed edges of one brick.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Brick {
    /// The brick as a cell, three levels above the finest.
    pub key: Key,
    /// The crossed edges along x, y, z, each at its start.
    pub crossed: [Plane; 3],
    /// Number of crossings in all bricks before this one.
    pub first: u32,
    /// Places of the bricks at +x, +y, +z, +x+y, +x+z, +y+z, or [`NO_BRICK`]. Keys would tell as well; every stage asks, and six hash
    /// probes a brick and stage took a tenth of the whole repair.
    plus: [u32; 6],
}

/// Stands for a brick that is not there.
const NO_BRICK: u32 = u32::MAX;

/// The directions of [`Brick::plus`].
const PLUS: [[i32; 3]; 6] = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]];

/// A brick that nothing crosses, standing in for all that are not there.
static NOTHING: Brick = Brick { key: Key::ROOT, crossed: [Plane::EMPTY; 3], first: 0, plus: [NO_BRICK; 6] };

impl Brick {
    /// Number of crossings on its edges.
    pub fn count(&self) -> u32 {
        self.crossed.iter().map(Plane::count).sum()
    }

    /// The place in the arrays of the crossing on the edge along `axis` at `local`, which must be crossed.
    pub fn place(&self, axis: Axis, local: Local) -> usize {
        let before: u32 = self.crossed[..axis.index()].iter().map(Plane::count).sum();
        (self.first + before + self.crossed[axis.index()].rank(local)) as usize
    }
}

/// Position and normal of a crossing on its edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Sample {
    /// Distance from the start of the edge in 65536ths of its length.
    pub offset: u16,
    /// The unoriented normal, see [`NormalCode`](crate::geom::normal::NormalCode); 0 where normals are not kept.
    pub normal: u16,
}

/// Samples keep this distance from both ends of their edge, in 65536ths: 1/1024 of a cell. Crossings of different edges then
/// never coincide in space, so a mesh written without shared vertices (STL) can be welded again.
pub const OFFSET_MARGIN: u16 = 64;

impl Sample {
    /// A sample so far from the start of its edge, in 65536ths, but not nearer to its ends than [`OFFSET_MARGIN`].
    #[inline]
    pub fn new(offset: u16, normal: u16) -> Self {
        Sample { offset: offset.clamp(OFFSET_MARGIN, u16::MAX - OFFSET_MARGIN), normal }
    }

    /// The position along the edge, in cells: above 0, below 1.
    pub fn position(self) -> f64 {
        position(self.offset)
    }
}

/// The position along the edge that an offset stands for, in cells.
#[inline]
pub fn position(offset: u16) -> f64 {
    (f64::from(offset) + 0.5) * (1.0 / 65536.0)
}

/// A crossing to be switched: off where there is one, on where there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Toggle {
    /// A finest edge.
    pub edge: Key,
    /// What to store if the edge is switched on.
    pub sample: Sample,
}

/// A list of bricks.
pub type Bricks = Segments<Brick, 8>;
/// A list of small numbers.
pub type Codes = Segments<u16, 15>;

/// All crossed edges of a finest grid with 2^depth cells a side.
#[derive(Debug, Clone)]
pub struct Crossings {
    depth: u32,
    index: LinearOctree<u32>,
    bricks: Bricks,
    offsets: Codes,
    /// As many as offsets, or none at all.
    normals: Codes,
    with_normals: bool,
}

/// The finest element at lattice point `at` (in cells) with the given extent: the one that starts there.
///
/// # Panics
/// When that is outside of the root cube.
pub fn finest_element(depth: u32, at: [u32; 3], extent: Extent) -> Key {
    let side = SIDE >> depth;
    let centre = Axis::ALL.map(|a| at[a.index()] * side + if extent.contains(a) { side / 2 } else { 0 });
    Key::element(centre, extent).expect("elements of the finest grid lie in the root cube")
}

/// The lattice point, in cells, at which a finest element starts.
pub fn lattice_point(depth: u32, element: Key) -> [u32; 3] {
    let finest = SIDE.ilog2() - depth;
    element.min_corner().map(|c| c >> finest)
}

/// The brick that owns a finest element, which is the one that holds its start, and the element's position in it. No brick owns what
/// starts on the root's high faces.
pub fn owner(depth: u32, element: Key) -> (Option<Key>, Local) {
    let start = element.min_code();
    let in_root = start >> (3 * SIDE.ilog2()) == 0;
    let order = start >> (3 * (SIDE.ilog2() - depth));
    (in_root.then(|| Key::around(start, depth - 3)), Local::from_order(order))
}

/// The finest element that a brick owns at a position: the inverse of [`owner`]. Any cell three levels above the finest will do.
pub fn owned(depth: u32, brick: Key, local: Local, extent: Extent) -> Key {
    Key::starting_at(brick.min_code() | local.order() << (3 * (SIDE.ilog2() - depth)), extent, depth)
}

/// Whether so many crossings can be numbered: places in the arrays have 32 bits.
///
/// # Errors
/// When there are 2^32 or more.
pub fn check_count(crossings: u64) -> Result<()> {
    if u32::try_from(crossings).is_ok() {
        return Ok(());
    }
    let problem = format!("the surface crosses {crossings} edges of the grid or more; {} can be numbered", u32::MAX);
    Err(Error::setting("depth", problem, "take a smaller depth"))
}

/// The same edges are crossed, at the same places. The index is not compared: it follows from the bricks.
impl PartialEq for Crossings {
    fn eq(&self, other: &Self) -> bool {
        let Crossings { depth, index: _, bricks, offsets, normals, with_normals } = self;
        (*depth, *with_normals) == (other.depth, other.with_normals)
            && *bricks == other.bricks
            && *offsets == other.offsets
            && *normals == other.normals
    }
}

impl Crossings {
    /// log2 of the number of cells a side.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Whether normals are kept.
    pub fn with_normals(&self) -> bool {
        self.with_normals
    }

    /// All bricks, sorted by key.
    pub fn bricks(&self) -> &Bricks {
        &self.bricks
    }

    /// Number of crossed edges.
    pub fn len(&self) -> usize {
        self.offsets.len()
    }

    /// Whether no edge is crossed.
    pub fn is_empty(&self) -> bool {
        self.offsets.is_empty()
    }

    /// Offsets of all crossings, in 65536ths of a cell, in the order of the bricks.
    pub fn offsets(&self) -> &Codes {
        &self.offsets
    }

    /// Codes of the normals of all crossings; empty where normals are not kept.
    pub fn normals(&self) -> &Codes {
        &self.normals
    }

    /// Bricks, offsets and normals, taken apart.
    pub(super) fn into_parts(self) -> (Bricks, Codes, Codes) {
        (self.bricks, self.offsets, self.normals)
    }

    /// The places in the arrays of the crossings of some bricks.
    pub fn places(&self, bricks: Range<usize>) -> Range<usize> {
        let first = |i| if i < self.bricks.len() { self.bricks[i].first as usize } else { self.len() };
        first(bricks.start)..first(bricks.end)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.bricks.allocated_bytes()
            + self.offsets.allocated_bytes()
            + self.normals.allocated_bytes()
            + self.index.allocated_bytes()
    }

    /// The place of a brick in the list.
    pub fn find(&self, brick: Key) -> Option<usize> {
        self.index.get(brick).map(|&i| i as usize)
    }

    /// The brick with this key, or one without crossings.
    pub fn brick_or_nothing(&self, brick: Option<Key>) -> &Brick {
        brick.and_then(|key| self.find(key)).map_or(&NOTHING, |i| &self.bricks[i])
    }

    /// The bricks at +x, +y, +z, +x+y, +x+z, +y+z of a brick; where there is none, one without crossings.
    #[inline]
    pub fn plus(&self, brick: &Brick) -> [&Brick; 6] {
        brick.plus.map(|place| if place == NO_BRICK { &NOTHING } else { &self.bricks[place as usize] })
    }

    /// The places of the bricks at +x, +y, +z of a brick.
    #[inline]
    pub fn plus_places(&self, brick: &Brick) -> [Option<usize>; 3] {
        let [x, y, z, ..] = brick.plus;
        [x, y, z].map(|place| (place != NO_BRICK).then_some(place as usize))
    }

    /// The lattice point at which a brick starts, in cells.
    pub fn origin(&self, brick: &Brick) -> [u32; 3] {
        lattice_point(self.depth, brick.key)
    }

    /// The brick that owns a finest element, and the element's position in it.
    fn home(&self, element: Key) -> (&Brick, Local) {
        let (key, local) = owner(self.depth, element);
        (self.brick_or_nothing(key), local)
    }

    /// Whether a finest edge is crossed.
    pub fn is_crossed(&self, edge: Key) -> bool {
        self.sample(edge).is_some()
    }

    /// The sample of a finest edge, if it is crossed. Cost: one hash probe and a few population counts.
    pub fn sample(&self, edge: Key) -> Option<Sample> {
        let axis = edge.dir().axes().next().expect("an edge has an axis");
        let (brick, local) = self.home(edge);
        brick.crossed[axis.index()].get(local).then(|| self.sample_at(brick.place(axis, local)))
    }

    /// The sample at a place of the arrays.
    pub(crate) fn sample_at(&self, place: usize) -> Sample {
        Sample { offset: self.offsets[place], normal: if self.with_normals { self.normals[place] } else { 0 } }
    }

    /// The finest faces of which an odd number of edges is crossed, sorted: the boundary of the dual surface (Ju 2004). None
    /// means that signs can be given to the lattice points. Cost: some 150 ns a brick, in parallel.
    pub fn odd_faces(&self) -> Vec<Key> {
        let bricks = (0..self.bricks.len()).into_par_iter();
        let mut odd: Vec<Key> = bricks.flat_map_iter(|i| self.odd_faces_of(&self.bricks[i])).collect();
        odd.par_sort_unstable();
        odd
    }

    /// How many [odd faces](Self::odd_faces) there are, without a list of them.
    pub fn count_odd_faces(&self) -> u64 {
        let of_brick = |i| self.odd_planes(&self.bricks[i]).iter().map(|plane| u64::from(plane.count())).sum::<u64>();
        (0..self.bricks.len()).into_par_iter().map(of_brick).sum()
    }

    /// The odd faces of a brick, by their normals.
    fn odd_planes(&self, brick: &Brick) -> [Plane; 3] {
        let [x, y, z] = &brick.crossed;
        let [nx, ny, nz, ..] = self.plus(brick).map(|b| &b.crossed);
        [
            *y ^ y.at_plus_z(&nz[1]) ^ *z ^ z.at_plus_y(&ny[2]),
            *x ^ x.at_plus_z(&nz[0]) ^ *z ^ z.at_plus_x(&nx[2]),
            *x ^ x.at_plus_y(&ny[0]) ^ *y ^ y.at_plus_x(&nx[1]),
        ]
    }

    fn odd_faces_of(&self, brick: &Brick) -> Vec<Key> {
        let planes = self.odd_planes(brick);
        let mut odd = Vec::new();
        for (axis, plane) in Axis::ALL.into_iter().zip(&planes).filter(|(_, plane)| !plane.is_empty()) {
            let origin = self.origin(brick);
            odd.extend(plane.iter().map(|local| {
                let c = local.coords();
                let at = std::array::from_fn(|a| origin[a] + c[a]);
                finest_element(self.depth, at, Extent::CELL - axis)
            }));
        }
        odd
    }

    /// Switches edges. An edge that is listed several times is switched as often; of the samples offered for an edge that is on
    /// at last, the least is taken. Cost: linear in crossings and toggles if there is any toggle.
    ///
    /// # Panics
    /// Beyond 2^32 crossings.
    #[must_use]
    pub fn toggled(self, toggles: Vec<Toggle>) -> Crossings {
        self.toggled_within(toggles, &Silent).expect("fewer than 2^32 crossings, as documented")
    }

    /// The same within the memory that `progress` grants. The old crossings are given back while the new ones are made.
    ///
    /// # Errors
    /// When there would be 2^32 crossings or more, `Cancelled`, and whatever [`Progress::hold`] returns.
    pub fn toggled_within(self, mut toggles: Vec<Toggle>, progress: &dyn Progress) -> Result<Crossings> {
        if toggles.is_empty() {
            return Ok(self);
        }
        check_count(self.len() as u64 + toggles.len() as u64)?;
        toggles.par_sort_unstable();
        keep_odd(&mut toggles);
        let toggle_bytes = toggles.capacity() * size_of::<Toggle>();
        let Crossings { depth, index, bricks, offsets, normals, with_normals } = self;
        drop(index);
        // Edge keys are sorted by their centres: those of a brick come together, and bricks come in order.
        let home = |toggle: &Toggle| {
            let at = lattice_point(depth, toggle.edge);
            Key::cell(depth - 3, at.map(|c| c >> 3)).expect("edges lie in bricks")
        };
        let mut pending = toggles.chunk_by(|a, b| home(a) == home(b)).map(|list| (home(&list[0]), list)).peekable();
        let empty = |key| Brick { key, ..NOTHING.clone() };
        let mut builder = Builder::new(depth, with_normals);
        let (all_bricks, all_crossings) = (bricks.len(), offsets.len());
        let (mut offsets, mut normals) = (offsets.into_reader(), normals.into_reader());
        let (mut of_offsets, mut of_normals) = (Vec::new(), Vec::new());
        for (i, brick) in bricks.into_iter().enumerate() {
            if i % 256 == 0 {
                check(progress)?;
                let left = all_crossings - brick.first as usize;
                let old = (all_bricks - i) * size_of::<Brick>() + left * if with_normals { 4 } else { 2 };
                progress.hold((old + toggle_bytes + builder.bytes()) as u64)?;
            }
            while let Some((key, list)) = pending.next_if(|(key, _)| *key < brick.key) {
                builder.push_toggled(&empty(key), [&[], &[]], list);
            }
            offsets.read(brick.count() as usize, &mut of_offsets);
            normals.read(of_offsets.len(), &mut of_normals);
            match pending.next_if(|(key, _)| *key == brick.key) {
                Some((_, list)) => builder.push_toggled(&brick, [&of_offsets, &of_normals], list),
                None => builder.push(brick.key, brick.crossed, &of_offsets, &of_normals),
            }
        }
        for (key, list) in pending {
            builder.push_toggled(&empty(key), [&[], &[]], list);
        }
        drop(toggles);
        builder.finish_within(progress)
    }

    /// The first broken invariant, in words. Cost: linear, a few hash probes a brick.
    ///
    /// # Errors
    /// Describes the violation and names its key.
    pub fn validate(&self) -> Result<(), String> {
        if self.index.len() != self.bricks.len() {
            return Err(format!("{} bricks, but {} in the index", self.bricks.len(), self.index.len()));
        }
        let mut first = 0;
        for (i, brick) in self.bricks.iter().enumerate() {
            if i > 0 && self.bricks[i - 1].key >= brick.key {
                return Err(format!("brick {} is not after the one before it", brick.key));
            }
            if brick.key.level() != Some(self.depth - 3) || self.find(brick.key) != Some(i) {
                return Err(format!("brick {} has the wrong level or index entry", brick.key));
            }
            if brick.first != first {
                return Err(format!("brick {} starts at {}, not {first}", brick.key, brick.first));
            }
            first += brick.count();
            for (steps, place) in PLUS.into_iter().zip(brick.plus) {
                let there = brick.key.toward(toward(steps)).and_then(|key| self.find(key));
                if there != (place != NO_BRICK).then_some(place as usize) {
                    return Err(format!("brick {} has a wrong neighbour at {steps:?}", brick.key));
                }
            }
            for apron in apron(brick) {
                if brick.key.toward(apron).and_then(|key| self.find(key)).is_none() {
                    return Err(format!(
                        "brick {} has a crossed edge whose cells lie in a brick that is missing",
                        brick.key
                    ));
                }
            }
        }
        if first as usize != self.len() || (self.with_normals && self.normals.len() != self.len()) {
            return Err(format!("{first} edges are crossed, but there are {} samples", self.len()));
        }
        match self.offsets.iter().find(|&&o| !(OFFSET_MARGIN..=u16::MAX - OFFSET_MARGIN).contains(&o)) {
            Some(offset) => Err(format!("a sample lies {offset}/65536 from the start of its edge")),
            None => Ok(()),
        }
    }
}

/// Of sorted switches, keeps one of each edge that is switched an odd number of times: the least.
fn keep_odd(toggles: &mut Vec<Toggle>) {
    let mut kept = 0;
    let mut i = 0;
    while i < toggles.len() {
        let same = toggles[i..].iter().take_while(|t| t.edge == toggles[i].edge).count();
        if same % 2 == 1 {
            toggles[kept] = toggles[i];
            kept += 1;
        }
        i += same;
    }
    toggles.truncate(kept);
}

/// The direction with these steps, not all 0.
pub(crate) const fn toward(steps: [i32; 3]) -> Direction {
    Direction::from_steps(steps).expect("steps of -1, 0 or 1, not all 0")
}

/// The directions of the neighbouring bricks that own a cell beside a crossed edge of `brick`.
fn apron(brick: &Brick) -> impl Iterator<Item = Direction> {
    let [x, y, z] = brick.crossed;
    let needed = [
        ([-1, 0, 0], (y | z).touches_min_x()),
        ([0, -1, 0], (x | z).touches_min_y()),
        ([0, 0, -1], (x | y).touches_min_z()),
        ([-1, -1, 0], z.touches_min_xy()),
        ([-1, 0, -1], y.touches_min_xz()),
        ([0, -1, -1], x.touches_min_yz()),
    ];
    needed.into_iter().filter_map(|(steps, needed)| needed.then_some(toward(steps)))
}

/// The most bytes of the index for each brick: the number of slots is a power of two, and room is made for a quarter more bricks.
const INDEX_BYTES: usize = 52;

/// Puts [`Crossings`] together from bricks in ascending order of keys.
#[derive(Debug)]
pub struct Builder {
    made: Crossings,
}

impl Builder {
    /// Starts without bricks.
    pub fn new(depth: u32, with_normals: bool) -> Self {
        let (bricks, offsets, normals) = Default::default();
        Builder { made: Crossings { depth, index: LinearOctree::new(), bricks, offsets, normals, with_normals } }
    }

    /// Appends a brick with one offset (and normal, if they are kept) for each set bit. Bricks without any are left out.
    ///
    /// # Panics
    /// When the numbers do not agree, or beyond 2^32 crossings.
    pub fn push(&mut self, key: Key, crossed: [Plane; 3], offsets: &[u16], normals: &[u16]) {
        let first = u32::try_from(self.made.len()).expect("fewer than 2^32 crossings");
        let brick = Brick { key, crossed, first, plus: [NO_BRICK; 6] };
        assert_eq!(brick.count() as usize, offsets.len(), "one offset a crossing");
        if offsets.is_empty() {
            return;
        }
        debug_assert!(
            offsets.iter().all(|o| (OFFSET_MARGIN..=u16::MAX - OFFSET_MARGIN).contains(o)),
            "see Sample::new"
        );
        self.made.offsets.extend_from_slice(offsets);
        if self.made.with_normals {
            assert_eq!(normals.len(), offsets.len(), "one normal a crossing");
            self.made.normals.extend_from_slice(normals);
        }
        self.made.bricks.push(brick);
    }

    /// Number of crossings so far.
    pub fn len(&self) -> usize {
        self.made.len()
    }

    /// Whether there are no crossings yet.
    pub fn is_empty(&self) -> bool {
        self.made.is_empty()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.made.bytes()
    }

    /// Appends a brick whose samples are `offsets` and `normals`, with some edges switched.
    fn push_toggled(&mut self, brick: &Brick, [offsets, normals]: [&[u16]; 2], toggles: &[Toggle]) {
        let mut crossed = brick.crossed;
        let mut samples = Vec::new();
        for axis in Axis::ALL {
            for local in crossed[axis.index()].iter() {
                let place = samples.len();
                let sample = Sample { offset: offsets[place], normal: normals.get(place).copied().unwrap_or(0) };
                samples.push((axis.index(), local, sample));
            }
        }
        for toggle in toggles {
            let axis = toggle.edge.dir().axes().next().expect("an edge has an axis").index();
            let [x, y, z] = lattice_point(self.made.depth, toggle.edge);
            let local = Local::new(x, y, z);
            crossed[axis].toggle(local);
            if crossed[axis].get(local) {
                samples.push((axis, local, toggle.sample));
            }
        }
        samples.retain(|&(axis, local, _)| crossed[axis].get(local));
        samples.sort_unstable();
        let offsets: Vec<u16> = samples.iter().map(|s| s.2.offset).collect();
        let normals: Vec<u16> = samples.iter().map(|s| s.2.normal).collect();
        self.push(brick.key, crossed, &offsets, &normals);
    }

    /// Adds the bricks without crossings that the invariant asks for, the index and the neighbours.
    pub fn finish(self) -> Crossings {
        self.finish_within(&Silent).expect("all that is asked for may be held")
    }

    /// The same within the memory that `progress` grants.
    ///
    /// # Errors
    /// Whatever [`Progress::hold`] returns.
    pub fn finish_within(self, progress: &dyn Progress) -> Result<Crossings> {
        let mut made = self.made;
        progress.hold((made.bytes() + made.bricks.len() * INDEX_BYTES) as u64)?;
        made.index.reserve(made.bricks.len() + made.bricks.len() / 4);
        for (place, brick) in (0..).zip(made.bricks.iter()) {
            made.index.insert(brick.key, place);
        }
        let bricks = (0..made.bricks.len()).into_par_iter();
        let mut missing: Vec<Key> = bricks
            .flat_map_iter(|i| {
                let brick = &made.bricks[i];
                let needed =
                    apron(brick).map(|d| brick.key.toward(d).expect("crossed edges lie off the root's boundary"));
                needed.filter(|key| made.index.get(*key).is_none()).collect::<Vec<_>>()
            })
            .collect();
        missing.par_sort_unstable();
        missing.dedup();
        // With the neighbours, which are gathered before they are entered.
        let neighbours = (made.bricks.len() + missing.len()) * size_of::<[u32; 6]>();
        progress.hold((made.bytes() + missing.len() * (size_of::<Brick>() + INDEX_BYTES) + neighbours) as u64)?;
        made.insert_empty(missing);
        let bricks = (0..made.bricks.len()).into_par_iter();
        let plus: Vec<[u32; 6]> = bricks
            .map(|i| {
                let key = made.bricks[i].key;
                let place = |steps| key.toward(toward(steps)).and_then(|key| made.index.get(key).copied());
                PLUS.map(|steps| place(steps).unwrap_or(NO_BRICK))
            })
            .collect();
        plus.into_iter().enumerate().for_each(|(i, plus)| made.bricks[i].plus = plus);
        Ok(made)
    }
}

impl Crossings {
    /// Merges sorted bricks without crossings into the list, in place and from the back.
    fn insert_empty(&mut self, mut missing: Vec<Key>) {
        let mut old = self.bricks.len();
        (0..missing.len()).for_each(|_| self.bricks.push(NOTHING.clone()));
        let mut following = self.offsets.len() as u32;
        for place in (0..self.bricks.len()).rev() {
            if missing.is_empty() {
                break;
            }
            let brick = match missing.last() {
                Some(&key) if old == 0 || self.bricks[old - 1].key < key => {
                    missing.pop();
                    Brick { key, first: following, ..NOTHING.clone() }
                }
                _ => {
                    old -= 1;
                    self.bricks[old].clone()
                }
            };
            following = brick.first;
            self.index.insert(brick.key, place as u32);
            self.bricks[place] = brick;
        }
    }
}
