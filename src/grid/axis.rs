//! The parts of a cell and the directions around it: [`Axis`], [`Extent`], [`Corner`], [`Edge`], [`Face`],
//! [`Direction`].
//!
//! Everything follows from one numbering. A corner is a three-bit mask `4x + 2y + z` of the axes on whose high side it
//! lies, an extent is the mask of the axes along which an element stretches, and both use the same bit for the same
//! axis. An edge is its axis and its low corner without that axis's bit, a face its axis and its side. No table is
//! typed in.
//!
//! ```
//! use zmend::grid::{Axis, Corner, Edge, Face};
//!
//! let edge = Edge::ALL[6]; // the y-edge from corner 4 to corner 6
//! assert_eq!(edge.axis(), Axis::Y);
//! assert_eq!(edge.corners(), [Corner::ALL[4], Corner::ALL[6]]);
//! assert_eq!(edge.faces(), [Face::new(Axis::X, true), Face::new(Axis::Z, false)]);
//! assert_eq!(Corner::ALL[4] ^ Axis::Y, Corner::ALL[6]);
//! ```

mod direction;

use std::fmt;
use std::ops::{BitAnd, BitOr, BitXor, Not, Sub};

pub use direction::Direction;

/// One of the three axes, in the order x, y, z.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Axis {
    /// The slowest axis of the child order, bit 4 of masks.
    X,
    /// The middle axis, bit 2 of masks.
    Y,
    /// The fastest axis of the child order, bit 1 of masks.
    Z,
}

impl Axis {
    /// All three, in order.
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    /// 0, 1, 2 for x, y, z: the place of this axis in a `[_; 3]` of coordinates.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The axis's bit in masks: 4, 2, 1 for x, y, z.
    pub const fn bit(self) -> u8 {
        4 >> self as u8
    }

    /// The next axis of the cycle x, y, z, x. `(a, a.next(), a.next().next())` is always right-handed.
    #[must_use]
    pub const fn next(self) -> Axis {
        Axis::ALL[(self as usize + 1) % 3]
    }

    /// The two other axes `u`, `v` in cyclic order, such that `self = u x v`.
    pub const fn others(self) -> [Axis; 2] {
        [self.next(), self.next().next()]
    }

    /// The axis of a mask bit, by its trailing zeros.
    const fn of_bit(mask: u8) -> Axis {
        Axis::ALL[2 - mask.trailing_zeros() as usize]
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(["x", "y", "z"][self.index()])
    }
}

/// `x | y`: the extent along both axes.
impl BitOr for Axis {
    type Output = Extent;
    fn bitor(self, other: Axis) -> Extent {
        Extent::from(self) | other
    }
}

/// The axes along which an element extends: none for a point, one for an edge, two for a face, three for a cell.
///
/// Also used as a plain set of axes. Bits as in [`Axis::bit`].
///
/// ```
/// use zmend::grid::{Axis, Extent};
///
/// let face = Axis::X | Axis::Z;
/// assert_eq!((face.bits(), face.dimension()), (0b101, 2));
/// assert_eq!(face - Axis::X, Extent::from(Axis::Z));
/// assert_eq!((!face).to_string(), "y");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Extent(u8);

impl Extent {
    /// No axis: a point.
    pub const POINT: Extent = Extent(0);
    /// All three axes: a cell.
    pub const CELL: Extent = Extent(7);
    /// All eight, by their bits.
    pub const ALL: [Extent; 8] = {
        let mut all = [Extent(0); 8];
        let mut i = 0;
        while i < 8 {
            all[i] = Extent(i as u8);
            i += 1;
        }
        all
    };

    /// The extent with these bits, or `None` above 7.
    pub const fn from_bits(bits: u8) -> Option<Extent> {
        if bits < 8 { Some(Extent(bits)) } else { None }
    }

    /// The mask, 0 ..= 7.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The mask as an index into tables of eight.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// 0 for a point, 1 for an edge, 2 for a face, 3 for a cell.
    pub const fn dimension(self) -> u32 {
        self.0.count_ones()
    }

    /// Whether the element extends along `axis`.
    pub const fn contains(self, axis: Axis) -> bool {
        self.0 & axis.bit() != 0
    }

    /// With `axis` added.
    #[must_use]
    pub const fn with(self, axis: Axis) -> Extent {
        Extent(self.0 | axis.bit())
    }

    /// With `axis` removed.
    #[must_use]
    pub const fn without(self, axis: Axis) -> Extent {
        Extent(self.0 & !axis.bit())
    }

    /// The axes not in it.
    #[must_use]
    pub const fn complement(self) -> Extent {
        Extent(self.0 ^ 7)
    }

    /// Its axes, in order.
    pub fn axes(self) -> impl Iterator<Item = Axis> + Clone {
        Axis::ALL.into_iter().filter(move |&a| self.contains(a))
    }
}

impl From<Axis> for Extent {
    fn from(axis: Axis) -> Extent {
        Extent(axis.bit())
    }
}

/// With an axis added.
impl BitOr<Axis> for Extent {
    type Output = Extent;
    fn bitor(self, axis: Axis) -> Extent {
        self.with(axis)
    }
}

/// With an axis removed.
impl Sub<Axis> for Extent {
    type Output = Extent;
    fn sub(self, axis: Axis) -> Extent {
        self.without(axis)
    }
}

/// The axes not in it.
impl Not for Extent {
    type Output = Extent;
    fn not(self) -> Extent {
        self.complement()
    }
}

/// `point`, or the axes: `x`, `yz`, `xyz`.
impl fmt::Display for Extent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(["point", "z", "y", "yz", "x", "xz", "xy", "xyz"][self.index()])
    }
}

/// Gives a newtype over `u8` with `N` values its `ALL`, `from_index` and `index`.
macro_rules! numbered {
    ($name:ident, $n:literal) => {
        impl $name {
            #[doc = concat!("All ", $n, ", in order of their index.")]
            pub const ALL: [$name; $n] = {
                let mut all = [$name(0); $n];
                let mut i = 0;
                while i < $n {
                    all[i] = $name(i as u8);
                    i += 1;
                }
                all
            };

            #[doc = concat!("The one with this index, or `None` from ", $n, " on.")]
            pub const fn from_index(index: usize) -> Option<$name> {
                if index < $n { Some($name(index as u8)) } else { None }
            }

            #[doc = concat!("Its number, below ", $n, ".")]
            pub const fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

/// A corner of a cell, or the child of a cell at that corner: number `4x + 2y + z`, each 0 on the low side, 1 on the
/// high.
///
/// ```
/// use zmend::grid::{Axis, Corner};
///
/// let c = Corner::MIN | Axis::X; // corner 4
/// assert!(c & Axis::X && !(c & Axis::Z));
/// assert_eq!(c ^ Axis::Z, Corner::ALL[5]);
/// assert_eq!(!c, Corner::ALL[3]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Corner(u8);

numbered!(Corner, 8);

impl Corner {
    /// The corner with the smallest coordinates, number 0.
    pub const MIN: Corner = Corner(0);
    /// The corner with the largest coordinates, number 7.
    pub const MAX: Corner = Corner(7);

    /// Its number as a mask of the axes on whose high side it lies, 0 ..= 7.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Whether it lies on the high side of `axis`.
    pub const fn is_high(self, axis: Axis) -> bool {
        self.0 & axis.bit() != 0
    }

    /// The corner at the other end of its edge along `axis`.
    #[must_use]
    pub const fn across(self, axis: Axis) -> Corner {
        Corner(self.0 ^ axis.bit())
    }

    /// The corner at the high end of its edge along `axis`: itself if it is there already.
    #[must_use]
    pub const fn high(self, axis: Axis) -> Corner {
        Corner(self.0 | axis.bit())
    }

    /// The corner at the low end of its edge along `axis`: itself if it is there already.
    #[must_use]
    pub const fn low(self, axis: Axis) -> Corner {
        Corner(self.0 & !axis.bit())
    }

    /// The corner at the other end of the cell's diagonal.
    #[must_use]
    pub const fn opposite(self) -> Corner {
        Corner(self.0 ^ 7)
    }

    /// Its three edges, along x, y, z.
    pub const fn edges(self) -> [Edge; 3] {
        [Edge::at(Axis::X, self), Edge::at(Axis::Y, self), Edge::at(Axis::Z, self)]
    }

    /// Its three faces, across x, y, z.
    pub const fn faces(self) -> [Face; 3] {
        [
            Face::new(Axis::X, self.is_high(Axis::X)),
            Face::new(Axis::Y, self.is_high(Axis::Y)),
            Face::new(Axis::Z, self.is_high(Axis::Z)),
        ]
    }
}

/// The corner at the high end along an axis.
impl BitOr<Axis> for Corner {
    type Output = Corner;
    fn bitor(self, axis: Axis) -> Corner {
        self.high(axis)
    }
}

/// Whether the corner lies on the high side of an axis.
impl BitAnd<Axis> for Corner {
    type Output = bool;
    fn bitand(self, axis: Axis) -> bool {
        self.is_high(axis)
    }
}

/// The corner at the other end along an axis.
impl BitXor<Axis> for Corner {
    type Output = Corner;
    fn bitxor(self, axis: Axis) -> Corner {
        self.across(axis)
    }
}

/// The opposite corner.
impl Not for Corner {
    type Output = Corner;
    fn not(self) -> Corner {
        self.opposite()
    }
}

impl fmt::Display for Corner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "corner {}", self.0)
    }
}

/// An edge of a cell, numbered by axis and then by its low corner.
///
/// | axis | numbers | from corner to corner |
/// |------|---------|-----------------------|
/// | x    | 0 ..= 3   | 0-4, 1-5, 2-6, 3-7 |
/// | y    | 4 ..= 7   | 0-2, 1-3, 4-6, 5-7 |
/// | z    | 8 ..= 11  | 0-1, 2-3, 4-5, 6-7 |
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Edge(u8);

numbered!(Edge, 12);

impl Edge {
    /// The edge along `axis` that ends at `corner`.
    pub const fn at(axis: Axis, corner: Corner) -> Edge {
        // Take the axis's bit out of the corner and close the gap.
        let below = axis.bit() - 1;
        let rank = ((corner.0 >> 1) & !below) | (corner.0 & below);
        Edge(4 * axis as u8 + (rank & 3))
    }

    /// The edge between two corners, or `None` if they differ along no axis or along several.
    pub const fn between(a: Corner, b: Corner) -> Option<Edge> {
        let apart = a.0 ^ b.0;
        if apart.is_power_of_two() { Some(Edge::at(Axis::of_bit(apart), a)) } else { None }
    }

    /// The axis it runs along.
    pub const fn axis(self) -> Axis {
        Axis::ALL[(self.0 / 4) as usize]
    }

    /// Its low and its high corner.
    pub const fn corners(self) -> [Corner; 2] {
        // Open a gap for the axis's bit in the rank.
        let rank = self.0 % 4;
        let bit = self.axis().bit();
        let below = bit - 1;
        let low = ((rank & !below) << 1) | (rank & below);
        [Corner(low), Corner(low | bit)]
    }

    /// The two faces that meet in it, by increasing axis.
    pub const fn faces(self) -> [Face; 2] {
        let [x, y, z] = self.corners()[0].faces();
        match self.axis() {
            Axis::X => [y, z],
            Axis::Y => [x, z],
            Axis::Z => [x, y],
        }
    }

    /// The parallel edge on the other side of the cell.
    #[must_use]
    pub const fn opposite(self) -> Edge {
        Edge(self.0 ^ 3)
    }
}

impl fmt::Display for Edge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "edge {}", self.0)
    }
}

/// A face of a cell, number `2 * axis + side`, side 0 low, 1 high; also the direction across it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Face(u8);

numbered!(Face, 6);

impl Face {
    /// The face across `axis` on its low or high side.
    pub const fn new(axis: Axis, high: bool) -> Face {
        Face(2 * axis as u8 + high as u8)
    }

    /// The axis across it, along its normal.
    pub const fn axis(self) -> Axis {
        Axis::ALL[(self.0 / 2) as usize]
    }

    /// Whether it is on the high side.
    pub const fn is_high(self) -> bool {
        self.0 % 2 == 1
    }

    /// The parallel face on the other side of the cell.
    #[must_use]
    pub const fn opposite(self) -> Face {
        Face(self.0 ^ 1)
    }

    /// Its corners, anticlockwise seen from outside the cell, starting at its corner with the smallest coordinates.
    pub const fn corners(self) -> [Corner; 4] {
        let [u, v] = self.axis().others();
        let start = if self.is_high() { Corner::MIN.high(self.axis()) } else { Corner::MIN };
        let (first, last) = if self.is_high() { (u, v) } else { (v, u) };
        [start, start.high(first), start.high(u).high(v), start.high(last)]
    }

    /// Its edges in the same turn: edge `i` joins [`corners`](Face::corners) `i` and `i + 1`.
    pub const fn edges(self) -> [Edge; 4] {
        let [u, v] = self.axis().others();
        let (first, last) = if self.is_high() { (u, v) } else { (v, u) };
        let c = self.corners();
        [Edge::at(first, c[0]), Edge::at(last, c[1]), Edge::at(first, c[2]), Edge::at(last, c[3])]
    }
}

impl fmt::Display for Face {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "face {}{}", if self.is_high() { '+' } else { '-' }, self.axis())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn position(c: Corner) -> [i32; 3] {
        Axis::ALL.map(|a| i32::from(c & a))
    }

    #[test]
    fn axes_turn_right_handed() {
        for axis in Axis::ALL {
            let [u, v] = axis.others();
            assert_eq!([u, v], [axis.next(), axis.next().next()]);
            assert_eq!(v.next(), axis);
            assert_eq!(Axis::of_bit(axis.bit()), axis);
            assert_eq!(Extent::from(axis).complement(), u | v);
        }
        assert_eq!(Axis::ALL.map(Axis::bit), [4, 2, 1]);
    }

    #[test]
    fn extents_are_sets_of_axes() {
        for e in Extent::ALL {
            assert_eq!(Extent::from_bits(e.bits()), Some(e));
            assert_eq!(e.axes().count() as u32, e.dimension());
            assert_eq!(e.axes().fold(Extent::POINT, Extent::with), e);
            assert_eq!(!!e, e);
            for a in Axis::ALL {
                assert!((e | a).contains(a) && !(e - a).contains(a));
                assert_ne!(e.contains(a), (!e).contains(a));
            }
        }
        assert_eq!(Extent::from_bits(8), None);
    }

    #[test]
    fn corners_are_bits_of_their_position() {
        for c in Corner::ALL {
            let [x, y, z] = position(c);
            assert_eq!(c.index() as i32, 4 * x + 2 * y + z);
            assert_eq!(position(!c), [1 - x, 1 - y, 1 - z]);
            for a in Axis::ALL {
                assert_eq!(c ^ a ^ a, c);
                assert_eq!((c ^ a) & a, !(c & a));
                assert_eq!(c | a, if c & a { c } else { c ^ a });
                assert_eq!(c.low(a), if c & a { c ^ a } else { c });
                assert!(c.edges()[a.index()].corners().contains(&c));
                assert!(c.faces()[a.index()].corners().contains(&c));
            }
        }
        assert_eq!(Corner::from_index(8), None);
    }

    #[test]
    fn edges_are_numbered_by_axis_then_low_corner() {
        let expected = [0, 4, 1, 5, 2, 6, 3, 7, 0, 2, 1, 3, 4, 6, 5, 7, 0, 1, 2, 3, 4, 5, 6, 7];
        let corners: Vec<usize> = Edge::ALL.iter().flat_map(|e| e.corners().map(Corner::index)).collect();
        assert_eq!(corners, expected);
        for e in Edge::ALL {
            let [low, high] = e.corners();
            assert_eq!((low | e.axis(), low & e.axis()), (high, false));
            assert_eq!([Edge::at(e.axis(), low), Edge::at(e.axis(), high)], [e; 2]);
            assert_eq!([Edge::between(low, high), Edge::between(high, low)], [Some(e); 2]);
            assert_eq!(e.opposite().corners(), [!high, !low]);
            for f in Face::ALL {
                assert_eq!(f.edges().contains(&e), e.faces().contains(&f));
            }
        }
        let joined = |a| Corner::ALL.into_iter().filter(|&b| Edge::between(a, b).is_some()).count();
        assert!(Corner::ALL.into_iter().all(|a| joined(a) == 3));
    }

    #[test]
    fn faces_turn_anticlockwise_seen_from_outside() {
        for f in Face::ALL {
            assert_eq!(Face::new(f.axis(), f.is_high()), f);
            let c = f.corners();
            assert!(c.iter().all(|&c| (c & f.axis()) == f.is_high()));
            assert_eq!(c[0], *c.iter().min().expect("four corners"));
            for i in 0..4 {
                assert_eq!(Edge::between(c[i], c[(i + 1) % 4]), Some(f.edges()[i]));
            }
            let [p, q, r] = [c[0], c[1], c[2]].map(position);
            let (a, b) = ([0, 1, 2].map(|i| q[i] - p[i]), [0, 1, 2].map(|i| r[i] - q[i]));
            let cross = [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
            assert_eq!(cross, Direction::from(f).steps());
            assert!(f.opposite().corners().iter().all(|d| !c.contains(d)));
        }
    }

    #[test]
    fn names() {
        assert_eq!((Axis::X | Axis::Y).to_string(), "xy");
        assert_eq!(Extent::POINT.to_string(), "point");
        assert_eq!(Extent::ALL.map(|e| e.to_string().len()), [5, 1, 1, 2, 1, 2, 2, 3]);
        assert_eq!(
            Face::ALL.map(|f| f.to_string()),
            ["face -x", "face +x", "face -y", "face +y", "face -z", "face +z"]
        );
        assert_eq!((Edge::ALL[11].to_string(), Corner::MAX.to_string()), ("edge 11".into(), "corner 7".into()));
    }
}
