//! How long work reports where it is, and how a caller stops it. The library itself never prints.

use crate::error::{Error, Result};

/// The stages of a repair, in the order in which they run, and other long work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Reading and snapping the input; unit: bytes or points.
    Read,
    /// Rasterising triangles into crossings; unit: triangles.
    Scan,
    /// Closing holes; unit: rings.
    Close,
    /// Inside and outside; unit: bricks.
    Sign,
    /// Cutting handles, filling tunnels; unit: layers of thinning, whose number is not known before.
    Topology,
    /// Extracting the surface; unit: bricks.
    Contour,
    /// Writing the output; unit: bytes.
    Write,
    /// Measuring distances between two surfaces; unit: points.
    Measure,
    /// Local repairs; unit: steps.
    Heal,
}

impl Stage {
    /// The stage's name in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Read => "read",
            Stage::Scan => "scan",
            Stage::Close => "close",
            Stage::Sign => "sign",
            Stage::Topology => "topology",
            Stage::Contour => "contour",
            Stage::Write => "write",
            Stage::Measure => "measure",
            Stage::Heal => "heal",
        }
    }
}

/// Receives progress and may cancel. All methods have defaults that do nothing, and may be called from any thread.
pub trait Progress: Sync {
    /// A stage begins; `total` is the amount of work in the stage's unit, 0 when unknown.
    fn begin(&self, stage: Stage, total: u64) {
        let _ = (stage, total);
    }
    /// `amount` more of the current stage's work is done.
    fn advance(&self, amount: u64) {
        let _ = amount;
    }
    /// A stage is going to hold so many bytes in all: the octree and what the stage needs beside it, but not source and sink. Called
    /// before memory is taken, often while it grows.
    ///
    /// # Errors
    /// When that is too much, [`Error::Memory`]; the running stage returns it.
    fn hold(&self, bytes: u64) -> Result<()> {
        let _ = bytes;
        Ok(())
    }
    /// Asked often; `true` makes the running stage return [`Error::Cancelled`].
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Reports nothing and never cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {}

/// Progress of work that is done beside so many bytes that stay held.
pub(crate) struct Beside<'a> {
    pub(crate) progress: &'a dyn Progress,
    pub(crate) bytes: u64,
}

impl Progress for Beside<'_> {
    fn begin(&self, stage: Stage, total: u64) {
        self.progress.begin(stage, total);
    }

    fn advance(&self, amount: u64) {
        self.progress.advance(amount);
    }

    fn hold(&self, bytes: u64) -> Result<()> {
        self.progress.hold(self.bytes.saturating_add(bytes))
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled()
    }
}

/// `Err(Cancelled)` once the caller wants to stop.
pub(crate) fn check(progress: &dyn Progress) -> Result<()> {
    if progress.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
}
