//! Draws egui's triangles and textures on top of a picture.

use super::device::Device;
use super::drawing::Drawing;
use super::ledger::{self, Ledgered};
use super::{Checked, FLIGHTS, Image};
use crate::error::{Error, Result};
use ash::vk;
use egui::epaint::{ClippedPrimitive, ImageDelta};
use egui::{ColorImage, ImageData, TextureId, TexturesDelta};
use egui_ash_renderer::allocator::DefaultAllocator;
use egui_ash_renderer::{DynamicRendering, RenderMode, Renderer, RendererError};
use std::collections::HashMap;
use std::sync::Arc;

/// One tessellated frame of egui.
pub struct Paint {
    /// Triangles with clip rectangles, in points.
    pub primitives: Vec<ClippedPrimitive>,
    /// Pixels per point.
    pub pixels_per_point: f32,
}

/// Draws egui into images of one format.
pub struct Overlay {
    /// The library forgets what it made when one of its calls fails.
    renderer: Ledgered<Renderer<DefaultAllocator>>,
    pool: CommandPool,
    /// The current content of every texture. A partial change is uploaded as the whole texture, because the renderer's partial
    /// update starts from an undefined layout and so discards the rest of the image.
    textures: HashMap<TextureId, ColorImage>,
    /// Textures to free when the recordings that use them have ended.
    retired: Vec<TextureId>,
}

struct CommandPool(Arc<Device>, vk::CommandPool);

impl Drop for CommandPool {
    fn drop(&mut self) {
        // SAFETY: the renderer, which goes first, waits for its uploads.
        unsafe { self.0.handle.destroy_command_pool(self.1, None) };
    }
}

fn failed(error: RendererError) -> Error {
    match error {
        RendererError::Vulkan(code) => {
            Err::<(), _>(code).checked(&ledger::failed_call(), "overlay").expect_err("it is one")
        }
        other => Error::Failed(format!("overlay: {other}")),
    }
}

impl Overlay {
    /// For images of `format`, which are the only attachment of their pass; `encodes_srgb` says whether that format is sRGB.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn new(device: &Arc<Device>, format: vk::Format, encodes_srgb: bool) -> Result<Self> {
        let create = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.queue_family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: destroyed by `CommandPool`.
        let pool =
            unsafe { device.handle.create_command_pool(&create, None) }.checked("vkCreateCommandPool", "overlay")?;
        device.name(pool, "overlay");
        let pool = CommandPool(device.clone(), pool);
        let target = DynamicRendering {
            color_attachment_format: format,
            depth_attachment_format: None,
            stencil_attachment_format: None,
        };
        let options = egui_ash_renderer::Options {
            in_flight_frames: FLIGHTS,
            srgb_framebuffer: encodes_srgb,
            ..Default::default()
        };
        let mode = RenderMode::DynamicRendering(target);
        let make = |noting| Renderer::with_allocator(DefaultAllocator::new(device.memory), noting, mode, options);
        let renderer = Ledgered::new(device, make).map_err(failed)?;
        Ok(Overlay { renderer, pool, textures: HashMap::new(), retired: Vec::new() })
    }

    /// Makes the `index`-th fallible Vulkan call of overlays on this thread, counted from 0, fail once, so that a test can show what
    /// follows; `None` restores normal calls.
    pub fn fail_call(index: Option<usize>) {
        ledger::fail_call(index);
    }

    /// Applies changes of textures; call it before the frame that needs them is drawn.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn update(&mut self, mut delta: TexturesDelta) -> Result<()> {
        if delta.set.is_empty() && delta.free.is_empty() && self.retired.is_empty() {
            return Ok(());
        }
        let device = self.pool.0.clone();
        device.settle();
        for id in self.retired.drain(..) {
            self.renderer.call(|renderer| renderer.free_texture(id)).map_err(failed)?;
            self.textures.remove(&id);
        }
        for (id, changes) in delta.set.drain() {
            for change in changes {
                let options = change.options;
                let ImageData::Color(image) = change.image;
                match (change.pos, self.textures.get_mut(&id)) {
                    (Some([x, y]), Some(whole)) => {
                        for row in 0..image.height() {
                            let at = (y + row) * whole.width() + x;
                            let from = &image.pixels[row * image.width()..][..image.width()];
                            whole.pixels[at..at + image.width()].copy_from_slice(from);
                        }
                    }
                    _ => drop(self.textures.insert(id, (*image).clone())),
                }
                let whole = ImageDelta::full(self.textures[&id].clone(), options);
                let queue = device.queue();
                let pool = self.pool.1;
                self.renderer.call(|renderer| renderer.set_texture(*queue, pool, id, &whole)).map_err(failed)?;
            }
        }
        // egui still draws with these textures in the coming frame, so they are freed after it.
        self.retired.extend(delta.free.drain());
        Ok(())
    }
}

impl Drop for Overlay {
    fn drop(&mut self) {
        self.pool.0.settle(); // before the renderer destroys what it draws with
    }
}

impl<'r> Drawing<'_, 'r> {
    /// Draws egui's triangles over the picture.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn overlay(&mut self, overlay: &'r mut Overlay, image: &Image, paint: &Paint) -> Result<()> {
        let extent = vk::Extent2D { width: image.shape.width, height: image.shape.height };
        let buffer = self.raw();
        let draw =
            |renderer: &mut Renderer<_>| renderer.cmd_draw(buffer, extent, paint.pixels_per_point, &paint.primitives);
        overlay.renderer.call(draw).map_err(failed)
    }
}
