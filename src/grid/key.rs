//! [`Key`]: one packed 64-bit name for every point, edge, face and cell of every level of an octree.
//!
//! The root cube has side 2^19 lattice units, so a coordinate, 0 ..= 2^19 with both boundaries included, fits 20 bits.
//! An element is named by the lattice coordinates of its CENTRE and its [`Extent`], the mask of the axes along which it
//! extends:
//!
//! ```text
//! bit 63 | 62 61 60 | 59 58 57 | ... | 5  4  3 | 2  1  0
//!     0  |  x  y  z |  x  y  z | ... | x  y  z | x  y  z
//!        |  extent  | coordinate bits 19 ... 1 and 0, interleaved
//! ```
//!
//! # Levels
//!
//! Level and size need no field. A cell of level `l` has side `2^(19 - l)`; its centre is an odd multiple of half of
//! that on every axis, so the number `t` of trailing zeros of a centre coordinate is `18 - l`. For an edge or a face
//! the same holds on the axes along which it extends, while its other coordinates are multiples of its side. A point is
//! any point of the lattice and has no level. The finest cells are of level 18 with a side of 2, so that their centres
//! are lattice points.
//!
//! # Arithmetic
//!
//! Interleaved coordinates are packed fields in another order. To add along one axis, set the bits of the other axes in
//! one operand so that carries ripple across them, add, and mask: three operations. Parent, child and ancestor are
//! masks and shifts, the elements around an element are additions of half its side. Nothing here allocates, searches or
//! loops over levels; every operation takes a few nanoseconds (`cargo bench --bench keys`).
//!
//! # Order
//!
//! Keys are ordered by their interleaved centres, the Z-order (Morton) curve with x slowest, and at equal centres by
//! extent. Cells that do not overlap therefore come in the order in which a depth-first walk over children 0 ..= 7
//! meets them. Between a cell and its own descendants it is an in-order: the descendants in children 0 ..= 6 come
//! before the cell, those in child 7 after it. Sort by [`Key::depth_first_rank`] for the order in which parents come
//! before their children.

mod block;
mod incidence;
mod morton;

use std::cmp::Ordering;
use std::fmt;

use super::axis::{Axis, Corner, Extent};
use morton::{CODE, FIELDS};

pub use incidence::Incident;
pub use morton::{deinterleave, interleave};

/// Side of the root cube in lattice units, and the largest coordinate: 2^19.
pub const SIDE: u32 = 1 << 19;

/// Level of the finest cells, which have a side of 2 lattice units.
pub const MAX_LEVEL: u32 = 18;

/// Where the extent starts in a key, and how many bits the interleaved coordinates have.
const EXTENT_SHIFT: u32 = 60;
/// The extent of a cell.
const CELL: u64 = (Extent::CELL.bits() as u64) << EXTENT_SHIFT;

/// The name of a point, edge, face or cell: its centre and its extent, packed. See the [module](self) for the layout.
///
/// A `Key` from a checked constructor is always the name of an element inside the root cube, boundary included.
/// Arithmetic states its domain; outside of it, debug builds panic and release builds give a key that
/// [`is_valid`](Key::is_valid) refuses or that names another element, but never undefined behaviour.
///
/// ```
/// use zmend::grid::{Axis, Corner, Face, Key};
///
/// let cell = Key::cell(3, [5, 0, 7]).unwrap();
/// assert_eq!((cell.level(), cell.size()), (Some(3), 65_536));
/// assert_eq!(cell.child(Corner::MAX).parent(), Some(cell));
/// assert_eq!(cell.neighbour(Face::new(Axis::X, true)), Key::cell(3, [6, 0, 7]));
/// assert_eq!(cell.neighbour(Face::new(Axis::Y, false)), None); // outside the root
/// assert_eq!(cell.boundary().count(), 6);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Key(u64);

/// Names from outside, checked.
impl Key {
    /// The root cell, level 0.
    pub const ROOT: Key = Key(CELL | 7 << (3 * MAX_LEVEL));

    /// The cell of `level` at integer position `[i, j, k]`, counted in cells of that level from the origin.
    ///
    /// `None` if the level is above 18 or a position not below `2^level`.
    #[inline]
    pub const fn cell(level: u32, [i, j, k]: [u32; 3]) -> Option<Key> {
        if level > MAX_LEVEL || (i | j | k) >> level != 0 {
            return None;
        }
        let t = MAX_LEVEL - level;
        Some(Key(CELL | interleave([i, j, k]) << (3 * (t + 1)) | 7 << (3 * t)))
    }

    /// The element with this centre, in lattice units, and this extent.
    ///
    /// `None` if no level has such an element inside the root cube.
    #[inline]
    pub const fn element(centre: [u32; 3], extent: Extent) -> Option<Key> {
        let [x, y, z] = centre;
        if x > SIDE || y > SIDE || z > SIDE {
            return None;
        }
        Key::from_bits(interleave(centre) | (extent.bits() as u64) << EXTENT_SHIFT)
    }

    /// The lattice point with these coordinates, or `None` if one is above 2^19.
    #[inline]
    pub const fn point(coordinates: [u32; 3]) -> Option<Key> {
        Key::element(coordinates, Extent::POINT)
    }

    /// The key with these bits, or `None` if they do not name an element inside the root cube.
    #[inline]
    pub const fn from_bits(bits: u64) -> Option<Key> {
        let key = Key(bits);
        if key.is_valid() { Some(key) } else { None }
    }

    /// The packed form, laid out as the [module](self) says.
    #[inline]
    pub const fn to_bits(self) -> u64 {
        self.0
    }

    /// From the plain layout `R | Dir | X | Y | Z` (high to low) of the `TopoMender` program: `z` in bits 0 ..= 19, `y`
    /// in 20 ..= 39, `x` in 40 ..= 59, the extent mask (4 x, 2 y, 1 z; 0 for a point) in 60 ..= 62 and 0 in 63.
    ///
    /// The files hold bare positions (the ends of an edge, the centre of a cell), which become keys of points. What
    /// that program keeps in memory for an edge is another thing: the position of its START with the NUMBER of its axis
    /// in bits 60 and 61.
    ///
    /// `None` if there is no such element.
    #[inline]
    pub const fn from_fields(fields: u64) -> Option<Key> {
        if fields >> 63 != 0 {
            return None;
        }
        let axis = 0xf_ffff;
        let centre = [(fields >> 40) as u32 & axis, (fields >> 20) as u32 & axis, fields as u32 & axis];
        Key::element(centre, Extent::ALL[(fields >> EXTENT_SHIFT) as usize])
    }

    /// To the plain layout read by [`from_fields`](Key::from_fields).
    #[inline]
    pub const fn to_fields(self) -> u64 {
        let [x, y, z] = self.center();
        self.0 & !CODE | (x as u64) << 40 | (y as u64) << 20 | z as u64
    }

    /// Whether this names an element inside the root cube. Always true of keys made by checked constructors, and of
    /// what arithmetic makes of valid keys within its domain.
    #[inline]
    pub const fn is_valid(self) -> bool {
        if self.0 >> 63 != 0 {
            return false;
        }
        let [x, y, z] = self.center();
        if x > SIDE || y > SIDE || z > SIDE {
            return false;
        }
        let extended = FIELDS[self.dir().index()];
        if extended == 0 {
            return true;
        }
        // On the extended axes bit t is the lowest that is set; on the others no bit up to t is.
        let t = (self.0 & extended).trailing_zeros() / 3;
        t <= MAX_LEVEL && self.0 & ((8 << (3 * t)) - 1) == extended & (7 << (3 * t))
    }
}

/// What a key says about its element.
impl Key {
    /// The axes along which the element extends.
    #[inline]
    pub const fn dir(self) -> Extent {
        Extent::ALL[(self.0 >> EXTENT_SHIFT) as usize & 7]
    }

    /// Whether it is a cell.
    #[inline]
    pub const fn is_cell(self) -> bool {
        self.0 >> EXTENT_SHIFT == Extent::CELL.bits() as u64
    }

    /// Whether it is a point.
    #[inline]
    pub const fn is_point(self) -> bool {
        self.0 >> EXTENT_SHIFT == 0
    }

    /// The level of the cells of which it is a part of full size, 0 for the root and 18 for the finest. `None` for a
    /// point.
    #[inline]
    pub const fn level(self) -> Option<u32> {
        if self.is_point() { None } else { Some(MAX_LEVEL - self.trailing()) }
    }

    /// The side in lattice units: `2^(19 - level)`, 0 for a point.
    #[inline]
    pub const fn size(self) -> u32 {
        if self.is_point() { 0 } else { 2 << self.trailing() }
    }

    /// The coordinates of the centre in lattice units.
    #[inline]
    pub const fn center(self) -> [u32; 3] {
        deinterleave(self.0)
    }

    /// The smallest coordinates of the closed element in lattice units.
    #[inline]
    pub const fn min_corner(self) -> [u32; 3] {
        deinterleave(self.min_code())
    }

    /// The largest coordinates of the closed element in lattice units.
    #[inline]
    pub const fn max_corner(self) -> [u32; 3] {
        let [x, y, z] = self.min_corner();
        let (dir, size) = (self.dir(), self.size());
        [
            x + size * dir.contains(Axis::X) as u32,
            y + size * dir.contains(Axis::Y) as u32,
            z + size * dir.contains(Axis::Z) as u32,
        ]
    }

    /// The interleaved centre, below 2^60.
    #[inline]
    pub const fn code(self) -> u64 {
        self.0 & CODE
    }

    /// Trailing zeros of the centre on the extended axes: 18 - level. Not for points.
    #[inline]
    const fn trailing(self) -> u32 {
        debug_assert!(!self.is_point(), "a point has no level");
        (self.0 & FIELDS[self.dir().index()]).trailing_zeros() / 3
    }

    /// The interleaved smallest corner: the centre without its lowest bit on the extended axes.
    #[inline]
    pub(crate) const fn min_code(self) -> u64 {
        if self.is_point() {
            return self.code();
        }
        self.code() & !(FIELDS[self.dir().index()] & 7 << (3 * self.trailing()))
    }
}

/// The tree: parent, child, ancestor. All of these are for cells.
impl Key {
    /// The cell that was split to give this one, or `None` for the root. Domain: cells.
    #[inline]
    pub const fn parent(self) -> Option<Key> {
        let low = self.lowest();
        if low == 1 << (3 * MAX_LEVEL) { None } else { Some(Key((self.0 & !(64 * low - 1)) | (56 * low))) }
    }

    /// The child at a corner. Domain: cells above level 18.
    #[must_use]
    #[inline]
    pub const fn child(self, corner: Corner) -> Key {
        let low = self.lowest();
        debug_assert!(low > 1, "a cell of level 18 has no children");
        Key((self.0 & !(7 * low)) | (corner.bits() as u64 * low) | (7 * (low >> 3)))
    }

    /// The eight children by corner. Domain: cells above level 18.
    #[inline]
    pub fn children(self) -> [Key; 8] {
        Corner::ALL.map(|corner| self.child(corner))
    }

    /// Which child of its parent this is. Domain: cells; the root gives corner 0.
    #[inline]
    pub const fn corner_in_parent(self) -> Corner {
        Corner::ALL[(self.code() >> (3 * (self.trailing() + 1))) as usize & 7]
    }

    /// The cell of `level` that holds this one: itself at its own level. Domain: cells, and levels up to its own.
    #[must_use]
    #[inline]
    pub const fn ancestor(self, level: u32) -> Key {
        debug_assert!(self.is_cell() && level <= MAX_LEVEL - self.trailing(), "an ancestor is not finer");
        Key::around(self.code(), level)
    }

    /// The cell of `level` that holds a lattice point of the half-open root, 0 ..= 2^19 - 1 on every axis. A cell holds
    /// its low faces but not its high ones.
    ///
    /// `None` if a coordinate is above 2^19 - 1 or the level above 18.
    #[inline]
    pub const fn holding([x, y, z]: [u32; 3], level: u32) -> Option<Key> {
        if (x | y | z) >= SIDE || level > MAX_LEVEL {
            return None;
        }
        Some(Key::around(interleave([x, y, z]), level))
    }

    /// The cell of `level` around an interleaved point of the half-open root.
    #[inline]
    pub(crate) const fn around(code: u64, level: u32) -> Key {
        let low = 1 << (3 * (MAX_LEVEL - level));
        Key(CELL | (code & !(8 * low - 1)) | (7 * low))
    }

    /// The interleaved lattice point of a cell, in the half-open sense, next to one of its corners. Domain: cells.
    #[inline]
    pub(crate) const fn code_inside(self, corner: Corner) -> u64 {
        let below = 8 * self.lowest() - 1;
        self.min_code() | FIELDS[corner.bits() as usize] & below
    }

    /// The element of a level with this extent whose least corner has the code `start`, which lies in the root and on the level's grid.
    #[inline]
    pub(crate) const fn starting_at(start: u64, extent: Extent, level: u32) -> Key {
        let half = 7 << (3 * (MAX_LEVEL - level));
        Key((extent.bits() as u64) << EXTENT_SHIFT | start | FIELDS[extent.bits() as usize] & half)
    }

    /// The smallest cell that holds both. Domain: cells.
    ///
    /// ```
    /// use zmend::grid::Key;
    ///
    /// let (a, b) = (Key::cell(9, [0, 0, 255]).unwrap(), Key::cell(4, [1, 0, 7]).unwrap());
    /// assert_eq!(a.common_ancestor(b), Key::cell(3, [0, 0, 3]).unwrap());
    /// assert_eq!(a.common_ancestor(a), a);
    /// ```
    #[must_use]
    #[inline]
    pub const fn common_ancestor(self, other: Key) -> Key {
        // Cells of level l agree with the cells inside them in every coordinate bit above bit t = 18 - l.
        let coarser = if self.trailing() > other.trailing() { self.trailing() } else { other.trailing() };
        let apart = (self.code() ^ other.code()) >> (3 * (coarser + 1));
        let t = coarser + (64 - apart.leading_zeros()).div_ceil(3);
        self.ancestor(MAX_LEVEL - t)
    }

    /// Whether this cell, its boundary included, holds the whole of `other`, which may be an element of any kind. A
    /// cell contains itself. Domain of `self`: cells.
    #[inline]
    pub fn contains(self, other: Key) -> bool {
        if other.is_cell() {
            let low = self.lowest();
            return (self.0 ^ other.0) < 8 * low && other.lowest() <= low;
        }
        let (min, max) = (self.min_corner(), self.max_corner());
        let (lower, upper) = (other.min_corner(), other.max_corner());
        (0..3).all(|a| min[a] <= lower[a] && upper[a] <= max[a])
    }

    /// The rank of a cell in a depth-first walk over the whole octree that meets a cell before its children and
    /// children by corner: its smallest corner, then its level. Domain: cells.
    ///
    /// ```
    /// use zmend::grid::{Corner, Key};
    ///
    /// let (first, last) = (Key::ROOT.child(Corner::MIN), Key::ROOT.child(Corner::MAX));
    /// let mut cells = [last, first, Key::ROOT];
    /// cells.sort_by_key(|k| k.depth_first_rank());
    /// assert_eq!(cells, [Key::ROOT, first, last]);
    /// cells.sort(); // the order of keys puts a cell before its last child, but after the first seven
    /// assert_eq!(cells, [first, Key::ROOT, last]);
    /// ```
    #[inline]
    pub const fn depth_first_rank(self) -> u64 {
        debug_assert!(self.is_cell(), "only cells have a place in the tree");
        self.min_code() << 5 | (MAX_LEVEL - self.trailing()) as u64
    }

    /// Bit `3t` of a cell: the lowest coordinate bit of its centre, as z bit.
    const fn lowest(self) -> u64 {
        debug_assert!(self.is_cell(), "only cells have parents and children");
        self.0 & self.0.wrapping_neg()
    }
}
/// Z-order of the centres, then extent. See the [module](self).
impl Ord for Key {
    fn cmp(&self, other: &Key) -> Ordering {
        self.0.rotate_left(4).cmp(&other.0.rotate_left(4))
    }
}

impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Key) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Kind, extent, level and the smallest corner in lattice units: `cell level 3 at 327680,0,458752`.
impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = ["point", "edge", "face", "cell"][self.dir().dimension() as usize];
        let [x, y, z] = self.min_corner();
        match self.level() {
            None => write!(f, "{kind} at {x},{y},{z}"),
            Some(level) if self.is_cell() => write!(f, "{kind} level {level} at {x},{y},{z}"),
            Some(level) => write!(f, "{kind} {} level {level} at {x},{y},{z}", self.dir()),
        }
    }
}

/// As [`Display`](fmt::Display), with the bits for keys that name nothing.
impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_valid() { write!(f, "Key({self})") } else { write!(f, "Key(invalid {:#018x})", self.0) }
    }
}
#[cfg(test)]
mod tests;
