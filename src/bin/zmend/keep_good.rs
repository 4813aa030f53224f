//! `zmend repair --keep-good`: what is good stays, what is not is made anew.

use crate::args::{SurfaceArg, WorkArgs};
use crate::bars::Bars;
use crate::goal::GoalFormat;
use crate::measure::Measured;
use crate::units::{bytes, count, counted, real, time};
use crate::{convert, digits, goal, heal, interrupt, json, memory, print, repair};
use serde_json::json;
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;
use zmend::io::{self, OctreeFormat, Precision, WriteOptions};
use zmend::mesh::HealOptions;
use zmend::repair::KeptParts;
use zmend::{Error, Faces, Mended, Options, Result, repair_keeping_good};

pub(crate) fn run(input: &Path, goal: &Path, args: &WorkArgs) -> Result<ExitCode> {
    let GoalFormat::Mesh(format) = goal::format(goal, args.write.format.map(Into::into))? else {
        return Err(refuse("octrees hold no faces that could be kept", "name a mesh to write"));
    };
    if OctreeFormat::of_file(input)?.is_some() {
        return Err(refuse("octrees hold no faces that could be kept", "leave it away"));
    }
    goal::check(goal, &[input], args.write.force)?;
    crate::volume::refuse(input)?;
    let topology = args.handles.options();
    let mut options = Options { topology, ..repair::options(args, SurfaceArg::Mc) };
    if format.has_only_triangles() {
        options.faces = Faces::Triangles;
    }
    options.max_memory = memory::limit(args.grid.max_memory)?;
    let bars = Bars::new(!args.tell.quiet && !args.tell.json);
    let start = Instant::now();
    bars.start("read", 0);
    let mesh = io::read(input)?;
    let (precision, loses_digits) = digits::choose(&mesh.report().bounds, &options, format, args.write.ascii)?;
    let mended = repair_keeping_good(&mesh, &options, &HealOptions::default(), &bars)?;
    drop(mesh);
    bars.start("write", 0);
    // Kept points lose nothing, if the format can hold them.
    let precision = if convert::is_single(&mended.mesh) { precision } else { Precision::Double };
    let write = WriteOptions { precision, is_text: args.write.ascii, ..WriteOptions::default() };
    let size = interrupt::noted(|| io::write_as(goal, format, &mended.mesh, write))?;
    let seconds = start.elapsed().as_secs_f64();
    drop(bars);
    if args.tell.quiet {
        return Ok(ExitCode::SUCCESS);
    }
    let mut warnings: Vec<String> =
        mended.rebuilt.iter().flat_map(|report| &report.warnings).map(ToString::to_string).collect();
    if loses_digits || (precision == Precision::Double && format.is_single(args.write.ascii)) {
        warnings.push(format!("{}: {format} has 32 bits a coordinate, the mesh needs more", goal.display()));
    }
    warnings.iter().for_each(print::warning);
    let verdict = Measured::of(&mended.mesh).verdict();
    if args.tell.json {
        let told = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "output": {
                "path": goal.display().to_string(),
                "format": format.extension(),
                "bytes": size,
                "vertices": mended.mesh.points.len(),
                "faces": mended.mesh.faces.len(),
                "verdict": verdict,
            },
            "before": heal::as_json(&mended.before),
            "healed": heal::as_json(&mended.healed),
            "steps": heal::steps_json(&mended.steps),
            "components": components(&mended.kept),
            "grid": mended.rebuilt.as_ref().map(|report| json::grid(&report.frame)),
            "warnings": warnings,
            "seconds": seconds,
        });
        print::out(&format!("{told}\n"))?;
    } else {
        let table = heal::table([&mended.before, &mended.healed], &mended.steps);
        let written = convert::told(goal, &mended.mesh, size);
        let told = words(&mended);
        print::out(&format!("{table}{told}{written}\n{}\n{verdict}\n", time(seconds)))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn refuse(problem: &str, remedy: &str) -> Error {
    Error::setting("keep-good", problem, remedy)
}

fn components(kept: &KeptParts) -> serde_json::Value {
    json!({
        "all": kept.parts,
        "kept": kept.kept,
        "defective": kept.defective,
        "meeting": kept.meeting,
        "nested": kept.nested,
        "overrun": kept.overrun,
        "faces_after_healing": kept.faces,
        "faces_kept": kept.kept_faces,
    })
}

/// What was kept, and why not all.
fn words(mended: &Mended) -> String {
    let kept = &mended.kept;
    let all = counted(kept.parts, "component", "components");
    let mut text =
        format!("{} of {all} kept, {} of {} faces\n", count(kept.kept), count(kept.kept_faces), count(kept.faces));
    let reasons = [
        (kept.defective, "not closed, manifold and oriented"),
        (kept.meeting, "passing through or touching themselves or others"),
        (kept.nested, "in or around others that are not good or do not fit"),
        (kept.overrun, "in the way of what was made anew"),
    ];
    let reasons: Vec<String> =
        reasons.iter().filter(|(n, _)| *n > 0).map(|(n, why)| format!("{} {why}", count(*n))).collect();
    if let Some(report) = &mended.rebuilt {
        let cell = real(report.frame.cell_size());
        let _ = writeln!(text, "made anew with cells of {cell}: {}", reasons.join("; "));
        let memory = memory::peak().map(bytes);
        text += &memory.map_or(String::new(), |memory| format!("{memory} of memory\n"));
    }
    text
}
