//! What can be chosen.

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
    /// Whether faces must not pass through each other: see [`Intersections`](crate::contour::Intersections). Marching cubes and blocks
    /// have no such faces in any case, whatever this says. Default false.
    pub no_self_intersections: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            depth: 8,
            scale: 0.9,
            surface: Surface::default(),
            faces: Faces::default(),
            no_self_intersections: false,
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
    /// Squares of one cell, as if the solid were built of blocks.
    Blocks,
}

/// What the faces of a surface are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Faces {
    /// Polygons for [`Surface::Quads`] and [`Surface::Blocks`], triangles for the others.
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
