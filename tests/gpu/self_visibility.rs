//! Self-visibility: closed forms, the shader's lookup against Rust's, direct light against rays.

use crate::common::{cap, generate, gpu, inside_out};
use crate::stage::scene;
use glam::{DVec3, Vec3, Vec4};
use shadow_fields::asset::Mesh;
use shadow_fields::bake::surfaces::{BakedSurface, GroupPlan};
use shadow_fields::bake::{self, TRANSFER_OFFSET, Wanted};
use shadow_fields::field::quantity::channel_stride;
use shadow_fields::field::self_visibility::{
    BYTES, CELLS, LIMIT_RAD, NODES, decode_angle, encode_angle, frame, node_direction, visible, write_cells,
};
use shadow_fields::field::sub_light::{LightPart, SeenLight};
use shadow_fields::gpu::{Bind, Buffer, Commands, ComputePipeline};
use shadow_fields::sh::quadrature::random_direction;
use shadow_fields::shaders::{Library, ShaderPermutation};
use shadow_fields::truth::{Vertex, World};
use std::f64::consts::TAU;
use std::sync::Arc;

/// The surface of a mesh that nothing surrounds.
fn bake(mesh: &Mesh) -> BakedSurface {
    let alone = GroupPlan::alone(&Arc::new(mesh.clone()), &bake::Options::default(), Wanted::BOTH);
    alone.bake(&|_, _| ()).0.remove(0)
}

fn maps(mesh: &Mesh) -> Vec<u8> {
    bake(mesh).self_visibility.expect("some ray is blocked").to_vec()
}

/// A floor that is one small triangle at the origin, and a wall that looms over it at x = -1: 1 m high, 80 m long.
fn floor_beside_a_wall() -> Mesh {
    let corners = [
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.1],
        [0.1, 0.0, 0.0],
        [-1.0, -0.5, -40.0],
        [-1.0, 1.0, -40.0],
        [-1.0, 1.0, 40.0],
        [-1.0, -0.5, 40.0],
    ];
    let triangles = vec![[0, 1, 2], [3, 4, 5], [3, 5, 6]];
    Mesh::new("wall", corners.map(Vec3::from_array).to_vec(), Vec::new(), None, triangles).unwrap()
}

#[test]
fn the_edge_of_a_wall_is_a_great_circle() {
    let mesh = floor_beside_a_wall();
    let vertex = mesh.positions.iter().position(|p| *p == Vec3::ZERO).unwrap();
    assert_eq!(mesh.normals[vertex], Vec3::Y);
    let maps = maps(&mesh);
    let height = 1.0 - f64::from(TRANSFER_OFFSET * mesh.bounding_sphere().1);
    let across = DVec3::new(height, 1.0, 0.0).normalize();
    let mut worst = 0.0_f64;
    for node in 0..NODES {
        let toward = frame(DVec3::Y) * node_direction(node);
        let sine = toward.dot(across);
        // Past the wall's ends, 40 away, their upper corners are nearest.
        let on_circle = toward - sine * across;
        let end = DVec3::new(-1.0, height, 40.0 * toward.z.signum());
        let along = on_circle.z.abs() * end.length() < 40.0 * on_circle.length() && on_circle.y > 0.0;
        let wanted = if along { sine.asin() } else { toward.angle_between(end) };
        let found = decode_angle(maps[vertex * BYTES + node]);
        worst = worst.max((found - wanted.clamp(-LIMIT_RAD, LIMIT_RAD)).abs());
    }
    // Half of a gap of 0.6 degrees, half a step of 0.35, and at the horizon what lies below its rays.
    assert!(worst.to_degrees() < 0.8, "{} degrees", worst.to_degrees());
    // A light whose centre the edge passes through.
    let edge = DVec3::new(-1.0, height, 0.3).normalize();
    let half = visible(&maps[vertex * BYTES..][..BYTES], DVec3::Y, edge, 0.1, f64::INFINITY);
    assert!((half - 0.5).abs() < 0.1, "{half}");
}

#[test]
fn convex_meshes_leave_all_free_outside_and_nothing_inside() {
    for mesh in [generate::sphere(0.5, 2), generate::cuboid(Vec3::new(1.0, 0.5, 2.0), 4)] {
        let surface = bake(&mesh);
        let nothing = surface.transfer.is_none() && surface.self_visibility.is_none();
        assert!(mesh.is_convex() && nothing, "{}: nothing is blocked, so nothing is kept", mesh.name);
    }
    let maps = maps(&inside_out(&generate::sphere(0.5, 2)));
    assert!(maps.chunks_exact(BYTES).flat_map(|map| &map[..NODES]).all(|byte| *byte == encode_angle(-LIMIT_RAD)));
}

const LOOKUP: &str = r#"#version 460
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Cells { uvec2 cells[]; };
layout(std430, binding = 1) readonly buffer Rays { vec4 rays[]; }; // normal, and the light's distance; direction, and its radius
layout(std430, binding = 2) writeonly buffer Found { float found[]; };
layout(push_constant) uniform Push { uint count; uint cell_count; } push;
uvec2 self_cell(uint i) { return cells[i]; }
#include "blocked_share.glsl"
#include "bytes.glsl"
#include "self_visibility.glsl"
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    vec4 normal = rays[2 * i], light = rays[2 * i + 1];
    found[i] = self_visible(i % 16 * push.cell_count, normal.xyz, light.xyz, light.w, normal.w);
}
"#;

#[test]
fn a_shader_finds_what_rust_finds() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("lookup.comp"), LOOKUP).unwrap();
    let library = Library { shader_dir: Some(folder.path().to_path_buf()), ..gpu.library.clone() };
    let shader = library.shader(&ShaderPermutation::new("lookup.comp", 4).self_visibility()).unwrap();
    let pass = ComputePipeline::new(&gpu.device, "lookup", &shader).unwrap();
    let mut rng = fastrand::Rng::with_seed(8);
    let maps: Vec<[u8; BYTES]> = (0..16).map(|_| std::array::from_fn(|_| rng.u8(..))).collect();
    let mut rays: Vec<[Vec3; 2]> = (0..4000).map(|_| [0; 2].map(|_| random_direction(&mut rng).as_vec3())).collect();
    let poles = [Vec3::Z, Vec3::NEG_Z, Vec3::new(1e-4, -2e-4, -1.0).normalize(), Vec3::X, Vec3::Y];
    rays.extend(poles.iter().flat_map(|normal| [[*normal, *normal], [*normal, Vec3::X], [*normal, Vec3::NEG_Y]]));
    let radius = |i: usize| [0.02_f32, 0.1, 0.4][i % 3];
    let distance = |i: usize| [0.5_f32, 1.0, 1e9][i / 3 % 3];
    let quads = |(i, [normal, light]): (usize, &[Vec3; 2])| [normal.extend(distance(i)), light.extend(radius(i))];
    let quads: Vec<Vec4> = rays.iter().enumerate().flat_map(quads).collect();
    let mut words = vec![[0; 2]; CELLS * maps.len()];
    words.chunks_exact_mut(CELLS).zip(&maps).for_each(|(cells, map)| write_cells(map, cells));
    let device = &gpu.device;
    let [words, quads] =
        [Buffer::with_data(device, "cells", &words).unwrap(), Buffer::with_data(device, "rays", &quads).unwrap()];
    let found = Buffer::with_data(device, "found", &vec![f32::NAN; rays.len()]).unwrap();
    let mut commands = Commands::new(device, "lookup").unwrap();
    let resources = [&words, &quads, &found].map(Bind::Buffer);
    let push = [rays.len() as u32, CELLS as u32];
    commands.pass("lookup", |c| c.dispatch(&pass, &resources, &push, [push[0], 1, 1])).unwrap();
    commands.submit().unwrap();
    for (i, found) in found.download::<f32>(rays.len()).unwrap().into_iter().enumerate() {
        let [normal, light] = rays[i].map(Vec3::as_dvec3);
        let wanted = visible(&maps[i % 16], normal, light, radius(i).into(), distance(i).into());
        assert!((f64::from(found) - wanted).abs() < 2e-3, "{normal} {light}: {found}, {wanted}");
    }
}

/// Directions over a round light, equal shares of its solid angle; `turned` by an angle about its middle.
pub fn light_rays(direction: DVec3, angle: f64, count: usize, turned: f64) -> impl Iterator<Item = DVec3> {
    let (a, b) = direction.any_orthonormal_pair();
    (0..count).map(move |i| {
        let cosine = 1.0 - (1.0 - angle.cos()) * (i as f64 + 0.5) / count as f64;
        let turn = turned + 2.399963229728653 * i as f64;
        let sine = (1.0 - cosine * cosine).sqrt();
        sine * turn.cos() * a + sine * turn.sin() * b + cosine * direction
    })
}

/// Direct light of a round light of unit radiance over its solid angle, by a map and sub-lights.
fn by_map(map: &[u8], normal: DVec3, toward: DVec3, angle: f64) -> f64 {
    let blocks = SeenLight::new(1e6 * toward, 1e6 * angle.sin()).blocks();
    let parts = blocks.iter().flat_map(|(_, parts)| parts);
    let sees = |part: &LightPart| visible(map, normal, part.toward, part.sine, f64::INFINITY);
    parts.map(|part| part.share(normal) * sees(part)).sum::<f64>() / (TAU * (1.0 - angle.cos()))
}

/// Its figures stand in `src/field/self_visibility.rs`.
#[test]
fn direct_light_is_that_of_rays() {
    const VERTICES: usize = 150;
    const LIGHTS: usize = 12;
    let pot = "[[mesh]]\nname = \"pot\"\nfile = \"assets/meshes/teapot.obj\"\n[[entity]]\nmesh = \"pot\"\n";
    let scene = scene(pot);
    let mesh = &scene.meshes[0];
    let world = World::of(&scene, &scene.at(0.0));
    let surface = bake(mesh);
    let transfer = surface.transfer.expect("some ray is blocked");
    let maps = surface.self_visibility.expect("some ray is blocked");
    let stride = channel_stride(4);
    let mut rng = fastrand::Rng::with_seed(4);
    let degrees = [1.0_f64, 3.0, 8.0, 15.0, 30.0];
    let mut sums = [[0.0; 3]; 5];
    for _ in 0..VERTICES {
        let index = rng.usize(..mesh.positions.len());
        let map = &maps[index * BYTES..][..BYTES];
        let transfer = &transfer[index * stride..][..16];
        let view = world.view(Vertex { entity: 0, index });
        let normal = mesh.normals[index].as_dvec3();
        for _ in 0..LIGHTS {
            let toward = random_direction(&mut rng);
            let toward = if toward.dot(normal) < 0.0 { -toward } else { toward };
            for (degrees, sums) in degrees.iter().zip(&mut sums) {
                let angle = degrees.to_radians();
                let (mut exact, mut whole) = (0.0, 0.0);
                for ray in light_rays(toward, angle, 96, TAU * rng.f64()).filter(|ray| ray.dot(normal) > 0.0) {
                    whole += ray.dot(normal) / 96.0;
                    exact += if world.blocks_itself(&view, ray, f64::INFINITY) { 0.0 } else { ray.dot(normal) / 96.0 };
                }
                let cap = cap(4, toward, angle);
                let sh = transfer.iter().zip(&cap).map(|(t, c)| f64::from(*t) * c).sum::<f64>();
                let sh = (sh / (TAU * (1.0 - angle.cos()))).max(0.0);
                sums[0] += (by_map(map, normal, toward, angle) - exact).powi(2);
                sums[1] += (sh - exact).powi(2);
                sums[2] += whole * whole;
            }
        }
    }
    for ((degrees, [map, sh, whole]), limit) in degrees.iter().zip(sums).zip([0.055, 0.035, 0.02, 0.013, 0.013]) {
        let (map, sh) = ((map / whole).sqrt(), (sh / whole).sqrt());
        assert!(map < limit && map < 0.7 * sh, "{degrees} degrees: {map} by maps, {sh} by SH");
    }
}
