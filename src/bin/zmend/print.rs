//! Words on standard output and standard error.

use std::fmt::Display;
use std::io::{ErrorKind, Write};
use zmend::{Error, Result};

/// Prints a text. When nobody reads any more (`zmend info part.ply | head -1`), the program ends, and quietly.
pub(crate) fn out(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() == ErrorKind::BrokenPipe => std::process::exit(0),
        result => result.map_err(|e| Error::io("standard output", "write", e)),
    }
}

/// Prints an error on standard error.
pub(crate) fn error(error: &Error) {
    to_stderr("error", error);
}

/// Prints a warning on standard error.
pub(crate) fn warning(text: impl Display) {
    to_stderr("warning", text);
}

fn to_stderr(kind: &str, text: impl Display) {
    // Unlike `eprintln`, this does not panic when standard error is closed: there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "{kind}: {text}");
}

/// Lines of a label and one or more columns; labels to the left, columns to the right. Numbers stand in line.
#[derive(Default)]
pub(crate) struct Table {
    lines: Vec<Vec<String>>,
}

impl Table {
    /// Adds a line: the label first. Lines without any value are left out.
    pub(crate) fn line(&mut self, label: &str, values: &[Option<String>]) {
        if values.iter().any(Option::is_some) {
            let values = values.iter().map(|value| value.clone().unwrap_or_else(|| "-".to_owned()));
            self.lines.push(std::iter::once(label.to_owned()).chain(values).collect());
        }
    }
}

impl Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let width = |i: usize| self.lines.iter().filter_map(|line| line.get(i)).map(|s| s.chars().count()).max();
        for line in &self.lines {
            write!(f, "  {:<1$}", line[0], width(0).unwrap_or(0))?;
            for (i, value) in line.iter().enumerate().skip(1) {
                write!(f, "  {value:>0$}", width(i).unwrap_or(0).max(14))?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_in_line() {
        let mut table = Table::default();
        table.line("a", &[Some("1".into()), None]);
        table.line("nothing", &[None, None]);
        table.line("long", &[Some("0123456789abcdef".into()), Some("²".into())]);
        let text = table.to_string();
        let expected = "  a                    1               -\n  long  0123456789abcdef               ²\n";
        assert_eq!(text, expected);
    }
}
