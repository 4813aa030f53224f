//! Where results go, looked at before any work begins.

use std::fs;
use std::path::Path;
use zmend::io::Format;
use zmend::{Error, Place, Result};

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
pub(crate) fn format(path: &Path, asked: Option<Format>) -> Result<Format> {
    asked.or_else(|| Format::from_path(path)).ok_or_else(|| {
        refuse(path, "the name says no format to write", "give it a name that ends in .stl, .ply, .obj or .off")
    })
}
