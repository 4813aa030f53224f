//! What can be chosen.

use crate::error::Result;
use crate::geom::{Cube, Frame};
use crate::mesh::Bounds;
use crate::sign::{Keep, Offset, Thicken};
use crate::topology;

/// How to repair: `Options { depth: 9, ..Options::default() }`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// log2 of the number of cells a side of the grid, 3 ..= 18. Each level more resolves half the size and costs four times as
    /// much. Default 8: 256 cells.
    pub depth: u32,
    /// Side of a cell in model units, kept to exactly, instead of `depth`: the cube grows until it is a power of two of cells wide.
    /// Default `None`.
    pub cell: Option<f64>,
    /// Part of the grid's side that the longest side of the model takes, above 0 and below 1; with `cell`, the most that it takes.
    /// Default 0.9.
    pub scale: f64,
    /// Where the grid lies, instead of `scale`: an input that does not fit inside is refused. With `cell` its least corner stays.
    /// Default `None`.
    pub cube: Option<Cube>,
    /// Which surface is extracted. Default [`Surface::MarchingCubes`].
    pub surface: Surface,
    /// What the faces are. Default [`Faces::Auto`].
    pub faces: Faces,
    /// Whether faces must not pass through each other: see [`Intersections`](crate::contour::Intersections). Marching cubes and blocks
    /// have no such faces in any case, whatever this says. Default false.
    pub no_self_intersections: bool,
    /// Bytes that the repair may hold, with what the sink holds but without the source: a repair that needs more is refused, with an
    /// estimate of what would do, at once or as soon as it is known. Default `None`: no limit.
    pub max_memory: Option<u64>,
    /// How inside is told from outside. Default [`Inside::Auto`].
    pub inside: Inside,
    /// With [`Inside::Hull`]: gaps between faces are closed up to this width, in model units. Default none.
    pub gap: Option<f64>,
    /// Faces that bound nothing get a wall of this width, in model units. Default none: they vanish.
    pub thicken: Option<f64>,
    /// Which faces get that wall. Default [`Thicken::Sheets`].
    pub thicken_what: Thicken,
    /// Another surface at a distance of this one: larger or smaller solids, or a shell round it. Default none.
    pub offset: Option<Offset>,
    /// Which solids stay. Default [`Keep::All`].
    pub keep: Keep,
    /// Whether cavities of solids are filled. Default no.
    pub drop_cavities: bool,
    /// Which handles are cut and which tunnels are filled, in the end: here, areas are in model units squared and volumes in model units
    /// cubed. Default: none.
    pub topology: topology::Options,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            depth: 8,
            cell: None,
            scale: 0.9,
            cube: None,
            inside: Inside::default(),
            surface: Surface::default(),
            faces: Faces::default(),
            no_self_intersections: false,
            max_memory: None,
            gap: None,
            thicken: None,
            thicken_what: Thicken::default(),
            offset: None,
            keep: Keep::default(),
            drop_cavities: false,
            topology: topology::Options::default(),
        }
    }
}

impl Options {
    /// The grid for an input with these bounds. An input without faces is as good as the unit cube: all checks of options apply.
    ///
    /// # Errors
    /// When an option is out of range, and when the input does not fit into the cube.
    pub fn frame(&self, bounds: &Bounds) -> Result<Frame> {
        let unit = Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::ONE };
        let model = &self.with_room(if bounds.is_empty() { &unit } else { bounds });
        let frame = match (self.cube, self.cell) {
            (None, None) => return Frame::fit(model, self.depth, self.scale),
            (None, Some(cell)) => return Frame::fit_cells(model, cell, self.scale),
            (Some(cube), None) => Frame::new(cube.min, cube.size, self.depth)?,
            (Some(cube), Some(cell)) => Frame::with_cells(cube, cell)?,
        };
        frame.check_holds(&if bounds.is_empty() { *bounds } else { *model }).map(|()| frame)
    }

    /// Bounds with room for walls, offsets, and for what closes gaps.
    fn with_room(&self, bounds: &Bounds) -> Bounds {
        let room = |width: Option<f64>| width.filter(|w| w.is_finite() && *w > 0.0).unwrap_or(0.0);
        let offset = room(self.offset.map(Offset::distance));
        let margin = (0.5 * room(self.thicken).max(room(self.gap))).max(offset);
        Bounds { min: bounds.min - margin, max: bounds.max + margin }
    }
}

/// The kinds of surfaces that can be extracted. All have the same topology.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Surface {
    /// Marching cubes: triangles, one point where the surface crosses an edge of the grid. After cuts or fills, which have no such edges,
    /// it is [`Surface::Quads`] in triangles, whose points lie next to those.
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
