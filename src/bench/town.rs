//! A town of any size: a floor with instances of three meshes on a grid of constant density, some of which are lights.

use crate::asset::embedded;
use crate::error::Result;
use crate::scene::{Placement, Scene};
use glam::Quat;
use std::fmt::Write;
use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Town {
    /// Number of entities on the floor, including lights.
    pub things: usize,
    /// Number of lights among them.
    pub lights: usize,
    /// Squares along an edge of the floor.
    pub cells: usize,
    /// Whether all entities are lit, or only the floor.
    pub receive: bool,
}

/// Distance between neighbours, metres; entities are about 1 m wide.
const STEP_M: f64 = 2.0;

impl Town {
    pub fn scene(&self) -> Result<Scene> {
        let edge = (self.things.max(1) as f64).sqrt().ceil() as usize;
        let size_m = edge as f64 * STEP_M;
        let mut text = format!(
            "environment = {{ uniform = [0.6, 0.7, 0.8] }}\n[camera]\neye = [0, 10, 20]\ntarget = [0, 0, 0]\n\
             [[mesh]]\nname = \"floor\"\nplane = {{ size_m = {size_m}, cells = {} }}\n\
             [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.4, subdivisions = 2 }}\n\
             [[mesh]]\nname = \"house\"\ncuboid = {{ size_m = [0.6, 0.7, 0.5], cells = 4 }}\n\
             [[mesh]]\nname = \"ring\"\ntorus = {{ major_m = 0.35, minor_m = 0.15, segments = 16, sides = 8 }}\n\
             [[entity]]\nmesh = \"floor\"\n",
            self.cells
        );
        let every = self.things / self.lights.max(1);
        for i in 0..self.things {
            let at = |k: usize| (k as f64 + 0.5) * STEP_M - edge as f64 * STEP_M / 2.0;
            // Displacements from the grid are the same in each run.
            let dx = 0.3 * (i as f64 * 2.399).sin();
            let dz = 0.3 * (i as f64 * 1.237).cos();
            let x = at(i % edge) + dx;
            let z = at(i / edge) + dz;
            let light = self.lights > 0 && i % every == every / 2 && i / every < self.lights;
            let (mesh, y) = [("ball", 0.41), ("house", 0.36), ("ring", 0.52)][if light { 0 } else { i % 3 }];
            let _ = if light {
                writeln!(
                    text,
                    "[[entity]]\nmesh = \"ball\"\nposition = [{x}, 1.6, {z}]\nscale = 0.3\nemission = [6, 5, 4]\nreceives = false"
                )
            } else {
                writeln!(
                    text,
                    "[[entity]]\nmesh = \"{mesh}\"\nposition = [{x}, {y}, {z}]\nrotation = {{ axis = [0.2, 1, 0.1], angle_deg = {} }}\n\
                     receives = {}",
                    i * 47 % 360,
                    self.receive
                )
            };
        }
        Scene::parse(&text, Path::new("assets/scenes/town.toml"), &embedded::read)
    }
}

/// The placement of an entity at `time_s`: it circles about its place and turns.
pub fn moved(place: &Placement, time_s: f64) -> Placement {
    let (sin, cos) = time_s.sin_cos();
    let position = place.position + glam::DVec3::new(0.1 * cos, 0.0, 0.1 * sin).as_vec3();
    let rotation = (Quat::from_rotation_y((0.3 * time_s) as f32) * place.rotation).normalize();
    Placement { position, rotation, scale: place.scale }
}
