//! 3MF from a mesh: one object, built once. The XML is packed as it comes.

use super::zip::ArchiveWriter;
use crate::error::{Error, Place, Result};
use crate::io::encode::{Encoder, Out, Patch, Precision};
use crate::io::scene::Triangles;
use crate::mesh::MeshSizes;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use glam::DVec3;
use std::io::Write;

const TYPES: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    r#"<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">"#,
    r#"<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>"#,
    r#"<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>"#,
);
const RELATIONS: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    r#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">"#,
    r#"<Relationship Target="/3D/3dmodel.model" Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>"#,
    r"</Relationships>",
);
const MODEL: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    "\n",
    r#"<model unit="millimeter" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">"#,
    r#"<metadata name="Application">zmend</metadata><resources><object id="1" type="model"><mesh><vertices>"#,
    "\n",
);
const BETWEEN: &str = "</vertices><triangles>\n";
const END: &str = "</triangles></mesh></object></resources><build><item objectid=\"1\"/></build></model>\n";

/// Sizes in the directory have 32 bits.
const MOST: u64 = u32::MAX as u64 - (1 << 20);

/// Encodes 3MF.
#[derive(Debug)]
pub(in crate::io) struct ThreeMfEncoder {
    name: String,
    precision: Precision,
    triangles: Triangles,
    archive: ArchiveWriter,
    packer: DeflateEncoder<Vec<u8>>,
    /// Text of the open entry that is not packed yet.
    text: Out,
    /// Bytes of text of the open entry that are.
    full: u64,
    has_points: bool,
}

impl ThreeMfEncoder {
    /// `name` is for messages.
    pub(in crate::io) fn new(name: String, precision: Precision) -> Self {
        ThreeMfEncoder {
            triangles: Triangles::new(name.clone()),
            name,
            precision,
            archive: ArchiveWriter::default(),
            packer: packer(),
            text: Out::default(),
            full: 0,
            has_points: false,
        }
    }

    /// Packs the text so far.
    fn pack(&mut self, out: &mut Out) {
        let text = self.text.bytes();
        self.packer.write_all(text).expect("memory takes all that is written");
        self.full += text.len() as u64;
        let packed = self.packer.get_mut();
        self.archive.data(text, packed, out);
        packed.clear();
        self.text.clear();
    }

    fn begin_entry(&mut self, path: &'static str, out: &mut Out) {
        self.packer = packer();
        self.full = 0;
        self.archive.begin(path, out);
    }

    fn end_entry(&mut self, out: &mut Out) {
        self.pack(out);
        let rest = std::mem::replace(&mut self.packer, packer()).finish().expect("memory takes all that is written");
        self.archive.data(&[], &rest, out);
        self.archive.end(self.full, out);
    }

    /// Whether there is room for more.
    fn check(&self) -> Result<()> {
        if self.full <= MOST && self.archive.position() <= MOST {
            return Ok(());
        }
        let problem = "the model is larger than the 4 GB of text that 3MF holds";
        Err(Error::format(self.name.as_str(), Place::Whole, problem, "write GLB or PLY, or take a smaller depth"))
    }

    /// What stands between the points and the triangles, once.
    fn begin_triangles(&mut self) {
        if !std::mem::replace(&mut self.has_points, true) {
            self.text.push(BETWEEN.as_bytes());
        }
    }
}

/// Fast packing: the better kinds take five times as long for a tenth less.
fn packer() -> DeflateEncoder<Vec<u8>> {
    DeflateEncoder::new(Vec::new(), Compression::fast())
}

impl Encoder for ThreeMfEncoder {
    fn begin(&mut self, sizes: MeshSizes, out: &mut Out) -> Result<()> {
        self.triangles.begin(sizes);
        for (path, content) in [("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS)] {
            self.begin_entry(path, out);
            self.text.push(content.as_bytes());
            self.end_entry(out);
        }
        self.begin_entry("3D/3dmodel.model", out);
        self.text.push(MODEL.as_bytes());
        Ok(())
    }

    fn points(&mut self, points: &[DVec3], out: &mut Out) {
        self.triangles.points(points);
        for point in points {
            for (name, value) in [&b"<vertex x=\""[..], b"\" y=\"", b"\" z=\""].into_iter().zip(point.to_array()) {
                self.text.push(name);
                self.text.push_number(value, self.precision);
            }
            self.text.push(b"\"/>\n");
        }
        self.pack(out);
    }

    fn faces(&mut self, arity: usize, corners: &[u32], out: &mut Out) -> Result<()> {
        self.begin_triangles();
        let text = &mut self.text;
        self.triangles.cut(arity, corners, |triangle| {
            for (name, corner) in [&b"<triangle v1=\""[..], b"\" v2=\"", b"\" v3=\""].into_iter().zip(triangle) {
                text.push(name);
                text.push_integer(corner.into());
            }
            text.push(b"\"/>\n");
        })?;
        self.pack(out);
        self.check()
    }

    fn end(&mut self, out: &mut Out) -> Option<Patch> {
        self.begin_triangles();
        self.text.push(END.as_bytes());
        self.end_entry(out);
        self.archive.finish(out);
        None
    }
}
