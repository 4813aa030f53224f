//! Topology repair.
pub mod betti;
pub mod complex;
mod label;
pub mod thin;
#[cfg(test)]
mod oracle;
pub use betti::Betti;
pub use complex::{Complex, Side};
