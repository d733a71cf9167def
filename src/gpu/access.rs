//! Kinds of access, the barriers between them, and the tracker that reports a missing barrier.
//!
//! The validation layer of Debian 12 misses a hazard between two dispatches on one storage buffer; the tracker finds
//! it. It knows every use that a recording declares (reflected from the shaders) and every barrier, and checks each
//! pair of overlapping uses of which at least one writes.

use crate::error::{Error, Result};
use ash::vk;
use std::collections::HashMap;
use std::ops::Range;

/// Use of a resource by a pass. A barrier names two: the use before it and the use after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// The host reads mapped memory after the submission.
    HostRead,
    /// Source of a copy.
    TransferRead,
    /// Destination of a copy, fill or clear.
    TransferWrite,
    /// A compute shader reads a storage or uniform block.
    ComputeRead,
    /// A compute shader writes (and may read) a storage block, or stores to an image.
    ComputeWrite,
    /// A compute shader reads a texel buffer or a sampled image.
    ComputeSampled,
    /// The device reads how many workgroups to run.
    Indirect,
    /// A vertex or fragment shader reads an image or a texel buffer with `texelFetch`.
    GraphicsSampled,
    /// Vertex attributes and indices.
    VertexRead,
    /// Colour attachment of a render pass, resolve included.
    ColorWrite,
    /// Depth attachment of a render pass.
    DepthWrite,
    /// The window system shows the image after it has waited for a semaphore.
    Present,
    /// Whatever the caller does with it that shares the device: any read in any later command.
    Caller,
}

impl Access {
    pub(super) fn stage(self) -> vk::PipelineStageFlags2 {
        use vk::PipelineStageFlags2 as Stage;
        match self {
            Access::HostRead => Stage::HOST,
            Access::TransferRead | Access::TransferWrite => Stage::ALL_TRANSFER,
            Access::ComputeRead | Access::ComputeWrite | Access::ComputeSampled => Stage::COMPUTE_SHADER,
            Access::Indirect => Stage::DRAW_INDIRECT,
            Access::GraphicsSampled => Stage::VERTEX_SHADER | Stage::FRAGMENT_SHADER,
            Access::VertexRead => Stage::VERTEX_INPUT,
            Access::ColorWrite => Stage::COLOR_ATTACHMENT_OUTPUT,
            Access::DepthWrite => Stage::EARLY_FRAGMENT_TESTS | Stage::LATE_FRAGMENT_TESTS,
            // The semaphore orders the accesses and makes the writes visible; the barrier only changes the layout.
            Access::Present => Stage::NONE,
            Access::Caller => Stage::ALL_COMMANDS,
        }
    }

    pub(super) fn mask(self) -> vk::AccessFlags2 {
        use vk::AccessFlags2 as Mask;
        match self {
            Access::HostRead => Mask::HOST_READ,
            Access::TransferRead => Mask::TRANSFER_READ,
            Access::TransferWrite => Mask::TRANSFER_WRITE,
            Access::ComputeRead => Mask::SHADER_STORAGE_READ | Mask::UNIFORM_READ,
            Access::ComputeWrite => Mask::SHADER_STORAGE_READ | Mask::SHADER_STORAGE_WRITE,
            Access::Indirect => Mask::INDIRECT_COMMAND_READ,
            Access::ComputeSampled | Access::GraphicsSampled => Mask::SHADER_SAMPLED_READ,
            Access::VertexRead => Mask::VERTEX_ATTRIBUTE_READ | Mask::INDEX_READ,
            Access::ColorWrite => Mask::COLOR_ATTACHMENT_READ | Mask::COLOR_ATTACHMENT_WRITE,
            Access::DepthWrite => Mask::DEPTH_STENCIL_ATTACHMENT_READ | Mask::DEPTH_STENCIL_ATTACHMENT_WRITE,
            Access::Present => Mask::NONE,
            Access::Caller => Mask::MEMORY_READ,
        }
    }

    pub fn writes(self) -> bool {
        matches!(self, Access::TransferWrite | Access::ComputeWrite | Access::ColorWrite | Access::DepthWrite)
    }

    /// Layout of an image during the access: GENERAL, except for attachments and copies.
    pub(super) fn layout(self) -> vk::ImageLayout {
        match self {
            Access::ColorWrite => vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
            Access::DepthWrite => vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
            Access::TransferRead => vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
            Access::TransferWrite => vk::ImageLayout::TRANSFER_DST_OPTIMAL,
            Access::Present => vk::ImageLayout::PRESENT_SRC_KHR,
            _ => vk::ImageLayout::GENERAL,
        }
    }
}

/// One use of a byte range of one resource by one pass.
#[derive(Clone, Debug)]
struct Use {
    order: usize,
    range: Range<u64>,
    access: Access,
    pass: String,
}

#[derive(Clone, Debug)]
struct Barrier {
    order: usize,
    from: Access,
    to: Access,
    /// The image of an image barrier; `None` for a memory barrier, which holds for every resource.
    resource: Option<u64>,
}

impl Barrier {
    /// Whether this barrier orders `earlier` before `later` and makes what `earlier` wrote visible to it.
    fn covers(&self, resource: u64, earlier: &Use, later: Access) -> bool {
        if self.order <= earlier.order || self.resource.is_some_and(|only| only != resource) {
            return false;
        }
        let stages = self.from.stage().contains(earlier.access.stage()) && self.to.stage().contains(later.stage());
        // A write after a read only needs execution order; after a write, the written memory must also become visible.
        let memory = !earlier.access.writes()
            || (self.from.mask().contains(earlier.access.mask()) && self.to.mask().contains(later.mask()));
        stages && memory
    }
}

/// Follows the uses and barriers of one recording on the host.
#[derive(Default)]
pub struct Tracker {
    order: usize,
    uses: HashMap<u64, Vec<Use>>,
    barriers: Vec<Barrier>,
    layouts: HashMap<u64, vk::ImageLayout>,
    objections: Vec<String>,
}

impl Tracker {
    /// Notes a barrier. An image barrier has a `resource` and also moves that image to the layout of `to`.
    pub fn barrier(&mut self, from: Access, to: Access, resource: Option<u64>) {
        self.order += 1;
        self.barriers.push(Barrier { order: self.order, from, to, resource });
        if let Some(image) = resource {
            self.layouts.insert(image, to.layout());
        }
    }

    /// Notes that an image's content is discarded and its layout becomes that of `to`.
    pub fn discard(&mut self, image: u64, to: Access) {
        self.layouts.insert(image, to.layout());
    }

    /// Notes a use of an image as a whole, and checks its layout.
    pub fn use_image(&mut self, image: u64, name: &str, access: Access, pass: &str) {
        if let Some(layout) = self.layouts.get(&image)
            && *layout != access.layout()
        {
            self.objections.push(format!("pass {pass}: {access:?} of {name}, which is in layout {layout:?}"));
        }
        self.use_range(image, name, 0..u64::MAX, access, pass);
    }

    /// Notes a use of a byte range, and an objection for each earlier conflicting use that no barrier separates from
    /// it.
    pub fn use_range(&mut self, resource: u64, name: &str, range: Range<u64>, access: Access, pass: &str) {
        self.order += 1;
        let uses = self.uses.entry(resource).or_default();
        for earlier in uses.iter() {
            let overlap = earlier.range.start < range.end && range.start < earlier.range.end;
            let conflict = overlap && (earlier.access.writes() || access.writes());
            if conflict && !self.barriers.iter().rev().any(|b| b.covers(resource, earlier, access)) {
                self.objections.push(format!(
                    "no barrier({:?}, {access:?}) on {name} between pass {} and pass {pass}",
                    earlier.access, earlier.pass
                ));
            }
        }
        if access.writes() {
            uses.retain(|earlier| earlier.range.start < range.start || range.end < earlier.range.end);
        } else {
            // Where the same pass repeats the same use: a later writer waits for the last one only.
            uses.retain(|u| !(u.access == access && u.range == range && u.pass == pass));
        }
        uses.push(Use { order: self.order, range, access, pass: pass.to_owned() });
    }

    pub fn verdict(&self) -> Result<()> {
        if self.objections.is_empty() {
            return Ok(());
        }
        Err(Error::Failed(format!("missing synchronisation: {}", self.objections.join("; "))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn objections(story: impl FnOnce(&mut Tracker)) -> usize {
        let mut tracker = Tracker::default();
        story(&mut tracker);
        tracker.objections.len()
    }

    #[test]
    fn write_then_read_needs_its_own_barrier() {
        let run = |from, to| {
            objections(|t| {
                t.use_range(1, "b", 0..64, Access::ComputeWrite, "one");
                t.barrier(from, to, None);
                t.use_range(1, "b", 0..64, Access::ComputeSampled, "two");
            })
        };
        assert_eq!(run(Access::ComputeWrite, Access::ComputeSampled), 0);
        assert_eq!(run(Access::ComputeWrite, Access::ComputeRead), 1, "a texel read is a sampled read");
        assert_eq!(run(Access::TransferWrite, Access::ComputeSampled), 1);
    }

    #[test]
    fn barrier_before_the_write_does_not_count() {
        let count = objections(|t| {
            t.barrier(Access::ComputeWrite, Access::ComputeRead, None);
            t.use_range(1, "b", 0..64, Access::ComputeWrite, "one");
            t.use_range(1, "b", 0..64, Access::ComputeRead, "two");
        });
        assert_eq!(count, 1);
    }

    #[test]
    fn disjoint_ranges_and_two_reads_are_free() {
        let count = objections(|t| {
            t.use_range(1, "b", 0..64, Access::ComputeWrite, "one");
            t.use_range(1, "b", 64..128, Access::ComputeWrite, "one");
            t.use_range(2, "c", 0..64, Access::ComputeRead, "one");
            t.use_range(2, "c", 0..64, Access::VertexRead, "two");
        });
        assert_eq!(count, 0);
    }

    #[test]
    fn write_after_read_and_write_after_write_object() {
        let count = objections(|t| {
            t.use_range(1, "b", 0..64, Access::ComputeRead, "one");
            t.use_range(1, "b", 32..33, Access::ComputeWrite, "two");
            t.use_range(1, "b", 0..64, Access::ComputeWrite, "three");
        });
        assert_eq!(count, 3, "two after one, three after one, three after two");
    }

    #[test]
    fn image_layouts_are_followed() {
        let count = objections(|t| {
            t.discard(1, Access::ColorWrite);
            t.use_image(1, "i", Access::ColorWrite, "draw");
            t.barrier(Access::ColorWrite, Access::ComputeSampled, None);
            t.use_image(1, "i", Access::ComputeSampled, "read");
        });
        assert_eq!(count, 1, "a memory barrier does not change the layout");
        let count = objections(|t| {
            t.discard(1, Access::ColorWrite);
            t.use_image(1, "i", Access::ColorWrite, "draw");
            t.barrier(Access::ColorWrite, Access::ComputeSampled, Some(1));
            t.use_image(1, "i", Access::ComputeSampled, "read");
            t.barrier(Access::ComputeSampled, Access::ColorWrite, Some(2));
            t.use_image(1, "i", Access::ColorWrite, "draw");
        });
        assert_eq!(count, 3, "good for its own image only: layout, order after the read, order after the write");
    }
}
