//! Others' opinions: what is written is read the same by other programs' readers, and rules of inside that have nothing in common but the scan
//! agree where they must. (Of real files tests/formats.rs asks the same readers; docs/guarantees.md lists all comparisons.)

use crate::common::{Chance, with_points};
use crate::is_same;
use zmend::glam::{DMat3, DVec3};
use zmend::io::{self, WriteOptions};
use zmend::mesh::sample;
use zmend::{Inside, Mesh, Options, Surface, repair};

/// Samples, as 32-bit numbers, which is what binary STL holds.
fn meshes() -> Vec<Mesh> {
    let single = |mesh: &Mesh| with_points(mesh, |p| p.as_vec3().as_dvec3());
    ["cube", "icosahedron", "plate", "torus"].map(|name| single(&sample::build(name, 1).expect("a sample"))).to_vec()
}

#[test]
fn stl_io_reads_what_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    for (mesh, is_text) in meshes().iter().flat_map(|mesh| [(mesh, false), (mesh, true)]) {
        let path = folder.path().join("a.stl");
        io::write(&path, mesh, WriteOptions { is_text, ..WriteOptions::default() }).expect("written");
        let mut file = std::fs::File::open(&path).expect("there");
        let theirs = stl_io::read_stl(&mut file).expect("readable by others");
        let ours = io::read(&path).expect("readable");
        assert_eq!(theirs.faces.len(), ours.faces.len());
        for (their_face, our_face) in theirs.faces.iter().zip(ours.faces.iter()) {
            let their_corners = their_face.vertices.map(|i| theirs.vertices[i].0);
            let our_corners: Vec<[f32; 3]> =
                our_face.iter().map(|&i| ours.points[i as usize].as_vec3().to_array()).collect();
            assert_eq!(our_corners, their_corners);
        }
    }
}

#[test]
fn ply_rs_reads_what_is_written() {
    use ply_rs_bw::ply::{DefaultElement, Property};
    let folder = tempfile::tempdir().expect("a folder");
    for (mesh, is_text) in meshes().iter().flat_map(|mesh| [(mesh, false), (mesh, true)]) {
        let path = folder.path().join("a.ply");
        io::write(&path, mesh, WriteOptions { is_text, ..WriteOptions::default() }).expect("written");
        let mut file = std::io::BufReader::new(std::fs::File::open(&path).expect("there"));
        let parser = ply_rs_bw::parser::Parser::<DefaultElement>::new();
        let theirs = parser.read_ply(&mut file).expect("readable by others");
        let number = |element: &DefaultElement, name: &str| match element[name] {
            Property::Float(x) => f64::from(x),
            Property::Double(x) => x,
            ref other => panic!("{other:?}"),
        };
        let points: Vec<DVec3> = theirs.payload["vertex"]
            .iter()
            .map(|element| DVec3::new(number(element, "x"), number(element, "y"), number(element, "z")))
            .collect();
        let faces: Vec<Vec<u32>> = theirs.payload["face"]
            .iter()
            .map(|element| match element.get("vertex_indices").or_else(|| element.get("vertex_index")) {
                Some(Property::ListInt(list)) => list.iter().map(|&i| i as u32).collect(),
                Some(Property::ListUInt(list)) => list.clone(),
                other => panic!("{other:?}"),
            })
            .collect();
        assert!(is_same(&Mesh { points, faces: faces.iter().map(Vec::as_slice).collect() }, mesh));
    }
}

/// Parity asks how many walls there are, winding numbers which way they are turned, and the hull what can be reached from outside: of a
/// clean solid, in any position and size, all say the same of every point, and the surface is the same bit by bit.
#[test]
fn all_rules_agree_on_clean_solids() {
    let mut chance = Chance(5);
    for round in 0..60 {
        let name = ["cube", "tetrahedron", "octahedron", "dodecahedron", "icosahedron", "zonohedron"][round % 6];
        // Every second one lies along the axes, where faces lie in planes of the grid.
        let turn = if round % 2 == 0 { chance.rotation() } else { DMat3::IDENTITY };
        let stretch = if round % 2 == 0 { 0.2 + chance.point() } else { DVec3::ONE };
        let scale = 10f64.powf(8.0 * chance.unit() - 4.0);
        let mesh = with_points(&sample::build(name, 1).expect("a sample"), |p| scale * (turn * (stretch * p)));
        let by = |inside| {
            let surface = [Surface::MarchingCubes, Surface::DualContouring, Surface::Blocks][round % 3];
            let options = Options { depth: 4 + round as u32 % 3, inside, surface, ..Options::default() };
            repair(mesh.clone(), &options).expect("repairable").mesh
        };
        let parity = by(Inside::Parity);
        assert!(!parity.faces.is_empty());
        for inside in [Inside::Winding, Inside::Hull, Inside::Auto] {
            assert!(is_same(&by(inside), &parity), "{name} by {inside:?} in round {round}");
        }
    }
}
