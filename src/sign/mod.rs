//! Soup to signs: scan the triangles, close the holes, tell inside from outside.
//!
//! ```text
//! triangles -> scan -> Crossings -> close -> Crossings without odd faces -> parity -> SignedOctree
//! ```

mod band;
mod close;
mod hits;
mod hull;
mod keep;
mod offset;
mod parity;
mod scan;
mod thicken;
mod walls;
pub mod winding;

pub use band::{Band, MOST_CELLS};
pub use close::{Closing, close};
pub use hull::{hull, hull_with_gap};
pub use keep::{Keep, Kept, keep};
pub use offset::{Offset, offset};
pub use parity::parity_signs;
pub use scan::{OrientedScan, Scan, ScanCounts, expected_hits, scan, scan_oriented};
pub use thicken::{Thicken, check_gap, check_width, thicken, vanished};
