//! Solids from volumes.
//!
//! The samples of a volume become lattice points of the octree, sample `(0, 0, 0)` at the point two cells (`MARGIN`) from the root's least corner along
//! each axis; what lies beyond the volume is outside, and the surface is closed half a cell beyond the last samples. So the solid has the
//! topology that [marching cubes](crate::contour::volume) give the volume itself.
//!
//! Signs are made as [rows of 64](Volume::signs), eight bytes of which (eight points along x, at eight points along z) are transposed into a
//! byte of each of eight words of a brick. Only bricks with both signs, or beside those of the other sign, are kept: no dense copy is made of
//! the volume, beyond a byte for each brick of 512 samples. Places and normals of crossings are asked for afterwards, for crossed edges only.

use super::Solid;
use crate::error::{Error, Result};
use crate::geom::frame::{DEPTHS, Frame};
use crate::geom::normal::NormalCode;
use crate::grid::brick::Plane;
use crate::grid::{Axis, Key};
use crate::octree::SignedOctree;
use crate::octree::cells::transposed;
use crate::octree::crossings::{Sample, lattice_point};
use crate::octree::signed::GIVEN_BYTES;
use crate::progress::{Progress, Stage, check};
use crate::volume::{Level, Volume};
use glam::DVec3;
use rayon::prelude::*;

/// Cells between the root's sides and the nearest samples: the surface that is closed beyond the samples, and what topology repair adds to it,
/// keep clear of the sides.
const MARGIN: usize = 2;
/// Points a side of a brick.
const BRICK: usize = 8;

impl Solid {
    /// The solid where a volume is inside a level, with sample `(0, 0, 0)` at `origin` and cells of `cell` model units between samples.
    /// [`Image::on_cubes`](crate::volume::Image::on_cubes) brings any volume onto such a lattice.
    ///
    /// Cost: that of the signs of all rows, and some 100 ns a crossed edge, in parallel.
    ///
    /// # Errors
    /// When the level is not a number, when the volume is too large for the finest octree or lies where its cells cannot be told apart; `Cancelled`.
    pub fn from_volume<V: Volume>(
        volume: &V,
        level: Level,
        origin: DVec3,
        cell: f64,
        progress: &dyn Progress,
    ) -> Result<Solid> {
        if level.iso.is_nan() {
            return Err(Error::setting(
                "iso",
                "the level is not a number",
                "give a number between those of the volume",
            ));
        }
        let size = volume.size();
        let most = size.into_iter().max().unwrap_or(0);
        let depth = DEPTHS.into_iter().find(|&depth| most + 2 * MARGIN <= 1 << depth).ok_or_else(|| {
            let problem = format!("{most} samples along an axis are more than {}", (1 << DEPTHS.end()) - 2 * MARGIN);
            Error::setting("volume", problem, "crop it, or sample it anew with larger cells")
        })?;
        let frame = Frame::new(origin - MARGIN as f64 * cell, cell * f64::from(1u32 << depth), depth)?;
        if size.contains(&0) {
            return Ok(Solid::new(SignedOctree::empty(depth), frame));
        }
        let bricks = Bricks::of(volume, level, depth, progress)?;
        let signs = bricks.listed();
        check(progress)?;
        progress.hold((bricks.classes.len() + signs.len() * GIVEN_BYTES) as u64)?;
        let field = Field { volume, level, size };
        let samples = |place: usize, crossed: &[Plane; 3], out: &mut Vec<Sample>| {
            let start = lattice_point(depth, signs[place].0).map(|c| i64::from(c) - MARGIN as i64);
            for axis in Axis::ALL {
                out.extend(crossed[axis.index()].iter().map(|local| {
                    let c = local.coords();
                    field.sample(std::array::from_fn(|a| start[a] + i64::from(c[a])), axis)
                }));
            }
        };
        let octree = SignedOctree::try_from_signs(depth, true, &signs, |key| bricks.is_full(key), samples, progress)?;
        Ok(Solid::new(octree, frame))
    }
}

/// What the points of a brick are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    Outside,
    Inside,
    Mixed,
}

/// The signs of all bricks that samples lie in.
struct Bricks {
    depth: u32,
    /// How many there are along x, y and z.
    size: [usize; 3],
    /// x fastest, then y, then z.
    classes: Vec<Class>,
    /// Those of both signs, in no order that matters.
    mixed: Vec<(Key, Plane)>,
}

impl Bricks {
    fn of<V: Volume>(volume: &V, level: Level, depth: u32, progress: &dyn Progress) -> Result<Self> {
        let size = volume.size().map(|n| (n + MARGIN).div_ceil(BRICK));
        let [nx, ny, nz] = size;
        progress.begin(Stage::Sign, (ny * nz) as u64);
        progress.hold((nx * ny * nz) as u64)?;
        let mut classes = vec![Class::Outside; nx * ny * nz];
        let rows = classes.par_chunks_mut(nx).enumerate().map(|(row, classes)| {
            check(progress)?;
            let planes = planes_of_row(volume, level, [row % ny, row / ny], nx);
            let mut mixed = Vec::new();
            for (x, (plane, class)) in planes.into_iter().zip(classes).enumerate() {
                *class = match plane {
                    Plane::EMPTY => Class::Outside,
                    Plane::FULL => Class::Inside,
                    _ => {
                        mixed.push((key(depth, [x, row % ny, row / ny]), plane));
                        Class::Mixed
                    }
                };
            }
            progress.advance(1);
            Ok(mixed)
        });
        let mixed: Result<Vec<Vec<(Key, Plane)>>> = rows.collect();
        Ok(Bricks { depth, size, classes, mixed: mixed?.concat() })
    }

    fn class(&self, [x, y, z]: [usize; 3]) -> Class {
        let [nx, ny, nz] = self.size;
        if x < nx && y < ny && z < nz { self.classes[(z * ny + y) * nx + x] } else { Class::Outside }
    }

    /// Whether all points of a brick are inside.
    fn is_full(&self, brick: Key) -> bool {
        self.class(lattice_point(self.depth, brick).map(|c| c as usize / BRICK)) == Class::Inside
    }

    /// All bricks that may own a crossed edge, sorted: those of both signs, and those beside which, along x, y or z, one is different. The
    /// edge belongs to the brick that it starts in, which may be one before the first samples, but never is: there is a margin.
    fn listed(&self) -> Vec<(Key, Plane)> {
        let [nx, ny, nz] = self.size;
        let beside = |i: usize| {
            let at = [i % nx, i / nx % ny, i / nx / ny];
            let class = self.classes[i];
            let differs = |axis: usize| {
                let mut next = at;
                next[axis] += 1;
                self.class(next) != class
            };
            let is_listed = class != Class::Mixed && (0..3).any(differs);
            is_listed.then(|| (key(self.depth, at), if class == Class::Inside { Plane::FULL } else { Plane::EMPTY }))
        };
        let mut list: Vec<(Key, Plane)> = (0..nx * ny * nz).into_par_iter().filter_map(beside).collect();
        list.extend(&self.mixed);
        list.par_sort_unstable_by_key(|&(key, _)| key);
        list
    }
}

/// The brick at a place, counted in bricks.
fn key(depth: u32, at: [usize; 3]) -> Key {
    Key::cell(depth - 3, at.map(|c| c as u32)).expect("the root holds all samples")
}

/// The points of the bricks in a row along x, at a place along y and z, counted in bricks.
fn planes_of_row<V: Volume>(volume: &V, level: Level, [by, bz]: [usize; 2], count: usize) -> Vec<Plane> {
    let [nx, ny, nz] = volume.size();
    let mut planes = vec![Plane::EMPTY; count];
    let mut words = vec![0u64; nx.div_ceil(64)];
    // For each brick, bytes of eight points along x at z = 0..8.
    let mut squares = vec![0u64; count];
    for y in 0..BRICK {
        squares.fill(0);
        for z in 0..BRICK {
            let at = [(by * BRICK + y).wrapping_sub(MARGIN), (bz * BRICK + z).wrapping_sub(MARGIN)];
            if at[0] >= ny || at[1] >= nz {
                continue;
            }
            volume.signs(at, level, &mut words);
            for (x, square) in squares.iter_mut().enumerate() {
                *square |= byte(&words, x * BRICK) << (8 * z);
            }
        }
        for (plane, square) in planes.iter_mut().zip(&squares).filter(|(_, square)| **square != 0) {
            // Byte z with bits x becomes byte x with bits z.
            let turned = transposed(*square).to_le_bytes();
            plane.0.iter_mut().zip(turned).for_each(|(word, byte)| *word |= u64::from(byte) << (8 * y));
        }
    }
    planes
}

/// Eight bits of a row from the lattice point `x` on, where samples begin at [`MARGIN`].
fn byte(words: &[u64], x: usize) -> u64 {
    let word = |i: usize| words.get(i).copied().unwrap_or(0);
    let Some(start) = x.checked_sub(MARGIN) else { return word(0) << (MARGIN - x) & 0xff };
    let (i, shift) = (start / 64, start % 64);
    let bits = word(i) >> shift | if shift > 56 { word(i + 1) << (64 - shift) } else { 0 };
    bits & 0xff
}

/// A volume, asked for crossings.
struct Field<'a, V> {
    volume: &'a V,
    level: Level,
    size: [usize; 3],
}

impl<V: Volume> Field<'_, V> {
    /// The crossing of the edge from the sample `at` one step along an axis; one of both may be beyond the last samples.
    fn sample(&self, at: [i64; 3], axis: Axis) -> Sample {
        let a = axis.index();
        let along = DVec3::AXES[a];
        if at[a] < 0 || at[a] + 1 >= self.size[a] as i64 {
            return Sample::new(1 << 15, NormalCode::encode(axis, along.to_array()).0);
        }
        let from = at.map(|c| c as usize);
        let t = self.volume.crossing(from, axis, self.level);
        let place = DVec3::from(from.map(|c| c as f64)) + t * along;
        let gradient = self.volume.gradient(place);
        // Fields of two values have no slope here and there; an edge that is crossed has one along itself.
        let is_usable = gradient.is_finite() && gradient[a].abs() > 1e-9 * gradient.abs().max_element();
        let normal = if is_usable { gradient / gradient.abs().max_element() } else { along };
        Sample::new((t * 65536.0) as u16, NormalCode::encode(axis, normal.to_array()).0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::volume::Samples;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn signs_and_crossings_are_those_of_the_samples(
            size in [1usize..20, 1usize..20, 1usize..80],
            axis in 0usize..3,
            seed in any::<u64>(),
            coarse in 1usize..9,
        ) {
            // Noise of one value for each block, so that there are uniform bricks, too.
            let mut size = size;
            size.swap(axis, 2);
            let noise = |[x, y, z]: [usize; 3]| {
                let block = ((x / coarse) as u64) << 40 | ((y / coarse) as u64) << 20 | (z / coarse) as u64;
                (block ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32 & 7
            };
            let volume = Samples::new(size, |at| noise(at) as f64);
            for level in [Level::above(3.25), Level::below(2.0)] {
                let solid = Solid::from_volume(&volume, level, DVec3::splat(-1.0), 0.5, &Silent).unwrap();
                prop_assert_eq!(solid.signed().validate(), Ok(()));
                let side = 1i64 << solid.frame.depth();
                let value = |at: [i64; 3]| {
                    let at = at.map(|c| (c - MARGIN as i64) as usize);
                    (0..3).all(|a| at[a] < size[a]).then(|| noise(at) as f64)
                };
                let end = size.map(|n| (n + 2 * MARGIN + 1).min(side as usize) as i64);
                for at in (0..end[0]).flat_map(|x| (0..end[1]).flat_map(move |y| (0..end[2]).map(move |z| [x, y, z]))) {
                    let here = value(at);
                    let is_inside = here.is_some_and(|v| level.holds(v));
                    prop_assert_eq!(solid.signed().is_inside(at.map(|c| c as u32)), is_inside, "{:?}", at);
                }
                // Sample (0, 0, 0) is where it should be.
                prop_assert_eq!(solid.frame.to_model(DVec3::splat(MARGIN as f64)), DVec3::splat(-1.0));
            }
        }
    }

    #[test]
    fn crossings_lie_where_the_field_has_its_level() {
        let centre = DVec3::splat(9.5);
        let ball = Samples::new([20; 3], |at| DVec3::from(at.map(|c| c as f64)).distance(centre));
        let solid = Solid::from_volume(&ball, Level::below(8.0), DVec3::ZERO, 1.0, &Silent).unwrap();
        let crossings = solid.signed().crossings();
        let mut seen = 0;
        for brick in crossings.bricks().iter() {
            let start = DVec3::from(crossings.origin(brick).map(f64::from)) - MARGIN as f64;
            for axis in Axis::ALL {
                for local in brick.crossed[axis.index()].iter() {
                    let sample = crossings.sample_at(brick.place(axis, local));
                    let at = start + DVec3::from(local.coords().map(f64::from));
                    let out = at + sample.position() * DVec3::AXES[axis.index()] - centre;
                    assert!((out.length() - 8.0).abs() < 0.02, "{out}");
                    let normal = NormalCode(sample.normal).decode(axis).as_dvec3();
                    assert!(normal.dot(out.normalize()).abs() > 0.995, "{normal} {out}");
                    seen += 1;
                }
            }
        }
        assert!(seen > 1000);
        let nothing = Solid::from_volume(&ball, Level::below(0.0), DVec3::ZERO, 1.0, &Silent).unwrap();
        assert!(nothing.signed().crossings().is_empty());
        let everything = Solid::from_volume(&ball, Level::above(-1.0), DVec3::ZERO, 1.0, &Silent).unwrap();
        assert_eq!(everything.signed().validate(), Ok(()));
        assert!((everything.signed().volume() - 8000.0).abs() < 1.0);
        assert!(Solid::from_volume(&ball, Level::above(f64::NAN), DVec3::ZERO, 1.0, &Silent).is_err());
    }
}
