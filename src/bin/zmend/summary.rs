//! How a repair is told: tables for people, JSON for scripts.

use crate::measure::Side;
use crate::print::{self, Table};
use crate::{handles, json, units};
use serde_json::{Map, Value, json};
use std::path::Path;
use std::time::Duration;
use zmend::io::{Format, InputInfo, Precision};
use zmend::repair::Kept;
use zmend::{Inside, Keep, Offset, Options, RepairReport, Result, Surface};

/// All that a repair has to tell.
pub(crate) struct Summary<'a> {
    pub(crate) input: &'a InputInfo,
    pub(crate) before: Side,
    pub(crate) goal: &'a Path,
    pub(crate) format: Format,
    /// Precision of the written coordinates.
    pub(crate) precision: Precision,
    /// Whether this is too low for the grid, because the format can do no better.
    pub(crate) loses_digits: bool,
    pub(crate) after: Side,
    pub(crate) options: Options,
    pub(crate) report: RepairReport,
    /// What was asked for and made no difference, in words.
    pub(crate) ignored: Vec<String>,
    /// Wall-clock time of each stage, and in total.
    pub(crate) times: Vec<(&'static str, Duration)>,
    pub(crate) peak_memory: Option<u64>,
}

impl Summary<'_> {
    pub(crate) fn print(&self) -> Result<()> {
        let cells = 1u64 << self.report.frame.depth();
        let cell = units::real(self.report.frame.cell_size());
        let mut table = Table::default();
        table.line("", &["before", "after"].map(|s| Some(s.to_owned())));
        for ((label, before), (_, after)) in self.before.lines().into_iter().zip(self.after.lines()) {
            table.line(label, &[before, after]);
        }
        print::out(&format!(
            "{} -> {}: {} on a grid of {cells} cells a side, each {cell} wide\n\n{table}\n",
            self.input.path.display(),
            self.goal.display(),
            surface_name(self.options.surface),
        ))?;
        let choice = &self.report.inside;
        print::out(&format!("inside by {}: {}\n", inside_name(choice.rule), choice.reason))?;
        self.dropped().map_or(Ok(()), |dropped| print::out(&format!("{dropped}\n")))?;
        if let Some(report) = &self.report.topology {
            let frame = &self.report.frame;
            print::out(&handles::report_text(report, frame, frame.cell_size(), self.options.topology.measure))?;
        }
        self.warnings().iter().for_each(print::warning);
        let seconds: Vec<String> =
            self.times.iter().map(|&(name, time)| format!("{name} {}", units::time(time.as_secs_f64()))).collect();
        let memory = self.peak_memory.map_or(String::new(), |bytes| format!(", {} of memory", units::bytes(bytes)));
        print::out(&format!("{}{memory}\n{}\n", seconds.join(", "), self.verdict()))
    }

    pub(crate) fn print_json(&self) -> Result<()> {
        let warnings = self.warnings();
        warnings.iter().for_each(print::warning);
        let RepairReport { frame, scan, closing, .. } = &self.report;
        let seconds: Map<String, Value> =
            self.times.iter().map(|&(name, time)| (name.to_owned(), json!(time.as_secs_f64()))).collect();
        let output = json!({
            "path": self.goal.display().to_string(),
            "format": self.format.extension(),
            "coordinate_bits": if self.precision == Precision::Double { 64 } else { 32 },
            "verdict": self.verdict(),
        });
        let all = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "input": json::merged(json::side(&self.before), json::file(self.input)),
            "output": json::merged(json::side(&self.after), output),
            "options": {
                "depth": frame.depth(),
                "cell": self.options.cell,
                "scale": self.options.scale,
                "box": self.options.cube.map(|cube| json!({ "min": json::vector(cube.min), "size": cube.size })),
                "max_memory": self.options.max_memory,
                "inside": inside_name(self.options.inside),
                "gap": self.options.gap,
                "thicken": self.options.thicken,
                "offset": self.options.offset.map(Offset::distance),
                "shell": matches!(self.options.offset, Some(Offset::Shell(_))),
                "thicken_what": format!("{:?}", self.options.thicken_what).to_lowercase(),
                "keep": keep_name(self.options.keep),
                "drop_cavities": self.options.drop_cavities,
                "surface": surface_name(self.options.surface),
                "faces": format!("{:?}", self.options.faces).to_lowercase(),
                "no_self_intersections": self.options.no_self_intersections,
                "threads": rayon::current_num_threads(),
            },
            "grid": {
                "origin": json::vector(frame.origin()),
                "size": frame.size(),
                "cell_size": frame.cell_size(),
                "cells_a_side": 1u64 << frame.depth(),
            },
            "scan": {
                "bounds": json::bounds(&self.report.bounds),
                "polygons": scan.source.polygons,
                "triangles": scan.source.triangles,
                "skipped_triangles": scan.skipped_triangles,
                "hits": scan.hits,
                "merged_walls": scan.merged_walls,
            },
            "closing": {
                "odd_faces": closing.odd_faces,
                "rings": closing.rings,
                "switched": closing.switched,
            },
            "inside": {
                "rule": inside_name(self.report.inside.rule),
                "reason": self.report.inside.reason.to_string(),
                "reversed": self.report.inside.reversed,
                "vanished_edges": self.report.vanished,
            },
            "components": self.components(),
            "topology": self.report.topology.as_ref().map(|report| {
                handles::report_json(report, frame, frame.cell_size(), self.options.topology.measure)
            }),
            "octree": {
                "crossings": self.report.crossings,
                "bricks": self.report.bricks,
                "bytes": self.report.octree_bytes,
                "volume": self.report.volume,
            },
            "warnings": warnings,
            "seconds": seconds,
            "peak_memory_bytes": self.peak_memory,
        });
        print::out(&format!("{all}\n"))
    }

    /// What became of solids and cavities, if they were counted.
    fn components(&self) -> Value {
        let Kept { solids, dropped_solids, dropped_cells, cavities, filled_cavities, filled_cells } = self.report.kept;
        if !self.counts_components() {
            return Value::Null;
        }
        json!({
            "solids": solids,
            "dropped_solids": dropped_solids,
            "dropped_volume": self.volume(dropped_cells),
            "cavities": cavities,
            "filled_cavities": filled_cavities,
            "filled_volume": self.volume(filled_cells),
        })
    }

    /// The same in words.
    fn dropped(&self) -> Option<String> {
        let kept = self.report.kept;
        let solids = format!("{} of {} dropped", kept.dropped_solids, units::counted(kept.solids, "solid", "solids"));
        let cavities =
            format!("{} of {} filled", kept.filled_cavities, units::counted(kept.cavities, "cavity", "cavities"));
        let volume = |cells| units::real(self.volume(cells));
        self.counts_components().then(|| {
            format!("{solids} (volume {}), {cavities} ({})", volume(kept.dropped_cells), volume(kept.filled_cells))
        })
    }

    fn counts_components(&self) -> bool {
        self.options.keep != Keep::All || self.options.drop_cavities
    }

    fn volume(&self, cells: u64) -> f64 {
        cells as f64 * self.report.frame.cell_size().powi(3)
    }

    /// What the result is, in words.
    fn verdict(&self) -> String {
        match &self.after.measured {
            _ if self.after.faces == 0 => "empty".to_owned(),
            Some(measured) => measured.verdict(),
            None => "closed, manifold, oriented: by construction; --report full measures it".to_owned(),
        }
    }

    /// All that the user should know.
    fn warnings(&self) -> Vec<String> {
        let mut warnings: Vec<String> = self.report.warnings.iter().map(ToString::to_string).collect();
        warnings.extend_from_slice(&self.ignored);
        if self.input.trailing_bytes > 0 {
            let ignored = units::counted(self.input.trailing_bytes, "byte", "bytes");
            warnings.push(format!("{ignored} behind the end of the input's mesh were ignored"));
        }
        if self.loses_digits {
            let problem = "files of this format hold 7 digits, too few for cells so small so far from the origin";
            warnings.push(format!("{problem}: vertices may fall together; write PLY instead"));
        }
        if let Some(measured) = &self.after.measured
            && self.after.faces > 0
            && !measured.is_solid()
        {
            let stl = "; STL joins vertices at one place, other formats do not";
            let remedy = if self.format == Format::Stl { stl } else { "" };
            warnings.push(format!("the written file is not the surface of a solid: {}{remedy}", measured.verdict()));
        }
        warnings
    }
}

fn keep_name(keep: Keep) -> Value {
    match keep {
        Keep::All => json!("all"),
        Keep::Largest => json!("largest"),
        Keep::Ratio(ratio) => json!(ratio),
        Keep::Count(count) => json!(count),
    }
}

fn inside_name(inside: Inside) -> String {
    format!("{inside:?}").to_lowercase()
}

pub(crate) fn surface_name(surface: Surface) -> &'static str {
    match surface {
        Surface::MarchingCubes => "mc",
        Surface::DualContouring => "dc",
        Surface::Quads => "quads",
        Surface::Blocks => "blocks",
    }
}
