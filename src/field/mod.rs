//! Level sets on octrees: functions of space, negative inside, sampled where it matters.
//!
//! A [`Field`] has values at the corners of the leaves of an octree and is continuous between them (see [`NodalOctree`](crate::octree::NodalOctree)). It is made of any
//! [`Function`], fine where the surface is curved and coarse elsewhere; of a mesh, by distance from the solid that it encloses, by
//! [`Solid::distance_field`](crate::Solid::distance_field); or of [points](crate::cloud). Fields can be joined, cut, moved and mixed
//! ([`union`](Field::union), [`intersection`](Field::intersection), [`difference`](Field::difference), [`offset`](Field::offset),
//! [`morph`](Field::morph)).
//!
//! # Surfaces
//!
//! [`Field::signed`] tells the signs of all finest lattice points, in bricks along the surface, and where it crosses the edges between
//! them. Since the field is continuous across leaves of different size, so are the signs: there is nothing to be closed where small leaves
//! meet large ones, and the contour has all the guarantees of signed octrees. It is as fine as the finest leaf everywhere. A field is a
//! [`Volume`](crate::volume::Volume), too, for [`contour::volume`](crate::contour::volume).
//!
//! ```
//! use zmend::field::{Adapt, Field};
//! use zmend::geom::Frame;
//! use zmend::glam::DVec3;
//! use zmend::progress::Silent;
//! use zmend::{Mesh, Options, Solid};
//!
//! let frame = Frame::new(DVec3::splat(-2.0), 4.0, 6)?;
//! let ball = |p: DVec3| p.length() - 1.5;
//! let pole = |p: DVec3| p.x.hypot(p.y) - 0.7;
//! let [ball, pole] = [&ball as &(dyn Fn(DVec3) -> f64 + Sync), &pole]
//!     .map(|shape| Field::build(frame, &shape, Adapt::default(), &Silent));
//! let ring = ball?.difference(&pole?, &Silent)?;
//! let solid = Solid::new(ring.signed(&Silent)?, frame);
//! let mut mesh = Mesh::default();
//! solid.extract(&Options::default(), &mut mesh, &Silent)?;
//! assert_eq!((mesh.validate(), mesh.report().euler), (Ok(()), 0));
//! # Ok::<(), zmend::Error>(())
//! ```
//!
//! # Cells
//!
//! [`Hexahedra`] are the leaves of such a tree as elements of a simulation, sorted into inside, outside and cut: see
//! [`Solid::cells`](crate::Solid::cells), and [`Solid::distance_field`](crate::Solid::distance_field) for the distance from any solid.
//!
//! # Cost
//!
//! 20 to 40 bytes a node in a hash table, 4 a leaf. About 1.2 nodes a leaf near a surface. Each node is asked for once.

mod build;
pub(crate) mod cells;
mod combine;
mod function;
mod signed;

pub use build::{Adapt, Field};
pub use cells::{Hexahedra, Side};
pub use function::{Edge, Function, Zero};
