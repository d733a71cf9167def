//! Names that a program needs to light a scene: `use shadow_fields::prelude::*;`.

pub use crate::asset::Generator;
pub use crate::bake::cache::Cache;
pub use crate::bake::{BakeOptions, Quality};
pub use crate::error::Error;
pub use crate::gpu::{DeviceOptions, Gpu};
pub use crate::renderer::{RenderOptions, Renderer};
pub use crate::scene::{Camera, EntityData, Placement, Scene};
