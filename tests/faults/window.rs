//! What a window shows, drawn into an image: all of a window but its surface and swapchain.

use shadow_fields::bake::cache::Cache;
use shadow_fields::draw::{Antialias, Shading};
use shadow_fields::gpu::{Device, DeviceOptions, Image, ImageShape};
use shadow_fields::scene::{Lights, Scene};
use shadow_fields::shaders::Library;
use shadow_fields::view::{Command, Editor, FrameTarget, Setup, Viewer};
use shadow_fields::{Error, Result, bake, check, frame};
use std::path::Path;
use std::time::Duration;

const SIZE: [u32; 2] = [48, 32];
const FORMAT: ash::vk::Format = ash::vk::Format::R8G8B8A8_SRGB;

/// Draws a still scene with the overlay, edited, and without the overlay: `w.raw`. The scene's fields are in the cache.
pub fn run(folder: &Path) -> Result<()> {
    let cache_dir = folder.join("cache");
    let options = DeviceOptions { cache_dir: Some(cache_dir.clone()), ..DeviceOptions::default() };
    let device = Device::new(&options)?;
    let [width, height] = SIZE;
    let image = Image::new(&device, "window", ImageShape { format: FORMAT, width, height, samples: 1 })?;
    let lattice = "cube:2x3".parse().expect("a lattice");
    let frame = frame::Options {
        bake: bake::Options { lattice, face_px: 4, ..Default::default() },
        lights: Lights::Sharp,
        shading: Some(Shading::Vertex),
        size: SIZE,
        antialias: Antialias::Outlines,
        ..check::merge::options()
    };
    let setup = Setup {
        device: device.clone(),
        options,
        library: Library { shader_dir: None, cache_dir: Some(cache_dir.clone()) },
        cache: Cache::new(Some(&cache_dir)),
        frame,
        format: FORMAT,
        seed: 1,
        strict: false,
        refines: false,
        preview_after: Duration::from_secs(60),
    };
    let path = folder.join("scene.toml");
    let mut viewer = Viewer::new(setup, Editor::new(Scene::load(&path)?, &path), 1.0)?;
    viewer.apply(Command::Resize(SIZE))?;
    viewer.apply(Command::ToggleRunning)?;
    while viewer.is_baking() {
        std::thread::yield_now();
        viewer.update(0.0)?;
    }
    let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width as f32, height as f32));
    for command in [None, Some(Command::SetSky(0.5)), Some(Command::ToggleOverlay)] {
        command.map_or(Ok(()), |command| viewer.apply(command))?;
        viewer.update(0.0)?;
        let _ = viewer.ui(egui::RawInput { screen_rect: Some(screen), ..Default::default() })?;
        viewer.draw(FrameTarget::Image(&image))?;
    }
    viewer.settle()?;
    if viewer.frame.is_none() {
        return Err(Error::Failed(viewer.message().unwrap_or("no frame, and nothing is said of it").to_owned()));
    }
    let pixels: Vec<[u8; 4]> = image.download()?;
    drop(viewer);
    device.save_pipeline_cache();
    std::fs::write(folder.join("w.raw"), pixels.as_flattened()).map_err(|error| Error::Failed(error.to_string()))
}
