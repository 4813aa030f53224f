//! The integer side of the octree: the parts of a cell, the keys of its elements, bricks of bits. No floats, no map.
//!
//! A cell has 8 corners, 12 edges and 6 faces, named by the newtypes of [`axis`]. Every point, edge, face and cell of
//! every level is named by one packed 64-bit [`Key`], and whatever incidence is needed is arithmetic on keys.

pub mod axis;
pub(crate) mod block;
pub mod brick;
pub mod cases;
pub mod flood;
pub mod key;
pub mod subcomplex;

pub use axis::{Axis, Corner, Direction, Edge, Extent, Face};
pub use key::Key;
