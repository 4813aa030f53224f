//! A binary PLY file as a source of triangles: vertices in memory, faces read anew from the file on each pass.

use super::super::Encoding;
use super::super::build::no_room;
use super::super::bytes::Bytes;
use super::body::{BigEndian, Binary, Body, LittleEndian, Order};
use super::header::{Element, Header, Kind, Scalar};
use crate::error::{Error, Result};
use crate::mesh::{Batch, Bounds, SourceCounts, TriangleSource};
use glam::{DVec3, Vec3};
use std::collections::TryReserveError;
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::PathBuf;

/// An open binary PLY file.
#[derive(Debug)]
pub(in crate::io) struct PlyFile {
    path: PathBuf,
    name: String,
    file: File,
    len: u64,
    header: Header,
    points: Positions,
    faces: Option<Faces>,
    bounds: Option<Bounds>,
}

/// Where the faces are.
#[derive(Debug, Clone)]
struct Faces {
    element: Element,
    start: u64,
}

/// Positions in the precision of the file.
#[derive(Debug)]
enum Positions {
    Single(Vec<Vec3>),
    Double(Vec<DVec3>),
}

/// A list with room for so many elements.
fn with_room<T>(room: usize) -> Result<Vec<T>, TryReserveError> {
    let mut list = Vec::new();
    list.try_reserve_exact(room).map(|()| list)
}

impl Positions {
    /// No positions, but room for those of an element that is known to fit in the file; unless there is none in memory.
    fn with_room_for(element: &Element) -> Result<Self, TryReserveError> {
        let room = element.count as usize;
        let is_coordinate = |name: &str| matches!(name, "x" | "y" | "z");
        let is_single = |kind: Kind| matches!(kind, Kind::One(Scalar::F32));
        if element.properties.iter().all(|p| !is_coordinate(&p.name) || is_single(p.kind)) {
            with_room(room).map(Positions::Single)
        } else {
            with_room(room).map(Positions::Double)
        }
    }

    fn push(&mut self, point: DVec3) {
        match self {
            Positions::Single(points) => points.push(point.as_vec3()),
            Positions::Double(points) => points.push(point),
        }
    }

    #[inline]
    fn get(&self, index: u32) -> DVec3 {
        match self {
            Positions::Single(points) => points[index as usize].as_dvec3(),
            Positions::Double(points) => points[index as usize],
        }
    }
}

impl PlyFile {
    /// Reads the vertices of a binary file of `len` bytes. `None` when the file must be read as a whole: when it is text,
    /// has faces before vertices, or strips.
    pub(in crate::io) fn open(path: PathBuf, file: File, len: u64, header: &Header) -> Result<Option<PlyFile>> {
        let at = |name| header.elements.iter().position(|e| e.name == name);
        let is_ordered = match (at("vertex"), at("face")) {
            (Some(vertex), Some(face)) => vertex < face,
            (None, Some(_)) => false,
            (_, None) => true,
        };
        let repeats = |name| header.elements.iter().filter(|e| e.name == name).count() > 1;
        if header.encoding == Encoding::Text
            || !is_ordered
            || at("tristrips").is_some()
            || repeats("vertex")
            || repeats("face")
        {
            return Ok(None);
        }
        let name = path.display().to_string();
        let points = Positions::Double(Vec::new());
        let header = header.clone();
        let mut opened = PlyFile { path, name, file, len, header, points, faces: None, bounds: None };
        match opened.header.encoding {
            Encoding::BigEndian => opened.read_points::<BigEndian>()?,
            _ => opened.read_points::<LittleEndian>()?,
        }
        Ok(Some(opened))
    }

    /// The file from `start` on.
    fn body<O: Order>(&self, start: u64) -> Result<Binary<'_, O, &File>> {
        let mut reader = &self.file;
        reader.seek(SeekFrom::Start(start)).map_err(|e| Error::io(&self.path, "read", e))?;
        Ok(Binary::new(Bytes::new(&self.name, reader, start, self.len)))
    }

    fn read_points<O: Order>(&mut self) -> Result<()> {
        let mut body = self.body::<O>(self.header.body as u64)?;
        let mut found = Positions::Double(Vec::new());
        let mut faces = None;
        for element in &self.header.elements {
            body.check_size(element)?;
            match element.name.as_str() {
                "vertex" => {
                    let room = Positions::with_room_for(element);
                    found = room.map_err(|_| no_room(&self.name, element.count as usize))?;
                    body.points(element, |point| {
                        found.push(point);
                        Ok(())
                    })?;
                }
                "face" => {
                    faces = Some(Faces { element: element.clone(), start: body.position() });
                    break;
                }
                _ => body.skip(element)?,
            }
        }
        (self.points, self.faces) = (found, faces);
        Ok(())
    }

    /// Calls `visit` with the vertices of each face.
    fn visit_faces(&self, visit: impl FnMut(&[u32]) -> Result<()>) -> Result<()> {
        let Some(Faces { element, start }) = &self.faces else { return Ok(()) };
        let points = self.header.points();
        match self.header.encoding {
            Encoding::BigEndian => self.body::<BigEndian>(*start)?.faces(element, points, visit),
            _ => self.body::<LittleEndian>(*start)?.faces(element, points, visit),
        }
    }
}

impl TriangleSource for PlyFile {
    fn bounds(&mut self) -> Result<Bounds> {
        if let Some(bounds) = self.bounds {
            return Ok(bounds);
        }
        let mut bounds = Bounds::EMPTY;
        self.visit_faces(|face| {
            for &corner in face {
                bounds.add(self.points.get(corner));
            }
            Ok(())
        })?;
        self.bounds = Some(bounds);
        Ok(bounds)
    }

    fn triangles(&mut self, sink: &mut dyn FnMut(&[[DVec3; 3]]) -> Result<()>) -> Result<SourceCounts> {
        let mut batch = Batch::new(sink);
        let mut corners = Vec::new();
        self.visit_faces(|face| {
            if let &[a, b, c] = face {
                return batch.triangle([a, b, c].map(|corner| self.points.get(corner)));
            }
            corners.clear();
            corners.extend(face.iter().map(|&corner| self.points.get(corner)));
            batch.polygon(&corners)
        })?;
        batch.finish()
    }

    fn size_hint(&self) -> Option<u64> {
        Some(self.faces.as_ref().map_or(0, |faces| faces.element.count))
    }
}
