//! Bindings of drawing shaders that include `glsl/pixel_light.glsl`: their pixels evaluate sharp lights.

use crate::error::Result;
use crate::gpu::{Bind, Buffer, TexelView};
use crate::layout::QUAD_FORMAT;
use ash::vk;

/// Where the pixels of an entity find what they evaluate sharp lights by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByPixel {
    /// Its first cluster in [`PixelLight::chains`].
    pub cluster_first: u32,
    /// The first vertex of its mesh in [`PixelLight::vertices`].
    pub vertex_first: u32,
    /// The first cell of its mesh in [`PixelLight::self_cells`], or [`crate::layout::NONE`].
    pub self_first: u32,
}

pub struct PixelLight<'d> {
    /// [`crate::layout::DeviceEntity`] of every entity.
    pub entities: &'d Buffer,
    /// Nodes and cells of all silhouette fields.
    pub silhouettes: [&'d Buffer; 2],
    pub entries: &'d Buffer,
    /// For every cluster of the lit entities: its first entry, and the number of its entries.
    pub chains: &'d Buffer,
    /// Light on vertices without that of sharp lights.
    pub soft: &'d Buffer,
    pub self_cells: &'d Buffer,
    /// Positions and normals of all meshes.
    pub vertices: &'d Buffer,
}

impl<'d> PixelLight<'d> {
    /// All bindings of a shader that includes `glsl/pixel_light.glsl`: corners and radiosity first, `others` last.
    pub fn binds(
        &self,
        own: &[(&'d Buffer, vk::Format); 2],
        others: &[(&'d Buffer, vk::Format)],
    ) -> Result<Vec<Bind<'d>>> {
        let [nodes, cells] = self.silhouettes;
        let shared = [
            (self.entities, QUAD_FORMAT),
            (nodes, QUAD_FORMAT),
            (cells, vk::Format::R32G32_UINT),
            (self.entries, vk::Format::R32_UINT),
            (self.chains, vk::Format::R32G32_UINT),
            (self.soft, QUAD_FORMAT),
        ];
        texels(&[&own[..], &shared, others].concat())
    }
}

/// Texel views of buffers, in the order of their bindings.
pub(super) fn texels<'r>(buffers: &[(&'r Buffer, vk::Format)]) -> Result<Vec<Bind<'r>>> {
    buffers.iter().map(|&(buffer, format)| TexelView::new(buffer, format).map(Bind::Texel)).collect()
}
