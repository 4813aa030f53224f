//! Repair that keeps what is good: parts that are solids, or can be healed to be, stay triangle for triangle; all others are made
//! anew.
//!
//! # How
//!
//! The mesh is healed locally ([`Mesh::heal`]) and falls into parts that hang together. Those that are closed, manifold, oriented, meet
//! neither themselves nor others and fit into what they lie in are kept ([`Parts`](crate::mesh::parts::Parts)). The others go through the
//! octree together, on the grid that the whole would have. Where the new surface meets a part that was to be kept, or one lies in the other,
//! that part goes through the octree, too, and so on; after [`ROUNDS`] rounds everything does.
//!
//! # Invariants
//!
//! - The result is closed, manifold and oriented: kept parts are, by their choice, the rebuilt surface by construction, and they have no
//!   point in common.
//! - The rebuilt surface does not meet the kept parts; that it does not meet itself is up to the [surface](super::Options::surface)
//!   that was asked for.
//! - A mesh that is good as a whole comes back as [`Mesh::heal`] leaves it, bit for bit.
//!
//! # Why no less than a part is kept
//!
//! A seam between kept triangles and rebuilt ones has to join two rims. Where the surface is smooth and at least a few cells from any other,
//! both are single curves next to each other, and a band of triangles joins them. Where there is something to rebuild, neither is sure:
//! at self-intersections the kept side runs into the other sheet, at thin walls the octree has merged two sheets into one or none, and
//! then the rims differ in number. A band that is closed and manifold cannot be promised there, and that is what this library promises.
//!
//! # Cost
//!
//! That of healing, of the parts (1 µs a triangle on two threads), and of a repair of what is bad for each round. Input and
//! result are in memory, with 100 bytes a triangle beside them.

use super::{Options, RepairReport, repair_into};
use crate::error::{Error, Result};
use crate::mesh::parts::{Fate, Parts};
use crate::mesh::{Defects, HealOptions, HealStep, Healed, Mesh};
use crate::progress::{Progress, check};
use crate::sign::Keep;

/// Repairs before parts that are in the way are no longer told apart.
const ROUNDS: u32 = 4;

/// A repaired mesh, of which some is the input's own.
#[derive(Debug)]
pub struct Mended {
    /// Closed, manifold, oriented outward. Kept faces come first, in their order.
    pub mesh: Mesh,
    /// What was wrong with the input.
    pub before: Defects,
    /// What was wrong still after healing.
    pub healed: Defects,
    /// What healing did.
    pub steps: Vec<HealStep>,
    /// What was kept.
    pub kept: KeptParts,
    /// How the rest was repaired, if there was any.
    pub rebuilt: Option<RepairReport>,
}

/// What became of the parts of a healed mesh. All but the kept ones were rebuilt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct KeptParts {
    /// Parts in all: faces that hang together by points.
    pub parts: u64,
    /// Parts that were kept.
    pub kept: u64,
    /// Parts that were open, not manifold or not oriented, or had faces without area.
    pub defective: u64,
    /// Parts that met themselves or others.
    pub meeting: u64,
    /// Parts that lay in or around others that were not good or did not fit.
    pub nested: u64,
    /// Parts that were good but in the way of what was rebuilt.
    pub overrun: u64,
    /// Faces of the healed mesh.
    pub faces: u64,
    /// Faces that were kept.
    pub kept_faces: u64,
}

/// Repairs a mesh and keeps what is good, or can be healed locally, face for face.
///
/// The grid and the surface of what is rebuilt are those that `options` say.
///
/// ```
/// use zmend::mesh::{HealOptions, sample};
/// use zmend::progress::Silent;
/// use zmend::{Options, repair_keeping_good};
///
/// let ball = sample::build("sphere", 1)?;
/// let options = Options { depth: 6, ..Options::default() };
/// let mended = repair_keeping_good(&ball, &options, &HealOptions::default(), &Silent)?;
/// assert!(mended.mesh == ball && mended.rebuilt.is_none() && mended.kept.kept == 1);
/// # Ok::<(), zmend::Error>(())
/// ```
///
/// # Errors
/// When an option is out of range; when one asks for what would change kept parts, too (offset, walls, topology, which solids stay);
/// when the rest needs more memory than may be taken; and `Cancelled`.
pub fn repair_keeping_good(
    mesh: &Mesh,
    options: &Options,
    heal: &HealOptions,
    progress: &dyn Progress,
) -> Result<Mended> {
    refuse(options)?;
    options.frame(&mesh.report().bounds)?;
    let heal = HealOptions { check_intersections: true, ..*heal };
    let Healed { mesh: healed, before, after, steps } = mesh.heal(&heal, progress)?;
    check(progress)?;
    // Healing may have moved what was at no place, but not out of the box.
    let frame = options.frame(&healed.report().bounds)?;
    let options = Options { depth: frame.depth(), cell: None, cube: Some(frame.cube()), ..*options };
    let parts = healed.parts(0);
    let mut kept = KeptParts {
        parts: parts.fates.len() as u64,
        defective: parts.count(Fate::Defective),
        meeting: parts.count(Fate::Meets),
        nested: parts.count(Fate::Nested),
        faces: healed.faces.len() as u64,
        ..KeptParts::default()
    };
    let mut stays: Vec<bool> = parts.fates.iter().map(|&fate| fate == Fate::Good).collect();
    let is_kept = |stays: &[bool], face: usize| stays.get(parts.of_face[face] as usize) == Some(&true);
    let mut round = 0;
    loop {
        check(progress)?;
        kept.kept = stays.iter().filter(|&&stays| stays).count() as u64;
        if kept.kept == kept.parts && !parts.of_face.contains(&Parts::NONE) {
            kept.kept_faces = kept.faces;
            return Ok(Mended { mesh: healed, before, healed: after, steps, kept, rebuilt: None });
        }
        let mut bad = Mesh::default();
        append(&mut bad, &healed, |face| parts.of_face[face] != Parts::NONE && !is_kept(&stays, face));
        let mut good = Mesh::default();
        append(&mut good, &healed, |face| is_kept(&stays, face));
        let mut rebuilt = Mesh::default();
        let report = repair_into(&mut bad, &options, &mut rebuilt, progress)?;
        drop(bad);
        let spoilt = overrun(&rebuilt, &good);
        if !spoilt.contains(&true) {
            kept.kept_faces = good.faces.len() as u64;
            append(&mut good, &rebuilt, |_| true);
            debug_assert_eq!(good.validate(), Ok(()), "parts and surface are solids and have no point in common");
            return Ok(Mended { mesh: good, before, healed: after, steps, kept, rebuilt: Some(report) });
        }
        round += 1;
        let mut of_good = (0..healed.faces.len()).filter(|&face| is_kept(&stays, face)).zip(&spoilt);
        let gone: Vec<u32> = of_good.by_ref().filter(|(_, gone)| **gone).map(|(face, _)| parts.of_face[face]).collect();
        drop(of_good);
        gone.into_iter().for_each(|part| stays[part as usize] = false);
        if round == ROUNDS {
            stays.fill(false);
        }
        kept.overrun = (kept.parts - kept.defective - kept.meeting - kept.nested)
            - stays.iter().filter(|&&stays| stays).count() as u64;
    }
}

/// Which faces of kept parts cannot stay beside a rebuilt surface.
fn overrun(rebuilt: &Mesh, good: &Mesh) -> Vec<bool> {
    if good.faces.is_empty() {
        return Vec::new();
    }
    let mut both = rebuilt.clone();
    append(&mut both, good, |_| true);
    let first = rebuilt.faces.len();
    let parts = both.parts(first as u32);
    (first..both.faces.len()).map(|face| !parts.is_good(face)).collect()
}

/// Appends some faces of a mesh and the points that they use, in their order.
fn append(to: &mut Mesh, from: &Mesh, takes: impl Fn(usize) -> bool) {
    const UNUSED: u32 = u32::MAX;
    let mut numbers = vec![UNUSED; from.points.len()];
    for (face, corners) in from.faces.iter().enumerate() {
        if takes(face) {
            corners.iter().for_each(|&v| numbers[v as usize] = 0);
        }
    }
    for (number, point) in numbers.iter_mut().zip(&from.points).filter(|(number, _)| **number != UNUSED) {
        *number = to.points.len() as u32;
        to.points.push(*point);
    }
    let mut renamed = Vec::new();
    for (_, corners) in from.faces.iter().enumerate().filter(|&(face, _)| takes(face)) {
        renamed.clear();
        renamed.extend(corners.iter().map(|&v| numbers[v as usize]));
        to.faces.push(&renamed);
    }
}

/// Refuses what would have to change kept parts.
fn refuse(options: &Options) -> Result<()> {
    let wishes = [
        ("offset", options.offset.is_some()),
        ("thicken", options.thicken.is_some()),
        ("keep", options.keep != Keep::All),
        ("drop-cavities", options.drop_cavities),
        ("cut and fill", !options.topology.is_nothing()),
    ];
    match wishes.iter().find(|(_, is_asked)| *is_asked) {
        None => Ok(()),
        Some((option, _)) => {
            let remedy = "leave one of both away, or apply this to the result in a second run";
            Err(Error::setting(option, "it changes the whole surface, of which good parts are to be kept", remedy))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::sample;
    use crate::progress::Silent;
    use glam::DVec3;

    /// Adds a mesh, moved and scaled.
    fn add(all: &mut Mesh, name: &str, size: f64, at: DVec3) {
        let mut mesh = sample::build(name, 1).unwrap();
        mesh.points.iter_mut().for_each(|p| *p = size * *p + at);
        append(all, &mesh, |_| true);
    }

    fn mended(mesh: &Mesh) -> Mended {
        let options = Options { depth: 6, ..Options::default() };
        // Holes are left to the octree.
        let heal = HealOptions { max_hole_edges: 0, ..HealOptions::default() };
        let mended = repair_keeping_good(mesh, &options, &heal, &Silent).unwrap();
        assert_eq!(mended.mesh.validate(), Ok(()));
        assert!(!mended.mesh.has_self_intersections());
        mended
    }

    #[test]
    fn good_parts_stay_and_others_are_rebuilt() {
        let mut mesh = Mesh::default();
        add(&mut mesh, "torus", 1.0, DVec3::ZERO);
        add(&mut mesh, "knot-holes", 1.0, 8.0 * DVec3::X);
        add(&mut mesh, "cube", 1.0, 8.0 * DVec3::Y);
        add(&mut mesh, "sphere", 1.0, DVec3::new(8.0, 8.0, 0.0));
        add(&mut mesh, "sphere", 1.0, DVec3::new(9.0, 8.0, 0.0));
        let result = mended(&mesh);
        let KeptParts { parts, kept, defective, meeting, kept_faces, overrun, .. } = result.kept;
        assert_eq!((parts, kept, defective, meeting, overrun), (5, 2, 1, 2, 0));
        // Point for point and face for face, quadrilaterals and all.
        let mut good = Mesh::default();
        add(&mut good, "torus", 1.0, DVec3::ZERO);
        add(&mut good, "cube", 1.0, 8.0 * DVec3::Y);
        assert_eq!(kept_faces, good.faces.len() as u64);
        assert_eq!(result.mesh.points[..good.points.len()], good.points);
        assert!(result.mesh.faces.iter().zip(good.faces.iter()).all(|(a, b)| a == b));
        // Two balls that overlap have become one.
        let report = result.mesh.report();
        assert_eq!((report.components, result.healed.holes), (4, 7));
        assert!(result.rebuilt.is_some_and(|report| report.sizes.faces + kept_faces == result.mesh.faces.len() as u64));
    }

    #[test]
    fn what_is_in_the_way_of_the_rebuilt_surface_is_rebuilt() {
        // A ball in the mouth of an open one, which is closed right through it.
        let mut mesh = Mesh::default();
        add(&mut mesh, "sphere", 4.0, DVec3::ZERO);
        let cap = |f: &&[u32]| f.iter().all(|&v| mesh.points[v as usize].z < 3.0);
        mesh.faces = mesh.faces.iter().filter(cap).collect();
        add(&mut mesh, "sphere", 0.4, 3.0 * DVec3::Z);
        add(&mut mesh, "cube", 1.0, 8.0 * DVec3::X);
        let result = mended(&mesh);
        assert_eq!((result.kept.parts, result.kept.kept, result.kept.overrun), (3, 1, 1));
        assert_eq!(result.kept.kept_faces, 6);
        // A ball deep in it would be a cavity, or nothing: that is for the rule of what is inside.
        mesh.points.iter_mut().filter(|p| p.distance(3.0 * DVec3::Z) < 0.5).for_each(|p| p.z -= 3.0);
        assert_eq!(mended(&mesh).kept.overrun, 1);
    }

    #[test]
    fn what_is_good_as_a_whole_is_not_touched() {
        for name in ["cube", "nested", "knot", "part"] {
            let mesh = sample::build(name, 1).unwrap();
            let result = mended(&mesh);
            assert!(result.rebuilt.is_none() && result.mesh == mesh, "{name}: {:?}", result.kept);
        }
        let nothing = mended(&Mesh::default());
        assert!(nothing.mesh.faces.is_empty() && nothing.kept == KeptParts::default());
    }

    #[test]
    fn what_would_change_kept_parts_is_refused() {
        let cube = sample::build("cube", 1).unwrap();
        let options = Options { drop_cavities: true, ..Options::default() };
        let error = repair_keeping_good(&cube, &options, &HealOptions::default(), &Silent).unwrap_err().to_string();
        assert!(error.contains("drop-cavities") && error.contains("second run"), "{error}");
    }
}
