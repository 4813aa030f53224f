//! Extended marching cubes (Kobbelt, Botsch, Schwanecke and Seidel 2001): marching cubes, with a vertex more where there is a feature.
//!
//! A cycle whose normals differ by more than an angle has a sharp edge or a corner in it. It gets a vertex where its tangent planes meet, and
//! becomes a fan round it. Where two such cycles meet in a segment on a face between their cells, the segment is flipped: it then joins
//! both vertices, along the edge. All other cycles are those of marching cubes.
//!
//! Kobbelt's rule tells edges from corners, and that gives the true rank of the planes: on an edge, the vertex is solved for across the
//! edge only ([`feature`]). Vertices stay in their cell, unless all planes meet just beyond, as in dual contouring.
//!
//! Flips ask for no search after the fact: whoever makes the triangles beside a segment looks at both of its cells. Segments are not flipped
//! where two cycles have two of them in common, on an open face, nor if the new triangles would have no area.

use super::cell_points::{CellPoint, Kind, STEPS, place_all};
use super::cubes::edge_points;
use super::feature::{Sharpness, feature};
use super::lattice::{Lattice, place};
use super::rows::{CellRows, Seen};
use super::run::Extractor;
use super::slice::{Slice, bytes};
use super::tangents::Planes;
use super::window::Window;
use crate::error::Result;
use crate::grid::brick::Bits;
use crate::grid::cases::{CASES, Case, Mask, best_disc};
use crate::grid::{Axis, Edge, Face};
use crate::progress::Progress;
use crate::volume::Volume;
use glam::DVec3;
use std::sync::LazyLock;

/// The surface of a mask, cycle by cycle.
#[derive(Default)]
struct Cycles {
    /// Those that may have a feature: all but the rims of tunnels.
    list: Vec<Vec<Edge>>,
    /// Their triangles if they have none, three edges for each.
    flat: Vec<Vec<u8>>,
    /// The triangles of tunnels.
    tunnels: Vec<u8>,
    /// The segments on all faces.
    segments: Vec<Segment>,
    /// For each face and edge, the cycle of the list with the segment on that face that starts at that edge.
    starts: [[Option<u8>; 12]; 6],
}

/// A side of a cycle, on a face of the cell.
#[derive(Clone, Copy)]
struct Segment {
    face: Face,
    from: Edge,
    to: Edge,
    /// Its cycle in the list.
    cycle: Option<u8>,
}

impl Cycles {
    /// Whether a cycle passes through a face twice.
    fn passes_twice(&self, face: Face, cycle: u8) -> bool {
        self.starts[face.index()].iter().filter(|&&c| c == Some(cycle)).count() == 2
    }
}

/// The vertex of a feature beside a segment.
struct Vertex {
    number: u32,
    /// Where it is on the lattice.
    at: DVec3,
    /// Whether its cycle has another segment on the same face.
    passes_twice: bool,
}

static CYCLES: LazyLock<Vec<Cycles>> = LazyLock::new(|| CASES.iter().map(cycles).collect());

fn cycles(case: &Case) -> Cycles {
    let numbers =
        |triangles: &[[Edge; 3]]| triangles.as_flattened().iter().map(|e| e.index() as u8).collect::<Vec<_>>();
    let mut cycles = Cycles::default();
    let has_tunnel = case.has_tunnel();
    if has_tunnel {
        cycles.tunnels = numbers(&case.triangles);
    } else {
        let discs = case.cycles.iter().map(|cycle| numbers(&best_disc(cycle).expect("as marching cubes has it")));
        cycles.flat = discs.collect();
        cycles.list.clone_from(&case.cycles);
    }
    for (cycle, i) in case.cycles.iter().zip(0..) {
        for (&from, &to) in cycle.iter().zip(cycle.iter().cycle().skip(1)) {
            let face = from.faces().into_iter().find(|face| to.faces().contains(face)).expect("segments lie on faces");
            let cycle = (!has_tunnel).then_some(i);
            cycles.segments.push(Segment { face, from, to, cycle });
            cycles.starts[face.index()][from.index()] = cycle;
        }
    }
    cycles
}

/// Extended marching cubes over the slices of a lattice.
pub(super) struct Extended<'a, V> {
    lattice: &'a Lattice<'a, V>,
    slices: &'a [Slice],
    cycles: &'static [Cycles],
    /// For each slice, the vertices of its cycles; of no kind where there is no feature.
    features: Vec<Vec<CellPoint>>,
    /// For each slice and cycle, the number of features before it.
    ranks: Vec<Vec<u32>>,
}

/// What a thread reuses from slice to slice.
pub(super) struct Scratch {
    window: Window,
    rows: CellRows,
}

impl<'a, V: Volume> Extended<'a, V> {
    /// Finds all features: where normals differ by more than an angle, in degrees.
    pub(super) fn new(
        lattice: &'a Lattice<'a, V>,
        slices: &'a [Slice],
        angle: f64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let cycles: &'static [Cycles] = &CYCLES;
        let sharpness = Sharpness::new(angle);
        let solve = |planes: &Planes, _, is_alone| {
            let point = feature(planes, sharpness, is_alone);
            point.map_or_else(CellPoint::default, |point| CellPoint::new(point, Kind::Sharp))
        };
        let features = place_all(lattice, slices, |mask| &cycles[usize::from(mask)].list, true, solve, progress)?;
        let of_ranks = features.iter().map(|points| (points.len() * size_of::<u32>()) as u64).sum::<u64>();
        progress.hold(bytes(slices) + super::cell_points::bytes(&features) + of_ranks)?;
        let rank_all = |points: &Vec<CellPoint>| {
            let mut next = 0;
            let ranks = points.iter().map(|point| {
                let rank = next;
                next += u32::from(point.kind == Kind::Sharp);
                rank
            });
            ranks.collect()
        };
        let ranks = features.iter().map(rank_all).collect();
        Ok(Extended { lattice, slices, cycles, features, ranks })
    }

    fn cycles_of(&self, mask: Mask) -> &'static Cycles {
        &self.cycles[usize::from(mask)]
    }

    /// Calls `each` with the mixed cells of a slice in order, and the numbers of their first cycles.
    fn cells(&self, z: usize, mut each: impl FnMut([usize; 3], Seen)) {
        let slice = &self.slices[z];
        let mut masks = slice.masks().iter();
        let mut first = 0;
        for y in 0..slice.rows() {
            for word in slice.row(y) {
                for (x, &mask) in Bits(word.mixed).zip(&mut masks) {
                    each([64 * word.x as usize + x as usize, y, z], Seen { first, mask });
                    first += self.cycles_of(mask).list.len() as u32;
                }
            }
        }
    }

    /// The feature of a cycle of a cell in slice `z`.
    fn feature(&self, z: usize, cell: Seen, cycle: u8) -> Option<CellPoint> {
        let point = self.features[z][cell.first as usize + usize::from(cycle)];
        (point.kind == Kind::Sharp).then_some(point)
    }

    /// Where the surface cuts an edge of the cell at `at`, on the lattice.
    fn crossing(&self, at: [usize; 3], edge: Edge) -> DVec3 {
        let [low, _] = edge.corners();
        let start = std::array::from_fn(|a| at[a] + usize::from(low & Axis::ALL[a]));
        place(start) + self.lattice.crossing(start, edge.axis()) * DVec3::AXES[edge.axis().index()]
    }

    /// The vertex of a cycle of the cell at `at`, seen from a face.
    fn vertex(
        &self,
        at: [usize; 3],
        cell: Seen,
        (face, cycle): (Face, u8),
        first: impl Fn(usize) -> u32,
    ) -> Option<Vertex> {
        let z = at[2];
        let point = self.feature(z, cell, cycle)?;
        let rank = self.ranks[z][cell.first as usize + usize::from(cycle)];
        let passes_twice = self.cycles_of(cell.mask).passes_twice(face, cycle);
        Some(Vertex { number: first(z) + self.slices[z].edges() + rank, at: point.place(at), passes_twice })
    }

    /// The same for the cycle beyond a segment on a face that a cell shares with one before it. The cells are those of `rows`.
    fn vertex_before(
        &self,
        rows: &CellRows,
        mut at: [usize; 3],
        segment: Segment,
        first: impl Fn(usize) -> u32,
    ) -> Option<Vertex> {
        let axis = segment.face.axis();
        at[axis.index()] -= 1;
        let cell = match axis {
            Axis::X => rows.at(3, at[0]),
            Axis::Y => rows.at(2, at[0]),
            Axis::Z => rows.at(1, at[0]),
        };
        // Seen from there, it runs the other way.
        let [low, high] = segment.to.corners().map(|corner| corner.across(axis));
        let edge = Edge::between(low, high).expect("across the cell from an edge is an edge");
        let face = Face::new(axis, true);
        let cycle = self.cycles_of(cell.mask).starts[face.index()][edge.index()]?;
        self.vertex(at, cell, (face, cycle), first)
    }

    /// Appends the triangles of features beside the segments of a cell: on faces that it shares with cells before it those of both cells, and on
    /// other faces, if there is no cell beyond, its own.
    fn beside_segments(
        &self,
        at: [usize; 3],
        rows: &CellRows,
        number: impl Fn(u8) -> u32,
        first: impl Fn(usize) -> u32,
        out: &mut Vec<u32>,
    ) {
        let cell = rows.at(3, at[0]);
        // Nobody knows which cells exist: each makes its own triangles.
        let apart = self.lattice.volume.has_invalid_cells();
        for &segment in &self.cycles_of(cell.mask).segments {
            let a = segment.face.axis().index();
            let is_last = if segment.face.is_high() { at[a] + 2 == self.lattice.size[a] } else { at[a] == 0 };
            let is_alone = apart || is_last;
            if segment.face.is_high() && !is_alone {
                continue;
            }
            let here = segment.cycle.and_then(|cycle| self.vertex(at, cell, (segment.face, cycle), &first));
            let there = if is_alone { None } else { self.vertex_before(rows, at, segment, &first) };
            let [p, q] = [segment.from, segment.to].map(|edge| number(edge.index() as u8));
            match (here, there) {
                (Some(f), Some(g)) => {
                    let [at_p, at_q] = [segment.from, segment.to].map(|edge| self.crossing(at, edge));
                    let has_area = has_area([at_p, g.at, f.at]) && has_area([g.at, at_q, f.at]);
                    let (f, g, is_twin) = (f.number, g.number, f.passes_twice && g.passes_twice);
                    out.extend(if has_area && !is_twin { [p, g, f, g, q, f] } else { [p, q, f, q, p, g] });
                }
                (Some(f), None) => out.extend([p, q, f.number]),
                (None, Some(g)) => out.extend([q, p, g.number]),
                (None, None) => {}
            }
        }
    }
}

/// Whether a triangle on the lattice has an area, beyond rounding: its height is more than a step of the vertices.
fn has_area([a, b, c]: [DVec3; 3]) -> bool {
    (b - a).cross(c - a).length() > 1.0 / STEPS as f64 * (b - a).length().max((c - b).length()).max((a - c).length())
}

impl<V: Volume> Extractor for Extended<'_, V> {
    type Scratch = Scratch;

    fn scratch(&self) -> Scratch {
        let width = self.lattice.size[0];
        Scratch { window: Window::new(width), rows: CellRows::new(width) }
    }

    fn count(&self, _: &mut Scratch, z: usize) -> [u64; 2] {
        let (mut points, mut triangles) = (u64::from(self.slices[z].edges()), 0);
        self.cells(z, |_, cell| {
            let cycles = self.cycles_of(cell.mask);
            triangles += cycles.tunnels.len() / 3;
            for (cycle, i) in cycles.list.iter().zip(0..) {
                let is_sharp = self.feature(z, cell, i).is_some();
                points += u64::from(is_sharp);
                triangles += if is_sharp { cycle.len() } else { cycle.len() - 2 };
            }
        });
        [points, triangles as u64]
    }

    /// First those on edges, then the features.
    fn points(&self, _: &mut Scratch, z: usize, points: &mut Vec<DVec3>) {
        edge_points(self.lattice, &self.slices[z], z, points);
        self.cells(z, |at, cell| {
            let features = (0..self.cycles_of(cell.mask).list.len() as u8).filter_map(|i| self.feature(z, cell, i));
            points.extend(features.map(|point| self.lattice.to_model(point.place(at))));
        });
    }

    fn triangles(
        &self,
        Scratch { window, rows }: &mut Scratch,
        z: usize,
        first: impl Fn(usize) -> u32,
        out: &mut Vec<u32>,
    ) {
        let Some(next) = self.slices.get(z + 1) else { return };
        let slice = &self.slices[z];
        let before = z.checked_sub(1).map(|z| &self.slices[z]);
        rows.restart();
        let (mut row, start) = (None, out.len());
        for y in 0..slice.rows() {
            rows.advance([before, Some(slice)], y, |mask| self.cycles_of(mask).list.len() as u32);
            for word in slice.row(y).iter().filter(|word| word.mixed != 0) {
                window.go_to(&mut row, [slice, next], [first(z), first(z + 1)], y);
                for x in Bits(word.mixed) {
                    let x = 64 * word.x as usize + x as usize;
                    let here = rows.at(3, x);
                    let number = window.at(x);
                    let cycles = self.cycles_of(here.mask);
                    out.extend(cycles.tunnels.iter().map(|&edge| number(edge)));
                    for (flat, i) in cycles.flat.iter().zip(0..) {
                        if self.feature(z, here, i).is_none() {
                            out.extend(flat.iter().map(|&edge| number(edge)));
                        }
                    }
                    self.beside_segments([x, y, z], rows, number, &first, out);
                }
            }
        }
        if self.lattice.is_mirrored() {
            out[start..].as_chunks_mut::<3>().0.iter_mut().for_each(|t| t.swap(1, 2));
        }
    }
}
