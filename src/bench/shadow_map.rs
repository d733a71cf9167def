//! A rival that games use: shadow maps, hard and percentage-closer soft (PCSS), for lights that are balls.
//!
//! For every light the occluders are drawn from its centre, into one view that just holds them all, or into the six
//! faces of a cube where they surround it. A compute pass then adds the light to every given point, a vertex or what a
//! pixel shows: its irradiance without occluders in closed form, times one comparison with the map, or times the share
//! of 32 taps that 16 taps for blockers have spread. Texels are compared at their own centres with the receiver's
//! plane, so that hardly any bias is needed. The sky has no shadow map.

use crate::asset::Mesh;
use crate::asset::enclose::around_spheres;
use crate::error::Result;
use crate::gpu::{
    Access, Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, GraphicsPipeline, GraphicsState, Image,
    ImageShape, Target, Timing,
};
use crate::scene::{Placement, Scene};
use crate::shaders::{Library, ShaderPermutation};
use crate::truth::Vertex;
use crate::truth::world::VertexView;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec3, DVec4, Vec4};
use std::sync::Arc;

/// Comparisons with the map for each vertex and light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    Hard,
    /// 16 for the distance of what blocks, then 32.
    Pcss,
}

/// Part of a light's radius from which on occluders are drawn: what is nearer lies within the light.
const NEAR: f64 = 0.5;
/// Ratio of the distance of all occluders to the radius of the ball around them from which on one view holds them.
const OUTSIDE: f64 = 1.15;

/// Distance off its surface from which a point of a bent mesh is compared, in bounding radii: facets bulge out of the
/// plane through a corner.
const OFFSET: f32 = 4e-3;

/// A view from a light: axes, and the tangent of half the angle across.
struct View {
    right: DVec3,
    down: DVec3,
    forward: DVec3,
    slope: f64,
}

struct MappedLight {
    entity: usize,
    centre: DVec3,
    radius_m: f64,
    /// Distance of the nearest occluder, at least [`NEAR`] radii.
    begin_m: f64,
    views: Vec<View>,
}

/// An entity's ball, metres.
type Ball = (DVec3, f64);

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct DrawPush {
    to_view: [[f32; 4]; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LightPush {
    light: [f32; 4],
    radiance: [f32; 4],
    right: [f32; 4],
    down: [f32; 4],
    forward: [f32; 4],
    vertex_count: u32,
    view_count: u32,
    is_first: u32,
}

/// Pipelines, maps and everything of a scene that stays the same while entities move.
pub struct ShadowMaps {
    device: Arc<Device>,
    draw: GraphicsPipeline,
    shade: ComputePipeline,
    map_px: u32,
    color: Image,
    depth: Image,
    meshes: Vec<[Buffer; 2]>,
    vertices: Buffer,
    radiosity: Buffer,
    vertex_count: u32,
}

/// Whether all lights of a scene are balls of one colour, and there is one.
pub fn maps_apply(scene: &Scene) -> bool {
    let is_ball = |mesh: &Mesh| {
        let (centre, radius_m) = mesh.bounding_sphere();
        mesh.colors.is_none() && mesh.positions.iter().all(|p| (p.distance(centre) / radius_m - 1.0).abs() < 1e-3)
    };
    let mut lights = scene.entities.iter().filter(|e| e.emits).peekable();
    lights.peek().is_some() && lights.all(|e| is_ball(&scene.meshes[e.mesh]))
}

impl ShadowMaps {
    /// Vertex, fragment and compute shader.
    pub fn permutations(filter: Filter, map_px: u32) -> [ShaderPermutation; 3] {
        let [searches, taps] = if filter == Filter::Pcss { [16_u32, 32] } else { [0, 0] };
        let shade = ShaderPermutation::new("shadow_map.comp", 4);
        let shade = shade.define("MAP", map_px).define("SEARCHES", searches).define("TAPS", taps);
        [ShaderPermutation::new("shadow_map.vert", 4), ShaderPermutation::new("shadow_map.frag", 4), shade]
    }

    /// Maps of `map_px` texels across a view for a scene to which [`maps_apply`], its entities at `placements`, and the
    /// points to light: an entity, and the view from a place on its surface.
    pub fn new(
        (device, library): (&Arc<Device>, &Library),
        scene: &Scene,
        placements: &[Placement],
        points: &[(Vertex, VertexView)],
        (filter, map_px): (Filter, u32),
    ) -> Result<Self> {
        let [vertex, fragment, shade] = Self::permutations(filter, map_px);
        let surrounded = lights(scene, placements).iter().any(|light| light.views.len() > 1);
        let [width, height] = if surrounded { [3 * map_px, 2 * map_px] } else { [map_px; 2] };
        let image = |name, format| Image::new(device, name, ImageShape { format, width, height, samples: 1 });
        let depth = Some(vk::Format::D32_SFLOAT);
        let state = GraphicsState { depth, ..GraphicsState::plain(vk::Format::R32_SFLOAT) };
        let mesh = |mesh: &Arc<Mesh>| {
            let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.to_array()).collect();
            let positions = Buffer::with_data(device, "shadow map positions", &positions)?;
            Ok([positions, Buffer::with_data(device, "shadow map indices", &mesh.triangles)?])
        };
        let vertices = receivers(scene, placements, points);
        let vertex_count = vertices.len() as u32 / 3;
        Ok(ShadowMaps {
            device: device.clone(),
            draw: GraphicsPipeline::new(
                device,
                "shadow map",
                &library.shader(&vertex)?,
                &library.shader(&fragment)?,
                state,
            )?,
            shade: ComputePipeline::new(device, "shadow map light", &library.shader(&shade)?)?,
            map_px,
            color: image("shadow map", state.color)?,
            depth: image("shadow map depth", vk::Format::D32_SFLOAT)?,
            meshes: scene.meshes.iter().map(mesh).collect::<Result<_>>()?,
            vertices: Buffer::with_data(device, "shadow map vertices", &vertices)?,
            radiosity: Buffer::new(device, "shadow map radiosity", BufferKind::Device, 16 * u64::from(vertex_count))?,
            vertex_count,
        })
    }

    /// Draws all maps and lights all points, and waits.
    pub fn run(&self, scene: &Scene, placements: &[Placement]) -> Result<Vec<Timing>> {
        let occluders = occluders(scene, placements);
        let mut commands = Commands::new(&self.device, "shadow map")?;
        commands.pass("shadow map", |commands| {
            for (index, light) in lights(scene, placements).iter().enumerate() {
                self.draw(commands, scene, placements, light, (index == 0, &occluders))?;
                let resources = [Bind::Image(&self.color), Bind::Buffer(&self.vertices), Bind::Buffer(&self.radiosity)];
                let push = light.push(scene, self.vertex_count, index == 0);
                commands.dispatch(&self.shade, &resources, &push, [self.vertex_count, 1, 1])?;
            }
            Ok(())
        })?;
        commands.submit()
    }

    /// Draws a light's views, with the barriers before and after.
    fn draw<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        scene: &Scene,
        placements: &[Placement],
        light: &MappedLight,
        (is_first, occluders): (bool, &[(usize, Ball)]),
    ) -> Result<()> {
        let before = |access| if is_first { None } else { Some(access) };
        commands.image_barrier(&self.color, before(Access::ComputeSampled), Access::ColorWrite);
        commands.image_barrier(&self.depth, before(Access::DepthWrite), Access::DepthWrite);
        if !is_first {
            // The tracker knows no chain of barriers: that over the reads in between orders these writes too.
            commands.barrier(Access::ColorWrite, Access::ColorWrite);
        }
        let target = Target { color: &self.color, clear: Some([0.0; 4]), depth: Some(&self.depth), resolve: None };
        commands.render(&target, |drawing| {
            for (entity, ball) in occluders.iter().filter(|(entity, _)| *entity != light.entity) {
                let mesh = scene.entities[*entity].mesh;
                let [positions, indices] = &self.meshes[mesh];
                drawing.bind(&self.draw, &[(positions, 0)], indices);
                for (index, view) in light.views.iter().enumerate().filter(|(_, view)| view.may_see(light, ball)) {
                    let index = index as u32;
                    let px = self.map_px;
                    drawing.area(index % 3 * px, index / 3 * px, px, px);
                    drawing.push(&view.push(light, &placements[*entity]));
                    drawing.indexed(0..3 * scene.meshes[mesh].triangles.len() as u32);
                }
            }
            Ok(())
        })?;
        commands.image_barrier(&self.color, Some(Access::ColorWrite), Access::ComputeSampled);
        if !is_first {
            // The light before has added to the same radiosity.
            commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
        }
        Ok(())
    }

    /// Light of the lights on every point after a run: linear RGB radiance.
    pub fn radiosity(&self) -> Result<Vec<[f64; 3]>> {
        let found: Vec<[f32; 4]> = self.radiosity.download(self.vertex_count as usize)?;
        Ok(found.into_iter().map(|[r, g, b, _]| [r, g, b].map(f64::from)).collect())
    }
}

/// Position and entity, normal and offset, and albedo of every point.
fn receivers(scene: &Scene, placements: &[Placement], points: &[(Vertex, VertexView)]) -> Vec<[f32; 4]> {
    let of = |(key, view): &(Vertex, VertexView)| {
        let entity = &scene.entities[key.entity];
        let place = &placements[key.entity];
        let mesh = &scene.meshes[entity.mesh];
        let offset_m = if mesh.is_flat() { 0.0 } else { OFFSET * mesh.bounding_sphere().1 * place.scale };
        let [position, normal] = [view.position, view.normal].map(DVec3::as_vec3);
        let numbers = [(position, key.entity as f32), (normal, offset_m), (entity.albedo, 0.0)];
        numbers.map(|(vector, last)| vector.extend(last).to_array())
    };
    points.iter().flat_map(of).collect()
}

fn ball(scene: &Scene, placements: &[Placement], entity: usize) -> Ball {
    placements[entity].sphere(scene.meshes[scene.entities[entity].mesh].bounding_sphere())
}

fn occluders(scene: &Scene, placements: &[Placement]) -> Vec<(usize, Ball)> {
    let all = (0..scene.entities.len()).filter(|&j| scene.entities[j].occludes);
    all.map(|j| (j, ball(scene, placements, j))).collect()
}

fn lights(scene: &Scene, placements: &[Placement]) -> Vec<MappedLight> {
    let occluders = occluders(scene, placements);
    let lights = (0..scene.entities.len()).filter(|&j| scene.entities[j].emits);
    lights
        .map(|entity| {
            let (centre, radius_m) = ball(scene, placements, entity);
            let others: Vec<Ball> = occluders.iter().filter(|(j, _)| *j != entity).map(|(_, ball)| *ball).collect();
            let nearest = others.iter().map(|(at, r)| at.distance(centre) - r).fold(f64::INFINITY, f64::min);
            let begin_m = nearest.clamp(NEAR * radius_m, f64::MAX);
            MappedLight { entity, centre, radius_m, begin_m, views: views(centre, &others) }
        })
        .collect()
}

/// The view that just holds all balls, or the six faces of a cube.
fn views(from: DVec3, balls: &[Ball]) -> Vec<View> {
    if let Some((centre, radius_m)) = around_spheres(balls)
        && centre.distance(from) > OUTSIDE * radius_m
    {
        let far = centre.distance(from);
        let forward = (centre - from) / far;
        let (right, down) = forward.any_orthonormal_pair();
        return vec![View { right, down, forward, slope: (radius_m / far).asin().tan() }];
    }
    let face = |i: usize| {
        let axis = |k: usize| DVec3::AXES[(i / 2 + k) % 3];
        View { right: axis(1), down: axis(2), forward: axis(0) * [1.0, -1.0][i % 2], slope: 1.0 }
    };
    (0..6).map(face).collect()
}

impl View {
    /// Whether a ball may be seen: it lies wholly outside none of the four sides.
    fn may_see(&self, light: &MappedLight, (centre, radius_m): &Ball) -> bool {
        let at = *centre - light.centre;
        let along = at.dot(self.forward);
        let length = self.slope.hypot(1.0);
        [self.right, self.down].iter().all(|side| (at.dot(*side).abs() - self.slope * along) / length < *radius_m)
    }

    fn push(&self, light: &MappedLight, place: &Placement) -> DrawPush {
        let row = |axis: DVec3| axis.extend(-axis.dot(light.centre));
        let near = DVec4::W * NEAR * light.radius_m / self.slope.hypot(1.0);
        let rows = [row(self.right / self.slope), row(self.down / self.slope), near, row(self.forward)];
        let to_view = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        let scale = DVec3::splat(f64::from(place.scale));
        let to_world = DMat4::from_scale_rotation_translation(scale, place.turn(), place.position.as_dvec3());
        DrawPush { to_view: (to_view * to_world).as_mat4().to_cols_array_2d() }
    }
}

impl MappedLight {
    fn push(&self, scene: &Scene, vertex_count: u32, is_first: bool) -> LightPush {
        let with = |vector: DVec3, last: f64| Vec4::from((vector.as_vec3(), last as f32)).to_array();
        let view = &self.views[0];
        LightPush {
            light: with(self.centre, self.radius_m),
            radiance: scene.entities[self.entity].emission.extend(self.entity as f32).to_array(),
            right: with(view.right, view.slope),
            down: with(view.down, self.begin_m),
            forward: with(view.forward, 0.0),
            vertex_count,
            view_count: self.views.len() as u32,
            is_first: u32::from(is_first),
        }
    }
}
