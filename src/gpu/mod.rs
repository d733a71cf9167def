//! A thin layer over `ash`: device, memory, shaders, pipelines, command recording.
//!
//! It knows nothing of spherical harmonics, fields or scenes, and it holds all of the crate's `unsafe`. Every Vulkan
//! object has one owner whose `Drop` destroys it; every owner keeps the [`Device`] alive.

// All but `Gpu`, `DeviceOptions` and `Validation` stands below the front door.
#![allow(missing_docs)]

pub mod access;
pub mod census;
pub mod commands;
pub mod compiling;
pub mod descriptors;
pub mod device;
#[cfg(feature = "view")]
pub mod display;
pub mod drawing;
pub mod flight;
pub mod image;
mod instance;
pub mod loader;
pub mod memory;
mod owned;
pub mod pipeline;
pub mod process;
pub mod reflect;
pub mod select;
pub mod shader;
pub mod share;
pub mod texture;
pub mod validation;
#[cfg(feature = "view")]
pub mod window;

pub use access::Access;
pub use commands::Commands;
pub use descriptors::Bind;
pub use device::{Device, DeviceOptions};
pub use drawing::{Drawing, Target};
pub use flight::{FLIGHTS, Flight, Timing};
pub use image::{Image, ImageShape};
pub use memory::{Buffer, BufferKind, TexelView, Upload};
pub use pipeline::{ComputePipeline, GraphicsPipeline, GraphicsState, Keeps};
pub use process::{cores, driver_threads, share_cores};
pub use shader::{Shader, Stage};
pub use share::Gpu;
pub use texture::Texture;
pub use validation::Validation;

#[cfg(feature = "view")]
pub use window::{PresentMode, Shot, Window};

use crate::error::{Error, Result};
use ash::vk;

/// Turns a Vulkan result into this crate's error, naming the call and the object it was made for.
pub(crate) trait Checked<T> {
    fn checked(self, call: &str, object: &str) -> Result<T>;
}

impl<T> Checked<T> for std::result::Result<T, vk::Result> {
    fn checked(self, call: &str, object: &str) -> Result<T> {
        self.map_err(|code| {
            let message = format!("{call} ({object}): {code:?}");
            match code {
                vk::Result::ERROR_OUT_OF_HOST_MEMORY
                | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
                | vk::Result::ERROR_OUT_OF_POOL_MEMORY
                | vk::Result::ERROR_FRAGMENTED_POOL
                | vk::Result::ERROR_FRAGMENTATION
                | vk::Result::ERROR_TOO_MANY_OBJECTS
                | vk::Result::ERROR_MEMORY_MAP_FAILED
                | vk::Result::ERROR_SURFACE_LOST_KHR
                | vk::Result::ERROR_DEVICE_LOST => Error::Device(message),
                vk::Result::ERROR_INITIALIZATION_FAILED
                | vk::Result::ERROR_NATIVE_WINDOW_IN_USE_KHR
                | vk::Result::ERROR_FEATURE_NOT_PRESENT
                | vk::Result::ERROR_EXTENSION_NOT_PRESENT
                | vk::Result::ERROR_LAYER_NOT_PRESENT
                | vk::Result::ERROR_INCOMPATIBLE_DRIVER => Error::Unsupported(message),
                _ => Error::Failed(message),
            }
        })
    }
}
