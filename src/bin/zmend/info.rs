//! `zmend info`: what a mesh is and what is wrong with it.

use crate::args::InfoArgs;
use crate::measure::{Measured, Side};
use crate::print::{self, Table};
use crate::units::{real, vector};
use crate::{json, units};
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;
use zmend::Result;
use zmend::io::{self, Format, InputInfo};

pub(crate) fn run(args: &InfoArgs) -> Result<ExitCode> {
    let mut code = ExitCode::SUCCESS;
    for (i, path) in args.files.iter().enumerate() {
        match look(path) {
            Ok((info, measured)) if args.json => print::out(&as_json(&info, measured))?,
            Ok((info, measured)) => {
                let gap = if i > 0 { "\n" } else { "" };
                print::out(&format!("{gap}{}", as_text(&info, measured)))?;
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

fn look(path: &Path) -> Result<(InputInfo, Measured)> {
    let input = io::open(path)?;
    let measured = Measured::input(&input)?;
    Ok((input.info().clone(), measured))
}

fn as_json(info: &InputInfo, measured: Measured) -> String {
    format!("{}\n", json::merged(json::file(info), json::side(&Side::new(info, Some(measured)))))
}

fn as_text(info: &InputInfo, measured: Measured) -> String {
    let name = info.path.display();
    let welded = if matches!(info.format, Format::Stl | Format::Gltf | Format::Glb) { ", welded" } else { "" };
    let mut text = format!("{name}: {} ({}){welded}\n", info.format, info.encoding);
    let verdict = measured.verdict();
    let remedy = measured.report.faces > 0 && !measured.is_solid();
    let report = measured.report.clone();
    let mut table = Table::default();
    Side::new(info, Some(measured)).lines().into_iter().for_each(|(label, value)| table.line(label, &[value]));
    let _ = write!(text, "{table}");
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
