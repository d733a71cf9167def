//! The maps of suns, for pixels that evaluate lights, and of lamps, for vertices too.

use super::Frame;
use crate::bake::surfaces::{CrispSun, crisp_suns};
use crate::draw::camera;
use crate::draw::lamp_map::{LampMaps, MappedLamp};
use crate::draw::sun_map::{MapCaster, SunMaps};
use crate::error::Result;
use crate::field::sub_light::{LampFace, Pattern};
use crate::layout::{MOST_LAMP_MAPS, MOST_SUN_MAPS};
use crate::scene::{Entity, LightMethod, Placement, Scene};
use glam::{DVec2, DVec3, Vec3};

/// Share of a sheet's longer side that something may reach below it.
const BELOW: f64 = 1e-3;

/// Things in maps from which on lamps have them, whatever stands around them: with 126 entities outlines take 0.65 of
/// their time at four lamps, with 797 four times as much at eight.
const MANY_CASTERS: usize = 200;
/// A lamp's fitting has at most so many of its radii. Outlines of what is not convex are wrong so near: light passes them.
const FITTING: f64 = 8.0;
/// How near a lamp convex things come that are not in its map, in its least thickness.
const TOUCHING: f64 = 0.25;

/// The entities that stand in maps. Lamps do not: their outlines hide other lights.
pub(super) fn casters(scene: &Scene) -> Vec<usize> {
    let stands = |&entity: &usize| {
        let Entity { occludes, emits, .. } = scene.entities[entity];
        occludes && !emits && scene.rests_opaque(entity)
    };
    (0..scene.data.entities.len()).filter(stands).collect()
}

/// Whether a scene has suns that have maps, and whether it has lamps that do.
pub(super) fn has_maps(scene: &Scene, methods: &[LightMethod]) -> [bool; 2] {
    let holds = !casters(scene).is_empty();
    [holds && crisp_suns(scene).next().is_some(), holds && !mapped_lamps(scene, methods).is_empty()]
}

/// The lamps that have maps, in the order of their bits: those that rest among many things, or in a fitting that nothing
/// convex joins: a cord through its top would be lit past that.
pub(super) fn mapped_lamps(scene: &Scene, methods: &[LightMethod]) -> Vec<StoodLamp> {
    let has_shape = |entity: usize| matches!(methods[entity], LightMethod::Ball(_) | LightMethod::LampFace(_));
    let mut lamps: Vec<usize> = (0..scene.data.entities.len())
        .filter(|&entity| scene.entities[entity].emits && has_shape(entity) && scene.is_at_rest(entity))
        .collect();
    if lamps.is_empty() {
        return Vec::new();
    }
    let placements = scene.at(0.0);
    let casters = casters(scene);
    let sphere = |entity: usize| placements[entity].sphere(scene.meshes[scene.entities[entity].mesh].bounding_sphere());
    let extents: Vec<[DVec3; 2]> = scene.meshes.iter().map(|mesh| mesh.extent().map(Vec3::as_dvec3)).collect();
    let bounds = |entity: usize| extents[scene.entities[entity].mesh];
    // The place nearest to another in the box around an entity, world.
    let nearest_in = |entity: usize, place: DVec3| {
        let [low, high] = bounds(entity);
        placements[entity].point(placements[entity].local(place).clamp(low, high))
    };
    let thickness_m = |lamp: usize| {
        let [low, high] = bounds(lamp);
        (high - low).min_element() * f64::from(placements[lamp].scale)
    };
    let apart = |lamp: usize| {
        let touches = |&caster: &usize| {
            let place = nearest_in(caster, sphere(lamp).0);
            let is_near = place.distance(nearest_in(lamp, place)) <= TOUCHING * thickness_m(lamp);
            is_near && scene.mask(caster).is_none() && scene.meshes[scene.entities[caster].mesh].is_convex()
        };
        casters.iter().copied().filter(touches).collect::<Vec<_>>()
    };
    let is_fitted = |lamp: usize| {
        let (centre, radius_m) = sphere(lamp);
        let is_around = |&caster: &usize| {
            let is_near = centre.distance(nearest_in(caster, centre)) < 0.5 * thickness_m(lamp);
            let is_small = sphere(caster).1 < FITTING * radius_m;
            is_near && is_small && !scene.meshes[scene.entities[caster].mesh].is_convex()
        };
        casters.iter().any(is_around) && apart(lamp).is_empty()
    };
    lamps.retain(|&lamp| casters.len() >= MANY_CASTERS || is_fitted(lamp));
    lamps.truncate(MOST_LAMP_MAPS);
    lamps.into_iter().map(|entity| StoodLamp { entity, stood: placements[entity], apart: apart(entity) }).collect()
}

/// A lamp that has a map.
pub(super) struct StoodLamp {
    entity: usize,
    /// Where it stood when that was drawn.
    stood: Placement,
    /// Convex things that nearly touch it, as the cord on which it hangs. They hide much of what stands behind them from
    /// its middle, so their outlines hide the lamp and they are not in its map.
    apart: Vec<usize>,
}

/// A sun of which vertices tell whether it is hidden.
pub(super) struct ToldSun {
    pub entity: usize,
    /// Where it stood when that was baked.
    pub stood: Placement,
    pub sun: CrispSun,
}

impl Frame {
    /// Draws the maps of lamps, and those of suns once any pixels evaluate lights.
    pub(super) fn fit_maps(&mut self) -> Result<()> {
        let Some(sharp) = self.sharp.as_ref().map(|sharp| sharp.permutation) else { return Ok(()) };
        let wants_suns = sharp.sun_maps && self.sun_maps.is_none() && self.wants_edges();
        let wants_lamps = sharp.lamp_maps && self.lamp_maps.is_none();
        if !wants_suns && !wants_lamps {
            return Ok(());
        }
        let casters = self.map_casters();
        let suns = || {
            let suns: Vec<CrispSun> = self.told_suns.iter().map(|told| told.sun).take(MOST_SUN_MAPS).collect();
            let maps = SunMaps::new(&self.device, &self.library, &suns, &casters)?;
            let [width, height] = [maps.heights.shape.width, maps.heights.shape.height];
            log::debug!("maps of {} suns: {width} x {height} texels", suns.len());
            Ok(maps)
        };
        let lamps = || {
            let lamps: Vec<MappedLamp> = self.stood_lamps.iter().map(|lamp| self.mapped_lamp(lamp)).collect();
            let maps = LampMaps::new(&self.device, &self.library, &lamps, &casters)?;
            log::debug!("maps of {} lamps: {} bytes", lamps.len(), maps.texels.size_bytes);
            Ok(maps)
        };
        let sun_maps = wants_suns.then(suns).transpose()?;
        let lamp_maps = wants_lamps.then(lamps).transpose()?;
        drop(casters);
        self.sun_maps = sun_maps.or(self.sun_maps.take());
        self.lamp_maps = lamp_maps.or(self.lamp_maps.take());
        Ok(())
    }

    fn mapped_lamp(&self, StoodLamp { entity, stood, apart }: &StoodLamp) -> MappedLamp {
        let radius_m = self.buffers.meshes[self.scene.entities[*entity].mesh].radius_m * f64::from(stood.scale);
        let centre = self.centre(*entity, stood);
        let whole = |nearest_m: f64| MappedLamp { apart: apart.clone(), middles: vec![centre], nearest_m };
        let LightMethod::LampFace(face) = self.light_method(*entity) else { return whole(0.5 * radius_m) };
        let half = radius_m * face.half();
        let flat_m = 0.02 * half.min_element();
        let (axes, nearest_m) = match face {
            LampFace::Disc(_) => return whole(flat_m),
            LampFace::Rectangle(_) | LampFace::Sheet(_) => ([DVec3::X, DVec3::Z], flat_m),
            // Half its thickness, which a corner of the near planes is away.
            LampFace::Tube { axis, thin, .. } => {
                ([DVec3::AXES[axis], DVec3::ZERO], half.y * thin.abs().min(1.0) / 3.0_f64.sqrt())
            }
        };
        let [x, y] = axes.map(|axis| stood.turn() * axis);
        let middle = |place: DVec2| centre + place.x * half.x * x + place.y * half.y * y;
        MappedLamp { middles: Pattern::rectangle(half).places.map(middle).to_vec(), ..whole(nearest_m) }
    }

    /// What stands in maps. The ground hides no sun.
    fn map_casters(&self) -> Vec<MapCaster<'_>> {
        let mapped: Vec<&(usize, Placement)> =
            self.stood.iter().filter(|(index, _)| self.casters.contains(index)).collect();
        let caster = |(index, placement): &(usize, Placement)| {
            let device_mesh = &self.buffers.meshes[self.scene.entities[*index].mesh];
            MapCaster {
                entity: *index,
                hides_suns: true,
                mesh: &self.buffers.surface(*index).drawn,
                world_from_object: camera::world_from_centred(placement, device_mesh.centre_m),
                corners: device_mesh.corners_m().map(|corner| placement.point(corner)),
                paint: self.paint(*index).filter(|paint| paint.alpha_cutoff > 0.0),
            }
        };
        let mut casters: Vec<MapCaster<'_>> = mapped.iter().map(|found| caster(found)).collect();
        let is_ground = |at: usize| {
            let (index, placement) = mapped[at];
            let Some(sheet) = self.sheet(*index, placement) else { return false };
            let [x, y] = sheet.rectangle.axes;
            let [half_x, half_y] = sheet.rectangle.half_m;
            let others = casters.iter().enumerate().filter(|(other, _)| *other != at);
            let mut corners = others.flat_map(|(_, caster)| caster.corners).peekable();
            let normal = x.cross(y);
            let suns: Vec<DVec3> =
                self.told_suns.iter().map(|told| normal * normal.dot(told.sun.toward).signum()).collect();
            let is_above =
                |corner: DVec3| suns.iter().all(|up| up.dot(corner - sheet.centre) > -BELOW * half_x.max(half_y));
            corners.peek().is_some() && corners.all(is_above)
        };
        let grounds: Vec<bool> = (0..casters.len()).map(is_ground).collect();
        if grounds.contains(&false) {
            casters.iter_mut().zip(grounds).for_each(|(caster, is_ground)| caster.hides_suns = !is_ground);
        }
        casters
    }

    /// Of every entity the bits of its maps, while all that rested when they were drawn still does.
    pub(super) fn light_map_bits(&self, placements: &[Placement]) -> Vec<u32> {
        let mut bits = vec![0; self.scene.entities.len()];
        if self.sun_maps.is_none() && self.lamp_maps.is_none() || !self.has_rested(placements) {
            return bits;
        }
        let mut all = 0;
        let suns = self.told_suns.iter().take(MOST_SUN_MAPS).map(|told| (told.entity, &told.stood));
        let lamps = self.stood_lamps.iter().map(|lamp| (lamp.entity, &lamp.stood));
        for (place, (entity, stood)) in (0..).zip(suns).chain((MOST_SUN_MAPS..).zip(lamps)) {
            if placements[entity] == *stood {
                bits[entity] = 1 << place;
                all |= 1 << place;
            }
        }
        let held = self.casters.iter().filter(|&&entity| !self.scene.entities[entity].emits);
        held.for_each(|&entity| bits[entity] = all);
        for (place, lamp) in (MOST_SUN_MAPS..).zip(&self.stood_lamps) {
            lamp.apart.iter().for_each(|&entity| bits[entity] &= !(1 << place));
        }
        bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::scene::data::EntityData;
    use crate::scene::light::Lights;

    /// Lamps with maps where one stands among boxes, or within a ring.
    fn lamps_with_maps(boxes: usize, ring_m: Option<f32>, moves: bool) -> usize {
        let stands = |mesh: &str, x: f32| EntityData { position: Vec3::new(x, 0.0, 0.0), ..EntityData::of_mesh(mesh) };
        let lamp = EntityData { emission: Vec3::ONE, movable: moves, ..stands("lamp", 0.0) };
        let mut scene = Scene::builder()
            .mesh("lamp", generate::sphere(0.1, 2))
            .mesh("box", generate::cuboid(Vec3::splat(0.1), 1))
            .entity(lamp);
        for i in 0..boxes {
            scene = scene.entity(stands("box", 1.0 + i as f32));
        }
        if let Some(size_m) = ring_m {
            scene = scene.mesh("fitting", generate::torus(size_m, 0.05, 16, 8)).entity(stands("fitting", 0.0));
        }
        let scene = scene.build().unwrap();
        mapped_lamps(&scene, &super::super::methods(&scene, Lights::default())).len()
    }

    #[test]
    fn lamps_in_fittings_or_among_many_things_have_maps() {
        assert_eq!(lamps_with_maps(MANY_CASTERS, None, false), 1);
        assert_eq!(lamps_with_maps(MANY_CASTERS - 1, None, false), 0);
        assert_eq!(lamps_with_maps(1, Some(0.3), false), 1);
        assert_eq!(lamps_with_maps(1, Some(0.8), false), 0, "a fitting is no room");
        assert_eq!(lamps_with_maps(MANY_CASTERS, Some(0.3), true), 0, "it moves");
    }
}
