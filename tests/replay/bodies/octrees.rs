//! The octree of anything: operations against a sorted map, and files of it.

use super::Draw;
use std::collections::BTreeMap;
use zmend::grid::Key;
use zmend::octree::{Balance, LinearOctree};

const BALANCES: [Balance; 4] = [Balance::Off, Balance::Faces, Balance::Edges, Balance::Corners];
/// Leaves from which nothing is split any more.
const MOST_LEAVES: usize = 3000;

type Oracle = BTreeMap<Key, u8>;

/// What [`LinearOctree::from_bytes`] takes is a valid tree, and [`LinearOctree::to_bytes`] writes the same bytes.
pub(crate) fn bytes(bytes: &[u8]) {
    match LinearOctree::from_bytes("fuzzed", bytes, |bytes| bytes.split_off_first().copied()) {
        Ok(tree) => {
            assert_eq!(tree.validate(), Ok(()));
            let again = tree.to_bytes(|&record, bytes| bytes.push(record));
            let back = LinearOctree::from_bytes("fuzzed", &again, |bytes| bytes.split_off_first().copied());
            assert_eq!(back.expect("ours"), tree);
        }
        Err(error) => assert!(error.to_string().starts_with("fuzzed: byte "), "{error}"),
    }
}

/// Any sequence of changes keeps the tree valid and the same as a map from keys to records.
pub(crate) fn operations(bytes: &[u8]) {
    let mut draw = Draw::new(bytes);
    let mut tree = LinearOctree::from_iter([(Key::ROOT, 0u8)]);
    let mut oracle = Oracle::from([(Key::ROOT, 0)]);
    while !draw.is_empty() {
        operation(&mut draw, &mut tree, &mut oracle);
    }
    assert_eq!(tree.validate(), Ok(()));
    assert!(tree.iter_z().map(|(key, &record)| (key, record)).eq(z_order(&oracle)));
    assert!(tree.iter_by_level().all(|(key, record)| oracle.get(&key) == Some(record)));
    let bytes = tree.to_bytes(|&record, bytes| bytes.push(record));
    let back = LinearOctree::from_bytes("ours", &bytes, |bytes| bytes.split_off_first().copied()).expect("ours");
    assert_eq!(back, tree);
}

fn z_order(oracle: &Oracle) -> Vec<(Key, u8)> {
    let mut leaves: Vec<(Key, u8)> = oracle.iter().map(|(&key, &record)| (key, record)).collect();
    leaves.sort_by_key(|leaf| Z(leaf.0));
    leaves
}

/// Z-order of cells that do not overlap, told by their least corners alone: the highest bit that differs decides, x before y before z.
#[derive(PartialEq, Eq)]
struct Z(Key);

impl PartialOrd for Z {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Z {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let (a, b) = (self.0.min_corner(), other.0.min_corner());
        let differs = |axis: usize| a[axis] ^ b[axis];
        let mut first = 0;
        for axis in 1..3 {
            if differs(first) < differs(axis) && differs(first) < (differs(first) ^ differs(axis)) {
                first = axis;
            }
        }
        a[first].cmp(&b[first])
    }
}

/// A cell: a few digits from the root.
fn cell(draw: &mut Draw<'_>) -> Key {
    let mut key = Key::ROOT;
    for _ in 0..draw.below(19) {
        let digit = draw.below(8);
        key = key.children()[digit];
    }
    key
}

/// A leaf, if there is one.
fn leaf(draw: &mut Draw<'_>, oracle: &Oracle) -> Option<Key> {
    let at = draw.word() as usize;
    oracle.keys().nth(at % oracle.len().max(1)).copied()
}

fn overlaps(oracle: &Oracle, cell: Key) -> bool {
    oracle.keys().any(|&leaf| leaf != cell && (leaf.contains(cell) || cell.contains(leaf)))
}

fn operation(draw: &mut Draw<'_>, tree: &mut LinearOctree<u8>, oracle: &mut Oracle) {
    let kind = draw.below(8);
    let record = draw.byte();
    let balance = BALANCES[usize::from(record) % 4];
    match kind {
        0 => {
            let cell = cell(draw);
            let is_free = !overlaps(oracle, cell);
            match tree.try_insert(cell, record) {
                Ok(old) => {
                    assert!(is_free, "{cell:?} overlaps");
                    assert_eq!(old, oracle.insert(cell, record));
                }
                Err(_) => assert!(!is_free, "{cell:?} is free"),
            }
        }
        1 => {
            if let Some(leaf) = leaf(draw, oracle) {
                assert_eq!(tree.remove(leaf), oracle.remove(&leaf));
            }
            let cell = cell(draw);
            assert_eq!(tree.remove(cell), oracle.remove(&cell));
        }
        2 => {
            if let Some(leaf) = leaf(draw, oracle).filter(|_| oracle.len() < MOST_LEAVES) {
                let _ = tree.refine(leaf, balance, |_, record| record.wrapping_add(1));
                *oracle = tree.iter().map(|(key, &record)| (key, record)).collect();
                assert_eq!(tree.validate(), Ok(()));
            }
        }
        3 => {
            if let Some(leaf) = leaf(draw, oracle).filter(|leaf| leaf.level() < Some(18))
                && tree.refine_strict(leaf, balance, |_, record| record.wrapping_add(2)).is_ok()
            {
                let old = oracle.remove(&leaf).expect("a leaf");
                oracle.extend(leaf.children().map(|child| (child, old.wrapping_add(2))));
            }
        }
        4 => {
            if let Some(parent) = leaf(draw, oracle).and_then(Key::parent)
                && tree.coarsen(parent, balance, |records| records.into_iter().fold(0, u8::wrapping_add)).is_ok()
            {
                let records = parent.children().map(|child| oracle.remove(&child).expect("a family"));
                oracle.insert(parent, records.into_iter().fold(0, u8::wrapping_add));
            }
        }
        5 => {
            if oracle.len() < MOST_LEAVES / 8 {
                tree.balance(balance, |_, record| record.wrapping_add(3));
                assert_eq!(tree.imbalance(balance), None);
                assert_eq!(tree.balance(balance, |_, &record| record), 0, "balancing twice is balancing once");
                *oracle = tree.iter().map(|(key, &record)| (key, record)).collect();
            }
        }
        6 => {
            let keep = |key: Key, record: u8| !(key.to_bits() >> 7 ^ u64::from(record)).is_multiple_of(8);
            tree.retain(|key, record| keep(key, *record));
            oracle.retain(|&key, record| keep(key, *record));
        }
        _ => {
            let point = [(); 3].map(|()| u32::from(draw.word()) << 2);
            let holds = |leaf: Key| {
                let min = leaf.min_corner();
                (0..3).all(|i| (min[i]..min[i] + leaf.size()).contains(&point[i]))
            };
            let found = tree.locate(point).map(|(leaf, &record)| (leaf, record));
            let expected = oracle.iter().find(|(leaf, _)| holds(**leaf)).map(|(&leaf, &record)| (leaf, record));
            assert_eq!(found, expected);
        }
    }
    assert_eq!(tree.len(), oracle.len());
}
