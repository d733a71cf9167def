//! What the view shows, saved as TOML and rendered by the program: the same picture.

#[path = "common/cli.rs"]
mod cli;
mod common;
#[path = "common/stage.rs"]
mod stage;

use cli::good;
use shadow_fields::asset::picture;
use shadow_fields::draw::Antialias;
use shadow_fields::frame;
use shadow_fields::merge::Variant;
use shadow_fields::scene::Scene;
use shadow_fields::view::{Command, Editor};
use stage::{small, stage};
use std::path::Path;

/// A scene with all that a file can say of motion and sky, less what makes it slow.
const SCENE: &str = r#"
[camera]
eye = [0, 2, 4.5]
target = [0, 0.5, 0]

[output]
width = 96
height = 64

[environment]
sky = { sun_elevation_deg = 30 }

[[mesh]]
name = "floor"
plane = { size_m = 6, cells = 12 }
[[mesh]]
name = "ring"
file = "assets/meshes/torus.obj"
[[mesh]]
name = "ball"
sphere = { radius_m = 0.4, subdivisions = 2 }

[[entity]]
mesh = "floor"

[[entity]]
mesh = "ring"
position = [-0.6, 0.8, 0]
motion = [
    { keyframes = { repeat = true, interpolation = "smooth", keys = [
        { time_s = 0, position = [-0.6, 0.8, 0] },
        { time_s = 1, position = [0.2, 1.0, 0.4], rotation = { axis = [1, 0, 0], angle_deg = 80 } },
        { time_s = 2, position = [-0.6, 0.8, 0] },
    ] } },
    { spin = { period_s = 3 } },
]

[[entity]]
mesh = "ball"
position = [0.9, 0.5, 0.3]
albedo = [0.8, 0.5, 0.3]
motion = [{ bob = { amplitude_m = 0.1, period_s = 1.5 } }]
"#;

#[test]
fn a_saved_state_is_rendered_to_the_picture_that_was_shown() {
    let Some(stage) = stage() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.toml");
    std::fs::write(&path, SCENE).unwrap();
    let mut editor = Editor::new(Scene::load(&path).unwrap(), &path);
    for command in [
        Command::SelectNext,
        Command::SelectNext,
        Command::SelectNext,
        Command::ToggleLight,
        Command::SetLight(2.0),
        Command::SetSkyTurn(70.0),
        Command::SetSky(0.6),
        Command::SetExposure(0.25),
        Command::Orbit([11.0, 4.0]),
        Command::Zoom(1.0),
    ] {
        assert!(editor.apply(command).message.is_none(), "{command:?}");
    }
    editor.advance(0.77);

    let variant = Variant::named("storage").unwrap();
    let bake = shadow_fields::bake::Options { lattice: "cube:4x3".parse().unwrap(), face_px: 16, ..Default::default() };
    let options =
        frame::Options { bake, variant: Some(variant), size: editor.size(), antialias: Antialias::Samples, ..small() };
    // As the command line has it.
    let options = frame::Options { lights: Default::default(), bounces: Default::default(), shading: None, ..options };
    let mut frame = stage.frame(editor.scene(), options);
    let white = (-editor.exposure_ev()).exp2();
    frame.render(&editor.placements(), Some(white)).unwrap();
    let shown = picture::encode_srgb(&frame.picture(), editor.exposure_ev());
    drop(frame);

    editor.save(&editor.save_path()).unwrap();
    assert_eq!(editor.save_path().file_name().unwrap(), "own-edited.toml");
    let fast = ["--lattice", "cube:4x3", "--face-px", "16", "--variant", "storage"];
    let run = |arguments: &[&str]| good(folder.path(), &[arguments, &fast].concat());
    run(&["render", "own-edited.toml", "-o", "p.png"]);
    let png = |name: &str| image::open(folder.path().join(name)).unwrap().into_rgb8();
    assert_eq!(png("p.png").dimensions(), (96, 64));
    assert!(png("p.png").into_raw() == shown, "the saved scene gives another picture");
    let levels: std::collections::HashSet<&[u8]> = shown.chunks(3).collect();
    assert!(levels.len() > 200, "flat: {} colours", levels.len());

    // Motion goes on from there, and is the same at any rate of frames: the last of 7 at 12 a second is the last of 4
    // at 6.
    run(&["render", "own-edited.toml", "-o", "a_#.png", "--exr", "a_#.exr", "--frames", "7", "--fps", "12"]);
    run(&["render", "own-edited.toml", "-o", "b_##.png", "--exr", "b.exr", "--frames", "4", "--fps", "6"]);
    assert!(png("a_0.png").into_raw() == shown);
    for (slow, fast) in [(0, 0), (1, 2), (2, 4), (3, 6)] {
        assert!(png(&format!("b_{slow:02}.png")) == png(&format!("a_{fast}.png")), "{slow}");
    }
    assert!(png("a_3.png") != png("a_2.png"), "it moves");
    let exr = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(exr("b.exr") == exr("a_6.exr"), "one EXR is the last picture's");
    assert!(exr("a_0.exr") != exr("a_6.exr") && !Path::new(&folder.path().join("a_7.exr")).exists());
}
