//! Inside and outside by counting crossings.
//!
//! Once no face is odd, any two ways from a lattice point to the outside cross the surface equally often mod 2: the orientation of the
//! input's faces plays no part. The counting is [`SignedOctree::from_crossings`].

use crate::octree::crossings::Crossings;
use crate::octree::signed::SignedOctree;

/// Gives each lattice point of each brick its sign.
///
/// `crossings` must have no odd faces ([`Crossings::odd_faces`]).
pub fn parity_signs(crossings: Crossings) -> SignedOctree {
    SignedOctree::from_crossings(crossings)
}
