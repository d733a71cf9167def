//! A storey of a house, made for skips: lamps that face away from the ceiling, lamps that are out, entities in the
//! attic.

use crate::asset::{Mesh, embedded};
use crate::error::Result;
use crate::scene::Scene;
use glam::Vec3;
use std::fmt::Write;
use std::path::Path;

/// Lamps along a side of the storey.
const LAMPS: usize = 3;
/// Entities along a side of the storey, and of the attic.
const THINGS: usize = 5;

/// A floor and a ceiling of 8 by 8 m, lamps of which three shine down and the others are out, entities on the floor and
/// in the attic. The field of a shining lamp is zero above it, and the field of a lamp that is out is zero everywhere.
pub fn scene() -> Result<Scene> {
    let panel = "cuboid = { size_m = [0.9, 0.1, 0.9], cells = 3 }";
    let mut text = format!(
        "[environment]\n[camera]\neye = [0, 1.5, 6]\ntarget = [0, 1, 0]\n\
         [[mesh]]\nname = \"floor\"\nplane = {{ size_m = 8, cells = 63 }}\n\
         [[mesh]]\nname = \"lamp\"\n{panel}\n[[mesh]]\nname = \"lamp that is out\"\n{panel}\n\
         [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.4, subdivisions = 2 }}\n\
         [[mesh]]\nname = \"ring\"\ntorus = {{ major_m = 0.35, minor_m = 0.15, segments = 16, sides = 8 }}\n\
         [[entity]]\nmesh = \"floor\"\n\
         [[entity]]\nmesh = \"floor\"\nposition = [0, 3, 0]\nrotation = {{ axis = [1, 0, 0], angle_deg = 180 }}\n"
    );
    let places = |count: usize| {
        let at = move |k: usize| 8.0 * (k as f64 + 0.5) / count as f64 - 4.0;
        (0..count * count).map(move |i| (i, at(i % count), at(i / count)))
    };
    // Writing to a string cannot fail.
    for (i, x, z) in places(LAMPS) {
        let mesh = if i % 4 == 0 { "lamp" } else { "lamp that is out" };
        let _ = writeln!(
            text,
            "[[entity]]\nmesh = \"{mesh}\"\nposition = [{x}, 2.6, {z}]\nemission = [6, 5, 4]\nreceives = false"
        );
    }
    for (i, x, z) in places(THINGS) {
        let mesh = ["ball", "ring"][i % 2];
        for y in [0.52, 3.6] {
            let _ = writeln!(text, "[[entity]]\nmesh = \"{mesh}\"\nposition = [{}, {y}, {z}]", x + 0.2);
        }
    }
    let mut scene = Scene::parse(&text, Path::new("assets/scenes/house.toml"), &embedded::read)?;
    for (index, shines) in [(1, true), (2, false)] {
        let mesh = &scene.meshes[index];
        let color = |n: &Vec3| if shines && n.y < -0.5 { Vec3::ONE } else { Vec3::ZERO };
        let colors = mesh.normals.iter().map(color).collect();
        let positions = mesh.positions.clone();
        let normals = mesh.normals.clone();
        let triangles = mesh.triangles.clone();
        scene.meshes[index] = Mesh::new(mesh.name.clone(), positions, normals, Some(colors), triangles)?.into();
    }
    Ok(scene)
}
