//! Floating parts and cavities by size: whole [`Components`] change sides.
//!
//! A part of the solid that is dropped, or a cavity that is filled, takes all crossings around it away: its points get the sign of what
//! surrounds them, and nothing else changes. Cost: that of [`Components`], whatever the volume.

use super::complex::Side;
use crate::octree::SignedOctree;
use crate::octree::components::{Component, Components};

/// Components of one side by volume in lattice points (one a cell), ascending: floating parts of the object, cavities of the background.
pub fn volumes(signed: &SignedOctree, side: Side) -> Vec<u64> {
    let components = Components::new(signed);
    let of_side = |c: &&Component| c.is_inside == (side == Side::Object);
    // The first is the outer space.
    let mut list: Vec<u64> = components.list()[1..].iter().filter(of_side).map(|c| c.points).collect();
    list.sort_unstable();
    list
}

/// Moves all components of up to `volume` lattice points to the other side: floating parts vanish, cavities are filled. The outside is never
/// filled. Returns the octree and the number of components moved.
pub fn move_small(signed: SignedOctree, side: Side, volume: f64) -> (SignedOctree, u64) {
    let components = Components::new(&signed);
    let list = components.list();
    let is_small = |i: u32| {
        let component = &list[i as usize];
        i > 0 && component.is_inside == (side == Side::Object) && component.points as f64 <= volume
    };
    let moved = (0..list.len() as u32).filter(|&i| is_small(i)).count() as u64;
    if moved == 0 {
        return (signed, 0);
    }
    (components.without(is_small), moved)
}
