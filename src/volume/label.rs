//! Volumes whose samples are numbers of materials.

use super::{Level, Volume};

/// One material of a volume whose samples are numbers of materials: a field that is 1 where it is and 0 elsewhere, so that the level 1/2 lies
/// between. [`extract_label`](crate::contour::volume::extract_label) makes its surface.
#[derive(Debug, Clone, Copy)]
pub struct Label<V> {
    labels: V,
    label: f64,
}

impl<V: Volume> Label<V> {
    /// The level between the material and all else.
    pub const LEVEL: Level = Level::above(0.5);

    /// The material with the number `label`.
    pub fn new(labels: V, label: f64) -> Self {
        Label { labels, label }
    }
}

impl<V: Volume> Volume for Label<V> {
    fn size(&self) -> [usize; 3] {
        self.labels.size()
    }

    fn value(&self, at: [usize; 3]) -> f64 {
        f64::from(u8::from(self.labels.value(at) == self.label))
    }

    fn has_materials(&self) -> bool {
        true
    }

    fn material(&self, at: [usize; 3]) -> f64 {
        self.labels.value(at)
    }

    fn has_invalid_cells(&self) -> bool {
        self.labels.has_invalid_cells()
    }

    fn valid_cells(&self, row: [usize; 2], words: &mut [u64]) {
        self.labels.valid_cells(row, words);
    }
}
