//! GLB from a mesh: one node with one mesh of triangles.
//!
//! The JSON comes first, but says what is only known at the end: the bounds of the points, and the number of triangles where faces are cut.
//! So its numbers are written in fields of fixed width, and replaced at the end.

use crate::error::{Error, Place, Result};
use crate::io::encode::{Encoder, Out, Patch};
use crate::io::scene::Triangles;
use crate::mesh::MeshSizes;
use glam::{DVec3, Vec3};

/// Encodes GLB in single precision, the only one that glTF has.
#[derive(Debug)]
pub(in crate::io) struct GlbEncoder {
    name: String,
    triangles: Triangles,
    counts: Counts,
    low: Vec3,
    high: Vec3,
}

/// What is in the file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Counts {
    points: u64,
    triangles: u64,
}

impl Counts {
    /// Bytes of the binary chunk.
    fn bytes(self) -> u64 {
        12 * (self.points + self.triangles)
    }
}

impl GlbEncoder {
    /// `name` is for messages.
    pub(in crate::io) fn new(name: String) -> Self {
        let triangles = Triangles::new(name.clone());
        GlbEncoder { name, triangles, counts: Counts::default(), low: Vec3::INFINITY, high: Vec3::NEG_INFINITY }
    }

    /// Everything before the points.
    fn header(&self, Counts { points, triangles }: Counts) -> Vec<u8> {
        let vector = |v: Vec3| v.to_array().map(|c| format!("{:<15e}", if c.is_finite() { c } else { 0.0 })).join(",");
        let (low, high) = (vector(self.low), vector(self.high));
        let (corners, of_points, of_triangles) = (3 * triangles, 12 * points, 12 * triangles);
        let json = if points == 0 {
            r#"{"asset":{"version":"2.0","generator":"zmend"},"scene":0,"scenes":[{}]}"#.to_owned()
        } else {
            format!(
                concat!(
                    r#"{{"asset":{{"version":"2.0","generator":"zmend"}},"scene":0,"scenes":[{{"nodes":[0]}}],"#,
                    r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],"#,
                    r#""accessors":[{{"bufferView":0,"componentType":5126,"count":{points:<10},"type":"VEC3","#,
                    r#""min":[{low}],"max":[{high}]}},"#,
                    r#"{{"bufferView":1,"componentType":5125,"count":{corners:<10},"type":"SCALAR"}}],"#,
                    r#""bufferViews":[{{"buffer":0,"byteLength":{of_points:<10},"target":34962}},"#,
                    r#"{{"buffer":0,"byteOffset":{of_points:<10},"byteLength":{of_triangles:<10},"target":34963}}],"#,
                    r#""buffers":[{{"byteLength":{bytes:<10}}}]}}"#
                ),
                points = points,
                low = low,
                high = high,
                corners = corners,
                of_points = of_points,
                of_triangles = of_triangles,
                bytes = of_points + of_triangles,
            )
        };
        let json = json.into_bytes();
        let json_len = json.len().next_multiple_of(4);
        let binary = Counts { points, triangles }.bytes();
        let binary_chunk = if points == 0 { 0 } else { 8 + binary };
        let total = 12 + 8 + json_len as u64 + binary_chunk;
        let mut header = Vec::new();
        header.extend(super::MAGIC);
        // What does not fit in 32 bits was refused at the beginning.
        [2, total as u32, json_len as u32].iter().for_each(|word| header.extend(word.to_le_bytes()));
        header.extend(super::JSON_CHUNK);
        header.extend(&json);
        header.resize(20 + json_len, b' ');
        if points > 0 {
            header.extend((binary as u32).to_le_bytes());
            header.extend(super::BINARY_CHUNK);
        }
        header
    }
}

impl Encoder for GlbEncoder {
    fn begin(&mut self, sizes: MeshSizes, out: &mut Out) -> Result<()> {
        let promised = Counts { points: sizes.points, triangles: self.triangles.begin(sizes) };
        if promised.bytes() > u64::from(u32::MAX) - 4096 {
            let problem = format!(
                "{} vertices and {} triangles are more than the 4 GB of GLB hold",
                sizes.points, promised.triangles
            );
            return Err(Error::format(self.name.as_str(), Place::Whole, problem, "write PLY, or take a smaller depth"));
        }
        out.push(&self.header(promised));
        Ok(())
    }

    fn points(&mut self, points: &[DVec3], out: &mut Out) {
        self.triangles.points(points);
        self.counts.points += points.len() as u64;
        for point in points.iter().map(|p| p.as_vec3()) {
            // Comparisons with NaN leave the bounds as they are.
            self.low = self.low.min(point);
            self.high = self.high.max(point);
            point.to_array().iter().for_each(|c| out.push(&c.to_le_bytes()));
        }
    }

    fn faces(&mut self, arity: usize, corners: &[u32], out: &mut Out) -> Result<()> {
        let written = &mut self.counts.triangles;
        self.triangles.cut(arity, corners, |triangle| {
            *written += 1;
            triangle.iter().for_each(|corner| out.push(&corner.to_le_bytes()));
        })
    }

    fn end(&mut self, _: &mut Out) -> Option<Patch> {
        Some(Patch { position: 0, bytes: self.header(self.counts) })
    }
}
