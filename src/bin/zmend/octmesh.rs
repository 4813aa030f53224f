//! `zmend octmesh`: cells in and around a body, and distances from it.

use crate::args::{OctmeshArgs, SurfaceArg};
use crate::bars::Bars;
use crate::goal::{self, GoalFormat};
use crate::print::{self, Table};
use crate::solid::{Work, open};
use crate::{handles, interrupt, json, memory, units};
use serde_json::{Value, json};
use std::process::ExitCode;
use std::time::Instant;
use zmend::field::Side;
use zmend::io::OctreeFormat;
use zmend::io::volume::write_volume;
use zmend::{Error, Result, Solid, Surface, io};

pub(crate) fn run(args: &OctmeshArgs) -> Result<ExitCode> {
    let OctmeshArgs { input, out, work, .. } = args;
    handles::check_extension(out, &["vtu", "mha", "nrrd"])?;
    if work.write.format.is_some() {
        let problem = "the name of the file says what is written: .vtu, .mha or .nrrd";
        return Err(Error::setting("format", problem, "leave this option away"));
    }
    goal::check(out, &[input], work.write.force)?;
    let bars = Bars::new(!work.tell.quiet && !work.tell.json).within(memory::limit(work.grid.max_memory)?);
    let start = Instant::now();
    let asked = Work::new(work, SurfaceArg::Dc);
    let surface = asked.options.surface;
    let (mut solid, source, _) = open(input, &asked, None, &bars)?;
    let topology = work.handles.options();
    if !topology.is_nothing() {
        solid = solid.mended(&topology, &bars)?.0.told_by_signs()?;
    }
    let is_cells = out.extension().is_some_and(|e| e.eq_ignore_ascii_case("vtu"));
    let (bytes, counts) = interrupt::noted(|| {
        if is_cells { cells(args, &solid, surface, &bars) } else { samples(args, &solid, surface, &bars) }
    })?;
    drop(bars);
    if work.tell.quiet {
        return Ok(ExitCode::SUCCESS);
    }
    let warnings = source.warnings(GoalFormat::Octree(OctreeFormat::Sog));
    warnings.iter().for_each(print::warning);
    let time = start.elapsed().as_secs_f64();
    if work.tell.json {
        let counts: serde_json::Map<String, Value> =
            counts.iter().map(|&(name, count)| (name.replace(' ', "_"), json!(count))).collect();
        let all = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "input": source.as_json(input),
            "output": { "path": out.display().to_string(), "bytes": bytes, "counts": counts },
            "grid": json::grid(&solid.frame)["grid"],
            "warnings": warnings,
            "seconds": { "total": time },
            "peak_memory_bytes": memory::peak(),
        });
        print::out(&format!("{all}\n"))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut table = Table::default();
    counts.iter().for_each(|&(name, count)| table.line(name, &[Some(units::count(count as u64))]));
    table.line("file", &[Some(units::bytes(bytes))]);
    let (side, cell) = (1u64 << solid.frame.depth(), units::real(solid.frame.cell_size()));
    let memory = memory::peak().map_or(String::new(), |bytes| format!(", {} of memory", units::bytes(bytes)));
    let (input, out, time) = (input.display(), out.display(), units::time(time));
    print::out(&format!(
        "{input} -> {out}: on a grid of {side} cells a side, each {cell} wide\n\n{table}\ntotal {time}{memory}\n"
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// What was written: how many bytes, and how many of what.
type Written = (u64, Vec<(&'static str, usize)>);

fn cells(args: &OctmeshArgs, solid: &Solid, surface: Surface, bars: &Bars) -> Result<Written> {
    let cells = solid.cells(surface, &args.cells(), bars)?;
    let bytes = io::write_vtu(&args.out, &cells, args.work.write.ascii, bars)?;
    let counts = vec![
        ("cells", cells.cells.len()),
        ("cells outside", cells.count(Side::Outside)),
        ("cells inside", cells.count(Side::Inside)),
        ("cells cut", cells.count(Side::Cut)),
        ("nodes", cells.points.len()),
    ];
    Ok((bytes, counts))
}

fn samples(args: &OctmeshArgs, solid: &Solid, surface: Surface, bars: &Bars) -> Result<Written> {
    let image = solid.distance_image(surface, solid.frame.depth(), bars)?;
    let bytes = write_volume(&args.out, &image, bars)?;
    let [x, y, z] = image.size();
    Ok((bytes, vec![("samples a side", x), ("samples", x * y * z)]))
}
