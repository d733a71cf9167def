//! Buffers that the host rewrites while the device still reads their earlier content.

use super::device::Device;
use super::flight::FLIGHTS;
use super::memory::{Buffer, BufferKind};
use crate::error::Result;
use bytemuck::Pod;
use std::ops::Deref;
use std::sync::Arc;

/// One buffer per flight, written in turn; readers use the one that was written last.
///
/// A frame writes it at most once, after it has waited for the flight that read the same buffer [`FLIGHTS`] frames
/// before.
pub struct Upload {
    buffers: [Buffer; FLIGHTS],
    last: usize,
}

impl Upload {
    /// Buffers of `size_bytes` each.
    pub fn new(device: &Arc<Device>, name: &str, size_bytes: u64) -> Result<Self> {
        let one = || Buffer::new(device, name, BufferKind::Upload, size_bytes);
        Ok(Upload { buffers: [one()?, one()?], last: 0 })
    }

    /// Writes the whole content. A buffer that is too small is replaced by one that is half as large again as needed,
    /// so that a slowly growing scene does not reallocate in each frame.
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

    /// Bytes of all buffers together.
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
