//! What `zmend surface`, `zmend points` and `zmend octmesh` understand.

use super::repair::{FacesArg, SurfaceArg, TellArgs, WorkArgs, WriteArgs};
use super::topology::HandleArgs;
use super::values::{Limit, bytes, cell, depth_range, keep, limit, scale, width};
use clap::{ValueEnum, value_parser};
use std::path::PathBuf;
use zmend::cloud::{CloudOptions, Pattern};
use zmend::repair::CellOptions;
use zmend::{Keep, Options};

/// Make a closed, manifold, oriented surface of points.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend surface scan.xyz scan.stl
  zmend surface scan.ply scan.ply --depth 9             512 cells a side, however far points are apart
  zmend surface points.csv part.stl --surface dc        sharp edges and corners
  zmend surface noisy.xyz smooth.ply --neighbours 40
  zmend surface scan.xyz scan.stl --gap 5 --keep largest
  zmend surface clean.ply mesh.ply --method ball --radius 0.4,0.8    triangles between the points
  zmend points part.stl cloud.xyz --spacing 0.5 && zmend surface cloud.xyz again.stl

Points come from XYZ text (a point a line: x y z, or x y z and a unit normal; colours and the like behind are skipped), from PLY (vertices, and their \
normals nx ny nz), or from any mesh (its vertices). Where there are normals, they say which side is outside, and holes are closed smoothly. Where there \
are none, planes through the nearest points tell them but for their side, and outside is what infinity reaches without passing between points less than \
the gap apart.")]
pub(crate) struct CloudArgs {
    /// Points to read.
    #[arg(value_name = "POINTS")]
    pub(crate) input: PathBuf,
    /// File to write: .stl, .ply, .obj, .off, .glb or .3mf; or the octree alone, as .sof, .sog or .dcf.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Resolution: 2^N cells a side, 4 to 18. When not given, cells are as wide as points are apart, or up to twice as fine.
    #[arg(short, long, value_name = "N", value_parser = depth_range(), help_heading = "Grid")]
    depth: Option<u32>,
    /// Resolution as the side of a cell, in model units, instead of --depth.
    #[arg(long, value_name = "SIZE", value_parser = cell, conflicts_with = "depth", allow_negative_numbers = true, help_heading = "Grid")]
    pub(crate) cell: Option<f64>,
    /// Part of the grid that the longest side of the cloud takes, above 0 and below 1.
    #[arg(long, value_name = "S", default_value_t = 0.9, value_parser = scale, allow_negative_numbers = true, help_heading = "Grid")]
    scale: f64,
    /// Most memory to take, such as 500M or 4G; all that is free when not given.
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = "Grid")]
    pub(crate) max_memory: Option<u64>,
    /// How many nearest points tell the normal and the share of each: more are smoother, fewer are sharper.
    #[arg(short, long, value_name = "N", default_value_t = 12, value_parser = value_parser!(u16).range(4..=200), help_heading = "Points")]
    neighbours: u16,
    /// Without normals: infinity does not pass between points less than this far apart, in model units. Four times as far as points are
    /// apart when not given.
    #[arg(long, value_name = "WIDTH", value_parser = width, allow_negative_numbers = true, help_heading = "Points")]
    gap: Option<f64>,
    /// Do as if the points had no normals.
    #[arg(long, help_heading = "Points")]
    pub(crate) no_normals: bool,
    /// Which solids stay: all, largest, those at least so large as a part of the largest (0.1), or so many of the largest (3).
    #[arg(long, value_name = "WHICH", default_value = "all", value_parser = keep, allow_negative_numbers = true, help_heading = "Surface")]
    pub(crate) keep: Keep,
    /// Fill cavities: what is outside, but cannot be reached from there.
    #[arg(long, help_heading = "Surface")]
    pub(crate) drop_cavities: bool,
    /// How the surface is made.
    #[arg(short, long, value_name = "METHOD", value_enum, default_value_t = CloudMethodArg::Octree, help_heading = "Surface")]
    pub(crate) method: CloudMethodArg,
    /// With --method ball: radius of the ball in model units; several are rolled one after the other. When not given, as wide as points are
    /// apart, and larger ones after that.
    #[arg(long, value_name = "R", value_parser = width, value_delimiter = ',', help_heading = "Surface")]
    pub(crate) radius: Vec<f64>,
    /// Kind of surface.
    #[arg(short, long, value_name = "KIND", value_enum, default_value_t = SurfaceArg::Mc, help_heading = "Surface")]
    surface: SurfaceArg,
    /// What the faces are: auto is polygons for quads and blocks, triangles for mc and dc.
    #[arg(long, value_name = "KIND", value_enum, default_value_t = FacesArg::Auto, help_heading = "Surface")]
    faces: FacesArg,
    /// No face passes through another one.
    #[arg(long, help_heading = "Surface")]
    no_self_intersections: bool,
    #[command(flatten)]
    pub(crate) handles: HandleArgs,
    #[command(flatten)]
    pub(crate) write: WriteArgs,
    #[command(flatten)]
    pub(crate) tell: TellArgs,
}

impl CloudArgs {
    /// What is made of the points.
    pub(crate) fn cloud_options(&self) -> CloudOptions {
        let CloudArgs { depth, cell, scale, gap, .. } = *self;
        CloudOptions { depth, cell, scale, gap, neighbours: usize::from(self.neighbours) }
    }

    /// What is extracted.
    pub(crate) fn options(&self) -> Options {
        Options {
            surface: self.surface.into(),
            faces: self.faces.into(),
            no_self_intersections: self.no_self_intersections,
            ..Options::default()
        }
    }
}

/// Ways from points to surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CloudMethodArg {
    /// A level set on an octree: smooths noise, closes holes; always closed, manifold, oriented.
    Octree,
    /// A ball that rolls over the points: triangles between the points themselves; manifold, with holes where points are too far apart. Of
    /// the other options only --no-normals and those of the output apply.
    Ball,
}

/// Take points of the surface of a mesh.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend points part.stl cloud.xyz
  zmend points part.stl cloud.xyz --spacing 0.5
  zmend points part.stl cloud.ply --spacing 0.2%             of the diagonal of the part's box
  zmend points part.stl rows.xyz --spacing 0.5 --pattern regular
  zmend points part.stl plain.xyz --no-normals

XYZ files have a point a line: x y z and the normal of its face. Points by chance are never nearer to each other than the spacing, and leave no room for \
more; the same ones come every time, unless --seed says otherwise.")]
pub(crate) struct PointsArgs {
    /// Mesh to read.
    #[arg(value_name = "MESH")]
    pub(crate) input: PathBuf,
    /// File to write: .xyz, .txt, .csv (text), or .ply.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// How far points are apart, in model units or, as in 0.5%, of the diagonal of the mesh's box.
    #[arg(long, value_name = "D", default_value = "1%", value_parser = limit)]
    pub(crate) spacing: Limit,
    /// How points are spread.
    #[arg(long, value_enum, default_value_t = PatternArg::Poisson)]
    pub(crate) pattern: PatternArg,
    /// Other numbers give other points by chance.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Leave normals out.
    #[arg(long)]
    pub(crate) no_normals: bool,
    /// Replace OUT if it exists.
    #[arg(short, long)]
    pub(crate) force: bool,
}

/// Ways to spread points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PatternArg {
    /// By chance, but never near to each other.
    Poisson,
    /// In rows over each face.
    Regular,
}

impl From<PatternArg> for Pattern {
    fn from(arg: PatternArg) -> Self {
        match arg {
            PatternArg::Poisson => Pattern::Poisson,
            PatternArg::Regular => Pattern::Regular,
        }
    }
}

/// Make a mesh of hexahedra in and around a body, fine along its surface, or sample the distance from it.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend octmesh part.stl part.vtu
  zmend octmesh part.stl part.vtu --depth 9 --coarsest 4
  zmend octmesh part.stl inside.vtu --only inside,cut        the body alone
  zmend octmesh part.sog part.vtu                            of an octree file
  zmend octmesh part.stl distance.mha --depth 7              129 x 129 x 129 samples of the signed distance

Cells along the surface have the depth of the grid, others are as large as they may be: neighbours across a face differ by one level at most, so nodes hang \
in the middle of faces and edges. Cells have the data `level` and `side` (0 outside, 1 inside, 2 cut by the surface), points have `distance`, below 0 inside. \
Inside and outside are told as `zmend repair` does.")]
pub(crate) struct OctmeshArgs {
    /// Mesh, or octree file (.sof, .sog, .dcf).
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write: .vtu for cells, .mha or .nrrd for samples of the distance.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Level of the largest cells: the cube round the model has level 0.
    #[arg(long, value_name = "N", default_value_t = 3, help_heading = "Cells")]
    pub(crate) coarsest: u32,
    /// Which cells are written.
    #[arg(long, value_name = "SIDES", value_enum, value_delimiter = ',', default_values_t = [SideArg::Outside, SideArg::Inside, SideArg::Cut], help_heading = "Cells")]
    pub(crate) only: Vec<SideArg>,
    /// Leave distances out.
    #[arg(long, help_heading = "Cells")]
    pub(crate) no_distances: bool,
    #[command(flatten)]
    pub(crate) work: WorkArgs,
}

/// Where cells are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SideArg {
    /// All of the cell is outside.
    Outside,
    /// All of the cell is inside.
    Inside,
    /// The surface passes through the cell.
    Cut,
}

impl OctmeshArgs {
    /// Which cells are made.
    pub(crate) fn cells(&self) -> CellOptions {
        let has = |side: SideArg| self.only.contains(&side);
        CellOptions {
            coarsest: self.coarsest,
            outside: has(SideArg::Outside),
            inside: has(SideArg::Inside),
            cut: has(SideArg::Cut),
            distances: !self.no_distances,
        }
    }
}
