//! Chains of sharp lights for the pixels of grids: every cluster's, merged in this frame or not.

use crate::draw::DrawnMesh;
use crate::error::Result;
use crate::gpu::{Device, Upload};
use crate::layout::{self, CLUSTER_VERTICES};
use crate::lists::gather::EntityBounds;
use crate::lists::incremental::{ClusterLists, State};
use crate::scene::Scene;
use crate::scene_buffers::SceneBuffers;
use std::sync::Arc;

/// What pixels read that evaluate sharp lights.
pub(super) struct PixelChains {
    /// Entities at the moment of the picture.
    pub entities: Upload,
    /// Entries of all chains.
    pub entries: Upload,
    /// Of every cluster of every grid the first of its entries, and how many they are.
    pub chains: Upload,
    /// Of every entity that is lit and drawn as a grid: its first cluster there, and how far the pixels of a cluster may lie from its
    /// vertices, metres.
    grids: Vec<Option<(u32, f32)>>,
    /// Entities as they were when the chains were made, and their bounds with what each of them takes part in.
    known: Option<(Vec<layout::Entity>, Vec<EntityBounds>)>,
}

impl PixelChains {
    /// For the grids of a scene.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn new(device: &Arc<Device>, scene: &Scene, buffers: &SceneBuffers) -> Result<Self> {
        let mut clusters = 0;
        let mut grids = Vec::with_capacity(scene.entities.len());
        for entity in &scene.entities {
            let device_mesh = &buffers.meshes[entity.mesh];
            grids.push(match &device_mesh.drawn {
                DrawnMesh::Grid(grid, _) if entity.receives => {
                    let first = clusters;
                    clusters += (device_mesh.vertices.len() as u32).div_ceil(CLUSTER_VERTICES);
                    Some((first, grid.reach_m))
                }
                _ => None,
            });
        }
        let upload = |name: &str, bytes: usize| Upload::new(device, name, bytes as u64);
        Ok(PixelChains {
            entities: upload("pixel entities", scene.entities.len() * size_of::<layout::Entity>())?,
            entries: upload("pixel entries", 16)?,
            chains: upload("pixel chains", 8 * clusters.max(1) as usize)?,
            grids,
            known: None,
        })
    }

    /// The first cluster of an entity among the chains, if its pixels evaluate lights.
    pub fn cluster_first(&self, entity: usize) -> Option<u32> {
        self.grids[entity].map(|(first, _)| first)
    }

    /// Whether chains have been made.
    pub fn is_ready(&self) -> bool {
        self.known.is_some()
    }

    /// Makes the chains of this moment.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn prepare(&mut self, lists: &ClusterLists) -> Result<()> {
        let State { entities, scene_bounds, .. } = lists.now();
        let is_known = self.known.as_ref().is_some_and(|(known, bounds)| {
            bytemuck::cast_slice::<_, u8>(known) == bytemuck::cast_slice::<_, u8>(entities)
                && *bounds == scene_bounds.entities
        });
        if is_known {
            return Ok(());
        }
        let (mut entries, mut chains) = (Vec::new(), Vec::new());
        for (receiver, reach_m) in self.grids.iter().enumerate().filter_map(|(i, grid)| Some((i, (*grid)?.1))) {
            let (places, listed) = lists.sharp_chains(receiver, reach_m);
            chains.extend(places.iter().map(|[first, count]| [first + entries.len() as u32, *count]));
            entries.extend(listed);
        }
        // A view may not be empty.
        entries.resize(entries.len().max(4), 0_u32);
        chains.resize(chains.len().max(2), [0; 2]);
        self.entities.write(entities)?;
        self.entries.write(&entries)?;
        self.chains.write(&chains)?;
        self.known = Some((entities.clone(), scene_bounds.entities.clone()));
        Ok(())
    }

    /// Bytes on the device.
    pub fn size_bytes(&self) -> u64 {
        self.entities.all_bytes() + self.entries.all_bytes() + self.chains.all_bytes()
    }
}
