//! Results as JSON, for scripts. Lengths, areas and volumes are in model units; unknown values are null. Self-intersections
//! are counted up to a limit, and one more than the limit stands for all beyond.

use crate::measure::{Crossings, Measured, Side};
use glam::DVec3;
use serde_json::{Value, json};
use zmend::geom::Frame;
use zmend::io::{InputInfo, OctreeInfo};
use zmend::mesh::{Bounds, Report};

/// All numbers of a mesh; the same fields whether it was measured or not.
pub(crate) fn side(side: &Side) -> Value {
    let measured = side.measured.as_ref();
    let r = measured.map(|measured| &measured.report);
    json!({
        "bytes": side.bytes,
        "measured": measured.is_some(),
        "solid": measured.map(Measured::is_solid),
        "closed": r.map(Report::is_closed),
        "manifold": r.map(Report::is_manifold),
        "oriented": r.map(Report::is_oriented),
        "verdict": measured.map(Measured::verdict),
        "violation": measured.and_then(|m| m.violation).map(|v| v.to_string()),
        "vertices": r.map(|r| r.points).or(side.vertices),
        "unused_vertices": r.map(|r| r.isolated_points),
        "non_finite_vertices": r.map(|r| r.non_finite_points),
        "faces": side.faces,
        "triangles": r.map(|r| r.triangles),
        "edges": r.map(|r| r.edges),
        "components": r.map(|r| r.components),
        "boundary_edges": r.map(|r| r.boundary_edges),
        "holes": r.map(|r| r.boundary_loops),
        "non_manifold_edges": r.map(|r| r.non_manifold_edges),
        "non_manifold_vertices": r.map(|r| r.non_manifold_vertices),
        "inconsistent_edges": r.map(|r| r.inconsistent_edges),
        "dangling_faces": r.map(|r| r.dangling_faces),
        "degenerate_faces": r.map(|r| r.degenerate_faces),
        "zero_area_faces": r.map(|r| r.zero_area_faces),
        "duplicate_faces": r.map(|r| r.duplicate_faces),
        "self_intersections": measured.and_then(|m| m.crossings).map(Crossings::least),
        "euler": r.map(|r| r.euler).or(side.euler),
        "genus": r.and_then(|r| r.genus),
        "volume": r.map(|r| r.volume).or(side.volume),
        "area": r.map(|r| r.area),
        "bounds": r.and_then(|r| bounds(&r.bounds)),
        "min_edge": r.map(|r| r.min_edge),
        "mean_edge": r.map(|r| r.mean_edge),
        "max_edge": r.map(|r| r.max_edge),
    })
}

/// What is known of a file without its mesh.
pub(crate) fn file(info: &InputInfo) -> Value {
    json!({
        "path": info.path.display().to_string(),
        "format": info.format.extension(),
        "encoding": info.encoding.to_string(),
        "streamed": info.is_streamed,
        "trailing_bytes": info.trailing_bytes,
    })
}

/// What is known of an octree file.
pub(crate) fn octree_file(info: &OctreeInfo) -> Value {
    json!({
        "path": info.path.display().to_string(),
        "format": info.format.extension(),
        "bytes": info.bytes,
        "depth": info.depth,
        "surface_cells": info.surface_cells,
        "uniform_surface_cells": info.surface_cells_inside + info.surface_cells_outside,
        "empty_cells": info.empty_cells,
        "missing_samples": info.missing_samples,
        "trailing_bytes": info.trailing_bytes,
        "padded": info.is_padded,
    })
}

/// Where a grid lies.
pub(crate) fn grid(frame: &Frame) -> Value {
    json!({
        "grid": {
            "origin": vector(frame.origin()),
            "size": frame.size(),
            "cell_size": frame.cell_size(),
            "cells_a_side": 1u64 << frame.depth(),
        },
    })
}

/// A box, unless it is empty.
pub(crate) fn bounds(bounds: &Bounds) -> Option<Value> {
    (!bounds.is_empty()).then(|| json!({ "min": vector(bounds.min), "max": vector(bounds.max) }))
}

pub(crate) fn vector(v: DVec3) -> Value {
    json!(v.to_array())
}

/// The fields of two objects together.
pub(crate) fn merged(mut a: Value, b: Value) -> Value {
    if let (Value::Object(a), Value::Object(b)) = (&mut a, b) {
        a.extend(b);
    }
    a
}
