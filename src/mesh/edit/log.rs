//! What was done, so that it can be taken back.

use super::{Corners, FaceId, PointId};
use glam::DVec3;

/// One thing that became another: what it was, and what it is.
#[derive(Debug, Clone)]
pub(super) enum Change {
    Point(PointId, Option<DVec3>, Option<DVec3>),
    Face(FaceId, Option<Corners>, Option<Corners>),
}

impl Change {
    /// The change back.
    pub(super) fn reversed(self) -> Self {
        match self {
            Change::Point(point, old, new) => Change::Point(point, new, old),
            Change::Face(face, old, new) => Change::Face(face, new, old),
        }
    }
}

/// A place in the history of an [`Edit`](super::Edit).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SavePoint(u64);

/// Changes that are undone together, with a number that no other group has.
#[derive(Debug, Clone)]
struct Group {
    number: u64,
    changes: Vec<Change>,
}

/// Groups that can be undone, and groups that can be redone.
#[derive(Debug, Clone)]
pub(super) struct Log {
    done: Vec<Group>,
    undone: Vec<Group>,
    /// Changes of the group that is open.
    open: Vec<Change>,
    depth: u32,
    /// The number of the last group; the state before all that are known has `bottom`.
    last: u64,
    bottom: u64,
    is_paused: bool,
    pub(super) is_on: bool,
    pub(super) limit: usize,
    pub(super) saved: SavePoint,
}

impl Default for Log {
    fn default() -> Self {
        Log {
            done: Vec::new(),
            undone: Vec::new(),
            open: Vec::new(),
            depth: 0,
            last: 0,
            bottom: 0,
            is_paused: false,
            is_on: true,
            limit: usize::MAX,
            saved: SavePoint(0),
        }
    }
}

impl Log {
    /// Notes a change, if notes are taken.
    pub(super) fn note(&mut self, change: impl FnOnce() -> Change) {
        if self.is_paused {
            return;
        }
        debug_assert!(self.depth > 0, "edits are made in groups");
        // Within a group notes are always taken: it may fail and must be taken back.
        self.open.push(change());
    }

    /// Notes nothing, or goes on. What was before.
    pub(super) fn pause(&mut self, is_paused: bool) -> bool {
        std::mem::replace(&mut self.is_paused, is_paused)
    }

    /// A group begins, maybe within another. How much was noted before.
    pub(super) fn open(&mut self) -> usize {
        self.depth += 1;
        self.open.len()
    }

    /// Takes back all notes of the group from a place on.
    pub(super) fn cut(&mut self, start: usize) -> Vec<Change> {
        self.open.split_off(start)
    }

    /// A group ends. Only if something changed can what was undone not be redone any more.
    pub(super) fn close(&mut self) {
        self.depth -= 1;
        if self.depth > 0 || self.open.is_empty() {
            return;
        }
        self.last += 1;
        self.undone.clear();
        let changes = std::mem::take(&mut self.open);
        if self.is_on {
            self.done.push(Group { number: self.last, changes });
            self.trim();
        } else {
            self.bottom = self.last;
        }
    }

    /// Forgets the oldest groups beyond the limit.
    pub(super) fn trim(&mut self) {
        let excess = self.done.len().saturating_sub(self.limit);
        if let Some(last) = self.done.drain(..excess).next_back() {
            self.bottom = last.number;
        }
    }

    /// Forgets everything.
    pub(super) fn forget(&mut self) {
        self.bottom = self.here().0;
        self.done.clear();
        self.undone.clear();
    }

    /// The changes that take back the last group, in order.
    pub(super) fn back(&mut self) -> Option<Vec<Change>> {
        let group = self.done.pop()?;
        let changes = group.changes.iter().rev().cloned().map(Change::reversed).collect();
        self.undone.push(group);
        Some(changes)
    }

    /// The changes that do the last group again that was taken back.
    pub(super) fn forth(&mut self) -> Option<Vec<Change>> {
        let group = self.undone.pop()?;
        let changes = group.changes.clone();
        self.done.push(group);
        Some(changes)
    }

    /// The place in the history.
    pub(super) fn here(&self) -> SavePoint {
        SavePoint(self.done.last().map_or(self.bottom, |group| group.number))
    }

    /// Whether a place can be reached by undoing.
    pub(super) fn can_reach(&self, point: SavePoint) -> bool {
        point.0 == self.bottom || self.done.iter().any(|group| group.number == point.0)
    }
}
