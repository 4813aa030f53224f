//! What the neighbours of each point say: how dense the points are, and which way the surface lies.

use super::orient::oriented;
use super::{Cloud, NONE, Near, Plane};
use crate::error::Result;
use crate::progress::{Progress, check};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Points looked at a time.
const BATCH: usize = 1024;

/// Normals by less than this (cosine) apart belong to one sheet.
const SAME_SHEET: f64 = 0.3;

/// No point stands for more than so many times the square of how far all points about it are apart: few of them are on one sheet along narrow faces.
const MOST_AREA: f64 = 2.5;

/// How often normals are filtered that were found by planes.
const FILTERS: usize = 3;
/// Normals 45 degrees apart count e^-2 in filters.
const UNLIKE: f64 = 0.3;

/// A point so many spacings off a plane counts half as much against it as one that is far off.
const ON_PLANE: f64 = 0.15;
/// A neighbour's plane is taken where less than this part speaks against it of what speaks against the own one: an edge of 90 degrees leaves 0.64.
const BETTER: f64 = 0.8;
/// How much of the turn that would suit the neighbours best is made: all of it would make neighbours swap their errors.
const TURN: f64 = 0.5;

/// Gaps that are tried, in spacings. Points by chance leave holes of up to four and a half, points that keep clear of each other of up to
/// two.
const GAPS: [f64; 4] = [1.6, 2.3, 3.2, 4.5];

/// Spacing, normals and areas of the points of a cloud.
#[derive(Debug, Clone)]
pub struct Shape {
    /// Unit normals, outward.
    pub normals: Vec<DVec3>,
    /// The part of the surface that each point stands for, in model units squared.
    pub areas: Vec<f64>,
    /// The middle one of the roots of all areas: how far neighbours are from each other.
    pub spacing: f64,
    /// The distance below which 98 of 100 points have their neighbours, in the same measure.
    pub wide_spacing: f64,
    /// How many points had the orientation of their normals from what infinity reaches; the others have that of their neighbours. None if
    /// normals were given.
    pub seen_from_outside: usize,
}

impl Shape {
    /// Looks at the `count` nearest of each point. Normals that the cloud has are kept; else they are those of planes through the nearest
    /// points, turned to where infinity reaches without coming between points that are less than `gap` apart (of several widths the one
    /// with which most is seen, when not given), or as their neighbours are.
    ///
    /// # Errors
    /// When too many points lie in one place, beside the extent of the cloud; `Cancelled`.
    pub fn of(cloud: &Cloud, near: &Near, count: usize, gap: Option<f64>, progress: &dyn Progress) -> Result<Shape> {
        check(progress)?;
        near.check()?;
        let nearest = near.nearest(count, progress)?;
        check(progress)?;
        let of =
            |i: usize| nearest[count * i..][..count].iter().copied().take_while(|&j| j != NONE).map(|j| j as usize);
        let points = &cloud.points;
        let extent = points.len().min(count);
        // A point with nothing near it stands for nothing.
        let alone =
            |i: usize| of(i).last().map_or(0.0, |j| points[i].distance(points[j]) * (PI / extent as f64).sqrt());
        let spacings: Vec<f64> = (0..points.len()).into_par_iter().map(alone).collect();
        let mut sorted = spacings.clone();
        sorted.par_sort_unstable_by(f64::total_cmp);
        let quantile = |q: f64| sorted.get(((sorted.len() as f64 - 1.0) * q) as usize).copied().unwrap_or(0.0);
        let (spacing, wide_spacing) = (quantile(0.5), quantile(0.98));

        let mut seen_from_outside = 0;
        let normals: Vec<DVec3> = if cloud.has_normals() {
            cloud.normals.par_iter().map(|n| n.normalize_or_zero()).collect()
        } else {
            let normal = |i: usize| {
                let around = std::iter::once(i).chain(of(i)).map(|j| points[j]);
                Plane::fit(around).map_or(DVec3::ZERO, |plane| plane.normal)
            };
            let normals: Vec<DVec3> = (0..points.len()).into_par_iter().with_min_len(BATCH).map(normal).collect();
            check(progress)?;
            let normals = chosen(points, &normals, ON_PLANE * spacing, |i| of(i));
            check(progress)?;
            let gaps = gap.map_or_else(|| GAPS.map(|n| n * wide_spacing).to_vec(), |gap| vec![gap]);
            let (normals, seen) = oriented(points, normals, &nearest, count, &gaps, progress)?;
            seen_from_outside = seen;
            (0..FILTERS).fold(normals, |normals, _| filtered(points, &normals, |i| of(i)))
        };
        let area = |i: usize| {
            let same = of(i).filter(|&j| normals[i].dot(normals[j]) > SAME_SHEET).count();
            let Some(last) = of(i).filter(|&j| normals[i].dot(normals[j]) > SAME_SHEET).last() else {
                return spacings[i] * spacings[i];
            };
            let area = PI * points[i].distance_squared(points[last]) / same as f64;
            area.min(MOST_AREA * spacings[i] * spacings[i])
        };
        let areas = (0..points.len()).into_par_iter().with_min_len(BATCH).map(area).collect();
        Ok(Shape { normals, areas, spacing, wide_spacing, seen_from_outside })
    }
}

/// Each normal, or that of a neighbour if its plane through the point has more of the points about it: where planes were fitted across an
/// edge, some neighbour's was not. Then the plane of the points that it has. What speaks against a plane are the squares of distances from
/// it, those far above `off` all alike.
fn chosen<I: Iterator<Item = usize>>(
    points: &[DVec3],
    normals: &[DVec3],
    off: f64,
    nearest: impl Fn(usize) -> I + Sync,
) -> Vec<DVec3> {
    let choice = |i: usize| {
        let ways: Vec<DVec3> = nearest(i).map(|j| points[j] - points[i]).collect();
        let cost = |n: DVec3| {
            ways.iter().map(|way| way.dot(n).powi(2)).map(|square| square / (square + off * off)).sum::<f64>()
        };
        let own = cost(normals[i]);
        let candidates = nearest(i).map(|j| (cost(normals[j]), normals[j]));
        let Some((least, normal)) = candidates.min_by(|a, b| a.0.total_cmp(&b.0)) else { return normals[i] };
        if least >= BETTER * own {
            return normals[i];
        }
        let on_plane = ways.iter().copied().filter(|way| way.dot(normal).abs() < 2.0 * off).chain([DVec3::ZERO]);
        let fitted = Plane::fit(on_plane).map_or(normal, |plane| plane.normal);
        if cost(fitted) < least { fitted } else { normal }
    };
    (0..normals.len()).into_par_iter().with_min_len(BATCH).map(choice).collect()
}

/// Each normal as the mean of those near it, which count less the more they differ: where planes were fitted across an edge, normals turn
/// to one side (the bilateral filter of Tomasi and Manduchi 1998). Then it is turned to where it and those of the points near it mirror each
/// other, as on an arc: there a plane through few points leans, and means of its like lean with it.
fn filtered<I: Iterator<Item = usize>>(
    points: &[DVec3],
    normals: &[DVec3],
    nearest: impl Fn(usize) -> I + Sync,
) -> Vec<DVec3> {
    let mean = |i: usize| {
        let own = normals[i];
        let (mut sum, mut square, mut off) = (own, DMat3::ZERO, DVec3::ZERO);
        for j in nearest(i) {
            let weight = (-own.distance_squared(normals[j]) / UNLIKE).exp();
            sum += weight * normals[j];
            let way = points[j] - points[i];
            // Normals that mirror each other: way . (own + normals[j]) = 0.
            square += weight * DMat3::from_cols(way * way.x, way * way.y, way * way.z);
            off += weight * way * way.dot(normals[j]);
        }
        let mean = sum.normalize_or_zero();
        if mean == DVec3::ZERO {
            return own;
        }
        // The turn t, along the plane, that makes the sum of (way . (mean + t) + way . normal)^2 least.
        let (u, v) = mean.any_orthonormal_pair();
        let rest = -(square * mean + off);
        let (a, b, c) = (u.dot(square * u), u.dot(square * v), v.dot(square * v));
        let (p, q) = (u.dot(rest), v.dot(rest));
        let determinant = a * c - b * b;
        if determinant <= 1e-3 * (a + c) * (a + c) {
            return mean;
        }
        let turn = (u * (c * p - b * q) + v * (a * q - b * p)) / determinant;
        (mean + TURN * turn.clamp_length_max(1.0)).normalize()
    };
    (0..normals.len()).into_par_iter().with_min_len(BATCH).map(mean).collect()
}
