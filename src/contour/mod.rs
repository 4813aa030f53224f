//! Signs to surface: the boundary of the solid as a mesh.
//!
//! Both extractors walk over bricks, look at 512 cells at a time ([`cells`]) and use the derived tables of
//! [`grid::cases`](crate::grid::cases), so they agree on the topology. They pass the mesh on as it is made: first the points of all
//! bricks, then the faces, in the order of the bricks; the mesh as a whole is never held.

mod cells;
mod cubes;
mod dual;
mod stream;

pub use cubes::marching_cubes;
pub use dual::{DualOptions, Placement, dual_contouring};
