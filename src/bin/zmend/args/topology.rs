//! What `zmend topology` understands, and what `zmend repair` understands of handles and tunnels.

use super::repair::WorkArgs;
use super::values::amount;
use super::volume::VolumeArgs;
use std::path::{Path, PathBuf};
use zmend::topology::{Measure, Options};
use zmend::{Error, Result};

/// Cut thin handles and fill narrow tunnels of a solid, and leave everything else as it is.
#[derive(Debug, clap::Args)]
#[command(
    override_usage = "zmend topology [OPTIONS] <IN> <OUT>\n       zmend topology [OPTIONS] <IN> --list\n       \
                      zmend topology [OPTIONS] <SOG> <THIN> <GROW> <OUT> [-skt <FILE>]",
    after_help = "\
Examples:
  zmend topology part.sog --list                       handles and tunnels, with size and place
  zmend topology part.sog clean.ply --cut 2.5          cut handles of up to 2.5 square units
  zmend topology scan.ply clean.ply --fill 1 --depth 9      of a mesh, on a grid of 512 cells a side
  zmend topology scan.ply clean.ply --genus 0          none is left, by the least change
  zmend topology scan.ply clean.ply --cut 4 --fill 4 --cheapest      cut or fill, whichever changes less
  zmend topology scan.ply clean.ply --cut all --drop-islands 10 --fill-cavities inf
  zmend topology scan.ply clean.ply --sketch lines.axs      what the lines of a sketch have, and nothing else
  zmend topology scan.mhd clean.ply --iso 41 --genus 0      of a volume
  zmend topology part.sog clean.sog --cut 2.5          an octree again, twice as fine where anything was cut
  zmend topology part.sog clean.ply --cut all --skeleton skeleton.ply --patches patches.ply
  zmend topology part.sog 2.5 0 clean.ply -skt part.skt    as TopoMender has it, sizes in its units

A handle is as large as its thinnest cross-section, a tunnel as the smallest membrane across it: areas in model units squared, whichever way they \
lie in the grid. Every handle goes round a tunnel, so that each can be cut or filled; without --genus and --cheapest, handles \
are cut first. A threshold makes it faster: nothing thicker is looked at.

TopoMender's own form takes a threshold each for cuts and fills, 0 for none. A cut counts a quarter of the squares that it is made of, a fill all \
but one, staircases included."
)]
pub(crate) struct TopologyArgs {
    /// An octree (.sof, .sog, .dcf) or a volume (see `zmend help extract`), which have grids of their own, or a mesh of any format, which is
    /// repaired on the way.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write: .stl, .ply, .obj, .off, .glb or .3mf, or an octree as .sof, .sog or .dcf. Three words: THIN, GROW, OUT.
    #[arg(value_name = "OUT", num_args = 0..=3, allow_negative_numbers = true)]
    rest: Vec<PathBuf>,
    /// List handles and tunnels, and change nothing; with --cut or --fill, those up to that size.
    #[arg(short, long)]
    pub(crate) list: bool,
    /// Write the skeleton, with the size of each arc and what was cut or filled: .skt, .ply or .obj.
    #[arg(long, value_name = "FILE")]
    pub(crate) skeleton: Option<PathBuf>,
    /// Write the membranes of cuts (red) and fills (blue): .ply or .obj.
    #[arg(long, value_name = "FILE")]
    pub(crate) patches: Option<PathBuf>,
    /// Make the topology that of a sketch: an .axs file, or an OBJ file with lines, in the coordinates of the model. Handles that the lines do not
    /// have are cut or filled, loops that they have are opened, parts without a line are dropped, and cavities filled.
    #[arg(long, value_name = "FILE", conflicts_with_all = [
        "list", "skeleton", "patches", "cut", "fill", "genus", "cheapest", "fill_cavities", "drop_islands",
    ])]
    pub(crate) sketch: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) volume: VolumeArgs,
    #[command(flatten)]
    pub(crate) work: WorkArgs,
}

/// Handles, tunnels, parts and cavities.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Topology")]
pub(crate) struct HandleArgs {
    /// Cut handles whose cross-section has up to this area, in model units squared; all or inf: however large.
    #[arg(long, value_name = "AREA", value_parser = amount, allow_negative_numbers = true)]
    cut: Option<f64>,
    /// Fill tunnels across which a membrane of up to this area lies, in model units squared; all or inf: however large.
    #[arg(long, value_name = "AREA", value_parser = amount, allow_negative_numbers = true)]
    fill: Option<f64>,
    /// Remove the smallest handles and tunnels until at most N handles are left; --cut and --fill, where given, bound what is removed.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    genus: Option<u64>,
    /// Cut or fill, whichever changes fewer cells, instead of cutting first.
    #[arg(long)]
    cheapest: bool,
    /// Fill cavities of up to this volume, in model units cubed; all or inf: however large.
    #[arg(long, value_name = "VOLUME", value_parser = amount, allow_negative_numbers = true)]
    fill_cavities: Option<f64>,
    /// Drop floating parts of up to this volume, in model units cubed.
    #[arg(long, value_name = "VOLUME", value_parser = amount, allow_negative_numbers = true)]
    drop_islands: Option<f64>,
}

impl HandleArgs {
    pub(crate) fn options(&self) -> Options {
        Options {
            cut: self.cut,
            fill: self.fill,
            genus: self.genus,
            cheapest: self.cheapest,
            fill_cavities: self.fill_cavities,
            drop_islands: self.drop_islands,
            measure: Measure::Area,
        }
    }
}

/// What the words behind the input mean.
#[derive(Debug)]
pub(crate) enum Form<'a> {
    /// Nothing is written.
    List,
    /// A file is written.
    Write(&'a Path, Options),
}

impl TopologyArgs {
    /// What is asked for.
    ///
    /// # Errors
    /// When the words make no sense.
    pub(crate) fn form(&self) -> Result<Form<'_>> {
        let options = self.work.handles.options();
        match (&self.rest[..], self.list) {
            ([], true) => Ok(Form::List),
            (_, true) => Err(Error::setting("list", "nothing is written", "leave OUT away")),
            ([], false) => Err(Error::setting("OUT", "no file to write is named", "name one, or add --list")),
            ([_], false) if options.is_nothing() && self.sketch.is_none() => {
                let remedy =
                    "add --cut, --fill, --genus, --cheapest, --fill-cavities, --drop-islands or --sketch, or --list";
                Err(Error::setting("topology", "nothing is asked for", remedy))
            }
            ([out], false) => Ok(Form::Write(out, options)),
            ([thin, grow, out], false) => {
                if !options.is_nothing() || self.sketch.is_some() {
                    let problem = "THIN and GROW are sizes already";
                    return Err(Error::setting("cut", problem, "say `zmend topology IN OUT` with options, or none"));
                }
                let options =
                    Options { cut: threshold(thin)?, fill: threshold(grow)?, measure: Measure::Original, ..options };
                Ok(Form::Write(out, options))
            }
            (_, false) => {
                let problem =
                    format!("{} words are too many for IN OUT and too few for SOG THIN GROW OUT", self.rest.len() + 1);
                Err(Error::setting("OUT", problem, "see `zmend help topology`"))
            }
        }
    }
}

/// A threshold of `TopoMender`: nothing is done where it is not above 0.
fn threshold(word: &Path) -> Result<Option<f64>> {
    let number = word.to_str().and_then(|text| text.parse::<f64>().ok()).filter(|number| !number.is_nan());
    let Some(number) = number else {
        let problem = format!("{} is no threshold", word.display());
        return Err(Error::setting("THIN GROW", problem, "give two numbers, 0 for nothing"));
    };
    Ok((number > 0.0).then_some(number))
}
