//! A program with a Vulkan device of its own has its vertices lit on it, and reads the light in a command buffer of its
//! own: `cargo run --example own_device`.
#![allow(unsafe_code)] // it calls Vulkan

use shadow_fields::ash::{self, vk};
use shadow_fields::gpu::device::required_features;
use shadow_fields::prelude::*;
use std::error::Error as AnyError;

type Outcome<T> = Result<T, Box<dyn AnyError>>;

fn main() -> Outcome<()> {
    // SAFETY: the loader is the system's; every handle below is used while its parents live, and destroyed before them.
    unsafe {
        let entry = ash::Entry::load()?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let create = vk::InstanceCreateInfo::default().application_info(&application);
        let instance = entry.create_instance(&create, None)?;
        let outcome = with_instance(&instance);
        instance.destroy_instance(None);
        outcome
    }
}

/// The program's device: its first, with a queue for everything.
///
/// # Safety
/// The instance is alive.
unsafe fn with_instance(instance: &ash::Instance) -> Outcome<()> {
    // SAFETY: see above.
    unsafe {
        let physical = *instance.enumerate_physical_devices()?.first().ok_or("no Vulkan device")?;
        let needed = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        let families = instance.get_physical_device_queue_family_properties(physical);
        let family = families.iter().position(|family| family.queue_flags.contains(needed));
        let family = family.ok_or("no queue for graphics and compute")? as u32;
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let mut features = required_features();
        let create = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut features);
        let device = instance.create_device(physical, &create, None)?;
        let queue = device.get_device_queue(family, 0);
        let outcome = light(instance, physical, &device, queue, family);
        // All that the library made is gone by now.
        device.device_wait_idle()?;
        device.destroy_device(None);
        outcome
    }
}

/// Lights a scene on the program's device and compares what the program reads with what the library says.
///
/// # Safety
/// All handles are alive and belong together.
unsafe fn light(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    device: &ash::Device,
    queue: vk::Queue,
    family: u32,
) -> Outcome<()> {
    let cache = Cache::usual_folder();
    // SAFETY: the instance is for Vulkan 1.3, the device has the required features, both outlive `gpu` and what is made
    // with it, and nothing else uses the queue.
    let gpu = unsafe { Gpu::from_vulkan(instance, physical, device, queue, family, cache.as_deref())? };
    let ball = Generator::Sphere { radius_m: 0.4, subdivisions: 3 };
    let lamp = EntityData { emission: [30.0, 30.0, 24.0].into(), ..EntityData::of_mesh("ball") };
    let scene = Scene::builder()
        .mesh("floor", Generator::Plane { size_m: 4.0, cells: 32 })
        .mesh("ball", ball)
        .entity(EntityData::of_mesh("floor"))
        .entity(EntityData { position: [0.0, 0.6, 0.0].into(), movable: true, ..EntityData::of_mesh("ball") })
        .entity(EntityData { position: [1.0, 2.2, 0.5].into(), scale: 0.3, ..lamp })
        .build()?;
    let mut renderer =
        Renderer::new(&gpu, &scene, &RenderOptions { bake: Quality::Draft.into(), ..Default::default() })?;
    for step in 0..3 {
        let mut placements = scene.at(0.0);
        placements[1].position.x = 0.3 * step as f32;
        renderer.update(&placements)?;
        // SAFETY: as above; the buffer is the renderer's and only read.
        let seen = unsafe { read(instance, physical, device, queue, family, &renderer)? };
        let lit = renderer.light_buffer().entities.into_iter().map(|e| (e.bytes, e.order.to_vec())).collect::<Vec<_>>();
        let (mut darkest, mut brightest) = (f32::MAX, 0.0_f32);
        for ((bytes, order), light) in lit.into_iter().zip(renderer.light()?) {
            for (place, vertex) in order.into_iter().enumerate() {
                let at = bytes.start as usize / 4 + 4 * place;
                assert_eq!(seen[at..at + 3], light[vertex as usize], "the program reads what the library says");
                (darkest, brightest) = (darkest.min(seen[at + 1]), brightest.max(seen[at + 1]));
            }
        }
        println!("step {step}: {} vertices, green radiosity from {darkest:.4} to {brightest:.4}", seen.len() / 4);
    }
    Ok(())
}

/// Copies the light into a buffer of the program's, in its own command buffer on the same queue. No barrier stands
/// before the copy: the library has made its writes visible.
///
/// # Safety
/// As [`light`].
unsafe fn read(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    device: &ash::Device,
    queue: vk::Queue,
    family: u32,
    renderer: &Renderer,
) -> Outcome<Vec<f32>> {
    let light = renderer.light_buffer();
    // SAFETY: the fence is waited for before anything is destroyed; the mapping covers the buffer.
    unsafe {
        let create = vk::BufferCreateInfo::default().size(light.size_bytes).usage(vk::BufferUsageFlags::TRANSFER_DST);
        let buffer = device.create_buffer(&create, None)?;
        let needs = device.get_buffer_memory_requirements(buffer);
        let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let memory = instance.get_physical_device_memory_properties(physical);
        let kind = (0..memory.memory_type_count).find(|&i| {
            needs.memory_type_bits & (1 << i) != 0 && memory.memory_types[i as usize].property_flags.contains(wanted)
        });
        let kind = kind.ok_or("no memory that the host sees")?;
        let allocate = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
        let memory = device.allocate_memory(&allocate, None)?;
        device.bind_buffer_memory(buffer, memory, 0)?;
        let pool =
            device.create_command_pool(&vk::CommandPoolCreateInfo::default().queue_family_index(family), None)?;
        let allocate = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let commands = device.allocate_command_buffers(&allocate)?[0];
        device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())?;
        device.cmd_copy_buffer(commands, light.buffer, buffer, &[vk::BufferCopy::default().size(light.size_bytes)]);
        device.end_command_buffer(commands)?;
        let fence = device.create_fence(&vk::FenceCreateInfo::default(), None)?;
        let submit = vk::SubmitInfo::default().command_buffers(std::slice::from_ref(&commands));
        device.queue_submit(queue, &[submit], fence)?;
        device.wait_for_fences(&[fence], true, u64::MAX)?;
        let mapped = device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())?.cast::<f32>();
        let seen = std::slice::from_raw_parts(mapped, light.size_bytes as usize / 4).to_vec();
        device.destroy_fence(fence, None);
        device.destroy_command_pool(pool, None);
        device.destroy_buffer(buffer, None);
        device.free_memory(memory, None);
        Ok(seen)
    }
}
