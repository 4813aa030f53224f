//! Blocks of 4 x 4 x 4 cells of one level, and [`Cells`]: a set of cells of a block, a bit each in one 64-bit word.
//!
//! A block is an octree cell two levels above the cells it holds, so a cell's place in it is the last six bits of its interleaved
//! position: bit `n` of a word is the cell with `n = 32 x1 + 16 y1 + 8 z1 + 4 x0 + 2 y0 + z0`. In this order the eight children
//! of one parent, a FAMILY, are one byte, and bits come in the order of a depth-first walk. A block is named by the first of its
//! cells, which also tells its level. Levels 0 and 1 have one block each, with room for more cells than they have.

use super::Key;
use super::axis::{Axis, Face};
use super::brick::Bits;
use std::ops::{BitAnd, BitOr, BitOrAssign, Not};

/// Some cells of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Cells(pub(crate) u64);

/// The first layer along each axis: the places that lack both bits of the axis.
const FIRST: [u64; 3] = [0x0000_0000_0f0f_0f0f, 0x0000_3333_0000_3333, 0x0055_0055_0055_0055];

impl Cells {
    /// No cell.
    pub(crate) const EMPTY: Cells = Cells(0);

    /// One cell, 0 ..= 63.
    #[inline]
    pub(crate) const fn one(place: u32) -> Cells {
        Cells(1 << place)
    }

    /// The cell and its seven siblings.
    #[inline]
    pub(crate) const fn family(place: u32) -> Cells {
        Cells(0xff << (place & 0o70))
    }

    /// Those cells of a block of `level` that lie in the root: all 64 but on the first two levels.
    #[inline]
    pub(crate) const fn of_level(level: u32) -> Cells {
        Cells([1, 0xff, !0][if level < 2 { level as usize } else { 2 }])
    }

    #[inline]
    pub(crate) const fn is_empty(self) -> bool {
        self.0 == 0
    }

    #[inline]
    pub(crate) const fn has(self, place: u32) -> bool {
        self.0 >> place & 1 != 0
    }

    /// How many there are before a place.
    #[inline]
    pub(crate) const fn rank(self, place: u32) -> usize {
        (self.0 & ((1 << place) - 1)).count_ones() as usize
    }

    #[inline]
    pub(crate) const fn count(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Their places, ascending.
    #[inline]
    pub(crate) fn places(self) -> Bits {
        Bits(self.0)
    }

    /// The eight bits of the family at a place, bit 0 for the child at corner 0.
    #[inline]
    pub(crate) const fn byte(self, place: u32) -> u8 {
        (self.0 >> (place & 0o70)) as u8
    }

    /// The neighbours across `face`: those in this block, and those in the next.
    #[inline]
    pub(crate) const fn moved(self, face: Face) -> (Cells, Cells) {
        let axis = face.axis();
        // The cells in layers 0 ..= 3 along the axis lie `a`, `8 a - a` and `a` places apart.
        let (a, first) = (axis.bit() as u32, FIRST[axis.index()]);
        let m = self.0;
        if face.is_high() {
            let within = (m & (first | first << (8 * a))) << a | (m & first << a) << (7 * a);
            (Cells(within), Cells((m & first << (9 * a)) >> (9 * a)))
        } else {
            let within = (m & (first << a | first << (9 * a))) >> a | (m & first << (8 * a)) >> (7 * a);
            (Cells(within), Cells((m & first) << (9 * a)))
        }
    }
}

impl BitOr for Cells {
    type Output = Cells;
    fn bitor(self, other: Cells) -> Cells {
        Cells(self.0 | other.0)
    }
}

impl BitOrAssign for Cells {
    fn bitor_assign(&mut self, other: Cells) {
        self.0 |= other.0;
    }
}

impl BitAnd for Cells {
    type Output = Cells;
    fn bitand(self, other: Cells) -> Cells {
        Cells(self.0 & other.0)
    }
}

impl Not for Cells {
    type Output = Cells;
    fn not(self) -> Cells {
        Cells(!self.0)
    }
}

/// The block `steps` (-1, 0 or 1 along each axis) from the block named `name`, by its name. `None` outside the root.
#[inline]
pub(crate) fn block_beside(name: Key, steps: [i32; 3]) -> Option<Key> {
    let side = 4 * i64::from(name.size());
    let min = name.min_corner();
    let [x, y, z] = Axis::ALL.map(|a| u32::try_from(i64::from(min[a.index()]) + side * i64::from(steps[a.index()])));
    Key::holding([x.ok()?, y.ok()?, z.ok()?], name.level()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_cell_is_its_block_and_its_place(point in [0..1u32 << 19, 0..1u32 << 19, 0..1u32 << 19], level in 0..=18u32) {
            let cell = Key::holding(point, level).expect("inside");
            let (name, place) = cell.block();
            prop_assert!(name.is_valid() && name.is_cell() && name.level() == Some(level));
            prop_assert!(Cells::of_level(level).has(place));
            prop_assert_eq!(name.in_block(place), cell);
            prop_assert_eq!(name.block(), (name, 0));
            prop_assert_eq!(place & 7, cell.corner_in_parent().index() as u32 * u32::from(level > 0));
            if level >= 2 {
                prop_assert_eq!(name.ancestor(level - 2), cell.ancestor(level - 2));
            }
        }

        #[test]
        fn moves_are_those_of_keys(mask: u64, point in [0..1u32 << 19, 0..1u32 << 19, 0..1u32 << 19], level in 2..=18u32) {
            let (name, _) = Key::holding(point, level).expect("inside").block();
            for face in Face::ALL {
                let (within, beyond) = Cells(mask).moved(face);
                let steps = Axis::ALL.map(|a| if a != face.axis() { 0 } else if face.is_high() { 1 } else { -1 });
                let next = block_beside(name, steps);
                let moved = Cells(mask).places().filter_map(|p| name.in_block(p).neighbour(face));
                let mut expected: Vec<Key> = within.places().map(|p| name.in_block(p)).collect();
                expected.extend(next.into_iter().flat_map(|next| beyond.places().map(move |p| next.in_block(p))));
                expected.sort();
                let mut moved: Vec<Key> = moved.collect();
                moved.sort();
                prop_assert_eq!(moved, expected);
            }
        }
    }
}
