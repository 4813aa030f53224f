//! What `zmend extract` understands, and what `zmend topology` understands of volumes.

use super::repair::{TellArgs, WriteArgs};
use super::topology::HandleArgs;
use super::values::{bytes, cell, coordinate, spacing};
use clap::ValueEnum;
use glam::DVec3;
use std::path::PathBuf;
use zmend::Surface;
use zmend::contour::volume::Method;
use zmend::io::volume::{RawLayout, VolumeOptions};

/// Extract the surface of a volume: of a scan, a simulation, any samples on a lattice.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  zmend info head.mhd                                    what values there are
  zmend extract head.mhd head.ply --iso 41
  zmend extract rock.vti pores.stl --iso 0.5 --below     what is below the value
  zmend extract part.nrrd part.ply --iso 300 --method dc      sharp edges and corners are kept
  zmend extract slices.raw bone.ply --iso 1200 --raw 512x512x240:u16le --spacing 0.5,0.5,1.25
  zmend extract head.mhd head.ply --iso 41 --genus 0     handles cut or tunnels filled, by the least change
  zmend extract head.mhd head.ply --iso 41 --drop-islands 500 --fill-cavities all
  zmend extract head.mhd head.sog --iso 41               the signed octree
  zmend extract tissues.vti liver.ply --label 6          one material of a volume of materials
  zmend extract tissues.vti liver.ply --label 6 --genus 0 --drop-islands 50

Files are MetaImage, NRRD, NIfTI, VTK image data (.vti, .vtk) and SLC; what they contain says which, not their names. The surface lies where \
the file says the samples are: spacing, origin and directions are honoured. Samples equal to the value are outside, and so is all beyond the volume: \
the surface is closed there, half a step beyond the last samples.

The surfaces of the labels of a volume fit together without gaps: where two of them touch, both have the same triangles. After topology repair they \
need not.

Topology repair works on cubes along the axes. A volume of other cells is sampled anew for it, with cubes as wide as its closest samples, or as --cell \
says.")]
pub(crate) struct ExtractArgs {
    /// Volume to read.
    #[arg(value_name = "VOLUME")]
    pub(crate) input: PathBuf,
    /// File to write: .stl, .ply, .obj, .off, .glb or .3mf; or the octree alone, as .sof, .sog or .dcf.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) volume: VolumeArgs,
    /// How the surface is made; mc when not given, nets for labels.
    #[arg(short, long, value_name = "METHOD", value_enum, help_heading = "Surface")]
    method: Option<MethodArg>,
    /// Leave the surface open where it leaves the volume, with a rim at the last samples.
    #[arg(long, help_heading = "Surface")]
    pub(crate) open: bool,
    /// Sample the volume anew, on cubes of this side along the axes, in its units.
    #[arg(long, value_name = "SIZE", value_parser = cell, allow_negative_numbers = true, help_heading = "Volume")]
    pub(crate) cell: Option<f64>,
    /// Most memory to take, such as 500M or 4G; all that is free when not given.
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = "Volume")]
    pub(crate) max_memory: Option<u64>,
    #[command(flatten)]
    pub(crate) handles: HandleArgs,
    #[command(flatten)]
    pub(crate) write: WriteArgs,
    #[command(flatten)]
    pub(crate) tell: TellArgs,
}

/// What is read of a volume, and where its surface is.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Volume")]
pub(crate) struct VolumeArgs {
    /// The value at which the surface lies: what is above it is inside.
    #[arg(long, value_name = "VALUE", value_parser = coordinate, allow_negative_numbers = true)]
    pub(crate) iso: Option<f64>,
    /// What is below the value is inside.
    #[arg(long, requires = "iso")]
    pub(crate) below: bool,
    /// What has this value, the number of a material, is inside.
    #[arg(long, value_name = "VALUE", value_parser = coordinate, conflicts_with_all = ["iso", "below"], allow_negative_numbers = true)]
    pub(crate) label: Option<f64>,
    /// Array to read, where a file has several; the first one when not given.
    #[arg(long, value_name = "NAME")]
    array: Option<String>,
    /// Number to read, where each sample has several: 0 is the first.
    #[arg(long, value_name = "N")]
    channel: Option<usize>,
    /// Distances between samples, whatever the file says: one number or three.
    #[arg(long, value_name = "X,Y,Z", value_parser = spacing, allow_negative_numbers = true)]
    pub(crate) spacing: Option<DVec3>,
    /// What a file without a header holds: size, type (u8 to i64, f32, f64) and byte order (le, be), as in 256x256x128:u16le; with :skip=N
    /// where N bytes stand before.
    #[arg(long, value_name = "LAYOUT")]
    raw: Option<RawLayout>,
}

impl ExtractArgs {
    /// How the surface is made.
    pub(crate) fn method(&self) -> MethodArg {
        self.method.unwrap_or(if self.volume.label.is_some() { MethodArg::Nets } else { MethodArg::Mc })
    }
}

impl VolumeArgs {
    /// What is to be read.
    pub(crate) fn options(&self) -> VolumeOptions {
        VolumeOptions { array: self.array.clone(), channel: self.channel, raw: self.raw }
    }

    /// One of the options that only volumes have, if any was given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let given = [
            ("iso", self.iso.is_some()),
            ("label", self.label.is_some()),
            ("array", self.array.is_some()),
            ("channel", self.channel.is_some()),
            ("spacing", self.spacing.is_some()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(option, _)| option)
    }

    /// Whether a file is a volume because it is said to be.
    pub(crate) fn is_raw(&self) -> bool {
        self.raw.is_some()
    }
}

/// How a surface is made of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodArg {
    /// Marching cubes: triangles; samples are joined along edges only.
    Mc,
    /// Marching cubes with the topology of the trilinear interpolant: where signs leave open what is joined, values decide.
    Mc33,
    /// Dual contouring: keeps sharp edges and corners.
    Dc,
    /// Surface nets: smooth, one point a cell.
    Nets,
    /// Extended marching cubes: marching cubes with points more at sharp edges and corners.
    Emc,
}

impl From<MethodArg> for Method {
    fn from(arg: MethodArg) -> Self {
        match arg {
            MethodArg::Mc => Method::MarchingCubes,
            MethodArg::Mc33 => Method::Trilinear,
            MethodArg::Dc => Method::DualContouring,
            MethodArg::Nets => Method::SurfaceNets,
            MethodArg::Emc => Method::ExtendedMarchingCubes,
        }
    }
}

impl MethodArg {
    /// The name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            MethodArg::Mc => "mc",
            MethodArg::Mc33 => "mc33",
            MethodArg::Dc => "dc",
            MethodArg::Nets => "nets",
            MethodArg::Emc => "emc",
        }
    }

    /// The surface of an octree that corresponds to it, if there is one.
    pub(crate) fn surface(self) -> Option<Surface> {
        match self {
            MethodArg::Mc => Some(Surface::MarchingCubes),
            MethodArg::Mc33 | MethodArg::Emc => None,
            MethodArg::Dc => Some(Surface::DualContouring),
            MethodArg::Nets => Some(Surface::Quads),
        }
    }
}
