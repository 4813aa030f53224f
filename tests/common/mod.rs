//! What the test binaries share: data, meshes, and checks that use nothing of the library but `Mesh`.
#![allow(dead_code, reason = "each test binary uses its own part")]

pub(crate) mod distance;
pub(crate) mod shapes;

use glam::{DMat3, DQuat, DVec3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use zmend::repair::Warning;
use zmend::{Faces, Mesh, Options, RepairReport, Repaired, Surface, io, repair};

/// The directory of real meshes beside the repository, if it is there.
pub(crate) fn data() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/meshes");
    if path.is_dir() {
        return Some(path);
    }
    println!("skipped: ../shared/data is not there");
    None
}

/// All files below a directory, sorted.
pub(crate) fn files(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).expect("a directory").map(|entry| entry.expect("an entry").path());
    let mut found: Vec<PathBuf> =
        entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect();
    found.sort();
    found
}

/// `directory/file`, as messages name a data file.
pub(crate) fn name(path: &Path) -> String {
    let parts: Vec<_> = path.iter().rev().take(2).map(|p| p.to_string_lossy()).collect();
    format!("{}/{}", parts[1], parts[0])
}

/// The ways to extract a surface, with their names; marching cubes come first.
pub(crate) fn surfaces(depth: u32) -> [(&'static str, Options); 7] {
    let disjoint = |options| Options { no_self_intersections: true, ..options };
    [
        ("mc", options(depth, Surface::MarchingCubes, Faces::Auto)),
        ("dc", options(depth, Surface::DualContouring, Faces::Auto)),
        ("quads", options(depth, Surface::Quads, Faces::Auto)),
        ("dc polygons", options(depth, Surface::DualContouring, Faces::Polygons)),
        ("blocks", options(depth, Surface::Blocks, Faces::Auto)),
        ("dc disjoint", disjoint(options(depth, Surface::DualContouring, Faces::Auto))),
        ("quads disjoint", disjoint(options(depth, Surface::Quads, Faces::Auto))),
    ]
}

pub(crate) fn options(depth: u32, surface: Surface, faces: Faces) -> Options {
    Options { depth, surface, faces, ..Options::default() }
}

pub(crate) fn mend(mesh: &Mesh, depth: u32, surface: Surface) -> Repaired {
    repair(mesh.clone(), &options(depth, surface, Faces::Auto)).expect("repairable")
}

/// What a closed surface is, counted here and not by the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Topology {
    pub(crate) components: u64,
    pub(crate) euler: i64,
}

impl Topology {
    pub(crate) const NOTHING: Topology = Topology { components: 0, euler: 0 };

    /// So many closed surfaces with so many handles in all.
    pub(crate) fn new(components: u64, genus: i64) -> Self {
        Topology { components, euler: 2 * components as i64 - 2 * genus }
    }

    pub(crate) fn genus(self) -> i64 {
        self.components as i64 - self.euler / 2
    }
}

/// Checks that a mesh is closed, manifold, oriented and encloses a positive volume, or is empty; by going round every point.
pub(crate) fn check(mesh: &Mesh) -> Result<Topology, String> {
    mesh.validate().map_err(|violation| format!("validate: {violation}"))?;
    own_check(mesh)
}

/// [`check`] without the library's opinion.
pub(crate) fn own_check(mesh: &Mesh) -> Result<Topology, String> {
    let topology = topology_of(mesh)?;
    let volume = volume(mesh);
    if !mesh.faces.is_empty() && volume <= 0.0 {
        return Err(format!("volume {volume} of {} faces", mesh.faces.len()));
    }
    Ok(topology)
}

/// Checks that a mesh is closed, manifold and oriented, one way or the other.
pub(crate) fn topology_of(mesh: &Mesh) -> Result<Topology, String> {
    if let Some(bad) = mesh.points.iter().find(|p| !p.is_finite()) {
        return Err(format!("point {bad}"));
    }
    // For each point, its corners: the point after it in the face, and the one before.
    let mut firsts = vec![0usize; mesh.points.len() + 1];
    mesh.faces.corners().iter().for_each(|&i| firsts[i as usize + 1] += 1);
    if let Some(point) = firsts[1..].iter().position(|&corners| corners == 0) {
        return Err(format!("point {point} is not used"));
    }
    (1..firsts.len()).for_each(|i| firsts[i] += firsts[i - 1]);
    let mut corners = vec![(0u32, 0u32); mesh.faces.corners().len()];
    let mut ends = firsts.clone();
    let mut sets = Sets::new(mesh.points.len());
    for face in mesh.faces.iter() {
        for (i, &at) in face.iter().enumerate() {
            let (after, before) = (face[(i + 1) % face.len()], face[(i + face.len() - 1) % face.len()]);
            corners[ends[at as usize]] = (after, before);
            ends[at as usize] += 1;
            sets.join(at as usize, after as usize);
        }
    }
    let around = |point: u32| &corners[firsts[point as usize]..firsts[point as usize + 1]];
    for point in 0..mesh.points.len() as u32 {
        let fan = around(point);
        for (i, corner) in fan.iter().enumerate() {
            if fan[..i].iter().any(|c| c.0 == corner.0) {
                return Err(format!("half edge {point}-{} is there twice", corner.0));
            }
            if around(corner.0).iter().all(|c| c.0 != point) {
                return Err(format!("half edge {point}-{} has no opposite", corner.0));
            }
        }
        // Going round the point from face to face must visit all of its corners.
        let (mut spoke, mut n) = (fan[0].1, 1);
        while spoke != fan[0].0 {
            spoke = fan.iter().find(|c| c.0 == spoke).ok_or_else(|| format!("point {point} has an open fan"))?.1;
            n += 1;
        }
        if n != fan.len() {
            return Err(format!("point {point} has {} corners, but a fan of {n}", fan.len()));
        }
    }
    let components = (0..mesh.points.len()).filter(|&i| sets.find(i) == i).count() as u64;
    let euler = mesh.points.len() as i64 - corners.len() as i64 / 2 + mesh.faces.len() as i64;
    Ok(Topology { components, euler })
}

/// [`check`], and that an empty result says why, and that the report agrees with the mesh.
pub(crate) fn check_repaired(repaired: &Repaired) -> Result<Topology, String> {
    check_with(repaired, check)
}

/// [`check_repaired`] with another check of the mesh itself.
pub(crate) fn check_with(
    repaired: &Repaired,
    check: impl Fn(&Mesh) -> Result<Topology, String>,
) -> Result<Topology, String> {
    let (mesh, report) = (&repaired.mesh, &repaired.report);
    let topology = check(mesh)?;
    check_warnings(mesh.faces.is_empty(), report)?;
    if (report.sizes.points, report.sizes.faces) != (mesh.points.len() as u64, mesh.faces.len() as u64) {
        return Err(format!("{:?} announced, but {} and {}", report.sizes, mesh.points.len(), mesh.faces.len()));
    }
    let whole = report.frame.size().powi(3);
    if !(0.0..whole).contains(&report.volume) || (mesh.faces.is_empty()) != (report.volume == 0.0) {
        return Err(format!("a volume of {} in a cube of {whole}", report.volume));
    }
    let (low, high) = (report.frame.origin(), report.frame.origin() + report.frame.size());
    match mesh.points.iter().find(|p| p.cmplt(low).any() || p.cmpgt(high).any()) {
        Some(p) => Err(format!("point {p} lies outside of the grid")),
        None => Ok(topology),
    }
}

/// Whether the report says why if the result is empty, and only then.
pub(crate) fn check_warnings(is_empty: bool, report: &RepairReport) -> Result<(), String> {
    let says_why = report.warnings.iter().any(|w| matches!(w, Warning::NoFaces | Warning::NothingEnclosed));
    if is_empty == says_why { Ok(()) } else { Err(format!("empty: {is_empty}, warnings: {:?}", report.warnings)) }
}

/// Whether the surface of the polygons is closed mod 2: after welding points that are equal, each edge has an even number of
/// users. Points that are not finite make it open.
pub(crate) fn is_closed_mod_2(mesh: &Mesh) -> bool {
    let mut places: HashMap<[u64; 3], u32> = HashMap::new();
    let welded: Vec<u32> = mesh
        .points
        .iter()
        .map(|p| {
            let next = places.len() as u32;
            // -0 and 0 are one place.
            *places.entry(p.to_array().map(|c| (c + 0.0).to_bits())).or_insert(next)
        })
        .collect();
    let mut edges: Vec<(u32, u32)> = Vec::new();
    for face in mesh.faces.iter().filter(|face| face.len() >= 3) {
        if face.iter().any(|&i| !mesh.points[i as usize].is_finite()) {
            return false;
        }
        for (i, &a) in face.iter().enumerate() {
            let (a, b) = (welded[a as usize], welded[face[(i + 1) % face.len()] as usize]);
            if a != b {
                edges.push((a.min(b), a.max(b)));
            }
        }
    }
    edges.sort_unstable();
    !edges.is_empty() && edges.chunk_by(|a, b| a == b).all(|same| same.len() % 2 == 0)
}

/// Every readable mesh of the data that is closed mod 2, with its name.
pub(crate) fn closed_meshes(data: &Path) -> Vec<(String, Mesh)> {
    let read = files(data).into_iter().filter_map(|path| Some((name(&path), io::read(&path).ok()?)));
    read.filter(|(_, mesh)| is_closed_mod_2(mesh)).collect()
}

/// Volume by the divergence theorem, relative to the first point.
pub(crate) fn volume(mesh: &Mesh) -> f64 {
    let Some(&origin) = mesh.points.first() else { return 0.0 };
    let at = |i: u32| mesh.points[i as usize] - origin;
    let of_face = |face: &[u32]| face.windows(2).map(|w| at(face[0]).cross(at(w[0])).dot(at(w[1]))).sum::<f64>() / 6.0;
    mesh.faces.iter().map(of_face).sum()
}

pub(crate) fn with_points(mesh: &Mesh, f: impl Fn(DVec3) -> DVec3) -> Mesh {
    Mesh { points: mesh.points.iter().map(|&p| f(p)).collect(), faces: mesh.faces.clone() }
}

pub(crate) fn with_faces<'a>(mesh: &Mesh, faces: impl IntoIterator<Item = &'a [u32]>) -> Mesh {
    Mesh { points: mesh.points.clone(), faces: faces.into_iter().collect() }
}

/// Several meshes as one.
pub(crate) fn together(parts: &[Mesh]) -> Mesh {
    let mut whole = Mesh::default();
    for part in parts {
        let first = whole.points.len() as u32;
        whole.points.extend_from_slice(&part.points);
        for face in part.faces.iter() {
            whole.faces.push(&face.iter().map(|i| i + first).collect::<Vec<u32>>());
        }
    }
    whole
}

/// Random numbers that are the same on every machine (splitmix64).
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// From 0 up to 1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    pub(crate) fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    pub(crate) fn rotation(&mut self) -> DMat3 {
        let mut signed = || 2.0 * self.unit() - 1.0;
        let q = DQuat::from_xyzw(signed(), signed(), signed(), signed());
        DMat3::from_quat(q.normalize())
    }

    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

/// Disjoint sets.
struct Sets(Vec<usize>);

impl Sets {
    fn new(n: usize) -> Self {
        Sets((0..n).collect())
    }

    fn find(&mut self, mut i: usize) -> usize {
        while self.0[i] != i {
            self.0[i] = self.0[self.0[i]];
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b)] = a.min(b);
    }
}
