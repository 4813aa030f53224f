//! Inside and outside at every lattice point: what repair, topology and contouring meet in.

use super::cells::CellEdges;
use super::crossings::{Brick, Builder, Crossings, Sample, finest_element, lattice_point, position, toward};
use crate::error::Result;
use crate::grid::brick::{Bits, Local, Plane};
use crate::grid::{Axis, Extent, Key};
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Silent};
use rayon::prelude::*;
use std::ops::Range;

/// Bytes a brick that [`SignedOctree::from_crossings`] takes beyond the crossings: the signs, and the bricks by row.
pub const SIGN_BYTES: usize = size_of::<Plane>() + size_of::<(u64, u32)>();

/// Bytes for each brick that is given to [`SignedOctree::from_signs`], the octree that is made of it included, but for crossings.
pub const GIVEN_BYTES: usize =
    size_of::<(Key, Plane)>() + 2 * size_of::<(Key, u32)>() + size_of::<Brick>() + SIGN_BYTES;

/// How many bricks at least, if there are so many, tell along which axis the [volume](SignedOctree::volume) is measured.
const TELLING: usize = 1024;

/// Crossed edges together with the signs of the lattice points.
///
/// Signs are stored for the points of bricks; everywhere else they are uniform up to the next brick and follow from it.
#[derive(Debug, Clone, PartialEq)]
pub struct SignedOctree {
    crossings: Crossings,
    /// For each brick, the points that are inside.
    inside: Vec<Plane>,
}

impl SignedOctree {
    /// Puts crossings and signs together; `inside` has one plane a brick.
    ///
    /// # Panics
    /// When there are not as many planes as bricks.
    pub fn new(crossings: Crossings, inside: Vec<Plane>) -> Self {
        assert_eq!(crossings.bricks().len(), inside.len(), "one plane a brick");
        SignedOctree { crossings, inside }
    }

    /// Gives each lattice point of each brick its sign: that of the parity of the crossings on the way to it along x from outside of the
    /// root. Within a brick that is a prefix parity over eight words, 64 lines at once; the carry goes to the next brick of the row.
    /// Where bricks of a row are missing, nothing is crossed, and the carry is the same for all 64 lines.
    ///
    /// `crossings` must have no odd faces ([`Crossings::odd_faces`]): then the way along x is as good as any other.
    ///
    /// Cost: some 50 ns a brick, most of it for putting the bricks into rows.
    pub fn from_crossings(crossings: Crossings) -> Self {
        debug_assert!(crossings.odd_faces().is_empty(), "closed before signs are counted");
        let bricks = crossings.bricks();
        // Bricks by row: y and z, then x, all in bricks.
        let mut rows: Vec<(u64, u32)> = (0..bricks.len())
            .into_par_iter()
            .map(|i| {
                let [x, y, z] = crossings.origin(&bricks[i]).map(|c| u64::from(c >> 3));
                ((y << 16 | z) << 16 | x, i as u32)
            })
            .collect();
        rows.par_sort_unstable();
        // Pieces end where rows do; few of them wait at a time.
        let is_in_row = |i: usize| i > 0 && i < rows.len() && rows[i - 1].0 >> 16 == rows[i].0 >> 16;
        let row_end = |from: usize| (from..rows.len()).find(|&i| !is_in_row(i)).unwrap_or(rows.len());
        let (count, piece) = pieces(rows.len(), 1024);
        let signs = |(): &mut (), n| {
            let Range { start, end } = piece(n);
            let mut carry = 0;
            let of_rows = (row_end(start)..row_end(end)).map(|i| {
                if !is_in_row(i) {
                    carry = 0;
                }
                let place = rows[i].1 as usize;
                let (inside, next) = bricks[place].crossed[0].prefix_parity_x(carry);
                carry = next;
                (place, inside)
            });
            of_rows.collect()
        };
        let mut inside = vec![Plane::EMPTY; bricks.len()];
        let enter = |signs: Vec<(usize, Plane)>| {
            signs.into_iter().for_each(|(place, plane)| inside[place] = plane);
            Ok(())
        };
        in_order(count, &Silent, || (), signs, enter).expect("nothing fails or is cancelled");
        SignedOctree::new(crossings, inside)
    }

    /// The octree of given signs: `signs` lists bricks, sorted by key, with their inside points. Edges whose ends differ are crossed;
    /// for each of them in turn (x-edges before y- before z-edges, then by position) `samples` pushes a sample, given the place of the
    /// brick in `signs` and its crossed edges.
    ///
    /// Every brick that owns a crossed edge must be listed; of the others, `uniform` says whether they lie inside. Listed bricks that turn
    /// out to be needless are dropped.
    ///
    /// Cost: three hash probes and some 100 ns a brick beside `samples`, in parallel.
    ///
    /// # Panics
    /// When a lattice point with a coordinate 0 is inside, when bricks are not in order or `samples` pushes too few or too many.
    pub fn from_signs(
        depth: u32,
        with_normals: bool,
        signs: &[(Key, Plane)],
        uniform: impl Fn(Key) -> bool + Sync,
        samples: impl Fn(usize, &[Plane; 3], &mut Vec<Sample>) + Sync,
    ) -> Self {
        let octree = Self::try_from_signs(depth, with_normals, signs, uniform, samples, &Silent);
        octree.expect("nothing fails or is cancelled")
    }

    /// As [`from_signs`](Self::from_signs), until `progress` says that it is cancelled.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(crate) fn try_from_signs(
        depth: u32,
        with_normals: bool,
        signs: &[(Key, Plane)],
        uniform: impl Fn(Key) -> bool + Sync,
        samples: impl Fn(usize, &[Plane; 3], &mut Vec<Sample>) + Sync,
        progress: &dyn Progress,
    ) -> Result<Self> {
        assert!(signs.is_sorted_by(|a, b| a.0 < b.0), "bricks are sorted");
        let mut places = super::LinearOctree::with_capacity(signs.len());
        for (place, &(key, _)) in (0u32..).zip(signs) {
            places.insert(key, place);
        }
        let crossed = |(key, inside): (Key, Plane)| {
            let touches = [Plane::touches_min_x, Plane::touches_min_y, Plane::touches_min_z];
            for (c, touches) in key.min_corner().into_iter().zip(touches) {
                assert!(c != 0 || !touches(&inside), "points on the root's boundary are outside");
            }
            let beside = |steps| match key.toward(toward(steps)) {
                Some(next) => match places.get(next) {
                    Some(&i) => signs[i as usize].1,
                    None if uniform(next) => Plane::FULL,
                    None => Plane::EMPTY,
                },
                None => Plane::EMPTY,
            };
            [
                inside ^ inside.at_plus_x(&beside([1, 0, 0])),
                inside ^ inside.at_plus_y(&beside([0, 1, 0])),
                inside ^ inside.at_plus_z(&beside([0, 0, 1])),
            ]
        };
        let mut builder = Builder::new(depth, with_normals);
        let (count, piece) = pieces(signs.len(), 64);
        let make = |(): &mut (), n| {
            let bricks = piece(n).map(|i| {
                let crossed = crossed(signs[i]);
                let mut list = Vec::new();
                samples(i, &crossed, &mut list);
                (signs[i].0, crossed, list)
            });
            bricks.collect()
        };
        let append = |bricks: Vec<_>| {
            for (key, crossed, samples) in bricks {
                let samples: Vec<Sample> = samples;
                let offsets: Vec<u16> = samples.iter().map(|s| s.offset).collect();
                let normals: Vec<u16> = samples.iter().filter(|_| with_normals).map(|s| s.normal).collect();
                builder.push(key, crossed, &offsets, &normals);
            }
            Ok(())
        };
        in_order(count, progress, || (), make, append)?;
        Ok(SignedOctree::from_crossings(builder.finish()))
    }

    /// An octree of which nothing is inside.
    pub fn empty(depth: u32) -> Self {
        SignedOctree { crossings: Builder::new(depth, false).finish(), inside: Vec::new() }
    }

    /// Crossings and signs, as [`new`](Self::new) takes them.
    pub fn into_parts(self) -> (Crossings, Vec<Plane>) {
        (self.crossings, self.inside)
    }

    /// The crossed edges.
    pub fn crossings(&self) -> &Crossings {
        &self.crossings
    }

    /// For each brick, its points that are inside.
    pub fn inside(&self) -> &[Plane] {
        &self.inside
    }

    /// The corners of the cells of brick `i` that are inside, by corner number: the sign changes along a crossed edge, so all follow from
    /// the brick's points. Cost: some 30 ns.
    pub fn corners(&self, i: usize) -> [Plane; 8] {
        let brick = &self.crossings.bricks()[i];
        let [x, y, z] = &brick.crossed;
        let [px, py, pz, pxy, ..] = self.crossings.plus(brick).map(|b| &b.crossed);
        let c0 = self.inside[i];
        let (c1, c2, c4) = (c0 ^ *z, c0 ^ *y, c0 ^ *x);
        let z_at_x = z.at_plus_x(&px[2]);
        let c3 = c2 ^ z.at_plus_y(&py[2]);
        let (c5, c6) = (c4 ^ z_at_x, c4 ^ y.at_plus_x(&px[1]));
        let c7 = c6 ^ z_at_x.at_plus_y(&py[2].at_plus_x(&pxy[2]));
        debug_assert_eq!(c3, c1 ^ y.at_plus_z(&pz[1]), "no face is odd");
        [c0, c1, c2, c3, c4, c5, c6, c7]
    }

    /// The elements of brick `i` all corners of which are inside, by extent: the part of the closed cubical complex that the brick owns.
    /// Cost: some 40 ns.
    pub fn elements(&self, i: usize) -> [Plane; 8] {
        // An element stretches from its start along some axes: its corners are the subsets of its extent.
        let mut planes = self.corners(i);
        for bit in [1, 2, 4] {
            for extent in (0..8).filter(|extent| extent & bit != 0) {
                planes[extent] &= planes[extent ^ bit];
            }
        }
        planes
    }

    /// The cells of brick `i` with corners of both signs.
    ///
    /// # Panics
    /// When there is no brick `i`.
    pub fn mixed_cells(&self, i: usize) -> Plane {
        CellEdges::new(self, i).mixed()
    }

    /// Whether lattice point `at` (in cells, 0 ..= 2^depth) is inside. Cost: a hash probe a brick along x until one is found.
    pub fn is_inside(&self, at: [u32; 3]) -> bool {
        let [x, y, z] = at;
        let local = Local::new(x, y, z);
        for bx in (0..=x >> 3).rev() {
            let found =
                Key::cell(self.crossings.depth() - 3, [bx, y >> 3, z >> 3]).and_then(|key| self.crossings.find(key));
            if let Some(i) = found {
                let end = Local::new(7, y, z);
                return if bx == x >> 3 {
                    self.inside[i].get(local)
                } else {
                    self.inside[i].get(end) ^ self.crossings.bricks()[i].crossed[0].get(end)
                };
            }
        }
        false
    }

    /// What bricks that are not in the list are. Cost: some 50 ns a brick.
    pub fn uniform(&self) -> Uniform<'_> {
        let bricks = self.crossings.bricks();
        let row = |i| (Uniform::code(self.crossings.origin(&bricks[i]).map(|c| c >> 3)), i as u32);
        let mut rows: Vec<(u64, u32)> = (0..bricks.len()).into_par_iter().map(row).collect();
        rows.par_sort_unstable();
        Uniform { octree: self, rows }
    }

    /// Volume enclosed, in cells: the length of all lines of the grid along one axis that is inside. The axis is the one with most crossings,
    /// as far as some thousand bricks tell: thin walls lie across it, and their thickness is measured instead of the lattice planes between
    /// their sides. An estimate: what lies along the lines is only known to a cell. Cost: some 2 ns a crossing along that axis.
    pub fn volume(&self) -> f64 {
        let bricks = self.crossings.bricks();
        let looked_at = (0..bricks.len()).step_by(bricks.len() / TELLING + 1);
        let crossed = |a: Axis| looked_at.clone().map(|i| u64::from(bricks[i].crossed[a.index()].count())).sum::<u64>();
        let axis = Axis::ALL.into_iter().max_by_key(|&a| crossed(a)).expect("three axes");
        // Sums of fixed chunks in a fixed order: the same for any number of threads.
        let (count, piece) = pieces(self.inside.len(), 256);
        let lengths = |n| match axis {
            Axis::X => self.length_inside::<0>(piece(n)),
            Axis::Y => self.length_inside::<1>(piece(n)),
            Axis::Z => self.length_inside::<2>(piece(n)),
        };
        let sums: Vec<f64> = (0..count).into_par_iter().map(lengths).collect();
        sums.iter().sum()
    }

    /// Where lines along an axis leave the inside in some bricks counts positive, where they enter it, negative.
    fn length_inside<const AXIS: usize>(&self, bricks: Range<usize>) -> f64 {
        let places = self.crossings.places(bricks.clone());
        let offsets = self.crossings.offsets().slice(places.clone());
        let mut sum = 0.0;
        for (brick, inside) in bricks.map(|i| (&self.crossings.bricks()[i], &self.inside[i])) {
            let from = f64::from(self.crossings.origin(brick)[AXIS]);
            let starts: [f64; 8] = std::array::from_fn(|i| from + i as f64);
            let before = brick.crossed[..AXIS].iter().map(Plane::count).sum::<u32>();
            let mut offsets = offsets[(brick.first + before) as usize - places.start..].iter();
            for (x, (&word, &inside)) in brick.crossed[AXIS].0.iter().zip(&inside.0).enumerate() {
                for (b, &offset) in Bits(word).zip(&mut offsets) {
                    let along = [x, b as usize >> 3, b as usize & 7][AXIS];
                    let w = starts[along % 8] + position(offset);
                    // The sign without a branch, which would be a guess.
                    sum += f64::from_bits(w.to_bits() ^ (!inside >> b) << 63);
                }
            }
        }
        sum
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.crossings.bytes() + self.inside.capacity() * size_of::<Plane>()
    }

    /// The first finest edge whose ends have the same sign although it is crossed, or different ones although it is not.
    ///
    /// # Errors
    /// Names the edge, or the broken invariant of the crossings.
    pub fn validate(&self) -> Result<(), String> {
        self.crossings.validate()?;
        for (i, brick) in self.crossings.bricks().iter().enumerate() {
            let origin = self.crossings.origin(brick);
            for p in (0..512).map(Local::from_index) {
                let c = p.coords();
                let at: [u32; 3] = std::array::from_fn(|a| origin[a] + c[a]);
                for axis in Axis::ALL {
                    let mut end = at;
                    end[axis.index()] += 1;
                    let changes = self.inside[i].get(p) != self.is_inside(end);
                    if changes != brick.crossed[axis.index()].get(p) {
                        let edge = finest_element(self.crossings.depth(), at, Extent::from(axis));
                        return Err(format!("edge {edge} has crossings and signs that disagree"));
                    }
                }
            }
        }
        Ok(())
    }
}

/// The signs of bricks that are not in the list of an octree.
#[derive(Debug)]
pub struct Uniform<'a> {
    octree: &'a SignedOctree,
    /// Bricks by y, z, x, and their places.
    rows: Vec<(u64, u32)>,
}

impl Uniform<'_> {
    fn code([x, y, z]: [u32; 3]) -> u64 {
        (u64::from(y) << 16 | u64::from(z)) << 16 | u64::from(x)
    }

    /// Whether the points of a brick that is not in the list are inside. Cost: a binary search.
    pub fn is_inside(&self, brick: Key) -> bool {
        let code = Uniform::code(lattice_point(self.octree.crossings.depth(), brick).map(|c| c >> 3));
        let Some(&(last, i)) = self.rows[..self.rows.partition_point(|row| row.0 < code)].last() else { return false };
        let end = Local::new(7, 0, 0);
        let i = i as usize;
        last >> 16 == code >> 16
            && self.octree.inside[i].get(end) != self.octree.crossings.bricks()[i].crossed[0].get(end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DEPTH: u32 = 5;
    const MIDDLE: Sample = Sample { offset: 1 << 15, normal: 0 };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn signs_come_back(balls in prop::collection::vec((prop::array::uniform3(1i32..32), 0i32..60), 0..6)) {
            let within = |p: [u32; 3]| {
                p.iter().all(|&c| c > 0) && balls.iter().any(|(centre, square)| {
                    (0..3).map(|a| (p[a] as i32 - centre[a]).pow(2)).sum::<i32>() <= *square
                })
            };
            let mut signs: Vec<(Key, Plane)> = Vec::new();
            for key in (0..64).map(|i| Key::cell(DEPTH - 3, [i >> 4, i >> 2 & 3, i & 3]).unwrap()) {
                let mut plane = Plane::EMPTY;
                let origin = lattice_point(DEPTH, key);
                for p in (0..512).map(Local::from_index) {
                    if within(std::array::from_fn(|a| origin[a] + p.coords()[a])) {
                        plane.set(p);
                    }
                }
                signs.push((key, plane));
            }
            signs.sort_unstable_by_key(|s| s.0);
            let build = |signs: &[(Key, Plane)]| {
                let uniform = |brick| within(lattice_point(DEPTH, brick));
                SignedOctree::from_signs(DEPTH, false, signs, uniform, |_, crossed, out| {
                    out.resize(crossed.iter().map(Plane::count).sum::<u32>() as usize, MIDDLE);
                })
            };
            let octree = build(&signs);
            prop_assert_eq!(octree.validate(), Ok(()));
            for i in 0..32 * 32 * 32 {
                let p = [i >> 10, i >> 5 & 31, i & 31];
                prop_assert_eq!(octree.is_inside(p), within(p), "{:?}", p);
            }
            let rows = octree.uniform();
            for key in (0..64).map(|i| Key::cell(DEPTH - 3, [i >> 4, i >> 2 & 3, i & 3]).unwrap()) {
                let is_listed = octree.crossings().find(key).is_some();
                prop_assert!(is_listed || rows.is_inside(key) == within(lattice_point(DEPTH, key)), "{}", key);
            }
            // The bricks it kept are enough to build it again.
            let kept: Vec<_> =
                octree.crossings().bricks().iter().zip(octree.inside()).map(|(b, &inside)| (b.key, inside)).collect();
            let again = build(&kept);
            prop_assert_eq!(again.inside(), octree.inside());
        }
    }
}
