//! Which solids stay, and whether their cavities do.
//!
//! Signs are changed and not meshes, so every surface extracted from them has the same components. Solids are chosen first, then cavities
//! are filled, those that a dropped solid lay in included.

use crate::error::{Error, Result};
use crate::octree::components::{Component, Components, component_bytes};
use crate::octree::signed::SignedOctree;
use crate::progress::{Progress, check};
use std::cmp::Reverse;

/// Which solids stay. Their size is the number of grid edges that their surfaces cross, as in `PolyMender`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Keep {
    /// All.
    #[default]
    All,
    /// The largest, and others of the same size.
    Largest,
    /// Those that have at least this part of the size of the largest one, rounded down: 0 keeps all, 1 as [`Keep::Largest`].
    Ratio(f64),
    /// So many at most, from the largest down; of equal ones those that come first in Z-order.
    Count(u32),
}

/// What [`keep`] found and did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Kept {
    /// Solids before.
    pub solids: u64,
    /// Solids that were dropped.
    pub dropped_solids: u64,
    /// Their volume in cells.
    pub dropped_cells: u64,
    /// Cavities of the solids that stay.
    pub cavities: u64,
    /// Cavities that were filled.
    pub filled_cavities: u64,
    /// Their volume in cells, without what was in them.
    pub filled_cells: u64,
}

impl Keep {
    /// # Errors
    /// When a ratio is not in 0 ..= 1, or no solid may stay.
    pub fn check(self) -> Result<()> {
        match self {
            Keep::Ratio(ratio) if !(0.0..=1.0).contains(&ratio) => Err(Error::setting(
                "keep",
                format!("{ratio} is not a part of the largest component"),
                "a ratio from 0 to 1 keeps what is at least so large, `largest` the largest one",
            )),
            Keep::Count(0) => Err(Error::setting("keep", "0 components leave nothing", "`largest` keeps one")),
            _ => Ok(()),
        }
    }

    /// For each component whether it is a solid to be dropped.
    fn drops(self, list: &[Component]) -> Vec<bool> {
        let largest = list.iter().filter(|c| c.is_inside).map(|c| c.edges).max().unwrap_or(0);
        let least = match self {
            Keep::All => 0,
            Keep::Largest => largest,
            Keep::Ratio(ratio) => (largest as f64 * ratio) as u64,
            Keep::Count(count) => {
                let mut solids: Vec<usize> = (0..list.len()).filter(|&i| list[i].is_inside).collect();
                solids.sort_by_key(|&i| Reverse(list[i].edges));
                let mut drops = vec![false; list.len()];
                solids.iter().skip(count as usize).for_each(|&i| drops[i] = true);
                return drops;
            }
        };
        list.iter().map(|c| c.is_inside && c.edges < least).collect()
    }
}

/// Drops solids and fills cavities. Without either, nothing is done and nothing counted.
///
/// Cost: linear in bricks; that of [`Components`] for each of both.
///
/// # Errors
/// As [`Keep::check`]; `Cancelled`, and `Memory` when `progress` says so.
pub fn keep(
    mut octree: SignedOctree,
    keep: Keep,
    drop_cavities: bool,
    progress: &dyn Progress,
) -> Result<(SignedOctree, Kept)> {
    keep.check()?;
    let mut kept = Kept::default();
    if keep == Keep::All && !drop_cavities {
        return Ok((octree, kept));
    }
    progress.hold(component_bytes(&octree) as u64)?;
    let components = Components::new(&octree);
    check(progress)?;
    kept.solids = components.solids().count() as u64;
    kept.cavities = components.cavities().count() as u64;
    let drops = keep.drops(components.list());
    for (component, _) in components.list().iter().zip(&drops).filter(|(_, drops)| **drops) {
        kept.dropped_solids += 1;
        kept.dropped_cells += component.points;
    }
    if kept.dropped_solids > 0 {
        octree = components.without(|c| drops[c as usize]);
        check(progress)?;
    }
    if kept.dropped_solids > 0 && kept.cavities > 0 {
        // Cavities may have gone with their solids, or have become one with another.
        kept.cavities = Components::new(&octree).cavities().count() as u64;
        check(progress)?;
    }
    if drop_cavities && kept.cavities > 0 {
        let components = Components::new(&octree);
        check(progress)?;
        kept.filled_cavities = kept.cavities;
        kept.filled_cells = components.cavities().map(|c| c.points).sum();
        let fills: Vec<bool> = components.list().iter().enumerate().map(|(i, c)| i > 0 && !c.is_inside).collect();
        octree = components.without(|c| fills[c as usize]);
    }
    Ok((octree, kept))
}
