//! Buffers with the memory they own, and texel views of them.

use super::device::Device;
use super::owned::Owned;
use super::{Access, Checked, Commands, FLIGHTS};
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::ops::{Deref, Range};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

/// Where a buffer lies and who accesses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferKind {
    /// Device memory; the host fills it once through [`Buffer::with_data`].
    Device,
    /// Host memory that the host writes often and the device reads.
    Upload,
    /// Host memory that the device copies results into.
    Readback,
}

impl BufferKind {
    /// Memory properties to try, best first.
    pub(super) fn preferences(self) -> [vk::MemoryPropertyFlags; 2] {
        use vk::MemoryPropertyFlags as Flags;
        let coherent = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
        match self {
            BufferKind::Device => [Flags::DEVICE_LOCAL, Flags::empty()],
            BufferKind::Upload => [coherent | Flags::DEVICE_LOCAL, coherent],
            BufferKind::Readback => [coherent | Flags::HOST_CACHED, coherent],
        }
    }
}

/// One allocation, bound to one buffer or image.
pub(super) struct Allocation {
    device: Arc<Device>,
    pub(super) handle: vk::DeviceMemory,
    size_bytes: u64,
    host_coherent: bool,
}

impl Allocation {
    pub(super) fn new(
        device: &Arc<Device>,
        name: &str,
        needs: vk::MemoryRequirements,
        preferences: [vk::MemoryPropertyFlags; 2],
    ) -> Result<Self> {
        let types = device.memory.memory_types_as_slice();
        let allowed = |index: usize| needs.memory_type_bits & (1 << index) != 0;
        let index = preferences
            .iter()
            .find_map(|&wanted| {
                (0..types.len()).find(|&index| allowed(index) && types[index].property_flags.contains(wanted))
            })
            .ok_or_else(|| Error::Unsupported(format!("{name}: the device has no memory type for it")))?;
        let heap = device.memory.memory_heaps[types[index].heap_index as usize];
        if needs.size > heap.size {
            return Err(Error::Input(format!(
                "{name} needs {} bytes of device memory, the device has {}",
                needs.size, heap.size
            )));
        }
        let allocate = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index as u32);
        // SAFETY: size and type come from the device; freed in `Drop`.
        let handle = unsafe { device.handle.allocate_memory(&allocate, None) }.checked("vkAllocateMemory", name)?;
        device.name(handle, name);
        device.allocated_bytes.fetch_add(needs.size, Ordering::Relaxed);
        let coherent = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let host_coherent = types[index].property_flags.contains(coherent);
        Ok(Allocation { device: device.clone(), handle, size_bytes: needs.size, host_coherent })
    }
}

impl Drop for Allocation {
    fn drop(&mut self) {
        // SAFETY: the object bound to this memory is dropped first (field order of its owner).
        unsafe { self.device.handle.free_memory(self.handle, None) };
        self.device.allocated_bytes.fetch_sub(self.size_bytes, Ordering::Relaxed);
    }
}

/// A buffer with its own memory, usable as storage, uniform, texel, vertex, index and indirect buffer and for copies.
pub struct Buffer {
    /// Destroyed before the buffer, which is destroyed before its memory.
    views: Mutex<Vec<(vk::Format, Owned<vk::BufferView>)>>,
    handle: Owned<vk::Buffer>,
    memory: Allocation,
    mapped: Option<*mut u8>,
    pub(super) kind: BufferKind,
    pub size_bytes: u64,
    pub name: String,
    pub(super) id: u64,
}

// SAFETY: the mapped pointer is only used through `&self`/`&mut self` methods that copy whole slices; Vulkan handles
// may be used from any thread.
unsafe impl Send for Buffer {}
// SAFETY: as above; `write` takes `&mut self`, so two threads cannot write at once.
unsafe impl Sync for Buffer {}

impl Buffer {
    /// An uninitialised buffer of `size_bytes` (at least 4 are allocated).
    pub fn new(device: &Arc<Device>, name: &str, kind: BufferKind, size_bytes: u64) -> Result<Self> {
        use vk::BufferUsageFlags as Use;
        let size_bytes = size_bytes.max(4);
        let create = vk::BufferCreateInfo::default().size(size_bytes).usage(
            Use::STORAGE_BUFFER
                | Use::UNIFORM_BUFFER
                | Use::UNIFORM_TEXEL_BUFFER
                | Use::VERTEX_BUFFER
                | Use::INDEX_BUFFER
                | Use::INDIRECT_BUFFER
                | Use::TRANSFER_SRC
                | Use::TRANSFER_DST,
        );
        // SAFETY: destroyed by `Owned`.
        let buffer = unsafe { device.handle.create_buffer(&create, None) }.checked("vkCreateBuffer", name)?;
        let handle = Owned::new(device, name, buffer, ash::Device::destroy_buffer);
        // SAFETY: the handle is alive.
        let needs = unsafe { device.handle.get_buffer_memory_requirements(buffer) };
        let memory = Allocation::new(device, name, needs, kind.preferences())?;
        // SAFETY: fresh buffer and memory of sufficient size; the whole allocation is mapped once and unmapped by
        // freeing.
        let mapped = unsafe {
            device.handle.bind_buffer_memory(buffer, memory.handle, 0).checked("vkBindBufferMemory", name)?;
            if memory.host_coherent {
                let pointer = device
                    .handle
                    .map_memory(memory.handle, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())
                    .checked("vkMapMemory", name)?;
                Some(pointer.cast::<u8>())
            } else {
                None
            }
        };
        let id = device.next_resource.fetch_add(1, Ordering::Relaxed);
        Ok(Buffer { views: Mutex::default(), handle, memory, mapped, kind, size_bytes, name: name.to_owned(), id })
    }

    /// A device buffer that holds `data`, copied directly if the host can map device memory, else through a staging
    /// buffer and a submission of its own.
    pub fn with_data<T: Pod>(device: &Arc<Device>, name: &str, data: &[T]) -> Result<Self> {
        let mut buffer = Self::new(device, name, BufferKind::Device, size_of_val(data) as u64)?;
        buffer.fill(0, data)?;
        Ok(buffer)
    }

    /// A device buffer of zeros, whole words.
    pub fn zeros(device: &Arc<Device>, name: &str, size_bytes: u64) -> Result<Self> {
        Self::with_data(device, name, &vec![0_u32; size_bytes as usize / 4])
    }

    /// Writes `data` at a byte offset (a multiple of 4), directly or through a staging buffer as the memory allows. It
    /// first waits for all recordings in flight.
    pub fn fill<T: Pod>(&mut self, offset_bytes: u64, data: &[T]) -> Result<()> {
        if data.is_empty() {
            return Ok(()); // Vulkan copies no empty range
        }
        if self.mapped.is_some() {
            self.device().settle();
            self.write(offset_bytes, data);
            return Ok(());
        }
        let device = self.device().clone();
        let mut staging = Self::new(&device, "staging", BufferKind::Upload, size_of_val(data) as u64)?;
        staging.write(0, data);
        let mut commands = Commands::new(&device, "upload")?;
        commands.copy_range(&staging, 0..size_of_val(data) as u64, self, offset_bytes);
        commands.submit()?;
        Ok(())
    }

    /// Writes `data` at a byte offset into mapped memory. The caller must not write what a recording in flight reads
    /// ([`Commands::launch`]); [`Upload`] keeps one buffer per flight for that.
    pub fn write<T: Pod>(&mut self, offset_bytes: u64, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let pointer = self.mapped.unwrap_or_else(|| panic!("{} is not visible to the host", self.name));
        let end = offset_bytes + bytes.len() as u64;
        assert!(end <= self.size_bytes, "{}: write to byte {end} of {}", self.name, self.size_bytes);
        // SAFETY: in bounds of the mapping (asserted); the borrow checker keeps recordings that read it apart in time.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), pointer.add(offset_bytes as usize), bytes.len()) };
    }

    /// Waits for all recordings in flight, then copies `count` elements from a byte offset of mapped memory.
    pub fn read<T: Pod>(&self, offset_bytes: u64, count: usize) -> Vec<T> {
        self.device().settle();
        self.read_finished(offset_bytes, count)
    }

    /// As [`Buffer::read`] of what no recording in flight writes.
    pub(super) fn read_finished<T: Pod>(&self, offset_bytes: u64, count: usize) -> Vec<T> {
        let pointer = self.mapped.unwrap_or_else(|| panic!("{} is not visible to the host", self.name));
        let end = offset_bytes + (count * size_of::<T>()) as u64;
        assert!(end <= self.size_bytes, "{}: read to byte {end} of {}", self.name, self.size_bytes);
        let mut out = vec![T::zeroed(); count];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut out);
        // SAFETY: in bounds of the mapping (asserted); every submission that writes it has finished.
        unsafe { std::ptr::copy_nonoverlapping(pointer.add(offset_bytes as usize), bytes.as_mut_ptr(), bytes.len()) };
        out
    }

    /// Copies `count` elements from the start of a device buffer to the host, through a staging buffer and a submission
    /// of its own.
    pub fn download<T: Pod>(&self, count: usize) -> Result<Vec<T>> {
        self.download_range(0..(count * size_of::<T>()) as u64)
    }

    /// As [`Buffer::download`] for a byte range.
    pub fn download_range<T: Pod>(&self, range: Range<u64>) -> Result<Vec<T>> {
        let device = self.device().clone();
        let size = range.end - range.start;
        let staging = Self::new(&device, "download", BufferKind::Readback, size)?;
        let mut commands = Commands::new(&device, "download")?;
        commands.copy_range(self, range, &staging, 0);
        commands.barrier(Access::TransferWrite, Access::HostRead);
        commands.submit()?;
        Ok(staging.read(0, size as usize / size_of::<T>()))
    }

    pub fn device(&self) -> &Arc<Device> {
        &self.memory.device
    }

    /// The Vulkan handle, which stays the buffer's own.
    pub fn raw(&self) -> vk::Buffer {
        self.handle.handle
    }

    pub(super) fn all(&self) -> Range<u64> {
        0..self.size_bytes
    }
}

/// A buffer that the host rewrites while the device still reads its earlier content: one per flight, written in turn.
/// Readers use the one that was written last.
///
/// A frame writes it at most once, after it has waited for the flight that read the same buffer [`FLIGHTS`] frames
/// before.
pub struct Upload {
    buffers: [Buffer; FLIGHTS],
    last: usize,
}

impl Upload {
    pub fn new(device: &Arc<Device>, name: &str, size_bytes: u64) -> Result<Self> {
        Self::of_kind(device, name, BufferKind::Upload, size_bytes)
    }

    /// Of [`BufferKind::Device`]: one that the device alone writes, of a size that changes from frame to frame.
    pub fn of_kind(device: &Arc<Device>, name: &str, kind: BufferKind, size_bytes: u64) -> Result<Self> {
        let one = || Buffer::new(device, name, kind, size_bytes);
        Ok(Upload { buffers: [one()?, one()?], last: 0 })
    }

    /// Writes the whole content.
    pub fn write<T: Pod>(&mut self, data: &[T]) -> Result<()> {
        self.reserve(size_of_val(data) as u64)?;
        self.buffers[self.last].write(0, data);
        Ok(())
    }

    /// Takes the next flight's buffer. One that is too small is replaced by one that is half as large again as needed, so
    /// that a slowly growing scene does not reallocate in each frame.
    pub fn reserve(&mut self, size_bytes: u64) -> Result<()> {
        self.last = (self.last + 1) % FLIGHTS;
        let buffer = &mut self.buffers[self.last];
        if size_bytes > buffer.size_bytes {
            let size = size_bytes + size_bytes / 2;
            *buffer = Buffer::new(&buffer.device().clone(), &buffer.name.clone(), buffer.kind, size)?;
        }
        Ok(())
    }
}

impl Deref for Upload {
    type Target = Buffer;
    fn deref(&self) -> &Buffer {
        &self.buffers[self.last]
    }
}

/// A typed view of a whole buffer, which shaders read as `textureBuffer`. The buffer owns the view, so it is created
/// once.
#[derive(Clone, Copy)]
pub struct TexelView<'b> {
    pub(super) handle: vk::BufferView,
    pub(super) buffer: &'b Buffer,
}

impl<'b> TexelView<'b> {
    /// Bytes of one texel of the formats in use.
    fn texel_bytes(format: vk::Format) -> u64 {
        match format {
            vk::Format::R32G32B32A32_SFLOAT | vk::Format::R32G32B32A32_UINT => 16,
            vk::Format::R16G16B16A16_SFLOAT | vk::Format::R32G32_UINT => 8,
            vk::Format::R32_UINT | vk::Format::R32_SFLOAT => 4,
            other => unreachable!("no texel view of format {other:?} is in use"),
        }
    }

    /// Whether a view of `size_bytes` stays under the device's `maxTexelBufferElements`.
    pub fn fits(device: &Device, format: vk::Format, size_bytes: u64) -> bool {
        size_bytes / Self::texel_bytes(format) <= u64::from(device.limits.max_texel_buffer_elements)
    }

    pub fn new(buffer: &'b Buffer, format: vk::Format) -> Result<Self> {
        let device = buffer.device();
        if !Self::fits(device, format, buffer.size_bytes) {
            return Err(Error::Input(format!(
                "{}: {} bytes are more texels than the device's views can hold ({})",
                buffer.name, buffer.size_bytes, device.limits.max_texel_buffer_elements
            )));
        }
        let mut views = buffer.views.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some((_, view)) = views.iter().find(|(known, _)| *known == format) {
            return Ok(TexelView { handle: view.handle, buffer });
        }
        let range = buffer.size_bytes / Self::texel_bytes(format) * Self::texel_bytes(format);
        let create = vk::BufferViewCreateInfo::default().buffer(buffer.raw()).format(format).range(range);
        // SAFETY: the buffer is alive and destroys the view before itself.
        let handle =
            unsafe { device.handle.create_buffer_view(&create, None) }.checked("vkCreateBufferView", &buffer.name)?;
        views.push((format, Owned::new(device, &buffer.name, handle, ash::Device::destroy_buffer_view)));
        Ok(TexelView { handle, buffer })
    }
}
