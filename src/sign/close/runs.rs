//! The parts into which a plane cuts a ring.

use super::patch::Plane;
use super::rings::{Ring, Step};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

/// Part of a ring on one side of a plane: its last step leaves through the plane.
pub(super) struct Run {
    pub(super) steps: VecDeque<Step>,
    pub(super) before: usize,
    pub(super) after: usize,
    /// Entries in the queue from before the run was joined with others do not count.
    joined: u32,
}

/// The runs of a ring, and which has the nearest ends.
pub(super) struct Runs {
    pub(super) list: Vec<Run>,
    /// Squared distance of the ends (as bits, which have the order of positive numbers), run, how often it had been joined.
    queue: BinaryHeap<Reverse<(u64, usize, u32)>>,
}

impl Runs {
    /// Divides a ring where it goes through the plane. No runs if it does not.
    pub(super) fn new(mut ring: Ring, plane: Plane) -> Runs {
        let leaves = |ring: &Ring, i: usize| plane.parts(ring[i].cell, ring[(i + 1) % ring.len()].cell);
        let mut runs = Runs { list: Vec::new(), queue: BinaryHeap::new() };
        if let Some(last) = (0..ring.len()).rev().find(|&i| leaves(&ring, i)) {
            let start = (last + 1) % ring.len();
            ring.rotate_left(start);
        }
        let mut steps = VecDeque::new();
        for i in 0..ring.len() {
            steps.push_back(ring[i]);
            if leaves(&ring, i) {
                let i = runs.list.len();
                runs.list.push(Run {
                    steps: std::mem::take(&mut steps),
                    before: i.wrapping_sub(1),
                    after: i + 1,
                    joined: 0,
                });
            }
        }
        let n = runs.list.len();
        if n > 0 {
            (runs.list[0].before, runs.list[n - 1].after) = (n - 1, 0);
        }
        (0..n).for_each(|i| runs.enqueue(i));
        runs
    }

    /// The step by which a run leaves through the plane.
    pub(super) fn end(&self, run: usize) -> Step {
        *self.list[run].steps.back().expect("runs have steps")
    }

    fn enqueue(&mut self, run: usize) {
        let distance = self.end(self.list[run].before).exit.distance_squared(self.end(run).exit);
        self.queue.push(Reverse((distance.to_bits(), run, self.list[run].joined)));
    }

    /// The run whose ends lie nearest to each other; the first if there are several.
    pub(super) fn nearest(&mut self) -> Option<usize> {
        loop {
            let Reverse((_, run, joined)) = self.queue.pop()?;
            if !self.list[run].steps.is_empty() && self.list[run].joined == joined {
                return Some(run);
            }
        }
    }

    /// Makes a run and the one after the next, between which a run has been cut off, one.
    pub(super) fn join(&mut self, first: usize, second: usize) {
        let mut steps = std::mem::take(&mut self.list[first].steps);
        let more = &mut self.list[second].steps;
        // The shorter one is moved.
        if steps.len() < more.len() {
            steps.into_iter().rev().for_each(|step| more.push_front(step));
        } else {
            steps.append(more);
            *more = steps;
        }
        let before = self.list[first].before;
        self.list[second].before = before;
        self.list[before].after = second;
        self.list[second].joined += 1;
        self.enqueue(second);
    }
}
