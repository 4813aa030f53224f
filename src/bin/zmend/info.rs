//! `zmend info`: what a mesh is and what is wrong with it.

use crate::args::InfoArgs;
use crate::details::Details;
use crate::measure::{self, Measured, Side};
use crate::print::{self, Table};
use crate::units::{real, vector};
use crate::volume::Loaded;
use crate::{json, units};
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;
use zmend::Result;
use zmend::io::volume::{VolumeFormat, VolumeOptions};
use zmend::io::{self, Format, InputInfo, OctreeFormat};
use zmend::progress::Silent;

pub(crate) fn run(args: &InfoArgs) -> Result<ExitCode> {
    let mut code = ExitCode::SUCCESS;
    for (i, path) in args.files.iter().enumerate() {
        if let Some(result) = look_at_other(path, args.json).transpose() {
            match result {
                Ok(text) => print::out(&if i > 0 && !args.json { format!("\n{text}") } else { text })?,
                Err(error) => {
                    print::error(&error);
                    code = ExitCode::FAILURE;
                }
            }
            continue;
        }
        match look(path, args.quick) {
            Ok((info, measured, details)) if args.json => print::out(&as_json(&info, measured, &details))?,
            Ok((info, measured, details)) => {
                let gap = if i > 0 { "\n" } else { "" };
                print::out(&format!("{gap}{}", as_text(&info, measured, &details)))?;
            }
            // Other files are no worse for it.
            Err(error) => {
                print::error(&error);
                code = ExitCode::FAILURE;
            }
        }
    }
    Ok(code)
}

fn look(path: &Path, quick: bool) -> Result<(InputInfo, Measured, Details)> {
    let file = measure::Loaded::open(path)?;
    Ok((file.info().clone(), file.measured(quick), Details::of(file.mesh())))
}

/// What is to be said of a file that is no mesh; `None` of meshes.
fn look_at_other(path: &Path, is_json: bool) -> Result<Option<String>> {
    // Files that cannot be read are told by those who read them.
    if path.is_file() && VolumeFormat::of_file(path).ok().flatten().is_some() {
        let told = Loaded::read(path, &VolumeOptions::default(), &Silent)?.told;
        return Ok(Some(if is_json { format!("{}\n", told.json()) } else { told.text() }));
    }
    look_at_octree(path, is_json)
}

/// What is to be said of an octree file; `None` of others.
fn look_at_octree(path: &Path, is_json: bool) -> Result<Option<String>> {
    if OctreeFormat::of_file(path).ok().flatten().is_none() {
        return Ok(None);
    }
    let file = io::read_octree(path, &Silent)?;
    let (info, frame) = (&file.info, &file.frame);
    if is_json {
        let solid = json::octree_file(info);
        return Ok(Some(format!("{}\n", json::merged(solid, json::grid(frame)))));
    }
    let cells = units::count(1 << info.depth);
    let mut text = format!("{}: {} of {cells} cells a side\n", info.path.display(), info.format);
    let mut table = Table::default();
    table.line("surface cells", &[Some(units::count(info.surface_cells))]);
    table.line("empty nodes", &[Some(units::count(info.empty_cells))]);
    table.line("crossed edges", &[Some(units::count(file.octree.crossings().len() as u64))]);
    table.line("volume", &[Some(real(file.octree.volume() * frame.cell_size().powi(3)))]);
    table.line("size of the file", &[Some(units::bytes(info.bytes))]);
    // The file's cube may be the one in the middle of the grid.
    let (corner, side) = if info.is_padded {
        (frame.origin() + 0.25 * frame.size(), 0.25 * frame.size())
    } else {
        (frame.origin(), frame.size())
    };
    let (corner, side, cell) = (vector(corner), real(side), real(frame.cell_size()));
    let _ = writeln!(text, "{table}  a cube of side {side} at {corner}, with cells of {cell}");
    if info.trailing_bytes > 0 {
        let ignored = units::counted(info.trailing_bytes, "byte", "bytes");
        let _ = writeln!(text, "  {ignored} behind the end of the octree mean nothing");
    }
    let _ = writeln!(text, "to make a surface of it: zmend repair {} OUT", info.path.display());
    Ok(Some(text))
}

fn as_json(info: &InputInfo, measured: Measured, details: &Details) -> String {
    let side = json::side(&Side::new(info, Some(measured)));
    format!("{}\n", json::merged(json::merged(json::file(info), side), details.json()))
}

fn as_text(info: &InputInfo, measured: Measured, details: &Details) -> String {
    let name = info.path.display();
    let welded = if matches!(info.format, Format::Stl | Format::Gltf | Format::Glb) { ", welded" } else { "" };
    let mut text = format!("{name}: {} ({}){welded}\n", info.format, info.encoding);
    let verdict = measured.verdict();
    let remedy = measured.report.faces > 0 && !measured.is_solid();
    let report = measured.report.clone();
    let mut table = Table::default();
    Side::new(info, Some(measured)).lines().into_iter().for_each(|(label, value)| table.line(label, &[value]));
    details.lines(&mut table);
    let _ = write!(text, "{table}{}", details.rims());
    if !report.bounds.is_empty() {
        let (min, max) = (vector(report.bounds.min), vector(report.bounds.max));
        let _ = writeln!(text, "  from {min} to {max}: {}", report.bounds.extent().to_array().map(real).join(" x "));
        let [min, mean, max] = [report.min_edge, report.mean_edge, report.max_edge].map(real);
        let _ = writeln!(text, "  edges from {min} to {max} long, {mean} on average");
    }
    if info.trailing_bytes > 0 {
        let ignored = units::counted(info.trailing_bytes, "byte", "bytes");
        let _ = writeln!(text, "  {ignored} behind the end of the mesh mean nothing");
    }
    let _ = writeln!(text, "{verdict}");
    if remedy {
        let _ = writeln!(text, "to repair it: zmend repair {name} OUT");
    }
    text
}
