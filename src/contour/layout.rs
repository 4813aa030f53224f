//! Which cells have vertices of a dual surface, and which numbers.
//!
//! Vertices are numbered brick by brick, in the order of the cells: a cell's number is the brick's first plus the rank of its bit
//! in the plane of mixed cells, corrected for the [knots](Knot) before it: cells with several vertices or none, of which there are few and
//! which are listed.

use crate::error::{Error, Result};
use crate::grid::brick::{Bits, Local, Plane};
use crate::grid::cases::{CASES, Mask};
use crate::grid::{Axis, Corner, Key};
use crate::octree::SignedOctree;
use crate::octree::cells::CellEdges;
use crate::octree::crossings::toward;
use rayon::prelude::*;

/// What is done about vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    /// Knots have the vertices of their case. Vertices of creases may leave their cell.
    Usual,
    /// Knots have no vertex: something else stands for the surface in them. Vertices stay in their cells.
    Disjoint,
}

/// A mixed cell whose vertices are not the ordinary single one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Knot {
    pub(super) cell: Local,
    pub(super) mask: Mask,
}

/// Which cells have vertices, and which numbers.
pub(super) struct Layout<'a> {
    pub(super) octree: &'a SignedOctree,
    pub(super) style: Style,
    bricks: Vec<CellBrick>,
    knots: Vec<Knot>,
    /// Number of vertices.
    pub(super) vertices: u64,
}

struct CellBrick {
    mixed: Plane,
    /// Number of the first vertex.
    first: u32,
    /// Where the brick's knots begin.
    knots: u32,
}

/// The most bytes that a [`Layout`] takes for each brick while it is made, and after that.
pub(super) const BRICK_BYTES: usize = size_of::<(Plane, Vec<Knot>)>() + size_of::<CellBrick>();

impl<'a> Layout<'a> {
    pub(super) fn new(octree: &'a SignedOctree, style: Style) -> Result<Self> {
        let found: Vec<(Plane, Vec<Knot>)> = (0..octree.crossings().bricks().len())
            .into_par_iter()
            .map(|i| {
                let edges = CellEdges::new(octree, i);
                let (mixed, mut knots) = (edges.mixed(), Vec::new());
                edges.for_knotty(|cell, mask| {
                    if CASES[usize::from(mask)].sheets.vertices > 1 {
                        knots.push(Knot { cell, mask });
                    }
                });
                (mixed, knots)
            })
            .collect();
        let mut layout =
            Layout { octree, style, bricks: Vec::with_capacity(found.len()), knots: Vec::new(), vertices: 0 };
        for (mixed, knots) in found {
            let first = layout.vertices as u32;
            let extra: i64 = knots.iter().map(|&k| i64::from(layout.extra_vertices(k))).sum();
            layout.vertices += (i64::from(mixed.count()) + extra) as u64;
            if u32::try_from(layout.vertices).is_err() {
                let problem =
                    format!("the surface has {} vertices or more; {} can be numbered", layout.vertices, u32::MAX);
                return Err(Error::setting("depth", problem, "take a smaller depth"));
            }
            layout.bricks.push(CellBrick { mixed, first, knots: layout.knots.len() as u32 });
            layout.knots.extend(knots);
        }
        Ok(layout)
    }

    /// The knots of a brick.
    pub(super) fn knots_of(&self, brick: usize) -> &[Knot] {
        let end = self.bricks.get(brick + 1).map_or(self.knots.len(), |b| b.knots as usize);
        &self.knots[self.bricks[brick].knots as usize..end]
    }

    /// The number of the first vertex of a brick, or of all vertices beyond the last.
    pub(super) fn first_of(&self, brick: usize) -> u64 {
        self.bricks.get(brick).map_or(self.vertices, |b| u64::from(b.first))
    }

    /// The mixed cells of a brick.
    pub(super) fn mixed(&self, brick: usize) -> Plane {
        self.bricks[brick].mixed
    }

    /// Whether the cell at `at` is mixed. Cost: a hash probe.
    pub(super) fn is_mixed(&self, at: [u32; 3]) -> bool {
        let crossings = self.octree.crossings();
        let brick = Key::cell(crossings.depth() - 3, at.map(|c| c >> 3)).and_then(|key| crossings.find(key));
        brick.is_some_and(|brick| self.bricks[brick].mixed.get(Local::new(at[0], at[1], at[2])))
    }

    /// Vertices beyond the first.
    fn extra_vertices(&self, knot: Knot) -> i32 {
        match self.style {
            Style::Usual => i32::from(CASES[usize::from(knot.mask)].sheets.vertices) - 1,
            Style::Disjoint => -1,
        }
    }

    /// Calls `each` with the mixed cells of a brick that `select` leaves of each word, their first vertices and their masks (0 if
    /// ordinary).
    #[inline]
    pub(super) fn for_cells(
        &self,
        brick: usize,
        select: impl Fn(usize) -> u64,
        mut each: impl FnMut(Local, u32, Mask),
    ) {
        let CellBrick { mixed, first, .. } = &self.bricks[brick];
        let mut before = *first;
        let mut knots = self.knots_of(brick).iter().peekable();
        for (x, &word) in mixed.0.iter().enumerate() {
            let selected = select(x);
            let mut counted = 0;
            for b in Bits(word & selected) {
                let cell = Local::from_index(x as u32 * 64 + b);
                while let Some(&knot) = knots.next_if(|k| k.cell < cell) {
                    before = before.wrapping_add_signed(self.extra_vertices(knot));
                }
                // Counting up is cheaper than counting bits, but only all bits can be counted up.
                let below = if selected == !0 { counted } else { (word & ((1 << b) - 1)).count_ones() };
                let mask = knots.peek().filter(|k| k.cell == cell).map_or(0, |k| k.mask);
                each(cell, before.wrapping_add(below), mask);
                counted += 1;
            }
            before = before.wrapping_add(if selected == !0 { counted } else { word.count_ones() });
        }
    }

    /// The brick of the mixed cell at `at`, its first vertex and its mask (0 if ordinary). Cost: a hash probe and a few counts.
    pub(super) fn find(&self, at: [u32; 3]) -> (usize, u32, Mask) {
        let brick = self.brick_of(at);
        let (first, mask) = self.find_in(brick, at);
        (brick, first, mask)
    }

    /// The brick of the mixed cell at `at`. Cost: a hash probe.
    pub(super) fn brick_of(&self, at: [u32; 3]) -> usize {
        let crossings = self.octree.crossings();
        let key = Key::cell(crossings.depth() - 3, at.map(|c| c >> 3)).expect("cells lie in the root cube");
        crossings.find(key).expect("mixed cells belong to listed bricks")
    }

    /// The first vertex of the mixed cell at `at`, which lies in a brick, and its mask (0 if ordinary). Cost: a few counts.
    pub(super) fn find_in(&self, brick: usize, at: [u32; 3]) -> (u32, Mask) {
        let cell = Local::new(at[0], at[1], at[2]);
        let knots = self.knots_of(brick);
        let extra: i32 = knots.iter().filter(|k| k.cell < cell).map(|&k| self.extra_vertices(k)).sum();
        let CellBrick { mixed, first, .. } = &self.bricks[brick];
        let mask = knots.iter().find(|k| k.cell == cell).map_or(0, |k| k.mask);
        ((first + mixed.rank(cell)).wrapping_add_signed(extra), mask)
    }

    /// The vertex of the cell at `at` to which its inside corner `corner` belongs.
    pub(super) fn vertex(&self, at: [u32; 3], corner: Corner) -> u32 {
        let (_, first, mask) = self.find(at);
        if mask == 0 { first } else { first + slot(mask, corner) }
    }
}

/// Which of the cell's vertices an inside corner belongs to.
#[inline]
pub(super) fn slot(mask: Mask, corner: Corner) -> u32 {
    u32::from(CASES[usize::from(mask)].sheets.vertex[corner.index()])
}

/// Cells a side of the table: a brick and the layer before it.
const CELL_SIDE: usize = 9;
/// Entries before that of a cell for one step along each axis.
const STEP: [usize; 3] = [CELL_SIDE * CELL_SIDE, CELL_SIDE, 1];

/// An entry for each mixed cell of a brick and of those before it in x, y and z. Entries of other cells are stale.
pub(super) struct CellTable<T>(Box<[T; CELL_SIDE.pow(3)]>);

/// A mixed cell as a brick beside it sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// The brick that it belongs to, and where it is in that.
    pub(super) brick: usize,
    pub(super) cell: Local,
    /// Where it is from the brick that sees it: -1 ..= 7 along each axis.
    pub(super) at: [i32; 3],
    /// Its first vertex.
    pub(super) first: u32,
    /// Its corners that are inside if it is a knot; 0 for others.
    pub(super) mask: Mask,
}

impl<T: Copy> CellTable<T> {
    pub(super) fn new(empty: T) -> Self {
        CellTable(Box::new([empty; CELL_SIDE.pow(3)]))
    }

    /// Makes an entry for each mixed cell round the edges of a brick.
    #[inline]
    pub(super) fn fill(&mut self, layout: &Layout<'_>, brick: usize, mut entry: impl FnMut(Seen) -> T) {
        const LAST_Y: u64 = 0xff << 56;
        const LAST_Z: u64 = 0x8080_8080_8080_8080;
        let crossings = layout.octree.crossings();
        for (steps, bits) in [
            ([0, 0, 0], !0),
            ([-1, 0, 0], !0),
            ([0, -1, 0], LAST_Y),
            ([0, 0, -1], LAST_Z),
            ([-1, -1, 0], LAST_Y),
            ([-1, 0, -1], LAST_Z),
            ([0, -1, -1], LAST_Y & LAST_Z),
        ] {
            let found = if steps == [0; 3] {
                Some(brick)
            } else {
                crossings.bricks()[brick].key.toward(toward(steps)).and_then(|key| crossings.find(key))
            };
            let Some(found) = found else { continue };
            let select = |x: usize| if steps[0] == 0 || x == 7 { bits } else { 0 };
            layout.for_cells(found, select, |cell, first, mask| {
                let c = cell.coords();
                let at: [i32; 3] = std::array::from_fn(|a| c[a] as i32 + 8 * steps[a]);
                // 1 is the brick's own first cell; a neighbour's last cell comes to stand at 0.
                let [x, y, z] = at.map(|c| (c + 1) as usize);
                self.0[(x * CELL_SIDE + y) * CELL_SIDE + z] = entry(Seen { brick: found, cell, at, first, mask });
            });
        }
    }

    /// The entries of the four cells round an edge of the brick, counter-clockwise seen from its end: see [`starts`].
    #[inline]
    pub(super) fn round(&self, axis: Axis, edge: Local) -> [T; 4] {
        let [x, y, z] = edge.coords().map(|c| c as usize + 1);
        let at = (x * CELL_SIDE + y) * CELL_SIDE + z;
        let [su, sv] = axis.others().map(|a| STEP[a.index()]);
        [su + sv, sv, 0, su].map(|step| self.0[at - step])
    }
}

/// The corners at which the four cells round an edge have its start, in the order of [`CellTable::round`].
#[inline]
pub(super) fn starts(axis: Axis) -> [Corner; 4] {
    let [u, v] = axis.others();
    [Corner::MIN | u | v, Corner::MIN | v, Corner::MIN, Corner::MIN | u]
}
