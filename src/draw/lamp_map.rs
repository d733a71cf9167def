//! Cube maps of what rests around the parts of lamps that rest: how near the nearest surface is. They are drawn once,
//! and tell vertices, and pixels that evaluate lights, how much of each part they see past it (`glsl/lamp_map.glsl`).
//!
//! Outlines of 32 texels let light through thin bent sheets, as the reflectors around tubes are, and a pixel looks up
//! those of all that may stand before a lamp: among 797 things 470 stand on a list of a wall, of which 26 are looked up
//! for each lamp. A map takes the same time whatever it holds.

use crate::draw::sun_map::{HEIGHT, MapCaster, View, draw, pipelines};
use crate::draw::{DEPTH, camera};
use crate::error::Result;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device, Image, ImageShape, Target};
use crate::layout::LampMap;
use crate::shaders::Library;
use glam::{DVec3, DVec4};
use std::iter::repeat_n;
use std::sync::Arc;

const FACES: u32 = 6;
/// Texels of all maps together where the device's views hold as many, and the most along an edge of a face.
const MOST_TEXELS: u32 = 1 << 24;
const MOST_FACE_PX: u32 = 512;
const TEXEL_BYTES: u64 = 4;

/// A lamp around whose parts there are maps.
pub struct MappedLamp {
    /// Entities that its maps leave out.
    pub apart: Vec<usize>,
    /// Middles of its parts, one or four, world.
    pub middles: Vec<DVec3>,
    /// How far from there what hides it may begin, metres.
    pub nearest_m: f64,
}

pub struct LampMaps {
    /// Faces of all maps, row by row: `nearest_m` over the distance along the face's axis, 0 where nothing stands.
    pub texels: Buffer,
    /// [`LampMap`] of each part, four to a lamp.
    pub maps: Buffer,
}

impl LampMaps {
    /// Draws the maps, and waits. There is a lamp, and something that casts shadows.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        lamps: &[MappedLamp],
        casters: &[MapCaster<'_>],
    ) -> Result<Self> {
        let faces: u32 = lamps.iter().map(|lamp| FACES * lamp.middles.len() as u32).sum();
        let most_faces = lamps.iter().map(|lamp| FACES * lamp.middles.len() as u32).max().unwrap_or(FACES);
        let most_texels = MOST_TEXELS.min(device.limits.max_texel_buffer_elements);
        let side_px = (most_texels / faces).isqrt().min(MOST_FACE_PX).min(device.most_image_px() / most_faces);
        let face_bytes = TEXEL_BYTES * u64::from(side_px * side_px);
        let texels = Buffer::new(device, "lamp maps", BufferKind::Device, u64::from(faces) * face_bytes)?;
        let shape = |format| ImageShape { format, width: side_px, height: most_faces * side_px, samples: 1 };
        let image = Image::new(device, "faces of a lamp", shape(HEIGHT))?;
        let depth = Image::new(device, "depth of a lamp's faces", shape(DEPTH))?;
        let target = Target { color: &image, second: None, clear: Some([0.0; 4]), depth: Some(&depth), resolve: None };
        let pipelines = pipelines(device, library)?;
        let mut maps = Vec::new();
        let mut first_face = 0;
        for lamp in lamps {
            let mut commands = Commands::new(device, "lamp maps")?;
            commands.image_barrier(&image, None, Access::ColorWrite);
            commands.image_barrier(&depth, None, Access::DepthWrite);
            let others: Vec<&MapCaster<'_>> =
                casters.iter().filter(|caster| !lamp.apart.contains(&caster.entity)).collect();
            let views = lamp.views(side_px);
            commands.pass("lamp map", |commands| {
                commands.render(&target, |drawing| {
                    for view in &views {
                        drawing.area(view.area);
                        let mut shown = others.iter().filter(|caster| is_shown(view, caster));
                        shown.try_for_each(|caster| draw(drawing, &pipelines, view, caster))?;
                    }
                    Ok(())
                })
            })?;
            commands.image_barrier(&image, Some(Access::ColorWrite), Access::TransferRead);
            let faces = views.len() as u32;
            let bytes = u64::from(first_face) * face_bytes..u64::from(first_face + faces) * face_bytes;
            commands.copy_rows(&image, faces * side_px, &texels, bytes);
            commands.barrier(Access::TransferWrite, Access::ComputeSampled);
            commands.submit()?;
            let of_part = (0..).zip(&lamp.middles).map(|(part, middle)| LampMap {
                middle: middle.as_vec3().to_array(),
                nearest_m: lamp.nearest_m as f32,
                most_inverse: (1.0 / least_gap_m(*middle, &others).max(lamp.nearest_m)) as f32,
                side_px: side_px as f32,
                first_texel: (first_face + FACES * part) * side_px * side_px,
                parts: lamp.middles.len() as u32,
            });
            maps.extend(of_part);
            // A lamp of one part has it four times, so that four maps belong to each.
            maps.extend(repeat_n(maps[maps.len() - 1], 4 - lamp.middles.len()));
            first_face += faces;
        }
        Ok(LampMaps { texels, maps: Buffer::with_data(device, "lamp map places", &maps)? })
    }
}

impl MappedLamp {
    /// The faces of all parts, below each other.
    fn views(&self, side_px: u32) -> Vec<View> {
        let faces = self.middles.iter().flat_map(|&middle| (0..FACES).map(move |face| (middle, face)));
        let view = |((middle, face), number): ((DVec3, u32), u32)| View {
            area: [0, number * side_px, side_px, side_px],
            clip_from_world: camera::cube_face_from_world(middle, self.nearest_m, face as usize, 1.0),
        };
        faces.zip(0..).map(view).collect()
    }
}

/// Whether any of the box around a caster may lie in a view.
fn is_shown(view: &View, caster: &MapCaster<'_>) -> bool {
    let corners = caster.corners.map(|corner| view.clip_from_world * corner.extend(1.0));
    let planes: [fn(&DVec4) -> f64; 5] = [|c| c.z - c.w, |c| c.x - c.w, |c| -c.x - c.w, |c| c.y - c.w, |c| -c.y - c.w];
    !planes.into_iter().any(|beyond| corners.iter().all(|corner| beyond(corner) > 0.0))
}

/// How near the boxes around casters come to a place, metres.
fn least_gap_m(place: DVec3, casters: &[&MapCaster<'_>]) -> f64 {
    let gap_m = |caster: &&MapCaster<'_>| {
        let corners = caster.corners.into_iter();
        let [low, high] =
            corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], c| [low.min(c), high.max(c)]);
        place.distance(place.clamp(low, high))
    };
    casters.iter().map(gap_m).fold(f64::INFINITY, f64::min)
}
