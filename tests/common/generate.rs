//! Generated meshes of numbers that are in range.

#![allow(dead_code, unused_imports)] // every test binary uses its own part

use glam::Vec3;
pub use shadow_fields::asset::generator::{COOL, WARM, library};
use shadow_fields::asset::{Generator, Mesh};

pub fn plane(size_m: f32, cells: u32) -> Mesh {
    Generator::Plane { size_m, cells }.build().unwrap()
}

pub fn sphere(radius_m: f32, subdivisions: u32) -> Mesh {
    Generator::Sphere { radius_m, subdivisions }.build().unwrap()
}

pub fn torus(major_m: f32, minor_m: f32, segments: u32, sides: u32) -> Mesh {
    Generator::Torus { major_m, minor_m, segments, sides }.build().unwrap()
}

pub fn torus_two_colour(major_m: f32, minor_m: f32, segments: u32, sides: u32) -> Mesh {
    Generator::TorusTwoColour { major_m, minor_m, segments, sides }.build().unwrap()
}

pub fn cuboid(size_m: Vec3, cells: u32) -> Mesh {
    Generator::Cuboid { size_m, cells }.build().unwrap()
}

/// The teapot; 10 squares along the edge of a patch are usual.
pub fn teapot(subdivisions: u32) -> Mesh {
    Generator::Teapot { subdivisions }.build().unwrap()
}
