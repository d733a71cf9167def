//! What may change from frame to frame: the scene's lights and camera, the merge's variant, and shader files.

use super::permutation::{CompiledMerge, harmonic_lights, usable};
use super::{Frame, methods, permutation};
use crate::error::Result;
use crate::merge::calibrate;
use crate::merge::variant::{MergePermutation, Variant};
use crate::scene::{Camera, Scene};
use crate::sharp::{Sharp, SharpPermutation};

impl Frame {
    /// Whether the fields that `scene` needs are here, and the passes that its sharp lights need; it has the meshes and entities
    /// that this frame was made for.
    pub fn covers(&self, scene: &Scene) -> bool {
        let methods = methods(scene, self.options.lights);
        let wanted = permutation::sharp(&self.options, &self.merge.permutation, &methods, scene, &self.buffers);
        let has = |wanted: SharpPermutation| {
            let compiled = self.sharp.as_ref().map(|sharp| sharp.permutation);
            compiled.is_some_and(|has| (has.outlines || !wanted.outlines) && (has.panels || !wanted.panels))
        };
        self.buffers.covers(scene, self.options.lights) && wanted.is_none_or(has)
    }

    /// Takes over lights, switches, sky and camera of a scene that has the meshes and receivers that this frame was made for.
    ///
    /// # Errors
    /// `Device` when memory ran out, `Failed` when a shader does not compile.
    ///
    /// # Panics
    /// When entities or receivers are others.
    pub fn set_scene(&mut self, scene: &Scene) -> Result<()> {
        let receivers = |scene: &Scene| scene.entities.iter().map(|e| (e.mesh, e.receives)).collect::<Vec<_>>();
        assert_eq!(receivers(scene), receivers(&self.scene), "another scene needs another frame");
        let sky = scene.data.environment != self.scene.data.environment;
        self.scene = scene.clone();
        self.methods = methods(scene, self.options.lights);
        // A shader that knows of lights serves a scene without them as well.
        if harmonic_lights(scene, &self.methods) && !self.merge.permutation.lights {
            self.compile_merge(MergePermutation { lights: true, ..self.merge.permutation })?;
        }
        if sky {
            self.work.lists.renew();
            self.sky.write(scene, self.options.bake.bands)?;
        }
        Ok(())
    }

    /// Sees the scene from elsewhere from now on.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.scene.data.camera = camera.clone();
    }

    /// Draws at most so many triangles in one render pass from now on, see [`crate::draw::Draw::batch_triangles`]; at least one.
    pub fn set_batch(&mut self, triangles: u32) {
        self.picture.draw.batch_triangles = triangles.max(1);
    }

    /// Merges by another variant from now on; `None` is the device's fastest.
    ///
    /// # Errors
    /// `Failed` when its shader does not compile.
    pub fn set_variant(&mut self, variant: Option<Variant>) -> Result<()> {
        let variant = variant.unwrap_or_else(|| calibrate::best_known(&self.device));
        self.compile_merge(MergePermutation { variant, ..self.merge.permutation })
    }

    /// Goes over to storage blocks where texel views cannot hold the clusters and lists that the next merge reads. Returns whether the
    /// merge was compiled anew, which wants them to be prepared again: entities name their fields by other places than those of an image.
    pub(super) fn fit_lists(&mut self) -> Result<bool> {
        if self.work.fits_views(&self.device) {
            return Ok(false);
        }
        if let Some(sharp) = self.sharp.as_mut().filter(|sharp| sharp.permutation.texel) {
            let permutation = SharpPermutation { texel: false, ..sharp.permutation };
            *sharp = Sharp::new(&self.device, &self.library, permutation)?;
        }
        let MergePermutation { variant, .. } = self.merge.permutation;
        let without_views = variant.restricted(false, false, false);
        if variant.texel {
            log::info!("the lists are too long for texel views; using \"{}\"", without_views.name);
            self.compile_merge(MergePermutation { variant: without_views, ..self.merge.permutation })?;
        }
        Ok(variant.texel)
    }

    /// Has the pass of sharp lights mark the edges of shadows where pixels by now read the marks, and leave them out where none does. Where
    /// they are new, every cluster is merged again.
    pub(super) fn fit_edges(&mut self) -> Result<()> {
        let edges = self.pixel.is_some() && self.options.evaluates_pixels();
        let Some(sharp) = self.sharp.as_mut().filter(|sharp| sharp.permutation.edges != edges) else { return Ok(()) };
        *sharp = Sharp::new(&self.device, &self.library, SharpPermutation { edges, ..sharp.permutation })?;
        if edges {
            self.forget();
        }
        Ok(())
    }

    /// Compiles the merge for what is wanted, as far as the device allows it. If it was compiled for something else, every cluster is
    /// merged again.
    fn compile_merge(&mut self, wanted: MergePermutation) -> Result<()> {
        let usable = usable(&self.device, &self.buffers, self.scene.entities.len(), wanted)?;
        if usable.0 != self.merge.permutation {
            self.merge = CompiledMerge::new(&self.device, &self.library, usable)?;
            self.forget();
        }
        Ok(())
    }

    /// Builds anew what is made from any of the shader files named. What does not compile stays as it was.
    ///
    /// # Errors
    /// `Failed` with the compiler's lines.
    pub fn reload(&mut self, changed: &[String]) -> Result<()> {
        let uses = |entry: &str| self.library.files(entry).iter().any(|file| changed.contains(file));
        let drawing = [
            "draw.vert",
            "draw.frag",
            "grid.vert",
            "grid.frag",
            "triangle.vert",
            "triangle.frag",
            "smooth.vert",
            "smooth.frag",
        ];
        let [draws, gathers, merges] = [drawing.into_iter().any(uses), uses("gather.comp"), uses("merge.comp")];
        if draws {
            self.picture.draw = self.draw(&self.options, self.picture.draw.finish())?;
        }
        if gathers {
            self.work.rebuild(&self.library, self.scene.entities.len())?;
        }
        if uses("sharp.comp")
            && let Some(sharp) = &mut self.sharp
        {
            *sharp = Sharp::new(&self.device, &self.library, sharp.permutation)?;
            self.forget();
        }
        if merges {
            self.merge.rebuild(&self.device, &self.library)?;
            self.forget();
        }
        Ok(())
    }
}
