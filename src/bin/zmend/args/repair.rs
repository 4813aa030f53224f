//! What `zmend repair` understands.

use super::topology::HandleArgs;
use super::values::{bytes, cell, coordinate, depth_range, keep, scale, width};
use crate::goal::GoalFormat;
use clap::{ArgGroup, ValueEnum};
use glam::DVec3;
use std::path::{Path, PathBuf};
use zmend::geom::Cube;
use zmend::io::{Format, OctreeFormat};
use zmend::{Keep, Offset, Thicken};

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
  zmend repair part.stl fixed.stl --surface dc --no-self-intersections
  zmend repair part.stl part.sog                      the signed octree, for TopoMender and others
  zmend repair part.sog part.ply --surface dc         the surface of an octree file
  zmend repair part.stl fixed.stl --cell 0.1          cells of a tenth of a unit
  zmend repair a.stl b.stl --box -5 -5 -5 10 --depth 9          the same grid for several models
  zmend repair in.ply out.ply --json --report full    measure both, for scripts
  zmend repair parts.stl one.stl --inside winding     solids that overlap become one
  zmend repair cad.stl shell.stl --inside hull --gap 0.5    the outer shell, gaps up to 0.5 units closed
  zmend repair leaf.obj leaf.stl --thicken 0.8        open sheets become walls 0.8 units thick
  zmend repair scan.ply body.ply --keep largest --drop-cavities    one solid and nothing within
  zmend repair parts.obj fixed.obj --keep-good        heal, keep the components that are good then, make the others anew
  zmend repair scan.ply body.ply --cut 0.5 --fill 2    thin handles cut, small holes filled: see `zmend help topology`

The grid has 2^depth cells a side. What is thinner than a cell may vanish or grow together: take a greater depth then. \
Holes are closed, and so are gaps between faces that should touch."
)]
pub(crate) struct RepairArgs {
    /// Mesh to repair, or an octree to make a surface of (.sof, .sog, .dcf), which has a grid of its own.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write: .stl, .ply, .obj, .off, .glb or .3mf; or the octree alone, as .sof, .sog or .dcf.
    #[arg(value_name = "OUT")]
    out: Option<PathBuf>,
    /// The same as OUT.
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Heal the mesh as `zmend heal` does, keep the components that are solids then, face for face, and make only the others anew.
    ///
    /// A component is made anew if it is open, not manifold or not oriented, if it meets itself or another one, if it lies in or around one
    /// that is made anew, or if it is in the way of what is.
    #[arg(long)]
    pub(crate) keep_good: bool,

    #[command(flatten)]
    pub(crate) work: WorkArgs,
}

/// Make a surface anew, through the distance to it: with cells of a size, larger or smaller by a distance, or as a shell.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend remesh part.stl even.ply --cell 0.5               faces of half a unit all over
  zmend remesh part.stl larger.stl --cell 0.5 --offset 2      two units larger all round
  zmend remesh part.stl smaller.stl --cell 0.5 --offset -2
  zmend remesh scan.ply wall.stl --cell 0.2 --offset 0.4 --shell      a wall of 0.8 units along the faces
  zmend remesh part.stl smooth.ply --cell 0.5 --surface quads

Inside and outside are told as `zmend repair` does, holes are closed, and the surface is closed and manifold. Solids grow round at convex edges \
and shrink with sharp ones, as the distance says; --surface dc keeps edges. A shell lies along all faces, whichever way they are turned, and closes \
no holes.")]
pub(crate) struct RemeshArgs {
    /// Mesh to read.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write: .stl, .ply, .obj, .off, .glb or .3mf; or the octree alone, as .sof, .sog or .dcf.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// How far out the new surface is, in model units; below 0, how far in.
    #[arg(long, value_name = "DISTANCE", value_parser = coordinate, allow_negative_numbers = true)]
    offset: Option<f64>,
    /// What is within the offset of the faces, on either side: a wall along open surfaces.
    #[arg(long, requires = "offset")]
    shell: bool,
    #[command(flatten)]
    pub(crate) work: WorkArgs,
}

impl RemeshArgs {
    /// What becomes of the surface.
    pub(crate) fn offset(&self) -> Option<Offset> {
        self.offset.map(if self.shell { Offset::Shell } else { Offset::Solid })
    }
}

/// What can be asked of everything that makes a solid and writes it.
#[derive(Debug, clap::Args)]
pub(crate) struct WorkArgs {
    #[command(flatten)]
    pub(crate) handles: HandleArgs,
    #[command(flatten)]
    pub(crate) grid: GridArgs,
    #[command(flatten)]
    pub(crate) inside: InsideArgs,
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
    /// Resolution as the side of a cell, in the units of the model, instead of --depth. Cells have exactly this size.
    #[arg(long, value_name = "SIZE", value_parser = cell, conflicts_with = "depth", allow_negative_numbers = true)]
    pub(crate) cell: Option<f64>,
    /// Part of the grid that the longest side of the model takes, above 0 and below 1; with --cell, the most that it takes.
    #[arg(long, value_name = "S", default_value_t = 0.9, value_parser = scale, allow_negative_numbers = true)]
    pub(crate) scale: f64,
    /// Which of these options was given, if any was.
    #[arg(skip)]
    pub(crate) given: Option<&'static str>,
    /// Where the grid lies, instead of --scale: its least corner and its side, in the units of the model. A model that does not fit inside
    /// is refused. With --cell the least corner stays and the side grows to a power of two of cells.
    #[arg(
        long = "box",
        value_names = ["X", "Y", "Z", "SIZE"],
        num_args = 4,
        value_parser = coordinate,
        conflicts_with = "scale",
        allow_negative_numbers = true
    )]
    cube: Option<Vec<f64>>,
    /// Most memory to take, such as 500M or 4G: a repair that needs more is refused, and told what depth would do. All that is free when
    /// not given.
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub(crate) max_memory: Option<u64>,
}

impl GridArgs {
    /// The names of those that place the grid.
    pub(super) const IDS: [&'static str; 4] = ["depth", "cell", "scale", "cube"];

    /// The grid's cube, if it was given.
    pub(crate) fn cube(&self) -> Option<Cube> {
        let [x, y, z, size] = *self.cube.as_deref()? else { return None };
        Some(Cube { min: DVec3::new(x, y, z), size })
    }
}

/// What is inside.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Inside")]
pub(crate) struct InsideArgs {
    /// How inside is told from outside.
    #[arg(short, long = "inside", value_name = "RULE", value_enum, default_value_t = InsideArg::Auto)]
    pub(crate) rule: InsideArg,
    /// With --inside hull: close gaps between faces up to this width, in model units.
    #[arg(long, value_name = "WIDTH", value_parser = width, allow_negative_numbers = true)]
    pub(crate) gap: Option<f64>,
    /// Give faces that bound no solid a wall so thick, in model units; at least two cells. Without it, open sheets vanish.
    #[arg(long, value_name = "WIDTH", value_parser = width, allow_negative_numbers = true)]
    pub(crate) thicken: Option<f64>,
    /// Which faces get that wall.
    #[arg(long, value_name = "WHICH", value_enum, default_value_t = ThickenArg::Sheets, requires = "thicken")]
    pub(crate) thicken_what: ThickenArg,
    /// Which solids stay: all, largest, those at least so large as a part of the largest (0.1), or so many of the largest (3).
    ///
    /// Size is counted in grid edges that the solid's surface crosses, which is about its area.
    #[arg(long, value_name = "WHICH", default_value = "all", value_parser = keep, allow_negative_numbers = true)]
    pub(crate) keep: Keep,
    /// Fill cavities: what is outside, but cannot be reached from there.
    #[arg(long)]
    pub(crate) drop_cavities: bool,
}

/// Faces that get a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ThickenArg {
    /// Those that bound no solid.
    Sheets,
    /// All; solids grow by half the width.
    All,
}

impl From<ThickenArg> for Thicken {
    fn from(arg: ThickenArg) -> Self {
        match arg {
            ThickenArg::Sheets => Thicken::Sheets,
            ThickenArg::All => Thicken::All,
        }
    }
}

/// What is extracted.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Surface")]
pub(crate) struct SurfaceArgs {
    /// Kind of surface. When not given: mc, or for `topology` of SOG files dc, with the points of the file.
    #[arg(short = 's', long = "surface", value_name = "KIND", value_enum)]
    kind: Option<SurfaceArg>,
    /// What the faces are: auto is polygons for quads and blocks, triangles for mc and dc.
    #[arg(long, value_name = "KIND", value_enum, default_value_t = FacesArg::Auto)]
    pub(crate) faces: FacesArg,
    /// No face passes through another one. Some faces of dc and quads are cut in four for that; mc and blocks need no change.
    #[arg(long)]
    pub(crate) no_self_intersections: bool,
}

impl SurfaceArgs {
    /// The kind that was asked for, or another one.
    pub(crate) fn kind_or(&self, other: SurfaceArg) -> SurfaceArg {
        self.kind.unwrap_or(other)
    }
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
    /// Polygons for quads and blocks, triangles for mc and dc.
    Auto,
    /// Triangles.
    Triangles,
    /// Quadrilaterals and a few triangles for dc, quads and blocks. Some programs cannot read PLY files with both.
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

/// Rules of what is inside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum InsideArg {
    /// Look at the input, take one of the others, and tell which and why.
    Auto,
    /// What an odd number of walls keeps from the outside. Which way faces are turned makes no difference; overlaps become holes.
    Parity,
    /// What the faces go round, by the way they are turned: overlaps become unions, walls inside vanish, holes close smoothly.
    Winding,
    /// What infinity cannot reach without passing through a face, whichever way faces are turned. See --gap.
    Hull,
}

impl From<InsideArg> for zmend::Inside {
    fn from(arg: InsideArg) -> Self {
        match arg {
            InsideArg::Auto => zmend::Inside::Auto,
            InsideArg::Parity => zmend::Inside::Parity,
            InsideArg::Winding => zmend::Inside::Winding,
            InsideArg::Hull => zmend::Inside::Hull,
        }
    }
}

/// Kinds of surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SurfaceArg {
    /// Marching cubes: triangles. Where handles are cut or tunnels filled, it is quads, in triangles.
    Mc,
    /// Dual contouring: keeps sharp edges and corners.
    Dc,
    /// Dual contouring without sharp edges: smooth quadrilaterals.
    Quads,
    /// Squares of one cell, as if built of blocks.
    Blocks,
}

impl From<SurfaceArg> for zmend::Surface {
    fn from(arg: SurfaceArg) -> Self {
        match arg {
            SurfaceArg::Mc => zmend::Surface::MarchingCubes,
            SurfaceArg::Dc => zmend::Surface::DualContouring,
            SurfaceArg::Quads => zmend::Surface::Quads,
            SurfaceArg::Blocks => zmend::Surface::Blocks,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArg {
    Stl,
    Ply,
    Obj,
    Off,
    Glb,
    #[value(name = "3mf")]
    ThreeMf,
    Sof,
    Sog,
    Dcf,
}

impl From<FormatArg> for GoalFormat {
    fn from(arg: FormatArg) -> Self {
        match arg {
            FormatArg::Stl => GoalFormat::Mesh(Format::Stl),
            FormatArg::Ply => GoalFormat::Mesh(Format::Ply),
            FormatArg::Obj => GoalFormat::Mesh(Format::Obj),
            FormatArg::Off => GoalFormat::Mesh(Format::Off),
            FormatArg::Glb => GoalFormat::Mesh(Format::Glb),
            FormatArg::ThreeMf => GoalFormat::Mesh(Format::ThreeMf),
            FormatArg::Sof => GoalFormat::Octree(OctreeFormat::Sof),
            FormatArg::Sog => GoalFormat::Octree(OctreeFormat::Sog),
            FormatArg::Dcf => GoalFormat::Octree(OctreeFormat::Dcf),
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
