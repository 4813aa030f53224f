//! Inside and outside by winding number: how often the oriented surface goes round a point.
//!
//! Parity asks how many walls lie between a point and the outside; the winding number asks how many more are entered than left. Where
//! solids overlap it is 2 and not 0, so that they become their union; walls inside of a solid, and pairs of coincident walls, are neither
//! here nor there. And it bears holes: the solid angle under which the surface is seen, over that of the sphere, is a winding number that
//! need not be whole (Jacobson, Kavan and Sorkine-Hornung 2013, "Robust inside-outside segmentation using generalized winding numbers").
//!
//! No triangle is looked at again. What is known are the jumps c of the winding number along the edges of the grid ([`OrientedHits`](crate::octree::OrientedHits)).
//!
//! 1. [`circulations`]: where jumps round a grid face do not add up to 0, the boundary of the surface passes.
//! 2. Without any, winding numbers are whole, and prefix sums along x tell them for 64 lines at once ([`WholeNumbers`]). Inside is where
//!    the number is not 0: the rule *nonzero* of drawing programs, to which it makes no difference if a solid is turned inside out.
//! 3. Else the boundary falls into oriented rings, and each is spanned by a [patch](Patches), as holes are [closed](super::close()).
//!    With the patches' jumps d, c + d has no circulation, and prefix sums give whole numbers p.
//! 4. The generalised winding number is w = p - s, where s, the part of the patches, is smooth but for them, and found from coarse to
//!    fine on the bricks where it matters (`field`). What patches were chosen makes no difference to w.
//! 5. Inside is where w is above one half, counted in the sense in which the whole of the input is oriented: if c + d encloses a negative
//!    volume, all is taken as turned inside out, and a surface and its reverse come to exactly the same. (Not where its amount is above one half: on the outer side of an open, nearly flat or
//!    hollow piece of surface w comes near to -1/2 or goes below.)
//! 6. An edge whose ends differ is crossed at the hit by which it passes one half; where no hit does, which is in holes, where the line
//!    between the values at its ends does, with the gradient of w as normal.
//!
//! Points on the boundary of the root are outside: what reaches it is clipped there.
//!
//! Cost: without holes that of parity. With holes, that of closing them and about 8 us more for each brick near a patch or a wall of w = 1/2.

mod circulation;
mod field;
mod levels;
mod net;
mod open;
mod relax;
mod samples;
mod sources;
mod whole;
mod world;

pub use circulation::{Circulation, circulations};
pub use open::{Patches, Winding, winding_signs};
pub use whole::WholeNumbers;

#[cfg(test)]
mod tests;
