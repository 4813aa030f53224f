//! Floating-point and fixed-point geometry: the frame between model and lattice, exact rasterisation, QEF.

pub mod frame;
pub mod normal;
pub mod qef;
pub mod raster;
pub(crate) mod triangle;

pub use frame::{Cube, Frame};
