//! Questions to octrees with the same leaves: the leaf at a point, the neighbours of a leaf.

use super::markdown::{number, table, times};
use super::measure::{measure, on_threads};
use super::pointer_octree::cell_map::{CellMap, HashCells, TreeCells, hash_cells};
use super::pointer_octree::locate::{beside, leaves, locate, sum_over_faces};
use super::pointer_octree::node::{Memory, Tree};
use super::pointer_octree::{scan, sign};
use super::svg::plot;
use super::{Plan, Report, input};
use zmend::grid::key::SIDE;
use zmend::grid::{Face, Key};
use zmend::octree::LinearOctree;

/// Questions asked at once.
const COUNT: usize = 1 << 16;

const SAMPLE: (&str, u32) = ("knot", 2);

/// `SplitMix64`: the same random numbers on every run.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The record of the leaf at a point, in a map of leaves: level after level, from the finest on, where most leaves are.
fn search<M: CellMap<u32>>(map: &M, point: [u32; 3], depth: u32) -> Option<&u32> {
    (0..=depth).rev().find_map(|level| map.get(Key::holding(point, level)?))
}

/// The sum of the records beside a leaf in a map of leaves.
fn around<M: CellMap<u32>>(map: &M, leaf: Key, depth: u32) -> u64 {
    let across = |face: Face| {
        let Some(beside) = leaf.neighbour(face) else { return 0 };
        let level = beside.level().unwrap_or(0);
        let above = (0..=level).rev().find_map(|level| map.get(beside.ancestor(level)));
        above.map_or_else(|| below(map, beside, face, depth), |&record| u64::from(record))
    };
    Face::ALL.into_iter().map(across).sum()
}

/// The sum of the records of the leaves within a cell that touch the side from which one comes.
fn below<M: CellMap<u32>>(map: &M, cell: Key, face: Face, depth: u32) -> u64 {
    if cell.level() >= Some(depth) {
        return 0;
    }
    let touching =
        cell.children().into_iter().filter(|kid| kid.corner_in_parent().is_high(face.axis()) != face.is_high());
    touching.map(|kid| map.get(kid).map_or_else(|| below(map, kid, face, depth), |&record| u64::from(record))).sum()
}

/// What a table shows of one kind of tree.
struct Answers {
    bytes: f64,
    /// Nanoseconds for a point in the cube, a point in a leaf, the neighbours of a leaf anywhere, those of the next leaf.
    times: [f64; 4],
    /// All answers added up: the same for all.
    sums: [u64; 4],
}

/// Where questions are asked.
struct Questions<'q> {
    plan: &'q Plan,
    uniform: &'q [[u32; 3]],
    in_leaves: &'q [[u32; 3]],
    some: &'q [Key],
    all: &'q [Key],
}

impl Questions<'_> {
    fn ask(
        &self,
        bytes: f64,
        locate: impl Fn([u32; 3]) -> u64,
        around: impl Fn(Key) -> u64,
        around_all: impl Fn(&[Key]) -> u64,
    ) -> Answers {
        let sums = [
            self.uniform.iter().map(|&p| locate(p)).sum(),
            self.in_leaves.iter().map(|&p| locate(p)).sum(),
            self.some.iter().map(|&leaf| around(leaf)).sum(),
            around_all(self.all),
        ];
        let effort = self.plan.effort;
        let cpu = |run: &dyn Fn() -> u64| measure(effort, || (), |()| run()).cpu;
        let times = [
            cpu(&|| self.uniform.iter().map(|&p| locate(p)).sum()) / self.uniform.len() as f64,
            cpu(&|| self.in_leaves.iter().map(|&p| locate(p)).sum()) / self.in_leaves.len() as f64,
            cpu(&|| self.some.iter().map(|&leaf| around(leaf)).sum()) / self.some.len() as f64,
            cpu(&|| around_all(self.all)) / self.all.len() as f64,
        ]
        .map(|seconds| 1e9 * seconds);
        Answers { bytes: bytes / self.all.len() as f64, times, sums }
    }

    fn ask_map<M: CellMap<u32>>(&self, map: &M, bytes: f64, depth: u32) -> Answers {
        let locate = |p| search(map, p, depth).map_or(0, |&record| u64::from(record));
        let around = |leaf| around(map, leaf, depth);
        self.ask(bytes, locate, around, |all| all.iter().map(|&leaf| around(leaf)).sum())
    }
}

/// zmend, pointer octree, hash table, ordered map; and the number of leaves.
fn ask_all(plan: &Plan, depth: u32) -> ([Answers; 4], usize) {
    let (mesh, frame) = input(SAMPLE.0, SAMPLE.1, depth);
    let memory = Memory::<()>::default();
    let tree = Tree::new(&memory, depth);
    scan::scan(&tree, &mut &mesh, &frame).expect("in memory");
    sign::sign_all(&tree);
    let places = leaves(&tree);
    let key = |at: [u32; 3], size: u32| Key::cell(depth - size, at.map(|c| c >> size)).expect("a leaf of the tree");
    let all: Vec<Key> = places.iter().map(|place| key(place.at, place.size)).collect();
    let records: Vec<u32> = (0..places.len() as u32).map(|i| i % 1021).collect();
    places.iter().zip(&records).for_each(|(place, &record)| place.leaf.vertex.set(record));
    let [leaf_count, inner] = memory.counts();
    let pointer_bytes = (24 * leaf_count + 88 * inner) as f64;

    let mut state = 8;
    let mut any = |below: u64| random(&mut state) % below;
    let uniform: Vec<[u32; 3]> = (0..COUNT).map(|_| [0; 3].map(|_: u32| any(u64::from(SIDE)) as u32)).collect();
    let some: Vec<Key> = (0..COUNT).map(|_| all[any(all.len() as u64) as usize]).collect();
    let in_leaves: Vec<[u32; 3]> = some.iter().map(|leaf| leaf.center()).collect();
    let questions = Questions { plan, uniform: &uniform, in_leaves: &in_leaves, some: &some, all: &all };

    let shift = 19 - depth;
    let at_leaf = |leaf: Key| (leaf.min_corner().map(|c| c >> shift), depth - leaf.level().unwrap_or(0));
    let pointer = questions.ask(
        pointer_bytes,
        |p| locate(&tree, p.map(|c| c >> shift)).map_or(0, |leaf| u64::from(leaf.vertex.get())),
        |leaf| {
            let ((at, size), mut sum) = (at_leaf(leaf), 0);
            beside(&tree, at, size, &mut |leaf| sum += u64::from(leaf.vertex.get()));
            sum
        },
        |_| sum_over_faces(&tree, |leaf| u64::from(leaf.vertex.get())),
    );
    let entries = || all.iter().copied().zip(records.iter().copied());
    let linear: LinearOctree<u32> = entries().collect();
    let around = |leaf| {
        let across = |face| linear.neighbours(leaf, face).map(|(_, &record)| u64::from(record)).sum::<u64>();
        Face::ALL.into_iter().map(across).sum::<u64>()
    };
    let zmend = questions.ask(
        linear.allocated_bytes() as f64,
        |p| linear.locate(p).map_or(0, |(_, &record)| u64::from(record)),
        around,
        |all| all.iter().map(|&leaf| around(leaf)).sum(),
    );
    let mut hash: HashCells<u32> = hash_cells();
    hash.extend(entries());
    let hash_bytes = hash.allocation_size() as f64;
    let hash = questions.ask_map(&hash, hash_bytes, depth);
    let tree_bytes = measure(super::Effort::QUICK, || (), |()| entries().collect::<TreeCells<u32>>()).live;
    let ordered = questions.ask_map(&entries().collect::<TreeCells<u32>>(), tree_bytes, depth);
    let answers = [zmend, pointer, hash, ordered];
    assert!(answers.iter().all(|other| other.sums == answers[0].sums), "all trees give the same answers");
    (answers, all.len())
}

const QUESTIONS: [&str; 4] = [
    "leaf at a point of the cube",
    "leaf at the centre of a random leaf",
    "neighbours of a random leaf",
    "neighbours of all leaves in turn, a leaf",
];

pub(crate) fn report(plan: &Plan, report: &mut Report) {
    let mut lines: Vec<(String, Vec<(f64, f64)>)> = ["zmend", "pointer octree", "hash entry a leaf", "ordered map"]
        .map(|name| (name.to_owned(), Vec::new()))
        .into();
    let mut last = None;
    for depth in plan.search.clone() {
        let found = on_threads(1, || ask_all(plan, depth));
        for (line, answers) in lines.iter_mut().zip(&found.0) {
            line.1.push((f64::from(depth), answers.times[1]));
        }
        last = Some((depth, found));
    }
    let Some((depth, ([zmend, pointer, hash, ordered], leaves))) = last else { return };
    report.say(format!("### Search and neighbours, depth {depth}\n\n"));
    report.say(format!(
        "Octrees with the same {leaves} leaves of all sizes, which fill the root, and four bytes kept for each (the pointer octree's leaves \
         have room for twenty). How many times as long the others take, then ns:\n\n"
    ));
    let row = |name: &str, of: &dyn Fn(&Answers) -> f64| {
        let base = of(&zmend);
        let mut row = vec![name.to_owned()];
        row.extend([&pointer, &hash, &ordered].map(|answers| times(of(answers) / base)));
        row.extend([&zmend, &pointer, &hash, &ordered].map(|answers| number(of(answers))));
        row
    };
    let mut rows = vec![row("bytes a leaf", &|answers| answers.bytes)];
    rows.extend(QUESTIONS.iter().enumerate().map(|(i, name)| row(name, &|answers| answers.times[i])));
    let head = ["", "pointer", "hash", "ordered", "zmend", "pointer", "hash", "ordered"];
    report.say(table(&head, &rows) + "\n");
    let svg = plot("The leaf at the centre of a random leaf", "depth", "ns", &lines);
    report.plot("search-time.svg", "Time of a search by depth: that of pointers grows most", svg);
}
