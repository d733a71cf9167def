//! The memory that a picture takes. It is compared with what the device and the host have before any work is done for
//! the picture.

use super::Options;
use crate::draw::Draw;
use crate::error::{Error, Result};
use crate::gpu::Device;
use std::fmt;

/// Bytes that the host holds for a pixel that it reads back: four halves, and three floats made of them.
const HOST_PIXEL_BYTES: u64 = 4 * 2 + 3 * 4;
/// Bytes for a pixel in the buffer that a picture is read back through.
pub(super) const READBACK_PIXEL_BYTES: u64 = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureMemory {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Bytes of its images and of the buffer that it is read back through.
    pub device: u64,
    /// Bytes that the host holds while it reads it back.
    pub host: u64,
    /// Whether the device's memory is the host's.
    pub shared: bool,
}

impl PictureMemory {
    /// For pictures that a frame with these options makes for files.
    pub fn new(device: &Device, options: &Options) -> Self {
        let pixels = u64::from(options.size[0]) * u64::from(options.size[1]);
        let pixel_bytes = Draw::pixel_bytes(device, options.antialias, options.shades_pixels()) + READBACK_PIXEL_BYTES;
        PictureMemory {
            size: options.size,
            device: pixels * pixel_bytes,
            host: pixels * HOST_PIXEL_BYTES,
            shared: device.info.is_software(),
        }
    }

    pub fn all(&self) -> u64 {
        self.device + self.host
    }

    /// Compares it with what the device and the host have.
    pub fn check(&self, device: &Device) -> Result<()> {
        self.fits(device.heap_bytes(), host_bytes())
    }

    /// Compares it with bytes of the device's largest heap and of the host; what is not known limits nothing.
    pub fn fits(&self, heap: u64, host: Option<u64>) -> Result<()> {
        let wanted = self.host + if self.shared { self.device } else { 0 };
        let has = match host {
            Some(host) if wanted > host => format!("the host has {} left", gigabytes(host)),
            _ if self.device > heap => format!("the device has {}", gigabytes(heap)),
            _ => return Ok(()),
        };
        Err(Error::Input(format!("{self}, but {has}")))
    }
}

impl fmt::Display for PictureMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        write!(f, "a picture of {width}x{height} pixels takes ")?;
        if self.shared {
            return write!(f, "{} of memory", gigabytes(self.all()));
        }
        write!(f, "{} on the device and {} on the host", gigabytes(self.device), gigabytes(self.host))
    }
}

fn gigabytes(bytes: u64) -> String {
    format!("{:.2} GB", bytes as f64 * 1e-9)
}

/// Bytes that this process can still take: what the system has free or can free, and what the limit on its address
/// space leaves. `None` where the system does not say.
fn host_bytes() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let number = |text: &str, key: &str| -> Option<u64> {
        let line = text.lines().find(|line| line.starts_with(key))?;
        line[key.len()..].split_whitespace().find_map(|word| word.parse().ok())
    };
    let system = read("/proc/meminfo");
    let free = number(&system, "MemAvailable:").map(|kib| 1024 * (kib + number(&system, "SwapFree:").unwrap_or(0)));
    let limits = read("/proc/self/limits");
    let taken = number(&read("/proc/self/status"), "VmSize:").unwrap_or(0) * 1024;
    // The soft limit comes first; "unlimited" is no number, and then neither is the hard limit below it.
    let soft = limits.lines().find_map(|line| line.strip_prefix("Max address space")?.split_whitespace().next());
    let left = soft.and_then(|bytes| bytes.parse::<u64>().ok()).map(|bytes| bytes.saturating_sub(taken));
    free.into_iter().chain(left).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_fits_or_is_refused_with_numbers() {
        let picture = PictureMemory { size: [4096, 2048], device: 600_000_000, host: 200_000_000, shared: false };
        assert!(picture.fits(600_000_000, Some(200_000_000)).is_ok());
        assert!(picture.fits(600_000_000, None).is_ok());
        let said = |picture: PictureMemory, heap, host| {
            let error = picture.fits(heap, host).unwrap_err();
            assert_eq!(error.exit_code(), 4);
            error.to_string()
        };
        let takes = "a picture of 4096x2048 pixels takes 0.60 GB on the device and 0.20 GB on the host";
        assert_eq!(said(picture, 500_000_000, None), format!("{takes}, but the device has 0.50 GB"));
        assert_eq!(said(picture, u64::MAX, Some(100_000_000)), format!("{takes}, but the host has 0.10 GB left"));
        let shared = PictureMemory { shared: true, ..picture };
        let takes = "a picture of 4096x2048 pixels takes 0.80 GB of memory";
        assert_eq!(said(shared, u64::MAX, Some(790_000_000)), format!("{takes}, but the host has 0.79 GB left"));
        assert!(shared.fits(600_000_000, Some(800_000_000)).is_ok());
    }
}
