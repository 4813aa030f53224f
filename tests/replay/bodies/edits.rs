//! Editing: whatever is done, the tables are in step, and undoing all restores the mesh bit by bit.

use super::Draw;
use zmend::Mesh;
use zmend::glam::DVec3;
use zmend::mesh::{Edit, FaceId, PointId, sample};

pub(crate) fn operations(bytes: &[u8]) {
    let mut draw = Draw::new(bytes);
    let (name, detail) = draw.one_of(&[("tetrahedron", 1), ("cube", 1), ("plate", 2), ("octahedron", 2)]);
    let start = sample::build(name, detail).expect("a sample");
    let mut edit = Edit::new(&start).expect("a sound mesh");
    if draw.coin() {
        edit.limit_log(1 + draw.below(20));
    }
    let mut done = 0usize;
    while !draw.is_empty() && done < 300 {
        let before = edit.to_mesh();
        let saved = edit.save_point();
        let outcome = operation(&mut draw, &mut edit, &mut done);
        assert_eq!(edit.validate(), Ok(()));
        if outcome.is_err() {
            assert!(edit.save_point() == saved && is_same(&edit.to_mesh(), &before), "what is refused changes nothing");
        }
    }
    // Everything back, and everything again: the same each time.
    let mut all = |step: fn(&mut Edit) -> bool| {
        while step(&mut edit) {}
        assert_eq!(edit.validate(), Ok(()));
        edit.to_mesh()
    };
    let (first, last) = (all(Edit::undo), all(Edit::redo));
    assert!(is_same(&all(Edit::undo), &first), "undoing twice comes to the same");
    assert!(is_same(&all(Edit::redo), &last), "redoing twice comes to the same");
}

fn is_same(a: &Mesh, b: &Mesh) -> bool {
    let bits = |mesh: &Mesh| mesh.points.iter().map(|p| p.to_array().map(f64::to_bits)).collect::<Vec<_>>();
    a.faces == b.faces && bits(a) == bits(b)
}

fn operation(draw: &mut Draw<'_>, edit: &mut Edit, done: &mut usize) -> zmend::Result<()> {
    *done += 1;
    let kind = draw.below(16);
    // Mostly things that are there, now and then such that are not.
    let [a, b, c] = [(); 3].map(|()| PointId(draw.byte().into()));
    let face = FaceId(draw.byte().into());
    let [a, b] = edit.face(face).filter(|_| draw.coin()).map_or([a, b], |corners| [corners[0], corners[1]]);
    let at = DVec3::new(draw.share(), draw.share(), draw.share());
    match kind {
        0 => edit.add_point(at).map(|_| ()),
        1 => edit.move_point(a, at),
        2 => edit.delete_point(c),
        3 => edit.add_face(&[a, c, b]).map(|_| ()),
        4 => edit.delete_face(face),
        5 => edit.turn_face(face),
        6 => edit.flip_edge(a, b),
        7 => edit.split_edge(a, b, at.x).map(|_| ()),
        8 => edit.split_face(face, at).map(|_| ()),
        9 => edit.collapse_edge(a, b),
        10 => edit.merge_points(a, c),
        11 => edit.group(|edit| {
            edit.split_edge(a, b, 0.5)?;
            edit.delete_face(face)?;
            edit.delete_point(c)
        }),
        12 => {
            edit.undo();
            Ok(())
        }
        13 => {
            edit.redo();
            Ok(())
        }
        14 => {
            let point = edit.save_point();
            edit.add_point(at)?;
            edit.undo_to(point)
        }
        _ => edit.move_point(a, DVec3::new(f64::NAN, at.y, at.z)).or(Ok(())),
    }
}
