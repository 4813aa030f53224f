//! Disjoint sets that several threads may join at once.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// A partition of `0 .. n`, at first into single elements. Four bytes an element.
///
/// Each set is a tree whose root is its least element (links point downwards), so the partition that a set of unions leads
/// to, and the number of those that joined anything, depend neither on their order nor on the threads that made them.
/// Relaxed loads and stores suffice: nothing is read but the links themselves, and any link ever seen stays true.
pub(crate) struct Sets {
    parent: Vec<AtomicU32>,
}

impl Sets {
    /// `n` single elements; `n` is below 2^32.
    pub(crate) fn new(n: usize) -> Self {
        Sets { parent: (0..n as u32).map(AtomicU32::new).collect() }
    }

    /// Joins the sets of two elements. Whether they were different until now.
    pub(crate) fn union(&self, a: u32, b: u32) -> bool {
        let (mut a, mut b) = (a, b);
        loop {
            (a, b) = (self.root(a), self.root(b));
            if a == b {
                return false;
            }
            let (low, high) = (a.min(b), a.max(b));
            // Fails when another thread has linked `high` meanwhile: then it is no root any more.
            if self.parent[high as usize].compare_exchange(high, low, Relaxed, Relaxed).is_ok() {
                return true;
            }
        }
    }

    /// The least element of the set of `a`. Follows links to the root; each element passed is linked to its grandparent on the way.
    pub(crate) fn root(&self, mut a: u32) -> u32 {
        loop {
            let parent = self.parent[a as usize].load(Relaxed);
            if parent == a {
                return a;
            }
            let grandparent = self.parent[parent as usize].load(Relaxed);
            if grandparent != parent {
                self.parent[a as usize].store(grandparent, Relaxed);
            }
            a = grandparent;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn unions_in_any_order_by_any_thread_leave_the_same_sets() {
        let n = 10_000u32;
        let sets = Sets::new(n as usize);
        let joined = (0..n - 7).into_par_iter().filter(|&i| sets.union(i, i + 7)).count();
        assert_eq!(joined, n as usize - 7);
        assert!((0..n).all(|i| sets.root(i) == i % 7));
        assert!(!sets.union(3, 10) && sets.union(3, 4) && !sets.union(10, 11));
    }
}
