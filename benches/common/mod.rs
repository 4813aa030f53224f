//! What several benches share.

use zmend::Result;
use zmend::mesh::{MeshSink, MeshSizes};

/// Takes a mesh and keeps only sums, so that the extractor is measured and not the memory of the result.
#[derive(Default)]
pub(crate) struct Sum(pub(crate) f64, pub(crate) u64);

impl MeshSink for Sum {
    fn begin(&mut self, _: MeshSizes) -> Result<()> {
        Ok(())
    }

    fn points(&mut self, points: &[glam::DVec3]) -> Result<()> {
        self.0 += points.iter().map(|p| p.x).sum::<f64>();
        Ok(())
    }

    fn faces(&mut self, _: usize, corners: &[u32]) -> Result<()> {
        self.1 += corners.iter().map(|&c| u64::from(c)).sum::<u64>();
        Ok(())
    }
}
