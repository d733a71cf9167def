//! Regions of a picture, and what the camera may see in each.

use super::Frame;
use crate::asset::edges::Line;
use crate::draw::{DrawnEntity, DrawnPaint, camera, smooth};
use crate::lists::sight::{self, Sight};
use crate::scene::Placement;
use ash::vk;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Which radiosity a viewport shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadiositySource {
    /// The radiosity that the merge has written.
    Merged,
    /// The comparison that [`Frame::set_comparison`] put at that index.
    Comparison(usize),
}

/// A region of the picture. Each shows the whole scene by the same camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Viewport {
    /// Left, top, width and height in pixels.
    pub area: [u32; 4],
    pub radiosity: RadiositySource,
    /// Whether what entities emit is added. It is not where radiosity stands for something else, as the colours of an
    /// error do.
    pub adds_emission: bool,
}

impl Viewport {
    /// A region that shows what the merge lights.
    pub fn merged(area: [u32; 4]) -> Self {
        Viewport { area, radiosity: RadiositySource::Merged, adds_emission: true }
    }

    /// Whether it shows light as it is, so that pixels may add to that of vertices.
    pub(super) fn shows_light(&self) -> bool {
        self.radiosity == RadiositySource::Merged
    }
}

impl Frame {
    pub(super) fn whole(&self) -> Viewport {
        let [width, height] = self.options.size;
        Viewport::merged([0, 0, width, height])
    }

    /// The camera for a viewport of `size` pixels.
    pub(super) fn camera(&self, size: [u32; 2]) -> sight::SightCamera {
        let camera = &self.scene.data.camera;
        let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
        sight::SightCamera {
            clip_from_world: camera::clip_from_world(camera, aspect),
            eye: camera.eye.as_dvec3(),
            near_m: camera::near_corner_m(camera, aspect),
            size,
            samples: self.picture.draw.samples() > 1,
        }
    }

    /// How an entity is seen.
    pub(super) fn sight(&self, camera: &sight::SightCamera, index: usize, placement: &Placement) -> Sight {
        let mesh = self.scene.entities[index].mesh;
        let device_mesh = &self.buffers.meshes[mesh];
        let world_from_object = camera::world_from_centred(placement, device_mesh.centre_m);
        Sight::new(camera, world_from_object, device_mesh.radius_m, self.scene.meshes[mesh].is_solid())
    }

    /// All entities in the order in which they are drawn for a camera.
    pub(super) fn drawn_entities(&self, placements: &[Placement], camera: &sight::SightCamera) -> Vec<DrawnEntity<'_>> {
        let [x, y, w] = [0, 1, 3].map(|row| camera.clip_from_world.row(row).truncate());
        // A mirror turns triangles over.
        let backs = match x.cross(y).dot(w) < 0.0 {
            true => vk::CullModeFlags::FRONT,
            false => vk::CullModeFlags::BACK,
        };
        let drawn = placements.iter().enumerate().map(|(index, placement)| {
            let entity = &self.scene.entities[index];
            let device_mesh = &self.buffers.meshes[entity.mesh];
            let surface = self.buffers.surface(index);
            let world_from_object = camera::world_from_centred(placement, device_mesh.centre_m);
            let sight = self.sight(camera, index, placement);
            let drawn = DrawnEntity {
                mesh: &surface.drawn,
                indices: surface.drawn.seen(self.options.skip.hidden.then_some(&sight)),
                clip_from_object: (camera.clip_from_world * world_from_object).as_mat4(),
                culls: match sight.culls() || self.scene.meshes[entity.mesh].is_two_sided() {
                    true => backs,
                    false => vk::CullModeFlags::NONE,
                },
                emission: entity.emission,
                radiosity_offset: self.radiosity.offsets[index],
                tag: if entity.transparent { self.scene.opacity(index) } else { smooth::tag(index) },
                transparent: entity.transparent,
                index: index as u32,
                paint: self.paint(index),
                gloss: self.drawn_gloss(entity),
                by_pixel: self.chains.as_ref().and_then(|chains| chains.of(index)),
            };
            let farthest_m = self.centre(index, placement).distance(camera.eye) + self.radius_m(index, placement);
            let place = match entity.transparent {
                true => (2, -self.box_distance_m(entity.mesh, placement, camera.eye)),
                false => (u8::from(drawn.mesh.grid().is_some()), farthest_m),
            };
            (place.0, place.1, drawn)
        });
        // From near to far by their far sides, so that few fragments are shaded that something nearer hides later: a room and
        // the ground come behind what stands in them. Grids come later: a fragment of a grid costs most. What is transparent
        // comes last, from far to near.
        let mut drawn: Vec<(u8, f64, DrawnEntity<'_>)> = drawn.collect();
        drawn.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        drawn.into_iter().map(|(_, _, entity)| entity).collect()
    }

    /// How far a point is from the box around an entity: what of two panes lies in front is nearer, however large.
    fn box_distance_m(&self, mesh: usize, placement: &Placement, point: DVec3) -> f64 {
        let [low, high] = self.buffers.meshes[mesh].extent_m;
        let own = placement.local(point);
        f64::from(placement.scale) * own.distance(own.clamp(low, high))
    }

    /// What varies the reflectance of an entity. Its vertices are lit by the mean.
    pub(super) fn paint(&self, index: usize) -> Option<DrawnPaint<'_>> {
        let texture = self.scene.paint(index)?;
        let entity = &self.scene.entities[index];
        let opacity = self.scene.opacity(index);
        let over_mean = |factor: f32, mean: f32| if mean > 0.0 { opacity * factor / mean } else { 0.0 };
        Some(DrawnPaint {
            texture: &self.buffers.textures[entity.texture?],
            tint: Vec3::from_array(std::array::from_fn(|c| over_mean(texture.factor[c], entity.albedo[c]))),
            alpha_cutoff: texture.alpha_cutoff.unwrap_or(0.0),
        })
    }

    /// Entities in the order in which a viewport draws them, without emission and paint where it shows none.
    pub(super) fn drawn_in(&self, placements: &[Placement], viewport: &Viewport) -> Vec<DrawnEntity<'_>> {
        let mut drawn = self.drawn_entities(placements, &self.camera([viewport.area[2], viewport.area[3]]));
        if !viewport.adds_emission {
            for entity in &mut drawn {
                entity.emission = Vec3::ZERO;
                entity.paint = None;
                entity.gloss = None;
            }
        }
        drawn
    }

    /// Outlines and creases of all entities as the camera sees them, and the tag of each.
    pub(super) fn outlines(&self, placements: &[Placement], aspect: f64) -> Vec<(Line, f32)> {
        let camera = &self.scene.data.camera;
        let clip_from_world = camera::clip_from_world(camera, aspect);
        let lines = placements.par_iter().enumerate().flat_map_iter(|(index, placement)| {
            // Alpha has the tag of what is seen through a transparent one.
            if self.scene.entities[index].transparent {
                return Vec::new();
            }
            let mesh = self.scene.entities[index].mesh;
            let world = camera::world_from_centred(placement, self.buffers.meshes[mesh].centre_m);
            let eye = world.inverse().transform_point3(camera.eye.as_dvec3());
            let lines = self.picture.edges[mesh].lines(clip_from_world * world, eye, true);
            lines.into_iter().map(move |line| (line, smooth::tag(index))).collect()
        });
        lines.collect()
    }
}
