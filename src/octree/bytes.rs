//! A tree as bytes, compact and checked when read; with the feature `serde`, also in any of its formats.
//!
//! ```text
//! "ZOCT"                 4 bytes
//! version                1 byte: 1
//! number of leaves       8 bytes, lowest first
//! of each leaf, in Z-order:
//!   state                1 byte: bits 0 to 4 its level; bit 5 if there is a gap before it; the others 0
//!   gap                  if there is one: between the end of the leaf before (or of nothing) and this one, as a number of cells of the
//!                        finer level of the two, seven bits a byte, lowest first, the highest bit where more follow
//!   record               as the caller writes it
//! ```
//!
//! In a tree without holes a leaf starts where the one before it ends, so that it takes one byte and its record. Keys cannot come
//! out of order, overlap or lie outside the root without being seen.

use super::LinearOctree;
use crate::error::{Error, Place, Result};
use crate::grid::Key;
use crate::grid::key::MAX_LEVEL;

const MAGIC: &[u8; 4] = b"ZOCT";
const VERSION: u8 = 1;
/// The bit of the state of a leaf that says there is a gap before it.
const GAP: u8 = 32;
/// Finest cells in the root.
const END: u64 = 1 << (3 * MAX_LEVEL);

/// Bytes.
impl<T> LinearOctree<T> {
    /// The tree as bytes; `write` appends a record's. O(n). After a version come, for each leaf in Z-order, its level and the gap before it, if there is one.
    ///
    /// ```
    /// use zmend::octree::LinearOctree;
    ///
    /// let tree = LinearOctree::build(2, |_| true, |leaf| leaf.corner_in_parent().index() as u8);
    /// let bytes = tree.to_bytes(|&record, bytes| bytes.push(record));
    /// assert_eq!(bytes.len(), 13 + 2 * 64);
    /// let back = LinearOctree::from_bytes("tree", &bytes, |bytes| bytes.split_off_first().copied())?;
    /// assert_eq!(back, tree);
    /// # Ok::<(), zmend::Error>(())
    /// ```
    pub fn to_bytes(&self, mut write: impl FnMut(&T, &mut Vec<u8>)) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(13 + self.len() * (1 + size_of::<T>()));
        bytes.extend_from_slice(MAGIC);
        bytes.push(VERSION);
        bytes.extend_from_slice(&(self.len() as u64).to_le_bytes());
        let (mut end, mut before) = (0, 0);
        for (leaf, record) in self.iter_z() {
            let level = leaf.level().unwrap_or(MAX_LEVEL);
            let start = first_finest(leaf);
            let gap = (start - end) >> shift(level.max(before));
            bytes.push(level as u8 | if gap > 0 { GAP } else { 0 });
            if gap > 0 {
                push_number(&mut bytes, gap);
            }
            write(record, &mut bytes);
            (end, before) = (start + (1 << shift(level)), level);
        }
        bytes
    }

    /// The tree that [`to_bytes`](LinearOctree::to_bytes) wrote. `read` takes a record's bytes from the front, or says `None` if they
    /// are none. `name` is what errors call the bytes. O(n); no more memory than the bytes account for.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] with the byte at which the bytes are no such tree: another format or version, cut short, leaves of no level or
    /// outside the root, bytes left over, a record that `read` refuses.
    pub fn from_bytes(name: &str, bytes: &[u8], mut read: impl FnMut(&mut &[u8]) -> Option<T>) -> Result<Self> {
        let mut rest = bytes;
        let fail = |rest: &[u8], problem: String, remedy: &str| {
            Error::format(name, Place::Byte((bytes.len() - rest.len()) as u64), problem, remedy)
        };
        let cut =
            |rest: &[u8]| fail(rest, "the octree ends early".to_owned(), "it was not written or copied to its end");
        if rest.split_off(..4) != Some(MAGIC) {
            return Err(fail(bytes, "this is no octree: it does not start with ZOCT".to_owned(), ""));
        }
        let version = *rest.split_off_first().ok_or_else(|| cut(rest))?;
        if version != VERSION {
            return Err(fail(
                rest,
                format!("version {version} of the format is not known"),
                "take a newer zmend to read it",
            ));
        }
        let count =
            rest.split_off(..8).and_then(|n| n.try_into().ok()).map(u64::from_le_bytes).ok_or_else(|| cut(rest))?;
        let mut tree = LinearOctree::new();
        let (mut end, mut before) = (0u64, 0);
        for _ in 0..count {
            let at = rest;
            let state = *rest.split_off_first().ok_or_else(|| cut(at))?;
            let level = u32::from(state & 31);
            if state & !(31 | GAP) != 0 || level > MAX_LEVEL {
                return Err(fail(at, format!("{state} is not the state of a leaf"), ""));
            }
            let gap = if state & GAP != 0 { take_number(&mut rest).ok_or_else(|| cut(at))? } else { 0 };
            let shift_by = shift(level.max(before));
            let is_near = gap <= END >> shift_by;
            let start = if is_near { end + (gap << shift_by) } else { END };
            let size = 1 << shift(level);
            if start % size != 0 || start + size > END {
                return Err(fail(at, format!("no leaf of level {level} is there"), ""));
            }
            let leaf = Key::around(start << 3, level);
            let record = read(&mut rest).ok_or_else(|| fail(at, format!("the record of {leaf} cannot be read"), ""))?;
            tree.insert(leaf, record);
            (end, before) = (start + size, level);
        }
        if !rest.is_empty() {
            return Err(fail(rest, format!("{} bytes are left over after the last leaf", rest.len()), ""));
        }
        tree.shrink_to_fit();
        debug_assert_eq!(tree.validate(), Ok(()));
        Ok(tree)
    }
}

/// log2 of how many finest cells a cell of a level has.
fn shift(level: u32) -> u32 {
    3 * (MAX_LEVEL - level)
}

/// The number of its first finest cell on the Z-order curve.
fn first_finest(leaf: Key) -> u64 {
    leaf.depth_first_rank() >> 8
}

fn push_number(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 128 {
        bytes.push(number as u8 | 128);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Up to nine bytes: 63 bits.
fn take_number(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0;
    for shift in (0..63).step_by(7) {
        let byte = *bytes.split_off_first()?;
        number |= u64::from(byte & 127) << shift;
        if byte < 128 {
            return Some(number);
        }
    }
    None
}

/// With the feature `serde`: the version, and the bits of each key with its record, in Z-order.
#[cfg(feature = "serde")]
mod with_serde {
    use super::{Key, LinearOctree, VERSION};
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Stored<L> {
        version: u8,
        leaves: L,
    }

    impl<T: Serialize> Serialize for LinearOctree<T> {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            let leaves: Vec<(u64, &T)> = self.iter_z().map(|(leaf, record)| (leaf.to_bits(), record)).collect();
            Stored { version: VERSION, leaves }.serialize(serializer)
        }
    }

    impl<'de, T: Deserialize<'de>> Deserialize<'de> for LinearOctree<T> {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            let stored = Stored::<Vec<(u64, T)>>::deserialize(deserializer)?;
            if stored.version != VERSION {
                return Err(D::Error::custom(format!("version {} of the octree is not known", stored.version)));
            }
            let mut tree = LinearOctree::new();
            for (bits, record) in stored.leaves {
                let key = Key::from_bits(bits).ok_or_else(|| D::Error::custom(format!("{bits} is no key")))?;
                if tree.try_insert(key, record).map_err(D::Error::custom)?.is_some() {
                    return Err(D::Error::custom(format!("{key} comes twice")));
                }
            }
            Ok(tree)
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn json_comes_back_and_is_checked() {
            let tree = LinearOctree::build(3, |cell| cell.min_corner() == [0; 3], Key::size);
            let text = serde_json::to_string(&tree).expect("numbers");
            assert_eq!(serde_json::from_str::<LinearOctree<u32>>(&text).expect("as written"), tree);
            let [root, child] = [Key::ROOT, Key::ROOT.children()[3]].map(Key::to_bits);
            let bad = [
                (format!("{{\"version\":9,\"leaves\":[[{root},1]]}}"), "version 9"),
                ("{\"version\":1,\"leaves\":[[12345678901234567890,1]]}".to_owned(), "is no key"),
                (format!("{{\"version\":1,\"leaves\":[[{root},1],[{child},2]]}}"), "lies inside leaf"),
                (format!("{{\"version\":1,\"leaves\":[[{child},1],[{child},2]]}}"), "comes twice"),
            ];
            for (text, message) in bad {
                let error = serde_json::from_str::<LinearOctree<u32>>(&text).expect_err(message).to_string();
                assert!(error.contains(message), "{error}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::oracle::tree;
    use proptest::prelude::*;

    fn read(bytes: &mut &[u8]) -> Option<u64> {
        bytes.split_off(..8)?.try_into().ok().map(u64::from_le_bytes)
    }

    fn written(tree: &LinearOctree<u64>) -> Vec<u8> {
        tree.to_bytes(|record, bytes| bytes.extend_from_slice(&record.to_le_bytes()))
    }

    proptest! {
        #[test]
        fn bytes_come_back(tree in tree(18)) {
            let bytes = written(&tree);
            prop_assert!(bytes.len() <= 13 + tree.len() * (8 + 9));
            prop_assert_eq!(LinearOctree::from_bytes("t", &bytes, read).expect("as written"), tree);
        }

        #[test]
        fn damaged_bytes_are_refused_or_another_tree(tree in tree(9), place: prop::sample::Index, value: u8, cut: bool) {
            let mut bytes = written(&tree);
            let place = place.index(bytes.len());
            if cut {
                bytes.truncate(place);
                let error = LinearOctree::from_bytes("t", &bytes, read).expect_err("cut short").to_string();
                prop_assert!(error.starts_with("t: byte "), "{}", error);
            } else {
                bytes[place] = value;
                if let Ok(other) = LinearOctree::from_bytes("t", &bytes, read) {
                    prop_assert_eq!(other.validate(), Ok(()));
                }
            }
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let tree = LinearOctree::from_iter([(Key::ROOT, 5u64)]);
        let good = written(&tree);
        let wrong = |place: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[place] = byte;
            LinearOctree::from_bytes("a.oct", &bytes, read).expect_err("wrong").to_string()
        };
        assert_eq!(wrong(0, b'x'), "a.oct: byte 0: this is no octree: it does not start with ZOCT");
        assert!(wrong(4, 2).starts_with("a.oct: byte 5: version 2 of the format is not known"));
        assert_eq!(wrong(5, 2), "a.oct: byte 22: the octree ends early; it was not written or copied to its end");
        assert_eq!(wrong(5, 0), "a.oct: byte 13: 9 bytes are left over after the last leaf");
        assert_eq!(wrong(13, 19), "a.oct: byte 13: 19 is not the state of a leaf");
        assert_eq!(wrong(13, 32), "a.oct: byte 13: no leaf of level 0 is there");
    }
}
