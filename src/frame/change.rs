//! Changes between frames: the scene's lights and camera.

use super::permutation::{harmonic_lights, usable};
use super::{Frame, albedos, methods, permutation};
use crate::bake;
use crate::error::Result;
use crate::merge::Merge;
use crate::merge::variant::MergePermutation;
use crate::scene::{Camera, Entity, Scene};
use crate::sharp::SharpPermutation;

impl Frame {
    /// Whether the fields that `scene` needs are here, and the passes that its sharp lights need; it has the meshes and
    /// entities that this frame was made for.
    pub fn covers(&self, scene: &Scene) -> bool {
        let methods = methods(scene, self.options.lights);
        let wanted = permutation::sharp(&self.options, &self.merge.permutation, &methods, scene, &self.buffers);
        let has = |wanted: SharpPermutation| {
            let compiled = self.sharp.as_ref().map(|sharp| sharp.permutation);
            compiled.is_some_and(|has| (has.outlines || !wanted.outlines) && (has.panels || !wanted.panels))
        };
        let (groups, surfaces) = bake::ensure::surfaces(scene, &self.options.baked(), self.options.lights);
        let look = |entity: &Entity| (entity.gloss.is_some(), entity.maps);
        let same_looks = scene.entities.iter().map(look).eq(self.scene.entities.iter().map(look));
        same_looks
            && self.scene.boxed == scene.boxed
            && self.groups == groups
            && self.surfaces.keys() == surfaces.keys()
            && self.buffers.cover_fields(scene, self.options.lights, &groups)
            && wanted.is_none_or(has)
    }

    /// Takes over lights, switches, sky and camera of a scene that has the meshes and receivers that this frame was
    /// made for.
    ///
    /// # Panics
    /// When entities or receivers are others.
    pub fn set_scene(&mut self, scene: &Scene) -> Result<()> {
        let receivers = |scene: &Scene| scene.entities.iter().map(|e| (e.mesh, e.receives)).collect::<Vec<_>>();
        assert_eq!(receivers(scene), receivers(&self.scene), "another scene needs another frame");
        let sky = scene.data.environment != self.scene.data.environment;
        if albedos(scene) != albedos(&self.scene) {
            self.bounce.as_mut().map_or(Ok(()), |bounce| bounce.set_albedos(&albedos(scene)))?;
        }
        let surfaces = (0..scene.entities.len()).map(|entity| self.scene.surface(entity).clone()).collect();
        self.scene = scene.clone();
        self.scene.surfaces = surfaces;
        self.methods = methods(scene, self.options.lights);
        // A shader that knows of lights serves a scene without them as well.
        if harmonic_lights(scene, &self.methods) && !self.merge.permutation.lights {
            let wanted = MergePermutation { lights: true, ..self.merge.permutation };
            let usable = usable(&self.device, &self.buffers, scene.entities.len() + self.boxes.len(), wanted);
            self.merge = Merge::new(&self.device, &self.library, usable)?;
            self.forget();
        }
        if sky {
            self.work.lists.renewed = true;
            self.sky.write(scene, self.options.bake.bands)?;
            self.buffers.forget_sky();
            self.reflections.as_mut().map_or(Ok(()), |reflections| reflections.set_sky(&scene.environment))?;
        }
        Ok(())
    }

    /// Sees the scene from elsewhere from now on.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.scene.data.camera = camera.clone();
    }

    /// Draws at most so many triangles in one render pass from now on, see [`crate::draw::Draw::batch_triangles`]; at
    /// least one.
    pub fn set_batch(&mut self, triangles: u32) {
        self.picture.draw.batch_triangles = triangles.max(1);
    }
}
