//! Topology repair.
mod betti;
mod complex;
mod label;
mod mend;
#[cfg(test)]
mod oracle;
mod patch;
mod section;
mod skeleton;
mod span;
#[cfg(test)]
mod tests;
mod thin;
mod volumes;

pub use betti::Betti;
pub use complex::{Complex, Side};
pub use mend::{Handle, Kind, Loops, Options, TopologyReport, handles, layers, repair_topology};
pub use skeleton::{Arc, Node, Skeleton};
pub use thin::{Thinned, thin};
pub use volumes::{move_small, volumes};
