//! zmend makes unusable solids usable.
#![forbid(unsafe_code)]

pub mod contour;
pub mod error;
pub mod geom;
pub mod grid;
pub mod io;
pub mod mesh;
pub mod octree;
mod parallel;
pub mod progress;
#[cfg(feature = "render")]
pub mod render;
pub mod repair;
pub mod sign;

pub use error::{Error, Place, Result};
pub use mesh::{Mesh, Polygons};
pub use repair::{Faces, Options, RepairReport, Repaired, Surface, repair, repair_into};
