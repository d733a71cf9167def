//! Surface and swapchain of a window; the swapchain is rebuilt when it no longer fits the window.

use super::device::{Device, DeviceOptions};
use super::flight::{FLIGHTS, Flight};
use super::image::{Image, ImageShape, encodes_srgb};
use super::owned::Owned;
use super::{Checked, Commands};
use crate::error::{Error, Result};
use ash::{khr, vk};
use clap::ValueEnum;
use raw_window_handle::{HasDisplayHandle, HasWindowHandle, RawDisplayHandle};
use std::ffi::CStr;
use std::sync::Arc;

/// When a finished frame is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PresentMode {
    /// At the display's next refresh, in order; every device supports it.
    #[default]
    Fifo,
    /// As FIFO, but a late frame is shown at once.
    FifoRelaxed,
    /// At the next refresh; a newer frame replaces one that waits.
    Mailbox,
    /// At once, with tearing.
    Immediate,
}

impl PresentMode {
    fn raw(self) -> vk::PresentModeKHR {
        match self {
            PresentMode::Fifo => vk::PresentModeKHR::FIFO,
            PresentMode::FifoRelaxed => vk::PresentModeKHR::FIFO_RELAXED,
            PresentMode::Mailbox => vk::PresentModeKHR::MAILBOX,
            PresentMode::Immediate => vk::PresentModeKHR::IMMEDIATE,
        }
    }
}

impl Device {
    /// As [`Device::new`], with the extensions that windows of a display need.
    pub fn for_display(options: &DeviceOptions, display: RawDisplayHandle) -> Result<Arc<Self>> {
        let names = ash_window::enumerate_required_extensions(display)
            .checked("surface extensions", "display")
            .map_err(|error| error.context("Vulkan opens no windows on this display"))?;
        // SAFETY: ash-window lists static strings.
        let names: Vec<&'static CStr> = names.iter().map(|name| unsafe { CStr::from_ptr(*name) }).collect();
        Self::with_extensions(options, &names, &[khr::swapchain::NAME])
    }
}

/// A window's Vulkan surface. It keeps the window alive.
struct WindowSurface {
    _device: Arc<Device>,
    loader: khr::surface::Instance,
    handle: vk::SurfaceKHR,
    /// Last: the window outlives its surface.
    _window: Box<dyn std::any::Any>,
}

impl WindowSurface {
    fn new<W: HasDisplayHandle + HasWindowHandle + 'static>(device: &Arc<Device>, window: &Arc<W>) -> Result<Self> {
        let gone = |error| Error::Unsupported(format!("the window cannot be drawn into: {error}"));
        let display = window.display_handle().map_err(gone)?.as_raw();
        let handle = window.window_handle().map_err(gone)?.as_raw();
        let instance = &device.instance.handle;
        let own = device.instance.own.as_ref();
        let entry = &own.ok_or_else(|| Error::Unsupported("a shared device opens no windows".into()))?.entry;
        let loader = khr::surface::Instance::new(entry, instance);
        // SAFETY: the handles are those of a live window, which this surface keeps alive; destroyed in `Drop`, before
        // the instance, which the device keeps alive.
        let handle = unsafe { ash_window::create_surface(entry, instance, display, handle, None) }
            .checked("vkCreateSurfaceKHR", "window")?;
        let surface = WindowSurface { _device: device.clone(), loader, handle, _window: Box::new(window.clone()) };
        // SAFETY: physical device and surface are alive.
        let supported = unsafe {
            surface.loader.get_physical_device_surface_support(device.physical, device.queue_family, surface.handle)
        }
        .checked("vkGetPhysicalDeviceSurfaceSupportKHR", "window")?;
        if !supported {
            return Err(Error::Unsupported(format!(
                "{} cannot draw into windows of this display; `shadow-fields render` needs none",
                device.info.name
            )));
        }
        Ok(surface)
    }
}

impl Drop for WindowSurface {
    fn drop(&mut self) {
        // SAFETY: its swapchain is gone (field order of `Window`).
        unsafe { self.loader.destroy_surface(self.handle, None) };
    }
}

fn semaphore(device: &Arc<Device>, name: &str) -> Result<Owned<vk::Semaphore>> {
    // SAFETY: destroyed by `Owned`.
    let handle = unsafe { device.handle.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }
        .checked("vkCreateSemaphore", name)?;
    Ok(Owned::new(device, name, handle, ash::Device::destroy_semaphore))
}

/// Owns a swapchain; its images keep it alive.
struct SwapchainHandle {
    device: Arc<Device>,
    loader: khr::swapchain::Device,
    handle: vk::SwapchainKHR,
}

impl SwapchainHandle {
    /// Waits until the queue has presented everything.
    fn settle(&self) {
        let queue = self.device.queue();
        // SAFETY: device and queue are alive; a lost device presents nothing.
        let _ = unsafe { self.device.handle.queue_wait_idle(*queue) };
    }
}

impl Drop for SwapchainHandle {
    fn drop(&mut self) {
        self.settle();
        // SAFETY: views of its images went before, and the queue is idle.
        unsafe { self.loader.destroy_swapchain(self.handle, None) };
    }
}

struct Swapchain {
    images: Vec<Arc<Image>>,
    /// Signalled when an image is drawn. There is one per image, because only acquiring the image again shows that its
    /// presentation has taken the semaphore.
    drawn: Vec<Owned<vk::Semaphore>>,
    handle: Arc<SwapchainHandle>,
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        // The semaphores are destroyed after this.
        self.handle.settle();
    }
}

/// An acquired image, which must be drawn into and presented.
pub struct Shot {
    /// The image; its content is undefined.
    pub image: Arc<Image>,
    index: u32,
    acquired: vk::Semaphore,
}

/// A window's surface and its current swapchain.
pub struct Window {
    device: Arc<Device>,
    /// Dropped before the surface.
    chain: Option<Swapchain>,
    /// Signalled when an image may be drawn into. There is one more than flights, since one image may be acquired
    /// ahead.
    acquired: Vec<Owned<vk::Semaphore>>,
    next: usize,
    format: vk::SurfaceFormatKHR,
    mode: PresentMode,
    size: [u32; 2],
    surface: WindowSurface,
}

impl Window {
    /// Prepares to draw into a window of `size` pixels.
    pub fn new<W: HasDisplayHandle + HasWindowHandle + 'static>(
        device: &Arc<Device>,
        window: &Arc<W>,
        size: [u32; 2],
        mode: PresentMode,
    ) -> Result<Self> {
        let surface = WindowSurface::new(device, window)?;
        // SAFETY: for both queries, physical device and surface are alive.
        let (modes, formats) = unsafe {
            (
                surface.loader.get_physical_device_surface_present_modes(device.physical, surface.handle),
                surface.loader.get_physical_device_surface_formats(device.physical, surface.handle),
            )
        };
        let modes = modes.checked("vkGetPhysicalDeviceSurfacePresentModesKHR", "window")?;
        let formats = formats.checked("vkGetPhysicalDeviceSurfaceFormatsKHR", "window")?;
        if !modes.contains(&mode.raw()) {
            let known = PresentMode::value_variants().iter().filter(|m| modes.contains(&m.raw()));
            let known: Vec<_> =
                known.filter_map(|mode| Some(mode.to_possible_value()?.get_name().to_owned())).collect();
            return Err(Error::Unsupported(format!(
                "this display does not support the present mode; it supports {}",
                known.join(", ")
            )));
        }
        let acquired = (0..=FLIGHTS).map(|_| semaphore(device, "acquired")).collect::<Result<_>>()?;
        Ok(Window {
            device: device.clone(),
            chain: None,
            acquired,
            next: 0,
            format: best_format(&formats)?,
            mode,
            size,
            surface,
        })
    }

    /// Format of the images. If it is not an sRGB format, shaders must encode colours.
    pub fn format(&self) -> vk::Format {
        self.format.format
    }

    /// Notes the window's size in pixels; the next frame rebuilds the swapchain. Nothing is shown while a side is 0.
    pub fn resize(&mut self, size: [u32; 2]) {
        if size != self.size {
            self.size = size;
            self.chain = None;
        }
    }

    /// Acquires the next image, after rebuilding the swapchain if it no longer fits the window. `None` if nothing can
    /// be shown, as in a minimised window.
    pub fn acquire(&mut self) -> Result<Option<Shot>> {
        // A window that is being resized may change again while its swapchain is built.
        for _ in 0..8 {
            if self.chain.is_none() && !self.rebuild()? {
                return Ok(None);
            }
            let chain = self.chain.as_ref().expect("made above");
            let swapchain = &chain.handle;
            let semaphore = self.acquired[self.next].handle;
            // SAFETY: the semaphore was waited for by a flight that has ended, since there are more of them than
            // flights.
            match unsafe {
                swapchain.loader.acquire_next_image(swapchain.handle, u64::MAX, semaphore, vk::Fence::null())
            } {
                // A suboptimal image is still drawn and shown; presenting it reports the same again.
                Ok((index, _suboptimal)) => {
                    self.next = (self.next + 1) % self.acquired.len();
                    let image = chain.images[index as usize].clone();
                    return Ok(Some(Shot { image, index, acquired: semaphore }));
                }
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.chain = None,
                Err(code) => return Err(code).checked("vkAcquireNextImageKHR", "window"),
            }
        }
        Ok(None)
    }

    /// Launches a recording that draws into the shot's image and leaves it as
    /// [`Access::Present`](super::Access::Present), and shows it. A swapchain that no longer fits is rebuilt by the
    /// next [`Window::acquire`]; if it fits so little that nothing is shown, the answer is false.
    pub fn present(&mut self, commands: Commands<'_>, shot: &Shot) -> Result<(Flight, bool)> {
        let chain = self.chain.as_ref().expect("a shot is presented before the window changes");
        assert!(Arc::ptr_eq(&chain.images[shot.index as usize], &shot.image), "a shot of another swapchain");
        let drawn = chain.drawn[shot.index as usize].handle;
        let flight = commands.end()?.launch(Some(shot.acquired), Some(drawn))?;
        let semaphores = [drawn];
        let swapchains = [chain.handle.handle];
        let indices = [shot.index];
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&semaphores).swapchains(&swapchains).image_indices(&indices);
        let queue = self.device.queue();
        // SAFETY: swapchain and semaphore are alive until the queue is idle (`Swapchain`); the queue is locked.
        let outcome = unsafe { chain.handle.loader.queue_present(*queue, &info) };
        drop(queue);
        let (fits, is_shown) = match outcome {
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => (false, false),
            other => (!other.checked("vkQueuePresentKHR", "window")?, true),
        };
        if !fits {
            self.chain = None;
        }
        Ok((flight, is_shown))
    }

    /// Rebuilds the swapchain; false if a side of the window is 0.
    fn rebuild(&mut self) -> Result<bool> {
        let surface = self.surface.handle;
        // SAFETY: physical device and surface are alive.
        let can =
            unsafe { self.surface.loader.get_physical_device_surface_capabilities(self.device.physical, surface) }
                .checked("vkGetPhysicalDeviceSurfaceCapabilitiesKHR", "window")?;
        let Some([width, height]) = extent(&can, self.size) else { return Ok(false) };
        let most = if can.max_image_count == 0 { u32::MAX } else { can.max_image_count };
        let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
        let alpha =
            if can.supported_composite_alpha.contains(opaque) { opaque } else { vk::CompositeAlphaFlagsKHR::INHERIT };
        let create = vk::SwapchainCreateInfoKHR::default()
            .surface(surface)
            // One image is shown, one waits and one is drawn.
            .min_image_count((can.min_image_count + 1).max(3).min(most))
            .image_format(self.format.format)
            .image_color_space(self.format.color_space)
            .image_extent(vk::Extent2D { width, height })
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::COLOR_ATTACHMENT)
            .pre_transform(can.current_transform)
            .composite_alpha(alpha)
            .present_mode(self.mode.raw())
            .clipped(true);
        let loader = khr::swapchain::Device::new(&self.device.instance.handle, &self.device.handle);
        // SAFETY: the surface is alive and has no other swapchain (`chain` is `None`); destroyed by `SwapchainHandle`.
        let handle = unsafe { loader.create_swapchain(&create, None) }.checked("vkCreateSwapchainKHR", "window")?;
        self.device.name(handle, "window");
        let handle = Arc::new(SwapchainHandle { device: self.device.clone(), loader, handle });
        // SAFETY: the swapchain is alive.
        let images = unsafe { handle.loader.get_swapchain_images(handle.handle) };
        let shape = ImageShape { format: self.format.format, width, height, samples: 1 };
        let image = |image| Ok(Arc::new(Image::of_swapchain(&self.device, handle.clone(), image, shape)?));
        let images: Vec<_> =
            images.checked("vkGetSwapchainImagesKHR", "window")?.into_iter().map(image).collect::<Result<_>>()?;
        let drawn = images.iter().map(|_| semaphore(&self.device, "drawn")).collect::<Result<_>>()?;
        log::info!("swapchain of {width}x{height}, {} images, {:?}", images.len(), self.format.format);
        self.chain = Some(Swapchain { images, drawn, handle });
        Ok(true)
    }
}

impl Drop for Window {
    fn drop(&mut self) {
        self.device.settle(); // the semaphores are destroyed after this
        self.chain = None;
    }
}

/// The swapchain's size in pixels: the surface's, or if it has none, the window's clamped to the surface's bounds.
/// `None` if a side is 0.
fn extent(can: &vk::SurfaceCapabilitiesKHR, size: [u32; 2]) -> Option<[u32; 2]> {
    let least = can.min_image_extent;
    let most = can.max_image_extent;
    let own = can.current_extent;
    let [width, height] = if own.width == u32::MAX { size } else { [own.width, own.height] };
    if width == 0 || height == 0 || size.contains(&0) || most.width == 0 || most.height == 0 {
        return None;
    }
    Some([width.clamp(least.width, most.width), height.clamp(least.height, most.height)])
}

/// An sRGB format if there is one, because the device then encodes and blends linearly; else an 8-bit format that the
/// shader encodes for.
fn best_format(formats: &[vk::SurfaceFormatKHR]) -> Result<vk::SurfaceFormatKHR> {
    let plain = |f: &vk::SurfaceFormatKHR| matches!(f.format, vk::Format::B8G8R8A8_UNORM | vk::Format::R8G8B8A8_UNORM);
    let shown = || formats.iter().filter(|f| f.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR);
    let found = shown().find(|f| encodes_srgb(f.format)).or_else(|| shown().find(|f| plain(f)));
    found.copied().ok_or_else(|| Error::Unsupported("this display has no 8-bit sRGB colours".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_without_pixels_has_no_swapchain() {
        let most = vk::Extent2D { width: 4096, height: 4096 };
        let own = |width, height| vk::SurfaceCapabilitiesKHR {
            current_extent: vk::Extent2D { width, height },
            max_image_extent: most,
            ..Default::default()
        };
        assert_eq!(extent(&own(640, 480), [1, 1]), Some([640, 480]), "the surface's own size wins");
        assert_eq!(
            extent(&own(u32::MAX, u32::MAX), [800, 9000]),
            Some([800, 4096]),
            "the window's size is clamped to the surface's bounds"
        );
        assert_eq!(extent(&own(0, 0), [640, 480]), None);
        assert_eq!(extent(&own(640, 480), [0, 0]), None, "minimised");
    }
}
