//! Files that appear whole or not at all.

use crate::error::{Error, Result};
use std::fs::{self, File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// A file written under the temporary name `.NAME.PID-N.partial` beside its goal, and renamed when it is complete. Dropped
/// before, it is removed, and a file that was there stays as it is. What exists but is no regular file (a pipe, a
/// terminal) is written directly.
#[derive(Debug)]
pub(super) struct AtomicFile {
    goal: PathBuf,
    /// The temporary name as long as the file has it.
    partial: Option<PathBuf>,
    file: File,
}

impl AtomicFile {
    /// Begins a file that is going to be `path`. Where `path` is a symbolic link, what it leads to is replaced.
    pub(super) fn create(path: &Path) -> Result<AtomicFile> {
        /// Keeps files apart that one process writes at the same time.
        static COUNTER: AtomicU32 = AtomicU32::new(0);

        let create_error = |e| Error::io(path, "create", e);
        if fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            let file = OpenOptions::new().write(true).open(path).map_err(create_error)?;
            return Ok(AtomicFile { goal: path.to_owned(), partial: None, file });
        }
        let goal = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let Some(name) = goal.file_name().filter(|_| !goal.is_dir()) else {
            return Err(create_error(std::io::ErrorKind::IsADirectory.into()));
        };
        let number = COUNTER.fetch_add(1, Ordering::Relaxed);
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}-{number}.partial", std::process::id()));
        let partial = goal.with_file_name(hidden);
        let file = File::create(&partial).map_err(create_error)?;
        Ok(AtomicFile { goal, partial: Some(partial), file })
    }

    /// Appends bytes.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|e| Error::io(&self.goal, "write", e))
    }

    /// Replaces bytes written before.
    pub(super) fn patch(&mut self, position: u64, bytes: &[u8]) -> Result<()> {
        let patched = self.file.seek(SeekFrom::Start(position)).and_then(|_| self.file.write_all(bytes));
        patched.map_err(|e| Error::io(&self.goal, "write", e))
    }

    /// Gives the file its name.
    pub(super) fn commit(mut self) -> Result<()> {
        if let Some(partial) = &self.partial {
            fs::rename(partial, &self.goal).map_err(|e| Error::io(&self.goal, "rename", e))?;
        }
        self.partial = None;
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(partial) = &self.partial {
            // Nobody is left to tell if this fails.
            let _ = fs::remove_file(partial);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = fs::read_dir(directory).expect("a directory");
        entries.map(|e| e.expect("an entry").file_name().into_string().expect("UTF-8")).collect()
    }

    #[test]
    fn files_appear_when_complete() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("a.ply");
        let mut first = AtomicFile::create(&path).expect("created");
        let mut second = AtomicFile::create(&path).expect("created");
        first.write(b"first").expect("written");
        second.write(b"second").expect("written");
        second.patch(0, b"S").expect("written");
        assert!(!path.exists());
        first.commit().expect("renamed");
        assert_eq!(fs::read(&path).expect("there"), b"first");
        second.commit().expect("renamed");
        assert_eq!(fs::read(&path).expect("there"), b"Second");
        assert_eq!(names(directory.path()), ["a.ply"]);
    }

    #[test]
    fn files_that_are_given_up_leave_nothing() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("a.ply");
        fs::write(&path, "old").expect("written");
        let mut file = AtomicFile::create(&path).expect("created");
        file.write(b"new").expect("written");
        drop(file);
        assert_eq!(fs::read(&path).expect("there"), b"old");
        assert_eq!(names(directory.path()), ["a.ply"]);
        assert!(AtomicFile::create(directory.path()).is_err());
        assert!(AtomicFile::create(&directory.path().join("no/such/x")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_stay_what_they_are() {
        let directory = tempfile::tempdir().expect("a directory");
        let (path, link) = (directory.path().join("a.ply"), directory.path().join("link"));
        fs::write(&path, "old").expect("written");
        std::os::unix::fs::symlink(&path, &link).expect("linked");
        let mut file = AtomicFile::create(&link).expect("created");
        file.write(b"new").expect("written");
        file.commit().expect("renamed");
        assert!(link.is_symlink());
        assert_eq!(fs::read(&path).expect("there"), b"new");

        let mut null = AtomicFile::create(Path::new("/dev/null")).expect("opened");
        null.write(b"x").expect("written");
        null.commit().expect("nothing to do");
    }
}
