//! The edits. Each looks whether it can be done before it does anything.

use super::{Corners, Edit, FaceId, PointId, side};
use crate::error::{Error, Result};
use glam::DVec3;

/// Whether a point can be there.
fn finite(at: DVec3) -> Result<()> {
    if at.is_finite() { Ok(()) } else { refuse(format!("{at} is no place")) }
}

/// The next handle where so many have been given out: they are never used again.
pub(super) fn handle(used: usize) -> Result<u32> {
    let next = u32::try_from(used).ok().filter(|&next| next < u32::MAX);
    next.map_or_else(|| refuse("all handles have been used: make a mesh of it, and edit that".to_owned()), Ok)
}

/// A refusal.
fn refuse<T>(problem: String) -> Result<T> {
    Err(Error::setting("edit", problem, "the mesh is as it was"))
}

impl Edit {
    /// Adds a point.
    ///
    /// # Errors
    /// When a coordinate is not finite, or all 2^32 handles have been used.
    pub fn add_point(&mut self, at: DVec3) -> Result<PointId> {
        let point = PointId(handle(self.points.len())?);
        finite(at)?;
        self.group(|edit| {
            edit.set_point(point, Some(at));
            Ok(point)
        })
    }

    /// Moves a point.
    ///
    /// # Errors
    /// When it is not there, or a coordinate is not finite.
    pub fn move_point(&mut self, point: PointId, to: DVec3) -> Result<()> {
        self.place(point)?;
        finite(to)?;
        self.group(|edit| {
            edit.set_point(point, Some(to));
            Ok(())
        })
    }

    /// Deletes a point.
    ///
    /// # Errors
    /// When it is not there, or a face uses it.
    pub fn delete_point(&mut self, point: PointId) -> Result<()> {
        self.place(point)?;
        if let Some(face) = self.faces_at(point).first() {
            return refuse(format!("face {} uses point {}", face.0, point.0));
        }
        self.group(|edit| {
            edit.set_point(point, None);
            Ok(())
        })
    }

    /// Adds all points and faces of a mesh, as one edit. Returns the handles of its points.
    ///
    /// # Errors
    /// When a point is not finite, or a face cannot be [added](Self::add_face); nothing is added then.
    pub fn add_mesh(&mut self, mesh: &super::Mesh) -> Result<Vec<PointId>> {
        self.group(|edit| {
            let points = mesh.points.iter().map(|&p| edit.add_point(p)).collect::<Result<Vec<_>>>()?;
            // What is not there is told as such.
            let of = |v: &u32| points.get(*v as usize).copied().unwrap_or(PointId(u32::MAX));
            for face in mesh.faces.iter() {
                edit.add_face(&face.iter().map(of).collect::<Vec<_>>())?;
            }
            Ok(points)
        })
    }

    /// Adds a face.
    ///
    /// # Errors
    /// When it has fewer than three corners, one that is not there or that comes twice, or when there is a face over the same cycle,
    /// either way round.
    pub fn add_face(&mut self, corners: &[PointId]) -> Result<FaceId> {
        self.check_face(corners, &[])?;
        let face = FaceId(handle(self.faces.len())?);
        self.group(|edit| {
            edit.set_face(face, Some(corners.into()));
            Ok(face)
        })
    }

    /// Deletes a face. Its points stay.
    ///
    /// # Errors
    /// When it is not there.
    pub fn delete_face(&mut self, face: FaceId) -> Result<()> {
        self.existing(face)?;
        self.group(|edit| {
            edit.set_face(face, None);
            Ok(())
        })
    }

    /// Turns a face over.
    ///
    /// # Errors
    /// When it is not there.
    pub fn turn_face(&mut self, face: FaceId) -> Result<()> {
        let mut corners: Corners = self.existing(face)?.into();
        corners[1..].reverse();
        self.group(|edit| {
            edit.set_face(face, Some(corners));
            Ok(())
        })
    }

    /// Turns the edge between two triangles into the one between their other corners.
    ///
    /// # Errors
    /// When the edge is not one between two triangles that run opposite ways along it, or the other edge is there already.
    pub fn flip_edge(&mut self, a: PointId, b: PointId) -> Result<()> {
        let faces: Vec<FaceId> = self.faces_along(a, b).collect();
        let &[f, g] = &faces[..] else {
            return refuse(format!("edge {}-{} has {} faces, not two", a.0, b.0, faces.len()));
        };
        let (&[_, _, _], &[_, _, _]) = (self.corners(f), self.corners(g)) else {
            return refuse(format!("faces {} and {} are not both triangles", f.0, g.0));
        };
        // From p to q in f, and to the tip.
        let turned = |face: FaceId| {
            let (corners, k) = (self.corners(face), side(self.corners(face), a, b).expect("a face along the edge"));
            [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]]
        };
        let ([p, q, c], [r, _, d]) = (turned(f), turned(g));
        if r != q {
            return refuse(format!("faces {} and {} run the same way", f.0, g.0));
        }
        if c == d || self.faces_along(c, d).next().is_some() {
            return refuse(format!("edge {}-{} is there already", c.0, d.0));
        }
        self.group(|edit| {
            edit.set_face(f, Some(Box::new([p, d, c])));
            edit.set_face(g, Some(Box::new([d, q, c])));
            Ok(())
        })
    }

    /// Puts a point on an edge, at a share of the way from its first end to its second. Triangles there, however many, are cut in two;
    /// other faces get one more corner.
    ///
    /// # Errors
    /// When there is no such edge, or the share is not between 0 and 1.
    pub fn split_edge(&mut self, a: PointId, b: PointId, share: f64) -> Result<PointId> {
        let faces: Vec<FaceId> = self.faces_along(a, b).collect();
        if faces.is_empty() {
            return refuse(format!("there is no edge {}-{}", a.0, b.0));
        }
        if !(share > 0.0 && share < 1.0) {
            return refuse(format!("{share} is not between 0 and 1"));
        }
        let at = self.place(a)?.lerp(self.place(b)?, share);
        self.group(|edit| {
            let middle = edit.add_point(at)?;
            for face in faces {
                let corners = edit.corners(face).to_vec();
                let k = side(&corners, a, b).expect("a face along the edge");
                if let [_, _, _] = corners[..] {
                    let [p, q, c] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
                    edit.set_face(face, Some(Box::new([p, middle, c])));
                    let half = FaceId(edit.faces.len() as u32);
                    edit.set_face(half, Some(Box::new([middle, q, c])));
                } else {
                    edit.set_face(face, Some([&corners[..=k], &[middle], &corners[k + 1..]].concat().into()));
                }
            }
            Ok(middle)
        })
    }

    /// Puts a point in a face, which becomes as many triangles as it has corners.
    ///
    /// # Errors
    /// When the face is not there, or a coordinate is not finite.
    pub fn split_face(&mut self, face: FaceId, at: DVec3) -> Result<PointId> {
        let corners = self.existing(face)?.to_vec();
        self.group(|edit| {
            let middle = edit.add_point(at)?;
            for (k, &p) in corners.iter().enumerate() {
                let part = if k == 0 { face } else { FaceId(edit.faces.len() as u32) };
                edit.set_face(part, Some(Box::new([p, corners[(k + 1) % corners.len()], middle])));
            }
            Ok(middle)
        })
    }

    /// Draws an edge together into its first end, where that leaves a surface a surface: [`merge_points`](Self::merge_points) with the
    /// link condition (Dey et al. 1999): the points next to both ends are the tips of triangles along the edge, and an inner edge does
    /// not join two rims.
    ///
    /// # Errors
    /// When there is no such edge, or the condition does not hold.
    pub fn collapse_edge(&mut self, keep: PointId, gone: PointId) -> Result<()> {
        let faces: Vec<FaceId> = self.faces_along(keep, gone).collect();
        if faces.is_empty() {
            return refuse(format!("there is no edge {}-{}", keep.0, gone.0));
        }
        let tips = faces.iter().filter(|&&face| self.corners(face).len() == 3).count();
        let next = self.connected(keep);
        let common = self.connected(gone).into_iter().filter(|v| next.contains(v)).count();
        let on_rim = |v: PointId| self.connected(v).into_iter().any(|w| self.faces_along(v, w).count() == 1);
        if common != tips || (faces.len() > 1 && on_rim(keep) && on_rim(gone)) {
            return refuse(format!("without edge {}-{} the surface would fold onto itself", keep.0, gone.0));
        }
        self.merge_points(keep, gone)
    }

    /// Makes one point of two: faces of the second become faces of the first, and the second is deleted. Faces that lose a side keep
    /// their other corners; those left with fewer than three, that would visit the point twice, or that are there already, go.
    ///
    /// # Errors
    /// When one is not there, or both are the same.
    pub fn merge_points(&mut self, keep: PointId, gone: PointId) -> Result<()> {
        self.place(keep)?;
        self.place(gone)?;
        if keep == gone {
            return refuse(format!("point {} cannot be merged with itself", keep.0));
        }
        let faces = self.faces_at(gone).to_vec();
        self.group(|edit| {
            for face in faces {
                let mut corners: Vec<PointId> = edit.corners(face).to_vec();
                corners.iter_mut().filter(|v| **v == gone).for_each(|v| *v = keep);
                corners.dedup();
                if corners.len() > 1 && corners.first() == corners.last() {
                    corners.pop();
                }
                let is_good = edit.check_face(&corners, &[face]).is_ok();
                edit.set_face(face, is_good.then(|| corners.into()));
            }
            edit.set_point(gone, None);
            Ok(())
        })
    }

    /// Whether a face may be there, beside all but some.
    fn check_face(&self, corners: &[PointId], but: &[FaceId]) -> Result<()> {
        if corners.len() < 3 {
            return refuse(format!("a face has three corners or more, not {}", corners.len()));
        }
        for (k, &v) in corners.iter().enumerate() {
            self.place(v)?;
            if corners[..k].contains(&v) {
                return refuse(format!("a face visits point {} twice", v.0));
            }
        }
        let n = corners.len();
        let is_same = |other: &[PointId]| {
            let at = other.iter().position(|&v| v == corners[0]);
            other.len() == n
                && at.is_some_and(|at| {
                    (0..n).all(|k| other[(at + k) % n] == corners[k])
                        || (0..n).all(|k| other[(at + n - k) % n] == corners[k])
                })
        };
        let copy = self.faces_at(corners[0]).iter().find(|face| !but.contains(face) && is_same(self.corners(**face)));
        copy.map_or(Ok(()), |face| refuse(format!("face {} goes over the same points", face.0)))
    }

    fn place(&self, point: PointId) -> Result<DVec3> {
        self.point(point).map_or_else(|| refuse(format!("there is no point {}", point.0)), Ok)
    }

    fn existing(&self, face: FaceId) -> Result<&[PointId]> {
        self.face(face).map_or_else(|| refuse(format!("there is no face {}", face.0)), Ok)
    }
}
