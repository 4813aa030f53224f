//! The records of a PLY file: one way of reading for all encodings, and fast ones for the usual binary layouts.

use super::super::bytes::Bytes;
use super::super::text::Text;
use super::header::{Element, Kind, Scalar};
use crate::error::{Error, Result};
use glam::DVec3;
use std::io::Read;
use std::marker::PhantomData;

/// Stands in a strip between two strips.
const RESTART: f64 = -1.0;

const CUT_SHORT: &str = "the file is cut short or its header wrong: copy or export it again";

/// A source of values in the order of the file. All types are passed as `f64`, which holds every index exactly.
pub(super) trait Body {
    /// The next value.
    fn value(&mut self, scalar: Scalar, element: &Element) -> Result<f64>;

    /// The least number of bytes that a value takes.
    fn least_size(&self, scalar: Scalar) -> u64;

    /// Number of bytes left.
    fn left(&self) -> u64;

    /// An error at the next value.
    fn error(&self, problem: String, remedy: &str) -> Error;

    /// Goes to the next record. In text it begins a line, and values too many on the line before are ignored, since some
    /// exporters write more than their header says.
    fn end_record(&mut self) {}

    /// Refuses an element that cannot fit in the bytes left, so that its count may be used to make room.
    fn check_size(&self, element: &Element) -> Result<()> {
        let least = |kind| match kind {
            Kind::One(scalar) | Kind::List(scalar, _) => self.least_size(scalar),
        };
        // A record without properties takes no room, so that its count could be anything. Those that are kept are held to a byte.
        let kept = u64::from(matches!(element.name.as_str(), "vertex" | "face"));
        let record: u64 = element.properties.iter().map(|p| least(p.kind)).sum();
        let need = element.count.saturating_mul(record.max(kept));
        // The last value of a text needs no blank behind it.
        if need > self.left() + 1 {
            let (count, name, left) = (element.count, &element.name, self.left());
            let problem = format!("{count} of `{name}` need at least {need} bytes, but {left} are left");
            return Err(self.error(problem, CUT_SHORT));
        }
        Ok(())
    }

    /// The number of entries of the list that comes next.
    fn list_length(&mut self, count: Scalar, item: Scalar, element: &Element) -> Result<u64> {
        let length = self.value(count, element)?;
        if length < 0.0 || length.fract() != 0.0 || length * self.least_size(item) as f64 > (self.left() + 1) as f64 {
            let (name, left) = (&element.name, self.left());
            return Err(
                self.error(format!("`{name}` has a list with {length} entries, but {left} bytes are left"), CUT_SHORT)
            );
        }
        Ok(length as u64)
    }

    /// Skips the next property.
    fn skip_property(&mut self, kind: Kind, element: &Element) -> Result<()> {
        match kind {
            Kind::One(scalar) => self.value(scalar, element).map(drop),
            Kind::List(count, item) => {
                for _ in 0..self.list_length(count, item, element)? {
                    self.value(item, element)?;
                }
                Ok(())
            }
        }
    }

    /// Skips all records of an element.
    fn skip(&mut self, element: &Element) -> Result<()> {
        if element.properties.is_empty() {
            return Ok(());
        }
        for _ in 0..element.count {
            for property in &element.properties {
                self.skip_property(property.kind, element)?;
            }
            self.end_record();
        }
        Ok(())
    }

    /// Calls `visit` with the position in each record.
    fn points(&mut self, element: &Element, visit: impl FnMut(DVec3) -> Result<()>) -> Result<()> {
        self.any_points(element, visit)
    }

    /// Calls `visit` with the vertices of each face, which are checked to be below `points`.
    fn faces(&mut self, element: &Element, points: u64, visit: impl FnMut(&[u32]) -> Result<()>) -> Result<()> {
        self.any_faces(element, points, visit)
    }

    /// [`points`](Self::points) for any layout.
    fn any_points(&mut self, element: &Element, mut visit: impl FnMut(DVec3) -> Result<()>) -> Result<()> {
        self.vertices(element, None, |point, _| visit(point))
    }

    /// Calls `visit` with the position in each record, and the vector of three further properties if they are given.
    fn vertices(
        &mut self,
        element: &Element,
        normals: Option<[usize; 3]>,
        mut visit: impl FnMut(DVec3, Option<DVec3>) -> Result<()>,
    ) -> Result<()> {
        if element.count == 0 {
            return Ok(());
        }
        let coordinates = element.coordinates().map_err(|name| {
            self.error(format!("vertices have no property `{name}`"), "export the file with three coordinates")
        })?;
        for _ in 0..element.count {
            let (mut point, mut normal) = (DVec3::ZERO, normals.map(|_| DVec3::ZERO));
            for (i, property) in element.properties.iter().enumerate() {
                let axis_in = |list: [usize; 3]| list.iter().position(|&c| c == i);
                match (axis_in(coordinates), normals.and_then(axis_in), property.kind) {
                    (Some(axis), _, Kind::One(scalar)) => point[axis] = self.value(scalar, element)?,
                    (_, Some(axis), Kind::One(scalar)) => {
                        let value = self.value(scalar, element)?;
                        normal.iter_mut().for_each(|normal| normal[axis] = value);
                    }
                    (.., kind) => self.skip_property(kind, element)?,
                }
            }
            visit(point, normal)?;
            self.end_record();
        }
        Ok(())
    }

    /// Calls `visit` with the list of vertex indices of each record as it is, and the number of the record.
    fn lists(&mut self, element: &Element, mut visit: impl FnMut(&mut Self, u64, &[f64]) -> Result<()>) -> Result<()> {
        if element.count == 0 {
            return Ok(());
        }
        let Some(indices) = element.indices() else {
            let problem = format!("`{}` has no list `vertex_indices`", element.name);
            return Err(self.error(problem, "export the file again, or correct the header"));
        };
        let mut list = Vec::new();
        for record in 0..element.count {
            for (i, property) in element.properties.iter().enumerate() {
                match property.kind {
                    Kind::List(count, item) if i == indices => {
                        list.clear();
                        for _ in 0..self.list_length(count, item, element)? {
                            list.push(self.value(item, element)?);
                        }
                    }
                    kind => self.skip_property(kind, element)?,
                }
            }
            visit(self, record, &list)?;
            self.end_record();
        }
        Ok(())
    }

    /// [`faces`](Self::faces) for any layout.
    fn any_faces(&mut self, element: &Element, points: u64, mut visit: impl FnMut(&[u32]) -> Result<()>) -> Result<()> {
        let mut face = Vec::new();
        self.lists(element, |body, record, list| {
            face.clear();
            for &index in list {
                face.push(body.index(element, record, index, points)?);
            }
            visit(&face)
        })
    }

    /// Calls `visit` with the triangles of each strip; -1 begins a strip anew. Triangles that only turn a corner have
    /// two equal vertices and are left out.
    fn strips(&mut self, element: &Element, points: u64, mut visit: impl FnMut([u32; 3]) -> Result<()>) -> Result<()> {
        self.lists(element, |body, record, list| {
            for strip in list.split(|index| index.to_bits() == RESTART.to_bits()) {
                for (i, window) in strip.windows(3).enumerate() {
                    let mut corner = |k: usize| body.index(element, record, window[k], points);
                    let (a, b, c) = (corner(0)?, corner(1)?, corner(2)?);
                    if a != b && b != c && c != a {
                        visit(if i % 2 == 0 { [a, b, c] } else { [b, a, c] })?;
                    }
                }
            }
            Ok(())
        })
    }

    /// A value as an index below `points`.
    fn index(&mut self, element: &Element, record: u64, value: f64, points: u64) -> Result<u32> {
        let index = value as u32;
        if f64::from(index).to_bits() == (value + 0.0).to_bits() && u64::from(index) < points {
            return Ok(index);
        }
        let problem = format!("{} {record} refers to vertex {value}, but there are {points}", element.name);
        Err(self.error(problem, "PLY counts vertices from 0: correct the face or export the file again"))
    }
}

impl Body for Text<'_> {
    fn value(&mut self, _: Scalar, element: &Element) -> Result<f64> {
        self.skip_blanks();
        self.number(format_args!("a value of `{}`", element.name))
    }

    fn least_size(&self, _: Scalar) -> u64 {
        2
    }

    fn left(&self) -> u64 {
        self.rest().len() as u64
    }

    fn error(&self, problem: String, remedy: &str) -> Error {
        self.error(problem, remedy)
    }

    fn end_record(&mut self) {
        self.skip_line();
    }
}

/// The order of the bytes of a value.
pub(super) trait Order {
    /// The same bytes with the least significant one first.
    fn little<const N: usize>(bytes: [u8; N]) -> [u8; N];
}

/// Least significant byte first.
pub(super) struct LittleEndian;

impl Order for LittleEndian {
    #[inline]
    fn little<const N: usize>(bytes: [u8; N]) -> [u8; N] {
        bytes
    }
}

/// Most significant byte first.
pub(super) struct BigEndian;

impl Order for BigEndian {
    #[inline]
    fn little<const N: usize>(mut bytes: [u8; N]) -> [u8; N] {
        bytes.reverse();
        bytes
    }
}

/// A binary body.
pub(super) struct Binary<'a, O, R> {
    bytes: Bytes<'a, R>,
    order: PhantomData<O>,
}

impl<'a, O: Order, R: Read> Binary<'a, O, R> {
    /// The body that begins where `bytes` stands.
    pub(super) fn new(bytes: Bytes<'a, R>) -> Self {
        Binary { bytes, order: PhantomData }
    }

    /// Offset in the file of the next value.
    pub(super) fn position(&self) -> u64 {
        self.bytes.position()
    }

    fn take<const N: usize>(&mut self, element: &Element) -> Result<[u8; N]> {
        match self.bytes.take()? {
            Some(bytes) => Ok(O::little(bytes)),
            None => Err(self.cut_short(element)),
        }
    }

    #[cold]
    fn cut_short(&self, element: &Element) -> Error {
        self.bytes.error(format!("the file ends within the records of `{}`", element.name), CUT_SHORT)
    }

    /// [`Body::points`] where all properties have a fixed size and coordinates are of the type that `decode` takes.
    fn fixed_points<const N: usize>(
        &mut self,
        element: &Element,
        [x, y, z]: [usize; 3],
        decode: impl Fn([u8; N]) -> f64,
        mut visit: impl FnMut(DVec3) -> Result<()>,
    ) -> Result<()> {
        let stride = offset_of(element, element.properties.len());
        let mut left = element.count;
        while left > 0 {
            let mut records = 0;
            for record in
                self.bytes.fill(stride)?.chunks_exact(stride).take(usize::try_from(left).unwrap_or(usize::MAX))
            {
                let value = |at: usize| decode(O::little(chunk(record, at)));
                visit(DVec3::new(value(x), value(y), value(z)))?;
                records += 1;
            }
            if records == 0 {
                return Err(self.cut_short(element));
            }
            self.bytes.consume(records * stride);
            left -= records as u64;
        }
        Ok(())
    }

    /// [`Body::faces`] where a list of four-byte indices, counted by one byte, stands between `before` and `after` bytes.
    fn fixed_faces(
        &mut self,
        element: &Element,
        (before, after): (usize, usize),
        points: u64,
        mut visit: impl FnMut(&[u32]) -> Result<()>,
    ) -> Result<()> {
        let longest = before + 1 + 4 * 255 + after;
        let mut face = [0; 255];
        let mut record = 0;
        while record < element.count {
            let window = self.bytes.fill(longest)?;
            let mut at = 0;
            let mut wrong = None;
            while record < element.count {
                let Some(&count) = window.get(at + before) else { break };
                let start = at + before + 1;
                let Some(indices) = window.get(start..start + 4 * usize::from(count)) else { break };
                if start + indices.len() + after > window.len() {
                    break;
                }
                let face = &mut face[..usize::from(count)];
                for (corner, &bytes) in face.iter_mut().zip(indices.as_chunks().0) {
                    *corner = u32::from_le_bytes(O::little(bytes));
                }
                wrong = face.iter().copied().find(|&corner| u64::from(corner) >= points);
                if wrong.is_some() {
                    break;
                }
                visit(face)?;
                at = start + indices.len() + after;
                record += 1;
            }
            self.bytes.consume(at);
            if let Some(corner) = wrong {
                let is_signed = element.properties.iter().any(|p| matches!(p.kind, Kind::List(_, Scalar::I32)));
                let value = if is_signed { f64::from(corner as i32) } else { f64::from(corner) };
                self.index(element, record, value, points)?;
            }
            if at == 0 {
                return Err(self.cut_short(element));
            }
        }
        Ok(())
    }
}

impl<O: Order, R: Read> Body for Binary<'_, O, R> {
    fn value(&mut self, scalar: Scalar, element: &Element) -> Result<f64> {
        Ok(match scalar {
            Scalar::I8 => f64::from(i8::from_le_bytes(self.take(element)?)),
            Scalar::U8 => f64::from(u8::from_le_bytes(self.take(element)?)),
            Scalar::I16 => f64::from(i16::from_le_bytes(self.take(element)?)),
            Scalar::U16 => f64::from(u16::from_le_bytes(self.take(element)?)),
            Scalar::I32 => f64::from(i32::from_le_bytes(self.take(element)?)),
            Scalar::U32 => f64::from(u32::from_le_bytes(self.take(element)?)),
            Scalar::I64 => i64::from_le_bytes(self.take(element)?) as f64,
            Scalar::U64 => u64::from_le_bytes(self.take(element)?) as f64,
            Scalar::F32 => f64::from(f32::from_le_bytes(self.take(element)?)),
            Scalar::F64 => f64::from_le_bytes(self.take(element)?),
        })
    }

    fn least_size(&self, scalar: Scalar) -> u64 {
        scalar.size() as u64
    }

    fn left(&self) -> u64 {
        self.bytes.left()
    }

    fn error(&self, problem: String, remedy: &str) -> Error {
        self.bytes.error(problem, remedy)
    }

    fn skip_property(&mut self, kind: Kind, element: &Element) -> Result<()> {
        let bytes = match kind {
            Kind::One(scalar) => scalar.size() as u64,
            Kind::List(count, item) => self.list_length(count, item, element)? * item.size() as u64,
        };
        if self.bytes.skip(bytes)? { Ok(()) } else { Err(self.cut_short(element)) }
    }

    fn points(&mut self, element: &Element, visit: impl FnMut(DVec3) -> Result<()>) -> Result<()> {
        let is_fixed = element.properties.iter().all(|p| matches!(p.kind, Kind::One(_)));
        if let (true, Ok(coordinates)) = (is_fixed, element.coordinates()) {
            let offsets = coordinates.map(|i| offset_of(element, i));
            let is_all = |scalar| coordinates.iter().all(|&i| element.properties[i].kind == Kind::One(scalar));
            if is_all(Scalar::F32) {
                return self.fixed_points(element, offsets, |b| f64::from(f32::from_le_bytes(b)), visit);
            } else if is_all(Scalar::F64) {
                return self.fixed_points(element, offsets, f64::from_le_bytes, visit);
            }
        }
        self.any_points(element, visit)
    }

    fn faces(&mut self, element: &Element, points: u64, visit: impl FnMut(&[u32]) -> Result<()>) -> Result<()> {
        let usual = [Scalar::I32, Scalar::U32].map(|item| Kind::List(Scalar::U8, item));
        let is_fixed = |i: usize| matches!(element.properties[i].kind, Kind::One(_));
        if let Some(list) = element.indices() {
            let all = element.properties.len();
            if usual.contains(&element.properties[list].kind) && (0..all).all(|i| i == list || is_fixed(i)) {
                let before = offset_of(element, list);
                let after = offset_of(element, all) - before;
                return self.fixed_faces(element, (before, after), points, visit);
            }
        }
        self.any_faces(element, points, visit)
    }
}

/// Bytes of the values in the first `properties` properties; lists count nothing.
fn offset_of(element: &Element, properties: usize) -> usize {
    let size = |kind| if let Kind::One(scalar) = kind { scalar.size() } else { 0 };
    element.properties[..properties].iter().map(|p| size(p.kind)).sum()
}

/// The `N` bytes from `at` on.
fn chunk<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes[at..at + N].try_into().expect("a slice of N bytes")
}
