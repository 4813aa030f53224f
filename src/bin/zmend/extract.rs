//! `zmend extract`: from volumes to surfaces.

use crate::args::{ExtractArgs, MethodArg};
use crate::bars::Bars;
use crate::goal::{self, GoalFormat};
use crate::measure::Side;
use crate::print::{self, Table};
use crate::repair::after;
use crate::solid::{self, Job, Work, verdict};
use crate::volume::{Loaded, Told, is_volume};
use crate::{digits, interrupt, json, memory, units};
use serde_json::json;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use zmend::contour::volume::{Border, ExtractOptions, extract, extract_label};
use zmend::io::{self, Format, WriteOptions};
use zmend::mesh::Bounds;
use zmend::progress::{Progress, Stage};
use zmend::volume::Level;
use zmend::{Error, Options, Place, Result};

pub(crate) fn run(args: &ExtractArgs) -> Result<ExitCode> {
    let ExtractArgs { input, out, write, .. } = args;
    let to = goal::format(out, write.format.map(Into::into))?;
    goal::check(out, &[input], write.force)?;
    let topology = args.handles.options();
    match to {
        GoalFormat::Mesh(format) if topology.is_nothing() => direct(args, format)?,
        _ => {
            let of_octree = |problem: &str, remedy: &str| Err(Error::setting("method", problem, remedy));
            let Some(surface) = args.method().surface() else {
                return of_octree(
                    "octrees, on which topology is repaired, have no such surface",
                    "take mc, dc or nets",
                );
            };
            if args.open {
                return of_octree("only surfaces made of the volume itself can be open", "leave --open away");
            }
            if !is_volume(input, Some(&args.volume))? {
                let remedy = "`zmend repair` takes meshes; of samples without a header say what they are: --raw";
                return Err(Error::format(input.display().to_string(), Place::Whole, "this is no volume", remedy));
            }
            let options = Options { surface, ..Options::default() };
            let given = args.cell.map(|_| "cell");
            let (cell, max_memory, tell) = (args.cell, args.max_memory, &args.tell);
            let work = Work { options, given, cell, max_memory, cloud: None, write, tell };
            let volume = Some(&args.volume);
            solid::run(&Job {
                input,
                goal: out,
                to,
                work,
                topology,
                sketch: None,
                volume,
                skeleton: None,
                patches: None,
            })?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Extracts the surface from the volume itself.
fn direct(args: &ExtractArgs, format: Format) -> Result<()> {
    let ExtractArgs { input, out, write, tell, .. } = args;
    let label = args.volume.label;
    check_label(args)?;
    let bars = Bars::new(!tell.quiet && !tell.json).within(memory::limit(args.max_memory)?);
    let start = Instant::now();
    let (mut volume, level) = match label {
        Some(label) => (Loaded::labelled(input, &args.volume, label, &bars)?, Level::above(0.0)),
        None => Loaded::open(input, &args.volume, &bars)?,
    };
    if let Some(cell) = args.cell {
        volume = volume.on_cubes(cell, &bars)?;
    }
    let Loaded { image, told } = volume;
    let read = start.elapsed();
    let placement = image.placement();
    let mut bounds = Bounds::EMPTY;
    image.corners().into_iter().for_each(|corner| bounds.add(corner));
    let (precision, _) = digits::of_box(&bounds, placement.spacing().min_element(), format, write.ascii)?;
    let border = if args.open { Border::Open } else { Border::Closed };
    let options =
        ExtractOptions { level, method: args.method().into(), border, placement, ..ExtractOptions::default() };
    let write_options = WriteOptions { precision, is_text: write.ascii, ..WriteOptions::default() };
    let (sizes, extracted, bytes) = interrupt::noted(|| {
        let mut writer = io::create(out, format, write_options)?;
        let sizes = match label {
            Some(label) => extract_label(&image, label, &options, &mut writer, &bars)?,
            None => extract(&image, &options, &mut writer, &bars)?,
        };
        if label.is_some() && sizes.points == 0 {
            return Err(told.without_label());
        }
        let extracted = start.elapsed();
        bars.begin(Stage::Write, 0);
        Ok((sizes, extracted, writer.finish()?))
    })?;
    let total = start.elapsed();
    if tell.quiet {
        return Ok(());
    }
    let peak_memory = memory::peak();
    let mut side = after(sizes, None, out, bytes, tell.report)?;
    if args.open {
        side.euler = side.measured.as_ref().map(|measured| measured.report.euler);
    }
    drop(bars);
    let times = [
        ("read", read),
        ("extract", extracted.saturating_sub(read)),
        ("write", total.saturating_sub(extracted)),
        ("total", total),
    ];
    Outcome { args, format, told, side, times, peak_memory }.tell()
}

/// Refuses what would not leave the surfaces of labels fit together.
fn check_label(args: &ExtractArgs) -> Result<()> {
    if args.volume.label.is_none() {
        return Ok(());
    }
    let refuse = |option: &'static str, problem: &str| Err(Error::setting(option, problem, "leave this option away"));
    if args.method() != MethodArg::Nets {
        return refuse("method", "surfaces of labels fit together by surface nets only");
    }
    if args.cell.is_some() {
        return refuse("cell", "numbers of materials cannot be interpolated");
    }
    Ok(())
}

/// What came out.
struct Outcome<'a> {
    args: &'a ExtractArgs,
    format: Format,
    told: Told,
    side: Side,
    times: [(&'static str, Duration); 4],
    peak_memory: Option<u64>,
}

impl Outcome<'_> {
    fn tell(&self) -> Result<()> {
        let Outcome { args, format, told, side, times, peak_memory } = self;
        let ExtractArgs { input, out, volume, .. } = args;
        let warnings = told.warnings();
        warnings.iter().for_each(print::warning);
        let verdict = if args.open && side.measured.is_none() {
            "manifold, oriented, open at the border: by construction; --report full measures it".to_owned()
        } else {
            verdict(Some(side))
        };
        if args.tell.json {
            let output = json!({
                "path": out.display().to_string(),
                "format": format.extension(),
                "verdict": verdict,
            });
            let seconds: serde_json::Map<String, serde_json::Value> =
                times.iter().map(|&(name, time)| (name.to_owned(), json!(time.as_secs_f64()))).collect();
            let all = json!({
                "version": env!("CARGO_PKG_VERSION"),
                "input": told.json(),
                "output": json::merged(json::side(side), output),
                "options": {
                    "iso": volume.iso,
                    "below": volume.below,
                    "label": volume.label,
                    "method": args.method().name(),
                    "open": args.open,
                    "threads": rayon::current_num_threads(),
                },
                "warnings": warnings,
                "seconds": seconds,
                "peak_memory_bytes": peak_memory,
            });
            return print::out(&format!("{all}\n"));
        }
        let mut table = Table::default();
        told.lines(&mut table);
        side.lines().into_iter().for_each(|(label, value)| table.line(label, &[value]));
        let words = times.iter().map(|&(name, time)| format!("{name} {}", units::time(time.as_secs_f64())));
        let times = words.collect::<Vec<_>>().join(", ");
        let memory = peak_memory.map_or(String::new(), |bytes| format!(", {} of memory", units::bytes(bytes)));
        let (input, out, level) = (input.display(), out.display(), told.level_words());
        print::out(&format!("{input} -> {out}: {format}, what is {level}\n\n{table}\n{times}{memory}\n{verdict}\n"))
    }
}
