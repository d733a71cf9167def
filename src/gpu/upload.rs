//! Buffers that the host rewrites while the device still reads what it wrote before.

use super::device::Device;
use super::flight::FLIGHTS;
use super::memory::{Buffer, BufferKind};
use crate::error::Result;
use bytemuck::Pod;
use std::ops::Deref;
use std::sync::Arc;

/// A buffer for each flight, written in turn; it stands for the one that was written last.
///
/// A frame writes it at most once, and waits for the flight before the last one first: what that one read is free again.
pub struct Upload {
    buffers: [Buffer; FLIGHTS],
    last: usize,
}

impl Upload {
    /// Buffers of `size_bytes` each.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn new(device: &Arc<Device>, name: &str, size_bytes: u64) -> Result<Self> {
        let one = || Buffer::new(device, name, BufferKind::Upload, size_bytes);
        Ok(Upload { buffers: [one()?, one()?], last: 0 })
    }

    /// Writes the whole content. A buffer that is too small gives way to one with room for half as much again, so that a moving
    /// scene does not come back each frame.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn write<T: Pod>(&mut self, data: &[T]) -> Result<()> {
        self.last = (self.last + 1) % FLIGHTS;
        let buffer = &mut self.buffers[self.last];
        let size = size_of_val(data) as u64;
        if size > buffer.size_bytes {
            *buffer = Buffer::new(&buffer.device().clone(), &buffer.name.clone(), BufferKind::Upload, size + size / 2)?;
        }
        buffer.write(0, data);
        Ok(())
    }

    /// Place of the buffer that was written last.
    pub fn place(&self) -> usize {
        self.last
    }

    /// What the device has written into the buffer at that place, once the flight that it belongs to has ended.
    pub fn at(&self, place: usize) -> &Buffer {
        &self.buffers[place]
    }

    /// Bytes of all flights together.
    pub fn all_bytes(&self) -> u64 {
        self.buffers.iter().map(|buffer| buffer.size_bytes).sum()
    }
}

impl Deref for Upload {
    type Target = Buffer;
    fn deref(&self) -> &Buffer {
        &self.buffers[self.last]
    }
}
