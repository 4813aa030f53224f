//! What can be said on the command line.

mod compare;
mod fields;
mod local;
mod repair;
mod topology;
mod values;
mod volume;

pub(crate) use compare::CompareArgs;
pub(crate) use fields::{CloudArgs, CloudMethodArg, OctmeshArgs, PointsArgs};
pub(crate) use local::{ConvertArgs, FeaturesArgs, HealArgs};
pub(crate) use repair::{FacesArg, RemeshArgs, RepairArgs, ReportArg, SurfaceArg, TellArgs, WorkArgs, WriteArgs};
pub(crate) use topology::{Form, TopologyArgs};
pub(crate) use values::Limit;
pub(crate) use volume::{ExtractArgs, MethodArg, VolumeArgs};

use repair::GridArgs;

use clap::parser::ValueSource;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand, value_parser};
use std::ffi::OsString;
use std::path::PathBuf;
use values::{degrees, detail_range, size};

/// Repairs polygon meshes: any soup of polygons in, a closed, manifold, oriented surface out.
///
/// Holes are closed, and flipped, doubled, missing and loose faces do not matter. Files are STL, PLY, OBJ, OFF,
/// glTF, GLB or 3MF; what they contain says which, not their names.
#[derive(Debug, Parser)]
#[command(
    name = "zmend",
    version,
    max_term_width = 100,
    after_help = "\
Examples:
  zmend sample knot-holes broken.ply          write a broken mesh to try
  zmend info broken.ply                       what is wrong with it
  zmend repair broken.ply fixed.ply           repair it
  zmend topology fixed.ply clean.ply --cut 2  cut its thin handles
  zmend extract scan.mhd scan.ply --iso 300   the surface of a volume
  zmend surface points.xyz part.stl           the surface that points were taken of
  zmend compare broken.ply fixed.ply          how far it has moved
  zmend render broken.ply picture.png --compare fixed.ply

`zmend help COMMAND` tells more."
)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Number of threads; all cores when not given. Results do not depend on it.
    #[arg(long, value_name = "N", global = true, value_parser = value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

/// What the command line says; ends the program when it makes no sense.
pub(crate) fn parse() -> Args {
    let matches = Args::command().get_matches_from(words());
    let mut args = Args::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
    let work = match &mut args.command {
        Command::Repair(args) => Some(&mut args.work),
        Command::Topology(args) => Some(&mut args.work),
        Command::Remesh(args) => Some(&mut args.work),
        Command::Octmesh(args) => Some(&mut args.work),
        _ => None,
    };
    if let (Some(work), Some((_, matches))) = (work, matches.subcommand()) {
        let is_given = |id: &&str| {
            matches.ids().any(|known| known == id) && matches.value_source(id) == Some(ValueSource::CommandLine)
        };
        work.grid.given = GridArgs::IDS.into_iter().find(is_given);
    }
    args
}

/// The words of the command line; `-skt`, which `TopoMender` has, is `--skeleton`.
fn words() -> impl Iterator<Item = OsString> {
    let is_topology = std::env::args_os().nth(1).is_some_and(|word| word == "topology");
    std::env::args_os().map(move |word| if is_topology && word == "-skt" { "--skeleton".into() } else { word })
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Repair(RepairArgs),
    Topology(TopologyArgs),
    Extract(ExtractArgs),
    Remesh(RemeshArgs),
    Surface(CloudArgs),
    Points(PointsArgs),
    Octmesh(OctmeshArgs),
    Info(InfoArgs),
    Compare(CompareArgs),
    Heal(HealArgs),
    Features(FeaturesArgs),
    Convert(ConvertArgs),
    Sample(SampleArgs),
    Render(RenderArgs),
}

/// Tell what a mesh is, what is wrong with it, and what to do; or what values a volume has.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend info part.stl
  zmend info *.ply --json        one JSON object a file, one a line
  zmend info huge.ply --quick    without looking for self-intersections

The triangles of STL files are taken as connected where their corners are identical to the last bit. \
Self-intersections are pairs of faces that meet anywhere but in common corners and edges: faces that pass through each \
other, touch, or fold over each other. They are decided exactly, and counted up to a million.")]
pub(crate) struct InfoArgs {
    /// Meshes to look at, or octree files, or volumes.
    #[arg(value_name = "FILE", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// Print one JSON object a file, each on its line.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not look for self-intersections, which takes longer than all the rest.
    #[arg(short, long)]
    pub(crate) quick: bool,
}

/// Write a built-in mesh, broken or clean, to try things on.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend sample --list
  zmend sample gear gear.stl
  zmend sample scan big.ply --detail 10        a hundred times the triangles")]
pub(crate) struct SampleArgs {
    /// Name of the sample.
    #[arg(required_unless_present = "list")]
    pub(crate) name: Option<String>,
    /// File to write: .stl, .ply, .obj, .off, .glb or .3mf.
    #[arg(value_name = "OUT", required_unless_present = "list")]
    pub(crate) out: Option<PathBuf>,
    /// How fine: the number of triangles grows with the square.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = detail_range())]
    pub(crate) detail: u32,
    /// List the names.
    #[arg(long, exclusive = true)]
    pub(crate) list: bool,
    /// Replace OUT if it exists.
    #[arg(short, long)]
    pub(crate) force: bool,
}

/// Draw a shaded picture of a mesh; what is seen from behind is red.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend render broken.ply picture.png
  zmend render broken.ply both.png --compare fixed.ply      side by side at one scale
  zmend render broken.ply wrong.png --defects               what is wrong, in colour
  zmend topology scan.ply clean.ply --cut all --patches cuts.ply
  zmend render scan.ply cuts.png --compare clean.ply --patches cuts.ply    where handles are cut, in red, and tunnels filled, in blue
  zmend render part.stl top.png --elevation 90 --wireframe --size 1600x1200")]
pub(crate) struct RenderArgs {
    /// Mesh to draw.
    pub(crate) mesh: PathBuf,
    /// Picture to write.
    #[arg(value_name = "OUT.png")]
    pub(crate) out: PathBuf,
    /// Another mesh to draw beside it; may be given several times.
    #[arg(long, value_name = "OTHER")]
    pub(crate) compare: Vec<PathBuf>,
    /// Size of the picture in pixels; 1200x900, or 800x800 a mesh with --compare, when not given.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(crate) size: Option<[u32; 2]>,
    /// Where the eye is around the z axis, in degrees from x towards y.
    #[arg(long, value_name = "DEGREES", default_value_t = -60.0, value_parser = degrees, allow_negative_numbers = true)]
    pub(crate) azimuth: f64,
    /// How high the eye is above the xy plane, in degrees: 90 looks down.
    #[arg(long, value_name = "DEGREES", default_value_t = 25.0, value_parser = degrees, allow_negative_numbers = true)]
    pub(crate) elevation: f64,
    /// Draw the edges of faces.
    #[arg(long)]
    pub(crate) wireframe: bool,
    /// Mark boundary edges green, non-manifold edges violet, edges between faces that run the same way blue, and faces that pass
    /// through others yellow.
    #[arg(long)]
    pub(crate) defects: bool,
    /// Draw the membranes of cuts (red) and fills (blue) that `zmend topology --patches` has written to a PLY file; they are seen through
    /// the surface.
    #[arg(long, value_name = "FILE")]
    pub(crate) patches: Option<PathBuf>,
    /// Replace OUT.png if it exists.
    #[arg(short, long)]
    pub(crate) force: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }
}
