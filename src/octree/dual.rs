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
//! O(leaves); a probe for each refined cell on each side of each element, in blocks that are at hand.

use super::{CellState, LinearOctree};
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
        let (corner, leaf) = Corner::ALL.into_iter().map(|c| (c, self.leaves[c.index()].0)).min_by_key(|&(_, l)| l.size()).expect("eight");
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

/// A cell on a side: refined, or a leaf with its record.
type Side<'a, T> = (Key, Option<&'a T>);

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
                if piece.is_least() { parts.push(piece) } else { piece.for_each_part(|part| parts.push(part)) }
                parts
            };
            pieces = pieces.into_iter().flat_map(divide).collect();
        }
        pieces
    }

    fn whole_dual(&self) -> Option<DualPiece<'_, T>> {
        Some(DualPiece { tree: self, extent: Extent::CELL, sides: [self.side(Key::ROOT)?; 8] })
    }

    fn side(&self, cell: Key) -> Option<Side<'_, T>> {
        match self.state(cell) {
            CellState::Leaf(record) => Some((cell, Some(record))),
            CellState::Refined => Some((cell, None)),
            CellState::Absent => None,
        }
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
        let [a, b, c, d, e, f, g, h] = self.sides.map(|(leaf, record)| Some((leaf, record?)));
        if let (Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g), Some(h)) = (a, b, c, d, e, f, g, h) {
            if self.extent != Extent::CELL {
                visit(Dual { extent: self.extent, leaves: [a, b, c, d, e, f, g, h] });
            }
        } else {
            self.for_each_part(|part| part.visit(visit));
        }
    }

    /// Whether all sides are leaves.
    fn is_least(&self) -> bool {
        self.sides.iter().all(|side| side.1.is_some())
    }

    /// The sub-elements with leaves on all sides: by what is taken along x, then y, then z: the low half, the middle, the high half.
    fn for_each_part(&self, mut take: impl FnMut(DualPiece<'a, T>)) {
        // Each side's children, by corner; a leaf is its own.
        let mut children = [[None; 8]; 8];
        for corner in Corner::ALL {
            let same = usize::from(corner.bits() & !self.extent.bits());
            children[corner.index()] = if same < corner.index() {
                children[same]
            } else {
                let (cell, record) = self.sides[corner.index()];
                match record {
                    Some(_) => [Some((cell, record)); 8],
                    None => cell.children().map(|child| self.tree.side(child)),
                }
            };
        }
        for part in 0..27u8 {
            let choice = [part / 9, part / 3 % 3, part % 3];
            // Halves can be taken, or have to be, along the extent only.
            if Axis::ALL.into_iter().any(|a| !self.extent.contains(a) && choice[a.index()] != 1) {
                continue;
            }
            let halved = Axis::ALL.into_iter().filter(|a| choice[a.index()] != 1);
            let extent = halved.fold(Extent::POINT, Extent::with);
            let high = Axis::ALL.into_iter().filter(|a| choice[a.index()] == 2).fold(0, |bits, a| bits | a.bit());
            let side = |corner: Corner| {
                // Towards the element from beside it; away from the middle; or in the half.
                let towards = !corner.bits() & !self.extent.bits();
                let away = corner.bits() & self.extent.bits() & !extent.bits();
                children[corner.index()][usize::from((towards | away | high) & 7)]
            };
            let [a, b, c, d, e, f, g, h] = Corner::ALL.map(side);
            if let (Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g), Some(h)) = (a, b, c, d, e, f, g, h) {
                take(DualPiece { tree: self.tree, extent, sides: [a, b, c, d, e, f, g, h] });
            }
        }
    }
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
