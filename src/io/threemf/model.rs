//! The XML of a model.

use crate::error::{Error, Place, Result};
use glam::{DAffine3, DMat3, DVec3};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::collections::BTreeMap;
use std::io::BufRead;

/// What a model part of an archive holds.
#[derive(Debug, Default)]
pub(super) struct Model {
    /// By the numbers of the objects.
    pub(super) shapes: BTreeMap<u32, Shape>,
    /// What is to be built.
    pub(super) items: Vec<Object>,
}

/// What an object is.
#[derive(Debug)]
pub(super) enum Shape {
    Mesh { points: Vec<DVec3>, triangles: Vec<[u32; 3]> },
    Components(Vec<Object>),
}

/// An object at a place.
#[derive(Debug, Clone)]
pub(super) struct Object {
    /// The part of the archive that holds it, if it is another one.
    pub(super) path: Option<String>,
    pub(super) id: u32,
    pub(super) transform: DAffine3,
}

/// The path of the model that the relations of an archive name.
pub(super) fn root_of(relations: &[u8]) -> Option<String> {
    let mut reader = Reader::from_reader(relations);
    let mut buffer = Vec::new();
    loop {
        match reader.read_event_into(&mut buffer).ok()? {
            Event::Start(tag) | Event::Empty(tag) => {
                let value = |name: &str| text(&tag, name).ok().flatten();
                if value("Type").is_some_and(|kind| kind.ends_with("/3dmodel")) {
                    return value("Target");
                }
            }
            Event::Eof => return None,
            _ => {}
        }
        buffer.clear();
    }
}

/// The value of an attribute, whatever its namespace.
fn text(tag: &BytesStart<'_>, name: &str) -> Result<Option<String>, quick_xml::Error> {
    for attribute in tag.attributes().with_checks(false) {
        let attribute = attribute?;
        if attribute.key.local_name().as_ref() == name {
            return Ok(Some(attribute.value.into_owned()));
        }
    }
    Ok(None)
}

impl Model {
    /// Reads a model as it comes; `name` and `path` are for messages.
    pub(super) fn parse(name: &str, path: &str, stream: &mut dyn BufRead) -> Result<Model> {
        let mut reader = Reader::from_reader(stream);
        let mut parser = Parser { model: Model::default(), object: None };
        let mut buffer = Vec::new();
        let mut depth = 0u64;
        loop {
            let at = reader.buffer_position();
            let fail = |problem: String| {
                let problem = format!("{path}, byte {at}: {problem}");
                Error::format(name, Place::Whole, problem, "export the file again")
            };
            match reader.read_event_into(&mut buffer).map_err(|e| fail(e.to_string()))? {
                Event::Start(tag) => {
                    depth += 1;
                    parser.begin(&tag).map_err(fail)?;
                }
                Event::Empty(tag) => {
                    parser.begin(&tag).map_err(&fail)?;
                    parser.end(tag.local_name().as_ref()).map_err(fail)?;
                }
                Event::End(tag) => {
                    depth = depth.saturating_sub(1);
                    parser.end(tag.local_name().as_ref()).map_err(fail)?;
                }
                Event::Eof if depth > 0 => return Err(fail("the model ends before it is complete".to_owned())),
                Event::Eof => return Ok(parser.model),
                _ => {}
            }
            buffer.clear();
        }
    }
}

/// A model that is being read.
struct Parser {
    model: Model,
    /// The object that is open.
    object: Option<(u32, Shape)>,
}

type Attempt<T = ()> = Result<T, String>;

impl Parser {
    fn begin(&mut self, tag: &BytesStart<'_>) -> Attempt {
        match (tag.local_name().as_ref(), &mut self.object) {
            ("vertex", Some((_, Shape::Mesh { points, .. }))) => {
                points.push(DVec3::from(numbers(tag, ["x", "y", "z"])?));
            }
            ("triangle", Some((_, Shape::Mesh { triangles, .. }))) => {
                triangles.push(numbers(tag, ["v1", "v2", "v3"])?);
            }
            ("object", object) => {
                let [id] = numbers(tag, ["id"])?;
                *object = Some((id, Shape::Mesh { points: Vec::new(), triangles: Vec::new() }));
            }
            ("component", Some((_, shape))) => match shape {
                Shape::Components(components) => components.push(object_of(tag)?),
                Shape::Mesh { .. } => *shape = Shape::Components(vec![object_of(tag)?]),
            },
            ("item", None) => self.model.items.push(object_of(tag)?),
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &str) -> Attempt {
        if name != "object" {
            return Ok(());
        }
        let Some((id, shape)) = self.object.take() else { return Ok(()) };
        if let Shape::Mesh { points, triangles } = &shape {
            let wrong = triangles.as_flattened().iter().find(|&&corner| corner as usize >= points.len());
            if let Some(wrong) = wrong {
                return Err(format!(
                    "a triangle of object {id} refers to vertex {wrong}, but there are {}",
                    points.len()
                ));
            }
        }
        self.model.shapes.insert(id, shape);
        Ok(())
    }
}

/// The numbers of some attributes, all of which must be there.
fn numbers<T: std::str::FromStr + Default + Copy, const N: usize>(
    tag: &BytesStart<'_>,
    names: [&str; N],
) -> Attempt<[T; N]> {
    let mut values = [None; N];
    for attribute in tag.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| e.to_string())?;
        if let Some(i) = names.iter().position(|&name| name == attribute.key.local_name().as_ref()) {
            let number = attribute
                .value
                .trim()
                .parse()
                .map_err(|_| format!("{} is \"{}\", which is no number of its kind", names[i], attribute.value))?;
            values[i] = Some(number);
        }
    }
    match values.iter().position(Option::is_none) {
        Some(i) => Err(format!("{} is missing", names[i])),
        None => Ok(values.map(Option::unwrap_or_default)),
    }
}

/// What an item or a component refers to.
fn object_of(tag: &BytesStart<'_>) -> Attempt<Object> {
    let [id] = numbers(tag, ["objectid"])?;
    let attribute = |name| text(tag, name).map_err(|e| e.to_string());
    let transform = match attribute("transform")? {
        None => DAffine3::IDENTITY,
        Some(text) => {
            let numbers: Option<Vec<f64>> = text.split_whitespace().map(|number| number.parse().ok()).collect();
            let numbers: Option<[f64; 12]> = numbers.and_then(|numbers| numbers.try_into().ok());
            let m = numbers.ok_or_else(|| format!("transform is \"{text}\", which is not twelve numbers"))?;
            // Rows of a matrix that is multiplied from the right are our columns.
            let column = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
            DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(3), column(6)), column(9))
        }
    };
    Ok(Object { path: attribute("path")?, id, transform })
}
