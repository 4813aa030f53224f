//! `zmend sample`: built-in meshes.

use crate::args::SampleArgs;
use crate::{goal, interrupt, print, units};
use std::process::ExitCode;
use zmend::Result;
use zmend::io::{self, WriteOptions};
use zmend::mesh::sample;

pub(crate) fn run(args: &SampleArgs) -> Result<ExitCode> {
    match (&args.name, &args.out) {
        (Some(name), Some(out)) if !args.list => {
            goal::mesh_format(out)?;
            goal::check(out, &[], args.force)?;
            let mesh = sample::build(name, args.detail)?;
            let bytes = interrupt::noted(|| io::write(out, &mesh, WriteOptions::default()))?;
            let (faces, bytes) = (units::count(mesh.faces.len() as u64), units::bytes(bytes));
            print::out(&format!("{}: {name}, {faces} faces, {bytes}\n", out.display()))?;
        }
        _ => print::out(&list())?,
    }
    Ok(ExitCode::SUCCESS)
}

fn list() -> String {
    let width = sample::names().iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    let lines: Vec<String> = sample::names().iter().map(|(name, what)| format!("{name:<width$}  {what}\n")).collect();
    lines.concat()
}
