//! Pipelines and their layouts, built from the reflection of their shaders. A device keeps each until it ends: another frame
//! of the same shaders waits for no driver.

use super::Checked;
use super::device::Device;
use super::reflect::{Binding, VertexInput};
use super::shader::{Shader, Stage};
use crate::error::{Error, Result};
use ash::vk;
use log::Level;
use std::collections::hash_map::Entry;
use std::sync::{Arc, PoisonError};
use std::time::Instant;

/// Descriptor set layout and pipeline layout, used by both kinds of pipeline.
pub(super) struct Layout {
    pub(super) pipeline: vk::PipelineLayout,
    pub(super) set: vk::DescriptorSetLayout,
    pub(super) bindings: Vec<Binding>,
    pub(super) push_bytes: u32,
    pub(super) push_stages: vk::ShaderStageFlags,
}

impl Layout {
    /// To be destroyed.
    fn new(device: &Device, name: &str, shaders: &[&Shader]) -> Result<Self> {
        let mut bindings: Vec<Binding> = Vec::new();
        for binding in shaders.iter().flat_map(|s| &s.reflection.bindings) {
            if !bindings.iter().any(|b| b.index == binding.index) {
                bindings.push(binding.clone());
            }
        }
        bindings.sort_by_key(|b| b.index);
        check_limits(&device.limits, name, &bindings)?;
        let all_stages = shaders.iter().fold(vk::ShaderStageFlags::empty(), |all, s| all | stage_flag(s.stage));
        let descriptions: Vec<_> = bindings
            .iter()
            .map(|b| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(b.index)
                    .descriptor_type(b.kind)
                    .descriptor_count(1)
                    .stage_flags(all_stages)
            })
            .collect();
        let create = vk::DescriptorSetLayoutCreateInfo::default().bindings(&descriptions);
        // SAFETY: destroyed with what is returned, or below.
        let set = unsafe { device.handle.create_descriptor_set_layout(&create, None) }
            .checked("vkCreateDescriptorSetLayout", name)?;
        device.name(set, name);
        let push_bytes = shaders.iter().map(|s| s.reflection.push_bytes).max().unwrap_or(0);
        let push_stages = shaders
            .iter()
            .filter(|s| s.reflection.push_bytes > 0)
            .fold(vk::ShaderStageFlags::empty(), |all, s| all | stage_flag(s.stage));
        let sets = [set];
        let ranges = [vk::PushConstantRange { stage_flags: push_stages, offset: 0, size: push_bytes }];
        let create = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&sets)
            .push_constant_ranges(if push_bytes > 0 { &ranges } else { &[] });
        // SAFETY: destroyed with what is returned.
        let pipeline =
            unsafe { device.handle.create_pipeline_layout(&create, None) }.checked("vkCreatePipelineLayout", name);
        let mut layout = Layout { pipeline: vk::PipelineLayout::null(), set, bindings, push_bytes, push_stages };
        layout.pipeline = pipeline.inspect_err(|_| layout.destroy(device))?;
        device.name(layout.pipeline, name);
        Ok(layout)
    }

    fn destroy(&self, device: &Device) {
        // SAFETY: no submission is under way that uses them; a handle that is null is passed over.
        unsafe {
            device.handle.destroy_pipeline_layout(self.pipeline, None);
            device.handle.destroy_descriptor_set_layout(self.set, None);
        }
    }
}

/// A pipeline that a device keeps, with its layout.
pub(super) struct CachedPipeline {
    handle: vk::Pipeline,
    layout: Layout,
}

impl CachedPipeline {
    /// No submission may be under way that uses it.
    pub(super) fn destroy(&self, device: &Device) {
        // SAFETY: as the caller says.
        unsafe { device.handle.destroy_pipeline(self.handle, None) };
        self.layout.destroy(device);
    }
}

/// A pipeline of either kind, by the name of one who uses it.
pub(super) struct Pipeline {
    cached: Arc<CachedPipeline>,
    /// Destroys it.
    _device: Arc<Device>,
    pub(super) name: String,
}

impl Pipeline {
    /// The pipeline of these shaders that `device` keeps, or the one that `make` makes of them.
    fn new(
        device: &Arc<Device>,
        name: &str,
        shaders: &[&Shader],
        state: &str,
        make: impl FnOnce(&Layout) -> Result<Vec<vk::Pipeline>>,
    ) -> Result<Self> {
        let mut hasher = blake3::Hasher::new();
        hasher.update(state.as_bytes());
        shaders.iter().for_each(|shader| {
            hasher.update(&(shader.spirv.len() as u64).to_le_bytes());
            hasher.update(bytemuck::cast_slice(&shader.spirv));
        });
        let key = *hasher.finalize().as_bytes();
        let pipelines = || device.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let named = |cached: &Arc<CachedPipeline>| Pipeline {
            cached: cached.clone(),
            _device: device.clone(),
            name: name.into(),
        };
        if let Some(found) = pipelines().get(&key) {
            return Ok(named(found));
        }
        let layout = Layout::new(device, name, shaders)?;
        let start = Instant::now();
        let handle = make(&layout).inspect_err(|_| layout.destroy(device))?[0];
        let ms = start.elapsed().as_secs_f64() * 1e3;
        log::log!(if ms < LEAST_TOLD_MS { Level::Trace } else { Level::Debug }, "pipeline {name}: {ms:.0} ms");
        device.name(handle, name);
        match pipelines().entry(key) {
            Entry::Vacant(place) => Ok(named(place.insert(Arc::new(CachedPipeline { handle, layout })))),
            // Another thread was quicker.
            Entry::Occupied(place) => {
                CachedPipeline { handle, layout }.destroy(device);
                Ok(named(place.get()))
            }
        }
    }

    pub(super) fn raw(&self) -> vk::Pipeline {
        self.cached.handle
    }

    pub(super) fn layout(&self) -> &Layout {
        &self.cached.layout
    }
}

/// Compares what a pipeline binds with the device's limits. All else that its shaders ask for, every device has.
fn check_limits(limits: &vk::PhysicalDeviceLimits, name: &str, bindings: &[Binding]) -> Result<()> {
    use vk::DescriptorType as Kind;
    let count = |kinds: &[Kind]| bindings.iter().filter(|b| kinds.contains(&b.kind)).count() as u32;
    // A texel buffer counts as a sampled image.
    let sampled = [Kind::UNIFORM_TEXEL_BUFFER, Kind::SAMPLED_IMAGE, Kind::COMBINED_IMAGE_SAMPLER];
    for (what, asked, most) in [
        ("storage buffers", count(&[Kind::STORAGE_BUFFER]), limits.max_per_stage_descriptor_storage_buffers),
        ("sampled images", count(&sampled), limits.max_per_stage_descriptor_sampled_images),
    ] {
        if asked > most {
            return Err(Error::Unsupported(format!("{name} wants {asked} {what} a stage, the device takes {most}")));
        }
    }
    Ok(())
}

fn stage_flag(stage: Stage) -> vk::ShaderStageFlags {
    match stage {
        Stage::Compute => vk::ShaderStageFlags::COMPUTE,
        Stage::Vertex => vk::ShaderStageFlags::VERTEX,
        Stage::Fragment => vk::ShaderStageFlags::FRAGMENT,
        other => unreachable!("no shader of stage {other:?} is in use"),
    }
}

/// A shader module that exists while a pipeline is created from it.
struct Module<'d>(&'d Device, vk::ShaderModule);

impl<'d> Module<'d> {
    fn new(device: &'d Device, shader: &Shader) -> Result<Self> {
        let create = vk::ShaderModuleCreateInfo::default().code(&shader.spirv);
        // SAFETY: the words come from the compiler or its hashed cache; destroyed in `Drop`.
        let module = unsafe { device.handle.create_shader_module(&create, None) }
            .checked("vkCreateShaderModule", &shader.name)?;
        device.name(module, &shader.name);
        Ok(Module(device, module))
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: pipelines do not need their modules after creation.
        unsafe { self.0.handle.destroy_shader_module(self.1, None) };
    }
}

/// Pipelines that are made in less time are many, and only traced.
const LEAST_TOLD_MS: f64 = 5.0;

/// One compute shader, ready to dispatch.
pub struct ComputePipeline {
    pub(super) pipeline: Pipeline,
    pub local_size: [u32; 3],
}

impl ComputePipeline {
    pub fn new(device: &Arc<Device>, name: &str, shader: &Shader) -> Result<Self> {
        let pipeline = Pipeline::new(device, name, &[shader], "", |layout| {
            let module = Module::new(device, shader)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module.1)
                .name(c"main");
            let create = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout.pipeline);
            // SAFETY: everything that `create` points to outlives the call; destroyed by `CachedPipeline`.
            unsafe { device.handle.create_compute_pipelines(device.pipeline_cache, &[create], None) }
                .map_err(|(_, code)| code)
                .checked("vkCreateComputePipelines", name)
        })?;
        Ok(ComputePipeline { pipeline, local_size: shader.reflection.local_size })
    }
}

/// Which of the values that are drawn at a pixel it keeps, channel by channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeps {
    Last,
    /// The last over what was there before, by its alpha, with which its colour is premultiplied.
    Over,
    Depth,
    /// As [`Keeps::Over`], of what is at least as near as its depth; alpha and depth stay what they were.
    ColorOver,
}

/// Fixed-function state that differs between graphics pipelines. All have filled triangles, counter-clockwise
/// front faces, and dynamic viewport, scissor and culling.
#[derive(Clone, Copy, Debug)]
pub struct GraphicsState {
    pub color: vk::Format,
    /// Format of the second colour attachment, if there is one; both keep the same.
    pub second: Option<vk::Format>,
    /// Depth attachment format. If present, depth is tested and written, and greater is nearer (reversed depth).
    pub depth: Option<vk::Format>,
    pub samples: u32,
    pub keeps: Keeps,
}

impl GraphicsState {
    /// One sample of that format without depth: all triangles are drawn, and the last one stays.
    pub fn plain(color: vk::Format) -> Self {
        GraphicsState { color, second: None, depth: None, samples: 1, keeps: Keeps::Last }
    }
}

/// A vertex and a fragment shader, ready to draw indexed triangles. Vertex input `location` reads tightly packed floats
/// from the vertex buffer bound at the same number.
pub struct GraphicsPipeline {
    pub(super) pipeline: Pipeline,
    pub(super) inputs: Vec<VertexInput>,
}

impl GraphicsPipeline {
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        vertex: &Shader,
        fragment: &Shader,
        state: GraphicsState,
    ) -> Result<Self> {
        let inputs = vertex.reflection.inputs.clone();
        let pipeline = Pipeline::new(device, name, &[vertex, fragment], &format!("{state:?}"), |layout| {
            let modules = [Module::new(device, vertex)?, Module::new(device, fragment)?];
            let stages = [(vk::ShaderStageFlags::VERTEX, modules[0].1), (vk::ShaderStageFlags::FRAGMENT, modules[1].1)]
                .map(|(stage, module)| {
                    vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module).name(c"main")
                });
            let (bindings, attributes) = vertex_layout(&inputs);
            let vertex_input = vk::PipelineVertexInputStateCreateInfo::default()
                .vertex_binding_descriptions(&bindings)
                .vertex_attribute_descriptions(&attributes);
            let assembly =
                vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
            let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
            let raster = vk::PipelineRasterizationStateCreateInfo::default()
                .polygon_mode(vk::PolygonMode::FILL)
                .front_face(vk::FrontFace::COUNTER_CLOCKWISE)
                .line_width(1.0);
            let multisample = vk::PipelineMultisampleStateCreateInfo::default()
                .rasterization_samples(vk::SampleCountFlags::from_raw(state.samples));
            let depth = vk::PipelineDepthStencilStateCreateInfo::default()
                .depth_test_enable(state.depth.is_some())
                .depth_write_enable(state.depth.is_some() && state.keeps != Keeps::ColorOver)
                .depth_compare_op(match state.keeps {
                    Keeps::ColorOver => vk::CompareOp::GREATER_OR_EQUAL,
                    _ => vk::CompareOp::GREATER,
                });
            let colors: Vec<vk::Format> = [state.color].into_iter().chain(state.second).collect();
            let blend_attachments = vec![color_blend(state.keeps); colors.len()];
            let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blend_attachments);
            let dynamic_states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR, vk::DynamicState::CULL_MODE];
            let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic_states);
            let mut rendering = vk::PipelineRenderingCreateInfo::default()
                .color_attachment_formats(&colors)
                .depth_attachment_format(state.depth.unwrap_or(vk::Format::UNDEFINED));
            let create = vk::GraphicsPipelineCreateInfo::default()
                .stages(&stages)
                .vertex_input_state(&vertex_input)
                .input_assembly_state(&assembly)
                .viewport_state(&viewport)
                .rasterization_state(&raster)
                .multisample_state(&multisample)
                .depth_stencil_state(&depth)
                .color_blend_state(&blend)
                .dynamic_state(&dynamic)
                .layout(layout.pipeline)
                .push_next(&mut rendering);
            // SAFETY: everything that `create` points to outlives the call; destroyed by `CachedPipeline`.
            unsafe { device.handle.create_graphics_pipelines(device.pipeline_cache, &[create], None) }
                .map_err(|(_, code)| code)
                .checked("vkCreateGraphicsPipelines", name)
        })?;
        Ok(GraphicsPipeline { pipeline, inputs })
    }
}

/// One tightly packed vertex buffer per input, bound at the number of the input's location.
fn vertex_layout(
    inputs: &[VertexInput],
) -> (Vec<vk::VertexInputBindingDescription>, Vec<vk::VertexInputAttributeDescription>) {
    let binding = |i: &VertexInput| vk::VertexInputBindingDescription {
        binding: i.location,
        stride: i.components * 4,
        input_rate: vk::VertexInputRate::VERTEX,
    };
    let attribute = |i: &VertexInput| vk::VertexInputAttributeDescription {
        location: i.location,
        binding: i.location,
        format: match i.components {
            1 => vk::Format::R32_SFLOAT,
            2 => vk::Format::R32G32_SFLOAT,
            3 => vk::Format::R32G32B32_SFLOAT,
            _ => vk::Format::R32G32B32A32_SFLOAT,
        },
        offset: 0,
    };
    (inputs.iter().map(binding).collect(), inputs.iter().map(attribute).collect())
}

fn color_blend(keeps: Keeps) -> vk::PipelineColorBlendAttachmentState {
    let written = match keeps {
        Keeps::Depth => vk::ColorComponentFlags::empty(),
        Keeps::ColorOver => vk::ColorComponentFlags::R | vk::ColorComponentFlags::G | vk::ColorComponentFlags::B,
        _ => vk::ColorComponentFlags::RGBA,
    };
    vk::PipelineColorBlendAttachmentState::default()
        .color_write_mask(written)
        .blend_enable(!matches!(keeps, Keeps::Last | Keeps::Depth))
        .src_color_blend_factor(vk::BlendFactor::ONE)
        .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
}
