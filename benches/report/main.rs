//! What hashing buys: zmend beside a pointer octree and maps with an entry a cell, as tables and plots.
//!
//! ```sh
//! cargo bench --bench report               # writes docs/benchmarks.md and docs/img; takes some ten minutes on a quiet machine
//! cargo bench --bench report -- --quick    # only prints, small depths; a minute
//! ```
//!
//! What is compared, and how, stands in docs/benchmarks.md, "What hashing buys". All times are of the processor.

#[path = "../common/mod.rs"]
mod common;
mod markdown;
mod measure;
#[path = "../pointer_octree/mod.rs"]
mod pointer_octree;
mod repair;
mod search;
mod svg;
mod topology;

use measure::Effort;
use std::fs;
use std::path::Path;
use zmend::Mesh;
use zmend::geom::Frame;
use zmend::mesh::{TriangleSource, sample};

/// What is measured how thoroughly.
pub(crate) struct Plan {
    pub(crate) effort: Effort,
    /// Depths at which a repair is measured.
    pub(crate) repair: std::ops::RangeInclusive<u32>,
    /// The depth of tables that show one depth.
    pub(crate) depth: u32,
    /// Depths at which leaves are searched.
    pub(crate) search: std::ops::RangeInclusive<u32>,
    /// Depths at which solids are thinned.
    pub(crate) topology: std::ops::RangeInclusive<u32>,
    /// The greatest depth at which every element of a solid has an entry.
    pub(crate) elements: u32,
}

/// Text for docs/benchmarks.md, and plots for docs/img.
#[derive(Default)]
pub(crate) struct Report {
    pub(crate) text: String,
    pub(crate) plots: Vec<(&'static str, String)>,
}

impl Report {
    /// Adds text.
    pub(crate) fn say(&mut self, text: impl AsRef<str>) {
        self.text.push_str(text.as_ref());
    }

    /// A plot, with words for who does not see it.
    pub(crate) fn plot(&mut self, name: &'static str, words: &str, svg: String) {
        self.say(format!("![{words}](img/{name})\n\n"));
        self.plots.push((name, svg));
    }
}

/// A sample, and the grid over it.
pub(crate) fn input(name: &str, detail: u32, depth: u32) -> (Mesh, Frame) {
    let mut mesh = sample::build(name, detail).expect("a sample");
    let bounds = mesh.bounds().expect("in memory");
    (mesh, Frame::fit(&bounds, depth, 0.9).expect("samples fit"))
}

fn main() -> std::io::Result<()> {
    let quick = std::env::args().any(|argument| argument == "--quick");
    let plan = if quick {
        Plan { effort: Effort::QUICK, repair: 6..=8, depth: 8, search: 6..=7, topology: 6..=7, elements: 6 }
    } else {
        Plan { effort: Effort::FULL, repair: 6..=10, depth: 9, search: 6..=9, topology: 6..=9, elements: 7 }
    };
    let mut report = Report::default();
    repair::report(&plan, &mut report);
    search::report(&plan, &mut report);
    topology::report(&plan, &mut report);
    if quick {
        println!("{}", report.text);
        return Ok(());
    }
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    for (name, svg) in &report.plots {
        fs::write(docs.join("img").join(name), svg)?;
    }
    markdown::replace(&docs.join("benchmarks.md"), "cargo bench --bench report", &report.text)?;
    println!("{}", report.text);
    Ok(())
}
