//! Topology repair: cutting thin handles and filling narrow tunnels of a solid, without touching anything else.
//!
//! ```text
//! SignedOctree -> Complex -> thin -> Skeleton -> spanning forest, sections -> patches -> EditedOctree
//! ```
//!
//! (Zhou, Ju and Hu 2007; the papers and what is done differently are listed in docs/algorithms.md.)
//!
//! 1. [`Complex`]: the elements of the solid in bricks of bit planes. The background is the same thing turned over, so that all that
//!    follows is written once and cuts the solid or, from outside, fills it.
//! 2. [`thin`](thin()): elementary collapses, layer by layer, until curves are left (and sheets around cavities, and a core where a threshold says that
//!    nothing thin can be deeper). With what each element was removed is remembered: a discrete gradient.
//! 3. [`Skeleton`]: what is left, as a graph. Every loop of it is a handle.
//! 4. Sections: following the gradient back from an edge of the skeleton gives the cross-section of the handle there, a surface that
//!    ends on the surface of the solid. Its vector area is the handle's size.
//! 5. A maximum spanning forest of the graph: each arc that is left over is the thinnest of a loop.
//! 6. Patches: what flowed into that arc's thinnest edge is taken away, which removes one loop and nothing else.
//!
//! # What is certain
//!
//! - Each cut, and each fill, lowers the number of handles (b1) by exactly one, and leaves components (b0) and cavities (b2) alone. This
//!   holds for any solid, noise included: it is a property of discrete gradients and not of the shapes. ([`Betti`] counts independently.)
//! - With all handles cut, what is left of b1 are the loops inside closed sheets: the wall of a hollow tube goes round its cavity, and any cut
//!   through it opens that. With all tunnels filled, it is what no disc spans: the hole of a knot.
//! - The result depends neither on threads nor on the order of anything.
//!
//! # Cost
//!
//! Without a threshold some 4 ns for each element of the volume, 8 elements a cell, and 768 bytes a brick; with one, of the layer along the
//! surface that is as deep as the threshold is wide. Where handles are many, sections take as long again. (docs/benchmarks.md)
//!
//! ```
//! use zmend::grid::brick::{Local, Plane};
//! use zmend::grid::Key;
//! use zmend::octree::SignedOctree;
//! use zmend::octree::crossings::Sample;
//! use zmend::progress::Silent;
//! use zmend::topology::{Options, repair_topology};
//!
//! // A ring of points in a single brick: a square with a hole.
//! let mut ring = Plane::EMPTY;
//! for (x, y) in [(2, 2), (3, 2), (4, 2), (4, 3), (4, 4), (3, 4), (2, 4), (2, 3)] {
//!     ring.set(Local::new(x, y, 3));
//! }
//! let brick = Key::cell(1, [0, 0, 0]).unwrap();
//! let samples = |_: usize, crossed: &[Plane; 3], list: &mut Vec<Sample>| {
//!     let count: u32 = crossed.iter().map(Plane::count).sum();
//!     list.extend((0..count).map(|_| Sample::new(1 << 15, 0)));
//! };
//! let solid = SignedOctree::from_signs(4, false, &[(brick, ring)], |_| false, samples);
//!
//! let fill = Options { fill: Some(10.0), ..Options::default() };
//! let (filled, report) = repair_topology(solid, &fill, &Silent)?;
//! assert_eq!((report.before.handles, report.after.handles), (1, 0));
//! assert_eq!(report.fills[0].squares, 4);
//! assert!(filled.validate().is_ok());
//! # Ok::<(), zmend::Error>(())
//! ```

mod betti;
mod collapse;
mod complex;
mod conform;
mod flow;
mod label;
mod member;
mod mend;
mod options;
#[cfg(test)]
mod oracle;
mod patch;
mod section;
mod skeleton;
mod sketch;
mod span;
#[cfg(test)]
mod tests;
mod thin;
mod volumes;

pub use betti::Betti;
pub use complex::{Complex, Side};
pub use conform::conform;
pub use member::Members;
pub use mend::{Handle, Kind, Loops, Round, TopologyReport, handles, layers, repair_topology, repair_topology_watched};
pub use options::{Measure, Options};
pub use skeleton::{Arc, Node, Skeleton};
pub use sketch::Sketch;
pub use thin::{Thinned, thin};
pub use volumes::{move_small, volumes};
