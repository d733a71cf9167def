//! A scene at one time, prepared for ray casting.

use super::Vertex;
use super::ray_mesh::{RayMesh, RayMeshes};
use super::sequence::Axes;
use crate::asset::texture::Texture;
use crate::bake::TRANSFER_OFFSET;
use crate::field::lattice::cap_height;
use crate::field::sheet;
use crate::scene::{Gloss, Placement, Scene};
use glam::{DMat3, DVec3, Mat3A, Vec3A};
use std::sync::Arc;

/// Holes that a ray passes at most.
const MOST_HOLES: usize = 32;

pub struct PlacedEntity {
    pub mesh: Arc<RayMesh>,
    /// Centre of the bounding sphere, metres.
    pub centre: DVec3,
    pub radius_m: f64,
    pub rotation: glam::DQuat,
    to_object: Mat3A,
}

/// A scene at one time.
pub struct World<'s> {
    /// The scene without placements.
    pub scene: &'s Scene,
    pub entities: Vec<PlacedEntity>,
    /// Entities that occlude.
    pub occluders: Vec<usize>,
    /// Entities that emit.
    pub lights: Vec<usize>,
}

/// A vertex from which the world is seen.
#[derive(Clone, Copy)]
pub struct VertexView {
    pub position: DVec3,
    pub normal: DVec3,
    /// Its own entity as seen from just off its surface; `None` if it cannot shadow itself.
    pub own: Option<EntityView>,
    entity: usize,
}

/// An entity as seen from a point: everything that all rays from there share.
#[derive(Clone, Copy)]
pub struct EntityView {
    pub entity: usize,
    /// Distance of the sphere's centre, metres.
    pub distance_m: f64,
    radius_m: f64,
    /// Vector to the sphere's centre, in bounding radii.
    toward: Vec3A,
    beyond: f32,
    origin: Vec3A,
    to_object: Mat3A,
}

/// The cone around an entity's bounding sphere.
#[derive(Clone, Copy)]
pub struct BoundingCone {
    /// Frame whose third axis is the cone's axis.
    pub axes: Axes,
    /// 1 - cosine of its half angle; 2 (all directions) from inside the sphere.
    pub height: f64,
}

impl<'s> World<'s> {
    /// The scene with its entities at `placements`, prepared for rays, which takes milliseconds per mesh.
    pub fn of(scene: &'s Scene, placements: &[Placement]) -> Self {
        Self::new(scene, &RayMeshes::new(scene), placements)
    }

    /// The same of meshes that are prepared.
    pub fn new(scene: &'s Scene, meshes: &RayMeshes, placements: &[Placement]) -> Self {
        let placed = |(entity, placement): (&crate::scene::Entity, &Placement)| {
            let (centre, radius_m) = placement.sphere(scene.meshes[entity.mesh].bounding_sphere());
            let rotation = placement.turn();
            PlacedEntity {
                mesh: meshes.0[entity.mesh].clone(),
                centre,
                radius_m,
                rotation,
                to_object: Mat3A::from(DMat3::from_quat(rotation.inverse()).as_mat3()),
            }
        };
        let having = |switch: &dyn Fn(&crate::scene::Entity) -> bool| {
            (0..scene.entities.len()).filter(|&j| switch(&scene.entities[j])).collect()
        };
        World {
            scene,
            entities: scene.entities.iter().zip(placements).map(placed).collect(),
            occluders: having(&|e| e.occludes),
            lights: having(&|e| e.emits),
        }
    }

    pub fn view(&self, vertex: Vertex) -> VertexView {
        let mesh = self.scene.surface(vertex.entity);
        let (centre, radius_m) = mesh.bounding_sphere();
        let local = (mesh.positions[vertex.index].as_dvec3() - centre.as_dvec3()) / f64::from(radius_m);
        self.surface(vertex.entity, local, mesh.normals[vertex.index].as_dvec3())
    }

    /// The view from a point of an entity's surface, given in bounding radii from the centre of its mesh, with the
    /// normal there.
    pub fn surface(&self, entity: usize, local: DVec3, normal: DVec3) -> VertexView {
        let placed = &self.entities[entity];
        let place = |local: DVec3| placed.centre + placed.rotation * (local * placed.radius_m);
        let own = placed.mesh.self_shadowing.then(|| {
            let eye = local + f64::from(TRANSFER_OFFSET) * normal;
            EntityView { origin: eye.as_vec3a(), ..self.sight(entity, place(eye)) }
        });
        VertexView { position: place(local), normal: (placed.rotation * normal).normalize(), own, entity }
    }

    /// The entity as seen from a point.
    pub fn sight(&self, entity: usize, from: DVec3) -> EntityView {
        let placed = &self.entities[entity];
        let toward = (placed.centre - from) / placed.radius_m;
        EntityView {
            entity,
            distance_m: placed.centre.distance(from),
            radius_m: placed.radius_m,
            toward: toward.as_vec3a(),
            beyond: (toward.length_squared() - 1.0) as f32,
            origin: placed.to_object * (-toward).as_vec3a(),
            to_object: placed.to_object,
        }
    }

    /// Every occluder of a vertex but its own entity, in the order of indices.
    pub fn occluders(&self, view: &VertexView) -> Vec<EntityView> {
        let others = self.occluders.iter().filter(|&&j| j != view.entity);
        others.map(|&j| self.sight(j, self.beside(j, view))).collect()
    }

    /// Where a vertex sees an occluder from: its own place, off the plane of a sheet ([`sheet::height_over`]).
    fn beside(&self, occluder: usize, view: &VertexView) -> DVec3 {
        let placed = &self.entities[occluder];
        let Some(normal) = placed.mesh.normal else { return view.position };
        let normal = placed.rotation * normal;
        let receiver = &self.entities[view.entity];
        let height = normal.dot(view.position - placed.centre);
        let of_centre = normal.dot(receiver.centre - placed.centre);
        let contact = sheet::CONTACT * receiver.radius_m;
        view.position + normal * (sheet::height_over(height, of_centre, normal.dot(view.normal), contact) - height)
    }

    /// Every light of a vertex but its own entity.
    pub fn lights(&self, view: &VertexView) -> Vec<EntityView> {
        let others = self.lights.iter().filter(|&&j| j != view.entity);
        others.map(|&j| self.sight(j, view.position)).collect()
    }

    /// Whether the entity blocks a ray (unit direction) nearer than `limit_m` metres; infinity is no limit.
    pub fn blocks(&self, sight: &EntityView, direction: DVec3, limit_m: f64) -> bool {
        let direction = direction.as_vec3a();
        let placed = &self.entities[sight.entity];
        let limit = (limit_m / placed.radius_m) as f32;
        let is_within = |radius: f32| sight.entry(direction, radius).is_some_and(|inner| inner > 0.0 && inner < limit);
        !self.lets_through(sight.entity, direction)
            && sight.entry(direction, 1.0).is_some_and(|sphere| sphere < limit)
            && ((self.scene.mask(sight.entity).is_none() && is_within(placed.mesh.inner_radius))
                || self.surface_blocks(sight, direction, limit))
    }

    /// Whether a ray meets the entity's surface, where that is no hole, nearer than `limit` bounding radii.
    fn surface_blocks(&self, sight: &EntityView, direction: Vec3A, limit: f32) -> bool {
        let direction = sight.to_object * direction;
        if self.scene.mask(sight.entity).is_some() {
            let met = self.corners_hit(sight.entity, sight.origin, direction);
            return met.is_some_and(|(distance, ..)| distance < limit);
        }
        self.entities[sight.entity].mesh.blocks(sight.origin, direction, limit)
    }

    /// Whether the receiver's own mesh blocks a ray (unit direction) nearer than `limit_m` metres.
    pub fn blocks_itself(&self, view: &VertexView, direction: DVec3, limit_m: f64) -> bool {
        view.own.as_ref().is_some_and(|own| {
            let limit = (limit_m / own.radius_m) as f32;
            !self.scene.entities[own.entity].transparent && self.surface_blocks(own, direction.as_vec3a(), limit)
        })
    }

    /// Whether a ray is one of those that a transparent entity lets through. A hash of its direction decides: of many
    /// rays, their share.
    fn lets_through(&self, entity: usize, direction: Vec3A) -> bool {
        let of = &self.scene.entities[entity];
        let bits = direction.to_array().map(|c| u64::from(c.to_bits()));
        let seed = bits[0] ^ bits[1] << 20 ^ bits[2] << 40 ^ (entity as u64) << 52;
        of.transparent && fastrand::Rng::with_seed(seed).f32() >= of.opacity
    }

    /// The first place of an entity, no hole, that a ray of its own frame meets: the distance, the triangle and the
    /// weights of its corners.
    fn corners_hit(&self, entity: usize, origin: Vec3A, direction: Vec3A) -> Option<(f32, usize, [f32; 3])> {
        let shape = &self.entities[entity].mesh;
        let mesh = &self.scene.meshes[self.scene.entities[entity].mesh];
        let mask = self.scene.mask(entity);
        let mut passed = 0.0;
        for _ in 0..MOST_HOLES {
            let (distance, triangle, weights) = shape.corners_hit(origin + passed * direction, direction)?;
            let is_hole = |mask: &Arc<Texture>| mask.opacity_at(mesh, mesh.triangles[triangle], weights) < 0.5;
            if !mask.is_some_and(is_hole) {
                return Some((passed + distance, triangle, weights));
            }
            passed += distance + 1e-5;
        }
        None
    }

    /// The surface where a ray (unit direction) meets the entity first; `None` if it misses.
    pub fn surface_hit(&self, sight: &EntityView, direction: DVec3) -> Option<SurfaceHit> {
        let direction = sight.to_object * direction.as_vec3a();
        let (distance, triangle, weights) = self.corners_hit(sight.entity, sight.origin, direction)?;
        let mesh = &self.scene.meshes[self.scene.entities[sight.entity].mesh];
        let corners = mesh.triangles[triangle];
        let normal: DVec3 =
            corners.iter().zip(weights).map(|(i, w)| mesh.normals[*i as usize].as_dvec3() * f64::from(w)).sum();
        // Backs that are triangles too lie where the fronts do: a ray meets the side that faces it.
        let turn = if mesh.is_two_sided() && normal.dot(direction.as_dvec3()) > 0.0 { -1.0 } else { 1.0 };
        let normal = turn * normal.normalize_or(DVec3::Y);
        let (gloss, tilted) = self.scene.gloss_at(sight.entity, corners, weights, normal.as_vec3());
        Some(SurfaceHit {
            place: (sight.origin + distance * direction).as_dvec3(),
            normal,
            over_mean: self.scene.over_mean(sight.entity, corners, weights).as_dvec3(),
            glow: self.scene.glow_at(sight.entity, corners, weights).as_dvec3(),
            gloss,
            tilted: tilted.as_dvec3(),
            opacity: f64::from(self.scene.opacity_at(sight.entity, corners, weights)),
        })
    }

    /// The first surface that a ray (unit direction) from a point of a surface meets, of entities that occlude and of lamps
    /// that reflect, whose own light is counted as direct light; `None` also past what reflects nothing: a transparent
    /// entity, which keeps its share of rays back, and other lamps.
    pub fn first_surface(&self, view: &VertexView, direction: DVec3) -> Option<(usize, SurfaceHit)> {
        let entities = &self.scene.entities;
        let lamps = self.lights(view).into_iter().filter(|lamp| !entities[lamp.entity].occludes);
        let met = self.occluders(view).into_iter().chain(view.own).chain(lamps);
        let may_meet = |sight: &EntityView| sight.entry(direction.as_vec3a(), 1.0).is_some();
        let reflects = |sight: &EntityView| {
            let of = &entities[sight.entity];
            !of.transparent && (of.occludes || of.receives)
        };
        let (others, dark): (Vec<_>, Vec<_>) = met.filter(may_meet).partition(reflects);
        let hits = others.iter().filter_map(|sight| Some((sight, self.first_hit_m(sight, direction)?)));
        let (sight, limit_m) = hits.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let is_kept_back = dark.iter().any(|sight| self.blocks(sight, direction, limit_m));
        if is_kept_back { None } else { Some((sight.entity, self.surface_hit(sight, direction)?)) }
    }

    /// Distance in metres at which a ray (unit direction) meets the entity first; `None` if it misses.
    pub fn first_hit_m(&self, sight: &EntityView, direction: DVec3) -> Option<f64> {
        let placed = &self.entities[sight.entity];
        let direction = sight.to_object * direction.as_vec3a();
        let found = match self.scene.mask(sight.entity) {
            Some(_) => self.corners_hit(sight.entity, sight.origin, direction)?.0,
            None => placed.mesh.first_hit(sight.origin, direction)?,
        };
        Some(f64::from(found) * placed.radius_m)
    }

    /// Emission of a light at a point, without its pattern: less where the point is off the axis of a spot.
    pub fn emission_at(&self, light: usize, point: DVec3) -> DVec3 {
        let entity = &self.scene.entities[light];
        let placed = &self.entities[light];
        let share = entity.spot.map_or(1.0, |spot| spot.share(placed.rotation, placed.centre - point));
        entity.emission.as_dvec3() * share
    }

    /// Emission pattern of an entity along a ray, without the entity's emission factor; `None` if the ray misses.
    pub fn emission(&self, sight: &EntityView, direction: DVec3) -> Option<DVec3> {
        let direction = direction.as_vec3a();
        sight.entry(direction, 1.0)?;
        let mesh = &self.entities[sight.entity].mesh;
        if mesh.is_plain() && sight.entry(direction, mesh.inner_radius).is_some_and(|inner| inner > 0.0) {
            return Some(DVec3::ONE);
        }
        mesh.emission(sight.origin, sight.to_object * direction).map(|color| color.as_dvec3())
    }
}

/// A place of a surface that a ray meets.
pub struct SurfaceHit {
    /// In bounding radii from the centre of the mesh.
    pub place: DVec3,
    /// As smooth shading interpolates it.
    pub normal: DVec3,
    /// Reflectance over the mean of the entity's, by colour.
    pub over_mean: DVec3,
    /// Emission over the entity's.
    pub glow: DVec3,
    /// How it reflects besides diffusely.
    pub gloss: Option<Gloss>,
    /// The normal as a map tilts it.
    pub tilted: DVec3,
    /// Share of light that it keeps back.
    pub opacity: f64,
}

impl EntityView {
    /// Distances in metres between which all of the entity lies: those of its bounding sphere, of which the first is
    /// negative within it.
    pub fn range_m(&self) -> [f64; 2] {
        [self.distance_m - self.radius_m, self.distance_m + self.radius_m]
    }

    /// Whether a part of the bounding sphere lies above the plane through the point with this normal.
    pub fn rises_above(&self, normal: DVec3) -> bool {
        self.toward.as_dvec3().dot(normal) > -1.0
    }

    /// The cone around the bounding sphere.
    pub fn cone(&self) -> BoundingCone {
        let toward = self.toward.as_dvec3();
        match toward.try_normalize() {
            Some(axis) if self.beyond > 0.0 => {
                BoundingCone { axes: Axes::new(axis), height: cap_height(toward.length()) }
            }
            _ => BoundingCone { axes: Axes::new(DVec3::Z), height: 2.0 },
        }
    }

    /// Whether the cones around two bounding spheres have a direction in common.
    pub fn overlaps(&self, other: &EntityView) -> bool {
        if self.beyond <= 0.0 || other.beyond <= 0.0 {
            return true;
        }
        // The cosine of the angle between their axes against that of the sum of their half-angles, whose sines are the
        // inverses of the distances, times both distances.
        let [a, b] = [self, other].map(|sight| sight.toward.as_dvec3());
        let cosines = (a.length_squared() - 1.0) * (b.length_squared() - 1.0);
        a.dot(b) > cosines.max(0.0).sqrt() - 1.0
    }

    /// Distance (in bounding radii) at which a ray enters a sphere of that radius (in bounding radii) around the
    /// centre: 0 or less from within the sphere, `None` if it misses. What lies around a sphere within a convex mesh is
    /// met before that.
    fn entry(&self, direction: Vec3A, radius: f32) -> Option<f32> {
        let along = self.toward.dot(direction);
        // Half the chord, squared. The distance from the axis is taken from the vector, because far away the difference
        // of two squares keeps no digits.
        let half = radius * radius - (self.toward - along * direction).length_squared();
        let within = self.beyond + 1.0 <= radius * radius;
        (within || (along > 0.0 && half > 0.0)).then(|| if within { 0.0 } else { along - half.sqrt() })
    }
}
