//! Floating parts and cavities by size: whole components change sides.
//!
//! A part of the solid that is dropped, or a cavity that is filled, takes all crossings around it away: its points get the sign of what
//! surrounds them, and nothing else changes. Cost: some 10 us a brick.

use super::betti::edges;
use super::complex::{Complex, DEEP, Side};
use super::label::{Labels, SENTINEL};
use crate::grid::brick::Plane;
use crate::grid::{Axis, Extent, Face};
use crate::octree::crossings::{Sample, Toggle, finest_element};
use crate::octree::{EditedOctree, SignedOctree};

/// Components of one side by volume in lattice points (one a cell), ascending: floating parts of the object, cavities of the background.
/// Cost: some 5 us a brick.
pub fn volumes(signed: &SignedOctree, side: Side) -> Vec<u64> {
    let edited = EditedOctree::unedited(signed.clone());
    let complex = Complex::new(&edited, side);
    let labels = Labels::new(&complex, |brick| edges(&complex, brick));
    let volumes = by_set(&complex, &labels);
    let mut list: Vec<u64> = labels.sets().into_iter().map(|set| volumes[set as usize]).collect();
    list.sort_unstable();
    list
}

/// The number of lattice points of each set, by its name.
fn by_set(complex: &Complex, labels: &Labels) -> Vec<u64> {
    let mut volumes: Vec<u64> = labels.deep_bricks().into_iter().map(|bricks| 512 * bricks).collect();
    for brick in 0..complex.bricks() as u32 {
        for (set, part) in labels.parts(brick) {
            volumes[set as usize] += u64::from(points(complex, brick, part).count());
        }
    }
    volumes
}

/// The lattice points that belong to a part, in the complex's own coordinates: for a background, the cells at whose start it lies.
fn points(complex: &Complex, brick: u32, part: &Plane) -> Plane {
    match complex.side() {
        Side::Object => *part,
        Side::Background => *part & complex.live(brick)[Extent::CELL.index()],
    }
}

/// Moves all components of up to `volume` lattice points to the other side: floating parts vanish, cavities are filled. The outside is never
/// filled. Returns the octree and the number of components moved.
pub fn move_small(signed: SignedOctree, side: Side, volume: f64) -> (SignedOctree, u64) {
    let edited = EditedOctree::unedited(signed);
    let complex = Complex::new(&edited, side);
    let labels = Labels::new(&complex, |brick| edges(&complex, brick));
    let volumes = by_set(&complex, &labels);
    let mut small = vec![false; labels.names()];
    let mut moved = 0;
    for set in labels.sets().into_iter().filter(|&set| set != SENTINEL && volumes[set as usize] as f64 <= volume) {
        small[set as usize] = true;
        moved += 1;
    }
    let signed = edited.into_signed();
    if moved == 0 {
        return (signed, 0);
    }
    // The points that change their sign, as the octree's coordinates have them; and, for each axis, whether those of an unlisted brick
    // beyond do.
    let turned = |plane: Plane| if side == Side::Object { plane } else { plane.turned_over() };
    let changing: Vec<(Plane, [bool; 3])> = (0..complex.bricks() as u32)
        .map(|brick| {
            let mut plane = Plane::EMPTY;
            for (_, part) in labels.parts(brick).filter(|(set, _)| small[*set as usize]) {
                plane |= points(&complex, brick, part);
            }
            let beyond = Axis::ALL.map(|axis| {
                let face = Face::new(axis, side == Side::Object);
                complex.beside(brick, face) == DEEP && small[labels.set_beside(&complex, brick, face) as usize]
            });
            (turned(plane), beyond)
        })
        .collect();
    let crossings = signed.crossings();
    let mut toggles = Vec::new();
    for (i, brick) in crossings.bricks().iter().enumerate() {
        let (here, beyond) = &changing[i];
        let origin = crossings.origin(brick);
        for axis in Axis::ALL {
            let next = match brick.key.neighbour(Face::new(axis, true)).and_then(|key| crossings.find(key)) {
                Some(place) => changing[place].0,
                None if beyond[axis.index()] => Plane::FULL,
                None => Plane::EMPTY,
            };
            let edges = brick.crossed[axis.index()] & (*here | here.at_plus(axis, &next));
            toggles.extend(edges.iter().map(|local| {
                let c = local.coords();
                let edge =
                    finest_element(crossings.depth(), std::array::from_fn(|a| origin[a] + c[a]), Extent::from(axis));
                Toggle { edge, sample: Sample::new(1 << 15, 0) }
            }));
        }
    }
    let (crossings, _) = signed.into_parts();
    (SignedOctree::from_crossings(crossings.toggled(toggles)), moved)
}
