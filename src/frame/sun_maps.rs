//! The maps of suns, for pixels that evaluate lights.

use super::Frame;
use crate::bake::surfaces::{CrispSun, crisp_suns};
use crate::draw::camera;
use crate::draw::sun_map::{MOST_MAPS, MapCaster, SunMaps};
use crate::error::Result;
use crate::scene::{Placement, Scene};
use glam::DVec3;

/// Share of a sheet's longer side that something may reach below it.
const BELOW: f64 = 1e-3;

/// Whether an entity stands in maps.
fn is_mapped(scene: &Scene, entity: usize) -> bool {
    scene.entities[entity].occludes && scene.rests_opaque(entity)
}

/// Whether a scene has suns that have maps, and anything that these hold.
pub(super) fn has_maps(scene: &Scene) -> bool {
    crisp_suns(scene).next().is_some() && (0..scene.entities.len()).any(|entity| is_mapped(scene, entity))
}

/// A sun of which vertices tell whether it is hidden.
pub(super) struct ToldSun {
    pub entity: usize,
    /// Where it stood when that was baked.
    pub stood: Placement,
    pub sun: CrispSun,
}

impl Frame {
    /// Draws the maps once any pixels evaluate lights.
    pub(super) fn fit_sun_maps(&mut self) -> Result<()> {
        let wanted = self.sharp.as_ref().is_some_and(|sharp| sharp.permutation.sun_maps) && self.wants_edges();
        if !wanted || self.sun_maps.is_some() {
            return Ok(());
        }
        let suns: Vec<CrispSun> = self.told_suns.iter().map(|told| told.sun).take(MOST_MAPS).collect();
        let maps = SunMaps::new(&self.device, &self.library, &suns, &self.casters())?;
        let [width, height] = [maps.heights.shape.width, maps.heights.shape.height];
        log::debug!("maps of {} suns: {width} x {height} texels", suns.len());
        self.sun_maps = Some(maps);
        Ok(())
    }

    /// What may cast shadows on anything: all that rests but the ground.
    fn casters(&self) -> Vec<MapCaster<'_>> {
        let mapped: Vec<&(usize, Placement)> =
            self.stood.iter().filter(|(index, _)| is_mapped(&self.scene, *index)).collect();
        let caster = |(index, placement): &(usize, Placement)| {
            let device_mesh = &self.buffers.meshes[self.scene.entities[*index].mesh];
            let corner = |k: usize| {
                let side = |axis: usize| device_mesh.extent_m[k >> axis & 1][axis];
                placement.point(DVec3::new(side(0), side(1), side(2)))
            };
            MapCaster {
                mesh: &self.buffers.surface(*index).drawn,
                world_from_object: camera::world_from_centred(placement, device_mesh.centre_m),
                corners: std::array::from_fn(corner),
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
            let mut grounds = grounds.into_iter();
            casters.retain(|_| grounds.next() == Some(false));
        }
        casters
    }

    /// Of every entity the bits of its maps, while all that rested when they were drawn still does.
    pub(super) fn sun_map_bits(&self, placements: &[Placement]) -> Vec<u32> {
        let mut bits = vec![0; self.scene.entities.len()];
        if self.sun_maps.is_none() || !self.has_rested(placements) {
            return bits;
        }
        let mut all = 0;
        for (place, told) in self.told_suns.iter().take(MOST_MAPS).enumerate() {
            if placements[told.entity] == told.stood {
                bits[told.entity] = 1 << place;
                all |= 1 << place;
            }
        }
        (0..bits.len()).filter(|&entity| is_mapped(&self.scene, entity)).for_each(|entity| bits[entity] |= all);
        bits
    }
}
