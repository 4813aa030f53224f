//! The dual of a tree: every point, edge and face at which leaves meet, with those leaves.
//!
//! The recursion of dual contouring (Ju, Losasso, Schaefer, Warren 2002, section 4: `cellProc`, `faceProc`, `edgeProc`, and the one for
//! points that its dual grids need) is one function here. An element is given by its [`Extent`] and the cells on its sides. Along each
//! axis of its extent it is cut into a low half, a high half and what is between them; the sub-elements are all combinations: 27 of a
//! cell (8 cells, 12 faces, 6 edges, a point), 9 of a face, 3 of an edge, and a point is its own. The sides of a sub-element are the
//! children that touch it, or the leaves that have none.
//!
//! # Cost
//!
//! O(leaves), seven elements a leaf: three faces, three edges, a point. A probe for each refined cell on each side of each element.

use super::{Block, CellState, LinearOctree};
use crate::grid::{Axis, Corner, Extent, Key};
use rayon::prelude::*;

/// A point, edge or face at which leaves meet, such that none of the leaves has a smaller element there.
#[derive(Debug, Clone, Copy)]
pub struct Dual<'a, T> {
    /// The axes along which it extends: none for a point, one for an edge, two for a face.
    pub extent: Extent,
    /// The leaf on the side of each corner; corners that differ along the extent only are on the same side. A leaf in the middle of whose
    /// edge or face the element lies is on several sides.
    pub leaves: [(Key, &'a T); 8],
}

impl<T> Dual<'_, T> {
    /// The element's name: that of a corner, an edge or a face of the smallest leaf.
    pub fn element(&self) -> Key {
        let (corner, leaf) = Corner::ALL
            .into_iter()
            .map(|c| (c, self.leaves[c.index()].0))
            .min_by_key(|&(_, l)| l.size())
            .expect("eight");
        let half = leaf.size() / 2;
        let centre = Axis::ALL.map(|a| {
            let c = leaf.center()[a.index()];
            match (self.extent.contains(a), corner & a) {
                (true, _) => c,
                (false, true) => c - half,
                (false, false) => c + half,
            }
        });
        Key::element(centre, self.extent).expect("a part of a leaf")
    }
}

/// A part of the recursion: [`LinearOctree::dual_pieces`].
#[derive(Debug)]
pub struct DualPiece<'a, T> {
    tree: &'a LinearOctree<T>,
    extent: Extent,
    sides: [Side<'a, T>; 8],
}

/// A cell on a side.
#[derive(Debug)]
struct Side<'a, T> {
    cell: Key,
    what: What<'a, T>,
}

/// What there is of a cell on a side.
#[derive(Debug)]
enum What<'a, T> {
    Leaf(&'a T),
    /// The block with its children, and the place of the first.
    Refined(&'a Block<T>, u32),
}

impl<T> Clone for Side<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Side<'_, T> {}

impl<T> Clone for What<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for What<'_, T> {}

impl<'a, T> Side<'a, T> {
    fn leaf(&self) -> Option<(Key, &'a T)> {
        match self.what {
            What::Leaf(record) => Some((self.cell, record)),
            What::Refined(..) => None,
        }
    }

    /// The child at a corner, if there is one; a leaf is its own.
    fn child(self, tree: &'a LinearOctree<T>, corner: Corner) -> Option<Self> {
        let What::Refined(block, first) = self.what else { return Some(self) };
        let place = first + corner.index() as u32;
        let cell = self.cell.child(corner);
        match block.get(place) {
            Some(record) => Some(Side { cell, what: What::Leaf(record) }),
            None if block.refined.has(place) => tree.refined_side(cell),
            None => None,
        }
    }
}

impl<T> LinearOctree<T> {
    /// Calls `visit` with every point, edge and face inside the root at which leaves meet, each once. What lies on the root's boundary
    /// or beside a hole is left out. The order is the same on every run.
    ///
    /// ```
    /// use zmend::grid::Key;
    /// use zmend::octree::LinearOctree;
    ///
    /// let tree: LinearOctree<()> = Key::ROOT.children().map(|leaf| (leaf, ())).into_iter().collect();
    /// let mut count = [0; 3];
    /// tree.visit_dual(|dual| count[dual.extent.dimension() as usize] += 1);
    /// assert_eq!(count, [1, 6, 12]);
    /// ```
    pub fn visit_dual<'a>(&'a self, mut visit: impl FnMut(Dual<'a, T>)) {
        if let Some(piece) = self.whole_dual() {
            piece.visit(&mut visit);
        }
    }

    /// The recursion in at least `count` pieces, if it has as many, for all threads. Visited one after another they give what
    /// [`visit_dual`](LinearOctree::visit_dual) does, in its order.
    ///
    /// ```
    /// use rayon::prelude::*;
    /// use zmend::octree::LinearOctree;
    ///
    /// let tree = LinearOctree::build(4, |_| true, |_| ());
    /// let counts = tree.dual_pieces(100).into_par_iter().map(|piece| {
    ///     let mut count = 0;
    ///     piece.visit(&mut |dual| count += u32::from(dual.extent.dimension() == 2));
    ///     count
    /// });
    /// assert_eq!(counts.sum::<u32>(), 3 * 15 * 16 * 16);
    /// ```
    pub fn dual_pieces<'a>(&'a self, count: usize) -> Vec<DualPiece<'a, T>> {
        let mut pieces: Vec<DualPiece<'a, T>> = self.whole_dual().into_iter().collect();
        while pieces.len() < count && pieces.iter().any(|piece| !piece.is_least()) {
            let divide = |piece: DualPiece<'a, T>| {
                let mut parts = Vec::new();
                if piece.is_least() {
                    parts.push(piece);
                } else {
                    piece.for_each_part(|part| parts.push(part));
                }
                parts
            };
            pieces = pieces.into_iter().flat_map(divide).collect();
        }
        pieces
    }

    fn whole_dual(&self) -> Option<DualPiece<'_, T>> {
        let root = match self.state(Key::ROOT) {
            CellState::Leaf(record) => Side { cell: Key::ROOT, what: What::Leaf(record) },
            CellState::Refined => self.refined_side(Key::ROOT)?,
            CellState::Absent => return None,
        };
        Some(DualPiece { tree: self, extent: Extent::CELL, sides: [root; 8] })
    }

    fn refined_side(&self, cell: Key) -> Option<Side<'_, T>> {
        let (block, first) = self.block_of(cell.child(Corner::MIN))?;
        Some(Side { cell, what: What::Refined(block, first) })
    }
}

impl<T: Sync> LinearOctree<T> {
    /// What `make` gives for every point, edge and face, on all threads, in the order of [`visit_dual`](LinearOctree::visit_dual).
    pub fn par_collect_dual<R: Send>(&self, make: impl Fn(Dual<'_, T>) -> Option<R> + Sync) -> Vec<R> {
        /// Enough for many threads; it does not depend on their number, though results would not either.
        const PIECES: usize = 1024;
        let collect = |piece: DualPiece<'_, T>| {
            let mut made = Vec::new();
            piece.visit(&mut |dual| made.extend(make(dual)));
            made
        };
        self.dual_pieces(PIECES).into_par_iter().flat_map_iter(collect).collect()
    }
}

impl<'a, T> DualPiece<'a, T> {
    /// Calls `visit` with every element of this piece.
    pub fn visit(&self, visit: &mut impl FnMut(Dual<'a, T>)) {
        if let Some(leaves) = all(self.sides.map(|side| side.leaf())) {
            if self.extent != Extent::CELL {
                visit(Dual { extent: self.extent, leaves });
            }
        } else {
            self.for_each_part(|part| part.visit(visit));
        }
    }

    /// Whether all sides are leaves.
    fn is_least(&self) -> bool {
        self.sides.iter().all(|side| side.leaf().is_some())
    }

    /// The sub-elements with leaves on all sides: by what is taken along x, then y, then z: the low half, the middle, the high half.
    fn for_each_part(&self, mut take: impl FnMut(DualPiece<'a, T>)) {
        let across = !self.extent.bits() & 7;
        // Eight children touch the element, whatever its kind: by side across it and by half along it.
        let children = Corner::ALL.map(|corner| {
            let side = self.sides[corner.index()];
            side.child(self.tree, Corner::ALL[usize::from(corner.bits() ^ across)])
        });
        for part in PARTS.iter().filter(|part| part.0 & across == 0) {
            let &(halved, high) = part;
            // Along the axes of a half all sides lie in it.
            let side = |corner: Corner| children[usize::from(corner.bits() & !halved | high)];
            if let Some(sides) = all(Corner::ALL.map(side)) {
                take(DualPiece { tree: self.tree, extent: Extent::ALL[usize::from(halved)], sides });
            }
        }
    }
}

/// Parts of an element: the axes along which it is halved, and those of them on which the high half is taken. Ordered by what is taken
/// along x, then y, then z: the low half, the middle, the high half.
const PARTS: [(u8, u8); 27] = {
    let mut parts = [(0, 0); 27];
    let mut n = 0;
    while n < 27 {
        let choice = [n / 9, n / 3 % 3, n % 3];
        let mut a = 0;
        while a < 3 {
            let bit = Axis::ALL[a].bit();
            if choice[a] != 1 {
                parts[n].0 |= bit;
            }
            if choice[a] == 2 {
                parts[n].1 |= bit;
            }
            a += 1;
        }
        n += 1;
    }
    parts
};

/// All eight, if all are there.
fn all<S: Copy>(sides: [Option<S>; 8]) -> Option<[S; 8]> {
    let first = sides[0]?;
    let mut found = [first; 8];
    for (found, side) in found.iter_mut().zip(sides) {
        *found = side?;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::oracle::{Oracle, tree};
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn the_dual_has_each_least_element_once(tree in tree(5)) {
            let oracle = Oracle::new(&tree);
            // Elements of leaves that no other leaf around them divides, with leaves on all sides.
            let mut expected = BTreeMap::new();
            for leaf in tree.keys_z() {
                for element in leaf.corners().into_iter().chain(leaf.edges()).chain(leaf.faces()) {
                    let around = oracle.around(element);
                    let is_least = element.is_point() || around.iter().all(|other| other.size() >= element.size());
                    let covered: u32 = around.iter().map(|&l| octants_covered(l, element)).sum();
                    if is_least && covered == 8 {
                        expected.insert(element, around);
                    }
                }
            }
            let mut found = BTreeMap::new();
            tree.visit_dual(|dual| {
                let mut leaves = dual.leaves.map(|(leaf, _)| leaf).to_vec();
                leaves.sort();
                leaves.dedup();
                assert!(found.insert(dual.element(), leaves).is_none(), "{} came twice", dual.element());
            });
            prop_assert_eq!(found, expected);
        }

        #[test]
        fn pieces_give_the_same_in_the_same_order(tree in tree(6), count in 0..300usize) {
            let mut expected = Vec::new();
            tree.visit_dual(|dual| expected.push(dual.element()));
            let mut found = Vec::new();
            for piece in tree.dual_pieces(count) {
                piece.visit(&mut |dual| found.push(dual.element()));
            }
            prop_assert_eq!(&found, &expected);
            prop_assert_eq!(tree.par_collect_dual(|dual| Some(dual.element())), expected);
        }
    }

    /// How many of the eight octants around the centre of an element a leaf fills, if it is no smaller than the element.
    fn octants_covered(leaf: Key, element: Key) -> u32 {
        let (min, max, c) = (leaf.min_corner(), leaf.max_corner(), element.center());
        let is_inside = |a: &Axis| min[a.index()] < c[a.index()] && c[a.index()] < max[a.index()];
        1 << Axis::ALL.iter().filter(|a| is_inside(a)).count()
    }
}
