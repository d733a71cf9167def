//! The front door: a scene on a device, its light by vertex, and its picture.
//!
//! ```no_run
//! use shadow_fields::prelude::*;
//!
//! # fn main() -> Result<(), Error> {
//! let gpu = Gpu::own(&DeviceOptions { cache_dir: Cache::usual_folder(), ..Default::default() })?;
//! let scene = Scene::load("assets/scenes/teapot_lights.toml".as_ref())?;
//! let mut renderer = Renderer::new(&gpu, &scene, &RenderOptions::default())?;
//! renderer.update(&scene.at(0.5))?;
//! println!("radiosity of the first vertex: {:?}", renderer.light()?[0][0]);
//! renderer.write_png("picture.png".as_ref())?;
//! # Ok(())
//! # }
//! ```
//!
//! [`Gpu::from_vulkan`](crate::gpu::Gpu::from_vulkan) takes a device that the caller has made, and
//! [`Renderer::light_buffer`] gives the light to it where it lies. The files in `examples/` show each of these.

use crate::asset::decode::Picture;
use crate::asset::{Mesh, picture};
use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::bake::ensure::SceneProgress;
use crate::error::{Error, Result};
use crate::field::quantity::channel_stride;
pub use crate::frame::RenderOptions;
use crate::frame::{self, Frame};
use crate::gpu::Gpu;
use crate::scene::{Camera, Placement, Scene};
use crate::sh::lobe;
use crate::shaders::Library;
use crate::truth::exposure;
use ash::vk;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Largest magnitude of a coordinate of a placement, metres, and largest scale; suns stand at a tenth of it.
const FARTHEST_M: f32 = 1e10;

/// The light of all entities on the device: four floats a vertex, linear RGB radiance that leaves the surface, without
/// emission, and a fourth for the library's own use.
#[derive(Clone, Debug)]
pub struct LightBuffer<'r> {
    /// The buffer, of usages storage, uniform, uniform texel, vertex, index, and both transfers. It stays the
    /// renderer's and is the same as long as that lives. On a device of [`Gpu::from_vulkan`] all writes of a call are
    /// visible to every command that the caller submits to the same queue after the call (a barrier to all commands and
    /// all reads is part of it), so that it needs no barrier of its own.
    pub buffer: vk::Buffer,
    /// Its size in bytes.
    pub size_bytes: u64,
    /// The stage that wrote it last, for a caller that tracks states.
    pub stage: vk::PipelineStageFlags2,
    /// The access by which it was written last.
    pub access: vk::AccessFlags2,
    /// Where the light of each entity lies.
    pub entities: Vec<LightRange<'r>>,
}

/// The light of one entity in a [`LightBuffer`].
#[derive(Clone, Debug)]
pub struct LightRange<'r> {
    /// Bytes in the buffer, 16 a vertex. They stay black where the entity does not receive light.
    pub bytes: Range<u64>,
    /// Which vertex of [`Renderer::mesh`] stands at each place of that range: the light of neighbours lies together.
    pub order: &'r [u32],
}

/// Transfer vectors of the vertices of an entity: what each makes of distant light that nothing else blocks. With the
/// light's coefficients L in the entity's own frame, the radiosity is albedo / pi times the sum of T * L.
#[derive(Clone, Debug, PartialEq)]
pub struct Transfer {
    /// SH bands; a vector has bands^2 coefficients.
    pub bands: usize,
    /// The vectors in the order of vertices of [`Renderer::mesh`], one after another.
    pub coefficients: Vec<f32>,
}

/// A scene on a device, ready to be lit and drawn at any time.
pub struct Renderer {
    gpu: Gpu,
    frame: Frame,
    /// Where everything stands as the scene has it.
    stood: Vec<Placement>,
    /// Where everything stands; `None` until the first update.
    placements: Option<Vec<Placement>>,
    /// Light by entity as the host has it; empty until it is asked for.
    light: Vec<Vec<[f32; 3]>>,
}

impl Renderer {
    /// Bakes what the scene needs, or finds it in the cache, and builds the passes. A scene that states no exposure gets
    /// the one that suits its light at its own time, by a few rays; a camera that was added to a file is placed for the
    /// picture's shape. [`Renderer::scene`] has both.
    ///
    /// # Errors
    /// As [`Frame::new`]; `Input` where an option is out of its range.
    pub fn new(gpu: &Gpu, scene: &Scene, options: &RenderOptions) -> Result<Self> {
        Self::with_progress(gpu, scene, options, &|_, _, _| ())
    }

    /// As [`Renderer::new`], and tells `progress` what is being baked, the samples that are done and the samples in
    /// all.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_progress(
        gpu: &Gpu,
        scene: &Scene,
        options: &RenderOptions,
        progress: SceneProgress<'_>,
    ) -> Result<Self> {
        let frame_options = frame::Options { pictures: false, ..options.frame(scene)? };
        let mut scene = scene.clone();
        // A scene that was put together by edits rests where it is now.
        scene.rejoin();
        let time_s = scene.data.output.time_s;
        let aspect = f64::from(frame_options.size[0]) / f64::from(frame_options.size[1]);
        scene.fit_added_camera(aspect);
        if let Some(said) = exposure::settle(&mut scene, time_s, aspect) {
            log::info!("{said}");
        }
        let folder = gpu.device().cache_dir.clone();
        let cache = options.cache.clone().unwrap_or_else(|| Cache::new(folder.as_deref()));
        let baker = Baker::new(gpu.device(), &Library { shader_dir: None, cache_dir: folder });
        let frame = Frame::new(&baker, &cache, &scene, frame_options, progress)?;
        gpu.device().save_pipeline_cache();
        Ok(Renderer { gpu: gpu.clone(), frame, stood: scene.at(time_s), placements: None, light: Vec::new() })
    }

    /// Lights every receiver with all entities placed so, as far as anything has changed since the last call. The list
    /// is as that of [`Scene::at`], with other placements for those that move: entities in the scene's order, then
    /// suns. What has motion of its own or is `movable` may stand anywhere; what rests is lit past all else that rests,
    /// and stays where it is.
    ///
    /// # Errors
    /// `Input` where the list has another length than the scene has entities, or a placement has a number that is not
    /// finite or over 1e10, a rotation that is not of unit length, or a scale that is not positive, or moves what rests
    /// or what nodes carry against the others that they carry; `Device` when the device was lost.
    pub fn update(&mut self, placements: &[Placement]) -> Result<()> {
        let entities = &self.frame.scene().entities;
        if placements.len() != entities.len() {
            let counts = format!("{} placements for {} entities", placements.len(), entities.len());
            return Err(Error::Input(counts));
        }
        for (placement, entity) in placements.iter().zip(entities) {
            let Placement { position, rotation, scale } = placement;
            let is_good = position.is_finite()
                && position.abs().max_element() <= FARTHEST_M
                && (0.999..1.001).contains(&rotation.length_squared())
                && (f32::MIN_POSITIVE..=FARTHEST_M).contains(scale);
            if !is_good {
                let ranges = format!("rotations have length 1, scales are above 0, places lie within {FARTHEST_M:e} m");
                return Err(Error::Input(format!("{:?}: {placement:?} is out of range: {ranges}", entity.name)));
            }
        }
        if let Some(entity) = self.frame.groups.displaced(self.frame.scene(), &self.stood, placements) {
            let why = if self.frame.scene().is_at_rest(entity) {
                "it rests in the scene"
            } else {
                "it has left its place among what the same nodes carry"
            };
            return Err(Error::Input(format!("{:?}: {why}; `movable` lets it stand anywhere", entities[entity].name)));
        }
        self.light.clear();
        self.frame.render(placements, None)?;
        self.placements = Some(placements.to_vec());
        Ok(())
    }

    /// The mesh of an entity as it is lit and drawn: the scene's, or one of the same shape with more vertices where light
    /// varies.
    ///
    /// # Panics
    /// Where there is no such entity.
    pub fn mesh(&self, entity: usize) -> &Arc<Mesh> {
        self.frame.scene().surface(entity)
    }

    /// Radiosity of every vertex, by entity in the scene's order and by vertex of [`Renderer::mesh`]: linear RGB radiance
    /// that leaves the surface, without emission, in W m^-2 sr^-1; zero where an entity does not receive. Before the
    /// first update it is that of the scene's own time.
    ///
    /// # Errors
    /// As [`Renderer::update`].
    pub fn light(&mut self) -> Result<&[Vec<[f32; 3]>]> {
        self.start()?;
        if self.light.is_empty() {
            let count = self.frame.scene().entities.len();
            self.light = (0..count).map(|entity| self.frame.radiosity(entity)).collect::<Result<_>>()?;
        }
        Ok(&self.light)
    }

    /// Where the light lies on the device, for whoever shares it; black before the first update.
    pub fn light_buffer(&self) -> LightBuffer<'_> {
        let (buffer, ranges) = self.frame.light_buffer();
        LightBuffer {
            buffer: buffer.raw(),
            size_bytes: buffer.size_bytes,
            stage: vk::PipelineStageFlags2::COMPUTE_SHADER,
            access: vk::AccessFlags2::SHADER_STORAGE_WRITE,
            entities: ranges.into_iter().map(|(bytes, order)| LightRange { bytes, order }).collect(),
        }
    }

    /// Transfer vectors of an entity's vertices, in its own frame, past all that never moves against it: baked ones, or
    /// the cosine lobes of the normals where nothing blocks.
    ///
    /// # Errors
    /// `Input` where there is no such entity, or where none were baked, as no light of the scene goes through spherical
    /// harmonics; `Device` when memory ran out.
    pub fn transfer(&self, entity: usize) -> Result<Transfer> {
        let scene = self.frame.scene();
        let bands = self.frame.buffers.bands;
        let known = scene.entities.get(entity);
        let mesh = known.ok_or_else(|| Error::Input(format!("there is no entity {entity}")))?.mesh;
        if let Some((floats, stride)) = self.frame.buffers.baked_transfer(self.frame.buffers.surface(entity))? {
            debug_assert_eq!(stride, channel_stride(bands));
            let vectors = floats.chunks_exact(stride).flat_map(|vector| &vector[..bands * bands]);
            return Ok(Transfer { bands, coefficients: vectors.copied().collect() });
        }
        if crate::bake::bakes_transfer(&scene.meshes[mesh]) && !self.frame.has_harmonics() {
            let what = "no transfer was baked, as no light of the scene goes through spherical harmonics";
            return Err(Error::Input(format!("{:?}: {what}", scene.entities[entity].name)));
        }
        let lobes = scene.surface(entity).normals.iter().flat_map(|n| lobe::clamped_cosine(bands, n.as_dvec3()));
        Ok(Transfer { bands, coefficients: lobes.map(|c| c as f32).collect() })
    }

    /// The picture of what was lit last, as the camera sees it: linear values. Radiance above what the scene's exposure
    /// shows as white is brought down to white, hue kept.
    ///
    /// # Errors
    /// As [`Renderer::update`].
    pub fn picture(&mut self) -> Result<Picture> {
        self.start()?;
        let placements = self.placements.as_deref().unwrap_or_default();
        let white = self.frame.scene().data.output.white();
        self.frame.redraw(placements, white)?;
        let [width, height] = self.frame.size().map(|px| px as usize);
        Ok(Picture { width, height, rgb: self.frame.picture(), is_linear: true, is_transparent: false })
    }

    /// Writes [`Renderer::picture`] as PNG, with the scene's exposure.
    ///
    /// # Errors
    /// As [`Renderer::picture`]; `Failed` where the path cannot be written.
    pub fn write_png(&mut self, path: &Path) -> Result<()> {
        let shown = self.picture()?;
        let exposure_ev = self.frame.scene().data.output.exposure_ev();
        picture::write_png(path, shown.width as u32, shown.height as u32, &shown.rgb, exposure_ev)
    }

    /// Sees the scene from elsewhere from now on.
    ///
    /// # Errors
    /// As [`Camera::check`].
    pub fn set_camera(&mut self, camera: &Camera) -> Result<()> {
        camera.check()?;
        self.frame.set_camera(camera);
        Ok(())
    }

    /// The scene that is lit, with the camera as it stands.
    pub fn scene(&self) -> &Scene {
        self.frame.scene()
    }

    /// The device that it is lit on.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The frame behind it, for all that the library has below its front door.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Lights the scene's own time where nothing was lit yet.
    fn start(&mut self) -> Result<()> {
        if self.placements.is_some() {
            return Ok(());
        }
        let placements = self.frame.scene().at(self.frame.scene().data.output.time_s);
        self.update(&placements)
    }
}
