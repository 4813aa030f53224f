//! Fields from fields: joined, cut, moved, mixed.

use super::Field;
use crate::error::{Error, Result};
use crate::grid::Key;
use crate::grid::key::SIDE;
use crate::octree::{LinearOctree, NodalOctree};
use crate::progress::Progress;
use glam::DVec3;

/// Fields on the same root cube, each as fine as it is; the deeper frame is that of the result.
///
/// Leaves are split where the surface passes through the crease between both fields, down to the frame's depth. So edges between two solids
/// are as sharp as the finest cells, whatever leaves the fields have there.
impl Field {
    /// What is inside one or the other.
    ///
    /// # Errors
    /// When the fields have different root cubes; `Cancelled`, and `Memory` when `progress` says so.
    pub fn union(&self, other: &Field, progress: &dyn Progress) -> Result<Field> {
        self.combined(other, f64::min, |a, b| a - b, progress)
    }

    /// What is inside both.
    ///
    /// # Errors
    /// As [`union`](Field::union).
    pub fn intersection(&self, other: &Field, progress: &dyn Progress) -> Result<Field> {
        self.combined(other, f64::max, |a, b| a - b, progress)
    }

    /// What is inside this one and not inside the other.
    ///
    /// # Errors
    /// As [`union`](Field::union).
    pub fn difference(&self, other: &Field, progress: &dyn Progress) -> Result<Field> {
        self.combined(other, |a, b| a.max(-b), |a, b| a + b, progress)
    }

    /// What lies between both: this one for a `share` of 0, the other for 1. Where the fields are distances, solids pass into each other
    /// smoothly as the share grows.
    ///
    /// # Errors
    /// When the share is no number from 0 to 1, and as [`union`](Field::union).
    pub fn morph(&self, other: &Field, share: f64, progress: &dyn Progress) -> Result<Field> {
        if !(0.0..=1.0).contains(&share) {
            return Err(Error::setting("share", format!("{share} is not 0 to 1"), "0.5 is half way"));
        }
        // It has no crease, so it is refined wherever the surface is.
        self.combined(other, |a, b| (1.0 - share) * a + share * b, |_, _| 0.0, progress)
    }

    /// The solid grown by a distance, or shrunk where it is negative, if the field is one of distances: values less that distance. The
    /// field is as fine as it is there, which it may not be far from the old surface.
    #[must_use]
    pub fn offset(&self, distance: f64) -> Field {
        let tree = self.nodes.tree().clone();
        let old = |point: Key| self.nodes.value(point).expect("the same tree has the same nodes");
        Field { nodes: NodalOctree::with_values(tree, |point| old(point) - distance), frame: self.frame }
    }

    /// A field of both, on the finer leaves of both. `crease` tells which of the two it is by its sign; leaves with surface where that
    /// changes are split.
    fn combined(
        &self,
        other: &Field,
        both: impl Fn(f64, f64) -> f64 + Sync,
        crease: impl Fn(f64, f64) -> f64 + Sync,
        progress: &dyn Progress,
    ) -> Result<Field> {
        let frames = [&self.frame, &other.frame];
        if frames[0].cube() != frames[1].cube() {
            let cubes = frames.map(|frame| format!("{} + {}", frame.origin(), frame.size()));
            let problem = format!("the fields lie in different cubes, {} and {}", cubes[0], cubes[1]);
            return Err(Error::setting("box", problem, "make both on the same frame"));
        }
        let frame = *frames.into_iter().max_by_key(|frame| frame.depth()).expect("two");
        // Places in the root are places of both.
        let values = |p: DVec3| [self, other].map(|field| field.value_at(p).unwrap_or(f64::INFINITY));
        let function = |p: DVec3| {
            let [a, b] = values(p);
            both(a, b)
        };
        let field = Field::on_tree(frame, self.finer_leaves(other), &function, progress)?;
        let at_node = |point: Key| {
            let at = point.center().map(f64::from);
            let [a, b] = [self, other].map(|field| field.nodes.value_at(at).unwrap_or(f64::INFINITY));
            crease(a, b)
        };
        let has_crease = |field: &Field, leaf: Key| {
            let signs = leaf.corners().map(&at_node);
            let (least, most) =
                signs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &s| (a.min(s), b.max(s)));
            least <= 0.0 && most >= 0.0 && field.is_mixed(leaf)
        };
        field.refined_where(&function, has_crease, progress)
    }

    /// The leaves of both trees that have no leaves of the other inside.
    fn finer_leaves(&self, other: &Field) -> LinearOctree<()> {
        let (a, b) = (self.nodes.tree(), other.nodes.tree());
        let finer = |one: &LinearOctree<()>, two: &LinearOctree<()>| -> Vec<Key> {
            one.iter_z().map(|(leaf, ())| leaf).filter(|&leaf| !two.state(leaf).is_refined()).collect()
        };
        let own = finer(a, b);
        // Leaves of both are taken once.
        let others = finer(b, a).into_iter().filter(|&leaf| !a.contains(leaf));
        debug_assert!(own.iter().all(|leaf| leaf.size() <= SIDE), "cells of the root");
        own.into_iter().chain(others).map(|leaf| (leaf, ())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Adapt;
    use crate::geom::Frame;
    use crate::progress::Silent;

    fn frame() -> Frame {
        Frame::new(DVec3::splat(-2.0), 4.0, 6).expect("a cube")
    }

    fn ball(centre: f64, radius: f64, tolerance: f64) -> Field {
        let ball = |p: DVec3| p.distance(DVec3::new(centre, 0.1, 0.0)) - radius;
        Field::build(frame(), &ball, Adapt { tolerance, ..Adapt::default() }, &Silent).expect("a field")
    }

    /// Signs at all points of a coarser lattice, by the field and by numbers, away from the surface.
    fn agrees(field: &Field, expected: impl Fn(DVec3) -> f64) {
        let mut checked = 0;
        for n in 0..23i32.pow(3) {
            let p = DVec3::new(f64::from(n % 23), f64::from(n / 23 % 23), f64::from(n / 529)) / 6.0 - 11.0 / 6.0;
            let expected = expected(p);
            if expected.abs() > 0.1 {
                assert_eq!(field.value_at(p).expect("inside") < 0.0, expected < 0.0, "{p} {expected}");
                checked += 1;
            }
        }
        assert!(checked > 8000, "{checked}");
    }

    #[test]
    fn sets_are_sets() {
        let at = |p: DVec3, c: f64, r: f64| p.distance(DVec3::new(c, 0.1, 0.0)) - r;
        for tolerance in [0.0, 0.05] {
            let (a, b) = (ball(-0.5, 1.0, tolerance), ball(0.6, 0.9, tolerance));
            let union = a.union(&b, &Silent).expect("a union");
            agrees(&union, |p| at(p, -0.5, 1.0).min(at(p, 0.6, 0.9)));
            agrees(&a.intersection(&b, &Silent).expect("both"), |p| at(p, -0.5, 1.0).max(at(p, 0.6, 0.9)));
            agrees(&a.difference(&b, &Silent).expect("one"), |p| at(p, -0.5, 1.0).max(-at(p, 0.6, 0.9)));
            agrees(&b.difference(&a, &Silent).expect("the other"), |p| at(p, 0.6, 0.9).max(-at(p, -0.5, 1.0)));
            agrees(&a.morph(&b, 0.25, &Silent).expect("between"), |p| 0.75 * at(p, -0.5, 1.0) + 0.25 * at(p, 0.6, 0.9));
            agrees(&a.offset(0.2), |p| at(p, -0.5, 1.2));
            // Along the crease there are finest leaves, whatever the balls have.
            let crease = DVec3::new(0.05 + 0.09 / 2.2 * 0.5, 0.1 + 0.8, 0.0);
            let point = ((crease - frame().origin()) * (f64::from(SIDE) / 4.0)).to_array().map(|c| c as u32);
            let around = union.nodes().tree().leaves_in_box(point.map(|c| c - 9000), point.map(|c| c + 9000));
            assert!(around.map(|(leaf, ())| leaf.level()).max() == Some(Some(6)), "{tolerance}");
        }
    }

    #[test]
    fn cubes_must_agree() {
        let a = ball(0.0, 1.0, 0.1);
        let other = Frame::new(DVec3::splat(-2.5), 5.0, 6).expect("a cube");
        let b = Field::build(other, &|p: DVec3| p.x, Adapt::default(), &Silent).expect("a field");
        assert!(
            a.union(&b, &Silent).expect_err("different").to_string().starts_with("box: the fields lie in different")
        );
        assert!(a.morph(&a, 1.5, &Silent).is_err() && a.morph(&a, f64::NAN, &Silent).is_err());
    }
}
