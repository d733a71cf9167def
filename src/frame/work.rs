//! The clusters that the next merge lights, and their lists, which the host or the device makes.

use crate::error::Result;
use crate::gpu::{Buffer, Device, TexelView, Upload};
use crate::layout::{self, CLUSTER_FORMAT, ENTRY_FORMAT};
use crate::lists::gather::Report;
use crate::lists::gathering::Gathering;
use crate::lists::incremental::{ClusterLists, Dirty, Merged, State};
use crate::lists::sight::Sight;
use crate::scene_buffers::limits;
use crate::shaders::Library;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What is kept from frame to frame to tell which clusters have changed, and what a merge reads of them.
pub(super) struct ClusterWork {
    pub lists: ClusterLists,
    /// The pass that makes the lists, where the device makes them.
    gathering: Option<Gathering>,
    pub entities: Upload,
    pub clusters: Upload,
    /// The lists that the host has made.
    entries: Upload,
    /// What the last frame did about its clusters.
    pub merged: Merged,
    /// Whether the merge that was prepared last was recorded too.
    recorded: AtomicBool,
}

impl ClusterWork {
    /// For the clusters of a scene. `entity_room` is the number of entities that the merge shader may address.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn new(
        device: &Arc<Device>,
        lists: ClusterLists,
        gathering: Option<Gathering>,
        entity_room: usize,
    ) -> Result<Self> {
        let upload = |name: &str, bytes: usize| Upload::new(device, name, bytes as u64);
        Ok(ClusterWork {
            gathering,
            entities: upload("entities", entity_room * size_of::<layout::DeviceEntity>())?,
            clusters: upload("clusters", lists.clusters.len() * size_of::<layout::Cluster>())?,
            entries: upload("entries", 4 * lists.clusters.len())?,
            merged: Merged::default(),
            recorded: AtomicBool::new(true),
            lists,
        })
    }

    /// Writes what the next merge reads, in buffers of that flight's own. `sights` says how each entity is seen in each viewport
    /// that shows merged light: then only what may be seen has to be lit.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn prepare(&mut self, state: State, sights: Option<&[Vec<Sight>]>) -> Result<()> {
        if !std::mem::replace(self.recorded.get_mut(), false) {
            self.lists.forget();
        }
        // In a window lists may have been too long for their room two frames ago: then every cluster is merged again.
        if let Some(report) = self.gathering.as_mut().and_then(Gathering::next_frame) {
            self.heed(&report);
        }
        let dirty = self.lists.update(state, sights);
        let merged_clusters = dirty.iter().map(Dirty::cluster_count).sum();
        let stale_clusters = self.lists.stale_count();
        self.merged = Merged { clusters: self.lists.clusters.len(), merged_clusters, stale_clusters, ..self.merged };
        if dirty.is_empty() {
            self.merged.merged_entries = 0;
            return Ok(());
        }
        self.entities.write(&self.lists.now().entities)?;
        if let Some(gathering) = &mut self.gathering
            && let Some(clusters) = gathering.prepare(&self.lists, &dirty)?
        {
            return self.clusters.write(&clusters);
        }
        let (clusters, entries) = self.lists.gather(&dirty);
        if self.entries.device().info.is_software() {
            limits::check_entries(clusters.iter().map(|cluster| cluster.entry_count).max().unwrap_or(0))?;
        }
        self.merged.merged_entries = entries.len();
        self.entries.write(&entries)?;
        self.clusters.write(&clusters)
    }

    /// Notes that the merge that was prepared last is being recorded. Returns how many clusters it lights.
    pub fn start(&self) -> u32 {
        self.recorded.store(true, Ordering::Relaxed);
        self.merged.merged_clusters as u32
    }

    /// The pass "gather", where the device makes the lists of the frame in preparation.
    pub fn gathering(&self) -> Option<&Gathering> {
        self.gathering.as_ref().filter(|gathering| gathering.entries().is_some())
    }

    /// The lists of all clusters, as the merge reads them.
    pub fn entries(&self) -> &Buffer {
        self.gathering.as_ref().and_then(Gathering::entries).unwrap_or(&self.entries)
    }

    /// Whether a device's texel views hold the clusters and their lists.
    pub fn fits_views(&self, device: &Device) -> bool {
        TexelView::fits(device, ENTRY_FORMAT, self.entries().size_bytes)
            && TexelView::fits(device, CLUSTER_FORMAT, self.clusters.size_bytes)
    }

    /// Whether every list of the last frame had room, once all that was submitted has ended. If not, the next frame merges every
    /// cluster.
    pub fn all_gathered(&mut self) -> bool {
        if self.merged.merged_clusters == 0 {
            return true;
        }
        let report = self.gathering.as_mut().and_then(Gathering::report);
        !report.is_some_and(|report| self.heed(&report))
    }

    /// Takes in what the pass "gather" has reported. Returns whether lists were lost.
    fn heed(&mut self, report: &Report) -> bool {
        self.merged.merged_entries = report.entry_total as usize;
        let lost = self.gathering.as_mut().is_some_and(|gathering| gathering.lost(report));
        if lost {
            self.lists.forget();
        }
        lost
    }

    /// Builds the pass "gather" anew, where the device makes the lists.
    ///
    /// # Errors
    /// `Failed` when its shader does not compile.
    pub fn rebuild(&mut self, library: &Library, entity_count: usize) -> Result<()> {
        if self.gathering.is_some() {
            self.gathering = Some(Gathering::new(self.entries.device(), library, &self.lists, entity_count)?);
            self.lists.forget();
        }
        Ok(())
    }

    /// Bytes on the device.
    pub fn size_bytes(&self) -> u64 {
        let uploads = [&self.entities, &self.clusters, &self.entries];
        uploads.iter().map(|upload| upload.all_bytes()).sum::<u64>()
            + self.gathering.as_ref().map_or(0, Gathering::size_bytes)
    }
}
