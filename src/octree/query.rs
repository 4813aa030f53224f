//! Leaves by where they are: in a box, within a radius, along a ray, around a point, an edge or a face.
//!
//! All coordinates are those of the lattice, 0 ..= 2^19; [`Domain`](crate::geom::Domain) tells them of points in space. The searches go
//! down from the root into those cells that can have a leaf of the kind; they allocate nothing.

use super::{CellState, LeavesIn, LinearOctree};
use crate::grid::key::{MAX_LEVEL, SIDE};
use crate::grid::{Axis, Corner, Direction, Extent, Key};

/// A leaf on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossed<'a, T> {
    /// The leaf.
    pub leaf: Key,
    /// Its record.
    pub record: &'a T,
    /// Where the ray enters it, in lengths of the ray's direction; 0 if it starts inside.
    pub enter: f64,
    /// Where it leaves it.
    pub leave: f64,
}

/// Leaves by place.
impl<T> LinearOctree<T> {
    /// The leaves for which the answer is yes, and yes for all cells that hold them, in Z-order. Asked once for a cell, from the root
    /// down; what lies in a cell that is refused is not looked at.
    pub fn leaves_where(&self, mut enter: impl FnMut(Key) -> bool) -> impl Iterator<Item = (Key, &T)> {
        let mut walk = self.leaves_in(Key::ROOT);
        std::iter::from_fn(move || {
            while let Some(cell) = walk.next {
                if !enter(cell) {
                    walk.next = walk.after(cell);
                } else if let Some(leaf) = walk.step(cell) {
                    return Some(leaf);
                }
            }
            None
        })
    }

    /// The leaves that hold a point of the closed box between two corners, in Z-order: those which [`locate`](LinearOctree::locate)
    /// finds for its points. Parts of the box outside the root hold none. Probes for those leaves and their ancestors.
    pub fn leaves_in_box(&self, min: [u32; 3], max: [u32; 3]) -> impl Iterator<Item = (Key, &T)> {
        let is_inside = min.iter().all(|&c| c <= SIDE);
        let first = min.map(|c| c.min(SIDE - 1));
        self.leaves_where(move |cell| {
            let (low, high) = (cell.min_corner(), cell.max_corner());
            is_inside && (0..3).all(|i| low[i] <= max[i] && first[i] < high[i])
        })
    }

    /// The leaves of which a point is at most `radius` lattice units away from `centre`, in Z-order. Probes for those leaves and their
    /// ancestors.
    pub fn leaves_within(&self, centre: [f64; 3], radius: f64) -> impl Iterator<Item = (Key, &T)> {
        self.leaves_where(move |cell| {
            let (low, high) = (cell.min_corner().map(f64::from), cell.max_corner().map(f64::from));
            let away = |i: usize| (low[i] - centre[i]).max(centre[i] - high[i]).max(0.0);
            (0..3).map(|i| away(i) * away(i)).sum::<f64>() <= radius * radius && radius >= 0.0
        })
    }

    /// The leaves along a ray, from its origin on, in the order in which it passes them. A leaf that it only touches at an edge or
    /// corner may be among them; of leaves on both sides of a face in whose plane it runs, those above. A direction of zero gives the
    /// leaf at the origin; one that is not finite, nothing. Probes for those leaves and their ancestors.
    ///
    /// The children of a cell are visited in Z-order, turned over along the axes on which the ray descends: since it goes one way along
    /// every axis, it never comes back to an earlier one.
    ///
    /// ```
    /// use zmend::grid::Key;
    /// use zmend::octree::LinearOctree;
    ///
    /// let tree: LinearOctree<()> = Key::ROOT.children().map(|leaf| (leaf, ())).into_iter().collect();
    /// let half = f64::from(1 << 18);
    /// let passed: Vec<_> = tree.along_ray([1.5 * half, 1.0, 9.0], [-1.0, 0.0, 0.0]).collect();
    /// assert_eq!(passed.iter().map(|at| (at.enter, at.leave)).collect::<Vec<_>>(), [(0.0, half / 2.0), (half / 2.0, 1.5 * half)]);
    /// assert_eq!(passed.iter().map(|at| at.leaf.corner_in_parent().index()).collect::<Vec<_>>(), [4, 0]);
    /// ```
    pub fn along_ray(&self, origin: [f64; 3], direction: [f64; 3]) -> impl Iterator<Item = Crossed<'_, T>> {
        let high = |axis: Axis| u8::from(direction[axis.index()] < 0.0) * axis.bit();
        let flip = Axis::ALL.into_iter().map(high).sum::<u8>();
        let mut walk = LeavesIn::flipped(self, Corner::ALL[usize::from(flip)]);
        if !direction.iter().chain(&origin).all(|c| c.is_finite()) {
            walk.next = None;
        }
        std::iter::from_fn(move || {
            while let Some(cell) = walk.next {
                let Some((enter, leave)) = stretch(cell, origin, direction) else {
                    walk.next = walk.after(cell);
                    continue;
                };
                if let Some((leaf, record)) = walk.step(cell) {
                    return Some(Crossed { leaf, record, enter, leave });
                }
            }
            None
        })
    }

    /// The leaves in the eight octants around a lattice point, by corner: at index `c` the leaf that holds the points next to it on the
    /// side of corner `c`. A leaf on whose edge or face the point lies comes several times. `None` outside the root and in holes. Up to
    /// eight searches.
    pub fn octants(&self, point: [u32; 3]) -> [Option<(Key, &T)>; 8] {
        let mut level = MAX_LEVEL;
        Corner::ALL.map(|corner| {
            let leaf = self.search(finest_beside(point, corner)?.code(), self.levels.occupied, level);
            level = leaf.and_then(|(leaf, _)| leaf.level()).unwrap_or(level);
            leaf
        })
    }

    /// All leaves around a point, an edge or a face, each once: those whose closed cubes meet it in a piece of its own dimension. By the
    /// corner on whose side they lie, then in Z-order. Of an edge or face of some level, the leaves may be smaller or larger than that
    /// level's. A cell gives the leaves inside it, or the one that holds it.
    ///
    /// Up to eight probes or searches, and one for each smaller leaf.
    ///
    /// ```
    /// use zmend::grid::{Edge, Key};
    /// use zmend::octree::LinearOctree;
    ///
    /// let [first, rest @ ..] = Key::ROOT.children();
    /// let tree: LinearOctree<()> = first.children().into_iter().chain(rest).map(|leaf| (leaf, ())).collect();
    /// // The edge of the first child along x at the middle of the root: two small leaves, three large ones.
    /// let edge = first.edge(Edge::ALL[3]);
    /// assert_eq!(tree.around(edge).count(), 5);
    /// ```
    pub fn around(&self, element: Key) -> impl Iterator<Item = (Key, &T)> {
        let extent = element.dir();
        let beside = move |corner: Corner| -> Option<Key> {
            if corner.bits() & extent.bits() != 0 {
                return None;
            }
            if element.is_point() { finest_beside(element.center(), corner) } else { cell_beside(element, corner) }
        };
        Corner::ALL.into_iter().flat_map(move |corner| {
            let Some(cell) = beside(corner) else { return Leaves { whole: None, parts: None } };
            let whole = match self.state(cell) {
                CellState::Leaf(record) => Some((cell, record)),
                CellState::Absent => self.leaf_over(cell),
                CellState::Refined => {
                    let back = Axis::ALL.map(|a| if extent.contains(a) { 0 } else { 1 - 2 * i32::from(corner & a) });
                    let parts = match Direction::from_steps(back) {
                        Some(back) => LeavesIn::beside(self, cell, back),
                        None => self.leaves_in(cell),
                    };
                    return Leaves { whole: None, parts: Some(parts) };
                }
            };
            // A larger one lies on several sides and counts on the first.
            let earlier = Corner::ALL.into_iter().take_while(move |&c| c != corner).filter_map(beside);
            let whole = whole.filter(|&(leaf, _)| !earlier.into_iter().any(|cell| leaf.contains(cell)));
            Leaves { whole, parts: None }
        })
    }
}

/// One leaf, or several.
struct Leaves<'a, T> {
    whole: Option<(Key, &'a T)>,
    parts: Option<LeavesIn<'a, T>>,
}

impl<'a, T> Iterator for Leaves<'a, T> {
    type Item = (Key, &'a T);

    fn next(&mut self) -> Option<Self::Item> {
        self.whole.take().or_else(|| self.parts.as_mut()?.next())
    }
}

/// Where a ray enters and leaves a cell, if it does. Along axes on which it does not move, a cell holds its low faces only, but for the
/// far faces of the root.
fn stretch(cell: Key, origin: [f64; 3], direction: [f64; 3]) -> Option<(f64, f64)> {
    let (low, high) = (cell.min_corner(), cell.max_corner());
    let (mut enter, mut leave) = (0.0, f64::INFINITY);
    for i in 0..3 {
        let (from, to) = (f64::from(low[i]), f64::from(high[i]));
        if direction[i] == 0.0 {
            let is_below = origin[i] < to || high[i] == SIDE && origin[i] == to;
            if origin[i] < from || !is_below {
                return None;
            }
            continue;
        }
        let (a, b) = ((from - origin[i]) / direction[i], (to - origin[i]) / direction[i]);
        enter = a.min(b).max(enter);
        leave = a.max(b).min(leave);
    }
    (enter <= leave).then(|| (enter, if leave.is_finite() { leave } else { 0.0 }))
}

/// The finest cell that holds what is next to a point on the side of a corner.
fn finest_beside(point: [u32; 3], corner: Corner) -> Option<Key> {
    let [x, y, z] =
        Axis::ALL.map(|a| if corner & a { Some(point[a.index()]) } else { point[a.index()].checked_sub(1) });
    Key::holding([x?, y?, z?], MAX_LEVEL)
}

/// The cell of the level of an edge or face that lies beside it, on the side of a corner.
fn cell_beside(element: Key, corner: Corner) -> Option<Key> {
    let half = element.size() / 2;
    let [x, y, z] = Axis::ALL.map(|a| {
        let centre = element.center()[a.index()];
        match (element.dir().contains(a), corner & a) {
            (true, _) => Some(centre),
            (false, true) => Some(centre + half),
            (false, false) => centre.checked_sub(half),
        }
    });
    Key::element([x?, y?, z?], Extent::CELL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::oracle::{Oracle, points, tree};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn boxes_and_balls_agree_with_a_look_at_all_leaves(tree in tree(7), corners in points(2), radius in 0..1u32 << 19) {
            let [a, b] = [0, 1].map(|i| corners.get(i).copied().unwrap_or([7, SIDE, 1 << 17]));
            let (min, max) = ([0, 1, 2].map(|i| a[i].min(b[i])), [0, 1, 2].map(|i| a[i].max(b[i])));
            let in_box = |leaf: &Key| (0..3).all(|i| {
                let (low, high) = (leaf.min_corner()[i], leaf.max_corner()[i]);
                low <= max[i] && (min[i] < high || min[i] == SIDE && high == SIDE)
            });
            let expected: Vec<Key> = tree.keys_z().into_iter().filter(in_box).collect();
            prop_assert!(tree.leaves_in_box(min, max).map(|(leaf, _)| leaf).eq(expected));
            let near = |leaf: &Key| (0..3).map(|i| {
                let (low, high) = (leaf.min_corner()[i], leaf.max_corner()[i]);
                u64::from(low.saturating_sub(a[i]).max(a[i].saturating_sub(high))).pow(2)
            }).sum::<u64>() <= u64::from(radius).pow(2);
            let expected: Vec<Key> = tree.keys_z().into_iter().filter(near).collect();
            prop_assert!(tree.leaves_within(a.map(f64::from), f64::from(radius)).map(|(leaf, _)| leaf).eq(expected));
            prop_assert_eq!(tree.leaves_in_box([0, 0, SIDE + 1], [SIDE + 1; 3]).count(), 0);
        }

        #[test]
        fn rays_pass_leaves_in_order_and_miss_none(tree in tree(7), from in [-0.2..1.2, -0.2..1.2, -0.2..1.2], way in [-1.0..1.0, -1.0..1.0, -1.0..1.0], still in 0..8usize) {
            let origin = from.map(|c: f64| (c * f64::from(SIDE)).round());
            let direction = [0, 1, 2].map(|i| if still >> i & 1 == 1 { 0.0 } else { way[i] });
            let passed: Vec<_> = tree.along_ray(origin, direction).collect();
            prop_assert!(passed.iter().all(|at| tree.contains(at.leaf) && at.enter <= at.leave));
            let ordered = passed.windows(2).all(|w| w[0].enter <= w[1].enter + 1e-6 && w[0].leave <= w[1].leave + 1e-6);
            prop_assert!(ordered || still == 7);
            // Points along the ray lie in the leaves passed there.
            for step in 0..200 {
                let t = f64::from(step) * f64::from(SIDE) / 60.0 + 0.321;
                let p = [0, 1, 2].map(|i| origin[i] + t * direction[i]);
                if p.iter().any(|&c| !(0.0..=f64::from(SIDE)).contains(&c)) {
                    continue;
                }
                let found = tree.locate(p.map(|c| c as u32)).map(|(leaf, _)| leaf);
                let there = passed.iter().find(|at| Some(at.leaf) == found);
                prop_assert_eq!(there.is_some(), found.is_some());
                prop_assert!(still == 7 || there.is_none_or(|at| at.enter <= t + 1e-6 && t <= at.leave + 1e-6));
            }
            prop_assert_eq!(tree.along_ray([f64::NAN; 3], direction).count(), 0);
        }

        #[test]
        fn leaves_around_an_element_are_those_that_share_a_piece_of_it(tree in tree(5), random in points(10)) {
            let oracle = Oracle::new(&tree);
            let of_leaves = tree.keys_z().into_iter().take(40).flat_map(|leaf| {
                leaf.corners().into_iter().chain(leaf.edges()).chain(leaf.faces())
            });
            for element in of_leaves.chain(random.into_iter().filter_map(Key::point)) {
                let mut found: Vec<Key> = tree.around(element).map(|(leaf, _)| leaf).collect();
                found.sort();
                prop_assert_eq!(found, oracle.around(element), "{}", element);
                if element.is_point() {
                    for (corner, leaf) in Corner::ALL.into_iter().zip(tree.octants(element.center())) {
                        let expected = finest_beside(element.center(), corner)
                            .and_then(|cell| oracle.leaf_at(cell.min_corner()));
                        prop_assert_eq!(leaf.map(|(leaf, _)| leaf), expected);
                    }
                }
            }
        }
    }
}
