//! [`Key`]: one packed 64-bit name for every point, edge, face and cell of every level of an octree.
//!
//! The root cube has side 2^19 lattice units, so a coordinate, 0 ..= 2^19 with both boundaries included, fits 20 bits. An
//! element is named by the lattice coordinates of its CENTRE and its [`Extent`], the mask of the axes along which it extends:
//!
//! ```text
//! bit 63 | 62 61 60 | 59 58 57 | ... | 5  4  3 | 2  1  0
//!     0  |  x  y  z |  x  y  z | ... | x  y  z | x  y  z
//!        |  extent  | coordinate bits 19 ... 1 and 0, interleaved
//! ```
//!
//! # Levels
//!
//! Level and size need no field. A cell of level `l` has side `2^(19 - l)`; its centre is an odd multiple of half of that on
//! every axis, so the number `t` of trailing zeros of a centre coordinate is `18 - l`. For an edge or a face the same holds
//! on the axes along which it extends, while its other coordinates are multiples of its side. A point is any point of the
//! lattice and has no level. The finest cells are of level 18 with a side of 2, so that their centres are lattice points.
//!
//! # Arithmetic
//!
//! Interleaved coordinates are packed fields in another order. To add along one axis, set the bits of the other axes in one
//! operand so that carries ripple across them, add, and mask: three operations. Parent, child and ancestor are masks and
//! shifts, the elements around an element are additions of half its side. Nothing here allocates, searches or loops over
//! levels; every operation takes a few nanoseconds (`cargo bench --bench keys`).
//!
//! # Order
//!
//! Keys are ordered by their interleaved centres, the Z-order (Morton) curve with x slowest, and at equal centres by extent.
//! Cells that do not overlap therefore come in the order in which a depth-first walk over children 0 ..= 7 meets them.
//! Between a cell and its own descendants it is an in-order: the descendants in children 0 ..= 6 come before the cell, those
//! in child 7 after it. Sort by [`Key::depth_first_rank`] for the order in which parents come before their children.

use std::cmp::Ordering;
use std::fmt;
use std::iter::FusedIterator;

use super::axis::{Axis, Corner, Direction, Edge, Extent, Face};

/// Side of the root cube in lattice units, and the largest coordinate: 2^19.
pub const SIDE: u32 = 1 << 19;

/// Level of the finest cells, which have a side of 2 lattice units.
pub const MAX_LEVEL: u32 = 18;

/// Where the extent starts in a key, and how many bits the interleaved coordinates have.
const EXTENT_SHIFT: u32 = 60;
/// The interleaved coordinates.
const CODE: u64 = (1 << EXTENT_SHIFT) - 1;
/// The extent of a cell.
const CELL: u64 = (Extent::CELL.bits() as u64) << EXTENT_SHIFT;

/// The bits of each extent's axes among the interleaved coordinates.
const FIELDS: [u64; 8] = {
    let mut fields = [0; 8];
    let mut dir = 0;
    while dir < 8 {
        fields[dir] = CODE / 7 * dir as u64;
        dir += 1;
    }
    fields
};

/// The bits of one axis among the interleaved coordinates.
const fn field(axis: Axis) -> u64 {
    FIELDS[axis.bit() as usize]
}

/// Spreads the low 20 bits of `n` to bits 0, 3, 6, ..., 57. (No BMI2 needed: five shifts and masks.)
const fn spread(n: u32) -> u64 {
    let mut n = n as u64 & 0xf_ffff;
    n = (n | n << 32) & 0x000f_0000_0000_ffff;
    n = (n | n << 16) & 0x000f_0000_ff00_00ff;
    n = (n | n << 8) & 0x000f_00f0_0f00_f00f;
    n = (n | n << 4) & 0x00c3_0c30_c30c_30c3;
    (n | n << 2) & (CODE / 7)
}

/// Gathers bits 0, 3, 6, ..., 57 of `n`: the inverse of [`spread`]; other bits are ignored.
const fn compact(n: u64) -> u32 {
    let mut n = n & (CODE / 7);
    n = (n | n >> 2) & 0x00c3_0c30_c30c_30c3;
    n = (n | n >> 4) & 0x000f_00f0_0f00_f00f;
    n = (n | n >> 8) & 0x000f_0000_ff00_00ff;
    n = (n | n >> 16) & 0x000f_0000_0000_ffff;
    ((n | n >> 32) & 0xf_ffff) as u32
}

/// The interleaved form of lattice coordinates, each below 2^20: x in bits 2, 5, ..., y in bits 1, 4, ..., z in bits 0, 3, ...
///
/// ```
/// use zmend::grid::key::{deinterleave, interleave};
///
/// assert_eq!(interleave([1, 0, 3]), 0b001_101);
/// assert_eq!(deinterleave(0b001_101), [1, 0, 3]);
/// ```
pub const fn interleave([x, y, z]: [u32; 3]) -> u64 {
    spread(x) << 2 | spread(y) << 1 | spread(z)
}

/// The coordinates of an interleaved code; bits from 60 on are ignored.
pub const fn deinterleave(code: u64) -> [u32; 3] {
    [compact(code >> 2), compact(code >> 1), compact(code)]
}

/// The name of a point, edge, face or cell: its centre and its extent, packed. See the [module](self) for the layout.
///
/// A `Key` from a checked constructor is always the name of an element inside the root cube, boundary included. Arithmetic
/// states its domain; outside of it, debug builds panic and release builds give a key that [`is_valid`](Key::is_valid) refuses
/// or that names another element, but never undefined behaviour.
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
    pub const fn element(centre: [u32; 3], extent: Extent) -> Option<Key> {
        let [x, y, z] = centre;
        if x > SIDE || y > SIDE || z > SIDE {
            return None;
        }
        Key::from_bits(interleave(centre) | (extent.bits() as u64) << EXTENT_SHIFT)
    }

    /// The lattice point with these coordinates, or `None` if one is above 2^19.
    pub const fn point(coordinates: [u32; 3]) -> Option<Key> {
        Key::element(coordinates, Extent::POINT)
    }

    /// The key with these bits, or `None` if they do not name an element inside the root cube.
    pub const fn from_bits(bits: u64) -> Option<Key> {
        let key = Key(bits);
        if key.is_valid() { Some(key) } else { None }
    }

    /// The packed form, laid out as the [module](self) says.
    pub const fn to_bits(self) -> u64 {
        self.0
    }

    /// From the plain layout `R | Dir | X | Y | Z` (high to low) of the `TopoMender` program: `z` in bits
    /// 0 ..= 19, `y` in 20 ..= 39, `x` in 40 ..= 59, the extent mask (4 x, 2 y, 1 z; 0 for a point) in 60 ..= 62 and 0 in 63.
    ///
    /// The files hold bare positions (the ends of an edge, the centre of a cell), which become keys of points. What
    /// that program keeps in memory for an edge is another thing: the position of its START with the NUMBER of its axis in bits 60 and 61.
    ///
    /// `None` if there is no such element.
    pub const fn from_fields(fields: u64) -> Option<Key> {
        if fields >> 63 != 0 {
            return None;
        }
        let axis = 0xf_ffff;
        let centre = [(fields >> 40) as u32 & axis, (fields >> 20) as u32 & axis, fields as u32 & axis];
        Key::element(centre, Extent::ALL[(fields >> EXTENT_SHIFT) as usize])
    }

    /// To the plain layout read by [`from_fields`](Key::from_fields).
    pub const fn to_fields(self) -> u64 {
        let [x, y, z] = self.center();
        self.0 & !CODE | (x as u64) << 40 | (y as u64) << 20 | z as u64
    }

    /// Whether this names an element inside the root cube. Always true of keys made by checked constructors, and of what
    /// arithmetic makes of valid keys within its domain.
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
    pub const fn dir(self) -> Extent {
        Extent::ALL[(self.0 >> EXTENT_SHIFT) as usize & 7]
    }

    /// Whether it is a cell.
    pub const fn is_cell(self) -> bool {
        self.0 >> EXTENT_SHIFT == Extent::CELL.bits() as u64
    }

    /// Whether it is a point.
    pub const fn is_point(self) -> bool {
        self.0 >> EXTENT_SHIFT == 0
    }

    /// The level of the cells of which it is a part of full size, 0 for the root and 18 for the finest. `None` for a point.
    pub const fn level(self) -> Option<u32> {
        if self.is_point() { None } else { Some(MAX_LEVEL - self.trailing()) }
    }

    /// The side in lattice units: `2^(19 - level)`, 0 for a point.
    pub const fn size(self) -> u32 {
        if self.is_point() { 0 } else { 2 << self.trailing() }
    }

    /// The coordinates of the centre in lattice units.
    pub const fn center(self) -> [u32; 3] {
        deinterleave(self.0)
    }

    /// The smallest coordinates of the closed element in lattice units.
    pub const fn min_corner(self) -> [u32; 3] {
        deinterleave(self.min_code())
    }

    /// The largest coordinates of the closed element in lattice units.
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
    pub const fn code(self) -> u64 {
        self.0 & CODE
    }

    /// Trailing zeros of the centre on the extended axes: 18 - level. Not for points.
    const fn trailing(self) -> u32 {
        debug_assert!(!self.is_point(), "a point has no level");
        (self.0 & FIELDS[self.dir().index()]).trailing_zeros() / 3
    }

    /// The interleaved smallest corner: the centre without its lowest bit on the extended axes.
    const fn min_code(self) -> u64 {
        if self.is_point() {
            return self.code();
        }
        self.code() & !(FIELDS[self.dir().index()] & 7 << (3 * self.trailing()))
    }
}

/// The tree: parent, child, ancestor. All of these are for cells.
impl Key {
    /// The cell that was split to give this one, or `None` for the root. Domain: cells.
    pub const fn parent(self) -> Option<Key> {
        let low = self.lowest();
        if low == 1 << (3 * MAX_LEVEL) { None } else { Some(Key((self.0 & !(64 * low - 1)) | (56 * low))) }
    }

    /// The child at a corner. Domain: cells above level 18.
    #[must_use]
    pub const fn child(self, corner: Corner) -> Key {
        let low = self.lowest();
        debug_assert!(low > 1, "a cell of level 18 has no children");
        Key((self.0 & !(7 * low)) | (corner.bits() as u64 * low) | (7 * (low >> 3)))
    }

    /// The eight children by corner. Domain: cells above level 18.
    pub fn children(self) -> [Key; 8] {
        Corner::ALL.map(|corner| self.child(corner))
    }

    /// Which child of its parent this is. Domain: cells; the root gives corner 0.
    pub const fn corner_in_parent(self) -> Corner {
        Corner::ALL[(self.code() >> (3 * (self.trailing() + 1))) as usize & 7]
    }

    /// The cell of `level` that holds this one: itself at its own level. Domain: cells, and levels up to its own.
    #[must_use]
    pub const fn ancestor(self, level: u32) -> Key {
        debug_assert!(self.is_cell() && level <= MAX_LEVEL - self.trailing(), "an ancestor is not finer");
        Key::around(self.code(), level)
    }

    /// The cell of `level` that holds a lattice point of the half-open root, 0 ..= 2^19 - 1 on every axis. A cell holds its low
    /// faces but not its high ones.
    ///
    /// `None` if a coordinate is above 2^19 - 1 or the level above 18.
    pub const fn holding([x, y, z]: [u32; 3], level: u32) -> Option<Key> {
        if (x | y | z) >= SIDE || level > MAX_LEVEL {
            return None;
        }
        Some(Key::around(interleave([x, y, z]), level))
    }

    /// The cell of `level` around an interleaved point of the half-open root.
    pub(crate) const fn around(code: u64, level: u32) -> Key {
        let low = 1 << (3 * (MAX_LEVEL - level));
        Key(CELL | (code & !(8 * low - 1)) | (7 * low))
    }

    /// The interleaved lattice point of a cell, in the half-open sense, next to one of its corners. Domain: cells.
    pub(crate) const fn code_inside(self, corner: Corner) -> u64 {
        let below = 8 * self.lowest() - 1;
        self.min_code() | FIELDS[corner.bits() as usize] & below
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
    pub const fn common_ancestor(self, other: Key) -> Key {
        // Cells of level l agree with the cells inside them in every coordinate bit above bit t = 18 - l.
        let coarser = if self.trailing() > other.trailing() { self.trailing() } else { other.trailing() };
        let apart = (self.code() ^ other.code()) >> (3 * (coarser + 1));
        let t = coarser + (64 - apart.leading_zeros()).div_ceil(3);
        self.ancestor(MAX_LEVEL - t)
    }

    /// Whether this cell, its boundary included, holds the whole of `other`, which may be an element of any kind. A cell
    /// contains itself. Domain of `self`: cells.
    pub fn contains(self, other: Key) -> bool {
        if other.is_cell() {
            let low = self.lowest();
            return (self.0 ^ other.0) < 8 * low && other.lowest() <= low;
        }
        let (min, max) = (self.min_corner(), self.max_corner());
        let (lower, upper) = (other.min_corner(), other.max_corner());
        (0..3).all(|a| min[a] <= lower[a] && upper[a] <= max[a])
    }

    /// The rank of a cell in a depth-first walk over the whole octree that meets a cell before its children and children by
    /// corner: its smallest corner, then its level. Domain: cells.
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

/// Incidence and neighbours.
impl Key {
    /// The elements of one dimension less of which its boundary consists: for each axis of its extent, the two half its side
    /// below and above its centre. All have its level, unless they are points.
    ///
    /// In the order x low, x high, y low, ... A cell gives its six faces in the order of [`Face::ALL`], an edge its two ends, a
    /// point nothing.
    pub fn boundary(self) -> Incident {
        let half = if self.is_point() { 0 } else { 1 << (3 * self.trailing()) };
        let pairs = self.dir().axes().map(|axis| 0b11 << (2 * axis.index())).sum();
        Incident { key: self, half, faces: pairs }
    }

    /// The elements of its own level and of one dimension more in whose boundary it lies: for each axis not in its extent, the
    /// two half its side below and above its centre, of which those outside the root are left out.
    ///
    /// In the order x low, x high, y low, ... Domain: edges, faces and cells; a cell gives nothing. For a point say at which
    /// level: [`coboundary_at`](Key::coboundary_at).
    pub fn coboundary(self) -> Incident {
        debug_assert!(!self.is_point(), "a point needs a level: coboundary_at");
        self.coboundary_at(MAX_LEVEL - self.trailing())
    }

    /// As [`coboundary`](Key::coboundary), of elements of `level`: the up to six edges of that level around a point. Domain: the
    /// element's own level; for a point, the levels up to 18 with cells that have a corner there.
    pub fn coboundary_at(self, level: u32) -> Incident {
        debug_assert!(self.level().is_none_or(|own| own == level), "of its own level");
        let half = 1 << (3 * (MAX_LEVEL - level));
        debug_assert!(!self.is_point() || self.code() & (8 * half - 1) == 0, "level {level} has no corner at {self}");
        let sides = self.dir().complement().axes().map(|axis| {
            let at = self.0 & field(axis);
            (u32::from(at != 0) | u32::from(at != SIDE_CODE & field(axis)) << 1) << (2 * axis.index())
        });
        Incident { key: self, half, faces: sides.sum() }
    }

    /// The same element one side further across a face: the neighbour of the same size. `None` outside the root. Domain: cells, faces
    /// and edges; for a face or an edge, any of the six directions.
    pub const fn neighbour(self, across: Face) -> Option<Key> {
        let field = field(across.axis());
        let side = (across.axis().bit() as u64) << (3 * (self.trailing() + 1));
        if across.is_high() { self.plus(field, side) } else { self.minus(field, side) }
    }

    /// The neighbour of the same size in any of the 26 directions, `None` outside the root. Domain as [`neighbour`](Key::neighbour).
    pub fn toward(self, direction: Direction) -> Option<Key> {
        let faces = direction.moves().axes().map(|axis| Face::new(axis, direction.corner() & axis));
        faces.into_iter().try_fold(self, Key::neighbour)
    }

    /// The up to 26 neighbours of the same size inside the root, by increasing step in x, then y, then z. Domain as
    /// [`neighbour`](Key::neighbour).
    pub fn neighbours(self) -> impl Iterator<Item = Key> + Clone {
        Direction::ALL.into_iter().filter_map(move |direction| self.toward(direction))
    }

    /// The corner of a cell, a point. Domain: cells.
    #[must_use]
    pub const fn corner(self, corner: Corner) -> Key {
        let low = self.lowest();
        Key(raise(self.code() & !(7 * low), corner, 8 * low))
    }

    /// The eight corners of a cell, by number. Domain: cells.
    pub fn corners(self) -> [Key; 8] {
        Corner::ALL.map(|corner| self.corner(corner))
    }

    /// The face of a cell. Domain: cells.
    #[must_use]
    pub const fn face(self, face: Face) -> Key {
        self.half_toward(face, self.lowest())
    }

    /// The six faces of a cell, by number. Domain: cells.
    pub fn faces(self) -> [Key; 6] {
        Face::ALL.map(|face| self.face(face))
    }

    /// The edge of a cell. Domain: cells.
    #[must_use]
    pub const fn edge(self, edge: Edge) -> Key {
        let [a, b] = edge.faces();
        self.half_toward(a, self.lowest()).half_toward(b, self.lowest())
    }

    /// The twelve edges of a cell, by number. Domain: cells.
    pub fn edges(self) -> [Key; 12] {
        Edge::ALL.map(|edge| self.edge(edge))
    }

    /// The points at the corners of any element, by corner number: two of an edge, four of a face, eight of a cell, a point itself.
    pub fn points(self) -> impl Iterator<Item = Key> + Clone {
        let (min, dir) = (self.min_code(), self.dir().bits());
        let side = if self.is_point() { 0 } else { 8 << (3 * self.trailing()) };
        Corner::ALL.into_iter().filter(move |c| c.bits() & !dir == 0).map(move |c| Key(raise(min, c, side)))
    }

    /// Half a side further across `face`, `half` given as z bit, with that axis switched in the extent.
    const fn half_toward(self, face: Face, half: u64) -> Key {
        let bit = face.axis().bit() as u64;
        let field = field(face.axis());
        let moved = if face.is_high() { add(self.0, field, half * bit) } else { subtract(self.0, field, half * bit) };
        Key(moved ^ bit << EXTENT_SHIFT)
    }

    /// `distance` further along one field, unless that leaves the root.
    const fn plus(self, field: u64, distance: u64) -> Option<Key> {
        let moved = add(self.0, field, distance);
        let (from, to) = (self.0 & field, moved & field);
        if from < to && to <= SIDE_CODE & field { Some(Key(moved)) } else { None }
    }

    /// `distance` back along one field, unless that leaves the root.
    const fn minus(self, field: u64, distance: u64) -> Option<Key> {
        if self.0 & field < distance { None } else { Some(Key(subtract(self.0, field, distance))) }
    }
}

/// The coordinate 2^19 on all three axes, interleaved.
const SIDE_CODE: u64 = 7 << 57;

/// Adds to one interleaved field: the bits of the others are set, so that carries pass over them, and then restored.
const fn add(code: u64, field: u64, distance: u64) -> u64 {
    (code | !field).wrapping_add(distance) & field | code & !field
}

/// Subtracts from one interleaved field: the bits of the others are clear, so that borrows pass over them, and then restored.
const fn subtract(code: u64, field: u64, distance: u64) -> u64 {
    (code & field).wrapping_sub(distance) & field | code & !field
}

/// The code of a corner: the code of the smallest one, raised by a side, given as z bit, on the corner's high axes.
const fn raise(min: u64, corner: Corner, side: u64) -> u64 {
    let high = corner.bits() as u64;
    let x = add(min, field(Axis::X), (high & 4) * side);
    let y = add(min, field(Axis::Y), (high & 2) * side);
    let z = add(min, field(Axis::Z), (high & 1) * side);
    x & field(Axis::X) | y & field(Axis::Y) | z & field(Axis::Z)
}

/// The elements of [`Key::boundary`] or [`Key::coboundary`]; at most six, made as they are asked for.
#[derive(Debug, Clone)]
pub struct Incident {
    key: Key,
    /// Half a side, as z bit.
    half: u64,
    /// The faces still to be crossed, a bit each.
    faces: u32,
}

impl Iterator for Incident {
    type Item = Key;

    fn next(&mut self) -> Option<Key> {
        let face = Face::from_index(self.faces.trailing_zeros() as usize)?;
        self.faces &= self.faces - 1;
        Some(self.key.half_toward(face, self.half))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.faces.count_ones() as usize;
        (left, Some(left))
    }
}

impl ExactSizeIterator for Incident {}
impl FusedIterator for Incident {}

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
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn cell() -> impl Strategy<Value = Key> {
        (0..=MAX_LEVEL, [0..SIDE, 0..SIDE, 0..SIDE]).prop_map(|(l, p)| Key::holding(p, l).expect("inside the root"))
    }

    /// Any element but a point.
    fn sized() -> impl Strategy<Value = Key> {
        (cell(), 0..27usize).prop_map(|(cell, part)| part_of(cell, part))
    }

    fn element() -> impl Strategy<Value = Key> {
        let side = 0..=SIDE;
        let point = [side.clone(), side.clone(), side].prop_map(|p| Key::point(p).expect("inside the root"));
        prop_oneof![3 => sized(), 1 => point]
    }

    /// Parts of a cell: 12 edges, 6 faces, itself for anything else.
    fn part_of(cell: Key, part: usize) -> Key {
        match part {
            0..12 => cell.edge(Edge::ALL[part]),
            12..18 => cell.face(Face::ALL[part - 12]),
            _ => cell,
        }
    }

    fn cells_of(level: u32) -> impl Iterator<Item = Key> {
        let n = 1 << level;
        (0..n * n * n).map(move |i| Key::cell(level, [i / n / n, i / n % n, i % n]).expect("below 2^level"))
    }

    /// Every element of every kind and of levels up to 3, and the points that are their corners.
    fn small_elements() -> BTreeSet<Key> {
        (0..=3).flat_map(cells_of).flat_map(|c| (0..27).map(move |i| part_of(c, i)).chain(c.corners())).collect()
    }

    /// The elements of `level` and one dimension more around `element`, by looking at all of them.
    fn coboundary_oracle(element: Key, level: u32) -> BTreeSet<Key> {
        let candidates = cells_of(level).flat_map(|c| (0..27).map(move |i| part_of(c, i)));
        candidates.filter(|c| c.boundary().any(|b| b == element)).collect()
    }

    #[test]
    fn every_small_element_obeys_the_laws() {
        let elements = small_elements();
        // Levels 0 ..= 3 have n^3 cells, 3 n^2 (n + 1) faces, 3 n (n + 1)^2 edges; the points are those of level 3.
        let sum: usize =
            [1usize, 2, 4, 8].iter().map(|n| n.pow(3) + 3 * n * n * (n + 1) + 3 * n * (n + 1).pow(2)).sum();
        assert_eq!(elements.len(), sum + 9usize.pow(3));
        for &e in &elements {
            laws(e);
        }
    }

    #[test]
    fn coboundary_is_the_transpose_of_boundary() {
        for e in small_elements().into_iter().filter(|e| e.level().is_none_or(|l| l == 2)) {
            let level = e.level().unwrap_or(2);
            if e.is_point() && e.code().trailing_zeros() < 3 * 17 {
                continue; // no corner of level 2
            }
            assert_eq!(e.coboundary_at(level).collect::<BTreeSet<_>>(), coboundary_oracle(e, level), "{e}");
        }
    }

    /// What holds for any valid key.
    fn laws(e: Key) {
        assert!(e.is_valid(), "{e:?}");
        assert_eq!(Key::from_bits(e.to_bits()), Some(e));
        assert_eq!(Key::from_fields(e.to_fields()), Some(e));
        assert_eq!(Key::element(e.center(), e.dir()), Some(e));

        let (min, max, center) = (e.min_corner(), e.max_corner(), e.center());
        for axis in Axis::ALL {
            let i = axis.index();
            assert_eq!(max[i] - min[i], if e.dir().contains(axis) { e.size() } else { 0 });
            assert_eq!(min[i] + max[i], 2 * center[i]);
        }
        let points: Vec<Key> = e.points().collect();
        assert_eq!(points.iter().collect::<BTreeSet<_>>().len(), 1 << e.dir().dimension());
        assert_eq!((points[0].center(), points[points.len() - 1].center()), (min, max));
        assert!(points.iter().all(|p| p.is_valid() && p.is_point()));
        assert!(Key::ROOT.contains(e));

        let boundary: Vec<Key> = e.boundary().collect();
        assert_eq!(boundary.len(), 2 * e.dir().dimension() as usize);
        assert_eq!(e.boundary().len(), boundary.len());
        for b in &boundary {
            assert!(b.is_valid() && b.dir().dimension() + 1 == e.dir().dimension());
            assert!(b.is_point() || b.level() == e.level());
            assert!(b.coboundary_at(e.level().expect("not a point")).any(|c| c == e), "{b} in the boundary of {e}");
        }
        let mut twice: Vec<Key> = boundary.iter().flat_map(|b| b.boundary()).collect();
        twice.sort();
        assert!(twice.chunks(2).all(|pair| pair[0] == pair[1]), "boundary of boundary of {e} does not cancel");

        let Some(level) = e.level() else { return };
        assert_eq!((level, e.size()), (MAX_LEVEL + 1 - e.size().ilog2(), SIDE >> level));
        for c in e.coboundary() {
            assert!(c.is_valid() && c.level() == Some(level), "{c:?}");
            assert!(c.boundary().any(|b| b == e));
        }
        for face in Face::ALL {
            let i = face.axis().index();
            let expected = i64::from(center[i]) + if face.is_high() { 1 } else { -1 } * i64::from(e.size());
            let moved = e.neighbour(face);
            assert_eq!(moved.is_some(), (0..=i64::from(SIDE)).contains(&expected), "{e} {face}");
            if let Some(moved) = moved {
                let mut at = center;
                at[i] = expected as u32;
                assert_eq!(Key::element(at, e.dir()), Some(moved));
                assert_eq!(moved.neighbour(face.opposite()), Some(e));
            }
        }
        assert!(Direction::ALL.iter().all(|&d| e.toward(d).is_none_or(|n| n.toward(d.opposite()) == Some(e))));
        if e.is_cell() {
            cell_laws(e, level);
        }
    }

    fn cell_laws(cell: Key, level: u32) {
        let position = cell.min_corner().map(|x| x / cell.size());
        assert_eq!(Key::cell(level, position), Some(cell));
        assert_eq!(Key::holding(cell.min_corner(), level), Some(cell));
        assert_eq!(cell.parent().is_none(), level == 0);
        if let Some(parent) = cell.parent() {
            assert_eq!(parent.child(cell.corner_in_parent()), cell);
            assert_eq!(parent, cell.ancestor(level - 1));
            assert!(parent.contains(cell) && !cell.contains(parent));
        }
        assert_eq!((cell.ancestor(level), cell.ancestor(0)), (cell, Key::ROOT));
        if level < MAX_LEVEL {
            for (corner, child) in Corner::ALL.into_iter().zip(cell.children()) {
                assert!(child.is_valid() && cell.contains(child));
                assert_eq!((child.parent(), child.corner_in_parent()), (Some(cell), corner));
                assert_eq!(child.corner(corner), cell.corner(corner));
                assert_eq!(child.corner(!corner).center(), cell.center());
                assert_eq!(child < cell, corner != Corner::MAX);
                assert_eq!(Key::around(cell.code_inside(corner), level + 1), child);
            }
        }
        assert!(cell.points().eq(cell.corners()));
        assert!(cell.boundary().eq(cell.faces()));
        for edge in Edge::ALL {
            assert!(cell.edge(edge).points().eq(edge.corners().map(|c| cell.corner(c))));
        }
        for face in Face::ALL {
            let mut corners = face.corners();
            corners.sort();
            assert!(cell.face(face).points().eq(corners.map(|c| cell.corner(c))));
        }
        let neighbours: BTreeSet<Key> = cell.neighbours().collect();
        let inside = position.map(|i| 3 - u32::from(i == 0) - u32::from(i + 1 == 1 << level));
        assert_eq!(neighbours.len() as u32, inside.iter().product::<u32>() - 1);
        let touch = |n: &Key| cell.corners().iter().any(|p| n.corners().contains(p));
        assert!(!neighbours.contains(&cell) && neighbours.iter().all(touch));
    }

    proptest! {
        #[test]
        fn any_element_obeys_the_laws(e in element()) {
            laws(e);
        }

        #[test]
        fn interleaving_is_bit_by_bit(p in [0..1u32 << 20, 0..1u32 << 20, 0..1u32 << 20]) {
            let slow = (0..20).fold(0, |code, i| {
                let [x, y, z] = p.map(|c| u64::from(c >> i & 1));
                code | (4 * x + 2 * y + z) << (3 * i)
            });
            prop_assert_eq!(interleave(p), slow);
            prop_assert_eq!(deinterleave(slow), p);
        }

        #[test]
        fn dilated_sums_are_sums(p in [0..1u32 << 20, 0..1u32 << 20, 0..1u32 << 20], n in 0..1u32 << 20, a in 0..3usize) {
            let (axis, mut distance) = (Axis::ALL[a], [0; 3]);
            distance[a] = n;
            let (mut sum, mut difference) = (p, p);
            sum[a] = (p[a] + n) % (1 << 20);
            difference[a] = p[a].wrapping_sub(n) % (1 << 20);
            prop_assert_eq!(deinterleave(add(interleave(p), field(axis), interleave(distance))), sum);
            prop_assert_eq!(deinterleave(subtract(interleave(p), field(axis), interleave(distance))), difference);
        }

        #[test]
        fn any_bits_are_checked(bits: u64) {
            for key in [Key::from_bits(bits), Key::from_bits(bits & (CODE >> 3)), Key::from_fields(bits)].into_iter().flatten() {
                laws(key);
            }
        }

        #[test]
        fn cells_that_do_not_overlap_are_in_z_order(a in cell(), b in cell()) {
            prop_assert_eq!(a.cmp(&b).is_eq(), a == b);
            prop_assert_eq!(a.depth_first_rank() == b.depth_first_rank(), a == b);
            if !a.contains(b) && !b.contains(a) {
                let (p, q) = (interleave(a.min_corner()), interleave(b.min_corner()));
                prop_assert_eq!(a.cmp(&b), p.cmp(&q));
                prop_assert_eq!(a.depth_first_rank().cmp(&b.depth_first_rank()), p.cmp(&q));
            } else if a != b {
                prop_assert_eq!(a.depth_first_rank() < b.depth_first_rank(), a.contains(b));
            }
        }

        #[test]
        fn the_common_ancestor_is_the_smallest(a in cell(), level in 0..=MAX_LEVEL, d in [-3..=3i64, -3..=3i64, -3..=3i64]) {
            // Near one another, so that it is not always the root.
            let near = [0, 1, 2].map(|i| (i64::from(a.center()[i]) + d[i] * i64::from(a.size())).clamp(0, i64::from(SIDE) - 1) as u32);
            let b = Key::holding(near, level).expect("clamped");
            let c = a.common_ancestor(b);
            prop_assert_eq!(c, b.common_ancestor(a));
            prop_assert!(c.contains(a) && c.contains(b));
            if c != a && c != b {
                prop_assert!(c.children().iter().all(|child| !(child.contains(a) && child.contains(b))));
            }
        }

        #[test]
        fn containment_is_that_of_boxes(a in cell(), e in element(), near in any::<bool>()) {
            let a = if near { Key::holding(e.min_corner().map(|x| x.min(SIDE - 1)), a.level().expect("a cell")).expect("inside") } else { a };
            let boxes = (0..3).all(|i| a.min_corner()[i] <= e.min_corner()[i] && e.max_corner()[i] <= a.max_corner()[i]);
            prop_assert_eq!(a.contains(e), boxes);
        }
    }

    #[test]
    fn constructors_refuse_what_does_not_exist() {
        assert_eq!(Key::cell(0, [0; 3]), Some(Key::ROOT));
        assert_eq!(Key::cell(3, [8, 0, 0]), None);
        assert_eq!(Key::cell(19, [0; 3]), None);
        assert_eq!(Key::point([SIDE + 1, 0, 0]), None);
        assert_eq!(Key::point([u32::MAX; 3]), None);
        assert!(Key::point([SIDE; 3]).is_some());
        assert_eq!(Key::element([2, 2, 4], Extent::CELL), None); // axes of different levels
        assert_eq!(Key::element([1, 1, 0], Extent::from(Axis::X)), None); // x-edges of level 18 lie at even y
        assert!(Key::element([1, SIDE, 0], Extent::from(Axis::X)).is_some());
        assert_eq!(Key::element([SIDE, 0, 0], Extent::from(Axis::X)), None);
        assert_eq!(Key::element([0, 0, 0], Extent::CELL), None);
        assert_eq!(Key::from_bits(1 << 63), None);
        assert_eq!(Key::from_fields(1 << 63), None);
        assert_eq!(Key::holding([SIDE, 0, 0], 3), None);
        assert_eq!(Key::holding([0, 0, 0], 19), None);
    }

    #[test]
    fn the_layout_is_as_documented() {
        let point = Key::point([1, 2, 4]).expect("inside the root");
        assert_eq!(point.to_bits(), 0b001_010_100);
        assert_eq!(point.to_fields(), 1 << 40 | 2 << 20 | 4);
        let edge = Key::element([1, 2, 4], Extent::from(Axis::X)).expect("of level 18");
        assert_eq!(edge.to_bits(), 1 << 62 | 0b001_010_100);
        assert_eq!(edge.to_fields(), 1 << 62 | 1 << 40 | 2 << 20 | 4);
        assert_eq!(Key::ROOT.to_bits(), 7 << 60 | 7 << 54);
        assert_eq!(Key::ROOT.to_string(), "cell level 0 at 0,0,0");
        assert_eq!(edge.to_string(), "edge x level 18 at 0,2,4");
        assert_eq!(format!("{point:?} {:?}", Key(0)), "Key(point at 1,2,4) Key(point at 0,0,0)");
        assert_eq!(format!("{:?}", Key(7 << 60)), "Key(invalid 0x7000000000000000)");
    }
}
