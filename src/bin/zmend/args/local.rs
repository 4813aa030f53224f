//! What can be said to `zmend heal`, `zmend features` and `zmend convert`.

use super::values::{Limit, degrees, limit};
use clap::value_parser;
use std::path::PathBuf;
use zmend::mesh::HealOptions;

/// What all that write a file and tell of it have in common.
#[derive(Debug, clap::Args)]
pub(crate) struct OutputArgs {
    /// Print one JSON object instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
    /// Replace OUT if it exists.
    #[arg(short, long)]
    pub(crate) force: bool,
}

/// Repair what can be repaired locally; every good face stays as it is.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend heal scan.stl healed.ply
  zmend heal part.obj healed.obj --tolerance 0.01      points up to 0.01 model units apart are one
  zmend heal scan.ply healed.ply --max-hole 1000       larger holes, too
  zmend heal part.stl healed.stl --json | jq .after

Points of rims are welded and stitched, degenerate and duplicate faces go, faces are turned to run one way round, solids \
that share edges are cut apart, small holes are filled to match. No kind of defect is more frequent afterwards than before, \
and a mesh without defects is written as `zmend convert` would. What is left is told; `zmend repair` makes a solid of \
anything, but makes the surface anew; with --keep-good only that of components that are not whole after healing.")]
pub(crate) struct HealArgs {
    /// Mesh to heal.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write: .stl, .ply, .obj, .off, .glb or .3mf.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Points of rims up to D apart are one, in model units or, as in 0.01%, of the diagonal of the mesh's box.
    #[arg(short, long, value_name = "D", default_value = "0.0001%", value_parser = limit)]
    pub(crate) tolerance: Limit,
    /// Fill holes of up to N edges; 0 fills none. The time for one grows with the cube of N.
    #[arg(long, value_name = "N", default_value_t = HealOptions::default().max_hole_edges,
        value_parser = value_parser!(u32).range(..=5000))]
    pub(crate) max_hole: u32,
    /// Fill holes without points of their own.
    #[arg(long)]
    pub(crate) plain: bool,
    /// Do not look for self-intersections, old or new.
    #[arg(short, long)]
    pub(crate) quick: bool,
    #[command(flatten)]
    pub(crate) output: OutputArgs,
}

/// Write the lines along which a mesh folds, ends or branches.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend features part.stl lines.obj
  zmend features part.stl lines.ply --angle 20
  zmend features scan.ply rims.ply --angle 180         only where the surface ends or branches

OBJ files have one polyline a chain; PLY files have edges, coloured by kind: red where the surface folds outwards, blue where \
it folds inwards, green where it ends, violet where it branches.")]
pub(crate) struct FeaturesArgs {
    /// Mesh to look at.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write: .obj or .ply.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// The angle between faces from which on their edge is a feature.
    #[arg(short, long, value_name = "DEGREES", default_value_t = 40.0, value_parser = degrees)]
    pub(crate) angle: f64,
    /// Leave out the edges where the surface ends or branches.
    #[arg(long)]
    pub(crate) folds_only: bool,
    #[command(flatten)]
    pub(crate) output: OutputArgs,
}

/// Write a mesh in another format; polygons stay polygons where the format has them.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend convert part.stl part.ply
  zmend convert part.obj part.stl --ascii

Coordinates are written with 32 bits if nothing is lost by that, else with 64 where the format has them. The triangles of STL \
files are connected where their corners are identical to the last bit; formats that have only triangles get polygons cut along diagonals \
that fold least. Vertices come before faces in most formats, and STL files do not have them, so the mesh is in memory meanwhile: 24 bytes a vertex \
and 16 a triangle, and while it is read, the file.")]
pub(crate) struct ConvertArgs {
    /// Mesh to read.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write: .stl, .ply, .obj, .off, .glb or .3mf.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Write numbers as text where the format has both (STL, PLY).
    #[arg(long)]
    pub(crate) ascii: bool,
    #[command(flatten)]
    pub(crate) output: OutputArgs,
}
