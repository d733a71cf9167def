//! Radiosity of all vertices: what the merge writes, and what comes from elsewhere to be compared with it.

use super::viewport::RadiositySource;
use crate::bounce::{BouncedLight, Bounces};
use crate::error::Result;
use crate::gpu::{Buffer, BufferKind, Device};
use crate::scene::{LightMethod, Scene};
use crate::scene_buffers::SceneBuffers;
use crate::sharp::KeptIrradiance;
use std::sync::Arc;

/// Four floats a vertex: linear RGB radiance that leaves the surface, and 1 where pixels evaluate lights. The vertices of
/// one entity follow those of another, each in the order of its mesh's [`crate::scene_buffers::DeviceMesh`].
pub(super) struct RadiosityBuffers {
    pub merged: Buffer,
    /// Light without that of sharp lights, in a scene that has any: what the merge writes then.
    soft: Option<Buffer>,
    /// The same two before light has bounced, where it does: then the merge and the pass of sharp lights write these.
    direct: Option<Direct>,
    /// Zeros, where mirrors show nothing but lamps.
    dark: Option<Buffer>,
    /// Irradiance of every vertex by sharp lights, once pixels evaluate these.
    irradiances: Option<Irradiances>,
    /// The first byte of each entity.
    pub offsets: Vec<u64>,
    comparisons: [Option<Buffer>; 2],
}

/// Direct light: all of it, and that without sharp lights where there are any.
struct Direct {
    all: Buffer,
    soft: Option<Buffer>,
    /// Share of its view that sharp lights take of every vertex, a float each.
    lamps: Option<Buffer>,
}

/// Sharp lights whose irradiances are kept. Pixels evaluate those beyond wherever they evaluate any.
const MOST_KEPT_LIGHTS: usize = 64;

/// Irradiance of every vertex by each of the first sharp lights ([`KeptIrradiance`]): of one light on all vertices, then of the
/// next. Zero where it is dark, and below where pixels around the vertex have to evaluate the light.
struct Irradiances {
    buffer: Buffer,
    /// The lights' entities, in this order.
    lights: Vec<usize>,
}

impl RadiosityBuffers {
    /// Zero for every vertex of a scene: those that receive no light stay so.
    pub fn new(device: &Arc<Device>, scene: &Scene, buffers: &SceneBuffers) -> Result<Self> {
        let mut offsets = Vec::new();
        let mut size_bytes = 0;
        for entity in 0..scene.entities.len() {
            offsets.push(size_bytes);
            size_bytes += 16 * buffers.surface(entity).vertices.len() as u64;
        }
        let size_bytes = size_bytes.max(16);
        Ok(RadiosityBuffers {
            merged: Buffer::zeros(device, "radiosity", size_bytes)?,
            soft: None,
            direct: None,
            dark: None,
            irradiances: None,
            offsets,
            comparisons: Default::default(),
        })
    }

    /// Keeps light without that of sharp lights apart from now on.
    pub fn keep_soft(&mut self) -> Result<()> {
        self.soft = Some(Buffer::zeros(self.merged.device(), "soft radiosity", self.merged.size_bytes)?);
        Ok(())
    }

    /// Keeps the irradiances by the first sharp lights from now on, at most as many as the device can bind at once.
    pub fn keep_irradiances(&mut self, scene: &Scene, methods: &[LightMethod]) -> Result<()> {
        if self.irradiances.is_some() {
            return Ok(());
        }
        let is_kept = |&light: &usize| scene.entities[light].emits && methods[light].is_sharp();
        let device = self.merged.device();
        let limits = &device.limits;
        let bound =
            limits.max_texel_buffer_elements.min(limits.max_storage_buffer_range / size_of::<KeptIrradiance>() as u32);
        let vertices = self.merged.size_bytes / 16;
        let most = (u64::from(bound) / vertices) as usize;
        let lights = (0..scene.entities.len()).filter(is_kept);
        let lights: Vec<usize> = lights.take(most.min(MOST_KEPT_LIGHTS)).collect();
        let size_bytes = (lights.len() as u64 * vertices).max(1) * size_of::<KeptIrradiance>() as u64;
        let buffer = Buffer::zeros(device, "irradiances", size_bytes)?;
        self.irradiances = Some(Irradiances { buffer, lights });
        Ok(())
    }

    /// Keeps direct light apart from now on, for bounces to add to it.
    pub fn keep_direct(&mut self) -> Result<()> {
        let like = |of: &Buffer, name: &str| Buffer::zeros(of.device(), name, of.size_bytes);
        self.direct = Some(Direct {
            all: like(&self.merged, "direct light")?,
            soft: self.soft.as_ref().map(|soft| like(soft, "soft direct light")).transpose()?,
            lamps: self
                .soft
                .as_ref()
                .map(|soft| Buffer::zeros(soft.device(), "shares of lamps", soft.size_bytes / 4))
                .transpose()?,
        });
        Ok(())
    }

    /// Keeps zeros for what mirrors show where no light bounces.
    pub fn keep_dark(&mut self) -> Result<()> {
        self.dark = Some(Buffer::zeros(self.merged.device(), "dark radiosity", self.merged.size_bytes)?);
        Ok(())
    }

    /// The light that mirrors show, with one bounce less than all.
    pub fn mirrored(&self, bounces: Bounces) -> &Buffer {
        match bounces {
            Bounces::None => self.dark.as_ref().unwrap_or(&self.merged),
            Bounces::One => self.direct(),
            Bounces::All => &self.merged,
        }
    }

    /// The bytes of an entity of so many vertices.
    pub fn bytes(&self, entity: usize, vertex_count: usize) -> std::ops::Range<u64> {
        let first = self.offsets[entity];
        first..first + 16 * vertex_count as u64
    }

    /// The irradiances by sharp lights, and by how many.
    pub fn irradiances(&self) -> Option<(&Buffer, u32)> {
        self.irradiances.as_ref().map(|kept| (&kept.buffer, kept.lights.len() as u32))
    }

    /// The first of a light's irradiances, if they are kept.
    pub fn irradiance_first(&self, light: usize) -> Option<u32> {
        let place = self.irradiances.as_ref()?.lights.binary_search(&light).ok()?;
        Some((place as u64 * self.merged.size_bytes / 16) as u32)
    }

    /// All light but that of sharp lights.
    pub fn soft(&self) -> &Buffer {
        self.soft.as_ref().unwrap_or(&self.merged)
    }

    /// All direct light: what the merge writes, and the pass of sharp lights.
    pub fn direct(&self) -> &Buffer {
        self.direct.as_ref().map_or(&self.merged, |direct| &direct.all)
    }

    /// Output of the merge.
    pub fn soft_direct(&self) -> &Buffer {
        match &self.direct {
            Some(direct) => direct.soft.as_ref().unwrap_or(&direct.all),
            None => self.soft(),
        }
    }

    /// Where the pass of sharp lights says how much of its view they take of every vertex.
    pub fn lamps(&self) -> Option<&Buffer> {
        self.direct.as_ref()?.lamps.as_ref()
    }

    /// What bounces take and give.
    pub fn bounced(&self) -> BouncedLight<'_> {
        BouncedLight {
            direct: self.direct(),
            radiosity: &self.merged,
            soft_direct: self.soft.as_ref().map(|_| self.soft_direct()),
            soft: self.soft.as_ref(),
            lamps: self.lamps(),
        }
    }

    /// An entity's values in the mesh's order of vertices.
    pub fn read(&self, entity: usize, order: &[u32]) -> Result<Vec<[f32; 3]>> {
        let quads: Vec<[f32; 4]> = self.merged.download_range(self.bytes(entity, order.len()))?;
        let mut values = vec![[0.0; 3]; quads.len()];
        for (&v, [r, g, b, _]) in order.iter().zip(quads) {
            values[v as usize] = [r, g, b];
        }
        Ok(values)
    }

    /// Writes one of the two comparisons: for each entity its order of vertices and its values; what is not given is
    /// `rest`.
    pub fn compare<'v>(
        &mut self,
        place: usize,
        entities: impl Iterator<Item = (usize, &'v [u32], &'v [[f32; 3]])>,
        rest: [f32; 3],
    ) -> Result<()> {
        let [r, g, b] = rest;
        let size_bytes = self.merged.size_bytes;
        let mut all = vec![[r, g, b, 0.0]; size_bytes as usize / 16];
        for (entity, order, values) in entities {
            let first = self.offsets[entity] as usize / 16;
            for (to, &v) in all[first..].iter_mut().zip(order) {
                let [r, g, b] = values[v as usize];
                *to = [r, g, b, 0.0];
            }
        }
        let buffer = match &mut self.comparisons[place] {
            Some(buffer) => buffer,
            none => none.insert(Buffer::new(self.merged.device(), "comparison", BufferKind::Device, size_bytes)?),
        };
        buffer.fill(0, &all)
    }

    /// The buffer that a viewport shows: the merged one where a comparison was never written.
    pub fn source(&self, source: RadiositySource) -> &Buffer {
        match source {
            RadiositySource::Merged => &self.merged,
            RadiositySource::Comparison(place) => self.comparisons[place].as_ref().unwrap_or(&self.merged),
        }
    }
}
