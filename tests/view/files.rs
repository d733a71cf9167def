//! Time, the next scene, and what is saved.

use super::{SMALL, built_in, from_text};
use glam::DVec3;
use shadow_fields::asset::embedded;
use shadow_fields::scene::Scene;
use shadow_fields::view::{Command, Editor};
use std::path::Path;

#[test]
fn time_passes_by_its_sum_alone() {
    let mut coarse = built_in("twelve_instances");
    let mut fine = built_in("twelve_instances");
    let steps: Vec<f64> = (0..400).map(|i| f64::from(1 + i % 7) / 64.0).collect();
    steps.iter().for_each(|dt| drop(fine.advance(*dt)));
    coarse.advance(steps.iter().sum());
    // Binary fractions, so that the sums are equal to the bit, and so must be the scenes.
    assert_eq!(coarse.time_s, fine.time_s);
    assert_eq!(coarse.placements(), fine.placements());
    assert_eq!(coarse.placements(), coarse.scene().at(coarse.time_s));
    coarse.apply(Command::ToggleRunning);
    for dt in [1.0, f64::NAN, -1.0, f64::INFINITY] {
        assert!(!coarse.advance(dt).changed.any());
    }
    coarse.apply(Command::ToggleRunning);
    for dt in [f64::NAN, -1.0, f64::INFINITY, 0.0] {
        assert!(!coarse.advance(dt).changed.any());
    }
    assert_eq!(coarse.time_s, fine.time_s);
    assert!(coarse.advance(0.5).changed.placements);
    // Where nothing moves, time changes nothing.
    let mut still = from_text(&SMALL.replace("motion", "# motion"));
    assert!(!still.advance(0.5).changed.any());
}

#[test]
fn the_next_scene_comes_round() {
    let mut editor = built_in("glowing_torus");
    editor.apply(Command::Resize([300, 200]));
    editor.apply(Command::ToggleRunning);
    let mut names = Vec::new();
    for _ in 0..8 {
        assert!(editor.apply(Command::NextScene).changed.scene);
        assert_eq!((editor.size(), editor.undo_count(), editor.selection), ([300, 200], 0, None));
        assert!(!editor.running && editor.hit([150.0, 120.0]).is_some());
        names.push(editor.path().file_stem().unwrap().to_str().unwrap().to_owned());
    }
    let all = embedded::scenes();
    let expected: Vec<&str> = all.iter().map(|(name, _)| *name).cycle().skip(1).take(8).collect();
    assert_eq!(names, expected);
    let mut own = from_text(SMALL);
    own.apply(Command::NextScene);
    assert_eq!(own.path(), Path::new("assets/scenes/glowing_torus.toml"));
}

#[test]
fn a_saved_scene_reads_back_as_the_state() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _) in embedded::scenes() {
        let mut editor = built_in(name);
        for command in [
            Command::Resize([321, 123]),
            Command::Orbit([30.0, 12.0]),
            Command::Zoom(3.0),
            Command::SelectNext,
            Command::SelectNext,
            Command::ToggleLight,
            Command::SetSky(1.7),
            Command::SetSkyTurn(33.0),
            Command::SetExposure(0.3),
        ] {
            editor.apply(command);
        }
        editor.advance(1.234_567);
        // Anywhere: built-in meshes are found by their built-in names.
        let path = folder.path().join(format!("{name}-edited.toml"));
        editor.save(&path).unwrap();
        let scene = Scene::load(&path).unwrap();
        assert_eq!(scene.data.output.time_s, editor.time_s);
        assert_eq!([scene.data.output.width, scene.data.output.height], [321, 123]);
        assert_eq!(scene.data.output.exposure_ev(), 0.3);
        assert_eq!(scene.data.camera, *editor.camera());
        assert_eq!(scene.data.environment, editor.scene().data.environment);
        assert_eq!(scene.data.entities, editor.scene().data.entities);
        assert_eq!(scene.entities, editor.scene().entities);
        assert_eq!(scene.at(scene.data.output.time_s), editor.placements());
        for (a, b) in scene.meshes.iter().zip(&editor.scene().meshes) {
            assert_eq!((a.content_hash(), &a.name), (b.content_hash(), &b.name));
        }
        assert_eq!(scene.environment.coefficients(4), editor.scene().environment.coefficients(4));
        // And it can be edited on, and saved over.
        let mut again = Editor::new(scene, &path);
        assert_eq!((again.placements(), again.save_path()), (editor.placements(), path.clone()));
        again.save(&path).unwrap();
        assert_eq!(Scene::load(&path).unwrap().data, again.scene().data);
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 7, "nothing but the scenes: {left:?}");
    let nowhere = folder.path().join("no/such/s.toml");
    let error = built_in("glowing_torus").save(&nowhere).unwrap_err();
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().starts_with(&nowhere.display().to_string()), "{error}");
}

#[test]
fn saved_files_are_found_from_other_folders() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path().join("here");
    let there = folder.path().join("there");
    std::fs::create_dir_all(here.join("meshes")).unwrap();
    std::fs::create_dir_all(&there).unwrap();
    std::fs::write(here.join("meshes/t.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    shadow_fields::asset::picture::write_exr(&here.join("sky.exr"), 2, 1, &[1.0; 6]).unwrap();
    let text = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[environment]\nimage = { file = \"sky.exr\" }\n\
                [[mesh]]\nname = \"m\"\nfile = \"meshes/t.obj\"\n[[mesh]]\nname = \"b\"\nfile = \"assets/meshes/torus.obj\"\n[[entity]]\nmesh = \"m\"\n";
    std::fs::write(here.join("s.toml"), text).unwrap();
    let open = |path: &Path| Editor::new(Scene::load(path).unwrap(), path);
    let mut editor = open(&here.join("s.toml"));
    assert_eq!(editor.save_path(), here.join("s-edited.toml"));
    editor.save(&editor.save_path()).unwrap();
    assert_eq!(editor.save_path(), here.join("s-edited.toml"), "its own file is written over");
    let beside = Scene::load(&here.join("s-edited.toml")).unwrap();
    assert_eq!(beside.data, editor.scene().data, "beside it, names stay as they are");
    editor.save(&there.join("s.toml")).unwrap();
    editor.save(&folder.path().join("s.toml")).unwrap();
    for path in [there.join("s.toml"), folder.path().join("s.toml")] {
        let scene = Scene::load(&path).unwrap();
        assert_eq!(scene.meshes[0].content_hash(), editor.scene().meshes[0].content_hash());
        assert_eq!(scene.environment.radiance(DVec3::X), [1.0; 3]);
    }
    let moved = Scene::load(&folder.path().join("s.toml")).unwrap();
    assert_eq!(moved.data.meshes[0].file.as_deref(), Some(Path::new("here/meshes/t.obj")), "relative where it can be");
    assert_eq!(moved.data.meshes[1].file.as_deref(), Some(Path::new("assets/meshes/torus.obj")));
}

#[test]
fn what_an_earlier_session_saved_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("s.toml"), SMALL).unwrap();
    let open = |name: &str| Editor::new(Scene::load(&at(name)).unwrap(), &at(name));
    let mut saved = Vec::new();
    for name in ["s-edited.toml", "s-edited-2.toml", "s-edited-3.toml"] {
        let mut editor = open("s.toml");
        editor.advance(0.1 * (1 + saved.len()) as f64);
        for _ in 0..2 {
            assert_eq!(editor.save_path(), at(name));
            editor.save(&editor.save_path()).unwrap();
        }
        saved.push((name, std::fs::read(at(name)).unwrap()));
    }
    for (name, bytes) in &saved {
        assert_eq!(&std::fs::read(at(name)).unwrap(), bytes, "{name}");
        assert_eq!(open(name).save_path(), at(name), "opened, it is written over");
    }
    // The same scene loaded again in one session is still that session.
    let mut editor = open("s.toml");
    editor.save(&editor.save_path()).unwrap();
    editor.apply(Command::NextScene);
    editor.open(Scene::load(&at("s.toml")).unwrap(), &at("s.toml"));
    assert_eq!((editor.path(), editor.save_path()), (&*at("s.toml"), at("s-edited-4.toml")));
}

#[test]
fn edits_that_would_be_lost_are_saved_beside_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.toml");
    std::fs::write(&path, SMALL).unwrap();
    let mut editor = Editor::new(Scene::load(&path).unwrap(), &path);
    assert!(!editor.is_edited());
    editor.apply(Command::Zoom(2.0));
    editor.apply(Command::SelectNext);
    assert_eq!((editor.is_edited(), editor.rescue().unwrap()), (false, None), "a look is no edit");
    editor.apply(Command::SetExposure(0.75));
    assert!(editor.is_edited());
    editor.apply(Command::Undo);
    assert!(!editor.is_edited(), "what was taken back is no edit");
    editor.apply(Command::SetExposure(1.5));
    assert_eq!(editor.rescue().unwrap(), Some(folder.path().join("small-edited.toml")));
    assert_eq!(Scene::load(&folder.path().join("small-edited.toml")).unwrap().data.output.exposure_ev(), 1.5);
    assert_eq!(editor.rescue().unwrap(), None, "once is enough");
}

#[test]
#[cfg(target_os = "linux")]
fn edits_are_saved_elsewhere_where_the_folder_cannot_be_written() {
    // A file in a folder in which nobody can make files.
    let path = Path::new("/proc/version");
    let mut editor = Editor::new(from_text(SMALL).scene().clone(), path);
    editor.apply(Command::SetExposure(0.75));
    let said = editor.rescued(shadow_fields::Error::Failed("gone".into())).to_string();
    let saved = said.strip_prefix("gone; the edited scene was saved as ").unwrap();
    assert!(Scene::load(Path::new(saved)).is_ok(), "{said}");
    std::fs::remove_file(saved).unwrap();
}
