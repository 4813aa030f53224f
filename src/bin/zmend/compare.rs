//! `zmend compare`: how far two meshes are from each other.

use crate::args::{CompareArgs, Limit};
use crate::bars::Bars;
use crate::json;
use crate::measure::{Loaded, Side};
use crate::print::{self, Table};
use crate::units::{count, real, vector};
use serde_json::{Value, json};
use std::process::ExitCode;
use zmend::Result;
use zmend::io::InputInfo;
use zmend::mesh::{Deviation, DistanceOptions, Distances};

pub(crate) fn run(args: &CompareArgs) -> Result<ExitCode> {
    let bars = Bars::new(!args.json);
    bars.start("read", 0);
    let (a, b) = (Loaded::open(&args.a)?, Loaded::open(&args.b)?);
    let options = DistanceOptions { samples: args.samples, seed: args.seed };
    let distances = a.mesh().distances(b.mesh(), options, &bars)?;
    bars.start("inspect", 0);
    let side = |file: &Loaded| (Side::new(file.info(), Some(file.measured(args.quick))), file.info().clone());
    let sides = [side(&a), side(&b)];
    drop(bars);
    let told = Told { diagonal: diagonal(&sides[0].0), sides, options, distances };
    print::out(&if args.json { told.json() } else { told.text() })?;
    Ok(args.max_distance.map_or(ExitCode::SUCCESS, |limit| told.judge(limit)))
}

/// The diagonal of a mesh's box, unless it is empty or a point.
fn diagonal(side: &Side) -> Option<f64> {
    let bounds = side.measured.as_ref()?.report.bounds;
    let length = bounds.extent().length();
    (!bounds.is_empty() && length > 0.0).then_some(length)
}

/// All that a comparison has to tell.
struct Told {
    /// A and B.
    sides: [(Side, InputInfo); 2],
    /// Of A's box.
    diagonal: Option<f64>,
    options: DistanceOptions,
    distances: Option<Distances>,
}

impl Told {
    fn percent(&self, distance: f64) -> Option<f64> {
        self.diagonal.map(|diagonal| 100.0 * distance / diagonal)
    }

    /// A distance as people read it.
    fn words(&self, distance: f64) -> String {
        let percent = self.percent(distance).map_or(String::new(), |percent| format!(" ({percent:.4} %)"));
        format!("{}{percent}", real(distance))
    }

    fn text(&self) -> String {
        let mut table = Table::default();
        table.line("", &["A", "B"].map(|name| Some(name.to_owned())));
        let [(a, of_a), (b, of_b)] = &self.sides;
        for ((label, a), (_, b)) in a.lines().into_iter().zip(b.lines()) {
            table.line(label, &[a, b]);
        }
        let reports = [a, b].map(|side| side.measured.as_ref().map(|m| &m.report).filter(|r| !r.bounds.is_empty()));
        table.line("least x y z", &reports.map(|r| r.map(|r| vector(r.bounds.min))));
        table.line("greatest x y z", &reports.map(|r| r.map(|r| vector(r.bounds.max))));
        let names = format!("A: {}\nB: {}\n", of_a.path.display(), of_b.path.display());
        format!("{names}\n{table}\n{}", self.distance_text())
    }

    fn distance_text(&self) -> String {
        let Some(distances) = &self.distances else {
            return format!("no distance: {}\n", self.empty());
        };
        let ways = [distances.there, distances.back];
        let mut table = Table::default();
        table.line("distance", &["A to B", "B to A"].map(|way| Some(way.to_owned())));
        let mut line = |label: &str, of: &dyn Fn(&Deviation) -> String| {
            table.line(label, &ways.each_ref().map(|way| Some(of(way))));
        };
        line("greatest", &|way| self.words(way.max));
        line("mean", &|way| self.words(way.mean));
        line("root mean square", &|way| self.words(way.rms));
        line("points measured", &|way| count(way.points));
        line("greatest from", &|way| vector(way.from));
        line("to", &|way| vector(way.to));
        let per = self.diagonal.map_or(String::new(), |d| format!("; 100 % is the diagonal of A's box, {}", real(d)));
        format!("{table}\nHausdorff distance {}{per}\n", self.words(distances.hausdorff()))
    }

    /// Why there is no distance.
    fn empty(&self) -> &'static str {
        let has_area = |side: &Side| side.measured.as_ref().is_some_and(|m| m.report.area > 0.0);
        match self.sides.each_ref().map(|(side, _)| has_area(side)) {
            [true, false] => "B has no face with an area",
            [false, true] => "A has no face with an area",
            _ => "there is no face with an area",
        }
    }

    fn json(&self) -> String {
        let way = |way: &Deviation| {
            json!({
                "points": way.points,
                "max": way.max,
                "max_percent": self.percent(way.max),
                "mean": way.mean,
                "mean_percent": self.percent(way.mean),
                "rms": way.rms,
                "rms_percent": self.percent(way.rms),
                "from": json::vector(way.from),
                "to": json::vector(way.to),
            })
        };
        let distance: Option<Value> = self.distances.as_ref().map(|distances| {
            json!({
                "hausdorff": distances.hausdorff(),
                "hausdorff_percent": self.percent(distances.hausdorff()),
                "a_to_b": way(&distances.there),
                "b_to_a": way(&distances.back),
            })
        });
        let [a, b] = self.sides.each_ref().map(|(side, info)| json::merged(json::side(side), json::file(info)));
        let all = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "a": a,
            "b": b,
            "diagonal": self.diagonal,
            "distance": distance,
            "options": { "samples": self.options.samples, "seed": self.options.seed },
        });
        format!("{all}\n")
    }

    /// Success if the surfaces are as near as asked for.
    fn judge(&self, limit: Limit) -> ExitCode {
        let far = match (limit, &self.distances) {
            (_, None) => self.empty().to_owned(),
            (Limit::Length(most), Some(d)) if d.hausdorff() > most => format!("more than {}", real(most)),
            (Limit::Percent(most), Some(d)) if self.percent(d.hausdorff()).is_none_or(|percent| percent > most) => {
                format!("more than {most} % of the diagonal")
            }
            _ => return ExitCode::SUCCESS,
        };
        let found =
            self.distances.map_or("no distance".to_owned(), |d| format!("distance {}", self.words(d.hausdorff())));
        print::warning(format_args!("{found}: {far}"));
        ExitCode::FAILURE
    }
}
