//! `zmend features`: lines along which a mesh folds, ends or branches.

use crate::args::FeaturesArgs;
use crate::print::{self, Table};
use crate::units::{count, real};
use crate::{goal, interrupt};
use serde_json::json;
use std::process::ExitCode;
use zmend::Result;
use zmend::io::{self, skeleton};
use zmend::mesh::{FeatureOptions, Topology, chains};

/// Red, blue, green and violet, by kind.
const COLOURS: [skeleton::Colour; 4] = [[202, 0, 32], [5, 113, 176], [26, 150, 65], [117, 60, 160]];
const KINDS: [&str; 4] = ["folds outwards", "folds inwards", "ends", "branches"];

pub(crate) fn run(args: &FeaturesArgs) -> Result<ExitCode> {
    goal::check(&args.out, &[&args.input], args.output.force)?;
    let mesh = io::read(&args.input)?;
    let topology = Topology::new(&mesh);
    let others = !args.folds_only;
    let options = FeatureOptions { angle: args.angle.to_radians(), boundary: others, non_manifold: others };
    let found = topology.features(&options);
    let kinds = [&found.convex, &found.concave, &found.boundary, &found.non_manifold];
    let mut lines = skeleton::Polylines { points: mesh.points.clone(), lines: Vec::new() };
    let mut table = Table::default();
    table.line("the surface", &["edges", "lines", "length"].map(|name| Some(name.to_owned())));
    let mut told = Vec::new();
    for ((sides, colour), kind) in kinds.into_iter().zip(COLOURS).zip(KINDS) {
        let chains = chains(&topology, sides);
        let length: f64 = chains.iter().map(|chain| chain.length(&topology)).sum();
        let numbers = [count(sides.len() as u64), count(chains.len() as u64), real(length)];
        table.line(kind, &numbers.map(Some));
        told.push(json!({ "kind": kind, "edges": sides.len(), "lines": chains.len(), "length": length }));
        lines.lines.extend(chains.into_iter().map(|chain| {
            let first = chain.is_closed.then_some(chain.points[0]);
            (chain.points.into_iter().chain(first).collect(), colour)
        }));
    }
    lines.drop_unused_points();
    let bytes = interrupt::noted(|| skeleton::write_polylines(&args.out, &lines))?;
    if args.output.json {
        let path = args.out.display().to_string();
        print::out(&format!(
            "{}\n",
            json!({ "path": path, "bytes": bytes, "unknown": found.unknown.len(), "kinds": told })
        ))?;
    } else {
        print::out(&format!("{table}"))?;
        if !found.unknown.is_empty() {
            print::warning(format_args!(
                "{} edges of faces without area have no angle",
                count(found.unknown.len() as u64)
            ));
        }
    }
    Ok(ExitCode::SUCCESS)
}
