//! A glTF file behind the window: it moves, it can be edited, and what is saved is a scene file with its meshes.

use super::model::{bench, robot};
use super::picture_place;
use glam::DVec3;
use shadow_fields::scene::Scene;
use shadow_fields::view::{Command, Editor};

#[test]
fn a_gltf_file_is_edited_and_saved_as_a_scene_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = robot().write(folder.path(), "robot");
    let mut editor = Editor::new(Scene::load(&path).unwrap(), &path);
    let start = editor.placements().to_vec();
    // The dim sky beside the file's lamp has no sun.
    assert_eq!((editor.scene().data.entities.len(), start.len()), (5, 5));
    assert!(editor.advance(0.75).changed.placements);
    for (index, (before, after)) in start.iter().zip(editor.placements()).enumerate() {
        assert_eq!(*before != after, index < 3, "entity {index}");
    }
    // The hand is moved: at all times, and nothing else.
    let unmoved = editor.scene().at(1.3);
    (0..3).for_each(|_| drop(editor.apply(Command::SelectNext)));
    assert_eq!(editor.selection, Some(2));
    let (centre, _) = editor.sphere(2, &editor.placements()[2]);
    let at = picture_place(&editor, centre);
    editor.apply(Command::DragStart(at));
    assert!(editor.apply(Command::DragTo([at[0] - 30.0, at[1]])).changed.placements, "the hand is seen at {at:?}");
    let moved = editor.scene().at(1.3);
    let by = moved[2].position.as_dvec3() - unmoved[2].position.as_dvec3();
    let now = editor.placements()[2].position.as_dvec3() - editor.scene().at(0.75)[2].position.as_dvec3();
    assert!(by.length() > 1e-3 && now == DVec3::ZERO, "{by}");
    assert!(moved[..2] == unmoved[..2] && moved[2].rotation == unmoved[2].rotation);

    let saved = editor.save_path();
    assert_eq!(saved, folder.path().join("robot-edited.toml"));
    editor.save(&saved).unwrap();
    let again = Scene::load(&saved).unwrap();
    assert_eq!(again.at(again.data.output.time_s), editor.placements());
    let hashes = |scene: &Scene| scene.meshes.iter().map(|mesh| mesh.content_hash()).collect::<Vec<_>>();
    assert_eq!(hashes(&again), hashes(editor.scene()));
    assert_eq!(again.data.entities, editor.scene().data.entities);
}

#[test]
fn the_pieces_of_a_thing_are_dragged_together() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = bench(serde_json::json!({}));
    let node = model.json["nodes"][0].clone();
    let other = model.node(node);
    model.json["nodes"][other]["translation"] = serde_json::json!([0, 0, -3]);
    let path = model.write(folder.path(), "benches");
    let mut editor = Editor::new(Scene::load(&path).unwrap(), &path);
    let before = editor.placements();
    let board = editor.scene().entities.iter().position(|entity| entity.name == "bench, piece 0").unwrap();
    let (centre, _) = editor.sphere(board, &before[board]);
    let at = picture_place(&editor, centre);
    editor.apply(Command::Pick(at));
    assert_eq!(editor.selection, Some(board));
    editor.apply(Command::DragStart(at));
    assert!(editor.apply(Command::DragTo([at[0] + 30.0, at[1]])).changed.placements);
    let after = editor.placements();
    let by = |entity: usize| after[entity].position - before[entity].position;
    assert!(by(board).length() > 0.01);
    for entity in 0..before.len() {
        let belongs = (board..board + 4).contains(&entity);
        assert_eq!(by(entity), if belongs { by(board) } else { glam::Vec3::ZERO }, "entity {entity}");
    }
    editor.apply(Command::DragEnd);
    editor.apply(Command::Undo);
    assert_eq!(editor.placements(), before);
}
