//! zmend turns any bag of polygons into the surface of a solid: closed, manifold and oriented.
//!
//! A mesh from a scanner, a modeller or the web is often not the surface of anything: it has holes, faces that are turned over, doubled
//! or missing, sheets that nearly meet, walls that pass through each other. zmend lays a fine grid over it, notes where the faces cross
//! the grid's edges, closes what is open there, tells inside from outside, and extracts the surface between. The grid is a linear
//! octree: a hash map from packed 64-bit keys to bricks of 8 x 8 x 8 cells, with no pointers between them, so time and memory grow with
//! the surface and not with the volume.
//!
//! ```
//! use zmend::glam::DVec3;
//! use zmend::{Mesh, Options, repair};
//!
//! // A tetrahedron of which one face is missing and another one turned over.
//! let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
//! let soup: [&[u32]; 3] = [&[0, 2, 1], &[0, 1, 3], &[0, 2, 3]];
//! let broken = Mesh { points, faces: soup.into_iter().collect() };
//! assert!(broken.validate().is_err());
//!
//! let repaired = repair(broken, &Options { depth: 7, ..Options::default() })?;
//! assert_eq!(repaired.mesh.validate(), Ok(())); // closed, manifold, oriented
//! assert!((repaired.mesh.report().volume - 1.0 / 6.0).abs() < 0.01);
//! assert_eq!(repaired.report.warnings[0].to_string(), "the surface was open: a hole was closed");
//! # Ok::<(), zmend::Error>(())
//! ```
//!
//! # What it promises
//!
//! - Whatever goes in, what comes out is closed, manifold and oriented outward. It may be empty, and then a [`Warning`](repair::Warning)
//!   says why. ([`Mesh::validate`] checks this, and the tests do so all the time.)
//! - A closed surface is scanned without any gap, however it lies in the grid: on grid planes, edges or points. The arithmetic is exact.
//! - The same input and options give the same bytes, on one thread or many, today and tomorrow, with the same version.
//! - Malformed input gives an [`Error`] that names the place and the remedy, never a panic.
//! - No `unsafe` code.
//!
//! # What it does not promise
//!
//! - **The surface is made anew.** It lies within about a cell of the input, but it shares no vertices with it. What is thinner than a
//!   cell may vanish or grow together: take a greater [`depth`](Options::depth). ([`repair_keeping_good`] keeps whole components that are good
//!   or can be healed.)
//! - **Open sheets vanish.** A surface that encloses nothing, such as a lone rectangle, has no inside, unless it is
//!   [thickened](Options::thicken).
//! - **Unions ask for orientation.** Solids that overlap become their union, and holes are closed by a smooth surface, if faces are turned
//!   the same way. Where they are turned this way and that, inside is a matter of parity: what lies inside two solids counts as outside.
//!   (See [`Inside`].)
//! - **Faces of dual contouring may intersect**, here and there, mostly at creases and in walls thinner than a cell, unless
//!   [`no_self_intersections`](Options::no_self_intersections) is asked for. Those of marching cubes and blocks never do.
//!   [`Mesh::self_intersections`] finds them.
//! - **Sharp edges** are kept by dual contouring, but for edges nearer to each other than the diagonal of a cell; they have notches with
//!   [`no_self_intersections`](Options::no_self_intersections), and where the surface is made from an octree file.
//!
//! # Where to find what
//!
//! | module | what it does |
//! |---|---|
//! | [`repair`](mod@repair) | the pipeline: [`repair()`](repair::repair) in memory, [`repair_into`] from any source into any sink, [`repair_keeping_good`] only where it must be |
//! | [`mesh`] | [`Mesh`], reports and validation, neighbourhoods ([`Topology`](mesh::Topology)), features, local repairs ([`Mesh::heal`]), editing ([`Edit`](mesh::Edit)), self-intersections, distances between surfaces, sources and sinks of meshes that pass by, broken samples to try |
//! | [`io`] | meshes: STL, PLY, OBJ, OFF, glTF and 3MF; octrees: SOF, SOG and DCF; [volumes](io::volume): `MetaImage`, NRRD, `NIfTI`, VTI, VTK, SLC |
//! | [`sign`] | triangles to crossings, crossings without holes, inside and outside |
//! | [`topology`] | thin handles cut, narrow tunnels filled, Betti numbers |
//! | [`contour`] | marching cubes and manifold dual contouring; of volumes in [`contour::volume`] |
//! | [`volume`] | scalar fields on a lattice: arrays, functions, parts |
//! | [`field`] | level sets on adaptive octrees: of functions, solids, points; booleans, offsets, morphs; hexahedra around bodies |
//! | [`cloud`] | points: neighbours, planes, winding numbers, closed surfaces of them, ball pivoting, and points of meshes |
//! | [`octree`] | [`LinearOctree`](octree::LinearOctree) of anything: refined, balanced, searched; crossings and signs in bricks |
//! | [`grid`] | keys, axes, corners, bricks of bits, the 256 cases: integers only |
//! | [`geom`] | the frame of the grid, exact rasterisation, normals in 16 bits, quadratic error functions |
//! | `render` | shaded pictures; with the feature `render` |
//! | [`progress`], [`error`] | how long work tells where it is, and how it fails |
//!
//! Each stage of the pipeline is one function that can be called alone:
//!
//! ```
//! use zmend::geom::Frame;
//! use zmend::mesh::{Mesh, TriangleSource, sample};
//! use zmend::progress::Silent;
//! use zmend::{contour, sign};
//!
//! let mut soup = sample::build("knot-holes", 1)?;
//! let frame = Frame::fit(&soup.bounds()?, 6, 0.9)?;
//! let scan = sign::scan(&mut soup, &frame, false, &Silent)?;
//! let (crossings, closing) = sign::close(scan.crossings, &Silent)?;
//! let octree = sign::parity_signs(crossings);
//! let mut surface = Mesh::default();
//! contour::marching_cubes(&octree, &frame, &mut surface, &Silent)?;
//! assert!(closing.rings >= 7 && surface.report().is_closed());
//! # Ok::<(), zmend::Error>(())
//! ```
//!
//! # Features
//!
//! `cli` (on by default) builds the program `zmend` and brings its dependencies: libraries say `default-features = false`. `render`
//! (part of `cli`) adds the module `render` and the dependency `png`; `gltf` and `3mf` (parts of `cli`) add these formats, and the
//! dependencies `serde_json` for the one, `flate2` and `quick-xml` for the other, as does `volumes` (part of `cli`) for VTI files and packed data
//! in files of volumes. `serde` lets octrees be serialised.
#![forbid(unsafe_code)]

pub mod cloud;
pub mod contour;
pub mod error;
pub mod field;
pub mod geom;
pub mod grid;
pub mod io;
pub mod mesh;
pub mod octree;
mod parallel;
pub mod progress;
#[cfg(feature = "render")]
pub mod render;
pub mod repair;
mod sets;
pub mod sign;
pub mod topology;
pub mod volume;

pub use error::{Error, Place, Result};
/// The vectors of the public interface.
pub use glam;
pub use mesh::{Mesh, Polygons};
pub use repair::{
    Faces, Inside, Keep, Mended, Offset, Options, RepairReport, Repaired, Solid, Surface, Thicken, repair, repair_into,
    repair_keeping_good, solidify,
};

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct ReadmeDoctests;
