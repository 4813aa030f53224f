//! Sketches: graphs of straight lines that say what topology a solid shall have, and how they are laid on the grid.
//!
//! A line becomes a path of edges of the grid, at most about a cell from it. Two lines from one point may have a stretch in common there, and
//! touch again within it when they are rounded; so the path of a line is taken from where it leaves what is drawn of
//! its neighbours for the last time. Whether the paths have as many parts and loops as the lines is counted: on a grid that is too
//! coarse for the sketch they have not, and that is an error.
//!
//! Cost: some 100 ns an edge of the paths.

use crate::error::{Error, Result, Short};
use crate::grid::{Axis, Extent, Key};
use crate::octree::crossings::finest_element;
use crate::sets::Sets;
use hashbrown::HashSet;

/// A graph of straight lines between points, in the coordinates of whoever made it. Points without a line are parts of their own.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sketch {
    /// Positions.
    pub points: Vec<[f64; 3]>,
    /// The points that each line joins. Lines that are there twice count once; a line from a point to itself is none.
    pub lines: Vec<[u32; 2]>,
}

/// A point of the grid, in cells.
type Point = [u32; 3];

impl Sketch {
    /// Lines from point to point to point.
    pub fn of_chains<'a>(points: Vec<[f64; 3]>, chains: impl Iterator<Item = &'a [u32]>) -> Sketch {
        Sketch { points, lines: chains.flat_map(|chain| chain.windows(2)).map(|line| [line[0], line[1]]).collect() }
    }

    /// The same lines between moved points.
    #[must_use]
    pub fn moved(&self, to: impl Fn([f64; 3]) -> [f64; 3]) -> Sketch {
        Sketch { points: self.points.iter().copied().map(to).collect(), lines: self.lines.clone() }
    }

    /// Number of parts, and of loops that the lines make.
    ///
    /// # Panics
    /// When a line names a point that is not there.
    pub fn parts_and_loops(&self) -> (u64, u64) {
        let lines = self.distinct_lines();
        count_parts_and_loops(self.points.len(), lines.iter().map(|line| line.map(|end| end as usize)))
    }

    fn distinct_lines(&self) -> Vec<[u32; 2]> {
        let mut lines: Vec<[u32; 2]> = self.lines.iter().map(|&[a, b]| [a.min(b), a.max(b)]).collect();
        lines.retain(|[a, b]| a != b);
        lines.sort_unstable();
        lines.dedup();
        lines
    }

    /// The finest points and edges of the paths, sorted; positions are in cells.
    ///
    /// # Errors
    /// When there are no points, when one does not lie within the grid, and when the grid is too coarse for the sketch.
    pub(super) fn on_grid(&self, depth: u32) -> Result<Vec<Key>> {
        if self.points.is_empty() {
            return Err(Error::setting("sketch", "it has no points", "draw what the solid shall look like with lines"));
        }
        if let Some([a, b]) = self.lines.iter().find(|line| line.iter().any(|&end| end as usize >= self.points.len())) {
            let problem =
                format!("a line joins points {a} and {b}, counted from 0, but there are {}", self.points.len());
            return Err(Error::setting("sketch", problem, "write the sketch again"));
        }
        let corners =
            self.points.iter().enumerate().map(|(i, &at)| rounded(depth, i, at)).collect::<Result<Vec<_>>>()?;
        let mut points: HashSet<Point, ahash::RandomState> = HashSet::with_hasher(fixed());
        let mut edges: HashSet<Key, ahash::RandomState> = HashSet::with_hasher(fixed());
        // What is drawn of the lines at each point.
        let mut near: Vec<HashSet<Point, ahash::RandomState>> = vec![HashSet::with_hasher(fixed()); corners.len()];
        (0..).zip(&corners).for_each(|(i, &corner): (usize, _)| _ = near[i].insert(corner));
        points.extend(&corners);
        for line in self.distinct_lines() {
            let [a, b] = line.map(|end| end as usize);
            let whole = path([corners[a], corners[b]]);
            let start = whole.iter().rposition(|point| near[a].contains(point)).unwrap_or(0);
            let left = &whole[start..];
            let end = left.iter().position(|point| near[b].contains(point)).unwrap_or(left.len() - 1);
            let drawn = &left[..=end];
            points.extend(drawn);
            edges.extend(drawn.windows(2).map(|step| edge_between(depth, step[0], step[1])));
            near[a].extend(drawn);
            near[b].extend(drawn);
        }
        let mut keys: Vec<Key> = points.iter().map(|&at| finest_element(depth, at, Extent::POINT)).collect();
        keys.sort_unstable();
        let number = |point: &Key| keys.binary_search(point).expect("both ends of an edge are points");
        let ends = |edge: &Key| {
            let mut ends = edge.boundary().map(|point| number(&point));
            [ends.next(), ends.next()].map(|end| end.expect("an edge has two ends"))
        };
        let (wanted, drawn) = (self.parts_and_loops(), count_parts_and_loops(keys.len(), edges.iter().map(ends)));
        if wanted != drawn {
            let problem = format!(
                "it has {} parts and {} loops, but {} and {} on a grid of {} cells a side: lines come within a cell of each other",
                wanted.0,
                wanted.1,
                drawn.0,
                drawn.1,
                1u64 << depth
            );
            return Err(Error::setting("sketch", problem, "take a greater --depth, or draw the lines further apart"));
        }
        keys.extend(edges);
        keys.sort_unstable();
        Ok(keys)
    }
}

/// Nothing depends on the order in a set.
fn fixed() -> ahash::RandomState {
    ahash::RandomState::with_seeds(5, 6, 7, 8)
}

/// The point of the grid next to a position, not on the sides of the root.
fn rounded(depth: u32, i: usize, at: [f64; 3]) -> Result<Point> {
    let last = f64::from((1u32 << depth) - 1);
    let nearest = at.map(f64::round);
    if nearest.iter().all(|c| (1.0..=last).contains(c)) {
        return Ok(nearest.map(|c| c as u32));
    }
    let [x, y, z] = at.map(Short);
    let problem =
        format!("its point {i}, at ({x}, {y}, {z}) in cells, does not lie within the grid of {} a side", last + 1.0);
    Err(Error::setting("sketch", problem, "draw it in the coordinates of the model, within its grid"))
}

/// The points of the grid that a line comes by, each one step from the last.
fn path([from, to]: [Point; 2]) -> Vec<Point> {
    let far: [u32; 3] = std::array::from_fn(|a| from[a].abs_diff(to[a]));
    let (mut at, mut steps) = (from, [0u32; 3]);
    let mut path = Vec::with_capacity(1 + far.iter().sum::<u32>() as usize);
    path.push(at);
    while at != to {
        // The axis whose next step comes first along the line: step k of n is at (2 k + 1) / (2 n).
        let comes_first = |&a: &usize, &b: &usize| {
            let share = |a: usize, of: usize| u64::from(2 * steps[a] + 1) * u64::from(far[of]);
            share(a, b).cmp(&share(b, a))
        };
        let axis = (0..3).filter(|&a| steps[a] < far[a]).min_by(comes_first).expect("the end is not reached");
        steps[axis] += 1;
        at[axis] = if to[axis] > from[axis] { at[axis] + 1 } else { at[axis] - 1 };
        path.push(at);
    }
    path
}

/// The edge between two points that are one step apart.
fn edge_between(depth: u32, a: Point, b: Point) -> Key {
    let axis = Axis::ALL.into_iter().find(|axis| a[axis.index()] != b[axis.index()]).expect("they are not the same");
    finest_element(depth, a.min(b), Extent::from(axis))
}

/// Parts and loops of a graph.
fn count_parts_and_loops(points: usize, edges: impl Iterator<Item = [usize; 2]>) -> (u64, u64) {
    let sets = Sets::new(points);
    let (mut parts, mut loops) = (points as u64, 0);
    for [a, b] in edges {
        if sets.union(a as u32, b as u32) { parts -= 1 } else { loops += 1 }
    }
    (parts, loops)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sketch(points: &[[f64; 3]], lines: &[[u32; 2]]) -> Sketch {
        Sketch { points: points.to_vec(), lines: lines.to_vec() }
    }

    #[test]
    fn lines_at_small_angles_leave_a_point_as_a_tree() {
        // Rounded, such lines meet, part and meet again many times.
        for seed in 0..200u32 {
            let mut state = seed;
            let mut random = |range: u32| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from((state >> 8) % range)
            };
            let from = [3.0, 3.0, 3.0];
            let mut points = vec![from];
            points.extend((0..6).map(|_| [45.0 + random(15), 3.0 + random(12), 3.0 + random(30)]));
            points.dedup();
            let lines: Vec<[u32; 2]> = (1..points.len() as u32).map(|end| [0, end]).collect();
            // Only where two lines come close at their ends can there be a loop, and that is told.
            match sketch(&points, &lines).on_grid(6) {
                Ok(keys) => {
                    let count = |dimension| keys.iter().filter(|key| key.dir().dimension() == dimension).count();
                    assert_eq!(count(0), count(1) + 1, "{seed}");
                }
                Err(error) => assert!(error.to_string().contains("within a cell of each other"), "{seed}: {error}"),
            }
        }
    }

    #[test]
    fn paths_stay_within_a_cell_of_their_lines() {
        for to in [[60, 3, 3], [1, 2, 3], [9, 40, 33], [50, 51, 52], [3, 3, 3]] {
            let from = [3u32, 3, 3];
            let path = path([from, to]);
            assert_eq!(path.len() as u32, 1 + (0..3).map(|a| from[a].abs_diff(to[a])).sum::<u32>());
            let direction = glam::DVec3::from(to.map(f64::from)) - glam::DVec3::from(from.map(f64::from));
            for point in path {
                let offset = glam::DVec3::from(point.map(f64::from)) - glam::DVec3::from(from.map(f64::from));
                let away = offset - direction * (offset.dot(direction) / direction.length_squared().max(1.0));
                assert!(away.length() < 1.23, "{point:?} is {} from the line to {to:?}", away.length());
            }
        }
    }

    #[test]
    fn a_grid_too_coarse_and_points_beyond_it_are_errors() {
        let square = [[2.0, 2.0, 2.0], [2.3, 2.0, 2.0], [2.3, 2.3, 2.0], [2.0, 2.3, 2.0]];
        let lines = [[0, 1], [1, 2], [2, 3], [3, 0]];
        let message = |sketch: Sketch| sketch.on_grid(4).expect_err("it cannot be drawn").to_string();
        assert!(message(sketch(&square, &lines)).contains("1 parts and 1 loops, but 1 and 0 on a grid of 16"));
        assert!(message(sketch(&[[0.4, 2.0, 2.0]], &[])).contains("point 0, at (0.4, 2, 2) in cells"));
        assert!(message(sketch(&[[f64::NAN, 2.0, 2.0]], &[])).contains("does not lie within the grid"));
        assert!(message(sketch(&[], &[])).contains("no points"));
        assert!(message(sketch(&[[3.0; 3]], &[[0, 7]])).contains("joins points 0 and 7"));
        let twice =
            sketch(&square.map(|at| at.map(|c| 5.0 * c - 6.0)), &[lines[0], lines[0], [1, 0], [2, 2], lines[1]]);
        assert_eq!(twice.parts_and_loops(), (2, 0));
        assert!(twice.on_grid(4).is_ok());
    }
}
