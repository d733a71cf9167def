//! Devices that have less than the one at hand: refused with the number, or worked around with the same picture.

use super::claimed::Claims;
use super::layer::watch;
use super::sweep::assert_clean;
use super::{Place, SMALL, run};
use shadow_fields::error::one_line;
use std::collections::BTreeMap;
use std::path::Path;

/// What becomes of a picture on a device.
#[derive(Clone, Copy)]
enum Outcome {
    /// It is the same.
    Same,
    /// There is one, which is not the same.
    Other,
    /// There is none, with this exit code and a line that has these words.
    Refused(u8, &'static str),
}

use Outcome::{Other, Refused, Same};

/// A device that has less, what is asked of it, and what follows.
type Row<T> = (&'static str, &'static str, T, Outcome);

const ALL: Claims = Claims::NONE;

/// Less than the program needs, or nothing that it needs.
#[rustfmt::skip]
const OTHERS: &[Row<Claims>] = &[
    ("Vulkan 1.2", "", Claims { api_version: ash::vk::API_VERSION_1_2, ..ALL },
        Refused(3, "supports Vulkan 1.2.0, but 1.3 is needed")),
    ("no dynamic rendering", "", Claims { features: |f| f.dynamic_rendering = 0, ..ALL },
        Refused(3, "lacks the feature dynamicRendering")),
    ("no synchronization2", "", Claims { features: |f| f.synchronization2 = 0, ..ALL },
        Refused(3, "lacks the feature synchronization2")),
    ("no maintenance4", "", Claims { features: |f| f.maintenance4 = 0, ..ALL }, Same),
    ("no timestamps", "", Claims { family: |f| f.timestamp_valid_bits = 0, ..ALL },
        Refused(3, "has no queue with graphics, compute and timestamps")),
    ("timestamps of 36 bits", "", Claims { family: |f| f.timestamp_valid_bits = 36, ..ALL }, Same),
    ("no names for debuggers", "", Claims { extension: |name| name != ash::ext::debug_utils::NAME, ..ALL }, Same),
    ("memory that the host cannot see", "", Claims { splits_memory: true, ..ALL }, Same),
    ("20 MB of memory", "--size 2048x2048", Claims { heap_bytes: Some(20_000_000), ..ALL },
        Refused(4, "but the device has 0.02 GB")),
];

/// The least that Vulkan 1.3 allows, and less than the program needs.
#[rustfmt::skip]
const LIMITS: &[Row<fn(&mut ash::vk::PhysicalDeviceLimits)>] = &[
    ("128 bytes of push constants", "", |l| l.max_push_constants_size = 128, Same),
    ("128 invocations a workgroup", "", |l| l.max_compute_work_group_invocations = 128, Same),
    ("128 invocations along x", "", |l| l.max_compute_work_group_size = [128, 128, 64], Same),
    ("16 KiB of shared memory", "", |l| l.max_compute_shared_memory_size = 16384, Same),
    ("4 storage buffers a stage", "", |l| l.max_per_stage_descriptor_storage_buffers = 4,
        Refused(3, "storage buffers a stage, the device takes 4")),
    ("12 uniform buffers a stage", "", |l| l.max_per_stage_descriptor_uniform_buffers = 12, Same),
    ("16 sampled images a stage", "", |l| l.max_per_stage_descriptor_sampled_images = 16, Same),
    ("no sampled images", "--variant texel-packed", |l| l.max_per_stage_descriptor_sampled_images = 0,
        Refused(3, "sampled images a stage, the device takes 0")),
    ("storage buffers of 128 MiB", "", |l| l.max_storage_buffer_range = 1 << 27, Same),
    ("storage buffers of 512 bytes", "", |l| l.max_storage_buffer_range = 512,
        Refused(4, "bytes, the device takes 512")),
    ("uniform buffers of 16 KiB", "--variant storage-uniform", |l| l.max_uniform_buffer_range = 1 << 14, Same),
    ("texel buffers of 65536 texels", "--variant texel-packed", |l| l.max_texel_buffer_elements = 1 << 16, Same),
    ("texel buffers of 256 texels, with pixels", "--shading pixel", |l| l.max_texel_buffer_elements = 1 << 8, Other),
    ("texel buffers of 4 texels", "--variant texel-packed", |l| l.max_texel_buffer_elements = 4, Refused(4, "(4)")),
    ("images of 4096 pixels", "", |l| l.max_image_dimension2_d = 4096, Same),
    ("images of 8 pixels", "", |l| l.max_image_dimension2_d = 8, Refused(4, "at most 8 px")),
    ("framebuffers 32 pixels high", "--size 40x40 --lights sh", |l| l.max_framebuffer_height = 32,
        Refused(4, "40x40 is outside the device's 1..=32")),
    ("one workgroup", "", |l| l.max_compute_work_group_count = [1; 3],
        Refused(4, "the device takes [1, 1, 1]")),
    ("buffers at 256 bytes", "",
        |l| (l.min_storage_buffer_offset_alignment, l.min_uniform_buffer_offset_alignment) = (256, 256), Same),
    ("one sample a pixel", "--antialias samples --lights sh",
        |l| l.framebuffer_color_sample_counts = ash::vk::SampleCountFlags::TYPE_1, Other),
];

fn picture(folder: &Path, more: &str) -> shadow_fields::Result<()> {
    let variant = if more.contains("--variant") { "" } else { "--variant storage" };
    let antialias = if more.contains("--antialias") { "" } else { "--antialias none" };
    run(folder, &format!("render @scene.toml -o @p.png {variant} {antialias} {SMALL} {more}"))
}

#[test]
fn devices_that_have_less_are_refused_with_the_number_or_worked_around() {
    let Some(place) = Place::new() else { return };
    let folder = place.path();
    let output = folder.join("p.png");
    let mut wrong = Vec::new();
    let mut pictures = BTreeMap::new();
    let limits = LIMITS.iter().map(|&(what, more, limits, outcome)| (what, more, Claims { limits, ..ALL }, outcome));
    for (what, more, claims, outcome) in OTHERS.iter().copied().chain(limits) {
        let expected = pictures.entry(more).or_insert_with(|| {
            picture(folder, more).unwrap();
            std::fs::read(&output).unwrap()
        });
        let _ = std::fs::remove_dir_all(folder.join("cache/fields"));
        let _ = std::fs::remove_file(&output);
        let (ran, heard) = watch(None, claims, || picture(folder, more));
        assert_clean(what, &heard);
        let made = std::fs::read(&output).ok();
        match (outcome, ran) {
            (Same, Ok(())) if made.as_ref() == Some(expected) => {}
            (Other, Ok(())) if made.is_some() && made.as_ref() != Some(expected) => {}
            (Refused(code, words), Err(error))
                if error.exit_code() == code && error.to_string().contains(words) && made.is_none() => {}
            (_, Ok(())) => wrong.push(format!("{what}: a picture, the same: {}", made.as_ref() == Some(expected))),
            (_, Err(error)) => wrong.push(format!("{what}: {} {}", error.exit_code(), one_line(&error.to_string()))),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
