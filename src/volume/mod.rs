//! Volumes.

pub mod image;

pub use image::{Image, Placement, Voxels};
