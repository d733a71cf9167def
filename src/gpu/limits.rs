//! Shaders' demands, compared with the device's limits before pipelines are made.

use super::reflect::{Binding, Reflection};
use super::shader::{Shader, Stage};
use crate::error::{Error, Result};
use ash::vk;

/// Refuses what exceeds a limit.
pub(super) fn check(
    limits: &vk::PhysicalDeviceLimits,
    name: &str,
    shaders: &[&Shader],
    bindings: &[Binding],
) -> Result<()> {
    use vk::DescriptorType as Kind;
    let push_bytes = shaders.iter().map(|s| s.reflection.push_bytes).max().unwrap_or(0);
    at_most(name, "bytes of push constants", push_bytes, limits.max_push_constants_size)?;
    let count = |kinds: &[Kind]| bindings.iter().filter(|b| kinds.contains(&b.kind)).count() as u32;
    // A texel buffer counts as a sampled image.
    let sampled = [Kind::UNIFORM_TEXEL_BUFFER, Kind::SAMPLED_IMAGE, Kind::COMBINED_IMAGE_SAMPLER];
    for (what, asked, most) in [
        ("storage buffers a stage", count(&[Kind::STORAGE_BUFFER]), limits.max_per_stage_descriptor_storage_buffers),
        ("uniform buffers a stage", count(&[Kind::UNIFORM_BUFFER]), limits.max_per_stage_descriptor_uniform_buffers),
        ("sampled images a stage", count(&sampled), limits.max_per_stage_descriptor_sampled_images),
        ("resources a stage", bindings.len() as u32, limits.max_per_stage_resources),
    ] {
        at_most(name, what, asked, most)?;
    }
    shaders
        .iter()
        .filter(|shader| shader.stage == Stage::Compute)
        .try_for_each(|shader| check_workgroup(limits, name, &shader.reflection))
}

fn check_workgroup(limits: &vk::PhysicalDeviceLimits, name: &str, shader: &Reflection) -> Result<()> {
    let size = shader.local_size;
    at_most(name, "invocations a workgroup", size.iter().product(), limits.max_compute_work_group_invocations)?;
    for (axis, (asked, most)) in ["x", "y", "z"].iter().zip(size.iter().zip(limits.max_compute_work_group_size)) {
        at_most(name, &format!("invocations a workgroup along {axis}"), *asked, most)?;
    }
    let shared = "bytes of memory shared by a workgroup";
    at_most(name, shared, shader.shared_bytes, limits.max_compute_shared_memory_size)
}

fn at_most(name: &str, what: &str, asked: u32, most: u32) -> Result<()> {
    if asked > most {
        return Err(Error::Unsupported(format!("{name} wants {asked} {what}, the device takes {most}")));
    }
    Ok(())
}
