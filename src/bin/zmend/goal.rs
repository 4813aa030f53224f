//! Where results go, looked at before any work begins.

use std::fmt;
use std::fs;
use std::path::Path;
use zmend::io::{Format, OctreeFormat};
use zmend::{Error, Place, Result};

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum GoalFormat {
    Mesh(Format),
    Octree(OctreeFormat),
}

impl GoalFormat {
    /// The usual end of file names.
    pub(crate) fn extension(self) -> &'static str {
        match self {
            GoalFormat::Mesh(format) => format.extension(),
            GoalFormat::Octree(format) => format.extension(),
        }
    }
}

impl fmt::Display for GoalFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            GoalFormat::Mesh(format) => format.fmt(f),
            GoalFormat::Octree(format) => format.fmt(f),
        }
    }
}

fn refuse(path: &Path, problem: &str, remedy: &str) -> Error {
    Error::format(path.display().to_string(), Place::Whole, problem, remedy)
}

/// Whether a file can be written at `path` without harm: it is none of the files that are read, nothing there is replaced
/// unless by `force`, and the folder exists.
pub(crate) fn check(path: &Path, inputs: &[&Path], force: bool) -> Result<()> {
    for input in inputs {
        // Inputs that are missing are told by those who read them.
        if let (Ok(a), Ok(b)) = (fs::canonicalize(path), fs::canonicalize(input))
            && a == b
        {
            return Err(refuse(path, "would replace the input", "give another name to write to"));
        }
    }
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => Err(refuse(path, "is a directory", "give the name of a file")),
        Ok(metadata) if metadata.is_file() && !force => Err(refuse(path, "exists already", "--force replaces it")),
        Ok(_) => Ok(()),
        Err(_) => match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
                Err(refuse(path, "there is no such directory", "create it first"))
            }
            _ => Ok(()),
        },
    }
}

/// The format to write: the one asked for, else the one that the name says.
pub(crate) fn format(path: &Path, asked: Option<GoalFormat>) -> Result<GoalFormat> {
    let octree = || OctreeFormat::from_path(path).map(GoalFormat::Octree);
    asked.or_else(octree).or_else(|| Format::from_path(path).map(GoalFormat::Mesh)).ok_or_else(|| {
        let remedy = "give it a name that ends in .stl, .ply, .obj, .off, .glb, .3mf, .sof, .sog or .dcf";
        refuse(path, "the name says no format to write", remedy)
    })
}

/// The format of a mesh to write, as the name says.
pub(crate) fn mesh_format(path: &Path) -> Result<Format> {
    match format(path, None)? {
        GoalFormat::Mesh(format) => Ok(format),
        GoalFormat::Octree(_) => Err(refuse(path, "a mesh is no octree", "repair it to make one of it")),
    }
}
