//! Maps of what rests as suns see it: how near to the sun the nearest surface is. They are drawn once, and tell the pixels
//! that evaluate lights how much of a sun's disc they see past it (`glsl/sun_map.glsl`).
//!
//! Outlines are of convex things and of what is far; the shadows of a room's own walls, of railings and of trees were as
//! fine as the vertices on which they fell.

use crate::bake::surfaces::CrispSun;
use crate::draw::triangles::DrawnTriangles;
use crate::draw::{DEPTH, DrawnMesh, DrawnPaint};
use crate::error::Result;
use crate::gpu::{
    Access, Bind, Buffer, Commands, Device, Drawing, GraphicsPipeline, GraphicsState, Image, ImageShape, Target,
};
use crate::layout::SunMap;
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec2, DVec3, DVec4};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Texels along the longer side of a map: as many as make them 3 mm wide, within these limits.
const SIDE_PX: [f64; 2] = [1024.0, 4096.0];
const TEXEL_M: f64 = 0.003;
/// Turns about the way to the sun of which the one with the smallest map is taken.
const TURNS: u32 = 12;
/// Share of its height by which a map reaches beyond what it holds.
const MARGIN: f64 = 1e-3;

pub(super) const HEIGHT: vk::Format = vk::Format::R32_SFLOAT;
/// First of the two bindings of maps in the shader that looks them up.
pub const SUN_BINDING: u32 = 18;

/// What maps hold.
pub struct MapCaster<'d> {
    pub entity: usize,
    /// Whether it may hide a sun from anything.
    pub hides_suns: bool,
    pub mesh: &'d DrawnMesh,
    pub world_from_object: DMat4,
    /// Corners of the box around it, world.
    pub corners: [DVec3; 8],
    /// What cuts holes into it.
    pub paint: Option<DrawnPaint<'d>>,
}

/// A rectangle of all maps, and what is drawn there.
pub(super) struct View {
    /// Left, top, width and height in texels.
    pub area: [u32; 4],
    pub clip_from_world: DMat4,
}

/// The map of a sun.
fn sun_map(sun: &CrispSun, casters: &[MapCaster<'_>], left: u32) -> (View, SunMap) {
    let (x, y) = sun.toward.any_orthonormal_pair();
    let turned = (0..TURNS).map(|turn| {
        let turn = DVec2::from_angle(FRAC_PI_2 * f64::from(turn) / f64::from(TURNS));
        let axes = [turn.x * x + turn.y * y, turn.x * y - turn.y * x, sun.toward];
        let corners = casters.iter().filter(|caster| caster.hides_suns).flat_map(|caster| caster.corners);
        let places = corners.map(|corner| DVec3::from(axes.map(|axis| axis.dot(corner))));
        let [low, high] =
            places.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], place| [low.min(place), high.max(place)]);
        (axes, low, high - low)
    });
    let area = |size: DVec3| size.x * size.y;
    let (axes, low, size) = turned.min_by(|a, b| area(a.2).total_cmp(&area(b.2))).expect("there are turns");
    let margin = MARGIN * size.max_element();
    let low = low - margin;
    let size = size + 2.0 * margin;
    let longer = size.x.max(size.y);
    let texel_m = longer / (longer / TEXEL_M).clamp(SIDE_PX[0], SIDE_PX[1]).floor();
    let [width, height] = [size.x, size.y].map(|side| (side / texel_m).ceil() as u32);
    let [across, down, toward] = axes;
    let row = |axis: DVec3, low: f64, scale: f64, first: f64| (scale * axis).extend(first - scale * low);
    let rows = [
        row(across, low.x, 2.0 / (f64::from(width) * texel_m), -1.0),
        row(down, low.y, 2.0 / (f64::from(height) * texel_m), -1.0),
        row(toward, low.z, 1.0 / size.z, 0.0),
        DVec4::W,
    ];
    let clip_from_world = DMat4::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose();
    let half = 0.5 * size;
    let middle = ((low.x + half.x) * across + (low.y + half.y) * down + (low.z + half.z) * toward).as_vec3();
    let from = low - DVec3::from(axes.map(|axis| axis.dot(middle.as_dvec3())));
    let texels = |axis: DVec3| (axis / texel_m).as_vec3().to_array();
    let map = SunMap {
        across: texels(across),
        across_first: (f64::from(left) - from.x / texel_m) as f32,
        down: texels(down),
        down_first: (-from.y / texel_m) as f32,
        toward: toward.as_vec3().to_array(),
        lowest: from.z as f32,
        low: [left as f32 + 0.5, 0.5],
        high: [(left + width) as f32 - 0.5, height as f32 - 0.5],
        range_m: size.z as f32,
        texel_m: texel_m as f32,
        tangent: sun.half_angle_rad.tan() as f32,
        middle: middle.to_array(),
        ..SunMap::default()
    };
    (View { area: [left, 0, width, height], clip_from_world }, map)
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    clip_from_object: [f32; 16],
    alpha_cutoff: f32,
}

pub struct SunMaps {
    /// All maps side by side.
    pub heights: Image,
    /// [`SunMap`] of each.
    pub maps: Buffer,
}

impl SunMaps {
    /// Draws the maps of at most [`crate::layout::MOST_SUN_MAPS`] suns, and waits. There is something that casts shadows.
    pub fn new(device: &Arc<Device>, library: &Library, suns: &[CrispSun], casters: &[MapCaster<'_>]) -> Result<Self> {
        let mut views = Vec::new();
        let mut maps = Vec::new();
        let mut width = 0;
        let mut height = 0;
        for sun in suns {
            let (view, map) = sun_map(sun, casters, width);
            width += view.area[2];
            height = height.max(view.area[3]);
            views.push(view);
            maps.push(map);
        }
        let image = |name, format| Image::new(device, name, ImageShape { format, width, height, samples: 1 });
        let heights = image("sun maps", HEIGHT)?;
        let depth = image("sun map depth", DEPTH)?;
        let pipelines = pipelines(device, library)?;
        let mut commands = Commands::new(device, "sun maps")?;
        commands.image_barrier(&heights, None, Access::ColorWrite);
        commands.image_barrier(&depth, None, Access::DepthWrite);
        let target =
            Target { color: &heights, second: None, clear: Some([0.0; 4]), depth: Some(&depth), resolve: None };
        commands.pass("sun map", |commands| {
            commands.render(&target, |drawing| {
                for view in &views {
                    drawing.area(view.area);
                    let mut casters = casters.iter().filter(|caster| caster.hides_suns);
                    casters.try_for_each(|caster| draw(drawing, &pipelines, view, caster))?;
                }
                Ok(())
            })
        })?;
        commands.image_barrier(&heights, Some(Access::ColorWrite), Access::ComputeSampled);
        commands.submit()?;
        Ok(SunMaps { maps: Buffer::with_data(device, "sun maps", &maps)?, heights })
    }

    /// Vertex and fragment shader that draw what casts shadows.
    pub fn rows(holes: bool) -> [ShaderPermutation; 2] {
        let row = |file| ShaderPermutation::new(file, 4).define("HOLES", holes).define("SAMPLES", 1_u32);
        [row("sun_map.vert"), row("sun_map.frag")]
    }
}

/// What draws casters without holes, and with them.
pub(super) fn pipelines(device: &Arc<Device>, library: &Library) -> Result<[GraphicsPipeline; 2]> {
    let state = GraphicsState { depth: Some(DEPTH), ..GraphicsState::plain(HEIGHT) };
    let pipeline = |holes: bool| {
        let [vertex, fragment] = SunMaps::rows(holes);
        GraphicsPipeline::new(device, "map of a light", &library.shader(&vertex)?, &library.shader(&fragment)?, state)
    };
    Ok([pipeline(false)?, pipeline(true)?])
}

pub(super) fn draw<'r>(
    drawing: &mut Drawing<'_, 'r>,
    [plain, with_holes]: &'r [GraphicsPipeline; 2],
    view: &View,
    caster: &MapCaster<'r>,
) -> Result<()> {
    let push = |alpha_cutoff| Push {
        clip_from_object: (view.clip_from_world * caster.world_from_object).as_mat4().to_cols_array(),
        alpha_cutoff,
    };
    let (positions, indices) = match caster.mesh {
        DrawnMesh::Grid(grid, _) => (&grid.positions, &grid.indices),
        DrawnMesh::Triangles(mesh) => (&mesh.positions, &mesh.indices),
    };
    match (caster.mesh, caster.paint) {
        (DrawnMesh::Triangles(DrawnTriangles { paint: Some(places), .. }), Some(paint)) => {
            drawing.bind(with_holes, &[(positions, 0), (places, 0)], indices);
            drawing.resources(&[Bind::Texture(paint.texture)])?;
            drawing.push(&push(paint.alpha_cutoff));
        }
        _ => {
            drawing.bind(plain, &[(positions, 0)], indices);
            drawing.push(&push(0.0));
        }
    }
    caster.mesh.seen(None).into_iter().for_each(|range| drawing.indexed(range));
    Ok(())
}
