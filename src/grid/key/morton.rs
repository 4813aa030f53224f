//! Interleaved coordinates: spreading, gathering and adding, on 64-bit words without any special instruction.

use super::EXTENT_SHIFT;
use crate::grid::axis::{Axis, Corner};

/// The interleaved coordinates.
pub(super) const CODE: u64 = (1 << EXTENT_SHIFT) - 1;

/// The bits of each extent's axes among the interleaved coordinates.
pub(super) const FIELDS: [u64; 8] = {
    let mut fields = [0; 8];
    let mut dir = 0;
    while dir < 8 {
        fields[dir] = CODE / 7 * dir as u64;
        dir += 1;
    }
    fields
};

/// The bits of one axis among the interleaved coordinates.
#[inline]
pub(super) const fn field(axis: Axis) -> u64 {
    FIELDS[axis.bit() as usize]
}

/// Spreads the low 20 bits of `n` to bits 0, 3, 6, ..., 57. (No BMI2 needed: five shifts and masks.)
#[inline]
const fn spread(n: u32) -> u64 {
    let mut n = n as u64 & 0xf_ffff;
    n = (n | n << 32) & 0x000f_0000_0000_ffff;
    n = (n | n << 16) & 0x000f_0000_ff00_00ff;
    n = (n | n << 8) & 0x000f_00f0_0f00_f00f;
    n = (n | n << 4) & 0x00c3_0c30_c30c_30c3;
    (n | n << 2) & (CODE / 7)
}

/// Gathers bits 0, 3, 6, ..., 57 of `n`: the inverse of [`spread`]; other bits are ignored.
#[inline]
const fn compact(n: u64) -> u32 {
    let mut n = n & (CODE / 7);
    n = (n | n >> 2) & 0x00c3_0c30_c30c_30c3;
    n = (n | n >> 4) & 0x000f_00f0_0f00_f00f;
    n = (n | n >> 8) & 0x000f_0000_ff00_00ff;
    n = (n | n >> 16) & 0x000f_0000_0000_ffff;
    ((n | n >> 32) & 0xf_ffff) as u32
}

/// The interleaved form of lattice coordinates, each below 2^20: x in bits 2, 5, ..., y in bits 1, 4, ..., z in bits 0,
/// 3, ...
///
/// ```
/// use zmend::grid::key::{deinterleave, interleave};
///
/// assert_eq!(interleave([1, 0, 3]), 0b001_101);
/// assert_eq!(deinterleave(0b001_101), [1, 0, 3]);
/// ```
#[inline]
pub const fn interleave([x, y, z]: [u32; 3]) -> u64 {
    spread(x) << 2 | spread(y) << 1 | spread(z)
}

/// The coordinates of an interleaved code; bits from 60 on are ignored.
#[inline]
pub const fn deinterleave(code: u64) -> [u32; 3] {
    [compact(code >> 2), compact(code >> 1), compact(code)]
}

/// Adds to one interleaved field: the bits of the others are set, so that carries pass over them, and then restored.
#[inline]
pub(super) const fn add(code: u64, field: u64, distance: u64) -> u64 {
    (code | !field).wrapping_add(distance) & field | code & !field
}

/// Subtracts from one interleaved field: the bits of the others are clear, so that borrows pass over them, and then
/// restored.
#[inline]
pub(super) const fn subtract(code: u64, field: u64, distance: u64) -> u64 {
    (code & field).wrapping_sub(distance) & field | code & !field
}
/// The code of a corner: the code of the smallest one, raised by a side, given as z bit, on the corner's high axes.
#[inline]
pub(super) const fn raise(min: u64, corner: Corner, side: u64) -> u64 {
    let high = corner.bits() as u64;
    let x = add(min, field(Axis::X), (high & 4) * side);
    let y = add(min, field(Axis::Y), (high & 2) * side);
    let z = add(min, field(Axis::Z), (high & 1) * side);
    x & field(Axis::X) | y & field(Axis::Y) | z & field(Axis::Z)
}
