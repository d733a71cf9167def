//! What lets light through, everywhere or by its holes.

use crate::common::gpu;
use crate::stage::{difference, holed, scene, shines, small, stands};
use glam::{Vec2, Vec3};
use shadow_fields::asset::environment::EnvironmentData;
use shadow_fields::asset::mesh::Attributes;
use shadow_fields::asset::{Generator, Mesh};
use shadow_fields::draw::Antialias;
use shadow_fields::scene::{Albedo, EntityData, Scene};
use shadow_fields::{bake, frame};

const SKY: &str = "environment = { uniform = [1, 1, 1] }\n";
const LAMP: &str = "[[entity]]\nmesh = \"ball\"\nscale = 0.2\nposition = [1, 3, 0.3]\nemission = [50, 50, 50]\n";
const FLOOR: &str = "[[mesh]]\nname = \"floor\"\nplane = { size_m = 4, cells = 20 }\n\
    [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 3 }\n\
    [[mesh]]\nname = \"box\"\ncuboid = { size_m = [0.9, 0.1, 0.6], cells = 2 }\n\
    [[mesh]]\nname = \"pane\"\nplane = { size_m = 1, cells = 1 }\n[[entity]]\nmesh = \"floor\"\n";

/// One occluder of any kind: what it leaves is between nothing and all of what it blocks, by its opacity.
#[test]
fn glass_takes_its_share() {
    let Some(gpu) = gpu() else { return };
    for mesh in ["ball", "box", "pane"] {
        for (what, light, sky) in [("sky", "", SKY), ("lamp", LAMP, "")] {
            for groups in [false, true] {
                let lit = |switch: &str| {
                    let pane = format!("[[entity]]\nmesh = \"{mesh}\"\nposition = [0.1, 0.8, 0]\n{switch}\n");
                    let bake = bake::Options { groups, ..small().bake };
                    let scene = scene(&format!("{sky}{FLOOR}{pane}{light}"));
                    gpu.lit(&scene, frame::Options { bake, ..small() }).swap_remove(0)
                };
                // An opaque one of a group would be in the floor's own visibility.
                let [open, glass, dense] = ["occludes = false", "opacity = 0.3", "opacity = 0.999"].map(lit);
                let mixed = |(open, dense): (&[f32; 3], &[f32; 3])| {
                    std::array::from_fn(|c| open[c] + 0.3 / 0.999 * (dense[c] - open[c]))
                };
                let wanted: Vec<[f32; 3]> = open.iter().zip(&dense).map(mixed).collect();
                let (off, most) = difference(&glass, &wanted);
                let (shadow, _) = difference(&open, &dense);
                // An occluder that is part field and part cap takes its share twice: not quite in proportion.
                assert!(off < 5e-4 * most && shadow > 0.2 * most, "{mesh}, {what}: {off}, {shadow} of {most}");
            }
        }
    }
}

#[test]
fn glass_is_drawn_over_what_lies_behind_it() {
    let Some(gpu) = gpu() else { return };
    let pane = "[[mesh]]\nname = \"pane\"\ncuboid = { size_m = [2, 2, 0.1], cells = 1 }\n[[entity]]\nmesh = \"pane\"\n\
        position = [0, 0, 1]\nopacity = 0.25\nemission = [0, 0, 0.1]\nemits = false\noccludes = false\n";
    let text = format!(
        "[[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.9, subdivisions = 3 }}\n[[entity]]\nmesh = \"ball\"\n\
         emission = [1, 0.5, 0]\nreceives = false\n{pane}"
    );
    let scene = scene(&text);
    for antialias in [Antialias::Samples, Antialias::Outlines, Antialias::None] {
        let picture = gpu.picture(&scene, frame::Options { size: [64, 64], antialias, ..small() }, 1.0);
        let middle = Vec3::from_slice(&picture[3 * (32 * 64 + 32)..][..3]);
        assert!((middle - Vec3::new(0.75, 0.375, 0.1)).abs().max_element() < 2e-3, "{antialias:?}: {middle}");
    }
}

/// A square of which a texture leaves the half at x > 0.
fn half_of_a_square(masked: bool) -> Scene {
    let from = if masked { -0.5 } else { 0.0 };
    let positions = [[from, -0.5], [0.5, -0.5], [0.5, 0.5], [from, 0.5]].map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec();
    let uvs = positions.iter().map(|p| Vec2::new(p.x + 0.5, 0.5)).collect();
    let attributes = Attributes { uvs: Some(uvs), ..Attributes::default() };
    let square =
        Mesh::with_attributes("square", positions, Vec::new(), attributes, vec![[0, 2, 1], [0, 3, 2]]).unwrap();
    let rgba = (0..64 * 64).map(|i| [255, 255, 255, if i % 64 < 32 { 0 } else { 255 }]).collect();
    Scene::builder()
        .environment(EnvironmentData { uniform: Some(Vec3::ONE), ..Default::default() })
        .texture("mask", holed(64, rgba))
        .mesh("floor", Generator::Plane { size_m: 4.0, cells: 20 })
        .mesh("square", square)
        .mesh("ball", Generator::Sphere { radius_m: 1.0, subdivisions: 2 })
        .entity(EntityData::of_mesh("floor"))
        .entity(EntityData { albedo: Albedo::Texture("mask".into()), ..stands("square", [0.0, 0.6, 0.0]) })
        .entity(EntityData { scale: 0.1, ..shines("ball", [1.0, 3.0, 0.3], 200.0) })
        .build()
        .unwrap()
}

/// By rays where nothing moves, else by what is captured of the shape without its holes.
#[test]
fn light_passes_holes() {
    let Some(gpu) = gpu() else { return };
    for (groups, limit) in [(true, 0.06), (false, 0.12)] {
        let lit = |masked: bool| {
            let bake = bake::Options { groups, ..bake::Options::default() };
            gpu.lit(&half_of_a_square(masked), frame::Options { bake, ..small() }).swap_remove(0)
        };
        let (off, most) = difference(&lit(true), &lit(false));
        assert!(off < limit * most, "groups {groups}: {off} of {most}");
    }
}
