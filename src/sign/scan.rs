//! Scan conversion: which edges of the finest grid do the triangles cross, and where?
//!
//! Batches of triangles are rasterised in parallel ([`raster`](crate::geom::raster)); the hits go to buckets by blocks of
//! bricks, and every block is resolved by itself: sort, count, keep one sample an edge. The order in which triangles come
//! and the number of threads make no difference, because an edge keeps what its *set* of hits says:
//!
//! - crossed, if the number of hits is odd: two different walls through one edge cancel, as they should;
//! - the sample of the middle hit;
//! - hits that coincide are noted, and decided by their surroundings ([`walls`](super::walls)).
//!
//! [`scan_oriented`] keeps all hits instead, each with the side to which its face is turned. What [`scan`] would have made of them is then
//! [`OrientedScan::parity`].
//!
//! Cost: about 20 ns a hit in all; 8 bytes a hit until its block is resolved, then 2 or 4 (see
//! [`Crossings`]). The triangles are not kept. Orientations cost 1 ns and a bit a hit.

use super::hits::{BlockCoords, Bucket, Hit, HitSorter, Ledger, brick_coords, is_repeated, sort_hits};
use super::walls;
use crate::error::Result;
use crate::geom::Frame;
use crate::geom::frame::FINE_BITS;
use crate::geom::raster::{FineTriangle, Hits, rasterise};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Key};
use crate::mesh::{SourceCounts, TriangleSource};
use crate::octree::crossings::{self, Brick, Builder, Crossings, Sample, Toggle, finest_element};
use crate::octree::hits::{EdgeHit, HitBatch, HitsBuilder, OrientedHits};
use crate::parallel::in_order;
use crate::progress::{Beside, Progress, Stage, check};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// What [`scan`] found.
#[derive(Debug)]
pub struct Scan {
    /// The crossed edges. Round a grid face their number may still be odd.
    pub crossings: Crossings,
    /// What was scanned.
    pub counts: ScanCounts,
}

/// How much was scanned and what was odd about it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ScanCounts {
    /// Polygons and triangles that the source passed on.
    pub source: SourceCounts,
    /// Triangles left out because a corner is not finite or lies outside of the root cube.
    pub skipped_triangles: u64,
    /// Those of them whose corners are finite.
    pub outside_triangles: u64,
    /// Crossings of triangles with lattice edges.
    pub hits: u64,
    /// Edges on which coincident walls, such as duplicate faces, were counted as one.
    pub merged_walls: u64,
}

/// Triangles of one task.
const TASK: usize = 2048;

/// What [`scan_oriented`] found.
#[derive(Debug)]
pub struct OrientedScan {
    /// All hits.
    pub hits: OrientedHits,
    /// What was scanned. Walls are not merged yet.
    pub counts: ScanCounts,
}

/// Finds all crossings of the source's triangles with the edges of the finest grid of `frame`.
///
/// # Errors
/// Whatever the source returns, `Cancelled`, `Memory` when `progress` says so, and when more than 2^32 edges are crossed.
pub fn scan(
    source: &mut dyn TriangleSource,
    frame: &Frame,
    with_normals: bool,
    progress: &dyn Progress,
) -> Result<Scan> {
    let (hits, mut counts) = collect(source, frame, with_normals, progress)?;
    let mut builder = Builder::new(frame.depth(), with_normals);
    let mut merges = Vec::new();
    let push = |block: Resolved| {
        crossings::check_count(builder.len() as u64 + block.offsets.len() as u64)?;
        block.for_bricks(with_normals, |key, crossed, offsets, normals| builder.push(key, crossed, offsets, normals));
        merges.extend(block.merges);
        counts.hits += block.hits;
        Ok((builder.bytes() + merges.capacity() * size_of::<Toggle>()) as u64)
    };
    resolve::<false>(hits, frame.depth(), with_normals, progress, push)?;
    let crossings = builder.finish_within(progress)?;
    merged(crossings, merges, counts, progress)
}

/// The same, but keeps all hits and their orientations.
///
/// # Errors
/// Whatever the source returns, and `Cancelled`.
pub fn scan_oriented(
    source: &mut dyn TriangleSource,
    frame: &Frame,
    with_normals: bool,
    progress: &dyn Progress,
) -> Result<OrientedScan> {
    let (hits, mut counts) = collect(source, frame, with_normals, progress)?;
    let hits = oriented(hits, frame.depth(), with_normals, progress)?;
    counts.hits = hits.len() as u64;
    Ok(OrientedScan { hits, counts })
}

/// All hits of triangles in fixed-point coordinates, without normals. `held` bytes are held by others.
///
/// # Errors
/// `Cancelled`, `Memory` when `progress` says so, and when more than 2^32 edges are crossed.
pub(super) fn scan_snapped(
    triangles: &[FineTriangle],
    depth: u32,
    held: u64,
    progress: &dyn Progress,
) -> Result<OrientedHits> {
    let progress = &Beside { progress, bytes: held };
    let ledger = Ledger::new(progress);
    let task = triangles.len().div_ceil(4 * rayon::current_num_threads()).clamp(1, TASK);
    let tasks = triangles.par_chunks(task).fold(
        || HitSorter::new(&ledger, false),
        |mut sorter, triangles| {
            triangles.iter().for_each(|triangle| rasterise(triangle, FINE_BITS - depth, &mut sorter));
            sorter
        },
    );
    let sorters: Vec<HitSorter<'_>> = tasks.collect();
    ledger.result()?;
    let collected = Collected { blocks: group_buckets(sorters.into_iter()), held: ledger.bytes() };
    oriented(collected, depth, false, progress)
}

/// All hits, resolved.
fn oriented(hits: Collected, depth: u32, with_normals: bool, progress: &dyn Progress) -> Result<OrientedHits> {
    let mut builder = HitsBuilder::new(depth, with_normals);
    let mut count = 0;
    let push = |block: Resolved| {
        count += block.hits;
        crossings::check_count(count)?;
        block.for_bricks(with_normals, |key, hit, offsets, normals| builder.push(key, hit, offsets, normals));
        builder.append(&block.oriented);
        Ok(builder.bytes() as u64)
    };
    resolve::<true>(hits, depth, with_normals, progress, push)?;
    builder.finish_within(progress)
}

impl OrientedScan {
    /// What [`scan`] makes of the same source. Cost: none if no edge has several hits; else linear.
    ///
    /// # Errors
    /// Whatever [`Progress::hold`] returns.
    pub fn parity(self, progress: &dyn Progress) -> Result<Scan> {
        let OrientedScan { hits, counts } = self;
        let (mut even, mut merges) = (Vec::new(), Vec::new());
        for brick in hits.edges().bricks().iter().filter(|_| !hits.are_single()) {
            for (axis, local, of_edge) in hits.several_in(brick) {
                let toggle = toggle_of(hits.edges(), brick, axis, local);
                if of_edge.len() % 2 == 0 {
                    even.push(toggle);
                }
                if are_doubtful(of_edge.iter().map(|hit| hit.sample.offset)) {
                    merges.push(toggle);
                }
            }
        }
        let crossings = hits.into_edges().toggled_within(even, progress)?;
        merged(crossings, merges, counts, progress)
    }
}

/// The scan of crossings of which coincident walls are counted as one where that is better.
fn merged(crossings: Crossings, merges: Vec<Toggle>, mut counts: ScanCounts, progress: &dyn Progress) -> Result<Scan> {
    progress.hold((crossings.bytes() + merges.len() * walls::BYTES) as u64)?;
    let merges = walls::worth_merging(&crossings, merges);
    counts.merged_walls = merges.len() as u64;
    Ok(Scan { crossings: crossings.toggled_within(merges, progress)?, counts })
}

/// The switch of a crossed edge.
fn toggle_of(crossings: &Crossings, brick: &Brick, axis: Axis, local: Local) -> Toggle {
    let (origin, c) = (crossings.origin(brick), local.coords());
    let edge = finest_element(crossings.depth(), std::array::from_fn(|a| origin[a] + c[a]), axis.into());
    Toggle { edge, sample: crossings.sample(edge).expect("it is crossed") }
}

/// Hits by block.
type Blocks = Vec<(BlockCoords, Vec<Bucket>)>;

/// All hits, and the bytes that they take.
struct Collected {
    blocks: Blocks,
    held: u64,
}

/// Rasterises all triangles.
fn collect(
    source: &mut dyn TriangleSource,
    frame: &Frame,
    with_normals: bool,
    progress: &dyn Progress,
) -> Result<(Collected, ScanCounts)> {
    progress.begin(Stage::Scan, source.size_hint().unwrap_or(0));
    let ledger = Ledger::new(progress);
    let sorters: Vec<_> =
        (0..rayon::current_num_threads()).map(|_| Mutex::new(HitSorter::new(&ledger, with_normals))).collect();
    let [skipped, outside] = [const { AtomicU64::new(0) }; 2];
    let counts = source.triangles(&mut |batch| {
        check(progress)?;
        let task = batch.len().div_ceil(4 * sorters.len()).clamp(1, TASK);
        batch.par_chunks(task).for_each(|triangles| {
            let thread = rayon::current_thread_index().unwrap_or(0) % sorters.len();
            let mut sorter = sorters[thread].lock().expect("rasterising does not panic");
            for triangle in triangles {
                if sorter.is_enough() {
                    return;
                }
                if !rasterise_model(triangle, frame, &mut sorter) {
                    skipped.fetch_add(1, Ordering::Relaxed);
                    outside.fetch_add(u64::from(triangle.iter().all(|p| p.is_finite())), Ordering::Relaxed);
                }
            }
        });
        ledger.result()?;
        progress.advance(batch.len() as u64);
        Ok(())
    })?;
    let held = ledger.bytes();
    let sorters = sorters.into_iter().map(|s| s.into_inner().expect("rasterising does not panic"));
    let counts = ScanCounts {
        source: counts,
        skipped_triangles: skipped.into_inner(),
        outside_triangles: outside.into_inner(),
        ..ScanCounts::default()
    };
    Ok((Collected { blocks: group_buckets(sorters), held }, counts))
}

/// How many hits are to be expected: the areas of the triangles' shadows along the three axes, in cells. Large numbers are right to a
/// part in their root; of small and slanted triangles many have none, some have several. Cost: a pass over the source, 3 ns a triangle.
///
/// # Errors
/// Whatever the source returns, and `Cancelled`.
pub fn expected_hits(source: &mut dyn TriangleSource, frame: &Frame, progress: &dyn Progress) -> Result<f64> {
    let to_cells = 1.0 / frame.cell_size();
    let mut total = 0.0;
    source.triangles(&mut |batch| {
        check(progress)?;
        for [a, b, c] in batch {
            let twice_area = ((b - a) * to_cells).cross((c - a) * to_cells).abs().element_sum();
            if twice_area.is_finite() {
                total += 0.5 * twice_area;
            }
        }
        Ok(())
    })?;
    Ok(total)
}

/// Rasterises a triangle in model coordinates; `false` if it cannot be placed in the grid.
#[inline(never)]
fn rasterise_model(triangle: &[DVec3; 3], frame: &Frame, sorter: &mut HitSorter<'_>) -> bool {
    let [Some(a), Some(b), Some(c)] = triangle.map(|p| frame.snap(p)) else {
        return false;
    };
    let snapped: FineTriangle = [a, b, c];
    rasterise(&snapped, frame.cell_shift(), sorter);
    true
}

/// The buckets of all threads, brought together by block, in Z-order of the blocks.
fn group_buckets<'a>(sorters: impl Iterator<Item = HitSorter<'a>>) -> Blocks {
    let mut all: Vec<(BlockCoords, Bucket)> = sorters.flat_map(HitSorter::into_buckets).collect();
    all.sort_by_cached_key(|(block, _)| crate::grid::key::interleave(*block));
    let mut grouped = Blocks::new();
    for (block, bucket) in all {
        match grouped.last_mut() {
            Some((last, buckets)) if *last == block => buckets.push(bucket),
            _ => grouped.push((block, vec![bucket])),
        }
    }
    grouped
}

/// The crossings of one block, or all its hit edges.
#[derive(Default)]
struct Resolved {
    bricks: Vec<(Key, [Plane; 3])>,
    offsets: Vec<u16>,
    normals: Vec<u16>,
    /// Switches that count coincident walls as one; only of crossings.
    merges: Vec<Toggle>,
    /// Only of hit edges.
    oriented: HitBatch,
    hits: u64,
    /// Bytes that the block's buckets held.
    freed: u64,
}

impl Resolved {
    /// Passes on each brick with its offsets and normals.
    fn for_bricks(&self, with_normals: bool, mut each: impl FnMut(Key, [Plane; 3], &[u16], &[u16])) {
        let mut from = 0;
        for &(key, crossed) in &self.bricks {
            let to = from + crossed.iter().map(Plane::count).sum::<u32>() as usize;
            let normals = if with_normals { &self.normals[from..to] } else { &[] };
            each(key, crossed, &self.offsets[from..to], normals);
            from = to;
        }
    }
}

/// The part of the memory of resolved hits that is found again by the allocator; the rest lies in small pieces between hits that still
/// wait. A cube at depth 11 has 163 MB of hits and 125 MB of crossings, and 210 MB are held when all is resolved.
const REUSED: [u64; 2] = [3, 8];

/// Resolves all blocks and passes them on in order; `push` returns the bytes that it holds then.
fn resolve<const ORIENTED: bool>(
    Collected { blocks, mut held }: Collected,
    depth: u32,
    with_normals: bool,
    progress: &dyn Progress,
    mut push: impl FnMut(Resolved) -> Result<u64> + Send,
) -> Result<()> {
    // Each block's hits are given back when it is resolved.
    let blocks: Vec<Mutex<_>> = blocks.into_iter().map(|block| Mutex::new(Some(block))).collect();
    let resolve = |(hits, spare): &mut (Vec<Hit>, Vec<Hit>), n: usize| {
        let block = blocks[n].lock().expect("locked once").take();
        let (block, buckets) = block.expect("each block is resolved once");
        let freed = buckets.iter().map(Bucket::bytes).sum();
        sort_hits(&buckets, hits, spare);
        drop(buckets);
        Resolved { freed, ..resolve_block::<ORIENTED>(block, hits, depth, with_normals) }
    };
    let append = |block: Resolved| {
        held -= block.freed / REUSED[1] * REUSED[0];
        let bytes = push(block)?;
        progress.hold(held + bytes)
    };
    in_order(blocks.len(), progress, Default::default, resolve, append)
}

/// Hits as close as this on one edge are one wall, in 65536ths of a cell: room for two roundings.
const COINCIDENT: u16 = 2;

/// Whether the parity of the hits on an edge, given by their offsets in order, is another one if coincident walls count once.
fn are_doubtful(mut offsets: impl Iterator<Item = u16>) -> bool {
    let Some(mut last) = offsets.next() else { return false };
    offsets.fold(false, |doubtful, offset| doubtful ^ (offset - std::mem::replace(&mut last, offset) <= COINCIDENT))
}

/// What a block comes to, from its sorted hits.
#[inline(never)]
fn resolve_block<const ORIENTED: bool>(block: BlockCoords, hits: &[Hit], depth: u32, with_normals: bool) -> Resolved {
    let mut out = Resolved { hits: hits.len() as u64, ..Resolved::default() };
    out.offsets.reserve_exact(hits.len());
    out.normals.reserve_exact(if with_normals { hits.len() } else { 0 });
    if ORIENTED {
        out.oriented.reserve(hits.len());
    }
    for of_brick in hits.chunk_by(|a, b| a.brick() == b.brick()) {
        let at = brick_coords(of_brick[0].brick());
        let at = std::array::from_fn(|a| block[a] * 8 + at[a]);
        let key = Key::cell(depth - 3, at).expect("hits lie in the root cube");
        let mut crossed = [Plane::EMPTY; 3];
        if is_repeated(of_brick) {
            for edge in of_brick.chunk_by(|a, b| a.slot() == b.slot()) {
                if ORIENTED {
                    orient_edge(edge, with_normals, &mut crossed, &mut out);
                } else {
                    resolve_edge(edge, depth, at, with_normals, &mut crossed, &mut out);
                }
            }
        } else {
            of_brick.iter().for_each(|hit| crossed[hit.axis()].set(Local::from_index(hit.local())));
            out.offsets.extend(of_brick.iter().map(|hit| Sample::new(hit.offset(), 0).offset));
            if with_normals {
                out.normals.extend(of_brick.iter().map(|hit| hit.normal().0));
            }
            if ORIENTED {
                of_brick.iter().for_each(|hit| out.oriented.push(hit.leaves()));
            }
        }
        out.bricks.push((key, crossed));
    }
    out
}

/// The middle one of an edge's hits: for an odd number of walls the surface that is left when pairs cancel from both ends.
fn middle(hits: &[Hit]) -> Hit {
    hits[(hits.len() - 1) / 2]
}

impl Resolved {
    /// Adds the sample of a hit, and its edge to those of the brick.
    fn push_sample(&mut self, hit: Hit, with_normals: bool, crossed: &mut [Plane; 3]) {
        let sample = Sample::new(hit.offset(), hit.normal().0);
        crossed[hit.axis()].set(Local::from_index(hit.local()));
        self.offsets.push(sample.offset);
        if with_normals {
            self.normals.push(sample.normal);
        }
    }
}

/// Adds an edge of the brick at `brick` (in bricks) with all its hits, by parity.
fn resolve_edge(
    hits: &[Hit],
    depth: u32,
    brick: [u32; 3],
    with_normals: bool,
    crossed: &mut [Plane; 3],
    out: &mut Resolved,
) {
    let middle = middle(hits);
    if hits.len() % 2 == 1 {
        out.push_sample(middle, with_normals, crossed);
    }
    if are_doubtful(hits.iter().map(|hit| hit.offset())) {
        let c = Local::from_index(middle.local()).coords();
        let point = std::array::from_fn(|a| brick[a] * 8 + c[a]);
        let edge = finest_element(depth, point, Axis::ALL[middle.axis()].into());
        out.merges.push(Toggle { edge, sample: Sample::new(middle.offset(), middle.normal().0) });
    }
}

/// Adds an edge with all its hits as they are.
fn orient_edge(hits: &[Hit], with_normals: bool, crossed: &mut [Plane; 3], out: &mut Resolved) {
    let middle = middle(hits);
    out.push_sample(middle, with_normals, crossed);
    if hits.len() == 1 {
        return out.oriented.push(middle.leaves());
    }
    let of_edge = hits
        .iter()
        .map(|hit| EdgeHit { sample: Sample { offset: hit.offset(), normal: hit.normal().0 }, leaves: hit.leaves() });
    out.oriented.push_several(Axis::ALL[middle.axis()], Local::from_index(middle.local()), of_edge);
}
