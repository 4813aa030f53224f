//! Floods within a brick: which of its 512 points hang together along edges that are open.
//!
//! All words of a plane are filled at once. Along z and y a flood runs through a word by doubling (Kogge and Stone 1973): three
//! steps reach eight points; along x it goes from word to word. One sweep takes some 400 word operations, and a part without
//! too many bends is full after two or three.

use super::brick::{Local, Plane};

/// Bits with z = 7 of a word: there an edge along z leaves the brick.
const Z7: u64 = 0x8080_8080_8080_8080;

/// The points that can be reached from those of `seed` along the edges that `open` has for x, y, z, each at its start. Edges that leave
/// the brick count as closed. Cost: some 400 word operations a sweep; as many sweeps as the way has bends.
#[must_use]
pub fn flooded(seed: Plane, open: &[Plane; 3]) -> Plane {
    let mut points = seed.0;
    loop {
        let before = points;
        for x in 0..7 {
            points[x + 1] |= points[x] & open[0].0[x];
        }
        for x in (0..7).rev() {
            points[x] |= points[x + 1] & open[0].0[x];
        }
        for (x, word) in points.iter_mut().enumerate() {
            *word = along::<8>(*word, open[1].0[x]);
            *word = along::<1>(*word, open[2].0[x] & !Z7);
        }
        if points == before {
            return Plane(points);
        }
    }
}

/// Floods a word both ways along runs of open edges, each at its start, in eight steps of `STEP` bits.
fn along<const STEP: u32>(mut points: u64, open: u64) -> u64 {
    let (mut up, mut down) = (open << STEP, open);
    for step in [STEP, 2 * STEP, 4 * STEP] {
        points |= (points << step & up) | (points >> step & down);
        up &= up << step;
        down &= down >> step;
    }
    points
}

/// All points of a brick in parts: those that hang together along open edges. Ordered by their first points.
///
/// Cost: as [`flooded`] for each part.
pub fn parts(open: &[Plane; 3]) -> impl Iterator<Item = Plane> {
    let mut rest = Plane::FULL;
    std::iter::from_fn(move || {
        let x = rest.0.iter().position(|&word| word != 0)?;
        let mut seed = Plane::EMPTY;
        seed.set(Local::from_index(64 * x as u32 + rest.0[x].trailing_zeros()));
        let part = flooded(seed, open);
        rest &= !part;
        Some(part)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Points one by one, from neighbour to neighbour.
    fn walked(seed: Local, open: &[Plane; 3]) -> Plane {
        let (mut found, mut pending) = (Plane::EMPTY, vec![seed]);
        while let Some(p) = pending.pop() {
            if found.get(p) {
                continue;
            }
            found.set(p);
            for axis in 0..3 {
                let mut c = p.coords();
                if c[axis] < 7 && open[axis].get(p) {
                    c[axis] += 1;
                    pending.push(Local::new(c[0], c[1], c[2]));
                }
                let mut c = p.coords();
                if c[axis] > 0 {
                    c[axis] -= 1;
                    let low = Local::new(c[0], c[1], c[2]);
                    if open[axis].get(low) {
                        pending.push(low);
                    }
                }
            }
        }
        found
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn parts_are_what_a_walk_finds(words in any::<[[[u64; 8]; 3]; 3]>(), dense in 0..3) {
            // Of three random sets, any one, two or all: edges are open with a chance of 7/8, 3/4 or 1/2.
            let open: [Plane; 3] = std::array::from_fn(|axis| {
                (0..=dense as usize).fold(Plane::EMPTY, |a, i| a | Plane(words[i][axis]))
            });
            let mut rest = Plane::FULL;
            for part in parts(&open) {
                let first = rest.iter().next().expect("parts are not empty");
                prop_assert_eq!(part, walked(first, &open));
                rest &= !part;
            }
            prop_assert!(rest.is_empty());
        }
    }

    #[test]
    fn a_winding_way_is_followed() {
        // A snake through all 512 points.
        let mut open = [Plane::EMPTY; 3];
        let mut way: Vec<[u32; 3]> = Vec::new();
        for x in 0..8 {
            for j in 0..8 {
                let y = if x % 2 == 0 { j } else { 7 - j };
                way.extend((0..8).map(|k| [x, y, if (x * 8 + j) % 2 == 0 { k } else { 7 - k }]));
            }
        }
        for pair in way.windows(2) {
            let axis = (0..3).find(|&a| pair[0][a] != pair[1][a]).expect("they differ");
            let low: [u32; 3] = std::array::from_fn(|a| pair[0][a].min(pair[1][a]));
            open[axis].set(Local::new(low[0], low[1], low[2]));
        }
        assert_eq!(parts(&open).collect::<Vec<_>>(), [Plane::FULL]);
    }
}
