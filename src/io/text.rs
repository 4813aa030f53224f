//! A cursor over text, shared by all readers of text formats.

use super::number;
use crate::error::{Error, Place, Result};
use std::borrow::Cow;
use std::fmt::Display;

/// Where a reader stands in a text. Lines end with LF, CR or both; `#` begins a comment; where the format says so, a
/// backslash at the end of a line continues it. Any other byte up to the space, even a NUL, counts as a blank.
///
/// Lines are not counted on the way: an error counts the line ends before it.
#[derive(Debug, Clone)]
pub(super) struct Text<'a> {
    name: &'a str,
    bytes: &'a [u8],
    at: usize,
    continues: bool,
}

impl<'a> Text<'a> {
    /// A cursor at the beginning; `name` is for messages.
    pub(super) fn new(name: &'a str, bytes: &'a [u8]) -> Self {
        Text { name, bytes, at: 0, continues: false }
    }

    /// The same, but a backslash continues a line.
    pub(super) fn with_continued_lines(name: &'a str, bytes: &'a [u8]) -> Self {
        Text { continues: true, ..Text::new(name, bytes) }
    }

    /// Whether nothing is left.
    pub(super) fn is_end(&self) -> bool {
        self.at >= self.bytes.len()
    }

    /// All that is left.
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// Bytes before the cursor.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// Skips `count` of the bytes left.
    pub(super) fn advance(&mut self, count: usize) {
        self.at += count;
    }

    /// Skips blanks, continued line ends and a comment, up to the next word or the end of the line.
    pub(super) fn skip_spaces(&mut self) {
        while let Some(&byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' | b'\r' => return,
                b'#' => self.at += line_length(self.rest()),
                b'\\' if self.continues => match continuation(self.rest()) {
                    Some(length) => self.at += length,
                    None => return,
                },
                0..=b' ' => self.at += 1,
                _ => return,
            }
        }
    }

    /// Skips blanks, comments and line ends, up to the next word or the end.
    pub(super) fn skip_blanks(&mut self) {
        self.skip_spaces();
        while matches!(self.bytes.get(self.at), Some(b'\n' | b'\r')) {
            self.at += 1;
            self.skip_spaces();
        }
    }

    /// Skips the rest of the line and its end, and the lines that continue it.
    pub(super) fn skip_line(&mut self) {
        self.skip_spaces();
        loop {
            let line = line_length(self.rest());
            let is_continued = self.continues && line > 0 && self.bytes[self.at + line - 1] == b'\\';
            self.at += line;
            self.at += newline_length(self.rest());
            if !is_continued || self.is_end() {
                return;
            }
        }
    }

    /// The word under the cursor; empty only at the end and before a blank.
    pub(super) fn peek_word(&self) -> &'a [u8] {
        let rest = self.rest();
        // A backslash alone is a word too, so that taking words always comes to an end.
        let length = match rest.first() {
            Some(b'\\') => 1,
            _ => rest.iter().position(|&b| is_delimiter(b)).unwrap_or(rest.len()),
        };
        &rest[..length]
    }

    /// Takes the word under the cursor.
    pub(super) fn word(&mut self) -> &'a [u8] {
        let word = self.peek_word();
        self.at += word.len();
        word
    }

    /// Skips spaces and takes a number that ends where its word ends.
    pub(super) fn number(&mut self, what: impl Display) -> Result<f64> {
        self.skip_spaces();
        self.take(number::scan, what)
    }

    /// Skips spaces and takes an integer that ends where its word ends.
    pub(super) fn integer(&mut self, what: impl Display) -> Result<i64> {
        self.skip_spaces();
        self.take(number::scan_integer, what)
    }

    /// Takes what `scan` finds under the cursor.
    #[inline]
    fn take<T>(&mut self, scan: impl Fn(&[u8]) -> Option<(T, usize)>, what: impl Display) -> Result<T> {
        let rest = self.rest();
        match scan(rest) {
            Some((value, length)) if rest.get(length).is_none_or(|&b| is_delimiter(b)) => {
                self.at += length;
                Ok(value)
            }
            _ => Err(self.unexpected(what)),
        }
    }

    /// An error at the cursor: something else stands where `what` should.
    #[cold]
    pub(super) fn unexpected(&self, what: impl Display) -> Error {
        if self.is_end() {
            return self.error(
                format!("expected {what}, but the file ends here"),
                "it seems to be cut short: copy or export it again",
            );
        }
        let word = self.peek_word();
        if word.is_empty() {
            return self.error(format!("expected {what}, but the line ends here"), "correct this line or export again");
        }
        let shown = String::from_utf8_lossy(&word[..word.len().min(40)]);
        self.error(format!("expected {what}, found `{}`", shown.escape_debug()), "correct this line or export again")
    }

    /// An error on the cursor's line.
    #[cold]
    pub(super) fn error(&self, problem: impl Into<String>, remedy: &str) -> Error {
        self.error_at(self.at, problem, remedy)
    }

    /// An error on the line that holds the byte at `position`.
    #[cold]
    pub(super) fn error_at(&self, position: usize, problem: impl Into<String>, remedy: &str) -> Error {
        let before = &self.bytes[..position.min(self.bytes.len())];
        let is_newline = |i: usize| match before[i] {
            b'\n' => true,
            b'\r' => before.get(i + 1) != Some(&b'\n'),
            _ => false,
        };
        let line = 1 + (0..before.len()).filter(|&i| is_newline(i)).count() as u64;
        Error::format(self.name, Place::Line(line), problem, remedy)
    }
}

/// The text of a file without its byte order mark, as UTF-8; bytes that are neither UTF-16 nor UTF-8 stay as they are.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, [u8]> {
    let utf16 = |rest: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = rest.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        Cow::Owned(text.into_bytes())
    };
    match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => Cow::Borrowed(rest),
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ => Cow::Borrowed(bytes),
    }
}

/// Whether a word ends before this byte.
pub(super) fn is_delimiter(byte: u8) -> bool {
    byte <= b' ' || byte == b'#' || byte == b'\\'
}

/// Bytes before the next line end.
fn line_length(bytes: &[u8]) -> usize {
    /// Wide enough for the search to be vectorised.
    const BLOCK: usize = 32;
    let is_end = |b: &u8| *b == b'\n' || *b == b'\r';
    let clear =
        bytes.chunks_exact(BLOCK).take_while(|block| !block.iter().fold(false, |any, b| any | is_end(b))).count();
    let start = clear * BLOCK;
    bytes[start..].iter().position(is_end).map_or(bytes.len(), |length| start + length)
}

/// Length of the line end at the start of `bytes`: 0, 1 or 2.
pub(super) fn newline_length(bytes: &[u8]) -> usize {
    match bytes {
        [b'\r', b'\n', ..] => 2,
        [b'\r' | b'\n', ..] => 1,
        _ => 0,
    }
}

/// Length of a backslash and the line end behind it, if it is that.
fn continuation(bytes: &[u8]) -> Option<usize> {
    let blanks = bytes[1..].iter().take_while(|b| matches!(b, b' ' | b'\t')).count();
    let behind = &bytes[1 + blanks..];
    let newline = newline_length(behind);
    (newline > 0 || behind.is_empty()).then_some(1 + blanks + newline)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_any_way() {
        for text in ["a\nb", "a\r\nb", "a\rb", "a # c\nb", "a \0 \n\n\n b"] {
            let mut text = Text::new("t", text.as_bytes());
            assert_eq!(text.word(), b"a");
            text.skip_blanks();
            assert_eq!(text.word(), b"b");
            assert!(text.is_end());
        }
    }

    #[test]
    fn errors_count_lines() {
        let mut text = Text::new("t", b"1\r\n2\r3\nx 5");
        for _ in 0..3 {
            text.number("a number").expect("a number");
            text.skip_blanks();
        }
        let message = text.number("a number").expect_err("x is none").to_string();
        assert_eq!(message, "t: line 4: expected a number, found `x`; correct this line or export again");
    }

    #[test]
    fn backslashes_continue_lines() {
        let mut text = Text::with_continued_lines("t", b"f 1 \\\r\n 2\\\n3\nskipped \\\n too\nend \\");
        assert_eq!(text.word(), b"f");
        for n in 1..=3 {
            assert_eq!(text.integer("n").expect("a number"), n);
        }
        text.skip_line();
        text.skip_line();
        assert_eq!(text.word(), b"end");
        text.skip_blanks();
        assert!(text.is_end());
    }

    #[test]
    fn byte_order_marks_are_understood() {
        let wide = |unit: fn(u16) -> [u8; 2]| "\u{feff}v 1".encode_utf16().flat_map(unit).collect::<Vec<u8>>();
        assert_eq!(&*decode(&wide(u16::to_le_bytes)), b"v 1");
        assert_eq!(&*decode(&wide(u16::to_be_bytes)), b"v 1");
        assert_eq!(&*decode("\u{feff}v 1".as_bytes()), b"v 1");
        assert_eq!(&*decode(b"v 1"), b"v 1");
    }

    #[test]
    fn long_lines_are_found_whole() {
        for length in [0, 1, 31, 32, 33, 64, 100] {
            let mut line = vec![b'x'; length];
            assert_eq!(line_length(&line), length);
            line.extend(b"\nrest that is longer than a block of bytes");
            assert_eq!(line_length(&line), length);
        }
    }
}
