//! `zmend render`: pictures.

use crate::args::RenderArgs;
use crate::{goal, interrupt, print};
use std::path::Path;
use std::process::ExitCode;
use zmend::io::skeleton;
use zmend::render::{Membrane, View, render_with};
use zmend::{Error, Mesh, Place, Result, io};

pub(crate) fn run(args: &RenderArgs) -> Result<ExitCode> {
    let out = &args.out;
    if !out.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        let name = out.display().to_string();
        return Err(Error::format(name, Place::Whole, "pictures are PNG files", "give it a name that ends in .png"));
    }
    let inputs: Vec<&Path> = std::iter::once(&args.mesh).chain(&args.compare).map(AsRef::as_ref).collect();
    let read: Vec<&Path> = inputs.iter().copied().chain(args.patches.as_deref()).collect();
    goal::check(out, &read, args.force)?;
    let membranes = args.patches.as_deref().map_or(Ok(Vec::new()), membranes)?;
    let meshes = inputs.iter().map(io::read).collect::<Result<Vec<Mesh>>>()?;
    let panels = meshes.len() as u32;
    let [width, height] = args.size.unwrap_or(if panels == 1 { [1200, 900] } else { [800 * panels.min(20), 800] });
    let view = View {
        width,
        height,
        azimuth: args.azimuth,
        elevation: args.elevation,
        wireframe: args.wireframe,
        defects: args.defects,
        ..View::default()
    };
    for (path, _) in inputs.iter().zip(&meshes).filter(|(_, mesh)| mesh.faces.is_empty()) {
        print::warning(format_args!("{}: there are no faces to draw", path.display()));
    }
    let picture = render_with(&meshes.iter().collect::<Vec<_>>(), &membranes, &view);
    interrupt::noted(|| picture.write_png(out))?;
    print::out(&format!("{}: {width} x {height} pixels\n", out.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// The membranes of a file of patches.
fn membranes(path: &Path) -> Result<Vec<Membrane>> {
    let patches = skeleton::read_patches(path)?;
    let place = |corner: u32| patches.points[corner as usize];
    Ok(patches.quads.iter().map(|&(corners, colour)| Membrane { corners: corners.map(place), colour }).collect())
}
