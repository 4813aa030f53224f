//! Functions of space, and where they are zero.

use glam::DVec3;

/// A lattice edge with ends of unlike sign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Its ends, in model units.
    pub ends: [DVec3; 2],
    /// The values there, of which one is below zero.
    pub values: [f64; 2],
}

/// Where the zero of a function lies on an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zero {
    /// From 0 at the first end to 1 at the second.
    pub at: f64,
    /// The direction in which the function grows, of any length.
    pub slope: DVec3,
}

impl Edge {
    /// The place at a part of its length.
    pub fn place(&self, at: f64) -> DVec3 {
        self.ends[0].lerp(self.ends[1], at)
    }

    /// Where a function is zero that is linear between the ends.
    pub fn linear(&self) -> f64 {
        let [a, b] = self.values;
        let at = a / (a - b);
        // Infinite values, and those of like sign.
        if (0.0..=1.0).contains(&at) { at } else { 0.5 }
    }
}

/// How far from an edge slopes are measured, as a part of its length.
const STEP: f64 = 1.0 / 64.0;

/// Times that an edge is cut to find a zero: regula falsi needs few where functions are smooth.
const CUTS: usize = 6;

/// A function of space that is negative inside of a solid: its level set 0 is the surface. It need not be a distance, but where it is near
/// to one, less has to be looked at (see [`Adapt`](super::Adapt)). Every `Fn(DVec3) -> f64` that threads can share is one.
///
/// What is asked for comes in batches, of places that are mostly near each other, so that what they need can be looked up once.
pub trait Function: Sync {
    /// Appends the values at some places, in model units. One that is no number counts as outside.
    fn values(&self, places: &[DVec3], out: &mut Vec<f64>);

    /// Appends the zeros on some edges. If nothing else is said, they are found by values, and slopes by differences over 1/64 of an edge.
    fn zeros(&self, edges: &[Edge], out: &mut Vec<Zero>) {
        let mut ranges: Vec<(Edge, [f64; 2])> = edges.iter().map(|edge| (*edge, [0.0, 1.0])).collect();
        let (mut places, mut values) = (Vec::new(), Vec::new());
        let mut at: Vec<f64> = edges.iter().map(Edge::linear).collect();
        let mut last: Vec<Option<usize>> = vec![None; edges.len()];
        for _ in 0..CUTS {
            places.clear();
            places.extend(edges.iter().zip(&at).map(|(edge, &at)| edge.place(at)));
            values.clear();
            self.values(&places, &mut values);
            let cuts = ranges.iter_mut().zip(&mut last).zip(&mut at).zip(&values);
            for ((((now, range), last), at), &value) in cuts {
                let end = usize::from((value < 0.0) != (now.values[0] < 0.0));
                if last.replace(end) == Some(end) {
                    // The end that stays again weighs half, so that both come nearer (the Illinois way, Dowell and Jarratt 1971).
                    now.values[1 - end] *= 0.5;
                }
                (now.values[end], range[end]) = (value, *at);
                *at = range[0] + (range[1] - range[0]) * now.linear();
            }
        }
        places.clear();
        for (edge, &at) in edges.iter().zip(&at) {
            let (place, step) = (edge.place(at), STEP * edge.ends[0].distance(edge.ends[1]));
            places.extend(DVec3::AXES.iter().flat_map(|&axis| [place - step * axis, place + step * axis]));
        }
        values.clear();
        self.values(&places, &mut values);
        out.extend(at.iter().zip(values.chunks_exact(6)).map(|(&at, v)| {
            let slope = DVec3::new(v[1] - v[0], v[3] - v[2], v[5] - v[4]);
            Zero { at, slope: if slope.is_finite() { slope } else { DVec3::ZERO } }
        }));
    }
}

impl<F: Fn(DVec3) -> f64 + Sync> Function for F {
    fn values(&self, places: &[DVec3], out: &mut Vec<f64>) {
        out.extend(places.iter().map(|&place| self(place)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_of_smooth_functions_are_found() {
        let ball = |p: DVec3| p.length_squared() - 2.0;
        let ways = [DVec3::X, DVec3::new(0.3, -0.8, 0.1), DVec3::ONE].map(|way| way.normalize());
        let edges = ways.map(|way| {
            let ends = [1.1 * way, 2.2 * way];
            Edge { ends, values: ends.map(ball) }
        });
        let mut zeros = Vec::new();
        ball.zeros(&edges, &mut zeros);
        for ((edge, zero), way) in edges.iter().zip(&zeros).zip(ways) {
            assert!(ball(edge.place(zero.at)).abs() < 1e-6, "{zero:?}");
            assert!(zero.slope.normalize().distance(way) < 1e-6);
        }
    }

    #[test]
    fn steps_and_odd_values_leave_zeros_on_the_edge() {
        let step = |p: DVec3| if p.x < 0.3 { f64::NEG_INFINITY } else { f64::NAN };
        let edge = Edge { ends: [DVec3::ZERO, DVec3::X], values: [-1e300, f64::INFINITY] };
        let mut zeros = Vec::new();
        step.zeros(&[edge], &mut zeros);
        assert!((0.0..=1.0).contains(&zeros[0].at) && zeros[0].slope.is_finite(), "{zeros:?}");
    }
}
