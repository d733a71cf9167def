//! How much memory a scene takes, on the device and on the host.

use super::Frame;
use super::pixel::PixelChains;
use crate::bounce::Bounce;
use crate::gloss::Reflections;
use serde::Serialize;

/// Bytes by use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Memory {
    pub fields: u64,
    /// Silhouette fields and self-visibility, for sharp lights.
    pub silhouettes: u64,
    pub transfers: u64,
    /// Positions and normals that the merge reads.
    pub vertices: u64,
    /// Light on vertices.
    pub radiosity: u64,
    /// Positions, emission and indices of drawn meshes.
    pub drawables: u64,
    pub textures: u64,
    /// Entities, clusters, entries, sky and outlines.
    pub lists: u64,
    /// Images and the buffer that a picture is read back through.
    pub pictures: u64,
    /// Cluster lists as the host keeps them.
    pub host_lists: u64,
}

impl Memory {
    /// All bytes on the device, or visible to it.
    pub fn device(&self) -> u64 {
        self.fields
            + self.silhouettes
            + self.transfers
            + self.vertices
            + self.radiosity
            + self.drawables
            + self.textures
            + self.lists
            + self.pictures
    }
}

impl Frame {
    /// Memory that the scene takes now. Meshes as they were read from their files are not counted.
    pub fn memory(&self) -> Memory {
        Memory {
            fields: self.buffers.fields.size_bytes,
            silhouettes: self.buffers.sharp().map(|buffer| buffer.size_bytes).iter().sum(),
            transfers: self.buffers.transfers.size_bytes + self.bounce.as_ref().map_or(0, Bounce::size_bytes),
            vertices: self.buffers.vertices.size_bytes,
            radiosity: self.radiosity.size_bytes(),
            drawables: self.buffers.surfaces.iter().map(|surface| surface.drawn.size_bytes()).sum(),
            textures: self.buffers.texture_bytes(),
            lists: self.work.size_bytes()
                + self.sky.coefficients.all_bytes()
                + self.reflections.as_ref().map_or(0, Reflections::size_bytes)
                + self.picture.lines.size_bytes()
                + self.chains.as_ref().map_or(0, PixelChains::size_bytes),
            pictures: self.picture.readback.size_bytes + self.picture.draw.size_bytes(),
            host_lists: self.work.lists.size_bytes(),
        }
    }
}
