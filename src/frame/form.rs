//! The merge pass as it is compiled for a scene: what was asked for, less what scene or device do not allow.

use super::Options;
use crate::error::Result;
use crate::gpu::{Device, TexelView, Volume};
use crate::merge::Merge;
use crate::merge::variant::{Form, Variant};
use crate::scene_buffers::Store;
use crate::shaders::Library;
use ash::vk;
use std::sync::Arc;

/// The merge pass of a frame.
pub(super) struct CompiledMerge {
    pub pass: Merge,
    /// What its shader was compiled for.
    pub form: Form,
    /// The fields as an image, where the variant samples one.
    pub image: Option<Volume>,
}

impl CompiledMerge {
    /// Compiles it for what [`usable`] returned.
    ///
    /// # Errors
    /// As [`Merge::new`].
    pub fn new(device: &Arc<Device>, library: &Library, (form, image): (Form, Option<Volume>)) -> Result<Self> {
        Ok(CompiledMerge { pass: Merge::new(device, library, form)?, form, image })
    }

    /// Compiles its shader anew, from files that have changed.
    ///
    /// # Errors
    /// As [`Merge::new`].
    pub fn rebuild(&mut self, device: &Arc<Device>, library: &Library) -> Result<()> {
        self.pass = Merge::new(device, library, self.form)?;
        Ok(())
    }
}

/// The form with its variant less the texel views or uniform blocks that cannot hold the scene.
pub(super) fn usable(
    device: &Device,
    store: &Store,
    entity_count: usize,
    form: Form,
) -> Result<(Form, Option<Volume>)> {
    let floats = vk::Format::R32G32B32A32_SFLOAT;
    let fits = TexelView::fits(device, form.field_format(), store.fields.size_bytes)
        && TexelView::fits(device, floats, store.transfers.size_bytes)
        && TexelView::fits(device, floats, store.vertices.size_bytes);
    let image = (form.variant.image && form.fits_image()).then(|| store.image()).transpose()?.flatten();
    let variant = form.variant.restricted(fits, entity_count <= form.entity_limit as usize, image.is_some());
    if variant != form.variant {
        log::info!("the scene is too large for the variant \"{}\"; using \"{}\"", form.variant.name, variant.name);
    }
    Ok((Form { variant, ..form }, image.filter(|_| variant.image)))
}

/// The form of the merge shader.
pub(super) fn form(options: &Options, variant: Variant, entity_limit: u32) -> Form {
    Form {
        variant,
        bands: options.bake.bands,
        field_bands: options.bake.occlusion_bands(),
        guard: options.guard,
        storage: options.bake.storage,
        lattice: options.bake.lattice,
        lookup: options.lookup,
        skip: options.skip,
        entity_limit,
    }
}
