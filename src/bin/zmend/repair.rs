//! `zmend repair`, the main job, and `zmend remesh`, which is one with another surface.

use crate::args::{FacesArg, RemeshArgs, RepairArgs, ReportArg, SurfaceArg, WorkArgs};
use crate::bars::Bars;
use crate::goal::GoalFormat;
use crate::measure::{Measured, Side};
use crate::solid::{self, Job, Work};
use crate::summary::Summary;
use crate::{digits, goal, interrupt, keep_good, memory};
use glam::DVec3;
use std::iter;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;
use zmend::io::{self, Format, Input, OctreeFormat, WriteOptions};
use zmend::mesh::{Bounds, MeshSizes, SourceCounts, TriangleSource};
use zmend::progress::{Progress, Stage};
use zmend::{Error, Faces, Offset, Options, Result, repair_into, topology};

/// Meshes of more faces are only measured on demand: measuring these takes some tenths of a second.
const SMALL: u64 = 1_000_000;

pub(crate) fn run(repair: &RepairArgs) -> Result<ExitCode> {
    if repair.keep_good {
        return keep_good::run(&repair.input, repair.goal(), &repair.work);
    }
    make(&repair.input, repair.goal(), &repair.work, None)
}

/// `zmend remesh`: a repair whose surface lies elsewhere.
pub(crate) fn remesh(args: &RemeshArgs) -> Result<ExitCode> {
    if let (Some(format), Some(_)) = (OctreeFormat::of_file(&args.input)?, args.offset()) {
        let problem = format!("{} is an octree ({format}): distances are those to faces", args.input.display());
        return Err(Error::setting("offset", problem, "make a mesh of it with `zmend repair` first"));
    }
    make(&args.input, &args.out, &args.work, args.offset())
}

fn make(input: &Path, goal: &Path, args: &WorkArgs, offset: Option<Offset>) -> Result<ExitCode> {
    let format = goal::format(goal, args.write.format.map(Into::into))?;
    goal::check(goal, &[input], args.write.force)?;
    let topology = args.handles.options();
    crate::volume::refuse(input)?;
    let (None, GoalFormat::Mesh(format)) = (OctreeFormat::of_file(input)?, format) else {
        let mut work = Work::new(args, SurfaceArg::Mc);
        work.options.offset = offset;
        let job =
            Job { input, goal, to: format, work, topology, sketch: None, volume: None, skeleton: None, patches: None };
        return solid::run(&job).map(|()| ExitCode::SUCCESS);
    };
    let mut options = Options { topology, offset, ..options(args, SurfaceArg::Mc) };
    if format.has_only_triangles() {
        // The surface knows better than the writer which diagonals to take.
        options.faces = Faces::Triangles;
    }

    let bars = Bars::new(!args.tell.quiet && !args.tell.json);
    let start = Instant::now();
    bars.begin(Stage::Read, 0);
    let mut source = Bounded::open(input)?;
    let is_text = args.write.ascii;
    let (precision, loses_digits) = digits::choose(&source.bounds, &options, format, is_text)?;
    let read = start.elapsed();
    let write_options = WriteOptions { precision, is_text, ..WriteOptions::default() };
    options.max_memory = memory::limit(args.grid.max_memory)?;
    let (report, repaired, bytes) = interrupt::noted(|| {
        let mut writer = io::create(goal, format, write_options)?;
        let report = repair_into(&mut source, &options, &mut writer, &bars)?;
        let repaired = start.elapsed();
        bars.begin(Stage::Write, 0);
        Ok((report, repaired, writer.finish()?))
    })?;
    let total = start.elapsed();
    if args.tell.quiet {
        return Ok(ExitCode::SUCCESS);
    }

    // Before anything is measured, which takes memory of its own.
    let peak_memory = memory::peak();
    bars.start("measure", 0);
    let before = before(&source.input, args.tell.report)?;
    let after = after(report.sizes, Some(report.volume), goal, bytes, args.tell.report)?;
    drop(bars);
    // The reading was done before the repair asked for it.
    let stages = report.times.iter().filter(|(stage, _)| *stage != Stage::Read).map(|&(s, time)| (s.name(), time));
    let times = iter::once(("read", read))
        .chain(stages)
        .chain([("write", total.saturating_sub(repaired)), ("total", total)])
        .collect();
    let summary = Summary {
        ignored: ignored(args, format),
        input: source.input.info(),
        before,
        goal,
        format,
        precision,
        loses_digits,
        after,
        options,
        report,
        times,
        peak_memory,
    };
    let told = if args.tell.json { summary.print_json() } else { summary.print() };
    told.map(|()| ExitCode::SUCCESS)
}

/// What is asked for, but for topology; with this surface if none is.
pub(crate) fn options(args: &WorkArgs, surface: SurfaceArg) -> Options {
    Options {
        depth: args.grid.depth,
        cell: args.grid.cell,
        scale: args.grid.scale,
        cube: args.grid.cube(),
        inside: args.inside.rule.into(),
        gap: args.inside.gap,
        thicken: args.inside.thicken,
        thicken_what: args.inside.thicken_what.into(),
        offset: None,
        keep: args.inside.keep,
        drop_cavities: args.inside.drop_cavities,
        surface: args.surface.kind_or(surface).into(),
        faces: args.surface.faces.into(),
        no_self_intersections: args.surface.no_self_intersections,
        max_memory: None,
        topology: topology::Options::default(),
    }
}

/// What was asked for and makes no difference.
fn ignored(args: &WorkArgs, format: Format) -> Vec<String> {
    let mut ignored = Vec::new();
    if args.write.ascii && !matches!(format, Format::Stl | Format::Ply) {
        ignored.push(format!("--ascii makes no difference: {format} is always text"));
    }
    if args.surface.faces == FacesArg::Polygons {
        if format == Format::Stl {
            ignored.push("--faces polygons makes no difference: STL has nothing but triangles".to_owned());
        } else if args.surface.kind_or(SurfaceArg::Mc) == SurfaceArg::Mc {
            ignored.push("--faces polygons makes no difference: marching cubes makes triangles".to_owned());
        }
    }
    ignored
}

/// An input whose bounds are found once, although both the precision of the output and the repair depend on them.
pub(crate) struct Bounded {
    input: Input,
    bounds: Bounds,
}

impl Bounded {
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let mut input = io::open(path)?;
        let bounds = input.bounds()?;
        Ok(Bounded { input, bounds })
    }
}

impl TriangleSource for Bounded {
    fn bounds(&mut self) -> Result<Bounds> {
        Ok(self.bounds)
    }

    fn triangles(&mut self, sink: &mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Result<SourceCounts> {
        self.input.triangles(sink)
    }

    fn size_hint(&self) -> Option<u64> {
        self.input.size_hint()
    }
}

/// Whether a mesh of so many faces is measured.
fn is_measured(faces: u64, report: ReportArg) -> bool {
    match report {
        ReportArg::Auto => faces <= SMALL,
        ReportArg::Brief => false,
        ReportArg::Full => true,
    }
}

fn before(input: &Input, report: ReportArg) -> Result<Side> {
    let info = input.info();
    // Pipes cannot be read again; what came from them is in memory.
    let can_be_read = input.mesh().is_some() || info.path.is_file();
    let measured = can_be_read && is_measured(info.polygons, report);
    Ok(Side::new(info, measured.then(|| Measured::input(input)).transpose()?))
}

/// What is known of the written surface, given its size and the volume that it encloses, if that is known.
pub(crate) fn after(sizes: MeshSizes, volume: Option<f64>, goal: &Path, bytes: u64, asked: ReportArg) -> Result<Side> {
    let MeshSizes { points, faces, corners } = sizes;
    let is_known = goal.is_file() && is_measured(faces, asked);
    Ok(Side {
        bytes: Some(bytes),
        vertices: Some(points),
        faces,
        // Closed and manifold by construction: every edge has two corners.
        euler: Some(points as i64 - (corners / 2) as i64 + faces as i64),
        volume,
        measured: is_known.then(|| Measured::file(goal)).transpose()?,
    })
}
