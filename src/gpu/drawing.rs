//! Render passes: what they draw into, and what is drawn.

use super::access::Access;
use super::commands::Commands;
use super::descriptors::Bind;
use super::image::Image;
use super::memory::Buffer;
use super::pipeline::{GraphicsPipeline, Pipeline};
use crate::error::Result;
use ash::vk;
use bytemuck::Pod;
use std::ops::Range;

/// Attachments of a render pass. A multisampled colour image is resolved into `resolve` if that is given.
pub struct Target<'r> {
    pub color: &'r Image,
    /// A second colour image, which the fragment shader's second output goes to; what it held is lost.
    pub second: Option<&'r Image>,
    /// Colour that it is cleared to; `None` keeps its content.
    pub clear: Option<[f32; 4]>,
    /// Depth attachment, cleared to 0 (infinitely far in reversed depth). It is stored if it has one sample per pixel.
    pub depth: Option<&'r Image>,
    /// Single-sampled image that receives the average of the colour samples.
    pub resolve: Option<&'r Image>,
}

impl<'r> Commands<'r> {
    /// Renders into `target` what `record` draws, in order.
    pub fn render(
        &mut self,
        target: &Target<'r>,
        record: impl FnOnce(&mut Drawing<'_, 'r>) -> Result<()>,
    ) -> Result<()> {
        self.render_part(target, [true, true], record)
    }

    /// As [`Commands::render`] for a picture that several render passes draw, with barriers between them. `ends` says
    /// whether this pass is the first, which clears, and whether it is the last, which resolves.
    pub fn render_part(
        &mut self,
        target: &Target<'r>,
        ends: [bool; 2],
        record: impl FnOnce(&mut Drawing<'_, 'r>) -> Result<()>,
    ) -> Result<()> {
        let [first, last] = ends;
        let load = if first { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD };
        let shape = target.color.shape;
        self.uses_image(target.color, Access::ColorWrite);
        let mut color = vk::RenderingAttachmentInfo::default()
            .image_view(target.color.view())
            .image_layout(Access::ColorWrite.layout())
            .load_op(if target.clear.is_some() { load } else { vk::AttachmentLoadOp::LOAD })
            .store_op(vk::AttachmentStoreOp::STORE)
            .clear_value(vk::ClearValue { color: vk::ClearColorValue { float32: target.clear.unwrap_or_default() } });
        if let Some(resolve) = target.resolve.filter(|_| last) {
            self.uses_image(resolve, Access::ColorWrite);
            color = color
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .resolve_mode(vk::ResolveModeFlags::AVERAGE)
                .resolve_image_view(resolve.view())
                .resolve_image_layout(Access::ColorWrite.layout());
        }
        let depth = target.depth.map(|depth| {
            self.uses_image(depth, Access::DepthWrite);
            vk::RenderingAttachmentInfo::default()
                .image_view(depth.view())
                .image_layout(Access::DepthWrite.layout())
                .load_op(load)
                .store_op(if last && depth.shape.samples > 1 {
                    vk::AttachmentStoreOp::DONT_CARE
                } else {
                    vk::AttachmentStoreOp::STORE
                })
                .clear_value(vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 } })
        });
        let mut colors = vec![color];
        if let Some(second) = target.second {
            assert!(target.resolve.is_none() && first && last, "{}: a second image is drawn at once", second.name);
            self.uses_image(second, Access::ColorWrite);
            colors.push(color.image_view(second.view()).load_op(vk::AttachmentLoadOp::DONT_CARE));
        }
        let extent = vk::Extent2D { width: shape.width, height: shape.height };
        let mut info = vk::RenderingInfo::default()
            .render_area(vk::Rect2D { offset: vk::Offset2D::default(), extent })
            .layer_count(1)
            .color_attachments(&colors);
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        let (handle, buffer) = self.raw();
        // SAFETY: the attachments are borrowed until the commands have run and in the layouts stated (tracked).
        unsafe { handle.cmd_begin_rendering(buffer, &info) };
        let outcome = record(&mut Drawing { commands: self, pipeline: None });
        let (handle, buffer) = self.raw();
        // SAFETY: begun above.
        unsafe { handle.cmd_end_rendering(buffer) };
        outcome
    }
}

pub struct Drawing<'c, 'r> {
    commands: &'c mut Commands<'r>,
    pipeline: Option<&'r Pipeline>,
}

impl<'r> Drawing<'_, 'r> {
    /// Selects the pipeline and its vertex buffers, in order of location, and the index buffer (32-bit). Both sides of
    /// triangles are drawn, until [`Drawing::cull`].
    pub fn bind(&mut self, pipeline: &'r GraphicsPipeline, vertices: &[(&'r Buffer, u64)], indices: &'r Buffer) {
        let GraphicsPipeline { pipeline, inputs } = pipeline;
        assert_eq!(vertices.len(), inputs.len(), "{}: vertex buffers against shader inputs", pipeline.name);
        for (buffer, offset) in vertices {
            self.commands.uses_range(buffer, *offset..buffer.size_bytes, Access::VertexRead);
        }
        self.commands.uses_range(indices, indices.all(), Access::VertexRead);
        let (handle, buffer) = self.commands.raw();
        // SAFETY: everything is borrowed until the commands have run.
        unsafe {
            handle.cmd_bind_pipeline(buffer, vk::PipelineBindPoint::GRAPHICS, pipeline.raw());
            handle.cmd_set_cull_mode(buffer, vk::CullModeFlags::NONE);
            for (input, (vertex, offset)) in inputs.iter().zip(vertices) {
                handle.cmd_bind_vertex_buffers(buffer, input.location, &[vertex.raw()], &[*offset]);
            }
            handle.cmd_bind_index_buffer(buffer, indices.raw(), 0, vk::IndexType::UINT32);
        }
        self.pipeline = Some(pipeline);
    }

    /// Leaves out these faces in the draws that follow.
    pub fn cull(&mut self, faces: vk::CullModeFlags) {
        // SAFETY: the pipelines of [`GraphicsPipeline`] take it from the commands.
        unsafe { self.commands.recording.device.handle.cmd_set_cull_mode(self.commands.recording.buffer, faces) };
    }

    /// Draws one triangle that covers the area, with a pipeline whose vertex shader makes it from `gl_VertexIndex`;
    /// `resources` are images that its fragment shader reads, at their binding numbers.
    pub fn screen<P: Pod>(&mut self, pipeline: &'r GraphicsPipeline, resources: &[Bind<'r>], push: &P) -> Result<()> {
        let GraphicsPipeline { pipeline, inputs } = pipeline;
        assert!(inputs.is_empty(), "{}: makes its own vertices", pipeline.name);
        self.commands.bind(pipeline, vk::PipelineBindPoint::GRAPHICS, resources)?;
        self.commands.push(pipeline, push);
        let (handle, buffer) = self.commands.raw();
        // SAFETY: pipeline and resources are borrowed until the commands are submitted; the vertex shader reads no
        // buffer.
        unsafe {
            handle.cmd_bind_pipeline(buffer, vk::PipelineBindPoint::GRAPHICS, pipeline.raw());
            handle.cmd_set_cull_mode(buffer, vk::CullModeFlags::NONE);
            handle.cmd_draw(buffer, 3, 1, 0, 0);
        }
        Ok(())
    }

    /// Binds images that the bound pipeline's fragment shader reads, at their binding numbers.
    pub fn resources(&mut self, resources: &[Bind<'r>]) -> Result<()> {
        let pipeline = self.pipeline.expect("a pipeline is bound before its resources");
        self.commands.bind(pipeline, vk::PipelineBindPoint::GRAPHICS, resources)
    }

    /// Sets viewport and scissor to a rectangle in pixels: left, top, width and height.
    pub fn area(&mut self, area: [u32; 4]) {
        self.part_of(area, area);
    }

    /// Sets the viewport to an area and the scissor to a part of it, both in pixels.
    pub fn part_of(&mut self, area: [u32; 4], part: [u32; 4]) {
        let [x, y, width, height] = area.map(|px| px as f32);
        let viewport = vk::Viewport { x, y, width, height, min_depth: 0.0, max_depth: 1.0 };
        let (handle, buffer) = self.commands.raw();
        // SAFETY: the command buffer is recording.
        unsafe { handle.cmd_set_viewport(buffer, 0, &[viewport]) };
        self.clip(part);
    }

    pub fn clip(&mut self, [x, y, width, height]: [u32; 4]) {
        let scissor = vk::Rect2D {
            offset: vk::Offset2D { x: x.cast_signed(), y: y.cast_signed() },
            extent: vk::Extent2D { width, height },
        };
        let (handle, buffer) = self.commands.raw();
        // SAFETY: the command buffer is recording.
        unsafe { handle.cmd_set_scissor(buffer, 0, &[scissor]) };
    }

    /// Sets the bound pipeline's push constants.
    pub fn push<P: Pod>(&mut self, push: &P) {
        let pipeline = self.pipeline.expect("a pipeline is bound before its push constants");
        self.commands.push(pipeline, push);
    }

    /// Draws the triangles of a range of corners, three a triangle, with a pipeline whose vertex shader finds corner
    /// `gl_VertexIndex` by itself.
    pub fn corners(&mut self, range: Range<u32>) {
        assert!(self.pipeline.is_some(), "a pipeline is bound before drawing");
        let (handle, buffer) = self.commands.raw();
        // SAFETY: the pipeline has no vertex inputs, as `bind` checked against the buffers that it was given.
        unsafe { handle.cmd_draw(buffer, range.end - range.start, 1, range.start, 0) };
    }

    /// Draws the triangles of a range of indices, three indices per triangle.
    pub fn indexed(&mut self, range: Range<u32>) {
        assert!(self.pipeline.is_some(), "a pipeline is bound before drawing");
        let (handle, buffer) = self.commands.raw();
        // SAFETY: the index buffer covers the range (its owner made both); values were checked when the mesh was read.
        unsafe { handle.cmd_draw_indexed(buffer, range.end - range.start, 1, range.start, 0, 0) };
    }
}
