//! Inside and outside by winding number: how often the oriented surface goes round a point.
//!
//! Parity asks how many walls lie between a point and the outside; the winding number asks how many more are entered than left. Where
//! solids overlap it is 2 and not 0, so that they become their union; walls inside of a solid, and pairs of coincident walls, are neither
//! here nor there. And it bears holes: the solid angle under which the surface is seen, over that of the sphere, is a winding number that
//! need not be whole (Jacobson, Kavan and Sorkine-Hornung 2013, "Robust inside-outside segmentation using generalized winding numbers").
//!
//! What is known first are the jumps of the winding number along the edges of the grid ([`OrientedHits`](crate::octree::OrientedHits)).
//!
//! 1. [`circulations`]: where jumps round a grid face do not add up to 0, the boundary of the surface passes.
//! 2. Without any, winding numbers are whole, and prefix sums along x tell them for 64 lines at once ([`WholeNumbers`]). Inside is where
//!    the number is not 0: the rule *nonzero* of drawing programs, to which it makes no difference if a solid is turned inside out.
//! 3. Else the triangles are looked at once more for the [`Boundary`], which falls into oriented rings, and these are spanned by
//!    [`Patches`]. Surface and patches together are closed, so prefix sums of both give whole numbers n.
//! 4. The generalised winding number is w = n + s, where s is the solid angle of the patches turned round (`span`). What patches were chosen
//!    makes no difference to w. Inside is where w is above one half, in the sense in which most of the input is oriented. (Not where its
//!    amount is above one half: on the outer side of an open, nearly flat or hollow piece of surface w comes near to -1/2 or goes below.)
//!    Only near the boundary and where w passes one half is s looked at by the point (`open`).
//! 5. An edge whose ends differ is crossed at the hit by which it passes one half; where no hit does, which is in holes, where the
//!    tangent of w at the edge's middle does, with the gradient of w as normal.
//!
//! Points on the boundary of the root are outside: what reaches it is clipped there.
//!
//! Cost: without holes that of parity. With holes, a pass over the source, and 50 to 500 us more for each brick near the boundary of the
//! surface or where w = 1/2 in a hole.

mod boundary;
mod circulation;
mod field;
mod levels;
mod net;
mod open;
mod patches;
mod polynomial;
mod samples;
mod span;
mod view;
mod whole;

pub use boundary::Boundary;
pub use circulation::{Circulation, circulations};
pub use open::{Winding, winding_signs};
pub use patches::Patches;
pub use whole::WholeNumbers;

#[cfg(test)]
mod tests;
