//! How handles and tunnels are told: tables for people, JSON for scripts; and files to look at.

use crate::print::Table;
use crate::{json, units};
use glam::DVec3;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use zmend::geom::Frame;
use zmend::grid::key::SIDE;
use zmend::io::{skeleton, skt};
use zmend::repair::Trace;
use zmend::topology::{Betti, Handle, Kind, Measure, TopologyReport};
use zmend::{Error, Place, Result};

/// Rows of tables for people; scripts get all.
const ROWS: usize = 20;

/// A table of handles and tunnels. `cell` is the size of the cells that areas are counted in.
pub(crate) fn table(names: [&str; 2], handles: &[&Handle], frame: &Frame, cell: f64, measure: Measure) -> String {
    if handles.is_empty() {
        return String::new();
    }
    let is_original = measure == Measure::Original;
    let mut table = Table::default();
    let mut head = vec!["area", "diameter", "component", "at x", "y", "z"];
    if is_original {
        head.insert(2, "TopoMender");
    }
    let head: Vec<Option<String>> = head.into_iter().map(|word| Some(word.to_owned())).collect();
    table.line("", &head);
    for handle in handles.iter().take(ROWS) {
        let name = match handle.kind {
            Kind::Cut => names[0],
            Kind::Fill => names[1],
        };
        let mut numbers = vec![handle.area * cell * cell, handle.diameter() * cell];
        if is_original {
            numbers.push(handle.original_size() * cell * cell);
        }
        let place = place(handle, frame).to_array();
        let cells = numbers.into_iter().map(units::real);
        let cells = cells.chain([handle.component.to_string()]).chain(place.map(units::real));
        table.line(name, &cells.map(Some).collect::<Vec<_>>());
    }
    let more = handles.len().saturating_sub(ROWS);
    let more = if more > 0 {
        format!("  and {} more: --json lists them all\n", units::count(more as u64))
    } else {
        String::new()
    };
    format!("{table}{more}\n")
}

/// What was found and done, in words.
pub(crate) fn report_text(report: &TopologyReport, frame: &Frame, cell: f64, measure: Measure) -> String {
    let TopologyReport { before, after, cuts, fills, .. } = report;
    let handles: Vec<&Handle> = cuts.iter().chain(fills).collect();
    let mut text = table(["cut", "filled"], &handles, frame, cell, measure);
    let mut done = vec![
        units::counted(cuts.len() as u64, "handle cut", "handles cut"),
        units::counted(fills.len() as u64, "tunnel filled", "tunnels filled"),
    ];
    if report.drilled > 0 {
        done.push(units::counted(report.drilled, "wall drilled through", "walls drilled through"));
    }
    if report.islands_dropped > 0 {
        done.push(units::counted(report.islands_dropped, "floating part dropped", "floating parts dropped"));
    }
    if report.cavities_filled > 0 {
        done.push(units::counted(report.cavities_filled, "cavity filled", "cavities filled"));
    }
    let changed = units::counted(report.changed_cells, "cell", "cells");
    let _ = writeln!(text, "before: {before}\nafter: {after}\n{}; {changed} changed\n", done.join(", "));
    text
}

/// The same for scripts.
pub(crate) fn report_json(report: &TopologyReport, frame: &Frame, cell: f64, measure: Measure) -> Value {
    let list =
        |handles: &[Handle]| -> Vec<Value> { handles.iter().map(|handle| handle_json(handle, frame, cell)).collect() };
    json!({
        "measure": if measure == Measure::Original { "topomender" } else { "area" },
        "before": betti_json(&report.before),
        "after": betti_json(&report.after),
        "cuts": list(&report.cuts),
        "fills": list(&report.fills),
        "drilled": report.drilled,
        "islands_dropped": report.islands_dropped,
        "cavities_filled": report.cavities_filled,
        "removed_elements": report.removed,
        "added_elements": report.added,
        "changed_cells": report.changed_cells,
    })
}

pub(crate) fn betti_json(betti: &Betti) -> Value {
    json!({ "components": betti.components, "handles": betti.handles, "cavities": betti.cavities })
}

/// Areas in model units squared, lengths in model units.
pub(crate) fn handle_json(handle: &Handle, frame: &Frame, cell: f64) -> Value {
    json!({
        "area": handle.area * cell * cell,
        "diameter": handle.diameter() * cell,
        "squares": handle.squares,
        "topomender": handle.original_size() * cell * cell,
        "component": handle.component,
        "at": json::vector(place(handle, frame)),
    })
}

/// Where a handle is, in the model's coordinates.
fn place(handle: &Handle, frame: &Frame) -> DVec3 {
    frame.origin() + DVec3::from(handle.centre) * (frame.size() / f64::from(SIDE))
}

/// Whether a skeleton, or membranes, can be written there.
pub(crate) fn check_extension(path: &Path, known: &[&str]) -> Result<()> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("").to_ascii_lowercase();
    if known.contains(&extension.as_str()) {
        return Ok(());
    }
    let remedy = format!("give it a name that ends in .{}", known.join(" or ."));
    Err(Error::format(path.display().to_string(), Place::Whole, "the name says no format that is known here", remedy))
}

/// Writes the skeleton as the name says: .skt, .ply or .obj.
pub(crate) fn write_skeleton(path: &Path, trace: &Trace, frame: &Frame) -> Result<u64> {
    let is_skt = PathBuf::from(path).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("skt"));
    if is_skt { skt::write(path, &trace.to_skt(frame)) } else { skeleton::write_lines(path, &trace.to_lines(frame)) }
}
