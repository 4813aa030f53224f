//! `zmend convert`: the same mesh in another format.

use crate::args::ConvertArgs;
use crate::{goal, interrupt, print, units};
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;
use zmend::io::{self, Precision, WriteOptions};
use zmend::{Mesh, Result};

pub(crate) fn run(args: &ConvertArgs) -> Result<ExitCode> {
    goal::mesh_format(&args.out)?;
    goal::check(&args.out, &[&args.input], args.output.force)?;
    let mesh = io::read(&args.input)?;
    let bytes = write(&args.out, &mesh, args.ascii)?;
    if args.output.json {
        let (vertices, faces) = (mesh.points.len(), mesh.faces.len());
        let path = args.out.display().to_string();
        let told = json!({ "path": path, "bytes": bytes, "vertices": vertices, "faces": faces });
        print::out(&format!("{told}\n"))?;
    } else {
        print::out(&format!("{}\n", told(&args.out, &mesh, bytes)))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes a mesh with as many digits as it needs, and returns the size of the file.
pub(crate) fn write(path: &Path, mesh: &Mesh, is_text: bool) -> Result<u64> {
    let format = goal::mesh_format(path)?;
    let is_single = is_single(mesh);
    let precision = if is_single { Precision::Single } else { Precision::Double };
    if !is_single && format.is_single(is_text) {
        print::warning(format_args!("{}: {format} has 32 bits a coordinate, the mesh needs more", path.display()));
    }
    interrupt::noted(|| io::write(path, mesh, WriteOptions { precision, is_text, ..WriteOptions::default() }))
}

/// Whether 32 bits hold all coordinates as they are.
pub(crate) fn is_single(mesh: &Mesh) -> bool {
    mesh.points.iter().all(|p| p.as_vec3().as_dvec3() == *p || !p.is_finite())
}

/// What was written, in words.
pub(crate) fn told(path: &Path, mesh: &Mesh, bytes: u64) -> String {
    let vertices = units::counted(mesh.points.len() as u64, "vertex", "vertices");
    let faces = units::counted(mesh.faces.len() as u64, "face", "faces");
    format!("{}: {vertices}, {faces}, {}", path.display(), units::bytes(bytes))
}
