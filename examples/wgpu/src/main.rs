//! A wgpu program shares its device with the library, which lights the vertices; wgpu draws them from the buffer where
//! the light lies. `cargo run -- wgpu.png` in this folder draws a frame and compares it with the library's own picture.

mod draw;

use shadow_fields::ash::vk;
use shadow_fields::asset::picture::{encode_srgb, linear_from_srgb, write_png};
use shadow_fields::draw::{Antialias, Shading};
use shadow_fields::asset::environment::EnvironmentData;
use shadow_fields::prelude::*;
use shadow_fields::scene::Output;
use wgpu::hal::api::Vulkan;

/// Width and height of the picture in pixels.
const SIZE: [u32; 2] = [512, 320];

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// wgpu's device and queue, and the same for the library.
fn open() -> Outcome<(wgpu::Device, wgpu::Queue, Gpu)> {
    let backends = wgpu::Backends::VULKAN;
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let descriptor = wgpu::DeviceDescriptor::default();
    // The library needs these two features, which wgpu does not ask for.
    let mut rendering = vk::PhysicalDeviceDynamicRenderingFeatures::default().dynamic_rendering(true);
    let mut synchronization = vk::PhysicalDeviceSynchronization2Features::default().synchronization2(true);
    // SAFETY: the features are of Vulkan 1.3, and `from_vulkan` refuses a device without them; the handles are those of
    // a device that wgpu keeps as long as `main` keeps it, which is longer than anything of the library's.
    unsafe {
        let hal = adapter.as_hal::<Vulkan>().ok_or("no Vulkan")?;
        let more: Box<wgpu::hal::vulkan::CreateDeviceCallback<'_>> = Box::new(|arguments| {
            *arguments.create_info = arguments.create_info.push_next(&mut rendering).push_next(&mut synchronization);
        });
        let hints = wgpu::MemoryHints::default();
        let opened =
            hal.open_with_callback(descriptor.required_features, &descriptor.required_limits, &hints, Some(more))?;
        let (device, queue) = (&opened.device, opened.queue.as_raw());
        let (physical, family) = (device.raw_physical_device(), device.queue_family_index());
        let cache = Cache::usual_folder();
        let gpu = Gpu::from_vulkan(
            device.shared_instance().raw_instance(),
            physical,
            device.raw_device(),
            queue,
            family,
            cache.as_deref(),
        )?;
        let (device, queue) = adapter.create_device_from_hal::<Vulkan>(opened, &descriptor)?;
        Ok((device, queue, gpu))
    }
}

fn scene() -> Result<Scene, Error> {
    Scene::builder()
        .camera(Camera::new([0.0, 2.2, 4.5], [0.0, 0.4, 0.0]))
        .environment(EnvironmentData { uniform: Some([0.15, 0.18, 0.25].into()), ..Default::default() })
        .mesh("floor", Generator::Cuboid { size_m: [6.0, 0.2, 6.0].into(), cells: 48 })
        .mesh("ring", Generator::Torus { major_m: 0.5, minor_m: 0.18, segments: 64, sides: 32 })
        .mesh("lamp", Generator::Sphere { radius_m: 0.12, subdivisions: 3 })
        .entity(EntityData { position: [0.0, -0.1, 0.0].into(), ..EntityData::of_mesh("floor") })
        .entity(EntityData {
            position: [0.0, 0.7, 0.0].into(),
            albedo: [0.8, 0.4, 0.2].into(),
            ..EntityData::of_mesh("ring")
        })
        .entity(EntityData {
            position: [1.2, 1.8, 0.6].into(),
            emission: [60.0, 54.0, 44.0].into(),
            ..EntityData::of_mesh("lamp")
        })
        .output(Output { exposure_ev: Some(0.0), ..Default::default() })
        .build()
}

fn main() -> Outcome<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "wgpu.png".into());
    let (device, queue, gpu) = open()?;
    let options = RenderOptions {
        bake: Quality::Draft.into(),
        size: Some(SIZE),
        shading: Some(Shading::Vertex),
        antialias: Some(Antialias::None),
        ..Default::default()
    };
    let scene = scene()?;
    let mut renderer = Renderer::new(&gpu, &scene, &options)?;
    let placements = scene.at(0.0);
    renderer.update(&placements)?;
    let drawn = draw::draw(&device, &queue, &renderer, &placements)?;
    let own = encode_srgb(&renderer.picture()?.rgb, 0.0);
    let most = drawn.iter().zip(&own).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(u8::MAX);
    let off = drawn.iter().zip(&own).filter(|(a, b)| a != b).count();
    let linear: Vec<f32> = drawn.iter().map(|byte| linear_from_srgb(f32::from(*byte) / 255.0)).collect();
    write_png(path.as_ref(), SIZE[0], SIZE[1], &linear, 0.0)?;
    println!("{path}: {off} of {} values differ from the library's picture, by at most {most} of 255", own.len());
    if most > 1 { Err("the pictures differ".into()) } else { Ok(()) }
}
