//! Parameters of a swapchain: present mode, size and format.

use super::image::encodes_srgb;
use crate::error::{Error, Result};
use ash::vk;
use clap::ValueEnum;

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
    /// Its name on the command line.
    pub(super) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    pub(super) fn raw(self) -> vk::PresentModeKHR {
        match self {
            PresentMode::Fifo => vk::PresentModeKHR::FIFO,
            PresentMode::FifoRelaxed => vk::PresentModeKHR::FIFO_RELAXED,
            PresentMode::Mailbox => vk::PresentModeKHR::MAILBOX,
            PresentMode::Immediate => vk::PresentModeKHR::IMMEDIATE,
        }
    }
}

/// The swapchain's size in pixels: the surface's, or if it has none, the window's clamped to the surface's bounds.
/// `None` if a side is 0.
pub(super) fn extent(can: &vk::SurfaceCapabilitiesKHR, size: [u32; 2]) -> Option<[u32; 2]> {
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
pub(super) fn best_format(formats: &[vk::SurfaceFormatKHR]) -> Result<vk::SurfaceFormatKHR> {
    let plain = |f: &vk::SurfaceFormatKHR| matches!(f.format, vk::Format::B8G8R8A8_UNORM | vk::Format::R8G8B8A8_UNORM);
    let shown = || formats.iter().filter(|f| f.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR);
    let found = shown().find(|f| encodes_srgb(f.format)).or_else(|| shown().find(|f| plain(f)));
    found.copied().ok_or_else(|| Error::Unsupported("this display has no 8-bit sRGB colours".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn present_modes_go_by_name() {
        for (name, mode) in [
            ("fifo", PresentMode::Fifo),
            ("fifo-relaxed", PresentMode::FifoRelaxed),
            ("mailbox", PresentMode::Mailbox),
            ("immediate", PresentMode::Immediate),
        ] {
            assert_eq!(PresentMode::from_str(name, false), Ok(mode));
            assert_eq!(mode.name(), name);
        }
        assert!(PresentMode::from_str("vsync", false).is_err());
    }

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

    #[test]
    fn srgb_before_plain_before_none() {
        let of = |format| vk::SurfaceFormatKHR { format, color_space: vk::ColorSpaceKHR::SRGB_NONLINEAR };
        let plain = of(vk::Format::B8G8R8A8_UNORM);
        let srgb = of(vk::Format::B8G8R8A8_SRGB);
        assert_eq!(best_format(&[plain, srgb]).unwrap().format, srgb.format);
        assert_eq!(best_format(&[plain]).unwrap().format, plain.format);
        assert_eq!(best_format(&[of(vk::Format::R5G6B5_UNORM_PACK16)]).unwrap_err().exit_code(), 3);
    }
}
