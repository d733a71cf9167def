//! What a frame computes before it is recorded: the clusters that are dirty and their lists, the chains of sharp lights
//! that pixels walk, and the viewports with their outlines. [`Frame::prepare`] is all of it; it writes what the passes
//! read, in buffers of that flight's own.

use super::Frame;
use super::pixel::PixelChains;
use super::viewport::Viewport;
use crate::asset::edges::Edges;
use crate::draw::smooth::Strips;
use crate::error::Result;
use crate::gpu::{Device, TexelView, Upload};
use crate::layout::{self, CLUSTER_FORMAT, ENTRY_FORMAT};
use crate::lists::incremental::{ClusterLists, Merged};
use crate::merge::Merge;
use crate::merge::variant::{MergePermutation, Reads};
use crate::scene::Placement;
use crate::scene_buffers::limits;
use crate::sharp::{Sharp, SharpPermutation};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What is kept from frame to frame to tell which clusters have changed, and what a merge reads of them.
pub(super) struct ClusterWork {
    pub lists: ClusterLists,
    pub entities: Upload,
    pub clusters: Upload,
    /// The lists of these clusters.
    pub entries: Upload,
    /// What the last frame did about its clusters.
    pub merged: Merged,
    /// Whether the merge that was prepared last was recorded too.
    recorded: AtomicBool,
}

impl ClusterWork {
    /// For the clusters of a scene. `entity_room` is the number of entities that the merge shader may address.
    pub fn new(device: &Arc<Device>, lists: ClusterLists, entity_room: usize) -> Result<Self> {
        let upload = |name: &str, bytes: usize| Upload::new(device, name, bytes as u64);
        Ok(ClusterWork {
            entities: upload("entities", entity_room * size_of::<layout::DeviceEntity>())?,
            clusters: upload("clusters", lists.members.len() * size_of::<layout::Cluster>())?,
            entries: upload("entries", 4 * lists.members.len())?,
            merged: Merged::default(),
            recorded: AtomicBool::new(true),
            lists,
        })
    }

    /// Notes that the merge that was prepared last is being recorded. Returns how many clusters it lights.
    pub fn start(&self) -> u32 {
        self.recorded.store(true, Ordering::Relaxed);
        self.merged.merged_clusters as u32
    }
}

impl Frame {
    /// Prepares a frame that draws `viewports`, if there are any. Where it `relights` dirty clusters, the merge has to be
    /// recorded next, or every cluster is merged again.
    pub fn prepare(&mut self, placements: &[Placement], viewports: &[Viewport], relights: bool) -> Result<()> {
        self.picture.mirrors = self.mirrors_of(placements, viewports);
        self.fit_maps()?;
        if relights {
            self.fit_edges()?;
            self.prepare_merge(placements)?;
            self.fit_lists()?;
        }
        if viewports.iter().any(Viewport::shows_light) {
            if !std::mem::replace(&mut self.picture.draw.is_made, true) {
                self.picture.make_pipelines(&self.scene, &self.buffers, self.reflections.is_some())?;
            }
            self.sky.prepare(&self.device, &self.scene)?;
        }
        if !viewports.is_empty() {
            self.prepare_chains()?;
            self.prepare_gloss(placements, viewports)?;
            self.prepare_lines(placements, viewports)?;
        }
        Ok(())
    }

    /// The dirty clusters and their lists.
    fn prepare_merge(&mut self, placements: &[Placement]) -> Result<()> {
        self.buffers.fit_sky(&self.scene, placements)?;
        let state = self.state(placements);
        let work = &mut self.work;
        if !std::mem::replace(work.recorded.get_mut(), false) {
            work.lists.forget();
        }
        let dirty = work.lists.update(state);
        let (clusters, entries) = work.lists.gather(&dirty);
        work.merged = Merged {
            clusters: work.lists.members.len(),
            merged_clusters: dirty.iter().map(|dirty| dirty.clusters.len()).sum(),
            merged_entries: entries.len(),
        };
        if dirty.is_empty() {
            return Ok(());
        }
        if self.device.info.is_software() {
            limits::check_entries(clusters.iter().map(|cluster| cluster.entry_count).max().unwrap_or(0))?;
        }
        self.bounce.as_mut().map_or(Ok(()), |bounce| bounce.prepare(&work.lists))?;
        work.entities.write(&work.lists.now().entities)?;
        work.entries.write(&entries)?;
        work.clusters.write(&clusters)
    }

    /// The chains of the time that was merged last, for pictures whose pixels evaluate sharp lights.
    fn prepare_chains(&mut self) -> Result<()> {
        if !self.picture.draw.evaluates_pixels() || !self.work.lists.is_updated() {
            return Ok(());
        }
        let chains = match &mut self.chains {
            Some(chains) => chains,
            none => none.insert(PixelChains::new(&self.device, &self.scene, &self.buffers, &self.radiosity)?),
        };
        chains.prepare(&self.work.lists)
    }

    /// The viewports of the next picture, and the outlines and creases of each where they are smoothed.
    fn prepare_lines(&mut self, placements: &[Placement], viewports: &[Viewport]) -> Result<()> {
        let smooths = self.picture.draw.smooth.is_some();
        if smooths && self.picture.edges.is_empty() {
            self.picture.edges = self.scene.meshes.iter().map(|mesh| Edges::new(mesh)).collect();
        }
        let mut strips = Strips::default();
        let mut prepared = Vec::with_capacity(viewports.len());
        for viewport in viewports {
            let first = strips.count() as u32;
            let [_, _, width, height] = viewport.area;
            if smooths {
                for (line, tag) in self.outlines(placements, f64::from(width) / f64::from(height.max(1))) {
                    strips.add(&line, [width, height], tag);
                }
            }
            prepared.push((*viewport, first..strips.count() as u32));
        }
        self.picture.prepared = prepared;
        self.picture.lines.write(&strips)
    }

    /// Goes over to storage blocks where texel views cannot hold the clusters and lists that the next merge reads.
    fn fit_lists(&mut self) -> Result<()> {
        if TexelView::fits(&self.device, ENTRY_FORMAT, self.work.entries.size_bytes)
            && TexelView::fits(&self.device, CLUSTER_FORMAT, self.work.clusters.size_bytes)
        {
            return Ok(());
        }
        if let Some(sharp) = self.sharp.as_mut().filter(|sharp| sharp.permutation.reads == Reads::Texels) {
            let permutation = SharpPermutation { reads: Reads::Storage, ..sharp.permutation };
            *sharp = Sharp::new(&self.device, &self.library, permutation)?;
        }
        let permutation = self.merge.permutation;
        if permutation.variant.reads == Reads::Texels {
            let variant = permutation.variant.restricted(false, false);
            log::info!("the lists are too long for texel views; using \"{}\"", variant.name);
            let permutation = MergePermutation { variant, ..permutation };
            self.merge = Merge::new(&self.device, &self.library, permutation)?;
        }
        Ok(())
    }

    /// Has the pass of sharp lights mark the edges of shadows where pixels by now read the marks, and leave them out
    /// where none does. Where they are new, every cluster is merged again.
    fn fit_edges(&mut self) -> Result<()> {
        let edges = self.wants_edges();
        let Some(sharp) = self.sharp.as_mut().filter(|sharp| sharp.permutation.edges != edges) else { return Ok(()) };
        *sharp = Sharp::new(&self.device, &self.library, SharpPermutation { edges, ..sharp.permutation })?;
        if edges {
            self.radiosity.keep_irradiances(&self.scene, &self.methods)?;
            self.forget();
        }
        Ok(())
    }
}
