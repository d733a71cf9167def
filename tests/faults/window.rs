//! What a window shows, drawn into an image: all of a window but its surface.

use shadow_fields::bake::cache::Cache;
use shadow_fields::draw::{Antialias, Shading};
use shadow_fields::gpu::{Access, Buffer, BufferKind, Commands, Device, DeviceOptions, Image, ImageShape};
use shadow_fields::scene::{Lights, Scene};
use shadow_fields::shaders::Library;
use shadow_fields::view::command::Command;
use shadow_fields::view::{Editor, FrameTarget, Setup, Viewer};
use shadow_fields::{Error, Result, bake, check, frame};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

pub const SIZE: [u32; 2] = [48, 32];
const FORMAT: ash::vk::Format = ash::vk::Format::R8G8B8A8_SRGB;

/// Draws frames of a scene that is edited, with the overlay, and writes the last as `w.raw`.
pub fn run(folder: &Path) -> Result<()> {
    let options = device_options(folder);
    let device = Device::new(&options)?;
    let [width, height] = SIZE;
    let image = Image::new(&device, "window", ImageShape { format: FORMAT, width, height, samples: 1 })?;
    let mut viewer = viewer(folder, device.clone(), options, FORMAT)?;
    show(&mut viewer, &mut |viewer| viewer.draw(FrameTarget::Image(&image)))?;
    let pixels = look(&device, &image)?;
    drop(viewer);
    device.save_pipeline_cache();
    std::fs::write(folder.join("w.raw"), pixels).map_err(|error| Error::Failed(error.to_string()))
}

pub fn device_options(folder: &Path) -> DeviceOptions {
    DeviceOptions { cache_dir: Some(folder.join("cache")), ..DeviceOptions::default() }
}

/// A viewer of the folder's scene that draws into targets of that format.
pub fn viewer(folder: &Path, device: Arc<Device>, options: DeviceOptions, format: ash::vk::Format) -> Result<Viewer> {
    let cache_dir = folder.join("cache");
    let path = folder.join("scene.toml");
    let setup = Setup {
        device,
        options,
        library: Library { shader_dir: None, cache_dir: Some(cache_dir.clone()) },
        cache: Cache::new(Some(&cache_dir)),
        frame: frame_options(),
        format,
        seed: 1,
        strict: false,
        refines: false,
        preview_after: Duration::from_secs(60),
    };
    let editor = Editor::new(Scene::load(&path)?, &path);
    let mut viewer = Viewer::new(setup, editor, 1.0)?;
    viewer.apply(Command::Resize(SIZE))?;
    viewer.apply(Command::ToggleRunning)?;
    while viewer.is_baking() {
        std::thread::yield_now();
        viewer.update(0.0)?;
    }
    Ok(viewer)
}

/// Shows a still scene, then the same edited, then without the overlay. `draw` is called until it answers that a frame
/// is seen.
pub fn show(viewer: &mut Viewer, draw: &mut dyn FnMut(&mut Viewer) -> Result<bool>) -> Result<()> {
    let [width, height] = SIZE.map(|side| side as f32);
    let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height));
    let mut turn = |viewer: &mut Viewer| {
        viewer.update(0.0)?;
        let _ = viewer.ui(egui::RawInput { screen_rect: Some(screen), ..Default::default() })?;
        draw(viewer)
    };
    for command in [None, Some(Command::SetSky(0.5)), Some(Command::ToggleOverlay)] {
        command.map_or(Ok(()), |command| viewer.apply(command))?;
        for turns in 0.. {
            assert!(turns < 100, "the window never comes to rest");
            if turn(viewer)? {
                break;
            }
        }
    }
    viewer.settle()?;
    match viewer.frame() {
        Some(_) => Ok(()),
        None => Err(Error::Failed(viewer.message().unwrap_or("no frame, and nothing is said of it").to_owned())),
    }
}

fn frame_options() -> frame::Options {
    let lattice = "cube:2x3".parse().expect("a lattice");
    frame::Options {
        bake: bake::Options { lattice, face_px: 4, ..Default::default() },
        lights: Lights::Sharp,
        shading: Some(Shading::Vertex),
        size: SIZE,
        antialias: Antialias::Outlines,
        ..check::merge::options()
    }
}

fn look(device: &Arc<Device>, image: &Image) -> Result<Vec<u8>> {
    let bytes = 4 * SIZE[0] * SIZE[1];
    let host = Buffer::new(device, "window on the host", BufferKind::Readback, bytes.into())?;
    let mut commands = Commands::new(device, "look")?;
    commands.copy_image(image, &host);
    commands.barrier(Access::TransferWrite, Access::HostRead);
    commands.submit()?;
    Ok(host.read(0, bytes as usize))
}
