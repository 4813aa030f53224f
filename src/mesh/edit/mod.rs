//! A mesh that can be changed bit by bit, and changed back.
//!
//! # Idea
//!
//! All edits come down to two: a point, or a face, becomes something else, where something may be nothing. Both note what was there
//! before, so undoing is doing the same with old and new exchanged, and a log of these notes is all there is to undo and redo. The faces
//! at each point are kept in step by the same two functions, which nothing goes around.
//!
//! # Invariants
//!
//! - Handles are stable: they name the same point or face for good, also after it was deleted and brought back, and are never used
//!   again.
//! - Faces have three corners or more, all different and all there; no two go over the same cycle. Edits that would break this, or make
//!   no sense, are refused with a reason before anything is changed or noted: a refused edit leaves no trace in the log.
//! - What is deleted holds no memory but its place in a table (25 or 40 bytes) and, while it can be brought back, its note.
//!
//! # Cost
//!
//! Edits take time proportional to the faces at the points they touch. Some 90 bytes a triangle: this is for editing, not for analysis;
//! [`Edit::to_mesh`] gives a [`Mesh`] for that.

mod log;
mod operations;
#[cfg(test)]
mod tests;

pub use log::SavePoint;

use super::Mesh;
use super::star::repeated;
use crate::error::{Error, Result};
use glam::DVec3;
use log::{Change, Log};

/// A point of an [`Edit`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PointId(pub u32);

/// A face of an [`Edit`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FaceId(pub u32);

/// Corners of a face.
type Corners = Box<[PointId]>;

/// A mesh under change.
///
/// ```
/// use zmend::mesh::{Edit, PointId, sample};
///
/// let ball = sample::build("sphere", 1)?;
/// let mut edit = Edit::new(&ball)?;
/// let [a, b] = [0, 1].map(|corner| PointId(ball.faces.get(0)[corner]));
/// let middle = edit.split_edge(a, b, 0.5)?;
/// edit.collapse_edge(a, middle)?;
/// edit.undo();
/// edit.undo();
/// assert_eq!(edit.to_mesh(), ball);
/// # Ok::<(), zmend::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Edit {
    points: Vec<Option<DVec3>>,
    faces: Vec<Option<Corners>>,
    /// The faces at each point, ascending.
    users: Vec<Vec<FaceId>>,
    log: Log,
}

impl Edit {
    /// Takes a mesh; points and faces have the numbers that they have there.
    ///
    /// # Errors
    /// When a face has fewer than three corners, visits a point twice or refers to one that does not exist: [`Mesh::heal`] removes those.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let points: Vec<Option<DVec3>> = mesh.points.iter().map(|&p| Some(p)).collect();
        let mut edit = Edit { users: vec![Vec::new(); points.len()], points, faces: Vec::new(), log: Log::default() };
        for (i, face) in mesh.faces.iter().enumerate() {
            if !mesh.is_sound(face) || repeated(face).is_some() {
                let problem = format!("face {i} is degenerate or has missing points");
                return Err(Error::setting("edit", problem, "heal the mesh before"));
            }
            let id = FaceId(i as u32);
            face.iter().for_each(|&v| edit.users[v as usize].push(id));
            edit.faces.push(Some(face.iter().map(|&v| PointId(v)).collect()));
        }
        Ok(edit)
    }

    /// The mesh as it is now: points and faces in the order of their handles.
    pub fn to_mesh(&self) -> Mesh {
        let mut numbers = vec![0; self.points.len()];
        let mut mesh = Mesh::default();
        for (number, point) in numbers.iter_mut().zip(&self.points) {
            *number = mesh.points.len() as u32;
            mesh.points.extend(point);
        }
        let mut face = Vec::new();
        for corners in self.faces.iter().flatten() {
            face.clear();
            face.extend(corners.iter().map(|v| numbers[v.0 as usize]));
            mesh.faces.push(&face);
        }
        mesh
    }

    /// Where a point is, in model units; none if it is not there.
    pub fn point(&self, point: PointId) -> Option<DVec3> {
        *self.points.get(point.0 as usize)?
    }

    /// The corners of a face; none if it is not there.
    pub fn face(&self, face: FaceId) -> Option<&[PointId]> {
        self.faces.get(face.0 as usize)?.as_deref()
    }

    /// All points that are there, ascending.
    pub fn points(&self) -> impl DoubleEndedIterator<Item = PointId> + '_ {
        (0..self.points.len() as u32).filter(|&i| self.points[i as usize].is_some()).map(PointId)
    }

    /// All faces that are there, ascending.
    pub fn faces(&self) -> impl DoubleEndedIterator<Item = FaceId> + '_ {
        (0..self.faces.len() as u32).filter(|&i| self.faces[i as usize].is_some()).map(FaceId)
    }

    /// The faces at a point, ascending.
    pub fn faces_at(&self, point: PointId) -> &[FaceId] {
        self.users.get(point.0 as usize).map_or(&[], |users| users)
    }

    /// The faces along the edge between two points, ascending.
    pub fn faces_along(&self, a: PointId, b: PointId) -> impl Iterator<Item = FaceId> + '_ {
        self.faces_at(a).iter().copied().filter(move |&face| side(self.corners(face), a, b).is_some())
    }

    /// The points to which edges lead from a point, ascending.
    pub fn connected(&self, point: PointId) -> Vec<PointId> {
        let ends = self.faces_at(point).iter().flat_map(|&face| {
            let corners = self.corners(face);
            let (at, n) = (corners.iter().position(|&v| v == point).expect("a face at the point"), corners.len());
            [corners[(at + 1) % n], corners[(at + n - 1) % n]]
        });
        let mut points: Vec<PointId> = ends.collect();
        points.sort_unstable();
        points.dedup();
        points
    }

    /// Recounts everything and tells the first thing that is out of step, if any. O(n log n).
    ///
    /// # Errors
    /// What is wrong, in words: a bug of this library.
    pub fn validate(&self) -> Result<(), String> {
        let mut users = vec![Vec::new(); self.points.len()];
        for face in self.faces() {
            let corners = self.corners(face);
            for (k, v) in corners.iter().enumerate() {
                if self.point(*v).is_none() || corners[..k].contains(v) {
                    return Err(format!("face {} has corner {} that is not there or twice", face.0, v.0));
                }
                users[v.0 as usize].push(face);
            }
        }
        match (0..users.len()).find(|&v| users[v] != self.users[v]) {
            Some(v) => Err(format!("point {v} is used by {:?}, not by {:?}", users[v], self.users[v])),
            None => Ok(()),
        }
    }

    /// The corners of a face that is there.
    fn corners(&self, face: FaceId) -> &[PointId] {
        self.face(face).expect("tables name only faces that are there")
    }

    /// Makes a point something else, and notes it.
    fn set_point(&mut self, point: PointId, new: Option<DVec3>) {
        let i = point.0 as usize;
        if i == self.points.len() {
            self.points.push(None);
            self.users.push(Vec::new());
        }
        let old = std::mem::replace(&mut self.points[i], new);
        self.log.note(|| Change::Point(point, old, new));
    }

    /// Makes a face something else, keeps the faces at points in step, and notes it.
    fn set_face(&mut self, face: FaceId, new: Option<Corners>) {
        let i = face.0 as usize;
        if i == self.faces.len() {
            self.faces.push(None);
        }
        let old = self.faces[i].take();
        for v in old.iter().flatten() {
            let users = &mut self.users[v.0 as usize];
            let at = users.binary_search(&face).expect("a corner's point knows its face");
            users.remove(at);
        }
        for v in new.iter().flatten() {
            let users = &mut self.users[v.0 as usize];
            let at = users.binary_search(&face).expect_err("a face visits a point once");
            users.insert(at, face);
        }
        self.faces[i].clone_from(&new);
        self.log.note(|| Change::Face(face, old, new));
    }

    /// Does several edits as one: undone and redone together. Groups may contain groups; the outermost counts. When the function fails,
    /// what it has done is undone, and nothing is noted.
    ///
    /// # Errors
    /// Whatever the function returns.
    pub fn group<T>(&mut self, edits: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let start = self.log.open();
        let result = edits(self);
        if result.is_err() {
            let undone = self.log.cut(start);
            undone.into_iter().rev().for_each(|change| self.apply(change.reversed()));
        }
        self.log.close();
        result
    }

    /// Changes without noting.
    fn apply(&mut self, change: Change) {
        let was = self.log.pause(true);
        match change {
            Change::Point(point, _, new) => self.set_point(point, new),
            Change::Face(face, _, new) => self.set_face(face, new),
        }
        self.log.pause(was);
    }

    /// Takes back the last edit or group. Whether there was one.
    pub fn undo(&mut self) -> bool {
        let Some(changes) = self.log.back() else { return false };
        changes.into_iter().for_each(|change| self.apply(change));
        true
    }

    /// Does again what was taken back last. Whether there was anything.
    pub fn redo(&mut self) -> bool {
        let Some(changes) = self.log.forth() else { return false };
        changes.into_iter().for_each(|change| self.apply(change));
        true
    }

    /// Where the log is now.
    pub fn save_point(&self) -> SavePoint {
        self.log.here()
    }

    /// Takes back all that was done since a save point.
    ///
    /// # Errors
    /// When it cannot be reached by undoing; nothing is undone then.
    pub fn undo_to(&mut self, point: SavePoint) -> Result<()> {
        if !self.log.can_reach(point) {
            let problem = "the save point cannot be reached by undoing";
            return Err(Error::setting("edit", problem, "it was undone before, or the log was cleared"));
        }
        while self.save_point() != point {
            self.undo();
        }
        Ok(())
    }

    /// Says that the mesh as it is now was saved.
    pub fn mark_saved(&mut self) {
        self.log.saved = self.log.here();
    }

    /// Whether it is another mesh than when it was made or saved last. Edits that were undone do not count, edits without notes do.
    pub fn is_modified(&self) -> bool {
        self.log.saved != self.log.here()
    }

    /// How many groups of edits are kept at most; older ones can no longer be undone. All, unless it is set.
    pub fn limit_log(&mut self, groups: usize) {
        self.log.limit = groups;
        self.log.trim();
    }

    /// Whether edits are noted. Without notes there is no undo, so what was noted is forgotten.
    pub fn set_logging(&mut self, is_on: bool) {
        if !is_on {
            self.log.forget();
        }
        self.log.is_on = is_on;
    }
}

/// Where a cycle of corners runs along an edge, either way: the number of the first corner of that side.
fn side(corners: &[PointId], a: PointId, b: PointId) -> Option<usize> {
    (0..corners.len()).find(|&k| {
        let next = corners[if k + 1 == corners.len() { 0 } else { k + 1 }];
        (corners[k] == a && next == b) || (corners[k] == b && next == a)
    })
}
