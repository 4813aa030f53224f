use super::*;
use crate::mesh::chance::Chance;

/// Components inside and outside of the trilinear function, on a grid of so many steps.
fn sampled(values: &[f64; 8], steps: usize) -> [usize; 2] {
    let side = steps + 1;
    let value = |i: usize| {
        let at = [i / (side * side), i / side % side, i % side].map(|c| c as f64 / steps as f64);
        Corner::ALL
            .into_iter()
            .map(|corner| {
                let weight = |a: usize| if corner & Axis::ALL[a] { at[a] } else { 1.0 - at[a] };
                values[corner.index()] * weight(0) * weight(1) * weight(2)
            })
            .sum::<f64>()
    };
    let inside: Vec<bool> = (0..side.pow(3)).map(|i| value(i) > 0.0).collect();
    let mut seen = vec![false; inside.len()];
    let mut components = [0; 2];
    for seed in 0..inside.len() {
        if std::mem::replace(&mut seen[seed], true) {
            continue;
        }
        components[usize::from(!inside[seed])] += 1;
        let mut open = vec![seed];
        while let Some(i) = open.pop() {
            for step in [1, side, side * side] {
                let c = i / step % side;
                let mut visit = |j: usize| {
                    if inside[j] == inside[i] && !std::mem::replace(&mut seen[j], true) {
                        open.push(j);
                    }
                };
                if c > 0 {
                    visit(i - step);
                }
                if c + 1 < side {
                    visit(i + step);
                }
            }
        }
    }
    components
}

fn choice_of(values: &[f64; 8]) -> (&'static variants::Variant, [u8; 8]) {
    let mask = (0..8).fold(0, |mask, i| mask | usize::from(values[i] > 0.0) << i);
    let variants = &VARIANTS[mask];
    let choice = variants.faces.iter().rev().fold(0, |bits, &face| bits << 1 | usize::from(is_joined(values, face)));
    (&variants.by_choice[choice], joined(values))
}

/// The same function with its axes exchanged in a circle, and what is joined then, told of the original corners.
fn joined_along(values: &[f64; 8], turns: u32) -> [u8; 8] {
    let turned = |i: usize| (0..turns).fold(i, |i, _| i >> 1 | (i & 1) << 2);
    let joined = joined(&std::array::from_fn(|i| values[turned(i)]));
    let mut least = [7; 8];
    for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))).filter(|&(i, j)| joined[i] == joined[j]) {
        least[turned(i)] = least[turned(i)].min(turned(j) as u8);
    }
    least
}

/// What `decide` says is joined is what a fine grid joins, for every mask; and the surface has as many tunnels as that needs.
#[test]
fn topology_is_that_of_a_refined_grid() {
    let mut chance = Chance(33);
    let (mut compared, mut tunnels, mut unclear) = (0, 0, 0);
    for round in 0..24 {
        for mask in (0..=255u8).filter(|&mask| !VARIANTS[usize::from(mask)].is_plain()) {
            let values: [f64; 8] = std::array::from_fn(|i| {
                // Values of like size have more tunnels.
                let size = [1.0, 0.5, 0.02][round % 3] + chance.unit();
                if mask >> i & 1 == 1 { size } else { -size }
            });
            let (variant, joined) = choice_of(&values);
            for turns in 1..3 {
                assert_eq!(joined_along(&values, turns), joined, "mask {mask} {values:?}");
            }
            let meets = |&&([a, b], _): &&([u8; 2], Patch)| joined[usize::from(a)] == joined[usize::from(b)];
            let meeting = variant.tunnels.iter().filter(meets).count();
            let count = |inside: bool| {
                let is_first = |&i: &usize| usize::from(joined[i]) == i && (mask >> i & 1 == 1) == inside;
                (0..8).filter(is_first).count()
            };
            // Each disc cuts the cell in two; a tunnel joins two of the parts.
            let parts = [count(true), count(false)];
            assert_eq!(
                parts[0] + parts[1] + usize::from(meeting > 0),
                variant.cycles.len() + 1,
                "mask {mask} {values:?}"
            );
            tunnels += meeting;
            if round < 6 {
                // Necks thinner than the step of a grid are not seen by it.
                compared += 1;
                unclear += usize::from(sampled(&values, 16) != parts && sampled(&values, 80) != parts);
            }
        }
    }
    assert!(compared > 700 && tunnels > 30, "{compared} {tunnels}");
    assert!(unclear <= 1, "{unclear} of {compared}");
}
