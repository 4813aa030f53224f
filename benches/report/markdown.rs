//! Tables, and where they go.

use std::fs;
use std::io;
use std::path::Path;

/// A table in Markdown.
pub(crate) fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let row = |cells: Vec<&str>| format!("| {} |\n", cells.join(" | "));
    let mut text = row(head.to_vec()) + &format!("|{}\n", "---|".repeat(head.len()));
    rows.iter().for_each(|cells| text += &row(cells.iter().map(String::as_str).collect()));
    text
}

/// A number with three digits that count, or all before the point.
pub(crate) fn number(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { 2 - value.abs().log10().floor() as i32 };
    format!("{value:.*}", digits.clamp(0, 4) as usize)
}

/// So many times.
pub(crate) fn times(ratio: f64) -> String {
    if ratio >= 10.0 { format!("**{ratio:.0}**") } else { format!("**{ratio:.1}**") }
}

/// Replaces what stands in a file between `<!-- NAME -->` and `<!-- end of NAME -->`.
///
/// # Errors
/// When the file cannot be read or written, or has no such lines.
pub(crate) fn replace(file: &Path, name: &str, text: &str) -> io::Result<()> {
    let old = fs::read_to_string(file)?;
    let marks = [format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->")];
    let missing = || io::Error::other(format!("{} has no `{}`", file.display(), marks[0].trim()));
    let start = old.find(&marks[0]).ok_or_else(missing)? + marks[0].len();
    let end = start + old[start..].find(&marks[1]).ok_or_else(missing)?;
    fs::write(file, format!("{}{text}{}", &old[..start], &old[end..]))
}
