//! The buffers of the gather on the device. Where a list does not fit, nothing is merged by a part of it: the next frame merges again
//! with more room, or with lists that the host makes.

use crate::error::Result;
use crate::gpu::{Buffer, BufferKind, Commands, Device, FLIGHTS, Upload};
use crate::lists::gather::{Gather, GatherInputs, Packed, Report};
use crate::lists::incremental::{ClusterLists, Dirty};
use crate::shaders::Library;
use std::sync::Arc;

/// Room of a list at first, in entries; less where a list cannot become so long.
const FIRST_CAPACITY: u64 = 64;
/// Largest size of all lists in bytes. Beyond it the host makes them, packed without room to spare.
const MOST_BYTES: u64 = 1 << 28;

/// Everything that the pass needs from frame to frame.
pub(crate) struct Gathering {
    device: Arc<Device>,
    pass: Gather,
    bounds: Buffer,
    scene_quads: Upload,
    groups: Upload,
    report: Upload,
    /// Entries of all clusters.
    entries: Buffer,
    /// Room of every list, in entries.
    capacity: u64,
    /// Whether the lists would take more than [`MOST_BYTES`] or be longer than the pass can walk, so that the host makes them from now on.
    refused: bool,
    /// The work of the frame in preparation.
    packed: Option<(Packed, u32, u32)>,
    /// Number of prepared frames, and for each report the frame in which it was begun.
    frames: u64,
    begun: [Option<u64>; FLIGHTS],
}

impl Gathering {
    /// Buffers for all clusters of a scene with that number of entities.
    ///
    /// # Errors
    /// As [`Gather::new`] and [`Buffer::new`].
    pub fn new(device: &Arc<Device>, library: &Library, lists: &ClusterLists, entity_count: usize) -> Result<Self> {
        let upload = |name: &str, bytes: u64| Upload::new(device, name, bytes);
        Ok(Gathering {
            device: device.clone(),
            pass: Gather::new(device, library, device.info.is_software(), entity_count)?,
            bounds: Buffer::with_data(device, "bounds", &lists.all_bounds())?,
            scene_quads: upload("scene_quads", 16)?,
            groups: upload("groups", 16)?,
            report: upload("report", size_of::<Report>() as u64)?,
            entries: Buffer::new(device, "lists", BufferKind::Device, 4)?,
            capacity: FIRST_CAPACITY,
            refused: false,
            packed: None,
            frames: 0,
            begun: [None; FLIGHTS],
        })
    }

    /// Prepares to gather for clusters at the last update's time, and returns them; `None` where the host has to.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn prepare(&mut self, lists: &ClusterLists, dirty: &[Dirty]) -> Result<Option<Vec<crate::layout::Cluster>>> {
        self.packed = None;
        if self.refused {
            return Ok(None);
        }
        let packed = Packed::new(&lists.now().scene_bounds);
        let (clusters, groups) = lists.groups(dirty);
        let capacity = self.capacity.min(packed.longest()).max(1);
        let bytes = 4 * capacity * clusters.len() as u64;
        if bytes > MOST_BYTES.min(self.device.limits.max_storage_buffer_range.into()) {
            log::info!("lists on the device would take {bytes} bytes; the host makes them");
            self.refused = true;
            return Ok(None);
        }
        if bytes > self.entries.size_bytes {
            self.entries = Buffer::new(&self.device, "lists", BufferKind::Device, bytes)?;
        }
        self.scene_quads.write(&packed.quads)?;
        self.groups.write(&groups)?;
        self.report.write(&[Report::default()])?;
        self.begun[self.report.place()] = Some(self.frames);
        self.packed = Some((packed, capacity as u32, groups.len() as u32));
        Ok(Some(clusters))
    }

    /// The entries, where the frame in preparation gathers.
    pub fn entries(&self) -> Option<&Buffer> {
        self.packed.as_ref().map(|_| &self.entries)
    }

    /// Records the pass for a frame that gathers. The merge then reads the lists, and the host the report.
    ///
    /// # Errors
    /// As [`Gather::record`].
    pub fn record<'f>(&'f self, commands: &mut Commands<'f>, entities: &'f Buffer, clusters: &'f Buffer) -> Result<()> {
        let Some((packed, capacity, group_count)) = &self.packed else { return Ok(()) };
        let inputs = GatherInputs {
            scene_quads: &self.scene_quads,
            entities,
            bounds: &self.bounds,
            groups: &self.groups,
            clusters,
            entries: &self.entries,
            report: &self.report,
        };
        self.pass.record(commands, &inputs, packed, *capacity, *group_count)
    }

    /// Goes on to the next frame of a window, and reads the report of the flight before the last one, which has ended.
    pub fn next_frame(&mut self) -> Option<Report> {
        self.frames += 1;
        let ended = |begun: &Option<u64>| begun.is_some_and(|frame| frame + FLIGHTS as u64 <= self.frames);
        let place = self.begun.iter().position(ended)?;
        self.begun[place] = None;
        Some(self.report.at(place).peek(0, 1)[0])
    }

    /// Reads the last frame's report, if it gathered. All submitted work has to have ended.
    pub fn report(&mut self) -> Option<Report> {
        self.packed.as_ref()?;
        self.begun = [None; FLIGHTS];
        Some(self.report.read(0, 1)[0])
    }

    /// Whether lists were lost, after making room for them.
    pub fn lost(&mut self, report: &Report) -> bool {
        if report.longest == u32::MAX {
            log::info!(
                "{} occluders near one place and their lights are more than a pass can go through; the host makes the lists",
                report.most_found
            );
            self.refused = true;
            return true;
        }
        let longest = u64::from(report.longest);
        let short = longest > self.capacity;
        if short {
            self.capacity = longest + longest / 4;
        }
        short
    }

    /// Bytes on the device.
    pub fn size_bytes(&self) -> u64 {
        let uploads = self.scene_quads.all_bytes() + self.groups.all_bytes() + self.report.all_bytes();
        self.bounds.size_bytes + self.entries.size_bytes + self.pass.size_bytes() + uploads
    }
}
