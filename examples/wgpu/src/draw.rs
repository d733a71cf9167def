//! Draws the lit scene with wgpu, from the buffer that the library lights.

use super::{Outcome, SIZE};
use shadow_fields::draw::camera;
use shadow_fields::glam::{Mat4, Vec3};
use shadow_fields::prelude::*;
use wgpu::hal::api::Vulkan;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Draws the lit scene with wgpu: bytes of sRGB, three a pixel.
pub fn draw(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    renderer: &Renderer,
    placements: &[Placement],
) -> Outcome<Vec<u8>> {
    let (scene, light) = (renderer.scene(), renderer.light_buffer());
    let usage = wgpu::BufferUsages::VERTEX;
    let descriptor = wgpu::BufferDescriptor { label: None, size: light.size_bytes, usage, mapped_at_creation: false };
    // SAFETY: the renderer outlives this function, at whose end wgpu has finished; the buffer is only read.
    let light_buffer = unsafe {
        let raw = wgpu::hal::vulkan::Buffer::from_raw_externally_owned(light.buffer, Box::new(|| ()));
        device.create_buffer_from_hal::<Vulkan>(raw, &descriptor)
    };
    let make =
        |contents: &[u8], usage| device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage });
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let pipeline = pipeline(device);
    let texture = |format, usage| {
        let size = wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 };
        let dimension = wgpu::TextureDimension::D2;
        let shape = wgpu::TextureDescriptor {
            label: None,
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension,
            format,
            usage,
            view_formats: &[],
        };
        (device.create_texture(&shape), size)
    };
    let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
    let (color, size) = texture(wgpu::TextureFormat::Rgba8UnormSrgb, attachment | wgpu::TextureUsages::COPY_SRC);
    let (depth, _) = texture(wgpu::TextureFormat::Depth32Float, attachment);
    let (color_view, depth_view) = (color.create_view(&Default::default()), depth.create_view(&Default::default()));
    let mut commands = device.create_command_encoder(&Default::default());
    let background = scene.data.environment.uniform.unwrap_or_default().as_dvec3();
    let clear = wgpu::Color { r: background.x, g: background.y, b: background.z, a: 1.0 };
    let mut pass = commands.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &color_view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store: wgpu::StoreOp::Store },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &depth_view,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
            stencil_ops: None,
        }),
        ..Default::default()
    });
    pass.set_pipeline(&pipeline);
    // wgpu's clip space has y up.
    let flip = Mat4::from_scale(Vec3::new(1.0, -1.0, 1.0)).as_dmat4();
    let clip_from_world = flip * camera::clip_from_world(&scene.data.camera, f64::from(SIZE[0]) / f64::from(SIZE[1]));
    for (index, (placement, range)) in placements.iter().zip(&light.entities).enumerate() {
        let entity = &scene.entities[index];
        let mesh = renderer.mesh(index);
        let centre = mesh.bounding_sphere().0;
        let matrix = (clip_from_world * camera::world_from_centred(placement, centre.as_dvec3())).as_mat4();
        let block =
            [&matrix.to_cols_array()[..], &entity.emission.extend(renderer.scene().data.output.white()).to_array()]
                .concat();
        let uniform = make(&floats(&block), wgpu::BufferUsages::UNIFORM);
        // Vertices in the order in which their light lies in the buffer.
        let mut place = vec![0_u32; range.order.len()];
        range.order.iter().enumerate().for_each(|(at, vertex)| place[*vertex as usize] = at as u32);
        let positions: Vec<f32> =
            range.order.iter().flat_map(|v| (mesh.positions[*v as usize] - centre).to_array()).collect();
        let indices: Vec<u32> = mesh.triangles.iter().flatten().map(|vertex| place[*vertex as usize]).collect();
        let index_bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let bind = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }],
        });
        pass.set_bind_group(0, &bind, &[]);
        pass.set_vertex_buffer(0, make(&floats(&positions), wgpu::BufferUsages::VERTEX).slice(..));
        pass.set_vertex_buffer(1, light_buffer.slice(range.bytes.clone()));
        pass.set_index_buffer(make(&index_bytes, wgpu::BufferUsages::INDEX).slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..indices.len() as u32, 0, 0..1);
    }
    drop(pass);
    let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
    let bytes = u64::from(4 * SIZE[0] * SIZE[1]);
    let read =
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size: bytes, usage, mapped_at_creation: false });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * SIZE[0]), rows_per_image: None };
    commands.copy_texture_to_buffer(color.as_image_copy(), wgpu::TexelCopyBufferInfo { buffer: &read, layout }, size);
    queue.submit([commands.finish()]);
    read.slice(..).map_async(wgpu::MapMode::Read, |_| ());
    device.poll(wgpu::PollType::wait_indefinitely())?;
    let mapped = read.slice(..).get_mapped_range()?;
    Ok(mapped.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect())
}

/// Emission plus radiosity of a vertex, brought down to white as the library does.
fn pipeline(device: &wgpu::Device) -> wgpu::RenderPipeline {
    let shader = wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(include_str!("scene.wgsl").into()),
    };
    let module = device.create_shader_module(shader);
    let buffer = |array_stride, attributes| wgpu::VertexBufferLayout {
        array_stride,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes,
    };
    let (position, light) = (wgpu::vertex_attr_array![0 => Float32x3], wgpu::vertex_attr_array![1 => Float32x4]);
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            buffers: &[Some(buffer(12, &position)), Some(buffer(16, &light))],
        },
        primitive: Default::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            targets: &[Some(wgpu::TextureFormat::Rgba8UnormSrgb.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
