//! 3MF (3MF Consortium, core specification 1.3): a ZIP archive with a model in XML.
//!
//! What is read: the meshes of all items of the build, each placed by its transform, with the components that objects are made of, also from
//! other parts of the archive (production extension), as one mesh. Where nothing is to be built, all meshes. Materials, colours, slices
//! and lattices are left out. Coordinates stay as they are, whatever their unit.
//!
//! The XML is read as it is unpacked and never held. An archive may claim to be of any size when it is unpacked, so this ends at
//! [`most_unpacked`] bytes.

mod model;
mod write;
mod zip;

pub(super) use write::ThreeMfEncoder;
pub(super) use zip::is_zip;

use super::scene::Scene;
use super::{Encoding, Parsed};
use crate::error::{Error, Place, Result};
use glam::DAffine3;
use model::{Model, Object, Shape};
use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use zip::Archive;

/// Objects within objects within objects; more is taken for a circle.
const DEEPEST: usize = 64;

/// How many points a component counts for, even where it has none: that is how long it takes.
const PER_COMPONENT: u64 = 16;

/// The most bytes that an archive of so many bytes may unpack to: coordinates as text pack to a fifth or a tenth.
fn most_unpacked(bytes: usize) -> u64 {
    (1 << 24) + 100 * bytes as u64
}

/// Reads a file.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Parsed> {
    let archive = Archive::open(name, bytes)?;
    let mut package = Package { name, archive, models: BTreeMap::new(), left: most_unpacked(bytes.len()) };
    let root = package.root()?;
    package.load(&root)?;
    let mut scene = Scene::new(name, bytes.len());
    let model = &package.models[&root];
    let items: Vec<Object> = if model.items.is_empty() {
        let meshes = model.shapes.iter().filter(|(_, shape)| matches!(shape, Shape::Mesh { .. }));
        meshes.map(|(&id, _)| Object { path: None, id, transform: DAffine3::IDENTITY }).collect()
    } else {
        model.items.clone()
    };
    for item in &items {
        package.add(&root, item, &DAffine3::IDENTITY, 0, &mut scene)?;
    }
    Ok(Parsed { mesh: scene.finish(), encoding: Encoding::Text, trailing_bytes: 0 })
}

/// An archive and those of its models that were needed.
struct Package<'a> {
    name: &'a str,
    archive: Archive<'a>,
    /// By path, in lower case and without a slash at the start.
    models: BTreeMap<String, Model>,
    /// Bytes that may still be unpacked.
    left: u64,
}

impl Package<'_> {
    #[cold]
    fn error(&self, problem: impl Into<String>, remedy: &str) -> Error {
        Error::format(self.name, Place::Whole, problem, remedy)
    }

    /// The path of the model to begin with: what the relations of the archive name, or the first model.
    fn root(&mut self) -> Result<String> {
        let mut relations = Vec::new();
        if let Some(stream) = self.archive.open_entry("_rels/.rels")? {
            // Damaged relations are no relations.
            let _ = stream.take(1 << 20).read_to_end(&mut relations);
        }
        let named = model::root_of(&relations).map(|path| key(&path));
        let first = || self.archive.find_by_end(".model").map(key);
        named.or_else(first).ok_or_else(|| self.error("there is no 3D model in the archive", "is it a 3MF file?"))
    }

    /// Reads a model unless it was read before.
    fn load(&mut self, path: &str) -> Result<()> {
        if self.models.contains_key(path) {
            return Ok(());
        }
        let Some(stream) = self.archive.open_entry(path)? else {
            return Err(self.error(format!("there is no {path} in the archive"), "export the file again"));
        };
        let mut stream = BufReader::with_capacity(1 << 16, stream.take(self.left));
        let model = Model::parse(self.name, path, &mut stream)?;
        self.left = stream.get_ref().limit();
        if self.left == 0 {
            return Err(
                self.error("the file unpacks to more than a hundred times its size", "it is damaged or malicious")
            );
        }
        self.models.insert(path.to_owned(), model);
        Ok(())
    }

    /// Adds an object of a model to the scene.
    fn add(
        &mut self,
        path: &str,
        object: &Object,
        above: &DAffine3,
        depth: usize,
        scene: &mut Scene<'_>,
    ) -> Result<()> {
        let path = object.path.as_deref().map_or_else(|| path.to_owned(), key);
        self.load(&path)?;
        let transform = *above * object.transform;
        let Some(shape) = self.models[&path].shapes.get(&object.id) else {
            let problem = format!("something refers to object {} of {path}, which is not there", object.id);
            return Err(self.error(problem, "export the file again"));
        };
        match shape {
            Shape::Mesh { points, triangles } => scene.add(points, triangles, &transform, false),
            Shape::Components(_) if depth >= DEEPEST => {
                let problem = format!("object {} of {path} is part of itself", object.id);
                Err(self.error(problem, "export the file again"))
            }
            Shape::Components(components) => {
                scene.spend(PER_COMPONENT * components.len() as u64)?;
                let components = components.clone();
                components.iter().try_for_each(|component| self.add(&path, component, &transform, depth + 1, scene))
            }
        }
    }
}

/// How paths are compared.
fn key(path: impl AsRef<str>) -> String {
    path.as_ref().trim_start_matches('/').to_ascii_lowercase()
}
