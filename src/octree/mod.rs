//! octree
pub mod crossings;
pub mod signed;
use crate::grid::Key;
pub use crossings::Crossings;
use hashbrown::HashMap;
pub use signed::SignedOctree;
#[derive(Debug, Clone)]
pub struct LinearOctree<T>(HashMap<Key, T, ahash::RandomState>);
impl<T> LinearOctree<T> {
    pub fn with_capacity(n: usize) -> Self {
        Self(HashMap::with_capacity_and_hasher(n, ahash::RandomState::with_seeds(1, 2, 3, 4)))
    }
    pub fn insert(&mut self, k: Key, t: T) -> Option<T> {
        self.0.insert(k, t)
    }
    pub fn get(&self, k: Key) -> Option<&T> {
        self.0.get(&k)
    }
    pub fn len(&self) -> usize {
        self.0.len()
    }
    pub fn bytes(&self) -> usize {
        self.0.allocation_size()
    }
}
