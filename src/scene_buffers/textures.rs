//! Textures on the device, with their levels of detail.

use crate::asset::texture::{Texels, Texture, Wrap};
use crate::error::Result;
use crate::gpu::Device;
use crate::gpu::texture::{self, Level};
use ash::vk;
use std::collections::HashMap;
use std::sync::Arc;

/// What stands for the picture of a texture that has none.
const WHITE: [u8; 4] = [u8::MAX; 4];
/// sRGB and alpha.
const FORMAT: vk::Format = vk::Format::R8G8B8A8_SRGB;

/// Uploads textures, which hold numbers or else sRGB colours; those of one picture and one way to go on share what is
/// uploaded. Pictures that are larger than the device's are halved.
pub fn upload(
    device: &Arc<Device>,
    textures: &[Arc<Texture>],
    holds_numbers: impl Fn(usize) -> bool,
) -> Result<Vec<Arc<texture::Texture>>> {
    let mut known: HashMap<(Option<*const Texels>, [Wrap; 2], bool), Arc<texture::Texture>> = HashMap::new();
    let mut uploaded = Vec::with_capacity(textures.len());
    for (index, texture) in textures.iter().enumerate() {
        let key = (texture.texels.as_ref().map(Arc::as_ptr), texture.wrap, holds_numbers(index));
        if !known.contains_key(&key) {
            known.insert(key, Arc::new(one(device, texture, holds_numbers(index))?));
        }
        uploaded.push(known[&key].clone());
    }
    Ok(uploaded)
}

fn one(device: &Arc<Device>, texture: &Texture, holds_numbers: bool) -> Result<texture::Texture> {
    let wrap = texture.wrap.map(|wrap| match wrap {
        Wrap::Repeat => vk::SamplerAddressMode::REPEAT,
        Wrap::Mirror => vk::SamplerAddressMode::MIRRORED_REPEAT,
        Wrap::Clamp => vk::SamplerAddressMode::CLAMP_TO_EDGE,
    });
    let Some(texels) = &texture.texels else {
        return texture::Texture::new(device, "white", FORMAT, &[Level { width: 1, height: 1, bytes: &WHITE }], wrap);
    };
    let most = device.most_image_px() as usize;
    let mut levels = vec![texels.clone()];
    while let Some(last) = levels.last().filter(|last| last.width.max(last.height) > 1) {
        levels.push(Arc::new(if holds_numbers { last.halved_numbers() } else { last.halved() }));
    }
    levels.retain(|level| level.width.max(level.height) <= most);
    let levels: Vec<Level<'_>> = levels.iter().map(|level| level_of(level)).collect();
    let format = if holds_numbers { vk::Format::R8G8B8A8_UNORM } else { FORMAT };
    texture::Texture::new(device, "texture", format, &levels, wrap)
}

fn level_of(texels: &Texels) -> Level<'_> {
    Level { width: texels.width as u32, height: texels.height as u32, bytes: texels.rgba.as_flattened() }
}
