//! What stands behind the window, without a window: events in, state out.
#![cfg(feature = "view")]

mod camera;
mod controls;
mod edit;
mod files;
mod gltf;
mod history;
mod lights;
mod panel;
mod selection;

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/model.rs"]
mod model;

use glam::DVec3;
use shadow_fields::draw::camera::clip_from_world;
use shadow_fields::scene::Scene;
use shadow_fields::view::Editor;
use std::path::Path;

fn built_in(name: &str) -> Editor {
    let path = format!("assets/scenes/{name}.toml");
    Editor::new(Scene::load(path.as_ref()).unwrap(), path.as_ref())
}

fn from_text(text: &str) -> Editor {
    Editor::new(common::parse(text), Path::new("t.toml"))
}

/// A ball, a lamp and a floor.
const SMALL: &str = "[camera]\neye = [0, 2, 5]\ntarget = [0, 0.5, 0]\n[output]\nwidth = 200\nheight = 100\n\
    [environment]\nuniform = [0.1, 0.1, 0.1]\n\
    [[mesh]]\nname = \"floor\"\nplane = { size_m = 8, cells = 2 }\n\
    [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 2 }\n\
    [[entity]]\nmesh = \"floor\"\n[[entity]]\nmesh = \"ball\"\nposition = [0, 0.5, 0]\nalbedo = [0.8, 0.4, 0.2]\n\
    [[entity]]\nname = \"lamp\"\nmesh = \"ball\"\nposition = [1.5, 2, 0]\nscale = 0.5\nemission = [40, 40, 30]\n\
    motion = [{ orbit = { centre = [0, 2, 0], period_s = 4 } }]\n";

fn picture_place(editor: &Editor, point: DVec3) -> [f32; 2] {
    let [width, height] = editor.size().map(f64::from);
    let clip = clip_from_world(editor.camera(), width / height) * point.extend(1.0);
    [((clip.x / clip.w + 1.0) * width / 2.0) as f32, ((clip.y / clip.w + 1.0) * height / 2.0) as f32]
}
