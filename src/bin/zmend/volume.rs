//! Volumes as the program reads them: with what the command line says of them, and what is told of them.

use crate::args::VolumeArgs;
use crate::print::Table;
use crate::units::{self, real, vector};
use glam::DVec3;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;
use zmend::io::volume::{VolumeFormat, VolumeInfo, VolumeOptions, read_volume};
use zmend::progress::Progress;
use zmend::volume::cubic::Change;
use zmend::volume::image::Range;
use zmend::volume::{Image, Level};
use zmend::{Error, Place, Result, Solid};

/// A volume, and what it came from.
pub(crate) struct Loaded {
    pub(crate) image: Image,
    pub(crate) told: Told,
}

/// What is told of a volume that was read.
#[derive(Debug, Clone)]
pub(crate) struct Told {
    pub(crate) info: VolumeInfo,
    /// Type of the samples.
    kind: &'static str,
    size: [usize; 3],
    origin: DVec3,
    axes: [DVec3; 3],
    range: Range,
    /// The level, where one was given.
    level: Option<Level>,
    /// The material, where one was asked for.
    label: Option<f64>,
    /// How large the cells are that it was sampled with anew.
    cell: Option<f64>,
}

/// Whether a file is a volume, or is said to be one, where volumes are taken.
pub(crate) fn is_volume(path: &Path, args: Option<&VolumeArgs>) -> Result<bool> {
    let Some(args) = args else { return Ok(false) };
    Ok(args.is_raw() || VolumeFormat::of_file(path)?.is_some())
}

/// Refuses a volume where a mesh is expected.
pub(crate) fn refuse(path: &Path) -> Result<()> {
    match VolumeFormat::of_file(path)? {
        Some(format) if path.is_file() => {
            let name = path.display().to_string();
            let remedy = format!("`zmend extract {name} OUT --iso VALUE` makes a surface of it");
            Err(Error::format(name, Place::Whole, format!("this is a volume ({format}), not a mesh"), remedy))
        }
        _ => Ok(()),
    }
}

impl Loaded {
    /// Reads a file.
    pub(crate) fn read(path: &Path, options: &VolumeOptions, progress: &dyn Progress) -> Result<Self> {
        let file = read_volume(path, options, progress)?;
        let (image, info) = (file.image, file.info);
        let told = Told {
            info,
            kind: image.voxels().type_name(),
            size: image.size(),
            origin: DVec3::ZERO,
            axes: [DVec3::ZERO; 3],
            range: image.voxels().range(),
            level: None,
            label: None,
            cell: None,
        };
        Ok(Loaded { image, told }.placed())
    }

    /// Reads a file as the command line says, and checks that there is a surface.
    pub(crate) fn open(path: &Path, args: &VolumeArgs, progress: &dyn Progress) -> Result<(Self, Level)> {
        if let Some(label) = args.label {
            return Ok((Loaded::labelled(path, args, label, progress)?.material(label)?, Level::above(0.5)));
        }
        let mut loaded = Loaded::spaced(path, args, progress)?;
        let level = loaded.level(args)?;
        loaded.told.level = Some(level);
        Ok((loaded, level))
    }

    /// Reads a file as the command line says, of which one material is wanted.
    pub(crate) fn labelled(path: &Path, args: &VolumeArgs, label: f64, progress: &dyn Progress) -> Result<Self> {
        let mut loaded = Loaded::spaced(path, args, progress)?;
        loaded.told.label = Some(label);
        Ok(loaded)
    }

    /// The field of a material, if it occurs: 1 where it is, 0 elsewhere.
    fn material(self, label: f64) -> Result<Self> {
        let image = self.image.material(label);
        if image.voxels().range().greatest == 0.0 {
            return Err(self.told.without_label());
        }
        Ok(Loaded { image, told: self.told })
    }

    fn spaced(path: &Path, args: &VolumeArgs, progress: &dyn Progress) -> Result<Self> {
        let loaded = Loaded::read(path, &args.options(), progress)?;
        let Some(spacing) = args.spacing else { return Ok(loaded) };
        Ok(Loaded { image: loaded.image.with_spacing(spacing)?, ..loaded }.placed())
    }

    fn placed(mut self) -> Self {
        let placement = self.image.placement();
        self.told.origin = placement.origin;
        self.told.axes = [0, 1, 2].map(|a| placement.axes.col(a));
        self
    }

    /// The level that was asked for, if something is inside.
    fn level(&self, args: &VolumeArgs) -> Result<Level> {
        let Range { least, greatest, .. } = self.told.range;
        if least > greatest {
            return Err(Error::setting("volume", "all samples are not a number", "is the type of the samples right?"));
        }
        let values = format!("values go from {} to {}", real(least), real(greatest));
        let Some(iso) = args.iso else {
            return Err(Error::setting(
                "iso",
                "it is not said where the surface lies",
                format!("{values}: --iso VALUE"),
            ));
        };
        let level = Level { iso, below: args.below };
        let (extreme, side) = if args.below { (least, "below") } else { (greatest, "above") };
        if level.holds(extreme) {
            return Ok(level);
        }
        Err(Error::setting("iso", format!("no sample is {side} {}", real(iso)), format!("{values}: take one between")))
    }

    /// The solid inside the level, on cubes.
    pub(crate) fn solid(mut self, level: Level, cell: Option<f64>, progress: &dyn Progress) -> Result<(Solid, Told)> {
        let (image, change) = self.image.on_cubes(cell, progress)?;
        let placement = image.placement();
        let cell = placement.axes.x_axis.x;
        if change == Change::Resampled {
            self.told.cell = Some(cell);
        }
        Ok((Solid::from_volume(&image, level, placement.origin, cell, progress)?, self.told))
    }

    /// Sampled anew on cubes of the given size.
    pub(crate) fn on_cubes(mut self, cell: f64, progress: &dyn Progress) -> Result<Self> {
        let (image, change) = self.image.on_cubes(Some(cell), progress)?;
        self.told.cell = (change == Change::Resampled).then_some(cell);
        Ok(Loaded { image, told: self.told })
    }
}

impl Told {
    /// What is to be known of it.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.info.trailing_bytes > 0 {
            let ignored = units::counted(self.info.trailing_bytes, "byte", "bytes");
            warnings.push(format!("{ignored} behind the samples were ignored"));
        }
        if self.range.not_numbers > 0 {
            let samples = units::counted(self.range.not_numbers, "sample is", "samples are");
            warnings.push(format!("{samples} not a number, and outside"));
        }
        let others: Vec<&str> = self
            .info
            .arrays
            .iter()
            .map(String::as_str)
            .filter(|&name| Some(name) != self.info.array.as_deref())
            .collect();
        if let (Some(array), false) = (&self.info.array, others.is_empty()) {
            warnings.push(format!("array {array} was read; there are others: {}", others.join(", ")));
        }
        if let Some(cell) = self.cell {
            warnings.push(format!("the volume was sampled anew, on cubes {} wide", real(cell)));
        }
        warnings
    }

    /// That no sample has the label.
    pub(crate) fn without_label(&self) -> Error {
        let label = real(self.label.unwrap_or(f64::NAN));
        let values = format!("values go from {} to {}", real(self.range.least), real(self.range.greatest));
        Error::setting("label", format!("no sample is {label}"), format!("{values}: take one that occurs"))
    }

    /// `above 41`, `below 41` or `equal to 6`, where there is a level or a label.
    pub(crate) fn level_words(&self) -> String {
        if let Some(label) = self.label {
            return format!("equal to {}", real(label));
        }
        self.level.map_or(String::new(), |Level { iso, below }| {
            format!("{} {}", if below { "below" } else { "above" }, real(iso))
        })
    }

    /// `48 x 62 x 42`.
    fn size_words(&self) -> String {
        self.size.map(|n| n.to_string()).join(" x ")
    }

    /// Lines of a table.
    pub(crate) fn lines(&self, table: &mut Table) {
        let spacing = self.axes.map(|step| real(step.length()));
        table.line("samples", &[Some(format!("{} of {}", self.size_words(), self.kind))]);
        table.line("spacing", &[Some(spacing.join(" x "))]);
        table.line("values", &[Some(format!("{} to {}", real(self.range.least), real(self.range.greatest)))]);
        let not_numbers = Some(self.range.not_numbers).filter(|&n| n > 0).map(units::count);
        table.line("not a number", &[not_numbers]);
    }

    /// All that is known, for people.
    pub(crate) fn text(&self) -> String {
        let name = self.info.path.display();
        let array = self.info.array.as_ref().filter(|name| !name.is_empty());
        let array = array.map_or(String::new(), |array| format!(", array {array}"));
        let mut table = Table::default();
        self.lines(&mut table);
        table.line("size of the file", &[Some(units::bytes(self.info.bytes))]);
        let end: DVec3 = (0..3).map(|a| self.axes[a] * (self.size[a] - 1) as f64).sum();
        let (from, to) = (vector(self.origin), vector(self.origin + end));
        let mut text = format!(
            "{name}: {}{array}\n{table}  the first sample is at {from}, the last one at {to}\n",
            self.info.format
        );
        self.warnings().iter().for_each(|warning| {
            let _ = writeln!(text, "  {warning}");
        });
        let middle = real(0.5 * (self.range.least + self.range.greatest));
        let _ = writeln!(text, "to make a surface of it: zmend extract {name} OUT --iso {middle}");
        text
    }

    /// All that is known, for scripts.
    pub(crate) fn json(&self) -> Value {
        let Range { least, greatest, not_numbers } = self.range;
        json!({
            "path": self.info.path.display().to_string(),
            "format": self.info.format.to_string(),
            "bytes": self.info.bytes,
            "type": self.kind,
            "size": self.size,
            "origin": self.origin.to_array(),
            "axes": self.axes.map(|axis| axis.to_array()),
            "spacing": self.axes.map(DVec3::length),
            "values": [least, greatest],
            "not_numbers": not_numbers,
            "array": self.info.array,
            "arrays": self.info.arrays,
            "trailing_bytes": self.info.trailing_bytes,
            "resampled": self.cell,
        })
    }
}
