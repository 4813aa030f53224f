//! SKT: the skeleton files of the `TopoMender` program.
//!
//! What was kept and what was cut or filled, edge by edge and face by face, without any header. Records follow one another,
//! little-endian, 21 bytes each:
//!
//! ```text
//! u8  0 a kept edge, 1 a cut edge, 2 a kept face, 3 a filled face
//! f32 weight
//! u64 the two ends, x << 40 | y << 20 | z in units of 2^-19 of the root cube: of an edge its two points,
//! u64 of a face the centres of the two cells beside it; beyond the root's boundary, the centre of the face itself
//! ```
//!
//! A byte 255 ends a phase: first the object's, then the background's. That program writes the centre of one and the same cell for both
//! ends of faces; this one writes both cells, and reads either.

use super::file::AtomicFile;
use crate::error::{Error, Place, Result};
use crate::grid::Key;
use std::path::Path;

/// What a record is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// An edge of the object's skeleton that stays.
    KeptEdge,
    /// An edge of the object's skeleton that was cut.
    CutEdge,
    /// A face of the background's skeleton that stays open.
    KeptFace,
    /// A face of the background's skeleton that was filled.
    FilledFace,
}

impl Kind {
    /// All four, in the order of their codes.
    pub const ALL: [Kind; 4] = [Kind::KeptEdge, Kind::CutEdge, Kind::KeptFace, Kind::FilledFace];
}

/// An edge or face of a skeleton.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    /// What it is about.
    pub kind: Kind,
    /// The size of the section at the edge, or of the membrane at the face, in the units of whoever writes it. Not NaN.
    pub weight: f32,
    /// The points it joins. See the [module](self).
    pub ends: [Key; 2],
}

impl Record {
    /// The record of an edge of a skeleton.
    ///
    /// # Panics
    /// When `edge` is not an edge.
    pub fn of_edge(edge: Key, is_cut: bool, weight: f32) -> Record {
        assert!(edge.dir().dimension() == 1, "{edge} is not an edge");
        let mut ends = edge.boundary();
        let mut end = || ends.next().expect("an edge has two ends");
        Record { kind: if is_cut { Kind::CutEdge } else { Kind::KeptEdge }, weight, ends: [end(), end()] }
    }

    /// The record of a face of a skeleton of the background.
    ///
    /// # Panics
    /// When `face` is not a face.
    pub fn of_face(face: Key, is_filled: bool, weight: f32) -> Record {
        assert!(face.dir().dimension() == 2, "{face} is not a face");
        let centre = |key: Key| Key::point(key.center()).expect("centres lie in the root cube");
        let cells: Vec<Key> = face.coboundary().map(centre).collect();
        let middle = centre(face);
        let ends = match cells[..] {
            [low, high] => [low, high],
            [cell] if cell > middle => [middle, cell],
            [cell] => [cell, middle],
            _ => unreachable!("a face has one or two cells beside it"),
        };
        Record { kind: if is_filled { Kind::FilledFace } else { Kind::KeptFace }, weight, ends }
    }
}

/// The records of an SKT file by phase.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Skeleton {
    /// The phases in order: of the object, of the background, or whatever was appended.
    pub phases: Vec<Vec<Record>>,
}

/// Bytes of a record behind its code.
const RECORD: usize = 20;
/// Ends a phase.
const END: u8 = 0xff;

/// Reads a whole file. Cost: some 10 ns a record.
///
/// # Errors
/// When the file cannot be read or is malformed.
pub fn read(path: impl AsRef<Path>) -> Result<Skeleton> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    parse(&path.display().to_string(), &bytes)
}

/// Reads the bytes of a whole file; `name` stands in error messages.
///
/// # Errors
/// When they are malformed: a code that is none of 0 to 3 and 255, a position outside of the root cube, a weight that is not a number,
/// or no byte 255 at the end. Names the offset.
pub fn parse(name: &str, bytes: &[u8]) -> Result<Skeleton> {
    let fail =
        |at: usize, problem: String, remedy: &str| Err(Error::format(name, Place::Byte(at as u64), problem, remedy));
    let mut skeleton = Skeleton::default();
    let mut phase = Vec::new();
    let mut rest = bytes;
    while let [code, behind @ ..] = rest {
        let at = bytes.len() - rest.len();
        if *code == END {
            skeleton.phases.push(std::mem::take(&mut phase));
            rest = behind;
            continue;
        }
        let Some(&kind) = Kind::ALL.get(usize::from(*code)) else {
            return fail(at, format!("{code} is no kind of record"), "is it an SKT file at all?");
        };
        let Some((record, next)) = behind.split_first_chunk::<RECORD>() else {
            return fail(at, "the file ends within a record".to_owned(), "copy or export it again");
        };
        let [w0, w1, w2, w3, ends @ ..] = record;
        let weight = f32::from_le_bytes([*w0, *w1, *w2, *w3]);
        if weight.is_nan() {
            return fail(at + 1, "the weight is not a number".to_owned(), "");
        }
        let (low, high) = ends.split_at(8);
        let end = |bytes: &[u8]| {
            let fields = u64::from_le_bytes(bytes.try_into().expect("eight bytes"));
            Key::from_fields(fields).filter(|key| key.is_point())
        };
        let (Some(low), Some(high)) = (end(low), end(high)) else {
            let problem = "a position lies outside of the root cube".to_owned();
            return fail(at + 5, problem, "coordinates are 20 bits each, up to 2^19");
        };
        phase.push(Record { kind, weight, ends: [low, high] });
        rest = next;
    }
    if !phase.is_empty() || skeleton.phases.is_empty() {
        return fail(bytes.len(), "the byte 255 that ends a phase is missing".to_owned(), "copy or export it again");
    }
    Ok(skeleton)
}

/// Writes a file, which appears whole or not at all. Returns its size in bytes.
///
/// # Errors
/// When it cannot be written.
pub fn write(path: impl AsRef<Path>, skeleton: &Skeleton) -> Result<u64> {
    let bytes = encode(skeleton);
    let mut file = AtomicFile::create(path.as_ref())?;
    file.write(&bytes)?;
    file.commit()?;
    Ok(bytes.len() as u64)
}

/// The bytes of a file.
pub fn encode(skeleton: &Skeleton) -> Vec<u8> {
    let records = skeleton.phases.iter().map(Vec::len).sum::<usize>();
    let mut bytes = Vec::with_capacity(records * (RECORD + 1) + skeleton.phases.len());
    for phase in &skeleton.phases {
        for record in phase {
            bytes.push(record.kind as u8);
            bytes.extend(record.weight.to_le_bytes());
            record.ends.iter().for_each(|end| bytes.extend(end.to_fields().to_le_bytes()));
        }
        bytes.push(END);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Axis, Corner, Face};
    use proptest::prelude::*;

    #[test]
    fn files_are_known_byte_by_byte() {
        let cell = Key::cell(1, [0, 1, 0]).expect("in the root");
        let edge = cell.edge(crate::grid::Edge::at(Axis::Z, Corner::MIN));
        let inner = cell.face(Face::new(Axis::X, true));
        let outer = cell.face(Face::new(Axis::Z, false));
        let skeleton = Skeleton {
            phases: vec![
                vec![Record::of_edge(edge, true, 1.5)],
                vec![Record::of_face(inner, false, 1e20), Record::of_face(outer, true, 0.0)],
            ],
        };
        let fields = |x: u64, y: u64, z: u64| (x << 40 | y << 20 | z).to_le_bytes();
        let (half, quarter) = (1 << 18, 1 << 17);
        let expected = [
            &[1][..],
            &1.5f32.to_le_bytes(),
            &fields(0, half, 0),
            &fields(0, half, half),
            &[255, 2],
            &1e20f32.to_le_bytes(),
            &fields(quarter, half + quarter, quarter),
            &fields(half + quarter, half + quarter, quarter),
            &[3],
            &0f32.to_le_bytes(),
            &fields(quarter, half + quarter, 0),
            &fields(quarter, half + quarter, quarter),
            &[255],
        ]
        .concat();
        assert_eq!(encode(&skeleton), expected);
        assert_eq!(parse("fixture", &expected).expect("well-formed"), skeleton);
    }

    #[test]
    fn malformed_files_are_refused_with_their_place() {
        let message = |bytes: &[u8]| parse("a.skt", bytes).expect_err("malformed").to_string();
        let record = |code: u8, weight: f32, end: u64| {
            [&[code][..], &weight.to_le_bytes(), &[0; 8], &end.to_le_bytes()].concat()
        };
        assert!(message(b"").contains("byte 0: the byte 255"));
        assert!(message(&[7]).contains("byte 0: 7 is no kind of record; is it an SKT file"));
        assert!(message(&[255, 0, 1, 2]).contains("byte 1: the file ends within a record"));
        assert!(message(&record(0, 1.0, 0)).contains("byte 21: the byte 255"));
        assert!(message(&record(0, f32::NAN, 0)).contains("byte 1: the weight"));
        for end in [1 << 60, 1 << 63, (1 << 19) + 1, u64::MAX] {
            assert!(message(&record(0, 1.0, end)).contains("byte 5: a position"), "{end:x}");
        }
        assert_eq!(parse("a.skt", &[255, 255]).expect("two empty phases").phases.len(), 2);
    }

    #[test]
    fn files_come_back() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("a.skt");
        let edge = Key::ROOT.edge(crate::grid::Edge::ALL[5]);
        let skeleton = Skeleton { phases: vec![vec![Record::of_edge(edge, false, 3.0)]] };
        assert_eq!(write(&path, &skeleton).expect("written"), 22);
        assert_eq!(read(&path).expect("read"), skeleton);
        assert!(read(directory.path().join("b.skt")).expect_err("none").to_string().contains("b.skt"));
    }

    proptest! {
        #[test]
        fn records_survive(
            phases in prop::collection::vec(
                prop::collection::vec((0usize..4, -1e30f32..1e30, prop::array::uniform6(0u32..=1 << 19)), 0..20),
                1..4,
            ),
        ) {
            let record = |&(kind, weight, [a, b, c, d, e, f]): &(usize, f32, [u32; 6])| {
                let point = |at| Key::point(at).expect("in the root");
                Record { kind: Kind::ALL[kind], weight, ends: [point([a, b, c]), point([d, e, f])] }
            };
            let skeleton = Skeleton { phases: phases.iter().map(|phase| phase.iter().map(record).collect()).collect() };
            prop_assert_eq!(parse("memory", &encode(&skeleton)).expect("well-formed"), skeleton);
        }

        #[test]
        fn noise_never_panics(bytes in prop::collection::vec(prop_oneof![Just(0u8), Just(2), Just(255), any::<u8>()], 0..100)) {
            if let Ok(skeleton) = parse("noise", &bytes) {
                prop_assert_eq!(parse("noise", &encode(&skeleton)).expect("its own bytes"), skeleton);
            }
        }
    }
}
