//! How far two surfaces are from each other.
//!
//! Points of one surface are measured against the other, both ways. The points are the corners of all faces, and samples spread evenly by
//! area: the surface is laid out triangle by triangle as a line as long as its area, in the order of the tree, which keeps neighbours
//! together; sample i lies anywhere in the i-th of n equal pieces (stratified sampling), and anywhere in its triangle (Turk 1990,
//! "Generating random points in triangles"). So samples come sorted in space, each starts its search from the triangle that was closest to
//! the one before, and none needs to be held.
//!
//! The mean and the root of the mean square are over the samples; the greatest distance is over samples and corners. It is a lower bound of
//! the Hausdorff distance: what lies between samples may be a little farther away (Cignoni, Rocchini and Scopigno 1998, "Metro").
//!
//! Pieces of fixed size are measured on all threads and added up in order: the result is the same on any number of them.

use super::chance::Chance;
use super::{Mesh, TriangleTree};
use crate::error::Result;
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Stage};
use glam::DVec3;
use std::ops::Range;

/// Points measured at a time.
const PIECE: usize = 1 << 12;
/// Random numbers a sample.
const NUMBERS: u64 = 3;

/// How distances are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DistanceOptions {
    /// Samples of each surface, beside its corners.
    pub samples: u64,
    /// Other seeds take other samples.
    pub seed: u64,
}

impl Default for DistanceOptions {
    /// 200,000 samples: the mean is right to about a part in a thousand.
    fn default() -> Self {
        DistanceOptions { samples: 200_000, seed: 1 }
    }
}

/// How far one surface is from another, in model units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Points that were measured: samples, and corners of faces.
    pub points: u64,
    /// The greatest distance of a point.
    pub max: f64,
    /// The point that has it.
    pub from: DVec3,
    /// The closest point to that one on the other surface.
    pub to: DVec3,
    /// The mean distance of the samples, or of the corners if there are no samples.
    pub mean: f64,
    /// The root of the mean square of these distances.
    pub rms: f64,
}

/// How far two surfaces are from each other, both ways.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distances {
    /// From points of the first surface to the second one.
    pub there: Deviation,
    /// From points of the second surface to the first one.
    pub back: Deviation,
}

impl Distances {
    /// The Hausdorff distance, as far as the points tell: no point of either surface is farther than this from the other surface.
    pub fn hausdorff(&self) -> f64 {
        self.there.max.max(self.back.max)
    }
}

impl Mesh {
    /// How far this surface and another one are from each other, or none if one of them has no face with an area.
    ///
    /// Points that no such face uses do not count, nor do faces with points that are not finite. Some 1 µs a point on one thread; 28 to 50
    /// bytes a triangle, and 4 a corner.
    ///
    /// # Errors
    /// Only when cancelled.
    ///
    /// ```
    /// use zmend::mesh::{DistanceOptions, sample};
    /// use zmend::progress::Silent;
    ///
    /// let cube = sample::build("cube", 1)?;
    /// let mut moved = cube.clone();
    /// moved.points.iter_mut().for_each(|p| p.x += 0.25);
    /// let distances = cube.distances(&moved, DistanceOptions::default(), &Silent)?.expect("both have faces");
    /// assert_eq!(distances.hausdorff(), 0.25);
    /// # Ok::<(), zmend::Error>(())
    /// ```
    pub fn distances(
        &self,
        other: &Mesh,
        options: DistanceOptions,
        progress: &dyn Progress,
    ) -> Result<Option<Distances>> {
        let (a, b) = (TriangleTree::new(self), TriangleTree::new(other));
        if a.is_empty() || b.is_empty() {
            return Ok(None);
        }
        let (corners_a, corners_b) = (a.used_points(), b.used_points());
        progress.begin(Stage::Measure, 2 * options.samples + (corners_a.len() + corners_b.len()) as u64);
        let there = deviation(&a, &corners_a, &b, options, progress)?;
        let back = deviation(&b, &corners_b, &a, options, progress)?;
        Ok(Some(Distances { there, back }))
    }
}

/// How far the corners and the samples of one surface are from another one.
fn deviation(
    from: &TriangleTree<'_>,
    corners: &[u32],
    to: &TriangleTree<'_>,
    options: DistanceOptions,
    progress: &dyn Progress,
) -> Result<Deviation> {
    let measure = |points: usize, place: &(dyn Fn(Range<usize>) -> Vec<DVec3> + Sync)| {
        let (count, piece) = pieces(points, PIECE);
        let mut sums = Sums::default();
        let make = |(): &mut (), number: usize| Sums::of(&place(piece(number)), to);
        let take = |piece: Sums| {
            progress.advance(piece.points);
            sums.add(&piece);
            Ok(())
        };
        in_order(count, progress, || (), make, take).map(|()| sums)
    };
    let samples = Samples::new(from, options);
    let at_corners = measure(corners.len(), &|range| corners[range].iter().map(|&i| from.point(i)).collect())?;
    let at_samples = measure(options.samples as usize, &|range| samples.points(range))?;
    let measured = if at_samples.points > 0 { at_samples } else { at_corners };
    let mut all = at_corners;
    all.add(&at_samples);
    let n = measured.points as f64;
    Ok(Deviation {
        points: all.points,
        max: all.max,
        from: all.from,
        to: all.to,
        mean: measured.sum / n / to.scale(),
        rms: (measured.squares / n).sqrt() / to.scale(),
    })
}

/// Points spread over a surface, evenly by area.
struct Samples<'a> {
    tree: &'a TriangleTree<'a>,
    options: DistanceOptions,
    /// Sums of the areas of the triangles up to each one, and this one.
    ends: Vec<f64>,
}

impl<'a> Samples<'a> {
    fn new(tree: &'a TriangleTree<'a>, options: DistanceOptions) -> Self {
        let mut total = 0.0;
        let ends = (0..tree.len() as u32).map(|i| {
            let [a, b, c] = tree.triangle(i);
            total += (b - a).cross(c - a).length();
            total
        });
        Samples { tree, options, ends: ends.collect() }
    }

    /// The samples with these numbers, in model units.
    fn points(&self, numbers: Range<usize>) -> Vec<DVec3> {
        let last = self.ends.len() - 1;
        let step = self.ends[last] / self.options.samples as f64;
        let mut chance = Chance(self.options.seed).skip(NUMBERS * numbers.start as u64);
        let mut triangle = self.ends.partition_point(|&end| end <= step * numbers.start as f64).min(last);
        let place = |i: usize| {
            let at = step * (i as f64 + chance.unit());
            while triangle < last && self.ends[triangle] <= at {
                triangle += 1;
            }
            let [a, b, c] = self.tree.triangle(triangle as u32);
            let (s, t) = (chance.unit().sqrt(), chance.unit());
            ((1.0 - s) * a + s * (1.0 - t) * b + s * t * c) / self.tree.scale()
        };
        numbers.map(place).collect()
    }
}

/// Distances added up.
#[derive(Clone, Copy, Default)]
struct Sums {
    points: u64,
    max: f64,
    from: DVec3,
    to: DVec3,
    /// Sums of distances and of their squares, times the scale of the other surface's tree and its square.
    sum: f64,
    squares: f64,
}

impl Sums {
    /// The sums of some points, which should lie near each other.
    fn of(points: &[DVec3], to: &TriangleTree<'_>) -> Self {
        let mut sums = Sums::default();
        let mut guess = 0;
        for &p in points {
            let (closest, triangle) = to.closest_from(p, guess);
            guess = triangle;
            let distance = closest.distance * to.scale();
            let one = Sums {
                points: 1,
                max: closest.distance,
                from: p,
                to: closest.point,
                sum: distance,
                squares: distance * distance,
            };
            sums.add(&one);
        }
        sums
    }

    fn add(&mut self, other: &Sums) {
        if self.points == 0 || other.points > 0 && other.max > self.max {
            (self.max, self.from, self.to) = (other.max, other.from, other.to);
        }
        self.points += other.points;
        self.sum += other.sum;
        self.squares += other.squares;
    }
}
