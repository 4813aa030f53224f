//! Memory in blocks of 1 MB, from which nodes are taken one by one and given back all at once.

use std::cell::{Cell, OnceCell};

/// Bytes of a block.
const BLOCK: usize = 1 << 20;

/// One block, and the next one.
struct Block<T> {
    slots: Box<[T]>,
    next: OnceCell<Box<Block<T>>>,
}

impl<T: Default> Block<T> {
    fn new() -> Self {
        let count = (BLOCK / size_of::<T>()).max(1);
        Block { slots: (0..count).map(|_| T::default()).collect(), next: OnceCell::new() }
    }
}

/// Values of one type, side by side in blocks; what is taken lives as long as the blocks. Cost: a comparison and an addition each.
pub(crate) struct Blocks<'a, T> {
    first: OnceCell<Box<Block<T>>>,
    current: Cell<Option<&'a Block<T>>>,
    used: Cell<usize>,
    taken: Cell<usize>,
}

impl<T> Default for Blocks<'_, T> {
    fn default() -> Self {
        Blocks { first: OnceCell::new(), current: Cell::new(None), used: Cell::new(0), taken: Cell::new(0) }
    }
}

impl<'a, T: Default> Blocks<'a, T> {
    /// The next value, as [`Default`] makes it.
    #[inline]
    pub(crate) fn take(&'a self) -> &'a T {
        let used = self.used.get();
        if let Some(slot) = self.current.get().and_then(|block| block.slots.get(used)) {
            self.used.set(used + 1);
            self.taken.set(self.taken.get() + 1);
            return slot;
        }
        self.grow();
        self.take()
    }

    #[cold]
    fn grow(&'a self) {
        let next = self.current.get().map_or(&self.first, |block| &block.next);
        self.current.set(Some(next.get_or_init(|| Box::new(Block::new()))));
        self.used.set(0);
    }

    /// Values taken so far.
    pub(crate) fn taken(&self) -> usize {
        self.taken.get()
    }
}
