//! What can be said on the command line.

use clap::builder::RangedI64ValueParser;
use clap::{ArgGroup, Parser, Subcommand, ValueEnum, value_parser};
use std::path::{Path, PathBuf};
use zmend::geom::frame::{DEPTHS, Frame};
use zmend::io::Format;
use zmend::mesh::{Bounds, DistanceOptions, sample};

/// Repairs polygon meshes: any soup of polygons in, a closed, manifold, oriented surface out.
///
/// Holes are closed, and flipped, doubled, missing and loose faces do not matter. Files are STL, PLY, OBJ or OFF; what they
/// contain says which, not their names.
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

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Repair(RepairArgs),
    Info(InfoArgs),
    Compare(CompareArgs),
    Sample(SampleArgs),
    Render(RenderArgs),
}

/// Make a closed, manifold, oriented surface of any mesh.
#[derive(Debug, clap::Args)]
#[command(
    group = ArgGroup::new("goal").required(true).args(["out", "output"]),
    override_usage = "zmend repair [OPTIONS] <IN> <OUT>\n       zmend repair [OPTIONS] <IN> -o <OUT>",
    after_help = "\
Examples:
  zmend repair broken.stl fixed.stl
  zmend repair broken.obj -o fixed.ply --depth 9      twice as fine, four times the faces and time
  zmend repair part.stl fixed.stl --surface dc        keep sharp edges and corners
  zmend repair in.ply out.ply --json --report full    measure both, for scripts

The grid has 2^depth cells a side. What is thinner than a cell may vanish or grow together: take a greater depth then. \
Holes are closed, and so are gaps between faces that should touch."
)]
pub(crate) struct RepairArgs {
    /// Mesh to repair.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write: .stl, .ply, .obj or .off.
    #[arg(value_name = "OUT")]
    out: Option<PathBuf>,
    /// The same as OUT.
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) grid: GridArgs,
    #[command(flatten)]
    pub(crate) surface: SurfaceArgs,
    #[command(flatten)]
    pub(crate) write: WriteArgs,
    #[command(flatten)]
    pub(crate) tell: TellArgs,
}

/// Where cells lie.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Grid")]
pub(crate) struct GridArgs {
    /// Resolution: 2^N cells a side, 3 to 18.
    #[arg(short, long, value_name = "N", default_value_t = 8, value_parser = depth_range(), allow_negative_numbers = true)]
    pub(crate) depth: u32,
    /// Part of the grid that the longest side of the model takes, above 0 and below 1.
    #[arg(long, value_name = "S", default_value_t = 0.9, value_parser = scale, allow_negative_numbers = true)]
    pub(crate) scale: f64,
}

/// What is extracted.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Surface")]
pub(crate) struct SurfaceArgs {
    /// Kind of surface.
    #[arg(short = 's', long = "surface", value_name = "KIND", value_enum, default_value_t = SurfaceArg::Mc)]
    pub(crate) kind: SurfaceArg,
    /// What the faces are: auto is polygons for quads, triangles for mc and dc.
    #[arg(long, value_name = "KIND", value_enum, default_value_t = FacesArg::Auto)]
    pub(crate) faces: FacesArg,
}

/// How the result is written.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct WriteArgs {
    /// Replace OUT if it exists.
    #[arg(short, long)]
    pub(crate) force: bool,
    /// Format of OUT, whatever its name says.
    #[arg(long, value_enum)]
    pub(crate) format: Option<FormatArg>,
    /// Write numbers as text where the format has both (STL, PLY).
    #[arg(long)]
    pub(crate) ascii: bool,
}

/// What is told.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Report")]
pub(crate) struct TellArgs {
    /// How much is measured of the input and of the written file.
    #[arg(long, value_name = "HOW", value_enum, default_value_t = ReportArg::Auto)]
    pub(crate) report: ReportArg,
    /// Print one JSON object with everything instead of tables.
    #[arg(long)]
    pub(crate) json: bool,
    /// Print nothing but errors, and measure nothing.
    #[arg(short, long, conflicts_with_all = ["json", "report"])]
    pub(crate) quiet: bool,
}

impl RepairArgs {
    /// The file to write.
    pub(crate) fn goal(&self) -> &Path {
        self.out.as_ref().or(self.output.as_ref()).expect("one of both is required")
    }
}

/// Kinds of faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FacesArg {
    /// Polygons for quads, triangles for mc and dc.
    Auto,
    /// Triangles.
    Triangles,
    /// Quadrilaterals and a few triangles for dc and quads. Some programs cannot read PLY files with both.
    Polygons,
}

impl From<FacesArg> for zmend::Faces {
    fn from(arg: FacesArg) -> Self {
        match arg {
            FacesArg::Auto => zmend::Faces::Auto,
            FacesArg::Triangles => zmend::Faces::Triangles,
            FacesArg::Polygons => zmend::Faces::Polygons,
        }
    }
}

/// Kinds of surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SurfaceArg {
    /// Marching cubes: triangles.
    Mc,
    /// Dual contouring: keeps sharp edges and corners.
    Dc,
    /// Dual contouring without sharp edges: smooth quadrilaterals.
    Quads,
}

impl From<SurfaceArg> for zmend::Surface {
    fn from(arg: SurfaceArg) -> Self {
        match arg {
            SurfaceArg::Mc => zmend::Surface::MarchingCubes,
            SurfaceArg::Dc => zmend::Surface::DualContouring,
            SurfaceArg::Quads => zmend::Surface::Quads,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArg {
    Stl,
    Ply,
    Obj,
    Off,
}

impl From<FormatArg> for Format {
    fn from(arg: FormatArg) -> Self {
        match arg {
            FormatArg::Stl => Format::Stl,
            FormatArg::Ply => Format::Ply,
            FormatArg::Obj => Format::Obj,
            FormatArg::Off => Format::Off,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ReportArg {
    /// Full for each side of at most 1,000,000 faces, brief for others.
    Auto,
    /// What the repair knows anyway.
    Brief,
    /// Read the input and the written file whole and measure them.
    Full,
}

/// Tell what a mesh is, what is wrong with it, and what to do.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend info part.stl
  zmend info *.ply --json        one JSON object a file, one a line
  zmend info huge.ply --quick    without looking for self-intersections

The triangles of STL files are taken as connected where their corners are identical to the last bit. Self-intersections \
are pairs of faces that meet anywhere but in common corners and edges: faces that pass through each other, touch, or fold over \
each other. They are decided exactly, and counted up to a million.")]
pub(crate) struct InfoArgs {
    /// Meshes to look at.
    #[arg(value_name = "FILE", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// Print one JSON object a file, each on its line.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not look for self-intersections, which takes longer than all the rest.
    #[arg(short, long)]
    pub(crate) quick: bool,
}

/// Measure how far two meshes are from each other, and put their numbers side by side.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend compare broken.ply fixed.ply
  zmend compare scan.stl fixed.stl --samples 5000000
  zmend compare part.stl fixed.stl --max-distance 0.5% && echo close enough
  zmend compare a.obj b.obj --json | jq .distance.hausdorff

Distances are those of points on one surface to the closest point on the other, both ways: all corners, and samples spread \
evenly by area. The Hausdorff distance is the greatest of them. Percentages are of the diagonal of A's bounding box. \
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

/// The greatest distance that is allowed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Limit {
    /// In model units.
    Length(f64),
    /// In hundredths of the diagonal of a box.
    Percent(f64),
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
    /// File to write: .stl, .ply, .obj or .off.
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
    /// Replace OUT.png if it exists.
    #[arg(short, long)]
    pub(crate) force: bool,
}

fn depth_range() -> RangedI64ValueParser<u32> {
    value_parser!(u32).range(i64::from(*DEPTHS.start())..=i64::from(*DEPTHS.end()))
}

fn detail_range() -> RangedI64ValueParser<u32> {
    value_parser!(u32).range(1..=i64::from(sample::MAX_DETAIL))
}

/// A number that the library takes as scale.
fn scale(text: &str) -> Result<f64, String> {
    let scale = text.parse().map_err(|_| "not a number".to_owned())?;
    let unit = Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::ONE };
    Frame::fit(&unit, *DEPTHS.start(), scale).map(|_| scale).map_err(|e| e.to_string())
}

/// A length, or a percentage.
fn limit(text: &str) -> Result<Limit, String> {
    let (number, limit) =
        text.strip_suffix('%').map_or((text, Limit::Length as fn(f64) -> Limit), |n| (n, Limit::Percent));
    let number = number.trim().parse().ok().filter(|n| (0.0..f64::INFINITY).contains(n));
    number.map(limit).ok_or_else(|| "not a length or percentage such as 0.01 or 0.5%".to_owned())
}

fn degrees(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|degrees: &f64| degrees.is_finite()).ok_or_else(|| "not a number of degrees".to_owned())
}

/// The most pixels of a picture, which takes some hundred bytes for each: 40 million are 8 K.
const MOST_PIXELS: u64 = 40_000_000;

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    let [width, height]: [u32; 2] = sides.ok_or_else(|| "not of the form 1200x900".to_owned())?;
    match u64::from(width) * u64::from(height) {
        1..=MOST_PIXELS => Ok([width, height]),
        _ => Err(format!("a picture has 1 to {MOST_PIXELS} pixels")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn values_are_checked() {
        assert_eq!(size("1200x900"), Ok([1200, 900]));
        for bad in ["", "1200", "x", "0x5", "-1x5", "1e3x5", "100000x100000", "99999999999x1"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        assert_eq!(scale("0.5"), Ok(0.5));
        assert!(["0", "1", "-1", "nan", "inf", "x"].iter().all(|bad| scale(bad).is_err()));
        assert_eq!((limit("0.25"), limit("2 %")), (Ok(Limit::Length(0.25)), Ok(Limit::Percent(2.0))));
        assert!(["", "%", "-1", "nan", "inf%", "1%%", "x"].iter().all(|bad| limit(bad).is_err()));
        assert!(degrees("-45.5").is_ok() && degrees("nan").is_err() && degrees("north").is_err());
    }
}
