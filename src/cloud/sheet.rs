//! The surface that points were taken of, as a function: negative inside.
//!
//! Two things are known of a place. The winding number of the points ([`Dipoles`]) says on which side it is, near points and far from them,
//! and where holes are closed; but it is a sum over pieces, and rough. The planes of the points near by, each with its normal, blended by
//! their distance (implicit moving least squares: Kolluri 2008), say exactly how far the surface is; but only near points. Where the points near a
//! place are of several sheets or faces, each has its own plane, and how they lie to each other says how they meet (`parts`). So the planes
//! are taken near points where they agree with the winding number, or where that is undecided; and the winding number everywhere else.

use super::parts::{self, Said, Weighted};
use super::{Cloud, Dipoles, Near, Shape, View};
use crate::field::{Edge, Function, Zero};
use crate::geom::Bounds;
use glam::DVec3;

/// Weights are a Gaussian of the distance over the point's own spacing, held between these parts of the middle spacing of all.
const WIDTHS: [f64; 2] = [0.5, 1.5];
/// Points so many widths away do not count: their weight would be 0.002.
const CUT: f64 = 2.5;
/// Planes count within so many spacings of a point. Where there is none, no two sheets are so near to each other that the winding number is in
/// doubt.
const NEARBY: f64 = 1.0;
/// Planes count where so much of the weight is of points that lie in three parts at most.
const LEAST_AGREEMENT: f64 = 0.7;
/// Between these winding numbers sides are undecided.
const UNDECIDED: [f64; 2] = [0.2, 0.8];
/// Places on an edge at which planes are asked where they cross it, at most,
const STEPS: usize = 5;
/// and how near the next one is to the last one, as a part of the edge.
const NEAR: f64 = 0.05;

/// The function of a cloud.
#[derive(Debug)]
pub struct Sheet {
    near: Near,
    normals: Vec<DVec3>,
    /// Squares of the widths of the points' weights, inverted.
    sharpness: Vec<f64>,
    /// No point is looked at that is farther.
    reach: f64,
    spacing: f64,
    dipoles: Dipoles,
}

impl Sheet {
    /// The function of a cloud in the order that [`Near::sorted`] gives, with the [`Shape`] found for it.
    pub fn new(cloud: &Cloud, near: Near, shape: Shape) -> Sheet {
        let dipoles = Dipoles::new(&cloud.points, &shape.normals, &shape.areas);
        let [least, most] = WIDTHS.map(|part| part * shape.spacing.max(f64::MIN_POSITIVE));
        let sharpness = shape.areas.iter().map(|area| area.sqrt().clamp(least, most).powi(-2)).collect();
        Sheet { near, normals: shape.normals, sharpness, reach: CUT * most, spacing: shape.spacing, dipoles }
    }

    /// The winding number of the points at a place.
    pub fn winding(&self, place: DVec3) -> f64 {
        self.dipoles.winding(place)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.near.bytes() + self.normals.len() * (2 * size_of::<DVec3>() + 4 * size_of::<f64>())
    }

    /// Calls `each` with the places and the points about them, in stretches of places so near to each other that the points are the same
    /// for all.
    fn stretches<T>(&self, items: &[T], place: impl Fn(&T) -> DVec3, mut each: impl FnMut(&[T], &[u32], Bounds)) {
        let mut points = Vec::new();
        let mut start = 0;
        while start < items.len() {
            let mut bounds = Bounds::EMPTY;
            let mut end = start;
            while end < items.len() {
                let mut with = bounds;
                with.add(place(&items[end]));
                if end > start && with.extent().max_element() > self.reach {
                    break;
                }
                bounds = with;
                end += 1;
            }
            points.clear();
            if !bounds.is_empty() {
                let about = Bounds { min: bounds.min - self.reach, max: bounds.max + self.reach };
                points.extend(self.near.in_box(&about).flatten());
            }
            each(&items[start..end], &points, bounds);
            start = end;
        }
    }

    /// What the planes of some points say of a place, if there are enough near it, and they make sense.
    fn said(&self, place: DVec3, points: &[u32], about: &mut Vec<Weighted>) -> Option<Said> {
        about.clear();
        let (mut all, mut nearest) = (0.0, f64::INFINITY);
        for &i in points {
            let i = i as usize;
            let point = self.near.points()[i];
            let square = place.distance_squared(point);
            let exponent = square * self.sharpness[i];
            if exponent < CUT * CUT {
                let weight = (-exponent).exp();
                all += weight;
                nearest = nearest.min(square);
                about.push(Weighted { weight, point, normal: self.normals[i] });
            }
        }
        if nearest > (NEARBY * self.spacing).powi(2) {
            return None;
        }
        parts::said(place, about, self.spacing).filter(|said| said.weight >= LEAST_AGREEMENT * all)
    }

    fn value(&self, place: DVec3, points: &[u32], view: &View, about: &mut Vec<Weighted>) -> f64 {
        let winding = view.winding(place);
        let by_winding = (0.5 - winding) * 2.0 * self.spacing;
        let is_undecided = (UNDECIDED[0]..UNDECIDED[1]).contains(&winding);
        let agrees = |said: &Said| is_undecided || (said.distance < 0.0) == (by_winding < 0.0);
        self.said(place, points, about).filter(agrees).map_or(by_winding, |said| said.distance)
    }

    /// Where planes cross an edge: by Newton's steps, and by halves where these lead astray.
    fn zero(&self, edge: &Edge, points: &[u32], about: &mut Vec<Weighted>) -> Zero {
        let way = edge.ends[1] - edge.ends[0];
        let is_outward = edge.values[0] < edge.values[1];
        let mut range = [0.0, 1.0];
        let mut zero = Zero { at: edge.linear(), slope: DVec3::ZERO };
        for _ in 0..STEPS {
            let Some(said) = self.said(edge.place(zero.at), points, about) else { break };
            zero.slope = said.normal;
            range[usize::from((said.distance < 0.0) != is_outward)] = zero.at;
            let along = said.normal.dot(way);
            let next = zero.at - said.distance / along;
            let is_good = (along > 0.0) == is_outward && (range[0]..=range[1]).contains(&next);
            let step = zero.at;
            zero.at = if is_good { next } else { 0.5 * (range[0] + range[1]) };
            if (zero.at - step).abs() < NEAR {
                break;
            }
        }
        if zero.slope == DVec3::ZERO { Zero { slope: self.slope(edge), ..zero } } else { zero }
    }

    /// The direction in which the winding number falls, by differences over an edge.
    fn slope(&self, edge: &Edge) -> DVec3 {
        let (place, step) = (edge.place(edge.linear()), 0.5 * edge.ends[0].distance(edge.ends[1]));
        let slope = DVec3::AXES.map(|axis| self.winding(place - step * axis) - self.winding(place + step * axis));
        DVec3::from_array(slope)
    }
}

impl Function for Sheet {
    fn values(&self, places: &[DVec3], out: &mut Vec<f64>) {
        let mut about = Vec::new();
        self.stretches(
            places,
            |&p| p,
            |places, points, bounds| {
                let view = self.dipoles.seen_from(bounds.center(), 0.5 * bounds.extent().length());
                out.extend(places.iter().map(|&p| self.value(p, points, &view, &mut about)));
            },
        );
    }

    fn zeros(&self, edges: &[Edge], out: &mut Vec<Zero>) {
        let place = |edge: &Edge| edge.place(0.5);
        let mut about = Vec::new();
        self.stretches(edges, place, |edges, points, _| {
            out.extend(edges.iter().map(|edge| self.zero(edge, points, &mut about)));
        });
    }
}
