//! The CPU twin of a frame's merge, and what its lists leave off.

use super::lists::State;
use super::store::Geometry;
use super::{Frame, store};
use crate::error::Result;
use crate::field;
use crate::layout::{CLUSTER_VERTICES, STEP_ENTITIES, Step};
use crate::render::gather::{self, Chains, Counts};
use crate::render::reference::{Object, Task};
use crate::scene::{Entity, Placement, Scene};
use glam::DVec3;
use std::collections::{BTreeSet, HashSet};
use std::f64::consts::PI;

impl Frame {
    /// What the lists of all clusters leave off at this moment, and why, and a bound of the light in it: by looking at every
    /// cluster and entity, which no frame does.
    pub fn counts(&self, placements: &[Placement]) -> Counts {
        let entities = || self.scene.entities.iter().filter(|entity| entity.occludes || entity.emits);
        let empty = |entity: &&Entity| self.store.geometries[entity.mesh].is_empty(entity.emits);
        Counts {
            empty: if self.options.skip.empty { entities().filter(empty).count() as u64 } else { 0 },
            unseen: if self.options.skip.unseen {
                entities().filter(|e| !store::is_seen(&self.scene, e)).count() as u64
            } else {
                0
            },
            ..self.lists.counts(&self.state(placements))
        }
    }

    /// Entities that stand on the list of any cluster of a receiver at this moment.
    pub fn listed(&self, placements: &[Placement], receiver: usize) -> BTreeSet<usize> {
        self.lists.entities_on(&self.state(placements), receiver)
    }

    /// The CPU twin of the merge in f64: radiosity of every receiver's vertices, by entity. Reads the fields back.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn reference(&self, placements: &[Placement]) -> Result<Vec<(usize, Vec<[f64; 3]>)>> {
        let mut fields: Vec<[Option<field::ShadowField>; 2]> = Vec::new();
        for geometry in &self.store.geometries {
            let load = |slot: &Option<store::Slot>| slot.as_ref().map(|slot| self.store.field(slot)).transpose();
            fields.push([load(&geometry.blocked)?, load(&geometry.radiance)?]);
        }
        let objects: Vec<Object<'_>> = placements
            .iter()
            .enumerate()
            .map(|(index, placement)| {
                let entity = &self.scene.entities[index];
                let [blocked, radiance] = &fields[entity.mesh];
                let over_pi = entity.albedo.as_dvec3() / PI;
                Object {
                    centre: self.centre(index, placement),
                    rotation: placement.rotation.as_dquat().normalize(),
                    scale: placement.scale.into(),
                    radius_m: self.store.geometries[entity.mesh].radius_m * f64::from(placement.scale),
                    albedo_over_pi: over_pi.to_array(),
                    emission: entity.emission.as_dvec3().to_array(),
                    blocked: blocked.as_ref(),
                    radiance: radiance.as_ref().filter(|_| entity.emits),
                }
            })
            .collect();
        let lights = indices(&self.scene, |e| e.emits);
        let sky = self.scene.environment.coefficients(self.options.bake.bands);
        let state = self.state(placements);
        let mut out = Vec::new();
        for receiver in indices(&self.scene, |e| e.receives) {
            let mesh_index = self.scene.entities[receiver].mesh;
            let mesh = &self.scene.meshes[mesh_index];
            let geometry = &self.store.geometries[mesh_index];
            let positions: Vec<DVec3> = mesh.positions.iter().map(|p| p.as_dvec3() - geometry.centre_m).collect();
            let normals: Vec<DVec3> = mesh.normals.iter().map(|n| n.as_dvec3()).collect();
            let transfer = self.store.transfer(geometry)?;
            // Without a threshold the twin looks at everything, which is what the lists are held against.
            let listed = (self.options.eps > 0.0).then(|| listed(&state, receiver, geometry));
            let leaves = |v: usize, j: usize, light: Option<usize>| {
                let Some((cluster_of, listed)) = &listed else { return false };
                !listed[cluster_of[v]].contains(&(j as u32, light.map_or(STEP_ENTITIES, |l| l as u32)))
            };
            let task = Task {
                objects: &objects,
                receiver,
                occluders: &self.occluders(&state.moment, receiver),
                lights: &lights,
                sky: (!self.scene.environment.is_none()).then_some(&sky),
                positions: &positions,
                normals: &normals,
                transfer: transfer.as_ref().map(|(floats, stride)| (&floats[..], *stride)),
                bands: self.options.bake.bands,
                lookup: self.options.lookup,
                skip: self.options.skip,
                chain: self.options.chain,
                leaves: &leaves,
            };
            out.push((receiver, task.run()));
        }
        Ok(out)
    }
}

/// The cluster of every vertex of a mesh, and what stands on each cluster's list: entity and light, or the sky's number.
type Listed = (Vec<usize>, Vec<HashSet<(u32, u32)>>);

fn listed(state: &State, receiver: usize, geometry: &Geometry) -> Listed {
    let (moment, entity) = (&state.moment, &state.entities[receiver]);
    let mut cluster_of = vec![0; geometry.order.len()];
    for (place, &v) in geometry.order.iter().enumerate() {
        cluster_of[v as usize] = place / CLUSTER_VERTICES as usize;
    }
    let chains = Chains::all(moment, receiver as u32);
    let of_cluster = |bounds| {
        let mut steps = Vec::new();
        gather::reference(moment, entity, bounds, &chains, &mut steps);
        steps.into_iter().map(|step| Step::entities(step).into()).collect()
    };
    (cluster_of, geometry.clusters.iter().map(of_cluster).collect())
}

/// Entities that satisfy a condition.
fn indices(scene: &Scene, condition: impl Fn(&crate::scene::Entity) -> bool) -> Vec<usize> {
    (0..scene.entities.len()).filter(|&i| condition(&scene.entities[i])).collect()
}
