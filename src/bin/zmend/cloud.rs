//! `zmend surface` and `zmend points`: from points to surfaces and back.

use crate::args::{CloudArgs, CloudMethodArg, Limit, PointsArgs};
use crate::bars::Bars;
use crate::print::Table;
use crate::solid::{self, Job, Work};
use crate::{convert, goal, interrupt, memory, print, units};
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;
use zmend::cloud::{CloudReport, ScatterOptions, pivot, scatter_into};
use zmend::io::{self, CloudFormat, CloudWriter};
use zmend::mesh::Bounds;
use zmend::{Error, Place, Result};

/// Cells so many times as wide as points are apart lose what the points show.
const COARSE: f64 = 4.0;

pub(crate) fn surface(args: &CloudArgs) -> Result<ExitCode> {
    let CloudArgs { input, out, write, tell, .. } = args;
    let to = goal::format(out, write.format.map(Into::into))?;
    goal::check(out, &[input], write.force)?;
    if args.method == CloudMethodArg::Ball {
        return ball(args);
    }
    if !args.radius.is_empty() {
        let problem = "only a ball has a radius";
        return Err(Error::setting("radius", problem, "say --method ball, or leave this option away"));
    }
    let work = Work {
        options: args.options(),
        given: None,
        cell: args.cell,
        max_memory: args.max_memory,
        cloud: Some(args),
        write,
        tell,
    };
    let topology = args.handles.options();
    let (sketch, volume, skeleton, patches) = (None, None, None, None);
    solid::run(&Job { input, goal: out, to, work, topology, sketch, volume, skeleton, patches })?;
    Ok(ExitCode::SUCCESS)
}

/// Triangles between points.
fn ball(args: &CloudArgs) -> Result<ExitCode> {
    let CloudArgs { input, out, write, tell, .. } = args;
    goal::mesh_format(out)?;
    let bars = Bars::new(!tell.quiet && !tell.json).within(memory::limit(args.max_memory)?);
    let mut points = io::read_cloud(input)?;
    if args.no_normals {
        points.normals.clear();
    }
    let mesh = pivot(&points, &args.radius, &bars)?;
    drop(bars);
    let bytes = convert::write(out, &mesh, write.ascii)?;
    if tell.quiet {
        return Ok(ExitCode::SUCCESS);
    }
    let report = mesh.report();
    if tell.json {
        let all = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "input": { "path": input.display().to_string(), "points": points.points.len(), "had_normals": points.has_normals() },
            "output": {
                "path": out.display().to_string(),
                "bytes": bytes,
                "vertices": mesh.points.len(),
                "faces": mesh.faces.len(),
                "boundary_edges": report.boundary_edges,
                "holes": report.boundary_loops,
            },
        });
        print::out(&format!("{all}\n"))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut table = Table::default();
    table.line("points", &[Some(units::count(points.points.len() as u64))]);
    table.line("boundary edges", &[Some(units::count(report.boundary_edges))]);
    table.line("holes", &[Some(units::count(report.boundary_loops))]);
    let remedy = if report.boundary_edges > 0 { "; `zmend repair` closes it" } else { "" };
    print::out(&format!("{}\n\n{table}\nmanifold, oriented{remedy}\n", convert::told(out, &mesh, bytes)))?;
    Ok(ExitCode::SUCCESS)
}

/// What is told of a cloud of points.
pub(crate) fn lines(report: &CloudReport, table: &mut Table) {
    table.line("points", &[Some(units::count(report.points as u64))]);
    table.line("spacing of points", &[Some(units::real(report.spacing))]);
    let sides = if report.had_normals {
        "told by normals".to_owned()
    } else {
        let share = 100.0 * report.seen_from_outside as f64 / report.points as f64;
        format!("seen from outside for {share:.0} % of the points")
    };
    table.line("sides", &[Some(sides)]);
}

/// The same for scripts.
pub(crate) fn as_json(report: &CloudReport, path: &Path) -> Value {
    json!({
        "path": path.display().to_string(),
        "points": report.points,
        "dropped_points": report.dropped,
        "had_normals": report.had_normals,
        "seen_from_outside": report.seen_from_outside,
        "spacing": report.spacing,
    })
}

/// What is to be known of a cloud.
pub(crate) fn warnings(report: &CloudReport, cell: f64) -> Vec<String> {
    let mut warnings = Vec::new();
    if cell > COARSE * report.spacing {
        let [cell, spacing] = [cell, report.spacing].map(units::real);
        warnings.push(format!(
            "cells of {cell} are much wider than points are apart, {spacing}: --depth or --cell makes them finer"
        ));
    }
    if report.dropped > 0 {
        let dropped = units::counted(report.dropped as u64, "point", "points");
        warnings.push(format!("{dropped} lay where others do, or nowhere, and were left out"));
    }
    if !report.had_normals && report.seen_from_outside == 0 {
        warnings.push(
            "infinity gets between the points everywhere: which side is outside was guessed; normals or a greater --gap would tell"
                .to_owned(),
        );
    }
    warnings
}

pub(crate) fn points(args: &PointsArgs) -> Result<ExitCode> {
    let PointsArgs { input, out, no_normals, .. } = args;
    let format = CloudFormat::from_path(out).ok_or_else(|| {
        let remedy = "give it a name that ends in .xyz or .ply";
        Error::format(out.display().to_string(), Place::Whole, "the name says no format for points", remedy)
    })?;
    goal::check(out, &[input], args.force)?;
    let bars = Bars::new(true);
    let mesh = io::read(input)?;
    let mut bounds = Bounds::EMPTY;
    mesh.points.iter().for_each(|&p| bounds.add(p));
    let spacing = match args.spacing {
        Limit::Length(length) => length,
        Limit::Percent(percent) if !bounds.is_empty() => percent / 100.0 * bounds.extent().length(),
        Limit::Percent(_) => 1.0,
    };
    let options = ScatterOptions { spacing: Some(spacing), pattern: args.pattern.into(), seed: args.seed };
    let (count, bytes) = interrupt::noted(|| {
        let mut writer = CloudWriter::create(out, format, !no_normals, spacing)?;
        let count = scatter_into(&mesh, &options, &mut |point, normal| writer.point(point, normal), &bars)?;
        Ok((count, writer.finish()?))
    })?;
    drop(bars);
    let (points, bytes) = (units::counted(count, "point", "points"), units::bytes(bytes));
    print::out(&format!("{}: {points}, {} apart, {bytes}\n", out.display(), units::real(spacing)))?;
    Ok(ExitCode::SUCCESS)
}
