//! Headers that are lines of `key: value` or `key = value`.

use crate::error::{Error, Place, Result};

/// The most bytes that a header may have.
pub(super) const LONGEST: usize = 1 << 20;

/// The fields of a header, in the order of the file.
#[derive(Debug, Default)]
pub(super) struct Fields<'a> {
    name: &'a str,
    list: Vec<Field>,
}

/// A line of a header.
#[derive(Debug)]
pub(super) struct Field {
    /// In lower case, with single blanks.
    pub(super) key: String,
    pub(super) value: String,
    pub(super) line: u64,
}

impl<'a> Fields<'a> {
    /// No field yet; `name` is for messages.
    pub(super) fn new(name: &'a str) -> Self {
        Fields { name, list: Vec::new() }
    }

    pub(super) fn push(&mut self, key: &str, value: &str, line: u64) {
        let key = key.split_whitespace().collect::<Vec<_>>().join(" ").to_ascii_lowercase();
        self.list.push(Field { key, value: value.trim().to_owned(), line });
    }

    /// The last field of the first of these keys that there is.
    pub(super) fn find(&self, keys: &[&str]) -> Option<&Field> {
        keys.iter().find_map(|key| self.list.iter().rev().find(|field| field.key == *key))
    }

    /// The value of a key without which the file makes no sense.
    pub(super) fn require(&self, key: &'static str) -> Result<&Field> {
        self.find(&[key]).ok_or_else(|| {
            let problem = format!("the header has no `{key}`");
            Error::format(self.name, Place::Whole, problem, "is the file complete? export it again")
        })
    }

    /// The numbers of a field: `count` of them, or any number where that is 0.
    pub(super) fn numbers(&self, field: &Field, count: usize) -> Result<Vec<f64>> {
        let numbers: Option<Vec<f64>> = field.value.split_whitespace().map(|word| word.parse().ok()).collect();
        numbers.filter(|numbers| !numbers.is_empty() && (count == 0 || numbers.len() == count)).ok_or_else(|| {
            let many = if count == 0 { "numbers".to_owned() } else { format!("{count} numbers") };
            self.error(field, &format!("expected {many}"))
        })
    }

    /// The whole numbers from 0 on of a field.
    pub(super) fn counts(&self, field: &Field) -> Result<Vec<u64>> {
        let counts: Option<Vec<u64>> = field.value.split_whitespace().map(|word| word.parse().ok()).collect();
        counts.filter(|counts| !counts.is_empty()).ok_or_else(|| self.error(field, "expected whole numbers from 0 on"))
    }

    /// An error in a field.
    #[cold]
    pub(super) fn error(&self, field: &Field, problem: &str) -> Error {
        let shown: String = field.value.chars().take(60).collect();
        let problem = format!("{problem}, found `{}: {}`", field.key, shown.escape_debug());
        Error::format(self.name, Place::Line(field.line), problem, "correct this line or export the file again")
    }
}

/// The lines of a header, each with its number and where the next one begins.
pub(super) fn lines(head: &[u8]) -> impl Iterator<Item = (u64, &[u8], usize)> {
    let mut at = 0;
    let line = move |number| {
        if at >= head.len() {
            return None;
        }
        let rest = &head[at..];
        let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        at = (at + length + 1).min(head.len());
        Some((number, rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]), at))
    };
    (1..).map_while(line)
}

/// The names of numbered files: a pattern as in C, the first and last number, and the step.
pub(super) fn numbered(pattern: &str, first: i64, last: i64, step: i64) -> Option<Vec<String>> {
    let (before, behind) = pattern.split_once('%')?;
    let digits = behind.find('d')?;
    let (width, behind) = (&behind[..digits], &behind[digits + 1..]);
    let is_zero_padded = width.starts_with('0');
    let width: usize = if width.is_empty() { 0 } else { width.parse().ok().filter(|&n| n < 20)? };
    let count = last.checked_sub(first)?.checked_div(step).filter(|count| (0..1 << 20).contains(count))? + 1;
    let numbers = (0..count).map(|i| first + i * step);
    let named = |n: i64| {
        let number = if is_zero_padded { format!("{n:0width$}") } else { format!("{n:width$}") };
        format!("{before}{number}{behind}")
    };
    Some(numbers.map(named).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_two_ways() {
        let found: Vec<_> = lines(b"a\r\n\nb").collect();
        assert_eq!(found, [(1, &b"a"[..], 3), (2, b"", 4), (3, b"b", 5)]);
    }

    #[test]
    fn files_are_numbered_as_in_c() {
        assert_eq!(numbered("s%03d.raw", 8, 12, 2).unwrap(), ["s008.raw", "s010.raw", "s012.raw"]);
        assert_eq!(numbered("%d", 3, 1, -1).unwrap(), ["3", "2", "1"]);
        for (pattern, first, last, step) in [("s.raw", 1, 2, 1), ("%x", 1, 2, 1), ("%d", 1, 0, 1), ("%d", 1, 2, 0)] {
            assert_eq!(numbered(pattern, first, last, step), None, "{pattern}");
        }
        assert_eq!(numbered("%d", 0, i64::MAX, 1), None);
    }
}
