//! A cell as a place in a block of 4 x 4 x 4.

use super::{CELL, CODE, Key};

/// Blocks: see [`grid::block`](crate::grid::block). Domain: cells.
impl Key {
    /// The first cell of its block, which names it, and its place there, 0 ..= 63.
    #[inline]
    pub(crate) const fn block(self) -> (Key, u32) {
        let shift = self.0.trailing_zeros() + 3;
        let place = (self.0 & CODE) >> shift & 0o77;
        (Key(self.0 & !(0o77 << shift) | CELL), place as u32)
    }

    /// The cell at a place of the block that `self` names.
    #[inline]
    pub(crate) const fn in_block(self, place: u32) -> Key {
        let shift = self.0.trailing_zeros() + 3;
        Key(self.0 | ((place as u64) << shift & CODE))
    }
}
