//! Buffers, texel views and images, each with the memory it owns.

use super::device::Device;
use super::{Access, Checked, Commands};
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Where a buffer lives and who touches it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferKind {
    /// Device memory; the host fills it once through [`Buffer::with_data`].
    Device,
    /// Host memory that the host rewrites often and the device reads.
    Upload,
    /// Host memory that the device copies results into.
    Readback,
}

impl BufferKind {
    /// Wanted memory properties, best first.
    fn preferences(self) -> &'static [vk::MemoryPropertyFlags] {
        use vk::MemoryPropertyFlags as Flags;
        const COHERENT: Flags = Flags::from_raw(Flags::HOST_VISIBLE.as_raw() | Flags::HOST_COHERENT.as_raw());
        const UPLOAD: Flags = Flags::from_raw(COHERENT.as_raw() | Flags::DEVICE_LOCAL.as_raw());
        const READBACK: Flags = Flags::from_raw(COHERENT.as_raw() | Flags::HOST_CACHED.as_raw());
        const LISTS: [[vk::MemoryPropertyFlags; 2]; 3] =
            [[Flags::DEVICE_LOCAL, Flags::empty()], [UPLOAD, COHERENT], [READBACK, COHERENT]];
        match self {
            BufferKind::Device => &LISTS[0],
            BufferKind::Upload => &LISTS[1],
            BufferKind::Readback => &LISTS[2],
        }
    }
}

/// One allocation, bound to one buffer or image.
struct Memory {
    device: Arc<Device>,
    handle: vk::DeviceMemory,
    host_coherent: bool,
}

impl Memory {
    fn new(
        device: &Arc<Device>,
        name: &str,
        needs: vk::MemoryRequirements,
        preferences: &[vk::MemoryPropertyFlags],
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
        let coherent = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        Ok(Memory { device: device.clone(), handle, host_coherent: types[index].property_flags.contains(coherent) })
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: the object bound to this memory is dropped first (field order of its owner).
        unsafe { self.device.handle.free_memory(self.handle, None) };
    }
}

/// Destroys a buffer handle before its memory goes.
struct BufferHandle(Arc<Device>, vk::Buffer);

impl Drop for BufferHandle {
    fn drop(&mut self) {
        // SAFETY: recordings that use the buffer borrow it until the device has finished with them.
        unsafe { self.0.handle.destroy_buffer(self.1, None) };
    }
}

/// A buffer with its own memory, usable as storage, uniform, texel, vertex and index buffer and for copies.
pub struct Buffer {
    handle: BufferHandle,
    memory: Memory,
    mapped: Option<*mut u8>,
    pub(super) kind: BufferKind,
    /// Size in bytes.
    pub size_bytes: u64,
    /// Name shown in messages and debuggers.
    pub name: String,
    pub(super) id: u64,
}

// SAFETY: the mapped pointer is only used through `&self`/`&mut self` methods that copy whole slices; Vulkan handles may be
// used from any thread.
unsafe impl Send for Buffer {}
// SAFETY: as above; `write` takes `&mut self`, so two threads cannot write at once.
unsafe impl Sync for Buffer {}

impl Buffer {
    /// An uninitialised buffer of `size_bytes` (at least 4 are allocated).
    ///
    /// # Errors
    /// `Input` when the device cannot ever hold it, `Device` when memory ran out.
    pub fn new(device: &Arc<Device>, name: &str, kind: BufferKind, size_bytes: u64) -> Result<Self> {
        use vk::BufferUsageFlags as Use;
        let size_bytes = size_bytes.max(4);
        let create = vk::BufferCreateInfo::default().size(size_bytes).usage(
            Use::STORAGE_BUFFER
                | Use::UNIFORM_BUFFER
                | Use::UNIFORM_TEXEL_BUFFER
                | Use::VERTEX_BUFFER
                | Use::INDEX_BUFFER
                | Use::TRANSFER_SRC
                | Use::TRANSFER_DST,
        );
        // SAFETY: destroyed by `BufferHandle`.
        let handle = unsafe { device.handle.create_buffer(&create, None) }.checked("vkCreateBuffer", name)?;
        let handle = BufferHandle(device.clone(), handle);
        device.name(handle.1, name);
        // SAFETY: the handle is alive.
        let needs = unsafe { device.handle.get_buffer_memory_requirements(handle.1) };
        let memory = Memory::new(device, name, needs, kind.preferences())?;
        // SAFETY: fresh buffer and memory of sufficient size; the whole allocation is mapped once and unmapped by freeing.
        let mapped = unsafe {
            device.handle.bind_buffer_memory(handle.1, memory.handle, 0).checked("vkBindBufferMemory", name)?;
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
        Ok(Buffer { handle, memory, mapped, kind, size_bytes, name: name.to_owned(), id })
    }

    /// A device buffer that holds `data`, copied directly where the host can see device memory, else through a staging
    /// buffer and a submission of its own.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn with_data<T: Pod>(device: &Arc<Device>, name: &str, data: &[T]) -> Result<Self> {
        let mut buffer = Self::new(device, name, BufferKind::Device, size_of_val(data) as u64)?;
        buffer.fill(0, data)?;
        Ok(buffer)
    }

    /// Writes `data` at a byte offset (a multiple of 4), directly or through a staging buffer as the memory allows.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn fill<T: Pod>(&mut self, offset_bytes: u64, data: &[T]) -> Result<()> {
        if self.mapped.is_some() {
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

    /// Writes `data` at a byte offset into mapped memory.
    ///
    /// # Panics
    /// When the buffer is not visible to the host or the data does not fit: a programmer's mistake.
    pub fn write<T: Pod>(&mut self, offset_bytes: u64, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let pointer = self.mapped.unwrap_or_else(|| panic!("{} is not visible to the host", self.name));
        let end = offset_bytes + bytes.len() as u64;
        assert!(end <= self.size_bytes, "{}: write to byte {end} of {}", self.name, self.size_bytes);
        // SAFETY: in bounds of the mapping (asserted); the borrow checker keeps recordings that read it apart in time.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), pointer.add(offset_bytes as usize), bytes.len()) };
    }

    /// Copies `count` elements from a byte offset of mapped memory.
    ///
    /// # Panics
    /// When the buffer is not visible to the host or the range is outside it.
    pub fn read<T: Pod>(&self, offset_bytes: u64, count: usize) -> Vec<T> {
        let pointer = self.mapped.unwrap_or_else(|| panic!("{} is not visible to the host", self.name));
        let end = offset_bytes + (count * size_of::<T>()) as u64;
        assert!(end <= self.size_bytes, "{}: read to byte {end} of {}", self.name, self.size_bytes);
        let mut out = vec![T::zeroed(); count];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut out);
        // SAFETY: in bounds of the mapping (asserted); every submission that writes it has finished.
        unsafe { std::ptr::copy_nonoverlapping(pointer.add(offset_bytes as usize), bytes.as_mut_ptr(), bytes.len()) };
        out
    }

    /// Brings `count` elements from the start of a device buffer to the host, through a staging copy and a submission of its
    /// own.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn download<T: Pod>(&self, count: usize) -> Result<Vec<T>> {
        self.download_range(0..(count * size_of::<T>()) as u64)
    }

    /// As [`Buffer::download`] for a byte range.
    ///
    /// # Errors
    /// As [`Buffer::new`].
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

    /// The device that the buffer lives on.
    pub fn device(&self) -> &Arc<Device> {
        &self.memory.device
    }

    pub(super) fn raw(&self) -> vk::Buffer {
        self.handle.1
    }

    pub(super) fn all(&self) -> Range<u64> {
        0..self.size_bytes
    }
}

/// A typed window on a whole buffer, read by shaders as `textureBuffer`.
pub struct TexelView<'b> {
    pub(super) handle: vk::BufferView,
    pub(super) buffer: &'b Buffer,
}

impl<'b> TexelView<'b> {
    /// Bytes of one texel of the formats in use.
    fn texel_bytes(format: vk::Format) -> u64 {
        match format {
            vk::Format::R32G32B32A32_SFLOAT | vk::Format::R32G32B32A32_UINT => 16,
            vk::Format::R16G16B16A16_SFLOAT => 8,
            other => unreachable!("no texel view of format {other:?} is in use"),
        }
    }

    /// Whether a view of `size_bytes` stays under the device's `maxTexelBufferElements`.
    pub fn fits(device: &Device, format: vk::Format, size_bytes: u64) -> bool {
        size_bytes / Self::texel_bytes(format) <= u64::from(device.limits.max_texel_buffer_elements)
    }

    /// A view of the whole of `buffer`.
    ///
    /// # Errors
    /// `Input` when it has more texels than the device's views can hold.
    pub fn new(buffer: &'b Buffer, format: vk::Format) -> Result<Self> {
        let device = buffer.device();
        if !Self::fits(device, format, buffer.size_bytes) {
            return Err(Error::Input(format!(
                "{}: {} bytes are more texels than the device's views can hold ({})",
                buffer.name, buffer.size_bytes, device.limits.max_texel_buffer_elements
            )));
        }
        let range = buffer.size_bytes / Self::texel_bytes(format) * Self::texel_bytes(format);
        let create = vk::BufferViewCreateInfo::default().buffer(buffer.raw()).format(format).range(range);
        // SAFETY: the view borrows the buffer, so it goes first; destroyed in `Drop`.
        let handle =
            unsafe { device.handle.create_buffer_view(&create, None) }.checked("vkCreateBufferView", &buffer.name)?;
        device.name(handle, &buffer.name);
        Ok(TexelView { handle, buffer })
    }
}

impl Drop for TexelView<'_> {
    fn drop(&mut self) {
        // SAFETY: recordings that use the view borrow it until the device has finished with them.
        unsafe { self.buffer.device().handle.destroy_buffer_view(self.handle, None) };
    }
}

/// What an image is made for.
#[derive(Clone, Copy, Debug)]
pub struct ImageShape {
    /// Texel format.
    pub format: vk::Format,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Samples a texel: 1 or 4.
    pub samples: u32,
}

/// Destroys an image's handles before its memory goes.
struct ImageHandle(Arc<Device>, vk::Image, vk::ImageView);

impl Drop for ImageHandle {
    fn drop(&mut self) {
        // SAFETY: recordings that use the image borrow it until the device has finished with them.
        unsafe {
            self.0.handle.destroy_image_view(self.2, None);
            self.0.handle.destroy_image(self.1, None);
        }
    }
}

/// A two-dimensional image that passes draw into and read.
pub struct Image {
    handle: ImageHandle,
    _memory: Memory,
    /// Format and size.
    pub shape: ImageShape,
    /// Name shown in messages and debuggers.
    pub name: String,
    pub(super) id: u64,
}

impl Image {
    /// An image without content. Depth formats become depth attachments, all else colour attachments.
    ///
    /// # Errors
    /// `Input` when it is larger than the device's images can be, `Device` when memory ran out.
    pub fn new(device: &Arc<Device>, name: &str, shape: ImageShape) -> Result<Self> {
        use vk::ImageUsageFlags as Use;
        let most = device.limits.max_image_dimension2_d.min(device.limits.max_framebuffer_width);
        if shape.width == 0 || shape.height == 0 || shape.width > most || shape.height > most {
            let (width, height) = (shape.width, shape.height);
            return Err(Error::Input(format!("{name}: {width}x{height} is outside the device's 1..={most}")));
        }
        let depth = shape.format == vk::Format::D32_SFLOAT;
        let usage = match (depth, shape.samples > 1) {
            (true, _) => Use::DEPTH_STENCIL_ATTACHMENT,
            (false, true) => Use::COLOR_ATTACHMENT,
            (false, false) => Use::COLOR_ATTACHMENT | Use::SAMPLED | Use::TRANSFER_SRC,
        };
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(shape.format)
            .extent(vk::Extent3D { width: shape.width, height: shape.height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::from_raw(shape.samples))
            .usage(usage);
        // SAFETY: destroyed by `ImageHandle`.
        let image = unsafe { device.handle.create_image(&create, None) }.checked("vkCreateImage", name)?;
        let mut handle = ImageHandle(device.clone(), image, vk::ImageView::null());
        device.name(image, name);
        // SAFETY: the handle is alive.
        let needs = unsafe { device.handle.get_image_memory_requirements(image) };
        let memory = Memory::new(device, name, needs, BufferKind::Device.preferences())?;
        let view = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(shape.format)
            .subresource_range(whole(shape.format));
        // SAFETY: fresh image and memory of sufficient size; the view is destroyed by `ImageHandle`.
        unsafe {
            device.handle.bind_image_memory(image, memory.handle, 0).checked("vkBindImageMemory", name)?;
            handle.2 = device.handle.create_image_view(&view, None).checked("vkCreateImageView", name)?;
        }
        device.name(handle.2, name);
        let id = device.next_resource.fetch_add(1, Ordering::Relaxed);
        Ok(Image { handle, _memory: memory, shape, name: name.to_owned(), id })
    }

    pub(super) fn raw(&self) -> vk::Image {
        self.handle.1
    }

    pub(super) fn view(&self) -> vk::ImageView {
        self.handle.2
    }
}

/// The one mip level and layer of an image of `format`.
pub(super) fn whole(format: vk::Format) -> vk::ImageSubresourceRange {
    let aspect =
        if format == vk::Format::D32_SFLOAT { vk::ImageAspectFlags::DEPTH } else { vk::ImageAspectFlags::COLOR };
    vk::ImageSubresourceRange {
        aspect_mask: aspect,
        base_mip_level: 0,
        level_count: 1,
        base_array_layer: 0,
        layer_count: 1,
    }
}
