//! glTF 2.0 (Khronos; ISO/IEC 12113), as text with its data beside or inside, or as one binary file (GLB).
//!
//! What is read: all triangles, strips and fans of all meshes in the default scene, placed by the transforms of its nodes, as one mesh.
//! Materials, lines, points, skins and morph targets are left out. glTF repeats vertices along seams of normals and textures, so
//! vertices of a mesh whose positions are identical to the last bit are joined, as those of STL files are. Coordinates stay as they are
//! (metres, y up).
//!
//! The document is read by our own hand over `serde_json`, because it may say anything: every index, offset and length is checked where it
//! is used.

mod buffers;
mod write;

pub(super) use write::GlbEncoder;

use super::scene::Scene;
use super::{Encoding, Parsed};
use crate::error::{Error, Place, Result};
use buffers::Buffers;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::Value;

/// The first bytes of GLB.
pub(super) const MAGIC: &[u8; 4] = b"glTF";
/// The kinds of chunks in GLB.
const JSON_CHUNK: &[u8] = b"JSON";
const BINARY_CHUNK: &[u8] = b"BIN\0";

/// Whether bytes look like glTF as text.
pub(super) fn is_text(prefix: &[u8]) -> bool {
    let start = prefix.trim_ascii_start();
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    let asset = b"\"asset\"";
    start.starts_with(b"{") && start.windows(asset.len()).any(|window| window == asset)
}

/// Reads a file with a document as text.
pub(super) fn parse_text(name: &str, bytes: &[u8]) -> Result<Parsed> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mesh = Document::parse(name, text, None, bytes.len())?.mesh()?;
    Ok(Parsed { mesh, encoding: Encoding::Text, trailing_bytes: 0 })
}

/// Reads GLB: a header of 12 bytes, then chunks.
pub(super) fn parse_binary(name: &str, bytes: &[u8]) -> Result<Parsed> {
    let error = |at: usize, problem: &str| {
        Error::format(name, Place::Byte(at as u64), problem, "the file is damaged or cut short: export it again")
    };
    let word = |at: usize| {
        let word = bytes.get(at..).and_then(<[u8]>::first_chunk).copied();
        word.map(u32::from_le_bytes).ok_or_else(|| error(at, "the header is cut short"))
    };
    let version = word(4)?;
    if version != 2 {
        let problem = format!("glTF of version {version}");
        return Err(Error::format(name, Place::Byte(4), problem, "version 2 is known: export it again as glTF 2.0"));
    }
    let len = word(8)? as usize;
    if len > bytes.len() {
        return Err(error(8, &format!("the header promises {len} bytes, but there are {}", bytes.len())));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < len {
        let size = word(at)? as usize;
        let kind = bytes.get(at + 4..at + 8).ok_or_else(|| error(at, "a chunk is cut short"))?;
        let data =
            bytes.get(at + 8..).and_then(|rest| rest.get(..size)).ok_or_else(|| error(at, "a chunk is cut short"))?;
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(data),
            BINARY_CHUNK if binary.is_none() => binary = Some(data),
            _ => {}
        }
        at += 8 + size;
    }
    let json = json.ok_or_else(|| error(12, "there is no JSON chunk"))?;
    let mesh = Document::parse(name, json, binary, bytes.len())?.mesh()?;
    Ok(Parsed { mesh, encoding: Encoding::LittleEndian, trailing_bytes: bytes.len().saturating_sub(at) as u64 })
}

/// Extensions that hide geometry where this reader does not look.
const UNREADABLE: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// A parsed document and its data.
struct Document<'a> {
    name: &'a str,
    json: Value,
    binary: Option<&'a [u8]>,
    bytes: usize,
}

impl<'a> Document<'a> {
    fn parse(name: &'a str, text: &[u8], binary: Option<&'a [u8]>, bytes: usize) -> Result<Self> {
        let json: Value = serde_json::from_slice(text).map_err(|e| {
            let place = Place::Line(e.line() as u64);
            Error::format(name, place, format!("the JSON of the file is malformed: {e}"), "export it again")
        })?;
        let document = Document { name, json, binary, bytes };
        let version = document.json.pointer("/asset/version").and_then(Value::as_str);
        if !version.is_some_and(|version| version.starts_with("2.")) {
            let problem = format!("glTF of version {}", version.unwrap_or("unknown"));
            return Err(document.error(problem, "version 2 is known: export it again as glTF 2.0"));
        }
        let required = document.list("extensionsRequired").iter().filter_map(Value::as_str);
        if let Some(extension) = required.clone().find(|extension| UNREADABLE.contains(extension)) {
            return Err(document.error(format!("the file needs {extension}"), "export it without compression"));
        }
        Ok(document)
    }

    #[cold]
    fn error(&self, problem: impl Into<String>, remedy: &str) -> Error {
        Error::format(self.name, Place::Whole, problem, remedy)
    }

    /// A list at the top of the document; empty where there is none.
    fn list(&self, key: &str) -> &[Value] {
        self.json.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    /// An object of a list at the top of the document.
    fn item(&self, list: &str, index: u64) -> Result<&Value> {
        let items = self.list(list);
        usize::try_from(index).ok().and_then(|index| items.get(index)).ok_or_else(|| {
            let problem = format!("something refers to {list}[{index}], but there are {}", items.len());
            self.error(problem, "export the file again")
        })
    }

    /// The number under a key; `None` where there is none.
    fn number(&self, object: &Value, key: &str) -> Result<Option<u64>> {
        match object.get(key) {
            None => Ok(None),
            Some(value) => value
                .as_u64()
                .map(Some)
                .ok_or_else(|| self.error(format!("{key} is {value}, which is not a count"), "export the file again")),
        }
    }

    /// `N` numbers under a key; `None` where there is no such key.
    fn numbers<const N: usize>(&self, object: &Value, key: &str) -> Result<Option<[f64; N]>> {
        let Some(value) = object.get(key) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = value.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
        numbers
            .and_then(|list| list.try_into().ok())
            .map(Some)
            .ok_or_else(|| self.error(format!("{key} is {value}, which is not {N} numbers"), "export the file again"))
    }

    /// All triangles of the scene.
    fn mesh(&self) -> Result<crate::mesh::Mesh> {
        let mut scene = Scene::new(self.name, self.bytes);
        let buffers = Buffers::new(self);
        let nodes = self.list("nodes");
        if nodes.is_empty() {
            for mesh in self.list("meshes") {
                self.add_mesh(mesh, &buffers, &DAffine3::IDENTITY, &mut scene)?;
            }
            return Ok(scene.finish());
        }
        let mut stack: Vec<(u64, DAffine3)> =
            self.roots()?.into_iter().rev().map(|n| (n, DAffine3::IDENTITY)).collect();
        let mut seen = vec![false; nodes.len()];
        while let Some((number, above)) = stack.pop() {
            let node = self.item("nodes", number)?;
            if std::mem::replace(&mut seen[number as usize], true) {
                let problem = format!("node {number} is found twice: it has two parents, or is its own ancestor");
                return Err(self.error(problem, "export the file again"));
            }
            let transform = above * self.transform(node)?;
            if let Some(mesh) = self.number(node, "mesh")? {
                self.add_mesh(self.item("meshes", mesh)?, &buffers, &transform, &mut scene)?;
            }
            let children = self.references(node, "children")?;
            stack.extend(children.into_iter().rev().map(|child| (child, transform)));
        }
        Ok(scene.finish())
    }

    /// The nodes of the default scene, or those without a parent where there is no scene.
    fn roots(&self) -> Result<Vec<u64>> {
        if !self.list("scenes").is_empty() {
            let scene = self.number(&self.json, "scene")?.unwrap_or(0);
            return self.references(self.item("scenes", scene)?, "nodes");
        }
        let mut is_child = vec![false; self.list("nodes").len()];
        for node in self.list("nodes") {
            for child in self.references(node, "children")? {
                self.item("nodes", child)?;
                is_child[child as usize] = true;
            }
        }
        Ok((0u64..).zip(is_child).filter(|(_, is_child)| !is_child).map(|(node, _)| node).collect())
    }

    /// The numbers in a list of an object.
    fn references(&self, object: &Value, key: &str) -> Result<Vec<u64>> {
        let list = object.get(key).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        let numbers: Option<Vec<u64>> = list.iter().map(Value::as_u64).collect();
        numbers.ok_or_else(|| self.error(format!("{key} holds something that is no index"), "export the file again"))
    }

    /// The transform of a node: a matrix, or scale, rotation and translation.
    fn transform(&self, node: &Value) -> Result<DAffine3> {
        if let Some(matrix) = self.numbers::<16>(node, "matrix")? {
            return Ok(DAffine3::from_mat4(DMat4::from_cols_array(&matrix)));
        }
        let translation = self.numbers(node, "translation")?.map_or(DVec3::ZERO, DVec3::from);
        let rotation = self.numbers(node, "rotation")?.map_or(DQuat::IDENTITY, DQuat::from_array);
        let scale = self.numbers(node, "scale")?.map_or(DVec3::ONE, DVec3::from);
        // A rotation that is none, as all zeros, would make everything NaN.
        let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    }

    fn add_mesh(
        &self,
        mesh: &Value,
        buffers: &Buffers<'_, '_>,
        transform: &DAffine3,
        scene: &mut Scene<'_>,
    ) -> Result<()> {
        for primitive in mesh.get("primitives").and_then(Value::as_array).map_or(&[][..], Vec::as_slice) {
            let mode = self.number(primitive, "mode")?.unwrap_or(TRIANGLES);
            let position = primitive.get("attributes").map(|attributes| self.number(attributes, "POSITION"));
            let Some(position) = position.transpose()?.flatten() else { continue };
            if !(TRIANGLES..=FAN).contains(&mode) {
                continue;
            }
            let points = buffers.positions(position)?;
            let indices = match self.number(primitive, "indices")? {
                Some(accessor) => buffers.indices(accessor)?,
                None => (0..points.len() as u32).collect(),
            };
            if let Some(wrong) = indices.iter().find(|&&i| i as usize >= points.len()) {
                let problem = format!("a face refers to vertex {wrong}, but there are {}", points.len());
                return Err(self.error(problem, "export the file again"));
            }
            scene.add(&points, &triangles(mode, &indices), transform, true)?;
        }
        Ok(())
    }
}

/// The kinds of primitives with triangles: a list, a strip (5) and a fan.
const TRIANGLES: u64 = 4;
const STRIP: u64 = 5;
const FAN: u64 = 6;

fn triangles(mode: u64, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        STRIP => {
            let strip = indices.windows(3).enumerate();
            strip.map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] }).collect()
        }
        FAN => indices.get(1..).unwrap_or(&[]).windows(2).map(|t| [indices[0], t[0], t[1]]).collect(),
        _ => indices.as_chunks().0.to_vec(),
    }
}
