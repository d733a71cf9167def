//! A glTF file behind the window: it moves, it can be edited, and what is saved is a scene file with its meshes.

use super::model::Model;
use super::step;
use glam::DVec3;
use serde_json::json;
use shadow_fields::scene::Scene;
use shadow_fields::view::{Command, Editor, Step};

/// Three parts that move, one in another, and two lamps.
fn robot() -> Model {
    let mut model = Model::default();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turn = [0., 0., 0., 1., 0., half, 0., half, 0., 1., 0., 0.];
    let mut outer = None;
    for (name, size) in [("body", 0.5), ("arm", 0.3), ("hand", 0.1)] {
        let mesh = model.cuboid([-size; 3], [size; 3], None);
        let node = json!({ "name": name, "mesh": mesh, "translation": [0, 1, 0.5] });
        let node = if let Some(outer) = outer { model.child(outer, node) } else { model.node(node) };
        model.animate(0, node, "rotation", "LINEAR", &[0., 1., 2.], &turn);
        outer = Some(node);
    }
    for x in [-2, 2] {
        let light = model.light(json!({ "type": "point", "intensity": 20 }));
        let extension = json!({ "KHR_lights_punctual": { "light": light } });
        model.node(json!({ "translation": [x, 3, 1], "extensions": extension }));
    }
    model
}

#[test]
fn a_gltf_file_is_edited_and_saved_as_a_scene_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = robot().write(folder.path(), "robot");
    let mut editor = Editor::new(Scene::load(&path).unwrap(), &path);
    let start = editor.placements().to_vec();
    // The sky that the window adds has a sun behind the five of the file.
    assert_eq!((editor.scene().data.entities.len(), start.len()), (5, 6));
    assert!(editor.advance(0.75).changed.placements);
    for (index, (before, after)) in start.iter().zip(editor.placements()).enumerate() {
        assert_eq!(*before != after, index < 3, "entity {index}");
    }
    // The hand is moved: at all times, and nothing else.
    let unmoved = editor.scene().at(1.3);
    (0..3).for_each(|_| drop(editor.apply(Command::SelectNext)));
    assert_eq!(editor.selection(), Some(2));
    editor.apply(step(Step::Left));
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
    // Saved again, it overwrites what it wrote.
    editor.save(&saved).unwrap();
    assert_eq!(std::fs::read_dir(folder.path().join("robot-edited_meshes")).unwrap().count(), 3);
}
