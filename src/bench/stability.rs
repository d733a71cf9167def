//! `bench stability`: odd places, sizes, numbers and meshes, each lit twice on the device and once in f64.

use super::budget::device_radiosity;
use super::cases::Case;
use super::{Bench, default_options};
use crate::asset::{Mesh, embedded};
use crate::error::Result;
use crate::field::{Lattice, Storage};
use crate::frame::{self, Frame};
use crate::scene::Scene;
use crate::sh::lobe::clamped_cosine;
use crate::truth::receiver_vertices;
use glam::{DVec3, Vec3};
use serde::Serialize;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    pub name: String,
    /// Number format of the fields.
    pub storage: Storage,
    #[serde(rename = "vertex_count")]
    pub vertices: usize,
    /// Whether every number on the device is finite.
    pub finite: bool,
    /// Whether a second run gave the same bytes.
    pub repeatable: bool,
    /// Largest magnitude of a radiosity.
    #[serde(rename = "largest_radiosity")]
    pub largest: f64,
    /// Upper bound of that magnitude (see [`bound`]).
    #[serde(rename = "bound_radiosity")]
    pub bound: f64,
    /// Largest difference of the device to its f64 twin, relative to the twin's largest magnitude; 0 where all is dark.
    #[serde(rename = "twin_error_relative")]
    pub twin_error: f64,
    /// Whether the trial passed: all numbers are finite, repeatable, within the bound, and within [`NEAR_TWIN`] of the
    /// twin.
    pub passed: bool,
}

/// How far f32 on the device may be from f64, of the brightest radiosity: a thousand products and rotations were off by
/// 3.3e-6, all else by less than 1e-6. Positions are taken from the receiver, so that they are as exact 10^6 m away.
pub const NEAR_TWIN: f64 = 2e-5;

/// Scenes of a floor and two balls, and what is odd about each. Two lights stand off the diagonals of the floor's
/// vertices: on these a direction lies between two faces of a silhouette field's nodes, and f32 and f64 take different
/// ones.
const TRIALS: &[(&str, &str)] = &[
    ("apart", "position = [0, 1, 0]; position = [1.2, 0.9, 0.3]"),
    ("touching each other", "position = [0, 1, 0]; position = [1, 1, 0]"),
    ("touching the floor", "position = [0, 0.5, 0]; position = [1.2, 0.5, 0]"),
    ("nested", "position = [0, 1, 0]; position = [0.05, 1, 0]\nscale = 0.5"),
    ("coinciding", "position = [0, 1, 0]; position = [0, 1, 0]"),
    ("floor through a centre", "position = [0, 0, 0]; position = [0, 2, 0]"),
    ("floor just inside the sphere", "position = [0, 0.499, 0]; position = [1.2, 0.5, 0]"),
    ("10^6 radii away", "position = [0, 500000, 0]; position = [1, 1, 0]"),
    ("positions of 10^6 m", "position = [1000000, 1, 1000000]; position = [1000000.5, 1, 1000000]"),
    ("scale 10^-6", "position = [0, 1, 0]\nscale = 0.000001; position = [1, 1, 0]"),
    ("scale 10^6", "position = [0, 600000, 0]\nscale = 1000000; position = [1, 1, 0]"),
    ("an object as large as the scene", "position = [0, 1, 0]\nscale = 8; position = [1, 1, 0]"),
    ("light in an occluder", "position = [0, 1, 0]; position = [0, 1, 0]\nscale = 0.2\nemission = [5, 5, 5]"),
    ("occluder in a light", "position = [0, 1, 0]\nscale = 0.2; position = [0, 1, 0]\nemission = [5, 5, 5]"),
    (
        "equal distances, occluder first",
        "position = [-1, 1, 0]; position = [1, 1, 0]\nemission = [5, 5, 5]\noccludes = true",
    ),
    (
        "equal distances, light first",
        "position = [1, 1, 0]\nemission = [5, 5, 5]\noccludes = true; position = [-1, 1, 0]",
    ),
    ("radiance 0", "position = [0, 1, 0]; position = [1, 1, 0]\nemission = [0, 0, 0]\nemits = true"),
    ("radiance 10^-6", "position = [0, 1, 0]; position = [1, 1, 0]\nemission = [1e-6, 1e-6, 1e-6]"),
    ("radiance 10^6", "position = [0, 1, 0]; position = [1, 1, 0.0137]\nemission = [1e6, 1e6, 1e6]"),
    (
        "a light of almost no size",
        "position = [0, 1, 0]; position = [1, 2, 0]\nscale = 1e-7\nemission = [1e14, 1e14, 1e14]",
    ),
    ("a light that touches the floor", "position = [0, 1, 0]; position = [1, 0.5, 0]\nemission = [5, 5, 5]"),
    ("a light half in the floor", "position = [0, 1, 0]; position = [1, 0, 0]\nemission = [5, 5, 5]"),
    ("a light that touches an occluder", "position = [0, 1, 0]; position = [0.9999, 1, 0.0137]\nemission = [5, 5, 5]"),
];

/// Panels over a floor and a ball: how they stand, and what is odd about each.
const PANELS: &[(&str, &str)] = &[
    ("a disc that lies on the floor", "disc = { radius_m = 0.4 }|position = [1, 0.001, 0]"),
    ("a disc that looks away", "disc = { radius_m = 0.4 }|position = [1, 1.5, 0]"),
    (
        "a rectangle through the floor",
        "rectangle = { size_m = [1, 1] }|position = [1, 0, 0.013]\nrotation = { axis = [0, 0, 1], angle_deg = 90 }",
    ),
    (
        "a strip of 1000 to 1",
        "rectangle = { size_m = [2, 0.002] }|position = [0.3, 1.7, 0.1]\nrotation = { axis = [1, 0, 0], angle_deg = 180 }",
    ),
    (
        "a panel of almost no size",
        "rectangle = { size_m = [1e-6, 1e-6] }|position = [0.3, 1.7, 0.1]\nrotation = { axis = [1, 0, 0], angle_deg = 180 }",
    ),
];

/// Suns over a floor and a ball, and what is odd about each.
const SUNS: &[(&str, &str)] = &[
    ("a sun of 0.01 degrees", "toward = [1, 2, 0], angle_deg = 0.01, radiance = [1e8, 1e8, 1e8]"),
    ("a sun of 90 degrees", "toward = [1, 2, 0], angle_deg = 90, radiance = [1, 1, 1]"),
    ("a sun in the horizon", "toward = [1, 0, 0], angle_deg = 2, radiance = [1000, 1000, 1000]"),
    ("a sun below the floor", "toward = [0, -1, 0], angle_deg = 2, radiance = [1000, 1000, 1000]"),
];

/// A floor of `cells` x `cells`, two balls and a two-coloured ring to place, and a sky.
fn scene(cells: u32, sky: &str, entities: &str) -> Result<Scene> {
    let text = format!(
        "[camera]\neye = [0, 3, 6]\ntarget = [0, 0, 0]\n{sky}\n\
         [[mesh]]\nname = \"floor\"\nplane = {{ size_m = 4, cells = {cells} }}\n\
         [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.5, subdivisions = 3 }}\n\
         [[mesh]]\nname = \"lamp\"\nsphere = {{ radius_m = 0.4, subdivisions = 2 }}\n\
         [[mesh]]\nname = \"ring\"\ntorus_two_colour = {{ major_m = 0.4, minor_m = 0.1, segments = 24, sides = 12 }}\n{entities}"
    );
    Scene::parse(&text, Path::new("assets/scenes/trial.toml"), &embedded::read)
}

const GRADIENT: &str = "[environment]\ngradient = { radiance = [1, 1, 1] }";
const FLOOR: &str = "[[entity]]\nmesh = \"floor\"\n";

/// An entity of a mesh of [`scene`], and more of its keys.
fn entity(mesh: &str, more: &str) -> String {
    format!("[[entity]]\nmesh = \"{mesh}\"\n{more}\n")
}

/// All trials; chains of occluders of up to `longest`.
pub fn cases(longest: usize) -> Result<Vec<Case>> {
    let mut out = Vec::new();
    let mut add = |name: String, scene: Scene| out.push(Case::at_start(name, scene));
    for (name, places) in TRIALS {
        let balls: String = places.split(';').map(|place| entity("ball", place.trim())).collect();
        add((*name).to_owned(), scene(40, GRADIENT, &format!("{FLOOR}{balls}"))?);
    }
    for (name, sun) in SUNS {
        let sky = format!("[environment]\nsun = {{ {sun} }}");
        let ball = entity("ball", "position = [0, 0.7, 0]");
        add((*name).to_owned(), scene(40, &sky, &format!("{FLOOR}{ball}"))?);
    }
    for (name, panel) in PANELS {
        let (mesh, place) = panel.split_once('|').expect("a mesh and a place");
        let sky = format!("[[mesh]]\nname = \"panel\"\n{mesh}");
        let panel = entity("panel", &format!("{place}\nemission = [9, 9, 9]"));
        add(
            (*name).to_owned(),
            scene(40, &sky, &format!("{FLOOR}{}{panel}", entity("ball", "position = [0, 0.7, 0]")))?,
        );
    }
    let glows = "emission = [9, 9, 9]";
    for (name, keeps) in [("one triangle", 1), ("an open mesh", 640)] {
        let between = entity("ball", "position = [0, 0.7, 0]");
        let light = |mesh| entity(mesh, &format!("position = [0.6, 1.8, 0.2]\n{glows}"));
        // The mesh occludes in one trial and emits in another.
        for (role, entities) in [("occludes", format!("{between}{}", light("lamp"))), ("shines", light("ball"))] {
            let mut scene = scene(20, "", &format!("{FLOOR}{entities}"))?;
            change(&mut scene, 1, |mesh| mesh.triangles.truncate(keeps))?;
            add(format!("{name} {role}"), scene);
        }
    }
    for count in [100, 1000].into_iter().filter(|count| *count <= longest) {
        add(format!("{count} lights"), many_lights(count)?);
    }
    add("receivers on centre, axes, edges, corners, shells, inside, far".into(), marks()?);
    for (name, pattern, emission) in
        [("0", 1.0, 0.0), ("10^-6", 1.0, 1e-6), ("10^6", 1.0, 1e6), ("10^6 by its colours", 1e6, 1.0)]
    {
        let ring = format!("position = [0.3, 1, 0]\nemission = [{emission}, {emission}, {emission}]\nemits = true");
        let lit = entity("ball", "position = [-0.8, 0.6, 0]");
        let mut scene = scene(20, "", &format!("{FLOOR}{lit}{}", entity("ring", &ring)))?;
        change(&mut scene, 3, |mesh| {
            mesh.colors.iter_mut().flatten().for_each(|color| *color *= pattern);
        })?;
        add(format!("two colours of radiance {name}"), scene);
    }
    let mut broken = scene(20, GRADIENT, &format!("{FLOOR}{}", entity("ball", "position = [0, 0.7, 0]")))?;
    change(&mut broken, 1, spoil)?;
    add("triangles of no area, needles, duplicate vertices".into(), broken);
    for count in [1, 8, 64, 256, 1000].into_iter().filter(|count| *count <= longest) {
        for distinct in [false, true] {
            let what = if distinct { "distinct" } else { "identical" };
            add(format!("{count} {what} occluders"), crowd(count, distinct)?);
        }
    }
    Ok(out)
}

fn change(scene: &mut Scene, index: usize, how: impl FnOnce(&mut Mesh)) -> Result<()> {
    let mut mesh = (*scene.meshes[index]).clone();
    how(&mut mesh);
    scene.meshes[index] = Arc::new(Mesh::new(&mesh.name, mesh.positions, mesh.normals, mesh.colors, mesh.triangles)?);
    Ok(())
}

/// Adds faults that exporters leave in meshes.
fn spoil(mesh: &mut Mesh) {
    let first = mesh.positions.len() as u32;
    let corner = mesh.triangles[7];
    let copies: Vec<Vec3> = corner.iter().map(|i| mesh.positions[*i as usize]).collect();
    let normals: Vec<Vec3> = corner.iter().map(|i| mesh.normals[*i as usize]).collect();
    // The same triangle on vertices of its own, and a hair of 1e-7 beside it.
    mesh.positions.extend(copies.iter().copied().chain([copies[0] + Vec3::new(0.0, 1e-7, 0.0)]));
    mesh.normals.extend(normals.iter().copied().chain([normals[0]]));
    mesh.triangles.extend([
        [first, first + 1, first + 2],
        [first, first + 1, first + 3],
        [corner[0], corner[0], corner[1]],
        [corner[2], corner[2], corner[2]],
        [corner[0], corner[1], first + 1],
    ]);
}

/// Small patches around one ball, one at every kind of place that a lookup treats in a way of its own.
fn marks() -> Result<Scene> {
    let lattice = Lattice { inner: crate::field::lattice::OUTSIDE_INNER, ..Lattice::default() };
    let directions =
        [DVec3::X, DVec3::NEG_Y, DVec3::new(1.0, 1.0, 0.0), DVec3::new(-1.0, 1.0, 1.0), DVec3::new(0.3, 0.2, -1.0)];
    let distances = [0.0, 1e-4, 0.5, lattice.shell(0), lattice.shell(5), lattice.outer, 1e6];
    let mut entities = entity("ball", "receives = false");
    for direction in directions {
        for distance in distances {
            let [x, y, z] = (direction.normalize() * distance * 0.5).to_array();
            entities += &entity("floor", &format!("position = [{x}, {y}, {z}]\nscale = 0.000001\noccludes = false"));
        }
    }
    scene(2, GRADIENT, &entities)
}

/// A coarse floor and a ball under many small lights.
fn many_lights(count: usize) -> Result<Scene> {
    let mut rng = fastrand::Rng::with_seed(8);
    let mut entities = format!("{FLOOR}{}", entity("ball", "position = [0, 0.6, 0]\nreceives = false"));
    for _ in 0..count {
        let x = 4.0 * rng.f64() - 2.0;
        let y = 1.5 + 2.0 * rng.f64();
        let z = 4.0 * rng.f64() - 2.0;
        let light = format!("position = [{x}, {y}, {z}]\nscale = 0.05\nemission = [1, 1, 1]\nreceives = false");
        entities += &entity("lamp", &light);
    }
    scene(6, "", &entities)
}

/// A coarse floor under many balls that are not lit.
fn crowd(count: usize, distinct: bool) -> Result<Scene> {
    let mut rng = fastrand::Rng::with_seed(5);
    let mut entities = FLOOR.to_owned();
    for _ in 0..count {
        let [x, y, z] = if distinct {
            [4.0 * rng.f64() - 2.0, 0.7 + 3.0 * rng.f64(), 4.0 * rng.f64() - 2.0]
        } else {
            [0.4, 1.1, 0.2]
        };
        entities += &entity("ball", &format!("position = [{x}, {y}, {z}]\nreceives = false"));
    }
    scene(6, GRADIENT, &entities)
}

/// Upper bound of the magnitude of every radiosity of a scene. A guarded chain never lengthens the transfer vector, of
/// which a lobe of the cosine is the longest; by Cauchy and Schwarz light adds at most the length of its own vector
/// times that. A local light's is at most its brightest emission times that of a whole sky, sqrt(4 pi), and a tenth for
/// what interpolation and the fit of samples add.
pub fn bound(scene: &Scene, bands: usize) -> f64 {
    let length = |v: &[f64]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let sky = scene.environment.coefficients(bands).iter().map(|channel| length(channel)).fold(0.0, f64::max);
    let light = |entity: &crate::scene::Entity| {
        let colors = &scene.meshes[entity.mesh].colors;
        let brightest = colors.as_ref().map_or(1.0, |c| c.iter().fold(0.0, |m: f32, c| m.max(c.max_element())));
        f64::from(entity.emission.max_element() * brightest) * (4.0 * PI).sqrt() * 1.1
    };
    let lights: f64 = scene.entities.iter().filter(|e| e.emits).map(light).sum();
    let albedo = scene.entities.iter().map(|e| e.albedo.max_element()).fold(0.0, f32::max);
    (sky + lights) * length(&clamped_cosine(bands, DVec3::Y)) * f64::from(albedo) / PI * 1.001
}

/// All trials with fields of both number formats.
pub fn run(bench: &Bench<'_>) -> Result<Vec<Trial>> {
    let mut trials = Vec::new();
    for case in cases(if bench.quick { 64 } else { 1000 })? {
        for storage in [Storage::F16, Storage::F32] {
            let options = default_options();
            let bake = crate::bake::Options { storage, ..options.bake };
            let frame = bench.frame(&case.scene, frame::Options { bake, ..options })?;
            trials.push(trial(&case, frame, storage)?);
        }
        (bench.progress)(&case.name);
    }
    Ok(trials)
}

/// Lights a trial twice on the device, merging everything each time, and once in f64.
pub fn trial(case: &Case, mut frame: Frame, storage: Storage) -> Result<Trial> {
    let placements = case.scene.at(0.0);
    let vertices = receiver_vertices(&case.scene);
    frame.render(&placements, None)?;
    let first = device_radiosity(&frame, &vertices)?;
    frame.render(&placements, None)?;
    let second = device_radiosity(&frame, &vertices)?;
    let twin: Vec<f64> = frame.twin(&placements)?.into_iter().flat_map(|(_, all)| all).flatten().collect();
    let device: Vec<f64> = first.iter().flatten().copied().collect();
    let largest = |values: &[f64]| values.iter().fold(0.0, |worst: f64, v| worst.max(v.abs()));
    let apart: Vec<f64> = device.iter().zip(&twin).map(|(a, b)| a - b).collect();
    let twin_error = if largest(&apart) == 0.0 { 0.0 } else { largest(&apart) / largest(&twin).max(f64::MIN_POSITIVE) };
    let finite = device.iter().chain(&twin).all(|v| v.is_finite());
    let bytes = |of: &[[f64; 3]]| of.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
    let repeatable = bytes(&first) == bytes(&second);
    let bound = bound(&case.scene, 4);
    Ok(Trial {
        name: case.name.clone(),
        storage,
        vertices: vertices.len(),
        finite,
        repeatable,
        largest: largest(&device),
        bound,
        twin_error,
        passed: finite && repeatable && largest(&device) <= bound && twin_error < NEAR_TWIN,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_trial_is_a_scene() {
        let all = cases(64).unwrap();
        assert!(all.len() > TRIALS.len() + 8);
        assert!(all.iter().all(|case| bound(&case.scene, 4) >= 0.0));
        // The radiosity of a white floor under a white sky is 1, and the bound lies little above that.
        let sky = "[environment]\nuniform = [1, 1, 1]";
        let open = scene(2, sky, &entity("floor", "albedo = [1, 1, 1]")).unwrap();
        let bound = bound(&open, 4);
        assert!((1.0..2.0).contains(&bound), "{bound}");
    }
}
