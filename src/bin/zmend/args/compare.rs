//! What can be said to `zmend compare`.

use super::values::{Limit, limit};
use clap::value_parser;
use std::path::PathBuf;
use zmend::mesh::DistanceOptions;

/// Measure how far two meshes are from each other, and put their numbers side by side.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend compare broken.ply fixed.ply
  zmend compare scan.stl fixed.stl --samples 5000000
  zmend compare part.stl fixed.stl --max-distance 0.5% && echo close enough
  zmend compare a.obj b.obj --json | jq .distance.hausdorff

Distances are those of points on one surface to the closest point on the other, both ways: all corners, and samples \
spread evenly by area. The Hausdorff distance is the greatest of them. Percentages are of the diagonal of A's bounding box. \
Far from the other surface is what a repair has closed (B to A) or lost (A to B).")]
pub(crate) struct CompareArgs {
    /// The mesh to compare with, for instance the original.
    #[arg(value_name = "A")]
    pub(crate) a: PathBuf,
    /// Another mesh, for instance the repaired one.
    #[arg(value_name = "B")]
    pub(crate) b: PathBuf,
    /// Samples of each surface, beside its corners.
    #[arg(short = 'n', long, value_name = "N", default_value_t = DistanceOptions::default().samples,
        value_parser = value_parser!(u64).range(..=10_000_000_000))]
    pub(crate) samples: u64,
    /// Other seeds take other samples; the same seed takes the same ones.
    #[arg(long, value_name = "N", default_value_t = DistanceOptions::default().seed)]
    pub(crate) seed: u64,
    /// Fail (exit code 1) if the Hausdorff distance is greater than D, in model units or, as in 0.5%, of the diagonal.
    #[arg(long, value_name = "D", value_parser = limit, allow_negative_numbers = true)]
    pub(crate) max_distance: Option<Limit>,
    /// Do not look for self-intersections.
    #[arg(short, long)]
    pub(crate) quick: bool,
    /// Print one JSON object with everything instead of tables.
    #[arg(long)]
    pub(crate) json: bool,
}
