//! Clean shapes, made analytically: wrapped sheets, surfaces of lattice cells, extruded outlines.

use crate::mesh::{Mesh, triangulate};
use glam::{DVec2, DVec3, IVec3};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A triangulated sheet of `across` by `along` quads that closes on itself both ways, like a torus. `place` maps
/// `0 .. 1` squared to points; the sheet looks where its first direction crossed with its second points.
pub(super) fn wrapped(across: u32, along: u32, place: impl Fn(f64, f64) -> DVec3) -> Mesh {
    sheet([across, along], along, place)
}

/// A triangulated sheet that closes on itself in its first direction only, like the side of a cylinder.
pub(super) fn band(across: u32, along: u32, place: impl Fn(f64, f64) -> DVec3) -> Mesh {
    sheet([across, along], along + 1, place)
}

fn sheet([across, along]: [u32; 2], rows: u32, place: impl Fn(f64, f64) -> DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    let at = |i: u32, j: u32| (i % across) * rows + j % rows;
    for (i, j) in (0..across).flat_map(|i| (0..rows).map(move |j| (i, j))) {
        mesh.points.push(place(f64::from(i) / f64::from(across), f64::from(j) / f64::from(along)));
        if j < along {
            mesh.faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.faces.push(&[at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    mesh
}

/// A closed tube around a closed curve given over `0 .. 1`.
pub(super) fn tube(around: u32, along: u32, radius: f64, curve: impl Fn(f64) -> DVec3) -> Mesh {
    wrapped(along, around, |t, angle| {
        let tangent = (curve(t + 1e-4) - curve(t - 1e-4)).normalize();
        // A frame that turns with the axis: smooth as long as the curve never runs along it.
        let side = tangent.cross(DVec3::Z).normalize();
        let (sin, cos) = (TAU * angle).sin_cos();
        curve(t) + radius * (cos * side + sin * side.cross(tangent))
    })
}

/// The quads between the cells that are solid and those that are not, looking outwards, within a box of cells from 0 to
/// `size`. Points are shared, so cells must not touch along a mere edge or corner if the surface is to be manifold.
pub(super) fn cells(size: IVec3, solid: impl Fn(IVec3) -> bool, place: impl Fn(IVec3) -> DVec3) -> Mesh {
    let is_solid = |c: IVec3| c.cmpge(IVec3::ZERO).all() && c.cmplt(size).all() && solid(c);
    let mut mesh = Mesh::default();
    let mut ids = BTreeMap::new();
    let range = |n: i32| 0..n;
    for c in
        range(size.x).flat_map(|x| range(size.y).flat_map(move |y| range(size.z).map(move |z| IVec3::new(x, y, z))))
    {
        let axes = [[IVec3::X, IVec3::Y, IVec3::Z], [IVec3::Y, IVec3::Z, IVec3::X], [IVec3::Z, IVec3::X, IVec3::Y]];
        for ([axis, u, v], upper) in axes.into_iter().flat_map(|axes| [(axes, false), (axes, true)]) {
            if is_solid(c) && !is_solid(if upper { c + axis } else { c - axis }) {
                let low = if upper { c + axis } else { c };
                let corners =
                    if upper { [low, low + u, low + u + v, low + v] } else { [low, low + v, low + u + v, low + u] };
                let face = corners.map(|p| {
                    *ids.entry(p.to_array()).or_insert_with(|| {
                        mesh.points.push(place(p));
                        mesh.points.len() as u32 - 1
                    })
                });
                mesh.faces.push(&face);
            }
        }
    }
    mesh
}

/// A sphere as the lattice on a cube of `n` cells a side, blown up, in triangles.
pub(super) fn sphere(n: i32, place: impl Fn(DVec3) -> DVec3) -> Mesh {
    let quarter = std::f64::consts::FRAC_PI_4;
    // Equal angles: the quads are nearly equally large.
    let tan = |x: i32| (quarter * (2.0 * f64::from(x) / f64::from(n) - 1.0)).tan();
    triangles(&cells(IVec3::splat(n), |_| true, |p| place(DVec3::new(tan(p.x), tan(p.y), tan(p.z)).normalize())))
}

/// A prism over an outline (counter-clockwise) with holes (clockwise), between two heights. In triangles.
pub(super) fn extrude(outline: &[DVec2], holes: &[Vec<DVec2>], [bottom, top]: [f64; 2], layers: u32) -> Mesh {
    let rings: Vec<&[DVec2]> = std::iter::once(outline).chain(holes.iter().map(|h| &h[..])).collect();
    let flat: Vec<DVec2> = rings.concat();
    let n = flat.len() as u32;
    let mut mesh = Mesh::default();
    for layer in 0..=layers {
        let z = bottom + (top - bottom) * f64::from(layer) / f64::from(layers);
        mesh.points.extend(flat.iter().map(|p| p.extend(z)));
    }
    let mut start = 0;
    for ring in &rings {
        let len = ring.len() as u32;
        for (layer, k) in (0..layers).flat_map(|layer| (0..len).map(move |k| (layer, k))) {
            let (a, b) = (layer * n + start + k, layer * n + start + (k + 1) % len);
            mesh.faces.push(&[a, b, b + n]);
            mesh.faces.push(&[a, b + n, a + n]);
        }
        start += len;
    }
    let mut lid = Vec::new();
    triangulate(&mesh.points, &keyhole(&rings), &mut lid);
    for [a, b, c] in lid {
        mesh.faces.push(&[a, c, b]);
        mesh.faces.push(&[a, b, c].map(|i| i + layers * n));
    }
    mesh
}

/// One polygon around an outline and, over bridges there and back, around its holes, as indices into all rings' points.
/// Each hole is tied to the nearest corner so far; holes must see it, in the order given.
fn keyhole(rings: &[&[DVec2]]) -> Vec<u32> {
    let flat = rings.concat();
    let mut polygon: Vec<u32> = (0..rings[0].len() as u32).collect();
    let mut start = rings[0].len() as u32;
    for hole in &rings[1..] {
        let len = hole.len() as u32;
        let pairs = (0..polygon.len()).flat_map(|i| (0..len).map(move |k| (i, k)));
        let distance = |(i, k): (usize, u32)| flat[polygon[i] as usize].distance(flat[(start + k) as usize]);
        let (i, k) = pairs.min_by(|&a, &b| distance(a).total_cmp(&distance(b))).expect("rings have corners");
        let round = (0..=len).map(|j| start + (k + j) % len);
        let there: Vec<u32> = std::iter::once(polygon[i]).chain(round).collect();
        polygon.splice(i..i, there);
        start += len;
    }
    polygon
}

/// A full circle or, seen from its centre, an arc between two angles in radians, ends included; `n` steps.
pub(super) fn arc(center: DVec2, radius: f64, [from, to]: [f64; 2], n: u32) -> impl Iterator<Item = DVec2> {
    (0..=n).map(move |k| center + radius * DVec2::from_angle(from + (to - from) * f64::from(k) / f64::from(n)))
}

/// A circle of `n` corners, clockwise: a hole for [`extrude`].
pub(super) fn hole(center: DVec2, radius: f64, n: u32) -> Vec<DVec2> {
    arc(center, radius, [TAU, 0.0], n).take(n as usize).collect()
}

/// A cylinder around the z axis.
pub(super) fn cylinder(radius: f64, height: f64, around: u32, layers: u32) -> Mesh {
    let mut outline = hole(DVec2::ZERO, radius, around);
    outline.reverse();
    extrude(&outline, &[], [-0.5 * height, 0.5 * height], layers)
}

/// The same surface in triangles.
pub(super) fn triangles(mesh: &Mesh) -> Mesh {
    let mut out = Vec::new();
    mesh.faces.iter().for_each(|face| triangulate(&mesh.points, face, &mut out));
    Mesh { points: mesh.points.clone(), faces: out.iter().map(|t| &t[..]).collect() }
}

/// Moves all points.
pub(super) fn moved(mut mesh: Mesh, mut place: impl FnMut(DVec3) -> DVec3) -> Mesh {
    mesh.points.iter_mut().for_each(|p| *p = place(*p));
    mesh
}

/// All meshes in one, nothing welded.
pub(super) fn together(meshes: &[Mesh]) -> Mesh {
    let mut all = Mesh::default();
    for mesh in meshes {
        let shift = all.points.len() as u32;
        all.points.extend_from_slice(&mesh.points);
        for face in mesh.faces.iter() {
            all.faces.push(&face.iter().map(|i| i + shift).collect::<Vec<_>>());
        }
    }
    all
}
