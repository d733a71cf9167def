//! Pictures of a frame: what is drawn of it, in which order, and read back.

use super::Frame;
use super::live::{Lit, Part};
use crate::asset::edges::{Edges, Line};
use crate::asset::picture::linear_from_srgb;
use crate::draw::camera;
use crate::draw::smooth::{self, Strips};
use crate::draw::{Antialias, Draw, Finish, Item, Pane};
use crate::error::Result;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Image, Timing};
use crate::lists::sight::{self, Sight};
use crate::scene::Placement;
use ash::vk;
use glam::Vec3;
use half::f16;
use rayon::prelude::*;
use std::ops::Range;

impl Frame {
    /// Finds outlines and creases for the next recording of a picture, in buffers of that flight's own; nothing where they are not
    /// smoothed.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn prepare_picture(&mut self, placements: &[Placement], parts: &[Part]) -> Result<()> {
        self.line_ranges.clear();
        if self.draw.smooth.is_none() {
            return Ok(());
        }
        if self.edges.is_empty() {
            self.edges = self.scene.meshes.iter().map(|mesh| Edges::new(mesh)).collect();
        }
        let mut strips = Strips::default();
        for part in parts {
            let first = strips.count() as u32;
            let [_, _, width, height] = part.area;
            for (line, tag) in self.outlines(placements, f64::from(width) / f64::from(height.max(1))) {
                strips.add(&line, [width, height], tag);
            }
            self.line_ranges.push(first..strips.count() as u32);
        }
        self.lines.write(&strips)
    }

    /// Outlines and creases of all entities as the camera sees them, and the tag of each.
    pub(super) fn outlines(&self, placements: &[Placement], aspect: f64) -> Vec<(Line, f32)> {
        let camera = &self.scene.data.camera;
        let clip_from_world = camera::clip_from_world(camera, aspect);
        let lines = placements.par_iter().enumerate().flat_map_iter(|(index, placement)| {
            let mesh = self.scene.entities[index].mesh;
            let world = camera::world_from_centred(placement, self.store.geometries[mesh].centre_m);
            let eye = world.inverse().transform_point3(camera.eye.as_dvec3());
            let lines = self.edges[mesh].lines(clip_from_world * world, eye, true);
            lines.into_iter().map(move |line| (line, smooth::tag(index)))
        });
        lines.collect()
    }

    /// All of the picture.
    pub(super) fn whole(&self, lit: Lit) -> Part {
        Part { area: [0, 0, self.options.size[0], self.options.size[1]], lit }
    }

    /// Draws the picture from the radiosity as it stands, the last merge's or what [`Frame::set_radiosity`] put there.
    ///
    /// # Errors
    /// As [`Frame::render`].
    pub fn redraw(&mut self, placements: &[Placement], white: f32) -> Result<Vec<Timing>> {
        self.prepare_picture(placements, &[self.whole(Lit::Merged)])?;
        let items = self.items(placements, self.options.size);
        let mut commands = Commands::new(&self.device, "redraw")?;
        self.record_file(&mut commands, &items, self.background, white)?;
        commands.submit()
    }

    /// As [`Frame::redraw`] for numbers that are no light: nothing shines, nothing is brought down, and the background is given.
    ///
    /// # Errors
    /// As [`Frame::render`].
    pub fn redraw_unlit(&mut self, placements: &[Placement], background: [f32; 3]) -> Result<Vec<Timing>> {
        self.prepare_picture(placements, &[self.whole(Lit::Merged)])?;
        let mut items = self.items(placements, self.options.size);
        items.iter_mut().for_each(|item| item.emission = Vec3::ZERO);
        let mut commands = Commands::new(&self.device, "redraw unlit")?;
        self.record_file(&mut commands, &items, background.into(), f32::INFINITY)?;
        commands.submit()
    }

    /// Draws and reads back.
    pub(super) fn record_file<'f>(
        &'f self,
        commands: &mut Commands<'f>,
        items: &[Item<'f>],
        background: Vec3,
        white: f32,
    ) -> Result<()> {
        let area = self.whole(Lit::Merged).area;
        self.record_panes(commands, &[Pane { items, radiosity: &self.radiosity, area }], background, white)?;
        let picture = self.draw.finished();
        commands.image_barrier(picture, Some(Access::ColorWrite), Access::TransferRead);
        commands.pass("read back", |commands| {
            commands.copy_image(picture, &self.readback);
            Ok(())
        })?;
        commands.barrier(Access::TransferWrite, Access::HostRead);
        Ok(())
    }

    /// Draws, and smooths what is to be smoothed. Leaves the picture as colour attachment.
    fn record_panes<'f>(
        &'f self,
        commands: &mut Commands<'f>,
        panes: &[Pane<'_, 'f>],
        background: Vec3,
        white: f32,
    ) -> Result<()> {
        for image in self.draw.attachments() {
            let depth = image.shape.format == vk::Format::D32_SFLOAT;
            commands.image_barrier(image, None, if depth { Access::DepthWrite } else { Access::ColorWrite });
        }
        commands.pass("draw", |c| self.draw.record(c, panes, background, white))?;
        let Some(smooth) = &self.draw.smooth else { return Ok(()) };
        let (picture, depth) = (&self.draw.picture, &self.draw.depth);
        // It is copied first and then read beside the copy.
        commands.barrier(Access::ColorWrite, Access::FragmentSampled);
        commands.image_barrier(picture, Some(Access::ColorWrite), Access::TransferRead);
        commands.image_barrier(&smooth.picture, None, Access::TransferWrite);
        assert_eq!(panes.len(), self.line_ranges.len(), "parts of a picture, and those that it was prepared for");
        let lines: Vec<_> = panes.iter().map(|pane| pane.area).zip(self.line_ranges.iter().cloned()).collect();
        commands.pass("smooth", |c| smooth.record(c, (picture, depth), &self.lines, &lines))
    }

    /// Records the picture, part by part, after [`Frame::prepare_picture`], to be read by a fragment shader. `white` as in [`Frame::render`].
    ///
    /// # Errors
    /// As [`Frame::render`].
    pub fn record_picture<'f>(
        &'f self,
        commands: &mut Commands<'f>,
        placements: &[Placement],
        parts: &[Part],
        white: f32,
    ) -> Result<()> {
        let lists: Vec<Vec<Item<'f>>> = parts
            .iter()
            .map(|part| {
                let mut items = self.items(placements, [part.area[2], part.area[3]]);
                if matches!(part.lit, Lit::Colors(_)) {
                    items.iter_mut().for_each(|item| item.emission = Vec3::ZERO);
                }
                items
            })
            .collect();
        let radiosity = |lit| match lit {
            Lit::Merged => &self.radiosity,
            Lit::Panel(i) | Lit::Colors(i) => self.panels[i].as_ref().unwrap_or(&self.radiosity),
        };
        let panes: Vec<Pane<'_, 'f>> = parts
            .iter()
            .zip(&lists)
            .map(|(part, items)| Pane { items, radiosity: radiosity(part.lit), area: part.area })
            .collect();
        self.record_panes(commands, &panes, self.background, white)?;
        commands.image_barrier(self.draw.finished(), Some(Access::ColorWrite), Access::FragmentSampled);
        Ok(())
    }

    /// The picture that was recorded last: linear or encoded, white as it was recorded with.
    pub fn shown(&self) -> &Image {
        self.draw.finished()
    }

    /// The last picture: linear RGB, three floats a pixel, rows from the top. Made for a screen, it is decoded: white is 1.
    pub fn picture(&self) -> Vec<f32> {
        let pixels = (self.options.size[0] * self.options.size[1]) as usize;
        if self.draw.finish() == Finish::Display {
            let bytes: Vec<u8> = self.readback.read(0, 4 * pixels);
            let linear = |byte: u8| linear_from_srgb(f32::from(byte) / 255.0);
            return bytes.chunks_exact(4).flat_map(|p| [linear(p[0]), linear(p[1]), linear(p[2])]).collect();
        }
        let halves: Vec<f16> = self.readback.read(0, 4 * pixels);
        halves.chunks_exact(4).flat_map(|p| [p[0].to_f32(), p[1].to_f32(), p[2].to_f32()]).collect()
    }

    /// Makes pictures of another size from now on.
    ///
    /// # Errors
    /// `Input` when it is larger than the device's images.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        if size != self.options.size {
            self.draw = Draw::new(&self.device, &self.library, size, self.options.antialias, self.draw.finish())?;
            let bytes = 8 * u64::from(size[0]) * u64::from(size[1]);
            self.readback = Buffer::new(&self.device, "readback", BufferKind::Readback, bytes)?;
            self.options.size = size;
        }
        Ok(())
    }

    /// Makes pictures for files or for a screen from now on, edges smoothed one way or another. A frame begins with linear ones.
    ///
    /// # Errors
    /// `Failed` when a shader does not compile.
    pub fn set_finish(&mut self, finish: Finish, antialias: Antialias) -> Result<()> {
        if (finish, antialias) != (self.draw.finish(), self.options.antialias) {
            self.draw = Draw::new(&self.device, &self.library, self.options.size, antialias, finish)?;
            self.options.antialias = antialias;
        }
        Ok(())
    }

    /// The picture at full quality, whatever is shown: multisampled where the device can, linear RGB, three floats a pixel, rows
    /// from the top; `white` as in [`Frame::render`]. Waits.
    ///
    /// # Errors
    /// As [`Frame::render`].
    pub fn still(&mut self, placements: &[Placement], white: f32) -> Result<Vec<f32>> {
        self.device.settle();
        let fine = Draw::new(&self.device, &self.library, self.options.size, Antialias::Samples, Finish::Linear)?;
        let usual = std::mem::replace(&mut self.draw, fine);
        let outcome = self.render(placements, Some(white)).map(|_| self.picture());
        self.draw = usual;
        outcome
    }

    /// Triangles that the whole picture leaves out.
    pub(super) fn undrawn_count(&self, placements: &[Placement]) -> usize {
        let count = |indices: Vec<Range<u32>>| indices.iter().map(|range| range.len() / 3).sum::<usize>();
        let items = self.items(placements, self.options.size);
        items.into_iter().map(|item| count(item.drawable.seen(None)) - count(item.indices)).sum()
    }

    /// The camera for a part of the picture.
    pub(super) fn camera(&self, size: [u32; 2]) -> sight::Camera {
        let camera = &self.scene.data.camera;
        let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
        sight::Camera {
            clip_from_world: camera::clip_from_world(camera, aspect),
            eye: camera.eye.as_dvec3(),
            near_m: camera::near_corner_m(camera, aspect),
            size,
            samples: self.draw.samples() > 1,
        }
    }

    /// How an entity is seen.
    pub(super) fn sight(&self, camera: &sight::Camera, index: usize, placement: &Placement) -> Sight {
        let mesh = self.scene.entities[index].mesh;
        let geometry = &self.store.geometries[mesh];
        let world_from_object = camera::world_from_centred(placement, geometry.centre_m);
        Sight::new(camera, world_from_object, geometry.radius_m, self.scene.meshes[mesh].is_solid())
    }

    /// All entities as they are drawn, in the order in which they are.
    pub(super) fn items(&self, placements: &[Placement], size: [u32; 2]) -> Vec<Item<'_>> {
        let camera = self.camera(size);
        let items = placements.iter().enumerate().map(|(index, placement)| {
            let entity = &self.scene.entities[index];
            let geometry = &self.store.geometries[entity.mesh];
            let world_from_object = camera::world_from_centred(placement, geometry.centre_m);
            let sight = self.sight(&camera, index, placement);
            Item {
                drawable: &geometry.drawable,
                indices: geometry.drawable.seen(self.options.skip.hidden.then_some(&sight)),
                clip_from_object: (camera.clip_from_world * world_from_object).as_mat4(),
                culls: sight.culls(),
                emission: entity.emission,
                radiosity_offset: self.radiosity_offsets[index],
                tag: smooth::tag(index),
            }
        });
        // Near to far, so that little is shaded that something nearer then hides; grids, whose shading costs most, at the end.
        let mut items: Vec<(bool, f64, Item<'_>)> = items
            .zip(placements)
            .enumerate()
            .map(|(index, (item, placement))| {
                let radius_m =
                    self.store.geometries[self.scene.entities[index].mesh].radius_m * f64::from(placement.scale);
                let distance = self.centre(index, placement).distance(camera.eye) - radius_m;
                (item.drawable.is_grid(), distance, item)
            })
            .collect();
        items.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        items.into_iter().map(|(_, _, item)| item).collect()
    }
}
