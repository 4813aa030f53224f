//! What the trilinear interpolant joins: asked of the function itself.
//!
//! On a face it is bilinear, and has one saddle if the face is open: what is joined has the saddle's sign (the asymptotic decider of
//! Nielson and Hamann 1991). In the middle of the cell the surface can change only where a slice does, and what slices look like changes
//! only at few places: where an edge along the sweep is cut, and where the saddle of the slice changes its sign, which are the roots of
//! a quadratic polynomial (the test of Chernyaev 1995, in the way of Grosso 2016). Between these places one slice stands for all. So the
//! corners that are joined inside the cell are found by following those of at most seven slices; there are no cases, and nothing
//! is assumed of the symmetries.
//!
//! Ties: a value of 0 is outside, and so is a saddle of 0. A face is decided from its own four values alone, with products whose
//! factors can be exchanged, so both of its cells decide the same: rounding may choose between nearly equal surfaces, but never cracks one.

use crate::grid::{Axis, Corner, Face};

/// Whether the two inside corners of an open face are joined: if the product of their values exceeds that of the others.
pub(super) fn is_joined(values: &[f64; 8], face: Face) -> bool {
    let ring = face.corners().map(|corner| values[corner.index()]);
    saddle_is_inside(ring)
}

/// Whether the saddle of a bilinear function with these values round a square, of which those inside are opposite to each other, is
/// inside. Values are scaled first, for products must neither overflow nor vanish.
fn saddle_is_inside(ring: [f64; 4]) -> bool {
    let scale = ring.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
    let [a, b, c, d] = ring.map(|v| v / scale);
    // Values of the one sign, times those of the other: the saddle's value times a positive number.
    if a > 0.0 || c > 0.0 { a * c - b * d > 0.0 } else { b * d - a * c > 0.0 }
}

/// For each corner the least one that it is joined to within the cell.
pub(super) fn joined(values: &[f64; 8]) -> [u8; 8] {
    // The corners of a slice across x in cyclic order, at its low end; at its high end, they are across.
    let ring = Face::new(Axis::X, false).corners();
    let low = ring.map(|corner| values[corner.index()]);
    let high = ring.map(|corner| values[corner.across(Axis::X).index()]);
    let scale = values.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
    let (low, high) = (low.map(|v| v / scale), high.map(|v| v / scale));
    let mut places = Places::default();
    for i in 0..4 {
        if (low[i] > 0.0) != (high[i] > 0.0) {
            places.add(low[i] / (low[i] - high[i]));
        }
    }
    places.add_saddles(low, high);
    let mut classes = Classes::default();
    let mut before: Option<[bool; 4]> = None;
    places.slices(|slice, at| {
        let values = match at {
            At::Low => low,
            At::High => high,
            At::Between(u) => std::array::from_fn(|i| low[i] + u * (high[i] - low[i])),
        };
        let inside = values.map(|v| v > 0.0);
        for i in 0..4 {
            // Along the sides of the slice, and from the slice before.
            if inside[i] == inside[(i + 1) % 4] {
                classes.join(4 * slice + i, 4 * slice + (i + 1) % 4);
            }
            if before.is_some_and(|before| before[i] == inside[i]) {
                classes.join(4 * slice + i, 4 * (slice - 1) + i);
            }
        }
        if inside[0] == inside[2] && inside[1] == inside[3] && inside[0] != inside[1] {
            let first = usize::from(inside[0] != saddle_is_inside(values));
            classes.join(4 * slice + first, 4 * slice + first + 2);
        }
        before = Some(inside);
    });
    let last = 4 * (places.count + 2);
    let mut least = [0; 8];
    let class_of = |corner: Corner, classes: &Classes| {
        let i = ring.iter().position(|&c| c == corner.low(Axis::X)).expect("every corner is at an end");
        classes.of(if corner.is_high(Axis::X) { last + i } else { i })
    };
    for corner in Corner::ALL {
        let class = class_of(corner, &classes);
        let first = Corner::ALL.into_iter().find(|&c| class_of(c, &classes) == class).expect("itself at least");
        least[corner.index()] = first.index() as u8;
    }
    least
}

/// Where a slice is.
enum At {
    Low,
    Between(f64),
    High,
}

/// The places along the sweep at which slices change, in ascending order.
#[derive(Default)]
struct Places {
    at: [f64; 6],
    count: usize,
}

impl Places {
    fn add(&mut self, u: f64) {
        if u > 0.0 && u < 1.0 {
            self.at[self.count] = u;
            self.count += 1;
            self.at[..self.count].sort_unstable_by(f64::total_cmp);
        }
    }

    /// Where the saddle's sign changes: the roots of the polynomial `ac - bd` of the values round the slice.
    fn add_saddles(&mut self, low: [f64; 4], high: [f64; 4]) {
        let slope: [f64; 4] = std::array::from_fn(|i| high[i] - low[i]);
        let a = slope[0] * slope[2] - slope[1] * slope[3];
        let b = low[0] * slope[2] + low[2] * slope[0] - low[1] * slope[3] - low[3] * slope[1];
        let c = low[0] * low[2] - low[1] * low[3];
        let square = b * b - 4.0 * a * c;
        if square > 0.0 {
            // The greater root without cancellation, the other by their product.
            let q = -0.5 * (b + square.sqrt().copysign(b));
            self.add(q / a);
            self.add(c / q);
        }
    }

    /// Calls `each` with the number and place of a slice at both ends and between any two places.
    fn slices(&self, mut each: impl FnMut(usize, At)) {
        each(0, At::Low);
        let mut from = 0.0;
        for (slice, &to) in (1..).zip(self.at[..self.count].iter().chain([&1.0])) {
            each(slice, At::Between(0.5 * (from + to)));
            from = to;
        }
        each(self.count + 2, At::High);
    }
}

/// Classes of corners of slices: for each the one it was joined to.
struct Classes([u8; 36]);

impl Default for Classes {
    fn default() -> Self {
        Classes(std::array::from_fn(|i| i as u8))
    }
}

impl Classes {
    fn of(&self, mut i: usize) -> usize {
        while usize::from(self.0[i]) != i {
            i = usize::from(self.0[i]);
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a] = b as u8;
    }
}
