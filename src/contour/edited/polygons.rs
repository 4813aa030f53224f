//! The polygons round the vertices of touched cells, and which ones of the unedited surface they replace.

use super::around::Around;
use super::shapes::{RINGS, Ring};
use super::touched::Touched;
use crate::contour::layout::Layout;
use crate::error::Result;
use crate::grid::Edge;
use crate::grid::cases::{CASES, is_crossed};
use crate::parallel::in_order;
use crate::progress::Progress;

/// A set of numbers below some limit that tells how many of its members are below a number.
#[derive(Debug)]
pub(super) struct Ranks {
    /// 64 bits, and the number of members before them.
    words: Vec<(u64, u32)>,
}

impl Ranks {
    fn new(limit: u64, members: &[u32]) -> Self {
        let mut words = vec![(0, 0); (limit / 64 + 1) as usize];
        members.iter().for_each(|&n| words[n as usize / 64].0 |= 1u64 << (n % 64));
        let mut before = 0;
        for word in &mut words {
            word.1 = before;
            before += word.0.count_ones();
        }
        Ranks { words }
    }

    #[inline]
    pub(super) fn contains(&self, n: u32) -> bool {
        self.words[n as usize / 64].0 >> (n % 64) & 1 == 1
    }

    /// Number of members below `n`.
    #[inline]
    pub(super) fn rank(&self, n: u32) -> u32 {
        let (word, before) = self.words[n as usize / 64];
        before + (word & ((1 << (n % 64)) - 1)).count_ones()
    }
}

/// What takes the place of the unedited surface in touched cells. Vertices have the numbers of the whole edited surface: those of
/// untouched cells as before, but closing up where others drop out, and then those of touched cells.
pub(super) struct Patch<'a> {
    pub(super) touched: &'a Touched,
    pub(super) layout: &'a Layout<'a>,
    /// The vertices of the unedited surface that drop out, sorted.
    pub(super) dropped: Vec<u32>,
    pub(super) ranks: Ranks,
    /// Number of vertices of untouched cells.
    pub(super) kept: u32,
}

/// Polygons by their number of corners. Each quadrilateral begins with a corner of the diagonal by which it must be cut.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    pub(super) quads: Vec<[u32; 4]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Polygons {
    /// Appends a polygon, unless it collapses.
    #[inline]
    fn push(&mut self, quad: [u32; 4]) {
        let differs: [bool; 4] = std::array::from_fn(|i| quad[i] != quad[(i + 3) % 4]);
        match differs.iter().filter(|&&differs| differs).count() {
            4 => self.quads.push(quad),
            3 => {
                let mut corners = quad.into_iter().zip(differs).filter(|corner| corner.1);
                self.triangles.push(std::array::from_fn(|_| corners.next().expect("three of them").0));
            }
            _ => {}
        }
    }

    pub(super) fn append(&mut self, mut other: Polygons) {
        self.quads.append(&mut other.quads);
        self.triangles.append(&mut other.triangles);
    }

    /// The sides of all polygons in order, each as the ends in the direction in which it is run through.
    pub(super) fn sides(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        let of_quads = self.quads.iter().flat_map(|q| (0..4).map(move |i| [q[i], q[(i + 1) % 4]]));
        of_quads.chain(self.triangles.iter().flat_map(|t| (0..3).map(move |i| [t[i], t[(i + 1) % 3]])))
    }
}

impl<'a> Patch<'a> {
    /// Cost: linear in the touched cells and, with 2 bits each, the vertices of the whole surface.
    pub(super) fn new(touched: &'a Touched, layout: &'a Layout<'a>) -> Self {
        let mut dropped = Vec::new();
        for brick in &touched.bricks {
            let Some(place) = brick.place else { continue };
            layout.for_cells(
                place as usize,
                |x| brick.plane.0[x],
                |_, first, mask| {
                    let vertices = if mask == 0 { 1 } else { CASES[usize::from(mask)].sheets.vertices };
                    dropped.extend(first..first + u32::from(vertices));
                },
            );
        }
        dropped.sort_unstable();
        let ranks = Ranks::new(layout.vertices, &dropped);
        let kept = layout.vertices as u32 - dropped.len() as u32;
        assert!(kept.checked_add(touched.vertices).is_some(), "fewer than 2^32 vertices");
        Patch { touched, layout, dropped, ranks, kept }
    }

    /// Number of quadrilaterals of the unedited surface that have a vertex in a touched cell: one for each crossed edge of those cells.
    pub(super) fn dropped_quads(&self, progress: &dyn Progress) -> Result<u64> {
        let mut sum = 0;
        let (count, piece) = self.touched.pieces();
        let crossed = |around: &mut Around<'_>, n| piece(n).map(|brick| self.crossed_first(around, brick)).sum::<u64>();
        let add = |edges| {
            sum += edges;
            Ok(())
        };
        in_order(count, progress, || Around::new(self), crossed, add)?;
        Ok(sum)
    }

    /// Number of crossed edges round the touched cells of a brick that no touched cell before has.
    fn crossed_first(&self, around: &mut Around<'_>, brick: usize) -> u64 {
        around.fill(brick);
        let mut sum = 0;
        for (i, at) in self.touched.bricks[brick].cells() {
            let signs = self.touched.cells[i].signs;
            if matches!(signs, 0 | 255) {
                continue;
            }
            let before = around.before(around.index(at));
            let own = |edge: &Edge| before & RINGS[3 * edge.corners()[0].index() + edge.axis().index()].cells == 0;
            sum += Edge::ALL.into_iter().filter(|&e| is_crossed(signs, e)).filter(own).count() as u64;
        }
        sum
    }

    /// Makes all polygons with a vertex in a touched cell and passes them on in pieces, in the order of the first such cell.
    pub(super) fn polygons(
        &self,
        progress: &dyn Progress,
        take: impl FnMut(Polygons) -> Result<()> + Send,
    ) -> Result<()> {
        let (count, piece) = self.touched.pieces();
        let make = |around: &mut Around<'_>, n| {
            let mut polygons = Polygons::default();
            piece(n).for_each(|brick| self.polygons_of(around, brick, &mut polygons));
            polygons
        };
        in_order(count, progress, || Around::new(self), make, take)
    }

    /// The polygons of the touched cells of a brick that no touched cell before has.
    fn polygons_of(&self, around: &mut Around<'_>, brick: usize, polygons: &mut Polygons) {
        around.fill(brick);
        let all: &[Ring] = &RINGS;
        for (i, at) in self.touched.bricks[brick].cells() {
            let here = around.index(at);
            let before = around.before(here);
            for &ring in &self.touched.shape(self.touched.cells[i]).rings {
                let Ring { octants, cells } = &all[usize::from(ring)];
                if before & cells == 0 {
                    let vertex = |(step, corner)| around.vertex(here.wrapping_add_signed(step as isize), corner);
                    polygons.push(octants.map(vertex));
                }
            }
        }
    }
}
