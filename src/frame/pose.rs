//! What an entity is to the merge at a moment: its place, rotation and light, and the steps of every cluster.

use super::{Frame, store};
use crate::error::Result;
use crate::field::quantity::channel_stride;
use crate::layout::{self, CLUSTER_VERTICES, NONE};
use crate::render::gather::{self, Body, Bounds, Counts, Pose};
use crate::scene::Placement;
use crate::sh::rotation::turns;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

impl Frame {
    /// Writes entities and the clusters' steps of this moment.
    pub(super) fn upload(&mut self, placements: &[Placement]) -> Result<()> {
        let entities: Vec<layout::Entity> =
            placements.iter().enumerate().map(|(index, placement)| self.entity(index, placement)).collect();
        self.entities.write(&entities)?;
        self.gather(placements)
    }

    /// Lists the steps of every cluster at this moment.
    fn gather(&mut self, placements: &[Placement]) -> Result<()> {
        let bodies: Vec<Body> = placements.iter().enumerate().map(|(index, p)| self.body(index, p)).collect();
        let centres: Vec<DVec3> = bodies.iter().map(|b| b.centre).collect();
        let poses: Vec<Pose> = placements
            .iter()
            .enumerate()
            .map(|(entity, placement)| Pose {
                entity,
                centre: bodies[entity].centre,
                rotation: placement.rotation.as_dquat().normalize(),
                scale: placement.scale.into(),
                occluders: if self.scene.entities[entity].receives {
                    self.occluders(&centres, entity)
                } else {
                    Vec::new()
                },
            })
            .collect();
        let (sky, skip) = (!self.scene.environment.is_none(), self.options.skip);
        // Some hundred clusters make a job that is worth handing to another core.
        let parts: Vec<(Vec<u32>, Vec<u32>, Counts)> = self
            .cluster_table
            .par_chunks(256)
            .map(|clusters| {
                let (mut steps, mut lengths, mut counts) = (Vec::new(), Vec::new(), Counts::default());
                for (cluster, bounds) in clusters {
                    let first = steps.len();
                    let pose = &poses[cluster.receiver as usize];
                    counts += gather::steps(bounds, pose, &bodies, sky, skip, &mut steps);
                    lengths.push((steps.len() - first) as u32);
                }
                (steps, lengths, counts)
            })
            .collect();
        self.counts = Counts::default();
        let (mut steps, mut clusters) = (Vec::new(), Vec::with_capacity(self.cluster_table.len()));
        for (part, lengths, counts) in parts {
            self.counts += counts;
            for step_count in lengths {
                let cluster = self.cluster_table[clusters.len()].0;
                let step_first = clusters.last().map_or(0, |c: &layout::Cluster| c.step_first + c.step_count);
                clusters.push(layout::Cluster { step_first, step_count, ..cluster });
            }
            steps.extend(part);
        }
        self.steps.write(&steps)?;
        self.clusters.write(&clusters)
    }

    fn body(&self, index: usize, placement: &Placement) -> Body {
        let entity = &self.scene.entities[index];
        let geometry = &self.store.geometries[entity.mesh];
        Body {
            centre: self.centre(index, placement),
            radius_m: geometry.radius_m * f64::from(placement.scale),
            emits: entity.emits,
            coloured: geometry.radiance.is_some() && entity.emits,
        }
    }

    fn entity(&self, index: usize, placement: &Placement) -> layout::Entity {
        let entity = &self.scene.entities[index];
        let geometry = &self.store.geometries[entity.mesh];
        let rotation = placement.rotation.as_dquat().normalize();
        let [cos_a, sin_a, cos_b, sin_b, cos_c, sin_c] = turns(rotation).map(|x| x as f32);
        let centre = self.centre(index, placement).as_vec3();
        let radius_m = geometry.radius_m * f64::from(placement.scale);
        let emission = match &geometry.radiance {
            Some(slot) if entity.emits => entity.emission * slot.header.radiance_scale,
            _ => entity.emission,
        };
        let slot = geometry.blocked.as_ref().or(geometry.radiance.as_ref());
        // Both fields of a mesh have the same shells.
        let radial = slot.map_or([0.0; 4], |slot| {
            let lattice = slot.header.lattice;
            let (slope, offset) = lattice.radial_map();
            [slope as f32, offset as f32, lattice.inner as f32, lattice.outer as f32]
        });
        layout::Entity {
            centre: centre.extend((1.0 / radius_m) as f32).to_array(),
            alpha_beta: [cos_a, sin_a, cos_b, sin_b],
            gamma: [cos_c, sin_c],
            emission: emission.extend(0.0).to_array(),
            albedo: (entity.albedo.as_dvec3() / PI).as_vec3().extend(placement.scale).to_array(),
            radial,
            blocked_base: geometry.blocked.as_ref().map_or(0, store::Slot::quad),
            radiance_base: geometry.radiance.as_ref().map_or(0, store::Slot::quad),
        }
    }

    /// Centre of an entity's bounding sphere in the world, metres.
    pub(super) fn centre(&self, index: usize, placement: &Placement) -> DVec3 {
        let centre_m = self.store.geometries[self.scene.entities[index].mesh].centre_m;
        let rotation = placement.rotation.as_dquat().normalize();
        placement.position.as_dvec3() + rotation * (centre_m * f64::from(placement.scale))
    }

    /// Occluders of a receiver, near to far from its bounding sphere's centre, ties by index; itself left out. One order for
    /// the whole receiver: products truncated in another order differ (by up to .006 over twelve occluders), which would show
    /// as seams between clusters.
    pub(super) fn occluders(&self, centres: &[DVec3], receiver: usize) -> Vec<usize> {
        let mut order: Vec<(f64, usize)> = (0..centres.len())
            .filter(|&j| self.scene.entities[j].occludes && j != receiver)
            .map(|j| (centres[j].distance(centres[receiver]), j))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.into_iter().map(|(_, j)| j).collect()
    }
}

/// Clusters of one receiver, without steps; `radiosity_first` is its first vertex in the radiosity buffer.
pub(super) fn clusters(
    receiver: usize,
    geometry: &store::Geometry,
    radiosity_first: u64,
    bands: usize,
) -> Vec<(layout::Cluster, Bounds)> {
    let transfer_quads = (channel_stride(bands) / 4) as u32;
    let cluster = |(i, bounds): (usize, &Bounds)| {
        let first = i as u32 * CLUSTER_VERTICES;
        let cluster = layout::Cluster {
            receiver: receiver as u32,
            vertex_first: geometry.vertices.start + first,
            vertex_count: (geometry.vertices.len() as u32 - first).min(CLUSTER_VERTICES),
            transfer_first: match geometry.transfer_first {
                NONE => NONE,
                quad => quad + first * transfer_quads,
            },
            radiosity_first: radiosity_first as u32 + first,
            ..Default::default()
        };
        (cluster, *bounds)
    };
    geometry.clusters.iter().enumerate().map(cluster).collect()
}
