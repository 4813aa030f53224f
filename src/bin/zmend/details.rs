//! What is known of a mesh beyond its report.

use crate::print::Table;
use crate::units::{count, counted, real};
use serde_json::{Value, json};
use std::fmt::Write;
use zmend::Mesh;
use zmend::mesh::{BoundaryLoop, Diagnosis, FeatureOptions, Topology};

/// The longest rims are listed, up to so many.
const RIMS: usize = 10;

/// Kind, orientation, spikes, rims and sharp edges.
pub(crate) struct Details {
    diagnosis: Diagnosis,
    /// Edges that fold outwards and inwards by 40 degrees or more.
    sharp: [u64; 2],
}

impl Details {
    pub(crate) fn of(mesh: &Mesh) -> Self {
        let topology = Topology::new(mesh);
        let features = topology.features(&FeatureOptions::default());
        let sharp = [&features.convex, &features.concave].map(|sides| sides.len() as u64);
        Details { diagnosis: topology.diagnose(), sharp }
    }

    /// Adds lines for what is there.
    pub(crate) fn lines(&self, table: &mut Table) {
        let d = &self.diagnosis;
        let rare = |n: u64| (n > 0).then(|| count(n));
        table.line("kind", &[Some(d.kind.to_string())]);
        table.line("faces turned over", &[rare(d.faces_to_turn)]);
        table.line("spikes", &[rare(d.spikes)]);
        table.line("edges from a vertex to itself", &[rare(d.self_edges)]);
        table.line("faces that are not planar", &[rare(d.bent_faces)]);
        table.line("sharp edges, outwards", &[rare(self.sharp[0])]);
        table.line("sharp edges, inwards", &[rare(self.sharp[1])]);
    }

    /// The longest rims, the longest first.
    fn longest(&self) -> Vec<&BoundaryLoop> {
        let mut rims: Vec<&BoundaryLoop> = self.diagnosis.loops.iter().collect();
        rims.sort_by(|a, b| b.length.total_cmp(&a.length));
        rims.truncate(RIMS);
        rims
    }

    /// The rims in words.
    pub(crate) fn rims(&self) -> String {
        let mut text = String::new();
        for rim in self.longest() {
            let ends = if rim.is_closed { "" } else { ", with ends" };
            let edges = counted(rim.sides.len() as u64, "edge", "edges");
            let _ = writeln!(text, "  a rim of {edges}, {} long{ends}", real(rim.length));
        }
        let more = self.diagnosis.loops.len().saturating_sub(RIMS);
        if more > 0 {
            let _ = writeln!(text, "  and {} that are not longer", counted(more as u64, "rim", "rims"));
        }
        text
    }

    pub(crate) fn json(&self) -> Value {
        let d = &self.diagnosis;
        let rim = |r: &&BoundaryLoop| json!({ "edges": r.sides.len(), "length": r.length, "closed": r.is_closed });
        json!({
            "kind": d.kind.to_string(),
            "orientable": d.is_orientable,
            "faces_turned_over": d.faces_to_turn,
            "spikes": d.spikes,
            "self_edges": d.self_edges,
            "bent_faces": d.bent_faces,
            "rims": d.loops.len(),
            "longest_rims": self.longest().iter().map(rim).collect::<Vec<_>>(),
            "sharp_edges_outwards": self.sharp[0],
            "sharp_edges_inwards": self.sharp[1],
        })
    }
}
