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
    let moved = moved(&components, side, |_, component| component.points as f64 <= volume);
    moved.unwrap_or((signed, 0))
}

/// Drops all solids of which none of some lattice points, in cells, is a part. Returns the octree, the number of solids dropped, and of those that
/// are left.
pub(super) fn drop_untouched(
    signed: &SignedOctree,
    points: impl Iterator<Item = [u32; 3]>,
) -> (SignedOctree, u64, u64) {
    let components = Components::new(signed);
    let mut touched = vec![false; components.list().len()];
    points.for_each(|at| touched[components.of_point(at) as usize] = true);
    let left = components.list().iter().zip(&touched).filter(|(component, touched)| component.is_inside && **touched);
    let left = left.count() as u64;
    let (octree, dropped) =
        moved(&components, Side::Object, |i, _| !touched[i as usize]).unwrap_or_else(|| (signed.clone(), 0));
    (octree, dropped, left)
}

/// Moves those components of a side for which the answer is yes to the other side; none if there are none. The outside is never filled.
fn moved(
    components: &Components<'_>,
    side: Side,
    is_moved: impl Fn(u32, &Component) -> bool + Sync,
) -> Option<(SignedOctree, u64)> {
    let list = components.list();
    let is_moved = |i: u32| {
        let component = &list[i as usize];
        i > 0 && component.is_inside == (side == Side::Object) && is_moved(i, component)
    };
    let count = (0..list.len() as u32).filter(|&i| is_moved(i)).count() as u64;
    (count > 0).then(|| (components.without(is_moved), count))
}
