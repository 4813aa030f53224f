//! A list that grows without moving what is in it.

use std::borrow::Cow;
use std::ops::{Index, IndexMut, Range};

/// A vector in segments of `2^BITS` elements.
///
/// A plain vector doubles, and while it moves both copies are held; its memory cannot come from what smaller blocks have given back. Here
/// every segment is an allocation of moderate size, so that a long list can grow into the room that another one leaves behind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Segments<T, const BITS: u32> {
    segments: Vec<Vec<T>>,
    len: usize,
}

impl<T, const BITS: u32> Default for Segments<T, BITS> {
    fn default() -> Self {
        Segments { segments: Vec::new(), len: 0 }
    }
}

impl<T, const BITS: u32> Segments<T, BITS> {
    const SIZE: usize = 1 << BITS;

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no element.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Appends an element.
    pub fn push(&mut self, element: T) {
        self.last_segment().push(element);
        self.len += 1;
    }

    /// The segment to append to, with room for at least one element.
    fn last_segment(&mut self) -> &mut Vec<T> {
        if self.len == self.segments.len() * Self::SIZE {
            self.segments.push(Vec::with_capacity(Self::SIZE));
        }
        self.segments.last_mut().expect("there is room, so there is a segment")
    }

    /// The elements in order.
    pub fn iter(&self) -> impl Iterator<Item = &T> + Clone {
        self.segments.iter().flatten()
    }

    /// The elements at some places in order; what is past the end is left out. Only where they lie in several segments they are copied.
    pub fn slice(&self, range: Range<usize>) -> Cow<'_, [T]>
    where
        T: Clone,
    {
        let (first, last) = (range.start >> BITS, range.end.div_ceil(Self::SIZE));
        let segments = self.segments.get(first..last.min(self.segments.len())).unwrap_or_default();
        let part = |i: usize| {
            let (segment, start) = (&segments[i], (first + i) << BITS);
            let end = segment.len().min(range.end - start);
            &segment[range.start.saturating_sub(start).min(end)..end]
        };
        match segments.len() {
            0 => Cow::Borrowed(&[]),
            1 => Cow::Borrowed(part(0)),
            count => Cow::Owned((0..count).flat_map(part).cloned().collect()),
        }
    }

    /// Gives back the room in the last segment that is not used.
    pub fn shrink_to_fit(&mut self) {
        self.segments.shrink_to_fit();
        if let Some(last) = self.segments.last_mut() {
            last.shrink_to_fit();
        }
    }

    /// Bytes held.
    pub fn allocated_bytes(&self) -> usize {
        let Some((last, full)) = self.segments.split_last() else { return 0 };
        self.segments.capacity() * size_of::<Vec<T>>() + (full.len() * Self::SIZE + last.capacity()) * size_of::<T>()
    }
}

/// The elements in order; each segment is given back as soon as it is used up.
impl<T, const BITS: u32> IntoIterator for Segments<T, BITS> {
    type Item = T;
    type IntoIter = std::iter::Flatten<std::vec::IntoIter<Vec<T>>>;

    fn into_iter(self) -> Self::IntoIter {
        self.segments.into_iter().flatten()
    }
}

/// Reads a list from its beginning; each segment is given back as soon as it is used up.
#[derive(Debug)]
pub struct Reader<T> {
    segments: std::vec::IntoIter<Vec<T>>,
    current: Vec<T>,
    at: usize,
}

impl<T: Copy> Reader<T> {
    /// Replaces what is in `out` by the next `count` elements, or as many as there are.
    pub fn read(&mut self, mut count: usize, out: &mut Vec<T>) {
        out.clear();
        while count > 0 {
            if self.at == self.current.len() {
                let Some(next) = self.segments.next() else { return };
                self.current = next;
                self.at = 0;
            }
            let here = count.min(self.current.len() - self.at);
            out.extend_from_slice(&self.current[self.at..self.at + here]);
            self.at += here;
            count -= here;
        }
    }
}

impl<T: Copy, const BITS: u32> Segments<T, BITS> {
    /// So many times the same element.
    pub fn filled(element: T, len: usize) -> Self {
        let sizes = (0..len.div_ceil(Self::SIZE)).map(|i| (len - i * Self::SIZE).min(Self::SIZE));
        Segments { segments: sizes.map(|size| vec![element; size]).collect(), len }
    }

    /// The segments, in order.
    pub fn parts(&self) -> impl Iterator<Item = &[T]> {
        self.segments.iter().map(Vec::as_slice)
    }

    /// The elements, to be read piece by piece.
    pub fn into_reader(self) -> Reader<T> {
        Reader { segments: self.segments.into_iter(), current: Vec::new(), at: 0 }
    }

    /// Appends elements.
    pub fn extend_from_slice(&mut self, mut elements: &[T]) {
        while !elements.is_empty() {
            let segment = self.last_segment();
            let (here, rest) = elements.split_at(elements.len().min(Self::SIZE - segment.len()));
            segment.extend_from_slice(here);
            self.len += here.len();
            elements = rest;
        }
    }
}

impl<T, const BITS: u32> Index<usize> for Segments<T, BITS> {
    type Output = T;
    #[inline]
    fn index(&self, i: usize) -> &T {
        &self.segments[i >> BITS][i & (Self::SIZE - 1)]
    }
}

impl<T, const BITS: u32> IndexMut<usize> for Segments<T, BITS> {
    #[inline]
    fn index_mut(&mut self, i: usize) -> &mut T {
        &mut self.segments[i >> BITS][i & (Self::SIZE - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_list() {
        let plain: Vec<u32> = (0..1000).collect();
        let mut list = Segments::<u32, 4>::default();
        list.push(0);
        list.extend_from_slice(&plain[1..500]);
        plain[500..].iter().for_each(|&x| list.push(x));
        assert_eq!(list.len(), 1000);
        assert!(list.iter().eq(&plain));
        for (a, b) in [(0, 0), (0, 1000), (15, 17), (16, 32), (33, 900), (1000, 1000), (999, 1000)] {
            assert_eq!(*list.slice(a..b), plain[a..b]);
        }
        list[77] = 5;
        assert_eq!((list[77], list[78]), (5, 78));
        assert!(list.allocated_bytes() >= 4000);
        let before = list.allocated_bytes();
        list.shrink_to_fit();
        assert!(list.allocated_bytes() < before && list.iter().eq(&*list.slice(0..1000)));
        let (mut reader, mut part, mut at) = (list.clone().into_reader(), Vec::new(), 0);
        for count in [0, 1, 15, 16, 17, 300, 651, 5] {
            reader.read(count, &mut part);
            assert_eq!(*list.slice(at..at + count), part);
            at += part.len();
        }
        assert!(list.parts().flatten().eq(list.iter()));
        assert!(list.into_iter().skip(78).eq(plain[78..].iter().copied()));
        for len in [0, 15, 16, 17, 100] {
            let list = Segments::<u8, 4>::filled(7, len);
            assert!(list.len() == len && list.iter().eq(&vec![7; len]));
        }
    }
}
