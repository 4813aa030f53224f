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

use super::hits::{BlockCoords, Bucket, Hit, HitSorter, brick_coords, sort_hits};
use super::walls;
use crate::error::Result;
use crate::geom::Frame;
use crate::geom::raster::{FineTriangle, rasterise};
use crate::grid::brick::{Local, Plane};
use crate::grid::{Axis, Key};
use crate::mesh::{SourceCounts, TriangleSource};
use crate::octree::crossings::{Brick, Builder, Crossings, Sample, Toggle, finest_element};
use crate::octree::hits::{EdgeHit, HitBatch, HitsBuilder, OrientedHits};
use crate::parallel::in_order;
use crate::progress::{Progress, Stage, check};
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
/// Whatever the source returns, and `Cancelled`.
pub fn scan(
    source: &mut dyn TriangleSource,
    frame: &Frame,
    with_normals: bool,
    progress: &dyn Progress,
) -> Result<Scan> {
    let (blocks, mut counts) = collect(source, frame, with_normals, progress)?;
    let mut builder = Builder::new(frame.depth(), with_normals);
    let mut merges = Vec::new();
    let push = |block: Resolved| {
        block.for_bricks(with_normals, |key, crossed, offsets, normals| builder.push(key, crossed, offsets, normals));
        merges.extend(block.merges);
        counts.hits += block.hits;
    };
    resolve::<false>(blocks, frame.depth(), with_normals, progress, push)?;
    let crossings = builder.finish();
    let merges = walls::worth_merging(&crossings, merges);
    counts.merged_walls = merges.len() as u64;
    Ok(Scan { crossings: crossings.toggled(merges), counts })
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
    let (blocks, mut counts) = collect(source, frame, with_normals, progress)?;
    let mut builder = HitsBuilder::new(frame.depth(), with_normals);
    let push = |block: Resolved| {
        block.for_bricks(with_normals, |key, hit, offsets, normals| builder.push(key, hit, offsets, normals));
        builder.append(&block.oriented);
        counts.hits += block.hits;
    };
    resolve::<true>(blocks, frame.depth(), with_normals, progress, push)?;
    Ok(OrientedScan { hits: builder.finish(), counts })
}

impl OrientedScan {
    /// What [`scan`] makes of the same source. Cost: none if no edge has several hits; else linear.
    pub fn parity(self) -> Scan {
        let OrientedScan { hits, mut counts } = self;
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
        let crossings = hits.into_edges().toggled(even);
        let merges = walls::worth_merging(&crossings, merges);
        counts.merged_walls = merges.len() as u64;
        Scan { crossings: crossings.toggled(merges), counts }
    }
}

/// The switch of a crossed edge.
fn toggle_of(crossings: &Crossings, brick: &Brick, axis: Axis, local: Local) -> Toggle {
    let (origin, c) = (crossings.origin(brick), local.coords());
    let edge = finest_element(crossings.depth(), std::array::from_fn(|a| origin[a] + c[a]), axis.into());
    Toggle { edge, sample: crossings.sample(edge).expect("it is crossed") }
}

/// Hits by block.
type Blocks = Vec<(BlockCoords, Vec<Bucket>)>;

/// Rasterises all triangles.
fn collect(
    source: &mut dyn TriangleSource,
    frame: &Frame,
    with_normals: bool,
    progress: &dyn Progress,
) -> Result<(Blocks, ScanCounts)> {
    progress.begin(Stage::Scan, source.size_hint().unwrap_or(0));
    let sorters: Vec<_> = (0..rayon::current_num_threads()).map(|_| Mutex::new(HitSorter::new(with_normals))).collect();
    let skipped = AtomicU64::new(0);
    let counts = source.triangles(&mut |batch| {
        check(progress)?;
        let task = batch.len().div_ceil(4 * sorters.len()).clamp(1, TASK);
        batch.par_chunks(task).for_each(|triangles| {
            let thread = rayon::current_thread_index().unwrap_or(0) % sorters.len();
            let mut sorter = sorters[thread].lock().expect("rasterising does not panic");
            let done = triangles.iter().filter(|t| rasterise_model(t, frame, &mut sorter)).count();
            skipped.fetch_add((triangles.len() - done) as u64, Ordering::Relaxed);
        });
        progress.advance(batch.len() as u64);
        Ok(())
    })?;
    let sorters = sorters.into_iter().map(|s| s.into_inner().expect("rasterising does not panic"));
    let counts = ScanCounts { source: counts, skipped_triangles: skipped.into_inner(), ..ScanCounts::default() };
    Ok((group_buckets(sorters), counts))
}

/// Rasterises a triangle in model coordinates; `false` if it cannot be placed in the grid.
#[inline(never)]
fn rasterise_model(triangle: &[DVec3; 3], frame: &Frame, sorter: &mut HitSorter) -> bool {
    let [Some(a), Some(b), Some(c)] = triangle.map(|p| frame.snap(p)) else {
        return false;
    };
    let snapped: FineTriangle = [a, b, c];
    rasterise(&snapped, frame.cell_shift(), sorter);
    true
}

/// The buckets of all threads, brought together by block, in Z-order of the blocks.
fn group_buckets(sorters: impl Iterator<Item = HitSorter>) -> Blocks {
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

/// Resolves all blocks and passes them on in order.
fn resolve<const ORIENTED: bool>(
    blocks: Blocks,
    depth: u32,
    with_normals: bool,
    progress: &dyn Progress,
    mut push: impl FnMut(Resolved) + Send,
) -> Result<()> {
    // Each block's hits are given back when it is resolved.
    let blocks: Vec<Mutex<_>> = blocks.into_iter().map(|block| Mutex::new(Some(block))).collect();
    let resolve = |(hits, spare): &mut (Vec<Hit>, Vec<Hit>), n: usize| {
        let block = blocks[n].lock().expect("locked once").take();
        let (block, buckets) = block.expect("each block is resolved once");
        hits.clear();
        buckets.into_iter().for_each(|bucket| bucket.drain_into(hits));
        let repeated = sort_hits(hits, spare);
        resolve_block::<ORIENTED>(block, hits, repeated, depth, with_normals)
    };
    let append = |block| {
        push(block);
        Ok(())
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

/// What a block comes to, from its sorted hits; `repeated` says whether some edge has several.
#[inline(never)]
fn resolve_block<const ORIENTED: bool>(
    block: BlockCoords,
    hits: &[Hit],
    repeated: bool,
    depth: u32,
    with_normals: bool,
) -> Resolved {
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
        if repeated {
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
