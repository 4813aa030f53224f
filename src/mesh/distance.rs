//! How far two surfaces are from each other.
//!
//! Points of one surface are measured against the other, both ways. The points are the corners of all faces, and
//! samples spread evenly by area: the surface is laid out triangle by triangle as a line as long as its area, in the
//! order of the tree, which keeps neighbours together; sample i lies anywhere in the i-th of n equal pieces of it
//! (stratified sampling). Where on a triangle's part of the line it lies says in which row of the triangle it is, and i
//! times the golden ratio where in the row (Turk 1990, "Generating random points in triangles"; Weyl 1916). So samples
//! come sorted in space, each starts its search from the triangle that was closest to the one before, and none needs to
//! be held.
//!
//! The mean and the root of the mean square are over the samples; the greatest distance is over samples and corners. It
//! is a lower bound of the Hausdorff distance: what lies between samples may be a little farther away (Cignoni,
//! Rocchini and Scopigno 1998, "Metro").
//!
//! Pieces of fixed size are measured on all threads and added up in order: the result is the same on any number of
//! them.

use super::chance::Chance;
use super::{Mesh, TriangleTree};
use crate::error::Result;
use crate::parallel::{in_order, pieces};
use crate::progress::{Progress, Stage};
use glam::DVec3;
use std::ops::Range;

/// Points measured at a time.
const PIECE: usize = 1 << 12;

/// How distances are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DistanceOptions {
    /// Samples of each surface, beside its corners.
    pub samples: u64,
    /// Other seeds take other samples.
    pub seed: u64,
}

impl Default for DistanceOptions {
    /// 200,000 samples: the mean is right to about a part in ten thousand where distances change smoothly.
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
    /// The Hausdorff distance, as far as the points tell: no point of either surface is farther than this from the
    /// other surface.
    pub fn hausdorff(&self) -> f64 {
        self.there.max.max(self.back.max)
    }
}

impl Mesh {
    /// How far this surface and another one are from each other, or none if one of them has no face with an area.
    ///
    /// Points that no such face uses do not count, nor do faces with points that are not finite. Some 1 µs a point on
    /// one thread; 28 to 50 bytes a triangle, and 4 a corner.
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
    /// assert!((distances.hausdorff() - 0.25).abs() < 1e-12);
    /// # Ok::<(), zmend::Error>(())
    /// ```
    pub fn distances(
        &self,
        other: &Mesh,
        options: DistanceOptions,
        progress: &dyn Progress,
    ) -> Result<Option<Distances>> {
        let (a, b) = (TriangleTree::try_new(self, progress)?, TriangleTree::try_new(other, progress)?);
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
        let mut chance = Chance(self.options.seed).skip(numbers.start as u64);
        let mut triangle = self.ends.partition_point(|&end| end <= step * numbers.start as f64).min(last);
        let place = |i: usize| {
            let at = step * (i as f64 + chance.unit());
            while triangle < last && self.ends[triangle] <= at {
                triangle += 1;
            }
            let [a, b, c] = self.tree.triangle(triangle as u32);
            // Where it is on the line says how far it is from `a`: large triangles are filled row by row.
            let start = if triangle == 0 { 0.0 } else { self.ends[triangle - 1] };
            let part = (at - start) / (self.ends[triangle] - start).max(f64::MIN_POSITIVE);
            let (s, t) = (part.clamp(0.0, 1.0).sqrt(), chance.even());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::mesh::sample;
    use crate::progress::Silent;
    use std::sync::atomic::{AtomicU64, Ordering};

    const FEW: DistanceOptions = DistanceOptions { samples: 20_000, seed: 1 };

    fn between(a: &Mesh, b: &Mesh) -> Distances {
        a.distances(b, FEW, &Silent).unwrap().unwrap()
    }

    fn mapped(mesh: &Mesh, map: impl Fn(DVec3) -> DVec3) -> Mesh {
        Mesh { points: mesh.points.iter().map(|&p| map(p)).collect(), faces: mesh.faces.clone() }
    }

    #[track_caller]
    fn assert_near(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
    }

    #[test]
    fn parallel_planes() {
        let plate = sample::build("plate", 1).unwrap();
        let d = between(&plate, &mapped(&plate, |p| p + 0.5 * DVec3::Z));
        for way in [d.there, d.back] {
            [way.max, way.mean, way.rms, way.from.distance(way.to)].iter().for_each(|&d| assert_near(d, 0.5, 1e-12));
            assert_eq!(way.points, FEW.samples + 4);
        }
        // Moved in its own plane by half its width, half of it hangs over: from 0 to 1/2 away, evenly.
        let width = plate.report().bounds.extent().x;
        let d = between(&plate, &mapped(&plate, |p| p + 0.5 * width * DVec3::X)).there;
        assert_near(d.max, 0.5 * width, 1e-12);
        assert_near(d.mean, 0.125 * width, 3e-4 * width);
        assert_near(d.rms, width / 24f64.sqrt(), 3e-4 * width);
        assert_near(d.to.x - d.from.x, 0.5 * width, 1e-12);
    }

    #[test]
    fn concentric_spheres() {
        let ball = sample::build("sphere", 2).unwrap();
        let d = between(&ball, &mapped(&ball, |p| 1.5 * p));
        for way in [d.there, d.back] {
            assert_near(way.max, 0.5, 2e-3);
            assert_near(way.mean, 0.5, 2e-3);
            assert_near(way.rms, 0.5, 2e-3);
            // The closest point lies in the same direction.
            assert_near(way.from.normalize().dot(way.to.normalize()), 1.0, 1e-3);
        }
    }

    #[test]
    fn one_way_is_not_the_other() {
        let ball = sample::build("sphere", 1).unwrap();
        let mut both = ball.clone();
        let n = ball.points.len() as u32;
        both.points.extend(ball.points.iter().map(|p| p + 10.0 * DVec3::X));
        ball.faces.iter().for_each(|f| both.faces.push(&f.iter().map(|i| i + n).collect::<Vec<_>>()));
        let d = between(&ball, &both);
        assert!(d.there.max < 1e-12 && d.there.mean < 1e-12, "{d:?}");
        assert_near(d.hausdorff(), 10.0, 1e-2);
        assert_near(d.back.from.x, 11.0, 1e-2);
        assert_eq!(between(&both, &ball).there, d.back);
        assert!(between(&both, &both).hausdorff() < 1e-12);
    }

    #[test]
    fn samples_are_spread_by_area() {
        // Triangles of very different sizes: a strip whose parts double in length.
        let points = (0..12).flat_map(|i| [0.0, 1.0].map(|y| DVec3::new(f64::from(1 << i), y, 0.0))).collect();
        let faces: Vec<[u32; 4]> = (0..11).map(|i| [2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1]).collect();
        let strip = Mesh { points, faces: faces.iter().map(|f| &f[..]).collect() };
        let tree = TriangleTree::new(&strip);
        let points = Samples::new(&tree, FEW).points(0..FEW.samples as usize);
        assert!(points.iter().all(|p| (1.0..=2048.0).contains(&p.x) && (0.0..=1.0).contains(&p.y) && p.z == 0.0));
        let mean = points.iter().sum::<DVec3>() / points.len() as f64;
        assert_near(mean.x, 0.5 * 2049.0, 0.5);
        assert_near(mean.y, 0.5, 1e-3);
        for x in [2.0, 3.0, 10.0, 100.0, 1000.0, 1500.0] {
            let below = points.iter().filter(|p| p.x < x).count() as f64 / points.len() as f64;
            assert_near(below, (x - 1.0) / 2047.0, 1e-3);
        }
        // Pieces are parts of the whole.
        assert_eq!(Samples::new(&tree, FEW).points(8192..9000), points[8192..9000]);
    }

    #[test]
    fn what_has_no_area_has_no_distance() {
        let ball = sample::build("sphere", 1).unwrap();
        let mut spoilt = ball.clone();
        spoilt.points.push(DVec3::NAN);
        spoilt.points.push(DVec3::splat(99.0));
        let [nan, far] = [1, 2].map(|i| ball.points.len() as u32 + i - 1);
        spoilt.faces.push(&[0, 1, nan]);
        spoilt.faces.push(&[0, far, far]);
        assert!(between(&ball, &spoilt).hausdorff() < 1e-12);
        let line = Mesh { points: vec![DVec3::ZERO, DVec3::X], faces: [&[0, 1, 0][..]].into_iter().collect() };
        for empty in [Mesh::default(), line] {
            assert_eq!(ball.distances(&empty, FEW, &Silent).unwrap(), None);
            assert_eq!(empty.distances(&ball, FEW, &Silent).unwrap(), None);
        }
        // Without samples, corners are all there is.
        let none = DistanceOptions { samples: 0, ..FEW };
        let d = ball.distances(&mapped(&ball, |p| 2.0 * p), none, &Silent).unwrap().unwrap().there;
        assert_eq!(d.points, ball.points.len() as u64);
        assert_near(d.mean, 1.0, 0.02);
    }

    #[test]
    fn seeds_and_threads() {
        let (a, b) = (sample::build("knot", 1).unwrap(), sample::build("overlap", 1).unwrap());
        let with = |threads, seed| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| a.distances(&b, DistanceOptions { seed, ..FEW }, &Silent)).unwrap().unwrap()
        };
        assert_eq!(with(1, 7), with(3, 7));
        let (x, y) = (with(2, 1).there, with(2, 2).there);
        assert!(x.mean != y.mean && (x.mean / y.mean - 1.0).abs() < 0.01, "{x:?} {y:?}");
    }

    /// Counts, and stops after a number of points.
    struct Until(AtomicU64, u64);

    impl Progress for Until {
        fn begin(&self, _: Stage, total: u64) {
            self.0.fetch_add(total, Ordering::Relaxed);
        }
        fn advance(&self, amount: u64) {
            self.0.fetch_sub(amount, Ordering::Relaxed);
        }
        fn is_cancelled(&self) -> bool {
            self.0.load(Ordering::Relaxed) <= self.1
        }
    }

    #[test]
    fn progress_is_told_and_heeded() {
        let ball = sample::build("sphere", 1).unwrap();
        let total = 2 * (FEW.samples + ball.points.len() as u64);
        let whole = Until(AtomicU64::new(1), 0);
        assert!(ball.distances(&ball, FEW, &whole).is_ok());
        assert_eq!(whole.0.into_inner(), 1);
        let half = Until(AtomicU64::new(0), total / 2);
        assert!(matches!(ball.distances(&ball, FEW, &half), Err(Error::Cancelled)));
    }
}
