//! A frame that lives on: recorded into somebody else's commands and changed between pictures, for the window.

use super::Frame;
use super::form::usable;
use crate::bake::cache::Cache;
use crate::draw::Draw;
use crate::error::Result;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Timing};
use crate::lists::gathering::Gathering;
use crate::merge::Merge;
use crate::merge::calibrate;
use crate::merge::variant::{Form, Variant};
use crate::scene::{Camera, Placement, Scene};
use crate::scene_buffers::Store;
use std::sync::atomic::Ordering;

/// Where the radiosity of a part of the picture comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lit {
    /// The merge, with what entities emit.
    Merged,
    /// What [`Frame::set_panel`] put at that place, with what entities emit.
    Panel(usize),
    /// The same as it stands: colours that mean something else.
    Colors(usize),
}

/// A part of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Left, top, width and height in pixels.
    pub area: [u32; 4],
    /// What lights it.
    pub lit: Lit,
}

impl Frame {
    /// Writes what the next recording's merge reads, in buffers of that flight's own. While things move only what may be seen in
    /// `parts` that show merged light is merged; where there are none, or nothing has changed since the last call, everything is
    /// that is not merged yet.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn prepare(&mut self, placements: &[Placement], parts: &[Part]) -> Result<()> {
        if !*self.recorded.get_mut() {
            self.lists.forget();
        }
        *self.recorded.get_mut() = false;
        self.heed_report();
        self.upload(placements, parts)
    }

    /// Records the merge of what has changed, after [`Frame::prepare`]; nothing where nothing has. When the recording does not
    /// run, call [`Frame::forget`].
    ///
    /// # Errors
    /// As [`Frame::render`].
    pub fn record_light<'f>(&'f self, commands: &mut Commands<'f>) -> Result<()> {
        if self.merged.merged_clusters > 0 {
            self.record_merge(commands)?;
            commands.barrier(Access::ComputeWrite, Access::VertexRead);
            commands.barrier(Access::ComputeWrite, Access::FragmentSampled);
        }
        self.recorded.store(true, Ordering::Relaxed);
        Ok(())
    }

    /// Radiosity of every entity's vertices from elsewhere, by entity in the mesh's order, for the panel at that place: 0 or 1.
    /// Entities that are not named are `rest`.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn set_panel(&mut self, panel: usize, radiosity: &[(usize, Vec<[f32; 3]>)], rest: [f32; 3]) -> Result<()> {
        let size = self.radiosity.size_bytes;
        let [r, g, b] = rest;
        let mut quads = vec![[r, g, b, 0.0]; size as usize / 16];
        for (entity, values) in radiosity {
            let order = &self.store.geometries[self.scene.entities[*entity].mesh].order;
            let first = self.radiosity_offsets[*entity] as usize / 16;
            for (quad, &v) in quads[first..].iter_mut().zip(order) {
                let [r, g, b] = values[v as usize];
                *quad = [r, g, b, 0.0];
            }
        }
        let buffer = match &mut self.panels[panel] {
            Some(buffer) => buffer,
            none => none.insert(Buffer::new(&self.device, "panel", BufferKind::Device, size)?),
        };
        buffer.fill(0, &quads)
    }

    /// As [`Frame::render`] with a picture that stays on the device, as a window would show it.
    ///
    /// # Errors
    /// As [`Frame::render`].
    pub fn show(&mut self, placements: &[Placement], white: f32) -> Result<Vec<Timing>> {
        let outcome = self.light_and_show(placements, white);
        if outcome.is_err() {
            self.forget();
        }
        outcome
    }

    fn light_and_show(&mut self, placements: &[Placement], white: f32) -> Result<Vec<Timing>> {
        let whole = self.whole(Lit::Merged);
        self.prepare(placements, &[whole])?;
        self.prepare_picture(placements, &[whole])?;
        loop {
            let mut commands = Commands::new(&self.device, "frame")?;
            self.record_light(&mut commands)?;
            self.record_picture(&mut commands, placements, &[whole], white)?;
            let timings = commands.submit()?;
            if self.all_gathered() {
                return Ok(timings);
            }
            self.prepare(placements, &[whole])?;
        }
    }

    /// Whether the fields that `scene` needs are here; it has the meshes and entities that this frame was made for.
    pub fn covers(&self, scene: &Scene) -> bool {
        self.store.covers(scene)
    }

    /// Takes over lights, switches, sky and camera of a scene that has the meshes and receivers that this frame was made for.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    ///
    /// # Panics
    /// When entities or receivers are others.
    pub fn set_scene(&mut self, scene: &Scene) -> Result<()> {
        let receivers = |scene: &Scene| scene.entities.iter().map(|e| (e.mesh, e.receives)).collect::<Vec<_>>();
        assert_eq!(receivers(scene), receivers(&self.scene), "another scene needs another frame");
        let sky = scene.data.environment != self.scene.data.environment;
        self.scene = scene.clone();
        if sky { self.write_sky() } else { Ok(()) }
    }

    /// Sees the scene from elsewhere from now on.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.scene.data.camera = camera.clone();
    }

    /// Draws at most so many triangles in one render pass from now on, see [`Draw::batch_triangles`]; a multiple of one at least.
    pub fn set_batch(&mut self, triangles: u32) {
        self.draw.batch_triangles = triangles.max(1);
    }

    /// What its merge was compiled for.
    pub fn form(&self) -> Form {
        self.form
    }

    /// Merges by another variant from now on; `None` is the device's fastest.
    ///
    /// # Errors
    /// `Failed` when its shader does not compile.
    pub fn set_variant(&mut self, variant: Option<Variant>) -> Result<()> {
        let wanted = variant.unwrap_or_else(|| calibrate::best_known(&self.device));
        let (form, image) =
            usable(&self.device, &self.store, self.scene.entities.len(), Form { variant: wanted, ..self.form })?;
        if form != self.form {
            self.merge = Merge::new(&self.device, &self.library, form)?;
            self.lists.forget();
            (self.form, self.variant, self.image) = (form, form.variant, image);
        }
        Ok(())
    }

    /// Builds anew what is made from any of the shader files named. What does not compile stays as it was.
    ///
    /// # Errors
    /// `Failed` with the compiler's lines.
    pub fn reload(&mut self, changed: &[String]) -> Result<()> {
        let uses = |files: &[String]| files.iter().any(|file| changed.contains(file));
        let drawing = ["draw.vert", "draw.frag", "grid.vert", "grid.frag", "smooth.vert", "smooth.frag"];
        if drawing.iter().any(|entry| uses(&self.library.files(entry))) {
            let options = self.options;
            self.draw = Draw::new(&self.device, &self.library, options.size, options.antialias, self.draw.finish())?;
        }
        if uses(&self.library.files("gather.comp")) && self.gathering.is_some() {
            self.gathering = Some(Gathering::new(&self.device, &self.library, &self.lists, self.scene.entities.len())?);
            self.lists.forget();
        }
        if uses(&self.library.files("merge.comp")) {
            self.merge = Merge::new(&self.device, &self.library, self.form)?;
            self.lists.forget();
        }
        Ok(())
    }
}

/// Whether a scene's fields and transfers are all in the cache, so that its frame is there at once.
pub fn is_cached(cache: &Cache, scene: &Scene, options: &crate::bake::Options) -> bool {
    Store::is_cached(cache, scene, options)
}
