//! Chains of sharp lights for pixels: every cluster's, merged in this frame or not.

use crate::draw::DrawnMesh;
use crate::draw::pixel_light::ByPixel;
use crate::error::Result;
use crate::frame::radiosity::RadiosityBuffers;
use crate::gpu::{Buffer, Device, TexelView, Upload};
use crate::layout::{self, CLUSTER_VERTICES, ENTRY_FORMAT, QUAD_FORMAT};
use crate::lists::gather::EntityBounds;
use crate::lists::incremental::{ClusterLists, State};
use crate::scene::Scene;
use crate::scene_buffers::SceneBuffers;
use ash::vk;
use std::sync::Arc;

/// Lists of sharp lights for pixels that evaluate them.
pub(super) struct PixelChains {
    /// Entities at the time of the picture.
    pub entities: Upload,
    pub entries: Upload,
    /// For every cluster of the lit entities: its first entry, and the number of its entries.
    pub chains: Upload,
    /// For every lit entity: where its pixels find their data, and how far the pixels of a cluster may lie from its
    /// vertices, metres of the mesh's frame. `None` for the others.
    lit: Vec<Option<(ByPixel, f32)>>,
    /// The first of these of every entity.
    pub receivers: Buffer,
    /// Whether texel views hold what all pixels bind.
    views_fit: bool,
    /// Entities as they were when the chains were made, and their bounds with what each of them takes part in.
    known: Option<(Vec<layout::DeviceEntity>, Vec<EntityBounds>)>,
}

impl PixelChains {
    /// Empty chains for the lit entities of a scene.
    pub fn new(
        device: &Arc<Device>,
        scene: &Scene,
        buffers: &SceneBuffers,
        radiosity: &RadiosityBuffers,
    ) -> Result<Self> {
        let views_fit = TexelView::fits(device, vk::Format::R32G32_UINT, buffers.self_cells.size_bytes)
            && TexelView::fits(device, QUAD_FORMAT, buffers.vertices.size_bytes);
        let mut clusters = 0;
        let mut receivers = Vec::with_capacity(scene.entities.len());
        let mut lit = Vec::with_capacity(scene.entities.len());
        for (index, entity) in scene.entities.iter().enumerate() {
            let surface = buffers.surface(index);
            let fits = match &surface.drawn {
                DrawnMesh::Grid(..) => true,
                DrawnMesh::Triangles(triangles) => triangles.fits_views(device, &buffers.vertices),
            };
            let by_pixel = ByPixel {
                lit_first: (radiosity.offsets[index] / 16) as u32,
                cluster_first: clusters,
                vertex_first: surface.vertices.start,
                self_first: surface.self_first,
            };
            let is_lit = entity.receives && views_fit && fits && !entity.transparent;
            receivers.push(by_pixel);
            lit.push(is_lit.then_some((by_pixel, surface.reach_m)));
            clusters += if is_lit { (surface.vertices.len() as u32).div_ceil(CLUSTER_VERTICES) } else { 0 };
        }
        let entity_count = scene.entities.len() + scene.boxes().len();
        let upload = |name: &str, bytes: usize| Upload::new(device, name, bytes as u64);
        Ok(PixelChains {
            entities: upload("pixel entities", entity_count * size_of::<layout::DeviceEntity>())?,
            entries: upload("pixel entries", 16)?,
            chains: upload("pixel chains", 8 * clusters.max(1) as usize)?,
            lit,
            receivers: Buffer::with_data(device, "pixel receivers", &receivers)?,
            views_fit,
            known: None,
        })
    }

    /// Where the pixels of an entity find what they need, if they evaluate lights.
    pub fn of(&self, entity: usize) -> Option<ByPixel> {
        self.lit[entity].map(|(by_pixel, _)| by_pixel)
    }

    /// Whether chains have been made that pixels can read: a device's texel views may be too short for them, and then
    /// vertices evaluate.
    pub fn is_ready(&self) -> bool {
        let device = self.entries.device();
        self.views_fit
            && self.known.is_some()
            && TexelView::fits(device, QUAD_FORMAT, self.entities.size_bytes)
            && TexelView::fits(device, ENTRY_FORMAT, self.entries.size_bytes)
            && TexelView::fits(device, vk::Format::R32G32_UINT, self.chains.size_bytes)
    }

    /// Makes the chains of this time.
    pub fn prepare(&mut self, lists: &ClusterLists) -> Result<()> {
        let State { entities, scene_bounds, .. } = lists.now();
        let is_known = self.known.as_ref().is_some_and(|(known, bounds)| {
            bytemuck::cast_slice::<_, u8>(known) == bytemuck::cast_slice::<_, u8>(entities)
                && *bounds == scene_bounds.entities
        });
        if is_known {
            return Ok(());
        }
        let mut entries = Vec::new();
        let mut chains = Vec::new();
        for (receiver, reach_m) in self.lit.iter().enumerate().filter_map(|(i, lit)| Some((i, (*lit)?.1))) {
            let (places, listed) = lists.sharp_chains(receiver, reach_m);
            chains.extend(places.iter().map(|[first, count]| [first + entries.len() as u32, *count]));
            entries.extend(listed);
        }
        // A view may not be empty.
        entries.resize(entries.len().max(4), 0_u32);
        chains.resize(chains.len().max(2), [0; 2]);
        self.entities.write(entities)?;
        self.entries.write(&entries)?;
        self.chains.write(&chains)?;
        self.known = Some((entities.clone(), scene_bounds.entities.clone()));
        Ok(())
    }
}
