//! Components of signs: against a flood over a dense grid, and against the surfaces extracted from the signs.

mod common;

use common::check;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use zmend::Mesh;
use zmend::contour::{DualOptions, Intersections, Placement, dual_contouring, marching_cubes};
use zmend::geom::Frame;
use zmend::glam::DVec3;
use zmend::grid::Key;
use zmend::grid::brick::{Local, Plane};
use zmend::octree::SignedOctree;
use zmend::octree::components::{Component, Components};
use zmend::octree::crossings::{Sample, lattice_point};
use zmend::progress::Silent;
use zmend::sign::{Keep, keep};

const DEPTH: u32 = 5;
const SIDE: u32 = 1 << DEPTH;

/// Signs of all lattice points of a small grid; points on the boundary of the root are outside.
#[derive(Clone, PartialEq)]
struct Dense(Vec<bool>);

impl fmt::Debug for Dense {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries((0..self.0.len()).filter(|&i| self.0[i]).map(point)).finish()
    }
}

fn point(i: usize) -> [u32; 3] {
    [i as u32 >> (2 * DEPTH), i as u32 >> DEPTH & (SIDE - 1), i as u32 & (SIDE - 1)]
}

fn index(p: [u32; 3]) -> usize {
    ((p[0] << (2 * DEPTH)) + (p[1] << DEPTH) + p[2]) as usize
}

impl Dense {
    fn new(inside: impl Fn([u32; 3]) -> bool) -> Self {
        Dense((0..1 << (3 * DEPTH)).map(point).map(|p| p.iter().all(|&c| c > 0) && inside(p)).collect())
    }

    fn octree(&self) -> SignedOctree {
        let mut signs: Vec<(Key, Plane)> = Vec::new();
        let bricks = SIDE >> 3;
        for i in 0..bricks.pow(3) {
            let key =
                Key::cell(DEPTH - 3, [i / bricks / bricks, i / bricks % bricks, i % bricks]).expect("in the root");
            let mut plane = Plane::EMPTY;
            let origin = lattice_point(DEPTH, key);
            for p in (0..512).map(Local::from_index) {
                if self.0[index(std::array::from_fn(|a| origin[a] + p.coords()[a]))] {
                    plane.set(p);
                }
            }
            signs.push((key, plane));
        }
        signs.sort_unstable_by_key(|s| s.0);
        // The builder drops bricks without crossings: rows get gaps, inside and outside.
        SignedOctree::from_signs(
            DEPTH,
            true,
            &signs,
            |_| false,
            |_, crossed, out| {
                out.resize(
                    crossed.iter().map(Plane::count).sum::<u32>() as usize,
                    Sample { offset: 1 << 15, normal: 127 << 8 | 127 },
                );
            },
        )
    }

    /// Number of the component of each point, by a walk from point to point: 0 for what reaches infinity.
    fn components(&self) -> Vec<usize> {
        let mut number = vec![usize::MAX; self.0.len()];
        let mut next = 0;
        for seed in 0..self.0.len() {
            if number[seed] != usize::MAX {
                continue;
            }
            let mut pending = vec![seed];
            if seed == 0 {
                // Beyond the last points of the grid is the outer space.
                pending.extend((0..self.0.len()).filter(|&i| !self.0[i] && point(i).contains(&(SIDE - 1))));
            }
            while let Some(i) = pending.pop() {
                if std::mem::replace(&mut number[i], next) != usize::MAX {
                    continue;
                }
                for step in (0..27).map(|n| [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1i32]) {
                    let far = step.iter().map(|s| s.abs()).sum::<i32>();
                    if far == 0 || (self.0[i] && far > 1) {
                        continue;
                    }
                    let p: [u32; 3] = std::array::from_fn(|a| point(i)[a].wrapping_add_signed(step[a]));
                    if p.iter().all(|&c| c < SIDE) && self.0[index(p)] == self.0[i] && number[index(p)] == usize::MAX {
                        pending.push(index(p));
                    }
                }
            }
            next += 1;
        }
        number
    }

    fn list(&self) -> Vec<Component> {
        let number = self.components();
        let mut list = vec![Component::default(); number.iter().max().expect("points") + 1];
        for i in 0..self.0.len() {
            let component = &mut list[number[i]];
            component.is_inside = self.0[i];
            component.points += u64::from(number[i] > 0);
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut p = point(i);
                    p[axis] = p[axis].wrapping_add_signed(step);
                    if p[axis] < SIDE {
                        list[number[i]].edges += u64::from(self.0[index(p)] != self.0[i]);
                    } else if self.0[i] {
                        list[number[i]].edges += 1;
                        list[0].edges += 1;
                    }
                }
            }
        }
        list
    }
}

/// Balls, hollow and solid, and single points.
fn signs() -> impl Strategy<Value = Dense> {
    let ball = (prop::array::uniform3(0i32..32), 1i32..140, any::<bool>());
    let dust = prop::collection::vec(0usize..1 << (3 * DEPTH), 0..120);
    (prop::collection::vec(ball, 0..7), dust).prop_map(|(balls, dust)| {
        let mut dense = Dense::new(|p| {
            balls.iter().fold(false, |inside, (centre, square, fills)| {
                let d = (0..3).map(|a| (p[a] as i32 - centre[a]).pow(2)).sum::<i32>();
                if d <= *square { *fills } else { inside }
            })
        });
        for i in dust {
            dense.0[i] = !dense.0[i] && point(i).iter().all(|&c| c > 0);
        }
        dense
    })
}

fn surfaces(octree: &SignedOctree) -> Vec<Mesh> {
    let frame = Frame::new(DVec3::ZERO, 1.0, DEPTH).expect("a frame");
    let (mut mc, mut dc) = (Mesh::default(), Mesh::default());
    marching_cubes(octree, &frame, &mut mc, &Silent).expect("in memory");
    let options =
        DualOptions { placement: Placement::MassPoint, triangles: false, intersections: Intersections::Allow };
    dual_contouring(octree, &frame, &options, &mut dc, &Silent).expect("in memory");
    vec![mc, dc]
}

fn config() -> ProptestConfig {
    ProptestConfig { cases: 150, rng_seed: RngSeed::Fixed(3), failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn components_are_those_of_a_dense_flood(dense in signs()) {
        let octree = dense.octree();
        let found = Components::new(&octree);
        let mut expected = dense.list();
        prop_assert_eq!(found.list()[0], expected.remove(0));
        let sorted = |list: &[Component]| {
            let mut list: Vec<_> = list.iter().map(|c| (c.is_inside, c.edges, c.points)).collect();
            list.sort_unstable();
            list
        };
        prop_assert_eq!(sorted(&found.list()[1..]), sorted(&expected));
    }

    /// A surface has a component for each solid and each cavity, whatever extracts it.
    #[test]
    fn surfaces_have_as_many_components_as_signs(dense in signs()) {
        let octree = dense.octree();
        let components = Components::new(&octree);
        let number = (components.solids().count() + components.cavities().count()) as u64;
        for mesh in surfaces(&octree) {
            prop_assert_eq!(check(&mesh).expect("a sound surface").components, number);
        }
    }

    /// What is dropped is gone, what stays keeps its signs, samples and nothing else.
    #[test]
    fn dropping_leaves_the_rest_alone(dense in signs(), count in 1u32..4, ratio in 0.0..1.0, drop_cavities: bool) {
        let octree = dense.octree();
        let before = dense.list();
        let mut sizes: Vec<u64> = before.iter().filter(|c| c.is_inside).map(|c| c.edges).collect();
        sizes.sort_unstable_by(|a, b| b.cmp(a));
        let number = dense.components();
        for choice in [Keep::All, Keep::Largest, Keep::Count(count), Keep::Ratio(ratio)] {
            let (after, kept) = keep(octree.clone(), choice, drop_cavities, &Silent).expect("in range");
            prop_assert_eq!(after.validate(), Ok(()));
            let least = match choice {
                Keep::All => 0,
                Keep::Largest => sizes.first().copied().unwrap_or(0),
                Keep::Ratio(ratio) => (sizes.first().copied().unwrap_or(0) as f64 * ratio) as u64,
                Keep::Count(n) => sizes.get(n as usize - 1).copied().unwrap_or(0),
            };
            let left = Dense::new(|p| after.is_inside(p));
            let mut lost = BTreeSet::new();
            for i in 0..dense.0.len() {
                let component = &before[number[i]];
                if dense.0[i] && !left.0[i] {
                    prop_assert!(component.edges <= least);
                    lost.insert(number[i]);
                }
                prop_assert!(!dense.0[i] || left.0[i] || lost.contains(&number[i]));
                prop_assert!(dense.0[i] || !left.0[i] || drop_cavities);
            }
            if drop_cavities {
                prop_assert_eq!(Components::new(&after).cavities().count(), 0);
            } else {
                let stay = before.iter().filter(|c| c.is_inside).count() - lost.len();
                let expected = match choice {
                    Keep::Count(n) => sizes.len().min(n as usize),
                    _ => sizes.iter().filter(|&&s| s >= least).count(),
                };
                prop_assert_eq!(stay, expected);
                prop_assert_eq!(kept.dropped_solids as usize, if choice == Keep::All { 0 } else { lost.len() });
            }
        }
    }
}

#[test]
fn a_ball_in_a_hollow_ball_is_two_solids() {
    let square = |p: [u32; 3]| p.iter().map(|&c| (c as i32 - 16).pow(2)).sum::<i32>();
    let dense = Dense::new(|p| matches!(square(p), 0..=25 | 82..=196));
    let octree = dense.octree();
    let mut by_kind = BTreeMap::new();
    Components::new(&octree).list().iter().for_each(|c| *by_kind.entry(c.is_inside).or_insert(0) += 1);
    assert_eq!(by_kind, [(false, 2), (true, 2)].into());
    let (largest, kept) = keep(octree.clone(), Keep::Largest, false, &Silent).expect("in range");
    assert_eq!((kept.solids, kept.dropped_solids, kept.cavities, kept.filled_cavities), (2, 1, 1, 0));
    assert_eq!(check(&surfaces(&largest)[0]).expect("a hollow ball").components, 2);
    let (full, kept) = keep(octree, Keep::Largest, true, &Silent).expect("in range");
    assert_eq!((kept.filled_cavities, Dense::new(|p| full.is_inside(p))), (1, Dense::new(|p| square(p) <= 196)));
}

#[test]
fn choices_that_keep_nothing_are_refused() {
    let octree = Dense::new(|_| false).octree();
    for bad in [Keep::Ratio(1.5), Keep::Ratio(-0.1), Keep::Ratio(f64::NAN), Keep::Count(0)] {
        assert!(keep(octree.clone(), bad, false, &Silent).unwrap_err().to_string().contains("largest"), "{bad:?}");
    }
    assert_eq!(keep(octree, Keep::Largest, true, &Silent).expect("in range").1.solids, 0);
}
