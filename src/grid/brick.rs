//! 8 x 8 x 8 bits at once: the record at the bottom of the octree.
//!
//! A [`Plane`] holds one bit for each lattice position of a brick: word `x`, bit `8 y + z` (z fastest, as in the child
//! order of the octree). Bits of several planes are the elements of one kind each: the points, the edges along x, and so
//! on, every element stored with the cell at whose minimum corner it lies.
//!
//! "The element at +x" is the plane shifted, with a carry from the neighbouring brick; a question about 512 elements is
//! eight word operations. All methods cost a few operations per word (eight words) and allocate nothing.

use super::Axis;
use super::key::{deinterleave, interleave};
use std::ops::{BitAnd, BitAndAssign, BitOr, BitOrAssign, BitXor, BitXorAssign, Not};

/// Cells a side of a brick.
pub const BRICK_SIDE: u32 = 8;

/// A position in a brick: `64 x + 8 y + z`, each coordinate 0..8.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Local(u16);

impl Local {
    /// The position whose coordinates are the three lowest bits of `x`, `y`, `z`.
    pub const fn new(x: u32, y: u32, z: u32) -> Self {
        Local(((x & 7) << 6 | (y & 7) << 3 | (z & 7)) as u16)
    }

    /// The position with this index; only the nine lowest bits count.
    pub const fn from_index(index: u32) -> Self {
        Local((index & 511) as u16)
    }

    /// `64 x + 8 y + z`.
    pub const fn index(self) -> u32 {
        self.0 as u32
    }

    /// The coordinates, each 0..8.
    pub const fn coords(self) -> [u32; 3] {
        [self.0 as u32 >> 6, self.0 as u32 >> 3 & 7, self.0 as u32 & 7]
    }

    /// The position with this place in the Z-order of the brick; only the nine lowest bits count.
    #[inline]
    pub const fn from_order(order: u64) -> Self {
        /// By place in the Z-order.
        static POSITIONS: [Local; 512] = {
            let mut all = [Local(0); 512];
            let mut i = 0;
            while i < 512 {
                let [x, y, z] = deinterleave(i);
                all[i as usize] = Local::new(x, y, z);
                i += 1;
            }
            all
        };
        POSITIONS[(order & 511) as usize]
    }

    /// Its place in the Z-order of the brick.
    #[inline]
    pub const fn order(self) -> u64 {
        /// By index.
        static ORDERS: [u16; 512] = {
            let mut all = [0; 512];
            let mut i = 0;
            while i < 512 {
                all[i] = interleave(Local(i as u16).coords()) as u16;
                i += 1;
            }
            all
        };
        ORDERS[self.0 as usize & 511] as u64
    }

    const fn word(self) -> usize {
        self.0 as usize >> 6
    }

    const fn bit(self) -> u64 {
        1 << (self.0 & 63)
    }
}

/// One bit for each of the 512 positions of a brick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Plane(pub [u64; 8]);

/// Bits with z = 0 of a word.
pub(crate) const Z0: u64 = 0x0101_0101_0101_0101;
/// Bits with y = 0 of a word.
const Y0: u64 = 0xff;

impl Plane {
    /// No bit set.
    pub const EMPTY: Plane = Plane([0; 8]);
    /// All bits set.
    pub const FULL: Plane = Plane([!0; 8]);

    /// The positions of a cube of `side` (1, 2, 4 or 8) whose least one is `at`, which is a multiple of the side on every axis.
    pub const fn cube(at: Local, side: u32) -> Plane {
        debug_assert!(at.0 as u32 & (0o111 * (side - 1)) == 0, "cubes of the octree lie at multiples of their side");
        let row = (1u64 << side) - 1;
        let square = row * (Z0 & (!0 >> (64 - 8 * side)));
        let [x, y, z] = at.coords();
        let mut plane = Plane::EMPTY;
        let mut i = 0;
        while i < side {
            plane.0[(x + i) as usize] = square << (8 * y + z);
            i += 1;
        }
        plane
    }

    /// The bit at `p`.
    pub const fn get(&self, p: Local) -> bool {
        self.0[p.word()] & p.bit() != 0
    }

    /// Sets the bit at `p`.
    pub fn set(&mut self, p: Local) {
        self.0[p.word()] |= p.bit();
    }

    /// Flips the bit at `p`.
    pub fn toggle(&mut self, p: Local) {
        self.0[p.word()] ^= p.bit();
    }

    /// Whether no bit is set.
    pub fn is_empty(&self) -> bool {
        self.0.iter().fold(0, |a, w| a | w) == 0
    }

    /// Number of set bits.
    pub fn count(&self) -> u32 {
        self.0.iter().map(|w| w.count_ones()).sum()
    }

    /// Number of set bits before `p`: the place of `p`'s record in an array that has one for each set bit.
    pub fn rank(&self, p: Local) -> u32 {
        let below = (self.0[p.word()] & (p.bit() - 1)).count_ones();
        below + self.0[..p.word()].iter().map(|w| w.count_ones()).sum::<u32>()
    }

    /// The set positions in ascending order.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = Local> + '_ {
        self.0.iter().zip(0u16..).flat_map(|(&word, x)| Bits(word).map(move |b| Local(x << 6 | b as u16)))
    }

    /// The plane of the elements at +x: bit p of the result is bit p + x; `next` is the brick at +x.
    #[must_use]
    pub fn at_plus_x(&self, next: &Plane) -> Plane {
        let [_, b, c, d, e, f, g, h] = self.0;
        Plane([b, c, d, e, f, g, h, next.0[0]])
    }

    /// The plane of the elements at +y; `next` is the brick at +y.
    #[must_use]
    pub fn at_plus_y(&self, next: &Plane) -> Plane {
        Plane(std::array::from_fn(|x| self.0[x] >> 8 | (next.0[x] & Y0) << 56))
    }

    /// The plane of the elements at +z; `next` is the brick at +z.
    #[must_use]
    pub fn at_plus_z(&self, next: &Plane) -> Plane {
        Plane(std::array::from_fn(|x| (self.0[x] >> 1 & !(Z0 << 7)) | (next.0[x] & Z0) << 7))
    }

    /// The plane of the elements at -x; `previous` is the brick at -x.
    #[must_use]
    pub fn at_minus_x(&self, previous: &Plane) -> Plane {
        let [a, b, c, d, e, f, g, _] = self.0;
        Plane([previous.0[7], a, b, c, d, e, f, g])
    }

    /// The plane of the elements at -y; `previous` is the brick at -y.
    #[must_use]
    pub fn at_minus_y(&self, previous: &Plane) -> Plane {
        Plane(std::array::from_fn(|x| self.0[x] << 8 | previous.0[x] >> 56))
    }

    /// The plane of the elements at -z; `previous` is the brick at -z.
    #[must_use]
    pub fn at_minus_z(&self, previous: &Plane) -> Plane {
        Plane(std::array::from_fn(|x| (self.0[x] << 1 & !Z0) | (previous.0[x] >> 7 & Z0)))
    }

    /// The plane of the elements one step further along `axis`; `next` is the brick there.
    #[inline]
    #[must_use]
    pub fn at_plus(&self, axis: Axis, next: &Plane) -> Plane {
        match axis {
            Axis::X => self.at_plus_x(next),
            Axis::Y => self.at_plus_y(next),
            Axis::Z => self.at_plus_z(next),
        }
    }

    /// The plane of the elements one step back along `axis`; `previous` is the brick there.
    #[inline]
    #[must_use]
    pub fn at_minus(&self, axis: Axis, previous: &Plane) -> Plane {
        match axis {
            Axis::X => self.at_minus_x(previous),
            Axis::Y => self.at_minus_y(previous),
            Axis::Z => self.at_minus_z(previous),
        }
    }

    /// The 64 bits of the layer in which `axis` is 7, packed in some order: what [`from_low_layer`](Plane::from_low_layer) takes.
    #[inline]
    pub fn high_layer(&self, axis: Axis) -> u64 {
        let words = || (0u32..).zip(self.0);
        match axis {
            Axis::X => self.0[7],
            Axis::Y => words().fold(0, |layer, (x, w)| layer | (w >> 56) << (8 * x)),
            Axis::Z => words().fold(0, |layer, (x, w)| layer | (w >> 7 & Z0) << x),
        }
    }

    /// The 64 bits of the layer in which `axis` is 0, in the order of [`high_layer`](Plane::high_layer).
    #[inline]
    pub fn low_layer(&self, axis: Axis) -> u64 {
        let words = || (0u32..).zip(self.0);
        match axis {
            Axis::X => self.0[0],
            Axis::Y => words().fold(0, |layer, (x, w)| layer | (w & Y0) << (8 * x)),
            Axis::Z => words().fold(0, |layer, (x, w)| layer | (w & Z0) << x),
        }
    }

    /// A plane with these bits in the layer in which `axis` is 0, and no others.
    #[inline]
    #[must_use]
    pub fn from_low_layer(axis: Axis, layer: u64) -> Plane {
        match axis {
            Axis::X => Plane([layer, 0, 0, 0, 0, 0, 0, 0]),
            Axis::Y => Plane(std::array::from_fn(|x| layer >> (8 * x) & Y0)),
            Axis::Z => Plane(std::array::from_fn(|x| layer >> x & Z0)),
        }
    }

    /// The plane turned over: position `(x, y, z)` comes to `(7 - x, 7 - y, 7 - z)`, index `i` to `511 - i`.
    #[must_use]
    pub fn turned_over(&self) -> Plane {
        Plane(std::array::from_fn(|x| self.0[7 - x].reverse_bits()))
    }

    /// Prefix parity along x: the result at x is `carry` flipped once for each bit set at x' < x on the same line (64
    /// lines at once, one bit of `carry` each). Also returns the carry into the brick at +x.
    #[must_use]
    pub fn prefix_parity_x(&self, carry: u64) -> (Plane, u64) {
        let mut parity = carry;
        let plane = Plane(self.0.map(|w| {
            let here = parity;
            parity ^= w;
            here
        }));
        (plane, parity)
    }

    /// Whether a bit is set in the layer in which `axis` is 0.
    #[inline]
    pub fn touches_min(&self, axis: Axis) -> bool {
        match axis {
            Axis::X => self.touches_min_x(),
            Axis::Y => self.touches_min_y(),
            Axis::Z => self.touches_min_z(),
        }
    }

    /// Whether a bit is set in the layer in which `axis` is 7.
    #[inline]
    pub fn touches_max(&self, axis: Axis) -> bool {
        match axis {
            Axis::X => self.0[7] != 0,
            Axis::Y => self.any(Y0 << 56),
            Axis::Z => self.any(Z0 << 7),
        }
    }

    /// Whether a bit with x = 0 is set.
    pub fn touches_min_x(&self) -> bool {
        self.0[0] != 0
    }

    /// Whether a bit with y = 0 is set.
    pub fn touches_min_y(&self) -> bool {
        self.any(Y0)
    }

    /// Whether a bit with z = 0 is set.
    pub fn touches_min_z(&self) -> bool {
        self.any(Z0)
    }

    /// Whether a bit with y = z = 0 is set.
    pub fn touches_min_yz(&self) -> bool {
        self.any(Y0 & Z0)
    }

    /// Whether a bit with x = z = 0 is set.
    pub fn touches_min_xz(&self) -> bool {
        self.0[0] & Z0 != 0
    }

    /// Whether a bit with x = y = 0 is set.
    pub fn touches_min_xy(&self) -> bool {
        self.0[0] & Y0 != 0
    }

    fn any(&self, mask: u64) -> bool {
        self.0.iter().fold(0, |a, w| a | w) & mask != 0
    }
}

macro_rules! wordwise {
    ($($op:ident $f:ident),*) => {$(
        impl $op for Plane {
            type Output = Plane;
            fn $f(self, other: Plane) -> Plane {
                Plane(std::array::from_fn(|x| self.0[x].$f(other.0[x])))
            }
        }
    )*};
}

wordwise!(BitAnd bitand, BitOr bitor, BitXor bitxor);

impl BitAndAssign for Plane {
    fn bitand_assign(&mut self, other: Plane) {
        *self = *self & other;
    }
}

impl BitOrAssign for Plane {
    fn bitor_assign(&mut self, other: Plane) {
        *self = *self | other;
    }
}

impl BitXorAssign for Plane {
    fn bitxor_assign(&mut self, other: Plane) {
        *self = *self ^ other;
    }
}

impl Not for Plane {
    type Output = Plane;
    fn not(self) -> Plane {
        Plane(self.0.map(|w| !w))
    }
}

/// The positions of the set bits of a word, ascending.
#[derive(Debug, Clone)]
pub struct Bits(pub u64);

impl Iterator for Bits {
    type Item = u32;

    #[inline]
    fn next(&mut self) -> Option<u32> {
        if self.0 == 0 {
            return None;
        }
        let bit = self.0.trailing_zeros();
        self.0 &= self.0 - 1;
        Some(bit)
    }

    #[inline]
    fn size_hint(&self) -> (usize, Option<usize>) {
        let count = self.0.count_ones() as usize;
        (count, Some(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A dense 16^3 grid: the oracle. Its eight bricks are cut out of it.
    struct Dense(Vec<bool>);

    impl Dense {
        fn at(&self, x: u32, y: u32, z: u32) -> bool {
            self.0[(x * 256 + y * 16 + z) as usize]
        }

        fn brick(&self, [bx, by, bz]: [u32; 3]) -> Plane {
            let mut plane = Plane::EMPTY;
            for i in 0..512 {
                let p = Local::from_index(i);
                let [x, y, z] = p.coords();
                if self.at(8 * bx + x, 8 * by + y, 8 * bz + z) {
                    plane.set(p);
                }
            }
            plane
        }
    }

    fn plane_from(f: impl Fn([u32; 3]) -> bool) -> Plane {
        let mut plane = Plane::EMPTY;
        (0..512).map(Local::from_index).filter(|p| f(p.coords())).for_each(|p| plane.set(p));
        plane
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn shifts_carry_across_bricks(bits in prop::collection::vec(any::<bool>(), 4096)) {
            let g = Dense(bits);
            let (o, x, y, z) = (g.brick([0; 3]), g.brick([1, 0, 0]), g.brick([0, 1, 0]), g.brick([0, 0, 1]));
            prop_assert_eq!(o.at_plus_x(&x), plane_from(|[i, j, k]| g.at(i + 1, j, k)));
            prop_assert_eq!(o.at_plus_y(&y), plane_from(|[i, j, k]| g.at(i, j + 1, k)));
            prop_assert_eq!(o.at_plus_z(&z), plane_from(|[i, j, k]| g.at(i, j, k + 1)));
            prop_assert_eq!(x.at_minus_x(&o), plane_from(|[i, j, k]| g.at(i + 7, j, k)));
            prop_assert_eq!(y.at_minus_y(&o), plane_from(|[i, j, k]| g.at(i, j + 7, k)));
            prop_assert_eq!(z.at_minus_z(&o), plane_from(|[i, j, k]| g.at(i, j, k + 7)));
        }

        #[test]
        fn prefix_parity_continues_in_the_next_brick(bits in prop::collection::vec(any::<bool>(), 4096)) {
            let g = Dense(bits);
            let (first, carry) = g.brick([0; 3]).prefix_parity_x(0);
            let (second, end) = g.brick([1, 0, 0]).prefix_parity_x(carry);
            let parity = |n: u32, y, z| (0..n).fold(false, |a, x| a ^ g.at(x, y, z));
            prop_assert_eq!(first, plane_from(|[x, y, z]| parity(x, y, z)));
            prop_assert_eq!(second, plane_from(|[x, y, z]| parity(8 + x, y, z)));
            for line in 0..64 {
                prop_assert_eq!(end >> line & 1 == 1, parity(16, line >> 3, line & 7));
            }
        }

        #[test]
        fn ranks_count_the_bits_before(words in any::<[u64; 8]>()) {
            let plane = Plane(words);
            let listed: Vec<_> = plane.iter().collect();
            prop_assert_eq!(listed.len() as u32, plane.count());
            prop_assert!(listed.is_sorted());
            for (n, p) in listed.into_iter().enumerate() {
                prop_assert!(plane.get(p));
                prop_assert_eq!(plane.rank(p), n as u32);
            }
        }

        #[test]
        fn layers_are_what_shifts_carry(words in any::<[u64; 8]>()) {
            let plane = Plane(words);
            for axis in Axis::ALL {
                let high = Plane::from_low_layer(axis, plane.high_layer(axis));
                prop_assert_eq!(high, Plane::EMPTY.at_minus(axis, &plane));
                let low = Plane::from_low_layer(axis, plane.low_layer(axis));
                prop_assert_eq!(plane.touches_min(axis), !low.is_empty());
                prop_assert_eq!(plane.touches_max(axis), !high.is_empty());
                prop_assert_eq!(low, plane_from(|c| c[axis.index()] == 0 && plane.get(Local::new(c[0], c[1], c[2]))));
            }
            prop_assert_eq!(plane.turned_over(), plane_from(|[x, y, z]| plane.get(Local::new(7 - x, 7 - y, 7 - z))));
        }

        #[test]
        fn words_are_combined_bit_by_bit(a in any::<[u64; 8]>(), b in any::<[u64; 8]>()) {
            let (a, b) = (Plane(a), Plane(b));
            prop_assert_eq!(a & b, plane_from(|[x, y, z]| a.get(Local::new(x, y, z)) & b.get(Local::new(x, y, z))));
            prop_assert_eq!(a | b, !(!a & !b));
            prop_assert_eq!(a ^ b, (a | b) & !(a & b));
        }
    }

    #[test]
    fn cubes_are_cubes() {
        for side in [1, 2, 4, 8] {
            for at in (0..512).map(Local::from_index).filter(|at| at.coords().iter().all(|c| c % side == 0)) {
                let is_in = |p: &Local| (0..3).all(|a| p.coords()[a] / side == at.coords()[a] / side);
                let expected = (0..512).map(Local::from_index).filter(is_in);
                assert!(Plane::cube(at, side).iter().eq(expected), "{side} at {at:?}");
            }
        }
    }

    #[test]
    fn touching_the_minimum_sides() {
        for i in 0..512 {
            let p = Local::from_index(i);
            let [x, y, z] = p.coords();
            assert_eq!(Local::new(x, y, z), p);
            assert_eq!((Local::from_order(p.order()), p.order()), (p, interleave([x, y, z])));
            let mut plane = Plane::EMPTY;
            plane.toggle(p);
            assert_eq!(plane.touches_min_x(), x == 0);
            assert_eq!(plane.touches_min_y(), y == 0);
            assert_eq!(plane.touches_min_z(), z == 0);
            assert_eq!(plane.touches_min_xy(), x == 0 && y == 0);
            assert_eq!(plane.touches_min_xz(), x == 0 && z == 0);
            assert_eq!(plane.touches_min_yz(), y == 0 && z == 0);
            plane.toggle(p);
            assert!(plane.is_empty());
        }
    }
}
