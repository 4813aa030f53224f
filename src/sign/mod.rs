//! Soup to signs: scan the triangles, close the holes, tell inside from outside.
//!
//! ```text
//! triangles -> scan -> Crossings -> close -> Crossings without odd faces -> parity -> SignedOctree
//! ```

mod close;
mod hits;
mod parity;
mod scan;
mod walls;
pub mod winding;

pub use close::{Closing, close};
pub use parity::parity_signs;
pub use scan::{OrientedScan, Scan, ScanCounts, expected_hits, scan, scan_oriented};
