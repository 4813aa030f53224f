//! `zmend heal`: local repairs.

use crate::args::{HealArgs, Limit};
use crate::bars::Bars;
use crate::print::{self, Table};
use crate::units::{count, counted};
use crate::{convert, goal};
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::process::ExitCode;
use zmend::mesh::{Defects, HealOptions, HealStep};
use zmend::{Result, io};

pub(crate) fn run(args: &HealArgs) -> Result<ExitCode> {
    goal::mesh_format(&args.out)?;
    goal::check(&args.out, &[&args.input], args.output.force)?;
    let bars = Bars::new(!args.output.json);
    bars.start("read", 0);
    let mesh = io::read(&args.input)?;
    let (tolerance, is_absolute) = match args.tolerance {
        Limit::Length(length) => (length, true),
        Limit::Percent(percent) => (percent / 100.0, false),
    };
    let options = HealOptions {
        tolerance,
        is_absolute,
        max_hole_edges: args.max_hole,
        smooth: !args.plain,
        check_intersections: !args.quick,
    };
    let healed = mesh.heal(&options, &bars)?;
    bars.start("write", 0);
    let bytes = convert::write(&args.out, &healed.mesh, false)?;
    drop(bars);
    if args.output.json {
        let told = json!({
            "path": args.out.display().to_string(),
            "bytes": bytes,
            "vertices": healed.mesh.points.len(),
            "faces": healed.mesh.faces.len(),
            "before": as_json(&healed.before),
            "after": as_json(&healed.after),
            "steps": steps_json(&healed.steps),
        });
        print::out(&format!("{told}\n"))?;
    } else {
        let written = convert::told(&args.out, &healed.mesh, bytes);
        let is_healed = healed.after.is_none();
        let told = table([&healed.before, &healed.after], &healed.steps);
        print::out(&format!("{told}{written}\n{}\n", verdict(is_healed, healed.steps.is_empty())))?;
    }
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn as_json(defects: &Defects) -> Value {
    let mut object: Map<String, Value> =
        defects.counts()[..11].iter().map(|(name, n)| (name.replace([' ', '-'], "_"), json!(n))).collect();
    object.insert("self_intersections".to_owned(), json!(defects.self_intersections));
    Value::Object(object)
}

pub(crate) fn steps_json(steps: &[HealStep]) -> Value {
    steps.iter().map(|s| json!({ "name": s.name, "count": s.count, "undone": s.is_undone })).collect()
}

/// Defects before and after, and what was done.
pub(crate) fn table(defects: [&Defects; 2], steps: &[HealStep]) -> String {
    let mut table = Table::default();
    let [before, after] = defects.map(Defects::counts);
    let found: Vec<usize> = (0..11).filter(|&i| before[i].1 + after[i].1 > 0).collect();
    let most = Defects::MOST as u64;
    let words = |defects: &Defects| {
        defects.self_intersections.map(|n| if n > most { format!("over {}", count(most)) } else { count(n) })
    };
    let crosses = defects.iter().any(|d| d.self_intersections.is_some_and(|n| n > 0));
    if !found.is_empty() || crosses {
        table.line("", &["before", "after"].map(|name| Some(name.to_owned())));
    }
    for i in found {
        table.line(before[i].0, &[before[i].1, after[i].1].map(|n| Some(count(n))));
    }
    if crosses {
        table.line("self-intersections", &defects.map(words));
    }
    let mut text = table.to_string();
    for step in steps {
        let undone = if step.is_undone { " (undone: something else was worse for it)" } else { "" };
        let _ = writeln!(text, "  {}{undone}", done(step.name, step.count));
    }
    text
}

/// What a step did, as a person says it.
fn done(step: &str, times: u64) -> String {
    let (one, many) = match step {
        "replaced" => ("point without a place was given one", "points without a place were given one"),
        "removed" => ("face or point of no use was removed", "faces and points of no use were removed"),
        "unduplicated" => ("duplicate face was removed", "duplicate faces were removed"),
        "welded" => ("point was welded to another", "points were welded to others"),
        "collapsed" => ("face that collapsed was removed", "faces that collapsed were removed"),
        "stitched" => ("point was stitched into an edge", "points were stitched into edges"),
        "flattened" => ("face without area was removed", "faces without area were removed"),
        "turned" => ("face was turned over", "faces were turned over"),
        "cut apart" => ("point was doubled to cut solids apart", "points were doubled to cut solids apart"),
        "filled" => ("hole was filled", "holes were filled"),
        "untied" => ("point was doubled where fans touch", "points were doubled where fans touch"),
        other => return format!("{other}: {}", count(times)),
    };
    counted(times, one, many)
}

fn verdict(is_healed: bool, is_unchanged: bool) -> &'static str {
    match (is_healed, is_unchanged) {
        (true, true) => "nothing to heal",
        (true, false) => "healed: closed, manifold, oriented",
        (false, _) => {
            "what is left needs more: zmend repair --keep-good makes a solid of it, and keeps the components that are good"
        }
    }
}
