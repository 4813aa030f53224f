//! octree
