//! Owns what a library makes of Vulkan objects. Libraries that draw for us are given a function table that notes every object they
//! make, so that objects which they forget, as after an error, are destroyed with them.

use super::device::Device;
use ash::vk::{self, Handle};
use std::cell::{Cell, RefCell};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The objects that a library has made and not destroyed, in the order in which they were made.
struct Ledger {
    device: Arc<Device>,
    live: Mutex<Vec<(vk::ObjectType, u64)>>,
}

impl Ledger {
    fn live(&self) -> MutexGuard<'_, Vec<(vk::ObjectType, u64)>> {
        self.live.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

thread_local! {
    /// The ledger of the library that runs on this thread: Vulkan's functions pass no pointer of ours.
    static CURRENT: RefCell<Option<Arc<Ledger>>> = const { RefCell::new(None) };
    /// Fallible calls until one fails; see [`fail_call`].
    static FAULT: Cell<Option<usize>> = const { Cell::new(None) };
    /// The call of a library that failed last: libraries pass on the error, not what was called.
    static FAILED: Cell<&'static str> = const { Cell::new("drawing") };
}

/// The Vulkan function that failed last when a library on this thread called it.
pub(super) fn failed_call() -> String {
    let words = FAILED.get().split('_').map(|word| word[..1].to_uppercase() + &word[1..]);
    format!("vk{}", words.collect::<String>())
}

/// Notes whether a call failed.
fn noted(call: &'static str, result: vk::Result) -> vk::Result {
    if result.as_raw() < 0 {
        FAILED.set(call);
    }
    result
}

/// Makes the `index`-th fallible call of libraries on this thread, counted from 0, fail once, so that a test can show what follows.
pub(super) fn fail_call(index: Option<usize>) {
    FAULT.set(index);
}

/// Whether this call is the one that is to fail.
fn fails() -> bool {
    let left = FAULT.get();
    FAULT.set(left.and_then(|left| left.checked_sub(1)));
    left == Some(0)
}

/// The ledger of the library that makes this call.
fn current() -> Arc<Ledger> {
    CURRENT.with_borrow(|current| current.clone()).expect("libraries are called through Ledgered")
}

/// Sets the thread's ledger while it lives.
struct Turn(Option<Arc<Ledger>>);

impl Turn {
    fn new(ledger: &Arc<Ledger>) -> Self {
        Turn(CURRENT.replace(Some(ledger.clone())))
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        CURRENT.set(self.0.take());
    }
}

/// A library's object with the ledger of what it made.
pub(super) struct Ledgered<T> {
    library: Option<T>,
    ledger: Arc<Ledger>,
}

impl<T> Ledgered<T> {
    /// Makes the library's object, which gets a device whose calls are noted.
    ///
    /// # Errors
    /// What `make` returns; then everything that it made is destroyed.
    pub fn new<E>(
        device: &Arc<Device>,
        make: impl FnOnce(ash::Device) -> std::result::Result<T, E>,
    ) -> std::result::Result<Self, E> {
        let ledger = Arc::new(Ledger { device: device.clone(), live: Mutex::default() });
        let mut out = Ledgered { library: None, ledger };
        let _turn = Turn::new(&out.ledger);
        out.library = Some(make(noting(&device.handle))?);
        Ok(out)
    }

    /// Calls the library.
    pub fn call<R>(&mut self, call: impl FnOnce(&mut T) -> R) -> R {
        let _turn = Turn::new(&self.ledger);
        call(self.library.as_mut().expect("made in `new`, taken in `drop`"))
    }
}

impl<T> Drop for Ledgered<T> {
    fn drop(&mut self) {
        let turn = Turn::new(&self.ledger);
        let device = &self.ledger.device;
        {
            let _queue = device.queue();
            // SAFETY: the device is alive and its queue is locked. A library that was stopped by an error may not have waited for what
            // it submitted; a lost device executes nothing.
            let _ = unsafe { device.handle.device_wait_idle() };
        }
        drop(self.library.take());
        drop(turn);
        let forgotten = std::mem::take(&mut *self.ledger.live());
        // What was made later may use what was made before.
        for (kind, handle) in forgotten.into_iter().rev() {
            log::debug!("{kind:?} was forgotten by a library");
            destroy(&device.handle, kind, handle);
        }
    }
}

/// Functions that make and destroy one kind of object each, with their usual parameters.
macro_rules! objects {
    ($($kind:ident: $create:ident($info:ident), $destroy:ident;)*) => {
        $(
            /// As the Vulkan function of that name; notes the object.
            ///
            /// # Safety
            /// The same conditions as for the Vulkan function.
            unsafe extern "system" fn $create(
                device: vk::Device,
                info: *const vk::$info<'_>,
                allocator: *const vk::AllocationCallbacks<'_>,
                object: *mut vk::$kind,
            ) -> vk::Result {
                if fails() {
                    return noted(stringify!($create), vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
                }
                let ledger = current();
                // SAFETY: the caller keeps the contract of this very function.
                let result = unsafe { (ledger.device.handle.fp_v1_0().$create)(device, info, allocator, object) };
                if result == vk::Result::SUCCESS {
                    // SAFETY: the function succeeded, so it has written the handle.
                    ledger.live().push((vk::$kind::TYPE, unsafe { *object }.as_raw()));
                }
                noted(stringify!($create), result)
            }

            /// As the Vulkan function of that name; strikes the object off.
            ///
            /// # Safety
            /// The same conditions as for the Vulkan function.
            unsafe extern "system" fn $destroy(
                device: vk::Device,
                object: vk::$kind,
                allocator: *const vk::AllocationCallbacks<'_>,
            ) {
                let ledger = current();
                ledger.live().retain(|known| *known != (vk::$kind::TYPE, object.as_raw()));
                // SAFETY: the caller keeps the contract of this very function.
                unsafe { (ledger.device.handle.fp_v1_0().$destroy)(device, object, allocator) };
            }
        )*

        /// A device whose calls are noted.
        fn noting(device: &ash::Device) -> ash::Device {
            let mut functions = device.fp_v1_0().clone();
            $(
                functions.$create = $create;
                functions.$destroy = $destroy;
            )*
            functions.create_graphics_pipelines = create_graphics_pipelines;
            functions.destroy_pipeline = destroy_pipeline;
            count_fallible(&mut functions);
            let (two, three, four) = (device.fp_v1_1().clone(), device.fp_v1_2().clone(), device.fp_v1_3().clone());
            ash::Device::from_parts_1_3(device.handle(), functions, two, three, four)
        }

        /// Destroys an object that is in a ledger.
        fn destroy(device: &ash::Device, kind: vk::ObjectType, handle: u64) {
            match kind {
                // SAFETY: for all kinds, the object was made by this device and not destroyed, and the device is idle.
                $(vk::$kind::TYPE => unsafe { device.$destroy(vk::$kind::from_raw(handle), None) },)*
                // SAFETY: as above.
                vk::Pipeline::TYPE => unsafe { device.destroy_pipeline(vk::Pipeline::from_raw(handle), None) },
                other => unreachable!("{other:?} is not noted"),
            }
        }
    };
}

objects! {
    Buffer: create_buffer(BufferCreateInfo), destroy_buffer;
    DeviceMemory: allocate_memory(MemoryAllocateInfo), free_memory;
    Image: create_image(ImageCreateInfo), destroy_image;
    ImageView: create_image_view(ImageViewCreateInfo), destroy_image_view;
    Sampler: create_sampler(SamplerCreateInfo), destroy_sampler;
    ShaderModule: create_shader_module(ShaderModuleCreateInfo), destroy_shader_module;
    PipelineLayout: create_pipeline_layout(PipelineLayoutCreateInfo), destroy_pipeline_layout;
    DescriptorPool: create_descriptor_pool(DescriptorPoolCreateInfo), destroy_descriptor_pool;
    DescriptorSetLayout: create_descriptor_set_layout(DescriptorSetLayoutCreateInfo), destroy_descriptor_set_layout;
}

/// As the Vulkan function of that name; notes the pipelines.
///
/// # Safety
/// The same conditions as for the Vulkan function.
unsafe extern "system" fn create_graphics_pipelines(
    device: vk::Device,
    cache: vk::PipelineCache,
    count: u32,
    infos: *const vk::GraphicsPipelineCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    pipelines: *mut vk::Pipeline,
) -> vk::Result {
    if fails() {
        // SAFETY: the caller has room for `count` handles, which are null where creation fails.
        unsafe { std::slice::from_raw_parts_mut(pipelines, count as usize) }.fill(vk::Pipeline::null());
        return noted("create_graphics_pipelines", vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
    }
    let ledger = current();
    let create = ledger.device.handle.fp_v1_0().create_graphics_pipelines;
    // SAFETY: the caller keeps the contract of this very function.
    let result = unsafe { create(device, cache, count, infos, allocator, pipelines) };
    // SAFETY: the function has written `count` handles, null ones where creation failed.
    let made = unsafe { std::slice::from_raw_parts(pipelines, count as usize) };
    let made = made.iter().filter(|pipeline| !pipeline.is_null());
    ledger.live().extend(made.map(|pipeline| (vk::Pipeline::TYPE, pipeline.as_raw())));
    noted("create_graphics_pipelines", result)
}

/// As the Vulkan function of that name; strikes the pipeline off.
///
/// # Safety
/// The same conditions as for the Vulkan function.
unsafe extern "system" fn destroy_pipeline(
    device: vk::Device,
    pipeline: vk::Pipeline,
    allocator: *const vk::AllocationCallbacks<'_>,
) {
    let ledger = current();
    ledger.live().retain(|known| *known != (vk::Pipeline::TYPE, pipeline.as_raw()));
    // SAFETY: the caller keeps the contract of this very function.
    unsafe { (ledger.device.handle.fp_v1_0().destroy_pipeline)(device, pipeline, allocator) };
}

/// Functions that can fail and make nothing that is noted.
macro_rules! fallible {
    ($($name:ident($($parameter:ident: $type:ty),*);)*) => {
        $(
            /// As the Vulkan function of that name; can be made to fail.
            ///
            /// # Safety
            /// The same conditions as for the Vulkan function.
            unsafe extern "system" fn $name($($parameter: $type),*) -> vk::Result {
                if fails() {
                    return noted(stringify!($name), vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
                }
                // SAFETY: the caller keeps the contract of this very function.
                let result = unsafe { (current().device.handle.fp_v1_0().$name)($($parameter),*) };
                noted(stringify!($name), result)
            }
        )*

        fn count_fallible(functions: &mut ash::DeviceFnV1_0) {
            $(functions.$name = $name;)*
        }
    };
}

fallible! {
    bind_buffer_memory(device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: vk::DeviceSize);
    bind_image_memory(device: vk::Device, image: vk::Image, memory: vk::DeviceMemory, offset: vk::DeviceSize);
    map_memory(device: vk::Device, memory: vk::DeviceMemory, offset: vk::DeviceSize, size: vk::DeviceSize,
        flags: vk::MemoryMapFlags, data: *mut *mut std::ffi::c_void);
    allocate_descriptor_sets(device: vk::Device, info: *const vk::DescriptorSetAllocateInfo<'_>, sets: *mut vk::DescriptorSet);
    allocate_command_buffers(device: vk::Device, info: *const vk::CommandBufferAllocateInfo<'_>,
        buffers: *mut vk::CommandBuffer);
    begin_command_buffer(buffer: vk::CommandBuffer, info: *const vk::CommandBufferBeginInfo<'_>);
    end_command_buffer(buffer: vk::CommandBuffer);
    queue_submit(queue: vk::Queue, count: u32, infos: *const vk::SubmitInfo<'_>, fence: vk::Fence);
    queue_wait_idle(queue: vk::Queue);
}
