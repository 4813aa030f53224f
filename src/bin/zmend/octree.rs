//! `zmend repair` from or to octree files: the half of the pipeline that is needed.

use crate::args::RepairArgs;
use crate::bars::Bars;
use crate::goal::GoalFormat;
use crate::measure::{Measured, Side};
use crate::repair::{self, Bounded, after};
use crate::summary::surface_name;
use crate::{digits, interrupt, json, memory, print, units};
use serde_json::{Map, Value, json};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use zmend::io::{self, OctreeFormat, OctreeInfo, WriteOptions};
use zmend::mesh::MeshSizes;
use zmend::progress::{Progress, Stage};
use zmend::{Error, Faces, Options, RepairReport, Result, Solid, Surface, solidify};

/// What came out.
struct Outcome<'a> {
    args: &'a RepairArgs,
    to: GoalFormat,
    options: Options,
    solid: Solid,
    source: Source,
    /// Size of the surface, if there is one.
    sizes: Option<MeshSizes>,
    bytes: u64,
    times: Vec<(&'static str, Duration)>,
    peak_memory: Option<u64>,
}

/// What the solid came from.
enum Source {
    Octree(OctreeInfo),
    Mesh(Box<RepairReport>),
}

pub(crate) fn run(args: &RepairArgs, from: Option<OctreeFormat>, to: GoalFormat) -> Result<ExitCode> {
    if let (Some(_), Some(option)) = (from, args.grid.given) {
        let problem = format!("{} has a grid of its own", args.input.display());
        return Err(Error::setting(option, problem, "leave this option away"));
    }
    let bars = Bars::new(!args.tell.quiet && !args.tell.json);
    let mut options = repair::options(args);
    options.surface = surface_of(options.surface, to);
    let start = Instant::now();
    let (solid, source, mut times) = if from.is_some() {
        let file = io::read_octree(&args.input, &bars)?;
        let solid = Solid { octree: file.octree, frame: file.frame, points: file.points };
        (solid, Source::Octree(file.info), vec![("read", start.elapsed())])
    } else {
        let mut input = Bounded::open(&args.input)?;
        let read = start.elapsed();
        options.max_memory = memory::limit(args.grid.max_memory)?;
        let (solid, report) = solidify(&mut input, &options, &bars)?;
        let stages = report.times.iter().filter(|(stage, _)| *stage != Stage::Read);
        let times = [("read", read)].into_iter().chain(stages.map(|&(stage, time)| (stage.name(), time))).collect();
        (solid, Source::Mesh(Box::new(report)), times)
    };
    let begun = Instant::now();
    let (sizes, bytes) = interrupt::noted(|| write(args, &solid, &mut options, to, &bars))?;
    times.extend([("write", begun.elapsed()), ("total", start.elapsed())]);
    if args.tell.quiet {
        return Ok(ExitCode::SUCCESS);
    }
    drop(bars);
    let peak_memory = memory::peak();
    Outcome { args, to, options, solid, source, sizes, bytes, times, peak_memory }.tell()?;
    Ok(ExitCode::SUCCESS)
}

/// The surface that decides what is kept of the mesh. SOF files have no normals; of the others, dual contouring makes the points.
fn surface_of(asked: Surface, to: GoalFormat) -> Surface {
    match to {
        GoalFormat::Octree(OctreeFormat::Sof) => Surface::MarchingCubes,
        GoalFormat::Octree(OctreeFormat::Dcf) => Surface::DualContouring,
        GoalFormat::Octree(_) if asked == Surface::MarchingCubes => Surface::DualContouring,
        _ => asked,
    }
}

/// Writes the solid or its surface; returns the size of the surface, if it is one, and of the file.
fn write(
    args: &RepairArgs,
    solid: &Solid,
    options: &mut Options,
    to: GoalFormat,
    progress: &Bars,
) -> Result<(Option<MeshSizes>, u64)> {
    let goal = args.goal();
    let format = match to {
        GoalFormat::Octree(OctreeFormat::Sof) => return Ok((None, io::write_sof(goal, &solid.octree, progress)?)),
        GoalFormat::Octree(OctreeFormat::Dcf) => return Ok((None, io::write_dcf(goal, &solid.octree, progress)?)),
        GoalFormat::Octree(_) => {
            let points = solid.cell_points(options.surface)?;
            return Ok((None, io::write_sog(goal, &solid.octree, &solid.frame, points.as_ref(), progress)?));
        }
        GoalFormat::Mesh(format) => format,
    };
    if format.has_only_triangles() {
        options.faces = Faces::Triangles;
    }
    let (precision, _) = digits::of_frame(&solid.frame, format, args.write.ascii)?;
    let write_options = WriteOptions { precision, is_text: args.write.ascii, ..WriteOptions::default() };
    let mut writer = io::create(goal, format, write_options)?;
    let sizes = solid.extract(options, &mut writer, progress)?;
    progress.begin(Stage::Write, 0);
    Ok((Some(sizes), writer.finish()?))
}

impl Outcome<'_> {
    fn tell(&self) -> Result<()> {
        let after = self.after()?;
        let warnings = self.warnings();
        warnings.iter().for_each(print::warning);
        if self.args.tell.json {
            return print::out(&format!("{}\n", self.as_json(after.as_ref(), &warnings)));
        }
        print::out(&self.as_text(after.as_ref()))
    }

    /// The surface that was written, measured if that was asked for.
    fn after(&self) -> Result<Option<Side>> {
        let volume = self.solid.octree.volume() * self.solid.frame.cell_size().powi(3);
        let goal = self.args.goal();
        self.sizes.map(|sizes| after(sizes, volume, goal, self.bytes, self.args.tell.report)).transpose()
    }

    fn warnings(&self) -> Vec<String> {
        match &self.source {
            Source::Mesh(report) => report.warnings.iter().map(ToString::to_string).collect(),
            Source::Octree(info) => {
                let ignored = units::counted(info.trailing_bytes, "byte", "bytes");
                let missing = units::counted(info.missing_samples, "crossed edge", "crossed edges");
                let says_where = self.to != GoalFormat::Octree(OctreeFormat::Sof);
                let half_way = "SOF files do not say where the surface crosses edges: it is taken to do so half way";
                let warnings = [
                    (info.trailing_bytes > 0, format!("{ignored} behind the end of the octree were ignored")),
                    (info.missing_samples > 0, format!("{missing} had no sample and are crossed half way")),
                    (info.format == OctreeFormat::Sof && says_where, half_way.to_owned()),
                ];
                warnings.into_iter().filter(|(is_so, _)| *is_so).map(|(_, warning)| warning).collect()
            }
        }
    }

    fn surface_cells(&self) -> u64 {
        let bricks = 0..self.solid.octree.crossings().bricks().len();
        bricks.map(|i| u64::from(self.solid.octree.mixed_cells(i).count())).sum()
    }

    fn as_text(&self, after: Option<&Side>) -> String {
        let Outcome { args, to, solid, .. } = self;
        let cells = 1u64 << solid.frame.depth();
        let mut table = print::Table::default();
        table.line("surface cells", &[Some(units::count(self.surface_cells()))]);
        table.line("crossed edges", &[Some(units::count(solid.octree.crossings().len() as u64))]);
        match after {
            Some(side) => side.lines().into_iter().for_each(|(label, value)| table.line(label, &[value])),
            None => table.line("file", &[Some(units::bytes(self.bytes))]),
        }
        let (input, goal, cell) = (args.input.display(), args.goal().display(), units::real(solid.frame.cell_size()));
        let times: Vec<String> =
            self.times.iter().map(|&(name, time)| format!("{name} {}", units::time(time.as_secs_f64()))).collect();
        let memory = self.peak_memory.map_or(String::new(), |bytes| format!(", {} of memory", units::bytes(bytes)));
        let (times, verdict) = (times.join(", "), verdict(after));
        format!(
            "{input} -> {goal}: {to} on a grid of {cells} cells a side, each {cell} wide\n\n{table}\n{times}{memory}\n{verdict}\n"
        )
    }

    fn as_json(&self, after: Option<&Side>, warnings: &[String]) -> Value {
        let Outcome { args, to, options, solid, source, .. } = self;
        let input = match source {
            Source::Mesh(report) => {
                json!({ "path": args.input.display().to_string(), "polygons": report.scan.source.polygons })
            }
            Source::Octree(info) => json::octree_file(info),
        };
        let output =
            json!({ "path": args.goal().display().to_string(), "format": to.extension(), "bytes": self.bytes });
        let seconds: Map<String, Value> =
            self.times.iter().map(|&(name, time)| (name.to_owned(), json!(time.as_secs_f64()))).collect();
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "input": input,
            "output": match after {
                Some(side) => json::merged(json::side(side), json::merged(output, json!({ "verdict": verdict(after) }))),
                None => output,
            },
            "options": { "surface": surface_name(options.surface), "threads": rayon::current_num_threads() },
            "grid": json::grid(&solid.frame)["grid"],
            "octree": {
                "surface_cells": self.surface_cells(),
                "crossings": solid.octree.crossings().len(),
                "bricks": solid.octree.crossings().bricks().len(),
                "bytes": solid.octree.bytes(),
            },
            "warnings": warnings,
            "seconds": seconds,
            "peak_memory_bytes": self.peak_memory,
        })
    }
}

/// What came out, in words.
fn verdict(after: Option<&Side>) -> String {
    match after {
        None => "an octree file: `zmend repair` makes a surface of it".to_owned(),
        Some(side) if side.faces == 0 => "empty".to_owned(),
        Some(side) => side.measured.as_ref().map_or_else(
            || "closed, manifold, oriented: by construction; --report full measures it".to_owned(),
            Measured::verdict,
        ),
    }
}
