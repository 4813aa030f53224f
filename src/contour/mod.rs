//! Signs to surface: the boundary of the solid as a mesh.
//!
//! Both extractors walk over bricks, look at 512 cells at a time (`octree::cells`) and use the derived tables of
//! [`grid::cases`](crate::grid::cases), so they agree on the topology. They pass the mesh on as it is made: first the points of all
//! bricks, then the faces, in the order of the bricks; the mesh as a whole is never held.

mod crease;
mod cubes;
mod disjoint;
mod dual;
mod edited;
mod envelope;
mod knots;
mod layout;
mod place;
mod points;
#[cfg(test)]
mod tests;
pub mod volume;

pub use cubes::marching_cubes;
pub use dual::{DualOptions, Intersections, Placement, dual_contouring};
pub use edited::dual_contouring_edited;
pub use points::CellVertices;

/// Bricks of a piece: some five thousand cells, whose points and faces stay in the cache until they are taken.
const PIECE: usize = 64;
