//! The numbers of a glTF file: accessors into views of buffers, which are in the file, in its text or beside it.

use super::Document;
use crate::error::{Error, Result};
use glam::DVec3;
use serde_json::Value;
use std::borrow::Cow;
use std::cell::OnceCell;
use std::path::{Component, Path};

/// The buffers of a document, each loaded when it is first asked for.
pub(super) struct Buffers<'d, 'a> {
    document: &'d Document<'a>,
    loaded: Vec<OnceCell<Cow<'a, [u8]>>>,
}

/// A list of vectors or numbers in a buffer.
struct Accessor<'b> {
    /// From its first byte on, as far as the view goes.
    bytes: &'b [u8],
    stride: usize,
    count: usize,
    component: Kind,
}

/// A kind of number.
#[derive(Clone, Copy)]
struct Kind {
    size: usize,
    /// Reads one; the bytes are there.
    read: fn(&[u8]) -> f64,
    /// What stands for 1 where numbers are normalised.
    one: f64,
}

impl<'d, 'a> Buffers<'d, 'a> {
    pub(super) fn new(document: &'d Document<'a>) -> Self {
        Buffers { document, loaded: document.list("buffers").iter().map(|_| OnceCell::new()).collect() }
    }

    /// The positions that an accessor gives.
    pub(super) fn positions(&self, accessor: u64) -> Result<Vec<DVec3>> {
        let object = self.document.item("accessors", accessor)?;
        let Accessor { bytes, stride, count, component } = self.accessor(accessor, "VEC3")?;
        let is_normalised = object.get("normalized").and_then(Value::as_bool) == Some(true);
        let scale = if is_normalised { 1.0 / component.one } else { 1.0 };
        let coordinate = |at: usize, axis: usize| {
            let value = scale * (component.read)(&bytes[at * stride + axis * component.size..]);
            // The least signed integer is one below -1.
            if is_normalised { value.max(-1.0) } else { value }
        };
        Ok((0..count).map(|i| DVec3::new(coordinate(i, 0), coordinate(i, 1), coordinate(i, 2))).collect())
    }

    /// The indices that an accessor gives.
    pub(super) fn indices(&self, accessor: u64) -> Result<Vec<u32>> {
        let Accessor { bytes, stride, count, component } = self.accessor(accessor, "SCALAR")?;
        // Integers of 32 bits are exact in 64-bit floats; whatever is no index becomes one that is out of range, or 0.
        Ok((0..count).map(|i| (component.read)(&bytes[i * stride..]) as u32).collect())
    }

    fn accessor(&self, number: u64, kind: &str) -> Result<Accessor<'_>> {
        let document = self.document;
        let wrong = |problem: String| document.error(format!("accessor {number} {problem}"), "export the file again");
        let object = document.item("accessors", number)?;
        let components = if kind == "VEC3" { 3 } else { 1 };
        if object.get("type").and_then(Value::as_str) != Some(kind) {
            return Err(wrong(format!("is not of type {kind}")));
        }
        if object.get("sparse").is_some() {
            return Err(
                document.error(format!("accessor {number} is sparse"), "export the file without sparse accessors")
            );
        }
        let component = match document.number(object, "componentType")? {
            Some(5120) => Kind { size: 1, read: |b| f64::from(b[0] as i8), one: 127.0 },
            Some(5121) => Kind { size: 1, read: |b| f64::from(b[0]), one: 255.0 },
            Some(5122) => Kind { size: 2, read: |b| f64::from(i16::from_le_bytes([b[0], b[1]])), one: 32767.0 },
            Some(5123) => Kind { size: 2, read: |b| f64::from(u16::from_le_bytes([b[0], b[1]])), one: 65535.0 },
            Some(5125) => Kind { size: 4, read: |b| f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])), one: 1.0 },
            Some(5126) => Kind { size: 4, read: |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])), one: 1.0 },
            _ => return Err(wrong("has no known componentType".to_owned())),
        };
        let count = document.number(object, "count")?.unwrap_or(0);
        let offset = document.number(object, "byteOffset")?.unwrap_or(0);
        let Some(view) = document.number(object, "bufferView")? else {
            return Err(wrong("has no bufferView".to_owned()));
        };
        let (view, stride) = self.view(view)?;
        let size = (components * component.size) as u64;
        let stride = stride.unwrap_or(size);
        let needed = count.checked_sub(1).map_or(Some(0), |before| stride.checked_mul(before)?.checked_add(size));
        let end = needed.and_then(|needed| needed.checked_add(offset));
        if stride < size || end.is_none_or(|end| end > view.len() as u64) {
            return Err(wrong(format!("has {count} elements, more than its bufferView of {} bytes holds", view.len())));
        }
        // All of these are now known to be at most the length of the view.
        let bytes = &view[(offset as usize).min(view.len())..];
        Ok(Accessor { bytes, stride: stride as usize, count: count as usize, component })
    }

    /// The bytes of a view, and the distance between its elements if it says so.
    fn view(&self, number: u64) -> Result<(&[u8], Option<u64>)> {
        let document = self.document;
        let object = document.item("bufferViews", number)?;
        let offset = document.number(object, "byteOffset")?.unwrap_or(0);
        let len = document.number(object, "byteLength")?.unwrap_or(0);
        let buffer = self.buffer(document.number(object, "buffer")?.unwrap_or(0))?;
        let end = offset.checked_add(len).filter(|&end| end <= buffer.len() as u64);
        let Some(end) = end else {
            let problem = format!("bufferView {number} reaches beyond its buffer of {} bytes", buffer.len());
            return Err(document.error(problem, "the data is cut short: copy or export it again"));
        };
        Ok((&buffer[offset as usize..end as usize], document.number(object, "byteStride")?))
    }

    fn buffer(&self, number: u64) -> Result<&[u8]> {
        let object = self.document.item("buffers", number)?;
        // There are as many cells as buffers.
        let cell = &self.loaded[number as usize];
        if let Some(bytes) = cell.get() {
            return Ok(bytes);
        }
        let bytes = match object.get("uri").and_then(Value::as_str) {
            None => {
                let binary = self.document.binary.filter(|_| number == 0);
                Cow::Borrowed(binary.ok_or_else(|| {
                    let problem = format!("buffer {number} has neither a URI nor a binary chunk");
                    self.document.error(problem, "export the file again")
                })?)
            }
            Some(uri) => Cow::Owned(self.load(uri)?),
        };
        Ok(cell.get_or_init(|| bytes))
    }

    fn load(&self, uri: &str) -> Result<Vec<u8>> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(";base64,").map(|(_, encoded)| encoded);
            return encoded.and_then(|encoded| from_base64(encoded.as_bytes())).ok_or_else(|| {
                self.document.error("the data in a URI is not in base64", "export the file again, as .glb")
            });
        }
        let file = from_percents(uri);
        let is_beside =
            Path::new(&file).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if !is_beside || file.contains("://") {
            let problem = format!("the data is in {file}, which is not beside the file");
            return Err(self.document.error(problem, "export it as .glb, in one file"));
        }
        let path = Path::new(self.document.name).with_file_name(file);
        std::fs::read(&path).map_err(|e| Error::io(&path, "read", e))
    }
}

/// Bytes from base64 (RFC 4648); `None` where it is malformed.
fn from_base64(encoded: &[u8]) -> Option<Vec<u8>> {
    let digits = encoded.trim_ascii_end();
    let digits = digits.strip_suffix(b"==").or_else(|| digits.strip_suffix(b"=")).unwrap_or(digits);
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    let (mut bits, mut held) = (0u32, 0);
    for &digit in digits {
        let value = match digit {
            b'A'..=b'Z' => digit - b'A',
            b'a'..=b'z' => digit - b'a' + 26,
            b'0'..=b'9' => digit - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    Some(bytes)
}

/// A name whose unusual characters are given as `%20`.
fn from_percents(uri: &str) -> String {
    let mut name = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let code = after.first_chunk::<2>().filter(|_| first == b'%');
        let code = code.and_then(|code| u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok());
        name.push(code.unwrap_or(first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&name).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percents() {
        assert_eq!(from_base64(b"TWFu").as_deref(), Some(&b"Man"[..]));
        assert_eq!(from_base64(b"TWE=\n").as_deref(), Some(&b"Ma"[..]));
        assert_eq!(from_base64(b"TQ==").as_deref(), Some(&b"M"[..]));
        assert_eq!(from_base64(b"T!==").as_deref(), None);
        assert_eq!(from_percents("a%20b%2x%c3%bc"), "a b%2x\u{fc}");
    }
}
