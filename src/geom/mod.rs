//! Floating-point and fixed-point geometry: the frame and the domain between model and lattice, exact rasterisation, QEF.

pub mod bounds;
pub mod domain;
pub mod frame;
pub mod normal;
pub mod qef;
pub mod raster;
pub(crate) mod triangle;

pub use bounds::Bounds;
pub use domain::{Domain, Outside};
pub use frame::{Cube, Frame};
