//! `zmend topology`: handles and tunnels, listed or removed.

use crate::args::{Form, SurfaceArg, TopologyArgs};
use crate::bars::Bars;
use crate::goal::{self, GoalFormat};
use crate::handles::{self, betti_json, handle_json};
use crate::solid::{self, Job, Work, open};
use crate::{json, memory, print, units, volume};
use serde_json::json;
use std::process::ExitCode;
use zmend::io::skeleton::Polylines;
use zmend::io::{self, OctreeFormat};
use zmend::progress::{Progress, Stage};
use zmend::repair::{Trace, membranes};
use zmend::topology::{Betti, Handle, Kind, Loops, Measure, Members, Side, Sketch, volumes};
use zmend::{Result, Solid};

/// Volumes of parts and cavities that are listed for people.
const VOLUMES: usize = 8;

pub(crate) fn run(args: &TopologyArgs) -> Result<ExitCode> {
    let TopologyArgs { input, work, .. } = args;
    let (skeleton, patches) = (args.skeleton.as_deref(), args.patches.as_deref());
    let extras = [(skeleton, &["skt", "ply", "obj"][..]), (patches, &["ply", "obj"])];
    for (path, known) in extras.into_iter().filter_map(|(path, known)| Some((path?, known))) {
        handles::check_extension(path, known)?;
        goal::check(path, &[input], work.write.force)?;
    }
    let (goal, topology) = match args.form()? {
        Form::List => return list(args).map(|()| ExitCode::SUCCESS),
        Form::Write(goal, topology) => (goal, topology),
    };
    let to = goal::format(goal, work.write.format.map(Into::into))?;
    goal::check(goal, &[input], work.write.force)?;
    let work = Work::new(work, default_surface(args)?);
    let volume = Some(&args.volume);
    let sketch = args.sketch.as_ref().map(io::sketch::read).transpose()?.map(|Polylines { points, lines }| {
        let points = points.into_iter().map(Into::into).collect();
        Sketch::of_chains(points, lines.iter().map(|line| &line.0[..]))
    });
    solid::run(&Job { input, goal, to, work, topology, sketch, volume, skeleton, patches }).map(|()| ExitCode::SUCCESS)
}

/// SOG files have the points of dual contouring.
fn default_surface(args: &TopologyArgs) -> Result<SurfaceArg> {
    let has_points = OctreeFormat::of_file(&args.input)? == Some(OctreeFormat::Sog);
    Ok(if has_points { SurfaceArg::Dc } else { SurfaceArg::Mc })
}

/// Lists what there is.
fn list(args: &TopologyArgs) -> Result<()> {
    let TopologyArgs { input, work, .. } = args;
    let mut bars = Bars::new(!work.tell.quiet && !work.tell.json);
    if volume::is_volume(input, Some(&args.volume))? {
        bars = bars.within(memory::limit(work.grid.max_memory)?);
    }
    let (solid, source, _) = open(input, &Work::new(work, SurfaceArg::Mc), Some(&args.volume), &bars)?;
    let frame = &solid.frame;
    let cell = frame.cell_size();
    let asked = work.handles.options().in_cells(cell);
    // A bound for one kind says that the other one is not asked for.
    let bounds = match (asked.cut, asked.fill) {
        (None, None) => [Some(f64::INFINITY); 2],
        (cut, fill) => [cut, fill],
    };
    bars.begin(Stage::Topology, 0);
    let (mut trace, mut sections, mut found) = (Trace::default(), Vec::new(), Vec::<Handle>::new());
    for ((side, kind), bound) in [(Side::Object, Kind::Cut), (Side::Background, Kind::Fill)].into_iter().zip(bounds) {
        let Some(bound) = bound else { continue };
        let loops = Loops::find(&solid.octree, side, bound, &bars)?;
        let listed: Vec<usize> = (0..loops.handles().len()).filter(|&i| loops.handles()[i].area <= bound).collect();
        found.extend(listed.iter().map(|&i| loops.handles()[i].clone()));
        if args.patches.is_some() {
            listed.iter().for_each(|&i| sections.extend(loops.section(i).map(|element| (kind, element))));
        }
        if args.skeleton.is_some() {
            trace.keep_loops(&solid.octree, &loops, &[]);
        }
    }
    if let Some(path) = &args.skeleton {
        handles::write_skeleton(path, &trace, frame)?;
    }
    if let Some(path) = &args.patches {
        io::skeleton::write_patches(path, &membranes(frame, sections))?;
    }
    let told = Told { found, parts: parts(&solid), betti: Betti::of(&solid.octree) };
    drop(bars);
    let warnings = source.warnings(GoalFormat::Octree(OctreeFormat::Sof));
    warnings.iter().for_each(print::warning);
    if work.tell.quiet {
        return Ok(());
    }
    if work.tell.json {
        let all = json::merged(source.as_json(input), json::grid(frame));
        let of = |kind| -> Vec<_> {
            told.found.iter().filter(|h| h.kind == kind).map(|h| handle_json(h, frame, cell)).collect()
        };
        let list = json!({
            "topology": betti_json(&told.betti),
            "handles": of(Kind::Cut),
            "tunnels": of(Kind::Fill),
            "component_volumes": told.parts[0],
            "cavity_volumes": told.parts[1],
            "warnings": warnings,
        });
        return print::out(&format!("{}\n", json::merged(all, list)));
    }
    let cells = 1u64 << frame.depth();
    let refs: Vec<&Handle> = told.found.iter().collect();
    let table = handles::table(["handle", "tunnel"], &refs, frame, cell, Measure::Area);
    let volumes = |name: &str, list: &[f64]| {
        let shown: Vec<String> = list.iter().take(VOLUMES).map(|&volume| units::real(volume)).collect();
        let more = if list.len() > VOLUMES { ", ..." } else { "" };
        if list.is_empty() { String::new() } else { format!("{name} by volume: {}{more}\n", shown.join(", ")) }
    };
    let parts = [volumes("components", &told.parts[0]), volumes("cavities", &told.parts[1])].concat();
    let (input, wide) = (input.display(), units::real(cell));
    print::out(&format!("{input}: a grid of {cells} cells a side, each {wide} wide\n\n{table}{}\n{parts}", told.betti))
}

/// What there is.
struct Told {
    found: Vec<Handle>,
    /// Volumes of components and cavities in model units cubed, the largest first.
    parts: [Vec<f64>; 2],
    betti: Betti,
}

fn parts(solid: &Solid) -> [Vec<f64>; 2] {
    let cubed = solid.frame.cell_size().powi(3);
    let in_units = |list: Vec<u64>| list.into_iter().map(|points| points as f64 * cubed).collect();
    let mut cavities = volumes(solid.signed(), Side::Background);
    cavities.reverse();
    [in_units(Members::new(solid.signed()).volumes()), in_units(cavities)]
}
