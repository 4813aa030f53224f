//! The surface that points were taken of, as a function: negative inside.
//!
//! Two things are known of a place. The winding number of the points ([`Dipoles`]) says on which side it is, near points and far from them,
//! and where holes are closed; but it is a sum over pieces, and rough. The planes of the points near by, each with its normal, blended by
//! their distance (implicit moving least squares: Kolluri 2008), say exactly how far the surface is; but only near points, and not where
//! points of several sheets are about. So the planes are taken where they agree with the winding number, or where that is undecided, and
//! where their normals are of one mind; and the winding number everywhere else.
//!
//! Where the surface crosses an edge of the lattice, points count less whose normals are unlike that of the nearest one (Oztireli,
//! Guennebaud and Gross 2009 do so), so that sharp edges stay nearly as sharp as the points have them.

use super::{Cloud, Dipoles, Near, Shape, View};
use crate::field::{Edge, Function, Zero};
use crate::geom::Bounds;
use glam::DVec3;

/// Weights are a Gaussian of the distance over the point's own spacing, held between these parts of the middle spacing of all.
const WIDTHS: [f64; 2] = [0.5, 1.5];
/// Points so many widths away do not count: their weight would be 0.002.
const CUT: f64 = 2.5;
/// Planes count where the sum of weights is this at least: at some 1.4 widths from a single point.
const LEAST_WEIGHT: f64 = 0.15;
/// Planes count where normals are of one mind: the length of their mean is this at least. 0.8 is that of two faces at 74 degrees.
const LEAST_AGREEMENT: f64 = 0.7;
/// Between these winding numbers sides are undecided.
const UNDECIDED: [f64; 2] = [0.2, 0.8];
/// Weights fall to 0.3 where normals are 45 degrees apart.
const UNLIKE: f64 = 0.5;

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

/// What planes say of a place.
#[derive(Debug, Clone, Copy)]
struct Blend {
    weight: f64,
    distance: f64,
    normal: DVec3,
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

    /// What the planes of some points say of a place; those whose normals are unlike `like` less, if there is any.
    fn blend(&self, place: DVec3, points: &[u32], like: Option<DVec3>) -> Blend {
        let mut blend = Blend { weight: 0.0, distance: 0.0, normal: DVec3::ZERO };
        for &i in points {
            let i = i as usize;
            let way = place - self.near.points()[i];
            let exponent = way.length_squared() * self.sharpness[i];
            if exponent < CUT * CUT {
                let normal = self.normals[i];
                let unlike = like.map_or(0.0, |like| like.distance_squared(normal) / UNLIKE);
                let weight = (-exponent - unlike).exp();
                blend.weight += weight;
                blend.distance += weight * way.dot(normal);
                blend.normal += weight * normal;
            }
        }
        if blend.weight > 0.0 {
            blend.distance /= blend.weight;
            blend.normal /= blend.weight;
        }
        blend
    }

    fn value(&self, place: DVec3, points: &[u32], view: &View) -> f64 {
        let winding = view.winding(place);
        let by_winding = (0.5 - winding) * 2.0 * self.spacing;
        let blend = self.blend(place, points, None);
        let is_sure = blend.weight >= LEAST_WEIGHT && blend.normal.length() >= LEAST_AGREEMENT;
        let agrees = (blend.distance < 0.0) == (by_winding < 0.0);
        let is_undecided = (UNDECIDED[0]..UNDECIDED[1]).contains(&winding);
        if is_sure && (agrees || is_undecided) { blend.distance } else { by_winding }
    }

    fn zero(&self, edge: &Edge, points: &[u32]) -> Zero {
        let linear = edge.linear();
        let place = edge.place(linear);
        let square = |i: &&u32| self.near.points()[**i as usize].distance_squared(place);
        let nearest = points.iter().min_by(|a, b| square(a).total_cmp(&square(b)).then(a.cmp(b)));
        let Some(&nearest) = nearest else { return Zero { at: linear, slope: self.slope(edge) } };
        let like = self.normals[nearest as usize];
        let middle = self.blend(place, points, Some(like));
        if middle.weight < 0.1 * LEAST_WEIGHT || middle.normal.length() < LEAST_AGREEMENT {
            return Zero { at: linear, slope: self.slope(edge) };
        }
        // The plane there, and where it meets the edge.
        let normal = middle.normal.normalize();
        let along = normal.dot(edge.ends[1] - edge.ends[0]);
        let outward = edge.values[1] - edge.values[0];
        if along * outward <= 0.0 {
            return Zero { at: linear, slope: normal };
        }
        Zero { at: (linear - middle.distance / along).clamp(0.0, 1.0), slope: normal }
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
        self.stretches(
            places,
            |&p| p,
            |places, points, bounds| {
                let view = self.dipoles.seen_from(bounds.center(), 0.5 * bounds.extent().length());
                out.extend(places.iter().map(|&p| self.value(p, points, &view)));
            },
        );
    }

    fn zeros(&self, edges: &[Edge], out: &mut Vec<Zero>) {
        let place = |edge: &Edge| edge.place(0.5);
        self.stretches(edges, place, |edges, points, _| out.extend(edges.iter().map(|edge| self.zero(edge, points))));
    }
}
