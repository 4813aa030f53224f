//! What can go wrong, where, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};

/// The crate's result.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can fail. Each message names what failed and where, and says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused to read or write.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file concerned.
        path: PathBuf,
        /// What was being done: "read", "write", "create", "rename".
        action: &'static str,
        /// The system's own reason.
        source: std::io::Error,
    },
    /// A file or byte string is not what its format promises.
    #[error("{name}: {place}{problem}{}", Remedy(remedy))]
    Format {
        /// The file's name, or what the bytes are called where there is no file.
        name: String,
        /// Where in the input.
        place: Place,
        /// What is wrong there.
        problem: String,
        /// What the user can do, or empty.
        remedy: String,
    },
    /// A setting is out of range or contradicts another one.
    #[error("{option}: {problem}{}", Remedy(remedy))]
    Setting {
        /// The setting's name as the user writes it, for example `depth`.
        option: &'static str,
        /// What is wrong with its value.
        problem: String,
        /// What the user can do, or empty.
        remedy: String,
    },
    /// More memory is needed than may be taken.
    #[error("max-memory: {} may be taken, {} or more are needed{}", Bytes(*limit), Bytes(*needed), Remedy(remedy))]
    Memory {
        /// Bytes needed, as far as is known.
        needed: u64,
        /// Bytes that may be taken.
        limit: u64,
        /// What the user can do, or empty.
        remedy: String,
    },
    /// The caller's [`Progress`](crate::progress::Progress) asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// An I/O error with its file and the action that failed.
    pub fn io(path: impl AsRef<Path>, action: &'static str, source: std::io::Error) -> Self {
        Error::Io { path: path.as_ref().to_owned(), action, source }
    }

    /// A format error at a place, with a remedy (may be empty).
    pub fn format(
        name: impl Into<String>,
        place: Place,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Error::Format { name: name.into(), place, problem: problem.into(), remedy: remedy.into() }
    }

    /// A setting that cannot be used, with a remedy (may be empty).
    pub fn setting(option: &'static str, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Error::Setting { option, problem: problem.into(), remedy: remedy.into() }
    }
}

/// A measured number in a message: six digits at most, and no row of zeros for those that are huge or tiny.
pub(crate) struct Short(pub(crate) f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Rounded to six digits by writing and reading, then written in the shortest way.
        let rounded: f64 = format!("{:.5e}", self.0).parse().unwrap_or(self.0);
        let is_plain = rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) || !rounded.is_finite();
        if is_plain { write!(f, "{rounded}") } else { write!(f, "{rounded:e}") }
    }
}

/// A size in bytes in a message.
pub(crate) struct Bytes(pub(crate) u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (size, unit) = match self.0 {
            ..1_000_000 => (self.0 as f64 / 1e3, "kB"),
            1_000_000..1_000_000_000 => (self.0 as f64 / 1e6, "MB"),
            1_000_000_000..1_000_000_000_000 => (self.0 as f64 / 1e9, "GB"),
            1_000_000_000_000.. => (self.0 as f64 / 1e12, "TB"),
        };
        let decimals = usize::from(size < 9.95);
        write!(f, "{size:.decimals$} {unit}")
    }
}

/// A place in an input file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    Whole,
    /// A line, counted from 1.
    Line(u64),
    /// A byte offset, counted from 0.
    Byte(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Whole => Ok(()),
            Place::Line(n) => write!(f, "line {n}: "),
            Place::Byte(n) => write!(f, "byte {n}: "),
        }
    }
}

/// Appends "; remedy" when there is one.
struct Remedy<'a>(&'a str);

impl fmt::Display for Remedy<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { Ok(()) } else { write!(f, "; {}", self.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_place_and_remedy() {
        let e = Error::format("part.ply", Place::Line(1203), "face 88 refers to vertex 9001, but there are 9000", "");
        assert_eq!(e.to_string(), "part.ply: line 1203: face 88 refers to vertex 9001, but there are 9000");
        let e = Error::setting("scale", "1.5 is not below 1", "take 0.9");
        assert_eq!(e.to_string(), "scale: 1.5 is not below 1; take 0.9");
    }

    #[test]
    fn memory_is_told_in_units() {
        let e = Error::Memory { needed: 12_345_678_900, limit: 950_000, remedy: "take depth 9".to_owned() };
        assert_eq!(e.to_string(), "max-memory: 950 kB may be taken, 12 GB or more are needed; take depth 9");
        assert_eq!([1_500_000, 99_000_000, u64::MAX].map(|n| Bytes(n).to_string()), ["1.5 MB", "99 MB", "18446744 TB"]);
    }

    #[test]
    fn numbers_are_short() {
        let shown = [0.0, -0.1, 1.0 / 3.0, 1_234_567.8, 1e300 / 0.9, 5e-324, f64::NAN, f64::INFINITY].map(Short);
        let expected = ["0", "-0.1", "0.333333", "1234570", "1.11111e300", "5e-324", "NaN", "inf"];
        assert_eq!(shown.map(|x| x.to_string()), expected);
    }
}
