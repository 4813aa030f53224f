//! The pipeline step by step, where a solid is what comes in, or what goes out, or what is worked on: octree files and topology.

use crate::args::{CloudArgs, SurfaceArg, TellArgs, VolumeArgs, WorkArgs, WriteArgs};
use crate::bars::Bars;
use crate::goal::GoalFormat;
use crate::handles;
use crate::measure::{Measured, Side};
use crate::repair::{self, Bounded, after};
use crate::summary::surface_name;
use crate::volume::{self, Loaded, Told};
use crate::{cloud, digits, interrupt, json, memory, print, units};
use serde_json::{Map, Value, json};
use std::path::Path;
use std::time::{Duration, Instant};
use zmend::cloud::CloudReport;
use zmend::io::{self, OctreeFormat, OctreeInfo, WriteOptions};
use zmend::mesh::MeshSizes;
use zmend::progress::{Progress, Stage};
use zmend::repair::{Trace, Warning, membranes};
use zmend::topology::{self, Kind, TopologyReport};
use zmend::{Error, Faces, Keep, Options, RepairReport, Result, Solid, Surface, sign, solidify};

/// What is to be done.
pub(crate) struct Job<'a> {
    pub(crate) input: &'a Path,
    pub(crate) goal: &'a Path,
    pub(crate) to: GoalFormat,
    pub(crate) work: Work<'a>,
    /// What becomes of handles and tunnels.
    pub(crate) topology: topology::Options,
    /// What the topology shall be, where a sketch says so.
    pub(crate) sketch: Option<topology::Sketch>,
    /// What is said of the input in case that it is a volume, where volumes are taken.
    pub(crate) volume: Option<&'a VolumeArgs>,
    /// Where skeleton and membranes are written.
    pub(crate) skeleton: Option<&'a Path>,
    pub(crate) patches: Option<&'a Path>,
}

/// How it is done.
#[derive(Clone)]
pub(crate) struct Work<'a> {
    pub(crate) options: Options,
    /// Which option that places the grid was given, if any was.
    pub(crate) given: Option<&'static str>,
    /// Side of a cell.
    pub(crate) cell: Option<f64>,
    pub(crate) max_memory: Option<u64>,
    /// What is said of points, where the input is points.
    pub(crate) cloud: Option<&'a CloudArgs>,
    pub(crate) write: &'a WriteArgs,
    pub(crate) tell: &'a TellArgs,
}

impl<'a> Work<'a> {
    /// What is asked for; with this surface if none is.
    pub(crate) fn new(args: &'a WorkArgs, surface: SurfaceArg) -> Self {
        Work {
            options: repair::options(args, surface),
            given: args.grid.given,
            cell: args.grid.cell,
            max_memory: args.grid.max_memory,
            cloud: None,
            write: &args.write,
            tell: &args.tell,
        }
    }
}

/// What came out.
struct Outcome<'a> {
    job: &'a Job<'a>,
    options: Options,
    solid: Solid,
    source: Source,
    topology: Option<TopologyReport>,
    /// Cell size of the grid that the topology was repaired on.
    cell: f64,
    /// Whether the octree was written on a grid twice as fine.
    is_refined: bool,
    /// Size of the surface, if there is one.
    sizes: Option<MeshSizes>,
    bytes: u64,
    times: Times,
    peak_memory: Option<u64>,
}

/// What a solid came from.
pub(crate) enum Source {
    Octree(OctreeInfo),
    Mesh(Box<RepairReport>),
    Volume(Box<Told>),
    /// And the side of its cells.
    Cloud(CloudReport, f64),
}

/// The time that each piece of work took.
pub(crate) type Times = Vec<(&'static str, Duration)>;

/// Reads an octree, or makes one of a volume or a mesh; topology is left to the caller.
pub(crate) fn open(
    path: &Path,
    work: &Work<'_>,
    volume: Option<&VolumeArgs>,
    bars: &Bars,
) -> Result<(Solid, Source, Times)> {
    if let Some(args) = work.cloud {
        return open_cloud(path, args, bars);
    }
    let from = OctreeFormat::of_file(path)?;
    let has_grid = || format!("{} has a grid of its own", path.display());
    let is_volume = volume::is_volume(path, volume)?;
    if let (false, Some(option)) = (is_volume, volume.and_then(VolumeArgs::given)) {
        let problem = format!("{} is no volume", path.display());
        return Err(Error::setting(option, problem, "leave this option away, or say what it is with --raw"));
    }
    if let (true, Some(option)) = (from.is_some(), work.given) {
        return Err(Error::setting(option, has_grid(), "leave this option away"));
    }
    let start = Instant::now();
    if from.is_some() && !is_volume {
        let file = io::read_octree(path, bars)?;
        let info = file.info.clone();
        return Ok((Solid::from(file), Source::Octree(info), vec![("read", start.elapsed())]));
    }
    if let (true, Some(args)) = (is_volume, volume) {
        if let Some(option) = work.given.filter(|&option| option != "cell") {
            return Err(Error::setting(option, has_grid(), "leave this option away, or say --cell"));
        }
        let (loaded, level) = Loaded::open(path, args, bars)?;
        let read = start.elapsed();
        let (solid, told) = loaded.solid(level, work.cell, bars)?;
        let times = vec![("read", read), (Stage::Sign.name(), start.elapsed().saturating_sub(read))];
        return Ok((solid, Source::Volume(Box::new(told)), times));
    }
    let mut input = Bounded::open(path)?;
    let read = start.elapsed();
    let options = Options { max_memory: memory::limit(work.max_memory)?, ..work.options };
    let (solid, report) = solidify(&mut input, &options, bars)?;
    let stages = report.times.iter().filter(|(stage, _)| *stage != Stage::Read);
    let times = [("read", read)].into_iter().chain(stages.map(|&(stage, time)| (stage.name(), time))).collect();
    Ok((solid, Source::Mesh(Box::new(report)), times))
}

/// Makes a solid of points.
fn open_cloud(path: &Path, args: &CloudArgs, bars: &Bars) -> Result<(Solid, Source, Times)> {
    let start = Instant::now();
    let mut points = io::read_cloud(path)?;
    if args.no_normals {
        points.normals.clear();
    }
    let read = start.elapsed();
    let (mut solid, report) = Solid::from_cloud(&points, &args.cloud_options(), bars)?;
    if args.keep != Keep::All || args.drop_cavities {
        let (octree, _) = sign::keep(solid.octree.into_signed(), args.keep, args.drop_cavities, bars)?;
        solid = Solid::new(octree, solid.frame);
    }
    let times = vec![("read", read), (Stage::Sign.name(), start.elapsed().saturating_sub(read))];
    let source = Source::Cloud(report, solid.frame.cell_size());
    Ok((solid, source, times))
}

pub(crate) fn run(job: &Job<'_>) -> Result<()> {
    let mut work = job.work.clone();
    work.options.surface = surface_of(work.options.surface, job.to);
    let mut bars = Bars::new(!work.tell.quiet && !work.tell.json);
    if work.cloud.is_some() || volume::is_volume(job.input, job.volume)? {
        bars = bars.within(memory::limit(work.max_memory)?);
    }
    let start = Instant::now();
    let (mut solid, source, mut times) = open(job.input, &work, job.volume, &bars)?;
    let mut options = work.options;
    let cell = solid.frame.cell_size();
    let mut topology = None;
    if !job.topology.is_nothing() || job.sketch.is_some() || job.skeleton.is_some() || job.patches.is_some() {
        let begun = Instant::now();
        let (mended, report) = mend(job, solid, &bars)?;
        (solid, topology) = (mended, Some(report));
        times.push((Stage::Topology.name(), begun.elapsed()));
    }
    let begun = Instant::now();
    let is_refined = matches!(job.to, GoalFormat::Octree(_)) && solid.octree.is_edited();
    if is_refined {
        solid = solid.told_by_signs()?;
    }
    let (sizes, bytes) = interrupt::noted(|| write(job, &solid, &mut options, &bars))?;
    times.extend([("write", begun.elapsed()), ("total", start.elapsed())]);
    if work.tell.quiet {
        return Ok(());
    }
    drop(bars);
    let peak_memory = memory::peak();
    Outcome { job, options, solid, source, topology, cell, is_refined, sizes, bytes, times, peak_memory }.tell()
}

/// Repairs the topology, and writes what can be looked at of it.
fn mend(job: &Job<'_>, solid: Solid, bars: &Bars) -> Result<(Solid, TopologyReport)> {
    if let Some(sketch) = &job.sketch {
        return solid.conformed(sketch, bars);
    }
    let mut trace = Trace::default();
    let mut watch = |round: &topology::Round<'_>| {
        if job.skeleton.is_some() {
            trace.keep(round);
        }
        Ok(())
    };
    let (solid, report) = solid.mended_watched(&job.topology, &mut watch, bars)?;
    if let Some(path) = job.skeleton {
        handles::write_skeleton(path, &trace, &solid.frame)?;
    }
    if let Some(path) = job.patches {
        let removed = solid.octree.removed().iter().map(|&edge| (Kind::Cut, edge));
        let added = solid.octree.added().iter().map(|&face| (Kind::Fill, face));
        io::skeleton::write_patches(path, &membranes(&solid.frame, removed.chain(added)))?;
    }
    Ok((solid, report))
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
fn write(job: &Job<'_>, solid: &Solid, options: &mut Options, progress: &Bars) -> Result<(Option<MeshSizes>, u64)> {
    let (goal, signed) = (job.goal, solid.signed());
    let is_text = job.work.write.ascii;
    let format = match job.to {
        GoalFormat::Octree(OctreeFormat::Sof) => return Ok((None, io::write_sof(goal, signed, progress)?)),
        GoalFormat::Octree(OctreeFormat::Dcf) => return Ok((None, io::write_dcf(goal, signed, progress)?)),
        GoalFormat::Octree(_) => {
            let points = solid.cell_points(options.surface)?;
            return Ok((None, io::write_sog(goal, signed, &solid.frame, points.as_ref(), progress)?));
        }
        GoalFormat::Mesh(format) => format,
    };
    if format.has_only_triangles() {
        options.faces = Faces::Triangles;
    }
    let (precision, _) = digits::of_frame(&solid.frame, format, is_text)?;
    let write_options = WriteOptions { precision, is_text, ..WriteOptions::default() };
    let mut writer = io::create(goal, format, write_options)?;
    let sizes = solid.extract(options, &mut writer, progress)?;
    progress.begin(Stage::Write, 0);
    Ok((Some(sizes), writer.finish()?))
}

impl Source {
    pub(crate) fn as_json(&self, path: &Path) -> Value {
        match self {
            Source::Mesh(report) => {
                json!({ "path": path.display().to_string(), "polygons": report.scan.source.polygons })
            }
            Source::Octree(info) => json::octree_file(info),
            Source::Volume(told) => told.json(),
            Source::Cloud(report, _) => cloud::as_json(report, path),
        }
    }

    /// What is to be known of it, given what is written.
    pub(crate) fn warnings(&self, to: GoalFormat) -> Vec<String> {
        match self {
            Source::Mesh(report) => report.warnings.iter().map(ToString::to_string).collect(),
            Source::Volume(told) => told.warnings(),
            Source::Cloud(report, cell) => cloud::warnings(report, *cell),
            Source::Octree(info) => {
                let ignored = units::counted(info.trailing_bytes, "byte", "bytes");
                let missing = units::counted(info.missing_samples, "crossed edge", "crossed edges");
                let says_where = to != GoalFormat::Octree(OctreeFormat::Sof);
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
}

impl Outcome<'_> {
    fn tell(&self) -> Result<()> {
        let after = self.after()?;
        let warnings = self.warnings();
        warnings.iter().for_each(print::warning);
        if self.job.work.tell.json {
            return print::out(&format!("{}\n", self.as_json(after.as_ref(), &warnings)));
        }
        print::out(&self.as_text(after.as_ref()))
    }

    /// The surface that was written, measured if that was asked for.
    fn after(&self) -> Result<Option<Side>> {
        let Outcome { job, solid, .. } = self;
        let volume = solid.signed().volume() * solid.frame.cell_size().powi(3);
        let report = job.work.tell.report;
        self.sizes.map(|sizes| after(sizes, Some(volume), job.goal, self.bytes, report)).transpose()
    }

    fn warnings(&self) -> Vec<String> {
        let mut warnings = self.source.warnings(self.job.to);
        let may_intersect = self.options.no_self_intersections && self.options.surface != Surface::Blocks;
        if may_intersect && self.sizes.is_some() && self.solid.octree.is_edited() {
            warnings.push(Warning::MayIntersect.to_string());
        }
        if self.is_refined {
            let cells = 1u64 << self.solid.frame.depth();
            warnings.push(format!(
                "signs tell of cuts and fills only on a grid twice as fine: the octree has {cells} cells a side"
            ));
        }
        warnings
    }

    fn surface_cells(&self) -> u64 {
        let signed = self.solid.signed();
        (0..signed.crossings().bricks().len()).map(|i| u64::from(signed.mixed_cells(i).count())).sum()
    }

    fn as_text(&self, after: Option<&Side>) -> String {
        let Outcome { job, solid, .. } = self;
        let Job { input, goal, to, .. } = job;
        let cells = 1u64 << solid.frame.depth();
        let mut table = print::Table::default();
        let mut level = String::new();
        if let Source::Volume(told) = &self.source {
            told.lines(&mut table);
            level = format!(", what is {}", told.level_words());
        }
        if let Source::Cloud(report, _) = &self.source {
            cloud::lines(report, &mut table);
        }
        table.line("surface cells", &[Some(units::count(self.surface_cells()))]);
        table.line("crossed edges", &[Some(units::count(solid.signed().crossings().len() as u64))]);
        match after {
            Some(side) => side.lines().into_iter().for_each(|(label, value)| table.line(label, &[value])),
            None => table.line("file", &[Some(units::bytes(self.bytes))]),
        }
        let (input, goal, cell) = (input.display(), goal.display(), units::real(solid.frame.cell_size()));
        let times: Vec<String> =
            self.times.iter().map(|&(name, time)| format!("{name} {}", units::time(time.as_secs_f64()))).collect();
        let memory = self.peak_memory.map_or(String::new(), |bytes| format!(", {} of memory", units::bytes(bytes)));
        let (times, verdict) = (times.join(", "), verdict(after));
        let of_report = |report| handles::report_text(report, &solid.frame, self.cell, job.topology.measure);
        let topology = self.topology.as_ref().map_or(String::new(), of_report);
        format!(
            "{input} -> {goal}: {to}{level} on a grid of {cells} cells a side, each {cell} wide\n\n{table}\n{topology}{times}{memory}\n{verdict}\n"
        )
    }

    fn as_json(&self, after: Option<&Side>, warnings: &[String]) -> Value {
        let Outcome { job, options, solid, source, .. } = self;
        let Job { input, goal, to, .. } = job;
        let crossings = solid.signed().crossings();
        let input = source.as_json(input);
        let output = json!({ "path": goal.display().to_string(), "format": to.extension(), "bytes": self.bytes });
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
                "crossings": crossings.len(),
                "bricks": crossings.bricks().len(),
                "bytes": solid.signed().bytes(),
            },
            "topology": self.topology.as_ref().map(|report| {
                handles::report_json(report, &solid.frame, self.cell, job.topology.measure)
            }),
            "warnings": warnings,
            "seconds": seconds,
            "peak_memory_bytes": self.peak_memory,
        })
    }
}

/// What came out, in words.
pub(crate) fn verdict(after: Option<&Side>) -> String {
    match after {
        None => "an octree file: `zmend repair` makes a surface of it".to_owned(),
        Some(side) if side.faces == 0 => "empty".to_owned(),
        Some(side) => side.measured.as_ref().map_or_else(
            || "closed, manifold, oriented: by construction; --report full measures it".to_owned(),
            Measured::verdict,
        ),
    }
}
