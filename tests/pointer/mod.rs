//! The baselines of the benches do the same as zmend: a pointer octree, and maps with an entry a cell.

#[path = "../../benches/pointer_octree/mod.rs"]
mod pointer_octree;

use pointer_octree::blocks::Blocks;
use pointer_octree::cell_map::{self, CellMap, TreeCells, hash_cells};
use pointer_octree::elements::{TopoMemory, prepare};
use pointer_octree::node::{Memory, Tree};
use pointer_octree::{element_map, locate, scan, sign, span, thin};
use proptest::prelude::*;
use std::collections::BTreeMap;
use zmend::geom::Frame;
use zmend::glam::DVec3;
use zmend::grid::{Axis, Extent, Face, Key};
use zmend::mesh::{TriangleSource, sample};
use zmend::octree::crossings::finest_element;
use zmend::octree::{Crossings, EditedOctree, LinearOctree};
use zmend::progress::Silent;
use zmend::topology::{Betti, Complex, Loops, Options as Repair, Side, repair_topology};
use zmend::{Inside, Mesh, Options, repair};

/// Samples that are closed, and a depth at which each has features near the size of a cell.
const CLOSED: [(&str, u32); 7] =
    [("knot", 6), ("torus", 5), ("sphere", 6), ("part", 6), ("noisy", 6), ("nested", 6), ("cube", 4)];

fn input(name: &str, depth: u32) -> (Mesh, Frame) {
    let mut mesh = sample::build(name, 1).unwrap();
    let frame = Frame::fit(&mesh.bounds().unwrap(), depth, 0.9).unwrap();
    (mesh, frame)
}

fn crossings(mesh: &Mesh, frame: &Frame) -> Crossings {
    zmend::sign::scan(&mut &*mesh, frame, false, &Silent).unwrap().crossings
}

/// Asserts that the pointer octree marks the same edges; returns their number.
fn marks_the_same(mesh: &Mesh, frame: &Frame) -> usize {
    let crossings = crossings(mesh, frame);
    let memory = Memory::<()>::default();
    let tree = Tree::new(&memory, frame.depth());
    scan::scan(&tree, &mut &*mesh, frame).unwrap();
    let mut count = 0;
    for place in locate::leaves(&tree) {
        for axis in Axis::ALL {
            let marked = place.leaf.a.get() >> (4 * axis.index()) & 1 == 1;
            let edge = finest_element(frame.depth(), place.at, Extent::from(axis));
            assert_eq!(marked, crossings.is_crossed(edge), "{edge}");
            count += usize::from(marked);
            if let Some(sample) = crossings.sample(edge) {
                let offset = place.leaf.b.get() >> (16 * axis.index()) & 0xffff;
                // zmend keeps a margin to the ends of edges, and rounds a last bit in its own way.
                assert!(sample.position() * 65536.0 - offset as f64 <= 68.0, "{edge}");
            }
        }
    }
    assert_eq!(count, crossings.len());
    count
}

#[test]
fn descent_finds_the_crossings_of_rasterisation() {
    for (name, depth) in CLOSED {
        let (mesh, frame) = input(name, depth);
        assert!(marks_the_same(&mesh, &frame) > 500, "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Corners on lattice points and at the middles of cells: ties of every kind.
    #[test]
    fn descent_decides_ties_as_rasterisation_does(corners in prop::array::uniform4(prop::array::uniform3(2..30i32))) {
        let points = corners.map(|p| DVec3::from(p.map(f64::from)) / 2.0).to_vec();
        let faces: [&[u32]; 4] = [&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]];
        let mesh = Mesh { points, faces: faces.into_iter().collect() };
        let frame = Frame::new(DVec3::ZERO, 16.0, 4).unwrap();
        marks_the_same(&mesh, &frame);
    }
}

#[test]
fn all_baselines_repair_like_zmend() {
    for (name, depth) in CLOSED {
        let (mesh, frame) = input(name, depth);
        let options = Options { depth, inside: Inside::Parity, ..Options::default() };
        let expected = repair(mesh.clone(), &options).unwrap().mesh.report();
        let of = |which: usize| {
            let mut result = Mesh::default();
            let counts = match which {
                0 => pointer_octree::repair(&mut &mesh, &frame, &mut result),
                1 => cell_map::repair(hash_cells(), &mut &mesh, &frame, &mut result),
                _ => cell_map::repair(TreeCells::new(), &mut &mesh, &frame, &mut result),
            };
            assert_eq!(counts.unwrap().odd, 0, "{name}");
            assert_eq!(result.validate(), Ok(()), "{name} {which}");
            result.report()
        };
        for which in 0..3 {
            let found = of(which);
            assert_eq!((found.points, found.faces), (expected.points, expected.faces), "{name} {which}");
            let topology = |report: &zmend::mesh::Report| (report.components, report.euler, report.genus);
            assert_eq!(topology(&found), topology(&expected), "{name} {which}");
            assert!((found.volume - expected.volume).abs() < 1e-4 * expected.volume, "{name} {which}");
            assert!((found.area - expected.area).abs() < 1e-4 * expected.area, "{name} {which}");
        }
    }
}

#[test]
fn pointers_and_keys_answer_alike() {
    let (mesh, frame) = input("part", 6);
    let memory = Memory::<()>::default();
    let tree = Tree::new(&memory, 6);
    scan::scan(&tree, &mut &mesh, &frame).unwrap();
    sign::sign_all(&tree);
    let places = locate::leaves(&tree);
    assert_eq!(places.iter().map(|place| 1u64 << (3 * place.size)).sum::<u64>(), 1 << 18, "leaves fill the root");
    let key = |at: [u32; 3], size: u32| Key::cell(6 - size, at.map(|c| c >> size)).unwrap();
    let mut linear = LinearOctree::new();
    for (i, place) in places.iter().enumerate() {
        place.leaf.vertex.set(i as u32);
        linear.insert(key(place.at, place.size), i as u32);
    }
    let mut sum = 0;
    for place in &places {
        let leaf = key(place.at, place.size);
        let found = locate::locate(&tree, leaf.center().map(|c| c >> 13)).unwrap();
        assert_eq!(linear.locate(leaf.center()), Some((leaf, &found.vertex.get())));
        let mut pointed: Vec<u32> = Vec::new();
        locate::beside(&tree, place.at, place.size, &mut |leaf| pointed.push(leaf.vertex.get()));
        let mut keyed: Vec<u32> =
            Face::ALL.into_iter().flat_map(|face| linear.neighbours(leaf, face)).map(|(_, &i)| i).collect();
        pointed.sort_unstable();
        keyed.sort_unstable();
        assert_eq!(pointed, keyed);
        sum += keyed.iter().map(|&i| u64::from(i)).sum::<u64>();
    }
    assert_eq!(locate::sum_over_faces(&tree, |leaf| u64::from(leaf.vertex.get())), sum);
}

/// Handles as zmend and as the pointer octree find them: sizes from the smallest on, in square cells.
fn handles(name: &str, depth: u32) -> [Vec<f64>; 2] {
    let (mesh, frame) = input(name, depth);
    let (memory, records) = (TopoMemory::default(), Blocks::default());
    let tree = Tree::new(&memory, depth);
    scan::scan(&tree, &mut &mesh, &frame).unwrap();
    sign::sign_all(&tree);
    prepare(&tree);
    let before = span::euler(&tree);
    thin::thin(&tree, &records);
    assert_eq!(span::euler(&tree), before, "{name}: collapses keep the homotopy type");
    let found = span::handles(&tree);
    span::cut(&tree, &found);
    let after = span::euler(&tree);
    thin::thin(&tree, &records);
    assert!(span::handles(&tree).is_empty(), "{name}: nothing is left to cut");

    let octree = zmend::sign::parity_signs(crossings(&mesh, &frame));
    let edited = EditedOctree::unedited(octree.clone());
    assert_eq!(Betti::of(&edited).euler_number(), before, "{name}");
    let loops = Loops::find(&edited, Side::Object, f64::INFINITY, &Silent).unwrap();
    let cut = Repair { cut: Some(f64::INFINITY), ..Repair::default() };
    let (edited, report) = repair_topology(octree, &cut, &Silent).unwrap();
    assert_eq!((report.cuts.len(), Betti::of(&edited).euler_number()), (found.len(), after), "{name}");
    let sizes = |list: &mut dyn Iterator<Item = f64>| {
        let mut sizes: Vec<f64> = list.collect();
        sizes.sort_by(f64::total_cmp);
        sizes
    };
    [
        sizes(&mut loops.handles().iter().map(|handle| handle.squares as f64)),
        sizes(&mut found.iter().map(|handle| f64::from(handle.size))),
    ]
}

/// Large leaves are thinned whole on the pointer octree, so that its sections lie elsewhere by a cell or two: sizes of wide handles agree to
/// a fifth. Handles of a cell or two, beside which all leaves are small, are the same.
#[test]
fn handles_are_as_many_and_as_large() {
    for (name, depth) in [("torus", 6), ("knot", 6), ("part", 5), ("noisy", 6)] {
        let [zmend, pointer] = handles(name, depth);
        assert_eq!(zmend.len(), pointer.len(), "{name}");
        let narrow = |sizes: &[f64]| -> Vec<f64> { sizes.iter().copied().filter(|&size| size < 2.5).collect() };
        assert_eq!(narrow(&zmend), narrow(&pointer), "{name}");
        let sum = |sizes: &[f64]| sizes.iter().sum::<f64>();
        let ratio = sum(&pointer) / sum(&zmend);
        assert!((0.8..1.25).contains(&ratio), "{name}: {zmend:?} {pointer:?}");
    }
}

/// An entry for each element: the same solid, thinned to something with the same Euler number.
#[test]
fn maps_of_elements_thin_alike() {
    let (mesh, frame) = input("knot", 5);
    let memory = Memory::<()>::default();
    let tree = Tree::new(&memory, 5);
    scan::scan(&tree, &mut &mesh, &frame).unwrap();
    sign::sign_all(&tree);
    let octree = EditedOctree::unedited(zmend::sign::parity_signs(crossings(&mesh, &frame)));
    let elements = Complex::new(&octree, Side::Object).count();

    let (mut hash, mut ordered) = (hash_cells(), BTreeMap::new());
    element_map::fill(&tree, &mut hash);
    element_map::fill(&tree, &mut ordered);
    assert_eq!((hash.len(), ordered.len()), (elements as usize, elements as usize));
    let thinned = element_map::thin(&mut hash, 5);
    assert_eq!(element_map::thin(&mut ordered, 5), thinned);
    let left: Vec<Key> = ordered.iter().filter(|(_, removed)| **removed == 0).map(|(&key, _)| key).collect();
    assert_eq!(left.len() as u64 + thinned.removed, elements);
    assert!(left.iter().all(|&key| CellMap::get(&hash, key) == Some(&0)));
    // A ring of points and edges.
    let edges = left.iter().filter(|key| key.dir().dimension() == 1).count();
    assert_eq!(2 * edges, left.len());
}
