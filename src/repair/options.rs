//! What can be chosen.

use crate::sign::{Keep, Thicken};

/// How to repair: `Options { depth: 9, ..Options::default() }`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// log2 of the number of cells a side of the grid, 3 ..= 18. Each level more resolves half the size and costs four times as
    /// much. Default 8: 256 cells.
    pub depth: u32,
    /// Part of the grid's side that the longest side of the model takes, above 0 and below 1. Default 0.9.
    pub scale: f64,
    /// Which surface is extracted. Default [`Surface::MarchingCubes`].
    pub surface: Surface,
    /// What the faces are. Default [`Faces::Auto`].
    pub faces: Faces,
    /// How inside is told from outside. Default [`Inside::Auto`].
    pub inside: Inside,
    /// With [`Inside::Hull`]: gaps between faces are closed up to this width, in model units. Default none.
    pub gap: Option<f64>,
    /// Faces that bound nothing get a wall of this width, in model units. Default none: they vanish.
    pub thicken: Option<f64>,
    /// Which faces get that wall. Default [`Thicken::Sheets`].
    pub thicken_what: Thicken,
    /// Which solids stay. Default [`Keep::All`].
    pub keep: Keep,
    /// Whether cavities of solids are filled. Default no.
    pub drop_cavities: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            depth: 8,
            scale: 0.9,
            surface: Surface::default(),
            faces: Faces::default(),
            inside: Inside::default(),
            gap: None,
            thicken: None,
            thicken_what: Thicken::default(),
            keep: Keep::default(),
            drop_cavities: false,
        }
    }
}

/// The kinds of surfaces that can be extracted. All have the same topology.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Surface {
    /// Marching cubes: triangles, one point where the surface crosses an edge of the grid.
    #[default]
    MarchingCubes,
    /// Dual contouring: one point a cell, which keeps sharp edges and corners.
    DualContouring,
    /// Dual contouring with points at the mean of the crossings: smooth quadrilaterals, no sharp edges.
    Quads,
}

/// What the faces of a surface are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Faces {
    /// Polygons for [`Surface::Quads`], triangles for the others.
    #[default]
    Auto,
    /// Triangles; quadrilaterals of dual surfaces are cut along creases.
    Triangles,
    /// Quadrilaterals and a few triangles for dual surfaces. Marching cubes makes triangles in any case.
    Polygons,
}

impl Surface {
    /// Whether its points need the normals of the input.
    pub fn needs_normals(self) -> bool {
        self == Surface::DualContouring
    }
}

/// Rules of what is inside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Inside {
    /// Looks at the surface and takes one of the others; the [report](super::InsideChoice) says which and why.
    ///
    /// A surface that is closed, oriented and does not overlap itself gives the same by all rules, at the cost of parity. One that is
    /// closed and oriented but overlaps itself goes by winding number. So does an open one, if its faces are turned the same way and it is
    /// more than a sheet. Where orientation is not to be trusted, parity is taken.
    #[default]
    Auto,
    /// Inside is what an odd number of walls keeps from the outside, once holes are closed. Which way faces are turned makes no
    /// difference. The overlap of two solids is outside, and so is a shell within a shell.
    Parity,
    /// Inside is what the surface goes round, by the way its faces are turned: the union of solids that overlap or lie in each other,
    /// without walls in between; a cavity is one whose faces are turned to it. Holes are closed by a smooth surface, the generalised
    /// winding number of one half. See [`sign::winding`](crate::sign::winding).
    Winding,
    /// Inside is what cannot be reached from infinity without passing through a face, whichever way faces are turned: the outer shell of
    /// everything, without cavities. Holes and gaps let the outside in unless [`Options::gap`] closes them. See
    /// [`sign::hull`](crate::sign::hull()).
    Hull,
}
