//! Resources that a recording binds to a pass.

use super::image::Image;
use super::memory::{Buffer, TexelView};
use super::texture::Texture;
use std::ops::Range;

/// A resource given to a pass; its position in the list is its binding number.
#[derive(Clone)]
pub enum Bind<'r> {
    /// A whole buffer, as storage or uniform block.
    Buffer(&'r Buffer),
    /// A byte range of a buffer. Its start keeps the device's offset alignment (at most 256 bytes).
    Range(&'r Buffer, Range<u64>),
    /// A texel view.
    Texel(TexelView<'r>),
    /// An image that is read with `texelFetch`.
    Image(&'r Image),
    /// A texture that a fragment shader samples.
    Texture(&'r Texture),
    /// No resource: the shader permutation does not have this binding.
    None,
}
