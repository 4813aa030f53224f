//! Laws of editing, and the bugs that others had.

use super::*;
use crate::mesh::chance::Chance;
use crate::mesh::sample;
use proptest::prelude::*;

fn edit(name: &str) -> Edit {
    Edit::new(&sample::build(name, 1).unwrap()).unwrap()
}

/// Does something by chance, which may be refused.
fn anything(edit: &mut Edit, chance: &mut Chance) -> Result<()> {
    let mut any = |n: usize| (chance.unit() * (n + 1) as f64) as u32;
    let [a, b, c] = [0; 3].map(|_| PointId(any(edit.points.len())));
    let face = FaceId(any(edit.faces.len()));
    // Mostly something that makes sense: an edge of the face.
    let [a, b] = edit.face(face).map_or([a, b], |corners| [corners[0], corners[1]]);
    let at = chance.within_cube(2.0);
    match (chance.unit() * 12.0) as u32 {
        0 => edit.add_point(at).map(|_| ()),
        1 => edit.move_point(a, at),
        2 => edit.delete_point(c),
        3 => edit.add_face(&[a, c, b]).map(|_| ()),
        4 => edit.delete_face(face),
        5 => edit.turn_face(face),
        6 => edit.flip_edge(a, b),
        7 => edit.split_edge(a, b, 0.25).map(|_| ()),
        8 => edit.split_face(face, at).map(|_| ()),
        9 => edit.collapse_edge(a, b),
        10 => edit.merge_points(a, c),
        _ => edit.group(|edit| {
            edit.split_edge(a, b, 0.5)?;
            edit.delete_face(face)?;
            edit.delete_point(c)
        }),
    }
}

/// The points' bits, the faces, and both as a mesh.
type State = (Vec<Option<[u64; 3]>>, Vec<Option<Corners>>, Mesh);

/// Everything that can be seen of an edit.
fn state(edit: &Edit) -> State {
    let bits = |p: &Option<DVec3>| p.map(|p| p.to_array().map(f64::to_bits));
    (edit.points.iter().map(bits).collect(), edit.faces.clone(), edit.to_mesh())
}

/// What is there, without the places of what is not.
fn seen(edit: &Edit) -> State {
    let (mut points, mut faces, mesh) = state(edit);
    points.truncate(points.iter().rposition(Option::is_some).map_or(0, |i| i + 1));
    faces.truncate(faces.iter().rposition(Option::is_some).map_or(0, |i| i + 1));
    (points, faces, mesh)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn undo_restores_the_mesh_and_redo_repeats_it(seed in 0u64..1_000_000, name in 0usize..3, steps in 1usize..60) {
        let (name, detail) = [("cube", 1), ("plate", 2), ("cube", 3)][name];
        let mut edit = Edit::new(&sample::build(name, detail).unwrap()).unwrap();
        let mut chance = Chance(seed);
        let mut states = vec![seen(&edit)];
        for _ in 0..steps {
            let before = (state(&edit), edit.save_point());
            match anything(&mut edit, &mut chance) {
                Ok(()) => states.push(seen(&edit)),
                Err(_) => prop_assert!(edit.save_point() == before.1 && seen(&edit) == *states.last().unwrap()),
            }
            prop_assert_eq!(edit.validate(), Ok(()));
        }
        for round in 0..2 {
            for k in (0..states.len() - 1).rev() {
                prop_assert!(edit.undo());
                prop_assert!(seen(&edit) == states[k], "undo to {} in round {}", k, round);
                prop_assert_eq!(edit.validate(), Ok(()));
            }
            prop_assert!(!edit.undo() && !edit.is_modified());
            for state in &states[1..] {
                prop_assert!(edit.redo());
                prop_assert!(seen(&edit) == *state);
            }
            prop_assert!(!edit.redo() && edit.is_modified() == (states.len() > 1));
        }
    }
}

#[test]
fn edits_keep_a_surface_a_surface() {
    let mut edit = edit("sphere");
    let mut chance = Chance(9);
    for _ in 0..3000 {
        let face = FaceId((chance.unit() * edit.faces.len() as f64) as u32);
        let Some(&[a, b, c]) = edit.face(face) else { continue };
        // Whatever is refused, is refused for a reason.
        let _ = match (chance.unit() * 4.0) as u32 {
            0 => edit.flip_edge(a, b),
            1 => edit.split_edge(b, c, 0.5).map(|_| ()),
            2 => edit.split_face(face, edit.point(a).unwrap()).map(|_| ()),
            _ => edit.collapse_edge(c, a),
        };
    }
    let mesh = edit.to_mesh();
    let report = mesh.report();
    assert_eq!((mesh.validate(), report.genus, report.components), (Ok(()), Some(0), 1));
    assert_ne!(mesh.faces.len(), sample::build("sphere", 1).unwrap().faces.len());
}

/// Bug C4.6: a deletion that was refused left an entry in the log, and there was no redo any more.
#[test]
fn a_refused_edit_leaves_redo_alone() {
    let mut edit = edit("cube");
    let first = edit.faces().next().unwrap();
    edit.delete_face(first).unwrap();
    edit.undo();
    let corner = edit.face(first).unwrap()[0];
    assert!(edit.delete_point(corner).unwrap_err().to_string().contains("uses point"));
    assert!(edit.group(|edit| edit.delete_point(corner)).is_err());
    // An empty group is nothing either.
    edit.group(|_| Ok(())).unwrap();
    assert!(!edit.is_modified() && edit.redo() && edit.face(first).is_none());
}

/// Bug C4.7: without a log, what was deleted stayed for ever.
#[test]
fn without_a_log_what_is_deleted_is_gone() {
    let mut edit = edit("cube");
    edit.set_logging(false);
    let face = edit.faces().next().unwrap();
    edit.delete_face(face).unwrap();
    assert!(edit.faces[face.0 as usize].is_none() && !edit.undo() && edit.is_modified());
    // A group that fails is taken back all the same.
    let other = edit.faces().next().unwrap();
    let before = edit.to_mesh();
    let failed = edit.group(|edit| {
        edit.delete_face(other)?;
        edit.delete_face(other)
    });
    assert!(failed.is_err() && edit.to_mesh() == before);
}

/// Bug C4.8: reading a mesh into one that is edited went past the log, which had no bounds.
#[test]
fn a_mesh_that_is_added_can_be_undone() {
    let mut edit = edit("cube");
    let (before, start) = (edit.to_mesh(), edit.save_point());
    let ball = sample::build("sphere", 1).unwrap();
    let points = edit.add_mesh(&ball).unwrap();
    assert_eq!((points.len(), edit.points().count()), (ball.points.len(), ball.points.len() + before.points.len()));
    let both = edit.to_mesh();
    assert!(edit.is_modified() && edit.undo() && edit.save_point() == start && edit.to_mesh() == before);
    assert!(edit.redo() && edit.to_mesh() == both && edit.validate().is_ok());
    // A mesh that cannot be added leaves nothing behind.
    let bad = Mesh { points: vec![DVec3::ZERO; 3], faces: [&[0, 1, 2][..], &[0, 1, 7]].into_iter().collect() };
    assert!(edit.add_mesh(&bad).unwrap_err().to_string().contains("no point"));
    assert!(edit.to_mesh() == both && edit.undo() && !edit.undo());
    // A log with bounds.
    edit.limit_log(3);
    (0..9).for_each(|_| drop(edit.add_mesh(&ball).unwrap()));
    assert_eq!((0..9).filter(|_| edit.undo()).count(), 3);
}

/// Bug C4.13: handles ran over when all had been used, and refusals gave no reason.
#[test]
fn handles_do_not_run_over_and_refusals_have_reasons() {
    let mut edit = edit("cube");
    let first = edit.add_point(DVec3::ZERO).unwrap();
    assert!(edit.undo() && edit.add_point(DVec3::ONE).unwrap() > first && edit.point(first).is_none());
    for refusal in [
        operations::handle(u32::MAX as usize).unwrap_err(),
        operations::handle(usize::MAX).unwrap_err(),
        edit.delete_point(PointId(99)).unwrap_err(),
        edit.delete_face(FaceId(99)).unwrap_err(),
        edit.move_point(first, DVec3::NAN).unwrap_err(),
        edit.flip_edge(first, PointId(0)).unwrap_err(),
    ] {
        assert!(refusal.to_string().len() > 20, "{refusal}");
    }
}

/// Bug C4.9: going through the faces backwards while deleting them moved the wrong cursor.
#[test]
fn faces_can_be_deleted_on_the_way_in_both_directions() {
    for backwards in [false, true] {
        let mut edit = edit("cube");
        let faces: Vec<FaceId> = if backwards { edit.faces().rev().collect() } else { edit.faces().collect() };
        assert_eq!(faces.len(), 6);
        assert_eq!(faces.is_sorted(), !backwards);
        faces.into_iter().for_each(|face| edit.delete_face(face).unwrap());
        assert_eq!(edit.faces().count(), 0);
        let points: Vec<PointId> = edit.points().rev().collect();
        points.into_iter().for_each(|point| edit.delete_point(point).unwrap());
        assert_eq!(edit.to_mesh(), Mesh::default());
    }
}

/// Bug C4.11: faces were taken without looking.
#[test]
fn faces_are_looked_at() {
    let mut edit = edit("cube");
    let corners = edit.face(FaceId(0)).unwrap().to_vec();
    let [a, b, c, d] = corners[..] else { unreachable!("a quad") };
    for (bad, says) in [
        (vec![], "three corners"),
        (vec![a, b], "three corners"),
        (vec![a, b, a], "twice"),
        (vec![a, b, PointId(99)], "no point 99"),
        (vec![c, b, a, d], "same points"),
    ] {
        let message = edit.add_face(&bad).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    }
    assert!(!edit.is_modified());
    assert!(
        edit.move_point(a, DVec3::NAN).is_err()
            && edit.split_edge(a, c, 0.5).is_err()
            && edit.split_edge(a, b, 1.0).is_err()
    );
    let degenerate = Mesh { points: vec![DVec3::ZERO; 2], faces: [&[0, 1, 0][..]].into_iter().collect() };
    assert!(Edit::new(&degenerate).is_err());
}

#[test]
fn groups_and_save_points() {
    let mut edit = edit("plate");
    let start = edit.save_point();
    let corner = edit.points().next().unwrap();
    edit.group(|edit| {
        edit.move_point(corner, DVec3::ONE)?;
        edit.group(|edit| edit.move_point(corner, DVec3::X))?;
        edit.move_point(corner, DVec3::Y)
    })
    .unwrap();
    edit.mark_saved();
    let middle = edit.save_point();
    (0..5).for_each(|i| edit.move_point(corner, f64::from(i) * DVec3::Z).unwrap());
    let late = edit.save_point();
    assert!(edit.is_modified());
    edit.undo_to(middle).unwrap();
    assert!(!edit.is_modified() && edit.point(corner) == Some(DVec3::Y));
    assert!(edit.undo_to(late).is_err());
    // The group is one step.
    assert!(edit.undo() && edit.save_point() == start && !edit.undo() && edit.is_modified());
    // Something else: what was undone cannot be reached any more.
    edit.move_point(corner, DVec3::ZERO).unwrap();
    assert!(edit.undo_to(middle).is_err() && !edit.redo());
    edit.limit_log(2);
    (0..5).for_each(|i| edit.move_point(corner, f64::from(i) * DVec3::Z).unwrap());
    assert!(edit.undo() && edit.undo() && !edit.undo() && edit.undo_to(start).is_err());
}
