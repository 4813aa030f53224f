//! What topology repair is asked for.

use super::complex::Side;
use crate::error::{Error, Result};

/// What to repair; `Options { cut: Some(20.0), ..Options::default() }`. By default, nothing.
///
/// Lengths are in cells of the finest level, areas in their squares, volumes in their cubes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// Cut handles of up to this cross-section; infinity: all that a patch can cut.
    pub cut: Option<f64>,
    /// Fill tunnels of up to this cross-section, after cutting.
    pub fill: Option<f64>,
    /// Remove the smallest handles and tunnels, by cut or fill, whichever changes fewer cells, until at most so many handles are left. `cut`
    /// and `fill`, where given, bound what may be used.
    pub genus: Option<u64>,
    /// Decide for each loop whether to cut or to fill, whichever changes fewer cells, instead of cutting first. `cut` and `fill` bound what may
    /// be used, without a bound where they are not given.
    pub cheapest: bool,
    /// Fill cavities of up to this volume.
    pub fill_cavities: Option<f64>,
    /// Drop floating parts of up to this volume.
    pub drop_islands: Option<f64>,
    /// What `cut` and `fill` are compared with. Default [`Measure::Area`].
    pub measure: Measure,
}

/// How large a handle or a tunnel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Measure {
    /// The area of its cross-section: [`Handle::area`](super::Handle::area).
    #[default]
    Area,
    /// What the `TopoMender` program says, for which cuts and fills are not comparable:
    /// [`Handle::original_size`](super::Handle::original_size).
    Original,
}

impl Options {
    /// Whether nothing is asked for.
    pub fn is_nothing(&self) -> bool {
        *self == Options { measure: self.measure, ..Options::default() }
    }

    /// Sizes given in the units of a model, counted in cells of so many units.
    #[must_use]
    pub fn in_cells(self, cell: f64) -> Options {
        let area = |size: Option<f64>| size.map(|size| size / (cell * cell));
        let volume = |size: Option<f64>| size.map(|size| size / (cell * cell * cell));
        Options {
            cut: area(self.cut),
            fill: area(self.fill),
            fill_cavities: volume(self.fill_cavities),
            drop_islands: volume(self.drop_islands),
            ..self
        }
    }

    /// The size up to which handles are cut (object) or tunnels filled (background), if any are.
    pub(super) fn size(&self, side: Side) -> Option<f64> {
        match side {
            Side::Object => self.cut,
            Side::Background => self.fill,
        }
    }

    /// An area that no cross-section of a size has more of.
    pub(super) fn area(&self, side: Side, size: f64) -> f64 {
        match (self.measure, side) {
            (Measure::Area, _) => size,
            (Measure::Original, Side::Object) => 4.0 * size,
            (Measure::Original, Side::Background) => size + 1.0,
        }
    }

    /// # Errors
    /// When a size is negative or not a number.
    pub(super) fn check(&self) -> Result<()> {
        let sizes = [
            ("cut", self.cut),
            ("fill", self.fill),
            ("fill_cavities", self.fill_cavities),
            ("drop_islands", self.drop_islands),
        ];
        match sizes.into_iter().find(|(_, size)| size.is_some_and(|size| size.is_nan() || size < 0.0)) {
            Some((name, size)) => Err(Error::setting(
                name,
                format!("{} is not a size", size.unwrap_or_default()),
                "give a number from 0 on",
            )),
            None => Ok(()),
        }
    }
}
