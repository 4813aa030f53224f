//! One map entry for each finest cell: the way of TCAD's octree, with a hash table or an ordered map.
//!
//! Triangles are rasterised along lattice lines as zmend does it; a hit makes the four cells round its edge. What concerns more than one cell
//! is looked up.

use super::sign::{CORNERS_OF, Counts, FACES};
use std::collections::BTreeMap;
use zmend::Result;
use zmend::geom::Frame;
use zmend::geom::raster::{FineTriangle, Hits, rasterise};
use zmend::glam::DVec3;
use zmend::grid::cases::CASES;
use zmend::grid::{Axis, Edge, Key};
use zmend::mesh::{MeshSink, MeshSizes, TriangleSource};
use zmend::octree::crossings::Sample;

/// A map from cells to records.
pub(crate) trait CellMap<T> {
    fn get(&self, cell: Key) -> Option<&T>;
    fn get_mut(&mut self, cell: Key) -> Option<&mut T>;
    /// The record of a cell, made if there is none.
    fn made(&mut self, cell: Key) -> &mut T;
    /// All cells in the order of the map.
    fn keys(&self) -> Vec<Key>;
}

/// A hash table with the hash of zmend's own trees.
pub(crate) type HashCells<T> = hashbrown::HashMap<Key, T, ahash::RandomState>;
/// An ordered map.
pub(crate) type TreeCells<T> = BTreeMap<Key, T>;

/// An empty hash table.
pub(crate) fn hash_cells<T>() -> HashCells<T> {
    hashbrown::HashMap::with_hasher(ahash::RandomState::with_seeds(1, 2, 3, 4))
}

impl<T: Default> CellMap<T> for HashCells<T> {
    fn get(&self, cell: Key) -> Option<&T> {
        self.get(&cell)
    }

    fn get_mut(&mut self, cell: Key) -> Option<&mut T> {
        self.get_mut(&cell)
    }

    fn made(&mut self, cell: Key) -> &mut T {
        self.entry(cell).or_default()
    }

    fn keys(&self) -> Vec<Key> {
        self.keys().copied().collect()
    }
}

impl<T: Default> CellMap<T> for TreeCells<T> {
    fn get(&self, cell: Key) -> Option<&T> {
        self.get(&cell)
    }

    fn get_mut(&mut self, cell: Key) -> Option<&mut T> {
        self.get_mut(&cell)
    }

    fn made(&mut self, cell: Key) -> &mut T {
        self.entry(cell).or_default()
    }

    fn keys(&self) -> Vec<Key> {
        self.keys().copied().collect()
    }
}

/// What is known of a surface cell: 16 bytes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Record {
    /// Bit e: the surface crosses edge e. At first only the three edges at the least corner.
    edges: u16,
    /// Bit c: corner c is inside.
    corners: u8,
    /// Where the surface crosses the three edges at the least corner.
    offsets: [u16; 3],
    /// The number of the first vertex.
    vertex: u32,
}

/// The edges that start at a cell's least corner.
const OWN: u16 = 0x111;

/// A cell some steps of 0 or 1 from another, by its place.
#[inline]
fn cell(depth: u32, at: [u32; 3]) -> Option<Key> {
    Key::cell(depth, at)
}

struct Marks<'m, M> {
    map: &'m mut M,
    depth: u32,
}

impl<M: CellMap<Record>> Hits for Marks<'_, M> {
    fn plane(&mut self, _: Axis, _: [f64; 3]) {}

    fn hit(&mut self, axis: Axis, at: [u32; 3], offset: u16) {
        let [u, v] = axis.others().map(Axis::index);
        for (du, dv) in [(1, 1), (1, 0), (0, 1), (0, 0)] {
            let mut beside = at;
            beside[u] -= du;
            beside[v] -= dv;
            let record = self.map.made(cell(self.depth, beside).expect("the model is inside of the root"));
            if (du, dv) == (0, 0) {
                record.edges ^= 1 << (4 * axis.index());
                record.offsets[axis.index()] = offset;
            }
        }
    }
}

/// Marks the edges that the triangles of a source cross.
///
/// # Errors
/// Those of the source.
pub(crate) fn scan<M: CellMap<Record>>(map: &mut M, source: &mut dyn TriangleSource, frame: &Frame) -> Result<u64> {
    let mut marks = Marks { map, depth: frame.depth() };
    let counts = source.triangles(&mut |batch| {
        for &[a, b, c] in batch {
            if let (Some(a), Some(b), Some(c)) = (frame.snap(a), frame.snap(b), frame.snap(c)) {
                let triangle: FineTriangle = [a, b, c];
                rasterise(&triangle, frame.cell_shift(), &mut marks);
            }
        }
        Ok(())
    })?;
    Ok(counts.triangles)
}

/// The place of a cell, in finest cells.
fn place(depth: u32, key: Key) -> [u32; 3] {
    key.min_corner().map(|c| c >> (19 - depth))
}

/// Calls `each` with every edge of a cell and the record of the cell at whose least corner it starts.
#[inline]
fn owners<M: CellMap<Record>>(map: &M, depth: u32, at: [u32; 3], mut each: impl FnMut(Edge, Option<&Record>)) {
    // By the corner at which an edge starts: each cell is looked up once.
    let records: [Option<&Record>; 7] = std::array::from_fn(|corner| {
        let high = [corner >> 2, corner >> 1 & 1, corner & 1];
        let beside = [0, 1, 2].map(|a: usize| at[a] + high[a] as u32);
        cell(depth, beside).and_then(|key| map.get(key))
    });
    for edge in Edge::ALL {
        each(edge, records[edge.corners()[0].index()]);
    }
}

/// Spreads crossings to all cells, and gives corners signs, line after line along x; returns the cells in that order.
pub(crate) fn sign<M: CellMap<Record>>(map: &mut M, depth: u32) -> (Vec<Key>, Counts) {
    let mut keys = map.keys();
    keys.sort_unstable_by_key(|&key| {
        let [x, y, z] = key.min_corner();
        u64::from(y) << 40 | u64::from(z) << 20 | u64::from(x)
    });
    let mut counts = Counts::default();
    let mut line = [u32::MAX; 2];
    let mut inside = false;
    for &key in &keys {
        let at = place(depth, key);
        if line != [at[1], at[2]] {
            line = [at[1], at[2]];
            inside = false;
        }
        let mut edges = 0u16;
        owners(map, depth, at, |edge, record| {
            let crossed = record.is_some_and(|record| record.edges >> (4 * edge.axis().index()) & 1 == 1);
            edges |= u16::from(crossed) << edge.index();
        });
        let corners = CORNERS_OF[usize::from(edges)] ^ if inside { 0xff } else { 0 };
        let record = map.get_mut(key).expect("a key of this map");
        // The bits of the edges at the least corner stay as they are.
        record.edges = edges;
        record.corners = corners;
        record.vertex = counts.crossings as u32;
        counts.crossings += u64::from((edges & OWN).count_ones());
        counts.triangles += CASES[usize::from(corners)].triangles.len() as u64;
        counts.mixed += u64::from(edges != 0);
        counts.odd += u64::from(FACES.iter().any(|face| (u64::from(edges) & face).count_ones() % 2 == 1));
        inside ^= edges & 1 == 1;
    }
    (keys, counts)
}

/// Passes the surface to `sink`.
///
/// # Errors
/// Those of the sink.
pub(crate) fn marching_cubes<M: CellMap<Record>>(
    map: &M,
    keys: &[Key],
    counts: &Counts,
    frame: &Frame,
    sink: &mut dyn MeshSink,
) -> Result<MeshSizes> {
    const BATCH: usize = 1 << 15;
    let (depth, cases) = (frame.depth(), &*CASES);
    let sizes = MeshSizes { points: counts.crossings, faces: counts.triangles, corners: 3 * counts.triangles };
    sink.begin(sizes)?;
    let mut points = Vec::with_capacity(BATCH + 3);
    for &key in keys {
        let Some(record) = map.get(key) else { continue };
        for axis in (0..3).filter(|axis| record.edges >> (4 * axis) & 1 == 1) {
            let start = frame.to_model(DVec3::from(place(depth, key).map(f64::from)));
            let offset = Sample::new(record.offsets[axis], 0).position();
            points.push(start + DVec3::AXES[axis] * (frame.cell_size() * offset));
        }
        if points.len() >= BATCH {
            sink.points(&points)?;
            points.clear();
        }
    }
    sink.points(&points)?;
    let mut corners = Vec::with_capacity(BATCH + 16);
    for &key in keys {
        let Some(mask) = map.get(key).map(|record| record.corners).filter(|&mask| mask != 0 && mask != 0xff) else {
            continue;
        };
        let mut numbers = [0; 12];
        owners(map, depth, place(depth, key), |edge, record| {
            let before = |record: &Record| record.edges & OWN & ((1 << (4 * edge.axis().index())) - 1);
            numbers[edge.index()] = record.map_or(0, |record| record.vertex + before(record).count_ones());
        });
        corners.extend(cases[usize::from(mask)].triangles.as_flattened().iter().map(|edge| numbers[edge.index()]));
        if corners.len() >= BATCH {
            sink.faces(3, &corners)?;
            corners.clear();
        }
    }
    sink.faces(3, &corners)?;
    Ok(sizes)
}

/// Repairs a closed mesh by parity, as [`super::repair`] does.
///
/// # Errors
/// Those of source and sink.
pub(crate) fn repair<M: CellMap<Record>>(
    mut map: M,
    source: &mut dyn TriangleSource,
    frame: &Frame,
    sink: &mut dyn MeshSink,
) -> Result<Counts> {
    scan(&mut map, source, frame)?;
    let (keys, counts) = sign(&mut map, frame.depth());
    marching_cubes(&map, &keys, &counts, frame, sink)?;
    Ok(counts)
}
