//! What is known of a mesh, in numbers and in words.

use crate::units::{self, count, counted, real, signed};
use std::path::Path;
use zmend::io::{self, Input, InputInfo};
use zmend::mesh::{Report, Violation};
use zmend::{Mesh, Result};

/// A file whose mesh is in memory.
pub(crate) struct Loaded {
    input: Input,
    /// The mesh, if the input does not hold it.
    mesh: Option<Mesh>,
}

impl Loaded {
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let input = io::open(path)?;
        // What came through a pipe is in memory, and cannot be read again.
        let mesh = if input.mesh().is_none() { Some(io::read(path)?) } else { None };
        Ok(Loaded { input, mesh })
    }

    pub(crate) fn info(&self) -> &InputInfo {
        self.input.info()
    }

    pub(crate) fn mesh(&self) -> &Mesh {
        self.mesh.as_ref().or(self.input.mesh()).expect("one of both holds it")
    }

    /// Measures the mesh and looks for self-intersections, unless in a hurry.
    pub(crate) fn measured(&self, quick: bool) -> Measured {
        let crossings = (!quick).then(|| Crossings::of(self.mesh()));
        Measured { crossings, ..Measured::of(self.mesh()) }
    }
}

/// A mesh, measured.
pub(crate) struct Measured {
    pub(crate) report: Report,
    /// The first reason why it is not the surface of a solid.
    pub(crate) violation: Option<Violation>,
    /// Self-intersections, where they were looked for.
    pub(crate) crossings: Option<Crossings>,
}

/// The most self-intersections that are counted: bad meshes have billions.
const MOST_CROSSINGS: usize = 1_000_000;

/// How many pairs of faces meet where they should not.
#[derive(Clone, Copy)]
pub(crate) enum Crossings {
    /// So many.
    Pairs(u64),
    /// More than this.
    More(u64),
}

impl Crossings {
    fn of(mesh: &Mesh) -> Self {
        let pairs = mesh.self_intersections_up_to(MOST_CROSSINGS);
        pairs.map_or(Crossings::More(MOST_CROSSINGS as u64), |pairs| Crossings::Pairs(pairs.len() as u64))
    }

    /// How many there are at least.
    pub(crate) fn least(self) -> u64 {
        match self {
            Crossings::Pairs(n) => n,
            Crossings::More(n) => n + 1,
        }
    }

    fn words(self) -> String {
        match self {
            Crossings::Pairs(n) => count(n),
            Crossings::More(n) => format!("over {}", count(n)),
        }
    }
}

impl Measured {
    pub(crate) fn of(mesh: &Mesh) -> Self {
        Measured { report: mesh.report(), violation: mesh.validate().err(), crossings: None }
    }

    /// Reads a file and measures what it holds.
    pub(crate) fn file(path: &Path) -> Result<Self> {
        Ok(Measured::of(&io::read(path)?))
    }

    /// Measures a file that is open, and reads it anew only if it is not in memory.
    pub(crate) fn input(input: &Input) -> Result<Self> {
        input.mesh().map_or_else(|| Measured::file(&input.info().path), |mesh| Ok(Measured::of(mesh)))
    }

    /// Whether this is a closed, manifold, oriented surface that looks outwards.
    pub(crate) fn is_solid(&self) -> bool {
        self.report.faces > 0 && self.violation.is_none() && self.report.volume >= 0.0
    }

    /// What this is, or what is wrong with it.
    pub(crate) fn verdict(&self) -> String {
        let r = &self.report;
        if r.faces == 0 {
            return "empty: there are no faces".to_owned();
        }
        let Some(violation) = self.violation else {
            let inside_out = if r.volume < 0.0 { ", but inside out: its faces look inwards" } else { ": a solid" };
            let crosses = self.crossings.is_some_and(|crossings| crossings.least() > 0);
            let crossing = if crosses { ", but it passes through or touches itself" } else { "" };
            return format!("closed, manifold, oriented{inside_out}{crossing}");
        };
        let rims = counted(r.boundary_edges, "boundary edge", "boundary edges");
        let problems = [
            (r.boundary_loops, format!("{} ({rims})", counted(r.boundary_loops, "hole", "holes"))),
            (r.non_manifold_edges, counted(r.non_manifold_edges, "non-manifold edge", "non-manifold edges")),
            (r.inconsistent_edges, counted(r.inconsistent_edges, "inconsistent edge", "inconsistent edges")),
            (r.non_manifold_vertices, counted(r.non_manifold_vertices, "non-manifold vertex", "non-manifold vertices")),
            (r.dangling_faces, counted(r.dangling_faces, "face", "faces") + " with missing vertices"),
            (r.degenerate_faces, counted(r.degenerate_faces, "degenerate face", "degenerate faces")),
            (r.non_finite_points, counted(r.non_finite_points, "vertex", "vertices") + " not finite"),
        ];
        let problems: Vec<String> = problems.into_iter().filter(|(n, _)| *n > 0).map(|(_, words)| words).collect();
        if problems.is_empty() { violation.to_string() } else { problems.join(", ") }
    }
}

/// What is known of a file with a mesh, be it measured or not.
pub(crate) struct Side {
    pub(crate) bytes: Option<u64>,
    pub(crate) vertices: Option<u64>,
    pub(crate) faces: u64,
    pub(crate) euler: Option<i64>,
    pub(crate) volume: Option<f64>,
    pub(crate) measured: Option<Measured>,
}

impl Side {
    /// A file that was opened, and what was measured of it.
    pub(crate) fn new(info: &InputInfo, measured: Option<Measured>) -> Self {
        Side {
            bytes: Some(info.bytes),
            vertices: info.points,
            faces: info.polygons,
            euler: None,
            volume: None,
            measured,
        }
    }

    /// Labels and values; the same labels for every side.
    pub(crate) fn lines(&self) -> Vec<(&'static str, Option<String>)> {
        let report = self.measured.as_ref().map(|measured| &measured.report);
        let number = |of: fn(&Report) -> u64| report.map(|r| count(of(r)));
        let rare = |of: fn(&Report) -> u64| report.map(of).filter(|n| *n > 0).map(count);
        let volume = report.map_or(self.volume, |r| r.is_closed().then_some(r.volume));
        vec![
            ("vertices", report.map(|r| r.points).or(self.vertices).map(count)),
            ("unused vertices", rare(|r| r.isolated_points)),
            ("vertices not finite", rare(|r| r.non_finite_points)),
            ("faces", Some(count(self.faces))),
            ("components", number(|r| r.components)),
            ("boundary edges", number(|r| r.boundary_edges)),
            ("holes", number(|r| r.boundary_loops)),
            ("non-manifold edges", number(|r| r.non_manifold_edges)),
            ("non-manifold vertices", number(|r| r.non_manifold_vertices)),
            ("inconsistent edges", number(|r| r.inconsistent_edges)),
            ("faces with missing vertices", rare(|r| r.dangling_faces)),
            ("degenerate faces", number(|r| r.degenerate_faces)),
            ("faces without area", rare(|r| r.zero_area_faces)),
            ("duplicate faces", number(|r| r.duplicate_faces)),
            ("self-intersections", self.measured.as_ref().and_then(|m| m.crossings).map(Crossings::words)),
            ("Euler characteristic", report.map(|r| r.euler).or(self.euler).map(signed)),
            ("genus", report.and_then(|r| r.genus).map(signed)),
            ("volume", volume.map(real)),
            ("area", report.map(|r| real(r.area))),
            ("size of the file", self.bytes.map(units::bytes)),
        ]
    }
}
